"""Does ``fidelity = "auto"`` keep its word? Trials with fresh machines and fresh starts.

Each trial draws speed, load and clearance of a built-in scene by its seed, lets auto choose for
each accuracy, and measures the choice against the best rungs on starts that the choice has not
seen. It also looks for a combination that costs less than two thirds of the choice and would have
done. Run as ``python tests/benchmarks/auto_trials.py [--trials 200] [--seconds 900] [SCENE …]``;
``--calibrate`` compares tabulated with measured cost instead. Numbers go to stdout as they come.
"""

import argparse
import time
from itertools import product

import numpy as np
from wearstate.datasets.quantities import QUANTITIES
from wearstate.sim.fidelity import Bench, differences, resolve
from wearstate.sim.ladder import admissible, cost_of, effects_of, with_values
from wearstate.sim.parts import SceneError
from wearstate.sim.scene import load_scene, scene_names

ACCURACIES = (0.10, 0.05, 0.02, 0.01)
FRESH_STARTS = 4
DEAREST = 1.5  # of the cheapest combination that would have done
SHARE_ASKED = 0.93
CLEARLY = 5.0  # a rung that errs so many times the accuracy alone is in no combination that will do

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
    scene = load_scene(name)
    rng = np.random.default_rng([seed, len(name)])
    values = {
        path: value_of(scene, path) * rng.uniform(1 - SPREAD, 1 + SPREAD)
        for path in DRAWS[scene.machine]
        if isinstance(value_of(scene, path), float)
    }
    return with_values(scene, values)


def reference_values(scene):
    """Values of the highest admissible rung of every effect."""
    tops = [admissible(each, scene)[-1] for each in effects_of(scene)]
    return {path: value for rung in tops for path, value in rung.values.items()}


def error_of(bench, values, reference, starts=FRESH_STARTS):
    """Largest error of the means over starts, and its standard error; infinite if it fails."""
    own, other = (bench.outcomes(v, starts) for v in (values, reference))
    if any(outcome.fault for outcome in (*own, *other)):
        return float("inf"), 0.0
    found = differences([o.quantities for o in own], [o.quantities for o in other]).values()
    worst = max(found, key=lambda each: each.error)
    return worst.error, worst.standard_error


def cheapest_that_does(scene, bench, accuracy, below):
    """Least cost under a bound of all combinations within the accuracy; the bound if there is none.

    Every combination is run, but for those that hold a rung which alone errs `CLEARLY` too much.
    """
    reference = reference_values(scene)
    choices = []
    for each in effects_of(scene):
        rungs = admissible(each, scene)
        choices.append(
            [
                rung
                for rung in rungs
                if rung is rungs[-1]
                or error_of(bench, {**reference, **rung.values}, reference, 2)[0]
                <= CLEARLY * accuracy
            ]
        )
    combinations = [
        {path: value for rung in rungs for path, value in rung.values.items()}
        for rungs in product(*choices)
    ]
    priced = sorted((cost_of(with_values(scene, v)), i) for i, v in enumerate(combinations))
    for cost, i in priced:
        if cost >= below:
            break
        if error_of(bench, combinations[i], reference, 2)[0] <= accuracy:
            return cost
    return below


def trial(name, seed, accuracies=ACCURACIES, *, brute=True):
    """One row for each accuracy: what was chosen, its error on fresh starts, its cost."""
    scene = drawn(name, seed)
    quantities = QUANTITIES[scene.machine]
    bench = Bench(scene, quantities, seed=2 * seed, clock=time.perf_counter)
    fresh = Bench(scene, quantities, seed=2 * seed + 1, clock=time.perf_counter)
    reference = reference_values(scene)
    rows = []
    for accuracy in accuracies:
        try:
            found = resolve(scene, quantities, accuracy, bench=bench)
        except SceneError as error:  # a draw that the best rungs cannot run is no trial
            return [{"scene": name, "seed": seed, "refused": error.faults[0]}]
        error, scatter = error_of(fresh, found.values, reference)
        best = cheapest_that_does(scene, bench, accuracy, found.cost) if brute else found.cost
        rows.append(
            {
                "scene": name,
                "seed": seed,
                "accuracy": accuracy,
                "status": found.status,
                "error": error,
                "scatter": scatter,
                # a difference within the scatter of the trial itself is none
                "kept": error - 2 * scatter <= accuracy,
                "dear": found.cost / best,
                "saved": found.cost_of_reference / found.cost,
                "faster": fresh.seconds(reference) / fresh.seconds(found.values),
                "rungs": dict(found.rungs),
            }
        )
    return rows


def summary(rows):
    """Lines that say how often the accuracy was kept, and at what cost."""
    lines = []
    for name, accuracy in sorted({(r["scene"], r["accuracy"]) for r in rows if "kept" in r}):
        own = [r for r in rows if r.get("accuracy") == accuracy and r["scene"] == name]
        lines.append(
            f"{name} at {accuracy:.0%}: "
            f"kept {np.mean([r['kept'] for r in own]):.1%} of {len(own)}, "
            f"within {DEAREST} of the cheapest {np.mean([r['dear'] <= DEAREST for r in own]):.1%} "
            f"(worst {max(r['dear'] for r in own):.2f}), cost over the best rungs' 1/"
            f"{np.median([r['saved'] for r in own]):.3g}, measured 1/"
            f"{np.median([r['faster'] for r in own]):.3g}, "
            f"unresolvable {np.mean([r['status'] == 'unresolvable' for r in own]):.1%}"
        )
    return lines


def calibrate(names):
    """Tabulated over measured time of every rung of every effect, alone."""
    for name in names:
        scene = load_scene(name)
        bench = Bench(scene, QUANTITIES[scene.machine], clock=time.perf_counter)
        for each in effects_of(scene):
            for rung in admissible(each, scene):
                bench.outcomes(rung.values, 3)
                cost = cost_of(with_values(scene, rung.values))
                took = bench.seconds(rung.values)
                print(f"{name} {each.name} {rung.name}: {cost:.4f} s, measured {took:.4f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=scene_names())
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="for each scene")
    parser.add_argument("--calibrate", action="store_true")
    given = parser.parse_args()
    if given.calibrate:
        calibrate(given.scenes)
        return
    for name in given.scenes:
        begin, rows = time.perf_counter(), []
        for seed in range(given.trials):
            rows += trial(name, seed)
            if time.perf_counter() - begin > given.seconds:
                break
        print(
            "\n".join([*summary(rows), *(r["refused"] for r in rows if "refused" in r)]), flush=True
        )


if __name__ == "__main__":
    main()
