"""Kill trials of `wearstate generate`: whatever dies, the same command ends with the same bytes.

    python tests/kill_trials.py [--trials 60] [--seed 0] [--folder DIR] [--sample]

Each trial starts a small simulated set, kills something at a random moment, looks at what is kept,
repeats the command and compares `signal`, `manifest` and hidden quantities with those of a run that
nothing disturbed. Killed are the process that writes, a worker process, a Dask worker, the Dask
scheduler; then Ctrl-C. Once each: a disk that runs full, a limit on file size, a read-only folder
(these need the right to mount, else they are skipped with a sentence). At last the process that
writes dies before each line of the file's writer in turn and, with strace installed, before each of
its writes to the disk.

Prints the counts as JSON; exits 1 where a record is lost, wrong, or repeated without being in
flight. 60 trials take about five minutes on two cores.
"""

import argparse
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from wearstate.datasets.file import attributes, record
from wearstate.datasets.file import writer as data_writer
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.generation import generate
from wearstate.diagnose.command_line import cli
from wearstate.sim.output.sensor import Channel

RECIPE = """
name = "kill-trials"
extends = "journal-bearing-small"
records = {records}
"""

RECORDS = 300
"""A few milliseconds each: a run lasts about a second beside its start."""

JOBS = 2
IN_FLIGHT = 3 * JOBS + 1
"""Records that may be done twice for one death: those handed out, and the one being written."""

LONGEST = 180.0
"""After which a run counts as hung [s]."""

LOCAL = ("writer alone", "writer", "worker", "Ctrl-C")
CLUSTER = ("writer of a cluster", "dask worker", "dask scheduler")


# -- the command, in a process of its own --------------------------------------------------------


def noted(log: str, function: Callable[[Any], Any], batch: Any) -> Any:
    """Simulate, and leave a line for each record begun; runs in a worker."""
    with open(log, "a", encoding="ascii") as file:
        file.writelines(f"{sample.index}\n" for sample in batch)
    return function(batch)


def command(log: str, claim: bool, arguments: list[str]) -> None:
    """`wearstate ARGUMENTS`, every record noted; with `claim` off, as on a disk of holes."""
    plain = generate.in_order

    def in_order(function: Any, items: Any, **options: Any) -> Any:
        return plain(partial(noted, log, function), items, **options)

    generate.in_order = in_order  # type: ignore[assignment]
    if not claim:
        data_writer._take_space = lambda path: None
    cli.main(arguments)


@dataclass
class Run:
    """One run of the command, a fork of this process: the imports are paid once."""

    pid: int
    path: Path
    said: Path
    code: int | None = None

    @property
    def part(self) -> Path:
        """Its unfinished file."""
        return self.path.with_name(self.path.name + ".part")

    def poll(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if pid else None
        return self.code

    def kill(self) -> None:
        """End it at once."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait_for_records(self) -> None:
        """Wait until the records begin."""
        end = time.monotonic() + LONGEST
        while not self.part.exists() and self.poll() is None and time.monotonic() < end:
            time.sleep(0.002)

    def ended(self) -> tuple[int, str, str]:
        """Exit code, stdout and stderr."""
        end = time.monotonic() + LONGEST
        while self.poll() is None:
            time.sleep(0.005)
            if time.monotonic() > end:
                os.killpg(self.pid, signal.SIGKILL)
                _, status = os.waitpid(self.pid, 0)
                self.code = os.waitstatus_to_exitcode(status)
                return self.code, "", f"hung for {LONGEST:g} s"
        out, err = (self.said.with_suffix(end).read_text() for end in (".out", ".err"))
        return self.code or 0, out, err


def forked(work: Callable[[], None], path: Path, said: Path) -> Run:
    """Do work in a new process, the leader of its own group, as a terminal starts a command."""
    sys.stdout.flush()
    if pid := os.fork():
        return Run(pid, path, said)
    code = 70
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for number, end in ((1, ".out"), (2, ".err")):
            os.dup2(os.open(said.with_suffix(end), os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
        work()
        code = 0
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def content(path: Path) -> tuple[str, ...]:
    """Hash of every array of a file that must not depend on the run."""
    with h5py.File(path) as file:
        names = ["signal", "manifest", *(f"truth/{name}" for name in file.get("truth", {}))]
        return tuple(hashlib.sha256(file[name][:].tobytes()).hexdigest() for name in names)


# -- what is at hand for the trials ----------------------------------------------------------------


@dataclass
class Cluster:
    """A Dask scheduler and its workers on this machine."""

    address: str = ""
    scheduler: Any = None
    workers: list[Any] = field(default_factory=list)

    def mend(self, folder: Path) -> str:
        """Start what is missing; gives the address."""
        if self.scheduler is None or self.scheduler.poll() is not None:
            self.end()
            self.address = f"tcp://127.0.0.1:{_free_port()}"
            host, port = self.address.removeprefix("tcp://").split(":")
            options = ("--host", host, "--port", port, "--no-dashboard")
            self.scheduler = _dask(folder, "scheduler", *options)
            _await_port(int(port))
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < JOBS:
            options = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
            self.workers.append(_dask(folder, "worker", self.address, *options))
        return self.address

    def end(self) -> None:
        """Stop all of it."""
        for process in (*self.workers, self.scheduler):
            if process is not None:
                process.kill()
                process.wait()
        self.workers, self.scheduler = [], None


def _dask(folder: Path, what: str, *arguments: str) -> "subprocess.Popen[bytes]":
    with (folder / f"dask-{what}.log").open("ab") as log:
        program = [sys.executable, "-P", "-m", f"distributed.cli.dask_{what}", *arguments]
        return subprocess.Popen(program, cwd=folder, stdout=log, stderr=log)


def _await_port(port: int) -> None:
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Rig:
    """Folder, recipe, the undisturbed result and the counts."""

    folder: Path
    dice: random.Random
    records: int = 0
    recipe: Path = Path()
    cluster: Cluster = field(default_factory=Cluster)
    reference: dict[bool, Path] = field(default_factory=dict)
    seconds: float = 2.0
    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def prepare(self, records: int = RECORDS) -> None:
        """Write the recipe and make the undisturbed files, without and with hidden quantities."""
        self.records = records
        self.recipe = self.folder / f"recipe-{records}.toml"
        self.recipe.write_text(RECIPE.format(records=records))
        for truth in (False, True):
            path = self.folder / f"reference-{records}-{truth}.h5"
            start = time.monotonic()
            generate.generate(str(self.recipe), None, path, truth=truth)
            self.seconds = time.monotonic() - start
            self.reference[truth] = path

    def start(
        self,
        path: Path,
        *,
        truth: bool = False,
        jobs: int = 1,
        scheduler: str = "",
        claim: bool = True,
        limit: int = 0,
        tamper: str = "",
    ) -> Run:
        """Start the command."""
        where = ["--scheduler", scheduler] if scheduler else ["--jobs", str(jobs)]
        arguments = ["generate", str(self.recipe), "-o", str(path), "--json", *where]
        arguments += ["--truth"] if truth else []

        def work() -> None:
            if tamper:
                _trace(tamper)
            if limit:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            command(self.log(path), claim, arguments)

        return forked(work, path, self.folder / f"{path.stem}.said")

    def log(self, path: Path) -> str:
        """File with a line per record begun."""
        return str(self.folder / f"{path.parent.name}-{path.stem}.log")

    def expect(self, good: bool, fault: str, kind: str = "faults") -> None:
        """Count and keep a fault."""
        if not good:
            self.counts[kind] += 1
            self.faults.append(fault)

    # -- what must hold -----------------------------------------------------------------------

    def kept(self, path: Path, truth: bool) -> int:
        """Records that the unfinished file holds; each must be that of the undisturbed run."""
        part = path.with_name(path.name + ".part")
        if not part.exists():
            return 0
        with h5py.File(part) as file, h5py.File(self.reference[truth]) as reference:
            rows, wanted = file["manifest"][:], reference["manifest"][:]
            done = [
                i for i in np.flatnonzero(rows["done"])
                if zlib.crc32(file["signal"][i].data) == rows["signal_crc32"][i]
            ]  # fmt: skip
            names = ["signal", *(f"truth/{name}" for name in (reference["truth"] if truth else ()))]
            wrong = [
                int(i) for i in done
                if rows[i].tobytes() != wanted[i].tobytes()
                or any(file[name][i].tobytes() != reference[name][i].tobytes() for name in names)
            ]  # fmt: skip
        self.expect(not wrong, f"{path.name}: kept records {wrong} are wrong", "wrong")
        return len(done)

    def finish(self, path: Path, truth: bool, kept: int, deaths: int, **options: Any) -> None:
        """Repeat the command; nothing may be lost, little done twice, all bytes the same."""
        code, out, err = self.start(path, truth=truth, **options).ended()
        self.expect(code == 0, f"{path.name}: the repeated command gave {code}: {err}")
        if code == 0:
            resumed = json.loads(out)["n_resumed"]
            self.expect(resumed == kept, f"{path.name}: {resumed} of {kept} kept taken on", "lost")
            self.compare(path, truth, deaths)

    def compare(self, path: Path, truth: bool, deaths: int) -> None:
        """Compare a finished file with the undisturbed one, and count what was done twice."""
        same = content(path) == content(self.reference[truth])
        self.expect(same, f"{path.name}: other bytes than undisturbed", "wrong")
        begun = Path(self.log(path)).read_text(encoding="ascii").split()
        twice = len(begun) - self.records
        self.counts["repeated"] += twice
        self.counts["most repeated"] = max(self.counts["most repeated"], twice)
        self.expect(
            twice <= IN_FLIGHT * deaths, f"{path.name}: {twice} repeated for {deaths} death(s)"
        )

    def refuse_orphans(self, run: Run) -> None:
        """Nothing of a run may be left a few seconds after its end."""
        end = time.monotonic() + 20
        while time.monotonic() < end:
            try:
                os.killpg(run.pid, 0)
            except ProcessLookupError:
                return
            time.sleep(0.1)
        self.expect(False, f"{run.path.name}: a process is left behind")
        os.killpg(run.pid, signal.SIGKILL)


# -- deaths ----------------------------------------------------------------------------------------


def moment(rig: Rig, run: Run) -> None:
    """Wait for a random moment: mostly among the records, at times before them."""
    if rig.dice.random() < 0.1:
        time.sleep(rig.dice.uniform(0, 2))
        return
    run.wait_for_records()
    time.sleep(rig.dice.uniform(0, 0.6 * rig.seconds))  # a fork has its imports already


def death(rig: Rig, kind: str, number: int) -> None:
    """One trial."""
    truth = rig.dice.random() < 0.3
    path = rig.folder / f"trial-{number}.h5"
    options: dict[str, Any] = {"jobs": 1 if kind == "writer alone" else JOBS}
    if kind in CLUSTER:
        options = {"scheduler": rig.cluster.mend(rig.folder)}
    run = rig.start(path, truth=truth, **options)
    moment(rig, run)
    late = run.poll() is not None
    hit = not late and KILLS[kind](rig, run)
    code, _, err = run.ended()
    rig.counts[kind] += hit
    rig.counts["too late"] += not hit
    print(f"{number}: {kind}, exit {code}", file=sys.stderr, flush=True)
    rig.refuse_orphans(run)
    deaths = int(hit)
    if kind in ("worker", "dask worker"):  # the run itself goes on
        rig.expect(code == 0, f"{path.name} ({kind}): exit {code}: {err}")
    elif code == 1:
        told = "records are kept in" in err and "repeat the command" in err
        quick = kind == "Ctrl-C" and err.strip() in ("", "Aborted!")  # before the first record
        rig.expect(told or quick, f"{path.name} ({kind}) says: {err}")
    if code != 0:
        if kind in CLUSTER:
            options = {"scheduler": rig.cluster.mend(rig.folder)}
        elif rig.dice.random() < 0.7:
            options = {}  # another number of processes goes on as well
        rig.finish(path, truth, rig.kept(path, truth), deaths, **options)
    else:
        rig.compare(path, truth, deaths)
    path.unlink(missing_ok=True)


def kill_writer(rig: Rig, run: Run) -> bool:
    run.kill()
    return True


def interrupt(rig: Rig, run: Run) -> bool:
    """Ctrl-C goes to every process of the terminal."""
    os.killpg(run.pid, signal.SIGINT)
    return True


def kill_worker(rig: Rig, run: Run) -> bool:
    workers = [pid for pid in _group(run.pid) if b"loky" in _line(pid) and _is_worker(pid)]
    if workers:
        os.kill(rig.dice.choice(workers), signal.SIGKILL)
    return bool(workers)


def kill_dask_worker(rig: Rig, run: Run) -> bool:
    rig.dice.choice(rig.cluster.workers).kill()
    return True


def kill_dask_scheduler(rig: Rig, run: Run) -> bool:
    rig.cluster.scheduler.kill()
    return True


KILLS: dict[str, Callable[[Rig, Run], bool]] = {
    "writer alone": kill_writer,
    "writer": kill_writer,
    "worker": kill_worker,
    "Ctrl-C": interrupt,
    "writer of a cluster": kill_writer,
    "dask worker": kill_dask_worker,
    "dask scheduler": kill_dask_scheduler,
}


def _group(leader: int) -> list[int]:
    """Other processes of the group that `leader` leads."""
    found = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    return [pid for pid in found if pid != leader and _pgid(pid) == leader]


def _pgid(pid: int) -> int:
    try:
        return os.getpgid(pid)
    except ProcessLookupError:
        return -1


def _line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _is_worker(pid: int) -> bool:
    return b"resource_tracker" not in _line(pid)


# -- disks -----------------------------------------------------------------------------------------


@contextmanager
def small_disk(rig: Rig, size: int) -> Iterator[Path | None]:
    """A file system of a few megabytes; None where it may not be mounted."""
    place = rig.folder / "disk"
    place.mkdir(exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        print("no right to mount a file system: full disk and read-only folder skipped")
        yield None
        return
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


def full_disk(rig: Rig) -> None:
    """Others fill the disk: a run that has claimed its space ends, one of holes goes on later."""
    size = rig.reference[False].stat().st_size
    with small_disk(rig, 2 * size) as place:
        if place is None:
            return
        for claim in (True, False):
            path = place / f"full-{claim}.h5"
            run = rig.start(path, claim=claim)
            run.wait_for_records()
            run.kill() if not claim else None
            _fill(place / "filler")
            code, _, err = run.ended()
            if claim:
                rig.expect(code == 0, f"full disk: exit {code}: {err}")
                rig.compare(path, False, 0) if code == 0 else None
            else:
                _stopped_by_the_disk(rig, path, "No space left on device", claim=False)
                (place / "filler").unlink()
                rig.finish(path, False, rig.kept(path, False), 2)
            (place / "filler").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        rig.counts["full disk"] += 2


def _fill(path: Path) -> None:
    try:
        with path.open("wb") as file:
            while True:
                file.write(bytes(2**16))
                file.flush()
    except OSError:
        return


def _stopped_by_the_disk(rig: Rig, path: Path, cause: str, **options: Any) -> None:
    """The command must end with the cause, and say how to go on."""
    code, _, err = rig.start(path, **options).ended()
    told = cause in err and "records are kept in" in err
    rig.expect(code == 1 and told, f"{path.name}: exit {code}, says: {err}")


def small_files(rig: Rig) -> None:
    """A limit on file size: refused at the start, and on going on with a larger file."""
    path, size = rig.folder / "limited.h5", rig.reference[False].stat().st_size
    code, _, err = rig.start(path, limit=size // 2).ended()
    clean = code == 2 and "File too large" in err and not list(rig.folder.glob("limited.h5*"))
    rig.expect(clean, f"file size limit: exit {code}, says: {err}")
    run = rig.start(path, claim=False)
    run.wait_for_records()
    run.kill()
    run.ended()
    _stopped_by_the_disk(rig, path, "File too large", limit=size // 2, claim=False)
    rig.finish(path, False, rig.kept(path, False), 2)
    rig.counts["file size limit"] += 1


def read_only(rig: Rig) -> None:
    """A folder that may not be written: at the start, and on going on."""
    size = rig.reference[False].stat().st_size
    with small_disk(rig, 2 * size) as place:
        if place is None:
            return
        path = place / "read-only.h5"
        _remount(place, "ro")
        _refused(rig, path)
        _remount(place, "rw")
        run = rig.start(path)
        run.wait_for_records()
        time.sleep(rig.seconds / 2)
        run.kill()
        run.ended()
        _remount(place, "ro")
        _refused(rig, path)
        _remount(place, "rw")
        rig.finish(path, False, rig.kept(path, False), 1)
        rig.counts["read-only folder"] += 2


def _remount(place: Path, mode: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{mode}", str(place)], check=True)


def _refused(rig: Rig, path: Path) -> None:
    code, _, err = rig.start(path).ended()
    rig.expect(code == 2 and "ead-only file system" in err, f"read-only: exit {code}, says: {err}")


# -- before each line, before each write -----------------------------------------------------------


def each_line(rig: Rig, stride: int = 1) -> None:
    """Die before every `stride`-th line of `datasets/file`, from the start of a file to its end.

    Three small records, hidden quantities from the second on: then the file is laid out anew.
    """
    whole = rig.folder / "lines.h5"
    write_small(whole)
    number, code = 1 - stride, DEAD
    while code == DEAD:
        number += stride
        path = rig.folder / f"line-{number}.h5"
        code, _, err = forked(partial(_dying, number, path), path, path.with_suffix("")).ended()
        rig.expect(code in (0, DEAD), f"line {number}: exit {code}: {err}")
        if not path.exists():
            write_small(path)
        # what a killed writer leaves has a name that no reader and no later run takes
        for loose in rig.folder.glob(f"{path.name}.????????.tmp"):
            loose.unlink()
        left = [entry.name for entry in rig.folder.glob(f"{path.name}*") if entry != path]
        rig.expect(not left, f"line {number}: leaves {left}")
        rig.expect(content(path) == content(whole), f"line {number}: other bytes", "wrong")
        path.unlink()
        rig.counts["before a line"] += code == DEAD


DEAD = 99
"""Exit code of a process that died of the trial."""

WATCHED = {module.__file__ for module in (attributes, data_writer, record)}


def _dying(number: int, path: Path) -> None:
    """Write the small file, and die before the given line."""
    left = number

    def watch(frame: Any, event: str, _: Any) -> Any:
        nonlocal left
        if frame.f_code.co_filename not in WATCHED:
            return None
        if event == "line":
            left -= 1
            if left == 0:
                os._exit(DEAD)
        return watch

    sys.settrace(watch)
    write_small(path)
    sys.settrace(None)


def write_small(path: Path) -> None:
    """Write three records and a split, or what is missing of them."""
    channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    head = Attributes(sample_rate=100.0, channels=(channel,), origin="simulated")
    shape = {"n_records": 3, "n_samples": 8}
    with data_writer.DataSetWriter(path, head, **shape, splits=("machines",)) as writer:
        for index in np.flatnonzero(~writer.done):
            row = {"record_id": str(index), "status": "ok" if index else "diverged"}
            truth = {"force": np.full(2, index), "orbit": np.full((2, 2), index)} if index else {}
            writer.write(index, np.full((1, 8), index), row, truth)
        writer.write_split("machines", np.array([0, 1, -1], dtype=np.int8), "{}")
        writer.finish()


def each_write(rig: Rig) -> None:
    """Die before the first, second, ... write of the process that writes, until it ends."""
    if shutil.which("strace") is None:
        print("strace is not installed: death before each write skipped")
        return
    rig.prepare(4)
    number, code = 0, -signal.SIGKILL
    while code != 0:
        number += 1
        path = rig.folder / f"write-{number}.h5"
        tamper = f"inject=pwrite64:signal=SIGKILL:when={number}"
        code, _, err = rig.start(path, truth=True, tamper=tamper).ended()
        if code == -signal.SIGKILL:
            rig.finish(path, True, rig.kept(path, True), 1)
            rig.counts["before a write"] += 1
        else:
            rig.expect(code == 0, f"write {number}: exit {code}: {err}")
            code = 0
        path.unlink(missing_ok=True)


def _trace(tamper: str) -> None:
    """Have this process watched by strace, which strikes at a call of it."""
    options = ("-qq", "-o", "/dev/null", "-e", "trace=pwrite64", "-e", tamper)
    watcher = subprocess.Popen(["strace", *options, "-p", str(os.getpid())])
    status = Path(f"/proc/{os.getpid()}/status")
    while "TracerPid:\t0\n" in status.read_text():
        if watcher.poll() is not None:
            raise SystemExit("strace may not watch this process")
        time.sleep(0.005)


# -- the campaign ----------------------------------------------------------------------------------


def campaign(folder: Path, trials: int, seed: int, *, sample: bool) -> Rig:
    """Run the trials; counts and faults are in what is returned."""
    rig = Rig(folder, random.Random(seed))
    rig.prepare()
    kinds = LOCAL if sample else (*LOCAL, *CLUSTER)
    try:
        for number in range(trials):
            death(rig, kinds[number % len(kinds)], number)
    finally:
        rig.cluster.end()
    if sample:
        each_line(rig, stride=12)
    else:
        for trial in (full_disk, small_files, read_only, each_line, each_write):
            trial(rig)
    return rig


def main() -> None:
    """Run the trials and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="Scratch; a new one by default.")
    parser.add_argument("--sample", action="store_true", help="No cluster and no disks.")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder, prefix="kill-trials-") as folder:
        start = time.monotonic()
        rig = campaign(Path(folder), options.trials, options.seed, sample=options.sample)
        seconds = round(time.monotonic() - start)
    kills = sum(rig.counts[kind] for kind in (*LOCAL, *CLUSTER))
    figures = {"kills": kills, "seconds": seconds, "lost": 0, "wrong": 0, **rig.counts}
    print(json.dumps(figures, indent=1))
    if rig.faults:
        raise SystemExit("\n".join(rig.faults))


if __name__ == "__main__":
    main()
