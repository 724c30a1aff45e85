"""Workers of this machine: order, few in flight, processes that die."""

import os
import signal
import subprocess
import sys
import time

import cloudpickle
import numpy as np
import pytest
from wearstate.datasets.workers import local as workers
from wearstate.datasets.workers.local import in_order
from wearstate.datasets.workers.pool import WorkersError

cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import this file


def late(item):
    """The earlier, the later."""
    time.sleep(0.02 * (4 - item % 4))
    return item, os.getpid()


def die_once(place, item):
    """End the process at item 3, where it was not done before."""
    try:
        if item == 3:
            os.close(os.open(place, os.O_CREAT | os.O_EXCL))
            os.kill(os.getpid(), signal.SIGKILL)
    except FileExistsError:
        return -item
    return item


class OnceAt3:
    """die_once of a place."""

    def __init__(self, place):
        self.place = place

    def __call__(self, item):
        return die_once(self.place, item)


class HalfAt1:
    """At item 1 end the process with half of a result sent, where it was not done before."""

    def __init__(self, place):
        self.place = place

    def __call__(self, item):
        if item == 1 and not os.path.exists(self.place):
            open(self.place, "w").close()
            frame = sys._getframe()
            while "result_queue" not in frame.f_locals:
                frame = frame.f_back
            length = (1 << 30).to_bytes(4, "big")
            os.write(frame.f_locals["result_queue"]._writer.fileno(), length + b"half")
            os.kill(os.getpid(), signal.SIGKILL)
        return item


class GrowAt4:
    """Keep 400 MB at item 4, when loky looks at its workers a second time; later items wait until
    the worker that takes the place of that one has come."""

    def __init__(self, folder):
        self.folder = folder

    def __call__(self, item):
        open(f"{self.folder}/{os.getpid()}", "w").close()
        if item == 4:
            time.sleep(1.2)
            os.kept = np.ones(50_000_000)
        end = time.monotonic() + 60
        while item > 4 and len(os.listdir(self.folder)) < 3 and time.monotonic() < end:
            time.sleep(0.02)
        return item, os.getpid()


def die(item):
    os.kill(os.getpid(), signal.SIGKILL)


def refuse(item):
    raise ValueError(f"item {item} is bad")


def test_results_come_in_the_order_of_the_items():
    found = list(in_order(late, range(12), jobs=2))
    assert [item for item, _ in found] == list(range(12))
    assert len({pid for _, pid in found}) == 2


def test_few_items_are_in_flight():
    drawn = []
    items = (drawn.append(i) or i for i in range(100))
    outcomes = in_order(abs, items, jobs=2)
    for taken in range(1, 20):
        next(outcomes)
        # the one that makes it full is handed out before the oldest is taken back
        assert len(drawn) - taken <= workers.AHEAD_PER_JOB * 2
    outcomes.close()


def test_a_worker_that_dies_is_replaced(tmp_path):
    told = []
    function = OnceAt3(str(tmp_path / "died"))
    found = list(in_order(function, range(8), jobs=2, say=told.append))
    assert found == [0, 1, 2, -3, 4, 5, 6, 7]
    assert told == ["a worker process died; its items are repeated"]


def test_a_worker_that_dies_with_half_a_result_sent_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "OVERDUE", 0.5)
    told = []
    work = HalfAt1(str(tmp_path / "half"))
    assert list(in_order(work, range(4), jobs=2, say=told.append)) == [0, 1, 2, 3]
    assert told == ["a worker process died; its items are repeated"]


def test_a_stop_does_not_wait_for_half_a_result(tmp_path):
    results = in_order(HalfAt1(str(tmp_path / "half")), range(4), jobs=2)
    assert next(results) == 0
    while not (tmp_path / "half").exists():
        time.sleep(0.01)
    time.sleep(0.5)  # until the half has come
    results.close()


def test_a_worker_that_grows_is_replaced_without_a_word(tmp_path):
    """Warnings are errors here, and one in the thread that hands out work would hang the run."""
    pytest.importorskip("psutil")  # what loky measures its workers with
    found = list(in_order(GrowAt4(str(tmp_path)), range(16), jobs=2))
    assert [item for item, _ in found] == list(range(16))
    assert len({pid for _, pid in found}) == 3


def test_a_worker_whose_parent_was_gone_before_it_settled_ends():
    """Its parent is then already another process, which lives."""
    script = (
        "import os, time; from wearstate.datasets.workers import local; local.PARENT_CHECK = 0.1; "
        "local._settle(os.getppid() + 10**6); time.sleep(60)"
    )
    run = subprocess.run([sys.executable, "-P", "-c", script], check=False, timeout=180)
    assert run.returncode == 1


def test_work_that_kills_every_worker_is_given_up():
    told = []
    with pytest.raises(WorkersError, match=r"died 3 times over the same work, must be < 3"):
        list(in_order(die, range(2), jobs=2, say=told.append))
    assert len(told) == workers.ATTEMPTS - 1
    assert list(in_order(abs, [-1, -2], jobs=2)) == [1, 2]  # none of it is left over


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_the_function_raises_is_raised(jobs):
    with pytest.raises(ValueError, match="item 5 is bad"):
        list(in_order(refuse, [5, 6], jobs=jobs))


def test_more_workers_than_four_a_core_are_limited_and_told(monkeypatch):
    monkeypatch.setattr(workers, "cores", lambda: 0.5)
    told = []
    assert list(in_order(abs, [-1, -2], jobs=64, say=told.append)) == [1, 2]
    assert told == ["jobs = 64 is more than 4 for each of 0.5 cores; 2 start"]
