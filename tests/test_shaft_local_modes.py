"""What an accelerometer hears of the part of the housing it sits on, and hum."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.shaft_parts import LocalMode
from wearstate.sim.shaft.local_modes import local_acceleration

CAP = LocalMode(frequency=60.0, damping_ratio=0.05, share=0.3)
COVER = LocalMode(frequency=140.0, damping_ratio=0.02, share=-0.2)
RATE = 2000.0


def shake(time):
    """Acceleration of a housing: tones below, on and above the modes, none at a line [m/s^2]."""
    tones = ((7.3, 1.0), (60.4, 0.4), (137.1, 0.3), (333.3, 0.7))
    return sum(level * np.cos(2 * np.pi * hertz * time + hertz) for hertz, level in tones)


def marched(mode, time):
    """z'' of z'' + 2 zeta w z' + w^2 z = -a, by steps from rest."""
    own, drag = (2 * np.pi * mode.frequency) ** 2, 4 * np.pi * mode.frequency * mode.damping_ratio

    def rate(at, state):
        return state[1], -shake(at) - drag * state[1] - own * state[0]

    found = solve_ivp(
        rate, (0, time[-1]), (0, 0), t_eval=time, method="DOP853", rtol=1e-8, atol=1e-12
    )
    return rate(time, found.y)[1]


def test_the_sensor_hears_what_the_equation_of_motion_says():
    time = np.arange(4000) / RATE
    expected = shake(time) + sum(mode.share * marched(mode, time) for mode in (CAP, COVER))
    heard = local_acceleration(shake(time), (CAP, COVER), RATE)
    settled = slice(1500, -1500)  # 0.75 s: exp(-0.75 / 0.053) of what each way begins with
    assert_allclose(heard[settled], expected[settled], atol=2e-5)


def test_a_recording_begins_as_loud_as_it_goes_on():
    rows = np.random.default_rng(0).standard_normal((400, 2000))
    heard = np.array([local_acceleration(row, (COVER,), RATE) - row for row in rows])
    first, later = (np.mean(heard[:, part] ** 2) for part in (slice(0, 10), slice(500, 1500)))
    assert first == pytest.approx(later, rel=0.25)  # 400 phases of one mode; from rest 0.03


def test_no_share_leaves_every_bit():
    silent = [LocalMode(frequency=400.0, damping_ratio=0.03)]
    row = shake(np.arange(100) / RATE)
    assert local_acceleration(row, silent, RATE) is row


def test_a_mode_is_heard_by_its_own_sensor_alone():
    still = {"sensors.0.noise": 0.0, "sensors.1.noise": 0.0}
    plain = simulate(load_scene("propulsion-shaft", still), seed=1).signal
    mode = [{"frequency": "300 Hz", "damping_ratio": 0.05, "share": 0.3}]
    scene = load_scene("propulsion-shaft", {**still, "sensors.1.modes": mode})
    heard = simulate(scene, seed=1).signal
    others = [0, 2, 3, 4, 5, 6, 7]
    assert_array_equal(heard[others], plain[others])
    lines = np.fft.rfftfreq(plain.shape[1], 1 / scene.sample_rate)
    near = np.abs(lines - 300) < 3
    power = [np.sum(np.abs(np.fft.rfft(row)[near]) ** 2) for row in (heard[1], plain[1])]
    assert power[0] / power[1] == pytest.approx(1 + 3.0**2, rel=0.1)  # |1 + 0.3 / (2j 0.05)|^2


def test_hum_comes_to_its_own_sensor_alone():
    still = {"duration": "1 s", "probes.0.noise": 0.0, "sensors.1.noise": 0.0}
    still |= {"probes.1.noise": 0.0}  # its noise would follow the phases of the hum
    plain = simulate(load_scene("propulsion-shaft", still), seed=1).signal
    hum = {"sensors.4.mains": "0.2 m/s^2", "probes.0.mains": "5 um"}
    humming = simulate(load_scene("propulsion-shaft", {**still, **hum}), seed=1).signal
    added = (humming.astype(float) - plain).std(axis=1)
    assert_allclose(added, [0, 0, 0, 0, 0.2, 5e-6, 0, 0], rtol=1e-3)  # 50 whole periods
