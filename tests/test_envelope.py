"""Envelopes, kurtogram and cyclic coherence against tones, modulations and blows made to order."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.features.signal.cyclic_coherence import coherence_threshold, cyclic_coherence
from wearstate.features.signal.envelope import (
    baseband,
    bearing_frequencies,
    envelope,
    envelope_span,
    envelope_spectrum,
    fault_line,
)
from wearstate.features.signal.kurtogram import (
    LONE_SHARE,
    LONE_SHARE_OF_FEW,
    MANY_FRAMES,
    Kurtogram,
    _begins,
    _moments,
    _pooled,
    _without_lone,
    kurtogram,
    kurtogram_levels,
    spectral_kurtosis,
)

FS = 8192.0
N = 8192  # one second: whole hertz are lines
T = np.arange(N) / FS
CARRIER = 2000
BAND = (1500.0, 2500.0)

depths = st.floats(0.01, 1.0)
sizes = st.floats(1e-6, 1e6)


def modulated(rate, depth, *, size=1.0, carrier=CARRIER):
    swing = 1 + depth * np.cos(2 * np.pi * rate * T + 0.4)
    return size * swing * np.cos(2 * np.pi * carrier * T + 1.1)


def line(frequency, amplitude, at):
    return amplitude[..., np.flatnonzero(frequency == at)[0]]


def blows(rate, resonance, *, fs=25_600.0, seconds=2.0, noise=0.2, damping=0.03, seed=0):
    """Ringing of one resonance struck at a steady rate, in white noise [rate in Hz]."""
    rng = np.random.default_rng(seed)
    n = int(fs * seconds)
    wave = noise * rng.standard_normal(n)
    for strike in np.arange(0.003, seconds, 1 / rate):
        first = math.ceil(strike * fs)
        after = np.arange(first, min(first + 3000, n)) / fs - strike
        ring = np.exp(-2 * np.pi * damping * resonance * after)
        wave[first : first + 3000] += ring * np.sin(2 * np.pi * resonance * after)
    return wave


# --- envelope


@given(rate=st.integers(3, 240), depth=depths, size=sizes)
def test_lines_of_a_modulated_tone(rate, depth, size):
    found = envelope_spectrum(modulated(rate, depth, size=size), FS, BAND)
    # A^2 (1 + m cos)^2 by hand; every term is a line and inside the band: rounding only
    assert_allclose(line(*found, rate), 2 * depth * size**2, rtol=1e-10)
    assert_allclose(line(*found, 2 * rate), depth**2 * size**2 / 2, rtol=1e-8, atol=1e-12 * size**2)
    assert_allclose(line(*found, 0), 0, atol=1e-12 * size**2)


@given(rate=st.integers(3, 240), depth=st.floats(0.01, 0.99))
def test_the_plain_envelope_of_a_modulated_tone_is_the_modulation(rate, depth):
    found = envelope_spectrum(modulated(rate, depth, size=3.0), FS, BAND, kind="plain")
    assert_allclose(line(*found, rate), 3 * depth, rtol=1e-10)  # |1 + m cos| has no kink: exact
    assert_allclose(line(*found, 2 * rate), 0, atol=1e-10)


@given(rate=st.sampled_from([8, 16, 32]), depth=st.floats(0.05, 0.7))
def test_the_log_envelope_of_a_modulated_tone(rate, depth):
    found = envelope_spectrum(modulated(rate, depth), FS, BAND, kind="log")
    ratio = (1 - math.sqrt(1 - depth**2)) / depth
    for k in (1, 2, 3):
        # 2 ln(1 + m cos u) = const + sum of (-1)^(k+1) (4 / k) r^k cos(k u). 2002 samples a second
        # hold 31 harmonics of 32 Hz; the ones above, of 4 / 60 r^60 < 1e-23, fold back
        assert_allclose(line(*found, k * rate), 4 / k * ratio**k, rtol=1e-9, atol=1e-12)


def test_a_tone_has_its_amplitude_and_no_spectrum():
    wave = 3 * np.cos(2 * np.pi * CARRIER * T)
    found, rate = envelope(wave, FS, BAND)
    assert_allclose(found, 3, rtol=1e-12)
    assert rate >= 2 * (BAND[1] - BAND[0])
    assert envelope_spectrum(wave, FS, BAND)[1].max() < 1e-12


def test_two_tones_beat():
    """|a + b exp(j w t)|^2 = a^2 + b^2 + 2 a b cos wt, whichever is louder."""
    wave = 2 * np.cos(2 * np.pi * 1800 * T) + 0.7 * np.sin(2 * np.pi * 2237 * T)
    found = envelope_spectrum(wave, FS, BAND)
    assert_allclose(line(*found, 437), 2 * 2 * 0.7, rtol=1e-10)


def test_what_is_outside_the_band_does_not_show():
    wave = modulated(30, 0.5) + 100 * np.cos(2 * np.pi * 400 * T) + 7
    inside = envelope_spectrum(wave, FS, BAND)[1]
    # both tones are lines; 100 times the rounding
    assert_allclose(inside, envelope_spectrum(modulated(30, 0.5), FS, BAND)[1], atol=1e-11)


def test_the_square_is_not_aliased_at_the_reduced_rate():
    """The two edges of the band beat at its full width, the last line of the spectrum."""
    wave = np.cos(2 * np.pi * BAND[0] * T) + np.cos(2 * np.pi * BAND[1] * T)
    found = envelope_spectrum(wave, FS, BAND)
    assert found[0][-1] == 1000
    assert_allclose(line(*found, 1000), 2.0, rtol=1e-10)
    assert found[1][:999].max() < 1e-9  # Hann's neighbour is half as high


@pytest.mark.parametrize("n", [8192, 8191, 1000, 997])
def test_the_whole_spectrum_keeps_the_power(n):
    """Without a band, the mean square of x is half that of the envelope (Parseval)."""
    wave = np.random.default_rng(1).standard_normal(n)
    wave -= wave.mean()
    if n % 2 == 0:  # the line at fs / 2 belongs to no band
        wave -= (wave @ (-1.0) ** np.arange(n)) / n * (-1.0) ** np.arange(n)
    found, _ = envelope(wave, 1.0)
    assert_allclose(np.mean(found**2) / 2, np.mean(wave**2), rtol=1e-12)


@pytest.mark.parametrize("kind", ["squared", "plain", "log"])
def test_scale_sign_offset_shift_and_channels(kind):
    rng = np.random.default_rng(2)
    wave = modulated(30, 0.5) + 0.1 * rng.standard_normal(N)
    power = {"squared": 2, "plain": 1, "log": 0}[kind]
    plain = envelope_spectrum(wave, FS, BAND, kind=kind)[1]

    def spectrum(x):
        return envelope_spectrum(x, FS, BAND, kind=kind)[1]

    # rounding of samples of size 1
    assert_allclose(spectrum(1000 * wave), 1000.0**power * plain, rtol=1e-9, atol=1e-9)
    assert_allclose(spectrum(-wave), plain, rtol=1e-9, atol=1e-12)
    assert_allclose(spectrum(wave + 5), plain, rtol=1e-9, atol=1e-12)
    both = spectrum(np.stack([wave, 2 * wave]))
    assert_allclose(both, [plain, spectrum(2 * wave)], rtol=1e-12)
    # moved round by a whole number of its own samples, only Hann's ends see other noise
    moved = spectrum(np.roll(wave, 1024))
    assert_allclose(moved[30], plain[30], rtol=0.01)


@pytest.mark.parametrize("kind", ["squared", "plain", "log"])
def test_single_precision_is_kept(kind):
    wave = modulated(30, 0.5)
    double = envelope_spectrum(wave, FS, BAND, kind=kind)[1]
    single = envelope_spectrum(wave.astype(np.float32), FS, BAND, kind=kind)[1]
    assert single.dtype == np.float32
    assert_allclose(single, double, atol=3e-6)  # 24 bits and the logarithm of 8192 samples


@pytest.mark.parametrize("kind", ["squared", "plain", "log"])
def test_silence_has_a_silent_spectrum(kind):
    for wave in (np.zeros(N), np.full(N, 3.7)):
        assert not envelope_spectrum(wave, FS, BAND, kind=kind)[1].any()


# --- bad input


@pytest.mark.parametrize("call", [baseband, envelope_spectrum, spectral_kurtosis, kurtogram])
def test_what_is_no_signal_is_refused_with_all_faults(call):
    wave = modulated(30, 0.5)
    wave[[5, 70]] = np.nan, np.inf
    with pytest.raises(ValueError, match=r"fs = 0 Hz must be >= 0.001.*x has 2 non-finite samples"):
        call(wave, 0)
    with pytest.raises(ValueError, match=r"n_samples = 1 must be >= .*record longer"):
        call([1.0], FS)
    with pytest.raises(ValueError, match=r"n_samples = 0 must be >="):
        call([], FS)


@pytest.mark.parametrize("band", [(-1.0, 100.0), (200.0, 100.0), (100.0, 5000.0), (math.nan, 9.0)])
def test_a_band_outside_the_spectrum_is_refused(band):
    with pytest.raises(ValueError, match=r"band = .* must rise and lie in 0 … fs / 2 = 4096 Hz"):
        envelope(T, FS, band)


def test_a_band_of_too_few_lines_is_refused():
    with pytest.raises(ValueError, match=r"holds 7 lines of 1 Hz, must hold >= 8; widen it"):
        envelope(T, FS, (100.5, 107.5))
    assert envelope(T, FS, (100.0, 107.0))[0].size == 16


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="kind = 'cubed' must be one of squared, plain, log"):
        envelope_spectrum(T, FS, kind="cubed")


# --- bearings


def test_published_bearing_frequencies():
    """MathWorks' bearingFaultBands example: 8 rollers, 2 cm on 12 cm, 25 Hz, 0 and 15 degrees."""
    published = {
        0: (10.4167, 83.3333, 116.6667, 72.9167),
        15: (10.4877, 83.9012, 116.0988, 73.0562),
    }
    for degrees, expected in published.items():
        found = bearing_frequencies(
            8, 0.02, 0.12, contact_angle=math.radians(degrees), speed_hz=25.0
        )
        parts = (found.cage, found.outer, found.inner, found.roller)
        assert_allclose(parts, expected, atol=5e-5)  # printed with four decimals


@pytest.mark.parametrize(
    ("geometry", "published"),
    [
        # Case Western Reserve: multiples of the shaft speed of the 6205 and 6203, inches
        ((9, 0.3126, 1.537), (0.398308, 3.58478, 5.41522, 2.35672)),
        ((8, 0.2656, 1.122), (0.38164, 3.05312, 4.94688, 1.99384)),
    ],
)
def test_orders_of_the_case_western_bearings(geometry, published):
    found = bearing_frequencies(*geometry)
    # diameters of four digits, orders of six
    parts = (found.cage, found.outer, found.inner, found.roller)
    assert_allclose(parts, published, rtol=2e-5)
    assert_allclose(found.outer + found.inner, geometry[0], rtol=1e-12)  # n rollers a turn


def test_a_bearing_that_cannot_be_is_refused_with_all_faults():
    with pytest.raises(ValueError, match="rollers = 0") as refusal:
        bearing_frequencies(0, 0.2, 0.1, contact_angle=15.0, speed_hz=-1.0)
    for part in ("roller_diameter = 0.2", "contact_angle = 15.0 rad", "speed_hz"):
        assert part in str(refusal.value)


# --- fault lines


def comb(at, size=1.0, *, lines=1000, spacing=0.5, seed=3, harmonics=3):
    """Rayleigh noise of median 1 with Hann peaks at the multiples of a frequency."""
    rng = np.random.default_rng(seed)
    frequency = np.arange(lines) * spacing
    amplitude = rng.rayleigh(1 / math.sqrt(2 * math.log(2)), lines)
    for k in range(1, harmonics + 1):
        off = np.arange(lines) - k * (at + 1e-9) / spacing  # on a line the formula is 0 / 0
        near = np.abs(off) < 1.99
        amplitude[near] += size * np.sinc(off[near]) / (1 - off[near] ** 2)
    return frequency, amplitude


@given(slip=st.floats(-0.019, 0.019), seed=st.integers(0, 50))
def test_a_fault_line_is_found_between_the_lines(slip, seed):
    found = fault_line(*comb(81.125 * (1 + slip), 100.0, seed=seed), 81.125)
    # noise of 1 on lines of 100 moves the ratio of two by 2 %, 0.05 lines of 0.5 Hz: 0.025 Hz at
    # the fundamental, less at a harmonic
    assert found.frequency == pytest.approx(81.125 * (1 + slip), abs=0.025)
    # at worst a third harmonic half-way between two lines reads 15 % low; median of noise 1 +- 15 %
    assert 75 < found.score < 125
    assert_allclose(found.score, np.prod(found.ratios) ** (1 / 3), rtol=1e-12)


def test_noise_scores_low():
    scores = [fault_line(*comb(81.125, 0.0, seed=i), 81.125).score for i in range(300)]
    # the largest of seven Rayleigh lines is 2.0 medians; three of them averaged
    assert 1.5 < np.median(scores) < 2.5
    assert max(scores) < 4.5


def test_a_multiple_of_another_fault_does_not_pass():
    """2 x 120 Hz = 3 x 80 Hz, but neither 120 nor 360 Hz is a multiple of 80."""
    spectrum = comb(80.0, 50.0)
    assert fault_line(*spectrum, 81.125).score > 30
    assert fault_line(*spectrum, 118.875).score < 8


def test_the_height_of_a_fault_line():
    frequency = np.arange(1000) * 0.5
    amplitude = np.full(1000, 0.25)
    amplitude[[160, 320, 480]] = 5.0, 4.0, 2.0
    found = fault_line(frequency, amplitude, 81.0)
    assert found.amplitudes.tolist() == [5.0, 4.0, 2.0]
    assert found.ratios.tolist() == [20.0, 16.0, 8.0]
    assert found.frequency == pytest.approx(80.0, abs=1e-12)
    # amplitudes in other units: same score
    assert fault_line(frequency, 1e-9 * amplitude, 81.0).score == pytest.approx(found.score)


def test_harmonics_beyond_the_spectrum_are_left_out():
    spectrum = comb(80.0, 50.0, lines=400, harmonics=2)  # up to 200 Hz
    assert fault_line(*spectrum, 80.0).ratios.size == 2


def test_a_silent_spectrum_scores_nothing():
    found = fault_line(np.arange(1000) * 0.5, np.zeros(1000), 81.0)
    assert found.score == 0
    assert not found.amplitudes.any()


@pytest.mark.parametrize(
    ("fault", "options", "message"),
    [
        (10.0, {}, "fault_hz = 10 Hz must be >= 13.3333 Hz, which a longer record lowers"),
        (450.0, {}, "and <= 384.231 Hz, which a wider band raises"),
        (math.nan, {"harmonics": 0}, "harmonics = 0 must be >= 1; .*fault_hz = nan Hz"),
        (81.0, {"slip": 0.06}, r"slip \* harmonics = 0.18 must be >= 0 and <= 0.15"),
    ],
)
def test_a_search_that_cannot_succeed_is_refused(fault, options, message):
    with pytest.raises(ValueError, match=message):
        fault_line(*comb(81.0), fault, **options)


@pytest.mark.parametrize(
    ("frequency", "amplitude", "message"),
    [
        ([0.0, 1.0], [1.0], "two rows of equal length"),
        (np.arange(99.0) + 1, np.ones(99), "must rise evenly from 0"),
        (np.arange(99.0) ** 2, np.ones(99), "must rise evenly from 0"),
        (np.arange(99.0), np.full(99, np.nan), "must be finite and >= 0"),
    ],
)
def test_what_is_no_spectrum_is_refused(frequency, amplitude, message):
    with pytest.raises(ValueError, match=message):
        fault_line(frequency, amplitude, 40.0)


def test_one_large_blow_hides_the_others_from_all_but_the_logarithm():
    wave = blows(80.0, 3000.0, noise=0.05)
    wave[20_000] += 3000.0
    scores = {
        kind: fault_line(*envelope_spectrum(wave, 25_600.0, (2000.0, 4000.0), kind=kind), 80.0)
        for kind in ("squared", "log")
    }
    assert scores["squared"].score < 5
    assert scores["log"].score > 15
    assert scores["log"].frequency == pytest.approx(80.0, abs=0.5)  # a line's width


# --- spectral kurtosis


def test_spectral_kurtosis_of_noise_is_0():
    wave = np.random.default_rng(4).standard_normal((40, 16_384))
    _, found = spectral_kurtosis(wave, FS)
    n_frames = 127
    assert found.std() == pytest.approx(2 / math.sqrt(n_frames), rel=0.05)
    # 40 x 125 lines, neighbours of which share a third of their noise: 0.178 / sqrt(2500), and the
    # bias of -1 / (9 x 127) that the overlap leaves
    assert found.mean() == pytest.approx(-1 / (9 * n_frames), abs=4 * 0.0036)


@pytest.mark.parametrize("n_frames", [5, 20])
def test_spectral_kurtosis_has_no_bias_with_few_frames(n_frames):
    wave = np.random.default_rng(5).standard_normal((2000, 64 * (n_frames + 1) // 2))
    _, found = spectral_kurtosis(wave, FS, nperseg=64)
    naive = -2 / (n_frames + 1)  # of <|X|^4> / <|X|^2>^2 - 2
    # 2000 x 29 lines that share a third of their noise; a ninth of 1 / K from the overlap
    assert abs(found.mean()) < 0.2 * abs(naive)


@given(cycles=st.integers(4, 28), size=sizes)
def test_spectral_kurtosis_of_a_tone_is_minus_1(cycles, size):
    frequency, found = spectral_kurtosis(
        size * np.cos(2 * np.pi * cycles / 64 * np.arange(4096)), 64.0, nperseg=64
    )
    assert found[frequency == cycles][0] == pytest.approx(-1, abs=1e-9)


def test_spectral_kurtosis_shows_where_the_blows_ring():
    frequency, found = spectral_kurtosis(blows(80.0, 3000.0), 25_600.0, nperseg=128)
    assert frequency[np.argmax(found)] == pytest.approx(3000, abs=400)  # two lines
    assert found.max() > 1
    assert np.abs(found[frequency > 6000]).max() < 0.5  # noise: 4 x 2 / sqrt(799)


@pytest.mark.parametrize("places", [(20_000,), (25_600,), (100,), (9000, 40_000)])
def test_lone_spikes_are_no_line_of_spectral_kurtosis(places):
    """The rule of the kurtogram, line by line."""
    noise = 0.2 * np.random.default_rng(0).standard_normal(51_200)
    _, bare = spectral_kurtosis(noise, 25_600.0)
    _, found = spectral_kurtosis(noise + spikes(*places), 25_600.0)
    # with the spikes left in, some hundred; of 399 frames noise has 0.1, at most four times that
    assert found.max() < 0.5
    assert bare.max() < 0.5
    frequency, rings = spectral_kurtosis(blows(80.0, 3000.0) + spikes(*places), 25_600.0)
    assert frequency[np.argmax(rings)] == pytest.approx(3000, abs=400)


@pytest.mark.parametrize(("n_frames", "most"), [(64, 0.04), (127, 0.005), (256, 0.015)])
def test_the_rule_seldom_touches_spectral_kurtosis_of_noise(n_frames, most):
    """Found: 0.029, 0.0023 and 0.0095 of 5,160 lines."""
    wave = np.random.default_rng(4).standard_normal((40, 128 * (n_frames + 1)))
    fourth = _moments(wave, 256, n_frames, _begins(n_frames, 16))[1]
    share = LONE_SHARE if n_frames >= MANY_FRAMES else LONE_SHARE_OF_FEW
    assert np.mean(_without_lone(fourth, share).min(axis=-1) == 0) < most


def test_a_lone_spike_is_left_out_of_a_short_record():
    noise = 0.2 * np.random.default_rng(0).standard_normal(16_384)
    _, found = spectral_kurtosis(noise + spikes(5000, n=16_384), 25_600.0)
    assert found.max() < 1.0  # 127 frames: 0.18 and 4 to 5 times that


@pytest.mark.parametrize("n", [1024, 4096, 8192])  # 31, 31 and 63 frames
def test_a_lone_spike_is_left_out_of_fewer_than_64_frames(n):
    noise = 0.2 * np.random.default_rng(0).standard_normal(n)
    _, found = spectral_kurtosis(noise + spikes(n // 3, n=n), 25_600.0)
    assert found.max() < 2.5  # noise: 0.4, and 4 to 5 times that; with the spike 10 and more


def test_noise_of_few_frames_loses_none():
    wave = np.random.default_rng(4).standard_normal((40, 4096))
    fourth = _moments(wave, 256, 31, _begins(31, 16))[1]
    assert np.mean(_without_lone(_pooled(fourth), LONE_SHARE_OF_FEW).min(axis=-1) == 0) < 0.005


def test_blows_in_few_frames_are_kept():
    wave = blows(80.0, 3000.0)
    short, pooled = spectral_kurtosis(wave[:2048], 25_600.0)  # 31 frames, 6 blows
    assert short[np.argmax(pooled)] == pytest.approx(3000, abs=800)  # four lines


def test_spectral_kurtosis_of_silence_is_that_of_a_steady_tone():
    assert (spectral_kurtosis(np.zeros(4096), FS)[1] == -1).all()


@pytest.mark.parametrize("nperseg", [15, 8, 2000])
def test_frames_that_make_no_kurtosis_are_refused(nperseg):
    with pytest.raises(ValueError, match=f"nperseg = {nperseg} samples must be even, >= 16"):
        spectral_kurtosis(T[:4096], FS, nperseg=nperseg)


# --- kurtogram


def test_the_tree_is_that_of_halves_and_thirds():
    found = kurtogram(np.random.default_rng(6).standard_normal(16_384), FS)
    assert [row.size for row in found.kurtosis] == [
        1,
        2,
        3,
        4,
        6,
        8,
        12,
        16,
        24,
        32,
        48,
        64,
        96,
        128,
    ]
    assert_allclose(found.level[:4], [0, 1, math.log2(3), 2])
    image = found.image()
    assert image.shape == (14, 384)
    assert (image[2].reshape(3, 128) == found.kurtosis[2][:, np.newaxis]).all()


def test_kurtogram_of_noise_scatters_round_0_as_it_says():
    rows = [
        kurtogram(np.random.default_rng(seed).standard_normal(32_768), FS, levels=6)
        for seed in range(30)
    ]
    for row in range(3, 12):
        values = np.concatenate([found.kurtosis[row] for found in rows])
        # 120 to 2000 values, neighbours nearly independent: their spread is known to 10 % or better
        assert values.std() == pytest.approx(rows[0].deviation[row], rel=0.2)
        assert abs(values.mean()) < 0.2 * rows[0].deviation[row] + 4 * values.std() / math.sqrt(120)
    # the highest of 223 bands
    assert max(found.highest / found.deviation[-1] for found in rows) < 6


@given(cycles=st.floats(0.02, 0.48), phase=st.floats(0, 6.28))
@settings(max_examples=30)
def test_kurtogram_of_a_tone_is_minus_1_everywhere(cycles, phase):
    """In its band because its envelope is constant, elsewhere because there is nothing."""
    found = kurtogram(np.cos(2 * np.pi * cycles * np.arange(20_000) + phase), 1.0)
    # the least weight of a flank lets 80 dB less through, beside what leaks past the tapers; the
    # worst of 600 tones is -0.5, the median -0.99999
    assert found.highest < -0.3


def test_kurtogram_of_two_tones():
    """|1 + exp(j u)|^2 = 2 + 2 cos u: mean square 6 over squared mean 4, less 2: -1/2."""
    wave = np.cos(2 * np.pi * 1000 * T) + np.cos(2 * np.pi * 1040 * T)
    found = kurtogram(wave, FS, levels=3)
    # 1000 and 1040 Hz lie in the flat part of the second quarter's first third, 683 … 1365 Hz; the
    # ends cut the beat: 1/40 of a second in 0.98 s
    assert found.kurtosis[4][1] == pytest.approx(-0.5, abs=0.03)


@pytest.mark.parametrize("resonance", [1700.0, 3000.0, 5200.0, 8100.0, 10_700.0])
@pytest.mark.parametrize("rate", [45.0, 118.0])
def test_kurtogram_finds_the_planted_band_and_the_envelope_its_rate(resonance, rate):
    wave = blows(rate, resonance, seed=int(resonance))
    found = kurtogram(wave, 25_600.0)
    low, high = found.band
    # a flank reaches a quarter of the width beyond
    assert low - found.bandwidth / 4 < resonance < high + found.bandwidth / 4
    assert found.highest > 10 * found.deviation[found.best[0]]
    frequency, amplitude = envelope_spectrum(wave, 25_600.0, found.band)
    slow = (frequency > 10) & (frequency < 400)
    # two seconds: lines half a hertz apart
    assert frequency[slow][np.argmax(amplitude[slow])] == pytest.approx(rate, abs=0.5)
    assert fault_line(frequency, amplitude, rate * 1.012).frequency == pytest.approx(rate, abs=0.1)


def test_kurtogram_is_not_fooled_by_the_step_between_the_ends():
    """A loud slow tone that does not close: its ends differ by 1000 times the noise."""
    rng = np.random.default_rng(7)
    t = np.arange(50_000) / 25_600
    wave = 1000 * np.sin(2 * np.pi * 25.3 * t) + rng.standard_normal(t.size)
    found = kurtogram(wave, 25_600.0)
    above = [row[1:].max() for row in found.kurtosis if row.size > 3]
    assert max(above) < 6 * found.deviation[-1]


def test_kurtogram_does_not_depend_on_scale_sign_and_offset():
    wave = blows(80.0, 3000.0)
    plain = kurtogram(wave, 25_600.0)
    for other in (1e6 * wave, 1e-9 * wave, -wave, wave + 30.0):
        found = kurtogram(other, 25_600.0)
        assert found.band == plain.band
        for row, expected in zip(found.kurtosis, plain.kurtosis, strict=True):
            assert_allclose(row, expected, rtol=0, atol=1e-9)  # rounding


def test_kurtogram_moves_little_when_the_record_does():
    long = blows(80.0, 3000.0, seconds=2.2)
    early, late = kurtogram(long[:51_200], 25_600.0), kurtogram(long[5000:56_200], 25_600.0)
    assert early.band == late.band
    # 160 blows, 16 of them exchanged
    assert early.highest == pytest.approx(late.highest, rel=0.1)


def test_kurtogram_in_single_precision():
    wave = blows(80.0, 3000.0)
    double = kurtogram(wave, 25_600.0)
    single = kurtogram((1e6 * wave).astype(np.float32), 25_600.0)
    assert single.band == double.band
    for row, expected in zip(single.kurtosis, double.kurtosis, strict=True):
        assert_allclose(row, expected, rtol=1e-4, atol=1e-4)  # sums of 24 bits


def spikes(*places, size=200.0, n=51_200):
    """Electrical spikes: four samples of alternating sign, loudest at half the sample rate."""
    wave = np.zeros(n)
    for place in places:
        wave[place : place + 4] = size * np.array([1, -1, 1, -1])
    return wave


@pytest.mark.parametrize("places", [(20_000,), (25_600,), (100,), (9000, 40_000)])
def test_lone_spikes_are_no_band_of_a_kurtogram(places):
    noise = 0.2 * np.random.default_rng(0).standard_normal(51_200)
    bare = kurtogram(noise, 25_600.0, levels=4)
    found = kurtogram(noise + spikes(*places), 25_600.0, levels=4)
    # a plain mean has a kurtosis of some thousand here; 6 as of noise alone
    assert found.highest < 6 * found.deviation[-1]
    assert bare.highest < 6 * bare.deviation[-1]


@pytest.mark.parametrize("places", [(), (20_000,), (9000, 40_000)])
@pytest.mark.parametrize("levels", [4, 7])
def test_a_train_of_blows_wins_over_lone_spikes(places, levels):
    train = blows(80.0, 3000.0)
    plain = kurtogram(train, 25_600.0, levels=levels)
    found = kurtogram(train + spikes(*places), 25_600.0, levels=levels)
    assert found.band == plain.band
    assert found.band[0] < 3000 < found.band[1]
    # up to a quarter of the blows are left out with the spikes
    assert found.highest == pytest.approx(plain.highest, rel=0.15)


@pytest.mark.parametrize(("rate", "again"), [(0.5, False), (1.0, False), (3.0, True), (10.0, True)])
def test_blows_come_back_from_four_a_record_on(rate, again):
    """Two seconds: one, two, six and twenty blows."""
    found = kurtogram(blows(rate, 3000.0, noise=0.02), 25_600.0, levels=4)
    assert (found.highest > 10 * found.deviation[found.best[0]]) == again


def test_the_depth_leaves_bands_that_hold_what_is_sought():
    bearing = bearing_frequencies(8, 20.0, 120.0)
    for speed, known in ((None, None), (25.0, None), (25.0, bearing), (2.0, bearing)):
        span = envelope_span(speed, known)
        levels = kurtogram_levels(51_200, 25_600.0, span)
        assert 12_800 / 2**levels >= span
        assert levels == 7 or 12_800 / 2 ** (levels + 1) < span
    assert kurtogram_levels(256, 100.0, 500.0) == 1


@pytest.mark.parametrize("wave", [np.zeros(16_384), np.full(16_384, 0.1)])
def test_kurtogram_of_nothing_is_the_whole_band(wave):
    found = kurtogram(wave, FS)
    assert found.highest == -1
    assert found.band == (0.0, FS / 2)
    assert (found.centre, found.bandwidth) == (FS / 4, FS / 2)


def test_depth_follows_the_length():
    assert len(kurtogram(T[:1024], FS).kurtosis) == 6  # 1, 2, 3, 4, 6 and 8 bands
    with pytest.raises(
        ValueError, match=r"levels = 4 must be >= 1 and <= 3, log2\(n_samples\) - 7"
    ):
        kurtogram(T[:1024], FS, levels=4)
    with pytest.raises(ValueError, match="levels = 0 must be >= 1"):
        kurtogram(T[:1024], FS, levels=0)


def test_one_channel_at_a_time():
    for call in (kurtogram, lambda x, fs: cyclic_coherence(x, fs, [50.0])):
        with pytest.raises(ValueError, match=r"x has shape \(2, 8192\), must be \(n_samples,\)"):
            call(np.stack([T, T]), FS)


def test_agreement_with_a_published_kurtogram(monkeypatch):
    """openconmo, after Antoni's own code: the maximum at the same place."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    published = pytest.importorskip("openconmo.kurtogram").fast_kurtogram
    for seed in range(8):
        resonance = np.random.default_rng(seed).uniform(1500, 11_000)
        wave = blows(60.0 + seed, resonance, seconds=2.4, seed=seed)
        theirs, _, _, centre, width = published(wave.copy(), 25_600.0, nlevel=7)
        ours = kurtogram(wave, 25_600.0, levels=7)
        # theirs overlap by 0.6 of a band, ours by 0.5 with steeper flanks: of two bands that hold
        # the resonance either may win, by a kurtosis a quarter apart at most
        assert abs(ours.centre - centre) <= max(width, ours.bandwidth) / 2
        assert ours.highest == pytest.approx(theirs.max(), rel=0.25)
        assert ours.image().shape == theirs.shape
        assert np.corrcoef(ours.image()[1:].ravel(), theirs[1:].ravel())[0, 1] > 0.9


# --- cyclic coherence


@pytest.mark.parametrize("depth", [0.2, 0.5, 1.0])
def test_coherence_of_modulated_noise(depth):
    fs, n, rate = 8192.0, 1 << 18, 57.3
    t = np.arange(n) / fs
    noise = np.random.default_rng(8).standard_normal(n)
    wave = noise * (1 + depth * np.cos(2 * np.pi * rate * t))
    _, found = cyclic_coherence(wave, fs, [rate, 2 * rate, 1.37 * rate])
    power = 1 + depth**2 / 2
    expected = [(depth / power) ** 2, (depth**2 / 4 / power) ** 2, 0]
    n_independent = 4 * n / 256 / 1.92
    # the mean of 120 lines, half of them independent: each scatters by about 2 |c| / sqrt(n); and
    # 1 / n of bias
    for line_, truth in zip(found[:, 4:-4].mean(axis=1), expected, strict=True):
        spread = 2 * math.sqrt(truth) / math.sqrt(n_independent * 60)
        assert line_ == pytest.approx(truth, abs=4 * spread + 2 / n_independent)


def test_noise_passes_the_threshold_as_rarely_as_it_says():
    rng = np.random.default_rng(9)
    found = [
        cyclic_coherence(rng.standard_normal(16_384), 1.0, [0.0123, 0.031, 0.07])[1][:, 12:-12]
        for _ in range(20)
    ]
    for probability in (0.1, 0.01):
        bound = coherence_threshold(16_384, probability=probability)
        # 6300 values of which half are independent: 0.01 to 20 % at one deviation
        assert np.mean(np.array(found) > bound) == pytest.approx(probability, rel=0.5)


def test_coherence_of_blows_stands_at_their_rate_and_harmonics():
    wave = blows(80.0, 3000.0, seconds=4.0)
    rates = [80.0, 160.0, 71.0, 97.0]
    frequency, found = cyclic_coherence(wave, 25_600.0, rates)
    bound = coherence_threshold(wave.size, probability=1e-6)
    ring = (frequency > 2700) & (frequency < 3300)
    assert found[:2, ring].min() > 5 * bound
    assert found[2:].max() < bound


def test_coherence_between_two_tones_is_1():
    wave = np.cos(2 * np.pi * 1024 * T) + np.cos(2 * np.pi * 1088 * T + 0.7)
    frequency, found = cyclic_coherence(wave, FS, [64.0, 100.0])
    assert found[0, frequency == 1088][0] == pytest.approx(1, abs=1e-3)  # leakage of the other
    # 100 Hz apart is nothing: two steady lines at different frequencies average out over a second
    assert found[1, frequency == 1088][0] < 1e-2


def test_coherence_does_not_depend_on_scale_sign_offset_and_shift():
    wave = blows(80.0, 3000.0)
    plain = cyclic_coherence(wave, 25_600.0, [80.0])[1]
    for other in (1e6 * wave, -wave, wave + 30.0):
        assert_allclose(cyclic_coherence(other, 25_600.0, [80.0])[1], plain, atol=1e-9)
    moved = cyclic_coherence(wave[640:], 25_600.0, [80.0])[1]
    assert_allclose(moved, plain, atol=0.05)  # 10 of 796 frames dropped
    single = cyclic_coherence(wave.astype(np.float32), 25_600.0, [80.0])[1]
    assert_allclose(single, plain, atol=1e-5)


def test_coherence_of_silence_is_0():
    assert not cyclic_coherence(np.zeros(N), FS, [50.0])[1].any()


@pytest.mark.parametrize("cyclic", [0.0, -3.0, 4096.0, 0.5, math.nan])
def test_cyclic_frequencies_out_of_range_are_refused(cyclic):
    with pytest.raises(ValueError, match=r"cyclic_hz = .* must be one row, >= 1, one period"):
        cyclic_coherence(T, FS, [50.0, cyclic])


@pytest.mark.parametrize("nperseg", [258, 12, 4096])
def test_frames_that_make_no_coherence_are_refused(nperseg):
    with pytest.raises(ValueError, match=f"nperseg = {nperseg} samples must be a multiple of 4"):
        cyclic_coherence(T, FS, [50.0], nperseg=nperseg)


def test_a_threshold_needs_a_probability():
    with pytest.raises(ValueError, match="probability = 1 must be > 0 and < 1"):
        coherence_threshold(N, probability=1)


def test_a_kurtogram_is_a_value():
    found = kurtogram(T[:1024] ** 2, FS)
    assert isinstance(found, Kurtogram)
    with pytest.raises(AttributeError):
        found.fs = 1.0
