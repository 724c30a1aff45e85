"""Pages on a phone: text of 8 pixels at least, tables row by row; the most urgent first."""

import dataclasses
import re

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.pages.picture import PHONE_PX
from wearstate.diagnose.report.advice import Advice
from wearstate.diagnose.report.batch import BatchRow
from wearstate.diagnose.report.figures import gauge, trend_picture
from wearstate.diagnose.report.trend import fit_trend
from wearstate.diagnose.wear_model.verdict import Estimate


def test_the_gauge_and_a_trend_are_read_on_a_phone():
    edges = [1e-4, 2e-4, 3e-4]
    limits = {
        "grade_edges_m": edges,
        "grade_names": ["as new", "worn", "plan renewal", "condemned"],
        "condemning_limit_m": 3e-4,
        "quantity": "diametral clearance, crankpin",
        "source": "manual",
    }
    estimate = {"low": 2.1e-4, "severity": 2.2e-4, "high": 2.4e-4, "coverage": 0.9}
    assert gauge(estimate, limits).image.least <= PHONE_PX
    hours = 700.0 * np.arange(12)
    wear = np.where(hours < 4000, 1e-4 + 3e-8 * hours, 1e-4)  # with a maintenance
    trend = fit_trend(hours, wear, 0.97 * wear, 1.03 * wear, limit=3e-4)
    assert trend_picture(trend, limits, "machine 1").image.least <= PHONE_PX


@pytest.fixture(scope="module")
def rig_page(tmp_path_factory):
    """Page of the alignment of a shaft rig."""
    page = tmp_path_factory.mktemp("rig") / "page.html"
    done = CliRunner().invoke(cli, ["align", "shaft-rig", "-o", str(page)])
    assert done.exit_code == 0, done.output
    return page.read_text()


def test_every_value_of_a_table_of_bearings_tells_what_it_is(rig_page):
    """Where rows are stacked the head is gone: each value but the name has its own."""
    tables = re.findall(r"<table.*?</table>", rig_page, flags=re.DOTALL)
    assert len(tables) == 8  # three conditions, before and after, margins, jacks, films, influence
    for table in tables:
        assert re.match('<table class="stack( many)?">', table)
        for row in re.findall(r"<tr>(.*?)</tr>", table, flags=re.DOTALL)[1:]:
            cells = re.findall(r"<td[^>]*>", row)
            assert len(cells) > 1
            assert all("data-label=" in cell for cell in cells[1:])
    assert 'data-label="reaction [kN]"' in rig_page
    assert 'data-label="third up"' in rig_page


def test_what_cannot_wait_is_before_what_is_worse():
    def row(name, days, *, verdict="graded", grade=3, severity=4e-4):
        return BatchRow(
            number=0, name=name, machine="1", time_h=None,
            estimate=Estimate(verdict=verdict, grade=grade, severity=severity),
            advice=Advice(action="stop", sentence="", days=days, horizon="", basis=""),
        )  # fmt: skip

    soon = row("a", 0.0)
    worse = row("b", 1.0, severity=5e-4)
    worn = row("c", 30.0, grade=1, severity=1e-4)
    unread = row("d", None, verdict="unusable", grade=None)
    past = dataclasses.replace(soon, name="e", current=False, time_h=5.0)
    rows = sorted([past, worn, unread, worse, soon], key=lambda row: row.urgency)
    assert [row.name for row in rows] == ["a", "b", "d", "c", "e"]
    same = [row("f", 1.0, severity=s) for s in (4e-4, 6e-4)]
    assert sorted(same, key=lambda row: row.urgency)[0].estimate.severity == 6e-4


def test_the_films_table_may_wrap_its_pairs(rig_page):
    """Unwrapped, nine columns of "as set → after" are wider than the page and are cut off."""
    text = rig_page
    films = text[text.index("Oil films by speed") :]
    assert re.search(r"<table[^>]*>", films)[0] == '<table class="stack many">'
    general, many = (text.index(rule) for rule in ("td { white-space: nowrap", ".many td,"))
    assert many > general  # the later rule wins
    assert "white-space: normal" in text[many : text.index("}", many)]
