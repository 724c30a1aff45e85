"""Transfer functions from places of forces to sensors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class SceneTransfer:
    """Accelerance from places of forces to accelerometers.

    Attributes
    ----------
    frequency : ndarray, shape (n_lines,)
        Frequencies [Hz].
    sensors, places : tuple of str
    values : ndarray, shape (n_sensors, n_places, n_lines)
        Accelerance, complex, ``exp(+j w t)`` [(m/s^2)/N].
    """

    frequency: NDArray[np.float64]
    sensors: tuple[str, ...]
    places: tuple[str, ...]
    values: NDArray[np.complex128]
