"""Modal fits and comparisons: closed forms, noise counted, other libraries; and Hv."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.features.response import (
    frf,
    modal,
    modal_model,
    resonance,
    response_change,
    stable_poles,
)

QUANTITIES = tuple(modal_model.DERIVATIVES)


def one(f, f0, zeta, gain=1.0, derivative=0, decay=0.0):
    """``gain s^d / (s^2 + 2 zeta w0 s + w0^2)``: one mode of modal constant `gain`."""
    s, w0 = decay + 2j * np.pi * np.asarray(f), 2 * np.pi * f0
    return gain * s**derivative / (s**2 + 2 * zeta * w0 * s + w0**2)


def several(f, modes, derivative=0, decay=0.0):
    return sum(one(f, *mode, derivative=derivative, decay=decay) for mode in modes)


def noise(shape, seed):
    """Circular normal, of mean square one."""
    rng = np.random.default_rng(seed)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


def residue_of(f0, zeta, gain=1.0):
    return gain / (2j * 2 * np.pi * f0 * np.sqrt(1 - zeta**2))


# --- peaks


F = np.arange(0.0, 200.0, 0.5)


def test_resonances_of_all_channels_together():
    value = np.stack([several(F, [(40.2, 0.01, 1.0), (90.0, 0.01, 1.0)]), one(F, 150.0, 0.01)])
    # The first channel alone does not see the last mode, the second only that.
    assert F[resonance.find_resonances(F, value)].tolist() == [40.0, 90.0, 150.0]
    assert F[resonance.find_resonances(F, value[0])].tolist() == [40.0, 90.0]
    assert resonance.find_resonances(F, np.ones_like(F)).size == 0


def test_noise_makes_no_resonance():
    value = one(F, 90.0, 0.01, derivative=2)
    # Ten averages at a coherence of 0.9.
    value = value * (1 + np.sqrt((1 - 0.9) / 0.9 / 10) * noise((200, F.size), 0))
    counts = [resonance.find_resonances(F, row).size for row in value]
    # 0.65 dB a line: a rise and a fall of 6 dB is rare among 400 lines, and no peak is lost.
    assert min(counts) == 1
    assert np.mean(counts) < 1.05


# --- linear least squares in the complex frequency


HYSTERETIC = 2 * np.pi * 320
"""Lowest angular frequency of the published example [rad/s]."""


def hysteretic(f):
    """Three modes of structural damping 0.005 and a complex constant, as published with pyFRF."""
    w, gain = 2 * np.pi * f, 0.5 + 0.1j
    gains = gain, 0.5 * np.conj(gain), 0.25 * gain
    poles = [(k * HYSTERETIC) ** 2 for k in (1, 2, 3)]
    terms = (g / (p * (1 + 5e-3j) - w**2) for g, p in zip(gains, poles, strict=True))
    return sum(terms) + 1e-8 * (1 - 0.1j)


def nearest(poles, wanted):
    return np.array([poles[np.argmin(np.abs(poles - p))] for p in np.atleast_1d(wanted)])


def test_poles_come_nearer_with_every_order():
    f = np.arange(1400.0)
    # s^2 + w0^2 (1 + j eta) = 0
    truth = 1j * HYSTERETIC * np.arange(1, 4) * np.sqrt(1 + 5e-3j)
    orders = [4, 6, 8, 12, 24]
    errors = [
        np.max(np.abs(nearest(poles, truth) / truth - 1))
        for poles in stable_poles.complex_frequency_poles(f, hysteretic(f), orders)
    ]
    # The mirrored poles are not in a band of complex coefficients: high orders stand in for them,
    # at a rate set by their distance. 1e-3, 6e-5, 1e-6, … were seen.
    assert np.all(np.array(errors) < [1e-2, 5e-4, 1e-5, 1e-6, 5e-7])
    # Structural damping of eta reads as a damping ratio of eta / 2, to the square of it.
    [poles] = stable_poles.complex_frequency_poles(f, hysteretic(f), [24])
    found = nearest(poles, truth)
    assert_allclose(-found.real / np.abs(found), 2.5e-3, rtol=2e-4)


def test_excess_poles_grow():
    f = np.arange(100.0, 500.0)
    value = several(f, [(200.0, 0.01, 1.0), (300.0, 0.01, 1.0), (400.0, 0.01, 1.0)])
    value = value + 1e-4 * np.abs(value).max() * noise(f.size, 1)
    for poles in stable_poles.complex_frequency_poles(f, value, range(6, 31, 6)):
        decaying = poles[(poles.real < 0) & (poles.real > -0.1 * np.abs(poles))]
        # Three modes; with the other end of the polynomial at 1 nearly every pole would decay.
        assert len(decaying) == 3
        assert_allclose(np.abs(decaying) / (2 * np.pi), [200.0, 300.0, 400.0], rtol=1e-3)


def test_a_band_may_start_anywhere_and_a_window_is_undone():
    modes = [(1200.3, 0.004, 1.0), (1260.7, 0.006, -2.0)]
    f = np.arange(1000.0, 1500.0, 0.5)
    decay = 12.0
    for rate in (0.0, decay):
        value = several(f, modes, 2, rate)
        [poles] = stable_poles.complex_frequency_poles(f, value, [12], decay=rate)
        truth = modal_model.poles_of([m[0] for m in modes], [m[1] for m in modes])
        # What order 12 leaves of s^2 and the mirrored poles.
        assert_allclose(nearest(poles, truth), truth, rtol=1e-6)


def test_lines_without_weight_do_not_count():
    f = np.arange(100.0, 300.0)
    value = one(f, 200.0, 0.01)
    spoilt = value.copy()
    spoilt[80:95] += np.abs(value).max() * noise(15, 0)  # close below the resonance
    deviation = np.ones(f.size)
    deviation[80:95] = 1e6
    truth = modal_model.poles_of(200.0, 0.01)
    weighted, plain = (
        stable_poles.complex_frequency_poles(f, spoilt, [4], deviation=d)[0]
        for d in (deviation, None)
    )
    # What order 4 leaves of the mirrored pole, and a tenth of the damping.
    assert abs(nearest(weighted, truth)[0] / truth - 1) < 1e-4
    assert abs(nearest(plain, truth)[0] / truth - 1) > 1e-3


# --- following poles


def test_a_pole_keeps_its_chain_past_a_gap_and_a_neighbour():
    a, b = -2 + 300j, -2.05 + 301j
    diagram = stable_poles.stabilise([[a], [a, b], [b], [b, a]], [1, 2, 3, 4])
    assert diagram.order.tolist() == [1, 2, 2, 3, 4, 4]
    assert diagram.chain.tolist() == [0, 0, 1, 1, 1, 0]
    assert diagram.length.tolist() == [1, 2, 1, 2, 3, 3]
    # Half a half-power width apart, but in the same orders: two modes.
    assert diagram.modes(least=3)[0].size == 2


def test_growing_and_overdamped_poles_are_no_modes():
    diagram = stable_poles.stabilise([[1 + 50j, -40 + 50j, -1 + 50j]] * 5, range(1, 6))
    assert diagram.order.tolist() == [1, 2, 3, 4, 5]
    assert_allclose(diagram.modes()[1], 1 / np.hypot(1, 50))


def test_a_pole_whose_damping_jumps_is_one_mode():
    poles = [[-1 + 300j]] * 6 + [[-1.4 + 300j]] * 7
    diagram = stable_poles.stabilise(poles, range(1, 14))
    assert np.unique(diagram.chain).tolist() == [0, 1]
    # The longer chain stands for both.
    assert_allclose(diagram.modes()[1], [1.4 / np.hypot(1.4, 300)])


# --- the whole model


CHAIN = [(52.0, 0.01), (57.0, 0.02), (120.0, 0.005)]
"""Natural frequencies [Hz] and damping ratios; the first two overlap."""

CONSTANTS = np.array([[1.0, -0.5, 2.0], [0.3, 1.2, -1.0]])
"""Modal constants, (n_channels, n_modes) [1/kg]."""

BAND = np.arange(30.0, 160.0, 0.25)


def chain(f, derivative=2, decay=0.0, background=(-3.0, 2e-6 + 1e-6j)):
    s = decay + 2j * np.pi * f
    rest = (background[0] / s**2 + background[1]) * s**derivative
    return np.stack(
        [
            several(f, [(*m, g) for m, g in zip(CHAIN, row, strict=True)], derivative, decay) + rest
            for row in CONSTANTS
        ]
    )


@pytest.mark.parametrize("decay", [0.0, 15.0])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_fit_is_exact_in_all_its_parts(quantity, decay):
    value = chain(BAND, modal_model.DERIVATIVES[quantity], decay)
    found = modal.fit_modes(
        BAND, value, [50.0, 60.0, 119.0], [0.02] * 3, quantity=quantity, decay=decay
    )
    # The model itself without noise: where Levenberg and Marquardt stop, 1e-12 of a width.
    assert_allclose(found.frequency, [m[0] for m in CHAIN], rtol=1e-9)
    assert_allclose(found.damping_ratio, [m[1] for m in CHAIN], rtol=1e-7)
    assert_allclose(found.modal_constant, CONSTANTS, rtol=1e-7, atol=1e-7)
    assert_allclose(found.lower, [-3.0] * 2, rtol=1e-5)
    assert_allclose(found.upper, [2e-6 + 1e-6j] * 2, rtol=1e-5)
    assert np.all(found.fit_error < 1e-9)


def test_two_masses_on_springs():
    # m x1'' + 2 k x1 - k x2 = F, m x2'' - k x1 + 2 k x2 = 0 and damping in proportion to stiffness:
    # w1^2 = k/m, w2^2 = 3 k/m, shapes (1, 1) and (1, -1) over sqrt(2 m).
    m, k, loss = 2.0, 5e5, 4e-5
    w = np.sqrt(np.array([k / m, 3 * k / m]))
    f = np.arange(1.0, 250.0, 0.5)
    s = 2j * np.pi * f
    stiff = k * (1 + loss * s)
    inverse = 1 / ((m * s**2 + 2 * stiff) ** 2 - stiff**2)
    value = np.stack([(m * s**2 + 2 * stiff) * inverse, stiff * inverse])  # Cramer's rule
    found = modal.modal_fit(f, value, quantity="receptance")
    assert_allclose(found.frequency, w / (2 * np.pi), rtol=1e-9)  # the model, without noise
    assert_allclose(found.damping_ratio, loss * w / 2, rtol=1e-7)
    shapes = np.array([[1, 1], [1, -1]]) / (2 * m)
    assert_allclose(found.modal_constant, shapes, rtol=0, atol=1e-7 / (2 * m))


def test_the_line_at_rest_is_left_out():
    f = np.arange(0.0, 100.0, 0.5)
    found = modal.fit_modes(f, one(f, 40.0, 0.01), [41.0], [0.02], quantity="receptance")
    assert_allclose(found.frequency, 40.0, rtol=1e-9)


def scores(deviation=None, size=1e-2, trials=200):
    """Errors of 200 noisy fits over the deviations they state."""
    clean = chain(BAND)
    scatter = (
        size * np.abs(clean).max() * (np.ones(clean.shape) if deviation is None else deviation)
    )
    truth = np.concatenate([[m[0] for m in CHAIN], [m[1] for m in CHAIN]])
    rows, residues = [], []
    for seed in range(trials):
        value = clean + scatter * noise(clean.shape, seed)
        found = modal.fit_modes(
            BAND,
            value,
            [52.3, 57.5, 120.0],
            [0.01] * 3,
            deviation=None if deviation is None else scatter,
        )
        stated = np.concatenate([found.frequency_deviation, found.damping_deviation])
        rows.append((np.concatenate([found.frequency, found.damping_ratio]) - truth) / stated)
        wanted = CONSTANTS / (2j * found.pole.imag)
        residues.append(np.abs(found.residue - wanted) / found.residue_deviation)
    return np.array(rows), np.array(residues)


@pytest.mark.parametrize("uneven", [False, True])
def test_the_deviations_are_the_scatter(uneven):
    ramp = np.linspace(0.1, 2.0, BAND.size) * np.array([[1.0], [0.3]])
    errors, residues = scores(ramp if uneven else None)
    # 200 trials: a mean scatters by 0.07 and a deviation by 5 %; four of them (six parameters).
    assert_allclose(np.mean(errors, axis=0), 0.0, atol=0.28)
    assert_allclose(np.std(errors, axis=0), 1.0, atol=0.2)
    # Two parts: the mean square of the modulus over its deviation is 1, to 7 % or less.
    assert_allclose(np.mean(residues**2, axis=0), 1.0, atol=0.28)


def test_weights_are_worth_having():
    ramp = np.where(BAND < 100, 20.0, 1.0) * np.ones((2, 1))
    clean = chain(BAND)
    scatter = 1e-3 * np.abs(clean).max() * ramp
    errors = {True: [], False: []}
    for seed in range(40):
        value = clean + scatter * noise(clean.shape, seed)
        for weighted, found in errors.items():
            modes = modal.fit_modes(
                BAND, value, [52, 57, 120], [0.01] * 3, deviation=scatter if weighted else None
            )
            found.append(modes.damping_ratio[2] - CHAIN[2][1])
    # The last mode stands in the quiet part, but shares its background with the noisy one.
    assert np.std(errors[True]) < 0.9 * np.std(errors[False])


def test_the_linear_fit_is_biased_and_the_full_one_is_not():
    f = np.arange(150.0, 250.0, 0.5)
    clean = one(f, 200.0, 0.01)
    truth = modal_model.poles_of(200.0, 0.01)
    linear, full = [], []
    for seed in range(100):
        value = clean + 0.1 * np.abs(clean).max() * noise(f.size, seed)
        linear.append(
            nearest(stable_poles.complex_frequency_poles(f, value, [4])[0], truth)[0].real
        )
        modes = modal.fit_modes(f, value, [200.0], [0.01], quantity="receptance")
        full.append(modes.pole[0].real)
    scatter = np.std(full) / np.sqrt(100)
    assert abs(np.mean(full) - truth.real) < 4 * scatter
    assert abs(np.mean(linear) - truth.real) > 10 * scatter


# --- found without being told


def test_modes_are_found_in_noise():
    clean = chain(BAND)
    for seed in range(20):
        value = clean + 1e-2 * np.abs(clean).max() * noise(clean.shape, seed)
        found = modal.modal_fit(BAND, value)
        assert found.frequency.size == 3
        # Five of the deviations the test above has found right.
        wanted = [m[0] for m in CHAIN]
        assert np.all(np.abs(found.frequency - wanted) < 5 * found.frequency_deviation)


@pytest.mark.parametrize(("apart", "level"), [(0.5, 0.0), (0.5, 1e-3), (1.0, 1e-2)])
def test_close_modes_are_told_apart(apart, level):
    zeta, f0 = 0.01, 100.0
    f1 = f0 * (1 + 2 * zeta * apart)  # in half-power widths
    f = np.arange(80.0, 120.0, 0.1)
    clean = several(f, [(f0, zeta, 1.0), (f1, zeta, 1.0)])
    value = clean + level * np.abs(clean).max() * noise(f.size, 3)
    if apart < 1:
        assert resonance.find_resonances(f, clean).size == 1  # one peak to the eye
    found = modal.modal_fit(f, value, quantity="receptance")
    assert found.frequency.size == 2
    assert_allclose(found.frequency, [f0, f1], rtol=1e-9 + 0.5 * zeta * (level > 0))
    assert_allclose(found.damping_ratio, zeta, rtol=1e-7 + 0.3 * (level > 0))


def test_structural_damping_as_published():
    f = np.arange(1400.0)
    poles = 1j * HYSTERETIC * np.arange(1, 4) * np.sqrt(1 + 5e-3j)
    gains = np.array([0.5 + 0.1j, 0.25 - 0.05j, 0.125 + 0.025j])

    def errors(found, at):
        truth = poles[at]  # of size w0 (1 + eta^2)^(1/4), damping ratio eta / 2
        return [
            np.abs(found.frequency * 2 * np.pi / np.abs(truth) - 1),
            np.abs(found.damping_ratio / 2.5e-3 - 1),
            np.abs(found.residue[0] / (gains[at] / (2 * truth)) - 1),
        ]

    whole = errors(modal.modal_fit(f, hysteretic(f), quantity="receptance"), np.arange(3))
    # The gains of the mirrored poles are not conjugate here: a fifth of their part in the
    # background (zeta / 2 of the peak, more beside the stronger modes) is not in the model.
    assert [np.max(x) < y for x, y in zip(whole, [2e-5, 2e-2, 2e-2], strict=True)] == [True] * 3
    for at in range(3):
        band = 320.0 * (at + 1) - 30, 320.0 * (at + 1) + 30
        found = modal.modal_fit(f, hysteretic(f), quantity="receptance", band=band)
        # The narrower the band the better does L / s^2 + U stand for that part: 1/10 of the
        # distance to the neighbours, cubed.
        near = errors(found, np.array([at]))
        assert [np.max(x) < y for x, y in zip(near, [4e-7, 5e-5, 2e-4], strict=True)] == [True] * 3


def test_the_highest_of_a_band():
    value = chain(BAND)
    assert_allclose(modal.modal_fit(BAND, value, band=(100.0, 140.0)).frequency, [120.0], rtol=1e-5)
    highest = modal.modal_fit(BAND, value, n_modes=1)
    assert_allclose(highest.frequency, [120.0], rtol=1e-3)  # the others are in its background now


def test_a_window_of_the_measurement_is_undone():
    fs, n = 1024.0, 2048
    f = np.arange(n // 2 + 1) * fs / n
    modes = [(100.0, 0.004, 1.0), (230.0, 0.003, -1.0)]
    force = np.zeros((2, n))
    force[:, 3:6] = [[1.0, 2.0, 1.0], [2.0, 4.0, 2.0]]
    decay = frf.window_decay(n / fs, last=0.01)
    impulse = np.zeros(4 * n)  # rung out: exp(-2 pi 0.4 * 8)
    time = np.arange(4 * n) / fs
    for f0, zeta, gain in modes:
        w0 = 2 * np.pi * f0
        wd = w0 * np.sqrt(1 - zeta**2)
        impulse += gain / wd * np.exp(-zeta * w0 * time) * np.sin(wd * time) / fs
    response = np.stack([np.convolve(row, impulse)[:n] for row in force])
    spectra = frf.block_spectra(force, response, fs, decay=decay).between(60.0, 300.0)
    for rate, tolerance in ((decay, 2e-4), (0.0, np.inf)):
        found = modal.modal_fit(
            spectra.frequency, frf.h1(spectra), quantity="receptance", decay=rate
        )
        assert_allclose(found.frequency, [100.0, 230.0], rtol=1e-4)
        wrong = np.abs(found.damping_ratio / [0.004, 0.003] - 1)
        # The sampled impulse response wraps at half the sample rate (a smooth part, background)
        # and the window's end cuts 1 % of exp(-2 pi 0.4 * 2): some 1e-4 of the response.
        assert np.all(wrong < tolerance)
    assert np.all(wrong > 0.5)  # what the window adds is not small
    assert spectra.frequency[0] == f[120]


def test_a_mode_that_the_data_do_not_hold_is_dropped(monkeypatch):
    clean = chain(BAND)
    value = clean + 1e-2 * np.abs(clean).max() * noise(clean.shape, 0)
    follow = stable_poles.stabilise
    false = [modal_model.poles_of(140.0, 0.01)]
    monkeypatch.setattr(
        modal, "stabilise", lambda poles, orders: follow([[*p, *false] for p in poles], orders)
    )
    found = modal.modal_fit(BAND, value)
    assert_allclose(found.frequency, [m[0] for m in CHAIN], rtol=1e-2)


def run_away(*_, **__):
    raise FloatingPointError


class Stopped:
    """Result of a search that has used up its steps."""

    status = 0
    x = np.zeros(2)


@pytest.mark.parametrize("search", [run_away, lambda *_, **__: Stopped()])
def test_a_fit_that_does_not_settle_says_so(monkeypatch, search):
    monkeypatch.setattr(modal, "least_squares", search)
    with pytest.raises(ValueError, match="fit of 1 modes must converge"):
        modal.fit_modes(F, NARROW, [90.0], [0.01])


# --- against a reference


def test_levels_of_bands():
    f0, zeta = 100.0, 0.02
    f = np.arange(0.0, 4000.0, 0.1)
    [[level]] = response_change.band_response_levels(f, one(f, f0, zeta), [0.0, 4000.0])
    w0 = 2 * np.pi * f0
    # The integral of |H|^2 over all w > 0 is pi / (4 zeta w0^3); beyond 4 kHz lie (w0/w)^3 4 zeta
    # / (3 pi) of it, 1e-7; the sum over lines of 1/40 of the width is exact to exp(-2 pi 20), but
    # the line at 0 Hz counts whole: half of it is too much.
    mean = np.pi / (4 * zeta * w0**3) / (2 * np.pi * 4000) + 0.5 / w0**4 / 40_000
    assert_allclose(level, 10 * np.log10(mean), atol=2e-6)


def test_levels_scale_and_split():
    value = chain(BAND)
    edges = [30.0, 60.0, 100.0, 150.0]
    levels = response_change.band_response_levels(BAND, value, edges)
    assert levels.shape == (2, 3)
    assert_allclose(response_change.band_response_levels(BAND, 10 * value, edges) - levels, 20.0)
    kept = (BAND >= 60) & (BAND < 100)
    wanted = 10 * np.log10(np.mean(np.abs(value[:, kept]) ** 2, axis=-1))
    assert_allclose(levels[:, 1], wanted)


@pytest.mark.parametrize("widths", [0.25, 1.0, 3.0])
def test_assurance_of_two_resonances_apart(widths):
    width = 1.0
    f = np.arange(-3000.0, 3000.0, 0.05)
    one_, other = (1 / (width / 2 + 1j * (f - at)) for at in (0.0, widths * width))
    # Two Lorentzians: 1 / (1 + (d / b)^2) over all frequencies; beyond 3000 widths lie 1e-4.
    [found] = response_change.frequency_response_assurance(one_, other)
    assert_allclose(found, 1 / (1 + widths**2), atol=3e-4)


def test_assurance_is_blind_to_level_and_phase_only():
    value = chain(BAND)
    other = value * np.array([[3j], [-0.1]])
    assert_allclose(response_change.frequency_response_assurance(other, value), 1.0)
    assert_allclose(
        response_change.frequency_response_assurance(value[::-1], value[::-1] ** 2)[::-1],
        response_change.frequency_response_assurance(value, value**2),
    )
    assert response_change.frequency_response_assurance(value[0], value[1])[0] < 0.9


def set_of(frequencies, shapes, ratio=0.01, scatter=0.0):
    """Modes of given shapes, (n_channels, n_modes)."""
    f = np.asarray(frequencies, dtype=float)
    residue = np.asarray(shapes, dtype=complex)
    return modal_model.Modes(
        frequency=f,
        damping_ratio=np.full(f.shape, ratio),
        residue=residue,
        lower=np.zeros(len(residue), dtype=complex),
        upper=np.zeros(len(residue), dtype=complex),
        quantity="receptance",
        frequency_deviation=np.full(f.shape, scatter),
        damping_deviation=np.zeros(f.shape),
        residue_deviation=np.zeros(residue.shape),
        fit_error=np.zeros(len(residue)),
    )


def test_a_softer_spring_lowers_a_resonance():
    before, after = (
        modal.fit_modes(BAND, k * chain(BAND), [50, 60, 119], [0.02] * 3) for k in (1.0, 0.5)
    )
    still = response_change.resonance_shift(after, before)
    assert still.pairs.tolist() == [[0, 0], [1, 1], [2, 2]]
    assert_allclose(still.frequency, 0.0, atol=1e-9)
    assert_allclose(still.level, -20 * np.log10(2), atol=1e-6)
    softer = one(BAND, 52.0 * np.sqrt(0.98), 0.02)
    moved = response_change.resonance_shift(
        modal.modal_fit(BAND, softer, quantity="receptance"),
        modal.modal_fit(BAND, one(BAND, 52.0, 0.01), quantity="receptance"),
    )
    # Two per cent of stiffness; twice the damping, half the height but for the frequency.
    assert_allclose(moved.frequency, np.sqrt(0.98) - 1, rtol=1e-6)
    assert_allclose(moved.damping_ratio, 2.0, rtol=1e-6)
    height = 20 * np.log10(0.5 / 0.98 * np.sqrt((1 - 1e-4) / (1 - 4e-4)))
    assert_allclose(moved.level, height, atol=1e-5)


def test_modes_that_changed_places_are_told_by_shape():
    shapes = np.array([[1.0, 1.0], [1.0, -1.0]])
    before = set_of([100.0, 103.0], shapes, scatter=0.3)
    after = set_of([101.0, 102.0], shapes[:, ::-1], scatter=0.4)
    shift = response_change.resonance_shift(after, before)
    assert shift.pairs.tolist() == [[0, 1], [1, 0]]
    assert_allclose(shift.frequency, [0.02, 101 / 103 - 1])
    deviation = 1.02 * np.hypot(0.4 / 102, 0.3 / 100)
    assert_allclose(shift.frequency_deviation[0], deviation)
    # One channel cannot tell, and takes the nearest.
    single = response_change.resonance_shift(
        set_of([101.0, 102.0], [[1, 1]]), set_of([100.0, 103.0], [[1, 1]])
    )
    assert single.pairs.tolist() == [[0, 0], [1, 1]]


def test_lost_and_new_modes_are_named():
    before = set_of([50.0, 100.0, 200.0], [[1, 1, 1]])
    after = set_of([104.0, 150.0, 201.0], [[1, 1, 1]])
    shift = response_change.resonance_shift(after, before)
    assert (shift.pairs.tolist(), shift.lost, shift.new) == ([[1, 0], [2, 2]], (0,), (1,))
    assert response_change.resonance_shift(after, before, within=0.03).lost == (0, 1)


# --- refusals


NARROW = one(F, 90.0, 0.01)
DATA = np.stack([NARROW, NARROW])
BAD = np.where(F == 50, np.nan, NARROW)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: resonance.find_resonances(F, NARROW[1:]), r"\(399,\), must be \(n_lines,\)"),
        (lambda: resonance.find_resonances(F, BAD), "value has 1 non-finite lines"),
        (
            lambda: resonance.find_resonances(F, [NARROW, 0 * F]),
            r"0 in channels \[1\], must at",
        ),
        (lambda: modal.modal_fit(F, 1e99 * NARROW), "leave out dead channels, use SI units"),
        (lambda: modal.fit_modes(F, F == 0, [9.0], [0.1]), "0 on every line above 0 Hz"),
        (
            lambda: resonance.find_resonances(F, NARROW, prominence=0),
            "prominence = 0 dB must be > 0",
        ),
        (
            lambda: modal.modal_fit([3.0, 1.0, -2.0], [np.inf, 1.0, 2.0]),
            "n_lines = 3 must be >= 5.*increasing; sort the lines; value has 1 non-finite",
        ),
        (lambda: modal.modal_fit(F, NARROW, quantity="inertance"), "one of receptance, mobility"),
        (
            lambda: stable_poles.complex_frequency_poles(F, NARROW, [0, 3, 200]),
            r"orders \[0, 200\]",
        ),
        (lambda: stable_poles.complex_frequency_poles(F, NARROW, []), r"orders \[\] must be"),
        (
            lambda: stable_poles.complex_frequency_poles(F, NARROW, [3], deviation=F),
            "deviation must be > 0 and finite",
        ),
        (
            lambda: stable_poles.complex_frequency_poles(F, NARROW, [3], deviation=[1.0, 2.0]),
            r"deviation has shape \(2,\)",
        ),
        (
            lambda: stable_poles.stabilise([], [], damping_tolerance=0),
            "damping_tolerance = 0 must be > 0",
        ),
        (lambda: modal.fit_modes(F, NARROW, [90.0], [0.01, 0.02]), "give a pair for each mode"),
        (
            lambda: modal.fit_modes(F, NARROW, [-90.0], [0.0]),
            "start_frequency must be.*start_damping must lie between -1 and 1",
        ),
        (lambda: modal.fit_modes(F[:9], NARROW[:9], [1, 2, 3, 4], [0.1] * 4), "degrees of freedom"),
        (lambda: modal.modal_fit(F, NARROW, band=(90.0, 91.0)), "holds 3 lines, must hold >= 5"),
        (
            lambda: modal.modal_fit(F[60:179], NARROW[60:179], quantity="receptance"),
            "mode at 90 Hz must lie in the band|no pole",
        ),
        (lambda: modal.fit_modes(F, NARROW, [90.0] * 2, [0.01] * 2), "starts must differ"),
        (lambda: modal._inverse(np.ones((4, 2))), "n_modes = 1 is more than the data can resolve"),
        (lambda: modal.modal_fit(F, NARROW, n_modes=0), "n_modes = 0 must be >= 1; leave it out"),
        (lambda: modal.modal_fit(F, NARROW.conj()), "at 90.* Hz must decay, but grow"),
        (lambda: modal.modal_fit(F, noise(F.size, 0)), "no pole stays stable|must"),
        (
            lambda: response_change.band_response_levels(F, NARROW, [1.0, 1.0]),
            "must be two or more",
        ),
        (
            lambda: response_change.band_response_levels(F, NARROW, [1.1, 1.2, 8.0, 900.0, 950.0]),
            "bands 1.1 … 1.2 Hz, 900 … 950 Hz must each hold a line",
        ),
        (
            lambda: response_change.frequency_response_assurance(NARROW, DATA),
            "bring both to the same lines",
        ),
        (
            lambda: response_change.frequency_response_assurance([], []),
            "bring both to the same lines",
        ),
        (
            lambda: response_change.frequency_response_assurance(NARROW, 0 * F),
            "leave out dead channels",
        ),
        (
            lambda: response_change.resonance_shift(
                set_of([1.0], [[1]]), set_of([1.0], [[1], [1]])
            ),
            "n_channels = 1 must equal that of the reference, 2",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


# --- Hv


FS = 1024.0


def both_noisy(seed, noise_in, noise_out, n=200_000):
    """White force through a gain of 2; powers of the noises on force and response."""
    force, *rest = np.random.default_rng(seed).standard_normal((3, n))
    return force + np.sqrt(noise_in) * rest[0], 2 * force + np.sqrt(noise_out) * rest[1]


def test_hv_is_unbiased_at_the_right_ratio_of_noises():
    spectra = frf.welch_spectra(*both_noisy(0, 0.3, 0.6), FS, nperseg=256)
    inside = slice(1, -1)
    means = {
        "h1": np.mean(frf.h1(spectra)[0, inside]),
        "hv": np.mean(frf.hv(spectra, noise_ratio=2.0)[0, inside]),
        "h2": np.mean(frf.h2(spectra)[0, inside]),
    }
    # 1500 blocks x 127 lines: each mean scatters by 0.2 %; four of them, and some 0.1 % of bias
    # that 1500 averages leave in a ratio.
    assert_allclose(means["hv"], 2.0, rtol=0.01)
    assert_allclose(means["h1"], 2 / 1.3, rtol=0.01)
    assert_allclose(means["h2"], 2 * (1 + 0.6 / 4), rtol=0.01)


@settings(max_examples=30, deadline=None)
@given(ratio=st.floats(1e-6, 1e6), seed=st.integers(0, 20))
def test_hv_lies_between_h1_and_h2(ratio, seed):
    spectra = frf.welch_spectra(*both_noisy(seed, 0.5, 1.0, n=4096), FS, nperseg=128)
    low, high = np.abs(frf.h1(spectra)), np.abs(frf.h2(spectra))
    for value in (frf.hv(spectra), frf.hv(spectra, noise_ratio=ratio)):
        assert np.all(low * (1 - 1e-12) <= np.abs(value))  # rounding
        assert np.all(np.abs(value) <= high * (1 + 1e-12))
        assert_allclose(np.angle(value * frf.h1(spectra).conj()), 0.0, atol=1e-12)


def test_limits_and_mean_of_hv():
    spectra = frf.welch_spectra(*both_noisy(1, 0.5, 1.0, n=8192), FS, nperseg=128)
    first, second = frf.h1(spectra), frf.h2(spectra)
    # First order in the small ratio.
    assert_allclose(frf.hv(spectra, noise_ratio=1e12), first, rtol=1e-9)
    assert_allclose(frf.hv(spectra, noise_ratio=1e-12), second, rtol=1e-9)
    assert_allclose(np.abs(frf.hv(spectra)) ** 2, np.abs(first) * np.abs(second), rtol=1e-12)
    powers = spectra.response / spectra.force
    assert_allclose(frf.hv(spectra, noise_ratio=powers), frf.hv(spectra), rtol=1e-9)


def test_hv_keeps_its_meaning_in_other_units():
    force, response = both_noisy(2, 0.5, 1.0, n=8192)
    values = [
        frf.hv(frf.welch_spectra(force, unit * response, FS, nperseg=128)) / unit
        for unit in (1.0, 1e6)
    ]
    assert_allclose(values[1], values[0], rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.0, -1.0, np.inf, [1.0, 2.0]])
def test_hv_refuses_a_ratio_it_cannot_use(ratio):
    spectra = frf.welch_spectra(*both_noisy(3, 0.1, 0.1, n=4096), FS, nperseg=128)
    with pytest.raises(ValueError, match=r"noise_ratio .* must be > 0 and finite"):
        frf.hv(spectra, noise_ratio=ratio)


# --- other libraries


@pytest.mark.filterwarnings("ignore")  # of the other library
def test_pyfrf_gives_the_same_hv():
    pyfrf = pytest.importorskip("pyFRF")
    force, response = (x.reshape(8, -1) for x in both_noisy(4, 0.2, 0.5, n=8192))
    theirs = pyfrf.FRF(
        sampling_freq=int(FS),
        exc=force[:, np.newaxis],
        resp=response[:, np.newaxis],
        exc_type="f",
        resp_type="d",  # then it converts nothing
        window="none",
        fft_len=force.shape[-1],
    )
    # The library takes the mean of each block out, and its ratio is 1 in whatever unit.
    blocks = [x - x.mean(axis=-1, keepdims=True) for x in (force, response)]
    spectra = frf.block_spectra(*blocks, FS).between(2.0, 500.0)
    ours = frf.hv(spectra, noise_ratio=1.0)[0]
    assert_allclose(ours, theirs.get_Hv()[0, 0, 2:501], rtol=1e-9)  # the same formula


@pytest.mark.filterwarnings("ignore")  # of the other library
def test_sdypy_finds_the_same_poles():
    ema = pytest.importorskip("sdypy.EMA")
    f = np.arange(0.0, 160.0, 0.25)
    value = chain(f[1:], 0, background=(0.0, 0.0))
    value = np.concatenate([chain(np.array([1e-3]), 0, background=(0.0, 0.0)), value], axis=1)
    model = ema.Model(value, f, lower=20, upper=155, pol_order_high=20, frf_form="receptance")
    model.get_poles(show_progress=False)
    theirs = np.asarray(model.all_poles[-1])
    ours = modal.modal_fit(f, value, quantity="receptance", band=(20.0, 155.0))
    # Theirs is the linear fit of order 40 with real coefficients, which leaves some 1e-4.
    assert_allclose(np.abs(nearest(theirs, ours.pole)), np.abs(ours.pole), rtol=1e-3)
