"""Hum of the mains in a recording: what no turning part makes, and a model takes for wear."""

import numpy as np

from ...features.rotation.order import pulse_times
from ...features.signal.hum import hum_power
from ...sim.output.recording import Recording
from .quality import QualityFault

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
