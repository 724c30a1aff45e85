"""Spellings of units."""

import re
from functools import lru_cache

_ALSO = {
    "rpm": ("RPM", "rev/min", "r/min", "1/min", "min^-1"),
    "rev/s": ("r/s",),
    "N s/m": ("N/(m/s)",),
    "kN s/m": ("kN/(m/s)",),
    "deg": ("°",),
    "L": ("l",),
}
"""Other names of a unit with a unique meaning; not 1/s, which may be rev/s or rad/s."""

_WAYS = {
    " ": r"\s*[*·⋅.-]?\s*",
    "/": r"\s*/\s*",
    "^2": r"(?:(?:\^|\*\*)?2|²)",
    "^3": r"(?:(?:\^|\*\*)?3|³)",
    "^-1": r"(?:(?:\^|\*\*)?-1|⁻¹)",
    "^": r"(?:\^|\*\*)?",
    "u": "[uµμ]",
}
"""Spellings of each symbol in a unit, as regular expressions."""

_SIGN = re.compile(r"( |/|\^[23]|\^-1|\^|\bu(?=[ms]\b))")


@lru_cache(maxsize=256)
def spellings(unit: str) -> str:
    """Regular expression of all spellings of a unit, for Python and for JSON schemas.

    Examples
    --------
    >>> [bool(re.fullmatch(spellings("m/s^2"), text)) for text in ("m/s²", "m / s**2", "m/s")]
    [True, True, False]
    """
    return "|".join(
        "".join(_WAYS.get(piece, re.escape(piece)) for piece in _SIGN.split(name))
        for name in (unit, *_ALSO.get(unit, ()))
    )
