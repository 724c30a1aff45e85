"""Outputs appear whole or not at all, and one run at a time writes one."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from wearstate.datasets.file import lock
from wearstate.datasets.file.lock import holding
from wearstate.sim import atomic
from wearstate.sim.atomic import OutputError, fresh_name, replacing, sealed, unsealed, write_whole
from wearstate.sim.output.recording import DataError


def names(folder):
    return sorted(os.listdir(folder))


# -- writing -------------------------------------------------------------------------------------


def test_what_other_runs_left_is_never_touched(tmp_path):
    (tmp_path / "data.h5.part").write_text("hours of work")
    left = fresh_name(tmp_path / "data.h5")
    left.write_text("of a killed run")
    write_whole(tmp_path / "data.h5", b"whole", force=False)
    write_whole(tmp_path / "data.h5", b"again", force=True)
    assert (tmp_path / "data.h5").read_bytes() == b"again"
    assert (tmp_path / "data.h5.part").read_text() == "hours of work"
    assert names(tmp_path) == sorted(["data.h5", "data.h5.part", left.name])


def write_late(path):
    with replacing(path, force=False) as fresh:
        fresh.write_text("mine")
        path.write_text("theirs")


def make_late(path):
    with replacing(path, force=False) as fresh:
        fresh.mkdir()
        path.mkdir()
        (path / "a.wav").write_text("theirs")


@pytest.mark.parametrize("hard_links", [True, False])
def test_an_output_that_appears_meanwhile_stays_and_so_does_the_work(
    tmp_path, monkeypatch, hard_links
):
    if not hard_links:

        def refuse(*_, **__):
            raise PermissionError(1, "Operation not permitted")

        monkeypatch.setattr(os, "link", refuse)
    path = tmp_path / "table.csv"
    with pytest.raises(OutputError, match="has appeared during the run") as caught:
        write_late(path)
    assert path.read_text() == "theirs"
    [fresh] = tmp_path.glob("*.tmp")
    assert fresh.read_text() == "mine"
    assert fresh.name in str(caught.value)
    write_whole(tmp_path / "b.csv", b"1", force=False)
    assert (tmp_path / "b.csv").read_bytes() == b"1"


def test_a_folder_that_appears_meanwhile_stays(tmp_path):
    path = tmp_path / "wavs"
    with pytest.raises(OutputError, match="has appeared during the run"):
        make_late(path)
    assert names(path) == ["a.wav"]


def _begin_and_fail(place, make, error):
    getattr(place, make)(*([b"half"] if make == "write_bytes" else []))
    raise error


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_fails_leaves_nothing(tmp_path, error):
    for make in ("write_bytes", "mkdir"):
        with pytest.raises(error), replacing(tmp_path / "x", force=True) as fresh:
            _begin_and_fail(fresh, make, error)
    assert names(tmp_path) == []


KILLED = """
import os, sys
from pathlib import Path
from wearstate.sim.atomic import replacing
rename, calls = os.rename, []
def counted(*places):
    calls.append(places)
    if len(calls) == int(sys.argv[2]):
        os._exit(9)
    rename(*places)
os.rename = counted
with replacing(Path(sys.argv[1]) / "out", force=True) as fresh:
    fresh.mkdir()
    (fresh / "new.wav").touch()
"""


@pytest.mark.parametrize("kill_at", [1, 2])
def test_a_kill_between_two_renames_loses_no_folder(tmp_path, kill_at):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.wav").touch()
    command = [sys.executable, "-P", "-c", KILLED, str(tmp_path), str(kill_at)]
    assert subprocess.run(command, check=False).returncode == 9
    held = sorted(path.name for path in tmp_path.rglob("*.wav"))
    assert held == ["new.wav", "old.wav"]
    with replacing(tmp_path / "out", force=True) as fresh:  # nothing that is left is in the way
        fresh.mkdir()
    assert (tmp_path / "out").is_dir()


def test_a_rename_that_fails_brings_the_old_folder_back(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.wav").touch()
    rename = os.rename

    def fail(source, target):
        if str(source).endswith(".tmp"):
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "rename", fail)
    with pytest.raises(OSError, match="No space"), replacing(tmp_path / "out", force=True) as fresh:
        fresh.mkdir()
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["old.wav"]


def test_names_at_the_limit_of_a_file_system(tmp_path):
    for name in ("x" * 255, "ö" * 127):
        write_whole(tmp_path / name, b"1", force=False)
    assert len(names(tmp_path)) == 2


def test_sealed_content_tells_every_cut_and_bit():
    stored = sealed(b"content")
    assert unsealed(stored) == b"content"
    assert all(unsealed(stored[:n]) is None for n in range(len(stored)))
    for place in range(len(stored)):
        wrong = bytearray(stored)
        wrong[place] ^= 1
        assert unsealed(bytes(wrong)) is None


def test_the_package_imports_nothing_of_ours():
    assert "from ." not in Path(atomic.__file__).read_text(encoding="utf-8")


# -- locks ---------------------------------------------------------------------------------------


HOLDER = """
import sys, time
from pathlib import Path
from wearstate.datasets.file import lock
if sys.argv[2] == "without":
    lock.fcntl = None
with lock.holding(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture(params=["with", "without"])
def held(request, tmp_path, monkeypatch):
    """Output that another process holds, with and without locks of the operating system."""
    if request.param == "without":
        monkeypatch.setattr(lock, "fcntl", None)
    path = tmp_path / "data.h5"
    command = [sys.executable, "-P", "-c", HOLDER, str(path), request.param]
    holder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout.readline() == "held\n"
        yield path, holder
    finally:
        holder.kill()
        holder.communicate()


def test_the_second_is_told_who_holds_it_and_a_dead_one_holds_nothing(held):
    path, holder = held
    who = rf"data\.h5 is being written by process {holder.pid} on {socket.gethostname()}; wait"
    with pytest.raises(DataError, match=who), holding(path):
        pass
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert len(names(path.parent)) == 1  # left behind, and in nobody's way
    with holding(path):
        assert len(names(path.parent)) == 1
    assert names(path.parent) == []


def test_a_file_system_without_locks_is_said(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(lock.fcntl, "flock", refuse)
    said = []
    with holding(tmp_path / "data.h5", said.append):
        assert names(tmp_path) == ["data.h5.pid"]
        second = holding(tmp_path / "data.h5")
        with pytest.raises(DataError, match=r"delete data\.h5\.pid if that run is gone"), second:
            pass
    assert said == [f"{tmp_path} has no file locks: data.h5.pid keeps other runs off"]
    assert names(tmp_path) == []


def test_a_lock_of_another_machine_is_not_taken_over(tmp_path, monkeypatch):
    monkeypatch.setattr(lock, "fcntl", None)
    (tmp_path / "data.h5.pid").write_text('{"pid": 1, "host": "elsewhere"}')
    with pytest.raises(DataError, match="process 1 on elsewhere"), holding(tmp_path / "data.h5"):
        pass


def test_a_place_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(DataError, match="cannot be made"), holding(tmp_path / "no" / "data.h5"):
        pass
