"""The parts of a propulsion shaft on its bearings, its loads and sensors, and their cross checks.

x points along the shaft from aft, the propeller, forward, and a station is the distance in it
from the aft end; y points up and z to starboard. The shaft turns from y towards z. Heights and
offsets are positive up, sags and wear-down positive downwards.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from ..output.sensor import Channel
from ..parts.dimensions import (
    Acceleration,
    Angle,
    Damping,
    Density,
    Force,
    Frequency,
    Gravity,
    Inertia,
    Length,
    Mass,
    Moment,
    Pressure,
    Ratio,
    RotationSpeed,
    Stiffness,
    Unbalance,
)
from ..parts.limits import (
    ANGLE_MOST,
    DAMPING_MOST,
    FORCE_MOST,
    GAIN_LEAST,
    GAIN_MOST,
    HEAVIEST,
    INERTIA_MOST,
    LONGEST,
    MOST_SENSORS,
    NAME_LONGEST,
    PRESSURE_MOST,
    STIFFEST,
)
from ..parts.oil import Oil
from ..parts.part import Part
from ..parts.sensors import Tacho, acceleration_channel, displacement_channel
from ..parts.units import STANDARD_GRAVITY
from .exciters import PlacedExciter, force_channel
from .journal import Dent, Film, ProximityProbe, RunOut, ScarLimits
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

_MOMENT_MOST = 1e9  # N m
_UNBALANCE_MOST = 1e6  # kg m
_MODULUS_LEAST, _MODULUS_MOST = 1e8, 1e13  # Pa, from rubber to beyond diamond
_DENSITY_MOST = 3e4  # kg/m^3, beyond osmium
_STEEPEST = 0.05  # rad: small angles are their sines to 0.04 %
_THINNEST = 1e-6  # m, of a clearance of a shaft line: a micrometre
_NOISIEST = 1e7  # m/s^2
_LEAST_RANGE, _MOST_RANGE = 1e-9, 1e7  # m/s^2
_LOOSEST_FIT = 0.05  # of the diameter: bore and shaft are one but for the clearance
_MOST_PARTS = 200
_MOST_BLADES = 20

_Station = Annotated[Length, Field(ge=0, le=LONGEST)]
_Height = Annotated[Length, Field(ge=-1.0, le=1.0)]
_Slope = Annotated[Angle, Field(ge=-_STEEPEST, le=_STEEPEST)]
_Phase = Annotated[Angle, Field(ge=-ANGLE_MOST, le=ANGLE_MOST)]
_Load = Annotated[Force, Field(ge=-FORCE_MOST, le=FORCE_MOST)]
_Turning = Annotated[Moment, Field(ge=-_MOMENT_MOST, le=_MOMENT_MOST)]
_Name = Annotated[str, Field(min_length=1, max_length=NAME_LONGEST)]


# --- shaft


class ShaftDrive(Part):
    """How the shaft is turned."""

    speed: RotationSpeed = Field(gt=0, le=1000, description="constant")
    start_angle: _Phase = Field(default=0.0, description="shaft angle at the first sample")


class ShaftMaterial(Part):
    """What the shaft is of, and how its beam is computed."""

    theory: Literal["timoshenko", "euler-bernoulli"] = Field(
        default="timoshenko",
        description="timoshenko: with shear and rotary inertia; euler-bernoulli: without",
    )
    shear_coefficient: Ratio | Literal["cowper"] = Field(
        default="cowper", description="of the Timoshenko beam: a number, or Cowper's formula"
    )
    young: Pressure = Field(
        ge=_MODULUS_LEAST, le=_MODULUS_MOST, description="modulus of elasticity"
    )
    shear_modulus: Pressure = Field(
        ge=_MODULUS_LEAST, le=_MODULUS_MOST, description="of the material"
    )
    density: Density = Field(gt=0, le=_DENSITY_MOST, description="of the material")
    damping_ratio: Ratio = Field(
        default=0.0, ge=0, lt=1, description="structural damping of the shaft's bending modes"
    )
    damping_band: tuple[Frequency, Frequency] = Field(
        default=(2.0, 200.0), description="two frequencies at which the damping ratio holds"
    )
    longest_element: Length = Field(
        gt=0, le=LONGEST, description="of the beam mesh; shorter is finer"
    )

    @model_validator(mode="after")
    def _rising(self) -> Self:
        low, high = self.damping_band
        if not 0 <= low < high:
            raise ValueError(
                f"damping_band = {low:g} Hz, {high:g} Hz must be >= 0 and rise; reorder it"
            )
        return self


class ShaftSection(Part):
    """A piece of shaft of one diameter; sections follow each other from aft."""

    length: Length = Field(gt=0, le=LONGEST, description="along the line")
    outer_diameter: Length = Field(gt=0, le=LONGEST, description="of this section")
    inner_diameter: Length = Field(
        default=0.0, ge=0, le=LONGEST, description="of its bore; 0 is solid"
    )

    @model_validator(mode="after")
    def _hollow(self) -> Self:
        if self.inner_diameter >= self.outer_diameter:
            raise ValueError(
                f"inner_diameter = {self.inner_diameter:g} m must be < outer_diameter = "
                f"{self.outer_diameter:g} m; exchange them or check the unit"
            )
        return self


class ShaftDisc(Part):
    """A mass on the shaft: propeller, flange, coupling half, gear.

    Entrained water has inertia and neither weight nor spin.
    """

    name: _Name = Field(description="by which exciters and results refer to it")
    station: _Station = Field(description="distance from the aft end of the line")
    mass: Mass = Field(ge=0, le=HEAVIEST, description="in air")
    polar_inertia: Inertia = Field(
        default=0.0, ge=0, le=INERTIA_MOST, description="about the shaft"
    )
    diametral_inertia: Inertia = Field(
        default=0.0, ge=0, le=INERTIA_MOST, description="about a diameter"
    )
    entrained_mass: Mass = Field(
        default=0.0, ge=0, le=HEAVIEST, description="of water that moves with it"
    )
    entrained_polar: Inertia = Field(
        default=0.0, ge=0, le=INERTIA_MOST, description="inertia of that water about the shaft"
    )
    entrained_diametral: Inertia = Field(
        default=0.0, ge=0, le=INERTIA_MOST, description="inertia of that water about a diameter"
    )
    buoyancy: Force = Field(default=0.0, ge=0, le=FORCE_MOST, description="lift of the water")
    unbalance: Unbalance = Field(
        default=0.0, ge=0, le=_UNBALANCE_MOST, description="mass times eccentricity"
    )
    unbalance_angle: _Phase = Field(
        default=0.0, description="from the keyphasor mark, in the direction of rotation"
    )


class ShaftLoad(Part):
    """A steady load at a station."""

    station: _Station = Field(description="distance from the aft end of the line")
    up: _Load = Field(default=0.0, description="negative is downward")
    side: _Load = Field(default=0.0, description="horizontal")
    moment_up: _Turning = Field(default=0.0, description="to the slope dy/dx")
    moment_side: _Turning = Field(default=0.0, description="to the slope dz/dx")


# --- bearings


class Housing(Part):
    """The bearing's housing on its pedestal: a mass on two springs with their dampers."""

    mass: Mass = Field(gt=0, le=HEAVIEST, description="that moves with the bearing")
    stiffness_up: Stiffness = Field(gt=0, le=STIFFEST, description="of the pedestal, vertically")
    stiffness_side: Stiffness = Field(
        gt=0, le=STIFFEST, description="of the pedestal, horizontally"
    )
    damping_up: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="of the pedestal, vertically"
    )
    damping_side: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="of the pedestal, horizontally"
    )


class AlignmentLimits(Part):
    """What a bearing may carry, and how far it may be moved; see where each is from in `source`."""

    least_load: Force = Field(
        default=0.0, ge=0, le=FORCE_MOST, description="below which the bearing counts as unloaded"
    )
    most_pressure: Pressure | None = Field(
        default=None, gt=0, le=PRESSURE_MOST, description="load over length times diameter"
    )
    most_slope: Angle | None = Field(
        default=None, gt=0, le=_STEEPEST, description="of the shaft in the bore, in this plane"
    )
    least_move: Length = Field(default=0.0, ge=-1.0, le=0, description="the furthest down")
    most_move: Length = Field(default=0.0, ge=0, le=1.0, description="the furthest up")
    source: str = Field(
        default="", description="standard, maker or judgement that the limits come from"
    )


class ShaftBearing(Part):
    """A journal bearing of the line, its place and its state.

    ``offset`` is the height of the journal's centre where it lies at the bottom of the bore, as
    aligned and as new. Wear-down lowers the bottom of the bore: the bore stays a circle and gets
    wider by as much, or keeps its circle but for an arc below. A sag lowers the bearing.
    """

    name: _Name = Field(description="by which sensors, probes and tests refer to it")
    station: _Station = Field(description="of its middle, from the aft end of the line")
    diameter: Length = Field(gt=0, le=LONGEST, description="of the bore")
    length: Length = Field(gt=0, le=LONGEST, description="of the bore")
    diametral_clearance: Length = Field(ge=_THINNEST, description="as new, bore minus journal")
    offset: _Height = Field(default=0.0, description="height of its centre over the reference line")
    side_offset: _Height = Field(default=0.0, description="of its centre beside the reference line")
    slope: _Slope = Field(default=0.0, description="of the bore, dy/dx")
    side_slope: _Slope = Field(default=0.0, description="of the bore, dz/dx")
    wear_down: Length = Field(default=0.0, ge=0, le=1.0, description="of the bottom of the bore")
    worn_shape: Literal["circle", "arc"] = Field(
        default="circle", description="of the worn bore: a wider circle, or an arc below"
    )
    arc_clearance: Ratio = Field(
        default=0.5, ge=0.05, le=1, description="of the journal in the arc, over the bore's as new"
    )
    groove_width: Angle = Field(
        default=0.0, ge=0, lt=math.pi / 2, description="of an axial groove at either side; 0: none"
    )
    sag: Length = Field(default=0.0, ge=0, le=1.0, description="downwards, from its offset")
    rise: _Height = Field(default=0.0, description="of the bearing, once it is hot")
    lift: Length = Field(
        default=0.0, ge=0, le=1.0, description="of the journal on its film, on rigid supports"
    )
    points: int = Field(default=1, ge=1, le=9, description="support points along its length")
    housing: Housing
    limits: AlignmentLimits = AlignmentLimits()

    @model_validator(mode="after")
    def _thin(self) -> Self:
        gap = self.diametral_clearance + self.wear_down
        if gap >= self.diameter / 10:
            raise ValueError(
                f"diametral_clearance + wear_down = {gap:g} m must be < a tenth of the bore "
                f"(diameter = {self.diameter:g} m), the film theory knows no curvature; check the "
                "unit"
            )
        if self.lift > self.diametral_clearance / 2:
            raise ValueError(
                f"lift = {self.lift:g} m must be <= half of diametral_clearance = "
                f"{self.diametral_clearance:g} m; no journal runs above the middle of its bore"
            )
        return self


class Hull(Part):
    """How the hull bends under its cargo: a parabola between first and last bearing."""

    deflection: _Height = Field(
        default=0.0, description="of the middle above the line through first and last bearing"
    )


class ShaftCondition(Part):
    """A state for which the alignment must hold."""

    hull_deflection: _Height | None = Field(default=None, description="by default hull.deflection")
    rise_share: Ratio = Field(default=0.0, ge=0, le=1, description="of the bearings' rise")
    lift_share: Ratio = Field(default=0.0, ge=0, le=1, description="of the journals' lift")
    thrust_share: Ratio = Field(default=0.0, ge=0, le=1, description="of the propeller's thrust")


class ShaftConditions(Part):
    """The three states of an alignment calculation."""

    cold: ShaftCondition = ShaftCondition()
    hot: ShaftCondition = ShaftCondition(rise_share=1.0)
    running: ShaftCondition = ShaftCondition(rise_share=1.0, lift_share=1.0, thrust_share=1.0)


# --- what excites it


class BladeRate(Part):
    """One harmonic of the propeller's forces, as shares of its thrust.

    At the order ``harmonic * blades`` the propeller pushes with ``share * thrust *
    cos(order * angle + phase)``, and turns with a moment of ``share * thrust * diameter``.
    """

    harmonic: int = Field(ge=1, le=100, description="of the blade rate")
    up: Ratio = Field(default=0.0, ge=0, le=1, description="vertical force, over the mean thrust")
    side: Ratio = Field(
        default=0.0, ge=0, le=1, description="horizontal force, over the mean thrust"
    )
    moment_up: Ratio = Field(
        default=0.0, ge=0, le=1, description="moment that bends upwards, over thrust times diameter"
    )
    moment_side: Ratio = Field(
        default=0.0,
        ge=0,
        le=1,
        description="moment that bends sideways, over thrust times diameter",
    )
    up_phase: _Phase = Field(default=0.0, description="of the vertical force and moment")
    side_phase: _Phase = Field(default=0.0, description="of the horizontal force and moment")


class Propeller(Part):
    """What the propeller does to the shaft besides its weight."""

    disc: _Name = Field(description="name of the disc that is the propeller")
    blades: int = Field(ge=1, le=_MOST_BLADES, description="number of blades")
    diameter: Length = Field(gt=0, le=LONGEST, description="of the blade tips")
    thrust: Force = Field(ge=0, le=FORCE_MOST, description="forward")
    thrust_height: _Height = Field(
        default=0.0, description="of the thrust's line of action above the shaft"
    )
    thrust_side: _Height = Field(default=0.0, description="of the same to starboard")
    blade_rate: tuple[BladeRate, ...] = Field(
        default=(),
        max_length=_MOST_PARTS,
        description="harmonics of the blade rate, the first first",
    )


class Coupling(Part):
    """A flexible coupling at one end of the line, its other half misaligned.

    Its elements sit on a ring and are not all alike: their stiffness has a first and a second
    harmonic round the ring. Turning, a misaligned ring pushes steadily and at twice the speed, and
    a ring that carries a torque at the speed.
    """

    station: _Station = Field(description="distance from the aft end of the line")
    parallel_offset: Length = Field(
        default=0.0, ge=0, le=1.0, description="of the other half's axis, along offset_angle"
    )
    offset_angle: _Phase = Field(default=0.0, description="from up towards starboard")
    angle: Annotated[Angle, Field(ge=-_STEEPEST, le=_STEEPEST)] = Field(
        default=0.0, description="of the other half's axis, dy/dx"
    )
    stiffness: Stiffness = Field(gt=0, le=STIFFEST, description="to a parallel offset")
    bending_stiffness: Moment = Field(
        default=0.0, ge=0, le=_MOMENT_MOST, description="to an angle, per radian"
    )
    torque: Moment = Field(default=0.0, ge=0, le=_MOMENT_MOST, description="carried")
    ring_radius: Length = Field(gt=0, le=LONGEST, description="of the elements")
    uneven_once: Ratio = Field(
        default=0.0, ge=0, lt=1, description="first harmonic of the elements' stiffness"
    )
    uneven_twice: Ratio = Field(
        default=0.0, ge=0, lt=1, description="second harmonic of the elements' stiffness"
    )
    uneven_phase: _Phase = Field(default=0.0, description="of the stiffest element at angle 0")


class Turbulence(Part):
    """A random force, flat up to a corner, then falling by 6 dB an octave.

    Its density is ``2 force^2 / (pi corner) / (1 + (f / corner)^2)``, in both directions,
    independently.
    """

    place: _Name = Field(description="name of a disc or of a bearing, whose housing it pushes")
    force: Force = Field(ge=0, le=FORCE_MOST, description="rms over all frequencies")
    corner: Frequency = Field(gt=0, le=1e6, description="above which the force falls")


class ShaftExciter(PlacedExciter):
    """A shaker or hammer on the shaft or on a bearing's housing, while the line runs.

    At rest the journals lie on metal, of which the model knows nothing: there is no test at
    standstill.
    """

    place: str = Field(
        default="", max_length=NAME_LONGEST, description="name of a bearing or a disc"
    )
    station: _Station | None = Field(default=None, description="of the shaft, instead of a place")
    part: Literal["shaft", "housing"] = Field(default="shaft", description="that it pushes")
    direction: Literal["up", "side"] = Field(default="up", description="up or side")

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        faults = []
        if bool(self.place) == (self.station is not None):
            faults.append(
                f"{'both' if self.place else 'neither'} of place and station given, must be "
                "exactly one; remove or add one"
            )
        if self.part == "housing" and self.place_scatter:
            faults.append(
                f"place_scatter = {self.place_scatter:g} m must be 0 on a housing, which does not "
                "tilt here; set part = 'shaft' or remove it"
            )
        if self.part == "housing" and self.station is not None:
            faults.append(
                f"station = {self.station:g} m names no housing; name a bearing as place instead"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    @property
    def where(self) -> str:
        """For people: ``shaft at forward``, ``housing of forward``."""
        if self.part == "housing":
            return f"housing of {self.place}"
        return f"shaft at {self.place or f'{self.station:g} m'}"


# --- what is seen of it


DIRECTIONS = {"up": "vertical, up", "side": "horizontal, to starboard"}
"""Of sensors and forces, as a report tells them."""


class ShaftAccelerometer(Part):
    """An accelerometer on a bearing's housing, with its converter."""

    name: _Name = Field(description="of its channel")
    bearing: _Name = Field(description="name of the bearing whose housing it sits on")
    direction: Literal["up", "side"] = Field(default="up", description="up or side")
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    noise: Acceleration = Field(default=0.0, ge=0, le=_NOISIEST, description="rms of white noise")
    range: Acceleration = Field(
        ge=_LEAST_RANGE, le=_MOST_RANGE, description="full scale, plus and minus"
    )
    bits: int = Field(default=24, ge=8, le=32, description="of its converter")


class ShaftProbe(ProximityProbe):
    """A proximity probe in a bearing's housing: it reads the journal's motion towards itself.

    Zero where the journal is in the middle of the bore as new. Its angle is from straight down in
    the direction of rotation, as that of a journal bearing's probe.
    """

    bearing: _Name = Field(description="name of the bearing whose housing it sits in")


# --- limits


class StateLimits(ScarLimits):
    """Limits of a fault of the line, with their source."""


# --- the whole


class ShaftScene(Scene):
    """A propulsion shaft on its bearings, seen on its housings and by proximity probes."""

    physics = "wearstate.sim.machine.shaft"
    effects = ("film", "beam", "elements", "mesh")
    wear_places = (
        WearPlace(
            "bearings.*.wear_down", "bearing_{}", "how far the bore has worn down", "wear_down"
        ),
        WearPlace("bearings.*.sag", "bearing_{}", "how far the foundation has sunk", "wear_sag"),
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
    )

    machine: Literal["propulsion-shaft"] = Field(description="propulsion-shaft")
    gravity: Gravity = STANDARD_GRAVITY
    settling_revolutions: int = Field(
        default=0, ge=0, le=1000, description="unused: the response is the settled one"
    )
    drive: ShaftDrive
    shaft: ShaftMaterial
    sections: tuple[ShaftSection, ...] = Field(min_length=1, max_length=_MOST_PARTS)
    discs: tuple[ShaftDisc, ...] = Field(default=(), max_length=_MOST_PARTS)
    loads: tuple[ShaftLoad, ...] = Field(default=(), max_length=_MOST_PARTS)
    bearings: tuple[ShaftBearing, ...] = Field(min_length=2, max_length=_MOST_PARTS)
    oil: Oil
    hull: Hull = Hull()
    conditions: ShaftConditions = ShaftConditions()
    propeller: Propeller | None = None
    coupling: Coupling | None = None
    turbulence: tuple[Turbulence, ...] = Field(default=(), max_length=_MOST_PARTS)
    exciters: tuple[ShaftExciter, ...] = Field(default=(), max_length=MOST_SENSORS)
    film: Film = Film(rung="direct")
    run_out: tuple[RunOut, ...] = Field(default=(), max_length=_MOST_PARTS)
    dents: tuple[Dent, ...] = Field(default=(), max_length=_MOST_PARTS)
    sensors: tuple[ShaftAccelerometer, ...] = Field(default=(), max_length=MOST_SENSORS)
    probes: tuple[ShaftProbe, ...] = Field(default=(), max_length=MOST_SENSORS)
    wear_down: StateLimits | None = None
    wear_sag: StateLimits | None = None
    wear_coupling: StateLimits | None = None

    @property
    def length(self) -> float:
        """Of the whole shaft [m]."""
        return math.fsum(section.length for section in self.sections)

    def sensor_channels(self) -> tuple[Channel, ...]:
        """Accelerations of the housings, a displacement for every probe, then the test forces."""
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
        """Those that push; the others are not there."""
        return tuple(part for part in self.exciters if part.mounted)

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between parts, of those parts that are there."""
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
    """Outer diameters at a station, two where sections meet."""
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
            f"film.rung = '{film.rung}' knows no tilted journal; set film.rung = 'direct' for a "
            "shaft line"
        )
    if film.condition == "reynolds":
        faults.append(
            "film.condition = 'reynolds' must be 'periodic' or 'guembel'; it holds P = 0 on the "
            "line of nodes at the widest gap, of which a tilted journal has no one; 'periodic' "
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
    (_turbulence_faults, ("bearings", "discs", "turbulence")),
    (_exciter_faults, ("sections", "bearings", "discs", "exciters")),
    (_film_faults, ("film",)),
)
"""Checks between parts, and the parts that each needs. A new one is one row."""
