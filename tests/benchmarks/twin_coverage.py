"""Do intervals of calibrated numbers hold the truth? On own machines that no test has drawn.

    python tests/benchmarks/twin_coverage.py --machines 40 --jobs 2

Each pump is drawn by the standard recipe and calibrated on three simulated healthy recordings. Of
every number that the calibration says something of, the middle 90 per cent of the posterior is held
against the truth; a row a number kind tells how many hold it, with a 95 % interval over machines,
and how far the mean is off. All is simulated.
"""

import argparse
import json
import re
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import wearstate
from twin_opinion import HEALTHY, PATH, drawn_pumps, heard_of
from wearstate.datasets.draws.draws import value_at
from wearstate.diagnose.learning.scores import resampled, share
from wearstate.diagnose.twin.calibration import CalibratedScene
from wearstate.sim.scene.load import override, scene_from_table
from wearstate.sim.scene.scene import Scene

DRAWS = 4000
INNER = (0.05, 0.95)


def judged(found: CalibratedScene, scene: Scene) -> list[dict]:
    """One row for every number that the recordings of a scene tell something of."""
    draws = found.found.posterior.draw(DRAWS, np.random.default_rng(0))
    told = {number.path for number in found.numbers}
    rows = []
    for name in found.unknowns.named:
        path = found.unknowns.path_of(name)
        if path not in told or not found.unknowns.holds(name, scene):
            continue
        values = found.unknowns.numbers(name, draws)
        truth = float(value_at(scene, path))
        low, high = np.quantile(values, INNER)
        rows.append(
            {
                "path": path,
                "truth": truth,
                "mean": float(values.mean()),
                "low": float(low),
                "high": float(high),
            }
        )
    return rows


def kind_of(path: str) -> str:
    return re.sub(r"\.\d+\.", ".*.", path)


def summary(rows: list[dict]) -> Iterator[str]:
    """Coverage of all numbers and of each kind, and how far means are off."""
    kinds = defaultdict(list)
    for row in rows:
        kinds["all"].append(row)
        kinds[kind_of(row["path"])].append(row)
    yield "| number | intervals | hold the truth | median miss | 9 of 10 within |"
    yield "|---|---|---|---|---|"
    for kind, mine in kinds.items():
        truth, mean, low, high = (
            np.array([row[key] for row in mine]) for key in ("truth", "mean", "low", "high")
        )
        owner = np.array([row["machine"] for row in mine])
        inside = (low <= truth) & (truth <= high)
        held = share(inside, np.ones(len(inside)), resampled(owner))
        off = abs(mean - truth)
        if kind.endswith("frequency"):
            off = off / truth
        miss = "" if kind == "all" else f"{np.median(off):.3g} | {np.quantile(off, 0.9):.3g}"
        yield (
            f"| {kind} | {len(mine)} | {held.value:.2f} ({held.low:.2f} to {held.high:.2f}) | "
            f"{miss or '| '} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machines", type=int, default=40)
    parser.add_argument("--seed", type=int, default=4001)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("twin_coverage.jsonl"))
    given = parser.parse_args()
    done = (
        [json.loads(line) for line in given.out.read_text().splitlines()]
        if given.out.exists()
        else []
    )
    ready = {row["machine"] for row in done}
    pumps = drawn_pumps(given.machines, HEALTHY, given.seed)
    for number, (base, mine, clearances) in enumerate(pumps):
        if number in ready:
            continue
        heard = [heard_of(base, s, c) for s, c in zip(mine, clearances, strict=True)]
        began = time.perf_counter()
        try:
            rows = judged(
                wearstate.calibrate("bilge-pump", heard, jobs=given.jobs),
                scene_from_table(
                    override(base, {**mine[0].drawn, PATH: float(np.mean(clearances))})
                ),
            )
        except wearstate.MisfitError as error:
            rows = [{"refused": str(error)}]
        spent = time.perf_counter() - began
        rows = [{"machine": number, "seconds": spent, **row} for row in rows]
        with given.out.open("a") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)
        done += rows
        print(number, f"{spent:.0f} s", flush=True)
    refused = {row["machine"] for row in done if "refused" in row}
    print(f"{len(refused)} of {given.machines} machines refused as a misfit")
    print(*summary([row for row in done if "truth" in row]), sep="\n")


if __name__ == "__main__":
    main()
