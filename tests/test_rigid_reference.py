"""The compliant crank against rigid impacts: stiffness to infinity at fixed clearance."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.sim.mechanism.crank_run import run_mechanism
from wearstate.sim.pump_setup import tables
from wearstate.sim.scene.load import load_scene

_SPEC = importlib.util.spec_from_file_location(
    "reference_rigid", Path(__file__).with_name("reference_rigid.py")
)
rigid = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(rigid)

START_ANGLE = 0.7  # rad
HORIZON = 1.2e-3  # s: four impacts at the benchmark's speed, long before they accumulate
STATE_COLUMNS = [3, 9, 2, 8]  # of the bodies: piston and its velocity, rod angle and its rate
RESTITUTION = 0.8
STIFFNESSES = 3e10 * 4.0 ** np.arange(5)  # N/m


def benchmark_crank():
    scene = load_scene("slider-crank-benchmark")
    return rigid.Crank(
        crank_radius=scene.crank.radius,
        rod_length=scene.rod.length,
        rod_mass=scene.rod.mass,
        rod_centre=scene.rod.centre_of_mass,
        inertia=scene.rod.inertia,
        piston_mass=scene.piston.mass,
        speed=2 * math.pi * scene.drive.speed,
        clearance=scene.joint.crankpin.clearance_radial,
    )


CRANK = benchmark_crank()


def centred_start(crank, angle):
    """Pin in the middle of its eye, moving as without clearance."""
    b = math.asin(crank.crank_radius * math.sin(angle) / crank.rod_length)
    w = crank.speed * crank.crank_radius * math.cos(angle) / (crank.rod_length * math.cos(b))
    x = crank.crank_radius * math.cos(angle) + crank.rod_length * math.cos(b)
    u = -crank.crank_radius * math.sin(angle) * crank.speed - crank.rod_length * math.sin(b) * w
    return angle, x, u, b, w


# --- the reference itself


def test_a_standing_crank_keeps_its_energy_at_full_restitution():
    standing = CRANK._replace(speed=0.0)
    start = np.add(centred_start(standing, 1.1), [0.0, 0.0, 2.0, 0.0, 25.0])
    run = rigid.rigid_run(standing, start, 1.0, 6e-3)
    assert len(run.times) > 10
    energy = [rigid.kinetic_energy(state, standing) for state in (start, *run.after)]
    # Tolerance 1e-12 a step, a few thousand steps of 2e-5 s at most.
    assert_allclose(energy, energy[0], rtol=1e-10)


@pytest.mark.parametrize(("restitution", "horizon"), [(1.0, 4e-3), (0.8, 2e-3), (0.3, 3.4e-4)])
def test_energy_is_what_the_crank_gives_less_the_loss(restitution, horizon):
    """At an impact the crank does the work P n . v_pin, and half m (1 - e^2) v^2 is lost."""
    start = centred_start(CRANK, START_ANGLE)
    run = rigid.rigid_run(CRANK, start, restitution, horizon)
    assert len(run.times) >= 2
    expected = [rigid.kinetic_energy(start, CRANK)]
    for before, impulse, normal in zip(run.before, run.impulses, run.directions, strict=True):
        speed = normal @ rigid.offset(before, CRANK)[1]
        mass = impulse / ((1 + restitution) * speed)
        work = impulse * (normal @ rigid.pin_direction(before[0], CRANK)) * CRANK.speed
        expected.append(expected[-1] + work - 0.5 * mass * (1 - restitution**2) * speed**2)
    found = [rigid.kinetic_energy(state, CRANK) for state in (start, *run.after)]
    assert_allclose(found, expected, rtol=1e-10)  # as above


def test_an_impact_returns_the_normal_speed_and_leaves_the_sliding():
    start = centred_start(CRANK, START_ANGLE)
    run = rigid.rigid_run(CRANK, start, RESTITUTION, HORIZON)
    for before, after, normal in zip(run.before, run.after, run.directions, strict=True):
        place, incoming = rigid.offset(before, CRANK)
        outgoing = rigid.offset(after, CRANK)[1]
        assert_allclose(np.linalg.norm(place), CRANK.clearance, rtol=1e-10)  # root of the event
        assert normal @ incoming > 0.1  # m/s: a real impact, not a graze
        assert_allclose(normal @ outgoing, -RESTITUTION * (normal @ incoming), rtol=1e-12)


def test_the_impulse_is_the_change_of_momentum_along_the_stroke():
    """Momentum of rod and piston as masses at their places, not through the mass matrix."""
    run = rigid.rigid_run(CRANK, centred_start(CRANK, START_ANGLE), RESTITUTION, HORIZON)

    def momentum(state):
        _, _, u, b, w = state
        rod = u + CRANK.rod_centre * np.sin(b) * w
        return CRANK.piston_mass * u + CRANK.rod_mass * rod

    jumps = [momentum(a) - momentum(b) for a, b in zip(run.after, run.before, strict=True)]
    assert_allclose(jumps, run.impulses * run.directions[:, 0], rtol=1e-10)


def test_accumulating_impacts_are_refused():
    with pytest.raises(RuntimeError, match=r"accumulate after .* shorten it"):
        rigid.rigid_run(CRANK, centred_start(CRANK, START_ANGLE), 0.3, 6e-3)


# --- adapter: all that knows how the mechanism is called


def compliant_run(start, *, stiffness, law, horizon, step):
    """Times and states (a, x, x', b, b') at the ends of the steps."""
    contact = {"law": law, "stiffness": stiffness, "damping": 0.0, "friction": 0.0}
    if law != "kelvin-voigt":
        contact |= {"restitution": RESTITUTION, "speed_floor": 1e-3}
    overrides = {f"joint.crankpin.{name}": value for name, value in contact.items()}
    scene = load_scene("slider-crank-benchmark", overrides)
    angle, x, u, b, w = start
    centre, sine, cosine = scene.rod.centre_of_mass, math.sin(b), math.cos(b)
    rod = [x - centre * cosine, centre * sine]
    rod_velocity = [u + centre * sine * w, centre * cosine * w]
    run = run_mechanism(
        tables.tables(scene, step),
        angle=angle,
        speed=2 * math.pi * scene.drive.speed,
        bodies=np.array([[*rod, b, x, 0.0, 0.0, *rod_velocity, w, u, 0.0, 0.0]]),
        step=step,
        n_steps=math.ceil(horizon / step),
    )
    assert run.status.ok
    states = np.column_stack([run.turns[:, 0], run.bodies[:, 0, STATE_COLUMNS]])
    return step * np.arange(len(states)), states


# --- towards rigid


def closings(times, states):
    """When the pin meets its eye, between steps by the straight line [s]."""
    place, _ = rigid.offset(states.T, CRANK)
    depth = np.linalg.norm(place, axis=0) - CRANK.clearance
    k = np.flatnonzero((depth[:-1] < 0.0) & (depth[1:] >= 0.0))
    return times[k] - depth[k] * (times[k + 1] - times[k]) / (depth[k + 1] - depth[k])


@pytest.mark.parametrize(("law", "restitution"), [("exact", RESTITUTION), ("kelvin-voigt", 1.0)])
def test_a_stiffening_contact_approaches_rigid_impacts(law, restitution):
    start = centred_start(CRANK, START_ANGLE)
    impacts = rigid.rigid_run(CRANK, start, restitution, HORIZON).times[:4]
    assert np.diff(impacts).min() > 5e-5  # s: flights longer than the softest contact
    # between impacts, where both fly, and a quarter of a flight after the last
    middle = np.append(0.5 * (impacts[:-1] + impacts[1:]), impacts[-1] + 5e-5)
    wanted = rigid.rigid_run(CRANK, start, restitution, middle[-1] + 1e-9, middle).samples
    late, fast = [], []
    for stiffness in STIFFNESSES:
        # the mass at the eye is at least 0.07 kg: twenty steps over a radian of the contact
        step = 0.05 / math.sqrt(stiffness / 0.07)
        times, states = compliant_run(
            start, stiffness=stiffness, law=law, horizon=middle[-1] + 2 * step, step=step
        )
        late.append(closings(times, states)[:4] - impacts)
        found = np.column_stack([np.interp(middle, times, column) for column in states.T])
        fast.append((found - wanted)[:, [2, 4]] / [1.0, 10.0])  # m/s and tens of rad/s
    late, fast = np.abs(late), np.abs(fast).max(axis=2)
    slope_late, slope_fast = (np.log(e[1:] / e[:-1]) / math.log(4.0) for e in (late, fast))
    print(f"\n{law}: slopes of times {slope_late[:, 1:]}, of speeds {slope_fast}")
    print(late[:, 1:], fast, sep="\n")
    # The first impact comes out of one free flight: the same but for rounding and the straight
    # line, h^2 a / (8 v) with h < 1e-7 s, a < 5e4 m/s^2 and v = 4 m/s: 2e-11 s at most.
    assert late[:, 0].max() < 2e-11
    # What is missing is the time in contact, pi sqrt(m / K): slope -1/2. The next term is of slope
    # -1; it has halved four times, from some 5 % of the whole, and so has its part in the slope.
    assert np.all(abs(slope_late[-1, 1:] + 0.5) < 0.01)
    assert np.all(abs(slope_fast[-1] + 0.5) < 0.01)
    # Three contacts of 0.3 to 0.7 us at the stiffest, on flights of 0.1 ms and more.
    assert late[-1].max() < 2e-6
    assert fast[-1].max() < 0.01 * 4.0  # m/s, of the first impact
