"""Derivatives of an equilibrium for small changes of the line."""

import numpy as np
from numpy.typing import NDArray

from ..beam.beam import Beam
from ..film.solve import FilmGeometry
from .laws import AT_REST, law_on, least_gap
from .line import bearing_nodes, condensed
from .on_oil_films import BeamFilm

Vector = NDArray[np.float64]

GRADIENT_STEP = 0.1
"""Step of :func:`coefficient_gradients`, over the least gap [-]: some nodes of a mesh fill or empty
within it."""


def journal_shifts(
    beam: Beam, found: BeamFilm, *, bores: Vector, forces: Vector, gives: Vector
) -> Vector:
    """Displacements of the journals in their bores for small changes of the line, to first order.

    Parameters
    ----------
    beam : Beam
        Beam of the equilibrium.
    found : BeamFilm
    bores : numpy.ndarray [shape=(p, n, 4)]
        Displacements of the bores, y, z [m] and y', z' [rad].
    forces : numpy.ndarray [shape=(p, n, 4)]
        Changes of the film forces with the journals fixed [N], [N m].
    gives : numpy.ndarray [shape=(p, n, 4)]
        Changes of the pedestals' displacement under the present forces [m], zero for the slopes.

    Returns
    -------
    numpy.ndarray [shape=(p, n, 4)]
        Displacements of the journals relative to the bores, y, z [m] and y', z' [rad].

    Notes
    -----
    The equilibrium of :func:`beam_film`, differentiated: with the films' stiffness ``S``, the
    beam's ``K`` and the pedestals' flexibility ``P``,
    ``(K + K P S + S) du = (1 + K P) dR - K (dq0 + dg)``.

    Examples
    --------
    A whole line that rises takes its journals along:

    >>> import math
    >>> from wearstate.film import JournalBearing
    >>> from wearstate.shaft import FilmBearing, Section, assemble_beam, beam_film
    >>> steel = Section(length=4.0, outer_diameter=0.3, young=206e9, shear_modulus=79e9,
    ...                 density=7850.0)
    >>> beam = assemble_beam([steel], stations=(1.0, 3.0), theory="euler-bernoulli")
    >>> bush = JournalBearing(diameter=0.3, length=0.3, clearance=0.2e-3, viscosity=0.05)
    >>> line = [FilmBearing(name=n, station=s, bearing=bush) for n, s in (("a", 1.0), ("b", 3.0))]
    >>> rise, none = np.zeros((1, 2, 4)), np.zeros((1, 2, 4))
    >>> rise[..., 0] = 1e-3
    >>> found = beam_film(beam, line, 2 * math.pi * 2)
    >>> shift = journal_shifts(beam, found, bores=rise, forces=none, gives=none)
    >>> bool(np.abs(shift).max() < 1e-12)
    True
    """
    count = 4 * len(found.bearings)
    stiffness = condensed(beam, bearing_nodes(beam, found.bearings))[0]
    flexibility: Vector = np.pad(1 / np.array(found.pedestals), ((0, 0), (0, 2))).ravel()
    films = np.zeros((count, count))
    for n, own in enumerate(found.stiffness):
        films[4 * n : 4 * n + 4, 4 * n : 4 * n + 4] = own
    share = np.eye(count) + stiffness * flexibility
    moved, pushed = (bores + gives).reshape(-1, count), forces.reshape(-1, count)
    right = pushed @ share.T - moved @ stiffness.T
    shifts = np.linalg.solve(stiffness + share @ films, right.T).T.reshape(bores.shape)
    return np.asarray(shifts, dtype=float)


def coefficient_gradients(found: BeamFilm, *, step: float = GRADIENT_STEP) -> tuple[Vector, Vector]:
    """Derivatives of the films' stiffness and damping for displacements of the journals.

    Parameters
    ----------
    found : BeamFilm
    step : float
        Step of the central differences, over the least gap of each film [-]. The coefficients of
        the rung *direct* jump by a per cent as nodes of its mesh fill and empty; with the default,
        over several of them, its gradients are within a tenth of those with 384 nodes round the
        bore.

    Returns
    -------
    stiffness, damping : numpy.ndarray [shape=(n, 4, 4, 4)]
        Derivatives by y, z [1/m], y', z' [1/rad] along the second axis; matrices as in
        :class:`BeamFilm`. Zero for what the rung neglects.

    Examples
    --------
    >>> import math
    >>> from wearstate.film import JournalBearing
    >>> from wearstate.shaft import FilmBearing, Section, assemble_beam, beam_film
    >>> steel = Section(length=4.0, outer_diameter=0.3, young=206e9, shear_modulus=79e9,
    ...                 density=7850.0)
    >>> beam = assemble_beam([steel], stations=(1.0, 3.0), theory="euler-bernoulli")
    >>> bush = JournalBearing(diameter=0.3, length=0.3, clearance=0.2e-3, viscosity=0.05)
    >>> line = [FilmBearing(name=n, station=s, bearing=bush) for n, s in (("a", 1.0), ("b", 3.0))]
    >>> stiffness, _ = coefficient_gradients(beam_film(beam, line, 2 * math.pi * 2))
    >>> bool(stiffness[0, 0, 0, 0] < 0)  # the journal rises from the bottom: the film gets softer
    True
    """
    pairs = [
        _own_gradients(found, n, geometry, step) for n, geometry in enumerate(found.geometries)
    ]
    stiffness, damping = (np.array(side) for side in zip(*pairs, strict=True))
    return stiffness, damping


def _own_gradients(
    found: BeamFilm, n: int, geometry: FilmGeometry, step: float
) -> tuple[Vector, Vector]:
    bearing = found.bearings[n]
    own = bearing.worn
    tilted = bool(np.any(found.stiffness[n, 2:]))
    law = law_on(found.rung, tilted, geometry)
    scale = -own.clearance / np.array([1.0, 1.0, own.length, own.length])
    place = np.concatenate([found.positions[n], found.slopes[n]]) / scale
    reach = step * least_gap(geometry, tilted, place)
    stiffness, damping = np.zeros((4, 4, 4)), np.zeros((4, 4, 4))
    units = own.force_unit(found.speed) * own.clearance / np.outer(scale, scale)
    for axis in range(4 if tilted else 2):
        ends = []
        for side in (-1, 1):
            there = place.copy()
            there[axis] += side * reach
            law.load(there, AT_REST)
            ends.append(law.coefficients(there))
        width = 2 * reach * scale[axis]
        stiffness[axis] = (ends[1].stiffness - ends[0].stiffness) * units / width
        damping[axis] = (ends[1].damping - ends[0].damping) * units / width / found.speed
    return stiffness, damping
