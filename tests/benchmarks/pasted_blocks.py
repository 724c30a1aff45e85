"""Does the block that ``wearstate chart SCENE`` recommends keep its word once it is pasted?

Run as ``python tests/benchmarks/pasted_blocks.py [SCENE …] [--budget 90] [--starts 32]
[--accuracy 0.02]``. For each question of a chart, the scene with the recommended values and the
same scene with the reference's run from starts that the chart has not seen, 32 each; where two of
them agree to a twentieth of the accuracy, starts are all alike and two do. A row tells the largest
error of a quantity beside what was promised, and whether it is within the accuracy. Exits 1 where
one is beyond it for sure.
"""

import argparse
import json
import subprocess
import sys

from auto_trials import reference_values
from first_answers import SCENES
from wearstate.datasets.generation.machines import known_of
from wearstate.sim.fidelity.differences import differences
from wearstate.sim.fidelity.ladder import effects_of
from wearstate.sim.fidelity.pilot import Pilot
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.rungs import admissible

FRESH = 7_001  # a seed that no chart takes
ALIKE = 0.05  # of the accuracy: scatter below it is none
SURE = 2.0  # standard errors
KEPT = "your rungs kept"


def chart_of(name, sets, budget, accuracy):
    """JSON of a chart, made by the command."""
    command = [sys.executable, "-m", "wearstate", "chart", name, "--json", "--budget", str(budget)]
    command += [] if accuracy is None else ["--accuracy", str(accuracy)]
    for each in sets:
        command += ["--set", each]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def finest_numerics(scene):
    """Values of the last rung of every numerical effect."""
    tops = [admissible(each, scene)[-1] for each in effects_of(scene) if each.numerical]
    return {path: value for rung in tops for path, value in rung.values.items()}


def compared(pilot, values, reference, starts):
    """Difference of every quantity; a text where a run is not valid."""
    own, best = (pilot.outcomes(each, starts) for each in (values, reference))
    fault = next((each.fault for each in (*own, *best) if each.fault), "")
    return fault or differences([o.quantities for o in own], [o.quantities for o in best])


def judged(scene, choice, accuracy, starts):
    """What a recommendation does on fresh starts."""
    kept = choice["question"] == KEPT
    reference = finest_numerics(scene) if kept else reference_values(scene)
    pilot = Pilot(scene, known_of(scene).quantities, seed=FRESH)
    took = 2
    found = compared(pilot, choice["changes"], reference, took)
    if not isinstance(found, str):
        scatter = max(each.standard_error for each in found.values())
        if scatter > ALIKE * accuracy:
            took = starts
            found = compared(pilot, choice["changes"], reference, took)
    if isinstance(found, str):
        return {"error": float("inf"), "worst": found, "standard_error": 0.0, "starts": took}
    worst = max(found, key=lambda each: found[each].error)
    return {
        "error": found[worst].error,
        "worst": worst,
        "standard_error": found[worst].standard_error,
        "starts": took,
    }


HEAD = (
    "| scene | question | recommended | promised [%] | on fresh starts [%] | in | starts | "
    "within |\n|---|---|---|---|---|---|---|---|"
)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), metavar="SCENE")
    parser.add_argument("--budget", type=float, default=90.0)
    parser.add_argument("--starts", type=int, default=32)
    parser.add_argument("--accuracy", type=float, help="default that of chart")
    given = parser.parse_args()
    print(HEAD, flush=True)
    beyond = 0
    for label in given.scenes:
        name, sets = SCENES[label]
        chart = chart_of(name, sets, given.budget, given.accuracy)
        scene = load_scene(name, dict(each.split("=", 1) for each in sets))
        accuracy = chart["accuracy"]
        for choice in chart["recommendations"]:
            if choice["status"] != "resolved":
                told = f"{choice['status']}: {choice['name']}"
                print(f"| `{label}` | {choice['question']} | {told} | | | | | |", flush=True)
                continue
            row = judged(scene, choice, accuracy, given.starts)
            far = row["error"] - SURE * row["standard_error"] > accuracy
            beyond += far
            within = "no" if far else "yes" if row["error"] <= accuracy else "by chance"
            print(
                f"| `{label}` | {choice['question']} | {choice['name']} | "
                f"{100 * choice['promised']:.2f} | {100 * row['error']:.2f} ± "
                f"{100 * row['standard_error']:.2f} | {row['worst']} | {row['starts']} | "
                f"{within} |",
                flush=True,
            )
    return int(beyond > 0)


if __name__ == "__main__":
    raise SystemExit(main())
