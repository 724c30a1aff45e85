"""Exports: every format holds the same numbers, comes back whole, and replaces nothing unasked."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from glob import glob
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal
from scipy.io import wavfile
from wearstate.datasets.audit.integrity import check_set
from wearstate.datasets.convert import export
from wearstate.datasets.convert.export import ABOUT, FORMATS, LABELS, export_set
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.measured.label_columns import RESERVED
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.feature_rows.feature_table import recording_features
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

from .command_line import run

N = 6


@pytest.fixture(scope="module")
def pump(tmp_path_factory):
    """Six simulated records with two severities, confounders and hidden quantities."""
    path = tmp_path_factory.mktemp("pump") / "data.h5"
    recipe = load_recipe("bilge-pump-faults", {"duration": "1 s"})
    generate(recipe, N, path, seed=1, truth=True)
    return path


@pytest.fixture(scope="module")
def signals(pump):
    with DataSet(pump) as data:
        return np.stack([item.signal for item in data])


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """Three records, the second of which failed; a rate that no WAV header holds."""
    path = tmp_path_factory.mktemp("mixed") / "mixed.h5"
    head = Attributes(
        sample_rate=1000.5,
        channels=(Channel(name="acc", unit="m/s^2", quantity="acceleration"),),
        origin="simulated",
        severities=("scar_depth_bearing_m",),
    )
    columns = {"scar_depth_bearing_m": "<f8", "fault": "S20", "confounder_loud": "?"}
    with DataSetWriter(path, head, n_records=3, n_samples=50, columns=columns) as writer:
        for i in range(3):
            row = {
                "record_id": f"{i}", "group": i, "seed": i, "grade": -1,
                "status": "diverged" if i == 1 else "ok", "fault": 'outer, "race"',
                "scar_depth_bearing_m": np.nan if i == 0 else 1e-5 / 3, "confounder_loud": i == 2,
            }  # fmt: skip
            signal = np.random.default_rng(i).standard_normal((1, 50)) * (i != 1)
            writer.write(i, signal, row)
        writer.finish()
    return path


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


# -- there and back ----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["wav", "csv"])
def test_a_folder_comes_back_by_the_command_it_names(pump, signals, tmp_path, kind):
    made = export_set(pump, tmp_path / "out put", kind=kind)
    assert made.n_records == N
    words = shlex.split(made.import_command)
    assert words[:2] == ["wearstate", "import"]
    files = [Path(file).as_posix() for file in glob(words[2])]
    run("import", *files, *words[3:-1], tmp_path / "back.h5")
    with DataSet(pump) as old, DataSet(tmp_path / "back.h5") as new:
        assert_array_equal([item.signal for item in new], signals)  # to the last bit
        before, after = old.attributes, new.attributes
        same = ("sample_rate", "tacho", "severities", "grade_edges", "condemning_limit")
        assert [getattr(before, n) for n in same] == [getattr(after, n) for n in same]
        assert [(c.name, c.unit) for c in before.channels] == [
            (c.name, c.unit) for c in after.channels
        ]
        told = old.manifest.replace("", np.nan).dropna(axis="columns", how="all")
        assert len(told.columns) > 30
        for name in sorted(set(told) - set(RESERVED)):
            assert_array_equal(old.manifest[name].to_numpy(), new.manifest[name].to_numpy(), name)
        for i in range(N):
            (names, one), (same_names, two) = recording_features(old[i]), recording_features(new[i])
            assert names == same_names
            assert_array_equal(one, two)


def test_a_compressed_copy_is_the_same_data_set(pump, tmp_path):
    copy, plain = tmp_path / "copy.h5", tmp_path / "plain.h5"
    small = export_set(pump, copy, compress=True)
    export_set(copy, plain)
    assert small.n_bytes < 0.75 * pump.stat().st_size  # 0.6 of noise with a tacho, by shuffle
    with h5py.File(pump) as one, h5py.File(copy) as two, h5py.File(plain) as three:
        assert (two["signal"].compression, two["signal"].shuffle) == ("gzip", True)
        assert two["signal"].chunks == one["signal"].chunks
        assert three["signal"].compression is None
        for name in ("signal", "manifest", *(f"truth/{key}" for key in one["truth"])):
            for other in (two, three):
                assert one[name].dtype == other[name].dtype
                assert one[name][:].tobytes() == other[name][:].tobytes()
        assert dict(one.attrs) == dict(two.attrs) == dict(three.attrs)
    for path in (copy, plain):
        assert check_set(path).sound
        with DataSet(path) as data, DataSet(pump) as original:
            assert_array_equal(data[-1].signal, original[-1].signal)
            assert data.truth(2).keys() == original.truth(2).keys()


def test_splits_go_with_a_copy(mixed, tmp_path):
    source, copy = tmp_path / "a.h5", tmp_path / "b.h5"
    shutil.copy(mixed, source)
    with h5py.File(source, "r+") as file:
        file["splits/mine"] = np.array([0, 1, -1], dtype=np.int8)
        file["splits/mine"].attrs["about"] = np.bytes_('{"kind": "random"}')
    export_set(source, copy, compress=True)
    with DataSet(copy) as data:
        assert [side.tolist() for side in data.split("mine")] == [[0], [1]]


def test_a_copy_of_an_old_file_has_hashes(mixed, tmp_path):
    old, copy = tmp_path / "old.h5", tmp_path / "copy.h5"
    shutil.copy(mixed, old)
    with h5py.File(old, "r+") as file:
        del file.attrs["manifest_sha256"], file.attrs["attributes_sha256"]
    export_set(old, copy)
    with DataSet(old) as one, DataSet(copy) as two:
        assert one.unhashed == ("attributes_sha256", "manifest_sha256")
        assert two.unhashed == ()


@pytest.mark.parametrize("compress", [False, True])
def test_npz_holds_everything_without_pickle(pump, signals, tmp_path, compress):
    made = export_set(pump, tmp_path / "x.npz", compress=compress)
    with np.load(made.path, allow_pickle=False) as file, DataSet(pump) as data:
        assert_array_equal(file["signal"], signals)
        assert file["sample_rate_hz"] == 25600.0
        assert file["channels"].tolist() == ["acc_x", "acc_y", "tacho"]
        assert file["units"].tolist() == ["m/s^2", "m/s^2", "V"]
        for name in data.manifest:
            assert_array_equal(file[f"manifest.{name}"], data.manifest[name].to_numpy())
        assert json.loads(str(file["attributes"]))["scene"] == data.attributes.scene
        for name, values in data.truth(4).items():
            assert_array_equal(file[f"truth.{name}"][4], values)


def test_parquet_has_a_column_for_every_label_and_channel(pump, signals, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    labels, whole = tmp_path / "a.parquet", tmp_path / "b.parquet"
    export_set(pump, labels)
    export_set(pump, whole, signals=True)
    with DataSet(pump) as data:
        pd.testing.assert_frame_equal(pd.read_parquet(labels), data.manifest)
        table = pd.read_parquet(whole)
        pd.testing.assert_frame_equal(table[list(data.manifest)], data.manifest)
        about = json.loads(parquet.read_schema(whole).metadata[b"wearstate"])
        assert about["sample_rate_hz"] == data.attributes.sample_rate
    for i, name in enumerate(["acc_x", "acc_y", "tacho"]):
        assert_array_equal(np.stack(table[name]), signals[:, i])


def test_row_groups_meet_without_a_gap(pump, signals, tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    monkeypatch.setattr(export, "_ROWS", 4)  # six records: a full group and a rest
    export_set(pump, tmp_path / "b.parquet", signals=True)
    assert_array_equal(np.stack(pd.read_parquet(tmp_path / "b.parquet")["acc_y"]), signals[:, 1])


def test_wav_is_what_other_programs_read(pump, signals, tmp_path):
    export_set(pump, tmp_path / "out", kind="wav")
    rate, samples = wavfile.read(tmp_path / "out" / "00000002.wav")
    assert (rate, samples.dtype) == (25600, np.float32)
    assert_array_equal(samples.T, signals[2])
    about = json.loads((tmp_path / "out" / ABOUT).read_text())
    assert about["attributes"]["origin"] == "simulated"


# -- what a format cannot say --------------------------------------------------------------------


def test_failed_records_are_left_out_of_folders_and_kept_in_files(mixed, tmp_path):
    made = export_set(mixed, tmp_path / "out", kind="csv")
    assert (made.n_records, made.n_left_out) == (2, 1)
    assert names_in(tmp_path / "out") == ["00000000.csv", "00000002.csv", ABOUT, LABELS]
    assert "1 left out: their status is not ok" in export.exported_text(made)
    assert export_set(mixed, tmp_path / "x.npz").n_left_out == 0
    with np.load(tmp_path / "x.npz") as file:
        assert file["manifest.status"].tolist() == ["ok", "diverged", "ok"]


def test_what_is_not_known_is_an_empty_cell(mixed, tmp_path):
    export_set(mixed, tmp_path / "out", kind="csv")
    table = pd.read_csv(tmp_path / "out" / LABELS, dtype=str, keep_default_na=False)
    assert "grade" not in table  # known of none
    assert table["scar_depth_bearing_m"].tolist() == ["", repr(1e-5 / 3)]
    assert table["confounder_loud"].tolist() == ["0", "1"]
    assert table["fault"].tolist() == ['outer, "race"'] * 2


def test_a_rate_that_wav_cannot_hold_is_refused(mixed, tmp_path):
    with pytest.raises(DataError, match=r"sample_rate = 1000\.5 Hz must be a whole number"):
        export_set(mixed, tmp_path / "out", kind="wav")
    assert names_in(tmp_path) == []


# -- refused -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.txt", {}, r"suffix '\.txt' must be one of \.h5, \.hdf5, \.parquet, \.npz; rename it"),
        ("a", {}, "or give kind wav or csv for a folder"),
        ("a.npz", {"kind": "parquet"}, r"must be \.parquet for kind parquet"),
        ("a.npz", {"kind": "flac"}, "kind = 'flac' must be one of h5, parquet, npz, wav, csv"),
        ("a", {"kind": "wav", "compress": True}, "compress must be left out of wav: it is"),
        ("a.npz", {"signals": True}, "signals must be left out of npz, which"),
        ("no/a.npz", {}, "is not a folder; create it"),
        ("no/a", {"kind": "csv"}, "is not a folder; create it"),
    ],
)
def test_a_contradictory_request_is_refused(mixed, tmp_path, name, options, message):
    with pytest.raises(DataError, match=message):
        export_set(mixed, tmp_path / name, **options)
    assert names_in(tmp_path) == []


def test_both_wrong_options_are_told_at_once(mixed, tmp_path):
    with pytest.raises(DataError, match=r"compress must .*\nsignals must "):
        export_set(mixed, tmp_path / "a", kind="csv", compress=True, signals=True)


def test_the_input_is_never_the_output(mixed, tmp_path):
    copy = tmp_path / "a.h5"
    shutil.copy(mixed, copy)
    with pytest.raises(DataError, match="is also the input"):
        export_set(copy, copy, force=True)
    (tmp_path / "b.h5").hardlink_to(copy)
    with pytest.raises(DataError, match="is also the input"):
        export_set(copy, tmp_path / "b.h5", force=True)


def test_files_are_replaced_only_when_forced(mixed, tmp_path):
    target = tmp_path / "a.npz"
    target.write_text("mine")
    with pytest.raises(DataError, match="exists; choose another name or use force"):
        export_set(mixed, target)
    assert target.read_text() == "mine"
    export_set(mixed, target, force=True)
    with np.load(target) as file:
        assert len(file["signal"]) == 3


def test_only_an_exported_folder_is_ever_replaced(mixed, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    export_set(mixed, out, kind="csv")  # an empty one may be used
    (out / "00000009.csv").write_text("of an earlier export")
    with pytest.raises(DataError, match="exists; choose another name or use force"):
        export_set(mixed, out, kind="csv")
    export_set(mixed, out, kind="csv", force=True)
    assert "00000009.csv" not in names_in(out)
    (out / ABOUT).unlink()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(DataError, match="no export made it: it is never replaced"):
        export_set(mixed, out, kind="csv", force=True)
    with pytest.raises(DataError, match="is a file, must be a folder for csv"):
        export_set(mixed, tmp_path / "file", kind="csv", force=True)


@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"wav"}))  # its rate is refused before
def test_nothing_is_left_of_an_export_that_fails(mixed, tmp_path, name):
    """A damaged signal in the middle: refused, and neither output nor scratch stays."""
    source = tmp_path / "in" / "a.h5"
    source.parent.mkdir()
    shutil.copy(mixed, source)
    with h5py.File(source) as file:
        place = file["signal"].id.get_chunk_info(2).byte_offset
    raw = bytearray(source.read_bytes())
    raw[place] ^= 1
    source.write_bytes(raw)
    out = tmp_path / "out"
    out.mkdir()
    target = out / ("x" if FORMATS[name].folder else f"x{FORMATS[name].suffixes[0]}")
    with pytest.raises(DataError, match="signal of record 2 has checksum"):
        export_set(source, target, kind=name, signals=name == "parquet")
    assert names_in(out) == []


def test_a_killed_export_leaves_no_output(pump, tmp_path):
    code = (
        "import os, sys\n"
        "from wearstate.datasets.convert.export import export_set\n"
        "export_set(sys.argv[1], sys.argv[2], kind='csv', progress=lambda i, n: os._exit(9))\n"
    )
    target = tmp_path / "out"
    done = subprocess.run([sys.executable, "-c", code, pump, target], check=False)
    assert done.returncode == 9
    [left] = names_in(tmp_path)
    assert re.fullmatch(r"out\.[0-9a-f]{8}\.tmp", left)
    (tmp_path / "out.part").touch()  # of an earlier version
    export_set(pump, target, kind="csv")
    export_set(pump, target, kind="csv", force=True)
    assert names_in(tmp_path) == sorted([left, "out", "out.part"])


def test_without_pyarrow_parquet_says_what_to_install(mixed, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DataError, match=r"pip install wearstate\[parquet\], or export \.npz"):
        export_set(mixed, tmp_path / "x.parquet")
    assert names_in(tmp_path) == []


def test_the_same_export_gives_the_same_bytes(mixed, tmp_path):
    for suffix in (".npz", ".parquet"):
        one, two = (export_set(mixed, tmp_path / f"{n}{suffix}").path for n in "ab")
        assert one.read_bytes() == two.read_bytes()


# -- the command ---------------------------------------------------------------------------------


def test_the_command(mixed, tmp_path):
    made = json.loads(run("export", mixed, "-o", tmp_path / "x.npz", "--json").stdout)
    assert (made["kind"], made["n_records"]) == ("npz", 3)
    text = run("export", mixed, "-o", tmp_path / "out", "--as", "csv").stdout
    assert "back: wearstate import" in text
    refused = run("export", mixed, "-o", tmp_path / "out", "--as", "csv", code=2)
    assert "use --force to replace it" in refused.stderr
    run("export", mixed, "-o", tmp_path / "out", "--as", "csv", "--force")
    assert "--compress must" in run("export", mixed, "-o", tmp_path / "y", "--as", "csv",
                                      "--compress", code=2).stderr  # fmt: skip
