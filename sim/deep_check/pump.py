"""Deep check of a reciprocating pump: its figures beside what is usual."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mechanism.layout import JOINT_COMPLIANT
from ..parts.units import STANDARD_GRAVITY
from ..pump.validity import pump_step
from ..pump_setup.contacts import contact_frequency, contact_table, penetration_under
from ..pump_setup.ideal_motion import joint_loads
from ..pump_setup.joints import joint_parts, joint_rungs
from ..pump_setup.yielding import bearing_mass_ratios
from ..scene.plausibility import largest_deflection, modal_mass
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import STANDARD_ATMOSPHERE
from .rows import RECORDING, Quantity, ShortRun, trial

_JOINTS = ("crankpin", "wristpin", "guide")
_TURNS = 6.0  # of the trial: after settling every revolution is much like the last
_SECONDS = 4.0  # tabulated, of the trial
_HARD = 0.1  # of the hardest impact of a run: what is slower is a bounce that dies down


@dataclass(frozen=True, kw_only=True)
class PumpFacts:
    """A pump and a short run of it.

    Attributes
    ----------
    scene : PumpScene
    trial : Trial
    """

    scene: PumpScene
    trial: ShortRun


def pump_facts(scene: PumpScene) -> PumpFacts:
    """Run six revolutions of a pump; of one that stands, its test as written."""
    turns = _TURNS if scene.running else scene.duration * scene.drive.speed
    return PumpFacts(
        scene=scene,
        trial=trial(scene, turns=turns, seconds=_SECONDS, truth=scene.running),
    )


# --- mechanism and liquid


def _running(measure: Callable[[PumpFacts], dict[str, float]]) -> Callable[[Any], dict[str, float]]:
    """Of a pump that turns; nothing else."""
    return lambda facts: measure(facts) if facts.scene.running else {}


def _piston_speed(facts: PumpFacts) -> dict[str, float]:
    return {"": 4 * facts.scene.crank.radius * facts.scene.drive.speed}


def _crank_ratio(facts: PumpFacts) -> dict[str, float]:
    return {"": facts.scene.crank.radius / facts.scene.rod.length}


def _pumping(scene: PumpScene) -> bool:
    pumping = scene.pressure.rung not in ("none", "constant")
    return pumping and scene.piston.diameter > 0


def _suction(facts: PumpFacts) -> dict[str, float]:
    if not _pumping(facts.scene):
        return {}
    return {"": 1e-5 * (facts.scene.pressure.suction + STANDARD_ATMOSPHERE)}


def _pressure_ratio(facts: PumpFacts) -> dict[str, float]:
    if not _pumping(facts.scene):
        return {}
    part = facts.scene.pressure
    absolute = part.suction + STANDARD_ATMOSPHERE
    if absolute <= 0:
        return {"": math.inf}
    return {"": (part.discharge + STANDARD_ATMOSPHERE) / absolute}


def _shaking(facts: PumpFacts) -> dict[str, float]:
    """Peak of the first two orders of what all throws' masses do along the stroke, over weight.

    ``m r omega^2 (cos phi + (r / l) cos 2 phi)``, with half of the rod on the piston.
    """
    scene = facts.scene
    if not scene.casing.modes:
        return {}
    angle = np.linspace(0, math.tau, 720, endpoint=False)
    ratio = scene.crank.radius / scene.rod.length
    swing = np.zeros_like(angle)
    for throw in scene.throws:
        own = angle + throw.phase
        swing += np.cos(own) + ratio * np.cos(2 * own)
    moving = scene.piston.mass + scene.rod.mass / 2
    force = moving * scene.crank.radius * (math.tau * scene.drive.speed) ** 2
    return {"": force * float(np.abs(swing).max()) / _weight(scene)}


def _cavitating(facts: PumpFacts) -> dict[str, float]:
    numerics = facts.trial.solution.numerics
    return {"": float(numerics["cavitating_share"])} if "cavitating_share" in numerics else {}


# --- joints


def _joints(scene: PumpScene) -> Iterator[tuple[str, int, int, Any]]:
    """Name, throw, number and part of every joint with a clearance; equal throws once."""
    seen: list[Any] = []
    for throw in range(len(scene.throws)):
        own = scene.joints(throw)
        if own in seen:
            continue
        seen.append(own)
        for joint, part in enumerate(joint_parts(scene, throw)):
            if part is not None and part.rung != "ideal":
                suffix = f" {throw + 1}" if len(seen) > 1 else ""
                yield f"{_JOINTS[joint]}{suffix}", throw, joint, part


def _size(part: Any) -> float:
    return float(getattr(part, "pin_diameter", None) or part.height)


def _relative_clearance(facts: PumpFacts) -> dict[str, float]:
    return {
        name: 1e3 * 2 * part.clearance_radial / _size(part)
        for name, _, _, part in _joints(facts.scene)
    }


def _worn(facts: PumpFacts) -> dict[str, float]:
    scene = facts.scene
    limits = {"crankpin": scene.wear, "wristpin": scene.wear_wristpin}
    return {
        name: 2 * part.clearance_radial / limit.condemning
        for name, _, joint, part in _joints(scene)
        if (limit := limits.get(_JOINTS[joint])) is not None
    }


def _pin_pressure(facts: PumpFacts, joint: int) -> dict[str, float]:
    """Over diameter times length, which is taken as the diameter where no law gives it."""
    scene = facts.scene
    loads = [joint_loads(scene, throw)[joint] for throw in range(len(scene.throws))]
    part = joint_parts(scene, int(np.argmax(loads)))[joint]
    if part is None:
        return {}
    diameter = _size(part)
    return {"": 1e-6 * max(loads) / (diameter * (part.contact_length or diameter))}


def _rubbing(facts: PumpFacts) -> dict[str, float]:
    return {"": math.pi * facts.scene.joint.crankpin.pin_diameter * facts.scene.drive.speed}


def _compliant(scene: PumpScene) -> Iterator[tuple[str, float, float, Any]]:
    """Name, penetration under the largest force without clearance, that force, part."""
    for name, throw, joint, part in _joints(scene):
        if joint_rungs(scene, throw)[joint] == JOINT_COMPLIANT:
            load = joint_loads(scene, throw)[joint]
            record = contact_table(scene, throw)[joint]
            yield name, penetration_under(record, load), load, part


def _sunk(facts: PumpFacts) -> dict[str, float]:
    return {name: depth / part.clearance_radial for name, depth, _, part in _compliant(facts.scene)}


def _overlap(facts: PumpFacts) -> dict[str, float]:
    return {name: depth / (_size(part) / 2) for name, depth, _, part in _compliant(facts.scene)}


def _contact_steps(facts: PumpFacts) -> dict[str, float]:
    frequency = contact_frequency(facts.scene)
    return {"": math.tau / frequency / pump_step(facts.scene)} if frequency > 0 else {}


def _tension(facts: PumpFacts) -> dict[str, float]:
    numerics = facts.trial.solution.numerics
    return {"": float(numerics["tension_share"])} if "tension_share" in numerics else {}


# --- impacts


def closing_speeds(
    offset: NDArray[np.float64], clearance: float, sample_rate: float
) -> NDArray[np.float64]:
    """Speeds at which a pin meets its eye.

    Parameters
    ----------
    offset : numpy.ndarray [shape=(n, 2)]
        Of the pin's centre from the eye's [m].
    clearance : float
        Radial [m].
    sample_rate : float
        [Hz]

    Returns
    -------
    numpy.ndarray [shape=(n_impacts,)]
        Radial, over the last sample before contact and the first in it: somewhat low of a contact
        that is stiff at this rate [m/s].

    Examples
    --------
    >>> fall = np.column_stack([np.array([0.0, 0.4, 0.8, 1.2, 0.8, 0.4]), np.zeros(6)])
    >>> closing_speeds(1e-4 * fall, 1e-4, 1e3).round(6).tolist()
    [0.04]
    """
    radius = np.hypot(*offset.T)
    inside = radius > clearance
    first = np.flatnonzero(~inside[:-1] & inside[1:]) + 1
    before = first[first >= 2]  # flight before contact has no elastic part in it
    flown = np.maximum(radius[before - 1] - radius[before - 2], radius[before] - radius[before - 1])
    return np.asarray(sample_rate * flown)


def _impacts(facts: PumpFacts) -> dict[str, NDArray[np.float64]]:
    """Closing speeds of crank pin and wrist pin of the first throw of a kind."""
    run = facts.trial
    if not run.ok or not facts.scene.running:
        return {}
    found = {}
    for name, throw, joint, part in _joints(facts.scene):
        if joint > 1 or joint_rungs(facts.scene, throw)[joint] != JOINT_COMPLIANT:
            continue
        suffix = f"_{throw + 1}" if throw else ""
        offset = run.solution.truth[("pin_offset_m", "wrist_offset_m")[joint] + suffix]
        rate = run.solution.sample_rate
        found[name] = closing_speeds(offset, part.clearance_radial, rate)
    return found


def _impact_count(facts: PumpFacts) -> dict[str, float]:
    turns = facts.trial.scene.duration * facts.scene.drive.speed
    return {
        name: float(np.count_nonzero(speeds > _HARD * speeds.max(initial=0.0))) / turns
        for name, speeds in _impacts(facts).items()
    }


def _approach(facts: PumpFacts) -> dict[str, float]:
    found = _impacts(facts).items()
    return {name: float(speeds.max()) for name, speeds in found if speeds.size}


# --- casing


def _weight(scene: PumpScene) -> float:
    """Of what the liveliest casing mode moves [N], the light end of the casing's weight."""
    return min(modal_mass(mode) for mode in scene.casing.modes) * STANDARD_GRAVITY


def _mass_ratio(facts: PumpFacts) -> dict[str, float]:
    scene = facts.scene
    if not scene.casing.modes:
        return {}
    moving = len(scene.throws) * (scene.piston.mass + scene.rod.mass)
    return {"": _weight(scene) / STANDARD_GRAVITY / moving}


def _bearing_mass(facts: PumpFacts) -> dict[str, float]:
    return bearing_mass_ratios(facts.scene)


def _force_ratio(facts: PumpFacts) -> dict[str, float]:
    numerics = facts.trial.solution.numerics
    if not facts.scene.casing.modes or "peak_normal_force_n" not in numerics:
        return {}
    return {"": float(numerics["peak_normal_force_n"]) / _weight(facts.scene)}


def _deflection(facts: PumpFacts) -> dict[str, float]:
    found = largest_deflection(facts.scene)
    return {} if found is None else {f"{found[1]} by {found[0]}": 1e6 * found[2]}


def _modes(facts: PumpFacts) -> dict[str, float]:
    return {f"mode {i}": mode.frequency for i, mode in enumerate(facts.scene.casing.modes)}


def _first_mode(facts: PumpFacts) -> dict[str, float]:
    found = _modes(facts).values()
    return {"": min(found) / facts.scene.drive.speed} if found else {}


def _band(facts: PumpFacts) -> dict[str, float]:
    half = facts.scene.sample_rate / 2
    return {name: hertz / half for name, hertz in _modes(facts).items()}


def _casing_damping(facts: PumpFacts) -> dict[str, float]:
    modes = facts.scene.casing.modes
    return {f"mode {i}": 100 * mode.damping_ratio for i, mode in enumerate(modes)}


PUMP_ROWS = (
    Quantity(
        name="mean piston speed",
        unit="m/s",
        measure=_running(_piston_speed),
        least=0.1,
        most=2.0,
        reason="0.3 to 1.5 of plunger and mud pumps",
        low="check drive.speed (rpm or rev/s) and crank.radius (half the stroke)",
        high="lower drive.speed (rpm or rev/s?) or crank.radius (half the stroke, not all of it)",
    ),
    Quantity(
        name="crank radius over rod length",
        unit="",
        measure=_crank_ratio,
        least=0.1,
        most=0.35,
        reason="1/6 to 1/3: a shorter rod loads the guide",
        low="check rod.length and crank.radius",
        high="lengthen rod.length, or check that crank.radius is half the stroke",
    ),
    Quantity(
        name="suction pressure, absolute",
        unit="bar",
        measure=_suction,
        least=0.2,
        most=30.0,
        reason="8 m of suction lift to a boosted suction; scenes give gauge pressures",
        low="raise pressure.suction, or check that it is a gauge pressure",
        high="lower pressure.suction, or check its unit",
    ),
    Quantity(
        name="pressure ratio, absolute",
        unit="",
        measure=_pressure_ratio,
        least=1.3,
        most=1000.0,
        reason="bilge pumps 3 to 10, plunger and mud pumps 30 to 300",
        low="raise pressure.discharge, or check the units of both pressures",
        high="lower pressure.discharge, or check the units of both pressures",
    ),
    Quantity(
        name="time with vapour in a cylinder",
        unit="",
        measure=_cavitating,
        most=0.01,
        reason="a pump that cavitates does not last",
        high="raise pressure.suction, shorten or widen pressure.suction_line, or lower drive.speed",
        doubt="the suction cavitates",
    ),
    Quantity(
        name="crank pin, projected pressure",
        unit="MPa",
        measure=_running(lambda facts: _pin_pressure(facts, 0)),
        least=0.02,
        most=20.0,
        reason="pumps 1 to 10, engines to 35; length as the diameter where none is given",
        low="lower joint.crankpin.pin_diameter, or check piston.diameter and the pressures",
        high="raise joint.crankpin.pin_diameter, or check piston.diameter and the pressures",
    ),
    Quantity(
        name="wrist pin, projected pressure",
        unit="MPa",
        measure=_running(lambda facts: _pin_pressure(facts, 1)),
        least=0.05,
        most=40.0,
        reason="5 to 30, twice a crank pin's; length as the diameter where none is given",
        low="lower joint.wristpin.pin_diameter, or check piston.diameter and the pressures",
        high="raise joint.wristpin.pin_diameter, or check piston.diameter and the pressures",
    ),
    Quantity(
        name="crank pin, rubbing speed",
        unit="m/s",
        measure=_running(_rubbing),
        least=0.05,
        most=8.0,
        reason="0.5 to 3 of pumps, engines to 10",
        low="check drive.speed and joint.crankpin.pin_diameter",
        high="lower drive.speed or joint.crankpin.pin_diameter",
    ),
    Quantity(
        name="clearance over pin, diametral",
        unit="per mille",
        measure=_relative_clearance,
        least=0.3,
        most=6.0,
        reason="0.5 to 2 new, renewed at 2 to 5",
        low="raise the joint's clearance, or set its rung to 'ideal'",
        high="lower the joint's clearance (diametral, or radial?), or check its unit",
    ),
    Quantity(
        name="clearance over renewal limit",
        unit="",
        measure=_worn,
        most=1.0,
        reason="beyond its [wear] limit a joint is renewed",
        high="lower the joint's clearance, or raise condemning_diametral of its [wear] table",
    ),
    Quantity(
        name="contact resolution",
        unit="steps per period",
        measure=_contact_steps,
        least=12.0,
        reason="21 by default; at 12 a contact turns too slowly by 6e-4",
        low="shorten numerics.step, or leave it out",
    ),
    Quantity(
        name="penetration over clearance",
        unit="",
        measure=_sunk,
        least=1e-3,
        most=2.0,
        reason="under the load without clearance; from 4 on the gap makes no difference",
        low="lower the joint's stiffness: oil film, bush and web in series give 100 to 5000 MN/m",
        high="raise the joint's stiffness (100 to 5000 MN/m), or set its rung to 'ideal'",
    ),
    Quantity(
        name="penetration over pin radius",
        unit="",
        measure=_overlap,
        most=0.01,
        reason="the contact laws end at 0.1",
        high="raise the joint's stiffness (100 to 5000 MN/m)",
    ),
    Quantity(
        name="impacts per revolution",
        unit="",
        measure=_impact_count,
        least=0.5,
        most=20.0,
        reason="two load reversals, each with bounces; those above a tenth of the hardest count",
        low="no reversal, no knock: rung 'link' says as much for less; or check the suction",
        high="raise damping of the contact, or lower its clearance: it rattles",
    ),
    Quantity(
        name="approach speed of an impact",
        unit="m/s",
        measure=_approach,
        least=5e-4,
        most=0.5,
        reason="hard steel yields from 0.1 on",
        low="raise the clearance, or set the rung to 'link'",
        high="lower the clearance or drive.speed: metal would be hammered flat",
    ),
    Quantity(
        name="link in tension",
        unit="of the steps",
        measure=_tension,
        most=0.0,
        reason="the rung 'link' never loses contact",
        high="set the joint's rung to 'compliant'",
        doubt="link is in tension",
    ),
    Quantity(
        name="casing mass over moving mass",
        unit="",
        measure=_mass_ratio,
        least=5.0,
        reason="5 to 30 and more; lightest casing mode over all pistons and rods",
        low="lower the shapes of casing.modes: near 1 over the square root of the mass that moves; "
        "a casing that light gives way to knocks: casing.rung = 'yielding'",
        doubt="light casing",
    ),
    Quantity(
        name="casing at bearing over moving mass",
        unit="",
        measure=_bearing_mass,
        least=1.0,
        reason="2 to 100; below 40 one that yields is quieter than one at rest, by decibels",
        low="lower the shapes of casing.modes at bearing_x and bearing_y",
    ),
    Quantity(
        name="peak pin force over casing weight",
        unit="",
        measure=_force_ratio,
        least=0.05,
        most=25.0,
        reason="1 to 10; it is shared with the cylinder within the frame",
        low="check the unit of casing shapes, or of the pressures",
        high="lower the shapes of casing.modes (a heavier casing), or check the pressures",
    ),
    Quantity(
        name="shaking force over casing weight",
        unit="",
        measure=_running(_shaking),
        most=2.0,
        reason="masses of all throws, two orders; above 1 a pump lifts unless bolted down",
        high="lower drive.speed or piston.mass, balance the throws' phases, or a heavier casing",
    ),
    Quantity(
        name="casing deflection, static",
        unit="um",
        measure=_deflection,
        least=0.1,
        most=100.0,
        reason="hundredths of a millimetre under the largest force",
        low="lower the frequencies of casing.modes, or check their shapes (kg^-0.5)",
        high="raise the frequencies of casing.modes, or lower their shapes",
        doubt="soft casing",
    ),
    Quantity(
        name="first casing mode over speed",
        unit="",
        measure=_running(_first_mode),
        least=3.0,
        reason="10 to 50 bolted down; below 3 it meets the large first orders",
        low="raise the lowest frequency of casing.modes (Hz, not rpm), or lower drive.speed",
    ),
    Quantity(
        name="casing mode over half the rate",
        unit="",
        measure=_band,
        most=1.0,
        reason="a mode above moves nothing that is recorded",
        high="raise sample_rate, leave that mode out, or check its unit",
        doubt="modes outside",
    ),
    Quantity(
        name="casing damping",
        unit="% of critical",
        measure=_casing_damping,
        least=0.2,
        most=12.0,
        reason="0.5 to 5 of bolted iron, more on rubber",
        low="raise the mode's damping_ratio: 0.02, not 2e-4",
        high="lower the mode's damping_ratio: 0.02, not 2",
    ),
    *RECORDING,
)
"""Every figure of a pump. A new one is one function and one row."""
