"""Moves that quieten a running line: the level itself, the limits, what is said of it."""

import numpy as np
import pytest
from wearstate.diagnose.alignment.align import align
from wearstate.diagnose.alignment.quiet_moves import quiet_moves, running_line, running_rms
from wearstate.diagnose.alignment.table import align_table
from wearstate.diagnose.alignment.text import align_text
from wearstate.sim.alignment.alignment import check
from wearstate.sim.alignment.calibration import calibrate
from wearstate.sim.alignment.seats import AlignmentError
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.shaft_parts import AlignmentLimits
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line
from wearstate.sim.shaft.recording import shaft_recorder


def calibrated(scene, **asked):
    return calibrate(alignment_line(scene), list(alignment_conditions(scene).values()), **asked)


def test_the_level_is_that_of_simulated_recordings():
    scene = load_scene("propulsion-shaft", {"duration": "40 s"})
    recorded = shaft_recorder(scene)(scene, 3, False, True).signal[:5].std(axis=1)
    level = running_rms(running_line(scene), np.zeros(5))
    # 40 s of random motion about the blade rate: 5 %; lines between resonances: as much
    np.testing.assert_allclose(level, recorded, rtol=0.15)


@pytest.fixture(scope="module")
def rig():
    """With limits so wide that the vibration is what decides."""
    scene = load_scene("shaft-rig", {"sample_rate": "1.024 kHz"})
    wide = AlignmentLimits(least_load=60.0, least_move=-0.5e-3, most_move=0.5e-3)
    bearings = tuple(b.model_copy(update={"limits": wide}) for b in scene.bearings)
    return scene.model_copy(update={"bearings": bearings})


@pytest.fixture(scope="module")
def quiet(rig):
    return quiet_moves(rig, calibrated(rig))


def test_the_moves_make_it_quieter_and_keep_every_limit(rig, quiet):
    assert quiet.moved
    assert quiet.calibration.status.ok
    assert np.mean(quiet.after**2) < 0.985 * np.mean(quiet.before**2)  # a tenth of a decibel
    line, limits = quiet.calibration.line, quiet.calibration.after
    assert all(limit.met for state in limits for limit in check(state))
    for seat, move in zip(line.seats, quiet.calibration.moves, strict=True):
        assert seat.least_move <= move <= seat.most_move
    assert "dB)" in quiet.text
    assert "no further moves" not in quiet.text


def test_what_is_said_is_what_the_moved_line_does(rig, quiet):
    moved = rig.model_copy(
        update={
            "bearings": tuple(
                bearing.model_copy(update={"offset": bearing.offset + float(move)})
                for bearing, move in zip(rig.bearings, quiet.calibration.moves, strict=True)
            )
        }
    )
    again = running_rms(running_line(moved), np.zeros(4))
    np.testing.assert_allclose(again, quiet.after, rtol=1e-6)


def test_where_nothing_helps_only_the_limits_move():
    """The ship's line hardly hears its alignment: less than a tenth of a decibel."""
    ship = load_scene("propulsion-shaft", {"bearings.2.sag": "0.3 mm"})
    found = calibrated(ship)
    same = quiet_moves(ship, found)
    assert not same.moved
    np.testing.assert_array_equal(same.calibration.moves, found.moves)
    assert "no further moves within the limits" in same.text


def test_the_page_and_the_table_say_it(rig):
    found = align(rig, condition="running", target="vibration")
    assert "vibration of the running line, rms over 4 accelerometers" in align_text(found)
    assert len(align_table(found)["vibration"]["after_rms_m_per_s2"]) == 4


def test_a_line_without_sensors_cannot_be_asked():
    with pytest.raises(AlignmentError, match="target = 'vibration' needs accelerometers"):
        running_line(load_scene("shaft-rig").model_copy(update={"sensors": ()}))
