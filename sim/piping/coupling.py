"""Solver for the node pressures of a suction and a discharge pipe with a pump between them.

The pump draws from both nodes; its flow at one depends on the pressure at the other too, and
far more steeply than a pipe's flow. A step solves two equations for the two pressures p::

    excess_k(p_k, drawn_k(p)) = 0     or  >= 0 at the vapour pressure,   k = suction, discharge

The slopes of the pipes are known; those of the pump are a 2 x 2 matrix G, which is learnt from the
trials (Broyden) and kept from step to step. A pump draws more at a node the higher the pressure
there, less the higher the other pressure, and not less if both rise equally. So G plus the pipes'
slopes is diagonally dominant, and a Newton step always exists.

A trial is accepted if the sum of both absolute excesses decreases. After two in a row with little
progress, G is determined anew by probing both pressures; steps that still fail are halved.

References
----------
Broyden (1965), A class of methods for solving nonlinear simultaneous equations, Mathematics of
Computation 19, 577-593, doi:10.1090/S0025-5718-1965-0198670-6.
"""

import math
from typing import Any

import numpy as np

from ..jit import kernel
from ..scene.pump_hydraulics import STANDARD_ATMOSPHERE
from .pipe import excess

PAIR = np.dtype(
    [
        ("pressure", "f8", 2),  # current trial [Pa gauge]
        ("base", "f8", 2),  # best so far
        ("base_drawn", "f8", 2),  # flow drawn by the pump there [m^3/s]
        ("base_gap", "f8", 2),  # excess there [m^3/s]
        ("base_slope", "f8", 2),  # of pipe, spring, gas and valve there [m^3/s/Pa]
        ("left", "f8"),  # sum of both absolute excesses there; infinite before any trial
        ("pump", "f8", (2, 2)),  # derivatives of the flows drawn by the pressures [m^3/s/Pa]
        ("share", "f8"),  # of the Newton step
        ("phase", "i8"),  # _STEP, _PROBE_FIRST, _PROBE_SECOND or _LAST
        ("slow", "i8"),  # consecutive trials with too little progress
        ("tries", "i8"),  # in this step
    ]
)
"""A search for both pressures; kept between steps, in particular the matrix."""

_STEP, _PROBE_FIRST, _PROBE_SECOND, _LAST = range(4)

MOST_TRIES = 40
"""Most trials of a search. The remaining excess of the best one is booked as volume and
compensated in the next steps. Parted columns take three to five on average, one step in a hundred
ten to forty."""

_TOLERANCE = 1e-8  # of the absolute pressure; the rest is booked as volume and compensated

_NOTABLE = 1e-3  # like the tolerance: remaining excess of a step that counts as unsettled

_PROBE_LEAST, _PROBE_MOST = 1e-7, 1e-5  # of the absolute pressure, limited by the rounding of flows

_FAST = 0.3  # of the last excess: a trial that leaves less is good progress

_PATIENCE = 2  # slow trials before both pressures are probed

_LEAST_SHARE = 1e-3  # of a Newton step: below it no slope helps


@kernel
def begin_pair(pair: Any, pipes: Any, states: Any) -> None:
    """Set the first trial of a step: pressures extrapolated from the last two means.

    Parameters
    ----------
    pair : record of dtype PAIR
    pipes : numpy.ndarray [shape=(2,), dtype=PIPE]
        Suction and discharge pipe.
    states : numpy.ndarray [shape=(2,), dtype=PIPE_STATE]
    """
    pair.tries, pair.phase, pair.slow = 0, _STEP, 0
    pair.left, pair.share = math.inf, 1.0
    for k in range(2):
        guess = pipes[k].far if pipes[k].fixed != 0 else 2.0 * states[k].end - states[k].mean
        pair.pressure[k] = max(guess, pipes[k].vapour)


@kernel
def _left(p: float, gap: float, slope: float, pipe: Any) -> float:
    """An excess as the pressure error of the pipe alone, over the absolute pressure."""
    if pipe.fixed != 0 or (p <= pipe.vapour and gap >= 0.0):
        return 0.0
    return abs(gap) / ((p + STANDARD_ATMOSPHERE) * slope)


@kernel
def seek_pair(
    pair: Any, suction: float, discharge: float, pipes: Any, states: Any, nodes: Any, h: float
) -> bool:
    """Whether the last trial has converged; otherwise set the next one in the pair.

    Parameters
    ----------
    pair : record of dtype PAIR
    suction, discharge : float
        Flow that the pump draws at both nodes in the last trial [m^3/s].
    pipes : numpy.ndarray [shape=(2,), dtype=PIPE]
    states : numpy.ndarray [shape=(2,), dtype=PIPE_STATE]
    nodes : tuple of two numpy.ndarray [shape=(4, n_reaches + 1)]
    h : float
        Step [s].
    """
    p0, p1 = pair.pressure[0], pair.pressure[1]
    gap0, slope0, gap1, slope1 = 0.0, 1.0, 0.0, 1.0
    if pipes[0].fixed == 0:
        gap0, slope0 = excess(p0, suction, pipes[0], states[0], nodes[0], h)
    if pipes[1].fixed == 0:
        gap1, slope1 = excess(p1, discharge, pipes[1], states[1], nodes[1], h)
    left0, left1 = _left(p0, gap0, slope0, pipes[0]), _left(p1, gap1, slope1, pipes[1])
    left = max(left0, left1)
    if left <= _TOLERANCE:
        return True
    if pair.phase == _LAST:
        states[0].unsettled += left0 > _NOTABLE
        states[1].unsettled += left1 > _NOTABLE
        return True
    pair.tries += 1
    if pair.phase == _PROBE_FIRST or pair.phase == _PROBE_SECOND:
        column = pair.phase - _PROBE_FIRST
        change = pair.pressure[column] - pair.base[column]
        pair.pump[0, column] = (suction - pair.base_drawn[0]) / change
        pair.pump[1, column] = (discharge - pair.base_drawn[1]) / change
        if column == 0 and pipes[1].fixed == 0:
            _probe(pair, 1, pipes)
        else:
            _newton(pair, pipes)
        return False
    total = (abs(gap0) if left0 > 0.0 else 0.0) + (abs(gap1) if left1 > 0.0 else 0.0)
    pair.slow = 0 if total <= _FAST * pair.left else pair.slow + 1
    if pair.left < math.inf:
        _learn(pair, suction, discharge)
    if total < pair.left:
        _settle_base(pair, suction, discharge, total)
        pair.base_gap[0], pair.base_gap[1] = gap0, gap1
        pair.base_slope[0], pair.base_slope[1] = slope0, slope1
        pair.share = 1.0
    elif pair.slow > _PATIENCE:
        pair.share *= 0.5
    if pair.tries >= MOST_TRIES or pair.share < _LEAST_SHARE:
        pair.phase = _LAST
        pair.pressure[0], pair.pressure[1] = pair.base[0], pair.base[1]
    elif pair.slow % _PATIENCE == 0 and pair.slow > 0:
        _probe(pair, 0 if pipes[0].fixed == 0 else 1, pipes)
    else:
        _newton(pair, pipes)
    return False


@kernel
def _settle_base(pair: Any, suction: float, discharge: float, left: float) -> None:
    pair.base[0], pair.base[1] = pair.pressure[0], pair.pressure[1]
    pair.base_drawn[0], pair.base_drawn[1] = suction, discharge
    pair.left = left


@kernel
def _probe(pair: Any, column: int, pipes: Any) -> None:
    """Set a probe with one pressure changed slightly, in the direction of the next step.

    In the other direction a valve may be on its seat, with another slope.
    """
    _newton(pair, pipes)
    absolute = pair.base[column] + STANDARD_ATMOSPHERE
    step = pair.pressure[column] - pair.base[column]
    size = min(max(abs(step), _PROBE_LEAST * absolute), _PROBE_MOST * absolute)
    upwards = step >= 0.0 or pair.base[column] - size <= pipes[column].vapour
    step = size if upwards else -size
    pair.phase = _PROBE_FIRST + column
    pair.pressure[1 - column] = pair.base[1 - column]
    pair.pressure[column] = pair.base[column] + step


@kernel
def _learn(pair: Any, suction: float, discharge: float) -> None:
    """Broyden's update: least change of the matrix, in relative pressures, to explain a trial."""
    step0, step1 = pair.pressure[0] - pair.base[0], pair.pressure[1] - pair.base[1]
    weight0 = step0 / (pair.base[0] + STANDARD_ATMOSPHERE) ** 2
    weight1 = step1 / (pair.base[1] + STANDARD_ATMOSPHERE) ** 2
    norm = weight0 * step0 + weight1 * step1
    if norm < _TINY:
        return
    for k in range(2):
        drawn = suction if k == 0 else discharge
        off = drawn - pair.base_drawn[k] - pair.pump[k, 0] * step0 - pair.pump[k, 1] * step1
        pair.pump[k, 0] += off * weight0 / norm
        pair.pump[k, 1] += off * weight1 / norm


_TINY = 1e-20  # square of a relative change of pressure that is rounding


@kernel
def _row(pair: Any, k: int) -> Any:
    """Slopes of one node's excess for its own pressure and for the other's, with signs."""
    own = max(pair.pump[k, k], 0.0)
    other = min(max(pair.pump[k, 1 - k], -own), 0.0)
    return pair.base_slope[k] + own, other


@kernel
def _both(own0: float, other0: float, gap0: float, own1: float, other1: float, gap1: float) -> Any:
    """Steps of both pressures by Cramer's rule."""
    whole = own0 * own1 - other0 * other1
    return (other0 * gap1 - own1 * gap0) / whole, (other1 * gap0 - own0 * gap1) / whole


@kernel
def _newton(pair: Any, pipes: Any) -> None:
    """Set the next trial: a Newton step from the base, limited to the vapour pressure."""
    pair.phase = _STEP
    own0, other0 = _row(pair, 0)
    own1, other1 = _row(pair, 1)
    gap0, gap1 = pair.base_gap[0], pair.base_gap[1]
    step0, step1 = 0.0, 0.0
    if pipes[0].fixed != 0:
        step1 = -gap1 / own1
    elif pipes[1].fixed != 0:
        step0 = -gap0 / own0
    else:
        step0, step1 = _both(own0, other0, gap0, own1, other1, gap1)
        low0, low1 = pipes[0].vapour - pair.base[0], pipes[1].vapour - pair.base[1]
        if step0 < low0 or step1 < low1:
            free0, free1 = -(gap0 + other0 * low1) / own0, -(gap1 + other1 * low0) / own1
            if free0 >= low0 and gap1 + own1 * low1 + other1 * free0 >= 0.0:
                step0, step1 = free0, low1
            elif free1 >= low1 and gap0 + own0 * low0 + other0 * free1 >= 0.0:
                step0, step1 = low0, free1
            else:
                step0, step1 = low0, low1
    pair.pressure[0] = _stepped(pair.base[0], pair.share * step0, pipes[0].vapour)
    pair.pressure[1] = _stepped(pair.base[1], pair.share * step1, pipes[1].vapour)


@kernel
def _stepped(base: float, step: float, vapour: float) -> float:
    """Pressure after a step; exactly the vapour pressure if the step reaches it."""
    after = base + step
    return after if after > vapour + _ROUNDING * (base - vapour) else vapour


_ROUNDING = 1e-12
