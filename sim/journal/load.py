"""Load of a journal over time: constant, rotating, periodic with the shaft, or a history."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..jit import kernel, sine_cosine


class Load(NamedTuple):
    """All loads on the journal, over M C omega^2, and alpha."""

    alpha: float
    static_x: float
    static_y: float
    unbalance: float  # of the mass centre over C
    phase: float  # of the unbalance at tau = 0 [rad]
    time: NDArray[np.float64]  # (n,) of the history [rad]
    history: NDArray[np.float64]  # (n, 2)
    orders: NDArray[np.float64]  # (n, 4): order, phase at tau = 0 [rad], peak along X, Y


_NO_HISTORY = (np.zeros(1), np.zeros((1, 2)))


def load(
    *,
    alpha: float,
    static: tuple[float, float] = (0.0, 0.0),
    unbalance: float = 0.0,
    phase: float = 0.0,
    time: ArrayLike | None = None,
    history: ArrayLike | None = None,
    orders: ArrayLike = (),
) -> Load:
    """Load of a run, validated.

    Parameters
    ----------
    alpha : float
        Film force over inertia, > 0.
    static : tuple of float
        Constant part along X and Y, over M C omega^2: weight and static load.
    unbalance : float
        Eccentricity of the mass over C, >= 0; its force rotates with the shaft.
    phase : float
        Its angle from X at tau = 0 [rad].
    time : array_like [shape=(n,)], optional
        Instants of the history [rad], in rising order; a repeated instant is a jump. Before the
        first and after the last the history is constant.
    history : array_like [shape=(n, 2)], optional
        Load along X and Y at those instants, linear between them.
    orders : array_like [shape=(n, 4)], optional
        Periodic loads: cycles per revolution, phase at tau = 0 [rad], peaks along X and Y.

    Returns
    -------
    Load
        Argument of :func:`run_orbit` and :func:`.mass_orbit.mass_orbit`.

    Raises
    ------
    ValueError
        All faults of the arguments together.

    Examples
    --------
    A step of the source paper at tau = 16 pi:

    >>> step = load(alpha=0.83537, static=(0.3972, 0.0), **step_history(16 * math.pi, (1.0, 0.0)))
    >>> load_at(step, 50.0), load_at(step, 51.0)
    ((0.3972, 0.0), (1.3972, 0.0))
    """
    instants, values = _NO_HISTORY
    if time is not None and history is not None:
        instants = np.ascontiguousarray(time, dtype=np.float64)
        values = np.ascontiguousarray(history, dtype=np.float64)
    wrong = []
    if not alpha > 0 or not math.isfinite(alpha):
        wrong.append(f"alpha = {alpha:g} must be > 0 and finite; without a film use no_film()")
    if not unbalance >= 0:
        wrong.append(f"unbalance = {unbalance:g} must be >= 0; reverse it by its phase")
    if (time is None) != (history is None):
        wrong.append("time and history must both be given, or neither")
    if values.shape != (len(instants), 2):
        wrong.append(f"history.shape = {values.shape} must be ({len(instants)}, 2) as time has")
    if not len(instants) or not np.all(np.isfinite(instants)) or not np.all(np.isfinite(values)):
        wrong.append("time and history must be finite and not empty; leave out missing samples")
    elif np.any(np.diff(instants) < 0):
        n = int(np.argmax(np.diff(instants) < 0))
        wrong.append(
            f"time[{n + 1}] = {instants[n + 1]:g} must be >= time[{n}] = {instants[n]:g}; sort them"
        )
    if wrong:
        raise ValueError("\n".join(wrong))
    repeated = np.ascontiguousarray(orders, dtype=np.float64).reshape(-1, 4)
    return Load(alpha, static[0], static[1], unbalance, phase, instants, values, repeated)


def step_history(start: float, size: tuple[float, float]) -> dict[str, NDArray[np.float64]]:
    """History for :func:`load`: zero, then `size` from `start` [rad] on."""
    return {
        "time": np.array([start, start]),
        "history": np.array([(0.0, 0.0), size]),
    }


def rectangular_history(
    start: float, end: float, size: tuple[float, float]
) -> dict[str, NDArray[np.float64]]:
    """History for :func:`load`: `size` from `start` to `end` [rad], else zero."""
    return {
        "time": np.array([start, start, end, end]),
        "history": np.array([(0.0, 0.0), size, size, (0.0, 0.0)]),
    }


def half_sine_history(
    start: float, end: float, size: tuple[float, float], n: int = 257
) -> dict[str, NDArray[np.float64]]:
    """History for :func:`load`: half a sine with that peak from `start` to `end` [rad].

    Sampled at n instants: linear interpolation misses the sine by ``(pi / (n - 1))^2 / 8`` of its
    peak, 2e-5 by default.
    """
    share = np.linspace(0.0, 1.0, n)
    return {
        "time": start + share * (end - start),
        "history": np.sin(np.pi * share)[:, None] * np.asarray(size, dtype=np.float64),
    }


@kernel
def _interval(time: Any, tau: float, first: int) -> int:
    """Index of the last instant not after tau, searched from `first` on; -1 before all."""
    n = first
    while n >= 0 and time[n] > tau:
        n -= 1
    while n + 1 < time.size and time[n + 1] <= tau:
        n += 1
    return n


@kernel
def load_and_rates(q: Load, tau: float, cursor: Any) -> tuple[float, float, float, float]:
    """Load along X and Y, and its rates."""
    x, y, x_slope, y_slope = q.static_x, q.static_y, 0.0, 0.0
    if q.unbalance != 0.0:
        s, c = sine_cosine(tau + q.phase)
        y_slope, x_slope = q.unbalance * c, -q.unbalance * s
        x, y = x + y_slope, y - x_slope
    for k in range(len(q.orders)):
        order, along, across = q.orders[k, 0], q.orders[k, 2], q.orders[k, 3]
        s, c = sine_cosine(order * tau + q.orders[k, 1])
        x, y = x + along * c, y + across * c
        x_slope, y_slope = x_slope - order * along * s, y_slope - order * across * s
    n = _interval(q.time, tau, cursor[0])
    cursor[0] = n
    if n < 0 or n + 1 == q.time.size:
        n = max(n, 0)
        return x + q.history[n, 0], y + q.history[n, 1], x_slope, y_slope
    span = q.time[n + 1] - q.time[n]
    share = (tau - q.time[n]) / span
    dx, dy = q.history[n + 1, 0] - q.history[n, 0], q.history[n + 1, 1] - q.history[n, 1]
    return (
        x + q.history[n, 0] + share * dx,
        y + q.history[n, 1] + share * dy,
        x_slope + dx / span,
        y_slope + dy / span,
    )


def load_at(q: Load, tau: float) -> tuple[float, float]:
    """Load along X and Y at an instant [rad]; at a jump, the value after it."""
    x, y, _, _ = load_and_rates(q, tau, np.zeros(1, np.int64))
    return x, y


def loads_at(q: Load, tau: NDArray[np.float64]) -> NDArray[np.float64]:
    """:func:`load_at` at many instants [shape=(n, 2)]: one call of a kernel for all of them."""
    found = np.empty((len(tau), 2))
    _loads(q, tau, np.zeros(1, np.int64), found)
    return found


@kernel
def _loads(q: Load, tau: Any, cursor: Any, found: Any) -> None:
    for i in range(tau.size):
        found[i, 0], found[i, 1], _, _ = load_and_rates(q, tau[i], cursor)
