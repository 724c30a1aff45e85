"""Alignment: closed forms, invariants, contact by brute force, and calibrations that keep word."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.sim.alignment.alignment import (
    AS_SET,
    AlignmentLine,
    Condition,
    check,
    influence,
    reactions,
    span_loads,
)
from wearstate.sim.alignment.calibration import CalibrationStatus, calibrate
from wearstate.sim.alignment.jacking import gap_and_sag, jacking
from wearstate.sim.alignment.seats import AlignmentError, Seat, seat_stations
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_parts import Disc, PointLoad, Section

STEEL = {"young": 2.1e11, "shear_modulus": 8.1e10, "density": 7850.0}


def bar(length, diameter=0.1):
    return Section(length=length, outer_diameter=diameter, **STEEL)


def bar_line(stations, length, *, offsets=None, seats=None, nodes=(), **beam):
    """An even bar on rigid seats, or on those given."""
    offsets = offsets or [0.0] * len(stations)
    seats = seats or tuple(
        Seat(name=f"b{i}", station=s, offset=h)
        for i, (s, h) in enumerate(zip(stations, offsets, strict=True))
    )
    beam = {"theory": "euler-bernoulli", **beam}
    stations = (*seat_stations(seats), *nodes)
    return AlignmentLine(beam=assemble_beam([bar(length)], stations=stations, **beam), seats=seats)


def equal_spans(n, longest=None):
    return bar_line([float(i) for i in range(n)], n - 1.0, longest_element=longest)


EI = bar(1.0).bending_stiffness
WEIGHT = bar(1.0).area * 7850.0 * 9.80665  # of a metre

# Three-moment equation, exact: reactions over the load of a span, and rows of the influence
# matrix over E I / L^3; the rest by symmetry.
EQUAL = {
    3: ([3 / 8, 5 / 4], [[3 / 2, -3, 3 / 2], [-3, 6, -3]]),
    4: ([2 / 5, 11 / 10], [[8 / 5, -18 / 5, 12 / 5, -2 / 5], [-18 / 5, 48 / 5, -42 / 5, 12 / 5]]),
    5: (
        [11 / 28, 8 / 7, 13 / 14],
        [
            [45 / 28, -51 / 14, 18 / 7, -9 / 14, 3 / 28],
            [-51 / 14, 69 / 7, -66 / 7, 27 / 7, -9 / 14],
            [18 / 7, -66 / 7, 96 / 7, -66 / 7, 18 / 7],
        ],
    ),
    6: (
        [15 / 38, 43 / 38, 37 / 38],
        np.array(
            [
                [336, -762, 540, -144, 36, -6],
                [-762, 2064, -1986, 864, -216, 36],
                [540, -1986, 2928, -2202, 864, -144],
            ]
        )
        / 209,
    ),
}


@pytest.mark.parametrize("n", EQUAL)
@pytest.mark.parametrize("longest", [None, 0.25, 0.05])
def test_equal_spans(n, longest):
    line = equal_spans(n, longest)
    loads, rows = EQUAL[n]
    state = reactions(line)
    # rounding grows with the cube of the elements in a span: 3e-10 at twenty
    assert_allclose(state.reactions[: len(loads)] / WEIGHT, loads, rtol=1e-9)
    assert_allclose(state.reactions[::-1], state.reactions, rtol=1e-9)
    matrix = influence(line) / EI
    assert_allclose(matrix[: len(rows)], rows, rtol=0, atol=1e-9)
    assert_allclose(matrix[::-1, ::-1], matrix, rtol=0, atol=1e-9)


def test_one_span_in_closed_form():
    state = reactions(bar_line([0.0, 1.0], 1.0, longest_element=0.125))
    slope = WEIGHT / (24 * EI)
    # rounding: a few hundred times the epsilon at eight elements
    assert_allclose(state.slopes, [-slope, slope], rtol=1e-11)
    assert_allclose(state.deflections.min(), -5 * WEIGHT / (384 * EI), rtol=1e-11)
    assert_allclose(state.moments.max(), WEIGHT / 8, rtol=1e-10)
    assert_allclose(state.shear[[0, -1]], [WEIGHT / 2, -WEIGHT / 2], rtol=1e-10)
    assert_allclose(state.cut_stations[[0, -1]], [0.0, 1.0])


@pytest.mark.parametrize("stiffness", [1e5, 1e7, 1e9])
def test_an_elastic_bearing_shares_by_its_stiffness(stiffness):
    seats = [Seat(name=f"b{i}", station=float(i)) for i in range(3)]
    seats[1] = replace(seats[1], stiffness=stiffness)
    state = reactions(bar_line([], 2.0, seats=tuple(seats)))
    expected = 1.25 * WEIGHT * stiffness / (stiffness + 6 * EI)
    assert_allclose(state.reactions[1], expected, rtol=1e-12)
    assert_allclose(state.deflections[1], -expected / stiffness, rtol=1e-9)


def test_a_moment_and_a_force_of_a_condition():
    line = bar_line([0.0, 2.0], 2.0, nodes=[0.5])
    rest = reactions(line, unilateral=False).reactions
    turned = Condition(name="m", loads=(PointLoad(station=0.5, moment_up=300.0),))
    pushed = Condition(name="f", loads=(PointLoad(station=0.5, up=-100.0),))
    moved = [reactions(line, c, unilateral=False).reactions - rest for c in (turned, pushed)]
    # a moment that turns the slope up presses the aft end down
    assert_allclose(moved, [[150.0, -150.0], [75.0, 25.0]], rtol=1e-11)


# --- random lines


def random_line(rng, *, n=None, points=1):
    """A stepped shaft with a propeller on bearings in disorder, limits and bounds of moves."""
    n = n or int(rng.integers(3, 8))
    at = 0.8 + np.concatenate([[0.0], np.cumsum(rng.uniform(2, 6, n - 1))])
    length, diameter = float(at[-1] + 0.8), rng.uniform(0.3, 0.6)
    sections = [
        bar(piece, diameter * rng.uniform(0.8, 1.2))
        for piece in np.diff([0, 0.3, length - 0.4, length])
    ]
    seats = tuple(
        Seat(
            name=f"b{i}",
            station=float(s),
            offset=float(rng.normal(0, 6e-4)),
            slope=float(rng.normal(0, 1e-4)),
            stiffness=10 ** rng.uniform(8.5, 10) if i == 0 or rng.random() < 0.5 else math.inf,
            length=1.2 if i == 0 else 0.6,
            diameter=diameter,
            points=points if i == 0 else 1,
        )
        for i, s in enumerate(at)
    )
    beam = assemble_beam(
        sections,
        discs=[Disc(station=0.1, mass=rng.uniform(0, 15e3))],
        stations=seat_stations(seats),
        shear_coefficient=0.9,
    )
    line = AlignmentLine(beam=beam, seats=seats)
    limited = tuple(
        replace(
            seat,
            least_load=max(0.0, 0.2 * load) * (rng.random() < 0.9),
            most_load=1.8 * abs(load) + 1e3,
            most_slope=6e-4 if i == 0 else math.inf,
            least_move=-rng.uniform(0, 2e-3),
            most_move=rng.uniform(0, 2e-3),
        )
        for i, (seat, load) in enumerate(zip(seats, span_loads(line).tolist(), strict=True))
    )
    return AlignmentLine(beam=beam, seats=limited)


def random_conditions(rng, line):
    n = len(line.seats)
    return [
        Condition(name="cold"),
        Condition(name="hot", rises=(*[0.0] * (n - 2), 2e-4, 2e-4)),
        Condition(
            name="running",
            rises=tuple(rng.normal(0, 1e-4, n).tolist()),
            slopes=tuple(rng.normal(0, 5e-5, n).tolist()),
            loads=(PointLoad(station=0.1, moment_up=rng.normal(0, 2e4)),),
        ),
    ]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), points=st.integers(1, 4))
def test_invariants_of_any_line(seed, points):
    rng = np.random.default_rng(seed)
    line = random_line(rng, points=points)
    matrix, held = influence(line), line.held
    scale = np.abs(held.influence).max()
    # rounding of the shortest element's stiffness, which the points of a stern tube set
    assert_allclose(held.influence.sum(axis=1), 0, atol=1e-9 * scale)
    assert_allclose(held.influence @ held.stations, 0, atol=1e-8 * scale)
    assert_allclose(matrix, matrix.T, rtol=0, atol=1e-12 * scale)
    assert_allclose(matrix.sum(axis=1), 0, atol=1e-9 * scale)
    rest = reactions(line, unilateral=False)
    load = line.beam.load.reshape(-1, 4)
    whole, arm = -load[:, 0].sum(), line.beam.stations
    moment = -(load[:, 0] @ arm + load[:, 1].sum())
    for state in (rest, reactions(line)):
        assert_allclose(state.point_reactions.sum(), whole, rtol=1e-9)
        assert_allclose(state.point_reactions @ held.stations, moment, rtol=1e-9)
    moves = rng.normal(0, 1e-3, len(line.seats))
    after = reactions(line.moved(moves), unilateral=False).reactions
    big = np.abs(matrix) @ np.abs(moves)
    assert_allclose(after, rest.reactions + matrix @ moves, rtol=0, atol=1e-9 * big.max())


def test_timoshenko_bends_more_and_carries_the_same_weight():
    soft = bar_line([0.0, 0.3, 2.0], 2.0, theory="timoshenko", shear_coefficient=0.9)
    stiff = bar_line([0.0, 0.3, 2.0], 2.0)
    assert influence(soft)[1, 1] < 0.99 * influence(stiff)[1, 1]
    assert_allclose(reactions(soft).reactions.sum(), reactions(stiff).reactions.sum(), rtol=1e-9)


# --- contact


def plane_of(beam):
    """Stiffness and load of the vertical plane, dense."""
    plane = [c for node in range(beam.stations.size) for c in (4 * node, 4 * node + 1)]
    return beam.stiffness.toarray()[np.ix_(plane, plane)], beam.load[plane]


def on_subset(line, subset):
    """Reactions and gaps with given points in contact, by Lagrange multipliers on the full beam."""
    k, f = plane_of(line.beam)
    k, held = k.copy(), line.held
    scale = k.max()
    at = [2 * line.beam.node(s) for s in held.stations]
    seats = [line.seats[i] for i in held.owner]
    heights = np.array(
        [
            seat.offset + seat.slope * (s - seat.station)
            for seat, s in zip(seats, held.stations, strict=True)
        ]
    )
    m = len(subset)
    matrix = np.zeros((f.size + m, f.size + m))
    matrix[: f.size, : f.size] = k / scale
    for row, j in enumerate(subset):
        matrix[f.size + row, at[j]] = matrix[at[j], f.size + row] = 1.0
        matrix[f.size + row, f.size + row] = -scale / held.stiffness[j]
    solved = np.linalg.solve(matrix, np.concatenate([f / scale, heights[list(subset)]]))
    force = np.zeros(held.stations.size)
    force[list(subset)] = -solved[f.size :] * scale
    return force, solved[at] - heights


def valid_contacts(line):
    """Every set of points on which the line rests without pulling or sinking in."""
    p = line.held.stations.size
    whole = line.beam.downward_load
    for size in range(2, p + 1):
        for subset in itertools.combinations(range(p), size):
            force, gap = on_subset(line, subset)
            others = [j for j in range(p) if j not in subset]
            if force.min() >= -1e-9 * whole and all(gap[j] >= -1e-10 for j in others):
                yield force


def test_contact_by_brute_force():
    lifted = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        points = int(rng.integers(1, 4))
        line = random_line(rng, n=int(rng.integers(3, 7 - points + 1)), points=points)
        line = line.moved(rng.normal(0, 1e-3, len(line.seats)))
        state = reactions(line)
        [force] = list(valid_contacts(line))  # one answer, no more
        # the dense system of the whole beam is solved to about 1e-10 of the load
        assert_allclose(state.point_reactions, force, atol=1e-7 * line.beam.downward_load)
        lifted += bool(state.lifted)
    assert lifted >= 10  # or the trial says nothing


def test_a_lifted_bearing_is_named_and_has_no_influence():
    line = bar_line([0.0, 1.0, 2.0], 2.0, offsets=[0.0, -1e-2, 0.0])
    state = reactions(line)
    assert state.lifted == ("b1",)
    assert state.gaps[1] == pytest.approx(1e-2 - 5 * WEIGHT * 16 / (384 * EI), rel=1e-9)
    assert_allclose(influence(line, state), 0, atol=1e-6)  # two bearings left
    pulled = reactions(line, unilateral=False)
    assert pulled.reactions[1] < 0
    assert pulled.lifted == ()


def test_a_shaft_that_tips_is_refused():
    with pytest.raises(AlignmentError, match=r"at 1 m must act downward .*first support at 1.2 m"):
        reactions(bar_line([1.2, 2.0], 2.0))
    upward = Condition(name="up", loads=(PointLoad(station=0.0, up=1e5),))
    with pytest.raises(AlignmentError, match="shaft tips"):
        reactions(bar_line([0.0, 2.0], 2.0), upward)


# --- stern tube


def stern_tube(slope, points=4, stiffness=1e8):
    seats = (
        Seat(name="tube", station=1.0, slope=slope, stiffness=stiffness, length=0.8,
             diameter=0.1, points=points),
        Seat(name="forward", station=3.0),
    )  # fmt: skip
    discs = [Disc(station=0.0, mass=100.0)]
    return bar_line([], 3.0, seats=seats, discs=discs, longest_element=0.1)


def test_a_heavy_propeller_loads_the_aft_edge_and_slope_boring_relieves_it():
    straight = reactions(stern_tube(0.0))
    assert straight.point_reactions[0] > 0.8 * straight.reactions[0]
    bored = reactions(stern_tube(float(straight.slopes[0])))
    share = bored.point_reactions[:4] / bored.reactions[0]
    # not more: the shaft is curved in the tube, the bore is straight
    assert share.max() < 0.85 * straight.point_reactions[:4].max() / straight.reactions[0]
    assert (share > 0).sum() > (straight.point_reactions[:4] > 0).sum()
    assert bored.edge_pressures[0] == pytest.approx(4 * share.max() * bored.pressures[0])
    assert math.isnan(bored.pressures[1])
    assert abs(bored.relative_slopes[0]) < 0.5 * abs(straight.relative_slopes[0])


def test_many_points_approach_an_even_bedding():
    """The load's lever on the bedding settles with the square of the points' distance."""

    def lever(points):
        line = stern_tube(0.0, points, stiffness=5e6)  # soft: every point carries
        state = reactions(line)
        assert (state.point_reactions > 0).all()
        own = state.point_reactions[:-1]
        return own @ line.held.stations[:-1] / own.sum()

    coarse, middle, fine = (lever(points) for points in (2, 4, 8))
    # midpoint rule: fourfold less error at half the distance, and terms of higher order
    assert_allclose((middle - coarse) / (fine - middle), 4.0, rtol=0.1)


# --- limits


def test_limits_of_load_pressure_and_slope():
    seat = Seat(name="b", station=0.0, length=0.1, diameter=0.1, most_pressure=1e5, most_load=900.0)
    assert seat.highest_load == 900.0
    assert replace(seat, most_pressure=5e4).highest_load == pytest.approx(500.0)
    slope = WEIGHT * 8 / (24 * EI)
    seats = (
        replace(seat, most_load=0.9 * WEIGHT, most_pressure=50 * WEIGHT, most_slope=0.9 * slope),
        Seat(name="c", station=2.0, least_load=1.1 * WEIGHT),
    )
    found = {(c.bearing, c.quantity): c for c in check(reactions(bar_line([], 2.0, seats=seats)))}
    assert not any(limit.met for limit in found.values())
    assert found["b", "reaction"].shortfall == pytest.approx(0.1 * WEIGHT)
    assert found["b", "mean pressure"].shortfall == pytest.approx(50 * WEIGHT)
    assert found["b", "slope"].shortfall == pytest.approx(0.1 * slope)
    assert found["b", "slope"].text.endswith(f"must be >= {-900 * slope:.4g} mm/m")
    assert found["c", "reaction"].shortfall == pytest.approx(0.1 * WEIGHT)


def test_span_loads_balance():
    line = random_line(np.random.default_rng(3), n=5)
    load = line.beam.load.reshape(-1, 4)
    at = np.array([seat.station for seat in line.seats])
    carried = span_loads(line)
    assert_allclose(carried.sum(), line.beam.downward_load, rtol=1e-12)
    moment = -(load[:, 0] @ line.beam.stations + load[:, 1].sum())
    assert_allclose(carried @ at, moment, rtol=1e-12)


# --- calibration


def test_the_least_move_in_closed_form():
    seats = [Seat(name=f"b{i}", station=float(i), least_load=0.3 * WEIGHT) for i in range(3)]
    seats[1] = replace(seats[1], offset=-1e-3, most_move=2e-3)
    found = calibrate(bar_line([], 2.0, seats=tuple(seats)))
    assert found.status is CalibrationStatus.DONE
    low = (1.25 - 0.3) * WEIGHT / (6 * EI)  # below the line where it carries its least load
    # the reserve of a limit is 1e-6 of a mean load
    assert_allclose(found.moves, [0, 1e-3 - low, 0], atol=1e-6 * low)
    assert found.after[0].reactions[1] >= 0.3 * WEIGHT


def test_of_two_equal_ways_the_move_is_shared():
    """The line and its limits are symmetric, so are the moves of which the largest is least."""
    seats = [
        Seat(name=f"b{i}", station=float(i), most_load=0.5 * WEIGHT if i in (1, 2) else math.inf,
             least_move=-1e-2 if i in (1, 2) else 0.0)
        for i in range(4)
    ]  # fmt: skip
    found = calibrate(bar_line([], 3.0, seats=tuple(seats)))
    assert found.status is CalibrationStatus.DONE
    assert_allclose(found.moves[1], found.moves[2], rtol=1e-5)
    assert_allclose(found.after[0].reactions[1:3], 0.5 * WEIGHT, rtol=1e-5)


def test_of_equal_sums_the_largest_move_is_least():
    """The aft bearing gains as much by its own rise as by that of the forward one."""
    seats = [Seat(name=f"b{i}", station=float(i), most_move=(i != 1) * 1e-2) for i in range(3)]
    seats[0] = replace(seats[0], least_load=0.5 * WEIGHT)
    found = calibrate(bar_line([], 2.0, seats=tuple(seats)))
    rise = (0.5 - 0.375) * WEIGHT / (1.5 * EI)
    # the reserves of the limit and of the sum, 1e-6 of a load and of a millimetre
    assert_allclose(found.moves, [rise / 2, 0, rise / 2], atol=1e-4 * rise)


def test_a_mean_pressure_is_brought_within_its_limit():
    seats = [Seat(name=f"b{i}", station=float(i), least_move=-1e-2) for i in range(3)]
    size = {"length": 0.1, "diameter": 0.1, "most_pressure": 110 * WEIGHT}
    seats[1] = replace(seats[1], **size)
    found = calibrate(bar_line([], 2.0, seats=tuple(seats)))
    sink = (1.25 - 1.1) * WEIGHT / (6 * EI)
    assert_allclose(found.moves, [0, -sink, 0], atol=1e-4 * sink)
    assert_allclose(found.after[0].pressures[1], 110 * WEIGHT, rtol=1e-5)


def met_limits(states):
    return {
        (limit.condition, limit.bearing, limit.quantity)
        for state in states
        for limit in check(state)
        if limit.met
    }


def check_calibration(seed):
    """Everything that must hold of any calibration; returns its status."""
    rng = np.random.default_rng(seed)
    line = random_line(rng, points=1 + 2 * (seed % 2))
    conditions = random_conditions(rng, line)
    found = calibrate(line, conditions, prefer="fewest" if seed % 5 == 4 else "least")
    assert found.status is not CalibrationStatus.UNRESOLVED
    low = np.array([seat.least_move for seat in line.seats])
    high = np.array([seat.most_move for seat in line.seats])
    assert (found.moves >= low - 1e-12).all()
    assert (found.moves <= high + 1e-12).all()
    # solved anew, apart from what the calibration says of itself
    anew = [reactions(line.moved(found.moves, found.turns), c) for c in conditions]
    got = np.array([state.reactions for state in anew])
    assert_allclose(found.promised, got, rtol=0, atol=1e-6 * np.abs(got).mean())
    for state in anew:
        assert state.point_reactions.min() >= -1e-9 * state.reactions.sum()
        assert state.gaps.min() >= -1e-12
    assert met_limits(found.before) <= met_limits(anew)
    bad = [limit for state in anew for limit in check(state) if not limit.met]
    assert found.status.ok == (not bad)
    assert bool(found.blocks) == bool(bad)
    return found.status


def test_calibrations_keep_their_word():
    seen = {check_calibration(seed) for seed in range(40)}
    assert seen == {
        CalibrationStatus.WITHIN,
        CalibrationStatus.DONE,
        CalibrationStatus.INFEASIBLE,
    }


@pytest.mark.slow
def test_calibrations_keep_their_word_at_length():
    for seed in range(40, 400):
        check_calibration(seed)


def test_no_smaller_moves_do():
    """Random moves with a smaller sum never meet every limit."""
    rng = np.random.default_rng(1)
    tried = 0
    for seed in range(12):
        line = random_line(np.random.default_rng(seed), n=4)
        found = calibrate(line)
        if found.status is not CalibrationStatus.DONE:
            continue
        for _ in range(200):
            moves = rng.dirichlet(np.ones(4)) * rng.choice([-1, 1], 4) * found.total_move
            state = reactions(line.moved(0.999 * moves))
            assert not all(limit.met for limit in check(state))
            tried += 1
    assert tried >= 600


def test_fewest_moves_no_more_bearings_than_least():
    fewer = 0
    for seed in range(25):
        line = random_line(np.random.default_rng(seed), n=5)
        least, fewest = calibrate(line), calibrate(line, prefer="fewest")
        if least.status is CalibrationStatus.DONE:
            assert fewest.status is CalibrationStatus.DONE
            assert len(fewest.moved) <= len(least.moved)
            # the bounds give by 2e-7 of a load where a mixed programme fits to tolerance only
            assert fewest.total_move >= least.total_move * (1 - 1e-4)
            fewer += len(fewest.moved) < len(least.moved)
    assert fewer >= 1  # or the trial says nothing


def test_what_blocks_a_move_and_by_how_much():
    seats = [Seat(name=f"b{i}", station=float(i), least_load=0.3 * WEIGHT) for i in range(3)]
    seats[1] = replace(seats[1], offset=-1e-3, most_move=1e-4)
    line = bar_line([], 2.0, seats=tuple(seats))
    found = calibrate(line)
    assert found.status is CalibrationStatus.INFEASIBLE
    [block] = found.blocks
    low = (1.25 - 0.3) * WEIGHT / (6 * EI)
    assert (block.bearing, block.quantity, block.upper) == ("b1", "move", True)
    assert block.needed == pytest.approx(1e-3 - low, rel=1e-5)
    assert "move <= 0.1 mm would have to be 0.9" in block.text
    for share, status in ((1.001, CalibrationStatus.DONE), (0.999, CalibrationStatus.INFEASIBLE)):
        seats[1] = replace(seats[1], most_move=share * block.needed)
        assert calibrate(bar_line([], 2.0, seats=tuple(seats))).status is status


def test_limits_that_no_move_brings_together_are_named():
    seats = tuple(
        Seat(
            name=f"b{i}",
            station=float(i),
            least_load=0.9 * WEIGHT,
            least_move=-1e-3,
            most_move=1e-3,
        )
        for i in range(3)
    )
    found = calibrate(bar_line([], 2.0, seats=seats))
    assert found.status is CalibrationStatus.INFEASIBLE
    assert {block.quantity for block in found.blocks} == {"reaction"}
    assert any(not math.isnan(block.needed) for block in found.blocks)
    short = sum(
        block.bound - block.needed for block in found.blocks if block.needed == block.needed
    )
    # three times 0.9 of a span's load, of which there are two
    assert_allclose(short, 0.7 * WEIGHT, rtol=1e-4)


def test_a_turn_of_the_bore_mends_a_slope():
    line = stern_tube(0.0)
    tube = replace(line.seats[0], most_slope=1e-4, least_turn=-2e-3, most_turn=2e-3)
    line = AlignmentLine(beam=line.beam, seats=(tube, line.seats[1]))
    before = reactions(line).relative_slopes[0]
    found = calibrate(line)
    assert abs(before) > 1.5e-4
    assert found.status is CalibrationStatus.DONE
    assert found.moved == ("tube",)
    assert abs(found.after[0].relative_slopes[0]) <= 1e-4
    assert np.sign(found.turns[0]) == np.sign(before)


def test_within_limits_nothing_moves():
    found = calibrate(equal_spans(4))
    assert found.status is CalibrationStatus.WITHIN
    assert found.moved == ()
    assert found.total_move == 0


# --- jacking, gap and sag


@pytest.mark.parametrize("bearing", ["b1", "b2", "b3"])
def test_jacking_gives_the_reaction(bearing):
    line = bar_line([0.5, 1.5, 2.5, 3.5], 4.0, nodes=[1.6, 2.4, 3.4])
    test = jacking(line, bearing)
    assert test.others == ()
    # bisection of the lift to 1e-10 of itself
    assert_allclose(test.estimate, test.reaction, rtol=1e-8)
    assert_allclose(test.reaction, reactions(line).reactions[line.seat(bearing)], rtol=1e-12)
    assert test.loads[0] == pytest.approx(0, abs=1e-6)
    assert test.first_slope > 5 * test.second_slope
    steps = np.diff(test.loads) / np.diff(test.lifts)
    assert_allclose(steps[[0, -1]], [test.first_slope, test.second_slope], rtol=1e-7)
    at = float(np.interp(test.free_lift, test.lifts, test.loads))
    assert_allclose(at, test.free_load, rtol=1e-7)


def test_jacking_of_a_stern_tube_that_comes_free_point_by_point():
    line = stern_tube(0.0, stiffness=5e6)
    test = jacking(line, "tube", station=0.5)
    assert_allclose(test.estimate, test.reaction, rtol=1e-7)


def test_jacking_that_cannot_be_is_refused():
    low = bar_line([0.0, 1.0, 2.0], 2.0, offsets=[0.0, -1e-2, 0.0], nodes=[1.1])
    for name, station, says in (
        ("b1", None, "must be > 0 to be jacked"),
        ("b9", None, "must be one of b0, b1, b2"),
        ("b0", 0.77, "is no node"),
        ("b0", 1.0, "without a tie"),
    ):
        with pytest.raises(AlignmentError, match=says):
            jacking(low, name, station=station)


def test_flush_flanges_carry_neither_moment_nor_shear_once_coupled():
    stations, cut = [0.3, 2.2, 3.4, 5.6], 2.9
    discs = [Disc(station=cut, mass=30.0), Disc(station=0.0, mass=40.0)]
    line = bar_line(stations, 6.0, discs=discs, nodes=[cut])
    (open_,) = gap_and_sag(line, [cut])
    # the forward piece, turned and shifted as a rigid body, closes gap and sag
    turn = open_.angle
    up = -open_.sag
    moves = [0.0, 0.0, *(up + turn * (s - cut) for s in stations[2:])]
    flush = line.moved(moves)
    (closed,) = gap_and_sag(flush, [cut])
    assert_allclose([closed.sag, closed.angle], 0, atol=1e-15)
    state = reactions(flush, unilateral=False)
    aft = int(np.flatnonzero(np.isclose(state.cut_stations, cut))[0])
    assert_allclose(state.moments[aft], 0, atol=1e-8 * np.abs(state.moments).max())
    half = 15.0 * 9.80665  # half of the flanges hangs on each piece
    assert_allclose(state.shear[aft], half, rtol=1e-6)
    assert_allclose(state.shear[aft + 1], -half, rtol=1e-6)


def test_drooping_flange_in_closed_form():
    line = bar_line([0.0, 1.0, 3.0, 4.0], 5.0, nodes=[2.0])
    support = Seat(name="temporary", station=2.0 + 1e-3)
    beam = assemble_beam([bar(5.0)], stations=[0, 1, 2, 2.001, 3, 4], theory="euler-bernoulli")
    line = AlignmentLine(beam=beam, seats=line.seats)
    (flange,) = gap_and_sag(line, [2.0], [support])
    droop = WEIGHT / (8 * EI) + WEIGHT / EI * (1 / 6 - 1 / 24)  # overhang, and the span's turn
    assert_allclose(flange.heights[0], -droop, rtol=1e-9)
    # the support stands a millimetre from the flange, which therefore hardly moves
    assert abs(flange.heights[1]) < 1e-2 * droop
    assert_allclose(flange.gap(0.5), 0.5 * (flange.slopes[0] - flange.slopes[1]))


def test_a_piece_without_support_is_named():
    with pytest.raises(AlignmentError, match=r"piece from 1.5 to 2 m.*support points = 1"):
        gap_and_sag(bar_line([0.0, 1.0, 2.0], 2.0, nodes=[1.5]), [1.5])
    with pytest.raises(AlignmentError, match=r"cuts = \[2.0\] m must lie inside the shaft of 2 m"):
        gap_and_sag(bar_line([0.0, 1.0, 2.0], 2.0), [2.0])


# --- bad input


def test_every_fault_of_a_line_at_once():
    seats = (
        Seat(name="a", station=0.0, stiffness=0.0, least_load=-1.0),
        Seat(name="a", station=0.7, most_pressure=1e5),
        Seat(name="c", station=math.nan, points=0, most_slope=0.0),
        Seat(name="d", station=1.0, points=3, least_move=1e-3, diameter=-1.0),
    )
    beam = assemble_beam([bar(1.0)], theory="euler-bernoulli")
    with pytest.raises(AlignmentError) as error:
        AlignmentLine(beam=beam, seats=seats)
    for says in (
        "bearing 'a' is given 2 times",
        "stiffness = 0 N/m must be > 0",
        "least_load = -1 N must be >= 0",
        "station = 0.7 m is no node, the nearest is 1 m",
        "most_pressure needs length and diameter",
        "station = nan must be finite",
        "points = 0 must be from 1 to 100",
        "most_slope = 0 rad must be > 0",
        "length = 0 m must be > 0 with several points",
        "least_move = 0.001 and most_move = 0 must be",
        "diameter = -1 m must be >= 0",
    ):
        assert says in str(error.value)


def test_lines_that_cannot_be():
    with pytest.raises(AlignmentError, match="support points = 1 must be >= 2"):
        bar_line([0.5], 1.0)
    with pytest.raises(AlignmentError, match="must rise from aft forward"):
        bar_line([1.0, 0.0], 1.0)


def test_questions_that_do_not_fit():
    line = equal_spans(3)
    for question, says in (
        (lambda: reactions(line, Condition(name="hot", rises=(1.0,))), "must be 3 finite numbers"),
        (
            lambda: reactions(line, Condition(name="x", loads=(PointLoad(station=0.3),))),
            "load of condition 'x': station = 0.3 m is no node",
        ),
        (lambda: line.moved({"b7": 1e-3}), "must be one of b0, b1, b2"),
        (lambda: calibrate(line, []), "conditions = none must be at least one"),
        (lambda: calibrate(line, [AS_SET, AS_SET]), "each named once"),
        (lambda: calibrate(line, prefer="cheapest"), "must be one of least, fewest"),
        (lambda: jacking(line, "b1", n_lifts=1), "n_lifts = 1 must be >= 2"),
    ):
        with pytest.raises(AlignmentError, match=says):
            question()


def test_moves_by_name_and_by_number_are_the_same():
    line = equal_spans(3)
    by_name, by_number = line.moved({"b1": 1e-3}), line.moved([0, 1e-3, 0])
    assert by_name.seats == by_number.seats
    assert_allclose(reactions(by_name).reactions, reactions(by_number).reactions)
