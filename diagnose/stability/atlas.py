"""All maps of a scene under one time budget, its own methods first.

The order is: row and column of the scene in the panels of its own methods, with the distance to the
next failure; then the whole planes of these panels; then the methods that the scene does not use.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ...sim.parts.wording import nearest
from ...sim.scene.scene import Scene, SceneError
from .edges import with_edges
from .maps import MAPS
from .method_map import Budget, MapPlan, StabilityMap, Verdict, measure, unmeasured

Progress = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class _Stage:
    """A stage of the work on all maps.

    Attributes
    ----------
    secondary : bool or None
        Which maps it covers: False for methods of the scene, True for others, None for all.
    own : bool
        Only the panel of the scene's own method.
    cross : bool
        Only row and column of the scene, and the edges in them.
    """

    secondary: bool | None
    own: bool
    cross: bool

    def covers(self, plan: MapPlan) -> bool:
        """Whether the stage applies to a map."""
        return self.secondary in (None, plan.secondary) and (plan.own is not None or not self.own)

    def methods(self, plan: MapPlan) -> list[str]:
        """Methods whose panels are run."""
        return [plan.own.method] if self.own and plan.own else list(plan.judges)

    def done(self, found: StabilityMap) -> bool:
        """Whether all cells of the stage have been run."""
        cells = found.plan.cross if self.cross else None
        return all(
            all(codes[c] != Verdict.NOT_RUN for c in cells) if cells is not None else codes.all()
            for codes in (found.verdicts[name] for name in self.methods(found.plan))
        )

    def run(self, found: StabilityMap, budget: Budget, progress: Progress | None) -> StabilityMap:
        """Run the cells of the stage in a map, within the budget."""
        plan = found.plan
        cells = plan.cross if self.cross else None
        found = measure(
            plan, budget, progress, begun=found, methods=self.methods(plan), cells=cells
        )
        return with_edges(found, budget) if self.cross else found


_STAGES = (
    _Stage(secondary=False, own=True, cross=True),
    _Stage(secondary=True, own=True, cross=True),
    _Stage(secondary=False, own=True, cross=False),
    _Stage(secondary=None, own=False, cross=False),
)
"""Stages in the order in which they receive the budget."""


def atlas(
    scene: Scene,
    *,
    name: str | None = None,
    budget: float | None = None,
    size: int | None = None,
    progress: Progress | None = None,
) -> tuple[StabilityMap, ...]:
    """All maps of a scene, or one of them.

    Parameters
    ----------
    scene : Scene
    name : str, optional
        Name of a map of this machine.
    budget : float, optional
        Total time [s]. It goes to the scene's own row and column first, then to its own methods,
        then to the others. At each stage every map gets an equal share of the remaining time, and
        unfinished maps use what the others leave.
    size : int, optional
        Cells along either axis; each map has its own default.
    progress : callable, optional
        Called with (done, all) of the running map.

    Returns
    -------
    tuple of StabilityMap
        Maps with the edges around the scene.

    Raises
    ------
    SceneError
        The machine has no such map, or the map does not apply to the scene.
    """
    makers = MAPS.get(scene.machine, {})
    if not makers:
        fault = (
            f"machine = '{scene.machine}' has no stability maps, must be one of {', '.join(MAPS)}"
        )
        raise SceneError(scene.name, [f"{fault}; see wearstate scene list"])
    if name is not None and name not in makers:
        raise SceneError(
            scene.name, [f"map = '{name}' is unknown for a {scene.machine}{nearest(name, makers)}"]
        )
    end = None if budget is None else time.monotonic() + budget
    plans = _plans(scene, [name] if name is not None else list(makers), size)
    found = {plan.name: unmeasured(plan) for plan in plans}
    for stage in _STAGES:
        for _ in range(2):
            _spend(stage, found, end, progress)
    left = None if end is None else end - time.monotonic()
    return tuple(_completed(each, Budget(left)) for each in found.values())


def _completed(found: StabilityMap, budget: Budget) -> StabilityMap:
    """Determine the edges again if not all cells up to them had been run."""
    sought = bool(found.edges) and all(edge.whole for edge in found.edges)
    return found if sought else with_edges(found, budget)


def _spend(
    stage: _Stage, found: dict[str, StabilityMap], end: float | None, progress: Progress | None
) -> None:
    """One round of a stage: an equal share of the remaining time for every unfinished map."""
    waiting = [
        name for name, each in found.items() if stage.covers(each.plan) and not stage.done(each)
    ]
    for place, name in enumerate(waiting):
        share = None if end is None else (end - time.monotonic()) / (len(waiting) - place)
        found[name] = stage.run(found[name], Budget(share), progress)


def _plans(scene: Scene, names: Sequence[str], size: int | None) -> list[MapPlan]:
    """Plans of the maps that apply to the scene; raise if the only one does not."""
    plans = []
    for name in names:
        plan = MAPS[scene.machine][name](scene, size)
        if isinstance(plan, MapPlan):
            plans.append(plan)
        elif len(names) == 1:
            raise SceneError(scene.name, [f"map = '{name}': {plan}"])
    return plans
