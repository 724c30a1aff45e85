"""A blend for each regime: where wear sounds different, and only there."""

import dataclasses
import io
import json
import zipfile

import numpy as np
import pytest
from wearstate.diagnose.familiarity.noise_floor import lifted_rows
from wearstate.diagnose.feature_rows.model_card import ConfounderRates
from wearstate.diagnose.learning.blends import Blend
from wearstate.diagnose.learning.experts import Experts, regime_shares
from wearstate.diagnose.learning.heads import Head
from wearstate.diagnose.learning.regressions import CANDIDATES
from wearstate.diagnose.wear_model.bundle import Bundle, ModelError, save_bundle
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.learn import learn
from wearstate.diagnose.wear_model.training_rows import TrainingRows

NAMES = ("a.shape_1", "a.kurtosis", "a.rms")
LINES_MS = 0.12  # a budget that lines alone keep


def rows_of(slopes, machines=150, seed=1):
    """Records of machines of as many regimes, each with a law of its own from wear to a feature."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(machines), 2)
    regime = groups % len(slopes)
    severity = np.exp(rng.uniform(-1, 1, groups.size))
    told = np.asarray(slopes)[regime] * np.log(severity) + 0.05 * rng.standard_normal(groups.size)
    sign = 1 + regime + 0.1 * rng.standard_normal(groups.size)
    return TrainingRows(
        names=NAMES,
        rows=np.column_stack([told, sign, np.ones(groups.size)]),
        baseline=None,
        severity=severity,
        groups=groups,
        faults={f"lubrication_{i}": regime == i for i in range(len(slopes))},
    )


def error(found, training):
    return np.abs(np.log(found.severity.estimate / training.severity)).mean()


def test_each_regime_is_read_by_its_own_law():
    """No line of both features reads loud and quiet wear; one for each does, to the noise."""
    training = rows_of((1.0, -1.0))
    found = learn(training, budget_ms=2 * LINES_MS)
    one = learn(dataclasses.replace(training, faults={}), budget_ms=2 * LINES_MS)
    assert isinstance(found.severity.blend, Experts)
    assert found.severity.chosen == "experts of 2 regimes"
    assert error(found, training) < 0.1 * error(one, training)
    assert error(found, training) < 0.06  # 0.04 is the mean size of the noise
    assert found.severity.cost_ms <= 2 * LINES_MS
    inputs = training.inputs
    shares = found.severity.blend.shares(inputs)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-12)
    present = np.column_stack(list(training.faults.values()))
    assert (shares.argmax(axis=1) == present.argmax(axis=1)).mean() > 0.98
    fitted = found.blind.severity.predict(inputs)
    assert np.abs(np.log(fitted / training.severity)).mean() < 0.06


@pytest.mark.parametrize(
    ("slopes", "machines", "budget_ms"),
    [
        ((1.0, 1.0), 150, 2 * LINES_MS),  # one law: two fits bring nothing
        ((1.0, -1.0), 90, 2 * LINES_MS),  # 90 records of each are too few
        ((1.0, -1.0), 150, 0.03),  # and no time for two lines
    ],
)
def test_one_fit_is_kept_where_regimes_bring_nothing(slopes, machines, budget_ms):
    found = learn(rows_of(slopes, machines), budget_ms=budget_ms)
    assert isinstance(found.severity.blend, Blend)


def test_a_referenced_model_tells_regimes_from_the_rows_as_they_are():
    """What changed since the machine was healthy comes first among its inputs."""
    training = rows_of((1.0, -1.0))
    still = np.column_stack([np.zeros(300), training.rows[:, 1], np.ones(300)])
    found = learn(dataclasses.replace(training, baseline=still), budget_ms=2 * LINES_MS)
    experts = found.severity.blend
    assert isinstance(experts, Experts)
    assert (experts.first, experts.features) == (3, 3)
    inputs = np.hstack([training.rows - still, training.rows])
    told = experts.shares(inputs).argmax(axis=1)
    assert (told == training.faults["lubrication_1"]).mean() > 0.98
    assert np.abs(np.log(experts.predict(inputs) / training.severity)).mean() < 0.06


def test_what_is_noted_beside_informs_each_regime():
    """The level leans on the viscosity, by a slope of its own in each regime."""
    training = rows_of((1.0, -1.0))
    rng = np.random.default_rng(5)
    lean = rng.uniform(np.log(0.01), np.log(0.04), 300)
    rows = training.rows.copy()
    rows[:, 0] += np.where(training.faults["lubrication_0"], lean, -lean)
    noted = dataclasses.replace(
        training,
        rows=rows,
        conditions=("viscosity_pa_s",),
        notes=[{"viscosity_pa_s": value} for value in np.exp(lean)],
    )
    found = learn(noted, budget_ms=2 * LINES_MS)
    assert isinstance(found.informed.severity, Experts)
    assert found.informed.error < 0.5 * found.blind.error
    asked = found.informed.severity.predict(np.column_stack([rows, lean]))
    # the viscosity itself is learnt as known to 5 %
    assert np.abs(np.log(asked / training.severity)).mean() < 0.1


def test_intervals_of_a_regime_are_as_wide_as_it_needs():
    """The second regime tells a tenth as much of the wear: its errors are ten times as large."""
    training = rows_of((1.0, 0.1), machines=300)
    found = learn(training, budget_ms=2 * LINES_MS)
    known = found.blind.calibration
    clear, hidden = training.faults.values()
    assert np.median(known.scale[hidden]) > 4 * np.median(known.scale[clear])


def test_shares_are_of_one():
    shares = regime_shares([np.array([0.2, 1.0]), np.array([0.2, 0.0])])
    np.testing.assert_allclose(shares, [[0.5, 0.5], [1.0, 0.0]], atol=1e-300)
    # no regime is likely at all: no estimate that is no number
    np.testing.assert_array_equal(regime_shares([np.zeros(1), np.zeros(1)]), [[0.5, 0.5]])


@pytest.fixture(scope="module")
def expert(small_trained):
    """The trained model with its blend twice, weighted by two made-up regimes."""
    model, table, _ = small_trained
    inputs, truth = table.values, table.manifest[model.card.severity].to_numpy(dtype=float)
    line = CANDIDATES[0].fit(inputs, inputs, 1.0 + (truth > np.median(truth)), 0, 0)
    sign = Blend(names=("ridge 3",), parts=(line,), weights=np.ones(1), low=0.5, high=4.0)
    heads = tuple(
        Head(
            name=f"lubrication_{name}", blend=sign, slope=slope, offset=-1.5 * slope, threshold=0.5
        )
        for name, slope in (("dry", -5.0), ("flooded", 5.0))
    )
    other = CANDIDATES[1].fit(inputs, inputs, truth, 0, 0)
    flat = Blend(names=("ridge 30",), parts=(other,), weights=np.ones(1), low=1e-5, high=1e-3)
    own = model.blind.severity
    experts = Experts(gates=heads, blends=(own, flat), first=0, features=len(model.names), tube=0.1)
    scale = model.blind.scale
    longer = {
        "centre": np.append(scale.centre, [0.5, 0.5]),
        "spread": np.append(scale.spread, [0.5, 0.5]),
        "weight": np.append(scale.weight, [0.0, 0.1]),
    }
    rates = {"share": 0.5, "detection_rate": 0.9, "false_alarm_rate": 0.1, "mae_with_m": 1e-5}
    rates |= {"mae_without_m": 1e-5, "members": {"ridge 3": 1.0}, "visible_from_m": None}
    found = [ConfounderRates(name=head.name, **rates) for head in heads]
    card = model.card.model_copy(update={"confounders": found})
    blind = dataclasses.replace(
        model.blind, severity=experts, scale=dataclasses.replace(scale, **longer)
    )
    return dataclasses.replace(model, blind=blind, heads=heads, card=card), inputs


def test_a_model_file_keeps_its_experts(expert, tmp_path):
    model, inputs = expert
    save_model(model, tmp_path / "experts.wsm")
    again = load_model(tmp_path / "experts.wsm")
    np.testing.assert_array_equal(again.predict(inputs), model.predict(inputs))
    seen = lifted_rows(model.names, inputs, model.familiarity.least_noise)
    first, second = (blend.predict(seen) for blend in model.blind.severity.blends)
    shares = model.blind.severity.shares(seen)
    np.testing.assert_allclose(
        model.predict(inputs), shares[:, 0] * first + shares[:, 1] * second, rtol=1e-12
    )
    assert again.judge(inputs[0]) == model.judge(inputs[0])


@pytest.mark.parametrize(
    "forgery",
    [
        {"gates": ["lubrication_dry", "unheard_of"]},
        {"gates": ["lubrication_dry"]},
        {"first": 1},
        {"first": -1},
        {"tube": -0.1},
        {"blends": []},
    ],
)
def test_forged_experts_are_refused(expert, tmp_path, forgery):
    model, _ = expert
    save_model(model, tmp_path / "good.wsm")
    with zipfile.ZipFile(tmp_path / "good.wsm") as stored:
        tables = {name: json.loads(stored.read(f"{name}.json")) for name in ("card", "structure")}
        with np.load(io.BytesIO(stored.read("arrays.npz"))) as loaded:
            arrays = {key: loaded[key] for key in loaded.files}
    tables["structure"]["blind"] |= forgery
    save_bundle(Bundle(kind="wear model", arrays=arrays, **tables), tmp_path / "forged.wsm")
    with pytest.raises(ModelError, match="retrain it"):
        load_model(tmp_path / "forged.wsm")
