"""Pipes of a pump: surge, organ pipe, damper and relief valve against closed forms; their books."""

import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from wearstate.sim.hydraulics.liquid import air_volume, mixture_volume
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.mechanism.crank_run import run_mechanism
from wearstate.sim.output.status import Status
from wearstate.sim.piping import coupling
from wearstate.sim.piping import pipe as pp
from wearstate.sim.pump.ladder import pressure_rungs, pump_cost
from wearstate.sim.pump.scene_run import run_scene
from wearstate.sim.pump.validity import limits, pump_step
from wearstate.sim.pump_lanes.lanes import lane_kind
from wearstate.sim.pump_setup.joints import hydraulics_of
from wearstate.sim.pump_setup.tables import lines_of, tables_and_start
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.pump_hydraulics import (
    STANDARD_ATMOSPHERE,
    Damper,
    Line,
    Liquid,
    ReliefValve,
)
from wearstate.sim.scene.scene import SceneError

RHO, SPEED, LENGTH, BORE = 998.2, 1200.0, 12.0, 0.08
AREA = math.pi / 4 * BORE**2
FAR = 5e6
SMOOTH = Line(length=LENGTH, wave_speed=SPEED, friction_factor=0.0, minor_loss=0.0)
BOTH = pytest.mark.parametrize("waves", [True, False], ids=["waves", "lumped"])
PIPED = {
    "pressure.suction_line.wave_speed": 1000.0,
    "pressure.discharge_line.wave_speed": 1200.0,
    "pressure.suction_line.length": 0.5,
    "pressure.discharge_line.length": 3.0,
}
DAMPED = PIPED | {
    "pressure.suction_line.damper": {"gas_volume": 2e-3},
    "pressure.discharge_line.damper": {"gas_volume": 2e-3},
}
STEP = 1 / 51200


def march(line, drawn, *, step, waves, start=0.0, far=FAR):
    """Pressure at the node and flow at the far end, means over the steps; pipe and final state."""
    pipes = pp.pipe_parameters(
        line, Liquid(density=RHO), far=far, relief_back=0.0, step=step, waves=waves
    )
    states, nodes = pp.pipe_start(pipes[0], start)
    drawn = np.asarray(drawn, dtype=float)
    pressure, entering = np.zeros(drawn.size), np.zeros(drawn.size)
    pp.drive_pipe(pipes, states, nodes, drawn, step, pressure, entering)
    return pressure, entering, pipes[0], states[0]


def ringing(line, *, step, waves, periods, frequency):
    """Frequency at which a line rings at a closed end after a small flow is stopped [Hz]."""
    n = int(periods / frequency / step)
    pressure, *_ = march(line, np.zeros(n), step=step, waves=waves, start=1e-4)
    rest = pressure - FAR
    up = np.flatnonzero((rest[:-1] < 0) & (rest[1:] >= 0))
    times = up - rest[up] / (rest[up + 1] - rest[up])
    return (len(times) - 1) / ((times[-1] - times[0]) * step)


# --- closed forms


def test_a_column_stopped_at_once_strikes_as_joukowsky_says():
    velocity = 1.0
    pressure, *_ = march(SMOOTH, np.zeros(400), step=1e-4, waves=True, start=velocity * AREA)
    travel = round(2 * LENGTH / SPEED / 1e-4)  # there and back
    assert_allclose(pressure[:travel] - FAR, RHO * SPEED * velocity, rtol=1e-9)
    assert_allclose(pressure[travel : 2 * travel] - FAR, -RHO * SPEED * velocity, rtol=1e-9)


@pytest.mark.parametrize(
    ("waves", "step"), [(True, 1e-4), (True, 2e-3 * 0.999), (True, 1.7e-3), (False, 1e-4)]
)
def test_a_closed_end_rings_as_an_organ_pipe(waves, step):
    # also with a length that is no whole number of reaches, down to the fewest that are allowed
    quarter = SPEED / (4 * LENGTH)
    found = ringing(SMOOTH, step=step, waves=waves, periods=20, frequency=quarter)
    assert_allclose(found, quarter, rtol=5e-3)


def test_third_harmonic_of_an_organ_pipe():
    """Waves have it, as the odd frequencies of a pipe closed at one end: driven, it is a peak."""
    step, quarter = 1e-4, SPEED / (4 * LENGTH)
    time = step * np.arange(8000)
    flow = 1e-5 * np.sin(2 * math.pi * 3 * quarter * time)
    amplitude = np.ptp(march(SMOOTH, flow, step=step, waves=True)[0][4000:])
    aside = np.ptp(
        march(SMOOTH, 1e-5 * np.sin(2 * math.pi * 4 * quarter * time), step=step, waves=True)[0][
            4000:
        ]
    )
    assert amplitude > 30 * aside  # it grows from cycle to cycle at resonance


def impedance(frequency, compliance, waves):
    """Pressure over drawn flow at a node with a damper; of the pipe alone and with the gas [Pa]."""
    omega = 2 * math.pi * frequency
    z = RHO * SPEED / AREA
    if waves:
        pipe = 1j * z * math.tan(omega * LENGTH / SPEED)
    else:
        spring = pp.FIRST_MODE * LENGTH * AREA / (RHO * SPEED**2)
        inertia = 1j * omega * RHO * LENGTH / AREA
        pipe = 1 / (1 / inertia + 1j * omega * spring)
    return abs(1 / (1 / pipe + 1j * omega * compliance))


@BOTH
@pytest.mark.parametrize("share", [0.3, 0.7, 1.6, 3.0])
def test_transfer_of_a_damper(waves, share):
    """Pressure per flow below and above the Helmholtz frequency, at small amplitude."""
    volume, step = 1e-3, 2e-4
    line = SMOOTH.model_copy(update={"damper": Damper(gas_volume=volume)})
    compliance = volume / (1.4 * (FAR + STANDARD_ATMOSPHERE))
    helmholtz = 1 / (2 * math.pi * math.sqrt(RHO * LENGTH / AREA * compliance))
    frequency = share * helmholtz
    per_cycle = round(1 / (frequency * step))
    frequency = 1 / (per_cycle * step)
    # nothing is damped: a slow rise leaves the own frequency alone
    phase = 2 * math.pi * (np.arange(240 * per_cycle) + 0.5) / per_cycle
    ramp = np.minimum(1.0, phase / (2 * math.pi * 120))
    pressure = march(line, 1e-6 * ramp * np.sin(phase), step=step, waves=waves)[0] - FAR
    kept = slice(-80 * per_cycle, None)
    found = 2 * abs(np.mean(pressure[kept] * np.exp(-1j * phase[kept]))) / 1e-6
    assert_allclose(found, impedance(frequency, compliance, waves), rtol=5e-3)


@BOTH
def test_a_damper_rings_at_its_own_frequency(waves):
    volume = 1e-3
    line = SMOOTH.model_copy(update={"damper": Damper(gas_volume=volume)})
    compliance = volume / (1.4 * (FAR + STANDARD_ATMOSPHERE))
    rough = 1 / (2 * math.pi * math.sqrt(RHO * LENGTH / AREA * compliance))
    z = RHO * SPEED / AREA
    if waves:  # cot(w L / a) = Z w C
        own = brentq(
            lambda f: (
                1 / math.tan(2 * math.pi * f * LENGTH / SPEED) - z * 2 * math.pi * f * compliance
            ),
            0.5 * rough,
            1.2 * rough,
        )
    else:
        spring = pp.FIRST_MODE * LENGTH * AREA / (RHO * SPEED**2)
        own = 1 / (2 * math.pi * math.sqrt(RHO * LENGTH / AREA * (compliance + spring)))
    found = ringing(line, step=1e-4, waves=waves, periods=20, frequency=own)
    assert_allclose(found, own, rtol=5e-4)  # BDF2 at this step; linear to 1e-4


@BOTH
def test_a_steady_flow_loses_what_darcy_and_weisbach_say(waves):
    line = SMOOTH.model_copy(update={"friction_factor": 0.02, "minor_loss": 1.5})
    flow = 3.0 * AREA
    steady = (0.02 * LENGTH / BORE + 1.5) * RHO * 3.0**2 / 2
    for sign in (1.0, -1.0):  # towards the pump, and from it
        pressure, entering, *_ = march(
            line, np.full(50, sign * flow), step=1e-3, waves=waves, start=sign * flow
        )
        assert_allclose(FAR - pressure, sign * steady, rtol=1e-6)
        assert_allclose(entering, sign * flow, rtol=1e-9)


@BOTH
@pytest.mark.parametrize("flow", [0.004, 0.009])
def test_a_relief_valve_lets_out_what_the_line_does_not_take(waves, flow):
    relief = ReliefValve(set_pressure=1.02 * FAR, diameter=0.008)  # in part, then fully open
    narrow = Line(length=LENGTH, diameter=0.025, wave_speed=SPEED, relief=relief)
    conductance = 0.7 * math.pi / 4 * 0.008**2 * math.sqrt(2 / RHO)
    loss = (0.02 * LENGTH / 0.025 + 1.5) * RHO / 2 / (math.pi / 4 * 0.025**2) ** 2

    def left(p):
        share = min(max(p - relief.set_pressure, 0.0) / (0.1 * relief.set_pressure), 1.0)
        return flow - math.sqrt((p - FAR) / loss) - share * conductance * math.sqrt(p)

    expected = brentq(left, FAR, 1e9)
    pressure, *_ = march(narrow, np.full(20000, -flow), step=5e-4, waves=waves, start=-1e-3)
    assert_allclose(pressure[-1], expected, rtol=1e-5)
    assert expected > relief.set_pressure


# --- vapour


def test_a_column_parts_where_its_reflection_would_fall_below_the_vapour_pressure():
    """The cavity grows by what leaves the closed end less what the far end's pressure gives."""
    z, vapour = RHO * SPEED / AREA, Liquid().vapour_pressure - STANDARD_ATMOSPHERE
    flow = 2.0 * (FAR - vapour) / z
    travel, n = round(2 * LENGTH / SPEED / 1e-4), 150
    pressure, _, _, state = march(SMOOTH, np.zeros(travel + n), step=1e-4, waves=True, start=flow)
    assert_allclose(pressure[travel:], vapour, rtol=0, atol=1e-6)
    grown = (flow - (FAR - vapour) / z) * n * 1e-4
    assert_allclose(state["void"], grown, rtol=1e-9)
    assert state["parted"] == n


@BOTH
def test_no_pressure_below_that_of_the_vapour(waves):
    vapour = Liquid().vapour_pressure - STANDARD_ATMOSPHERE
    flow = 8e-3 * np.sin(2 * math.pi * 7 * 1e-3 * np.arange(4000))
    pressure, _, _, state = march(SMOOTH, flow, step=1e-3, waves=waves, far=0.0)
    assert pressure.min() == vapour
    assert state["parted"] > 0


# --- books


@pytest.mark.parametrize("far", [FAR, 0.0], ids=["full", "with vapour"])
def test_volumes_close_to_rounding(far):
    """What the far end gives is drawn, or is in the spring, in the gas's place, or vapour's."""
    line = SMOOTH.model_copy(
        update={"damper": Damper(gas_volume=1e-4), "minor_loss": 2.0, "friction_factor": 0.02}
    )
    rng, step = np.random.default_rng(5), 1e-3
    drawn = 4e-3 * rng.standard_normal(3000)
    _, entering, pipe, state = march(line, drawn, step=step, waves=False, far=far)
    gas = pipe["gas_volume"] - state["gas"]
    spring = pipe["compliance"] * (state["end"] - far)
    assert_allclose(
        step * np.sum(entering - drawn), spring + gas - state["void"], rtol=0, atol=1e-12
    )
    assert abs(gas) > 1e-8


@BOTH
def test_a_frictionless_pipe_keeps_its_energy(waves):
    """Periodic: the far end's work is the node's; with a loss the difference is the loss's."""
    per_cycle, cycles, step = 400, 60, 1e-4
    phase = 2 * math.pi * (np.arange(cycles * per_cycle) + 0.5) / per_cycle
    drawn = 0.01 + 1e-3 * np.minimum(1.0, phase / (2 * math.pi * 30)) * np.sin(phase)
    for minor in (0.0, 20.0):
        line = Line(length=3.0, wave_speed=SPEED, friction_factor=0.0, minor_loss=minor)
        pressure, entering, *_ = march(line, drawn, step=step, waves=waves, start=0.01)
        last = slice(-10 * per_cycle, None)
        lost = np.mean(FAR * entering[last] - pressure[last] * drawn[last])
        expected = 0.5 * RHO * minor / AREA**2 * np.mean(np.abs(entering[last]) ** 3)
        # of the work that goes to and fro, 1e-3 m^3/s times the pressure's swing
        swing = 1e-3 * np.ptp(pressure[last])
        assert_allclose(lost, expected, rtol=5e-3, atol=2e-3 * swing)


@pytest.mark.parametrize("step", [1e-4, 1.7e-3])
def test_a_pipe_with_waves_never_gains(step):
    n = 20000
    pressure, *_ = march(SMOOTH, np.zeros(n), step=step, waves=True, start=1e-4)
    levels = [np.std(pressure[k : k + 2000]) for k in (0, 8000, 16000)]
    assert levels[0] * (1 + 1e-9) >= levels[1] >= levels[2] * (1 - 1e-9)
    if step == 1e-4:  # whole reaches lose nothing
        assert_allclose(levels[2], levels[0], rtol=1e-9)


@pytest.mark.parametrize("volume", [None, 1e-3])
def test_a_column_on_a_spring_or_gas_is_hardly_damped(volume):
    """By (w h)^3 / 4 of the critical, as BDF2 is: first order anywhere would halve the swing."""
    damper = None if volume is None else Damper(gas_volume=volume)
    line, n = SMOOTH.model_copy(update={"damper": damper}), 40_000
    pressure, *_ = march(line, np.zeros(n), step=1e-4, waves=False, start=1e-4)
    begin, end = np.ptp(pressure[: n // 8]), np.ptp(pressure[-n // 8 :])
    rate = 2 * math.pi * (SPEED / (4 * LENGTH) if volume is None else 8.07)
    left = math.exp(-((rate * 1e-4) ** 3) / 4 * rate * 1e-4 * n)
    assert 2 * left - 1.001 < end / begin < 1.0001


# --- in a pump


def pump(rung, overrides, name="bilge-pump"):
    return load_scene(name, {**overrides, "pressure.rung": rung, "joint.crankpin.rung": "ideal"})


def ran(scene, n=20480, step=STEP):
    return run_scene(scene, step=step, n_steps=n, start_angle=0.0, keep_states=True)


@pytest.mark.parametrize("rung", ["lumped-lines", "wave-lines"])
def test_a_pipe_without_length_is_a_constant_pressure_to_the_last_byte(rung):
    none = {
        f"pressure.{side}_line.{name}": value
        for side in ("suction", "discharge")
        for name, value in {"length": 0.0, "minor_loss": 0.0, "wave_speed": 1000.0}.items()
    }
    chamber, piped = ran(pump("chamber", none), 4096), ran(pump(rung, none), 4096)
    assert_array_equal(piped.chambers, chamber.chambers)
    assert_array_equal(piped.forces, chamber.forces)
    assert_array_equal(piped.ends, np.broadcast_to([-3e4, 3e5], piped.ends.shape))


def test_a_short_pipe_tends_to_the_constant_pressure():
    short = {
        f"pressure.{side}_line.{name}": value
        for side in ("suction", "discharge")
        for name, value in {"minor_loss": 0.0, "friction_factor": 0.0, "wave_speed": 1e3}.items()
    }
    chamber = ran(pump("chamber", short)).chambers[:, 0, 0]
    off = []
    for length in (4e-3, 2e-3, 1e-3):
        lengths = {f"pressure.{side}_line.length": length for side in ("suction", "discharge")}
        piped = ran(pump("lumped-lines", short | lengths)).chambers[:, 0, 0]
        off.append(np.sqrt(np.mean((piped - chamber) ** 2)))
    assert off[0] > 1.6 * off[1] > 1.6**2 * off[2]  # of first order in the length
    assert off[2] < 3e-3 * np.std(chamber)


def test_below_the_organ_pipe_waves_are_a_column_on_a_spring():
    lumped, waves = (ran(pump(rung, DAMPED)).ends[8192:] for rung in ("lumped-lines", "wave-lines"))
    assert np.all(np.std(lumped, axis=0) > 5e3)
    assert np.all(np.std(waves - lumped, axis=0) < 0.01 * np.std(lumped, axis=0))


def test_a_pump_draws_from_its_lines_what_they_give():
    """Volume: what a step leaves over is booked. Momentum: the mean drop is the mean loss."""
    scene = pump("lumped-lines", DAMPED | {"pressure.suction_line.minor_loss": 30.0})
    lines = lines_of(scene, STEP)
    assert lines is not None
    t, start = tables_and_start(scene, STEP, 0.0)
    per_turn = round(1 / scene.drive.speed / STEP)
    run = run_mechanism(
        t, **start._asdict(), lines=lines, step=STEP, n_steps=10 * per_turn, keep_states=False
    )
    assert run.status.ok
    assert run.parted_steps == (0, 0)
    swept = math.pi / 4 * 0.1**2 * 0.1
    assert np.all(np.abs(lines.states["void"]) < 1e-9 * swept)
    assert run.ends is not None
    suction = run.ends[-5 * per_turn :, 0] + 3e4
    # a line of 0.5 m with its losses passes little of what pulses: the flow is nearly the mean
    mean_flow = swept * scene.drive.speed
    loss = (30.0 + 0.02 * 0.5 / 0.08) * RHO / 2 * (mean_flow / AREA) ** 2
    assert -2.5 * loss < suction.mean() < -loss


def test_a_cylinder_that_breathes_through_its_line_alone():
    """Suction valve shut, discharge valve stuck open: against an independent solver."""
    scene = pump(
        "lumped-lines",
        {
            "pressure.suction_line.wave_speed": 1000.0,
            "pressure.discharge_line.wave_speed": 1200.0,
            "pressure.discharge_line.length": 2.0,
            "pressure.discharge_line.damper": {"gas_volume": 1e-3},
            "pressure.suction_valve.stuck_lift": 0.0,
            "pressure.discharge_valve.stuck_lift": 0.003,
            "pressure.discharge": 1e6,
        },
    )
    run = ran(scene, 8192)
    h, pressure = hydraulics_of(scene, 0)[0], scene.pressure
    line, liquid = pressure.discharge_line, pressure.liquid
    area, gas, turn = math.pi / 4 * 0.08**2, 1e-3, 2 * math.pi * scene.drive.speed
    face = math.pi / 4 * 0.1**2
    inertance = liquid.density * line.length / area
    loss = liquid.density / 2 / area**2 * (line.minor_loss + 0.02 * line.length / 0.08)
    spring = pp.FIRST_MODE * line.length * area / (liquid.density * 1200.0**2)
    open_by = h["discharge_gap_conductance"] * 0.003 + h["discharge_leak_conductance"]

    def volume(time):
        sine = scene.crank.radius * np.sin(turn * time)
        x = scene.crank.radius * np.cos(turn * time) + np.sqrt(scene.rod.length**2 - sine**2)
        rate = (
            -sine
            * turn
            * (
                1
                + scene.crank.radius
                * np.cos(turn * time)
                / (np.sqrt(scene.rod.length**2 - sine**2))
            )
        )
        top = scene.crank.radius + scene.rod.length
        return pressure.dead_volume + face * (top - x), -face * rate

    def specific(pressure):
        return mixture_volume(pressure, air_volume(pressure, h), h)[0]

    def rates(time, y):
        mass, node, flow = y
        room, _ = volume(time)
        p = brentq(lambda q: specific(q) * mass - room, -1.01e5, 1e9, xtol=1e-6)
        drop = p - node
        out = open_by * drop / math.sqrt(abs(drop) + 1.0)
        n, absolute = 1.4, node + STANDARD_ATMOSPHERE
        soft = gas / n * (1e6 + STANDARD_ATMOSPHERE) ** (1 / n) * absolute ** (-1 / n - 1)
        return [
            -out,
            (flow + out) / (spring + soft),
            (1e6 - node - loss * flow * abs(flow)) / inertance,
        ]

    begin = run.chambers[0, 0, 0]
    mean = 2 * face * scene.crank.radius * scene.drive.speed
    lines = lines_of(scene, STEP)
    y0 = [volume(0.0)[0] / specific(begin), lines.states["mean"][1], -mean]
    end = 8192 * STEP
    found = solve_ivp(
        rates,
        (0, end),
        y0,
        rtol=1e-8,
        atol=1e-12,
        max_step=1e-3,
        method="LSODA",
        t_eval=STEP * (np.arange(1, 8193) - 0.5),
    )
    off = run.ends[1:, 1] - found.y[1]
    assert np.sqrt(np.mean(off**2)) < 5e-3 * np.std(found.y[1])


def test_throws_feel_each_other_and_a_damper_calms_them():
    lines = {
        "pressure.suction_line.wave_speed": 1000.0,
        "pressure.suction_line.length": 1.0,
        "pressure.discharge_line.wave_speed": 1300.0,
        "pressure.discharge_line.length": 10.0,
        "pressure.discharge_line.diameter": 0.03,
    }
    bare = ran(pump("wave-lines", lines, "triplex-pump"), 16384)
    vessel = {"pressure.discharge_line.damper": {"gas_volume": 2e-3}}
    calm = ran(pump("wave-lines", lines | vessel, "triplex-pump"), 16384)
    swing = [np.std(run.ends[8192:, 1]) for run in (bare, calm)]
    assert swing[0] > 1e5
    assert swing[1] < 0.2 * swing[0]
    relief = {"pressure.discharge_line.relief": {"set_pressure": 10.1e6, "diameter": 0.01}}
    cut = ran(pump("wave-lines", lines | relief, "triplex-pump"), 16384)
    assert cut.ends[8192:, 1].max() < bare.ends[8192:, 1].max() - 2e5


def orifice(drop):
    return 2e-5 * drop / math.sqrt(abs(drop) + 1.0)


def between_pipes(at_suction, at_discharge):
    """What a pump draws that pushes 1 L/s and has a wide gap open between its pipes [m^3/s]."""
    through = 1e-3 + orifice(at_suction - at_discharge)
    return through, -through


@pytest.mark.parametrize(
    ("waves", "far"),
    [(True, (3e5, 3.2e5)), (False, (3e5, 3.2e5)), (True, (-6e4, 6e5)), (True, (-1.1e5, 3e5))],
    ids=["waves", "lumped", "steep", "parted"],
)
def test_two_pipes_agree_with_what_flows_between_them(waves, far):
    """Against brackets, one inside the other; the gap conducts some hundred times a pipe's flow."""
    liquid, h = Liquid(density=RHO), 1e-4
    pipes = np.concatenate(
        [
            pp.pipe_parameters(SMOOTH, liquid, far=p, relief_back=0.0, step=h, waves=waves)
            for p in far
        ]
    )
    starts = [pp.pipe_start(pipe, 0.0) for pipe in pipes]
    states, nodes = np.concatenate([s for s, _ in starts]), tuple(n for _, n in starts)
    pair = np.zeros(1, coupling.PAIR)[0]
    coupling.begin_pair(pair, pipes.view(np.recarray), states.view(np.recarray))
    tries = 1
    args = pipes.view(np.recarray), states.view(np.recarray), nodes, h
    while not coupling.seek_pair(pair, *between_pipes(*pair["pressure"]), *args):
        tries += 1
    assert tries < coupling.MOST_TRIES  # it starts without any slope of the pump
    vapour = pipes["vapour"][0]

    def gap(side, *pressures):
        drawn = between_pipes(*pressures)[side]
        pipe, state = pipes.view(np.recarray)[side], states.view(np.recarray)[side]
        return pp.excess(pressures[side], drawn, pipe, state, nodes[side], h)[0]

    def suction_at(p):
        if gap(0, vapour, p) >= 0:
            return vapour
        return brentq(lambda q: gap(0, q, p), vapour, 1e8, xtol=1e-6, rtol=1e-14)

    discharge = vapour
    if gap(1, suction_at(vapour), vapour) < 0:
        discharge = brentq(lambda p: gap(1, suction_at(p), p), vapour, 1e8, rtol=1e-14)
    expected = [suction_at(discharge), discharge]
    # what may be left over, as a pressure of a pipe: 1e-8 of the absolute one
    assert_allclose(pair["pressure"], expected, rtol=0, atol=1e-7 * (max(expected) + 1e5))


@pytest.mark.parametrize(("suction", "discharge", "most"), [(0.5, 6.0, 1e-3), (2.0, 6.0, 4e-3)])
def test_parted_columns_settle(suction, discharge, most):
    """Searched one by one, 14 and 6 % of these steps ended without both pressures."""
    lengths = {
        "pressure.suction_line.length": suction,
        "pressure.discharge_line.length": discharge,
    }
    run = ran(pump("wave-lines", PIPED | lengths), 10240)
    assert run.status.ok
    assert min(run.parted_steps) > 0.1 * run.steps
    assert max(run.unsettled_steps) < most * run.steps


@pytest.mark.parametrize("rung", ["lumped-lines", "wave-lines"])
def test_a_recording_tells_of_its_lines(rung):
    scene = load_scene("bilge-pump", {**DAMPED, "pressure.rung": rung, "duration": "0.3 s"})
    solution = simulate(scene, seed=1, truth=True)
    assert solution.status.ok
    for side, level in (("suction", -3e4), ("discharge", 3e5)):
        line = solution.truth[f"{side}_line_pressure_pa"]
        assert line.shape == solution.signal.shape[-1:]
        assert 0.2 * abs(level) < np.ptp(line) < 3 * abs(level)
        assert solution.numerics[f"{side}_line_parted_share"] == 0
    assert not any("parts" in text for text in solution.warnings)
    assert solution.numerics["lines_unsettled_share"] == 0
    torn = simulate(
        load_scene(
            "bilge-pump",
            {
                **PIPED,
                "pressure.rung": rung,
                "duration": "0.3 s",
                "pressure.discharge_line.length": 6.0,
            },
        ),
        seed=1,
    )
    assert torn.numerics["discharge_line_parted_share"] > 0.01
    assert any("column of the discharge line parts" in text for text in torn.warnings)


def test_lanes_leave_pipes_alone():
    assert lane_kind(load_scene("bilge-pump", {"pressure.rung": "chamber"})) is not None
    for rung in ("lumped-lines", "wave-lines"):
        assert lane_kind(load_scene("bilge-pump", {**PIPED, "pressure.rung": rung})) is None


def test_a_pipe_of_waves_has_five_reaches_at_the_least():
    scene = load_scene("bilge-pump", {**PIPED, "pressure.rung": "wave-lines"})
    assert pump_step(scene) <= 0.5 / (5 * 1000.0)
    short = {**PIPED, "pressure.rung": "wave-lines", "pressure.suction_line.length": 0.06}
    assert pump_step(load_scene("bilge-pump", short)) == pytest.approx(0.06 / 5000)
    lines = lines_of(load_scene("bilge-pump", short), pump_step(load_scene("bilge-pump", short)))
    assert lines is not None
    assert lines.pipes["reaches"][0] == 5
    told = load_scene("bilge-pump", short | {"numerics.step": "15 us"})
    [(status, text)] = limits(told)
    assert status is Status.STEP
    assert re.search(r"numerics.step = 1.5e-05 s must be <= 1.2e-05 s.*suction_line; shorten", text)
    assert limits(load_scene("bilge-pump", short | {"numerics.step": "12 us"})) == []


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({}, r"suction_line.wave_speed is missing.*at most 196 m/s of this liquid"),
        (
            {**PIPED, "pressure.suction_line.rise": 11.0},
            r"suction at the pump = -137679 Pa must be >",
        ),
        ({**PIPED, "pressure.suction_line.damper": {"gas_volume": 0}}, r"gas_volume = 0"),
        (
            {**PIPED, "pressure.discharge_line.relief": {"set_pressure": -1, "diameter": 0.01}},
            r"set_pressure = -1",
        ),
    ],
)
def test_faults_of_lines_say_their_cure(overrides, words):
    with pytest.raises(SceneError, match=words):
        load_scene("bilge-pump", {**overrides, "pressure.rung": "wave-lines"})


def test_throws_share_their_lines():
    own = {**PIPED, "pressure.rung": "lumped-lines", "throws.1.pressure.discharge": "9 MPa"}
    with pytest.raises(SceneError, match=r"throws.1.pressure.discharge must be that of the first"):
        load_scene("triplex-pump", own)


def test_the_ladder_offers_pipes_where_their_waves_are_known():
    names = [rung.name for rung in pressure_rungs(load_scene("bilge-pump"))]
    assert names[-1] == "chamber"
    scene = load_scene("bilge-pump", PIPED)
    assert [rung.name for rung in pressure_rungs(scene)][-2:] == ["lumped-lines", "wave-lines"]
    costs = [
        pump_cost(load_scene("bilge-pump", {**PIPED, "pressure.rung": rung}))
        for rung in ("chamber", "lumped-lines", "wave-lines")
    ]
    assert costs == sorted(costs)
    assert costs[1] < costs[2]
