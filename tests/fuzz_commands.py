"""Damaged files of every kind given to the commands: each ends in words, in time, by no signal.

    python tests/fuzz_commands.py --files 5600 [--kind data] [--seed 0] [--first 0]

Every command runs in a process group of its own under a watchdog, which ends the group. A failure
names kind and number, so that ``--kind KIND --first NUMBER --files 1`` repeats it.
"""

import argparse
import contextlib
import importlib
import io
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_readers

LONGEST = 20.0  # s for one command
ROOT = Path(__file__).parents[1]
DECLARED = ("--fs", "1000", "--unit", "m/s^2")


@dataclass(frozen=True)
class Kind:
    """A valid file, and the commands that read it."""

    suffix: str
    content: bytes
    commands: tuple[tuple[str, ...], ...]


def recording_kinds(folder: Path) -> dict[str, list[Kind]]:
    """Files of every reader; ``FILE`` and ``OUT`` stand for paths."""
    kinds: dict[str, list[Kind]] = {}
    for name, seeds in fuzz_readers.SEEDS.items():
        for number, seed in enumerate(seeds):
            path = folder / f"{name}{number}{seed.suffix}"
            seed.build(path)
            told = [part for key, value in seed.options.items() for part in _option(key, value)]
            commands = (
                ("import", "FILE", "--list", *told),
                ("info", "FILE", *DECLARED, *told),
                ("import", "FILE", "-o", "OUT.h5", "-j", "1", *DECLARED, *told),
            )
            kinds.setdefault(name, []).append(Kind(seed.suffix, path.read_bytes(), commands))
    return kinds


def _option(key: str, value: object) -> tuple[str, str]:
    return f"--{key.replace('_', '-')}", str(value)


def data_set(path: Path) -> bytes:
    """A data set with everything that one can hold."""
    from wearstate.datasets.file.attributes import Attributes
    from wearstate.datasets.file.writer import DataSetWriter
    from wearstate.sim.output.sensor import Channel

    head = Attributes(
        sample_rate=1000.0,
        channels=(Channel(name="acc", unit="m/s^2", quantity="acceleration"),),
        origin="measured",
        severities=("size_m",),
    )
    with DataSetWriter(
        path, head, n_records=6, n_samples=60, columns={"size_m": "<f8"}, splits=("mine",)
    ) as writer:
        for i in range(6):
            row = {"record_id": f"r{i}", "group": i, "status": "ok", "size_m": 1e-4 * i}
            writer.write(i, fuzz_readers.SIGNAL[:1] * i, row, {"force": np.ones(3)})
        sides = np.array([0, 0, 0, 1, 1, 1], np.int8)
        about = '{"kind": "machine", "text": "some", "machines_apart": true}'
        writer.write_split("mine", sides, about)
        writer.finish()
    return path.read_bytes()


TABLE = "file,state,group,size_m,mean,rms\n" + "".join(
    f"a{i}.wav,{'ab'[i % 2]},{i % 5},{i / 1e4},{i % 7},{i * i % 11}\n" for i in range(40)
)


def other_kinds(folder: Path, model: Path | None) -> dict[str, list[Kind]]:
    """Data sets, models, scenes, recipes and tables."""
    data = (
        ("info", "FILE"),
        ("info", "FILE", "--verify"),
        ("splits", "FILE"),
        ("export", "FILE", "-o", "OUT.h5"),
        ("export", "FILE", "-o", "OUT.npz"),
        ("audit", "FILE", "-j", "1"),
    )
    whole = Kind(".h5", data_set(folder / "data.h5"), data)
    kinds = {
        "data": [whole],
        "data-flips": [whole],
        "scene": [
            Kind(".toml", path.read_bytes(), (("scene", "check", "FILE"),))
            for path in sorted((ROOT / "sim" / "scene" / "built_in").glob("*.toml"))
        ],
        "recipe": [
            Kind(".toml", path.read_bytes(), (("recipe", "check", "FILE"),))
            for path in sorted((ROOT / "datasets" / "recipe" / "built_in").glob("*small.toml"))
        ],
        "table": [
            Kind(
                ".csv",
                TABLE.encode(),
                (("audit", "FILE", "--label", "state", "--group", "group", "-j", "1"),),
            )
        ],
    }
    if model is not None:
        kinds["model"] = [Kind(".wsm", model.read_bytes(), (("info", "FILE"),))]
        kinds["model-flips"] = kinds["model"]
    return kinds


def kinds_of(folder: Path, model: Path | None = None) -> dict[str, list[Kind]]:
    """Everything that is damaged."""
    return {**recording_kinds(folder), **other_kinds(folder, model)}


def damaged(kind: str, whole: bytes, seed: int, number: int) -> bytes:
    """Kinds of flips have one to three flipped bits and no other damage."""
    if kind.endswith("-flips"):
        rng = np.random.default_rng([seed, number])
        raw = np.frombuffer(whole, np.uint8).copy()
        for place in rng.integers(0, raw.size, int(rng.integers(1, 4))):
            raw[place] ^= 1 << int(rng.integers(8))
        return raw.tobytes()
    return fuzz_readers.changed(whole, fuzz_readers.random_changes(seed, number))


# --- running


def warm_up() -> None:
    """Import and load what commands do inside: forks start from a process that has it all."""
    for name in (
        "datasets.audit.audit",
        "datasets.audit.integrity",
        "datasets.convert.export",
        "datasets.measured.data_set",
        "datasets.recipe.recipe",
        "datasets.split.rules",
        "diagnose.command_line.cli",
        "diagnose.inspect.info",
        "diagnose.wear_model.file",
        "diagnose.report.verdict",
        "diagnose.report.batch",
        "diagnose.feature_rows.feature_table",
        "diagnose.wear_model.train",
    ):
        importlib.import_module(f"wearstate.{name}")
    from click.testing import CliRunner
    from wearstate.diagnose.command_line.cli import cli

    for scene in ("bilge-pump", "journal-bearing", "propulsion-shaft"):  # kernels of each machine
        CliRunner().invoke(cli, ["scene", "check", scene], catch_exceptions=False)


def run_forked(command: list[str], log: Path) -> tuple[int | None, float]:
    """Exit code of a command in a fork of this process, negative for a signal; None: too long."""
    begin = time.perf_counter()
    pid = os.fork()
    if pid == 0:
        _become(command, log)
    while time.perf_counter() - begin < LONGEST:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            _end_group(pid)
            return os.waitstatus_to_exitcode(status), time.perf_counter() - begin
        time.sleep(0.002)
    _end_group(pid)
    os.waitpid(pid, 0)
    return None, time.perf_counter() - begin


def _become(command: list[str], log: Path) -> None:
    """The child: leads a group of its own, says all into the log, never returns."""
    os.setpgid(0, 0)
    with log.open("wb") as handle:
        os.dup2(handle.fileno(), 1)
        os.dup2(handle.fileno(), 2)
    sys.stdout, sys.stderr = (_strict(descriptor) for descriptor in (1, 2))
    code = 70
    try:
        from wearstate.diagnose.command_line.cli import main

        main(command)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code or 0)


def _strict(descriptor: int) -> io.TextIOWrapper:
    """A stream of UTF-8 alone, whatever this process has: pytest has its own."""
    raw = io.BufferedWriter(io.FileIO(descriptor, "w", closefd=False))
    return io.TextIOWrapper(raw, encoding="utf-8", errors="strict")


def _end_group(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def fault_of(code: int | None, said: str) -> str:
    """What is wrong with the end of a command; empty where nothing is."""
    if code is None:
        return f"longer than {LONGEST:g} s"
    if code < 0:
        return f"signal {-code}"
    if "Traceback (most recent call last)" in said:
        return "traceback: " + said.strip().split("\n")[-1][:200]
    if code not in (0, 1, 2, 3, 4, 5):
        return f"exit code {code}"
    if code in (1, 2) and not said.strip():
        return "not a word"
    return ""


def attempt(kind: Kind, content: bytes, number: int, folder: Path) -> tuple[int | None, str]:
    """Exit code and fault of one command on one file."""
    path, log = folder / f"x{kind.suffix}", folder / "log"
    path.write_bytes(content)
    for left in folder.glob("out*"):
        left.unlink()
    words = kind.commands[number % len(kind.commands)]
    places = {
        "FILE": str(path),
        "OUT.h5": str(folder / "out.h5"),
        "OUT.npz": str(folder / "out.npz"),
    }
    code, _ = run_forked([places.get(word, word) for word in words], log)
    return code, fault_of(code, log.read_text(errors="replace"))


def campaign(
    kinds: dict[str, list[Kind]],
    n_files: int,
    *,
    seed: int = 0,
    first: int = 0,
    say: Callable[[str], None] = print,
) -> list[str]:
    """So many damaged files, shared among the kinds; the faults found."""
    warm_up()
    faults = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, seeds in kinds.items():
            codes: Counter[int | None] = Counter()
            for number in range(first, first + max(n_files // len(kinds), 1)):
                kind = seeds[number % len(seeds)]
                content = damaged(name, kind.content, seed, number)
                code, fault = attempt(kind, content, number // len(seeds), folder)
                codes[code] += 1
                if fault:
                    faults.append(f"{name} {number} of seed {seed}: {fault}")
                    say(faults[-1])
            say(f"{name}: {dict(codes)}")
    return faults


def main() -> int:
    """Run the campaign; 1 where it shows a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", action="append")
    parser.add_argument("--files", type=int, default=5600)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--model", type=Path, help="An intact .wsm, to be damaged too.")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        kinds = kinds_of(Path(folder), given.model)
        wanted = {name: kinds[name] for name in given.kind or kinds}
        faults = campaign(wanted, given.files, seed=given.seed, first=given.first)
    print(f"{len(faults)} faults")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
