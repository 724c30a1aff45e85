"""Names of values that hold a sample rate, and the declaration that such a value makes."""

import re
from dataclasses import dataclass

from ...sim.parts.units import to_si

_RATE_NAME = re.compile(r"(?:fs|sr|sampl(?:e|ing)[_ ]?(?:rate|frequency))([_ ]?hz)?", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class RateNote:
    """Statement of a file about its sample rate.

    Attributes
    ----------
    declared : float, optional
        Rate [Hz], if name or value contain the unit.
    seen : float, optional
        A number without unit: the rate, if it is in hertz.
    note : str
        Reason why it does not declare the rate, and the cure.
    """

    declared: float | None = None
    seen: float | None = None
    note: str = ""


def is_rate_name(name: str) -> bool:
    """Whether a value of this name is a sample rate.

    Examples
    --------
    >>> is_rate_name("Sampling Rate"), is_rate_name("fs_hz"), is_rate_name("rate")
    (True, True, False)
    """
    return _RATE_NAME.fullmatch(name) is not None


def rate_note(name: str, value: float | str | None) -> RateNote:
    """Declaration made by a value under the name of a rate.

    Parameters
    ----------
    name : str
        Name for which :func:`is_rate_name` holds.
    value : float, str or None
        Number, or text with a unit.

    Examples
    --------
    >>> rate_note("fs", "25.6 kHz").declared, rate_note("fs_hz", 100.0).declared
    (25600.0, 100.0)
    >>> rate_note("fs", 100.0).note
    'it holds fs = 100 without a unit: give fs = 100 if that is in Hz'
    """
    match = _RATE_NAME.fullmatch(name)
    if isinstance(value, str):
        try:
            return RateNote(declared=to_si(value, "frequency"))
        except ValueError:
            return RateNote()
    if value is None or match is None:
        return RateNote()
    if match.group(1):
        return RateNote(declared=float(value))
    text = f"{name} = {value:.10g}"
    note = f"it holds {text} without a unit: give fs = {value:.10g} if that is in Hz"
    return RateNote(seen=float(value), note=note)
