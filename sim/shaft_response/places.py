"""Coordinates of a rotor by name, and checks of arguments.

A place is the index of a coordinate, or an argument of :meth:`.Rotor.dof`: ``("stern", "y")`` or
``("stern", "y", "housing")``, which distinguishes a housing's displacement from that of the shaft
in its bearing.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..beam.rotor import Rotor

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]
Place = int | tuple[str | float, str] | tuple[str | float, str, str]


def dofs(rotor: Rotor, places: Sequence[Place]) -> Index:
    """Indices of the coordinates; raises ValueError for an unknown place."""
    return np.array([_dof(rotor, place) for place in places], dtype=np.int64)


def _dof(rotor: Rotor, place: Place) -> int:
    if isinstance(place, tuple):
        return rotor.dof(*place)
    n = rotor.mass.shape[0]
    if not isinstance(place, (int, np.integer)) or not 0 <= place < n:
        raise ValueError(
            f"coordinate = {place!r} must be from 0 to {n - 1}, or a pair like ('stern', 'y')"
        )
    return int(place)


def checked_frequencies(frequencies: ArrayLike) -> Vector:
    """Check that frequencies are one row of finite numbers [Hz]; raises ValueError."""
    hertz = np.asarray(frequencies, dtype=float)
    if hertz.ndim != 1 or not np.isfinite(hertz).all():
        raise ValueError(
            f"frequencies of shape {hertz.shape} must be one row of finite numbers [Hz]"
        )
    return hertz


def checked_speed(speed: ArrayLike) -> Vector:
    """Check that speeds are finite [rad/s]; raises ValueError."""
    turning = np.asarray(speed, dtype=float)
    if not np.isfinite(turning).all():
        raise ValueError(f"speed = {speed!r} rad/s must be finite")
    return turning
