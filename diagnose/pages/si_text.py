"""Numbers with their unit as text: SI prefix, three digits."""

import math

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))
_PREFIXED = ("m", "N", "Pa", "Hz", "s", "V", "W")
"""Units that take a prefix; metres not kilo."""


def si_text(value: float, unit: str = "", digits: int = 3) -> str:
    """A number with its unit.

    Parameters
    ----------
    value : float
        Value in `unit`.
    unit : str
        SI unit; products and powers take no prefix, and an angle is shown in degrees.
    digits : int
        Number of significant digits.

    Returns
    -------
    str

    Examples
    --------
    >>> si_text(2.5e-4, "m"), si_text(-30e3, "Pa"), si_text(13.61, "m/s^2"), si_text(0.0, "N")
    ('250 um', '-30 kPa', '13.6 m/s^2', '0 N')
    >>> si_text(0.5, "rad"), si_text(1.234)
    ('28.6 deg', '1.23')
    """
    if not math.isfinite(value):
        return "no figure"
    if unit == "rad":
        value, unit = math.degrees(value), "deg"
    prefix = ""
    if unit in _PREFIXED and value != 0:
        rounded = abs(float(f"{value:.{digits}g}"))  # 999.9 N is 1 kN
        scale, prefix = next((p for p in _PREFIXES if rounded >= p[0]), _PREFIXES[-1])
        if unit == "m" and scale > 1:
            scale, prefix = 1.0, ""
        value /= scale
    return f"{plain(value, digits)} {prefix}{unit}".rstrip()


def plain(value: float, digits: int = 3) -> str:
    """A number with the given digits, without an exponent if that is short.

    Examples
    --------
    >>> plain(1234.5, 3), plain(0.0123456, 3), plain(1.5e-9, 2)
    ('1230', '0.0123', '1.5e-09')
    """
    return f"{float(f'{value:.{digits}g}'):g}"
