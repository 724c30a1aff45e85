"""Hum of the mains: told from a shaft's own lines, and a caution where it is loud."""

import math

import numpy as np
import pytest
from wearstate.diagnose.recording_faults.surroundings import MOST_HUM, hum_faults
from wearstate.features.signal.hum import hum_power
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel, coloured_noise, mains_hum

FS = 5000.0
TIME = np.arange(25_000) / FS


def hum(frequency: float, rms: float = 1.0) -> np.ndarray:
    rng = np.random.default_rng(1)
    return mains_hum(TIME.size, FS, rms=rms, frequency=frequency, rng=rng)


def shaft(speed: float, orders: int = 40) -> np.ndarray:
    return sum(np.cos(math.tau * k * speed * TIME + k * k) for k in range(1, orders))


def recording(x: np.ndarray, speed: float) -> Recording:
    tacho = np.where((speed * TIME) % 1.0 < 0.1, 5.0, 0.0)
    channels = (
        Channel(name="acc", unit="m/s^2", quantity="acceleration"),
        Channel(name="tacho", unit="V", quantity="voltage"),
    )
    return Recording(
        signal=np.stack([x, tacho]).astype(np.float32),
        sample_rate=FS,
        channels=channels,
        tacho="tacho",
    )


@pytest.mark.parametrize("mains", [50.0, 60.0])
@pytest.mark.parametrize("speed", [3.1, 7.3, 5.0])
def test_power_of_hum_is_found_among_the_lines_of_a_shaft(mains: float, speed: float) -> None:
    noise = coloured_noise(TIME.size, FS, rms=1.0, slope=1.0, rng=np.random.default_rng(2))
    signal = 0.1 * shaft(speed) + noise + hum(mains, rms=2.0)
    assert hum_power(signal, FS, speed_hz=speed)[mains] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("mains", [50.03, 49.97])
def test_a_supply_may_be_a_little_off(mains: float) -> None:
    assert hum_power(hum(mains), FS, speed_hz=7.3)[50.0] == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("speed", [5.0, 10.0, 12.5, 25.0, 49.6, 50.0])
def test_lines_of_the_shaft_are_no_hum(speed: float) -> None:
    signal = shaft(speed) + 1e-3 * np.random.default_rng(0).standard_normal(TIME.size)
    share = hum_power(signal, FS, speed_hz=speed)[50.0] / signal.var()
    assert share < 0.01


@pytest.mark.parametrize(("speed", "order"), [(50.0, 1), (49.6, 1), (25.0, 2), (12.5, 4)])
def test_a_lone_order_where_hum_would_be_is_no_hum(speed: float, order: int) -> None:
    """An unbalance at 3000 rpm stands out as hum does."""
    noise = 0.1 * np.random.default_rng(0).standard_normal(TIME.size)
    signal = np.sin(math.tau * order * speed * TIME) + noise
    assert hum_power(signal, FS, speed_hz=speed)[50.0] < 0.01


def test_noise_and_blows_are_no_hum() -> None:
    blows = np.zeros(TIME.size)
    blows[:: int(FS / 7.3)] = 50.0
    assert hum_power(blows, FS, speed_hz=7.3)[50.0] < 0.01 * blows.var()
    noise = np.random.default_rng(0).standard_normal(TIME.size)
    assert hum_power(noise, FS, speed_hz=7.3)[50.0] < 0.01


@pytest.mark.parametrize("samples", [0, 1, 5, 40])
def test_a_few_samples_have_none(samples: int) -> None:
    assert hum_power(np.ones(samples), 48_000.0, speed_hz=50.0) == {50.0: 0.0, 60.0: 0.0}


def test_a_signal_too_short_to_tell_has_none() -> None:
    assert hum_power(hum(50.0)[:2000], FS, speed_hz=3.0) == {50.0: 0.0, 60.0: 0.0}


@pytest.mark.parametrize(("name", "value"), [("fs", 0.0), ("speed_hz", 0.0)])
def test_values_must_be_positive(name, value):
    values = {"fs": FS, "speed_hz": 5.0} | {name: value}
    with pytest.raises(ValueError, match=name):
        hum_power(TIME, values["fs"], speed_hz=values["speed_hz"])


def test_averaging_in_blocks_keeps_the_power():
    """Sixteen samples to a block at 25.6 kHz, and every harmonic counted."""
    fs = 25_600.0
    rng = np.random.default_rng(1)
    loud = mains_hum(122_880, fs, rms=2.0, frequency=60.0, rng=rng)
    assert hum_power(loud, fs, speed_hz=7.7)[60.0] == pytest.approx(4.0, rel=0.01)


def test_loud_hum_is_a_caution_that_bars_nothing_and_names_its_supply() -> None:
    noise = np.random.default_rng(3).standard_normal(TIME.size)
    quiet = hum(60.0, rms=math.sqrt(0.8 * MOST_HUM))
    assert hum_faults(recording(noise + quiet, 7.3)) == ()
    [fault] = hum_faults(recording(noise + hum(60.0, rms=math.sqrt(2 * MOST_HUM)), 7.3))
    assert (fault.kind, fault.channel, fault.bars) == ("hum", "acc", False)
    assert fault.text.startswith("9% of the mean square of channel acc is at multiples of 60 Hz")
