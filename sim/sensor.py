"""What an accelerometer, a tacho and a converter do to a signal."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One row of a signal: what it is, in which unit, from where.

    Attributes
    ----------
    name, unit, quantity : str
        The unit is that of the numbers; the quantity is ``acceleration``, ``tacho``, ….
    place, direction : str
        For the report.
    unit_in_file : str
        What a measured file declared before conversion; empty for a simulated channel.
    """

    name: str
    unit: str
    quantity: str
    place: str = ""
    direction: str = ""
    unit_in_file: str = ""

    @property
    def label(self) -> str:
        """Name and unit, for people: ``acc [m/s^2]``, or ``gs [m/s^2, g in the file]``."""
        converted = self.unit_in_file not in ("", self.unit)
        return f"{self.name} [{self.unit}{f', {self.unit_in_file} in the file' * converted}]"


def digitise(
    acceleration: NDArray[np.float64],
    *,
    gain: float,
    noise: float,
    full_scale: float,
    bits: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], int]:
    """Pass an acceleration through an accelerometer and its converter.

    Parameters
    ----------
    acceleration : numpy.ndarray [shape=(n_samples,)]
        True acceleration of the housing [m/s^2], already band-limited.
    gain : float
        True sensitivity over the nominal one.
    noise : float
        rms of white Gaussian noise [m/s^2], added before the converter.
    full_scale : float
        The converter saturates at plus and minus this [m/s^2].
    bits : int
        Word length; the step is ``2 * full_scale / 2**bits``.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    signal : numpy.ndarray [shape=(n_samples,)]
        float32 [m/s^2].
    clipped : int
        Number of saturated samples; a caller must not lose it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> digitise(np.array([0.0, 30.0]), gain=1.0, noise=0.0, full_scale=20.0, bits=16, rng=rng)
    (array([ 0., 20.], dtype=float32), 1)
    """
    signal = gain * acceleration
    if noise > 0:
        signal = signal + noise * rng.standard_normal(signal.shape)
    step = 2 * full_scale / 2**bits
    clipped = int(np.count_nonzero(np.abs(signal) > full_scale))
    rounded = np.round(np.clip(signal, -full_scale, full_scale) / step) * step
    return rounded.astype(np.float32), clipped


def tacho_pulses(
    revolutions: NDArray[np.float64], *, pulse_width: float, level: float
) -> NDArray[np.float32]:
    """Rectangular tacho pulses, rising at every whole revolution.

    Each sample holds the mean over the interval from the sample before to itself, so that a
    reader can interpolate an edge to a fraction of a sample.

    Parameters
    ----------
    revolutions : numpy.ndarray [shape=(n_samples,)]
        Shaft angle in revolutions at each sample, rising.
    pulse_width : float
        [rev]
    level : float
        Height of a pulse [V].

    Returns
    -------
    numpy.ndarray [shape=(n_samples,)]
        float32 [V].

    Examples
    --------
    >>> tacho_pulses(np.array([-0.1, 0.1, 0.3]), pulse_width=0.5, level=4.0)
    array([2., 2., 4.], dtype=float32)
    """
    # integral of the pulse train over angle: whole pulses passed, and the part of the present one
    whole = np.floor(revolutions)
    area = whole * pulse_width + np.minimum(revolutions - whole, pulse_width)
    mean = np.diff(area) / np.diff(revolutions)
    return (level * np.concatenate([mean[:1], mean])).astype(np.float32)
