"""The script of the page on lubrication: its numbers stand on the page, and say what it says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def figures():
    spec = importlib.util.spec_from_file_location("figures_oil", DOCS / "figures_oil.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_row_of_the_page_is_what_the_script_finds(figures):
    rows = figures.stated()
    assert set(rows) == {(speed, name) for speed in figures.SPEEDS for name in figures.REGIMES}
    for name in ("dry", "starved, 20 um", "flooded, 0.1 Pa s"):
        level, _, _ = figures.run(figures.CLEARANCES[2], 300, name)
        assert level == pytest.approx(rows[300, name][2], rel=0.03)


def test_the_page_says_what_its_table_does(figures):
    rows = {key: np.array(levels) for key, levels in figures.stated().items()}
    for speed in (200, 300):
        dry, flooded = rows[speed, "dry"], rows[speed, "flooded, 0.1 Pa s"]
        assert np.median(dry / flooded) > 25
        assert np.ptp(flooded[:4]) < 0.25 * flooded[:4].mean()
        assert flooded[-1] > 1.5 * flooded[0]
        assert dry[3] < dry[1]


def test_the_figure_draws_the_table(figures):
    figure, rows = figures.picture(), figures.stated()
    for axes, speed in zip(figure.axes, figures.SPEEDS, strict=True):
        drawn = {line.get_label(): list(line.get_ydata()) for line in axes.lines}
        assert drawn == {name: rows[speed, name] for name in figures.REGIMES}
