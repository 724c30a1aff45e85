"""A guard in every run: thirty planted bad set-ups end in an error or status, thirty good in none.

Ten of the bad ones are drawn: a kind of fault, then how far beyond its limit, by seed. It is not
enough that a run ends: it must say what was planted, as a wrong cure misleads.
"""

import math
import re

import numpy as np
import pytest
from wearstate.sim.film.solve import FilmGeometry, FilmState, FilmStatus, solve_relaxed
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.pump_setup.contacts import contact_rate
from wearstate.sim.pump_setup.ideal_motion import joint_loads
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

PUMP = {"duration": "0.4 s", "settling_revolutions": 1}
CHAMBER = {**PUMP, "pressure.rung": "chamber"}
TRIPLEX = {"duration": "0.2 s", "settling_revolutions": 1}
JOURNAL = {"duration": "0.1 s", "settling_revolutions": 5}
WHIRL = {"duration": "0.2 s", "tacho.pulse_width": "90 deg"}
SHAFT = {"duration": "0.4 s"}
COARSE = {"film.n_theta": 16, "film.n_z": 5}
WALL = {"bearing.wall": {"stiffness": "0.5 MN/m"}}
VALVES = {
    f"pressure.{side}_valve.{name}": value
    for side in ("suction", "discharge")
    for name, value in {"stiffness": 0, "preload_lift": 0, "damping": 50}.items()
}

PLANTED = {
    "pump: step too long": ("bilge-pump", {**PUMP, "numerics.step": "0.2 ms"}),
    "pump: step needs a memory of its own": ("bilge-pump", {**PUMP, "numerics.step": "0.01 us"}),
    "pump: clearance below what its stiffness resolves": (
        "bilge-pump",
        {**PUMP, "joint.crankpin.diametral_clearance": "2 um"},
    ),
    "pump: contact so soft that the pin sinks in": (
        "bilge-pump",
        {**PUMP, "joint.crankpin.stiffness": "0.5 MN/m", "joint.crankpin.damping": 0},
    ),
    "pump: impact law without a floor": (
        "bilge-pump",
        {
            **PUMP,
            "joint.crankpin.law": "exact",
            "joint.crankpin.restitution": 0.3,
            "joint.crankpin.damping": 0,
            "joint.crankpin.speed_floor": "1e-6 m/s",
        },
    ),
    "pump: rod shorter than the stroke leaves room": (
        "bilge-pump",
        {
            **PUMP,
            "joint.crankpin.rung": "link",
            "rod.length": "50.1 mm",
            "rod.centre_of_mass": "30 mm",
        },
    ),
    "pump: liquid column torn": (
        "bilge-pump",
        {**PUMP, "pressure.rung": "heads", "pressure.suction_line.length": "15 m"},
    ),
    "pump: liquid column torn by knocks": ("bilge-pump", {**PUMP, "pressure.rung": "heads"}),
    "pump: valves without springs": ("bilge-pump", {**CHAMBER, **VALVES}),
    "journal: step too long for the squeezed film": (
        "journal-bearing",
        {**JOURNAL, "numerics.integrator": "rk4", "numerics.step": "0.1 ms"},
    ),
    "journal: step stable but too long to be right": (
        "journal-whirl",
        {
            **WHIRL,
            "sample_rate": "2 kHz",
            "numerics.integrator": "euler",
            "numerics.step": "0.4 ms",
        },
    ),
    "journal: mesh too coarse for its eccentricity, solved": (
        "journal-bearing",
        {**JOURNAL, **COARSE, "film.rung": "direct", "load.static": "100 kN"},
    ),
    "journal: mesh too coarse for its eccentricity, mapped": (
        "journal-bearing",
        {**JOURNAL, **COARSE, "load.static": "100 kN"},
    ),
    "journal: short film of a long bearing": (
        "journal-bearing",
        {**JOURNAL, "film.rung": "short", "bearing.length": "200 mm"},
    ),
    "journal: more load than any film carries": (
        "journal-bearing",
        {**JOURNAL, "load.static": "50 MN"},
    ),
    "journal: shell so soft that the journal sinks in": (
        "journal-bearing",
        {**JOURNAL, **WALL, "load.static": "50 MN"},
    ),
    "shaft: mesh too coarse for its band": ("propulsion-shaft", {**SHAFT, "sample_rate": "50 kHz"}),
    "shaft: elements longer than a half-wave": (
        "propulsion-shaft",
        {**SHAFT, "shaft.longest_element": "3 m"},
    ),
    "shaft: whirls on its films": (
        "propulsion-shaft",
        {**SHAFT, "drive.speed": "60 Hz", "sample_rate": "5.12 kHz", "tacho.pulse_width": "60 deg"},
    ),
    "shaft: bore across the shaft": (
        "propulsion-shaft",
        {**SHAFT, "bearings.0.slope": "0.005 rad"},
    ),
    "shaft: moves by more than its film": (
        "propulsion-shaft",
        {**SHAFT, "oil": {"viscosity": "1 mPa s"}},
    ),
}

CAUSE = {
    "pump: step too long": "step is too long for the contact",
    "pump: step needs a memory of its own": r"numerics\.step = 1e-08 s must be >=",
    "pump: clearance below what its stiffness resolves": "clearance is smaller than its stiffness",
    "pump: contact so soft that the pin sinks in": "penetration exceeds",
    "pump: impact law without a floor": "the contact needs steps of",
    "pump: rod shorter than the stroke leaves room": "rod is perpendicular to the stroke",
    "pump: liquid column torn": "below the vapour pressure",
    "pump: liquid column torn by knocks": "below the vapour pressure",
    "pump: valves without springs": "valve does not close",
    "journal: step too long for the squeezed film": "too long for the squeeze stiffness",
    "journal: step stable but too long to be right": r"numerics\.step = 0\.0004 s must be <=",
    "journal: mesh too coarse for its eccentricity, solved": "mesh or map resolves",
    "journal: mesh too coarse for its eccentricity, mapped": "mesh or map resolves",
    "journal: short film of a long bearing": r"film\.rung = 'short' of L/D = 2 must be <= 1",
    "journal: more load than any film carries": "exceeds the capacity",
    "journal: shell so soft that the journal sinks in": "sinks into its shell",
    "shaft: mesh too coarse for its band": "half a bending wave",
    "shaft: elements longer than a half-wave": "half a bending wave",
    "shaft: whirls on its films": "unstable on its films",
    "shaft: bore across the shaft": "touches the edge",
    "shaft: moves by more than its film": "move by more than its film",
}
"""What each planted one must be told."""

# --- drawn


def pump_step(rng):
    """Beyond the limit of the integrator itself, 2.8 over the fastest rate."""
    rate = contact_rate(load_scene("bilge-pump"))
    return "bilge-pump", {**PUMP, "numerics.step": rng.uniform(3, 10) / rate}


def pump_clearance(rng):
    """Smaller than a fifth of the penetration under the ideal joint's load."""
    scene = load_scene("bilge-pump")
    depth = joint_loads(scene, 0)[0] / scene.joint.crankpin.stiffness
    return "bilge-pump", {
        **PUMP,
        "joint.crankpin.diametral_clearance": 2 * depth * rng.uniform(0.01, 0.2),
    }


def pump_suction(rng):
    """A suction line that no atmosphere fills."""
    return "bilge-pump", {
        **PUMP,
        "pressure.rung": "heads",
        "pressure.suction_line.length": rng.uniform(12, 40),
    }


def journal_step(rng):
    """An explicit step far beyond what the film's damping allows: stable ones are below 0.1 rad."""
    name = str(rng.choice(["euler", "rk4"]))
    return "journal-bearing", {
        **JOURNAL,
        "sample_rate": "1 kHz",
        "tacho.pulse_width": "60 deg",
        "numerics.integrator": name,
        "numerics.step": rng.uniform(0.3, 3.0) / (2 * math.pi * 50),
    }


def journal_mesh(rng):
    """A dozen nodes or two under a load that leaves a tenth of the clearance."""
    return "journal-bearing", {
        **JOURNAL,
        "film.rung": str(rng.choice(["map", "direct"])),
        "film.n_theta": int(rng.integers(6, 9)) * 2,
        "film.n_z": 5,
        "load.static": rng.uniform(1e5, 2e5),
    }


def journal_load(rng):
    return "journal-bearing", {**JOURNAL, "load.static": rng.uniform(4e7, 1e8)}


def shaft_mesh(rng):
    return "propulsion-shaft", {**SHAFT, "shaft.longest_element": rng.uniform(1.0, 10.0)}


def shaft_speed(rng):
    return "propulsion-shaft", {
        **SHAFT,
        "drive.speed": rng.uniform(55, 80),
        "sample_rate": "5.12 kHz",
        "tacho.pulse_width": "60 deg",
    }


def shaft_slope(rng):
    return "propulsion-shaft", {**SHAFT, "bearings.0.slope": rng.uniform(0.004, 0.01)}


KINDS = {
    pump_step: "step is too long for the contact",
    pump_clearance: "clearance is smaller than its stiffness",
    pump_suction: "below the vapour pressure",
    journal_step: r"too long for the squeeze stiffness|numerics\.step = .* must be <=",
    journal_mesh: "mesh or map resolves",
    journal_load: "exceeds the capacity",
    shaft_mesh: "half a bending wave",
    shaft_speed: "unstable on its films",
    shaft_slope: "touches the edge",
}
"""Kind of fault -> what it must be told."""


def drawn(seed):
    """Ten set-ups: nine kinds in a drawn order, and one of them again."""
    rng = np.random.default_rng(seed)
    kinds = list(KINDS)
    order = [*rng.permutation(len(kinds)), int(rng.integers(len(kinds)))]
    return {
        f"drawn {place}: {kinds[kind].__name__}": (kinds[kind](rng), KINDS[kinds[kind]])
        for place, kind in enumerate(order)
    }


BAD = {name: (case, CAUSE[name]) for name, case in PLANTED.items()} | drawn(20)


def verdict(name, overrides):
    """Text of the error or status, None where a run has ended well."""
    try:
        solution = simulate(load_scene(name, overrides), seed=0, raise_on_failure=False)
    except SceneError as error:
        return str(error)
    if solution.status.ok:
        return None
    assert not solution.signal.any()
    return solution.status.text


def test_none_of_them_is_missing():
    assert len(BAD) == 31
    assert len(GOOD) == 30


@pytest.mark.parametrize(("case", "cause"), BAD.values(), ids=list(BAD))
def test_a_bad_set_up_is_told_its_cause_and_a_cure(case, cause):
    text = verdict(*case)
    assert text is not None
    assert re.search(cause, text, re.DOTALL), text
    cure = r"; .*\b(shorten|raise|lower|lengthen|set|bring|load|refine)\b"
    assert re.search(cure, text, re.DOTALL), text


@pytest.mark.parametrize("factor", [2.0, 2.02, 2.5, 10.0])
def test_over_relaxation_beyond_two_says_so(factor):
    found = solve_relaxed(
        FilmGeometry(length_to_diameter=1.0), FilmState(x=0.5, y=0.0), relaxation=factor
    )
    assert found.status in (FilmStatus.DIVERGED, FilmStatus.STALLED, FilmStatus.SWEEPS)
    assert "; " in found.status.value


# --- no false alarm

GOOD = {
    "pump": ("bilge-pump", PUMP),
    "pump: condemned": ("bilge-pump", {**PUMP, "joint.crankpin.diametral_clearance": "0.31 mm"}),
    "pump: tight": ("bilge-pump", {**PUMP, "joint.crankpin.diametral_clearance": "40 um"}),
    "pump: ideal": ("bilge-pump", {**PUMP, "joint.crankpin.rung": "ideal"}),
    "pump: slow": ("bilge-pump", {**PUMP, "drive.speed": "250 rpm"}),
    "pump: fast": ("bilge-pump", {**PUMP, "drive.speed": "400 rpm"}),
    "pump: stiff": ("bilge-pump", {**PUMP, "joint.crankpin.stiffness": "500 MN/m"}),
    "pump: fine step": ("bilge-pump", {**PUMP, "numerics.step": "5 us"}),
    "pump: heads": (
        "bilge-pump",
        {**PUMP, "pressure.rung": "heads", "joint.crankpin.rung": "ideal"},
    ),
    "pump: chamber": ("bilge-pump", CHAMBER),
    "pump: motor": ("bilge-pump", {**PUMP, "drive.rung": "motor"}),
    "triplex": ("triplex-pump", TRIPLEX),
    "benchmark": ("slider-crank-benchmark", {"duration": "0.05 s"}),
    "journal": ("journal-bearing", JOURNAL),
    "journal: solved": ("journal-bearing", {**JOURNAL, "film.rung": "direct"}),
    "journal: short": ("journal-bearing", {**JOURNAL, "film.rung": "short"}),
    "journal: coarse mesh, light load": ("journal-bearing", {**JOURNAL, **COARSE}),
    "journal: heavy load, fine mesh": ("journal-bearing", {**JOURNAL, "load.static": "100 kN"}),
    "journal: euler": (
        "journal-bearing",
        {**JOURNAL, "numerics.integrator": "euler", "numerics.step": "20 us"},
    ),
    "journal: rk4": (
        "journal-bearing",
        {**JOURNAL, "numerics.integrator": "rk4", "numerics.step": "20 us"},
    ),
    "journal: scar": (
        "journal-bearing",
        {**JOURNAL, "film.rung": "direct", "bearing.scar_depth": "10 um"},
    ),
    "journal: step load": ("journal-step", {}),
    "journal: unbalance": ("journal-unbalance", {"duration": "0.2 s"}),
    "journal: whirl": ("journal-whirl", {"duration": "0.2 s"}),
    "shaft": ("propulsion-shaft", SHAFT),
    "shaft: worn": ("propulsion-shaft", {**SHAFT, "bearings.0.wear_down": "0.5 mm"}),
    "shaft: slow": ("propulsion-shaft", {**SHAFT, "drive.speed": "250 rpm"}),
    "shaft: thin oil": ("propulsion-shaft", {**SHAFT, "oil": {"viscosity": "30 mPa s"}}),
    "shaft: slender theory": ("propulsion-shaft", {**SHAFT, "shaft.theory": "euler-bernoulli"}),
    "rig": ("shaft-rig", {"duration": "0.4 s"}),
}


@pytest.mark.parametrize("case", GOOD.values(), ids=list(GOOD))
def test_a_good_set_up_raises_no_alarm(case):
    assert verdict(*case) is None
