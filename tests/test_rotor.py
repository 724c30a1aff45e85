"""Rotors against published ones, closed forms, and what energy and symmetry ask of them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import linalg
from wearstate.sim.beam import rotor as rt
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_parts import Disc, Section
from wearstate.sim.beam.campbell import campbell, critical_speeds
from wearstate.sim.beam.modes import modes
from wearstate.sim.beam.rotor import Rotor, Support, Unbalance

PI = math.pi
STEEL = {"young": 211e9, "shear_modulus": 81.2e9, "density": 7810.0}
RPM_4000 = 4000 * PI / 30


def bar(length=1.5, outer_diameter=0.05, **other):
    return Section(length=length, outer_diameter=outer_diameter, **{**STEEL, **other})


def wheel(station, width, outer, inner=0.05):
    mass = STEEL["density"] * PI / 4 * (outer**2 - inner**2) * width
    square = outer**2 + inner**2
    return Disc(
        station=station,
        mass=mass,
        polar_inertia=mass / 8 * square,
        diametral_inertia=mass / 48 * (3 * square + 4 * width**2),
    )


def friswell(stiffness, damping=None, *, elements=6, discs=None, stations=(0.0, 1.5)):
    """The shaft of examples 5.9.1 to 5.9.5; stiffness in the order y, z."""
    if discs is None:
        discs = [wheel(0.5, 0.07, 0.28), wheel(1.0, 0.07, 0.35)]
    beam = assemble_beam(
        [bar()], discs=discs, longest_element=1.5 / elements, shear_coefficient="cowper"
    )
    return Rotor(beam=beam, supports=[bearing(s, stiffness, damping) for s in stations])


def bearing(station, stiffness, damping=None, **other):
    return Support(
        name=f"at {station:g}", station=station, stiffness=stiffness, damping=damping, **other
    )


EVEN = 1e6 * np.eye(2)
HERTZ = 2 * PI


# --- published rotors


@pytest.mark.parametrize(
    ("name", "stiffness", "speed", "printed"),
    [
        ("5.9.1", EVEN, 0.0, [86.66, 86.66, 274.31, 274.31, 716.78, 716.78]),
        ("5.9.1", EVEN, RPM_4000, [85.39, 87.80, 251.78, 294.71, 600.18, 827.08]),
        ("5.9.2", np.diag([0.8e6, 1e6]), 0.0, [82.65, 86.66, 254.52, 274.31, 679.49, 716.79]),
        (
            "5.9.2",
            np.diag([0.8e6, 1e6]),
            RPM_4000,
            [82.33, 86.86, 239.64, 287.25, 583.49, 806.89],
        ),
        (
            "5.9.3",
            np.diag([0.2e6, 1e6]),
            RPM_4000,
            np.array([8.545, 13.77, 22.35, 44.06, 78.76, 120.4]) * HERTZ,
        ),
        (
            "5.9.4",
            np.array([[1e6, 0.5e6], [0.5e6, 1e6]]),
            0.0,
            np.array([11.66, 14.80, 33.97, 49.19, 97.97, 126.61]) * HERTZ,
        ),
    ],
)
def test_natural_frequencies_of_friswell(name, stiffness, speed, printed):
    found = modes(friswell(stiffness), speed, 6)
    # printed to four digits, of a program with other rounding of its inertias
    assert_allclose(found.frequency_hz * HERTZ, printed, rtol=3e-4, err_msg=name)
    assert_allclose(found.damping_ratio, 0.0, atol=1e-12)


def test_damped_rotor_of_friswell():
    rotor = friswell(EVEN, 3e3 * np.eye(2))
    found = modes(rotor, count=6)
    printed = np.repeat([13.91, 48.18, 137.06], 2)
    assert_allclose(found.undamped_frequency_hz, printed, rtol=5e-4)  # four digits, one rounded up
    assert_allclose(found.frequency_hz, np.repeat([13.89, 46.54, 103.22], 2), rtol=2e-4)
    found = modes(rotor, RPM_4000, 5)
    # behind the axial mode at 103.52, which a bending model has not
    printed = [13.70, 14.09, 43.61, 52.18, 122.37]
    assert_allclose(found.undamped_frequency_hz, printed, rtol=3e-4)
    assert found.direction == ("backward", "forward", "backward", "forward", "backward")
    assert (found.damping_ratio > 0.02).all()
    zeta = found.damping_ratio
    assert_allclose(found.log_decrement, HERTZ * zeta / np.sqrt(1 - zeta**2), rtol=1e-14)
    bare = found.undamped_frequency_hz
    assert_allclose(found.frequency_hz, bare * np.sqrt(1 - zeta**2), rtol=1e-12)


def test_overhung_rotor_of_friswell():
    rotor = friswell(1e7 * np.eye(2), discs=[wheel(1.5, 0.07, 0.35)], stations=(0.0, 1.0))
    still = [90.14, 90.14, 630.73, 630.73, 830.43, 830.43]
    assert_allclose(modes(rotor).frequency_hz * HERTZ, still, rtol=1e-4)
    turning = [76.19, 103.91, 565.99, 634.23, 647.75, 1174.2]
    assert_allclose(modes(rotor, RPM_4000).frequency_hz * HERTZ, turning, rtol=1e-4)


def test_mixed_modes_of_soft_supports():
    found = modes(friswell(np.diag([0.2e6, 1e6])), RPM_4000, 6)
    assert found.direction[0] == "backward"
    assert "mixed" in found.direction  # what the example is there to show
    ratios = found.axis_ratio[:, found.direction.index("mixed")]
    assert ratios.min() < -0.01 < 0.01 < ratios.max()


# --- methods


def shaken(seed, elements):
    """A stepped rotor on cross-coupled, damped supports with and without housings."""
    draw = np.random.default_rng(seed)
    sections = [bar(d, 0.04 + 0.04 * d) for d in draw.uniform(0.3, 1.0, 3)]
    length = sum(s.length for s in sections)
    stations = [0.1 * length, 0.5 * length, 0.9 * length]
    supports = []
    for i, station in enumerate(stations):
        size = 4 if i == 1 else 2
        k, c = draw.normal(size=(2, size, size))
        scale = np.diag([1e3, 1e3, 1e2, 1e2][:size])
        housing = {} if i == 0 else {"housing_mass": 8.0, "pedestal_stiffness": (5e6, 8e6)}
        supports.append(
            Support(
                name=str(i),
                station=station,
                stiffness=scale @ (6 * np.eye(size) + k) @ scale,
                damping=1e-3 * scale @ (6 * np.eye(size) + c) @ scale,
                **housing,
            )
        )
    beam = assemble_beam(
        sections,
        discs=[wheel(0.3 * length, 0.05, 0.4), wheel(length, 0.04, 0.3)],
        stations=stations,
        longest_element=length / elements,
        shear_coefficient=0.9,
    )
    return Rotor(beam=beam, supports=supports, damping_ratio=0.003, damping_band=(10.0, 300.0))


def same_modes(a, b):
    assert_allclose(a.undamped_frequency_hz, b.undamped_frequency_hz, rtol=1e-8)
    assert_allclose(a.eigenvalues, b.eigenvalues, atol=1e-8 * np.abs(a.eigenvalues).max())


@pytest.mark.parametrize("seed", range(4))
def test_dense_and_sparse_agree(seed):
    rotor = shaken(seed, 20)
    dense, sparse = (modes(rotor, 200.0, 8, method=m) for m in ("dense", "sparse"))
    same_modes(dense, sparse)
    assert dense.direction == sparse.direction
    # shapes are scaled to one, whatever found them
    assert_allclose(
        np.abs(dense.shapes), np.abs(sparse.shapes), atol=1e-6 * np.abs(dense.shapes).max()
    )


@pytest.mark.parametrize("damping", [None, 3e3 * np.eye(2)])
@pytest.mark.parametrize("elements", [12, 30])
def test_twins_of_a_symmetric_rotor_are_both_found(damping, elements):
    rotor = friswell(EVEN, damping, elements=elements)
    dense, sparse = (modes(rotor, 0.0, 10, method=m) for m in ("dense", "sparse"))
    same_modes(dense, sparse)
    twins = sparse.eigenvalues.reshape(-1, 2)
    assert_allclose(twins[:, 0], twins[:, 1], rtol=1e-8)
    assert sparse.direction == dense.direction == ("planar",) * 10
    y = np.abs(sparse.shapes[0 : rotor.beam.n_dof : 4]).max(axis=0) > 1e-6
    z = np.abs(sparse.shapes[2 : rotor.beam.n_dof : 4]).max(axis=0) > 1e-6
    assert (y ^ z).all()  # one in each plane


def test_eigenpairs_satisfy_the_equations():
    rotor, speed = shaken(7, 10), -150.0
    found = modes(rotor, speed, 8)
    for value, shape in zip(found.eigenvalues, found.shapes.T, strict=True):
        terms = [value**2 * (rotor.mass @ shape), value * (rotor.damping(speed) @ shape)]
        terms.append(rotor.stiffness @ shape)
        # rounding over the stiffest entry
        scale = (np.abs(rotor.stiffness) @ np.abs(shape)).max()
        assert np.abs(sum(terms)).max() < 1e-9 * scale


def test_shapes_have_a_largest_displacement_of_one():
    rotor = shaken(3, 8)
    found = modes(rotor, 100.0, 6)
    moved = found.shapes[0 : rotor.beam.n_dof : 2]
    at = np.abs(moved).argmax(axis=0)
    assert_allclose(moved[at, np.arange(6)], 1.0, atol=1e-12)


# --- free shafts


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_rigid_motions_are_zero(method):
    beam = assemble_beam(
        [bar()], discs=[wheel(0.7, 0.07, 0.35)], longest_element=0.1, shear_coefficient="cowper"
    )
    still = modes(Rotor(beam=beam), 0.0, 6, method=method)
    assert (still.eigenvalues[:4] == 0).all()
    assert still.frequency_hz[4] > 50
    turning = modes(Rotor(beam=beam), 300.0, 5, method=method)
    assert (turning.eigenvalues[:3] == 0).all()  # the fourth has become precession
    for found, count in ((still, 4), (turning, 3)):
        force = beam.stiffness @ found.shapes[:, :count]
        assert np.abs(force).max() < 1e-9 * abs(beam.stiffness).max()
        assert np.linalg.matrix_rank(found.shapes[:, :count]) == count
    assert turning.stable
    assert turning.real_eigenvalues.size == 0


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_shaft_on_one_pin_swings(method):
    beam = assemble_beam([bar()], longest_element=0.1, theory="euler-bernoulli")
    pin = bearing(0.0, 1e12 * np.eye(2))
    found = modes(Rotor(beam=beam, supports=[pin]), 0.0, 4, method=method)
    assert (found.eigenvalues[:2] == 0).all()
    s = bar()
    exact = (3.926602312 / 1.5) ** 2 * math.sqrt(s.bending_stiffness / (s.density * s.area))
    # (3.93 / 15)^4 / 1440 = 3e-6 of the frequency
    assert_allclose(found.frequency_hz[2:] * HERTZ, exact, rtol=1e-5)
    turned = modes(Rotor(beam=beam, supports=[pin]), 50.0, 4, method=method)
    assert_allclose(turned.frequency_hz, found.frequency_hz, rtol=1e-6)  # nothing to precess


@pytest.mark.parametrize("ratio", [0.3, 1.9])
def test_a_free_spinning_disc_precesses(ratio):
    speed, diametral = 90.0, 2.0
    light = bar(0.2, 0.05, density=1e-3)
    disc = Disc(
        station=0.1, mass=10.0, polar_inertia=ratio * diametral, diametral_inertia=diametral
    )
    beam = assemble_beam([light], discs=[disc], theory="euler-bernoulli")
    found = modes(Rotor(beam=beam), speed, 4)
    # Id a'' + Ip Omega b' = 0; the shaft weighs 4e-8 of the disc
    assert_allclose(found.eigenvalues[3], 1j * ratio * speed, rtol=1e-6)
    assert found.direction[3] == "forward"
    assert modes(Rotor(beam=beam), -speed, 4).direction[3] == "backward"


# --- gyroscopics


def test_turning_the_other_way_swaps_the_whirl():
    rotor = friswell(EVEN)
    one, other = modes(rotor, RPM_4000, 6), modes(rotor, -RPM_4000, 6)
    assert_allclose(one.eigenvalues, other.eigenvalues, rtol=1e-10, atol=1e-8)
    assert one.direction == ("backward", "forward") * 3
    assert other.direction == ("forward", "backward") * 3
    assert_allclose(one.forward_share, [0, 1] * 3, atol=1e-9)
    assert_allclose(other.forward_share, [1, 0] * 3, atol=1e-9)
    assert_allclose(np.abs(one.axis_ratio).min(axis=0), 1.0, atol=1e-6)  # circles everywhere


def test_the_split_is_even_at_low_speed():
    rotor = friswell(EVEN)
    still = modes(rotor, 0.0, 6).frequency_hz[::2]
    skews = []
    for speed in (8.0, 4.0):
        pairs = modes(rotor, speed, 6).frequency_hz.reshape(-1, 2)
        assert (pairs[:, 0] < still).all()
        assert (still < pairs[:, 1]).all()
        skews.append(pairs.mean(axis=1) - still)
    # the split is odd in the speed, so the mean moves with its square
    assert_allclose(np.log2(skews[0] / np.array(skews[1])), 2.0, atol=0.02)


def test_a_disc_on_a_pinned_shaft_in_closed_form():
    """At the middle, symmetric: translation and tilt part, tilt on 12 E I / L."""
    s, speed = bar(1.0, 0.02, density=1e-3), 500.0
    disc = Disc(station=0.5, mass=5.0, polar_inertia=0.06, diametral_inertia=0.04)
    beam = assemble_beam([s], discs=[disc], theory="euler-bernoulli")
    ends = [bearing(x, 1e14 * np.eye(2)) for x in (0.0, 1.0)]
    found = modes(Rotor(beam=beam, supports=ends), speed, 4)
    up = math.sqrt(48 * s.bending_stiffness / 5.0)
    half = 0.06 * speed / 2
    root = math.sqrt(half**2 + 0.04 * 12 * s.bending_stiffness)
    expected = sorted([up, up, (root - half) / 0.04, (root + half) / 0.04])
    # supports give by 48 E I / 1e14, the shaft weighs 1e-7 of the disc
    assert_allclose(found.frequency_hz * HERTZ, expected, rtol=1e-6)


# --- supports


BENDS = 1e-5
"""Of a support's stiffness: the rod below gives by up to 3e-6 of it."""


def stiff_body(**supports):
    """A rod that hardly bends, 20 kg, 1 m, on a support at its middle."""
    s = Section(length=1.0, outer_diameter=0.06, young=1e16, shear_modulus=4e15, density=1.0)
    s = Section(**{**s.__dict__, "density": 20.0 / s.area})
    beam = assemble_beam([s], stations=[0.5], theory="euler-bernoulli")
    return Rotor(beam=beam, supports=[Support(name="middle", station=0.5, **supports)])


def test_one_degree_of_freedom():
    k, c, mass = 3e5, 400.0, 20.0
    angular = np.diag([k, 2 * k, 9e4, 9e4])
    damping = np.diag([c, 3 * c, 50.0, 50.0])
    found = modes(stiff_body(stiffness=angular, damping=damping), 0.0, 4)
    inertia = mass / 12
    expected = {
        math.sqrt(k / mass): c / (2 * math.sqrt(k * mass)),
        math.sqrt(2 * k / mass): 3 * c / (2 * math.sqrt(2 * k * mass)),
        math.sqrt(9e4 / inertia): 50.0 / (2 * math.sqrt(9e4 * inertia)),
    }
    pairs = [*expected.items(), list(expected.items())[2]]
    pairs.sort()
    assert_allclose(found.undamped_frequency_hz * HERTZ, [p[0] for p in pairs], rtol=BENDS)
    assert_allclose(found.damping_ratio, [p[1] for p in pairs], rtol=BENDS)
    assert_allclose(
        found.log_decrement, [HERTZ * p / math.sqrt(1 - p * p) for _, p in pairs], rtol=BENDS
    )


def test_housing_on_its_pedestal_in_closed_form():
    k, mass, own, pedestal = 4e5, 20.0, 7.0, (9e5, 3e5)
    rotor = stiff_body(
        stiffness=np.diag([k, k, 1e9, 1e9]), housing_mass=own, pedestal_stiffness=pedestal
    )
    found = modes(rotor, 0.0, 4)
    expected = []
    for below in pedestal:
        two = np.array([[k, -k], [-k, k + below]])
        expected += list(np.sqrt(linalg.eigh(two, np.diag([mass, own]), eigvals_only=True)))
    assert_allclose(found.frequency_hz * HERTZ, sorted(expected), rtol=BENDS)
    assert rotor.n_dof == rotor.beam.n_dof + 2
    up, aside = (rotor.dof("middle", axis, "housing") for axis in "yz")
    assert (up, aside) == (12, 13)
    assert rotor.stiffness[[up], [up]] == k + 9e5
    assert rotor.stiffness[[up], [rotor.dof("middle", "y")]] == -k
    assert rotor.mass[[aside], [aside]] == own


def test_springs_in_series():
    k, below = 4e5, 6e5
    rotor = stiff_body(
        stiffness=np.diag([k, k, 1e9, 1e9]), housing_mass=1e-6, pedestal_stiffness=(below, below)
    )
    series = 1 / (1 / k + 1 / below)
    found = modes(rotor, 0.0, 2).frequency_hz * HERTZ
    assert_allclose(found, math.sqrt(series / 20.0), rtol=1e-6)  # the housing's share 1e-7


def test_moments_and_cross_terms_stand_where_they_belong():
    k = np.arange(1.0, 17.0).reshape(4, 4)
    rotor = stiff_body(
        stiffness=k,
        damping=10 * k,
        housing_mass=2.0,
        pedestal_stiffness=(100.0, 200.0),
        pedestal_damping=(5.0, 6.0),
    )
    names = ("y", "z", "slope_y", "slope_z")
    shaft = [rotor.dof("middle", name) for name in names]
    assert shaft == [4, 6, 5, 7]
    assert shaft == [rotor.dof(0.5, name) for name in names]
    bare = Rotor(beam=rotor.beam)
    added = rotor.stiffness.toarray()
    added[:12, :12] -= bare.stiffness.toarray()
    scale = abs(bare.stiffness).max()
    assert_allclose(added[np.ix_(shaft, shaft)], k, atol=1e-15 * scale)
    damping = rotor.damping().toarray()
    assert_allclose(damping[np.ix_(shaft, shaft)], 10 * k, rtol=1e-14)
    assert_allclose(damping[np.ix_(shaft, [12, 13])], -10 * k[:, :2], rtol=1e-14)
    assert_allclose(damping[np.ix_([12, 13], shaft)], -10 * k[:2], rtol=1e-14)
    assert_allclose(damping[12:, 12:], 10 * k[:2, :2] + np.diag([5.0, 6.0]), rtol=1e-14)
    assert np.count_nonzero(damping) == 36
    # a common motion of shaft and housing strains the pedestal alone
    both = np.zeros(14)
    both[[4, 12]] = 1.0
    strain = np.zeros(14)
    strain[12] = 5.0
    assert_allclose(rotor.damping() @ both, strain, atol=1e-12)


def test_the_shafts_own_damping_is_as_asked():
    beam = assemble_beam([bar()], longest_element=0.1, theory="euler-bernoulli")
    bare = modes(Rotor(beam=beam), 0.0, 10).frequency_hz
    band = (float(bare[4]), float(bare[8]))
    found = modes(Rotor(beam=beam, damping_ratio=0.02, damping_band=band), 0.0, 8)
    elastic = found.undamped_frequency_hz > 0.9 * band[0]
    zeta = dict(
        zip(
            found.undamped_frequency_hz[elastic].round(3), found.damping_ratio[elastic], strict=True
        )
    )
    assert_allclose(zeta[round(band[0], 3)], 0.02, rtol=1e-6)
    assert_allclose(zeta[round(band[1], 3)], 0.02, rtol=1e-6)
    middle = sorted(zeta)[1]
    low, high = band
    expected = 0.02 * (low * high / middle + middle) / (low + high)
    assert_allclose(zeta[middle], expected, rtol=1e-5)
    assert expected < 0.02
    zero = Rotor(beam=beam, damping_ratio=0.02, damping_band=(0.0, high))
    assert_allclose(abs(zero.damping() @ np.tile([1.0, 0, 0, 0], 16)).max(), 0.0, atol=1e-5)


# --- energy


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(-800.0, 800.0),
)
def test_damping_takes_energy_and_rotation_none(seed, speed):
    draw = np.random.default_rng(seed)

    def positive(size):
        root = draw.normal(size=(size, size))
        return root @ root.T + 0.1 * np.eye(size)

    k, c = 1e6 * positive(2), 1e3 * positive(2)
    still = modes(friswell(k), speed, 6)
    # conservative: gyroscopic forces do no work; 1e-9 for rounding over the shift
    assert np.abs(still.eigenvalues.real).max() < 1e-9 * np.abs(still.eigenvalues).max()
    damped = modes(friswell(k, c), speed, 6)
    assert (damped.damping_ratio > 0).all()
    assert damped.stable
    shape, value = damped.shapes[:, 0], damped.eigenvalues[0]
    rotor = friswell(k, c)
    mass = (shape.conj() @ (rotor.mass @ shape)).real
    lost = (shape.conj() @ (rotor.damping() @ shape)).real
    # Re of the quadratic form: 2 a m + c + (spin part) = 0 once divided by Im(lambda)
    spin = (shape.conj() @ ((rotor.damping(speed) - rotor.damping()) @ shape)).imag
    balance = 2 * value.real * mass * value.imag + lost * value.imag + spin * value.real
    assert abs(balance) < 1e-8 * lost * value.imag


def test_cross_coupling_feeds_the_forward_whirl():
    """One rigid mass: lambda^2 m + c lambda + k -+ i kc = 0, unstable from kc = c sqrt(k / m)."""
    k, c, mass = 3e5, 400.0, 20.0
    threshold = c * math.sqrt(k / mass)
    for share, stable in ((0.99, True), (1.01, False)):
        cross = share * threshold
        film = np.diag([k, k, 1e9, 1e9])
        film[0, 1], film[1, 0] = cross, -cross
        rotor = stiff_body(stiffness=film, damping=np.diag([c, c, 1.0, 1.0]))
        found = modes(rotor, 0.0, 2)
        assert found.stable is stable
        forward = found.direction.index("forward")
        exact = np.roots([mass, c, k - 1j * cross])
        exact = exact[exact.imag > 0][0]
        assert_allclose(found.eigenvalues[forward], exact, rtol=BENDS)
        assert (found.damping_ratio[forward] > 0) is np.True_ or not stable


def test_overdone_damping_is_left_out_on_request():
    rotor = friswell(EVEN, 3e3 * np.eye(2), elements=12)
    every = modes(rotor, RPM_4000, 20)
    few = np.flatnonzero(every.damping_ratio <= 0.3)
    assert 0 < few.size < 20
    for method in ("dense", "sparse"):
        some = modes(rotor, RPM_4000, int(few.size), most_damping=0.3, method=method)
        assert_allclose(some.eigenvalues, every.eigenvalues[few], rtol=1e-9)
    table = campbell(rotor, [RPM_4000, 1.1 * RPM_4000], int(few.size), most_damping=0.3)
    assert_allclose(table.eigenvalues[0], every.eigenvalues[few], rtol=1e-9)
    assert np.isinf(table.lost_at).all()


def test_no_slow_mode_is_missed_for_its_damping():
    """Six lightly damped housings lie nearer the shift than the shaft's own slow, damped motion."""
    total, mass, zeta = 6e4, 20.0, 0.95
    s = Section(length=1.0, outer_diameter=0.06, young=1e14, shear_modulus=4e13, density=1.0)
    s = Section(**{**s.__dict__, "density": mass / s.area})
    stations = (0.1, 0.5, 0.9)
    beam = assemble_beam([s], stations=stations, theory="euler-bernoulli")
    film = total / 3 * np.eye(2)
    damping = 2 * zeta * math.sqrt(total * mass) / 3 * np.eye(2)
    housing = {"housing_mass": 1e3, "pedestal_stiffness": (4e7, 4e7)}
    rotor = Rotor(beam=beam, supports=[bearing(x, film, damping, **housing) for x in stations])
    dense, sparse = (modes(rotor, 0.0, 1, method=m) for m in ("dense", "sparse"))
    same_modes(dense, sparse)
    # the housings give by k over their own 4e7, and shake by the shaft's share of their mass
    assert_allclose(sparse.undamped_frequency_hz * HERTZ, math.sqrt(total / mass), rtol=5e-3)
    assert_allclose(sparse.damping_ratio, zeta, rtol=5e-3)


# --- over the speed


def test_modes_are_followed_across_a_crossing():
    rotor = friswell(EVEN)
    speeds = np.linspace(0.0, 3600.0, 10)
    table = campbell(rotor, speeds, 6)
    assert np.isinf(table.lost_at).all()
    assert table.mac.min() > 0.8
    ends = table.direction[-1]
    assert sorted(ends) == ["backward"] * 3 + ["forward"] * 3
    rising = table.frequency_hz[-1] > table.frequency_hz[0]
    # without damping on symmetric supports forward modes rise and backward ones fall
    assert [d == "forward" for d in ends] == list(rising)
    assert (np.diff(table.frequency_hz, axis=0) > 0).all(axis=0).tolist() == list(rising)
    order = np.argsort(table.frequency_hz[-1])
    assert order.tolist() != np.argsort(table.frequency_hz[1]).tolist()  # there was a crossing
    found = modes(rotor, 3600.0, 6)
    assert_allclose(np.sort(table.frequency_hz[-1])[:4], found.frequency_hz[:4], rtol=1e-9)


def test_modes_are_followed_round_a_veering():
    """Two like pendulums, coupled: tuned by the speed, their frequencies come near and part."""
    detuned = 2e5

    def law(speed):
        film = np.diag([3e5 + detuned * speed / 100, 3e5, 1e9, 1e9])
        film[0, 1] = film[1, 0] = 4e3
        return stiff_body(stiffness=film)

    table = campbell(law, [-100.0, 100.0], 2)
    frequency = table.frequency_hz * HERTZ
    for row, side in zip(frequency, (-1, 1), strict=True):
        mean, half = 3e5 + side * detuned / 2, detuned / 2
        root = math.hypot(half, 4e3)
        exact = np.sqrt((mean + np.array([-root, root])) / 20.0)
        assert_allclose(np.sort(row), exact, rtol=BENDS)
    # they do not cross: the lower stays the lower, though it moves from y to z
    assert (np.argsort(frequency[0]) == np.argsort(frequency[1])).all()
    assert table.mac[1].min() > 0.8


def test_an_overdamped_mode_is_reported_lost():
    def law(speed):
        damping = np.diag([6000.0 * speed, 10.0, 10.0, 10.0])
        return stiff_body(stiffness=np.diag([3e5, 4e5, 1e9, 1e9]), damping=damping)

    table = campbell(law, np.linspace(0.0, 1.0, 5), 2)
    critical = 2 * math.sqrt(3e5 * 20.0) / 6000.0
    lost = np.isfinite(table.lost_at)
    assert lost.tolist() == [True, False]
    # halved down to 1/4096 of a quarter; near the end the root's slope is endless
    assert_allclose(table.lost_at[0], critical, atol=2e-3)
    assert np.isnan(table.eigenvalues[-1, 0])
    assert table.direction[-1] == ("lost", "planar")
    assert np.isfinite(table.eigenvalues[:, 1]).all()


@pytest.mark.parametrize("order", [1.0, 3.0])
@pytest.mark.parametrize("stiffness", [EVEN, np.diag([0.2e6, 1e6])])
def test_critical_speeds_are_those_of_the_direct_problem(stiffness, order):
    """K q = Omega^2 (n^2 M - i n G) q, Hermitian."""
    rotor = friswell(stiffness)
    k, m, g = (matrix.toarray() for matrix in (rotor.stiffness, rotor.mass, rotor.gyroscopic))
    inverse = linalg.eigvalsh(order**2 * m - 1j * order * g, k)
    exact = np.sort(1 / np.sqrt(inverse[inverse > 0]))
    highest = 800.0
    found = critical_speeds(rotor, np.linspace(0.0, highest, 21), count=14, order=order)
    assert_allclose(found.speeds, exact[exact < highest], rtol=1e-8)
    assert_allclose(found.damping_ratio, 0.0, atol=1e-10)
    assert len(found.direction) == found.speeds.size


def test_a_damped_critical_speed_in_closed_form():
    k, c = 3e5, 400.0
    film, damping = np.diag([k, 2 * k, 1e9, 1e9]), np.diag([c, c, 1.0, 1.0])
    found = critical_speeds(
        stiff_body(stiffness=film, damping=damping), [0.0, 100.0, 300.0], count=2, order=2.0
    )
    expected = np.sqrt(np.array([k, 2 * k]) / 20.0 - (c / 40.0) ** 2) / 2.0
    assert_allclose(found.speeds, expected, rtol=BENDS)
    assert found.direction == ("planar", "planar")


# --- unbalance


def test_unbalance_of_a_rigid_rotor_in_closed_form():
    k, c, mass, moment, phase = 3e5, 400.0, 20.0, 2e-3, 0.7
    film, damping = np.diag([k, k, 1e9, 1e9]), np.diag([c, c, 1.0, 1.0])
    rotor = stiff_body(stiffness=film, damping=damping)
    speeds = np.array([0.0, 30.0, math.sqrt(k / mass), 400.0])
    found = rt.unbalance_response(
        rotor, speeds, [Unbalance(station=0.5, moment=moment, phase=phase)]
    )
    exact = moment * speeds**2 * np.exp(1j * phase) / (k - mass * speeds**2 + 1j * c * speeds)
    y, z = (found[:, rotor.dof("middle", axis)] for axis in "yz")
    assert_allclose(y, exact, rtol=BENDS, atol=1e-15)
    assert_allclose(z, -1j * exact, rtol=BENDS, atol=1e-15)
    major, minor = rt.orbit_axes(y, z)
    assert_allclose(major, np.abs(exact), rtol=BENDS, atol=1e-15)
    assert_allclose(minor, np.abs(exact), rtol=BENDS, atol=1e-15)  # a forward circle
    # in phase below, square at, against the heavy spot above
    assert_allclose(np.angle(y[2] * np.exp(-1j * phase)), -PI / 2, atol=BENDS)


def test_unbalance_drives_forward_modes_only():
    rotor = friswell(EVEN, 100.0 * np.eye(2))
    critical = critical_speeds(rotor, np.linspace(0, 600.0, 13), count=6)
    unbalance = [Unbalance(station=0.5, moment=1e-3), Unbalance(station=1.0, moment=1e-3)]
    speeds = np.linspace(40.0, 600.0, 1121)
    found = rt.unbalance_response(rotor, speeds, unbalance)
    size = np.abs(found[:, rotor.dof(0.5, "y")])
    peaks = speeds[1:-1][(size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])]
    forward = [
        s for s, d in zip(critical.speeds, critical.direction, strict=True) if d == "forward"
    ]
    assert len(critical.speeds) == len(forward) + 3
    # a step is 0.5 rad/s, the damping moves a peak by its square
    assert_allclose(peaks, forward, atol=1.0)
    backward = np.abs(found[:, 0::4] - 1j * found[:, 2::4]).max()
    assert backward < 1e-9 * size.max()


def test_a_rotor_law_is_asked_at_each_speed():
    def law(speed):
        return stiff_body(stiffness=np.diag([1e5 + 10 * speed**2] * 2 + [1e9] * 2))

    found = rt.unbalance_response(law, [50.0, 200.0], [Unbalance(station=0.5, moment=1.0)])
    # k - m Omega^2 = 1e5 - 10 Omega^2
    assert_allclose(found[:, 4], [50.0**2 / 7.5e4, 200.0**2 / -3e5], rtol=BENDS)


# --- refusals


def test_all_faults_of_a_support_come_at_once():
    with pytest.raises(ValueError, match="must") as caught:
        Support(
            name="aft",
            station=0.0,
            stiffness=np.eye(3),
            damping=np.full((2, 2), np.nan),
            housing_mass=-1.0,
            pedestal_stiffness=(1.0, -2.0),
        )
    lines = str(caught.value).splitlines()
    assert [line.split(": ")[1].split(" ")[0] for line in lines] == [
        "stiffness",
        "damping",
        "damping",
        "housing_mass",
        "pedestal_stiffness",
    ]
    assert all(line.startswith("support 'aft': ") for line in lines)
    assert "along z = -2.0 N/m must be >= 0" in lines[-1]
    with pytest.raises(ValueError, match="housing_mass is missing, must be > 0 with a pedestal"):
        Support(name="a", station=0.0, stiffness=EVEN, pedestal_stiffness=(1.0, 1.0))
    with pytest.raises(ValueError, match="pedestal_stiffness is missing"):
        Support(name="a", station=0.0, stiffness=EVEN, housing_mass=1.0)


def test_all_faults_of_a_rotor_come_at_once():
    beam = friswell(EVEN).beam
    supports = [bearing(0.0, EVEN), bearing(0.0, EVEN), bearing(0.1, EVEN)]
    with pytest.raises(ValueError, match="must") as caught:
        Rotor(beam=beam, supports=supports, damping_ratio=1.0, damping_band=(5.0, 5.0))
    lines = str(caught.value).splitlines()
    assert lines[0] == "support 'at 0' stands 2 times, must be unique; rename one"
    assert lines[1].startswith("support 'at 0.1': station = 0.1 m is no node, the nearest is 0 m")
    assert lines[2].startswith("damping_ratio = 1.0 must be in [0, 1)")
    assert lines[3].startswith("damping_band = (5.0, 5.0) Hz must be 0 <= lower < upper")
    assert len(lines) == 4
    with pytest.raises(ValueError, match="damping_band is missing"):
        Rotor(beam=beam, damping_ratio=0.01)


def test_places_that_are_not_there():
    rotor = friswell(EVEN)
    for arguments, message in (
        (("aft", "y"), "place = 'aft' must be a support: at 0, at 1.5"),
        ((0.0, "y", "pedestal"), "part = 'pedestal' must be one of shaft, housing"),
        (("at 0", "y", "housing"), "must be a support with a housing: there is none"),
        ((0.0, "w"), "coordinate = 'w' must be one of"),
    ):
        with pytest.raises(ValueError, match=message):
            rotor.dof(*arguments)
    housed = stiff_body(stiffness=EVEN, housing_mass=1.0, pedestal_stiffness=(1.0, 1.0))
    with pytest.raises(ValueError, match="coordinate = 'slope_y' of a housing must be y or z"):
        housed.dof("middle", "slope_y", "housing")


def test_arguments_out_of_range():
    rotor = friswell(EVEN)
    with pytest.raises(ValueError, match="finite") as caught:
        modes(rotor, math.inf, 0, method="magic", most_damping=0.0)
    assert len(str(caught.value).splitlines()) == 4
    with pytest.raises(ValueError, match="must be finite and rise or fall throughout"):
        campbell(rotor, [0.0, 2.0, 1.0])
    with pytest.raises(ValueError, match="count = 90 must be <= 28, of modes that oscillate"):
        campbell(rotor, [0.0, 2.0], 90)
    with pytest.raises(ValueError, match=r"order = 0\.0 must be > 0"):
        critical_speeds(rotor, [0.0, 1.0], order=0.0)
    with pytest.raises(ValueError, match="speeds must be >= 0 and finite"):
        rt.unbalance_response(rotor, [-1.0], [])
    with pytest.raises(ValueError, match=r"unbalances\[0\] of moment = inf kg m"):
        rt.unbalance_response(rotor, [1.0], [Unbalance(station=0.0, moment=math.inf)])
