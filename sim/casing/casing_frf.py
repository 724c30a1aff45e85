"""Measured frequency response functions of a casing: reading, selection, interpolation.

A table holds the accelerance [m/s^2/N], acceleration over force under ``exp(+j w t)``, of pairs
named ``response/reference``: the sensor and the place of the force.

CSV: UTF-8; delimiter ``,`` or ``;`` (with ``;`` a decimal comma is allowed); lines that begin
with ``#`` are comments; the first other line is the header: ``frequency_hz`` [Hz], then for every
pair the two columns ``acc_x/bearing_x real`` and ``acc_x/bearing_x imag``, in any order.

UFF (``.uff``, ``.unv``): the records of data set 58 that are frequency response functions,
acceleration over force, through the extra ``wearstate[uff]``. A record is identified by its degrees
of freedom, ``"12:+X/3:+Y"`` (response node and direction, reference node and direction; either
direction may be given reversed, which changes the sign), and by its entity names if it has
both.
"""

import csv
import hashlib
import importlib
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ..parts.casing import FrfFile, specific_key
from ..parts.units import STANDARD_GRAVITY
from ..parts.wording import nearest
from ..scene.scene import SceneError

FEWEST_LINES = 16
"""Least number of lines of a table: fewer are a list of points, not a spectrum."""

_MOST_LINES = 2**18  # of the uniform grid to which a non-uniform table is interpolated
_EVEN = 0.01  # of the line spacing: printed frequencies are rounded
_ROLL_OFF = 0.125  # of the table's lines, added above it for the interpolation only
_LEAD = 1 / 16  # of the response's length kept for times before zero
_BACKWARD = 4.0  # energy before the blow over energy after it, of a conjugated table

_PATH = "casing.frf.file"


@dataclass(frozen=True, kw_only=True, eq=False)
class FrfTable:
    """Contents of a file of frequency response functions.

    Attributes
    ----------
    frequency : numpy.ndarray [shape=(n_lines,)]
        Frequencies, rising [Hz].
    pairs : mapping of str to numpy.ndarray [shape=(n_lines,)]
        Complex accelerance [m/s^2/N] by ``response/reference``.
    sha256 : str
        Hash of the file's bytes.
    """

    frequency: NDArray[np.float64]
    pairs: Mapping[str, NDArray[np.complex128]]
    sha256: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Accelerance:
    """Accelerance of a casing at measured lines.

    Attributes
    ----------
    frequency : numpy.ndarray [shape=(n_lines,)]
        Frequencies, rising [Hz].
    values : numpy.ndarray [shape=(n_outputs, n_inputs, n_lines)]
        Complex [m/s^2/N], ``exp(+j w t)``.
    sha256 : str
        Hash of the source file; empty without one.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]
    sha256: str = ""

    @property
    def spacing(self) -> float:
        """Line spacing of the uniform grid [Hz]; its inverse is the length of the response [s]."""
        return _spacing(self.frequency)

    def at(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Accelerance interpolated at uniformly spaced frequencies.

        Parameters
        ----------
        frequency : numpy.ndarray [shape=(n_frequencies,)]
            Uniformly spaced from zero [Hz].

        Returns
        -------
        numpy.ndarray [shape=(n_outputs, n_inputs, n_frequencies)]
            Complex [m/s^2/N]. Below the first line, that line's value times ``(f / f_first)^2``, as
            for a casing on its mounts; above the last line zero.

        Notes
        -----
        Lines ``df`` apart completely determine a response shorter than ``1/df``: they are
        transformed to the time domain, and the response, followed by zeros, back to any frequency.
        This recovers a resonance between two lines, which linear interpolation would lose. A
        response longer than ``1/df`` wraps around (:func:`late_share` shows it). For the
        transform the last value rolls off smoothly above the table; a sixteenth of the length is
        kept for times before the blow. Non-uniform lines are first interpolated to a uniform grid
        by cubic splines of real and imaginary part.

        Examples
        --------
        >>> f = np.arange(0.0, 401.0, 4.0)
        >>> unit = Accelerance(frequency=f, values=_resonance(f, 102.0, 0.05)[None, None])
        >>> grid = np.arange(0.0, 401.0)
        >>> peak = unit.at(grid)[0, 0, 102]  # halfway between two lines; exactly 10j
        >>> bool(abs(peak - 10j) < 0.01)
        True
        """
        from scipy.signal import ZoomFFT  # half a second, only for measured casings

        response, rate = _impulse_response(self)
        lead = round(_LEAD * response.shape[-1])
        inside = frequency <= self.frequency[-1] * (1 + 1e-12)
        asked = frequency[inside]
        result = np.zeros((*self.values.shape[:2], len(frequency)), dtype=np.complex128)
        if len(asked) < 2:  # a record of one or two samples has only zero frequency
            result[..., : len(asked)] = response.sum(axis=-1, keepdims=True)
            return result
        zoom = ZoomFFT(response.shape[-1], [0.0, asked[-1]], len(asked), fs=rate, endpoint=True)
        back = np.exp(2j * np.pi * asked * lead / rate)
        result[..., inside] = zoom(np.roll(response, lead, axis=-1)) * back
        return result

    def late_share(self) -> float:
        """Share of the responses' energy in the second half of their length.

        Its root is about the relative error of the acceleration: above 1e-4 the line spacing is too
        large for the damping, as the response has not decayed within ``1 / spacing``.
        """
        response, _ = _impulse_response(self)
        n = response.shape[-1]
        energy = np.sum(response**2, axis=(0, 1))
        late = energy[n // 2 : n - round(_LEAD * n)].sum()
        return float(late / energy.sum()) if energy.any() else 0.0


def _resonance(
    frequency: NDArray[np.float64], natural: float, damping_ratio: float
) -> NDArray[np.complex128]:
    """Accelerance of one mode of unit mass, for the examples."""
    ratio = frequency / natural
    return np.asarray(-(ratio**2) / (1 - ratio**2 + 2j * damping_ratio * ratio))


def _spacing(frequency: NDArray[np.float64]) -> float:
    """Spacing of the uniform grid from zero that contains all lines, or comes close to them."""
    even = float(frequency[-1] - frequency[0]) / (len(frequency) - 1)
    steps = np.rint(frequency / even)
    if np.abs(frequency - steps * even).max() <= _EVEN * even and (np.diff(steps) == 1).all():
        return float(frequency[-1] / steps[-1])
    return max(float(np.diff(frequency).min()), float(frequency[-1]) / _MOST_LINES)


def _on_even_lines(accelerance: Accelerance) -> tuple[NDArray[np.complex128], float]:
    """Values at whole multiples of the spacing, from zero to the last line, and the spacing."""
    spacing = accelerance.spacing
    given = accelerance.frequency
    n = int(np.floor(given[-1] / spacing * (1 + 1e-9))) + 1
    grid = spacing * np.arange(n)
    first = int(np.ceil(given[0] / spacing - _EVEN))
    values = np.empty((*accelerance.values.shape[:2], n), dtype=np.complex128)
    if len(given) == n - first:
        values[..., first:] = accelerance.values
    else:
        from scipy.interpolate import CubicSpline  # slow to import, for few files

        spline = CubicSpline(given, accelerance.values, axis=-1)
        values[..., first:] = spline(grid[first:])
    if first > 0:
        values[..., :first] = values[..., first : first + 1] * (grid[:first] / grid[first]) ** 2
    return values, spacing


def _impulse_response(accelerance: Accelerance) -> tuple[NDArray[np.float64], float]:
    """Responses [shape=(n_outputs, n_inputs, n_times)] over one period, and their sample rate."""
    lines, spacing = _on_even_lines(accelerance)
    n = lines.shape[-1]
    extra = max(2, round(_ROLL_OFF * n))
    fall = 0.5 * (1 + np.cos(np.pi * np.arange(1, extra + 1) / extra))
    whole = np.concatenate([lines, lines[..., -1:] * fall], axis=-1)
    period = 2 * (whole.shape[-1] - 1)
    return fft.irfft(whole, period, axis=-1), period * spacing


# --- selection of pairs for a scene


def load_accelerance(
    frf: FrfFile, sensors: Sequence[str], inputs: Sequence[tuple[str, int]]
) -> Accelerance:
    """Accelerance from the forces of a machine to its sensors, from the scene's file.

    Parameters
    ----------
    frf : FrfFile
        File, pairs and missing places, as the scene gives them.
    sensors : sequence of str
        Names of the channels, the outputs.
    inputs : sequence of (str, int)
        Place and throw (1-based) of every force, the inputs. A pair whose place ends in the
        throw (``bearing_x_2``) takes precedence over that of the place.

    Returns
    -------
    Accelerance
        Values [shape=(n_outputs, n_inputs, n_lines)] in the order of the arguments.

    Raises
    ------
    SceneError
        The file is missing or cannot be used, or a pair is missing; all faults together.
    """
    path = find_file(frf)
    status = path.stat()
    table = _cached_table(path, status.st_mtime_ns, status.st_size)
    faults: list[str] = []
    rows = [[_pair(table, frf, s, place, k, faults) for place, k in inputs] for s in sensors]
    if faults:
        raise SceneError(str(frf.file), list(dict.fromkeys(faults)))
    accelerance = Accelerance(frequency=table.frequency, values=np.array(rows), sha256=table.sha256)
    if _is_backward(accelerance):
        raise SceneError(
            str(frf.file),
            [
                f"{_PATH} = {frf.file!r}: the responses come before the blow, must come after it; "
                "the table is conjugated, change the sign of every imaginary part"
            ],
        )
    return accelerance


def find_file(frf: FrfFile) -> Path:
    """Path of the table: next to the scene file, else in the working directory.

    Raises
    ------
    SceneError
        There is no such file.
    """
    places = [Path(frf.folder) / frf.file] if frf.folder else []
    places.append(Path(frf.file))
    for path in places:
        try:
            if path.is_file():
                return path
        except ValueError:  # a NUL in the name
            continue
    fault = (
        f"{_PATH} = {frf.file!r} must be a file; it is neither next to the scene nor in the "
        "working directory; copy it there or give its whole path"
    )
    raise SceneError(frf.file, [fault])


def _pair(
    table: FrfTable, frf: FrfFile, sensor: str, place: str, throw: int, faults: list[str]
) -> NDArray[np.complex128]:
    none = np.zeros(len(table.frequency), dtype=np.complex128)
    # names in the scene's table take precedence over those of the file
    names = {name: name for name in table.pairs} | dict(frf.pairs)
    here = {name.partition("/")[2]: name for name in names if name.startswith(f"{sensor}/")}
    key = specific_key(here, place, throw)
    if key is not None:
        if (wanted := names[here[key]]) in table.pairs:
            return table.pairs[wanted]
        faults.append(
            f"casing.frf.pairs.{here[key]} = {wanted!r} is no pair of {frf.file}"
            f"{nearest(wanted, table.pairs)}"
        )
    elif specific_key(frf.without, place, throw) is None:
        name = f"{sensor}/{place}"
        faults.append(
            f"{_PATH} = {frf.file!r} has no pair '{name}', must have one; map it in "
            f"casing.frf.pairs, or put '{place}' into casing.frf.without to ignore its force"
            f"{nearest(name, table.pairs)}"
        )
    return none


def _is_backward(accelerance: Accelerance) -> bool:
    """Whether a table uses ``exp(-j w t)``, which puts its decay before the blow."""
    response, _ = _impulse_response(accelerance)
    energy = np.sum(response**2, axis=(0, 1))
    n = len(energy)
    near = max(2, n // 64)  # a bare mass responds at once, on both sides of the blow
    after, before = energy[near : n // 2].sum(), energy[n // 2 : n - near].sum()
    return bool(before > _BACKWARD * after and before > 0.01 * energy.sum())


# --- reading files


@lru_cache(maxsize=4)
def _cached_table(path: Path, modified: int, size: int) -> FrfTable:
    """Read a file once for all records of a data set; a changed file is read again."""
    del modified, size
    return read_frf_table(path)


def read_frf_table(path: str | Path) -> FrfTable:
    """Read a table of frequency response functions.

    Parameters
    ----------
    path : str or Path
        ``.csv`` or ``.txt``; ``.uff``, ``.unv`` or ``.uf`` (extra ``wearstate[uff]``).

    Returns
    -------
    FrfTable
        All pairs of the file.

    Raises
    ------
    SceneError
        No such file, another suffix, an invalid header or number, frequencies that do not rise,
        fewer than :data:`FEWEST_LINES` lines, a value that is not finite, no pair, or UFF without
        its extra.

    Examples
    --------
    >>> read_frf_table("none.csv")
    Traceback (most recent call last):
    wearstate.sim.scene.scene.SceneError: none.csv: 1 fault(s)
    casing.frf.file = 'none.csv' cannot be read (No such file or directory); check the path
    """
    file = Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise _refusal(file, f"suffix must be one of {', '.join(_READERS)}; convert the file")
    try:
        content = file.read_bytes()
    except OSError as error:
        fault = f"{_PATH} = {file.name!r} cannot be read ({error.strerror}); check the path"
        raise SceneError(str(path), [fault]) from None
    frequency, pairs = reader(file, content)
    faults = _table_faults(frequency, pairs)
    if faults:
        raise _refusal(file, *faults)
    return FrfTable(frequency=frequency, pairs=pairs, sha256=hashlib.sha256(content).hexdigest())


_Contents = tuple[NDArray[np.float64], dict[str, NDArray[np.complex128]]]


def _refusal(file: Path, *faults: str) -> SceneError:
    return SceneError(str(file), [f"{_PATH} = {file.name!r}: {fault}" for fault in faults])


def _table_faults(
    frequency: NDArray[np.float64], pairs: Mapping[str, NDArray[np.complex128]]
) -> list[str]:
    faults = []
    if len(frequency) < FEWEST_LINES:
        faults.append(f"has {len(frequency)} lines, must have >= {FEWEST_LINES}; measure more")
    if not pairs:
        faults.append("has no pair; add two columns for each, 'acc_x/bearing_x real' and '… imag'")
    if not np.isfinite(frequency).all():
        return [*faults, "has a frequency that is not finite; remove the line"]
    if (frequency < 0).any():
        faults.append(f"has a frequency of {frequency.min():g} Hz, must be >= 0; remove the line")
    fall = np.flatnonzero(np.diff(frequency) <= 0)
    if len(fall):
        low, high = frequency[fall[0] : fall[0] + 2]
        faults.append(f"{high:g} Hz follows {low:g} Hz, must rise from line to line; sort them")
    for name, values in pairs.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            faults.append(
                f"'{name}' is {values[bad[0]]:g} at {frequency[bad[0]]:g} Hz, must be finite; "
                "measure that line again or remove it"
            )
    return faults


def _read_csv(file: Path, content: bytes) -> _Contents:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _refusal(file, "is no UTF-8 text; save it as UTF-8") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise _refusal(file, "is empty; it needs a header and a line for every frequency")
    delimiter = ";" if ";" in lines[0] else ","
    header = [cell.strip() for cell in next(csv.reader(lines[:1], delimiter=delimiter))]
    columns = _columns(file, header)
    body = "\n".join(lines[1:])
    if delimiter == ";":
        body = body.replace(",", ".")
    return _from_columns(header, columns, _numbers(file, body, delimiter, len(header)))


def _columns(file: Path, header: list[str]) -> dict[str, tuple[int, int]]:
    """Columns of real and imaginary part by pair."""
    faults = [f"column '{n}' is given twice; remove one" for n in header if header.count(n) > 1]
    if "frequency_hz" not in header:
        faults.append("has no column 'frequency_hz'; the first line must be the header")
    columns: dict[str, dict[str, int]] = {}
    for index, name in enumerate(header):
        pair, _, part = name.rpartition(" ")
        if name == "frequency_hz":
            continue
        if part not in ("real", "imag") or pair.count("/") != 1:
            faults.append(f"column '{name}' must be like 'acc_x/bearing_x real'; rename it")
            continue
        columns.setdefault(pair, {})[part] = index
    faults += [
        f"column '{pair} {part}' is missing next to the other part; add it"
        for pair, parts in columns.items()
        for part in ("real", "imag")
        if part not in parts
    ]
    if faults:
        raise _refusal(file, *dict.fromkeys(faults))
    return {pair: (parts["real"], parts["imag"]) for pair, parts in columns.items()}


def _numbers(file: Path, body: str, delimiter: str, width: int) -> NDArray[np.float64]:
    if not body:
        return np.empty((0, width))
    try:
        numbers = np.loadtxt(io.StringIO(body), delimiter=delimiter, ndmin=2)
    except ValueError as error:
        raise _refusal(file, f"below the header: {error}; correct that line") from None
    if numbers.shape[1] != width:
        fault = f"lines have {numbers.shape[1]} cells, must have {width} as the header; fix them"
        raise _refusal(file, fault)
    return numbers


def _from_columns(
    header: list[str], columns: Mapping[str, tuple[int, int]], numbers: NDArray[np.float64]
) -> _Contents:
    frequency = np.ascontiguousarray(numbers[:, header.index("frequency_hz")])
    return frequency, {
        pair: numbers[:, real] + 1j * numbers[:, imag] for pair, (real, imag) in columns.items()
    }


_FRF, _FREQUENCY, _ACCELERATION = 4, 18, 12  # codes of the universal file format
_FORCES = (9, 13)  # reaction force, excitation force
_AXES = {1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}
_ACCELERATION_UNITS = {"m/s^2": 1.0, "m/s2": 1.0, "m/s²": 1.0, "g": STANDARD_GRAVITY}
_FORCE_UNITS = {"n": 1.0, "kn": 1e3}


def _read_uff(file: Path, content: bytes) -> _Contents:
    del content  # the library opens the file itself
    try:
        pyuff: Any = importlib.import_module("pyuff")
    except ImportError:
        fault = "needs pyuff, which is not installed; pip install 'wearstate[uff]', or use CSV"
        raise _refusal(file, fault) from None
    try:
        sets = _read_sets(pyuff.UFF(str(file)))
    except Exception as error:  # the library has no error class for an invalid file
        raise _refusal(file, f"is no universal file ({error}); export it again") from None
    records = [r for r in sets if r["type"] == 58 and r["func_type"] == _FRF]
    if not records:
        raise _refusal(file, "has no frequency response function (58, type 4); export those")
    system = next((r for r in sets if r["type"] == 164), None)
    faults = [fault for record in records for fault in _record_faults(record, records[0])]
    if faults:
        raise _refusal(file, *dict.fromkeys(faults))
    return np.asarray(records[0]["x"], dtype=float), _named(file, records, system)


def _read_sets(uff: Any) -> list[dict[str, Any]]:
    kinds = uff.get_set_types()
    return [uff.read_sets(int(n)) for n in np.flatnonzero(np.isin(kinds, (58, 164)))]


def _record_faults(record: Mapping[str, Any], first: Mapping[str, Any]) -> Iterable[str]:
    name = _dof_name(record)
    if record["ordinate_spec_data_type"] != _ACCELERATION:
        kind = record["ordinate_spec_data_type"]
        yield f"'{name}' has the quantity {kind}, must be acceleration (12); export accelerance"
    if record["orddenom_spec_data_type"] not in _FORCES:
        kind = record["orddenom_spec_data_type"]
        yield f"'{name}' is over the quantity {kind}, must be force (13); export accelerance"
    if record["abscissa_spec_data_type"] != _FREQUENCY:
        kind = record["abscissa_spec_data_type"]
        yield f"'{name}' is over the abscissa {kind}, must be frequency (18); export spectra"
    if not np.array_equal(record["x"], first["x"]):
        yield f"'{name}' has other lines than '{_dof_name(first)}', export them with equal lines"
    for label, known in (("ordinate", _ACCELERATION_UNITS), ("orddenom", _FORCE_UNITS)):
        unit = _label(record, label)
        if unit and unit.lower() not in known:
            yield f"'{name}' is in {unit!r}, must be one of {', '.join(known)}; convert it"


def _label(record: Mapping[str, Any], axis: str) -> str:
    text = str(record.get(f"{axis}_axis_units_lab") or "").strip()
    return "" if text.upper() in ("NONE", "") else text


def _scale(record: Mapping[str, Any], system: Mapping[str, Any] | None) -> float:
    """Factor to SI: by the record's labels, else by the file's unit system (data set 164)."""
    length = 1.0 / float(system["length"]) if system else 1.0
    force = 1.0 / float(system["force"]) if system else 1.0
    above, below = _label(record, "ordinate").lower(), _label(record, "orddenom").lower()
    return _ACCELERATION_UNITS.get(above, length) / _FORCE_UNITS.get(below, force)


def _dof(node: Any, direction: Any) -> str:
    code = int(direction)
    if code == 0:
        return f"{int(node)}:S"
    return f"{int(node)}:{'-' if code < 0 else '+'}{_AXES.get(abs(code), abs(code))}"


def _dof_name(record: Mapping[str, Any]) -> str:
    response = _dof(record["rsp_node"], record["rsp_dir"])
    return f"{response}/{_dof(record['ref_node'], record['ref_dir'])}"


def _named(
    file: Path, records: Sequence[Mapping[str, Any]], system: Mapping[str, Any] | None
) -> dict[str, NDArray[np.complex128]]:
    """Records by their degrees of freedom, by the reversed ones, and by their entity names."""
    pairs: dict[str, NDArray[np.complex128]] = {}
    faults = []
    for record in records:
        values = np.asarray(record["data"], dtype=np.complex128) * _scale(record, system)
        entities = [str(record.get(f"{end}_ent_name") or "").strip() for end in ("rsp", "ref")]
        names = [_dof_name(record)]
        if all(entity.upper() not in ("", "NONE") for entity in entities):
            names.append("/".join(entities))
        faults += [f"has '{name}' twice; export one of them" for name in names[:1] if name in pairs]
        pairs |= dict.fromkeys((name for name in names if name not in pairs), values)
    if faults:
        raise _refusal(file, *faults)
    for record in records:
        for name, sign in _reversed(record):
            pairs.setdefault(name, sign * pairs[_dof_name(record)])
    return pairs


def _reversed(record: Mapping[str, Any]) -> Iterable[tuple[str, float]]:
    """Names of the same record with either direction reversed, and the resulting sign."""
    for response, reference in ((-1, 1), (1, -1), (-1, -1)):
        turned = {
            **record,
            "rsp_dir": response * record["rsp_dir"],
            "ref_dir": reference * record["ref_dir"],
        }
        if record["rsp_dir"] and record["ref_dir"]:
            yield _dof_name(turned), float(response * reference)


_READERS = {
    ".csv": _read_csv,
    ".txt": _read_csv,
    ".uff": _read_uff,
    ".unv": _read_uff,
    ".uf": _read_uff,
}
"""Suffix -> reader. A new format is one row."""
