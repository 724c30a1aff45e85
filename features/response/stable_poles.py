"""Poles by least squares in the complex frequency, and their stability over model orders."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .modal_model import WIDEST, checked_functions, frequency_and_damping

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integer = NDArray[np.intp]

FREQUENCY_TOLERANCE = 0.01
"""Largest change of a stable pole's natural frequency between successive model orders [-]."""

DAMPING_TOLERANCE = 0.05
"""Largest relative change of a stable pole's damping ratio between successive orders [-]."""

LEAST_CHAIN = 5
"""Successive model orders through which a pole must stay stable to count as a mode."""

_ARC = 0.95  # of the unit circle covered by the band; the function does not close on itself


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
        Standard deviation of every line, or anything proportional to it, such as `Frf.radius`; in
        the shape of `value` or broadcastable to it [unit of value]. Equal weights by default.
    decay : float
        Rate of the exponential window of the functions [1/s], see `Frf.decay`.

    Returns
    -------
    list of ndarray
        For each order the poles whose damped frequency lies in the band, in ascending order of it
        [rad/s]. Growing ones (real part > 0) are the excess poles of a model of high order, to be
        left out.

    Raises
    ------
    ValueError
        If the data or the orders cannot be used; all faults are named.

    Notes
    -----
    All channels share the denominator of ``N_c(z) / D(z)`` with ``z = exp(s T)``. The band is
    mapped to 95 % of the unit circle and the coefficients are complex, so that bands may start
    anywhere and high orders stay well conditioned. ``sum |W (N_c - D H_c)|^2`` is minimised with
    the constant coefficient of D at 1, which moves the excess poles outside the circle. The problem
    is linear, so that no starting values are needed, but biased: noise of a share r of the response
    shifts a pole by the order of r^2 of its width. `fit_modes` removes the bias.

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
    lines, functions = checked_functions(frequency, value)
    wanted = [int(order) for order in orders]
    most = (lines.size - 1) // 2
    wrong = [order for order in wanted if not 1 <= order <= most]
    if wrong or not wanted:
        raise ValueError(
            f"orders {wrong} must be >= 1 and <= (n_lines - 1) / 2 = {most}; "
            "lower the order or widen the band"
        )
    weights = line_weights(deviation, functions)
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


def line_weights(deviation: ArrayLike | None, functions: Complex) -> Float:
    """One over the deviations, (1, n_lines) or (n_channels, n_lines), scaled to order one."""
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
    """Products of the columns ``z^k H`` and, channel by channel, their projections on ``z^k``."""
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
    """Zeros of D for one order, with its constant coefficient equal to 1.

    The numerators are eliminated: orthonormal columns are nested, so that the first ones of the
    highest order serve every lower one.
    """
    kept = slice(order + 1)
    matrix = products[kept, kept].copy()
    for part in projected:
        matrix -= part[kept, kept].conj().T @ part[kept, kept]
    tail = np.linalg.lstsq(matrix[1:, 1:], -matrix[1:, 0], rcond=1e-13)[0]
    return np.asarray(np.roots(np.concatenate([tail[::-1], [1.0]])), dtype=np.complex128)


@dataclass(frozen=True, kw_only=True)
class Stabilisation:
    """Decaying poles of ascending model orders, one entry per pole: the stabilisation diagram.

    Attributes
    ----------
    order : ndarray of int, shape (n_poles,)
        Model order.
    frequency : ndarray, shape (n_poles,)
        Undamped natural frequency [Hz].
    damping_ratio : ndarray, shape (n_poles,)
        Damping ratio [-].
    chain : ndarray of int, shape (n_poles,)
        Number of the chain; poles of one chain continue each other from order to order.
    length : ndarray of int, shape (n_poles,)
        Poles of the chain so far; above 1 this pole is stable.
    """

    order: Integer
    frequency: Float
    damping_ratio: Float
    chain: Integer
    length: Integer

    def modes(self, *, least: int = LEAST_CHAIN) -> tuple[Float, Float]:
        """Frequencies [Hz] and damping ratios, medians of the chains of `least` poles or more.

        Chains closer to each other than their damping count as one, unless they share most orders:
        a pole whose damping jumps starts a new chain, whereas close modes appear in the same
        orders.
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
        for two poles to count as the same [-].

    Returns
    -------
    Stabilisation
        Diagram of the decaying poles with damping ratios up to one half.

    Raises
    ------
    ValueError
        If a tolerance is not > 0.

    Notes
    -----
    Pairs are formed nearest first, each pole used once, so that two close modes keep their own
    chains. A chain may continue after missing an order.

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
        kept = [complex(p) for p in np.asarray(found) if 0 < -p.real < WIDEST * abs(p)]
        follows = _continued(latest, kept, tolerances)
        for i, pole in enumerate(kept):
            chain = follows.get(i, len(latest))
            if chain == len(latest):
                latest.append(pole)
                lengths.append(0)
            latest[chain] = pole
            lengths[chain] += 1
            rows.append((order, pole, chain, lengths[chain]))
    frequency, ratio = frequency_and_damping(np.array([row[1] for row in rows], dtype=complex))
    number, chain_of, length_of = (
        np.array([row[i] for row in rows], dtype=np.intp) for i in (0, 2, 3)
    )
    return Stabilisation(
        order=number, frequency=frequency, damping_ratio=ratio, chain=chain_of, length=length_of
    )


def _continued(
    old: list[complex], new: list[complex], tolerances: tuple[float, float]
) -> dict[int, int]:
    """Map from new poles to the old ones they continue, nearest pairs first."""
    if not old or not new:
        return {}
    was, now = np.array(old), np.array(new)[:, np.newaxis]
    frequency, ratio = frequency_and_damping(was)
    frequency_now, ratio_now = frequency_and_damping(now)
    same = np.abs(frequency_now - frequency) <= tolerances[0] * frequency
    same &= np.abs(ratio_now - ratio) <= tolerances[1] * ratio
    follows: dict[int, int] = {}
    for flat in np.argsort(np.abs(now - was), axis=None):
        i, j = divmod(int(flat), len(old))
        if same[i, j] and i not in follows and j not in follows.values():
            follows[i] = j
    return follows
