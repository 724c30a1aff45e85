"""Conditions noted beside a recording as inputs of a model."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from wearstate.diagnose.feature_rows.model_card import TrainedCondition
from wearstate.diagnose.feature_rows.noted import (
    NOTED,
    doubted,
    given_of,
    noted_ranges,
    noted_values,
    partly_noted,
    strayed,
)
from wearstate.diagnose.learning.experts import FEWEST_RECORDS
from wearstate.diagnose.nameplate.nameplate import nameplate_of
from wearstate.diagnose.wear_model.bundle import ModelError, load_bundle
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.learn import _worth_asking, learn
from wearstate.diagnose.wear_model.training_rows import TrainingRows
from wearstate.sim.scene.load import scene_text

NAMES = tuple(f"acc_x.order_{i}.level_db" for i in range(1, 9))
N = 120


def training(conditions, effect, seed=0):
    """Severities told by a level and by the viscosity, of two records a machine."""
    rng = np.random.default_rng(seed)
    severity = np.exp(rng.uniform(np.log(1e-4), np.log(4e-4), N))
    viscosity = np.exp(rng.uniform(np.log(0.01), np.log(0.04), N))
    rows = rng.normal(0, 1, (N, len(NAMES)))
    rows[:, 0] = 10 * (np.log(severity / 2e-4) + effect * np.log(viscosity / 0.02))
    rows[:, 0] += rng.normal(0, 1, N)  # a tenth of the severity
    return TrainingRows(
        names=NAMES,
        rows=rows,
        baseline=None,
        severity=severity,
        groups=np.repeat(np.arange(N // 2), 2),
        conditions=conditions,
        notes=[{"viscosity_pa_s": float(value)} for value in viscosity],
    )


@pytest.fixture(scope="module")
def learnt():
    return learn(training(("viscosity_pa_s",), effect=1.0))


def test_a_condition_that_tells_makes_an_informed_estimate(learnt):
    assert learnt.informed.error < 0.5 * learnt.blind.error
    # it was learnt from notes that are off by their doubt
    assert learnt.informed.error > 0.3 * NOTED["viscosity_pa_s"].doubt * 2e-4


def test_a_condition_that_tells_nothing_is_not_asked_for():
    assert learn(training(("viscosity_pa_s",), effect=0.0)).informed is None
    assert learn(training((), effect=1.0)).informed is None


def test_notes_become_inputs():
    rows = [{"viscosity_pa_s": np.e, "hull_deflection_m": -1e-3}, {"thrust_n": 1.0}, {}]
    found = noted_values(["viscosity_pa_s", "hull_deflection_m"], rows)
    np.testing.assert_allclose(found, [[1.0, -1e-3], [np.nan, np.nan], [np.nan, np.nan]])
    assert noted_values([], rows).shape == (3, 0)


def test_doubts_are_those_of_the_table():
    names = ["viscosity_pa_s", "hull_deflection_m"]
    values = np.column_stack([np.zeros(4000), np.linspace(-1, 1, 4000)])
    off = (doubted(names, values, seed=1) - values).std(axis=0)
    np.testing.assert_allclose(off, [0.05, 0.05 * 2], rtol=0.05)


def test_strays_reach_a_fifth():
    names = ["viscosity_pa_s", "hull_deflection_m"]
    values = np.column_stack([np.zeros(4000), np.linspace(-1, 1, 4000)])
    off = np.abs(strayed(names, values, seed=1, reach=1.2) - values).max(axis=0)
    np.testing.assert_allclose(off, [np.log(1.2), 0.2 * 2], rtol=0.01)


# --- a condition that few people know


def test_what_few_know_is_taken_as_usual_and_not_called_noted():
    names = ["viscosity_pa_s", "film_warming_k"]
    usual = NOTED["film_warming_k"].usual
    found = noted_values(names, [{"viscosity_pa_s": 1.0}, {"film_warming_k": 0.0}])
    np.testing.assert_array_equal(found, [[0.0, usual], [np.nan, 0.0]])
    assert given_of(names, {"viscosity_pa_s": 1.0, "film_warming_k": float("nan")}) == (names[0],)


def test_a_suction_that_some_records_lack_is_an_input_and_a_lacking_discharge_is_named():
    """One empty cell must not drop what may be unknown, nor drop the rest without a word."""
    gaps = pd.DataFrame(
        {"suction_pressure_pa": [-3e4, np.nan, 0.0], "discharge_pressure_pa": [3e5, np.nan, 2e5]}
    )
    assert noted_ranges(gaps) == {"suction_pressure_pa": (-3e4, 0.0)}
    assert [text.split(",")[0] for text in partly_noted(gaps)] == [
        "discharge_pressure_pa is known in 2 of 3 records"
    ]
    whole = gaps.fillna(2.5e5)
    assert set(noted_ranges(whole)) == set(gaps)
    assert partly_noted(whole) == []
    assert noted_ranges(gaps * np.nan) == {}
    assert partly_noted(gaps * np.nan) == []
    constant = pd.DataFrame(
        {"suction_pressure_pa": [-3e4, np.nan], "discharge_pressure_pa": [3e5, np.nan]}
    )
    assert noted_ranges(constant) == {}
    assert partly_noted(constant) == []  # as nothing can be learnt from them


def test_a_suction_of_zero_is_a_pressure_and_no_missing_number(tmp_path):
    """At an inlet 0 bar is the atmosphere; a film 0 K warmer is one that nobody noted."""
    scene = tmp_path / "mine.toml"
    text = re.sub(r"(?m)^suction = .*$", 'suction = "0 bar"', scene_text("bilge-pump"), count=1)
    scene.write_text(text, encoding="utf-8")
    known = nameplate_of(None, str(scene), {}).conditions({})
    assert known == {"discharge_pressure_pa": 3e5, "suction_pressure_pa": 0.0}


def test_a_pressure_that_a_scene_does_not_give_is_not_known(tmp_path):
    """A nameplate may hold the geometry only; the default of 0 Pa moved a pump by a fifth."""
    text = scene_text("bilge-pump")
    scene = tmp_path / "mine.toml"

    def known(without, **row):
        scene.write_text(re.sub(rf"(?m)^({without}) = .*$", "", text), encoding="utf-8")
        return nameplate_of(None, str(scene), {}).conditions(row)

    assert known("discharge") == {"suction_pressure_pa": -3e4}
    assert known("discharge|suction") == {}
    assert known("discharge|suction", discharge_pressure_pa=2.8e5) == {
        "discharge_pressure_pa": 2.8e5
    }
    given = nameplate_of(None, str(scene), {"pressure.discharge": "0 bar"})
    assert given.conditions({}) == {"discharge_pressure_pa": 0.0}


def test_half_of_the_training_records_lack_it_and_others_are_doubted_as_without_it():
    both = np.column_stack([np.zeros(4000), np.linspace(0, 15, 4000)])
    noted = doubted(["viscosity_pa_s", "film_warming_k"], both, seed=1)
    unnoted = noted[:, 1] == NOTED["film_warming_k"].usual
    assert np.mean(unnoted) == pytest.approx(0.5, abs=0.03)  # four deviations of 4,000 coins
    off = (noted - both)[~unnoted].std(axis=0)
    np.testing.assert_allclose(off, [0.05, 0.07 * 15], rtol=0.08)


def test_a_model_uses_a_thermometer_and_does_without():
    """Severity by a level, the oil's viscosity and how much warmer the film is."""
    rng = np.random.default_rng(4)
    warming = rng.uniform(0, 15, N) * (rng.random(N) < 0.5)
    rows = training(("viscosity_pa_s", "film_warming_k"), effect=1.0)
    level = rows.rows.copy()
    level[:, 0] -= 10 * 0.05 * warming  # 5 % of viscosity a kelvin
    notes = [
        {**note, "film_warming_k": float(kelvin)}
        for note, kelvin in zip(rows.notes, warming, strict=True)
    ]
    found = learn(replace(rows, rows=level, notes=notes))

    def error(told):
        inputs = np.hstack([level, noted_values(rows.conditions, told)])
        return np.abs(np.log(found.informed.severity.predict(inputs) / rows.severity)).mean()

    without = [{"viscosity_pa_s": note["viscosity_pa_s"]} for note in notes]
    assert error(notes) < 0.8 * error(without)
    off = np.array(
        [
            found.informed.severity.predict(np.hstack([level, noted_values(rows.conditions, told)]))
            / rows.severity
            for told in (notes, without)
        ]
    )
    assert abs(np.log(off).mean(axis=1)).max() < 0.05  # neither is biased by the warming


def test_conditions_that_help_one_regime_are_worth_asking_for():
    """A fifth less of the small errors of dry pins, next to nothing of all records' mean."""
    dry = np.arange(400) < 200
    rows = replace(
        training(("viscosity_pa_s",), effect=0.0),
        severity=np.full(400, 1e-4),
        groups=np.arange(400) // 2,
        faults={"lubrication_dry": dry, "lubrication_flooded": ~dry},
    )
    blind = rows.severity + np.where(dry, 5e-6, 1e-4)
    better = rows.severity + np.where(dry, 4e-6, 1e-4)
    assert _worth_asking(rows, better, blind)
    assert not _worth_asking(replace(rows, faults={}), better, blind)
    assert not _worth_asking(rows, blind, blind)
    few = {"lubrication_dry": np.arange(400) < FEWEST_RECORDS - 1}
    assert not _worth_asking(replace(rows, faults=few), better, blind)


@pytest.mark.parametrize(("machines", "worth"), [(20, False), (200, True)])
def test_a_gain_that_chance_explains_is_not_worth_asking_for(machines, worth):
    """A tenth less error on average: 0.9 standard errors of 20 machines, 2.8 of 200."""
    n = 2 * machines
    rows = replace(
        training(("viscosity_pa_s",), effect=0.0),
        severity=np.full(n, 1e-4),
        groups=np.arange(n) // 2,
    )
    uneven = np.repeat(np.arange(machines) % 2, 2)  # the gain of every other machine is a loss
    blind = rows.severity + 1e-5
    better = rows.severity + np.where(uneven, 1.4e-5, 0.4e-5)
    assert _worth_asking(rows, better, blind) is worth


@pytest.fixture(scope="module")
def model(small_trained):
    """The small pump model, as if its straight line leant on the viscosity too."""
    trained, table, _ = small_trained
    noted = TrainedCondition(name="viscosity_pa_s", feature="", unit="Pa s", low=0.01, high=0.04)
    kept = [c for c in trained.card.conditions if c.feature]
    card = trained.card.model_copy(update={"conditions": [*kept, noted]})
    line = trained.blind.witness
    more = {"centre": -4.0, "spread": 1.0, "weight": 0.5, "low": -5.0, "high": -3.0}
    line = replace(line, **{key: np.append(getattr(line, key), end) for key, end in more.items()})
    blend = replace(
        trained.blind.severity, names=("line",), parts=(line,), weights=np.ones(1), tube=0.0
    )
    informed = replace(trained.blind, severity=blend, witness=line)
    return replace(trained, informed=informed, card=card), table


def test_what_is_not_known_is_a_caution_with_its_worth(model):
    asked, table = model
    row = table.values[0]
    blind = asked.judge(row)
    assert blind.verdict == "caution"
    assert blind.noted == ()
    assert "viscosity_pa_s is not known: with it estimates" in blind.cautions[0]
    assert '--set oil.viscosity="30 mPa s"' in blind.cautions[0]
    told = asked.judge(row, conditions={"viscosity_pa_s": 0.02})
    assert told.noted == ("viscosity_pa_s",)
    assert not any("not known" in text for text in told.cautions)
    assert told.severity != blind.severity
    notes = [{}, {"viscosity_pa_s": 0.02}]
    both = asked.predict(np.stack([row, row]), conditions=notes)
    np.testing.assert_allclose(both, [blind.severity, told.severity], rtol=1e-12)


def test_a_condition_in_the_wrong_unit_is_named_with_its_cure(model):
    asked, table = model
    thick = asked.judge(table.values[0], conditions={"viscosity_pa_s": 20.0})  # mPa s
    (said,) = [text for text in thick.cautions if text.startswith("viscosity_pa_s")]
    assert said.startswith("viscosity_pa_s = 20 Pa s is outside the trained range 0.0")
    assert said.endswith(
        "check value and unit; if they are right, the estimate is an extrapolation"
    )


def test_an_informed_model_comes_back_from_its_file(model, tmp_path):
    asked, table = model
    save_model(asked, tmp_path / "a.wsm")
    again = load_model(tmp_path / "a.wsm")
    note = {"viscosity_pa_s": 0.03}
    assert again.judge(table.values[0], conditions=note) == asked.judge(
        table.values[0], conditions=note
    )
    assert load_bundle(tmp_path / "a.wsm", "wear model").structure["informed"] is not None


def test_an_informed_part_without_its_conditions_is_refused(model, tmp_path):
    asked, _ = model
    kept = [c for c in asked.card.conditions if c.feature]
    card = asked.card.model_copy(update={"conditions": kept})
    with pytest.raises(ModelError, match="informed do not fit"):
        save_model(replace(asked, card=card), tmp_path / "a.wsm")
