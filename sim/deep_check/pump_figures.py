"""Figures of a reciprocating pump and of a short run of it, for its deep check."""

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
from .rows import ShortRun, trial

_JOINTS = ("crankpin", "wristpin", "guide")
_TURNS = 6.0  # of the trial: after settling, revolutions are similar
_SECONDS = 4.0  # tabulated time of the trial
_HARD = 0.1  # of the hardest impact of a run: slower ones are decaying bounces


@dataclass(frozen=True, kw_only=True)
class PumpFacts:
    """A pump and a short run of it.

    Attributes
    ----------
    scene : PumpScene
    trial : ShortRun
    """

    scene: PumpScene
    trial: ShortRun


def pump_facts(scene: PumpScene) -> PumpFacts:
    """Run six revolutions of a pump; for one at rest, its test as written."""
    turns = _TURNS if scene.running else scene.duration * scene.drive.speed
    return PumpFacts(
        scene=scene,
        trial=trial(scene, turns=turns, seconds=_SECONDS, truth=scene.running),
    )


# --- mechanism and liquid


def running(measure: Callable[[PumpFacts], dict[str, float]]) -> Callable[[Any], dict[str, float]]:
    """A measure that is empty for a pump at rest."""
    return lambda facts: measure(facts) if facts.scene.running else {}


def piston_speed(facts: PumpFacts) -> dict[str, float]:
    """Mean piston speed [m/s]."""
    return {"": 4 * facts.scene.crank.radius * facts.scene.drive.speed}


def crank_ratio(facts: PumpFacts) -> dict[str, float]:
    """Crank radius over rod length [-]."""
    return {"": facts.scene.crank.radius / facts.scene.rod.length}


def _pumping(scene: PumpScene) -> bool:
    pumping = scene.pressure.rung not in ("none", "constant")
    return pumping and scene.piston.diameter > 0


def suction(facts: PumpFacts) -> dict[str, float]:
    """Absolute suction pressure [bar]."""
    if not _pumping(facts.scene):
        return {}
    return {"": 1e-5 * (facts.scene.pressure.suction + STANDARD_ATMOSPHERE)}


def pressure_ratio(facts: PumpFacts) -> dict[str, float]:
    """Absolute discharge pressure over suction pressure [-]."""
    if not _pumping(facts.scene):
        return {}
    part = facts.scene.pressure
    absolute = part.suction + STANDARD_ATMOSPHERE
    if absolute <= 0:
        return {"": math.inf}
    return {"": (part.discharge + STANDARD_ATMOSPHERE) / absolute}


def shaking(facts: PumpFacts) -> dict[str, float]:
    """Peak inertia force of all throws along the stroke over the weight of the casing [-].

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


def cavitating(facts: PumpFacts) -> dict[str, float]:
    """Share of the time with vapour in a cylinder [-]."""
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


def relative_clearance(facts: PumpFacts) -> dict[str, float]:
    """Diametral clearance of each joint over its pin diameter or guide height [per mille]."""
    return {
        name: 1e3 * 2 * part.clearance_radial / _size(part)
        for name, _, _, part in _joints(facts.scene)
    }


def worn(facts: PumpFacts) -> dict[str, float]:
    """Diametral clearance of each joint over its condemning limit [-]."""
    scene = facts.scene
    limits = {"crankpin": scene.wear, "wristpin": scene.wear_wristpin}
    return {
        name: 2 * part.clearance_radial / limit.condemning
        for name, _, joint, part in _joints(scene)
        if (limit := limits.get(_JOINTS[joint])) is not None
    }


def pin_pressure(facts: PumpFacts, joint: int) -> dict[str, float]:
    """Peak load of a pin over diameter times length [MPa].

    The length is taken as the diameter if no law gives it.
    """
    scene = facts.scene
    loads = [joint_loads(scene, throw)[joint] for throw in range(len(scene.throws))]
    part = joint_parts(scene, int(np.argmax(loads)))[joint]
    if part is None:
        return {}
    diameter = _size(part)
    return {"": 1e-6 * max(loads) / (diameter * (part.contact_length or diameter))}


def rubbing(facts: PumpFacts) -> dict[str, float]:
    """Rubbing speed of the crank pin in its eye [m/s]."""
    return {"": math.pi * facts.scene.joint.crankpin.pin_diameter * facts.scene.drive.speed}


def _compliant(scene: PumpScene) -> Iterator[tuple[str, float, float, Any]]:
    """Name, penetration under the largest force without clearance, that force, part."""
    for name, throw, joint, part in _joints(scene):
        if joint_rungs(scene, throw)[joint] == JOINT_COMPLIANT:
            load = joint_loads(scene, throw)[joint]
            record = contact_table(scene, throw)[joint]
            yield name, penetration_under(record, load), load, part


def sunk(facts: PumpFacts) -> dict[str, float]:
    """Penetration of each compliant joint under the load of ideal joints over its clearance [-]."""
    return {name: depth / part.clearance_radial for name, depth, _, part in _compliant(facts.scene)}


def overlap(facts: PumpFacts) -> dict[str, float]:
    """Penetration of each compliant joint under the load of ideal joints over its radius [-]."""
    return {name: depth / (_size(part) / 2) for name, depth, _, part in _compliant(facts.scene)}


def contact_steps(facts: PumpFacts) -> dict[str, float]:
    """Steps in a period of the stiffest contact."""
    frequency = contact_frequency(facts.scene)
    return {"": math.tau / frequency / pump_step(facts.scene)} if frequency > 0 else {}


def tension(facts: PumpFacts) -> dict[str, float]:
    """Share of the steps in which a link is in tension [-]."""
    numerics = facts.trial.solution.numerics
    return {"": float(numerics["tension_share"])} if "tension_share" in numerics else {}


# --- impacts


def closing_speeds(
    offset: NDArray[np.float64], clearance: float, sample_rate: float
) -> NDArray[np.float64]:
    """Impact speeds of a pin in its eye.

    Parameters
    ----------
    offset : numpy.ndarray [shape=(n, 2)]
        Position of the pin's centre from the eye's [m].
    clearance : float
        Radial clearance [m].
    sample_rate : float
        Sampling rate [Hz].

    Returns
    -------
    numpy.ndarray [shape=(n_impacts,)]
        Radial, over the last sample before contact and the first in it [m/s]: slightly low for a
        contact that is stiff at this rate.

    Examples
    --------
    >>> fall = np.column_stack([np.array([0.0, 0.4, 0.8, 1.2, 0.8, 0.4]), np.zeros(6)])
    >>> closing_speeds(1e-4 * fall, 1e-4, 1e3).round(6).tolist()
    [0.04]
    """
    radius = np.hypot(*offset.T)
    inside = radius > clearance
    first = np.flatnonzero(~inside[:-1] & inside[1:]) + 1
    before = first[first >= 2]  # flight before contact has no elastic part
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


def impact_count(facts: PumpFacts) -> dict[str, float]:
    """Impacts of each joint per revolution."""
    turns = facts.trial.scene.duration * facts.scene.drive.speed
    return {
        name: float(np.count_nonzero(speeds > _HARD * speeds.max(initial=0.0))) / turns
        for name, speeds in _impacts(facts).items()
    }


def approach(facts: PumpFacts) -> dict[str, float]:
    """Highest closing speed of each joint [m/s]."""
    found = _impacts(facts).items()
    return {name: float(speeds.max()) for name, speeds in found if speeds.size}


# --- casing


def _weight(scene: PumpScene) -> float:
    """Smallest modal weight of the casing [N], a lower bound of the weight of the casing."""
    return min(modal_mass(mode) for mode in scene.casing.modes) * STANDARD_GRAVITY


def mass_ratio(facts: PumpFacts) -> dict[str, float]:
    """Smallest modal mass of the casing over the moving masses [-]."""
    scene = facts.scene
    if not scene.casing.modes:
        return {}
    moving = len(scene.throws) * (scene.piston.mass + scene.rod.mass)
    return {"": _weight(scene) / STANDARD_GRAVITY / moving}


def bearing_mass(facts: PumpFacts) -> dict[str, float]:
    """Mass of the casing at its bearing over the moving masses [-]."""
    return bearing_mass_ratios(facts.scene)


def force_ratio(facts: PumpFacts) -> dict[str, float]:
    """Peak pin force over the weight of the casing [-]."""
    numerics = facts.trial.solution.numerics
    if not facts.scene.casing.modes or "peak_normal_force_n" not in numerics:
        return {}
    return {"": float(numerics["peak_normal_force_n"]) / _weight(facts.scene)}


def deflection(facts: PumpFacts) -> dict[str, float]:
    """Largest static deflection of the casing [um], with its mode and force."""
    found = largest_deflection(facts.scene)
    return {} if found is None else {f"{found[1]} by {found[0]}": 1e6 * found[2]}


def _modes(facts: PumpFacts) -> dict[str, float]:
    return {f"mode {i}": mode.frequency for i, mode in enumerate(facts.scene.casing.modes)}


def first_mode(facts: PumpFacts) -> dict[str, float]:
    """Lowest casing frequency over the shaft speed [-]."""
    found = _modes(facts).values()
    return {"": min(found) / facts.scene.drive.speed} if found else {}


def band(facts: PumpFacts) -> dict[str, float]:
    """Casing frequencies over half the sample rate [-]."""
    half = facts.scene.sample_rate / 2
    return {name: hertz / half for name, hertz in _modes(facts).items()}


def casing_damping(facts: PumpFacts) -> dict[str, float]:
    """Damping ratio of each casing mode [% of critical]."""
    modes = facts.scene.casing.modes
    return {f"mode {i}": 100 * mode.damping_ratio for i, mode in enumerate(modes)}
