"""Effects of sensor, cable and converter on a recording, as rows of the blind spots."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...datasets.measured.plan import EachChannel
from ...datasets.measured.recording import read_recording
from ...datasets.source.part import SourceOptions
from ...sim.output.recording import DataError, Recording
from ...sim.output.sensor import (
    anti_alias_poles,
    coloured_noise,
    low_pass,
    mains_hum,
    mounting_poles,
)

Float = NDArray[np.float64]

NOISE_DB = (-30, -20, -10)
"""Levels of added noise over the rms of each channel about its mean [dB]."""

GAIN = 1.26
"""Gain error of a sensor 2 dB off its sensitivity."""

MOUNT_HZ, MOUNT_DAMPING = 7e3, 0.05
"""Mounted resonance [Hz] and damping of an accelerometer on a magnet (usual data-sheet values)."""

ALIAS_SHARE, ALIAS_ORDER = 0.39, 6
"""Cut-off over the sample rate of the low-pass before a converter, and its order."""

BITS, HEADROOM = 12, 2.0
"""Word length of an old converter; its full scale over the largest value."""

LATE_DEG = (1.0, 2.0, 5.0)
"""Possible delays of a tacho's mark [deg]."""

MAINS_HZ = 50.0


@dataclass(frozen=True, kw_only=True)
class SignalRow:
    """One change of the recorded signal.

    Attributes
    ----------
    name, shift, why : str
        What is changed, by how much, and the cause in practice.
    apply : callable
        Recording, shaft speed [Hz] and random stream -> recording.
    """

    name: str
    shift: str
    why: str
    apply: Callable[[Recording, float, np.random.Generator], Recording]


def signal_rows(background: Path | None = None) -> list[SignalRow]:
    """All rows of the signal.

    Parameters
    ----------
    background : Path, optional
        A recording of the surroundings, in any readable format and unit.

    Returns
    -------
    list of SignalRow

    Raises
    ------
    DataError
        The background cannot be read, or is silent.

    Examples
    --------
    >>> sorted({row.name for row in signal_rows()})[:3]
    ['anti-alias filter', 'conditions', 'converter']
    """
    rows = [
        SignalRow(name=f"{name} noise", shift=f"{db} dB", why=why, apply=_noisy(make, db))
        for name, why, make in (
            ("white", "a sensor of less sensitivity", _white),
            ("pink", "flicker noise of an amplifier", _pink),
            ("mains", "a ground loop", _mains),
        )
        for db in NOISE_DB
    ]
    rows += [
        _plain("gain", f"x {GAIN:g}", "another sensitivity than declared", _gained),
        _plain("mounting", f"resonance at {MOUNT_HZ / 1e3:g} kHz", "a magnet", _mounted),
        _plain(
            "anti-alias filter",
            f"order {ALIAS_ORDER}, {ALIAS_SHARE:g} of the sample rate",
            "another analyser",
            _filtered,
        ),
        _plain("converter", f"{BITS} bits", "an old logger", _coarse),
    ]
    rows += [
        SignalRow(name="tacho", shift=f"{late:g} deg late", why="its mark", apply=_late(late))
        for late in LATE_DEG
    ]
    rows.append(
        SignalRow(
            name="start", shift="first revolution missing", why="cut by hand", apply=_without_first
        )
    )
    rows.append(_plain("conditions", "not noted", "nobody wrote them down", _unnoted))
    if background is not None:
        sound = _sound(background)
        rows += [
            SignalRow(
                name=f"background {background.name}",
                shift=f"{db} dB",
                why="machinery near by",
                apply=_noisy(_repeated(*sound), db),
            )
            for db in NOISE_DB
        ]
    return rows


_Noise = Callable[[int, float, float, np.random.Generator], Float]
"""Samples, sample rate [Hz], rms and random stream -> noise."""


def _white(n: int, fs: float, rms: float, rng: np.random.Generator) -> Float:
    return coloured_noise(n, fs, rms=rms, slope=0.0, rng=rng)


def _pink(n: int, fs: float, rms: float, rng: np.random.Generator) -> Float:
    return coloured_noise(n, fs, rms=rms, slope=1.0, rng=rng)


def _mains(n: int, fs: float, rms: float, rng: np.random.Generator) -> Float:
    return mains_hum(n, fs, rms=rms, frequency=MAINS_HZ, rng=rng)


def _each(recording: Recording, change: Callable[[Float], Float]) -> Recording:
    """Change every channel except the tacho."""
    signal = recording.signal.astype(float)
    for i, name in enumerate(recording.names):
        if name != recording.tacho:
            signal[i] = change(signal[i])
    return replace(recording, signal=signal)


def _noisy(make: _Noise, db: float) -> Callable[[Recording, float, np.random.Generator], Recording]:
    def apply(recording: Recording, _speed: float, rng: np.random.Generator) -> Recording:
        def add(x: Float) -> Float:
            return x + make(x.size, recording.sample_rate, 10 ** (db / 20) * float(x.std()), rng)

        return _each(recording, add)

    return apply


def _plain(name: str, shift: str, why: str, change: Callable[[Recording], Recording]) -> SignalRow:
    def apply(recording: Recording, _speed: float, _rng: np.random.Generator) -> Recording:
        return change(recording)

    return SignalRow(name=name, shift=shift, why=why, apply=apply)


def _gained(recording: Recording) -> Recording:
    return _each(recording, lambda x: GAIN * x)


def _mounted(recording: Recording) -> Recording:
    """Apply a mounted resonance to accelerometers; proximity probes have none."""
    if not any(channel.quantity == "acceleration" for channel in recording.channels):
        raise DataError("no channel is an acceleration; there is no mounted resonance")
    poles = mounting_poles(MOUNT_HZ, MOUNT_DAMPING)
    signal = recording.signal.astype(float)
    for i, channel in enumerate(recording.channels):
        if channel.quantity == "acceleration":
            signal[i] = low_pass(signal[i], recording.sample_rate, poles)
    return replace(recording, signal=signal)


def _filtered(recording: Recording) -> Recording:
    fs = recording.sample_rate
    poles = anti_alias_poles("butterworth", ALIAS_SHARE * fs, ALIAS_ORDER)
    return _each(recording, lambda x: low_pass(x, fs, poles))


def _coarse(recording: Recording) -> Recording:
    def rounded(x: Float) -> Float:
        step = 2 * HEADROOM * float(np.abs(x).max()) / 2**BITS
        return np.round(x / step) * step if step > 0 else x

    return _each(recording, rounded)


def _late(degrees: float) -> Callable[[Recording, float, np.random.Generator], Recording]:
    def apply(recording: Recording, speed: float, _rng: np.random.Generator) -> Recording:
        if recording.tacho is None or speed <= 0:
            raise DataError("the recording has no tacho of a rotating shaft that could be late")
        samples = degrees / 360 / speed * recording.sample_rate
        place = np.arange(recording.signal.shape[1], dtype=float)
        signal = recording.signal.astype(float)
        row = recording.names.index(recording.tacho)
        signal[row] = np.interp(place - samples, place, signal[row])
        return replace(recording, signal=signal)

    return apply


def _unnoted(recording: Recording) -> Recording:
    speed = recording.row.get("speed_hz")
    return replace(recording, row={} if speed is None else {"speed_hz": speed})


def _without_first(recording: Recording, speed: float, _rng: np.random.Generator) -> Recording:
    first = math.ceil(recording.sample_rate / speed) if speed > 0 else 0
    if not 0 < first < recording.signal.shape[1]:
        raise DataError("the recording contains no whole revolution that could be missing")
    return replace(recording, signal=recording.signal[:, first:])


def _sound(path: Path) -> tuple[Float, float]:
    """First vibration channel of a file, scaled to rms 1, and its sample rate [Hz]."""
    try:
        recording = read_recording(path)
    except DataError:  # perhaps only the unit is missing, which does not matter here
        recording = read_recording(path, SourceOptions(unit=EachChannel({}, others="m/s^2")))
    sound = recording.vibration[0].astype(float)
    sound -= sound.mean()
    if not sound.any():
        raise DataError(f"{path}: channel 0 is silent, must have a signal; give another background")
    return sound / sound.std(), recording.sample_rate


def _repeated(sound: Float, rate: float) -> _Noise:
    """Noise source that repeats the sound from a random start, at the recording's rate."""

    def make(n: int, fs: float, rms: float, rng: np.random.Generator) -> Float:
        from scipy.signal import resample_poly

        ratio = _ratio(fs / rate)
        heard = resample_poly(sound, *ratio)
        heard = heard / (heard.std() or 1.0)
        start = int(rng.integers(heard.size))
        return np.asarray(rms * np.take(heard, np.arange(start, start + n), mode="wrap"))

    return make


def _ratio(value: float) -> tuple[int, int]:
    from fractions import Fraction

    found = Fraction(value).limit_denominator(1000)
    return max(found.numerator, 1), found.denominator
