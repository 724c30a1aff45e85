"""Peaks of transfer functions before and after: which of them have moved, and how surely."""

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

_SEARCH_SHARE = 0.1  # of a peak's frequency, by which alignment may shift it
_DEVIATIONS = 8.0  # by which a peak must stand out: of some hundred values the extremes are 6 apart
_SMOOTHED = 5  # lines averaged to find a peak
_CHANCE = 1e-6  # of a peak's coherence without any connection

PROMINENCE_DB = 3.0  # a factor of two in power


@dataclass(frozen=True, kw_only=True)
class PeakChange:
    """What became of one peak of one channel.

    Attributes
    ----------
    channel : str
    frequency_before, frequency_after : float
        [Hz]
    level_before, level_after : float
        [dB re 1 (m/s^2)/N]
    change : float
        Measured, after less before [dB].
    interval : tuple of float
        Confidence interval of the change, of this peak alone [dB].
    p_value : float
        Of no change, adjusted for the number of peaks (Holm) [-].
    coherence_before, coherence_after : float
        At the peak [-].
    model_change : float
        What the change is in truth, the model's peak at both times [dB].
    verdict : str
        ``suppressed`` or ``amplified`` where the change is significant, else ``unchanged``.
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
        """Whether the true change is larger than the scatter: about every second test shows it."""
        return abs(self.model_change) > self.scatter


def find_frf_peaks(frf: Frf, *, prominence: float = PROMINENCE_DB) -> tuple[NDArray[np.intp], ...]:
    """Peaks of the magnitude that stand out of their surroundings and of their scatter.

    Parameters
    ----------
    frf : Frf
    prominence : float
        Least height over the higher of the two valleys beside it, > 0 [dB].

    Returns
    -------
    tuple of ndarray
        Lines of the peaks of each channel, ascending.

    Notes
    -----
    Sought in the mean power of five neighbouring lines. The peak must rise over the valleys by
    eight standard deviations of that mean too, and its coherence must be significant (1e-6), else
    noise would make peaks. Two resonances closer than five lines are one peak.

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
    """Infinite where nothing hangs together: more than any peak stands out."""
    return np.minimum(deviation, 1e3)


def _channel_peaks(
    value: Complex, deviation: Float, coherence: Float, averages: float, prominence: float
) -> NDArray[np.intp]:
    smooth = 10 * np.log10(uniform_filter1d(np.abs(value) ** 2, _SMOOTHED) + TINY)
    lines, found = find_peaks(smooth, prominence=prominence)
    outstanding = found["prominences"] > _DEVIATIONS * deviation[lines] / math.sqrt(_SMOOTHED)
    # without any connection P(coherence > c) = (1 - c)^(n - 1)
    connected = coherence[lines] > 1 - _CHANCE ** (1 / (averages - 1))
    tops = [_top(np.abs(value), int(line)) for line in lines[outstanding & connected]]
    return np.unique(np.asarray(tops, dtype=np.intp))


def _top(size: Float, line: int) -> int:
    """Highest line of those that were smoothed into one."""
    first = max(0, line - _SMOOTHED // 2)
    return first + int(np.argmax(size[first : line + _SMOOTHED // 2 + 1]))


def level_db(value: Complex | Float) -> Float:
    """In decibels, floored by the smallest number."""
    return np.asarray(20 * np.log10(np.abs(value) + TINY))


def peak_changes(
    before: RigTest,
    after: RigTest,
    *,
    prominence: float = PROMINENCE_DB,
    confidence: float = 0.95,
) -> tuple[PeakChange, ...]:
    """Follow every peak of the first test into the second, and those of the second back.

    Parameters
    ----------
    before, after : RigTest
        Of the same channels and lines.
    prominence : float
        As in `find_frf_peaks` [dB].
    confidence : float
        Of the intervals; a verdict has the level ``1 - confidence`` over all peaks together [-].

    Returns
    -------
    tuple of PeakChange
        By channel, then frequency.

    Raises
    ------
    RigError
        The two tests have other lines or channels.

    Notes
    -----
    A peak is found again in the nearest one of the second test, each taken once, whose frequency
    differs by a tenth at most; there a third of the prominence is enough. Where there is none the
    peak has gone, and the level of its line is taken; likewise a peak that has come, else the
    choice of peaks would favour those that fall. Frequencies alone make the pairs: where alignment
    shifts resonances past one another, the picture tells more than the table.

    The scatter of a level in dB is normal to first order; the difference of two has Welch's
    degrees of freedom. That the top of a noisy peak was picked raises both levels alike.

    References
    ----------
    B. L. Welch, "The generalization of 'Student's' problem when several different population
    variances are involved", Biometrika 34 (1947) 28-35, doi:10.1093/biomet/34.1-2.28.
    S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6
    (1979) 65-70.
    """
    _check_same(before, after)
    tops = find_frf_peaks(before.frf, prominence=prominence)
    others = find_frf_peaks(after.frf, prominence=prominence / 3)
    new = find_frf_peaks(after.frf, prominence=prominence)
    found = [
        _compared(before, after, channel, line, there, confidence)
        for channel, rows in enumerate(zip(tops, others, new, strict=True))
        for line, there in _pairs(before.frf.frequency, *rows)
    ]
    adjusted = holm([p_value for _, p_value in found])
    return tuple(
        replace(peak, p_value=p, verdict=_verdict(peak.change, p, confidence))
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
    """Line before and line after of each peak; the same one where it has gone or come."""
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
    before: RigTest, after: RigTest, channel: int, line: int, there: int, confidence: float
) -> tuple[PeakChange, float]:
    """One peak and the p-value of it alone."""
    sides = (before, line), (after, there)
    levels = [float(level_db(test.frf.value[channel, at])) for test, at in sides]
    errors = [float(level_deviation(test.frf)[channel, at]) for test, at in sides]
    sizes = [np.abs(test.model[channel]) for test, _ in sides]
    truths = [
        float(level_db(size[_top(size, at)])) for size, at in zip(sizes, (line, there), strict=True)
    ]
    change = levels[1] - levels[0]
    freedom = [2 * test.frf.averages - 2 for test, _ in sides]
    interval, p_value = _welch(change, errors, freedom, confidence)
    peak = PeakChange(
        channel=before.channels[channel],
        frequency_before=float(before.frf.frequency[line]),
        frequency_after=float(after.frf.frequency[there]),
        level_before=levels[0],
        level_after=levels[1],
        change=change,
        interval=interval,
        p_value=p_value,
        coherence_before=float(before.frf.coherence[channel, line]),
        coherence_after=float(after.frf.coherence[channel, there]),
        model_change=truths[1] - truths[0],
        verdict="unchanged",
    )
    return peak, p_value


def _welch(
    change: float, errors: Sequence[float], freedom: Sequence[float], confidence: float
) -> tuple[tuple[float, float], float]:
    """Interval of a difference of two levels [dB], and p-value of none."""
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
    """P-values adjusted so that one threshold serves for all of them together.

    Parameters
    ----------
    p_values : sequence of float
        Each 0 to 1 [-].

    Returns
    -------
    list of float
        In the same order: the k-th smallest of n times ``n - k + 1``, never less than a smaller
        one's and at most 1 [-].

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


def _verdict(change: float, p_value: float, confidence: float) -> str:
    if p_value >= 1 - confidence:
        return "unchanged"
    return "suppressed" if change < 0 else "amplified"
