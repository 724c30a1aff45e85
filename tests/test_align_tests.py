"""Sags of a shaft line from files: a recording of a test, a table of reactions, the command."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.shaft_tests.measured_tests import line_tests, read_reactions
from wearstate.diagnose.shaft_tests.sag_report import sag_report, sag_text
from wearstate.sim.alignment.alignment import reactions
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.changed import free_line, line_model, rest, transfer
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line

STRAIGHT = {"bearings.2.offset": "0 mm"}
SAG = 0.15e-3
TEST = {
    **STRAIGHT,
    "bearings.2.sag": "0.15 mm",
    "exciters.0.force": "20 N",
    "duration": "40 s",
    "sample_rate": "1.024 kHz",
}


@pytest.fixture(scope="module")
def rig():
    return load_scene("shaft-rig", STRAIGHT)


@pytest.fixture(scope="module")
def recording():
    found = simulate(load_scene("shaft-rig", TEST), seed=1)
    return Recording(
        signal=found.signal,
        sample_rate=found.sample_rate,
        channels=found.channels,
        tacho="tacho",
        origin="simulated",
        source="test.h5",
    )


@pytest.fixture(scope="module")
def straight_reactions(rig):
    state = reactions(alignment_line(rig), alignment_conditions(rig)["cold"])
    return dict(zip(state.line.names, state.reactions.tolist(), strict=True))


def run(*args):
    return CliRunner().invoke(cli, ["align", *map(str, args)])


def with_channels(recording, **changes):
    channels = tuple(
        replace(channel, **changes) if channel.quantity == "force" else channel
        for channel in recording.channels
    )
    return replace(recording, channels=channels)


# --- a recording


def test_a_recording_becomes_the_accelerance_of_its_line(rig, recording):
    [test] = line_tests(recording, rig)
    data = test.transfer
    assert data.force == ("forward", "y")
    assert data.responses[2] == ("third", "y", "housing")
    assert data.speed == pytest.approx(math.tau * 10, rel=1e-4)  # by the tacho
    model = line_model(load_scene("shaft-rig", TEST))
    line = free_line(
        model, data.frequencies, speed=data.speed, forces=[data.force], responses=data.responses
    )
    truth = transfer(model, rest(model, data.speed), line).value[..., 0]
    deviation = np.sqrt(np.einsum("lrr->lr", data.covariance).real)
    score = np.abs(data.value - truth) / deviation
    # mean square 1 by the coherence; orders of the shaft and leakage put some lines further off
    assert 0.5 < np.median(score) < 1.2
    assert np.mean(score < 3) > 0.95


def test_places_come_from_names_where_the_channels_do_not_say_them(rig, recording):
    [test] = line_tests(with_channels(recording, place="", direction=""), rig)
    assert test.transfer.force == ("forward", "y")
    [test] = line_tests(with_channels(recording, place="shaft at disc"), rig)
    assert test.transfer.force == (0.1, "y")
    [test] = line_tests(with_channels(recording, place="housing of aft", direction="side"), rig)
    assert test.transfer.force == ("aft", "z", "housing")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "f", "place": "", "direction": ""}, "channel 'f': place = '' and direction"),
        ({"place": "shaft at bow"}, "place 'bow' must be on the line of 'shaft-rig': aft"),
        ({"quantity": "voltage"}, "force channels = 0 and accelerometers = 4 must be >= 1"),
    ],
)
def test_channels_that_say_nothing_are_refused(rig, recording, changes, message):
    with pytest.raises(DataError, match=message):
        line_tests(with_channels(recording, **changes), rig)


def test_a_force_without_connection_is_refused(rig, recording):
    signal = recording.signal.copy()
    row = recording.names.index("force")
    signal[row] = np.random.default_rng(0).standard_normal(signal.shape[1])
    with pytest.raises(DataError, match="5 %; push harder, average longer"):
        line_tests(replace(recording, signal=signal), rig)


def test_without_a_speed_there_is_no_film(rig, recording):
    with pytest.raises(DataError, match="speed is missing, must be known for the oil films"):
        line_tests(replace(recording, tacho=None), rig)


# --- reactions


def test_reactions_in_newton_and_kilonewton(rig, tmp_path):
    table = tmp_path / "jacks.csv"
    table.write_text("bearing,reaction_kn,error_n\nsecond,0.3,\nthird,0.2,7\n", encoding="utf-8")
    found = read_reactions(table, rig)
    assert found.reactions == {"second": 300.0, "third": 200.0}
    assert found.deviations == {"second": 15.0, "third": 7.0}


def test_all_faults_of_a_table_are_told_at_once(rig, tmp_path):
    table = tmp_path / "jacks.csv"
    table.write_text(
        "bearing,reaction_n,error_n\nbow,3,1\nsecond,many,1\nthird,200,0\n", encoding="utf-8"
    )
    with pytest.raises(DataError) as raised:
        read_reactions(table, rig)
    text = str(raised.value)
    assert "line 2: bearing 'bow' must be one of aft, second" in text
    assert "line 3: reaction_n = 'many' must be a number >= 0" in text
    assert "line 4: error_n = '0' must be a number > 0" in text
    table.write_text("name,load\n", encoding="utf-8")
    with pytest.raises(DataError, match="must hold bearing and reaction_n or reaction_kn"):
        read_reactions(table, rig)


# --- the command


def test_the_command_tells_the_bearing_that_sagged_and_what_to_test_next(tmp_path):
    record = tmp_path / "test.h5"
    pairs = [part for key, value in TEST.items() for part in ("--set", f"{key}={value}")]
    made = CliRunner().invoke(cli, ["simulate", "shaft-rig", *pairs, "-o", str(record)])
    assert made.exit_code == 0, made.output
    page = tmp_path / "page.html"
    told = run(
        "shaft-rig", "--set", "bearings.2.offset=0 mm", "--from-test", record, "-o", page, "--json"
    )
    assert told.exit_code == 0, told.output
    answer = json.loads(told.stdout)
    second, third = answer["sags"]["bearings"]
    assert third["interval_m"][0] < SAG < third["interval_m"][1]
    assert third["interval_m"][0] > 0
    assert second["interval_m"][0] < 0 < second["interval_m"][1]
    assert answer["bearings"][2]["offset_m"] == pytest.approx(-third["sag_m"])
    assert answer["sags"]["next"][0]["variance_taken"] > 0.2
    html = page.read_text(encoding="utf-8")
    assert "Sags from measured tests and reactions" in html
    assert "Next: push the shaft at" in html


def test_reactions_alone_move_the_line_to_where_they_are_explained(
    rig, straight_reactions, tmp_path
):
    lower = reactions(
        alignment_line(rig).moved({"third": -SAG}), alignment_conditions(rig)["cold"]
    ).reactions
    table = tmp_path / "jacks.csv"
    rows = [f"{name},{load},3" for name, load in zip(straight_reactions, lower, strict=True)]
    table.write_text("\n".join(["bearing,reaction_n,error_n", *rows]), encoding="utf-8")
    report = sag_report(rig, reactions=table)
    np.testing.assert_allclose(report.posterior.mean, [0.0, SAG], atol=5e-6)
    assert report.headline.endswith("third")
    assert "next: push" in sag_text(report)
    told = run("shaft-rig", "--set", "bearings.2.offset=0 mm", "--reactions", table)
    assert told.exit_code == 0, told.output
    assert "moved, with 90% confidence each, against the line through aft and forward: third" in (
        told.stdout
    )


def test_reactions_that_no_sag_explains_are_said_to_be_so(rig, straight_reactions, tmp_path):
    table = tmp_path / "jacks.csv"
    rows = [f"{name},{2 * load},3" for name, load in straight_reactions.items()]  # twice the weight
    table.write_text("\n".join(["bearing,reaction_n,error_n", *rows]), encoding="utf-8")
    report = sag_report(rig, reactions=table)
    assert "does not explain the measurements" in sag_text(report)
    assert "next:" not in sag_text(report)


def test_a_file_of_another_kind_ends_with_two(tmp_path):
    told = run("shaft-rig", "--from-test", tmp_path / "absent.h5")
    assert told.exit_code == 2
    told = run("bilge-pump", "--reactions", tmp_path / "absent.csv")
    assert told.exit_code == 2
