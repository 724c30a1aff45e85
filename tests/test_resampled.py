"""Recordings at a higher rate, and tachos at any: by closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured.data_set import import_recordings
from wearstate.datasets.measured.recording import read_recording
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source import resampled_tacho
from wearstate.datasets.source.part import SourceOptions
from wearstate.features.rotation.order import pulse_times
from wearstate.sim.output.recording import DataError

FS = 4000.0


@pytest.mark.parametrize("to", [8000.0, 6000.0, 10_000.0, 4321.0 * 4])
def test_a_tone_keeps_its_samples_at_a_higher_rate(tmp_path, to):
    n = 8000
    np.save(tmp_path / "x.npy", np.sin(2 * np.pi * 700.0 * np.arange(n) / FS)[None])
    options = SourceOptions(fs=FS, unit="m/s^2", resample_to=to)
    with open_source(tmp_path / "x.npy", options) as source:
        whole = source.read()[0]
        piece = source.read(3001, 3502)[0]
        assert source.conditions == {"sample_rate_in_file_hz": FS, "bandwidth_hz": 1800.0}
    wanted = np.sin(2 * np.pi * 700.0 * np.arange(len(whole)) / to)
    # the filter's ripple of 80 dB; its length fades the ends, by 64 samples of the file
    assert np.abs(whole - wanted)[400:-400].max() < 2e-4
    assert_allclose(piece, whole[3001:3502], atol=1e-12)  # rounding


def test_a_raised_rate_adds_no_band(tmp_path):
    np.save(tmp_path / "x.npy", np.random.default_rng(1).standard_normal((1, 40_000)))
    options = SourceOptions(fs=FS, unit="m/s^2", resample_to=4 * FS)
    with open_source(tmp_path / "x.npy", options) as source:
        signal = source.read()[0]
    power = np.abs(np.fft.rfft(signal * np.hanning(len(signal)))) ** 2
    hz = np.linspace(0, 2 * FS, len(power))
    # white noise fills half its rate; beyond it stand images, 80 dB down
    assert power[hz > FS / 2 * 1.001].sum() < 1e-7 * power.sum()


def train(turns, fs, n, duty=0.1):
    """Pulses averaged over a sample, as a converter with a filter shows them [V]."""
    time = np.arange(8 * n) / (8 * fs)
    return 5.0 * (np.mod(turns(time), 1.0) < duty).reshape(n, 8).mean(axis=1)


def sweep(time):
    return 11.3 * time + 2.1 * time**2 + 0.37


@pytest.mark.parametrize("to", [2000.0, 3000.0, 10_000.0, 25_600.0])
@pytest.mark.parametrize("duty", [0.02, 0.5, 0.98])
def test_a_tacho_keeps_the_times_of_its_edges(tmp_path, to, duty, monkeypatch):
    monkeypatch.setattr(resampled_tacho, "_PIECE", 777)  # edges on either side of a seam
    volts = train(sweep, FS, 20_000, duty)
    wave = np.sin(2 * np.pi * 300.0 * np.arange(len(volts)) / FS)
    np.save(tmp_path / "x.npy", np.stack([wave, volts]))
    options = SourceOptions(fs=FS, unit="g", channels=("acc", "key"), resample_to=to)
    made = read_recording(tmp_path / "x.npy", options, tacho="key")
    before, after = pulse_times(volts, FS), pulse_times(made.tacho_signal, to)
    assert_allclose(after, before[-len(after) :], atol=1e-3 / to)  # of float32
    assert len(before) - len(after) <= 1  # one may begin within a sample of the start
    assert made.tacho_signal.min() == 0.0
    assert made.tacho_signal.max() == 5.0


@pytest.mark.parametrize("to", [2500.0, 10_000.0])
def test_a_logic_level_leaves_the_samples_of_the_file_behind(tmp_path, to, monkeypatch):
    """Each edge is 0.29 samples off in the file, and a resampled one is no logic level any more."""
    monkeypatch.setattr(resampled_tacho, "_PIECE", 777)
    time = np.arange(20_000) / FS
    volts = 5.0 * (np.mod(sweep(time), 1.0) < 0.1)
    np.save(tmp_path / "x.npy", np.stack([np.ones_like(volts), volts]))
    options = SourceOptions(fs=FS, unit="g", channels=("acc", "key"), resample_to=to)
    made = read_recording(tmp_path / "x.npy", options, tacho="key")
    before, after = pulse_times(volts, FS), pulse_times(made.tacho_signal, to)
    assert_allclose(after, before[-len(after) :], atol=1e-3 / to)  # of float32
    off = [
        np.std((sweep(times) - np.round(sweep(times))) / (11.3 + 4.2 * times) * FS)
        for times in (after, pulse_times(made.tacho_signal, to, level=2.5))
    ]
    assert max(off) < 0.2  # samples of the file; 0.163 found, 0.291 by the crossings alone


def test_a_tacho_is_the_same_in_pieces_and_of_records(tmp_path):
    volts = train(sweep, FS, 20_000)
    np.save(tmp_path / "x.npy", np.stack([np.ones_like(volts), volts]))
    options = SourceOptions(fs=FS, unit="g", channels=("acc", "key"), resample_to=10_000.0)
    import_recordings(
        [tmp_path / "x.npy"], tmp_path / "o.h5", options=options, tacho="key", segment=1.0
    )
    whole = read_recording(tmp_path / "x.npy", options, tacho="key").tacho_signal
    with DataSet(tmp_path / "o.h5") as data:
        pieces = np.concatenate([data[i].tacho_signal for i in range(len(data))])
        speeds = data.manifest["mean_speed_hz"].to_numpy()
    assert_array_equal(pieces, whole[: len(pieces)])
    middles = np.arange(len(speeds)) + 0.5
    # of whole revolutions, so up to one off the middle of the record
    assert_allclose(speeds, 11.3 + 4.2 * middles, atol=0.4)


def test_pulses_too_fast_for_the_rate_are_refused(tmp_path):
    volts = train(lambda time: 400.0 * time, FS, 4000, duty=0.5)
    np.save(tmp_path / "x.npy", np.stack([np.ones_like(volts), volts]))
    options = SourceOptions(fs=FS, unit="g", channels=("acc", "key"), resample_to=1000.0)
    with pytest.raises(DataError, match=r"2\.\d+ samples apart .* must be >= 6; choose a higher"):
        read_recording(tmp_path / "x.npy", options, tacho="key")


@pytest.mark.parametrize("volts", [np.zeros(500), np.r_[np.zeros(250), np.full(250, 5.0)]])
def test_a_tacho_without_pulses_stays_without(tmp_path, volts):
    np.save(tmp_path / "x.npy", np.stack([np.ones(500), volts]))
    options = SourceOptions(fs=FS, unit="g", channels=("acc", "key"), resample_to=8000.0)
    found = read_recording(tmp_path / "x.npy", options, tacho="key").tacho_signal
    assert (found[0], found[-1]) == (volts[0], volts[-1])
