"""Names under which files keep a sample rate, and what a number there declares."""

import re
from dataclasses import dataclass

from ...sim.parts.units import to_si

_RATE_NAME = re.compile(r"(?:fs|sr|sampl(?:e|ing)[_ ]?(?:rate|frequency))([_ ]?hz)?", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class RateNote:
    """What a file says of its sample rate.

    Attributes
    ----------
    declared : float, optional
        [Hz], where name or value says hertz.
    seen : float, optional
        A number of no unit: the rate, if it is in hertz.
    note : str
        Why that declares nothing, and the cure.
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
    """What a value under the name of a rate declares.

    Parameters
    ----------
    name : str
        For which :func:`is_rate_name` holds.
    value : float, str or None
        A number, or a text with its unit.

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
