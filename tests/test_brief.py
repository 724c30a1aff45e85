"""Short texts of results: what public classes print in a console."""

from dataclasses import dataclass

import numpy as np
import pytest
import wearstate
from wearstate.sim.brief import brief

LONGEST = 200
"""Characters: two lines of a console."""


@pytest.fixture(scope="module")
def results():
    """Results that hold arrays, and scenes, by their public names."""
    bearing = wearstate.film.JournalBearing(
        diameter=0.1, length=0.05, clearance=1e-4, viscosity=0.02
    )
    point = wearstate.film.operate(bearing, speed=50.0, load=(0.0, -1e3))
    line = wearstate.load_scene("propulsion-shaft")
    aligned = wearstate.align.align(line)
    state = wearstate.shaft.shaft_state(line)
    return {
        "operate": point,
        "whirl": point.whirl,
        "equilibrium": point.equilibrium,
        "solution": point.equilibrium.film,
        "scene": wearstate.load_scene("bilge-pump"),
        "line": line,
        "align": aligned,
        "alignment line": aligned.line,
        "condition": aligned.states[0],
        "calibration": aligned.calibration,
        "shaft_state": state,
        "beam": state.beam,
        "films": state.film,
        "rotor": state.rotor,
        "modes": wearstate.shaft.modes(state.rotor, 10.0),
        "campbell": wearstate.shaft.campbell(state.rotor, [1.0, 10.0]),
        "map": wearstate.film.impedance_map(wearstate.film.FilmGeometry(length_to_diameter=0.5)),
    }


def test_results_are_told_in_one_short_line(results):
    for name, value in results.items():
        text = repr(value)
        assert text.startswith(f"<{type(value).__name__} "), name
        assert len(text) <= LONGEST, f"{name}: {text}"
        assert "\n" not in text


def test_the_line_says_what_one_asks_for_first(results):
    assert repr(results["scene"]) == str(results["scene"])
    assert repr(results["scene"]) == "<PumpScene bilge-pump, 4.8 s, 25.6 kHz>"
    assert repr(results["align"]) == "<Alignment name='propulsion-shaft', verdict='within'>"
    ratio = results["operate"].eccentricity_ratio
    assert f"eccentricity_ratio={ratio:.4g}, " in repr(results["operate"])
    assert "status=ok" in repr(results["equilibrium"])


def test_kinds_of_fields():
    @dataclass
    class Each:
        """Of every kind."""

        flag: object
        none: object
        text: object
        numbers: object
        table: object
        matrix: object
        __repr__ = brief()

    long = Each(True, None, "x" * 99, (1.5, 2), {"a": Each, "b": 2}, np.zeros((0, 2)))
    assert repr(long) == f"<Each flag=True, text='{'x' * 39}…', numbers=(1.5, 2), table=2 of type>"


@pytest.mark.parametrize("name", ["bilge-pump", "journal-bearing", "propulsion-shaft"])
def test_a_scene_shows_its_parts_in_a_notebook(name):
    shown = wearstate.load_scene(name)._repr_html_()
    assert f"{name}, " in shown
    assert "<tr><td>duration</td><td>" in shown
    assert 10 < shown.count("<tr>") < 40
    assert "None" not in shown
