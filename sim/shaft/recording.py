"""A propulsion shaft, from its scene to its beam, its bearings and its recording.

The state of rest is that of beam and oil films solved together; what the sensors see is the linear
response about it, in steady running. Axes are those of :mod:`wearstate.sim.shaft.on_oil_films`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ..alignment.alignment import AlignmentLine, Condition
from ..alignment.seats import Seat, seat_stations
from ..beam.beam import Beam, assemble_beam
from ..beam.beam_parts import Disc, PointLoad, Section
from ..beam.rotor import Rotor, Support
from ..bearing.operate import JournalBearing
from ..brief import brief
from ..excitation.forces import Push, read_cell
from ..film.solve import FilmGeometry, Groove
from ..output.recording import Recorder, Recording
from ..output.sensor import digitise
from ..output.status import SimulationError, Status
from ..output.track import track_under
from ..scene.exciters import pushing_faults
from ..scene.recorded import failed, recorded
from ..scene.sampling import duration_faults, memory_faults, tacho_faults
from ..scene.scene import Scene, SceneError
from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import (
    Coupling,
    ShaftAccelerometer,
    ShaftBearing,
    ShaftCondition,
    ShaftDisc,
    ShaftLoad,
    ShaftMaterial,
    ShaftProbe,
    Turbulence,
)
from .elements import element_faults
from .hull import engine_rate_faults, hull_forces, hull_orders
from .local_modes import heard_locally
from .on_oil_films import BeamFilm, FilmBearing, ShaftFilmStatus, beam_film
from .push import lead_samples, peak_push, pushed_motion, pushed_stations, pushes
from .response import (
    Broadband,
    FreeBasis,
    Harmonic,
    Place,
    ReducedRotor,
    free_basis,
    harmonic_response,
    reduce_rotor,
    time_response,
)

Float = NDArray[np.float64]
Numerics = dict[str, float | int | str]

_FEWEST_PER_TURN = 8
"""Samples a revolution: three orders below half the sample rate, and a margin."""

_BYTES_PER_SAMPLE = 200 * 8  # spectra of forces, states of a block, responses, channels

_MOVED_WARNING = 0.3
"""Peak motion over the least film at which the films' stiffness has changed by about its own size,
``(1 + 0.3)^3`` to one, and the linear response is a fair guess no more."""

_CORNERED = 3  # times the nodes: with 48 a journal in an arc lies 12 % of the clearance too high
_RESONANT = 0.1
"""Damping ratio below which a motion is called a resonance: amplified five times and more."""

_PEAK = 4.0  # of the rms of a Gaussian motion: passed once in 16,000 independent values
_DENSITY_LINES = 200  # of a turbulence's spectrum up to half the sample rate
_LIFTED = 0.05  # of the mean reaction: a bearing that carries less is told of
_THIN_EDGE = 0.2  # least film over that without tilt: below it the edge is what runs

_STATUS = {
    ShaftFilmStatus.OK: Status.OK,
    ShaftFilmStatus.OVERLOAD: Status.LINE_OVERLOAD,
    ShaftFilmStatus.EDGE_CONTACT: Status.LINE_EDGE,
    ShaftFilmStatus.NO_ROOM: Status.LINE_EDGE,
    ShaftFilmStatus.NO_CONVERGENCE: Status.LINE_BALANCE,
    ShaftFilmStatus.COARSE: Status.LINE_COARSE,
}
"""How the balance of shaft and films ended, in the words of a scene."""


# --- beam


def shaft_beam(scene: ShaftScene) -> Beam:
    """Beam of a scene with the loads that are always there: weight, loads, coupling.

    Parameters
    ----------
    scene : ShaftScene
        Of a propulsion shaft or a shaft rig.

    Returns
    -------
    Beam
        With a node at every bearing and its support points, at the discs and at the coupling.

    Raises
    ------
    ValueError
        Two of these stations are too near to each other.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(shaft_beam(load_scene("propulsion-shaft")).weight / 1e3, 1)
    101.1
    """
    return _loaded(_bare_beam(_bones(scene)), coupling_loads(scene.coupling))


def running_beam(scene: ShaftScene) -> Beam:
    """Beam of a scene in steady running: with its thrust as well.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> len(running_beam(load_scene("propulsion-shaft")).loads)
    2
    """
    share = scene.conditions.running.thrust_share
    return _loaded(shaft_beam(scene), thrust_loads(scene, share))


class _Bones(NamedTuple):
    """What a beam is made of; machines and records that share it share the beam."""

    sections: tuple[Section, ...]
    discs: tuple[Disc, ...]
    loads: tuple[PointLoad, ...]
    stations: tuple[float, ...]
    material: ShaftMaterial
    gravity: float


def _bones(scene: ShaftScene) -> _Bones:
    coupling = (scene.coupling.station,) if scene.coupling else ()
    return _Bones(
        sections=_sections(scene),
        discs=tuple(_disc(disc) for disc in scene.discs),
        loads=tuple(_load(load) for load in scene.loads),
        stations=(
            *seat_stations(_seat(bearing) for bearing in scene.bearings),
            *_own_stations(scene),
            *coupling,
        ),
        material=scene.shaft,
        gravity=scene.gravity,
    )


def _own_stations(scene: ShaftScene) -> tuple[float, ...]:
    """Stations where an exciter pushes and no part of the line is."""
    parts = {bearing.station for bearing in scene.bearings}
    parts |= {disc.station for disc in scene.discs}
    parts |= {scene.coupling.station} if scene.coupling else set()
    return tuple(station for station in pushed_stations(scene) if station not in parts)


def _sections(scene: ShaftScene) -> tuple[Section, ...]:
    material = scene.shaft
    return tuple(
        Section(
            length=section.length,
            outer_diameter=section.outer_diameter,
            inner_diameter=section.inner_diameter,
            young=material.young,
            shear_modulus=material.shear_modulus,
            density=material.density,
        )
        for section in scene.sections
    )


def _disc(part: ShaftDisc) -> Disc:
    """Without its unbalance, so that machines that differ in it alone share a beam."""
    return Disc(
        station=part.station,
        mass=part.mass,
        polar_inertia=part.polar_inertia,
        diametral_inertia=part.diametral_inertia,
        entrained_mass=part.entrained_mass,
        entrained_polar=part.entrained_polar,
        entrained_diametral=part.entrained_diametral,
        buoyancy=part.buoyancy,
    )


def _load(part: ShaftLoad) -> PointLoad:
    return PointLoad(
        station=part.station,
        up=part.up,
        side=part.side,
        moment_up=part.moment_up,
        moment_side=part.moment_side,
    )


@lru_cache(maxsize=32)
def _bare_beam(bones: _Bones) -> Beam:
    """Kept between the records of a data set, which differ in bearings and forces."""
    material = bones.material
    timoshenko = material.theory == "timoshenko"
    return assemble_beam(
        bones.sections,
        discs=bones.discs,
        loads=bones.loads,
        stations=bones.stations,
        longest_element=material.longest_element,
        theory=material.theory,
        shear_coefficient=material.shear_coefficient if timoshenko else None,
        gravity=bones.gravity,
    )


@lru_cache(maxsize=32)
def _basis(bones: _Bones, places: tuple[float, ...], limit_hz: float) -> FreeBasis:
    """Kept as the beam is: its own modes do not know films, housings or speed."""
    forced = [*places, *(disc.station for disc in bones.discs), *bones.stations[-1:]]
    return free_basis(
        _bare_beam(bones), limit_hz=limit_hz, stations=list(dict.fromkeys(forced)), slopes=True
    )


def _loaded(beam: Beam, loads: Sequence[PointLoad]) -> Beam:
    """The same beam with further steady loads at its nodes."""
    steady = beam.load.copy()
    for load in loads:
        first = beam.dof(load.station, "y")
        steady[first : first + 4] += (load.up, load.moment_up, load.side, load.moment_side)
    return replace(beam, load=steady, loads=(*beam.loads, *loads))


def thrust_loads(scene: ShaftScene, share: float = 1.0) -> tuple[PointLoad, ...]:
    """Moment of the propeller's thrust, whose line of action is off the shaft's axis.

    Parameters
    ----------
    scene : ShaftScene
    share : float
        Of the thrust.

    Returns
    -------
    tuple of PointLoad
        One at the propeller; none without a propeller.

    Notes
    -----
    A force T along x at the height e turns the slope dy/dx by the moment ``-T e``: above the axis
    it lifts the propeller.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(thrust_loads(load_scene("propulsion-shaft"))[0].moment_up)
    -12600
    """
    part = scene.propeller
    if part is None or share == 0:
        return ()
    return (
        PointLoad(
            station=_disc_of(scene, part.disc).station,
            moment_up=-share * part.thrust * part.thrust_height,
            moment_side=-share * part.thrust * part.thrust_side,
        ),
    )


def _disc_of(scene: ShaftScene, name: str) -> ShaftDisc:
    return next(disc for disc in scene.discs if disc.name == name)


# --- alignment


def alignment_line(scene: ShaftScene) -> AlignmentLine:
    """The line as an alignment calculation sees it: the beam on elastic, unilateral seats.

    Parameters
    ----------
    scene : ShaftScene
        Of a propulsion shaft or a shaft rig.

    Returns
    -------
    AlignmentLine
        Offsets as aligned, less sag and wear-down; no thermal rise, no hull deflection: these are
        of a condition.

    Raises
    ------
    ValueError
        As :func:`shaft_beam`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> line = alignment_line(load_scene("propulsion-shaft", {"bearings.2.sag": "1 mm"}))
    >>> line.seats[2].name, line.seats[2].offset
    ('intermediate_aft', -0.001)
    """
    return AlignmentLine(
        beam=shaft_beam(scene), seats=tuple(_seat(bearing) for bearing in scene.bearings)
    )


def _seat(bearing: ShaftBearing) -> Seat:
    limits = bearing.limits
    return Seat(
        name=bearing.name,
        station=bearing.station,
        offset=bearing.offset - bearing.sag - bearing.wear_down,
        slope=bearing.slope,
        stiffness=bearing.housing.stiffness_up,
        length=bearing.length,
        diameter=bearing.diameter,
        points=bearing.points,
        least_load=limits.least_load,
        most_pressure=math.inf if limits.most_pressure is None else limits.most_pressure,
        most_slope=math.inf if limits.most_slope is None else limits.most_slope,
        least_move=limits.least_move,
        most_move=limits.most_move,
    )


def alignment_conditions(scene: ShaftScene) -> dict[str, Condition]:
    """The states in which the alignment must be within its limits.

    Parameters
    ----------
    scene : ShaftScene
        Of a propulsion shaft or a shaft rig.

    Returns
    -------
    dict of str to Condition
        ``cold``, ``hot`` and ``running``.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = alignment_conditions(load_scene("propulsion-shaft"))
    >>> list(found), round(1e3 * found["hot"].rises[-1], 3)
    (['cold', 'hot', 'running'], 0.2)
    """
    return {
        name: _condition(scene, name, getattr(scene.conditions, name))
        for name in type(scene.conditions).model_fields
    }


def _condition(scene: ShaftScene, name: str, part: ShaftCondition) -> Condition:
    hull = _hull_deflection(scene, part)
    rises = tuple(
        part.rise_share * bearing.rise
        + part.lift_share * bearing.lift
        + hull * hull_shape(scene, bearing.station)[0]
        for bearing in scene.bearings
    )
    return Condition(
        name=name,
        rises=rises,
        slopes=tuple(hull * hull_shape(scene, b.station)[1] for b in scene.bearings),
        loads=thrust_loads(scene, part.thrust_share),
    )


def _hull_deflection(scene: ShaftScene, part: ShaftCondition) -> float:
    return scene.hull.deflection if part.hull_deflection is None else part.hull_deflection


def hull_shape(scene: ShaftScene, station: float) -> tuple[float, float]:
    """Height and slope of the hull where its middle has risen by one.

    Parameters
    ----------
    scene : ShaftScene
    station : float
        [m]

    Returns
    -------
    height : float
        Over that of the middle: a parabola, zero at the first and at the last bearing [-].
    slope : float
        Over the height of the middle [1/m].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> height, slope = hull_shape(load_scene("propulsion-shaft"), (1.25 + 15.6) / 2)
    >>> round(height, 9), abs(slope) < 1e-9
    (1.0, True)
    """
    first, last = scene.bearings[0].station, scene.bearings[-1].station
    share = (station - first) / (last - first)
    return 4 * share * (1 - share), 4 * (1 - 2 * share) / (last - first)


# --- bearings


def film_bearings(
    scene: ShaftScene, moves: Mapping[str, float] | None = None
) -> tuple[FilmBearing, ...]:
    """Bearings with their oil films, in the running state: hot, on the hull as it is.

    Parameters
    ----------
    scene : ShaftScene
    moves : mapping of str to float, optional
        Bearing -> by how much it is moved up [m].

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
    hull = _hull_deflection(scene, running)
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
                n_theta=film.n_theta * (_CORNERED if _has_corners(bearing) else 1),
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
    """Two through the whole length, a quarter of a turn from the bottom, without pressure."""
    if width == 0:
        return ()
    sides = (-math.pi / 2, math.pi / 2)
    return tuple(Groove(angle=angle, width=width) for angle in sides)


# --- coupling


def coupling_loads(coupling: Coupling | None) -> tuple[PointLoad, ...]:
    """What a misaligned coupling does to the shaft at rest.

    Parameters
    ----------
    coupling : Coupling or None

    Returns
    -------
    tuple of PointLoad
        One, at the coupling; none without.

    Notes
    -----
    A flexible ring pulls the shaft towards the axis of the other half with the force ``k delta``
    and turns it towards its direction with the moment ``k_b alpha``; the torque T that bends round
    the angle leaves ``T alpha / 2`` across it. The shaft's own displacement, hundredths of a
    millimetre, is left out beside the offset, and with it the ring's stiffness in the line: it is
    a hundredth of that of a bearing.

    References
    ----------
    Gibbons (1976), Coupling misalignment forces, Proceedings of the 5th Turbomachinery Symposium,
    Texas A&M University, 111-116.

    Examples
    --------
    >>> part = Coupling(station=1.0, stiffness=1e6, ring_radius=0.1, parallel_offset=1e-3)
    >>> coupling_loads(part)[0].up
    1000.0
    """
    if coupling is None:
        return ()
    force = coupling.stiffness * coupling.parallel_offset
    return (
        PointLoad(
            station=coupling.station,
            up=force * math.cos(coupling.offset_angle),
            side=force * math.sin(coupling.offset_angle),
            moment_up=coupling.bending_stiffness * coupling.angle,
            moment_side=-coupling.torque * coupling.angle / 2,
        ),
    )


# --- state of rest


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftState:
    """A line in steady running: at rest on its films, and ready to vibrate about that.

    Attributes
    ----------
    beam : Beam
        With all steady loads.
    film : BeamFilm
        Where the journals are, and what the films carry.
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
    """Beam and films solved together in the running state, and the rotor about it.

    Parameters
    ----------
    scene : ShaftScene
        Of a propulsion shaft or a shaft rig.
    moves : mapping of str to float, optional
        Bearing -> by how much it is moved up [m].
    raise_on_failure : bool
        False returns the last state with its status instead.

    Returns
    -------
    ShaftState
        Beam, films and rotor.

    Raises
    ------
    ShaftFilmError
        No balance was found; names the bearing and the cure.
    ValueError
        The scene is no shaft line, a move names no bearing of it, or as :func:`shaft_beam`.

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


# --- forces


class OrderForce(NamedTuple):
    """A force or moment that repeats with the shaft: ``Re(amplitude exp(j order angle))``."""

    order: int
    place: tuple[float, str]
    amplitude: complex


def harmonic_forces(scene: ShaftScene) -> tuple[Harmonic, ...]:
    """Unbalance, blade rate, coupling and hull of a scene, as seen from its first sample.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of Harmonic
        One for every order of the speed, rising; then those of
        :func:`~wearstate.sim.shaft.hull.hull_forces`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> forces = harmonic_forces(load_scene("propulsion-shaft"))
    >>> [round(force.frequency, 6) for force in forces]
    [5.0, 10.0, 20.0, 40.0]
    >>> round(abs(forces[0].forces[0.35, "y"]))  # unbalance of the propeller: 0.34 kg m at 300 rpm
    336
    """
    orders: dict[int, dict[Place, complex]] = {}
    for order, place, amplitude in _order_forces(scene):
        turned = amplitude * np.exp(1j * order * scene.drive.start_angle)
        at = orders.setdefault(order, {})
        at[place] = at.get(place, 0.0) + complex(turned)
    of_the_shaft = tuple(
        Harmonic(frequency=order * scene.drive.speed, forces=orders[order])
        for order in sorted(orders)
    )
    return of_the_shaft + hull_forces(scene)


def _order_forces(scene: ShaftScene) -> list[OrderForce]:
    forces = _unbalances(scene)
    if scene.propeller is not None:
        forces += _blade_rates(scene)
    if scene.coupling is not None:
        forces += coupling_forces(scene.coupling)
    return [force for force in forces if force.amplitude != 0]


def _forward(
    order: int, station: float, amplitude: complex, coordinates: tuple[str, str] = ("y", "z")
) -> list[OrderForce]:
    """A vector that turns with the shaft: ``A (cos, sin)(order angle + phase)``."""
    return [
        OrderForce(order, (station, coordinate), amplitude * turn)
        for coordinate, turn in zip(coordinates, (1.0, -1j), strict=True)
    ]


def _unbalances(scene: ShaftScene) -> list[OrderForce]:
    square = (math.tau * scene.drive.speed) ** 2
    return [
        force
        for disc in scene.discs
        for force in _forward(
            1, disc.station, disc.unbalance * square * np.exp(1j * disc.unbalance_angle)
        )
    ]


def _blade_rates(scene: ShaftScene) -> list[OrderForce]:
    part = scene.propeller
    assert part is not None
    station = _disc_of(scene, part.disc).station
    forces = []
    for rate in part.blade_rate:
        up, side = (part.thrust * np.exp(1j * p) for p in (rate.up_phase, rate.side_phase))
        amplitudes = {
            "y": rate.up * up,
            "z": rate.side * side,
            "slope_y": rate.moment_up * part.diameter * up,
            "slope_z": rate.moment_side * part.diameter * side,
        }
        forces += [
            OrderForce(rate.harmonic * part.blades, (station, coordinate), complex(amplitude))
            for coordinate, amplitude in amplitudes.items()
        ]
    return forces


def coupling_forces(coupling: Coupling) -> list[OrderForce]:
    """What a coupling with unlike elements does at once and twice the speed.

    Parameters
    ----------
    coupling : Coupling

    Returns
    -------
    list of OrderForce

    Notes
    -----
    The elements stand on a ring at the angle ``psi = phi + theta``; their stiffness along it is
    ``1 + a cos phi + b cos 2 phi`` over its mean, phi from the stiffest, theta the shaft's angle.
    An offset delta, at rest in space, moves the element at psi by ``delta . t`` along the ring,
    ``t = (-sin psi, cos psi)``. The mean over the ring of ``2 k (1 + b cos 2 phi) (delta . t) t``
    is the steady pull ``k delta`` and a force of ``k b delta / 2`` at twice the speed; an angle
    does the same with its moments, of the other sign, as it moves the elements along the shaft. The
    torque T winds up all elements alike, so that the stiffer side carries more of it and a force
    of ``a T / 2 r`` turns with the shaft. An offset adds nothing at the speed itself: what stands
    there besides unbalance is the torque's.

    Derived here. Measurements of misaligned couplings show mostly twice the speed, as here;
    Sekhar, Prabhu (1995), Effects of coupling misalignment on vibrations of rotating machinery,
    Journal of Sound and Vibration 185(4), 655-671, doi:10.1006/jsvi.1995.0407, take both.

    Examples
    --------
    >>> part = Coupling(
    ...     station=1.0, stiffness=1e6, ring_radius=0.1, parallel_offset=1e-3, uneven_twice=0.2
    ... )
    >>> [(f.order, f.place[1], round(float(abs(f.amplitude)))) for f in coupling_forces(part)[2:4]]
    [(2, 'y', 100), (2, 'z', 100)]
    """
    station = coupling.station
    turned = np.exp(1j * coupling.uneven_phase)
    torque = coupling.torque * coupling.uneven_once / (2 * coupling.ring_radius)
    pull = coupling.stiffness * coupling.parallel_offset * coupling.uneven_twice / 2
    bend = coupling.bending_stiffness * coupling.angle * coupling.uneven_twice / 2
    return [
        *_forward(1, station, 1j * torque * turned),
        *_forward(2, station, -pull * turned**2 * np.exp(-1j * coupling.offset_angle)),
        *_forward(2, station, bend * turned**2, ("slope_y", "slope_z")),
    ]


def random_forces(scene: ShaftScene) -> tuple[Broadband, ...]:
    """Turbulence of a scene: two independent forces, up and to the side, of every entry.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of Broadband
        With densities up to half the sample rate.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> len(random_forces(load_scene("propulsion-shaft")))
    12
    """
    return tuple(
        Broadband(
            frequencies=hertz, density=density, forces={_pushed(scene, entry.place, axis): 1.0}
        )
        for entry in scene.turbulence
        if entry.force > 0
        for hertz, density in (turbulence_density(entry, scene.sample_rate / 2),)
        for axis in "yz"
    )


def _pushed(scene: ShaftScene, name: str, axis: str) -> Place:
    """Where a random force acts: the housing of a bearing, or the shaft at a disc."""
    if name in [bearing.name for bearing in scene.bearings]:
        return name, axis, "housing"
    return _disc_of(scene, name).station, axis


def turbulence_density(part: Turbulence, highest: float) -> tuple[Float, Float]:
    """One-sided power spectral density of a random force.

    Parameters
    ----------
    part : Turbulence
    highest : float
        Last frequency [Hz].

    Returns
    -------
    frequencies : numpy.ndarray [shape=(n,)]
        From zero, even below the corner and in even ratios above it [Hz].
    density : numpy.ndarray [shape=(n,)]
        ``2 F^2 / (pi f_c) / (1 + (f / f_c)^2)`` [N^2/Hz], whose integral to infinity is F^2.

    Examples
    --------
    >>> part = Turbulence(place="propeller", force=10.0, corner=50.0)
    >>> hertz, density = turbulence_density(part, 1e5)
    >>> bool(abs(np.trapezoid(density, hertz) / 100 - 1) < 1e-3)
    True
    """
    steps = np.linspace(0, math.asinh(highest / part.corner), _DENSITY_LINES)
    hertz = part.corner * np.sinh(steps)
    hertz[-1] = highest
    density = 2 * part.force**2 / (math.pi * part.corner) / (1 + (hertz / part.corner) ** 2)
    return hertz, density


# --- run


def check_shaft(scene: Scene) -> None:
    """Check what only the physics can tell: sampling, size, the beam's mesh.

    Raises
    ------
    SceneError
        Every fault at once.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> check_shaft(load_scene("propulsion-shaft"))
    """
    shaft = cast(ShaftScene, scene)
    faults = [*_sampling_faults(shaft), *pushing_faults(shaft, shaft.exciters)]
    try:
        alignment_line(shaft)
        faults += element_faults(shaft)
    except ValueError as error:
        faults += str(error).splitlines()
    if faults:
        raise SceneError(shaft.name, faults)


def _sampling_faults(scene: ShaftScene) -> list[str]:
    revolution = 1 / scene.drive.speed
    faults = duration_faults(scene, revolution)
    orders = [*(force.order for force in _order_forces(scene)), *hull_orders(scene)]
    fewest = max([_FEWEST_PER_TURN, *(2 * order + 1 for order in orders)])
    if scene.sample_rate * revolution < fewest:
        faults.append(
            f"sample_rate = {scene.sample_rate:g} Hz must be >= {fewest / revolution:g} Hz, "
            f"{fewest} samples a revolution for the highest order of its forces; raise it"
        )
    faults += engine_rate_faults(scene)
    faults += tacho_faults(scene, revolution)
    needed = scene.duration * scene.sample_rate * _BYTES_PER_SAMPLE
    return faults + memory_faults(scene, needed)


class _Rest(NamedTuple):
    """A line at rest and judged: what recordings share that differ in seed and start angle."""

    state: ShaftState
    reduced: ReducedRotor | None
    status: Status
    culprit: str
    numerics: Numerics


def simulate_shaft(scene: Scene, seed: int, truth: bool, raise_on_failure: bool) -> Recording:
    """Simulate one recording; see :func:`wearstate.sim.machine.simulate.simulate`."""
    return shaft_recorder(scene)(scene, seed, truth, raise_on_failure)


def shaft_recorder(scene: Scene) -> Recorder:
    """Recordings of one line at rest; see :func:`wearstate.sim.machine.simulate.recorder`."""
    return partial(_record, _rest(cast(ShaftScene, scene)))


def _rest(scene: ShaftScene) -> _Rest:
    check_shaft(scene)
    state = shaft_state(scene, raise_on_failure=False)
    numerics = _numerics(scene, state)
    status, culprit = _STATUS[state.film.status], state.film.culprit
    reduced = None
    if status.ok:
        reduced = reduced_rotor(scene, state)
        numerics |= _guards(scene, reduced)
        status, culprit = _judged(scene, state, reduced, numerics)
    return _Rest(state, reduced, status, culprit, numerics)


def _record(rest: _Rest, scene: Scene, seed: int, truth: bool, raise_on_failure: bool) -> Recording:
    shaft, state, numerics = cast(ShaftScene, scene), rest.state, dict(rest.numerics)
    if rest.reduced is None or not rest.status.ok:
        if raise_on_failure:
            raise SimulationError(rest.status, f"{shaft.name}, bearing '{rest.culprit}'")
        return failed(shaft, rest.status, numerics)
    motion = _Motion(shaft, state, rest.reduced, seed, truth)
    signal, clipped = _measured(shaft, state, motion, seed)
    numerics["clipped_samples"] = clipped
    return recorded(
        shaft,
        signal,
        truth=motion.truth() if truth else {},
        status=rest.status,
        numerics=numerics,
        warnings=_warnings(shaft, state, numerics),
    )


def _guards(scene: ShaftScene, reduced: ReducedRotor) -> Numerics:
    """Least damping, which is how far the line is from unstable; first resonance; basis' error."""
    swinging = reduced.poles[np.abs(reduced.poles.imag) > 0]
    ratios = -swinging.real / np.abs(swinging)
    least = int(np.argmin(ratios))
    resonant = np.abs(swinging[ratios < _RESONANT].imag)
    guards: Numerics = {
        "least_damping_ratio": float(ratios[least]),
        "least_damped_hz": float(abs(swinging[least].imag)) / math.tau,
        "stability_margin": float(ratios[least]),
    }
    if resonant.size:
        guards["first_resonance_hz"] = float(resonant.min()) / math.tau
    harmonics = harmonic_forces(scene)
    if harmonics:
        places: list[Place] = [(b.name, axis) for b in scene.bearings for axis in "yz"]
        forces = list(dict.fromkeys(place for each in harmonics for place in each.forces))
        lines = [each.frequency for each in harmonics]
        guards["estimated_error"] = reduced.measured_error(lines, places, forces)
    return guards


def reduced_rotor(scene: ShaftScene, state: ShaftState) -> ReducedRotor:
    """The rotor of a state on the free modes of its shaft up to half the sample rate.

    Parameters
    ----------
    scene : ShaftScene
    state : ShaftState
        Of :func:`shaft_state`.

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
    basis = _basis(_bones(scene), stations, scene.sample_rate / 2)
    return reduce_rotor(state.rotor, basis, speed=state.film.speed)


def _judged(
    scene: ShaftScene, state: ShaftState, reduced: ReducedRotor, numerics: Numerics
) -> tuple[Status, str]:
    """Whether the linear response holds, and the bearing that says so."""
    if not reduced.stable:
        worst = int(np.argmin(state.film.reactions[:, 1] ** 2 + state.film.reactions[:, 0] ** 2))
        return Status.LINE_UNSTABLE, scene.bearings[worst].name
    share = peak_motion(scene, reduced) / state.film.least_film
    worst = int(np.argmax(share))
    numerics["motion_share"] = float(share[worst])
    status = Status.LINE_MOTION if share[worst] >= 1 else Status.OK
    return status, scene.bearings[worst].name


def peak_motion(scene: ShaftScene, reduced: ReducedRotor) -> Float:
    """How far each journal moves in its bore, by the linear response.

    Parameters
    ----------
    scene : ShaftScene
    reduced : ReducedRotor
        Of its state.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Sum of the amplitudes of all orders, and four times the rms of the random motion, each
        over both directions together, and what exciters add by
        :func:`~wearstate.sim.shaft.push.peak_push`: an upper bound but for some rare peaks [m].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("propulsion-shaft")
    >>> motion = peak_motion(scene, reduced_rotor(scene, shaft_state(scene)))
    >>> bool((motion > 0).all() and motion.argmax() == 0)  # nearest to the propeller
    True
    """
    places = _bore_places(scene)
    phasors = _relative(harmonic_response(reduced, harmonic_forces(scene), places), axis=1)
    square = np.zeros(phasors.shape[1:])
    for force in random_forces(scene):
        hertz, density = np.asarray(force.frequencies), np.asarray(force.density)
        # the mean leaves the rigid motion at rest out of it, as the response does
        gain = reduced.receptance(hertz[1:], places, list(force.forces))[..., 0]
        square += np.trapezoid(
            np.abs(_relative(gain, axis=1)) ** 2 * density[1:, None, None], hertz[1:], axis=0
        )
    steady = np.linalg.norm(np.abs(phasors), axis=-1).sum(axis=0)
    pushed = peak_push(scene, reduced, _paired(places)).reshape(-1, 2)
    return np.asarray(
        steady + _PEAK * np.sqrt(square.sum(axis=-1)) + np.linalg.norm(pushed, axis=-1)
    )


def _bore_places(scene: ShaftScene) -> list[Place]:
    """Journal and housing of every bearing, up and to the side."""
    return [
        (bearing.name, axis, part)
        for bearing in scene.bearings
        for part in ("shaft", "housing")
        for axis in "yz"
    ]


def _paired(places: Sequence[Place]) -> list[Place]:
    """Journal and housing of one direction side by side."""
    return [
        places[4 * i + j + 2 * k] for i in range(len(places) // 4) for j in (0, 1) for k in (0, 1)
    ]


def _relative(values: NDArray[np.inexact], axis: int) -> NDArray[np.inexact]:
    """Journal less housing; the axis of the places becomes two, bearing and direction."""
    shape = values.shape
    split = values.reshape(*shape[:axis], shape[axis] // 4, 2, 2, *shape[axis + 1 :])
    journal, housing = np.moveaxis(split, axis + 1, 0)
    return np.asarray(journal - housing)


class _Motion:
    """Time histories of the housings and journals that are seen, or of all."""

    def __init__(
        self, scene: ShaftScene, state: ShaftState, reduced: ReducedRotor, seed: int, truth: bool
    ) -> None:
        self.scene, self.state = scene, state
        wanted = _wanted(scene, truth)
        found = time_response(
            reduced,
            [place for place, _ in wanted],
            n_samples=round(scene.duration * scene.sample_rate),
            sample_rate=scene.sample_rate,
            quantity=[quantity for _, quantity in wanted],
            harmonics=harmonic_forces(scene),
            broadband=random_forces(scene),
            seed=seed,
        )
        self.forces: tuple[Push, ...] = ()
        if scene.mounted_exciters:
            lead = lead_samples(scene, reduced)
            led = pushes(scene, seed, lead)
            found = found + pushed_motion(scene, reduced, led, wanted, lead=lead)
            inside = slice(lead, lead + found.shape[1])
            self.forces = tuple(Push(*(row[inside] for row in push)) for push in led)
        self._rows = dict(zip(wanted, found, strict=True))

    def acceleration(self, bearing: str, axis: str) -> Float:
        """Of a housing [m/s^2]."""
        return np.asarray(self._rows[(bearing, axis, "housing"), "acceleration"])

    def offset(self, bearing: str, axis: str, quantity: str = "displacement") -> Float:
        """Of a journal in its bore about its place at rest [m] or [m/s]."""
        journal, housing = (
            self._rows[(bearing, axis, part), quantity] for part in ("shaft", "housing")
        )
        return np.asarray(journal - housing)

    def truth(self) -> dict[str, Float]:
        """Shaft angle, journals in their bores, film forces, test forces along their direction."""
        scene, film = self.scene, self.state.film
        places, forces = [], []
        for i, bearing in enumerate(scene.bearings):
            place, rate = (
                np.stack(
                    [
                        *(self.offset(bearing.name, axis, quantity) for axis in "yz"),
                        *(
                            self._rows[(bearing.name, f"slope_{axis}", "shaft"), quantity]
                            for axis in "yz"
                        ),
                    ]
                )
                for quantity in ("displacement", "velocity")
            )
            pull = film.stiffness[i] @ place + film.damping[i] @ rate
            places.append(film.positions[i] + place[:2].T)
            forces.append(film.reactions[i] - pull[:2].T)
        return {
            "state_angle": shaft_angle(scene),
            "journal_m": np.stack(places, axis=1),
            "film_force_n": np.stack(forces, axis=1),
        } | (
            {"test_force_n": np.stack([f.along for f in self.forces], axis=1)}
            if self.forces
            else {}
        )


def _wanted(scene: ShaftScene, truth: bool) -> list[tuple[Place, str]]:
    """Places and quantities of a run: those of the sensors, or of the truth as well."""
    wanted: dict[tuple[Place, str], None] = {}
    for sensor in scene.sensors:
        axis = "y" if sensor.direction == "up" else "z"
        wanted[(sensor.bearing, axis, "housing"), "acceleration"] = None
    names = [probe.bearing for probe in scene.probes]
    for name in names:
        wanted |= {((name, a, p), "displacement"): None for p in ("shaft", "housing") for a in "yz"}
    if truth:
        for bearing in scene.bearings:
            for quantity in ("displacement", "velocity"):
                for axis in "yz":
                    wanted[(bearing.name, axis, "shaft"), quantity] = None
                    wanted[(bearing.name, axis, "housing"), quantity] = None
                    wanted[(bearing.name, f"slope_{axis}", "shaft"), quantity] = None
    return list(wanted)


def shaft_angle(scene: ShaftScene) -> Float:
    """Angle of the shaft at the samples [rad].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> shaft_angle(load_scene("propulsion-shaft", {"duration": "0.2 s"})).size
    512
    """
    time = np.arange(round(scene.duration * scene.sample_rate)) / scene.sample_rate
    return np.asarray(scene.drive.start_angle + math.tau * scene.drive.speed * time)


def _measured(
    scene: ShaftScene, state: ShaftState, motion: _Motion, seed: int
) -> tuple[NDArray[np.float32], int]:
    """Signal of every channel, and how many samples were clipped."""
    # apart from the stream of the random forces, which has the seed itself
    rng = np.random.default_rng([seed, 1])
    angle = shaft_angle(scene)
    rows, clipped = [], 0
    readings = [
        heard_locally(
            motion.acceleration(sensor.bearing, "y" if sensor.direction == "up" else "z"),
            sensor.modes,
            scene.sample_rate,
        )
        for sensor in scene.sensors
    ]
    readings += [_reading(scene, state, motion, probe, angle) for probe in scene.probes]
    parts: list[ShaftAccelerometer | ShaftProbe] = [*scene.sensors, *scene.probes]
    for part, reading in zip(parts, readings, strict=True):
        row, lost = digitise(
            reading,
            gain=part.gain,
            noise=part.noise,
            full_scale=part.range,
            bits=part.bits,
            rng=rng,
        )
        rows.append(row)
        clipped += lost
    for exciter, push in zip(scene.mounted_exciters, motion.forces, strict=True):
        row, lost = read_cell(exciter, push.cell, rng)
        rows.append(row)
        clipped += lost
    if scene.tacho:
        rows.append(scene.tacho.channel(angle))
    return np.stack(rows), clipped


def _reading(
    scene: ShaftScene, state: ShaftState, motion: _Motion, probe: ShaftProbe, angle: Float
) -> Float:
    """Of a proximity probe: the journal from the middle of the bore as new, and its track."""
    i = [bearing.name for bearing in scene.bearings].index(probe.bearing)
    up, side = state.film.positions[i]
    up -= state.film.bearings[i].sunk
    down = -(up + motion.offset(probe.bearing, "y"))
    port = -(side + motion.offset(probe.bearing, "z"))
    towards = down * math.cos(probe.angle) + port * math.sin(probe.angle)
    turned = angle - probe.angle
    track = track_under(scene.run_out, scene.dents, turned)
    return np.asarray(towards + track + probe.offset)


def _numerics(scene: ShaftScene, state: ShaftState) -> Numerics:
    film = state.film
    return {
        "rung_film": film.rung,
        "film_condition": scene.film.condition,
        "mean_speed_hz": scene.drive.speed,
        "steps": film.iterations,
        "residual": film.residual,
        "min_film_m": float(film.least_film.min()),
        "peak_eccentricity": float(film.eccentricity_ratios.max()),
        "least_reaction_n": float(film.reactions[:, 0].min()),
    }


def _warnings(scene: ShaftScene, state: ShaftState, numerics: Numerics) -> tuple[str, ...]:
    """What a user must know of a run that did not fail."""
    film = state.film
    up = film.reactions[:, 0]
    warnings = [
        f"bearing '{bearing.name}' carries {reaction:.0f} N, less than {_LIFTED:.0%} of the mean; "
        "raise it, or see wearstate align"
        for bearing, reaction in zip(scene.bearings, up, strict=True)
        if reaction < _LIFTED * float(np.mean(np.abs(up)))
    ]
    warnings += [
        f"bearing '{bearing.name}' runs on its edge, film {1e6 * least:.0f} um there and "
        f"{1e6 * inside:.0f} um in the middle; turn its bore towards the shaft"
        for bearing, least, inside in zip(
            scene.bearings, film.least_film, film.middle_films, strict=True
        )
        if least < _THIN_EDGE * inside
    ]
    moved = float(numerics["motion_share"])
    if moved > _MOVED_WARNING:
        warnings.append(
            f"a journal moves by {moved:.0%} of its least film, and the linear response is good "
            f"to about {_MOVED_WARNING:.0%}; lower unbalance, blade_rate, turbulence or the force "
            "of exciters"
        )
    if int(numerics["clipped_samples"]) > 0:
        warnings.append(f"{numerics['clipped_samples']} samples clipped; widen the sensor's range")
    return tuple(warnings)
