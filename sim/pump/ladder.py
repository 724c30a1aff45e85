"""Rungs of a reciprocating pump, from the cheapest to the best, and the cost of a run."""

import math
from collections.abc import Iterator
from functools import partial
from typing import cast

from ..pump_setup.joints import joint_parts
from ..pump_setup.tables import lines_of
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import PIPED_RUNGS
from ..scene.pump_joints import OILED_RUNGS, RevoluteJoint
from ..scene.rungs import (
    Effect,
    Rung,
    as_written,
    effect,
    levels,
    price,
    whole_steps,
    with_values,
    written,
)
from ..scene.scene import Scene
from .validity import FEWEST_STEPS, joint_faults, knock_limits, limits, pump_step, pump_steps

JOINT_RUNGS = (
    Rung(
        name="ideal",
        assumes="no clearance: rigid links, constraint forces",
        reference="Newton-Euler equations of the slider-crank",
        nanoseconds_per_step=60.0,
    ),
    Rung(
        name="link",
        assumes="a massless link as long as the radial clearance: contact is never lost",
        reference="Earles, Wu 1973",
        valid="while the link is in compression: no step of the run in tension",
        needs="a clearance",
        nanoseconds_per_step=120.0,
    ),
    Rung(
        name="compliant",
        assumes="free flight and the contact law's force, with friction, in the clearance circle",
        reference="Xia et al. 2017, eqs 1-15 with corrected signs",
        valid="penetration below a tenth of the pin's radius, and 4 clearances under the load",
        needs="a clearance, a contact law with its stiffness; of a guide the piston's inertia",
        nanoseconds_per_step=140.0,
    ),
    Rung(
        name="film-short",
        assumes="a short oil film on a yielding wall; flooded, or filled in thin gaps only",
        reference="Ocvirk 1952; Booker 1965 for a rotating load",
        valid="length up to a quarter of the diameter; film thicker than the roughness",
        needs="oil with its length",
        nanoseconds_per_step=550.0,
    ),
    Rung(
        name="film-map",
        assumes="a flooded oil film of finite length, from a table, on a yielding wall",
        reference="Childs, Moes, van Leeuwen 1977",
        valid="film thicker than the roughness; laminar, isothermal",
        needs="oil with its length",
        nanoseconds_per_step=1000.0,
    ),
    Rung(
        name="mixed",
        assumes="film and asperities share the load; short where starved, else finite",
        reference="Greenwood, Tripp 1971",
        valid="roughness far below the clearance; laminar, isothermal",
        needs="oil with its length and roughness",
        nanoseconds_per_step=1000.0,
    ),
)
"""Rungs of crank pin and wrist pin; the main bearings have all except the link."""

GUIDE_RUNGS = tuple(rung for rung in JOINT_RUNGS if rung.name in ("ideal", "compliant"))
"""Rungs of a guide."""

ROD_RUNGS = (
    Rung(
        name="rigid",
        assumes="rigid rod",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="elastic",
        assumes="one axial and one bending mode of the rod",
        reference="Shabana 2020, floating frame of reference with mean axes",
        valid="up to its second modes; axial force up to a tenth of Euler's load",
        needs="rod.section_area and rod.section_radius",
        nanoseconds_per_step=200.0,
    ),
)
"""Rungs of the rods."""

PRESSURE_RUNGS = (
    Rung(
        name="none",
        assumes="no pressure",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="constant",
        assumes="a plunger against a constant pressure",
        needs="pressure.discharge",
        nanoseconds_per_step=1.0,
    ),
    Rung(
        name="two-level",
        assumes="suction and discharge pressure in turn",
        reference="quasi-static limit of the rung above",
        needs="pressure.suction and pressure.discharge",
        nanoseconds_per_step=20.0,
    ),
    Rung(
        name="heads",
        assumes="incompressible liquid: energy balance of the lines, liquid inertia as added mass",
        reference="Xia et al. 2017, eqs 16-27 with misprints corrected",
        valid="while the liquid stays above its vapour pressure, also at knocks",
        needs="both lines and valves",
        nanoseconds_per_step=30.0,
    ),
    Rung(
        name="chamber",
        assumes="compressible chamber with air and vapour, self-acting valves, leaks",
        reference="Westphal 1893 for the plates' displacement; Hosea, Shampine 1996 for the solver",
        needs="both lines and valves, pressure.dead_volume",
        nanoseconds_per_step=350.0,
    ),
    Rung(
        name="lumped-lines",
        assumes="chambers on two shared pipes, each a mass on a spring at the pump",
        reference="first mode of an organ pipe closed at the pump",
        valid="up to the first organ-pipe frequency of a pipe; liquid column without vapour",
        needs="as chamber, and the wave speeds of both lines",
        nanoseconds_per_step=900.0,
    ),
    Rung(
        name="wave-lines",
        assumes="chambers on two shared pipes with waves, at least five reaches",
        reference="method of characteristics: Wylie, Streeter 1993",
        valid="plane waves, quasi-steady friction; vapour only at the pipe's nodes",
        needs="as chamber, and the wave speeds of both lines",
        nanoseconds_per_step=900.0,
    ),
)
"""Rungs of the cylinder pressure."""

DRIVE_RUNGS = (
    Rung(
        name="constant-speed",
        assumes="constant crank speed at any load",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="motor",
        assumes="asynchronous motor and flywheel: the speed drops under load",
        reference="Kloss 1929",
        needs="drive.motor",
        nanoseconds_per_step=30.0,
    ),
)
"""Rungs of the drive."""

CASING_RUNGS = (
    Rung(
        name="driven",
        assumes="forces drive the casing, which does not act back: bearing at rest",
        valid="apparent mass of the casing at the bearing far above the moving masses",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="yielding",
        assumes="the bearing moves with the casing's modes, and the crank with it; cost per mode",
        reference="Newton's equations in the frame of the bearing",
        valid="modes up to the frequencies of the knocks",
        needs="casing.modes",
        nanoseconds_per_step=13.0,
    ),
)
"""Rungs of the casing; their costs are per step and mode."""

PUMP_LADDERS = {
    "joint": JOINT_RUNGS,
    "rod": ROD_RUNGS,
    "pressure": PRESSURE_RUNGS,
    "drive": DRIVE_RUNGS,
    "casing": CASING_RUNGS,
}
"""Effect -> its rungs. A new rung is one row, its code in the kernel, and one test."""

PUMP_STEP_LEVELS = (4.0, 2.0, 4 / 3, 1.0, 0.5, 0.25)
"""Factors on the scene's step: few steps make a sample, so that two to four is a large change."""


def pump_effects(scene: Scene) -> Iterator[Effect]:
    """Effects of a pump, each with its rungs; their names are in its scene type."""
    yield from _joint_effects(scene)
    yield from _bearing_effect(scene)
    yield from _rod_effect(scene)
    yield from _pressure_effect(scene)
    yield from _drive_effect(scene)
    yield from _casing_effect(scene)
    yield from _step_effect(scene)


def _beyond(scene: Scene) -> list[str]:
    pump = cast(PumpScene, scene)
    beyond = joint_faults(pump) or [fault for _, fault in limits(pump)]
    return beyond or [fault for _, fault in knock_limits(pump)]


def _joint_effects(scene: Scene) -> Iterator[Effect]:
    pump = cast(PumpScene, scene)
    for name in ("crankpin", "wristpin", "guide"):
        part = getattr(pump.joint, name)
        if part is None:
            continue
        table = GUIDE_RUNGS if name == "guide" else pin_rungs(part)
        rungs = written(table, _throw_paths(pump, "joint", f"{name}.rung"))
        yield effect(name, scene, rungs, partial(_joint_rung, name), beyond=_beyond)


def _bearing_effect(scene: Scene) -> Iterator[Effect]:
    bearing = cast(PumpScene, scene).crank.bearing
    if bearing is not None:
        held = tuple(rung for rung in pin_rungs(bearing) if rung.name != "link")
        rungs = written(held, ["crank.bearing.rung"])
        yield effect(
            "mainbearing", scene, rungs, lambda one: str(one.crank.bearing.rung), beyond=_beyond
        )


def _rod_effect(scene: Scene) -> Iterator[Effect]:
    if cast(PumpScene, scene).rod.section_area is not None:
        rungs = written(ROD_RUNGS, ["rod.rung"])
        yield effect("rod", scene, rungs, lambda one: str(one.rod.rung), beyond=_beyond)


def pin_rungs(part: RevoluteJoint) -> tuple[Rung, ...]:
    """Rungs of a pin: oiled ones only if the scene gives the oil.

    Examples
    --------
    >>> dry = RevoluteJoint(pin_diameter=0.06, radial_clearance=5e-5, stiffness=2e8)
    >>> [rung.name for rung in pin_rungs(dry)]
    ['ideal', 'link', 'compliant']
    """
    return tuple(r for r in JOINT_RUNGS if part.oil is not None or r.name not in OILED_RUNGS)


def _joint_rung(name: str, scene: Scene) -> str:
    return str(getattr(cast(PumpScene, scene).joint, name).rung)


def _throw_paths(scene: PumpScene, table: str, leaf: str) -> Iterator[str]:
    """Paths of a value in the scene's table, and in each throw's own table if it has one."""
    yield f"{table}.{leaf}"
    for i, throw in enumerate(scene.throws):
        if getattr(throw, table) is not None:
            yield f"throws.{i}.{table}.{leaf}"


def _pressure_effect(scene: Scene) -> Iterator[Effect]:
    pump = cast(PumpScene, scene)
    if pump.piston.diameter > 0:  # else there is no pressure force
        rungs = written(pressure_rungs(pump), _throw_paths(pump, "pressure", "rung"))
        yield effect("pressure", scene, rungs, lambda one: str(one.pressure.rung), beyond=_beyond)


def pressure_rungs(pump: PumpScene) -> tuple[Rung, ...]:
    """Rungs of the pressure: those with pipes only if the scene gives their wave speeds.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> pump = load_scene("bilge-pump")
    >>> pressure_rungs(pump)[-1].name
    'chamber'
    """
    lines = (pump.pressure.suction_line, pump.pressure.discharge_line)
    known = all(line is not None and line.wave_speed is not None for line in lines)
    return tuple(rung for rung in PRESSURE_RUNGS if known or rung.name not in PIPED_RUNGS)


def _drive_effect(scene: Scene) -> Iterator[Effect]:
    if cast(PumpScene, scene).drive.motor is not None:
        rungs = written(DRIVE_RUNGS, ["drive.rung"])
        yield effect("drive", scene, rungs, lambda one: str(one.drive.rung), beyond=_beyond)


def _casing_effect(scene: Scene) -> Iterator[Effect]:
    if cast(PumpScene, scene).casing.modes:
        rungs = written(CASING_RUNGS, ["casing.rung"])
        yield effect("casing", scene, rungs, lambda one: str(one.casing.rung), beyond=_beyond)


def _stiffest(scene: PumpScene) -> PumpScene:
    """The scene with all springs it can have: a step that is stable there is stable in any rung."""
    joints = (*_joint_effects(scene), *_bearing_effect(scene))
    stiff = [(part, "compliant") for part in joints]
    for part, name in [*stiff, *((rod, "elastic") for rod in _rod_effect(scene))]:
        if part.refusal(scene, name) is None:
            scene = with_values(scene, part.rung(name).values)
    return scene


def _step_effect(scene: Scene) -> Iterator[Effect]:
    longest = pump_step(_stiffest(cast(PumpScene, scene)))
    values = whole_steps("numerics.step", scene, longest, FEWEST_STEPS)
    rungs = levels("a step", PUMP_STEP_LEVELS, values)
    yield effect("step", scene, rungs, as_written, numerical=True, beyond=_beyond)


def sample_step(scene: Scene) -> float:
    """Step of a pump's run, a whole fraction of a sample [s]."""
    longest = pump_step(cast(PumpScene, scene))
    return 1 / scene.sample_rate / math.ceil(1 / (scene.sample_rate * longest) - _ROUNDING)


_ROUNDING = 1e-9  # tolerance for a whole number of steps


# --- cost

_MECHANISM = 60.0  # ns per step of one throw in addition to its effects

_MODE = 12.0  # ns per step of one casing mode and its sensors

_REACH = 6.0  # ns per step of one reach of a pipe with waves

_CASING_FIXED = 200.0  # ns per step in addition: low-pass and bookkeeping


def pump_cost(scene: Scene) -> float:
    """Time of a run by the tables [s]."""
    pump = cast(PumpScene, scene)
    mode = _MODE + price(CASING_RUNGS, pump.casing.rung)
    per_step = _CASING_FIXED + mode * len(pump.casing.modes) + price(DRIVE_RUNGS, pump.drive.rung)
    per_step += _REACH * _reaches(pump)
    for throw in range(len(pump.throws)):
        per_step += _MECHANISM + price(ROD_RUNGS, pump.rod.rung)
        per_step += price(PRESSURE_RUNGS, pump.pressures(throw).rung)
        for part in joint_parts(pump, throw):
            per_step += price(JOINT_RUNGS, "ideal" if part is None else part.rung)
    return 1e-9 * per_step * pump_steps(pump)


def _reaches(pump: PumpScene) -> int:
    """Number of reaches of both pipes at the step of the run; 0 without waves."""
    lines = lines_of(pump, sample_step(pump))
    return 0 if lines is None else int(lines.pipes["reaches"].sum())
