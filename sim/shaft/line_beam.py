"""Beam of a line from its scene: sections, discs, and permanent loads."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from ..alignment.seats import Seat, seat_stations
from ..beam.beam import Beam, assemble_beam
from ..beam.beam_parts import Disc, PointLoad, Section
from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import Coupling, ShaftBearing, ShaftDisc, ShaftLoad, ShaftMaterial
from .push import pushed_stations


def shaft_beam(scene: ShaftScene) -> Beam:
    """Beam of a scene with its permanent loads: weight, loads, coupling.

    Parameters
    ----------
    scene : ShaftScene
        A propulsion shaft or a shaft rig.

    Returns
    -------
    Beam
        With a node at every bearing and its support points, at the discs and at the coupling.

    Raises
    ------
    ValueError
        Two of these stations are too close to each other.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(shaft_beam(load_scene("propulsion-shaft")).weight / 1e3, 1)
    101.1
    """
    return _loaded(bare_beam(parts_of(scene)), coupling_loads(scene.coupling))


def running_beam(scene: ShaftScene) -> Beam:
    """Beam of a scene in steady running, which includes the thrust.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> len(running_beam(load_scene("propulsion-shaft")).loads)
    2
    """
    share = scene.conditions.running.thrust_share
    return _loaded(shaft_beam(scene), thrust_loads(scene, share))


class BeamParts(NamedTuple):
    """Components of a beam; machines and records with equal components share the beam."""

    sections: tuple[Section, ...]
    discs: tuple[Disc, ...]
    loads: tuple[PointLoad, ...]
    stations: tuple[float, ...]
    material: ShaftMaterial
    gravity: float


def parts_of(scene: ShaftScene) -> BeamParts:
    """Beam components of a scene, without properties in which similar machines differ."""
    coupling = (scene.coupling.station,) if scene.coupling else ()
    return BeamParts(
        sections=_sections(scene),
        discs=tuple(_disc(disc) for disc in scene.discs),
        loads=tuple(_load(load) for load in scene.loads),
        stations=(
            *seat_stations(seat_of(bearing) for bearing in scene.bearings),
            *_own_stations(scene),
            *coupling,
        ),
        material=scene.shaft,
        gravity=scene.gravity,
    )


def _own_stations(scene: ShaftScene) -> tuple[float, ...]:
    """Stations of exciters where no other part of the line is."""
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
    """Disc without its unbalance, so that machines that differ only in that share a beam."""
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
def bare_beam(parts: BeamParts) -> Beam:
    """Beam without supports, cached for the records of a data set, which share it."""
    material = parts.material
    timoshenko = material.theory == "timoshenko"
    return assemble_beam(
        parts.sections,
        discs=parts.discs,
        loads=parts.loads,
        stations=parts.stations,
        longest_element=material.longest_element,
        theory=material.theory,
        shear_coefficient=material.shear_coefficient if timoshenko else None,
        gravity=parts.gravity,
    )


def _loaded(beam: Beam, loads: Sequence[PointLoad]) -> Beam:
    """The same beam with additional steady loads at its nodes."""
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
        Share of the thrust.

    Returns
    -------
    tuple of PointLoad
        One at the propeller; none without a propeller.

    Notes
    -----
    A force T along x at the height e acts on the slope dy/dx with the moment ``-T e``: above the
    axis it lifts the propeller.

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
            station=disc_of(scene, part.disc).station,
            moment_up=-share * part.thrust * part.thrust_height,
            moment_side=-share * part.thrust * part.thrust_side,
        ),
    )


def disc_of(scene: ShaftScene, name: str) -> ShaftDisc:
    """Return the disc of that name."""
    return next(disc for disc in scene.discs if disc.name == name)


def seat_of(bearing: ShaftBearing) -> Seat:
    """Seat of a bearing in the alignment model."""
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


def coupling_loads(coupling: Coupling | None) -> tuple[PointLoad, ...]:
    """Loads of a misaligned coupling on the shaft at rest.

    Parameters
    ----------
    coupling : Coupling or None

    Returns
    -------
    tuple of PointLoad
        One, at the coupling; none without a coupling.

    Notes
    -----
    A flexible ring pulls the shaft towards the axis of the other half with the force ``k delta``
    and turns it towards its direction with the moment ``k_b alpha``; the torque T that bends round
    the angle leaves ``T alpha / 2`` across it. The shaft's own displacement, hundredths of a
    millimetre, is neglected against the offset, and so is the ring's stiffness in the line, a
    hundredth of a bearing's.

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
