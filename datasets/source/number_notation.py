"""Numbers in notations that the text readers do not support, distinguished from words."""

import re
from collections.abc import Sequence

_NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"

_NOTATIONS = (
    (
        re.compile(rf"\(?[-+]?{_NUMBER}(?:[-+]{_NUMBER})?[ij]\)?"),
        "a complex number",
        "write real and imaginary part as two columns",
    ),
    (
        # groups of three, by one sign throughout
        re.compile(r"[-+]?[0-9]{1,3}([,.' \u00a0\u2019])[0-9]{3}(?:\1[0-9]{3})*(?:[.,][0-9]*)?"),
        "a number whose thousands are separated",
        "write it without the separators",
    ),
    (
        re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[dD][-+]?[0-9]+"),
        "a number with Fortran's exponent",
        "write e in place of d",
    ),
)
"""Pattern of a whole cell, its name, and the cure."""


def unknown_notation(cells: Sequence[str]) -> tuple[str, str, str] | None:
    """First cell that is a number in an unsupported notation, the notation, and the cure.

    Parameters
    ----------
    cells : sequence of str
        Cells of one column that is not read as numbers.

    Returns
    -------
    tuple of str or None
        None if a cell is neither a plain number nor in such a notation: the column holds words.

    Examples
    --------
    >>> unknown_notation(["999.5", "1,234.5"])
    ('1,234.5', 'a number whose thousands are separated', 'write it without the separators')
    >>> unknown_notation(["1+2j", "pump 3"]), unknown_notation(["2024-05-01", "01.02.2024"])
    (None, None)
    """
    found = None
    for cell in map(str.strip, cells):
        known = next(
            ((cell, name, cure) for p, name, cure in _NOTATIONS if p.fullmatch(cell)), None
        )
        if known is None and not re.fullmatch(rf"[-+]?{_NUMBER}", cell):
            return None
        found = found or known
    return found
