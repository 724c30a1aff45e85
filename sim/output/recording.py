"""A recording, simulated or measured: signals and all data needed to interpret them."""

import html
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .sensor import Channel, rate_fault
from .spellings import spellings
from .status import Status

Origin = Literal["simulated", "measured"]


class Table(Protocol):
    """Interface of a pandas.DataFrame, which tables of other libraries also have."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def to_numpy(self) -> Any:
        """Values [shape=(n_rows, n_columns)]."""


class DataError(ValueError):
    """A data set or recording cannot be used; the message gives quantity, value, bound and cure."""


def missing_file(path: Path, cure: str = "check the path") -> str:
    """Why nothing can be read at a path: it is a folder, missing, or not a file.

    Examples
    --------
    >>> missing_file(Path("no.h5"))
    'no.h5: no such file; check the path'
    """
    if path.is_dir():
        return f"{path} is a folder, must be a file; name a file in it"
    if not os.path.lexists(path):
        return f"{path}: no such file; {cure}"
    return f"{path} is no file; {cure}"


@dataclass(frozen=True, kw_only=True)
class SignalLayout:
    """Layout of a signal: sample rate, channels, tacho.

    Parameters
    ----------
    sample_rate : float
        Sampling rate [Hz].
    channels : tuple of Channel
        One per row of a signal, names unique.
    tacho : str, optional
        Name of the tacho channel.
    pulses_per_revolution : int
        Pulses per revolution of the tacho.
    origin : {"simulated", "measured"}
        Origin of the signals.

    Examples
    --------
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> SignalLayout(sample_rate=100.0, channels=(channel,)).names
    ('acc',)
    """

    sample_rate: float
    channels: tuple[Channel, ...]
    tacho: str | None = None
    pulses_per_revolution: int = 1
    origin: Origin = "measured"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all channels."""
        return tuple(channel.name for channel in self.channels)

    @property
    def units(self) -> dict[str, str]:
        """Units of all channels, by name."""
        return {channel.name: channel.unit for channel in self.channels}

    @property
    def vibration_channels(self) -> tuple[Channel, ...]:
        """All channels except the tacho."""
        return tuple(channel for channel in self.channels if channel.name != self.tacho)

    @property
    def vibration_names(self) -> tuple[str, ...]:
        """Names of all channels except the tacho."""
        return tuple(channel.name for channel in self.vibration_channels)

    @property
    def vibration_quantities(self) -> tuple[str, ...]:
        """Quantities of all channels except the tacho."""
        return tuple(channel.quantity for channel in self.vibration_channels)

    def refuse_contradictions(self, where: str) -> None:
        """Raise DataError if sample rate, channel names or tacho contradict each other."""
        names = list(self.names)
        faults = []
        if fault := rate_fault("sample_rate", self.sample_rate, "give it in Hz"):
            faults.append(fault)
        if not names or len(set(names)) != len(names):
            faults.append(f"channel names {names} must be unique and at least one; rename them")
        if self.tacho is not None and self.tacho not in names:
            faults.append(f"tacho = {self.tacho!r} must be one of the channels {names}; rename it")
        if self.pulses_per_revolution < 1:
            faults.append(f"pulses_per_revolution = {self.pulses_per_revolution} must be >= 1")
        if self.origin not in ("simulated", "measured"):
            faults.append(f"origin = {self.origin!r} must be 'simulated' or 'measured'")
        if faults:
            raise DataError("\n".join(f"{where}: {fault}" for fault in faults))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Recording(SignalLayout):
    """A recording, simulated or measured, with all data needed to interpret it.

    Returned by :func:`wearstate.simulate` and :func:`wearstate.read_recording`, and accepted by
    features, models, reports and plots. :meth:`from_array` converts arrays and tables.

    Parameters
    ----------
    sample_rate : float
        Samples per second [Hz].
    channels : tuple of Channel
        One per row of the signal, names unique.
    tacho : str, optional
        Name of the tacho channel.
    pulses_per_revolution : int
        Pulses per revolution of the tacho.
    origin : {"simulated", "measured"}
        Origin of the signals.
    signal : ndarray of shape (n_channels, n_samples)
        Finite, in the unit of each channel; stored as float32.
    row : mapping
        Manifest values: conditions, severities, grade, numerics; may be empty.
    source : str
        File or scene, for messages and reports.
    machine : str
        Identity of the machine, see :func:`~.file.machines.machine_identities`; empty if
        unknown.
    joined : mapping
        Further tests of the same machine state, by name of the view.
    status : Status
        How a simulated run ended; always OK for a measured recording.
    warnings : tuple of str
        Warnings about a run that did not fail.
    truth : mapping of str to ndarray
        Quantities known only to the simulator, with `time` as first dimension; empty unless
        requested.
    numerics : mapping
        Rungs, step, step count and guards of a simulated run; no wall time.

    Raises
    ------
    DataError
        Shape, sample rate, names or tacho are inconsistent, or a sample is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> recording = Recording(signal=np.zeros((1, 8)), sample_rate=100.0, channels=(channel,))
    >>> recording.duration, recording
    (0.08, <Recording 0.08 s, 100 Hz, acc>)
    """

    signal: NDArray[np.float32]
    row: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""
    machine: str = ""
    joined: Mapping[str, "Recording"] = field(default_factory=dict)
    status: Status = Status.OK
    warnings: tuple[str, ...] = ()
    truth: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    numerics: dict[str, float | int | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = np.shape(self.signal)
        if len(shape) != 2 or shape[0] != len(self.channels) or 0 in shape:
            raise DataError(
                f"{self.source or 'recording'}: signal has shape {shape}, must be "
                f"({len(self.channels)} channels, >= 1 samples); transpose it or name its channels"
            )
        self.refuse_contradictions(self.source or "recording")
        with np.errstate(over="ignore"):  # values too large for float32 become inf, refused below
            object.__setattr__(self, "signal", np.asarray(self.signal, dtype=np.float32))
        _refuse_gaps(self)

    @classmethod
    def from_array(
        cls,
        data: ArrayLike | Table,
        fs: float,
        channels: Sequence[str | Channel] | None = None,
        *,
        unit: str | Mapping[str, str] = "m/s^2",
        tacho: str | None = None,
        pulses_per_revolution: int = 1,
        source: str = "",
    ) -> Self:
        """Recording from an array, or from a table with one column per channel.

        Parameters
        ----------
        data : array_like of shape (n_channels, n_samples) or (n_samples,), or pandas.DataFrame
            Signals in SI units. A table has samples in rows, and its columns name the
            channels.
        fs : float
            Sample rate [Hz].
        channels : sequence of str or Channel, optional
            Names of the rows; for a table, the columns to use. By default ``ch_0``, ``ch_1``, …, or
            all columns.
        unit : str or mapping
            SI unit of all channels, or by name of channel, in any spelling (``m/s²``, ``m/s**2``);
            the quantity follows from it.
        tacho : str, optional
            Name of the tacho channel, in volts unless `unit` says otherwise.
        pulses_per_revolution : int
            Pulses per revolution of the tacho.
        source : str
            For messages and reports.

        Returns
        -------
        Recording

        Raises
        ------
        DataError
            The numbers of names and rows differ, a column is missing or not numeric, a unit is
            unknown, or as for the class itself.

        Examples
        --------
        >>> signal = np.zeros((2, 1000))
        >>> Recording.from_array(signal, 1000.0, ["acc", "tacho"], tacho="tacho")
        <Recording 1 s, 1 kHz, acc tacho>
        >>> import pandas as pd
        >>> Recording.from_array(pd.DataFrame({"x": [0.0, 1.0], "y": [0.0, 2.0]}), 10.0).names
        ('x', 'y')
        """
        signal, names = _rows_of(data, channels, source or "recording")
        return cls(
            signal=signal,
            sample_rate=float(fs),
            channels=_channels(names, unit, tacho, source or "recording"),
            tacho=tacho,
            pulses_per_revolution=pulses_per_revolution,
            source=source,
        )

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.signal.shape[1] / self.sample_rate)

    @cached_property
    def time(self) -> NDArray[np.float64]:
        """Time of every sample, of signal and truth [s, shape=(n_samples,)]."""
        return np.asarray(np.arange(self.signal.shape[1]) / self.sample_rate)

    @property
    def vibration(self) -> NDArray[np.float32]:
        """All channels except the tacho [shape=(n_vibration, n_samples)]."""
        rows = [i for i, name in enumerate(self.names) if name != self.tacho]
        return self.signal[rows]

    @property
    def declared_speed_hz(self) -> float | None:
        """Shaft speed from the manifest: the record's mean, else as set [Hz]; None without one."""
        known = {**self.numerics, **self.row}
        declared = (float(known.get(name, math.nan)) for name in ("mean_speed_hz", "speed_hz"))
        return next((speed for speed in declared if 0 < speed < math.inf), None)

    @property
    def tacho_signal(self) -> NDArray[np.float32] | None:
        """Signal of the tacho [shape=(n_samples,)], None without one."""
        return None if self.tacho is None else self[self.tacho]

    def __getitem__(self, name: str) -> NDArray[np.float32]:
        """Signal of a channel by its name [shape=(n_samples,)]; KeyError lists the names."""
        if name not in self.names:
            raise KeyError(f"channel {name!r} must be one of {', '.join(self.names)}")
        row: NDArray[np.float32] = self.signal[self.names.index(name)]
        return row

    def plot(self, *, ax: Any = None) -> Any:
        """Draw every channel over time, in axes below each other.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            One for each channel; a new figure by default.

        Returns
        -------
        numpy.ndarray of matplotlib.axes.Axes, shape (n_channels,)

        Examples
        --------
        >>> recording = Recording.from_array(np.sin(np.arange(99.0)), 10.0, ["acc"])
        >>> recording.plot()[0].get_ylabel()
        'acc [m/s^2]'
        """
        if ax is None:
            from matplotlib import pyplot as plt

            size = (8.0, 1.2 + 1.3 * len(self.channels))
            _, ax = plt.subplots(
                len(self.channels), squeeze=False, sharex=True, figsize=size, layout="constrained"
            )
        axes = np.ravel(ax)
        for each, channel, row in zip(axes, self.channels, self.signal, strict=True):
            each.plot(self.time, row, lw=0.6)
            each.set_ylabel(f"{channel.name} [{channel.unit}]")
            each.margins(x=0)
            each.grid(alpha=0.3)
        axes[0].set_title(f"{self.source or 'recording'} ({self.origin})")
        axes[-1].set_xlabel("time [s]")
        return axes

    def __repr__(self) -> str:
        """Source, length, rate and channels; the status of a failed run."""
        return f"<Recording {self._heading}, {' '.join(self.names)}>"

    @property
    def _heading(self) -> str:
        name = f"{self.source} " if self.source else ""
        failed = "" if self.status.ok else f", {self.status}"
        return f"{name}{extent_text(self.duration, self.sample_rate)}{failed}"

    def _repr_html_(self) -> str:
        """For notebooks: the channels with quantity, unit and rms about the mean."""
        cells = [
            (c.name, c.quantity, c.place, f"{float(row.std()):.4g} {c.unit}")
            for c, row in zip(self.channels, self.signal, strict=True)
        ]
        head = f"{self._heading}, {self.origin}"
        return html_table(head, ("channel", "quantity", "place", "rms about the mean"), cells)


def extent_text(duration: float, sample_rate: float) -> str:
    """Duration [s] and sample rate [Hz] of a recording, in words.

    Examples
    --------
    >>> extent_text(1.0, 25600.0)
    '1 s, 25.6 kHz'
    """
    thousand = sample_rate >= 1000
    rate = f"{sample_rate / 1000:.6g} kHz" if thousand else f"{sample_rate:.6g} Hz"
    return f"{duration:.4g} s, {rate}"


def html_table(heading: str, head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A heading and a table as HTML for notebooks, everything escaped.

    Examples
    --------
    >>> html_table("a < b", ["x"], [[1]])
    '<p><b>a &lt; b</b></p><table><tr><th>x</th></tr><tr><td>1</td></tr></table>'
    """

    def line(tag: str, cells: Sequence[object]) -> str:
        return f"<tr>{''.join(f'<{tag}>{html.escape(str(c))}</{tag}>' for c in cells)}</tr>"

    body = "".join(line("td", cells) for cells in rows)
    return f"<p><b>{html.escape(heading)}</b></p><table>{line('th', head)}{body}</table>"


# --- from arrays and tables


def as_recording(
    data: Recording | ArrayLike | Table,
    fs: float | None = None,
    channels: Sequence[str | Channel] | None = None,
    **about: Any,
) -> Recording:
    """Return a recording unchanged; convert an array or a table to one.

    Parameters
    ----------
    data : Recording, array_like or pandas.DataFrame
        See :meth:`Recording.from_array`.
    fs : float, optional
        Sample rate of an array or a table [Hz]; a recording has its own.
    channels : sequence of str or Channel, optional
        Channels of an array or a table; a recording has its own.
    **about
        See :meth:`Recording.from_array`.

    Raises
    ------
    DataError
        `fs` is missing, or given with a recording, or as in :meth:`Recording.from_array`.

    Examples
    --------
    >>> as_recording(np.zeros(8), 10.0)
    <Recording 0.8 s, 10 Hz, ch_0>
    """
    if isinstance(data, Recording):
        if fs is not None or channels is not None:
            raise DataError("fs and channels must be left out; the recording has its own")
        return data
    if fs is None:
        raise DataError("fs = None must be given with an array or table; give it in Hz")
    return Recording.from_array(data, fs, channels, **about)


_QUANTITIES = {
    "m/s^2": "acceleration",
    "m/s": "velocity",
    "m": "displacement",
    "N": "force",
    "Pa": "pressure",
    "V": "voltage",
}
"""SI unit -> its quantity."""


def _rows_of(
    data: Any, channels: Sequence[str | Channel] | None, where: str
) -> tuple[NDArray[Any], list[str | Channel]]:
    """Signals by channel, and their names or channels."""
    if hasattr(data, "columns") and hasattr(data, "to_numpy"):
        return _columns_of(data, channels, where)
    signal = np.atleast_2d(np.asarray(data))
    if signal.ndim != 2 or signal.dtype.kind not in "fiu":
        raise DataError(
            f"{where}: data has shape {signal.shape} and type {signal.dtype}, must be real numbers "
            "of shape (n_channels, n_samples); give one recording at a time"
        )
    if channels is None and len(signal) > signal.shape[1]:
        raise DataError(
            f"{where}: data has shape {signal.shape}, must be (n_channels, n_samples); transpose it"
        )
    names = channels or [f"ch_{i}" for i in range(len(signal))]
    return signal, list(names)


def _columns_of(
    table: Any, channels: Sequence[str | Channel] | None, where: str
) -> tuple[NDArray[Any], list[str | Channel]]:
    names = list(table.columns) if channels is None else list(channels)
    labels = [name.name if isinstance(name, Channel) else name for name in names]
    faults = [f"column {name!r} must be there; rename one" for name in labels if name not in table]
    faults += [f"column name {name!r} must be a text" for name in labels if type(name) is not str]
    faults += [
        f"column {name!r} holds {table[name].dtype}, must hold real numbers; leave it out"
        for name in labels
        if name in table and table[name].to_numpy().dtype.kind not in "fiu"
    ]
    if faults:
        raise DataError("\n".join(f"{where}: {fault}" for fault in faults))
    return table[labels].to_numpy().T, names


def _channels(
    names: Sequence[str | Channel], unit: str | Mapping[str, str], tacho: str | None, where: str
) -> tuple[Channel, ...]:
    found, faults = [], []
    for name in names:
        if isinstance(name, Channel):
            found.append(name)
            continue
        known = unit.get(name) if isinstance(unit, Mapping) else None if name == tacho else unit
        listed = _listed(known or ("V" if name == tacho else ""))
        if name != tacho and listed not in _QUANTITIES:
            faults.append(
                f"unit of channel {name!r} = {listed!r} must be of {', '.join(_QUANTITIES)}; "
                "convert it to SI, or give a Channel"
            )
        quantity = "tacho" if name == tacho else _QUANTITIES.get(listed, "")
        found.append(Channel(name=name, unit=listed, quantity=quantity))
    if faults:
        raise DataError("\n".join(f"{where}: {fault}" for fault in faults))
    return tuple(found)


def _listed(unit: str) -> str:
    """An SI unit in the listed spelling; others unchanged.

    Examples
    --------
    >>> _listed("m/s²"), _listed("furlong")
    ('m/s^2', 'furlong')
    """
    text = unit.strip()
    return next((each for each in _QUANTITIES if re.fullmatch(spellings(each), text)), unit)


def _refuse_gaps(recording: Recording) -> None:
    if np.isfinite(recording.signal).all():
        return
    faults = []
    for name, row in zip(recording.names, recording.signal, strict=True):
        bad = np.flatnonzero(~np.isfinite(row))
        if bad.size:
            faults.append(
                f"{recording.source or 'recording'}: channel '{name}' has {bad.size} sample(s) "
                f"that are not finite, must be 0, first at index {bad[0]}; cut or repair the gap"
            )
    raise DataError("\n".join(faults))


Recorder = Callable[[Any, int, bool, bool], Recording]
"""Makes a recording of a scene: scene, seed, with its truth, raise on failure."""
