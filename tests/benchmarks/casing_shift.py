"""What does a strange casing cost, and what does a healthy reference of the same pump give back?

Trains on pumps of ``bilge-pump-standard``, whose casings scatter by 6 per cent, judges pumps whose
casing frequencies lie up to 20 per cent off, cold and referenced to three healthy records each.
Run as ``python tests/benchmarks/casing_shift.py FOLDER [-n 400]``; what FOLDER holds is used again.
"""

import argparse
from pathlib import Path

from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.evaluation.evaluate import evaluate_model
from wearstate.diagnose.wear_model.train import train_model

SHIFTED = """
name = "casing-shifted"
description = "Standard pumps, casing frequencies up to a fifth off (simulated)"
extends = "bilge-pump-standard"
without = ["fast", "heavy_load", "beyond_limit"]
records = 120
[[machine]]
path = "casing.modes.*.frequency"
distribution = "factor"
low = 0.8
high = 1.2
"""

HEALTHY = """
name = "casing-shifted-healthy"
description = "The same pumps as new (simulated)"
extends = "casing-shifted.toml"
machines_of = "casing-shifted"
records = 180
records_per_group = 3
[severity]
path = "joint.crankpin.diametral_clearance"
low = "0.05 mm"
high = "0.06 mm"
"""

JUDGED = 120
FIGURES = ("mae_share_of_limit", "mae_all_share_of_limit", "unfamiliar", "coverage", "missed_fault")


def data_set(folder, name, recipe, n, seed):
    """Path of a data set, generated where it is not there."""
    path = folder / f"{name}.h5"
    if not path.exists():
        generate(load_recipe(str(recipe)), n, path, seed=seed, jobs=2)
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-n", type=int, default=400, help="records to train on")
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(exist_ok=True)
    recipes = {"casing-shifted": SHIFTED, "casing-shifted-healthy": HEALTHY}
    for name, text in recipes.items():
        (folder / f"{name}.toml").write_text(text)
    judged, judged_new = (folder / f"{name}.toml" for name in recipes)
    known = data_set(folder, "known", "bilge-pump-standard", given.n, 0)
    known_new = data_set(folder, "known-healthy", "bilge-pump-healthy", given.n * 3 // 2, 0)
    strange = data_set(folder, "strange", judged, JUDGED, 1)
    strange_new = data_set(folder, "strange-healthy", judged_new, JUDGED * 3 // 2, 1)
    for mode, own, theirs in (("cold", None, None), ("referenced", known_new, strange_new)):
        model = train_model(known, baseline=own, jobs=2)[0]
        found = evaluate_model(model, strange, healthy=theirs, quick=True, jobs=2)
        print(mode, {name: round(found[name], 4) for name in FIGURES}, flush=True)


if __name__ == "__main__":
    main()
