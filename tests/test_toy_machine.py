"""A machine in one file: it registers itself and goes the whole way from its scene to a verdict."""

import json
import math
from typing import Literal

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from pydantic import Field
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.machine.registry import MachinePhysics
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.sensor import Channel, digitise
from wearstate.sim.parts.dimensions import Length, Mass, Ratio, RotationSpeed
from wearstate.sim.parts.part import Part
from wearstate.sim.parts.sensors import Accelerometer
from wearstate.sim.scene.journal import ScarLimits
from wearstate.sim.scene.load import MACHINES, load_scene
from wearstate.sim.scene.recorded import recorded
from wearstate.sim.scene.scene import Scene, SceneError, WearPlace

# --- the machine: an unbalanced motor on a spring whose wire wears


class Spring(Part):
    wire: Length = Field(gt=0)
    coil: Length = Field(gt=0)
    turns: int = Field(ge=1)
    wear_depth: Length = Field(ge=0)

    @property
    def stiffness(self):
        """``G d^4 / (8 D^3 n)``, of the wire that is left [N/m]."""
        return _SHEAR * (self.wire - self.wear_depth) ** 4 / (8 * self.coil**3 * self.turns)


class Motor(Part):
    speed: RotationSpeed = Field(gt=0, le=1000)


class SpringScene(Scene):
    physics = __name__
    wear_places = (
        WearPlace("spring.wear_depth", "spring", "depth worn off the wire", "wear_wire"),
    )

    machine: Literal["worn-spring"]
    drive: Motor
    spring: Spring
    mass: Mass = Field(gt=0)
    damping_ratio: Ratio = Field(gt=0, lt=1)
    unbalance: float = Field(gt=0, description="kg m")
    sensors: tuple[Accelerometer, ...] = Field(min_length=1)
    wear_wire: ScarLimits | None = None

    def sensor_parts(self):
        return self.sensors

    def sensor_channels(self):
        return tuple(
            Channel(name=one.name, unit="m/s^2", quantity="acceleration", place=one.place)
            for one in self.sensors
        )


_SHEAR = 80e9  # N/m^2, of spring steel


def response(scene):
    """Acceleration of the mass per revolution's angle: ``m e w^4 / (k - m w^2 + j c w)``."""
    omega, k, m = math.tau * scene.drive.speed, scene.spring.stiffness, scene.mass
    c = 2 * scene.damping_ratio * math.sqrt(k * m)
    return -scene.unbalance * omega**4 / (k - m * omega**2 + 1j * c * omega)


def simulate_spring(scene, seed, truth, _raise):
    rng = np.random.default_rng(seed)
    angle = (
        math.tau
        * scene.drive.speed
        * np.arange(round(scene.duration * scene.sample_rate))
        / scene.sample_rate
    )
    motion = np.real(response(scene) * np.exp(1j * angle))
    rows = [
        digitise(motion, gain=s.gain, noise=s.noise, full_scale=s.range, bits=s.bits, rng=rng)[0]
        for s in scene.sensors
    ]
    signal = np.stack([*rows, scene.tacho.channel(angle)])
    return recorded(scene, signal, truth={"state_angle": angle} if truth else {})


def check_spring(scene):
    if scene.drive.speed > scene.sample_rate / 20:
        raise SceneError(scene.name, ["drive.speed must be < a twentieth of sample_rate; lower it"])


MACHINE = MachinePhysics(
    scene=SpringScene,
    simulate=simulate_spring,
    check=check_spring,
    cost=lambda scene: 1e-7 * scene.duration * scene.sample_rate,
)


# --- its scene and its recipe

SCENE = """
name = "fan"
machine = "worn-spring"
description = "A fan on a worn spring (simulated)"
duration = "3 s"
sample_rate = "1 kHz"
mass = "5 kg"
damping_ratio = "5 %"
unbalance = 2e-4
[drive]
speed = "9 Hz"
[spring]
wire = "4 mm"
coil = "20 mm"
turns = 6
wear_depth = "0.05 mm"
[wear_wire]
as_new = "0.02 mm"
condemning = "0.4 mm"
grade_edges = ["0.1 mm", "0.2 mm", "0.4 mm"]
source = "chosen"
[[sensors]]
name = "acc"
range = "50 m/s^2"
noise = "0.001 m/s^2"
"""

RECIPE = """
name = "fans"
description = "Worn springs of fans"
scene = "{scene}"
records = 60
records_per_group = 2
[severity]
path = "spring.wear_depth"
low = "as new"
high = "150 % of limit"
[[machine]]
path = "mass"
distribution = "factor"
low = 0.99
high = 1.01
[[record]]
path = "drive.speed"
distribution = "factor"
low = 0.98
high = 1.02
"""


@pytest.fixture
def scene_file(tmp_path, monkeypatch):
    """The scene on disk, its machine known to the program as long as the test runs."""
    monkeypatch.setitem(MACHINES, "worn-spring", SpringScene)
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "fan.toml"
    path.write_text(SCENE)
    return path


def run(*arguments, code=0):
    result = CliRunner().invoke(cli, [str(each) for each in arguments])
    assert result.exit_code == code, result.output
    return result.output


def test_a_recording_is_the_closed_form(scene_file):
    scene = load_scene(scene_file, {"sensors.0.noise": 0.0})
    found = simulate(scene, seed=0)
    crest = abs(response(scene))
    assert_allclose(np.abs(found.signal[0]).max(), crest, rtol=1e-3)  # 111 samples a revolution
    worn = simulate(load_scene(scene_file, {"spring.wear_depth": "0.4 mm"}), seed=0)
    assert np.abs(worn.signal[0]).max() > 1.1 * crest  # nearer to its resonance


def test_a_machine_goes_from_its_scene_to_a_verdict(scene_file, tmp_path):
    assert run("scene", "show", scene_file) == SCENE
    assert "fan: no fault" in run("scene", "check", scene_file)
    assert "processor time per recording" in run("scene", "check", scene_file, "--deep")
    assert "fan" in run("simulate", scene_file, "-o", "fan.h5", "--plot", "fan.png", "--truth")
    (tmp_path / "fans.toml").write_text(RECIPE.format(scene=scene_file))
    assert "fans: no fault" in run("recipe", "check", "fans.toml")
    run("generate", "fans.toml", "-o", "fans.h5", "-j", 1)
    with h5py.File("fans.h5") as file:
        assert file["signal"].shape == (60, 2, 3000)
    run("features", "fans.h5", "-o", "fans.csv", "-j", 1)
    run("train", "fans.h5", "-o", "fan.wsm", "-j", 1)
    worn = tmp_path / "worn.h5"
    run("simulate", scene_file, "--set", "spring.wear_depth=0.35mm", "-o", worn)
    verdict = json.loads(run("report", worn, "--model", "fan.wsm", "--json"))
    estimate = verdict["estimate"]
    assert (verdict["recording"]["origin"], estimate["grade"]) == ("simulated", 2)
    # sixty records leave some 5 % of the limit
    assert estimate["severity"] == pytest.approx(0.35e-3, abs=0.08e-3)


def test_what_a_machine_does_not_register_is_refused_politely(scene_file):
    assert "has no stability maps" in run("stability", scene_file, code=2)
    assert "has no transfer function" in run("frf", scene_file, code=2)
    faults = run("scene", "check", scene_file, "--set", "drive.speed=200Hz", code=2)
    assert "a twentieth of sample_rate" in faults
