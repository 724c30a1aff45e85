"""What a shaft line does about its equilibrium: transfer functions and time histories.

Receptance is displacement over force, mobility velocity over force, accelerance acceleration over
force, all for ``exp(+i omega t)``: a spring's receptance is real and positive, a mass's accelerance
too. Frequencies are in Hz, the shaft's speed in rad/s as everywhere in the shaft line.

========  =========================================  ==============================================
method    by                                         error
========  =========================================  ==============================================
modal     free-free modes of the shaft and residual  falls as the number of modes to the power -11,
          flexibility at supports and forces; films  without residual flexibility -3 (slender shaft,
          and housings as they are                   force at its end); measured on request
direct    elimination of the nodes between the       rounding
          stations of interest, then one dense
          solve for each frequency
========  =========================================  ==============================================

A place is a coordinate's number, or what :meth:`Rotor.dof` takes: ``("stern", "y")`` or
``("stern", "y", "housing")``. A displacement of a support that is a housing's is so told apart from
the shaft's there.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, linalg
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import splu

from ..beam.beam import Beam
from ..beam.rotor import Rotor

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]
Place = int | tuple[str | float, str] | tuple[str | float, str, str]

QUANTITIES = ("displacement", "velocity", "acceleration")
"""Of a response, in the order of their derivatives."""

_LINES = 256  # solved at once: what they need stays in the cache
_MODAL_LINES = 1024
_ISOTROPY = 1e-9  # of the largest entry: rounding of an assembly
_NOTHING = 1e-16  # of the largest at the start
_RANK = 1e-10  # of the largest: flatter residual shapes repeat others
_MOST_GROWTH = 10.0  # of an elimination without exchange of rows; it costs digits by its square
_UNRESTRAINED = 1e-14  # reciprocal condition of the stiffness


# --- transfer functions, direct


def receptance(
    rotor: Rotor,
    frequencies: ArrayLike,
    responses: Sequence[Place],
    forces: Sequence[Place],
    *,
    speed: ArrayLike = 0.0,
) -> Complex:
    """Displacement over force [m/N] (rad and N m for slopes and moments).

    Parameters
    ----------
    rotor : Rotor
        Shaft on its supports.
    frequencies : array-like [shape=(n_freq,)]
        Of the forces [Hz].
    responses, forces : sequence of place
        Coordinates, or what :meth:`Rotor.dof` takes.
    speed : float or array-like [shape=(n_freq,)]
        Of the shaft [rad/s]; one for each frequency where they go together, as in a run-up.

    Returns
    -------
    numpy.ndarray [shape=(n_freq, n_resp, n_force)]
        Complex, the responses of every force.

    Raises
    ------
    ValueError
        A frequency or the speed is not finite, a place is unknown, or a static force (0 Hz) acts
        on a shaft that nothing holds.

    Notes
    -----
    ``(K - w^2 M + i w (C + Omega G)) q = f``. Away from the supports both planes have the same
    matrices, so that u = y + i z and v = y - i z part: 2 x 2 blocks along the shaft, with
    ``+- w Omega g`` for the gyroscopic moments (g couples y with z). These are eliminated node by
    node between the stations where something acts or is asked for; what is left is dense and holds
    the films and housings.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> from wearstate.sim.beam.rotor import Support
    >>> shaft = Section(length=2.0, outer_diameter=0.1, young=2.1e11, shear_modulus=8e10,
    ...                 density=7850.0)
    >>> beam = assemble_beam([shaft], theory="euler-bernoulli", longest_element=0.1)
    >>> ends = [Support(name=n, station=s, stiffness=1e7 * np.eye(2))
    ...         for n, s in (("aft", 0.0), ("fore", 2.0))]
    >>> h = receptance(Rotor(beam=beam, supports=ends), [0.0, 10.0], [(1.0, "y")], [(1.0, "y")])
    >>> expected = 2.0**3 / (48 * shaft.bending_stiffness) + 1 / 2e7  # beam and springs
    >>> bool(abs(h[0, 0, 0] / expected - 1) < 1e-9)
    True
    """
    hertz = _checked_frequencies(frequencies)
    turning = np.broadcast_to(_checked_speed(speed), hertz.shape)
    rows, columns = _dofs(rotor, responses), _dofs(rotor, forces)
    chain = _chain(rotor, rows, columns)
    if (hertz == 0).any():
        _check_restrained(rotor)
    values = np.empty((hertz.size, rows.size, columns.size), dtype=np.complex128)
    growth = np.empty(hertz.size)
    for first in range(0, hertz.size, _LINES):
        lines = slice(first, first + _LINES)
        values[lines], growth[lines] = _solve(chain, 2 * math.pi * hertz[lines], turning[lines])
    for line in np.flatnonzero(~(growth < _MOST_GROWTH)):
        values[line] = _solve_pivoted(rotor, rows, columns, hertz[line], turning[line])
    _check_finite(values, hertz)
    return values


def accelerance(
    rotor: Rotor,
    frequencies: ArrayLike,
    responses: Sequence[Place],
    forces: Sequence[Place],
    *,
    speed: ArrayLike = 0.0,
) -> Complex:
    """Acceleration over force [m/(N s^2)]: :func:`receptance` times ``-w^2``.

    Parameters
    ----------
    rotor : Rotor
        Shaft on its supports.
    frequencies : array-like [shape=(n_freq,)]
        Of the forces [Hz].
    responses, forces : sequence of place
        Coordinates, or what :meth:`Rotor.dof` takes.
    speed : float or array-like [shape=(n_freq,)]
        Of the shaft [rad/s].

    Returns
    -------
    numpy.ndarray [shape=(n_freq, n_resp, n_force)]
        Complex, the responses of every force.

    Examples
    --------
    A free shaft, pushed in its middle far below its first frequency, is a mass:

    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> bar = Section(length=2.0, outer_diameter=0.1, young=2.1e11, shear_modulus=8e10,
    ...               density=7850.0)
    >>> beam = assemble_beam([bar], theory="euler-bernoulli", longest_element=0.1)
    >>> middle = [(1.0, "y")]
    >>> value = accelerance(Rotor(beam=beam, supports=()), [0.5], middle, middle)[0, 0, 0]
    >>> round(float(1 / value.real), 1), round(beam.weight / 9.80665, 1)
    (123.3, 123.3)
    """
    values = receptance(rotor, frequencies, responses, forces, speed=speed)
    omega = 2 * math.pi * np.asarray(frequencies, dtype=float)
    return values * ((1j * omega) ** 2)[:, None, None]


@dataclass(frozen=True, kw_only=True)
class _Chain:
    """A rotor's matrices, sorted for the elimination.

    The last axis of a coefficient runs over what multiplies it: 1, -w^2, i w, +- w Omega.
    """

    diagonal: Vector  # [shape=(n, 2, 2, 4)] of node k with itself, forward plane
    following: Vector  # [shape=(n - 1, 2, 2, 4)] of node k with node k + 1
    kept: Index  # nodes, ascending, the shaft's ends among them
    skeleton: Vector  # [shape=(m, m, 4)] of the coordinates kept, housings last
    responses: Index  # in the skeleton
    forces: Index

    @property
    def shape(self) -> tuple[int, int]:
        """Of a line's receptance."""
        return self.responses.size, self.forces.size


def _chain(rotor: Rotor, responses: Index, forces: Index) -> _Chain:
    stiffness, mass, damping = rotor.stiffness, rotor.mass, rotor.damping(0.0)
    gyroscopic = rotor.gyroscopic
    n_beam = 4 * rotor.beam.stations.size
    touched = np.concatenate([responses, forces])
    kept = np.unique(
        [
            0,
            n_beam // 4 - 1,
            *(touched[touched < n_beam] // 4),
            *(rotor.beam.node(support.station) for support in rotor.supports),
        ]
    )
    blocks = [_node_blocks(a, n_beam) for a in (stiffness, mass, damping)]
    turning = _node_blocks(gyroscopic, n_beam)
    for (at, after), name in zip(blocks, ("stiffness", "mass", "damping"), strict=True):
        _check_isotropic(np.delete(at, kept, axis=0), name)
        _check_isotropic(after, name)
    coordinates = np.concatenate(
        [(4 * kept[:, None] + np.arange(4)).ravel(), np.arange(n_beam, mass.shape[0])]
    )
    place = np.full(mass.shape[0], -1)
    place[coordinates] = np.arange(coordinates.size)
    four = (stiffness, mass, damping, gyroscopic)
    return _Chain(
        diagonal=np.stack([*(b[0][:, :2, :2] for b in blocks), turning[0][:, :2, 2:]], axis=-1),
        following=np.stack([*(b[1][:, :2, :2] for b in blocks), turning[1][:, :2, 2:]], axis=-1),
        kept=kept,
        skeleton=np.stack([a[coordinates][:, coordinates].toarray() for a in four], axis=-1),
        responses=place[responses],
        forces=place[forces],
    )


def _node_blocks(matrix: csc_array, n_beam: int) -> tuple[Vector, Vector]:
    """Blocks of a node with itself [shape=(n, 4, 4)] and with the next [shape=(n - 1, 4, 4)]."""
    blocks = bsr_array(matrix[:n_beam, :n_beam], blocksize=(4, 4))
    blocks.sum_duplicates()
    n = n_beam // 4
    row = np.repeat(np.arange(n), np.diff(blocks.indptr))
    after = np.zeros((n, 4, 4))
    at = np.zeros((n, 4, 4))
    at[row[blocks.indices == row]] = blocks.data[blocks.indices == row]
    after[row[blocks.indices == row + 1]] = blocks.data[blocks.indices == row + 1]
    return at, after[:-1]


def _check_isotropic(blocks: Vector, name: str) -> None:
    """Raise where the planes of a node without support differ or are coupled."""
    bound = _ISOTROPY * np.abs(blocks).max(initial=0.0)
    apart = np.abs(blocks[:, :2, :2] - blocks[:, 2:, 2:]).max(initial=0.0)
    coupled = np.abs(blocks[:, :2, 2:]).max(initial=0.0)
    if max(apart, coupled) > bound:
        raise ValueError(
            f"the {name} of the shaft differs between its planes, or couples them, by "
            f"{max(apart, coupled):g} (bound {bound:g}) away from every support; "
            "name a support where it does"
        )


def _solve(chain: _Chain, omega: Vector, speed: Vector) -> tuple[Complex, Vector]:
    """Receptance [shape=(n_lines, n_resp, n_force)], and the growth of the elimination."""
    factors = np.array([np.ones_like(omega), -(omega**2), 1j * omega, 1j * omega * speed])
    dynamic = np.tensordot(factors, chain.skeleton, axes=(0, 2))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a pivot of exactly zero
        growth = _add_spans(dynamic, chain, omega, speed)
    spoilt = ~np.isfinite(dynamic).all(axis=(1, 2))
    dynamic[spoilt] = np.eye(dynamic.shape[1])
    growth[spoilt] = math.inf
    unit = np.zeros((dynamic.shape[1], chain.forces.size), dtype=np.complex128)
    unit[chain.forces, np.arange(chain.forces.size)] = 1
    try:
        found = np.linalg.solve(dynamic, unit)[:, chain.responses]
    except np.linalg.LinAlgError:  # on one of the lines: each for itself
        return np.zeros((omega.size, *chain.shape), np.complex128), np.full(omega.size, math.inf)
    return np.asarray(found, dtype=np.complex128), growth


def _solve_pivoted(
    rotor: Rotor, rows: Index, columns: Index, hertz: float, speed: float
) -> Complex:
    """Receptance at one line, by a factorisation of the whole that exchanges rows."""
    omega = 2 * math.pi * hertz
    dynamic = rotor.stiffness - omega**2 * rotor.mass + 1j * omega * rotor.damping(speed)
    unit = np.zeros((dynamic.shape[0], columns.size), dtype=np.complex128)
    unit[columns, np.arange(columns.size)] = 1
    try:
        return np.asarray(splu(csc_array(dynamic)).solve(unit)[rows], dtype=np.complex128)
    except RuntimeError:  # exactly singular
        return np.full((rows.size, columns.size), math.nan, dtype=np.complex128)


def _add_spans(dynamic: Complex, chain: _Chain, omega: Vector, speed: Vector) -> Vector:
    """Add to the coordinates kept what the nodes between them do; the growth on each line."""
    signs = np.array([1.0, -1.0]) if speed.any() else np.array([1.0])
    factors = _span_factors(chain, omega, speed, signs)
    growth = np.zeros(omega.size)
    for k, (left, right) in enumerate(zip(chain.kept[:-1], chain.kept[1:], strict=True)):
        if right == left + 1:
            continue  # the skeleton holds this coupling
        at_left, across, at_right, most = _condense(chain, left, right, factors)
        np.maximum(growth, most, out=growth)
        a, b = slice(4 * k, 4 * k + 4), slice(4 * k + 4, 4 * k + 8)
        dynamic[:, a, a] += _both_planes(at_left)
        dynamic[:, b, b] += _both_planes(at_right)
        dynamic[:, a, b] += _both_planes(across)
        dynamic[:, b, a] += _both_planes(across.swapaxes(0, 1))
    return growth


def _span_factors(
    chain: _Chain, omega: Vector, speed: Vector, signs: Vector
) -> NDArray[np.inexact]:
    """What multiplies a coefficient [shape=(4, n_signs, n_lines)]; real without damping."""
    damped = chain.diagonal[..., 2].any() or chain.following[..., 2].any()
    factors = np.zeros((4, signs.size, omega.size), dtype=complex if damped else float)
    factors[0] = 1
    factors[1] = -(omega**2)
    if damped:
        factors[2] = 1j * omega
    factors[3] = signs[:, None] * omega * speed
    return factors


def _condense(
    chain: _Chain, left: int, right: int, factors: NDArray[np.inexact]
) -> tuple[NDArray[np.inexact], NDArray[np.inexact], NDArray[np.inexact], Vector]:
    """Eliminate the nodes between two, from left to right.

    Each [shape=(2, 2, n_signs, n_lines)]: what is added to the left node, to the coupling of left
    (rows) and right (columns), and to the right node. Then on each line the largest stiffness met
    at the left over that of one element: where a part of the span resonates between clamped ends
    without damping, its pivot vanishes, and as many digits go as this has.
    """
    at_left = np.zeros((2, 2, *factors.shape[1:]), dtype=factors.dtype)
    most = np.zeros(factors.shape[1:])
    across = np.tensordot(chain.following[left], factors, axes=1)
    here = np.tensordot(chain.diagonal[left + 1], factors, axes=1)
    for k in range(left + 1, right):
        after = np.tensordot(chain.following[k], factors, axes=1)
        flexibility = _inverse(here)
        carried = _product(across, flexibility)
        at_left -= _product(carried, across.swapaxes(0, 1))
        np.maximum(most, np.abs(at_left[0, 0]), out=most)
        across = -_product(carried, after)
        here = -_product(after.swapaxes(0, 1), _product(flexibility, after))
        if k + 1 < right:
            here += np.tensordot(chain.diagonal[k + 1], factors, axes=1)
    return at_left, across, here, most.max(axis=0) / abs(chain.following[left, 0, 0, 0])


def _product(a: NDArray[np.inexact], b: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """Of 2 x 2 matrices along the first two axes."""
    return a[:, :1] * b[:1] + a[:, 1:] * b[1:]


def _inverse(a: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """Of symmetric 2 x 2 matrices along the first two axes."""
    inverse = np.empty_like(a)
    scale = 1 / (a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    inverse[0, 0] = a[1, 1] * scale
    inverse[1, 1] = a[0, 0] * scale
    inverse[0, 1] = -a[0, 1] * scale
    inverse[1, 0] = -a[1, 0] * scale
    return inverse


def _both_planes(span: NDArray[np.inexact]) -> Complex:
    """From u, v to y, slope_y, z, slope_z [shape=(n_lines, 4, 4)]."""
    forward, backward = span[:, :, 0], span[:, :, -1]
    whole = np.zeros((span.shape[-1], 4, 4), dtype=np.complex128)
    same = np.moveaxis((forward + backward) / 2, -1, 0)
    whole[:, :2, :2] = whole[:, 2:, 2:] = same
    if span.shape[2] == 2:
        turned = np.moveaxis((forward - backward) * 0.5j, -1, 0)
        whole[:, :2, 2:], whole[:, 2:, :2] = turned, -turned
    return whole


# --- reduced to free-free modes


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeBasis:
    """Shapes of one plane that a free shaft's motion is made of, the same for both planes.

    Attributes
    ----------
    shapes : numpy.ndarray [shape=(2 n, r)]
        In the order y, slope_y of every node; modes first, then residual shapes; of unit modal
        mass and orthogonal to one another [kg^-1/2].
    frequency_hz : numpy.ndarray [shape=(r,)]
        Natural frequencies of the modes, then those that the residual shapes stand in for [Hz].
    n_modes : int
        How many are modes, the two rigid ones among them.
    limit_hz : float
        Natural frequency of the first mode left out [Hz], inf where none is.
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

    To be computed once for a shaft: films, housings and speed do not enter.

    Parameters
    ----------
    beam : Beam
    limit_hz : float
        Keep the modes up to here, the two rigid ones at least [Hz].
    stations : sequence of float
        Where forces act on the shaft, supports first of all [m].
    slopes : bool
        Moments act there too, as of tilted films.

    Raises
    ------
    ValueError
        The limit is out of range.

    Notes
    -----
    The residual shape of a force is the static deflection by the modes left out,
    ``sum phi_k phi_k^T b / w_k^2``. The static answer is then exact for forces at these stations,
    and what is left of a mode out is its share of ``(w / w_k)^4 / w_k^2``.

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
    """Static deflections by omitted modes, made orthonormal, and what they stand for [rad2/s2]."""
    amplitude = omitted[rows].T / squared[:, None]  # of every omitted mode, per unit force
    scale = np.linalg.norm(amplitude, axis=0)
    amplitude = amplitude[:, scale > 0] / scale[scale > 0]
    left, sizes, _ = np.linalg.svd(amplitude, full_matrices=False)
    span = left[:, sizes > _RANK * sizes.max(initial=0.0)]
    stands_for, turn = np.linalg.eigh(span.T @ (squared[:, None] * span))
    return omitted @ (span @ turn), np.maximum(stands_for, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedRotor:
    """A rotor at one speed, on a free basis of its shaft; films and housings as they are.

    Attributes
    ----------
    rotor : Rotor
        What was reduced.
    speed : float
        [rad/s]
    limit_hz : float
        Natural frequency of the first free-free mode left out [Hz]; responses are good up to a
        third of it or so, :meth:`measured_error` tells.
    poles : numpy.ndarray [shape=(2 m,)]
        Eigenvalues [rad/s], a negative real part for a motion that dies down.
    shapes : numpy.ndarray [shape=(n_dof, 2 m)]
        Displacements of the rotor's coordinates.
    participation : numpy.ndarray [shape=(2 m, n_dof)]
        Of forces in each, so that the receptance is ``shapes (s - poles)^-1 participation``.
    """

    rotor: Rotor
    speed: float
    limit_hz: float
    poles: Complex
    shapes: Complex
    participation: Complex

    @property
    def stable(self) -> bool:
        """Every motion dies down."""
        return bool(self.poles.real.max() < 0)

    def receptance(
        self, frequencies: ArrayLike, responses: Sequence[Place], forces: Sequence[Place]
    ) -> Complex:
        """Displacement over force [shape=(n_freq, n_resp, n_force)], as :func:`receptance`."""
        s = 2j * math.pi * _checked_frequencies(frequencies)
        rows, columns = _dofs(self.rotor, responses), _dofs(self.rotor, forces)
        residues = self.shapes[rows].T[:, :, None] * self.participation[:, None, columns]
        residues = residues.reshape(self.poles.size, -1)
        values = np.empty((s.size, residues.shape[1]), dtype=np.complex128)
        for first in range(0, s.size, _MODAL_LINES):
            lines = slice(first, first + _MODAL_LINES)
            values[lines] = (1 / (s[lines, None] - self.poles)) @ residues
        return values.reshape(s.size, rows.size, columns.size)

    def measured_error(
        self,
        frequencies: ArrayLike,
        responses: Sequence[Place],
        forces: Sequence[Place],
    ) -> float:
        """Largest deviation from the direct receptance, over the largest entry at the line.

        All lines given are solved directly, so that a few are enough.
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
        On the beam that the basis was made of; its supports may be any.
    basis : FreeBasis
    speed : float
        Of the shaft [rad/s].

    Raises
    ------
    ValueError
        The basis is of another beam, or the speed is not finite.

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
    turning = float(_checked_speed(speed))
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
    """From both planes' shapes and the housings to the rotor's coordinates."""
    n_plane, r = basis.shapes.shape
    n_beam = rotor.beam.n_dof
    if 2 * n_plane != n_beam:
        raise ValueError(
            f"basis of {2 * n_plane} coordinates must be of the rotor's own beam, {n_beam}; "
            "make it again with free_basis"
        )
    n = rotor.mass.shape[0]
    transform = np.zeros((n, 2 * r + n - n_beam))
    forward = np.arange(n_beam) % 4 < 2
    transform[np.flatnonzero(forward), :r] = basis.shapes
    transform[np.flatnonzero(~forward), r : 2 * r] = basis.shapes
    transform[n_beam:, 2 * r :] = np.eye(n - n_beam)
    return transform


# --- steady and transient forces


@dataclass(frozen=True, kw_only=True, eq=False)
class Harmonic:
    """Forces of one frequency, ``Re(amplitude exp(2 pi i frequency t))``.

    Attributes
    ----------
    frequency : float
        [Hz]; zero for a steady force.
    forces : mapping of place to complex
        Amplitudes [N], [N m]. A force that turns with the shaft has -i times along z what it has
        along y.
    """

    frequency: float
    forces: Mapping[Place, complex]


@dataclass(frozen=True, kw_only=True, eq=False)
class Broadband:
    """A Gaussian random force, the same at all its places; others are independent of it.

    Attributes
    ----------
    frequencies : array-like [shape=(m,)]
        Rising, [Hz].
    density : array-like [shape=(m,)]
        One-sided power spectral density at these, linear between them and zero outside
        [N^2/Hz].
    forces : mapping of place to float
        Share at each place.
    """

    frequencies: ArrayLike
    density: ArrayLike
    forces: Mapping[Place, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Transient:
    """A force by its samples, zero before the first: a hammer's blow, a shaker's sweep.

    Attributes
    ----------
    samples : array-like [shape=(n_samples,)]
        [N], at the sample rate of the response; band-limited between them.
    forces : mapping of place to float
        Share at each place.
    """

    samples: ArrayLike
    forces: Mapping[Place, float]


def harmonic_response(
    rotor: "Rotor | ReducedRotor",
    harmonics: Sequence[Harmonic],
    responses: Sequence[Place],
    *,
    speed: float | None = None,
) -> Complex:
    """Complex displacement of each place at each frequency [m].

    Parameters
    ----------
    rotor : Rotor or ReducedRotor
    harmonics : sequence of Harmonic
    responses : sequence of place
    speed : float, optional
        Of the shaft [rad/s]; by default 0, or that of the reduced rotor.

    Returns
    -------
    numpy.ndarray [shape=(n_harmonics, n_resp)]

    Raises
    ------
    ValueError
        As of :func:`receptance`; or a reduced rotor is asked at another speed than its own.
    """
    if not harmonics:
        return np.zeros((0, len(responses)), dtype=np.complex128)
    places, amplitude = _amplitudes([harmonic.forces for harmonic in harmonics])
    hertz = [harmonic.frequency for harmonic in harmonics]
    if isinstance(rotor, ReducedRotor):
        if speed is not None and speed != rotor.speed:
            raise ValueError(
                f"speed = {speed} rad/s must be the reduced rotor's, {rotor.speed}; reduce it again"
            )
        gain = rotor.receptance(hertz, responses, places)
    else:
        gain = receptance(rotor, hertz, responses, places, speed=speed or 0.0)
    return np.asarray(np.einsum("hrf,hf->hr", gain, amplitude), dtype=np.complex128)


def _amplitudes(forces: Sequence[Mapping[Place, complex]]) -> tuple[list[Place], Complex]:
    """All places, and amplitudes [shape=(n, n_places)]."""
    places = list(dict.fromkeys(place for one in forces for place in one))
    table = [[one.get(place, 0.0) for place in places] for one in forces]
    amplitude = np.array(table, dtype=np.complex128).reshape(len(forces), len(places))
    for k, j in np.argwhere(~np.isfinite(amplitude)):
        raise ValueError(f"force {k} at {places[j]!r} = {amplitude[k, j]} must be finite")
    return places, amplitude


def time_response(
    reduced: ReducedRotor,
    responses: Sequence[Place],
    *,
    n_samples: int,
    sample_rate: float,
    quantity: str | Sequence[str] = "acceleration",
    harmonics: Sequence[Harmonic] = (),
    broadband: Sequence[Broadband] = (),
    transients: Sequence[Transient] = (),
    seed: int = 0,
) -> Vector:
    """Motion about the equilibrium under forces of three kinds, added.

    Parameters
    ----------
    reduced : ReducedRotor
        Of :func:`reduce_rotor`.
    responses : sequence of place
    n_samples : int
        At least 2.
    sample_rate : float
        [Hz]
    quantity : str or sequence of str [shape=(n_resp,)]
        *displacement*, *velocity* or *acceleration*, one for all or one for each response.
    harmonics : sequence of Harmonic
        In their steady state: on since long before the first sample.
    broadband : sequence of Broadband
        In theirs too.
    transients : sequence of Transient
        From rest at the first sample on.
    seed : int
        Of the random forces.

    Returns
    -------
    numpy.ndarray [shape=(n_resp, n_samples)]
        [m], [m/s] or [m/s^2] (rad for slopes).

    Raises
    ------
    ValueError
        The rotor is unstable, a force lies above half the sample rate, or an argument is out of
        range.

    Notes
    -----
    Nothing is stepped: each line of the forces' spectra is multiplied by the reduced rotor's
    transfer function, so that a response is exact for forces that are band-limited. Random forces
    are drawn a quarter longer than the record, which is cut out and so is not periodic. A transient
    is first taken to repeat for ever; from that motion goes what each mode would do freely with
    the modal coordinate it has at the first sample, and what is left starts from rest. A transient
    that starts or ends with a jump rings at half the sample rate around it, as its band-limited
    self does.

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
    >>> turning = Harmonic(frequency=20 / (2 * np.pi), forces={(5.0, "y"): 10, (5.0, "z"): -10j})
    >>> time_response(reduced, [("aft", "y"), ("aft", "z")], n_samples=100, sample_rate=500.0,
    ...               quantity="displacement", harmonics=[turning]).shape
    (2, 100)
    """
    _check_record(reduced, n_samples, sample_rate, harmonics, broadband, transients)
    orders = _orders(quantity, len(responses))
    rows = _dofs(reduced.rotor, responses)
    total = np.zeros((len(responses), n_samples))
    if harmonics:
        total += _harmonic_part(reduced, rows, orders, n_samples, sample_rate, harmonics)
    if broadband:
        total += _broadband_part(reduced, rows, orders, n_samples, sample_rate, broadband, seed)
    if transients:
        total += _transient_part(reduced, rows, orders, n_samples, sample_rate, transients)
    return total


def _harmonic_part(
    reduced: ReducedRotor,
    rows: Index,
    orders: Index,
    n_samples: int,
    sample_rate: float,
    harmonics: Sequence[Harmonic],
) -> Vector:
    omega = 2 * math.pi * np.array([harmonic.frequency for harmonic in harmonics])
    phasors = harmonic_response(reduced, harmonics, [int(row) for row in rows])
    phasors = phasors * (1j * omega[:, None]) ** orders
    turns = _turns(omega / sample_rate, n_samples)
    return np.asarray(phasors.real.T @ turns.real - phasors.imag.T @ turns.imag, dtype=float)


def _turns(angle: Vector, n: int) -> Complex:
    """``exp(i angle k)`` for k below n [shape=(n_angles, n)], a product of few exponentials."""
    block = math.isqrt(n) + 1
    fine = np.exp(1j * np.outer(angle, np.arange(block)))
    coarse = np.exp(1j * np.outer(angle, block * np.arange(block)))
    product = coarse[:, :, None] * fine[:, None, :]
    return np.asarray(product.reshape(angle.size, -1)[:, :n], dtype=np.complex128)


def _broadband_part(
    reduced: ReducedRotor,
    rows: Index,
    orders: Index,
    n_samples: int,
    sample_rate: float,
    broadband: Sequence[Broadband],
    seed: int,
) -> Vector:
    n = fft.next_fast_len(n_samples + n_samples // 4, real=True)
    hertz = fft.rfftfreq(n, 1 / sample_rate)
    streams = np.random.SeedSequence(seed).spawn(len(broadband))
    spectra = np.array(
        [
            _random_spectrum(source, hertz, n, sample_rate, np.random.default_rng(stream))
            for source, stream in zip(broadband, streams, strict=True)
        ]
    )
    participation = _shared(reduced, [source.forces for source in broadband])
    found, _ = _through(reduced, hertz, n, spectra, participation, rows, orders)
    return np.asarray(fft.irfft(found, n)[:, :n_samples], dtype=float)


def _random_spectrum(
    source: Broadband, hertz: Vector, n: int, sample_rate: float, rng: np.random.Generator
) -> Complex:
    """Of a real Gaussian force [N], as rfft has it; the mean is left out."""
    at = np.asarray(source.frequencies, dtype=float)
    given = np.asarray(source.density, dtype=float)
    density = np.interp(hertz, at, given, left=0.0, right=0.0)
    density[0] = 0.0
    normal = rng.standard_normal((2, hertz.size))
    # E|X|^2 = n fs S / 2 for a one-sided density S
    spectrum = np.sqrt(n * sample_rate * density / 4) * (normal[0] + 1j * normal[1])
    if n % 2 == 0:
        spectrum[-1] = spectrum[-1].real * math.sqrt(2)
    return np.asarray(spectrum, dtype=np.complex128)


def _transient_part(
    reduced: ReducedRotor,
    rows: Index,
    orders: Index,
    n_samples: int,
    sample_rate: float,
    transients: Sequence[Transient],
) -> Vector:
    n = fft.next_fast_len(n_samples, real=True)
    samples = np.array([transient.samples for transient in transients], dtype=float)
    participation = _shared(reduced, [transient.forces for transient in transients])
    hertz = fft.rfftfreq(n, 1 / sample_rate)
    found, start = _through(reduced, hertz, n, fft.rfft(samples, n), participation, rows, orders)
    repeated = np.asarray(fft.irfft(found, n)[:, :n_samples], dtype=float)
    repeated -= _decay(reduced, start, n_samples, sample_rate, rows, orders)
    return repeated


def _decay(
    reduced: ReducedRotor,
    start: Complex,
    n_samples: int,
    sample_rate: float,
    rows: Index,
    orders: Index,
) -> Vector:
    """Free motion from modal coordinates `start` [shape=(n_resp, n_samples)]."""
    upper = reduced.poles.imag >= 0
    poles = reduced.poles[upper]
    once = np.where(poles.imag > 0, 2.0, 1.0)  # the conjugate pole is the other half
    now = once * start[upper] * poles ** orders[:, None] * reduced.shapes[np.ix_(rows, upper)]
    block = math.isqrt(n_samples) + 1
    within = np.exp(np.outer(poles, np.arange(block) / sample_rate))
    later = np.exp(poles * block / sample_rate)
    motion = np.zeros((rows.size, n_samples))
    least = _NOTHING * np.abs(now).max(axis=1, keepdims=True, initial=0.0)
    for first in range(0, n_samples, block):
        alive = (np.abs(now) > least).any(axis=0)
        piece = now[:, alive].real @ within[alive].real - now[:, alive].imag @ within[alive].imag
        motion[:, first : first + block] = piece[:, : n_samples - first]
        now = now * later
    return motion


def _shared(reduced: ReducedRotor, forces: Sequence[Mapping[Place, float]]) -> Complex:
    """Participation of each source [shape=(2 m, n_sources)]."""
    places, share = _amplitudes(forces)
    return reduced.participation[:, _dofs(reduced.rotor, places)] @ share.T


def _through(
    reduced: ReducedRotor,
    hertz: Vector,
    n: int,
    spectra: Complex,
    participation: Complex,
    rows: Index,
    orders: Index,
) -> tuple[Complex, Complex]:
    """Response to forces that repeat after n samples; lines without force cost nothing.

    Spectra of the responses [shape=(n_resp, n_lines)], and modal coordinates at the first sample
    [shape=(2 m,)].
    """
    s = 2j * math.pi * hertz
    found = np.zeros((rows.size, s.size), dtype=np.complex128)
    shapes = reduced.shapes[rows].T
    half = np.zeros(reduced.poles.size, dtype=np.complex128)  # from the lines above zero
    weight = np.ones(s.size)
    weight[0] = 0.5  # zero and half the sample rate stand for both sides
    if n % 2 == 0:
        weight[-1] = 0.5
    busy = np.flatnonzero(spectra.any(axis=0))
    for first in range(0, busy.size, _MODAL_LINES):
        lines = busy[first : first + _MODAL_LINES]
        states = spectra[:, lines].T @ participation.T
        states /= s[lines, None] - reduced.poles
        half += weight[lines] @ states
        found[:, lines] = ((states @ shapes) * s[lines, None] ** orders).T
    return found, (half + half[_partners(reduced.poles)].conj()) / n


def _partners(poles: Complex) -> Index:
    """Index of each one's conjugate; those of a real matrix come in pairs, the upper first."""
    return np.arange(poles.size) + np.sign(poles.imag).astype(np.int64)


# --- places and checks


def _dofs(rotor: Rotor, places: Sequence[Place]) -> Index:
    return np.array([_dof(rotor, place) for place in places], dtype=np.int64)


def _dof(rotor: Rotor, place: Place) -> int:
    if isinstance(place, tuple):
        return rotor.dof(*place)
    n = rotor.mass.shape[0]
    if not isinstance(place, (int, np.integer)) or not 0 <= place < n:
        raise ValueError(
            f"coordinate = {place!r} must be from 0 to {n - 1}, or a pair like ('stern', 'y')"
        )
    return int(place)


def _checked_frequencies(frequencies: ArrayLike) -> Vector:
    hertz = np.asarray(frequencies, dtype=float)
    if hertz.ndim != 1 or not np.isfinite(hertz).all():
        raise ValueError(
            f"frequencies of shape {hertz.shape} must be one row of finite numbers [Hz]"
        )
    return hertz


def _check_finite(values: Complex, hertz: Vector) -> None:
    """Raise where a line has no answer."""
    lost = hertz[~np.isfinite(values).all(axis=(1, 2))]
    if lost.size:
        raise ValueError(
            f"frequency = {lost[0]:g} Hz must not be a natural frequency without damping; "
            "shift the lines or give damping"
        )


def _checked_speed(speed: ArrayLike) -> Vector:
    turning = np.asarray(speed, dtype=float)
    if not np.isfinite(turning).all():
        raise ValueError(f"speed = {speed!r} rad/s must be finite")
    return turning


def _check_restrained(rotor: Rotor) -> None:
    """Raise where a static force meets no stiffness."""
    dense = rotor.stiffness.toarray()
    scale = np.sqrt(np.abs(dense.diagonal()))
    condition = np.linalg.cond(dense / scale / scale[:, None], 1) if scale.all() else math.inf
    if condition > 1 / _UNRESTRAINED:
        raise ValueError(
            "a frequency of 0 Hz must meet a shaft that its supports hold: "
            f"its stiffness is singular (condition {condition:.1g}); "
            "start above 0 Hz or add a support"
        )


def _orders(quantity: str | Sequence[str], n: int) -> Index:
    """How often to derive each displacement."""
    names = [quantity] * n if isinstance(quantity, str) else list(quantity)
    if len(names) != n or not set(names) <= set(QUANTITIES):
        raise ValueError(
            f"quantity = {quantity!r} must be one of {', '.join(QUANTITIES)}, "
            f"or {n} of them, one for each response"
        )
    return np.array([QUANTITIES.index(name) for name in names], dtype=np.int64)


def _check_record(
    reduced: ReducedRotor,
    n_samples: int,
    sample_rate: float,
    harmonics: Sequence[Harmonic],
    broadband: Sequence[Broadband],
    transients: Sequence[Transient],
) -> None:
    faults = [
        *_record_faults(reduced, n_samples, sample_rate),
        *_harmonic_faults(harmonics, sample_rate),
        *_broadband_faults(broadband, sample_rate),
        *_transient_faults(transients, n_samples),
    ]
    if faults:
        raise ValueError("\n".join(faults))


def _record_faults(reduced: ReducedRotor, n_samples: int, sample_rate: float) -> Iterator[str]:
    if n_samples < 2:
        yield f"n_samples = {n_samples} must be >= 2"
    if not 0 < sample_rate < math.inf:
        yield f"sample_rate = {sample_rate} Hz must be > 0 and finite"
    if not reduced.stable:
        worst = reduced.poles[np.argmax(reduced.poles.real)]
        yield (
            f"growth rate = {worst.real:.3g} 1/s of the motion at "
            f"{abs(worst.imag) / 2 / math.pi:.3g} Hz must be < 0: the shaft whirls in its films, "
            "or nothing holds it; change speed, load or film, or add a support"
        )


def _harmonic_faults(harmonics: Sequence[Harmonic], sample_rate: float) -> Iterator[str]:
    for k, harmonic in enumerate(harmonics):
        if not 0 <= harmonic.frequency < sample_rate / 2:
            yield (
                f"harmonics[{k}].frequency = {harmonic.frequency} Hz must be >= 0 and below "
                f"half the sample rate, {sample_rate / 2:g} Hz; raise the sample rate"
            )


def _broadband_faults(broadband: Sequence[Broadband], sample_rate: float) -> Iterator[str]:
    for k, source in enumerate(broadband):
        hertz = np.asarray(source.frequencies, dtype=float)
        density = np.asarray(source.density, dtype=float)
        if hertz.ndim != 1 or hertz.shape != density.shape or hertz.size < 2:
            yield (
                f"broadband[{k}]: frequencies of shape {hertz.shape} and density of shape "
                f"{density.shape} must be two rows of one length, at least 2"
            )
            continue
        if not (np.diff(hertz) > 0).all() or not 0 <= hertz[0] <= hertz[-1] <= sample_rate / 2:
            yield (
                f"broadband[{k}].frequencies = {hertz[0]:g} ... {hertz[-1]:g} Hz must rise within "
                f"0 ... {sample_rate / 2:g}, half the sample rate"
            )
        if not (np.isfinite(density).all() and (density >= 0).all()):
            yield f"broadband[{k}].density must be >= 0 and finite [N^2/Hz]"


def _transient_faults(transients: Sequence[Transient], n_samples: int) -> Iterator[str]:
    for k, transient in enumerate(transients):
        samples = np.asarray(transient.samples, dtype=float)
        if samples.shape != (n_samples,) or not np.isfinite(samples).all():
            yield (
                f"transients[{k}].samples of shape {samples.shape} must be {n_samples} finite "
                "numbers [N]; fill up with zeros"
            )
