"""The cepstrum against echoes, whose series is known, and click trains."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features.signal.cepstrum import cepstrum, cepstrum_of_lines, harmonic_spacing

FS = 16_000.0


def echo_lines(strength, delay, n=1024):
    """Mean square of an impulse and its echo, but for line 0, which the function replaces."""
    return np.abs(1 + strength * np.exp(-2j * np.pi * delay * np.arange(n // 2 + 1) / n)) ** 2


@pytest.mark.parametrize(("strength", "delay"), [(0.5, 40), (-0.5, 40), (0.2, 7), (0.8, 100)])
def test_echo_is_a_series(strength, delay):
    quefrency, real = cepstrum_of_lines(echo_lines(strength, delay), FS)
    assert_allclose(quefrency[delay], delay / FS, rtol=1e-14)
    # Line 0 stands for line 1, whose logarithm differs by this, and counts as one of n.
    first, second = np.log(echo_lines(strength, delay)[:2]) / 2
    change = (second - first) / 1024
    for m in (1, 2, 3):
        expected = (-1) ** (m + 1) * strength**m / (2 * m)
        # The series folds at half the segment: a^m with m delay > 512, summed, is beyond these.
        folded = abs(strength) ** ((1024 - m * delay) // delay) / 2
        assert_allclose(real[m * delay], expected, atol=abs(change) + folded + 1e-12)
    # Between the echoes nothing but that one line; 1.2 for the far, folded terms.
    assert abs(np.median(real) - change) < 0.2 * abs(change) + 1e-12


def test_echo_in_noise():
    noise = np.random.default_rng(0).standard_normal((2, 400_000))
    x = noise + 0.5 * np.roll(noise, 40, axis=-1)
    quefrency, real = cepstrum(x, FS, nperseg=4096)
    # 190 averages scatter ln sqrt P by 1 / (2 sqrt 190) and its mean over 2048 lines by 8e-4,
    # four of them. The window, moved by 1 % of its length, loses 3e-4.
    assert_allclose(real[:, 40], 0.25, atol=0.004)
    assert_allclose(real[:, 80], -0.0625, atol=0.004)
    assert quefrency[40] == 40 / FS


def test_gain_moves_quefrency_zero_only():
    lines = np.random.default_rng(1).exponential(size=(2, 257))
    before, after = (cepstrum_of_lines(gain * lines, FS)[1] for gain in (1.0, 100.0))
    # ln sqrt 100 = 2.30: rounding only.
    assert_allclose(after[:, 0] - before[:, 0], np.log(10), rtol=1e-12)
    assert_allclose(after[:, 1:], before[:, 1:], atol=1e-12)
    assert_allclose(cepstrum_of_lines(lines[::-1], FS)[1], before[::-1], atol=1e-15)


def test_empty_lines_are_raised_to_the_floor():
    lines = np.ones(257)
    lines[100] = 0.0
    real = cepstrum_of_lines(lines, FS)[1]
    # One line of 256 (counted twice) at -120 dB: ln sqrt 1e-12 = -13.8, over 256.
    assert_allclose(real[0], np.log(1e-6) / 256, rtol=1e-12)


# --- harmonic spacing


def clicks(spacing, n=65_536, noise=0.05, seed=0):
    """Band-limited clicks at any rate, in noise."""
    order = np.arange(1, int(0.45 * FS / spacing))
    t = np.arange(n) / FS
    train = sum(np.cos(2 * np.pi * k * spacing * t) for k in order) / order.size
    return train + noise * np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("spacing", [71.3, 97.0, 117.9])
def test_spacing_of_harmonics(spacing):
    found, height = harmonic_spacing(clicks(spacing), FS, low=60.0, high=140.0)
    # Within half a sample of the period.
    assert_allclose(found, spacing, rtol=spacing / (2 * FS))
    assert height > 10


def test_spacing_of_sidebands():
    t = np.arange(65_536) / FS
    shape = np.exp(2 * np.cos(2 * np.pi * 31.7 * t))  # many sidebands about 2.9 kHz
    x = shape * np.cos(2 * np.pi * 2911.3 * t)
    x += 0.01 * np.random.default_rng(2).standard_normal(t.size)
    found, height = harmonic_spacing(x, FS, low=25.0, high=45.0, band=(2600.0, 3200.0))
    # Some 16 sidebands make a peak 1 / 500 Hz wide, whose top the noise moves by less than a tenth.
    assert_allclose(found, 31.7, rtol=0.1 * 31.7 / 500)
    assert height > 5


def test_noise_has_no_family():
    x = np.random.default_rng(3).standard_normal((20, 32_768))
    height = harmonic_spacing(x, FS, low=60.0, high=140.0)[1]
    # The largest of 150 Gaussian lines reaches 2.7 in the median, 4.1 in one of 300.
    assert height.max() < 4.6
    assert 2 < np.median(height) < 3.5


@settings(max_examples=20, deadline=None)
@given(
    gain=st.floats(1e-6, 1e6), sign=st.sampled_from([-1, 1]), offset=st.floats(-10, 10),
    roll=st.integers(0, 20_000),
)  # fmt: skip
def test_gain_sign_offset_and_start_do_not_matter(gain, sign, offset, roll):
    x = clicks(100.0, n=80_000)
    y = sign * gain * (x[roll : roll + 60_000] + offset)
    found, height = harmonic_spacing(y, FS, low=60.0, high=150.0)
    assert_allclose(found, 100.0, rtol=100 / (2 * FS))
    assert height > 10


def test_a_constant_has_no_cepstrum():
    x = np.full((2, 4096), 0.1)
    assert_array_equal(cepstrum(x, FS, nperseg=1024)[1], 0)
    assert_array_equal(harmonic_spacing(x, FS, low=60.0, high=150.0), 0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cepstrum_of_lines([1.0, 1.0], FS), r"shape \(2,\) must be three or more"),
        (lambda: cepstrum_of_lines([1.0, np.nan, 1.0], FS), r"must be finite and >= 0"),
        (lambda: cepstrum_of_lines([1.0, -1.0, 1.0], FS), r"must be finite and >= 0"),
        (lambda: cepstrum([1.0], FS), r"nperseg = 0 samples"),
        (lambda: harmonic_spacing(np.ones(99), FS, low=9.0, high=3.0), r"low = 9.0 Hz must be"),
        (lambda: harmonic_spacing(np.ones(99), FS, low=9.0, high=5e3), r"<= fs / 4 = 4000"),
        (
            lambda: harmonic_spacing(np.ones(999), FS, low=90.0, high=99.0, band=(0, 150)),
            r"band = 0 … 150 Hz must lie .* wider than 2 high = 198",
        ),
        (
            lambda: harmonic_spacing(np.ones(99), FS, low=100.0, high=150.0),
            r"nperseg = 98 samples must be >= 320, two periods",
        ),
        (
            lambda: harmonic_spacing(np.full(999, np.nan), FS, low=100.0, high=150.0),
            r"must be finite",
        ),
    ],
)
def test_faults_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
