"""Measured jacking curves: reactions, errors and own influence numbers read off them."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.shaft_tests.jacking_tests import measured_curves, read_curves
from wearstate.diagnose.shaft_tests.sags import estimate_sags
from wearstate.sim.alignment.alignment import influence, reactions
from wearstate.sim.alignment.jacking import jacking
from wearstate.sim.alignment.jacking_curve import CurveError, fit_curve
from wearstate.sim.output.recording import DataError
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line

STRAIGHT = {"bearings.2.offset": "0 mm"}
SAG = 0.15e-3  # m, of the third bearing


def curve(lifts, *, zero=8e4, slope=1e8, first=6e8, friction=0.0, noise=0.0, seed=0):
    """Two lines, up and down again."""
    load = np.minimum(first * lifts, zero + slope * lifts)
    way = np.concatenate([[1.0], np.sign(np.diff(lifts))])
    return load + friction * way + noise * np.random.default_rng(seed).standard_normal(lifts.size)


UP_AND_DOWN = np.concatenate([np.linspace(0, 1e-3, 15), np.linspace(0.95e-3, 0.05e-3, 14)])


def test_two_lines_are_read_off_exactly():
    found = fit_curve(UP_AND_DOWN, curve(UP_AND_DOWN, friction=3e3))
    assert found.zero_load == pytest.approx(8e4, rel=1e-9)
    assert found.slope == pytest.approx(1e8, rel=1e-9)
    assert found.friction == pytest.approx(3e3, rel=1e-9)
    # the knee is tried at 200 lifts: half a step of 5 um moves the first slope by a few per cent
    assert found.free_lift == pytest.approx(8e4 / 5e8, rel=0.05)


def test_friction_of_one_way_is_not_seen_and_so_said():
    lifts = np.linspace(0, 1e-3, 21)
    found = fit_curve(lifts, curve(lifts, friction=3e3))
    assert found.friction is None
    assert found.zero_load == pytest.approx(8.3e4, rel=1e-9)  # off by the friction


def test_the_error_said_is_that_of_many_curves():
    """400 curves: a deviation of their errors over the one said is known to 4 %."""
    scores = []
    for seed in range(400):
        found = fit_curve(UP_AND_DOWN, curve(UP_AND_DOWN, friction=2e3, noise=1e3, seed=seed))
        scores.append((found.zero_load - 8e4) / found.zero_load_deviation)
    assert abs(np.mean(scores)) < 0.25
    # t of some 20 degrees of freedom, 1.05; a fit that used its friction wrongly would be far off
    assert 0.85 < np.std(scores) < 1.3


@pytest.mark.parametrize(
    ("lifts", "loads", "message"),
    [
        (np.linspace(0, 1, 5), np.ones(5), "points = 5 must be >= 8"),
        (np.linspace(-1, 1, 9), np.ones(9), "lifts >= 0"),
        (np.linspace(0, 1e-3, 20), 1e8 * np.linspace(0, 1e-3, 20), "does not come free"),
        (np.linspace(0, 0.17e-3, 20), curve(np.linspace(0, 0.17e-3, 20)), "lift on"),
    ],
)
def test_curves_that_tell_nothing_are_refused(lifts, loads, message):
    with pytest.raises(CurveError, match=message):
        fit_curve(lifts, loads)


# --- of a line


def jacked_file(path, *, both=True, noise=2.0, softer=1.0):
    """Curves of a rig whose third bearing has sagged, as a gauge reads them."""
    true = alignment_line(load_scene("shaft-rig", STRAIGHT)).moved({"third": -SAG})
    rng = np.random.default_rng(1)
    rows = ["bearing,lift_mm,load_n"]
    for name in ("second", "third"):
        test = jacking(true, name, alignment_conditions(load_scene("shaft-rig", STRAIGHT))["cold"])
        # on to twenty times where it comes free, as a hand with a dial gauge would
        beyond = np.linspace(3, 20, 20) * test.free_lift
        lifts = np.concatenate([test.lifts[::4], beyond])
        loads = np.concatenate([test.loads[::4], test.zero_load + test.second_slope * beyond])
        order = [*range(lifts.size), *(range(lifts.size - 2, 0, -1) if both else ())]
        at = lifts[order]
        way = np.concatenate([[1.0], np.sign(np.diff(at))])
        load = loads[order] * softer + 4.0 * way + noise * rng.standard_normal(len(order))
        rows += [f"{name},{1e3 * x:.6f},{max(y, 0):.4f}" for x, y in zip(at, load, strict=True)]
    path.write_text("\n".join(rows))
    return true


def test_reactions_and_influence_numbers_of_a_line(tmp_path):
    true = jacked_file(tmp_path / "jacks.csv")
    scene = load_scene("shaft-rig", STRAIGHT)
    found = read_curves(tmp_path / "jacks.csv", scene)
    loads = reactions(true, alignment_conditions(scene)["cold"]).reactions
    own = np.abs(np.diag(influence(true)))
    for one, place in zip(found, (1, 2), strict=True):
        assert abs(one.reaction - loads[place]) < 3 * one.deviation
        assert one.deviation < 0.06 * one.reaction
        assert one.influence == pytest.approx(own[place], rel=0.1)
        assert one.expected_influence == pytest.approx(own[place], rel=1e-6)
        assert one.warnings == ()


def test_curves_tell_the_sag(tmp_path):
    jacked_file(tmp_path / "jacks.csv")
    scene = load_scene("shaft-rig", STRAIGHT)
    found = estimate_sags(
        scene, measured=measured_curves(read_curves(tmp_path / "jacks.csv", scene), "cold")
    )
    assert found.plausible
    assert found.holds(np.array([0.0, SAG]), 0.99)
    assert found.deviation[1] < 0.2 * SAG  # a tenth of what the prior leaves


def test_a_line_that_is_not_the_described_one_and_one_way_are_said(tmp_path):
    jacked_file(tmp_path / "jacks.csv", both=False, softer=0.7)
    first, _ = read_curves(tmp_path / "jacks.csv", load_scene("shaft-rig", STRAIGHT))
    assert "must be" in first.text
    assert "by the line as described" in first.text
    assert "while lowering too" in first.text


def test_align_takes_curves(tmp_path):
    jacked_file(tmp_path / "jacks.csv")
    arguments = ["align", "shaft-rig", "--set", "bearings.2.offset=0 mm", "--no-calibrate"]
    arguments += ["--json"]
    told = CliRunner().invoke(cli, [*arguments, "--jacking", str(tmp_path / "jacks.csv")])
    assert told.exit_code == 0, told.output
    sags = json.loads(told.stdout)["sags"]
    assert [one["bearing"] for one in sags["jacking"]] == ["second", "third"]
    [third] = [one for one in sags["bearings"] if one["name"] == "third"]
    assert third["interval_m"][0] < SAG < third["interval_m"][1]
    both = [*arguments, "--jacking", str(tmp_path / "jacks.csv")]
    (tmp_path / "loads.csv").write_text("bearing,reaction_n\nthird,100\n")
    twice = CliRunner().invoke(cli, [*both, "--reactions", str(tmp_path / "loads.csv")])
    assert twice.exit_code == 2
    assert "bearings third are in reactions and in jacking" in twice.stderr


def test_faults_of_a_file_are_told_at_once(tmp_path):
    scene = load_scene("shaft-rig", STRAIGHT)
    file = tmp_path / "jacks.csv"
    file.write_text("bearing,lift_mm\nthird,0\n")
    with pytest.raises(DataError, match="columns load_kn or load_n are missing"):
        read_curves(file, scene)
    file.write_text("bearing,lift_mm,load_kn\nbow,0,0\nthird,x,1\nthird,,1\n")
    with pytest.raises(DataError) as told:
        read_curves(file, scene)
    assert str(told.value).count("line ") == 3
    file.write_text("bearing,lift_mm,load_kn\nthird,0,0\nthird,1,1\n")
    with pytest.raises(DataError, match="bearing 'third': points = 2 must be >= 8"):
        read_curves(file, scene)
