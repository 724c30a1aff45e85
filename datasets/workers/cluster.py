"""Workers of an existing Dask cluster."""

import asyncio
import concurrent.futures
import hashlib
import importlib
import logging
import platform
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from ... import __version__
from ...sim.output.recording import DataError
from .pool import AHEAD_PER_JOB, Pool, WorkersError, first_line

CONNECT = 8.0
"""Time for a scheduler to answer [s]."""

WORKER_WAIT = 60.0
"""Time for a cluster without workers to get one [s]."""

LOOK = 2.0
"""Time between two checks of a cluster while its oldest result is awaited [s]."""

RETRIES = 2
"""Number of retries of an item that raised, since another worker may succeed."""

_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")

_ADDRESS = re.compile(
    r"(tcp|tls|ucx|wss?)://(\[[0-9a-f:.%]+\]|[^\s/:\[\]]+):\d{1,5}", re.IGNORECASE
)

_ALONE = threading.Lock()
"""Held while an item is processed: the limit on threads applies to the whole process."""


@contextmanager
def cluster_pool(
    function: Callable[[Any], Any],
    scheduler: str,
    say: Callable[[str], None],
    watch: Callable[[], None],
) -> Iterator[Pool]:
    """Workers of a running Dask cluster, for use by :func:`.workers.local.in_order`.

    Every worker must have the same wearstate and the same libraries as this process; one that joins
    later with others fails its first item. The scheduler needs Dask only. It reassigns the items of
    a lost worker.

    Parameters
    ----------
    function : callable
        Importable by name, or a partial of such a function.
    scheduler : str
        Its address, ``tcp://HOST:PORT``; ``tls://`` with the certificates of Dask's settings.
    say : callable
        Called with a line about what is being waited for.
    watch : callable
        Called every `LOOK` seconds while a result is awaited; may raise to stop.

    Yields
    ------
    Pool
        Pool that takes items and returns results.

    Raises
    ------
    DataError
        If Dask is not installed, the address is invalid, the scheduler does not answer within
        `CONNECT`, there is no worker within `WORKER_WAIT`, or workers have another wearstate.
    WorkersError
        If the scheduler or all workers were lost, or an item killed its workers.
    """
    refuse_scheduler(scheduler)
    with _quiet():
        client = _connected(scheduler)
        try:
            _await_worker(client, scheduler, say)
            _check_workers(client, say)
            yield _Cluster(client, function, scheduler, watch)
        except _gone():
            raise _lost(scheduler) from None
        finally:
            _close(client)


class _Cluster:
    """Items sent to a scheduler, and results not yet fetched."""

    def __init__(
        self,
        client: Any,
        function: Callable[[Any], Any],
        scheduler: str,
        watch: Callable[[], None],
    ) -> None:
        self._client, self._scheduler, self._watch = client, scheduler, watch
        self._function = partial(_done_alone, function, _fingerprint())
        self._unpacked = _unpacker()
        self._ahead: deque[Any] = deque()
        self._most, self._looked = 0, -float("inf")

    @property
    def waiting(self) -> int:
        return len(self._ahead)

    @property
    def most(self) -> int:
        """Largest number of items in flight; it follows the number of workers."""
        if time.monotonic() - self._looked > LOOK:
            self._most = AHEAD_PER_JOB * max(1, sum(self._client.nthreads().values()))
            self._looked = time.monotonic()
        return self._most

    def submit(self, item: Any) -> None:
        from cloudpickle import dumps

        # packed, because the scheduler opens what it passes on, and need not have wearstate
        packed = dumps((self._function, item))
        future = self._client.submit(self._unpacked, packed, pure=False, retries=RETRIES)
        self._ahead.append(future)

    def take(self) -> Any:
        error = self._awaited(self._ahead[0])
        if error is not None:
            raise _fault(error, self._scheduler)
        return self._ahead.popleft().result()

    def _awaited(self, future: Any) -> BaseException | None:
        """Error of the oldest item, once it is done; None for a result or a lost scheduler."""
        idle = time.monotonic()
        while True:
            try:
                found: BaseException | None = future.exception(timeout=LOOK)
            except TimeoutError:
                self._watch()
                if self._client.status != "running":
                    raise _lost(self._scheduler) from None
                if self._client.nthreads():
                    idle = time.monotonic()
                elif time.monotonic() - idle > WORKER_WAIT:
                    raise WorkersError(
                        f"workers of {self._scheduler} = 0 for {WORKER_WAIT:g} s, must be >= 1; "
                        f"start one: dask worker {self._scheduler}"
                    ) from None
            else:
                return found


def refuse_scheduler(scheduler: str) -> None:
    """Refuse an address at which no Dask scheduler answers.

    Parameters
    ----------
    scheduler : str
        Address, ``tcp://HOST:PORT``.

    Raises
    ------
    DataError
        If Dask is not installed, the address is invalid, or nothing answers within `CONNECT`.
    """
    if not _ADDRESS.fullmatch(scheduler):
        raise DataError(
            f"scheduler = {scheduler!r} must read tcp://HOST:PORT; take the address that "
            "'dask scheduler' prints"
        )
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise DataError(
            "scheduler needs Dask, which is not installed; pip install 'wearstate[dask]'"
        ) from error
    with _answering(scheduler), concurrent.futures.ThreadPoolExecutor(1) as thread:
        # in a thread: the caller may have its own event loop
        thread.submit(lambda: asyncio.run(_greeted(scheduler))).result()


@contextmanager
def _answering(scheduler: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # any error caused by a program that is not a scheduler
        raise DataError(
            f"scheduler = {scheduler} does not answer within {CONNECT:g} s "
            f"({first_line(error)}); start it with 'dask scheduler', or correct address or network"
        ) from error


def _connected(scheduler: str) -> Any:
    from distributed import Client

    with _answering(scheduler):
        return Client(scheduler, timeout=CONNECT, set_as_default=False, name="wearstate")


async def _greeted(scheduler: str) -> None:
    """Connect once: Dask's client waits for ever for a listening program that does not answer."""
    from distributed.comm import connect
    from distributed.security import Security

    async with asyncio.timeout(CONNECT):
        keys = Security().get_connection_args("client")
        comm = await connect(scheduler, timeout=CONNECT, **keys)
    comm.abort()


def _await_worker(client: Any, scheduler: str, say: Callable[[str], None]) -> None:
    start = spoken = time.monotonic()
    while not client.nthreads():
        now = time.monotonic()
        if now - start > WORKER_WAIT:
            raise DataError(
                f"scheduler = {scheduler} has 0 workers after {WORKER_WAIT:g} s, must be >= 1; "
                f"start one: dask worker {scheduler}"
            )
        if now - spoken >= 10 or spoken == start:
            spoken = now
            left = max(0.0, WORKER_WAIT - (now - start))
            say(f"waiting for a worker at {scheduler}, {left:.0f} s more")
        time.sleep(0.2)


def _check_workers(client: Any, say: Callable[[str], None]) -> None:
    """Refuse workers whose records would differ; all faults at once."""
    ours = _fingerprint()
    answers = client.run(_asked(__name__), on_error="return")
    # a worker lost meanwhile is handled by the scheduler, like any other
    theirs = {key: found for key, found in answers.items() if not isinstance(found, OSError)}
    faults = [
        f"worker {address}: {fault}"
        for address, found in theirs.items()
        for fault in _differences(ours, found)
    ]
    if faults:
        raise DataError("\n".join(faults))
    _warn_of_processors(theirs, say)
    threads = client.nthreads()
    if most := max(threads.values(), default=1) - 1:
        say(f"a worker has {most + 1} threads, of which one is used; better: --nthreads 1")


def _unpacker() -> Callable[[bytes], Any]:
    """Function that is sent as code, because the scheduler may lack wearstate."""

    def do(packed: bytes) -> Any:
        from cloudpickle import loads

        function, item = loads(packed)
        return function(item)

    return do


def _asked(module: str) -> Callable[[], Any]:
    """Function that is sent as code, so that a worker without wearstate can answer."""

    def ask() -> Any:
        try:
            from importlib import import_module

            return import_module(module).description()
        except ImportError as error:
            return {"missing": str(error)}

    return ask


def description() -> dict[str, str]:
    """Properties that determine the bits of a record: programs with versions, and the processor.

    Examples
    --------
    >>> sorted(description())[:3]
    ['llvmlite', 'numba', 'numpy']
    """
    return {
        **_programs(),
        "processor": importlib.import_module("llvmlite.binding").get_host_cpu_name(),
    }


@cache
def _programs() -> Mapping[str, str]:
    return {
        "python": ".".join(platform.python_version_tuple()[:2]),
        "wearstate": __version__,
        "wearstate sources": _sources(),
        **{name: version(name) for name in _LIBRARIES},
    }


def _sources() -> str:
    """Hash of the sources that make a record; versions alone do not distinguish checkouts."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for path in sorted([*root.glob("sim/**/*.py"), *root.glob("datasets/**/*.py")]):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def _fingerprint() -> tuple[tuple[str, str], ...]:
    return tuple(sorted(_programs().items()))


def _differences(ours: tuple[tuple[str, str], ...], found: Any) -> list[str]:
    """Faults of one worker, from its answer."""
    if isinstance(found, BaseException):
        return [f"cannot say what it runs ({first_line(found)}); restart it"]
    if "missing" in found:
        return [
            f"wearstate cannot be imported ({found['missing']}); install wearstate {__version__} "
            "there as well"
        ]
    return [
        f"{name} = {found.get(name)}, must be {value} as here; install the same there"
        for name, value in ours
        if found.get(name) != value
    ]


def _warn_of_processors(theirs: Mapping[str, Any], say: Callable[[str], None]) -> None:
    kinds = {found["processor"] for found in theirs.values()} | {description()["processor"]}
    if len(kinds) > 1:
        say(f"processors differ ({', '.join(sorted(kinds))}): so may the last bit of a sample")


class _OtherProgramError(RuntimeError):
    """Raised on a worker that joined later and has another wearstate."""


def _done_alone(
    function: Callable[[Any], Any], expected: tuple[tuple[str, str], ...], item: Any
) -> Any:
    """Process one item on a worker; one at a time, however many threads the worker has."""
    if faults := _differences(expected, _programs()):
        raise _OtherProgramError("; ".join(faults))
    with _ALONE, threadpool_limits(1):
        return function(item)


def _fault(error: BaseException, scheduler: str) -> BaseException:
    """Error of an item in the form for the caller."""
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return WorkersError(
            f"an item killed every worker of {scheduler} that took it ({first_line(error)}); look "
            "for too little memory there"
        )
    if isinstance(error, (ModuleNotFoundError, _OtherProgramError)):
        return WorkersError(
            f"a worker that joined {scheduler} has another wearstate ({first_line(error)}); "
            "install the same there"
        )
    return error


def _lost(scheduler: str) -> WorkersError:
    return WorkersError(f"the scheduler {scheduler} was lost; start it and its workers again")


def _gone() -> tuple[type[BaseException], ...]:
    """Errors raised by Dask when the scheduler is lost."""
    from distributed.comm import CommClosedError

    return concurrent.futures.CancelledError, asyncio.CancelledError, CommClosedError


def _close(client: Any) -> None:
    """Disconnect from the cluster; outstanding items are dropped with the client."""
    try:
        client.close(timeout=LOOK)
    except Exception as error:  # disconnecting fails if the scheduler is lost
        logging.getLogger(__name__).debug("leaving the cluster: %s", error)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's own log of a lost connection off the terminal; the error says it in one line."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
