"""Labels of measured files, from a CSV beside them or one value for all; and wear limits."""

import csv
import difflib
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path, PurePosixPath

from ...sim.output.recording import DataError, missing_file
from ...sim.parts.units import UNITS, to_si
from ...sim.parts.wording import nearest
from ...sim.scene.load import all_wear_places, load_scene
from ..file.csv_cells import plain_cell
from ..file.machines import FILE
from ..recipe.severities import clearances, wear_limits

Value = float | int | bool | str
"""A label: NaN, -1 or empty where it is not known."""

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
"""Manifest columns that an import writes by itself."""

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
"""Ending of the name of a column in SI -> dimension, a key of the table of units."""

LARGEST_TABLE = 2**26
"""Largest believable table of labels [byte]."""

Place = Callable[[int], str]
"""Where a row of a table is, for messages."""

_LONGEST_TEXT = 200  # byte
_HIGHEST_GRADE = 3
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_WITH_UNIT = re.compile(rf"{_NUMBER.pattern}\s*([^\s0-9].*)")
_HEADING = re.compile(r"(.*?)\s*\[([^\[\]]*)\]")
_SEVERITY = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)+_m")
_SHOWN = 5  # of a list in a message
_MOST_FAULTS = 20  # of a message, before it counts the rest


@dataclass(frozen=True, kw_only=True)
class Labels:
    """Labels by file.

    Attributes
    ----------
    source : str
        File they are from, for messages; empty where all are constants.
    entries : tuple of str
        What each row says of its file; empty without a table.
    lines : tuple of int
        Line of each row in its file.
    rows : tuple of int, optional
        Which row of its file each one is about, where rows are records.
    columns : mapping
        Name -> a value per row.
    constants : mapping
        Name -> the value of every file.
    severities : tuple of str
        Columns that say how worn a machine is [m].
    """

    source: str = ""
    entries: tuple[str, ...] = ()
    lines: tuple[int, ...] = ()
    rows: tuple[int, ...] | None = None
    columns: Mapping[str, tuple[Value, ...]]
    constants: Mapping[str, Value]
    severities: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Every label, severities first."""
        rest = [n for n in (*self.columns, *self.constants) if n not in self.severities]
        return (*self.severities, *rest)

    def numpy_types(self) -> dict[str, str]:
        """Manifest columns with their types; group and grade have a place of their own."""
        return {
            name: _numpy_type(self.columns.get(name) or (self.constants[name],))
            for name in self.names
            if name not in (GROUP, GRADE)
        }

    def of_files(self, paths: Sequence[Path]) -> tuple[list[dict[str, Value]], int]:
        """Labels of each file.

        Parameters
        ----------
        paths : sequence of Path
            Absolute. A row is about the file whose path ends in the row's entry.

        Returns
        -------
        rows : list of dict
            Name -> value, of each file.
        unused : int
            Rows about files that are not among `paths`.

        Raises
        ------
        DataError
            A file has no row or several, or a row fits several files; all at once.
        """
        if not self.source:
            return [dict(self.constants) for _ in paths], 0
        found = _matches(self.entries, paths)
        faults = [*self._ambiguous(found, paths), *self._missing_or_twice(found, paths)]
        if faults:
            raise refusal([f"{self.source}: {fault}" for fault in faults])
        row_of = {files[0]: row for row, files in enumerate(found) if files}
        rows = [self._row(row_of[i]) for i in range(len(paths))]
        return rows, sum(not files for files in found)

    def of_rows(
        self, paths: Sequence[Path], counts: Sequence[int]
    ) -> tuple[list[dict[str, Value]], int]:
        """Labels of each row of each file, one file behind the other.

        Parameters
        ----------
        paths : sequence of Path
            Absolute.
        counts : sequence of int
            Rows of each.

        Returns
        -------
        rows : list of dict
            Name -> value, of each row of each file.
        unused : int
            Rows of the table about other files.

        Raises
        ------
        DataError
            As :meth:`of_files`, about rows.
        """
        found = _matches(self.entries, paths)
        faults = self._ambiguous(found, paths)
        places: dict[tuple[int, int], int] = {}
        for place, (files, row) in enumerate(zip(found, self.rows or (), strict=True)):
            for i in files:
                line, name = self.lines[place], paths[i].name
                if row >= counts[i]:
                    faults.append(
                        f"line {line}: {ROW} = {row} must be < {counts[i]}, the rows of {name} "
                        "that are records; correct it, or give rows"
                    )
                elif (i, row) in places:
                    earlier = self.lines[places[i, row]]
                    faults.append(
                        f"lines {earlier}, {line} are all about row {row} of {name}, must be one; "
                        "remove the others"
                    )
                places.setdefault((i, row), place)
        wanted = [(i, row) for i, count in enumerate(counts) for row in range(count)]
        missing = [f"{paths[i].name} {row}" for i, row in wanted if (i, row) not in places]
        if missing:
            faults.append(f"has no row for {len(missing)} record(s), {listed(missing)}; add one")
        if faults:
            raise refusal([f"{self.source}: {fault}" for fault in faults])
        rows = [self._row(places[key]) for key in wanted]
        return rows, sum(not files for files in found)

    def _row(self, place: int) -> dict[str, Value]:
        return {**{name: self.columns[name][place] for name in self.columns}, **self.constants}

    def _ambiguous(self, found: Sequence[Sequence[int]], paths: Sequence[Path]) -> list[str]:
        return [
            f"line {line}: file '{entry}' fits {listed([str(paths[i]) for i in files])}, must fit "
            "one; write more of its path"
            for entry, line, files in zip(self.entries, self.lines, found, strict=True)
            if len(files) > 1
        ]

    def _missing_or_twice(self, found: Sequence[Sequence[int]], paths: Sequence[Path]) -> list[str]:
        lines: dict[int, list[int]] = {i: [] for i in range(len(paths))}
        for line, files in zip(self.lines, found, strict=True):
            for i in files:
                lines[i].append(line)
        faults = [
            f"lines {', '.join(map(str, here))} are all about {paths[i]}, must be one; remove "
            "the others"
            for i, here in lines.items()
            if len(here) > 1
        ]
        missing = [paths[i].name for i, here in lines.items() if not here]
        if missing:
            close = difflib.get_close_matches(missing[0], self.entries, n=1)
            hint = f"; is {close[0]!r} meant for {missing[0]}?" if close else ""
            faults.append(
                f"has no row for {len(missing)} file(s), {listed(missing)}; add one{hint}"
            )
        return faults


def refusal(faults: Sequence[str]) -> DataError:
    """One error of many faults: the first of them, and how many more."""
    more = len(faults) - _MOST_FAULTS
    last = [f"and {more} more faults"] if more > 0 else []
    return DataError("\n".join([*faults[:_MOST_FAULTS], *last]))


def listed(words: Sequence[str]) -> str:
    """The first few of a list, and how many more.

    Examples
    --------
    >>> listed(["a", "b"]), listed(list("abcdefgh"))
    ('a, b', 'a, b, c, d, e and 3 more')
    """
    more = len(words) - _SHOWN
    return ", ".join(words[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


def _matches(entries: Sequence[str], paths: Sequence[Path]) -> list[list[int]]:
    """Files that each entry is about: the last parts of their path are its parts."""
    by_name: dict[str, list[int]] = {}
    for i, path in enumerate(paths):
        by_name.setdefault(path.name, []).append(i)
    found = []
    for entry in entries:
        parts = PurePosixPath(entry.replace("\\", "/")).parts
        close = by_name.get(parts[-1], []) if parts else []
        found.append([i for i in close if paths[i].parts[-len(parts) :] == parts])
    return found


def _numpy_type(values: Sequence[Value]) -> str:
    if isinstance(values[0], str):
        return f"S{max(1, *(len(str(value).encode()) for value in values))}"
    return "?" if isinstance(values[0], bool) else "<f8"


# --- reading ------------------------------------------------------------------------------------


def read_labels(
    path: str | Path | None = None,
    constants: Mapping[str, str] | None = None,
    severities: Sequence[str] = (),
) -> Labels:
    r"""Read labels from a CSV file, from words, or both.

    Parameters
    ----------
    path : str or Path, optional
        Table with a header; its column ``file`` holds file names, or as much of their paths as
        tells them apart. Comma, semicolon or tab; a decimal comma where commas do not separate.
        A column ``row_in_file`` labels single rows of files whose rows are records, from 0.
    constants : mapping, optional
        Label -> text, the same for all files.
    severities : sequence of str
        Labels that say how worn a machine is, besides those that recipes know; the first one is
        that which models are trained for unless told otherwise.

    Returns
    -------
    Labels
        Numbers in SI, texts as they are. A name ends in the SI unit (``speed_hz``); a unit in the
        heading (``speed [rpm]``) or behind the number is converted, and the former gives the name
        its ending. ``grade`` (0 to 3) and ``group`` (the machine) are known by name;
        ``confounder_`` begins a column of 0 and 1. An empty cell is not known.

    Raises
    ------
    DataError
        The table cannot be read or a value does not fit its name; all faults at once.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "labels.csv"
    ...     _ = file.write_text("file,scar_depth_bearing [um],fault\na.wav,40,outer\n")
    ...     labels = read_labels(file, {"speed_hz": "1500 rpm"})
    >>> labels.severities, labels.columns["fault"], labels.constants["speed_hz"]
    (('scar_depth_bearing_m',), ('outer',), 25.0)
    """
    faults: list[str] = []
    table = _Table() if path is None else _read_table(Path(path), faults)
    rows = _row_numbers(table, faults)
    given = {name: [text] for name, text in (constants or {}).items()}
    columns = _columns(table.columns, table.comma, table.place, faults)
    fixed = _columns(given, False, lambda _: "label", faults)
    faults += [
        f"label {name} is also a column of {table.source}, must be one of them; leave one out"
        for name in fixed
        if name in columns
    ]
    found = _severities({**columns, **fixed}, severities, faults)
    if faults:
        raise refusal(faults)
    return Labels(
        source=table.source,
        entries=tuple(table.entries),
        lines=tuple(table.lines),
        rows=rows,
        columns=columns,
        constants={name: values[0] for name, values in fixed.items()},
        severities=found,
    )


def _row_numbers(table: "_Table", faults: list[str]) -> tuple[int, ...] | None:
    """Rows that a table is about, of which it has a column or not."""
    cells = table.columns.pop(ROW, None)
    if cells is None:
        return None
    wrong = [i for i, cell in enumerate(cells) if not re.fullmatch("[0-9]{1,9}", cell)]
    faults += [
        f"{table.place(i)}: {ROW} = {cells[i]!r} must be a whole number >= 0, the first row being "
        "0; correct it"
        for i in wrong
    ]
    return tuple(0 if i in wrong else int(cell) for i, cell in enumerate(cells))


class _Table:
    """Cells of a table by column, with the lines they are from."""

    def __init__(self, source: str = "", comma: bool = False) -> None:
        self.source = source
        self.comma = comma
        self.entries: list[str] = []
        self.lines: list[int] = []
        self.columns: dict[str, list[str]] = {}

    def place(self, row: int) -> str:
        """Where a row is, for messages."""
        return f"{self.source} line {self.lines[row]}"


def _read_table(path: Path, faults: list[str]) -> _Table:
    text = _table_text(path)
    ways = [d for d in ",;\t" if FILE in next(_rows(path, text, d), (0, [""]))[1]]
    if not ways:
        raise DataError(
            f"{path}: its first line has no column '{FILE}', must have it before the labels: "
            f"{text.lstrip()[:60].partition(chr(10))[0].strip()!r}; name it so"
        )
    rows = _rows(path, text, ways[0])
    headings = next(rows)[1]
    wrong = [
        f"{path}: column {name!r} is there {headings.count(name)} times, must be once; rename one"
        for name in sorted(set(headings))
        if name and headings.count(name) > 1
    ]
    if "" in headings:
        wrong.append(f"{path}: column {headings.index('') + 1} has no name; give it one")
    if wrong:
        raise refusal(wrong)
    return _filled_table(_Table(str(path), comma=ways[0] != ","), headings, rows, faults)


def _filled_table(
    table: "_Table",
    headings: Sequence[str],
    rows: Iterator[tuple[int, list[str]]],
    faults: list[str],
) -> _Table:
    table.columns = {name: [] for name in headings}
    for line, cells in rows:
        if len(cells) != len(headings):
            faults.append(
                f"{table.source} line {line}: has {len(cells)} cells, must have {len(headings)}; "
                "mend it"
            )
            continue
        table.lines.append(line)
        for name, cell in zip(headings, cells, strict=True):
            table.columns[name].append(cell)
    table.entries = table.columns.pop(FILE)
    if not table.entries and not faults:
        faults.append(
            f"{table.source} has 0 rows below its header, must have one for every file; add them"
        )
    return table


def _table_text(path: Path) -> str:
    if not path.is_file():
        raise DataError(missing_file(path, "check the path of the labels"))
    size = path.stat().st_size
    if size > LARGEST_TABLE:
        raise DataError(f"{path} has {size} byte, must be <= {LARGEST_TABLE}; is it the labels?")
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path} is not UTF-8 at byte {error.start}, must be; save it as CSV UTF-8"
        ) from None


def _rows(path: Path, text: str, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Lines that are not blank, with their numbers."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield reader.line_num, [plain_cell(cell.strip()) for cell in cells]
    except csv.Error as error:
        raise DataError(f"{path} line {reader.line_num}: {error}; mend it") from None


# --- meaning ------------------------------------------------------------------------------------


def _columns(
    cells: Mapping[str, Sequence[str]], comma: bool, place: Place, faults: list[str]
) -> dict[str, tuple[Value, ...]]:
    """Values by name in SI; a heading may say a unit."""
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
    """Name with its SI ending, and the unit that the heading declares."""
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
    """Longest of the known endings that a name has."""
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
    """How the cells of a column are read."""
    if name == GRADE:
        return _grade
    if name == GROUP:
        return _group
    if name.startswith(CONFOUNDER):
        return _flag
    ending = _ending(name)
    told = [cell for cell in column if cell]
    if ending is None and not (told and all(_NUMBER.fullmatch(_dot(c, comma)) for c in told)):
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
        raise ValueError("must be finite; leave the cell empty where it is not known")
    return value


def _grade(cell: str) -> int:
    if cell not in ("", *map(str, range(_HIGHEST_GRADE + 1))):
        raise ValueError(f"must be a whole number >= 0 and <= {_HIGHEST_GRADE}, or empty")
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
        raise ValueError("is no UTF-8 text, must be; rewrite it")
    match = _WITH_UNIT.fullmatch(cell)
    ends = [end for end, d in ENDINGS.items() if match and match.group(1) in UNITS[d]]
    if ends:
        raise ValueError(f"has a unit, so its name must end in _{ends[0]}, the SI one; rename it")
    return cell


def _severities(
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


def known_severities(name: str) -> str:
    """Severities that recipes know, those with the same words first.

    Parameters
    ----------
    name : str
        As a person calls it.

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
    """True of a column that a machine's own wear has."""
    known = (each.column.replace("{}", "[0-9]+") for each in all_wear_places().values())
    return any(re.fullmatch(pattern, column) for pattern in known)


# --- limits -------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class LabelLimits:
    """Wear limits of a severity.

    Attributes
    ----------
    edges : tuple of float
        Where grades 1, 2, 3 begin [m], rising; the last one condemns.
    source : str
        Where they are from.
    """

    edges: tuple[float, ...]
    source: str


def read_limits(text: str, severities: Sequence[str]) -> LabelLimits:
    """Read wear limits as a person gives them.

    Parameters
    ----------
    text : str
        Three lengths with commas between, or a scene (built-in name or file) that has limits for
        the severity.
    severities : sequence of str
        Of the labels; limits are those of the first.

    Raises
    ------
    DataError
        There is no severity, it is not three lengths that rise, or the scene has no such limits.
    SceneError
        There is no such scene.

    Examples
    --------
    >>> read_limits("0.13 mm, 0.22 mm, 0.31 mm", ["diametral_clearance_crankpin_m"]).edges
    (0.00013, 0.00022, 0.00031)
    >>> read_limits("bilge-pump", ["diametral_clearance_crankpin_m"]).edges[-1]
    0.00031
    """
    if not severities:
        raise DataError(
            f"limits = {text!r} must be about a severity, the labels have none; label the wear in "
            "metres and say which label it is with severity"
        )
    if "," in text:
        return LabelLimits(edges=_edges(text), source="given on import")
    scene = load_scene(text)
    found = wear_limits(scene, severities[0])
    if found is None:
        own = [name for name in clearances(scene) if wear_limits(scene, name) is not None]
        raise DataError(
            f"scene {text} has no wear limits of {severities[0]}, it has those of "
            f"{listed(own) or 'none'}; name the label so, or give lengths like "
            "'0.13 mm, 0.22 mm, 0.31 mm'"
        )
    return LabelLimits(edges=tuple(found.grade_edges), source=found.source)


def _edges(text: str) -> tuple[float, ...]:
    try:
        edges = tuple(to_si(part.strip(), "length") for part in text.split(","))
    except ValueError as error:
        raise DataError(f"limits = {text!r}: a length {error}") from None
    rising = all(low < high for low, high in pairwise((0.0, *edges)))
    if len(edges) != _HIGHEST_GRADE or not rising or not math.isfinite(edges[-1]):
        raise DataError(
            f"limits = {text!r} must be {_HIGHEST_GRADE} lengths > 0 that rise: where grades 1, 2 "
            "and 3 begin; correct them"
        )
    return edges
