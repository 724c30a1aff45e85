"""Parts of a propulsion shaft: sections, bearings, loads, excitation, sensors.

x points along the shaft from aft, the propeller, forward; a station is the distance in x
from the aft end. y points up and z to starboard. The shaft turns from y towards z. Heights and
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
from .journal import ProximityProbe, ScarLimits

_MOMENT_MOST = 1e9  # N m
_UNBALANCE_MOST = 1e6  # kg m
_MODULUS_LEAST, _MODULUS_MOST = 1e8, 1e13  # Pa, from rubber to beyond diamond
_DENSITY_MOST = 3e4  # kg/m^3, beyond osmium
_STEEPEST = 0.05  # rad: small angles are their sines to 0.04 %
_THINNEST = 1e-6  # m, smallest clearance of a shaft line: a micrometre
_NOISIEST = 1e7  # m/s^2
_LEAST_RANGE, _MOST_RANGE = 1e-9, 1e7  # m/s^2
_HULL_FASTEST = 1.0  # m/s: a hundred times what people on board tolerate
_HULL_SHARE_MOST = 10.0  # a floor in resonance
_WARMEST_FILM = 100.0  # K above the oil: white metal melts first

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
    """Drive of the shaft."""

    speed: RotationSpeed = Field(gt=0, le=1000, description="shaft speed, constant")
    start_angle: _Phase = Field(default=0.0, description="shaft angle at the first sample")


class ShaftMaterial(Part):
    """Material of the shaft, and its beam theory."""

    theory: Literal["timoshenko", "euler-bernoulli"] = Field(
        default="timoshenko",
        description="timoshenko: with shear and rotary inertia; euler-bernoulli: without",
    )
    shear_coefficient: Ratio | Literal["cowper"] = Field(
        default="cowper",
        description="coefficient of the Timoshenko beam: a number, or Cowper's formula",
    )
    young: Pressure = Field(
        ge=_MODULUS_LEAST, le=_MODULUS_MOST, description="modulus of elasticity"
    )
    shear_modulus: Pressure = Field(
        ge=_MODULUS_LEAST, le=_MODULUS_MOST, description="shear modulus of the material"
    )
    density: Density = Field(gt=0, le=_DENSITY_MOST, description="density of the material")
    damping_ratio: Ratio = Field(
        default=0.0, ge=0, lt=1, description="structural damping of the shaft's bending modes"
    )
    damping_band: tuple[Frequency, Frequency] = Field(
        default=(2.0, 200.0), description="two frequencies at which the damping ratio holds"
    )
    longest_element: Length = Field(
        gt=0, le=LONGEST, description="longest element of the beam mesh"
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
    """A piece of shaft with one diameter; sections are listed from aft."""

    length: Length = Field(gt=0, le=LONGEST, description="length along the line")
    outer_diameter: Length = Field(gt=0, le=LONGEST, description="outer diameter of this section")
    inner_diameter: Length = Field(
        default=0.0, ge=0, le=LONGEST, description="bore diameter; 0: solid"
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

    Entrained water has inertia but no weight and does not spin.
    """

    name: _Name = Field(description="name used by exciters and results")
    station: _Station = Field(description="distance from the aft end of the line")
    mass: Mass = Field(ge=0, le=HEAVIEST, description="mass in air")
    polar_inertia: Inertia = Field(
        default=0.0, ge=0, le=INERTIA_MOST, description="inertia about the shaft"
    )
    diametral_inertia: Inertia = Field(
        default=0.0, ge=0, le=INERTIA_MOST, description="inertia about a diameter"
    )
    entrained_mass: Mass = Field(
        default=0.0, ge=0, le=HEAVIEST, description="mass of water that moves with it"
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
    up: _Load = Field(default=0.0, description="vertical force; negative is downward")
    side: _Load = Field(default=0.0, description="horizontal force")
    moment_up: _Turning = Field(default=0.0, description="moment that increases the slope dy/dx")
    moment_side: _Turning = Field(default=0.0, description="moment that increases the slope dz/dx")


# --- bearings


class Housing(Part):
    """Housing of a bearing on its pedestal: a mass on two springs with their dampers."""

    mass: Mass = Field(gt=0, le=HEAVIEST, description="mass that moves with the bearing")
    stiffness_up: Stiffness = Field(gt=0, le=STIFFEST, description="pedestal stiffness, vertical")
    stiffness_side: Stiffness = Field(
        gt=0, le=STIFFEST, description="pedestal stiffness, horizontal"
    )
    damping_up: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="pedestal damping, vertical"
    )
    damping_side: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="pedestal damping, horizontal"
    )
    hull_share_up: _HullShare = Field(
        default=1.0, description="foundation's share of the hull vibration, vertical"
    )
    hull_share_side: _HullShare = Field(
        default=1.0, description="foundation's share of the hull vibration, horizontal"
    )


class AlignmentLimits(Part):
    """Limits of a bearing's load and of its adjustment; `source` gives their origin."""

    least_load: Force = Field(
        default=0.0,
        ge=0,
        le=FORCE_MOST,
        description="load below which the bearing counts as unloaded",
    )
    most_pressure: Pressure | None = Field(
        default=None, gt=0, le=PRESSURE_MOST, description="largest load over length times diameter"
    )
    most_slope: Angle | None = Field(
        default=None,
        gt=0,
        le=_STEEPEST,
        description="largest slope of the shaft in the bore, in this plane",
    )
    least_move: Length = Field(default=0.0, ge=-1.0, le=0, description="lowest adjustment, <= 0")
    most_move: Length = Field(default=0.0, ge=0, le=1.0, description="highest adjustment")
    source: str = Field(
        default="", description="origin of the limits: standard, maker or judgement"
    )


class ShaftBearing(Part):
    """A journal bearing of the line, its position and its state.

    ``offset`` is the height of the journal's centre when it lies at the bottom of the bore, as
    aligned and new. Wear-down lowers the bottom of the bore: the bore stays a circle and gets
    wider by the same amount, or keeps its circle except for an arc at the bottom. A sag lowers the
    bearing.
    """

    name: _Name = Field(description="name used by sensors, probes and tests")
    station: _Station = Field(description="position of its middle, from the aft end of the line")
    diameter: Length = Field(gt=0, le=LONGEST, description="bore diameter")
    length: Length = Field(gt=0, le=LONGEST, description="bore length")
    diametral_clearance: Length = Field(
        ge=_THINNEST, description="clearance as new, bore minus journal"
    )
    offset: _Height = Field(
        default=0.0, description="height of its centre above the reference line"
    )
    side_offset: _Height = Field(
        default=0.0, description="horizontal distance of its centre from the reference line"
    )
    slope: _Slope = Field(default=0.0, description="slope of the bore, dy/dx")
    side_slope: _Slope = Field(default=0.0, description="slope of the bore, dz/dx")
    wear_down: Length = Field(
        default=0.0, ge=0, le=1.0, description="wear of the bottom of the bore"
    )
    worn_shape: Literal["circle", "arc"] = Field(
        default="circle",
        description="shape of the worn bore: a wider circle, or an arc at the bottom",
    )
    arc_clearance: Ratio = Field(
        default=0.5,
        ge=0.05,
        le=1,
        description="clearance of the journal in the arc, over the bore's as new",
    )
    groove_width: Angle = Field(
        default=0.0,
        ge=0,
        lt=math.pi / 2,
        description="width of an axial groove at either side; 0: none",
    )
    sag: Length = Field(default=0.0, ge=0, le=1.0, description="sag below its offset")
    film_warming: Temperature = Field(
        default=0.0,
        ge=0,
        le=_WARMEST_FILM,
        description="film temperature above that of the oil; needs oil.temperature",
    )
    rise: _Height = Field(default=0.0, description="rise of the bearing when hot")
    lift: Length = Field(
        default=0.0, ge=0, le=1.0, description="lift of the journal on its film, for rigid supports"
    )
    points: int = Field(
        default=1, ge=1, le=9, description="number of support points along its length"
    )
    housing: Housing
    limits: AlignmentLimits = AlignmentLimits()

    @model_validator(mode="after")
    def _thin(self) -> Self:
        gap = self.diametral_clearance + self.wear_down
        if gap >= self.diameter / 10:
            raise ValueError(
                f"diametral_clearance + wear_down = {gap:g} m must be < a tenth of the bore "
                f"(diameter = {self.diameter:g} m), the film theory neglects curvature; check the "
                "unit"
            )
        if self.lift > self.diametral_clearance / 2:
            raise ValueError(
                f"lift = {self.lift:g} m must be <= half of diametral_clearance = "
                f"{self.diametral_clearance:g} m; no journal runs above the middle of its bore"
            )
        return self


class _HullTone(Part):
    """A tone of the hull: the velocity ``up cos(angle + up_phase)``, and likewise to the side.

    Every foundation has a share of it, in phase with all others or in antiphase.
    """

    up: _HullSpeed = Field(default=0.0, description="amplitude of the vertical velocity")
    side: _HullSpeed = Field(default=0.0, description="amplitude of the horizontal velocity")
    up_phase: _Phase = Field(default=0.0, description="phase of the vertical velocity")
    side_phase: _Phase = Field(default=0.0, description="phase of the horizontal velocity")


class HullBladeTone(_HullTone):
    """Hull vibration from the propeller's pressure, at a harmonic of the blade rate."""

    harmonic: int = Field(ge=1, le=100, description="harmonic of the blade rate")


class EngineTone(_HullTone):
    """Hull vibration from a separate engine, at an order of its speed."""

    order: Ratio = Field(
        gt=0, le=100, description="order of the engine's speed; 0.5: one per working cycle"
    )


class HullEngine(Part):
    """An engine independent of the line, such as a generating set, with its own speed and phase."""

    speed: RotationSpeed = Field(gt=0, le=1000, description="engine speed, constant")
    tones: tuple[EngineTone, ...] = Field(
        default=(), max_length=MOST_PARTS, description="hull vibration, by orders of this speed"
    )


class Hull(Part):
    """Motion of the hull under the bearings.

    Cargo bends it, in a parabola between first and last bearing; vibration shakes the pedestals.
    """

    deflection: _Height = Field(
        default=0.0,
        description="height of the middle above the line through first and last bearing",
    )
    blade_tones: tuple[HullBladeTone, ...] = Field(
        default=(), max_length=MOST_PARTS, description="vibration at the blade rate"
    )
    engines: tuple[HullEngine, ...] = Field(
        default=(),
        max_length=MOST_PARTS,
        description="engines whose vibration reaches the bearings",
    )


class ShaftCondition(Part):
    """A state in which the alignment must hold."""

    hull_deflection: _Height | None = Field(
        default=None, description="hull deflection; none: hull.deflection"
    )
    rise_share: Ratio = Field(default=0.0, ge=0, le=1, description="share of the bearings' rise")
    lift_share: Ratio = Field(default=0.0, ge=0, le=1, description="share of the journals' lift")
    thrust_share: Ratio = Field(
        default=0.0, ge=0, le=1, description="share of the propeller's thrust"
    )


class ShaftConditions(Part):
    """Three states of an alignment calculation."""

    cold: ShaftCondition = ShaftCondition()
    hot: ShaftCondition = ShaftCondition(rise_share=1.0)
    running: ShaftCondition = ShaftCondition(rise_share=1.0, lift_share=1.0, thrust_share=1.0)


# --- what excites it


class BladeRate(Part):
    """One harmonic of the propeller's forces, as shares of its thrust.

    At the order ``harmonic * blades`` the propeller pushes with ``share * thrust *
    cos(order * angle + phase)``, and turns with a moment of ``share * thrust * diameter``.
    """

    harmonic: int = Field(ge=1, le=100, description="harmonic of the blade rate")
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
    up_phase: _Phase = Field(default=0.0, description="phase of the vertical force and moment")
    side_phase: _Phase = Field(default=0.0, description="phase of the horizontal force and moment")


class Propeller(Part):
    """Propeller forces on the shaft, in addition to its weight."""

    disc: _Name = Field(description="name of the disc that is the propeller")
    blades: int = Field(ge=1, le=_MOST_BLADES, description="number of blades")
    diameter: Length = Field(gt=0, le=LONGEST, description="diameter of the blade tips")
    thrust: Force = Field(ge=0, le=FORCE_MOST, description="thrust, forward")
    thrust_height: _Height = Field(
        default=0.0, description="of the thrust's line of action above the shaft"
    )
    thrust_side: _Height = Field(default=0.0, description="offset of that line to starboard")
    blade_rate: tuple[BladeRate, ...] = Field(
        default=(),
        max_length=MOST_PARTS,
        description="harmonics of the blade rate, in rising order",
    )


class Coupling(Part):
    """A flexible coupling at one end of the line, its other half misaligned.

    Its elements sit on a ring and differ: their stiffness has a first and a second harmonic round
    the ring. As it turns, a misaligned ring exerts a steady force and one at twice the speed; a
    ring that carries a torque exerts a force at the speed.
    """

    station: _Station = Field(description="distance from the aft end of the line")
    parallel_offset: Length = Field(
        default=0.0, ge=0, le=1.0, description="offset of the other half's axis, along offset_angle"
    )
    offset_angle: _Phase = Field(
        default=0.0, description="direction of the offset, from up towards starboard"
    )
    angle: Annotated[Angle, Field(ge=-_STEEPEST, le=_STEEPEST)] = Field(
        default=0.0, description="slope of the other half's axis, dy/dx"
    )
    stiffness: Stiffness = Field(gt=0, le=STIFFEST, description="stiffness against parallel offset")
    bending_stiffness: Moment = Field(
        default=0.0, ge=0, le=_MOMENT_MOST, description="stiffness against angle, per radian"
    )
    torque: Moment = Field(default=0.0, ge=0, le=_MOMENT_MOST, description="torque carried")
    ring_radius: Length = Field(gt=0, le=LONGEST, description="radius of the ring of elements")
    uneven_once: Ratio = Field(
        default=0.0, ge=0, lt=1, description="first harmonic of the elements' stiffness"
    )
    uneven_twice: Ratio = Field(
        default=0.0, ge=0, lt=1, description="second harmonic of the elements' stiffness"
    )
    uneven_phase: _Phase = Field(
        default=0.0, description="position of the stiffest element at angle 0"
    )


class Turbulence(Part):
    """A random force, flat up to a corner frequency, then falling by 6 dB per octave.

    Its spectral density is ``2 force^2 / (pi corner) / (1 + (f / corner)^2)``, independent in the
    two directions.
    """

    place: _Name = Field(description="name of a disc or of a bearing, whose housing it pushes")
    force: Force = Field(ge=0, le=FORCE_MOST, description="rms over all frequencies")
    corner: Frequency = Field(gt=0, le=1e6, description="frequency above which the force falls")


# --- sensors


DIRECTIONS = {"up": "vertical, up", "side": "horizontal, to starboard"}
"""Directions of sensors and forces, in words for a report."""


class LocalMode(Part):
    """A resonant part of a housing on which an accelerometer is mounted.

    It is too light to act back: no other sensor measures it.
    """

    frequency: Frequency = Field(
        gt=0, le=1e6, description="natural frequency of the part on its housing"
    )
    damping_ratio: Ratio = Field(gt=0, lt=1, description="damping of this mode")
    share: Ratio = Field(
        default=0.0,
        ge=-1,
        le=1,
        description="measured share of its motion relative to the housing; 0: none",
    )


class ShaftAccelerometer(Part):
    """An accelerometer on a bearing's housing, with its converter."""

    name: _Name = Field(description="channel name")
    bearing: _Name = Field(description="name of the bearing whose housing it sits on")
    direction: Literal["up", "side"] = Field(default="up", description="up or side")
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    noise: Acceleration = Field(default=0.0, ge=0, le=_NOISIEST, description="rms of white noise")
    mains: Acceleration = Field(
        default=0.0, ge=0, le=_NOISIEST, description="rms of mains hum with harmonics"
    )
    mains_frequency: Frequency = Field(default=50.0, ge=15, le=400, description="mains frequency")
    range: Acceleration = Field(
        ge=_LEAST_RANGE, le=_MOST_RANGE, description="full scale, plus and minus"
    )
    bits: int = Field(default=24, ge=8, le=32, description="resolution of the converter")
    modes: tuple[LocalMode, ...] = Field(
        default=(), max_length=MOST_PARTS, description="modes of the part of the housing it sits on"
    )


class ShaftProbe(ProximityProbe):
    """A proximity probe in a bearing's housing; it reads the journal's motion towards it.

    It reads zero with the journal in the middle of the new bore. Its angle counts from straight
    down in the direction of rotation, like that of a journal bearing's probe.
    """

    bearing: _Name = Field(description="name of the bearing whose housing it sits in")


# --- limits


class StateLimits(ScarLimits):
    """Limits of a fault of the line, and their source."""
