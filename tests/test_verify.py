"""The literature checks themselves: complete, cheap, and able to fail."""

import dataclasses
import math

import pytest
from numpy.testing import assert_allclose
from wearstate.diagnose import verify
from wearstate.sim.analytic import kelvin_voigt_restitution
from wearstate.sim.contact import RELEASE_AT_ZERO_FORCE


def test_every_check_passes():
    results = verify.run_checks()
    assert len(results) == 14
    assert [r.name for r in results if not r.passed] == []


def test_every_line_says_where_it_is_from():
    for check in verify.checks():
        assert len(check.source) > 20, check.name
        assert set(check.trust.split("+")) <= {"R", "M", "V", "H"}, check.name
        assert 0 < check.tolerance <= 1e-4 * abs(check.expected), check.name


def test_no_tolerance_exceeds_the_last_printed_digit():
    for check in verify.checks():
        # half a unit of the last digit of a number printed with at least six
        assert check.tolerance <= 0.51e-5 * abs(check.expected), check.name


@pytest.mark.parametrize("wrong", [1.00001, 0.99999, math.nan])
def test_a_wrong_value_fails(wrong):
    for check in verify.checks():
        # 1e-5 of the value is above every tolerance (the test before)
        broken = dataclasses.replace(check, obtain=lambda c=check: wrong * c.expected)
        assert not verify._judge(broken).passed


def test_relative_tolerance_is_of_the_expected_value():
    check = dataclasses.replace(
        verify.checks()[0], expected=-200.0, tolerance=0.01, kind="relative", obtain=lambda: -201.9
    )
    assert verify._judge(check).passed
    assert not verify._judge(dataclasses.replace(check, obtain=lambda: -202.1)).passed


def test_lines_and_functions_must_agree():
    table = dict(verify._TABLES["restitution.csv"])
    name, function = table.popitem()
    with pytest.raises(ValueError, match=name):
        verify._read("restitution.csv", table)
    with pytest.raises(ValueError, match="nothing like it"):
        verify._read("restitution.csv", {**table, name: function, "nothing like it": function})


def test_unusable_lines_are_refused():
    row = {"name": "x", "expected": "1", "tolerance": "0", "kind": "absolute"}
    row |= {"trust": "H", "source": "s"}
    with pytest.raises(ValueError, match=r"tolerance of 'x' = 0 must be > 0"):
        verify._check("file.csv", row, float)
    with pytest.raises(ValueError, match=r"kind of 'x' = 'loose' must be"):
        verify._check("file.csv", {**row, "tolerance": "1", "kind": "loose"}, float)


def test_rebound_converges_at_the_order_of_the_integrator():
    exact = kelvin_voigt_restitution(0.2)
    coarse, fine = (
        abs(verify.rebound(0.2, RELEASE_AT_ZERO_FORCE, step_per_contact_time=h) - exact)
        for h in (0.15, 0.0375)
    )
    # Runge-Kutta 4 and a cubic dense output: order 4, that is 256 over two halvings.
    assert_allclose(math.log(coarse / fine, 4), 4.0, atol=0.5)


def test_rebound_needs_an_underdamped_contact():
    with pytest.raises(ValueError, match=r"damping_ratio = 1.0 must be in \[0, 1\)"):
        verify.rebound(1.0, RELEASE_AT_ZERO_FORCE)
