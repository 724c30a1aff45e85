"""Beam elements against closed forms, their own integrals, and what statics owes everybody."""

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import linalg
from wearstate.sim.beam import beam as bm
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_matrices import cowper_coefficient
from wearstate.sim.beam.beam_parts import Disc, DistributedLoad, PointLoad, Section

PI = math.pi
STEEL = {"young": 2.11e11, "shear_modulus": 8.12e10, "density": 7810.0}


def bar(length=1.0, outer_diameter=0.05, **other):
    return Section(length=length, outer_diameter=outer_diameter, **{**STEEL, **other})


def euler(sections, **options):
    return assemble_beam(sections, theory="euler-bernoulli", **options)


def solve(beam, fixed):
    """Deflection with the coordinates `fixed` held, and what holds every coordinate."""
    free = np.setdiff1d(np.arange(beam.n_dof), fixed)
    stiffness = beam.stiffness.toarray()
    deflection = np.zeros(beam.n_dof)
    deflection[free] = np.linalg.solve(stiffness[np.ix_(free, free)], beam.load[free])
    return deflection, stiffness @ deflection - beam.load


def pins(beam, stations, axes="yz"):
    return [beam.dof(station, axis) for station in stations for axis in axes]


def clamp(beam, station):
    first = 4 * beam.node(station)
    return list(range(first, first + 4))


# --- statics in closed form


EQUAL_SPANS = {
    3: [0.375, 1.25],
    4: [0.4, 1.1],
    5: [11 / 28, 8 / 7, 13 / 14],
    6: [15 / 38, 43 / 38, 37 / 38],
}
"""Count of supports -> reactions over w L up to the middle, by the theorem of three moments."""


@pytest.mark.parametrize("count", EQUAL_SPANS)
def test_equal_spans_carry_what_the_three_moments_say(count):
    stations = np.arange(count, dtype=float)
    beam = euler([bar(count - 1.0)], stations=stations)
    _, held = solve(beam, pins(beam, stations))
    half = EQUAL_SPANS[count]
    expected = half + half[::-1][count % 2 :]
    span = beam.weight / (count - 1)
    # nodes are exact, rounding alone
    assert_allclose(held[pins(beam, stations, "y")] / span, expected, rtol=1e-9)
    assert_allclose(held[pins(beam, stations, "z")], 0.0, atol=1e-9 * span)


@pytest.mark.parametrize("theory", bm.THEORIES)
def test_a_cantilever_bends_and_shears(theory):
    k, force, moment, spread = 0.9, -700.0, 30.0, -900.0
    s = bar(1.5)
    loads = [
        PointLoad(station=1.5, up=force, side=2 * force, moment_up=moment, moment_side=-moment),
        DistributedLoad(start=0.0, end=1.5, up=spread),
    ]
    beam = assemble_beam([s], loads=loads, theory=theory, shear_coefficient=k, gravity=0.0)
    q, held = solve(beam, clamp(beam, 0.0))
    bending = s.bending_stiffness
    flexible = 1 / (k * s.shear_modulus * s.area) if theory == "timoshenko" else 0.0
    length = s.length
    sag = force * length**3 / (3 * bending) + moment * length**2 / (2 * bending)
    sag += spread * length**4 / (8 * bending)
    sag += flexible * (force * length + spread * length**2 / 2)
    slope = force * length**2 / (2 * bending) + moment * length / bending
    slope += spread * length**3 / (6 * bending)
    # one element, exact: rounding
    assert_allclose(q[4:6], [sag, slope], rtol=1e-11)
    aside = 2 * force * (length**3 / (3 * bending) + flexible * length)
    assert_allclose(q[6], aside - moment * length**2 / (2 * bending), rtol=1e-11)
    total = force + spread * length
    assert_allclose(held[0], -total, rtol=1e-12)
    couple = -(force * length + moment + spread * length**2 / 2)
    assert_allclose(held[1], couple, rtol=1e-12)


def test_a_stepped_hollow_cantilever_against_its_integral():
    sections = [bar(0.4, 0.06), bar(0.7, 0.05, inner_diameter=0.03), bar(0.3, 0.04, young=1e11)]
    k, force = 0.7, 1e3
    beam = assemble_beam(
        sections, loads=[PointLoad(station=1.4, up=force)], shear_coefficient=k, gravity=0.0
    )
    q, _ = solve(beam, clamp(beam, 0.0))
    expected, aft = 0.0, 0.0
    for s in sections:
        arm = np.array([1.4 - aft, 1.4 - aft - s.length])
        expected += force * (arm[0] ** 3 - arm[1] ** 3) / (3 * s.bending_stiffness)
        expected += force * s.length / (k * s.shear_modulus * s.area)
        aft += s.length
    assert_allclose(q[beam.dof(1.4, "y")], expected, rtol=1e-11)  # rounding


def test_load_on_a_part_of_a_span():
    beam = euler(
        [bar(2.0)], loads=[DistributedLoad(start=0.5, end=1.2, up=100.0, side=-40.0)], gravity=0.0
    )
    _, held = solve(beam, pins(beam, (0.0, 2.0)))
    aft = -100.0 * 0.7 * (2.0 - 0.85) / 2.0
    # rounding
    assert_allclose(held[pins(beam, (0.0, 2.0), "y")], [aft, -70.0 - aft], rtol=1e-11)
    assert_allclose(held[beam.dof(0.0, "z")], -0.4 * aft, rtol=1e-11)
    assert_allclose(beam.downward_load, -70.0, rtol=1e-14)


@pytest.mark.parametrize("theory", bm.THEORIES)
def test_moment_and_shear_of_a_pinned_shaft(theory):
    s, force, moment = bar(2.0), -500.0, 80.0
    loads = [PointLoad(station=0.5, up=force), PointLoad(station=1.25, moment_side=moment)]
    beam = assemble_beam(
        [s], loads=loads, longest_element=0.3, theory=theory, shear_coefficient=0.9
    )
    q, _ = solve(beam, pins(beam, (0.0, 2.0)))
    cut = beam.moments_and_shear(q)
    x, w = cut.stations, beam.weight / 2.0
    reaction = w + 500.0 * 1.5 / 2.0
    # of two cuts at a station the second is the forward one
    behind = np.isclose(x, 0.5) & (np.arange(x.size) % 2 == 0)
    loaded = (x > 0.5 + 1e-9) | behind
    assert_allclose(cut.shear_up, reaction - w * x + force * loaded, atol=1e-8 * reaction)
    expected = reaction * x - w * x**2 / 2 + force * (x - 0.5) * loaded
    assert_allclose(cut.moment_up, expected, atol=1e-8 * reaction)
    behind = np.isclose(x, 1.25) & (np.arange(x.size) % 2 == 0)
    turned = (x > 1.25 + 1e-9) | behind
    assert_allclose(cut.moment_side, moment * x / 2.0 - moment * turned, atol=1e-8 * moment)
    assert_allclose(cut.shear_side, moment / 2.0, rtol=1e-8)
    assert x.size == 2 * beam.stations.size - 2
    assert cut.moment_up.max() > 0  # sagging is positive


def test_a_section_may_be_cut_without_change():
    whole = assemble_beam([bar(1.0)], stations=[0.3], shear_coefficient=1.0)
    cut = assemble_beam([bar(0.3), bar(0.7)], shear_coefficient=1.0)
    for name in ("mass", "stiffness", "gyroscopic"):
        a, b = getattr(whole, name).toarray(), getattr(cut, name).toarray()
        assert_allclose(a, b, rtol=1e-12)
    assert_allclose(whole.load, cut.load, rtol=1e-12)


# --- the element against its own integrals


def shapes(x, length, ratio):
    """Deflection, slope and curvature of the unloaded beam for unit ends, found by collocation.

    Solved for the cubic that meets the ends, with the slope of the section ``w' + s L^2 w''' /
    12``, s the shear ratio.
    """

    def rows(at):
        w = np.array([1, at, at**2, at**3])
        turn = np.array([0, 1, 2 * at, 3 * at**2 + ratio * length**2 / 2])
        return w, turn

    ends = np.array([*rows(0.0), *rows(length)])
    cubic = np.linalg.inv(ends)
    w, turn = (np.array([rows(at)[k] for at in x]) @ cubic for k in (0, 1))
    curvature = np.array([[0, 0, 2, 6 * at] for at in x]) @ cubic
    shear = np.array([[0, 0, 0, -ratio * length**2 / 2] for _ in x]) @ cubic
    return w, turn, curvature, shear


@pytest.mark.parametrize("theory", bm.THEORIES)
@pytest.mark.parametrize("length", [0.03, 1.0])
def test_element_matrices_are_the_integrals_of_their_shapes(theory, length):
    s, k = bar(length, 0.1, inner_diameter=0.02), 0.8
    beam = assemble_beam([s], theory=theory, shear_coefficient=k)
    ratio, rotary = beam.elements.shear_ratio[0], beam.elements.rotary[0]
    point, weight = np.polynomial.legendre.leggauss(6)
    x, weight = length / 2 * (point + 1), length / 2 * weight
    w, turn, curvature, shear = shapes(x, length, ratio)

    def integral(rows):
        return rows.T @ (weight[:, None] * rows)

    plane = [0, 1, 4, 5]
    stiffness = s.bending_stiffness * integral(curvature)
    stiffness += k * s.shear_modulus * s.area * integral(shear)
    mass = s.density * s.area * integral(w) + rotary * integral(turn)
    for at in (0, 2):
        here = np.ix_(np.add(plane, at), np.add(plane, at))
        # six points integrate degree eleven: rounding, of entries of every unit
        scale = np.sqrt(np.outer(np.diag(stiffness), np.diag(stiffness)))
        assert_allclose(beam.stiffness.toarray()[here] / scale, stiffness / scale, atol=1e-11)
        scale = np.sqrt(np.outer(np.diag(mass), np.diag(mass)))
        assert_allclose(beam.mass.toarray()[here] / scale, mass / scale, atol=1e-11)
    polar = 2 * rotary * integral(turn)
    gyroscopic = beam.gyroscopic.toarray()
    across = np.ix_(plane, np.add(plane, 2))
    assert_allclose(gyroscopic[across], polar, atol=1e-11 * max(polar.max(), 1e-30))
    assert_allclose(gyroscopic[across[::-1]].T, -gyroscopic[across], atol=0)
    expected_rotary = 0.0 if theory == "euler-bernoulli" else s.density * s.second_moment
    assert_allclose(rotary, expected_rotary, rtol=1e-14)
    expected_ratio = 12 * s.bending_stiffness / (k * s.shear_modulus * s.area * length**2)
    assert_allclose(ratio, expected_ratio if theory == "timoshenko" else 0.0, rtol=1e-14)


# --- natural frequencies in closed form


def frequencies(beam, fixed, count):
    """Of the plane of y [rad/s]."""
    plane = np.flatnonzero(np.arange(beam.n_dof) % 4 < 2)
    free = np.setdiff1d(plane, fixed)
    k, m = (matrix.toarray()[np.ix_(free, free)] for matrix in (beam.stiffness, beam.mass))
    # the inverse keeps the digits of the low ones; all beams here are held
    inverse = linalg.eigh(m, k, eigvals_only=True)[::-1]
    return 1 / np.sqrt(inverse[:count])


ROOTS = {
    "pinned-pinned": [PI, 2 * PI, 3 * PI],
    "clamped-free": [1.875104068712, 4.694091132974, 7.854757438238],
    "clamped-clamped": [4.730040744863, 7.853204624096, 10.995607838002],
    "clamped-pinned": [3.926602312048, 7.068582745629, 10.210176122813],
}
"""beta L of cos cosh = -1, 1 and tan = tanh, by an independent root finder."""


def held(beam, ends):
    first, last = ends.split("-")
    by = {"pinned": [0], "clamped": [0, 1], "free": []}
    return [*by[first], *(beam.n_dof - 4 + k for k in by[last])]


@pytest.mark.parametrize("ends", ROOTS)
def test_beam_roots_at_the_theoretical_order(ends):
    s = bar(2.0)
    exact = np.array(ROOTS[ends]) ** 2 / 4.0
    exact *= math.sqrt(s.bending_stiffness / (s.density * s.area))
    errors = []
    for count in (6, 12, 24):
        beam = euler([s], longest_element=2.0 / count)
        errors.append(frequencies(beam, held(beam, ends), 3) / exact - 1)
    errors = np.array(errors)
    assert (errors > 0).all()  # consistent: from above
    # cubic elements: (beta h)^4 / 1440 of the frequency; the next term has (beta h)^6
    assert_allclose(np.log2(errors[1] / errors[2]), 4.0, atol=0.1)
    assert_allclose(errors[2], (np.array(ROOTS[ends]) / 24) ** 4 / 1440, rtol=0.02)


def pinned_timoshenko(s, k, mode, length):
    """Lower root of the quartic of a pinned Timoshenko beam [rad/s]."""
    wave = (mode * PI / length) ** 2
    turn = s.density * s.second_moment
    quartic = turn * s.density / (k * s.shear_modulus)
    middle = s.density * s.area + turn * wave * (1 + s.young / (k * s.shear_modulus))
    root = middle**2 - 4 * quartic * s.bending_stiffness * wave**2
    return math.sqrt((middle - math.sqrt(root)) / (2 * quartic))


@pytest.mark.parametrize("slenderness", [5.0, 20.0, 60.0])
def test_pinned_timoshenko_in_closed_form(slenderness):
    s, k, mode = bar(1.0, 1.0 / slenderness), 0.85, np.array([1, 2, 3])
    exact = np.array([pinned_timoshenko(s, k, m, 1.0) for m in mode])
    errors, counts = [], (48, 96)
    for count in counts:
        beam = assemble_beam([s], longest_element=1.0 / count, shear_coefficient=k)
        found = frequencies(beam, held(beam, "pinned-pinned"), 3) / exact - 1
        errors.append(found - (mode * PI / count) ** 4 / 1440)  # that of the bending
    errors = np.array(errors)
    # an element's shear is even while its inertia bends: order 2, by s (beta h)^2 / 24 where the
    # share s of the shear over the bending is small
    assert_allclose(np.log2(errors[0] / errors[1]), 2.0, atol=0.02)
    share = s.young / (k * s.shear_modulus) * (mode * PI / slenderness / 4) ** 2
    expected = share * (mode * PI / counts[1]) ** 2 / 24
    assert (errors[1] < 1.05 * expected).all()  # rounding of the smallest
    assert_allclose(errors[1] / expected, 1.0, atol=2 * share.max())  # the next order in s


@pytest.mark.parametrize(("diameters", "high"), [(10, 0.047), (30, 0.0054)])
def test_without_shear_a_wave_is_as_much_too_fast_as_its_rung_says(diameters, high):
    s = bar(1.0, 2.0 / diameters)  # half a wave
    k = cowper_coefficient(s.poisson)
    slender = PI**2 * math.sqrt(s.bending_stiffness / (s.density * s.area))
    assert slender / pinned_timoshenko(s, k, 1, 1.0) - 1 == pytest.approx(high, rel=0.05)


def test_pinned_rayleigh_in_closed_form():
    s = bar(1.0, 0.1)
    wave = (np.array([1, 2]) * PI) ** 2
    exact = wave * np.sqrt(
        s.bending_stiffness / (s.density * s.area + s.density * s.second_moment * wave)
    )
    beam = assemble_beam([s], longest_element=1 / 24, theory="rayleigh")
    found = frequencies(beam, held(beam, "pinned-pinned"), 2)
    # (2 pi / 24)^4 / 720 = 6.5e-6 of the frequency squared
    assert_allclose(found, exact, rtol=1e-5)


def test_timoshenko_comes_to_euler_bernoulli_at_its_rate():
    gaps = []
    for diameter in (0.02, 0.01, 0.005):
        s = bar(1.0, diameter)
        options = {"longest_element": 1 / 16}
        thick = assemble_beam([s], shear_coefficient=0.9, **options)
        thin = euler([s], **options)
        fixed = held(thin, "clamped-free")
        gaps.append(1 - frequencies(thick, fixed, 2) / frequencies(thin, fixed, 2))
    gaps = np.array(gaps)
    assert (gaps > 0).all()
    # (d / L)^2, the next term (d / L)^4
    assert_allclose(np.log2(gaps[:-1] / gaps[1:]), 2.0, atol=0.02)
    assert gaps[-1].max() < 1e-3


def whirl(beam, fixed, speed, count):
    """Lowest whirl frequencies of a conservative beam, by the Hermitian form [rad/s]."""
    free = np.setdiff1d(np.arange(beam.n_dof), fixed)
    k, m, g = (
        matrix.toarray()[np.ix_(free, free)]
        for matrix in (beam.stiffness, beam.mass, beam.gyroscopic)
    )
    n, zero = len(k), np.zeros((len(free), len(free)))
    state = np.block([[zero, np.eye(n)], [-np.linalg.solve(m, k), -speed * np.linalg.solve(m, g)]])
    return np.sort(np.abs(np.linalg.eigvals(state).imag))[::2][:count]


def test_a_spinning_pinned_shaft_in_closed_form():
    s, speed = bar(1.0, 0.2), 4000.0
    beam = assemble_beam([s], longest_element=1 / 12, theory="rayleigh")
    found = whirl(beam, pins(beam, (0.0, 1.0)), speed, 4)
    exact = []
    for mode in (1, 2):
        wave = (mode * PI) ** 2
        turn = s.density * s.second_moment * wave
        mass, split = s.density * s.area + turn, turn * speed
        root = math.sqrt(split**2 + mass * s.bending_stiffness * wave**2)
        exact += [(root - split) / mass, (root + split) / mass]  # backward, forward
    # (2 pi / 12)^4 / 1440 = 5e-5 of the second
    assert_allclose(found, exact, rtol=1e-4)
    assert exact[1] / exact[0] > 1.03  # the shaft's own spin is seen


# --- discs


DISC = Disc(
    station=0.4,
    mass=30.0,
    polar_inertia=0.8,
    diametral_inertia=0.5,
    entrained_mass=6.0,
    entrained_polar=0.3,
    entrained_diametral=0.2,
    buoyancy=40.0,
)


def test_water_is_inertia_without_weight_or_spin():
    bare = assemble_beam([bar()], stations=[0.4], shear_coefficient=1.0)
    beam = assemble_beam([bar()], discs=[DISC], shear_coefficient=1.0)
    first = 4 * beam.node(0.4)
    mass = (beam.mass - bare.mass).toarray()
    assert_allclose(np.diag(mass)[first : first + 4], [36.0, 0.7, 36.0, 0.7], rtol=1e-12)
    assert np.count_nonzero(np.abs(mass) > 1e-9) == 4
    spin = (beam.gyroscopic - bare.gyroscopic).toarray()
    assert_allclose(spin[first + 1, first + 3], 0.8, rtol=1e-12)
    assert_allclose(spin[first + 3, first + 1], -0.8, rtol=1e-12)
    assert np.count_nonzero(np.abs(spin) > 1e-9) == 2
    added = 30.0 * bm.STANDARD_GRAVITY - 40.0
    assert_allclose(beam.weight - bare.weight, added, rtol=1e-12)
    assert_allclose(beam.load - bare.load, np.where(np.arange(12) == first, -added, 0), atol=1e-12)


def test_discs_at_one_station_add_up():
    twice = assemble_beam([bar()], discs=[DISC, DISC], shear_coefficient=1.0)
    once = assemble_beam(
        [bar()],
        discs=[
            Disc(
                station=0.4,
                **{k: 2 * v for k, v in dataclasses.asdict(DISC).items() if k != "station"},
            )
        ],
        shear_coefficient=1.0,
    )
    assert_allclose(twice.mass.toarray(), once.mass.toarray(), rtol=1e-12)
    assert_allclose(twice.gyroscopic.toarray(), once.gyroscopic.toarray(), rtol=1e-12)
    assert_allclose(twice.load, once.load, rtol=1e-12)


# --- invariants


lengths = st.floats(0.05, 3.0)
pieces = st.builds(bar, lengths, st.floats(0.05, 0.5), inner_diameter=st.floats(0.0, 0.04))
beams = st.builds(
    lambda sections, longest, theory: assemble_beam(
        sections,
        discs=[Disc(station=sections[0].length, mass=20.0)],
        longest_element=longest,
        theory=theory,
        shear_coefficient="cowper",
    ),
    st.lists(pieces, min_size=1, max_size=5),
    st.floats(0.2, 1.0),
    st.sampled_from(bm.THEORIES),
)


def rigid_motions(beam):
    motions = np.zeros((beam.n_dof, 4))
    motions[0::4, 0] = motions[2::4, 1] = 1.0
    motions[0::4, 2] = motions[2::4, 3] = beam.stations
    motions[1::4, 2] = motions[3::4, 3] = 1.0
    return motions


@settings(max_examples=60, deadline=None)
@given(beams)
def test_matrices_have_the_symmetries_of_a_free_shaft(beam):
    k, m, g = (matrix.toarray() for matrix in (beam.stiffness, beam.mass, beam.gyroscopic))
    assert (k == k.T).all()
    assert (m == m.T).all()
    assert (g == -g.T).all()
    motions = rigid_motions(beam)
    # rounding of entries that cancel
    assert np.abs(k @ motions).max() <= 1e-11 * (np.abs(k) @ np.abs(motions)).max()
    assert np.linalg.eigvalsh(m).min() > 0
    assert np.linalg.eigvalsh(k).min() > -1e-12 * np.abs(k).max()
    total = sum(s.density * s.area * s.length for s in beam.sections) + 20.0
    assert_allclose(motions[:, 0] @ m @ motions[:, 0], total, rtol=1e-11)
    assert_allclose(beam.weight, total * bm.STANDARD_GRAVITY, rtol=1e-11)
    assert_allclose(beam.downward_load, beam.weight, rtol=1e-11)


@settings(max_examples=40, deadline=None)
@given(beams)
def test_inertia_about_the_aft_end(beam):
    """The consistent mass knows mass, first and second moment of the shaft exactly."""
    aft, first, second, own, spin = 0.0, 0.0, 0.0, 0.0, 0.0
    for s in beam.sections:
        mass = s.density * s.area * s.length
        first += mass * (aft + s.length / 2)
        second += mass * (aft**2 + aft * s.length + s.length**2 / 3)
        aft += s.length
        own += s.density * s.second_moment * s.length
    rotary = 0.0 if beam.theory == "euler-bernoulli" else own
    [disc] = beam.discs
    motions = rigid_motions(beam)
    inertia = motions.T @ (beam.mass @ motions)
    assert_allclose(inertia[0, 2], first + 20.0 * disc.station, rtol=1e-10)
    assert_allclose(inertia[2, 2], second + 20.0 * disc.station**2 + rotary, rtol=1e-10)
    spin = motions.T @ (beam.gyroscopic @ motions)
    assert_allclose(spin[2, 3], 2 * rotary, rtol=1e-9, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(beams, st.data())
def test_turned_round_the_shaft_is_the_same(beam, data):
    total = beam.length
    mirrored = assemble_beam(
        beam.sections[::-1],
        discs=[dataclasses.replace(d, station=total - d.station) for d in beam.discs],
        stations=total - beam.stations,
        theory=beam.theory,
        shear_coefficient=beam.shear_coefficient,
    )
    n = beam.stations.size
    assert mirrored.stations.size == n
    order = (4 * np.arange(n)[::-1, None] + np.arange(4)).ravel()
    sign = np.tile([1.0, -1.0, 1.0, -1.0], n)
    for name in ("mass", "stiffness", "gyroscopic"):
        own, other = getattr(beam, name).toarray(), getattr(mirrored, name).toarray()
        turned = (sign[:, None] * other * sign)[np.ix_(order, order)]
        scale = (
            np.sqrt(np.outer(*2 * [np.diag(beam.mass.toarray())]))
            if name != "stiffness"
            else (np.sqrt(np.outer(*2 * [np.diag(own)])))
        )
        # stations are differences of sums: rounding over the shortest element, cubed
        assert np.abs((turned - own) / scale).max() < 1e-9
    assert_allclose(sign * mirrored.load[order], beam.load, atol=1e-9 * np.abs(beam.load).max())


@settings(max_examples=40, deadline=None)
@given(beams)
def test_reactions_balance_and_the_cuts_end_in_nothing(beam):
    ends = (0.0, beam.sections[0].length, beam.length)
    stations = sorted({round(s, 12): s for s in ends}.values())
    q, held_by = solve(beam, pins(beam, stations))
    up = held_by[0::4]
    assert_allclose(up.sum(), beam.downward_load, rtol=1e-8)
    moment = up @ beam.stations + held_by[1::4].sum()
    assert_allclose(moment, -rigid_motions(beam)[:, 2] @ beam.load, rtol=1e-7)
    cut = beam.moments_and_shear(q)
    # rounding grows with the inverse cube of the shortest element
    assert_allclose(cut.moment_up[[0, -1]], 0.0, atol=1e-8 * beam.weight * beam.length)
    assert_allclose(cut.moment_side, 0.0, atol=1e-8 * beam.weight * beam.length)


# --- mesh and places


def test_named_stations_become_nodes_once():
    beam = assemble_beam(
        [bar(0.1), bar(0.2), bar(0.3)],
        discs=[Disc(station=0.3, mass=1.0)],  # the sum 0.1 + 0.2 is not 0.3 in binary
        loads=[PointLoad(station=0.45, up=1.0), DistributedLoad(start=0.1, end=0.2, up=1.0)],
        stations=[0.6, 0.45 + 1e-12, 0.0],
        shear_coefficient=1.0,
    )
    assert_allclose(beam.stations, [0.0, 0.1, 0.2, 0.3, 0.45, 0.6], atol=1e-12)
    assert beam.node(0.3) == 3
    assert beam.dof(0.45, "slope_z") == 19
    with pytest.raises(ValueError, match=r"station = 0.44 m is no node, the nearest is 0.45 m"):
        beam.node(0.44)
    with pytest.raises(ValueError, match="coordinate = 'x' must be one of y, slope_y, z, slope_z"):
        beam.dof(0.3, "x")
    with pytest.raises(ValueError, match=r"shape \(3,\) must be \(24,\)"):
        beam.moments_and_shear(np.zeros(3))


@pytest.mark.parametrize(("longest", "count"), [(0.25, 6), (0.3, 5), (0.29, 6), (5.0, 1), (1.5, 1)])
def test_no_element_is_longer_than_asked_and_none_is_wasted(longest, count):
    beam = assemble_beam([bar(1.5)], longest_element=longest, shear_coefficient=1.0)
    assert beam.stations.size == count + 1
    assert_allclose(np.diff(beam.stations), 1.5 / count, rtol=1e-12)


def test_rounding_adds_no_element():
    assert (0.1 + 0.2) / 0.1 > 3
    beam = assemble_beam([bar(0.1 + 0.2)], longest_element=0.1, shear_coefficient=1.0)
    assert beam.stations.size == 4


def test_cowper_of_solid_and_thin():
    for nu in (0.0, 0.3, 0.5):
        assert_allclose(cowper_coefficient(nu), 6 * (1 + nu) / (7 + 6 * nu), rtol=1e-15)
        thin = cowper_coefficient(nu, 1 - 1e-9)
        assert_allclose(thin, 2 * (1 + nu) / (4 + 3 * nu), rtol=1e-8)  # his thin tube
    with pytest.raises(ValueError, match=r"poisson = 0.6 must be in \(-1, 0.5\]"):
        cowper_coefficient(0.6)
    with pytest.raises(ValueError, match=r"diameter_ratio = 1.0 must be in \[0, 1\)"):
        cowper_coefficient(0.3, 1.0)


def test_cowper_is_that_of_each_section():
    s = bar(0.5, 0.1, inner_diameter=0.06)
    beam = assemble_beam([bar(0.5, 0.1), s], shear_coefficient="cowper")
    k = cowper_coefficient(s.poisson, 0.6)
    expected = 12 * s.bending_stiffness / (k * s.shear_modulus * s.area * 0.25)
    assert_allclose(beam.elements.shear_ratio[1], expected, rtol=1e-14)
    assert beam.elements.shear_ratio[0] < expected


# --- refusals


def refusal(*sections, **options):
    with pytest.raises(ValueError, match="must") as caught:
        assemble_beam(sections, **options)
    return str(caught.value).splitlines()


def test_all_faults_come_at_once():
    lines = refusal(
        bar(-1.0),
        bar(1.0, 0.1, inner_diameter=0.2, density=math.nan),
        discs=[Disc(station=0.5, mass=-1.0), Disc(station=0.5, mass=1.0, polar_inertia=1.0)],
        loads=[
            PointLoad(station=0.5, up=math.inf),
            DistributedLoad(start=0.7, end=0.7, side=math.nan),
        ],
        longest_element=0.0,
        theory="bernoulli",
        gravity=math.nan,
    )
    starts = [re.match(r"[\w\[\].]+", line).group() for line in lines]
    assert starts == [
        "sections[0].length",
        "sections[1].density",
        "sections[1].inner_diameter",
        "discs[0].mass",
        "discs[1].polar_inertia",
        "loads[0].up",
        "loads[1].start",
        "loads[1].side",
        "gravity",
        "longest_element",
        "theory",
    ]
    assert lines[0] == "sections[0].length = -1.0 m must be > 0 and finite; check the unit"
    assert "must be <= 2 diametral_inertia = 0.0 kg m^2" in lines[4]


def test_places_off_the_shaft_and_too_near():
    lines = refusal(
        bar(2.0),
        discs=[Disc(station=2.1, mass=1.0)],
        stations=[-0.1, math.nan],
        shear_coefficient=1.0,
    )
    assert [line.split(" = ")[0] for line in lines] == [
        "stations[0]",
        "stations[1]",
        "discs[0].station",
    ]
    assert lines[2] == "discs[0].station = 2.1 m must be in [0, 2] m, on the shaft; move it"
    [line] = refusal(bar(2.0), stations=[1.0, 1.0001], shear_coefficient=1.0)
    assert line.startswith("stations 1 m and 1.0001 m are 0.0001 m apart, must be one or >= 0.0001")
    [line] = refusal(bar(2.0), longest_element=1e-5, shear_coefficient=1.0)
    assert "must be >= 0.0001 m, for 20000 nodes at most" in line
    assert refusal(shear_coefficient=1.0)[0].startswith("sections is empty, must hold at least one")


@pytest.mark.parametrize("coefficient", [None, 0.0, 1.2, -1.0, math.nan, "hutchinson"])
def test_the_shear_coefficient_is_explicit(coefficient):
    [line] = refusal(bar(), shear_coefficient=coefficient)
    assert f"shear_coefficient = {coefficient!r} must be in (0, 1] or 'cowper'" in line
    assert euler([bar()], shear_coefficient=coefficient).theory == "euler-bernoulli"
