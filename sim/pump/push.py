"""What shakers and hammers do to the casing of a pump, running or at rest.

Their forces are made at the rate of the steps and go the way of all others through the casing; the
force cell reads them through the filter that the accelerations pass.
"""

import numpy as np
from numpy.typing import NDArray

from ..casing.decimation import decimate
from ..excitation.forces import Push, exciter_push, read_cell
from ..scene.pump import FORCE_PLACES, PumpScene


def casing_pushes(
    scene: PumpScene, *, n_steps: int, first: int, last: int, factor: int, seed: int
) -> tuple[Push, ...]:
    """Forces of the mounted exciters through a run.

    Parameters
    ----------
    scene : PumpScene
    n_steps : int
        Of the run.
    first, last : int
        Steps between which it is recorded; a steady force is there before and after.
    factor : int
        Steps per sample.
    seed : int
        Of the recording.

    Returns
    -------
    tuple of Push
        Of `n_steps` samples each.
    """
    return tuple(
        exciter_push(
            part,
            n_samples=last - first,
            sample_rate=scene.sample_rate * factor,
            seed=seed,
            index=index,
            lead=first,
            tail=n_steps - last,
        )
        for index, part in enumerate(scene.exciters)
        if part.mounted
    )


def pushed_places(scene: PumpScene) -> tuple[str, ...]:
    """Keys of the places of all mounted exciters, as the casing knows them."""
    return tuple(pushed_place(scene, part.place) for part in scene.mounted_exciters)


def pushed_place(scene: PumpScene, place: str) -> str:
    """Key under which the casing knows a place: a measured one counts throws."""
    if scene.casing.frf is not None and place in FORCE_PLACES:
        return f"{place}_1"
    return place


def read_cells(
    scene: PumpScene,
    pushes: tuple[Push, ...],
    factor: int,
    kept: slice,
    rng: np.random.Generator,
) -> tuple[list[NDArray[np.float32]], int]:
    """Channels of the force cells, and how many samples were clipped."""
    rows, clipped = [], 0
    for part, push in zip(scene.mounted_exciters, pushes, strict=True):
        force = decimate(push.cell[:, None], factor)[kept, 0]
        row, lost = read_cell(part, force, rng)
        rows.append(row)
        clipped += lost
    return rows, clipped
