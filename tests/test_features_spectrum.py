"""Band levels against Parseval's theorem and the level of a sine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal
from wearstate.features.signal import spectrum, third_octave

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
        (lambda: spectrum.band_edges(np.nan), r"fs = nan Hz must be >= 0.001"),
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


# --- amplitude, density, tones


@pytest.mark.parametrize(("dtype", "rtol"), [(np.float64, 1e-12), (np.float32, 2e-6)])
def test_amplitude_of_a_tone_on_a_line(dtype, rtol):
    x = tone(100 * FS / 8192, 3.0, n=8192, dtype=dtype) + dtype(5)
    frequency, amplitude = spectrum.amplitude_spectrum(x, FS)
    assert amplitude.dtype == dtype
    assert_allclose(frequency[100], 100 * FS / 8192, rtol=1e-14)
    # On a line Hann's window is exact: rounding only.
    assert_allclose(amplitude[100], 3.0, rtol=rtol)
    assert_allclose(amplitude[[99, 101]], 1.5, rtol=2 * rtol)
    rms = spectrum.amplitude_spectrum(x, FS, rms=True)[1]
    assert_allclose(rms[100], 3 / np.sqrt(2), rtol=rtol)


def test_amplitude_between_lines_reads_low_by_hanns_scallop():
    x = tone(100.5 * FS / 8192, 3.0, n=8192)
    amplitude = spectrum.amplitude_spectrum(x, FS)[1]
    # Half a line off, Hann reads 8 / (3 pi) = -1.42 dB; the mirror image disturbs by 1e-8.
    assert_allclose(amplitude[[100, 101]], 3 * 8 / (3 * np.pi), rtol=1e-6)


@pytest.mark.parametrize("n", [4096, 4097, 20_000])
def test_density_is_welchs(n):
    x = np.random.default_rng(4).standard_normal((2, n)) + 3
    frequency, density = spectrum.power_spectral_density(x, FS, nperseg=1024)
    expected = signal.welch(
        x - x.mean(axis=-1, keepdims=True), FS, "hann", 1024, detrend=False, return_onesided=True
    )
    assert_allclose(frequency, expected[0], rtol=1e-14)
    # The same estimate in another order of summation.
    assert_allclose(density, expected[1], rtol=1e-10)
    assert_allclose(
        density.sum(axis=-1) * frequency[1],
        spectrum.power_lines(x, FS, nperseg=1024).sum(axis=-1),
        rtol=1e-12,
    )


@settings(max_examples=60, deadline=None)
@given(
    line=st.floats(6, 900),
    phase=st.floats(0, 2 * np.pi),
    amplitude=st.floats(1e-6, 1e6),
    segments=st.sampled_from([1, 3]),
)
def test_strongest_tone_lies_between_lines(line, phase, amplitude, segments):
    n = 2048
    t = np.arange(n * segments) / n
    x = amplitude * np.cos(2 * np.pi * line * t + phase)
    frequency, found = spectrum.strongest_tone(x, float(n), nperseg=n)
    # The mirror images, as its docstring says; 1e-9 for rounding. The mean over a fraction of a
    # cycle, taken off, is a line 0 of its own at `line` lines' distance: as much again.
    k = min(line, n / 2 - line)
    assert_allclose(found, amplitude, rtol=0.04 / k**3 + 1e-9)
    assert_allclose(frequency, line, atol=0.2 / k**3 + 1e-9)


def test_strongest_tone_of_each_channel_within_a_band():
    t = np.arange(8192) / 8192
    first = 2 * np.sin(2 * np.pi * 50.25 * t) + np.sin(2 * np.pi * 400.6 * t)
    x = np.stack([first, 0 * t, -3 * np.sin(2 * np.pi * 1000 * t)])
    frequency, amplitude = spectrum.strongest_tone(x, 8192.0)
    # 350 lines apart, 0.4 / 350^3 of each other: 1e-8.
    assert_allclose(frequency, [50.25, 0, 1000], atol=1e-5)
    assert_allclose(amplitude, [2, 0, 3], atol=1e-6)
    frequency, amplitude = spectrum.strongest_tone(x[0], 8192.0, band=(200.0, 2000.0))
    assert_allclose([frequency, amplitude], [400.6, 1.0], atol=1e-5)


def test_a_tone_at_half_the_rate_is_no_peak_between_lines():
    frequency, amplitude = spectrum.strongest_tone(np.tile([1.0, -1.0], 512), 1024.0)
    # The last line has no neighbour above: the one below it is the highest that is looked at.
    assert 510.5 <= frequency <= 511.5
    assert amplitude > 0


def test_tone_in_noise_is_found_where_it_is():
    x = tone(1234.5, 1.0) + 0.3 * np.random.default_rng(7).standard_normal(32_768)
    frequency, amplitude = spectrum.strongest_tone(x, FS)
    # Noise of 0.3 rms puts 0.3 sqrt(2 * 1.5 * 2 / n) = 0.004 on a line: four of them, and as
    # much of a line spacing of 0.78 Hz.
    assert_allclose(amplitude, 1.0, atol=0.016)
    assert_allclose(frequency, 1234.5, atol=0.016)


# --- third octaves and bands of choice


def test_third_octaves_of_the_standard():
    centres = third_octave.third_octave_centres(31.5, 20_000)
    # IEC 61260-1, table E.1: exact mid-band frequencies to five digits.
    assert_allclose(centres[:4], [31.623, 39.811, 50.119, 63.096], atol=5e-4)
    assert_allclose(centres[-2:], [15_849, 19_953], atol=0.5)
    assert centres.size == 29
    # Three bands make 10^(3/10), the octave of the standard.
    assert_allclose(centres[3:] / centres[:-3], 10**0.3, rtol=1e-12)


def test_bands_of_choice_may_overlap():
    x = np.random.default_rng(6).standard_normal((2, 8192))
    lines = spectrum.power_lines(x, FS)
    bands = [[100.0, 300.0], [300.0, 777.0], [100.0, 777.0]]
    levels = spectrum.levels_in_bands(lines, FS, bands)
    # The first two are the edges of `band_levels`; the third is their sum.
    assert_allclose(levels[:, :2], spectrum.levels_from_lines(lines, FS, [100, 300, 777]))
    power = 10 ** (levels / 10)
    assert_allclose(power[:, 0] + power[:, 1], power[:, 2], rtol=1e-12)


# --- properties and faults


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gain=st.floats(1e-3, 1e3),
    sign=st.sampled_from([-1, 1]),
    shift=st.integers(0, 2047),
)
def test_gain_sign_offset_shift_and_order_of_channels(seed, gain, sign, shift):
    x = np.random.default_rng(seed).standard_normal((3, 2048))
    y = sign * gain * (x + 2)[::-1]
    # Rounding of the offset of 2 against lines of 1e-3: 1e-12 and some.
    amplitude = spectrum.amplitude_spectrum(x, FS)[1]
    assert_allclose(spectrum.amplitude_spectrum(y, FS)[1], gain * amplitude[::-1], atol=1e-9 * gain)
    frequency, peak = spectrum.strongest_tone(x, FS)
    again = spectrum.strongest_tone(y, FS)
    assert_allclose(again[0], frequency[::-1], rtol=1e-8)
    assert_allclose(again[1], gain * peak[::-1], rtol=1e-8)
    edges = 891.25 * 10 ** (np.arange(12) / 10)
    levels = spectrum.band_levels(x, FS, edges, nperseg=1024)
    after = spectrum.band_levels(y, FS, edges, nperseg=1024)
    assert_allclose(after, levels[::-1] + 20 * np.log10(gain), atol=1e-8)
    # A periodic signal has the same spectrum whenever it starts.
    t = np.arange(2048) / 2048
    wave = np.cos(2 * np.pi * 64 * t) + 0.3 * np.cos(2 * np.pi * 192 * t + 1)
    shifted = spectrum.amplitude_spectrum(np.roll(wave, shift), FS)[1]
    assert_allclose(shifted, spectrum.amplitude_spectrum(wave, FS)[1], atol=1e-12)


@pytest.mark.parametrize("x", [np.zeros(512), np.full(512, 0.1)])
def test_a_constant_has_no_tone_and_no_level(x):
    assert_array_equal(spectrum.amplitude_spectrum(x, FS)[1], 0)
    assert_array_equal(spectrum.power_spectral_density(x, FS)[1], 0)
    assert_array_equal(spectrum.strongest_tone(x, FS), 0)
    assert_array_equal(spectrum.band_levels(x, FS, [900.0, 1100.0], nperseg=512), -200)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: spectrum.amplitude_spectrum([1.0], FS), r"nperseg = 0 samples must be"),
        (lambda: spectrum.amplitude_spectrum([], FS), r"n_samples = 0"),
        (lambda: spectrum.strongest_tone([1.0], FS), r"nperseg = 0 samples must be"),
        (
            lambda: spectrum.strongest_tone(np.ones(64), FS, band=(1.0, 2.0)),
            r"band = 1 … 2 Hz must hold a line of 400 Hz",
        ),
        (lambda: spectrum.line_frequencies(1, FS), r"n_lines = 1 must be >= 2"),
        (
            lambda: spectrum.levels_in_bands(np.ones(9), 16.0, [[1, 2], [3, 2], [7, 9]]),
            r"band 3 … 2 Hz must rise .*; band 7 … 9 Hz must rise within 0 … fs / 2 = 8 Hz",
        ),
        (lambda: spectrum.band_weights(8, 8.0, [1, 2]), r"shape \(2,\) must be \(n_bands"),
        (lambda: third_octave.third_octave_centres(0, 100), r"low = 0 Hz must be > 0"),
    ],
)
def test_further_faults_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_nan_comes_through():
    x = np.random.default_rng(8).standard_normal((2, 512))
    x[0, 9] = np.nan
    for value in (
        spectrum.amplitude_spectrum(x, FS)[1],
        spectrum.power_spectral_density(x, FS)[1],
        np.stack(spectrum.strongest_tone(x, FS), axis=-1),
        spectrum.band_levels(x, FS, [900.0, 1100.0, 3000.0], nperseg=512),
    ):
        assert np.isnan(value[0]).all()
        assert np.isfinite(value[1]).all()
