"""Data sets merged into one: machines apart, sources told, duplicates named."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_array_equal
from wearstate.datasets.convert.merge import merge_sets
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured.data_set import import_recordings
from wearstate.datasets.measured.labels import Labels, read_labels
from wearstate.datasets.source.part import SourceOptions
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.output.recording import DataError


def made(folder, name, seeds, *, fs=100.0, labels=None, unit="g"):
    """A data set of one record and one group for each seed."""
    files = []
    home = folder / f"files_{name}"
    home.mkdir()
    for i, seed in enumerate(seeds):
        files.append(home / f"r{i}.npy")
        np.save(files[-1], np.random.default_rng(seed).standard_normal((1, 40)))
    told = read_labels(None, labels, ()) if labels else Labels(columns={}, constants={})
    options = SourceOptions(fs=fs, unit=unit, channels=("acc",))
    import_recordings(files, folder / f"{name}.h5", options=options, labels=told)
    return folder / f"{name}.h5"


def test_groups_stay_apart_and_columns_are_joined(tmp_path):
    a = made(tmp_path, "a", [1, 2], labels={"speed_hz": "25 Hz", "state": "worn"})
    b = made(tmp_path, "b", [3, 4, 5], labels={"load_n": "7"})
    summary = merge_sets([a, b], tmp_path / "c.h5")
    assert summary.sources == {"a": 2, "b": 3}
    assert summary.filled == {"speed_hz": ("b",), "state": ("b",), "load_n": ("a",)}
    with DataSet(tmp_path / "c.h5") as data, DataSet(a) as one, DataSet(b) as other:
        table = data.manifest
        assert table["group"].nunique() == 5
        assert list(table["source"]) == ["a"] * 2 + ["b"] * 3
        assert list(table["group_name"]) == [
            "a/r0.npy",
            "a/r1.npy",
            "b/r0.npy",
            "b/r1.npy",
            "b/r2.npy",
        ]
        assert list(table["source_record_id"]) == ["0", "1", "0", "1", "2"]
        assert table["record_id"].is_unique
        assert_array_equal(table["speed_hz"], [25.0, 25.0, np.nan, np.nan, np.nan])
        assert_array_equal(table["load_n"].notna(), [False, False, True, True, True])
        assert list(table["state"]) == ["worn", "worn", "", "", ""]
        for i in range(5):
            known = one[i] if i < 2 else other[i - 2]
            assert_array_equal(data[i].signal, known.signal)
        told = json.loads(data.attributes.merged_from)
        assert [(item["name"], item["records"]) for item in told] == [("a", 2), ("b", 3)]


def test_duplicates_are_refused_or_dropped_and_their_machine_is_one(tmp_path):
    a = made(tmp_path, "a", [1, 2])
    b = made(tmp_path, "b", [1, 9, 2])  # r0 with the same id; seed 2 under another id
    with pytest.raises(DataError, match=r"1 record\(s\) have the id .* 0 of b; .*duplicates"):
        merge_sets([a, b], tmp_path / "c.h5")
    assert not list(tmp_path.glob("c.h5*"))
    summary = merge_sets([a, b], tmp_path / "c.h5", duplicates="drop")
    assert (summary.n_records, summary.n_dropped, summary.n_joined) == (4, 1, 2)
    with DataSet(tmp_path / "c.h5") as data:
        groups = data.manifest["group"].tolist()
    assert groups[1] == groups[3]  # the same signal is the same machine, whatever its id
    assert len(set(groups)) == 3


def test_sets_of_another_kind_are_refused_with_every_difference(tmp_path):
    a = made(tmp_path, "a", [1])
    b = made(tmp_path, "b", [2], fs=50.0, unit="mm/s")
    with pytest.raises(DataError) as caught:
        merge_sets([a, b], tmp_path / "c.h5")
    assert "sample rate [Hz] must be the same: 100.0 in a; 50.0 in b" in str(caught.value)
    assert "channel names, units and quantities must be the same" in str(caught.value)
    with pytest.raises(DataError, match="given twice"):
        merge_sets([a, a], tmp_path / "c.h5")
    with pytest.raises(DataError, match=r"1 data set\(s\), must be >= 2"):
        merge_sets([a], tmp_path / "c.h5")
    with pytest.raises(DataError, match="is also an input"):
        merge_sets([a, b], a, force=True)
    assert not list(tmp_path.glob("c.h5*"))


def test_an_interrupted_merge_leaves_nothing(tmp_path):
    a, b = made(tmp_path, "a", [1]), made(tmp_path, "b", [2])

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        merge_sets([a, b], tmp_path / "c.h5", progress=stop)
    assert not list(tmp_path.glob("c.h5*"))


def test_merge_on_the_command_line(tmp_path):
    a, b = made(tmp_path, "a", [1, 2]), made(tmp_path, "b", [1])
    run = CliRunner()
    command = ["merge", str(a), str(b), "-o", str(tmp_path / "c.h5")]
    refused = run.invoke(cli, command)
    assert refused.exit_code == 2
    assert "--duplicates" in refused.output
    found = run.invoke(cli, [*command, "--duplicates", "drop", "--json"])
    assert found.exit_code == 0
    assert json.loads(found.stdout)["n_dropped"] == 1
    again = run.invoke(cli, [*command, "--duplicates", "drop"])
    assert again.exit_code == 2
    assert "exists" in again.output
    # merged ones merge again
    c = made(tmp_path, "d", [7])
    merged = merge_sets([tmp_path / "c.h5", c], tmp_path / "e.h5")
    assert merged.sources == {"c": 2, "d": 1}
