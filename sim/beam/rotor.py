"""A rotating shaft on its supports, and its response to unbalance.

Coordinates are those of the beam, four per node, followed by y and z of every housing, in the
order of the supports. The shaft turns from y to z, which is forward.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import block_array, coo_array, csc_array
from scipy.sparse.linalg import splu

from ..brief import brief
from .beam import Beam
from .beam_matrices import Sparse

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

PARTS = ("shaft", "housing")
"""Parts that a coordinate can belong to."""

_SUPPORT_ORDER = ("y", "z", "slope_y", "slope_z")


@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """A bearing: stiffness and damping between the shaft and its housing or the ground.

    Attributes
    ----------
    name : str
    station : float
        Position of a node of the beam [m].
    stiffness : array_like [shape=(2, 2) or (4, 4)]
        In the order y, z, slope_y, slope_z [N/m], [N/rad], [N m/m], [N m/rad].
    damping : array_like, optional
        The same, units times a second, of the same shape; by default none.
    housing_mass : float, optional
        Mass [kg]. With it the housing has its own y and z and stands on the pedestal; moments go
        to the ground, since a housing does not turn. Without it, all goes to the ground.
    pedestal_stiffness, pedestal_damping : tuple of float
        Along y and z [N/m], [N s/m]; only with a housing.

    Raises
    ------
    ValueError
        Something is out of range; all faults together.

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
                f"in the order {', '.join(_SUPPORT_ORDER)}; numpy.diag makes one from two numbers"
            )
        if c.shape != k.shape:
            yield (
                f"support '{self.name}': damping of shape {c.shape} must be that of stiffness = "
                f"{k.shape}; fill with zeros"
            )
        for quantity, matrix in (("stiffness", k), ("damping", c)):
            if not np.isfinite(matrix).all():
                yield (
                    f"support '{self.name}': {quantity} must be finite; for a rigid support use a "
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
                "finite; leave it out for a bearing on the ground"
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
    """A mass off the axis that rotates with the shaft.

    Attributes
    ----------
    station : float
        Position of a node [m].
    moment : float
        Mass times distance from the axis [kg m].
    phase : float
        Phase ahead of the shaft's mark, which points along y at time zero [rad].
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
        Damping of the shaft's own material over critical, in [0, 1); it applies at both ends of the
        band, with less between and more outside.
    damping_band : tuple of float, optional
        Two frequencies [Hz], the lower may be zero; required with a damping ratio.

    Raises
    ------
    ValueError
        A support is at no node, names repeat, or the damping is unusable; all faults together.

    Notes
    -----
    The shaft's damping is ``alpha M + beta K`` of the beam alone, ``alpha = 2 zeta w1 w2 /
    (w1 + w2)``, ``beta = 2 zeta / (w1 + w2)``. It is stationary, as seen by an observer: rotating
    damping would excite the forward whirl above the first critical speed, so use
    lower speeds, or damping that is small compared with that of the supports.

    References
    ----------
    Friswell, Penny, Garvey, Lees (2010), Dynamics of Rotating Machines, Cambridge University
    Press, chapters 5 and 7.

    Examples
    --------
    >>> from wearstate.sim.beam.modes import modes
    >>> from wearstate.sim.beam.beam import assemble_beam
    >>> from wearstate.sim.beam.beam_parts import Section
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
            yield f"damping_band = {band} Hz must be 0 <= lower < upper, finite; exchange them"

    @property
    def n_dof(self) -> int:
        """Number of coordinates of the beam and the housings."""
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
            "y", "slope_y", "z" or "slope_z"; for a housing "y" or "z".
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
        """K [shape=(n_dof, n_dof)], scipy.sparse.csc_array; symmetric if the supports are."""
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
            Shaft speed, positive from y to z [rad/s].
        """
        if speed == 0:
            return self._damping_at_rest
        return self._damping_at_rest + speed * self.gyroscopic

    def _widened(self, matrix: Sparse) -> Sparse:
        """Extend a matrix by the housings."""
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
        """Coordinates connected by a support, and its matrix for them."""
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


RotorLaw = Callable[[float], Rotor]


def unbalance_response(
    rotor: Rotor | RotorLaw, speeds: ArrayLike, unbalances: Sequence[Unbalance]
) -> Complex:
    """Steady motion caused by unbalances.

    Parameters
    ----------
    rotor : Rotor or callable
        As in :func:`campbell`.
    speeds : array_like [shape=(n_speeds,)]
        Speeds >= 0 [rad/s].
    unbalances : sequence of Unbalance
        Masses off the axis.

    Returns
    -------
    numpy.ndarray [shape=(n_speeds, n_dof)]
        Q of ``q = Re(Q exp(i Omega t))`` [m], [rad]: its angle is the phase ahead of the mark.

    Raises
    ------
    ValueError
        A speed is below zero, or an unbalance is at no node or not finite.

    Notes
    -----
    ``(K - Omega^2 M + i Omega (C + Omega G)) Q = F`` with ``F_y = U Omega^2 exp(i phase)`` and
    ``F_z = -i F_y``, a force that rotates with the shaft.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import assemble_beam
    >>> from wearstate.sim.beam.beam_parts import Section
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
        raise ValueError("speeds must be >= 0 and finite; reverse z for the other direction")
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
        Minor semi-axis [m]; negative if the orbit runs backward, from z to y.

    Examples
    --------
    >>> orbit_axes(np.array([2.0]), np.array([1.0j]))
    (array([2.]), array([-1.]))
    """
    forward, backward = np.abs(y + 1j * z) / 2, np.abs(y - 1j * z) / 2
    return forward + backward, forward - backward
