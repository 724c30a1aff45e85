"""Cylinder pressure and valves against closed forms, an independent solver, and their books."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from wearstate.sim.contact.closed_forms import kelvin_voigt_restitution
from wearstate.sim.hydraulics import (
    chamber,
    chamber_run,
    flow_ripple,
    parameters,
    piston_pressure,
    valves,
)
from wearstate.sim.hydraulics.liquid import air_near, air_volume, mixture_volume
from wearstate.sim.jit import kernel
from wearstate.sim.parts.units import STANDARD_GRAVITY
from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Line, Liquid, Valve
from wearstate.sim.scene.scene import SceneError, validate_table

# The built-in bilge pump
RADIUS, ROD, SPEED = 0.05, 0.25, 2 * math.pi * 5
AREA = math.pi / 4 * 0.1**2
DEAD = 5e-4
TURN = 2 * math.pi
SWEPT = 2 * RADIUS * AREA
ATMOSPHERE = 101325.0
CHAMBER = {
    "rung": "chamber",
    "suction": -3e4,
    "discharge": 3e5,
    "suction_valve": Valve(),
    "discharge_valve": Valve(),
    "dead_volume": DEAD,
}
RIGID = Liquid(air_fraction=0.0, bulk_modulus=1e12)


def record(**fields):
    """Parameters of the bilge pump's cylinder."""
    return parameters.hydraulic_parameters(
        CylinderPressure(**fields), area=AREA, crank_radius=RADIUS, rod_length=ROD, speed=SPEED
    )[0]


def chamber_of(**fields):
    return record(**{**CHAMBER, **fields})


def motion(angle):
    sine = RADIUS * np.sin(angle)
    piston = RADIUS * np.cos(angle) + np.sqrt(ROD**2 - sine**2)
    return piston, -RADIUS * SPEED * flow_ripple.flow_shape(angle, RADIUS / ROD)


def acceleration(angle, h=1e-4):
    # central difference of the velocity: error h^2/6 of its third derivative, 2e-9 of the value
    return SPEED * (motion(angle + h)[1] - motion(angle - h)[1]) / (2 * h)


def run(h, *, per_turn=10_000, turns=3.0, first=0.3, substeps=None, start=None):
    angle = first + TURN * np.arange(round(turns * per_turn) + 1) / per_turn
    done = chamber_run.run_chamber(
        h, *motion(angle), step=TURN / SPEED / per_turn, substeps=substeps, start=start
    )
    assert done.code == chamber.CHAMBER_OK
    return angle, done.states, done.flows


def volume(h, angle):
    return h["dead_volume"] + AREA * (RADIUS + ROD - motion(angle)[0])


def specific(p, liquid):
    """Volume per volume at atmospheric pressure, written down a second time."""
    air = liquid.air_fraction * (ATMOSPHERE / (ATMOSPHERE + p)) ** (1 / liquid.air_exponent)
    return (1 - liquid.air_fraction) / (1 + p / liquid.bulk_modulus) + air


HEALTHY = chamber_of()


@pytest.fixture(scope="module")
def healthy():
    return run(HEALTHY)


# --- rungs without a state


def test_every_rung_has_a_code():
    rungs = CylinderPressure.model_fields["rung"].annotation.__args__
    assert tuple(parameters.PRESSURE_CODES) == rungs
    assert list(parameters.PRESSURE_CODES.values()) == [
        0,
        1,
        2,
        3,
        4,
        4,
        4,
    ]  # pipes on the same chamber


@pytest.mark.parametrize("angle", [-1.0, 0.03, 2.0, 3.17, 5.0, 40.0])
def test_simple_rungs(angle):
    levels = {"suction": -3e4, "discharge": 3e5, "rise_angle": 0.1}
    assert piston_pressure.line_pressure(angle, SPEED, 1.0, record(rung="none", **levels)) == (
        0.0,
        0.0,
    )
    assert piston_pressure.line_pressure(angle, SPEED, 1.0, record(rung="constant", **levels)) == (
        3e5,
        0.0,
    )
    h = record(rung="two-level", **levels)
    expected = piston_pressure.two_level_pressure(angle, -3e4, 3e5, h)
    assert piston_pressure.line_pressure(angle, SPEED, 1.0, h) == (
        expected,
        0.0,
    )


HEADS = {
    "rung": "heads",
    "suction": -1e4,
    "discharge": 2e5,
    "rise_angle": math.radians(3.0),
    "suction_line": Line(rise=2.0, length=0.4, diameter=0.08, friction_factor=0.02, minor_loss=1.5),
    "discharge_line": Line(
        rise=5.0, length=0.6, diameter=0.07, friction_factor=0.03, minor_loss=2.0
    ),
    "suction_valve": Valve(resistance=8.0, equivalent_length=0.1),
    "discharge_valve": Valve(resistance=12.0, equivalent_length=0.2),
}


def bernoulli(side, flow, flow_rate, speed):
    """Energy balance from the free end to the piston face, term by term [Pa]."""
    density = Liquid().density
    sign = 1 if side == "discharge" else -1
    line, valve = HEADS[f"{side}_line"], HEADS[f"{side}_valve"]
    pipe = math.pi / 4 * line.diameter**2
    seats = valve.count * math.pi / 4 * valve.diameter**2
    u, seat_speed = flow / pipe, flow / seats
    head = line.rise + sign * (
        line.friction_factor * line.length / line.diameter * u * abs(u) / (2 * STANDARD_GRAVITY)
        + line.minor_loss * u * abs(u) / (2 * STANDARD_GRAVITY)
        + line.length / STANDARD_GRAVITY * flow_rate / pipe
        + valve.resistance * seat_speed * abs(seat_speed) / (2 * STANDARD_GRAVITY)
        + valve.equivalent_length / STANDARD_GRAVITY * flow_rate / seats
    )
    if side == "suction":
        return HEADS["suction"] - density * STANDARD_GRAVITY * (
            line.rise + speed**2 / (2 * STANDARD_GRAVITY) + (line.rise - head)
        )
    kinetic = (u**2 - speed**2) / (2 * STANDARD_GRAVITY)
    return HEADS["discharge"] + density * STANDARD_GRAVITY * (head + kinetic)


@pytest.mark.parametrize("angle", [0.8, 2.9, 3.94, 6.04])
def test_heads_with_the_exact_flow(angle):
    delivers = angle > math.pi
    side = "discharge" if delivers else "suction"
    velocity, acc = motion(angle)[1], acceleration(angle)
    p, mass = piston_pressure.line_pressure(angle, SPEED, float(velocity), record(**HEADS))
    into_line = 1 if delivers else -1
    flow, rate = into_line * AREA * velocity, into_line * AREA * acc
    assert flow > 0
    # 2e-9 of the inertia by the difference quotient above
    assert_allclose(p + mass * acc / AREA, bernoulli(side, flow, rate, abs(velocity)), rtol=1e-7)
    assert mass > 1.0


def test_heads_with_the_two_harmonic_flow():
    h = record(**HEADS, flow="two-harmonic")
    ratio, unit = RADIUS / ROD, AREA * RADIUS * SPEED
    for angle, side in ((1.1, "suction"), (2.5, "suction"), (4.0, "discharge"), (6.0, "discharge")):
        sign = 1 if side == "suction" else -1
        flow = sign * unit * (math.sin(angle) + ratio / 2 * math.sin(2 * angle))
        rate = sign * unit * SPEED * (math.cos(angle) + ratio * math.cos(2 * angle))
        p, mass = piston_pressure.line_pressure(angle, SPEED, 99.0, h)  # the velocity is not asked
        assert mass == 0.0
        # the same formula twice: rounding
        assert_allclose(p, bernoulli(side, flow, rate, flow / AREA), rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.2, 0.1, 0.05])
def test_two_harmonic_flow_errs_with_the_cube_of_the_rod_ratio(ratio):
    angle = np.linspace(0, TURN, 20_001)
    flow = np.sin(angle) + ratio / 2 * np.sin(2 * angle)
    error = np.abs(flow - flow_ripple.flow_shape(angle, ratio)).max()
    # lambda^3/4 max |2 sin^3 cos| = 3 sqrt(3)/32 lambda^3; the next term is 3/2 lambda^2 smaller
    assert_allclose(error, 3 * math.sqrt(3) / 32 * ratio**3, rtol=1.5 * ratio**2)
    rate = np.cos(angle) + ratio * np.cos(2 * angle)
    slope = np.gradient(flow_ripple.flow_shape(angle, ratio), angle, edge_order=2)
    # at mid-stroke lambda (1 - 1/sqrt(1 - lambda^2)), exactly; 3e-8 from the difference quotient
    expected = ratio * (1 / math.sqrt(1 - ratio**2) - 1)
    assert_allclose(np.abs(rate - slope).max(), expected, atol=1e-7)


def test_heads_without_losses_at_low_speed_are_the_two_levels():
    free = Line(length=0.0, friction_factor=0.0, minor_loss=0.0)
    h = record(
        **{**HEADS, "suction_line": free, "discharge_line": free}
        | {"suction_valve": None, "discharge_valve": None}
    )
    for angle in np.linspace(0, TURN, 50):
        p, mass = piston_pressure.line_pressure(angle, SPEED, 1e-6, h)
        assert mass == 0.0
        expected = piston_pressure.two_level_pressure(angle, -1e4, 2e5, h)
        assert_allclose(p, expected, rtol=0, atol=1e-8)  # rho u^2 = 1e-9 Pa


@pytest.mark.parametrize("flow", ["exact", "two-harmonic"])
def test_heads_never_jump(flow):
    h = record(**HEADS, flow=flow)
    angle = np.linspace(-0.2, TURN, 200_001)
    v = motion(angle)[1]
    acc = acceleration(angle)
    p = np.array(
        [
            np.dot(piston_pressure.line_pressure(a, SPEED, u, h), (1, b / AREA))
            for a, u, b in zip(angle, v, acc, strict=True)
        ]
    )
    # 230 kPa of levels and 200 kPa of inertia change within 3 deg, with a slope of 3/2
    assert np.abs(np.diff(p)).max() < 1.6 * 4.3e5 / math.radians(3.0) * (angle[1] - angle[0])


def test_lowest_pressure_is_the_acceleration_head():
    long = Line(length=1.2, diameter=0.09, friction_factor=0.0, minor_loss=0.0)
    h = record(rung="heads", suction_line=long, discharge_line=long, rise_angle=math.radians(0.5))
    pipe = math.pi / 4 * long.diameter**2
    mean = AREA * RADIUS * SPEED / math.pi / pipe
    constant = flow_ripple.acceleration_constant(RADIUS / ROD, [0.0])
    head = long.length * mean * (60 * SPEED / TURN) * constant / STANDARD_GRAVITY
    # the steepest rise is at the dead centre, inside the blend of 0.5 deg: 1 - cos, and the
    # velocity head at 0.5 deg, 1e-4 of it each
    expected = -Liquid().density * STANDARD_GRAVITY * head
    assert_allclose(piston_pressure.lowest_pressure(h), expected, rtol=5e-4)
    with pytest.raises(ValueError, match=r"rung = 4 must be 3 \(heads\)"):
        piston_pressure.lowest_pressure(HEALTHY)


# --- kinematic ripple

RIPPLE = [  # lambda, phases, double acting, above, below, total in per cent of the mean
    (1 / 6, flow_ripple.even_phases(1), False, 218.5, 100.0, 318.5),
    (1 / 6, flow_ripple.even_phases(2), False, 59.25, 100.0, 159.25),
    (1 / 6, flow_ripple.even_phases(3), False, 6.17, 16.95, 23.11),
    (1 / 6, flow_ripple.even_phases(4), False, 11.07, 21.46, 32.53),
    (1 / 6, flow_ripple.even_phases(6), False, 4.72, 9.31, 14.03),
    (1 / 6, flow_ripple.even_phases(9), False, 0.56, 1.55, 2.10),
    (1 / 6, flow_ripple.even_phases(1), True, 59.25, 100.0, 159.25),
    (1 / 6, [0.0, math.pi / 2], True, 24.25, 21.46, 45.71),
    (1 / 5, flow_ripple.even_phases(3), False, 6.80, 18.52, 25.31),
    (1 / 5, flow_ripple.even_phases(5), False, 1.95, 5.57, 7.52),
    (0.0, flow_ripple.even_phases(3), False, 4.72, 9.31, 14.03),
]


@pytest.mark.parametrize(("ratio", "phases", "double", "above", "below", "total"), RIPPLE)
def test_flow_ripple_table(ratio, phases, double, above, below, total):
    ripple = flow_ripple.flow_ripple(ratio, phases, double_acting=double)
    found = [100 * ripple.above, 100 * ripple.below, 100 * ripple.total]
    # half a unit of the last printed digit, a whole one for the sum of two rounded
    assert_allclose(found, [above, below, total], rtol=0, atol=0.0501 if above > 100 else 0.0101)


@pytest.mark.parametrize("cylinders", [2, 3, 4, 5, 8])
def test_flow_ripple_of_sine_pumps(cylinders):
    ripple = flow_ripple.flow_ripple(0.0, flow_ripple.even_phases(cylinders))
    # sum of sines: n even pulses n times a turn, n odd 2 n times, below a peak of 1 / sin
    half = math.pi / (cylinders if cylinders % 2 == 0 else 2 * cylinders)
    mean = cylinders / math.pi
    peak = 1 / math.sin(half) if cylinders % 2 == 0 else 0.5 / math.sin(half)
    floor = peak * math.cos(half)
    # the parabola through three of 513 points an arc: 1e-11
    assert_allclose(ripple.above, peak / mean - 1, rtol=0, atol=1e-9)
    assert_allclose(ripple.below, 1 - floor / mean, rtol=0, atol=1e-9)


def test_flow_ripple_of_uneven_cranks_against_brute_force():
    phases = np.array([0.0, 1.9, 4.4])
    angle = np.linspace(0, TURN, 400_001)
    flow = sum(np.maximum(-flow_ripple.flow_shape(angle + phase, 0.25), 0) for phase in phases)
    mean = flow[:-1].mean()
    ripple = flow_ripple.flow_ripple(0.25, phases)
    # the grid misses a kink by 8e-6 rad at slopes of about one
    assert_allclose(ripple.above, flow.max() / mean - 1, atol=2e-5)
    assert_allclose(ripple.below, 1 - flow.min() / mean, atol=2e-5)


def test_flow_ripple_finds_a_peak_between_its_points():
    phases = flow_ripple.even_phases(3)

    def delivered(angle):
        return float(sum(max(-flow_ripple.flow_shape(angle + phase, 0.3), 0.0) for phase in phases))

    angles = np.linspace(0, TURN, 601)
    best = angles[np.argmax([delivered(angle) for angle in angles])]
    peak = minimize_scalar(
        lambda angle: -delivered(angle), bounds=(best - 0.02, best + 0.02), method="bounded",
        options={"xatol": 1e-9},
    )  # fmt: skip
    # a grid of 513 points an arc alone may miss it by h^2/8 = 5e-7; its parabola by h^4: 1e-11
    assert_allclose(
        flow_ripple.flow_ripple(0.3, phases).above, -peak.fun / (3 / math.pi) - 1, rtol=0, atol=1e-9
    )


ACCELERATION = [  # phases, double acting, C of exact kinematics at lambda = 1/5
    (flow_ripple.even_phases(1), False, 0.3948),
    (flow_ripple.even_phases(1), True, 0.1974),
    (flow_ripple.even_phases(2), False, 0.1974),
    ([0.0, math.pi / 2], True, 0.1155),
    (flow_ripple.even_phases(3), False, 0.0658),
    (flow_ripple.even_phases(5), False, 0.0395),
    (flow_ripple.even_phases(7), False, 0.0282),
    (flow_ripple.even_phases(9), False, 0.0219),
]


@pytest.mark.parametrize(("phases", "double", "expected"), ACCELERATION)
def test_acceleration_constants(phases, double, expected):
    found = flow_ripple.acceleration_constant(0.2, phases, double_acting=double)
    assert_allclose(found, expected, rtol=0, atol=0.501e-4)  # half a unit of the last digit


def test_acceleration_constant_of_one_cylinder_in_closed_form():
    for ratio in (0.0, 0.2, 0.4):
        # steepest at the top dead centre: pi (1 + lambda) 2 pi / 60
        expected = math.pi * (1 + ratio) * TURN / 60
        assert_allclose(flow_ripple.acceleration_constant(ratio, [0.7]), expected, rtol=1e-11)


@pytest.mark.parametrize("function", [flow_ripple.flow_ripple, flow_ripple.acceleration_constant])
def test_impossible_pumps(function):
    with pytest.raises(ValueError, match=r"crank_to_rod = 1 must be in \[0, 1\)"):
        function(1, [0.0])
    with pytest.raises(ValueError, match="phases must not be empty"):
        function(0.2, [])


# --- the liquid


@pytest.mark.parametrize("air", [0.0, 0.002, 0.1])
@pytest.mark.parametrize("p", [-9.9e4, -3e4, 0.0, 3e5, 1e8])
def test_specific_volume(air, p):
    liquid = Liquid(air_fraction=air)
    h = record(liquid=liquid)
    v, slope = mixture_volume(p, air_volume(p, h), h)
    assert_allclose(v, specific(p, liquid), rtol=1e-15)
    # complex step: exact to rounding
    derivative = specific(p + 1e-20j, liquid).imag / 1e-20
    assert_allclose(slope, derivative, rtol=1e-13)


def test_bulk_moduli_of_water_and_air_at_atmospheric_pressure():
    for air, exponent in ((0.0, 1.4), (0.01, 1.0), (0.01, 1.4), (0.2, 1.4)):
        h = record(liquid=Liquid(air_fraction=air, air_exponent=exponent))
        v, slope = mixture_volume(0.0, air_volume(0.0, h), h)
        # compliances in series by volume: (1 - a) / B + a / (n p_a)
        expected = (1 - air) / 2.18e9 + air / (exponent * ATMOSPHERE)
        assert_allclose(-slope / v, expected, rtol=1e-14)


@settings(deadline=None)  # the first example compiles
@given(st.floats(-9.8e4, 1e7), st.floats(-0.0099, 0.0099), st.floats(1.0, 5 / 3))
def test_series_for_the_air(p, e, exponent):
    h = record(liquid=Liquid(air_fraction=0.2, air_exponent=exponent))
    near = p + e * (p + ATMOSPHERE)
    known = (p, air_volume(p, h), 1 / (p + ATMOSPHERE))
    # five terms: the sixth is below 1e-12 of the air, and half of it at the end of the reach
    assert_allclose(air_near(near, known, h), air_volume(near, h), rtol=2e-12)


def shut(**fields):
    """A chamber without ways in or out; no scene may have it."""
    h = chamber_of(suction_valve=Valve(stuck_lift=0.0), **fields).copy()
    h["discharge_stuck"] = 0.0
    return h


@pytest.mark.parametrize(
    ("liquid", "squeeze"),
    [(Liquid(), 1e-4), (RIGID, 1e-7), (Liquid(air_fraction=0.1, air_exponent=1.0), 8e-3)],
)
def test_closed_chamber_follows_its_equation_of_state(liquid, squeeze):
    h = shut(liquid=liquid)
    n = 500
    x = np.linspace(0.25, 0.25 + squeeze, n + 1)
    step = 2e-5
    start = np.array([-2e4, 0, 0, 0, 0, 0])
    done = chamber_run.run_chamber(
        h, x, np.full(n + 1, squeeze / (n * step)), step=step, start=start
    )
    room = DEAD + AREA * (RADIUS + ROD - x)
    target = specific(-2e4, liquid) * room[-1] / room[0]
    expected = brentq(lambda p: specific(p, liquid) - target, -1e5, 5e9, xtol=1e-9)
    assert expected > 5e4
    # 500 steps, each booking the mass to 1e-16, on a modulus of 1e12 Pa: 500 * 1e-4 Pa at most
    assert_allclose(done.states[-1, 0], expected, rtol=1e-9, atol=0.05)
    assert_array_equal(done.flows[:, :2], 0.0)


# --- the books of the chamber

BOOKS = {
    "healthy": {},
    "much air": {"liquid": Liquid(air_fraction=0.05)},
    "no air": {"liquid": Liquid(air_fraction=0.0)},
    "leaking": {"discharge_valve": Valve(leak_area=2e-5)},
    "cavitating": {"suction": -8.8e4},
    "stuck": {"suction_valve": Valve(stuck_lift=1e-3)},
}


@pytest.mark.parametrize("fields", BOOKS.values(), ids=BOOKS)
@pytest.mark.parametrize("substeps", [1, 3])
def test_mass_books(fields, substeps):
    h = chamber_of(**fields)
    liquid = fields.get("liquid", Liquid())
    angle, states, flows = run(h, turns=2, substeps=substeps)
    mass = (volume(h, angle) - states[:, 1]) / specific(states[:, 0], liquid)
    # rounding of volume and specific volume, and the series for two per mille of air: 5e-15
    assert_allclose(np.diff(mass), flows[:, 0] - flows[:, 1], rtol=0, atol=1e-14 * mass.max())
    assert np.all(states[:, 1] >= 0)
    assert np.all(states[:, 0] >= h["vapour"])
    # complementary: vapour only at the vapour pressure
    assert np.all((states[:, 1] == 0) | (states[:, 0] == h["vapour"]))


def energy_gap(per_turn):
    """Piston work less line work, losses in the gaps and work on the plates, of one turn."""
    liquid = Liquid(air_fraction=0.0)
    h = chamber_of(liquid=liquid)
    angle, states, flows = run(h, per_turn=per_turn, turns=4)
    p, _, z_s, v_s, z_d, v_d = states[-per_turn - 1 :].T
    room = volume(h, angle[-per_turn - 1 :])

    def carried(pressure):
        """Work to bring a unit of mass in: the integral of v dp."""
        return liquid.bulk_modulus * np.log1p(pressure / liquid.bulk_modulus)

    def spent(before, after, lift, rate, side):
        """Work of the flow between two pressures, gap and plate [W]."""
        drop = before - after
        gap = h[f"{side}_gap_conductance"] * np.maximum(lift, 0) * drop / np.sqrt(abs(drop) + 1)
        return (gap + h[f"{side}_area"] * rate) * (carried(before) - carried(after))

    power = spent(h["suction"], p, z_s, v_s, "suction")
    power += spent(p, h["discharge"], z_d, v_d, "discharge")
    losses = TURN / SPEED / per_turn * np.sum((power[1:] + power[:-1]) / 2)
    suction, discharge = flows[-per_turn:, :2].sum(axis=0)
    lines = carried(h["discharge"]) * discharge - carried(h["suction"]) * suction
    work = -np.sum((p[1:] + p[:-1]) / 2 * np.diff(room))
    assert_allclose(work, 3.3e5 * SWEPT, rtol=0.12)  # indicator diagram: levels and valve losses
    return (work - lines - losses) / work


def test_energy_book():
    # At 80 us a valve passes its seat within a step; at 20 us and below the gap is that of the
    # trapezoidal sums, second order but for the kinks of opening and closing.
    for per_turn, largest in ((2_500, 5e-5), (10_000, 1e-7), (40_000, 2e-8)):
        assert abs(energy_gap(per_turn)) < largest


# --- against an independent solver


def textbook(t, y, h, liquid, angle0):
    """dp/dt = B/V (...), valves as mass, spring and damper; no contact, no vapour."""
    p, z_s, v_s, z_d, v_d = y
    angle = angle0 + SPEED * t
    velocity = motion(angle)[1]
    room = volume(h, angle)
    slope = specific(p + 1e-20j, liquid).imag / 1e-20
    v = specific(p, liquid)
    out = []
    for drop, z, rate in (
        (h["suction"] - p, z_s, v_s),
        (p - h["discharge"], z_d, v_d),
    ):
        gap = Valve().discharge_coefficient * 4 * math.pi * Valve().diameter * max(z, 0)
        seats = 4 * math.pi / 4 * Valve().diameter ** 2
        laminar = drop / math.sqrt(abs(drop) + 1.0)  # a square root but for the last pascal
        flow = gap * math.sqrt(2 / liquid.density) * laminar + seats * rate
        spring = 4 * (Valve().stiffness * (z + Valve().preload_lift) + Valve().damping * rate)
        seat = -4 * (Valve().seat_stiffness * z + Valve().seat_damping * rate) if z < 0 else 0.0
        out.append((flow, (seats * drop - spring + max(seat, 0.0)) / (4 * Valve().mass)))
    (q_s, a_s), (q_d, a_d) = out
    pressure_rate = (-v / slope) / room * (v * (q_s - q_d) + AREA * velocity)
    return [pressure_rate, v_s, a_s, v_d, a_d]


@pytest.fixture(scope="module")
def independent():
    """From mid-suction to the closed valves' compression: opening, free flight, closing."""
    first, last = 0.5 * math.pi, 1.9 * math.pi
    start = run(HEALTHY, per_turn=10_000, first=0.0, turns=2.25)[1][-1]
    times = np.linspace(0, (last - first) / SPEED, 1401)
    done = solve_ivp(
        textbook,
        (0, times[-1]),
        np.delete(start, 1),
        method="Radau",
        t_eval=times,
        rtol=1e-8,
        atol=[1e-2, 1e-10, 1e-8, 1e-10, 1e-8],
        args=(HEALTHY, Liquid(), first),
        max_step=1e-4,
    )
    assert done.success
    return start, times, done.y.T


def test_chamber_against_an_independent_solver(independent):
    start, times, expected = independent
    states = run(HEALTHY, per_turn=80_000, first=0.5 * math.pi, turns=0.7, start=start)[1]
    found = np.delete(states[:: (len(states) - 1) // 1400], 1, axis=1)
    assert len(found) == len(times)
    # Radau at 1e-8; here steps of 2.5 us, second order, first at the impact of the suction valve
    assert_allclose(found[:, 0], expected[:, 0], rtol=0, atol=3e-3 * 3.3e5)
    assert_allclose(found[:, [1, 3]], expected[:, [1, 3]], rtol=0, atol=1e-3 * 5.7e-3)
    smooth = times < 0.4 * math.pi / SPEED  # the free flight of the suction valve
    assert_allclose(found[smooth, 0], expected[smooth, 0], rtol=0, atol=1e-5 * 1.5e4)
    assert_allclose(found[smooth, 1], expected[smooth, 1], rtol=0, atol=1e-6 * 5.7e-3)


@pytest.mark.parametrize("liquid", [Liquid(), Liquid(air_fraction=0.0), RIGID])
def test_observed_order(liquid):
    # free flight of the suction valve, from the balance at 60 deg: nothing opens or closes
    h = chamber_of(liquid=liquid)
    ends = [run(h, per_turn=n, first=1.0, turns=0.1, substeps=1)[1][-1] for n in (2000, 4000, 8000)]
    exact = run(h, per_turn=256_000, first=1.0, turns=0.1, substeps=1)[1][-1]
    for column in (0, 2, 3):
        errors = [abs(end[column] - exact[column]) for end in ends]
        # TR-BDF2: order 2, in the stiff limit too (the rigid liquid is an index-2 constraint)
        assert 1.7 < math.log2(errors[0] / errors[2]) / 2 < 2.4, (column, errors)


def test_two_substeps_are_two_steps():
    angle = 1.0 + TURN * np.arange(401) / 20_000
    x, v = motion(angle)
    fine = chamber_run.run_chamber(HEALTHY, x, v, step=1e-5, substeps=1)
    half = x[::2].copy(), v[::2].copy()  # of one layout, for which the kernel is compiled
    coarse = chamber_run.run_chamber(HEALTHY, *half, step=2e-5, substeps=2)
    # only the cubic between the ends differs: h^4 / 384 of x'''' = 1e-17 m, on B/V of 1e11 Pa/m^3
    assert_allclose(coarse.states[-1, 0], fine.states[-1, 0], rtol=0, atol=1e-3)
    assert_allclose(coarse.states[-1, 2:], fine.states[-1, 2:], rtol=0, atol=1e-9)
    assert_allclose(coarse.flows.sum(axis=0), fine.flows.sum(axis=0), rtol=1e-9, atol=1e-12)


# --- the valves


def test_westphal():
    """Constant gap velocity: a valve without mass under a force that does not change."""
    drop, seat = 15e3, math.pi / 4 * 0.045**2
    valve = Valve(
        mass=1e-6, stiffness=0.3, preload_lift=drop * seat / 0.3, damping=0.0,
        seat_stiffness=9e5, seat_damping=0.0,
    )  # fmt: skip
    h = chamber_of(suction=0.0, suction_valve=valve, discharge_valve=valve, liquid=RIGID)
    per_turn = 40_000
    angle = 0.5 + TURN * np.arange(round(1.2 * per_turn)) / per_turn
    x, v = 0.25 + RADIUS * np.cos(angle), -RADIUS * SPEED * np.sin(angle)
    done = chamber_run.run_chamber(h, x, v, step=0.2 / per_turn, substeps=1)
    lift = done.states[:, 4]
    # C_d pi D v z = A r w sin - A_v z', z = Z sin(a - pi - phi) in the discharge stroke
    gap = 4 * math.pi * 0.045 * 0.65 * math.sqrt(2 * drop / RIGID.density)
    inertia = 4 * seat * SPEED
    phase = math.atan2(inertia, gap)
    amplitude = AREA * RADIUS * SPEED / math.hypot(gap, inertia)
    middle = (angle > 4.6) & (angle < 6.1)  # the start from zero has died out by e^-12
    basis = np.column_stack([-np.sin(angle), -np.cos(angle)])[middle]
    in_phase, behind = np.linalg.lstsq(basis, lift[middle], rcond=None)[0]
    # spring and laminar limit: 7e-5 each of the gap velocity
    assert_allclose(math.hypot(in_phase, behind), amplitude, rtol=2e-4)
    assert_allclose(math.atan2(-behind, in_phase), phase, rtol=2e-4)
    assert_allclose(np.interp(TURN, angle, lift), amplitude * math.sin(phase), rtol=2e-4)
    late = angle > TURN
    closed = angle[late][np.argmax(lift[late] <= 0)]
    assert_allclose(closed - TURN, phase, rtol=2.5e-3)  # a step is 1.6e-3 of it
    assert 5 < math.degrees(phase) < 6


def lone_valve(ratio):
    """A valve without spring, flow or force: only its mass and what it hits."""
    h = shut().copy()
    h["suction_stuck"] = -1.0
    for name in ("gap_conductance", "area", "force_area", "stiffness", "preload", "damping"):
        h[f"suction_{name}"] = 0.0
    h["suction_seat_damping"] = 2 * ratio * math.sqrt(h["suction_seat_stiffness"] * 0.4)
    return h


def bounce(ratio, lift, rate, step, n):
    h = lone_valve(ratio)
    still = np.full(n + 1, 0.27)
    start = np.array([0.0, 0.0, lift, rate, 0.0, 0.0])
    return chamber_run.run_chamber(h, still, 0 * still, step=step, substeps=1, start=start)


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("stop", [False, True])
def test_seat_and_stop_rebound_as_a_spring_with_damper(ratio, stop):
    lift, rate = (8e-3 - 1e-6, 0.2) if stop else (1e-6, -0.2)
    done = bounce(ratio, lift, rate, 2e-7, 2000)
    after = done.states[-1, 3]
    expected = kelvin_voigt_restitution(ratio)
    # a contact of 140 us in 700 steps whose ends fall anywhere in a step
    assert_allclose(-after / rate, expected, atol=5e-3)
    # impulse: the change of momentum, to rounding of 2000 sums
    assert_allclose(done.flows[:, 2].sum(), 0.4 * (after - rate), rtol=1e-11)
    assert np.sign(done.flows[:, 2].sum()) == (-1 if stop else 1)


def test_a_closed_valve_presses_on_its_seat():
    h = chamber_of()
    p = 1e5
    still = np.full(3001, 0.27)
    h = h.copy()
    h["discharge_stuck"] = 0.0
    start = np.array([p, 0, 0.0, 0, 0, 0])
    done = chamber_run.run_chamber(h, still, 0 * still, step=2e-5, start=start)
    pressure = done.states[-1, 0]
    force = 4 * (Valve().stiffness * Valve().preload_lift) + h["suction_area"] * (pressure + 3e4)
    # at rest after 60 ms; the spring in the seat's dent takes 1e-4 of it
    assert_allclose(done.flows[-1, 2] / 2e-5, force, rtol=2e-4)
    assert_allclose(done.states[-1, 2], -force / (4 * Valve().seat_stiffness), rtol=2e-4)


def test_contact_never_pulls(healthy):
    _, states, flows = healthy
    assert np.all(flows[:, 2:] >= -1e-12 * flows[:, 2:].max())  # no stop is reached here
    assert 4e-3 < states[:, 2].max() < 8e-3


def test_start_is_close_to_the_settled_cycle(healthy):
    angle, states, _ = healthy
    for first in (1.5, 4.7):
        x, v = motion(first)
        start = chamber_run.chamber_start(HEALTHY, float(x), float(v))
        settled = states[np.argmin(np.abs(angle - first - TURN))]
        # valves in motion are not quite in balance
        assert_allclose(start[0], settled[0], rtol=0, atol=1.5e3)
        assert_allclose(start[[2, 4]], settled[[2, 4]], rtol=0, atol=4e-4)


def test_healthy_pump(healthy):
    angle, states, flows = healthy
    last = slice(-10_000, None)
    p, stroke = states[last, 0], angle[last] % TURN
    suction = p[(stroke > 0.7) & (stroke < 2.5)]
    discharge = p[(stroke > 4.0) & (stroke < 5.6)]
    assert -5.0e4 < suction.min() < suction.max() < -4.2e4  # valve losses of some 15 kPa
    assert 3.12e5 < discharge.min() < discharge.max() < 3.2e5
    delivered = flows[last, 1].sum() / SWEPT
    assert 0.97 < delivered < 1.0
    for side, column in (("suction", 2), ("discharge", 4)):
        assert_array_equal(valves.lift_left(angle, states[:, column], side, 8e-3), 0.0)


# --- faults and limits


def test_cavitation_with_the_suction_valve_stuck_shut():
    liquid = Liquid()
    h = shut()
    angle = 0.1 + TURN * np.arange(10_001) / 10_000
    x, v = motion(angle)
    start = np.array([0.0, 0, 0, 0, 0, 0])
    done = chamber_run.run_chamber(h, x, v, step=2e-5, start=start)
    room = volume(h, angle)
    mass = room[0] / specific(0.0, liquid)
    bubble = room - mass * specific(float(h["vapour"]), liquid)
    boiling = bubble > 0
    assert 0.9 < boiling.mean() < 1.0
    assert_array_equal(done.states[boiling, 0], h["vapour"])
    # volumes to rounding, added up over 10,000 steps
    assert_allclose(done.states[:, 1], np.maximum(bubble, 0), rtol=0, atol=1e-12 * room.max())
    assert done.states[-1, 0] == pytest.approx(0.0, abs=0.1)  # back where it began: B 1e-13


def test_starved_suction_collapses_with_a_blow(healthy):
    angle, states, flows = run(chamber_of(suction=-9.0e4))
    vapour = states[:, 1] > 0
    assert 0.5 < vapour[-10_000:].mean() < 0.8
    assert states[:, 0].max() > 1.5 * healthy[1][:, 0].max()
    filled = flows[-10_000:, 0].sum()
    assert filled < 0.8 * SWEPT
    # the cylinder fills in the delivery stroke: the bubble outlives the dead centre
    bottom = np.argmin(np.abs(angle - 5 * math.pi))
    assert states[bottom, 1] > 0.1 * SWEPT


@pytest.mark.parametrize("leak", [2e-6, 2e-5])
def test_leaking_discharge_valve_follows_the_orifice_formula(healthy, leak):
    flows = run(chamber_of(discharge_valve=Valve(leak_area=leak)))[2]
    lost = healthy[2][-10_000:, 1].sum() - flows[-10_000:, 1].sum()
    suction = 1.6e4 + 3e4  # mean of the suction stroke, gauge below zero
    speed = Valve().discharge_coefficient * math.sqrt(2 * (3e5 + suction) / Liquid().density)
    # half a turn less the angle in which the valve closes and the pressure falls: 8 in 180 deg
    assert_allclose(lost, leak * speed * math.pi / SPEED * (1 - 8 / 180), rtol=0.05)


def test_stuck_valves():
    _, states, flows = run(chamber_of(suction_valve=Valve(stuck_lift=4e-3)))
    assert states[:, 0].max() < 0.1 * 3e5  # no pressure
    assert abs(flows[-10_000:, 1].sum()) < 1e-9 * SWEPT  # no delivery
    assert np.all(states[:, 2] == 4e-3)
    _, states, flows = run(chamber_of(discharge_valve=Valve(stuck_lift=4e-3)))
    assert states[-10_000:, 0].min() > 2e5
    assert abs(flows[-10_000:, 0].sum()) < 1e-9 * SWEPT


def quick(scale):
    """Rigid liquid; valves that open at `scale` times 2 kPa and pass the flow with no lift."""
    valve = Valve(stiffness=0.0, damping=0.0, mass=0.01 * scale)
    h = chamber_of(suction_valve=valve, discharge_valve=valve, liquid=RIGID).copy()
    for side in ("suction", "discharge"):
        h[f"{side}_preload"] = 2e3 * scale * h[f"{side}_area"]
        h[f"{side}_gap_conductance"] *= 10 / scale**2
    return h


def test_quick_valves_and_rigid_liquid_approach_the_two_levels():
    errors = []
    for scale in (1.0, 0.5, 0.25):
        angle, states, _ = run(quick(scale), substeps=8)
        last = slice(-10_000, None)
        stroke = angle[last] % math.pi
        away = (stroke > 0.25) & (stroke < 3.0)
        sharp = record(rung="two-level", rise_angle=0.01)
        levels = np.array(
            [piston_pressure.two_level_pressure(a, -3e4, 3e5, sharp) for a in angle[last]]
        )
        errors.append(np.abs(states[last, 0] - levels)[away].mean())
    # what is left is what opens the valves
    assert_allclose(errors, [2e3, 1e3, 0.5e3], rtol=0.05)


@pytest.mark.parametrize(("stiffness", "closes"), [(3.3e3, True), (1e3, True), (300.0, False)])
def test_soft_spring_is_noticed(stiffness, closes):
    valve = Valve(stiffness=stiffness)
    angle, states, _ = run(chamber_of(suction_valve=valve, discharge_valve=valve))
    for side, column in (("suction", 2), ("discharge", 4)):
        left = valves.lift_left(angle, states[:, column], side, valve.max_lift)
        assert len(left) == 3
        assert np.all(left < 0.03) if closes else np.all(left[1:] > 0.2)


def test_lift_left_counts_the_right_dead_centres():
    angle = np.linspace(1.0, 14.0, 20_000)
    lift = np.where(np.abs(angle - 3 * math.pi) < 0.01, 4e-3, 0.0)  # open there alone
    assert_array_equal(valves.lift_left(angle, lift, "suction", 8e-3, after=0.0), [0.0, 0.5])
    assert_array_equal(valves.lift_left(angle, lift, "discharge", 8e-3, after=math.pi), [0.0, 0.5])
    assert_array_equal(valves.lift_left(angle, lift, "discharge", 8e-3, after=0.0), [0.0, 0.0])
    with pytest.raises(ValueError, match="side = 'inlet' must be 'suction' or 'discharge'"):
        valves.lift_left(angle, lift, "inlet", 8e-3)


def test_status_instead_of_nonsense():
    x, v = motion(1.0)
    start = chamber_run.chamber_start(HEALTHY, float(x), float(v))
    for state, end, code in (
        (start, 0.3 + 1.1 * DEAD / AREA, chamber.CHAMBER_NO_VOLUME),
        (np.array([math.nan, 0, 0, 0, 0, 0]), float(x), chamber.CHAMBER_NOT_FINITE),
        (np.array([0, 0, 0, math.nan, 0, 0]), float(x), chamber.CHAMBER_NOT_FINITE),
        (np.array([0, 0, 0, 0, 0, math.inf]), float(x), chamber.CHAMBER_NOT_FINITE),
    ):
        after, flows = state.copy(), np.full(4, 7.0)
        found = chamber.chamber_step(after, flows, HEALTHY, 2e-5, float(x), float(v), end, 0.0, 1)
        assert found == code
        assert_array_equal(after, state)  # as it was
        assert_array_equal(flows, 7.0)


@settings(max_examples=60, deadline=None)
@given(
    speed=st.floats(0.1, 50.0),
    mass=st.floats(1e-3, 10.0),
    stiffness=st.floats(0.0, 1e5),
    air=st.sampled_from([0.0, 1e-6, 1e-3, 0.2]),
    modulus=st.sampled_from([1e8, 2.2e9, 1e12]),
    suction=st.floats(-9.8e4, 1e6),
    rise=st.floats(0.0, 1e8),
    dead=st.floats(1e-5, 1e-1),
    per_turn=st.sampled_from([50, 500, 5000]),
    leak=st.sampled_from([0.0, 1e-6, 1e-3]),
)
def test_any_pump_gives_numbers_or_a_status(
    speed, mass, stiffness, air, modulus, suction, rise, dead, per_turn, leak
):
    valve = Valve(mass=mass, stiffness=stiffness, leak_area=leak)
    h = chamber_of(
        suction=suction,
        discharge=suction + rise,
        suction_valve=valve,
        discharge_valve=valve,
        dead_volume=dead,
        liquid=Liquid(air_fraction=air, bulk_modulus=modulus),
    )
    angle = TURN * np.arange(3 * per_turn) / per_turn
    x, v = motion(angle)
    done = chamber_run.run_chamber(h, x, v * speed / 5, step=1 / speed / per_turn, substeps=1)
    assert done.code in (chamber.CHAMBER_OK, chamber.CHAMBER_NOT_FINITE)
    assert np.all(np.isfinite(done.states))
    assert np.all(np.isfinite(done.flows))
    if done.code == chamber.CHAMBER_OK:
        room = dead + AREA * (RADIUS + ROD - x)
        held = (room - done.states[:, 1]) / specific(
            done.states[:, 0], Liquid(air_fraction=air, bulk_modulus=modulus)
        )
        net = np.abs(np.diff(held) - (done.flows[:, 0] - done.flows[:, 1]))
        assert net.max() <= 1e-12 * (held.max() + np.abs(done.flows).max())


@kernel
def _twice(records, state, flows, x, v, step):
    h = records[0]
    code = chamber.chamber_step(state, flows, h, step, x, v, x, v, 1)
    pressure, mass = piston_pressure.line_pressure(1.0, 30.0, v, h)
    return code + chamber.chamber_step(state, flows, h, step, x, v, x, v, 1), pressure, mass


def test_records_pass_inside_kernels():
    records = parameters.hydraulic_parameters(
        CylinderPressure(**CHAMBER), area=AREA, crank_radius=RADIUS, rod_length=ROD, speed=SPEED
    )
    state, flows = chamber_run.chamber_start(records[0], 0.25, 0.0), np.zeros(4)
    assert _twice(records, state, flows, 0.25, 0.0, 2e-5) == (0, 0.0, 0.0)


# --- the parts of a scene


def faults(table):
    with pytest.raises(SceneError) as caught:
        validate_table(CylinderPressure, table, "pressure")
    return "\n".join(caught.value.faults)


def test_what_a_rung_needs_is_named_at_once():
    text = faults({"rung": "chamber", "discharge": "0.3 MPa"})
    for name in ("suction_valve", "discharge_valve", "dead_volume"):
        assert f"{name} is missing; the rung 'chamber' needs it" in text
    text = faults({"rung": "heads", "suction": "0.1 MPa"})
    assert "suction_line is missing" in text
    assert "discharge_line is missing" in text
    assert "discharge = 0 Pa must be >= suction = 100000 Pa; swap them" in text


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"suction_valve": {"max_lift": "20 mm"}}, "max_lift = 0.02 m must be <= diameter / 4"),
        ({"suction_valve": {"stuck_lift": "9 mm"}}, "stuck_lift = 0.009 m must be <= max_lift"),
        ({"suction_valve": {"mass": "1 mg"}}, "has unit 'mg', not one of mass"),
        ({"suction_valve": {"seat_stiffness": 1e13}}, "rad/s; soften the seat"),
        ({"discharge_valve": {"stuck_lift": 0}}, "a cylinder without a way out bursts"),
        ({"suction": "-0.1 MPa"}, "must be > the liquid's vapour pressure = -98986 Pa gauge"),
        (
            {"rung": "two-level", "suction": "-0.1 MPa"},
            "suction = -100000 Pa must be > the liquid's vapour pressure = -98986 Pa gauge",
        ),
        (
            {"rung": "constant", "suction": "-0.1 MPa", "discharge": "-0.1 MPa"},
            "discharge = -100000 Pa must be > the liquid's vapour pressure = -98986 Pa gauge",
        ),
        ({"liquid": {"density": "1 kg"}}, "has unit 'kg', not one of density"),
        ({"dead_volume": "0 L"}, "dead_volume"),
    ],
)
def test_refusals(table, says):
    base = {
        "rung": "chamber",
        "discharge": 3e5,
        "suction_valve": {},
        "discharge_valve": {},
        "dead_volume": "0.5 L",
    }
    assert re.search(re.escape(says), faults({**base, **table}))


def test_stuck_shut_discharge_is_allowed_beside_an_open_suction():
    pressure = {**CHAMBER, "discharge_valve": Valve(stuck_lift=0.0)}
    assert CylinderPressure(**{**pressure, "suction_valve": Valve(stuck_lift=1e-3)})


def test_scenes_of_the_first_rungs_stay_valid():
    old = {"rung": "two-level", "suction": "-0.03 MPa", "discharge": "0.30 MPa"}
    pressure = validate_table(CylinderPressure, {**old, "rise_angle": "6 deg"}, "pressure")
    assert (pressure.suction, pressure.discharge) == (-3e4, 3e5)
    assert CylinderPressure(rung="none").discharge == 0.0


def test_valve_groups_add_up():
    four = chamber_of()
    alone = Valve().model_dump() | {"count": 1}
    one = chamber_of(suction_valve=Valve(**alone))
    for name in ("gap_conductance", "area", "mass", "stiffness", "preload", "seat_stiffness"):
        assert_allclose(four[f"suction_{name}"], 4 * one[f"suction_{name}"], rtol=1e-15)
    assert chamber_run.chamber_substeps(four, 2e-5) == chamber_run.chamber_substeps(one, 2e-5) == 1
    # sqrt(50e6 / 0.1) = 22361 rad/s, half a radian each
    assert chamber_run.chamber_substeps(four, 1e-3) == 45
