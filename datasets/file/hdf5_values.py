"""Small values of an HDF5 file: written, and read without trusting the file.

The HDF5 library trusts what it reads. A damaged type, or a damaged heap of texts of variable
length, can end the process or block it for ever. Types are therefore checked before values, own
texts have fixed length, and those of other programs are read in a separate process.
"""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

_READ_TEXTS = """
import json, sys, h5py
with h5py.File(sys.argv[1], "r") as file:
    found = [file[name].attrs[key] for name, key in json.load(sys.stdin)]
print(json.dumps([text if isinstance(text, str) else "" for text in found]))
"""
_LONGEST_READING = 10.0  # s; a twentieth of it is usual
_NUMBERS = (h5py.h5t.TypeIntegerID, h5py.h5t.TypeFloatID, h5py.h5t.TypeEnumID)

HDF5_FAULTS = (
    OSError,
    RuntimeError,
    KeyError,
    TypeError,
    ValueError,
    AttributeError,
    IndexError,
    OverflowError,
    NotImplementedError,
    MemoryError,
)
"""Errors raised by h5py on damaged bytes."""

Place = tuple[str, str]
"""Path of an object in the file, and name of its attribute."""


def texts_by_subprocess(path: Path, places: Sequence[Place]) -> dict[Place, str]:
    """Texts of variable length, read by another process, so that a damaged heap ends only that one.

    Parameters
    ----------
    path : Path
        File.
    places : sequence of tuple
        Attributes to read; if there are none, no process is started.

    Returns
    -------
    dict
        Texts by place; empty for anything but a single text.

    Raises
    ------
    ValueError
        If the process fails or does not end.
    """
    if not places:
        return {}
    # -P: with -c, a json.py in the current folder would be run
    command = [sys.executable, "-P", "-c", _READ_TEXTS, str(path)]
    try:
        done = subprocess.run(
            command,
            input=json.dumps(places),
            capture_output=True,
            text=True,
            check=True,
            timeout=_LONGEST_READING,
        )
        texts = json.loads(done.stdout)
    except (subprocess.SubprocessError, OSError, ValueError) as error:
        names = ", ".join(f"{name}.{key}".lstrip("/.") for name, key in places[:3])
        raise ValueError(f"the texts of {names} cannot be read ({type(error).__name__})") from error
    return dict(zip(places, texts, strict=True))


def is_loose_text(attribute: Any) -> bool:
    """Whether an attribute (h5py.h5a.AttrID) is a text of variable length."""
    kind = attribute.get_type()
    return isinstance(kind, h5py.h5t.TypeStringID) and bool(kind.is_variable_str())


def is_plain(kind: Any) -> bool:
    """Whether values of a type (h5py.h5t.TypeID) are stored inline, without a heap.

    This holds for numbers, truth values, texts of fixed length, and rows of these.
    """
    if isinstance(kind, h5py.h5t.TypeCompoundID):
        return all(is_plain(kind.get_member_type(i)) for i in range(kind.get_nmembers()))
    if isinstance(kind, h5py.h5t.TypeStringID):
        return not kind.is_variable_str()
    return isinstance(kind, _NUMBERS)


def plain_value(item: Any, key: str) -> Any:
    """One number, or a text of fixed length as bytes; None for anything else.

    Parameters
    ----------
    item : h5py.File, h5py.Group or h5py.Dataset
        Object with the attribute.
    key : str
        Name of the attribute.
    """
    if key not in item.attrs:
        return None
    attribute = item.attrs.get_id(key)
    kind = attribute.get_type()
    compound = isinstance(kind, h5py.h5t.TypeCompoundID)
    if compound or not is_plain(kind) or attribute.get_space().get_simple_extent_npoints() != 1:
        return None
    value = item.attrs[key]
    return value.reshape(-1)[0] if isinstance(value, np.ndarray) else value


def plain_values(path: Path, item: Any, where: str = "/") -> dict[str, Any]:
    """All attributes of an object: numbers, and texts decoded.

    Parameters
    ----------
    path : Path
        File.
    item : h5py.File, h5py.Group or h5py.Dataset
        Open object.
    where : str
        Path of `item` in the file.

    Raises
    ------
    ValueError
        If one is neither a number nor a text.
    """
    loose = [(where, key) for key in item.attrs if is_loose_text(item.attrs.get_id(key))]
    texts = {key: text for (_, key), text in texts_by_subprocess(path, loose).items()}
    return {key: texts[key] if key in texts else _known_value(item, key) for key in item.attrs}


def _known_value(item: Any, key: str) -> Any:
    value = plain_value(item, key)
    if value is None:
        raise ValueError(f"attribute {key!r} must be one number or one text")
    # a damaged text is detected by the hashes
    return value.decode(errors="replace") if isinstance(value, bytes) else value


def write_values(item: Any, values: Mapping[str, Any]) -> None:
    """Write attributes, texts as UTF-8 of fixed length.

    Parameters
    ----------
    item : h5py.File, h5py.Group or h5py.Dataset
        Writable object.
    values : mapping
        Numbers and texts; bytes are texts already encoded.
    """
    for name, value in values.items():
        if isinstance(value, (str, bytes)):
            raw = value.encode() if isinstance(value, str) else value
            make_room(item, name, len(raw))
            fill_room(item, name, raw)
        else:
            item.attrs[name] = value


def make_room(item: Any, name: str, n_bytes: int) -> None:
    """Create an empty text attribute that can be filled later without changing any structure.

    Parameters
    ----------
    item : h5py.File, h5py.Group or h5py.Dataset
        Writable object.
    name : str
        Name of the attribute; an existing one is replaced.
    n_bytes : int
        Longest text as UTF-8.
    """
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(n_bytes + 1)  # with its terminating zero, so that readers show no padding
    kind.set_strpad(h5py.h5t.STR_NULLTERM)
    kind.set_cset(h5py.h5t.CSET_UTF8)
    if name in item.attrs:
        del item.attrs[name]
    h5py.h5a.create(item.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
    fill_room(item, name, b"")


def fill_room(item: Any, name: str, raw: bytes) -> None:
    """Write a text into an attribute made by :func:`make_room`.

    Parameters
    ----------
    item : h5py.File, h5py.Group or h5py.Dataset
        Writable object.
    name : str
        Name of the attribute.
    raw : bytes
        The text as UTF-8.

    Raises
    ------
    ValueError
        If the reserved length is too small.
    """
    attribute = item.attrs.get_id(name)
    kind = attribute.get_type()
    room = kind.get_size() - (kind.get_strpad() == h5py.h5t.STR_NULLTERM)
    if len(raw) > room:
        raise ValueError(f"text of {name} has {len(raw)} byte, must be <= {room}")
    # the type of the file itself: the library does not convert between encodings
    attribute.write(np.array(raw, dtype=f"S{kind.get_size()}"), kind)
