"""How well does a wear model fare on a machine that another program simulates?

    python tests/benchmarks/foreign.py bilge-pump [--program A|B|loose|oval] [-n 60] [--peel]

Trains on the library's own records (or takes `--model`, repeatedly), and judges on records of an
independent program of the same nominal numbers: `foreign_pump.py`, `foreign_exudyn.py`,
`foreign_ross.py`, `foreign_journal.py`, `foreign_ross_shaft.py` say which laws they have. With
`--baseline k` a referenced model is judged too, with k healthy records of each foreign machine.
`--peel` repeats it with every difference alone and with all but each. Errors are in per cent of the
condemning limit, with 95 % intervals over machines; a refused record has an estimate and no
interval. Data, models, JSON stay in the folder.

No constant of the foreign programs was chosen by these results. All is simulated.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from foreign_records import Program, write_records
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import generate
from wearstate.diagnose.evaluation.evaluate import judge_rows, judged_rows
from wearstate.diagnose.feature_rows.feature_choice import choice_in
from wearstate.diagnose.healthy_reference.healthy import Baselines, references
from wearstate.diagnose.learning.scores import Judged, ScoreFigure, resampled, share
from wearstate.diagnose.wear_model.estimate import WearModel
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.train import train_model
from wearstate.diagnose.wear_model.verdict import Estimate

PROGRAMS = {
    "bilge-pump": {
        "A": "foreign_pump.PUMP_A",
        "B": "foreign_exudyn.PUMP_B",
        "loose": "foreign_pump.PUMP_LOOSE",
        "oval": "foreign_pump.PUMP_OVAL",
    },
    "journal-bearing": {"A": "foreign_ross.JOURNAL", "B": "foreign_journal.JOURNAL_B"},
    "propulsion-shaft": {"A": "foreign_ross_shaft.SHAFT"},
}
"""Machine -> letter -> where its program is."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A model and its name, and whether it is given healthy records."""

    name: str
    model: WearModel
    home: tuple[Path, Path | None] | None  # its own data, and healthy records of those machines

    @property
    def referenced(self) -> bool:
        return self.model.mode == "referenced"


def program_of(machine: str, letter: str) -> Program:
    """The program; imported only when asked for, as it may need packages of its own."""
    module, name = PROGRAMS[machine][letter].rsplit(".", 1)
    return getattr(import_module(module), name)


# --- models


def trained(given: argparse.Namespace) -> Iterator[Case]:
    """Models trained on the library's own records: cold, and referenced where asked for."""
    home, new = (
        own_records(given, f"{given.machine}-{kind}", records)
        for kind, records in ((given.kind, given.train), ("healthy", given.train * 3 // 2))
    )
    for name, healthy in (("cold", None), ("referenced", new))[: 1 + (given.baseline > 0)]:
        path = given.folder / f"{given.machine}-{given.kind}-{name}-{given.train}.wsm"
        if not path.exists():
            save_model(train_model(home, baseline=healthy, jobs=given.jobs)[0], path)
        yield Case(name=name, model=load_model(path), home=(home, healthy))


def own_records(given: argparse.Namespace, recipe: str, records: int) -> Path:
    """The library's own data set, generated unless it is there."""
    path = given.folder / f"{recipe}-{records}.h5"
    needed = recipe.endswith(given.kind) or given.baseline
    if needed and not path.exists():
        generate(recipe, records, path, seed=given.seed, jobs=given.jobs)
    return path


# --- judging


def judged_set(model: WearModel, path: Path, healthy: Path | None) -> tuple[Judged, list[Estimate]]:
    """What a model says of a data set's unseen machines, the checks of the recordings included."""
    table, rows = judged_rows(model, path, healthy=healthy)
    reference, known = None, None
    if healthy is not None:
        reference = references(table, path, healthy, choice=choice_in(model.card.feature_choice))[0]
        known = Baselines(healthy, model.card)
    found, _ = judge_rows(model, table, rows, reference)
    with DataSet(path) as data:
        recordings = (data[int(row)] for row in rows)
        told = [model.estimate(each, known and known.of(each)) for each in recordings]
    ends = [[np.nan if end is None else end for end in (each.low, each.high)] for each in told]
    low, high = np.array(ends).T
    graded = np.array([each.graded for each in told])
    cautious = np.array([each.verdict == "caution" for each in told])
    return replace(found, graded=graded, cautious=cautious, low=low, high=high), told


def figures(found: Judged, limit: float, condemned: float) -> dict[str, ScoreFigure]:
    """Figures over all records and over those that were not refused.

    Returns
    -------
    dict
        ``error``, ``bias`` and ``missed`` of ``all``; the same and ``coverage`` of ``graded``;
        ``refused`` and ``caution``.
    """
    draws = resampled(found.groups)
    every = np.ones(len(found.truth), dtype=bool)
    off = (found.found - found.truth) / limit
    inside = (found.low <= found.truth) & (found.truth <= found.high)
    worn = found.truth >= condemned
    pairs = {
        f"{name}_{over}": (value, part & where)
        for over, part in (("all", every), ("graded", found.graded))
        for name, value, where in (
            ("error", np.abs(off), every),
            ("bias", off, every),
            ("missed", found.grade <= 1, worn),
        )
    }
    pairs["coverage_graded"] = (inside, found.graded)
    pairs["refused"] = (~found.graded, every)
    pairs["caution"] = (found.cautious, every)
    return {
        name: share(np.where(over, value, 0.0), over.astype(float), draws)
        for name, (value, over) in pairs.items()
    }


def row_of(case: Case, path: Path, healthy: Path | None, what: str) -> dict[str, Any]:
    """Figures of one model on one data set, ready for JSON."""
    found, told = judged_set(case.model, path, healthy if case.referenced else None)
    card = case.model.card
    result = figures(found, card.condemning_limit_m, card.grade_edges_m[-1])
    return {
        "model": case.name,
        "records_of": what,
        "records": len(told),
        "machines": len(set(found.groups.tolist())),
        "verdicts": dict(Counter(each.verdict for each in told)),
        "figures": {name: [one.value, one.low, one.high] for name, one in result.items()},
    }


COLUMNS = (
    ("error_all", "error"),
    ("bias_all", "bias"),
    ("missed_all", "missed"),
    ("refused", "refused"),
    ("caution", "caution"),
    ("error_graded", "error, graded"),
    ("bias_graded", "bias, graded"),
    ("coverage_graded", "coverage"),
    ("missed_graded", "missed, graded"),
)


def line(row: dict[str, Any]) -> str:
    """One row of the table, in per cent."""
    cells = [
        f"{100 * value:.1f} [{100 * low:.1f}, {100 * high:.1f}]"
        for value, low, high in (row["figures"][name] for name, _ in COLUMNS)
    ]
    return f"{row['model']:10} {row['records_of']:18} {row['machines']:4} " + " ".join(
        f"{cell:19}" for cell in cells
    )


def heading() -> str:
    """Names of the columns."""
    names = " ".join(f"{name:19}" for _, name in COLUMNS)
    return f"{'model':10} {'records of':18} {'of':>4} {names}"


# --- what is judged


def variants(program: Program, given: argparse.Namespace) -> dict[str, frozenset[str]]:
    """Sets of differences by name."""
    every = frozenset(program.differences)
    on = (frozenset(given.only) if given.only is not None else every) - frozenset(given.without)
    found = {"foreign": on}
    if given.peel:
        found |= {f"only {name}": frozenset({name}) for name in program.differences}
        found |= {f"without {name}": every - {name} for name in program.differences}
        found |= {"no difference": frozenset()}
    return found


def foreign_records(
    program: Program, given: argparse.Namespace, on: frozenset[str]
) -> tuple[Path, Path | None]:
    """The program's data set with these differences, and its healthy records where asked for."""
    bits = reduce(lambda all_, name: 2 * all_ + (name in on), program.differences, 0)
    stem = f"{program.name.replace(' ', '-')}-{given.n}-seed{given.seed}-{bits}"
    path = given.folder / f"{stem}.h5"
    write_records(program, path, given.n, seed=given.seed, on=on)
    if not given.baseline:
        return path, None
    new = given.folder / f"{stem}-new{given.baseline}.h5"
    write_records(program, new, given.n, seed=given.seed, on=on, healthy=given.baseline)
    return path, new


def campaign(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Rows of the table, one after the other."""
    given.folder.mkdir(parents=True, exist_ok=True)
    program = program_of(given.machine, given.program)
    cases = [
        Case(name=Path(each).stem, model=load_model(each), home=None) for each in given.model or ()
    ] or list(trained(given))
    for case in cases:
        if case.home is not None:
            yield row_of(case, *case.home, "its own, unseen")
    for name, on in variants(program, given).items():
        path, new = foreign_records(program, given, on)
        for case in cases:
            if case.referenced and new is None:
                raise SystemExit(f"{case.name} is referenced; give --baseline 3")
            yield row_of(case, path, new, name)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("machine", choices=list(PROGRAMS))
    parser.add_argument("--program", default="A")
    parser.add_argument("-n", type=int, default=60, help="records, two of each machine")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--model", action="append", help="in place of those trained here")
    parser.add_argument("--train", type=int, default=300, help="records to train on")
    parser.add_argument("--kind", default="standard", help="recipe to train on: or narrow, cold")
    parser.add_argument("--baseline", type=int, default=0, help="healthy records of each machine")
    parser.add_argument("--peel", action="store_true")
    parser.add_argument("--only", nargs="*", help="differences that are on")
    parser.add_argument("--without", nargs="*", default=[], help="differences that are off")
    parser.add_argument("--folder", type=Path, default=Path("benchmark-data"))
    parser.add_argument("--jobs", type=int, default=1, help="for the library's own records")
    given = parser.parse_args()
    print(heading())
    rows = []
    for row in campaign(given):
        rows.append(row)
        print(line(row), flush=True)
    out = given.folder / f"{given.machine}-{given.program}.json"
    out.write_text(json.dumps({**vars(given), "folder": str(given.folder), "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
