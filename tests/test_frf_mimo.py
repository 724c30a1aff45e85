"""Several forces at once: known functions, noise, forces that are not independent, one force."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.features.response import frf
from wearstate.features.response.mimo import multiple_h1

FS = 1024.0
GAINS = np.array([[2.0, -1.0], [0.5, 3.0]])


def records(seed, mixing=0.0, noise=0.0, n=100_000):
    """Two forces of which the second repeats a share of the first, through gains and a delay."""
    rng = np.random.default_rng(seed)
    force = rng.standard_normal((2, n))
    force[1] += mixing * force[0]
    response = GAINS @ np.roll(force, 1, axis=-1) + noise * rng.standard_normal((2, n))
    return force, response


def expected(frequency):
    return GAINS[..., np.newaxis] * np.exp(-2j * np.pi * frequency / FS)


def test_every_force_gets_its_own_function():
    found = multiple_h1(*records(0, mixing=1.0, noise=0.5), FS, nperseg=128)
    error = found.value / expected(found.frequency) - 1
    # 1560 blocks: a function scatters by 0.5 / sqrt(1500) / (0.5 or more) sqrt(condition 6) at
    # worst, 6 %; the mean over 63 lines by 0.8 %, and one sample in 128 is lost to the delay.
    assert np.max(np.abs(np.mean(error, axis=-1))) < 0.03
    # Coherences among forces of 1 and 1 + 1: rho^2 = 1/2, (1 + rho) / (1 - rho) = 5.83.
    assert_allclose(np.mean(found.condition), 5.83, rtol=0.03)
    # One force at a time takes the other's part for its own.
    force, response = records(0, mixing=1.0, noise=0.5)
    alone = frf.welch_spectra(force[0], response, FS, nperseg=128)
    assert np.all(np.abs(frf.h1(alone)[:, 1:-1] / expected(found.frequency)[:, 0] - 1) > 0.2)


def test_multiple_coherence_of_noise():
    found = multiple_h1(*records(1, mixing=1.0, noise=1.0), FS, nperseg=128)
    # Powers of the signals: |g1 + g2|^2 + g2^2, and 1 of noise; 1560 averages scatter by 0.05 or
    # less a line, 63 lines.
    power = (GAINS[:, 0] + GAINS[:, 1]) ** 2 + GAINS[:, 1] ** 2
    assert_allclose(np.mean(found.coherence, axis=-1), power / (power + 1), atol=0.01)
    silent = multiple_h1(records(2)[0], np.zeros(100_000), FS, nperseg=128)
    assert np.all(silent.coherence == 0)


def test_one_force_is_the_ordinary_h1():
    force, response = records(3, noise=1.0, n=4096)
    found = multiple_h1(force[:1], response, FS, nperseg=128)
    spectra = frf.welch_spectra(force[0], response, FS, nperseg=128)
    kept = slice(1, -1)
    assert_allclose(found.frequency, spectra.frequency[kept], rtol=1e-12)
    # The same arithmetic in another order.
    assert_allclose(found.value[:, 0], frf.h1(spectra)[:, kept], rtol=1e-10)
    assert_allclose(found.coherence, frf.coherence(spectra)[:, kept], rtol=1e-10)
    assert_allclose(found.averages, spectra.averages)
    assert_allclose(found.condition, 1.0)


def test_order_and_units_of_the_forces():
    force, response = records(4, mixing=0.5, noise=1.0, n=8192)
    found = multiple_h1(force, response, FS, nperseg=127)
    units = np.array([[1e9], [1e-6]])
    other = multiple_h1((force * units)[::-1], response, FS, nperseg=127)
    # Scaled to one before they are inverted: rounding alone.
    assert_allclose(other.value[:, ::-1] * units, found.value, rtol=1e-9)
    assert_allclose(other.condition, found.condition, rtol=1e-9)
    # An odd block has no line at half the sample rate: 1 … 63.
    assert_allclose(found.frequency, np.arange(1, 64) * FS / 127)


FORCE, RESPONSE = records(5, n=1024)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: multiple_h1(FORCE[0], RESPONSE, FS, nperseg=64), r"must be \(n_forces, n_samples"),
        (lambda: multiple_h1(FORCE, RESPONSE[:, 1:], FS, nperseg=64), "channels of one record"),
        (
            lambda: multiple_h1(FORCE * np.nan, RESPONSE * np.inf, FS, nperseg=64),
            "force has 2048 non-finite samples.*response has 2048",
        ),
        (lambda: multiple_h1(FORCE, RESPONSE, 0.0, nperseg=64), "fs = 0.0 Hz must be >= 0.001"),
        (lambda: multiple_h1(FORCE, RESPONSE, FS, nperseg=64, overlap=1), "overlap = 1 must be"),
        (lambda: multiple_h1(FORCE, RESPONSE, FS, nperseg=2000), "nperseg = 2000 samples must"),
        (lambda: multiple_h1(FORCE, RESPONSE, FS, nperseg=700), "averages = 1 must be > n_forces"),
        (
            lambda: multiple_h1(FORCE * [[1], [0]], RESPONSE, FS, nperseg=64),
            "force = 0 at 31 lines",
        ),
        (lambda: multiple_h1(FORCE[[0, 0]], RESPONSE, FS, nperseg=64), "by independent noise"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
