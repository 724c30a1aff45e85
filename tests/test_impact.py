"""Impact tests: recognised, cut and analysed by one rule."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.features.catalogue import analysis
from wearstate.features.catalogue import row as table
from wearstate.features.response import frf, impact
from wearstate.sim.output.sensor import Channel

from .command_line import run

FS, N = 2048.0, 8192
POLES = ((100.0, 0.002), (300.0, 0.001))
PULSE = np.array([30.0, 80.0, 80.0, 30.0])
KINDS = ("force", "displacement")


def record(hits, *, n=N, noise=0.0, strengths=None):
    """Force and displacement of a structure with two modes, struck at some samples."""
    force = np.zeros(n)
    for at, strength in zip(hits, strengths or [1.0] * len(hits), strict=True):
        force[at : at + 4] += strength * PULSE[: n - at]
    t = np.arange(n) / FS
    ring = sum(
        np.exp(-z * 2 * np.pi * f * t) * np.sin(2 * np.pi * f * np.sqrt(1 - z * z) * t)
        for f, z in POLES
    )
    motion = np.convolve(force, ring)[:n]
    scatter = noise * np.random.default_rng(0).standard_normal((2, n))
    return np.stack([force, motion]) + scatter * [[1.0], [np.std(motion)]]


def row(signals, **about):
    settings = analysis.Settings(n_modes=2, **about)
    names, values = table.feature_row(
        signals, FS, quantities=KINDS, settings=settings, feature_set="complete"
    )
    return dict(zip(names, values.tolist(), strict=True))


def test_what_is_a_hammer_and_what_is_not():
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(N)
    burst = noise * (np.arange(N) % 1024 < 40)
    assert impact.is_impact(record([500])[0])
    assert impact.is_impact(-record([500, 4000], noise=0.1)[0] + 3.0)
    for other in (noise, np.sin(np.arange(N) / 9), burst, np.zeros(N)):
        assert not impact.is_impact(other)


@pytest.mark.parametrize(("samples", "hammer"), [(40, True), (99, True), (150, False)])
def test_one_blow_may_take_a_fifth_of_its_record(samples, hammer):
    """A soft tip in a record that was cut short; what does not end in it is no blow."""
    blow = np.zeros(500)
    blow[20 : 20 + samples] = np.sin(np.pi * np.arange(samples) / samples) + 0.1
    assert impact.is_impact(blow) is hammer
    assert impact.is_impact(blow + 0.01 * np.random.default_rng(0).standard_normal(500)) is hammer
    assert not impact.is_impact(np.arange(500) >= 500 - samples if samples > 40 else np.ones(9))
    assert not impact.is_impact(np.concatenate([blow, blow, blow]))


def test_a_blow_that_is_a_sixteenth_of_its_record_is_analysed_as_a_blow():
    """As of a random force the record would be too short for any transfer function."""
    half_sine = np.sin(np.pi * np.arange(1, 25) / 25)
    struck, answer = (np.convolve(half_sine, each)[:400] for each in record([0]))
    found = row(np.stack([struck, answer]), exponential=0.05)
    assert np.isnan(found["ch_1.frf.coherence"])
    assert all(np.isfinite(value) for name, value in found.items() if ".frf.band" in name)


def test_blocks_of_several_blows():
    found = impact.find_impacts(record([1, 2000, 4000, 6000])[0], FS)
    assert found.blows.starts.tolist() == [0, 1996, 3996, 5996]  # the first without its pretrigger
    assert found.text == "4 blows"
    # a double hit and a last blow near the end shorten nobody
    found = impact.find_impacts(record([10, 2000, 4000, 4300, 6000, 8100])[0], FS)
    assert found.blows.nperseg > 1700
    assert found.text == "3 blows, 2 left out"
    cut = record([2000, 4000, 6000])[0][2002:]
    assert impact.find_impacts(cut, FS).text == "2 blows, 1 left out"


@pytest.mark.parametrize(("last", "within"), [(1.0, 5e-3), (0.1, 1e-4), (0.01, 1e-4)])
def test_one_blow_has_modes_and_no_coherence(last, within):
    found = row(record([100]), exponential=last)
    for i, (frequency, ratio) in enumerate(POLES, start=1):
        assert found[f"frf.mode_{i}.frequency_hz"] == pytest.approx(frequency, rel=1e-5)
        # the pretrigger turns the cut-off tail a little; the window takes it away, and its damping
        # is out of the result
        assert found[f"frf.mode_{i}.damping_ratio"] == pytest.approx(ratio, rel=within)
    assert np.isnan(found["ch_1.frf.coherence"])
    assert np.isnan(found["ch_1.frf.random_error"])
    undefined = [name for name, value in found.items() if not np.isfinite(value)]
    assert undefined == ["ch_1.frf.coherence", "ch_1.frf.random_error"]


def test_several_blows_have_a_coherence():
    hits = [100, 2100, 4100, 6100]
    quiet, noisy = (row(record(hits, noise=noise)) for noise in (0.0, 0.3))
    assert 1 >= quiet["ch_1.frf.coherence"] > noisy["ch_1.frf.coherence"] > 0
    assert quiet["ch_1.frf.random_error"] < noisy["ch_1.frf.random_error"]


def test_the_only_blow_is_analysed_whatever_is_wrong_with_it():
    cut = record([500])[:, 502:]
    spectra, found = impact.impact_spectra(cut[0], cut[1:], FS)
    assert found.blows.starts.tolist() == [0]
    assert "begins within the blow, at 100 % of its peak" in found.text
    assert "coherence, random error and confidence are not defined" in found.text
    assert spectra.blocks == 1
    twice = record([500, 520])
    assert "hits 2 times" in impact.impact_spectra(twice[0], twice[1:], FS)[1].text
    with pytest.raises(ValueError, match="connect the force cell"):
        impact.find_impacts(np.zeros(100), FS)


@pytest.mark.parametrize("ms", [60, 170, 340])
def test_a_blow_is_analysed_however_short_the_record(ms):
    """Half a second of Welch's blocks are asked for of other forces only."""
    n = round(ms * FS / 1000)
    signals = record([20], n=n)
    found = row(signals, exponential=0.05)
    assert all(np.isfinite(value) for name, value in found.items() if ".frf.band" in name)
    assert sum(".frf.band" in name for name in found) == 10
    text = impact.find_impacts(signals[0], FS, signals[1:], last=0.05).text
    assert ("resolve" in text) == (ms < 80)
    assert "still at" not in text
    noise = np.random.default_rng(0).standard_normal((2, n))
    if ms < 340:
        with pytest.raises(ValueError, match=r"duration = .* s must be >= "):
            table.feature_row(noise, FS, quantities=KINDS, only=["frf_levels"])


def test_what_a_cut_response_costs_is_told():
    """At 100 Hz and a ratio of 0.002 the ring falls by e in 0.8 s."""
    short, long = record([20], n=400), record([20], n=2 * N)
    told = impact.find_impacts(short[0], FS, short[1:])
    assert "the response is still at 80% of its loudest" in told.text
    assert "leaks over all lines; record longer, or lower --exponential" in told.text
    assert "still at" not in impact.find_impacts(long[0], FS, long[1:]).text
    plain, windowed, true = (row(short), row(short, exponential=0.05), row(long))
    beside = [f"ch_1.frf.band_{b}.level_db" for b in ("60_84", "116_156", "212_284", "380_508")]
    off = [max(abs(found[name] - true[name]) for name in beside) for found in (plain, windowed)]
    # beside the modes the cut leaks, and the window takes it away; on them it adds its damping
    assert off[0] > 5 > 1 > off[1]


def test_short_blocks_are_filled_and_agree():
    signals = record([100])
    plain, _ = impact.impact_spectra(signals[0], signals[1:], FS, last=0.01)
    filled, _ = impact.impact_spectra(signals[0], signals[1:], FS, last=0.01, least=2 * N)
    # nothing is left at the end of the block: the lines between are interpolated
    long = frf.h1(filled.between(50, 500))[0]
    at = np.interp(plain.between(50, 500).frequency, filled.between(50, 500).frequency, abs(long))
    assert_allclose(at, abs(frf.h1(plain.between(50, 500))[0]), rtol=0.02)


def test_command_line_and_picture_tell_the_same(tmp_path):
    channels = (
        Channel(name="hammer", unit="N", quantity="force"),
        Channel(name="probe", unit="m", quantity="displacement"),
    )
    head = Attributes(sample_rate=FS, channels=channels, origin="measured", tacho=None)
    path, out = tmp_path / "d.h5", tmp_path / "t.csv"
    with DataSetWriter(path, head, n_records=1, n_samples=N) as writer:
        writer.write(0, 1e-6 * record([0]) * [[1e6], [1.0]], {"record_id": "0", "status": "ok"})
        writer.finish()
    done = run("features", path, "-o", out, "--only", "modes,frf_quality", "--exponential", 0.1)
    assert "1 records: impact test, 1 blow, H1 of the whole block: coherence" in done.stderr
    frame = pd.read_csv(out)
    assert frame["probe.frf.coherence"].isna().all()
    assert "frf.mode_1.frequency_hz" in frame
    run("info", path, "--kind", "frf", "--plot", tmp_path / "p.svg", "--exponential", 0.1)
    refused = run("features", path, "-o", out, "--force", "--exponential", 0, code=2)
    assert "--exponential" in refused.stderr


def test_published_impact_by_the_command_line(realdata, tmp_path):
    """One frame of a measured test against the function that its analyser stored."""
    file = realdata / "vibrationtesting_frf_MIT" / "case1.mat"
    if not file.is_file():
        pytest.skip("the measured impact is not here")
    from scipy.io import loadmat

    stored = loadmat(file)
    data, out = tmp_path / "d.h5", tmp_path / "t.csv"
    names = ("--variable", "Time_chan_1", "--variable", "Time_chan_2")
    units = ("--fs", 1280, "--unit", "Time_chan_1=N", "--unit", "m/s^2", "--segment", "whole")
    run("import", file, *names, *units, "-o", data)
    done = run("features", data, "-o", out, "--only", "modes,frf_quality,frf_levels")
    assert "the record begins within the blow, at 53 % of its peak" in done.stderr
    frame = pd.read_csv(out)
    modes = frame[[f"frf.mode_{i}.frequency_hz" for i in (1, 2, 3)]].to_numpy()[0]
    nearest = modes[np.argmin(np.abs(modes - 212.0925))]
    assert nearest == pytest.approx(212.092530551, abs=0.02)  # of the package that ships the file
    assert frame["Time_chan_2.frf.coherence"].isna().all()
    rows = stored["Time_chan_1"].ravel(), stored["Time_chan_2"].T
    value = frf.h1(impact.impact_spectra(*rows, 1280.0)[0].between(205.0, 220.0))[0]
    kept = (stored["Freq_domain"].ravel() >= 205) & (stored["Freq_domain"].ravel() <= 220)
    # On every line the stored function is smaller by the root of two, 1.41 to 1.42. It is the
    # stored cross spectrum over the stored spectrum of the force, so that the factor is in one of
    # these; nothing in the file explains it.
    function = np.sqrt(2) * np.abs(stored["Hf_chan_2"].ravel())
    published = function[kept]
    error = np.linalg.norm(np.abs(value) - published) / np.linalg.norm(published)
    assert error < 0.024
    # the same by the table: the bands that hold the modes; of 2.4 % it is 0.2 dB
    for low, high in ((165, 215), (215, 275)):
        inside = (stored["Freq_domain"].ravel() >= low) & (stored["Freq_domain"].ravel() < high)
        level = frame[f"Time_chan_2.frf.band_{low}_{high}.level_db"][0]
        assert level == pytest.approx(10 * np.log10(np.mean(function[inside] ** 2)), abs=0.1)
