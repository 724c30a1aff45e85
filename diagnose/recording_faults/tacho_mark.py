"""A tacho mark that is not at the dead centre."""

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from .fault import QualityFault

Float = NDArray[np.float64]

_HALF = 0.5
_MARK_BIN_DEG = 10.0  # steps in which the mark is moved on trial


def mark_faults(recording: Recording, late_deg: float | None) -> tuple[QualityFault, ...]:
    """Report a tacho mark that is not at the dead centre, where the model expects it.

    Parameters
    ----------
    recording : Recording
    late_deg : float or None
        Lateness of the mark [deg]; None if it is where it should be.

    Examples
    --------
    >>> from wearstate.sim.output.sensor import Channel
    >>> recording = Recording(signal=np.ones((1, 8)), sample_rate=1e3, tacho="key", channels=(
    ...     Channel(name="key", unit="V", quantity="tacho"),))
    >>> mark_faults(recording, 30.0)[0].text[:61]
    'tacho key: its mark comes about 30 degrees late, but for whic'
    >>> mark_faults(recording, None)
    ()
    """
    if late_deg is None:
        return ()
    side = "late" if late_deg > 0 else "early"
    upright = "" if not _upside_down(recording, late_deg) else "multiply the channel by -1: "
    if upright:
        upright += "its pulses point down and end as late as that; or "
    text = (
        f"tacho {recording.tacho}: its mark comes about {abs(late_deg):.0f} degrees {side}, but "
        f"for which the recording is familiar; must be at the top dead centre: {upright}move the "
        "mark, shift the channel by as much, or look for a valve that does not close"
    )
    return (QualityFault(kind="tacho", channel=str(recording.tacho), text=text),)


def _upside_down(recording: Recording, late_deg: float) -> bool:
    """Whether pulses point down and are as long as the mark is late: their end was taken for it."""
    tacho = recording.tacho_signal
    if tacho is None:
        return False
    below = float(np.mean(tacho < (float(tacho.min()) + float(tacho.max())) / 2))
    width_deg = 360.0 * below / recording.pulses_per_revolution
    return below < _HALF and abs(width_deg - late_deg) <= _MARK_BIN_DEG
