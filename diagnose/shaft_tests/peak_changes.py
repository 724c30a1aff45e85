"""Peaks of transfer functions before and after: significant changes of their levels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks
from scipy.special import stdtr, stdtrit

from ...features.response.frf import Frf, level_deviation
from .rig_setup import TINY, RigError
from .rig_test import RigTest

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_SEARCH_SHARE = 0.1  # largest shift of a peak by alignment, relative to its frequency
_DEVIATIONS = 8.0  # height of a peak: the range of some hundred values is 6 deviations
_SMOOTHED = 5  # lines averaged to find a peak
_CHANCE = 1e-6  # probability of a peak's coherence if force and response are unrelated
_CONFIDENCE = 0.95  # of the intervals of a change

PROMINENCE_DB = 3.0  # a factor of two in power


@dataclass(frozen=True, kw_only=True)
class PeakChange:
    """Change of one peak of one channel.

    Attributes
    ----------
    channel : str
    frequency_before, frequency_after : float
        [Hz]
    level_before, level_after : float
        [dB re 1 (m/s^2)/N]
    change : float
        Measured level after minus before [dB].
    interval : tuple of float
        Confidence interval of the change, for this peak alone [dB].
    p_value : float
        P-value of no change, adjusted for the number of peaks (Holm) [-].
    coherence_before, coherence_after : float
        Coherence at the peak [-].
    model_change : float
        True change, from the peaks of the model before and after [dB].
    verdict : str
        ``suppressed`` or ``amplified`` if the change is significant, else ``unchanged``.
    """

    channel: str
    frequency_before: float
    frequency_after: float
    level_before: float
    level_after: float
    change: float
    interval: tuple[float, float]
    p_value: float
    coherence_before: float
    coherence_after: float
    model_change: float
    verdict: str

    @property
    def scatter(self) -> float:
        """Half the width of the interval [dB]."""
        return (self.interval[1] - self.interval[0]) / 2

    @property
    def expected(self) -> bool:
        """Whether the true change exceeds the scatter: about half of all tests then show it."""
        return abs(self.model_change) > self.scatter


def find_frf_peaks(frf: Frf, *, prominence: float = PROMINENCE_DB) -> tuple[NDArray[np.intp], ...]:
    """Peaks of the magnitude that exceed their surroundings and their scatter.

    Parameters
    ----------
    frf : Frf
    prominence : float
        Smallest height over the higher of the two adjacent valleys, > 0 [dB].

    Returns
    -------
    tuple of ndarray
        Lines of the peaks of each channel, ascending.

    Notes
    -----
    Peaks are searched in the mean power of five adjacent lines. To exclude peaks of noise, a peak
    must also exceed the valleys by eight standard deviations of that mean, and its coherence must
    be significant (1e-6). Two resonances closer than five lines count as one peak.

    Examples
    --------
    >>> frequency = np.arange(10.0, 90.0, 0.25)
    >>> one = np.ones((1, frequency.size))
    >>> value = 1 / (1 - (frequency / 40) ** 2 + 0.04j * frequency / 40)
    >>> smooth = Frf(frequency=frequency, value=value[None], coherence=0.99 * one, radius=one,
    ...              averages=20.0, estimator="h1", confidence=0.95)
    >>> frequency[find_frf_peaks(smooth)[0]].tolist()
    [40.0]
    """
    deviation = uniform_filter1d(_finite(level_deviation(frf)), _SMOOTHED, axis=-1)
    return tuple(
        _channel_peaks(value, scatter, share, frf.averages, prominence)
        for value, scatter, share in zip(frf.value, deviation, frf.coherence, strict=True)
    )


def _finite(deviation: Float) -> Float:
    """Replace an infinite deviation, of lines without coherence, by more than any peak's height."""
    return np.minimum(deviation, 1e3)


def _channel_peaks(
    value: Complex, deviation: Float, coherence: Float, averages: float, prominence: float
) -> NDArray[np.intp]:
    smooth = 10 * np.log10(uniform_filter1d(np.abs(value) ** 2, _SMOOTHED) + TINY)
    lines, found = find_peaks(smooth, prominence=prominence)
    outstanding = found["prominences"] > _DEVIATIONS * deviation[lines] / math.sqrt(_SMOOTHED)
    # for unrelated signals P(coherence > c) = (1 - c)^(n - 1)
    connected = coherence[lines] > 1 - _CHANCE ** (1 / (averages - 1))
    tops = [_top(np.abs(value), int(line)) for line in lines[outstanding & connected]]
    return np.unique(np.asarray(tops, dtype=np.intp))


def _top(size: Float, line: int) -> int:
    """Highest of the lines that were averaged into one."""
    first = max(0, line - _SMOOTHED // 2)
    return first + int(np.argmax(size[first : line + _SMOOTHED // 2 + 1]))


def level_db(value: Complex | Float) -> Float:
    """Level in decibels; zero is replaced by a tiny number."""
    return np.asarray(20 * np.log10(np.abs(value) + TINY))


def peak_changes(before: RigTest, after: RigTest) -> tuple[PeakChange, ...]:
    """Match every peak of the first test with the second, and vice versa.

    Parameters
    ----------
    before, after : RigTest
        Tests with the same channels and lines.

    Returns
    -------
    tuple of PeakChange
        Sorted by channel, then frequency. Intervals of 95 %; verdicts have a level of 5 % jointly.

    Raises
    ------
    RigError
        The two tests differ in lines or channels.

    Notes
    -----
    A peak is matched with the nearest one of the second test, each used once, whose frequency
    differs by at most a tenth; there a third of the prominence is enough. Without a match the peak
    has disappeared, and the level at its line is used. New peaks are treated in the same way,
    otherwise the selection would favour peaks that fall. Matching uses frequencies alone: if
    alignment shifts resonances past one another, the picture is clearer than the table.

    The scatter of a level in dB is normal to first order; the difference of two has Welch's
    degrees of freedom. Picking the maximum of a noisy peak raises both levels alike.

    References
    ----------
    B. L. Welch, "The generalization of 'Student's' problem when several different population
    variances are involved", Biometrika 34 (1947) 28-35, doi:10.1093/biomet/34.1-2.28.
    S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6
    (1979) 65-70.
    """
    _check_same(before, after)
    tops, new = find_frf_peaks(before.frf), find_frf_peaks(after.frf)
    others = find_frf_peaks(after.frf, prominence=PROMINENCE_DB / 3)
    found = [
        _compared(before, after, channel, line, later)
        for channel, rows in enumerate(zip(tops, others, new, strict=True))
        for line, later in _pairs(before.frf.frequency, *rows)
    ]
    adjusted = holm([p_value for _, p_value in found])
    return tuple(
        replace(peak, p_value=p, verdict=_verdict(peak.change, p))
        for (peak, _), p in zip(found, adjusted, strict=True)
    )


def _check_same(before: RigTest, after: RigTest) -> None:
    lines = before.frf.frequency, after.frf.frequency
    if before.channels != after.channels or not np.array_equal(*lines):
        raise RigError(
            f"tests of {len(before.channels)} channels x {lines[0].size} lines and of "
            f"{len(after.channels)} x {lines[1].size} must agree; run both with one setup"
        )


def _pairs(
    frequency: Float,
    peaks: NDArray[np.intp],
    later: NDArray[np.intp],
    new: NDArray[np.intp],
) -> list[tuple[int, int]]:
    """Lines before and after of each peak; the same line if it has disappeared or is new."""
    partner: dict[int, int] = {}
    free = {int(line) for line in later}
    near = sorted(
        (abs(math.log(frequency[other] / frequency[line])), int(line), int(other))
        for line in peaks
        for other in later
    )
    for distance, line, other in near:
        if distance <= _SEARCH_SHARE and line not in partner and other in free:
            partner[line] = other
            free.remove(other)
    pairs = {int(line): partner.get(int(line), int(line)) for line in peaks}
    pairs.update({int(line): int(line) for line in new if int(line) in free - set(pairs)})
    return sorted(pairs.items())


def _compared(
    before: RigTest, after: RigTest, channel: int, line: int, later: int
) -> tuple[PeakChange, float]:
    """Change of one peak, and its unadjusted p-value."""
    sides = (before, line), (after, later)
    levels = [float(level_db(test.frf.value[channel, at])) for test, at in sides]
    errors = [float(level_deviation(test.frf)[channel, at]) for test, at in sides]
    sizes = [np.abs(test.model[channel]) for test, _ in sides]
    truths = [
        float(level_db(size[_top(size, at)])) for size, at in zip(sizes, (line, later), strict=True)
    ]
    change = levels[1] - levels[0]
    freedom = [2 * test.frf.averages - 2 for test, _ in sides]
    interval, p_value = _welch(change, errors, freedom, _CONFIDENCE)
    peak = PeakChange(
        channel=before.channels[channel],
        frequency_before=float(before.frf.frequency[line]),
        frequency_after=float(after.frf.frequency[later]),
        level_before=levels[0],
        level_after=levels[1],
        change=change,
        interval=interval,
        p_value=p_value,
        coherence_before=float(before.frf.coherence[channel, line]),
        coherence_after=float(after.frf.coherence[channel, later]),
        model_change=truths[1] - truths[0],
        verdict="unchanged",
    )
    return peak, p_value


def _welch(
    change: float, errors: Sequence[float], freedom: Sequence[float], confidence: float
) -> tuple[tuple[float, float], float]:
    """Interval of a difference of two levels [dB], and p-value of no difference."""
    squares = [error**2 for error in errors]
    total = math.fsum(squares)
    if not 0 < total < math.inf:
        width = 0.0 if total == 0 else math.inf
        return (change - width, change + width), float(total > 0 or change == 0)
    degrees = total**2 / math.fsum(s**2 / f for s, f in zip(squares, freedom, strict=True))
    deviation = math.sqrt(total)
    width = float(stdtrit(degrees, (1 + confidence) / 2)) * deviation
    p_value = 2 * float(stdtr(degrees, -abs(change) / deviation))
    return (change - width, change + width), p_value


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjust p-values so that one threshold applies to all of them jointly.

    Parameters
    ----------
    p_values : sequence of float
        Each 0 to 1 [-].

    Returns
    -------
    list of float
        In the same order [-]: the k-th smallest of n times ``n - k + 1``, made non-decreasing and
        at most 1.

    References
    ----------
    S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6
    (1979) 65-70.

    Examples
    --------
    >>> holm([0.04, 0.01, 0.03])
    [0.06, 0.03, 0.06]
    """
    order = np.argsort(p_values)
    factors = np.arange(len(p_values), 0, -1)
    raised = np.maximum.accumulate(np.asarray(p_values, dtype=np.float64)[order] * factors)
    result = np.empty(len(p_values))
    result[order] = np.minimum(raised, 1.0)
    return [float(p) for p in result]


def _verdict(change: float, p_value: float) -> str:
    if p_value >= 1 - _CONFIDENCE:
        return "unchanged"
    return "suppressed" if change < 0 else "amplified"
