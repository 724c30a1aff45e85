"""MATLAB files of any level: 5 to 7 read here, 7.3 being HDF5 inside."""

from pathlib import Path

from .source_hdf5 import mat73_contents
from .source_mat5 import mat5_tree
from .source_mat_tree import tree_contents
from .source_part import Contents, SourceOptions

_LEVEL_7_3 = b"MATLAB 7.3"


def mat_contents(path: Path, options: SourceOptions) -> Contents:
    """Arrays of a MATLAB file; a known layout declares its rate and unit.

    Raises
    ------
    DataError
        It is no MATLAB file or damaged.
    """
    with path.open("rb") as handle:
        head = handle.read(len(_LEVEL_7_3))
    if head == _LEVEL_7_3:
        return mat73_contents(path, options)
    return tree_contents(path, mat5_tree(path), options)
