"""A shaft on its supports, turning: natural frequencies, modes, Campbell diagram, unbalance.

Coordinates are those of the beam, four a node, and behind them y and z of every housing, in the
order of the supports. The shaft turns from y to z, which is forward.

==========  ======================================================================================
eigenvalues by
==========  ======================================================================================
symmetric   no damping, no rotation, symmetric supports: real modes
dense       all eigenvalues of the inverted, shifted first-order form
sparse      those nearest the shift, by Arnoldi's method on the factorised sparse matrix
==========  ======================================================================================
"""

import math
from abc import ABC
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg
from scipy.optimize import brentq, linear_sum_assignment
from scipy.sparse import block_array, coo_array, csc_array
from scipy.sparse.linalg import LinearOperator, eigs, eigsh, splu

from ..brief import brief
from .beam import Beam, Sparse

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

PARTS = ("shaft", "housing")
"""What a coordinate can belong to."""

_SUPPORT_ORDER = ("y", "z", "slope_y", "slope_z")
_SEED = 5  # of the first vector of a sparse search: any fixed one makes runs repeatable
_DENSE_SYMMETRIC = 200  # coordinates; above these the sparse search is the faster
_DENSE_GENERAL = 60
_EQUAL = 1e-8  # of an eigenvalue: nearer ones are one, its shapes any that span the same
_REAL = 1e-6  # of an eigenvalue: rounding gives equal real ones an imaginary part, up to 1e-8
_PLANAR = 1e-3  # of the major axis: an orbit with a thinner one is a line
_SYMMETRIC = 1e-12  # of the largest entry
_MOST_BISECTIONS = 12  # of a step across which a mode is not like itself
_NARROWEST = 8  # the same where two modes change places
_SPARE = 4  # modes that may come in from above between two speeds
_LEAST_MAC = 0.8  # between neighbouring speeds; below, the step is halved


# --- supports and rotor


@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """A bearing: stiffness and damping between the shaft and its housing or the ground.

    Attributes
    ----------
    name : str
    station : float
        Of a node of the beam [m].
    stiffness : array_like [shape=(2, 2) or (4, 4)]
        In the order y, z, slope_y, slope_z [N/m], [N/rad], [N m/m], [N m/rad].
    damping : array_like, optional
        The same times a second, of the same shape; by default none.
    housing_mass : float, optional
        [kg]. With it the housing has y and z of its own and stands on the pedestal; moments go
        to the ground, since a housing does not turn. Without, all goes to the ground.
    pedestal_stiffness, pedestal_damping : tuple of float
        Along y and z [N/m], [N s/m]; only with a housing.

    Raises
    ------
    ValueError
        Something is out of its range; all faults at once.

    Examples
    --------
    >>> Support(name="aft", station=0.0, stiffness=1e8 * np.eye(2)).damping
    array([[0., 0.],
           [0., 0.]])
    """

    name: str
    station: float
    stiffness: Any
    damping: Any = None
    housing_mass: float | None = None
    pedestal_stiffness: tuple[float, float] | None = None
    pedestal_damping: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        k = np.array(self.stiffness, dtype=float)
        c = np.zeros_like(k) if self.damping is None else np.array(self.damping, dtype=float)
        object.__setattr__(self, "stiffness", k)
        object.__setattr__(self, "damping", c)
        faults = [*self._film_faults(), *self._pedestal_faults()]
        if faults:
            raise ValueError("\n".join(faults))

    def _film_faults(self) -> Iterator[str]:
        k, c = self.stiffness, self.damping
        if k.shape not in ((2, 2), (4, 4)):
            yield (
                f"support '{self.name}': stiffness of shape {k.shape} must be (2, 2), or (4, 4) "
                f"in the order {', '.join(_SUPPORT_ORDER)}; numpy.diag makes one of two numbers"
            )
        if c.shape != k.shape:
            yield (
                f"support '{self.name}': damping of shape {c.shape} must be that of stiffness = "
                f"{k.shape}; fill with zeros"
            )
        for quantity, matrix in (("stiffness", k), ("damping", c)):
            if not np.isfinite(matrix).all():
                yield (
                    f"support '{self.name}': {quantity} must be finite; a rigid support takes a "
                    "thousand times the shaft's own stiffness"
                )

    def _pedestal_faults(self) -> Iterator[str]:
        if self.housing_mass is None:
            if self.pedestal_stiffness is not None or any(self.pedestal_damping):
                yield (
                    f"support '{self.name}': housing_mass is missing, must be > 0 with a pedestal; "
                    "give the mass that moves with the bearing"
                )
            return
        if not 0 < self.housing_mass < math.inf:
            yield (
                f"support '{self.name}': housing_mass = {self.housing_mass} kg must be > 0 and "
                "finite; leave it out where the bearing stands on the ground"
            )
        if self.pedestal_stiffness is None:
            yield f"support '{self.name}': pedestal_stiffness is missing; a housing stands on one"
        for quantity, unit in (("pedestal_stiffness", "N/m"), ("pedestal_damping", "N s/m")):
            for axis, value in zip("yz", getattr(self, quantity) or (), strict=False):
                if not 0 <= value < math.inf:
                    yield (
                        f"support '{self.name}': {quantity} along {axis} = {value} {unit} must be "
                        ">= 0 and finite; check the unit"
                    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Unbalance:
    """A mass off the axis, that turns with the shaft.

    Attributes
    ----------
    station : float
        Of a node [m].
    moment : float
        Mass times distance from the axis [kg m].
    phase : float
        Ahead of the shaft's mark, which points along y at time zero [rad].
    """

    station: float
    moment: float
    phase: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Rotor:
    """A beam on supports: ``M q'' + (C + Omega G) q' + K q = f``.

    Attributes
    ----------
    beam : Beam
    supports : tuple of Support
        Empty for a free shaft.
    damping_ratio : float
        Of the shaft's own material, over the critical, in [0, 1); it holds at both ends of the
        band, is less between and more outside.
    damping_band : tuple of float, optional
        Two frequencies [Hz], the lower may be zero; must be given with a damping ratio.

    Raises
    ------
    ValueError
        A support stands on no node, names repeat, or the damping is unusable; all at once.

    Notes
    -----
    The shaft's damping is ``alpha M + beta K`` of the beam alone, ``alpha = 2 zeta w1 w2 /
    (w1 + w2)``, ``beta = 2 zeta / (w1 + w2)``. It stands still, as seen by an observer: damping
    that turned with the shaft would feed the forward whirl above the first critical speed, so
    keep to lower speeds, or to damping that is small beside that of the supports.

    References
    ----------
    Friswell, Penny, Garvey, Lees (2010), Dynamics of Rotating Machines, Cambridge University
    Press, chapters 5 and 7.

    Examples
    --------
    >>> from .beam import Section, assemble_beam
    >>> bar = Section(length=1.0, outer_diameter=0.05, young=2e11, shear_modulus=8e10,
    ...               density=7800.0)
    >>> beam = assemble_beam([bar], longest_element=0.1, theory="euler-bernoulli")
    >>> ends = [Support(name=n, station=s, stiffness=1e13 * np.eye(2))
    ...         for n, s in (("aft", 0.0), ("forward", 1.0))]
    >>> rotor = Rotor(beam=beam, supports=tuple(ends))
    >>> [round(float(f), 1) for f in modes(rotor, count=4).frequency_hz]
    [99.4, 99.4, 397.7, 397.7]
    """

    beam: Beam
    supports: tuple[Support, ...] = ()
    damping_ratio: float = 0.0
    damping_band: tuple[float, float] | None = None

    __repr__ = brief("n_dof", "supports", "damping_ratio")

    def __post_init__(self) -> None:
        object.__setattr__(self, "supports", tuple(self.supports))
        faults = [*self._support_faults(), *self._damping_faults()]
        if faults:
            raise ValueError("\n".join(faults))

    def _support_faults(self) -> Iterator[str]:
        names = [support.name for support in self.supports]
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield f"support '{name}' stands {names.count(name)} times, must be unique; rename one"
        for support in self.supports:
            try:
                self.beam.node(support.station)
            except ValueError as fault:
                yield f"support '{support.name}': {fault}"

    def _damping_faults(self) -> Iterator[str]:
        if not 0 <= self.damping_ratio < 1:
            yield f"damping_ratio = {self.damping_ratio} must be in [0, 1); steel has about 0.002"
        band = self.damping_band
        if band is None:
            if self.damping_ratio > 0:
                yield (
                    "damping_band is missing, must be two frequencies in Hz with a damping_ratio; "
                    "give the band of interest"
                )
        elif not 0 <= band[0] < band[1] < math.inf:
            yield f"damping_band = {band} Hz must be 0 <= lower < upper, finite; turn them round"

    @property
    def n_dof(self) -> int:
        """Count of the coordinates, of the beam and of the housings."""
        return self.beam.n_dof + 2 * len(self._housed)

    @cached_property
    def _housed(self) -> list[str]:
        return [s.name for s in self.supports if s.housing_mass is not None]

    def dof(self, place: str | float, coordinate: str, part: str = "shaft") -> int:
        """Index of a coordinate.

        Parameters
        ----------
        place : str or float
            Name of a support, or station of a node [m].
        coordinate : str
            "y", "slope_y", "z" or "slope_z"; of a housing "y" or "z".
        part : str
            "shaft" or "housing".

        Raises
        ------
        ValueError
            There is no such place, coordinate or part.
        """
        if part not in PARTS:
            raise ValueError(f"part = '{part}' must be one of {', '.join(PARTS)}")
        if part == "shaft":
            station = place if not isinstance(place, str) else self._support(place).station
            return self.beam.dof(station, coordinate)
        if place not in self._housed:
            raise ValueError(
                f"place = '{place}' must be a support with a housing: "
                f"{', '.join(self._housed) or 'there is none'}"
            )
        if coordinate not in ("y", "z"):
            raise ValueError(f"coordinate = '{coordinate}' of a housing must be y or z")
        return self.beam.n_dof + 2 * self._housed.index(str(place)) + "yz".index(coordinate)

    def _support(self, name: str) -> Support:
        for support in self.supports:
            if support.name == name:
                return support
        known = ", ".join(support.name for support in self.supports)
        raise ValueError(f"place = '{name}' must be a support: {known or 'there is none'}")

    @cached_property
    def mass(self) -> Sparse:
        """M [shape=(n_dof, n_dof)], scipy.sparse.csc_array."""
        masses = [s.housing_mass for s in self.supports if s.housing_mass is not None]
        at = self.beam.n_dof + np.arange(2 * len(masses))
        housings = coo_array((np.repeat(masses, 2), (at, at)), shape=2 * (self.n_dof,))
        return self._widened(self.beam.mass) + housings.tocsc()

    @cached_property
    def stiffness(self) -> Sparse:
        """K [shape=(n_dof, n_dof)], scipy.sparse.csc_array; symmetric where the supports are."""
        return self._widened(self.beam.stiffness) + self._of_supports("stiffness")

    @cached_property
    def gyroscopic(self) -> Sparse:
        """G [shape=(n_dof, n_dof)], skew, to be multiplied by the speed [rad/s]."""
        return self._widened(self.beam.gyroscopic)

    @cached_property
    def _damping_at_rest(self) -> Sparse:
        alpha, beta = self._proportional
        own = alpha * self.beam.mass + beta * self.beam.stiffness
        return self._widened(own) + self._of_supports("damping")

    @property
    def _proportional(self) -> tuple[float, float]:
        if self.damping_band is None:
            return 0.0, 0.0
        low, high = (2 * math.pi * f for f in self.damping_band)
        beta = 2 * self.damping_ratio / (low + high)
        return beta * low * high, beta

    def damping(self, speed: float = 0.0) -> Sparse:
        """``C + Omega G`` [shape=(n_dof, n_dof)], scipy.sparse.csc_array.

        Parameters
        ----------
        speed : float
            Of the shaft, positive from y to z [rad/s].
        """
        if speed == 0:
            return self._damping_at_rest
        return self._damping_at_rest + speed * self.gyroscopic

    def _widened(self, matrix: Sparse) -> Sparse:
        """Room for the housings."""
        if not self._housed:
            return matrix
        spare = csc_array((self.n_dof - self.beam.n_dof,) * 2)
        return block_array([[matrix, None], [None, spare]], format="csc")

    def _of_supports(self, quantity: str) -> Sparse:
        rows, columns, values = [], [], []
        for support in self.supports:
            at, matrix = self._local(support, quantity)
            rows.append(np.repeat(at, at.size))
            columns.append(np.tile(at, at.size))
            values.append(matrix.ravel())
        if not rows:
            return csc_array(2 * (self.n_dof,))
        places = (np.concatenate(rows), np.concatenate(columns))
        full = coo_array((np.concatenate(values), places), shape=2 * (self.n_dof,)).tocsc()
        full.eliminate_zeros()
        return full

    def _local(self, support: Support, quantity: str) -> tuple[NDArray[np.int64], Vector]:
        """Coordinates that a support joins, and its matrix over them."""
        film = getattr(support, quantity)
        names = _SUPPORT_ORDER[: len(film)]
        shaft = [self.beam.dof(support.station, name) for name in names]
        if support.housing_mass is None:
            return np.array(shaft), film
        housing = [self.dof(support.name, axis, "housing") for axis in "yz"]
        relative = np.hstack([np.eye(len(film)), -np.eye(len(film), 2)])
        matrix = relative.T @ film @ relative
        matrix[-2:, -2:] += np.diag(getattr(support, f"pedestal_{quantity}"))
        return np.array(shaft + housing), matrix


# --- modes


class _Vibrations(ABC):
    """What complex eigenvalues tell [rad/s]."""

    eigenvalues: Complex

    @property
    def frequency_hz(self) -> Vector:
        """Damped, ``Im(lambda) / 2 pi`` [Hz]."""
        return self.eigenvalues.imag / (2 * math.pi)

    @property
    def undamped_frequency_hz(self) -> Vector:
        """``|lambda| / 2 pi`` [Hz]."""
        return np.abs(self.eigenvalues) / (2 * math.pi)

    @property
    def damping_ratio(self) -> Vector:
        """``-Re(lambda) / |lambda|``; negative where the motion grows, 0 for a rigid motion."""
        size = np.abs(self.eigenvalues)
        return -self.eigenvalues.real / np.where(size > 0, size, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class RotorModes(_Vibrations):
    """Free vibrations ``q = Re(shape exp(lambda t))`` of a rotor at one speed.

    Attributes
    ----------
    speed : float
        [rad/s]
    eigenvalues : numpy.ndarray [shape=(n_modes,)]
        lambda with an imaginary part >= 0, by rising magnitude [rad/s].
    shapes : numpy.ndarray [shape=(n_dof, n_modes)]
        Complex; each has a largest displacement of the shaft of one, taken real, or of the
        housings where the shaft has none.
    forward_share : numpy.ndarray [shape=(n_modes,)]
        Of the kinetic energy of translation, the part that whirls forward; 0.5 in a plane.
    axis_ratio : numpy.ndarray [shape=(n_nodes, n_modes)]
        Minor over major axis of the orbit at each node: 1 a forward circle, 0 a line, -1 a
        backward circle; 0 where the node is at rest.
    real_eigenvalues : numpy.ndarray
        Overdamped motions that were met on the way, not all there are [rad/s].
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
        """``2 pi zeta / sqrt(1 - zeta^2)``."""
        zeta = self.damping_ratio
        return 2 * math.pi * zeta / np.sqrt(1 - zeta**2)

    @property
    def direction(self) -> tuple[str, ...]:
        """Of each mode: "forward", "backward", "planar", or "mixed" if nodes differ."""
        return tuple(_direction(ratios) for ratios in self.axis_ratio.T)

    @property
    def stable(self) -> bool:
        """False where a motion that was found grows, by more than rounding."""
        bound = 1e-9 * np.abs(self.eigenvalues).max(initial=0.0)
        return not ((self.eigenvalues.real > bound).any() or (self.real_eigenvalues > bound).any())


def _direction(ratios: Vector) -> str:
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
    """The lowest modes of a rotor.

    Parameters
    ----------
    rotor : Rotor
        Shaft on its supports.
    speed : float
        [rad/s], may be negative.
    count : int
        Of modes wanted, >= 1; fewer come where the rotor has fewer that oscillate.
    most_damping : float
        In (0, 1]: modes of a higher damping ratio are left out. Oil films make many that no
        response shows; 0.5 leaves those that do.
    method : str
        "dense", "sparse", or "auto" for the faster.

    Returns
    -------
    RotorModes
        By rising undamped frequency; the rigid motions of a free shaft come first, as zeros.

    Raises
    ------
    ValueError
        An argument is out of its range.
    RuntimeError
        The sparse search did not converge.

    Notes
    -----
    With ``v = lambda u / s`` the quadratic problem is one of first order; it is inverted about a
    real shift s, the shaft's own first frequency, so that low modes keep their digits whatever
    the highest of the mesh, and free shafts need no care. The search goes on until no motion of
    lower frequency can have been missed. Of modes with one eigenvalue any combination is a mode
    too: at rest the ones in the planes of y and z are given, else the circular ones.

    Examples
    --------
    >>> from .beam import Disc, Section, assemble_beam
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
        Of the shaft [rad/s], may be negative.
    count : int
        Of modes wanted, >= 1.
    most_damping : float
        In (0, 1]: modes of a higher damping ratio are left out.
    method : str
        As of :func:`modes`.

    Returns
    -------
    numpy.ndarray [shape=(count,) or fewer]
        Rising [Hz].

    Examples
    --------
    A free bar has rigid motions of no frequency in both planes, and ``(4.730 / l)^2 sqrt(EI / m)``:

    >>> from .beam import Section, assemble_beam
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
        faults.append(f"most_damping = {most_damping} must be in (0, 1]; 1 leaves out none")
    if method not in ("auto", "dense", "sparse"):
        faults.append(f"method = '{method}' must be one of auto, dense, sparse")
    if faults:
        raise ValueError("\n".join(faults))


def _shift(beam: Beam) -> float:
    """First bending frequency of the shaft pinned at its ends, all mass spread, about [rad/s]."""
    e = beam.elements
    bending = float(e.bending @ e.length) / beam.length
    mass = float(e.mass @ e.length) + sum(disc.mass + disc.entrained_mass for disc in beam.discs)
    return math.pi**2 / beam.length**2 * math.sqrt(bending * beam.length / mass)


Found = tuple[Complex, Complex, Vector]


def _symmetric(rotor: Rotor, count: int, method: str) -> Found | None:
    """Real modes of a rotor at rest, or None if it has none or a stiffness below zero."""
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
        reach = np.abs(values - s).max() - s  # nothing slower is missing
        found = _sorted(rotor, speed, values, states, count, most_damping)
        if found[0].size == count and np.abs(found[0][-1]) <= reach:
            return found
        asked *= 2
    values, states = invert.all()
    return _sorted(rotor, speed, values, states, count, most_damping)


class _Inverse:
    """The first-order form, shifted and inverted: eigenvalues ``1 / (lambda - s)``.

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
    """Oscillating ones by magnitude, behind the rigid motions, and real ones."""
    order = np.argsort(np.abs(values), kind="stable")
    values, shapes = values[order], shapes[:, order]
    motions = _rigid_motions(rotor)
    rest = _zeros(rotor, speed, motions)  # split by rounding, of shapes all but parallel
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
    """Count of eigenvalues that are zero: two for a rigid motion, one where a force slows it."""
    if not motions.size:
        return 0
    damping = rotor.damping(speed)
    slowed = motions.T @ (damping @ motions)
    bound = _SYMMETRIC * (np.abs(motions).T @ (np.abs(damping) @ np.abs(motions))).max()
    rank = int(np.linalg.matrix_rank(slowed, tol=bound))
    count: int = motions.shape[1]
    return 2 * count - rank


def _parted(rotor: Rotor, speed: float, values: Complex, shapes: Complex) -> Complex:
    """Of modes with one eigenvalue, those with most and least in y, or most and least forward."""
    parted = shapes.copy()
    first = 0
    for last in range(1, values.size + 1):
        apart = last == values.size or abs(values[last] - values[first]) > _EQUAL * abs(
            values[first]
        )
        if not apart:
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


# --- over the speed


@dataclass(frozen=True, kw_only=True, eq=False)
class Campbell(_Vibrations):
    """Modes of a rotor followed over its speed.

    Attributes
    ----------
    speeds : numpy.ndarray [shape=(n_speeds,)]
        [rad/s]
    eigenvalues : numpy.ndarray [shape=(n_speeds, n_modes)]
        Each column one mode [rad/s]; NaN from where the mode was lost.
    shapes : numpy.ndarray [shape=(n_speeds, n_dof, n_modes)]
        As in :class:`RotorModes`; NaN likewise.
    axis_ratio : numpy.ndarray [shape=(n_speeds, n_nodes, n_modes)]
        Of the orbits, as in :class:`RotorModes`; NaN likewise.
    mac : numpy.ndarray [shape=(n_speeds, n_modes)]
        Least likeness to the shape of the step before, 1 for the same; the first row is 1.
    lost_at : numpy.ndarray [shape=(n_modes,)]
        Speed from which a mode no longer oscillates, or cannot be told from others [rad/s];
        inf where it was followed to the end.
    """

    speeds: Vector
    eigenvalues: Complex
    shapes: Complex
    axis_ratio: Vector
    mac: Vector
    lost_at: Vector

    __repr__ = brief("speeds", "frequency_hz")

    @property
    def direction(self) -> tuple[tuple[str, ...], ...]:
        """For each speed that of each mode, as in :class:`RotorModes`; "lost" where it was."""
        return tuple(
            tuple("lost" if np.isnan(mode).any() else _direction(mode) for mode in nodes.T)
            for nodes in self.axis_ratio
        )


RotorLaw = Callable[[float], Rotor]


def campbell(
    rotor: Rotor | RotorLaw, speeds: ArrayLike, count: int = 6, *, most_damping: float = 1.0
) -> Campbell:
    """Natural frequencies and damping over the speed, each mode followed by its shape.

    Parameters
    ----------
    rotor : Rotor or callable
        A function of the speed [rad/s] gives one, where films make stiffness and damping depend
        on the speed; all with the same coordinates.
    speeds : array_like [shape=(n_speeds,)]
        [rad/s], rising or falling throughout.
    count : int
        Of modes to follow, the lowest at the first speed.
    most_damping : float
        In (0, 1]: of the modes at the first speed, as in :func:`modes`; then a mode is followed
        half the way from there to 1.

    Returns
    -------
    Campbell
        Every mode at every speed.

    Raises
    ------
    ValueError
        The speeds do not rise or fall throughout, or there are fewer modes.

    Notes
    -----
    Shapes of neighbouring speeds are paired so that the sum of their likeness
    ``|a* M b|^2 / (a* M a  b* M b)`` is greatest. Where one falls below 0.8, or two modes have
    changed places, the step is halved: so a mode is followed across a crossing, where it keeps
    its shape, and round a veering, where it takes on the other's. A veering narrower than 1/256
    of a step counts as a crossing; what is below 0.5 at 1/4096 of a step ends there.

    Examples
    --------
    >>> from .beam import Disc, Section, assemble_beam
    >>> steel = dict(young=211e9, shear_modulus=81.2e9, density=7810.0)
    >>> beam = assemble_beam([Section(length=1.5, outer_diameter=0.05, **steel)],
    ...                      longest_element=0.25, shear_coefficient="cowper",
    ...                      discs=[Disc(station=1.0, mass=50.0, polar_inertia=0.8,
    ...                                  diametral_inertia=0.42)])
    >>> ends = [Support(name=str(s), station=s, stiffness=1e6 * np.eye(2)) for s in (0.0, 1.5)]
    >>> found = campbell(Rotor(beam=beam, supports=tuple(ends)), [0.0, 200.0, 400.0], count=2)
    >>> bool(np.diff(np.sort(found.frequency_hz[-1])) > np.diff(np.sort(found.frequency_hz[0])))
    True
    """
    omega = np.atleast_1d(np.asarray(speeds, dtype=float))
    steps = np.diff(omega)
    if omega.ndim != 1 or not np.isfinite(omega).all() or not (all(steps > 0) or all(steps < 0)):
        raise ValueError("speeds must be finite and rise or fall throughout; sort them")
    law = rotor if callable(rotor) else lambda _: rotor
    track = _Track(law, float(omega[0]), count, most_damping)
    rows = [track.row()]
    for before, speed in pairwise(omega):
        track.least[:] = 1.0
        track.follow(float(before), float(speed), 0)
        rows.append(track.row())
    return Campbell(
        speeds=omega,
        eigenvalues=np.array([row[0] for row in rows]),
        shapes=np.array([row[1] for row in rows]),
        axis_ratio=np.array([row[2] for row in rows]),
        mac=np.array([row[3] for row in rows]),
        lost_at=track.lost_at,
    )


class _Track:
    """Modes on their way from speed to speed."""

    def __init__(self, law: RotorLaw, speed: float, count: int, most_damping: float) -> None:
        self.law = law
        self.most_damping = (1 + most_damping) / 2
        found = modes(law(speed), speed, count, most_damping=most_damping)
        if found.eigenvalues.size < count:
            raise ValueError(
                f"count = {count} must be <= {found.eigenvalues.size}, of modes that oscillate at "
                f"{speed:g} rad/s; ask for fewer"
            )
        self.values, self.shapes, self.ratios = found.eigenvalues, found.shapes, found.axis_ratio
        self.least = np.ones(count)
        self.lost_at = np.full(count, math.inf)

    def row(self) -> tuple[Complex, Complex, Vector, Vector]:
        lost = np.isfinite(self.lost_at)
        return (
            np.where(lost, np.nan, self.values),
            np.where(lost, np.nan, self.shapes),
            np.where(lost, np.nan, self.ratios),
            np.where(lost, np.nan, self.least),
        )

    def follow(self, before: float, speed: float, depth: int) -> None:
        rotor, alive = self.law(speed), np.flatnonzero(np.isinf(self.lost_at))
        wanted = self.values.size + _SPARE
        found = modes(rotor, speed, wanted, most_damping=self.most_damping)
        likeness = _likeness(rotor.mass, self.shapes[:, alive], self.values[alive], found.shapes)
        rows, columns = linear_sum_assignment(-likeness)
        matched, kept = likeness[rows, columns], alive[rows]
        unlike = rows.size < alive.size or matched.min(initial=1.0) < _LEAST_MAC
        swapped = _swapped(self.values[kept], found.eigenvalues[columns])
        if depth < _MOST_BISECTIONS * unlike or depth < _NARROWEST * swapped:
            middle = (before + speed) / 2
            self.follow(before, middle, depth + 1)
            self.follow(middle, speed, depth + 1)
            return
        self.lost_at[np.setdiff1d(alive, kept)] = speed
        self.lost_at[kept[matched < 0.5]] = speed
        self.values[kept] = found.eigenvalues[columns]
        self.shapes[:, kept] = found.shapes[:, columns]
        self.ratios[:, kept] = found.axis_ratio[:, columns]
        self.least[kept] = np.minimum(self.least[kept], matched)


def _swapped(old: Complex, new: Complex) -> bool:
    """Whether two modes have changed places, by a crossing or by a veering too narrow to see.

    Their eigenvalues must have come near on the way: with unlike damping modes do not mix.
    """
    before, after = (np.subtract.outer(values, values) for values in (old, new))
    change = after - before
    slack = _EQUAL * np.abs(old).max(initial=0.0)
    turned = (before.imag > slack) & (after.imag < 0)
    nearest = np.abs((before.conj() * change).imag)  # distance of the chord from zero, times change
    return bool((turned & (nearest < 0.1 * np.abs(change) ** 2)).any())


def _likeness(mass: Sparse, old: Complex, values: Complex, new: Complex) -> Vector:
    """MAC of old with new shapes; modes of one frequency are taken as the space they span."""
    weighted = mass @ new
    size = np.sum(new.conj() * weighted, axis=0).real
    result = np.empty((old.shape[1], new.shape[1]))
    for i in range(old.shape[1]):
        same = np.abs(values - values[i]) <= 1e-6 * np.abs(values[i])
        group = old[:, same]
        gram = group.conj().T @ (mass @ group)
        overlap = group.conj().T @ weighted
        result[i] = np.sum(overlap.conj() * linalg.solve(gram, overlap), axis=0).real / size
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class CriticalSpeeds:
    """Where a mode meets an order of the speed.

    Attributes
    ----------
    speeds : numpy.ndarray [shape=(n,)]
        Rising [rad/s].
    damping_ratio : numpy.ndarray [shape=(n,)]
        Of the mode there.
    direction : tuple of str
        Of its whirl. An unbalance on symmetric supports drives forward modes only.
    """

    speeds: Vector
    damping_ratio: Vector
    direction: tuple[str, ...]

    __repr__ = brief()


def critical_speeds(
    rotor: Rotor | RotorLaw,
    speeds: ArrayLike,
    *,
    count: int = 6,
    order: float = 1.0,
    most_damping: float = 1.0,
) -> CriticalSpeeds:
    """Speeds at which a damped natural frequency equals an order of the speed.

    Parameters
    ----------
    rotor : Rotor or callable
        As in :func:`campbell`.
    speeds : array_like
        Rising from zero [rad/s]: what meets the order below the first is not seen, nor what meets
        it twice between two of them.
    count : int
        Of modes followed.
    order : float
        Of the excitation, > 0: 1 for unbalance, the count of blades for a propeller.
    most_damping : float
        In (0, 1], as in :func:`campbell`.

    Returns
    -------
    CriticalSpeeds
        Within 1e-10 of the speed; by the chord of the step, where a mode changes so much across
        it that its shape cannot be found between: then give the speeds closer.

    Raises
    ------
    ValueError
        The order is not above zero, or as :func:`campbell`.

    Examples
    --------
    >>> from .beam import Disc, Section, assemble_beam
    >>> bar = Section(length=1.0, outer_diameter=0.01, young=2e11, shear_modulus=8e10,
    ...               density=7800.0)
    >>> beam = assemble_beam([bar], discs=[Disc(station=0.5, mass=100.0)], shear_coefficient=1.0)
    >>> ends = [Support(name=str(s), station=s, stiffness=1e12 * np.eye(2)) for s in (0.0, 1.0)]
    >>> found = critical_speeds(Rotor(beam=beam, supports=tuple(ends)), [0.0, 50.0], count=2)
    >>> round(math.sqrt(48 * bar.bending_stiffness / 100), 1), found.speeds.round(1)
    (6.9, array([6.9, 6.9]))
    """
    if not 0 < order < math.inf:
        raise ValueError(f"order = {order} must be > 0 and finite; unbalance has 1")
    law = rotor if callable(rotor) else lambda _: rotor
    table = campbell(law, speeds, count, most_damping=most_damping)
    excess = table.eigenvalues.imag - order * table.speeds[:, None]
    known = np.isfinite(excess) & (table.eigenvalues != 0)  # rigid motions meet every order at rest
    turns = known[:-1] & known[1:] & ((excess[:-1] < 0) != (excess[1:] < 0))
    places = zip(*np.nonzero(turns), strict=True)
    found = [
        _meet(law, table, int(step), int(mode), order, (1 + most_damping) / 2)
        for step, mode in places
    ]
    found.sort(key=lambda entry: entry[0])
    return CriticalSpeeds(
        speeds=np.array([entry[0] for entry in found]),
        damping_ratio=np.array([entry[1] for entry in found]),
        direction=tuple(entry[2] for entry in found),
    )


def _meet(
    law: RotorLaw, table: Campbell, step: int, mode: int, order: float, most_damping: float
) -> tuple[float, float, str]:
    """Speed, damping ratio and direction where a mode meets the order within a step."""
    ends = table.shapes[step : step + 2, :, mode].T
    last: dict[str, Any] = {}

    def excess(speed: float) -> float:
        rotor = law(speed)
        wanted = table.eigenvalues.shape[1] + _SPARE
        found = modes(rotor, speed, wanted, most_damping=most_damping)
        alone = np.array([1.0, 2.0]) * found.eigenvalues[0]  # each end by itself, no group
        at = int(_likeness(rotor.mass, ends, alone, found.shapes).sum(axis=0).argmax())
        last["damping"], last["direction"] = found.damping_ratio[at], found.direction[at]
        return float(found.eigenvalues[at].imag) - order * speed

    low, high = float(table.speeds[step]), float(table.speeds[step + 1])
    if excess(low) * excess(high) > 0:  # shapes too unlike to be told apart: the chord's root
        ends_of = (
            table.eigenvalues[step : step + 2, mode].imag - order * table.speeds[[step, step + 1]]
        )
        speed = low + (high - low) * float(ends_of[0] / (ends_of[0] - ends_of[1]))
    else:
        speed = float(brentq(excess, low, high, xtol=1e-10 * high, rtol=1e-12))
    excess(speed)
    return speed, float(last["damping"]), str(last["direction"])


# --- unbalance


def unbalance_response(
    rotor: Rotor | RotorLaw, speeds: ArrayLike, unbalances: Sequence[Unbalance]
) -> Complex:
    """Steady motion that unbalances keep up.

    Parameters
    ----------
    rotor : Rotor or callable
        As in :func:`campbell`.
    speeds : array_like [shape=(n_speeds,)]
        >= 0 [rad/s].
    unbalances : sequence of Unbalance
        Masses off the axis.

    Returns
    -------
    numpy.ndarray [shape=(n_speeds, n_dof)]
        Q of ``q = Re(Q exp(i Omega t))`` [m], [rad]: its angle is the phase ahead of the mark.

    Raises
    ------
    ValueError
        A speed is below zero, or an unbalance stands on no node or is not finite.

    Notes
    -----
    ``(K - Omega^2 M + i Omega (C + Omega G)) Q = F`` with ``F_y = U Omega^2 exp(i phase)`` and
    ``F_z = -i F_y``, a force that turns with the shaft.

    Examples
    --------
    >>> from .beam import Section, assemble_beam
    >>> bar = Section(length=1.0, outer_diameter=0.01, young=2e11, shear_modulus=8e10,
    ...               density=7800.0)
    >>> beam = assemble_beam([bar], stations=[0.5], shear_coefficient=1.0)
    >>> ends = [Support(name=str(s), station=s, stiffness=1e6 * np.eye(2)) for s in (0.0, 1.0)]
    >>> rotor = Rotor(beam=beam, supports=tuple(ends))
    >>> [q] = unbalance_response(rotor, [10.0], [Unbalance(station=0.5, moment=1e-3)])
    >>> bool(np.isclose(q[rotor.dof(0.5, "z")], -1j * q[rotor.dof(0.5, "y")]))  # a circle
    True
    """
    omega = np.atleast_1d(np.asarray(speeds, dtype=float))
    if not (np.isfinite(omega).all() and (omega >= 0).all()):
        raise ValueError("speeds must be >= 0 and finite; turn z round for the other sense")
    law = rotor if callable(rotor) else lambda _: rotor
    return np.array([_unbalanced(law(float(speed)), float(speed), unbalances) for speed in omega])


def _unbalanced(rotor: Rotor, speed: float, unbalances: Sequence[Unbalance]) -> Complex:
    force = np.zeros(rotor.n_dof, dtype=complex)
    for i, unbalance in enumerate(unbalances):
        if not (math.isfinite(unbalance.moment) and math.isfinite(unbalance.phase)):
            raise ValueError(
                f"unbalances[{i}] of moment = {unbalance.moment} kg m and phase = "
                f"{unbalance.phase} rad must be finite"
            )
        turning = unbalance.moment * speed**2 * np.exp(1j * unbalance.phase)
        force[rotor.dof(unbalance.station, "y")] += turning
        force[rotor.dof(unbalance.station, "z")] -= 1j * turning
    dynamic = rotor.stiffness - speed**2 * rotor.mass + 1j * speed * rotor.damping(speed)
    solved: Complex = splu(dynamic.tocsc()).solve(force)
    return solved


def orbit_axes(y: Complex, z: Complex) -> tuple[Vector, Vector]:
    """Semi-axes of the orbit of two harmonic motions ``Re(y exp(i w t))``, ``Re(z exp(i w t))``.

    Parameters
    ----------
    y, z : numpy.ndarray
        Complex amplitudes of one shape [m].

    Returns
    -------
    major : numpy.ndarray
        Major semi-axis [m].
    minor : numpy.ndarray
        Minor semi-axis [m]; negative where the orbit runs backward, from z to y.

    Examples
    --------
    >>> orbit_axes(np.array([2.0]), np.array([1.0j]))
    (array([2.]), array([-1.]))
    """
    forward, backward = np.abs(y + 1j * z) / 2, np.abs(y - 1j * z) / 2
    return forward + backward, forward - backward
