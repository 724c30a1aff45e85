"""A shaft on its films: limits, invariants, and the derivatives that it hands on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.diagnose.machines.shaft import _touching
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_parts import Disc, PointLoad, Section
from wearstate.sim.beam.modes import modes
from wearstate.sim.beam.rotor import Rotor
from wearstate.sim.bearing.coefficients import coefficients
from wearstate.sim.bearing.operate import JournalBearing, operate
from wearstate.sim.film.solve import FilmGeometry, Groove, dufrane_scar, worn_arc
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.at_rest import film_bearings
from wearstate.sim.shaft.line_beam import running_beam
from wearstate.sim.shaft_films.film_bearing import FilmBearing
from wearstate.sim.shaft_films.on_oil_films import beam_film, supports
from wearstate.sim.shaft_films.status import ShaftFilmError, ShaftFilmStatus

SPEED = 2 * math.pi * 2.0
STATIONS = (1.3, 5.0, 11.0, 17.0)
LENGTH = 18.3  # a shaft symmetric about its middle has the stations 1.3, 7, 11.3, 17 instead
TENTH = 1e-9  # of the load: tolerance of the balance, which most answers inherit


def shaft(
    stations=STATIONS, *, length=LENGTH, young=2.06e11, loads=(), discs=True, gravity=9.80665
):
    steel = Section(
        length=length, outer_diameter=0.42, young=young, shear_modulus=young / 2.6, density=7850.0
    )
    ends = [Disc(station=s, mass=4000.0) for s in (0.0, length)] if discs else []
    return assemble_beam(
        [steel],
        discs=ends,
        loads=loads,
        stations=stations,
        theory="timoshenko",
        shear_coefficient=0.9,
        longest_element=1.0,
        gravity=gravity,
    )


def journal(*, length=0.36, clearance=0.3e-3, **mesh):
    film = FilmGeometry(length_to_diameter=length / 0.42, **mesh)
    return JournalBearing(
        diameter=0.42, length=length, clearance=clearance, viscosity=0.08, film=film
    )


def line(stations=STATIONS, *, bearing=None, offsets=None, **options):
    offsets = np.zeros(len(stations)) if offsets is None else offsets
    return [
        FilmBearing(
            name=f"b{n}", station=s, bearing=bearing or journal(), offset=float(offset), **options
        )
        for n, (s, offset) in enumerate(zip(stations, offsets, strict=True))
    ]


# --- limits


def test_one_bearing_in_the_middle_is_the_bearing_alone():
    beam = shaft((3.0,), length=6.0)
    found = beam_film(beam, line((3.0,)), SPEED)
    alone = operate(journal(), speed=SPEED, load=[beam.downward_load, 0.0], tilt_coefficients=True)
    # the shaft's X is down, its Y against z; both are solved to 1e-9 of the load
    assert_allclose(found.positions[0], -alone.position, rtol=1e-7)
    bearing = journal()
    film = coefficients(alone.equilibrium, method="mesh", tilt=True)
    scale = np.outer(*2 * [[1, 1, bearing.length, bearing.length]])
    scale = scale * bearing.force_unit(SPEED) / bearing.clearance
    assert_allclose(found.stiffness[0], film.stiffness * scale, rtol=1e-6, atol=1e-6 * 1e8)
    assert_allclose(found.damping[0], film.damping * scale / SPEED, rtol=1e-6, atol=1e-6 * 1e7)
    assert_allclose(found.least_film[0], alone.least_film, rtol=1e-7)
    assert_allclose(found.peak_pressure[0], alone.peak_pressure, rtol=1e-7)


def test_one_bearing_off_the_middle_carries_the_moment():
    """A rigid journal under a force and a moment: the film has to resist the tilt."""
    loads = [PointLoad(station=3.0, moment_up=4e3, moment_side=-2e3)]
    beam = shaft((3.0,), length=6.0, loads=loads, young=2.06e14)
    found = beam_film(beam, line((3.0,)), SPEED)
    assert_allclose(found.moments[0], [-4e3, 2e3], atol=1e-6 * 4e3)
    assert_allclose(found.reactions[0], [beam.downward_load, 0.0], atol=1e-6 * beam.downward_load)
    again = operate(
        journal(),
        speed=SPEED,
        load=[beam.downward_load, 0.0],
        slope=tuple(-found.slopes[0]),
    )
    assert_allclose(found.positions[0], -again.position, rtol=1e-6)


def test_a_symmetric_line_has_symmetric_answers():
    stations = (1.3, 6.3, 12.0, 17.0)
    found = beam_film(shaft(stations), line(stations), SPEED)
    near = {"rtol": 1e-6, "atol": 1e-9}  # the balance holds to 1e-9 of the load
    assert_allclose(found.reactions, found.reactions[::-1], rtol=1e-6, atol=1e-6 * 1e5)
    assert_allclose(found.positions, found.positions[::-1], **near)
    assert_allclose(found.slopes, -found.slopes[::-1], atol=1e-6 * np.abs(found.slopes).max())
    assert_allclose(found.least_film, found.least_film[::-1], **near)


def test_reactions_carry_all_loads():
    beam = shaft(loads=[PointLoad(station=5.0, up=2e4, side=-1e4)])
    found = beam_film(beam, line(offsets=[0, -1e-3, 5e-4, 0]), SPEED)
    assert found.residual < TENTH
    assert found.iterations <= 6  # quadratic; with half of a stiffness it takes twelve
    total = found.reactions.sum(axis=0)
    assert_allclose(total, [beam.downward_load, 1e4], atol=4 * TENTH * beam.downward_load)
    # and they balance about the aft end, with the films' own moments
    turn = (np.array(STATIONS)[:, None] * found.reactions + found.moments).sum(axis=0)
    up, side = beam.load[0::4], beam.load[2::4]
    loads = [beam.stations @ up + beam.load[1::4].sum(), beam.stations @ side]
    assert_allclose(turn, -np.array(loads), atol=4 * TENTH * beam.downward_load * LENGTH)


def rigid_reactions(beam, stations, heights):
    """Of the same finite elements, held at the stations."""
    held = np.array([4 * beam.node(s) for s in stations])
    free = np.setdiff1d(np.arange(beam.n_dof)[np.arange(beam.n_dof) % 4 < 2], held)
    k, f = beam.stiffness.toarray(), beam.load
    q = np.zeros(beam.n_dof)
    q[held] = heights
    q[free] = np.linalg.solve(k[np.ix_(free, free)], f[free] - k[np.ix_(free, held)] @ q[held])
    return (k @ q - f)[held]


def test_without_clearance_the_reactions_are_those_of_rigid_supports():
    """The journals lie above the bottom by a share of the clearance: first order."""
    offsets = np.array([0.0, -3e-4, -2e-4, 0.0])
    beam = shaft()
    rigid = rigid_reactions(beam, STATIONS, offsets)
    gaps = []
    for clearance in (4e-5, 2e-5, 1e-5):
        thin = JournalBearing(
            diameter=0.42,
            length=0.36,
            clearance=clearance,
            viscosity=0.08 * (clearance / 3e-4) ** 2,
        )  # the same Sommerfeld number
        found = beam_film(beam, line(bearing=thin, offsets=offsets), SPEED, tilted=False)
        gaps.append(np.abs(found.reactions[:, 0] - rigid).max())
    rates = np.log2(np.array(gaps[:-1]) / gaps[1:])
    # at the same eccentricities the rate would be 1; they change as the loads do, by some per cent
    assert_allclose(rates, 1.0, atol=0.05)
    assert gaps[-1] < 0.01 * rigid.mean()


def test_a_stiff_shaft_shares_its_load_like_a_lever():
    """Two bearings are determined whatever the shaft, but for the films' moments."""
    stations = (2.0, 14.0)
    beam = shaft(stations, young=2.06e14)
    found = beam_film(beam, line(stations), SPEED)
    weights, x = -beam.load[0::4], beam.stations
    moment = weights @ x + beam.load[1::4].sum() * -1
    aft = (14.0 * weights.sum() - moment) / 12.0
    films = found.moments[:, 0].sum() / 12.0
    assert_allclose(found.reactions[0, 0], aft + films, rtol=1e-8)


def test_a_soft_shaft_does_not_feel_how_its_bearings_stand():
    """Then its reactions are those of one on rigid supports in a row, film or not."""
    beam = shaft(young=2.06e4, discs=False, gravity=1e-3)
    found = beam_film(beam, line(offsets=[0, 1e-4, 0, 0]), SPEED, tilted=False)
    rigid = rigid_reactions(beam, STATIONS, np.zeros(4))
    # 1e-4 m of an influence of 9.6 EI / L^3, 1.4 N/m here, and as much of the films
    assert_allclose(found.reactions[:, 0], rigid, atol=1e-3)
    assert rigid.min() > 1


# --- what it hands on


@pytest.mark.parametrize("rung", ["direct", "finite"])
def test_stiffness_is_what_a_further_load_meets(rung):
    """dR = -K du at every bearing, from two balances under a small load."""
    films = line(offsets=[0, -5e-4, -5e-4, 0])
    found = [
        beam_film(
            shaft(
                loads=[PointLoad(station=6.0, up=sign * 20.0, side=sign * 30.0)],
                stations=(*STATIONS, 6.0),
            ),
            films,
            SPEED,
            rung=rung,
            tolerance=1e-12,
        )
        for sign in (-1, 0, 1)
    ]
    move = [np.hstack([f.positions, f.slopes]) for f in found]
    force = [np.hstack([f.reactions, f.moments]) for f in found]
    met = -np.einsum("nij,nj->ni", found[1].stiffness, move[2] - move[0])
    # 20 N are 2e-4 of a load: central differences of smooth forces, and rounding
    scale = np.abs(force[2] - force[0]).max()
    assert_allclose(met, force[2] - force[0], atol=1e-4 * scale)


def test_supports_are_the_films():
    found = beam_film(shaft(), line(), SPEED)
    own = supports(found)
    assert [s.name for s in own] == ["b0", "b1", "b2", "b3"]
    assert_allclose(own[2].stiffness, found.stiffness[2])
    assert_allclose(own[2].damping, found.damping[2])
    assert supports(found, moments=False)[0].stiffness.shape == (2, 2)
    rotor = Rotor(beam=shaft(), supports=own)
    assert modes(rotor, SPEED, 4).stable


def test_every_node_of_the_deflected_beam_is_in_balance():
    beam = shaft(loads=[PointLoad(station=5.0, side=-1e4)])
    found = beam_film(beam, line(offsets=[0, -1e-3, 5e-4, 0]), SPEED, pedestals=[(1e9, 5e8)] * 4)
    expected = np.zeros(beam.n_dof)
    for n, station in enumerate(STATIONS):
        first = 4 * beam.node(station)
        expected[[first, first + 2]] = found.reactions[n]
        expected[[first + 1, first + 3]] = found.moments[n]
    # rounding of entries of 1e11 N/m times 1e-3 m
    assert_allclose(beam.stiffness @ found.deflection - beam.load, expected, atol=1e-3)


def test_pedestals_give_way_under_their_load():
    stiff = [(2e8, 1e8)] * 4
    found = beam_film(shaft(), line(), SPEED, pedestals=stiff)
    assert_allclose(found.give, -found.reactions / stiff, rtol=1e-12)
    y, z = found.deflection[0::4], found.deflection[2::4]
    nodes = [shaft().node(s) for s in STATIONS]
    bores = np.array([b.centre for b in line()]) + found.give
    assert_allclose(np.column_stack([y, z])[nodes], bores + found.positions, atol=1e-15)
    # each bore lowered by hand as much carries the same
    lowered = [
        replace(b, offset=b.offset + g[0], side_offset=g[1])
        for b, g in zip(line(), found.give, strict=True)
    ]
    again = beam_film(shaft(), lowered, SPEED)
    assert_allclose(again.reactions, found.reactions, atol=1e-6 * 1e5)
    held = supports(found, housing_masses=[300.0] * 4, pedestal_damping=[(1e4, 1e4)] * 4)
    assert held[0].pedestal_stiffness == (2e8, 1e8)
    with pytest.raises(ValueError, match="must have a housing mass"):
        supports(found)


def test_very_stiff_pedestals_are_none():
    plain = beam_film(shaft(), line(), SPEED)
    stiff = beam_film(shaft(), line(), SPEED, pedestals=[(1e14, 1e14)] * 4)
    # 1e5 N over 1e14 N/m is 1e-9 m of 3e-4
    assert_allclose(stiff.positions, plain.positions, rtol=1e-4, atol=1e-9)


# --- places


def test_wear_down_lowers_the_bottom_and_widens_the_bore():
    new = journal(bore=dufrane_scar(0.2, 0.0, 72), n_theta=72)
    pressed = Groove(angle=1.6, width=0.3, pressure=2.0)
    new = replace(new, film=replace(new.film, grooves=(pressed,)))
    worn = FilmBearing(name="stern", station=0.0, bearing=new, offset=1e-3, wear_down=4e-4)
    assert_allclose(worn.worn.clearance, 5e-4, rtol=1e-12)
    assert_allclose(worn.centre, [1e-3 + 3e-4 - 2e-4, 0.0], rtol=1e-12)
    bottom = worn.centre[0] - worn.worn.clearance
    assert_allclose(bottom, 1e-3 - 4e-4, rtol=1e-12)
    # scar in metres and feed pressure in pascals are the same
    assert_allclose(worn.worn.film.bore * 5e-4, new.film.bore * 3e-4, rtol=1e-12)
    unit = [b.force_unit(SPEED) * b.clearance**0 for b in (new, worn.worn)]
    fed = [b.film.grooves[0].pressure for b in (new, worn.worn)]
    assert_allclose(fed[0] * unit[0], fed[1] * unit[1], rtol=1e-12)


@pytest.mark.parametrize("depth", [1e-4, 6e-4])
def test_an_arc_as_wide_as_the_worn_circle_is_that_circle(depth):
    """Depth w and clearance C + w / 2 make the gap w / 2 (1 + cos) wider, as the circle does."""
    films = line(offsets=[0, -2e-4, 0, 0])
    circle, arc = (
        beam_film(shaft(), [replace(films[0], wear_down=depth, **shape), *films[1:]], SPEED)
        for shape in ({}, {"arc_clearance": 1 + depth / 2 / films[0].bearing.clearance})
    )
    assert arc.status.ok
    # a profile is linear between its 72 nodes: off by w / 2 times their distance squared over 8,
    # 0.3 um of the deeper one, by which the journal moves too; 3e-5 of the load
    assert_allclose(arc.reactions, circle.reactions, atol=1e-4 * 1e5)
    places = [
        found.positions[:, 0] + [b.centre[0] for b in found.bearings] for found in (circle, arc)
    ]
    assert_allclose(places[1], places[0], atol=3e-7)
    assert_allclose(arc.least_film, circle.least_film, atol=6e-7)
    assert_allclose(arc.middle_films, circle.middle_films, rtol=2e-3)  # between nodes, and at them


@pytest.mark.parametrize("own", [0.25, 0.5])
def test_the_mesh_of_the_scene_is_fine_enough_for_an_arc(own):
    """Against twice as many nodes, at the condemning wear-down; a third of them is 42 um off."""
    worn = {"bearings.0.worn_shape": "arc", "bearings.0.arc_clearance": own}
    heights = []
    for nodes in (48, 96):
        changes = {**worn, "bearings.0.wear_down": 0.9e-3, "film.n_theta": nodes}
        scene = load_scene("propulsion-shaft", changes)
        speed = 2 * math.pi * scene.drive.speed
        films = film_bearings(scene)
        assert films[0].bearing.geometry.n_theta == 3 * films[1].bearing.geometry.n_theta
        heights.append(beam_film(running_beam(scene), films, speed).positions[0])
    assert_allclose(heights[0], heights[1], atol=0.02 * 0.35e-3)


def test_a_picture_shows_where_journals_touch():
    """In a wider circle that is lower, the middle of a journal reaches all of that circle."""
    depth = 0.8
    side, up = _touching(worn_arc(depth, 1 + depth / 2, 0.0, 288))
    # nodes 1.25 degrees apart leave 1 / cos(0.6 degrees) - 1 of the radius
    assert_allclose(np.hypot(side, up + depth / 2), 1 + depth / 2, rtol=1e-4)
    side, up = _touching(worn_arc(3.0, 0.4, 0.0, 288))
    assert_allclose(up.min(), -4.0, rtol=1e-4)  # the bottom of the arc
    assert_allclose(np.abs(side).max(), 1.0, rtol=1e-4)  # no wider than the bore as new


def test_an_arc_leaves_the_rest_of_the_bore_as_new():
    bearing = replace(line()[0], offset=1e-3, wear_down=4e-4, arc_clearance=0.4)
    gap = bearing.worn.clearance * (1 + bearing.worn.geometry.bore)
    assert bearing.worn.clearance == bearing.bearing.clearance
    assert bearing.sunk == 0
    assert_allclose(gap[0], bearing.bearing.clearance + 4e-4)
    assert_allclose(gap[len(gap) // 4 : 3 * len(gap) // 4], bearing.bearing.clearance)
    assert_allclose(bearing.centre[0] - bearing.bottom, 1e-3 - 4e-4)
    with pytest.raises(ValueError, match=r"arc_clearance = 0.0 must be > 0"):
        replace(bearing, arc_clearance=0.0)


def test_moving_everything_changes_nothing():
    """Neither does a rigid turn of shaft and bores: a sum of moments would tell."""
    plain = beam_film(shaft(), line(), SPEED)
    tilt = 1e-3
    turned = [
        replace(b, offset=2e-3 + tilt * b.station, side_offset=-1e-3, slope=(tilt, 0.0))
        for b in line()
    ]
    moved = beam_film(shaft(), turned, SPEED)
    assert_allclose(moved.reactions, plain.reactions, atol=1e-6 * 1e5)
    assert_allclose(moved.slopes, plain.slopes, atol=1e-6 * np.abs(plain.slopes).max())


def test_a_start_nearby_saves_steps_and_changes_nothing():
    films = line(offsets=[0, -5e-4, -5e-4, 0])
    cold = beam_film(shaft(), films, SPEED)
    warm = beam_film(shaft(), films, SPEED, start=cold)
    assert warm.iterations == 0
    assert_allclose(warm.reactions, cold.reactions, atol=2 * TENTH * 1e5)
    near = beam_film(shaft(), films, 1.02 * SPEED, start=cold)
    afresh = beam_film(shaft(), films, 1.02 * SPEED)
    assert near.iterations <= afresh.iterations
    assert_allclose(near.reactions, afresh.reactions, atol=4 * TENTH * 1e5)


# --- what a line may be like


def test_badly_aligned_line_reports_the_bearing_that_hangs():
    found = beam_film(shaft(), line(offsets=[0, 0, -6e-3, 0]), 4 * SPEED)
    assert found.status.ok
    assert found.unloaded == ("b2",)
    assert found.reactions[2, 0] < 0  # the shaft lies in the upper half of the bore
    assert found.positions[2, 0] > 0


def stern(**options):
    """Two diameters long, bored with half of the shaft's slope."""
    long = journal(length=0.84, clearance=0.35e-3)
    aft = FilmBearing(name="aft", station=1.3, bearing=long, **options)
    return [aft, *line(STATIONS[1:])]


def test_worn_stern_bearing_is_refined_where_its_edge_is_near():
    """Two diameters long, tilted by 0.6 of its clearance from end to end."""
    films = stern(wear_down=1.5e-3, slope=(-2e-4, 0.0))
    found = beam_film(shaft(), films, SPEED)
    given = beam_film(shaft(), films, SPEED, refinements=0, raise_on_failure=False)
    long = journal(length=0.84, clearance=0.35e-3, n_z=65)
    fine = beam_film(shaft(), [replace(films[0], bearing=long), *films[1:]], SPEED)
    assert found.geometries[0].n_z > given.geometries[0].n_z == 17
    # the edge's film, a fiftieth of the clearance, is 10 % off the fine mesh's, the given 41 %
    assert_allclose(found.least_film[0], fine.least_film[0], rtol=0.15)
    assert abs(given.least_film[0] / fine.least_film[0] - 1) > 0.3
    assert_allclose(found.reactions, fine.reactions, atol=5e-3 * fine.reactions[:, 0].mean())


def test_an_edge_that_the_mesh_cannot_carry_may_be_carried_by_a_finer_one():
    films = stern(wear_down=1.5e-3, slope=(-4e-4, 0.0))
    given = beam_film(shaft(), films, SPEED, refinements=0, raise_on_failure=False)
    assert given.status is ShaftFilmStatus.EDGE_CONTACT
    assert 1 < given.strength < 1.5
    found = beam_film(shaft(), films, SPEED)
    assert found.residual < TENTH
    assert 0 < found.least_film[0] < 0.01 * films[0].worn.clearance


def test_thin_film_is_followed_on_a_finer_mesh():
    """Eccentricity .97 and more on a stiff shaft, which the given mesh cannot resolve."""
    films = line((2.0, 14.0), bearing=journal(n_theta=48))
    beam = shaft((2.0, 14.0), young=2.06e15)
    slow = SPEED / 50
    with pytest.raises(ShaftFilmError, match="bearing 'b0': coarse"):
        beam_film(beam, films, slow, refinements=0)
    found = beam_film(beam, films, slow)
    assert found.eccentricity_ratios.max() > 0.97
    assert found.geometries[1].n_theta > 48
    assert found.residual < TENTH


def test_a_journal_on_its_edge_is_named_with_what_would_help():
    steep = stern(slope=(-3e-3, 0.0))
    with pytest.raises(ShaftFilmError, match="bearing 'aft': edge_contact") as caught:
        beam_film(shaft(), steep, SPEED)
    assert caught.value.bearing == "aft"
    found = beam_film(shaft(), steep, SPEED, raise_on_failure=False)
    assert found.status is ShaftFilmStatus.EDGE_CONTACT
    assert found.culprit == "aft"
    assert found.strength > 1
    # films that much stronger do carry it, on the same mesh
    enough = 1.05 * found.strength * 0.08
    thick = [replace(b, bearing=replace(b.bearing, viscosity=enough)) for b in steep]
    assert beam_film(shaft(), thick, SPEED, refinements=0).status.ok


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_any_line_is_balanced_or_names_a_bearing(seed):
    random = np.random.default_rng(seed)
    offsets = random.normal(size=4) * 10 ** random.uniform(-5, -2.7)
    bearing = journal(
        length=random.uniform(0.15, 0.84),
        clearance=10 ** random.uniform(-3.9, -3.1),
        n_theta=36,
        n_z=9,
    )
    films = line(bearing=bearing, offsets=offsets)
    films[0] = replace(films[0], slope=tuple(random.normal(size=2) * 3e-4), side_offset=2e-4)
    speed = 10 ** random.uniform(0, 1.5)
    found = beam_film(shaft(), films, speed, raise_on_failure=False)
    if found.status.ok:
        assert found.residual <= TENTH
        assert found.strength == 1
        total = found.reactions.sum(axis=0)
        assert_allclose(total, [shaft().downward_load, 0.0], atol=1e-8 * shaft().downward_load)
        assert np.all(found.least_film > 0)
    else:
        # no search gives up where the mesh can carry the load
        assert found.status is not ShaftFilmStatus.NO_CONVERGENCE
        assert found.culprit in {b.name for b in films}


# --- what is refused


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 0.0}, "speed = 0.0 rad/s must be > 0"),
        ({"rung": "paper"}, "rung = 'paper' must be one of"),
        ({"pedestals": [(1e9, 1e9)]}, "pedestals has 1 entries and must have 4"),
        ({"pedestals": [(1e9, 0.0)] * 4}, "pedestals of 'b0' = 0.0 N/m must be > 0"),
    ],
)
def test_arguments_out_of_range_are_refused(change, message):
    arguments = {"speed": SPEED} | change
    with pytest.raises(ValueError, match=message):
        beam_film(shaft(), line(), **arguments)


def test_bearings_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="must hold at least one"):
        beam_film(shaft(), [], SPEED)
    twice = [line()[0], replace(line()[1], name="b0")]
    with pytest.raises(ValueError, match="must differ in it"):
        beam_film(shaft(), twice, SPEED)
    with pytest.raises(ValueError, match=r"b0\.wear_down = -1\.0 m must be >= 0"):
        replace(line()[0], wear_down=-1.0)
    with pytest.raises(ValueError, match="alone must resist tilt"):
        beam_film(shaft((3.0,), length=6.0), line((3.0,)), SPEED, rung="short")
    jumpy = line(bearing=journal(condition="reynolds"))
    with pytest.raises(ValueError, match="must be 'periodic' or 'guembel'"):
        beam_film(shaft(), jumpy, SPEED)
