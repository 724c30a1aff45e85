"""Reading a data set the way learners do: at random, in worker processes, by other libraries."""

import os
import pickle
import re
import subprocess
import sys
import zlib
from itertools import pairwise

import h5py
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal
from wearstate.datasets.file import attributes, record, writer
from wearstate.datasets.file.attributes import Attributes, attributes_hash, manifest_hash
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.split.rules import group_split
from wearstate.diagnose.feature_rows.feature_table import feature_table
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

N, N_SAMPLES = 12, 2048
CHANNELS = (
    Channel(name="acc", unit="m/s^2", quantity="acceleration"),
    Channel(name="probe", unit="m", quantity="displacement"),
)
COLUMNS = {"scar_depth_bearing_m": "<f8", "steps": "<i8", "confounder_loud": "?"}


def head(**change):
    about = {
        "sample_rate": 5120.0,
        "channels": CHANNELS,
        "origin": "simulated",
        "severities": ("scar_depth_bearing_m",),
        "grade_edges": (1e-5, 2e-5, 3e-5),
        "condemning_limit": 3e-5,
    }
    return Attributes(**{**about, **change})


def signal_of(index):
    noise = np.random.default_rng(index).standard_normal((2, N_SAMPLES))
    return noise.astype(np.float32)


def written(path, **change):
    with DataSetWriter(
        path, head(**change), n_records=N, n_samples=N_SAMPLES, columns=COLUMNS
    ) as writer:
        for i in range(N):
            row = {
                "record_id": f"{i}", "group": i // 2, "seed": 2**64 - 1 - i, "status": "ok",
                "grade": i % 4, "scar_depth_bearing_m": 1e-6 * i, "confounder_loud": i % 2 == 1,
            }  # fmt: skip
            writer.write(i, signal_of(i), row, {"force": np.full(3, i)})
        writer.finish()
    with h5py.File(path, "r+") as file:
        file["splits/mine"] = np.arange(N, dtype=np.int8) % 2
        file["splits/mine"].attrs["about"] = np.bytes_('{"kind": "random"}')
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return written(tmp_path_factory.mktemp("loaders") / "data.h5")


# -- rows ----------------------------------------------------------------------------------------


def test_a_row_holds_plain_python(path):
    with DataSet(path) as data:
        row = data[5].row
    assert row == {
        "record_id": "5", "group": 2, "seed": 2**64 - 6, "done": True, "status": "ok", "grade": 1,
        "scar_depth_bearing_m": 5 * 1e-6, "steps": -1, "confounder_loud": True,
        "signal_crc32": row["signal_crc32"],
    }  # fmt: skip
    assert {type(value) for value in row.values()} == {str, int, bool, float}


def test_rows_and_manifest_agree(path):
    with DataSet(path) as data:
        for index, (_, line) in enumerate(data.manifest.iterrows()):
            assert data.row(index) == line.to_dict()
        assert data.row(-1) == data.row(N - 1)
        assert data.stored_shape == (N, 2, N_SAMPLES)


def test_the_table_is_not_made_for_reading_nor_sent_to_workers(path):
    with DataSet(path) as data:
        data[3]
        assert "manifest" not in vars(data)
        assert isinstance(data.manifest, pd.DataFrame)
        copy = pickle.loads(pickle.dumps(data))
        assert "manifest" not in vars(copy)
        assert_array_equal(copy[3].signal, signal_of(3))
        copy.close()


def test_a_signal_may_be_changed_in_place(path):
    """As torch.from_numpy wants it; the next read is the file's again."""
    with DataSet(path) as data:
        data[1].signal[:] = 0
        assert_array_equal(data[1].signal, signal_of(1))


def test_a_checksum_is_looked_at_once_for_each_time_the_file_is_opened(path, monkeypatch):
    seen = []
    monkeypatch.setattr(record, "signal_checksum", lambda s: seen.append(1) or zlib.crc32(s.data))
    with DataSet(path) as data:
        for index in (0, 1, 0, 1, 1):
            data[index]
        assert len(seen) == 2
        data.close()  # what is opened again may be another file
        data[0]
        assert len(seen) == 3
        pickle.loads(pickle.dumps(data))[0]
        assert len(seen) == 4


# -- hashes --------------------------------------------------------------------------------------


def test_a_stopped_run_has_the_hashes_of_an_uninterrupted_one(path, tmp_path):
    stopped = tmp_path / "data.h5"
    with DataSet(path) as data:
        rows = [{**data.row(i)} for i in range(N)]
    for part in pairwise((0, 5, N)):
        with DataSetWriter(
            stopped, head(), n_records=N, n_samples=N_SAMPLES, columns=COLUMNS
        ) as writer:
            for i in range(*part):
                writer.write(i, signal_of(i), rows[i])
            if part[1] == N:
                writer.finish()
    with h5py.File(path) as one, h5py.File(stopped) as two:
        assert dict(one.attrs) == dict(two.attrs)
        assert one.attrs["manifest_sha256"].decode() == manifest_hash(one["manifest"][:])


def test_a_run_begun_before_there_were_hashes_is_finished_without(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "stamped", lambda stored, _: dict(stored))
    with DataSet(written(tmp_path / "data.h5")) as data:
        assert data.unhashed == ("attributes_sha256", "manifest_sha256")


def test_the_hash_of_attributes_covers_each(path):
    with h5py.File(path) as file:
        stored = dict(file.attrs)
    whole = attributes_hash(stored)
    for name in stored:
        if name not in attributes.HASHES:
            assert attributes_hash({k: v for k, v in stored.items() if k != name}) != whole
            assert attributes_hash({**stored, name: "other"}) != whole


# -- contradictory attributes --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"severities": ("a_m", "a_m")}, r"severities \['a_m', 'a_m'\] must be unique"),
        ({"grade_edges": (2e-5, 1e-5)}, r"grade_edges = \[2e-05, 1e-05\] m must be > 0 and rise"),
        ({"grade_edges": (0.0, 1e-5)}, r"must be > 0 and rise"),
        ({"condemning_limit": 1e-6}, "condemning_limit = 1e-06 m must be >= 3e-05 m"),
        ({"condemning_limit": float("nan")}, "condemning_limit = nan m must be >= 3e-05 m"),
    ],
)
def test_limits_that_contradict_each_other_are_refused(change, message):
    with pytest.raises(DataError, match=message):
        head(**change)


def test_all_faults_of_the_attributes_are_told_with_the_file(path, tmp_path):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        file.attrs["grade_edges_m"], file.attrs["severities"] = "[2, 1]", '["a_m", "a_m"]'
    with pytest.raises(DataError) as caught:
        DataSet(copy)
    lines = str(caught.value).split("\n")
    assert [line.partition(": ")[0] for line in lines] == [str(copy)] * 3
    assert [re.search("severities|grade_edges|condemning", line)[0] for line in lines] == [
        "severities", "grade_edges", "condemning",
    ]  # fmt: skip


# -- other libraries -----------------------------------------------------------------------------


def test_pandas_reads_labels_and_features(path):
    with DataSet(path) as data:
        worn = data.manifest.groupby("grade")["scar_depth_bearing_m"].max()
        train, test = group_split(data.manifest["group"], seed=0)
    assert worn.to_dict() == pytest.approx({0: 8e-6, 1: 9e-6, 2: 1e-5, 3: 1.1e-5})
    assert len(train) + len(test) == N
    table = feature_table(path).frame()
    assert len(table) == N
    assert table.filter(like="acc.").shape[1] > 10


def run(code, path, cache):
    """A script of its own: the name of a library may not be that of our package beside it."""
    script = cache / "script.py"
    script.write_text(code)
    done = subprocess.run(
        [sys.executable, script, path],
        env={**os.environ, "HF_HOME": str(cache), "HF_DATASETS_OFFLINE": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    missing = re.search("No module named '(torch|datasets)'", done.stderr)
    if missing:
        pytest.skip(f"{missing[1]} is not installed")
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


TORCH = """
import sys

import numpy as np
import torch
from torch.utils.data import DataLoader
from wearstate.datasets.file.record import DataSet


def batch(items):
    signals = torch.from_numpy(np.stack([item.signal for item in items]))
    return signals, [item.row["record_id"] for item in items]


if __name__ == "__main__":
    data = DataSet(sys.argv[1])
    data[0]  # the parent's handle is open when the workers begin
    for start in ("fork", "spawn"):
        loader = DataLoader(
            data, batch_size=5, shuffle=True, num_workers=2, collate_fn=batch,
            multiprocessing_context=start,
        )
        for epoch in range(2):
            seen = []
            for signals, names in loader:
                for signal, name in zip(signals, names):
                    assert torch.equal(signal, torch.from_numpy(data[int(name)].signal))
                seen += names
            print(len(seen), len(set(seen)))
"""


def test_torch_reads_every_record_once_in_worker_processes(path, tmp_path):
    assert run(TORCH, path, tmp_path) == [str(N)] * 8


HUGGING_FACE = """
import sys

import h5py
import numpy as np
from datasets import load_dataset

data = load_dataset("hdf5", data_files=sys.argv[1], split="train").with_format("numpy")
with h5py.File(sys.argv[1]) as file:
    assert np.array_equal(data["signal"], file["signal"][:])
    assert [row["force"][0] for row in data["truth"]] == list(range(len(data)))
    grades = [row["grade"] for row in data["manifest"]]
    assert grades == file["manifest"]["grade"].tolist()
test = data.filter(lambda row: row["mine"] == 1, input_columns="splits")
print(len(data), len(test), *sorted(data.column_names))
"""


def test_hugging_face_reads_the_file_as_it_is(path, tmp_path):
    found = run(HUGGING_FACE, path, tmp_path)
    assert found == [str(N), str(N // 2), "manifest", "signal", "splits", "truth"]
