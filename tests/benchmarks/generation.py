"""Speed, memory and share of writing of `generate`, and the time to read a record.

    python tests/benchmarks/generation.py [--seconds 20] [--records 20000] [--folder DIR]

Simulates `bilge-pump-narrow` (three channels at 25.6 kHz) in one process and in two workers,
without their start: signal made and written in a second, what it costs in processor time (which a
busy machine changes less), and the writer's share. Then the memory of every process at 100 records,
and at `--records` short ones of `journal-bearing-small`, small enough to make so many; then random
reads. Exits 1 where a figure misses its goal. The figures are of this machine in its present state:
run it on a quiet one.
"""

import argparse
import json
import os
import random
import tempfile
import threading
import time
from collections.abc import Iterator
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation import generate as generation
from wearstate.datasets.generation.work import together
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.recipe import Recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.workers.local import in_order

RECIPE, SHORT = "bilge-pump-narrow", "journal-bearing-small"

LEAST_RATE = 50.0
"""Seconds of three-channel signal made in a second, with two processes."""

LARGEST_RATE = 200.0
"""Records a second that would need more room in the file than it is given."""

LEAST_GAIN = 1.8
"""Of the second core."""

MOST_MEMORY = 500e6
"""Resident in any process [byte]."""

MOST_WRITING = 0.05
"""Share of the time of the run in which the writer works."""

LONGEST_READ = 0.5e-3
"""Median time to read a record at random [s]."""


class Clocked(DataSetWriter):
    """Takes the time of writing, by the wall and by the processor."""

    wall = processor = 0.0

    def write(self, *arguments: Any) -> None:
        """As the writer's."""
        start, busy = time.perf_counter(), time.thread_time()
        super().write(*arguments)
        Clocked.wall += time.perf_counter() - start
        Clocked.processor += time.thread_time() - busy


def endless(recipe: Recipe) -> Iterator[Any]:
    """Samples without end, each with a number of its own."""
    yield from sample_records(recipe, 10**6, seed=0)


def rate(folder: Path, seconds: float, jobs: int) -> dict[str, float]:
    """Signal made and written in a second in steady state, and the writer's share of it."""
    recipe = load_recipe(RECIPE)
    work = partial(together, error=None)
    size = generation._TOGETHER
    ahead = 3 * jobs * size  # until every worker has started and compiled, and the pipeline is full
    most = ahead + int(seconds * LARGEST_RATE)
    args = {"seed": 0, "force": True, "truth": False, "choice": None}
    generation.DataSetWriter = Clocked  # type: ignore[misc]
    with generation._writer(recipe, most, folder / f"rate-{jobs}.h5", **args) as writer:
        batches = in_order(work, generation._batches(endless(recipe), size), jobs=jobs)
        outcomes = chain.from_iterable(batches)
        for outcome in islice(outcomes, ahead):
            writer.write(outcome.index, outcome.signal, outcome.row, outcome.truth)
        Clocked.wall = Clocked.processor = 0.0
        before = [processor_time(pid) for pid in (os.getpid(), *children(os.getpid()))]
        start, count = time.perf_counter(), 0
        while time.perf_counter() - start < seconds and count + ahead < most:
            outcome = next(outcomes)
            writer.write(outcome.index, outcome.signal, outcome.row, outcome.truth)
            count += 1
        passed = time.perf_counter() - start
        after = [processor_time(pid) for pid in (os.getpid(), *children(os.getpid()))]
        batches.close()
    writer.part.unlink()
    made = count * recipe.scene.duration
    return {
        "signal_seconds_per_second": made / passed,
        "processor_seconds_per_signal_second": (sum(after) - sum(before)) / made,
        "of_it_in_this_process": (after[0] - before[0]) / made,
        "writing_share": Clocked.wall / passed,
        "writing_processor_share": Clocked.processor / passed,
        "milliseconds_to_write_a_record": 1e3 * Clocked.wall / max(count, 1),
    }


class MemoryWatch:
    """Largest resident set of this process and of each of its children, sampled."""

    def __init__(self) -> None:
        self.most: dict[str, int] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> "MemoryWatch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._stop.wait(0.1):
            for pid in (os.getpid(), *children(os.getpid())):
                role = "writer" if pid == os.getpid() else "worker"
                self.most[role] = max(self.most.get(role, 0), resident(pid))


def children(parent: int) -> list[int]:
    """Processes that a process has started."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if entry.name.isdigit() and int(fields[1]) == parent:
            found.append(int(entry.name))
    return found


def processor_time(pid: int) -> float:
    """User and system time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident(pid: int) -> int:
    """Resident set of a process [byte]; 0 when it is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def memory(path: Path, recipe: str, records: int) -> dict[str, float]:
    """Largest memory of writer and workers over a whole run [MB], and its time [s]."""
    start = time.perf_counter()
    with MemoryWatch() as watch:
        generation.generate(recipe, records, path, jobs=2, force=True)
    return {
        **{f"{role}_mb": most / 1e6 for role, most in sorted(watch.most.items())},
        "seconds": time.perf_counter() - start,
    }


def reading(path: Path, times: int = 400) -> dict[str, float]:
    """Time of a random read, file open and in the page cache [ms]."""
    dice = random.Random(0)
    with DataSet(path) as data:
        took = []
        for _ in range(times):
            index = dice.randrange(len(data))
            start = time.perf_counter()
            data[index]
            took.append(time.perf_counter() - start)
        took.sort()
        return {
            "samples": float(data[0].signal.size),
            "median_ms": 1e3 * took[times // 2],
            "p95_ms": 1e3 * took[int(0.95 * times)],
        }


def measure(folder: Path, seconds: float, records: int) -> dict[str, Any]:
    """All figures."""
    one, two = (rate(folder, seconds, jobs) for jobs in (1, 2))
    long, short = folder / "long.h5", folder / "short.h5"
    return {
        "one process": one,
        "two processes": two,
        "gain of the second core": two["signal_seconds_per_second"]
        / one["signal_seconds_per_second"],
        f"memory, 100 records of {RECIPE}": memory(long, RECIPE, 100),
        f"memory, 100 records of {SHORT}": memory(short, SHORT, 100),
        f"memory, {records} records of {SHORT}": memory(short, SHORT, records),
        f"reading a record of {RECIPE}": reading(long),
        f"reading a record of {SHORT}": reading(short),
    }


def misses(figures: dict[str, Any]) -> list[str]:
    """Figures that miss their goal, as sentences."""
    two, gain = figures["two processes"], figures["gain of the second core"]
    speed, share = two["signal_seconds_per_second"], two["writing_share"]
    held = [
        most for name, value in figures.items() if "memory" in name for most in megabytes(value)
    ]
    reads = [value["median_ms"] for name, value in figures.items() if "reading" in name]
    checks = (
        (speed >= LEAST_RATE, f"{speed:.1f} signal seconds per second must be >= {LEAST_RATE}"),
        (gain >= LEAST_GAIN, f"gain of the second core {gain:.2f} must be >= {LEAST_GAIN}"),
        (
            share <= MOST_WRITING,
            f"writing takes {share:.3f} of the time, must be <= {MOST_WRITING}",
        ),
        (1e6 * max(held) <= MOST_MEMORY, f"{max(held):.0f} MB must be <= {MOST_MEMORY / 1e6:.0f}"),
        (max(reads) <= 1e3 * LONGEST_READ, f"read of {max(reads):.2f} ms must be <= 0.5 ms"),
    )
    return [text for good, text in checks if not good]


def megabytes(figures: dict[str, float]) -> list[float]:
    """Those of the figures that are memory."""
    return [value for name, value in figures.items() if name.endswith("_mb")]


def main() -> None:
    """Print the figures as JSON; exit 1 where one misses its goal."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="For each of the two rates.")
    parser.add_argument("--records", type=int, default=20_000)
    parser.add_argument("--folder", type=Path, help="Scratch; a new one by default.")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder, prefix="generation-") as folder:
        figures = measure(Path(folder), options.seconds, options.records)
    print(json.dumps(figures, indent=1))
    if faults := misses(figures):
        raise SystemExit("\n".join(faults))


if __name__ == "__main__":
    main()
