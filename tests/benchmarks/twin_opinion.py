"""Second opinion of twins on machines that were not used for tuning: error and coverage.

Each machine is calibrated on three healthy recordings; then the clearance of further recordings of
it, worn and at other speeds and pressures, is told by its twin alone. Own machines are drawn by the
standard recipe, of another seed than any test's; foreign ones are of an independent program.

    python tests/benchmarks/twin_opinion.py own --machines 6 --records 7 --seed 901
    python tests/benchmarks/twin_opinion.py foreign --machines 6 --records 3
"""

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

import numpy as np
import wearstate
from foreign_pump import AS_NEW, CONDEMNING, PUMP_A
from foreign_records import Job
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import Sample, sample_records
from wearstate.diagnose.twin.opinion import second_opinion
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import Recording
from wearstate.sim.scene.load import override, scene_from_table

HEALTHY = 3
COLUMN = "diametral_clearance_crankpin_m"
PATH = "joint.crankpin.diametral_clearance"


def drawn_pumps(
    count: int, per: int, seed: int, recipe: str = "bilge-pump-standard"
) -> Iterator[tuple[dict, list[Sample], list[float]]]:
    """Scene of the recipe, `per` draws of each pump, and clearances of its healthy recordings."""
    plan = load_recipe(recipe, {"duration": "2.4 s"})
    plan = replace(plan, table=plan.table.model_copy(update={"records_per_group": per}))
    samples = list(sample_records(plan, count * per, seed=seed))
    rng = np.random.default_rng(seed)
    for number in range(count):
        new = np.exp(rng.uniform(np.log(AS_NEW), np.log(1.2 * AS_NEW)))  # of the machine
        clearances = [float(new * rng.uniform(1, 1.05)) for _ in range(HEALTHY)]
        yield plan.base, samples[number * per : (number + 1) * per], clearances


def own_machines(given: argparse.Namespace) -> Iterator[tuple[list[Recording], list[Recording]]]:
    """Healthy and worn recordings of machines that the recipe draws."""
    for base, mine, new in drawn_pumps(given.machines, HEALTHY + given.records, given.seed):
        heard = [heard_of(base, s, c) for s, c in zip_longest(mine, new)]
        yield heard[:HEALTHY], heard[HEALTHY:]


def heard_of(base: dict, sample: Sample, clearance: float | None) -> Recording:
    """Simulated recording of a draw, of a clearance of its own where one is given."""
    drawn = {**sample.drawn, **({} if clearance is None else {PATH: clearance})}
    found = simulate(scene_from_table(override(base, drawn)), seed=sample.seed)
    return replace(found, row={**sample.row, COLUMN: drawn[PATH]}, source=f"record {sample.index}")


def foreign_machines(
    given: argparse.Namespace,
) -> Iterator[tuple[list[Recording], list[Recording]]]:
    """The same of the independent program."""
    on = frozenset(PUMP_A.differences if given.only is None else given.only)
    for number in range(given.machines):
        jobs = [
            Job(
                seed=given.seed,
                machine=number,
                record=1000 * number + i,
                healthy=i < HEALTHY,
                on=on,
            )
            for i in range(HEALTHY + given.records)
        ]
        heard = [_foreign(job) for job in jobs]
        yield heard[:HEALTHY], heard[HEALTHY:]


def _foreign(job: Job) -> Recording:
    signal, row = PUMP_A.make(job)
    found = Recording.from_array(
        signal,
        PUMP_A.head["sample_rate"],
        channels=PUMP_A.head["channels"],
        tacho="tacho",
    )
    row = {name: value for name, value in row.items() if name != "mean_speed_hz"}
    return replace(found, row=row, source=f"foreign {job.record}")


def judged(given: argparse.Namespace) -> Iterator[dict]:
    """One row a recording."""
    machines = own_machines if given.whose == "own" else foreign_machines
    folder = given.folder / f"{given.whose}-{given.seed}"
    folder.mkdir(parents=True, exist_ok=True)
    for number, (healthy, worn) in enumerate(machines(given)):
        began = time.process_time()
        scene = folder / f"{number}.toml"
        if not scene.exists():
            try:
                wearstate.calibrate("bilge-pump", healthy).save(scene)
            except wearstate.MisfitError as error:
                print(f"{number}: refused: {error}", flush=True)
                yield {"machine": number, "refused": str(error)}
                continue
        spent = time.process_time() - began
        for one in worn:
            began = time.process_time()
            found = second_opinion(scene, one, seed=given.seed)
            yield {
                "machine": number,
                "truth": one.row[COLUMN],
                "speed_hz": one.row["speed_hz"],
                **{key: getattr(found, key) for key in ("severity", "low", "high", "p")},
                "calibration_s": spent,
                "seconds": time.process_time() - began,
            }


def summary(rows: list[dict]) -> str:
    """Error in shares of the condemning limit, coverage, width, bias."""
    told = [row for row in rows if "truth" in row]
    if not told:
        return "nothing was calibrated"
    truth, found, low, high, p = (
        np.array([row[key] for row in told]) for key in ("truth", "severity", "low", "high", "p")
    )
    off = (found - truth) / CONDEMNING
    inside = (low <= truth) & (truth <= high)
    return (
        f"{len(told)} recordings of {len({row['machine'] for row in told})} machines, "
        f"{len(rows) - len(told)} refused: error {100 * abs(off).mean():.1f} % of the limit "
        f"(median {100 * np.median(abs(off)):.1f}), bias {100 * off.mean():+.1f}, coverage "
        f"{inside.mean():.2f}, half width {50 * ((high - low) / CONDEMNING).mean():.1f}, "
        f"p < .02 of {(p < 0.02).sum()}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("whose", choices=["own", "foreign"])
    parser.add_argument("--machines", type=int, default=6)
    parser.add_argument("--records", type=int, default=7)
    parser.add_argument("--seed", type=int, default=901)
    parser.add_argument("--only", nargs="*", help="differences of the foreign program that are on")
    parser.add_argument("--folder", type=Path, default=Path("benchmark-data/twin"))
    given = parser.parse_args()
    rows = []
    for row in judged(given):
        rows.append(row)
        print(json.dumps(row), flush=True)
    print(summary(rows))


if __name__ == "__main__":
    main()
