"""Band levels against Parseval's theorem and the level of a sine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features import spectrum

FS = 25_600.0


def tone(frequency, amplitude=1.0, n=32_768, fs=FS, dtype=np.float64):
    return (amplitude * np.sin(2 * np.pi * frequency * np.arange(n) / fs)).astype(dtype)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("frequency", [600.0, 601.7, 4000.0])
def test_sine_in_a_band(frequency, dtype):
    edges = [100.0, 300.0, 1200.0, 3000.0, 9000.0]
    levels = spectrum.band_levels(tone(frequency, 3.0, dtype=dtype), FS, edges)
    own = np.searchsorted(edges, frequency) - 1
    assert levels.dtype == np.float64
    # A tone between two lines meets the segments' tapers at different phases: 0.001 dB.
    assert_allclose(levels[own], 10 * np.log10(9 / 2), atol=1e-3)
    # 200 lines away, Hann's side lobes are below -31 dB - 18 dB/octave * 6.
    assert np.all(np.delete(levels, own) < levels[own] - 90)


def test_lines_obey_parseval():
    x = np.random.default_rng(0).standard_normal((2, 8192))
    lines = spectrum.power_lines(x, FS, nperseg=8192)
    window = spectrum.hann(8192)
    y = x - x.mean(axis=-1, keepdims=True)
    expected = (np.square(window * y).sum(axis=-1)) / np.square(window).sum()
    # An identity: only rounding is left.
    assert_allclose(lines.sum(axis=-1), expected, rtol=1e-12)


def test_bands_together_hold_the_mean_square_of_noise():
    x = np.random.default_rng(1).standard_normal(200_000)
    edges = [0.0, 1000.0, 7000.0, FS / 2]
    levels = spectrum.band_levels(x, FS, edges)
    share = np.diff(edges) / (FS / 2)
    # White noise: each band in proportion. The band of 1 kHz has 2 B T = 15600 degrees of
    # freedom, hence 0.05 dB; four of them.
    assert_allclose(levels, 10 * np.log10(share), atol=0.2)
    # All bands: 2e5 samples give 0.3 % and the taper at the two ends as much again.
    assert_allclose((10 ** (levels / 10)).sum(), np.mean(x**2), rtol=0.012)


def test_nyquist_and_offset_are_counted_once():
    x = 5.0 + np.tile([1.0, -1.0], 512)
    lines = spectrum.power_lines(x, 1024.0, nperseg=256)
    # The tone at half the sample rate has mean square 1, the offset is removed. Hann puts a third
    # of it on the neighbouring line's two halves, so the sum tells, not the last line.
    assert_allclose(lines.sum(), 1.0, rtol=1e-12)
    assert_allclose(lines[:100], 0.0, atol=1e-25)


def test_line_weights_divide_without_loss():
    edges = np.array([0.0, 3.3, 3.4, 11.0, 32.0])
    weights = spectrum.line_weights(64, 64.0, edges)
    assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-14)
    # The cell of line 3 reaches from 2.5 to 3.5 Hz: eight, one and one tenth.
    assert_allclose(weights[3], [0.8, 0.1, 0.1, 0.0], atol=1e-13)


def test_silence_has_the_floor():
    assert_array_equal(spectrum.band_levels(np.ones(4096), FS, [100, 1000]), [-200.0])


def test_band_edges_default():
    edges = spectrum.band_edges(FS)
    assert edges.shape == (21,)
    # geomspace lands on its ends and has one ratio: rounding only.
    assert_allclose(edges[[0, -1]], [50.0, 11_500.0], rtol=1e-12)
    assert_allclose(edges[1:] / edges[:-1], (11_500 / 50) ** (1 / 20), rtol=1e-12)
    assert_allclose(spectrum.band_edges(10_000.0)[-1], 4500.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("fs", "nperseg"), [(25_600.0, 256), (48_800.0, 512), (97_656.25, 1024), (12_800.0, 128)]
)
def test_line_band_edges_hold_whole_lines(fs, nperseg):
    edges = spectrum.line_band_edges(fs, nperseg)
    assert edges.shape == (21,)
    counts = spectrum.line_weights(nperseg, fs, edges).sum(axis=0)
    # Whole lines, at least one, wider and wider but for rounding to one line.
    assert_allclose(counts, np.rint(counts), atol=1e-9)
    assert counts.min() >= 1
    assert np.all(np.diff(counts) >= -1)
    assert abs(edges[-1] - min(0.45 * fs, 11_500)) <= fs / nperseg


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), gain=st.floats(1e-3, 1e3), sign=st.sampled_from([-1, 1]))
def test_gain_shifts_and_sign_and_offset_do_not(seed, gain, sign):
    x = np.random.default_rng(seed).standard_normal((2, 2048))
    edges = spectrum.band_edges(FS)
    before = spectrum.band_levels(x, FS, edges)
    after = spectrum.band_levels(sign * gain * x + 3 * gain, FS, edges)
    # Rounding of the offset: 1e-15 in amplitude against bands 1e-2 strong.
    assert_allclose(after, before + 20 * np.log10(gain), atol=1e-9)


def test_float32_is_kept_and_close():
    x = np.random.default_rng(5).standard_normal(20_000)
    lines = spectrum.power_lines(x.astype(np.float32), FS)
    assert lines.dtype == np.float32
    edges = spectrum.band_edges(FS)
    # float32 rounds amplitudes at 6e-8: 1e-5 dB with a margin of ten.
    assert_allclose(
        spectrum.levels_from_lines(lines, FS, edges), spectrum.band_levels(x, FS, edges), atol=1e-5
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: spectrum.band_edges(1000.0, high=600.0), r"high = 600.0 Hz must be <= fs / 2"),
        (lambda: spectrum.band_edges(1000.0, low=-1.0, n_bands=0), r"n_bands = 0 .*; low = -1"),
        (lambda: spectrum.band_edges(np.nan), r"fs = nan Hz must be > 0"),
        (lambda: spectrum.line_band_edges(FS, 32), r"n_bands = 20 must be <= "),
        (lambda: spectrum.line_weights(64, 64.0, [3, 2]), r"edges = .* increase"),
        (lambda: spectrum.line_weights(64, 64.0, [3, 33]), r"must lie in 0 … fs / 2"),
        (lambda: spectrum.power_lines(np.ones(100), FS, nperseg=200), r"nperseg = 200 samples"),
        (lambda: spectrum.power_lines(np.ones(100), FS, nperseg=51), r"nperseg = 51 .* even"),
    ],
)
def test_faults_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
