"""Features of a model: named, chosen by folds, kept in its card and used wherever it judges."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.split.rules import group_folds
from wearstate.diagnose.feature_rows.feature_choice import choice_in, choices_of, select_set
from wearstate.diagnose.feature_rows.feature_table import (
    USUAL,
    FeatureSelection,
    held_against,
    recording_features,
)
from wearstate.diagnose.feature_rows.model_card import FeatureChoice, ModelCard
from wearstate.diagnose.healthy_reference.healthy import Baselines
from wearstate.diagnose.healthy_reference.transfer_reference import HealthyTransfer
from wearstate.diagnose.wear_model.bundle import ModelError, load_bundle
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.train import train_model
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

from .command_line import run

FS, N = 2560.0, 10_240
COLUMN = "sag_support_m"
LIMIT = 5e-4
CHANNELS = (
    Channel(name="force", unit="N", quantity="force"),
    Channel(name="one", unit="m/s^2", quantity="acceleration"),
    Channel(name="two", unit="m/s^2", quantity="acceleration"),
)


def pushed(path, *, machines=40, healthy=False, blows=0):
    """Tests of machines of two masses, whose support softens by its sag; nothing else is alike."""
    s = 2j * np.pi * np.fft.rfftfreq(N, 1 / FS)
    head = Attributes(
        sample_rate=FS, channels=CHANNELS, origin="measured", severities=(COLUMN,),
        grade_edges=(1e-4, 2e-4, 4e-4), condemning_limit=LIMIT, limit_source="drawing",
    )  # fmt: skip
    columns = {COLUMN: "<f8", "group_name": "S8"}
    with DataSetWriter(path, head, n_records=machines, n_samples=N, columns=columns) as writer:
        for i in range(machines):
            machine = np.random.default_rng(i)
            rng = np.random.default_rng([i, int(healthy)])
            sag = 1e-6 if healthy else LIMIT * machine.uniform(0.02, 1)
            soft, ground = 4e6 * machine.uniform(0.97, 1.03, 2)
            ground *= 1 - 0.5 * sag / LIMIT
            push = rng.uniform(0.1, 10) * rng.standard_normal(N)
            if blows:
                push = 100.0 * np.isin(np.arange(N), np.arange(blows) * 1200 + 500)
            one, two = (m * s**2 + 60 * s + soft + k for m, k in ((2, 4e6), (3, ground)))
            motion = np.stack([two, np.full_like(s, soft)]) / (one * two - soft**2) * s**2
            rows = np.fft.irfft(motion * np.fft.rfft(push), N)
            rows += 0.05 * rows.std() * rng.standard_normal(rows.shape)
            row = {"record_id": f"r{i}", "group": i, "status": "ok", "group_name": f"rig{i}"}
            row |= {COLUMN: sag, "grade": int(np.searchsorted(head.grade_edges, sag))}
            writer.write(i, np.vstack([push, rows]), row)
        writer.finish()
    return path


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return pushed(tmp_path_factory.mktemp("tests") / "data.h5")


# --- what is said


def test_words_name_sets_names_and_files(tmp_path):
    file = tmp_path / "mine.txt"
    file.write_text("rms  # of every channel\n\nfrf_profile, speed\n")
    assert choices_of([]) == (USUAL,)
    assert choices_of(["complete,standard"]) == (USUAL, FeatureSelection(feature_set="complete"))
    assert [c.feature_set for c in choices_of(["select"])] == ["standard", "core", "complete"]
    assert choices_of([str(file)]) == (FeatureSelection(only=("rms", "frf_profile", "speed")),)
    assert choices_of(["rms", "core", "rms"]) == (
        FeatureSelection(only=("rms",)),
        FeatureSelection(feature_set="core"),
    )
    with pytest.raises(DataError, match="must hold sets or names, holds both"):
        choices_of(["core,rms"])
    with pytest.raises(DataError, match="names 0 features"):
        choices_of([" , "])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--features", "frf_profil"), "did you mean frf_profile?"),
        (("--features", "order_levels"), "tacho = none must be there"),
        (("--features", "standard", "--features", "core,rms"), "holds both"),
        (("--features", "speed_variation,nonsense"), "feature 'nonsense' is unknown"),
        (("--features", "rms"), "levels alone"),
    ],
)
def test_what_cannot_be_trained_on_is_refused(data, tmp_path, options, message):
    result = run("train", data, "-o", tmp_path / "m.wsm", "-j", 1, *options, code=2)
    assert message in result.stderr
    assert not (tmp_path / "m.wsm").exists()


def test_what_a_single_blow_leaves_undefined_is_refused(tmp_path):
    path = pushed(tmp_path / "blows.h5", machines=12, blows=1)
    with pytest.raises(DataError, match=r"undefined in some .* as one\.frf\.coh"):
        train_model(path, choices=choices_of(["core"]), budget_ms=0.1)


# --- what is kept and used


def test_a_model_keeps_its_features(data, tmp_path):
    path = tmp_path / "m.wsm"
    ways = ("--features", "frf_profile,antiresonances", "--budget-ms", 0.1, "-j", 1)
    told = json.loads(run("train", data, "-o", path, *ways, "--json").stdout)
    assert told["features"]["only"] == ["frf_profile", "antiresonances"]
    assert told["features"]["ms_per_record"][0] > 0
    model = load_model(path)
    choice = choice_in(model.card.feature_choice)
    assert len(model.names) == 2 * (72 + 6)
    with DataSet(data) as records:
        recording = records[3]
    estimate = model.estimate(recording)
    row = recording_features(recording, choice)[1]
    assert estimate.severity == pytest.approx(model.predict(row[None])[0])
    assert abs(estimate.severity - recording.row[COLUMN]) < 0.1 * LIMIT
    # judged again, in folds of its own, and reported: always on the same features
    judged = run("evaluate", path, data, "--quick", "--json", "-j", 1)
    assert json.loads(judged.stdout)["records"] == 10
    again = run("evaluate", path, data, "--quick", "--retrain", "random", "--json", "-j", 1)
    assert json.loads(again.stdout)
    report = run("report", data, "--model", path, "--record", 3, "--json")
    assert "frf_profile, antiresonances" in report.stdout


def test_an_older_model_has_the_standard_set(data, tmp_path):
    model, table, _ = train_model(data, budget_ms=0.1)
    assert model.card.feature_choice.table() == {
        "set": "standard", "only": [], "candidates": [],
    }  # fmt: skip
    older = {key: value for key, value in model.card.table().items() if key != "feature_choice"}
    save_model(replace(model, card=ModelCard.model_validate(older)), tmp_path / "old.wsm")
    assert load_bundle(tmp_path / "old.wsm", "wear model").card == older  # nothing is added
    with DataSet(data) as records:
        assert load_model(tmp_path / "old.wsm").estimate(records[0]).severity is not None
    core = model.card.model_copy(update={"feature_choice": FeatureChoice(set="core")})
    other = replace(model, card=core)
    with DataSet(data) as records, pytest.raises(ModelError, match="features are not"):
        other.estimate(records[0])
    assert len(table.names) == len(model.names)


# --- the choice


def test_folds_choose_the_set_that_tells(data):
    choices = choices_of(["skewness,kurtosis", "frf_profile"])
    model, table, test = train_model(data, choices=choices, budget_ms=0.1)
    kept = model.card.feature_choice
    assert kept.only == ["frf_profile"]
    assert set(table.names) == set(model.names)
    poor, good = (each.line_mae_m for each in kept.candidates)
    assert good < 0.3 * poor
    error = np.abs(model.predict(table.values[test]) - table.manifest[COLUMN].to_numpy()[test])
    assert error.mean() < 0.04 * LIMIT
    alone, *_ = train_model(data, choices=choices[1:], budget_ms=0.1)
    assert_same(alone, model)


def assert_same(one, other):
    assert one.names == other.names
    np.testing.assert_array_equal(one.blind.calibration.estimate, other.blind.calibration.estimate)


def test_a_fold_knows_nothing_of_what_it_leaves_out():
    """Other truths of the records left out change the choice by all records, and not the fold's."""
    rng = np.random.default_rng(2)
    target = np.exp(0.3 * rng.standard_normal(24))
    sets = [rng.standard_normal((24, 1)) for _ in range(6)]
    groups = np.arange(24)
    folds = group_folds(groups, n=5, seed=2)
    left = folds[0][1]
    found = []
    for place in range(3):
        told = target.copy()
        told[left] = np.exp(2 * sets[place][left, 0])  # as this set would have it
        found.append(select_set(sets, told, groups, folds, seed=2))
    assert len({each.by_fold[0] for each in found}) == 1
    assert len({each.chosen for each in found}) > 1
    assert found[0].errors[found[0].chosen] <= 1.01 * min(found[0].errors)


# --- against the healthy machine


@pytest.fixture(scope="module")
def new(tmp_path_factory):
    return pushed(tmp_path_factory.mktemp("new") / "new.h5", healthy=True)


def test_a_referenced_model_is_told_against_the_healthy_machine(data, new, tmp_path):
    path = tmp_path / "m.wsm"
    ways = ("--baseline", new, "--budget-ms", 0.1, "-j", 1, "--json")
    run("train", data, "-o", path, "--features", "frf_assurance,frf_profile", *ways)
    model = load_model(path)
    assert model.mode == "referenced"
    assert model.names[-2:] == ("one.frf.assurance", "two.frf.assurance")
    with DataSet(data) as records:
        recording = records[3]
    baseline = Baselines(new, model.card).of(recording)
    sag = recording.row[COLUMN]
    assert abs(model.estimate(recording, baseline).severity - sag) < 0.1 * LIMIT
    # without healthy records there is no verdict, and the judge needs them, too
    assert model.estimate(recording).unreferenced
    judged = run("evaluate", path, data, "--quick", "--json", "-j", 1, "--baseline", new)
    assert json.loads(judged.stdout)["mae_all_m"] < 0.05 * LIMIT


def test_modes_are_told_against_those_of_the_healthy_machine(data, new):
    with DataSet(data) as records:
        sags = records.manifest[COLUMN].to_numpy()
        place = int(np.argmin(np.abs(sags - 0.3 * LIMIT)))
        recording = records[place]
    known = HealthyTransfer(path=new, modes=True).of(recording.machine)
    choice = held_against(FeatureSelection(only=("mode_changes", "frf_assurance")), known)
    row = dict(zip(*recording_features(recording, choice), strict=True))
    machine = np.random.default_rng(place)
    machine.uniform()
    soft, ground = 4e6 * machine.uniform(0.97, 1.03, 2)

    def natural(support):
        stiffness = [[soft + 4e6, -soft], [-soft, soft + support]]
        return np.sqrt(np.sort(np.linalg.eigvals(np.diag([1 / 2, 1 / 3]) @ stiffness)))

    shift = natural(ground * (1 - 0.5 * sags[place] / LIMIT)) / natural(ground) - 1
    told = [row[f"frf.mode_{k}.frequency_shift"] for k in (1, 2)]
    # 9 half-overlapped windows of noise of 5 % on either side
    np.testing.assert_allclose(told, shift, atol=0.01)
    assert shift[0] < -0.02
    assert 0.3 < row["one.frf.assurance"] < 0.98
    assert all(0.5 < row[f"frf.mode_{k}.mac"] <= 1 for k in (1, 2))


def test_a_worker_makes_its_own_references(new):
    known = HealthyTransfer(path=new, modes=True)
    first = known.of("machine rig0")
    sent = pickle.loads(pickle.dumps(known))
    assert sent == known
    again = sent.of("machine rig0")
    np.testing.assert_array_equal(again.value, first.value)
    assert again.modes.frequency.size >= 2
    assert known.of("machine rig99") is None
