"""Transfer functions of a shaft line, by direct solution.

Receptance is displacement over force, accelerance acceleration over force, both for
``exp(+i omega t)``: a spring's receptance is real and positive, a mass's accelerance too.
Frequencies are in Hz, the shaft's speed in rad/s as everywhere in the shaft line. The nodes between
the stations of interest are eliminated, leaving one dense solve for each frequency; the error
is at rounding level.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import splu

from ..beam.rotor import Rotor
from .places import Complex, Index, Place, Vector, checked_frequencies, checked_speed, dofs

_LINES = 256  # solved together: their data fit the cache
_ISOTROPY = 1e-9  # of the largest entry: rounding of an assembly
_MOST_GROWTH = 10.0  # of an elimination without pivoting; the lost digits are its square
_UNRESTRAINED = 1e-14  # reciprocal condition of the stiffness


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
        Frequencies of the forces [Hz].
    responses, forces : sequence of place
        Coordinates, or arguments of :meth:`Rotor.dof`.
    speed : float or array-like [shape=(n_freq,)]
        Shaft speed [rad/s]; one per frequency if they vary together, as in a run-up.

    Returns
    -------
    numpy.ndarray [shape=(n_freq, n_resp, n_force)]
        Complex, the responses of every force.

    Raises
    ------
    ValueError
        A frequency or the speed is not finite, a place is unknown, or a static force (0 Hz) acts
        on a shaft without restraint.

    Notes
    -----
    ``(K - w^2 M + i w (C + Omega G)) q = f``. Away from the supports both planes have the same
    matrices, so that u = y + i z and v = y - i z decouple: 2 x 2 blocks along the shaft, with
    ``+- w Omega g`` for the gyroscopic moments (g couples y with z). These are eliminated node by
    node between the stations of forces and responses; the remaining system is dense and includes
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
    hertz = checked_frequencies(frequencies)
    turning = np.broadcast_to(checked_speed(speed), hertz.shape)
    rows, columns = dofs(rotor, responses), dofs(rotor, forces)
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
        Frequencies of the forces [Hz].
    responses, forces : sequence of place
        Coordinates, or arguments of :meth:`Rotor.dof`.
    speed : float or array-like [shape=(n_freq,)]
        Shaft speed [rad/s].

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
    """Matrices of a rotor, sorted for the elimination.

    The last axis of a coefficient runs over its factors: 1, -w^2, i w, +- w Omega.
    """

    diagonal: Vector  # [shape=(n, 2, 2, 4)] of node k with itself, forward plane
    following: Vector  # [shape=(n - 1, 2, 2, 4)] of node k with node k + 1
    kept: Index  # nodes, ascending, the shaft's ends among them
    skeleton: Vector  # [shape=(m, m, 4)] of the coordinates kept, housings last
    responses: Index  # in the skeleton
    forces: Index

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of one line's receptance."""
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
    """Raise if the planes of a node without support differ or are coupled."""
    bound = _ISOTROPY * np.abs(blocks).max(initial=0.0)
    difference = np.abs(blocks[:, :2, :2] - blocks[:, 2:, 2:]).max(initial=0.0)
    coupled = np.abs(blocks[:, :2, 2:]).max(initial=0.0)
    if max(difference, coupled) > bound:
        raise ValueError(
            f"the {name} of the shaft differs between its planes, or couples them, by "
            f"{max(difference, coupled):g} (bound {bound:g}) away from every support; "
            "name a support there"
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
    except np.linalg.LinAlgError:  # singular on one of the lines: solve each separately
        return np.zeros((omega.size, *chain.shape), np.complex128), np.full(omega.size, math.inf)
    return np.asarray(found, dtype=np.complex128), growth


def _solve_pivoted(
    rotor: Rotor, rows: Index, columns: Index, hertz: float, speed: float
) -> Complex:
    """Receptance at one line, by a full factorisation with pivoting."""
    omega = 2 * math.pi * hertz
    dynamic = rotor.stiffness - omega**2 * rotor.mass + 1j * omega * rotor.damping(speed)
    unit = np.zeros((dynamic.shape[0], columns.size), dtype=np.complex128)
    unit[columns, np.arange(columns.size)] = 1
    try:
        return np.asarray(splu(csc_array(dynamic)).solve(unit)[rows], dtype=np.complex128)
    except RuntimeError:  # exactly singular
        return np.full((rows.size, columns.size), math.nan, dtype=np.complex128)


def _add_spans(dynamic: Complex, chain: _Chain, omega: Vector, speed: Vector) -> Vector:
    """Add the condensed spans to the coordinates kept; return the growth on each line."""
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
    """Factors of the coefficients [shape=(4, n_signs, n_lines)]; real without damping."""
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

    Returns, each [shape=(2, 2, n_signs, n_lines)], the additions to the left node, to the coupling
    of left (rows) and right (columns), and to the right node. Also, for each line, the largest
    left-hand stiffness over that of one element: if a part of the span resonates between clamped
    ends without damping, its pivot vanishes, and this ratio gives the lost digits.
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
    """Product of 2 x 2 matrices along the first two axes."""
    return a[:, :1] * b[:1] + a[:, 1:] * b[1:]


def _inverse(a: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """Inverse of symmetric 2 x 2 matrices along the first two axes."""
    inverse = np.empty_like(a)
    scale = 1 / (a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    inverse[0, 0] = a[1, 1] * scale
    inverse[1, 1] = a[0, 0] * scale
    inverse[0, 1] = -a[0, 1] * scale
    inverse[1, 0] = -a[1, 0] * scale
    return inverse


def _both_planes(span: NDArray[np.inexact]) -> Complex:
    """Transform from u, v to y, slope_y, z, slope_z [shape=(n_lines, 4, 4)]."""
    forward, backward = span[:, :, 0], span[:, :, -1]
    whole = np.zeros((span.shape[-1], 4, 4), dtype=np.complex128)
    same = np.moveaxis((forward + backward) / 2, -1, 0)
    whole[:, :2, :2] = whole[:, 2:, 2:] = same
    if span.shape[2] == 2:
        turned = np.moveaxis((forward - backward) * 0.5j, -1, 0)
        whole[:, :2, 2:], whole[:, 2:, :2] = turned, -turned
    return whole


def _check_finite(values: Complex, hertz: Vector) -> None:
    """Raise if a line has no solution."""
    lost = hertz[~np.isfinite(values).all(axis=(1, 2))]
    if lost.size:
        raise ValueError(
            f"frequency = {lost[0]:g} Hz must not be a natural frequency without damping; "
            "shift the lines or give damping"
        )


def _check_restrained(rotor: Rotor) -> None:
    """Raise if a static force meets no stiffness."""
    dense = rotor.stiffness.toarray()
    scale = np.sqrt(np.abs(dense.diagonal()))
    condition = np.linalg.cond(dense / scale / scale[:, None], 1) if scale.all() else math.inf
    if condition > 1 / _UNRESTRAINED:
        raise ValueError(
            "a frequency of 0 Hz must meet a shaft that its supports hold: "
            f"its stiffness is singular (condition {condition:.1g}); "
            "start above 0 Hz or add a support"
        )
