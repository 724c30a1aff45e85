"""The gallery's script of the shaft: the figures show what the text says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import wearstate
from wearstate.sim.shaft_response.receptance import accelerance

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


def test_peaks_fall_where_the_push_hears_the_films(figures, monkeypatch):
    """Beside the light bearings of the rig, not at its heavy end, and on the ship hardly."""
    monkeypatch.setattr(figures, "SPEED_SHARES", (1.0,))
    forward = figures.aligned_peaks.__wrapped__("shaft-rig", "forward", "y")
    aft = figures.aligned_peaks.__wrapped__("shaft-rig", "aft", "y")
    ship = figures.aligned_peaks.__wrapped__("propulsion-shaft", "stern_aft", "y")
    falls = [cell[2] for cell in forward]
    assert falls == sorted(falls, reverse=True)  # the more, the larger the sag
    assert falls[-1] < -6
    assert forward[2][0] >= 3  # some fall
    assert forward[2][1] >= 3  # and as many rise
    assert min(cell[2] for cell in aft) > -3
    assert min(cell[2] for cell in ship[:3]) > -1  # as long as the bearing carries


def test_films_and_sensors_count_for_more_than_averages(figures, monkeypatch):
    monkeypatch.setattr(figures, "BURSTS", (10, 100))
    sags = figures.detectable_sags.__wrapped__
    four = sags("third", "y", 4, 0.03)
    assert 0.07 < four[1] < four[0] < 0.12
    assert sags("third", "y", 4, 0.01)[0] < 0.5 * four[0]
    one = sags("third", "y", 1, 0.03)
    assert one[0] > 1.5 * four[0]
    assert one[1] < 0.7 * one[0]
