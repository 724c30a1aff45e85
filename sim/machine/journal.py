"""The journal bearing's physics, as registered for the program."""

from typing import cast

from ..journal.ladder import FILM_LADDER, journal_cost, journal_effects
from ..journal.recording import check_journal, simulate_journal
from ..journal.validity import journal_step
from ..scene.journal import JournalScene
from ..scene.scene import Scene
from .registry import MachinePhysics


def _step(scene: Scene) -> float:
    return journal_step(cast(JournalScene, scene))


MACHINE = MachinePhysics(
    scene=JournalScene,
    simulate=simulate_journal,
    check=check_journal,
    ladders={"film": FILM_LADDER},
    effects=journal_effects,
    cost=journal_cost,
    step=_step,
)
