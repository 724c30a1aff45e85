"""Machine of each record, as far as its data set identifies it."""

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...sim.scene.load import scene_table
from ...sim.scene.scene import SceneError

FILE, GROUP_NAME = "file", "group_name"
"""Manifest columns of an imported record: its file, and the name of its machine."""

_NO_NAMES = ("", ".")  # of a machine: the folder of a file that lies in none


def machine_origin(recipe: str, seed: int) -> tuple[str, int] | None:
    """Origin of the machines of a simulated set: equal groups of equal origin are one machine.

    Parameters
    ----------
    recipe : str
        TOML text of the data set's recipe; empty if it has none.
    seed : int
        Seed of the data set.

    Returns
    -------
    tuple of (str, int) or None
        Name of the recipe that draws the machines, as JSON, and seed; None for a measured set.

    Examples
    --------
    >>> machine_origin("machines_of = 'new'", 3)
    ('"new"', 3)
    """
    if not recipe:
        return None
    try:
        table = scene_table(recipe, "recipe")
    except SceneError:
        return None
    name = table.get("machines_of") or table.get("name")
    return None if not name else (json.dumps(name), seed)


def machine_identities(rows: NDArray[np.void], recipe: str, seed: int) -> tuple[str, ...]:
    """Identity of the machine of each record: equal texts are one machine, in any file.

    Parameters
    ----------
    rows : numpy.ndarray [shape=(n_records,)]
        Manifest, structured as in the file.
    recipe : str
        As for :func:`machine_origin`.
    seed : int
        As for :func:`machine_origin`.

    Returns
    -------
    tuple of str
        Draw of a recipe under a seed, or the name given on import. Empty if unknown: a group number
        alone is no identity, nor is the name of a file, since any folder may contain it.

    Examples
    --------
    >>> rows = np.array([(7, b"a.wav", b"north")], "i8,S9,S9")
    >>> rows.dtype.names = "group", "file", "group_name"
    >>> machine_identities(rows, "", 0), machine_identities(rows, "name = 'new'", 3)
    (('machine north',), ('machine 7 of recipe "new", seed 3',))
    """
    origin = machine_origin(recipe, seed)
    if origin is not None:
        drawn = f"of recipe {origin[0]}, seed {origin[1]}"
        return tuple(f"machine {group} {drawn}" for group in rows["group"].tolist())
    columns = rows.dtype.names or ()
    if GROUP_NAME not in columns:
        return ("",) * len(rows)
    names = _texts(rows[GROUP_NAME].tolist())
    files = _texts(rows[FILE].tolist()) if FILE in columns else ("",) * len(rows)
    return tuple(
        "" if name in (*_NO_NAMES, file) else f"machine {name}"
        for name, file in zip(names, files, strict=True)
    )


def _texts(values: Sequence[bytes | str]) -> tuple[str, ...]:
    return tuple(v.decode(errors="replace") if isinstance(v, bytes) else str(v) for v in values)
