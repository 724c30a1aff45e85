"""Is another machine in the recording of a pump named, and what does it cost where it is not?

    python tests/benchmarks/company.py MODEL [-n 160] [--seed 3]

MODEL of ``wearstate train`` on `bilge-pump-standard`. Simulated pumps of that recipe, alone, with a
gear mesh of 1 to 5 m/s^2 at an order from 23 to 180 (half of them whole, side bands of a turn), and
with a second pump of the recipe beside it, worn to 60 to 150 % of the limit, at 0.6 to 1.7 times
the speed and heard 10 to 25 dB softer. Prints shares named; of those whose error rises by 6 % of
the limit or more; and with the order or rate within 1 %.
"""

import argparse
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.recipe import Recipe
from wearstate.datasets.recipe.records import Sample, sample_records
from wearstate.diagnose.wear_model.estimate import WearModel
from wearstate.diagnose.wear_model.file import load_model
from wearstate.diagnose.wear_model.verdict import Estimate
from wearstate.features.rotation.order import pulse_times, shaft_phase
from wearstate.sim.machine.simulate import simulate_many
from wearstate.sim.output.recording import Recording
from wearstate.sim.scene.load import override, scene_from_table

CLEARANCE = "joint.crankpin.diametral_clearance"
COSTLY = 0.06  # of the condemning limit
SILENT = {f"sensors.{i}.{what}": 0.0 for i in (0, 1) for what in ("noise", "mains")}


def pumps(recipe: Recipe, n: int, seed: int) -> list[Sample]:
    """One record of each machine."""
    per = recipe.table.records_per_group
    skip = np.arange(n * per) % per != 0
    return list(sample_records(recipe, n * per, seed=seed, skip=skip))


def with_more(recording: Recording, more: np.ndarray) -> Recording:
    signal = recording.signal.copy()
    rows = [i for i, name in enumerate(recording.names) if name != recording.tacho]
    signal[rows] += more.astype(np.float32)
    return replace(recording, signal=signal)


def meshing(recording: Recording, order: float, size: float, rng: np.random.Generator) -> Recording:
    """With side bands of 3 to 20 %, at phases of their own in each channel."""
    fs, tacho = recording.sample_rate, recording.tacho_signal
    turns = 2 * np.pi * shaft_phase(pulse_times(tacho, fs), tacho.size, fs)
    side = 2 * rng.uniform(0.03, 0.2)
    waves = [
        (1 + side * np.cos(turns + a)) * np.cos(order * turns + b)
        for a, b in rng.uniform(0, 2 * np.pi, (len(recording.vibration), 2))
    ]
    return with_more(recording, size * np.array(waves))


def beside(recording: Recording, other: Recording, db: float) -> Recording:
    """Another pump, so much softer than each channel [dB]."""
    heard = other.vibration - other.vibration.mean(axis=1, keepdims=True)
    gain = 10 ** (db / 20) * recording.vibration.std(axis=1) / heard.std(axis=1)
    return with_more(recording, gain[:, None] * heard)


def cases(n: int, seed: int) -> Iterator[tuple[str, float, float, list[Recording]]]:
    """Kind, truth [m], order or ratio of rates, and the recording alone and with company."""
    recipe, rng = load_recipe("bilge-pump-standard"), np.random.default_rng(seed)
    own, others = pumps(recipe, n, seed), pumps(recipe, n, seed + 1)
    ratios = rng.uniform(0.6, 1.7, n)
    scenes = []
    for sample, other, ratio in zip(own, others, ratios, strict=True):
        limit = sample.scene.wear.condemning_diametral
        changed = {"drive.speed": sample.drawn["drive.speed"] * ratio}
        changed[CLEARANCE] = limit * rng.uniform(0.6, 1.5)
        table = override(recipe.base, {**other.drawn, **SILENT, **changed})
        scenes.append((scene_from_table(table), other.seed))
    alone = dict(simulate_many([(sample.scene, sample.seed) for sample in own]))
    company = dict(simulate_many(scenes))
    for i, sample in enumerate(own):
        pair = (alone[i], company[i])
        if not all(isinstance(each, Recording) and each.status.ok for each in pair):
            continue
        known, truth = replace(alone[i], row=sample.row, numerics={}), sample.drawn[CLEARANCE]
        order = float(rng.uniform(23, 180))
        order = round(order) if rng.random() < 0.5 else order
        yield "mesh", truth, order, [known, meshing(known, order, rng.uniform(1, 5), rng)]
        yield "pump", truth, ratios[i], [known, beside(known, company[i], rng.uniform(-25, -10))]


def named(estimate: Estimate) -> list[float]:
    """Orders and ratios in the cautions of other machines."""
    found = [
        re.search(r"order ([\d.]+) of the shaft: half|([\d.]+) times per turn", caution)
        for caution in estimate.cautions
    ]
    return [float(each[1] or each[2]) for each in found if each]


def judged(model: WearModel, n: int, seed: int) -> dict[str, list[tuple[bool, bool, bool, float]]]:
    """By kind: named, rightly, costly and error, of every verdict with a grade."""
    rows: dict[str, list[tuple[bool, bool, bool, float]]] = {"alone": [], "mesh": [], "pump": []}
    for kind, truth, place, recordings in cases(n, seed):
        told = [model.estimate(each) for each in recordings]
        if not all(each.graded for each in told):
            continue
        errors = [abs(each.severity - truth) / model.card.condemning_limit_m for each in told]
        said = [named(each) for each in told]
        right = any(abs(value / place - 1) < 0.01 for value in said[1])
        if kind == "mesh":
            rows["alone"].append((bool(said[0]), False, False, errors[0]))
        rows[kind].append((bool(said[1]), right, errors[1] - errors[0] > COSTLY, errors[1]))
    return rows


def main() -> None:
    """Print a line for each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path)
    parser.add_argument("-n", type=int, default=160)
    parser.add_argument("--seed", type=int, default=3)
    given = parser.parse_args()
    for kind, rows in judged(load_model(given.model), given.n, given.seed).items():
        said, right, costly, error = (np.array(column) for column in zip(*rows, strict=True))
        print(
            f"{kind}: {len(rows)} graded, named {said.mean():.3f}, of {costly.sum()} costly "
            f"{said[costly].sum()}, rightly {right[said].sum()} of {said.sum()}; error "
            f"{100 * error.mean():.1f} %, of those not named {100 * error[~said].mean():.1f} %"
        )


if __name__ == "__main__":
    main()
