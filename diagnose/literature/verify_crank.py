"""Literature checks of the crank mechanism: the ideal crank, and a slider in clearance."""

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np

from ...sim.contact.closed_forms import IdealCrank
from ...sim.contact.law import CONTACT
from ...sim.hydraulics.parameters import HYDRAULIC
from ...sim.mechanism.crank_run import CrankRun, run_mechanism
from ...sim.mechanism.layout import (
    BODY,
    GUIDE,
    JOINT_COMPLIANT,
    MAIN_BEARING,
    ROD_MODES,
    THROW,
    Machine,
    Tables,
)
from ...sim.mechanism.oiled_joint import OIL
from ...sim.pump_setup.ideal_motion import ideal_motion
from ...sim.scene.load import load_scene
from ...sim.scene.pump import PumpScene

_ANGLES = 36_001  # steps of 0.01 degree: a maximum is missed by less than 1e-7 of itself


@cache
def _benchmark_crank() -> IdealCrank:
    scene = load_scene("slider-crank-benchmark")
    assert isinstance(scene, PumpScene)  # a built-in scene of that machine
    return ideal_motion(scene, np.linspace(0.0, 2 * math.pi, _ANGLES))


def _stroke() -> float:
    return float(np.ptp(_benchmark_crank().piston))


def _largest_piston_speed() -> float:
    return float(np.abs(_benchmark_crank().piston_velocity).max())


def _least_piston_acceleration() -> float:
    return float(_benchmark_crank().piston_acceleration.min())


def _largest_piston_acceleration() -> float:
    return float(_benchmark_crank().piston_acceleration.max())


def _largest_crank_pin_force() -> float:
    crank = _benchmark_crank()
    return float(np.hypot(crank.pin_force_x, crank.pin_force_y).max())


def _largest_wrist_pin_force() -> float:
    crank = _benchmark_crank()
    return float(np.hypot(crank.wrist_force_x, crank.wrist_force_y).max())


def _largest_guide_force() -> float:
    return float(np.abs(_benchmark_crank().guide_force).max())


def _largest_crank_moment() -> float:
    return float(np.abs(_benchmark_crank().crank_moment).max())


def one_throw(numbers: dict[str, float], contacts: dict[int, np.void], **machine: float) -> Tables:
    """Tables of one throw without pressure; values not given are zero."""
    throws, table = np.zeros(1, THROW), np.zeros((1, 3), CONTACT)
    table["friction_speed"] = table["speed_floor"] = 1.0  # an unused record divides by neither
    for name, value in numbers.items():
        throws[name] = value
    for joint, contact in contacts.items():
        table[0, joint] = contact
    shared = Machine(**{**dict.fromkeys(Machine._fields, 0.0), **machine})
    return Tables(
        throws=throws,
        contacts=table,
        liquid=np.zeros(1, HYDRAULIC),
        oils=np.zeros((1, 2), OIL),
        maps=np.zeros(1),
        bearing=np.zeros(0, MAIN_BEARING),
        bore=np.zeros(0, CONTACT),
        bore_oil=np.zeros(0, OIL),
        flex=np.zeros(0, ROD_MODES),
        machine=shared,
    )


@cache
def _loose_slider() -> CrankRun:
    """Slider-crank whose slider has clearance in its guide, for the 2 ms before it touches."""
    half_rod = 0.153
    numbers = {
        "crank_radius": 0.153,
        "rod_centre": half_rod,
        "rod_arm": half_rod,
        "rod_mass": 0.038,
        "inverse_rod_mass": 1 / 0.038,
        "inverse_rod_inertia": 1 / 5.9e-4,
        "piston_mass": 0.076,
        "inverse_piston_across": 1 / 0.076,
        "inverse_piston_tilt": 1 / 2.7e-6,
        "guide_rung": JOINT_COMPLIANT,
        "guide_half_length": 0.05,
        "guide_half_height": 0.025,
    }
    guide = np.zeros(1, CONTACT)[0]
    guide["stiffness"], guide["clearance"], guide["friction_speed"] = 1e6, 1e-3, 1.0
    crank_mass, crank_centre, step = 0.038, 0.0765, 1e-5
    t = one_throw(
        numbers,
        {GUIDE: guide},
        gravity_y=9.81,
        inverse_inertia=1 / (7.4e-5 + crank_mass * crank_centre**2),
        static_moment=crank_mass * crank_centre,
        baumgarte=1000.0,  # 1/s, of drift: slow to the steps, fast to the run
    )
    crank_speed, rod_rate = 150.0, 75.0  # the published rod angle is minus ours
    bodies = np.zeros((1, 2 * len(BODY)))
    bodies[0, 0], bodies[0, 3] = 0.153 + half_rod, 0.153 + 2 * half_rod
    bodies[0, 7], bodies[0, 8] = 0.153 * crank_speed - half_rod * rod_rate, rod_rate
    return run_mechanism(t, angle=0.0, speed=crank_speed, bodies=bodies, step=step, n_steps=200)


def _loose_slider_value(step: int, quantity: str) -> float:
    run = _loose_slider()
    assert run.bodies is not None  # kept by default
    values = {
        "revolutions": run.turns[step, 0] / (2 * math.pi),
        "rod angle": -run.bodies[step, 0, 2],
        "crank speed": run.turns[step, 1],
        "rod rate": -run.bodies[step, 0, 8],
    }
    return float(values[quantity])


def crank_checks() -> dict[str, Callable[[], float]]:
    """Checks of ideal motion and forces, and of a slider in clearance."""
    return {
        "ideal crank: stroke [m]": _stroke,
        "ideal crank: largest piston speed [m/s]": _largest_piston_speed,
        "ideal crank: least piston acceleration [m/s^2]": _least_piston_acceleration,
        "ideal crank: largest piston acceleration [m/s^2]": _largest_piston_acceleration,
        "ideal crank: largest crank-pin force [N]": _largest_crank_pin_force,
        "ideal crank: largest wrist-pin force [N]": _largest_wrist_pin_force,
        "ideal crank: largest guide force [N]": _largest_guide_force,
        "ideal crank: largest crank moment [N m]": _largest_crank_moment,
        **{
            f"loose slider: {quantity} after {after} ms [{unit}]": partial(
                _loose_slider_value, 100 * after, quantity
            )
            for after in (1, 2)
            for quantity, unit in (
                ("revolutions", "-"),
                ("rod angle", "rad"),
                ("crank speed", "rad/s"),
                ("rod rate", "rad/s"),
            )
        },
    }
