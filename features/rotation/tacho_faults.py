"""Faults of tacho pulses: missing, extra, jittery, or at a standstill; repair on request."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from .order import INTERVAL_JUMP

Float = NDArray[np.float64]

LARGEST_FAULTY_SHARE = 0.1
"""Largest share of wrong pulses that is repaired [-]: with more, the trigger level is wrong."""

LONGEST_GAP = 4
"""Longest gap that is repaired, in intervals [-]: three pulses in a row."""

STANDSTILL_GROWTH = 1.15
"""Growth of neighbouring intervals that marks a standstill [-]. At a constant deceleration the last
interval before a standstill is 1.3 times the one before; at a tenth of that deceleration the shaft
does not stop."""

_NEIGHBOURS = 9  # intervals: their median survives two extra pulses, or four missing
_GAP_ROUNDING = 0.2  # of a gap's length: a half-integer number of intervals is rejected


@dataclass(frozen=True, kw_only=True)
class PulseFaults:
    """Faults in a row of tacho pulses.

    Parameters
    ----------
    missing : ndarray, shape (n_missing,)
        Times at which a pulse is missing [s].
    extra : ndarray, shape (n_extra,)
        Times of the surplus pulses [s].
    standstills : ndarray, shape (n_standstills,)
        Times around which the shaft stopped, and possibly reversed [s].
    unclear : ndarray, shape (n_unclear,)
        Times of gaps that do not fit a whole number of missing pulses, or of more than three [s].
    jitter_rev : float
        Standard deviation of the pulses about a smoothly changing speed [rev]; 0 if fewer than four
        pulses are left to determine it.

    Examples
    --------
    >>> none = np.zeros(0)
    >>> faults = PulseFaults(
    ...     missing=np.array([0.5]), extra=none, standstills=none, unclear=none, jitter_rev=0.001
    ... )
    >>> print(faults)
    missing: 1 (0.5 s); extra: 0; standstills: 0; unclear: 0; jitter: 0.1 % of a revolution
    """

    missing: Float
    extra: Float
    standstills: Float
    unclear: Float
    jitter_rev: float

    def __str__(self) -> str:
        listed = [
            f"{name}: {times.size}" + (f" ({_some(times)} s)" if times.size else "")
            for name, times in (
                ("missing", self.missing),
                ("extra", self.extra),
                ("standstills", self.standstills),
                ("unclear", self.unclear),
            )
        ]
        return "; ".join([*listed, f"jitter: {100 * self.jitter_rev:.3g} % of a revolution"])

    @property
    def count(self) -> int:
        """Number of faults apart from the jitter."""
        return sum(t.size for t in (self.missing, self.extra, self.standstills, self.unclear))


def _some(times: Float) -> str:
    """The first five times as text."""
    return ", ".join(f"{t:.4g}" for t in times[:5]) + (", …" if times.size > 5 else "")


def pulse_faults(pulses: ArrayLike, *, pulses_per_revolution: int = 1) -> PulseFaults:
    """Find missing and extra pulses, standstills and jitter, without changing anything.

    Parameters
    ----------
    pulses : array_like, shape (n_pulses,)
        Pulse times [s], increasing, as from `order.pulse_times`.
    pulses_per_revolution : int
        Pulses in one revolution.

    Returns
    -------
    PulseFaults
        All faults found.

    Raises
    ------
    ValueError
        If there are fewer than five pulses, or they do not increase.

    Notes
    -----
    An interval is compared with the median of the nine around it. If it is shorter than 1 / 1.8 of
    the median, the end whose removal leaves the more regular interval is an extra pulse. If it is
    longer than 1.8 times, it is a gap of as many pulses as fit, or a standstill if the intervals
    grow towards it and shrink after it. One tacho does not show the direction: a shaft that
    reverses looks like one that stops. Jitter is the third difference of the times, which is 0 for
    a steady acceleration, over the root of 20; it lowers the amplitude of order k by the share ``(2
    pi k jitter)^2 / 2``.

    Examples
    --------
    >>> faults = pulse_faults([0.0, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0.74, 0.8])
    >>> faults.missing.round(3).tolist(), faults.extra.tolist()
    ([0.4], [0.74])
    """
    return _examine(pulses, pulses_per_revolution)[1]


def mend_pulses(pulses: ArrayLike, *, pulses_per_revolution: int = 1) -> tuple[Float, PulseFaults]:
    """Remove extra pulses and insert missing ones.

    Parameters
    ----------
    pulses : array_like, shape (n_pulses,)
        Pulse times [s], increasing.
    pulses_per_revolution : int
        Pulses in one revolution.

    Returns
    -------
    mended : ndarray, shape (n_mended,)
        Pulse times [s]; inserted ones lie on a cubic spline through the others.
    faults : PulseFaults
        Faults found, and repaired.

    Raises
    ------
    ValueError
        As for `pulse_faults`; or if the shaft stands still, a gap is unclear, or more than a tenth
        of the pulses (and more than one) is wrong: such faults are not repaired.

    Examples
    --------
    >>> mended, faults = mend_pulses([0.0, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7, 0.8])
    >>> mended.round(3).tolist()
    [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    """
    kept, faults = _examine(pulses, pulses_per_revolution)
    wrong = faults.missing.size + faults.extra.size
    bound = max(1, int(LARGEST_FAULTY_SHARE * kept.size))
    reasons = []
    if faults.standstills.size:
        reasons.append(
            f"speed passes through zero near {_some(faults.standstills)} s, must stay > 0; cut "
            "the record to one direction of rotation"
        )
    if faults.unclear.size:
        reasons.append(
            f"pulses near {_some(faults.unclear)} s are no whole number of intervals apart, or "
            f"more than {LONGEST_GAP}; cut the record there"
        )
    if wrong > bound:
        reasons.append(
            f"wrong pulses = {wrong} of {kept.size} must be <= {bound}; "
            "check the tacho, or cut the record to where it works"
        )
    if reasons:
        raise ValueError("\n".join(reasons))
    return np.sort(np.concatenate((kept, faults.missing))), faults


def _examine(pulses: ArrayLike, per_revolution: int) -> tuple[Float, PulseFaults]:
    """Pulses that are not extra, and all faults."""
    times = np.asarray(pulses, dtype=np.float64)
    _check_times(times, per_revolution)
    kept = _without_extra(times)
    ratio = np.diff(kept) / _usual(np.diff(kept))
    gaps = np.flatnonzero(ratio >= INTERVAL_JUMP)
    count = np.rint(ratio[gaps])
    stopped = np.array([_is_standstill(np.diff(kept), int(gap)) for gap in gaps], dtype=np.bool_)
    clear = (np.abs(ratio[gaps] / count - 1) <= _GAP_ROUNDING) & (count <= LONGEST_GAP)
    steps = np.ones(kept.size - 1)
    steps[gaps[clear & ~stopped]] = count[clear & ~stopped]
    middle = (kept[:-1] + kept[1:]) / 2
    return kept, PulseFaults(
        missing=_missing(kept, steps),
        extra=np.setdiff1d(times, kept),
        standstills=middle[gaps[stopped]],
        unclear=middle[gaps[~clear & ~stopped]],
        jitter_rev=_jitter(kept, steps) / per_revolution,
    )


def _check_times(times: Float, per_revolution: int) -> None:
    if per_revolution < 1:
        raise ValueError(f"pulses_per_revolution = {per_revolution} must be >= 1; count the teeth")
    if times.ndim != 1 or times.size < 5:
        raise ValueError(f"n_pulses = {times.size} must be >= 5 to judge one by; record longer")
    if not np.all(np.diff(times) > 0):
        raise ValueError("pulse times must be finite and increase; sort them")


def _usual(intervals: Float) -> Float:
    """Median of the intervals around each [s]."""
    return np.asarray(median_filter(intervals, size=_NEIGHBOURS, mode="reflect"))


def _without_extra(times: Float) -> Float:
    """Pulses without the extra ones, removed one at a time, the worst first."""
    kept = times
    # Removing more would change the usual interval itself.
    for _ in range(times.size // 4):
        intervals = np.diff(kept)
        usual = _usual(intervals)
        worst = int(np.argmin(intervals / usual))
        if kept.size <= 5 or intervals[worst] * INTERVAL_JUMP > usual[worst]:
            break
        kept = np.delete(kept, _extra_of(intervals, worst, usual[worst]))
    return kept


def _extra_of(intervals: Float, short: int, usual: float) -> int:
    """Which of the two pulses around a short interval is the extra one."""

    def irregularity(neighbour: int) -> float:
        # At an end of the row there is no neighbouring interval to compare.
        inside = 0 <= neighbour < intervals.size
        merged = intervals[short] + (intervals[neighbour] if inside else 0.0)
        return abs(float(np.log(merged / usual))) if inside else float(np.log(INTERVAL_JUMP) / 2)

    return short if irregularity(short - 1) < irregularity(short + 1) else short + 1


def _is_standstill(intervals: Float, gap: int) -> bool:
    """Whether the intervals grow into a gap and shrink after it."""
    before, after = intervals[max(gap - 2, 0) : gap], intervals[gap + 1 : gap + 3]
    if min(before.size, after.size) < 2:
        return False
    return bool(
        before[1] > STANDSTILL_GROWTH * before[0] and after[0] > STANDSTILL_GROWTH * after[1]
    )


def _missing(kept: Float, steps: Float) -> Float:
    """Times of the pulses missing between the steps."""
    numbers = np.concatenate(([0.0], np.cumsum(steps)))
    absent = np.setdiff1d(np.arange(numbers[-1]), numbers)
    return np.asarray(CubicSpline(numbers, kept)(absent))


def _jitter(kept: Float, steps: Float) -> float:
    """Scatter of the pulses about a smooth speed, in intervals."""
    third = np.diff(kept, 3)
    whole = np.convolve(steps == 1, np.ones(3), "valid") == 3  # no gap within the three intervals
    if not whole.any():
        return 0.0
    relative = third[whole] / np.convolve(np.diff(kept), np.ones(3) / 3, "valid")[whole]
    return float(np.sqrt(np.mean(relative**2) / 20))
