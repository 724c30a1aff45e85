"""The wear-down of a shaft's bearing by alignment and films."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import save_solution
from wearstate.diagnose.film_clearance.clearance import Doubts
from wearstate.diagnose.film_clearance.wear_down import (
    SinkingRun,
    film_wear_down,
    possible_bores,
    sinking_places,
)
from wearstate.diagnose.nameplate.nameplate import nameplate_of
from wearstate.diagnose.report.film import film_estimate
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene

ANGLES = (math.radians(225), math.radians(135))
LIMIT, AS_NEW = 0.9e-3, 0.03e-3
WEAR = "wear_down_bearing_1_m"


def sunk(wear, *, offset=(0.0, 0.0), measured=None, film=80e-6):
    """A journal that lies one film above the bottom of its bore, a little to the side."""
    wears = np.linspace(0, 1.5 * LIMIT, 5)
    rows = [[-0.35e-3 - w + film, 40e-6, 20e-6, 5e-6, -0.35e-3, 0.0] for w in wears]
    up, side = -0.35e-3 - wear + film, 40e-6
    towards = [-(up * math.cos(a) + side * math.sin(a)) for a in ANGLES]
    return SinkingRun(
        readings=np.add(towards, offset),
        places=(CubicSpline(wears, np.array(rows)),),
        likely=(1.0,),
        swing=5e-6,
        clearance=0.35e-3,
        measured=measured,
    )


def told(run, **ways):
    return film_wear_down(run, ANGLES, LIMIT, AS_NEW, Doubts(offset=15e-6), **ways)


def test_a_place_gives_its_wear_and_doubts_their_interval():
    found = told(sunk(0.5e-3))
    assert found.severity == pytest.approx(0.5e-3, abs=2e-6)
    # 9 % of 0.35 mm by the makers' tolerance, 15 um of two probes: half of 90 % in all
    known = math.hypot(0.09 * 0.35e-3, 15e-6, 0.03 * 0.77e-3 / math.sqrt(2))
    assert (found.high - found.low) / 2 == pytest.approx(1.645 * known, rel=0.1)
    assert found.budget["clearance"] > found.budget["offset"] > found.budget["viscosity"]


def test_healthy_recordings_take_offsets_and_tolerances_away():
    off = (-150e-6, -120e-6)
    new = [sunk(w, offset=off, measured=w) for w in (0.03e-3, 0.04e-3, 0.05e-3)]
    alone = told(sunk(0.5e-3, offset=off))
    assert alone.severity is None or abs(alone.severity - 0.5e-3) > 0.1e-3
    found = told(sunk(0.5e-3, offset=off), healthy=new)
    assert found.severity == pytest.approx(0.5e-3, abs=0.03 * LIMIT)
    assert found.low < 0.5e-3 < found.high


def test_what_no_wear_explains_is_said():
    turned = sunk(0.5e-3, offset=(300e-6, -300e-6))
    assert "no wear-down explains the journal" in told(turned).reason
    assert "--baseline" in told(sunk(2 * LIMIT)).reason


def test_the_line_is_solved_for_places(tmp_path):
    """A recording of the built-in line: its own alignment and films, one nuisance wrong."""
    changes = {"bearings.0.wear_down": 0.5e-3, "duration": 0.5, "oil.temperature": 318.15}
    scene = load_scene("propulsion-shaft", changes)
    path = tmp_path / "line.h5"
    save_solution(scene, simulate(scene, seed=1), path, seed=1)
    with DataSet(path) as data:
        recording = data[0]
    told_right = film_estimate(recording, WEAR, nameplate_of(path, None, {}))
    # the bore may as well have an arc or grooves: that moves the estimate a little
    assert told_right.severity == pytest.approx(0.5e-3, abs=0.04 * LIMIT)
    assert told_right.low < 0.5e-3 < told_right.high
    # a sag without probes in its bearing cannot be told so
    assert (
        "0 probes"
        in film_estimate(recording, "wear_down_bearing_2_m", nameplate_of(path, None, {})).reason
    )


def test_a_bore_worn_to_an_arc_is_told_against_healthy_recordings():
    """By a scene that has a circle: an arc or an offset of the probes, who knows?"""
    truth = {"bearings.0.worn_shape": "arc", "duration": 0.5}
    plain = load_scene("propulsion-shaft", {"duration": 0.5})
    angles = [probe.angle for probe in plain.probes]
    likely = [before for before, _ in possible_bores(plain.bearings[0])]

    def run(wear, *, bores, healthy=False):
        scene = load_scene("propulsion-shaft", {**truth, "bearings.0.wear_down": wear})
        motion = simulate(scene, seed=1)
        state = [motion.signal[motion.names.index(probe.name)].mean() for probe in plain.probes]
        return SinkingRun(
            readings=np.array(state),
            places=sinking_places(plain, 0, LIMIT, healthy=healthy)[:bores],
            likely=tuple(likely[:bores]),
            swing=2e-5,
            clearance=0.35e-3,
            measured=wear if healthy else None,
        )

    def told_by(bores):
        today, new = (run(w, bores=bores, healthy=w < 1e-4) for w in (0.7e-3, 0.03e-3))
        doubts = Doubts(offset=15e-6)
        return [
            film_wear_down(today, angles, LIMIT, AS_NEW, doubts, healthy=healthy)
            for healthy in ((), (new,))
        ]

    for found in told_by(1):
        assert "no wear-down explains the journal" in found.reason
    alone, found = told_by(len(likely))
    assert "bore of another shape" in alone.reason
    assert found.low < 0.7e-3 < found.high
    # two readings hardly tell an arc's clearance: that is most of the interval
    assert max(found.budget, key=found.budget.get) == "film and bore"
    half = (found.high - found.low) / 2
    assert math.hypot(*found.budget.values()) == pytest.approx(half, rel=0.05)


def test_a_scene_that_tells_the_bore_is_believed():
    told = {"bearings.0.worn_shape": "arc", "bearings.0.groove_width": "20 deg"}
    assert possible_bores(load_scene("propulsion-shaft", told).bearings[0]) == ((1.0, {}),)


def test_a_line_that_no_film_carries_says_so():
    scene = load_scene("propulsion-shaft", {"oil.viscosity_40": 2e-6, "oil.viscosity_100": 2e-6})
    assert "bearing" in sinking_places(scene, 0, LIMIT)


# --- a film that is warmer than the oil


def test_nobody_is_taken_to_have_read_a_thermometer():
    bare = nameplate_of(None, "propulsion-shaft", {})
    assert "film_warming_k" not in bare.conditions({})
    assert bare.conditions({"film_warming_k": 0.0})["film_warming_k"] == 0.0
    read = nameplate_of(None, "propulsion-shaft", {"bearings.stern_aft.film_warming": "0 K"})
    assert read.conditions({"film_warming_k": 9.0})["film_warming_k"] == 0.0


def test_a_warming_that_was_noted_thins_the_film_of_its_bearing_alone():
    plate = nameplate_of(None, "propulsion-shaft", {})
    day = plate.on_the_day({"viscosity_pa_s": 0.08, "film_warming_k": 10.0}, 5.0)
    assert day.oil.dynamic_viscosity == pytest.approx(0.08, rel=1e-12)
    assert day.oil.warmed(10.0) < 0.05  # Walther: 40 % for ten kelvin at 42 degrees
    assert [bearing.film_warming for bearing in day.bearings] == [10.0, 0, 0, 0, 0]
    known = nameplate_of(None, "propulsion-shaft", {"oil": {"viscosity": "80 mPa s"}})
    assert known.on_the_day({"film_warming_k": 10.0}, 5.0).bearings[0].film_warming == 0
