"""Condition monitoring built around physics.

``wearstate`` simulates machines whose joints and bearings wear, turns simulated or measured
signals into features, and estimates the wear state with an interval it can defend.

The public names below load on first use, so that ``import wearstate`` stays cheap::

    recording = wearstate.simulate("bilge-pump")
    names, values = wearstate.feature_row(recording)
"""

from importlib import import_module

TYPE_CHECKING = False  # not from typing: with -m, a typing.py of the current folder would be run
if TYPE_CHECKING:
    from typing import Any

    from .datasets.file.record import DataSet as DataSet
    from .datasets.generation.generate import generate as generate
    from .datasets.generation.simulate import simulate as simulate
    from .datasets.measured.data_set import import_recordings as import_recordings
    from .datasets.measured.recording import read_recording as read_recording
    from .datasets.source.part import SourceOptions as SourceOptions
    from .diagnose.wear_model.estimate import ModelError as ModelError
    from .diagnose.wear_model.file import load_model as load_model
    from .features.catalogue.row import feature_row as feature_row
    from .sim.output.recording import DataError as DataError
    from .sim.output.recording import Recording as Recording
    from .sim.output.sensor import Channel as Channel
    from .sim.output.status import SimulationError as SimulationError
    from .sim.scene.load import load_scene as load_scene
    from .sim.scene.load import scene_names as scene_names
    from .sim.scene.parts import Scene as Scene
    from .sim.scene.parts import SceneError as SceneError

__version__ = "0.1.0"

_HOMES = {
    "Channel": ".sim.output.sensor",
    "DataError": ".sim.output.recording",
    "DataSet": ".datasets.file.record",
    "ModelError": ".diagnose.wear_model.estimate",
    "Recording": ".sim.output.recording",
    "Scene": ".sim.scene.parts",
    "SceneError": ".sim.scene.parts",
    "SimulationError": ".sim.output.status",
    "SourceOptions": ".datasets.source.part",
    "feature_row": ".features.catalogue.row",
    "generate": ".datasets.generation.generate",
    "import_recordings": ".datasets.measured.data_set",
    "load_model": ".diagnose.wear_model.file",
    "load_scene": ".sim.scene.load",
    "read_recording": ".datasets.measured.recording",
    "scene_names": ".sim.scene.load",
    "simulate": ".datasets.generation.simulate",
}
"""Public name -> module that defines it; the block above tells type checkers the same."""

__all__ = ["__version__", *_HOMES]

if not TYPE_CHECKING:  # a type checker would take it that there is every name

    def __getattr__(name: str) -> "Any":
        """Import the public name on first use."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name], __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
