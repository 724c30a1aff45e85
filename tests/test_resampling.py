"""Recordings at other sample rates than a model's."""

from dataclasses import replace

import numpy as np
import pytest
from wearstate.diagnose.feature_rows.resampling import at_rate
from wearstate.diagnose.healthy_reference.healthy import baseline_of
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel
from wearstate.sim.scene.load import load_scene


def tone(rate, frequency=3000.0, seconds=0.2):
    time = np.arange(round(rate * seconds)) / rate
    turns = (time * 5.0) % 1.0
    signal = np.stack([np.sin(2 * np.pi * frequency * time), np.where(turns < 0.1, 5.0, 0.0)])
    channels = (
        Channel(name="acc", unit="m/s^2", quantity="acceleration"),
        Channel(name="tacho", unit="V", quantity="voltage"),
    )
    return Recording(signal=signal, sample_rate=rate, channels=channels, tacho="tacho")


@pytest.mark.parametrize("rate", [51_200.0, 48_000.0, 44_100.0, 102_400.0, 25_600.0 * np.pi])
def test_a_tone_and_the_tacho_keep_their_shape(rate):
    slow, wanted = at_rate(tone(rate), 25_600.0), tone(25_600.0)
    assert slow.sample_rate == 25_600.0
    inner = slice(200, wanted.signal.shape[1] - 200)
    np.testing.assert_allclose(slow.signal[0, inner], wanted.signal[0, inner], atol=0.01)
    edges = [np.flatnonzero(np.diff(each.signal[1] > 2.5)) for each in (slow, wanted)]
    assert np.abs(edges[0] - edges[1]).max() <= 1


def test_what_the_lower_rate_cannot_hold_is_filtered_out():
    slow = at_rate(tone(51_200.0, frequency=20_000.0), 25_600.0)
    assert np.abs(slow.signal[0, 200:-200]).max() < 1e-3  # else it would come back at 5.6 kHz


def test_slower_ones_stay_as_they_are():
    for rate in (20_000.0, 25_600.0):
        fast = tone(rate)
        assert at_rate(fast, 25_600.0) is fast


def test_a_model_reads_a_faster_recording_as_its_own(small_trained):
    model, _, _ = small_trained
    own, fast, slow = (
        simulate(load_scene("bilge-pump", {"sample_rate": rate}), seed=3)
        for rate in ("25.6 kHz", "48 kHz", "20 kHz")
    )
    said = model.estimate(fast)
    assert said.graded
    assert said.severity == pytest.approx(model.estimate(own).severity, rel=0.05)
    [reason] = model.estimate(slow).reasons
    assert "sampled at 20000 Hz, the model needs 25600 Hz: record faster" in reason


def test_healthy_recordings_may_be_faster_as_well(small_trained):
    card = small_trained[0].card
    own, fast = (
        baseline_of([simulate(load_scene("bilge-pump", {"sample_rate": rate}), seed=3)], card)
        for rate in ("25.6 kHz", "51.2 kHz")
    )
    levels = [i for i, name in enumerate(card.features) if name.endswith(".rms")]
    np.testing.assert_allclose(fast.features[levels], own.features[levels], rtol=0.02)


def test_a_rate_that_is_stated_twice_too_high_is_still_found(small_trained):
    model, _, _ = small_trained
    own = simulate(load_scene("bilge-pump"), seed=3)
    said = model.estimate(replace(own, sample_rate=51_200.0))
    assert said.verdict == "unusable"
    assert "fit a sample rate of 25600 Hz, 0.5 times the stated 51200 Hz" in said.reasons[0]
