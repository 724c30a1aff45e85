"""Results of a run in addition to its channels: numerics, warnings, truth."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..casing.decimation import decimate
from ..excitation.forces import Push
from ..hydraulics.valves import lift_left
from ..mechanism.crank_run import CrankRun, CrankTally
from ..mechanism.layout import (
    BOW,
    CRANK_FORCES,
    GUIDE,
    JOINT_COMPLIANT,
    JOINT_LINK,
    JOINT_OILED,
    STRETCH,
    force_column,
)
from ..output.status import Status
from ..pump_setup.contacts import contact_rate, contact_table
from ..pump_setup.films import bore_temperature, film_temperature_of
from ..pump_setup.joints import joint_rungs
from ..scene.pump import PumpScene
from ..scene.pump_joints import OILED_RUNGS
from .gathering import Gathering, has_chambers
from .run_plan import RunPlan
from .scene_run import pin_offsets
from .tearing import lowest_under_pull, torn_by_pull

_LIFT_LEFT = 0.05
"""Share of the stop's lift: a valve still open by more, late in its idle stroke, fails to close."""

_STABLE = 2.785  # step times rate of Runge-Kutta 4: stability limit on the negative real axis

_ROUGHNESS = 0.4e-6  # m, combined, of a ground pin and a bored eye, if none is given
_MOSTLY = 0.5  # of all contacts: beyond this share the floor rather than the law sets the damping

_LATE = math.radians(60.0)  # after the dead centre; a fast pump's valves close 30 degrees late


def oiled_pins(scene: PumpScene) -> NDArray[np.bool_]:
    """Whether each pin is oiled [shape=(n_throws, 2)]."""
    rungs = [joint_rungs(scene, throw)[:GUIDE] for throw in range(len(scene.throws))]
    return np.asarray(np.array(rungs) == JOINT_OILED)


def run_status(gathered: Gathering, lift: float) -> Status:
    """Status of a run: a torn liquid column, or a valve that never closes in time."""
    if torn_by_pull(gathered.plan.scene, gathered.pull):
        return Status.VAPOUR
    return Status.VALVE_OPEN if lift > _LIFT_LEFT else Status.OK


def largest_lift_left(gathered: Gathering) -> float:
    """Largest lift that recurs in every idle stroke of some free valve, over the stop's lift."""
    scene, settled = gathered.plan.scene, gathered.plan.kept.start
    lifts = gathered.lifts[settled:]
    if not len(lifts):  # no chambers, or a run that failed earlier
        return 0.0
    largest = 0.0
    for throw in np.flatnonzero(~gathered.vapour).tolist():
        # vapour keeps a suction valve open until the cylinder is refilled, for any spring
        pressure = scene.pressures(throw)
        angle = gathered.turns[settled:, 0, 0] + scene.throws[throw].phase
        sides = (("suction", pressure.suction_valve, 0), ("discharge", pressure.discharge_valve, 1))
        for side, valve, column in sides:
            if valve is None or valve.stuck_lift is not None:
                continue
            left = lift_left(angle, lifts[:, throw, column], side, valve.max_lift, after=_LATE)
            if left.size:
                largest = max(largest, float(left.min()))
    return largest


def _rung_of(part: Any) -> str:
    return "ideal" if part is None else str(part.rung)


def run_numerics(gathered: Gathering, run: CrankTally, lift: float) -> dict[str, float | int | str]:
    """Rungs, steps and what the steps resolve, by name."""
    scene = gathered.plan.scene
    steps, resolved = run.steps, run.step * contact_rate(scene)
    numerics: dict[str, float | int | str] = {
        "rung_joint": scene.joint.crankpin.rung,
        "rung_wristpin": _rung_of(scene.joint.wristpin),
        "rung_guide": _rung_of(scene.joint.guide),
        "rung_mainbearing": _rung_of(scene.crank.bearing),
        "rung_rod": scene.rod.rung,
        "rung_pressure": scene.pressure.rung,
        "rung_drive": scene.drive.rung,
        "rung_casing": scene.casing.rung,
        "contact_law": scene.joint.crankpin.law,
        "step_s": run.step,
        "steps": steps,
        "step_per_contact_time": resolved,
        "stability_margin": 1 - resolved / _STABLE,
        # share by which Runge-Kutta 4 underestimates the phase of the fastest contact
        "estimated_error": resolved**4 / 120,
        "contact_changes": run.contact_changes,
        "cuts_refused": run.cuts_refused,
        "peak_normal_force_n": run.peak_normal_force,
        "mean_speed_hz": gathered.mean_speed / (2 * math.pi),
    }
    rungs = [joint_rungs(scene, throw) for throw in range(len(scene.throws))]
    if any(JOINT_COMPLIANT in row for row in rungs) and _has_floor(scene):
        closings = max(1, run.contact_changes // 2)
        numerics["floored_share"] = run.floored_closings / closings
        numerics["speed_floor_m_s"] = max(
            float(contact_table(scene, throw)["speed_floor"][:2].min())
            for throw in range(len(scene.throws))
        )
    lowest = lowest_under_pull(scene, gathered.pull)
    if math.isfinite(lowest):
        numerics["lowest_pressure_pa"] = lowest
    if any(JOINT_LINK in row for row in rungs):
        numerics["tension_share"] = run.tension_steps / max(1, steps * len(rungs))
    if gathered.films:
        numerics |= _film_numerics(gathered)
    if has_chambers(scene):
        numerics["cavitating_share"] = run.vapour_steps / max(1, steps * len(rungs))
        numerics["lift_left"] = lift
    for side, parted in zip(("suction", "discharge"), run.parted_steps, strict=False):
        numerics[f"{side}_line_parted_share"] = parted / max(1, steps)
    if run.unsettled_steps:
        numerics["lines_unsettled_share"] = max(run.unsettled_steps) / max(1, steps)
    return numerics


def _film_numerics(gathered: Gathering) -> dict[str, float | int | str]:
    """Least film thickness, and the highest film temperature if there is a heat balance."""
    scene = gathered.plan.scene
    pins = zip(*np.nonzero(oiled_pins(scene)), strict=True)
    warm = [film_temperature_of(scene, int(throw), int(joint)) for throw, joint in pins]
    known = [each for each in (*warm, bore_temperature(scene)) if each is not None]
    return {**({"film_temperature_k": max(known)} if known else {}), **gathered.films}


def _has_floor(scene: PumpScene) -> bool:
    """Whether a contact law depends on the impact speed, and so has a speed floor."""
    parts = (scene.joint.crankpin, scene.joint.wristpin, scene.joint.guide)
    return any(
        part is not None and part.law != "kelvin-voigt" and part.restitution_speed is None
        for part in parts
    )


def run_warnings(numerics: dict[str, float | int | str]) -> tuple[str, ...]:
    """Warnings about a run that did not fail."""
    found = []
    if float(numerics.get("tension_share", 0.0)) > 0:
        found.append(
            f"contact would be lost in {float(numerics['tension_share']):.1%} of the steps: a "
            "massless link is in tension; set the joint's rung to 'compliant'"
        )
    if float(numerics.get("cavitating_share", 0.0)) > 0:
        found.append(
            f"a cylinder holds vapour in {float(numerics['cavitating_share']):.1%} of the steps: "
            "the suction cavitates"
        )
    for side in ("suction", "discharge"):
        share = float(numerics.get(f"{side}_line_parted_share", 0.0))
        if share > 0:
            found.append(
                f"the liquid column of the {side} line parts in {share:.1%} of the steps: vapour "
                "is computed only at the nodes of the line, so the pressures when it closes are "
                "those of a coarse model; raise the pressure at its far end, shorten it, or "
                "give it a damper"
            )
    if float(numerics.get("lines_unsettled_share", 0.0)) > 0:
        found.append(
            f"pump and lines agree to a thousandth of the pressure except in "
            f"{float(numerics['lines_unsettled_share']):.2%} of the steps: the remainder is "
            "corrected in the next steps; shorten numerics.step, or give the lines dampers"
        )
    if float(numerics.get("floored_share", 0.0)) > _MOSTLY:
        found.append(
            f"{float(numerics['floored_share']):.1%} of the contacts closed more slowly than "
            f"{float(numerics['speed_floor_m_s']):.3g} m/s, the floor of the contact law: they "
            "were damped less than by the law"
        )
    if int(numerics.get("clipped_samples", 0)) > 0:
        found.append(f"{numerics['clipped_samples']} samples clipped; widen the sensor's range")
    return tuple(found)


def film_warnings(scene: PumpScene, numerics: dict[str, float | int | str]) -> tuple[str, ...]:
    """Warn of films thinner than the surface roughness, if the rung has no asperities."""
    joints = (scene.joint.crankpin, scene.joint.wristpin, scene.crank.bearing)
    pins = [part for part in joints if part is not None]
    oiled = [part for part in pins if part.rung in OILED_RUNGS and part.oil is not None]
    if not oiled or any(part.rung == "mixed" for part in oiled):
        return ()
    given = [part.oil.roughness for part in oiled if part.oil and part.oil.roughness]
    rough, film = max(given, default=_ROUGHNESS), float(numerics.get("min_film_m", math.inf))
    if film >= rough:
        return ()
    return (
        f"least film of the pins = {film:.2g} m is below a roughness of {rough:.2g} m, where "
        "asperities touch; set the joint's rung to 'mixed'",
    )


def motor_warnings(scene: PumpScene, speed: NDArray[np.float64]) -> tuple[str, ...]:
    """Warn of a motor slowed beyond its breakdown moment."""
    motor = scene.drive.motor
    if scene.drive.rung != "motor" or motor is None:
        return ()
    later = speed[3 * len(speed) // 4 :]  # mean over a part, as the speed fluctuates
    last = later.mean() / math.tau
    least = scene.drive.synchronous_speed * (1 - motor.breakdown_slip)
    if last >= least:
        return ()
    return (
        f"speed at the end = {60 * last:.3g} rpm is below {60 * least:.3g} rpm, where the motor "
        "has its largest moment: it stalls; raise drive.motor.breakdown_moment or lower the load",
    )


def exciter_truth(plan: RunPlan, pushes: tuple[Push, ...]) -> dict[str, Any]:
    """Exciter forces at the sample instants [shape=(n_samples, n_exciters)] [N]."""
    if not pushes:
        return {}
    forces = np.stack([push.along for push in pushes], axis=1)
    return {"test_force_n": decimate(forces, plan.factor)[plan.kept]}


def run_truth(run: CrankRun, plan: RunPlan) -> dict[str, Any]:
    """Forces, low-passed like the signal, and states at the sample instants, per throw."""
    turned = plan.turned(plan.at_samples(run.turns[:, 0]))
    truth: dict[str, Any] = {"state_alpha": turned}
    truth["state_alpha_rate"] = plan.at_samples(run.turns[:, 1])
    throws = range(len(plan.scene.throws))
    columns = [force_column(name, throw, len(throws)) for throw in throws for name in _KEPT]
    if run.journal is not None:
        columns += [force_column(name, 0, len(throws)) for name in CRANK_FORCES]
        truth["main_bearing_offset_m"] = plan.at_samples(run.journal[:, :2])
    force = decimate(run.forces[:, [0, *columns]], plan.factor)[
        plan.kept
    ]  # only the columns needed
    truth["drive_moment_n_m"] = force[:, 0]
    if run.bore_gaps is not None:
        truth["main_bearing_gap_m"] = plan.at_samples(run.bore_gaps[:, 0])
    if run.journal is not None:
        truth["main_bearing_force_n"] = force[:, -len(CRANK_FORCES) :]
    if run.ends is not None:
        ends = plan.at_samples(run.ends)
        truth["suction_line_pressure_pa"] = ends[:, 0]
        truth["discharge_line_pressure_pa"] = ends[:, 1]
    for throw in throws:
        suffix = f"_{throw + 1}" if throw else ""
        own = force[:, 1 + len(_KEPT) * throw :]
        truth |= {
            f"{name}{suffix}": value for name, value in _throw_truth(run, plan, throw, turned, own)
        }
    return truth


_KEPT = ("pin_x", "pin_y", "wrist_x", "wrist_y", "guide_y", "piston_x")
"""Forces of a throw in the truth."""


def _throw_truth(
    run: CrankRun,
    plan: RunPlan,
    throw: int,
    turned: NDArray[np.float64],
    force: NDArray[np.float64],
) -> list[tuple[str, NDArray[np.float64]]]:
    assert run.bodies is not None  # requested with the truth
    bodies = plan.at_samples(run.bodies[:, throw])
    journal = None if run.journal is None else plan.at_samples(run.journal)
    flex = None if run.flex is None else plan.at_samples(run.flex[:, throw])
    offsets = pin_offsets(plan.scene, turned, bodies, throw, journal=journal, flex=flex)
    found = [
        ("pin_force_n", force[:, 0:2]),
        ("wrist_force_n", force[:, 2:4]),
        ("guide_force_n", force[:, 4]),
        ("piston_pressure_force_n", -force[:, 5]),  # positive towards the crank
        ("pin_offset_m", offsets[:, 0:2]),
        ("wrist_offset_m", offsets[:, 2:4]),
        ("state_piston", bodies[:, 3]),
        ("state_piston_velocity", bodies[:, 9]),
        ("state_piston_across", bodies[:, 4]),
        ("state_piston_tilt", bodies[:, 5]),
        ("state_beta", bodies[:, 2]),
        ("state_beta_rate", bodies[:, 8]),
    ]
    if flex is not None:
        found += [("rod_stretch_m", flex[:, STRETCH]), ("rod_bow_m", flex[:, BOW])]
    if run.gaps is not None:
        gaps = plan.at_samples(run.gaps[:, throw])
        rungs = joint_rungs(plan.scene, throw)
        for joint, name in enumerate(("crankpin", "wristpin")):
            if rungs[joint] == JOINT_OILED:
                found += [
                    (f"{name}_gap_m", gaps[:, joint]),
                    (f"{name}_peak_force_n", gaps[:, GUIDE + joint]),
                ]
    if run.chambers is not None:
        chamber = plan.at_samples(run.chambers[:, throw])
        found += [
            ("cylinder_pressure_pa", chamber[:, 0]),
            ("suction_lift_m", chamber[:, 2]),
            ("discharge_lift_m", chamber[:, 4]),
        ]
    return found
