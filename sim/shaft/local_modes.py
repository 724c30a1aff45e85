"""Local vibration of the part of a housing that an accelerometer sits on.

A scene's housing is one mass on its pedestal. A real one has webs, caps and covers with their own
modes, from twice the pedestal's frequency on; they are too light to act back.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ..scene.shaft_parts import LocalMode

Float = NDArray[np.float64]

_SETTLED = math.log(1e4)
"""Time constants after which a motion from rest has settled to 1e-4."""


def local_acceleration(
    acceleration: Float, modes: Sequence[LocalMode], sample_rate: float
) -> Float:
    """Acceleration under a sensor, from that of its housing.

    Parameters
    ----------
    acceleration : numpy.ndarray [shape=(n_samples,)]
        Acceleration of the housing [m/s^2].
    modes : sequence of LocalMode
        Modes of the part that the sensor sits on.
    sample_rate : float
        Sampling rate [Hz].

    Returns
    -------
    numpy.ndarray [shape=(n_samples,)]
        Acceleration under the sensor [m/s^2].

    Notes
    -----
    Within a housing of acceleration a, a light part moves by

        z'' + 2 zeta w z' + w^2 z = -a,

    and the sensor measures ``a + share z''`` of each: a far below w, ``1 - share`` of a far
    above. Exact at every frequency. The time before the recording is replaced by its
    reflection, long enough for the mode to settle: the first moments then have another
    past of the same level.

    Examples
    --------
    >>> shake = np.cos(2 * np.pi * 50 * np.arange(2000) / 1000)
    >>> cap = LocalMode(frequency=100.0, damping_ratio=0.05, share=0.3)
    >>> heard = local_acceleration(shake, [cap], 1000.0)
    >>> round(float(heard[500:1500].max()), 2)  # 1 + 0.3 / (2^2 - 1)
    1.1
    """
    active = [mode for mode in modes if mode.share != 0]
    if not active:
        return acceleration
    slowest = min(math.tau * mode.frequency * mode.damping_ratio for mode in active)
    lead = min(math.ceil(_SETTLED / slowest * sample_rate), len(acceleration) - 1)
    longer = np.pad(acceleration, lead, mode="reflect")
    hertz = fft.rfftfreq(len(longer), 1 / sample_rate)
    gain = 1 + sum(mode.share * _relative(mode, hertz) for mode in active)
    heard = fft.irfft(gain * fft.rfft(longer), len(longer))
    return np.asarray(heard[lead : lead + len(acceleration)], dtype=np.float64)


def _relative(mode: LocalMode, hertz: Float) -> NDArray[np.complex128]:
    """Acceleration of a part relative to its housing, over that of the housing."""
    own, drag = mode.frequency**2, 2j * mode.damping_ratio * mode.frequency
    return np.asarray(hertz**2 / (own - hertz**2 + drag * hertz), dtype=np.complex128)
