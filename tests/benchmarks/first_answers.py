"""Seconds until ``wearstate chart SCENE`` has its first answer, and until its whole chart.

Run as ``python tests/benchmarks/first_answers.py [SCENE …] [-o FILE.json]``: all built-in scenes,
those of ``tests/own_scenes``, and both kinds of pipes by default. Prints seconds of the clock
beside those of all processors: a busy machine changes only the former, by which nothing is to be
judged then. Linux only.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from wearstate.sim.scene.load import load_scene, scene_names

ANSWER_S = {"reciprocating-pump": 10.0, "journal-bearing": 10.0, "propulsion-shaft": 20.0}
"""Machine -> seconds to the first answer."""

WHOLE_S = 90.0  # of two quiet cores, or the chart says what is left
JOBS = 2

OWN = Path(__file__).parent.parent / "own_scenes"
LINES = ("pressure.suction_line.wave_speed=1200 m/s", "pressure.discharge_line.wave_speed=1200 m/s")
PIPED = {
    f"{name} {rung}": (name, (f"pressure.rung={rung}", *LINES))
    for name, rung in (("bilge-pump", "wave-lines"), ("bilge-pump", "lumped-lines"),
                       ("triplex-pump", "wave-lines"))
}  # fmt: skip
SCENES = {
    **{name: (name, ()) for name in scene_names()},
    **{path.stem: (str(path), ()) for path in sorted(OWN.glob("*.toml"))},
    **PIPED,
}
"""Name -> scene, and values set."""

_FIELDS = slice(11, 15)  # of /proc/PID/stat after the name: user, system, and both of children
_SESSION = 3
_TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, kw_only=True)
class Times:
    """Of one chart: seconds of the clock, and of the processors."""

    scene: str
    asked: float
    answer: float
    answer_busy: float
    whole: float
    whole_busy: float
    status: str
    measured: int
    planned: int
    choices: tuple[str, ...]
    said: str

    @property
    def good(self) -> bool:
        """The first answer is in time by the processor, and the chart has one for each question."""
        return self.answer_busy <= self.asked and "no answer yet" not in self.choices


def busy_seconds(session: int) -> float:
    """Seconds of the processors of all processes of a session."""
    total = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rsplit(")", 1)[1].split()
        except OSError:  # it has ended
            continue
        if int(fields[_SESSION]) == session:
            total += sum(map(int, fields[_FIELDS]))
    return total / _TICKS


def chart_times(label: str, budget: float, jobs: int) -> Times:
    """Times of a chart in a process of its own."""
    name, given = SCENES[label]
    scene = load_scene(name, dict(each.split("=", 1) for each in given))
    sets = [word for each in given for word in ("--set", each)]
    with TemporaryDirectory() as folder:
        page = Path(folder) / "chart.json"
        command = [sys.executable, "-m", "wearstate", "chart", name, *sets, "-j", str(jobs)]
        begin = time.perf_counter()
        run = subprocess.Popen(
            [*command, "--budget", str(budget), "-o", str(page)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env={k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"},
            start_new_session=True,
        )
        answer = answer_busy = float("inf")
        said, end_busy = "", 0.0
        assert run.stderr is not None
        for line in run.stderr:
            if line.startswith("after ") and not said:
                said = line.strip()
                answer, answer_busy = time.perf_counter() - begin, busy_seconds(run.pid)
        _, status, used = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
        whole, end_busy = time.perf_counter() - begin, used.ru_utime + used.ru_stime
        if run.returncode:
            raise SystemExit(f"{label}: exit code {run.returncode}")
        found = json.loads(page.read_text())
    return Times(
        scene=label,
        asked=ANSWER_S[scene.machine],
        answer=answer,
        answer_busy=answer_busy,
        whole=whole,
        whole_busy=end_busy,
        status=found["status"],
        measured=found["measured_points"],
        planned=found["planned_points"],
        choices=tuple(each["status"] for each in found["recommendations"]),
        said=said,
    )


HEAD = (
    "| scene | first answer [s] | of the processors | asked | whole [s] | of the processors | "
    "status | measured | choices |\n|---|---|---|---|---|---|---|---|---|"
)


def row_of(each: Times) -> str:
    """Row of a Markdown table."""
    return (
        f"| `{each.scene}` | {each.answer:.1f} | {each.answer_busy:.1f} | {each.asked:g} | "
        f"{each.whole:.0f} | {each.whole_busy:.0f} | {each.status} | {each.measured} of "
        f"{each.planned} | {', '.join(each.choices)}{'' if each.good else ' **missed**'} |"
    )


def main() -> None:
    """Print a row for each scene, write all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--budget", type=float, default=WHOLE_S)
    parser.add_argument("-j", "--jobs", type=int, default=JOBS)
    given = parser.parse_args()
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    print(HEAD)
    rows = []
    for label in given.scenes:
        rows.append(chart_times(label, given.budget, given.jobs))
        print(row_of(rows[-1]), flush=True)
        if given.output is not None:
            given.output.write_text(json.dumps([asdict(each) for each in rows], indent=1))


if __name__ == "__main__":
    main()
