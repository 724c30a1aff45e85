"""Outputs of commands: their suffixes, and refusals before any work.

Heavy imports stay inside the functions, so that ``--help`` answers at once.
"""

from collections.abc import Sequence
from pathlib import Path

import click

DATA_SUFFIXES, MODEL_SUFFIXES, PAGE_SUFFIXES = (".h5", ".hdf5"), (".wsm",), (".html", ".htm")
SCENE_SUFFIXES = (".toml",)
CHART_SUFFIXES = (".svg", ".png", ".pdf", ".html", ".json", ".csv")
PICTURE_SUFFIXES, TABLE_SUFFIXES = (".png", ".svg", ".pdf"), (".parquet", ".csv", ".h5")
_Output = tuple[Path | None, tuple[str, ...]]
"""A file to write (None if not requested), and the suffixes it may have."""


def check_interactive(interactive: bool, output: Path | None) -> None:
    """Refuse tappable points without a page, or without the library that draws them."""
    if not interactive:
        return
    if output is None or output.suffix not in PAGE_SUFFIXES:
        raise click.UsageError("--interactive is for a page: name one with -o, as -o page.html")
    from ..pages.embed import require_bokeh

    require_bokeh()


def check_outputs(inputs: Sequence[Path | str], outputs: Sequence[_Output], force: bool) -> None:
    """Refuse outputs that cannot or must not be written, before any work.

    Raises
    ------
    DataError
        If an output has the wrong suffix, is a folder or in none, exists and `force` is not given,
        or is the same file as an input or another output, which `force` does not override.
    """
    from ...sim.output.recording import DataError

    wanted = [(path, suffixes) for path, suffixes in outputs if path is not None]
    paths = [path for path, _ in wanted]
    faults = [fault for path, suffixes in wanted for fault in _name_faults(path, suffixes)]
    faults += [
        f"{path} is also an input, must be another file; choose another name"
        for path in paths
        if any(_same_file(path, Path(source)) for source in inputs)
    ]
    faults += [
        f"{path} is given for two outputs, must be one; choose another name"
        for number, path in enumerate(paths)
        if any(_same_file(path, other) for other in paths[:number])
    ]
    if not faults and not force:
        faults = [
            f"{path} exists; choose another name or use --force to replace it"
            for path in paths
            if path.exists()
        ]
    if faults:
        raise DataError("\n".join(faults))


def _name_faults(path: Path, suffixes: tuple[str, ...]) -> list[str]:
    if path.is_dir():
        return [f"{path} is a folder; name a file in it"]
    if path.suffix not in suffixes:
        return [f"{path}: suffix {path.suffix!r} must be one of {', '.join(suffixes)}; rename it"]
    if not path.parent.is_dir():
        return [f"{path.parent} is not a folder; create it"]
    return _unwritable(path.parent)


def refuse_unwritable(output: Path) -> None:
    """Refuse an output in a place that cannot be written, before any work.

    Raises
    ------
    DataError
        If it cannot; names the folder and the reason.
    """
    from ...sim.output.recording import DataError

    faults = _unwritable(output.parent) if output.parent.is_dir() else []
    if faults:
        raise DataError(faults[0])


def _unwritable(folder: Path) -> list[str]:
    """Reason why a folder cannot be written, by trial: a disk may be full or read-only."""
    from tempfile import TemporaryFile

    try:
        with TemporaryFile(dir=folder):
            return []
    except OSError as error:
        why = error.strerror or type(error).__name__
        return [f"{folder} cannot be written ({why}); check rights and space, or choose another"]


def _same_file(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)  # also by another link
    return one.resolve() == other.resolve()
