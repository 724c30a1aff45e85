"""A rotor reduced to free-free modes of its shaft, with unreduced films and housings.

With the residual flexibility at supports and forces, the error of a receptance falls with the
number of modes to the power -11, without it -3 (slender shaft, force at its end);
:meth:`ReducedRotor.measured_error` compares with the direct solution.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from scipy.sparse import csc_array

from ..beam.beam import Beam
from ..beam.rotor import Rotor
from .places import Complex, Index, Place, Vector, checked_frequencies, checked_speed, dofs
from .receptance import receptance

LINES_AT_ONCE = 1024
_RANK = 1e-10  # of the largest: residual shapes of smaller rank are redundant


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeBasis:
    """Basis of one plane for the motion of a free shaft, the same for both planes.

    Attributes
    ----------
    shapes : numpy.ndarray [shape=(2 n, r)]
        In the order y, slope_y of every node; modes first, then residual shapes; of unit modal
        mass and orthogonal to one another [kg^-1/2].
    frequency_hz : numpy.ndarray [shape=(r,)]
        Natural frequencies of the modes, then those that the residual shapes represent [Hz].
    n_modes : int
        Number of modes, including the two rigid ones.
    limit_hz : float
        Natural frequency of the first omitted mode [Hz], inf if there is none.
    """

    shapes: Vector
    frequency_hz: Vector
    n_modes: int
    limit_hz: float


def free_basis(
    beam: Beam,
    *,
    limit_hz: float,
    stations: Sequence[float] = (),
    slopes: bool = True,
) -> FreeBasis:
    """Free-free modes of a shaft, and its residual flexibility at stations.

    Independent of films, housings and speed: compute it once for a shaft.

    Parameters
    ----------
    beam : Beam
    limit_hz : float
        Highest natural frequency of the modes kept, in addition to the two rigid ones [Hz].
    stations : sequence of float
        Stations of forces on the shaft, in particular of its supports [m].
    slopes : bool
        Whether moments act there too, as from tilted films.

    Raises
    ------
    ValueError
        The limit is out of range.

    Notes
    -----
    The residual shape of a force is the static deflection by the omitted modes,
    ``sum phi_k phi_k^T b / w_k^2``. The static response is then exact for forces at these stations,
    and the remaining error of an omitted mode is its share of ``(w / w_k)^4 / w_k^2``.

    References
    ----------
    Craig, Kurdila (2006), Fundamentals of Structural Dynamics, 2nd ed., Wiley, chapter 17
    (residual-flexibility attachment modes).

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> shaft = Section(length=10.0, outer_diameter=0.2, young=2.1e11, shear_modulus=8e10,
    ...                 density=7850.0)
    >>> beam = assemble_beam([shaft], theory="euler-bernoulli", longest_element=0.5)
    >>> basis = free_basis(beam, limit_hz=30.0, stations=[0.0, 10.0], slopes=False)
    >>> [round(float(f), 2) for f in basis.frequency_hz[:4]], basis.shapes.shape[1]
    ([0.0, 0.0, 9.21, 25.38], 6)
    """
    if not 0 < limit_hz < math.inf:
        raise ValueError(f"limit_hz = {limit_hz} Hz must be > 0 and finite")
    plane = np.flatnonzero(np.arange(beam.n_dof) % 4 < 2)
    values, shapes = linalg.eigh(*(_plane(a, plane) for a in (beam.stiffness, beam.mass)))
    squared = np.maximum(values, 0.0)
    squared[:2] = 0.0  # rigid
    highest = (2 * math.pi * limit_hz) ** 2
    n_modes = max(2, int(np.searchsorted(squared, highest, side="right")))
    kept = shapes[:, :n_modes]
    frequency = np.sqrt(squared) / (2 * math.pi)
    nodes = np.array([beam.node(station) for station in stations], dtype=np.int64)
    rows = np.concatenate([2 * nodes, 2 * nodes + 1]) if slopes else 2 * nodes
    residual, stands_for = _residual_shapes(shapes[:, n_modes:], squared[n_modes:], rows)
    return FreeBasis(
        shapes=np.hstack([kept, residual]),
        frequency_hz=np.concatenate([frequency[:n_modes], np.sqrt(stands_for) / (2 * math.pi)]),
        n_modes=n_modes,
        limit_hz=float(frequency[n_modes]) if n_modes < frequency.size else math.inf,
    )


def _plane(matrix: csc_array, plane: Index) -> Vector:
    return np.asarray(matrix[plane][:, plane].toarray(), dtype=float)


def _residual_shapes(omitted: Vector, squared: Vector, rows: Index) -> tuple[Vector, Vector]:
    """Static deflections by omitted modes, orthonormal, and their squared frequencies [rad2/s2]."""
    amplitude = omitted[rows].T / squared[:, None]  # of every omitted mode, per unit force
    scale = np.linalg.norm(amplitude, axis=0)
    amplitude = amplitude[:, scale > 0] / scale[scale > 0]
    left, sizes, _ = np.linalg.svd(amplitude, full_matrices=False)
    span = left[:, sizes > _RANK * sizes.max(initial=0.0)]
    stands_for, turn = np.linalg.eigh(span.T @ (squared[:, None] * span))
    return omitted @ (span @ turn), np.maximum(stands_for, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedRotor:
    """A rotor at one speed, on a free basis of its shaft, with unreduced films and housings.

    Attributes
    ----------
    rotor : Rotor
        The unreduced rotor.
    speed : float
        Shaft speed [rad/s].
    limit_hz : float
        Natural frequency of the first free-free mode omitted [Hz]; responses are accurate up to
        about a third of it, see :meth:`measured_error`.
    poles : numpy.ndarray [shape=(2 m,)]
        Eigenvalues [rad/s], with negative real part for a decaying motion.
    shapes : numpy.ndarray [shape=(n_dof, 2 m)]
        Displacements of the rotor's coordinates.
    participation : numpy.ndarray [shape=(2 m, n_dof)]
        Participation of forces, so that the receptance is ``shapes (s - poles)^-1 participation``.
    """

    rotor: Rotor
    speed: float
    limit_hz: float
    poles: Complex
    shapes: Complex
    participation: Complex

    @property
    def stable(self) -> bool:
        """Whether every motion decays."""
        return bool(self.poles.real.max() < 0)

    def receptance(
        self, frequencies: ArrayLike, responses: Sequence[Place], forces: Sequence[Place]
    ) -> Complex:
        """Displacement over force [shape=(n_freq, n_resp, n_force)], as :func:`receptance`."""
        s = 2j * math.pi * checked_frequencies(frequencies)
        rows, columns = dofs(self.rotor, responses), dofs(self.rotor, forces)
        residues = self.shapes[rows].T[:, :, None] * self.participation[:, None, columns]
        residues = residues.reshape(self.poles.size, -1)
        values = np.empty((s.size, residues.shape[1]), dtype=np.complex128)
        for first in range(0, s.size, LINES_AT_ONCE):
            lines = slice(first, first + LINES_AT_ONCE)
            values[lines] = (1 / (s[lines, None] - self.poles)) @ residues
        return values.reshape(s.size, rows.size, columns.size)

    def measured_error(
        self,
        frequencies: ArrayLike,
        responses: Sequence[Place],
        forces: Sequence[Place],
    ) -> float:
        """Largest deviation from the direct receptance, over the largest entry at the line.

        All lines are solved directly, so use only a few.
        """
        own = self.receptance(frequencies, responses, forces)
        exact = receptance(self.rotor, frequencies, responses, forces, speed=self.speed)
        deviation = np.abs(own - exact).max(axis=(1, 2))
        return float((deviation / np.abs(exact).max(axis=(1, 2))).max())


def reduce_rotor(rotor: Rotor, basis: FreeBasis, *, speed: float = 0.0) -> ReducedRotor:
    """Project a rotor on the free basis of its shaft, and find its poles at a speed.

    Parameters
    ----------
    rotor : Rotor
        A rotor on the basis' beam, with any supports.
    basis : FreeBasis
    speed : float
        Shaft speed [rad/s].

    Raises
    ------
    ValueError
        The basis belongs to another beam, or the speed is not finite.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> from wearstate.sim.beam.rotor import Support
    >>> shaft = Section(length=10.0, outer_diameter=0.2, young=2.1e11, shear_modulus=8e10,
    ...                 density=7850.0)
    >>> beam = assemble_beam([shaft], theory="euler-bernoulli", longest_element=0.5)
    >>> ends = [Support(name=n, station=s, stiffness=1e7 * np.eye(2), damping=1e4 * np.eye(2))
    ...         for n, s in (("aft", 0.0), ("fore", 10.0))]
    >>> basis = free_basis(beam, limit_hz=100.0, stations=[0.0, 10.0])
    >>> reduced = reduce_rotor(Rotor(beam=beam, supports=ends), basis, speed=20.0)
    >>> reduced.measured_error([1.0, 5.0, 25.0], [("aft", "y")], [("fore", "y")]) < 1e-4
    True
    """
    turning = float(checked_speed(speed))
    transform = _transform(rotor, basis)
    m, k, c = (
        transform.T @ (a @ transform) for a in (rotor.mass, rotor.stiffness, rotor.damping(turning))
    )
    size = len(m)
    flexible = linalg.solve(m, np.hstack([k, c, np.eye(size)]), assume_a="pos")
    state = np.zeros((2 * size, 2 * size))
    state[:size, size:] = np.eye(size)
    state[size:] = -flexible[:, : 2 * size]
    poles, vectors = linalg.eig(state)
    inputs = np.zeros((2 * size, size))
    inputs[size:] = flexible[:, 2 * size :]
    return ReducedRotor(
        rotor=rotor,
        speed=turning,
        limit_hz=basis.limit_hz,
        poles=poles,
        shapes=transform @ vectors[:size],
        participation=linalg.solve(vectors, inputs) @ transform.T,
    )


def _transform(rotor: Rotor, basis: FreeBasis) -> Vector:
    """Transformation from both planes' shapes and the housings to the rotor's coordinates."""
    n_plane, r = basis.shapes.shape
    n_beam = rotor.beam.n_dof
    if 2 * n_plane != n_beam:
        raise ValueError(
            f"basis of {2 * n_plane} coordinates must match the rotor's beam, {n_beam}; "
            "rebuild it with free_basis"
        )
    n = rotor.mass.shape[0]
    transform = np.zeros((n, 2 * r + n - n_beam))
    forward = np.arange(n_beam) % 4 < 2
    transform[np.flatnonzero(forward), :r] = basis.shapes
    transform[np.flatnonzero(~forward), r : 2 * r] = basis.shapes
    transform[n_beam:, 2 * r :] = np.eye(n - n_beam)
    return transform
