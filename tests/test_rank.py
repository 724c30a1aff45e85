"""Which features tell the wear: synthetic features whose answer is known, and real sets."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from wearstate.diagnose.feature_rows import feature_table as features_module
from wearstate.diagnose.feature_rows.feature_rank import (
    LEAST_OF_MACHINE,
    rank_features,
)
from wearstate.diagnose.feature_rows.feature_table import USUAL
from wearstate.diagnose.inspect import rank_text as rank_module
from wearstate.diagnose.inspect.rank_text import rank_lines, rank_set, rank_text, value_images

from .test_cli import refused, run, strict

MACHINES, EACH = 30, 10


@pytest.fixture(scope="module")
def known():
    """Features of 300 records of 30 machines, each with a relation to the wear that is known."""
    rng = np.random.default_rng(5)
    machine = np.repeat(np.arange(MACHINES), EACH)
    wear = rng.random(machine.size)
    side = rng.choice([-1.0, 1.0], MACHINES)[machine]
    return {
        "machine": machine,
        "wear": wear,
        "features": {
            "exact": np.exp(5 * wear),  # rises whatever the machine
            "falling": -(wear**3),
            "bowl": (wear - 0.5) ** 2,  # tells half of it, follows nothing
            "own_way": side * wear,  # rises in some machines, falls in others
            "offset": wear + 20 * rng.random(MACHINES)[machine],  # rises from another start in each
            "noise": rng.standard_normal(machine.size),
            "constant": np.ones(machine.size),
        },
    }


@pytest.fixture(scope="module")
def ranked(known):
    columns = known["features"]
    table = np.column_stack(list(columns.values()))
    grades = np.digitize(known["wear"], [0.25, 0.5, 0.75])
    return rank_features(list(columns), table, known["wear"], known["machine"], grades=grades)


def by_name(ranking):
    return {each.name: each for each in ranking.features}


def test_what_follows_the_wear_stands_first(ranked):
    names = [each.name for each in ranked.features]
    assert set(names[:2]) == {"exact", "falling"}
    found = by_name(ranked)
    # a monotonic function changes no rank: what remains is the estimate's breaking of ties
    assert found["exact"].information == pytest.approx(found["falling"].information, rel=0.01)
    assert found["exact"].spearman == pytest.approx(1.0)
    assert found["falling"].spearman == pytest.approx(-1.0)
    for name in ("exact", "falling"):
        assert found[name].monotonicity == pytest.approx(1.0)
        assert found[name].trendability == pytest.approx(1.0)
        assert found[name].grades > 0.85  # of the entropy; neighbours blur the edges of grades


def test_a_bowl_is_informative_and_has_no_trend(ranked):
    """It lacks one bit, the side.

    Within half a bit: of a relation without noise the estimate tells the number of records, and
    the two branches have half of them each.
    """
    found = by_name(ranked)
    assert found["bowl"].information == pytest.approx(found["exact"].information - 1, abs=0.5)
    assert abs(found["bowl"].spearman) < 0.2
    assert found["bowl"].trendability < 0.2
    assert found["bowl"] in ranked.informative


def test_machines_that_contradict_each_other_have_a_trend_and_no_common_one(ranked, known):
    found = by_name(ranked)
    sides = known["features"]["own_way"].reshape(MACHINES, EACH)[:, 0] > 0
    assert found["own_way"].monotonicity == pytest.approx(1.0)
    assert found["own_way"].trendability == pytest.approx(abs(2 * sides.mean() - 1))


def test_a_start_of_its_own_hides_the_trend_over_all_machines_alone(ranked):
    found = by_name(ranked)
    assert abs(found["offset"].spearman) < 0.3
    assert found["offset"].trendability == pytest.approx(1.0)


def test_noise_and_constants_tell_no_more_than_chance(ranked):
    found = by_name(ranked)
    telling = {each.name for each in ranked.informative}
    assert telling >= {"exact", "falling", "bowl"}
    assert "constant" not in telling
    assert found["constant"].information == 0.0
    assert found["constant"].monotonicity == 0.0
    assert found["noise"].information < 0.25
    assert ranked.chance < 0.25
    assert [each.name for each in ranked.features][-1] in ("constant", "noise")


def test_the_order_of_records_and_features_does_not_matter(known, ranked):
    names = list(known["features"])[::-1]
    table = np.column_stack([known["features"][name] for name in names])
    grades = np.digitize(known["wear"], [0.25, 0.5, 0.75])
    again = rank_features(names, table, known["wear"], known["machine"], grades=grades)
    assert again.features == ranked.features
    turned = np.argsort(known["wear"])
    moved = rank_features(names, table[turned], known["wear"][turned], known["machine"][turned])
    assert by_name(moved)["own_way"].trendability == pytest.approx(
        by_name(ranked)["own_way"].trendability
    )


def test_named_conditions_have_information_and_no_trend(known):
    condition = np.array(["good", "inner", "outer"])[(3 * known["wear"]).astype(int)]
    table = np.column_stack([known["features"][name] for name in ("exact", "noise")])
    found = rank_features(["exact", "noise"], table, condition, known["machine"], classes=True)
    assert found.features[0].name == "exact"
    shares = np.unique(condition, return_counts=True)[1] / condition.size
    entropy = -np.sum(shares * np.log2(shares))
    assert found.features[0].information == pytest.approx(entropy, rel=0.1)
    assert math.isnan(found.features[0].spearman)
    assert found.n_followed == 0


def test_few_records_of_a_machine_and_gaps():
    rng = np.random.default_rng(1)
    wear = rng.random(40)
    gaps = np.where(np.arange(40) < 35, np.nan, wear)
    table = np.column_stack([wear, gaps])
    pairs = rank_features(["whole", "gaps"], table, wear, np.arange(40) // 2)
    assert pairs.n_followed == 0
    assert math.isnan(pairs.features[0].monotonicity)
    assert math.isnan(by_name(pairs)["gaps"].information)  # five values
    assert pairs.features[0].name == "whole"
    fours = rank_features(["whole", "gaps"], table, wear, np.arange(40) // LEAST_OF_MACHINE)
    assert fours.n_followed == 10
    assert by_name(fours)["gaps"].monotonicity == pytest.approx(1.0)  # of the last machine


# --- the command


@pytest.fixture
def known_features(small_set, small_trained, monkeypatch):
    """Features of `small_set` as its training had them: of them the ranking is asked, no more."""

    def told(path, **_):
        assert path == small_set
        return small_trained[1]

    monkeypatch.setattr(features_module, "feature_table", told)


@pytest.fixture
def untimed(monkeypatch):
    """Costs that are not measured: twenty features, each alone on four recordings."""
    monkeypatch.setattr(
        rank_module, "costs_ms", lambda path, choices: [1.0 + i for i in range(len(choices))]
    )


def test_the_clearance_of_a_pump_is_told_by_its_knocks(small_set, known_features, tmp_path):
    page = tmp_path / "rank.html"
    told = strict(run("features", small_set, "--rank", "-o", page, "-j", 1, "--json").stdout)
    assert told["target"] == "diametral_clearance_crankpin_m"
    assert told["files"] == [str(page)]
    first = told["features"][0]
    assert first["information"] > 3 * told["chance_bits"]
    assert first["cost_ms"] > 0
    assert abs(first["spearman"]) > 0.7
    best = [each["information"] for each in told["features"]]
    assert best == sorted(best, reverse=True)
    html = page.read_text()
    assert html.count("data:image/png;base64,") == 7  # bars, and values of six
    assert first["name"] in html
    assert "<script" not in html


def test_text_table_and_json_tell_the_same(few_set, untimed, tmp_path):
    table = tmp_path / "rank.csv"
    ranked = ("features", few_set, "--rank", "--only", "rms,kurtosis,angle_kurtosis", "-j", 1)
    told = strict(run(*ranked, "--json").stdout)
    text = run(*ranked, "-o", table).stdout
    assert f"{told['features'][0]['name']} is most informative about" in text
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert [row["name"] for row in rows] == [each["name"] for each in told["features"]]


def test_what_cannot_be_ranked_is_refused(small_set, known_features, tmp_path):
    refused("features", small_set, "--rank", "--target", "colour", says=["target = 'colour'"])
    refused("features", small_set, "--rank", "--target", "status", says=["the same in all records"])
    refused("features", small_set, "--target", "grade", "-o", tmp_path / "x.csv", says=["--rank"])
    refused("features", small_set, "--rank", "-o", tmp_path / "x.parquet", says=["suffix"])
    refused("features", small_set, says=["DATA and --rank"])


def test_records_without_a_label_are_left_out(small_set, small_trained, untimed):
    _, table, _ = small_trained
    severity = "diametral_clearance_crankpin_m"
    blank = table.manifest.assign(**{severity: table.manifest[severity].where(lambda v: v > 1e-4)})
    found = rank_set(small_set, replace(table, manifest=blank), USUAL)
    assert found.ranking.n_records == (table.manifest[severity] > 1e-4).sum()
    assert found.ranking.features[0].information > found.ranking.chance
    assert len(value_images(found)) == 6


def test_few_records_are_said_to_be_few_and_not_ranked_by_nan(small_set, small_trained, untimed):
    _, table, _ = small_trained
    severity = "diametral_clearance_crankpin_m"
    few = table.manifest[severity].where(np.arange(len(table.manifest)) < 5)
    blank = table.manifest.assign(**{severity: few})
    found = rank_set(small_set, replace(table, manifest=blank), USUAL)
    (said,) = rank_lines(found)
    assert said.startswith("5 records are too few to rank by information about diametral_clear")
    assert "must be >= 10" in said
    assert "nan" not in rank_text(found)


def test_another_label_is_ranked_as_conditions(small_set, known_features, untimed):
    told = strict(
        run("features", small_set, "--rank", "--target", "grade", "-j", 1, "--json").stdout
    )
    assert told["features"][0]["spearman"] is None
    assert told["features"][0]["information"] > told["chance_bits"]
