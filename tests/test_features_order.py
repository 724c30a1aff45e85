"""Tacho, phase, orders and the crank-angle map against analytic truth."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features.rotation import order
from wearstate.features.signal import spectrum

FS = 25_600.0


def stepped(phase, duty=0.1, high=5.0):
    """Rectangular pulses averaged over each sample, from the phase at the sample edges [rev]."""
    on_time = np.floor(phase) * duty + np.minimum(phase % 1, duty)
    return high * np.diff(on_time) / np.diff(phase)


def constant_speed(speed, n, start=0.3, fs=FS):
    return start + speed * np.arange(n) / fs


def test_pulse_times_of_a_linear_edge_are_exact():
    # Edges through 2.5 V at 0.1 + k 0.2 s, each 8 samples long.
    t = np.arange(25_600) / FS
    volts = np.clip(2.5 + (((t + 0.1) % 0.2) - 0.1) * FS * 5 / 8, 0, 5)
    volts[((t + 0.1) % 0.2) - 0.1 < -0.09] = 0.0
    times = order.pulse_times(volts, FS)
    # Exact for a straight edge: rounding of t.
    assert_allclose(times, np.arange(1, 5) * 0.2, atol=1e-12)


def test_pulse_times_of_a_sampled_step():
    edges = (np.arange(51_201) - 0.5) / FS * 5.0371 - 0.4
    times = order.pulse_times(stepped(edges), FS)
    truth = (np.arange(times.size) + 0.4) / 5.0371
    assert times.size == 10
    # Worst case of linear interpolation over an averaged step, v = 1/sqrt 2: 0.5 / v + v - 1.5
    # = -0.086 sample.
    assert np.abs(times - truth).max() * FS < 0.0865


@pytest.mark.parametrize("seed", range(3))
def test_noise_neither_adds_nor_loses_pulses(seed):
    rng = np.random.default_rng(seed)
    edges = (np.arange(122_881) - 0.5) / FS * 5.03
    # Slow edges (about 3 ms) under 3 % noise cross the middle many times each.
    clean = np.convolve(stepped(edges), np.hanning(128) / np.hanning(128).sum(), "same")
    times = order.pulse_times(clean + rng.normal(0, 0.15, clean.size), FS)
    truth = np.arange(1, 25) / 5.03
    bare = np.count_nonzero(np.diff((clean + rng.normal(0, 0.15, clean.size)) > 2.5)) // 2
    assert bare > 30
    assert times.size == truth.size
    # 0.15 V on an edge of 5 V in 1.5 ms is 0.05 ms; the last crossing picks the latest of some.
    assert_allclose(times, truth, atol=0.3e-3)


def test_edges_at_the_ends_and_the_given_level():
    volts = np.array([5, 5, 0, 0, 5, 5, 0, 0, 5, 5, 0, 2.6])
    # Neither the pulse running at the start nor the half-risen last one is an edge.
    assert_allclose(order.pulse_times(volts, 1.0), [3.5, 7.5])
    assert_allclose(order.pulse_times(volts, 1.0, level=1.0), [3.2, 7.2, 10 + 1 / 2.6])


@pytest.mark.parametrize(
    ("volts", "message"),
    [
        (np.full(100, 2.0), r"level = 2 must lie between the extremes"),
        ([0, 0, 5, 5], r"1 rising edge\(s\) through 2.5, must have >= 2"),
        ([0, np.nan, 5, np.inf], r"2 non-finite samples, the first at 1"),
        (np.zeros((2, 3)), r"shape \(2, 3\)"),
    ],
)
def test_bad_tacho_is_refused(volts, message):
    with pytest.raises(ValueError, match=message):
        order.pulse_times(volts, FS)


def test_phase_at_constant_speed_is_a_line():
    phase = order.shaft_phase(np.arange(1, 24) / 5.0 - 0.03, 122_880, FS)
    # Any interpolant is exact on a line: rounding.
    assert_allclose(phase, 5.0 * (np.arange(122_880) / FS - 0.17), atol=1e-9)
    toothed = order.shaft_phase(np.arange(1, 96) / 20.0, 122_880, FS, pulses_per_revolution=4)
    assert_allclose(toothed, 5.0 * (np.arange(122_880) / FS - 0.05), atol=1e-9)


def test_phase_of_a_ramp():
    # 4.5 to 5.5 rev/s in 4.8 s; pulses at whole phases of a quadratic, exactly known.
    rate = 1.0 / 4.8
    pulses = (np.sqrt(4.5**2 + 2 * rate * np.arange(24)) - 4.5) / rate
    t = np.arange(122_880) / FS
    error = order.shaft_phase(pulses, t.size, FS) - (4.5 * t + rate * t**2 / 2)
    # Straight lines between pulses would err by rate / (8 speed^2) = 1.3e-3 rev; the monotone
    # cubic is an order of magnitude better. After the last pulse the speed is held constant.
    inside = slice(int(pulses[1] * FS), int(pulses[-2] * FS))
    assert np.abs(error[inside]).max() < 1e-4
    assert np.abs(error).max() < rate * (t[-1] - pulses[-1]) ** 2 / 2 + 1e-4


@pytest.mark.parametrize(
    ("pulses", "message"),
    [
        ([0.1], r"n_pulses = 1 must be >= 2"),
        ([0.1, 0.3, 0.2], r"pulse interval = -0.1 s must be > 0"),
        ([0.1, 0.3, 0.7, 0.9], r"ratio of pulse intervals = 2 at 0.3 s must be < 1.8"),
        ([0.1, 0.3, 0.31, 0.5], r"a pulse is missing or false"),
        ([0.4, 0.6, 0.8], r"without pulses at one end = 2 intervals"),
        ([0.5, 1.5], r"must lie in the record"),
    ],
)
def test_bad_pulses_are_refused(pulses, message):
    with pytest.raises(ValueError, match=message):
        order.shaft_phase(pulses, 1000, 1000.0)


def test_revolution_weights_are_whole():
    weights = order.revolution_weights(constant_speed(5.0371, 122_880))
    assert_allclose(weights.sum(), 24, rtol=1e-12)
    assert np.all(weights[-900:] == 0)
    with pytest.raises(ValueError, match=r"revolutions must be >= 1"):
        order.revolution_weights(np.linspace(0, 0.9, 50))


@pytest.mark.parametrize(("dtype", "atol"), [(np.float64, 1e-9), (np.float32, 2e-5)])
def test_orders_at_constant_speed_do_not_leak(dtype, atol):
    # 5120 samples a revolution: sums over whole revolutions vanish but for rounding. float32:
    # 1e-7 per sample and per product of up to ten.
    phase = constant_speed(5.0, 122_000)
    truth = np.zeros(10, complex)
    truth[[0, 1, 6]] = 1.0, 2j, 0.5 * np.exp(1.1j)
    x = 100 + sum(np.real(a * np.exp(2j * np.pi * k * phase)) for k, a in enumerate(truth, 1))
    x = np.stack((x, -2 * x)).astype(dtype)
    found = order.order_amplitudes(x, phase, range(1, 11))
    assert found.dtype == (np.complex64 if dtype == np.float32 else np.complex128)
    assert_allclose(found, [truth, -2 * truth], atol=atol * (40 if dtype == np.float32 else 1))
    assert_allclose(order.order_amplitudes(x, phase, [7, 2]), found[:, [6, 1]], atol=atol)


def ramp():
    """The published example: 600 Hz, 5 s, 10 to 40 rev/s, four orders."""
    t = np.arange(3000) / 600.0
    return lambda s: 10 * s + 3 * s**2, t, np.array([1, 0.5, np.sqrt(2), 2])


def test_orders_of_the_ramp_example():
    turns, t, orders = ramp()
    amplitudes = np.array([1, 0.5, np.sqrt(2), 2])
    x = (amplitudes[:, np.newaxis] * np.cos(2 * np.pi * np.outer(orders, turns(t)))).sum(axis=0)
    found = np.abs(order.order_amplitudes(x, turns(t), orders))
    # Leakage of order o: sum over the others of B / (pi R) (1 / |o - o'| + 1 / (o + o')), and of
    # its own mirror image, over R = 124 or 125 revolutions. Sampling 15 times in the fastest
    # revolution adds (2 pi 4 / 15)^2 / 24 = 0.1 of the last interval's share, which is nothing.
    gap = np.abs(orders[:, np.newaxis] - orders)
    spread = 1 / (orders[:, np.newaxis] + orders)
    spread += np.divide(1, gap, out=np.zeros_like(gap), where=gap > 0)
    bound = spread @ amplitudes / (np.pi * 124)
    assert bound.max() < 0.03
    assert np.all(np.abs(found - amplitudes) < bound)


def test_orders_of_the_ramp_example_through_a_tacho():
    turns, t, orders = ramp()
    amplitudes = np.array([1, 0.5, np.sqrt(2), 2])
    x = (amplitudes[:, np.newaxis] * np.cos(2 * np.pi * np.outer(orders, turns(t)))).sum(axis=0)
    edges = (np.arange(3001) - 0.5) / 600.0
    pulses = order.pulse_times(stepped(turns(edges), duty=0.2), 600.0)
    found = np.abs(order.order_amplitudes(x, order.shaft_phase(pulses, t.size, 600.0), orders))
    # Leakage as above (below 0.03), and pulses 0.086 sample off at 40 rev/s are 6e-3 rev, 0.07 rad
    # at order 2, which costs 0.07^2 / 2 = 0.3 % of its amplitude at the most.
    assert_allclose(found, amplitudes, atol=0.035)


def test_impossible_orders_are_refused():
    phase = constant_speed(5.0, 10_240, fs=1000.0)
    with pytest.raises(ValueError, match=r"must be one row, > 0 and < 100"):
        order.order_amplitudes(np.ones(10_240), phase, [1, 100.5])
    with pytest.raises(ValueError, match=r"phase has \(10240,\) samples"):
        order.order_amplitudes(np.ones(10), phase, [1])


@pytest.mark.parametrize("angle_deg", [0.0, 5.0, 94.9, 180.1, 355.0])
@pytest.mark.parametrize("speed", [5.0, 4.25, 5.75])
def test_impulse_appears_at_its_angle(angle_deg, speed):
    # Through the tacho, as in use: one impulse a revolution at the given crank angle.
    n = 122_880
    edges = 0.3 + speed * (np.arange(n + 1) - 0.5) / FS
    phase = order.shaft_phase(order.pulse_times(stepped(edges), FS), n, FS)
    x = np.zeros(n, np.float32)
    turn = np.arange(1, 27) + angle_deg / 360
    where = np.rint((turn - 0.3) / speed * FS).astype(int)
    x[where[(where >= 0) & (where < n)]] = 10.0
    bins = spectrum.line_band_edges(FS, 256)
    profile = order.crank_angle_map(x, FS, phase, edges=bins).sum(axis=-1)
    centre = np.exp(2j * np.pi * (np.arange(36) + 0.5) / 36)
    found = np.degrees(np.angle(profile @ centre))
    # Frames 64 samples apart sample a symmetric window: 0.02 deg; the linear split of an
    # impulse over bins of 10 deg shifts its centroid by up to a quarter of a bin.
    assert abs((found - angle_deg + 180) % 360 - 180) < 2.5
    own = int(angle_deg // 10)
    if 2 < angle_deg % 10 < 8:
        assert np.argmax(profile) == own
    # sin^4 holds 99.9 % within 0.41 of the window: 4.1 ms is 8.5 deg at 5.75 rev/s.
    assert profile[np.arange(own - 1, own + 2) % 36].sum() > 0.985 * profile.sum()


def test_map_holds_the_mean_square():
    rng = np.random.default_rng(0)
    phase = constant_speed(5.0, 122_880)
    x = rng.standard_normal((2, 122_880))
    edges = spectrum.line_band_edges(FS, 256)
    energy = order.crank_angle_map(x, FS, phase, edges=edges)
    assert energy.shape == (2, 36, 20)
    expected = np.diff(edges) / (FS / 2)
    # White noise in the narrowest band, 100 Hz: 2 B T = 960 degrees of freedom, 4.6 %; 3.5 of it
    # over 40 values. All bands have 90 times that: 0.5 %.
    assert_allclose(energy.mean(axis=1), np.tile(expected, (2, 1)), rtol=0.16)
    assert_allclose(energy.mean(axis=1).sum(axis=1), expected.sum(), rtol=0.02)


def test_map_of_a_sine_is_flat_and_calibrated():
    phase = constant_speed(5.0, 122_880)
    x = 3 * np.sin(2 * np.pi * 1500 * np.arange(122_880) / FS)
    energy = order.crank_angle_map(x, FS, phase, edges=[950.0, 2050.0, 3050.0])
    # Five lines clear of the edges; Hann's side lobes there are 1e-5 in power.
    assert_allclose(energy[:, 0], 4.5, rtol=1e-4)
    assert np.all(energy[:, 1] < 1e-4)


@pytest.mark.parametrize("speed", [0.9, 5.0, 25.0, 90.0])
def test_no_bin_is_empty_at_any_speed(speed):
    # 25 rev/s puts exactly sixteen frames in every revolution, always at the same angles.
    phase = constant_speed(speed, 122_880)
    energy = order.mean_over_angle(
        np.ones((1917, 1)), order.frame_boundaries(phase, 1917, nperseg=256, hop=64), angle_bins=36
    )
    # A weighted mean of ones.
    assert_allclose(energy, 1.0, rtol=1e-9)


def test_mean_over_angle_follows_changing_speed():
    # Energy is 1 in the first half of each turn and 3 in the second, at any speed.
    turns = np.cumsum(np.repeat([0.05, 0.1, 0.05, 0.1], [20, 10, 40, 20]))
    turns = np.concatenate(([0.0], turns)) + 0.5
    middle = (turns[1:] + turns[:-1]) / 2 % 1
    energy = np.where(middle < 0.5, 1.0, 3.0)[:, np.newaxis]
    found = order.mean_over_angle(energy, turns, angle_bins=2)
    # Frame boundaries fall on the bin edges, so nothing mixes.
    assert_allclose(found, [[1.0], [3.0]], rtol=1e-9)


def test_short_time_energy_keeps_float32_and_parseval():
    x = np.random.default_rng(4).standard_normal(5000)
    edges = [0.0, FS / 2]
    energy = order.short_time_energy(x.astype(np.float32), FS, edges=edges, nperseg=256, hop=64)
    window = spectrum.hann(256) ** 2
    y = x - x.mean()
    expected = np.convolve(y**2, window[::-1], "valid")[::64] / window.sum()
    assert energy.dtype == np.float32
    assert energy.shape == (75, 1)
    # An identity; float32 sums of 256 squares.
    assert_allclose(energy[:, 0], expected, rtol=5e-6)


def test_map_faults_are_named():
    x, phase = np.ones(2000), constant_speed(5.0, 2000)
    with pytest.raises(ValueError, match=r"frames span .* revolutions, must span"):
        order.crank_angle_map(x, FS, phase, edges=[150, 3000])
    with pytest.raises(ValueError, match=r"hop = 128 samples must be >= 1 and <= nperseg / 3"):
        order.crank_angle_map(x, FS, phase, edges=[150, 3000], hop=128)
    with pytest.raises(ValueError, match=r"nperseg = 4096 samples"):
        order.crank_angle_map(x, FS, phase, edges=[150, 3000], nperseg=4096)


def test_angle_harmonics_are_the_coefficients_and_ignore_gain():
    angle = 2 * np.pi * (np.arange(36) + 0.5) / 36
    level = 7 + 2 * np.cos(angle) - 3 * np.sin(2 * angle) + 0.5 * np.cos(3 * angle + 0.2)
    expected = [[2, 0], [0, -3], [0.5 * np.cos(0.2), -0.5 * np.sin(0.2)]]
    # Orthogonal on 36 equal steps: rounding of the logarithm.
    assert_allclose(order.angle_harmonics(10 ** (level / 10)), expected, atol=1e-12)
    assert_allclose(order.angle_harmonics(50 * 10 ** (level / 10)), expected, atol=1e-12)
    with pytest.raises(ValueError, match=r"n_harmonics = 18"):
        order.angle_harmonics(level, n_harmonics=18)


def test_dead_centre_levels():
    profile = np.zeros(36)
    profile[1] = 36.0
    # One bin of 10 deg, 10 to 20, holds everything: inside both 40 deg windows at 0, so 9 times.
    silent = -200.0
    found = order.dead_centre_levels(profile)
    assert_allclose(found[0], 10 * np.log10(9), rtol=1e-12)
    assert_allclose(found[1], silent, rtol=1e-12)
    # From -10 to 0 only the window round the dead centre sees it; 190 to 200 belongs to 180.
    profile = np.roll(profile, -2)
    assert_allclose(order.dead_centre_levels(profile)[0], [10 * np.log10(9), silent], rtol=1e-12)
    assert_allclose(order.dead_centre_levels(np.roll(profile, 20))[1], 10 * np.log10(9), rtol=1e-12)


def test_window_cuts_bins_in_proportion():
    profile = np.array([4.0, 0.0, 0.0, 0.0])
    # 80 of 100 deg: bin 0 whole or in part.
    assert_allclose(order.angle_window_level(profile, 10, 110), 10 * np.log10(3.2), rtol=1e-12)
    with pytest.raises(ValueError, match=r"window = 30 … 10 deg"):
        order.angle_window_level(profile, 30, 10)


def test_angle_kurtosis():
    profile = np.zeros(36)
    assert order.angle_kurtosis(profile + 2) == 0
    profile[5] = 1.0
    p = 1 / 36
    # Two-point distribution.
    assert_allclose(order.angle_kurtosis(profile), (1 - 3 * p * (1 - p)) / (p * (1 - p)), rtol=1e-9)


def test_impacts_are_counted():
    rng = np.random.default_rng(7)
    n = 122_880
    phase = constant_speed(5.0, n)
    x = rng.standard_normal(n)
    ring = np.exp(-np.arange(200) / 40) * np.sin(2 * np.pi * 3000 * np.arange(200) / FS)
    # Two knocks a revolution, 40 standard deviations high.
    for start in (np.arange(0.05, 4.7, 0.1) * FS).astype(int):
        x[start : start + 200] += 40 * ring
    energy = order.short_time_energy(x, FS, edges=[150, 11_500], nperseg=256, hop=64)[:, 0]
    boundaries = order.frame_boundaries(phase, energy.size, nperseg=256, hop=64)
    span = boundaries[-1] - boundaries[0]
    # A count: exact.
    assert_allclose(order.impacts_per_revolution(energy, boundaries) * span, 47, rtol=1e-12)
    still = order.impacts_per_revolution(np.ones_like(energy), boundaries)
    assert_array_equal(still, 0.0)
    with pytest.raises(ValueError, match=r"threshold = 1 medians must be > 1"):
        order.impacts_per_revolution(energy, boundaries, threshold=1)
