"""Columns of labels: the meaning of a heading, and the values under it in SI."""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from ...sim.parts.units import UNITS, to_si
from ...sim.parts.wording import nearest
from ...sim.scene.load import all_wear_places
from ...sim.scene.pump_hydraulics import STANDARD_ATMOSPHERE
from ..file.machines import FILE
from .label_table import listed

Value = float | int | bool | str
"""A label: NaN, -1 or empty if unknown."""

GROUP, GRADE, ROW = "group", "grade", "row_in_file"
CONFOUNDER = "confounder_"

RESERVED = (
    "record_id",
    "seed",
    "done",
    "status",
    "signal_crc32",
    "group_name",
    "start_s",
    "mean_speed_hz",
)
"""Manifest columns that an import writes itself."""

ENDINGS = {
    "m": "length",
    "hz": "rotation speed",
    "n": "force",
    "pa": "pressure",
    "rad": "angle",
    "s": "time",
    "k": "temperature",
    "pa_s": "viscosity",
    "kg_m": "unbalance",
}
"""Dimension (key of the table of units) of a column in SI, by the ending of its name."""

Place = Callable[[int], str]
"""Text with the place of a row of a table, for messages."""

_LONGEST_TEXT = 200  # byte
HIGHEST_GRADE = 3
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_WITH_UNIT = re.compile(rf"{_NUMBER.pattern}\s*([^\s0-9].*)")
_HEADING = re.compile(r"(.*?)\s*\[([^\[\]]*)\]")
_SEVERITY = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)+_m")


def columns_of(
    cells: Mapping[str, Sequence[str]], comma: bool, place: Place, faults: list[str]
) -> dict[str, tuple[Value, ...]]:
    """Values by name in SI; a heading may contain a unit."""
    found: dict[str, tuple[Value, ...]] = {}
    for heading, column in cells.items():
        try:
            name, unit = _heading(heading)
        except ValueError as error:
            faults.append(f"label '{heading}' {error}")
            continue
        if name in (*RESERVED, FILE):
            faults.append(f"label {name} is a name of the import's own; choose another")
        elif name in found:
            faults.append(f"label {name} is there twice, must be once; rename one")
        else:
            parse = _parser(name, unit, column, comma)
            found[name] = tuple(_parsed(name, column, parse, place, faults))
    return found


def _heading(heading: str) -> tuple[str, str]:
    """Name with its SI ending, and the unit declared in the heading."""
    if not heading:
        raise ValueError("has no name; give it one")
    match = _HEADING.fullmatch(heading)
    if match is None:
        return heading, ""
    name, unit = match.group(1), match.group(2).strip()
    endings = [end for end, dimension in ENDINGS.items() if unit in UNITS[dimension]]
    if not endings or not name:
        known = ", ".join(unit for dimension in ENDINGS.values() for unit in UNITS[dimension])
        raise ValueError(f"has unit {unit!r} behind {name!r}, must be a name and one of {known}")
    own = _ending(name)
    if own is not None and own not in endings:
        raise ValueError(f"has unit {unit!r}, must be one of {ENDINGS[own]}; rename or convert it")
    return (name if own is not None else f"{name}_{endings[0]}"), unit


def _ending(name: str) -> str | None:
    """Longest of the known endings of a name."""
    return max((end for end in ENDINGS if name.endswith(f"_{end}")), key=len, default=None)


def _parsed(
    name: str,
    column: Sequence[str],
    parse: Callable[[str], Value],
    place: Place,
    faults: list[str],
) -> Iterator[Value]:
    for row, cell in enumerate(column):
        try:
            yield parse(cell)
        except ValueError as error:
            faults.append(f"{place(row)}: {name} = {cell!r} {error}")
            yield ""


def _parser(name: str, unit: str, column: Sequence[str], comma: bool) -> Callable[[str], Value]:
    """Parser for the cells of a column."""
    if name == GRADE:
        return _grade
    if name == GROUP:
        return _group
    if name.startswith(CONFOUNDER):
        return _flag
    ending = _ending(name)
    filled = [cell for cell in column if cell]
    if ending is None and not (filled and all(_NUMBER.fullmatch(_dot(c, comma)) for c in filled)):
        return _text
    return partial(_number, ending=ending, unit=unit, comma=comma)


def _dot(cell: str, comma: bool) -> str:
    return cell.replace(",", ".") if comma else cell


def _number(cell: str, *, ending: str | None, unit: str, comma: bool) -> float:
    if not cell:
        return math.nan
    text = _dot(cell, comma)
    if _NUMBER.fullmatch(text) and not unit:
        value = float(text)
    elif _NUMBER.fullmatch(text) or not unit:
        value = to_si(f"{text} {unit}".rstrip(), ENDINGS[str(ending)])
    else:
        raise ValueError(f"must be a number, the heading says {unit}; leave the unit out")
    if not math.isfinite(value):
        raise ValueError("must be finite; leave the cell empty if it is unknown")
    return value


def _grade(cell: str) -> int:
    if cell not in ("", *map(str, range(HIGHEST_GRADE + 1))):
        raise ValueError(f"must be a whole number >= 0 and <= {HIGHEST_GRADE}, or empty")
    return int(cell) if cell else -1


def _group(cell: str) -> str:
    if not cell:
        raise ValueError("must name the machine; windows of one machine decide every split")
    return _text(cell)


def _flag(cell: str) -> bool:
    if cell not in ("0", "1"):
        raise ValueError("must be 0 (absent) or 1 (present)")
    return cell == "1"


def _text(cell: str) -> str:
    size = len(cell.encode(errors="surrogatepass"))
    if size > _LONGEST_TEXT:
        raise ValueError(f"has {size} byte, must have <= {_LONGEST_TEXT}; shorten it")
    if any("\ud800" <= letter <= "\udfff" for letter in cell):
        raise ValueError("is not UTF-8 text, must be; rewrite it")
    match = _WITH_UNIT.fullmatch(cell)
    ends = [end for end, d in ENDINGS.items() if match and match.group(1) in UNITS[d]]
    if ends:
        raise ValueError(f"has a unit, so its name must end in _{ends[0]}, the SI one; rename it")
    return cell


def severities_in(
    columns: Mapping[str, Sequence[Value]], declared: Sequence[str], faults: list[str]
) -> tuple[str, ...]:
    """Names of the labels of wear, those declared first."""
    names = tuple(dict.fromkeys([*declared, *filter(_is_severity, columns)]))
    for name in names:
        if name not in columns:
            faults.append(f"severity {name} is no label{nearest(name, list(columns))}")
        elif not _SEVERITY.fullmatch(name):
            faults.append(
                f"severity {name} must name kind, place and metres; rename the label to "
                f"{known_severities(name)}, as recipes and models do, or alike"
            )
        elif any(isinstance(value, float) and value < 0 for value in columns[name]):
            worst = min(value for value in columns[name] if isinstance(value, float))
            faults.append(f"severity {name} = {worst:g} m must be >= 0; check the sign")
    return names


_BOUND = {
    "suction_pressure_pa": -STANDARD_ATMOSPHERE,
    "discharge_pressure_pa": -STANDARD_ATMOSPHERE,
    "viscosity_pa_s": 0.0,
}
"""Operating conditions and the bound that a value must exceed [SI]; pressures are gauge."""


def condition_faults(columns: Mapping[str, Sequence[Value]], place: Place) -> list[str]:
    """Sentences on operating conditions that no machine has, and which models would use.

    Parameters
    ----------
    columns : mapping
        Values of each row.
    place : callable
        Place of a row.

    Examples
    --------
    >>> condition_faults({"viscosity_pa_s": [0.03, 0.0]}, lambda row: f"line {row + 2}")
    ['line 3: viscosity_pa_s = 0 must be > 0; check value and unit']
    """
    return [
        f"{place(row)}: {name} = {value:g} must be > {bound:g}; check value and unit"
        for name, bound in _BOUND.items()
        for row, value in enumerate(columns.get(name, ()))
        if isinstance(value, float) and value <= bound
    ]


def pressure_faults(
    columns: Mapping[str, Sequence[Value]], constants: Mapping[str, Sequence[Value]], place: Place
) -> list[str]:
    """Sentences on pumps that discharge at less than their suction pressure.

    Parameters
    ----------
    columns : mapping
        Values of each row.
    constants : mapping
        One value for all rows.
    place : callable
        Place of a row.

    Examples
    --------
    >>> suction = {"suction_pressure_pa": [3e5]}
    >>> found = pressure_faults({"discharge_pressure_pa": [4e5, 3.0]}, suction, "row {}".format)
    >>> [each.partition(";")[0] for each in found]
    ['row 1: discharge_pressure_pa = 3 must be >= suction_pressure_pa = 300000']
    """
    names = ("suction_pressure_pa", "discharge_pressure_pa")
    rows = max(len(columns.get(name, ())) for name in names)
    values = [columns.get(name) or list(constants.get(name, ())) * max(rows, 1) for name in names]
    return [
        f"{place(row) if rows else 'label'}: discharge_pressure_pa = {high:g} must be >= "
        f"suction_pressure_pa = {low:g}; check values, units and signs of both gauge pressures"
        for row, (low, high) in enumerate(zip(*values, strict=False))
        if isinstance(low, float) and isinstance(high, float) and high < low
    ]


def known_severities(name: str) -> str:
    """Severities that recipes know, those with the same words first.

    Parameters
    ----------
    name : str
        Name as written by the user.

    Examples
    --------
    >>> known_severities("sag")
    'sag_bearing_1_m'
    """
    known = [each.column.replace("{}", "1") for each in all_wear_places().values()]
    words = set(name.removesuffix("_m").split("_"))
    alike = [column for column in known if words & set(column.split("_"))]
    return listed(alike or known)


def _is_severity(column: str) -> bool:
    """Whether a column is a wear label of a built-in machine."""
    known = (each.column.replace("{}", "[0-9]+") for each in all_wear_places().values())
    return any(re.fullmatch(pattern, column) for pattern in known)
