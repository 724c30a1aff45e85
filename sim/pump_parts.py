"""The parts of a reciprocating pump and their cross checks."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from .parts import (
    ANGLE_MOST,
    DAMPING_MOST,
    GRAVITY_MOST,
    HEAVIEST,
    INERTIA_LEAST,
    INERTIA_MOST,
    LIGHTEST,
    LONGEST,
    PRESSURE_MOST,
    SLIDING_LEAST,
    SLIDING_MOST,
    STANDARD_GRAVITY,
    STIFFEST,
    Acceleration,
    Accelerometer,
    Angle,
    Casing,
    Damping,
    Inertia,
    Length,
    Mass,
    Part,
    Pressure,
    Ratio,
    RotationSpeed,
    Scene,
    Stiffness,
    Tacho,
    Velocity,
    nearest,
)


class Drive(Part):
    """How the crank is turned."""

    speed: RotationSpeed = Field(gt=0, le=1000, description="crank speed in rev/s, constant")
    start_angle: Angle = Field(
        default=0.0,
        ge=-ANGLE_MOST,
        le=ANGLE_MOST,
        description="crank angle at the first sample",
    )


class Crank(Part):
    """The crank throw, balanced about its axis."""

    radius: Length = Field(gt=0, le=LONGEST, description="half the stroke")


class Rod(Part):
    """The connecting rod."""

    length: Length = Field(
        gt=0, le=LONGEST, description="between the centres of wrist pin and crank-pin eye"
    )
    mass: Mass = Field(ge=LIGHTEST, le=HEAVIEST)
    centre_of_mass: Length = Field(ge=0, description="distance from the wrist pin")
    inertia: Inertia = Field(
        ge=INERTIA_LEAST, le=INERTIA_MOST, description="about the centre of mass"
    )

    @model_validator(mode="after")
    def _centre_between_pins(self) -> Self:
        if self.centre_of_mass > self.length:
            raise ValueError(
                f"centre_of_mass = {self.centre_of_mass:g} m must be <= length = {self.length:g} m;"
                " measure it from the wrist pin"
            )
        return self


class Piston(Part):
    """Piston with crosshead and wrist pin: everything that only slides."""

    mass: Mass = Field(ge=LIGHTEST, le=HEAVIEST)
    diameter: Length = Field(
        ge=0, le=LONGEST, description="bore that the cylinder pressure acts on"
    )


class CylinderPressure(Part):
    """Gauge pressure on the piston face."""

    rung: Literal["none", "two-level"] = "two-level"
    suction: Pressure = Field(default=0.0, ge=-101325.0, description="gauge, above vacuum")
    discharge: Pressure = Field(default=0.0, le=PRESSURE_MOST, description="gauge")
    rise_angle: Angle = Field(
        default=math.radians(3.0),
        ge=math.radians(0.5),
        le=math.radians(90.0),
        description="crank angle after a dead centre over which the pressure changes level",
    )

    @model_validator(mode="after")
    def _levels_ordered(self) -> Self:
        if self.discharge < self.suction:
            raise ValueError(
                f"discharge = {self.discharge:g} Pa must be >= suction = {self.suction:g} Pa; "
                "swap them"
            )
        return self


class RevoluteJoint(Part):
    """A pin in an eye with clearance. Give exactly one of the two clearances."""

    rung: Literal["ideal", "compliant"] = "compliant"
    pin_diameter: Length = Field(gt=0, le=LONGEST)
    diametral_clearance: Length | None = Field(
        default=None, ge=0, description="eye diameter minus pin diameter"
    )
    radial_clearance: Length | None = Field(
        default=None, ge=0, description="eye radius minus pin radius"
    )
    stiffness: Stiffness = Field(gt=0, le=STIFFEST, description="contact force per penetration")
    damping: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="normal contact damping C_n"
    )
    friction: Ratio = Field(default=0.0, ge=0, le=1, description="Coulomb coefficient")
    friction_speed: Velocity = Field(
        default=0.01,
        ge=SLIDING_LEAST,
        le=SLIDING_MOST,
        description="sliding speed that regularises the Coulomb sign",
    )
    tangential_damping: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="C_t of the source paper"
    )

    @model_validator(mode="after")
    def _one_clearance_that_fits(self) -> Self:
        given = [
            name
            for name in ("diametral_clearance", "radial_clearance")
            if getattr(self, name) is not None
        ]
        if len(given) != 1:
            raise ValueError(
                f"{' and '.join(given) if given else 'no clearance'} given, must be exactly one of "
                "diametral_clearance and radial_clearance; keep the one you measured"
            )
        if self.clearance_radial >= self.pin_diameter / 2:
            raise ValueError(
                f"{given[0]} = {getattr(self, given[0]):g} m must be smaller than the pin "
                f"(pin_diameter = {self.pin_diameter:g} m); check the unit"
            )
        return self

    @property
    def clearance_radial(self) -> float:
        """Radial clearance [m], whichever way it was given."""
        if self.radial_clearance is not None:
            return self.radial_clearance
        assert self.diametral_clearance is not None  # the validator saw to it
        return self.diametral_clearance / 2

    @property
    def clearance_diametral(self) -> float:
        """Diametral clearance [m], whichever way it was given."""
        return 2 * self.clearance_radial


class PumpJoints(Part):
    """The joints of the crank mechanism that may have clearance."""

    crankpin: RevoluteJoint


class Wear(Part):
    """Limits of the crank-pin clearance, all diametral, with their source."""

    as_new_diametral: Length = Field(
        gt=0, le=LONGEST, description="smallest clearance of a new joint"
    )
    condemning_diametral: Length = Field(
        gt=0, le=LONGEST, description="the joint must be renewed above it"
    )
    grade_edges_diametral: tuple[Length, Length, Length] = Field(
        description="clearance at which grades 1, 2 and 3 begin"
    )
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        values = (self.as_new_diametral, *self.grade_edges_diametral)
        if any(low >= high for low, high in pairwise(values)):
            raise ValueError(
                "as_new_diametral and grade_edges_diametral = "
                f"{', '.join(f'{v:g} m' for v in values)} must rise strictly; reorder them"
            )
        if self.grade_edges_diametral[-1] != self.condemning_diametral:
            raise ValueError(
                f"grade_edges_diametral[2] = {self.grade_edges_diametral[-1]:g} m must equal "
                f"condemning_diametral = {self.condemning_diametral:g} m; grade 3 is condemned"
            )
        return self


FORCE_PLACES = ("bearing_x", "bearing_y", "guide_y", "cylinder_x")
"""Where the crank mechanism pushes on the casing: x along the stroke, y across it."""


class PumpScene(Scene):
    """A single-throw reciprocating pump with a worn crank pin."""

    machine: Literal["reciprocating-pump"]
    gravity: Acceleration = Field(default=STANDARD_GRAVITY, ge=0, le=GRAVITY_MOST)
    stroke_inclination: Angle = Field(
        default=0.0, ge=-math.tau, le=math.tau, description="0 horizontal, 90 deg piston up"
    )
    drive: Drive
    crank: Crank
    rod: Rod
    piston: Piston
    pressure: CylinderPressure = CylinderPressure(rung="none")
    joint: PumpJoints
    wear: Wear | None = None
    casing: Casing

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between parts, of those parts that are there."""
        checks = (
            (_rod_faults, ("crank", "joint", "rod")),
            (_name_faults, ("sensors", "tacho")),
            (_shape_faults, ("casing", "sensors")),
        )
        return [
            fault
            for check, needs in checks
            if all(need in parts for need in needs)
            for fault in check(*(parts[need] for need in needs))
        ]


def _rod_faults(crank: Crank, joint: PumpJoints, rod: Rod) -> list[str]:
    reach = crank.radius + joint.crankpin.clearance_radial
    if rod.length > reach:
        return []
    return [
        f"rod.length = {rod.length:g} m must be > crank radius + radial clearance = {reach:g} m; "
        "a shorter rod locks the crank"
    ]


def _name_faults(sensors: tuple[Accelerometer, ...], tacho: Tacho | None) -> list[str]:
    names = [sensor.name for sensor in sensors] + ([tacho.name] if tacho else [])
    return [
        f"sensors: name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]


def _shape_faults(casing: Casing, sensors: tuple[Accelerometer, ...]) -> list[str]:
    places = (*FORCE_PLACES, *(sensor.name for sensor in sensors))
    faults = []
    for index, mode in enumerate(casing.modes):
        path = f"casing.modes.{index}.shape"
        faults += [
            f"{path}.{key} is no place of this scene{nearest(key, places)}"
            for key in mode.shape
            if key not in places
        ]
        faults += [
            f"{path}.{sensor.name} is missing; give the shape at every sensor (0 at a node)"
            for sensor in sensors
            if sensor.name not in mode.shape
        ]
    return faults
