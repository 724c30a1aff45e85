"""Centroid, spread, entropy, flatness and noise floor against closed forms and noise laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import digamma
from wearstate.features.response.frf import effective_averages
from wearstate.features.signal import spectral_shape as shape
from wearstate.features.signal.spectrum import hann, power_lines

FS = 4096.0
N = 4096  # lines of 1 Hz from one segment


def lines_of(x, nperseg=N):
    return power_lines(x, FS, nperseg=nperseg)


def averages_of(n, nperseg):
    return effective_averages(hann(nperseg), nperseg // 2, (n - nperseg) // (nperseg // 2) + 1)


def tone(frequency, amplitude=1.0, phase=0.3):
    return amplitude * np.cos(2 * np.pi * frequency * np.arange(N) / FS + phase)


def test_tone_on_a_line():
    lines = lines_of(tone(300, 2.0))
    # Hann's three lines 1/6, 2/3, 1/6: rounding only.
    assert_allclose(shape.spectral_centroid(lines, FS), 300, rtol=1e-12)
    assert_allclose(shape.spectral_spread(lines, FS), np.sqrt(1 / 3), rtol=1e-9)
    p = np.array([1 / 6, 2 / 3, 1 / 6])
    expected = -np.sum(p * np.log(p)) / np.log(N / 2)
    assert_allclose(shape.spectral_entropy(lines), expected, rtol=1e-9)
    assert_allclose(-np.sum(p * np.log(p)), 0.868, atol=5e-4)  # as its docstring says
    assert shape.spectral_flatness(lines) < 1e-20


@pytest.mark.parametrize("off", [0.25, 0.5])
def test_tone_between_lines(off):
    lines = lines_of(tone(300 + off))
    # The mean taken off, 1 / (600 pi) of the amplitude, is a line 300 lines away that would have
    # to hold 2 / (600 pi)^2 = 6e-7 of the power.
    assert_allclose(shape.spectral_centroid(lines, FS), 300 + off, atol=300 * 6e-7)
    assert_allclose(shape.spectral_spread(lines, FS) ** 2, 1 / 3, atol=300**2 * 6e-7)


def test_two_tones():
    lines = lines_of(tone(200, np.sqrt(3)) + tone(1000, 1.0))
    # Powers 3 : 1, hence 400 Hz, and sqrt(3/4 200^2 + 1/4 600^2 + 1/3).
    assert_allclose(shape.spectral_centroid(lines, FS), 400, rtol=1e-12)
    assert_allclose(shape.spectral_spread(lines, FS), np.sqrt(120_000 + 1 / 3), rtol=1e-12)


def test_white_noise_of_one_segment():
    lines = np.random.default_rng(0).exponential(size=200_000)
    # An exponential variable has mean of p ln p = 1 - gamma and of ln p = -gamma; the scatter of
    # either over 2e5 lines is 1 / sqrt(2e5) = 0.0022, four of them.
    entropy = shape.spectral_entropy(lines)
    assert_allclose((1 - entropy) * np.log(lines.size - 1), 1 - np.euler_gamma, atol=0.01)
    assert_allclose(shape.spectral_flatness(lines), np.exp(-np.euler_gamma), rtol=0.01)
    # Half the band, and the width of a uniform distribution over sqrt 12.
    assert_allclose(shape.spectral_centroid(lines, 2.0), 0.5, atol=0.003)
    assert_allclose(shape.spectral_spread(lines, 2.0), 1 / np.sqrt(12), atol=0.003)


def test_averaged_noise_is_flatter():
    x = np.random.default_rng(1).standard_normal(21 * 2048)
    lines = lines_of(x, 4096)
    k = averages_of(x.size, 4096)
    assert 18.9 < k < 19.1  # 20 segments overlapping by half
    # K averages: a gamma variable; scatter 1 / sqrt(2 K N) of the mean logarithm, small.
    assert_allclose(shape.spectral_flatness(lines), np.exp(digamma(k)) / k, atol=4e-3)


def test_variance_of_the_lines_is_that_of_the_effective_averages():
    x = np.random.default_rng(2).standard_normal((40, 8 * 1024))
    lines = lines_of(x, 1024)[:, 2:-2]
    k = averages_of(x.shape[-1], 1024)
    # 40 channels of 500 lines, neighbours correlated: 2e4 / 2 estimates of a variance, 1.5 %.
    assert_allclose((lines.mean() / lines.std()) ** 2, k, rtol=0.06)


# --- noise floor


@pytest.mark.parametrize("segments", [1, 5, 40])
def test_floor_of_white_noise(segments):
    nperseg = 2048  # lines of 2 Hz
    n = nperseg + (segments - 1) * nperseg // 2
    x = 3 * np.random.default_rng(segments).standard_normal((4, n))
    k = averages_of(n, nperseg)
    floor = shape.noise_floor(lines_of(x, nperseg), FS, n_averages=k)
    # 9 over the band of 2048 Hz. Scatter 1.5 … 2 / sqrt(1024 k), half of the lines independent;
    # four of them.
    assert_allclose(floor, 9 / 2048, rtol=4 * 2 * np.sqrt(2) / np.sqrt(1024 * k))


def test_tones_hardly_lift_the_floor():
    n = 21 * 2048
    noise = np.random.default_rng(3).standard_normal(n)
    t = np.arange(n) / FS
    tones = sum(100 * np.sin(2 * np.pi * f * t) for f in range(50, 2000, 50))
    k = averages_of(n, 4096)
    alone, among = (
        10 * np.log10(shape.noise_floor(lines_of(x, 4096), FS, n_averages=k))
        for x in (noise, noise + tones)
    )
    # 39 tones of 3 lines and the skirts: a tenth of the lines, 0.15 dB with 20 averages; the mean
    # of the lines would rise by 53 dB.
    assert 0 < among - alone < 0.4


def test_floor_within_a_band():
    lines = np.ones(101)
    lines[50:] = 9.0
    floor = shape.noise_floor(lines, 200.0, n_averages=1e6, band=(60.0, 90.0))
    # A million averages: no bias but 1 - 0.6745 / 1000.
    assert_allclose(floor, 9.0, rtol=1e-3)


# --- properties and faults


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), gain=st.floats(1e-9, 1e9))
def test_gain_and_order_of_channels(seed, gain):
    lines = np.random.default_rng(seed).exponential(size=(3, 300))
    y = gain * lines[::-1]
    for function in (
        lambda p: shape.spectral_centroid(p, FS),
        lambda p: shape.spectral_spread(p, FS),
        shape.spectral_entropy,
        shape.spectral_flatness,
        lambda p: shape.noise_floor(p / p.sum(), FS, n_averages=1.0),
    ):
        # Sums of 300 products: rounding only.
        assert_allclose(function(y), function(lines)[::-1], rtol=1e-10)
    floor = shape.noise_floor(lines, FS, n_averages=1.0)
    assert_allclose(shape.noise_floor(y, FS, n_averages=1.0), gain * floor[::-1], rtol=1e-10)


def test_silence_is_zero():
    lines = np.zeros((2, 64))
    assert_array_equal(shape.spectral_centroid(lines, FS), [0, 0])
    assert_array_equal(shape.spectral_spread(lines, FS), [0, 0])
    assert_array_equal(shape.spectral_entropy(lines), [0, 0])
    assert_array_equal(shape.spectral_flatness(lines), [0, 0])
    assert_array_equal(shape.noise_floor(lines, FS, n_averages=1.0), [0, 0])


def test_nan_is_no_silent_number():
    lines = np.ones((2, 64))
    lines[0, 5] = np.nan
    for value in (
        shape.spectral_centroid(lines, FS),
        shape.spectral_spread(lines, FS),
        shape.spectral_entropy(lines),
        shape.spectral_flatness(lines),
    ):
        assert np.isnan(value[0])
        assert np.isfinite(value[1])
    with pytest.raises(ValueError, match="lines hold non-finite values"):
        shape.noise_floor(lines, FS, n_averages=1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: shape.spectral_centroid([1.0], FS), r"shape \(1,\) must be two or more"),
        (lambda: shape.spectral_spread([1.0, -1.0], FS), r"lines = -1 must be >= 0"),
        (lambda: shape.spectral_entropy([1.0, 1.0]), r"shape \(2,\) must be three or more"),
        (lambda: shape.spectral_flatness(1.0), r"shape \(\) must be three or more"),
        (
            lambda: shape.noise_floor(np.ones(20), 40.0, n_averages=0.5, band=(1, 3)),
            r"n_averages = 0.5 must be >= 1 .*; band = 1 … 3 Hz holds 2 lines, must hold >= 8",
        ),
    ],
)
def test_faults_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
