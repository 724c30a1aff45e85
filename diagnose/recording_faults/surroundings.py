"""What else is in a recording, and a model takes for wear: hum, a steady tone, another's knocks."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.order import pulse_times
from ...features.rotation.other_rate import other_rate
from ...features.signal.hum import hum_power
from ...features.signal.steady_tone import steady_tone
from ...sim.output.recording import Recording
from .fault import QualityFault

MOST_HUM = 0.05
"""Share of a channel's mean square beyond which hum is a caution: -13 dB. At -20 dB estimates of
simulated pumps err as without any hum, at -10 dB nearly twice as much; of 200 simulated pumps, 200
journals and 200 shafts as trained none has as much at these lines."""


def hum_faults(recording: Recording, speed_hz: float | None = None) -> tuple[QualityFault, ...]:
    """Channels whose hum is loud beside the machine; none where no tacho tells its own lines.

    Parameters
    ----------
    recording : Recording
        Of a tacho whose pulses are sound.
    speed_hz : float, optional
        Mean shaft speed [Hz]; from the pulses unless given.

    Returns
    -------
    tuple of QualityFault
        None of them bars a verdict.
    """
    tacho = recording.tacho_signal
    if tacho is None:
        return ()
    if speed_hz is None:
        pulses = pulse_times(tacho, recording.sample_rate)
        turns = (len(pulses) - 1) / recording.pulses_per_revolution
        speed_hz = turns / float(pulses[-1] - pulses[0])
    found = []
    for channel, row in zip(recording.vibration_channels, recording.vibration, strict=True):
        power = float(np.var(row, dtype=np.float64))
        found_at = hum_power(row, recording.sample_rate, speed_hz=speed_hz)
        mains, hum = max(found_at.items(), key=lambda each: each[1])
        if hum > MOST_HUM * power:
            text = (
                f"{hum / power:.0%} of the mean square of channel {channel.name} is at multiples "
                f"of {mains:g} Hz, must be at most {MOST_HUM:.0%}: hum of the mains hides what the "
                "machine shows; check grounding and cable"
            )
            found.append(QualityFault(kind="hum", channel=channel.name, text=text, bars=False))
    return tuple(found)


LEAST_SCATTER = 0.7
"""Scatter of a tone below which it is a caution: 8 of 2,000 simulated pumps ring so steadily."""

LEAST_TONE = 5e-4
"""Share of a channel's mean square from which on a tone counts: -33 dB. Of simulated pumps with a
softer one estimates err as without."""

LOWEST_TONE_HZ = 170.0
"""Where tones are looked for: a casing's lowest mode rings on from one knock to the next."""

MOST_EVIDENCE = 3.5
"""Evidence of another rate above which it is a caution: 4 of 2,000 simulated pumps have more."""

_LONGEST_S = 30.0  # that is looked at: speeds drift, and lines with them


def company_faults(recording: Recording) -> tuple[QualityFault, ...]:
    """Other machines that are heard in the recording of one that knocks.

    Parameters
    ----------
    recording : Recording
        Of a tacho whose pulses are sound, of a machine that knocks in every turn: one that runs
        evenly is full of steady tones.

    Returns
    -------
    tuple of QualityFault
        At most one of a tone and one of knocks, none of which bars a verdict. Another machine at
        the own speed, or at a simple ratio of it, cannot be told.
    """
    tacho = recording.tacho_signal
    if tacho is None:
        return ()
    rate, longest = recording.sample_rate, int(_LONGEST_S * recording.sample_rate)
    marks = pulse_times(tacho, rate)[:: recording.pulses_per_revolution]
    marks = marks[marks < _LONGEST_S]
    if len(marks) < _FEWEST_MARKS:
        return ()
    channels = [channel.name for channel in recording.vibration_channels]
    signal = [recording.signal[recording.names.index(name), :longest] for name in channels]
    speed = (len(marks) - 1) / float(marks[-1] - marks[0])
    return (*_tone_faults(recording, signal, speed), *_knock_faults(signal, rate, marks, speed))


_FEWEST_MARKS = 2


def _tone_faults(
    recording: Recording, signal: Sequence[NDArray[np.float32]], speed_hz: float
) -> list[QualityFault]:
    """Of the steadiest tone that is loud enough and steadier than ringing."""
    tones = [steady_tone(row, recording.sample_rate, low_hz=LOWEST_TONE_HZ) for row in signal]
    steady = [
        (tone, channel)
        for tone, row, channel in zip(tones, signal, recording.vibration_channels, strict=True)
        if tone.scatter < LEAST_SCATTER
        and tone.amplitude**2 / 2 > LEAST_TONE * float(np.var(row, dtype=np.float64))
    ]
    if not steady:
        return []
    tone, channel = min(steady, key=lambda each: each[0].scatter)
    text = (
        f"channel {channel.name} has a steady tone of {tone.amplitude:.2g} {channel.unit} at "
        f"{tone.frequency_hz:.4g} Hz, order {tone.frequency_hz / speed_hz:.1f} of the shaft: half "
        f"of the time its amplitude is off by at most {tone.scatter:.0%}, must be by "
        f"{LEAST_SCATTER:.0%} or more, as of what knocks set ringing: a gear mesh, a fan or "
        "another machine hides what this one shows; record while that stands still"
    )
    return [QualityFault(kind="tone", channel=channel.name, text=text, bars=False)]


def _knock_faults(
    signal: Sequence[NDArray[np.float32]], rate: float, marks: NDArray[np.float64], speed_hz: float
) -> list[QualityFault]:
    """Of knocks at a rate that the own turn does not have."""
    other = other_rate(signal, rate, marks)
    if other.evidence <= MOST_EVIDENCE:
        return []
    text = (
        f"something knocks {other.rate_hz:.3g} times a second, {other.rate_hz / speed_hz:.2f} "
        f"times per turn of the shaft: evidence {other.evidence:.1f}, must be <= "
        f"{MOST_EVIDENCE:.1f}: a machine near by hides what this one shows; record while that "
        "stands still"
    )
    return [QualityFault(kind="knocks", channel="", text=text, bars=False)]
