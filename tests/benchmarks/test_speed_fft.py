"""Speed of the Fourier transforms and of the features of time and spectrum."""

import numpy as np
import pytest
from wearstate.features.signal import fft, iso, spectral_shape, spectrum, statistics
from wearstate.features.signal.cepstrum import harmonic_spacing

FS = 25_600.0


def record(noise=1.0):
    """One second of three channels: a few tones in noise."""
    t = np.arange(25_600) / FS
    x = noise * np.random.default_rng(0).standard_normal((3, t.size))
    return (x + np.sin(2 * np.pi * 50 * t) + np.sin(2 * np.pi * 1234 * t)).astype(np.float32)


@pytest.mark.parametrize("engine", ["scipy", "fftw"])
@pytest.mark.parametrize("shape", [(600, 256), (3, 8192), (12, 8192), (3, 25_600), (1, 122_880)])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_speed_of_rfft(benchmark, engine, shape, dtype):
    x = np.random.default_rng(0).standard_normal(shape).astype(dtype)
    y = benchmark(fft.transform, "rfft", x, engine=engine)
    assert np.allclose(y[..., 0], x.sum(axis=-1, dtype=float), atol=1e-2)  # float32 sums


@pytest.mark.parametrize("engine", ["scipy", "fftw"])
@pytest.mark.parametrize("dtype", ["complex64", "complex128"])
def test_speed_of_ifft(benchmark, engine, dtype):
    x = np.zeros((3, 25_600), dtype)
    x[:, 1] = 25_600
    y = benchmark(fft.transform, "ifft", x, engine=engine)
    assert np.allclose(np.abs(y), 1, atol=1e-5)


def test_speed_of_the_time_features(benchmark):
    def row(x):
        shape = statistics.Amplitude(x)
        names = (
            "rms", "peak", "peak_to_peak", "crest_factor", "shape_factor", "impulse_factor",
            "clearance_factor", "k_factor", "kurtosis", "skewness", "zero_crossings", "entropy",
        )  # fmt: skip
        return np.stack([getattr(shape, name) for name in names])

    values = benchmark(row, record())
    # Noise of 1 rms and two tones of 1: sqrt 2, to a percent of scatter.
    assert np.allclose(values[0], np.sqrt(2), rtol=0.02)


def test_speed_of_the_spectrum_features(benchmark):
    def row(x):
        lines = spectrum.power_lines(x, FS)
        return (
            spectral_shape.spectral_centroid(lines, FS),
            spectral_shape.spectral_spread(lines, FS),
            spectral_shape.spectral_entropy(lines),
            spectral_shape.spectral_flatness(lines),
            spectral_shape.noise_floor(lines, FS, n_averages=4.9),
        )

    floor = benchmark(row, record())[-1]
    assert np.allclose(floor, 2 / FS, rtol=0.2)  # 4096 lines of five averages: 1 %, tones 5 %


@pytest.mark.parametrize(
    "function",
    [
        lambda x: spectrum.amplitude_spectrum(x, FS)[1][..., 1234],
        lambda x: spectrum.strongest_tone(x, FS, band=(1000.0, 2000.0))[1],
        lambda x: iso.velocity_rms(x, FS) * np.sqrt(2) * 100 * np.pi,
    ],
    ids=["amplitude", "tone", "velocity"],
)
def test_speed_of_calibrated_amplitudes(benchmark, function):
    # Every one reads the amplitude of 1 of a tone, in noise that adds a few percent.
    assert np.allclose(benchmark(function, record(noise=0.05)), 1, rtol=0.2)


def test_speed_of_the_cepstrum(benchmark):
    x = record()
    x[:, ::256] += 20  # clicks at 100 Hz
    spacing, _ = benchmark(harmonic_spacing, x, FS, low=60.0, high=140.0)
    assert np.allclose(spacing, 100, rtol=0.002)
