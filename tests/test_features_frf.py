"""Frequency response: known systems, bias by noise, confidence counted, other libraries."""

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from numpy.testing import assert_allclose
from wearstate.features.response import frf
from wearstate.features.signal.spectrum import hann

FS = 4096.0
N = 4096


def accelerance(s, modes=((180.0, 0.02, 1.0), (420.0, 0.012, -0.6), (1100.0, 0.008, 0.4))):
    """Sum of modes ``g s^2 / (s^2 + 2 zeta w s + w^2)`` at the complex frequency s [rad/s]."""
    total = np.zeros(np.shape(s), dtype=complex)
    for f0, zeta, gain in modes:
        omega = 2 * np.pi * f0
        total += gain * s**2 / (s**2 + 2 * zeta * omega * s + omega**2)
    return total


def lines(n=N, fs=FS):
    return np.arange(n // 2 + 1) * fs / n


def blows(n_blocks, seed, n=N, fs=FS):
    """Half-sine pulses of 1 ms and of a strength that scatters, one a block [N]."""
    rng = np.random.default_rng(seed)
    width = round(1e-3 * fs)
    pulse = np.zeros(n)
    pulse[8 : 8 + width + 1] = np.sin(np.pi * np.arange(width + 1) / width)
    return 100 * rng.lognormal(0.0, 0.3, (n_blocks, 1)) * pulse


def responses(force, transfer):
    """Response of every block; the slowest mode falls by exp(-22) in a block, so none is cut."""
    return np.fft.irfft(np.fft.rfft(force) * transfer, force.shape[-1])


# --- known systems


def test_phase_and_sign_of_one_degree_of_freedom():
    stiffness, mass, zeta = 4e5, 2.5, 0.05
    omega = np.sqrt(stiffness / mass)
    f0 = omega / (2 * np.pi)
    n = 4096
    fs = 64 * f0
    s = 2j * np.pi * lines(n, fs)
    receptance = 1 / (mass * s**2 + 2 * zeta * mass * omega * s + stiffness)
    force = blows(2, 0, n, fs)
    value = frf.h1(frf.block_spectra(force, responses(force, receptance), fs))[0]
    at = n // 64  # the line of the resonance
    # Identities but for rounding: static limit 1/k in phase, -90 degrees at the resonance, mass
    # line and -180 degrees above it.
    assert_allclose(value[0], 1 / stiffness, rtol=1e-10)
    assert_allclose(value[at], -1j / (2 * zeta * stiffness), rtol=1e-10)
    assert abs(np.angle(value[16 * at])) > 0.99 * np.pi
    assert_allclose(abs(value[16 * at]), 1 / (mass * (16 * omega) ** 2), rtol=5e-3)


def test_a_delay_has_a_falling_phase():
    force = np.random.default_rng(0).standard_normal(N)
    value = frf.h1(frf.welch_spectra(force, np.roll(force, 3), FS, nperseg=256))[0]
    at = 16  # 256 Hz: 3 / 4096 s are 0.1875 periods
    # 3 samples of 256 are lost at the ends of each block: noise of about a hundredth.
    assert_allclose(np.angle(value[at]), -2 * np.pi * 0.1875, atol=0.03)


def test_the_exponential_window_moves_the_poles_and_nothing_else():
    force = blows(3, 1)
    response = responses(force, accelerance(2j * np.pi * lines()))
    decay = frf.window_decay(N / FS, last=0.01)
    spectra = frf.block_spectra(force, response, FS, decay=decay)
    expected = accelerance(decay + 2j * np.pi * lines())
    # The tail cut off at the end is exp(-22 - 4.6) of the response. The response to a blow limited
    # to half the sample rate rings at -60 dB, ahead of the blow too, where the window wraps round:
    # 5e-5 of a response function that reaches 25; the same near half the sample rate.
    kept = slice(1, 1200)
    assert_allclose(frf.h1(spectra)[0, kept], expected[kept], rtol=2e-3, atol=1e-4)
    assert spectra.decay == decay
    # Without the shift the resonance would be missed by a fifth and more.
    unshifted = accelerance(2j * np.pi * lines())
    assert np.max(np.abs(unshifted[kept] / expected[kept])) > 1.15


# --- bias


def stationary(seed, noise_in=0.0, noise_out=0.0, n=200_000):
    """White force through a gain of 2 and one sample's delay; noise powers over the signals'."""
    rng = np.random.default_rng(seed)
    force = rng.standard_normal(n)
    response = 2 * np.roll(force, 1)
    measured = force + np.sqrt(noise_in) * rng.standard_normal(n)
    return measured, response + 2 * np.sqrt(noise_out) * rng.standard_normal(n)


TRUTH = 2 * np.exp(-2j * np.pi * np.arange(1, 128) / 256)
"""Of the lines between zero and half the sample rate, in blocks of 256."""


def mean_ratio(value):
    return np.mean(value[0, 1:-1] / TRUTH)


def test_bias_by_noise_on_the_response():
    spectra = frf.welch_spectra(*stationary(1, noise_out=0.5), FS, nperseg=256)
    # 1560 blocks x 127 lines: the mean of H1 scatters by sqrt(0.5 / 2 / 1.9e5) = 0.1 %, H2 alike;
    # four of them, and one sample in 256 lost to the delay (0.4 %, half of it in H2 - H1).
    assert_allclose(mean_ratio(frf.h1(spectra)), 1.0, atol=0.008)
    assert_allclose(mean_ratio(frf.h2(spectra)), 1.5, atol=0.012)
    assert_allclose(np.mean(frf.coherence(spectra)[0]), 1 / 1.5, atol=0.006)


def test_bias_by_noise_on_the_force():
    spectra = frf.welch_spectra(*stationary(2, noise_in=0.5), FS, nperseg=256)
    # As above.
    assert_allclose(mean_ratio(frf.h2(spectra)), 1.0, atol=0.008)
    assert_allclose(mean_ratio(frf.h1(spectra)), 1 / 1.5, atol=0.006)
    assert_allclose(np.mean(frf.coherence(spectra)[0]), 1 / 1.5, atol=0.006)


def test_the_ratio_of_the_estimators_is_the_coherence():
    spectra = frf.welch_spectra(*stationary(3, 0.3, 0.2, n=20_000), FS, nperseg=256)
    ratio = frf.h1(spectra) / frf.h2(spectra)
    assert_allclose(ratio, frf.coherence(spectra), atol=1e-12)  # an identity
    assert np.all(np.abs(frf.h1(spectra)) <= np.abs(frf.h2(spectra)))


def test_coherence_of_nothing_in_common():
    rng = np.random.default_rng(4)
    spectra = frf.block_spectra(*rng.standard_normal((2, 8, 8192)), FS)
    # Beta(1, n - 1) has mean 1/n = 0.125 and deviation 0.11: 4095 lines, four deviations.
    assert_allclose(np.mean(frf.coherence(spectra)[0, 1:-1]), 1 / 8, atol=4 * 0.11 / 64)


# --- confidence


def noisy_test(seed, n_blocks, noise, n=N):
    """Hammer test with white noise on the response alone; its truth."""
    transfer = accelerance(2j * np.pi * lines(n))
    force = blows(n_blocks, seed, n)
    rng = np.random.default_rng(seed + 10_000)
    response = responses(force, transfer)
    return force, response + noise * rng.standard_normal(response.shape), transfer


def inside(spectra, truth, estimator="h1", kept=slice(1, -1)):
    estimate = frf.estimate_frf(spectra, estimator=estimator)
    return (np.abs(estimate.value[0] - truth) <= estimate.radius[0])[kept]


def test_the_disc_holds_the_truth_on_2000_independent_lines():
    force, response, truth = noisy_test(0, 10, noise=1.0)
    spectra = frf.block_spectra(force, response, FS)
    shares = frf.coherence(spectra)[0, 1:2001]
    # The test reaches from lines lost in the noise to clean ones.
    assert shares.min() < 0.3
    assert shares.max() > 0.99
    # Nominal 95 %; white noise has independent lines, so the count scatters by 0.5 %.
    held = inside(spectra, truth, kept=slice(1, 2001))
    assert held.size == 2000
    assert 0.93 <= np.mean(held) <= 0.97


@pytest.mark.parametrize("n_blocks", [2, 3, 5, 20])
def test_the_disc_is_exact_for_any_number_of_blows(n_blocks):
    held = []
    for seed in range(16):
        force, response, truth = noisy_test(100 + seed, n_blocks, noise=1.0)
        held.append(inside(frf.block_spectra(force, response, FS), truth))
    # 16 x 2047 independent lines: 0.12 % a deviation, four of them.
    assert_allclose(np.mean(held), 0.95, atol=0.005)


def test_the_disc_about_h2_holds_the_truth():
    held = []
    for seed in range(16):
        force, _, truth = noisy_test(200 + seed, 8, noise=0.0)
        rng = np.random.default_rng(seed)
        measured = force + 1.0 * rng.standard_normal(force.shape)
        held.append(inside(frf.block_spectra(measured, responses(force, truth), FS), truth, "h2"))
    # The covering disc is larger than the image of the exact one: never less than 95 %, and the
    # wider the noisier.
    assert 0.948 < np.mean(held) < 0.99


def test_real_lines_have_their_own_bound():
    held = []
    for seed in range(400):
        force, response = np.random.default_rng(seed).standard_normal((2, 4, 64))
        spectra = frf.block_spectra(force, 3 * force + response, FS)
        held.append(inside(spectra, 3.0, kept=[0, -1]))
    # 800 lines: 0.8 % a deviation, four of them; the bound of the complex lines would hold 88 %.
    assert_allclose(np.mean(held), 0.95, atol=0.031)


def test_closed_form_of_the_bound_against_scipy():
    force, response, _ = noisy_test(5, 7, noise=1.0)
    spectra = frf.block_spectra(force, response, FS)
    share = frf.coherence(spectra)[0]
    quantile = scipy.stats.f.ppf(0.9, 2, 12)
    noise = (1 - share) * spectra.response[0] / spectra.force
    radius = frf.confidence_radius(spectra, confidence=0.9)[0]
    # The quantile's own accuracy.
    assert_allclose(radius[1:-1], np.sqrt(2 / 12 * quantile * noise[1:-1]), rtol=1e-9)
    real = scipy.stats.f.ppf(0.9, 1, 6) / 6
    assert_allclose(radius[[0, -1]], np.sqrt(real * noise[[0, -1]]), rtol=1e-9)


@pytest.mark.parametrize(("overlap", "window"), [(0.5, None), (2 / 3, None), (0.0, np.ones(256))])
def test_confidence_with_overlapping_blocks(overlap, window):
    held = []
    for seed in range(60):
        force, response = stationary(300 + seed, noise_out=0.5, n=256 * 12)
        spectra = frf.welch_spectra(
            force, response, FS, nperseg=256, overlap=overlap, window=window, detrend=False
        )
        held.append(inside(spectra, np.r_[2.0, TRUTH, -2.0]))
    # Neighbouring lines of Hann share noise: about 60 x 80 independent ones, 0.3 % a deviation.
    # The effective number is right to first order only (a whole one without overlap).
    assert_allclose(np.mean(held), 0.95, atol=0.015)


def test_random_error_is_the_scatter_of_the_magnitude():
    values = []
    for seed in range(200):
        force, response, truth = noisy_test(2000 + seed, 10, noise=0.3, n=512)
        values.append(np.abs(frf.h1(frf.block_spectra(force, response, FS))[0]))
    kept = slice(10, 110)  # away from the lines without response and without force
    scatter = (np.std(values, axis=0) / np.abs(truth).clip(1e-9))[kept]
    energy = np.mean(np.square(np.abs(np.fft.rfft(blows(2000, 7, 512)))), axis=0)
    share = 1 / (1 + 0.3**2 * 512 / (np.abs(truth[kept]) ** 2 * energy[kept]))
    expected = frf.random_error(share, 10)
    # First order holds to 2 % at an error of 0.2; 200 draws of a deviation scatter by 5 % a line.
    assert np.max(expected) < 0.2
    assert_allclose(np.mean(scatter / expected), 1.0, atol=0.04)


def test_an_interval_of_the_level_holds_the_truth():
    held = []
    for seed in range(200):
        force, response, truth = noisy_test(4000 + seed, 5, noise=0.3, n=512)
        spectra = frf.block_spectra(force, response, FS).between(80.0, 880.0)
        estimate = frf.estimate_frf(spectra)
        error = 20 * np.log10(np.abs(estimate.value[0] / truth[10:111]))
        held.append(np.abs(error) <= scipy.stats.t.ppf(0.95, 8) * frf.level_deviation(estimate)[0])
    # 20,000 independent lines: 0.2 % a deviation, and first order in errors of up to 0.2.
    assert_allclose(np.mean(held), 0.90, atol=0.01)


def test_effective_averages():
    # Hann overlapping by half: rho_1 = 1/6, so 1 / (1 + 2/36) for many blocks.
    assert_allclose(frf.effective_averages(hann(1024), 512, 10**6) / 1e6, 18 / 19, rtol=1e-5)
    assert frf.effective_averages(np.ones(64), 64, 5) == 5
    assert frf.effective_averages(np.ones(64), 16, 1) == 1
    # Against the variance of a mean power spectrum of white noise.
    rng = np.random.default_rng(6)
    powers = [
        frf.welch_spectra(x, x, FS, nperseg=128, overlap=0.75, detrend=False).force[4:-4]
        for x in rng.standard_normal((400, 1024))
    ]
    spectra = frf.welch_spectra(*rng.standard_normal((2, 1024)), FS, nperseg=128, overlap=0.75)
    relative = np.mean(np.var(powers, axis=0)) / np.mean(powers) ** 2
    # 400 variances on some 40 independent lines: 1 % a deviation.
    assert_allclose(1 / relative, spectra.averages, rtol=0.04)
    assert 0.4 < spectra.averages / spectra.blocks < 0.6


# --- other libraries


def test_scipy_gives_the_same_spectra_and_coherence():
    rng = np.random.default_rng(8)
    force = rng.standard_normal(20_000)
    response = np.stack([scipy.signal.lfilter([1, 0.5], [1, -0.6], force), force]) + 0.3
    response += rng.standard_normal(response.shape)
    ours = frf.welch_spectra(force, response, FS, nperseg=512, overlap=0.75)
    same = {"fs": FS, "window": hann(512), "nperseg": 512, "noverlap": 384}
    # Same arithmetic in another order.
    assert_allclose(ours.frequency, scipy.signal.csd(force, force, **same)[0], rtol=1e-12)
    assert_allclose(ours.force, scipy.signal.welch(force, **same)[1], rtol=1e-12)
    assert_allclose(ours.response, scipy.signal.welch(response, **same)[1], rtol=1e-12)
    cross = scipy.signal.csd(force, response, **same)[1]
    assert_allclose(ours.cross, cross, rtol=1e-12, atol=1e-12 * np.abs(cross).max())
    share = scipy.signal.coherence(force, response, **same)[1]
    assert_allclose(frf.coherence(ours), share, atol=1e-12)


@pytest.mark.filterwarnings("ignore")  # of the other library
@pytest.mark.parametrize("window", ["none", "hann"])
def test_pyfrf_gives_the_same_estimates(window):
    pyfrf = pytest.importorskip("pyFRF")
    rng = np.random.default_rng(9)
    n, n_blocks = 1024, 6
    force = rng.standard_normal((n_blocks, n))
    response = responses(force, accelerance(2j * np.pi * lines(n))) + rng.standard_normal(
        force.shape
    )
    theirs = pyfrf.FRF(
        sampling_freq=int(FS),
        exc=force[:, np.newaxis],
        resp=response[:, np.newaxis],
        exc_type="f",
        resp_type="d",  # then it converts nothing
        window=window,
        fft_len=n,
    )
    taper = np.ones(n) if window == "none" else np.hanning(n)  # theirs is the symmetric one
    # The library takes the mean of each block out.
    force, response = (x - x.mean(axis=-1, keepdims=True) for x in (force, response))
    ours = frf.block_spectra(force * taper, response * taper, FS)
    kept = slice(2, -1)  # clear of the mean, which is rounding
    # Same arithmetic in another order; the library divides by its own scale and back.
    assert_allclose(frf.h1(ours)[0, kept], theirs.get_H1()[0, 0, kept], rtol=1e-10)
    assert_allclose(frf.h2(ours)[0, kept], theirs.get_H2()[0, 0, kept], rtol=1e-10)
    share = np.squeeze(theirs.get_coherence())[kept]
    assert_allclose(frf.coherence(ours)[0, kept], share, rtol=1e-10)


# --- hammer


def hammer_record(hits, n=20_000, strengths=None):
    force = np.zeros(n)
    for at, strength in zip(hits, strengths or [100.0] * len(hits), strict=True):
        force[at : at + 5] = strength * np.sin(np.pi * np.arange(5) / 4)
    return force + 0.05 * np.random.default_rng(0).standard_normal(n)


def test_blows_are_found_and_double_hits_left_out():
    hits = [20, 2000, 5000, 5300, 9000, 12_000, 19_500]
    force = hammer_record(hits, strengths=[100, 100, 60, 20, 30, 150, 90])
    found = frf.find_blows(force, FS, nperseg=1024, pretrigger=50)
    # The first sample of a half sine of five is zero.
    assert found.starts.tolist() == [2001 - 50, 9001 - 50, 12_001 - 50]
    assert [text.split(": ")[1] for text in found.rejected] == [
        "block starts 29 samples before the record, must start in it",
        "hits 2 times, must hit once",
        "block ends 475 samples after the record, must end in it",
    ]
    blocks = found.cut(np.stack([force, -force]))
    assert blocks.shape == (3, 2, 1024)
    assert np.all(np.argmax(blocks[:, 0], axis=-1) == 51)


def test_noise_at_the_trigger_level_is_no_second_hit():
    force = np.zeros(200)
    force[50:60] = [0.06, 0.11, 0.09, 0.12, 0.6, 1.0, 0.6, 0.12, 0.08, 0.11]
    found = frf.find_blows(force, FS, nperseg=100, pretrigger=10)
    assert found.starts.tolist() == [51 - 10]


def test_a_force_window_takes_the_noise_and_leaves_the_blow():
    force = blows(4, 3)
    response = responses(force, accelerance(2j * np.pi * lines()))
    noisy = force + 1.0 * np.random.default_rng(3).standard_normal(force.shape)
    window = frf.force_window(N, FS, end=0.005, fall=0.002)
    truth = accelerance(2j * np.pi * lines())
    errors = []
    for taper in (None, window):
        spectra = frf.block_spectra(noisy, response, FS, force_window=taper)
        error = frf.h1(spectra)[0, 1:800] / truth[1:800] - 1
        errors.append(np.sqrt(np.mean(np.abs(error) ** 2)))
    # 24 of 4096 samples keep their noise: a factor of 13 in amplitude.
    assert errors[1] < errors[0] / 8
    assert_allclose(
        frf.block_spectra(force, response, FS, force_window=window).force,
        frf.block_spectra(force, response, FS).force,
        rtol=1e-12,
    )


# --- refusals and the rest


SPECTRA = frf.block_spectra(blows(1, 0), blows(1, 0), FS)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: frf.coherence(SPECTRA), "n_blocks = 1 must be >= 2.*identically 1"),
        (lambda: frf.estimate_frf(SPECTRA), "n_blocks = 1 must be >= 2"),
        (lambda: frf.estimate_frf(SPECTRA, estimator="h3"), "must be one of h1, h2"),
        (lambda: frf.h1(frf.block_spectra(np.zeros((2, 8)), np.ones((2, 8)), FS)), "force = 0 at"),
        (lambda: frf.h2(frf.block_spectra(np.ones((2, 8)), np.zeros((2, 8)), FS)), "response to"),
        (lambda: frf.block_spectra(np.ones((2, 8)), np.ones((2, 9)), FS), "cut both at the same"),
        (lambda: frf.block_spectra(np.ones((2, 8)), np.full((2, 8), np.nan), FS), "16 non-finite"),
        (lambda: frf.block_spectra(np.ones((2, 8)), np.ones((2, 8)), -1.0), "fs = -1.0 Hz"),
        (lambda: frf.block_spectra(np.ones((2, 8)), np.ones((2, 8)), FS, decay=-1), "decay = -1"),
        (
            lambda: frf.block_spectra(np.ones((2, 8)), np.ones((2, 8)), FS, force_window=[1]),
            r"must have \(8,\)",
        ),
        (lambda: frf.welch_spectra([1.0] * 99, [1.0] * 98, FS, nperseg=9), "channels of one"),
        (lambda: frf.welch_spectra([1.0] * 99, [1.0] * 99, FS, nperseg=100), "nperseg = 100"),
        (
            lambda: frf.welch_spectra([1.0] * 99, [1.0] * 99, FS, nperseg=9, overlap=1.0),
            "overlap = 1.0",
        ),
        (
            lambda: frf.welch_spectra([1.0] * 99, [1.0] * 99, FS, nperseg=9, window=[1.0]),
            r"window has shape \(1,\)",
        ),
        (lambda: frf.blocks_of(range(99), 9, 0), "step = 0"),
        (lambda: SPECTRA.between(0.1, 0.2), "must hold a line"),
        (lambda: frf.random_error([1.1], 5), "coherence must lie in 0"),
        (lambda: frf.random_error([0.5], 0), "averages = 0 must be > 0"),
        (lambda: frf.find_blows(-blows(1, 0)[0], FS, nperseg=64), "turn the sign"),
        (lambda: frf.find_blows(blows(1, 0)[0], FS, nperseg=64, pretrigger=20), "n_blows|n_blocks"),
        (lambda: frf.force_window(8, FS, end=0.0, fall=1.0), "end = 0.0 s must be > 0"),
        (lambda: frf.window_decay(1.0, last=0.0), "last = 0.0 must be > 0"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_band_of_lines():
    spectra = frf.block_spectra(blows(2, 0), blows(2, 1), FS)
    band = spectra.between(100.0, 200.0)
    assert band.frequency[[0, -1]].tolist() == [100.0, 200.0]
    assert band.cross.shape == (1, 101)
    assert_allclose(frf.h1(band), frf.h1(spectra)[:, 100:201])
    assert spectra.real_lines.nonzero()[0].tolist() == [0, 2048]
    assert not band.real_lines.any()


def test_magnitudes_of_the_disc():
    force, response, _ = noisy_test(11, 4, noise=5.0)
    estimate = frf.estimate_frf(frf.block_spectra(force, response, FS))
    low, high = estimate.magnitude_interval
    assert np.all((low >= 0) & (low <= np.abs(estimate.value)) & (np.abs(estimate.value) <= high))
    assert np.any(low == 0)  # lines lost in the noise
