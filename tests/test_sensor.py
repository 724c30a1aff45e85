"""Accelerometer, converter and tacho."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.sensor import (
    HUM,
    anti_alias_poles,
    digitise,
    low_pass,
    low_pass_response,
    mains_hum,
    mounting_poles,
    tacho_pulses,
)
from wearstate.sim.scene.load import load_scene, override, scene_from_table, scene_table, scene_text
from wearstate.sim.scene.scene import SceneError, channels_of


def clean(x, **changes):
    options = {"gain": 1.0, "noise": 0.0, "full_scale": 100.0, "bits": 24, **changes}
    return digitise(np.asarray(x, dtype=float), rng=np.random.default_rng(7), **options)


def test_gain():
    x = np.linspace(-50, 50, 1001)
    signal, clipped = clean(x, gain=1.05)
    # half a step of 24 bits over +-100 is 6e-6; float32 of 50 rounds by 2e-6
    assert_allclose(signal, 1.05 * x, atol=8e-6)
    assert signal.dtype == np.float32
    assert clipped == 0


def test_noise_has_its_rms_and_is_white():
    noise, _ = clean(np.zeros(200_000), noise=0.3)
    # rms of n Gaussian samples: 1 / sqrt(2 n) = 0.16 %; four of them
    assert_allclose(noise.std(), 0.3, rtol=0.0064)
    # mean: 1 / sqrt(n); autocorrelation of white noise: the same
    assert abs(noise.mean()) < 4 * 0.3 / np.sqrt(200_000)
    correlation = np.mean(noise[1:] * noise[:-1]) / noise.var()
    assert abs(correlation) < 4 / np.sqrt(200_000)


@pytest.mark.parametrize(("n", "fs", "heard"), [(1537, 1e3, 4), (512, 320.0, 3), (100, 90.0, 0)])
def test_hum_is_the_sum_of_its_harmonics(n, fs, heard):
    """Over block ends; at low rates without the fifth harmonic, and without any."""
    phases = np.random.default_rng(4).random(4)
    amplitude = 0.2 * np.sqrt(2 / sum(share**2 for _, share in HUM))
    expected = sum(
        amplitude * share * np.sin(2 * np.pi * (order * 50.0 / fs * np.arange(n) + phase))
        for (order, share), phase in list(zip(HUM, phases, strict=True))[:heard]
    )
    hum = mains_hum(n, fs, rms=0.2, frequency=50.0, rng=np.random.default_rng(4))
    assert hum.shape == (n,)
    assert_allclose(hum, expected, rtol=0, atol=1e-12)  # rounding of 2400 rad


def test_noise_is_added_after_the_gain():
    quiet, _ = clean(np.zeros(1000), noise=0.3)
    loud, _ = clean(np.zeros(1000), noise=0.3, gain=5.0)
    assert_array_equal(quiet, loud)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_quantisation_step(bits):
    x = np.random.default_rng(0).uniform(-90, 90, 50_000)
    signal, _ = clean(x, bits=bits)
    step = 200.0 / 2**bits
    in_steps = signal / step
    assert_allclose(in_steps, np.round(in_steps), atol=1e-2)  # float32 of 2^15 steps: 2e-3
    error = signal - x
    assert abs(error).max() <= step / 2 * 1.01
    # uniform over a step; rms of 50,000 samples to 0.5 %
    assert_allclose(error.std(), step / np.sqrt(12), rtol=0.02)


def test_clipping_is_counted():
    signal, clipped = clean([-150.0, -100.0, 0.0, 100.0, 100.1, 1e9])
    assert clipped == 3  # full scale itself is not clipped
    assert_allclose(signal, [-100, -100, 0, 100, 100, 100], rtol=1e-6)


def test_clipping_sees_gain_and_noise():
    assert clean([60.0], gain=2.0)[1] == 1
    assert clean(np.zeros(1000), noise=1000.0)[1] > 800


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30),
    st.integers(8, 32),
    st.floats(1e-3, 1e4),
)
def test_nothing_leaves_the_range(values, bits, full_scale):
    signal, clipped = clean(values, bits=bits, full_scale=full_scale)
    assert np.all(np.isfinite(signal))
    assert abs(signal).max() <= full_scale * (1 + 1e-6)
    assert clipped == sum(abs(v) > full_scale for v in values)


# --- the mounted sensor and the filter before the converter


@pytest.mark.parametrize("zeta", [0.01, 0.03, 0.3])
def test_mounting_resonance(zeta):
    f0 = 25e3
    poles = mounting_poles(f0, zeta)
    response = low_pass_response(np.array([0.0, f0 / 3, f0, 10 * f0]), poles)
    assert_allclose(response[0], 1.0, rtol=1e-14)  # rounding
    r = np.array([1 / 3, 1.0, 10.0])
    assert_allclose(response[1:], 1 / (1 - r**2 + 2j * zeta * r), rtol=1e-12)
    # Named apart: the gain at the resonance, a quarter of a turn behind; a third of it reads 12 %
    # too much, the usual rule for the useful band.
    assert_allclose(response[2], -0.5j / zeta, rtol=1e-12)
    if zeta < 0.1:
        assert_allclose(abs(response[1]), 9 / 8, rtol=1e-3 if zeta < 0.02 else 5e-3)


@pytest.mark.parametrize("kind", ["butterworth", "bessel"])
@pytest.mark.parametrize("order", [1, 2, 4, 8, 10])
def test_anti_alias_filter(kind, order):
    cutoff = 10e3
    poles = anti_alias_poles(kind, cutoff, order)
    far = 1e3 * cutoff
    level = abs(low_pass_response(np.array([0.0, cutoff, far, 2 * far]), poles))
    assert_allclose(level[0], 1.0, rtol=1e-12)
    assert_allclose(level[1], np.sqrt(0.5), rtol=1e-6)  # scipy seeks the Bessel one to 1e-8
    # 6.02 dB an octave and order; terms of (cutoff / far)^2 are left, ten times for Bessel.
    assert_allclose(level[2] / level[3], 2.0**order, rtol=1e-4)
    f = np.linspace(0, 3 * cutoff, 50)
    falling = abs(low_pass_response(f, poles))
    assert np.all(np.diff(falling) < 1e-14)  # rounding, where it is flat
    if kind == "butterworth":
        assert_allclose(falling, (1 + (f / cutoff) ** (2 * order)) ** -0.5, rtol=1e-10)
    else:  # the delay of a Bessel filter is the same throughout its pass band
        phase = np.unwrap(np.angle(low_pass_response(np.linspace(1, cutoff / 4, 30), poles)))
        delay = -np.diff(phase)
        # Flat as (f / cutoff)^(2 order): of the first order 1 / (1 + r^2), a sixteenth.
        assert np.ptp(delay) / delay[0] < (0.07 if order == 1 else 0.04)


FS = 25_600.0


@pytest.mark.parametrize(
    "poles", [mounting_poles(25e3, 0.03), anti_alias_poles("butterworth", 9e3, 8)]
)
@pytest.mark.parametrize("f", [200.0, 5000.0, 9000.0, 11_000.0])
def test_a_sine_has_level_and_phase_of_the_response(poles, f):
    time = np.arange(8000) / FS
    out = low_pass(np.sin(2 * np.pi * f * time), FS, poles)
    wave = np.exp(2j * np.pi * f * time[2000:6000])
    design = np.column_stack([wave.imag, wave.real])
    sine, cosine = np.linalg.lstsq(design, out[2000:6000], rcond=None)[0]
    # The sine's ends ring at the band edge, 1 / (pi n) at n > 2,000 samples, out of step with it.
    expected = complex(low_pass_response(np.array([f]), poles)[0])
    assert_allclose(sine + 1j * cosine, expected, atol=3e-4)


@pytest.mark.parametrize("f0", [30.0, 25e3])
def test_nothing_wraps_round_and_nothing_comes_early(f0):
    x = np.zeros((2, 4000))
    x[0, 2000] = 1.0
    x[1, -50:] = 1.0
    out = low_pass(x, FS, mounting_poles(f0, 0.03))
    assert abs(out).max() > 1e-3
    # A sample is as narrow as the band; its ringing sinks as 1 / n, at half the rate. A pole
    # within the band leaves none; one above it a response that jumps at the band's edge.
    early = 2e-3 * abs(out).max(axis=1)
    assert abs(out[0, :1500]).max() < early[0]
    assert abs(out[1, :3000]).max() < early[1]


def test_a_steady_beginning_makes_no_transient():
    assert_allclose(low_pass(np.full(300, 7.0), FS, mounting_poles(40.0, 0.03)), 7.0, rtol=1e-12)


def test_a_slow_resonance_rings_as_its_step_response():
    f0, zeta = 60.0, 0.05
    x = np.zeros(6000)
    rise = np.arange(1, 41) / 41
    x[1000:1040] = 0.5 - 0.5 * np.cos(np.pi * rise)  # 1.6 ms, a tenth of the period
    x[1040:] = 1.0
    out = low_pass(x, FS, mounting_poles(f0, zeta))
    time = (np.arange(1100, 6000) - 1020) / FS
    w, wd = 2 * np.pi * f0, 2 * np.pi * f0 * np.sqrt(1 - zeta**2)
    step = np.exp(-zeta * w * time) * (np.cos(wd * time) + zeta * w / wd * np.sin(wd * time))
    # A rise over T passes f0 as 1 - (1 - 8 / pi^2) (pi f0 T)^2 / 2 or so: 1e-2.
    assert_allclose(out[1100:], 1 - step, atol=1e-2)


@pytest.mark.parametrize("bits", [16, 24])
def test_noise_floor_of_a_converter(bits):
    full_scale, n = 100.0, 200_000
    step = 2 * full_scale / 2**bits
    x = 0.3 * step * np.random.default_rng(4).standard_normal(n)  # of the last bit only
    signal, _ = clean(x, bits=bits, full_scale=full_scale)
    error = signal - np.round(x / step) * step
    assert abs(error).max() == 0  # float32 holds so few steps exactly
    busy = np.random.default_rng(5).uniform(-20 * step, 20 * step, n)
    floor = (clean(busy, bits=bits, full_scale=full_scale)[0] - busy).std()
    assert_allclose(floor, step / np.sqrt(12), rtol=6e-3)  # rms of n samples: 0.14 %, four of them


# --- what a scene says of it


def pump(**changes):
    return load_scene("bilge-pump", {f"sensors.0.{name}": v for name, v in changes.items()})


def test_units_and_defaults_of_the_front_end():
    sensor = pump(
        mounting_resonance="25 kHz",
        mounting_damping="3 %",
        anti_alias="bessel",
        anti_alias_cutoff="10 kHz",
        anti_alias_order=4,
    ).sensors[0]
    assert (sensor.mounting_resonance, sensor.mounting_damping) == (25_000.0, 0.03)
    assert (sensor.anti_alias_cutoff, sensor.anti_alias_order) == (10_000.0, 4)
    plain = pump().sensors[0]
    assert (plain.mounting_resonance, plain.anti_alias, plain.axes) == (None, "none", ())


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"mounting_resonance": "25 kHz"}, "mounting_resonance = 25000 needs mounting_damping"),
        ({"mounting_damping": 0.03}, "mounting_damping = 0.03 needs mounting_resonance as well"),
        ({"mounting_resonance": "0.5 Hz", "mounting_damping": 0.1}, "= 0.5 Hz must be >= 1"),
        ({"mounting_resonance": "9 kHz", "mounting_damping": 1}, "mounting_damping = 1 must be <"),
        ({"anti_alias": "butterworth", "anti_alias_order": 4}, "needs anti_alias_cutoff as well"),
        ({"anti_alias_order": 4}, "anti_alias_order = 4 needs anti_alias = 'butterworth' or"),
        ({"anti_alias": "chebyshev"}, "must be 'none', 'butterworth' or 'bessel'"),
        ({"anti_alias_order": 11}, "sensors.0.anti_alias_order = 11 must be <= 10"),
        ({"axes": ["x", "x"]}, "axes = ['x', 'x'] must be different; remove one"),
        ({"axes": ["u"]}, "sensors.0.axes.0 = 'u' must be 'x', 'y' or 'z'"),
        ({"axes": ["x"]}, "direction = 'along the stroke' must be empty with axes"),
        ({"axes": ["x"], "direction": "", "name": "a" * 63}, "name has 63 characters, must have"),
    ],
)
def test_faults_of_the_front_end(changes, says):
    with pytest.raises(SceneError) as caught:
        pump(**changes)
    assert any(says in fault and "sensors.0" in fault for fault in caught.value.faults), (
        caught.value.faults
    )


def triaxial(**changes):
    table = scene_table(scene_text("bilge-pump"))
    head = {"name": "head", "axes": ["x", "y", "z"], "place": "cylinder head", "range": "200 g"}
    table["sensors"] = [head, table["sensors"][1]]
    for mode in table["casing"]["modes"]:
        mode["shape"]["head_x"] = mode["shape"].pop("acc_x")
        mode["shape"] |= {"head_y": mode["shape"]["acc_y"], "head_z": 0.03}
    table |= {"duration": "0.25 s"}
    return scene_from_table(override(table, {"sensors.1.noise": 0, **changes}))


def test_a_triaxial_sensor_has_three_channels():
    scene = triaxial()
    assert [s.name for s in scene.accelerometers] == ["head_x", "head_y", "head_z", "acc_y"]
    channels = channels_of(scene)
    assert [channel.name for channel in channels[:3]] == ["head_x", "head_y", "head_z"]
    assert channels[2].direction == "along the shaft"
    assert {channel.place for channel in channels[:3]} == {"cylinder head"}
    assert scene_from_table(scene.model_dump()) == scene


def test_an_axis_measures_what_a_sensor_of_its_own_would():
    signal = simulate(triaxial(), seed=1).signal
    single = load_scene(
        "bilge-pump", {"duration": "0.25 s", "sensors.0.noise": 0, "sensors.1.noise": 0}
    )
    alone = simulate(single, seed=1).signal
    assert_array_equal(signal[[0, 3]], alone[:2])
    assert_array_equal(signal[1], signal[3])  # the shapes of head_y and acc_y are the same
    assert signal[2].std() > 0.1
    doubled = simulate(triaxial(**{"sensors.0.gain": 2.0}), seed=1).signal
    step = 2 * triaxial().sensors[0].range / 2**24
    assert_allclose(doubled[:3], 2 * signal[:3], atol=2 * step)  # one path moves all its axes
    assert_array_equal(doubled[3], signal[3])


def test_a_missing_axis_is_named():
    with pytest.raises(SceneError, match=r"casing\.modes\.0\.shape\.head_w is no place") as caught:
        triaxial(**{"casing.modes.0.shape": {"head_w": 1.0, "head_x": 0.1, "acc_y": 0.1}})
    assert any("shape.head_z is missing" in fault for fault in caught.value.faults)


def test_a_recording_passes_mounting_and_filter():
    quiet = {"duration": "0.25 s", "sensors.0.noise": 0, "sensors.1.noise": 0}
    plain = simulate(load_scene("bilge-pump", quiet), seed=1).signal
    mounted = {"sensors.0.mounting_resonance": "9 kHz", "sensors.0.mounting_damping": 0.05}
    filtered = {
        "sensors.0.anti_alias": "butterworth",
        "sensors.0.anti_alias_cutoff": "2 kHz",
        "sensors.0.anti_alias_order": 6,
    }
    filter_poles = anti_alias_poles("butterworth", 2e3, 6)
    for changes, poles in (
        (mounted, mounting_poles(9e3, 0.05)),
        (filtered, filter_poles),
        (mounted | filtered, np.concatenate([mounting_poles(9e3, 0.05), filter_poles])),
    ):
        found = simulate(load_scene("bilge-pump", {**quiet, **changes}), seed=1).signal
        expected = low_pass(plain[0].astype(float), FS, poles)
        # Cut out of the run before or after the filter: the same once the start has died away,
        # exp(-2800 / s * 20 ms), but for the band edge's ringing at the cuts and two roundings.
        step = 2 * load_scene("bilge-pump").sensors[0].range / 2**24
        away = slice(512, -512)
        atol = 1e-3 * plain[0].std() + step
        assert_allclose(found[0][away], expected[away], rtol=0, atol=atol)
        assert abs(found[0][away] - plain[0][away]).max() > 100 * atol
        assert_array_equal(found[1], plain[1])  # the other sensor has neither


# --- the tacho


def interpolated_edges(pulses, level):
    """Rising edges in samples, from the one or two samples that a box-filtered edge touches.

    A sample holds the mean over the interval round it: an edge inside that of sample k leaves it at
    the fraction of the interval that lies behind the edge.
    """
    share = pulses / level
    rising = np.flatnonzero((share[:-2] == 0) & (share[2:] == 1)) + 1
    return rising + 0.5 - share[rising]


@pytest.mark.parametrize("speed", [4.25, 5.0, 5.75, 83.3])
def test_edges_interpolate_to_the_true_crossing(speed):
    fs, start = 25_600.0, -0.37
    n = 60_000
    revolutions = start + speed / fs * np.arange(n)
    pulses = tacho_pulses(revolutions, pulse_width=10 / 360, level=5.0)
    edges = interpolated_edges(pulses.astype(float), 5.0)
    truth = (np.arange(0, revolutions[-1]) - start) * fs / speed
    truth = truth[(truth > 1) & (truth < n - 2)]
    # An edge just at a sample may show as share 0 or 1 there; none is lost all the same.
    assert len(edges) >= len(truth) - 1
    nearest = truth[np.argmin(abs(truth[None, :] - edges[:, None]), axis=1)]
    # float32 of the level: 6e-8 of a sample. float64 angles of 1e3 turns over 2e-4 turns a
    # sample: 1e-13 / 2e-4 = 1e-9 of one.
    assert_allclose(edges, nearest, rtol=0, atol=1e-6)


def test_pulse_has_its_width_and_level():
    revolutions = np.arange(100_000) * 1e-4
    pulses = tacho_pulses(revolutions, pulse_width=0.1, level=5.0)
    assert pulses.dtype == np.float32
    assert set(np.unique(pulses[(revolutions % 1 > 0.001) & (revolutions % 1 < 0.099)])) == {5.0}
    assert set(np.unique(pulses[(revolutions % 1 > 0.101) & (revolutions % 1 < 0.999)])) == {0.0}
    assert_allclose(pulses.mean(), 0.5, rtol=2e-4)  # ten whole turns, one sample more or less


def test_tacho_of_a_changing_speed():
    time = np.arange(40_000) / 25_600.0
    revolutions = 5.0 * time + 0.5 * time**2 + 0.2  # run-up
    pulses = tacho_pulses(revolutions, pulse_width=0.1, level=1.0).astype(float)
    edges = interpolated_edges(pulses, 1.0)
    truth = (-5.0 + np.sqrt(25.0 + 2.0 * (np.arange(1, 20) - 0.2))) * 25_600.0
    # Within one sample the angle is taken as linear: acceleration * dt^2 / 8 over speed * dt,
    # that is 1e-6 of a sample.
    assert_allclose(edges, truth[: len(edges)], rtol=0, atol=2e-6)
    assert len(edges) >= 8
