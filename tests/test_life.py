"""Lives of machines: the growth law against its closed form, maintenance, and data sets of them."""

import math
import re
from dataclasses import replace
from itertools import pairwise, repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_equal
from scipy.integrate import simpson
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.life import LIFE_COLUMNS
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.text import RecipeError, recipe_text
from wearstate.sim.scene.load import load_scene
from wearstate.sim.wear.archard import grade
from wearstate.sim.wear.life import Maintenance, RunningIn, WearLaw, life_history
from wearstate.sim.wear.rate import joint_wear

HOUR = 3600.0
GAIN = 200.0  # m of play per m^3
RATE = 1e-15  # m^2/N


def law_of(power, *, knots=9, last=2e-6):
    """Play in proportion to volume, sliding power from a function of the volume."""
    volume = np.linspace(0, last, knots)
    return WearLaw(
        volume=volume,
        power=np.asarray([power(v) for v in volume], dtype=float),
        severity_of=lambda v: GAIN * v,
        volume_of=lambda s: s / GAIN,
    )


def rising(volume):
    return 1000 * math.exp(volume / 1e-6)


STEADY = law_of(lambda _: 1000.0)
LAW = law_of(rising)
DEFAULTS = {"as_new": repeat(1e-4), "limit": 2e-4, "end": 3e-4, "until": 1e6}


def life(law=STEADY, rate=RATE, **changes):
    return life_history(law, rate, **{**DEFAULTS, **changes})


# -- the law of growth --------------------------------------------------------------------------


def test_growth_is_the_solution_of_its_equation():
    straight = law_of(lambda v: 1000 + 5e8 * v, knots=2)
    work = 8e-10
    # dV/dw = a + b V from 0
    expected = 1000 / 5e8 * math.expm1(5e8 * work)
    assert straight.grown(0.0, work) == pytest.approx(expected, rel=1e-12)
    assert straight.work(expected) == pytest.approx(work, rel=1e-12)


def runge_kutta(law, volume, work, steps):
    h = work / steps
    for _ in range(steps):
        a = law.power_at(volume)
        b = law.power_at(volume + h / 2 * a)
        c = law.power_at(volume + h / 2 * b)
        d = law.power_at(volume + h * c)
        volume += h / 6 * (a + 2 * b + 2 * c + d)
    return volume


def test_stepping_the_equation_approaches_the_closed_form_at_its_order():
    straight = law_of(lambda v: 1000 + 5e8 * v, knots=2)  # one segment: smooth
    exact = straight.grown(0.0, 2e-9)
    errors = [abs(runge_kutta(straight, 0.0, 2e-9, n) - exact) for n in (4, 8, 16)]
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4, atol=0.15)


def test_the_table_of_rates_converges_at_second_order():
    # of P = P0 exp(V / V0) the work is V0 / P0 (1 - exp(-V / V0)), in closed form
    exact = 1e-6 / 1000 * -math.expm1(-2.0)
    errors = [abs(law_of(rising, knots=n).work(2e-6) - exact) for n in (5, 9, 17, 33)]
    assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2, atol=0.1)


@given(st.floats(0, 1.9e-6), st.floats(0, 3e-10))
def test_growth_and_work_are_inverse(volume, work):
    grown = LAW.grown(volume, work)
    # rounding of two sums of work, up to 9e-10 m^2 s/N, at up to 7 kW
    assert grown >= volume - 1e-20
    assert LAW.work(grown) - LAW.work(volume) == pytest.approx(work, abs=1e-23)


def test_a_law_without_wear_is_refused():
    with pytest.raises(ValueError, match=r"volume = .* must be two or more that rise; power = "):
        replace(LAW, volume=LAW.volume[::-1], power=0 * LAW.power)


# -- running in ---------------------------------------------------------------------------------


@given(st.floats(0, 100), st.floats(1, 1e6), st.floats(0, 1e8))
def test_age_and_equivalent_age_are_inverse(excess, time, age):
    running_in = RunningIn(excess=excess, time=time)
    # the slope is at most 1 + excess; Lambert's function is good to 1e-14 of its argument
    assert running_in.age(running_in.equivalent(age)) == pytest.approx(
        age, rel=1e-9, abs=1e-9 * time
    )


def test_running_in_adds_a_fixed_volume():
    plain, fresh = life(), life(running_in=RunningIn(excess=3.0, time=1e4))
    # after ten time constants all of excess times time has been worn, but for exp(-10)
    added = RATE * 1000 * 3.0 * 1e4
    assert fresh.volume(1e5) - plain.volume(1e5) == pytest.approx(added, rel=1e-4)
    assert fresh.rate(0.0) == pytest.approx(4 * plain.rate(0.0), rel=1e-12)


# -- the invariant ------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [STEADY, LAW], ids=["steady", "rising"])
def test_volume_gained_is_the_wear_rate_times_the_sliding_work(law):
    running_in = RunningIn(excess=2.0, time=2e5)
    service = [Maintenance(restores=0.4, every=3e5)]
    history = life(law, running_in=running_in, maintenance=service, until=2e6)
    stretches = list(pairwise((0.0, *event_times(history))))
    assert len(stretches) > 5
    for begin, end in stretches[:6]:
        inside = np.linspace(begin, end * (1 - 1e-15), 2001)
        volume = np.array([history.volume(t) for t in inside])
        born = max(t for t in (0.0, *renewals(history)) if t <= begin)
        fresh = 1 + 2.0 * np.exp(-(inside - born) / 2e5)
        power = np.interp(volume, law.volume, law.power)
        work = simpson(fresh * power, x=inside)
        # Simpson over 2000 steps, across a few kinks of the table
        assert volume[-1] - volume[0] == pytest.approx(RATE * work, rel=1e-6)
        # and the play of the joint is that volume over its surface
        play = history.severity(inside[-1]) - history.severity(begin)
        assert play / GAIN == pytest.approx(RATE * work, rel=1e-6)


def event_times(history):
    """Of maintenance and renewals [s]."""
    return tuple(piece.begin for piece in history.pieces[1:])


def renewals(history):
    """Events after which the joint is as new."""
    return [t for t in event_times(history) if history.severity(t) == pytest.approx(1e-4)]


def test_the_volume_of_a_real_joint_follows_its_forces():
    # hour by hour with a simulation each, against the table of four; simulated
    recipe = load_recipe("bilge-pump-life")
    lives = recipe.lives
    volume = lives.law.volume_of(0.2e-3)
    seconds, steps = 2000 * HOUR, 4
    for _ in range(steps):
        scene = load_scene(
            "bilge-pump", {"joint.crankpin.diametral_clearance": lives.law.severity_of(volume)}
        )
        volume += 2e-17 * joint_wear(scene, "crankpin").power * seconds / steps
    table = lives.law.grown(lives.law.volume_of(0.2e-3), 2e-17 * seconds)
    gained = volume - lives.law.volume_of(0.2e-3)
    # the run-to-run scatter of the mean power, 0.3 %, and the table's as much again
    assert table - lives.law.volume_of(0.2e-3) == pytest.approx(gained, rel=0.01)
    # V = k P t of some 1290 W, and play = V times pi/2 / (pi R L) for a bed of half a turn
    assert gained == pytest.approx(2e-17 * 1290 * seconds, rel=0.01)
    play = lives.law.severity_of(volume) - 0.2e-3
    assert play == pytest.approx(gained / 2 / (0.03 * 0.05), rel=0.02)


# -- what happens in a life ---------------------------------------------------------------------


def test_without_wear_nothing_changes():
    kept = life(rate=0.0, maintenance=[Maintenance(restores=0.5, at=1.5e-4)])
    assert [kept.severity(t) for t in (0.0, 5e5, 1e6)] == pytest.approx([1e-4] * 3, rel=1e-14)
    assert event_times(kept) == ()
    assert math.isnan(kept.remaining(0.0))
    assert math.isnan(kept.share(1.0))


def test_a_joint_fails_at_the_end_and_is_renewed():
    # 1e-4 m at 1000 W, GAIN and RATE: 2e-10 m/s, so the limit after 5e5 s and the end after 1e6
    history = life(until=3.5e6, as_new=iter([1e-4, 1.2e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4]))
    assert event_times(history)[0] == pytest.approx(1e6)
    assert history.severity(1e6 * (1 - 1e-9)) == pytest.approx(3e-4)
    assert history.severity(1e6 * (1 + 1e-9)) == pytest.approx(1.2e-4)
    assert event_times(history)[1] == pytest.approx(1e6 + 0.9e6)  # from 0.12 to 0.3 mm
    assert [history.events(t) for t in (0.0, 1.5e6, 2e6)] == [0, 1, 2]
    assert history.share(7.5e5) == pytest.approx(0.75)
    assert history.remaining(1e5) == pytest.approx(4e5)
    assert history.remaining(7e5) == 0
    assert history.remaining(1.2e6) == pytest.approx(2e5)


def test_maintenance_takes_back_its_share_of_the_wear():
    history = life(maintenance=[Maintenance(restores=0.25, every=4e5)], until=2e6)
    assert event_times(history)[0] == pytest.approx(4e5)
    # 0.08 mm worn, a quarter of it taken back
    assert history.severity(4e5 * (1 + 1e-9)) == pytest.approx(1e-4 + 0.75 * 0.8e-4)
    assert history.remaining(0.0) == pytest.approx(6e5)  # 0.16 mm and 0.04 more
    later = event_times(history)[1]
    assert later == pytest.approx(8e5)
    assert history.severity(later * (1 + 1e-9)) == pytest.approx(1e-4 + 0.75 * 1.4e-4)


def test_maintenance_on_condition_comes_when_it_is_due():
    history = life(LAW, maintenance=[Maintenance(restores=1, at=1.8e-4)], until=2e6)
    first = event_times(history)[0]
    assert history.severity(first * (1 - 1e-9)) == pytest.approx(1.8e-4)
    assert history.severity(first) == pytest.approx(1e-4)
    assert math.isnan(history.remaining(0.0))  # the policy keeps it from the limit
    assert history.share(first / 2) == pytest.approx(0.5)


def test_what_is_due_together_is_done_together():
    rules = [Maintenance(restores=0.5, every=2e5), Maintenance(restores=1, every=4e5)]
    history = life(maintenance=rules, until=9e5)
    assert_allclose(event_times(history)[:4], [2e5, 4e5, 6e5, 8e5], rtol=1e-12)
    assert [history.events(t + 1) for t in (2e5, 4e5, 6e5, 8e5)] == [1, 3, 4, 6]


@given(
    st.floats(2e-16, 5e-15),
    st.floats(0, 5),
    st.sampled_from([None, 2.3e5, 7.7e5]),
    st.floats(0.1, 1),
    st.floats(0, 0.999),
)
def test_what_remains_is_the_way_to_the_limit(rate, excess, every, restores, place):
    rules = [] if every is None else [Maintenance(restores=restores, every=every)]
    history = life(LAW, rate=rate, running_in=RunningIn(excess=excess, time=1e5), maintenance=rules)
    time = place * 1e6
    left = history.remaining(time)
    if history.severity(time) >= 2e-4:
        assert left == 0
    elif not math.isnan(left):
        # rounding of times of 1e7 s; an event may fall on the very moment
        assert history.severity((time + left) * (1 - 1e-9)) == pytest.approx(2e-4, rel=1e-6)
        between = np.linspace(time, time + left * (1 - 1e-6), 50)
        assert max(history.severity(t) for t in between) < 2e-4 * (1 + 1e-9)
    assert math.isnan(history.share(time)) or 0 <= history.share(time) <= 1


def test_faster_wear_leaves_less_time():
    left = [life(LAW, rate=k * RATE).remaining(0.0) for k in (0.5, 1, 2)]
    assert_allclose(np.divide(left[:-1], left[1:]), 2, rtol=1e-12)  # time is work over rate


def test_a_machine_that_is_always_mended_is_refused():
    with pytest.raises(ValueError, match=r"maintenance = 10000 events by .* renew less often"):
        life(maintenance=[Maintenance(restores=0.1, every=1.0)])


def test_faults_of_a_life_come_together():
    rules = [Maintenance(restores=1, at=4e-4)]
    with pytest.raises(ValueError, match=re.compile("wear_rate = -1.*limit.*until.*0.at", re.S)):
        life(rate=-1, limit=5e-4, until=0, maintenance=rules)
    with pytest.raises(ValueError, match=r"restores = 2 .*; every = None and at = None"):
        Maintenance(restores=2)
    with pytest.raises(ValueError, match=r"excess = -1 .*; time = 0 s"):
        RunningIn(excess=-1, time=0)


# -- recipes ------------------------------------------------------------------------------------

SHORT = {"duration": "0.25 s", "settling_revolutions": 1}
CLEARANCE = "diametral_clearance_crankpin_m"


@pytest.fixture(scope="module")
def pump():
    return load_recipe("bilge-pump-life", SHORT)


@pytest.fixture(scope="module")
def rows(pump):
    return [sample.row for sample in sample_records(pump, 120, seed=2)]


def test_a_group_is_one_machine_in_the_order_of_time(pump, rows):
    for group in range(4):
        own = [row for row in rows if row["group"] == group]
        assert len(own) == 30
        hours = np.array([row["operating_hours"] for row in own])
        # one recording in each spacing of 500 h, within the middle half of it
        assert_allclose(hours, 500 * (np.arange(30) + 0.5), atol=125)
        assert np.ptp(np.diff(hours)) > 10
        assert len({row["wear_rate_m2_per_n"] for row in own}) == 1
        worn = np.array([row[CLEARANCE] for row in own])
        events = np.array([row["maintenance"] for row in own])
        assert (np.diff(worn)[np.diff(events) == 0] > 0).all()
        assert (np.diff(events) >= 0).all()
        assert own[0]["maintenance"] == 0


def test_what_remains_shrinks_as_time_goes_by(rows):
    counted = 0
    for before, after in pairwise(rows):
        left, then = before["remaining_life_h"], after["remaining_life_h"]
        if before["group"] == after["group"] and left > 0 and then > 0:
            passed = after["operating_hours"] - before["operating_hours"]
            # the same crossing, or a later one after maintenance near the limit
            assert then == pytest.approx(left - passed, abs=1e-6) or left < passed
            counted += 1
    assert counted > 40


def test_labels_agree_with_the_severity(pump, rows):
    edges = pump.severities[0].edges
    for row in rows:
        assert row["grade"] == grade(row[CLEARANCE], edges)
        assert (row["remaining_life_h"] == 0) == (row["grade"] == 3)
        assert math.isnan(row["life_share"]) or 0 <= row["life_share"] <= 1
        assert 0.05e-3 <= row[CLEARANCE] <= 0.465e-3


def test_a_record_of_a_life_depends_on_its_number_alone(pump, rows):
    skip = np.ones(120, dtype=bool)
    skip[77] = False
    [alone] = sample_records(pump, 120, seed=2, skip=skip)
    assert_equal(alone.row, rows[77])  # NaN is NaN
    assert alone.scene.joint.crankpin.clearance_diametral == rows[77][CLEARANCE]
    other = next(sample_records(pump, 1, seed=3))
    assert other.row["wear_rate_m2_per_n"] != rows[0]["wear_rate_m2_per_n"]


def test_wear_rates_spread_as_the_recipe_says(pump):
    lives = pump.lives
    rates = np.array([lives.history(pump.rng(0, 99, group)).wear_rate for group in range(400)])
    spread = np.log(rates / 2e-17)
    # standard errors 0.4 / sqrt(400) and 0.4 / sqrt(800); four of them
    assert abs(spread.mean()) < 0.08
    assert spread.std() == pytest.approx(0.4, abs=0.06)


@pytest.mark.parametrize(
    ("name", "of_power", "of_life"),
    # power within the scatter of its runs, 0.5 %; the film's load share bends where the bearing is
    # new, in which it spends little of its life
    [("bilge-pump-life", 0.01, 0.005), ("journal-bearing-life", 0.03, 0.003)],
)
def test_the_table_of_a_shipped_recipe_is_fine_enough(name, of_power, of_life):
    lives = load_recipe(name).lives
    finer = lives.table.model_copy(update={"knots": 2 * lives.table.knots - 1})
    coarse, fine = lives.law, replace(lives, table=finer).law
    power = np.array([coarse.power_at(volume) for volume in fine.volume])
    assert_allclose(power, fine.power, rtol=of_power)
    last = coarse.volume[-1]
    ratio = coarse.work(last) / fine.work(last)
    assert ratio == pytest.approx(1, rel=of_life)


def written(folder, text):
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_faults_of_a_life_in_a_recipe_come_together(tmp_path):
    text = (
        recipe_text("bilge-pump-life")
        .replace('width = "50 mm"', "")
        .replace('as_new_most = "0.13 mm"', 'as_new_most = "0.6 mm"')
    )
    text += '[[life.maintenance]]\nrestores = 1\nat = "0.5 mm"\n'
    with pytest.raises(RecipeError) as caught:
        load_recipe(written(tmp_path, text))
    assert [fault.split(" ")[0] for fault in caught.value.faults] == [
        "life.width",
        "life.as_new_most",
        "life.maintenance.1.at",
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("wear_rate = 2e-17", "wear_rate = 2e-8", r"life\.wear_rate .*2e-08.*<= 1e-09"),
        ('every = "6000 h"', "", "every = None and at = None must be one of them"),
        ('spacing = "500 h"', 'spacing = "500"', "spacing = '500' has no unit"),
    ],
)
def test_a_life_that_makes_no_sense_is_refused(tmp_path, old, new, message):
    text = recipe_text("bilge-pump-life")
    assert old in text
    with pytest.raises(RecipeError, match=message):
        load_recipe(written(tmp_path, text.replace(old, new)))


def test_a_severity_without_a_model_of_wear_is_refused(tmp_path):
    text = recipe_text("journal-bearing-life")
    text = text.replace('extends = "journal-scar-small"', 'extends = "propulsion-shaft-small"')
    with pytest.raises(RecipeError, match=r"must be one whose wear is modelled: joint.crankpin"):
        load_recipe(written(tmp_path, text))


def test_a_turning_gear_that_lifts_the_shaft_is_refused(tmp_path):
    text = recipe_text("journal-bearing-life").replace('"3 rpm"', '"60 rpm"')
    recipe = load_recipe(written(tmp_path, text))
    with pytest.raises(
        RecipeError, match=r"life: wear of bearing.scar_depth: power = .* must be > 0"
    ):
        next(sample_records(recipe, 1))


# -- data sets ----------------------------------------------------------------------------------


def few(folder, name):
    text = recipe_text(name).replace("records_per_group = 30", "records_per_group = 4")
    return written(folder, text.replace("records = 600", "records = 8"))


def test_two_pumps_over_their_lives(tmp_path):
    recipe = load_recipe(few(tmp_path, "bilge-pump-life"), SHORT)
    summary = generate(recipe, None, tmp_path / "data.h5", seed=4)
    assert (summary.n_records, summary.n_groups, summary.failures) == (8, 2, {})
    with DataSet(tmp_path / "data.h5") as data:
        rows = data.manifest
    assert set(LIFE_COLUMNS) <= set(rows.columns)
    assert rows["group"].tolist() == [0] * 4 + [1] * 4
    for _, own in rows.groupby("group"):
        assert (np.diff(own["operating_hours"]) > 0).all()
        assert (np.diff(own[CLEARANCE]) > 0).all()
        assert own["maintenance"].tolist() == [0] * 4


def test_two_bearings_over_their_lives(tmp_path):
    recipe = load_recipe(few(tmp_path, "journal-bearing-life"), {"duration": "0.06 s"})
    summary = generate(recipe, None, tmp_path / "data.h5", seed=4)
    assert summary.failures == {}
    with DataSet(tmp_path / "data.h5") as data:
        rows = data.manifest
    depth = rows["scar_depth_bearing_m"].to_numpy()
    assert (np.diff(depth[:4]) > 0).all()
    assert (np.diff(depth[4:]) > 0).all()
    assert (rows["remaining_life_h"] > 0).all()
