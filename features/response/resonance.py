"""One resonance of one response function: found by its prominence, read by half power or circle."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from ..signal.spectrum import decibel
from .modal_model import (
    FEWEST_LINES,
    WIDEST,
    Quantity,
    checked_functions,
    derivative_order,
    squared_size,
)

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integer = NDArray[np.intp]

PROMINENCE = 6.0
"""Rise of a resonance above the valleys beside it [dB]: ten averages at a coherence of 0.9 scatter
by 0.65 dB a line, and hardly ever make one."""

_MOST_MISFIT = 0.05  # of the diameter of a fitted circle


@dataclass(frozen=True, kw_only=True)
class Resonance:
    """One mode read from one response function.

    Attributes
    ----------
    frequency : float
        Undamped natural frequency [Hz].
    damping_ratio : float
        [-]
    residue : complex
        Of the receptance at its pole, as in `Modes` [unit of receptance * rad/s].
    fit_error : float
        Rms departure of the lines used from the fitted curve, over the size of the resonance
        (half power: in ``1 / |H|^2``, nothing is left over with three lines; circle: of its
        diameter) [-].
    n_lines : int
        Lines used.
    """

    frequency: float
    damping_ratio: float
    residue: complex
    fit_error: float
    n_lines: int


def find_resonances(
    frequency: ArrayLike, value: ArrayLike, *, prominence: float = PROMINENCE
) -> Integer:
    """Lines of the resonance peaks that all response functions show together.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        [Hz]
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions, of one quantity and unit.
    prominence : float
        Rise above the higher of the two valleys beside it, > 0 [dB].

    Returns
    -------
    ndarray of int, shape (n_peaks,)
        Indices of the lines, ascending; empty where nothing stands out.

    Raises
    ------
    ValueError
        If shapes do not agree, a line is not finite, a channel is silent or `prominence` is not
        > 0.

    Notes
    -----
    Peaks of ``10 log10 sum |H|^2`` over the channels: a channel at a node of a mode misses it,
    the sum does not. Two modes closer than their half-power width make one peak; `stable_modes`
    tells them apart.

    Examples
    --------
    >>> f = np.arange(100.0)
    >>> value = 1 / (30**2 - f**2 + 1.2j * f) + 1 / (70**2 - f**2 + 2.8j * f)
    >>> find_resonances(f, value).tolist()
    [30, 70]
    """
    from scipy.signal import find_peaks  # half a second, which no report needs

    _, functions = checked_functions(frequency, value)
    if not prominence > 0:
        raise ValueError(f"prominence = {prominence} dB must be > 0; 6 dB is usual")
    level = decibel(np.sum(squared_size(functions / np.abs(functions).max()), axis=0))
    peaks, _ = find_peaks(level, prominence=prominence)
    return np.asarray(peaks, dtype=np.intp)


def half_power(
    frequency: ArrayLike,
    value: ArrayLike,
    line: int,
    *,
    quantity: Quantity = "receptance",
) -> Resonance:
    """Natural frequency and damping of a resonance from its half-power points.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        [Hz]
    value : array_like, shape (n_lines,)
        One response function.
    line : int
        Index of a peak, as from `find_resonances`.
    quantity : str
        What `value` is: ``receptance``, ``mobility`` or ``accelerance``.

    Returns
    -------
    Resonance

    Raises
    ------
    ValueError
        If the magnitude does not peak at `line`, or does not fall to half the power on both sides
        before it rises again: then a neighbour is too near for this method.

    Notes
    -----
    With f1 and f2 where the receptance has fallen to ``1 / sqrt(2)`` of its peak, and
    ``S = (f1^2 + f2^2) / 2``, ``D = (f2^2 - f1^2) / 2``::

        f0^4 = S^2 + D^2,    zeta = sin(atan2(D, S) / 2)

    which is exact for one viscously damped mode (the usual ``(f2 - f1) / (2 f0)`` is its limit).
    Mobility and accelerance are divided by s and s^2 first. ``1 / |H|^2`` of such a mode is a
    parabola in f^2, hence peak and crossings are read from parabolas through three lines, again
    without error. Neighbours, noise on the few lines used, and leakage where the half-power width
    is below some five lines, are errors that this method does not see.

    References
    ----------
    D. J. Ewins, "Modal Testing: Theory, Practice and Application", 2nd ed., Research Studies Press
    2000, section 4.2.

    Examples
    --------
    >>> f = np.arange(1.0, 100.0)
    >>> found = half_power(f, 1 / (40.3**2 - f**2 + 2j * 0.03 * 40.3 * f), 39)
    >>> round(found.frequency, 6), round(found.damping_ratio, 6)
    (40.3, 0.03)
    """
    f, receptance, line = _peak_of(frequency, value, line, quantity)
    square, power = f**2, squared_size(receptance)
    stiffness = 1 / np.maximum(power, 1e-30 * power.max())  # of any line that is exactly 0
    lowest = _vertex(square[line - 1 : line + 2], stiffness[line - 1 : line + 2])
    below, above = (_doubled(square, stiffness, line, lowest, step) for step in (-1, 1))
    middle, width = (above + below) / 2, (above - below) / 2
    f0 = math.sqrt(math.hypot(middle, width))
    ratio = math.sin(math.atan2(width, middle) / 2)
    used = np.flatnonzero((square >= below) & (square <= above))
    # The lines next to them test the shape too.
    around = slice(used.min(initial=line) - 1, used.max(initial=line) + 2)
    shape = np.square(f0**2 - square) + 4 * ratio**2 * f0**2 * square
    error = stiffness / shape * (4 * ratio**2 * (1 - ratio**2) * f0**4 / lowest) - 1
    gain = complex(receptance[line]) * complex(f0**2 - square[line], 2 * ratio * f0 * f[line])
    return Resonance(
        frequency=f0,
        damping_ratio=ratio,
        residue=gain * 2 * math.pi / (2j * f0 * math.sqrt(1 - ratio**2)),
        fit_error=float(np.sqrt(np.mean(np.square(error[around])))),
        n_lines=error[around].size,
    )


def _peak_of(
    frequency: ArrayLike, value: ArrayLike, line: int, quantity: Quantity
) -> tuple[Float, Complex, int]:
    """Lines above 0 Hz, receptance on them, and the index of its peak there."""
    derivative = derivative_order(quantity)
    f, functions = checked_functions(frequency, value)
    if functions.shape[0] != 1:
        raise ValueError(f"value has {functions.shape[0]} channels, must have 1; give one row")
    size = np.abs(functions[0])
    if not 0 < line < f.size - 1:
        raise ValueError(f"line = {line} must be > 0 and < n_lines - 1 = {f.size - 1}; add lines")
    if size[line] == 0 or size[line] < max(size[line - 1], size[line + 1]):
        raise ValueError(
            f"line = {line} ({f[line]:.6g} Hz) must be a peak of the magnitude; take one of "
            "find_resonances"
        )
    start = int(f[0] == 0)
    f, at = f[start:], line - start
    receptance = functions[0, start:] / (2j * np.pi * f) ** derivative
    size = np.abs(receptance)
    # s^d moves the peak of a damped mode by some lines.
    while 0 < at < f.size - 1 and size[at] < max(size[at - 1], size[at + 1]):
        at += 1 if size[at + 1] > size[at - 1] else -1
    if not 0 < at < f.size - 1:
        raise ValueError(
            f"receptance about {f[line - start]:.6g} Hz must peak inside the lines; add lines "
            "beyond the resonance"
        )
    return f, receptance, at


def _parabola(x: Float, y: Float) -> tuple[float, float, float]:
    """Coefficients about the middle one of three points, highest power first."""
    left, right = (y[0] - y[1]) / (x[0] - x[1]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    return float(bend), float(left + bend * (x[1] - x[0])), float(y[1])


def _vertex(x: Float, y: Float) -> float:
    """Least value of the parabola through three points, the middle one lowest."""
    bend, slope, height = _parabola(x, y)
    return height - slope**2 / (4 * bend) if bend > 0 else height


def _doubled(x: Float, y: Float, line: int, lowest: float, step: int) -> float:
    """Where y, going from `line` in steps, reaches twice its lowest value."""
    at = line
    while y[at] < 2 * lowest:
        at += step
        if not 0 <= at < y.size or y[at] < lowest * (1 - 1e-9):
            side = "above" if step > 0 else "below"
            raise ValueError(
                f"resonance at line {line} must fall to half its power {side} before the "
                "functions end or rise to a higher peak; use circle_fit or modal_fit"
            )
    middle = min(max(at - step if at != line else line, 1), y.size - 2)
    three = slice(middle - 1, middle + 2)
    bend, slope, height = _parabola(x[three], y[three])
    roots = (np.roots([bend, slope, height - 2 * lowest]) + x[middle]).real
    if at == line:  # the peak is narrower than the lines: both crossings lie on its parabola
        return float(roots.max() if step > 0 else roots.min())
    return float(roots[np.argmin(np.abs(roots - (x[at] + x[at - step]) / 2))])


def circle_fit(
    frequency: ArrayLike,
    value: ArrayLike,
    line: int,
    *,
    quantity: Quantity = "receptance",
    share: float = 0.5,
) -> Resonance:
    """Natural frequency, damping and residue from the circle a mode draws in the Nyquist plane.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        [Hz]
    value : array_like, shape (n_lines,)
        One response function.
    line : int
        Index of a peak, as from `find_resonances`.
    quantity : str
        What `value` is: ``receptance``, ``mobility`` or ``accelerance``.
    share : float
        Lines on both sides are used as long as the magnitude of the mobility is at least this
        share of its peak, 0 < share < 1 [-].

    Returns
    -------
    Resonance

    Raises
    ------
    ValueError
        If there is no peak, fewer than five lines lie on the arc, they depart from a circle by
        more than a twentieth of its diameter, or run through it against the clock: then the data
        belong to ``exp(-j w t)`` or to no passive structure.

    Notes
    -----
    The mobility of a viscously damped mode, with G its modal constant and any constant B for its
    neighbours, is ``B + G / (2 zeta w0 + j (w - w0^2 / w))``: exactly a circle, on which the angle
    from the resonance is ``-2 atan((w - w0^2 / w) / (2 zeta w0))``. The circle is fitted to the
    lines by algebraic least squares, then frequency and damping to the angles. Neighbours that
    vary over the lines used are an error; a share nearer to 1 takes fewer lines and less of it.
    Beside an equal mode six half-power widths away the frequency comes out some twenty times
    nearer than by `half_power`, the damping no better.

    References
    ----------
    C. C. Kennedy, C. D. P. Pancu, "Use of vectors in vibration measurement and analysis", J.
    Aeronaut. Sci. 14 (1947) 603-625, doi:10.2514/8.1479.

    Examples
    --------
    >>> f = np.arange(1.0, 100.0, 0.5)
    >>> mode = 1 / (40.3**2 - f**2 + 2j * 0.03 * 40.3 * f)
    >>> found = circle_fit(f, mode + (1 - 2j) * 1e-4 / f, 79)  # a constant of the mobility
    >>> round(found.frequency, 6), round(found.damping_ratio, 6)
    (40.3, 0.03)
    """
    if not 0 < share < 1:
        raise ValueError(f"share = {share} must be > 0 and < 1; 0.5 is usual")
    f, receptance, at = _peak_of(frequency, value, line, quantity)
    omega = 2 * np.pi * f
    mobility = 1j * omega * receptance
    first, last = _around(np.abs(mobility), at, share)
    arc, omega = mobility[first:last], omega[first:last]
    if arc.size < FEWEST_LINES:
        raise ValueError(
            f"resonance at {f[at]:.6g} Hz has {arc.size} lines above {share} of its peak, must "
            f"have >= {FEWEST_LINES}; resolve the lines finer, lower share, or use modal_fit"
        )
    centre, radius = _circle(arc)
    angle = np.unwrap(np.angle(arc - centre))
    if angle[-1] >= angle[0]:
        raise ValueError(
            f"phase at {f[at]:.6g} Hz rises with frequency, must fall; conjugate data of the "
            "convention exp(-j w t), else the peak is no mode of a passive structure"
        )
    error = float(np.std(np.abs(arc - centre)) / (2 * radius))
    if error > _MOST_MISFIT:
        raise ValueError(
            f"lines about {f[at]:.6g} Hz depart by {error:.3g} of the diameter from a circle, must "
            f"by <= {_MOST_MISFIT}; average more, or raise share to leave neighbours out"
        )
    top, w0, rate = _angle_fit(omega, angle, at - first)
    ratio = rate / (2 * w0)
    if not (rate > 0 and ratio < WIDEST and omega[0] < w0 < omega[-1]):
        raise ValueError(
            f"damping_ratio = {ratio:.3g} must be > 0 and < {WIDEST}, and frequency = "
            f"{w0 / (2 * math.pi):.6g} Hz among the lines used; use modal_fit"
        )
    gain = 2 * radius * rate * np.exp(1j * top)
    return Resonance(
        frequency=w0 / (2 * math.pi),
        damping_ratio=ratio,
        residue=complex(gain / (2j * w0 * math.sqrt(1 - ratio**2))),
        fit_error=error,
        n_lines=arc.size,
    )


def _around(size: Float, at: int, share: float) -> tuple[int, int]:
    """First and one past the last of the lines about a peak that reach a share of it."""
    low = np.flatnonzero(size < share * size[at])
    first = low[low < at].max(initial=-1) + 1
    last = low[low > at].min(initial=size.size)
    return int(first), int(last)


def _circle(points: Complex) -> tuple[complex, float]:
    """Centre and radius of the circle nearest to the points, in the algebraic sense."""
    scale = float(np.abs(points).max())
    x, y = points.real / scale, points.imag / scale
    table = np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1)
    a, b, c = np.linalg.lstsq(table, x**2 + y**2, rcond=None)[0]
    return complex(a, b) * scale, float(np.sqrt(c + a**2 + b**2) * scale)


def _angle_fit(omega: Float, angle: Float, peak: int) -> tuple[float, float, float]:
    """Angle of the resonance [rad], w0 and 2 zeta w0 [rad/s] from angles on the circle."""
    speed = -np.gradient(angle, omega).min()  # at the resonance: 4 / (2 zeta w0)
    width = 4 / speed
    start = omega[peak]

    def misfit(unknown: Float) -> Float:
        w0 = start + unknown[1] * width
        turn = 2 * np.arctan((omega - w0**2 / omega) / (unknown[2] * width))
        return np.asarray(unknown[0] - turn - angle)

    found = least_squares(misfit, [angle[peak], 0.0, 1.0], method="lm", xtol=1e-14, ftol=1e-14).x
    return float(found[0]), float(start + found[1] * width), float(found[2] * width)
