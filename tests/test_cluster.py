"""Workers of a Dask cluster: two processes on this machine."""

import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
from contextlib import contextmanager

import h5py
import pytest
from click.testing import CliRunner
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.workers import cluster
from wearstate.datasets.workers.local import in_order
from wearstate.datasets.workers.pool import WorkersError
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.output.recording import DataError

pytest.importorskip("distributed")
cloudpickle = pytest.importorskip("cloudpickle")
cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import this file

N = 12


# imports for seconds, once: every scheduler and worker is a fork of this server
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(
    [
        "distributed.cli.dask_scheduler",
        "distributed.cli.dask_worker",
        "wearstate.datasets.generation.generate",
    ]
)

COMMAND = """
import os, signal
from distributed.cli.dask_{what} import main
signal.signal(signal.SIGINT, signal.default_int_handler)
os.chdir({folder!r})
log = os.open("{what}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
os.dup2(log, 1)
os.dup2(log, 2)
main({arguments!r}, prog_name="dask-{what}")
"""


def start(folder, what, *arguments):
    """Run ``dask scheduler`` or ``dask worker`` in a process of its own."""
    code = COMMAND.format(folder=str(folder), what=what, arguments=arguments)
    process = FORKS.Process(target=exec, args=(code, {}), daemon=True)
    process.start()
    return process


def start_worker(folder, address, threads=1):
    options = ("--no-nanny", "--no-dashboard", "--nthreads", str(threads))
    return start(folder, "worker", address, *options)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(port):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)


class Cluster:
    """A scheduler and workers, ended with the test."""

    def __init__(self, folder):
        self.folder, self.workers = folder, []
        self.address = f"tcp://127.0.0.1:{free_port()}"
        port = self.address.rpartition(":")[2]
        options = ("--host", "127.0.0.1", "--port", port, "--no-dashboard")
        self.scheduler = start(folder, "scheduler", *options)
        self.workers = []
        self.port = int(port)

    def join(self, count):
        """Start workers and wait until the scheduler knows them all."""
        self.workers += [start_worker(self.folder, self.address) for _ in range(count)]
        wait_for(self.port)
        if count:
            from distributed import Client

            with Client(self.address, set_as_default=False) as client:
                client.wait_for_workers(count, timeout=180)

    def end(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.join()


@contextmanager
def running(folder, workers):
    made = Cluster(folder)
    try:
        made.join(workers)
        yield made
    finally:
        made.end()


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    with running(tmp_path_factory.mktemp("pair"), workers=2) as made:
        yield made


@pytest.fixture
def alone(tmp_path):
    with running(tmp_path, workers=0) as made:
        yield made


@pytest.fixture(scope="module")
def recipe():
    return load_recipe("journal-bearing-small")


def content(path):
    with h5py.File(path) as file:
        names = ["signal", "manifest", *(f"truth/{name}" for name in file["truth"])]
        return {name: file[name][:].tobytes() for name in names}


def named(item):
    time.sleep(0.05)
    return item, os.getpid()


def die(item):
    os.kill(os.getpid(), signal.SIGKILL)


def refuse(item):
    raise ValueError(f"item {item} is bad")


def hold(item):
    """Count how many run at once in this process."""
    HELD.append(item)
    most = len(HELD)
    time.sleep(0.05)
    HELD.remove(item)
    return most


HELD = []


# -- the same bytes --------------------------------------------------------------------------------


def test_two_workers_of_a_cluster_give_the_bytes_of_one_process_here(pair, recipe, tmp_path):
    here, there, both = (tmp_path / f"{name}.h5" for name in ("here", "there", "both"))
    generate(recipe, N, here, seed=3, truth=True)
    generate(recipe, N, there, seed=3, truth=True, scheduler=pair.address)
    generate(recipe, N, both, seed=3, truth=True, jobs=2)
    assert content(there) == content(here)
    assert content(both) == content(here)


def test_work_is_spread_and_comes_back_in_order(pair):
    found = list(in_order(named, range(30), jobs=1, scheduler=pair.address))
    assert [item for item, _ in found] == list(range(30))
    assert os.getpid() not in {pid for _, pid in found}


def test_few_items_are_in_flight(pair):
    drawn = []
    items = (drawn.append(i) or i for i in range(100))
    outcomes = in_order(abs, items, jobs=1, scheduler=pair.address)
    for taken in range(1, 30):
        next(outcomes)
        assert len(drawn) - taken <= cluster.AHEAD_PER_JOB * 2
    outcomes.close()


def test_what_the_function_raises_is_raised(pair):
    with pytest.raises(ValueError, match="item 5 is bad"):
        list(in_order(refuse, [5], jobs=1, scheduler=pair.address))


def test_a_refusal_there_must_be_one_here(pair, recipe, tmp_path, monkeypatch):
    """A worker may lack a file of the scene, and would make rows of failures of it."""
    monkeypatch.setattr("wearstate.datasets.generation.generate.simulated", refused_unless_here)
    with pytest.raises(WorkersError, match=r"record 0 is refused by a worker \(no such file\) and"):
        generate(recipe, 2, tmp_path / "data.h5", scheduler=pair.address)


def refused_unless_here(sample, *, truth, error):
    from wearstate.datasets.generation.work import RecordOutcome, silence

    lacking = None if os.getpid() == HERE else sample
    fault = "no such file" if lacking else ""
    row = {**sample.row, "status": "refused" if lacking else "ok"}
    return RecordOutcome(sample.index, silence(sample.scene), row, {}, fault, lacking)


HERE = os.getpid()


# -- what cannot be used ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("somewhere", "scheduler = 'somewhere' must read tcp://HOST:PORT"),
        ("foo://127.0.0.1:8786", "must read tcp://HOST:PORT"),
        ("tcp://127.0.0.1", "must read tcp://HOST:PORT"),
    ],
)
def test_an_address_that_is_none_is_refused_before_any_work(recipe, tmp_path, address, message):
    with pytest.raises(DataError, match=message):
        generate(recipe, N, tmp_path / "data.h5", scheduler=address)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("listens", [False, True])
def test_a_scheduler_that_does_not_answer_is_named_in_time(recipe, tmp_path, monkeypatch, listens):
    monkeypatch.setattr(cluster, "CONNECT", 1.0)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        if listens:
            deaf.listen()
        address = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        begun = time.monotonic()
        with pytest.raises(DataError, match=f"{address} does not answer within 1 s .*dask sched"):
            generate(recipe, N, tmp_path / "data.h5", scheduler=address)
    # the time to connect, and as much again for a loaded machine and the import of Dask
    assert time.monotonic() - begun < 8
    assert list(tmp_path.iterdir()) == []
    assert cluster.CONNECT < 10


def test_a_cluster_without_workers_is_waited_for_and_then_refused(
    alone, recipe, tmp_path, monkeypatch
):
    monkeypatch.setattr(cluster, "WORKER_WAIT", 1.0)
    told, path = [], tmp_path / "data.h5"
    with pytest.raises(DataError, match=r"has 0 workers after 1 s, must be >= 1; start one: dask"):
        generate(recipe, N, path, scheduler=alone.address, say=told.append)
    assert told == [f"waiting for a worker at {alone.address}, 1 s more"]
    assert not list(tmp_path.glob("data.h5*"))


def test_jobs_and_scheduler_exclude_each_other(tmp_path):
    arguments = ["generate", "journal-bearing-small", "-o", str(tmp_path / "data.h5"), "-j", "2"]
    run = CliRunner().invoke(cli, [*arguments, "--scheduler", "tcp://127.0.0.1:1"])
    assert run.exit_code == 2
    assert "--jobs is for this machine" in run.stderr


def test_a_worker_with_another_program_is_named():
    ours = (("numba", "0.60"), ("wearstate", "1.0"))
    assert cluster._differences(ours, dict(ours)) == []
    assert cluster._differences(ours, {"numba": "0.61"}) == [
        "numba = 0.61, must be 0.60 as here; install the same there",
        "wearstate = None, must be 1.0 as here; install the same there",
    ]
    (fault,) = cluster._differences(ours, {"missing": "No module named 'wearstate'"})
    assert "wearstate cannot be imported (No module named 'wearstate'); install" in fault


def test_workers_with_other_libraries_are_refused_all_at_once(pair, monkeypatch):
    monkeypatch.setattr(cluster, "_programs", lambda: {"wearstate": "9.9"})
    cluster._fingerprint.cache_clear()
    with pytest.raises(DataError) as caught:
        list(in_order(abs, [-1], jobs=1, scheduler=pair.address))
    cluster._fingerprint.cache_clear()
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    assert all(line.startswith("worker tcp://127.0.0.1:") for line in lines)
    assert all(line.endswith("must be 9.9 as here; install the same there") for line in lines)


def test_a_worker_that_is_lost_while_it_is_asked_is_no_fault():
    class Client:
        def run(self, function, on_error):
            return {"one": ConnectionResetError("gone"), "two": function()}

        def nthreads(self):
            return {"two": 1}

    told = []
    cluster._check_workers(Client(), told.append)
    assert told == []


def test_a_worker_without_wearstate_answers_all_the_same():
    ask = cluster._asked("no_such_package.datasets.cluster")
    assert "no_such_package" in ask()["missing"]
    assert ask.__qualname__.endswith("<locals>.ask")  # so that it is sent as code


def test_a_worker_that_joins_later_with_another_program_fails_its_item():
    with pytest.raises(RuntimeError, match=r"wearstate = .*, must be 9\.9 as here"):
        cluster._done_alone(abs, (("wearstate", "9.9"),), -1)


def test_one_item_at_a_time_whatever_threads_a_worker_has():
    most = []
    expected = cluster._fingerprint()
    threads = [
        threading.Thread(target=lambda i=i: most.append(cluster._done_alone(hold, expected, i)))
        for i in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1, 1, 1]


# -- what is lost ----------------------------------------------------------------------------------


def test_a_worker_that_is_lost_costs_nothing_but_time(alone):
    alone.join(2)
    found = []
    for item, _ in in_order(named, range(30), jobs=1, scheduler=alone.address):
        found.append(item)
        if item == 5:
            alone.workers[0].kill()
    assert found == list(range(30))


def test_a_lost_scheduler_is_told_with_what_is_kept(alone, recipe, tmp_path):
    alone.join(1)
    path = tmp_path / "data.h5"

    def end(done, total):
        if done == 4:
            alone.scheduler.kill()

    with pytest.raises(WorkersError) as caught:
        generate(recipe, 40, path, seed=3, scheduler=alone.address, progress=end)
    text = str(caught.value)
    assert text.startswith(f"the scheduler {alone.address} was lost; start it and its workers")
    # results that had arrived are still written
    kept = int(text.split("; ")[-1].split(" of 40 records are kept in data.h5.part")[0])
    assert 4 <= kept < 40
    summary = generate(recipe, 40, path, seed=3)
    assert summary.n_resumed == kept


def test_an_item_that_kills_every_worker_is_given_up(alone):
    alone.join(4)  # as many as a scheduler gives an item to
    with pytest.raises(WorkersError, match=r"an item killed every worker of tcp.* that took it"):
        list(in_order(die, [1], jobs=1, scheduler=alone.address))


def test_a_cluster_that_loses_all_workers_is_given_up(alone, monkeypatch):
    alone.join(1)
    monkeypatch.setattr(cluster, "LOOK", 0.2)
    outcomes = in_order(named, range(20), jobs=1, scheduler=alone.address)
    next(outcomes)
    monkeypatch.setattr(cluster, "WORKER_WAIT", 1.0)
    alone.workers[0].kill()
    with pytest.raises(WorkersError, match=r"= 0 for 1 s, must be >= 1; start one: dask worker"):
        list(outcomes)
