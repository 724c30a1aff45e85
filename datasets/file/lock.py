"""One run at a time writes an output; others get an error that names it."""

import errno
import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ...sim.atomic import fresh_name
from ...sim.output.recording import DataError

try:
    import fcntl
except ImportError:  # Windows: only the lock file is used
    fcntl = None  # type: ignore[assignment]

_PATIENCE = 0.5  # s; within which a holder has written its name
_UNSUPPORTED = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL}


@contextmanager
def holding(path: Path, say: Callable[[str], None] | None = None) -> Iterator[None]:
    """Keep other runs from writing an output until this one ends or dies.

    Uses a lock of the operating system on ``<path>.lock``, which is released if the process dies.
    If the file system has no locks, ``<path>.pid`` is created instead; one left by a dead process
    of this machine is taken over.

    Parameters
    ----------
    path : Path
        Output.
    say : callable, optional
        Called with a line if the file system has no locks.

    Raises
    ------
    DataError
        If another run holds it, or the lock cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with holding(Path(folder) / "data.h5"):
    ...         print(*(path.name for path in Path(folder).iterdir()))
    ...     list(Path(folder).iterdir())
    data.h5.lock
    []
    """
    place = path.with_name(path.name + ".lock")
    try:
        handle = _locked(path, place)
        if handle is None:
            if say is not None:
                say(f"{path.parent} has no file locks: {path.name}.pid keeps other runs off")
            place = path.with_name(path.name + ".pid")
            handle = _claimed(path, place)
    except OSError as error:
        raise DataError(
            f"{path} cannot be made ({error.strerror or error}); check rights and space, or choose "
            "another folder"
        ) from error
    try:
        yield
    finally:
        with suppress(OSError):  # first the name: whoever waits for the lock checks it again
            place.unlink()
        os.close(handle)


def _locked(path: Path, place: Path) -> int | None:
    """Descriptor of the lock file, locked; None if the file system has no locks."""
    if fcntl is None:
        return None
    while True:
        handle = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _same(handle, place):
                _sign(handle)
                return handle
        except BlockingIOError:
            os.close(handle)
            raise DataError(_held(path, _signed(place))) from None
        except OSError as error:
            os.close(handle)
            if error.errno not in _UNSUPPORTED:
                raise
            place.unlink(missing_ok=True)
            return None
        os.close(handle)  # its holder has removed it meanwhile


def _same(handle: int, place: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(place))
    except FileNotFoundError:
        return False


def _claimed(path: Path, place: Path) -> int:
    """Descriptor of a file made by this process that names the holder of the output."""
    while True:
        try:
            handle = os.open(place, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        except FileExistsError:
            holder = _signed(place)
            if not _dead(holder):
                raise DataError(
                    f"{_held(path, holder)}; delete {place.name} if that run is gone"
                ) from None
            _take_away(place, holder)
        else:
            _sign(handle)
            return handle


def _take_away(place: Path, holder: dict[str, str | int]) -> None:
    """Remove the file of a dead process, but not one made meanwhile by a third process."""
    aside = fresh_name(place)
    with suppress(FileNotFoundError):
        os.rename(place, aside)
        if _signed(aside) != holder:
            os.rename(aside, place)
        aside.unlink(missing_ok=True)


def _sign(handle: int) -> None:
    text = json.dumps({"pid": os.getpid(), "host": socket.gethostname()})
    os.ftruncate(handle, 0)
    os.write(handle, text.encode())


def _signed(place: Path) -> dict[str, str | int]:
    """Holder named in a lock file; empty if it is not written within `_PATIENCE`."""
    end = time.monotonic() + _PATIENCE
    while True:
        with suppress(OSError, ValueError, KeyError, TypeError):
            found = json.loads(place.read_bytes())
            return {"pid": int(found["pid"]), "host": str(found["host"])}
        if time.monotonic() > end:
            return {}
        time.sleep(0.02)


def _dead(holder: dict[str, str | int]) -> bool:
    if os.name != "posix" or holder.get("host") != socket.gethostname():
        return False
    try:
        os.kill(int(holder["pid"]), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return False


def _held(path: Path, holder: dict[str, str | int]) -> str:
    who = f"process {holder['pid']} on {holder['host']}" if holder else "another run"
    return f"{path} is being written by {who}; wait for its end, or choose another name"
