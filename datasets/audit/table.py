"""Input of an audit: a table of numbers with its labels, machines and splits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, missing_file
from ..file.hdf5_values import HDF5_FAULTS, is_plain
from ..file.record import DataSet
from ..measured.label_table import listed

Float = NDArray[np.float64]
Severity = Literal["alarm", "warning", "note"]

BY_CHANCE = 1e-3
"""Probability that chance causes a false finding of a check (Bonferroni over its columns)."""

FEWEST = 3
"""Fewest rows that a class needs to be checked, and fewest machines that it needs."""

FEW_DISTINCT = 0.5
"""Share of distinct values, relative to rows, below which a column holds counts, not
measurements."""

SMALLEST, LARGEST = 1e-100, 1e100
"""Range of magnitudes compared, in addition to 0: squares, products and ratios are finite."""

SHOWN = 10
"""Columns, rows and records listed in a finding."""

OWN = ("record_id", "group", "grade", "signal_crc32")
"""Columns that identify a table of `wearstate features`; its features have a dot in the name."""

LARGEST_TABLE = 2**32
"""Largest plausible table file [byte]."""

MOST_CLASSES = 20
"""A numeric label with more values is continuous, and cut into `BINS`."""

BINS = 4
"""Classes of equal size into which a continuous label is cut."""

TABLES = (".csv", ".tsv", ".txt", ".parquet")
"""Suffixes of plain tables; the content of HDF5 files decides."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One finding of an audit.

    Attributes
    ----------
    code : str
        Kind of finding, for programs.
    severity : {"alarm", "warning", "note"}
        Alarm: figures from these data can be worthless. Warning: they may be; check. Note: known
        and harmless if considered.
    where : str
        File concerned.
    columns : tuple of str
        Columns concerned, the first few.
    numbers : mapping
        Counts and values behind the finding.
    what, means, cure : str
        Finding, its meaning, and what to do.
    """

    code: str
    severity: Severity
    where: str
    columns: tuple[str, ...] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)
    what: str
    means: str
    cure: str


def named(names: Sequence[str]) -> str:
    """The first few columns, and the number of others.

    Examples
    --------
    >>> named(["a", "b"]), named(list("abcdef"))
    ('a, b', 'a, b, c and 3 more columns')
    """
    shown = ", ".join(names[:3])
    return shown if len(names) <= 3 else f"{shown} and {len(names) - 3} more columns"


def has(names: Sequence[Any]) -> str:
    """``has`` for one, ``have`` for several."""
    return "has" if len(names) == 1 else "have"


@dataclass(frozen=True, kw_only=True, eq=False)
class AuditTable:
    """Rows of numbers, with their labels, machines and splits.

    Attributes
    ----------
    source : str
        File name, for messages.
    names : tuple of str
        Names of the columns of `values`.
    values : numpy.ndarray [shape=(n_rows, n_columns)]
        Inputs of a model; may hold NaN.
    texts : mapping of str to numpy.ndarray [shape=(n_rows,)]
        Columns of text.
    label_name : str
        Name of the label; empty without one.
    label : numpy.ndarray [shape=(n_rows,)] or None
        Class of each row, counted from 0.
    classes : tuple of str
        Name of each class.
    graded : numpy.ndarray [shape=(n_rows,)] or None
        The label as a number if it is ordered: wear in metres.
    groups : numpy.ndarray [shape=(n_rows,)] or None
        Machine of each row.
    nuisance : mapping of str to numpy.ndarray [shape=(n_rows,)]
        Conditions and other faults, which should not be related to the label.
    sides : mapping of str to numpy.ndarray [shape=(n_rows,)]
        Splits: 0 train, 1 test, -1 neither.
    shared : frozenset of str
        Splits that have machines on both sides by design.
    numbered : bool
        True if machines are numbered within their data set, and other files use the same numbers
        for other machines.
    """

    source: str
    names: tuple[str, ...]
    values: Float
    texts: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)
    label_name: str = ""
    label: NDArray[np.intp] | None = None
    classes: tuple[str, ...] = ()
    graded: Float | None = None
    groups: NDArray[Any] | None = None
    nuisance: Mapping[str, Float] = field(default_factory=dict)
    sides: Mapping[str, NDArray[np.int8]] = field(default_factory=dict)
    shared: frozenset[str] = frozenset()
    numbered: bool = False


@dataclass(frozen=True, kw_only=True)
class Roles:
    """Roles of the columns of a table; by name, or by number counted from 1.

    Attributes
    ----------
    label : str
        Column, or a file with one value per row.
    group : str
        Column of the machine.
    split : str
        Column with ``train`` or ``test``, or 0, 1 and -1; for a data set the name of a stored
        split.
    nuisance : tuple of str
        Columns that should not be related to the label.
    """

    label: str = ""
    group: str = ""
    split: str = ""
    nuisance: tuple[str, ...] = ()


NO_ROLES = Roles()
"""No roles given: only those declared by the file."""


def is_data_set(path: Path) -> bool:
    """Whether a file is HDF5 written by this program as a data set."""
    if path.suffix not in (".h5", ".hdf5", ".part"):
        return False
    import h5py

    try:
        with h5py.File(path) as file:
            return "signal" in file and "manifest" in file
    except HDF5_FAULTS:
        return True  # the reader of data sets reports its fault


def read_table(path: str | Path, roles: Roles = NO_ROLES) -> AuditTable:
    """Read a plain table: CSV with or without a header, Parquet, or HDF5 of columns.

    Parameters
    ----------
    path : str or Path
        File.
    roles : Roles
        Roles of columns: label, machine, split and nuisance. A table written by `wearstate
        features` needs none: its columns ``grade`` and ``group`` are used.

    Returns
    -------
    AuditTable
        Columns without a role, with numbers and text separate.

    Raises
    ------
    DataError
        If the file cannot be read, is empty, or lacks a column named in `roles`; all at once.
    """
    place = Path(path)
    frame = _frame(place)
    if not len(frame) or not len(frame.columns):
        raise DataError(f"{place}: {frame.shape} rows and columns, must be >= 1 each; check it")
    ours = set(OWN) <= set(frame.columns)
    if ours:
        roles = _own_roles(frame, roles)
    taken, nuisance, faults = _taken(frame, roles, place)
    if faults:
        raise DataError("\n".join(faults))
    label_name, label = _label(frame, taken.get("label"), roles.label, place)
    classes, codes, graded = coded(label, label_name)
    held = {*taken.values(), *nuisance}
    features = [name for name in frame.columns if "." in str(name) or not ours]
    free = [name for name in features if name not in held]
    numeric = [name for name in free if frame[name].dtype.kind in "biuf"]
    values = frame[numeric].to_numpy(dtype=float) if numeric else np.empty((len(frame), 0))
    values = comparable(values)
    split = taken.get("split")
    return AuditTable(
        source=place.name,
        names=tuple(map(str, numeric)),
        values=values,
        texts={str(name): _words(frame[name]) for name in free if name not in numeric},
        label_name=label_name,
        label=codes,
        classes=classes,
        graded=graded,
        groups=_machines(frame[taken["group"]], place) if "group" in taken else None,
        nuisance={name: comparable(_numbers(frame[name])) for name in nuisance},
        sides={split: _sides(frame[split], place)} if split else {},
        numbered=ours and taken.get("group") == "group",
    )


def comparable(values: Float) -> Float:
    """Numbers, with those too large or too small for any check made missing.

    Parameters
    ----------
    values : numpy.ndarray

    Examples
    --------
    >>> comparable(np.array([1e308, -2.0, 0.0, 1e-320]))
    array([nan, -2.,  0., nan])
    """
    size = np.abs(values)
    return np.where((size <= LARGEST) & ((size >= SMALLEST) | (size == 0)), values, np.nan)


def _machines(column: Any, place: Path) -> NDArray[np.str_]:
    """Machine of each row; a row without one would count as a separate machine."""
    missing = np.flatnonzero(column.isna().to_numpy())
    if missing.size:
        raise DataError(
            f"{place}: group {column.name!r} is missing in {missing.size} of {len(column)} rows, "
            f"must be in 0, first in row {missing[0] + 1}; name the machine or leave the rows out"
        )
    return _words(column)


def _own_roles(frame: Any, roles: Roles) -> Roles:
    """Roles of a table written by `wearstate features`, unless others are given."""
    conditions = [name for name in frame.columns if is_nuisance(str(name))]
    return Roles(
        label=roles.label or "grade",
        group=roles.group or "group",
        split=roles.split,
        nuisance=roles.nuisance or tuple(conditions),
    )


def is_nuisance(column: str) -> bool:
    """Whether a manifest column is drawn in addition to the wear: a condition, another fault."""
    from ...sim.scene.load import all_condition_places

    return column in all_condition_places() or column.startswith("confounder_")


def _taken(
    frame: Any, roles: Roles, place: Path
) -> tuple[dict[str, str], tuple[str, ...], list[str]]:
    """Column of each role that names one, nuisance columns, and faults."""
    single = {"label": roles.label, "group": roles.group, "split": roles.split}
    wanted = {role: name for role, name in single.items() if name}
    if roles.label and _is_file(roles.label, frame):
        del wanted["label"]
    requested = [*wanted.items(), *(("nuisance", name) for name in roles.nuisance)]
    faults = [
        f"{place}: {role} = {name!r} must be one of its {len(frame.columns)} columns "
        f"({listed(list(map(str, frame.columns)))}); give a name, or a number from 1"
        for role, name in requested
        if _column(frame, name) is None
    ]
    taken = {role: str(_column(frame, name)) for role, name in wanted.items()}
    return taken, tuple(str(_column(frame, name)) for name in roles.nuisance), faults


def _column(frame: Any, name: str) -> str | None:
    columns = list(map(str, frame.columns))
    if name in columns:
        return name
    if name.isdecimal() and 1 <= int(name) <= len(columns):
        return columns[int(name) - 1]
    return None


def _is_file(name: str, frame: Any) -> bool:
    return _column(frame, name) is None and Path(name).is_file()


def _label(frame: Any, column: str | None, wanted: str, place: Path) -> tuple[str, Any]:
    """Label of every row, from a column or from a separate file."""
    if column is not None:
        return column, frame[column]
    if not wanted:
        return "", None
    other = _frame(Path(wanted))
    if len(other) != len(frame) or other.shape[1] != 1:
        raise DataError(
            f"{wanted}: {other.shape[0]} rows and {other.shape[1]} columns, must be {len(frame)} "
            f"rows as {place} and 1 column; give one label per row"
        )
    return Path(wanted).name, other.iloc[:, 0]


def coded(label: Any, name: str) -> tuple[tuple[str, ...], NDArray[np.intp] | None, Float | None]:
    """Classes of a label, the class of every row, and its number if it is continuous.

    Parameters
    ----------
    label : array_like [shape=(n_rows,)] or None
        Texts or numbers.
    name : str
        Name for messages.

    Returns
    -------
    classes : tuple of str
        Names, or ranges of a continuous label.
    codes : numpy.ndarray [shape=(n_rows,)] or None
        Index into `classes`; None without a label.
    graded : numpy.ndarray [shape=(n_rows,)] or None
        Numbers of a continuous label.

    Raises
    ------
    DataError
        If a label is missing.

    Examples
    --------
    >>> coded(["worn", "new", "worn"], "state")[:2]
    (('new', 'worn'), array([1, 0, 1]))
    """
    if label is None:
        return (), None, None
    found: NDArray[Any] = np.asarray(label)
    if found.dtype.kind == "f" and not np.isfinite(comparable(found)).all():
        bad = int(np.count_nonzero(~np.isfinite(comparable(found))))
        raise DataError(
            f"label {name}: {bad} rows have none of {SMALLEST:g} to {LARGEST:g} in size (or 0), "
            "must be 0 rows; leave them out"
        )
    if found.dtype.kind not in "biuf":
        found = found.astype(str)
    classes, codes = np.unique(found, return_inverse=True)
    if found.dtype.kind == "f" and classes.size > MOST_CLASSES:
        edges = np.quantile(found, np.arange(1, BINS) / BINS)
        names = tuple(f"quarter {i + 1} of {name}" for i in range(BINS))
        return names, np.searchsorted(edges, found), found.astype(float)
    return tuple(map(str, classes.tolist())), codes, None


def _words(column: Any) -> NDArray[np.str_]:
    found: NDArray[np.str_] = column.astype(str).to_numpy(dtype=str)
    return found


def _numbers(column: Any) -> Float:
    """A column as numbers; texts as the number of their class."""
    if column.dtype.kind in "biuf":
        return np.asarray(column, dtype=float)
    return np.unique(_words(column), return_inverse=True)[1].astype(float)


_SIDES = {"train": 0, "test": 1, "0": 0, "1": 1, "-1": -1, "": -1, "nan": -1}


def _sides(column: Any, place: Path) -> NDArray[np.int8]:
    words = [str(word).strip().lower().removesuffix(".0") for word in column.tolist()]
    unknown = sorted(set(words) - set(_SIDES))
    if unknown:
        raise DataError(
            f"{place}: split column {column.name} holds {', '.join(unknown[:5])}, must hold train "
            "and test, or 0, 1 and -1; rewrite it"
        )
    return np.array([_SIDES[word] for word in words], dtype=np.int8)


# --- reading


def _frame(path: Path) -> Any:
    """Columns of a file as a data frame, numbered if they have no names."""
    if not path.is_file():
        raise DataError(missing_file(path))
    if path.stat().st_size > LARGEST_TABLE:
        raise DataError(
            f"{path}: {path.stat().st_size / 1e9:.1f} GB, must be <= {LARGEST_TABLE / 1e9:.1f} GB; "
            "audit a part of it"
        )
    if path.suffix in (".h5", ".hdf5"):
        return _hdf5_frame(path)
    if path.suffix not in TABLES:
        raise DataError(
            f"{path}: suffix {path.suffix!r} must be .h5 or one of {', '.join(TABLES)}; convert it"
        )
    import pandas as pd

    try:
        if path.suffix == ".parquet":
            return pd.read_parquet(path)
        return pd.read_csv(path, **_csv_dialect(path))
    except ImportError:
        raise DataError(
            f"{path}: Parquet needs pyarrow, which is not installed; pip install "
            "wearstate[parquet], or convert it to CSV"
        ) from None
    except (ValueError, OSError) as error:  # pandas' own errors are ValueErrors
        text = " ".join(str(error).split())
        raise DataError(
            f"{path} cannot be read as a table ({text}); repair or convert it"
        ) from None


def _csv_dialect(path: Path) -> dict[str, Any]:
    """Separator, decimal mark and header of a text table, detected in its first lines."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = [file.readline(2**22) for _ in range(3)]
    first, probe = lines[0], lines[1] or lines[0]
    separator = max(";\t,", key=first.count)
    if first.count(separator) == 0:
        separator = r"\s+" if len(first.split()) > 1 else ","
    decimal = "," if separator != "," and "," in probe and "." not in probe else "."
    cells = first.split() if separator == r"\s+" else first.split(separator)
    bare = all(_is_number(cell, decimal) for cell in cells)
    named = [f"column {i + 1}" for i in range(len(cells))]
    names = {"header": None, "names": named} if bare else {}
    return {"sep": separator, "decimal": decimal, "encoding": "utf-8-sig", **names}


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


def _hdf5_frame(path: Path) -> Any:
    """One column per dataset, as written by `wearstate features -o table.h5`."""
    import h5py
    import pandas as pd

    try:
        with h5py.File(path) as file:
            columns = {
                name: node[:]
                for name, node in file.items()
                if isinstance(node, h5py.Dataset)
                and is_plain(node.id.get_type())
                and node.ndim == 1
                and node.dtype.names is None
            }
    except HDF5_FAULTS as error:
        raise DataError(f"{path} cannot be read ({error}); take an intact copy") from None
    if len({len(column) for column in columns.values()}) != 1:
        raise DataError(
            f"{path}: its {len(columns)} one-dimensional datasets must be >= 1 and of one length "
            "to be a table; convert it to CSV"
        )
    text = {
        n: np.char.decode(c, "utf-8", "replace") for n, c in columns.items() if c.dtype.kind == "S"
    }
    return pd.DataFrame({**columns, **text})


# --- data sets


def manifest_table(data: DataSet, roles: Roles, names: Sequence[str], values: Float) -> AuditTable:
    """Usable records of a data set as a table of what was measured on their signals.

    Parameters
    ----------
    data : DataSet
        Simulated or measured.
    roles : Roles
        Roles that replace grade, machine and all stored splits.
    names : sequence of str
        Names of the columns of `values`.
    values : numpy.ndarray [shape=(n_usable, n_columns)]
        One row per usable record.

    Returns
    -------
    AuditTable
        Table with the conditions of the manifest as nuisance.

    Raises
    ------
    DataError
        If a role names a missing column or split.
    """
    usable = usable_records(data)
    manifest = data.manifest.iloc[usable]
    faults = [
        f"{data.path}: {role} = {name!r} must be a manifest column; see wearstate info"
        for role, name in (
            ("label", roles.label),
            ("group", roles.group),
            *(("nuisance", name) for name in roles.nuisance),
        )
        if name and name not in manifest.columns
    ]
    if faults:
        raise DataError("\n".join(faults))
    label_name, label, graded = _data_label(data, manifest, roles)
    classes, codes, continuous = coded(label, label_name)
    wanted = [roles.split] if roles.split else list(data.splits)
    conditions = roles.nuisance or tuple(n for n in manifest.columns if is_nuisance(str(n)))
    apart = {name: data.splits.get(name, {}).get("machines_apart", True) for name in wanted}
    return AuditTable(
        source=data.path.name,
        names=tuple(names),
        values=comparable(values),
        texts={"record_id": manifest["record_id"].to_numpy(dtype=str)},
        label_name=label_name,
        label=codes,
        classes=classes,
        graded=graded if graded is not None else continuous,
        groups=manifest[roles.group or "group"].to_numpy(),
        nuisance={
            str(name): comparable(manifest[name].to_numpy(dtype=float)) for name in conditions
        },
        sides={name: _stored_sides(data, name)[usable] for name in wanted},
        shared=frozenset(name for name, is_apart in apart.items() if not is_apart),
    )


def usable_records(data: DataSet) -> NDArray[np.intp]:
    """Records whose simulation did not fail [shape=(n_usable,)]."""
    return np.flatnonzero((data.manifest["status"] == "ok").to_numpy())


def _data_label(data: DataSet, manifest: Any, roles: Roles) -> tuple[str, Any, Float | None]:
    """The grade with the severity behind it; nothing if unknown."""
    if roles.label:
        return roles.label, manifest[roles.label], None
    if (manifest["grade"] < 0).any() or not data.attributes.severities:
        return "", None, None
    severity = manifest[data.attributes.severities[0]].to_numpy(dtype=float)
    return "grade", manifest["grade"], severity if np.isfinite(severity).all() else None


def _stored_sides(data: DataSet, name: str) -> NDArray[np.int8]:
    train, test = data.split(name)
    sides = np.full(len(data), -1, dtype=np.int8)
    sides[train], sides[test] = 0, 1
    return sides
