"""The parts of a propulsion shaft: sections, bearings, loads, what excites it, its sensors.

x points along the shaft from aft, the propeller, forward, and a station is the distance in it
from the aft end; y points up and z to starboard. The shaft turns from y towards z. Heights and
offsets are positive up, sags and wear-down positive downwards.
"""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ..parts.dimensions import (
    Acceleration,
    Angle,
    Damping,
    Density,
    Force,
    Frequency,
    Inertia,
    Length,
    Mass,
    Moment,
    Pressure,
    Ratio,
    RotationSpeed,
    Stiffness,
    Temperature,
    Unbalance,
    Velocity,
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
    NAME_LONGEST,
    PRESSURE_MOST,
    STIFFEST,
)
from ..parts.part import Part
from .exciters import PlacedExciter
from .journal import ProximityProbe, ScarLimits

_MOMENT_MOST = 1e9  # N m
_UNBALANCE_MOST = 1e6  # kg m
_MODULUS_LEAST, _MODULUS_MOST = 1e8, 1e13  # Pa, from rubber to beyond diamond
_DENSITY_MOST = 3e4  # kg/m^3, beyond osmium
_STEEPEST = 0.05  # rad: small angles are their sines to 0.04 %
_THINNEST = 1e-6  # m, of a clearance of a shaft line: a micrometre
_NOISIEST = 1e7  # m/s^2
_LEAST_RANGE, _MOST_RANGE = 1e-9, 1e7  # m/s^2
_HULL_FASTEST = 1.0  # m/s: a hundred times what people on board would bear
_HULL_SHARE_MOST = 10.0  # a floor in resonance
_WARMEST_FILM = 100.0  # K over the oil: white metal melts first

MOST_PARTS = 200
_MOST_BLADES = 20

_Station = Annotated[Length, Field(ge=0, le=LONGEST)]
_Height = Annotated[Length, Field(ge=-1.0, le=1.0)]
_Slope = Annotated[Angle, Field(ge=-_STEEPEST, le=_STEEPEST)]
_Phase = Annotated[Angle, Field(ge=-ANGLE_MOST, le=ANGLE_MOST)]
_Load = Annotated[Force, Field(ge=-FORCE_MOST, le=FORCE_MOST)]
_Turning = Annotated[Moment, Field(ge=-_MOMENT_MOST, le=_MOMENT_MOST)]
_HullShare = Annotated[Ratio, Field(ge=-_HULL_SHARE_MOST, le=_HULL_SHARE_MOST)]
_HullSpeed = Annotated[Velocity, Field(ge=0, le=_HULL_FASTEST)]
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
    hull_share_up: _HullShare = Field(
        default=1.0, description="of the hull's vibration that its foundation has, vertically"
    )
    hull_share_side: _HullShare = Field(
        default=1.0, description="of the hull's vibration that its foundation has, horizontally"
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
    film_warming: Temperature = Field(
        default=0.0,
        ge=0,
        le=_WARMEST_FILM,
        description="how much warmer its film is than the oil; needs oil.temperature",
    )
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


class _HullTone(Part):
    """A tone of the hull: the velocity ``up cos(angle + up_phase)``, and so to the side.

    Every foundation has its share of it, in step with all others or against them.
    """

    up: _HullSpeed = Field(default=0.0, description="amplitude of the velocity, vertically")
    side: _HullSpeed = Field(default=0.0, description="amplitude of the velocity, horizontally")
    up_phase: _Phase = Field(default=0.0, description="of the vertical velocity")
    side_phase: _Phase = Field(default=0.0, description="of the horizontal velocity")


class HullBladeTone(_HullTone):
    """What the propeller's pressure makes the hull do at a harmonic of the blade rate."""

    harmonic: int = Field(ge=1, le=100, description="of the blade rate")


class EngineTone(_HullTone):
    """What an engine beside the line makes the hull do at an order of its speed."""

    order: Ratio = Field(gt=0, le=100, description="of the engine's speed; 0.5 is a working cycle")


class HullEngine(Part):
    """An engine that runs beside the line, as a generating set; it keeps its own time."""

    speed: RotationSpeed = Field(gt=0, le=1000, description="constant")
    tones: tuple[EngineTone, ...] = Field(
        default=(), max_length=MOST_PARTS, description="of the hull, by orders of this speed"
    )


class Hull(Part):
    """What the hull does under the bearings.

    It bends under its cargo, a parabola between first and last bearing, and shakes their pedestals.
    """

    deflection: _Height = Field(
        default=0.0, description="of the middle above the line through first and last bearing"
    )
    blade_tones: tuple[HullBladeTone, ...] = Field(
        default=(), max_length=MOST_PARTS, description="vibration at the blade rate"
    )
    engines: tuple[HullEngine, ...] = Field(
        default=(), max_length=MOST_PARTS, description="whose vibration reaches the bearings"
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
        max_length=MOST_PARTS,
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


class LocalMode(Part):
    """A part of a housing that swings in it, and that an accelerometer sits on.

    Too light to push back: no other sensor hears of it.
    """

    frequency: Frequency = Field(gt=0, le=1e6, description="of the part on its housing")
    damping_ratio: Ratio = Field(gt=0, lt=1, description="of this mode")
    share: Ratio = Field(
        default=0.0,
        ge=-1,
        le=1,
        description="of its motion within the housing that the sensor hears; 0: none",
    )


class ShaftAccelerometer(Part):
    """An accelerometer on a bearing's housing, with its converter."""

    name: _Name = Field(description="of its channel")
    bearing: _Name = Field(description="name of the bearing whose housing it sits on")
    direction: Literal["up", "side"] = Field(default="up", description="up or side")
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    noise: Acceleration = Field(default=0.0, ge=0, le=_NOISIEST, description="rms of white noise")
    mains: Acceleration = Field(
        default=0.0, ge=0, le=_NOISIEST, description="rms of hum, harmonics and all"
    )
    mains_frequency: Frequency = Field(default=50.0, ge=15, le=400, description="of the hum")
    range: Acceleration = Field(
        ge=_LEAST_RANGE, le=_MOST_RANGE, description="full scale, plus and minus"
    )
    bits: int = Field(default=24, ge=8, le=32, description="of its converter")
    modes: tuple[LocalMode, ...] = Field(
        default=(), max_length=MOST_PARTS, description="of the part of the housing it sits on"
    )


class ShaftProbe(ProximityProbe):
    """A proximity probe in a bearing's housing: it reads the journal's motion towards itself.

    Zero where the journal is in the middle of the bore as new. Its angle is from straight down in
    the direction of rotation, as that of a journal bearing's probe.
    """

    bearing: _Name = Field(description="name of the bearing whose housing it sits in")


# --- limits


class StateLimits(ScarLimits):
    """Limits of a fault of the line, with their source."""
