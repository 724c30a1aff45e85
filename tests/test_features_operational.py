"""Transmissibilities and deflection shapes against paths that are known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import signal
from wearstate.features.catalogue.row import feature_row
from wearstate.features.response import operational
from wearstate.features.signal import spectrum

FS = 2048.0
EDGES = np.array([50.0, 100.0, 200.0, 400.0, 800.0])
LENGTH = 1 << 16


def resonance(x, frequency, damping):
    """Response of one mode, by its exact impulse response."""
    turn = np.exp(2 * np.pi * frequency / FS * complex(-damping, np.sqrt(1 - damping**2)))
    return signal.lfilter([turn.imag], [1, -2 * turn.real, abs(turn) ** 2], x)


@pytest.fixture(scope="module")
def paths():
    """Two modes that answer to the same source, and the square of their ratio at each line."""
    source = np.random.default_rng(0).standard_normal(LENGTH)
    both = np.stack([resonance(source, f, 0.1) for f in (160.0, 400.0)])
    impulse = np.zeros(LENGTH)
    impulse[0] = 1
    first, second = (np.abs(np.fft.rfft(resonance(impulse, f, 0.1))) ** 2 for f in (160.0, 400.0))
    weights = spectrum.line_weights(LENGTH, FS, EDGES)
    return source, both, first @ weights, second @ weights


def test_the_source_drops_out(paths):
    _, both, first, second = paths
    level, coherence = operational.transmissibility(both, FS, EDGES)
    # 255 blocks, some tens of lines a band: 0.1 dB; leakage at a resonance of 32 Hz: less
    assert_allclose(level, 10 * np.log10(first / second)[None], atol=0.15)
    assert np.all(coherence > 0.98)  # what leaks into lines of 4 Hz
    coloured = signal.lfilter([1], [1, -0.9], both)
    flat = operational.transmissibility(coloured, FS, np.array([50.0, 55.0, 60.0]))[0]
    narrow = operational.transmissibility(both, FS, np.array([50.0, 55.0, 60.0]))[0]
    assert_allclose(flat, narrow, atol=0.1)  # within a narrow band the source's colour is nothing


def test_noise_of_the_response_lowers_the_coherence_alone(paths):
    _, both, *_ = paths
    clean, _ = operational.transmissibility(both, FS, EDGES)
    noise = np.random.default_rng(1).standard_normal(LENGTH) * both[0].std()
    level, coherence = operational.transmissibility([both[0] + noise, both[1]], FS, EDGES)
    weights = spectrum.line_weights(8192, FS, EDGES)
    own, added = (spectrum.power_lines(x, FS, nperseg=8192) @ weights for x in (both[0], noise))
    assert_allclose(coherence[0], own / (own + added), atol=0.02)
    strong = own > added
    assert strong.sum() >= 2
    assert_allclose(level[0, strong], clean[0, strong], atol=0.3)


def test_strangers_share_no_more_than_chance():
    both = np.random.default_rng(2).standard_normal((2, LENGTH))
    _, coherence = operational.transmissibility(both, FS, EDGES)
    blocks = 2 * LENGTH / spectrum.default_nperseg(FS, LENGTH) - 1
    assert_allclose(coherence, 1.0 / (0.947 * blocks), rtol=0.5)  # Hann, half overlapped


def test_pairs_are_in_the_order_of_their_names():
    rng = np.random.default_rng(3)
    one = rng.standard_normal(LENGTH)
    three = one * np.array([[1.0], [10.0], [1000.0]])
    level, _ = operational.transmissibility(three, FS, EDGES)
    assert_allclose(level.mean(axis=1), [-20, -60, -40], atol=1e-6)
    names, values = feature_row(three, FS, channel_names=["a", "b", "c"], only=["transmissibility"])
    assert names[0].startswith("a_over_b.transmissibility.band_50_")
    by_pair = dict(zip(names, values, strict=True))
    assert [v for n, v in by_pair.items() if n.startswith("a_over_c") and "level" in n] == (
        pytest.approx([-60.0] * 20)
    )


def test_a_silent_channel_has_a_value():
    x = np.zeros((2, 4096))
    x[0] = np.random.default_rng(4).standard_normal(4096)
    level, coherence = operational.transmissibility(x, FS, EDGES)
    assert np.all(level == -200)
    assert np.all(coherence == 0)
    assert np.all(operational.deflection_shape(np.zeros((2, 3)))[..., 0] == -200)


def test_shape_of_a_shaft_that_bends():
    turns = 10.3 * np.arange(8192) / FS  # rev
    x = np.stack([3 * np.cos(2 * np.pi * turns + 0.5), 0.3 * np.cos(2 * np.pi * turns - 0.2)])
    tacho = (turns % 1 < 0.3) * 5.0
    names, values = feature_row(
        x, FS, tacho=tacho, channel_names=["a", "b"], only=["deflection_shape"]
    )
    found = dict(zip(names, values, strict=True))
    assert found["a_over_b.deflection.order_01.ratio_db"] == pytest.approx(20, abs=0.01)
    assert found["a_over_b.deflection.order_01.phase_cos"] == pytest.approx(np.cos(0.7), abs=1e-3)
    assert found["a_over_b.deflection.order_01.phase_sin"] == pytest.approx(np.sin(0.7), abs=1e-3)
