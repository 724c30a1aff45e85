"""Units and their symbols: conversion of texts to SI, and SI symbols."""

import math
import re
from decimal import Decimal
from functools import lru_cache
from numbers import Real
from typing import Any

from ..output.spellings import spellings

_INCH = 0.0254  # m, exact by definition
_POUND_FORCE = 4.4482216152605  # N, exact by definition
STANDARD_GRAVITY = 9.80665  # m/s^2, ISO 80000-3

UNITS: dict[str, dict[str, float]] = {
    "length": {
        **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9},
        **{"in": _INCH, "mil": 1e-3 * _INCH},
    },
    "mass": {"kg": 1.0, "g": 1e-3},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "rotation speed": {"rev/s": 1.0, "Hz": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.5 / math.pi},
    "frequency": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "pressure": {
        "Pa": 1.0,
        "kPa": 1e3,
        "MPa": 1e6,
        "GPa": 1e9,
        "N/mm^2": 1e6,
        "bar": 1e5,
        "mbar": 1e2,
        "psi": _POUND_FORCE / _INCH**2,
    },
    "acceleration": {"m/s^2": 1.0, "g": STANDARD_GRAVITY},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "inertia": {"kg m^2": 1.0, "kg mm^2": 1e-6},
    "stiffness": {
        **{"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6, "GN/m": 1e9},
        **{"N/mm": 1e3, "kN/mm": 1e6, "N/um": 1e6},
    },
    "damping": {"N s/m": 1.0, "kN s/m": 1e3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "ratio": {"": 1.0, "%": 1e-2},
    "mode shape": {"kg^-0.5": 1.0},
    "density": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "volume": {"m^3": 1.0, "L": 1e-3, "cm^3": 1e-6, "mm^3": 1e-9},
    "area": {"m^2": 1.0, "cm^2": 1e-4, "mm^2": 1e-6},
    "moment": {"N m": 1.0, "kN m": 1e3, "N mm": 1e-3},
    "temperature": {"K": 1.0},
    "kinematic viscosity": {"m^2/s": 1.0, "mm^2/s": 1e-6, "cSt": 1e-6},
    "unbalance": {"kg m": 1.0, "kg mm": 1e-3, "g mm": 1e-6},
    "Hertz stiffness": {"N/m^1.5": 1.0},
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6},
    "viscosity": {"Pa s": 1.0, "mPa s": 1e-3, "cP": 1e-3},
    "heat conductance": {"W/K": 1.0},
    "specific heat": {"J/(kg K)": 1.0, "kJ/(kg K)": 1e3},
    "volume flow": {"m^3/s": 1.0, "L/s": 1e-3, "L/min": 1e-3 / 60, "mL/min": 1e-6 / 60},
}
"""Factor to SI of every unit, by dimension. The first unit of a row is the SI one."""

NUMBER_PATTERN = r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*(?P<number>{NUMBER_PATTERN})\s*(?P<unit>.*?)\s*")


def to_si(value: Any, dimension: str) -> float:
    """Convert a number or a string with a unit to SI.

    Parameters
    ----------
    value : float or str
        A bare number is SI; a string is a number and a unit of `dimension`.
    dimension : str
        A key of :data:`UNITS`.

    Returns
    -------
    float
        The value in the SI unit of `dimension` (rotation speed: revolutions per second).

    Raises
    ------
    ValueError
        The string has no number, no unit, or a unit of another dimension.

    Examples
    --------
    >>> to_si("0.25 mm", "length")
    0.00025
    >>> to_si("300 rpm", "rotation speed")
    5.0
    """
    if isinstance(value, bool) or not isinstance(value, (Real, str)):  # NumPy's are Real, too
        raise ValueError(f"is not a number or a string with a unit ({_unit_list(dimension)})")
    if isinstance(value, str):
        return _text_to_si(value, dimension)
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return math.inf if value == abs(value) else -math.inf


@lru_cache(maxsize=4096)
def _text_to_si(value: str, dimension: str) -> float:
    """Convert a text; cached, as a recipe validates its scene a hundred times."""
    units = UNITS[dimension]
    match = _QUANTITY.fullmatch(value)
    if match is None:
        example = f"1.5 {unit_symbol(dimension)}".rstrip()
        raise ValueError(f"has no leading number; write it like '{example}'")
    number, unit = match["number"], listed_unit(match["unit"], dimension)
    if unit is None:
        unit = match["unit"]
        if re.match(r",\d", unit):
            raise ValueError(f"has a decimal comma; write '{value.replace(',', '.', 1).strip()}'")
        missing = "has no unit" if unit == "" else f"has unit '{unit}', not one of {dimension}"
        raise ValueError(f"{missing}; use one of {_unit_list(dimension)}")
    try:  # a decimal product makes 0.13 mm exactly 0.00013, a product of two floats would not
        return float(Decimal(number) * Decimal(repr(units[unit])))
    except ArithmeticError:  # an exponent beyond decimals; the caller checks for finite values
        return float(number) * units[unit]


def listed_unit(text: str, dimension: str) -> str | None:
    """Unit of :data:`UNITS` that a text spells; None if it is none of the dimension.

    A product may be written with a blank, ``*``, ``·``, ``.``, ``-`` or nothing, a power as ``^2``,
    ``**2``, ``²`` or ``2``, and micro as ``u``, ``µ`` or ``μ``.

    Examples
    --------
    >>> [listed_unit(text, "viscosity") for text in ("Pa*s", "mPa·s", "Pas", "m")]
    ['Pa s', 'mPa s', 'Pa s', None]
    >>> listed_unit("1/min", "rotation speed"), listed_unit("kg·m²", "inertia")
    ('rpm', 'kg m^2')
    """
    units = UNITS[dimension]
    if text in units:
        return text
    return next((unit for unit in units if re.fullmatch(spellings(unit), text)), None)


def _unit_list(dimension: str) -> str:
    return ", ".join(unit or "(none)" for unit in UNITS[dimension])


def unit_symbol(dimension: str) -> str:
    """SI unit of a dimension."""
    return next(iter(UNITS[dimension]))
