"""Registry of presentations."""

from ...sim.scene.journal import JournalScene
from ...sim.scene.pump import PumpScene
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from . import journal, pump, shaft
from .presentation import Presentation

PRESENTATIONS: dict[type[Scene], Presentation] = {
    PumpScene: pump.PRESENTATION,
    JournalScene: journal.PRESENTATION,
    ShaftScene: shaft.PRESENTATION,
}
"""Type of scene -> presentation; a machine without a row uses the default."""


def presentation_of(scene: Scene) -> Presentation:
    """Presentation of the machine of a scene.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> presentation_of(load_scene("shaft-rig")).sizes
    ('propeller.blades',)
    """
    return PRESENTATIONS.get(type(scene), Presentation())
