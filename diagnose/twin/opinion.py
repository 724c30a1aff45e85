"""Clearance of a new recording by the twin of its machine, without a trained model.

The inversion of the calibration is repeated with the wear unknown over its whole range and every
other number as uncertain as after the calibration.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from ...datasets.draws.twin import Twin, TwinTable
from ...datasets.recipe.load import load_recipe
from ...datasets.recipe.recipe import Recipe
from ...datasets.recipe.text import RecipeError, beside, twin_path
from ...sim.output.recording import DataError, Recording
from ...sim.scene.load import scene_table
from ...sim.scene.scene import SceneError, validate_table
from .calibration import conditions_of, refuse_channels
from .inversion import Gaussian, inverted
from .levels import layout_of, levels_of
from .misfit import Misfit, misfit
from .unknowns import WEAR, TwinUnknowns, unknowns_of

OPINION_ROUNDS = (120, 90)
"""Members of the rounds: over all wear, then around the result of the first."""
OPINION_WIDENED = (1.6, 1.6)
"""Widening for the second round: the machine itself is already known."""
COVERAGE = 0.9
"""Nominal coverage of the interval."""


@dataclass(frozen=True, kw_only=True)
class TwinOpinion:
    """Estimate of a twin for a recording, from :func:`second_opinion`.

    Attributes
    ----------
    reason : str
        Why there is no estimate; empty if there is one.
    severity, low, high : float or None
        Wear and its interval [m].
    coverage : float
        Nominal coverage of the interval.
    p : float
        P-value of the recording among the machines that the twin considers possible.
    members : int
        Number of simulated machines.
    scene : str
        Calibrated scene.
    column : str
        Manifest column of the wear.
    """

    reason: str = ""
    severity: float | None = None
    low: float | None = None
    high: float | None = None
    coverage: float = COVERAGE
    p: float = 1.0
    members: int = 0
    scene: str = ""
    column: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Estimate for JSON."""
        return asdict(self)


def second_opinion(
    twin: str | Path,
    recording: Recording,
    *,
    wear: str | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> TwinOpinion:
    """Estimate the wear of a recording by the twin of its machine.

    Parameters
    ----------
    twin : str or Path
        Calibrated scene, or its ``.twin.toml``, from ``wearstate calibrate``.
    recording : Recording
        Recording of this machine, with a tacho.
    wear : str, optional
        Manifest column of the requested wear, checked against that of the twin.
    seed : int
        Seed of draws and sensor noise, >= 0.
    progress : callable, optional
        Called with (machines simulated, all).

    Raises
    ------
    DataError
        The twin cannot be read, or is for another wear.

    Notes
    -----
    A recording without tacho or with other channels than the scene gets a reason and no estimate.
    """
    table, folder = read_twin(twin)
    plan = plan_of(table, folder, recording.sample_rate)
    column = plan.severities[0].column
    if wear not in (None, column):
        raise DataError(
            f"twin: wear = {column} must be {wear}, as for the model; leave the twin out"
        )
    source: dict[str, Any] = {"scene": table.scene, "column": column}
    try:
        refuse_channels(plan, [recording])
        layout, observed = layout_of(recording), levels_of(recording)[np.newaxis]
    except DataError as error:
        return TwinOpinion(reason=str(error), **source)
    unknowns = unknowns_of(plan, plan.severity.extremes(), table.unknown)
    seen: list[Misfit] = []
    found = inverted(
        unknowns,
        layout,
        observed,
        [conditions_of(plan, recording)],
        prior=prior_of(table, unknowns),
        rounds=OPINION_ROUNDS,
        wider=OPINION_WIDENED,
        seed=seed,
        progress=progress,
        check=lambda rows: seen.append(misfit(layout, rows, observed)),
    )
    severity, low, high = interval_of(found.posterior, unknowns)
    return TwinOpinion(
        severity=severity, low=low, high=high, p=seen[0].p, members=found.members, **source
    )


def interval_of(posterior: Gaussian, unknowns: TwinUnknowns) -> tuple[float, float, float]:
    """Median of the wear and ends of its interval [m]."""
    place = unknowns.names.index(WEAR)
    half = NormalDist().inv_cdf((1 + COVERAGE) / 2) * posterior.sd[place]
    scores = np.zeros((3, len(unknowns.names)))
    scores[:, place] = posterior.mean[place] + np.array([0.0, -half, half])
    severity, low, high = unknowns.numbers(WEAR, scores).tolist()
    return severity, low, high


def prior_of(table: TwinTable, unknowns: TwinUnknowns) -> Gaussian:
    """Prior of a machine before a recording: its twin, completed by the recipe."""
    names = list(unknowns.names)
    lost = sorted(set(table.names) - set(names))
    if lost:
        raise DataError(
            f"twin: {', '.join(lost[:3])} ({len(lost)} in all) must be drawn by the recipe; "
            "calibrate again"
        )
    places = [names.index(name) for name in table.names]
    mean, covariance = np.zeros(len(names)), np.eye(len(names))
    mean[places] = table.mean
    covariance[np.ix_(places, places)] = Twin(table).covariance
    return Gaussian(mean=mean, covariance=covariance)


def read_twin(twin: str | Path) -> tuple[TwinTable, Path]:
    """Table of a twin, and its folder.

    Raises
    ------
    DataError
        There is no such file, or it is not a twin.
    """
    place = twin_path(twin)
    try:
        text = place.read_text(encoding="utf-8")
        return validate_table(TwinTable, scene_table(text, str(place)), str(place)), place.parent
    except (OSError, ValueError) as error:
        fault = error if isinstance(error, SceneError) else f"{place} cannot be read ({error})"
        raise DataError(f"twin: {fault}; make it: wearstate calibrate") from None


def plan_of(table: TwinTable, folder: Path, sample_rate: float) -> Recipe:
    """The recipe around the calibrated scene, at a sample rate [Hz]."""
    if not table.recipe or not table.base:
        raise DataError("twin: recipe and base are missing, needed to simulate it; calibrate again")
    recipe, base = (beside(folder, name) for name in (table.recipe, table.base))
    try:
        return load_recipe(recipe, {"sample_rate": sample_rate}, scene=base)
    except RecipeError as error:
        raise DataError(f"twin of {table.base} by {table.recipe}: {error}") from None
