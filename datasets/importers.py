"""Recordings from files: one reader per suffix, units converted only where they are declared."""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sim.parts import UNITS, to_si
from ..sim.sensor import Channel
from .record import DataError, DataSet, Recording

LARGEST_INFLATED = 2**30
"""Largest believable content of a MAT file [byte]: beyond it a small file is a trap."""

POUND_FORCE = 4.4482216152605
"""[N], exact: international pound times standard gravity."""

_MAT_HEADER = 128  # byte, MAT-file Level 5
_MAT_COMPRESSED = 15  # miCOMPRESSED
_LEVEL_7_3 = b"MATLAB 7.3"


@dataclass(frozen=True, kw_only=True)
class _Options:
    """What the caller declares about a file that does not say it."""

    record: int
    fs: float | None
    unit: str | None
    variable: str | None


@dataclass(frozen=True, kw_only=True)
class MatLayout:
    """Where a known MAT layout keeps its numbers, all fields of one struct.

    Attributes
    ----------
    name : str
        Of the data set, for messages.
    struct, signal, sample_rate : str
        Names of the struct and its fields.
    unit : str
        Unit of the signal, by the documentation of the data set.
    conditions : dict
        Field -> manifest column and factor to SI.
    """

    name: str
    struct: str
    signal: str
    sample_rate: str
    unit: str
    conditions: Mapping[str, tuple[str, float]]


MAT_LAYOUTS = (
    MatLayout(
        name="MFPT bearing fault data set",
        struct="bearing",
        signal="gs",
        sample_rate="sr",
        unit="g",
        conditions={"rate": ("speed_hz", 1.0), "load": ("load_n", POUND_FORCE)},
    ),
)
"""A new layout is one row."""


def read_recording(
    path: str | Path,
    *,
    record: int = 0,
    fs: float | None = None,
    unit: str | None = None,
    variable: str | None = None,
) -> Recording:
    """Read one recording from a file.

    Parameters
    ----------
    path : str or Path
        Data set of this program (``.h5``, ``.hdf5``) or MATLAB 5 to 7 (``.mat``).
    record : int
        Record of a data set; 0 in every other file.
    fs : float, optional
        Sample rate [Hz], where the file does not give it.
    unit : {"m/s^2", "g"}, optional
        Unit of the signal, where the file's format does not declare it. Never guessed.
    variable : str, optional
        Array to read from a ``.mat`` file of unknown layout; ``struct.field`` for a field. One
        channel, or the longer side is time.

    Returns
    -------
    Recording
        Accelerations in m/s^2.

    Raises
    ------
    DataError
        The file is missing, truncated, damaged or of a format not known; it does not declare
        sample rate or unit and neither does the caller; what it declares contradicts the caller.

    Examples
    --------
    >>> import tempfile
    >>> from scipy.io import savemat
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "pump.mat"
    ...     savemat(file, {"x": np.ones(16)})
    ...     read_recording(file, variable="x", fs=1000.0, unit="g").signal[0, 0]
    np.float32(9.80665)
    """
    file = Path(path)
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise DataError(
            f"{file}: suffix '{file.suffix}' must be one of {', '.join(READERS)}; convert the file"
        )
    if not file.is_file():
        raise DataError(f"{file} is no file; check the path")
    if fs is not None and not (np.isfinite(fs) and fs > 0):
        raise DataError(f"fs = {fs} Hz must be > 0 and finite; give the sample rate")
    if unit is not None and unit not in UNITS["acceleration"]:
        known = ", ".join(UNITS["acceleration"])
        raise DataError(f"unit = {unit!r} must be one of {known}; convert the signal")
    return reader(file, _Options(record=record, fs=fs, unit=unit, variable=variable))


def _read_data_set(file: Path, options: _Options) -> Recording:
    with DataSet(file) as data:
        declared = data.attributes.sample_rate
        if options.fs is not None and options.fs != declared:
            raise _contradiction(file, "fs", f"{options.fs:g} Hz", f"{declared:g} Hz")
        if options.unit is not None or options.variable is not None:
            raise DataError(f"{file} declares its own units and channels; leave out those options")
        if not 0 <= options.record < len(data):
            raise DataError(
                f"{file}: record = {options.record} must be >= 0 and < {len(data)}; choose another"
            )
        return data[options.record]


def _read_mat(file: Path, options: _Options) -> Recording:
    if options.record != 0:
        raise DataError(f"{file}: record = {options.record} must be 0; the file holds one")
    content = _mat_content(file)
    if options.variable is None:
        for layout in MAT_LAYOUTS:
            fields = _fields(content.get(layout.struct))
            if {layout.signal, layout.sample_rate} <= set(fields):
                return _from_layout(file, layout, fields, options)
    return _from_variable(file, content, options)


def _mat_content(file: Path) -> dict[str, Any]:
    """Every variable of a MAT file by name.

    Raises
    ------
    DataError
        It cannot be read.
    """
    from scipy.io import loadmat  # slow to import, and only for this format

    raw = file.read_bytes()
    if raw.startswith(_LEVEL_7_3):
        raise DataError(f"{file} is MATLAB 7.3, must be 5 to 7; save it again with '-v7'")
    _refuse_cut(file, raw)
    try:
        content: dict[str, Any] = loadmat(BytesIO(raw), squeeze_me=False)
    # the parser meets bytes of any origin and raises errors of any type; none may pass as data
    except Exception as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{file} cannot be read ({text}); take an intact copy") from error
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _refuse_cut(file: Path, raw: bytes) -> None:
    """Walk the top-level elements: each must lie within the file and inflate to a sane size."""
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:_MAT_HEADER])
    if order is None:
        raise DataError(f"{file} has no MAT 5 header; it is cut short, or save it with '-v7'")
    place, inflated = _MAT_HEADER, 0
    while place < len(raw):
        if place + 8 > len(raw):
            raise _cut(file, place + 8, len(raw))
        kind, size = np.frombuffer(raw, dtype=f"{order}u4", count=2, offset=place).tolist()
        if place + 8 + size > len(raw):
            raise _cut(file, place + 8 + size, len(raw))
        element = memoryview(raw)[place + 8 : place + 8 + size]
        inflated += _inflated_size(file, element) if kind == _MAT_COMPRESSED else size
        if inflated > LARGEST_INFLATED:
            raise DataError(
                f"{file} holds more than {LARGEST_INFLATED} byte, the largest believed; split it"
            )
        place += 8 + size
    if inflated == 0:
        raise DataError(f"{file} holds 0 variables, must be >= 1; it is cut short")


def _inflated_size(file: Path, element: memoryview) -> int:
    inflater = zlib.decompressobj()
    total, rest = 0, bytes(element)
    try:
        while rest and not inflater.eof and total <= LARGEST_INFLATED:
            total += len(inflater.decompress(rest, 1 << 22))
            rest = inflater.unconsumed_tail
    except zlib.error as error:
        raise DataError(f"{file} cannot be read ({error}); take an intact copy") from error
    if not inflater.eof and total <= LARGEST_INFLATED:
        raise DataError(f"{file} ends within a compressed variable; take an intact copy")
    return total


def _cut(file: Path, needed: int, size: int) -> DataError:
    return DataError(f"{file} has {size} byte, must be >= {needed}; take an intact copy")


def _fields(value: Any) -> dict[str, NDArray[Any]]:
    """Fields of a 1 x 1 struct; none of anything else."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if not names or value.size != 1:
        return {}
    return {name: np.asarray(value.reshape(-1)[0][name]) for name in names}


def _from_layout(
    file: Path, layout: MatLayout, fields: Mapping[str, NDArray[Any]], options: _Options
) -> Recording:
    if options.unit not in (None, layout.unit):
        raise _contradiction(file, "unit", str(options.unit), f"{layout.unit} ({layout.name})")
    rate = _scalar(file, layout.sample_rate, fields[layout.sample_rate])
    if options.fs not in (None, rate):
        raise _contradiction(file, "fs", f"{options.fs} Hz", f"{rate:g} Hz")
    row = {
        column: factor * _scalar(file, field, fields[field])
        for field, (column, factor) in layout.conditions.items()
        if field in fields
    }
    return _recording(file, layout.signal, fields[layout.signal], rate, layout.unit, row)


def _from_variable(file: Path, content: Mapping[str, Any], options: _Options) -> Recording:
    arrays = _numeric_arrays(content)
    listing = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "none"
    if options.variable not in arrays:
        raise DataError(
            f"{file}: variable = {options.variable!r} must be one of its numeric arrays: "
            f"{listing}; give variable, fs and unit"
        )
    if options.fs is None or options.unit is None:
        raise DataError(
            f"{file}: fs = {options.fs} and unit = {options.unit} must both be given for "
            f"variable {options.variable}; the file does not declare them"
        )
    array = arrays[options.variable]
    return _recording(file, options.variable, array, options.fs, options.unit, {})


def _numeric_arrays(content: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    found = {}
    for name, value in content.items():
        fields = {f"{name}.{field}": array for field, array in _fields(value).items()}
        found.update(fields or {name: np.asarray(value)})
    return {
        name: array
        for name, array in found.items()
        if array.dtype.kind in "iuf" and array.ndim == 2 and array.size > 1
    }


def _scalar(file: Path, name: str, value: NDArray[Any]) -> float:
    """One number, also where the file holds it as text."""
    try:
        return float(value.reshape(-1)[0]) if value.size == 1 else float("")
    except (TypeError, ValueError):
        raise DataError(f"{file}: {name} = {value!r} must be one number; mend the file") from None


def _recording(
    file: Path, name: str, array: NDArray[Any], fs: float, unit: str, row: dict[str, Any]
) -> Recording:
    if array.dtype.kind not in "iuf" or array.ndim != 2 or array.size == 0:
        raise DataError(
            f"{file}: {name} is {array.dtype} {array.shape}, must be real numbers (samples, "
            "channels); choose another variable"
        )
    rows = array if array.shape[0] < array.shape[1] else array.T
    names = [name] if len(rows) == 1 else [f"{name}_{i}" for i in range(len(rows))]
    factor = to_si(f"1 {unit}", "acceleration")
    with np.errstate(over="ignore"):  # becomes inf, which a recording refuses by name
        signal = (rows.astype(np.float64) * factor).astype(np.float32)
    channels = tuple(
        Channel(name=n, unit="m/s^2", quantity="acceleration", unit_in_file=unit) for n in names
    )
    return Recording(
        signal=signal,
        sample_rate=fs,
        channels=channels,
        origin="measured",
        row=row,
        source=file.name,
    )


def _contradiction(file: Path, what: str, given: str, declared: str) -> DataError:
    return DataError(f"{file}: {what} = {given} must be {declared}, as declared; leave it out")


READERS: dict[str, Callable[[Path, _Options], Recording]] = {
    ".h5": _read_data_set,
    ".hdf5": _read_data_set,
    ".mat": _read_mat,
}
"""Suffix -> reader. A new format is one row."""
