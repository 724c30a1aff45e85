"""What a pressure over the crank angle tells of a cylinder: its two levels, and when it turns.

The two levels are told from the pressure itself, so the mark need not be at a dead centre; the
angles count from the mark, which a tacho sets at the top dead centre, where the piston turns from
discharge to suction. A connecting line or a slow transmitter delays both transitions alike, by
``speed * 360 deg`` times its delay (first order: its time constant; second order:
``zeta / (pi f)``), and widens them: no pressure tells its own lag.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..signal.statistics import Real

Float = NDArray[np.float64]

CELLS = 720
"""Most cells of a mean revolution [-]: half a degree, where the record has a sample for each."""

LEAST_CELLS = 36
"""Fewest samples in a revolution of which transitions are told [-]: ten degrees each."""

_LOW, _HIGH = 0.1, 0.9  # of a transition: what a rise time is told between, IEC 60469
_LEFT, _REACHED = 0.25, 0.75  # of the change: where a level is left for good, the other reached
_INNER = 0.25  # of a level's stretch left out at either end: what follows a transition rings there
_TURN = 360.0  # deg


class Transitions(NamedTuple):
    """Levels of a mean revolution and what lies between them.

    Attributes
    ----------
    suction, discharge : float
        Medians of the inner halves of the lower and of the upper stretch [unit of x].
    suction_ripple, discharge_ripple : float
        rms about them there, of what repeats every revolution [unit of x].
    rise, fall : float
        Angle at which half of the change is done, after the bottom dead centre, which is half a
        turn from the mark, and after the mark [deg], from -180 to 180.
    rise_width, fall_width : float
        From a tenth to nine tenths of the change [deg].
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
        [any unit], with its mean.
    phase : ndarray, shape (n_samples,)
        Shaft phase, increasing [rev].

    Returns
    -------
    ndarray, shape (n_cells,)
        Cell k is centred on the angle ``k / n_cells`` [unit of x]. There are :data:`CELLS`, or as
        many as a revolution has samples.

    Raises
    ------
    ValueError
        If a revolution has fewer than :data:`LEAST_CELLS` samples.

    Notes
    -----
    White noise falls by the root of the samples in a cell. Cells that no sample fell into are
    interpolated.

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
        All angles 0 where the pressure does not change.

    Notes
    -----
    A level holds until three quarters of the change to the other are done, so that a line that
    rings does not count as another rise (down to a damping ratio of 0.05). Levels and stretches
    are told by turns until they agree. A transition that is a straight ramp of width W shows
    ``0.8 W``, a cubic with level ends ``0.608 W``; one as narrow as a cell or two shows wider, by
    half a cell.

    Examples
    --------
    >>> angle = np.arange(720) / 2
    >>> rise, fall = np.clip((angle - 190) / 10, 0, 1), np.clip((angle - 8) / 10, 0, 1)
    >>> found = transitions(1.0 + 2.0 * (rise + 1 - fall))
    >>> [round(value, 3) for value in found]
    [1.0, 3.0, 0.0, 0.0, 15.0, 8.0, 13.0, 8.0]
    """
    low, high = (float(value) for value in np.percentile(cycle, (10, 90)))
    for _ in range(3):  # the second time the medians stand
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
    """Which cells are on the upper level, by the last level that was reached before each."""
    told = np.flatnonzero((share < _LEFT) | (share > _REACHED))
    last = told[np.searchsorted(told, np.arange(share.size), side="right") - 1]
    return np.asarray(share[last] > _REACHED)


def _longest(above: NDArray[np.bool_]) -> tuple[int, int]:
    """First cell and number of cells of the longest stretch, which may run over the end."""
    first = int(np.flatnonzero(~above)[0])
    turned = np.append(np.roll(above, -first), False)
    change = np.diff(turned.astype(np.int8))
    starts, ends = np.flatnonzero(change == 1) + 1, np.flatnonzero(change == -1) + 1
    longest = int(np.argmax(ends - starts))
    return first + int(starts[longest]), int(ends[longest] - starts[longest])


def _inner(cycle: Float, start: int, length: int) -> Float:
    """Middle of a stretch."""
    cut = int(_INNER * length)
    return np.asarray(np.take(cycle, np.arange(start + cut, start + length - cut), mode="wrap"))


def _edge(rising: Float, reached: int) -> tuple[float, float]:
    """Half of a rise [deg] and its width [deg], by the cell in which the upper level is reached."""
    reach = rising.size // 4
    around = np.take(rising, np.arange(reached - reach, reached + reach), mode="wrap")
    half = _last_below(around[: reach + 1], 0.5)
    begin = _last_below(around[: int(half) + 2], _LOW)
    backwards = 1 - around[int(half) :][::-1]
    end = around.size - 1 - _last_below(backwards, 1 - _HIGH)
    step = _TURN / rising.size
    return (reached - reach + half) * step, (end - begin) * step


def _last_below(rising: Float, level: float) -> float:
    """Where a rise passes a level for the last time, between cells; its first cell if never."""
    below = np.flatnonzero(rising[:-1] <= level)
    if not below.size:
        return 0.0
    at = int(below[-1])
    change = rising[at + 1] - rising[at]
    return at + float(np.clip((level - rising[at]) / change, 0, 1)) if change > 0 else float(at)


def _centred(angle: float) -> float:
    """The same angle from -180 to 180 [deg]."""
    return (angle + _TURN / 2) % _TURN - _TURN / 2
