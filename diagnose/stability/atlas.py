"""All maps of a scene under one budget: what the scene is computed with comes first.

First row and column of the scene in the panels of its own methods, and how far the next failure
is; then the planes of these panels; then the methods that it is not computed with.
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
    """A share of the work on all maps.

    Attributes
    ----------
    aside : bool or None
        Maps that it is for: of the scene's own physics, of others, or all.
    own : bool
        Only the panel of the scene's own method.
    cross : bool
        Only row and column of the scene, and the edges in them.
    """

    aside: bool | None
    own: bool
    cross: bool

    def covers(self, plan: MapPlan) -> bool:
        """Whether it has anything to do in a map."""
        return self.aside in (None, plan.aside) and (plan.own is not None or not self.own)

    def methods(self, plan: MapPlan) -> list[str]:
        """Panels."""
        return [plan.own.method] if self.own and plan.own else list(plan.judges)

    def done(self, found: StabilityMap) -> bool:
        """Whether none of its cells is left."""
        cells = found.plan.cross if self.cross else None
        return all(
            all(codes[c] != Verdict.NOT_RUN for c in cells) if cells is not None else codes.all()
            for codes in (found.verdicts[name] for name in self.methods(found.plan))
        )

    def run(self, found: StabilityMap, budget: Budget, progress: Progress | None) -> StabilityMap:
        """Its cells of a map, as far as the budget goes."""
        plan = found.plan
        cells = plan.cross if self.cross else None
        found = measure(
            plan, budget, progress, begun=found, methods=self.methods(plan), cells=cells
        )
        return with_edges(found, budget) if self.cross else found


_STAGES = (
    _Stage(aside=False, own=True, cross=True),
    _Stage(aside=True, own=True, cross=True),
    _Stage(aside=False, own=True, cross=False),
    _Stage(aside=None, own=False, cross=False),
)
"""In the order in which the budget goes to them."""


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
        Of a map of this machine.
    budget : float, optional
        Seconds in all. It goes to the scene's own row and column first, then to its own methods,
        then to the others; at each stage every map gets an even share of what is left, and those
        that it cuts short go on with what the others leave.
    size : int, optional
        Cells along either axis; each map has its own.
    progress : callable, optional
        ``(done, all)`` of the map that runs.

    Returns
    -------
    tuple of StabilityMap
        With the edges about the scene.

    Raises
    ------
    SceneError
        The machine has no such map, or the scene nothing to draw in it.
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
    """Edges again where the way to one of them was not run when they were sought."""
    sought = bool(found.edges) and all(edge.whole for edge in found.edges)
    return found if sought else with_edges(found, budget)


def _spend(
    stage: _Stage, found: dict[str, StabilityMap], end: float | None, progress: Progress | None
) -> None:
    """One round of a stage: an even share of what is left for every map that is not done."""
    waiting = [
        name for name, each in found.items() if stage.covers(each.plan) and not stage.done(each)
    ]
    for place, name in enumerate(waiting):
        share = None if end is None else (end - time.monotonic()) / (len(waiting) - place)
        found[name] = stage.run(found[name], Budget(share), progress)


def _plans(scene: Scene, names: Sequence[str], size: int | None) -> list[MapPlan]:
    """Those that the scene has something to draw in; of one alone, its refusal is an error."""
    plans = []
    for name in names:
        plan = MAPS[scene.machine][name](scene, size)
        if isinstance(plan, MapPlan):
            plans.append(plan)
        elif len(names) == 1:
            raise SceneError(scene.name, [f"map = '{name}': {plan}"])
    return plans
