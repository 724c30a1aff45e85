"""Sweeps of a scene: the smallest change that is told, going on, workers, files, refusals."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import t as student
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.sweep import sweep as sweep_module
from wearstate.diagnose.sweep.axes import SweepError, parse_axis
from wearstate.diagnose.sweep.detect import detect
from wearstate.diagnose.sweep.sweep import kept_runs, measure, sweep_of, sweep_plan
from wearstate.diagnose.sweep.text import conclusion, sweep_table
from wearstate.sim.fidelity import runs as pilot_runs
from wearstate.sim.fidelity.runs import Outcome
from wearstate.sim.machine.simulate import simulate_many

CLEARANCE = "joint.crankpin.diametral_clearance"
OVER = ("drive.speed=300..400rpm/2", f"{CLEARANCE}=.1,.3mm")
SHOW = ("acc_x.rms", "pin.peak", "order.2")
TINY = {"duration": 0.45}


def tiny(**options):
    return sweep_plan("bilge-pump", OVER, given=TINY, show=SHOW, starts=2, **options)


def invoke(*arguments):
    return CliRunner().invoke(cli, ["sweep", *map(str, arguments)])


def command(output, *more):
    over = [word for axis in OVER for word in ("--over", axis)]
    about = ("--set", "duration=0.45", "--show", ",".join(SHOW), "--starts", 2, "-o", output)
    return invoke("bilge-pump", *over, *about, "-j", 1, *more)


# --- the smallest change


def test_a_straight_line_with_known_scatter():
    x, noise = [1.0, 2.0, 4.0], np.array([-1.0, 0.0, 1.0])  # standard deviation 1
    found = detect(x, [10 * v + noise for v in x], 0.95)
    threshold = (student.ppf(0.975, 6) + student.ppf(0.95, 6)) * math.sqrt(4 / 3)
    assert found.threshold == pytest.approx(threshold)
    assert found.change == pytest.approx(threshold / 10)  # cubics keep a straight line
    assert (found.slope, found.freedom, found.rises) == (pytest.approx(10), 6, True)
    falling = detect(x, [-10 * v + noise for v in x], 0.95)
    assert falling.change == pytest.approx(found.change)
    backwards = detect(x[::-1], [10 * v + noise for v in x[::-1]], 0.95)
    assert backwards.change == pytest.approx(found.change)


def test_a_change_counts_where_all_larger_ones_stand_out_too():
    noise = np.array([-0.1, 0.0, 0.1])
    returns = detect([0, 1, 2, 3], [noise, 9 + noise, noise, 9 + noise])
    assert 2 < returns.change < 3
    assert math.isinf(detect([0, 1, 2], [noise, 9 + noise, noise]).change)


def test_without_scatter_nothing_is_known_but_of_truths_everything():
    assert math.isnan(detect([0, 1], [[1.0], [2.0]]).change)
    exact = detect([0, 1], [[1.0, 1.0], [2.0, 2.0]])
    assert 0 < exact.change < 1e-6
    assert math.isinf(detect([0, 1], [[1.0, 1.0], [1.0, 1.0]]).change)
    assert math.isnan(detect([0, 1], [[], [2.0, 3.0]]).change)


def test_as_many_false_alarms_and_finds_as_it_says():
    """6,000 trials: a share of 5 % scatters by 0.3 %; the shifted t costs some tenths."""
    rng = np.random.default_rng(7)
    alarms = finds = 0
    for _ in range(6000):
        rows = rng.normal(0, 1, (3, 5))
        found = detect([0, 1, 2], list(rows))
        limit = student.ppf(0.975, found.freedom) * found.scatter * math.sqrt(1 + 1 / 5)
        alarms += abs(rng.normal() - rows[0].mean()) > limit
        finds += rng.normal() + found.threshold - rows[0].mean() > limit
    assert alarms / 6000 == pytest.approx(0.05, abs=0.01)
    assert finds / 6000 == pytest.approx(0.95, abs=0.015)


# --- the plan


@pytest.mark.parametrize(
    ("text", "numbers", "unit"),
    [
        ("a.b=200..400rpm/3", (200, 300, 400), "rpm"),
        ("a.b=200..400/3 rpm", (200, 300, 400), "rpm"),
        ("a.b=200rpm..400rpm", (200, 300, 400), "rpm"),
        ("a.b=1..2MN/m/2", (1, 2), "MN/m"),
        ("a.b=.1,.2,.3mm", (0.1, 0.2, 0.3), "mm"),
        ("a.b=-1.5..1e1", (-1.5, 4.25, 10), ""),
        ("a.b=3,2,1", (3, 2, 1), ""),
    ],
)
def test_axes(text, numbers, unit):
    axis = parse_axis(text, 3)
    assert axis.numbers == pytest.approx(numbers)
    assert axis.unit == unit


@pytest.mark.parametrize(
    "text", ["a.b", "a.b=", "a.b=1", "a.b=1,3,2", "a.b=1..x", "a.b=1,x", "a.b=1mm,2m", "a.b=1..2/1"]
)
def test_axes_that_are_none(text):
    with pytest.raises(SweepError, match="must"):
        parse_axis(text)


def test_all_faults_at_once_with_near_matches(tmp_path):
    done = invoke(
        "bilge-pump", "--over", "drive.speet=1,2Hz", "--over", f"{CLEARANCE}=1,x", "--show",
        "acc_x.rsm,pin.peek", "-o", tmp_path / "a.html",
    )  # fmt: skip
    assert done.exit_code == 2
    for words in ("did you mean 'speed'", "'x' must be a number", "'acc_x.rsm'", "'pin_peak'"):
        assert words in done.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("over", "more", "says"),
    [
        ("drive.start_angle=0,1", (), "use --starts"),
        ("drive.speed=4,5", ("--set", "drive.speed=5"), "both set and swept"),
        ("joint.crankpin.law=1,2", (), "joint.crankpin.law"),
        (f"{CLEARANCE}=1,2kg", (), "unit 'kg'"),
        ("drive.speed=4,5", ("--show", "*"), "must be <= 200"),
    ],
)
def test_what_cannot_be_swept(over, more, says):
    done = invoke("bilge-pump", "--set", "duration=0.5", "--over", over, *more)
    assert done.exit_code == 2, done.output
    assert says in done.output


# --- runs


def test_workers_change_nothing_and_a_sweep_goes_on(tmp_path):
    plan = tiny()
    alone = kept_runs(None, plan)
    measure(plan, alone)
    whole = sweep_table(sweep_of(plan, alone))
    assert whole["runs"] == {"done": 8, "planned": 8}
    assert [q["name"] for q in whole["quantities"]] == [
        "acc_x.rms", "pin_peak", "acc_x.order_02.level_db", "acc_y.order_02.level_db",
    ]  # fmt: skip
    spread = kept_runs(None, plan)
    measure(plan, spread, jobs=2)
    assert sweep_table(sweep_of(plan, spread)) == whole

    part = tmp_path / "sweep.part.json"

    def stop(done, _):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        measure(plan, kept_runs(part, plan), progress=stop)
    again = kept_runs(part, plan)
    assert len(again) == 3
    assert not sweep_of(plan, again).finished
    measure(plan, again)
    assert sweep_table(sweep_of(plan, again)) == whole
    with pytest.raises(ValueError, match="axes, seed or quantities"):
        kept_runs(part, tiny(seed=1))


@pytest.mark.parametrize(("show", "beside"), [(SHOW, 20), ((*SHOW, "wrist.peak"), 0)])
def test_runs_side_by_side_have_the_values_of_each_alone(show, beside, monkeypatch):
    """Where what is shown needs no truth that only a run alone has."""
    lying = []
    monkeypatch.setattr(
        pilot_runs,
        "simulate_many",
        lambda runs, truth: lying.append(len(runs)) or simulate_many(runs, truth=truth),
    )
    plan = sweep_plan("bilge-pump", OVER, given=TINY, show=show, starts=5)
    found, alone = {}, {}
    measure(plan, Kept(found))
    assert sum(lying) == beside
    measure(replace(plan, truth=None), Kept(alone))
    assert sum(lying) == beside
    assert len(found) == 20
    assert found == alone


class Kept(dict):
    """Runs that no file keeps."""

    def __init__(self, runs):
        super().__init__()
        self.runs = runs

    def save(self):
        self.runs |= self


def test_the_command_goes_on_after_an_interrupt(tmp_path, monkeypatch):
    page = tmp_path / "sweep.html"
    real = sweep_module.measure

    def stopped(plan, kept, **options):
        def stop(done, _):
            if done == 5:
                raise KeyboardInterrupt

        return real(plan, kept, **{**options, "progress": stop})

    monkeypatch.setattr(sweep_module, "measure", stopped)
    done = command(page)
    assert done.exit_code == 1
    assert "the same command continues" in done.stderr
    assert "so far 5 of 8 runs" in page.read_text()
    monkeypatch.undo()
    done = command(page)
    assert done.exit_code == 0, done.output
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.html"]
    text = page.read_text()
    for words in ("(simulated)", "shows first at speed", "smallest change", "±", "<img"):
        assert words in text
    assert command(page).exit_code == 2  # it exists

    table = tmp_path / "sweep.csv"
    assert command(table).exit_code == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert len(rows) == 8
    assert {float(row[CLEARANCE]) for row in rows} == {1e-4, 3e-4}
    assert all(float(row["acc_x.rms"]) > 0 and not row["fault"] for row in rows)


def test_a_point_that_fails_is_told(tmp_path):
    done = invoke(
        "bilge-pump", "--set", "duration=0.45", "--over", "numerics.step=1e-5,3e-4s",
        "--show", "acc_x.rms", "--starts", 2, "-j", 1, "-o", tmp_path / "a.json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "2 of 4 runs have no values" in done.output
    assert sum(json.loads((tmp_path / "a.json").read_text())["faults"].values()) == 2


# --- words


def test_the_conclusion_names_where_it_shows_first():
    """Made up: at 300 rpm the level rises by 1 in 0.1 mm, at 400 rpm by 4, scatter 0.01."""
    plan = tiny()

    def outcome(point, start):
        gain = (5.0, 20.0)[point[0]] * point[1] * 0.2 + 0.01 * start
        return Outcome({each.name: (gain, "", 0.0) for each in plan.shown}, "")

    kept = {f"{p[0]},{p[1]} {s}": outcome(p, s) for p, s in plan.runs}
    lines = conclusion(sweep_of(plan, kept))
    assert len(lines) == 2
    assert lines[0].startswith("Crank pin diametral clearance shows first at speed 400 rpm, in ")
    assert "from 0.1 mm" in lines[0]
    assert lines[1].startswith("At 300 rpm it takes 0.0")


def test_one_axis_has_slopes_and_one_start_no_judgement():
    done = invoke(
        "bilge-pump", "--set", "duration=0.45", "--over", f"{CLEARANCE}=.1,.3mm", "--show",
        "pin_peak", "--starts", 1, "-j", 1, "--json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    table = json.loads(done.stdout)
    assert "--starts 2" in table["conclusion"][0]
    [row] = table["rows"]
    assert row["slope"] == pytest.approx((row["mean"][1] - row["mean"][0]) / 2e-4)
    assert row["judged"] is False
