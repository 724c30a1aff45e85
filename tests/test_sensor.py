"""Accelerometer, converter and tacho."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.sim.sensor import digitise, tacho_pulses


def clean(x, **changes):
    options = {"gain": 1.0, "noise": 0.0, "full_scale": 100.0, "bits": 24, **changes}
    return digitise(np.asarray(x, dtype=float), rng=np.random.default_rng(7), **options)


def test_gain():
    x = np.linspace(-50, 50, 1001)
    signal, clipped = clean(x, gain=1.05)
    # half a step of 24 bits over +-100 is 6e-6; float32 of 50 rounds by 2e-6
    assert_allclose(signal, 1.05 * x, atol=8e-6)
    assert signal.dtype == np.float32
    assert clipped == 0


def test_noise_has_its_rms_and_is_white():
    noise, _ = clean(np.zeros(200_000), noise=0.3)
    # rms of n Gaussian samples: 1 / sqrt(2 n) = 0.16 %; four of them
    assert_allclose(noise.std(), 0.3, rtol=0.0064)
    # mean: 1 / sqrt(n); autocorrelation of white noise: the same
    assert abs(noise.mean()) < 4 * 0.3 / np.sqrt(200_000)
    correlation = np.mean(noise[1:] * noise[:-1]) / noise.var()
    assert abs(correlation) < 4 / np.sqrt(200_000)


def test_noise_is_added_after_the_gain():
    quiet, _ = clean(np.zeros(1000), noise=0.3)
    loud, _ = clean(np.zeros(1000), noise=0.3, gain=5.0)
    assert_array_equal(quiet, loud)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_quantisation_step(bits):
    x = np.random.default_rng(0).uniform(-90, 90, 50_000)
    signal, _ = clean(x, bits=bits)
    step = 200.0 / 2**bits
    in_steps = signal / step
    assert_allclose(in_steps, np.round(in_steps), atol=1e-2)  # float32 of 2^15 steps: 2e-3
    error = signal - x
    assert abs(error).max() <= step / 2 * 1.01
    # uniform over a step; rms of 50,000 samples to 0.5 %
    assert_allclose(error.std(), step / np.sqrt(12), rtol=0.02)


def test_clipping_is_counted():
    signal, clipped = clean([-150.0, -100.0, 0.0, 100.0, 100.1, 1e9])
    assert clipped == 3  # full scale itself is not clipped
    assert_allclose(signal, [-100, -100, 0, 100, 100, 100], rtol=1e-6)


def test_clipping_sees_gain_and_noise():
    assert clean([60.0], gain=2.0)[1] == 1
    assert clean(np.zeros(1000), noise=1000.0)[1] > 800


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30),
    st.integers(8, 32),
    st.floats(1e-3, 1e4),
)
def test_nothing_leaves_the_range(values, bits, full_scale):
    signal, clipped = clean(values, bits=bits, full_scale=full_scale)
    assert np.all(np.isfinite(signal))
    assert abs(signal).max() <= full_scale * (1 + 1e-6)
    assert clipped == sum(abs(v) > full_scale for v in values)


# --- the tacho


def interpolated_edges(pulses, level):
    """Rising edges in samples, from the one or two samples that a box-filtered edge touches.

    A sample holds the mean over the interval that ends at it: an edge inside the interval before
    sample k leaves it at the fraction of the interval that lies behind the edge.
    """
    share = pulses / level
    rising = np.flatnonzero((share[:-2] == 0) & (share[2:] == 1)) + 1
    return rising - share[rising]


@pytest.mark.parametrize("speed", [4.25, 5.0, 5.75, 83.3])
def test_edges_interpolate_to_the_true_crossing(speed):
    fs, start = 25_600.0, -0.37
    n = 60_000
    revolutions = start + speed / fs * np.arange(n)
    pulses = tacho_pulses(revolutions, pulse_width=10 / 360, level=5.0)
    edges = interpolated_edges(pulses.astype(float), 5.0)
    truth = (np.arange(0, revolutions[-1]) - start) * fs / speed
    truth = truth[(truth > 1) & (truth < n - 2)]
    # An edge just at a sample may show as share 0 or 1 there; none is lost all the same.
    assert len(edges) >= len(truth) - 1
    nearest = truth[np.argmin(abs(truth[None, :] - edges[:, None]), axis=1)]
    # float32 of the level: 6e-8 of a sample. float64 angles of 1e3 turns over 2e-4 turns a
    # sample: 1e-13 / 2e-4 = 1e-9 of one.
    assert_allclose(edges, nearest, rtol=0, atol=1e-6)


def test_pulse_has_its_width_and_level():
    revolutions = np.arange(100_000) * 1e-4
    pulses = tacho_pulses(revolutions, pulse_width=0.1, level=5.0)
    assert pulses.dtype == np.float32
    assert set(np.unique(pulses[(revolutions % 1 > 0.001) & (revolutions % 1 < 0.099)])) == {5.0}
    assert set(np.unique(pulses[(revolutions % 1 > 0.101) & (revolutions % 1 < 0.999)])) == {0.0}
    assert_allclose(pulses.mean(), 0.5, rtol=2e-4)  # ten whole turns, one sample more or less


def test_tacho_of_a_changing_speed():
    time = np.arange(40_000) / 25_600.0
    revolutions = 5.0 * time + 0.5 * time**2 + 0.2  # run-up
    pulses = tacho_pulses(revolutions, pulse_width=0.1, level=1.0).astype(float)
    edges = interpolated_edges(pulses, 1.0)
    truth = (-5.0 + np.sqrt(25.0 + 2.0 * (np.arange(1, 20) - 0.2))) * 25_600.0
    # Within one sample the angle is taken as linear: acceleration * dt^2 / 8 over speed * dt,
    # that is 1e-6 of a sample.
    assert_allclose(edges, truth[: len(edges)], rtol=0, atol=2e-6)
    assert len(edges) >= 8
