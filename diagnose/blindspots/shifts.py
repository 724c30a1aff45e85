"""What a recipe may take for granted: plausible shifts of every machine's scene, with reasons.

A row whose path a scene lacks is left out; one that the recipe draws is shifted beyond its range
instead, see :mod:`.blindspots.rows`. All amounts are estimates of what differs from one machine, or
one nameplate, to the next. A new row is one line.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["factor", "add", "set"]


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A value of the scene, and what it may be instead.

    Attributes
    ----------
    path : str
        Dotted path of the scene; ``*`` stands for every list entry, all shifted together.
    kind : {"factor", "add", "set"}
        Whether the amounts multiply the machine's own value, are added to it [SI], or replace it.
    amounts : tuple
        One row each; text has a unit or is the name of a rung or law.
    why : str
        How such a difference comes about.
    beside : mapping
        What has to be set with it, by dotted path.
    """

    path: str
    kind: Kind
    amounts: tuple[Any, ...]
    why: str
    beside: Mapping[str, Any] = field(default_factory=dict)


def _factor(path: str, low: float, high: float, why: str) -> Shift:
    return Shift(path=path, kind="factor", amounts=(low, high), why=why)


def _add(path: str, low: float, high: float, why: str) -> Shift:
    return Shift(path=path, kind="add", amounts=(low, high), why=why)


def _set(path: str, amounts: tuple[Any, ...], why: str, **beside: Any) -> Shift:
    return Shift(path=path, kind="set", amounts=amounts, why=why, beside=beside.get("beside", {}))


_PIN = "joint.crankpin"
_LOSSY = {f"{_PIN}.damping": 0.0, f"{_PIN}.restitution": 0.3}
_HERTZ = {f"{_PIN}.hertz_stiffness": 5e10}  # as stiff as the linear one at some kN
_WRIST = {"joint.wristpin.rung": "compliant"}
_GUIDE = {"joint.guide.rung": "compliant"}
_DEGREE = math.radians(1.0)

_PUMP = (
    _set("pressure.rise_delay", ("6 deg", "12 deg"), "the delivery valve opens late"),
    _set("pressure.fall_delay", ("6 deg", "12 deg"), "the suction valve opens late"),
    _set("pressure.rise_angle", ("2 deg", "12 deg"), "stiff liquid, or air in it"),
    _set("pressure.fall_angle", ("2 deg", "12 deg"), "stiff liquid, or air in it"),
    _set("pressure.rung", ("heads", "chamber"), "valves that move, instead of two levels"),
    _factor("pressure.suction", 0.5, 1.5, "level of the bilge"),
    _factor("pressure.discharge", 0.7, 1.4, "head of the line"),
    _factor("drive.speed", 0.8, 1.25, "another gear or motor"),
    _set("drive.rung", ("motor",), "a motor whose speed gives way under the load"),
    _factor(f"{_PIN}.stiffness", 0.5, 2.0, "oil film, bush and rod end in series"),
    _factor(f"{_PIN}.damping", 0.4, 2.5, "squeezed oil, cold or hot"),
    _factor(f"{_PIN}.friction", 0.4, 2.0, "from full film to dry metal"),
    _factor(f"{_PIN}.tangential_damping", 0.3, 3.0, "viscosity of the oil"),
    _set(
        f"{_PIN}.law",
        ("hunt-crossley", "flores", "exact"),
        "no contact law is known to hold in a worn bearing",
        beside=_LOSSY,
    ),
    _set(f"{_PIN}.elasticity", ("hertz",), "a pin that touches on a narrow strip", beside=_HERTZ),
    _set("joint.wristpin.rung", ("compliant",), "a wrist pin with the play of a new one"),
    _set(
        "joint.wristpin.diametral_clearance",
        ("0.12 mm",),
        "a wrist pin worn as well",
        beside=_WRIST,
    ),
    _set("joint.guide.rung", ("compliant",), "a crosshead with the play of a new one"),
    _set("joint.guide.diametral_clearance", ("0.25 mm",), "a worn crosshead", beside=_GUIDE),
    _factor("casing.modes.*.frequency", 0.85, 1.15, "another foundation or pattern"),
    _factor("casing.modes.*.damping_ratio", 0.4, 2.5, "joints, paint, pipes"),
    _factor("rod.mass", 0.8, 1.25, "another drawing"),
    _factor("rod.length", 0.85, 1.2, "another drawing"),
    _factor("rod.inertia", 0.8, 1.25, "estimated from the mass"),
    _factor("piston.mass", 0.8, 1.25, "another drawing"),
    _factor("piston.diameter", 0.93, 1.07, "another liner"),
    _factor("crank.radius", 0.9, 1.1, "another stroke"),
)

_JOURNAL = (
    _factor("load.static", 0.7, 1.4, "belt tension, gear load"),
    _add("load.static_across", -1500.0, 1500.0, "the load does not point where it is taken to"),
    _factor("bearing.length", 0.85, 1.15, "chamfers, grooves, another bush"),
    _factor("bearing.diameter", 0.95, 1.05, "another bush"),
    _factor("oil.viscosity", 0.6, 1.6, "another grade, or 10 K"),
    _factor("drive.speed", 0.8, 1.25, "another gear or motor"),
    _factor("rotor.mass", 0.8, 1.25, "its share on this bearing"),
    _factor("rotor.unbalance", 0.3, 3.0, "another balance quality"),
    _factor("rotor.run_out.*.amplitude", 0.2, 3.0, "another track"),
    _add("sensors.*.offset", -1e-5, 1e-5, "the gap at rest in the middle is not known"),
    _add("sensors.*.angle", -5 * _DEGREE, 5 * _DEGREE, "probes beside their place"),
    _factor("sensors.*.gain", 0.9, 1.1, "another steel under the probe"),
    _set("film.rung", ("short",), "a film solved without its length"),
    _set("film.condition", ("guembel", "reynolds", "periodic"), "where the film ends"),
)

_SHAFT = (
    _add("probes.*.offset", -6e-5, 6e-5, "the gap at rest in the middle is not known"),
    _add("probes.*.angle", -5 * _DEGREE, 5 * _DEGREE, "probes beside their place"),
    _factor("probes.*.gain", 0.9, 1.1, "another steel under the probe"),
    _factor("oil.viscosity_40", 0.68, 1.5, "one ISO grade down or up"),
    _add("oil.temperature", -10.0, 10.0, "cold water, or the tropics"),
    _set("propeller.blades", (3, 5), "another propeller"),
    _factor("propeller.thrust", 0.7, 1.4, "draught, tow"),
    _factor("propeller.thrust_height", 0.3, 2.0, "another wake"),
    _factor("propeller.blade_rate.*.up", 0.3, 3.0, "another wake"),
    _factor("propeller.blade_rate.*.side", 0.3, 3.0, "another wake"),
    _set("hull.deflection", ("-0.8 mm", "0.8 mm"), "loaded, in ballast"),
    _factor("drive.speed", 0.8, 1.25, "another operating point"),
    _factor("bearings.*.diametral_clearance", 0.75, 1.3, "another maker's clearance"),
    _factor("bearings.*.length", 0.85, 1.15, "chamfers, grooves, another bush"),
    _factor("bearings.*.rise", 0.3, 2.0, "pedestals colder or hotter"),
    _add("bearings.*.offset", -1e-4, 1e-4, "datum of the alignment"),
    _add("bearings.*.slope", -1e-4, 1e-4, "bores not in line"),
    _factor("bearings.*.housing.mass", 0.8, 1.25, "what moves with the bearing"),
    _factor("bearings.*.housing.stiffness_up", 0.7, 1.4, "another foundation"),
    _factor("bearings.*.housing.stiffness_side", 0.7, 1.4, "another foundation"),
    _factor("bearings.*.housing.damping_up", 0.4, 2.5, "bolts, chocks"),
    _factor("bearings.*.housing.damping_side", 0.4, 2.5, "bolts, chocks"),
    _factor("discs.*.mass", 0.9, 1.1, "estimated from drawings"),
    _factor("discs.*.entrained_mass", 0.5, 1.5, "water that moves with the propeller"),
    _factor("discs.*.buoyancy", 0.5, 1.5, "propeller half out of the water"),
    _factor("discs.*.unbalance", 0.3, 3.0, "another balance quality, fouling"),
    _factor("run_out.*.amplitude", 0.2, 3.0, "another track"),
    _factor("turbulence.*.force", 0.3, 3.0, "sea state"),
    _factor("coupling.stiffness", 0.5, 2.0, "age of the rubber"),
    _factor("coupling.bending_stiffness", 0.5, 2.0, "age of the rubber"),
    _factor("coupling.torque", 0.7, 1.3, "load of the engine"),
    _set("coupling.angle", ("0.0005 rad",), "faces not parallel"),
    _factor("shaft.young", 0.97, 1.03, "another steel"),
    _set("film.condition", ("guembel", "periodic"), "where the film ends"),
)

SCENE_SHIFTS: Mapping[str, tuple[Shift, ...]] = {
    "reciprocating-pump": _PUMP,
    "journal-bearing": _JOURNAL,
    "propulsion-shaft": _SHAFT,
}
"""Rows by machine; a path of joints or pressures stands for every throw's own as well."""
