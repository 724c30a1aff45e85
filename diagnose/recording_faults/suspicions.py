"""Wrong units, swapped channels, wrong sample rates and tacho pulses, each tried on the recording.

The recording is corrected as suspected, and must then look familiar to the model.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.views import MARK
from ...features.rotation.order import pulse_times
from ...sim.output.recording import Recording
from ..feature_rows.resampling import resampled
from .fault import QualityFault

Float = NDArray[np.float64]

FACTORS = (9.80665, 1000.0)
"""Ratios of units that are often confused: g and m/s^2, and powers of a thousand."""

RATES = (2.0, 2.56, 4.0, 5.12, 10.0)
"""Ratios of sample rates that are often confused: by decimation, or bandwidth given as rate."""

_TRIED = 2  # factors of units
_NEARER = (
    0.5  # of the excess: one of 11 dB is no factor of 20 dB, though 9 dB the other way is less
)

_DOUBTFUL = 0.75
"""Share of the limit of familiarity from which swapped channels are tried, and up to which pulses
explain a speed: of 20 pumps as they are none was beyond 0.73; swapped all were, and with a wrong
rate and half of the pulses those of a small model were beyond 1.05."""

_SWAPPED_NEARER = 0.8  # of the distance: swapped back, those pumps were at 0.4 to 0.75 of it

PULSES = (2, 3, 4, 6, 8)  # per revolution, where one is stated
_FEWEST_KEPT = 3
_PULSE_WIDTH = 0.1  # of a revolution

_FREE = 0.75  # of the limit: features independent of the rate stay within half of it
_OFF_DB = 10.0  # half-way to a factor of 9.81 [dB]
_SPEED_MARGIN = 0.05  # of the trained speeds


@dataclass(frozen=True, kw_only=True)
class Observation:
    """Distance and levels of a recording as a model sees them.

    Attributes
    ----------
    distance, limit : float
        Novelty distance, and the limit from which a recording is unfamiliar.
    free_distance : float
        Distance by features that do not depend on the sample rate; NaN without such features.
    excess_db : mapping
        Level of each channel above the expected one [dB].
    speed_hz : float or None
        Shaft speed from the tacho.
    """

    distance: float
    limit: float
    free_distance: float
    excess_db: Mapping[str, float]
    speed_hz: float | None

    @property
    def familiar(self) -> bool:
        """Whether the distance is below the limit and all levels are as expected."""
        return self.distance < self.limit and self.level

    @property
    def level(self) -> bool:
        """Whether every channel has about the expected level."""
        return all(abs(excess) < _OFF_DB for excess in self.excess_db.values())


Observe = Callable[[Recording], Observation]


def suspicions(
    recording: Recording,
    look: Observation,
    see: Observe,
    speeds: tuple[float, float] | None,
    stated: float | None = None,
) -> tuple[QualityFault, ...]:
    """Find a fault that explains why a recording is unfamiliar, by correcting it on trial.

    Parameters
    ----------
    recording : Recording
        Recording with the model's inputs.
    look : Observation
        The recording as the model sees it.
    see : callable
        Gives the observation of a corrected recording.
    speeds : tuple of float, optional
        Trained range of shaft speeds [Hz].
    stated : float, optional
        Sample rate stated in the source [Hz]; that of the recording by default.

    Returns
    -------
    tuple of QualityFault
        The first explanation that makes the recording familiar, in the order unit (if a level is
        off), channels (if the shape is hardly familiar), pulses of the tacho (if the speed is
        strange), rate (if shape or speed is); empty if none does, or if the recording is familiar
        as it is.
    """
    paced = speeds is None or look.speed_hz is None or _within(look.speed_hz, speeds)
    near = look.distance < look.limit
    found: tuple[QualityFault, ...] = ()
    if not look.level:
        found = _wrong_unit(recording, look, see)
    doubtful = look.distance >= _DOUBTFUL * look.limit
    if not found and doubtful and paced:  # swapped cables do not change the speed
        found = _swapped(recording, look, see)
    if not found and not paced and speeds is not None:
        found = _wrong_pulses(recording, look, see, speeds)
    if not found and not (near and paced) and speeds is not None:
        rate = recording.sample_rate if stated is None else stated
        found = _wrong_rate(recording, look, see, speeds, rate)
    return found


def _within(speed: float, speeds: tuple[float, float]) -> bool:
    low, high = speeds
    return low * (1 - _SPEED_MARGIN) <= speed <= high * (1 + _SPEED_MARGIN)


def _wrong_unit(recording: Recording, look: Observation, see: Observe) -> tuple[QualityFault, ...]:
    off = {name: db for name, db in look.excess_db.items() if abs(db) >= _OFF_DB}
    for rank in range(_TRIED):
        factors = {name: _near_factors(excess)[rank] for name, excess in off.items()}
        mended = see(_amplified(recording, factors))
        nearer = all(abs(mended.excess_db[n]) < _NEARER * abs(db) for n, db in off.items())
        if mended.familiar and nearer:
            return tuple(
                QualityFault(
                    kind="unit",
                    channel=name,
                    text=f"channel {name} is {off[name]:+.0f} dB off what its shape lets expect; "
                    f"{_times(factor)} it is familiar: its unit is wrong, check it",
                    factor=factor,
                )
                for name, factor in factors.items()
            )
    return ()


def _amplified(recording: Recording, factors: Mapping[str, float], view: str = "") -> Recording:
    """Multiply channels of a recording and of its views, which are named ``view:channel``."""
    names = [f"{view}{MARK}{name}" if view else name for name in recording.names]
    gain = np.array([factors.get(name, 1.0) for name in names], dtype=np.float32)
    joined = {name: _amplified(each, factors, name) for name, each in recording.joined.items()}
    return replace(recording, signal=recording.signal * gain[:, None], joined=joined)


def _near_factors(excess_db: float) -> list[float]:
    """Factors of units, sorted by how near they bring a level to the expected one.

    The nearest is not always right: the features of a very quiet signal have another shape, so
    each factor is tried.
    """
    known = [value for factor in FACTORS for value in (factor, 1 / factor)]
    return sorted(known, key=lambda factor: abs(excess_db + 20 * math.log10(factor)))


def _times(factor: float) -> str:
    return f"multiplied by {factor:.4g}" if factor > 1 else f"divided by {1 / factor:.4g}"


def _swapped(recording: Recording, look: Observation, see: Observe) -> tuple[QualityFault, ...]:
    channels = [c for c in recording.channels if c.name != recording.tacho]
    for a, b in combinations(channels, 2):
        if a.quantity != b.quantity or a.unit != b.unit:
            continue
        first, second = recording.names.index(a.name), recording.names.index(b.name)
        order = np.arange(len(recording.names))
        order[[first, second]] = second, first
        mended = see(replace(recording, signal=recording.signal[order]))
        if mended.familiar and mended.distance < _SWAPPED_NEARER * look.distance:
            text = f"channels {a.name} and {b.name} look swapped; swap their cables or names"
            return (QualityFault(kind="swapped", channel=f"{a.name}, {b.name}", text=text),)
    return ()


def _wrong_rate(
    recording: Recording,
    look: Observation,
    see: Observe,
    speeds: tuple[float, float],
    stated: float,
) -> tuple[QualityFault, ...]:
    if look.speed_hz is None:
        return ()
    for ratio in (*RATES, *(1 / rate for rate in RATES)):
        if not _within(look.speed_hz * ratio, speeds):
            continue
        mended = see(resampled(recording, ratio))
        # a true rate below the stated one leaves no high bands to compare
        lacking = ratio < 1 and mended.free_distance < _FREE * mended.limit and mended.level
        if mended.familiar or lacking:
            text = (
                f"speed and spectrum fit a sample rate of {stated * ratio:g} Hz, {ratio:.3g} times "
                f"the stated {stated:g} Hz; correct the rate, or, if it is right, run the machine "
                f"within {speeds[0]:.4g} to {speeds[1]:.4g} Hz"
            )
            return (QualityFault(kind="rate", channel="", text=text, factor=ratio),)
    return ()


def _wrong_pulses(
    recording: Recording, look: Observation, see: Observe, speeds: tuple[float, float]
) -> tuple[QualityFault, ...]:
    """More pulses per revolution than stated: keep every second, third, … one on trial."""
    if look.speed_hz is None or recording.tacho is None or recording.pulses_per_revolution != 1:
        return ()
    tacho = recording.signal[recording.names.index(recording.tacho)]
    pulses = pulse_times(tacho, recording.sample_rate)
    for count in PULSES:
        if not _within(look.speed_hz / count, speeds) or len(pulses) < _FEWEST_KEPT * count:
            continue
        looks = [see(_thinned(recording, pulses[first::count])) for first in range(count)]
        if any(each.level and each.distance < _DOUBTFUL * each.limit for each in looks):
            text = (
                f"tacho {recording.tacho} shows {look.speed_hz:.4g} Hz, {count} times the speed at "
                f"which the recording is familiar: it gives {count} pulses per revolution, the "
                "model needs 1; keep the pulse at the top dead centre"
            )
            return (QualityFault(kind="tacho", channel=recording.tacho, text=text),)
    return ()


def _thinned(recording: Recording, pulses: Float) -> Recording:
    """The recording with these pulses of its tacho alone, at times [s]."""
    place = recording.names.index(str(recording.tacho))
    tacho = recording.signal[place]
    clean = np.full(tacho.size, tacho.min())
    width = max(1, round(_PULSE_WIDTH * float(np.diff(pulses).min()) * recording.sample_rate))
    for start in np.ceil(pulses * recording.sample_rate).astype(int).tolist():
        clean[start : start + width] = tacho.max()
    signal = recording.signal.copy()
    signal[place] = clean
    return replace(recording, signal=signal)
