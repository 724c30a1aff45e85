"""Recordings of your own: brought to one rate, named conditions learnt, judged by recording."""

import glob
import json
import re
import shlex
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured.data_set import import_recordings
from wearstate.datasets.measured.labels import read_labels
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source.part import SourceOptions
from wearstate.datasets.split.rules import group_folds
from wearstate.diagnose.class_model.file import load_class_model, save_class_model
from wearstate.diagnose.class_model.text import naming_text, namings_summary
from wearstate.diagnose.class_model.train import (
    _clouds,
    _left_out_distances,
    _nearest_distance,
    evaluate_classes,
    train_classes,
)
from wearstate.diagnose.class_model.votes import Votes, set_of
from wearstate.diagnose.feature_rows.blows import NOISE_SCORE, blow_scores
from wearstate.diagnose.feature_rows.feature_table import feature_table, recording_features
from wearstate.diagnose.wear_model.bundle import ModelError
from wearstate.diagnose.wear_model.file import load_model
from wearstate.sim.output.recording import DataError

from .command_line import run

RATE = 4000.0


def tone(path, hz, rate, seconds=1.0):
    n = round(seconds * rate)
    np.save(path, np.sin(2 * np.pi * hz * np.arange(n) / rate)[None, :])
    return path


@pytest.mark.parametrize(("rate", "to"), [(8000.0, 4000.0), (10_000.0, 4000.0), (6000.0, 4000.0)])
def test_a_tone_keeps_its_samples_at_another_rate(tmp_path, rate, to):
    """Against the closed form: the same sine sampled at the new rate."""
    path = tone(tmp_path / "x.npy", 700.0, rate)
    with open_source(path, SourceOptions(fs=rate, unit="m/s^2", resample_to=to)) as source:
        whole = source.read()[0]
        piece = source.read(1001, 1502)[0]
        assert source.sample_rate == to
        assert source.conditions["sample_rate_in_file_hz"] == rate
    wanted = np.sin(2 * np.pi * 700.0 * np.arange(len(whole)) / to)
    # the filter's ripple of 80 dB; its length fades the ends
    assert np.abs(whole - wanted)[100:-100].max() < 2e-4
    assert np.allclose(piece, whole[1001:1502], atol=1e-12)  # rounding


@pytest.mark.parametrize(("hz", "least", "most"), [(1800.0, 0.998, 1.002), (2100.0, 0, 2e-4)])
def test_what_the_new_rate_cannot_hold_is_gone_and_the_rest_is_kept(tmp_path, hz, least, most):
    path = tone(tmp_path / "x.npy", hz, 8000.0)
    with open_source(path, SourceOptions(fs=8000.0, unit="m/s^2", resample_to=4000.0)) as source:
        level = np.sqrt(2) * source.read()[0][200:-200].std()
    assert least <= level <= most  # 0.01 dB in the band, 80 dB beyond


@pytest.mark.parametrize(
    ("to", "text"),
    [
        (7999.0, "ratio of whole numbers"),
        (8001.0, "nearest 8"),
        (-1.0, ">= 0.001"),
        (8e98, "1e.08"),
    ],
)
def test_rates_that_cannot_be_had_are_refused(tmp_path, to, text):
    path = tone(tmp_path / "x.npy", 700.0, 8000.0)
    with pytest.raises(DataError, match=text):
        open_source(path, SourceOptions(fs=8000.0, unit="g", resample_to=to))


# --- named conditions ---------------------------------------------------------------------------


def made(folder, name, *, seed, hz, n=4, rate=RATE):
    """Files of noise in which a resonance rings; the machines differ in level."""
    rng = np.random.default_rng(seed)
    paths = []
    for i in range(n):
        x = rng.standard_normal(round(2 * rate))
        t = np.arange(round(0.05 * rate)) / rate
        ring = np.exp(-200 * t) * np.sin(2 * np.pi * hz * t)
        x = rng.uniform(0.5, 2.0) * (np.convolve(x, ring)[: len(x)] + 0.1 * x)
        np.save(folder / f"{name}_{i}.npy", x[None, :])
        paths.append(folder / f"{name}_{i}.npy")
    return paths


def own_set(folder, kinds, *, name="own.h5", seed=0):
    """Data set of recordings by kind -> frequency of the resonance [Hz]."""
    files = {kind: made(folder, kind, seed=seed + i, hz=hz) for i, (kind, hz) in enumerate(kinds)}
    table = folder / "labels.csv"
    rows = [f"{path.name},{kind}" for kind, paths in files.items() for path in paths]
    table.write_text("file,condition\n" + "\n".join(rows) + "\n")
    import_recordings(
        [path for paths in files.values() for path in paths],
        folder / name,
        options=SourceOptions(fs=RATE, unit="m/s^2", channels=("acc",)),
        labels=read_labels(table),
        segment=0.5,
        force=True,
    )
    return folder / name


KINDS = (("cracked", 900.0), ("sound", 500.0))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    path = own_set(tmp_path_factory.mktemp("own"), KINDS)
    return path, *train_classes(path, target="condition", seed=0)


def test_conditions_that_differ_are_told_apart_by_recordings_left_out(trained):
    _path, model, result = trained
    assert model.classes == ("cracked", "sound")
    assert "chance" not in model.notice
    assert (result["recordings_right"], result["recordings_judged"]) == (8, 8)
    # of 8 recordings nobody can say more than this, however right they are
    assert result["recordings_interval"][0] == pytest.approx(0.025 ** (1 / 8))
    # four recordings of a class promise 4 / 5 at most
    assert result["nominal_coverage"] == {"cracked": 0.8, "sound": 0.8}
    json.dumps(result, allow_nan=False)


def test_conditions_that_do_not_differ_are_not_told_apart(tmp_path):
    """Windows of one recording are alike, which must be of no help."""
    path = own_set(tmp_path, (("a", 700.0), ("b", 700.0)), seed=5)
    model, result = train_classes(path, target="condition", seed=0)
    assert "the largest class alone would give 0.50: that may be chance" in model.notice
    assert result["accuracy"] < 0.85
    assert result["recordings_right"] <= 6  # 7 or 8 of 8 by chance: 9 in 256


def test_the_file_gives_the_same_answers_and_the_seed_the_same_bytes(trained, tmp_path):
    path, model, _result = trained
    save_class_model(model, tmp_path / "a.wsm")
    again, _ = train_classes(path, target="condition", seed=0)
    save_class_model(again, tmp_path / "b.wsm")
    assert (tmp_path / "a.wsm").read_bytes() == (tmp_path / "b.wsm").read_bytes()
    read = load_class_model(tmp_path / "a.wsm")
    with DataSet(path) as data:
        assert read.estimate(data[0]) == model.estimate(data[0])
        assert read.estimate(data[0]).name == "cracked"
        assert read.estimate(data[0].signal, fs=RATE) == read.estimate(data[0])
    with pytest.raises(ModelError, match="is a class model, must be a wear model"):
        load_model(tmp_path / "a.wsm")


def test_a_recording_of_something_else_is_unfamiliar(trained, tmp_path):
    model = trained[1]
    other = own_set(tmp_path, (("hum", 100.0), ("hiss", 1700.0)), seed=9)
    with DataSet(other) as data:
        verdicts = [model.estimate(data[i]).verdict for i in range(len(data))]
    assert verdicts.count("unfamiliar") >= 0.9 * len(verdicts)


def test_a_name_of_a_recording_with_a_gap_comes_with_a_caution(trained):
    with DataSet(trained[0]) as data:
        item = data[0]
    assert trained[1].estimate(item).cautions == ()
    signal = item.signal.copy()
    signal[0, 500:600] = 0.0
    told = trained[1].estimate(replace(item, signal=signal))
    assert told.verdict != "unusable"
    [caution] = told.cautions
    assert "samples were lost" in caution
    assert f"caution: {caution}" in naming_text(told)


def test_a_condition_near_a_trained_one_is_none_of_them(trained, tmp_path):
    """Held against each class by itself; in one cloud over all classes 10 of these 16 would be."""
    model = trained[1]
    near = own_set(tmp_path, (("near", 1300.0), ("same", 500.0)), seed=9)
    with DataSet(near) as data:
        told = [model.estimate(item) for item in data]
    assert [t.verdict for t in told[:16]].count("unfamiliar") >= 14
    # exchangeable with the trained ones: of nine recordings one may be refused, here of four
    assert [t.verdict for t in told[16:]].count("named") >= 12
    assert told[0].p_limit == pytest.approx(1 / 9)
    assert told[0].p_value <= told[0].p_limit
    assert (
        "trained on 8 recordings, must be >= 10 to recognise unfamiliar recordings" in model.notice
    )
    assert namings_summary(told[:1]) == "no condition is named, 1 recordings: 1 unfamiliar"


def test_a_measured_condition_that_was_held_out_is_mostly_unfamiliar(realdata):
    """Inner-race faults before a model of outer-race faults and the sound bearing."""
    [folder] = realdata.glob("mfpt_*")
    options = SourceOptions(resample_to=48828.0)
    labels = {"Outer": "outer", "baseline": "healthy"}
    with TemporaryDirectory() as place:
        path = Path(place) / "two.h5"
        files = sorted(f for f in folder.glob("*.mat") if "Inner" not in f.name)
        table = Path(place) / "labels.csv"
        rows = [f"{f.name},{next(v for k, v in labels.items() if k in f.name)}" for f in files]
        table.write_text("file,condition\n" + "\n".join(rows) + "\n")
        import_recordings(files, path, options=options, labels=read_labels(table), segment=0.25)
        found = feature_table(path)
        strange = Path(place) / "inner.h5"
        import_recordings(sorted(folder.glob("Inner*.mat")), strange, options=options, segment=0.25)
        other = feature_table(strange)
    groups = found.manifest["group"].to_numpy()
    _, truth = np.unique(found.manifest["condition"], return_inverse=True)
    clouds = _clouds(found, truth, groups, np.arange(len(groups)))
    folds = group_folds(groups, n=len(np.unique(groups)), seed=0)
    distance = _left_out_distances(found, truth, groups, folds)
    votes = Votes(
        shares=np.ones((len(groups), 1)),
        label=truth,
        group=groups,
        distance=distance,
        blows=np.zeros((len(groups), 1)),
    )
    far = _nearest_distance(clouds, other.names, other.values)
    assert np.mean([votes.p_value(value) <= votes.p_limit for value in far]) > 0.5
    # the trained ones themselves, each by clouds without it: one recording in six at most
    own = [votes.p_value(value) <= votes.p_limit for value in distance]
    assert np.mean(own) <= 1 / 6


def test_a_measured_sound_bearing_has_no_blows_and_is_neither_fault(realdata, tmp_path):
    """Before a model of the two damaged races: what no distance between features tells."""
    [folder] = realdata.glob("mfpt_*")
    options = SourceOptions(resample_to=48828.0)
    files = sorted(folder.glob("*Fault*.mat"))
    table = tmp_path / "labels.csv"
    table.write_text("file,race\n" + "".join(f"{f.name},{f.name[:5].lower()}\n" for f in files))
    path, sound = tmp_path / "faults.h5", tmp_path / "sound.h5"
    import_recordings(files, path, options=options, labels=read_labels(table), segment=1.0)
    import_recordings([folder / "baseline_1.mat"], sound, options=options, segment=1.0)
    model, result = train_classes(path, target="race", seed=0)
    with DataSet(sound) as data:
        told = [model.estimate(item) for item in data]
    assert {naming.verdict for naming in told} == {"unfamiliar"}
    assert "without the blows of every recording of outer" in told[0].reasons[0]
    # by blows none; by distance one recording of eight may be
    assert result["called_unfamiliar"] <= 1 / 8
    assert min(model.votes.blow_floors.ravel()) > 3 * NOISE_SCORE


def struck(folder, name, *, seed, rate_hz, n=4, loudness=0.8):
    """Files of noise, and of blows that come back at a rate of the class's own."""
    rng = np.random.default_rng(seed)
    paths = []
    for i in range(n):
        x = rng.standard_normal(round(2 * RATE))
        t = np.arange(200) / RATE
        ring = np.exp(-300 * t) * np.sin(2 * np.pi * 1200 * t)
        train = np.zeros(x.size)
        if loudness:
            train[:: round(RATE / rate_hz)] = 1.0
        blows = np.convolve(train, ring)[: x.size]
        x += loudness * rng.uniform(0.8, 1.2) * blows / max(blows.std(), 1e-9)
        np.save(folder / f"{name}_{i}.npy", x[None, :])
        paths.append(folder / f"{name}_{i}.npy")
    return paths


def test_a_recording_without_the_blows_of_every_class_is_of_none(tmp_path):
    files = [
        path
        for kind, hz in (("inner", 30.0), ("outer", 18.0))
        for path in struck(tmp_path, kind, seed=int(hz), rate_hz=hz)
    ]
    table = tmp_path / "labels.csv"
    table.write_text("file,kind\n" + "".join(f"{f.name},{f.name[:5]}\n" for f in files))
    shared = {"options": SourceOptions(fs=RATE, unit="g", channels=("acc",)), "segment": 0.5}
    import_recordings(files, tmp_path / "x.h5", labels=read_labels(table), **shared)
    model, result = train_classes(tmp_path / "x.h5", target="kind")
    assert (model.votes.blow_floors > 2 * NOISE_SCORE).all()
    assert result["called_unfamiliar"] <= 1 / 8  # what the distance alone may refuse
    sound = struck(tmp_path, "sound", seed=1, rate_hz=1.0, loudness=0.0)
    import_recordings(sound, tmp_path / "sound.h5", **shared)
    save_class_model(model, tmp_path / "x.wsm")
    read = load_class_model(tmp_path / "x.wsm")
    with DataSet(tmp_path / "sound.h5") as data:
        scores = np.array([blow_scores(item) for item in data])
        assert {read.estimate(item).verdict for item in data} == {"unfamiliar"}
    assert (scores <= NOISE_SCORE).all()
    with DataSet(tmp_path / "x.h5") as data:
        row = recording_features(data[0])[1]
        assert read.judge(row, blow_scores(data[0])).name == "inner"
    # blows are held against by themselves: no feature needs to be far
    naming = read.judge(row, scores[0])
    assert naming.verdict == "unfamiliar"
    assert re.match(
        r"without the blows of every recording of inner.*noise has up to 7", *naming.reasons
    )


def test_new_recordings_are_judged_and_known_ones_are_not(trained, tmp_path):
    path, model, _result = trained
    fresh = own_set(tmp_path, KINDS, seed=20)
    result = evaluate_classes(model, fresh)
    assert (result["recordings"], result["recordings_right"]) == (8, 8)
    with pytest.raises(DataError, match="has not seen"):
        evaluate_classes(model, path)


def test_the_report_names_one_or_many_and_refuses_what_is_of_wear(trained, tmp_path):
    path, model, _result = trained
    save_class_model(model, tmp_path / "a.wsm")
    common = ("--model", tmp_path / "a.wsm")
    one = run("report", path, "--record", 1, *common).stdout
    assert one.startswith("cracked; cannot be excluded: cracked")
    with DataSet(path) as data:
        names = [model.estimate(item).name for item in data]
    lines = [
        json.loads(line) for line in run("report", path, *common, "--json").stdout.splitlines()
    ]
    assert [line["name"] for line in lines] == names
    assert lines[1]["recording"] == f"{path.name}[1]"
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "cut.h5").write_bytes(path.read_bytes()[:5000])
    said = run("report", folder, *common, code=2).stdout
    assert said.startswith("folder: no condition is named, 1 recordings: 1 unusable\n")
    assert "cut.h5: unusable: file cannot be read" in said
    said = run("report", path, *common, "--fail-on", "alarm", "--trend", code=2).stderr
    assert "is a model of named conditions, without wear: leave out --fail-on, --trend" in said


def test_labels_that_cannot_be_learnt_are_refused(trained, tmp_path):
    with pytest.raises(DataError, match="target = 'kind' must be one of its columns"):
        train_classes(trained[0], target="kind")
    with pytest.raises(DataError, match="is a column of decimal numbers"):
        train_classes(trained[0], target="start_s")
    alone = own_set(tmp_path, (("a", 700.0),))
    with pytest.raises(DataError, match=r"1 classes of >= 3 recordings \(4 of a\), must be >= 2"):
        train_classes(alone, target="condition")


def test_a_set_is_never_empty():
    assert set_of(np.array([0.4, 0.3, 0.3]), np.array([0.9, 0.9, 0.9])) == (0,)


def blocks(page, kind):
    """Contents of the blocks of code of one kind."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE)
    return [text for name, text in found if name == kind]


def assert_same(said, shown):
    """The same words; figures but for their last digit, which may round the other way."""
    number = re.compile(r"\d+(?:\.\d+)?")
    assert number.sub("#", " ".join(said.split())) == number.sub("#", " ".join(shown.split()))
    wanted = [float(text) for text in number.findall(shown)]
    assert [float(text) for text in number.findall(said)] == pytest.approx(
        wanted, rel=0.02, abs=0.01
    )


def test_the_example_of_the_page_runs_as_written(realdata, tmp_path, monkeypatch):
    """Inner against outer race, measured; the healthy file has twice the rate of the others."""
    page = (Path(__file__).parents[1] / "docs" / "own-data.md").read_text()
    labels, *shown = blocks(page, "")
    [folder] = realdata.glob("mfpt_*")
    for file in folder.glob("*.mat"):
        (tmp_path / file.name).symlink_to(file)
    (tmp_path / "labels.csv").write_text(labels)
    monkeypatch.chdir(tmp_path)
    said = {}
    for line in "".join(blocks(page, "sh")).splitlines():
        _, *words = shlex.split(line)
        whole = [name for word in words for name in (sorted(glob.glob(word)) or [word])]
        said[" ".join(words[:2])] = run(*whole).stdout
    assert (
        "1. warning, bearings.h5: classes of condition with fewer than 3"
        in said["audit bearings.h5"]
    )
    assert "2. " not in said["audit bearings.h5"]
    assert_same(said["train bearings.h5"], shown[0])
    assert said["report OuterRaceFault_vload_7.mat"].startswith("outer;")
    assert_same(said["report baseline_1.mat"], shown[1])
    refused = run("report", "baseline_1.mat", "--model", "bearings.wsm", code=2).stdout
    assert "sampled at 97656 Hz, the model needs 48828 Hz" in refused
    assert "has not seen" in run("evaluate", "bearings.wsm", "bearings.h5", code=2).stderr
