"""Splits keep a machine on one side, and are stored without touching anything else."""

import json
import os
import pickle
from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import overrides_text, sample_records
from wearstate.datasets.split import stored as split_file
from wearstate.datasets.split.rules import (
    check_no_leak,
    condition_split,
    group_folds,
    group_split,
    region_split,
    time_split,
)
from wearstate.datasets.split.stored import (
    KINDS,
    Drawn,
    Split,
    default_splits,
    drawn_of,
    machine_draws,
    make_split,
    split_names,
    store_splits,
    usable_sides,
)
from wearstate.diagnose.command_line.data_sets import _SPLITS
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

from .command_line import run

MANY = st.lists(st.integers(-3, 9), min_size=2, max_size=60).filter(lambda g: len(set(g)) > 1)


@given(MANY, st.floats(0.01, 0.99), st.integers(0, 99))
def test_a_split_parts_all_records_and_no_group(groups, fraction, seed):
    train, test = group_split(groups, test_fraction=fraction, seed=seed)
    assert_array_equal(np.sort(np.r_[train, test]), np.arange(len(groups)))
    labels = np.array(groups)
    assert not set(labels[train]) & set(labels[test])
    n_groups = len(set(groups))
    # half a group from rounding, one from keeping both sides occupied
    assert abs(len(set(labels[test])) - fraction * n_groups) <= 1
    check_no_leak(groups, train, test)


@given(MANY, st.integers(0, 99))
def test_folds_test_every_record_once(groups, seed):
    n = min(3, len(set(groups)))
    folds = group_folds(groups, n=n, seed=seed)
    assert_array_equal(np.sort(np.concatenate([test for _, test in folds])), range(len(groups)))
    labels = np.array(groups)
    sizes = [len(set(labels[test])) for _, test in folds]
    assert max(sizes) - min(sizes) <= 1
    for train, test in folds:
        check_no_leak(groups, train, test)
        assert len(train) + len(test) == len(groups)


def test_the_seed_decides():
    groups = np.repeat(np.arange(50), 2)
    first, again, other = (group_split(groups, seed=s)[1] for s in (0, 0, 1))
    assert_array_equal(first, again)
    assert set(first) != set(other)
    # 25 % of 50 groups is 12 (even rounding), two records each
    assert len(first) == 24


def test_held_out_conditions():
    values, groups = [4.0, 5.0, 6.0, 4.5], [0, 0, 1, 1]
    train, test = condition_split(values, 4.5, 5.0)
    assert (train.tolist(), test.tolist()) == ([0, 2], [1, 3])
    train, test = condition_split(values, 5.5, 9.0, groups=groups)
    # record 3 is of the held-out machine 1
    assert (train.tolist(), test.tolist()) == ([0, 1], [2])
    check_no_leak(groups, train, test)


def test_a_leak_is_named():
    with pytest.raises(ValueError, match=r"1 group\(s\) are on both sides, must be 0: \[7\]"):
        check_no_leak([7, 7, 8], [0], [1, 2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: group_split([1, 2], test_fraction=1.0), "test_fraction = 1.0 must be > 0 and < 1"),
        (lambda: group_split([1, 1]), r"1 group\(s\), must be >= 2"),
        (lambda: group_split([[1], [2]]), "groups has 2 dimensions"),
        (lambda: group_folds([1, 2, 3], n=4), r"3 group\(s\), must be >= 4"),
        (lambda: group_folds([1, 2, 3], n=1), "n = 1 folds must be >= 2"),
        (lambda: condition_split([1.0, 2.0], 3, 4), "holds out 0 and keeps 2 of 2"),
        (lambda: condition_split([1.0, 2.0], 0, 4), "holds out 2 and keeps 0 of 2"),
        (lambda: condition_split([1.0, np.nan], 0, 1), r"1 condition value\(s\) are not finite"),
    ],
)
def test_splits_that_cannot_be_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_region_is_where_every_bound_holds():
    columns = {"speed_hz": [4.0, 6.0, 6.0, 4.0], "load_n": [9.0, 1.0, 9.0, 1.0]}
    bounds = {"speed_hz": (5.0, np.inf), "load_n": (5.0, 10.0)}
    train, test = region_split(columns, bounds)
    assert (train.tolist(), test.tolist()) == ([0, 1, 3], [2])
    train, test = region_split(columns, bounds, groups=[0, 1, 1, 0])
    assert (train.tolist(), test.tolist()) == ([0, 3], [2])
    with pytest.raises(ValueError, match=r"range 7 to 8 of speed_hz .* from 4 to 6"):
        region_split(columns, {"speed_hz": (7.0, 8.0)})


LIVES = st.lists(st.lists(st.floats(0, 1e4), min_size=3, max_size=9), min_size=2, max_size=6)


@given(LIVES, st.floats(0.1, 0.9))
def test_time_parts_lives_by_their_hours(lives, early):
    hours = np.concatenate(lives)
    groups = np.repeat(np.arange(len(lives)), [len(life) for life in lives])
    end = np.array([max(life) for life in lives])
    if not ((end > 0).all() and (hours <= early * end[groups]).any()):
        return  # a life without hours has no late part, lives of late records alone no early one
    train, test = time_split(hours, groups, early=early)
    assert_array_equal(np.sort(np.r_[train, test]), np.arange(hours.size))
    assert (hours[train] <= early * end[groups[train]]).all()
    assert (hours[test] > early * end[groups[test]]).all()


def test_time_on_other_machines():
    hours = np.tile([0.0, 10.0, 20.0, 30.0], 4)
    groups = np.repeat([3, 5, 7, 9], 4)
    train, test = time_split(hours, groups, early=0.5, test_fraction=0.25, seed=1)
    check_no_leak(groups, train, test)
    [tested] = np.unique(groups[test])
    assert_array_equal(np.unique(groups[train]), [g for g in (3, 5, 7, 9) if g != tested])
    assert set(hours[train]) == {0.0, 10.0}
    assert set(hours[test]) == {20.0, 30.0}


# --- in a file


RECIPE = load_recipe("bilge-pump-small", {"duration": "0.25 s"})
N = 40


def write_set(path, *, recipe=RECIPE, n=N, seed=3, change=None, failed=()):
    """A data set with the draws of a recipe and noise for signals: splits know no signals."""
    channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    head = Attributes(
        sample_rate=100.0,
        channels=(channel,),
        origin="simulated",
        severities=recipe.severity_columns,
        recipe=recipe.text,
        scene=recipe.scene_text,
        overrides=overrides_text(recipe),
        seed=seed,
    )
    rng = np.random.default_rng(seed)
    with DataSetWriter(path, head, n_records=n, n_samples=8, columns=recipe.columns) as writer:
        for sample in sample_records(recipe, n, seed=seed):
            status = "diverged" if sample.index in failed else "ok"
            row = {**sample.row, "status": status, **(change or {})}
            writer.write(sample.index, rng.standard_normal((1, 8)), row)
        writer.finish()
    return path


@pytest.fixture
def path(tmp_path):
    return write_set(tmp_path / "data.h5")


def contents(path):
    with h5py.File(path) as file:
        return file["signal"][:].tobytes(), file["manifest"][:].tobytes(), repr(dict(file.attrs))


def test_defaults_hold_out_the_largest_fifth_and_part_machines(path):
    with DataSet(path) as data:
        made = default_splits(drawn_of(data))
        manifest = data.manifest
    assert {"machine", "speed", "load", "severity", "geometry"} <= set(made)
    assert not any(name.startswith("time") for name in made)
    for split in made.values():
        check_no_leak(manifest["group"], split.train, split.test)
    columns = {"speed": "speed_hz", "load": "discharge_pressure_pa"}
    columns["severity"] = RECIPE.severity_columns[0]
    for name, column in columns.items():
        values = manifest[column].to_numpy()
        # a fifth of 40 records lies beyond the 80 % quantile
        assert_array_equal(made[name].test, np.sort(np.argsort(values)[-8:]))
        assert values[made[name].train].max() < values[made[name].test].min()


def test_geometry_is_drawn_anew_from_recipe_and_seed(path):
    with DataSet(path) as data:
        name, values = machine_draws(drawn_of(data))
    drawn = [sample.drawn[name] for sample in sample_records(RECIPE, N, seed=3)]
    assert name == "casing.modes.0.frequency"
    assert_array_equal(values, drawn)


def test_geometry_of_another_version_is_refused(tmp_path):
    path = write_set(tmp_path / "old.h5", change={RECIPE.severity_columns[0]: 1e-4})
    with DataSet(path) as data:
        drawn = drawn_of(data)
    with pytest.raises(DataError, match=r"record 0 redrawn has .* of another version"):
        machine_draws(drawn)
    assert "geometry" not in default_splits(drawn)


def test_failed_records_are_on_neither_side(tmp_path):
    with DataSet(write_set(tmp_path / "f.h5", failed=(0, 7))) as data:
        made = default_splits(drawn_of(data))
    for split in made.values():
        assert_array_equal(split.sides(N)[[0, 7]], [-1, -1])


@pytest.mark.parametrize("kind", KINDS)
def test_a_set_that_failed_as_a_whole_has_no_splits(tmp_path, kind):
    with DataSet(write_set(tmp_path / "f.h5", failed=range(N))) as data:
        drawn = drawn_of(data)
        assert default_splits(drawn) == {}
        with pytest.raises(DataError, match="must"):
            make_split(drawn, kind)


def test_storing_leaves_signal_and_manifest_as_they_are(path):
    before = contents(path)
    with DataSet(path) as data:
        made = default_splits(drawn_of(data))
    store_splits(path, list(made.values()))
    assert contents(path) == before
    assert [entry.name for entry in path.parent.iterdir()] == ["data.h5"]
    with DataSet(path) as data:
        assert set(data.splits) == set(made)
        for name, split in made.items():
            assert_array_equal(data.split(name)[0], split.train)
            assert_array_equal(data.split(name)[1], split.test)
            assert data.splits[name]["kind"] == split.kind
            assert data.splits[name]["text"] == split.text
        copy = pickle.loads(pickle.dumps(data))
        assert_array_equal(copy.split("machine")[1], made["machine"].test)
        copy.close()
    with h5py.File(path) as file:
        for dataset in file["splits"].values():
            assert (dataset.shape, dataset.dtype) == ((N,), np.int8)


def test_storing_again(path):
    with DataSet(path) as data:
        drawn = drawn_of(data)
    one, two = (make_split(drawn, "machine", name="mine", share=s, seed=1) for s in (0.2, 0.5))
    store_splits(path, [one])
    with pytest.raises(DataError, match="split mine is stored already; use force"):
        store_splits(path, [two])
    store_splits(path, [two], force=True)
    with DataSet(path) as data:
        assert_array_equal(data.split("mine")[1], two.test)
        assert data.splits["mine"]["share"] == 0.5
        with pytest.raises(DataError, match="split = 'fast' must be one of mine; choose one"):
            data.split("fast")


def test_storing_that_fails_leaves_the_file(path, monkeypatch):
    with DataSet(path) as data:
        made = make_split(drawn_of(data), "machine")
    before = path.read_bytes()
    monkeypatch.setattr(split_file, "fill_split", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        store_splits(path, [made])
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_two_that_store_at_once(path, monkeypatch):
    """The second copy would be made without the first one's split, and replace it."""
    data = drawn_of(DataSet(path))
    one, two = make_split(data, "machine", seed=1), make_split(data, "machine", seed=2)
    two = replace(two, name="second")
    copy = split_file.shutil.copy

    def meanwhile(source, target):
        copy(source, target)
        with pytest.raises(DataError, match=rf"is being written by process {os.getpid()} on "):
            store_splits(path, [two])

    monkeypatch.setattr(split_file.shutil, "copy", meanwhile)
    store_splits(path, [one])
    monkeypatch.undo()
    store_splits(path, [two])
    with DataSet(path) as stored:
        assert {one.name, "second"} <= set(stored.splits)
    assert not path.with_name(path.name + ".lock").exists()


def test_damaged_sides_are_refused(path):
    with DataSet(path) as data:
        made = make_split(drawn_of(data), "machine")
    store_splits(path, [made])
    with h5py.File(path, "r+") as file:
        file["splits/machine"][5] = 4
    with DataSet(path) as data, pytest.raises(DataError, match="must be -1, 0 or 1 for each of 40"):
        data.split("machine")


def halves(name, train, test, *, apart=True):
    return Split(name=name, kind="region", train=train, test=test, text="", machines_apart=apart)


def test_sides_are_rows_of_the_usable_records(tmp_path):
    path = write_set(tmp_path / "f.h5", failed=(0, 7, 30))
    store_splits(path, [halves("half", np.arange(20), np.arange(20, N))])
    with DataSet(path) as data:
        sides = usable_sides(data, "half")
    # records 0 and 7 are missing below 20, record 30 beyond: rows of a table of 37
    assert_array_equal(sides.train, np.arange(18))
    assert_array_equal(sides.test, np.arange(18, 37))
    assert (sides.name, sides.machines_apart) == ("half", True)


def test_sides_that_cannot_serve_are_refused(path):
    with DataSet(path) as data:
        group = data.manifest["group"].to_numpy()
    second = np.append(False, group[1:] == group[:-1])
    mixed = np.flatnonzero(~second), np.flatnonzero(second)
    store_splits(
        path,
        [
            halves("leaky", *mixed),
            halves("meant", *mixed, apart=False),
            halves("empty", np.arange(N), np.arange(0)),
        ],
    )
    with DataSet(path) as data:
        with pytest.raises(DataError, match=rf"{second.sum()} group\(s\) are on both sides"):
            usable_sides(data, "leaky")
        assert not usable_sides(data, "meant").machines_apart
        with pytest.raises(DataError, match=r"split empty trains on 40 and tests on 0 usable"):
            usable_sides(data, "empty")


def test_the_hash_of_a_split_is_of_its_sides_and_signals(tmp_path):
    def digest(file, seed, edge):
        path = write_set(tmp_path / file, seed=seed)
        store_splits(path, [halves("mine", np.arange(edge), np.arange(edge, N))])
        with DataSet(path) as data:
            return usable_sides(data, "mine").sha256

    first, again = digest("a.h5", 3, 20), digest("b.h5", 3, 20)
    assert first == again
    assert len({first, digest("c.h5", 3, 22), digest("d.h5", 4, 20)}) == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "speeds"}, "kind = 'speeds' must be one of machine"),
        ({"kind": "region"}, "region: bounds are for region"),
        ({"kind": "speed", "bounds": {"speed_hz": (1.0, 2.0)}}, "speed: bounds are for region"),
        ({"kind": "speed", "share": 0.5}, "speed: share and seed are for machine"),
        ({"kind": "machine", "name": "a/b"}, "name = 'a/b' must be lower-case"),
        ({"kind": "time-same-machines"}, "manifest has no operating_hours"),
        ({"kind": "region", "bounds": {"speed": (0.0, 1.0)}}, "column = 'speed' must be one of"),
        ({"kind": "region", "bounds": {"record_id": (0.0, 1.0)}}, "'record_id' holds text"),
    ],
)
def test_splits_that_are_asked_for_wrongly(path, arguments, message):
    with DataSet(path) as data, pytest.raises(DataError, match=message):
        make_split(drawn_of(data), **arguments)


def test_what_a_recipe_declares(tmp_path):
    recipe = load_recipe("bilge-pump-narrow", {"duration": "0.25 s"})
    assert recipe.held_out
    with DataSet(write_set(tmp_path / "s.h5", recipe=recipe, n=200)) as data:
        made, manifest = default_splits(drawn_of(data)), data.manifest
    for region in recipe.held_out:
        split = made[region.name]
        assert split.kind == "declared"
        inside = np.ones(200, dtype=bool)
        for column, (low, high) in region.bounds.items():
            inside &= manifest[column].between(low, high).to_numpy()
        assert_array_equal(split.test, np.flatnonzero(inside))
    assert {region.name for region in recipe.held_out} <= set(split_names(recipe))


def test_time_splits_of_a_life():
    hours = np.tile([5.0, 12.0, 15.0, 20.0], 6)
    columns = {
        "status": np.array(["ok"] * 24),
        "group": np.repeat(np.arange(6), 4),
        "operating_hours": hours,
    }
    made = default_splits(Drawn(columns=columns, seed=2))
    same, other = made["time-same-machines"], made["time-other-machines"]
    assert not same.machines_apart
    assert other.machines_apart
    # 60 % of 20 h, that record included
    assert set(hours[same.train]) == set(hours[other.train]) == {5.0, 12.0}
    assert set(hours[same.test]) == set(hours[other.test]) == {15.0, 20.0}
    check_no_leak(columns["group"], other.train, other.test)


def test_generate_stores_them(tmp_path):
    path = tmp_path / "g.h5"
    generate(RECIPE, 8, path, seed=3)
    with DataSet(path) as data:
        made = default_splits(drawn_of(data))
        assert set(data.splits) == set(made) >= {"machine", "geometry"}
        for name, split in made.items():
            assert_array_equal(data.split(name)[1], split.test)


def test_the_command(path):
    assert "no splits; add some" in run("splits", path).stdout
    assert "machine:" in run("splits", path, "--defaults").stdout
    bound = "speed_hz=5:"
    run("splits", path, "--add", "region", "--name", "quick", "--bound", bound)
    made = json.loads(run("splits", path, "--json").stdout)["splits"]
    assert made["quick"]["bounds"] == {"speed_hz": [5.0, None]}
    with DataSet(path) as data:
        quick = (data.manifest["speed_hz"] >= 5).to_numpy()
        assert made["quick"]["test"] == np.count_nonzero(quick)
    assert "is stored already" in run("splits", path, "--add", "machine", code=2).stderr
    run("splits", path, "--add", "machine", "--share", 0.5, "--force")
    assert "--bound" in run("splits", path, "--add", "region", "--bound", "a:b", code=2).stderr
    assert "need --add" in run("splits", path, "--share", 0.5, code=2).stderr
    assert "--name is for one" in run("splits", path, "--name", "a", code=2).stderr


def test_the_kinds_of_the_command_line_are_those_of_the_library():
    assert (*KINDS, "region") == _SPLITS
