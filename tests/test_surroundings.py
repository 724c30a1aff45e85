"""Other machines in a recording: a steady tone, and knocks at a rate that is not the shaft's."""

import re
from dataclasses import replace

import numpy as np
import pytest
from wearstate.diagnose.familiarity.noise_floor import swing_of_turn
from wearstate.diagnose.recording_faults.surroundings import company_faults
from wearstate.diagnose.wear_model.file import load_model
from wearstate.features.rotation.other_rate import NO_OTHER_RATE, other_rate
from wearstate.features.signal.steady_tone import SILENT, steady_tone
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene

FS = 10_000.0
TIME = np.arange(60_000) / FS
RNG = np.random.default_rng(2)


def ringing(rate: float, hz: float, decay: float = 200.0) -> np.ndarray:
    """Blows at a rate, each of which sets one mode ringing."""
    since = (TIME * rate) % 1 / rate
    return np.exp(-decay * since) * np.sin(2 * np.pi * hz * since)


def knocks(rate: float, seed: int) -> np.ndarray:
    """Blows at a rate in all bands."""
    rng = np.random.default_rng(seed)
    return np.exp(-300 * ((TIME * rate) % 1) / rate) * rng.standard_normal(TIME.size)


# --- a tone


@pytest.mark.parametrize("hz", [233.0, 575.3, 1010.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_tone_among_blows_and_noise_is_found_with_its_frequency_and_size(hz, seed):
    noise = 0.3 * np.random.default_rng(seed).standard_normal(TIME.size)
    found = steady_tone(
        20 * ringing(5.0, 390.0) + noise + 1.5 * np.cos(2 * np.pi * hz * TIME), FS, low_hz=170.0
    )
    assert found.frequency_hz == pytest.approx(hz, abs=0.2)  # the record lasts six seconds
    assert found.amplitude == pytest.approx(1.5, rel=0.1)
    assert found.scatter < 0.5


@pytest.mark.parametrize("seed", range(5))
def test_blows_noise_and_hum_are_no_tone(seed):
    rng = np.random.default_rng(seed)
    blows = 20 * ringing(5.0, 390.0, decay=60.0)
    noise = rng.standard_normal(TIME.size)
    hum = 2 * np.cos(2 * np.pi * 250 * TIME)
    for signal in (blows + 0.1 * noise, noise, blows + 0.1 * noise + hum):
        assert steady_tone(signal, FS, low_hz=170.0).scatter > 0.7


def test_the_lowest_frequency_is_kept_and_its_value_refused():
    tone = np.cos(2 * np.pi * 140 * TIME)
    assert steady_tone(tone, FS, low_hz=100.0).frequency_hz == pytest.approx(140, abs=0.2)
    found = steady_tone(tone + 0.01 * RNG.standard_normal(TIME.size), FS, low_hz=300.0)
    assert found.frequency_hz > 300.0
    with pytest.raises(ValueError, match=re.escape("low_hz = 0 Hz")):
        steady_tone(tone, FS, low_hz=0)


@pytest.mark.parametrize(
    ("samples", "fs"), [(0, FS), (1, FS), (900, FS), (60_000, 200.0), (60_000, 20.0)]
)
def test_too_short_slow_or_silent_signals_have_none(samples, fs):
    assert steady_tone(np.zeros(samples, np.float32), fs, low_hz=170.0) == SILENT


# --- another rate


@pytest.mark.parametrize("ratio", [0.62, 0.93, 1.17, 1.44, 1.7])
def test_softer_knocks_at_another_rate_are_found_with_it(ratio):
    own, noise = knocks(5.0, 1), 0.01 * RNG.standard_normal(TIME.size)
    marks = np.arange(0.05, 6.0, 0.2)
    heard = other_rate([own + 0.1 * knocks(5.0 * ratio, 3) + noise], FS, marks)
    assert heard.rate_hz == pytest.approx(5.0 * ratio, rel=0.01)
    assert heard.evidence > 6
    assert other_rate([own + noise], FS, marks).evidence < 3


def test_the_own_rate_and_its_simple_ratios_are_left_out():
    own, noise = knocks(5.0, 1), 0.01 * RNG.standard_normal(TIME.size)
    marks = np.arange(0.05, 6.0, 0.2)
    for ratio in (1.0, 1.5):
        found = other_rate([own + 0.1 * np.roll(knocks(5.0 * ratio, 3), 700) + noise], FS, marks)
        assert abs(found.rate_hz / 5.0 - ratio) > 0.005


@pytest.mark.parametrize("turns", [0, 1, 5])
def test_few_turns_tell_no_rate(turns):
    assert other_rate(np.ones((2, 9000)), FS, np.arange(turns) * 0.2) == NO_OTHER_RATE


def test_a_fast_shaft_has_fewer_multiples_and_no_false_rate():
    noise = np.random.default_rng(0).standard_normal((2, 60_000))
    for speed in (8.0, 20.0, 90.0):
        assert other_rate(noise, FS, np.arange(0, 6, 1 / speed)).evidence < 3.5


# --- cautions of a pump


def pump(**changes):
    """A worn pump as recorded."""
    worn = {"joint.crankpin.diametral_clearance": 2.5e-4}
    return simulate(load_scene("bilge-pump", worn | changes), seed=4)


@pytest.fixture(scope="module")
def clean():
    return pump()


@pytest.fixture(scope="module")
def neighbour():
    return pump(**{"drive.speed": 5.9, "sensors.0.noise": 0.0, "sensors.1.noise": 0.0})


def with_more(recording, more):
    """A recording with more in its vibration."""
    signal = recording.signal.copy()
    rows = [i for i, name in enumerate(recording.names) if name != recording.tacho]
    signal[rows] += more
    return replace(recording, signal=signal)


def meshing(recording, order, size):
    """A gear mesh at an order of 300 rpm, with side bands of a turn."""
    turns = 5.0 * np.arange(recording.signal.shape[1]) / recording.sample_rate
    swing = 1 + 0.2 * np.cos(2 * np.pi * turns)
    return with_more(recording, (size * swing * np.cos(2 * np.pi * order * turns)).astype("f4"))


def beside(clean, neighbour, db):
    """Heard so much softer than the pump itself [dB]."""
    own, other = clean.vibration, neighbour.vibration
    gain = 10 ** (db / 20) * own.std(axis=1) / other.std(axis=1)
    return with_more(clean, gain[:, None] * other)


def test_a_pump_alone_has_no_company(clean):
    assert company_faults(clean) == ()


@pytest.mark.parametrize("order", [61, 115.4])
def test_a_gear_mesh_is_a_caution_that_names_its_order(clean, order):
    [fault] = company_faults(meshing(clean, order, 2.0))
    assert (fault.kind, fault.bars) == ("tone", False)
    assert f"order {order:.1f} of the shaft" in fault.text


def test_a_tone_that_is_little_of_its_channel_is_none(clean):
    mesh = meshing(clean, 115, 2.0)
    slow = 120 * np.sin(2 * np.pi * 30 * np.arange(mesh.signal.shape[1]) / mesh.sample_rate)
    assert company_faults(with_more(mesh, slow.astype("f4"))) == ()


@pytest.mark.parametrize("db", [-10, -20])
def test_a_pump_near_by_is_a_caution_that_names_its_rate(clean, neighbour, db):
    [fault] = company_faults(beside(clean, neighbour, db))
    assert (fault.kind, fault.channel, fault.bars) == ("knocks", "", False)
    assert "something knocks 5.9 times a second, 1.18 times per turn" in fault.text


def test_company_needs_a_tacho_that_turns(clean):
    assert company_faults(replace(clean, tacho=None)) == ()


def test_a_verdict_beside_another_pump_is_one_with_caution(small_model, clean, neighbour):
    model = load_model(small_model)
    assert swing_of_turn(model.names, np.array(model.card.healthy_features.mean)) > 20
    said = [
        [text for text in model.estimate(each).cautions if "something knocks" in text]
        for each in (clean, beside(clean, neighbour, -20))
    ]
    assert [len(texts) for texts in said] == [0, 1]
