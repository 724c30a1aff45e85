"""Worker processes: results in the order of the work, few in flight."""

import gc
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD_PER_JOB = 3
"""Items handed out and not yet taken back, per worker; bounds the memory of a run."""

JOBS_PER_CORE = 4
"""More processes than this for every core only wait for each other."""

PARENT_CHECK = 1.0
"""Time between two looks of a worker at whether its parent lives [s]."""

IDLE = 600.0
"""Time after which an idle worker ends [s]: long, since loky has hung where workers were ending of
idleness (after 10 s, its default) just as new work came."""

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def in_order(
    function: Callable[[Item], Result], items: Iterable[Item], *, jobs: int
) -> Iterator[Result]:
    """Apply a function in worker processes and give the results in order.

    Parameters
    ----------
    function : callable
        Importable by name, or a partial of such a function.
    items : iterable
        Drawn from only as far as the workers need.
    jobs : int
        Processes; 1 works in this one, without any other. No more are started than
        `JOBS_PER_CORE` for every core.

    Yields
    ------
    result
        Of each item, in the order of the items. The same for any `jobs`.

    Examples
    --------
    >>> list(in_order(abs, [-1, 2, -3], jobs=1))
    [1, 2, 3]
    """
    jobs = min(jobs, JOBS_PER_CORE * cores())
    if jobs == 1:
        # one thread for linear algebra, as in a worker: the same sums in the same order
        with threadpool_limits(1):
            yield from map(function, items)
        return
    from joblib.externals.loky import get_reusable_executor

    executor = get_reusable_executor(
        max_workers=jobs, timeout=IDLE, env=_ONE_THREAD, initializer=_settle
    )
    waiting: deque[Any] = deque()
    try:
        for item in items:
            waiting.append(executor.submit(function, item))
            if len(waiting) >= AHEAD_PER_JOB * jobs:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BaseException:  # also Ctrl-C, and a caller that stops: leave no worker behind
        executor.shutdown(wait=True, kill_workers=True)
        raise


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


def _settle() -> None:
    """Start a worker."""
    # loky collects garbage once a second; over every imported object that is 8 % of a run
    gc.freeze()
    threading.Thread(target=_follow, args=(os.getppid(),), daemon=True).start()


def _follow(parent: int) -> None:
    """End this worker when the process that started it is gone: a killed one cannot say so."""
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK)
    os._exit(1)
