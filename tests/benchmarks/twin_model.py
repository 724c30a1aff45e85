"""Does a twin improve a wear model? Paired, on machines that an independent program simulates.

    wearstate generate bilge-pump-standard -n 8000 --seed 7 -o wide.h5
    wearstate train wide.h5 -o wide.wsm
    python tests/benchmarks/twin_model.py wide.h5 wide.wsm --machines 12 --wide 3000 --pool 300

For every machine: a twin is calibrated on three healthy records; a pool of records is drawn, half
of them of the twin (`generate --twin`); the parts of the wide model are fitted anew to the first
`--wide` records alone, and to these with the pool, once and with each of its records counted
`--weight` times. All three judge the same worn records of the machine. Weights of the parts are
those of the wide model, so that one fit of each suffices; no interval is fitted. Differences are
paired, with 95 % intervals over machines. All is simulated.
"""

import argparse
import json
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import wearstate
from foreign_pump import CONDEMNING
from numpy.typing import NDArray
from twin_opinion import COLUMN, foreign_machines
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.feature_rows.feature_table import feature_table, recording_features
from wearstate.diagnose.learning.blends import Blend
from wearstate.diagnose.learning.regressions import CANDIDATES
from wearstate.diagnose.learning.scores import resampled, share
from wearstate.diagnose.wear_model.training_rows import TrainingRows
from wearstate.sim.output.recording import Recording

SEED = 0


def rows_of(path: Path, names: tuple[str, ...], most: int | None = None) -> TrainingRows:
    """First usable records of a data set, with the features of a model."""
    table = feature_table(path)
    if table.names != names:
        raise SystemExit(f"{path}: its features are not those of the model; make both anew")
    manifest = table.manifest
    return TrainingRows(
        names=names,
        rows=table.values[:most],
        baseline=None,
        severity=manifest[COLUMN].to_numpy(dtype=float)[:most],
        groups=manifest["group"].to_numpy()[:most],
    )


def fitted(like: Blend, *sets: tuple[TrainingRows, int]) -> Blend:
    """Parts of a blend fitted to sets of records, each counted so many times; weights as they were.

    Every set is seen with its resonances moved as well, as training does.
    """
    known = {each.name: each for each in CANDIDATES}
    asked = [(each, each.moved(SEED), times) for each, times in sets]
    rows, moved = (
        np.concatenate([np.repeat(pair[i].rows, pair[2], axis=0) for pair in asked]) for i in (0, 1)
    )
    target = np.concatenate([np.repeat(each.severity, times) for each, _, times in asked])
    parts = tuple(known[name].fit(rows, moved, target, SEED) for name in like.names)
    return Blend(
        names=like.names,
        parts=parts,
        weights=like.weights,
        low=like.low,
        high=like.high,
        tube=like.tube,
    )


def told(blend: Blend, records: list[Recording]) -> NDArray[np.float64]:
    """Clearance by a blend [m]."""
    return blend.predict(np.array([recording_features(each)[1] for each in records]))


def pool_of(healthy: list[Recording], stem: Path, records: int) -> Path:
    """Records half of which are of the twin of a machine.

    Raises
    ------
    wearstate.MisfitError
        No machine of the scene could have made the healthy records.
    """
    scene, path = stem.with_suffix(".toml"), stem.with_suffix(".h5")
    if not scene.exists():
        wearstate.calibrate("bilge-pump", healthy).save(scene)
    if not path.exists():
        generate(load_recipe("bilge-pump-standard", twin=scene), records, path, seed=SEED)
    return path


def judged(given: argparse.Namespace) -> Iterator[dict]:
    """One row a worn record."""
    model = wearstate.load_model(given.model)
    like, names = model.blind.severity, model.names
    wide = rows_of(given.data, names, given.wide)
    alone = fitted(like, (wide, 1))
    given.folder.mkdir(parents=True, exist_ok=True)
    for number, (healthy, worn) in enumerate(foreign_machines(given)):
        began = time.process_time()
        try:
            path = pool_of(healthy, given.folder / f"{given.seed}-{number}", given.pool)
        except wearstate.MisfitError as error:
            print(f"{number}: refused: {error}", flush=True)
            continue
        pool = rows_of(path, names)
        found = {
            "wide": told(alone, worn),
            "twin": told(fitted(like, (wide, 1), (pool, 1)), worn),
            "weighted": told(fitted(like, (wide, 1), (pool, given.weight)), worn),
        }
        spent = time.process_time() - began
        for i, one in enumerate(worn):
            yield {
                "machine": number,
                "truth": one.row[COLUMN],
                **{name: float(each[i]) for name, each in found.items()},
                "seconds": spent,
            }


def summary(rows: list[Mapping[str, float]]) -> str:
    """Errors of the three, and what the twin changes, in per cent of the condemning limit."""
    draws = resampled(np.array([row["machine"] for row in rows]))
    off = {
        name: 100 * np.array([row[name] - row["truth"] for row in rows]) / CONDEMNING
        for name in ("wide", "twin", "weighted")
    }
    every = np.ones(len(rows))

    def mean(values: NDArray[np.float64]) -> str:
        found = share(values, every, draws)
        return f"{found.value:+.1f} ({found.low:+.1f} to {found.high:+.1f})"

    lines = [f"{len(rows)} records of {len({row['machine'] for row in rows})} machines"]
    for name, each in off.items():
        change = mean(abs(each) - abs(off["wide"]))
        lines.append(f"{name}: error {mean(abs(each))}, bias {mean(each)}, against wide {change}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="records of bilge-pump-standard")
    parser.add_argument("model", type=Path, help="trained on them")
    parser.add_argument("--wide", type=int, default=3000, help="of these records")
    parser.add_argument("--pool", type=int, default=300, help="records, half of them of the twin")
    parser.add_argument("--weight", type=int, default=4, help="of a record of the pool")
    parser.add_argument("--machines", type=int, default=12)
    parser.add_argument("--records", type=int, default=4, help="worn ones of each machine")
    parser.add_argument("--seed", type=int, default=77, help="of the foreign machines")
    parser.add_argument("--only", nargs="*", help="differences of the foreign program that are on")
    parser.add_argument("--folder", type=Path, default=Path("benchmark-data/twin-model"))
    given = parser.parse_args()
    rows = []
    for row in judged(given):
        rows.append(row)
        print(json.dumps(row), flush=True)
        if len({each["machine"] for each in rows}) > 1 and len(rows) % given.records == 0:
            print(summary(rows), flush=True)


if __name__ == "__main__":
    main()
