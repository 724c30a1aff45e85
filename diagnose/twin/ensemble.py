"""Simulated members of a twin's ensemble under the conditions of the recordings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...datasets.workers.local import in_order
from ...sim.machine.simulate import simulate
from ...sim.output.status import Status
from ...sim.scene.parts import SceneError
from .levels import levels_of
from .unknowns import TwinUnknowns

Float = NDArray[np.float64]

REVOLUTIONS = 4.3
"""Length of a simulated member [rev]. Levels of twenty revolutions differ from those of four by
the scatter of the noise alone, as the mechanism repeats itself."""
SETTLING = 1
"""Revolutions before: the contact forgets its start within one."""


@dataclass(frozen=True)
class Member:
    """One machine to simulate.

    Attributes
    ----------
    scores : ndarray [shape=(n_names,)]
        Normal scores of the unknowns.
    seed : int
        Of the sensor noise.
    """

    scores: Float
    seed: int


def simulated(
    unknowns: TwinUnknowns,
    scores: Float,
    runs: Sequence[Mapping[str, float]],
    *,
    seed: int,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Float, Float]:
    """Levels of every member under every run; members that do not run are left out.

    Parameters
    ----------
    unknowns : TwinUnknowns
    scores : ndarray [shape=(n_members, n_names)]
    runs : sequence of mapping
        Dotted path -> condition [SI], ``drive.speed`` among them.
    seed : int
        Of the sensor noise; member `i` takes ``seed + i``.
    jobs : int
        Worker processes; the result is the same for any number.
    progress : callable, optional
        Called with (members done, members).

    Returns
    -------
    scores : ndarray [shape=(n_kept, n_names)]
    levels : ndarray [shape=(n_kept, n_runs, n_levels)]
        In decibels.
    """
    members = [Member(row, seed + i) for i, row in enumerate(scores)]
    work = partial(_levels, unknowns, runs)
    found = []
    for number, levels in enumerate(in_order(work, members, jobs=jobs), 1):
        found.append(levels)
        if progress is not None:
            progress(number, len(members))
    kept = [i for i, levels in enumerate(found) if levels is not None]
    return scores[kept], np.array([found[i] for i in kept])


def _levels(
    unknowns: TwinUnknowns, runs: Sequence[Mapping[str, float]], member: Member
) -> Float | None:
    rows = []
    for run in runs:
        short = {"duration": REVOLUTIONS / run["drive.speed"], "settling_revolutions": SETTLING}
        try:
            scene = unknowns.scene(member.scores, {**run, **short})
            recording = simulate(scene, seed=member.seed, raise_on_failure=False)
        except SceneError:  # a step that a stiff contact does not allow
            return None
        if recording.status is not Status.OK:
            return None
        rows.append(levels_of(recording))
    return np.array(rows)
