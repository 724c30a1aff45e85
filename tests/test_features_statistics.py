"""Amplitude statistics against closed forms and invariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import gamma
from wearstate.features.signal import statistics
from wearstate.features.signal.fft import rfft

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


# --- clearance and K factors, zero crossings, entropy


def test_sine_of_the_further_statistics():
    n, cycles = 480_000, 12
    x = 3 * np.sin(2 * np.pi * cycles * (np.arange(n) + 0.5) / n) + 7
    # mean sqrt |sin| = Gamma(3/4) / (sqrt(pi) Gamma(5/4)) = 0.76276; the sum over 40,000 samples
    # a cycle stops short of its cusps by 1e-6, and of the peak by 3e-9.
    root = gamma(0.75) / (np.sqrt(np.pi) * gamma(1.25))
    assert_allclose(statistics.clearance_factor(x), root**-2, rtol=2e-6)
    assert_allclose(statistics.k_factor(x), 9 / np.sqrt(2), rtol=1e-8)
    # Two crossings a cycle, but none is seen at the very start: 23 in n - 1 intervals.
    assert_allclose(statistics.zero_crossing_rate(x, 1000.0), 23 * 1000 / (n - 1), rtol=ROUNDING)
    # The arcsine distribution's share of each bin; samples near edges move by 1e-4 of a bin.
    share = np.diff(np.arcsin(np.linspace(-1, 1, 65))) / np.pi
    assert_allclose(statistics.entropy(x), -np.sum(share * np.log2(share)), atol=1e-4)


def test_entropy_of_known_distributions():
    levels = np.repeat(np.arange(64.0), [3] * 64)
    assert_allclose(statistics.entropy(levels), 6.0, rtol=ROUNDING)
    assert_allclose(statistics.entropy([0.0, 0.0, 0.0, 1.0]), 2 - 0.75 * np.log2(3), rtol=ROUNDING)
    # Bins follow the range: twice the outlier, fewer bins for the rest.
    x = np.random.default_rng(0).standard_normal(25_600)
    x[0] = 10
    small = statistics.entropy(x)
    x[0] = 20
    assert statistics.entropy(x) < small - 0.5


def test_zero_crossings_of_noise_follow_rice():
    x = np.random.default_rng(3).standard_normal(400_000)
    # White noise changes sign every second sample; binomial: sqrt(1 / (4 n)) = 8e-4, four of them.
    assert_allclose(statistics.zero_crossing_rate(x, 1.0), 0.5, atol=3.2e-3)


@pytest.mark.parametrize(
    ("x", "crossings"),
    [
        ([1, 0, 1, -2], 1),  # touched, not crossed
        ([-1, 0, -1, 2], 1),
        ([1, 0, -1], 1),  # one crossing through a sample at 0
        ([0, 0, 1, -1], 1),  # none before the first sample off 0
        ([0, 0, -1, 1], 1),
        ([1, -1, 1, -1], 3),
    ],
)
def test_samples_at_zero_cross_nothing(x, crossings):
    for sign in (1, -1):
        rate = statistics.zero_crossing_rate(sign * np.array(x, float), 1.0)
        assert_allclose(rate * (len(x) - 1), crossings, rtol=ROUNDING)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gain=st.floats(1e-6, 1e6),
    sign=st.sampled_from([-1, 1]),
    offset=st.floats(-100, 100),
)
def test_invariance_of_the_further_statistics(seed, gain, sign, offset):
    x = np.random.default_rng(seed).gumbel(size=(2, 300))
    y = sign * gain * (x + offset)
    # As above: an offset of 100 costs two digits of sixteen.
    assert_allclose(statistics.clearance_factor(y), statistics.clearance_factor(x), rtol=1e-10)
    assert_allclose(statistics.k_factor(y), gain**2 * statistics.k_factor(x), rtol=1e-10)
    rate = statistics.zero_crossing_rate(x, 10.0)
    assert_array_equal(statistics.zero_crossing_rate(y, 10.0), rate)
    # The lowest and the highest sample lie on edges, where rounding and a flip decide: one sample
    # of 300 from one bin to the next moves the entropy by log2(300) / 300 = 0.03 at most, twice.
    assert_allclose(statistics.entropy(y), statistics.entropy(x), atol=0.06)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("x", [np.zeros(100), np.full(100, 9.81), np.ones(1)])
def test_further_statistics_of_a_constant(x, dtype):
    x = x.astype(dtype)
    for value in (
        statistics.clearance_factor(x),
        statistics.k_factor(x),
        statistics.entropy(x),
        statistics.zero_crossing_rate(x, 1.0),
    ):
        assert value == 0
        assert value.dtype == dtype


def test_further_statistics_keep_axes_and_permute():
    x = np.random.default_rng(2).standard_normal((3, 2, 500)).astype(np.float32)
    for function in (
        statistics.clearance_factor,
        statistics.k_factor,
        statistics.entropy,
        lambda y: statistics.zero_crossing_rate(y, 1.0),
    ):
        value = function(x)
        assert value.shape == (3, 2)
        assert value.dtype == np.float32
        # Each channel alone: the same sums, in the order of another layout.
        assert_allclose(function(x[::-1, ::-1]), value[::-1, ::-1], rtol=ROUNDING_32)
        assert_allclose(function(x[1, 0]), value[1, 0], rtol=ROUNDING_32)


def test_nan_is_no_number_and_no_silent_one():
    x = np.random.default_rng(2).standard_normal((2, 50))
    x[0, 3] = np.nan
    rate = statistics.zero_crossing_rate(x, 1.0)
    assert np.isnan(rate[0])
    assert np.isfinite(rate[1])
    for name in (*RATIOS, *SIZES, "clearance_factor", "k_factor"):
        value = getattr(statistics, name)(x)
        assert np.isnan(value[0]), name
        assert np.isfinite(value[1]), name
    with pytest.raises(ValueError, match="non-finite samples"):
        statistics.entropy(x)
    with pytest.raises(ValueError, match=r"fs = 0\.0 Hz must be >= 0.001"):
        statistics.zero_crossing_rate([1.0, 2.0], 0.0)
