"""Where the methods of the pump end: every bad set-up ends in a status with a cure."""

import copy
import re

import numpy as np
import pytest
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.output.status import SimulationError, Status
from wearstate.sim.pump_setup.contacts import contact_rate
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

SHORT = {"duration": "0.4 s", "settling_revolutions": 1}
CHAMBER = {
    "pressure": {
        "rung": "chamber",
        "suction": "-0.03 MPa",
        "discharge": "0.3 MPa",
        "dead_volume": 4e-4,
        "suction_valve": {},
        "discharge_valve": {},
    }
}
HEADS = {"pressure.rung": "heads", "pressure.suction_line": {}, "pressure.discharge_line": {}}
WRIST = {
    "joint.wristpin": {
        "pin_diameter": "40 mm",
        "radial_clearance": "30 um",
        "stiffness": "200 MN/m",
        "damping": "20 kN s/m",
        "friction": 0.05,
    }
}
GUIDE = {
    "piston.inertia": 0.02,
    "joint.guide": {
        "length": "120 mm",
        "height": "100 mm",
        "diametral_clearance": "0.1 mm",
        "stiffness": "100 MN/m",
        "damping": "20 kN s/m",
        "friction": 0.05,
    },
}
MOTOR = {
    "drive.rung": "motor",
    "drive.motor": {
        "synchronous_speed": "312 rpm",
        "breakdown_moment": 400,
        "breakdown_slip": 0.2,
        "inertia": 3.0,
    },
}
EXACT = {"law": "exact", "restitution": 0.5, "damping": 0}


def crank_pin(**changes):
    return {f"joint.crankpin.{name}": value for name, value in changes.items()}


def valves(**changes):
    return {
        f"pressure.{side}_valve.{name}": value
        for side in ("suction", "discharge")
        for name, value in changes.items()
    }


def pump(*changes):
    table = dict(SHORT)
    for change in changes:
        table |= copy.deepcopy(change)  # later paths are set inside these tables
    return load_scene("bilge-pump", table)


BEFORE_THE_RUN = {
    "step": (
        Status.STEP,
        pump({"numerics.step": "0.2 ms"}),
        r"numerics\.step = 0\.0002 s must be <= .* s.*; shorten it, or lower",
    ),
    "step and wrist pin": (
        Status.STEP,
        pump(WRIST, {"numerics.step": "0.1 ms"}),
        r"numerics\.step = 0\.0001 s must be <= .* s.*; shorten it, or lower",
    ),
    "clearance unresolved": (
        Status.UNRESOLVED,
        pump(crank_pin(diametral_clearance="2 um")),
        r"joint\.crankpin: radial clearance = 1e-06 m must be >= .* m.*; raise its stiffness, or "
        r"set joint\.crankpin\.rung = 'ideal'",
    ),
    "wrist pin unresolved": (
        Status.UNRESOLVED,
        pump(WRIST, {"joint.wristpin.stiffness": "5 MN/m", "joint.wristpin.damping": 0}),
        r"joint\.wristpin: radial clearance = 3e-05 m must be >= .* m",
    ),
    "guide unresolved": (
        Status.UNRESOLVED,
        pump(GUIDE, {"joint.guide.stiffness": "2 MN/m", "joint.guide.damping": 0}),
        r"joint\.guide: radial clearance = 5e-05 m must be >= .* m",
    ),
    "one throw unresolved": (
        Status.UNRESOLVED,
        pump(
            {"throws": [{}, {"phase": 2.0, "joint": {"crankpin": {"diametral_clearance": 2e-6}}}]}
        ),
        r"throws\.1\.joint\.crankpin: radial clearance = 1e-06 m must be >= .* m",
    ),
    "overlap": (
        Status.OVERLAP,
        pump(crank_pin(stiffness="0.5 MN/m", damping=0)),
        r"joint\.crankpin: penetration under .* N = .* m must be <= 0\.003 m, 0\.1 of the pin's "
        r"radius, where the contact law ends; raise its stiffness",
    ),
    "guide overlaps": (
        Status.OVERLAP,
        pump(GUIDE, {"joint.guide.stiffness": "10 kN/m", "joint.guide.damping": 0}),
        r"joint\.guide: penetration under .* N = .* m must be <= 0\.005 m, 0\.1 of half the height",
    ),
    "rod near its buckling": (
        Status.SLENDER,
        pump({"rod.rung": "elastic", "rod.section_area": 1e-4, "rod.section_radius": 2e-3}),
        r"rod: force along it = .* N must be <= 1\.3e\+03 N, 0\.1 of Euler's load, .*; raise "
        r"rod\.section_radius or rod\.section_area, or set rod\.rung = 'rigid'",
    ),
    "column torn by knocks": (
        Status.VAPOUR,
        pump(HEADS, crank_pin(diametral_clearance="0.4 mm")),
        r"pressure: the knocks pull the liquid down to -.* Pa at the lowest, must be >= .* Pa "
        r"gauge; set pressure\.rung = 'chamber', or pressure\.flow = 'two-harmonic', .*, shorten",
    ),
    "column of one throw torn by knocks": (
        Status.VAPOUR,
        pump(
            HEADS,
            {"throws": [{}, {"phase": 2.0}]},
            crank_pin(rung="ideal"),
            {"throws.1.joint": {"crankpin": {"rung": "compliant"}}},
        ),
        r"pressure: the knocks pull the liquid down to",
    ),
    "column torn": (
        Status.VAPOUR,
        pump(HEADS, {"pressure.suction_line": {"length": "15 m"}}),
        r"pressure: the piston needs -.* Pa at the lowest, must be >= .* Pa gauge; set "
        r"pressure\.rung = 'chamber', shorten pressure\.suction_line\.length, or lower the speed",
    ),
}

IN_THE_RUN = {
    "locked": (
        Status.LOCKED,
        pump(crank_pin(rung="link"), {"rod.length": "50.1 mm", "rod.centre_of_mass": "30 mm"}),
        "rod.length",
    ),
    "chamber without volume": (
        Status.CHAMBER,
        pump(  # at rest on the pressure before the valves, the play lets the piston reach the head
            CHAMBER,
            {"pressure.dead_volume": 1e-9, "pressure.suction": -1e4, "pressure.discharge": 0},
            crank_pin(diametral_clearance="0.3 mm"),
        ),
        "dead_volume",
    ),
    "valve without a spring": (
        Status.VALVE_OPEN,
        pump(CHAMBER, valves(stiffness=0, preload_lift=0, damping=50)),
        "valve's stiffness",
    ),
    "valve too soft for its damping": (
        Status.VALVE_OPEN,
        pump(CHAMBER, valves(stiffness=300, preload_lift="1 mm", damping=50)),
        "lower the speed",
    ),
}

every_bad_scene = pytest.mark.parametrize(
    ("status", "scene", "text"),
    [*BEFORE_THE_RUN.values(), *IN_THE_RUN.values()],
    ids=[*BEFORE_THE_RUN, *IN_THE_RUN],
)


@pytest.mark.parametrize(
    ("status", "scene", "text"), BEFORE_THE_RUN.values(), ids=list(BEFORE_THE_RUN)
)
def test_a_limit_is_refused_with_quantity_value_bound_and_cure(status, scene, text):
    with pytest.raises(SceneError, match=text) as refused:
        simulate(scene, seed=0)
    assert refused.value.status is status


@pytest.mark.parametrize(("status", "scene", "cure"), IN_THE_RUN.values(), ids=list(IN_THE_RUN))
def test_a_failed_run_says_why(status, scene, cure):
    with pytest.raises(SimulationError, match=re.escape(cure)) as failed:
        simulate(scene, seed=0)
    assert failed.value.status is status
    assert str(failed.value).startswith(f"bilge-pump: {status.name.lower().replace('_', ' ')}: ")


@pytest.mark.parametrize("truth", [False, True])
@every_bad_scene
def test_a_sweep_gets_the_status_and_zeros(status, scene, text, truth):
    solution = simulate(scene, seed=0, truth=truth, raise_on_failure=False)
    assert solution.status is status
    assert not solution.status.ok
    channels = len(scene.accelerometers) + (scene.tacho is not None)
    assert solution.signal.shape == (channels, round(scene.duration * scene.sample_rate))
    assert solution.signal.dtype == np.float32
    assert not solution.signal.any()
    assert solution.truth == {}


@pytest.mark.parametrize(
    ("change", "lowest"),
    [
        ({"pressure.rung": "constant"}, 3e5),
        ({}, -3e4),
        ({**HEADS, "pressure.flow": "two-harmonic"}, None),
        (CHAMBER, None),
        ({**CHAMBER, "pressure.suction": "-0.095 MPa"}, -101325 + 2339),  # the vapour's own
    ],
)
@pytest.mark.parametrize("throws", [1, 2])
def test_no_pressure_is_recorded_below_that_of_the_vapour(change, lowest, throws):
    worn = crank_pin(diametral_clearance="0.4 mm")
    scene = pump(change, worn, {"throws": [{"phase": 3.0 * k} for k in range(throws)]})
    solution = simulate(scene, seed=0, truth=True)
    found = solution.numerics["lowest_pressure_pa"]
    assert found >= -101325 + 2330  # vapour of water at 20 degrees
    if lowest is not None:
        assert found == pytest.approx(lowest, abs=20)  # the chamber's is extrapolated over a step
    area = np.pi / 4 * scene.piston.diameter**2
    for throw in range(throws):
        force = solution.truth["piston_pressure_force_n" + f"_{throw + 1}" * (throw > 0)]
        # what is recorded is low-passed and rings about a step by a tenth
        assert force.min() / area >= found - 0.1 * np.ptp(force) / area


def test_without_a_pressure_none_is_told():
    assert "lowest_pressure_pa" not in simulate(pump({"pressure.rung": "none"}), seed=0).numerics


@pytest.mark.parametrize("stiffness", ["5 MN/m", "0.5 MN/m", "50 kN/m", "1 N/m"])
def test_the_softer_the_contact_the_surer_it_is_refused(stiffness):
    with pytest.raises(SceneError, match=r"joint\.crankpin: "):
        check(pump(crank_pin(stiffness=stiffness, damping=0)))


def test_every_status_has_a_cure():
    for status in Status:
        assert status.text
        if not status.ok:
            assert re.search(r"; .*(shorten|raise|lower|lengthen|set)", status.text), status


def test_limits_are_reported_together():
    scene = pump(crank_pin(diametral_clearance="2 um"), {"numerics.step": "0.2 ms"})
    with pytest.raises(SceneError) as refused:
        simulate(scene, seed=0)
    assert len(refused.value.faults) == 2


GOOD = {
    "as it comes": pump(),
    "condemned": pump(crank_pin(diametral_clearance="0.31 mm")),
    "ideal": pump(crank_pin(rung="ideal")),
    "link under constant pressure": pump(crank_pin(rung="link"), {"pressure.rung": "constant"}),
    "wrist pin": pump(WRIST),
    "guide": pump(GUIDE),
    "all joints": pump(WRIST, GUIDE),
    "heads": pump(HEADS, crank_pin(rung="ideal")),
    "heads, whose flow ignores knocks": pump(HEADS, {"pressure.flow": "two-harmonic"}),
    "chamber": pump(CHAMBER),
    "motor": pump(MOTOR),
    "triplex": pump({"throws": [{"phase": f"{angle} deg"} for angle in (0, 120, 240)]}),
    "everything": pump(WRIST, GUIDE, CHAMBER, MOTOR),
    "benchmark": load_scene("slider-crank-benchmark", {"duration": "0.05 s"}),
}


FEW_TURNS = "duration = "  # these runs are: they are told that they hold few revolutions


@pytest.mark.parametrize("scene", GOOD.values(), ids=list(GOOD))
def test_a_good_scene_raises_no_alarm(scene):
    solution = simulate(scene, seed=0)
    assert solution.status is Status.OK
    told = [text for text in solution.warnings if not text.startswith(FEW_TURNS)]
    # joints without a knock leave a quiet casing, which is no fault of the scene's limits
    assert [text for text in told if "its own noise" not in text] == []
    assert solution.signal[0].any()
    assert np.all(np.isfinite(solution.signal))


WARNED = {
    "link in tension": (
        pump(crank_pin(rung="link")),
        r"contact would be lost in \d.*% of the steps.*set the joint's rung to 'compliant'",
        "tension_share",
    ),
    "cavitation": (
        pump(CHAMBER, {"pressure.suction": "-0.095 MPa"}),
        r"a cylinder holds vapour in \d.*% of the steps",
        "cavitating_share",
    ),
    "floored contacts": (
        pump(crank_pin(**EXACT, speed_floor="1 m/s")),
        r"% of the contacts closed more slowly than 1 m/s",
        "floored_share",
    ),
}


@pytest.mark.parametrize(("scene", "text", "share"), WARNED.values(), ids=list(WARNED))
def test_what_a_user_must_know_is_a_warning(scene, text, share):
    solution = simulate(scene, seed=0)
    assert solution.status is Status.OK
    warning, *others = solution.warnings
    assert re.search(text, warning)
    assert all(other.startswith(FEW_TURNS) for other in others)
    assert 0 < solution.numerics[share] <= 1


def test_what_is_kept_of_a_scene_is_not_told_of_another():
    """Scenes are known by identity: the next one may lie where the last one did."""
    base = load_scene("bilge-pump")
    kept, anew = [], []
    for n in range(200):
        stiffness = {"stiffness": 1e8 * (1 + n)}
        crankpin = base.joint.crankpin.model_copy(update=stiffness)
        joint = base.joint.model_copy(update={"crankpin": crankpin})
        scene = base.model_copy(update={"joint": joint})
        kept.append((contact_rate(scene), contact_rate(scene)))
        anew.append(contact_rate.__wrapped__(scene))
        del scene, joint, crankpin
    assert kept == [(rate, rate) for rate in anew]
    assert len(set(anew)) == 200
