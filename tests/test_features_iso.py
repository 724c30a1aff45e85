"""Velocity and displacement against integrated sines, and the zones against the boundaries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features.signal import iso

FS = 5120.0


def tone(frequency, amplitude=1.0, phase=0.3, duration=2.0, fs=FS):
    return amplitude * np.cos(2 * np.pi * frequency * np.arange(round(duration * fs)) / fs + phase)


# --- rms


@pytest.mark.parametrize("integrations", [0, 1, 2])
@settings(max_examples=30, deadline=None)
@given(frequency=st.floats(11.0, 990.0), phase=st.floats(0, 2 * np.pi))
def test_rms_of_a_tone_within_the_band(integrations, frequency, phase):
    x = tone(frequency, 3.0, phase)
    found = iso.band_rms(x, FS, iso.ISO_BAND, integrations=integrations)
    expected = 3 / np.sqrt(2) / (2 * np.pi * frequency) ** integrations
    # Lines of 0.5 Hz, so a tone from 22 lines on: 6e-5 of the method, of its docstring. Two lines
    # from the edge of 10 Hz, 0.0135 / 1.5^5 of the power leaks out: 9e-4 of rms. Half of the mean
    # taken off a fraction of a cycle, 1 / (40 pi)^2, comes as much.
    assert_allclose(found, expected, rtol=1e-3)


def test_two_integrations_are_one_and_one():
    x = tone(100) + tone(300)
    displacement = np.hypot((2 * np.pi * 100.0) ** -2, (2 * np.pi * 300.0) ** -2) / np.sqrt(2)
    # 200 lines up: the method's 6e-5 falls with the third power or more, to 6e-8.
    assert_allclose(iso.band_rms(x, FS, (10, 1000), integrations=2), displacement, rtol=1e-6)
    velocity = np.hypot(1 / (2 * np.pi * 100.0), 1 / (2 * np.pi * 300.0)) / np.sqrt(2)
    assert_allclose(iso.velocity_rms(x, FS), velocity, rtol=1e-6)


@pytest.mark.parametrize(("lines", "bound"), [(5, 1e-3), (10, 3e-4), (20, 6e-5)])
@pytest.mark.parametrize("integrations", [1, 2])
def test_integration_bound_of_the_docstring(lines, bound, integrations):
    # One segment of n samples; the band is wide open, so only the division is at fault. The mean
    # square over all starts, for the mirror image to average out.
    n, band = 1024, (5.0, 400.0)
    errors = []
    for off in np.linspace(0, 0.5, 6):
        squares = []
        for phase in np.arange(8) * np.pi / 8:
            x = np.cos(2 * np.pi * (lines + off) * np.arange(n) / n + phase)
            k = np.arange(n // 2 + 1)
            window = np.sin(np.pi * np.arange(n) / n) ** 2
            power = np.abs(np.fft.rfft(x * window)) ** 2
            weight = iso._divisors(n, float(n), integrations) / iso._divisors(n, float(n), 0)
            share = power[k >= 1] / power.sum()
            squares.append(share @ weight[1:])
        expected = (2 * np.pi * (lines + off)) ** (-2 * integrations)
        errors.append(np.sqrt(np.mean(squares) / expected) - 1)
    assert band[0] == iso.FEWEST_LINES_BELOW
    assert np.abs(errors).max() < bound


def test_leakage_from_below_the_band():
    # Slow rocking of 1 m/s^2 far under the band, ten lines below its edge, between two lines: the
    # share of the docstring, here of a whole segment of 2 s.
    x = tone(4.75, duration=2.0)
    bound = np.sqrt(0.0135 / 10**5) / np.sqrt(2) / (2 * np.pi * 10)
    found = iso.velocity_rms(x, FS)
    assert found < bound
    assert found > 0.05 * bound  # and not by much less


def test_edges_take_half_of_a_tone_on_them():
    x = tone(10.0, duration=4.0)
    # Half the power, as an instrument of ISO 2954 does; the line above weighs less than that
    # below, 1 % by 1 / 20 lines.
    assert_allclose(
        iso.velocity_rms(x, FS), np.sqrt(0.5) / np.sqrt(2) / (2 * np.pi * 10), rtol=0.02
    )


def test_noise_has_the_velocity_of_its_density():
    x = np.random.default_rng(0).standard_normal((4, 200 * int(FS)))
    density = 1 / (FS / 2)
    expected = np.sqrt(density / (4 * np.pi**2) * (1 / 10 - 1 / 1000))
    # Most comes from 10 to 20 Hz: 10 Hz times 200 s make 2000 averages, 1.1 % of rms; three.
    assert_allclose(iso.velocity_rms(x, FS), expected, rtol=0.035)


def test_short_and_slow_records():
    # 0.5 s hold five lines under 10 Hz: the method's 1e-3, and the mirror image's 0.02 / 15^3.
    x = tone(30, duration=0.5)
    assert_allclose(iso.velocity_rms(x, FS), 1 / np.sqrt(2) / (2 * np.pi * 30), rtol=1e-3)
    x = tone(4.0, duration=10.0)
    # 20 lines: 6e-5; the edge of 2 Hz is 20 lines away.
    assert_allclose(
        iso.velocity_rms(x, FS, band=iso.SLOW_ISO_BAND), 1 / np.sqrt(2) / (8 * np.pi), rtol=1e-4
    )


# --- properties


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gain=st.floats(1e-6, 1e6),
    sign=st.sampled_from([-1, 1]),
    offset=st.floats(-100, 100),
)
def test_gain_sign_offset_and_order_of_channels(seed, gain, sign, offset):
    x = np.random.default_rng(seed).standard_normal((3, 5120))
    y = sign * gain * (x + offset)[::-1]
    # An offset of 100 rounds at 1e-14, amplified at 10 Hz against the noise there by less than 1e4.
    assert_allclose(iso.velocity_rms(y, FS), gain * iso.velocity_rms(x, FS)[::-1], rtol=1e-9)


@pytest.mark.parametrize("shift", [1, 100, 3333])
def test_start_of_a_steady_tone_does_not_matter(shift):
    x = tone(50.3, duration=3.0)
    first, later = x[:10_240], x[shift : shift + 10_240]
    # Mirror image at 100 lines: 0.02 / 100^3.
    assert_allclose(iso.velocity_rms(first, FS), iso.velocity_rms(later, FS), rtol=1e-6)


def test_float32_is_kept_and_close():
    x = tone(25.0, 5.0) + np.random.default_rng(1).standard_normal(10_240) + 9.81
    single = iso.velocity_rms(x.astype(np.float32), FS)
    assert single.dtype == np.float32
    # 24 bits, amplified at the lower edge by (25 / 10)^2.
    assert_allclose(single, iso.velocity_rms(x, FS), rtol=2e-5)


@pytest.mark.parametrize("x", [np.zeros(5120), np.full(5120, 9.81)])
def test_a_constant_does_not_move(x):
    assert iso.velocity_rms(x, FS) == 0


def test_nan_comes_through():
    x = np.stack([tone(50), tone(50)])
    x[0, 77] = np.nan
    value = iso.velocity_rms(x, FS)
    assert np.isnan(value[0])
    assert np.isfinite(value[1])


# --- zones


@pytest.mark.parametrize(
    ("kind", "boundaries"),
    [
        ("industrial-1-rigid", (2.3, 4.5, 7.1)),
        ("industrial-1-flexible", (3.5, 7.1, 11.0)),
        ("industrial-2-rigid", (1.4, 2.8, 4.5)),
        ("industrial-2-flexible", (2.3, 4.5, 7.1)),
        ("pump-1-small", (2.5, 4.0, 6.6)),
        ("pump-1-large", (3.5, 5.0, 7.6)),
        ("pump-2-small", (3.2, 5.1, 8.5)),
        ("pump-2-large", (4.2, 6.1, 9.5)),
        ("reciprocating-1", (4.46, 7.07, 11.2)),
        ("reciprocating-5", (28.2, 44.6, 70.7)),
        ("compressor-frame", (5.3, 8.0, 12.0)),
        ("compressor-cylinder-lateral", (8.7, 13.0, 19.5)),
    ],
)
def test_zone_boundaries(kind, boundaries):
    inside = np.array(boundaries) * 1e-3  # a value on a boundary is in the better zone
    assert_array_equal(iso.zone(inside, kind), [0, 1, 2])
    assert_array_equal(iso.zone(inside * 1.0001, kind), [1, 2, 3])
    assert iso.zone(0.0, kind) == 0


@pytest.mark.parametrize("name", iso.KINDS)
def test_every_kind_is_in_order_and_says_where_it_is_from(name):
    kind = iso.KINDS[name]
    for boundaries in (kind.velocity_mm_s, kind.displacement_um):
        assert boundaries is None or 0 < boundaries[0] < boundaries[1] < boundaries[2]
    assert kind.standard.startswith("ISO ")
    assert 0.5 < kind.confidence < 1
    assert kind.reciprocating == ("20816-8" in kind.standard or "10816-6" in kind.standard)


def test_the_worse_of_velocity_and_displacement_counts():
    zones = iso.zone([1e-3, 1e-3, 5e-3], "industrial-1-rigid", displacement=[1e-6, 60e-6, 1e-6])
    assert_array_equal(zones, [0, 2, 2])


@pytest.mark.parametrize(
    ("kind", "speed", "low"),
    [
        ("industrial-1-rigid", 10.0, 10.0),
        ("industrial-1-rigid", 9.99, 2.0),
        ("pump-1-small", 50.0, 10.0),
        ("reciprocating-2", None, 2.0),
        ("compressor-frame", 25.0, 2.0),
    ],
)
def test_band_of_a_kind(kind, speed, low):
    assert iso.iso_band(kind, speed) == (low, 1000.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: iso.velocity_rms(np.ones(5120), 1000.0),
            r"high = 1000.0 Hz must be <= fs / 2 = 500.0 Hz",
        ),
        (
            lambda: iso.velocity_rms(np.ones(99), FS),
            r"duration = 0.0193359 s must be >= 0.5 s, 5 periods of low = 10.0 Hz",
        ),
        (lambda: iso.velocity_rms(np.ones(1), FS), r"duration = 0.000195313 s must be >= 0.5 s"),
        (
            lambda: iso.velocity_rms(np.ones(9), np.nan, band=(5, 2)),
            r"fs = nan Hz must be >= 0.001 .*; low = 5 Hz must be > 0 and < high = 2 Hz",
        ),
        (lambda: iso.velocity_rms([], FS), r"n_samples = 0"),
        (lambda: iso.band_rms([1.0], FS, (1, 2), integrations=3), r"integrations = 3 must be 0"),
        (lambda: iso.zone(1e-3, "industrial-1-rgid"), r"did you mean industrial-1-rigid\?"),
        (lambda: iso.zone(1e-3, ""), r"kind = '' must be one of industrial-1-rigid, "),
        (lambda: iso.zone(-1.0, "pump-1-small"), r"velocity = -1.0 m/s must be >= 0"),
        (lambda: iso.zone([0, np.nan], "pump-1-small"), r"velocity = nan m/s must be >= 0"),
        (
            lambda: iso.zone(0, "pump-1-small", displacement=0),
            r"displacement has no boundaries in ISO 10816-7",
        ),
        (lambda: iso.iso_band("pump-1-small"), r"speed_hz = None Hz must be > 0"),
        (lambda: iso.iso_band("pump-1-small", -3.0), r"speed_hz = -3.0 Hz must be > 0"),
    ],
)
def test_faults_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
