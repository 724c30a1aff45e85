"""What `simulate` says first: forces, films, reactions and levels, against sums that must hold."""

import json
import math
import re

import pytest
from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.pages.si_text import si_text


def simulated(*arguments):
    done = CliRunner().invoke(cli, ["simulate", *arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


def summary_of(*arguments):
    return json.loads(simulated(*arguments, "--json"))["summary"]


def value(summary, name):
    return summary["truth"][name]["value"]


def test_a_piston_without_area_has_no_pressure():
    told = summary_of("bilge-pump", "--set", "duration=0.6", "--set", "piston.diameter=0")["truth"]
    assert "pressure_highest" not in told
    assert told["pressure_rms"]["value"] == 0


def test_a_pump_tells_forces_pressures_and_levels():
    summary = summary_of("bilge-pump", "--set", "duration=0.6")
    # the two levels of the scene, low-passed: within a per cent of 330 kPa
    assert value(summary, "pressure_highest") == pytest.approx(300e3, abs=3e3)
    assert value(summary, "pressure_lowest") == pytest.approx(-30e3, abs=3e3)
    assert value(summary, "pressure_ratio") == pytest.approx(401.325 / 71.325, rel=0.05)
    # the pin carries the pressure at least
    assert value(summary, "pin_peak") > 300e3 * math.pi / 4 * 0.1**2
    assert summary["channels"]["acc_x"]["peak"] > summary["channels"]["acc_x"]["rms"]
    assert "tacho" not in summary["channels"]
    text = simulated("bilge-pump", "--set", "duration=0.6").splitlines()
    assert text[0].startswith("bilge-pump (simulated): acc_x ")  # as ever
    assert [line.split()[0] for line in text[1:]] == [
        "pin",
        "pressure",
        "contacts",
        "level",
        "acc_y:",
    ]


def test_a_pump_in_oil_tells_its_film_instead_of_contacts():
    mixed = ("rung=mixed", "oil.viscosity=0.06 Pa s", "oil.length=30 mm", "oil.roughness=0.5 um")
    given = [word for each in mixed for word in ("--set", f"joint.crankpin.{each}")]
    flooded = simulated("bilge-pump", *given, "--set", "duration=0.6")
    assert re.search(r"oil +least film of the pins \d+\.\d+ um\n", flooded)
    assert "contacts" not in flooded
    starved = simulated(
        "bilge-pump", *given, "--set", "duration=0.6", "--set", "joint.crankpin.oil.filled_gap=1um"
    )
    assert "rough peaks touch" in starved


def test_a_pump_at_rest_has_levels_alone():
    at_rest = ("--set", "running=false", "--set", "exciters.0.force=500 N", "--set", "duration=2")
    text = simulated("bilge-pump", *at_rest)
    assert "at rest" in text
    assert "level" in text


def test_a_journal_tells_its_place_and_its_film():
    summary = summary_of("journal-bearing")
    ratio, film = value(summary, "eccentricity"), value(summary, "film_least")
    clearance, moved = 70e-6, value(summary, "orbit_largest")
    assert film == pytest.approx(clearance * (1 - ratio), abs=moved)  # h = C (1 - e)
    assert 0 < value(summary, "attitude_angle") < math.pi / 2
    assert value(summary, "pressure_peak") > 1e6  # 1 MPa is its mean on the projected area
    text = simulated("journal-bearing")
    assert "attitude angle" in text
    assert " um" in text


def test_the_reactions_of_a_shaft_sum_to_its_weight():
    summary = summary_of("shaft-rig")
    names = [n for n in summary["truth"] if n.startswith("reaction_") and n != "reaction_sum"]
    total = value(summary, "reaction_sum")
    assert sum(value(summary, name) for name in names) == pytest.approx(total)
    from wearstate.sim.scene.load import load_scene
    from wearstate.sim.shaft.line_beam import running_beam

    weight = running_beam(load_scene("shaft-rig")).downward_load
    assert total == pytest.approx(weight, rel=0.02)  # means of whole and a part of a revolution
    assert "reactions" in simulated("shaft-rig")


def test_prefixes_round_before_they_choose():
    assert si_text(999.96, "N") == "1 kN"
    assert si_text(1500.0, "m") == "1500 m"
    assert si_text(float("nan"), "m") == "no figure"
