"""Faults visible in the samples alone: saturation, gaps, dead or equal channels, missing pulses."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.order import check_pulses, pulse_times
from ...sim.output.lost import LostSamples, lost_samples
from ...sim.output.recording import Recording
from ...sim.output.sensor import Channel
from .fault import QualityFault

Float = NDArray[np.float64]

_FEWEST_AT_END = 4  # samples equal to the extreme; one or two occur by chance
_END_SHARE = 0.02  # of the swing, next to the extreme
_PILE = 4  # a tone has at most 1 / (sqrt(2) - 1) = 2.4 times as many at its last code as before it

_MOST_CLIPPED = 0.1
"""Share of saturated samples beyond which no verdict is given. They moved estimates of journals by
0.9 % of the limit (4 % at most) at this share, by 3 % (21 %) at 0.15, by 15 % (91 %) at 0.3."""

_MOST_LOST = 0.2
"""Share of lost samples beyond which no verdict is given. They moved the mean error of pumps from
4.1 % of the limit to 4.3 at a tenth, 4.6 at this share and 5.5 at 0.3 (48 recordings, filled up
with zeros or the last value), that of journals by 0.1."""

_NEVER_STILL = ("acceleration", "velocity", "displacement")
"""Quantities that vary as long as the machine runs; forces and pressures may be constant."""


def sample_faults(recording: Recording) -> tuple[QualityFault, ...]:
    """Find flat tops, gaps, dead channels, equal ones, and a tacho that gives no pulses.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of QualityFault
        All faults found. No verdict is given if a tenth of a channel's samples are saturated or a
        fifth are lost; the other faults always bar it.

    Notes
    -----
    A channel counts as saturated if at least four samples equal its extreme, and more than four
    times as many as equal any other value within two per cent of the swing from it: a fine
    converter hardly ever repeats a value, a coarse one repeats all of them. A square wave, or a
    tone at five bits without another code that near, cannot be distinguished from saturation.

    Examples
    --------
    >>> from dataclasses import replace
    >>> wave = np.sin(np.arange(1000.0))
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> recording = Recording(signal=wave[np.newaxis], sample_rate=10.0, channels=(channel,))
    >>> sample_faults(recording)
    ()
    >>> sample_faults(replace(recording, signal=recording.signal.clip(-0.8, 0.8)))[0].kind
    'saturated'
    """
    faults: list[QualityFault] = []
    for channel, row in zip(recording.vibration_channels, recording.vibration, strict=True):
        faults += _channel_sample_faults(channel, row, recording.sample_rate)
    return (*faults, *_twin_faults(recording), *_tacho_faults(recording))


def _twin_faults(recording: Recording) -> list[QualityFault]:
    """Channels of one quantity that hold the same samples: one cable, or one column read twice."""
    both = combinations(zip(recording.vibration_channels, recording.vibration, strict=True), 2)
    return [
        QualityFault(
            kind="layout",
            channel=f"{a.name}, {b.name}",
            text=f"channels {a.name} and {b.name} hold the same samples, must be of two sensors; "
            "check cables and channels",
        )
        for (a, one), (b, other) in both
        if a.quantity == b.quantity and np.ptp(one) > 0 and np.array_equal(one, other)
    ]


def _channel_sample_faults(
    channel: Channel, row: NDArray[np.float32], sample_rate: float
) -> list[QualityFault]:
    low, high, name, unit = float(row.min()), float(row.max()), channel.name, channel.unit
    if low == high:
        text = f"channel {name} is {low:g} {unit} throughout: it is dead; check sensor and cable"
        return [QualityFault(kind="dead", channel=name, text=text)]
    lost = lost_samples(row) if channel.quantity in _NEVER_STILL else None
    faults = [] if lost is None else [_gap_fault(channel, lost, row.size, sample_rate)]
    rails = [end for end in (low, high) if lost is None or end != lost.value]
    ends = {end: count for end in rails if (count := _piled(row, end, high - low))}
    if ends:
        text = (
            f"channel {name} is at exactly {' and '.join(f'{end:g}' for end in ends)} {unit} "
            f"{' and '.join(str(n) for n in ends.values())} times, more often than just beside it: "
            "it is saturated; raise the range"
        )
        bars = sum(ends.values()) > _MOST_CLIPPED * row.size
        faults.append(QualityFault(kind="saturated", channel=name, text=text, bars=bars))
    return faults


def _gap_fault(channel: Channel, lost: LostSamples, size: int, sample_rate: float) -> QualityFault:
    share = lost.count / size
    text = (
        f"channel {channel.name} stands still for {lost.count / sample_rate:.3g} s, {share:.2g} of "
        f"the recording, at {lost.value:g} {channel.unit} from {lost.start / sample_rate:.4g} s "
        f"on{f' and {lost.stretches - 1} times more' if lost.stretches > 1 else ''}: samples were "
        "lost; record without gaps"
    )
    return QualityFault(kind="gap", channel=channel.name, text=text, bars=share > _MOST_LOST)


def _piled(row: NDArray[np.float32], end: float, swing: float) -> int:
    """Number of samples at an extreme if the signal was cut off there, else 0."""
    distance = np.abs(row - end)
    at = int(np.count_nonzero(distance == 0))
    near = row[(distance > 0) & (distance <= _END_SHARE * swing)]
    alike = int(np.unique(near, return_counts=True)[1].max(initial=0))
    return at if at >= _FEWEST_AT_END and at > _PILE * alike else 0


def _tacho_faults(recording: Recording) -> list[QualityFault]:
    tacho = recording.tacho_signal
    if tacho is None:
        return []
    try:
        pulses = pulse_times(tacho, recording.sample_rate)
        check_pulses(pulses, tacho.size, recording.sample_rate, recording.pulses_per_revolution)
    except ValueError as error:
        text = f"tacho {recording.tacho}: {error}"
        return [QualityFault(kind="tacho", channel=str(recording.tacho), text=text)]
    turns = (len(pulses) - 1) / recording.pulses_per_revolution
    if turns >= 1:
        return []
    text = f"tacho {recording.tacho} gives {turns:.2g} revolutions, must be >= 1; record longer"
    return [QualityFault(kind="tacho", channel=str(recording.tacho), text=text)]
