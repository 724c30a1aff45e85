"""Speed of envelope features. Results are asserted, times and ratios are only printed."""

import time

import numpy as np
import pytest
from wearstate.features.signal.cyclic_coherence import cyclic_coherence
from wearstate.features.signal.envelope import envelope_spectrum, fault_line
from wearstate.features.signal.kurtogram import kurtogram, spectral_kurtosis

FS = 25_600.0
N = 120_000
RATE, RESONANCE = 80.0, 6000.0


def record(n=N, dtype=np.float64):
    """A resonance struck 80 times a second, in noise."""
    after = np.arange(n) / FS % (1 / RATE)
    ring = np.exp(-1000 * after) * np.sin(2 * np.pi * RESONANCE * after)
    return (ring + 0.1 * np.random.default_rng(0).standard_normal(n)).astype(dtype)


def show(benchmark, what):
    if benchmark.enabled:
        print(f"\n{what}: {1e3 * benchmark.stats.stats.median:.1f} ms")


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n", [N // 4, N, 4 * N])
def test_speed_of_a_kurtogram(benchmark, n, dtype):
    found = benchmark(kurtogram, record(n, dtype), FS, levels=7)
    show(benchmark, f"kurtogram of {n} samples, {np.dtype(dtype).name}")
    assert abs(found.centre - RESONANCE) < found.bandwidth


def test_speed_of_an_envelope_spectrum(benchmark):
    frequency, amplitude = benchmark(envelope_spectrum, record(), FS, (5000.0, 7000.0))
    show(benchmark, "squared envelope spectrum of one band")
    assert fault_line(frequency, amplitude, 81.0).frequency == pytest.approx(RATE, abs=0.05)


def test_speed_of_spectral_kurtosis(benchmark):
    frequency, found = benchmark(spectral_kurtosis, record(), FS)
    show(benchmark, "spectral kurtosis")
    assert abs(frequency[np.argmax(found)] - RESONANCE) < 500


def test_speed_of_cyclic_coherence(benchmark):
    _, found = benchmark(cyclic_coherence, record(), FS, [RATE, 1.07 * RATE])
    show(benchmark, "cyclic coherence at two cyclic frequencies")
    assert found[0].mean() > 10 * found[1].mean()


def seconds(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def test_speed_against_a_published_kurtogram(benchmark, monkeypatch):
    """openconmo, alternating with ours; the median ratio of eleven pairs."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    published = pytest.importorskip("openconmo.kurtogram").fast_kurtogram
    wave = record()
    found = benchmark.pedantic(kurtogram, (wave, FS), {"levels": 7}, rounds=1)
    *_, centre, width = published(wave.copy(), FS, nlevel=7)
    assert abs(found.centre - centre) <= max(found.bandwidth, width) / 2
    if benchmark.enabled:
        pairs = [
            (
                seconds(lambda: published(wave.copy(), FS, nlevel=7)),
                seconds(lambda: kurtogram(wave, FS, levels=7)),
            )
            for _ in range(11)
        ]
        theirs, ours = np.array(pairs).T
        print(
            f"\nkurtogram, {N} samples, level 7: ours {1e3 * np.median(ours):.1f} ms, openconmo "
            f"{1e3 * np.median(theirs):.1f} ms, ratio {np.median(theirs / ours):.1f}"
        )
