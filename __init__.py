"""Condition monitoring built around physics.

``wearstate`` simulates machines whose joints and bearings wear, turns simulated or measured
signals into features, and estimates the wear state with an interval it can defend.

The public names and modules below load on first use, so that ``import wearstate`` stays cheap::

    recording = wearstate.simulate("bilge-pump")
    names, values = wearstate.feature_row(recording)
    wearstate.features.spectrum(recording).plot()
"""

from importlib import import_module

TYPE_CHECKING = False  # not from typing: with -m, a typing.py of the current folder would be run
if TYPE_CHECKING:
    from typing import Any

    from . import align as align
    from . import contact as contact
    from . import crank as crank
    from . import features as features
    from . import film as film
    from . import shaft as shaft
    from .datasets.file.record import DataSet as DataSet
    from .datasets.generation.generate import generate as generate
    from .datasets.generation.simulate import simulate as simulate
    from .datasets.measured.data_set import import_recordings as import_recordings
    from .datasets.measured.recording import read_recording as read_recording
    from .datasets.source.part import SourceOptions as SourceOptions
    from .diagnose.class_model.file import load_class_model as load_class_model
    from .diagnose.class_model.file import save_class_model as save_class_model
    from .diagnose.class_model.train import ClassModel as ClassModel
    from .diagnose.twin.calibration import CalibratedScene as CalibratedScene
    from .diagnose.twin.calibration import MisfitError as MisfitError
    from .diagnose.twin.calibration import calibrate as calibrate
    from .diagnose.wear_model.bundle import ModelError as ModelError
    from .diagnose.wear_model.estimate import WearModel as WearModel
    from .diagnose.wear_model.file import load_model as load_model
    from .diagnose.wear_model.file import save_model as save_model
    from .diagnose.wear_model.verdict import Estimate as Estimate
    from .diagnose.workflow.evaluate import Evaluation as Evaluation
    from .diagnose.workflow.evaluate import evaluate as evaluate
    from .diagnose.workflow.report import Report as Report
    from .diagnose.workflow.report import report as report
    from .diagnose.workflow.train import train as train
    from .diagnose.workflow.train import train_classes as train_classes
    from .features.catalogue.row import feature_row as feature_row
    from .sim.output.recording import DataError as DataError
    from .sim.output.recording import Recording as Recording
    from .sim.output.sensor import Channel as Channel
    from .sim.output.status import SimulationError as SimulationError
    from .sim.scene.load import load_scene as load_scene
    from .sim.scene.load import scene_names as scene_names
    from .sim.scene.scene import Scene as Scene
    from .sim.scene.scene import SceneError as SceneError

__version__ = "0.1.0"

_MODULES = ("align", "contact", "crank", "features", "film", "shaft")
"""Public modules, each with an ``__all__``."""

_HOMES = {
    "CalibratedScene": ".diagnose.twin.calibration",
    "Channel": ".sim.output.sensor",
    "ClassModel": ".diagnose.class_model.train",
    "DataError": ".sim.output.recording",
    "DataSet": ".datasets.file.record",
    "Estimate": ".diagnose.wear_model.verdict",
    "Evaluation": ".diagnose.workflow.evaluate",
    "MisfitError": ".diagnose.twin.calibration",
    "ModelError": ".diagnose.wear_model.bundle",
    "Recording": ".sim.output.recording",
    "Report": ".diagnose.workflow.report",
    "Scene": ".sim.scene.scene",
    "SceneError": ".sim.scene.scene",
    "SimulationError": ".sim.output.status",
    "SourceOptions": ".datasets.source.part",
    "WearModel": ".diagnose.wear_model.estimate",
    "calibrate": ".diagnose.twin.calibration",
    "evaluate": ".diagnose.workflow.evaluate",
    "feature_row": ".features.catalogue.row",
    "generate": ".datasets.generation.generate",
    "import_recordings": ".datasets.measured.data_set",
    "load_class_model": ".diagnose.class_model.file",
    "load_model": ".diagnose.wear_model.file",
    "load_scene": ".sim.scene.load",
    "read_recording": ".datasets.measured.recording",
    "report": ".diagnose.workflow.report",
    "save_class_model": ".diagnose.class_model.file",
    "save_model": ".diagnose.wear_model.file",
    "scene_names": ".sim.scene.load",
    "simulate": ".datasets.generation.simulate",
    "train": ".diagnose.workflow.train",
    "train_classes": ".diagnose.workflow.train",
}
"""Public name -> module that defines it; repeats the block above, which is for type checkers."""

__all__ = ["__version__", *_MODULES, *_HOMES]

if not TYPE_CHECKING:  # a type checker would assume that every name exists

    def __getattr__(name: str) -> "Any":
        """Import the public name on first use."""
        if name in _MODULES:
            return import_module(f".{name}", __name__)
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name], __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
