"""Modal fits of measured response functions; the files are not part of the project."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.features.response import modal, resonance, response_change, stable_poles

BEAM_PEAKS = [52, 142, 279, 460, 687, 959]
"""Lines of the peaks of the three points together [Hz]."""

FREE_FREE = np.array([4.730041, 7.853205, 10.995608, 14.137165, 17.278760, 20.420352])
"""Roots of ``cos x cosh x = 1``: frequencies of a uniform free beam go with their squares."""

PUBLISHED = {"case1": 212.092530551, "case2": 192.59382330}
"""What the package that ships the files gets from lines 500 … 999 [Hz]."""


@pytest.fixture(scope="module")
def beam(realdata):
    folder = realdata / "pyuff_beam_frf_MIT"
    if not folder.is_dir():
        pytest.skip("the measured beam is not here")
    rows = [(folder / f"meas_point_{i}.txt").read_text().split() for i in (1, 2, 3)]
    return np.arange(1001.0), np.array([[complex(x) for x in row] for row in rows])


@pytest.fixture(scope="module")
def case(realdata):
    folder = realdata / "vibrationtesting_frf_MIT"
    if not folder.is_dir():
        pytest.skip("the measured response functions are not here")
    from scipy.io import loadmat

    def read(name):
        table = loadmat(folder / f"{name}.mat")
        lines = slice(500, 1000)
        return table["Freq_domain"].ravel()[lines].astype(float), table["Hf_chan_2"].ravel()[lines]

    return read


def test_the_peaks_of_the_beam(beam):
    frequency, value = beam
    assert frequency[resonance.find_resonances(frequency, value)].tolist() == BEAM_PEAKS
    for i in (1, 2):  # each of these alone shows all of them; the first has a peak at 1 Hz, too
        assert frequency[resonance.find_resonances(frequency, value[i])].tolist() == BEAM_PEAKS


def test_the_modes_of_the_beam(beam):
    frequency, value = beam
    found = modal.modal_fit(frequency, value)
    # Six modes and no more, each within half a line of its peak.
    assert_allclose(found.frequency, BEAM_PEAKS, rtol=0, atol=0.6)
    assert np.all((found.damping_ratio > 5e-5) & (found.damping_ratio < 1e-3))
    assert np.all(found.frequency_deviation < 0.005)
    # Inferred, not told with the files: a free beam. Thickness lowers the high ones a little.
    ratios = found.frequency / found.frequency[2]
    assert_allclose(ratios, (FREE_FREE / FREE_FREE[2]) ** 2, rtol=0.01)
    # The model says what was measured.
    assert np.all(found.fit_error < 0.05)


def test_every_point_of_the_beam_has_the_same_modes(beam):
    frequency, value = beam
    whole = modal.modal_fit(frequency, value)
    for row in value:
        alone = modal.modal_fit(frequency, row, band=(20.0, 1000.0))
        assert alone.frequency.size == 6
        # A fiftieth of a line, or five of the stated deviations where a point lies near a node.
        limit = np.maximum(0.03, 5 * alone.frequency_deviation)
        assert np.all(np.abs(alone.frequency - whole.frequency) < limit)


def equation_error(frequency, value):
    """Pole of ``(s^2 + b1 s + b0) H = a0 + a1 s + a2 s^2``, least squares of the difference.

    With the mirrored lines, unweighted and in the unscaled s: what the published figures are.
    """
    s = 2j * np.pi * np.concatenate([-frequency[::-1], frequency])
    h = np.concatenate([np.conj(value[::-1]), value])
    columns = np.stack([h, s * h, -np.ones_like(s), -s, -(s**2)], axis=1)
    size = np.linalg.norm(columns, axis=0)
    b0, b1 = (np.linalg.lstsq(columns / size, -(s**2) * h, rcond=None)[0] / size)[:2]
    return np.roots([1, b1, b0])[0]


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_published_figures_are_those_of_a_linear_fit(case, name):
    pole = equation_error(*case(name))
    # The frequencies are stored in single precision, 3e-8 of them.
    assert_allclose(abs(pole) / (2 * np.pi), PUBLISHED[name], atol=2e-5)
    # The second one grows: no mode of a passive structure.
    assert (pole.real < 0) == (name == "case1")


def test_the_first_case(case):
    frequency, value = case("case1")
    spacing = frequency[1] - frequency[0]
    found = modal.modal_fit(frequency, value, n_modes=1)
    # 0.0016 Hz were seen, a two-hundredth of a line. The published fit weighs its error by s^2 and
    # by the distance to the pole, ours does not; leakage is in all lines: the half-power width is
    # 1.2 of them.
    assert_allclose(found.frequency, PUBLISHED["case1"], atol=spacing / 100)
    assert_allclose(found.damping_ratio, 8.4e-4, rtol=0.08)  # the published fit has 8.1e-4


def test_the_second_case_is_no_mode(case):
    frequency, value = case("case2")
    spacing = frequency[1] - frequency[0]
    line = int(np.argmax(np.abs(value)))
    assert_allclose(frequency[line], 192.5)
    # The phase rises by 180 degrees through the peak, in a function that is mostly noise.
    assert np.angle(value[line + 1] / value[line - 2]) > 2.5
    poles = stable_poles.complex_frequency_poles(frequency, value, range(1, 7))
    for found in poles:
        nearest = found[np.argmin(np.abs(found.imag - 2 * np.pi * frequency[line]))]
        assert_allclose(abs(nearest) / (2 * np.pi), PUBLISHED["case2"], atol=spacing / 6)
        assert nearest.real > 0
    with pytest.raises(ValueError, match="must decay, but grow: the phase rises"):
        modal.modal_fit(frequency, value)


def test_two_points_of_a_beam_are_not_alike(beam):
    frequency, value = beam
    assert np.all(response_change.frequency_response_assurance(value, value[[1, 2, 0]]) < 0.9)
    levels = response_change.band_response_levels(frequency, value, [20.0, 200.0, 500.0, 900.0])
    assert levels.shape == (3, 3)
