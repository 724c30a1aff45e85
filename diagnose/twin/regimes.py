"""Whether recordings resemble an oiled crank pin although the pin of the scene is dry.

The levels of a dry pin with another contact law and those of an oiled pin overlap: a recording of
one is no misfit of the other. Therefore some machines of the scene are simulated with oil, and a
linear discriminant, as in the inversion, distinguishes the two kinds. The evidence is the rank of
its value among those of the scene's own machines, each left out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...datasets.draws.options import Alternatives
from ...datasets.recipe.load import load_recipe
from ...sim.scene.pump import PumpScene
from .ensemble import simulated
from .inversion import standard
from .levels import LevelLayout
from .misfit import LEAST_P, LEAST_REGIME_P, OILED, Misfit, far_better, misfit, tail_share
from .regression import regressed
from .unknowns import TwinUnknowns

Float = NDArray[np.float64]

LUBRICATION, DRY = "lubrication", "dry"
"""Choice of that recipe, and its option in the scene."""
PER_MEMBER = 0.5
"""Machines with oil per member of the first ensemble."""
FEWEST = 10
"""Fewest machines with oil for a comparison."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OiledMembers:
    """Machines of the scene with an oiled crank pin.

    Attributes
    ----------
    levels : ndarray [shape=(n, n_runs, n_levels)]
        [dB]
    names : tuple of str
        Lubrications.
    labels : ndarray [shape=(n, n_names)]
        1 for the lubrication of each member, 0 for the others.
    """

    levels: Float
    names: tuple[str, ...]
    labels: Float


def oiled_unknowns(unknowns: TwinUnknowns) -> TwinUnknowns | None:
    """Unknowns with oil in the crank pin; None if it is not dry or the recipe varies its oil.

    The oil is that of the built-in recipe: a film of 50 mm, whatever the pin.
    """
    plan = unknowns.recipe
    scene = plan.scene
    dry = isinstance(scene, PumpScene) and scene.joint.crankpin.rung == "compliant"
    if not dry or LUBRICATION in [each.name for each in plan.choices]:
        return None
    oil = _without_dry(next(c for c in load_recipe(OILED).choices if c.name == LUBRICATION))
    return replace(
        unknowns,
        recipe=replace(plan, choices=(*plan.choices, oil)),
        kept=(*unknowns.kept, *oil.coordinates),
    )


def _without_dry(choice: Alternatives) -> Alternatives:
    wet = [each for each in choice.options if each.name != DRY]
    total = sum(each.share for each in wet)
    return replace(choice, options=tuple(replace(w, share=w.share / total) for w in wet))


def oiled_members(
    unknowns: TwinUnknowns | None,
    count: int,
    runs: Sequence[Mapping[str, float]],
    *,
    seed: int,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> OiledMembers | None:
    """Simulate machines with oil; None if there are none, or too few run.

    Parameters
    ----------
    unknowns : TwinUnknowns or None
        From :func:`oiled_unknowns`.
    count, runs, seed, jobs, progress
        As in :func:`~.ensemble.simulated`.
    """
    if unknowns is None:
        return None
    drawn = standard(len(unknowns.names)).draw(count, np.random.default_rng(seed))
    scores, levels = simulated(unknowns, drawn, runs, seed=seed, jobs=jobs, progress=progress)
    if len(scores) < FEWEST:
        return None
    taken = [unknowns.options(row)[f"choice_{LUBRICATION}"] for row in scores]
    names = tuple(sorted(set(taken)))
    labels = np.array([[float(each == name) for name in names] for each in taken])
    return OiledMembers(levels=levels, names=names, labels=labels)


def with_regime(
    found: Misfit, layout: LevelLayout, rows: Float, observed: Float, oiled: OiledMembers | None
) -> Misfit:
    """Add to a misfit the lubrication that recordings resemble more than the scene's.

    Parameters
    ----------
    found : Misfit
        Misfit of the same recordings.
    layout : LevelLayout
    rows : ndarray [shape=(n, n_runs, n_levels)]
        Levels of the scene's machines [dB].
    observed : ndarray [shape=(n_runs, n_levels)]
        Levels of the recordings [dB].
    oiled : OiledMembers or None
        None: no comparison.
    """
    if oiled is None or found.order:
        return found
    p, name = regime(layout, rows, observed, oiled)
    # recordings that fit neither dry nor oiled pins are from another machine
    fits = found.p >= LEAST_P or far_better(misfit(layout, oiled.levels, observed), found)
    return replace(found, regime=name, regime_p=p) if p < LEAST_REGIME_P and fits else found


def regime(
    layout: LevelLayout, rows: Float, observed: Float, oiled: OiledMembers
) -> tuple[float, str]:
    """Share of the scene's machines that appear as oiled, and the likeliest lubrication."""
    labels = np.concatenate([np.zeros((len(rows), len(oiled.names))), oiled.labels])
    every = np.concatenate([rows, oiled.levels, observed[np.newaxis]])
    found = regressed(labels, layout.levels_of(every).reshape(len(every), -1))
    left_out = (labels - found.residuals)[: len(rows)].sum(axis=1)
    likeliest = oiled.names[int(np.argmax(found.mean))]
    return tail_share(left_out, float(found.mean.sum())), likeliest
