"""What a model was shown to refuse, it refuses, and hardly anything else."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import generate
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.feature_rows.feature_table import USUAL, feature_table_names
from wearstate.diagnose.learning.blends import Blend, Linear
from wearstate.diagnose.learning.heads import Head, logit
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.learn import learn
from wearstate.diagnose.wear_model.strangers import fit_strangers, strangers_in
from wearstate.diagnose.wear_model.training_rows import Strangers, TrainingRows
from wearstate.diagnose.workflow.train import train
from wearstate.sim.output.recording import DataError

NAMES = ("a.shape_1", "a.kurtosis", "a.rms")
LINES_MS = 0.12  # a budget that lines alone keep


def familiar(machines=400, seed=1):
    """Records whose second feature follows the first; strangers break that, within both ranges."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(machines), 2)
    severity = np.exp(rng.uniform(-1, 1, groups.size))
    first = np.log(severity) + 0.05 * rng.standard_normal(groups.size)
    rows = np.column_stack([first, first + 0.1 * rng.standard_normal(groups.size), severity])
    return TrainingRows(names=NAMES, rows=rows, baseline=None, severity=severity, groups=groups)


def strangers(name, offset, count=60, seed=2):
    rng = np.random.default_rng(seed)
    first = rng.uniform(-0.4, 0.4, count)
    rows = np.column_stack([first, first + offset, np.exp(first)])
    return Strangers(name=name, rows=rows, groups=np.arange(count))


def refused(found, rows):
    return np.any([head.probability(rows) > head.threshold for head, _ in found.strangers], axis=0)


def test_two_kinds_are_told_from_the_familiar_though_they_lie_among_them():
    """Each is within the range of every feature: only their relation is another."""
    training = familiar()
    kinds = (strangers("lubrication_starved", 0.6), strangers("others", -0.6, seed=3))
    assert all((each.rows.max(axis=0) < training.rows.max(axis=0)).all() for each in kinds)
    found = learn(dataclasses.replace(training, strangers=kinds), budget_ms=LINES_MS)
    for (head, rates), kind in zip(found.strangers, kinds, strict=True):
        assert (head.name, rates.name, rates.records) == (kind.name, kind.name, 60)
        assert rates.detection_rate > 0.95
        assert rates.false_alarm_rate <= 0.0025 + 1 / 800  # none of 800
    fresh = (strangers("lubrication_starved", 0.6, 400, 5), strangers("others", -0.6, 400, 6))
    assert all(refused(found, each.rows).mean() > 0.95 for each in fresh)
    unseen = familiar(machines=2000, seed=7).rows
    assert refused(found, unseen).mean() <= 0.02  # none of 4,000
    plain = learn(training, budget_ms=LINES_MS)
    assert plain.strangers == ()
    np.testing.assert_array_equal(plain.severity.estimate, found.severity.estimate)


def test_a_kind_on_both_sides_of_the_familiar_is_recognised():
    """No line separates it: the second feature is as far above the first as below."""
    training = familiar()
    kinds = (strangers("above", 0.6, 100), strangers("below", -0.6, 100, seed=3))
    rows = np.vstack([each.rows for each in kinds])
    both = Strangers(name="others", rows=rows, groups=np.arange(200))
    ((_, rates),) = fit_strangers(dataclasses.replace(training, strangers=(both,)), seed=0)
    assert rates.detection_rate > 0.9


def test_some_rows_are_those_of_whole_machines():
    training = familiar()
    found = training.some(300, seed=1)
    assert abs(len(found.rows) - 300) <= 5
    here = np.isin(training.groups, found.groups)
    np.testing.assert_array_equal(found.rows, training.rows[here])
    np.testing.assert_array_equal(found.rows, training.some(300, seed=1).rows)
    assert training.some(len(training.rows), seed=1) is training


def test_where_two_kinds_fit_the_likelier_one_is_named(small_trained):
    """Of a rare kind little probability suffices, which is not to make it the likelier one."""
    model, table, _ = small_trained
    n = len(model.names)
    flat = Linear(
        centre=np.zeros(n),
        spread=np.ones(n),
        weight=np.zeros(n),
        low=np.full(n, -1e30),
        high=np.full(n, 1e30),
        offset=1.5,
        log=False,
    )
    blend = Blend(names=("ridge 3",), parts=(flat,), weights=np.ones(1), low=0.5, high=4.0)
    chances = {"lubrication_flooded": (0.3, 0.05), "lubrication_starved": (0.97, 0.3)}
    heads = tuple(
        Head(name=name, blend=blend, slope=0.0, offset=logit(chance), threshold=threshold)
        for name, (chance, threshold) in chances.items()
    )
    said = dataclasses.replace(model, strangers=heads).judge(table.values[0])
    assert [text for text in said.reasons if "sounds like" in text] == [said.reasons[0]]
    assert "sounds like a starved pin" in said.reasons[0]


def test_recordings_of_the_training_kind_cannot_be_refused():
    twins = familiar(machines=40, seed=9)
    same = Strangers(name="twins", rows=twins.rows, groups=twins.groups)
    with pytest.raises(DataError, match=r"of 80 recordings of twins differ .* >= 50%; leave"):
        learn(dataclasses.replace(familiar(), strangers=(same,)), budget_ms=LINES_MS)


FLOODED = """
extends = "bilge-pump-small"
name = "flooded-pumps"
description = "Pins under pressure feed"

[fixed]
"joint.crankpin.rung" = "film-map"
"joint.crankpin.oil.viscosity" = "0.06 Pa s"
"joint.crankpin.oil.length" = "50 mm"
"""


@pytest.fixture(scope="module")
def flooded_set(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flooded")
    (folder / "flooded.toml").write_text(FLOODED)
    return generate(folder / "flooded.toml", 24, folder / "flooded.h5", seed=3, jobs=1).path


@pytest.fixture(scope="module")
def command(few_set, flooded_set, tmp_path_factory):
    """Model file of a training on few dry pumps, told to refuse flooded ones, and what it said."""
    model = tmp_path_factory.mktemp("model") / "pump.wsm"
    arguments = ["train", few_set, "--refuse", flooded_set, "-o", model, "--held-out", 0]
    arguments += ["--features", "core", "--budget-ms", 0.2, "-j", 1, "--json"]
    done = CliRunner().invoke(cli, [str(each) for each in arguments])
    assert done.exit_code == 0, done.output
    return model, json.loads(done.stdout)


def report(data, number, model):
    arguments = ["report", str(data), "--record", str(number), "--model", str(model), "--json"]
    return json.loads(CliRunner().invoke(cli, arguments).stdout)["estimate"]


def test_train_refuse_report(command, few_set, flooded_set):
    model, told = command
    (rates,) = told["strangers"]
    assert rates["name"] == "flooded-pumps"
    assert rates["records"] == 24
    assert rates["detection_rate"] > 0.9
    flooded = report(flooded_set, 3, model)
    assert flooded["verdict"] == "unfamiliar"
    assert "it sounds like the recordings of flooded-pumps" in flooded["reasons"][0]
    dry = [report(few_set, number, model) for number in range(8)]
    assert not any("sounds like" in text for each in dry for text in each["reasons"])


def test_a_model_file_keeps_what_it_refuses(command, tmp_path):
    model = load_model(command[0])
    save_model(model, tmp_path / "again.wsm")
    assert (tmp_path / "again.wsm").read_bytes() == command[0].read_bytes()
    (head,) = model.strangers
    assert load_model(tmp_path / "again.wsm").strangers[0].threshold == head.threshold


def test_what_was_shown_is_no_unseen_recording(command, flooded_set):
    """So that an evaluation on the very recordings says so."""
    with DataSet(flooded_set) as data:
        shown = set(data.manifest["signal_crc32"].tolist())
    assert shown <= set(load_model(command[0]).card.trained_on.training_signals)


def test_the_same_set_twice_is_one(few_set, flooded_set):
    with DataSet(few_set) as data:
        head = data.attributes
    names = feature_table_names(few_set)
    [once] = strangers_in([flooded_set], head, USUAL, names)
    again = flooded_set.with_name("again.h5")
    again.write_bytes(flooded_set.read_bytes())
    [twice] = strangers_in([flooded_set, again], head, USUAL, names)
    np.testing.assert_array_equal(once.rows, twice.rows)


def test_a_forged_model_without_its_head_is_refused(command, tmp_path):
    model = dataclasses.replace(load_model(command[0]), strangers=())
    with pytest.raises(ValueError, match="strangers do not fit"):
        save_model(model, tmp_path / "forged.wsm")


def test_what_cannot_be_shown_is_named(few_set, flooded_set, tmp_path):
    other, few = tmp_path / "other.h5", tmp_path / "few.h5"
    slow = tmp_path / "slow.toml"
    slow.write_text(FLOODED + 'sample_rate = "20 kHz"\n')
    generate(slow, 2, other, seed=0, jobs=1)
    generate("bilge-pump-small", 2, few, seed=1, jobs=1)
    with pytest.raises(DataError, match=r"sample_rate = 20000\.0 must be 25600\.0, as of"):
        train(few_set, refuse=[few, other])
    with pytest.raises(DataError, match="refuse: 2 recordings of bilge-pump-small, must be >= 20"):
        train(few_set, refuse=[few])
    one = tmp_path / "one.toml"
    one.write_text(FLOODED.replace("[fixed]", "records_per_group = 20\n\n[fixed]"))
    generate(one, 20, tmp_path / "one.h5", seed=0, jobs=1)
    with pytest.raises(DataError, match="refuse: 1 machines of flooded-pumps, must be >= 5"):
        train(few_set, refuse=[tmp_path / "one.h5"])
    with pytest.raises(DataError, match="refuse needs features of one recording by itself"):
        train(few_set, refuse=[flooded_set], joined=[f"again={few_set}"])


def test_what_a_model_learns_to_grade_it_cannot_learn_to_refuse(few_set, tmp_path):
    with pytest.raises(DataError, match=r"also in the training set .*, must not be"):
        train(few_set, refuse=[few_set])
    ran = CliRunner().invoke(
        cli, ["train", str(few_set), "--refuse", str(few_set), "-o", str(tmp_path / "m.wsm")]
    )
    assert ran.exit_code == 2
    assert "leave them out" in ran.stderr


def test_regimes_that_a_set_draws_are_kinds_of_their_own(few_set, tmp_path):
    oiled = tmp_path / "oiled.h5"
    generate("bilge-pump-lubricated", 6, oiled, seed=0, jobs=1)
    with pytest.raises(DataError) as caught:
        train(few_set, refuse=[oiled])
    assert "recordings of lubrication_starved" in str(caught.value)
    assert "recordings of lubrication_flooded" in str(caught.value)
