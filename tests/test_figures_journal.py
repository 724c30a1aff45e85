"""The gallery's script of the journal: the figures show what the text says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import wearstate
from numpy.testing import assert_allclose

SCRIPT = Path(wearstate.__file__).parent / "docs" / "figures_journal.py"


@pytest.fixture(scope="module")
def figures():
    spec = importlib.util.spec_from_file_location("figures_journal", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_pulse_raises_pressure_and_force_and_is_forgotten(figures):
    _, solution, tau, place = figures.run("journal-rectangular-pulse")
    before = np.searchsorted(tau, 15.9 * np.pi)
    peak = solution.truth["peak_pressure_pa"]
    force = -solution.truth["film_force_n"][:, 0]
    late = tau > 16 * np.pi
    # of the paper, to 2 %: 4.6 and 3.9 times
    assert_allclose(peak[late].max() / peak[before], 4.6, rtol=0.02)
    assert_allclose(force[late].max() / force[before], 3.9, rtol=0.02)
    assert_allclose(place[-1], place[before], atol=1e-3)
    half_sine = figures.run("journal-half-sine")[3]
    assert np.hypot(*half_sine[late].T).max() < np.hypot(*place[late].T).max()


def test_half_frequency_whirl_fills_the_clearance_above_the_threshold(figures):
    sizes = {}
    for rpm in (4400, 5200):
        scene, _, _, place = figures.run("journal-whirl", {"drive.speed": rpm / 60})
        late = place[3 * len(place) // 4 :] @ np.array([1.0, 1.0j])
        sizes[rpm] = np.abs(late - late.mean()).max()
        if rpm == 5200:
            spectrum = np.fft.fft((late - late.mean()) * np.hanning(late.size))
            order = np.fft.fftfreq(late.size, 1 / scene.sample_rate) / scene.drive.speed
            assert_allclose(order[np.argmax(np.abs(spectrum))], 0.5, atol=0.06)  # one line is 0.046
    assert sizes[4400] < 1e-3
    assert sizes[5200] > 0.7


@pytest.mark.parametrize("name", ["journal-map", "journal-scar"])
def test_figures_say_that_they_are_simulated(figures, name, tmp_path):
    figure = figures.FIGURES[name]()
    assert "(simulated)" in figure.get_suptitle()
    figure.savefig(tmp_path / "figure.png", dpi=40)
    assert (tmp_path / "figure.png").stat().st_size > 5_000
