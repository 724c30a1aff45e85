"""Forces of shakers and hammers on the casing of a pump, running or at rest.

They are generated at the rate of the steps and pass through the casing like all other forces; the
force cell reads them through the same filter as the accelerations.
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
        Number of steps of the run.
    first, last : int
        First and last recorded step; a steady force acts before and after as well.
    factor : int
        Steps per sample.
    seed : int
        Seed of the recording.

    Returns
    -------
    tuple of Push
        One force of `n_steps` samples per exciter.
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
    """Keys of the places of all mounted exciters in the casing."""
    return tuple(pushed_place(scene, part.place) for part in scene.mounted_exciters)


def pushed_place(scene: PumpScene, place: str) -> str:
    """Key of a place in the casing: in a measured one, places include the throw."""
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
    """Channels of the force cells, and the number of clipped samples."""
    rows, clipped = [], 0
    for part, push in zip(scene.mounted_exciters, pushes, strict=True):
        force = decimate(push.cell[:, None], factor)[kept, 0]
        row, lost = read_cell(part, force, rng)
        rows.append(row)
        clipped += lost
    return rows, clipped
