"""MATLAB files of any level: 4, and 5 to 7, read here; 7.3 is HDF5 inside."""

from pathlib import Path

from ..source.part import Contents, SourceOptions
from .hdf5 import mat73_contents
from .mat4 import is_mat4, mat4_tree
from .mat5 import mat5_tree
from .mat_tree import tree_contents

_HEADER = 128  # byte, of a text and the version
_HDF5_HEAD = b"\x89HDF\r\n\x1a\n"
_HDF5_AT = 512  # byte; MATLAB 7.3 leaves this space for the header
_HDF5_VERSION = (b"\x00\x02IM", b"\x02\x00MI")
"""Version 2.0 and byte order, at the end of the header: its text may name another level."""


def mat_contents(path: Path, options: SourceOptions) -> Contents:
    """Arrays of a MATLAB file; a known layout declares its rate and unit.

    Raises
    ------
    DataError
        If it is not a MATLAB file or damaged.
    """
    with path.open("rb") as handle:
        head = handle.read(_HDF5_AT + len(_HDF5_HEAD))
    if head[_HDF5_AT:] == _HDF5_HEAD or head[124:_HEADER] in _HDF5_VERSION:
        return mat73_contents(path, options)
    if is_mat4(head):
        return tree_contents(path, mat4_tree(path), options)
    return tree_contents(path, mat5_tree(path), options)
