"""Severity over time: lines, maintenance, the life left, dates."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import theilslopes
from wearstate.diagnose.report.trend import (
    FEWEST_POINTS,
    LONGEST_REACH,
    _theil_sen,
    date_in,
    fit_trend,
    hours_of,
    read_dates,
    span_words,
)
from wearstate.sim.output.recording import DataError

LIMIT = 3.1e-4  # m
Z = 1.6448536  # of 90 %
HOURS = np.arange(12) * 500.0


def trend_of(severity, hours=HOURS, *, spread=0.05, **options):
    severity = np.asarray(severity)
    factor = math.exp(Z * spread)
    return fit_trend(
        hours, severity, severity / factor, severity * factor, **{"limit": LIMIT} | options
    )


def life(rng, *, n, bias, scatter, start=1e-4):
    """Times, true wear, estimates of one machine: linear wear, one lasting factor, scatter."""
    hours = np.arange(n) * 500.0
    wear = start + rng.uniform(5e-9, 2e-8) * hours
    factor = np.exp(bias * rng.standard_normal())
    return hours, wear, wear * factor * np.exp(scatter * rng.standard_normal(n))


# --- the line


def test_without_scatter_the_line_is_exact():
    """Closed form: (limit - a) / b."""
    found = trend_of(1e-4 + 2e-8 * HOURS, spread=1e-6)
    left = (LIMIT - 1e-4) / 2e-8 - HOURS[-1]
    for value in (found.outlook.remaining_low_h, found.outlook.remaining_high_h):
        assert_allclose(value, left, rtol=1e-4)  # a spread of 1e-6 of 310 µm is 0.02 h
    assert_allclose(found.outlook.rate, 2e-8)


def test_exponential_wear_is_exact_on_its_own_scale():
    """ln(limit / s) / rate, and the rate at the last recording."""
    wear = 1e-4 * np.exp(1.5e-4 * HOURS)
    found = trend_of(wear, spread=1e-6, growth="log")
    assert_allclose(found.outlook.remaining_h, math.log(LIMIT / wear[-1]) / 1.5e-4, rtol=1e-4)
    assert_allclose(found.outlook.rate, 1.5e-4 * wear[-1], rtol=1e-6)
    straight = trend_of(wear, spread=1e-6)
    assert straight.outlook.remaining_h > 1.2 * found.outlook.remaining_h


def test_the_line_is_that_of_theil_and_sen():
    rng = np.random.default_rng(3)
    time = np.sort(rng.uniform(0, 10, 15))
    values = rng.standard_normal((4, 15))
    slope, offset = _theil_sen(time, values)
    for i, row in enumerate(values):
        expected = theilslopes(row, time, method="joint")
        assert_allclose((slope[i], offset[i]), expected[:2])


def test_a_few_wild_recordings_change_little():
    wear = 1e-4 + 1.5e-8 * HOURS
    wild = wear.copy()
    wild[[3, 8]] *= (2.5, 0.4)
    clean, hurt = trend_of(wear), trend_of(wild)
    assert hurt.starts == (0,)  # one low value is no maintenance
    assert_allclose(hurt.outlook.rate, clean.outlook.rate, rtol=0.1)


def test_order_and_seed():
    rng = np.random.default_rng(0)
    hours, _, seen = life(rng, n=12, bias=0, scatter=0.05)
    mixed = rng.permutation(12)
    first, second = trend_of(seen, hours), trend_of(seen[mixed], hours[mixed])
    assert first.outlook == second.outlook
    assert trend_of(seen, hours, seed=1).outlook != first.outlook


# --- maintenance


def test_a_fall_that_stays_is_a_maintenance():
    rng = np.random.default_rng(5)
    hours = np.arange(30) * 500.0
    wear = np.concatenate([1e-4 + 1.5e-8 * hours[:18], 1.2e-4 + 1.5e-8 * (hours[18:] - 9000)])
    found = trend_of(wear * np.exp(0.04 * rng.standard_normal(30)), hours)
    assert found.starts == (0, 18)
    assert found.ahead_h[0] == hours[18]
    left = (LIMIT - 1.2e-4) / 1.5e-8 - 11 * 500
    # without the new start the line would be flat and the life three times as long
    assert_allclose(found.outlook.remaining_h, left, rtol=0.3)


def test_steady_wear_has_no_maintenance():
    """Four standard deviations: of 300 lives at most a few may be cut."""
    rng = np.random.default_rng(6)
    cut = 0
    for _ in range(300):
        hours, _, seen = life(rng, n=20, bias=0.05, scatter=0.06)
        cut += trend_of(seen, hours).starts != (0,)
    assert cut <= 6


def test_too_little_since_the_last_maintenance_is_said():
    wear = np.concatenate([np.linspace(1e-4, 3e-4, 9), [0.6e-4, 0.7e-4, 0.8e-4]])
    found = trend_of(wear)
    assert found.starts == (0, 9)
    assert found.outlook is None
    assert "3 usable recordings since the last maintenance" in found.reason
    assert str(FEWEST_POINTS) in found.reason
    assert found.line.size == 0
    same = trend_of(np.full(6, 1e-4), np.zeros(6))
    assert "of one moment only" in same.reason


def test_files_copied_within_an_hour_show_no_trend():
    """Their times are those of the copying; hours of operation may be as near as one likes."""
    wear, hours = np.linspace(1e-4, 2e-4, 8), np.linspace(0, 0.9, 8)
    copied = fit_trend(hours, wear, 0.9 * wear, 1.1 * wear, limit=3e-4, clock="calendar")
    assert copied.outlook is None
    assert "of one moment only, must be >= 5 over more than an hour" in copied.reason
    assert trend_of(wear, hours).outlook is not None


# --- the life left


@pytest.mark.parametrize(
    ("bias", "scatter", "claimed"), [(0.05, 0.04, math.hypot(0.05, 0.04)), (0.0, 0.08, 1e-6)]
)
def test_the_band_holds_the_truth_as_often_as_it_says(bias, scatter, claimed):
    """Simulated lives of known end; the second only by its own scatter, the intervals being nil."""
    rng = np.random.default_rng(7)
    inside, n = 0, 200
    for seed in range(n):
        points = int(rng.integers(6, 25))
        hours, wear, seen = life(rng, n=points, bias=bias, scatter=scatter)
        rate = (wear[-1] - wear[0]) / (hours[-1] - hours[0])
        truth = max((LIMIT - wear[-1]) / rate, 0.0)
        outlook = trend_of(seen, hours, spread=claimed, seed=seed).outlook
        low, high = outlook.remaining_low_h, outlook.remaining_high_h
        after_low = truth >= (outlook.reach_h if low is None else low)
        inside += after_low and (high is None or truth <= high)
    # nominal 0.90; three standard errors of 200 lives are 0.064
    assert 0.836 <= inside / n <= 0.964


def test_a_lasting_error_widens_the_band():
    """Scatter averages out over recordings, an error of the whole machine does not."""
    wear = 1e-4 + 2e-8 * HOURS
    narrow, wide = trend_of(wear, spread=0.01), trend_of(wear, spread=0.1)

    def width(found):
        return found.outlook.remaining_high_h - found.outlook.remaining_low_h

    # of 310 µm at 2e-8 m/h: 2 z spread 15500 h
    assert_allclose(width(narrow), 2 * Z * 0.01 * LIMIT / 2e-8, rtol=0.15)  # 400 draws
    assert width(wide) > 7 * width(narrow)


def test_no_growth_gives_no_life():
    flat = trend_of(np.full(12, 1e-4)).outlook
    assert flat.remaining_low_h is None
    assert flat.reach_h == LONGEST_REACH * HOURS[-1]
    assert flat.text.startswith("the condemning limit is not reached within 16000 h")


def test_a_life_beyond_reach_is_not_given():
    """Three times the time seen, and no further."""
    slow = trend_of(1e-4 + 5e-9 * HOURS, spread=0.01).outlook  # 36,500 h against 16,500 h
    assert slow.remaining_h is None
    assert slow.remaining_high_h is None


def test_beyond_the_limit_is_said():
    worn = trend_of(2e-4 + 4e-8 * HOURS).outlook
    assert (worn.remaining_low_h, worn.remaining_h) == (0.0, 0.0)
    assert worn.text == "the condemning limit is reached"


def test_the_sentence_gives_the_band():
    text = trend_of(1e-4 + 2e-8 * HOURS, clock="calendar").outlook.text
    assert text.startswith("the condemning limit is reached in ")
    assert "(90 %), most likely after " in text
    assert trend_of(1e-4 + 2e-8 * HOURS).outlook.assumption.startswith("wear continues at the")


def test_many_recordings_are_grouped():
    rng = np.random.default_rng(8)
    hours = np.sort(rng.uniform(0, 6000, 3000))
    wear = (1e-4 + 2e-8 * hours) * np.exp(0.05 * rng.standard_normal(3000))
    found = trend_of(wear, hours)
    assert found.starts == (0,)
    assert_allclose(found.outlook.rate, 2e-8, rtol=0.03)  # 0.05 / sqrt(3000) over the span


@pytest.mark.parametrize(
    ("severity", "hours", "says"),
    [
        ([1e-4, -1e-4], [0.0, 1.0], "recording 1 .* must be finite"),
        ([1e-4, math.nan], [0.0, 1.0], "recording 1"),
        ([1e-4], [0.0, 1.0], "must be one"),
        ([], [], "n >= 1"),
    ],
)
def test_bad_points_are_refused(severity, hours, says):
    with pytest.raises(DataError, match=says):
        trend_of(severity, hours)


# --- dates


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("p_20240301.wav", "2024-03-01T00:00:00+00:00"),
        ("2024-03-01T08:30:15.h5", "2024-03-01T08:30:15+00:00"),
        ("a-2024_03_01_0830.csv", "2024-03-01T08:30:00+00:00"),
        ("pump 01.03.2024 (2).wav", "2024-03-01T00:00:00+00:00"),
        ("p_20241345_20240301.wav", "2024-03-01T00:00:00+00:00"),  # the first is no date
    ],
)
def test_dates_in_names(text, moment):
    assert date_in(text).isoformat() == moment


@pytest.mark.parametrize(
    "text", ["run12.wav", "123456789012.wav", "2024-02-30.h5", "30.02.2024.h5", "01-03-2024.h5", ""]
)
def test_numbers_that_are_no_dates(text):
    assert date_in(text) is None


def test_a_table_of_dates(tmp_path):
    table = tmp_path / "dates.csv"
    table.write_text("\ufeffFile,Date\na.wav,2024-03-01\n\nb.wav,2024-03-02 12:00\n", "utf-8")
    found = read_dates(table)
    assert found["b.wav"] - found["a.wav"] == 36
    assert found["a.wav"] == hours_of(date_in("2024-03-01"))
    table.write_text("file,hours\na.wav,12.5\n")
    assert read_dates(table) == {"a.wav": 12.5}


def test_faults_of_a_table_come_at_once(tmp_path):
    table = tmp_path / "dates.csv"
    table.write_text("file,date\na.wav,yesterday\nb.wav,2024-03-01\nb.wav,2024-03-02\nc.wav\n")
    with pytest.raises(DataError) as caught:
        read_dates(table)
    assert len(str(caught.value).splitlines()) == 3
    assert "line 2" in str(caught.value)
    table.write_text("name;when\n")
    with pytest.raises(DataError, match="must be file,date or file,hours"):
        read_dates(table)
    with pytest.raises(DataError, match="cannot be read"):
        read_dates(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("hours", "words"),
    [(0.4, "0.4 h"), (71, "71 h"), (200, "8.3 days"), (24 * 365 * 5, "5 years")],
)
def test_spans_in_words(hours, words):
    assert span_words(hours) == words


def test_the_picture_has_dates_where_dates_were_given():
    from datetime import UTC, datetime

    from matplotlib.figure import Figure
    from wearstate.diagnose.report.figures import _draw_trend

    start = datetime(2024, 3, 14, tzinfo=UTC).timestamp() / 3600
    hours = start + 24 * 9.0 * np.arange(10)
    wear = 1e-4 + 7e-8 * (hours - hours[0])
    limits = {"condemning_limit_m": 3.1e-4, "quantity": "clearance"}
    labels = {}
    for clock, times in (("calendar", hours), ("operating", hours - start)):
        found = fit_trend(times, wear, 0.9 * wear, 1.1 * wear, limit=3.1e-4, clock=clock)
        figure = Figure()
        axes = figure.add_subplot()
        _draw_trend(axes, found, limits)
        figure.draw_without_rendering()
        ticks = [tick.get_text() for tick in axes.get_xticklabels()]
        labels[clock] = [axes.get_xlabel(), *ticks]
        assert figure.axes[0].get_xlim()[1] > axes.get_lines()[0].get_xdata(orig=False).max()
        legend = [text.get_text() for text in axes.get_legend().get_texts()]
        assert "estimate, 90 % interval" in legend
        assert "90 % band of the line" in legend
        assert "condemning limit 0.31 mm" in legend
    assert labels["calendar"][0] == "date (UTC)"
    assert {"Apr", "May", "Jun"} <= set(labels["calendar"])
    assert labels["operating"][0] == "operating hours [h]"
