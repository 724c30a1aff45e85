"""Workers: results in the order of the work, few in flight, lost processes replaced."""

import gc
import importlib
import logging
import os
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from .pool import AHEAD_PER_JOB, Pool, WorkersError, first_line

Item = TypeVar("Item")
Result = TypeVar("Result")

JOBS_PER_CORE = 4
"""Largest number of processes per core; more would only wait for each other."""

ATTEMPTS = 3
"""Number of times that processes may die before the oldest outstanding result arrives."""

PARENT_CHECK = 1.0
"""Time between two checks of a worker whether its parent is alive [s]."""

IDLE = 600.0
"""Time after which an idle worker ends [s]: long, since a new one takes seconds to import."""

OVERDUE = 5.0
"""Time after which an outstanding result is checked against processes that died [s]."""

WATCH = 1.0
"""Time between two calls of `watch` while waiting [s]."""

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

_SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable that keeps the current folder off the path of a starting Python: a file in
it may be named like a module."""


def in_order(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    jobs: int,
    scheduler: str | None = None,
    say: Callable[[str], None] | None = None,
    watch: Callable[[], None] | None = None,
) -> Generator[Result, None, None]:
    """Apply a function in worker processes and return the results in order.

    Parameters
    ----------
    function : callable
        Importable by name, or a partial of such a function. An item is repeated if its worker died,
        so that the function should have no side effects.
    items : iterable
        Read only as far as the workers need.
    jobs : int
        Number of processes; 1 works in this process. At most `JOBS_PER_CORE` per core are started.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``, whose workers are used instead; `jobs` is
        then ignored.
    say : callable, optional
        Called with a line about workers that are awaited, lost or too many.
    watch : callable, optional
        Called every `WATCH` seconds while a worker's result is awaited; may raise to stop.

    Yields
    ------
    result
        Result of each item, in the order of the items. The same for any `jobs` and `scheduler`.

    Raises
    ------
    WorkersError
        If worker processes died `ATTEMPTS` times in a row, or the cluster was lost.
    DataError
        If the cluster cannot be used; see :func:`wearstate.datasets.workers.cluster.cluster_pool`.

    Examples
    --------
    >>> list(in_order(abs, [-1, 2, -3], jobs=1))
    [1, 2, 3]
    """
    talk, look = say or _silent, watch or _nothing
    if scheduler is None and (jobs := _bounded(jobs, talk)) == 1:
        # one thread for linear algebra, as in a worker: the same sums in the same order
        with threadpool_limits(1):
            yield from map(function, items)
        return
    with _pool(function, jobs, scheduler, talk, look) as pool:
        yield from _through(pool, items)


def _silent(_: str) -> None:
    """Ignore the message."""


def _nothing() -> None:
    """Do nothing."""


def _bounded(jobs: int, say: Callable[[str], None]) -> int:
    most = max(1, int(JOBS_PER_CORE * cores()))
    if jobs > most:
        say(f"jobs = {jobs} is more than {JOBS_PER_CORE} for each of {cores()} cores; {most} start")
    return min(jobs, most)


def _pool(
    function: Callable[[Any], Any],
    jobs: int,
    scheduler: str | None,
    say: Callable[[str], None],
    watch: Callable[[], None],
) -> AbstractContextManager[Pool]:
    if scheduler is None:
        return _processes(function, jobs, say, watch)
    from .cluster import cluster_pool

    return cluster_pool(function, scheduler, say, watch)


def _through(pool: Pool, items: Iterable[Any]) -> Iterator[Any]:
    for item in items:
        pool.submit(item)
        while pool.waiting >= pool.most:
            yield pool.take()
    while pool.waiting:
        yield pool.take()


@contextmanager
def _processes(
    function: Callable[[Any], Any],
    jobs: int,
    say: Callable[[str], None],
    watch: Callable[[], None],
) -> Iterator[Pool]:
    """Processes of this machine."""
    with _safe_path():
        pool = _Processes(function, jobs, say, watch)
        try:
            yield pool
        except BaseException:  # also Ctrl-C, and a caller that stops: leave no worker behind
            pool.kill()
            raise


@contextmanager
def _safe_path() -> Iterator[None]:
    """Set the variable for the processes that loky starts in addition to its workers."""
    if os.environ.get(_SAFE_PATH):
        yield
        return
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        os.environ.pop(_SAFE_PATH, None)


class _Processes:
    """Processes of this machine, replaced when one dies."""

    def __init__(
        self,
        function: Callable[[Any], Any],
        jobs: int,
        say: Callable[[str], None],
        watch: Callable[[], None],
    ) -> None:
        self._function, self._jobs = function, jobs
        self._say, self._watch = say, watch
        self._ahead: deque[tuple[Any, Future[Any]]] = deque()
        self._start()
        self._start_early()

    def _start_early(self) -> None:
        """Start the processes now: they import while the first items are being made."""
        with suppress(BrokenExecutor):  # reported by take, where attempts are counted
            self._executor.submit(os.getpid)

    def _start(self) -> None:
        from joblib.externals.loky import get_reusable_executor

        # loky renews a worker that was idle for long, or grew by 300 MB (as when compiling
        # kernels), and warns of it in the thread that submits work: if warnings are errors, that
        # thread ends, and every later result is awaited for ever
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        self._executor = get_reusable_executor(
            max_workers=self._jobs,
            timeout=IDLE,
            env={**_ONE_THREAD, _SAFE_PATH: "1"},
            initializer=_settle,
            initargs=(os.getpid(), _module_of(self._function)),
        )

    @property
    def waiting(self) -> int:
        return len(self._ahead)

    @property
    def most(self) -> int:
        return AHEAD_PER_JOB * self._jobs

    def submit(self, item: Any) -> None:
        self._ahead.append((item, self._sent(item)))

    def _sent(self, item: Any) -> "Future[Any]":
        try:
            future: Future[Any] = self._executor.submit(self._function, item)
        except BrokenExecutor as error:  # reported by take, where attempts are counted
            future = Future()
            future.set_exception(error)
        return future

    def take(self) -> Any:
        for attempt in range(1, ATTEMPTS + 1):
            try:
                result = self._come(self._ahead[0][1])
            except BrokenExecutor as error:
                fault = error
            else:
                self._ahead.popleft()
                return result
            if attempt < ATTEMPTS:
                self._say("a worker process died; its items are repeated")
                self._renew()
        raise WorkersError(
            f"worker processes died {ATTEMPTS} times over the same work, must be < {ATTEMPTS} "
            f"({first_line(fault)}); look for too little memory, or use fewer jobs"
        ) from fault

    def _come(self, future: "Future[Any]") -> Any:
        """Result of a future, even if a process died with half of its result sent."""
        overdue = time.monotonic() + OVERDUE
        while True:
            wait([future], WATCH)
            if future.done():
                return future.result()
            self._watch()
            if time.monotonic() < overdue:
                continue
            overdue = time.monotonic() + OVERDUE
            if any(process.exitcode for process in self._workers()):
                self._end()

    def _renew(self) -> None:
        self._start()  # loky returns a new executor for a broken one
        self._ahead = deque(
            (item, future if _has_come(future) else self._sent(item))
            for item, future in self._ahead
        )

    def kill(self) -> None:
        # loky's own kill_workers fails in its thread if an item was submitted just before; it
        # handles processes that die
        self._end()
        self._executor.shutdown(wait=True)

    def _end(self) -> None:
        """End all processes, and the wait for the rest of a result that one of them was sending."""
        results = self._executor._result_queue
        for process in self._workers():
            process.terminate()
        if results is not None:  # this process holds a write end, which delays the end of file
            results._writer.close()

    def _workers(self) -> list[Any]:
        return list((self._executor._processes or {}).values())


def _has_come(future: "Future[Any]") -> bool:
    return future.done() and not isinstance(future.exception(), BrokenExecutor)


def cores() -> int:
    """Cores that this process may use.

    Examples
    --------
    >>> cores() >= 1
    True
    """
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _module_of(function: Any) -> str:
    """Module that a worker imports to call a function."""
    while isinstance(function, partial):
        function = function.func
    return str(getattr(function, "__module__", type(function).__module__))


def _settle(parent: int, module: str) -> None:
    """Start a worker for functions of a module."""
    # Ctrl-C reaches all processes of the terminal; the writing one ends the others
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # the parent has already reported faults of the kernel cache
    logging.getLogger(f"{__name__.partition('.')[0]}.sim.jit").setLevel(logging.ERROR)
    threading.Thread(target=_follow, args=(parent,), daemon=True).start()
    with suppress(ImportError):  # a function may be sent as code
        importlib.import_module(module)
    # loky collects garbage once a second; over all imported objects that is 8 % of a run
    gc.freeze()


def _follow(parent: int) -> None:
    """End this worker when its parent process is gone, since a killed parent cannot do so."""
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK)
    os._exit(1)
