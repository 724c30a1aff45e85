"""Cylinder pressure over the crank angle: its two levels, and the times of its transitions.

The two levels are determined from the pressure itself, so that the mark need not be at a dead
centre; the angles count from the mark, which a tacho sets at the top dead centre, where the piston
turns from discharge to suction. A connecting line or a slow transmitter delays both transitions
alike, by ``speed * 360 deg`` times its delay (first order: its time constant; second order: ``zeta
/ (pi f)``), and widens them: this lag cannot be determined from the pressure.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..signal.statistics import Real

Float = NDArray[np.float64]

CELLS = 720
"""Largest number of cells in a mean revolution [-]: half a degree each, if the record has as many
samples."""

LEAST_CELLS = 36
"""Fewest samples per revolution for transitions [-]: ten degrees each."""

_LOW, _HIGH = 0.1, 0.9  # of a transition: between them the rise time is measured, IEC 60469
_LEFT, _REACHED = 0.25, 0.75  # of the change: a level counts as left, the other as reached
_INNER = 0.25  # of a level's stretch, left out at either end, where the pressure still rings
_TURN = 360.0  # deg


class Transitions(NamedTuple):
    """Levels of a mean revolution and the transitions between them.

    Attributes
    ----------
    suction, discharge : float
        Medians of the inner halves of the lower and the upper stretch [unit of x].
    suction_ripple, discharge_ripple : float
        Rms about them there, of the part that repeats every revolution [unit of x].
    rise, fall : float
        Angles at which half of the change is completed, after the bottom dead centre (half a turn
        from the mark) and after the mark [deg], from -180 to 180.
    rise_width, fall_width : float
        Angle from a tenth to nine tenths of the change [deg].
    """

    suction: float
    discharge: float
    suction_ripple: float
    discharge_ripple: float
    rise: float
    rise_width: float
    fall: float
    fall_width: float


def mean_revolution(x: Real, phase: Float) -> Float:
    """Mean of a signal over each cell of a revolution.

    Parameters
    ----------
    x : ndarray, shape (n_samples,)
        Signal [any unit], with its mean.
    phase : ndarray, shape (n_samples,)
        Shaft phase, increasing [rev].

    Returns
    -------
    ndarray, shape (n_cells,)
        Values; cell k is centred on the angle ``k / n_cells`` [unit of x]. There are :data:`CELLS`,
        or as many as a revolution has samples.

    Raises
    ------
    ValueError
        If a revolution has fewer than :data:`LEAST_CELLS` samples.

    Notes
    -----
    White noise falls by the root of the samples in a cell. Cells without a sample are interpolated.

    Examples
    --------
    >>> phase = np.arange(7200) / 720
    >>> mean = mean_revolution(np.cos(2 * np.pi * phase), phase)
    >>> mean.size, mean[[0, 360]].round(9).tolist()
    (720, [1.0, -1.0])
    """
    per_turn = (phase.size - 1) / (phase[-1] - phase[0])
    if per_turn < LEAST_CELLS:
        raise ValueError(
            f"samples in a revolution = {per_turn:.4g} must be >= {LEAST_CELLS}; sample faster"
        )
    cells = min(CELLS, int(per_turn))
    place = np.floor(phase * cells + 0.5).astype(np.intp) % cells
    count = np.bincount(place, minlength=cells)
    total = np.bincount(place, weights=x.astype(np.float64), minlength=cells)
    filled = np.flatnonzero(count)
    mean = total[filled] / count[filled]
    return np.asarray(np.interp(np.arange(cells), filled, mean, period=cells))


def transitions(cycle: Float) -> Transitions:
    """Levels and transitions of a cylinder pressure.

    Parameters
    ----------
    cycle : ndarray, shape (n_cells,)
        A mean revolution from the top dead centre on [any unit], see :func:`mean_revolution`.

    Returns
    -------
    Transitions
        Levels and transitions; all angles are 0 if the pressure does not change.

    Notes
    -----
    A level lasts until three quarters of the change to the other are completed, so that ringing of
    the line does not count as another rise (down to a damping ratio of 0.05). Levels and stretches
    are determined alternately until they agree. A transition that is a straight ramp of width W
    reads ``0.8 W``, a cubic with level ends ``0.608 W``; one only a cell or two wide reads half a
    cell too much.

    Examples
    --------
    >>> angle = np.arange(720) / 2
    >>> rise, fall = np.clip((angle - 190) / 10, 0, 1), np.clip((angle - 8) / 10, 0, 1)
    >>> found = transitions(1.0 + 2.0 * (rise + 1 - fall))
    >>> [round(value, 3) for value in found]
    [1.0, 3.0, 0.0, 0.0, 15.0, 8.0, 13.0, 8.0]
    """
    low, high = (float(value) for value in np.percentile(cycle, (10, 90)))
    for _ in range(3):  # the medians are final after the second pass
        if not high > low:
            return Transitions(low, low, *(6 * (0.0,)))
        start, length = _longest(_discharging((cycle - low) / (high - low)))
        upper = _inner(cycle, start, length)
        lower = _inner(cycle, start + length, cycle.size - length)
        low, high = float(np.median(lower)), float(np.median(upper))
    rising = (cycle - low) / (high - low) if high > low else np.zeros(cycle.size)
    rise, rise_width = _edge(rising, start)
    fall, fall_width = _edge(1 - rising, start + length)
    return Transitions(
        suction=low,
        discharge=high,
        suction_ripple=float(np.sqrt(np.mean((lower - low) ** 2))),
        discharge_ripple=float(np.sqrt(np.mean((upper - high) ** 2))),
        rise=_centred(rise - _TURN / 2),
        rise_width=rise_width,
        fall=_centred(fall),
        fall_width=fall_width,
    )


def _discharging(share: Float) -> NDArray[np.bool_]:
    """Whether each cell is on the upper level, by the last level reached before it."""
    decided = np.flatnonzero((share < _LEFT) | (share > _REACHED))
    last = decided[np.searchsorted(decided, np.arange(share.size), side="right") - 1]
    return np.asarray(share[last] > _REACHED)


def _longest(above: NDArray[np.bool_]) -> tuple[int, int]:
    """First cell and number of cells of the longest stretch, which may wrap around the end."""
    first = int(np.flatnonzero(~above)[0])
    turned = np.append(np.roll(above, -first), False)
    change = np.diff(turned.astype(np.int8))
    starts, ends = np.flatnonzero(change == 1) + 1, np.flatnonzero(change == -1) + 1
    longest = int(np.argmax(ends - starts))
    return first + int(starts[longest]), int(ends[longest] - starts[longest])


def _inner(cycle: Float, start: int, length: int) -> Float:
    """Inner part of a stretch."""
    cut = int(_INNER * length)
    return np.asarray(np.take(cycle, np.arange(start + cut, start + length - cut), mode="wrap"))


def _edge(rising: Float, reached: int) -> tuple[float, float]:
    """Middle and width of a rise [deg], from the cell in which the upper level is reached."""
    reach = rising.size // 4
    around = np.take(rising, np.arange(reached - reach, reached + reach), mode="wrap")
    half = _last_below(around[: reach + 1], 0.5)
    begin = _last_below(around[: int(half) + 2], _LOW)
    backwards = 1 - around[int(half) :][::-1]
    end = around.size - 1 - _last_below(backwards, 1 - _HIGH)
    step = _TURN / rising.size
    return (reached - reach + half) * step, (end - begin) * step


def _last_below(rising: Float, level: float) -> float:
    """Position at which a rise passes a level last, between cells; 0 if never."""
    below = np.flatnonzero(rising[:-1] <= level)
    if not below.size:
        return 0.0
    at = int(below[-1])
    change = rising[at + 1] - rising[at]
    return at + float(np.clip((level - rising[at]) / change, 0, 1)) if change > 0 else float(at)


def _centred(angle: float) -> float:
    """The same angle, within -180 to 180 [deg]."""
    return (angle + _TURN / 2) % _TURN - _TURN / 2
