"""Units of measured channels: declared, converted by the common table of units, or refused."""

import difflib
import math
import re
from dataclasses import dataclass

from ...sim.parts.units import UNITS, listed_unit, to_si

FULL_SCALE = "FS"
"""Unit of a converter's numbers, 1 at full scale: not physical, but a valid declaration."""

DIMENSIONS = {
    "acceleration": "acceleration",
    "velocity": "velocity",
    "displacement": "length",
    "force": "force",
    "pressure": "pressure",
    "voltage": "voltage",
    "rotation speed": "rotation speed",
    "angle": "angle",
    "moment": "moment",
    "temperature": "temperature",
}
"""Row of the table of units for each quantity of a channel. Mass is excluded: g is gravity here."""

SAME = {
    "m/s/s": "m/s^2",
    "m s^-2": "m/s^2",
    "gn": "g",
    "g_n": "g",
    "mg": "0.001 g",
    "mm/s^2": "0.001 m/s^2",
    "mm/s2": "0.001 m/s^2",
    "cm/s": "10 mm/s",
    "in/s": "25.4 mm/s",
    "ips": "25.4 mm/s",
    "mils": "mil",
    "micron": "um",
    "microns": "um",
    "hPa": "100 Pa",
    "barg": "bar",
    "bar(g)": "bar",
    "psig": "psi",
    "psi(g)": "psi",
    "uV": "0.001 mV",
    "Volt": "V",
    "Volts": "V",
    "volts": "V",
}
"""Other names and multiples, in units of the table."""

_SIGNS = str.maketrans({"μ": "u", "µ": "u", "²": "^2", "·": " ", "⋅": " ", "*": " "})
_NUMBER = re.compile(r"\s*([0-9]+\.?[0-9]*(?:[eE][-+]?[0-9]+)?|\.[0-9]+(?:[eE][-+]?[0-9]+)?)\s*")


@dataclass(frozen=True, kw_only=True)
class ChannelUnit:
    """Conversion of one number of a file to SI.

    Attributes
    ----------
    quantity : str
        ``acceleration``, …, a key of :data:`DIMENSIONS`, or ``full scale``.
    symbol : str
        SI unit of the quantity.
    factor : float
        SI units per number of the file, > 0.
    """

    quantity: str
    symbol: str
    factor: float


def parse_unit(text: str) -> ChannelUnit:
    """Meaning of a declared unit, with an optional number before it.

    Parameters
    ----------
    text : str
        ``"g"``, ``"mm/s"``, ``"0.5 mV"`` (one number of the file is half a millivolt), ``"FS"``.

    Returns
    -------
    ChannelUnit
        Quantity, SI unit and factor.

    Raises
    ------
    ValueError
        If the unit is unknown (the nearest known one is named), or its factor is not > 0 and
        finite.

    Examples
    --------
    >>> parse_unit("m/s²")
    ChannelUnit(quantity='acceleration', symbol='m/s^2', factor=1.0)
    >>> parse_unit("0.5 mV").factor
    0.0005
    >>> parse_unit("mm/sec")
    Traceback (most recent call last):
    ValueError: unit 'mm/sec' is not known; did you mean 'mm/s'?
    """
    number, unit = _split(text)
    scale, symbol = _split(SAME.get(unit, unit))
    if symbol == FULL_SCALE:
        return ChannelUnit(quantity="full scale", symbol=FULL_SCALE, factor=_sane(text, number))
    for quantity, dimension in DIMENSIONS.items():
        if listed_unit(symbol, dimension):
            factor = _sane(text, number * to_si(f"{scale!r} {symbol}", dimension))
            return ChannelUnit(
                quantity=quantity, symbol=next(iter(UNITS[dimension])), factor=factor
            )
    raise ValueError(f"unit {text!r} is not known; {_nearest(unit)}")


def parse_sensitivity(text: str) -> ChannelUnit:
    """Conversion of a voltage by the sensitivity of the sensor.

    Parameters
    ----------
    text : str
        Voltage per unit: ``"100 mV/g"``, ``"4 mV/(mm/s)"``, ``"7.87 mV/µm"``.

    Returns
    -------
    ChannelUnit
        Unit with the factor from volts to the SI unit.

    Raises
    ------
    ValueError
        If it is not voltage per unit, or zero.

    Examples
    --------
    >>> unit = parse_sensitivity("100 mV/g")
    >>> unit.quantity, round(unit.factor, 4)  # a volt is 10 g
    ('acceleration', 98.0665)
    """
    above, slash, below = text.partition("/")
    cure = "write voltage per unit like '100 mV/g'"
    if not slash:
        raise ValueError(f"sensitivity {text!r} has no '/'; {cure}")
    volts, unit = parse_unit(above), parse_unit(below.strip().strip("()"))
    if volts.quantity != "voltage" or unit.quantity in ("voltage", "full scale"):
        raise ValueError(
            f"sensitivity {text!r} is {volts.quantity} per {unit.quantity}, must be voltage per "
            f"what the sensor measures; {cure}"
        )
    return ChannelUnit(
        quantity=unit.quantity, symbol=unit.symbol, factor=_sane(text, unit.factor / volts.factor)
    )


def known_unit(text: str) -> bool:
    """Whether :func:`parse_unit` accepts the text."""
    try:
        parse_unit(text)
    except ValueError:
        return False
    return True


def known_units() -> tuple[str, ...]:
    """All units of the table that a channel may have.

    Examples
    --------
    >>> {"g", "mm/s", "um", "V"} <= set(known_units())
    True
    """
    rows = (UNITS[dimension] for dimension in DIMENSIONS.values())
    return tuple(dict.fromkeys([*(unit for row in rows for unit in row), FULL_SCALE]))


def _split(text: str) -> tuple[float, str]:
    """Number before a unit (1 if there is none), and the unit in the table's notation."""
    plain = " ".join(text.replace("**", "^").translate(_SIGNS).replace("^^", "^").split())
    match = _NUMBER.match(plain)
    # "1/min" begins with a number that belongs to the unit
    if match is None or listed_unit(plain, "rotation speed"):
        return 1.0, plain
    return float(match.group(1)), plain[match.end() :]


def _sane(text: str, factor: float) -> float:
    if not (math.isfinite(factor) and factor > 0):
        raise ValueError(f"{text!r} is a factor of {factor}, must be > 0 and finite; correct it")
    return factor


def _nearest(unit: str) -> str:
    choices = (*known_units(), *SAME)
    found = difflib.get_close_matches(unit, choices, n=1, cutoff=0.5)
    if found:
        return f"did you mean {found[0]!r}?"
    return f"use one of {', '.join(known_units())}, or a number and one of them, like '25.4 mm/s'"
