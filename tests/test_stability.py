"""The stability atlas: measured limits against theory, regions, budget, and the command."""

import json
import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.diagnose.stability import atlas as stability_atlas
from wearstate.diagnose.stability import method_map as stability
from wearstate.diagnose.stability.atlas import atlas
from wearstate.diagnose.stability.figure import save_figure
from wearstate.diagnose.stability.joint_maps import (
    contact_oscillator,
    contact_restitution,
    step_stiffness,
)
from wearstate.diagnose.stability.maps import MAPS
from wearstate.diagnose.stability.method_map import Budget, MapAxis, MapPlan, Verdict, edge, measure
from wearstate.diagnose.stability.orbit_maps import (
    _orbit_case,
    growth,
    linear_film,
    squeeze_limit,
    step_squeeze,
    threshold_speed,
    whirls,
)
from wearstate.diagnose.stability.steppers import STEPPERS, bounce, decays, runge_kutta_limit
from wearstate.sim.bearing.bearing_status import BearingStatus
from wearstate.sim.bearing.equilibrium import equilibrium
from wearstate.sim.contact.closed_forms import kelvin_voigt_restitution
from wearstate.sim.film.solve import FilmGeometry, FilmState, FilmStatus, solve_relaxed
from wearstate.sim.output.recording import DataError
from wearstate.sim.pump_setup.contacts import contact_frequency, joint_mobility
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

from .command_line import run as command

BY_NAME = {stepper.name: stepper for stepper in STEPPERS}
FIVE_PER_CENT = 0.05  # what a measured limit may be off by from theory

# --- steppers


def measured_limit(stepper, zeta):
    """Step times omega at which a free oscillator begins to grow, by narrowing a search."""
    low, high = 1e-3, 1e3
    for _ in range(3):
        steps = np.geomspace(low, high, 64)
        unstable = ~decays(stepper, steps, 1.0, zeta, 1000)
        if unstable[0] or not unstable.any():
            return 0.0 if unstable[0] else math.inf
        first = int(np.argmax(unstable))
        low, high = steps[first - 1], steps[first]
    return math.sqrt(low * high)


@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.2, 0.5, 1.0, 3.0])
def test_semi_implicit_euler_ends_where_its_formula_says(zeta):
    expected = 2 * (math.sqrt(1 + zeta**2) - zeta)
    found = measured_limit(BY_NAME["semi-implicit euler"], zeta)
    assert_allclose(found, expected, rtol=FIVE_PER_CENT)


def test_runge_kutta_ends_at_two_root_two_without_damping():
    found = measured_limit(BY_NAME["runge-kutta 4"], 0.0)
    assert_allclose(found, 2 * math.sqrt(2), rtol=FIVE_PER_CENT)


@pytest.mark.parametrize("zeta", [5.0, 20.0])
def test_runge_kutta_ends_at_2_785_on_the_real_axis(zeta):
    fast = zeta + math.sqrt(zeta**2 - 1)  # decay of the faster mode over omega
    found = measured_limit(BY_NAME["runge-kutta 4"], zeta)
    assert_allclose(fast * found, 2.785, rtol=FIVE_PER_CENT)


@pytest.mark.parametrize("stepper", STEPPERS, ids=lambda s: s.name)
@pytest.mark.parametrize("zeta", [0.1, 0.5, 0.7, 1.0, 2.0])
def test_every_stepper_ends_where_its_theory_says(stepper, zeta):
    found, expected = measured_limit(stepper, zeta), stepper.limit(zeta)
    assert math.isinf(found) == math.isinf(expected)
    if math.isfinite(expected):
        assert_allclose(found, expected, rtol=FIVE_PER_CENT)


def test_the_midpoint_has_no_stable_step_without_damping():
    assert runge_kutta_limit(0.0, order=2) == 0
    # it grows by sqrt(1 + z^4 / 4) a step: 1.5 at 0.6 in the 25 steps that are watched, and on
    assert not decays(BY_NAME["explicit midpoint"], 0.6, 1.0, 0.0, 1000)


@pytest.mark.parametrize("stepper", STEPPERS, ids=lambda s: s.name)
def test_observed_order_of_a_free_oscillation(stepper):
    errors = []
    for n in (400, 800):
        x, v = np.ones(1), np.zeros(1)
        for _ in range(n):
            x, v = stepper.step(x, v, lambda p, _u: -p, np.array(2.0 / n))
        errors.append(np.hypot(x - math.cos(2.0), v + math.sin(2.0))[0])
    # the next term is of the size of the step, 1/200
    assert_allclose(math.log2(errors[0] / errors[1]), stepper.order, atol=0.05)


@pytest.mark.parametrize("zeta", [0.0, 0.3, 0.8])
def test_a_bounce_comes_back_with_the_restitution_of_the_contact(zeta):
    phase = np.arange(8) / 8
    for stepper in STEPPERS:
        found = bounce(stepper, 1e-3, 1.0, 2 * zeta, phase)
        # touch and release are missed by up to a step: each changes the speed by 2 zeta h at most
        assert_allclose(found, kelvin_voigt_restitution(zeta), atol=2.5e-3)


def test_restitution_beyond_critical_damping():
    # by the motion itself: x = (exp(r t) - exp(s t)) / (r - s), force x + 2 zeta x' = 0
    zeta = 1.7
    r, s = -zeta + math.sqrt(zeta**2 - 1), -zeta - math.sqrt(zeta**2 - 1)
    t = math.log((1 + 2 * zeta * s) / (1 + 2 * zeta * r)) / (r - s)
    speed = (r * math.exp(r * t) - s * math.exp(s * t)) / (r - s)
    assert_allclose(contact_restitution(zeta), -speed, rtol=1e-9)
    near = [contact_restitution(z) for z in (1 - 1e-6, 1.0, 1 + 1e-6)]
    assert_allclose(near, math.exp(-2), rtol=1e-4)  # the speed is smooth there


# --- regions against theory

FINE = 41  # cells between a twentieth and twenty times the contact's time: 16 % from cell to cell


def test_the_contact_of_the_pump_is_what_its_step_is_chosen_by():
    pump = load_scene("bilge-pump")
    found = contact_oscillator(pump)
    assert_allclose(found.mass, 1 / joint_mobility(pump, 0, 0))
    assert_allclose(math.sqrt(found.stiffness / found.mass), contact_frequency(pump), rtol=1e-9)


@pytest.mark.parametrize("name", ["semi-implicit euler", "runge-kutta 4", "velocity verlet"])
def test_the_region_of_a_stepper_ends_at_the_line_drawn_over_it(name):
    plan = step_stiffness(load_scene("bilge-pump"), FINE)
    codes = np.array([[plan.judges[name](h, k)[0] for h in plan.x.values] for k in plan.y.values])
    found = edge(codes, plan.x.values)
    (curve,) = plan.curves[name]
    expected = np.interp(np.log(plan.y.values), np.log(curve.y), curve.x)
    known = np.isfinite(found)
    assert known.sum() >= FINE - 4
    # half a cell, 9 %, is the plane's; limits themselves are held to 5 % above
    assert_allclose(found[known], expected[known], rtol=0.14)


@pytest.mark.parametrize(
    ("name", "factor"), [("semi-implicit euler", 2.0), ("runge-kutta 4", 2.785)]
)
@pytest.mark.parametrize("gap", [0.5, 0.1])
def test_the_limit_of_an_orbit_is_that_of_the_squeeze_damping(name, factor, gap):
    case = _orbit_case(load_scene("journal-bearing", {"film.rung": "short"}))
    _, damping = linear_film(case, 1 - gap)
    fastest = np.abs(np.linalg.eigvals(damping)).max()
    limit = squeeze_limit(case, 1 - gap, BY_NAME[name])
    # stiffness over damping squared is what damping alone leaves out
    assert_allclose(limit, factor / fastest, rtol=FIVE_PER_CENT)


@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_orbit_steps_end_where_the_linear_film_says(method):
    scene = load_scene("journal-bearing", {"film.rung": "short"})
    case = _orbit_case(scene)
    plan = step_squeeze(scene, 5)
    stepper = BY_NAME[{"euler": "semi-implicit euler", "rk4": "runge-kutta 4"}[method]]
    for gap in (0.5, 0.1):
        limit = squeeze_limit(case, 1 - gap, stepper)
        for share, expected in ((0.95, True), (1.05, False)):
            bare = plan.judges[f"{method}, no guard"](share * limit, gap)[0]
            assert (bare is not Verdict.UNSTABLE) is expected
            guarded = plan.judges[method](share * limit, gap)[0]
            assert (guarded is not Verdict.REFUSED) is expected  # the guard is neither late nor shy
        assert plan.judges["adaptive"](20 * limit, gap)[0] is Verdict.ACCURATE


@pytest.mark.parametrize("load", [0.3, 1.0, 3.0])
def test_whirl_begins_within_five_per_cent_of_the_linear_threshold(load):
    # on the film that is solved, so that film and coefficients are of one mesh
    scene = load_scene("journal-whirl", {"film.rung": "short"})
    weight = load * scene.rotor.mass * scene.gravity
    speed = threshold_speed(scene, weight, 10.0, 500.0)
    assert whirls(scene, (1 - FIVE_PER_CENT) * speed, weight)[0] is False
    assert whirls(scene, (1 + FIVE_PER_CENT) * speed, weight)[0] is True


def test_euler_shifts_the_threshold_by_a_third_of_its_step():
    scene = load_scene("journal-whirl", {"film.rung": "short"})
    weight = scene.rotor.mass * scene.gravity
    speed = threshold_speed(scene, weight, 10.0, 500.0)
    above = 1.03 * speed
    assert whirls(scene, above, weight)[0] is True
    assert whirls(scene, above, weight, integrator="rk4", step=0.2)[0] is True
    told, _ = whirls(scene, above, weight, integrator="euler", step=0.2)
    assert told is False  # stable but wrong: what the longest step of the scene keeps out
    stiffness, damping = np.eye(2), 0.02 * np.eye(2)
    cross = np.array([[0.0, 0.03], [-0.03, 0.0]])  # more than the damping holds
    assert growth(BY_NAME["runge-kutta 4"], stiffness + cross, damping, 0.2) > 1
    assert growth(BY_NAME["semi-implicit euler"], stiffness + 0.5 * cross, damping, 0.2) < 1


@pytest.mark.parametrize("n_theta", [24, 72])
@pytest.mark.parametrize("eccentricity", [0.2, 0.8])
def test_over_relaxation_ends_at_two(n_theta, eccentricity):
    geometry = FilmGeometry(length_to_diameter=0.6, n_theta=n_theta)
    state = FilmState(x=eccentricity, y=0.0)

    def ends(factor):
        found = solve_relaxed(geometry, state, relaxation=factor, most_sweeps=20_000)
        return found.status

    assert ends(0.95 * 2.0) is FilmStatus.OK
    assert ends(1.05 * 2.0) is FilmStatus.DIVERGED
    assert ends(2.0) is not FilmStatus.OK


# --- maps


def test_a_rung_far_outside_its_validity_ends_in_a_status():
    # the long film of a short bearing at the edge of its bore has no stiffness left but rounding
    geometry = FilmGeometry(length_to_diameter=0.1)
    found = equilibrium(geometry, (1 / (math.pi * 0.003), 0.0), rung="long", raise_on_failure=False)
    assert found.status is not BearingStatus.OK
    assert found.status.text


def tiny(judge, x=(1.0, 2.0, 4.0), y=(1.0, 2.0)):
    axes = {"x": MapAxis(name="x", unit="m", values=x), "y": MapAxis(name="y", unit="", values=y)}
    return MapPlan(name="tiny", title="a test", judges={"method": judge}, **axes)


def test_a_map_keeps_verdicts_and_words_in_their_cells():
    found = measure(
        tiny(lambda x, y: (Verdict.UNSTABLE if x * y > 3 else Verdict.INACCURATE, f"{x * y}"))
    )
    assert found.verdicts["method"].tolist() == [[2, 2, 3], [2, 3, 3]]
    assert found.words["method"] == [["1.0", "2.0", "4.0"], ["2.0", "4.0", "8.0"]]
    assert found.share("method") == {Verdict.INACCURATE: 0.5, Verdict.UNSTABLE: 0.5}
    assert_allclose(edge(found.verdicts["method"], (1.0, 2.0, 4.0)), [math.sqrt(8), math.sqrt(2)])


def test_what_the_budget_leaves_no_time_for_is_not_run():
    found = measure(tiny(lambda _x, _y: (Verdict.ACCURATE, "")), Budget(-1.0))
    assert found.share("method") == {Verdict.NOT_RUN: 1.0}


def test_a_map_that_was_cut_short_goes_on_where_it_ended():
    runs = []

    class Allowance:
        spent = False

    allowance = Allowance()

    def judge(x, y):
        runs.append((x, y))
        allowance.spent = len(runs) == 2
        return Verdict.ACCURATE, f"run {len(runs)}"

    half = measure(tiny(judge), allowance)
    assert not half.whole
    whole = measure(half.plan, begun=half)
    assert whole.whole
    assert len(runs) == len(set(runs)) == 6
    assert sorted(word for row in whole.words["method"] for word in row) == [
        f"run {k}" for k in range(1, 7)
    ]
    assert half.share("method")[Verdict.NOT_RUN] == 4 / 6


def test_a_map_goes_on_with_what_the_others_leave_of_a_budget(monkeypatch):
    now = [0.0]

    def judge_of(seconds):
        def judge(_x, _y):
            now[0] += seconds
            return Verdict.ACCURATE, ""

        return judge

    scene = load_scene("bilge-pump")
    slow = replace(tiny(judge_of(2.0)), name="slow")
    quick = replace(tiny(judge_of(0.1)), name="quick")
    makers = {"slow": lambda *_: slow, "quick": lambda *_: quick}
    monkeypatch.setitem(MAPS, scene.machine, makers)
    for module in (stability, stability_atlas):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    maps = atlas(scene, budget=14.0)  # the slow one takes 12 s, its even share is 7
    assert [found.plan.name for found in maps] == ["slow", "quick"]
    assert [found.whole for found in maps] == [True, True]
    assert_allclose(now[0], 12.6)


PIPES_WITH_WAVES = {
    "pressure.rung": "wave-lines",
    "pressure.suction_line.wave_speed": 1000.0,
    "pressure.discharge_line.wave_speed": 1200.0,
}


@pytest.mark.parametrize(
    ("scene", "more"),
    [
        # a run takes two revolutions: at twice the speed half as many steps
        ("bilge-pump", PIPES_WITH_WAVES | {"drive.speed": "10 Hz", "casing.rung": "yielding"}),
        ("journal-bearing", {}),
        ("propulsion-shaft", {}),
    ],
)
def test_every_map_of_a_machine_is_drawn_with_words_and_theory(scene, more, tmp_path):
    machine = load_scene(scene, more)
    maps = atlas(machine, size=3)
    assert [found.plan.name for found in maps] == list(MAPS[machine.machine])
    for found in maps:
        for method, codes in found.verdicts.items():
            assert Verdict.NOT_RUN not in codes
            failed = codes >= Verdict.UNSTABLE
            words = np.array(found.words[method])
            assert np.all(words[failed] != "")
    save_figure(machine, maps, tmp_path / "atlas.svg")
    text = (tmp_path / "atlas.svg").read_text()
    assert len(text) > 20_000
    with pytest.raises(DataError, match="suffix must be one of"):
        save_figure(machine, maps, tmp_path / "atlas.gif")


def test_the_guard_of_a_pipe_with_waves_is_where_its_frequency_is_right():
    assert "set pressure.rung" in MAPS["reciprocating-pump"]["step-line"](
        load_scene("bilge-pump"), 3
    )
    scene = load_scene("bilge-pump", PIPES_WITH_WAVES | {"pressure.discharge_line.length": 3.0})
    plan = MAPS["reciprocating-pump"]["step-line"](scene, 7)
    assert plan.own is not None
    assert (plan.own.method, plan.own.y) == ("wave-lines", 3.0)
    [guard] = plan.curves["wave-lines"]
    for step, length in zip(guard.x, guard.y, strict=True):
        for share in (0.3, 0.77, 0.999):
            verdict, word = plan.judges["wave-lines"](share * step, length)
            assert verdict is Verdict.ACCURATE
            assert float(word.rpartition(" ")[2]) < 5e-3
        assert plan.judges["wave-lines"](10 * step, length)[0] is Verdict.INACCURATE
        assert plan.judges["lumped-lines"](10 * step, length)[0] is Verdict.INACCURATE
        assert plan.judges["lumped-lines"](0.1 * step, length)[0] is Verdict.ACCURATE


def test_a_casing_that_yields_runs_away_nowhere_however_light_it_is():
    make = MAPS["reciprocating-pump"]["step-casing"]
    assert "set casing.rung = 'yielding'" in make(load_scene("bilge-pump"), 3)
    stiff = {f"casing.modes.{i}.shape.bearing_x": 0.0 for i in range(8)}
    scene = load_scene("bilge-pump", {**stiff, "casing.rung": "yielding"})
    assert "does not move along the stroke" in make(scene, 3)
    plan = make(load_scene("bilge-pump", {"casing.rung": "yielding"}), 7)
    [judge] = plan.judges.values()
    assert plan.own.y == pytest.approx(1 / 0.0564 / 9, rel=1e-3)  # sum of shape^2 [1/kg], on 9 kg
    for ratio in plan.y.values:  # down to a thirtieth of its weight
        found = [judge(step, ratio)[0] for step in (*plan.x.values, 0.3 / 7620)]
        assert set(found) == {Verdict.ACCURATE, Verdict.INACCURATE}
        assert judge(0.05 / 7620, ratio)[0] is Verdict.ACCURATE


def test_the_pump_loses_contact_by_its_clearance_and_not_by_its_step(monkeypatch):
    judge = next(
        iter(
            MAPS["reciprocating-pump"]["clearance-speed"](
                load_scene("bilge-pump"), 3
            ).judges.values()
        )
    )
    assert judge(5.0, 0.3e-3)[0] in (Verdict.LOST, Verdict.CHAOTIC)
    assert judge(5.0, 2e-6)[0] is Verdict.REFUSED
    soft = load_scene(
        "bilge-pump", {"joint.crankpin.stiffness": "0.5 MN/m", "joint.crankpin.damping": 0}
    )
    judge = next(iter(MAPS["reciprocating-pump"]["clearance-speed"](soft, 3).judges.values()))
    assert judge(5.0, 5e-3)[0] is Verdict.REFUSED  # the check sees it coming
    monkeypatch.setattr("wearstate.sim.pump.run_plan.limits", lambda scene: [])
    verdict, word = judge(5.0, 5e-3)
    assert verdict is Verdict.FAILS  # at a quarter of the step as well
    assert word.startswith("overlap")


def test_a_line_whirls_at_any_mesh():
    maker = MAPS["propulsion-shaft"]["speed-viscosity"]
    for judge in maker(load_scene("propulsion-shaft"), 3).judges.values():
        assert judge(60.0, 0.08)[0] is Verdict.WHIRL
        assert judge(5.0, 0.08)[0].cause != "physical"


# --- command


run = partial(command, "stability")


def test_command_writes_picture_text_and_json(tmp_path):
    picture = tmp_path / "map.png"
    result = run("bilge-pump", "--map", "step-stiffness", "--size", 3, "-o", picture)
    assert picture.stat().st_size > 10_000
    assert "unstable (numerical cause)" in result.stdout
    table = json.loads(
        run("journal-whirl", "--map", "relaxation-mesh", "--size", 3, "--json").stdout
    )
    assert table["schema_version"] == 1
    (found,) = table["maps"]
    assert {"x", "y"} == set(found["axes"])
    for method in found["methods"]:
        assert len(method["verdicts"]) == len(found["axes"]["y"]["values"])
        assert any(curve["name"].startswith("limit in theory: 2") for curve in method["theory"])


def test_command_refuses_what_it_cannot_draw():
    assert (
        "map = 'speedload' is unknown"
        in run("journal-bearing", "--map", "speedload", code=2).stderr
    )
    ideal = ("bilge-pump", "--set", "joint.crankpin.rung=ideal", "--map", "step-stiffness")
    assert "no joint is compliant; set joint.crankpin.rung" in run(*ideal, code=2).stderr


def test_a_map_that_a_scene_has_not_is_an_error_of_the_scene():
    with pytest.raises(SceneError, match="unknown for a propulsion-shaft"):
        atlas(load_scene("propulsion-shaft"), name="step-stiffness")
