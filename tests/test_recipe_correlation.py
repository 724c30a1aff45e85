"""Draws that go together: the rank correlation that was asked, and nothing else moved."""

from itertools import islice

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import kstest, spearmanr
from wearstate.datasets.draws.correlation import pearson
from wearstate.datasets.recipe import records
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.text import RecipeError

BASE = """
name = "together"
extends = "journal-bearing-small"
records_per_group = 1
"""


def correlated(*entries):
    return "".join(
        f"[[correlation]]\npaths = {list(paths)}\nrank = {rank}\n" for rank, *paths in entries
    )


def load(tmp_path, text=""):
    file = tmp_path / "mine.toml"
    file.write_text(BASE + text)
    return load_recipe(file)


def faults_of(tmp_path, text):
    with pytest.raises(RecipeError) as caught:
        load(tmp_path, text)
    return caught.value.faults


def drawn(recipe, n, seed=0):
    """Every number by path, without building a scene of each."""
    sources = records._sources(recipe, seed)
    rows = [
        {path: v for source in sources.values() for path, v in source.values(i).items()}
        for i in range(n)
    ]
    return {path: np.array([row[path] for row in rows]) for path in rows[0]}


def test_numbers_drawn_here_are_those_of_the_records(tmp_path):
    recipe = load(tmp_path, correlated((0.6, "drive.speed", "load.static")))
    values = drawn(recipe, 20, seed=3)
    for i, sample in enumerate(islice(sample_records(recipe, seed=3), 20)):
        assert sample.drawn == {path: column[i] for path, column in values.items()}


@pytest.mark.parametrize("method", ["sobol", "latin-hypercube", "random"])
@pytest.mark.parametrize("rank", [0.6, -0.9])
def test_ranks_go_together_as_asked(tmp_path, method, rank):
    text = f'sampling = "{method}"\n' + correlated(
        (rank, "drive.speed", "load.static"), (rank, "rotor.unbalance", "sensors.1.offset")
    )
    values = drawn(load(tmp_path, text), 2000)
    for one, other in (("drive.speed", "load.static"), ("rotor.unbalance", "sensors.1.offset")):
        found = spearmanr(values[one], values[other]).statistic
        # deviation of Spearman's coefficient of 2000 free normal pairs: below 1 / sqrt(2000)
        assert abs(found - rank) < 4 * (1 - rank**2) / np.sqrt(2000) + 0.01
    # other pairs stay free: 4 deviations
    assert abs(spearmanr(values["drive.speed"], values["rotor.unbalance"]).statistic) < 0.09


def test_three_go_together_pair_by_pair(tmp_path):
    paths = ("drive.speed", "load.static", "oil.viscosity")
    values = drawn(load(tmp_path, correlated((0.7, *paths))), 2000)
    found = spearmanr(np.array([values[path] for path in paths]).T).statistic
    assert_allclose(found[np.triu_indices(3, 1)], 0.7, atol=4 * 0.51 / np.sqrt(2000) + 0.01)


def test_list_entries_go_together_one_by_one(tmp_path):
    text = correlated((0.8, "sensors.*.gain", "sensors.*.noise"))
    values = drawn(load(tmp_path, text), 1000)
    found = {
        (i, j): spearmanr(values[f"sensors.{i}.gain"], values[f"sensors.{j}.noise"]).statistic
        for i in (0, 1)
        for j in (0, 1)
    }
    # 4 deviations of a free pair 0.13, of a correlated one less
    for (i, j), rank in found.items():
        assert abs(rank - (0.8 if i == j else 0)) < 0.13


def test_ranges_stay_and_every_other_draw_stays_as_it_is(tmp_path):
    free = drawn(load(tmp_path), 1000)
    together = drawn(load(tmp_path, correlated((0.9, "drive.speed", "load.static"))), 1000)
    moved = {path for path in free if (free[path] != together[path]).any()}
    # the first of a pair is the same but for rounding, through the normal quantile and back
    assert_allclose(together["drive.speed"], free["drive.speed"], rtol=1e-12)
    assert moved - {"drive.speed"} == {"load.static"}
    uniform = (together["load.static"] - 4000) / 2000
    # Kolmogorov: 2 exp(-2 * 2^2) = 7e-4
    assert kstest(uniform, "uniform").statistic < 2 / np.sqrt(1000)


def test_severities_may_go_together(tmp_path):
    file = tmp_path / "mine.toml"
    pins = [f"throws.{i}.joint.crankpin.diametral_clearance" for i in range(3)]
    file.write_text('name = "m"\nextends = "triplex-pump-small"\n' + correlated((0.5, *pins[:2])))
    values = drawn(load_recipe(file), 1000)
    found = spearmanr(np.array([values[pin] for pin in pins]).T).statistic
    # 4 deviations of .75 and 1 / sqrt(1000)
    assert abs(found[0, 1] - 0.5) < 0.1
    assert np.abs(found[2, :2]).max() < 0.13


def test_the_normal_correlation_of_a_rank():
    """2 sin(pi/6 r): its inverse is 6/pi asin(r/2), Spearman's coefficient of a normal pair."""
    for rank in (-0.99, -0.4, 0.0, 0.5, 0.99):
        assert_allclose(6 / np.pi * np.arcsin(pearson(rank) / 2), rank, atol=1e-15)


@pytest.mark.parametrize(
    ("entries", "fault"),
    [
        ([(0.5, "drive.speed", "rotor.unbalance")], "are of machine and record, must be of one"),
        (
            [(0.5, "drive.speed", "bearing.diametral_clearance")],
            "are of record and severity, must be of one level",
        ),
        ([(0.5, "drive.speed", "drive.sped")], "drive.sped is not drawn, must be one of"),
        ([(0.5, "drive.speed", "drive.speed")], "a path is given twice"),
        ([(0.5, "drive.speed")], "correlation.0.paths = ['drive.speed'] must have >= 2"),
        ([(1.0, "drive.speed", "load.static")], "correlation.0.rank = 1.0 must be < 1"),
        ([(-1.0, "drive.speed", "load.static")], "correlation.0.rank = -1.0 must be > -1"),
        (
            [(0.5, "sensors.*.gain", "rotor.run_out.*.phase")],
            "stand for 2, 8 values, must be as many each",
        ),
        (
            [(0.5, "drive.speed", "load.static"), (0.1, "load.static", "drive.speed")],
            "load.static and drive.speed are correlated twice",
        ),
        (
            [(-0.6, "drive.speed", "load.static", "oil.viscosity")],
            "contradict each other, least eigenvalue = -0.236 must be > 0",
        ),
    ],
)
def test_correlations_at_fault(tmp_path, entries, fault):
    [found] = faults_of(tmp_path, correlated(*entries))
    assert fault in found


def test_a_table_of_numbers_has_no_rank(tmp_path):
    file = tmp_path / "mine.toml"
    text = correlated((0.5, "casing.modes.0.shape", "joint.crankpin.friction"))
    file.write_text('name = "m"\nextends = "bilge-pump-small"\n' + text)
    with pytest.raises(RecipeError, match="a table of numbers has no rank"):
        load_recipe(file)


def test_faults_of_draws_and_correlations_are_told_together_and_once(tmp_path):
    text = correlated((0.5, "drive.sped", "load.static"), (0.5, "drive.spud", "load.static"))
    bad = '[[record]]\npath = "drive.sped"\ndistribution = "factor"\nlow = 0.9\nhigh = 1.1\n'
    faults = faults_of(tmp_path, bad + text)
    assert len(faults) == 2
    assert "drive.sped is an unknown key" in faults[0]
    assert "drive.spud is not drawn" in faults[1]


def test_an_extending_recipe_may_drop_all_correlations(tmp_path):
    (tmp_path / "base.toml").write_text(BASE + correlated((0.6, "drive.speed", "load.static")))
    mine = tmp_path / "more.toml"
    mine.write_text('name = "more"\nextends = "base.toml"\n')
    assert load_recipe(mine).copulas
    mine.write_text('name = "more"\nextends = "base.toml"\ncorrelation = []\n')
    assert not load_recipe(mine).copulas
