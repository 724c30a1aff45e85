"""Closed forms of the ideal pump: shape and ripple of its flow, acceleration head."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def flow_shape(angle: ArrayLike, crank_to_rod: float) -> NDArray[np.float64]:
    """Flow into a cylinder with ideal valves, over ``A r w``.

    Parameters
    ----------
    angle : array_like
        Crank angle [rad], 0 at the top dead centre.
    crank_to_rod : float
        Crank radius over rod length, lambda, from 0 to below 1.

    Returns
    -------
    numpy.ndarray [shape as angle]
        ``sin a + lambda sin a cos a / sqrt(1 - lambda^2 sin^2 a)``, negative while delivering.

    Examples
    --------
    >>> float(flow_shape(1.5707963267948966, 0.2))
    1.0
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    root = np.sqrt(1.0 - (crank_to_rod * sine) ** 2)
    return np.asarray(sine * (1.0 + crank_to_rod * cosine / root))


def flow_slope(angle: ArrayLike, crank_to_rod: float) -> NDArray[np.float64]:
    """Derivative of :func:`flow_shape` over the angle."""
    sine, cosine = np.sin(angle), np.cos(angle)
    root = np.sqrt(1.0 - (crank_to_rod * sine) ** 2)
    bend = (cosine**2 - sine**2) / root + (crank_to_rod * sine * cosine) ** 2 / root**3
    return np.asarray(cosine + crank_to_rod * bend)


def even_phases(cylinders: int, turn: float = 2 * math.pi) -> NDArray[np.float64]:
    """Crank offsets of cylinders spread evenly over an angle [rad].

    Parameters
    ----------
    cylinders : int
        Number of cylinders.
    turn : float
        Angle that they share [rad].

    Returns
    -------
    numpy.ndarray [shape=(cylinders,)]
        Offsets from 0 on [rad].

    Examples
    --------
    >>> [round(float(phase), 4) for phase in even_phases(3)]
    [0.0, 2.0944, 4.1888]
    """
    return np.arange(float(cylinders)) * (turn / cylinders)


@dataclass(frozen=True, kw_only=True)
class FlowRipple:
    """Extremes of a pump's flow relative to its mean.

    Attributes
    ----------
    above, below, total : float
        Largest flow above the mean, largest deficit below it, and their sum, over the mean.
    """

    above: float
    below: float
    total: float


def flow_ripple(
    crank_to_rod: float, phases: ArrayLike, *, double_acting: bool = False
) -> FlowRipple:
    """Kinematic flow ripple of an ideal pump: incompressible, valves without delay.

    Parameters
    ----------
    crank_to_rod : float
        Crank radius over rod length, lambda, from 0 to below 1.
    phases : array_like [shape=(n_cylinders,)]
        Offsets of the cranks [rad], see :func:`even_phases`.
    double_acting : bool
        Whether both sides of the pistons deliver; the rod's area is neglected.

    Returns
    -------
    FlowRipple
        From the exact kinematics; the extremes are those of smooth arcs between dead centres,
        accurate to 1e-9 of the mean.

    Raises
    ------
    ValueError
        lambda is outside [0, 1), or there is no cylinder.

    References
    ----------
    Karassik et al., Pump Handbook, chapter on displacement pumps: its table of flow variation
    belongs to lambda = 1/6.

    Examples
    --------
    >>> ripple = flow_ripple(1 / 6, even_phases(3))
    >>> [round(100 * value, 2) for value in (ripple.above, ripple.below, ripple.total)]
    [6.17, 16.95, 23.11]
    """
    offsets = _checked_phases(crank_to_rod, phases)
    arcs = _arcs(offsets)
    flow = _delivered(arcs, offsets, crank_to_rod, double_acting, flow_shape)
    mean = offsets.size * (2.0 if double_acting else 1.0) / math.pi
    above, below = _peak(flow) / mean - 1.0, 1.0 + _peak(-flow) / mean
    return FlowRipple(above=above, below=below, total=above + below)


def acceleration_constant(
    crank_to_rod: float, phases: ArrayLike, *, double_acting: bool = False
) -> float:
    """Constant C of the acceleration head ``h = L V n C / (g K)`` of a rigid liquid column.

    Parameters
    ----------
    crank_to_rod : float
        Crank radius over rod length, lambda, from 0 to below 1.
    phases : array_like [shape=(n_cylinders,)]
        Offsets of the cranks [rad], see :func:`even_phases`.
    double_acting : bool
        Whether both sides of the pistons draw; the rod's area is neglected.

    Returns
    -------
    float
        Constant [min/s]: L line length, V mean speed in the line, n crank speed in rpm, K = 1.

    Raises
    ------
    ValueError
        lambda is outside [0, 1), or there is no cylinder.

    Notes
    -----
    ``C = (2 pi / 60) max(dQ/da) / mean Q``: the steepest rise of the total flow.

    References
    ----------
    Hydraulic Institute, reciprocating pump standard: table of C, computed at lambda = 1/5.

    Examples
    --------
    >>> round(acceleration_constant(0.2, even_phases(3)), 4)
    0.0658
    """
    offsets = _checked_phases(crank_to_rod, phases)
    arcs = _arcs(offsets)
    slope = _delivered(arcs, offsets, crank_to_rod, double_acting, flow_slope, drawn=True)
    mean = offsets.size * (2.0 if double_acting else 1.0) / math.pi
    return 2 * math.pi / 60 * _peak(slope) / mean


def _checked_phases(crank_to_rod: float, phases: ArrayLike) -> NDArray[np.float64]:
    offsets = np.atleast_1d(np.asarray(phases, dtype=float))
    if not 0 <= crank_to_rod < 1:
        raise ValueError(f"crank_to_rod = {crank_to_rod} must be in [0, 1); lengthen the rod")
    if offsets.size == 0:
        raise ValueError("phases must not be empty; give one for each cylinder")
    return offsets


_ARC_POINTS = 513


def _arcs(offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles between neighbouring dead centres [shape=(n_arcs, n_points)], without kinks inside."""
    turn = 2 * math.pi
    centres = np.concatenate([-offsets, math.pi - offsets]) % turn
    kinks = np.unique(np.round(centres, 12))
    ends = np.append(kinks[1:], kinks[0] + turn)
    share = np.arange(_ARC_POINTS) / (_ARC_POINTS - 1)
    return np.asarray(kinks[:, None] + np.multiply.outer(ends - kinks, share))


def _delivered(
    arcs: NDArray[np.float64],
    offsets: NDArray[np.float64],
    crank_to_rod: float,
    double_acting: bool,
    shape: Any,
    *,
    drawn: bool = False,
) -> NDArray[np.float64]:
    """Total flow of all cylinders over ``A r w`` on the arcs, or its slope."""
    angles = arcs + offsets[:, None, None]
    withdraws = (np.sin(angles[..., _ARC_POINTS // 2]) > 0)[..., None]
    flow = shape(angles, crank_to_rod)
    if double_acting:
        return np.asarray(np.where(withdraws, flow, -flow).sum(axis=0))
    return np.asarray(np.where(withdraws == drawn, flow if drawn else -flow, 0.0).sum(axis=0))


def _peak(values: NDArray[np.float64]) -> float:
    """Largest value of sampled smooth arcs, by the parabola through its neighbours."""
    arc, i = np.unravel_index(int(np.argmax(values)), values.shape)
    if i in (0, values.shape[1] - 1):
        return float(values[arc, i])
    before, top, after = values[arc, i - 1 : i + 2]
    bend = before - 2.0 * top + after
    return float(top - (after - before) ** 2 / (8.0 * bend)) if bend < 0 else float(top)
