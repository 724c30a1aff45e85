"""Time and memory of the report: one recording cold, and a thousand in one run.

Run as ``python tests/benchmarks/report_speed.py MODEL DATA [COUNT]``: MODEL of ``wearstate train``,
DATA any set that it can judge, whose records are gone through until COUNT is reached. Prints
seconds of the processor beside those of the clock: a busy machine changes only the latter.
"""

import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from wearstate.diagnose.report.batch import judge_all, recordings_in
from wearstate.diagnose.report.page import batch_html
from wearstate.diagnose.wear_model.file import load_model

COLD_S, EACH_MS, GROWTH_MB = 3.0, 50.0, 50.0
WARM = 20  # recordings, before time and memory are taken


def cold(model: str, data: str) -> tuple[float, float]:
    """Seconds of the clock and of the processor of one report with its page, in a new process."""
    with TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        command = [sys.executable, "-m", "wearstate", "report", data, "--record", "0"]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([*command, "--model", model, "-o", str(page)], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return time.perf_counter() - start, busy


def many(model: str, data: str, count: int) -> tuple[float, float, float]:
    """Milliseconds of the clock and of the processor for each recording, growth of memory [MB]."""
    known = load_model(Path(model))
    with recordings_in(Path(data)) as found:
        items = (found * (count // len(found) + 1))[:count]
        judge_all(Path(data), items[:WARM], known)
        base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start, busy = time.perf_counter(), time.process_time()
        batch = judge_all(Path(data), items, known)
        seconds, busy = time.perf_counter() - start, time.process_time() - busy
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - base) / 1024
        page = batch_html(batch, known)
    print(f"page of {count} recordings: {len(page) / 1e6:.2f} MB")
    return 1e3 * seconds / count, 1e3 * busy / count, grown


def main() -> None:
    """Print what was reached beside what is asked."""
    model, data = sys.argv[1:3]
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 1000
    clock, busy = cold(model, data)
    print(f"one recording, cold: {clock:.2f} s, processor {busy:.2f} s (asked {COLD_S:g} s)")
    clock, busy, grown = many(model, data, count)
    print(f"each of {count}: {clock:.1f} ms, processor {busy:.1f} ms (asked {EACH_MS:g} ms)")
    print(f"memory grown by {grown:.1f} MB (asked <= {GROWTH_MB:g} MB)")


if __name__ == "__main__":
    main()
