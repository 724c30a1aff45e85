"""A propulsion shaft on its bearings as a scene, and the checks between its parts."""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal

from pydantic import Field

from ..output.sensor import Channel
from ..parts.dimensions import Gravity
from ..parts.limits import MOST_SENSORS
from ..parts.oil import Oil
from ..parts.sensors import Tacho, acceleration_channel, displacement_channel
from ..parts.units import STANDARD_GRAVITY
from .exciters import ShaftExciter, force_channel
from .journal import Dent, Film, RunOut
from .scene import (
    SPEED,
    START_ANGLE,
    VISCOSITY,
    ConditionPlace,
    Scene,
    WearPlace,
    faults_between,
    name_faults,
)
from .shaft_parts import (
    DIRECTIONS,
    MOST_PARTS,
    Coupling,
    Hull,
    Propeller,
    ShaftAccelerometer,
    ShaftBearing,
    ShaftConditions,
    ShaftDisc,
    ShaftDrive,
    ShaftLoad,
    ShaftMaterial,
    ShaftProbe,
    ShaftSection,
    StateLimits,
    Turbulence,
)

_LOOSEST_FIT = 0.05  # of the diameter: bore and shaft are equal except for the clearance


class ShaftScene(Scene):
    """A propulsion shaft on its bearings, measured on the housings and by proximity probes."""

    physics = "wearstate.sim.machine.shaft"
    effects = ("film", "beam", "elements", "mesh")
    wear_places = (
        WearPlace("bearings.*.wear_down", "bearing_{}", "wear-down of the bore", "wear_down"),
        WearPlace("bearings.*.sag", "bearing_{}", "sag of the foundation", "wear_sag"),
        WearPlace(
            "coupling.parallel_offset",
            "coupling",
            "parallel offset of the shafts",
            "wear_coupling",
        ),
    )
    condition_places = (
        SPEED,
        START_ANGLE,
        VISCOSITY,
        ConditionPlace(
            "hull.deflection", "hull_deflection_m", "deflection of the hull under the bearings"
        ),
        ConditionPlace("propeller.thrust", "thrust_n", "thrust of the propeller"),
        ConditionPlace(
            "bearings.0.film_warming",
            "film_warming_k",
            "temperature of the first bearing's film above the oil",
        ),
    )

    machine: Literal["propulsion-shaft"] = Field(description="propulsion-shaft")
    gravity: Gravity = STANDARD_GRAVITY
    settling_revolutions: int = Field(
        default=0, ge=0, le=1000, description="unused: the response is in steady state"
    )
    drive: ShaftDrive
    shaft: ShaftMaterial
    sections: tuple[ShaftSection, ...] = Field(min_length=1, max_length=MOST_PARTS)
    discs: tuple[ShaftDisc, ...] = Field(default=(), max_length=MOST_PARTS)
    loads: tuple[ShaftLoad, ...] = Field(default=(), max_length=MOST_PARTS)
    bearings: tuple[ShaftBearing, ...] = Field(min_length=2, max_length=MOST_PARTS)
    oil: Oil
    hull: Hull = Hull()
    conditions: ShaftConditions = ShaftConditions()
    propeller: Propeller | None = None
    coupling: Coupling | None = None
    turbulence: tuple[Turbulence, ...] = Field(default=(), max_length=MOST_PARTS)
    exciters: tuple[ShaftExciter, ...] = Field(default=(), max_length=MOST_SENSORS)
    film: Film = Film(rung="direct")
    run_out: tuple[RunOut, ...] = Field(default=(), max_length=MOST_PARTS)
    dents: tuple[Dent, ...] = Field(default=(), max_length=MOST_PARTS)
    sensors: tuple[ShaftAccelerometer, ...] = Field(default=(), max_length=MOST_SENSORS)
    probes: tuple[ShaftProbe, ...] = Field(default=(), max_length=MOST_SENSORS)
    wear_down: StateLimits | None = None
    wear_sag: StateLimits | None = None
    wear_coupling: StateLimits | None = None

    @property
    def length(self) -> float:
        """Length of the whole shaft [m]."""
        return math.fsum(section.length for section in self.sections)

    def sensor_channels(self) -> tuple[Channel, ...]:
        """Accelerations of the housings, displacements of the probes, then the test forces."""
        accelerations = tuple(
            acceleration_channel(
                sensor.name, f"housing of {sensor.bearing}", DIRECTIONS[sensor.direction]
            )
            for sensor in self.sensors
        )
        displacements = tuple(
            displacement_channel(
                probe.name, probe.place or f"housing of {probe.bearing}", probe.direction
            )
            for probe in self.probes
        )
        forces = tuple(
            force_channel(part, part.where, DIRECTIONS[part.direction])
            for part in self.mounted_exciters
        )
        return accelerations + displacements + forces

    def sensor_parts(self) -> tuple[ShaftAccelerometer | ShaftProbe, ...]:
        """Accelerometers, then probes."""
        return (*self.sensors, *self.probes)

    @property
    def mounted_exciters(self) -> tuple[ShaftExciter, ...]:
        """Exciters that act; unmounted ones are ignored."""
        return tuple(part for part in self.exciters if part.mounted)

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between those parts that are present."""
        return faults_between(parts, _CHECKS)


def _channel_faults(
    sensors: tuple[ShaftAccelerometer, ...],
    probes: tuple[ShaftProbe, ...],
    exciters: tuple[ShaftExciter, ...],
    tacho: Tacho | None,
) -> list[str]:
    names = [*(s.name for s in sensors), *(p.name for p in probes), *(e.name for e in exciters)]
    faults = name_faults(names, tacho)
    if not sensors and not probes:
        faults.append("sensors and probes: both are empty, must have >= 1 entry; add one")
    return faults


def _repeated(kind: str, names: Sequence[str]) -> list[str]:
    return [
        f"{kind}: name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]


def _name_faults(bearings: tuple[ShaftBearing, ...], discs: tuple[ShaftDisc, ...]) -> list[str]:
    return _repeated("bearings and discs", [*(b.name for b in bearings), *(d.name for d in discs)])


def _outside(sections: tuple[ShaftSection, ...], places: Iterable[tuple[str, float]]) -> list[str]:
    length = math.fsum(section.length for section in sections)
    return [
        f"{name}.station = {station:g} m must be <= the shaft's length = {length:g} m; lengthen a "
        "section or move it"
        for name, station in places
        if station > length * (1 + 1e-12)
    ]


def _disc_faults(
    sections: tuple[ShaftSection, ...],
    discs: tuple[ShaftDisc, ...],
    loads: tuple[ShaftLoad, ...],
    coupling: Coupling | None,
) -> list[str]:
    places = [(f"discs.{i}", disc.station) for i, disc in enumerate(discs)]
    places += [(f"loads.{i}", load.station) for i, load in enumerate(loads)]
    places += [("coupling", coupling.station)] if coupling else []
    return _outside(sections, places)


def _bearing_faults(
    sections: tuple[ShaftSection, ...], bearings: tuple[ShaftBearing, ...]
) -> list[str]:
    faults = _outside(sections, ((f"bearings.{i}", b.station) for i, b in enumerate(bearings)))
    for i, (one, other) in enumerate(pairwise(bearings)):
        room = other.station - one.station
        if room <= (one.length + other.length) / 2:
            faults.append(
                f"bearings.{i + 1}.station = {other.station:g} m must be > that of bearings.{i} by "
                f"more than half of both lengths, {(one.length + other.length) / 2:g} m; order "
                "them from aft and keep them apart"
            )
    for i, bearing in enumerate(bearings):
        there = _diameters(sections, bearing.station)
        if there and not any(
            abs(bearing.diameter - d) <= _LOOSEST_FIT * bearing.diameter for d in there
        ):
            faults.append(
                f"bearings.{i}.diameter = {bearing.diameter:g} m must be that of the shaft at its "
                f"station, {' or '.join(f'{d:g} m' for d in there)}; change one of them"
            )
    return faults


def _diameters(sections: tuple[ShaftSection, ...], station: float) -> list[float]:
    """Outer diameters at a station; two where sections meet."""
    found, start = [], 0.0
    for section in sections:
        end = start + section.length
        if start * (1 - 1e-12) <= station <= end * (1 + 1e-12):
            found.append(section.outer_diameter)
        start = end
    return found


def _sensor_faults(
    bearings: tuple[ShaftBearing, ...],
    sensors: tuple[ShaftAccelerometer, ...],
    probes: tuple[ShaftProbe, ...],
) -> list[str]:
    names = [bearing.name for bearing in bearings]
    asked = [(f"sensors.{i}", sensor.bearing) for i, sensor in enumerate(sensors)]
    asked += [(f"probes.{i}", probe.bearing) for i, probe in enumerate(probes)]
    return [
        f"{place}.bearing = '{name}' is no bearing; choose one of {', '.join(names)}"
        for place, name in asked
        if name not in names
    ]


def _propeller_faults(discs: tuple[ShaftDisc, ...], propeller: Propeller | None) -> list[str]:
    names = [disc.name for disc in discs]
    if propeller is None or propeller.disc in names:
        return []
    return [
        f"propeller.disc = '{propeller.disc}' is no disc; choose one of "
        f"{', '.join(names) or 'none, and add it'}"
    ]


def _hull_faults(hull: Hull, propeller: Propeller | None) -> list[str]:
    if propeller is not None:
        return []
    return [
        f"hull.blade_tones.{i}: {max(tone.up, tone.side):g} m/s must be 0 without a propeller, "
        "which has the blade rate; add a propeller or leave the tone out"
        for i, tone in enumerate(hull.blade_tones)
        if tone.up or tone.side
    ]


def _warming_faults(oil: Oil, bearings: tuple[ShaftBearing, ...]) -> list[str]:
    if oil.viscosity is None:
        return []
    return [
        f"bearings.{i}.film_warming = {bearing.film_warming:g} K must be 0 with oil.viscosity, "
        "which is valid at one temperature; give oil.temperature, viscosity_40, "
        "viscosity_100 and density instead"
        for i, bearing in enumerate(bearings)
        if bearing.film_warming
    ]


def _turbulence_faults(
    bearings: tuple[ShaftBearing, ...],
    discs: tuple[ShaftDisc, ...],
    turbulence: tuple[Turbulence, ...],
) -> list[str]:
    names = [*(b.name for b in bearings), *(d.name for d in discs)]
    return [
        f"turbulence.{i}.place = '{part.place}' is no bearing and no disc; choose one of "
        f"{', '.join(names)}"
        for i, part in enumerate(turbulence)
        if part.place not in names
    ]


def _exciter_faults(
    sections: tuple[ShaftSection, ...],
    bearings: tuple[ShaftBearing, ...],
    discs: tuple[ShaftDisc, ...],
    exciters: tuple[ShaftExciter, ...],
) -> list[str]:
    housed = [bearing.name for bearing in bearings]
    known = {"housing": housed, "shaft": [*housed, *(disc.name for disc in discs)]}
    mounted = [(i, part) for i, part in enumerate(exciters) if part.mounted]
    stations = [(f"exciters.{i}", part.station) for i, part in mounted]
    return [
        *_outside(sections, ((name, at) for name, at in stations if at is not None)),
        *(
            f"exciters.{i}.place = '{part.place}' is no {'bearing' * (part.part == 'housing')}"
            f"{'bearing and no disc' * (part.part == 'shaft')}; choose one of "
            f"{', '.join(known[part.part])}"
            for i, part in mounted
            if part.place and part.place not in known[part.part]
        ),
    ]


def _film_faults(film: Film) -> list[str]:
    faults = []
    if film.rung != "direct":
        faults.append(
            f"film.rung = '{film.rung}' is for an aligned journal; set film.rung = 'direct' for a "
            "shaft line"
        )
    if film.condition == "reynolds":
        faults.append(
            "film.condition = 'reynolds' must be 'periodic' or 'guembel'; it holds P = 0 on the "
            "line of nodes at the widest gap, which is not unique for a tilted journal; 'periodic' "
            "ruptures the film by the same law and finds the line itself"
        )
    return faults


_CHECKS: tuple[tuple[Any, tuple[str, ...]], ...] = (
    (_channel_faults, ("sensors", "probes", "exciters", "tacho")),
    (_name_faults, ("bearings", "discs")),
    (_disc_faults, ("sections", "discs", "loads", "coupling")),
    (_bearing_faults, ("sections", "bearings")),
    (_sensor_faults, ("bearings", "sensors", "probes")),
    (_propeller_faults, ("discs", "propeller")),
    (_hull_faults, ("hull", "propeller")),
    (_warming_faults, ("oil", "bearings")),
    (_turbulence_faults, ("bearings", "discs", "turbulence")),
    (_exciter_faults, ("sections", "bearings", "discs", "exciters")),
    (_film_faults, ("film",)),
)
"""Checks between parts, and the parts that each needs. A new check is one row."""
