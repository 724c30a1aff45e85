"""Rungs as data: every row fits its scene, refuses what is not valid, and is ranked by its cost."""

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.sim.casing.decimation import edge_samples
from wearstate.sim.fidelity.ladder import cost_of, effects_of
from wearstate.sim.journal.ladder import journal_calls
from wearstate.sim.journal.load import load
from wearstate.sim.journal.orbit import run_orbit
from wearstate.sim.journal.orbit_film import short_film
from wearstate.sim.journal.recording import journal_film, squeeze_rate
from wearstate.sim.journal.validity import orbit_faults
from wearstate.sim.machine.registry import machine_of
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.pump.validity import pump_step, pump_steps
from wearstate.sim.scene.load import MACHINES, load_scene, scene_names
from wearstate.sim.scene.rungs import admissible, with_values
from wearstate.sim.scene.scene import SceneError
from wearstate.sim.shaft.at_rest import reduced_rotor, shaft_state
from wearstate.sim.shaft.elements import element_faults, element_lengths
from wearstate.sim.shaft.ladder import shaft_states
from wearstate.sim.shaft.line_beam import shaft_beam

PUMPS = ("bilge-pump", "slider-crank-benchmark", "triplex-pump")
JOURNALS = tuple(name for name in scene_names() if name.startswith("journal"))


def effect(scene, name):
    return next(each for each in effects_of(scene) if each.name == name)


# --- rows


@pytest.mark.parametrize("name", scene_names())
def test_every_rung_goes_into_its_scene_and_is_found_there(name):
    scene = load_scene(name)
    for each in effects_of(scene):
        assert each.name in scene.effects
        for rung in admissible(each, scene):
            changed = with_values(scene, rung.values)
            if each.numerical:
                assert effect(changed, each.name).current(changed) == "x1"
            else:
                assert each.current(changed) == rung.name


def test_every_effect_of_a_machine_is_found_in_one_of_its_scenes():
    found = {machine: set() for machine in MACHINES}
    for name in scene_names():
        changes = [{}]
        if name == "journal-step":
            changes.append({"numerics.integrator": "rk4"})
        if name == "bilge-pump":  # no scene has play there, or a rod's section
            play = {"pin_diameter": 0.07, "diametral_clearance": 1e-4, "rung": "ideal"}
            changes.append({"crank.mass": 60.0, "crank.bearing": play})
            changes.append({"rod.section_area": 8e-4})
        for change in changes:
            scene = load_scene(name, change)
            found[scene.machine] |= {each.name for each in effects_of(scene)}
    assert found == {machine: set(kind.effects) for machine, kind in MACHINES.items()}


def test_an_absent_effect_is_absent():
    names = [each.name for each in effects_of(load_scene("slider-crank-benchmark"))]
    assert names == ["crankpin", "casing", "step"]  # no wrist pin, no guide, no bore, no motor


def test_rungs_are_tabulated_from_the_cheapest():
    machines = [machine_of(load_scene(name)) for name in scene_names()]
    assert {name for each in machines for name in each.ladders} >= {"joint", "film", "beam"}
    for rungs in (rungs for each in machines for rungs in each.ladders.values()):
        costs = [rung.nanoseconds_per_step for rung in rungs]
        assert costs == sorted(costs)
        assert all(rung.assumes and rung.valid for rung in rungs)


@pytest.mark.parametrize(
    ("name", "changes", "where", "rung", "cure"),
    [
        ("triplex-pump", {}, "pressure", "heads", "suction_line is missing"),
        ("bilge-pump", {"joint.crankpin.diametral_clearance": 0}, "crankpin", "link", "clearance"),
        ("bilge-pump", {"drive.speed": "900 rpm"}, "pressure", "heads", "vapour"),
        ("propulsion-shaft", {}, "film", "map", "is for an aligned journal"),
        (
            "journal-bearing",
            {"bearing.scar_depth": "5 um", "film.rung": "direct"},
            "film",
            "short",
            "needs a plain bore",
        ),
        ("propulsion-shaft", {}, "elements", "x2", "half a bending wave"),
        (
            "journal-step",
            {"numerics.integrator": "euler", "numerics.step": 1e-4, "sample_rate": 2560},
            "step",
            "x4",
            "0.1 rad of the shaft",
        ),
        ("journal-step", {"bearing.length": "0.16 m"}, "film", "short", "must be <= 1"),
        ("slider-crank-benchmark", {"numerics.step": 13e-6}, "step", "x2", "the contact's rate"),
    ],
)
def test_what_a_scene_does_not_admit_is_refused_with_the_reason(name, changes, where, rung, cure):
    if name == "bilge-pump" and "drive.speed" not in changes:
        changes = {**changes, "joint.crankpin.rung": "ideal"}
    scene = load_scene(name, changes)
    each = effect(scene, where)
    assert cure in each.refusal(scene, rung)
    assert rung not in [row.name for row in admissible(each, scene)]
    assert each.current(scene) in [row.name for row in admissible(each, scene)]


def test_a_refusal_is_not_that_of_another_effect():
    """A film outside its validity refuses no mesh: choosing may well raise the film."""
    scene = load_scene("journal-step", {"bearing.length": "0.16 m", "film.rung": "map"})
    written = scene.model_copy(update={"film": scene.film.model_copy(update={"rung": "short"})})
    assert orbit_faults(written)
    assert [r.name for r in admissible(effect(written, "mesh"), written)] == ["x2", "x1", "x1/2"]
    assert [r.name for r in admissible(effect(written, "film"), written)] == ["map", "direct"]


@pytest.mark.parametrize(
    ("name", "values", "where"),
    [
        ("propulsion-shaft", {"shaft.longest_element": 0.8}, "elements"),
        (
            "journal-step",
            {
                "numerics.integrator": "euler",
                "numerics.step": 4e-4,
                "sample_rate": 2560,
                "tacho": None,
            },
            "step",
        ),
    ],
)
def test_what_a_run_refuses_no_rung_offers(name, values, where):
    """Of scenes whose written level is refused, what is left runs."""
    short = {"duration": 2 / load_scene(name).drive.speed}
    scene = load_scene(name, short)
    changed = with_values(scene, values)
    with pytest.raises(SceneError):
        simulate(changed, seed=1)
    left = admissible(effect(changed, where), changed)
    assert left
    assert "x1" not in [rung.name for rung in left]
    assert simulate(with_values(changed, left[0].values), seed=1).status.ok


@pytest.mark.parametrize("name", ["propulsion-shaft", "shaft-rig"])
def test_elements_and_states_of_a_line_are_told_without_its_beam(name):
    written = load_scene(name).shaft.longest_element
    for factor in (4, 1, 0.25):
        scene = load_scene(name, {"shaft.longest_element": factor * written})
        lengths = np.diff(shaft_beam(scene).stations)
        assert_allclose(element_lengths(scene), lengths, rtol=1e-9)  # the same mesh, rounded
        assert bool(element_faults(scene)) == (name == "propulsion-shaft" or factor == 4) * (
            factor > 1
        )
    scene = load_scene(name)
    states = len(reduced_rotor(scene, shaft_state(scene)).poles)
    # housings, discs and the line's ends shift the count of modes by one or two a plane
    assert abs(states - shaft_states(scene)) <= 4 * 3


def test_levels_of_a_step_are_whole_parts_of_a_sample():
    """Finer by factors of two, which the order of convergence needs; coarser as far as it goes."""
    parts = {}
    for name in PUMPS:
        scene = load_scene(name)
        rungs = effect(scene, "step").rungs
        steps = [1 / (scene.sample_rate * rung.values["numerics.step"]) for rung in rungs]
        parts[name] = dict(zip([rung.name for rung in rungs], steps, strict=True))
        for each, level in zip(steps, rungs, strict=True):
            run = with_values(scene, {**level.values, "duration": 2 / scene.drive.speed})
            taken = simulate(run, seed=1).numerics["step_s"]
            assert_allclose(1 / (scene.sample_rate * taken), each, rtol=1e-12)  # and so it runs
    expected = {
        "bilge-pump": {"x2": 2, "x1": 3, "x1/2": 6, "x1/4": 12},  # two at the least: no x4
        "slider-crank-benchmark": {"x4": 3, "x2": 5, "x1": 9, "x1/2": 18, "x1/4": 36},
        "triplex-pump": {"x2": 2, "x4/3": 3, "x1": 4, "x1/2": 8, "x1/4": 16},
    }
    for name, levels in expected.items():
        assert parts[name] == pytest.approx(levels)
    # one more step a sample than what is written needs would be one too many
    scene = load_scene("slider-crank-benchmark")
    assert 8 < 1 / (scene.sample_rate * pump_step(scene)) <= 9


def test_meshes_of_an_orbit_go_by_factors_of_two_those_of_a_line_by_one_way_at_a_time():
    meshes = effect(load_scene("journal-bearing"), "mesh").rungs
    assert [tuple(rung.values.values()) for rung in meshes] == [(36, 9), (72, 17), (144, 33)]
    meshes = effect(load_scene("shaft-rig"), "mesh").rungs
    assert {rung.name: tuple(rung.values.values()) for rung in meshes} == {
        "x2": (24, 7),
        "x1 round": (48, 7),
        "x1": (48, 13),
        "x1/2 round": (96, 13),
        "x1/2": (96, 25),
        "x1/4 round": (192, 25),
        "x1/4": (192, 49),
    }


def test_a_mesh_finer_round_the_bore_is_worth_its_rung():
    """Nodes round the bore are cheap and most of the error: half of it for a tenth of the cost."""
    scene = load_scene("shaft-rig", {"duration": "0.3 s"})
    rungs = {rung.name: rung for rung in effect(scene, "mesh").rungs}

    def coefficients(name):
        state = shaft_state(with_values(scene, rungs[name].values))
        return np.concatenate([state.film.stiffness.ravel(), state.film.positions.ravel() * 1e12])

    finest = coefficients("x1/4")
    errors = {
        name: np.linalg.norm(coefficients(name) - finest) for name in ("x1", "x1/2 round", "x1/2")
    }
    assert errors["x1"] > errors["x1/2 round"] > errors["x1/2"]
    costs = {name: cost_of(with_values(scene, rungs[name].values)) for name in errors}
    assert costs["x1/2 round"] - costs["x1"] < 0.25 * (costs["x1/2"] - costs["x1"])


def test_a_step_is_stable_for_every_rung_of_the_joints():
    """The levels hold whichever joints are chosen: none is refused for the stiffest contact."""
    scene = load_scene("triplex-pump")
    rungs = {each.name: admissible(each, scene)[-1] for each in effects_of(scene)}
    values = {path: value for rung in rungs.values() for path, value in rung.values.items()}
    coarse = effect(scene, "step").rungs[0].values
    assert effect(scene, "step").refusal(with_values(scene, values), "x1") is None
    assert pump_step(with_values(scene, {**values, **coarse})) <= 0.5 / scene.sample_rate


# --- values


def test_values_change_nothing_else():
    for name in scene_names():
        scene = load_scene(name)
        assert with_values(scene, {}) == scene
        changed = with_values(scene, {"accuracy": 0.05}).model_dump()
        assert changed == {**scene.model_dump(), "accuracy": 0.05}


def test_a_scene_without_a_tacho_stays_without():
    scene = load_scene("bilge-pump", {"tacho": None})
    assert with_values(scene, {"joint.crankpin.rung": "ideal"}).tacho is None


def test_a_throw_with_its_own_joint_gets_the_rung_too():
    own = {"throws.1.joint": {"crankpin": {"diametral_clearance": "0.1 mm"}}}
    scene = load_scene("triplex-pump", own)
    changed = with_values(scene, effect(scene, "crankpin").rung("ideal").values)
    assert [changed.joints(throw).crankpin.rung for throw in range(3)] == ["ideal"] * 3
    assert_allclose(changed.joints(1).crankpin.clearance_diametral, 1e-4)


def test_an_unknown_effect_is_refused_with_the_nearest():
    with pytest.raises(SceneError, match=r"'presure' is no effect .*did you mean 'pressure'"):
        load_scene("bilge-pump", {"pinned": ["presure"]})
    # beside other faults too
    with pytest.raises(SceneError, match="2 fault"):
        load_scene("bilge-pump", {"pinned": ["presure"], "accuracy": 2})
    with pytest.raises(SceneError, match="fidelity = "):
        load_scene("bilge-pump", {"fidelity": "best"})


# --- cost: counted, never timed


@pytest.mark.parametrize("name", PUMPS)
def test_predicted_steps_are_those_of_a_pumps_run(name):
    scene = load_scene(name, {"duration": 1.5 / load_scene(name).drive.speed})
    numerics = simulate(scene, seed=1).numerics
    per_sample = round(1 / (scene.sample_rate * numerics["step_s"]))
    # what is not counted: the casing's filter at either end; a sample is lost by rounding at most
    beside = 2 * edge_samples(per_sample) * per_sample
    assert abs(numerics["steps"] - pump_steps(scene) - beside) <= per_sample
    assert numerics["step_s"] <= pump_step(scene) * (1 + 1e-9)


def calls_of(name, tolerance):
    """Solves of an orbit, over those that are predicted; the scene."""
    scene = load_scene(name, {"film.rung": "short", "numerics.tolerance": tolerance})
    return simulate(scene, seed=1).numerics["film_calls"] / journal_calls(scene), scene


@pytest.mark.parametrize("tolerance", [1e-6, 1e-5, 1e-4])
def test_predicted_calls_are_those_of_orbits(tolerance):
    """How lively an orbit is cannot be seen in its scene: right in the mean, and near enough."""
    found = [calls_of(name, tolerance) for name in JOURNALS]
    # a constant is fitted to the mean over these scenes at 1e-5; golden, to a tenth
    mean = np.exp(np.mean([math.log(ratio) for ratio, _ in found]))
    assert 1 / 1.2 < mean < 1.2
    for ratio, scene in found:
        # a miscount reorders films only where it exceeds the ratio of their costs
        costs = [cost_of(with_values(scene, {"film.rung": rung})) for rung in ("map", "direct")]
        assert max(ratio, 1 / ratio) < costs[1] / costs[0]


@pytest.mark.parametrize("name", JOURNALS)
def test_a_finer_tolerance_takes_more_calls_by_less_than_a_level(name):
    """Predicted is twice as many for each level; a level further it would be four times."""
    ratios = [calls_of(name, 1e-5 * factor**4)[0] / factor for factor in (4, 2, 1, 0.5)]
    for coarse, fine in pairwise(ratios):
        assert 1 < fine / coarse < 4


def test_predicted_calls_follow_the_fastest_force():
    """A force of order 6 takes five times the steps of the unbalance; one of no size takes none."""
    ratios = []
    for force in ("0 N", "200 N"):
        orders = [{"order": 6.0, "amplitude": force}]
        scene = load_scene("journal-bearing", {"film.rung": "short", "load.orders": orders})
        calls = simulate(scene, seed=1).numerics["film_calls"]
        ratios.append(calls / journal_calls(scene))
    assert 1 / 2 < ratios[1] / ratios[0] < 2


def test_a_fixed_step_asks_for_as_many_solves_as_predicted():
    scene = load_scene("journal-step", {"film.rung": "short", "numerics.integrator": "rk4"})
    calls = simulate(scene, seed=1).numerics["film_calls"]
    assert calls == pytest.approx(journal_calls(scene), rel=0.05)  # whole steps to a sample


@pytest.mark.parametrize("name", scene_names())
def test_a_better_rung_or_a_finer_level_costs_no_less(name):
    scene = load_scene(name)
    # the same step for all, as a choice has it: what is left to itself depends on the contact
    steps = [each.rungs[-1].values for each in effects_of(scene) if each.name == "step"]
    for each in effects_of(scene):
        same = steps[0] if steps and each.name != "step" else {}
        costs = [
            cost_of(with_values(scene, {**same, **rung.values})) for rung in admissible(each, scene)
        ]
        if each.name == "film" and "map" in [rung.name for rung in each.rungs]:
            costs = [costs[0], costs[-1]]  # a table pays or does not, by the length of the run
        assert costs == sorted(costs), each.name


# --- guards


def test_margin_and_expected_error_of_a_pump_follow_its_step():
    steps = (1e-6, 2e-6)
    changes = [{"numerics.step": step, "duration": "0.2 s"} for step in steps]
    short, long = (simulate(load_scene("bilge-pump", c), seed=1).numerics for c in changes)
    ratio = long["step_s"] / short["step_s"]
    assert_allclose((1 - long["stability_margin"]) / (1 - short["stability_margin"]), ratio)
    assert_allclose(long["estimated_error"] / short["estimated_error"], ratio**4)  # its order
    assert 0 < long["stability_margin"] < short["stability_margin"] < 1


def test_squeeze_rate_of_a_short_bearing():
    """Centred journal: squeezed oil holds pressure on one half of the circle, pi/2 of cos^2."""
    film = short_film(0.5)
    run = run_orbit(film, load(alpha=1.0), duration=0.1)
    # P = 6 (L/D)^2 ... integrated over the length: 4 (L/D)^2 a unit of cos; wedge none at rest
    assert_allclose(squeeze_rate(film, run), 4 * 0.25 * math.pi / 2, rtol=1e-3)


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
def test_margin_of_an_orbit_says_where_its_step_becomes_unstable(integrator):
    """Doubling the step until the run is refused: the margin shrinks with it."""
    changes = {
        "film.rung": "short",
        "numerics.integrator": integrator,
        "sample_rate": 400,
        "tacho": None,
    }
    margins, step = [], 2e-5
    while step < 2e-3:
        scene = load_scene("journal-bearing", {**changes, "numerics.step": step})
        result = simulate(scene, seed=1, raise_on_failure=False)
        if not result.status.ok:
            break
        margins.append(result.numerics["stability_margin"])
        step *= 2
    assert not result.status.ok
    assert result.status.name == "SQUEEZE"
    assert margins[0] > 0.5
    assert margins == sorted(margins, reverse=True)
    # twice the step doubles what is used up, and that was too much
    assert 2 * (1 - margins[-1]) > 1 - 0.2


def test_an_adaptive_orbit_is_stable_at_any_step():
    numerics = simulate(load_scene("journal-bearing"), seed=1).numerics
    assert numerics["stability_margin"] == 1.0
    assert numerics["estimated_error"] == load_scene("journal-bearing").numerics.tolerance
    assert journal_film(load_scene("journal-bearing")) is not None


def test_guards_of_a_line_are_its_least_damped_motion_and_the_error_of_its_basis():
    numerics = simulate(load_scene("shaft-rig"), seed=1).numerics
    assert 0 < numerics["stability_margin"] == numerics["least_damping_ratio"] < 0.1
    assert numerics["least_damped_hz"] > 0
    assert 0 < numerics["estimated_error"] < 1e-3
