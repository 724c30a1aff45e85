"""Modes, and the response functions they are fitted to or synthesised into."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

Quantity = Literal["receptance", "mobility", "accelerance"]

DERIVATIVES = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Number of times the displacement is differentiated, by quantity of response over force."""

FEWEST_LINES = 5
"""Lines needed to fit one mode: a pole, a residue and two background terms are four."""

_SIZES = (1e-60, 1e60)  # of functions: their squares and fourth powers must be representable

WIDEST = 0.5  # damping ratio: a pole further from the axis is background, not a resonance


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
        L and U, the contributions of the modes below and above the band to the receptance [unit of
        receptance * rad^2/s^2 and unit of receptance].
    quantity : str
        Quantity of the fitted functions: ``receptance``, ``mobility`` or ``accelerance``.
    frequency_deviation : ndarray, shape (n_modes,)
        Standard deviation of `frequency` from the scatter about the fit [Hz].
    damping_deviation : ndarray, shape (n_modes,)
        Standard deviation of `damping_ratio` [-].
    residue_deviation : ndarray, shape (n_channels, n_modes)
        Standard deviation of `residue`, root of the summed variances of its two parts.
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
        """Number of modes and their frequencies."""
        listed = ", ".join(f"{each:.4g}" for each in self.frequency[:6])
        more = ", …" if len(self.frequency) > 6 else ""
        return f"<Modes of {self.quantity}, {len(self.frequency)}: {listed}{more} Hz>"

    @property
    def pole(self) -> Complex:
        """Poles in the upper half plane, shape (n_modes,) [rad/s]."""
        return poles_of(self.frequency, self.damping_ratio)

    @property
    def modal_constant(self) -> Complex:
        """``2 j w_d A``, shape (n_channels, n_modes): a product of two mass-normalised shapes.

        Real for proportional damping [1/kg if displacement and force are in SI units].
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


def frequency_and_damping(pole: Complex) -> tuple[Float, Float]:
    """Undamped natural frequencies [Hz] and damping ratios of poles [rad/s]."""
    size = np.abs(pole)
    return np.asarray(size / (2 * np.pi)), np.asarray(-pole.real / size)


def checked_functions(
    frequency: ArrayLike, value: ArrayLike, *, least: int = FEWEST_LINES
) -> tuple[Float, Complex]:
    """Lines (n_lines,) and functions (n_channels, n_lines), checked; all faults in one error."""
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
        faults.append(f"value has {wrong} non-finite lines, must have 0; cut or repair them")
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


def derivative_order(quantity: str) -> int:
    """Number of times the displacement is differentiated in a quantity, which must exist."""
    if quantity not in DERIVATIVES:
        raise ValueError(f"quantity = {quantity!r} must be one of {', '.join(get_args(Quantity))}")
    return DERIVATIVES[quantity]


def squared_size(z: Complex) -> Float:
    """``|z|^2`` without taking a root."""
    return np.asarray(np.square(z.real) + np.square(z.imag))
