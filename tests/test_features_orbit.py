"""Orbits of two probes against ellipses, spirals and circles known in closed form."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.features.catalogue import analysis as shared
from wearstate.features.catalogue import orbit_rows, standard_rows
from wearstate.features.catalogue import row as table
from wearstate.features.rotation import orbit, order

FS = 5120.0
SPEED = 50.0
N = 4096
TURNS = SPEED * np.arange(N) / FS  # 40 revolutions: whole cycles of every order below
CHANNELS = ("probe_1", "probe_2")

sizes = st.floats(1e-6, 1e-3)
angles = st.floats(-1.5, 1.5)


def ellipse(a, b, tilt=0.0, order_=1.0, turns=TURNS):
    """Semi-axes a along the tilt and b across it; b < 0 runs backward."""
    angle = 2 * np.pi * order_ * turns
    return (a * np.cos(angle) + 1j * b * np.sin(angle)) * np.exp(1j * tilt)


def readings(z, probe_angles=orbit.PROBE_ANGLES):
    """What probes at these angles see."""
    return [z.real * math.cos(a) + z.imag * math.sin(a) for a in probe_angles]


# --- from the probes


@given(first=st.floats(-3, 3), between=st.floats(0.2, 2.9))
def test_any_two_probes_give_the_displacement_back(first, between):
    z = ellipse(3e-5, 1e-5, 0.4) + (2e-5 - 1e-5j)
    at = (first, first - between)
    # a sine of 0.2 between the probes multiplies the rounding of 1e-16 by 5
    assert_allclose(orbit.displacement(*readings(z, at), angles=at), z, rtol=0, atol=1e-18)


def test_a_turn_from_the_second_probe_to_the_first_is_forward():
    early = np.argmax(readings(ellipse(1, 1))[1][:100])
    late = np.argmax(readings(ellipse(1, 1))[0][:100])
    # a quarter of 102.4 samples a revolution
    assert (late - early) % 102.4 == pytest.approx(25.6, abs=1)


@pytest.mark.parametrize("angles_deg", [(10, 10), (45, 225), (0, 3)])
def test_probes_on_one_line_are_refused(angles_deg):
    at = tuple(math.radians(angle) for angle in angles_deg)
    with pytest.raises(ValueError, match=r"angle between the probes = .* deg must be >= 5 deg"):
        orbit.displacement([1.0], [1.0], angles=at)


def test_probes_of_unequal_length_are_refused():
    with pytest.raises(ValueError, match=r"\(2,\) and \(1,\), must be equal"):
        orbit.displacement([1.0, 2.0], [1.0])


# --- filtered orbits


@given(a=sizes, b=sizes, tilt=angles, backward=st.booleans())
def test_an_ellipse_has_the_vectors_of_its_axes(a, b, tilt, backward):
    sign = -1 if backward else 1
    z = ellipse(a, sign * b, tilt) + (1e-4 + 2e-4j)
    [forward], [behind] = orbit.filtered_orbits(z, TURNS, [1.0])
    # R+ = (a + b) / 2, R- = (a - b) / 2, both turned by the tilt; sums of 4096 samples of 1e-3
    assert_allclose(forward, (a + sign * b) / 2 * np.exp(1j * tilt), rtol=0, atol=1e-15)
    assert_allclose(behind, (a - sign * b) / 2 * np.exp(1j * tilt), rtol=0, atol=1e-15)
    major, minor = orbit.semi_axes(forward, behind)
    assert_allclose([major, minor], [max(a, b), min(a, b)], rtol=0, atol=2e-15)
    assert_allclose(orbit.ellipticity(forward, behind), min(a, b) / max(a, b), atol=1e-8)
    assert_allclose(abs(orbit.precession(forward, behind)), min(a, b) / max(a, b), atol=1e-8)
    assert np.sign(orbit.precession(forward, behind)) == sign


@given(a=st.floats(2e-6, 1e-3), tilt=angles)
def test_the_long_axis_is_where_it_is(a, tilt):
    for minor in (a / 2, -a / 2):
        [forward], [behind] = orbit.filtered_orbits(ellipse(a, minor, tilt), TURNS, [1.0])
        assert orbit.inclination(forward, behind) == pytest.approx(tilt, abs=1e-9)  # rounding


def test_orders_do_not_mix_and_the_path_closes():
    parts = {0.5: (4e-6, 3e-6, 0.2), 1.0: (2e-5, -1e-5, -0.7), 2.0: (5e-6, 0.0, 1.1)}
    z = sum(ellipse(*axes, order_=k) for k, axes in parts.items())
    forward, backward = orbit.filtered_orbits(z, TURNS, list(parts))
    for i, (k, axes) in enumerate(parts.items()):
        path = orbit.orbit_path(forward[i], backward[i], 2 * np.pi * k * TURNS)
        # 40 revolutions hold every order a whole number of times: exact but for rounding
        assert_allclose(path, ellipse(*axes, order_=k), rtol=0, atol=1e-16)


def test_points_and_circles_have_shapes_too():
    assert [float(orbit.ellipticity(r, 0)) for r in (0, 1)] == [0.0, 1.0]
    assert [float(orbit.precession(0, r)) for r in (0, 1)] == [0.0, -1.0]


# --- the whole record


@given(a=sizes, b=sizes)
def test_full_spectrum_of_an_ellipse(a, b):
    frequency, vector = orbit.full_spectrum(ellipse(a, b) + 1e-3, FS)
    lines = dict(zip(frequency.tolist(), np.abs(vector), strict=True))
    # 50 Hz is line 40; sums of 4096 samples of 1e-3
    assert_allclose([lines[50.0], lines[-50.0]], [(a + b) / 2, abs(a - b) / 2], atol=1e-15)
    assert_allclose(lines[0.0], 0, atol=1e-15)


@given(cycles=st.floats(0.3, 0.7), radius=sizes)
def test_whirl_is_found_between_the_lines_beside_a_larger_synchronous_orbit(cycles, radius):
    z = radius * np.exp(2j * np.pi * cycles * TURNS) + ellipse(radius, 0.5 * radius)
    ratio, found = orbit.whirl(z, FS, SPEED)
    # leakage of the synchronous circle 12 lines off: 1 / (pi d (d^2 - 1)) = 2e-4 of the radius
    assert ratio == pytest.approx(cycles, abs=4e-4)
    assert found == pytest.approx(radius, rel=2e-3)


def test_backward_motion_is_no_whirl():
    _, forward = orbit.whirl(1e-5 * np.exp(2j * np.pi * 0.45 * TURNS), FS, SPEED)
    _, backward = orbit.whirl(1e-5 * np.exp(-2j * np.pi * 0.45 * TURNS), FS, SPEED)
    assert forward == pytest.approx(1e-5, rel=1e-6)
    assert backward < 1e-4 * forward


def test_a_shaft_that_stands_still_does_not_whirl():
    assert orbit.whirl(np.full(N, 3 + 1j), FS, SPEED) == (0.0, 0.0)


def test_too_short_a_record_has_no_line_to_whirl_on():
    with pytest.raises(ValueError, match="must have >= 2; record longer"):
        orbit.whirl(np.ones(128), FS, SPEED)


# --- run-out

SCRATCH = {1: 2e-5 * np.exp(0.4j), 2: 8e-6j, 3: 3e-6}


def surface(turns, offset=0.0):
    """What a probe reads of the surface below it [m]."""
    return sum(np.real(a * np.exp(2j * np.pi * k * (turns + offset))) for k, a in SCRATCH.items())


def test_slow_roll_vectors_leave_the_motion():
    slow_turns = 3.0 * np.arange(N) / FS
    at = orbit.PROBE_ANGLES
    slow = orbit.displacement(surface(slow_turns), surface(slow_turns, 0.25), angles=at)
    motion = ellipse(2e-5, 1e-5, 0.3)
    first, second = readings(motion, at)
    z = orbit.displacement(first + surface(TURNS), second + surface(TURNS, 0.25), angles=at)
    rolled = orbit.filtered_orbits(slow, slow_turns, [1.0, 2.0])
    found = orbit.filtered_orbits(z, TURNS, [1.0, 2.0], slow_roll=rolled)
    # 2.4 revolutions of slow roll are cut to two, the last sample of them in part: 1 / 1707 of a
    # revolution of trapezoids: (2 pi 3 / 1707)^2 of 3e-5
    assert_allclose(found[0], [1.5e-5 * np.exp(0.3j), 0], rtol=0, atol=5e-9)
    assert_allclose(found[1], [5e-6 * np.exp(0.3j), 0], rtol=0, atol=5e-9)
    raw = orbit.filtered_orbits(z, TURNS, [1.0, 2.0])
    assert abs(raw[0][0] - found[0][0]) > 5e-6
    with pytest.raises(ValueError, match=r"slow_roll has shapes \(2,\) and \(2,\), must be \(1,\)"):
        orbit.filtered_orbits(z, TURNS, [1.0], slow_roll=rolled)


def test_centreline_excursion_and_marks():
    z = ellipse(4e-5, 2e-5) + (3e-5 - 4e-5j)
    assert abs(orbit.centreline(z)) == pytest.approx(5e-5, rel=1e-12)
    assert orbit.largest_excursion(z) == pytest.approx(4e-5, rel=1e-12)
    marks = orbit.keyphasor_marks(z, FS, np.arange(1, 40) / SPEED)
    # between samples a chord cuts the arc: (2 pi / 102.4)^2 / 8 of 4e-5 m
    assert_allclose(marks, 7e-5 - 4e-5j, rtol=0, atol=2.1e-8)


# --- the row


def machine(mean=4e-5 - 1e-5j, noise=0.0):
    rng = np.random.default_rng(3)
    z = mean + ellipse(2e-5, 1e-5, 0.3) + 1e-6 * np.exp(2j * np.pi * 0.475 * TURNS)
    probes = np.stack(readings(z)) + noise * rng.standard_normal((2, N))
    tacho = 5.0 * ((TURNS + 0.01) % 1 < 0.1)
    return probes.astype(np.float32), tacho


def row(probes, tacho, **options):
    names, values = table.feature_row(
        probes,
        FS,
        tacho=tacho,
        channel_names=CHANNELS,
        quantities=("displacement", "displacement"),
        **options,
    )
    assert np.all(np.isfinite(values))
    return dict(zip(names, values, strict=True))


def test_the_row_of_two_probes():
    found = row(*machine())
    # float32 readings of 5e-5 m: 3e-12 m
    assert found["orbit.centreline.x"] == pytest.approx(4e-5, abs=1e-10)
    assert found["orbit.centreline.y"] == pytest.approx(-1e-5, abs=1e-10)
    assert found["orbit.centreline.radius_db"] == pytest.approx(
        20 * math.log10(abs(4e-5 - 1e-5j)), abs=1e-3
    )
    # the phase is known from 39 pulses to a fraction of a sample; 20 log10 of 1e-4 relative
    assert found["orbit.order_1.major_db"] == pytest.approx(20 * math.log10(2e-5), abs=0.02)
    assert found["orbit.order_1.minor_db"] == pytest.approx(20 * math.log10(1e-5), abs=0.02)
    assert found["orbit.order_1.forward_db"] == pytest.approx(20 * math.log10(1.5e-5), abs=0.02)
    assert found["orbit.order_1.backward_db"] == pytest.approx(20 * math.log10(5e-6), abs=0.02)
    assert found["orbit.order_1.ellipticity"] == pytest.approx(0.5, abs=2e-3)
    assert found["orbit.order_1.precession"] == pytest.approx(0.5, abs=2e-3)
    # twice the tilt of the axis
    assert found["orbit.order_1.inclination_cos"] == pytest.approx(math.cos(0.6), abs=2e-3)
    assert found["orbit.order_1.inclination_sin"] == pytest.approx(math.sin(0.6), abs=2e-3)
    assert found["orbit.whirl_ratio"] == pytest.approx(0.475, abs=2e-3)
    # the larger orbit leaks 1e-3 of its 2e-5 m into the line of 1e-6 m: 2 %, 0.2 dB
    assert found["orbit.whirl_db"] == pytest.approx(-120, abs=0.2)


def test_the_mark_is_the_high_spot():
    """At the pulse, a hundredth of a turn early, the shaft is at the end of its major axis."""
    found = row(*machine())
    expected = ellipse(2e-5, 1e-5, 0.3, turns=np.array([-0.01]))[0]
    direction = expected / abs(expected)
    # half a sample of phase: 0.03 rad
    assert found["orbit.mark_cos"] == pytest.approx(direction.real, abs=0.04)
    assert found["orbit.mark_sin"] == pytest.approx(direction.imag, abs=0.04)


def test_orbit_features_appear_with_two_probes_only():
    probes, tacho = machine()
    found = row(probes, tacho)
    names = table.feature_names(CHANNELS, FS, quantities=("displacement", "displacement"))
    assert tuple(found) == names
    assert not any(".angle_" in name or "dead_centre" in name for name in found)
    assert any(name.startswith("orbit.") for name in found)
    one, _ = table.feature_row(
        probes, FS, tacho=tacho, channel_names=CHANNELS, quantities=("displacement", "velocity")
    )
    assert not any(name.startswith("orbit.") for name in one)
    mixed = ("displacement", "displacement", "acceleration")
    names = table.feature_names(("a", "b", "c"), 25_600.0, quantities=mixed)
    assert any(name.startswith("orbit.") for name in names)
    assert any(name.startswith("c.angle_") for name in names)


def test_without_a_tacho_the_centreline_is_left():
    probes, _ = machine()
    found = row(probes, None)
    assert [name for name in found if name.startswith("orbit.")] == [
        "orbit.centreline.x",
        "orbit.centreline.y",
        "orbit.centreline.radius_db",
        "orbit.centreline.attitude_cos",
        "orbit.centreline.attitude_sin",
        "orbit.largest_excursion_db",
    ]


def test_every_orbit_feature_is_one_function_with_a_reference():
    probes, tacho = machine()
    analysis = shared.Analysis(probes, FS, pulses=order.pulse_times(tacho, FS), probes=(0, 1))
    every = (*standard_rows.CATALOGUE, *orbit_rows.ORBIT_CATALOGUE)
    assert len({feature.name for feature in every}) == len(every)
    for feature in orbit_rows.ORBIT_CATALOGUE:
        assert np.size(feature.function(analysis)) == len(feature.labels_for(shared.STANDARD, FS))
        assert feature.reference
        assert feature.unit


@pytest.mark.parametrize("scale", [0.25, 8.0])
def test_levels_follow_the_scale_and_shapes_do_not(scale):
    probes, tacho = machine(noise=1e-7)
    plain, scaled = row(probes, tacho), row(probes * np.float32(scale), tacho)
    for name in plain:
        if name.startswith("orbit.") and name.endswith("_db"):
            # a power of two scales floats exactly
            assert scaled[name] - plain[name] == pytest.approx(20 * math.log10(scale), abs=1e-6)
        elif name.startswith("orbit.") and not name.endswith((".x", ".y")):
            assert scaled[name] == pytest.approx(plain[name], abs=1e-6)


def test_dead_probes_have_finite_features():
    found = row(np.zeros((2, N), dtype=np.float32), machine()[1])
    assert found["orbit.centreline.radius_db"] == -200.0
    assert found["orbit.order_1.ellipticity"] == 0.0


def test_quantities_must_be_one_for_each_channel():
    with pytest.raises(ValueError, match="quantities has 1 entries, must have 2"):
        table.feature_row(machine()[0], FS, quantities=("displacement",))
