"""From which wear on it can be told: closed form, limits, and what a report says of it."""

import math

import numpy as np
import pytest
from wearstate.diagnose.learning.detection import visible_from
from wearstate.diagnose.report.verdict import finding_words

NEW, MOST = 1e-4, 1e-3
RATES = {"probability": 0.9, "detection_rate": 0.9, "false_alarm_rate": 0.02}


def machines(n=4000, scatter=0.2, slope=1.0):
    """Estimates with a known line and scatter."""
    rng = np.random.default_rng(0)
    wear = np.exp(rng.uniform(math.log(2e-5), math.log(MOST), n))
    return wear, np.exp(slope * np.log(wear) + scatter * rng.standard_normal(n))


def test_it_is_where_the_line_crosses_the_threshold():
    wear, read = machines(n=40_000)
    threshold = np.quantile(read[wear <= NEW], 0.95)
    # b0 = 0, b1 = 1, s = 0.2: ln a = ln t + 1.2816 s; the line's own scatter is 1/sqrt(n)
    assert visible_from(wear, read, NEW) == pytest.approx(
        threshold * math.exp(0.2 * 1.2816), rel=0.01
    )
    assert (read[np.abs(wear / visible_from(wear, read, NEW) - 1) < 0.05] > threshold).mean() == (
        pytest.approx(0.9, abs=0.02)
    )


def test_estimates_that_say_nothing_hide_all_wear():
    assert visible_from(*machines(slope=0.0), NEW) == pytest.approx(MOST, rel=0.01)
    wear, read = machines(scatter=1e-6)
    assert visible_from(wear, read, NEW) == pytest.approx(NEW, rel=0.1)


def test_too_few_machines_tell_nothing():
    wear = np.geomspace(2e-5, MOST, 30)
    assert visible_from(wear, wear, 3e-5) is None


@pytest.mark.parametrize(
    ("name", "present", "visible", "says"),
    [
        ("lubrication_flooded", True, 2.14e-4, True),
        ("lubrication_flooded", False, 2.14e-4, False),
        ("lubrication_flooded", True, None, False),
        ("stuck_valve", True, None, False),
    ],
)
def test_the_report_says_what_wear_a_flooded_pin_hides(name, present, visible, says):
    words = finding_words({"name": name, "present": present, "visible_from_m": visible, **RATES})
    assert ("wear below 0.21 mm cannot be seen on a flooded pin of this kind" in words) == says
