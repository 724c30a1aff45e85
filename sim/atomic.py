"""Files that appear whole or not at all, each made under a name that no other run uses.

Of the standard library only.
"""

import errno
import hashlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_NAME_KEPT = 60  # characters; a file system takes 255 byte, of which one character may need four


class OutputError(ValueError):
    """A finished output may not be put in its place; names it, where it is kept, and the cure."""


def fresh_name(path: Path, ending: str = "tmp") -> Path:
    """Name beside a file that no other run uses.

    A run that is killed leaves ``NAME.xxxxxxxx.tmp`` behind: no reader takes it for a recording,
    no later run stumbles over it, and it may be deleted.

    Examples
    --------
    >>> fresh_name(Path("a.csv")).suffix, fresh_name(Path("a.csv")) == fresh_name(Path("a.csv"))
    ('.tmp', False)
    """
    return path.with_name(f"{path.name[:_NAME_KEPT]}.{secrets.token_hex(4)}.{ending}")


@contextmanager
def replacing(path: Path, *, force: bool) -> Iterator[Path]:
    """Give a fresh name to write a file or folder under, and put that in place at the end.

    Parameters
    ----------
    path : Path
        Output.
    force : bool
        Replace what is there at the end, also what appeared meanwhile.

    Yields
    ------
    Path
        Nothing is there yet. What is written there is removed where the block fails.

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
        raise  # the work of the run is kept
    except BaseException:
        _remove(fresh)
        raise


def write_whole(path: Path, content: bytes, *, force: bool) -> None:
    """Write a file whole, or not at all; see :func:`replacing`."""
    with replacing(path, force=force) as fresh:
        fresh.write_bytes(content)


def put_in_place(fresh: Path, path: Path, *, force: bool) -> None:
    """Give a finished file or folder its name; what had it before is lost at no instant.

    Parameters
    ----------
    fresh : Path
        Beside `path`.
    path : Path
        Its name from now on.
    force : bool
        Replace what is there. A folder is put aside first and removed last.

    Raises
    ------
    OutputError
        There is something and `force` is not given; `fresh` stays.
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
            os.rename(fresh, path)  # an empty folder gives way
            return
        _link(fresh, path)
        fresh.unlink(missing_ok=True)
    except OSError as error:
        if error.errno not in (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR):
            raise
        raise OutputError(
            f"{path} has appeared during the run and is not replaced; what was made is kept as "
            f"{fresh.name}: rename it, or use force from the start"
        ) from None


def _link(fresh: Path, path: Path) -> None:
    """Second name of a file, only where there is none: renaming would replace."""
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


# --- content that tells whether it is whole -------------------------------------------------------

_DIGEST = hashlib.sha256().digest_size


def sealed(content: bytes) -> bytes:
    """Content behind its SHA-256.

    Examples
    --------
    >>> unsealed(sealed(b"kernel")), unsealed(sealed(b"kernel")[:-1]), unsealed(b"")
    (b'kernel', None, None)
    """
    return hashlib.sha256(content).digest() + content


def unsealed(stored: bytes) -> bytes | None:
    """Content that :func:`sealed` was given; None where it is cut or altered."""
    content = stored[_DIGEST:]
    return content if sealed(content) == stored else None
