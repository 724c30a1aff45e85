"""Properties of a film in equilibrium: stiffness and damping, friction, flow.

Stiffness and damping are ``K = -dF/dx`` and ``C = -dF/dx'``; with the tilt they are 4 x 4, in the
order X, Y, tilt_x, tilt_y.

============  ====================================================================================
coefficients  by
============  ====================================================================================
analytic      perturbation of the equations of the rung *direct*, the film's rim between the nodes:
              one factorisation
mesh          the same with the rim on the nodes: exact derivatives of the mesh's own force
displacement  central differences of any rung, eight forces (sixteen with the tilt)
============  ====================================================================================
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..film.direct import direct_tilted_force
from ..film.slopes import Coefficients, perturbation
from ..film.solve import direct_film, film_gap
from .equilibrium import Equilibrium
from .film_force import DISPLACEMENT, JOURNAL_MOTIONS, angles_around, displaced_film, turn_by

Vector = NDArray[np.float64]
_RATE = 1e-5  # step of a rate, of the surface speed's share of a gap


# --- stiffness and damping


def coefficients(
    found: Equilibrium, *, method: str = "analytic", tilt: bool = False
) -> Coefficients:
    """Stiffness and damping of the film about an equilibrium.

    Parameters
    ----------
    found : Equilibrium
        Result of :func:`equilibrium` or :func:`at_eccentricity`.
    method : str
        ``"analytic"`` or ``"mesh"`` (rung *direct* only), or ``"displacement"``.
    tilt : bool
        Whether to add the moments and the tilt.

    Returns
    -------
    Coefficients [shape=(2, 2) or (4, 4)]
        Forces and moments decrease by ``stiffness @ (X, Y, tilt_x, tilt_y)`` and by ``damping @``
        their rates by tau. Over the magnitude of the load they are ``k C / W`` and
        ``c C omega / W``.

    Raises
    ------
    ValueError
        There is no such method, or it does not support the rung.

    Notes
    -----
    *analytic* holds the film's rim at its position between the nodes, and *mesh* at the nodes
    (:mod:`.film.slopes`): the first is close to the film's own coefficients, the second gives the
    exact derivatives of the mesh's force, like *displacement* except for its truncation. With
    *guembel* all nodes are solved for, and count where the pressure is above zero. With *reynolds*
    P = 0 stays at the widest gap of the equilibrium.

    Damping is symmetric, except with *guembel*.

    Mesh error, over the largest coefficient of its kind, maximum for S from 0.05 to 1, L / D
    1/2 and 1, with and without two grooves: 0.7 % on 72 x 17 nodes, 0.16 % on 144 x 33 (*mesh*:
    5 % and 1.3 %). :func:`whirl` estimates it for a given bearing.

    Examples
    --------
    >>> from wearstate.sim.bearing.equilibrium import equilibrium
    >>> from wearstate.sim.film.solve import FilmGeometry
    >>> found = equilibrium(FilmGeometry(length_to_diameter=0.5), [0.5, 0.0])
    >>> own = coefficients(found, method="mesh")
    >>> displaced = coefficients(found, method="displacement")
    >>> bool(np.allclose(own.stiffness, displaced.stiffness, rtol=1e-6))
    True
    """
    if method not in _METHODS:
        raise ValueError(f"method = '{method}' must be one of {', '.join(_METHODS)}")
    if method != "displacement" and found.geometry.inlet_fill < 1:
        raise ValueError(
            f"method = '{method}' of inlet_fill = {found.geometry.inlet_fill} must be "
            "'displacement'; the front of a starved film moves with the journal"
        )
    if method != "displacement" and found.rung != "direct":
        raise ValueError(
            f"method = '{method}' of rung '{found.rung}' must be 'displacement'; only the rung "
            "'direct' has a perturbation of its equations"
        )
    own = _METHODS[method](found, tilt)
    turn = np.kron(np.eye(2 if tilt else 1), turn_by(found.mesh_angle))
    return Coefficients(turn @ own.stiffness @ turn.T, turn @ own.damping @ turn.T)


def _by_perturbation(resolved: bool, found: Equilibrium, tilt: bool) -> Coefficients:
    state = found.state
    work = direct_film(found.geometry, tilted=tilt or found.tilt != (0.0, 0.0))
    tilts = (state.tilt_x, state.tilt_y, 0.0, 0.0)
    direct_tilted_force(work, state.x, state.y, 0.0, 0.0, *tilts)
    own = perturbation(work, state, resolved=resolved)
    return own if tilt else Coefficients(own.stiffness[:2, :2], own.damping[:2, :2])


def _by_displacement(found: Equilibrium, tilt: bool) -> Coefficients:
    places = JOURNAL_MOTIONS if tilt else JOURNAL_MOTIONS[:2]
    rates = tuple(place._replace(name=place.rate) for place in places)
    state, room = found.state, found.film.min_thickness
    geometry, rung = found.geometry, found.rung
    return Coefficients(
        displaced_film(geometry, state, rung, places, DISPLACEMENT * room),
        displaced_film(geometry, state, rung, rates, _RATE),
    )


_METHODS: dict[str, Callable[[Equilibrium, bool], Coefficients]] = {
    "analytic": partial(_by_perturbation, True),
    "mesh": partial(_by_perturbation, False),
    "displacement": _by_displacement,
}


# --- friction, flow


def friction(found: Equilibrium) -> float:
    """Friction on the journal, in units of ``eta omega R^2 L / C``.

    Parameters
    ----------
    found : Equilibrium
        Result of :func:`equilibrium` or :func:`at_eccentricity`.

    Returns
    -------
    float
        Divided by the magnitude of the load it is the friction variable ``(R / C) f``.

    Notes
    -----
    Shear of the journal's surface, ``eta U / h + (h / 2) dp/dx`` over the whole circumference, so
    ``∬ (1/H + (H/2) dP/dtheta) dtheta dz``; where the film is ruptured the first part is kept, as
    if the streaks of oil filled the gap. The second part is integrated by parts, which is exact
    for the mesh: with the gap's wedge, ``-∬ (P/2) dH/dtheta``. The first part over the
    pressurised region alone would give 0.55 to 0.67 of this.

    Examples
    --------
    >>> from wearstate.sim.bearing.equilibrium import equilibrium, sommerfeld_number
    >>> from wearstate.sim.film.solve import FilmGeometry
    >>> found = equilibrium(
    ...     FilmGeometry(length_to_diameter=1.0, condition="reynolds"),
    ...     [sommerfeld_number(0.121), 0.0],
    ... )
    >>> round(friction(found) * math.pi * 0.121, 2)  # Raimondi and Boyd: 3.22
    3.22
    """
    gap, face = _gaps(found)
    n, k = gap.shape
    lengths = _trapezoid(k)
    shear = float(np.sum(lengths / gap)) * 2 * math.pi / n
    wedge = face - np.roll(face, 1, axis=0)
    drag: float = shear - 0.5 * float(np.sum(lengths * found.film.pressure * wedge))
    return drag


@dataclass(frozen=True, kw_only=True)
class Flow:
    """Oil flow through a bearing, in units of ``R C N L`` with N in revolutions per second.

    Attributes
    ----------
    through : float
        Along the circumference past the widest gap.
    side : float
        Out of both ends.
    """

    through: float
    side: float


def flow(found: Equilibrium) -> Flow:
    """Flow through the widest section and out of the ends.

    Parameters
    ----------
    found : Equilibrium
        Result of :func:`equilibrium` or :func:`at_eccentricity`.

    Returns
    -------
    Flow
        In units of ``R C N L``.

    Notes
    -----
    Along the circumference ``2 pi ∫ (H/2 - H^3/12 dP/dtheta) dz``, at the face behind the line of
    the widest gap if the film begins there, else the mean over both its faces; out of the ends
    ``-(pi/6) (R/L)^2 ∫ H^3 dP/dz dtheta`` with the slope of a parabola through three nodes.
    Without eccentricity the first is pi, and the second zero.

    Examples
    --------
    >>> from wearstate.sim.bearing.equilibrium import equilibrium, sommerfeld_number
    >>> from wearstate.sim.film.solve import FilmGeometry
    >>> found = equilibrium(
    ...     FilmGeometry(length_to_diameter=1.0, condition="reynolds"),
    ...     [sommerfeld_number(0.121), 0.0],
    ... )
    >>> oil = flow(found)  # Raimondi and Boyd: 4.33 and 0.680
    >>> round(oil.through, 2), round(oil.side / oil.through, 2)
    (4.33, 0.68)
    """
    gap, face = _gaps(found)
    n, k = gap.shape
    pressure = found.film.pressure
    step = 2 * math.pi / n
    rise = (np.roll(pressure, -1, axis=0) - pressure) / step
    section = 2 * math.pi * (face / 2 - face**3 * rise / 12) @ _trapezoid(k)
    line = int(np.argmax(gap[:, k // 2]))
    opens = not np.any(pressure[line] > 0)
    through = section[line] if opens else 0.5 * (section[line] + section[line - 1])
    factor = math.pi / 6 * 0.25 / found.geometry.length_to_diameter**2 * step
    return Flow(through=float(through), side=factor * _end_slopes(pressure, gap))


def _end_slopes(pressure: Vector, gap: Vector) -> float:
    """Sum of H^3 |dP/dz| over the nodes of both ends."""
    length_step = 1.0 / (pressure.shape[1] - 1)
    first = (4 * pressure[:, 1] - pressure[:, 2]) / (2 * length_step)
    last = (4 * pressure[:, -2] - pressure[:, -3]) / (2 * length_step)
    return float(gap[:, 0] ** 3 @ first + gap[:, -1] ** 3 @ last)


def _gaps(found: Equilibrium) -> tuple[Vector, Vector]:
    """H at the nodes and at the faces behind them (n_theta, n_z)."""
    state, geometry = found.state, found.geometry
    z = np.linspace(-0.5, 0.5, geometry.n_z)
    behind = angles_around(geometry.n_theta) + math.pi / geometry.n_theta
    face = 1 - np.outer(np.cos(behind), state.x + z * state.tilt_x)
    face -= np.outer(np.sin(behind), state.y + z * state.tilt_y)
    if geometry.bore is not None:
        face += 0.5 * (geometry.bore + np.roll(geometry.bore, -1))[:, None]
    return film_gap(geometry, state), face


def _trapezoid(count: int) -> Vector:
    weights = np.full(count, 1.0 / (count - 1))
    weights[[0, -1]] *= 0.5
    return weights
