"""Deep check of any scene: figures of its machine and a short run, compared with usual values."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

from ..scene.journal import JournalScene
from ..scene.plausibility import Doubt, scene_doubts
from ..scene.pump import PumpScene
from ..scene.scene import Scene
from ..scene.shaft import ShaftScene
from .journal import JOURNAL_ROWS, journal_facts
from .pump import PUMP_ROWS
from .pump_figures import pump_facts
from .rows import RECORDING, Figure, Quantity, figures, plain_facts
from .shaft import SHAFT_ROWS, shaft_facts


@dataclass(frozen=True, kw_only=True)
class DeepCheck:
    """Result of a deep check.

    Attributes
    ----------
    figures : tuple of Figure
        In the order of the machine's table.
    failure : str
        Why the short run failed, with the cure; "" if it did not.
    warnings : tuple of str
        Warnings of the scene and its run that no figure covers.
    turns : float
        Revolutions of the run.
    """

    figures: tuple[Figure, ...]
    failure: str
    warnings: tuple[str, ...]
    turns: float

    @property
    def unusual(self) -> tuple[Figure, ...]:
        """Figures outside of the usual range."""
        return tuple(figure for figure in self.figures if not figure.usual)


_TABLES: dict[type[Scene], tuple[Callable[[Any], Any], Sequence[Quantity]]] = {
    PumpScene: (pump_facts, PUMP_ROWS),
    JournalScene: (journal_facts, JOURNAL_ROWS),
    ShaftScene: (shaft_facts, SHAFT_ROWS),
}
"""Facts and table of every machine with its own figures."""


def deep_check(scene: Scene) -> DeepCheck:
    """Compare all figures of a scene with usual values.

    Parameters
    ----------
    scene : Scene
        A valid scene, see :func:`wearstate.sim.machine.simulate.check`. Its rungs are used as
        written, also with fidelity "auto".

    Returns
    -------
    DeepCheck

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = deep_check(load_scene("journal-bearing"))
    >>> found.unusual, found.failure
    ((), '')
    """
    gather, table = _TABLES.get(type(scene), (plain_facts, RECORDING))
    facts = gather(scene)
    rows = figures(table, facts)
    covered = {row.quantity.doubt for row in rows if row.quantity.doubt and not row.usual}
    all_doubts: tuple[Doubt, ...] = (*scene_doubts(scene), *facts.trial.doubts)
    doubts = [doubt for doubt in all_doubts if doubt.check not in covered]
    status = facts.trial.solution.status
    return DeepCheck(
        figures=rows,
        failure="" if status.ok else f"{status.name.lower()}: {status.text}",
        warnings=(*(doubt.text for doubt in doubts), *_uncovered(facts.trial.warnings, covered)),
        turns=facts.trial.scene.duration * facts.trial.scene.drive.speed,
    )


def _uncovered(warnings: Sequence[str], covered: Collection[str]) -> list[str]:
    """Warnings of a run that no unusual figure covers."""
    return [text for text in warnings if not any(words in text for words in covered)]
