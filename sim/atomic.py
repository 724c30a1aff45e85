"""Files that appear whole or not at all, each written first under a unique temporary name.

Uses the standard library only.
"""

import errno
import hashlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_NAME_KEPT = 60  # characters; a file system allows 255 bytes, and a character may take four


class OutputError(ValueError):
    """A finished output cannot be put in place; the message gives its location and the cure."""


def fresh_name(path: Path, ending: str = "tmp") -> Path:
    """Name next to a file that no other run uses.

    A run that is killed leaves ``NAME.xxxxxxxx.tmp`` behind: no reader takes it for a recording,
    it does not disturb later runs, and it may be deleted.

    Examples
    --------
    >>> fresh_name(Path("a.csv")).suffix, fresh_name(Path("a.csv")) == fresh_name(Path("a.csv"))
    ('.tmp', False)
    """
    return path.with_name(f"{path.name[:_NAME_KEPT]}.{secrets.token_hex(4)}.{ending}")


@contextmanager
def replacing(path: Path, *, force: bool) -> Iterator[Path]:
    """Provide a temporary name for a file or folder, and move it into place at the end.

    Parameters
    ----------
    path : Path
        Output.
    force : bool
        Replace an existing output, including one that appeared meanwhile.

    Yields
    ------
    Path
        Unused path. What is written there is removed if the block fails.

    Raises
    ------
    OutputError
        The output appeared meanwhile.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt", force=False) as fresh:
    ...         _ = fresh.write_text("whole")
    ...     [path.name for path in Path(folder).iterdir()]
    ['a.txt']
    """
    fresh = fresh_name(path)
    try:
        yield fresh
        put_in_place(fresh, path, force=force)
    except OutputError:
        raise  # keep the work of the run
    except BaseException:
        _remove(fresh)
        raise


def write_whole(path: Path, content: bytes, *, force: bool) -> None:
    """Write a file whole or not at all; see :func:`replacing`."""
    with replacing(path, force=force) as fresh:
        fresh.write_bytes(content)


def put_in_place(fresh: Path, path: Path, *, force: bool) -> None:
    """Rename a finished file or folder; an existing one is replaced without a gap.

    Parameters
    ----------
    fresh : Path
        Next to `path`.
    path : Path
        Final name.
    force : bool
        Replace an existing output. A folder is first renamed and removed at the end.

    Raises
    ------
    OutputError
        The output exists and `force` is not given; `fresh` stays.
    """
    if fresh.is_file():
        with fresh.open("r+b") as handle:
            os.fsync(handle.fileno())  # a power cut must not leave the name without the content
    if not force:
        _put_new(fresh, path)
    elif fresh.is_dir() and path.exists():
        _put_aside(fresh, path)
    else:
        os.replace(fresh, path)


def _put_new(fresh: Path, path: Path) -> None:
    try:
        if fresh.is_dir():
            os.rename(fresh, path)  # replaces an empty folder
            return
        _link(fresh, path)
        fresh.unlink(missing_ok=True)
    except OSError as error:
        if error.errno not in (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR):
            raise
        raise OutputError(
            f"{path} has appeared during the run and is not replaced; the result is kept as "
            f"{fresh.name}: rename it, or use force from the start"
        ) from None


def _link(fresh: Path, path: Path) -> None:
    """Add a second name to a file unless it is taken: renaming would replace."""
    try:
        os.link(fresh, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: claim the name, then replace the claim
        path.open("xb").close()
        os.replace(fresh, path)


def _put_aside(fresh: Path, path: Path) -> None:
    old = fresh_name(path, "old")
    try:
        os.rename(path, old)
        os.rename(fresh, path)
    except BaseException:
        if old.exists() and not path.exists():
            os.rename(old, path)
        raise
    _remove(old)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


# --- content that shows whether it is whole -------------------------------------------------------

_DIGEST = hashlib.sha256().digest_size


def sealed(content: bytes) -> bytes:
    """Content preceded by its SHA-256.

    Examples
    --------
    >>> unsealed(sealed(b"kernel")), unsealed(sealed(b"kernel")[:-1]), unsealed(b"")
    (b'kernel', None, None)
    """
    return hashlib.sha256(content).digest() + content


def unsealed(stored: bytes) -> bytes | None:
    """Content of a :func:`sealed` text; None if it is cut or altered."""
    content = stored[_DIGEST:]
    return content if sealed(content) == stored else None
