"""The physical space, and how far a recording lies from the familiar."""

import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfilt
from wearstate.datasets.file.record import DataSet
from wearstate.diagnose.familiarity.bandwidth import cut_off
from wearstate.diagnose.familiarity.noise_floor import (
    fit_least,
    lifted_rows,
    noise_floors,
    noisiest,
)
from wearstate.diagnose.familiarity.novelty import (
    fit_familiarity,
    free_distance,
    novelty_p_value,
    outside_weight,
)
from wearstate.diagnose.feature_rows.feature_choice import feature_words
from wearstate.diagnose.feature_rows.feature_table import recording_features
from wearstate.diagnose.feature_rows.physical import (
    columns_of,
    coordinates_of,
    level_rows,
    moved_rows,
    physical_rows,
    shape_rows,
)
from wearstate.features.catalogue.row import feature_names, feature_row
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene

NAMES = tuple(f"a.shape_{i}" for i in range(40))
"""Features that the physical space takes as they are."""


def cloud_of(rows):
    return fit_familiarity(NAMES[: rows.shape[1]], rows, np.arange(len(rows)))


def distances(cloud, rows):
    return cloud.distance(NAMES[: rows.shape[1]], rows)


# --- the physical space


def test_every_feature_of_the_row_has_its_place_once():
    names = feature_names(["x", "y"], 25_600.0)
    owners = columns_of(names)
    found = [
        i
        for columns in owners.values()
        for part in ("level", "bands", "orders", "spiky", "again", "other", "cells")
        for i in getattr(columns, part)
    ]
    left = {names[i] for i in set(range(len(names))) - set(found)}
    assert sorted(found) == sorted(set(found))
    assert left == {"shaft.speed_hz", "shaft.speed_variation"}
    assert owners["x"].angles == 36
    assert len(owners["x"].cells) == 720


@pytest.fixture(scope="module")
def recording(small_set):
    with DataSet(small_set) as data:
        return data[0]


def test_the_space_knows_no_level(recording):
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((2, 40_000))
    tacho = (np.arange(40_000) % 5_000 < 100).astype(float)
    names, row = feature_row(noise, 25_600.0, tacho=tacho, channel_names=["x", "y"])
    _, louder = feature_row(9.80665 * noise, 25_600.0, tacho=tacho, channel_names=["x", "y"])
    for space in (physical_rows, shape_rows):
        # sums over thousands of samples in other magnitudes: rounding only
        np.testing.assert_allclose(space(names, row[None]), space(names, louder[None]), atol=1e-8)
    lift = level_rows(names, louder[None]) - level_rows(names, row[None])
    np.testing.assert_allclose(lift, 20 * np.log10(9.80665), rtol=1e-9)


def test_a_resonance_that_moves_by_a_fifth_moves_the_space_less_than_the_row():
    """White noise through one resonator, at 3 and at 3.6 kHz: narrow bands jump, wide ones lean."""
    from scipy.signal import iirpeak, lfilter

    noise = np.random.default_rng(1).standard_normal(100_000)
    names, rows = None, []
    for centre in (3000.0, 3600.0):
        wave = lfilter(*iirpeak(centre, 20, fs=25_600.0), noise) + 0.03 * noise
        names, row = feature_row(wave, 25_600.0, channel_names=["x"])
        rows.append(row)
    rows = np.array(rows)
    bands = [i for i, name in enumerate(names) if ".band_" in name]
    narrow = np.abs(np.diff(rows[:, bands], axis=0)).max()
    wide = np.abs(np.diff(physical_rows(names, rows)[:, :5], axis=0)).max()
    assert narrow > 10  # dB
    assert wide < 0.6 * narrow


BANDS = tuple(f"{a}.band_{50 * 2**i}_{100 * 2**i}.level_db" for a in "xy" for i in range(8))
"""Two channels of eight octaves."""


def test_moved_spectra_are_those_of_the_moved_resonance():
    """A spectrum given as a function of frequency, moved by the function's own argument."""

    def spectrum(hertz):  # quadratic in the logarithm: linear interpolation errs by its curvature
        return -3.0 * np.log2(hertz / 1000) ** 2

    middle = np.sqrt(2) * 50 * 2.0 ** np.arange(8)
    row = np.tile(spectrum(middle), 2)[None]
    inner = np.r_[1:7, 9:15]  # the ends are held: what comes from beyond is not known
    for factor in (1 / 1.2, 1.2):
        moved = moved_rows(BANDS, row, factor)[0]
        # a quarter octave between points one octave apart: 3 x 2 x .26 x .74 / 2 = 0.6 dB at most
        wanted = np.tile(spectrum(middle / factor), 2)
        np.testing.assert_allclose(moved[inner], wanted[inner], atol=0.6)
    assert moved_rows(BANDS, row, 2.0)[0, 1:8] == pytest.approx(row[0, :7])
    assert np.array_equal(moved_rows(BANDS, row, 1.0), row)


def test_every_coordinate_has_an_owner_and_a_kind(recording):
    names, row = recording_features(recording)
    found = coordinates_of(names)
    assert found.owner.shape == found.kind.shape == physical_rows(names, row[None])[0].shape
    assert set(found.owner) == {"acc_x", "acc_y", "acc_x_over_acc_y"}
    assert set(found.kind) == {"profile", "wide", "orders", "spiky", "other"}
    assert np.count_nonzero(found.kind == "profile") == 2 * 18


def test_a_turn_of_the_profile_is_seen(recording):
    """The same energy a quarter turn later is another machine."""
    names, row = recording_features(recording)
    cells = columns_of(names)["acc_x"].cells
    turned = row.copy()
    turned[cells] = np.roll(row[cells].reshape(36, -1), 9, axis=0).ravel()
    apart = physical_rows(names, np.array([row, turned]))
    assert np.abs(np.diff(apart, axis=0)).max() > 3  # dB


def test_silence_has_a_place_too():
    tacho = (np.arange(40_000) % 5_000 < 100).astype(float)
    names, row = feature_row(np.zeros((2, 40_000)), 25_600.0, tacho=tacho)
    for space in (physical_rows, shape_rows, level_rows):
        assert np.isfinite(space(names, row[None])).all()


# --- the distance


def test_a_training_recording_is_one_away():
    """The mean square over coordinates of variance one, for any covariance."""
    rng = np.random.default_rng(2)
    rows = rng.standard_normal((4000, 10)) @ rng.standard_normal((10, 10))
    distance = distances(cloud_of(rows), rows)
    # 40,000 squares: the mean is known to 0.7 %; shrinking the covariance adds as little
    assert np.sqrt((distance**2).mean()) == pytest.approx(1.0, abs=0.03)


def test_it_is_the_mahalanobis_distance_where_nothing_needs_shrinking():
    rng = np.random.default_rng(3)
    mixing = rng.standard_normal((3, 3))
    rows = rng.standard_normal((20_000, 3)) @ mixing
    points = rng.standard_normal((20, 3))
    inverse = np.linalg.inv(mixing.T @ mixing)
    wanted = np.sqrt(np.einsum("ij,jk,ik->i", points, inverse, points) / 3)
    # the covariance of 20,000 is known to 1 %, its inverse along the least axis to some more
    np.testing.assert_allclose(distances(cloud_of(rows), points), wanted, rtol=0.05)


def test_familiarity_sees_what_leaves_the_cloud_in_a_direction_it_never_took():
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.standard_normal((200, 2)), 1e-3 * rng.standard_normal(200)])
    inside, outside = distances(cloud_of(flat), np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 0.1]]))
    # 100 standard deviations, clipped at ten, in one feature of three
    assert outside > 5 * inside


def test_familiarity_sees_usual_values_in_an_unusual_combination():
    """Forty features driven by five causes: a recording that no causes can make."""
    rng = np.random.default_rng(12)
    mixing = rng.standard_normal((5, 40))
    seen = rng.standard_normal((300, 5)) @ mixing + 0.01 * rng.standard_normal((300, 40))
    cloud = cloud_of(seen)
    usual = rng.standard_normal((1, 5)) @ mixing
    shuffled = rng.permutation(usual[0])[None, :]  # the same values, at other features
    assert np.abs((shuffled - cloud.centre) / cloud.spread).max() < 5
    # Along the five causes it may lie anywhere near; off them by the noise's 0.01 it should.
    assert distances(cloud, shuffled)[0] > 10 * distances(cloud, usual)[0]


def test_one_wild_feature_counts_as_ten_standard_deviations_and_no_more():
    rng = np.random.default_rng(11)
    cloud = cloud_of(rng.standard_normal((300, 40)))
    point = np.zeros((3, 40))
    point[:, 0] = [12.0, 1e3, 1e9]
    found = distances(cloud, point)
    np.testing.assert_allclose(found, found[0], rtol=1e-12)  # sums in another order


def resonant(centre, rng):
    """Band levels of machines with one resonance each, at `centre` times 500 Hz."""
    middle = np.sqrt(2) * 50 * 2.0 ** np.arange(8)
    octaves = np.log2(middle / (500 * centre[:, None]))
    levels = np.tile(-10 * np.log10(1 + (2 * octaves) ** 2), 2)
    return levels + 0.5 * rng.standard_normal(levels.shape)


def test_a_resonance_a_fifth_off_is_still_of_the_kind_and_one_an_octave_off_is_not():
    """Trained on resonances within 3 %: what another machine of the kind may have is near."""
    rng = np.random.default_rng(7)
    known = resonant(rng.uniform(0.97, 1.03, 600), rng)
    cloud = fit_familiarity(BANDS, known, np.arange(600))
    centres = {"same": 1.0, "lower": 1 / 1.2, "higher": 1.2, "octave": 2.0}
    found = {
        name: np.median(cloud.distance(BANDS, resonant(np.full(50, centre), rng)))
        for name, centre in centres.items()
    }
    # The ends of a uniform distribution are 1.7 standard deviations out, and interpolating between
    # octaves errs by as much again; without the tolerance they are 3 and 5 times as far.
    assert found["lower"] < 2.5 * found["same"]
    assert found["higher"] < 2.5 * found["same"]
    assert found["octave"] > 5 * found["same"]


KINDS = (
    *(f"a.order_{i:02d}.level_db" for i in range(1, 11)),
    *(f"a.shape_{i}" for i in range(10)),
    *(f"a.peak_{i}.kurtosis" for i in range(10)),
)


def test_odd_in_every_way_is_farther_than_very_odd_in_one():
    """The mean over the ways of looking, not over all coordinates."""
    rng = np.random.default_rng(8)

    def rows(n, size):
        orders, other, spiky = (s * rng.standard_normal((n, 10)) for s in size)
        return np.hstack([orders, other, np.exp(spiky)])

    cloud = fit_familiarity(KINDS, rows(3000, (1, 1, 1)), np.arange(3000))
    one, every = (
        np.median(cloud.distance(KINDS, rows(200, size))) for size in ((1, 4, 1), (2.5, 2.5, 2.5))
    )
    # the root mean square over all would be sqrt((1 + 16 + 1) / 3) = 2.45 and 2.5. Means: 2 and
    # 2.5; one order is told by the others (their mean is taken out), which adds a few per cent
    assert one == pytest.approx(2.0, rel=0.08)
    assert every == pytest.approx(2.5, rel=0.08)


def test_what_hangs_on_no_rate_leaves_the_bands_out():
    rng = np.random.default_rng(9)
    names = (*BANDS, "x.skewness", "y.skewness")
    rows = np.hstack([resonant(np.ones(400), rng), rng.standard_normal((400, 2))])
    cloud = fit_familiarity(names, rows, np.arange(400))
    lost, odd = rows[0].copy(), rows[0].copy()
    lost[4:8] -= 40  # the upper bands of a channel
    odd[-2:] = 6.0
    found = cloud.by_kind(names, np.array([rows[0], lost, odd]))
    np.testing.assert_allclose(
        found.mean(axis=1), cloud.distance(names, np.array([rows[0], lost, odd]))
    )
    whole, without, strange = (free_distance(names, apart) for apart in found)
    assert without == pytest.approx(whole, rel=1e-12)
    assert strange > 5  # six standard deviations in both of two
    assert cloud.distance(names, lost[None])[0] > 2 * cloud.distance(names, rows[:1])[0]
    only_bands = fit_familiarity(BANDS, rows[:, :16], np.arange(400))
    assert np.isnan(free_distance(BANDS, only_bands.by_kind(BANDS, rows[:1, :16])[0]))


def test_familiarity_survives_constant_features():
    rng = np.random.default_rng(5)
    cloud = cloud_of(np.column_stack([rng.standard_normal(50), np.full(50, 7.0)]))
    assert np.isfinite(distances(cloud, np.array([[0.0, 7.0], [0.0, 8.0]]))).all()


def test_the_nearest_machine_is_the_one_it_comes_from():
    rng = np.random.default_rng(6)
    groups = np.repeat(np.arange(100, 130), 4)
    own = rng.standard_normal((30, 10))
    rows = own[groups - 100] + 0.1 * rng.standard_normal((120, 10))
    cloud = fit_familiarity(NAMES[:10], rows, groups)
    found = [cloud.nearest(NAMES[:10], row + 0.1 * rng.standard_normal(10))[0] for row in rows]
    assert np.mean(np.array(found) == groups) > 0.95
    group, distance = cloud.nearest(NAMES[:10], rows[groups == 107].mean(axis=0))
    assert group == 107
    assert distance == pytest.approx(0, abs=1e-9)


def test_p_value_of_familiar_recordings_is_uniform():
    rng = np.random.default_rng(3)
    values = [novelty_p_value(d[0], d[1:]) for d in rng.standard_normal((4000, 100))]
    # a conformal p-value is uniform on k/100; 4 standard errors of the share are 0.019
    assert np.mean(np.array(values) <= 0.1) == pytest.approx(0.1 * 100 / 101, abs=0.02)


def test_another_machine_made_to_match_is_refused(small_model, small_set, tmp_path):
    """A sample of tests/benchmarks/strangers.py: journals in the rate and channels of the pump."""
    from wearstate.datasets.generation.generate import generate
    from wearstate.diagnose.wear_model.file import load_model

    script = runpy.run_path(str(Path(__file__).parent / "benchmarks" / "strangers.py"))
    journals = tmp_path / "journals.h5"
    generate("journal-bearing-small", 4, journals, seed=0)
    with DataSet(small_set) as data:
        own, speeds = data[0], data.manifest["speed_hz"].to_numpy()
    strangers = script["of_machine"](journals, 4, own, speeds, np.random.default_rng(0))
    told = script["campaign"](load_model(small_model), strangers)
    assert told["journals, stretched"] == {"unfamiliar": 4}
    assert set(told["journals, own time"]) <= {"unfamiliar", "no features"}


# --- outside the trained ranges


def test_more_records_do_not_make_features_outside_the_range_count_more():
    """A tenth of the features outside is as strange to a model of 10,000 records as of 1,000."""
    apart, outside = np.linspace(0.0, 2.0, 1001), np.linspace(0.0, 0.02, 1001)
    weights = [outside_weight(apart, factor * outside)[0] for factor in (5, 2, 1, 0.1, 0)]
    far = np.quantile(apart, 0.99)
    assert weights[0] * 0.1 * 0.99 == pytest.approx(far)
    assert weights[1] < weights[2] == weights[3] == weights[4]
    assert weights[4] * 0.03 == pytest.approx(far)


def test_features_outside_their_range_are_a_caution_that_names_them(small_trained):
    model, table, _ = small_trained
    cloud = model.familiarity
    row = table.values[table.manifest["grade"].to_numpy().argmin()].copy()
    most = int(cloud.seldom_outside * len(model.names) + 1e-9)
    cells = [i for i, name in enumerate(model.names) if ".band_" in name]
    inside = ((row >= cloud.low) & (row <= cloud.high)).all()
    assert inside
    assert "are outside all that was trained on" not in " ".join(model.judge(row).cautions)
    assert len(cells) > most
    for place, i in enumerate(cells[: most + 1]):
        row[i] = cloud.high[i] + (0.01 + 0.001 * place) * (cloud.high[i] - cloud.low[i])
    found = model.judge(row)
    said = " ".join((*found.cautions, *found.reasons))
    assert f"{most + 1} of {len(model.names)} features are outside all that was trained on" in said
    farthest = model.names[cells[most]]
    assert f"at most {most}: {feature_words(farthest)} {row[cells[most]]:.3g} dB, trained " in said
    row[cells[0]] = cloud.high[cells[0]]
    found = model.judge(row)
    assert "are outside all" not in " ".join((*found.cautions, *found.reasons))


# --- too quiet


def test_a_machine_that_does_not_knock_is_refused_by_name(small_trained):
    """A flooded pin: the same shape, peaks far below; a dry one of the same speed is graded."""
    model, table, _ = small_trained
    row = table.values[table.manifest["grade"].to_numpy().argmin()].copy()
    assert model.judge(row).verdict != "unfamiliar"
    cloud = model.familiarity
    peaks = [i for i, name in enumerate(model.names) if name.endswith(".peak")]
    assert peaks
    lack = float(cloud.lacking(model.names, row[None, :])[0])
    for beyond, verdict in ((-0.5, {"graded", "caution"}), (0.5, {"unfamiliar"})):
        quiet = row.copy()
        quiet[peaks] *= 10 ** ((lack - cloud.most_lacking - beyond) / 20)
        found = model.judge(quiet)
        said = " ".join(found.reasons)
        assert found.verdict in verdict, said
        told = "flooded pins, which do not knock, are not in this model" in said
        assert told == (found.verdict == "unfamiliar")


def test_few_of_its_own_machines_are_too_quiet_for_a_model(small_trained):
    model, table, _ = small_trained
    lacking = model.familiarity.lacking(model.names, table.values)
    # 2 % of the training set by the calibration, and as many again by chance in so few
    assert (lacking > model.familiarity.seldom_lacking).mean() <= 0.04
    assert model.familiarity.seldom_lacking <= model.familiarity.most_lacking


# --- noise floor


def turning(recording):
    return recording.signal[recording.names.index(recording.tacho)]


def edges_of(names):
    """Of the bands of the crank-angle map [Hz]."""
    cells = re.findall(r"x\.angle_000_010\.band_(\d+)_(\d+)", " ".join(names))
    return [(float(low), float(high)) for low, high in cells]


def test_the_floor_of_noise_is_its_level_in_each_band(recording):
    """White noise alone: the same energy at all angles, so the quiet ones tell its density."""
    rms = 3.0
    noise = np.random.default_rng(5).normal(0.0, rms, recording.signal.shape[1])
    names, row = feature_row(noise, 25_600.0, tacho=turning(recording), channel_names=["x"])
    [floor] = noise_floors(names, row[None]).values()
    widths = [b - a for a, b in edges_of(names)]
    wanted = 10 * np.log10(rms**2 * np.array(widths) / 12_800)
    # levels of narrow bands scatter by some decibels over few turns, and quiet angles are below
    assert np.abs(floor[0] - wanted).max() < 4.0
    assert np.median(floor[0] - wanted) == pytest.approx(-1.0, abs=1.0)


def test_a_noisy_sensor_is_a_caution_that_names_it(small_trained, recording):
    """Ten decibels below the signal: between knocks nothing but noise is left."""
    model, _, _ = small_trained
    assert "noise floor" not in " ".join(model.estimate(recording).cautions)
    rng = np.random.default_rng(6)
    signal = recording.signal.astype(float)
    own = recording.names.index("acc_y")
    signal[own] += rng.normal(0.0, 10**-0.5 * signal[own].std(), signal.shape[1])
    said = model.estimate(replace(recording, signal=signal.astype(np.float32)))
    assert said.verdict == "caution"
    assert [text for text in said.cautions if text.startswith("the noise floor of acc_y")]


def test_a_cleaner_sensor_than_any_known_is_as_good_as_the_cleanest(small_trained):
    """A model that has never seen silence between knocks must not refuse it."""
    model, _, _ = small_trained
    noiseless = {f"sensors.{i}.noise": "0 m/s^2" for i in range(2)}
    clean, usual = (
        simulate(load_scene("bilge-pump", changes), seed=3) for changes in (noiseless, {})
    )
    said = model.estimate(clean)
    assert said.graded
    assert said.severity == pytest.approx(model.estimate(usual).severity, rel=0.05)
    row = model._row(clean, None)
    lifted = lifted_rows(model.names, row[None, :], model.familiarity.least_noise)
    raw, filled = (model.familiarity.outside(each)[0] for each in (row[None, :], lifted))
    assert raw > 0.2  # of the features, which many machines in training would call unfamiliar
    assert filled < 0.05
    assert model._look(row).distance < model.familiarity.distance(model.names, row[None, :])[0]


def test_evidence_is_of_the_recording_as_it_is(small_trained):
    """Against itself, a clean recording has not moved at all."""
    model, _, _ = small_trained
    noiseless = {f"sensors.{i}.noise": "0 m/s^2" for i in range(2)}
    row = model._row(simulate(load_scene("bilge-pump", noiseless), seed=3), None)
    assert {moved for *_, moved in model.judge(row, row).evidence} == {0.0}


def test_rows_with_noise_enough_stay_as_they_are(small_trained):
    model, table, _ = small_trained
    least = model.familiarity.least_noise
    lifted = lifted_rows(model.names, table.values, least)
    lacking = [f < w for f, w in zip(_floors(model.names, table.values), least, strict=True)]
    assert 0.01 < np.mean(lacking) < 0.03
    enough = ~np.any(lacking, axis=0)
    assert enough.any()
    assert (lifted[enough] == table.values[enough]).all()
    assert (lifted >= table.values).all()
    np.testing.assert_allclose(lifted_rows(model.names, lifted, least), lifted, atol=1e-5)


def _floors(names, rows):
    return np.hstack(list(noise_floors(names, rows).values())).T


def test_a_channel_without_a_map_is_lifted_to_the_density_of_its_quiet_bands():
    """White noise of 0.1 per hertz beneath one line, and the same line without noise."""
    names = [f"a.band_{f}_{2 * f}.level_db" for f in (10, 20, 40, 80, 160)]
    widths = np.array([10.0, 20.0, 40.0, 80.0, 160.0])
    line = np.array([0.0, 0.0, 500.0, 0.0, 0.0])
    noisy, clean = (10 * np.log10(line + d * widths)[None] for d in (0.1, 1e-9))
    least = fit_least(names, noisy)
    assert least == pytest.approx([-10.0])
    np.testing.assert_allclose(lifted_rows(names, clean, least), noisy, atol=1e-6)
    np.testing.assert_array_equal(lifted_rows(names, noisy, least), noisy)


@pytest.mark.parametrize("sensitivity", [1e-3, 1.0])
def test_noise_is_filled_up_only_after_a_wrong_sensitivity_is_seen(small_trained, sensitivity):
    """A channel in other units is quiet as well; that is for the check of levels to find."""
    model, _, _ = small_trained
    usual = simulate(load_scene("bilge-pump"), seed=3)
    signal = usual.signal * np.where(np.array(usual.names) == "acc_y", sensitivity, 1.0)[:, None]
    said = model.estimate(replace(usual, signal=signal.astype(np.float32)))
    assert any("acc_y" in fault.text for fault in said.faults) == (sensitivity < 1)
    assert said.graded == (sensitivity == 1)


def test_a_channel_that_lacks_its_highest_band_is_a_caution(small_trained):
    """The same knocks through a low pass: the wear is read from what is gone as well."""
    model, _, _ = small_trained
    usual = simulate(load_scene("bilge-pump"), seed=3)
    assert "limits its band" not in " ".join(model.estimate(usual).cautions)
    own = usual.names.index("acc_x")
    signal = usual.signal.astype(float)
    signal[own] = sosfilt(butter(4, 4000.0, fs=usual.sample_rate, output="sos"), signal[own])
    said = model.estimate(replace(usual, signal=signal.astype(np.float32)))
    told = [text for text in said.cautions if "limits its band" in text]
    assert len(told) == 1
    assert told[0].startswith("acc_x is ")
    row = model._row(replace(usual, signal=signal.astype(np.float32)), None)
    [found] = cut_off(model.names, row, model.familiarity.tops)
    assert found.channel == "acc_x"
    # digital, of the fourth order: 80 lg(tan(pi 8762 / 25600) / tan(pi 4000 / 25600)) at its edge;
    # the line knows the highest band of this machine, whole, to some 7 dB
    assert found.lacking_db == pytest.approx(43.0, abs=8.0)


def test_three_oddities_at_once_are_no_familiar_machine(small_trained, recording):
    """Each by itself is a caution; no familiar recording has three."""
    model, _, _ = small_trained
    signal = recording.signal.astype(float)
    own = [recording.names.index(name) for name in ("acc_x", "acc_y")]
    low_pass = butter(4, 4000.0, fs=recording.sample_rate, output="sos")
    signal[own[0]] = sosfilt(low_pass, signal[own[0]])
    noise = np.random.default_rng(6).normal(0.0, 10**-0.5 * signal[own[1]].std(), signal.shape[1])
    signal[own[1]] += noise
    noted = {**recording.row, "discharge_pressure_pa": 9e5}
    said = [
        model.estimate(replace(recording, signal=changed.astype(np.float32)), conditions=row)
        for changed in (recording.signal, signal)
        for row in (recording.row, noted)
    ]
    assert [each.verdict for each in said[:3]] == ["graded", "caution", "caution"]
    assert said[3].verdict == "unfamiliar"
    assert said[3].reasons[0].startswith("it is unlike the training recordings in 3 ways at once")
    assert len(said[3].reasons) == 4


def test_few_of_its_own_machines_lack_a_band(small_trained):
    model, table, _ = small_trained
    cut = [bool(cut_off(model.names, row, model.familiarity.tops)) for row in table.values]
    assert np.mean(cut) <= 0.04  # half a per cent of each channel in the fit; of 120, some more


def test_few_of_its_own_machines_are_too_noisy_for_a_model(small_trained):
    model, table, _ = small_trained
    cloud = model.familiarity
    noisy = cloud.noise(model.names, table.values) > cloud.most_noise
    # 1 % by the calibration on machines left out; those of the training set fit better
    assert noisy.mean() <= 0.02


def test_a_model_without_a_map_has_no_floor():
    rows = np.random.default_rng(7).standard_normal((50, 2))
    cloud = cloud_of(rows)
    assert cloud.floor_ceiling.size == 0
    assert noisiest(NAMES[:2], rows[0], cloud.floor_ceiling) is None
    assert (cloud.noise(NAMES[:2], rows) < -1000).all()
