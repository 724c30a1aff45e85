"""Responses of a shaft line against closed forms, and what they owe one another."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_parts import Disc, Section
from wearstate.sim.beam.modes import modes
from wearstate.sim.beam.rotor import Rotor, Support, Unbalance, unbalance_response
from wearstate.sim.shaft_response.places import dofs
from wearstate.sim.shaft_response.receptance import accelerance, receptance
from wearstate.sim.shaft_response.reduced import free_basis, reduce_rotor
from wearstate.sim.shaft_response.time_response import (
    Broadband,
    Harmonic,
    Transient,
    harmonic_response,
    time_response,
)

STEEL = {"young": 2.06e11, "shear_modulus": 7.92e10, "density": 7850.0}
FILM = {
    "stiffness": np.array([[8e7, 3e7], [-2e7, 1.2e8]]),
    "damping": np.array([[4e5, -1e5], [-1e5, 6e5]]),
}
TILTED = {
    "stiffness": np.array(
        [[8e7, 3e7, 2e6, 0], [-2e7, 1.2e8, 0, 1e6], [1e6, 0, 9e5, 2e5], [0, 3e6, -1e5, 1e6]]
    ),
    "damping": np.diag([4e5, 6e5, 5e3, 6e3]),
}
PEDESTAL = {
    "housing_mass": 300.0,
    "pedestal_stiffness": (4e8, 2e8),
    "pedestal_damping": (2e4, 4e4),
}
STATIONS = (1.0, 3.0, 3.5, 8.0)  # two of them neighbours on the coarse mesh


def shaft(theory="timoshenko", element=0.5, discs=True):
    propeller = Disc(station=0.0, mass=2000.0, polar_inertia=600.0, diametral_inertia=400.0)
    return assemble_beam(
        [
            Section(length=6.0, outer_diameter=0.3, **STEEL),
            Section(length=4.0, outer_diameter=0.25, inner_diameter=0.1, **STEEL),
        ],
        discs=[propeller] if discs else [],
        stations=STATIONS,
        longest_element=element,
        theory=theory,
        shear_coefficient="cowper" if theory == "timoshenko" else None,
    )


def line(film=FILM, pedestal=PEDESTAL, damping_ratio=0.0, **beam):
    names = "abcd"
    return Rotor(
        beam=shaft(**beam),
        supports=[
            Support(name=name, station=station, **film, **pedestal)
            for name, station in zip(names, STATIONS, strict=True)
        ],
        damping_ratio=damping_ratio,
        damping_band=(1.0, 100.0) if damping_ratio else None,
    )


def symmetric(film):
    return {key: (value + value.T) / 2 for key, value in film.items()}


def everywhere(rotor):
    """Places of all kinds: both planes, slopes, housings, the ends, a node of no support."""
    n = rotor.beam.n_dof
    housed = [("a", "y", "housing"), ("d", "z", "housing")] if rotor.mass.shape[0] > n else []
    return [0, 3, n - 4, ("b", "y"), ("c", "slope_z"), (5.0, "z"), *housed]


def dense(rotor, frequencies, responses, forces, speed=0.0):
    """By the definition."""
    rows, columns = dofs(rotor, responses), dofs(rotor, forces)
    found = []
    for hertz in frequencies:
        w = 2 * math.pi * hertz
        dynamic = rotor.stiffness - w**2 * rotor.mass + 1j * w * rotor.damping(speed)
        found.append(np.linalg.inv(dynamic.toarray())[np.ix_(rows, columns)])
    return np.array(found)


LINES = np.array([0.5, 3.0, 7.7, 20.0, 55.0, 140.0])


def assert_receptance(found, expected, tolerance):
    """Within the tolerance of the geometric mean of both places' own receptances."""
    own = np.sqrt(np.abs(np.diagonal(expected, axis1=1, axis2=2)))
    scale = own[:, :, None] * own[:, None, :]
    assert_allclose(found / scale, expected / scale, atol=tolerance)


# --- direct


@pytest.mark.parametrize("speed", [0.0, 40.0])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"film": TILTED},
        {"pedestal": {}},
        {"damping_ratio": 0.01},
        {"film": {"stiffness": np.diag([1e8, 2e8])}, "pedestal": {}},  # real spans
        {"theory": "euler-bernoulli"},
    ],
)
def test_direct_is_the_inverse_of_the_dynamic_stiffness(options, speed):
    rotor = line(**options)
    places = everywhere(rotor)
    found = receptance(rotor, LINES, places, places, speed=speed)
    # rounding by the condition of the whole, some 1e5
    assert_receptance(found, dense(rotor, LINES, places, places, speed), 1e-10)


def test_a_housing_alone_is_a_mass_on_a_spring():
    """Magnitude, phase and sign of receptance and accelerance."""
    mass, k, c = 100.0, 100.0 * (2 * math.pi * 10) ** 2, 2 * 0.05 * 100 * 2 * math.pi * 10
    rotor = lone_housing(mass, k, c)
    hertz = np.array([0.01, 1.0, 9.0, 10.0, 11.0, 100.0])
    w = 2 * math.pi * hertz
    expected = 1 / (k - mass * w**2 + 1j * w * c)
    place = [("alone", "y", "housing")]
    found = receptance(rotor, hertz, place, place)[:, 0, 0]
    assert_allclose(found, expected, rtol=1e-13)  # one division
    phase = np.degrees(np.angle(found))
    assert_allclose(phase[[0, 3, 5]], [0, -90, -180], atol=0.6)  # stiffness, resonance, mass
    assert_allclose(1j * w[3] * found[3], 1 / c, rtol=1e-12)  # mobility at resonance
    assert_allclose(
        accelerance(rotor, hertz, place, place)[:, 0, 0], -(w**2) * expected, rtol=1e-13
    )
    far = accelerance(rotor, [1e4], place, place)[0, 0, 0]
    assert_allclose(far, 1 / mass, rtol=2e-4)  # positive; c / (w m) is 1e-4


def lone_housing(mass, k, c):
    """A housing whose film is nothing, beside a shaft that others hold."""
    return Rotor(
        beam=shaft(),
        supports=[
            *(Support(name=f"held{s}", station=s, **FILM) for s in (1.0, 8.0)),
            Support(
                name="alone",
                station=3.0,
                stiffness=np.zeros((2, 2)),
                housing_mass=mass,
                pedestal_stiffness=(k, k),
                pedestal_damping=(c, c),
            ),
        ],
    )


def bishop(hertz, length, diameter):
    """Receptances of a free bar from its tip to the same tip, and to the other."""
    area, second = math.pi * diameter**2 / 4, math.pi * diameter**4 / 64
    bending = STEEL["young"] * second
    wave = (STEEL["density"] * area * (2 * math.pi * hertz) ** 2 / bending) ** 0.25
    x = wave * length
    f3 = math.cos(x) * math.cosh(x) - 1
    f5 = math.cos(x) * math.sinh(x) - math.sin(x) * math.cosh(x)
    f8 = math.sin(x) - math.sinh(x)
    return np.array([-f5, f8]) / (bending * wave**3 * f3)


def test_free_bar_of_bishop_and_johnson():
    """Their table 7.1(c), tips of a free-free bar; a cubic element is of the fourth order."""
    # Bishop, Johnson, The Mechanics of Vibration, Cambridge University Press, 1960
    lines = np.array([3.0, 17.0, 60.0])  # below, between and above the first two bending modes
    exact = np.array([bishop(f, 10.0, 0.2) for f in lines])
    errors = []
    for element in (1.0, 0.5, 0.25):
        beam = assemble_beam(
            [Section(length=10.0, outer_diameter=0.2, **STEEL)],
            longest_element=element,
            theory="euler-bernoulli",
        )
        found = receptance(Rotor(beam=beam), lines, [0, beam.n_dof - 4], [0])[:, :, 0]
        assert np.abs(found.imag).max() == 0
        errors.append(np.abs(found / exact - 1).max())
    assert errors[-1] < 1e-4
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_allclose(order, 4, atol=0.2)  # the next term of the series, a quarter each time


def test_static_limit_is_the_flexibility():
    rotor = line(film=TILTED)
    places = everywhere(rotor)
    found = receptance(rotor, [0.0], places, places)[0]
    rows = dofs(rotor, places)
    expected = np.linalg.inv(rotor.stiffness.toarray())[np.ix_(rows, rows)]
    assert_receptance(found[None], expected[None], 1e-10)  # condition 1e5
    near = receptance(rotor, [1e-4], places, places)[0]
    assert_receptance(near[None], expected[None], 1e-5)  # damping: w c / k = 6e-4 * 0.005


@pytest.mark.parametrize("damping_ratio", [0.0, 0.005])
def test_reciprocity_at_rest_on_symmetric_supports(damping_ratio):
    rotor = line(film=symmetric(TILTED), damping_ratio=damping_ratio)
    places = everywhere(rotor)
    found = receptance(rotor, np.linspace(0.5, 500, 2000), places, places)
    largest = np.abs(found).max(axis=(1, 2), keepdims=True)
    assert np.abs((found - found.swapaxes(1, 2)) / largest).max() < 1e-10  # the contract


def test_reciprocity_with_the_speed_reversed():
    rotor = line(film=symmetric(TILTED))
    places = everywhere(rotor)
    lines = np.linspace(0.5, 200, 300)
    forward = receptance(rotor, lines, places, places, speed=60.0)
    backward = receptance(rotor, lines, places, places, speed=-60.0)
    largest = np.abs(forward).max(axis=(1, 2), keepdims=True)
    assert np.abs((forward - backward.swapaxes(1, 2)) / largest).max() < 1e-10
    assert np.abs((forward - forward.swapaxes(1, 2)) / largest).max() > 1e-3  # not of itself


def test_a_span_that_resonates_between_clamped_ends_keeps_its_digits():
    """Without damping a pivot of the elimination vanishes there; row exchange is called for."""
    rotor = line(pedestal={}, film={"stiffness": np.diag([1e8, 2e8])})
    places = [("a", "y"), ("d", "y")]
    span = rotor.beam.stations[(rotor.beam.stations >= 3.5) & (rotor.beam.stations <= 7.5)]
    inner = 4 * np.array([rotor.beam.node(s) for s in span[1:-1]])
    inner = np.sort(np.concatenate([inner, inner + 1]))
    cut = [a[inner][:, inner].toarray() for a in (rotor.stiffness, rotor.mass)]
    lowest = np.sqrt(np.linalg.eigvals(np.linalg.solve(cut[1], cut[0])).real.min())
    hertz = lowest / (2 * math.pi) * (1 + np.array([-1e-6, 0.0, 1e-9]))
    found = receptance(rotor, hertz, places, places)
    # without exchange 1e-3 and worse
    assert_receptance(found, dense(rotor, hertz, places, places), 1e-9)


def test_speed_of_each_line_is_that_line_s():
    rotor = line()
    speeds = 2 * math.pi * LINES
    together = receptance(rotor, LINES, [("a", "y")], [0], speed=speeds)
    apart = [
        receptance(rotor, [f], [("a", "y")], [0], speed=s)[0]
        for f, s in zip(LINES, speeds, strict=True)
    ]
    assert_allclose(together, apart, rtol=1e-12)  # the same sums


def test_synchronous_response_is_that_of_the_unbalance():
    rotor = line()
    speeds = np.array([20.0, 60.0])
    mass = Unbalance(station=0.0, moment=2.0, phase=0.3)
    expected = unbalance_response(rotor, speeds, [mass])
    for k, speed in enumerate(speeds):
        force = 2.0 * speed**2 * np.exp(0.3j)
        turning = Harmonic(
            frequency=speed / (2 * math.pi), forces={(0.0, "y"): force, (0.0, "z"): -1j * force}
        )
        places = [("a", "y"), ("a", "z"), ("d", "y", "housing")]
        found = harmonic_response(rotor, [turning], places, speed=speed)[0]
        rows = dofs(rotor, places)
        assert_allclose(found, expected[k, rows], rtol=1e-9)  # two solvers of one system


def test_a_force_that_turns_in_round_supports_makes_a_circle():
    rotor = line(film={"stiffness": 1e8 * np.eye(2), "damping": 1e5 * np.eye(2)}, pedestal={})
    turning = Harmonic(frequency=4.0, forces={(0.0, "y"): 100.0, (0.0, "z"): -100.0j})
    y, z = harmonic_response(rotor, [turning], [("b", "y"), ("b", "z")], speed=30.0)[0]
    assert_allclose(z / y, -1j, rtol=1e-10)


@pytest.mark.parametrize("speed", [0.0, 80.0])
def test_a_force_does_work_on_what_only_dissipates(speed):
    rotor = line(film=symmetric(FILM), damping_ratio=0.01)
    places = everywhere(rotor)
    hertz = np.linspace(1, 300, 400)
    found = receptance(rotor, hertz, places, places, speed=speed)
    found *= 2j * math.pi * hertz[:, None, None]  # mobility
    hermitian = (found + found.conj().swapaxes(1, 2)) / 2
    power = np.linalg.eigvalsh(hermitian)
    # >= 0 for every pattern of forces; rounding of the largest
    assert power.min() >= -1e-12 * power.max()


def test_poles_stand_where_the_rotor_has_its_modes():
    rotor = line(damping_ratio=0.01)
    basis = free_basis(rotor.beam, limit_hz=2000.0, stations=STATIONS)
    own = reduce_rotor(rotor, basis, speed=40.0).poles
    expected = modes(rotor, speed=40.0, count=6).eigenvalues
    for pole in expected:
        assert np.abs(own - pole).min() < 1e-6 * abs(pole)  # of the basis, measured 1e-9


# --- modal


def basis_of(beam, n_modes, **options):
    """As free_basis, of a number of modes."""
    first, last = free_basis(beam, limit_hz=20_000.0).frequency_hz[n_modes - 1 : n_modes + 1]
    basis = free_basis(beam, limit_hz=(first + last) / 2, **options)
    assert basis.n_modes == n_modes
    return basis


def modal_error(n_modes, residual, hertz):
    """Of the tip's receptance on two springs."""
    beam = assemble_beam(
        [Section(length=10.0, outer_diameter=0.2, **STEEL)],
        stations=[3.0, 7.0],
        longest_element=0.1,
        theory="euler-bernoulli",
    )
    springs = [
        Support(name=f"at{s}", station=s, stiffness=1e6 * np.eye(2), damping=1e3 * np.eye(2))
        for s in (3.0, 7.0)
    ]
    forced = [0.0, 3.0, 7.0] if residual else []
    basis = basis_of(beam, n_modes, stations=forced, slopes=False)
    reduced = reduce_rotor(Rotor(beam=beam, supports=springs), basis)
    return reduced.measured_error([hertz], [0], [0])


@pytest.mark.parametrize(
    ("residual", "expected", "counts"), [(False, -3, (8, 32)), (True, -11, (5, 12))]
)
def test_modal_error_falls_with_the_modes_kept(residual, expected, counts):
    # sum over the modes out of 1 / w_k^2, or 1 / w_k^6, with w_k as (k - 3/2)^2
    first, last = (modal_error(n, residual, 30.0) for n in counts)
    slope = math.log(last / first) / math.log((counts[1] - 1) / (counts[0] - 1))
    assert_allclose(slope, expected, rtol=0.15)  # the sum begins at a mode, not at infinity


def test_modal_error_is_what_it_is_measured_to_be():
    rotor = line(film=TILTED)
    places = everywhere(rotor)
    lines = np.linspace(1, 60, 40)
    basis = basis_of(rotor.beam, 6, stations=[0.0, *STATIONS, 5.0, 10.0])
    reduced = reduce_rotor(rotor, basis, speed=40.0)
    found = reduced.receptance(lines, places, places)
    exact = dense(rotor, lines, places, places, 40.0)
    expected = np.abs(found - exact).max(axis=(1, 2)) / np.abs(exact).max(axis=(1, 2))
    measured = reduced.measured_error(lines, places, places)
    assert_allclose(measured, expected.max(), rtol=1e-3, atol=1e-10)
    assert measured > 1e-8  # there is one to be measured


@pytest.mark.parametrize("speed", [0.0, 40.0])
@pytest.mark.parametrize("film", [FILM, TILTED])
def test_modal_comes_to_the_direct(film, speed):
    rotor = line(film=film, damping_ratio=0.01)
    places = everywhere(rotor)
    lines = np.linspace(0.5, 60, 30)
    basis = basis_of(rotor.beam, 30, stations=[0.0, *STATIONS, 5.0, 10.0])
    found = reduce_rotor(rotor, basis, speed=speed).receptance(lines, places, places)
    expected = receptance(rotor, lines, places, places, speed=speed)
    assert_receptance(found, expected, 1e-5)  # of places without residual shape; measured 2e-7


def test_one_basis_serves_other_films():
    rotor = line()
    basis = free_basis(rotor.beam, limit_hz=600.0, stations=[0.0, *STATIONS])
    lines, places = np.linspace(1, 60, 7), [0, ("a", "y"), ("b", "y", "housing")]
    for stiffer in (1.0, 0.2, 5.0):
        other = line(film={key: stiffer * value for key, value in TILTED.items()})
        reduced = reduce_rotor(other, basis, speed=10.0)
        assert reduced.measured_error(lines, places, places) < 1e-5  # measured below 1e-6


# --- in time


def reduced_line(**options):
    rotor = line(**{"damping_ratio": 0.01, **options})
    basis = free_basis(rotor.beam, limit_hz=500.0, stations=[0.0, *STATIONS])
    return reduce_rotor(rotor, basis, speed=20.0)


def gaussian(t, centre, width):
    return np.exp(-((t - centre) ** 2) / (2 * width**2))


@pytest.mark.parametrize("zeta", [0.05, 1.5])  # a pair of poles, two real ones
@pytest.mark.parametrize("centre", [0.1, 3.0])  # the motion goes on past the end, or ends before
def test_a_blow_rings_as_the_closed_form(zeta, centre):
    """The pulse's spectrum at the poles, once the pulse is over."""
    mass, w0 = 100.0, 2 * math.pi * 10
    rotor = lone_housing(mass, mass * w0**2, 2 * zeta * mass * w0)
    reduced = reduce_rotor(rotor, free_basis(rotor.beam, limit_hz=200.0, stations=STATIONS))
    fs, n, width = 1000.0, 3500, 5e-3
    t = np.arange(n) / fs
    place = ("alone", "z", "housing")
    blow = Transient(samples=1e3 * gaussian(t, centre, width), forces={place: 1.0})
    found = time_response(
        reduced,
        [place, place, place, (1.0, "y")],
        n_samples=n,
        sample_rate=fs,
        quantity=["displacement", "velocity", "acceleration", "displacement"],
        transients=[blow],
    )
    root = np.sqrt(complex(zeta**2 - 1))
    poles = w0 * np.array([-zeta + root, -zeta - root])
    after = t > centre + 8 * width  # the pulse is 1e-14 there
    ringing = np.exp(np.outer(poles, t[after] - centre) + (poles[:, None] * width) ** 2 / 2)
    ringing *= 1e3 * width * math.sqrt(2 * math.pi) / (mass * (poles[0] - poles[1]))
    for k in range(3):
        expected = (poles**k * [1, -1] @ ringing).real
        # rounding of the sums over some 60 poles
        bound = 1e-10 * np.abs(found[k]).max()
        assert_allclose(found[k, after], expected, atol=bound)
        assert np.abs(found[k, t < centre - 8 * width]).max() < bound
    # nothing joins the housing to the shaft
    assert np.abs(found[3]).max() < 1e-12 * np.abs(found[0]).max()


def test_work_of_a_blow_is_dissipated_or_still_there():
    reduced = reduced_line(element=1.0)
    rotor = reduced.rotor
    fs, n = 4000.0, 1600
    t = np.arange(n) / fs
    samples = 1e4 * gaussian(t, 0.03, 3e-3)
    everything = list(range(rotor.n_dof))
    both = [
        time_response(
            reduced,
            everything,
            n_samples=n,
            sample_rate=fs,
            quantity=quantity,
            transients=[Transient(samples=samples, forces={(0.0, "y"): 1.0})],
        )
        for quantity in ("displacement", "velocity")
    ]
    q, v = both
    work = np.cumsum(samples * v[rotor.dof(0.0, "y")]) / fs
    # the cross stiffness of the film feeds or takes energy too
    symmetric_part = (rotor.stiffness + rotor.stiffness.T) / 2
    circulating = rotor.stiffness - symmetric_part
    power = np.sum(v * (rotor.damping(20.0) @ v + circulating @ q), axis=0)
    lost = (np.cumsum(power) - power / 2) / fs
    stored = np.sum(v * (rotor.mass @ v) + q * (symmetric_part @ q), axis=0) / 2
    late = t > 0.06
    assert stored[late].max() > 0.1 * work[late].max()  # something is left to be checked
    # trapezia over a free motion of up to 500 Hz at 4 kHz
    assert_allclose((lost + stored)[late], work[late], rtol=1e-4)


def test_steady_harmonics_are_the_transfer_function_times_the_force():
    reduced = reduced_line()
    places = [("a", "y", "housing"), ("d", "z"), (0.0, "y")]
    fs, n, hertz = 800.0, 400, 7.3
    force = 50.0 - 20.0j
    forces = {(0.0, "y"): force, ("b", "z"): 30.0j}
    found = time_response(
        reduced,
        places,
        n_samples=n,
        sample_rate=fs,
        quantity="acceleration",
        harmonics=[Harmonic(frequency=hertz, forces=forces)],
    )
    gain = receptance(reduced.rotor, [hertz], places, list(forces), speed=20.0)[0]
    w = 2 * math.pi * hertz
    phasor = -(w**2) * gain @ np.array(list(forces.values()))
    expected = (phasor[:, None] * np.exp(1j * w * np.arange(n) / fs)).real
    # of the basis, up to 500 Hz for 7 Hz
    assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_a_steady_force_gives_the_static_deflection():
    reduced = reduced_line()
    found = time_response(
        reduced,
        [("b", "y")],
        n_samples=5,
        sample_rate=100.0,
        quantity="displacement",
        harmonics=[Harmonic(frequency=0.0, forces={(0.0, "y"): -1e4})],
    )
    expected = -1e4 * receptance(reduced.rotor, [0.0], [("b", "y")], [0]).real.item()
    assert_allclose(found, expected, rtol=1e-7)  # exact in the basis, up to its rounding


def test_a_periodic_transient_settles_to_the_harmonic():
    reduced = reduced_line(damping_ratio=0.05)
    slowest = -reduced.poles.real.max()
    fs, hertz = 400.0, 12.5
    n = int(fs * 25 / slowest)
    t = np.arange(n) / fs
    kw = {"n_samples": n, "sample_rate": fs, "quantity": "displacement"}
    driven = time_response(
        reduced,
        [("a", "y")],
        transients=[Transient(samples=np.sin(2 * math.pi * hertz * t), forces={(0.0, "y"): 1.0})],
        **kw,
    )[0]
    steady = time_response(
        reduced,
        [("a", "y")],
        harmonics=[Harmonic(frequency=hertz, forces={(0.0, "y"): -1j})],
        **kw,
    )[0]
    middle = slice(int(0.8 * n), int(0.9 * n))
    # 20 time constants are 2e-9; the force's end rings, 1e-6 at 240 samples from it (measured)
    assert_allclose(driven[middle], steady[middle], atol=3e-6 * np.abs(steady).max())
    assert np.abs(driven - steady)[: n // 50].max() > 0.01 * np.abs(steady).max()


def test_random_response_has_the_density_of_the_force_times_the_gain():
    reduced = reduced_line()
    fs, n = 400.0, 200_000
    band = ([10.0, 60.0], [4.0, 4.0])
    source = Broadband(
        frequencies=band[0], density=band[1], forces={(0.0, "y"): 1.0, ("b", "z"): -0.5}
    )
    found = time_response(
        reduced, [("a", "y")], n_samples=n, sample_rate=fs, broadband=[source], seed=7
    )[0]
    edges = np.linspace(12, 58, 13)
    spectrum = np.abs(np.fft.rfft(found)) ** 2 * 2 / (fs * n)
    hertz = np.fft.rfftfreq(n, 1 / fs)
    gain = accelerance(reduced.rotor, hertz[::20], [("a", "y")], [0, ("b", "z")], speed=20.0)
    expected = 4.0 * np.interp(hertz, hertz[::20], np.abs(gain[:, 0] @ np.array([1.0, -0.5])) ** 2)
    for low, high in pairwise(edges):
        lines = (hertz >= low) & (hertz < high)
        # the mean of 1900 lines scatters by at most 1/sqrt(their effective number), 2.3 to 7 %
        assert_allclose(spectrum[lines].sum(), expected[lines].sum(), rtol=0.25)
    inside = (hertz >= 12) & (hertz <= 58)
    ratio = (spectrum[inside] / expected[inside]).mean()
    assert_allclose(ratio, 1, atol=0.03)  # 4.5 sigma of 23 000 exponential deviates
    outside = (hertz > 80) | ((hertz < 5) & (hertz > 0))
    assert spectrum[outside].max() < 1e-3 * spectrum[inside].max()  # what cutting a record leaks


def test_random_forces_repeat_with_the_seed_and_are_independent():
    reduced = reduced_line()
    source = Broadband(frequencies=[5, 50], density=[1.0, 1.0], forces={(0.0, "y"): 1.0})

    def run(seed, *sources):
        return time_response(
            reduced, [0], n_samples=20_000, sample_rate=200.0, broadband=sources, seed=seed
        )[0]

    first, both = run(1, source), run(1, source, source)
    assert_allclose(first, run(1, source), rtol=0, atol=0)
    second = both - first  # the other stream alone
    # of two independent records of 100 s, whose narrowest peak is some 0.5 Hz wide: 0.1
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.3
    assert abs(np.corrcoef(first, run(2, source))[0, 1]) < 0.3
    assert_allclose(second.std(), first.std(), rtol=0.5)


def test_kinds_of_forces_add():
    reduced = reduced_line()
    t = np.arange(500) / 500.0
    kinds = {
        "harmonics": [Harmonic(frequency=20.0, forces={0: 1.0})],
        "broadband": [Broadband(frequencies=[1, 90], density=[1, 2], forces={2: 1.0})],
        "transients": [Transient(samples=gaussian(t, 0.3, 0.01), forces={0: 5.0})],
    }
    kw = {"n_samples": 500, "sample_rate": 500.0, "seed": 3}
    together = time_response(reduced, [0, 2], **kinds, **kw)
    apart = [time_response(reduced, [0, 2], **{kind: kinds[kind]}, **kw) for kind in kinds]
    assert min(np.abs(part).max() for part in apart) > 0
    assert_allclose(together, sum(apart), atol=1e-12 * np.abs(together).max())


# --- refusals


def test_a_free_shaft_has_no_static_response():
    rotor = Rotor(beam=shaft())
    with pytest.raises(
        ValueError, match=r"0 Hz must meet a shaft that its supports hold.*add a support"
    ):
        receptance(rotor, [0.0, 1.0], [0], [0])
    assert np.isfinite(receptance(rotor, [1.0], [0], [0])).all()


def test_an_unstable_shaft_is_refused_in_time():
    whirling = {"stiffness": np.array([[1e8, 9e7], [-9e7, 1e8]]), "damping": 1e4 * np.eye(2)}
    rotor = line(film=whirling)
    reduced = reduce_rotor(rotor, basis_of(rotor.beam, 8, stations=STATIONS))
    assert not reduced.stable
    with pytest.raises(ValueError, match=r"growth rate = .* must be < 0: the shaft whirls"):
        time_response(reduced, [0], n_samples=10, sample_rate=100.0)


def test_planes_that_differ_away_from_supports_are_refused():
    beam = shaft()
    uneven = beam.stiffness.toarray()
    at = 4 * beam.node(5.0) + 2
    uneven[at, at] *= 1.01
    rotor = Rotor(
        beam=dataclasses.replace(beam, stiffness=sparse.csc_array(uneven)),
        supports=[Support(name="a", station=1.0, **FILM)],
    )
    with pytest.raises(ValueError, match="stiffness of the shaft differs between its planes"):
        receptance(rotor, [1.0], [0], [0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequencies": [1.0, math.nan]}, "must be one row of finite numbers"),
        ({"frequencies": 1.0}, "must be one row"),
        ({"speed": math.inf}, "speed = inf rad/s must be finite"),
        ({"responses": [10**6]}, "coordinate = 1000000 must be from 0 to"),
        ({"responses": ["a"]}, r"coordinate = 'a' must be .* or a pair"),
        ({"forces": [("nowhere", "y")]}, "nowhere"),
    ],
)
def test_receptance_refuses(change, message):
    arguments = {"frequencies": [1.0, 2.0], "responses": [0], "forces": [0], **change}
    with pytest.raises(ValueError, match=message):
        receptance(line(), **arguments)


def test_a_basis_of_another_beam_is_refused():
    basis = free_basis(shaft(element=1.0), limit_hz=100.0)
    with pytest.raises(ValueError, match="must match the rotor's beam"):
        reduce_rotor(line(), basis)


def test_a_reduced_rotor_answers_at_its_own_speed_only():
    with pytest.raises(ValueError, match=r"must be the reduced rotor's, 20\.0"):
        harmonic_response(
            reduced_line(), [Harmonic(frequency=1.0, forces={0: 1.0})], [0], speed=10.0
        )


def test_all_faults_of_a_record_at_once():
    with pytest.raises(ValueError, match="n_samples") as caught:
        time_response(
            reduced_line(),
            [0],
            n_samples=1,
            sample_rate=-1.0,
            harmonics=[Harmonic(frequency=60.0, forces={0: 1.0})],
            broadband=[
                Broadband(frequencies=[5, 1], density=[1, -1], forces={0: 1.0}),
                Broadband(frequencies=[5], density=[1], forces={0: 1.0}),
            ],
            transients=[Transient(samples=[1.0, math.nan], forces={0: 1.0})],
        )
    text = str(caught.value)
    for part in (
        "n_samples = 1 must be >= 2",
        "sample_rate = -1.0 Hz must be > 0",
        "harmonics[0].frequency = 60.0 Hz",
        "broadband[0].frequencies = 5 ... 1 Hz must rise",
        "broadband[0].density must be >= 0",
        "broadband[1]: frequencies of shape (1,)",
        "transients[0].samples of shape (2,) must be 1 finite numbers",
    ):
        assert part in text


def test_an_amplitude_that_is_no_number_is_refused():
    blow = Harmonic(frequency=1.0, forces={0: 1.0, ("a", "y"): math.nan})
    with pytest.raises(ValueError, match=r"force 0 at \('a', 'y'\) = .*nan.* must be finite"):
        harmonic_response(line(), [blow], [0])


def test_no_force_moves_nothing():
    still = time_response(reduced_line(), [0, 1], n_samples=8, sample_rate=10.0)
    assert (still == 0).all()
    assert harmonic_response(line(), [], [0, 1]).shape == (0, 2)
    empty = Harmonic(frequency=1.0, forces={})
    assert (harmonic_response(line(), [empty], [0, 1]) == np.zeros((1, 2))).all()


@pytest.mark.parametrize("quantity", ["speed", ["velocity"], ["velocity", "jerk"]])
def test_an_unknown_quantity_is_refused(quantity):
    with pytest.raises(ValueError, match="must be one of displacement, velocity, acceleration"):
        time_response(reduced_line(), [0, 1], n_samples=4, sample_rate=10.0, quantity=quantity)
