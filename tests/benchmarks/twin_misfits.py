"""Recordings that are not of the scene: does a calibration refuse them, and keep the true ones?

    python tests/benchmarks/twin_misfits.py --each 8 --true 24 --seed 7001 --out twin_misfits.jsonl

Pumps are drawn by the standard recipe, two healthy recordings each, and recorded so that they are
not what the scene says; then they are calibrated with the scene as it is written. A calibration
counts as refused when it raises MisfitError. It judges by its first ensemble, so that it is stopped
there, and kinds of the same pump share that ensemble: their speeds differ by less than one part in
a hundred. How often machines of the scene are refused is also counted on further draws of the
recipe, short as the ensemble is. What is in the file already is not repeated. Prints a Markdown
table with exact intervals of 95 %. All is simulated.
"""

import argparse
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import wearstate
from scipy.stats import binomtest
from strangers import matched, resampled
from twin_opinion import drawn_pumps, heard_of
from wearstate.datasets.draws.draws import value_at
from wearstate.datasets.recipe.records import Sample
from wearstate.diagnose.twin import inversion, regimes
from wearstate.diagnose.twin.ensemble import simulated
from wearstate.diagnose.twin.levels import layout_of
from wearstate.diagnose.twin.misfit import misfit
from wearstate.diagnose.twin.unknowns import TwinUnknowns
from wearstate.features.rotation.order import pulse_times
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import Recording
from wearstate.sim.scene.load import load_scene

PER = 2
"""Recordings of a calibration."""
SIZES = ("crank.radius", "rod.length", "rod.centre_of_mass", "piston.diameter")
CONDITIONS = {
    "speed_hz": "drive.speed",
    "discharge_pressure_pa": "pressure.discharge",
    "suction_pressure_pa": "pressure.suction",
}
"""Columns of what differs between recordings, and their paths."""


@dataclass(frozen=True, kw_only=True)
class Pump:
    """A drawn pump to record: scene of its recipe, draws, clearances [m]."""

    base: dict[str, Any]
    draws: list[Sample]
    clearances: list[float]

    def heard(self, **changed: Any) -> list[Recording]:
        """Its recordings, numbers of the scene changed (two underscores for a dot)."""
        values = {name.replace("__", "."): value for name, value in changed.items()}
        return [
            heard_of(self.base, replace(draw, drawn={**draw.drawn, **values}), clearance)
            for draw, clearance in zip(self.draws, self.clearances, strict=True)
        ]

    def scaled(self, by: float, *paths: str) -> list[Recording]:
        """Its recordings, sizes of the scene multiplied."""
        scene = self.draws[0].scene
        return self.heard(**{p.replace(".", "__"): by * value_at(scene, p) for p in paths})


def pumps(count: int, seed: int) -> list[Pump]:
    """Pumps of the standard recipe."""
    return [
        Pump(base=base, draws=draws, clearances=clearances[:PER])
        for base, draws, clearances in drawn_pumps(count, PER, seed)
    ]


def oiled_pumps(count: int, seed: int, lubrication: str) -> list[Pump]:
    """Pumps of the oiled recipe that have a lubrication."""
    drawn = drawn_pumps(8 * count + 8, PER, seed, recipe="bilge-pump-oiled")
    found = (
        Pump(base=base, draws=draws, clearances=clearances[:PER])
        for base, draws, clearances in drawn
        if draws[0].row["choice_lubrication"] == lubrication
    )
    return list(islice(found, count))


def run_as(pump: Pump, other: Pump) -> Pump:
    """A pump at the speeds and pressures of another."""
    draws = [
        replace(
            draw,
            drawn={**draw.drawn, **{path: like.drawn[path] for path in CONDITIONS.values()}},
            row={**draw.row, **{column: like.row[column] for column in CONDITIONS}},
        )
        for draw, like in zip(pump.draws, other.draws, strict=True)
    ]
    return replace(pump, draws=draws)


# --- kinds


def three_throws(pump: Pump) -> list[Recording]:
    phases = [{"phase": np.deg2rad(degrees)} for degrees in (0, 120, 240)]
    return pump.heard(throws=phases)


def triplex(pump: Pump) -> list[Recording]:
    """The triplex pump at its own pressures, two axes of its head under the names of the scene."""
    found = []
    for own, draw in zip(pump.heard(), pump.draws, strict=True):
        speed = draw.drawn["drive.speed"]
        other = simulate(
            load_scene("triplex-pump", {"drive.speed": speed, "duration": own.duration}),
            seed=draw.seed,
        )
        found.append(replace(own, signal=other.signal[rows_of(other, "head_x", "head_y", "tacho")]))
    return found


def rows_of(recording: Recording, *names: str) -> list[int]:
    """Rows of channels."""
    return [[each.name for each in recording.channels].index(name) for name in names]


def swapped(pump: Pump) -> list[Recording]:
    return [replace(each, signal=each.signal[[1, 0, 2]]) for each in pump.heard()]


def turned(scene: str, names: tuple[str, str], pump: Pump) -> list[Recording]:
    """Another machine, stretched to the pump's speed and at the level of the pump."""
    found = []
    for own, draw in zip(pump.heard(), pump.draws, strict=True):
        other = simulate(load_scene(scene), seed=draw.seed)
        pulses = pulse_times(other.tacho_signal, other.sample_rate)
        speed = (len(pulses) - 1) / (pulses[-1] - pulses[0])
        drawn = own.row["speed_hz"]
        waves = other.signal[rows_of(other, *names)].astype(float)
        waves = resampled(waves, own.sample_rate / other.sample_rate * speed / drawn)
        found.append(matched(waves, drawn / own.sample_rate, own))
    return found


def noise(pump: Pump) -> list[Recording]:
    """Pink noise at the level of the pump, with its tacho."""
    found = []
    for own, draw in zip(pump.heard(), pump.draws, strict=True):
        rng = np.random.default_rng(draw.seed)
        length = own.signal.shape[1]
        lines = np.fft.rfft(rng.standard_normal((2, length)))
        waves = np.fft.irfft(lines / np.sqrt(np.maximum(np.arange(lines.shape[1]), 1)), length)
        found.append(matched(waves, own.row["speed_hz"] / own.sample_rate, own))
    return found


def journal(pump: Pump) -> list[Recording]:
    return turned("journal-bearing", ("probe_1", "probe_2"), pump)


def shaft_line(pump: Pump) -> list[Recording]:
    return turned("propulsion-shaft", ("acc_stern_aft", "acc_thrust_block"), pump)


def half_pressure(pump: Pump) -> list[Recording]:
    """Half the pressure that the rows of the recordings tell."""
    return [
        heard
        for draw, clearance in zip(pump.draws, pump.clearances, strict=True)
        for heard in replace(pump, draws=[draw], clearances=[clearance]).heard(
            **{f"pressure__{side}": draw.drawn[f"pressure.{side}"] / 2 for side in SIDES}
        )
    ]


SIDES = ("discharge", "suction")


@dataclass(frozen=True)
class Kind:
    """How a drawn pump is recorded, and the lubrication of its pin where it has any."""

    name: str
    recorded: Callable[[Pump], list[Recording]]
    oil: str = ""


TRUE = "true"
KINDS = (
    Kind(TRUE, Pump.heard),
    Kind("three throws instead of one", three_throws),
    Kind("a triplex pump", triplex),
    Kind("pin flooded with oil", Pump.heard, "flooded"),
    Kind("pin starved of oil", Pump.heard, "starved"),
    Kind("a journal bearing", journal),
    Kind("a shaft line", shaft_line),
    Kind("pink noise", noise),
    Kind("channels swapped", swapped),
    Kind("no pressure", lambda pump: pump.heard(pressure__rung="none")),
    Kind("half the pressure", half_pressure),
    Kind("crank radius +10 %", lambda pump: pump.scaled(1.1, "crank.radius")),
    Kind("bore +10 %", lambda pump: pump.scaled(1.1, "piston.diameter")),
    Kind("rod length +10 %", lambda pump: pump.scaled(1.1, "rod.length", "rod.centre_of_mass")),
    Kind("all sizes +30 %", lambda pump: pump.scaled(1.3, *SIZES)),
)


# --- judgement


class PassedError(Exception):
    """The first ensemble found nothing to refuse."""


class SharedEnsembles:
    """Ensembles of the last conditions, for recordings of nearly the same; none after the first."""

    def __init__(self) -> None:
        self.speeds: list[float] = []
        self.kept: dict[int, Any] = {}
        self.asked: dict[int, tuple[TwinUnknowns, Any]] = {}

    def __call__(self, unknowns: TwinUnknowns, scores: Any, runs: Any, **given: Any) -> Any:
        seed, speeds = given["seed"], [run["drive.speed"] for run in runs]
        if seed > FIRST_ROUND:
            raise PassedError
        if not np.allclose(speeds, self.speeds or 0.0, rtol=SAME_SPEED):
            self.speeds, self.kept = speeds, {}
        if seed not in self.kept:
            self.kept[seed] = simulated(unknowns, scores, runs, **given)
            self.asked[seed] = unknowns, runs
        return self.kept[seed]


SAME_SPEED = 1e-2
FIRST_ROUND = 100_000
"""Seed of the noise of the first ensemble; that of pumps with oil is less."""


def judged(kind: Kind, pump: Pump) -> dict[str, Any]:
    """Whether recordings of a kind are refused, and what is said."""
    try:
        wearstate.calibrate("bilge-pump", kind.recorded(pump))
    except PassedError:
        return {"refused": False, "says": ""}
    except wearstate.MisfitError as error:
        return {"refused": True, "says": str(error)}
    raise AssertionError("a calibration has more than one round")


def further(pump: Pump, count: int, seed: int, shared: SharedEnsembles) -> Iterator[dict[str, Any]]:
    """Whether further machines of the recipe are refused under the conditions of a pump."""
    heard = pump.heard()
    layout = layout_of(heard[0])
    with suppress(PassedError, wearstate.MisfitError):
        wearstate.calibrate("bilge-pump", heard)
    unknowns, runs = shared.asked[FIRST_ROUND]
    rows, wet = shared.kept[FIRST_ROUND][1], regimes.oiled_unknowns(unknowns)
    oiled = regimes.oiled_members(wet, len(shared.kept[0][0]), runs, seed=0)
    scores = inversion.standard(len(unknowns.names)).draw(count, np.random.default_rng(seed))
    for observed in simulated(unknowns, scores, runs, seed=seed)[1]:
        found = regimes.with_regime(misfit(layout, rows, observed), layout, rows, observed, oiled)
        yield {"refused": found.refused, "says": found.regime or found.text}


DRAWN_ALIKE = "further draws of the recipe"


def table(rows: list[dict[str, Any]]) -> Iterator[str]:
    """A line a kind: how many were refused, with an exact interval of 95 %."""
    yield "| recorded | refused | 95 % bounds |"
    yield "|---|---|---|"
    for name in (TRUE, DRAWN_ALIKE, *(kind.name for kind in KINDS[1:])):
        mine = [row["refused"] for row in rows if row["kind"] == name]
        if mine:
            told = binomtest(sum(mine), len(mine)).proportion_ci()
            bounds = f"{told.low:.0%} to {told.high:.0%}"
            yield f"| {name} | {sum(mine)} of {len(mine)} | {bounds} |"


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    """Append rows to the file, and show them."""
    lines = "".join(json.dumps(row) + "\n" for row in rows)
    with path.open("a") as file:
        file.write(lines)
    print(lines, end="", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--each", type=int, default=8, help="pumps of every kind of misfit")
    parser.add_argument("--true", type=int, default=24, help="pumps that are as the scene says")
    parser.add_argument("--further", type=int, default=0, help="draws for each of those pumps")
    parser.add_argument("--seed", type=int, default=7001)
    parser.add_argument("--out", type=Path, default=Path("twin_misfits.jsonl"))
    parser.add_argument("--only", nargs="*", default=[], help="kinds, all where empty")
    given = parser.parse_args()
    lines = given.out.read_text().splitlines() if given.out.exists() else []
    rows = [json.loads(line) for line in lines]
    ready = {(row["kind"], row["seed"], row["pump"]) for row in rows}
    shared = SharedEnsembles()
    inversion.simulated = regimes.simulated = shared
    dry = pumps(max(given.true, given.each), given.seed)
    oiled = {name: oiled_pumps(given.each, given.seed, name) for name in ("flooded", "starved")}
    for number, pump in enumerate(dry):
        place = {"kind": DRAWN_ALIKE, "seed": given.seed, "pump": number}
        if number < given.each and given.further and tuple(place.values()) not in ready:
            seed = FIRST_ROUND * given.seed + 1000 * number
            told = [{**place, **row} for row in further(pump, given.further, seed, shared)]
            write(given.out, told)
            rows += told
        for kind in KINDS:
            place = {"kind": kind.name, "seed": given.seed, "pump": number}
            count = given.true if kind.name == TRUE else given.each
            skipped = given.only and kind.name not in given.only
            if tuple(place.values()) in ready or number >= count or skipped:
                continue
            mine = run_as(oiled[kind.oil][number], pump) if kind.oil else pump
            rows.append({**place, **judged(kind, mine)})
            write(given.out, rows[-1:])
    print(*table([row for row in rows if row["seed"] == given.seed]), sep="\n")


if __name__ == "__main__":
    main()
