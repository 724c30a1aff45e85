"""The script behind the page on fidelity: every scene it shortens exists, a chart comes of one."""

import importlib.util
import re
from pathlib import Path

import pytest
import wearstate
from wearstate.sim.scene.load import load_scene, scene_names

DOCS = Path(wearstate.__file__).parent / "docs"


@pytest.fixture(scope="module")
def figures():
    spec = importlib.util.spec_from_file_location("figures_fidelity", DOCS / "figures_fidelity.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_only_built_in_scenes_are_shortened(figures):
    assert set(figures.SHORTER) <= set(scene_names())
    for name, values in figures.SHORTER.items():
        assert load_scene(name, values).duration < load_scene(name).duration
    for name, values in figures.COARSER.items():
        assert load_scene(name, values).accuracy > load_scene(name).accuracy


def test_the_page_shows_what_the_script_draws(figures):
    page = (DOCS / "fidelity.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\]\(img/([^)]+)\.png\)", page)) == set(figures.FIGURES)


@pytest.mark.parametrize("scene", ["bilge-pump", "journal-bearing"])
def test_a_small_map_has_steps_that_hold_and_steps_that_fail(figures, scene):
    plan = {"bilge-pump": "step-stiffness", "journal-bearing": "step-squeeze"}[scene]
    [sheet] = figures.small_map(scene, plan, 4).subfigs
    words = {text.get_text() for legend in sheet.legends for text in legend.get_texts()}
    assert words >= {"accurate", "unstable (numerical cause)"}


def test_a_chart_keeps_to_its_budget(figures, monkeypatch):
    small = {"film.n_theta": 24, "film.n_z": 5, "duration": "0.05 s"}
    monkeypatch.setitem(figures.SHORTER, "journal-bearing", small)
    chart = figures.chart("journal-bearing", budget=1e-3, jobs=1)
    assert chart.status == "out of budget"
    [choice] = chart.choices
    assert choice.status == "no answer yet"  # but for the reference nothing fine enough was run
    assert (choice.block, choice.options) == ("", "")
    assert chart.winner == ""
    assert chart.measured < chart.planned
