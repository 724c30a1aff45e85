"""How the machine of a scene is shown."""

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
"""Type of scene -> how its machine is shown; a machine without a row is shown plainly."""


def presentation_of(scene: Scene) -> Presentation:
    """How the machine of a scene is shown.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> presentation_of(load_scene("shaft-rig")).sizes
    ('propeller.blades',)
    """
    return PRESENTATIONS.get(type(scene), Presentation())
