"""Modes from frequency response functions, and two functions held against each other.

Resonances -> half power, circle or least squares in the complex frequency -> natural frequency,
damping, residue, each with its deviation -> synthesis. Then what a change has done: band levels,
resonance shift, assurance criteria.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares, linear_sum_assignment

from ..signal.spectrum import decibel

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integer = NDArray[np.intp]
Quantity = Literal["receptance", "mobility", "accelerance"]

DERIVATIVES = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Response over force -> how often the displacement is differentiated."""

FEWEST_LINES = 5
"""Lines that a fit of one mode needs: a pole, a residue and two background terms are four."""

PROMINENCE = 6.0
"""Rise of a resonance above the valleys beside it [dB]: ten averages at a coherence of 0.9 scatter
by 0.65 dB a line, and hardly ever make one."""

FREQUENCY_TOLERANCE = 0.01
"""Change of a stable pole's natural frequency from one model order to the next [-]."""

DAMPING_TOLERANCE = 0.05
"""Change of a stable pole's damping ratio, relative to it [-]."""

LEAST_CHAIN = 5
"""Successive model orders through which a pole must stay stable to count as a mode."""

_SIZES = (1e-60, 1e60)  # of functions: their squares and fourth powers must stay numbers
_ARC = 0.95  # of the unit circle taken by the band: a gap, as the function does not close on itself
_MOST_DOUBT = 1 / 3  # standard deviation of a mode's residue in its best channel, relative to it
_LEAST_DIFFERENCE = 1e-7  # of the effects of two poles: about the root of the rounding
_MOST_MISFIT = 0.05  # of the diameter of a fitted circle
_MOST_GROWTH = 5.0  # natural logarithm of how far a start's damping may be wrong
_WIDEST = 0.5  # damping ratio: a pole further from the axis is background, not a resonance


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


@dataclass(frozen=True, kw_only=True)
class Modes:
    """Modal model of the response functions of one force.

    The receptance is ``sum_r A_r / (s - p_r) + conj(A_r) / (s - conj(p_r)) + L / s^2 + U`` with
    ``p = 2 pi f (-zeta + j sqrt(1 - zeta^2))``; mobility and accelerance are s and s^2 times it.

    Attributes
    ----------
    frequency : ndarray, shape (n_modes,)
        Undamped natural frequencies f, ascending [Hz].
    damping_ratio : ndarray, shape (n_modes,)
        zeta [-].
    residue : ndarray, shape (n_channels, n_modes)
        A, of the receptance [unit of receptance * rad/s].
    lower, upper : ndarray, shape (n_channels,)
        L and U, what the modes below and above the band leave in it [unit of receptance *
        rad^2/s^2 and unit of receptance].
    quantity : str
        What the fitted functions were: ``receptance``, ``mobility`` or ``accelerance``.
    frequency_deviation : ndarray, shape (n_modes,)
        Standard deviation of `frequency` from the scatter about the fit [Hz].
    damping_deviation : ndarray, shape (n_modes,)
        Of `damping_ratio` [-].
    residue_deviation : ndarray, shape (n_channels, n_modes)
        Of `residue`, root of the summed variances of its two parts.
    fit_error : ndarray, shape (n_channels,)
        Rms difference of fit and data over the rms of the data [-].
    """

    frequency: Float
    damping_ratio: Float
    residue: Complex
    lower: Complex
    upper: Complex
    quantity: Quantity
    frequency_deviation: Float
    damping_deviation: Float
    residue_deviation: Float
    fit_error: Float

    def __repr__(self) -> str:
        """Number of modes, and where they lie."""
        told = ", ".join(f"{each:.4g}" for each in self.frequency[:6])
        more = ", …" if len(self.frequency) > 6 else ""
        return f"<Modes of {self.quantity}, {len(self.frequency)}: {told}{more} Hz>"

    @property
    def pole(self) -> Complex:
        """Poles in the upper half plane, shape (n_modes,) [rad/s]."""
        return poles_of(self.frequency, self.damping_ratio)

    @property
    def modal_constant(self) -> Complex:
        """``2 j w_d A``, shape (n_channels, n_modes): a product of two mass-normalised shapes.

        Real for proportional damping [1/kg where displacement and force are in SI units].
        """
        return np.asarray(2j * self.pole.imag * self.residue)


def poles_of(frequency: ArrayLike, damping_ratio: ArrayLike) -> Complex:
    """Poles of underdamped modes.

    Parameters
    ----------
    frequency : array_like
        Undamped natural frequency f [Hz].
    damping_ratio : array_like
        zeta, below 1 [-].

    Returns
    -------
    ndarray
        ``2 pi f (-zeta + j sqrt(1 - zeta^2))`` [rad/s].

    Examples
    --------
    >>> poles_of(1 / (2 * np.pi), 0.6).round(12).item()
    (-0.6+0.8j)
    """
    ratio = np.asarray(damping_ratio, dtype=np.float64)
    omega = 2 * np.pi * np.asarray(frequency, dtype=np.float64)
    return np.asarray(omega * (-ratio + 1j * np.sqrt(1 - ratio**2)))


def _frequency_and_damping(pole: Complex) -> tuple[Float, Float]:
    size = np.abs(pole)
    return np.asarray(size / (2 * np.pi)), np.asarray(-pole.real / size)


# --- input


def _functions(
    frequency: ArrayLike, value: ArrayLike, *, least: int = FEWEST_LINES
) -> tuple[Float, Complex]:
    """Lines (n_lines,) and functions (n_channels, n_lines), or all that is wrong with them."""
    lines = np.asarray(frequency, dtype=np.float64)
    functions = np.atleast_2d(np.asarray(value, dtype=np.complex128))
    if lines.ndim != 1 or functions.ndim != 2 or functions.shape[-1] != lines.size:
        raise ValueError(
            f"frequency has shape {lines.shape} and value {np.shape(value)}, must be (n_lines,) "
            "and (n_channels, n_lines); give one row a channel"
        )
    faults = []
    if lines.size < least:
        faults.append(f"n_lines = {lines.size} must be >= {least}; widen the band")
    if not np.all(np.isfinite(lines)) or np.any(np.diff(lines) <= 0) or np.any(lines[:1] < 0):
        faults.append("frequency must be finite, >= 0 Hz and increasing; sort the lines")
    wrong = np.count_nonzero(~np.isfinite(functions))
    if wrong:
        faults.append(f"value has {wrong} non-finite lines, must have 0; cut or mend them")
    elif functions.size:
        peaks = np.abs(functions).max(axis=-1)
        odd = np.flatnonzero((peaks < _SIZES[0]) | (peaks > _SIZES[1])).tolist()
        if odd:
            faults.append(
                f"value peaks at {peaks[odd[0]]:.3g} in channels {odd}, must at {_SIZES[0]} … "
                f"{_SIZES[1]}; leave out dead channels, use SI units"
            )
    if faults:
        raise ValueError("; ".join(faults))
    return lines, functions


def _derivative(quantity: str) -> int:
    if quantity not in DERIVATIVES:
        raise ValueError(f"quantity = {quantity!r} must be one of {', '.join(get_args(Quantity))}")
    return DERIVATIVES[quantity]


# --- one resonance


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

    _, functions = _functions(frequency, value)
    if not prominence > 0:
        raise ValueError(f"prominence = {prominence} dB must be > 0; 6 dB is usual")
    level = decibel(np.sum(_square(functions / np.abs(functions).max()), axis=0))
    peaks, _ = find_peaks(level, prominence=prominence)
    return np.asarray(peaks, dtype=np.intp)


def _square(z: Complex) -> Float:
    return np.asarray(np.square(z.real) + np.square(z.imag))


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
    square, power = f**2, _square(receptance)
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
    derivative = _derivative(quantity)
    f, functions = _functions(frequency, value)
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
    if not (rate > 0 and ratio < _WIDEST and omega[0] < w0 < omega[-1]):
        raise ValueError(
            f"damping_ratio = {ratio:.3g} must be > 0 and < {_WIDEST}, and frequency = "
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


# --- least squares in the complex frequency


def complex_frequency_poles(
    frequency: ArrayLike,
    value: ArrayLike,
    orders: Iterable[int],
    *,
    deviation: ArrayLike | None = None,
    decay: float = 0.0,
) -> list[Complex]:
    """Poles by linear least squares in the complex frequency (LSCF), for several model orders.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Lines of the band [Hz].
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions to one force: receptance, mobility or accelerance.
    orders : iterable of int
        Numbers of poles, each >= 1 and <= (n_lines - 1) / 2.
    deviation : array_like, optional
        Standard deviation of every line, or anything in proportion to it, such as `Frf.radius`;
        shape as `value` or one that broadcasts to it [unit of value]. Lines count alike by
        default.
    decay : float
        Rate of the exponential window the functions carry [1/s], see `Frf.decay`.

    Returns
    -------
    list of ndarray
        For each order the poles whose damped frequency lies in the band, ascending in it [rad/s].
        Those that grow (real part > 0) are the excess poles of a model of high order, and are to
        be left out.

    Raises
    ------
    ValueError
        If the data or the orders cannot be used; all faults are named.

    Notes
    -----
    All channels share the denominator of ``N_c(z) / D(z)`` with ``z = exp(s T)``, the band laid
    over 95 % of the unit circle and coefficients complex, so that bands may start anywhere and
    high orders stay well conditioned. ``sum |W (N_c - D H_c)|^2`` is least with the constant
    coefficient of D at 1, which sends the excess poles outside the circle. It is linear, hence
    without starting values, and biased: noise of a share r of the response shifts a pole by the
    order of r^2 of its width. `fit_modes` removes the bias.

    References
    ----------
    P. Guillaume, P. Verboven, S. Vanlanduit, H. Van der Auweraer, B. Peeters, "A poly-reference
    implementation of the least-squares complex frequency-domain estimator", IMAC XXI (2003).
    B. Cauberghe, P. Guillaume, P. Verboven, S. Vanlanduit, E. Parloo, "On the influence of the
    parameter constraint on the stability of the poles and the discrimination capabilities of the
    stabilisation diagrams", Mech. Syst. Signal Process. 19 (2005) 989-1014.

    Examples
    --------
    >>> f = np.arange(20.0, 60.0, 0.5)
    >>> value = 1 / (40.3**2 - f**2 + 2j * 0.01 * 40.3 * f)
    >>> [poles] = complex_frequency_poles(f, value, [8])
    >>> (abs(poles[poles.real < 0]) / (2 * np.pi)).round(4).tolist()
    [40.3]
    """
    lines, functions = _functions(frequency, value)
    wanted = [int(order) for order in orders]
    most = (lines.size - 1) // 2
    wrong = [order for order in wanted if not 1 <= order <= most]
    if wrong or not wanted:
        raise ValueError(
            f"orders {wrong} must be >= 1 and <= (n_lines - 1) / 2 = {most}; "
            "lower the order or widen the band"
        )
    weights = _weights(deviation, functions)
    span = float(lines[-1] - lines[0])
    powers = np.exp(2j * np.pi * _ARC / span * (lines - lines[0]))
    products, projected = _normal_equations(powers, functions, weights, max(wanted))
    found = []
    for order in wanted:
        zeros = _denominator_zeros(products, projected, order)
        zeros = zeros[zeros != 0]
        turn = np.angle(zeros * np.exp(-1j * np.pi * _ARC)) + np.pi * _ARC
        pole = (np.log(np.abs(zeros)) + 1j * turn) * (span / _ARC) + 2j * np.pi * lines[0]
        inside = (pole.imag > 2 * np.pi * lines[0]) & (pole.imag < 2 * np.pi * lines[-1])
        pole = pole[inside] + decay
        found.append(np.asarray(pole[np.argsort(pole.imag)]))
    return found


def _weights(deviation: ArrayLike | None, functions: Complex) -> Float:
    """One over the deviations, (1, n_lines) or (n_channels, n_lines), of size one."""
    if deviation is None:
        return np.ones((1, functions.shape[1]))
    scatter = np.atleast_2d(np.asarray(deviation, dtype=np.float64))
    if scatter.shape not in ((1, functions.shape[1]), functions.shape):
        raise ValueError(
            f"deviation has shape {np.shape(deviation)}, must have that of value, "
            f"{functions.shape}; give one number a line"
        )
    if not np.all(np.isfinite(scatter) & (scatter > 0)):
        raise ValueError("deviation must be > 0 and finite on every line; cut the lines without")
    return np.asarray(scatter.min() / scatter)


def _normal_equations(
    powers: Complex, functions: Complex, weights: Float, order: int
) -> tuple[Complex, list[Complex]]:
    """Products of the columns ``z^k H`` and, channel by channel, their parts along ``z^k``."""
    columns = powers[:, np.newaxis] ** np.arange(order + 1)
    products = np.zeros((order + 1, order + 1), dtype=np.complex128)
    projected = []
    bases = [np.linalg.qr(columns * weight[:, np.newaxis])[0] for weight in weights]
    for channel, values in enumerate(functions):
        shared = channel if len(bases) > 1 else 0
        rows = columns * (values * weights[shared])[:, np.newaxis]
        products += rows.conj().T @ rows
        projected.append(bases[shared].conj().T @ rows)
    return products, projected


def _denominator_zeros(products: Complex, projected: list[Complex], order: int) -> Complex:
    """Zeros of D of one order, its constant coefficient being 1.

    The numerators are eliminated: orthonormal columns are nested, so the first ones of the highest
    order serve every lower one.
    """
    kept = slice(order + 1)
    matrix = products[kept, kept].copy()
    for part in projected:
        matrix -= part[kept, kept].conj().T @ part[kept, kept]
    tail = np.linalg.lstsq(matrix[1:, 1:], -matrix[1:, 0], rcond=1e-13)[0]
    return np.asarray(np.roots(np.concatenate([tail[::-1], [1.0]])), dtype=np.complex128)


@dataclass(frozen=True, kw_only=True)
class Stabilisation:
    """Decaying poles of ascending model orders, one entry a pole: the stabilisation diagram.

    Attributes
    ----------
    order : ndarray of int, shape (n_poles,)
        Model order.
    frequency : ndarray, shape (n_poles,)
        Undamped natural frequency [Hz].
    damping_ratio : ndarray, shape (n_poles,)
        [-]
    chain : ndarray of int, shape (n_poles,)
        Poles with one number continue each other from order to order.
    length : ndarray of int, shape (n_poles,)
        Poles of the chain so far; above 1 this one is stable.
    """

    order: Integer
    frequency: Float
    damping_ratio: Float
    chain: Integer
    length: Integer

    def modes(self, *, least: int = LEAST_CHAIN) -> tuple[Float, Float]:
        """Frequencies [Hz] and damping ratios, medians of the chains of `least` poles or more.

        Chains within their damping of each other count as one, unless they mostly run side by
        side: a pole whose damping jumps starts a new chain, close modes stand in the same orders.
        """
        accepted: list[tuple[float, float, set[int]]] = []
        number, count = np.unique(self.chain, return_counts=True)
        for chain in number[count >= least][np.argsort(-count[count >= least], kind="stable")]:
            mine = self.chain == chain
            f, ratio = (float(np.median(x[mine])) for x in (self.frequency, self.damping_ratio))
            orders = set(self.order[mine].tolist())
            if not any(
                abs(f - other) <= max(ratio, damping) * f and 2 * len(orders & own) < len(orders)
                for other, damping, own in accepted
            ):
                accepted.append((f, ratio, orders))
        table = np.array(sorted(mode[:2] for mode in accepted), dtype=np.float64).reshape(-1, 2)
        return table[:, 0], table[:, 1]


def stabilise(
    poles: Iterable[ArrayLike],
    orders: Iterable[int],
    *,
    frequency_tolerance: float = FREQUENCY_TOLERANCE,
    damping_tolerance: float = DAMPING_TOLERANCE,
) -> Stabilisation:
    """Follow poles from one model order to the next.

    Parameters
    ----------
    poles : iterable of array_like
        Poles of each order, as from `complex_frequency_poles` [rad/s].
    orders : iterable of int
        Their orders, ascending.
    frequency_tolerance, damping_tolerance : float
        Largest relative changes of natural frequency and damping ratio between successive orders
        at which a pole is the same one [-].

    Returns
    -------
    Stabilisation
        Of the poles that decay, with damping ratios up to one half.

    Raises
    ------
    ValueError
        If a tolerance is not > 0.

    Notes
    -----
    Pairs are formed nearest first, each pole used once, so two close modes keep their own chains.
    A chain that has missed an order may be taken up again.

    References
    ----------
    R. J. Allemang, D. L. Brown, "A unified matrix polynomial approach to modal identification", J.
    Sound Vib. 211 (1998) 301-322.

    Examples
    --------
    >>> diagram = stabilise([[-1 + 50j], [-1 + 50j, -2 + 80j], [-1.01 + 50j]], [1, 2, 3])
    >>> diagram.chain.tolist(), diagram.length.tolist()
    ([0, 0, 1, 0], [1, 2, 1, 3])
    """
    if not (frequency_tolerance > 0 and damping_tolerance > 0):
        raise ValueError(
            f"frequency_tolerance = {frequency_tolerance} and damping_tolerance = "
            f"{damping_tolerance} must be > 0; 0.01 and 0.05 are usual"
        )
    tolerances = frequency_tolerance, damping_tolerance
    rows: list[tuple[int, complex, int, int]] = []
    latest: list[complex] = []  # pole of every chain
    lengths: list[int] = []
    for order, found in zip(orders, poles, strict=True):
        kept = [complex(p) for p in np.asarray(found) if 0 < -p.real < _WIDEST * abs(p)]
        follows = _continued(latest, kept, tolerances)
        for i, pole in enumerate(kept):
            chain = follows.get(i, len(latest))
            if chain == len(latest):
                latest.append(pole)
                lengths.append(0)
            latest[chain] = pole
            lengths[chain] += 1
            rows.append((order, pole, chain, lengths[chain]))
    frequency, ratio = _frequency_and_damping(np.array([row[1] for row in rows], dtype=complex))
    number, chain_of, length_of = (
        np.array([row[i] for row in rows], dtype=np.intp) for i in (0, 2, 3)
    )
    return Stabilisation(
        order=number, frequency=frequency, damping_ratio=ratio, chain=chain_of, length=length_of
    )


def _continued(
    old: list[complex], new: list[complex], tolerances: tuple[float, float]
) -> dict[int, int]:
    """New pole -> the old one it continues, nearest pairs first."""
    if not old or not new:
        return {}
    was, now = np.array(old), np.array(new)[:, np.newaxis]
    frequency, ratio = _frequency_and_damping(was)
    frequency_now, ratio_now = _frequency_and_damping(now)
    same = np.abs(frequency_now - frequency) <= tolerances[0] * frequency
    same &= np.abs(ratio_now - ratio) <= tolerances[1] * ratio
    follows: dict[int, int] = {}
    for flat in np.argsort(np.abs(now - was), axis=None):
        i, j = divmod(int(flat), len(old))
        if same[i, j] and i not in follows and j not in follows.values():
            follows[i] = j
    return follows


# --- the whole model


@dataclass(frozen=True)
class _Problem:
    """Weighted lines of all channels, against which poles are judged.

    `s` (n_lines,), `factor` = s^d (n_lines,), `weights` (1 or n_channels, n_lines), `target`
    (n_channels, 2 n_lines) weighted real and imaginary parts.
    """

    s: Complex
    factor: Complex
    weights: Float
    target: Float

    def rows(self, columns: Complex) -> Float:
        """Weighted real and imaginary parts: (…, n_lines, k) -> (…, 2 n_lines, k)."""
        scaled = columns * (self.weights * self.factor)[..., np.newaxis]
        return np.concatenate([scaled.real, scaled.imag], axis=-2)

    def fit(self, pole: Complex) -> tuple[Float, Float, Float]:
        """Orthonormal basis, its triangle, and the coefficients (n_channels, 2 n_modes + 4)."""
        basis, triangle = np.linalg.qr(self.rows(_columns(self.s, pole)))
        parts = np.swapaxes(basis, -1, -2) @ self.target[..., np.newaxis]
        # Two poles may meet on the way to the solution: then no plain inverse exists.
        return basis, triangle, (np.linalg.pinv(triangle) @ parts)[..., 0]

    def residual(self, pole: Complex) -> Float:
        """Target less its best fit with these poles, (n_channels, 2 n_lines)."""
        basis = np.linalg.qr(self.rows(_columns(self.s, pole)))[0]
        return np.asarray(self.target - _along(basis, self.target[..., np.newaxis])[..., 0])

    def slopes(self, pole: Complex, residue: Complex) -> Float:
        """Change of the model per change of the real and the imaginary parts of the poles.

        Shape (n_channels, 2 n_lines, 2 n_modes) [s/rad].
        """
        direct, mirrored = (
            1 / np.square(self.s[:, np.newaxis] - p) * a[:, np.newaxis]
            for p, a in ((pole, residue), (pole.conj(), residue.conj()))
        )
        return self.rows(np.concatenate([direct + mirrored, 1j * (direct - mirrored)], axis=-1))


def _along(basis: Float, columns: Float) -> Float:
    return np.asarray(basis @ (np.swapaxes(basis, -1, -2) @ columns))


def _columns(s: Complex, pole: Complex) -> Complex:
    """Columns of the real parameters Re A, Im A of each mode, L and U, in the receptance.

    The four of the background are scaled to the size of the lines, which keeps them in step.
    """
    direct, mirrored = (1 / (s[:, np.newaxis] - p) for p in (pole, pole.conj()))
    lower = np.square(np.abs(s).mean() / s)[:, np.newaxis]
    upper = np.ones_like(lower)
    return np.concatenate(
        [direct + mirrored, 1j * (direct - mirrored), lower, 1j * lower, upper, 1j * upper], axis=1
    )


def fit_modes(
    frequency: ArrayLike,
    value: ArrayLike,
    start_frequency: ArrayLike,
    start_damping: ArrayLike,
    *,
    quantity: Quantity = "accelerance",
    deviation: ArrayLike | None = None,
    decay: float = 0.0,
) -> Modes:
    """Fit poles, residues and background by least squares, from starting values of the poles.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Lines of the band [Hz]; a line at 0 Hz is left out, as it holds nothing about a mode.
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions to one force.
    start_frequency, start_damping : array_like, shape (n_modes,)
        Natural frequencies [Hz] and damping ratios [-] to start from. The sign of a damping ratio
        is kept: negative ones fit a phase that rises through the resonance.
    quantity : str
        What `value` is: ``receptance``, ``mobility`` or ``accelerance``.
    deviation : array_like, optional
        Standard deviation of every line, or anything in proportion to it, such as `Frf.radius`
        [unit of value]. Lines count alike by default, which suits a hammer: noise of one strength
        on the response.
    decay : float
        Rate of the exponential window the functions carry [1/s], see `Frf.decay`; the modes come
        out without it.

    Returns
    -------
    Modes

    Raises
    ------
    ValueError
        If the data or starts cannot be used (all faults are named), the fit does not settle, or
        the lines do not determine the modes.

    Notes
    -----
    Residues and background are linear in the data and are solved for at every step (variable
    projection); the poles follow by Levenberg and Marquardt. With independent, circular normal
    noise of the given deviations this is maximum likelihood, hence without bias to first order,
    and the deviations of the result are its Cramer-Rao bounds with the noise read from the misfit.
    They hold what noise does, not what leakage, non-linearity or a missing mode do. Modes beyond
    the band are caught as long as ``L / s^2 + U`` describes them in it. Structural damping eta
    reads as ``zeta = eta / 2``; where complex modal constants go with it, as in no model of
    conjugate pairs, a band about each mode keeps the error small.

    References
    ----------
    G. H. Golub, V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares
    problems whose variables separate", SIAM J. Numer. Anal. 10 (1973) 413-432,
    doi:10.1137/0710036.

    Examples
    --------
    >>> f = np.arange(20.0, 60.0, 0.5)
    >>> s = 2j * np.pi * f
    >>> w0 = 2 * np.pi * 40.3
    >>> modes = fit_modes(f, s**2 / (s**2 + 0.02 * w0 * s + w0**2), [40.0], [0.02])
    >>> modes.frequency.round(6).tolist(), modes.damping_ratio.round(6).tolist()
    ([40.3], [0.01])
    >>> modes.modal_constant.real.round(6).tolist()
    [[1.0]]
    """
    derivative = _derivative(quantity)
    lines, functions = _functions(frequency, value)
    weights = _weights(deviation, functions)
    start = _starts(start_frequency, start_damping)
    s = decay + 2j * np.pi * lines
    kept = s != 0
    functions, weights, s = functions[:, kept], weights[:, kept], s[kept]
    if not np.all(np.any(functions != 0, axis=-1)):
        raise ValueError("value must not be 0 on every line above 0 Hz; leave out dead channels")
    scale = float(np.abs(functions).max())
    weighted = functions * weights / scale
    target = np.concatenate([weighted.real, weighted.imag], axis=-1)
    freedom = target.size - functions.shape[0] * (2 * start.size + 4) - 2 * start.size
    if freedom <= 0:
        raise ValueError(
            f"n_modes = {start.size} leaves {freedom} degrees of freedom on {s.size} lines, must "
            "leave > 0; widen the band or give fewer modes"
        )
    problem = _Problem(s, s**derivative, weights, target)
    pole = _settled(problem, start - decay, decay)
    return _modes(problem, pole, freedom, scale, quantity)


def _starts(frequency: ArrayLike, damping_ratio: ArrayLike) -> Complex:
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    ratio = np.atleast_1d(np.asarray(damping_ratio, dtype=np.float64))
    if f.ndim != 1 or f.shape != ratio.shape or f.size == 0:
        raise ValueError(
            f"start_frequency has shape {f.shape} and start_damping {ratio.shape}, must be "
            "(n_modes,) both, n_modes >= 1; give a pair for each mode"
        )
    faults = []
    if not np.all(np.isfinite(f) & (f > 0)):
        faults.append("start_frequency must be finite and > 0 Hz; take find_resonances")
    if not np.all((np.abs(ratio) < 1) & (ratio != 0)):
        faults.append("start_damping must lie between -1 and 1 and not be 0; 0.01 is a usual start")
    if np.unique(f + 1j * ratio).size < f.size:
        faults.append("starts must differ from one another; leave out the copies")
    if faults:
        raise ValueError("; ".join(faults))
    return poles_of(f, ratio)


def _settled(problem: _Problem, start: Complex, decay: float) -> Complex:
    """Poles of least misfit.

    Unknowns are the logarithm of each pole's distance from the axis, softly bounded, and its shift
    along it in units of that distance: all of order one, and no pole can cross the axis.
    """
    count = start.size
    size = np.abs(start.real)

    def bounded(unknown: Float) -> tuple[Float, Float]:
        share = np.tanh(unknown[:count] / _MOST_GROWTH)
        return _MOST_GROWTH * share, 1 - np.square(share)

    def pole_of(unknown: Float) -> Complex:
        growth = start.real * np.exp(bounded(unknown)[0])
        return np.asarray(growth + 1j * (start.imag + size * unknown[count:]) + decay)

    def misfit(unknown: Float) -> Float:
        return np.asarray(problem.residual(pole_of(unknown)).ravel())

    def slope(unknown: Float) -> Float:
        pole = pole_of(unknown)
        units = [(pole.real - decay) * bounded(unknown)[1], size]
        return np.asarray(_slopes(problem, pole) * np.concatenate(units))

    try:
        with np.errstate(over="raise", invalid="raise"):
            found = least_squares(
                misfit, np.zeros(2 * count), slope, method="lm", xtol=1e-12, ftol=1e-15, gtol=1e-15
            )
        settled = found.status >= 1
    except (FloatingPointError, np.linalg.LinAlgError):
        settled = False
    if not settled:
        raise ValueError(
            f"fit of {count} modes must settle, but its poles run away; start nearer, give fewer "
            "modes or narrow the band"
        )
    return pole_of(found.x)


def _slopes(problem: _Problem, pole: Complex) -> Float:
    """Change of the residual per change of each pole's parts, (n_values, 2 n_modes) [s/rad].

    Kaufman's approximation: the turn of the basis towards the residual is left out.
    """
    basis, _, parts = problem.fit(pole)
    slopes = problem.slopes(pole, _residues(parts, pole.size))
    return np.asarray(-(slopes - _along(basis, slopes)).reshape(-1, 2 * pole.size))


def _residues(parts: Float, count: int) -> Complex:
    return np.asarray(parts[:, :count] + 1j * parts[:, count : 2 * count])


def _modes(
    problem: _Problem, pole: Complex, freedom: int, scale: float, quantity: Quantity
) -> Modes:
    count, order = pole.size, np.argsort(np.abs(pole))
    parts = problem.fit(pole)[2]
    residue = _residues(parts, count)
    squares = np.square(problem.residual(pole))
    variance = float(np.sum(squares)) / freedom
    spread = variance * _inverse(_slopes(problem, pole))
    frequency, ratio = _frequency_and_damping(pole[order])
    scatter = [_deviation(slope, spread)[order] for slope in _slopes_of_size(pole)]
    lower, upper = (_residues(parts[:, i : i + 2], 1)[:, 0] for i in (2 * count, 2 * count + 2))
    return Modes(
        frequency=frequency,
        damping_ratio=ratio,
        residue=residue[:, order] * scale,
        lower=lower * scale * float(np.abs(problem.s).mean()) ** 2,
        upper=upper * scale,
        quantity=quantity,
        frequency_deviation=scatter[0],
        damping_deviation=scatter[1],
        residue_deviation=_residue_deviation(problem, pole, variance, spread)[:, order] * scale,
        fit_error=np.sqrt(np.mean(squares, axis=-1) / np.mean(np.square(problem.target), axis=-1)),
    )


def _inverse(slopes: Float) -> Float:
    """Inverse of ``slopes.T slopes``, positive definite by construction."""
    size = np.linalg.norm(slopes, axis=0)
    if np.all(size > 0):
        triangle = np.linalg.qr(slopes / size, mode="r")
        if np.abs(np.diagonal(triangle)).min() > _LEAST_DIFFERENCE:
            inverse = np.linalg.inv(triangle) / size[:, np.newaxis]
            return np.asarray(inverse @ inverse.T)
    raise ValueError(
        f"n_modes = {slopes.shape[1] // 2} is more than the data tell apart: two starts lead to "
        "one pole, or one to nothing; give fewer"
    )


def _slopes_of_size(pole: Complex) -> tuple[Float, Float]:
    """Of natural frequency [Hz] and damping ratio per rad/s of the parts, (n_modes, 2 n_modes)."""
    size, real, imaginary = np.abs(pole), pole.real, pole.imag
    frequency = np.concatenate([np.diag(real / size), np.diag(imaginary / size)], axis=1)
    ratio = [np.diag(-(imaginary**2) / size**3), np.diag(real * imaginary / size**3)]
    return frequency / (2 * np.pi), np.concatenate(ratio, axis=1)


def _deviation(slope: Float, spread: Float) -> Float:
    return np.asarray(np.sqrt(np.sum((slope @ spread) * slope, axis=-1)))


def _residue_deviation(problem: _Problem, pole: Complex, variance: float, spread: Float) -> Float:
    """By the noise on the lines, and by what the scatter of the poles drags along."""
    basis, triangle, parts = problem.fit(pole)
    inverse = np.linalg.inv(triangle)
    slopes = problem.slopes(pole, _residues(parts, pole.size))
    dragged = inverse @ (np.swapaxes(basis, -1, -2) @ slopes)
    total = variance * np.sum(np.square(inverse), axis=-1)
    total = total + np.sum((dragged @ spread) * dragged, axis=-1)
    return np.asarray(np.sqrt(total[:, : pole.size] + total[:, pole.size : 2 * pole.size]))


def modal_fit(
    frequency: ArrayLike,
    value: ArrayLike,
    *,
    band: tuple[float, float] | None = None,
    n_modes: int | None = None,
    quantity: Quantity = "accelerance",
    deviation: ArrayLike | None = None,
    decay: float = 0.0,
    highest_order: int | None = None,
) -> Modes:
    """Find and fit the modes of a band, their number and starting values unknown.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Rising [Hz].
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions to one force.
    band : tuple of float, optional
        First and last frequency to use [Hz]; all lines by default.
    n_modes : int, optional
        Keep only so many: those that stand out highest. All that the data determine by default.
    quantity : str
        What `value` is: ``receptance``, ``mobility`` or ``accelerance``.
    deviation : array_like, optional
        As in `fit_modes`.
    decay : float
        As in `fit_modes` [1/s].
    highest_order : int, optional
        Highest order of the stabilisation; by default 30, or a third of the lines.

    Returns
    -------
    Modes
        By rising frequency.

    Raises
    ------
    ValueError
        As `fit_modes`, or if no pole stays stable.

    Notes
    -----
    Poles of `complex_frequency_poles` for orders 1, 2, … that `stabilise` follows through
    `LEAST_CHAIN` orders are the starts of `fit_modes`. A mode is dropped, and the rest fitted
    again, as long as its residue is known to a third of itself in no channel, its damping not
    to itself, or its frequency has left the band.

    A resonance narrower than some four lines that was measured with a window (Hann) is no longer
    of this form: leakage comes out as further modes within a line or two of it. `n_modes` leaves
    them out; more lines, a burst or an exponential window avoid them.

    Examples
    --------
    >>> f = np.arange(1.0, 100.0, 0.25)
    >>> value = sum(1 / (f0**2 - f**2 + 0.02j * f0 * f) for f0 in (30.0, 30.5, 70.0))
    >>> found = modal_fit(f, value, quantity="receptance")
    >>> found.frequency.round(6).tolist(), found.damping_ratio.round(6).tolist()
    ([30.0, 30.5, 70.0], [0.01, 0.01, 0.01])
    """
    lines, functions = _functions(frequency, value)
    scatter = 1 / _weights(deviation, functions)
    if band is not None:
        kept = _between(lines, *band)
        lines, functions, scatter = lines[kept], functions[:, kept], scatter[:, kept]
    if n_modes is not None and n_modes < 1:
        raise ValueError(f"n_modes = {n_modes} must be >= 1; leave it out to find all")
    top = min(30, lines.size // 3) if highest_order is None else highest_order
    orders = range(1, top + 1)
    poles = complex_frequency_poles(lines, functions, orders, deviation=scatter, decay=decay)
    frequencies, ratios = stabilise(poles, orders).modes(least=min(LEAST_CHAIN, top))
    if frequencies.size == 0:
        raise ValueError(_no_modes(poles, orders))

    def fit(at: Float, ratio: Float) -> Modes:
        return fit_modes(
            lines, functions, at, ratio, quantity=quantity, deviation=scatter, decay=decay
        )

    modes = _determined(fit, frequencies, ratios, (float(lines[0]), float(lines[-1])))
    if n_modes is not None and modes.frequency.size > n_modes:
        height = np.linalg.norm(modes.residue, axis=0) / np.abs(modes.pole.real - decay)
        height *= np.abs(modes.pole) ** _derivative(quantity)
        highest = np.sort(np.argsort(height)[-n_modes:])
        modes = fit(modes.frequency[highest], modes.damping_ratio[highest])
    return modes


def peak_fits(
    frequency: ArrayLike,
    value: ArrayLike,
    *,
    n_modes: int,
    quantity: Quantity = "accelerance",
    decay: float = 0.0,
    highest_order: int = 10,
) -> Modes:
    """Modes at the highest peaks: each found in its own surroundings, then all fitted together.

    Parameters
    ----------
    frequency, value, quantity, decay
        As in `modal_fit`, of many lines.
    n_modes : int
        Peaks wanted.
    highest_order : int
        As in `modal_fit`, of the surroundings of one peak; 10 at the most.

    Returns
    -------
    Modes
        As many as were found, to the lines around the peaks.

    Raises
    ------
    ValueError
        If no peak is a mode, or as `fit_modes`.

    Examples
    --------
    >>> f = np.arange(20.0, 500.0, 0.25)
    >>> value = sum(f**2 / (f0**2 - f**2 + 0.01j * f0 * f) for f0 in (100.0, 300.0))
    >>> peak_fits(f, value, n_modes=2).frequency.round(6).tolist()
    [100.0, 300.0]
    """
    lines, functions = _functions(frequency, value)
    peaks = find_resonances(lines, functions)
    height = np.linalg.norm(functions[:, peaks], axis=0)
    reach = PEAK_REACH * float(lines[1] - lines[0])
    found: list[Modes] = []
    near = np.zeros(lines.size, dtype=bool)
    for peak in peaks[np.argsort(-height)][: MOST_TRIED * n_modes]:
        if len(found) == n_modes or near[peak]:
            continue
        band = (float(lines[peak]) - reach, float(lines[peak]) + reach)
        try:
            mode = modal_fit(
                lines, functions, band=band, n_modes=1, quantity=quantity, decay=decay,
                highest_order=min(highest_order, 10),
            )  # fmt: skip
        except ValueError:  # a peak of the noise: the functions are sound
            continue
        found.append(mode)
        near |= (lines >= band[0]) & (lines <= band[1])
    if not found:
        raise ValueError(
            f"n_modes = 0 must be >= 1: none of {peaks.size} peaks is a mode; average more"
        )
    starts = np.concatenate([mode.frequency for mode in found])
    ratios = np.concatenate([mode.damping_ratio for mode in found])
    order = np.argsort(starts)
    return fit_modes(
        lines[near], functions[:, near], starts[order], ratios[order],
        quantity=quantity, decay=decay,
    )  # fmt: skip


PEAK_REACH = 40
"""Lines to either side of a peak that are fitted with it."""

MOST_TRIED = 3
"""Peaks that are tried for each mode that is wanted."""


def _between(lines: Float, low: float, high: float) -> NDArray[np.bool_]:
    kept = (lines >= low) & (lines <= high)
    if np.count_nonzero(kept) < FEWEST_LINES:
        raise ValueError(
            f"band = {low} … {high} Hz holds {np.count_nonzero(kept)} lines, must hold "
            f">= {FEWEST_LINES}; widen it or resolve the lines finer"
        )
    return np.asarray(kept)


def _no_modes(poles: list[Complex], orders: range) -> str:
    growing = stabilise([-p.conj() for p in poles], orders).modes()[0]
    if growing.size == 0:
        return (
            f"n_modes = 0 must be >= 1: no pole stays stable through {LEAST_CHAIN} of the orders "
            f"1 … {orders[-1]}; choose a band about a resonance, or average more"
        )
    return (
        f"poles at {', '.join(f'{f:.6g}' for f in growing)} Hz must decay, but grow: the phase "
        "rises with frequency there; conjugate data of the convention exp(-j w t), else average "
        "more"
    )


def _determined(
    fit: Callable[[Float, Float], Modes], frequency: Float, ratio: Float, band: tuple[float, float]
) -> Modes:
    """Modes that the data determine, the others dropped one by one, the worst first."""
    while True:
        modes = fit(frequency, ratio)
        doubt = np.maximum(
            modes.damping_deviation / np.abs(modes.damping_ratio) * _MOST_DOUBT,
            np.min(modes.residue_deviation / np.abs(modes.residue), axis=0),
        )
        doubt[(modes.frequency < band[0]) | (modes.frequency > band[1])] = np.inf
        if doubt.max() <= _MOST_DOUBT:
            return modes
        kept = np.arange(doubt.size) != doubt.argmax()
        if not kept.any():
            raise ValueError(
                f"mode at {modes.frequency[0]:.6g} Hz must lie in the band, with its residue known "
                f"to a third (here to {doubt[0]:.3g}) and its damping to a factor of two; average "
                "more or widen the band"
            )
        frequency, ratio = modes.frequency[kept], modes.damping_ratio[kept]


def synthesise(
    modes: Modes, frequency: ArrayLike, *, quantity: Quantity | None = None, decay: float = 0.0
) -> Complex:
    """Response functions of a modal model.

    Parameters
    ----------
    modes : Modes
    frequency : array_like, shape (n_lines,)
        [Hz]
    quantity : str, optional
        ``receptance``, ``mobility`` or ``accelerance``; that of the fit by default.
    decay : float
        Of an exponential window the functions shall carry [1/s].

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        [unit of the fitted functions, or of their integral or derivative in time]

    Raises
    ------
    ValueError
        If `quantity` is unknown or a frequency is not finite; or at 0 Hz of a receptance or
        mobility with a background from below the band, which has no bound there.

    Notes
    -----
    Outside the fitted band the background is an extrapolation and not to be trusted.

    Examples
    --------
    >>> f = np.arange(20.0, 60.0, 0.5)
    >>> value = 1 / (40.3**2 - f**2 + 2j * 0.01 * 40.3 * f)
    >>> modes = fit_modes(f, value, [40.0], [0.02], quantity="receptance")
    >>> bool(np.allclose(synthesise(modes, f), value))
    True
    """
    derivative = _derivative(modes.quantity if quantity is None else quantity)
    lines = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if not np.all(np.isfinite(lines)):
        raise ValueError("frequency must be finite; leave out the other lines")
    s = decay + 2j * np.pi * lines
    at_rest = (s == 0) & (derivative < 2)
    if at_rest.any() and np.any(modes.lower != 0):
        raise ValueError(
            "frequency = 0 Hz must be > 0 where a background L / s^2 is; leave out that line"
        )
    total = modes.upper[:, np.newaxis]
    for residue, pole in ((modes.residue, modes.pole), (modes.residue.conj(), modes.pole.conj())):
        total = total + residue @ (1 / (s - pole[:, np.newaxis]))
    # s^d / s^2 on its own: an accelerance has it at 0 Hz too.
    mass = np.power(s, derivative - 2, out=np.zeros_like(s), where=~at_rest)
    return np.asarray(total * s**derivative + modes.lower[:, np.newaxis] * mass)


# --- against a reference


def band_response_levels(
    frequency: ArrayLike, value: ArrayLike, edges: ArrayLike, *, weight: ArrayLike | None = None
) -> Float:
    """Mean level of response functions in bands.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Lines, equally spaced [Hz].
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions.
    edges : array_like, shape (n_bands + 1,)
        Ascending; a band takes the lines from its lower edge to below its upper one [Hz].
    weight : array_like, shape (n_lines,) or (n_channels, n_lines), optional
        Of the lines, >= 0 [-], as their coherence; all alike by default.

    Returns
    -------
    ndarray, shape (n_channels, n_bands)
        ``10 log10`` of the mean of ``|H|^2`` over the lines [dB re 1 unit of value]; NaN where
        every line of a band has the weight 0.

    Raises
    ------
    ValueError
        If the data cannot be used, edges do not ascend, a band holds no line, or weights are
        negative or of another shape.

    Notes
    -----
    The level of the response to a white force in that band, less the level of the force. The
    difference to the levels of a reference is the change in dB, free of the unit.

    Examples
    --------
    >>> band_response_levels(range(10), [10.0] * 5 + [1.0] * 5, [0.0, 5.0, 10.0]).tolist()
    [[20.0, 0.0]]
    >>> weight = [1.0, 0, 0, 0, 0]
    >>> band_response_levels(range(5), [10.0, 1, 1, 1, 1], [0.0, 5.0], weight=weight).tolist()
    [[20.0]]
    """
    lines, functions = _functions(frequency, value)
    limits = np.asarray(edges, dtype=np.float64)
    if limits.ndim != 1 or limits.size < 2 or not np.all(np.diff(limits) > 0):
        raise ValueError(f"edges (shape {limits.shape}) must be two or more and ascend; sort them")
    places = np.searchsorted(lines, limits)
    empty = np.flatnonzero(np.diff(places) == 0)
    if empty.size:
        named = ", ".join(f"{limits[i]:.6g} … {limits[i + 1]:.6g} Hz" for i in empty)
        raise ValueError(f"bands {named} must each hold a line; widen them")
    share = np.ones(lines.size) if weight is None else np.asarray(weight, dtype=np.float64)
    if share.shape == lines.shape:
        share = np.broadcast_to(share, functions.shape)
    if share.shape != functions.shape or not np.all(share >= 0):
        raise ValueError(
            f"weight has shape {share.shape}, must have {functions.shape}, each >= 0; give "
            "the coherence of every line"
        )
    total, shares = (
        np.add.reduceat(lines[:, : places[-1]], places[:-1], axis=-1)
        for lines in (share * _square(functions), share)
    )
    heard = shares > 0
    return np.where(heard, decibel(total / np.where(heard, shares, 1.0)), np.nan)


def frequency_response_assurance(value: ArrayLike, reference: ArrayLike) -> Float:
    """Frequency response assurance criterion (FRAC): likeness of shape over frequency.

    Parameters
    ----------
    value, reference : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions on the same lines.

    Returns
    -------
    ndarray, shape (n_channels,)
        ``|sum H R*|^2 / (sum |H|^2 sum |R|^2)`` over the lines, 0 to 1 [-]; 1 where one is a
        complex multiple of the other.

    Raises
    ------
    ValueError
        If shapes differ, a line is not finite or a channel is silent.

    Notes
    -----
    Blind to level and to a common phase. Two resonances of one half-power width b, alone in the
    band and a distance d apart, have ``1 / (1 + (d / b)^2)``: one half at one width.

    References
    ----------
    W. Heylen, S. Lammens, "FRAC: a consistent way of comparing frequency response functions",
    Proc. Int. Conf. Identification in Engineering Systems, Swansea 1996, 48-57.

    Examples
    --------
    >>> frequency_response_assurance([1, 1j, 2], [2, 2j, 4]).round(12).tolist()
    [1.0]
    """
    one, other = _same(value, reference)
    return _likeness(one, other, axis=-1)


def cross_signature_assurance(value: ArrayLike, reference: ArrayLike) -> Float:
    """Cross signature assurance criterion (CSAC): likeness of shape over the channels, by line.

    Parameters
    ----------
    value, reference : array_like, shape (n_channels, n_lines)
        Response functions of two channels or more, on the same lines.

    Returns
    -------
    ndarray, shape (n_lines,)
        ``|sum H R*|^2 / (sum |H|^2 sum |R|^2)`` over the channels, 0 to 1 [-].

    Raises
    ------
    ValueError
        As `frequency_response_assurance`, if there is one channel only (it would be 1 whatever
        the data), or if all channels are silent on a line.

    References
    ----------
    C. Zang, H. Grafe, M. Imregun, "Frequency-domain criteria for correlating and updating dynamic
    finite element models", Mech. Syst. Signal Process. 15 (2001) 139-155.

    Examples
    --------
    >>> cross_signature_assurance([[1, 1], [1, 1]], [[2, 1], [2, -1]]).round(12).tolist()
    [1.0, 0.0]
    """
    one, other = _same(value, reference)
    if one.shape[0] < 2:
        raise ValueError(
            f"n_channels = {one.shape[0]} must be >= 2, the likeness of one is identically 1; use "
            "cross_signature_scale, or frequency_response_assurance"
        )
    return _likeness(one, other, axis=0)


def cross_signature_scale(value: ArrayLike, reference: ArrayLike) -> Float:
    """Cross signature scale factor (CSF): likeness of shape and level over the channels, by line.

    Parameters
    ----------
    value, reference : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions on the same lines.

    Returns
    -------
    ndarray, shape (n_lines,)
        ``2 |sum H R*| / (sum |H|^2 + sum |R|^2)`` over the channels, 0 to 1 [-]; 1 only where the
        two agree up to a common phase.

    Raises
    ------
    ValueError
        As `frequency_response_assurance`, or if all channels are silent on a line.

    References
    ----------
    As `cross_signature_assurance`.

    Examples
    --------
    >>> cross_signature_scale([1, 1], [1, 3]).round(12).tolist()
    [1.0, 0.6]
    """
    one, other = _same(value, reference)
    powers = [np.sum(_square(x), axis=0) for x in (one, other)]
    _check_silence(powers)
    both = np.abs(np.sum(one * other.conj(), axis=0))
    return np.asarray(np.minimum(2 * both / (powers[0] + powers[1]), 1.0))


def _same(value: ArrayLike, reference: ArrayLike) -> tuple[Complex, Complex]:
    """Two sets of functions of one shape, in units of the largest magnitude of both."""
    shapes = np.shape(value), np.shape(reference)
    if shapes[0] != shapes[1] or len(shapes[0]) not in (1, 2) or 0 in shapes[0]:
        raise ValueError(
            f"value has shape {shapes[0]} and reference {shapes[1]}, must be the same, (n_lines,) "
            "or (n_channels, n_lines); bring both to the same lines"
        )
    index = np.arange(shapes[0][-1], dtype=np.float64)
    one, other = (_functions(index, x, least=1)[1] for x in (value, reference))
    size = max(np.abs(one).max(), np.abs(other).max())
    return one / size, other / size


def _likeness(one: Complex, other: Complex, *, axis: int) -> Float:
    powers = [np.sum(_square(x), axis=axis) for x in (one, other)]
    _check_silence(powers)
    both = _square(np.sum(one * other.conj(), axis=axis))
    return np.asarray(np.minimum(both / (powers[0] * powers[1]), 1.0))  # rounding


def _check_silence(powers: list[Float]) -> None:
    silent = np.count_nonzero(~((powers[0] > 0) & (powers[1] > 0)))
    if silent:
        raise ValueError(
            f"value or reference is 0 in all channels on {silent} lines, must be > 0; leave out "
            "these lines, as that at 0 Hz"
        )


@dataclass(frozen=True, kw_only=True)
class ModeShift:
    """What has become of the modes of a reference.

    Attributes
    ----------
    pairs : ndarray of int, shape (n_pairs, 2)
        Index of the mode in the reference and in the new set, ascending.
    frequency : ndarray, shape (n_pairs,)
        Relative change of natural frequency [-].
    frequency_deviation : ndarray, shape (n_pairs,)
        Its standard deviation, from those of both fits [-].
    damping_ratio : ndarray, shape (n_pairs,)
        New damping ratio over the old one [-].
    level : ndarray, shape (n_channels, n_pairs)
        Change of the height of the resonance, ``|A| / |Re p|`` [dB].
    lost, new : tuple of int
        Modes of the reference without a partner, and of the new set.
    """

    pairs: Integer
    frequency: Float
    frequency_deviation: Float
    damping_ratio: Float
    level: Float
    lost: tuple[int, ...]
    new: tuple[int, ...]


def resonance_shift(modes: Modes, reference: Modes, *, within: float = 0.1) -> ModeShift:
    """Pair the modes of two fits and tell how they have moved.

    Parameters
    ----------
    modes, reference : Modes
        Fits of the same channels, after and before.
    within : float
        Largest relative change of frequency of a pair, > 0 [-].

    Returns
    -------
    ModeShift

    Raises
    ------
    ValueError
        If the numbers of channels differ or `within` is not > 0.

    Notes
    -----
    Pairs make the sum of ``|f / f_ref - 1| / within + 1 - MAC`` least, a mode left alone costing
    2, with the modal assurance criterion MAC of the residues over the channels: modes that have
    changed places are told apart by shape where there are channels enough. With one channel MAC
    is 1, and the nearest frequency decides.

    Examples
    --------
    >>> f = np.arange(20.0, 60.0, 0.5)
    >>> before, after = (
    ...     fit_modes(f, 1 / (f0**2 - f**2 + 0.02j * f0 * f), [f0], [0.02], quantity="receptance")
    ...     for f0 in (40.0, 39.0)
    ... )
    >>> resonance_shift(after, before).frequency.round(6).tolist()
    [-0.025]
    """
    channels = modes.residue.shape[0], reference.residue.shape[0]
    if channels[0] != channels[1] or not within > 0:
        raise ValueError(
            f"n_channels = {channels[0]} must equal that of the reference, {channels[1]}, and "
            f"within = {within} must be > 0; fit the same channels"
        )
    pairs = _paired(modes, reference, within)
    old, now = pairs.T
    ratio = modes.frequency[now] / reference.frequency[old]
    scatter = np.hypot(
        modes.frequency_deviation[now] / modes.frequency[now],
        reference.frequency_deviation[old] / reference.frequency[old],
    )
    heights = [np.abs(x.residue) / np.abs(x.pole.real) for x in (modes, reference)]
    return ModeShift(
        pairs=pairs,
        frequency=ratio - 1,
        frequency_deviation=ratio * scatter,
        damping_ratio=modes.damping_ratio[now] / reference.damping_ratio[old],
        level=decibel(np.square(heights[0][:, now] / heights[1][:, old])),
        lost=tuple(sorted(set(range(reference.frequency.size)) - set(old.tolist()))),
        new=tuple(sorted(set(range(modes.frequency.size)) - set(now.tolist()))),
    )


def _paired(modes: Modes, reference: Modes, within: float) -> Integer:
    """Indices (reference, modes) of the cheapest pairs, (n_pairs, 2)."""
    apart = np.abs(modes.frequency / reference.frequency[:, np.newaxis] - 1) / within
    product = _square(reference.residue.conj().T @ modes.residue)
    sizes = [np.sum(_square(x.residue), axis=0) for x in (reference, modes)]
    cost = apart + 1 - product / np.outer(*sizes)
    cost = np.where(apart <= 1, np.minimum(cost, 2.0), 2.0)
    rows, columns = linear_sum_assignment(cost)
    kept = cost[rows, columns] < 2.0
    return np.stack([rows[kept], columns[kept]], axis=1).astype(np.intp)
