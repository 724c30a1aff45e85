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


def test_every_picture_of_the_page_is_there():
    shown = re.findall(r"\]\((img/[^)]+)\)", (DOCS / "fidelity.md").read_text(encoding="utf-8"))
    every = {f"img/{kind}-{name}.png" for kind in ("chart", "atlas") for name in scene_names()}
    assert every <= set(shown)
    assert [name for name in shown if not (DOCS / name).is_file()] == []


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
