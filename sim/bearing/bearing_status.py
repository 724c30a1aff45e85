"""How the search for an equilibrium of a journal bearing ends."""

from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..output.status import Ending

Vector = NDArray[np.float64]


class BearingStatus(Ending):
    """How the search for an equilibrium ended. Every status except OK includes a cure."""

    OK = 0, "done"
    OVERLOAD = (
        1,
        "the film cannot carry this load with a gap that the mesh resolves; lower the load or the "
        "tilt, or raise the viscosity, the speed or the length",
    )
    NO_CONVERGENCE = (
        2,
        "no equilibrium was found; lower a groove's feed pressure that outweighs the load, choose "
        "condition = 'periodic', refine n_theta and n_z, or give a start closer to it",
    )
    NO_ROOM = (
        3,
        "the tilted journal touches the bore in every position; lower the tilt below 2 C from end "
        "to end",
    )
    COARSE = (
        4,
        "the film at the equilibrium is too thin for the mesh, so its position is inaccurate; "
        "raise n_theta, or lower the load",
    )


class BearingError(RuntimeError):
    """No equilibrium was found, and the caller asked for an error in that case."""

    def __init__(self, status: BearingStatus, where: str) -> None:
        self.status = status
        self.where = where
        super().__init__(f"{where}: {status.name.lower()}: {status.text}")

    def __reduce__(self) -> tuple[type[Self], tuple[BearingStatus, str]]:
        """How it leaves a worker process."""
        return type(self), (self.status, self.where)
