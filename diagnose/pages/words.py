"""Names of severity columns, for headings and sentences."""

import re


def quantity_name(severity: str) -> str:
    """Name of a severity column, for headings.

    Examples
    --------
    >>> quantity_name("diametral_clearance_crankpin_m")
    'diametral clearance, crankpin'
    >>> quantity_name("diametral_clearance_crankpin_2_m")
    'diametral clearance, crankpin 2'
    """
    number = re.search(r"_([0-9]+)_m$", severity)
    stem = severity.removesuffix(number[0] if number else "_m")
    kind, _, place = stem.rpartition("_")
    return f"{kind.replace('_', ' ')}, {place}{f' {number[1]}' if number else ''}"


def severity_word(severity: str) -> str:
    """Quantity of a severity column, in one or two words.

    Examples
    --------
    >>> severity_word("diametral_clearance_crankpin_m"), severity_word("scar_depth_bearing_m")
    ('clearance', 'scar depth')
    """
    return quantity_name(severity).split(",")[0].removeprefix("diametral ")
