"""Does ``fidelity = "auto"`` keep its word? Trials with fresh machines and fresh starts.

Each trial draws speed, load and clearance of a built-in scene by its seed, lets auto choose for
each accuracy, and measures the choice against the best rungs on starts that the choice has not
seen. It also looks for a combination that costs less than two thirds of the choice and would have
done. Run as ``python tests/benchmarks/auto_trials.py [--trials 200] [--seconds 900] [--out FILE]
[SCENE …]``: a line of JSON for every trial, by default in the file beside this script; those that
it has are not run again, and ``--summary`` only reads it. ``--calibrate`` compares tabulated with
measured cost instead. Times are of the processor, of recordings as ``generate`` makes them, without
their truth.
"""

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from pathlib import Path

import numpy as np
from wearstate.datasets.generation.machines import known_of
from wearstate.sim.fidelity.choose import affordable_starts, resolve
from wearstate.sim.fidelity.differences import differences
from wearstate.sim.fidelity.ladder import cost_of, effects_of
from wearstate.sim.fidelity.pilot import Pilot
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene, scene_names
from wearstate.sim.scene.rungs import admissible, with_values
from wearstate.sim.scene.scene import SceneError

ACCURACIES = (0.10, 0.05, 0.02, 0.01)
DEAREST = 1.5  # of the cheapest combination that would have done
CLEARLY = 5.0  # a rung that errs so many times the accuracy alone is in no combination that will do
FRESH_STARTS = (4, 8, 32, 64)  # of a choice, until it is clear whether the accuracy was kept
BRUTE_STARTS = (2, 8, 64)  # of a cheaper combination, until it is clear
LEAST_OFF = 32  # of them: fewer may lie at one end of a scatter that has two
STILL = 0.05  # of the accuracy: scatter below it is none, and one fresh start tells as much as four
SURE = 2.0  # standard errors
CLEAR = 4.0  # the same, of few starts: one quantity in ten is off by 2 of eight starts' by chance
TIMED = 10  # trials of a scene in which the speed is measured

PULSE = {"duration": "0.3 s", "sample_rate": "5.12 kHz", "tacho": None}
SHORTER = {
    "bilge-pump": {"duration": "0.8 s"},  # four revolutions
    "triplex-pump": {"duration": "0.8 s"},  # six
    "journal-bearing": {"duration": "0.2 s", "settling_revolutions": 5},  # ten
    "journal-half-sine": PULSE,  # from eight revolutions before the load until seven after it
    "journal-rectangular-pulse": PULSE,
    "journal-step": PULSE,
    "journal-unbalance": {**PULSE, "duration": "0.16 s", "settling_revolutions": 6},
    "journal-whirl": {**PULSE, "duration": "0.25 s", "start.x": 0.6},  # near its limit cycle
    "propulsion-shaft": {"duration": "1.6 s"},  # eight revolutions
    "shaft-rig": {"duration": "1 s"},  # ten
}
"""What a trial changes: the rungs and their errors stay, a reference on them takes a second or two.
A journal's truth solves the film at every sample, and 25.6 kHz are for drawing."""

DRAWS = {
    "reciprocating-pump": ("drive.speed", "joint.crankpin.diametral_clearance"),
    "journal-bearing": ("drive.speed", "oil.viscosity", "rotor.mass"),
    "propulsion-shaft": ("drive.speed", "oil.viscosity"),
}
SPREAD = 0.15  # of each, uniform, either way: what a recipe draws


def value_of(scene, path):
    """Value at a dotted path."""
    node = scene
    for key in path.split("."):
        node = getattr(node, key)
    return node


def drawn(name, seed):
    """A scene with its conditions drawn; values that it gives another way stay."""
    scene = load_scene(name, SHORTER.get(name))
    rng = np.random.default_rng([seed, len(name)])
    values = {
        path: value_of(scene, path) * rng.uniform(1 - SPREAD, 1 + SPREAD)
        for path in DRAWS[scene.machine]
        if isinstance(value_of(scene, path), float)
    }
    return with_values(scene, values)


def reference_values(scene):
    """Values of the highest admissible rung of every effect that holds on the machine.

    Where the highest together do not hold, such as a link in tension, the first effect that is
    written with a lower rung and cures it goes down by one.
    """
    effects = effects_of(scene)
    tops = {each.name: admissible(each, scene) for each in effects}
    pilot = Pilot(scene, known_of(scene).quantities)
    if pilot.fault(_together(tops)):
        for each in effects:
            lower = {**tops, each.name: tops[each.name][:-1]}
            written = each.current(scene)
            above = not each.numerical and tops[each.name][-1].name != written
            if above and lower[each.name] and not pilot.fault(_together(lower)):
                return _together(lower)
    return _together(tops)


def _together(rungs):
    return {path: value for own in rungs.values() for path, value in own[-1].values.items()}


def starts_of(name, scene):
    """Most starts of a choice: they last as long as those of the scene as it is written."""
    written = load_scene(name)
    starts = affordable_starts(cost_of(with_values(written, reference_values(written))))
    return 1 << math.floor(math.log2(starts * written.duration / scene.duration))


def apart(pilot, values, reference, starts):
    """Differences of the means over starts; None if a run is not valid."""
    own, other = (pilot.outcomes(v, starts) for v in (values, reference))
    if any(outcome.fault for outcome in (*own, *other)):
        return None
    return differences([o.quantities for o in own], [o.quantities for o in other])


def student(starts):
    """Factor on standard errors of few starts, about Student's at 99 % from four starts on."""
    return 1 + 2.3 / (starts - 1)


def off(found, starts, accuracy):
    """Whether differences are beyond the accuracy for sure; what is not valid is."""
    if found is None:
        return True
    doubt = SURE * student(starts)
    return any(d.error - doubt * d.standard_error > accuracy for d in found.values())


def would_do(pilot, values, reference, accuracy):
    """Whether a combination keeps the accuracy, on as many starts as tell."""
    for starts in BRUTE_STARTS:
        found = apart(pilot, values, reference, starts)
        if off(found, starts, accuracy):
            return False
        if max(d.standard_error for d in found.values()) <= STILL * accuracy:
            break
    return max(d.error for d in found.values()) <= accuracy


# --- one trial


def verdict(pilot, fresh, values, reference, accuracy):
    """How well a choice does on fresh starts: of as many as tell, 64 at the most.

    ``kept`` is false where a quantity is off by more than the accuracy and twice its own standard
    error, ``strictly`` where it is off by more than the accuracy at all. Before all 64 have run it
    takes four times that and 32 starts to be off, twice with Student's factor to be kept: knocks
    scatter within two bounds rather than about a mean, and the first four may well lie near the
    same one.
    """
    pilot = apart(pilot, values, reference, 2)
    still = max(each.standard_error for each in pilot.values()) <= STILL * accuracy
    for starts in ((1,) if still else ()) + FRESH_STARTS:
        found = apart(fresh, values, reference, starts)
        if found is None:
            return {"kept": False, "strictly": False, "error": math.inf, "worst": "not valid"}
        alone = starts == 1
        last = starts == FRESH_STARTS[-1]
        doubt = {name: 0.0 if alone else d.standard_error for name, d in found.items()}
        few = 1.0 if alone or last else student(starts)
        near, far = SURE * few, SURE if last else CLEAR
        sure = all(d.error + near * doubt[name] <= accuracy for name, d in found.items())
        beyond = any(d.error - far * doubt[name] > accuracy for name, d in found.items())
        if sure or (beyond and starts >= LEAST_OFF):
            break
    worst = max(found, key=lambda name: found[name].error)
    return {
        "kept": not beyond,
        "strictly": found[worst].error <= accuracy,
        "error": found[worst].error,
        "worst": worst,
        "scatter": doubt[worst],
        "starts": starts,
    }


def cheaper_that_does(scene, pilot, reference, accuracy, below):
    """Least cost under a bound of all combinations within the accuracy; None if there is none.

    Every combination is run, but for those that hold a rung which alone errs `CLEARLY` too much.
    """
    choices = []
    for each in effects_of(scene):
        rungs = admissible(each, scene)
        choices.append(
            [
                rung
                for rung in rungs
                if each.numerical
                or rung is rungs[-1]
                or not off(
                    apart(pilot, {**reference, **rung.values}, reference, 2), 2, CLEARLY * accuracy
                )
            ]
        )
    combinations = [
        {path: value for rung in rungs for path, value in rung.values.items()}
        for rungs in product(*choices)
    ]
    priced = sorted((cost_of(with_values(scene, v)), i) for i, v in enumerate(combinations))
    for cost, i in priced:
        if cost >= below:
            return None
        if would_do(pilot, combinations[i], reference, accuracy):
            return cost
    return None


def seconds_of(scene, values):
    """Processor time of a recording, the less of two."""
    changed, times = with_values(scene, values), []
    for seed in range(2):
        begin = time.process_time()
        simulate(changed, seed=seed)
        times.append(time.process_time() - begin)
    return min(times)


def trial(name, seed, accuracies=ACCURACIES, *, brute=True, timed=False):
    """One row for each accuracy: what was chosen, its error on fresh starts, its cost."""
    scene = drawn(name, seed)
    quantities, starts = known_of(scene).quantities, starts_of(name, scene)
    pilot, fresh = (Pilot(scene, quantities, seed=2 * seed + k) for k in range(2))
    reference = reference_values(scene)
    slowest = seconds_of(scene, reference) if timed else math.nan
    rows = []
    for accuracy in accuracies:
        try:
            found = resolve(scene, quantities, accuracy, starts=starts, pilot=pilot)
        except SceneError as error:  # a draw that the best rungs cannot run is no trial
            return {"scene": name, "seed": seed, "refused": error.faults[0]}
        row = {
            "accuracy": accuracy,
            "status": found.status,
            "estimate": found.estimated_error,
            "saved": found.cost_of_reference / found.cost,
            "rungs": dict(found.rungs),
        }
        promised = found.status != "unresolvable"
        if found.values == reference:
            row |= {"kept": True, "strictly": True, "error": 0.0, "worst": "", "scatter": 0.0}
        elif promised:
            row |= verdict(pilot, fresh, found.values, reference, accuracy)
        if brute and promised:
            limit = found.cost / DEAREST
            best = cheaper_that_does(scene, pilot, reference, accuracy, limit)
            row["dear"] = DEAREST if best is None else found.cost / best
        if timed:
            row["faster"] = slowest / seconds_of(scene, found.values)
        rows.append(row)
    return {"scene": name, "seed": seed, "rows": rows, "runs": pilot.runs + fresh.runs}


# --- many


HEAD = (
    "| scene | trials | kept at 10 / 5 / 2 / 1 % | largest error over accuracy | within 1.5 of the "
    "cheapest | times as fast at 2 %, median (least) |\n|---|---|---|---|---|---|"
)
FAST_AT = 0.02


def summary(trials):
    """Rows of a Markdown table: how often the accuracy was kept, and at what cost."""
    return [
        _row(name, [each for each in trials if each["scene"] == name and "rows" in each])
        for name in sorted({each["scene"] for each in trials})
    ]


def _row(name, trials):
    """One scene; what is unresolvable promises nothing, and is counted apart."""
    told = [[r for r in each["rows"] if r["status"] != "unresolvable"] for each in trials]
    rows = [row for each in told for row in each]
    tried = [sum(r["accuracy"] == a for each in trials for r in each["rows"]) for a in ACCURACIES]
    kept = [
        _kept([r for r in rows if r["accuracy"] == a], n, len(trials))
        for a, n in zip(ACCURACIES, tried, strict=True)
    ]
    far = max((row["error"] / row["accuracy"] for row in rows), default=math.nan)
    dear = [row["dear"] for row in rows if "dear" in row]
    cheap = sum(each <= DEAREST for each in dear)
    beyond = "" if cheap == len(dear) else f", worst {max(dear):.2g}"
    fast = [r["faster"] for r in rows if "faster" in r and r["accuracy"] == FAST_AT]
    faster = f"{_times(np.median(fast))} ({_times(min(fast))})" if fast else "-"
    return (
        f"| `{name}` | {len(trials)} | {' / '.join(kept)} | {far:.2f} | "
        f"{cheap} of {len(dear)}{beyond} | {faster} |"
    )


def _times(ratio):
    return f"{float(f'{ratio:.2g}'):,g}"


def _kept(rows, tried, trials):
    """Kept of those resolved; in how many trials, where the others are unresolvable."""
    kept = sum(row["kept"] for row in rows)
    if kept == len(rows) == trials:
        return "all"
    within = "" if tried == len(rows) else f" in {tried}"
    return f"{kept} of {len(rows)}{within}" if tried else "-"


def line_of(result):
    """JSON of a trial, its numbers to five digits."""

    def short(value):
        if isinstance(value, float):
            return float(f"{value:.5g}")
        if isinstance(value, dict):
            return {key: short(each) for key, each in value.items()}
        return [short(each) for each in value] if isinstance(value, list) else value

    return json.dumps(short(result))


def run_scene(name, trials, seconds, jobs, write):
    """Trials of a scene that are not done yet, until the time is up."""
    end = time.monotonic() + seconds
    if jobs == 1:
        for seed in trials:
            if time.monotonic() >= end:
                return
            write(trial(name, seed, timed=seed < TIMED))
        return
    with ProcessPoolExecutor(jobs) as pool:
        waiting = [pool.submit(trial, name, seed, timed=seed < TIMED) for seed in trials]
        for each in as_completed(waiting):
            write(each.result())
            if time.monotonic() >= end:
                pool.shutdown(cancel_futures=True)
                return


def calibrate(names):
    """Tabulated and measured time of every rung of every effect, alone and below the best."""
    for name in names:
        scene = load_scene(name, SHORTER.get(name))
        for label, base in (("as written", {}), ("else the best", reference_values(scene))):
            for each in effects_of(scene):
                for rung in admissible(each, scene):
                    values = {**base, **rung.values}
                    cost = cost_of(with_values(scene, values))
                    took = seconds_of(scene, values)
                    line = f"{name}, {label}, {each.name} {rung.name}: {cost:.4f} s"
                    print(f"{line}, measured {took:.4f} s, ratio {cost / took:.2f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=scene_names())
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=math.inf, help="for each scene")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".jsonl"))
    parser.add_argument("--summary", action="store_true", help="of the file alone")
    parser.add_argument("--calibrate", action="store_true")
    given = parser.parse_args()
    if given.calibrate:
        calibrate(given.scenes)
        return
    done = []
    if given.out.exists():
        done = [json.loads(line) for line in given.out.read_text().splitlines() if line]

    def write(result):
        done.append(result)
        with given.out.open("a", encoding="utf-8") as file:
            file.write(line_of(result) + "\n")

    for name in () if given.summary else given.scenes:
        had = {each["seed"] for each in done if each["scene"] == name}
        rest = [seed for seed in range(given.trials) if seed not in had]
        run_scene(name, rest, given.seconds, given.jobs, write)
        print("\n".join(summary([each for each in done if each["scene"] == name])), flush=True)
    if given.summary:
        print("\n".join([HEAD, *summary(done)]))


if __name__ == "__main__":
    main()
