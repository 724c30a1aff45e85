"""The literature checks themselves: complete, cheap, and able to fail."""

import dataclasses
import math

import pytest
from numpy.testing import assert_allclose
from wearstate.diagnose.literature import verify, verify_contact
from wearstate.sim.contact.closed_forms import kelvin_voigt_restitution
from wearstate.sim.contact.law import RELEASE_AT_ZERO_FORCE


def test_every_check_passes():
    results = verify.run_checks()
    assert len(results) == sum(len(table) for table in verify._TABLES.values())
    assert [r.name for r in results if not r.passed] == []


def test_no_table_is_empty():
    """A check that nobody counts can vanish unnoticed."""
    counts = {file: len(table) for file, table in verify._TABLES.items()}
    assert counts == {
        "slider_crank.csv": 16,
        "restitution.csv": 6,
        "contact.csv": 71,
        "pump.csv": 49,
        "film.csv": 143,
        "bearing.csv": 103,
        "finite_bearing.csv": 229,
        "cavitation.csv": 19,
        "shaft_line.csv": 57,
        "alignment.csv": 57,
    }


def test_every_line_says_where_it_is_from():
    for check in verify.checks():
        assert len(check.source) > 20, check.name
        assert set(check.trust.split("+")) <= {"R", "M", "V", "H"}, check.name


def test_no_tolerance_exceeds_what_the_source_can_tell():
    for check in verify.checks():
        if check.name.startswith(("Lund-Thomsen", "Someya")):  # printed to 0.01 and 0.1 degrees
            assert check.tolerance <= 0.06 * abs(check.expected) + 0.15 + 1e-9, check.name
            continue
        if check.name.startswith("Raimondi-Boyd"):  # differences on a mesh of 1958
            scale = 1.0 if check.kind == "relative" else abs(check.expected)
            assert check.tolerance <= 0.03 * scale, check.name
            continue
        if check.name.startswith("two grooves near"):  # the source's own meshes lie 2 % apart
            scale = 1.0 if check.kind == "relative" else check.expected
            assert check.tolerance <= 0.02 * scale, check.name
            continue
        if check.kind == "relative":  # closed forms against a discretised model
            assert check.tolerance <= 5e-3, check.name
            continue
        # half a unit of the last printed digit, of numbers printed with at least two of them
        # (a ripple of .56 % stands as 0.0056)
        assert check.tolerance <= 1e-2 * abs(check.expected), check.name


@pytest.mark.parametrize("off", [3.0, -3.0, math.nan])
def test_a_wrong_value_fails(off):
    for check in verify.checks():
        scale = abs(check.expected) if check.kind == "relative" else 1.0
        wrong = check.expected + off * check.tolerance * scale
        broken = dataclasses.replace(check, obtain=lambda value=wrong: value)
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
        abs(verify_contact.rebound(0.2, RELEASE_AT_ZERO_FORCE, step_per_contact_time=h) - exact)
        for h in (0.15, 0.0375)
    )
    # Runge-Kutta 4 and a cubic dense output: order 4, that is 256 over two halvings.
    assert_allclose(math.log(coarse / fine, 4), 4.0, atol=0.5)


def test_rebound_needs_an_underdamped_contact():
    with pytest.raises(ValueError, match=r"damping_ratio = 1.0 must be in \[0, 1\)"):
        verify_contact.rebound(1.0, RELEASE_AT_ZERO_FORCE)
