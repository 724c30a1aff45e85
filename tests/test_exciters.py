"""Shakers and hammers: their forces, what a running shaft line answers, what is recorded."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import kstest
from wearstate.features.response.frf import (
    block_spectra,
    estimate_frf,
    find_blows,
    force_window,
    welch_spectra,
)
from wearstate.features.response.mimo import multiple_h1
from wearstate.sim.excitation.forces import exciter_push, stepped_frequencies
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.output.status import SimulationError, Status
from wearstate.sim.scene.exciters import Exciter, ShaftExciter
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError, channels_of
from wearstate.sim.shaft.at_rest import reduced_rotor, shaft_state
from wearstate.sim.shaft.push import exciter_places
from wearstate.sim.shaft.recording import peak_motion
from wearstate.sim.shaft_response.receptance import accelerance
from wearstate.sim.shaft_response.time_response import Harmonic, harmonic_response

FS = 1024.0
STILL = {
    "turbulence": [],
    "coupling": None,
    "run_out": [],
    "dents": [],
    "discs.0.unbalance": 0.0,
    "discs.1.unbalance": 0.0,
    **{f"sensors.{i}.noise": 0.0 for i in range(4)},
    **{f"sensors.{i}.bits": 32 for i in range(4)},
    "exciters.0.noise": 0.0,
    "exciters.0.bits": 32,
}
"""Nothing but the exciter moves the rig, and what it does is read exactly."""


def part(**values):
    return ShaftExciter(**{"range": 1e6, "force": 20.0, "place": "aft", **values})


def push(seed=1, n=65536, fs=FS, index=0, lead=0, **values):
    return exciter_push(
        part(**values), n_samples=n, sample_rate=fs, seed=seed, index=index, lead=lead
    )


def rig(values, duration="32 s", still=False):
    base = {"duration": duration, "sample_rate": FS, "exciters.0.force": "20 N"}
    return load_scene("shaft-rig", {**base, **(STILL if still else {}), **values})


# --- forces


@pytest.mark.parametrize("contact_time", [1e-3, 2.5e-3])
def test_contact_time_sets_the_spectrum_of_a_blow(contact_time):
    fs = 65536.0  # 65 samples a pulse: its corners weigh (f / fs)^2, 1e-4 here
    force = push(
        kind="hammer", repeats=1, n=65536, fs=fs, contact_time=contact_time, peak_scatter=0.0
    ).cell
    at = np.array([0.0, 0.5946, 1.5]) / contact_time
    kernel = np.exp(-2j * np.pi * np.outer(at, np.arange(force.size)) / fs)
    level = np.abs(kernel @ force) / fs
    assert_allclose(level[0], 20.0 * 2 * contact_time / np.pi, rtol=1e-3)  # of a half sine
    assert_allclose(20 * np.log10(level[1] / level[0]), -3.01, atol=0.01)
    assert level[2] < 2e-3 * level[0]


def test_random_force_is_gaussian_flat_in_its_band_and_of_its_rms():
    force = push(kind="random", n=2**17, low=50.0, high=300.0).cell
    # 2 x 250 Hz x 128 s = 64,000 independent values: rms to 0.3 %
    assert_allclose(np.sqrt(np.mean(force**2)), 20.0, rtol=4 * 0.003)
    power = np.abs(np.fft.rfft(force * np.hanning(force.size))) ** 2
    hertz = np.fft.rfftfreq(force.size, 1 / FS)
    inside = (hertz > 51) & (hertz < 299)
    assert power[(hertz < 49) | (hertz > 301)].sum() < 1e-5 * power.sum()
    bands = power[inside][: 10 * (inside.sum() // 10)].reshape(10, -1).mean(axis=1)
    # each mean of some 3,000 lines, three of which are one under the window: 3 %
    assert_allclose(bands / bands.mean(), 1.0, atol=4 * 0.03)
    assert kstest(force[::4][:10000] / 20.0, "norm").pvalue > 1e-4


@pytest.mark.parametrize("kind", ["burst-random", "sweep"])
def test_bursts_have_their_rms_share_and_number(kind):
    force = push(kind=kind, repeats=8, share=0.5).cell.reshape(8, -1)
    n = force.shape[1] // 2
    assert_allclose(np.sqrt(np.mean(force[:, :n] ** 2, axis=1)), 20.0, rtol=1e-9)
    assert not force[:, n:].any()
    assert (force[0] == force[1]).all() == (kind == "sweep")


def test_a_sweep_covers_its_band():
    force = push(kind="sweep", repeats=1, share=1.0, low=50.0, high=300.0).cell
    level = np.abs(np.fft.rfft(force)) ** 2
    hertz = np.fft.rfftfreq(force.size, 1 / FS)
    inside = level[(hertz > 50) & (hertz < 300)]
    assert level[(hertz < 30) | (hertz > 320)].sum() < 1e-3 * level.sum()
    # the ripple of a chirp's spectrum is a few per cent far from its ends, where it is held
    middle = inside[2000:-2000]
    assert_allclose(middle / np.mean(middle), 1.0, atol=0.1)
    assert inside.min() > 0.2 * np.mean(middle)


def test_a_stepped_sine_holds_whole_periods_in_the_second_half_of_a_dwell():
    values = {"kind": "stepped-sine", "repeats": 16, "low": 20.0, "high": 400.0}
    dwells = push(**values).cell.reshape(16, -1)
    hertz = stepped_frequencies(part(**values), 64.0)
    settled = dwells[:, dwells.shape[1] // 2 :]
    lines = np.abs(np.fft.rfft(settled)) / settled.shape[1] * 2
    at = np.round(hertz * settled.shape[1] / FS).astype(int)
    assert (np.diff(at) > 0).all()
    assert_allclose(lines[np.arange(16), at], math.sqrt(2) * 20.0, rtol=1e-6)
    assert_allclose(np.delete(lines[3], at[3]), 0.0, atol=1e-6)


def test_blows_scatter_as_told():
    values = {"kind": "hammer", "repeats": 2000, "contact_time": 4e-3}
    n = 2000 * 64
    found = push(
        n=n, **values, peak_scatter=0.2, angle_scatter=0.1, place_scatter=0.01, double_hits=0.0
    )
    rows = [row.reshape(2000, 64) for row in found]
    top = np.abs(rows[0]).argmax(axis=1)
    cell, along, across, moment = (row[np.arange(2000), top] for row in rows)
    impulse = np.log(rows[0].sum(axis=1))  # of a pulse by few samples: 1 % beside the peak's 20
    # standard error of a deviation of n values: 1 / sqrt(2 n) = 1.6 %, four of them
    assert_allclose(np.std(impulse), 0.2, rtol=0.065)
    assert_allclose(np.std(np.arctan2(across, along)), 0.1, rtol=0.065)
    assert_allclose(np.std(moment / along), 0.01, rtol=0.065)
    assert_allclose(np.hypot(along, across), cell, rtol=1e-12)


def test_double_hits_are_told_by_the_finder_of_blows():
    found = []
    for share in (0.0, 0.5):
        force = push(kind="hammer", repeats=40, double_hits=share, n=40 * 2048).cell
        blows = find_blows(force, FS, nperseg=1500, pretrigger=8)
        found.append((len(blows.starts), len(blows.rejected)))
    assert found[0] == (40, 0)
    # 20 +- 3.2 of 40 rebound; rebounds below a tenth of the hardest blow go unseen
    assert 5 <= found[1][1] <= 33
    assert sum(found[1]) >= 38


def test_forces_depend_on_the_seed_and_the_exciter_alone():
    for kind in ("random", "burst-random", "hammer"):
        one = push(kind=kind, n=4096, repeats=2)
        assert_array_equal(one, push(kind=kind, n=4096, repeats=2))
        assert (one.cell != push(kind=kind, n=4096, repeats=2, seed=2).cell).any()
        assert (one.cell != push(kind=kind, n=4096, repeats=2, index=1).cell).any()


def test_quiet_and_lead():
    for kind in ("random", "stepped-sine", "burst-random", "hammer"):
        values = {"kind": kind, "n": 4096, "repeats": 2}
        led = push(**values, lead=500).cell
        assert led.size == 4596
        assert led[:500].any() == (kind in ("random", "stepped-sine"))
        late = push(**values, lead=500, quiet=1.0).cell
        assert not late[: 500 + 1024].any()
        assert late[500 + 1024 :].any()


# --- a running line answers


def recorded(scene, seed):
    solution = simulate(scene, seed=seed)
    kinds = [channel.quantity for channel in solution.channels]
    force = solution.signal[[k == "force" for k in kinds]].astype(float)
    response = solution.signal[[k == "acceleration" for k in kinds]].astype(float)
    return force, response


def exact(scene, hertz):
    """[shape=(n_lines, n_sensors, n_exciters)]"""
    state = shaft_state(scene)
    places = [(sensor.bearing, "y", "housing") for sensor in scene.sensors]
    forces = list(exciter_places(scene))
    return accelerance(state.rotor, hertz, places, forces, speed=state.film.speed)


def by_blows(force, response):
    blows = find_blows(force, FS, nperseg=768, pretrigger=6)
    assert not blows.rejected
    window = force_window(768, FS, end=12 / FS, fall=4 / FS)
    return block_spectra(blows.cut(force), blows.cut(response), FS, force_window=window)


def by_welch(force, response):
    return welch_spectra(force, response, FS, nperseg=2048)


_SPECTRA = {False: by_welch, True: by_blows}


@pytest.mark.parametrize("kind", ["random", "burst-random", "hammer"])
def test_h1_of_a_record_is_the_lines_accelerance(kind):
    values = {"exciters.0.kind": kind}
    if kind == "hammer":
        values |= {"exciters.0.force": "400 N", "exciters.0.range": "2 kN"}
        values |= {"exciters.0.contact_time": "2 ms", "exciters.0.repeats": 40}
    scene = rig(values, "48 s")
    force, response = recorded(scene, 1)
    spectra = _SPECTRA[kind == "hammer"](force[0], response).between(20.0, 400.0)
    frf = estimate_frf(spectra, confidence=0.95)
    true = exact(scene, frf.frequency)[:, :, 0].T
    sure = frf.coherence > 0.9
    assert sure.mean() > 0.5
    held = np.abs(frf.value - true)[sure] <= frf.radius[sure]
    # of some 1,500 lines, three of which are one under the window; a block's edge cuts ringing
    # and adds a per cent of bias, which the disc of a line does not know
    assert held.mean() > 0.85
    assert np.median(np.abs(frf.value / true - 1)[sure]) < 0.05


def test_two_shakers_are_told_apart():
    second = {
        "name": "force_2", "kind": "random", "force": "20 N", "place": "second",
        "direction": "up", "range": "200 N", "low": "5 Hz", "high": "450 Hz",
    }  # fmt: skip
    one = rig({}).model_dump()["exciters"][0]
    scene = rig({"exciters": [one, second]}, "64 s")
    force, response = recorded(scene, 1)
    assert abs(np.corrcoef(force)[0, 1]) < 4 / np.sqrt(2 * 445 * 64)  # independent
    found = multiple_h1(force, response, FS, nperseg=2048)
    band = (found.frequency > 20) & (found.frequency < 400)
    true = exact(scene, found.frequency[band])
    value = np.moveaxis(found.value, -1, 0)[band]
    sure = found.coherence[:, band].T > 0.95
    assert sure.mean() > 0.5
    for k in range(2):  # each path, where all forces together explain the response
        size = np.abs(true[..., k])
        strong = sure & (size > np.median(size))
        assert np.median(np.abs(value[..., k] - true[..., k])[strong] / size[strong]) < 0.06


def test_a_shaker_that_was_on_before_is_heard_settled_from_the_first_sample():
    values = {"exciters.0.kind": "stepped-sine", "exciters.0.repeats": 1, "exciters.0.low": "64 Hz"}
    scene = rig(values, "2 s", still=True)
    solution = simulate(scene, seed=0)
    row = [channel.name for channel in solution.channels].index("acc_forward")
    reduced = reduced_rotor(scene, shaft_state(scene))
    [[phasor]] = harmonic_response(
        reduced,
        [Harmonic(frequency=64.0, forces={exciter_places(scene)[0]: math.sqrt(2) * 20.0})],
        [("forward", "y", "housing")],
    )
    amplitude = abs(phasor) * (2 * np.pi * 64.0) ** 2
    blocks = solution.signal[row].reshape(-1, 64).astype(float)  # four periods each
    found = np.sqrt(2 * np.mean(blocks**2, axis=1))
    # settled to 1e-4; converter steps of 1e-8
    assert_allclose(found, amplitude, rtol=1e-3)


def test_a_station_is_the_same_place_as_the_bearing_that_stands_there():
    one = rig({}, "2 s")
    other = rig({"exciters.0.place": "", "exciters.0.station": "4.0 m"}, "2 s")
    assert_array_equal(simulate(one, seed=3).signal, simulate(other, seed=3).signal)
    assert channels_of(other)[-2].place == "shaft at 4 m"
    free = rig({"exciters.0.place": "", "exciters.0.station": "3.5 m"}, "2 s")
    assert exciter_places(free) == ((3.5, "y"),)
    assert simulate(free, seed=3).status.ok


def test_on_a_housing_and_sideways():
    scene = rig({"exciters.0.part": "housing", "exciters.0.direction": "side"}, "2 s", still=True)
    assert exciter_places(scene) == (("forward", "z", "housing"),)
    channel = channels_of(scene)[-2]
    told = (channel.unit, channel.quantity, channel.place, channel.direction)
    assert told == ("N", "force", "housing of forward", "horizontal, to starboard")
    solution = simulate(scene, seed=3, truth=True)
    assert_allclose(solution.signal[-2], solution.truth["test_force_n"][:, 0], atol=1e-5)


def test_an_exciter_without_force_changes_nothing():
    scene = load_scene("shaft-rig", {"duration": "1 s"})
    bare = load_scene("shaft-rig", {"duration": "1 s", "exciters": []})
    assert scene.exciters
    assert channels_of(scene) == channels_of(bare)
    solutions = [simulate(each, seed=5) for each in (scene, bare)]
    assert solutions[0].signal.tobytes() == solutions[1].signal.tobytes()


def test_a_test_leaves_the_other_channels_noise_and_the_machines_vibration():
    quiet = simulate(rig({"exciters.0.force": 0}, "2 s"), seed=5)
    pushed = simulate(rig({"exciters.0.quiet": "1 s"}, "2 s"), seed=5)
    names = [channel.name for channel in pushed.channels]
    assert [channel.name for channel in quiet.channels] == [n for n in names if n != "force"]
    rows = [names.index(channel.name) for channel in quiet.channels]
    n = int(FS)  # the force comes softly and rings before by nothing
    assert_allclose(pushed.signal[rows, :n], quiet.signal[:, :n], atol=1e-3)
    assert np.std(pushed.signal[rows[3], int(FS) :]) > 2 * np.std(quiet.signal[3, int(FS) :])


@pytest.mark.parametrize("kind", ["random", "sweep", "stepped-sine", "hammer"])
def test_peak_motion_bounds_what_an_exciter_does(kind):
    values = {"exciters.0.kind": kind, "exciters.0.range": "2 kN"}
    values["exciters.0.force"] = "300 N" if kind == "hammer" else "20 N"
    scene = rig(values, "16 s", still=True)
    bound = peak_motion(scene, reduced_rotor(scene, shaft_state(scene)))
    path = simulate(scene, seed=2, truth=True).truth["journal_m"]
    found = np.linalg.norm(path - path.mean(axis=0), axis=-1).max(axis=0)
    # four deviations are passed once in 16,000 values of a random motion; a third of the bound is
    # reached where the sweep is fast or both directions do not peak at once
    assert (found < 1.15 * bound).all()
    assert (found > 0.25 * bound).all()


def test_too_hard_a_push_ends_the_run():
    with pytest.raises(SimulationError) as caught:
        simulate(rig({"exciters.0.force": "2 kN"}, "2 s"), seed=1)
    assert caught.value.status is Status.LINE_MOTION
    told = simulate(rig({"exciters.0.force": "300 N"}, "2 s"), seed=1)
    assert any("force of exciters" in warning for warning in told.warnings)
    assert any("samples clipped" in warning for warning in told.warnings)  # the cell has 200 N


# --- faults


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ({"high": "600 Hz"}, "exciters.0.high = 600 Hz must be <= 512 Hz"),
        ({"quiet": "9 s"}, "exciters.0.quiet = 9 s must be < duration = 2 s"),
        ({"kind": "hammer", "contact_time": "1 ms"}, "contact_time = 0.001 s must be >= 0.00195"),
        ({"kind": "hammer", "repeats": 100}, "and <= 0.002 s, a tenth of the time for a blow"),
        ({"kind": "stepped-sine", "repeats": 500}, "exciters.0.repeats = 500 leaves 0.004 s"),
        ({"kind": "sweep", "repeats": 500}, "too short for one period of low"),
        ({"place": "forwrd"}, "exciters.0.place = 'forwrd' is no bearing and no disc"),
        ({"place": "disc", "part": "housing"}, "'disc' is no bearing; choose one of aft, second"),
        ({"station": "1 m"}, "both of place and station given"),
        ({"place": ""}, "neither of place and station given"),
        ({"place": "", "station": "9 m"}, "exciters.0.station = 9 m must be <= the shaft's length"),
        ({"part": "housing", "place_scatter": "1 cm"}, "place_scatter = 0.01 m must be 0"),
        ({"low": "500 Hz"}, "low = 500 Hz must be < high = 450 Hz"),
        ({"name": "acc_aft"}, "name 'acc_aft' is given 2 times"),
        ({"kind": "noise"}, "exciters.0.kind = 'noise' must be 'random', 'burst-random'"),
    ],
)
def test_faults_are_told(values, fault):
    with pytest.raises(SceneError) as caught:
        check(rig({f"exciters.0.{key}": value for key, value in values.items()}, "2 s"))
    assert fault in str(caught.value)


def test_what_is_not_mounted_is_not_checked_against_the_recording():
    check(rig({"exciters.0.force": 0, "exciters.0.high": "2 kHz"}, "2 s"))
    assert not Exciter(range=1.0).mounted
