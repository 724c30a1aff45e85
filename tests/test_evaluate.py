"""The evaluation: honest splits, what noise and training size do, page, text and JSON."""

import json
import re
import runpy
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.split.rules import check_no_leak
from wearstate.datasets.split.stored import Split, drawn_of, store_splits, usable_sides
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.evaluation import evaluate as judging
from wearstate.diagnose.evaluation import protocol
from wearstate.diagnose.evaluation import splits as module
from wearstate.diagnose.evaluation.evaluate import (
    P_LEVELS,
    evaluate_model,
    judge_rows,
    p_value_shares,
    score,
)
from wearstate.diagnose.evaluation.figure import evaluation_html, save_evaluation
from wearstate.diagnose.evaluation.protocol import costs, evaluate_splits, one_split
from wearstate.diagnose.evaluation.splits import (
    SPLITS,
    case_of,
    machine_distances,
    noisy_table,
    with_noise,
)
from wearstate.diagnose.evaluation.text import baseline_lines, score_lines, splits_text
from wearstate.diagnose.learning.scores import resampled
from wearstate.diagnose.wear_model import train as training
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.train import train_model
from wearstate.diagnose.wear_model.verdict import Estimate
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel

NAMES = ("random", "speed", "severity-beyond", "noise")  # of others, the rows are looked at
CHEAP_MS = 0.05  # ridges only: the protocol is tested, not the model


def with_features(patch, table):
    """Features of `small_set` are those of a table: they need not be computed again."""
    for place in (training, judging, module):
        patch.setattr(place, "feature_table", lambda path, **_: table)


@pytest.fixture(scope="module")
def trained(small_trained, small_set):
    with pytest.MonkeyPatch.context() as patch:
        with_features(patch, small_trained[1])
        return train_model(small_set, seed=0, budget_ms=CHEAP_MS)


@pytest.fixture(scope="module")
def case(trained, small_set):
    return case_of(trained[0], small_set, quick=True)  # with features of its own making


@pytest.fixture(scope="module")
def result(case):
    return evaluate_splits(case, NAMES)


def split_named(result, name):
    return next(split for split in result["splits"] if split["name"] == name)


# -- splits


@pytest.mark.parametrize("name", SPLITS)
def test_no_machine_is_on_both_sides(case, name):
    train, test = SPLITS[name][1](case)
    check_no_leak(case.groups, train, test)
    assert min(len(train), len(test)) > 0


def test_what_is_held_out_is_beyond_what_is_trained(case):
    for name, values in (
        ("speed", case.table.manifest["speed_hz"].to_numpy()),
        ("load", case.table.manifest["discharge_pressure_pa"].to_numpy()),
        ("severity-beyond", case.truth),
    ):
        train, test = SPLITS[name][1](case)
        assert values[train].max() < values[test].min(), name
    train, test = SPLITS["severity-gap"][1](case)
    low, high = case.truth[test].min(), case.truth[test].max()
    assert case.edges[1] <= low < high < case.edges[2]
    assert not ((case.truth[train] >= case.edges[1]) & (case.truth[train] < case.edges[2])).any()


def test_unusual_machines_are_drawn_again_as_they_were(case, small_set):
    """The distances belong to the machines of the file: its severities are drawn with them."""
    with DataSet(small_set) as data:
        drawn = drawn_of(data)
    distance = machine_distances(drawn)
    assert sorted(distance) == list(range(60))
    train, test = (case.groups[rows].tolist() for rows in SPLITS["geometry"][1](case))
    assert min(distance[group] for group in test) > max(distance[group] for group in train)
    with pytest.raises(DataError, match=r"record 0 redrawn has diametral_clearance"):
        machine_distances(replace(drawn, seed=drawn.seed + 1))
    with pytest.raises(DataError, match="no recipe to draw its machines"):
        machine_distances(replace(drawn, recipe=None))


def test_the_distance_of_a_machine_is_over_its_properties(case, monkeypatch):
    """By hand: a machine in the middle of everything is at 0, one in a corner at 1."""
    drawn = [(1.0, {"x": 0.0, "y": 8.0}), (2.0, {"x": 2.0, "y": 6.0}), (3.0, {"x": 4.0, "y": 6.0})]
    samples = [
        SimpleNamespace(group=9 - i, drawn={"gain": gain, "shape": shape})
        for i, (gain, shape) in enumerate(drawn)
    ]
    recipe = SimpleNamespace(machine=[SimpleNamespace(path="gain"), SimpleNamespace(path="shape")])
    monkeypatch.setattr(module, "machine_samples", lambda _: iter(samples))
    distance = machine_distances(SimpleNamespace(recipe=recipe))
    # places: gain -1, 0, 1; shape (-1, 1), (0, -1), (1, -1), whose two components count as one
    assert distance == pytest.approx({9: 1.0, 8: 0.5, 7: 1.0})


def test_a_model_of_a_split_has_not_seen_its_test_side(case):
    seen = []

    def spy(rows):
        seen.append(rows)
        return case.model

    told = evaluate_splits(replace(case, fit=spy), ["speed", "severity-gap"])
    for rows, name in zip(seen, ("speed", "severity-gap"), strict=True):
        train, test = SPLITS[name][1](case)
        assert np.array_equal(rows, train)
        assert split_named(told, name)["records"] == len(test)


def test_a_split_of_the_file_is_judged_by_its_records(case):
    with DataSet(case.path) as data:
        assert set(case.stored) == set(data.splits) - set(module.ALL_SPLITS) >= {"severity"}
        train, test = data.split("severity")  # no record of this set has failed
        text = data.splits["severity"]["text"]
    seen = []
    fresh = replace(case, fit=lambda rows: seen.append(rows) or case.model)
    made = evaluate_splits(fresh, ["severity"])["splits"][0]
    assert (made["text"], made["records"]) == (text, len(test))
    assert np.array_equal(seen[0], train)


def test_an_unknown_split_is_refused(case):
    with pytest.raises(DataError, match=r"held-out part 'sped' must be one of random, speed"):
        evaluate_splits(case, ["sped"])


def test_a_split_that_cannot_be_made_says_why(case):
    bare = replace(
        case, table=replace(case.table, manifest=case.table.manifest.drop(columns="speed_hz"))
    )
    made = evaluate_splits(bare, ["speed"])["splits"][0]
    assert "speed_hz" in made["missing"]
    assert "not made" in splits_text({**evaluate_splits(bare, ["speed"])})


# -- figures


def test_the_random_split_is_what_score_says(case, result):
    train, test = case.random
    told = split_named(result, "random")
    judged, _ = judge_rows(case.model, case.table, test)
    assert told["train"]["records"] == len(train)
    mine = judged.graded
    assert_allclose(told["mae_m"], np.abs(judged.found - judged.truth)[mine].mean())
    low, high = told["intervals"]["mae_m"]
    assert low < told["mae_m"] < high
    assert sum(map(sum, told["confusion"])) == mine.sum()


def test_estimates_of_many_are_those_of_one(case):
    _, test = case.random
    judged, estimates = judge_rows(case.model, case.table, test)
    for i, each in enumerate(estimates):
        if each.graded:
            assert_allclose(judged.found[i], each.severity, rtol=1e-9)
            assert judged.grade[i] == each.grade


def test_reliability_at_the_nominal_level_is_the_coverage(result):
    told = split_named(result, "random")
    at = {row["nominal"]: row for row in told["reliability"]}
    assert_allclose(at[0.9]["interval"]["value"], told["coverage"])
    assert_allclose(at[0.9]["set"]["value"], told["set_coverage"])
    held = [row["interval"]["value"] for row in told["reliability"]]
    assert held == sorted(held)


def test_p_values_are_counted_at_their_levels():
    given = [Estimate(verdict="graded", p_value=p) for p in (0.01, 0.04, 0.5, 1.0)]
    given.append(Estimate(verdict="unusable"))
    found = p_value_shares(given, resampled(np.arange(5)))
    assert [row["p"] for row in found] == list(P_LEVELS)
    shares = {row["p"]: row["share"].value for row in found}
    assert (shares[0.01], shares[0.05], shares[0.5]) == (0.4, 0.6, 0.8)


def test_baselines_stand_beside_every_split(result):
    made = [split for split in result["splits"] if not split["missing"]]
    assert len(made) == 3 + 3  # three levels of noise
    for split in made:
        assert list(split["baselines"]) == ["majority", "single_rms", "tsfel", "minirocket"]
        assert split["baselines"]["majority"]["mae_all_m"]["value"] > 0
        assert split["baselines"]["tsfel"]["missing"]


def test_noise_has_the_rms_that_is_asked_for():
    channels = tuple(
        Channel(name=name, unit="m/s^2", quantity="acceleration") for name in ("x", "y")
    )
    tacho = Channel(name="t", unit="V", quantity="voltage")
    quiet = Recording(
        signal=np.ones((3, 50_000)),
        sample_rate=1e3,
        channels=(channels[0], tacho, channels[1]),
        tacho="t",
    )
    noisy = with_noise(quiet, np.array([0.5, 2.0]), seed=3)
    # of 50,000 samples the deviation is known to 0.3 %; three of them
    assert_allclose(noisy.signal.std(axis=1), [0.5, 0.0, 2.0], rtol=0.01)
    again = with_noise(quiet, np.array([0.5, 2.0]), seed=3)
    assert np.array_equal(noisy.signal, again.signal)


def test_noise_raises_the_levels_of_the_features(case):
    table, foreign = noisy_table(case, 0.0)
    rows = case.random[1][: len(table.values)]
    column = case.table.names.index("acc_x.rms")
    clean, noisy = case.table.values[rows, column], table.values[:, column]
    train = case.random[0]
    newest = train[np.argsort(case.truth[train])[:9]]  # a tenth of 90
    as_new = np.median(case.table.values[newest, column])
    # powers of signal and noise add, but for their product: 1 % in a record of 50,000 samples
    assert_allclose(np.sqrt(noisy**2 - clean**2), as_new, rtol=0.05)
    assert all(isinstance(why, str) for why in foreign.values())


def test_noise_is_refused_or_costs_accuracy(result):
    clean, loud = split_named(result, "random"), split_named(result, "noise 0 dB")
    assert loud["unfamiliar"] > 0.5 or loud["mae_all_m"] > 1.5 * clean["mae_all_m"]


def test_more_machines_are_no_worse(result):
    curve = result["learning_curve"]
    assert [row["machines"] for row in curve] == [45]  # 60 draws, a quarter held out


def test_the_learning_curve_trains_on_whole_machines(case, monkeypatch):
    monkeypatch.setattr(protocol, "CURVE_MACHINES", (10, 20))
    seen = []

    def spy(rows):
        seen.append(np.unique(case.groups[rows]))
        return case.model

    curve = protocol.learning_curve(replace(case, fit=spy))
    assert [row["machines"] for row in curve] == [10, 20, 45]
    assert [len(each) for each in seen[:2]] == [10, 20]
    assert set(seen[0]) < set(seen[1])
    assert set(seen[1]).isdisjoint(case.groups[case.random[1]])


def test_what_is_found_lies_between_healthy_and_condemned(case, result):
    floors = {row["condition"]: row for row in result["detectability"]}
    usual = floors["as recorded"]
    assert usual["healthy_below_m"] < usual["smallest_m"]["value"] < case.limit
    assert len(floors) == 1 + 3 + 3  # speeds, noises


# -- a finished model


def test_the_training_set_serves_the_baselines(trained, small_set):
    model, table, test = trained
    told = evaluate_model(model, small_set, quick=True)
    assert told["records"] == len(test)
    assert not told["baselines"]["single_rms"]["flattered"]
    assert_allclose(told["mae_m"], score(model, table, test)["mae_m"])


def trained_on_others(model, **changes):
    """The model, as if it had been trained on other records."""
    trained = model.card.trained_on.model_copy(update=changes)
    return replace(model, card=model.card.model_copy(update={"trained_on": trained}))


def test_another_set_is_no_training_set(trained, small_set, monkeypatch):
    monkeypatch.setattr(judging, "feature_table", lambda path, **_: trained[1])
    told = evaluate_model(trained[0], small_set, trained_on=small_set, quick=True)
    assert not told["baselines"]["majority"]["flattered"]
    stranger = trained_on_others(trained[0], training_signals=[1])
    with pytest.raises(DataError, match="0 records that the model was trained on"):
        evaluate_model(stranger, small_set, trained_on=small_set, quick=True)


@pytest.fixture(scope="module")
def split_set(small_set, tmp_path_factory):
    """The small set with two more splits: odd machines, and every machine on both sides."""
    path = tmp_path_factory.mktemp("split") / "data.h5"
    shutil.copy(small_set, path)
    with DataSet(path) as data:
        group = data.manifest["group"].to_numpy()
    second = np.append(False, group[1:] == group[:-1])
    sides = {"odd": (group % 2 == 0, group % 2 == 1), "same": (~second, second)}
    splits = [
        Split(
            name=name,
            kind="region",
            train=np.flatnonzero(train),
            test=np.flatnonzero(test),
            text=f"{name} machines",
            machines_apart=name != "same",
        )
        for name, (train, test) in sides.items()
    ]
    store_splits(path, splits)
    return path


@pytest.fixture
def known_features(trained, monkeypatch):
    """Both sets hold the same signals."""
    with_features(monkeypatch, trained[1])


@pytest.fixture
def odd(split_set, known_features):
    return train_model(split_set, split="odd", budget_ms=CHEAP_MS)


def test_a_model_learns_from_its_split_alone(odd, split_set):
    model, table, test = odd
    groups = table.manifest["group"].to_numpy()
    assert np.array_equal(test, np.flatnonzero(groups % 2))
    with DataSet(split_set) as data:
        signals = data.manifest["signal_crc32"][data.manifest["group"] % 2 == 0]
        digest = usable_sides(data, "odd").sha256
    trained = model.card.trained_on
    assert trained.training_signals == sorted(set(signals))
    assert (trained.split, trained.split_sha256) == ("odd", digest)
    assert trained.held_out_share == 0.5
    told = evaluate_model(model, split_set, split="odd", quick=True)
    assert told["split"] == {
        "name": "odd",
        "text": "odd machines",
        "sha256": digest,
        "trained_with_it": True,
    }
    assert told["records"] == len(test)
    assert not told["baselines"]["single_rms"]["flattered"]
    assert_allclose(told["mae_m"], score(*odd)["mae_m"])
    page = one_split(told, model, split_set, 0)["splits"][0]
    assert (page["name"], page["text"]) == ("odd", "odd machines")


def test_a_model_that_knows_what_a_split_tests_is_refused(trained, odd, split_set):
    # 45 of 60 machines, of two records each, were trained on; which of them are odd is chance
    known = set(trained[0].card.trained_on.training_groups)
    leaked = sum(group % 2 for group in known)
    message = rf"split odd tests {2 * leaked} records of {leaked} machines that the model was"
    with pytest.raises(DataError, match=message):
        evaluate_model(trained[0], split_set, split="odd", quick=True)
    with pytest.raises(DataError, match=r"split same tests 30 records of 30 machines"):
        # by design of this split machines are on both sides, but no record is
        evaluate_model(odd[0], split_set, split="same", quick=True)


def test_the_same_machines_later_are_judged_where_a_split_says_so(split_set, known_features):
    model, _, test = train_model(split_set, split="same", budget_ms=CHEAP_MS)
    told = evaluate_model(model, split_set, split="same", quick=True)
    assert told["records"] == len(test) == 60
    made = evaluate_splits(case_of(model, split_set, quick=True), ["same"])["splits"][0]
    assert (made["missing"], made["records"]) == ("", 60)


def test_a_stranger_is_judged_on_all_that_a_split_tests(odd, split_set):
    """Its baselines learn from the training side: no record of either is the model's."""
    none = {"draw_identity": "", "split": "", "split_sha256": ""}
    stranger = trained_on_others(odd[0], training_signals=[1], **none)
    told = evaluate_model(stranger, split_set, split="odd", quick=True)
    assert not told["split"]["trained_with_it"]
    assert not told["baselines"]["single_rms"]["flattered"]
    assert told["mae_m"] == evaluate_model(odd[0], split_set, split="odd", quick=True)["mae_m"]


def test_a_split_too_small_to_train_on_is_refused(small_set, tmp_path, known_features):
    path = tmp_path / "few.h5"
    shutil.copy(small_set, path)
    split = Split(
        name="few", kind="region", train=np.arange(8), test=np.arange(60, 120), text="four"
    )
    store_splits(path, [split])
    with pytest.raises(DataError, match=r"split few leaves 4 of 60 usable machine draws"):
        train_model(path, split="few", budget_ms=CHEAP_MS)
    with pytest.raises(DataError, match=r"split = 'fw' must be one of .*few"):
        train_model(path, split="fw", budget_ms=CHEAP_MS)


def test_the_command_line_trains_and_judges_by_a_split(split_set, tmp_path, known_features):
    model = tmp_path / "odd.wsm"
    ways = ["--split", "odd", "-j", "1", "--json"]
    done = CliRunner().invoke(
        cli, ["train", str(split_set), "-o", str(model), "--budget-ms", str(CHEAP_MS), *ways]
    )
    assert done.exit_code == 0, done.output
    trained = json.loads(done.stdout)
    assert trained["trained_on"]["split"] == load_model(model).card.trained_on.split == "odd"
    done = CliRunner().invoke(cli, ["evaluate", str(model), str(split_set), "--quick", *ways])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["split"]["trained_with_it"]
    assert told["mae_m"] == trained["held_out"]["mae_m"]


def test_the_same_seed_gives_the_same_figures(trained):
    first, again, other = (score(*trained, seed=seed) for seed in (4, 4, 5))
    assert first == again
    assert other["intervals"] != first["intervals"]
    assert other["mae_m"] == first["mae_m"]


def test_cold_and_referenced_are_not_mixed(trained, small_set):
    with pytest.raises(DataError, match="the model is cold, and healthy recordings are given"):
        case_of(trained[0], small_set, healthy=small_set)


# -- words and pictures


def test_json_is_strict_and_complete(result):
    told = json.loads(json.dumps(result, allow_nan=False))
    assert told["schema_version"] == 1
    assert {"splits", "learning_curve", "detectability", "cost"} <= set(told)
    own = told["cost"][0]
    assert own["name"] == "wearstate"
    assert own["ms_per_record"] > 0
    assert told["cost"][1]["ms_per_record"] > 0
    assert [row["name"] for row in told["cost"] if row["missing"]] == ["tsfel", "minirocket"]


def test_the_severity_alone_costs_less_than_the_whole_estimate(case):
    """Seconds of a busy computer: one of three measurements shows it."""
    rows = (costs(case) for _ in range(3))
    assert any(own["ms_per_record"] < whole["ms_per_record"] for own, whole, *_ in rows)


@pytest.mark.parametrize("suffix", [".json", ".html"])
def test_a_file_holds_no_measured_time(result, tmp_path, suffix):
    slower = [dict(row) for row in result["cost"]]
    slower[0]["ms_per_record"] *= 10
    one, other = (tmp_path / f"{name}{suffix}" for name in ("one", "other"))
    save_evaluation(result, one)
    save_evaluation({**result, "cost": slower}, other)
    assert one.read_bytes() == other.read_bytes()
    assert any(row["name"] == "wearstate" for row in result["cost"])
    assert "ms per recording" in splits_text(result)


def test_text_names_every_split_and_what_is_missing(result, trained):
    text = splits_text(result)
    for name in (*NAMES[:3], "noise -20 dB", "smallest wear found", "machines trained on"):
        assert name in text
    assert max(map(len, text.splitlines())) < 200
    lines = "\n".join(score_lines(split_named(result, "random"), trained[0].card))
    assert "false alarms" in lines
    assert re.search(r"tsfel +(left out|tsfel is not installed)", lines)


def test_text_of_a_set_without_a_familiar_record(result, trained):
    nothing = {**split_named(result, "random"), "mae_m": None}
    assert "none is familiar" in score_lines(nothing, trained[0].card)[-1]
    assert score_lines({}, trained[0].card) == ["not evaluated: no machine draw was held out"]


def test_baselines_are_told_over_all_records_as_on_the_page():
    figures = {
        "missing": "",
        "flattered": False,
        "accuracy": {"value": 0.5},
        "mae_share_of_limit": {"value": 0.1},
        "mae_all_share_of_limit": {"value": 0.2},
        "difference": {"value": -0.01, "low": -0.02, "high": 0.0},
        "difference_all": {"value": -0.05, "low": -0.06, "high": -0.04},
    }
    _, line, note = baseline_lines({"single_rms": figures})
    assert line.split() == ["single", "rms", "20.0", "0.500", "-5.0", "[-6.0,", "-4.0]"]
    assert note == "  error and difference over all records, accuracy over those not unfamiliar"


def test_the_page_stands_alone(result):
    page = evaluation_html(result, notice="trained on simulation")
    assert page.count("data:image/png;base64,") == 6
    assert "http" not in page.replace("http-equiv", "")
    assert "<script" not in page
    assert "trained on simulation" in page
    assert "severity-beyond" in page


def test_pictures_and_json_are_written(result, tmp_path):
    for suffix in ("png", "svg", "json", "html"):
        save_evaluation(result, tmp_path / f"e.{suffix}")
    kept = {key: value for key, value in result.items() if key != "cost"}  # measured times
    assert json.loads((tmp_path / "e.json").read_text()) == json.loads(json.dumps(kept))
    assert (tmp_path / "e.png").stat().st_size > 50_000
    nothing = {**result, "splits": [{"name": "load", "text": "", "missing": "no load"}]}
    assert "no load" in evaluation_html(nothing)
    with pytest.raises(DataError, match="0 splits could be made"):
        save_evaluation(nothing, tmp_path / "x.png")


def test_a_finished_model_has_a_page_too(trained, small_set):
    told = one_split(score(*trained), trained[0], small_set, 0)
    assert evaluation_html(told).count("data:image/png;base64,") == 4


def test_the_command_judges_by_splits(trained, small_set, tmp_path, known_features):
    model, page = tmp_path / "model.wsm", tmp_path / "page.html"
    save_model(trained[0], model)
    assert load_model(model).card.budget_ms == CHEAP_MS
    arguments = ["evaluate", str(model), str(small_set), "--retrain", "speed", "--quick", "-j", "1"]
    done = CliRunner().invoke(cli, [*arguments, "--json", "-o", str(page)])
    assert done.exit_code == 0, done.output
    assert [split["name"] for split in json.loads(done.stdout)["splits"]] == ["speed"]
    assert "<h1>Evaluation" in page.read_text()
    with DataSet(small_set) as data:
        assert len(data) == json.loads(done.stdout)["records"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--retrain", "speed", "--trained-on", "x.h5"], "--trained-on and --split do not apply"),
        (["--retrain", "speed", "--split", "machine"], "--trained-on and --split do not apply"),
        (["-o", "page.txt"], "suffix"),
        (["--across-fidelity", "--quick"], "makes its own data"),
    ],
)
def test_usage(arguments, message, small_set):
    done = CliRunner().invoke(cli, ["evaluate", "m.wsm", str(small_set), *arguments])
    assert done.exit_code == 2
    assert message in done.output


def test_the_benchmark_fails_on_a_miss():
    script = runpy.run_path(str(Path(__file__).parent / "benchmarks" / "evaluate_standard.py"))
    even = {"value": 0.0, "low": -0.01, "high": 0.01}
    ran = {
        "missing": "",
        "accuracy": {"value": 0.6},
        "mae_all_share_of_limit": {"value": 0.05},
        "difference_all": even,
    }
    good = {
        "name": "random",
        "missing": "",
        "mae_share_of_limit": 0.04,
        "within_one_grade": 0.995,
        "accuracy_far": 0.95,
        "missed_fault": 0.002,
        "unfamiliar": 0.2,
        "baselines": {"single_rms": ran},
    }
    better = {"value": -0.02, "low": -0.03, "high": -0.01}
    ahead = {**good, "baselines": {"single_rms": {**ran, "difference_all": better}}}
    cost = [
        {"name": "wearstate", "missing": "", "ms_per_record": 10.0},
        {"name": "tsfel", "missing": "", "ms_per_record": 100.0},
        {"name": "minirocket", "missing": "not here", "ms_per_record": None},
    ]
    misses = script["misses"]
    assert misses({"splits": [good], "shifted": ahead, "cost": cost}, "pump") == []
    bad = {
        **good,
        "mae_share_of_limit": 0.041,
        "within_one_grade": 0.994,
        "accuracy_far": 0.94,
        "missed_fault": 0.003,
    }
    assert len(misses({"splits": [bad]}, "pump")) == 4
    worse = {"value": 0.02, "low": 0.01, "high": 0.03}
    behind = {**good, "baselines": {"single_rms": {**ran, "difference_all": worse}}}
    assert len(misses({"splits": [behind]}, "pump")) == 1
    # no worse is not enough beyond the trained range
    assert len(misses({"splits": [good], "shifted": {**good, "unfamiliar": 0.21}}, "pump")) == 2
    slow = [{**cost[0], "ms_per_record": 11.0}, *cost[1:]]
    assert len(misses({"splits": [good], "cost": slow}, "pump")) == 1
    nothing = {**good, "mae_share_of_limit": None}
    assert "unfamiliar" in misses({"splits": [nothing]}, "pump")[0]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["a", "c"], "of the model's 2 features it lacks 1, such as b and additionally has 1"),
        (["a"], "of the model's 2 features it lacks 1, such as b; use"),
        (["b", "a"], "of the model's 2 features it has another order; use"),
    ],
)
def test_features_of_another_kind_are_told_by_what_differs(names, said):
    model = SimpleNamespace(card=SimpleNamespace(features=["a", "b"]))
    with pytest.raises(DataError, match=re.escape(f"set.h5: {said}")):
        judging.unseen_rows(model, SimpleNamespace(names=tuple(names)), "", "set.h5")
