"""Recipes and what is generated from them: the same records however the run goes."""

import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from contextlib import suppress

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import rankdata
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter, LostError, WriteError
from wearstate.datasets.generation import generate as generation
from wearstate.datasets.generation import work
from wearstate.datasets.generation.generate import Stopped, generate, save_solution
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import LARGEST_SEED, STRATA, sample_records
from wearstate.datasets.recipe.severities import wear_limits
from wearstate.datasets.recipe.table import MOST_RECORDS
from wearstate.datasets.recipe.text import RecipeError, recipe_names
from wearstate.datasets.split.rules import group_split
from wearstate.datasets.workers.local import in_order
from wearstate.sim.atomic import OutputError
from wearstate.sim.machine.simulate import alike, simulate
from wearstate.sim.output.recording import DataError
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

SHORT = {"duration": "0.25 s", "settling_revolutions": 1}
"""One revolution and a bit of the slowest machine: about 20 ms to simulate."""

N = 6
CRANKPIN = "joint.crankpin.diametral_clearance"


@pytest.fixture(scope="module")
def short():
    return load_recipe("bilge-pump-small", SHORT)


@pytest.fixture(scope="module")
def reference(short, tmp_path_factory):
    path = tmp_path_factory.mktemp("reference") / "data.h5"
    generate(short, N, path, seed=5)
    return content(path)


def content(path):
    with h5py.File(path) as file:
        return file["signal"][:].tobytes(), file["manifest"][:].tobytes()


# -- the same bytes ----------------------------------------------------------------------------


def test_any_number_of_jobs_gives_the_same_bytes(short, reference, tmp_path):
    generate(short, N, tmp_path / "data.h5", seed=5, jobs=2)
    assert content(tmp_path / "data.h5") == reference


def test_a_smaller_set_begins_a_larger_one(short, reference, tmp_path):
    generate(short, N - 3, tmp_path / "data.h5", seed=5)
    for part, whole in zip(content(tmp_path / "data.h5"), reference, strict=True):
        assert part == whole[: len(whole) // N * (N - 3)]


def test_another_seed_gives_other_records(short, reference, tmp_path):
    generate(short, 1, tmp_path / "data.h5", seed=6)
    part = content(tmp_path / "data.h5")[0]
    assert part != reference[0][: len(part)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_run_stopped_by_ctrl_c_goes_on(short, reference, tmp_path, jobs):
    path = tmp_path / "data.h5"

    def stop(done, total):
        if done == 3:
            raise KeyboardInterrupt

    text = "stopped; 3 of 6 records are kept in data.h5.part: repeat the command to go on"
    with pytest.raises(Stopped, match=f"^{text}$"):
        generate(short, N, path, seed=5, jobs=jobs, progress=stop)
    assert [item.name for item in tmp_path.iterdir()] == ["data.h5.part"]
    seen = []
    summary = generate(short, N, path, seed=5, progress=lambda *pair: seen.append(pair))
    assert (summary.n_resumed, seen) == (3, [(4, N), (5, N), (6, N)])
    assert content(path) == reference


def test_a_full_disk_is_told_with_what_is_kept(short, reference, tmp_path, monkeypatch):
    path = tmp_path / "data.h5"

    def fill(done, total):
        if done == 2:
            monkeypatch.setattr(h5py.File, "flush", full)

    def full(self):
        raise OSError("error message = 'No space left on device'")

    with pytest.raises(WriteError, match=r"No space .* room; 2 of 6 records are kept in data"):
        generate(short, N, path, seed=5, progress=fill)
    monkeypatch.undo()
    assert generate(short, N, path, seed=5).n_resumed == 2
    assert content(path) == reference


@pytest.fixture
def interruptible():
    """Ctrl-C as in a terminal: a job in the background of a script is started without."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_a_ctrl_c_that_a_callback_loses_is_kept_in_mind(short, tmp_path):
    done = []

    def lose(count, _):
        done.append(count)
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt, match="1 of 4 records are kept"):
        generate(short, 4, tmp_path / "data.h5", progress=lose)
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interruptible")
def test_a_ctrl_c_in_a_finaliser_is_kept_in_mind_and_not_reported(short, tmp_path, capsys):
    class Gone:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def lose(done, total):
        if done == 1:
            Gone()

    with pytest.raises(KeyboardInterrupt, match="1 of 4 records are kept"):
        generate(short, 4, tmp_path / "data.h5", progress=lose)
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
def test_progress_and_ctrl_c_on_a_terminal(tmp_path):
    import pty

    path, recipe = tmp_path / "data.h5", tmp_path / "brief.toml"
    # brief records in several batches: the first is told early, and others are left to stop
    fixed = "".join(f"{name} = {value!r}\n" for name, value in SHORT.items())
    recipe.write_text(
        f'name = "brief"\nextends = "bilge-pump-small"\nrecords = 400\n[fixed]\n{fixed}'
    )
    command = [sys.executable, "-P", "-m", "wearstate", "generate", str(recipe)]
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(tmp_path)
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # as a terminal starts it
        os.execv(sys.executable, [*command, "-o", str(path), "-j", "2"])
    seen = ""
    while "/s" not in seen:  # the rate comes with the second record
        seen += os.read(terminal, 4096).decode()
    os.write(terminal, b"\x03")
    while chunk := read_terminal(terminal):
        seen += chunk
    os.close(terminal)
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 1
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", seen)  # colours and moves of the cursor
    assert re.search(r"simulating \S+ +[0-9]+/400 [0-9:-]+ [0-9.]+/s", plain)
    assert re.search(r"stopped; [0-9]+ of 400 records are kept in data.h5.part: repeat", seen)
    assert "Traceback" not in seen


def read_terminal(terminal):
    try:
        return os.read(terminal, 4096).decode()
    except OSError:  # so does Linux say that the other side has closed it
        return ""


KILLED = """
import os, signal, sys
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
recipe = load_recipe("bilge-pump-small", {overrides})
kill = lambda done, total: os.kill(os.getpid(), signal.SIGKILL) if done == 4 else None
generate(recipe, {n}, sys.argv[1], seed=5, progress=kill, jobs=int(sys.argv[2]))
"""


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_killed_process_goes_on(short, reference, tmp_path, jobs):
    path = tmp_path / "data.h5"
    script = KILLED.format(overrides=SHORT, n=N)
    # -P: the checkout holds packages named like other projects' top-level ones. Workers share the
    # captured stdout: the call returns when the last of them is gone, or fails at the timeout.
    command = [sys.executable, "-P", "-c", script, str(path), jobs]
    run = subprocess.run(command, cwd=tmp_path, check=False, stdout=subprocess.PIPE, timeout=180)
    assert run.returncode == -signal.SIGKILL
    assert sorted(os.listdir(tmp_path)) == ["data.h5.lock", "data.h5.part"]
    assert generate(short, N, path, seed=5).n_resumed == 4
    assert content(path) == reference


# -- one output, several hands -------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_unfinished_file_that_is_deleted_stops_the_run_and_says_so(short, tmp_path, jobs):
    path = tmp_path / "data.h5"
    seen = []

    def delete(done, total):
        seen.append(done)
        if done == 2:
            (tmp_path / "data.h5.part").unlink()

    with pytest.raises(LostError, match=r"part is gone: .* its 2 records with it; 0 of 40 are"):
        generate(short, 40, path, seed=5, jobs=jobs, progress=delete)
    assert seen == [1, 2]  # noticed before the next record
    assert os.listdir(tmp_path) == []


def test_it_is_noticed_while_a_worker_is_waited_for(tmp_path):
    part = tmp_path / "data.h5.part"
    part.touch()

    def watch():
        if not part.exists():
            raise LostError("gone")

    results = in_order(time.sleep, [0, 0, 30, 30], jobs=2, watch=watch)
    assert next(results) is None
    part.unlink()
    begin = time.monotonic()
    with pytest.raises(LostError):
        list(results)
    assert time.monotonic() - begin < 20  # a second, and the end of the workers


def test_ctrl_c_after_the_file_was_deleted_claims_nothing(short, tmp_path):
    def delete_and_stop(done, total):
        (tmp_path / "data.h5.part").unlink()
        raise KeyboardInterrupt

    with pytest.raises(Stopped, match="0 of 6 are kept"):
        generate(short, N, tmp_path / "data.h5", progress=delete_and_stop)


def test_an_output_that_appears_is_not_replaced(short, reference, tmp_path):
    path = tmp_path / "data.h5"

    def other(done, total):
        path.write_text("of another run")

    with pytest.raises(OutputError, match=r"has appeared .* kept as data\.h5\.part: rename it"):
        generate(short, N, path, seed=5, progress=other)
    assert path.read_text() == "of another run"
    assert content(tmp_path / "data.h5.part") == reference
    path.unlink()
    assert generate(short, N, path, seed=5).n_resumed == N
    assert content(path) == reference


RIVAL = """
import sys, time
from pathlib import Path
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.sim.output.recording import DataError

folder, me, other, rounds = Path(sys.argv[1]), sys.argv[2], sys.argv[3], int(sys.argv[4])
recipe = load_recipe("bilge-pump-small", {overrides!r})
for number in range(rounds):
    (folder / f"ready-{{number}}-{{me}}").touch()
    while not (folder / f"ready-{{number}}-{{other}}").exists():
        time.sleep(0.0005)
    try:
        generate(recipe, 2, folder / f"{{number}}.h5", seed=5)
        print("made", flush=True)
    except DataError as error:
        print(error, flush=True)
"""


def test_of_two_runs_at_once_one_goes_on_and_the_other_says_who_holds_it(short, tmp_path):
    rounds = 25
    generate(short, 2, tmp_path / "reference.h5", seed=5)
    script = RIVAL.format(overrides=SHORT)
    rivals = [
        subprocess.Popen(
            [sys.executable, "-P", "-c", script, str(tmp_path), *names, str(rounds)],
            stdout=subprocess.PIPE,
            text=True,
        )
        for names in ("ab", "ba")
    ]
    said = [rival.communicate(timeout=500)[0].splitlines() for rival in rivals]
    assert [len(lines) for lines in said] == [rounds, rounds]
    held = 0
    for number, lines in enumerate(zip(*said, strict=True)):
        assert sorted(line == "made" for line in lines) == [False, True], lines
        [refusal] = [line for line in lines if line != "made"]
        holder = rivals[lines.index("made")].pid
        assert f"is being written by process {holder} on " in refusal or "h5 exists;" in refusal
        held += "is being written" in refusal
        assert content(tmp_path / f"{number}.h5") == content(tmp_path / "reference.h5")
    assert held > 0
    assert not [*tmp_path.glob("*.lock"), *tmp_path.glob("*.part"), *tmp_path.glob("*.tmp")]


# -- the file ----------------------------------------------------------------------------------


def test_the_file_tells_all(short, tmp_path):
    path = tmp_path / "data.h5"
    summary = generate(short, 4, path, seed=5, truth=True)
    scene = load_scene("bilge-pump")
    with DataSet(path) as data:
        head, rows = data.attributes, data.manifest
        hidden, item = data.truth(0), data[0]
    assert (head.origin, head.tacho, head.sample_rate) == ("simulated", "tacho", 25_600.0)
    assert head.severities == ("diametral_clearance_crankpin_m",)
    assert head.grade_edges == scene.wear.grade_edges_diametral
    assert head.condemning_limit == scene.wear.condemning_diametral
    assert (head.recipe, head.scene, head.seed) == (short.text, short.scene_text, 5)
    assert rows["group"].tolist() == [0, 0, 1, 1]
    assert rows["status"].tolist() == ["ok"] * 4
    assert rows["rung_joint"].tolist() == ["compliant"] * 4
    clearance = rows["diametral_clearance_crankpin_m"].to_numpy()
    assert_array_equal(rows["grade"], np.searchsorted(head.grade_edges, clearance, side="right"))
    assert rows["residual"].isna().all()  # no solution gives it yet
    assert item.signal.shape == (3, 6400)
    assert hidden["pin_force_n"].shape == (6400, 2)
    # 5 V for 10 of 360 deg; one revolution and a bit holds one pulse or two
    assert 0.01 < item.tacho_signal.mean() / 5 < 0.06
    assert (summary.n_records, summary.n_groups, summary.failures) == (4, 2, {})
    assert sum(summary.grades.values()) == 4


def test_each_record_is_the_simulation_of_its_sample(short, reference, tmp_path):
    sample = list(sample_records(short, N, seed=5))[4]
    alone = work.simulate(sample.scene, seed=sample.seed).signal.tobytes()
    size = len(alone)
    assert reference[0][4 * size : 5 * size] == alone


def test_failures_keep_their_row(tmp_path):
    recipe = load_recipe("bilge-pump-small", {**SHORT, "joint.crankpin.stiffness": "0.1 MN/m"})
    with pytest.raises(DataError, match="0 of 2 records are simulated, must be >= 1; record 0: a "):
        generate(recipe, 2, tmp_path / "data.h5")
    with DataSet(tmp_path / "data.h5") as data:
        assert data.manifest["status"].tolist() == ["overlap"] * 2
        assert data.manifest["grade"].min() >= 0
        assert not data[0].signal.any()


def test_scenes_the_simulation_refuses_keep_their_row(short, tmp_path, monkeypatch):
    middle = load_scene("bilge-pump").joint.crankpin.friction
    simulate_many = work.simulate_many

    def particular(jobs, **options):
        for number, found in simulate_many(jobs, **options):
            scene = jobs[number][0]
            fault = SceneError(scene.name, ["joint.crankpin.friction is beyond the model"])
            yield number, fault if scene.joint.crankpin.friction > middle else found

    monkeypatch.setattr(work, "simulate_many", particular)
    samples = list(sample_records(short, 12, seed=1))
    expected = [sample.scene.joint.crankpin.friction > middle for sample in samples]
    summary = generate(short, 12, tmp_path / "data.h5", seed=1)
    assert 0 < sum(expected) < 12
    assert summary.failures == {"refused": sum(expected)}
    assert "friction is beyond the model" in summary.first_failures[0]
    with DataSet(tmp_path / "data.h5") as data:
        assert (data.manifest["status"] == "refused").tolist() == expected
        assert [not item.signal.any() for item in data] == expected


def test_existing_output_is_refused_before_any_work(short, tmp_path, monkeypatch):
    path = tmp_path / "data.h5"
    path.write_text("mine")
    monkeypatch.setattr(work, "simulate", None)
    with pytest.raises(DataError, match="exists"):
        generate(short, N, path)
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n": 0}, "n = 0 must be >= 1"),
        ({"seed": -1}, "seed = -1 must be >= 0"),
        ({"jobs": 0}, "jobs = 0 must be >= 1"),
    ],
)
def test_options_out_of_bounds(short, tmp_path, options, message):
    with pytest.raises(ValueError, match=message):
        generate(short, path=tmp_path / "data.h5", **{"n": 1, **options})
    assert list(tmp_path.iterdir()) == []


# -- what is drawn -----------------------------------------------------------------------------


def drawn(recipe, n, seed=0):
    """Every number drawn [shape=(n,)] by path, shapes by entry; and the rows."""
    values, rows = defaultdict(list), []
    for sample in sample_records(recipe, n, seed=seed):
        rows.append(sample.row)
        for path, value in sample.drawn.items():
            entries = value.items() if isinstance(value, dict) else [("", value)]
            for key, number in entries:
                values[f"{path}.{key}".rstrip(".")].append(number)
    return {path: np.array(numbers) for path, numbers in values.items()}, rows


@pytest.fixture(scope="module")
def standard():
    return drawn(load_recipe("bilge-pump-narrow"), 2000)


def test_standard_ranges_are_filled_and_kept(standard):
    values, _ = standard
    scene = load_scene("bilge-pump")
    mode, pin = scene.casing.modes[3], scene.joint.crankpin
    turn = 2 * np.pi
    ranges = {
        CRANKPIN: (0.05e-3, 0.465e-3),
        "casing.modes.3.frequency": (0.97 * mode.frequency, 1.03 * mode.frequency),
        "casing.modes.3.damping_ratio": (0.6 * mode.damping_ratio, 1.4 * mode.damping_ratio),
        "joint.crankpin.stiffness": (0.7 * pin.stiffness, 1.4 * pin.stiffness),
        "joint.crankpin.damping": (0.5 * pin.damping, 2 * pin.damping),
        "joint.crankpin.friction": (0.02, 0.08),
        "sensors.0.gain": (0.95, 1.05),
        "drive.speed": (0.85 * scene.drive.speed, 1.15 * scene.drive.speed),
        "pressure.discharge": (0.8 * 0.3e6, 1.2 * 0.3e6),
        "drive.start_angle": (0.0, turn),
    }
    for path, (low, high) in ranges.items():
        found = values[path]
        assert low <= found.min()
        assert found.max() <= high
        # 1000 draws leave more than 1 % of the range free at an end with probability 4e-5
        assert found.min() < low + 0.01 * (high - low)
        assert found.max() > high - 0.01 * (high - low)
    # half of a log-factor 0.5...2 lies below 1; 1000 draws: 4 sigma = 0.063
    assert abs(np.mean(values["joint.crankpin.damping"][::2] < pin.damping) - 0.5) < 0.063


def test_mode_shapes_move_by_five_per_cent_of_their_norm():
    scene = load_scene("bilge-pump")
    for sample in sample_records(load_recipe("bilge-pump-narrow"), 3):
        for mode, moved in zip(scene.casing.modes, sample.scene.casing.modes, strict=True):
            old = np.array(list(mode.shape.values()))
            new = np.array([moved.shape[place] for place in mode.shape])
            assert_allclose(np.linalg.norm(new - old), 0.05 * np.linalg.norm(old), rtol=1e-12)


def test_machines_are_drawn_once_per_group_and_differ(standard):
    values, rows = standard
    assert [row["group"] for row in rows] == [i // 2 for i in range(2000)]
    for path, numbers in values.items():
        pairs = numbers.reshape(-1, 2)
        per_record = path in (CRANKPIN, "drive.speed", "pressure.discharge", "drive.start_angle")
        assert (
            np.all(pairs[:, 0] != pairs[:, 1]) if per_record else np.ptp(pairs, axis=1).max() == 0
        )
        assert len(np.unique(pairs[:, 0])) == 1000


def test_draws_are_independent(standard):
    values, _ = standard
    # one record of each machine: independent draws. Every pair of the 73 numbers is compared,
    # 2628 rank correlations of deviation 1/sqrt(999) = 0.032; the largest of so many normal
    # values passes 5 deviations with probability 2628 * 6e-7 = 0.002. Entries of one mode shape
    # share one vector of fixed norm but are uncorrelated all the same.
    ranks = np.array([rankdata(numbers[::2]) for numbers in values.values()])
    correlation = np.corrcoef(ranks) - np.eye(len(ranks))
    assert len(ranks) == 73
    assert np.abs(correlation).max() < 5 / np.sqrt(999)


def test_machine_and_record_of_one_number_are_independent(standard):
    values, _ = standard
    # machine k and record k, each by the first number of its stream; bound as above
    machine = rankdata(values["casing.modes.0.frequency"][::2])
    record = rankdata(values["drive.speed"][:1000])
    assert abs(np.corrcoef(machine, record)[0, 1]) < 5 / np.sqrt(999)


def test_severity_does_not_know_its_group(standard):
    values, _ = standard
    level = np.log(values[CRANKPIN] / 0.05e-3) / np.log(9.3)
    pairs = level.reshape(-1, 2)
    # two of 16 strata without repetition: correlation -1/15; plus 4 deviations of 1/sqrt(1000)
    correlation = np.corrcoef(pairs.T)[0, 1]
    assert abs(correlation + 1 / (STRATA - 1)) < 4 / np.sqrt(1000)
    # the step within a machine is spread, not one or two values: all 16ths of (-1, 1) but the
    # outermost (probability 2e-3 each) and the middle ones (same stratum) are visited
    steps, _ = np.histogram(pairs[:, 1] - pairs[:, 0], bins=np.linspace(-1, 1, 33))
    assert np.count_nonzero(steps) >= 28


def test_severity_is_stratified_from_the_start(standard):
    values, _ = standard
    level = np.log(values[CRANKPIN] / 0.05e-3) / np.log(9.3)
    strata = np.floor(level * STRATA).astype(int).reshape(-1, STRATA)
    assert_array_equal(np.sort(strata, axis=1), np.tile(np.arange(STRATA), (len(strata), 1)))
    # log-uniform: exact at the borders of strata; inside one, 125 free draws miss by
    # sqrt(125) / 2 = 5.6 of 2000 at most, of which 4 deviations (free draws in all: 4 * 22)
    fractions = np.sort(level)
    assert np.abs(fractions - (np.arange(2000) + 0.5) / 2000).max() < 4 * 5.6 / 2000


def test_no_two_recipes_share_a_machine():
    recipes = [load_recipe(name) for name in recipe_names()]
    first = [next(sample_records(each)).drawn for each in recipes if not each.table.machines_of]
    assert len(first) > 10
    assert len({drawn["sensors.0.gain"] for drawn in first}) == len(first)


def test_the_shifted_set_lies_outside_the_standard_one():
    values, rows = drawn(load_recipe("bilge-pump-shifted"), 400)
    pressure = values["pressure.discharge"] / 0.3e6
    assert np.all((np.abs(pressure - 1) >= 0.2) & (np.abs(pressure - 1) <= 0.4))
    # both bands equally wide: 200 of 400, 4 deviations = 40
    assert abs(np.count_nonzero(pressure > 1) - 200) < 40
    # each band is filled: 200 draws leave 5 % of it free at an end with probability 4e-5
    ends = [pressure[pressure < 1].max(), pressure[pressure > 1].min()]
    assert_allclose(ends, [0.8, 1.2], atol=0.01)
    speed = np.array([row["speed_hz"] for row in rows])
    assert 3.5 <= speed.min() < 3.6
    assert 6.4 < speed.max() <= 6.5


@pytest.mark.parametrize("name", recipe_names())
def test_every_record_holds_twenty_revolutions(name):
    recipe = load_recipe(name)
    speeds = [axis.bands[0][0] for axis in recipe.record if axis.path == "drive.speed"]
    assert bool(speeds) == getattr(recipe.scene, "running", True)
    assert all(recipe.scene.duration * slowest >= 20 for slowest in speeds)
    limits = wear_limits(recipe.scene, recipe.severity_columns[0])
    assert limits.as_new == recipe.severity.bands[0][0]
    if name.endswith("-healthy"):
        assert recipe.severity.bands[0][1] < limits.grade_edges[0]
    else:
        assert_allclose(recipe.severity.bands[0][1], 1.5 * limits.condemning)


# -- recipes at fault --------------------------------------------------------------------------

GOOD = """
name = "mine"
scene = "bilge-pump"
records = 4
[severity]
path = "joint.crankpin.diametral_clearance"
low = "0.05 mm"
high = "0.4 mm"
"""


def faults_of(text, tmp_path, overrides=None):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(RecipeError) as caught:
        load_recipe(file, overrides)
    return caught.value.faults


def draw(path, rest, table="machine"):
    return f'[[{table}]]\npath = "{path}"\n{rest}\n'


def test_all_faults_at_once(tmp_path):
    text = GOOD.replace("records = 4", "records = 0\nrecord_per_group = 2\n").replace(
        'name = "mine"', ""
    )
    assert faults_of(text, tmp_path) == [
        "name is missing (name of the recipe, kept in the data set); add it",
        "records = 0 must be >= 1 (number of records by default)",
        "record_per_group is an unknown key; did you mean 'records_per_group'?",
    ]


def test_all_draws_at_fault_at_once(tmp_path):
    factor = 'distribution = "factor"\nlow = 0.9\nhigh = 1.1'
    text = GOOD + "".join(
        [
            draw("drive.sped", factor),
            draw("casing.*.frequency", factor),
            draw("drive.start_angle", factor),
            draw("joint.crankpin.friction", 'distribution = "uniform"\nlow = 0.5\nhigh = 1.5'),
            draw("drive.speed", 'distribution = "uniform"\nlow = "3 mm"\nhigh = "6 Hz"'),
            draw("rod.mass", 'distribution = "factor"\nlow = 1.1\nhigh = 0.9'),
            draw("rod.mass", factor),
            draw("rod.mass", factor),
            draw("duration", factor, "record"),
        ]
    )
    faults = faults_of(text, tmp_path)
    expected = [
        "machine.0 (drive.sped): drive.sped is an unknown key; did you mean 'speed'?",
        "machine.1 (casing.*.frequency): casing.*.frequency: '*' stands where the scene has no",
        "machine.2 (drive.start_angle): drive.start_angle = 0.0 must not be 0 to be multiplied",
        "machine.3 (joint.crankpin.friction): joint.crankpin.friction = 1.5 must be <= 1",
        "machine.4 (drive.speed): drive.speed = '3 mm' has unit 'mm', not one of rotation speed",
        "machine.5 (rod.mass): rod.mass: 1.1 to 0.9 must rise and not overlap",
        "duration is drawn, must be one for all records; put it in [fixed]",
        "rod.mass is drawn 2 times, must be once",
    ]
    assert len(faults) == len(expected)
    for fault, start in zip(faults, expected, strict=True):
        assert fault.startswith(start)


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        ('distribution = "factor"', "give low and high, or bands, and not both"),
        ('distribution = "factor"\nlow = 1', "give low and high, or bands, and not both"),
        ('distribution = "factor"\nlow = 1\nhigh = 2\nscale = 0.1', "scale is for relative-normal"),
        ('distribution = "relative-normal"\nlow = 1', "takes scale and nothing else"),
        ('distribution = "normal"\nlow = 1\nhigh = 2', "must be 'uniform', 'log-uniform'"),
        ('distribution = "relative-normal"\nscale = 0.1', "is no table of numbers"),
        ('distribution = "factor"\nbands = [[0.9, 1.1], [1.0, 1.2]]', "must rise and not overlap"),
        ('distribution = "log-factor"\nlow = -1.0\nhigh = 1.0', "must be > 0 for a logarithm"),
        ('distribution = "factor"\nlow = "1 kg"\nhigh = 2', "a factor takes plain numbers"),
    ],
)
def test_a_draw_says_one_thing(tmp_path, rest, message):
    (fault,) = faults_of(GOOD + draw("rod.mass", rest), tmp_path)
    assert message in fault


def test_severity_and_fixed_values_at_fault(tmp_path):
    swapped = GOOD.replace("0.05 mm", "0.5 mm")
    assert "0.0005 to 0.0004 must rise" in faults_of(swapped, tmp_path)[0]
    other = GOOD.replace("joint.crankpin.diametral_clearance", "crank.radius")
    assert "is no known severity; choose one of joint.crank" in faults_of(other, tmp_path)[0]
    assert faults_of(GOOD, tmp_path, {"sensors.*.nois": 1}) == [
        "fixed.sensors.*.nois: sensors.0.nois is an unknown key; did you mean 'noise'?",
        "fixed.sensors.*.nois: sensors.1.nois is an unknown key; did you mean 'noise'?",
    ]


def test_unknown_recipes_and_scenes_are_named(tmp_path):
    with pytest.raises(RecipeError, match="did you mean 'bilge-pump-small'"):
        load_recipe("bilge-pump-smal")
    faults = faults_of(GOOD.replace('"bilge-pump"', '"bilge-pum"'), tmp_path)
    assert "did you mean 'bilge-pump'?" in faults[0]


# -- bounds ------------------------------------------------------------------------------------


def test_records_and_seed_have_upper_bounds(short, tmp_path):
    with pytest.raises(RecipeError, match=r"n = 100000001 must be >= 1 and <= 100000000"):
        generate(short, MOST_RECORDS + 1, tmp_path / "data.h5")
    with pytest.raises(RecipeError, match=r"seed = 9223372036854775808 must be .* choose another"):
        generate(short, 1, tmp_path / "data.h5", seed=LARGEST_SEED + 1)
    with pytest.raises(DataError, match=r"must be >= .* GB; ask for fewer"):
        generate(short, MOST_RECORDS, tmp_path / "data.h5")
    assert list(tmp_path.iterdir()) == []


def test_no_more_workers_than_records(short, tmp_path, monkeypatch):
    asked = []

    def noted(function, items, *, jobs, **_):
        asked.append(jobs)
        return in_order(function, items, jobs=1)

    monkeypatch.setattr(generation, "in_order", noted)
    generate(short, 1, tmp_path / "data.h5", jobs=10**6)
    assert asked == [1]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("records = 4", "records = 1_000_000_001", "records = 1000000001 must be <= 1e+08"),
        ("records = 4", "records = 'x'", "records = 'x' must be a whole number"),
        ("records = 4", "records = 4\nfixed = 3", "fixed = 3 must be a table"),
        ("records = 4", "records = 4\nmachine = 3", "machine = 3 must be a list"),
        (
            "records = 4",
            "records = 4\nfixed = { duration = [1] }",
            "fixed.duration = [1] must be a number or a text with a unit",
        ),
    ],
)
def test_tables_of_the_wrong_kind(tmp_path, old, new, says):
    assert old in GOOD
    [fault] = faults_of(GOOD.replace(old, new), tmp_path)
    assert says in fault


def test_a_failed_recording_leaves_no_unfinished_file_but_that_of_others(tmp_path, monkeypatch):
    scene = load_scene("bilge-pump", SHORT)
    solution = simulate(scene, seed=0)
    other = tmp_path / "other.h5.part"
    other.write_bytes(b"of an interrupted run")
    save_solution(scene, solution, tmp_path / "other.h5", seed=0)
    assert other.read_bytes() == b"of an interrupted run"

    def full(*_, **__):
        raise OSError("no space")

    monkeypatch.setattr(DataSetWriter, "write", full)
    with pytest.raises(OSError, match="no space"):
        save_solution(scene, solution, tmp_path / "mine.h5", seed=0)
    assert sorted(tmp_path.iterdir()) == [tmp_path / "other.h5", other]


def test_a_split_that_cannot_be_made_is_bad_data():
    """So that the command line answers with one message and not with a traceback."""
    with pytest.raises(DataError, match=r"1 group\(s\), must be >= 2"):
        group_split([1, 1])
    with pytest.raises(DataError, match="test_fraction = nan must be > 0 and < 1"):
        group_split([1, 2], test_fraction=float("nan"))


# --- batches --------------------------------------------------------------------------------------


def test_records_of_a_batch_are_of_one_kind_but_for_what_is_left_and_each_comes_once():
    recipe = load_recipe("bilge-pump-standard")
    samples = list(sample_records(recipe, 160, seed=0))
    assert len({alike(each.scene) for each in samples}) > 2
    batches = list(generation._batches(samples, 8))
    assert sorted(job.index for batch in batches for job in batch) == list(range(160))
    kinds = [{alike(job.scene) for job in batch} for batch in batches]
    mixed = [len(kind) > 1 for kind in kinds]
    assert mixed.index(True) > 2
    assert [len(batch) for batch in batches[:-1]] == [8] * (len(batches) - 1)
    left = Counter(alike(job.scene) for batch in batches[mixed.index(True) :] for job in batch)
    assert max(left.values()) < 8  # else a batch of that kind were full


def test_records_that_do_not_fill_a_batch_of_their_kind_fill_lanes_with_neighbours():
    """Records with and without chambers never share lanes: one batch at most holds both."""
    recipe = load_recipe("bilge-pump-standard")
    samples = list(sample_records(recipe, 160, seed=0))
    batches = list(generation._batches(samples, 32))
    assert sorted(job.index for batch in batches for job in batch) == list(range(160))
    rest = [batch for batch in batches if len(batch) < 32]
    assert [len(batch) for batch in rest[:-1]] == [16] * (len(rest) - 1)
    mixed = [batch for batch in rest if len({alike(job.scene) for job in batch}) > 1]
    assert len(mixed) < len(rest)
    chambers = [{job.scene.pressure.rung == "chamber" for job in batch} for batch in mixed]
    assert chambers.count({True, False}) <= 1
    assert {True} in chambers
    assert {False} in chambers


def test_the_first_failures_are_those_of_the_first_records_whatever_ends_first():
    tally = generation._Tally(9, None)
    for index in (7, 3, 8, 1, 5):
        tally.note(
            work.RecordOutcome(index, np.zeros((1, 1), np.float32), {}, {}, f"fault {index}")
        )
    assert [index for index, _ in tally.faults] == [1, 3, 5]
