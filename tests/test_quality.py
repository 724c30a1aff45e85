"""Faults of the data, named before anything is said of the machine."""

import math
import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from wearstate.datasets.file.record import DataSet
from wearstate.diagnose.nameplate.cautions import recording_context, untrained_wear
from wearstate.diagnose.recording_faults.layout import layout_faults
from wearstate.diagnose.recording_faults.levels import Levels, fit_levels, quiet_faults
from wearstate.diagnose.recording_faults.samples import sample_faults
from wearstate.diagnose.recording_faults.suspicions import Observation, suspicions
from wearstate.diagnose.wear_model.cautions import condition_cautions
from wearstate.diagnose.wear_model.file import load_model
from wearstate.features.rotation.order import pulse_times
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel, mains_hum

CAMPAIGN = runpy.run_path(str(Path(__file__).parent / "benchmarks" / "quality_faults.py"))
PLANTED = CAMPAIGN["PLANTED"]


@pytest.fixture(scope="module")
def model(small_model):
    return load_model(small_model)


@pytest.fixture(scope="module")
def familiar(model, small_set):
    """Held-out recordings that the model grades as they are."""
    seen = model.card.trained_on.training_groups
    with DataSet(small_set) as data:
        rows = np.flatnonzero(~data.manifest["group"].isin(seen).to_numpy())
        found = [data[int(row)] for row in rows[:8]]
    kept = [recording for recording in found if model.estimate(recording).graded]
    assert len(kept) >= 6
    return kept


def acceleration(signal, unit="m/s^2"):
    channels = tuple(
        Channel(name=f"acc_{i}", unit=unit, quantity="acceleration") for i in range(len(signal))
    )
    return Recording(signal=signal, sample_rate=1000.0, channels=channels)


# --- samples


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_tones_are_at_no_fault(seed):
    rng = np.random.default_rng(seed)
    wave = np.sin(2 * np.pi * rng.uniform(1, 400) * np.arange(5000) / 1000)
    assert sample_faults(acceleration(np.array([wave, rng.standard_normal(5000)]))) == ()


@pytest.mark.parametrize("seed", range(5))
def test_a_converter_of_eight_bits_is_not_saturated_by_being_coarse(seed):
    rng = np.random.default_rng(seed)
    noise = np.round(30 * rng.standard_normal(3000)) / 30
    tone = np.round(127 * np.sin(2 * np.pi * 13.7 * np.arange(3000) / 1000 + rng.random())) / 127
    assert sample_faults(acceleration(np.array([noise, tone]))) == ()


def test_clipped_blows_are_saturated_however_short():
    """Blows whose peaks last a sample or two, cut at six tenths."""
    rng = np.random.default_rng(0)
    ring = np.exp(-np.arange(40) / 8) * np.sin(2 * np.pi * 0.2 * np.arange(40))
    train = np.zeros(20_000)
    train[::500] = rng.uniform(0.7, 1.0, 40)
    blows = np.convolve(train, ring)[:20_000] + 0.01 * rng.standard_normal(20_000)
    assert sample_faults(acceleration(blows[None])) == ()
    [fault] = sample_faults(acceleration(blows.clip(-0.45, 0.45)[None]))
    assert fault.kind == "saturated"


def test_a_cut_through_a_crowd_of_peaks_is_seen():
    """Noise of a narrow band, cut where many of its peaks end a little lower or higher."""
    from scipy.signal import iirpeak, lfilter

    rng = np.random.default_rng(3)
    wave = lfilter(*iirpeak(300, 30, fs=1000), rng.standard_normal(20_000))
    end = 0.8 * np.abs(wave).max()
    assert sample_faults(acceleration(wave[None])) == ()
    cut = wave.clip(-end, end)
    # hardly more samples lie on the cut than just beside it, but there no two agree
    assert np.sum(np.abs(cut) == end) < 2 * np.sum(np.abs(cut) > 0.96 * end)
    [fault] = sample_faults(acceleration(cut[None]))
    assert fault.kind == "saturated"
    # the same through a converter of twelve bits
    step = 2 * np.abs(wave).max() / 4096
    assert sample_faults(acceleration(np.round(wave / step)[None] * step)) == ()
    [fault] = sample_faults(acceleration(np.round(cut / step)[None] * step))
    assert fault.kind == "saturated"


@pytest.mark.parametrize(("share", "bars"), [(0.5, True), (0.94, True), (0.96, False)])
def test_flat_tops_are_named_and_bar_a_verdict_from_a_tenth_on(share, bars):
    """A sine is below minus .94 and .96 of its peak for arccos / pi = .111 and .090 of the time."""
    wave = np.sin(2 * np.pi * 5 * np.arange(5000) / 1000)
    [fault] = sample_faults(acceleration(np.clip(wave, -share, 2)[None]))
    assert (fault.kind, fault.channel, fault.bars) == ("saturated", "acc_0", bars)
    assert f"{-share:g}" in fault.text


def blows_in_noise(size=20_000, noise=0.01):
    rng = np.random.default_rng(0)
    ring = np.exp(-np.arange(40) / 8) * np.sin(2 * np.pi * 0.2 * np.arange(40))
    train = np.zeros(size)
    train[::500] = rng.uniform(0.7, 1.0, size // 500)
    return np.convolve(train, ring)[:size] + noise * rng.standard_normal(size)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(("share", "bars"), [(0.01, False), (0.19, False), (0.21, True)])
def test_samples_that_were_lost_are_named_and_bar_a_verdict_from_a_fifth_on(share, bars, held):
    wave = blows_in_noise()
    assert sample_faults(acceleration(wave[None])) == ()
    lost = slice(7000, 7000 + round(share * wave.size))
    wave[lost] = wave[6999] if held else 0.0
    [fault] = sample_faults(acceleration(wave[None]))
    assert (fault.kind, fault.channel, fault.bars) == ("gap", "acc_0", bars)
    assert " from 7 s on: samples were lost" in fault.text or "from 6.999 s on" in fault.text


def test_blocks_that_were_lost_are_counted():
    wave = blows_in_noise()
    for start in (1000, 5000, 9000):
        wave[start : start + 256] = 0.0
    [fault] = sample_faults(acceleration(wave[None]))
    assert "stands still for 0.768 s, 0.038 of the recording" in fault.text
    assert "and 2 times more" in fault.text


def test_a_gap_of_a_probe_far_from_zero_is_no_saturation():
    """Zeros are the lowest that a probe a millimetre off its shaft says."""
    rng = np.random.default_rng(0)
    gap = 1e-3 + 5e-5 * rng.standard_normal(5000)
    gap[1000:1300] = 0.0
    assert [fault.kind for fault in sample_faults(acceleration(gap[None]))] == ["gap"]


def test_what_stands_still_by_itself_has_lost_nothing():
    """Between the blows of a coarse converter; a force between blows; a square wave."""
    coarse = np.round(20 * blows_in_noise(noise=1e-3)) / 20
    assert np.diff(np.flatnonzero(np.diff(coarse))).max() > 256
    assert sample_faults(acceleration(coarse[None])) == ()
    push = np.zeros(5000)
    push[::1000] = 1.0
    force = Channel(name="force", unit="N", quantity="force")
    hammer = Recording(signal=push[None], sample_rate=1000.0, channels=(force,))
    assert not any(fault.kind == "gap" for fault in sample_faults(hammer))
    square = np.sign(np.sin(2 * np.pi * 2 * np.arange(5000) / 1000 + 0.1))
    assert not any(fault.kind == "gap" for fault in sample_faults(acceleration(square[None])))


def test_one_sensor_in_two_channels_is_named():
    wave = np.random.default_rng(0).standard_normal(3000)
    [fault] = sample_faults(acceleration(np.array([wave, wave])))
    assert (fault.kind, fault.channel, fault.bars) == ("layout", "acc_0, acc_1", True)
    assert "hold the same samples" in fault.text
    dead = sample_faults(acceleration(np.zeros((2, 3000))))
    assert {fault.kind for fault in dead} == {"dead"}


def test_all_faults_are_named_at_once():
    wave = np.clip(np.sin(2 * np.pi * 5 * np.arange(5000) / 1000), -0.5, 0.5)
    found = sample_faults(acceleration(np.array([np.full(5000, 2.0), wave])))
    assert [(fault.kind, fault.channel) for fault in found] == [
        ("dead", "acc_0"),
        ("saturated", "acc_1"),
    ]


def test_a_graded_but_saturated_recording_says_so(model, familiar):
    recording = familiar[0]
    signal = recording.signal.copy()
    end = 0.8 * np.abs(signal[0]).max()
    signal[0] = signal[0].clip(-end, end)
    assert np.count_nonzero(np.abs(signal[0]) == end) >= 4
    estimate = model.estimate(replace(recording, signal=signal))
    assert estimate.verdict in ("caution", "unfamiliar")
    assert [fault.kind for fault in estimate.faults] == ["saturated"]


def test_a_graded_recording_with_a_gap_says_so(model, familiar):
    recording = familiar[0]
    signal = recording.signal.copy()
    signal[: len(recording.vibration_names), 5000:7000] = 0.0
    estimate = model.estimate(replace(recording, signal=signal))
    assert estimate.graded
    assert {fault.kind for fault in estimate.faults} == {"gap"}
    assert sum("samples were lost" in caution for caution in estimate.cautions) == 2


def test_a_refused_recording_names_what_may_be_why(model, familiar):
    """Without the highest samples, a twelfth, it is quieter than any machine; saturated, too."""
    recording = familiar[0]
    end = np.quantile(np.abs(recording.vibration), 11 / 12, axis=1).max()
    rows = len(recording.vibration_names)
    signal = recording.signal.copy()
    signal[:rows] = signal[:rows].clip(-end, end)  # of too few samples to bar a verdict
    estimate = model.estimate(replace(recording, signal=signal))
    assert estimate.verdict in ("unfamiliar", "unusable")
    assert [fault.kind for fault in estimate.faults if not fault.bars] == ["saturated"] * rows
    assert any("it is saturated" in reason for reason in estimate.reasons)


def test_a_verdict_under_loud_hum_is_one_with_caution(model, familiar):
    """At -13 dB it begins: nothing is said at -20 dB, and at -10 dB there is a caution."""

    def judged(db):
        recording = familiar[0]
        signal = recording.signal.astype(float)
        rng = np.random.default_rng(0)
        for i, name in enumerate(recording.names):
            if name != recording.tacho:
                rms = 10 ** (db / 20) * signal[i].std()
                signal[i] += mains_hum(
                    signal.shape[1], recording.sample_rate, rms=rms, frequency=60.0, rng=rng
                )
        return model.estimate(replace(recording, signal=signal.astype(np.float32)))

    assert not any("60 Hz" in caution for caution in judged(-20).cautions)
    loud = judged(-10)
    assert any(fault.kind == "hum" and not fault.bars for fault in loud.faults)
    assert loud.verdict == "caution"
    assert any("multiples of 60 Hz" in caution for caution in loud.cautions)


@pytest.mark.parametrize("late", [60, -90])
def test_a_mark_beside_the_dead_centre_is_named_with_its_angle(model, familiar, late):
    told = []
    for recording in familiar:
        assert not any(fault.kind == "tacho" for fault in model.estimate(recording).faults)
        tacho = recording.names.index(recording.tacho)
        signal = recording.signal.copy()
        turn = recording.sample_rate / recording.row["speed_hz"]
        signal[tacho] = np.roll(signal[tacho], round(late / 360 * turn))
        # what is rolled in breaks the train of pulses
        cut = slice(*(round(place * turn) for place in (0.3, signal.shape[1] / turn - 0.3)))
        found = model.estimate(replace(recording, signal=signal[:, cut]))
        told += [fault.text for fault in found.faults if fault.kind == "tacho" and fault.bars]
    # in bins of 10 degrees, and a knock comes the later the wider the clearance
    assert len(told) > len(familiar) / 2
    words = "late" if late > 0 else "early"
    degrees = [int(re.search(rf"about (\d+) degrees {words}", text)[1]) for text in told]
    assert degrees == pytest.approx([abs(late)] * len(told), abs=10)


def test_a_tacho_upside_down_is_named_as_that(model, familiar):
    told = []
    for recording in familiar[:4]:
        row = recording.names.index(recording.tacho)
        signal = recording.signal.copy()
        signal[row] = signal[row].max() - signal[row]
        found = model.estimate(replace(recording, signal=signal))
        told += [fault.text for fault in found.faults if fault.kind == "tacho"]
    assert told
    assert all("multiply the channel by -1: its pulses point down" in text for text in told)


def test_a_channel_that_is_the_tacho_but_not_named_as_it_is_said_so(model, familiar):
    recording = replace(familiar[0], tacho=None)
    found = model.estimate(recording)
    [fault] = found.faults
    assert (fault.kind, found.verdict) == ("tacho", "unusable")
    assert "its channel tacho is not named as its tacho; give --tacho tacho" in fault.text


def test_a_level_outside_the_trained_range_has_its_unit(model, familiar):
    units = {each.name: each.unit for each in model.card.conditions}
    assert (units["acc_x.rms"], units["shaft.speed_hz"]) == ("m/s^2", "Hz")
    row = np.zeros(len(model.names))
    told = condition_cautions(model.card, row, {})
    assert any("acc_x.rms = 0 m/s^2 is outside" in text for text in told)


def test_a_header_that_does_not_fit_is_named_whole(model, familiar):
    recording = familiar[0]
    wrong = replace(
        recording,
        sample_rate=recording.sample_rate / 2,
        channels=tuple(replace(c, unit="g") for c in recording.channels),
    )
    kinds = [fault.kind for fault in layout_faults(wrong, model.card)]
    assert kinds.count("rate") == 1
    assert kinds.count("unit") == 2


# --- planted in recordings


def test_familiar_recordings_are_at_no_fault(model, familiar):
    assert all(model.estimate(recording).faults == () for recording in familiar)


@pytest.mark.parametrize("name", PLANTED)
def test_planted_faults_are_named_and_no_other(model, familiar, name):
    """A sample of the campaign of tests/benchmarks/quality_faults.py, on a model of 90 records."""
    kind, plant = PLANTED[name]
    rng = np.random.default_rng(0)
    told = []
    for recording in familiar[:3]:
        estimate = model.estimate(plant(recording, rng))
        told.append({fault.kind for fault in estimate.faults} == {kind})
        if kind not in ("saturated", "swapped"):
            assert estimate.verdict in ("unusable", "unfamiliar")
            assert estimate.grade is None
        assert {fault.kind for fault in estimate.faults} <= {kind}
    # so small a model knows its machines poorly: one in three may be missed, none misnamed; 90
    # records do not tell the two channels of this pump apart, 1,500 do
    assert sum(told) >= (2 if kind != "swapped" else 0)


def a_look(*, distance=0.8, excess=0.0, speed=5.0, slow=2.5):
    return Observation(
        distance=distance,
        limit=1.4,
        free_distance=slow,
        excess_db={"acc_0": excess},
        speed_hz=speed,
    )


@pytest.fixture
def two_tones():
    n = np.arange(4000) / 1000
    return acceleration(np.array([np.sin(2 * np.pi * 40 * n), np.sin(2 * np.pi * 90 * n)]))


def sees(test):
    """A model to which a recording is familiar that passes a test."""
    return lambda recording: a_look(distance=0.8 if test(recording) else 2.5)


def test_a_suspicion_is_named_only_where_mending_helps(two_tones):
    first = two_tones.signal[0]

    def swapped_back(recording):
        return np.array_equal(recording.signal[1], first)

    [fault] = suspicions(two_tones, a_look(distance=2.5), sees(swapped_back), (4.0, 6.0))
    assert (fault.kind, fault.channel) == ("swapped", "acc_0, acc_1")
    assert suspicions(two_tones, a_look(distance=2.5), sees(lambda _: False), (4.0, 6.0)) == ()
    # nothing is tried on what is familiar
    assert suspicions(two_tones, a_look(), sees(swapped_back), (4.0, 6.0)) == ()


def test_swapped_channels_are_tried_on_what_is_hardly_familiar(two_tones):
    first = two_tones.signal[0]

    def nearer(distance):
        def look(recording):
            swapped_back = np.array_equal(recording.signal[1], first)
            return a_look(distance=distance if swapped_back else 1.3)

        return look

    [fault] = suspicions(two_tones, a_look(distance=1.3), nearer(0.8), (4.0, 6.0))
    assert fault.kind == "swapped"
    assert suspicions(two_tones, a_look(distance=1.3), nearer(1.1), (4.0, 6.0)) == ()
    assert suspicions(two_tones, a_look(distance=1.0), nearer(0.5), (4.0, 6.0)) == ()


def test_more_pulses_than_stated_are_named_with_their_number(two_tones):
    tacho = 5.0 * (np.arange(4000) % 100 < 10)  # 10 Hz
    key = Channel(name="key", unit="V", quantity="tacho")
    recording = replace(
        two_tones,
        signal=np.vstack([two_tones.signal, tacho]),
        channels=(*two_tones.channels, key),
        tacho="key",
    )

    def look(mended):
        pulses = pulse_times(mended.tacho_signal, mended.sample_rate)
        late = pulses[0] > 0.15  # of the two, the second is at the dead centre
        return a_look(distance=0.9 if late else 1.3, speed=1 / np.diff(pulses).mean())

    fast = a_look(distance=1.2, speed=10.0)
    [fault] = suspicions(recording, fast, look, (4.0, 6.0))
    assert fault.kind == "tacho"
    assert "10 Hz, 2 times the speed at which the recording is familiar" in fault.text
    # of another speed, stated already, or not much more familiar
    assert suspicions(recording, fast, look, (7.0, 8.0)) == ()
    stated = replace(recording, pulses_per_revolution=2)
    assert "tacho" not in {fault.kind for fault in suspicions(stated, fast, look, (4.0, 6.0))}
    hardly = suspicions(recording, fast, lambda _: a_look(distance=1.2), (4.0, 6.0))
    assert "tacho" not in {fault.kind for fault in hardly}


def test_a_rate_is_suspected_where_it_brings_the_speed_into_range(two_tones):
    lengths = []

    def look(recording):
        lengths.append(recording.signal.shape[1])
        return a_look()

    slow = a_look(distance=2.5, speed=2.5)
    both = replace(two_tones, tacho=None)
    [fault] = suspicions(both, a_look(distance=2.5, speed=5.0), look, (4.0, 6.0))
    assert fault.kind == "swapped"  # tried first, and it helps here
    [fault] = suspicions(both, slow, look, (4.0, 6.0))
    assert fault.kind == "rate"  # no cable changes the speed
    one = replace(two_tones, signal=two_tones.signal[:1], channels=two_tones.channels[:1])
    [fault] = suspicions(one, slow, look, (4.0, 6.0))
    assert (fault.kind, fault.factor) == ("rate", 2.0)
    assert lengths[-1] == 2000
    assert "2000 Hz" in fault.text
    # slower than stated: high bands are lost, what hangs on no rate decides
    fast = a_look(distance=2.5, speed=10.0)
    for slow, kinds in ((1.0, ["rate"]), (1.1, []), (1.9, []), (math.nan, [])):
        faults = suspicions(one, fast, lambda _, s=slow: a_look(distance=2.0, slow=s), (4.0, 6.0))
        assert [fault.kind for fault in faults] == kinds
    # in the same way where only the speed is strange: a journal at any rate looks like a journal
    near = a_look(distance=0.8, speed=10.0)
    [fault] = suspicions(one, near, lambda _: a_look(distance=2.0, slow=1.0), (4.0, 6.0))
    assert (fault.kind, fault.factor) == ("rate", 0.5)
    assert "run the machine within 4 to 6 Hz" in fault.text
    # 2.5 Hz times 2.56 would fit 6.4 Hz as well: the first that helps is named, none out of range
    assert suspicions(one, a_look(distance=2.5, speed=3.0), look, (100.0, 120.0)) == ()


def test_only_a_level_that_is_off_is_a_unit(two_tones):
    one = replace(two_tones, signal=two_tones.signal[:1], channels=two_tones.channels[:1])
    for excess, factor in ((20.0, 1 / 9.80665), (-60.0, 1000.0), (-20.0, 9.80665)):
        [fault] = suspicions(one, a_look(excess=excess), sees(lambda _: True), None)
        assert (fault.kind, fault.channel) == ("unit", "acc_0")
        assert fault.factor == pytest.approx(factor)
    # within the scatter of levels
    assert suspicions(one, a_look(excess=9.0), sees(lambda _: True), None) == ()
    # half-way to 9.81: as far off the other way
    assert suspicions(one, a_look(excess=-11.0), lambda _: a_look(excess=8.8), None) == ()
    # mending by the nearest factor does not bring the level back
    assert suspicions(one, a_look(excess=40.0), lambda _: a_look(excess=20.0), None) == ()


def test_a_wrong_unit_is_named_with_its_factor(model, familiar):
    for factor in (9.80665, 1 / 9.80665, 1000.0):
        _, plant = "unit", CAMPAIGN["scaled"](factor)
        faults = model.estimate(plant(familiar[0], None)).faults
        assert [fault.kind for fault in faults] == ["unit", "unit"]
        assert faults[0].factor == pytest.approx(1 / factor)


# --- levels


def levels_task():
    """Level follows the kurtosis and the speed; 0.5 dB of what nothing tells."""
    rng = np.random.default_rng(1)
    names = ("a.rms", "a.kurtosis", "shaft.speed_hz")
    shape, speed = rng.standard_normal(400), np.exp(0.1 * rng.standard_normal(400))
    level = 5 * shape + 40 * np.log10(speed) + 0.5 * rng.standard_normal(400)
    rows = np.column_stack([10 ** (level / 20), np.exp(shape), speed])
    folds = [(np.arange(200), np.arange(200, 400)), (np.arange(200, 400), np.arange(200))]
    return names, rows, folds


def test_the_level_to_be_expected_follows_shape_and_speed():
    names, rows, folds = levels_task()
    levels = fit_levels(names, rows, folds)
    # a ridge of penalty 30 on 200 records takes 30 / 230 off each slope: of the shape's 5 dB it
    # leaves 0.65, of the speed's 1.74 dB 0.23, beside 0.5 of scatter 0.85 in all; the standard
    # error of that from 400 is 0.03
    assert levels.size[0] == pytest.approx(0.85, abs=2 * 0.03)
    louder = rows.copy()
    louder[:, 0] *= 9.80665
    lift = levels.excess(names, louder) - levels.excess(names, rows)
    np.testing.assert_allclose(lift, 20 * np.log10(9.80665), rtol=1e-9)


def test_what_is_thirty_times_too_quiet_is_dead():
    names, rows, folds = levels_task()
    levels = fit_levels(names, rows, folds)
    recording = replace(
        acceleration(np.zeros((1, 8))),
        channels=(Channel(name="a", unit="m/s^2", quantity="acceleration"),),
    )
    quietest = rows[np.argmin(rows[:, 0])].copy()
    for factor, kinds in ((1 / 29, []), (1 / 31, ["dead"])):
        row = quietest * [factor, 1, 1]
        found = quiet_faults(recording, names, row, levels)
        assert [fault.kind for fault in found] == kinds
    assert isinstance(levels, Levels)


def test_a_model_that_never_saw_a_condemned_machine_says_so(model, familiar):
    assert untrained_wear(model.card) == ()  # trained beyond the limit
    low = model.card.severity_range_m[0]
    card = model.card.model_copy(update={"severity_range_m": (low, 0.13e-3)})
    [text] = untrained_wear(card)
    assert text.startswith("no machine in training was worn beyond 0.13 mm, the condemning limit")
    assert recording_context(None, familiar[0], card)["told"] == (text,)
