"""Deep check of any scene: every figure of its machine beside what is usual, a short run too."""

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
    """What a deep check has found.

    Attributes
    ----------
    figures : tuple of Figure
        In the order of the machine's table.
    failure : str
        Why the short run failed, with the cure; "" where it did not.
    warnings : tuple of str
        Of the scene and of its run, those that no figure tells already.
    turns : float
        Revolutions that were run.
    """

    figures: tuple[Figure, ...]
    failure: str
    warnings: tuple[str, ...]
    turns: float

    @property
    def unusual(self) -> tuple[Figure, ...]:
        """Figures outside of what is usual."""
        return tuple(figure for figure in self.figures if not figure.usual)


_TABLES: dict[type[Scene], tuple[Callable[[Any], Any], Sequence[Quantity]]] = {
    PumpScene: (pump_facts, PUMP_ROWS),
    JournalScene: (journal_facts, JOURNAL_ROWS),
    ShaftScene: (shaft_facts, SHAFT_ROWS),
}
"""Facts and table of every machine with figures of its own."""


def deep_check(scene: Scene) -> DeepCheck:
    """Every figure of a scene beside what is usual.

    Parameters
    ----------
    scene : Scene
        Without faults, see :func:`wearstate.sim.machine.simulate.check`. Its rungs are taken as
        written, also where its fidelity is "auto".

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
    told = {row.quantity.doubt for row in rows if row.quantity.doubt and not row.usual}
    all_doubts: tuple[Doubt, ...] = (*scene_doubts(scene), *facts.trial.doubts)
    doubts = [doubt for doubt in all_doubts if doubt.check not in told]
    status = facts.trial.solution.status
    return DeepCheck(
        figures=rows,
        failure="" if status.ok else f"{status.name.lower()}: {status.text}",
        warnings=(*(doubt.text for doubt in doubts), *_untold(facts.trial.warnings, told)),
        turns=facts.trial.scene.duration * facts.trial.scene.drive.speed,
    )


def _untold(warnings: Sequence[str], told: Collection[str]) -> list[str]:
    """Warnings of a run that no unusual figure tells already."""
    return [text for text in warnings if not any(words in text for words in told)]
