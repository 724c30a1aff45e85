"""What the film equilibrium says of machines whose conditions are shifted, nameplate given.

    python tests/benchmarks/conditions.py journal shaft [-n 60] [--folder DIR]

Every row shifts one condition or one gap offset of the standard recipe, whose journals have round
bores here unless a row says otherwise. The scene of each data set is the nameplate, its manifest
has the conditions of the day; what differs from machine to machine, offsets and sensitivities of
the probes among it, is unknown. `cold`: no healthy recordings.
`healthy`: three of the same machine, their wear known to be that of a new one only. `measured`:
three, with the wear that was measured then. All simulated. Errors are of those told, over the
condemning limit; `covered` is the share of intervals of 90 % that hold the truth.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.healthy_reference.healthy import Baseline
from wearstate.diagnose.healthy_reference.probe_means import probe_means
from wearstate.diagnose.nameplate.nameplate import nameplate_of
from wearstate.diagnose.report.film import film_estimate

SEED = 5

UNLOADED = 'path = "load.static"\ndistribution = "uniform"\nlow = "0 N"\nhigh = "1 N"\n'
OFFSET = 'path = "{}.*.offset"\ndistribution = "uniform"\nlow = "{} um"\nhigh = "{} um"\n'
WARM = 'path = "oil.temperature"\ndistribution = "uniform"\nlow = "323.15 K"\nhigh = "333.15 K"\n'

THIN = '"oil.viscosity_40" = "30 cSt"\n"oil.viscosity_100" = "5.2 cSt"\n'

ROWS = {
    "journal": {
        "as trained": "",
        "no belt load": f"[[record]]\n{UNLOADED}",
        "load direction +90 deg": f'[fixed]\n"load.static_across" = "5 kN"\n[[record]]\n{UNLOADED}',
        "length x1.4": '[fixed]\n"bearing.length" = "84 mm"\n',
        "viscosity x2": '[fixed]\n"oil.viscosity" = "60 mPa s"\n',
        "gap offset -20 um": f"[[machine]]\n{OFFSET.format('sensors', -25, -15)}",
    },
    "shaft": {
        "as trained": "",
        "gap offset -60 um": f"[[machine]]\n{OFFSET.format('probes', -90, -30)}",
        "gap offset -150 um": f"[[machine]]\n{OFFSET.format('probes', -180, -120)}",
        "viscosity x0.3": f"[fixed]\n{THIN}",
        "oil +15 K": f"[[record]]\n{WARM}",
    },
}
"""Machine -> row -> what the recipe has beside the standard one."""

SCAR = "scar beside the wear"
ROWS["journal"][SCAR] = (
    '[fixed]\n"film.rung" = "direct"\n"bearing.unworn_clearance" = "0.0914 mm"\n'
)
WORN = {
    SCAR: """
[[record]]
path = "bearing.scar_share"
distribution = "uniform"
low = 0.1
high = 1.0
[[record]]
path = "bearing.scar_angle"
distribution = "uniform"
low = "-20 deg"
high = "20 deg"
"""
}
"""Row -> what its machines have that they had not when they were new."""
RECIPE = "bores as the recipe has"
ROWS["journal"][RECIPE] = ""
ROUND = """
[[choice]]
name = "film"
[[choice.option]]
name = "finite"
weight = 3.0
[[choice.option]]
name = "short"
values = { "film.rung" = "short" }
"""
"""In place of the recipe's choice, which draws scars as well; a short film knows none."""
BORES = {SCAR: "", RECIPE: None}
"""Row -> in place of the recipe's choice of films and bores; ROUND elsewhere."""

RECIPES = {"journal": "journal-bearing", "shaft": "propulsion-shaft"}
SPLITS = {
    "journal": ("fast", "heavy_load", "thin_oil", "beyond_limit"),
    "shaft": ("fast", "heavy_load", "ballast", "beyond_limit"),
}


def made(folder, machine, row, records):
    """Data sets of a row: the machines in question, and the same as new."""
    number = list(ROWS[machine]).index(row)
    paths = []
    for kind in ("standard", "healthy"):
        name = f"{machine}-{number}-{kind}"
        head = f'name = "{name}"\nextends = "{RECIPES[machine]}-{kind}"\n'
        bores = BORES.get(row, ROUND if machine == "journal" else None)
        without = [] if bores is None else ["film"]
        if kind == "standard":
            without += SPLITS[machine]
        else:
            head += f'machines_of = "{machine}-{number}-standard"\n'
        head += f"without = {json.dumps(without)}\n"
        recipe, path = folder / f"{name}.toml", folder / f"{name}.h5"
        worn = WORN.get(row, "") if kind == "standard" else ""
        changed = ROWS[machine][row] + (bores or "") + worn
        recipe.write_text(head + changed, encoding="utf-8")
        if not path.exists():
            table = load_recipe(recipe).table
            machines = records // 2
            generate(recipe, machines * table.records_per_group, path, seed=SEED, jobs=1)
        paths.append(path)
    return paths


def positions(path, severity, known):
    """Machine -> where its shaft ran when it was healthy."""
    found = {}
    with DataSet(path) as data:
        for i in np.flatnonzero(data.manifest["status"] == "ok"):
            means = probe_means(data[int(i)])
            row = dict(means.row) if known else {**means.row, severity: np.nan}
            found.setdefault(means.row["group"], []).append(replace(means, row=row))
    return found


def judged(path, healthy_path, way):
    """Figures of one row in one way."""
    with DataSet(path) as data:
        head = data.attributes
        severity, limit = head.severities[0], head.condemning_limit
        healthy = {} if way == "cold" else positions(healthy_path, severity, way == "measured")
        plate = nameplate_of(path, None, {})
        errors, covered, wide, refused, started = [], [], [], 0, perf_counter()
        usable = np.flatnonzero(data.manifest["status"] == "ok")
        for i in usable:
            recording = data[int(i)]
            new = tuple(healthy.get(recording.row["group"], ()))
            base = Baseline(features=np.zeros(1), recordings=len(new), source="", positions=new)
            found = film_estimate(recording, severity, plate, base)
            if found.severity is None:
                refused += 1
                continue
            truth = recording.row[severity]
            errors.append(abs(found.severity - truth) / limit)
            covered.append(found.low <= truth <= found.high)
            wide.append((found.high - found.low) / limit)
    return {
        "records": len(usable),
        "refused": refused / len(usable),
        "error": float(np.mean(errors)) if errors else None,
        "worst": float(np.max(errors)) if errors else None,
        "covered": float(np.mean(covered)) if covered else None,
        "width": float(np.mean(wide)) if wide else None,
        "ms": 1e3 * (perf_counter() - started) / len(usable),
    }


WAYS = ("cold", "healthy", "measured")


def table(machine, records, folder):
    """Row -> way -> figures."""
    found = {}
    for row in ROWS[machine]:
        paths = made(folder, machine, row, records)
        found[row] = {way: judged(*paths, way) for way in WAYS}
        print(f"{machine}, {row}: {records} records", file=sys.stderr)
    return found


def lines(machine, found):
    """The table as text."""

    def cell(way):
        if way["error"] is None:
            return f"all refused{'':18}"
        return (
            f"{100 * way['error']:5.1f} % (worst {100 * way['worst']:4.1f}), "
            f"{way['covered']:.2f}, refused {100 * way['refused']:2.0f} %"
        )

    yield f"{machine}: error over the limit, covered, refused"
    yield f"{'':24}" + "  ".join(f"{way:44}" for way in WAYS)
    for row, ways in found.items():
        yield f"{row:24}" + "  ".join(f"{cell(ways[way]):44}" for way in WAYS)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("machines", nargs="+", choices=list(ROWS))
    parser.add_argument("-n", "--records", type=int, default=60)
    parser.add_argument("--folder", type=Path, help="keeps the data sets, and uses those there")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args(arguments)
    result = {}
    with TemporaryDirectory() as passing:
        folder = asked.folder or Path(passing)
        folder.mkdir(parents=True, exist_ok=True)
        for machine in asked.machines:
            result[machine] = table(machine, asked.records, folder)
            print("\n".join(lines(machine, result[machine])))
    if asked.json:
        asked.json.write_text(json.dumps(result, indent=1), encoding="utf-8")
    return result


if __name__ == "__main__":
    main()
