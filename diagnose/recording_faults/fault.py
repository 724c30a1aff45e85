"""One fault of a recording: what is wrong, where, and how to correct it."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "saturated",
    "gap",
    "dead",
    "swapped",
    "unit",
    "rate",
    "tacho",
    "layout",
    "hum",
    "tone",
    "knocks",
    "coupling",
    "place",
]


@dataclass(frozen=True, kw_only=True)
class QualityFault:
    """One thing wrong with a recording.

    Attributes
    ----------
    kind : str
        ``saturated``, ``gap``, ``dead``, ``swapped``, ``unit``, ``rate``, ``tacho``, ``layout``,
        ``hum``, ``tone``, ``knocks``, ``coupling`` or ``place``.
    channel : str
        Name of the channel; empty for the whole recording.
    text : str
        Quantity, value, bound and cure.
    bars : bool
        Whether no verdict is given with this fault.
    factor : float or None
        Wrong unit: factor by which the samples must be multiplied. Wrong rate: true sample rate
        over the stated one.
    """

    kind: Kind
    channel: str
    text: str
    bars: bool = True
    factor: float | None = None
