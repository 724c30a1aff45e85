"""Are faults of the data named, and nothing else? Every fault planted in every held-out recording.

Train on the data set's training machines, then plant each fault in recordings of the held-out ones
and count how often the model names it, and how often it grades the recording as if nothing were
wrong. The shares go to stdout. Run as
``python tests/benchmarks/quality_faults.py DATA [--model MODEL] [-n 100]``.
A recording that is unfamiliar as it is stays in: the shares are of all recordings.
"""

import argparse
from dataclasses import replace
from fractions import Fraction

import numpy as np
from scipy.signal import resample_poly
from wearstate.datasets.file.record import DataSet
from wearstate.diagnose.wear_model.file import load_model
from wearstate.diagnose.wear_model.train import train_model


def changed(recording, name, change):
    """Recording with one channel changed."""
    signal = recording.signal.copy()
    row = recording.names.index(name)
    signal[row] = change(signal[row])
    return replace(recording, signal=signal)


def clipped(recording, _rng):
    """The converter ends at 60 % of the peak."""

    def clip(x):
        middle, reach = x.mean(), 0.6 * np.abs(x - x.mean()).max()
        return np.clip(x, middle - reach, middle + reach)

    return changed(recording, recording.vibration_names[0], clip)


def dead(recording, rng):
    """A cable came off: a thousandth of the rms, as noise."""
    size = recording.vibration[0].std() / 1000
    name = recording.vibration_names[0]
    return changed(recording, name, lambda x: size * rng.standard_normal(x.size))


def constant(recording, _rng):
    """A sensor at rest."""
    return changed(recording, recording.vibration_names[-1], lambda x: np.full_like(x, x.mean()))


def swapped(recording, _rng):
    """The last two channels have changed places, their names not."""
    names = recording.vibration_names
    a, b = (recording.names.index(name) for name in names[-2:])
    signal = recording.signal.copy()
    signal[[a, b]] = signal[[b, a]]
    return replace(recording, signal=signal)


def scaled(factor, every=True):
    """All channels, or the first, in a unit that is not the stated one."""

    def plant(recording, _rng):
        names = recording.vibration_names if every else recording.vibration_names[:1]
        for name in names:
            recording = changed(recording, name, lambda x: factor * x)
        return recording

    return plant


def misstated(ratio):
    """Sampled at `ratio` times the stated rate."""

    def plant(recording, _rng):
        part = Fraction(ratio).limit_denominator(100)
        signal = resample_poly(
            recording.signal, part.numerator, part.denominator, axis=1, padtype="line"
        )
        if recording.tacho is not None:
            row = recording.names.index(recording.tacho)
            old = np.arange(recording.signal.shape[1])
            signal[row] = np.interp(np.arange(signal.shape[1]) / ratio, old, recording.signal[row])
        return replace(recording, signal=signal)

    return plant


def without_tacho(recording, _rng):
    """The tacho channel is missing."""
    keep = [i for i, name in enumerate(recording.names) if name != recording.tacho]
    channels = tuple(recording.channels[i] for i in keep)
    return replace(recording, signal=recording.signal[keep], channels=channels, tacho=None)


def silent_tacho(recording, rng):
    """The tacho channel is there, without pulses."""
    return changed(recording, recording.tacho, lambda x: 0.01 * rng.standard_normal(x.size))


def lossy_tacho(recording, _rng):
    """Every third pulse is missing."""
    from wearstate.features.rotation.order import pulse_times

    row = recording.tacho_signal.copy()
    pulses = (pulse_times(row, recording.sample_rate) * recording.sample_rate).astype(int)
    for first, last in zip(pulses[1::3], pulses[2::3], strict=False):
        row[first - 5 : (first + last) // 2] = row.min()
    return changed(recording, recording.tacho, lambda _: row)


PLANTED = {
    "saturated": ("saturated", clipped),
    "dead, noise": ("dead", dead),
    "dead, constant": ("dead", constant),
    "swapped": ("swapped", swapped),
    "unit, all x 9.81": ("unit", scaled(9.80665)),
    "unit, all / 9.81": ("unit", scaled(1 / 9.80665)),
    "unit, one x 9.81": ("unit", scaled(9.80665, every=False)),
    "unit, all x 1000": ("unit", scaled(1000.0)),
    "unit, all / 1000": ("unit", scaled(1e-3)),
    "rate, half stated": ("rate", misstated(2.0)),
    "rate, 2.56 x stated": ("rate", misstated(1 / 2.56)),
    "rate, twice stated": ("rate", misstated(0.5)),
    "tacho missing": ("tacho", without_tacho),
    "tacho silent": ("tacho", silent_tacho),
    "tacho lossy": ("tacho", lossy_tacho),
}
"""Name -> kind of fault to be named, and how it is planted."""


def campaign(model, recordings, planted=PLANTED):
    """Share of recordings in which each fault, and no other, is named; and of plain grades.

    Returns
    -------
    dict
        Name of the planted fault -> (share named, share graded without a word); ``"nothing"`` ->
        share in which a fault was named, and the same.
    """
    told = {name: [] for name in ("nothing", *planted)}
    for i, recording in enumerate(recordings):
        rng = np.random.default_rng(i)
        found = model.estimate(recording)
        told["nothing"].append((bool(found.faults), found.verdict == "graded"))
        for name, (kind, plant) in planted.items():
            found = model.estimate(plant(recording, rng))
            kinds = {fault.kind for fault in found.faults}
            told[name].append((kinds == {kind}, found.verdict == "graded"))
    return {name: tuple(np.mean(found, axis=0).tolist()) for name, found in told.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data")
    parser.add_argument("--model")
    parser.add_argument("-n", type=int, default=100)
    given = parser.parse_args()
    if given.model:
        model = load_model(given.model)
    else:
        model, _, _ = train_model(given.data)
    with DataSet(given.data) as data:
        seen = data.manifest["group"].isin(model.card.trained_on.training_groups)
        rows = np.flatnonzero(~seen.to_numpy())[: given.n]
        shares = campaign(model, (data[int(row)] for row in rows))
    for name, (told, plain) in shares.items():
        print(f"{name:22} named {told:.3f}, plainly graded {plain:.3f} of {len(rows)}")


if __name__ == "__main__":
    main()
