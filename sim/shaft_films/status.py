"""How the search for the equilibrium of shaft and films ended, with the cure."""

from typing import Self

from ..output.status import Ending


class ShaftFilmStatus(Ending):
    """How the search for the equilibrium ended. Every status except OK includes a cure."""

    OK = 0, "done"
    OVERLOAD = (
        1,
        "the film cannot carry the bearing's load with a gap that the mesh resolves; lower the "
        "bearing, or raise the viscosity, the speed or the length",
    )
    EDGE_CONTACT = (
        2,
        "the journal touches the edge of the bore; bring the slope of the bore nearer to that of "
        "the shaft, lower the bearing, or raise the viscosity or the speed",
    )
    NO_ROOM = (
        3,
        "the shaft bends so far that the journal touches both ends of the bore; bring the slope of "
        "the bore nearer to that of the shaft, or raise the clearance",
    )
    NO_CONVERGENCE = (
        4,
        "beam and films found no equilibrium; give a start closer to it, refine the "
        "mesh, or lower a groove's feed pressure that outweighs the load",
    )
    COARSE = (
        5,
        "the film is too thin for the mesh, so the result is inaccurate; raise n_theta or the "
        "number of refinements, or lower the load",
    )


class ShaftFilmError(RuntimeError):
    """No equilibrium of a shaft on its films was found, and the caller asked for an error."""

    def __init__(self, status: ShaftFilmStatus, bearing: str) -> None:
        self.status = status
        self.bearing = bearing
        super().__init__(f"bearing '{bearing}': {status.name.lower()}: {status.text}")

    def __reduce__(self) -> tuple[type[Self], tuple[ShaftFilmStatus, str]]:
        """How it leaves a worker process."""
        return type(self), (self.status, self.bearing)
