"""The core and complete sets: values against closed forms, needs, silence, sharing, names."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.datasets.measured.recording import read_recording
from wearstate.features.catalogue import analysis as shared
from wearstate.features.catalogue import catalogue, complete_rows, needs
from wearstate.features.catalogue import row as table
from wearstate.features.response import modal
from wearstate.features.response.transfer import FrfReference
from wearstate.features.rotation import angle_resample as resample
from wearstate.features.rotation import order
from wearstate.features.rotation import tacholess_speed as speed
from wearstate.features.signal import (
    cepstrum,
    envelope,
    fft,
    iso,
    spectral_shape,
    spectrum,
    statistics,
)
from wearstate.features.signal import kurtogram as blows

FS = 25_600.0
N = 25_600
T = np.arange(N) / FS
BEARING = envelope.bearing_frequencies(8, 0.235, 1.245)
EVERYTHING = shared.Settings(
    bearing=BEARING,
    speed_hz=25.0,
    speed_band_hz=(20.0, 30.0),
    machine="pump-1-small",
    bands=((100.0, 500.0), (300.0, 4000.0)),
)


def row(vibration, tacho=None, *, fs=FS, feature_set="complete", **options):
    names, values = table.feature_row(
        vibration, fs, tacho=tacho, feature_set=feature_set, **options
    )
    assert len(names) == len(values) == len(set(names))
    assert np.all(np.isfinite(values))
    return dict(zip(names, values, strict=True))


def only(vibration, *names, fs=FS, **options):
    """Values of single features, without the name of a single channel."""
    found = row(np.asarray(vibration), fs=fs, only=names, **options)
    return {name.removeprefix("ch_0."): value for name, value in found.items()}


def machine(seed=0, dtype=np.float64, speed_hz=25.0, blows_per_turn=BEARING.outer):
    """Two channels with shaft orders, blows (an outer race's) and noise, and a tacho."""
    rng = np.random.default_rng(seed)
    phase = 0.3 + speed_hz * T
    blows = (T * speed_hz * blows_per_turn) % 1
    ring = 3 * np.exp(-blows * 40) * np.sin(2 * np.pi * 5000 * T)
    vibration = np.stack((ring, 0.5 * ring)) + rng.normal(0, 0.2, (2, N))
    vibration += np.cos(2 * np.pi * phase) + 0.5 * np.cos(4 * np.pi * phase)
    return vibration.astype(dtype), (5.0 * (phase % 1 < 0.1)).astype(dtype)


def kurtogram(x):
    """Kurtogram as deep as an unknown speed allows."""
    levels = blows.kurtogram_levels(x.size, FS, envelope.SHOWN_HZ)
    return blows.kurtogram(x, FS, levels=levels)


def forced(seed=0, f0=400.0, gain=1.0):
    """Force and the accelerations of one and of three resonances under it."""
    rng = np.random.default_rng(seed)
    force = rng.standard_normal(N)
    s = 2j * np.pi * np.fft.rfftfreq(N, 1 / FS)
    modes = [s**2 / (s**2 + 0.08 * w * s + w**2) for w in 2 * np.pi * np.array([f0, 1500, 4000])]
    lines = np.fft.rfft(force)
    single, triple = (np.fft.irfft(lines * h, N) for h in (modes[0], sum(modes)))
    return np.stack([force, gain * single, gain * triple])


FORCED = ("force", "acceleration", "acceleration")


# --- the sets


def test_larger_sets_begin_with_the_smaller_ones():
    vibration, tacho = machine()
    found = [row(vibration, tacho, feature_set=name) for name in catalogue.SETS]
    for small, large in pairwise(found):
        assert list(large)[: len(small)] == list(small)
        # The standard row, which models are trained on, is the same to the last bit in each set.
        assert_array_equal(list(large.values())[: len(small)], list(small.values()))
        assert len(large) > len(small)


def test_the_dearest_rows_are_in_the_complete_set_only():
    dearest = {row.name for row in complete_rows.COMPLETE_ROWS}
    assert dearest >= {"kurtogram", "cyclic_coherence", "modes"}
    core = {row.name for row in catalogue.SETS["core"]}
    assert core.isdisjoint(dearest)
    assert len(catalogue.SETS["complete"]) == len(core) + len(dearest)


def test_every_row_says_what_it_is():
    listed = table.catalogue()
    assert [r["name"] for r in listed] == [r.name for r in catalogue.SETS["complete"]]
    assert len({r["name"] for r in listed}) == len(listed)
    for feature, text in zip(catalogue.SETS["complete"], listed, strict=True):
        assert set(feature.needs) <= set(needs.NEEDS)
        assert all(text.values()), feature.name
    assert {need for feature in catalogue.SETS["complete"] for need in feature.needs} == set(
        needs.NEEDS
    )
    by_name = {r["name"]: r for r in listed}
    assert by_name["bearing_lines"]["needs"].endswith("bearing geometry, tacho or nominal speed")
    assert (by_name["rms"]["set"], by_name["entropy"]["set"]) == ("standard", "core")


def test_unknown_set():
    with pytest.raises(ValueError, match="must be one of standard, core, complete"):
        table.feature_row(np.zeros((1, 100)), FS, feature_set="all")


@pytest.mark.parametrize("with_tacho", [True, False])
@pytest.mark.parametrize("quantities", [None, FORCED[:2], ("displacement", "acceleration")])
def test_names_agree_with_the_row(with_tacho, quantities):
    vibration, tacho = machine()
    found = row(
        vibration, tacho if with_tacho else None, quantities=quantities, settings=EVERYTHING
    )
    names = table.feature_names(
        ("ch_0", "ch_1"),
        FS,
        tacho=with_tacho,
        quantities=quantities,
        n_samples=N,
        settings=EVERYTHING,
        feature_set="complete",
    )
    assert names == tuple(found)


# --- values


def test_a_sine_in_time_and_frequency():
    amplitude, f = 3.0, 1000.0
    found = row(amplitude * np.sin(2 * np.pi * f * T), settings=EVERYTHING)
    found = {name.removeprefix("ch_0."): value for name, value in found.items()}
    # Mean square root of |sin|: 0.76276, whose cusps 128 different samples read to 4e-3.
    assert found["clearance_factor"] == pytest.approx(1 / 0.762760**2, rel=5e-3)
    assert found["k_factor"] == pytest.approx(amplitude**2 / np.sqrt(2), rel=5e-3)
    assert found["zero_crossing_rate"] == pytest.approx(2 * f, rel=1e-3)  # one of 2000 at an end
    # Hann's lobe on a line is symmetric: exact. Its spread is a third of a line of 3.125 Hz.
    assert found["spectral_centroid_hz"] == pytest.approx(f, rel=1e-9)
    assert found["spectral_spread_hz"] == pytest.approx(3.125 * np.sqrt(1 / 3), rel=1e-6)
    # All but nothing on one line of thousands: 0.868 nats (the three lines of the window).
    assert found["spectral_entropy"] == pytest.approx(0.868 / np.log(4096), rel=1e-3)
    assert found["tone.frequency_hz"] == pytest.approx(f, abs=1e-6)
    level = 10 * np.log10(amplitude**2 / 2)
    assert found["tone.level_db"] == pytest.approx(level, abs=1e-6)
    assert found["third_octave_1000.level_db"] == pytest.approx(level, abs=1e-6)
    assert found["user_band_300_4000.level_db"] == pytest.approx(level, abs=1e-6)
    assert found["user_band_100_500.level_db"] < level - 100
    assert found["spectral_kurtosis.highest"] < 5  # its own lines are at -1, the others empty


def test_third_octaves_are_named_as_engineers_do():
    names = table.feature_names(["a"], FS, only=["third_octaves"])
    nominal = [name.split("third_octave_")[1].removesuffix(".level_db") for name in names]
    assert nominal[:6] == ["25", "31.5", "40", "50", "63", "80"]
    assert nominal[-3:] == ["6300", "8000", "10000"]
    assert len(shared.STANDARD.octave_centres(FS)) == len(nominal)


def test_third_octave_levels_of_tones_and_noise():
    t = np.arange(51_200) / FS
    x = np.sqrt(2) * (np.sin(2 * np.pi * 1000 * t) + 0.1 * np.sin(2 * np.pi * 4000 * t))
    centres = shared.STANDARD.octave_centres(FS)
    assert_allclose(centres[[0, -1]], [25.119, 10_000], rtol=1e-4)
    levels = shared.Analysis(x[np.newaxis], FS).octave_levels[0]
    # Segments meet a tone off their lines at different phases: 0.001 dB.
    assert_allclose(levels[centres == 1000], 0.0, atol=1e-3)
    assert_allclose(levels[np.isclose(centres, 3981.07)], -20.0, atol=1e-3)
    noise = np.random.default_rng(5).standard_normal((2, 200_000))
    found = shared.Analysis(noise, FS).octave_levels[:, centres >= 999]
    # White noise rises by 1 dB a band; the narrowest, 231 Hz, has 3600 degrees of freedom, hence
    # 0.1 dB: four of them.
    width = centres[centres >= 999] * (10**0.05 - 10**-0.05)
    assert_allclose(found, np.tile(10 * np.log10(width / (FS / 2)), (2, 1)), atol=0.4)


@pytest.mark.parametrize(
    ("name", "label", "function"),
    [
        ("clearance_factor", "clearance_factor", statistics.clearance_factor),
        ("k_factor", "k_factor", statistics.k_factor),
        ("entropy", "entropy", statistics.entropy),
        (
            "zero_crossing_rate",
            "zero_crossing_rate",
            lambda x: statistics.zero_crossing_rate(x, FS),
        ),
        ("velocity_rms", "velocity_rms", lambda x: iso.velocity_rms(x, FS)),
        (
            "spectral_flatness",
            "spectral_flatness",
            lambda x: spectral_shape.spectral_flatness(spectrum.power_lines(x, FS)),
        ),
        (
            "spectral_entropy",
            "spectral_entropy",
            lambda x: spectral_shape.spectral_entropy(spectrum.power_lines(x, FS)),
        ),
        (
            "harmonic_spacing",
            "harmonic_spacing.frequency_hz",
            lambda x: cepstrum.harmonic_spacing(x, FS, low=25.0, high=200.0)[0],
        ),
        (
            "spectral_kurtosis",
            "spectral_kurtosis.highest",
            lambda x: blows.spectral_kurtosis(x, FS)[1].max(),
        ),
        ("kurtogram", "kurtogram.kurtosis", lambda x: kurtogram(x).highest),
        ("kurtogram", "kurtogram.centre_hz", lambda x: kurtogram(x).centre),
        ("kurtogram", "kurtogram.score", lambda x: kurtogram(x).score),
        (
            "tacholess_speed",
            "tacholess.speed_hz",
            lambda x: speed.tacholess_speed(x, FS, band_hz=(20.0, 30.0)).mean_hz,
        ),
    ],
)
def test_values_are_those_of_the_function_and_the_channel(name, label, function):
    vibration, _ = machine()
    found = row(vibration, only=[name], settings=shared.Settings(speed_band_hz=(20.0, 30.0)))
    for i, signal in enumerate(vibration):
        # The same sums, of two channels at once.
        assert_allclose(found[f"ch_{i}.{label}"], function(signal), rtol=1e-9)


@pytest.mark.parametrize("rms_mm_s", [1.2, 3.0, 5.0, 9.0])
def test_severity_and_zone(rms_mm_s):
    f = 25.0
    acceleration = 2 * np.pi * f * rms_mm_s * 1e-3 * np.sqrt(2) * np.cos(2 * np.pi * f * T)
    found = only(acceleration, "velocity_rms", "iso_zone", settings=EVERYTHING)
    # Leakage of a tone 25 lines up, integrated: 1e-3.
    assert found["velocity_rms"] == pytest.approx(rms_mm_s * 1e-3, rel=1e-3)
    limits = iso.KINDS["pump-1-small"].velocity_mm_s
    assert found["iso_zone"] == np.searchsorted(limits, rms_mm_s)


def test_the_zone_is_the_worse_of_velocity_and_displacement():
    # 3 Hz: 1 mm/s is zone A, but 1e-3 / (2 pi 3) = 53 um rms is zone C of 22, 45, 71 um.
    t = np.arange(10 * 4096) / 4096
    slow = 2 * np.pi * 3 * 1e-3 * np.sqrt(2) * np.cos(2 * np.pi * 3 * t)
    settings = shared.Settings(machine="industrial-2-rigid", speed_hz=3.0)
    found = only(slow, "iso_zone", "velocity_rms", fs=4096.0, settings=settings)
    assert found["velocity_rms"] == pytest.approx(1e-3, rel=1e-2)
    assert found["iso_zone"] == 2


def test_the_band_of_the_severity_follows_the_machine():
    assert shared.Settings().severity_band() == iso.ISO_BAND
    assert shared.Settings(machine="pump-1-small").severity_band() == iso.ISO_BAND
    slow = shared.Settings(machine="pump-1-small", speed_hz=5.0)
    assert slow.severity_band() == iso.SLOW_ISO_BAND
    assert shared.Settings(machine="reciprocating-2").severity_band() == iso.SLOW_ISO_BAND


def test_only_accelerations_have_a_severity():
    vibration, _ = machine()
    found = row(vibration, only=["velocity_rms"], quantities=("displacement", "acceleration"))
    assert list(found) == ["ch_1.velocity_rms"]
    assert found["ch_1.velocity_rms"] == pytest.approx(iso.velocity_rms(vibration[1], FS), rel=1e-9)


def test_noise_floor_of_white_noise():
    noise = 2.0 * np.random.default_rng(1).standard_normal(10 * N)
    found = only(noise, "noise_floor")
    # Variance 4 over 12.8 kHz. 4000 lines of 60 averages scatter by 1.5 / sqrt(240,000): 0.01 dB.
    assert found["noise_floor_db"] == pytest.approx(10 * np.log10(4 / 12_800), abs=0.06)


def test_orders_have_a_phase():
    phase = 0.3 + 25.0 * T
    tacho = 5.0 * (phase % 1 < 0.1)
    found = row(np.cos(2 * np.pi * 2 * phase + 0.7), tacho, only=["order_phases"])
    angle = np.arctan2(found["ch_0.order_02.sin"], found["ch_0.order_02.cos"])
    # A pulse is known to half a sample of 1024: 0.006 rad at order 2.
    assert angle == pytest.approx(0.7, abs=0.01)
    assert np.hypot(found["ch_0.order_05.sin"], found["ch_0.order_05.cos"]) == pytest.approx(1.0)


def test_phases_need_a_mark():
    vibration, tacho = machine()
    found = row(vibration, tacho, pulses_per_revolution=2, feature_set="core")
    assert "ch_0.order_02.level_db" in found
    assert not any(name.endswith("order_02.cos") for name in found)


def test_synchronous_average_and_residual():
    phase = 0.3 + 25.0 * T
    tacho = 5.0 * (phase % 1 < 0.1)
    wave = 2 * np.cos(2 * np.pi * 3 * phase) + np.cos(2 * np.pi * 4.5 * phase)
    found = only(wave, "synchronous_average", tacho=tacho)
    # A half order is averaged to 1 / 24 of itself at the most: 0.02 dB of the synchronous part.
    assert found["synchronous.level_db"] == pytest.approx(10 * np.log10(2.0), abs=0.05)
    assert found["residual.level_db"] == pytest.approx(10 * np.log10(0.5), abs=0.2)
    # Both are sines, but for those 4 %.
    assert found["synchronous.kurtosis"] == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize("speed_hz", [4.0, 11.0, 60.0])
def test_thinning_changes_nothing_below_its_edge(speed_hz):
    """The synchronous average of thinned signals is that of the whole ones."""
    rng = np.random.default_rng(2)
    phase = 0.3 + speed_hz * T
    repeating = sum(np.cos(2 * np.pi * k * phase + k) for k in (1, 2, 7, 30, 50))
    vibration = (repeating + rng.normal(0, 0.1, N))[np.newaxis]
    pulses = order.pulse_times(5.0 * (phase % 1 < 0.1), FS)
    found = shared.Analysis(vibration, FS, pulses=pulses)
    factor = round(FS / (found.angle.points_per_revolution * speed_hz))
    assert factor >= 2
    direct = resample.angular_resample(vibration, found.phase, points_per_revolution=128)
    mean = resample.synchronous_average(direct)
    ours = resample.synchronous_average(found.angle)
    # Orders up to 51 are kept by both; above, the two filters differ, on noise of 0.1 / sqrt(3).
    assert_allclose(ours, mean, atol=0.12)
    lines, expected = (np.abs(np.fft.rfft(m)) / 64 for m in (ours, mean))
    assert_allclose(lines[..., :51], expected[..., :51], atol=3e-3)


def test_thinning_by_one_is_nothing():
    wave = np.arange(10.0)
    assert shared.thinned(wave, 1) is wave


def test_spacing_of_a_family():
    clicks = np.zeros(N)
    clicks[::320] = 1.0
    noisy = clicks + 0.02 * np.random.default_rng(0).standard_normal(N)
    found = only(noisy, "harmonic_spacing")
    # The period is known to half a sample of 320.
    assert found["harmonic_spacing.frequency_hz"] == pytest.approx(80.0, rel=1 / 640)
    assert found["harmonic_spacing.height"] > 10


def test_envelope_line_of_a_modulated_tone():
    wave = (1 + 0.5 * np.cos(2 * np.pi * 37 * T)) * np.sin(2 * np.pi * 6000 * T)
    wave = wave + 0.01 * np.random.default_rng(0).standard_normal(N)
    found = only(wave, "envelope_line")
    assert found["envelope_line.frequency_hz"] == pytest.approx(37.0, abs=1e-9)  # on a line
    assert found["envelope_line.ratio"] > 100


def test_bearing_lines_name_the_damaged_race():
    vibration, tacho = machine()
    options = {"settings": EVERYTHING}
    for found in (row(vibration, tacho, **options), row(vibration, **options)):
        for prefix in ("bearing", "kurtogram_bearing"):
            scores = {fault: found[f"ch_0.{prefix}_{fault}.score"] for fault in shared.FAULTS}
            assert max(scores, key=scores.get) == "outer"
            assert scores["outer"] > 10
            # 14.8 Hz, below the 26.7 Hz that one second can show with its surroundings.
            assert scores["cage"] == 0.0
        coherent = {fault: found[f"ch_0.cyclic_{fault}.coherence"] for fault in shared.FAULTS}
        assert max(coherent, key=coherent.get) == "outer"
        assert coherent["outer"] > 5 * coherent["inner"]
        assert coherent["cage"] == 0.0


@pytest.mark.parametrize(
    ("fault", "blows_per_turn"),
    [
        ("outer", BEARING.outer),
        ("inner", BEARING.inner),
        ("roller", 2 * BEARING.roller),  # it strikes both races
        ("cage", BEARING.cage),
    ],
)
def test_every_part_of_a_bearing_has_its_line(fault, blows_per_turn):
    # At 80 rev/s even the cage turns fast enough for one second.
    vibration, tacho = machine(speed_hz=80.0, blows_per_turn=blows_per_turn)
    found = row(vibration, tacho, only=["bearing_lines"], settings=EVERYTHING)
    scores = {part: found[f"ch_0.bearing_{part}.score"] for part in shared.FAULTS}
    assert scores[fault] > 10
    assert max(scores, key=scores.get) == fault


def test_speed_without_a_tacho():
    vibration, _ = machine(speed_hz=24.3)
    found = row(vibration, only=["tacholess_speed"], settings=EVERYTHING)
    assert found["ch_0.tacholess.speed_hz"] == pytest.approx(24.3, abs=0.05)
    assert 0 < found["ch_0.tacholess.half_interval_hz"] < 0.2
    assert found["ch_0.tacholess.found"] == 1.0
    noise = np.random.default_rng(0).standard_normal(N)
    assert list(only(noise, "tacholess_speed", settings=EVERYTHING).values()) == [0.0, 0.0, 0.0]


# --- transfer functions


def test_transfer_function_of_a_gain():
    force = np.random.default_rng(0).standard_normal(N)
    found = row(np.stack([force, 2 * force]), quantities=FORCED[:2])
    levels = [value for name, value in found.items() if name.startswith("ch_1.frf.band_")]
    assert len(levels) == 10
    assert_allclose(levels, 20 * np.log10(2), atol=1e-9)
    assert found["ch_1.frf.coherence"] == pytest.approx(1.0, abs=1e-9)
    assert found["ch_1.frf.random_error"] < 1e-5
    assert not any(name.startswith("ch_0.frf.") for name in found)


def test_noise_lowers_the_coherence():
    rng = np.random.default_rng(0)
    force, noise = rng.standard_normal((2, 10 * N))
    found = row(np.stack([force, force + noise]), quantities=FORCED[:2], only=["frf_quality"])
    # As much noise as signal: 1 / (1 + 1); the estimate is high by less than 1 / 240 averages.
    assert found["ch_1.frf.coherence"] == pytest.approx(0.5, abs=0.01)
    averages = 249 / (1 + 2 / 36)  # half-overlapping Hann blocks of 2048
    assert found["ch_1.frf.random_error"] == pytest.approx(np.sqrt(0.5 / averages), rel=0.02)


def test_modes_shift_and_likeness():
    before = shared.Analysis(forced(), FS, quantities=FORCED)
    measured = before.transfer_functions
    reference = FrfReference(measured.frequency, measured.value, before.modes)
    settings = shared.Settings(reference=reference)
    same = row(forced(), quantities=FORCED, settings=settings)
    # Lines of 12.5 Hz, Hann: a mode 32 Hz wide reads up to a tenth wider, its frequency to 1 %.
    assert same["frf.mode_1.frequency_hz"] == pytest.approx(400, rel=0.01)
    assert same["frf.mode_1.damping_ratio"] == pytest.approx(0.04, rel=0.3)
    assert same["frf.mode_2.frequency_hz"] == pytest.approx(1500, rel=0.01)
    assert same["ch_2.frf.assurance"] == pytest.approx(1.0, abs=1e-9)
    assert same["frf.resonance_shift.mean"] == pytest.approx(0.0, abs=1e-9)
    assert same["frf.resonance_shift.found"] == 1.0
    louder = row(forced(gain=3.0), quantities=FORCED, settings=settings)
    assert louder["ch_1.frf.assurance"] == pytest.approx(1.0, abs=1e-9)
    changed = row(forced(f0=380.0), quantities=FORCED, settings=settings)
    # One of three modes lower by a twentieth; the mean to a third of the 1 % above.
    assert changed["frf.resonance_shift.mean"] == pytest.approx(-0.05 / 3, abs=0.004)
    assert changed["ch_1.frf.assurance"] < 0.95


def test_a_reference_of_other_lines_is_refused():
    other = FrfReference(np.arange(3.0), np.ones((2, 3), complex))
    with pytest.raises(ValueError, match=r"reference has shape \(2, 3\) at 0 … 2 Hz, must have 2 "):
        row(forced(), quantities=FORCED, settings=shared.Settings(reference=other))


def test_dead_force_and_dead_response():
    signals = forced()
    signals[1] = 0.3
    found = row(signals, quantities=FORCED)
    dead = {name: value for name, value in found.items() if name.startswith("ch_1.frf.")}
    assert all(value == -200.0 for name, value in dead.items() if name.endswith("level_db"))
    assert (dead["ch_1.frf.coherence"], dead["ch_1.frf.random_error"]) == (0.0, 1.0)
    assert found["ch_2.frf.coherence"] > 0.99
    assert found["frf.mode_2.frequency_hz"] == pytest.approx(1500, rel=0.01)
    signals[0] = 1.0
    found = row(signals, quantities=FORCED)
    assert found["ch_2.frf.coherence"] == 0.0
    assert found["frf.mode_1.frequency_hz"] == 0.0


# --- properties


def test_gain_sign_and_offset():
    vibration, tacho = machine()
    options = {"settings": EVERYTHING, "feature_set": "complete"}
    before = row(vibration, tacho, **options)
    after = row(-4.0 * vibration + 3.0, tacho, **options)
    shift = 20 * np.log10(4.0)
    for name, value in before.items():
        label = name.split(".", 1)[1]
        scaled = value * {"k_factor": 16, "velocity_rms": 4}.get(label, 1)
        if "_over_" in name or label.endswith(("angle_harmonic_1.cos_db", "iso_zone")):
            continue  # ratios are tested with the standard row; the zone has steps
        if label in ("rms", "peak", "peak_to_peak"):
            scaled = 4 * value
        elif label == "skewness" or (label.startswith("order_") and not label.endswith("_db")):
            scaled = -value  # a sign is half a turn of the phase
        elif label.endswith(("level_db", "floor_db")):
            scaled = value + shift
        elif label == "entropy":
            # Samples on the edge of a bin change it: one in 64 bins of 400.
            assert after[name] == pytest.approx(value, abs=2e-3)
            continue
        # A factor of four is exact; the offset costs digits of weak lines and phases.
        assert_allclose(after[name], scaled, rtol=1e-6, atol=1e-6, err_msg=name)


def test_channels_may_change_places():
    vibration, tacho = machine()
    names = ("a", "b")
    first = row(vibration, tacho, channel_names=names, settings=EVERYTHING)
    second = row(vibration[::-1], tacho, channel_names=names[::-1], settings=EVERYTHING)
    for name, value in first.items():
        if name.startswith(("a.", "b.")):
            assert_allclose(second[name], value, rtol=1e-8, atol=1e-8, err_msg=name)


def test_float32_stays_and_agrees(monkeypatch):
    vibration, tacho = machine()
    full = row(vibration, tacho, feature_set="core")
    seen = []
    transform = fft.transform
    monkeypatch.setattr(
        fft,
        "transform",
        lambda kind, x, *a, **k: seen.append(x.dtype) or transform(kind, x, *a, **k),
    )
    single = row(vibration.astype(np.float32), tacho.astype(np.float32), feature_set="core")
    # Double precision only where logarithms of lines are transformed, for the cepstrum.
    doubles = [kind for kind in seen if kind in (np.float64, np.complex128)]
    assert len(doubles) == 1
    for name, value in full.items():
        if name.endswith((".cos", ".sin", "entropy")):
            continue  # phases of orders that are all noise
        assert_allclose(single[name], value, rtol=2e-3, atol=1e-2, err_msg=name)


# --- silence, clipping, faults


@pytest.mark.parametrize("constant", [0.0, 0.1, -7.0])
def test_a_dead_channel_has_documented_values(constant):
    vibration, tacho = machine(dtype=np.float32)
    vibration[1] = constant
    found = row(vibration, tacho, settings=EVERYTHING)
    dead = {n.removeprefix("ch_1."): v for n, v in found.items() if n.startswith("ch_1.")}
    special = {
        "spectral_kurtosis.highest": -1.0,
        "spectral_kurtosis.frequency_hz": 200.0,
        "kurtogram.centre_hz": 6400.0,
        "kurtogram.bandwidth_hz": 12_800.0,
        "kurtogram.kurtosis": -1.0,
    }
    for name, value in dead.items():
        level = name.endswith(("level_db", "floor_db"))
        # Silence: the floor for levels, 0 for all the rest; the log of 1e-20 rounds.
        expected = special.get(name, -200.0 if level else 0.0)
        assert_allclose(value, expected, atol=1e-12, err_msg=name)


def test_a_clipped_signal_has_finite_values():
    vibration, tacho = machine()
    found = row(np.clip(20 * vibration, -1, 1), tacho, settings=EVERYTHING)
    # A square wave, nearly: two bins hold most samples, and the peak is little above the rms.
    assert found["ch_0.entropy"] < 3
    assert found["ch_0.clearance_factor"] < 1.5  # 1.72 of a sine, 1 of a square wave


@pytest.mark.parametrize("feature_set", ["core", "complete"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 3e9])
def test_bad_samples_are_refused(feature_set, value):
    vibration, _ = machine()
    vibration[1, 17] = value
    with pytest.raises(ValueError, match=r"ch_1 has 1 .* the first at 17"):
        row(vibration, feature_set=feature_set)


@pytest.mark.parametrize("fs", [150.0, 2048.0, 25_600.0])
@pytest.mark.parametrize("n", [64, 255, 256, 767, 768, 2559, 5001])
def test_what_a_short_record_cannot_give_is_absent(fs, n):
    """Whatever the length and the rate, what is announced can be computed."""
    rng = np.random.default_rng(n)
    settings = shared.Settings(bearing=BEARING, speed_hz=25.0, machine="reciprocating-1")
    found = row(rng.standard_normal((2, n)), fs=fs, settings=settings, quantities=FORCED[:2])
    layout = needs.Layout(
        channels=("ch_0", "ch_1"),
        quantities=FORCED[:2],
        fs=fs,
        n_samples=n,
        settings=settings,
    )
    absent = table.absent_features(layout)
    there = {feature.name for feature in catalogue.SETS["complete"]} - set(absent)
    assert ("kurtogram" in there) == any(".kurtogram." in name for name in found)
    assert ("kurtogram" in there) == (n >= 256)
    # Half a second at 10 Hz, or 2.5 s at the 2 Hz of a reciprocating machine, up to 1000 Hz.
    assert ("velocity_rms" in there) == (fs >= 2000 and n / fs >= 2.5)
    assert ("third_octaves" in there) == any(".third_octave_" in name for name in found)


def test_absent_features_say_why():
    layout = needs.Layout(
        channels=("a", "b"), quantities=("displacement",) * 2, fs=1000.0, n_samples=500
    )
    why = table.absent_features(layout)
    assert why["velocity_rms"].startswith(
        "acceleration channels = 0 must be >= 1; declare the unit"
    )
    assert why["iso_zone"].endswith("machine = None must be given; name its kind")
    assert why["bearing_lines"] == (
        "bearing = None must be given; give its geometry; "
        "speed_hz = None must be given without a tacho; give either"
    )
    assert why["frf_levels"].startswith("force channels = 0 must be >= 1; declare the unit N on")
    assert "crank_angle_map" in why
    assert "centreline" not in why
    assert "rms" not in why
    three = needs.Layout(
        channels=("a",), quantities=("acceleration",), fs=FS, n_samples=N, settings=EVERYTHING
    )
    assert "velocity_rms" not in table.absent_features(three, "core")
    with pytest.raises(ValueError, match="did you mean pump-1-small"):
        table.feature_names(
            ["a"], FS, settings=shared.Settings(machine="pump-1-smal"), feature_set="core"
        )


# --- only


def test_only_what_is_asked_for_is_computed(monkeypatch):
    calls = []
    for module, name in (
        (fft, "transform"),
        (order, "pulse_times"),
        (order, "shaft_phase"),
        (blows, "kurtogram"),
        (modal, "modal_fit"),
    ):
        inner = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, f=inner, n=name, **k: calls.append(n) or f(*a, **k)
        )
    vibration, tacho = machine()
    row(vibration, only=["rms", "kurtosis", "ch_0.entropy"])
    assert calls == []
    row(vibration, tacho, only=["order_levels"])
    assert calls == ["pulse_times", "shaft_phase"]
    row(vibration, only=["kurtogram"])
    assert calls.count("kurtogram") == 2


def test_transforms_are_shared(monkeypatch):
    calls = []
    for module, name in (
        (envelope, "envelope_spectrum"),
        (blows, "kurtogram"),
        (blows, "spectral_kurtosis"),
        (order, "order_amplitudes"),
        (order, "shaft_phase"),
        (resample, "angular_resample"),
        (spectrum, "power_lines"),
    ):
        inner = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, f=inner, n=name, **k: calls.append(n) or f(*a, **k)
        )
    vibration, tacho = machine()
    row(vibration, tacho, settings=EVERYTHING)
    count = {name: calls.count(name) for name in set(calls)}
    assert count["envelope_spectrum"] == 3  # the chosen band, and the kurtogram's of two channels
    assert count["kurtogram"] == 2  # one a channel
    assert count["spectral_kurtosis"] == count["order_amplitudes"] == count["shaft_phase"] == 1
    assert count["angular_resample"] == 1
    # The default segments, once for six features; by name in `spectrum`, also those of the tone and
    # of the third octaves.
    assert count["power_lines"] == 3


def test_single_values_by_name():
    vibration, tacho = machine()
    whole = row(vibration, tacho, feature_set="core")
    bands = [f"ch_{i}.third_octave_{f}.level_db" for i, f in ((0, 63), (1, 1000), (1, 5000))]
    found = row(vibration, tacho, only=[*bands[::-1], "shaft.speed_hz", "rms"])
    assert list(found) == ["ch_0.rms", "ch_1.rms", "shaft.speed_hz", *bands]
    for name, value in found.items():
        assert value == whole[name]


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (["kurtossis"], r"feature 'kurtossis' is unknown; did you mean kurtosis\?"),
        (["ch_0.rmss"], r"feature 'ch_0.rmss' is unknown; did you mean ch_0.rms\?"),
        (["qqqqqqqq"], r"feature 'qqqqqqqq' is unknown; see wearstate features --list"),
        (["order_levels"], r"order_levels is not available: tacho = none must be there"),
        (["x1y2", "frf_levels"], r"(?s)frf_levels is not available: force .*'x1y2' is unknown"),
        ([], r"only = \(\) must name one feature or more"),
    ],
)
def test_only_names_what_there_is(wanted, message):
    with pytest.raises(ValueError, match=message):
        row(np.random.default_rng(0).standard_normal((1, 1000)), only=wanted)


# --- measured


@pytest.mark.parametrize(
    ("file", "damaged"),
    [
        *((f"OuterRaceFault_vload_{n}.mat", "outer") for n in (1, 3, 5, 7)),
        *((f"InnerRaceFault_vload_{n}.mat", "inner") for n in (1, 3, 5, 7)),
        ("baseline_1.mat", None),
    ],
)
def test_measured_bearings_without_a_band(realdata, file, damaged):
    """The row names the damaged race, with no band given: ten is three times what noise reaches."""
    path = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0" / file
    if not path.is_file():
        pytest.skip("the bearing recordings are not here")
    recording = read_recording(path)
    found = row(
        recording.signal[:1],
        fs=recording.sample_rate,
        only=["bearing_lines", "cyclic_coherence"],
        settings=shared.Settings(bearing=BEARING, speed_hz=25.0),
    )
    for fault in shared.FAULTS:
        assert (found[f"ch_0.bearing_{fault}.score"] > 10) == (fault == damaged)
        assert (found[f"ch_0.cyclic_{fault}.coherence"] > 0.05) == (fault == damaged)
