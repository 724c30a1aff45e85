"""Joints of a pump: crank pin, wrist pin and guide, their contact laws, rungs and wear."""

from typing import Literal, Self

from pydantic import Field, model_validator

from ..parts.dimensions import (
    Angle,
    Damping,
    HertzStiffness,
    Length,
    Pressure,
    Ratio,
    Stiffness,
    Velocity,
)
from ..parts.limits import ANGLE_MOST, DAMPING_MOST, LONGEST, SLIDING_LEAST, SLIDING_MOST, STIFFEST
from ..parts.oil import JointOil
from ..parts.part import Part
from .pump_hydraulics import CylinderPressure

_HERTZ_MOST = 1e18  # N/m^1.5, a metre of steel has 1e11

_ELASTICITY = {
    "linear": ("stiffness",),
    "hertz": ("hertz_stiffness",),
    "conformal": ("effective_modulus", "contact_length"),
}
"""Elasticity of a contact -> its parameters."""


class Contact(Part):
    """Contact and friction of two surfaces of a joint; its laws are alternatives, not rungs."""

    law: Literal[
        "kelvin-voigt",
        "hunt-crossley",
        "lankarani-nikravesh",
        "flores",
        "hu-guo",
        "carvalho-martins",
        "exact",
    ] = Field(
        default="kelvin-voigt",
        description="energy loss of an impact; kelvin-voigt: spring and damper",
    )
    elasticity: Literal["linear", "hertz", "conformal"] = Field(
        default="linear",
        description="normal force against overlap: linear, point contact, or pin in a close bore",
    )
    stiffness: Stiffness | None = Field(
        default=None, gt=0, le=STIFFEST, description="contact force per penetration"
    )
    hertz_stiffness: HertzStiffness | None = Field(
        default=None, gt=0, le=_HERTZ_MOST, description="force per penetration to the power 1.5"
    )
    effective_modulus: Pressure | None = Field(
        default=None, gt=0, le=1e13, description="effective modulus E* of the conformal pair"
    )
    contact_length: Length | None = Field(
        default=None, gt=0, le=LONGEST, description="length of the conformal pair along the pin"
    )
    damping: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="damping C_n of the law kelvin-voigt"
    )
    restitution: Ratio | None = Field(
        default=None, gt=0, le=1, description="coefficient of restitution of the hysteresis laws"
    )
    restitution_speed: Velocity | None = Field(
        default=None,
        ge=SLIDING_LEAST,
        le=SLIDING_MOST,
        description="impact speed of the restitution; faster impacts lose more; none: constant",
    )
    speed_floor: Velocity | None = Field(
        default=None,
        ge=SLIDING_LEAST,
        le=SLIDING_MOST,
        description="least impact speed in a hysteresis law; none: damping at most critical",
    )
    friction_law: Literal["smooth", "ramp"] = Field(
        default="smooth", description="friction law near zero sliding velocity"
    )
    friction: Ratio = Field(default=0.0, ge=0, le=1, description="Coulomb coefficient")
    friction_speed: Velocity = Field(
        default=0.01,
        ge=SLIDING_LEAST,
        le=SLIDING_MOST,
        description="sliding speed that regularises the Coulomb sign; full friction of the ramp",
    )
    friction_dead_speed: Velocity = Field(
        default=0.0, ge=0, le=SLIDING_MOST, description="speed below which the ramp has no friction"
    )
    tangential_damping: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="damping C_t of the source paper"
    )

    @model_validator(mode="after")
    def _law_complete(self) -> Self:
        faults = []
        if self.law == "kelvin-voigt" and self.restitution is not None:
            faults.append(
                f"restitution = {self.restitution:g} is for the hysteresis laws; remove it and "
                "set damping, or choose another law"
            )
        if self.law != "kelvin-voigt" and self.restitution is None:
            faults.append(f"restitution is missing; the law '{self.law}' needs it")
        if self.law != "kelvin-voigt" and self.damping > 0:
            faults.append(
                f"damping = {self.damping:g} N s/m is for the law kelvin-voigt; remove it, the law "
                f"'{self.law}' uses restitution"
            )
        if self.law == "kelvin-voigt" and self.restitution_speed is not None:
            faults.append(
                f"restitution_speed = {self.restitution_speed:g} m/s is for the hysteresis laws; "
                "remove it, or choose another law"
            )
        if self.restitution_speed is not None and self.speed_floor is not None:
            faults.append(
                f"speed_floor = {self.speed_floor:g} m/s has no effect with restitution_speed, "
                "which replaces the impact speed in the law; remove one of them"
            )
        if self.law == "carvalho-martins" and (self.restitution or 1) < 1 / 3:
            faults.append(
                f"restitution = {self.restitution:g} must be >= 1/3 for the law carvalho-martins; "
                "choose the law 'exact'"
            )
        if self.friction_dead_speed >= self.friction_speed:
            faults.append(
                f"friction_dead_speed = {self.friction_dead_speed:g} m/s must be < friction_speed "
                f"= {self.friction_speed:g} m/s; the ramp lies between them"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def elastic_faults(self) -> list[str]:
        """Find missing parameters of the elasticity, for the rungs that need one."""
        return [
            f"{name} is missing; the elasticity '{self.elasticity}' needs it"
            for name in _ELASTICITY[self.elasticity]
            if getattr(self, name) is None
        ]


_ROUGHNESSES = 8.0
"""Least radial clearance in roughness heights: see :mod:`wearstate.sim.contact.asperities`."""

OILED_RUNGS = ("film-short", "film-map", "mixed")
"""Rungs of a joint lubricated with oil."""


class RevoluteJoint(Contact):
    """Pin in an eye with clearance. Give exactly one of the two clearances.

    Rungs: *ideal* (no clearance), *link* (always in contact), *compliant* (dry impact), and with
    oil *film-short*, *film-map* (finite length) and *mixed* (a film and the asperities of rough
    surfaces). With oil, elasticity and stiffness describe the parts behind the film, and
    friction the touching asperities.
    """

    rung: Literal["ideal", "link", "compliant", "film-short", "film-map", "mixed"] = Field(
        default="compliant",
        description="ideal: no clearance; link: massless link of its length; compliant: contact; "
        "film-short, film-map: oil; mixed: oil and asperities",
    )
    oil: JointOil | None = Field(default=None, description="oil between pin and eye")
    pin_diameter: Length = Field(gt=0, le=LONGEST, description="nominal pin diameter")
    diametral_clearance: Length | None = Field(
        default=None, ge=0, description="eye diameter minus pin diameter"
    )
    radial_clearance: Length | None = Field(
        default=None, ge=0, description="eye radius minus pin radius"
    )
    one_sided: Ratio = Field(
        default=0.0,
        ge=0,
        le=1,
        description="share of the wear beyond wear.as_new_diametral under the load, so that "
        "the eye has the clearance along the rod and less across it",
    )

    @model_validator(mode="after")
    def _one_clearance_that_fits(self) -> Self:
        given = [
            name
            for name in ("diametral_clearance", "radial_clearance")
            if getattr(self, name) is not None
        ]
        faults = self.elastic_faults() if self.rung not in ("ideal", "link") else []
        faults += self._oil_faults()
        if self.one_sided > 0 and self.rung not in ("ideal", "compliant"):
            faults.append(
                f"one_sided = {self.one_sided:g} must be 0 on the rung '{self.rung}', whose eye is "
                "round; set rung = 'compliant' or one_sided = 0"
            )
        if len(given) > 1 or (not given and self.rung != "ideal"):
            faults.append(
                f"{' and '.join(given) if given else 'no clearance'} given, must be exactly one of "
                "diametral_clearance and radial_clearance; keep the one you measured"
            )
        elif self.clearance_radial >= self.pin_diameter / 2:
            faults.append(
                f"{given[0]} = {getattr(self, given[0]):g} m must be smaller than the pin "
                f"(pin_diameter = {self.pin_diameter:g} m); check the unit"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _oil_faults(self) -> list[str]:
        """Find missing or conflicting values of an oiled rung."""
        if self.rung not in OILED_RUNGS:
            return []
        if self.oil is None:
            least = ["oil.viscosity", "oil.length", *["oil.roughness"] * (self.rung == "mixed")]
            return [f"oil is missing; the rung '{self.rung}' needs it: add {', '.join(least)}"]
        faults = self._roughness_faults(self.oil.roughness) if self.rung == "mixed" else []
        if self.rung == "film-map" and self.oil.filled_gap is not None:
            faults.append(
                f"oil.filled_gap = {self.oil.filled_gap:g} m is for the rungs 'film-short' and "
                "'mixed'; a map describes a flooded film; remove it or choose another rung"
            )
        return faults

    def _roughness_faults(self, roughness: float | None) -> list[str]:
        """Find roughness that is missing, or so large that peaks would touch over half the bore."""
        if roughness is None:
            return ["oil.roughness is missing; the rung 'mixed' needs it"]
        most = self.clearance_radial / _ROUGHNESSES
        if 0 < most <= roughness:
            return [
                f"oil.roughness = {roughness:g} m must be < {most:g} m, the radial clearance over "
                f"{_ROUGHNESSES:g}, for peaks to touch near the least gap only; check both values"
            ]
        return []

    @property
    def clearance_radial(self) -> float:
        """Radial clearance [m], whether given as radial or diametral; 0 if neither."""
        if self.radial_clearance is not None:
            return self.radial_clearance
        return (self.diametral_clearance or 0.0) / 2

    @property
    def clearance_diametral(self) -> float:
        """Diametral clearance [m], whether given as diametral or radial; 0 if neither."""
        return 2 * self.clearance_radial


class MainBearing(RevoluteJoint):
    """The crank's main bearings with play, lumped into one: the crank moves parallel to itself.

    The pin is the journal of the crank. Stiffness, damping and film length are totals of all
    bearings.
    """

    @model_validator(mode="after")
    def _moves_and_is_round(self) -> Self:
        faults = []
        if self.rung == "link":
            faults.append(
                "rung = 'link' must be one with a force, as only its bearings hold the crank; "
                "set rung = 'compliant'"
            )
        if self.one_sided > 0:
            faults.append(
                f"one_sided = {self.one_sided:g} must be 0: only the eye of the crank pin may be "
                "oval; remove it"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self


class Guide(Contact):
    """Guide of piston or crosshead, across the stroke in the plane of the crank."""

    rung: Literal["ideal", "compliant"] = Field(
        default="compliant", description="ideal: no clearance; compliant: contact at four corners"
    )
    length: Length = Field(gt=0, le=LONGEST, description="length of the guided part")
    height: Length = Field(
        gt=0, le=LONGEST, description="height of the guided part, across the stroke"
    )
    diametral_clearance: Length = Field(
        ge=0, le=LONGEST, description="guide height minus height of the guided part"
    )

    @property
    def clearance_radial(self) -> float:
        """Clearance on either side of the centred part [m]."""
        return self.diametral_clearance / 2

    @model_validator(mode="after")
    def _surfaces(self) -> Self:
        faults = self.elastic_faults() if self.rung == "compliant" else []
        if faults:
            raise ValueError("\n".join(faults))
        return self


class PumpJoints(Part):
    """Joints of the crank mechanism that may have clearance; an absent one is ideal."""

    crankpin: RevoluteJoint
    wristpin: RevoluteJoint | None = None
    guide: Guide | None = None


class Throw(Part):
    """One throw of the crank: its phase, and its differences from the scene's values.

    ``joint`` and ``pressure`` are merged over the scene's tables, so that one worn joint or
    one leaking valve takes one line; a schema lists them as ``partial``, with nothing required.
    """

    phase: Angle = Field(
        default=0.0, ge=-ANGLE_MOST, le=ANGLE_MOST, description="crank angle from the first throw"
    )
    joint: PumpJoints | None = Field(default=None, json_schema_extra={"partial": True})
    pressure: CylinderPressure | None = Field(default=None, json_schema_extra={"partial": True})
