"""Amplitude statistics against closed forms and invariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features import statistics
from wearstate.features.fft import rfft

RATIOS = ("crest_factor", "shape_factor", "impulse_factor", "kurtosis", "skewness")
SIZES = ("rms", "peak", "peak_to_peak")

# Sums of a few thousand float64 products round at 1e-13; float32 data at about 1e-6.
ROUNDING = 1e-12
ROUNDING_32 = 2e-6


def sine(dtype=np.float64, n=4800, cycles=12, amplitude=3.0):
    return (amplitude * np.sin(2 * np.pi * cycles * np.arange(n) / n)).astype(dtype)


@pytest.mark.parametrize(("dtype", "rtol"), [(np.float64, ROUNDING), (np.float32, ROUNDING_32)])
def test_sine(dtype, rtol):
    x = sine(dtype) + dtype(7)
    # The offset of 7 costs float32 another factor of two.
    rtol *= 2
    assert_allclose(statistics.rms(x), 3 / np.sqrt(2), rtol=rtol)
    assert_allclose(statistics.peak(x), 3, rtol=rtol)
    assert_allclose(statistics.peak_to_peak(x), 6, rtol=rtol)
    assert_allclose(statistics.crest_factor(x), np.sqrt(2), rtol=rtol)
    assert_allclose(statistics.kurtosis(x), 1.5, rtol=rtol)
    assert_allclose(statistics.skewness(x), 0, atol=rtol)
    # A mean of |sin| over 400 samples a cycle differs from 2 / pi by (pi / 400)^2 / 3 = 2e-5.
    assert_allclose(statistics.shape_factor(x), np.pi / np.sqrt(8), rtol=3e-5)
    assert_allclose(statistics.impulse_factor(x), np.pi / 2, rtol=3e-5)
    assert statistics.rms(x).dtype == dtype
    assert statistics.kurtosis(x).dtype == dtype


def test_square_wave_has_every_ratio_one():
    x = np.tile([2.0, 2.0, -2.0, -2.0], 100)
    for name in ("crest_factor", "shape_factor", "impulse_factor", "kurtosis"):
        assert_allclose(getattr(statistics, name)(x), 1.0, rtol=ROUNDING)


def test_two_point_distribution():
    # One sample in n at 1: p = 1/n, kurtosis = (1 - 3 p (1 - p)) / (p (1 - p)), skewness
    # (1 - 2 p) / sqrt(p (1 - p)).
    n = 50
    x = np.zeros(n)
    x[17] = 1.0
    p = 1 / n
    assert_allclose(statistics.kurtosis(x), (1 - 3 * p * (1 - p)) / (p * (1 - p)), rtol=ROUNDING)
    assert_allclose(statistics.skewness(x), (1 - 2 * p) / np.sqrt(p * (1 - p)), rtol=ROUNDING)


def test_gaussian_kurtosis_is_three():
    x = np.random.default_rng(1).standard_normal(200_000)
    # Standard error of a Gaussian's kurtosis is sqrt(24 / n) = 0.011; four of them.
    assert_allclose(statistics.kurtosis(x), 3.0, atol=0.044)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("value", [0.0, 0.1, -9.81, 1e9])
def test_constant_signal_is_zero_by_convention(value, dtype):
    x = np.full(1000, value, dtype)
    for name in SIZES + RATIOS:
        assert getattr(statistics, name)(x) == 0, name


@pytest.mark.parametrize("scale", [1e-30, 1e9])
def test_float32_neither_overflows_nor_underflows(scale):
    x = sine(np.float32, amplitude=1.0) * np.float32(scale)
    assert_allclose(statistics.rms(x), scale / np.sqrt(2), rtol=ROUNDING_32)
    assert_allclose(statistics.kurtosis(x), 1.5, rtol=ROUNDING_32)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gain=st.floats(1e-6, 1e6),
    sign=st.sampled_from([-1, 1]),
    offset=st.floats(-100, 100),
)
def test_gain_sign_and_offset(seed, gain, sign, offset):
    x = np.random.default_rng(seed).gumbel(size=(2, 300))
    # An offset of 100 against a spread of 1 costs two digits of sixteen.
    y = sign * gain * (x + offset)
    for name in RATIOS:
        expected = getattr(statistics, name)(x) * (sign if name == "skewness" else 1)
        assert_allclose(getattr(statistics, name)(y), expected, rtol=1e-10, err_msg=name)
    for name in SIZES:
        expected = gain * getattr(statistics, name)(x)
        assert_allclose(getattr(statistics, name)(y), expected, rtol=1e-10, err_msg=name)


def test_leading_axes_and_integers():
    x = np.random.default_rng(2).integers(-9, 9, size=(3, 2, 100))
    for name in SIZES + RATIOS:
        function = getattr(statistics, name)
        assert function(x).shape == (3, 2)
        # Summation order differs with the layout, so the last bits may.
        assert_allclose(function(x)[2, 1], function(x[2, 1].astype(float)), rtol=ROUNDING)


def test_no_samples_are_refused():
    with pytest.raises(ValueError, match=r"n_samples = 0 .* must be >= 1"):
        statistics.rms(np.empty((2, 0)))


@pytest.mark.parametrize(
    ("dtype", "kept"), [(np.float32, np.complex64), (np.float64, np.complex128)]
)
def test_rfft_keeps_precision_and_axis(dtype, kept):
    x = np.random.default_rng(3).standard_normal((8, 3)).astype(dtype)
    n = np.arange(8)
    matrix = np.exp(-2j * np.pi * np.outer(np.arange(5), n) / 8)
    spectrum = rfft(x, axis=0)
    assert spectrum.dtype == kept
    # Eight products: a few units in the last place.
    assert_allclose(spectrum, matrix @ x, atol=50 * np.finfo(dtype).eps)
    assert_array_equal(spectrum, rfft(x.T).T)
