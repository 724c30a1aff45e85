"""Rungs of each effect, as tables from the cheapest to the best.

A rung is one row: a name, what it assumes, where it comes from, what it costs, and when it is
not valid, with the cure. The kernels choose by the codes that go with the names; nothing else
knows which rungs there are.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from .crank_setup import (
    contact_table,
    hydraulics_of,
    joint_loads,
    joint_parts,
    joint_rungs,
    penetration_under,
)
from .hydraulics import PRESSURE_HEADS, lowest_pressure
from .integrate import Status
from .pump_parts import Guide, PumpScene, RevoluteJoint
from .slider_crank import JOINT_COMPLIANT, OVERLAP_LIMIT


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One rung of an effect.

    Attributes
    ----------
    name : str
        As in the scene.
    assumes : str
        The model in one line.
    reference : str
        Source.
    nanoseconds_per_step : float
        Tabulated cost of the effect on one throw, on one core of a 2020s server, for ranking only.
    """

    name: str
    assumes: str
    reference: str
    nanoseconds_per_step: float


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
        reference="Earles, Wu 1973; valid while the link is in compression",
        nanoseconds_per_step=120.0,
    ),
    Rung(
        name="compliant",
        assumes="free flight and the contact law's force, with friction, in the clearance circle",
        reference="Xia et al. 2017, eqs 1-15 with their signs mended",
        nanoseconds_per_step=140.0,
    ),
)
"""Rungs of crank pin and wrist pin; a guide has the first and the last."""

PRESSURE_RUNGS = (
    Rung(
        name="none",
        assumes="no pressure",
        reference="",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="constant",
        assumes="a plunger against a constant pressure",
        reference="",
        nanoseconds_per_step=1.0,
    ),
    Rung(
        name="two-level",
        assumes="suction and discharge pressure by turns",
        reference="quasi-static limit of the rung above",
        nanoseconds_per_step=20.0,
    ),
    Rung(
        name="heads",
        assumes="incompressible liquid: energy balance of the lines, liquid inertia as added mass",
        reference="Xia et al. 2017, eqs 16-27 with their misprints mended",
        nanoseconds_per_step=30.0,
    ),
    Rung(
        name="chamber",
        assumes="compressible chamber with air and vapour, self-acting valves, leaks",
        reference="Westphal 1893 for the plates' displacement; Hosea, Shampine 1996 for the solver",
        nanoseconds_per_step=350.0,
    ),
)
"""Rungs of the cylinder pressure."""

DRIVE_RUNGS = (
    Rung(
        name="constant-speed",
        assumes="the crank turns evenly whatever it carries",
        reference="",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="motor",
        assumes="asynchronous motor and flywheel: the speed gives way",
        reference="Kloss 1929",
        nanoseconds_per_step=30.0,
    ),
)
"""Rungs of the drive."""

LADDERS = {"joint": JOINT_RUNGS, "pressure": PRESSURE_RUNGS, "drive": DRIVE_RUNGS}
"""Effect -> its rungs. A new rung is one row, its code in the kernel, and one test."""


def joint_faults(scene: PumpScene) -> list[str]:
    """Joints whose rung needs a clearance and has none, with the cure."""
    return [
        f"{path}.rung = '{part.rung}' needs a clearance > 0 m; "
        f"set {path}.rung = 'ideal' for a joint without one"
        for throw, path, part in _joints(scene)
        if part.rung != "ideal" and part.clearance_radial == 0
    ]


def _joints(scene: PumpScene) -> Iterator[tuple[int, str, RevoluteJoint | Guide]]:
    """Throw, path and part of every joint that is given, those of the scene's own tables once."""
    for throw, own in enumerate(scene.throws):
        if throw > 0 and own.joint is None and scene.throws[0].joint is None:
            continue
        where = "joint" if own.joint is None else f"throws.{throw}.joint"
        names = ("crankpin", "wristpin", "guide")
        for name, part in zip(names, joint_parts(scene, throw), strict=True):
            if part is not None:
                yield throw, f"{where}.{name}", part


_UNRESOLVED = 4.0
"""Static penetration under the ideal joint's largest force, over the radial clearance: beyond it
the joint is a spring in which a gap of this size makes no difference."""


def limits(scene: PumpScene) -> list[tuple[Status, str]]:
    """What of a scene is beyond the validity of its rungs: status, and a fault with its cure.

    Parameters
    ----------
    scene : PumpScene
        Without faults otherwise.

    Returns
    -------
    list of (Status, str)
        Empty where every rung is valid.
    """
    checks: tuple[Callable[[PumpScene], list[tuple[Status, str]]], ...] = (_unresolved, _torn)
    return [found for check in checks for found in check(scene)]


def _unresolved(scene: PumpScene) -> list[tuple[Status, str]]:
    found = []
    for throw, path, part in _joints(scene):
        joint = ("crankpin", "wristpin", "guide").index(path.rpartition(".")[2])
        if joint_rungs(scene, throw)[joint] != JOINT_COMPLIANT:
            continue
        load = joint_loads(scene, throw)[joint]
        gap = part.clearance_radial
        depth = penetration_under(contact_table(scene, throw)[joint], load)
        if _UNRESOLVED * gap < depth <= OVERLAP_LIMIT * _size(part):
            text = (
                f"{path}: radial clearance = {gap:.3g} m must be >= {depth / _UNRESOLVED:.3g} m, a "
                f"quarter of the penetration under {load:.3g} N, for the contact to resolve it; "
                f"raise its stiffness, or set {path}.rung = 'ideal'"
            )
            found.append((Status.UNRESOLVED, text))
    return found


def _size(part: RevoluteJoint | Guide) -> float:
    """Length that an overlap is measured against: pin radius, half height of a guided part."""
    return (part.height if isinstance(part, Guide) else part.pin_diameter) / 2


def _torn(scene: PumpScene) -> list[tuple[Status, str]]:
    """Throws whose liquid column would tear: the rung heads has no vapour."""
    found = []
    for throw in range(len(scene.throws)):
        liquid = hydraulics_of(scene, throw)[0]
        if liquid["rung"] != PRESSURE_HEADS:
            continue
        lowest = lowest_pressure(liquid)
        if lowest < liquid["vapour"]:
            text = (
                f"pressure: the piston needs {lowest:.4g} Pa at its lowest, must be >= the "
                f"liquid's vapour pressure = {liquid['vapour']:.4g} Pa gauge; set pressure.rung = "
                "'chamber', shorten pressure.suction_line.length, or lower the speed"
            )
            found.append((Status.VAPOUR, text))
    return found
