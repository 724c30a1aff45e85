"""A reciprocating pump as a scene, and the checks between its parts."""

import math
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from ..output.sensor import Channel
from ..parts.casing import Casing, FrfFile
from ..parts.dimensions import Angle, Gravity
from ..parts.limits import MOST_SENSORS
from ..parts.part import merged
from ..parts.sensors import (
    Accelerometer,
    PressureSensor,
    Tacho,
    acceleration_channel,
    single_axis,
)
from ..parts.units import STANDARD_GRAVITY
from ..parts.wording import nearest
from .exciters import CasingExciter, force_channel
from .journal import ScarLimits
from .pump_hydraulics import PIPED_RUNGS, CylinderPressure
from .pump_joints import PumpJoints, Throw
from .pump_parts import Crank, Drive, Piston, Rod
from .scene import (
    SPEED,
    START_ANGLE,
    ConditionPlace,
    Scene,
    Wear,
    WearPlace,
    faults_between,
    name_faults,
)

_MOST_THROWS = 32


CRANK_PLACES = ("bearing_x", "bearing_y", "guide_y", "cylinder_x")
"""Places where the crank mechanism acts on the casing: x along the stroke, y across it."""

GUIDE_PLACES = ("guide_x",)
"""Places where a piston in a guide with clearance rubs, along the stroke."""

VALVE_PLACES = ("suction_valve", "discharge_valve")
"""Places where the valves strike their seats, along the stroke."""

FORCE_PLACES = (*CRANK_PLACES, *GUIDE_PLACES, *VALVE_PLACES)
"""All places of forces on the casing; a suffix ``_1``, ``_2``, … selects one throw."""


class FootLimits(ScarLimits):
    """Limits of the anchor bolts' loss of stretch, and their source."""


_PLAY = "diametral clearance"


class PumpScene(Scene):
    """A reciprocating pump with one or more equal throws and clearance in its joints."""

    physics = "wearstate.sim.machine.pump"
    effects = (
        *(
            "crankpin",
            "wristpin",
            "guide",
            "mainbearing",
            "rod",
            "pressure",
            "drive",
            "casing",
            "step",
        ),
    )
    wear_places = (
        WearPlace("joint.crankpin.diametral_clearance", "crankpin", _PLAY, "wear"),
        WearPlace("joint.wristpin.diametral_clearance", "wristpin", _PLAY, "wear_wristpin"),
        WearPlace("joint.guide.diametral_clearance", "guide", _PLAY),
        WearPlace("crank.bearing.diametral_clearance", "mainbearing", _PLAY),
        WearPlace("throws.*.joint.crankpin.diametral_clearance", "crankpin_{}", _PLAY, "wear"),
        WearPlace(
            "throws.*.joint.wristpin.diametral_clearance", "wristpin_{}", _PLAY, "wear_wristpin"
        ),
        WearPlace("throws.*.joint.guide.diametral_clearance", "guide_{}", _PLAY),
        WearPlace(
            "casing.feet.stretch_lost",
            "feet",
            "stretch that the anchor bolts have lost",
            "wear_feet",
        ),
    )
    condition_places = (
        SPEED,
        ConditionPlace(
            "pressure.discharge",
            "discharge_pressure_pa",
            "pressure behind the pump, above the atmosphere",
        ),
        ConditionPlace(
            "pressure.suction",
            "suction_pressure_pa",
            "pressure before the pump, above the atmosphere",
        ),
        START_ANGLE,
    )

    machine: Literal["reciprocating-pump"] = Field(description="reciprocating-pump")
    gravity: Gravity = STANDARD_GRAVITY
    stroke_inclination: Angle = Field(
        default=0.0, ge=-math.tau, le=math.tau, description="0 horizontal, 90 deg piston up"
    )
    drive: Drive
    crank: Crank
    rod: Rod
    piston: Piston
    pressure: CylinderPressure = CylinderPressure(rung="none")
    joint: PumpJoints
    throws: tuple[Throw, ...] = Field(default=(Throw(),), min_length=1, max_length=_MOST_THROWS)
    wear: Wear | None = None
    wear_wristpin: Wear | None = None
    wear_feet: FootLimits | None = None
    casing: Casing
    running: bool = Field(
        default=True, description="false: the crank stands still, for a test at rest"
    )
    exciters: tuple[CasingExciter, ...] = Field(default=(), max_length=MOST_SENSORS)
    sensors: tuple[Accelerometer, ...] = Field(min_length=1, max_length=MOST_SENSORS)

    @model_validator(mode="before")
    @classmethod
    def _merge_throws(cls, table: Any) -> Any:
        """Merge the scene's tables into those of every throw."""
        if not isinstance(table, Mapping) or not isinstance(table.get("throws"), (list, tuple)):
            return table
        return {**table, "throws": [_merged_throw(table, throw) for throw in table["throws"]]}

    @property
    def accelerometers(self) -> tuple[Accelerometer, ...]:
        """One accelerometer for every channel: triaxial ones split up, see `single_axis`."""
        return single_axis(self.sensors)

    def sensor_channels(self) -> tuple[Channel, ...]:
        """Acceleration of every axis of every accelerometer, then test forces, then pressures."""
        accelerations = tuple(
            acceleration_channel(sensor.name, sensor.place, sensor.direction)
            for sensor in self.accelerometers
        )
        forces = tuple(
            force_channel(part, f"casing at {part.place}", part.direction)
            for part in self.mounted_exciters
        )
        pressures = tuple(
            Channel(name=sensor.name, unit="Pa", quantity="pressure", place=sensor.place)
            for _, sensor in self.pressure_sensors
        )
        return accelerations + forces + pressures

    def sensor_parts(self) -> tuple[Accelerometer, ...]:
        """The accelerometers."""
        return self.accelerometers

    @property
    def mounted_exciters(self) -> tuple[CasingExciter, ...]:
        """Exciters that act; unmounted ones are ignored."""
        return tuple(part for part in self.exciters if part.mounted)

    def joints(self, throw: int) -> PumpJoints:
        """Joints of a throw, counted from 0."""
        return self.throws[throw].joint or self.joint

    def pressures(self, throw: int) -> CylinderPressure:
        """Pressure on the piston of a throw, counted from 0."""
        return self.throws[throw].pressure or self.pressure

    @property
    def pressure_sensors(self) -> tuple[tuple[int, PressureSensor], ...]:
        """Throw, counted from 0, and sensor of every cylinder that has one.

        If there are several throws, each name ends in the number of its throw, counted from 1.
        """
        return _pressure_sensors(self.pressure, self.throws)

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between those parts that are present."""
        checks = (
            (_rod_faults, ("crank", "joint", "rod")),
            (_guide_faults, ("joint", "piston")),
            (_oval_faults, ("joint", "throws", "wear")),
            (_play_faults, ("crank", "joint", "throws")),
            (_line_faults, ("pressure", "throws")),
            (_name_faults, ("sensors", "exciters", "tacho", "pressure", "throws")),
            (_shape_faults, ("casing", "sensors", "throws")),
            (_exciter_faults, ("casing", "sensors", "exciters")),
            (_rest_faults, ("running", "exciters", "fidelity")),
        )
        return faults_between(parts, checks)


def _merged_throw(scene: Mapping[str, Any], throw: Any) -> Any:
    if not isinstance(throw, Mapping):
        return throw
    return {
        **throw,
        **{
            name: merged(scene.get(name, {}), throw[name])
            for name in ("joint", "pressure")
            if isinstance(throw.get(name), Mapping)
        },
    }


def _guide_faults(joint: PumpJoints, piston: Piston) -> list[str]:
    if joint.guide is None or joint.guide.rung == "ideal" or piston.inertia is not None:
        return []
    return ["piston.inertia is missing; a piston in a guide with clearance tilts"]


def _oval_faults(joint: PumpJoints, throws: tuple[Throw, ...], wear: Wear | None) -> list[str]:
    """Find one-sided wear of an eye other than the crank pin's, or without a size as new."""
    faults = []
    for one in (joint, *(throw.joint for throw in throws if throw.joint)):
        if one.wristpin is not None and one.wristpin.one_sided > 0:
            faults.append(
                f"joint.wristpin.one_sided = {one.wristpin.one_sided:g} must be 0: only the eye of "
                "the crank pin may be oval; remove it"
            )
        if one.crankpin.one_sided > 0 and wear is None:
            faults.append(
                f"joint.crankpin.one_sided = {one.crankpin.one_sided:g} needs "
                "wear.as_new_diametral, where one-sided wear begins; add the table wear"
            )
    return list(dict.fromkeys(faults))


def _play_faults(crank: Crank, joint: PumpJoints, throws: tuple[Throw, ...]) -> list[str]:
    """Find a crank with play that ideal joints hold: no pin force would move it."""
    if crank.bearing is None or crank.bearing.rung == "ideal":
        return []
    pins = {(throw.joint or joint).crankpin.rung for throw in throws}
    return [
        f"joint.crankpin.rung = '{rung}' holds the crank, must be a rung with a force if "
        "crank.bearing has play; set it to 'compliant', or crank.bearing.rung = 'ideal'"
        for rung in sorted(pins & {"ideal", "link"})
    ]


def _line_faults(pressure: CylinderPressure, throws: tuple[Throw, ...]) -> list[str]:
    """Find throws with pipes of their own: all throws share one suction and one discharge line."""
    each = [throw.pressure or pressure for throw in throws]
    if not any(one.rung in PIPED_RUNGS for one in each):
        return []
    names = ("rung", "suction", "discharge", "suction_line", "discharge_line", "liquid")
    return [
        f"throws.{i}.pressure.{name} must be that of the first throw: all throws share the lines "
        "of the rungs 'lumped-lines' and 'wave-lines'; set it in the scene's table"
        for i, one in enumerate(each)
        for name in names
        if getattr(one, name) != getattr(each[0], name)
    ]


def _rod_faults(crank: Crank, joint: PumpJoints, rod: Rod) -> list[str]:
    play = joint.wristpin.clearance_radial if joint.wristpin else 0.0
    play += crank.bearing.clearance_radial if crank.bearing else 0.0
    reach = crank.radius + joint.crankpin.clearance_radial + play
    if rod.length > reach:
        return []
    return [
        f"rod.length = {rod.length:g} m must be > crank radius + radial clearance = {reach:g} m; "
        "a shorter rod locks the crank"
    ]


def _pressure_sensors(
    pressure: CylinderPressure, throws: tuple[Throw, ...]
) -> tuple[tuple[int, PressureSensor], ...]:
    found = []
    for i, throw in enumerate(throws):
        sensor = (throw.pressure or pressure).sensor
        if sensor is not None and len(throws) > 1:
            sensor = sensor.model_copy(update={"name": f"{sensor.name}_{i + 1}"})
        if sensor is not None:
            found.append((i, sensor))
    return tuple(found)


def _name_faults(
    sensors: tuple[Accelerometer, ...],
    exciters: tuple[CasingExciter, ...],
    tacho: Tacho | None,
    pressure: CylinderPressure,
    throws: tuple[Throw, ...],
) -> list[str]:
    pressures = (sensor.name for _, sensor in _pressure_sensors(pressure, throws))
    names = [*(sensor.name for sensor in single_axis(sensors)), *(part.name for part in exciters)]
    return name_faults([*names, *pressures], tacho)


def _exciter_faults(
    casing: Casing, sensors: tuple[Accelerometer, ...], exciters: tuple[CasingExciter, ...]
) -> list[str]:
    """Find mounted exciters at places that the casing does not have."""
    if casing.frf is not None:
        known = set(FORCE_PLACES)
    else:
        known = {key for mode in casing.modes for key in mode.shape}
        known |= {sensor.name for sensor in single_axis(sensors)}
    return [
        f"exciters.{i}.place = '{part.place}' is no place of the casing"
        f"{nearest(part.place, sorted(known))}"
        for i, part in enumerate(exciters)
        if part.mounted and part.place not in known
    ]


def _rest_faults(running: bool, exciters: tuple[CasingExciter, ...], fidelity: str) -> list[str]:
    """Faults of a pump at rest, which needs an exciter."""
    faults = []
    if not running and not any(part.mounted for part in exciters):
        faults.append(
            "running = false needs an exciter with force > 0: nothing else moves; set "
            "exciters.0.force or set running = true"
        )
    if not running and fidelity == "auto":
        faults.append(
            "fidelity = 'auto' must be 'given' with running = false; a casing at rest has no "
            "rungs to choose"
        )
    return faults


def _shape_faults(
    casing: Casing, sensors: tuple[Accelerometer, ...], throws: tuple[Throw, ...]
) -> list[str]:
    names = [sensor.name for sensor in single_axis(sensors)]
    forces = [
        f"{place}{suffix}"
        for place in FORCE_PLACES
        for suffix in ("", *(f"_{throw}" for throw in range(1, len(throws) + 1)))
    ]
    if casing.frf is not None:
        return _frf_faults(casing.frf, names, forces)
    faults = []
    for index, mode in enumerate(casing.modes):
        path = f"casing.modes.{index}.shape"
        faults += [
            f"{path}.{key} is no place of this scene{nearest(key, (*FORCE_PLACES, *names))}"
            for key in mode.shape
            if key not in forces and key not in names
        ]
        faults += [
            f"{path}.{name} is missing; give the shape at every sensor (0 at a node)"
            for name in names
            if name not in mode.shape
        ]
    return faults


def _frf_faults(frf: FrfFile, sensors: list[str], forces: list[str]) -> list[str]:
    """Find unknown names in the scene's table of pairs; the file's are checked on reading."""
    pairs = [f"{sensor}/{force}" for sensor in sensors for force in forces]
    return [
        f"casing.frf.pairs.{pair} is no sensor/place of this scene{nearest(pair, pairs)}"
        for pair in frf.pairs
        if pair not in pairs
    ] + [
        f"casing.frf.without: '{place}' is no place of this scene{nearest(place, forces)}"
        for place in frf.without
        if place not in forces
    ]
