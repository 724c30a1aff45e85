"""A shaft line in steady running: its equilibrium on the films, and the rotor about it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from ..beam.beam import Beam
from ..beam.rotor import Rotor, Support
from ..bearing.operate import JournalBearing
from ..brief import brief
from ..film.solve import FilmGeometry, Groove
from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import ShaftBearing
from ..shaft_films.film_bearing import FilmBearing
from ..shaft_films.on_oil_films import BeamFilm, beam_film
from ..shaft_response.reduced import FreeBasis, ReducedRotor, free_basis, reduce_rotor
from .line_alignment import hull_deflection, hull_shape
from .line_beam import BeamParts, bare_beam, parts_of, running_beam
from .push import pushed_stations

_CORNER_NODES = 3  # factor: with 48 nodes a journal in an arc is 12 % of the clearance too high


@lru_cache(maxsize=32)
def _basis(parts: BeamParts, places: tuple[float, ...], limit_hz: float) -> FreeBasis:
    """Free basis of a beam, cached like the beam: independent of films, housings and speed."""
    forced = [*places, *(disc.station for disc in parts.discs), *parts.stations[-1:]]
    return free_basis(
        bare_beam(parts), limit_hz=limit_hz, stations=list(dict.fromkeys(forced)), slopes=True
    )


def film_bearings(
    scene: ShaftScene, moves: Mapping[str, float] | None = None
) -> tuple[FilmBearing, ...]:
    """Bearings with their oil films in the running state: hot, on the deflected hull.

    Parameters
    ----------
    scene : ShaftScene
    moves : mapping of str to float, optional
        Bearing -> upward displacement [m].

    Returns
    -------
    tuple of FilmBearing
        From aft.

    Raises
    ------
    ValueError
        A move names no bearing of the scene.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> aft = film_bearings(load_scene("propulsion-shaft"), {"stern_aft": -1e-4})[0]
    >>> aft.offset, aft.bearing.length
    (-0.0001, 0.6)
    """
    lifts = dict(moves or {})
    unknown = sorted(set(lifts) - {bearing.name for bearing in scene.bearings})
    if unknown:
        known = ", ".join(bearing.name for bearing in scene.bearings)
        raise ValueError(
            "\n".join(f"moves: '{name}' is no bearing; choose one of {known}" for name in unknown)
        )
    return tuple(_film_bearing(scene, bearing, lifts) for bearing in scene.bearings)


def _film_bearing(
    scene: ShaftScene, bearing: ShaftBearing, moves: Mapping[str, float]
) -> FilmBearing:
    running = scene.conditions.running
    height, slope = hull_shape(scene, bearing.station)
    hull = hull_deflection(scene, running)
    film = scene.film
    return FilmBearing(
        name=bearing.name,
        station=bearing.station,
        bearing=JournalBearing(
            diameter=bearing.diameter,
            length=bearing.length,
            clearance=bearing.diametral_clearance / 2,
            viscosity=scene.oil.warmed(bearing.film_warming),
            film=FilmGeometry(
                length_to_diameter=bearing.length / bearing.diameter,
                n_theta=film.n_theta * (_CORNER_NODES if _has_corners(bearing) else 1),
                n_z=film.n_z,
                condition=film.condition,
                grooves=_side_grooves(bearing.groove_width),
            ),
        ),
        offset=(
            bearing.offset
            - bearing.sag
            + running.rise_share * bearing.rise
            + hull * height
            + moves.get(bearing.name, 0.0)
        ),
        side_offset=bearing.side_offset,
        slope=(bearing.slope + hull * slope, bearing.side_slope),
        wear_down=bearing.wear_down,
        arc_clearance=bearing.arc_clearance if bearing.worn_shape == "arc" else None,
    )


def _has_corners(bearing: ShaftBearing) -> bool:
    """Whether the film's gap has a corner, at the ends of an arc or at grooves."""
    arc = bearing.worn_shape == "arc" and bearing.wear_down > 0
    return arc or bearing.groove_width > 0


def _side_grooves(width: float) -> tuple[Groove, ...]:
    """Two grooves over the whole length, a quarter turn from the bottom, without pressure."""
    if width == 0:
        return ()
    sides = (-math.pi / 2, math.pi / 2)
    return tuple(Groove(angle=angle, width=width) for angle in sides)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftState:
    """A shaft line in steady running: its equilibrium on the films, and the rotor about it.

    Attributes
    ----------
    beam : Beam
        Beam with all steady loads.
    film : BeamFilm
        Positions of the journals and loads of the films.
    rotor : Rotor
        The beam on the films' stiffness and damping, in housings on their pedestals.
    """

    beam: Beam
    film: BeamFilm
    rotor: Rotor

    __repr__ = brief()


def shaft_state(
    scene: ShaftScene,
    moves: Mapping[str, float] | None = None,
    *,
    raise_on_failure: bool = True,
) -> ShaftState:
    """Solve beam and films together in the running state, and build the rotor about it.

    Parameters
    ----------
    scene : ShaftScene
        A propulsion shaft or a shaft rig.
    moves : mapping of str to float, optional
        Bearing -> upward displacement [m].
    raise_on_failure : bool
        False: return the last state with its status instead.

    Returns
    -------
    ShaftState
        Beam, films and rotor.

    Raises
    ------
    ShaftFilmError
        No equilibrium was found; the message names the bearing and the cure.
    ValueError
        The scene is no shaft line, a move names no bearing of it, or as in :func:`shaft_beam`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> state = shaft_state(load_scene("propulsion-shaft"))
    >>> bool(abs(state.film.reactions[:, 0].sum() / state.beam.downward_load - 1) < 1e-6)
    True
    """
    if not isinstance(scene, ShaftScene):
        raise ValueError(
            f"scene = {getattr(scene, 'name', scene)!r} must be a shaft line; wearstate.load_scene "
            "reads one"
        )
    beam = running_beam(scene)
    housings = [bearing.housing for bearing in scene.bearings]
    film = beam_film(
        beam,
        film_bearings(scene, moves),
        speed=math.tau * scene.drive.speed,
        rung=scene.film.rung,
        pedestals=[(housing.stiffness_up, housing.stiffness_side) for housing in housings],
        raise_on_failure=raise_on_failure,
    )
    return ShaftState(beam=beam, film=film, rotor=_rotor(scene, beam, film))


def _rotor(scene: ShaftScene, beam: Beam, film: BeamFilm) -> Rotor:
    supports = tuple(
        Support(
            name=bearing.name,
            station=bearing.station,
            stiffness=stiffness,
            damping=damping,
            housing_mass=bearing.housing.mass,
            pedestal_stiffness=(bearing.housing.stiffness_up, bearing.housing.stiffness_side),
            pedestal_damping=(bearing.housing.damping_up, bearing.housing.damping_side),
        )
        for bearing, stiffness, damping in zip(
            scene.bearings, film.stiffness, film.damping, strict=True
        )
    )
    ratio = scene.shaft.damping_ratio
    return Rotor(
        beam=beam,
        supports=supports,
        damping_ratio=ratio,
        damping_band=scene.shaft.damping_band if ratio > 0 else None,
    )


def reduced_rotor(scene: ShaftScene, state: ShaftState) -> ReducedRotor:
    """Reduce the rotor of a state to free modes of its shaft up to half the sample rate.

    Parameters
    ----------
    scene : ShaftScene
    state : ShaftState
        Result of :func:`shaft_state`.

    Returns
    -------
    ReducedRotor

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("propulsion-shaft")
    >>> reduced_rotor(scene, shaft_state(scene)).stable
    True
    """
    stations = (*(bearing.station for bearing in scene.bearings), *pushed_stations(scene))
    basis = _basis(parts_of(scene), stations, scene.sample_rate / 2)
    return reduce_rotor(state.rotor, basis, speed=state.film.speed)
