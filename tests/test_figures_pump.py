"""The gallery's script: it runs, and the figures say what the text says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import wearstate
from numpy.testing import assert_allclose
from wearstate.sim.machine.transfer import scene_transfer

SCRIPT = Path(wearstate.__file__).parent / "docs" / "figures_pump.py"


@pytest.fixture(scope="module")
def figures():
    spec = importlib.util.spec_from_file_location("figures_pump", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_clearance_sets_the_piston_free_and_catches_it(figures):
    ideal = figures.turn(figures.pump({"joint.crankpin.rung": "ideal"}))
    worn = figures.turn(figures.pump(figures.WORN))
    # r w (1 + lambda^2 / 2) of 50 mm at 300 rpm and 1/5: 1.60 m/s
    assert_allclose(np.abs(ideal["piston_velocity"]).max(), 1.602, atol=0.005)
    gained = worn["piston_velocity"] - ideal["piston_velocity"]
    early = worn["angle"] < 30
    assert 0.15 < gained[early].max() < 0.25  # m/s
    assert 5 < worn["angle"][np.argmax(gained)] < 15  # caught about 10 degrees after the centre
    late = (worn["angle"] > 200) & (worn["angle"] < 340)
    assert np.abs(gained[late]).max() < 0.01
    motion = np.abs(np.gradient(ideal["piston_velocity"], figures.STEP)).max()
    knock = np.abs(np.gradient(worn["piston_velocity"], figures.STEP)).max()
    assert 10 < knock / motion < 18


def test_the_chamber_compresses_and_its_valves_close_late(figures):
    healthy = figures.turn(figures.pump(figures.CHAMBER))
    angle, pressure, lifts = healthy["angle"], healthy["pressure"], healthy["lifts"]
    closed = angle[(angle > 180) & (lifts[:, 0] <= 0)][0]
    assert 184 < closed < 191
    full = angle[(angle > 180) & (pressure > 0.3e6)][0]
    assert closed + 1 < full < closed + 8
    assert 0.38e6 < pressure.max() < 0.45e6
    torn = figures.turn(figures.pump({**figures.CHAMBER, "pressure.suction": "-85 kPa"}))
    assert 0.5e6 < torn["pressure"].max() < 0.8e6
    assert 205 < torn["angle"][np.argmax(torn["pressure"])] < 235
    stuck = {**figures.CHAMBER, "pressure.suction_valve.stuck_lift": "3 mm"}
    assert figures.turn(figures.pump(stuck))["pressure"].max() < 0.1e6


def test_flights_end_in_landings(figures):
    tight, loose = "0.08 mm", "0.31 mm"
    key = "joint.crankpin.diametral_clearance"
    flight, strike = figures.contact_map([{key: tight}, {key: loose}])
    assert flight[1].sum() > 1.5 * flight[0].sum()
    assert strike[1].max() > 1.2 * strike[0].max()
    assert np.all(flight[:, 60:110] == 0)  # the discharge stroke presses the pin home


def test_accelerance_is_that_of_one_mass_far_above_its_modes(figures):
    scene = figures.pump()
    h = scene_transfer(scene, np.array([1e7])).values[0, 0]  # acc_x over bearing_x
    mass = sum(m.shape["bearing_x"] * m.shape["acc_x"] for m in scene.casing.modes)
    assert_allclose(h, mass, rtol=1e-3)


@pytest.mark.parametrize(
    "name", ["pump-modes", "pump-transfer", "pump-velocity", "bilge-pump-life"]
)
def test_figures_say_that_they_are_simulated(figures, name, tmp_path):
    figure = figures.FIGURES[name]()
    assert "(simulated)" in figure.get_suptitle()
    figure.savefig(tmp_path / "figure.png", dpi=40)
    assert (tmp_path / "figure.png").stat().st_size > 5_000
