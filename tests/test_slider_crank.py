"""The crank mechanism against closed forms, conservation laws, and its own limits."""

import cmath
import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad
from wearstate.diagnose.literature.verify_contact import rebound
from wearstate.sim.contact.closed_forms import ideal_crank, kelvin_voigt_restitution
from wearstate.sim.contact.law import RELEASE_AT_ZERO_FORCE, RELEASE_AT_ZERO_PENETRATION
from wearstate.sim.hydraulics.parameters import hydraulic_parameters
from wearstate.sim.hydraulics.piston_pressure import two_level_pressure
from wearstate.sim.jit import half_turn_angle, power, sine_cosine
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.mechanism import crank_run, crank_step, equations, layout, throw_motion
from wearstate.sim.pump import scene_run, validity
from wearstate.sim.pump_setup import contacts, ideal_motion, tables
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.pump_hydraulics import CylinderPressure

REVOLUTION = np.linspace(0.0, 2 * np.pi, 721)
PUMP = load_scene("bilge-pump")
BENCHMARK = load_scene("slider-crank-benchmark")
TILTED = load_scene("bilge-pump", {"stroke_inclination": "35 deg"})  # gravity both ways


def crank_by_newton_euler(scene, angle, piston_force):
    """Forces at every joint by force balance of each body, positions as complex numbers.

    Nothing of this is shared with the library: no rod angle, no Lagrange equation. The crank pin
    is z = r exp(i a), the piston at w on the real axis with |z - w| = L; two time derivatives of
    that, then Newton for piston and rod and Euler for the rod about its centre of mass.
    """
    omega, r, length = 2 * np.pi * scene.drive.speed, scene.crank.radius, scene.rod.length
    rod, piston = scene.rod, scene.piston
    z = r * np.exp(1j * angle)
    dz, ddz = 1j * omega * z, -(omega**2) * z
    w = z.real + np.sqrt(length**2 - z.imag**2)
    # Re(conj(z - w)(dz - dw)) = 0 with dw real
    dw = (np.conj(z - w) * dz).real / (z - w).real
    ddw = ((np.conj(z - w) * ddz).real + abs(dz - dw) ** 2) / (z - w).real
    axis = (z - w) / length
    spin = ((dz - dw) / (z - w)).imag
    spin_rate = ((ddz - ddw) / (z - w)).imag  # the centripetal part of the ratio is real
    weight = -scene.gravity * (
        math.sin(scene.stroke_inclination) + 1j * math.cos(scene.stroke_inclination)
    )
    centre = ddw + (rod.centre_of_mass * axis) * (1j * spin_rate - spin**2)
    wrist_x = piston.mass * (ddw - weight.real) + piston_force
    pin_x = rod.mass * (centre.real - weight.real) + wrist_x
    # Euler about the centre: arms to the pin and to the wrist, pin_y + (-wrist_y) from Newton
    to_pin, to_wrist = (length - rod.centre_of_mass) * axis, -rod.centre_of_mass * axis
    both_y = rod.mass * (centre.imag - weight.imag)  # pin_y - wrist_y
    moment = rod.inertia * spin_rate + to_pin.imag * pin_x - to_wrist.imag * wrist_x
    # moment = to_pin.real * pin_y - to_wrist.real * wrist_y
    wrist_y = (moment - to_pin.real * both_y) / (to_pin.real - to_wrist.real)
    pin_y = both_y + wrist_y
    return {
        "piston": w,
        "piston_velocity": dw,
        "piston_acceleration": ddw,
        "pin_force_x": pin_x,
        "pin_force_y": pin_y,
        "wrist_force_x": wrist_x,
        "wrist_force_y": wrist_y,
        "guide_force": -wrist_y - piston.mass * weight.imag,
        "crank_moment": (np.conj(z) * (pin_x + 1j * pin_y)).imag,
    }


def levels_of(pressure):
    """Kernel record of a pressure whose piston does not matter."""
    return hydraulic_parameters(pressure, area=1.0, crank_radius=1.0, rod_length=5.0, speed=1.0)[0]


def pushes(scene, angle):
    """Force of a two-level pressure on the piston, positive towards the crank [N]."""
    p, area = scene.pressure, math.pi / 4 * scene.piston.diameter**2
    h = levels_of(p)
    return np.array(
        [
            area * two_level_pressure(a, p.suction, p.discharge, h)
            if p.rung == "two-level"
            else 0.0
            for a in angle
        ]
    )


# --- the ideal crank


@pytest.mark.parametrize("scene", [PUMP, BENCHMARK, TILTED], ids=lambda s: s.name)
def test_ideal_crank_against_newton_and_euler(scene):
    ideal = ideal_motion.ideal_motion(scene, REVOLUTION)
    push = pushes(scene, REVOLUTION)
    for name, expected in crank_by_newton_euler(scene, REVOLUTION, push).items():
        # Two algebraically equal forms: rounding, on the scale of the largest value.
        assert_allclose(
            getattr(ideal, name), expected, rtol=0, atol=1e-12 * abs(expected).max(), err_msg=name
        )


def test_ideal_crank_rates_are_derivatives():
    h = 1e-3
    # Sixth-order central differences: error ~ h^6 / 140 of the seventh derivative, and rounding
    # of 1e-16 / h; the harmonics of a rod ratio 5/12 keep derivatives within 1e3 of the value.
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / (60 * h)
    omega = 2 * np.pi * BENCHMARK.drive.speed
    around = ideal_motion.ideal_motion(BENCHMARK, REVOLUTION[:, None] + h * np.arange(-3, 4))
    here = ideal_motion.ideal_motion(BENCHMARK, REVOLUTION)
    for value, rate in (
        ("piston", "piston_velocity"),
        ("piston_velocity", "piston_acceleration"),
        ("beta", "beta_rate"),
        ("beta_rate", "beta_acceleration"),
    ):
        expected = getattr(here, rate)
        found = omega * (getattr(around, value) @ weights)
        assert_allclose(found, expected, rtol=0, atol=1e-11 * abs(expected).max(), err_msg=rate)


@pytest.mark.parametrize("scene", [BENCHMARK, TILTED], ids=lambda s: s.name)
def test_drive_does_no_work_over_a_revolution_without_pressure(scene):
    free = load_scene(scene.name, {"pressure.rung": "none", "stroke_inclination": 0.6})
    moment = ideal_motion.ideal_motion(free, REVOLUTION[:-1]).crank_moment
    # The mean over a period of an analytic function: the trapezoidal rule is exact to rounding.
    assert abs(moment.mean()) < 1e-13 * abs(moment).max()


@pytest.mark.parametrize(
    ("rise", "fall"),
    [
        ((0, 0.5), (0, 0.5)),
        ((0, 6), (0, 6)),
        ((0, 60), (0, 60)),
        ((9, 2), (7, 1)),  # what the valves of the rung chamber do
        ((80, 90), (3, 20)),
    ],
)
def test_drive_does_the_work_of_the_pressure(rise, fall):
    ramps = dict(zip(("rise_delay", "rise_angle"), rise, strict=True))
    ramps |= dict(zip(("fall_delay", "fall_angle"), fall, strict=True))
    scene = load_scene("bilge-pump", {f"pressure.{k}": f"{v} deg" for k, v in ramps.items()})
    area = math.pi / 4 * scene.piston.diameter**2
    span = scene.pressure.discharge - scene.pressure.suction
    radius, length = scene.crank.radius, scene.rod.length

    def position(a):
        return radius * math.cos(a) + math.sqrt(length**2 - (radius * math.sin(a)) ** 2)

    def late(dead_centre, delay, ramp):
        """Volume over area that passes while the pressure is still at the old level."""
        change, _ = quad(
            lambda a: (
                abs(position(dead_centre + delay + a) - position(dead_centre))
                * (6 / ramp * (a / ramp) * (1 - a / ramp))  # slope of the smooth step
            ),
            0.0,
            ramp,
            epsabs=1e-15,
        )
        return change

    rise, fall = np.radians(rise), np.radians(fall)
    # Indicator diagram: the full rectangle less what each dead centre loses to its ramp.
    work = area * span * (2 * radius - late(0.0, *fall) - late(math.pi, *rise))

    def moment(a):
        return float(ideal_motion.ideal_motion(scene, np.array([a])).crank_moment[0])

    pieces = [0.0, fall[0], fall.sum(), math.pi, math.pi + rise[0], math.pi + rise.sum()]
    ends = pairwise([*pieces, 2 * math.pi])
    done = sum(quad(moment, a, b, epsrel=1e-11, limit=200)[0] for a, b in ends if a < b)
    assert_allclose(done, work, rtol=1e-9)  # quadrature
    assert 0 < work < area * span * 2 * radius


def test_ideal_run_records_the_ideal_forces_in_mid_step():
    step, start = 1e-4, 0.4
    scene = load_scene(
        "bilge-pump",
        {"stroke_inclination": "35 deg", "joint.crankpin.rung": "ideal", "crank.unbalance": 0.3},
    )
    run = scene_run.run_scene(scene, step=step, n_steps=3000, start_angle=start)
    omega = 2 * np.pi * scene.drive.speed
    middle = start + omega * step * (np.arange(3000) + 0.5)
    push = pushes(scene, middle)
    assert np.ptp(push) > 1000  # N: both levels are met
    expected = crank_by_newton_euler(scene, middle, push)
    expected["piston_force"] = -push
    for name, source, sign in (
        ("pin_x", "pin_force_x", 1),
        ("pin_y", "pin_force_y", 1),
        ("wrist_x", "wrist_force_x", -1),  # of the pin on the rod, there of the rod on the pin
        ("wrist_y", "wrist_force_y", -1),
        ("guide_y", "guide_force", 1),
        ("piston_x", "piston_force", 1),
    ):
        # Rounding of angle and forces, on the scale of the pin force.
        assert_allclose(
            run.force(name), sign * expected[source], rtol=0, atol=1e-11 * 3000, err_msg=name
        )
    along = math.sin(scene.stroke_inclination) * np.sin(middle)
    weight = scene.gravity * (math.cos(scene.stroke_inclination) * np.cos(middle) - along)
    drive = expected["crank_moment"] + scene.crank.unbalance * weight
    assert_allclose(run.forces[:, 0], drive, rtol=0, atol=1e-11 * 3000)
    assert run.bodies.shape == (3001, 1, 12)
    ends = start + omega * step * np.arange(3001)
    assert_allclose(run.turns[:, 0], ends, rtol=1e-14)
    assert np.all(run.turns[:, 1] == omega)
    at_ends = crank_by_newton_euler(scene, ends, 0.0)
    assert_allclose(run.bodies[:, 0, 3], at_ends["piston"], rtol=1e-13)
    assert_allclose(run.bodies[:, 0, 9], at_ends["piston_velocity"], rtol=0, atol=1e-12)
    pin = scene.crank.radius * np.exp(1j * ends)
    to_pin = (pin - at_ends["piston"]) / scene.rod.length
    centre = at_ends["piston"] + scene.rod.centre_of_mass * to_pin
    assert_allclose(run.bodies[:, 0, 0], centre.real, rtol=1e-13)
    assert_allclose(run.bodies[:, 0, 1], centre.imag, rtol=0, atol=1e-15)
    pin_force = np.hypot(run.force("pin_x"), run.force("pin_y"))
    assert run.peak_normal_force == pin_force.max()


def test_pressure_levels_and_ramps():
    h = levels_of(CylinderPressure(rise_delay=0.2, rise_angle=0.1, fall_delay=0.3, fall_angle=0.4))
    down, up = 0.5 * math.pi, 1.5 * math.pi
    assert two_level_pressure(down, -2.0, 7.0, h) == -2.0
    assert two_level_pressure(up, -2.0, 7.0, h) == 7.0
    assert two_level_pressure(up - 40 * math.pi, -2.0, 7.0, h) == 7.0
    # the old level stays for the delay
    assert two_level_pressure(0.299, -2.0, 7.0, h) == 7.0
    assert two_level_pressure(math.pi + 0.199, -2.0, 7.0, h) == -2.0
    # half-way up a symmetric ramp is the mean of the levels
    assert_allclose(two_level_pressure(0.5, -2.0, 7.0, h), 2.5, rtol=1e-12)
    assert_allclose(two_level_pressure(math.pi + 0.25, -2.0, 7.0, h), 2.5, rtol=1e-12)
    # one angle stands for both where only one is given
    both = levels_of(CylinderPressure(rise_angle=0.1))
    assert_allclose(two_level_pressure(0.05, -2.0, 7.0, both), 2.5, rtol=1e-12)


@pytest.mark.parametrize("rpm", [255, 345])
def test_delays_are_those_of_the_valves(rpm):
    """Valves and liquid of the rung chamber reverse the pressure as late as the delays say."""
    speed = {"drive.speed": f"{rpm} rpm", "duration": "1.2 s", "joint.crankpin.rung": "ideal"}
    run = simulate(
        load_scene("bilge-pump", {**speed, "pressure.rung": "chamber"}), seed=0, truth=True
    )
    angle, found = run.truth["state_alpha"], run.truth["cylinder_pressure_pa"]
    about = ((angle + 0.1) % math.pi < 0.4) & (angle > angle[0] + 4 * math.pi)

    def error(**numbers):
        h = levels_of(CylinderPressure(**{k: math.radians(v) for k, v in numbers.items()}))
        here = [two_level_pressure(a, -0.03e6, 0.3e6, h) for a in angle[about]]
        return np.abs(found[about] - here).mean()

    closing = {"rise_delay": 0.024 * rpm, "fall_delay": 0.0245 * rpm}  # a fixed time, 4 ms
    late = error(**closing, rise_angle=4, fall_angle=1)
    # what is left is the pressure that opens the valves; 300 rpm has 7.4 and 8.4 degrees
    assert late < 0.25 * error(rise_angle=6)


# --- one impact


@pytest.mark.parametrize(
    ("ratio", "release", "expected"),
    [
        (0.05, RELEASE_AT_ZERO_FORCE, 0.858758),
        (0.05, RELEASE_AT_ZERO_PENETRATION, 0.854468),
        (0.2, RELEASE_AT_ZERO_FORCE, 0.571740),
        (0.2, RELEASE_AT_ZERO_PENETRATION, 0.526621),
        (0.5, RELEASE_AT_ZERO_FORCE, 0.298436),
        (0.5, RELEASE_AT_ZERO_PENETRATION, 0.163034),
    ],
)
def test_restitution_of_the_mechanism(ratio, release, expected):
    closed = kelvin_voigt_restitution(ratio, release_at_zero_force=release == RELEASE_AT_ZERO_FORCE)
    assert_allclose(closed, expected, atol=5e-7)  # half of the last printed digit
    default = rebound(ratio, release, step_per_contact_time=validity.STEP_PER_CONTACT_TIME)
    assert_allclose(default, closed, atol=1e-4)  # what the default step is chosen for
    # Order 4: a tenth of the step leaves 1e-4 of that error, and rounding.
    assert_allclose(rebound(ratio, release), closed, atol=2e-8)


# --- energy of the free crank


class Lumped(NamedTuple):
    """A throw in its least coordinates, which the library does not use."""

    crank_radius: float
    rod_length: float
    moving_mass: float
    static_moment: float
    rod_inertia: float  # about the wrist pin
    inverse_crank_inertia: float
    gravity_x: float
    gravity_y: float
    clearance: float
    pin_radius: float
    eye_radius: float
    stiffness: float
    friction_speed: float


def lumped(scene, t):
    """Of a scene and its tables with changes."""
    rod, pin = scene.rod, t.contacts[0, layout.CRANKPIN]
    radius = scene.joint.crankpin.pin_diameter / 2
    return Lumped(
        crank_radius=scene.crank.radius,
        rod_length=rod.length,
        moving_mass=rod.mass + scene.piston.mass,
        static_moment=rod.mass * rod.centre_of_mass,
        rod_inertia=rod.inertia + rod.mass * rod.centre_of_mass**2,
        inverse_crank_inertia=t.machine.inverse_inertia,
        gravity_x=scene.gravity * math.sin(scene.stroke_inclination),
        gravity_y=scene.gravity * math.cos(scene.stroke_inclination),
        clearance=float(pin["clearance"]),
        pin_radius=radius,
        eye_radius=radius + float(pin["clearance"]),
        stiffness=float(pin["stiffness"]),
        friction_speed=float(pin["friction_speed"]),
    )


def with_pin(t, **changes):
    """Tables with a changed contact of the crank pin."""
    contacts = t.contacts.copy()
    for name, value in changes.items():
        contacts[name][0, layout.CRANKPIN] = value
    return t._replace(contacts=contacts)


FREE = load_scene("bilge-pump", {"stroke_inclination": "35 deg", "pressure.rung": "none"})


def free_crank(step=1e-5, **changes):
    """Tables without drive and losses: the crank has an inertia, nothing takes energy out."""
    t = with_pin(
        tables.tables(FREE, step),
        **{"friction": 0.0, "tangential_damping": 0.0, "damping": 0.0, **changes},
    )
    return t._replace(machine=t.machine._replace(inverse_inertia=1 / 0.5))  # a flywheel [kg m^2]


def bodies_of(state, scene=FREE):
    """Row of the bodies from crank angle and speed, piston and rod angle with their rates."""
    _, _, x, u, beta, b = state
    centre = scene.rod.centre_of_mass
    sin_b, cos_b = math.sin(beta), math.cos(beta)
    rod = [x - centre * cos_b, centre * sin_b, beta]
    rates = [u + centre * sin_b * b, centre * cos_b * b, b]
    return np.array([[*rod, x, 0.0, 0.0, *rates, u, 0.0, 0.0]])


def states_of(run):
    """Crank angle and speed, piston and its velocity, rod angle and its rate, by columns."""
    return np.column_stack([run.turns, run.bodies[:, 0][:, [3, 9, 2, 8]]])


def run_from(t, state, *, step, n_steps, scene=FREE):
    """Run from a state in the coordinates of `states_of`."""
    return crank_run.run_mechanism(
        t,
        angle=state[0],
        speed=state[1],
        bodies=bodies_of(state, scene),
        step=step,
        n_steps=n_steps,
    )


def run_worn(scene, t, *, step, n_steps, angle=0.3):
    """Run from the library's own start."""
    return crank_run.run_mechanism(
        t,
        angle=angle,
        speed=2 * np.pi * scene.drive.speed,
        bodies=tables.start_state(scene, angle, t),
        step=step,
        n_steps=n_steps,
    )


def scratch(state, contact):
    """Scratch of the kernels with a state in its row 0."""
    w = layout.scratch(1)
    w.crank[0, :2] = state[:2]
    w.stage["y"][0] = bodies_of(state)
    w.stage["margin"] = 1.0  # a contact that is none asks for no change
    w.held["touching"][0, layout.CRANKPIN] = contact
    return w


def rate_of(state, contact, t):
    """Rates of a state in the coordinates of `states_of`."""
    w = scratch(state, contact)
    equations.derivative_of_record(w, 0, 0.0, t)
    rate = w.stage["rate"][0, 0]
    return np.array([*w.crank[0, 2:4], *rate[[3, 9, 2, 8]]])


def mechanical_energy(state, p):
    """Kinetic, potential and contact energy; also of complex states, for exact derivatives."""
    alpha, omega, x, u, beta, b = state
    kinetic = (
        0.5 * p.moving_mass * u * u
        + p.static_moment * np.sin(beta) * u * b
        + 0.5 * p.rod_inertia * b * b
        + 0.5 * omega * omega / p.inverse_crank_inertia
    )
    height = p.gravity_x * (
        p.moving_mass * x - p.static_moment * np.cos(beta)
    ) + p.gravity_y * p.static_moment * np.sin(beta)
    d_x = p.crank_radius * np.cos(alpha) + p.rod_length * np.cos(beta) - x
    d_y = p.crank_radius * np.sin(alpha) - p.rod_length * np.sin(beta)
    sigma = np.sqrt(d_x * d_x + d_y * d_y) - p.clearance
    return kinetic + height + np.where(sigma.real > 0, 0.5 * p.stiffness * sigma * sigma, 0.0)


def thrown(angle, t):
    """A start in free flight: the pin is kicked off its side of the eye."""
    x, _, beta = (float(tables.start_state(FREE, angle, t)[0, column]) for column in (3, 9, 2))
    ideal = ideal_motion.ideal_motion(FREE, np.array([angle]))
    x += 0.5 * float(t.contacts[0, 0]["clearance"])
    speed = 2 * np.pi * FREE.drive.speed
    return (angle, speed, x, float(ideal.piston_velocity[0]), beta, float(ideal.beta_rate[0]))


def worst_energy_error(step, angle):
    t = free_crank(step)
    run = run_from(t, thrown(angle, t), step=step, n_steps=math.ceil(0.25 / step))
    assert run.status.ok
    energy = mechanical_energy(states_of(run).T, lumped(FREE, t))
    return abs(energy / energy[0] - 1).max(), run


def test_undamped_contact_keeps_the_energy():
    default = validity.STEP_PER_CONTACT_TIME / contacts.contact_frequency(PUMP)
    angles = 0.7 + np.arange(8)
    rms = []
    for part in (1, 2, 4):
        pairs = [worst_energy_error(default / part, angle) for angle in angles]
        rms.append(math.sqrt(np.mean([error**2 for error, _ in pairs])))
        assert min(run.contact_changes for _, run in pairs) >= 200  # 100 closings, 100 openings
        assert sum(run.cuts_refused for _, run in pairs) == 0
    order = math.log(rms[0] / rms[2], 4)
    print(f"\nenergy error {rms}, observed order {order:.2f}")
    assert rms[0] < 1e-4
    # Runge-Kutta 4 loses the oscillator's energy at order 5, the located contact changes add
    # order 4 and more. The runs are chaotic, their mean error is not.
    assert 3.5 <= order <= 6.5


def energy_error_without_location(t, step, angle, n_steps):
    """As the solver, but a contact change waits for the end of its step."""
    w, i = scratch(thrown(angle, t), False), 0
    for _ in range(n_steps):
        crank_step._stages(w, i, step, 0.0, step, False, t)
        i = 1 - i
        if w.stage["margin"][i, 0, 0] < 0:
            w.held["touching"][0, 0] = 1 - w.held["touching"][0, 0]
    end = [*w.crank[i, :2], *w.stage["y"][i, 0, [3, 9, 2, 8]]]
    start, p = np.array(thrown(angle, t)), lumped(FREE, t)
    return abs(mechanical_energy(np.array(end), p) / mechanical_energy(start, p) - 1)


def test_energy_needs_the_contact_located():
    step = 0.25 * validity.STEP_PER_CONTACT_TIME / contacts.contact_frequency(PUMP)
    t = free_crank(step)
    n_steps = math.ceil(0.05 / step)
    cut, uncut = [], []
    for angle in 0.7 + np.arange(4):
        uncut.append(energy_error_without_location(t, step, angle, n_steps))
        run = run_from(t, thrown(angle, t), step=step, n_steps=n_steps)
        energy = mechanical_energy(states_of(run)[[0, -1]].T, lumped(FREE, t))
        cut.append(abs(energy[1] / energy[0] - 1))
    print(f"\nenergy error without location {max(uncut):.2e}, with it {max(cut):.2e}")
    # A change found late by up to a step costs K (v h)^2 each time; found in time, order 4.
    assert max(uncut) > 100 * max(cut)


states = st.tuples(
    st.floats(-10, 10),  # crank angle [rad]
    st.floats(-50, 50),  # crank speed [rad/s]
    st.floats(-math.pi, math.pi),  # direction of the pin in the eye [rad]
    st.floats(-2, 2),  # piston velocity [m/s]
    st.floats(1e-9, 1e-4),  # penetration [m]
    st.floats(-20, 20),  # rod rate [rad/s]
)


def touching_state(numbers, p):
    """State with the pin pressed into the eye in a direction that can be chosen."""
    alpha, omega, direction, u, penetration, b = numbers
    offset = (p.clearance + penetration) * cmath.exp(1j * direction)
    beta = math.asin((p.crank_radius * math.sin(alpha) - offset.imag) / p.rod_length)
    piston = p.crank_radius * math.cos(alpha) + p.rod_length * math.cos(beta) - offset.real
    return (alpha, omega, piston, u, beta, b)


def power_into(state, t):
    """Rate of the mechanical energy, by a complex step along the equations of motion: exact."""
    along = np.array(state) + 1e-30j * rate_of(state, True, t)
    return mechanical_energy(along, lumped(FREE, t)).imag / 1e-30


def sliding_speed(numbers, state, p):
    """Velocity of pin surface less eye surface at the contact, from rigid-body motion."""
    alpha, omega, direction, u, _, b = numbers
    normal, beta = cmath.exp(1j * direction), state[4]
    pin = 1j * omega * (p.crank_radius * cmath.exp(1j * alpha) + p.pin_radius * normal)
    # the rod turns at -b; its eye moves with the piston and about the wrist
    arm = p.rod_length * complex(-math.cos(beta), math.sin(beta)) + p.eye_radius * normal
    eye = u - 1j * b * arm
    return ((pin - eye) * (1j * normal).conjugate()).real


@given(numbers=states)
@settings(max_examples=200, deadline=None)
def test_conservative_forces_keep_the_energy(numbers):
    t = free_crank()
    p = lumped(FREE, t)
    state = touching_state(numbers, p)
    # Rounding of the products of velocities and forces that cancel.
    scale = p.stiffness * numbers[4] * (abs(numbers[1]) + abs(numbers[3]) + abs(numbers[5]) + 1)
    rounding = 1e-10 * (scale + mechanical_energy(np.array(state), p).real * 100 + 1)
    assert abs(power_into(state, t)) <= rounding


@given(numbers=states, friction=st.floats(0, 0.5), viscous=st.floats(0, 100))
@settings(max_examples=300, deadline=None)
def test_friction_takes_its_power_out(numbers, friction, viscous):
    t = free_crank(friction=friction, tangential_damping=viscous)
    p = lumped(FREE, t)
    state = touching_state(numbers, p)
    slide = sliding_speed(numbers, state, p)
    normal = p.stiffness * numbers[4]
    force = friction * normal * slide / math.hypot(slide, p.friction_speed) + viscous * slide
    scale = normal * (abs(numbers[1]) + abs(numbers[3]) + abs(numbers[5]) + 1)
    rounding = 1e-8 * (scale + mechanical_energy(np.array(state), p).real * 100 + 1)
    power = power_into(state, t)
    assert power <= rounding
    # All of it, neither more nor less, is force times sliding speed of the two surfaces.
    assert abs(power + force * slide) <= rounding


def test_energy_of_a_run_with_friction_only_falls():
    step = 0.3 / contacts.contact_frequency(PUMP)
    t = free_crank(step, friction=0.05, tangential_damping=12.0)
    run = run_from(t, thrown(0.7, t), step=step, n_steps=math.ceil(0.5 / step))
    energy = mechanical_energy(states_of(run).T, lumped(FREE, t))
    # The integrator's own error at this step, seen without friction, is below 1e-5.
    assert np.max(energy - np.minimum.accumulate(energy)) < 1e-5 * energy[0]
    assert energy[-1] < 0.99 * energy[0]
    assert run.contact_changes > 50


# --- recorded forces against the motion


@pytest.fixture(scope="module")
def fine_run():
    """Worn pump at a twentieth of the contact time, without friction, in least coordinates."""
    worn = {"joint.crankpin.diametral_clearance": "0.31 mm", "stroke_inclination": "35 deg"}
    scene = load_scene("bilge-pump", worn)
    step = 0.05 / contacts.contact_frequency(scene)
    t = with_pin(tables.tables(scene, step), friction=0.0, tangential_damping=0.0)
    run = run_worn(scene, t, step=step, n_steps=math.ceil(0.5 / step))
    assert run.contact_changes > 10
    return scene, lumped(scene, t), run


def smooth_steps(run, p):
    """Inner step ends whose two neighbours on either side see no change of contact or ramp."""
    alpha, _, x, _, beta, _ = states_of(run).T
    d_x = p.crank_radius * np.cos(alpha) + p.rod_length * np.cos(beta) - x
    d_y = p.crank_radius * np.sin(alpha) - p.rod_length * np.sin(beta)
    side = np.hypot(d_x, d_y) > p.clearance
    # The contact opens at zero force, before the penetration is gone: leave a wide berth.
    changed = np.convolve(np.diff(side.astype(int)) != 0, np.ones(81), mode="same") > 0
    return np.flatnonzero(~(changed[:-1] | changed[1:])) + 1


def second_difference(y, h):
    return np.concatenate([[np.nan], y[2:] - 2 * y[1:-1] + y[:-2], [np.nan]]) / h**2


def beside(means):
    """Average of the means of the steps before and after each step end."""
    return np.concatenate([[np.nan], 0.5 * (means[1:] + means[:-1]), [np.nan]])


def test_mass_times_acceleration_is_the_recorded_force(fine_run):
    scene, p, run = fine_run
    h = run.step
    inner = smooth_steps(run, p)
    assert len(inner) > 0.5 * len(run.forces)
    names = ("pin_x", "pin_y", "guide_y", "piston_x")
    pin_x, pin_y, guide, piston = (run.force(name) for name in names)
    x, beta = run.bodies[:, 0, 3], run.bodies[:, 0, 2]
    rod_mass = scene.rod.mass
    first_moment_x = p.moving_mass * x - p.static_moment * np.cos(beta)
    first_moment_y = p.static_moment * np.sin(beta)
    assert_allclose(rod_mass * scene.rod.centre_of_mass, p.static_moment, rtol=1e-15)
    along = beside(pin_x + piston) - p.moving_mass * p.gravity_x
    across = beside(pin_y + guide) - p.moving_mass * p.gravity_y
    # The second difference weighs the force by a triangle over two steps, the mean of two step
    # means by a box: they differ by h^2/12 of the force's second derivative, that is by
    # (h w)^2 / 12 = 2e-4 of a force that oscillates on the contact spring; and rounding of
    # positions, 1e-16 * 9 kg * 0.3 m / h^2 = 2e-5 N.
    size = np.abs(pin_x).max()
    for moment, force in ((first_moment_x, along), (first_moment_y, across)):
        error = np.abs(second_difference(moment, h) - force)[inner]
        assert error.max() < 4e-4 * size
        assert error.mean() < 2e-5 * size


def test_guide_force_balances_the_rods_moment(fine_run):
    """Euler about the rod's centre of mass, from recorded forces and positions alone."""
    scene, p, run = fine_run
    inner = smooth_steps(run, p)
    names = ("pin_x", "pin_y", "guide_y", "piston_x")
    pin_x, pin_y, guide, piston = (beside(run.force(name)) for name in names)
    x, beta = run.bodies[:, 0, 3], run.bodies[:, 0, 2]
    acceleration = second_difference(x, run.step)
    wrist_x = scene.piston.mass * (acceleration + p.gravity_x) - piston  # rod on piston
    wrist_y = scene.piston.mass * p.gravity_y - guide
    cos_b, sin_b = np.cos(beta), np.sin(beta)
    pin_arm = scene.rod.length - scene.rod.centre_of_mass
    moment = pin_arm * (-cos_b * pin_y - sin_b * pin_x) + scene.rod.centre_of_mass * (
        -cos_b * wrist_y - sin_b * wrist_x
    )
    error = np.abs(moment + scene.rod.inertia * second_difference(beta, run.step))[inner]
    # As above, on the scale of the pin force times its arm.
    assert error.max() < 1e-3 * pin_arm * np.nanmax(np.abs(pin_x))
    assert np.abs(guide[inner]).max() > 100  # N: there is something to balance
    # ... and the recorded force of the wrist pin is that same one, on the rod
    for recorded, expected in (("wrist_x", -wrist_x), ("wrist_y", -wrist_y)):
        error = np.abs(beside(run.force(recorded)) - expected)[inner]
        assert error.max() < 1e-3 * np.nanmax(np.abs(pin_x))


def test_recorded_impulse_is_the_change_of_momentum():
    """Over any span, also across contact changes: forces are recorded as exact impulses."""
    scene = load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.31 mm"})
    # The integrator sums the same stage forces into velocities and impulses; in the least
    # coordinates the coupling sin(b) b' is differentiated in between, at order 4: 256 times less
    # at a quarter. In those of the bodies momentum is a sum, and only rounding is left.
    for part, tolerance in ((1, 1e-9), (4, 4e-12)):
        step = 0.3 / part / contacts.contact_frequency(scene)
        t = tables.tables(scene, step)
        run = run_worn(scene, t, step=step, n_steps=math.ceil(0.4 / step))
        p = lumped(scene, t)
        _, _, _, u, beta, b = states_of(run).T
        force = run.force("pin_x") + run.force("piston_x") - p.moving_mass * p.gravity_x
        impulse = np.cumsum(force) * step
        least = p.moving_mass * u + p.static_moment * np.sin(beta) * b
        bodies = scene.rod.mass * run.bodies[:, 0, 6] + scene.piston.mass * run.bodies[:, 0, 9]
        for momentum, bound in ((least, tolerance), (bodies, 1e-12)):
            missing = abs(momentum[1:] - momentum[0] - impulse).max()
            print(f"\nmomentum off by {missing / np.ptp(momentum):.1e} of its swing")
            assert missing < bound * np.ptp(momentum)
        assert run.contact_changes > 10


# --- edges of the contact


def test_a_centred_pin_has_a_finite_normal():
    assert throw_motion.polar(0.0, 0.0, 3.0, 4.0) == (0.0, 3.0, 1.0, 0.0)
    t = free_crank()
    state = (0.0, 31.4, FREE.crank.radius + FREE.rod.length, 0.1, 0.0, 2.0)
    for contact in (False, True):
        assert np.all(np.isfinite(rate_of(state, contact, t)))
    run = run_from(t, state, step=1e-5, n_steps=200)
    assert run.status.ok
    assert np.all(np.isfinite(run.bodies))


def outward_push(scene, run):
    """Mean force of every step along the direction of the pin in its eye [N]."""
    angle = 0.5 * (run.turns[1:, 0] + run.turns[:-1, 0])
    middle = 0.5 * (run.bodies[1:, 0] + run.bodies[:-1, 0])
    offset = scene_run.pin_offsets(scene, angle, middle)[:, :2]
    outward = offset / np.hypot(*offset.T)[:, None]
    return run.force("pin_x") * outward[:, 0] + run.force("pin_y") * outward[:, 1]


def test_the_contact_never_pulls():
    scene = load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.31 mm"})
    step = 0.1 / contacts.contact_frequency(scene)
    t = with_pin(tables.tables(scene, step), friction=0.0, tangential_damping=0.0)
    run = run_worn(scene, t, step=step, n_steps=40_000)
    push = outward_push(scene, run)
    # Without friction the mean force of a step is along the normal, which turns by 1e-3 within it.
    assert push.min() > -1e-3 * push.max()
    # ... and the variant that releases at zero penetration does pull: the test can tell.
    sticky = with_pin(t, release=RELEASE_AT_ZERO_PENETRATION)
    pulling = run_worn(scene, sticky, step=step, n_steps=40_000)
    assert outward_push(scene, pulling).min() < -0.01 * push.max()
    assert run.peak_normal_force >= push.max() > 0


# --- the limit of no clearance


@pytest.fixture(scope="module")
def shrinking():
    """Radial clearance -> worst piston error [m] and low-order error of the pin force [-]."""
    found = {}
    for millimetres in (0.4, 0.2, 0.1, 0.05):
        scene = load_scene(
            "bilge-pump",
            {
                "joint.crankpin.radial_clearance": f"{millimetres} mm",
                # a hundredfold: the penetration, about F / K, is 0.12 um plus impacts, far below
                # the clearance; the damping keeps its ratio
                "joint.crankpin.stiffness": 2e10,
                "joint.crankpin.damping": 3e5,
                "joint.crankpin.friction": 0,
                "joint.crankpin.tangential_damping": 0,
            },
        )
        per_revolution = 2 ** math.ceil(
            math.log2(0.2 * contacts.contact_frequency(scene) / validity.STEP_PER_CONTACT_TIME)
        )
        step = 1 / (scene.drive.speed * per_revolution)
        n_steps = 5 * per_revolution
        run = scene_run.run_scene(
            scene, step=step, n_steps=n_steps, start_angle=0.0, keep_states=True
        )
        rigid = load_scene("bilge-pump", {"joint.crankpin.rung": "ideal"})
        ideal = scene_run.run_scene(rigid, step=step, n_steps=n_steps, start_angle=0.0)
        last = slice(per_revolution, None)  # the first revolution settles
        error = np.abs(run.bodies[last, 0, 3] - ideal.bodies[last, 0, 3]).max()
        real, wanted = (
            np.fft.rfft(r.forces[last, 1:3].reshape(4, per_revolution, 2), axis=1)[:, :20]
            for r in (run, ideal)
        )
        found[millimetres * 1e-3] = (
            error,
            np.linalg.norm(real - wanted) / np.linalg.norm(wanted),
        )
    print("\nradial clearance: piston error, low-order force error", found)
    return found


def test_piston_error_falls_with_the_clearance(shrinking):
    clearance = np.array(list(shrinking))
    error = np.array([e for e, _ in shrinking.values()])
    slope = np.polyfit(np.log(clearance), np.log(error), 1)[0]
    print(f"observed slope {slope:.3f}")
    assert 0.9 <= slope <= 1.1
    # The pin leans on one side or the other of its eye: about one clearance, seen at the rod's
    # angle at most 1 / cos(asin(1/5)) of it.
    assert np.all((error > 0.9 * clearance) & (error < 1.1 * clearance))


def test_low_orders_of_the_pin_force_approach_the_ideal_joint(shrinking):
    error = [e for _, e in shrinking.values()]
    assert all(small < large for large, small in pairwise(error))
    slope = np.polyfit(np.log(list(shrinking)), np.log(error), 1)[0]
    print(f"observed slope {slope:.2f}, smallest error {error[-1]:.2%}")
    # The knocks at load reversal have a momentum of mass times clearance times speed: slope 1,
    # less what does not shrink, the rebounds of a contact that restitutes about 0.4.
    assert 0.7 <= slope <= 1.1
    assert error[-1] < 0.01


# --- the rest


def test_contact_frequency_bounds_every_direction():
    """The largest eigenfrequency of mechanism on contact spring, by brute force."""
    t = free_crank()
    p = lumped(FREE, t)
    worst = 0.0
    for alpha in np.linspace(0, 2 * np.pi, 73):
        for direction in np.linspace(0, np.pi, 37):
            state = touching_state((alpha, 0.0, direction, 0.0, 1e-6, 0.0), p)
            deeper = touching_state((alpha, 0.0, direction, 0.0, 2e-6, 0.0), p)
            rates = [rate_of(s, True, t) for s in (state, deeper)]
            normal = np.array([math.cos(direction), math.sin(direction)])
            beta = state[4]
            eye = [
                np.array(
                    [
                        r[3] + p.rod_length * math.sin(beta) * r[5],
                        p.rod_length * math.cos(beta) * r[5],
                    ]
                )
                for r in rates
            ]
            worst = max(worst, (eye[1] - eye[0]) @ normal / 1e-6)
    # The grid misses the worst direction by at most 2.5 degrees: (1 - cos) = 1e-3.
    assert_allclose(math.sqrt(worst), contacts.contact_frequency(PUMP), rtol=2e-3)


def test_power_against_libm():
    """The logarithm must be known beyond its last bit: its error is multiplied."""
    dice = np.random.default_rng(4)
    base, exponent = np.exp(dice.uniform(-13.8, 13.8, 4000)), dice.uniform(-1.0, 1.0, 4000)
    base[:4], exponent[:4] = (1.0, 1.0, 0.5, 3.0), (0.7, 1.0, 0.0, 1.0)
    found = np.array([power(x, k) for x, k in zip(base, exponent, strict=True)])
    known = np.array([math.pow(x, k) for x, k in zip(base, exponent, strict=True)])
    assert (np.abs(found - known) <= 2 * np.spacing(known)).all()
    assert found[:4].tolist() == [1.0, 1.0, 1.0, 3.0]
    assert np.mean(found == known) > 0.8


@pytest.mark.parametrize("base", [0.0, -2.0, math.inf, -math.inf, math.nan])
def test_power_of_what_has_none_is_no_number(base):
    """Its bits would make one of 1e215 of it, and a lost pressure would not be seen."""
    assert math.isnan(power(base, 0.7))


def test_half_turn_angle_against_libm():
    """Within 1 ulp at pi of the library's arc tangent, at every seam of the reduction too."""
    rng = np.random.default_rng(3)
    seams = np.arctan([0.66, 1 / 0.66])
    angles = np.r_[rng.uniform(0, math.pi, 4000), seams, math.pi - seams, 1e-12, 0, math.pi / 2]
    sizes = rng.uniform(0.1, 10, angles.size)
    along, across = sizes * np.cos(angles), sizes * np.abs(np.sin(angles))
    found = [half_turn_angle(*pair) for pair in zip(along, across, strict=True)]
    assert np.abs(found - np.arctan2(across, along)).max() <= 4.5e-16
    assert half_turn_angle(-1.0, 0.0) == math.pi


def test_sine_cosine_against_libm():
    angles = np.random.default_rng(0).uniform(-1e4, 1e4, 20_000)
    found = np.array([sine_cosine(a) for a in angles])
    expected = np.column_stack([np.sin(angles), np.cos(angles)])
    # The reduction by a two-part pi/2 leaves 1e-20 * 6e3, the polynomials half an ulp each.
    assert_allclose(found, expected, rtol=0, atol=4e-16)


def test_ideal_crank_needs_no_mass_at_the_rod():
    crank = ideal_crank(
        REVOLUTION,
        speed=10.0,
        crank_radius=0.05,
        rod_length=0.25,
        rod_mass=0.0,
        rod_centre=0.0,
        rod_inertia=0.0,
        piston_mass=2.0,
    )
    # A massless rod carries along its own line only.
    assert_allclose(
        crank.pin_force_x * np.sin(crank.beta) + crank.pin_force_y * np.cos(crank.beta),
        0.0,
        atol=1e-13 * 12,
    )
