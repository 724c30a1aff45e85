"""Simulated members of a twin's ensemble under the conditions of the recordings."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from ...datasets.workers.local import in_order
from ...sim.machine.simulate import simulate_many
from ...sim.output.recording import Recording
from ...sim.output.status import Status
from ...sim.scene.scene import Scene, SceneError
from .levels import levels_of
from .unknowns import TwinUnknowns

Float = NDArray[np.float64]

REVOLUTIONS = 4.3
"""Length of a simulated member [rev]. Levels of twenty revolutions differ from those of four only
by the scatter of the noise, because the mechanism repeats itself."""
SETTLING = 1
"""Settling revolutions: the contact forgets its initial state within one."""

_TOGETHER = 48  # members that a worker simulates side by side


@dataclass(frozen=True)
class Member:
    """One machine to be simulated.

    Attributes
    ----------
    scores : ndarray [shape=(n_names,)]
        Normal scores of the unknowns.
    seed : int
        Seed of the sensor noise.
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
    """Levels of every member in every run; members that fail are left out.

    Parameters
    ----------
    unknowns : TwinUnknowns
    scores : ndarray [shape=(n_members, n_names)]
    runs : sequence of mapping
        Dotted path -> condition [SI], including ``drive.speed``.
    seed : int
        Seed of the sensor noise; member `i` uses ``seed + i``.
    jobs : int
        Worker processes; the result is the same for any number.
    progress : callable, optional
        Called with (members done, members).

    Returns
    -------
    scores : ndarray [shape=(n_kept, n_names)]
    levels : ndarray [shape=(n_kept, n_runs, n_levels)]
        Levels [dB].
    """
    members = [Member(row, seed + i) for i, row in enumerate(scores)]
    work = partial(_levels, unknowns, runs)
    batches = [members[first : first + _TOGETHER] for first in range(0, len(members), _TOGETHER)]
    found: list[Float | None] = []
    for number, levels in enumerate(chain.from_iterable(in_order(work, batches, jobs=jobs)), 1):
        found.append(levels)
        if progress is not None:
            progress(number, len(members))
    kept = [i for i, levels in enumerate(found) if levels is not None]
    return scores[kept], np.array([found[i] for i in kept])


def _levels(
    unknowns: TwinUnknowns, runs: Sequence[Mapping[str, float]], members: Sequence[Member]
) -> list[Float | None]:
    """Levels of each member [shape=(n_runs, n_levels)], None if it fails."""
    jobs: list[tuple[Scene, int]] = []
    owners: list[tuple[int, int]] = []
    levels: list[list[Float | None]] = [[None] * len(runs) for _ in members]
    for i, member in enumerate(members):
        for j, run in enumerate(runs):
            short = {"duration": REVOLUTIONS / run["drive.speed"], "settling_revolutions": SETTLING}
            with suppress(SceneError):  # numbers that the scene rejects
                jobs.append((unknowns.scene(member.scores, {**run, **short}), member.seed))
                owners.append((i, j))
    for number, found in simulate_many(jobs):
        i, j = owners[number]
        if isinstance(found, Recording) and found.status is Status.OK:
            levels[i][j] = levels_of(found)
    return [_whole(rows) for rows in levels]


def _whole(rows: Sequence[Float | None]) -> Float | None:
    found = [row for row in rows if row is not None]
    return np.array(found) if len(found) == len(rows) else None
