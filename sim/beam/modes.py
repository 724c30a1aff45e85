"""Natural frequencies and modes of a rotating shaft.

==========  ======================================================================================
eigenvalues by
==========  ======================================================================================
symmetric   no damping, no rotation, symmetric supports: real modes
dense       all eigenvalues of the inverted, shifted first-order form
sparse      eigenvalues nearest the shift, by Arnoldi's method on the factorised sparse matrix
==========  ======================================================================================
"""

import math
from abc import ABC
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.sparse.linalg import LinearOperator, eigs, eigsh, splu

from ..brief import brief
from .beam import Beam
from .rotor import Rotor

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

Found = tuple[Complex, Complex, Vector]

_SEED = 5  # of the start vector of a sparse search: fixed, so that runs are repeatable
_DENSE_SYMMETRIC = 200  # coordinates; above these the sparse search is faster
_DENSE_GENERAL = 60
EQUAL = 1e-8  # of an eigenvalue: closer ones count as equal, with any shapes of the same span
_REAL = 1e-6  # of an eigenvalue: rounding gives equal real ones an imaginary part, up to 1e-8
_PLANAR = 1e-3  # of the major axis: an orbit with a thinner one is a line
_SYMMETRIC = 1e-12  # of the largest entry


class Vibrations(ABC):
    """Frequencies and damping from complex eigenvalues [rad/s]."""

    eigenvalues: Complex

    @property
    def frequency_hz(self) -> Vector:
        """Damped frequency ``Im(lambda) / 2 pi`` [Hz]."""
        return self.eigenvalues.imag / (2 * math.pi)

    @property
    def undamped_frequency_hz(self) -> Vector:
        """Undamped frequency ``|lambda| / 2 pi`` [Hz]."""
        return np.abs(self.eigenvalues) / (2 * math.pi)

    @property
    def damping_ratio(self) -> Vector:
        """``-Re(lambda) / |lambda|``; negative if the motion grows, 0 for a rigid motion."""
        size = np.abs(self.eigenvalues)
        return -self.eigenvalues.real / np.where(size > 0, size, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class RotorModes(Vibrations):
    """Free vibrations ``q = Re(shape exp(lambda t))`` of a rotor at one speed.

    Attributes
    ----------
    speed : float
        Speed [rad/s].
    eigenvalues : numpy.ndarray [shape=(n_modes,)]
        lambda with an imaginary part >= 0, by rising magnitude [rad/s].
    shapes : numpy.ndarray [shape=(n_dof, n_modes)]
        Complex; scaled to a largest displacement of the shaft of one, taken as real, or of the
        housings if the shaft has none.
    forward_share : numpy.ndarray [shape=(n_modes,)]
        Share of the translational kinetic energy that whirls forward; 0.5 in a plane.
    axis_ratio : numpy.ndarray [shape=(n_nodes, n_modes)]
        Minor over major axis of the orbit at each node: 1 a forward circle, 0 a line, -1 a
        backward circle; 0 for a node at rest.
    real_eigenvalues : numpy.ndarray
        Overdamped motions found along the way; the list may be incomplete [rad/s].
    """

    speed: float
    eigenvalues: Complex
    shapes: Complex
    forward_share: Vector
    axis_ratio: Vector
    real_eigenvalues: Vector

    __repr__ = brief("speed", "frequency_hz", "stable")

    @property
    def log_decrement(self) -> Vector:
        """Logarithmic decrement of each mode, ``2 pi zeta / sqrt(1 - zeta^2)``."""
        zeta = self.damping_ratio
        return 2 * math.pi * zeta / np.sqrt(1 - zeta**2)

    @property
    def direction(self) -> tuple[str, ...]:
        """Direction of each mode: "forward", "backward", "planar", or "mixed" if nodes differ."""
        return tuple(direction_of(ratios) for ratios in self.axis_ratio.T)

    @property
    def stable(self) -> bool:
        """False if a motion that was found grows by more than rounding."""
        bound = 1e-9 * np.abs(self.eigenvalues).max(initial=0.0)
        return not ((self.eigenvalues.real > bound).any() or (self.real_eigenvalues > bound).any())


def direction_of(ratios: Vector) -> str:
    """Direction of the whirl, from the ratios of axes along the shaft."""
    forward, backward = (ratios > _PLANAR).any(), (ratios < -_PLANAR).any()
    if forward and backward:
        return "mixed"
    return "forward" if forward else "backward" if backward else "planar"


def modes(
    rotor: Rotor,
    speed: float = 0.0,
    count: int = 6,
    *,
    most_damping: float = 1.0,
    method: str = "auto",
) -> RotorModes:
    """Lowest modes of a rotor.

    Parameters
    ----------
    rotor : Rotor
        Shaft on its supports.
    speed : float
        Speed [rad/s], may be negative.
    count : int
        Number of modes, >= 1; fewer are returned if the rotor has fewer that oscillate.
    most_damping : float
        In (0, 1]: modes of a higher damping ratio are omitted. Oil films have many that are not
        visible in any response; 0.5 keeps the visible ones.
    method : str
        "dense", "sparse", or "auto" for the faster.

    Returns
    -------
    RotorModes
        By rising undamped frequency; the rigid motions of a free shaft come first, as zeros.

    Raises
    ------
    ValueError
        An argument is out of range.
    RuntimeError
        The sparse search did not converge.

    Notes
    -----
    With ``v = lambda u / s`` the quadratic problem becomes one of first order; it is inverted about
    a real shift s, the shaft's own first frequency, so that low modes keep their digits regardless
    of the mesh's highest, and free shafts need no special treatment. The search continues until no
    motion of lower frequency can be missing. For modes with equal eigenvalues any combination is a
    mode too: at rest those in the planes of y and z are returned, else the circular ones.

    Examples
    --------
    >>> from wearstate.sim.beam.rotor import Support
    >>> from wearstate.sim.beam.beam import assemble_beam
    >>> from wearstate.sim.beam.beam_parts import Disc, Section
    >>> steel = dict(young=211e9, shear_modulus=81.2e9, density=7810.0)
    >>> beam = assemble_beam([Section(length=1.5, outer_diameter=0.05, **steel)],
    ...                      longest_element=0.25, shear_coefficient="cowper",
    ...                      discs=[Disc(station=1.0, mass=50.0, polar_inertia=0.8,
    ...                                  diametral_inertia=0.42)])
    >>> ends = [Support(name=str(s), station=s, stiffness=1e6 * np.eye(2)) for s in (0.0, 1.5)]
    >>> found = modes(Rotor(beam=beam, supports=tuple(ends)), speed=400.0, count=2)
    >>> found.direction
    ('backward', 'forward')
    """
    _checked_modes(speed, count, most_damping, method)
    found = _symmetric(rotor, count, method) if speed == 0 else None
    values, shapes, real = found or _general(rotor, speed, count, most_damping, method)
    shapes = _normalised(rotor, _parted(rotor, speed, values, shapes))
    forward, backward = _circles(rotor.beam, shapes)
    return RotorModes(
        speed=float(speed),
        eigenvalues=values,
        shapes=shapes,
        forward_share=_forward_share(rotor, forward, backward),
        axis_ratio=_axis_ratio(forward, backward),
        real_eigenvalues=real,
    )


def natural_frequencies(
    rotor: Rotor,
    speed: float = 0.0,
    count: int = 6,
    *,
    most_damping: float = 1.0,
    method: str = "auto",
) -> Vector:
    """Undamped natural frequencies ``|lambda| / 2 pi`` of a rotor.

    Parameters
    ----------
    rotor : Rotor
        Shaft on its supports.
    speed : float
        Shaft speed [rad/s], may be negative.
    count : int
        Number of modes, >= 1.
    most_damping : float
        In (0, 1]: modes of a higher damping ratio are omitted.
    method : str
        As in :func:`modes`.

    Returns
    -------
    numpy.ndarray [shape=(count,) or fewer]
        Rising [Hz].

    Examples
    --------
    A free bar has rigid motions of no frequency in both planes, and ``(4.730 / l)^2 sqrt(EI / m)``:

    >>> from wearstate.sim.beam.beam import assemble_beam
    >>> from wearstate.sim.beam.beam_parts import Section
    >>> bar = Section(length=2.0, outer_diameter=0.05, young=2e11, shear_modulus=8e10,
    ...               density=7850.0)
    >>> beam = assemble_beam([bar], theory="euler-bernoulli", longest_element=0.1)
    >>> natural_frequencies(Rotor(beam=beam, supports=()), count=6).round(2)[4:]
    array([56.17, 56.17])
    """
    found = modes(rotor, speed, count, most_damping=most_damping, method=method)
    return found.undamped_frequency_hz


def _checked_modes(speed: float, count: int, most_damping: float, method: str) -> None:
    faults = []
    if not math.isfinite(speed):
        faults.append(f"speed = {speed} rad/s must be finite")
    if count < 1:
        faults.append(f"count = {count} must be >= 1")
    if not 0 < most_damping <= 1:
        faults.append(f"most_damping = {most_damping} must be in (0, 1]; 1 omits none")
    if method not in ("auto", "dense", "sparse"):
        faults.append(f"method = '{method}' must be one of auto, dense, sparse")
    if faults:
        raise ValueError("\n".join(faults))


def _shift(beam: Beam) -> float:
    """Estimate of the shaft's first bending frequency, pinned at its ends, mass spread [rad/s]."""
    e = beam.elements
    bending = float(e.bending @ e.length) / beam.length
    mass = float(e.mass @ e.length) + sum(disc.mass + disc.entrained_mass for disc in beam.discs)
    return math.pi**2 / beam.length**2 * math.sqrt(bending * beam.length / mass)


def _symmetric(rotor: Rotor, count: int, method: str) -> Found | None:
    """Real modes of a rotor at rest, or None if it has none or a negative stiffness."""
    k, m = rotor.stiffness, rotor.mass
    skew = abs(k - k.T).max()
    if rotor.damping().count_nonzero() or skew > _SYMMETRIC * abs(k).max():
        return None
    n, square = rotor.n_dof, _shift(rotor.beam) ** 2
    count = min(count, n)
    dense = n <= _DENSE_SYMMETRIC if method == "auto" else method == "dense"
    try:
        if dense or count > n // 3:
            last = (n - count, n - 1)
            raised = (k + square * m).toarray()
            inverse, shapes = linalg.eigh(m.toarray(), raised, subset_by_index=last)
            squares = 1 / inverse - square
        else:
            start = np.random.default_rng(_SEED).standard_normal(n)
            squares, shapes = eigsh(k, count, m, sigma=-square, v0=start)
    except np.linalg.LinAlgError:
        return None
    if squares.min() < -1e-9 * square:
        return None
    order = np.argsort(squares)
    squares = squares[order]
    squares[squares < 1e-9 * square] = 0.0  # rigid: rounding leaves 1e-12 of the shift's square
    return 1j * np.sqrt(squares), shapes[:, order].astype(complex), np.zeros(0)


def _general(rotor: Rotor, speed: float, count: int, most_damping: float, method: str) -> Found:
    n, s = rotor.n_dof, _shift(rotor.beam)
    invert = _Inverse(rotor, speed, s)
    dense = n <= _DENSE_GENERAL if method == "auto" else method == "dense"
    asked = 2 * count + 6
    while not dense and asked < n:
        values, states = invert.nearest(asked)
        reach = np.abs(values - s).max() - s  # no slower one is missing
        found = _sorted(rotor, speed, values, states, count, most_damping)
        if found[0].size == count and np.abs(found[0][-1]) <= reach:
            return found
        asked *= 2
    values, states = invert.all()
    return _sorted(rotor, speed, values, states, count, most_damping)


class _Inverse:
    """Shifted and inverted first-order form, with eigenvalues ``1 / (lambda - s)``.

    ``u = -S^-1 (s M b_v + (D + s M) b_u)``, ``v = b_u / s + u``, ``S = K + s D + s^2 M``.
    """

    def __init__(self, rotor: Rotor, speed: float, shift: float) -> None:
        damping = rotor.damping(speed)
        self.shift = shift
        self.mass = shift * rotor.mass
        self.lower = damping + self.mass
        self.matrix = (rotor.stiffness + shift * self.lower).tocsc()

    def all(self) -> tuple[Complex, Complex]:
        n = self.matrix.shape[0]
        both = np.hstack([self.lower.toarray(), self.mass.toarray()])
        upper = -linalg.solve(self.matrix.toarray(), both)
        lower = upper.copy()
        lower[:, :n] += np.eye(n) / self.shift
        return self._unshifted(*linalg.eig(np.vstack([upper, lower])))

    def nearest(self, count: int) -> tuple[Complex, Complex]:
        n, factors = self.matrix.shape[0], splu(self.matrix)

        def apply(state: Vector) -> Vector:
            first, second = state[:n], state[n:]
            moved = -factors.solve(self.mass @ second + self.lower @ first)
            return np.concatenate([moved, first / self.shift + moved])

        start = np.random.default_rng(_SEED).standard_normal(2 * n)
        operator = LinearOperator((2 * n, 2 * n), matvec=apply, dtype=float)
        width = min(2 * n, 2 * count + 20)
        return self._unshifted(*eigs(operator, count, ncv=width, v0=start))

    def _unshifted(self, inverse: Complex, states: Complex) -> tuple[Complex, Complex]:
        kept = inverse != 0
        return self.shift + 1 / inverse[kept], states[: self.matrix.shape[0], kept]


def _sorted(
    rotor: Rotor, speed: float, values: Complex, shapes: Complex, count: int, most_damping: float
) -> Found:
    """Rigid motions, then oscillating modes by magnitude; and real eigenvalues."""
    order = np.argsort(np.abs(values), kind="stable")
    values, shapes = values[order], shapes[:, order]
    motions = _rigid_motions(rotor)
    rest = _zeros(rotor, speed, motions)  # split by rounding, with nearly parallel shapes
    size = np.abs(values[rest:])
    wanted = (values[rest:].imag > _REAL * size) & (-values[rest:].real <= most_damping * size)
    oscillating = rest + np.flatnonzero(wanted)
    still = motions[:, : rest // 2]
    all_values: Complex = np.append(np.zeros(still.shape[1], complex), values[oscillating])
    all_shapes = np.hstack([still, shapes[:, oscillating]])
    real = values[rest:][np.abs(values[rest:].imag) <= _REAL * size].real
    return all_values[:count], all_shapes[:, :count], real


def _rigid_motions(rotor: Rotor) -> Vector:
    """Motions without any spring force [shape=(n_dof, n_motions)]."""
    n, stations = rotor.beam.n_dof, rotor.beam.stations
    candidates = np.zeros((rotor.n_dof, 4 + rotor.n_dof - n))
    candidates[0:n:4, 0] = candidates[2:n:4, 1] = 1.0
    candidates[0:n:4, 2] = candidates[2:n:4, 3] = stations / rotor.beam.length - 0.5
    candidates[1:n:4, 2] = candidates[3:n:4, 3] = 1 / rotor.beam.length
    candidates[n:, 4:] = np.eye(rotor.n_dof - n)
    force = np.abs(rotor.stiffness) @ np.abs(candidates)
    _, stretch, turn = np.linalg.svd(rotor.stiffness @ candidates)
    motions: Vector = candidates @ turn[stretch <= _SYMMETRIC * force.max()].T
    return motions


def _zeros(rotor: Rotor, speed: float, motions: Vector) -> int:
    """Number of zero eigenvalues: two for a rigid motion, one if a force damps it."""
    if not motions.size:
        return 0
    damping = rotor.damping(speed)
    slowed = motions.T @ (damping @ motions)
    bound = _SYMMETRIC * (np.abs(motions).T @ (np.abs(damping) @ np.abs(motions))).max()
    rank = int(np.linalg.matrix_rank(slowed, tol=bound))
    count: int = motions.shape[1]
    return 2 * count - rank


def _parted(rotor: Rotor, speed: float, values: Complex, shapes: Complex) -> Complex:
    """Combine modes of equal eigenvalue to most and least in y, or most and least forward."""
    parted = shapes.copy()
    first = 0
    for last in range(1, values.size + 1):
        distinct = last == values.size or abs(values[last] - values[first]) > EQUAL * abs(
            values[first]
        )
        if not distinct:
            continue
        if last - first > 1 and (speed == 0 or values[first] != 0):
            group = shapes[:, first:last]
            part = group[0 : rotor.beam.n_dof : 4] if speed == 0 else _circles(rotor.beam, group)[0]
            whole = group.conj().T @ group
            _, turn = linalg.eigh(part.conj().T @ part, whole)
            parted[:, first:last] = group @ turn[:, ::-1]
        first = last
    return parted


def _normalised(rotor: Rotor, shapes: Complex) -> Complex:
    n, columns = rotor.beam.n_dof, np.arange(shapes.shape[1])
    moved = shapes.copy()
    moved[1:n:2] = 0.0  # slopes
    whole = np.abs(moved)
    shaft = whole[:n].max(axis=0) > 1e-9 * whole.max(axis=0)
    row = np.where(shaft, whole[:n].argmax(axis=0), whole.argmax(axis=0))
    largest: Complex = moved[row, columns]
    return shapes / largest


def _circles(beam: Beam, response: Complex) -> tuple[Complex, Complex]:
    """Forward and backward circle of each node's orbit [shape=(n_nodes, ...)]."""
    y, z = response[0 : beam.n_dof : 4], response[2 : beam.n_dof : 4]
    return (y + 1j * z) / 2, (y - 1j * z) / 2


def _axis_ratio(forward: Complex, backward: Complex) -> Vector:
    f, b = np.abs(forward), np.abs(backward)
    still = f + b <= 1e-9 * (f + b).max(axis=0, initial=0.0)
    return np.where(still, 0.0, (f - b) / np.where(still, 1.0, f + b))


def _forward_share(rotor: Rotor, forward: Complex, backward: Complex) -> Vector:
    mass = rotor.beam.mass[0::4, :][:, 0::4]
    f, b = (np.sum(part.conj() * (mass @ part), axis=0).real for part in (forward, backward))
    total = f + b
    return np.where(total > 0, f / np.where(total > 0, total, 1.0), 0.5)
