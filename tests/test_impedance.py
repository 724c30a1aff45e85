"""The film as a map: against direct solves on its own mesh, its scales, and its cache."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.sim.film import impedance_map as im
from wearstate.sim.film import map_look_up as look_up
from wearstate.sim.film.direct import direct_force
from wearstate.sim.film.impedance_map import impedance_map
from wearstate.sim.film.map_look_up import map_force, map_peak, map_scales
from wearstate.sim.film.short import short_force
from wearstate.sim.film.solve import FilmGeometry, Groove, direct_film

TURN = 2 * math.pi
SEED_CASE = FilmGeometry(length_to_diameter=2 / 3)
SMALL = {"length_to_diameter": 0.5, "n_theta": 36, "n_z": 9}
QUICK = {"last_eccentricity": 0.9, "accuracy": 0.1}
CONDITIONS = ("guembel", "reynolds", "periodic")


def solved(geometry, x, y, x_rate, y_rate):
    work = direct_film(geometry)
    force = direct_force(work, x, y, x_rate, y_rate)
    return np.array(force), work.pressure.max()


def state(eccentricity, attitude, along, across):
    """Place and rates for a V along and across the line of centres."""
    n_x, n_y = math.cos(attitude), math.sin(attitude)
    x, y = eccentricity * n_x, eccentricity * n_y
    v_x, v_y = along * n_x - across * n_y, along * n_y + across * n_x
    return x, y, v_x - 0.5 * y, v_y + 0.5 * x


def turned(force, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([force[0] * c - force[1] * s, force[0] * s + force[1] * c])


@pytest.fixture(scope="module")
def plain():
    return impedance_map(SEED_CASE)


# --- against the direct film


@pytest.mark.parametrize("condition", CONDITIONS)
def test_map_is_the_direct_film_at_its_knots(condition):
    geometry = FilmGeometry(**SMALL, condition=condition)
    m = impedance_map(geometry, **QUICK, cached=False)
    _, roots, angles = m.knots
    for i in range(0, roots - 2, 7):
        for j in range(0, angles - 2, 9):
            root, angle = 1 - i / m.table.per_root, j / m.table.per_radian
            eccentricity = 1 - root**2
            stretch = math.sqrt(1 - eccentricity**2)
            here = state(eccentricity, 0.0, math.cos(angle), math.sin(angle) / stretch)
            force, peak = solved(geometry, *here)
            # the angle of the look-up is right within 6e-7; the table bends by a few per radian
            assert_allclose(map_force(m.table, *here), force, atol=5e-6 * np.abs(force).max())
            assert map_peak(m.table, *here) == pytest.approx(peak, rel=2e-5)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_stored_error_is_kept_by_other_states(condition):
    geometry = FilmGeometry(length_to_diameter=2 / 3, condition=condition)
    m = impedance_map(geometry)
    assert m.accurate
    assert m.interpolation.median < 3e-4
    random = np.random.default_rng(7)
    errors = []
    for _ in range(600):
        root = random.uniform(m.table.least_root, 1)
        angle = random.uniform(0, TURN)
        stretch = math.sqrt(1 - (1 - root**2) ** 2)
        here = state(1 - root**2, 0.0, math.cos(angle), math.sin(angle) / stretch)
        force, _ = solved(geometry, *here)
        errors.append(np.hypot(*(map_force(m.table, *here) - force)) / np.hypot(*force))
    # thirty states lie above 95 %, which leaves the quantile itself uncertain by a third or so
    assert np.quantile(errors, 0.95) < 1.7 * m.interpolation.most
    assert np.median(errors) < 1.7 * m.interpolation.median


def test_most_of_the_error_is_the_mesh_that_turns(plain):
    """A finer mesh mends what the turn of the journal over the mesh costs."""
    assert plain.turned.most > 3 * plain.interpolation.most
    finer = impedance_map(FilmGeometry(length_to_diameter=2 / 3, n_theta=144))
    assert finer.turned.most < 0.3 * plain.turned.most


def test_peak_pressure(plain):
    random = np.random.default_rng(3)
    errors = []
    for _ in range(100):
        here = state(random.uniform(0, 0.8), random.uniform(0, 7), *random.normal(size=2))
        _, peak = solved(SEED_CASE, *here)
        errors.append(abs(map_peak(plain.table, *here) / peak - 1))
    # the largest node of a mesh of 5 degrees misses the crest by up to (2.5 deg / 25 deg)^2 / 2
    assert max(errors) < 5e-3
    assert np.median(errors) < 1e-3


def test_groove():
    groove = (Groove(angle=1.0, width=0.4),)
    geometry = FilmGeometry(length_to_diameter=0.5, n_z=9, grooves=groove)
    m = impedance_map(geometry, **QUICK, cached=False)
    assert m.knots[0] > 1
    random = np.random.default_rng(5)
    errors, attitude_matters = [], []
    for _ in range(200):
        # velocities as of a journal that turns: the last angles of V pull it off its wall, where
        # the force is a hundredth
        eccentricity, attitude = random.uniform(0.05, 0.8), random.uniform(0, TURN)
        size = 10 ** random.uniform(-2, 2)
        parts = size * random.uniform(-0.3, 1.0), size * random.uniform(-1, 1)
        here = state(eccentricity, attitude, *parts)
        force, _ = solved(geometry, *here)
        errors.append(np.hypot(*(map_force(m.table, *here) - force)) / np.hypot(*force))
        other = state(eccentricity, attitude + 2.0, *parts)
        around = turned(map_force(m.table, *other), -2.0)
        attitude_matters.append(np.hypot(*(around - force)) / np.hypot(*force))
    # 36 x 17 x 32 knots, a fifth of a thousandth at half of the states
    assert np.median(errors) < 5e-4
    assert max(errors) < 0.02
    assert np.median(attitude_matters) > 10 * np.median(errors)


def test_a_worn_bore_has_no_map():
    """Its own wedge does not grow with V, so that no table over directions can hold its force."""
    bore = np.maximum(0.3 - (1 - np.cos(TURN * np.arange(72) / 72 - 1.0)), 0.0)
    geometry = FilmGeometry(length_to_diameter=0.5, n_z=9, bore=bore)
    slow, _ = solved(geometry, *state(0.5, 1.0, 0.0, -0.1))
    fast, _ = solved(geometry, *state(0.5, 1.0, 0.0, -1.0))
    assert np.hypot(*(fast - 10 * slow)) > 0.1 * np.hypot(*fast)
    with pytest.raises(ValueError, match=r"bore spans 0\.29\d+ of the clearance and must be round"):
        impedance_map(geometry)


def test_a_round_bore_is_only_wider():
    wider = impedance_map(FilmGeometry(**SMALL, bore=np.full(36, 0.1)), **QUICK, cached=False)
    here = state(0.6, 0.0, 0.3, -0.2)
    force, _ = solved(FilmGeometry(**SMALL, bore=np.full(36, 0.1)), *here)
    # between knots of the coarsest map
    assert_allclose(map_force(wider.table, *here), force, rtol=5e-3)


# --- what must hold by itself


@given(st.floats(0, math.pi), st.floats(-100, 100))
def test_stretched_angle(angle, decades):
    size = 10**decades
    found = look_up.stretched_angle(size * math.cos(angle), size * math.sin(angle))
    # fitted within 2.7e-7 of the half angle
    assert found == pytest.approx(angle, abs=6e-7)


def test_stretched_angle_is_continuous_where_it_is_joined():
    before, behind = (look_up.stretched_angle(a, 1.0) for a in (1e-12, -1e-12))
    # a jump would be seen by every difference quotient
    assert abs(behind - before) < 1e-11


@given(
    st.floats(1e-3, 0.99), st.floats(0, 6.3), st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 6.3)
)
def test_turned_mirrored_stretched(eccentricity, attitude, along, across, angle):
    table = impedance_map(SEED_CASE).table
    force = np.array(map_force(table, *state(eccentricity, attitude, along, across)))
    size = np.hypot(*force) + 1e-9
    # rounding, more of it towards the wall, where 1 - eccentricity cancels two digits; and of V,
    # a difference of numbers of order one, times a table of up to a thousand
    kept = 1e-10 * size + 1e-12
    around = map_force(table, *state(eccentricity, attitude + angle, along, across))
    assert_allclose(turned(around, -angle), force, atol=kept)
    mirrored = map_force(table, *state(eccentricity, -attitude, along, -across))
    assert_allclose([mirrored[0], -mirrored[1]], force, atol=kept)
    thrice = map_force(table, *state(eccentricity, attitude, 3 * along, 3 * across))
    assert_allclose(thrice, 3 * force, atol=3 * kept)


def test_about_the_centre_no_direction_counts(plain):
    """The table is exact at its knots, so the force there is isotropic as the mesh is."""
    for angle in np.linspace(0, TURN, 17):
        towards = (math.cos(angle), math.sin(angle))
        force = map_force(plain.table, 0.0, 0.0, *towards)
        straight = map_force(plain.table, 0.0, 0.0, 1.0, 0.0)
        # edges of the film lie between nodes 5 degrees apart: second order, (2.5 deg)^2 / 8
        assert_allclose(turned(force, -angle), straight, atol=3e-4 * abs(straight[0]))


def test_nothing_moves_nothing_pushes(plain):
    assert plain.force(0.0, 0.0) == (0.0, 0.0)
    assert map_peak(plain.table, 0.0, 0.0, 0.0, 0.0) == 0.0


@pytest.mark.parametrize("gap", [1e-2, 1e-3])
def test_scale_is_the_squeeze_of_a_short_film_near_the_wall(gap):
    """In closed form: the ratio tends to one as the gap closes, with an error of its order."""
    ratio = 0.001  # so short that the long film does not count
    table = im._blank_table(FilmGeometry(length_to_diameter=ratio), (1, 33, 49), 0.9999)
    _, _, scale = map_scales(table, 1 - gap)
    x = 1 - gap
    f_x, _ = short_force(ratio, x, 0.0, 1.0, 0.5 * x)  # V = (1, 0)
    # the long film still takes 2 g (D/L)^2 from it, 5e-5 at the smaller gap
    assert f_x / scale == pytest.approx(-1, abs=1.5 * gap)


@pytest.mark.parametrize("gap", [0.02, 0.01])
def test_scale_is_the_squeeze_of_a_long_film_near_the_wall(gap):
    geometry = FilmGeometry(length_to_diameter=100.0, n_theta=1440, n_z=5)
    table = im._blank_table(geometry, (1, 33, 49), 0.9999)
    _, _, scale = map_scales(table, 1 - gap)
    x = 1 - gap
    force, _ = solved(geometry, x, 0.0, 1.0, 0.5 * x)
    # the trapezoidal rule over five nodes, whose ends are at zero pressure, leaves three quarters
    assert force[0] / (0.75 * scale) == pytest.approx(-1, abs=1.5 * gap)


@pytest.mark.parametrize(
    ("ends", "function"),
    [
        ("free", lambda x: np.exp(x) * np.sin(5 * x)),
        ("even", lambda x: np.cos(math.pi * x) + np.cos(3 * math.pi * x)),
        ("odd", lambda x: np.sin(math.pi * x) + np.sin(TURN * x)),
        ("periodic", lambda x: np.exp(np.sin(TURN * x))),
    ],
)
def test_splines_are_of_fourth_order(ends, function):
    def error(n):
        cells = n if ends == "periodic" else n - 1
        c = im._spline_coefficients(function(np.arange(n) / cells), 0, ends)
        x = np.linspace(0, 1, 997)
        i = np.minimum((x * cells).astype(int), cells - 1)
        w = np.array([look_up._weights(share) for share in x * cells - i])
        value = sum(c[i + k] * w[:, k] for k in range(4))
        return np.abs(value - function(x)).max()

    order = math.log2(error(33) / error(65))
    assert 3.7 < order < 4.6  # 4 in the limit; the free ends come from above


def test_force_rises_up_to_the_end(plain):
    squeezes = []
    for eccentricity in np.linspace(0.3, plain.last_eccentricity, 60):
        f_x, _ = plain.force(eccentricity, 0.0, 1.0, 0.5 * eccentricity)
        squeezes.append(-f_x)
    assert np.all(np.diff(squeezes) > 0)
    with pytest.raises(ValueError, match=r"eccentricity = 0\.996 must be <= 0\.995"):
        plain.force(0.996, 0.0)


# --- arguments and cache


def test_refusals():
    fed = FilmGeometry(**SMALL, grooves=(Groove(angle=0.0, width=0.4, pressure=0.2),))
    with pytest.raises(ValueError, match=r"grooves\[0\]\.pressure = 0\.2 must be 0") as caught:
        impedance_map(fed, last_eccentricity=1.0, accuracy=0.0)
    assert "last_eccentricity = 1 must be in (0, 1)" in str(caught.value)
    assert "accuracy = 0 must be > 0" in str(caught.value)
    tight = FilmGeometry(**SMALL, bore=np.full(36, -0.2))  # the journal touches at 0.8
    with pytest.raises(ValueError, match="lower last_eccentricity, or check the bore"):
        impedance_map(tight, last_eccentricity=0.9, cached=False)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(im, "cache_folder", lambda: tmp_path)
    return tmp_path


def test_cache(folder, monkeypatch):
    geometry = FilmGeometry(**SMALL)
    built = impedance_map(geometry, **QUICK)
    [path] = folder.iterdir()
    monkeypatch.setattr(im, "_build_table", None)  # a second build would fail
    again = impedance_map(FilmGeometry(**SMALL), **QUICK)
    assert_array_equal(again.table.coefficients, built.table.coefficients)
    assert again.table[1:] == built.table[1:]
    assert (again.interpolation, again.turned) == (built.interpolation, built.turned)
    assert again.last_eccentricity == 0.9
    assert path.suffix == ".npz"


def test_every_argument_has_its_own_map(folder):
    impedance_map(FilmGeometry(**SMALL), **QUICK)
    impedance_map(FilmGeometry(**SMALL, condition="guembel"), **QUICK)
    impedance_map(FilmGeometry(**{**SMALL, "length_to_diameter": 0.6}), **QUICK)
    impedance_map(FilmGeometry(**{**SMALL, "n_z": 11}), **QUICK)
    impedance_map(FilmGeometry(**SMALL), last_eccentricity=0.91, accuracy=0.1)
    impedance_map(FilmGeometry(**SMALL), last_eccentricity=0.9, accuracy=0.2)
    assert len(list(folder.iterdir())) == 6
    bores = (np.linspace(0, 0.1, 36), np.linspace(0, 0.11, 36))
    paths = {im._cache_path(FilmGeometry(**SMALL, bore=bore), 0.9, 0.1) for bore in bores}
    assert len(paths) == 2


def truncated(content):
    return content[: len(content) // 2]


def flipped(content):
    """One bit of the coefficients."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.parametrize("damage", [truncated, flipped, lambda _: b"", lambda _: b"no archive"])
def test_a_damaged_cache_is_built_again(folder, damage):
    built = impedance_map(FilmGeometry(**SMALL), **QUICK)
    [path] = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    again = impedance_map(FilmGeometry(**SMALL), **QUICK)
    assert_array_equal(again.table.coefficients, built.table.coefficients)
    assert path.read_bytes() == whole


def test_no_cache_is_no_error(monkeypatch, tmp_path):
    for nowhere in (None, tmp_path / "missing"):
        monkeypatch.setattr(im, "cache_folder", lambda place=nowhere: place)
        assert impedance_map(FilmGeometry(**SMALL), **QUICK).knots == (1, 35, 51)
