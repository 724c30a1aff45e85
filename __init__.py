"""Condition monitoring built around physics.

``wearstate`` simulates machines whose joints and bearings wear, turns simulated or measured
signals into features, and estimates the wear state with an interval it can defend.

The few public names below load lazily, so that ``import wearstate`` stays cheap::

    scene = wearstate.load_scene("bilge-pump")
    result = wearstate.simulate(scene, seed=1)
"""

from importlib import import_module

TYPE_CHECKING = False  # not from typing: with -m, a typing.py of the current folder would be run
if TYPE_CHECKING:
    from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "Scene": ".sim.scene.load",
    "load_scene": ".sim.scene.load",
    "simulate": ".sim.machine.simulate",
    "feature_row": ".features.catalogue.row",
    "DataSet": ".datasets.file.record",
    "generate": ".datasets.generation.generate",
    "read_recording": ".datasets.measured.recording",
    "import_recordings": ".datasets.measured.data_set",
    "SourceOptions": ".datasets.readers.open",
    "load_model": ".diagnose.wear_model.file",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> "Any":
    """Import the public name on first use."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name], __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
