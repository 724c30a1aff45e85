"""Modal model of measured response functions: frequencies, damping ratios, residues.

Poles come from :mod:`.response.stable_poles`, or one by one from the peaks; a fit of the whole
model refines them and gives each its standard deviation.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from .modal_model import (
    FEWEST_LINES,
    Modes,
    Quantity,
    checked_functions,
    derivative_order,
    frequency_and_damping,
    poles_of,
)
from .resonance import find_resonances
from .stable_poles import LEAST_CHAIN, complex_frequency_poles, line_weights, stabilise

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MOST_DOUBT = 1 / 3  # largest relative standard deviation of a mode's residue in its best channel
_LEAST_DIFFERENCE = 1e-7  # between the effects of two poles: about the root of the rounding error

_MOST_GROWTH = 5.0  # natural logarithm of the largest error factor in a starting value of damping


@dataclass(frozen=True)
class _Problem:
    """Weighted lines of all channels, to which poles are fitted.

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
        """Orthonormal basis, triangular factor and coefficients (n_channels, 2 n_modes + 4)."""
        basis, triangle = np.linalg.qr(self.rows(_columns(self.s, pole)))
        parts = np.swapaxes(basis, -1, -2) @ self.target[..., np.newaxis]
        # Two poles may meet during the iteration: then no plain inverse exists.
        return basis, triangle, (np.linalg.pinv(triangle) @ parts)[..., 0]

    def residual(self, pole: Complex) -> Float:
        """Target less its best fit with these poles, (n_channels, 2 n_lines)."""
        basis = np.linalg.qr(self.rows(_columns(self.s, pole)))[0]
        return np.asarray(self.target - _along(basis, self.target[..., np.newaxis])[..., 0])

    def slopes(self, pole: Complex, residue: Complex) -> Float:
        """Derivative of the model with respect to the real and imaginary parts of the poles.

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

    The four background columns are scaled to the size of the lines, for good conditioning.
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
        Lines of the band [Hz]; a line at 0 Hz is left out, as it contains nothing about a mode.
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions to one force.
    start_frequency, start_damping : array_like, shape (n_modes,)
        Natural frequencies [Hz] and damping ratios [-] to start from. The sign of a damping ratio
        is kept: negative ones fit a phase that rises through the resonance.
    quantity : str
        Quantity of `value`: ``receptance``, ``mobility`` or ``accelerance``.
    deviation : array_like, optional
        Standard deviation of every line, or anything proportional to it, such as `Frf.radius` [unit
        of value]. By default all lines have equal weight, which suits a hammer: the noise on the
        response has the same strength at all of them.
    decay : float
        Rate of the exponential window of the functions [1/s], see `Frf.decay`; its effect is
        removed from the modes.

    Returns
    -------
    Modes

    Raises
    ------
    ValueError
        If the data or starts cannot be used (all faults are named), the fit does not converge, or
        the lines do not determine the modes.

    Notes
    -----
    Residues and background are linear in the data and solved for at every step (variable
    projection); the poles follow by Levenberg and Marquardt. With independent, circular normal
    noise of the given deviations this is maximum likelihood, hence unbiased to first order, and the
    deviations of the result are its Cramer-Rao bounds with the noise taken from the misfit. They
    include the effect of noise, not that of leakage, non-linearity or a missing mode. Modes beyond
    the band are covered as long as ``L / s^2 + U`` describes them within it. Structural damping eta
    reads as ``zeta = eta / 2``; if complex modal constants occur with it, unlike in any model of
    conjugate pairs, a band about each mode keeps the error small.
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
    derivative = derivative_order(quantity)
    lines, functions = checked_functions(frequency, value)
    weights = line_weights(deviation, functions)
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
    """Poles of smallest misfit.

    The unknowns are the logarithm of each pole's distance from the imaginary axis, softly bounded,
    and its shift along the axis in units of that distance: all of order one, and no pole can cross
    the axis.
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
            f"fit of {count} modes must converge, but its poles diverge; start nearer, give fewer "
            "modes or narrow the band"
        )
    return pole_of(found.x)


def _slopes(problem: _Problem, pole: Complex) -> Float:
    """Derivative of the residual by each pole's parts, (n_values, 2 n_modes) [s/rad].

    Kaufman's approximation: the rotation of the basis towards the residual is left out.
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
    frequency, ratio = frequency_and_damping(pole[order])
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
        f"n_modes = {slopes.shape[1] // 2} is more than the data can resolve: two starts lead "
        "to one pole, or one to nothing; give fewer"
    )


def _slopes_of_size(pole: Complex) -> tuple[Float, Float]:
    """Derivatives of frequency [Hz] and damping ratio by a pole's parts, (n_modes, 2 n_modes)."""
    size, real, imaginary = np.abs(pole), pole.real, pole.imag
    frequency = np.concatenate([np.diag(real / size), np.diag(imaginary / size)], axis=1)
    ratio = [np.diag(-(imaginary**2) / size**3), np.diag(real * imaginary / size**3)]
    return frequency / (2 * np.pi), np.concatenate(ratio, axis=1)


def _deviation(slope: Float, spread: Float) -> Float:
    return np.asarray(np.sqrt(np.sum((slope @ spread) * slope, axis=-1)))


def _residue_deviation(problem: _Problem, pole: Complex, variance: float, spread: Float) -> Float:
    """Standard deviation from the noise on the lines and from the scatter of the poles."""
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
    """Find and fit the modes of a band, without their number or starting values.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Frequency of the lines, rising [Hz].
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions to one force.
    band : tuple of float, optional
        First and last frequency to use [Hz]; all lines by default.
    n_modes : int, optional
        Number of modes kept: those that stand out most. By default all that the data determine.
    quantity : str
        Quantity of `value`: ``receptance``, ``mobility`` or ``accelerance``.
    deviation : array_like, optional
        As in `fit_modes`.
    decay : float
        As in `fit_modes` [1/s].
    highest_order : int, optional
        Highest order of the stabilisation; by default 30, or a third of the lines.

    Returns
    -------
    Modes
        Modes in order of rising frequency.

    Raises
    ------
    ValueError
        As for `fit_modes`, or if no pole stays stable.

    Notes
    -----
    The starts of `fit_modes` are poles of `complex_frequency_poles` for orders 1, 2, … that
    `stabilise` follows through `LEAST_CHAIN` orders. A mode is dropped, and the rest fitted again,
    if its residue is not known to a third in any channel, its damping is not known to within its
    own size, or its frequency has left the band.

    A resonance narrower than about four lines measured with a window (Hann) does not have this
    form: leakage appears as further modes within a line or two of it. `n_modes` leaves them out;
    more lines, a burst or an exponential window avoid them.

    Examples
    --------
    >>> f = np.arange(1.0, 100.0, 0.25)
    >>> value = sum(1 / (f0**2 - f**2 + 0.02j * f0 * f) for f0 in (30.0, 30.5, 70.0))
    >>> found = modal_fit(f, value, quantity="receptance")
    >>> found.frequency.round(6).tolist(), found.damping_ratio.round(6).tolist()
    ([30.0, 30.5, 70.0], [0.01, 0.01, 0.01])
    """
    lines, functions = checked_functions(frequency, value)
    scatter = 1 / line_weights(deviation, functions)
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
        height *= np.abs(modes.pole) ** derivative_order(quantity)
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
        As in `modal_fit`, with many lines.
    n_modes : int
        Number of peaks wanted.
    highest_order : int
        As in `modal_fit`, for the surroundings of one peak; 10 at most.

    Returns
    -------
    Modes
        As many modes as were found, fitted to the lines around the peaks.

    Raises
    ------
    ValueError
        If no peak is a mode, or as for `fit_modes`.

    Examples
    --------
    >>> f = np.arange(20.0, 500.0, 0.25)
    >>> value = sum(f**2 / (f0**2 - f**2 + 0.01j * f0 * f) for f0 in (100.0, 300.0))
    >>> peak_fits(f, value, n_modes=2).frequency.round(6).tolist()
    [100.0, 300.0]
    """
    lines, functions = checked_functions(frequency, value)
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
        except ValueError:  # a peak of noise: the functions are valid
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
"""Lines on either side of a peak that are fitted with it."""

MOST_TRIED = 3
"""Peaks tried for each mode wanted."""


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
    """Modes that the data determine; the others are dropped one by one, the worst first."""
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
