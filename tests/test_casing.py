"""From force to housing acceleration: exact discretisation, the FRF's phase, the decimation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import signal
from wearstate.sim.casing.decimation import (
    PASS_BAND,
    decimate,
    decimation_filter,
    edge_samples,
    pieces,
)
from wearstate.sim.casing.modes import (
    CasingModes,
    ModalCasing,
    _ModesInMotion,
    casing_inputs,
    exact_oscillator,
)
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.pump import FORCE_PLACES
from wearstate.sim.scene.scene import SceneError

FS = 25_600.0
FACTORS = [1, 2, 3, 5, 8]


def housing_acceleration(forces, fs, modes):
    """[m/s^2, shape=(n_outputs, n_samples)] of forces that are linear between samples."""
    as_they_are = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # no loss of straight lines made up
    casing = _ModesInMotion(modes, as_they_are, fs)
    found = []

    def response(n):
        return np.empty((modes.outputs.shape[1], n))

    for piece in pieces(forces.T):
        casing.room(piece.shape[1])[:] = piece
        found.append(casing.take(piece.shape[1], response))
    return np.hstack([*found, casing.finish(response)])


def one_mode(forces, frequency=388.0, damping_ratio=0.025, shape=1.0, fs=FS):
    """Housing acceleration of a single mode with the same shape at force and sensor."""
    return housing_acceleration(
        np.asarray(forces)[:, None], fs, mode(frequency, damping_ratio, shape)
    )[0]


def mode(frequency, damping_ratio, shape=1.0):
    return CasingModes(
        frequency=np.array([frequency]),
        damping_ratio=np.array([damping_ratio]),
        inputs=np.array([[shape]]),
        outputs=np.array([[shape]]),
    )


def state_space(frequency, damping_ratio):
    w = 2 * np.pi * frequency
    return (
        np.array([[0.0, 1.0], [-(w**2), -2 * damping_ratio * w]]),
        np.array([[0.0], [1.0]]),
        np.array([[-(w**2), -2 * damping_ratio * w]]),
        np.array([[1.0]]),
    )


def accelerance(f, frequency, damping_ratio):
    """Of a unit mass: acceleration over force, exp(+j w t)."""
    r = f / frequency
    return -(r**2) / (1 - r**2 + 2j * damping_ratio * r)


def held_accelerance(f, frequency, damping_ratio, fs=FS):
    """What a sampled sine meets when the force is linear between samples.

    The straight lines hold the sine times sinc^2 and its images about multiples of the sample
    rate; every image passes the mode, and sampling folds it back.
    """
    k = np.arange(-20_000, 20_001)
    share = np.sinc(f / fs - k) ** 2
    passed = accelerance(f - k * fs, frequency, damping_ratio)
    # beyond the last image the mode is a mass of one: what is missing of the shares, sum 1
    return (share * passed).sum() + (1 - share.sum())


# --- the oscillator


@settings(max_examples=60, deadline=None)
@given(cycles=st.floats(0.01, 3.0), damping_ratio=st.floats(0.0, 0.9))
def test_discretisation_against_scipy(cycles, damping_ratio):
    frequency, step = 100.0, cycles / 100.0
    transition, gain = exact_oscillator(frequency, damping_ratio, step)
    a, b = state_space(frequency, damping_ratio)[:2]
    # scipy's first-order hold carries the state z = x - gain_next u, hence its B and D
    discrete = signal.cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), step, method="foh")
    scale = np.array([[1.0, 1 / (2 * np.pi * frequency)], [2 * np.pi * frequency, 1.0]])
    # Two routes to one matrix exponential: rounding times the condition of a few cycles, on the
    # natural scale of each entry.
    assert_allclose(transition / scale, discrete[0] / scale, rtol=0, atol=1e-12)
    following = discrete[3]
    now = discrete[1] - discrete[0] @ following
    natural = np.array([[1 / (2 * np.pi * frequency) ** 2], [1 / (2 * np.pi * frequency)]])
    assert_allclose(gain[:, 1:] / natural, following / natural, rtol=0, atol=1e-11)
    assert_allclose(gain[:, :1] / natural, now / natural, rtol=0, atol=1e-11)


def test_response_against_scipy_lsim():
    rng = np.random.default_rng(3)
    force = np.concatenate([np.zeros(1), rng.standard_normal(400)])  # starts at rest
    time = np.arange(len(force)) / FS
    _, expected, _ = signal.lsim(state_space(388.0, 0.025), force, time)  # also linear between
    assert_allclose(one_mode(force), expected, rtol=0, atol=1e-11)  # rounding over 400 steps


@pytest.mark.parametrize("ratio", [0.05, 0.5, 1.0, 2.0, 8.0])
def test_sine_response_has_amplitude_and_phase_of_the_accelerance(ratio):
    frequency, zeta = 388.0, 0.025
    f = ratio * frequency
    time = np.arange(int(0.6 * FS)) / FS
    force = 7.0 * np.sin(2 * np.pi * f * time)
    response = one_mode(force, frequency, zeta)
    settled = time > 0.3  # exp(-zeta w 0.3) = 1e-8
    basis = np.exp(2j * np.pi * f * time[settled])
    design = np.column_stack([basis.imag, basis.real])
    sine, cosine = np.linalg.lstsq(design, response[settled], rcond=None)[0] / 7.0
    found = sine + 1j * cosine
    # What is left of the start: 1e-8, seen against a response of 2e-3 far below the mode.
    assert_allclose(found, held_accelerance(f, frequency, zeta), rtol=1e-5)
    # The phase is the mode's own, the hold adds none: within the images' (f / fs)^2 / 3 of it.
    assert_allclose(np.angle(found), np.angle(accelerance(f, frequency, zeta)), atol=5e-3)


def test_signs_of_the_accelerance():
    # Far below: against the force, quasi-static. Far above: with it, +1 / m (here a mass of 4 kg).
    low = accelerance(1.0, 100.0, 0.01)
    assert low.real < 0
    shape, f = 1 / np.sqrt(4.0), 3000.0
    force = np.sin(2 * np.pi * f * np.arange(20_000) / FS)
    response = one_mode(force, 20.0, 0.3, shape)[10_000:]
    in_phase = 2 * np.mean(response * force[10_000:])
    # (f0 / f)^2 = 4e-5 from the stiffness; the sampled sine is not whole in its 10,000 samples.
    assert_allclose(in_phase, 1 / 4.0, rtol=1e-3)


def test_momentum_of_a_push():
    """A free mass (very soft mode) keeps the velocity that the force's impulse gave it."""
    force = np.zeros(2000)
    force[100:103] = [500.0, 800.0, 300.0]
    velocity = np.cumsum(one_mode(force, 1e-4, 0.5)) / FS
    # w t = 5e-5 of the motion is given back to the spring and the dashpot.
    assert_allclose(velocity[-1], force.sum() / FS, rtol=2e-4)


def test_superposition_and_reciprocity():
    rng = np.random.default_rng(5)
    forces = rng.standard_normal((600, 3))
    frequency, zeta = np.array([142.0, 815.0, 7620.0]), np.array([0.04, 0.02, 0.015])
    inputs, outputs = rng.standard_normal((3, 3)), rng.standard_normal((3, 2))

    def modes(inputs, outputs):
        return CasingModes(frequency=frequency, damping_ratio=zeta, inputs=inputs, outputs=outputs)

    together = housing_acceleration(forces, FS, modes(inputs, outputs))
    assert together.shape == (2, 600)
    apart = np.zeros_like(together)
    for m in range(3):
        for j in range(3):
            for k in range(2):
                apart[k] += (
                    outputs[m, k] * inputs[m, j] * one_mode(forces[:, j], frequency[m], zeta[m])
                )
    assert_allclose(together, apart, rtol=0, atol=1e-11)  # rounding of 18 sums
    # Exchange force and sensor: the same response.
    there = housing_acceleration(forces[:, :1], FS, modes(inputs[:, :1], outputs[:, :1]))
    back = housing_acceleration(forces[:, :1], FS, modes(outputs[:, :1], inputs[:, :1]))
    assert_allclose(there, back, rtol=0, atol=1e-12)


@pytest.mark.parametrize("n_inputs", [1, 2, 3])
@pytest.mark.parametrize("n", [1, 2, 9, 575, 576, 577, 1160])
def test_blocks_of_a_record_are_one_plain_recursion(n, n_inputs):
    """From less than a block to more than two, step by step as the discretisation says."""
    rng = np.random.default_rng(n)
    forces = rng.standard_normal((n, n_inputs))
    frequency, zeta = np.array([142.0, 7620.0]), np.array([0.04, 0.0])
    inputs, outputs = rng.standard_normal((2, n_inputs)), rng.standard_normal((2, 1))
    expected = np.zeros(n)
    for f, z, phi, out in zip(frequency, zeta, inputs, outputs[:, 0], strict=True):
        transition, gain = exact_oscillator(f, z, 1 / FS)
        w, felt = 2 * np.pi * f, forces @ phi
        state, before = np.array([felt[0] / w**2, 0.0]), felt[0]
        for i, now in enumerate(felt):
            state, before = transition @ state + gain @ [before, now], now
            expected[i] += out * (now - w**2 * state[0] - 2 * z * w * state[1])
    modes = CasingModes(frequency=frequency, damping_ratio=zeta, inputs=inputs, outputs=outputs)
    # rounding of stiffness * deflection, a thousand steps of it where nothing damps
    assert_allclose(housing_acceleration(forces, FS, modes)[0], expected, rtol=0, atol=1e-11)


def test_a_constant_force_makes_no_transient():
    quiet = one_mode(np.full(500, 3000.0))
    # Rounding of stiffness * deflection, that is of the force.
    assert_allclose(quiet, 0.0, atol=3000 * 1e-13)


def test_a_mode_above_the_band_adds_next_to_nothing():
    f = 500.0
    force = np.sin(2 * np.pi * f * np.arange(5120) / FS)
    response = one_mode(force, 40_000.0, 0.05)[2560:]  # whole periods
    in_phase = 2 * np.mean(response * force[2560:])
    # Quasi-static it would be (f / f0)^2 = 1.6e-4; images of the hold add (f / fs)^2 = 3.8e-4
    # times what the mode makes of them, a few.
    assert abs(in_phase) < 3e-3
    assert_allclose(in_phase, held_accelerance(f, 40_000.0, 0.05).real, atol=1e-6)


MODES = [142.0, 388.0, 815.0, 1370.0, 2240.0, 3450.0, 5180.0, 7620.0]  # of the bilge pump


def chain_accelerance(f, frequency, damping_ratio, factor):
    """What the whole chain makes of a sine force: means over steps, casing, decimation."""
    rate = factor * FS
    edges = np.arange(int(0.7 * rate) + 1) / rate
    means = -np.diff(np.cos(2 * np.pi * f * edges)) / (2 * np.pi * f) * rate
    unit = mode(frequency, damping_ratio)
    casing = ModalCasing(unit, rate, factor, len(means))
    casing.add(means[None])
    response = casing.finish()[0]
    time = (np.arange(len(response)) * factor + 0.5) / rate
    settled = (time > 0.4) & (time < 0.69)  # exp(-zeta w 0.4) = 5e-3 for the slowest mode
    wave = np.exp(2j * np.pi * f * time[settled])
    design = np.column_stack([wave.imag, wave.real])
    sine, cosine = np.linalg.lstsq(design, response[settled], rcond=None)[0]
    return sine + 1j * cosine


@pytest.mark.parametrize("factor", [2, 4])
def test_resonances_have_their_level_for_a_band_limited_force(factor):
    level = [
        20 * np.log10(abs(chain_accelerance(f, f, 0.015, factor) / accelerance(f, f, 0.015)))
        for f in MODES
    ]
    print(f"\nresonances through the chain [dB]: {np.round(level, 3)}")
    assert np.abs(level).max() < 0.02  # 0.01 dB of filter ripple, twice


def test_between_resonances_the_chain_is_the_accelerance_too():
    frequency, zeta, factor = 5180.0, 0.015, 2
    for f in (1000.0, 3000.0, 4000.0, 6700.0, 9000.0, 11000.0):
        error = chain_accelerance(f, frequency, zeta, factor) - accelerance(f, frequency, zeta)
        # Images of the hold move springs by their share, 1 / sinc^2 - 1, and the mode passes
        # them as (f0 / (rate - f))^2 only. The inverse of the hold is off by up to 0.4 % of what
        # the springs take back, the decimation by 0.3 % of all.
        images = (1 / np.sinc(f / (factor * FS)) ** 2 - 1) * (frequency / (factor * FS - f)) ** 2
        whole = accelerance(f, frequency, zeta)
        assert abs(error) < 1.5 * images + 4e-3 * abs(1 - whole) + 3e-3 * abs(whole)


def test_far_below_a_mode_masses_and_springs_cancel():
    """(f / f0)^2 = 1.7e-4 of either is left, at the lowest frequency a spectrum shows."""
    found = chain_accelerance(100.0, 7620.0, 0.015, 2)
    # Images of the hold are 5e-5 there: (1 / sinc^2 - 1) (f0 / rate)^2 = 3e-7.
    assert abs(found / accelerance(100.0, 7620.0, 0.015) - 1) < 5e-3


# --- decimation


def total_response(factor, frequency):
    """Of step mean and filter together, at frequencies over the final rate."""
    _, response = signal.freqz(decimation_filter(factor), worN=2 * np.pi * frequency / factor)
    return np.abs(response) * np.sinc(frequency / factor)


@pytest.mark.parametrize("factor", FACTORS)
def test_the_filter_is_that_of_scipy(factor):
    n = len(decimation_filter(factor))
    width = (1 - 2 * PASS_BAND) * 2 / factor
    fewest, beta = signal.kaiserord(80.0, width)
    assert fewest <= n <= fewest + 2 * factor + 1
    grid = np.linspace(0, 1 / factor, 129)
    end = [1 / factor, 1.0] if factor > 1 else []
    gain = np.append(1 / np.sinc(grid / 2), np.zeros(len(end)))
    expected = signal.firwin2(n, [*grid, *end], gain, nfreqs=2**15 + 1, window=("kaiser", beta))
    assert_allclose(decimation_filter(factor), expected, atol=1e-15)  # rounding


@pytest.mark.parametrize("factor", FACTORS)
def test_pass_band_is_flat_with_the_step_mean(factor):
    inside = np.linspace(1e-6, PASS_BAND, 2001)
    level = 20 * np.log10(total_response(factor, inside))
    assert abs(level).max() < 0.01  # dB, of the ripple of an 80 dB Kaiser design: 0.001


@pytest.mark.parametrize("factor", FACTORS[1:])
def test_stop_band(factor):
    # What folds back into the pass band; at factor 1 there is nothing above half the rate.
    outside = np.linspace(1 - PASS_BAND, factor / 2, 8001)
    assert 20 * np.log10(total_response(factor, outside).max()) <= -75


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("n_kept", [1, 100, 511, 512, 513, 3000, 17_000])
def test_blocks_of_a_record_are_one_plain_convolution(factor, n_kept):
    """From less than a block to many; with steps beyond the last sample."""
    rng = np.random.default_rng(n_kept)
    means = rng.normal(size=(n_kept * factor + factor // 2, 2))
    taps = decimation_filter(factor)
    half = len(taps) // 2
    expected = [np.convolve(column, taps)[half : half + n_kept * factor] for column in means.T]
    # sums of some 50 * factor products of about 1 / factor
    assert_allclose(decimate(means, factor), np.transpose(expected)[::factor], atol=1e-13)


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("offset", [0, 1, 2])
def test_an_impulse_keeps_its_time_and_its_momentum(factor, offset):
    n = 400 * factor
    hit = 200 * factor + offset
    means = np.zeros((n, 1))
    means[hit] = 4.0 * factor * FS  # one step of 1 / (factor FS) at this force: 4 N s
    kept = decimate(means, factor)[:, 0]
    assert len(kept) == 400
    frequency = np.fft.rfftfreq(400)
    inside = frequency <= PASS_BAND
    spectrum = np.fft.rfft(kept)[inside] / FS
    # Row k is the middle of step k * factor, and so is the impulse's own step.
    samples = hit / factor
    expected = 4.0 * np.exp(-2j * np.pi * frequency[inside] * samples)
    # The impulse is as short as a step, so the step mean's sinc is still to come: undo the
    # filter's compensation of it. Ripple: 0.01 dB = 1.2e-3 at factor 1,
    # else 0.002 dB = 2.5e-4; aliases are at most -80 dB = 1e-4 each.
    expected = expected / np.sinc(frequency[inside] / factor)
    assert_allclose(spectrum, expected, rtol=1.3e-3 if factor == 1 else 5e-4)
    # The area alone: only the aliases of zero frequency.
    assert_allclose(kept.sum() / FS, 4.0, rtol=3e-4 if factor > 1 else 1.2e-3)


def test_a_force_within_a_step_keeps_its_momentum_at_its_sample():
    factor = 4
    steps = np.arange(400 * factor)
    force = np.exp(-0.5 * ((steps - 803.0) / 6.0) ** 2)
    kept = decimate(force[:, None], factor)[:, 0]
    centroid = (kept * np.arange(400)).sum() / kept.sum()
    # A Gaussian of 1.5 samples is inside the pass band to exp(-(2 pi 0.45 1.5)^2 / 2) = 1e-4.
    assert_allclose(centroid * factor, 803.0, atol=2e-2)
    # ... and only its value at the kept step's middle is wanted, less the mean's own spread.
    assert_allclose(kept.sum() * factor, force.sum(), rtol=3e-4)


@pytest.mark.parametrize("factor", FACTORS)
def test_a_constant_is_kept_and_only_the_edges_are_spoilt(factor):
    kept = decimate(np.full((300 * factor, 2), 5.0), factor)
    edge = edge_samples(factor)
    assert kept.shape == (300, 2)
    # At most the ripple.
    assert_allclose(kept[edge : 300 - edge], 5.0, rtol=1.2e-3)
    assert abs(kept[0, 0] - 5.0) > 0.2  # the filter runs into zeros there


# --- where the forces act


@given(
    st.dictionaries(st.sampled_from(FORCE_PLACES), st.floats(-1, 1)),
    st.dictionaries(st.tuples(st.sampled_from(FORCE_PLACES), st.integers(1, 12)), st.floats(-1, 1)),
    st.sampled_from(FORCE_PLACES),
    st.integers(1, 12),
)
def test_the_shape_of_a_throw_wins_over_that_of_the_place(places, throws, place, throw):
    shape = places | {f"{where}_{k}": value for (where, k), value in throws.items()}
    found = casing_inputs(shape, place, throw)
    if (place, throw) in throws:
        assert found == throws[place, throw]
    else:
        assert found == places.get(place, 0.0)


@pytest.mark.parametrize("key", ["suction_valve", "discharge_valve_1", "bearing_y_1"])
def test_a_scene_takes_valves_and_single_throws(key):
    scene = load_scene("bilge-pump", {f"casing.modes.0.shape.{key}": 0.2})
    assert scene.casing.modes[0].shape[key] == 0.2


@pytest.mark.parametrize("key", ["bearing_y_0", "bearing_y_2", "bearing_y_01", "valve", "guide_z"])
def test_a_throw_or_place_that_the_pump_lacks_is_refused(key):
    with pytest.raises(SceneError, match=f"shape.{key} is no place of this scene; "):
        load_scene("bilge-pump", {f"casing.modes.0.shape.{key}": 0.2})
