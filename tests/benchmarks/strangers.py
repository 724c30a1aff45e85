"""Is what a model was not trained on refused? Recordings of other machines, made to match.

Every strange recording gets the rate, the channels, the units, the length and a tacho of the
model's own: its samples are resampled, its channels dealt out in turn (where there are too few,
later and weaker echoes of them), each at the level of a recording of the model's own machine. The
tacho turns once at the strange machine's own speed, once at one drawn from the model's; recordings
of other machines are also stretched so that their revolutions last as long as the model's do.
Prints how many of each kind are unfamiliar, unusable and graded. Run as
``python tests/benchmarks/strangers.py MODEL OWN.h5 [OTHER.h5 …] [--measured FOLDER] [-n 100]``,
OWN being of the model's machine, FOLDER one of recordings at a shaft speed of 25 Hz.
"""

import argparse
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import islice
from pathlib import Path

import numpy as np
from scipy.signal import resample_poly
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured.recording import read_recording
from wearstate.diagnose.wear_model.file import load_model
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import tacho_pulses

MEASURED_SPEED_HZ = 25.0  # of every MFPT recording
PULSE_WIDTH = 1 / 36  # of a revolution
MOST_PIECES = 5  # of one long recording


def resampled(waves, ratio):
    """Waves at `ratio` times their rate."""
    part = Fraction(ratio).limit_denominator(2000)
    return resample_poly(waves, part.numerator, part.denominator, axis=1, padtype="line")


def matched(waves, turns_per_sample, own):
    """Waves [shape=(n_waves, n)], at the rate of `own`, in the shape and at the levels of `own`."""
    length = own.signal.shape[1]
    waves = np.tile(waves, -(-length // waves.shape[1]))[:, :length]
    rows, dealt = [], 0
    for channel, row in zip(own.channels, own.signal, strict=True):
        if channel.name == own.tacho:
            turns = np.arange(length) * turns_per_sample
            rows.append(tacho_pulses(turns, pulse_width=PULSE_WIDTH, level=float(row.max())))
            continue
        lap, place = divmod(dealt, len(waves))
        echo = 0.8**lap * np.roll(waves[place], 7 * lap)
        rows.append(echo * row.std() / max(float(waves[place].std()), 1e-30))
        dealt += 1
    return replace(own, signal=np.array(rows, dtype=np.float32), source="made to match")


def of_measured(folder, own, speeds):
    """(kind, recording) of every measured file, in pieces."""
    for path in sorted(folder.glob("*.mat")):
        read = read_recording(path)
        rate, length = own.sample_rate, own.signal.shape[1]
        waves = resampled(read.vibration.astype(float), rate / read.sample_rate)
        last = max(waves.shape[1] - length, 0)
        for start in islice(range(0, last + 1, length), MOST_PIECES):
            piece = waves[:, start : start + length]
            for speed in (MEASURED_SPEED_HZ, speeds[0] / 2, float(np.median(speeds))):
                yield "measured", matched(piece, speed / rate, own)


def of_machine(path, n, own, speeds, rng):
    """(kind, recording) of n recordings of another machine, in its own time and stretched."""
    with DataSet(path) as data:
        for i in range(min(n, len(data))):
            waves, rate = data[i].vibration.astype(float), data[i].sample_rate
            speed = float(data.manifest["speed_hz"][i])
            yield (
                f"{path.stem}, own time",
                matched(resampled(waves, own.sample_rate / rate), speed / own.sample_rate, own),
            )
            drawn = float(rng.choice(speeds))
            stretched = resampled(waves, own.sample_rate / rate * speed / drawn)
            yield f"{path.stem}, stretched", matched(stretched, drawn / own.sample_rate, own)


def campaign(model, recordings):
    """Kind -> how often each verdict was given.

    Returns
    -------
    dict of Counter
    """
    told = {}
    for kind, recording in recordings:
        try:
            verdict = model.estimate(recording).verdict
        except DataError:
            verdict = "no features"
        told.setdefault(kind, Counter())[verdict] += 1
    return told


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model")
    parser.add_argument("own", type=Path)
    parser.add_argument("others", type=Path, nargs="*")
    parser.add_argument("--measured", type=Path)
    parser.add_argument("-n", type=int, default=100)
    given = parser.parse_args()
    model = load_model(given.model)
    with DataSet(given.own) as data:
        own, speeds = data[0], np.sort(data.manifest["speed_hz"].to_numpy())
        seen = data.manifest["group"].isin(model.card.trained_on.training_groups)
        fresh = np.flatnonzero(~seen.to_numpy())[: given.n]
        familiar = campaign(model, (("its own, held out", data[int(row)]) for row in fresh))
    rng = np.random.default_rng(0)
    told = dict(familiar)
    if given.measured:
        told |= campaign(model, of_measured(given.measured, own, speeds))
    for path in given.others:
        told |= campaign(model, of_machine(path, given.n, own, speeds, rng))
    for kind, verdicts in told.items():
        total = sum(verdicts.values())
        refused = 1 - (verdicts["graded"] + verdicts["caution"]) / total
        print(f"{kind:32} refused {refused:.3f} of {total}: {dict(verdicts)}")


if __name__ == "__main__":
    main()
