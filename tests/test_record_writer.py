"""The writer: nothing but bytes in their place after the layout, and every fault told."""

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from wearstate.datasets.file import writer
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter, WriteError
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

HEAD = Attributes(
    sample_rate=100.0,
    channels=(Channel(name="acc", unit="m/s^2", quantity="acceleration"),),
    origin="simulated",
)
N_RECORDS, N_SAMPLES = 5, 40
ROW = {"record_id": "r", "status": "ok"}


def begin(path, **options):
    return DataSetWriter(path, HEAD, n_records=N_RECORDS, n_samples=N_SAMPLES, **options)


def signal_of(index):
    return np.full((1, N_SAMPLES), index + 1.0)


def hidden(index):
    return {"force": np.full(3, index + 1.0), "orbit": np.full((2, 2), index + 1.0)}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "data.h5"


@pytest.fixture
def part(path):
    return path.with_name("data.h5.part")


OPEN_FLAG = 20
"""Byte of the superblock that says open for writing; no reader of this version minds it."""


def changed(before, after):
    """Places at which two files of one size differ."""
    assert len(before) == len(after)
    found = np.frombuffer(before, np.uint8) != np.frombuffer(after, np.uint8)
    found[OPEN_FLAG] = False
    return np.flatnonzero(found)


def test_only_bytes_in_their_place_change_after_the_layout(path, part):
    with begin(path) as writer:
        writer.write(0, signal_of(0), ROW, hidden(0))
        before = part.read_bytes()
        writer.write(3, signal_of(3), ROW, hidden(3))
        file = writer._file
        places = [
            (file[name].id.get_chunk_info(3).byte_offset, file[name][3].nbytes)
            for name in ("signal", "truth/force", "truth/orbit")
        ]
        size = file["manifest"].dtype.itemsize
        places.append((file["manifest"].id.get_offset() + 3 * size, size))
    allowed = np.concatenate([np.arange(start, start + size) for start, size in places])
    found = changed(before, part.read_bytes())
    assert found.size > 100
    assert set(found) <= set(allowed)


def test_finishing_changes_the_hash_in_its_place_and_no_structure(path, part):
    with begin(path) as writer:
        for i in range(N_RECORDS):
            writer.write(i, signal_of(i), ROW)
        before = part.read_bytes()
        writer.finish()
    # the 64 characters of one hash, of which about one in 16 stays the same
    places = changed(before, path.read_bytes())
    assert 40 < places.size <= 64
    assert np.ptp(places) < 64


def test_hidden_quantities_that_come_late_keep_what_was_written(path, part):
    with begin(path) as writer:
        writer.write(2, signal_of(2), {"record_id": "failed", "status": "diverged"})
        inode = part.stat().st_ino
        writer.write(4, signal_of(4), ROW, hidden(4))
        assert part.stat().st_ino != inode  # laid out anew, beside itself
        assert writer.done.tolist() == [False, False, True, False, True]
        inode = part.stat().st_ino
        for i in (0, 1, 3):
            writer.write(i, signal_of(i), ROW, hidden(i))
        assert part.stat().st_ino == inode
        writer.finish()
    with DataSet(path) as data:
        assert [item.signal[0, 0] for item in data] == [1, 2, 3, 4, 5]
        assert data.manifest["status"][2] == "diverged"
        assert not data.truth(2)["force"].any()
        assert data.truth(4)["orbit"].tolist() == hidden(4)["orbit"].tolist()


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="the system cannot claim space")
def test_the_disk_is_claimed_for_all_records_beforehand(path, part):
    with DataSetWriter(path, HEAD, n_records=100, n_samples=4096):
        status = part.stat()
    assert status.st_size > 100 * 4 * 4096
    # blocks of 512 byte; a file of holes has next to none
    assert 512 * status.st_blocks >= status.st_size


def test_no_run_takes_the_file_of_another_by_force(path, part):
    with begin(path) as writer:
        writer.write(0, signal_of(0), ROW)
        with pytest.raises(DataError, match=r"data\.h5\.part is being written by another run"):
            other_process(path, force=True)
        with pytest.raises(DataError, match=r"data\.h5\.part is being written by another run"):
            other_process(path)
        writer.write(1, signal_of(1), ROW)
    with begin(path) as writer:
        assert writer.done.sum() == 2


def other_process(path, **options):
    from concurrent.futures import ProcessPoolExecutor
    from functools import partial
    from multiprocessing import get_context

    # HDF5 takes a file that is open here already for the same one: another process must ask
    size = {"n_records": N_RECORDS, "n_samples": N_SAMPLES}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        pool.submit(partial(DataSetWriter, path, HEAD, **size, **options)).result()


FULL = (
    "Can't write data (file write failed: time = now, filename = 'x', errno = 28, error message = "
    "'No space left on device', buf = 0x1)"
)


def test_a_disk_that_runs_full_is_told_and_the_file_goes_on(path, monkeypatch):
    def full(self):
        raise OSError(FULL)

    with begin(path) as writer:
        writer.write(0, signal_of(0), ROW)
        with monkeypatch.context() as patch:
            patch.setattr(h5py.File, "flush", full)
            message = (
                r"data\.h5\.part cannot be written \(No space left on device\); repair the disk"
            )
            with pytest.raises(WriteError, match=message):
                writer.write(1, signal_of(1), ROW)
        assert writer.done.tolist() == [True, False, False, False, False]
    with begin(path) as writer:
        assert writer.done[0]


LIMITED = """
import resource, sys
from pathlib import Path
import numpy as np
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter, WriteError
from wearstate.sim.output.sensor import Channel
channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
head = Attributes(sample_rate=100.0, channels=(channel,), origin="simulated")
size = Path(sys.argv[1] + ".part").stat().st_size
resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, size // 2))
try:
    with DataSetWriter(sys.argv[1], head, n_records=5, n_samples=9000) as writer:
        hidden = {"force": np.ones(9000)} if sys.argv[2] == "hidden" else {}
        for index in range(5):
            writer.write(index, np.ones((1, 9000)), {"record_id": "r", "status": "ok"}, hidden)
except WriteError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of resources")
@pytest.mark.parametrize("what", ["hidden", "row"])
def test_a_write_that_fails_leaves_nothing_that_closing_fails_over(path, what):
    """The first half of the file may be written: signals, not the rows or hidden quantities."""
    hidden = {"force": np.ones(9000)} if what == "hidden" else {}
    with DataSetWriter(path, HEAD, n_records=5, n_samples=9000) as writer:
        writer.write(4, np.ones((1, 9000)), ROW, hidden)
    command = [sys.executable, "-P", "-c", LIMITED, str(path), what]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=180)
    assert run.returncode == 0, run.stderr  # HDF5 has ended such a process by a fault of memory
    assert "data.h5.part cannot be written (File too large); repair the disk" in run.stdout
    with DataSetWriter(path, HEAD, n_records=5, n_samples=9000) as writer:
        assert writer.done.tolist() == [False] * 4 + [True]


def test_what_went_wrong_first_is_told_not_that_closing_fails_as_well(path, monkeypatch):
    def fail(self):
        raise RuntimeError("Can't close")

    writer = begin(path)
    with monkeypatch.context() as patch:
        patch.setattr(DataSetWriter, "close", fail)
        with pytest.raises(KeyError, match="first"), writer:
            raise KeyError("first")
        with pytest.raises(RuntimeError, match="Can't close"), writer:
            pass
    writer.close()


def test_a_place_that_cannot_be_written_is_told_and_left_clean(path, monkeypatch):
    def refuse(file, *_):
        raise PermissionError(13, "Permission denied", str(file))

    monkeypatch.setattr(writer, "_take_space", refuse)
    message = r"data\.h5 cannot be made \(Permission denied\); check rights and space, or choose"
    with pytest.raises(DataError, match=message):
        begin(path)
    assert list(Path(path).parent.iterdir()) == []
