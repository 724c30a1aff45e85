"""Measured recordings of another machine: read rightly, and refused for their vibration."""

import json

import numpy as np
import pytest
from scipy.signal import resample_poly
from wearstate.datasets.measured.recording import read_recording
from wearstate.diagnose.command_line.report import report_exit
from wearstate.diagnose.wear_model.file import load_model
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel, tacho_pulses
from wearstate.sim.parts.units import STANDARD_GRAVITY

FILES = [
    *(f"InnerRaceFault_vload_{n}.mat" for n in (1, 3, 5, 7)),
    *(f"OuterRaceFault_vload_{n}.mat" for n in (1, 3, 5, 7)),
    "baseline_1.mat",
]


@pytest.fixture(scope="module")
def mfpt(realdata):
    folder = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0"
    if not folder.is_dir():
        pytest.skip("the bearing recordings are not here")
    return folder


@pytest.mark.parametrize("name", FILES)
def test_sample_rate_length_and_unit(mfpt, name):
    from scipy.io import loadmat

    recording = read_recording(mfpt / name)
    raw = loadmat(mfpt / name, simplify_cells=True)["bearing"]["gs"]
    rate, samples = (97656, 585936) if name.startswith("base") else (48828, 146484)
    assert (recording.sample_rate, recording.signal.shape) == (rate, (1, samples))
    assert recording.origin == "measured"
    assert recording.channels[0].unit == "m/s^2"
    # float32 keeps 24 bits: relative 6e-8, and the stored value is declared in g
    assert np.allclose(recording.signal[0], raw * STANDARD_GRAVITY, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", FILES)
def test_as_it_is_the_report_cannot_judge_it_and_says_what_it_lacks(mfpt, small_model, name):
    """One channel, no tacho: nothing of the machine can be said; the rate is high enough."""
    from click.testing import CliRunner
    from wearstate.diagnose.command_line.cli import cli

    arguments = ["report", str(mfpt / name), "--model", str(small_model), "--json"]
    done = CliRunner().invoke(cli, arguments)
    table = json.loads(done.stdout)
    assert table["estimate"]["verdict"] == "unusable"
    assert [fault["kind"] for fault in table["estimate"]["faults"]] == ["layout", "tacho"]
    assert "g" in table["recording"]["channels"][0]["unit_in_file"]
    assert done.exit_code == 2
    assert CliRunner().invoke(cli, [*arguments, "--fail-on", "alarm"]).exit_code == 2


def made_to_match(recording, speed):
    """The same vibration in the model's shape: rate, two channels, names, a tacho."""
    rate = 25600
    down = resample_poly(
        recording.signal[0].astype(float), rate // 4, int(recording.sample_rate) // 4
    )
    length = round(4.8 * rate)
    wave = np.tile(down, -(-length // len(down)))[:length]
    turns = np.arange(length) / rate * speed
    tacho = tacho_pulses(turns, pulse_width=1 / 36, level=5.0)
    channels = (
        Channel(name="acc_x", unit="m/s^2", quantity="acceleration"),
        Channel(name="acc_y", unit="m/s^2", quantity="acceleration"),
        Channel(name="tacho", unit="V", quantity="tacho"),
    )
    # a second place hears the same source a little later and weaker
    second = 0.8 * np.roll(wave, 7)
    return Recording(
        signal=np.stack([wave, second, tacho]),
        sample_rate=rate,
        channels=channels,
        tacho="tacho",
        source="matched",
    )


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("speed", [5.0, 25.0])  # the pump's, and the rig's own shaft speed
@pytest.mark.parametrize("level", [None, 14.0])  # as measured, and scaled to the pump's rms
def test_it_is_the_vibration_that_is_unfamiliar(mfpt, small_model, name, speed, level):
    model = load_model(small_model)
    matched = made_to_match(read_recording(mfpt / name), speed)
    if level is not None:
        signal = matched.signal.copy()
        signal[:2] *= level / signal[0].std()
        matched = Recording(
            signal=signal,
            sample_rate=matched.sample_rate,
            channels=matched.channels,
            tacho="tacho",
            source="matched",
        )
    estimate = model.estimate(matched)
    assert estimate.verdict == "unfamiliar"
    assert estimate.p_value is not None
    assert estimate.p_value <= model.p_limit <= 0.012
    assert report_exit([(estimate.verdict, estimate.grade)], "alarm") == 5
