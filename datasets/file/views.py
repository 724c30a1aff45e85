"""Several tests of one machine state, each in its own data set, joined to one record.

A view is one of these tests: the machine running, a shaker at one bearing, the same at another.
Records of two sets belong together if machine and state are the same.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, Recording
from .attributes import Attributes
from .record import DataSet

VIEW, STATE = "view", "state"
"""Manifest columns: the test that a record belongs to, and the state of its machine."""

MARK = ":"
"""Separator between the name of a view and that of a feature."""


@dataclass(frozen=True, order=True)
class CompletingView:
    """A data set that completes the records of another.

    Attributes
    ----------
    name : str
        Prefix of the names of its features.
    path : Path
    """

    name: str
    path: Path

    @classmethod
    def from_text(cls, text: str) -> Self:
        """View from ``NAME=FILE`` or ``FILE``; without a name, manifest or file name gives it.

        Raises
        ------
        DataError
            If the file is not a data set, holds several views, or the name has a reserved
            character.

        Examples
        --------
        >>> CompletingView.from_text("running=turning.h5").name
        'running'
        """
        name, sign, file = text.partition("=")
        path = Path(file if sign else text)
        name = name if sign else _name_in(path)
        if not name or set(name) & set(f"{MARK}./ ,"):
            raise DataError(
                f"view = {name!r} must be a word without '{MARK}', '.', '/', ',' and blanks; name "
                "it: NAME=FILE"
            )
        return cls(name, path)


def _name_in(path: Path) -> str:
    with DataSet(path) as data:
        names = sorted(set(_texts(data, VIEW)))
    if len(names) > 1:
        raise DataError(
            f"{path}: {len(names)} views ({', '.join(names[:4])}), must be one; import each into a "
            "file of its own"
        )
    return (names or [""])[0] or path.stem


def views_of(texts: Sequence[str]) -> tuple[CompletingView, ...]:
    """Views given on the command line; see :meth:`CompletingView.from_text`.

    Raises
    ------
    DataError
        If two have the same name.
    """
    found = tuple(CompletingView.from_text(text) for text in texts)
    twice = [name for name, count in Counter(view.name for view in found).items() if count > 1]
    if twice:
        raise DataError(f"views named {', '.join(twice)} are given twice; name them: NAME=FILE")
    return found


def _texts(data: DataSet, column: str) -> list[str]:
    """A manifest column as texts; empty if there is none."""
    if column not in (data.rows.dtype.names or ()):
        return []
    return [str(value) for value in data.manifest[column].tolist()]


def _keys(data: DataSet) -> list[tuple[str, str]]:
    """Machine and state of each record.

    Raises
    ------
    DataError
        If the set does not name them.
    """
    states = _texts(data, STATE)
    if not states and data.attributes.recipe:
        states = _texts(data, "record_id")  # record i of every view has the same state
    if not states or "" in states or "" in data.machines:
        raise DataError(
            f"{data.path}: its records do not name machine and state, which joining needs; import "
            "with the labels group and state"
        )
    return list(zip(data.machines, states, strict=True))


@dataclass(frozen=True)
class JoinedSet:
    """A data set whose records include those of its views.

    Attributes
    ----------
    path : Path
        The data set; its manifest is that of the whole.
    views : tuple of CompletingView
        Views to join; may be empty.

    Raises
    ------
    DataError
        On first use: if a set cannot be read, does not name machine and state, or has two usable
        records of one state.
    """

    path: Path
    views: tuple[CompletingView, ...] = ()

    @cached_property
    def data(self) -> DataSet:
        """The data set itself."""
        return DataSet(self.path)

    @cached_property
    def _others(self) -> dict[str, tuple[DataSet, NDArray[np.intp]]]:
        """Data set of each view, and its record number for each record here; -1 if it has none."""
        if not self.views:
            return {}
        sets = {view.name: DataSet(view.path) for view in self.views}
        if len(self.data) == 1 and all(len(other) == 1 for other in sets.values()):
            for name, other in sets.items():
                joined_recordings(self.data[0], {name: other[0]})  # refuses another machine
            return {name: (other, np.zeros(1, dtype=np.intp)) for name, other in sets.items()}
        return self._by_state(sets)

    def _by_state(self, sets: Mapping[str, DataSet]) -> dict[str, tuple[DataSet, NDArray[np.intp]]]:
        mine = _keys(self.data)
        if len(set(mine)) < len(mine):
            raise DataError(
                f"{self.path}: {len(mine) - len(set(mine))} records repeat machine and state, must "
                "be 0 to be joined; give each state a name of its own"
            )
        found = {}
        for name, other in sets.items():
            found[name] = other, _places(other, mine)
            if not (found[name][1] >= 0).any():
                raise DataError(
                    f"{other.path}: 0 of its {len(other)} records are of a machine and state of "
                    f"{self.path}, must be >= 1; generate both by one recipe and seed, or import "
                    "both with the same labels group and state"
                )
        return found

    @property
    def layouts(self) -> dict[str, Attributes]:
        """Properties common to all records of each view."""
        return {name: other.attributes for name, (other, _) in self._others.items()}

    @cached_property
    def complete(self) -> NDArray[np.bool_]:
        """Whether a record has every view [shape=(n_records,)]."""
        here = [places >= 0 for _, places in self._others.values()]
        return np.asarray(np.all([np.ones(len(self.data), dtype=bool), *here], axis=0))

    def lacks(self, view: str) -> NDArray[np.bool_]:
        """Whether a record has no usable counterpart in a view [shape=(n_records,)]."""
        return np.asarray(self._others[view][1] < 0)

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """Views that a usable record lacks."""
        usable = (self.data.manifest["status"] == "ok").to_numpy()
        return tuple(name for name in self._others if (usable & self.lacks(name)).any())

    def __getitem__(self, index: int) -> Recording:
        """A record with those of its views; missing ones are left out."""
        joined = {
            name: other[int(places[index])]
            for name, (other, places) in self._others.items()
            if places[index] >= 0
        }
        recording = self.data[index]
        return replace(recording, joined=joined) if joined else recording

    def close(self) -> None:
        """Close the files; reading opens them again."""
        for data in (self.data, *(other for other, _ in self._others.values())):
            data.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _places(other: DataSet, wanted: Sequence[tuple[str, str]]) -> NDArray[np.intp]:
    """Number in a set of the usable record of each machine and state; -1 if there is none."""
    usable = (other.manifest["status"] == "ok").to_numpy()
    keys = [key for key, sound in zip(_keys(other), usable, strict=True) if sound]
    if len(set(keys)) < len(keys):
        raise DataError(
            f"{other.path}: {len(keys) - len(set(keys))} records repeat machine and state, must be "
            "0 to be joined; give each state a name of its own"
        )
    place = dict(zip(keys, np.flatnonzero(usable).tolist(), strict=True))
    return np.array([place.get(key, -1) for key in wanted], dtype=np.intp)


def joined_recordings(recording: Recording, others: Mapping[str, Recording]) -> Recording:
    """A recording with further tests of the same machine state.

    Parameters
    ----------
    recording : Recording
    others : mapping
        Recordings by name of the view.

    Returns
    -------
    Recording

    Raises
    ------
    DataError
        If one is known to be of another machine or state.
    """
    for name, other in others.items():
        machines = (recording.machine, other.machine)
        states = tuple(str(each.row.get(STATE, "")) for each in (recording, other))
        for what, (one, two) in (("machine", machines), ("state", states)):
            if one and two and one != two:
                raise DataError(
                    f"{other.source}: view {name} is of {what} {two!r}, must be of {one!r} as "
                    f"{recording.source}; join tests of one machine and state"
                )
    return replace(recording, joined=dict(others))


def layout_card(head: Attributes) -> dict[str, Any]:
    """Properties that a recording must have to match a layout, as plain values."""
    return {
        "channels": [dict(vars(channel)) for channel in head.channels],
        "sample_rate_hz": head.sample_rate,
        "tacho": head.tacho,
        "pulses_per_revolution": head.pulses_per_revolution,
    }
