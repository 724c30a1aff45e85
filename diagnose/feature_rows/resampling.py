"""Resampling of recordings."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from ...sim.output.recording import Recording

_MOST_PARTS = 1000  # largest denominator of a ratio of rates: accurate to a millionth


def at_rate(recording: Recording, rate: float) -> Recording:
    """A recording at a lower sample rate.

    Parameters
    ----------
    recording : Recording
    rate : float
        [Hz]

    Returns
    -------
    Recording
        Unchanged if its rate is not higher.

    Examples
    --------
    >>> from wearstate.sim.output.sensor import Channel
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> wave = np.sin(np.arange(4800.0) / 100)
    >>> fast = Recording(signal=wave[np.newaxis], sample_rate=48_000.0, channels=(channel,))
    >>> slow = at_rate(fast, 25_600.0)
    >>> slow.sample_rate, slow.signal.shape
    (25600.0, (1, 2560))
    """
    if recording.sample_rate <= rate:
        return recording
    return replace(resampled(recording, recording.sample_rate / rate), sample_rate=rate)


def resampled(recording: Recording, ratio: float) -> Recording:
    """The recording at its own rate, as if its samples had been taken faster.

    Parameters
    ----------
    recording : Recording
    ratio : float
        True over stated sample rate.

    Returns
    -------
    Recording
        Vibration is filtered before decimation; the tacho is interpolated, because a filter would
        ring at its edges.
    """
    from scipy.signal import resample_poly

    part = Fraction(ratio).limit_denominator(_MOST_PARTS)
    up, down = part.denominator, part.numerator
    signal = resample_poly(recording.signal, up, down, axis=1, padtype="line")
    if recording.tacho is not None:
        row = recording.names.index(recording.tacho)
        place = np.arange(signal.shape[1]) * ratio
        signal[row] = np.interp(place, np.arange(recording.signal.shape[1]), recording.signal[row])
    return replace(recording, signal=signal)
