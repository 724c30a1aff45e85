"""Moving parts of a reciprocating pump: drive, crank, connecting rod and piston."""

from typing import Literal, Self

from pydantic import Field, model_validator

from ..parts.dimensions import (
    Angle,
    Area,
    Force,
    Inertia,
    Length,
    Mass,
    Moment,
    Pressure,
    Ratio,
    RotationSpeed,
    Unbalance,
    Velocity,
)
from ..parts.limits import (
    ANGLE_MOST,
    FORCE_MOST,
    HEAVIEST,
    INERTIA_LEAST,
    INERTIA_MOST,
    LIGHTEST,
    LONGEST,
    SLIDING_LEAST,
    SLIDING_MOST,
)
from ..parts.part import Part
from .pump_joints import MainBearing

_MOMENT_MOST = 1e9  # N m
_UNBALANCE_MOST = 1e6  # kg m
_AREA_MOST = 1e4  # m^2
_ROUNDING = 1e-9  # of the inertia of a uniform bar, the lower bound


class Motor(Part):
    """An asynchronous motor with everything that turns with it, referred to the crank.

    Moment ``2 M_b / (s / s_b + s_b / s)`` at the slip s, after Kloss. Give exactly one of
    `rated_slip` (drive.speed sets the speed) and `synchronous_speed` (the mains does).
    """

    rated_slip: Ratio | None = Field(
        default=None,
        ge=0,
        lt=0.5,
        description="slip at drive.speed; no-load speed is speed / (1 - rated_slip)",
    )
    synchronous_speed: RotationSpeed | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="no-load speed at the crank; drive.speed is then the initial speed",
    )
    breakdown_moment: Moment = Field(
        gt=0, le=_MOMENT_MOST, description="largest moment, at the crank"
    )
    breakdown_slip: Ratio = Field(
        default=0.2, ge=1e-3, le=10, description="slip at which the moment is largest"
    )
    inertia: Inertia = Field(
        ge=INERTIA_LEAST,
        le=INERTIA_MOST,
        description="inertia of crank, flywheel, gear and rotor, at the crank",
    )

    @model_validator(mode="after")
    def _one_speed(self) -> Self:
        names = ("rated_slip", "synchronous_speed")
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"{' and '.join(given) or 'neither'} given, must be exactly one of rated_slip and "
                "synchronous_speed; keep rated_slip if drive.speed sets the speed"
            )
        return self


class Drive(Part):
    """Drive of the crank: constant speed, or a motor whose speed drops under load."""

    rung: Literal["constant-speed", "motor"] = Field(
        default="constant-speed", description="constant-speed, or a motor that slows under load"
    )
    speed: RotationSpeed = Field(
        gt=0,
        le=1000,
        description="crank speed in rev/s: constant, or the motor's at rated load",
    )
    start_angle: Angle = Field(
        default=0.0,
        ge=-ANGLE_MOST,
        le=ANGLE_MOST,
        description="crank angle at the first sample (motor: expected value)",
    )
    motor: Motor | None = None

    @model_validator(mode="after")
    def _motor_given(self) -> Self:
        if self.rung == "motor" and self.motor is None:
            raise ValueError("motor is missing; the rung 'motor' needs it")
        return self

    @property
    def synchronous_speed(self) -> float:
        """Speed of the motor without load, at the crank [Hz]; `speed` without a motor."""
        if self.motor is None:
            return self.speed
        return self.motor.synchronous_speed or self.speed / (1 - (self.motor.rated_slip or 0.0))


class Crank(Part):
    """Crank with its throws."""

    radius: Length = Field(gt=0, le=LONGEST, description="half the stroke")
    unbalance: Unbalance = Field(
        default=0.0,
        ge=0,
        le=_UNBALANCE_MOST,
        description="mass times eccentricity of the whole crank, along the first throw",
    )
    mass: Mass | None = Field(
        default=None,
        ge=LIGHTEST,
        le=HEAVIEST,
        description="mass of crank, flywheel and all that turns on the main bearings, if they have "
        "play",
    )
    bearing: MainBearing | None = None

    @model_validator(mode="after")
    def _mass_in_play(self) -> Self:
        if self.bearing is not None and self.bearing.rung != "ideal" and self.mass is None:
            raise ValueError("mass is missing; a crank with play in its main bearings moves")
        return self


class Rod(Part):
    """The connecting rod: rigid, or elastic with its first axial and its first bending mode.

    The mass of an elastic rod is spread evenly between the eyes, except for eye masses that follow
    from mass, centre of mass and inertia.
    """

    rung: Literal["rigid", "elastic"] = Field(
        default="rigid", description="rigid, or elastic in tension and bending"
    )
    length: Length = Field(
        gt=0, le=LONGEST, description="distance between the centres of wrist pin and crank-pin eye"
    )
    mass: Mass = Field(ge=LIGHTEST, le=HEAVIEST, description="mass with bearing shells")
    centre_of_mass: Length = Field(ge=0, description="distance from the wrist pin")
    inertia: Inertia = Field(
        ge=INERTIA_LEAST, le=INERTIA_MOST, description="inertia about the centre of mass"
    )
    elastic_modulus: Pressure = Field(
        default=206e9, gt=0, le=1e13, description="modulus of elasticity of an elastic rod; steel"
    )
    section_area: Area | None = Field(
        default=None, gt=0, le=_AREA_MOST, description="cross-section of an elastic rod's shank"
    )
    section_radius: Length | None = Field(
        default=None,
        gt=0,
        le=LONGEST,
        description="radius of gyration of the shank in the plane of motion; for a bar, depth "
        "over 3.46",
    )
    damping_ratio: Ratio = Field(
        default=0.01, ge=0, lt=1, description="damping of both modes of an elastic rod"
    )

    @property
    def shank_mass(self) -> float:
        """Mass of the shank, spread evenly between the eyes [kg]."""
        lever = self.centre_of_mass * (self.length - self.centre_of_mass)
        return 6 * (self.mass * lever - self.inertia) / self.length**2

    @model_validator(mode="after")
    def _elastic_complete(self) -> Self:
        if self.rung == "rigid":
            return self
        faults = [
            f"{name} is missing; the rung 'elastic' needs it"
            for name in ("section_area", "section_radius")
            if getattr(self, name) is None
        ]
        least, most = self.inertia_range
        if not least * (1 - _ROUNDING) <= self.inertia < most:
            faults.append(
                f"inertia = {self.inertia:g} kg m^2 must be >= {least:.4g} and < {most:.4g} kg m^2 "
                "for a rod with a shank between two eyes; check inertia and centre_of_mass, or set "
                "rung = 'rigid'"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    @property
    def inertia_range(self) -> tuple[float, float]:
        """Least inertia (one massless eye) and largest (two eyes and no shank) [kg m^2]."""
        near = min(self.centre_of_mass, self.length - self.centre_of_mass)
        most = self.mass * self.centre_of_mass * (self.length - self.centre_of_mass)
        return most - self.mass * near * self.length / 3, most

    @model_validator(mode="after")
    def _centre_between_pins(self) -> Self:
        if self.centre_of_mass > self.length:
            raise ValueError(
                f"centre_of_mass = {self.centre_of_mass:g} m must be <= length = {self.length:g} m;"
                " measure it from the wrist pin"
            )
        return self


class Piston(Part):
    """Piston with crosshead and wrist pin: all parts that only slide."""

    mass: Mass = Field(ge=LIGHTEST, le=HEAVIEST, description="mass with crosshead and wrist pin")
    diameter: Length = Field(
        ge=0, le=LONGEST, description="bore diameter that the cylinder pressure acts on"
    )
    inertia: Inertia | None = Field(
        default=None,
        ge=INERTIA_LEAST,
        le=INERTIA_MOST,
        description="inertia about the wrist pin, for a guide with clearance",
    )
    seal_friction: Force = Field(
        default=0.0,
        ge=0,
        le=FORCE_MOST,
        description="friction from the tension of rings or packing",
    )
    seal_friction_share: Ratio = Field(
        default=0.0,
        ge=0,
        le=1,
        description="friction over the pressure force on the piston, which presses the seal on",
    )
    seal_friction_speed: Velocity = Field(
        default=0.01,
        ge=SLIDING_LEAST,
        le=SLIDING_MOST,
        description="sliding speed that regularises the Coulomb sign",
    )
