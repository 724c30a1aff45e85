"""The scene in its maps: where it lies, how far the next failure is, budget, page and symbols."""

import html
import io
import itertools
import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.stability import atlas as stability_atlas
from wearstate.diagnose.stability import method_map as stability
from wearstate.diagnose.stability.atlas import atlas
from wearstate.diagnose.stability.edges import conclusion, with_edges
from wearstate.diagnose.stability.figure import COLOUR, SYMBOL, atlas_figure
from wearstate.diagnose.stability.joint_maps import contact_oscillator
from wearstate.diagnose.stability.maps import MAPS
from wearstate.diagnose.stability.method_map import (
    Budget,
    MapAxis,
    MapPlan,
    Own,
    Verdict,
    measure,
    unmeasured,
)
from wearstate.diagnose.stability.own_point import own_film
from wearstate.diagnose.stability.page import atlas_html
from wearstate.diagnose.stability.text import stability_table
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.pump.run_plan import steps_per_sample
from wearstate.sim.scene.load import load_scene

DECADE = (0.1, 0.3, 1.0, 3.0, 10.0)


def plan_of(judge, *, x=1.0, y=1.0, others=(), **more):
    axis = MapAxis(name="step", unit="s", values=DECADE)
    own = Own(method="own", x=x, y=y)
    judges = {**dict.fromkeys(others, judge), "own": judge}
    title = "a test"
    across = replace(axis, name="stiffness", unit="N/m")
    return MapPlan(name="plane", title=title, x=axis, y=across, judges=judges, own=own, **more)


def ends_at(limit, verdict=Verdict.UNSTABLE, word="grows"):
    """Judge of a method that fails beyond a limit of x."""
    return lambda x, _y: (verdict, word) if x > limit else (Verdict.ACCURATE, "")


# --- edges


@pytest.mark.parametrize("limit", [1.4, 2.2, 5.0])
def test_an_edge_is_halved_to_a_few_per_cent_of_the_limit_itself(limit):
    found = with_edges(measure(plan_of(ends_at(limit))))
    (edge,) = [e for e in found.edges if e.verdict is Verdict.UNSTABLE]
    assert (edge.axis, edge.rising) == ("x", True)
    assert edge.inside <= limit < edge.outside
    assert edge.outside / edge.inside <= 1.17  # 3 and a third to one, halved three times


def test_the_words_tell_the_distance_and_the_cause_of_the_next_failure():
    text = conclusion(with_edges(measure(plan_of(ends_at(5.0)))))
    factor = float(re.search(r"Stable up to ([\d.]+) times this step", text)[1])
    assert 5.0 / 1.17 <= factor <= 5.0
    assert "next failure: unstable (numerical cause), grows." in text
    assert "down to 0.1 times this step (end of the map)" in text


def test_accuracy_ends_before_stability_and_both_are_told():
    def judge(x, _y):
        if x > 5.0:
            return Verdict.UNSTABLE, "grows"
        return (Verdict.INACCURATE, "off by 0.3") if x > 2.0 else (Verdict.ACCURATE, "")

    text = conclusion(with_edges(measure(plan_of(judge))))
    accurate, stable = (
        float(re.search(rf"{word} up to ([\d.]+) times", text)[1])
        for word in ("Accurate", "Stable")
    )
    assert 2.0 / 1.17 <= accurate <= 2.0
    assert 5.0 / 1.17 <= stable <= 5.0


def test_the_nearest_of_four_ways_is_told_first_in_whatever_direction():
    def judge(x, y):
        if y < 0.5:
            return Verdict.WHIRL, "late motion 3 times the early motion"
        return (Verdict.UNSTABLE, "grows") if x > 5.0 else (Verdict.ACCURATE, "")

    text = conclusion(with_edges(measure(plan_of(judge))))
    assert re.search(
        r"Stable down to 0\.5\d? times this stiffness; next failure: whirl \(phys", text
    )
    assert text.index("whirl") < text.index("up to 4")


def test_a_scene_that_is_bad_itself_is_told_so_with_the_way_out():
    text = conclusion(with_edges(measure(plan_of(ends_at(0.5, Verdict.INACCURATE, "off by 0.3")))))
    assert "inaccurate (numerical cause), off by 0.3." in text
    factor = float(re.search(r"earest accurate cell: ([\d.]+) times this step", text)[1])
    assert 0.5 / 1.17 <= factor <= 0.5


def test_a_knocking_pump_that_knocks_otherwise_has_not_failed():
    def judge(x, _y):
        return (Verdict.CHAOTIC if x > 2 else Verdict.LOST), "in flight"

    found = with_edges(measure(plan_of(judge)))
    assert all(edge.verdict is Verdict.NOT_RUN and edge.whole for edge in found.edges)
    assert "No failure found" in conclusion(found)


def test_a_scene_on_one_axis_alone_gets_the_range_of_the_other():
    found = with_edges(measure(plan_of(ends_at(5.0), x=None)))
    assert {edge.axis for edge in found.edges} == {"x"}
    text = conclusion(found)
    low, high = re.search(r"accurate for step = (\S+ \S+) to ([\d.]+) s", text).groups()
    assert low == "100 ms"
    assert 5.0 / 1.17 <= float(high) <= 5.0
    nothing = with_edges(measure(plan_of(ends_at(0.0), x=None)))
    assert "nothing is accurate" in conclusion(nothing)


# --- honest where the budget ended


def runs_out_after(monkeypatch, n):
    """Judge that counts its runs, and a clock that passes the end of any budget at the n-th."""
    clock = SimpleNamespace(now=0.0, runs=[])

    def judge(x, y):
        clock.runs.append((x, y))
        clock.now = 100.0 if len(clock.runs) >= n else 0.0
        return ends_at(5.0)(x, y)

    for module in (stability, stability_atlas):
        fake = SimpleNamespace(monotonic=lambda: clock.now)
        monkeypatch.setattr(module, "time", fake)
    return judge, clock


@pytest.mark.parametrize("n", range(1, 13))
def test_a_map_cut_short_says_what_it_does_not_know(monkeypatch, n):
    judge, clock = runs_out_after(monkeypatch, n)
    budget = Budget(50.0)
    text = conclusion(with_edges(measure(plan_of(judge), budget), budget))
    cells = len(set(clock.runs))
    seen = any(x > 5.0 for x, _ in clock.runs)
    assert ("unstable" in text) is seen  # no failure is told that was not run
    assert ("not run beyond" in text) is (cells < 9)
    assert ("The budget ended before" in text) is (cells < 9)
    nothing = conclusion(with_edges(unmeasured(plan_of(judge))))
    assert nothing.startswith("The budget ended before the cell of this scene")


def test_the_budget_goes_to_the_scene_and_its_own_methods_first(monkeypatch):
    order = []

    def noted(name):
        def judge(x, y):
            order.append((name, x, y))
            return ends_at(50.0)(x, y)

        return judge

    own, aside = (replace(plan_of(None), name=name) for name in ("own", "aside"))
    own = replace(own, judges={"other": noted("other"), "own": noted("own")})
    aside = replace(aside, judges={"other": noted("far"), "own": noted("aside")}, secondary=True)
    scene = load_scene("bilge-pump")
    makers = {"aside": lambda *_: aside, "own": lambda *_: own}
    monkeypatch.setitem(MAPS, scene.machine, makers)
    atlas(scene)
    names = [name for name, _, _ in order]
    assert names[9:18] == ["aside"] * 9  # crosses of the scene's own method, then all of its own
    assert names[18 : 18 + 16] == ["own"] * 16
    assert set(names[34:]) == {"other", "aside", "far"}
    first = order[:9]  # the cross of its own map
    assert all(name == "own" and 1.0 in (x, y) for name, x, y in first)
    assert first[0] == ("own", 1.0, 1.0)


# --- where a scene lies


def test_a_pump_lies_at_the_step_and_the_stiffness_that_it_is_run_with():
    pump = load_scene("bilge-pump")
    plan = MAPS[pump.machine]["step-stiffness"](pump, 5)
    run = simulate(load_scene("bilge-pump", {"duration": "0.2 s"}), seed=0)
    assert_allclose(plan.own.x, run.numerics["step_s"])
    assert_allclose(plan.own.x, 1 / (pump.sample_rate * steps_per_sample(pump)))
    assert plan.own.y == pump.joint.crankpin.stiffness
    i, j = plan.cell
    assert (plan.x.values[j], plan.y.values[i]) == (plan.own.x, plan.own.y)
    speed = MAPS[pump.machine]["clearance-speed"](pump, 3).own
    assert (speed.x, speed.y) == (pump.drive.speed, pump.joint.crankpin.clearance_diametral)


def test_a_journal_lies_at_the_gap_and_sommerfeld_number_of_its_load():
    scene = load_scene("journal-bearing")
    found = own_film(scene)
    weight = scene.rotor.mass * scene.gravity + scene.load.static
    b, speed = scene.bearing, scene.drive.speed
    expected = (
        0.030 * speed * b.length * b.diameter / weight * (b.diameter / b.clearance_diametral) ** 2
    )
    assert_allclose(found.sommerfeld, expected, rtol=1e-9)
    still = load_scene("journal-bearing", {"rotor.unbalance": 0, "duration": "0.05 s"})
    orbit = simulate(still, seed=0, truth=True)
    least = orbit.truth["min_film_m"].min() / b.clearance_radial
    assert_allclose(found.gap, least, rtol=2e-3)  # the map is the direct film to 2e-4


def test_a_hertz_contact_has_its_mechanism_too_at_its_tangent_stiffness():
    pump = load_scene(
        "bilge-pump",
        {"joint.crankpin.elasticity": "hertz", "joint.crankpin.hertz_stiffness": 3e10},
    )
    plan = MAPS[pump.machine]["step-stiffness"](pump, 3)
    contact = contact_oscillator(pump)
    assert plan.own.y == contact.stiffness
    assert plan.judges[plan.own.method](plan.own.x, plan.own.y)[0] is Verdict.ACCURATE
    soft = contact_oscillator(
        load_scene(
            "bilge-pump",
            {"joint.crankpin.elasticity": "hertz", "joint.crankpin.hertz_stiffness": 3e10 * 8},
        )
    )
    assert_allclose(soft.stiffness / contact.stiffness, 8 ** (2 / 3), rtol=1e-3)


# --- what is shown


@pytest.fixture(scope="module")
def every_verdict():
    """A map in which each verdict has a column."""
    values = tuple(float(v) for v in range(1, len(Verdict) + 1))
    x = MapAxis(name="step", unit="s", values=values, log=False)
    y = replace(x, values=(1.0, 2.0, 3.0))
    plan = MapPlan(
        name="all", title="all", x=x, y=y,
        judges={"m": lambda x, _y: (Verdict(round(x) - 1), "word")},
    )  # fmt: skip
    return measure(plan)


def test_no_two_verdicts_share_a_symbol():
    marked = [SYMBOL[v] for v in Verdict if SYMBOL[v]]
    assert len(marked) == len(set(marked)) == len(Verdict) - 2
    assert len({COLOUR[v] for v in Verdict}) == len(Verdict)


def test_verdicts_are_told_apart_without_colours(every_verdict):
    from PIL import Image

    figure = atlas_figure(load_scene("bilge-pump"), [every_verdict])
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=150)
    grey = np.asarray(Image.open(picture).convert("L"), float)
    panel = figure.subfigs[0].axes[0]
    cells = []
    for x in every_verdict.plan.x.values:
        column, up = np.round(panel.transData.transform((x, 2.0)) * 150 / figure.dpi).astype(int)
        row = grey.shape[0] - up
        cells.append(grey[row - 8 : row + 9, column - 8 : column + 9])
    for one, other in itertools.combinations(cells, 2):
        assert np.abs(one - other).max() > 40  # of 255: a line of a symbol, or the ground


def test_every_map_names_the_scene_in_every_panel():
    scene = load_scene("bilge-pump")
    plan = plan_of(ends_at(5.0), others=("a", "b", "c"))
    figure = atlas_figure(scene, [with_edges(measure(plan))])
    panels = figure.subfigs[0].axes
    assert len(panels) == 4
    for panel in panels:
        assert "this scene" in [text.get_text() for text in panel.texts]
    assert panels[0].get_title() == "own (this scene)"
    line = atlas_figure(scene, [measure(plan_of(ends_at(5.0), x=None))])
    assert "this scene" in [text.get_text() for text in line.subfigs[0].axes[0].texts]


def test_the_page_says_the_conclusions_before_the_first_map():
    scene = load_scene("bilge-pump")
    maps = [with_edges(measure(plan_of(ends_at(5.0))))]
    page = atlas_html(scene, maps)
    top = page[: page.index("<figure")]
    assert "Stable up to 4" in top
    assert "this scene" in top
    assert page == atlas_html(scene, maps)
    assert not re.search(r"<script|https?://", page)


def test_the_command_writes_a_page_and_tells_the_edges_in_json(tmp_path):
    page = tmp_path / "atlas.html"
    arguments = ["journal-bearing", "--map", "length-load"]
    done = CliRunner().invoke(
        cli, ["stability", *arguments, "--size", "3", "-o", str(page), "--json"]
    )
    assert done.exit_code == 0, done.output
    (found,) = json.loads(done.stdout)["maps"]
    assert found["own"]["method"] == "direct"
    assert found["own"]["cause"] in (None, "numerical")
    assert found["own"]["x"] == 0.6
    assert {"times_own", "inside", "outside", "cause"} <= set(found["edges"][0])
    assert found["conclusion"] in html.unescape(page.read_text())


def test_the_table_and_the_words_are_of_one_mind():
    found = with_edges(measure(plan_of(ends_at(5.0))))
    (table,) = stability_table(load_scene("bilge-pump"), [found])["maps"]
    (edge,) = [each for each in table["edges"] if each["verdict"] == "unstable"]
    assert f"up to {edge['times_own']:.2g} times this step" in table["conclusion"]
    assert not math.isnan(edge["times_own"])
