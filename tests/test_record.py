"""The data set file: what is written comes back, and nothing damaged passes as data."""

import json
import os
import pickle
import shutil
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import Pipe, get_context
from operator import getitem
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from wearstate.datasets.file import hdf5_values, writer
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.hdf5_values import is_plain
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel

N_RECORDS, N_SAMPLES = 3, 40
CHANNELS = (
    Channel(name="acc", unit="m/s^2", quantity="acceleration", place="housing", direction="x"),
    Channel(name="tacho", unit="V", quantity="tacho"),
)
HEAD = Attributes(
    sample_rate=1000.0,
    channels=CHANNELS,
    origin="simulated",
    tacho="tacho",
    pulses_per_revolution=2,
    severities=("clearance_m",),
    grade_edges=(1e-4, 2e-4, 3e-4),
    condemning_limit=3e-4,
    limit_source="a manual, § 3",
    recipe="name = 'r'",
    scene="name = 's'",
    seed=2**63 + 1,
)
COLUMNS = {"clearance_m": "<f8", "steps": "<i8", "rung": "S8"}


def signal_of(index):
    return np.random.default_rng(index).standard_normal((2, N_SAMPLES)).astype(np.float32)


def row_of(index):
    return {
        "record_id": f"{index:08d}",
        "group": index // 2,
        "seed": 2**64 - 1 - index,
        "status": "ok",
        "grade": index % 4,
        "clearance_m": 1e-4 * (index + 1),
        "rung": "µ",
    }


def begin(path, head=HEAD, n_records=N_RECORDS, **options):
    return DataSetWriter(
        path, head, n_records=n_records, n_samples=N_SAMPLES, columns=COLUMNS, **options
    )


def write_all(path, *, truth=False, **options):
    with begin(path, **options) as writer:
        for i in range(N_RECORDS):
            hidden = {"force": np.full((N_SAMPLES, 2), i), "peak": np.array(i)} if truth else None
            writer.write(i, signal_of(i), row_of(i), hidden)
        writer.finish()
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "data.h5"


def test_a_file_that_is_not_gone_on_with_goes_where_its_run_fails(path):
    def fails(writer):
        raise OSError("no space left")

    def cannot_be_closed(writer):
        writer.close()
        writer.close = lambda: fails(writer)

    for resumable in (False, True):
        for fault in (fails, cannot_be_closed):
            writer = begin(path, resumable=resumable, force=True)
            with pytest.raises(OSError, match="no space left"), writer:
                fault(writer)
            assert writer.part.exists() == resumable


def test_what_is_written_comes_back(path):
    with DataSet(write_all(path)) as data:
        assert len(data) == N_RECORDS
        assert data.attributes == HEAD
        for i, item in enumerate(data):
            assert_array_equal(item.signal, signal_of(i))
            assert {**row_of(i), "done": True, "steps": -1}.items() <= dict(item.row).items()
        assert data.manifest["seed"].tolist() == [2**64 - 1 - i for i in range(N_RECORDS)]
        assert data.manifest["rung"].tolist() == ["µ"] * N_RECORDS
    assert list(path.parent.iterdir()) == [path]


def test_a_record_knows_its_channels(path):
    with DataSet(write_all(path)) as data:
        item = data[-1]
    assert item.source == "data.h5[2]"
    assert (item.vibration_names, item.tacho, item.origin) == (("acc",), "tacho", "simulated")
    assert item.units == {"acc": "m/s^2", "tacho": "V"}
    assert_array_equal(item.vibration, signal_of(2)[:1])
    assert_array_equal(item.tacho_signal, signal_of(2)[1])
    assert (item.duration, item.pulses_per_revolution) == (0.04, 2)


def test_every_dataset_has_the_record_first(path):
    write_all(path, truth=True)
    lengths = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, node: (
                lengths.update({name: len(node)}) if isinstance(node, h5py.Dataset) else None
            )
        )
        assert file["signal"].chunks == (1, 2, N_SAMPLES)
        assert file["signal"].compression is None
    assert lengths == dict.fromkeys(["signal", "manifest", "truth/force", "truth/peak"], N_RECORDS)
    with DataSet(path) as data:
        assert_array_equal(data.truth(1)["force"], np.ones((N_SAMPLES, 2)))
        assert data.truth(2)["peak"] == 2


def test_index_past_the_end(path):
    with DataSet(write_all(path)) as data, pytest.raises(IndexError, match="record 3 must be < 3"):
        data[3]


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_loader_processes_open_it_themselves(path, start):
    with DataSet(write_all(path)) as data:
        data[0]  # the parent's handle is open
        with ProcessPoolExecutor(1, mp_context=get_context(start)) as pool:
            items = list(pool.map(getitem, [data] * 3, range(3)))
        assert_array_equal([item.signal for item in items], [signal_of(i) for i in range(3)])
        copy = pickle.loads(pickle.dumps(data))
        data.close()
        assert_array_equal(copy[1].signal, signal_of(1))
        copy.close()


def opened_by(data, pipe):
    pipe.send((data[1].signal, data._pid == os.getpid()))


def test_a_handle_does_not_cross_a_fork(path):
    receiving, sending = Pipe(duplex=False)
    with DataSet(write_all(path)) as data:
        data[0]  # the parent's handle is open
        child = get_context("fork").Process(target=opened_by, args=(data, sending))
        child.start()
        signal, own = receiving.recv()
        child.join()
    assert_array_equal(signal, signal_of(1))
    assert own


# -- refused -----------------------------------------------------------------------------------


def test_every_truncation_is_refused(path, tmp_path):
    whole = write_all(path, truth=True).read_bytes()
    cut = tmp_path / "cut.h5"
    # 61 is prime to the 8-byte grid of HDF5, so cuts fall inside every kind of structure
    for size in [*range(0, len(whole), 61), len(whole) - 1]:
        cut.write_bytes(whole[:size])
        with pytest.raises(DataError, match=r"cut\.h5"):
            DataSet(cut)


@pytest.mark.parametrize("seed", range(3))
def test_a_flipped_bit_in_a_signal_is_refused(path, seed):
    write_all(path)
    with h5py.File(path) as file:
        place = file["signal"].id.get_chunk_info(1).byte_offset
    raw = bytearray(path.read_bytes())
    bit = int(np.random.default_rng(seed).integers(8 * 2 * 4 * N_SAMPLES))
    raw[place + bit // 8] ^= 1 << bit % 8
    path.write_bytes(raw)
    with DataSet(path) as data:
        assert_array_equal(data[0].signal, signal_of(0))
        with pytest.raises(DataError, match=r"signal of record 1 has checksum \d+, must be \d+"):
            data[1]


def stamp(path, name, value):
    with h5py.File(path, "r+") as file:
        file.attrs[name] = value


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("schema_version", 2, r"schema_version = 2 must be 1; update wearstate"),
        ("schema_version", 0, r"schema_version = 0 must be 1; generate it again"),
        ("created_by", "other 1.0", r"created_by = 'other 1.0', must begin with 'wearstate'"),
        ("scene", "name = 't'", r"text of the scene does not fit its hash"),
        ("channels", "[", r"attributes cannot be read"),
        (
            "channels",
            json.dumps([{"name": "acc", "unit": "g", "quantity": "x"}]),
            "tacho = 'tacho'",
        ),
        ("sample_rate_hz", -1.0, r"sample_rate = -1.0 Hz must be >= 0.001"),
        ("severities", '["size_m"]', r"manifest lacks size_m"),
    ],
)
def test_foreign_attributes_are_refused(path, name, value, message):
    stamp(write_all(path), name, value)
    with pytest.raises(DataError, match=message):
        DataSet(path)


def attributes_of(path):
    """Type of every attribute of a file and what is in it."""
    kinds = {}
    with h5py.File(path) as file:
        for name, node in {"/": file, **dict(file["splits"].items())}.items():
            kinds |= {(name, key): node.attrs.get_id(key).get_type() for key in node.attrs}
    return kinds


def test_nothing_of_a_file_lies_in_a_heap_and_no_text_is_padded(path):
    with begin(path, splits=("mine", "later")) as writer:
        for i in range(N_RECORDS):
            writer.write(i, signal_of(i), row_of(i))
        writer.write_split("mine", np.zeros(N_RECORDS, np.int8), '{"kind": "µ"}')
        writer.finish()
    kinds = attributes_of(path)
    assert len(kinds) > 15
    assert all(is_plain(kind) for kind in kinds.values())
    assert b"GCOL" not in path.read_bytes()
    with h5py.File(path) as file:
        assert file["splits/mine"].attrs["about"].decode() == '{"kind": "µ"}'
    with DataSet(path) as data:
        assert data.splits == {"mine": {"kind": "µ"}}
        assert data.attributes == HEAD


def loosened(path):
    """The same file with texts of variable length, as other programs write them."""
    with h5py.File(path, "r+") as file:
        for name, value in dict(file.attrs).items():
            if isinstance(value, bytes):
                file.attrs[name] = value.decode()
    return path


def test_texts_of_variable_length_are_read_by_another_process(path, monkeypatch):
    loosened(write_all(path))
    with DataSet(path) as data:
        assert data.attributes == HEAD
    raw = bytearray(path.read_bytes())
    place = raw.index(b"GCOL") + 24  # size of the first text: the library's walk stands still
    raw[place : place + 8] = b"\xff" * 8
    path.write_bytes(raw)
    monkeypatch.setattr(hdf5_values, "_LONGEST_READING", 2.0)
    with pytest.raises(DataError, match=r"attributes cannot be read \(the texts of .*intact copy"):
        DataSet(path)


@pytest.mark.parametrize("name", ["signal", "manifest", "splits/x", "truth/x"])
def test_values_in_a_heap_are_refused(path, name):
    write_all(path)
    with h5py.File(path, "r+") as file:
        if name in file:
            del file[name]
        file.create_dataset(name, data=["a"] * N_RECORDS, dtype=h5py.string_dtype())
    with pytest.raises(DataError, match=rf"/{name} must hold numbers and texts"):
        DataSet(path)


def test_attributes_that_are_no_number_and_no_text_are_refused(path):
    stamp(write_all(path), "channels", np.zeros(3))
    with pytest.raises(DataError, match="'channels' must be one number or one text"):
        DataSet(path)


def test_files_of_others_are_refused(tmp_path):
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["x"] = np.zeros(3)
    with pytest.raises(DataError, match="created_by = None, must begin with 'wearstate'"):
        DataSet(other)
    other.write_text("no HDF5")
    with pytest.raises(DataError, match="file cannot be read"):
        DataSet(other)
    measured = tmp_path / "pump.wav"
    measured.write_bytes(b"RIFF and so on")
    told = (
        r"pump\.wav is not a data set; .*: wearstate import pump\.wav -o data\.h5, with their units"
    )
    with pytest.raises(DataError, match=told):
        DataSet(measured)
    with pytest.raises(DataError, match=r"absent\.h5: no such file; check the path"):
        DataSet(tmp_path / "absent.h5")


@pytest.mark.parametrize(
    ("n_samples", "message"),
    [
        (2**40, "declares 8796093022208 byte per record"),  # reading one would ask for 8 TB
        (1000, r"declares 8000 byte .* and holds 0 of 24000 byte"),  # would read as zeros
    ],
)
def test_sizes_the_file_does_not_hold_are_refused(path, n_samples, message):
    write_all(path)
    with h5py.File(path, "r+") as file:
        del file["signal"]
        chunks = (1, 1, min(n_samples, 2**20))
        file.create_dataset("signal", (N_RECORDS, 2, n_samples), np.float32, chunks=chunks)
    with pytest.raises(DataError, match=message):
        DataSet(path)


def test_an_unfinished_file_is_refused(path):
    with begin(path) as writer:
        writer.write(0, signal_of(0), row_of(0))
    part = path.with_name("data.h5.part")
    with pytest.raises(DataError, match="unfinished data set; run the same generate command"):
        DataSet(part)
    with pytest.raises(DataError, match=r"no such file; data\.h5\.part is there"):
        DataSet(path)
    shutil.copy(part, path)
    with pytest.raises(DataError, match="1 of 3 records are done, must be all"):
        DataSet(path)


# -- writing -----------------------------------------------------------------------------------


def test_existing_output_is_kept_unless_forced(path):
    before = write_all(path).read_bytes()
    with pytest.raises(DataError, match="exists; choose another name or use force"):
        begin(path)
    assert path.read_bytes() == before
    with begin(path, force=True) as writer:  # not finished: the old file stays
        writer.write(0, signal_of(5), row_of(0))
    assert path.read_bytes() == before
    write_all(path, force=True)
    assert list(path.parent.iterdir()) == [path]


def test_a_folder_is_no_output(path):
    path.mkdir()
    with pytest.raises(DataError, match="is a folder; name a file in it"):
        begin(path, force=True)


def test_nothing_is_left_when_set_up_fails(path, monkeypatch):
    def fail(*_, **__):
        raise OSError("no space")

    monkeypatch.setattr(writer, "_create", fail)
    with pytest.raises(DataError, match=r"data\.h5 cannot be made \(no space\); check rights"):
        begin(path)
    assert list(path.parent.iterdir()) == []


def test_a_full_disk_is_told_beforehand(path, monkeypatch):
    monkeypatch.setattr(writer.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
    with pytest.raises(DataError, match=r"1 kB are free, must be >= [1-9][.\d]* kB; ask for fewer"):
        begin(path)
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize(
    ("signal", "row", "message"),
    [
        (np.zeros((2, 5)), {}, r"shape \(2, 5\), must be \(2, 40\)"),
        (np.full((2, N_SAMPLES), np.nan), {}, r"80 sample\(s\) that are not finite"),
        (signal_of(0), {"speed": 1.0}, r"unknown columns \['speed'\]"),
        (signal_of(0), {"rung": "a long name"}, r"rung = 'a long name' .* must be <= 8 byte"),
    ],
)
def test_rows_that_do_not_fit_are_refused(path, signal, row, message):
    with begin(path) as writer:
        with pytest.raises(DataError, match=message):
            writer.write(0, signal, row)
        assert not writer.done.any()
        with pytest.raises(DataError, match="0 of 3 records are done"):
            writer.finish()


def test_a_stopped_file_goes_on_where_it_was(path):
    with begin(path) as writer:
        writer.write(1, signal_of(1), row_of(1))
    with begin(path) as writer:
        assert writer.done.tolist() == [False, True, False]
        for i in (2, 0):
            writer.write(i, signal_of(i), row_of(i))
        writer.finish()
    with DataSet(path) as data:
        assert all((item.signal == signal_of(i)).all() for i, item in enumerate(data))


def test_a_record_lost_by_the_disk_is_written_again(path):
    with begin(path) as writer:
        for i in (0, 1):
            writer.write(i, signal_of(i), row_of(i))
        place = writer._signal.id.get_chunk_info(1).byte_offset
    part = path.with_name("data.h5.part")
    raw = bytearray(part.read_bytes())
    raw[place : place + 64] = bytes(64)  # as after a power cut
    part.write_bytes(raw)
    with begin(path) as writer:
        assert writer.done.tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 1}, r"seed = '9223372036854775809', must be '1' to go on"),
        ({"recipe": "name = 'q'"}, r"recipe_sha256 = "),
        ({"created_by": "wearstate 9"}, r"created_by = 'wearstate .*', must be 'wearstate 9'"),
    ],
)
def test_another_run_does_not_go_on_with_it(path, change, message):
    begin(path).close()
    head = Attributes(**{**HEAD.__dict__, **change})
    with pytest.raises(DataError, match=message):
        begin(path, head=head)
    with pytest.raises(DataError, match=r"must be \(4, 2, 40\)"):
        begin(path, n_records=4)
    begin(path, head=head, force=True).close()  # starts anew


def test_two_runs_do_not_share_a_file(path):
    again = partial(
        DataSetWriter, path, HEAD, n_records=N_RECORDS, n_samples=N_SAMPLES, columns=COLUMNS
    )
    with (
        begin(path),
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(DataError, match=r"\.part is being written by another run; wait"),
    ):
        pool.submit(again).result()


def test_a_text_too_long_for_the_file_is_refused():
    with pytest.raises(DataError, match="text of recipe must be <= 60000 byte"):
        Attributes(**{**HEAD.__dict__, "recipe": "x" * 60_001})


# -- a recording -------------------------------------------------------------------------------


def test_a_gap_is_named():
    signal = np.zeros((2, 10))
    signal[1, [4, 7]] = np.nan, np.inf
    with pytest.raises(DataError, match=r"channel 'tacho' has 2 sample\(s\).* first at index 4"):
        Recording(signal=signal, sample_rate=1.0, channels=CHANNELS)


def test_a_value_beyond_float32_is_no_silent_infinity():
    with pytest.raises(DataError, match="channel 'acc' has 1 sample"):
        Recording(signal=[[1e39], [0.0]], sample_rate=1.0, channels=CHANNELS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"signal": np.zeros(4)}, r"shape \(4,\), must be \(2 channels, >= 1 samples\)"),
        ({"signal": np.zeros((2, 0))}, r"shape \(2, 0\)"),
        ({"sample_rate": 0.0}, r"sample_rate = 0.0 Hz must be >= 0.001"),
        ({"tacho": "key"}, r"tacho = 'key' must be one of"),
        ({"channels": CHANNELS[:1] * 2}, r"\['acc', 'acc'\] must be unique"),
        ({"pulses_per_revolution": 0}, r"pulses_per_revolution = 0 must be >= 1"),
    ],
)
def test_a_contradictory_recording_is_refused(change, message):
    whole = {"signal": np.zeros((2, 4)), "sample_rate": 1.0, "channels": CHANNELS, **change}
    with pytest.raises(DataError, match=message):
        Recording(**whole)


def test_one_channel_without_tacho():
    item = Recording(signal=np.ones((1, 4)), sample_rate=8.0, channels=CHANNELS[:1])
    assert (item.tacho_signal, item.vibration.shape, item.duration) == (None, (1, 4), 0.5)
