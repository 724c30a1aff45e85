"""The pressure sensor of a pump's cylinder: what it reads, and what it leaves as it is."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.datasets.source.channel_units import parse_unit
from wearstate.diagnose.feature_rows.feature_table import recording_features, recording_layout
from wearstate.diagnose.pictures.view import View
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import Recording
from wearstate.sim.parts.sensors import PressureSensor
from wearstate.sim.pump.pressure_sensors import read_pressure
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

SENSOR = {"pressure.sensor.range": "10 bar"}
BRIEF = {"duration": "0.6 s", "settling_revolutions": 1}


def run(scene="bilge-pump", **overrides):
    dotted = {name.replace("__", "."): value for name, value in overrides.items()}
    return simulate(load_scene(scene, {**BRIEF, **dotted}), seed=2, truth=True)


def reading(solution, name="pressure"):
    names = [channel.name for channel in solution.channels]
    return solution.signal[names.index(name)]


@pytest.fixture(scope="module")
def chamber():
    """A chamber seen by a perfect sensor."""
    return run(pressure__rung="chamber", pressure__sensor__range="20 bar")


def test_a_perfect_sensor_reads_the_chamber(chamber):
    assert chamber.channels[2].unit == "Pa"
    assert chamber.channels[2].quantity == "pressure"
    truth = chamber.truth["cylinder_pressure_pa"]
    error = reading(chamber) - truth
    # the truth is sampled, the reading band-limited: they differ where a valve strikes
    assert np.sqrt(np.mean(error**2)) < 0.01 * truth.std()


def test_every_rung_is_read_as_the_force_on_the_piston_over_its_area():
    area = math.pi / 4 * 0.1**2
    smooth = {"pressure__flow": "two-harmonic"}  # the other feels knocks, too hard for this column
    for rung in ("none", "constant", "two-level", "heads"):
        found = run(pressure__rung=rung, pressure__sensor__range="100 bar", **smooth)
        force = found.truth["piston_pressure_force_n"]
        # a converter of 24 bits over 100 bar has steps of 0.6 Pa, float32 of 5 MPa rounds by 0.3
        assert_allclose(reading(found), force / area, atol=2.0)


def test_vibration_and_tacho_are_the_same_with_a_sensor():
    bare, seen = run(), run(pressure__sensor__range="10 bar", pressure__sensor__noise="1 kPa")
    assert_array_equal(bare.signal, seen.signal[[0, 1, 3]])
    assert "sensor" not in load_scene("bilge-pump").model_dump_json().split('"joint"')[0]


def test_gain_offset_noise_range_and_vacuum():
    rng = np.random.default_rng(0)
    clean = PressureSensor(range=1e6, gain=1.03, offset=2e3)
    x = np.linspace(-2e5, 2e6, 2001)
    row, lost = read_pressure(clean, x, rng)
    expected = np.clip(1.03 * x + 2e3, -101325.0, 1e6)
    assert_allclose(row, expected, atol=0.2)  # a step of 24 bits, a rounding of float32
    assert lost == np.count_nonzero(expected == 1e6) > 0
    assert row.min() == -101325.0  # vacuum is no fault of the sensor's
    noisy, _ = read_pressure(PressureSensor(range=1e6, noise=700.0), np.zeros(100_000), rng)
    assert noisy.std() == pytest.approx(700.0, rel=0.01)  # 1 / sqrt(2 n) is 0.22 %
    coarse, _ = read_pressure(PressureSensor(range=1e6, bits=8), x, rng)
    step = (1e6 + 101325.0) / 256
    assert abs(coarse - np.clip(x, -101325.0, 1e6)).max() <= step / 2 * 1.001


def test_line_and_lag_delay_a_reading_by_the_sum_of_their_delays():
    """The centre of a pulse is late by time constant plus ``zeta / (pi f)``, whatever its shape."""
    late = {"pressure__sensor__lag": "0.8 ms"}
    late |= {"pressure__sensor__line_resonance": "150 Hz", "pressure__sensor__line_damping": 0.6}
    at_once = run(pressure__sensor__range="10 bar")
    delayed = run(pressure__sensor__range="10 bar", **late)
    expected = 0.8e-3 + 0.6 / (math.pi * 150)
    spectra = [np.fft.rfft(reading(each).astype(float)[:15_360])[3] for each in (at_once, delayed)]
    # 15,360 samples hold three turns: line 3 is the first order, slow beside both time constants
    found = -np.angle(spectra[1] / spectra[0]) / (2 * math.pi * 5)
    assert found == pytest.approx(expected, rel=0.01)


def test_throws_have_sensors_of_their_own():
    scene = load_scene("triplex-pump", {"throws.1.pressure.sensor.range": "200 bar"})
    assert [(throw, sensor.name) for throw, sensor in scene.pressure_sensors] == [(1, "pressure_2")]
    every = load_scene("triplex-pump", {"pressure.sensor.range": "200 bar"})
    assert [sensor.name for _, sensor in every.pressure_sensors] == [
        "pressure_1",
        "pressure_2",
        "pressure_3",
    ]


def test_a_pump_at_rest_stands_at_suction_pressure():
    overrides = {**SENSOR, "running": False, "exciters.0.force": "500 N", "pressure.suction": -2e4}
    still = simulate(load_scene("bilge-pump", overrides), seed=0)
    assert_allclose(reading(still), -2e4, atol=0.2)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"pressure.sensor.noise": 5.0}, r"pressure\.sensor\.range is missing"),
        ({**SENSOR, "pressure.sensor.line_resonance": "100 Hz"}, "needs line_damping as well"),
        ({**SENSOR, "pressure.sensor.line_damping": 0.3}, "needs line_resonance as well"),
        ({**SENSOR, "pressure.sensor.name": "acc_x"}, "name 'acc_x' is given 2 times"),
        ({**SENSOR, "pressure.sensor.lag": "2 s"}, r"sensor\.lag = 2 s must be <= "),
    ],
)
def test_faults(overrides, words):
    with pytest.raises(SceneError, match=words):
        load_scene("bilge-pump", overrides)


def test_a_recording_with_a_pressure_has_one_row_and_is_drawn_in_kilopascals(chamber):
    recording = Recording(
        signal=chamber.signal,
        sample_rate=chamber.sample_rate,
        channels=chamber.channels,
        tacho="tacho",
    )
    layout = recording_layout(recording)
    assert layout.pressures == ("pressure",)
    assert layout.vibrations == ("acc_x", "acc_y")
    names, values = recording_features(recording)
    assert np.isfinite(values).all()
    assert [name for name in names if "pressure" in name][:2] == [
        "pressure.suction",
        "pressure.discharge",
    ]
    assert not any("velocity" in name for name in names if name.startswith("pressure"))
    trace = next(trace for trace in View(recording=recording).traces if trace.name == "pressure")
    assert trace.unit == "kPa"
    assert trace.values.max() == pytest.approx(reading(chamber).max() / 1e3)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("kPa", 1e3), ("MPa", 1e6), ("bar", 1e5), ("barg", 1e5), ("psig", 6894.757)],
)
def test_gauge_pressures_are_imported(unit, factor):
    found = parse_unit(unit)
    assert (found.quantity, found.symbol) == ("pressure", "Pa")
    assert found.factor == pytest.approx(factor, rel=1e-6)
