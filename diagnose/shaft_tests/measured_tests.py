"""Tests of a shaft line from files: recordings with a force channel, reactions from a table."""

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.record import DataSet
from ...features.response.transfer import measured_transfer
from ...features.rotation.order import pulse_times
from ...sim.output.recording import DataError, Recording
from ...sim.output.sensor import Channel
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft_response.places import Place
from .next_test import JACKING_ERROR
from .sag_model import MeasuredReactions, MeasuredTransfer

_BLOCKS = 10  # whole windows in a record, overlapped by half
_FINEST_HZ = 0.25  # spacing of lines: oil-damped shafts need no finer one
_MOST_LINES = 200  # evenly spaced in the band
_FLOOR = 0.01  # error of a transfer function, relative: leakage and calibration
_FEWEST_HEARD = 0.05  # of the lines of the band: noise alone yields about a hundredth of them
_LOW_HZ = 5.0
_HIGH_HZ = 400.0
_HIGH_SHARE = 0.4  # of the sample rate


@dataclass(frozen=True, kw_only=True, eq=False)
class LineTest:
    """One test read from a file.

    Attributes
    ----------
    transfer : MeasuredTransfer
    coherence : ndarray, shape (n_lines, n_resp)
        Coherence at the lines of `transfer` [-].
    text : str
        Place of the force, averaging and coherence.
    """

    transfer: MeasuredTransfer
    coherence: NDArray[np.float64]
    text: str


def read_tests(path: str | Path, scene: ShaftScene) -> tuple[LineTest, ...]:
    """Read the tests of one line from a data set or recording of this program.

    Parameters
    ----------
    path : str or Path
        Every record is a test of the same line; `import` converts measured files.
    scene : ShaftScene
        Its sensors and exciters locate channels without a stated place.

    Returns
    -------
    tuple of LineTest
        One for each force of each record.

    Raises
    ------
    DataError
        The file cannot be read or holds several machines, or a channel, its place or the speed is
        missing.
    """
    data = DataSet(path)
    machines = {name for name in data.machines if name}
    if len(machines) > 1:
        raise DataError(
            f"{path}: machines = {len(machines)} must be 1, the line to be aligned; "
            "keep the records of one machine"
        )
    return tuple(test for number in range(len(data)) for test in line_tests(data[number], scene))


def line_tests(recording: Recording, scene: ShaftScene) -> tuple[LineTest, ...]:
    """Transfer functions of a recording, from each of its forces to its accelerometers.

    Parameters
    ----------
    recording : Recording
        Recording with force and acceleration channels, and a tacho or a speed in its manifest.
    scene
        As in :func:`read_tests`.

    Returns
    -------
    tuple of LineTest

    Raises
    ------
    DataError
        As in :func:`read_tests`.
    """
    forces = [c for c in recording.channels if c.quantity == "force"]
    seen = [c for c in recording.channels if c.quantity == "acceleration"]
    if not forces or not seen:
        raise DataError(
            f"{recording.source}: force channels = {len(forces)} and accelerometers = {len(seen)} "
            "must be >= 1; record both, or name the force with import --force"
        )
    fs = recording.sample_rate
    top = min(_HIGH_SHARE * fs, _HIGH_HZ)
    rows = [recording.signal[[recording.names.index(c.name) for c in kind]]
            for kind in (forces, seen)]  # fmt: skip
    found = measured_transfer(rows[0], rows[1], fs, nperseg=_window(recording), band=(_LOW_HZ, top))
    if found.decay or np.isnan(found.coherence).any():
        raise DataError(
            f"{recording.source}: blows = 1 must be >= 2 for a coherence, without which a test is "
            "not trusted; strike several times"
        )
    speed = math.tau * _speed(recording)
    shape = (len(seen), len(forces), -1)
    value, noise = found.value.reshape(shape), found.noise.reshape(shape)
    coherence, heard = found.coherence.reshape(shape), found.heard.reshape(shape)
    places = tuple(_place(channel, scene) for channel in seen)
    tests = []
    for k, channel in enumerate(forces):
        kept = _kept(np.asarray(heard[:, k].all(axis=0)), recording.source, channel.name)
        transfer = MeasuredTransfer(
            frequencies=found.frequency[kept],
            value=np.ascontiguousarray(value[:, k, kept].T),
            covariance=_covariance(value[:, k, kept].T, noise[:, k, kept].T),
            speed=speed,
            force=_place(channel, scene),
            responses=places,
        )
        share = float(np.median(coherence[:, k]))
        text = (
            f"{recording.source}: {channel.name}, {channel.place or 'by its name'}, "
            f"{speed / math.tau:.4g} rev/s, {found.words}, median coherence {share:.2f}, "
            f"{kept.size} lines"
        )
        tests.append(LineTest(transfer=transfer, coherence=coherence[:, k, kept].T, text=text))
    return tuple(tests)


def _window(recording: Recording) -> int:
    samples = recording.signal.shape[1]
    longest = min(samples / _BLOCKS, recording.sample_rate / _FINEST_HZ)
    return 1 << int(np.log2(max(longest, 8)))


def _kept(heard: NDArray[np.bool_], source: str, name: str) -> NDArray[np.intp]:
    """Lines at which all responses are coherent with the force, up to a largest number."""
    usable = np.flatnonzero(heard)
    if usable.size < _FEWEST_HEARD * heard.size:
        raise DataError(
            f"{source}: lines with coherence between '{name}' and every accelerometer = "
            f"{100 * usable.size / heard.size:.1f} % must be >= {100 * _FEWEST_HEARD:.0f} %; push "
            "harder, average longer, or check the channels"
        )
    picked = np.unique(np.linspace(0, usable.size - 1, min(_MOST_LINES, usable.size)).round())
    return usable[picked.astype(np.intp)]


def _covariance(
    value: NDArray[np.complex128], noise: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Covariance of independent errors of the responses (n_lines, n_resp, n_resp)."""
    variance = noise + (_FLOOR * np.abs(value)) ** 2
    return np.asarray(
        np.einsum("lr,rs->lrs", variance, np.eye(value.shape[1])), dtype=np.complex128
    )


def _speed(recording: Recording) -> float:
    """Mean speed from the tacho, else as declared [Hz]."""
    tacho = recording.tacho_signal
    if tacho is not None:
        pulses = pulse_times(tacho, recording.sample_rate)
        turns = (pulses.size - 1) / recording.pulses_per_revolution
        if turns > 0:
            return turns / float(pulses[-1] - pulses[0])
    declared = recording.declared_speed_hz
    if declared is None:
        raise DataError(
            f"{recording.source}: speed is missing, must be known for the oil films; record a "
            "tacho, or give the column speed_hz"
        )
    return declared


# --- where a channel is


def _place(channel: Channel, scene: ShaftScene) -> Place:
    """Place of a channel from its metadata, else from the scene's sensor or exciter of its name."""
    stated, axis = _stated(channel.place), _axis(channel.direction)
    if stated is not None and axis is not None:
        return _on_line(*stated, axis, scene)
    for sensor in scene.sensors:
        if sensor.name == channel.name:
            return _on_line(sensor.bearing, True, _AXES[sensor.direction], scene)
    for part in scene.exciters:
        where = _stated(part.where)
        if part.name == channel.name and where is not None:
            return _on_line(*where, _AXES[part.direction], scene)
    first = scene.bearings[0].name
    raise DataError(
        f"channel '{channel.name}': place = '{channel.place}' and direction = "
        f"'{channel.direction}' must say where it is, as 'housing of {first}' or 'shaft at "
        f"{first}' with 'vertical' or 'horizontal'; name it as a sensor or exciter of the scene"
    )


def _on_line(where: str, housing: bool, axis: str, scene: ShaftScene) -> Place:
    """Place on the line; discs and numbers are converted to stations."""
    if where in [bearing.name for bearing in scene.bearings]:
        return (where, axis, "housing") if housing else (where, axis)
    stations = {disc.name: disc.station for disc in scene.discs}
    number = re.fullmatch(r"([0-9.eE+-]+) m", where)
    if not housing and where in stations:
        return stations[where], axis
    if not housing and number is not None:
        return float(number.group(1)), axis
    known = ", ".join([bearing.name for bearing in scene.bearings] + list(stations))
    raise DataError(f"place '{where}' must be on the line of '{scene.name}': {known}; rename it")


_AXES = {"up": "y", "side": "z"}


def _axis(direction: str) -> str | None:
    words = direction.lower()
    if "vertical" in words or "up" in words.split():
        return "y"
    return "z" if "horizontal" in words or "side" in words else None


def _stated(place: str) -> tuple[str, bool] | None:
    """Name, and whether it is a housing."""
    match = re.fullmatch(r"(housing of|shaft at) (.+)", place.strip())
    return None if match is None else (match.group(2), match.group(1) == "housing of")


# --- reactions


def read_reactions(
    path: str | Path, scene: ShaftScene, *, condition: str = "cold"
) -> MeasuredReactions:
    r"""Read measured reactions from a table.

    Parameters
    ----------
    path : str or Path
        CSV with the columns ``bearing``, ``reaction_n`` or ``reaction_kn``, and ``error_n`` or
        ``error_kn``, a standard deviation; by default 5 % of the reaction, but at least 5 % of a
        tenth of the mean reaction.
    scene : ShaftScene
    condition : str
        Condition of the scene during the measurement.

    Returns
    -------
    MeasuredReactions

    Raises
    ------
    DataError
        The file cannot be read, or a column, number or bearing is invalid; all faults at once.

    Examples
    --------
    >>> import tempfile
    >>> from wearstate.sim.scene.load import load_scene
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "jacks.csv"
    ...     _ = file.write_text("bearing,reaction_kn\nsecond,0.31\n", encoding="utf-8")
    ...     found = read_reactions(file, load_scene("shaft-rig"))
    >>> found.reactions, found.deviations
    ({'second': 310.0}, {'second': 15.5})
    """
    try:
        rows = list(csv.DictReader(Path(path).read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path} cannot be read: {error}") from None
    columns = set(rows[0]) if rows else set()
    if "bearing" not in columns or not columns & {"reaction_n", "reaction_kn"}:
        raise DataError(
            f"{path}: columns = {', '.join(sorted(map(str, columns))) or 'none'} must hold bearing "
            "and reaction_n or reaction_kn; error_n or error_kn is the standard deviation"
        )
    names = [bearing.name for bearing in scene.bearings]
    faults: list[str] = []
    loads: dict[str, float] = {}
    errors: dict[str, float] = {}
    for number, row in enumerate(rows, start=2):
        name = (row["bearing"] or "").strip()
        if name not in names or name in loads:
            faults.append(
                f"{path} line {number}: bearing '{name}' must be one of {', '.join(names)}, each "
                "once; rename or remove it"
            )
            continue
        load, deviation = (_newton(row, key, f"{path} line {number}", faults) for key in _FORCES)
        if load is None:
            faults.append(f"{path} line {number}: reaction is missing; give it in N or kN")
            continue
        loads[name] = load
        if deviation is not None:
            errors[name] = deviation
    if faults:
        raise DataError("\n".join(faults))
    least = JACKING_ERROR * abs(float(np.mean(list(loads.values())))) / 10
    usual = {name: max(JACKING_ERROR * load, least) for name, load in loads.items()}
    return MeasuredReactions(reactions=loads, deviations=usual | errors, condition=condition)


_FORCES = ("reaction", "error")


def _newton(row: dict[str, str], key: str, where: str, faults: list[str]) -> float | None:
    """Force of a row [N], from its column in N or kN; None if empty."""
    for unit, factor in (("n", 1.0), ("kn", 1e3)):
        text = (row.get(f"{key}_{unit}") or "").strip()
        if not text:
            continue
        try:
            value = factor * float(text)
        except ValueError:
            value = math.nan
        if not 0 <= value < math.inf or (key == "error" and value == 0):
            bound = "> 0" if key == "error" else ">= 0"
            faults.append(f"{where}: {key}_{unit} = '{text}' must be a number {bound}")
            return 1.0
        return value
    return None
