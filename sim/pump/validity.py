"""Validity checks of a pump's rungs and steps: clearances, penetrations, torn columns, steps."""

import math
from collections.abc import Callable, Iterator

from ..mechanism.layout import JOINT_COMPLIANT, OVERLAP_LIMIT
from ..output.status import Status
from ..piping.pipe import FEWEST_REACHES
from ..pump_setup.contacts import (
    bore_table,
    contact_frequency,
    contact_rate,
    contact_table,
    penetration_under,
)
from ..pump_setup.ideal_motion import joint_loads, largest_bearing_load
from ..pump_setup.joints import JOINT_CODES, joint_parts
from ..pump_setup.rods import buckling_load
from ..pump_setup.yielding import guide_gain
from ..scene.pump import PumpScene
from ..scene.pump_joints import OILED_RUNGS, Guide, RevoluteJoint
from .tearing import torn_by_knocks, torn_in_motion

STEP_PER_CONTACT_TIME = 0.3
"""Default step times the contact's fastest angular frequency: 21 steps per contact period."""

STEP_PER_STARVED_CONTACT_TIME = 0.15
"""The same for a pin flying into a thin film, which is no event that cuts the step."""

STEP_PER_CONTACT_DECAY = 0.7
"""Default step times the contact's fastest decay, if its damping is above critical."""

LARGEST_STEP_PER_CONTACT_TIME = 1.0
"""Largest step over the contact's time constant: Runge-Kutta 4 is stable up to 2.8
but no longer accurate."""


def joint_faults(scene: PumpScene) -> list[str]:
    """Joints that lack a needed clearance, and guides moving against their bearing."""
    tight = [
        f"{path}.rung = '{part.rung}' needs a clearance > 0 m; "
        f"set {path}.rung = 'ideal' for a joint without one"
        for throw, path, part in _joints(scene)
        if part.rung != "ideal" and part.clearance_radial == 0
    ]
    return [*tight, *_opposed(scene)]


def _opposed(scene: PumpScene) -> list[str]:
    """Find a guide that moves against a bearing which carries it: one would excite the other."""
    gain = 0.0 if scene.casing.rung != "yielding" else guide_gain(scene)
    if gain >= _MOST_OPPOSED:
        return []
    return [
        f"casing.modes: guide_y moves against bearing_y by {gain:.3g} of it under the guided mass, "
        f"must be >= {_MOST_OPPOSED:g} with casing.rung = 'yielding', whose guide moves with the "
        "bearing; check the signs of the shapes, or set casing.rung = 'driven'"
    ]


_MOST_OPPOSED = -0.25  # a bilge pump was stable with -0.24 and unstable with -0.48


def _joints(scene: PumpScene) -> Iterator[tuple[int, str, RevoluteJoint | Guide]]:
    """Throw, path and part of every joint given, those of the scene's own tables once."""
    for throw, own in enumerate(scene.throws):
        if throw > 0 and own.joint is None and scene.throws[0].joint is None:
            continue
        where = "joint" if own.joint is None else f"throws.{throw}.joint"
        names = ("crankpin", "wristpin", "guide")
        for name, part in zip(names, joint_parts(scene, throw), strict=True):
            if part is not None:
                yield throw, f"{where}.{name}", part
    if scene.crank.bearing is not None:
        yield 0, _BEARING, scene.crank.bearing


_BEARING = "crank.bearing"


_UNRESOLVED = 4.0
"""Largest static penetration under the ideal joint's largest force, over the radial clearance:
above it, the clearance has no effect on the joint."""


def limits(scene: PumpScene) -> list[tuple[Status, str]]:
    """Violations of the validity of a scene's rungs: status, and fault with cure.

    Parameters
    ----------
    scene : PumpScene
        A scene without other faults.

    Returns
    -------
    list of (Status, str)
        Empty if every rung is valid.
    """
    checks: tuple[Callable[[PumpScene], list[tuple[Status, str]]], ...] = (
        _penetrations,
        _slender,
        _torn,
        _too_long,
        _too_short,
    )
    return [found for check in checks for found in check(scene)]


def knock_limits(scene: PumpScene) -> list[tuple[Status, str]]:
    """Violations that only a trial run shows, after :func:`limits`, in the same form.

    Parameters
    ----------
    scene : PumpScene

    Returns
    -------
    list of (Status, str)
        Also empty if the step is too long, which prevents a trial.
    """
    steps = math.ceil(1 / (scene.sample_rate * pump_step(scene)) - 1e-9)
    if steps > MOST_STEPS:
        return []
    step = 1 / (scene.sample_rate * max(FEWEST_STEPS, steps))
    return [(Status.VAPOUR, tear.text) for tear in torn_by_knocks(scene, step)]


def _penetrations(scene: PumpScene) -> list[tuple[Status, str]]:
    """Contacts too soft for their load: beyond their law, or unable to resolve their clearance."""
    found = []
    for throw, path, part in _joints(scene):
        if JOINT_CODES[part.rung] < JOINT_COMPLIANT:
            continue
        if path == _BEARING:
            load, contact = largest_bearing_load(scene), bore_table(scene)[0]
        else:
            joint = ("crankpin", "wristpin", "guide").index(path.rpartition(".")[2])
            load = joint_loads(scene, throw)[joint]
            contact = contact_table(scene, throw)[joint]
        depth = penetration_under(contact, load)
        found += [*_overlaps(path, part, depth, load), *_unresolved(path, part, depth, load)]
    return found


def _overlaps(
    path: str, part: RevoluteJoint | Guide, depth: float, load: float
) -> list[tuple[Status, str]]:
    size, what = _size(part)
    most = OVERLAP_LIMIT * size
    if depth <= most:
        return []
    text = (
        f"{path}: penetration under {load:.3g} N = {depth:.3g} m must be <= {most:.3g} m, "
        f"{OVERLAP_LIMIT:g} of {what}, where the contact law ends; "
        f"raise its stiffness, or set {path}.rung = 'ideal'"
    )
    return [(Status.OVERLAP, text)]


def _unresolved(
    path: str, part: RevoluteJoint | Guide, depth: float, load: float
) -> list[tuple[Status, str]]:
    gap = part.clearance_radial
    if depth <= _UNRESOLVED * gap:
        return []
    text = (
        f"{path}: radial clearance = {gap:.3g} m must be >= {depth / _UNRESOLVED:.3g} m, a "
        f"quarter of the penetration under {load:.3g} N, for the contact to resolve it; "
        f"raise its stiffness, or set {path}.rung = 'ideal'"
    )
    return [(Status.UNRESOLVED, text)]


_MOST_OF_EULER = 0.1  # reduces a rod's bending frequency to 0.95, which is neglected


def _slender(scene: PumpScene) -> list[tuple[Status, str]]:
    """Elastic rods whose load would soften or buckle them, which their bending mode neglects."""
    most = _MOST_OF_EULER * buckling_load(scene)
    load = max(max(joint_loads(scene, throw)[:2]) for throw in range(len(scene.throws)))
    if load <= most:
        return []
    text = (
        f"rod: force along it = {load:.3g} N must be <= {most:.3g} N, {_MOST_OF_EULER:g} of "
        "Euler's load, beyond which it softens the bending; raise rod.section_radius or "
        "rod.section_area, or set rod.rung = 'rigid'"
    )
    return [(Status.SLENDER, text)]


def _size(part: RevoluteJoint | Guide) -> tuple[float, str]:
    """Reference length of an overlap [m], and its name."""
    if isinstance(part, Guide):
        return part.height / 2, "half the height"
    return part.pin_diameter / 2, "the pin's radius"


def _torn(scene: PumpScene) -> list[tuple[Status, str]]:
    """Throws whose liquid column would tear: the rung heads has no vapour."""
    return [(Status.VAPOUR, tear.text) for tear in torn_in_motion(scene)]


def _too_long(scene: PumpScene) -> list[tuple[Status, str]]:
    """A step set in the scene that is too long for the contact."""
    step, rate = scene.numerics.step, contact_rate(scene)
    if step is None or step * rate <= LARGEST_STEP_PER_CONTACT_TIME:
        return []
    longest = LARGEST_STEP_PER_CONTACT_TIME / rate
    text = (
        f"numerics.step = {step:g} s must be <= {longest:.3g} s, as the contact's rate is "
        f"{1 / longest:.4g} 1/s; shorten it, or lower joint.crankpin.stiffness and damping"
    )
    return [(Status.STEP, text)]


def _too_short(scene: PumpScene) -> list[tuple[Status, str]]:
    """Pipes with waves that are too short for the scene's step (Courant)."""
    step = scene.numerics.step
    return [
        (
            Status.STEP,
            f"numerics.step = {step:g} s must be <= {longest:.3g} s, in which a wave passes a "
            f"{FEWEST_REACHES}th of {path}; shorten it, or set pressure.rung = 'lumped-lines'",
        )
        for path, longest in wave_steps(scene)
        if step is not None and step > longest * (1 + _ROUNDING)
    ]


_ROUNDING = 1e-9  # tolerance for a step that divides a pipe's travel time


def wave_steps(scene: PumpScene) -> list[tuple[str, float]]:
    """Pipes that carry waves, each with its longest admissible step [s].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> piped = {"pressure.rung": "wave-lines", "pressure.suction_line.wave_speed": 1000.0,
    ...     "pressure.discharge_line.wave_speed": 1200.0}
    >>> [round(1e6 * step) for _, step in wave_steps(load_scene("bilge-pump", piped))]
    [60, 50]
    """
    pressure = scene.pressures(0)
    if pressure.rung != "wave-lines":
        return []
    lines = {"suction": pressure.suction_line, "discharge": pressure.discharge_line}
    return [
        (f"pressure.{side}_line", line.length / (FEWEST_REACHES * line.wave_speed))
        for side, line in lines.items()
        if line is not None and line.wave_speed is not None and line.length > 0
    ]


FEWEST_STEPS = 2
"""Fewest steps per sample: the casing runs once per step, and needs twice the sample rate."""

MOST_STEPS = 1000
"""Most steps per sample: a smaller step is more likely a mistake than a need of accuracy."""


def pump_step(scene: PumpScene) -> float:
    """Longest step of a pump: that of the scene, else as contact, casing and waves need [s].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(1e6 * pump_step(load_scene("bilge-pump")), 2)
    19.53
    """
    casing = 1 / FEWEST_STEPS / scene.sample_rate
    casing = min([casing, *(longest for _, longest in wave_steps(scene))])
    if scene.numerics.step is not None:
        return min(scene.numerics.step, casing)
    rate = contact_rate(scene)
    if rate == 0:
        return casing
    resolved = STEP_PER_STARVED_CONTACT_TIME if _starved(scene) else STEP_PER_CONTACT_TIME
    return min(resolved / contact_frequency(scene), STEP_PER_CONTACT_DECAY / rate, casing)


def _starved(scene: PumpScene) -> bool:
    """Whether any pin has oil that fills thin gaps only."""
    return any(
        part.rung in OILED_RUNGS and part.oil is not None and part.oil.filled_gap is not None
        for _, _, part in _joints(scene)
        if isinstance(part, RevoluteJoint)
    )


def pump_steps(scene: PumpScene) -> int:
    """Number of steps of a pump's run, including settling but not the filters' edges."""
    time = scene.duration + scene.settling_revolutions / scene.drive.speed
    return math.ceil(time * scene.sample_rate) * math.ceil(
        1 / (scene.sample_rate * pump_step(scene)) - 1e-9
    )
