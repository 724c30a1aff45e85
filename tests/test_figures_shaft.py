"""The gallery's script of the shaft: the figures show what the text says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import wearstate
from wearstate.sim.shaft_response import accelerance

SCRIPT = Path(wearstate.__file__).parent / "docs" / "figures_shaft.py"


@pytest.fixture(scope="module")
def figures():
    spec = importlib.util.spec_from_file_location("figures_shaft", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_calibration_turns_an_upside_down_bearing_over(figures):
    before, after = (state.film.reactions[:, 0] for state in figures.states().values())
    assert before[2] < 0 < after[2]
    assert np.ptp(after) < np.ptp(before)
    moved = np.abs(figures.calibration().moves) > 5e-6  # no chock is cut finer
    assert moved.tolist() == [False, False, True, True, False]


def test_alignment_moves_peaks_of_springs_but_hardly_those_of_films(figures):
    hertz = np.linspace(10.0, 250.0, 500)
    place = [("thrust_block", "y", "housing")]

    def level(rotor):
        h = accelerance(rotor, hertz, place, [("stern_aft", "y")], speed=10 * np.pi)
        return 20 * np.log10(np.abs(h[:, 0, 0]))

    films = [state.rotor for state in figures.states().values()]
    springs = [figures.springs_alone(rotor) for rotor in films]
    change = np.abs(level(films[1]) - level(films[0]))
    other = np.abs(level(springs[1]) - level(springs[0]))
    assert np.median(change) < 1.0 < 3.0 < np.median(other)
    assert other.max() > 20.0


@pytest.mark.parametrize("name", ["shaft-model", "shaft-influence", "shaft-films"])
def test_figures_say_that_they_are_simulated(figures, name, tmp_path):
    figure = figures.FIGURES[name]()
    assert "(simulated)" in figure.get_suptitle()
    figure.savefig(tmp_path / "figure.png", dpi=40)
    assert (tmp_path / "figure.png").stat().st_size > 5_000
