"""The crank mechanism on every combination of rungs: conservation, closed forms, limits."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.diagnose.literature.verify_contact import impact
from wearstate.sim.contact.law import CONTACT, ELASTIC_HERTZ, LAW_HYSTERESIS, hysteresis
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.mechanism import crank_run, layout, throw_motion
from wearstate.sim.pump import scene_run, validity
from wearstate.sim.pump_setup import contacts, ideal_motion, joints, tables
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

IDEAL, LINK, COMPLIANT = "ideal", "link", "compliant"
COMBINATIONS = list(
    itertools.product((IDEAL, LINK, COMPLIANT), (IDEAL, LINK, COMPLIANT), (IDEAL, COMPLIANT))
)
every_combination = pytest.mark.parametrize("rungs", COMBINATIONS, ids="-".join)

WRIST_RADIUS, GUIDE_LENGTH, GUIDE_HEIGHT, TILT_INERTIA = 0.02, 0.12, 0.1, 0.01
FLYWHEEL = 0.5  # kg m^2, so small that the speed gives way by some per cent


def pump(rungs=(COMPLIANT, IDEAL, IDEAL), **changes):
    """Bilge pump with its stroke aslant, so that gravity acts both ways; keys with __ for dots."""
    crankpin, wristpin, guide = rungs
    rubbing = {"friction": 0.05, "damping": 2e4}
    table = {
        "stroke_inclination": "35 deg",
        "piston.inertia": TILT_INERTIA,
        "joint.crankpin.rung": crankpin,
        "joint.wristpin": {
            "rung": wristpin,
            "pin_diameter": 2 * WRIST_RADIUS,
            "radial_clearance": 4e-5,
            "stiffness": 2e8,
            **rubbing,
        },
        "joint.guide": {
            "rung": guide,
            "length": GUIDE_LENGTH,
            "height": GUIDE_HEIGHT,
            "diametral_clearance": 6e-5,
            "stiffness": 1e8,
            **rubbing,
        },
    }
    return load_scene("bilge-pump", table | {k.replace("__", "."): v for k, v in changes.items()})


def without(t, *losses):
    """Tables with some properties of all contacts set to zero."""
    contacts = t.contacts.copy()
    for name in losses:
        contacts[name] = 0.0
    return t._replace(contacts=contacts)


LOSSES = ("damping", "friction", "tangential_damping")


def turning(t, inertia=FLYWHEEL, **machine):
    """Tables whose crank has an inertia."""
    return t._replace(machine=t.machine._replace(inverse_inertia=1 / inertia, **machine))


def run(scene, t, *, step, duration, angle=0.3, speed=None, kick=0.0):
    """Run from the library's own start; a kick [m/s] sends rods and pistons along the stroke."""
    bodies = tables.start_state(scene, angle, t)
    bodies[:, [6, 9]] += kick
    found = crank_run.run_mechanism(
        t,
        angle=angle,
        speed=2 * math.pi * scene.drive.speed if speed is None else speed,
        bodies=bodies,
        step=step,
        n_steps=round(duration / step),
    )
    assert found.status.ok
    assert np.all(np.isfinite(found.bodies))
    return found


# --- the mechanism written down once more, from rigid-body geometry with complex numbers


def rod_geometry(scene, found):
    """Crank pin, its eye, wrist pin and its eye: positions and velocities, as complex numbers."""
    x, y, beta, piston_x, piston_y, _, dx, dy, dbeta, dpx, dpy, _ = found.bodies[:, 0].T
    angle, speed = found.turns.T
    axis = np.exp(1j * (np.pi - beta))  # from wrist pin to crank pin, turning at -beta'
    pin = scene.crank.radius * np.exp(1j * angle)
    centre, moving = x + 1j * y, dx + 1j * dy
    arm, back = scene.rod.length - scene.rod.centre_of_mass, -scene.rod.centre_of_mass
    spin = -1j * dbeta
    return (
        (pin, 1j * speed * pin),
        (centre + arm * axis, moving + spin * arm * axis),
        (piston_x + 1j * piston_y, dpx + 1j * dpy),
        (centre + back * axis, moving + spin * back * axis),
    )


def offsets(scene, found):
    """Pin from its eye's centre, and how fast, at crank pin and wrist pin."""
    pin, eye, wrist, small_eye = rod_geometry(scene, found)
    return ((pin[0] - eye[0], pin[1] - eye[1]), (wrist[0] - small_eye[0], wrist[1] - small_eye[1]))


def along_rod(found, offset):
    """An offset in axes of the rod: towards its wrist pin, and across."""
    return offset * np.exp(1j * found.bodies[:, 0, 2])


def from_line(offset, length):
    """Distance from a line of this length that begins at nought, towards the wrist pin."""
    return np.abs(offset - np.clip(offset.real, 0.0, length))


def corners(found, clearance):
    """Overlap of the guide's four corners, its rate, and their velocity along the guide."""
    y, tilt = found.bodies[:, 0, 4], found.bodies[:, 0, 5]
    dx, dy, spin = found.bodies[:, 0, 9:12].T
    for along, side in itertools.product((-0.5, 0.5), (1, -1)):
        corner = (along * GUIDE_LENGTH + 0.5j * side * GUIDE_HEIGHT) * np.exp(1j * tilt)
        over = side * (y + corner.imag) - GUIDE_HEIGHT / 2 - clearance
        yield over, side * (dy + spin * corner.real), dx - spin * corner.imag


def mechanical_energy(scene, t, found):
    """Kinetic, potential and elastic energy at the ends of the steps [J]."""
    m, contacts = t.machine, t.contacts[0]
    x, y, _, piston_x, piston_y, _, dx, dy, dbeta, dpx, dpy, spin = found.bodies[:, 0].T
    angle, speed = found.turns.T
    rod, piston = scene.rod, scene.piston
    energy = rod.mass * (dx**2 + dy**2) + rod.inertia * dbeta**2 + piston.mass * (dpx**2 + dpy**2)
    energy = 0.5 * (energy + TILT_INERTIA * spin**2)
    if m.inverse_inertia > 0:
        energy += 0.5 * speed**2 / m.inverse_inertia
    energy += m.gravity_x * (rod.mass * x + piston.mass * piston_x)
    energy += m.gravity_y * (rod.mass * y + piston.mass * piston_y)
    energy += m.static_moment * (m.gravity_x * np.cos(angle) + m.gravity_y * np.sin(angle))
    pushed = []
    for joint, (offset, _) in enumerate(offsets(scene, found)):
        if joints.joint_rungs(scene, 0)[joint] == layout.JOINT_COMPLIANT:
            apart = from_line(along_rod(found, offset), contacts[joint]["slot"])
            pushed.append((joint, apart - contacts[joint]["clearance"]))
    if joints.joint_rungs(scene, 0)[layout.GUIDE] == layout.JOINT_COMPLIANT:
        pushed += [
            (layout.GUIDE, o) for o, _, _ in corners(found, contacts[layout.GUIDE]["clearance"])
        ]
    for joint, overlap in pushed:
        energy += 0.5 * contacts[joint]["stiffness"] * np.maximum(overlap, 0.0) ** 2
    return energy


def middle(values):
    """Mean of both ends of every step."""
    return 0.5 * (values[1:] + values[:-1])


# --- conservation


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_energy_of_a_pin_in_an_oval_eye(share):
    """Work along and across the rod, and the moment of a force that acts off the eye's centre."""
    worn = {"joint__crankpin__diametral_clearance": 4e-4, "joint__crankpin__one_sided": share}
    scene = pump(pressure__rung="none", drive__speed=12, **worn)
    errors = []
    for step in (1e-5, 2.5e-6):
        t = turning(without(tables.tables(scene, step), *LOSSES))
        found = run(scene, t, step=step, duration=0.1, kick=0.2)
        energy = mechanical_energy(scene, t, found)
        errors.append(abs(energy / energy[0] - 1).max())
        assert found.contact_changes > 20
        at = along_rod(found, offsets(scene, found)[0][0])
        beside = t.contacts[0, layout.CRANKPIN]["slot"]
        assert np.any((at.real > 0.1 * beside) & (at.real < 0.9 * beside) & (abs(at.imag) > 2e-5))
    print(f"\nenergy error {errors[0]:.1e}, {errors[1]:.1e}")
    assert errors[0] < 1e-6  # as of a round eye
    # Order 4 would be a 256th: where the flanks end, the force is continuous and its slope is not.
    assert errors[1] < errors[0] / 8


@pytest.mark.parametrize("place", [0.7 - 0.3j, 0.5 + 0.4j, -0.3 - 0.5j])
def test_the_speed_of_a_pin_off_its_eyes_line_is_that_of_the_distance(place):
    """Beyond the line's end, beside it and before it, of a rod that turns fast with the line."""
    contact = np.zeros(1, dtype=CONTACT)[0]
    contact["slot"] = 0.6

    def seen(time):  # from the eye's centre, in fixed axes, while the rod turns by beta
        return place * np.exp((0.1 + 0.2j) * time), 0.3 + 5.0 * time

    def nearest(time):
        offset, beta = seen(time)
        speed = (0.1 + 0.2j) * offset
        numbers = (offset.real, offset.imag, speed.real, speed.imag)
        found, _ = throw_motion.worn_eye(numbers, 5.0, math.sin(beta), math.cos(beta), contact)
        return throw_motion.polar(*found)[:2]

    h = 1e-6
    rate = (nearest(h)[0] - nearest(-h)[0]) / (2 * h)
    assert_allclose(nearest(0.0)[1], rate, rtol=1e-8)  # rounding of a difference over 2e-6 s


def test_a_pin_in_an_oval_eye_has_the_clearance_along_the_rod():
    scene = load_scene(
        "bilge-pump",
        {"joint.crankpin.diametral_clearance": 3.5e-4, "joint.crankpin.one_sided": 0.6},
    )
    step = validity.pump_step(scene)
    t = tables.tables(scene, step)
    found = run(scene, t, step=step, duration=1.0)
    offset = along_rod(found, offsets(scene, found)[0][0])[len(found.bodies) // 2 :]
    across = 3.5e-4 - 0.6 * (3.5e-4 - scene.wear.as_new)
    # what the knocks press in, on both sides: some 10 kN on 200 MN/m
    pressed = 2 * 6e-5
    assert 3.5e-4 < np.ptp(offset.real) < 3.5e-4 + pressed
    assert np.ptp(offset.imag) < across + pressed < 3.5e-4
    assert offset.real.max() > across / 2 + 1e-4  # towards the wrist pin, where the load presses


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"joint.crankpin.rung": "link"}, "must be 0 on the rung 'link'"),
        ({"joint.wristpin.one_sided": 0.5}, "joint.wristpin.one_sided = 0.5 must be 0"),
        ({"wear": None}, "needs wear.as_new_diametral"),
    ],
)
def test_an_oval_eye_needs_contact_and_a_size_as_new(changes, told):
    with pytest.raises(SceneError, match=told):
        load_scene("bilge-pump", {"joint.crankpin.one_sided": 0.5} | changes)


@every_combination
def test_energy_of_the_free_crank(rungs):
    scene = pump(rungs, pressure__rung="none", crank__unbalance=0.3, drive__speed=12)
    errors = []
    for step, stretch in ((1e-5, 3e-8), (2.5e-6, 5e-10)):
        t = turning(without(tables.tables(scene, step), *LOSSES))
        worst = []
        for angle in (0.3, 2.0):
            kick = 0.2 if rungs[0] == COMPLIANT else 0.0
            found = run(scene, t, step=step, duration=0.1, angle=angle, kick=kick)
            energy = mechanical_energy(scene, t, found)
            worst.append(abs(energy / energy[0] - 1).max())
            assert found.cuts_refused == 0
            if COMPLIANT in rungs:
                assert found.contact_changes > 20
            for (offset, _), rung, length in zip(
                offsets(scene, found), rungs[:2], (4e-5, 4e-5), strict=True
            ):
                # An ideal joint closes to rounding of its coordinates; a link that whirls round
                # its pin in some milliseconds keeps its length to the fourth order in the step.
                drift = abs(abs(offset) - (length if rung == LINK else 0.0)).max()
                assert rung == COMPLIANT or drift < (stretch if rung == LINK else 1e-11)
        errors.append(math.hypot(*worst))
    print(f"\n{'-'.join(rungs)}: energy error {errors[0]:.1e}, {errors[1]:.1e}")
    assert errors[0] < 1e-6
    # Order 4 and more would be a 256th; the runs are chaotic, and rounding of 40,000 steps stays.
    assert errors[1] < errors[0] / 30 + 1e-13


@every_combination
def test_impulses_are_the_changes_of_momentum(rungs):
    scene = pump(rungs, piston__seal_friction=60.0, piston__seal_friction_share=0.02)
    step = 1e-5
    t = turning(tables.tables(scene, step), drive_moment=20.0)
    found = run(scene, t, step=step, duration=0.2)
    assert abs(found.force("seal_x")).max() > 60.0
    rod, piston, m = scene.rod.mass, scene.piston.mass, t.machine
    pin, wrist = found.force("pin_x"), found.force("wrist_x")
    across, wrist_across = found.force("pin_y"), found.force("wrist_y")
    books = (
        (rod, 6, pin + wrist - rod * m.gravity_x),
        (rod, 7, across + wrist_across - rod * m.gravity_y),
        (
            piston,
            9,
            sum(found.force(f"{place}_x") for place in ("piston", "seal", "guide"))
            - wrist
            - piston * m.gravity_x,
        ),
        (piston, 10, found.force("guide_y") - wrist_across - piston * m.gravity_y),
    )
    for mass, column, force in books:
        momentum = mass * found.bodies[:, 0, column]
        missing = momentum[1:] - momentum[0] - step * np.cumsum(force)
        # The same sums in another order: rounding of 20,000 of them.
        assert abs(missing).max() < 1e-10 * (rod + piston) * scene.crank.radius * 31.4


@every_combination
def test_moments_turn_rod_and_crank(rungs):
    """Euler's equations, from mean forces and the geometry in the middle of every step."""
    scene = pump(rungs, crank__unbalance=0.3)
    errors = []
    for step in (2e-5, 5e-6):
        t = turning(without(tables.tables(scene, step), *LOSSES[1:]), drive_moment=20.0)
        found = run(scene, t, step=step, duration=0.1)
        m, rod = t.machine, scene.rod
        pin, wrist = (
            found.force(f"{joint}_x") + 1j * found.force(f"{joint}_y") for joint in ("pin", "wrist")
        )
        axis = np.exp(1j * (np.pi - middle(found.bodies[:, 0, 2])))
        arms = (rod.length - rod.centre_of_mass) * axis, -rod.centre_of_mass * axis
        on_rod = (np.conj(arms[0]) * pin + np.conj(arms[1]) * wrist).imag
        at = np.exp(1j * middle(found.turns[:, 0]))
        weight = -(m.gravity_x + 1j * m.gravity_y)
        at_radius = m.static_moment * weight - scene.crank.radius * pin
        on_crank = found.forces[:, 0] + (np.conj(at) * at_radius).imag
        spin = rod.inertia * (found.bodies[:, 0, 8] - found.bodies[0, 0, 8])
        momentum = FLYWHEEL * (found.turns[:, 1] - found.turns[0, 1])
        errors.append(
            max(
                abs(spin[1:] + step * np.cumsum(on_rod)).max() / abs(spin).max(),
                abs(momentum[1:] - step * np.cumsum(on_crank)).max() / abs(momentum).max(),
            )
        )
    print(f"\n{'-'.join(rungs)}: moments off by {errors[0]:.1e}, {errors[1]:.1e}")
    # Mean of a product for product of means: order 2 in the step, a sixteenth; knocks fall into
    # the steps as they like.
    assert errors[0] < 2e-6
    assert errors[1] < errors[0] / 12


def joint_losses(scene, t, found):
    """Power that the laws take out at the middle of every step, from the motion alone [W]."""
    speed, dbeta = found.turns[:, 1], found.bodies[:, 0, 8]
    radii = scene.joint.crankpin.pin_diameter / 2, WRIST_RADIUS
    spins = speed, found.bodies[:, 0, 11]
    lost = np.zeros(len(found.turns))
    for joint, (offset, rate) in enumerate(offsets(scene, found)):
        if joints.joint_rungs(scene, 0)[joint] != layout.JOINT_COMPLIANT:
            continue
        c = t.contacts[0, joint]
        along = np.conj(offset / abs(offset)) * rate
        slide = along.imag + radii[joint] * spins[joint] + (radii[joint] + c["clearance"]) * dbeta
        lost += contact_loss(c, abs(offset) - c["clearance"], along.real, slide)
    if joints.joint_rungs(scene, 0)[layout.GUIDE] == layout.JOINT_COMPLIANT:
        c = t.contacts[0, layout.GUIDE]
        lost += sum(contact_loss(c, *corner) for corner in corners(found, c["clearance"]))
    return middle(lost)


def contact_loss(c, overlap, approach, slide):
    force = c["stiffness"] * overlap + c["damping"] * approach
    touching = (overlap > 0) & (force > 0)
    friction = c["friction"] * force * slide / np.hypot(slide, c["friction_speed"])
    tangential = friction + c["tangential_damping"] * slide
    return np.where(touching, c["damping"] * approach**2 + tangential * slide, 0.0)


@every_combination
def test_work_is_energy_and_loss(rungs):
    scene = pump(rungs, drive__motor=MOTOR, drive__rung="motor")
    step = 2.5e-6
    t = tables.tables(scene, step)
    found = run(scene, t, step=step, duration=0.1)
    work = found.forces[:, 0] * middle(found.turns[:, 1])
    work += found.force("piston_x") * middle(found.bodies[:, 0, 9])
    energy = mechanical_energy(scene, t, found)
    lost = step * np.cumsum(work) - (energy[1:] - energy[0])
    size = step * abs(work).sum()
    # Work is force times mean speed, order 2 in the step, and knocks are steep.
    assert np.max(np.maximum.accumulate(lost) - lost) < 1e-6 * size
    print(f"\n{'-'.join(rungs)}: lost {lost[-1]:.4g} J of {size:.4g} J")
    if set(rungs) == {IDEAL}:
        assert abs(lost).max() < 1e-6 * size
        return
    assert lost[-1] > 1e-3 * size
    if LINK not in rungs:  # whose force cannot be seen from the motion
        expected = step * joint_losses(scene, t, found).sum()
        # A contact let go at zero force has not yet sprung back: what its spring still holds,
        # some thousandths, is lost besides. Steps in which one changes are all or nothing here.
        assert_allclose(lost[-1], expected, rtol=5e-3)
        assert lost[-1] > expected


MOTOR = {
    "synchronous_speed": 5.1,
    "breakdown_moment": 300.0,
    "breakdown_slip": 0.2,
    "inertia": FLYWHEEL,
}


def test_friction_of_two_links_takes_energy_out_of_both():
    """Either link may be in tension while the other is not."""
    changes = {"joint__crankpin__friction": 0.1, "drive__speed": 8}
    scene = pump((LINK, LINK, IDEAL), pressure__rung="none", **changes)
    step = 1e-5
    for drags in ((), ("damping", "tangential_damping")):
        t = without(tables.tables(scene, step), *drags)
        found = run(scene, t, step=step, duration=0.4)
        assert found.tension_steps > 400
        work = found.forces[:, 0] * 2 * math.pi * scene.drive.speed * step
        lost = work - np.diff(mechanical_energy(scene, t, found))
        print(f"\nleast power lost {lost.min() / step:.2g} W of {lost.max() / step:.2g} W")
        # The speed is steady: work is exact but for rounding of energies, 1e-15 of 100 J.
        assert lost.min() > -1e-12
        # Order 2 in the step, which a fast whirl takes far.
        assert_allclose(lost.sum(), link_loss(scene, t, found), rtol=2e-4)


def link_loss(scene, t, found):
    """Power of the recorded tangential forces: between the surfaces, but for the drag on a link.

    That drag, the damping times the link's swing, acts between the centres.
    """
    total = 0.0
    speed, dbeta = found.turns[:, 1], found.bodies[:, 0, 8]
    radii = scene.joint.crankpin.pin_diameter / 2, WRIST_RADIUS
    for name, c, radius, spin, (offset, rate) in zip(
        ("pin", "wrist"),
        t.contacts[0],
        radii,
        (speed, 0 * speed),
        offsets(scene, found),
        strict=False,
    ):
        direction = offset / abs(offset)
        swing = (np.conj(direction) * rate).imag
        slide = swing + radius * spin + (radius + c["clearance"]) * dbeta
        force = found.force(f"{name}_x") + 1j * found.force(f"{name}_y")
        tangential = (np.conj(middle(direction)) * force).imag
        drag = c["damping"] * middle(swing)
        total += found.step * np.sum((tangential - drag) * middle(slide) + drag * middle(swing))
    return total


# --- closed forms


@pytest.mark.parametrize("pressure", ["none", "two-level", "heads"])
def test_ideal_joints_in_the_kernel_are_the_closed_form(pressure):
    changes = {"pressure__rung": pressure, "crank__unbalance": 0.3}
    if pressure == "heads":
        changes |= {"pressure__suction_line": {}, "pressure__discharge_line": {}}
    scene = pump((IDEAL, IDEAL, IDEAL), pressure__rise_angle="60 deg", **changes)
    assert not scene_run.needs_integration(scene)
    omega, errors = 2 * math.pi * scene.drive.speed, []
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for step in (4e-5, 1e-5):
        found = run(scene, tables.tables(scene, step), step=step, duration=0.4)
        # the mean over every step by Gauss's rule
        angle = 0.3 + omega * step * (np.arange(len(found.forces))[:, None] + 0.5 * (1 + nodes))
        ideal = ideal_motion.ideal_motion(scene, angle)
        g, unbalance = scene.gravity, scene.crank.unbalance
        tilted = angle + scene.stroke_inclination
        expected = {
            "pin_x": ideal.pin_force_x,
            "pin_y": ideal.pin_force_y,
            "wrist_x": -ideal.wrist_force_x,
            "wrist_y": -ideal.wrist_force_y,
            "guide_y": ideal.guide_force,
        }
        size = abs(ideal.pin_force_x).max()
        wrong = [abs(found.force(n) - e @ weights / 2).max() / size for n, e in expected.items()]
        moment = ideal.crank_moment + unbalance * g * np.cos(tilted)
        wrong.append(abs(found.forces[:, 0] - moment @ weights / 2).max() / abs(moment).max())
        errors.append(max(wrong))
    print(f"\n{pressure}: forces off by {errors}")
    assert errors[1] < 5e-9
    # Runge-Kutta 4 on constraints that are held: order 4 would be a 256th, without rounding of
    # positions times the square of the drift's rate, and the kinks of the pressure.
    assert errors[1] < errors[0] / 10 + 1e-11


def test_motor_of_great_inertia_is_constant_speed():
    scene = pump((COMPLIANT, COMPLIANT, IDEAL), pressure__rung="constant")
    step = 2e-5
    steady = run(scene, tables.tables(scene, step), step=step, duration=0.2)
    errors = []
    for inertia in (1e3, 1e4):
        found = run(scene, turning(tables.tables(scene, step), inertia), step=step, duration=0.2)
        errors.append(abs(found.force("pin_x") - steady.force("pin_x")).max())
        assert abs(found.turns[:, 1] / steady.turns[:, 1] - 1).max() < 1.0 / inertia
    # What the speed gives way goes with the inverse inertia; contact is kept, nothing is chaotic.
    assert steady.contact_changes == 0
    assert_allclose(errors[0] / errors[1], 10.0, rtol=0.02)


@pytest.mark.parametrize("load", [50.0, 290.0])
def test_motor_settles_on_its_curve(load):
    """An all but massless mechanism: the motor's moment is the load, at the slip of Kloss."""
    scene = pump(
        (IDEAL, IDEAL, IDEAL),
        pressure__rung="none",
        drive__rung="motor",
        drive__motor=MOTOR,
        gravity=0,
    )
    step = 1e-4
    t = tables.tables(scene, step)
    light = t.throws.copy()
    light["rod_mass"] = light["piston_mass"] = 1e-6
    light["inverse_rod_mass"], light["inverse_rod_inertia"] = 1e6, 1e8
    t = t._replace(throws=light, machine=t.machine._replace(drive_moment=-load))
    found = run(scene, t, step=step, duration=4.0, speed=30.0)
    ratio = MOTOR["breakdown_moment"] / load
    slip = MOTOR["breakdown_slip"] * (ratio - math.sqrt(ratio**2 - 1))
    expected = 2 * math.pi * MOTOR["synchronous_speed"] * (1 - slip)
    # The ripple of 1 mg in the flywheel of half a kg m^2, and exp(-4 s over time constant).
    assert_allclose(found.turns[-1, 1], expected, rtol=1e-6)
    assert abs(found.turns[0, 1] / expected - 1) > 0.01
    assert_allclose(throw_motion.motor_moment(expected, t.machine), 0.0, atol=1e-9 * load)


@pytest.mark.parametrize("rungs", [(IDEAL, IDEAL, IDEAL), (LINK, IDEAL, COMPLIANT)], ids="-".join)
def test_unbalance_weighs_on_the_drive(rungs):
    step = 1e-5
    runs = []
    for unbalance in (0.0, 0.7):
        scene = pump(rungs, crank__unbalance=unbalance)
        runs.append(run(scene, tables.tables(scene, step), step=step, duration=0.2))
    angle, g = runs[0].turns[:, 0], scene.gravity
    inclination, omega = scene.stroke_inclination, 2 * math.pi * scene.drive.speed
    lever = np.diff(np.sin(angle + inclination)) / (omega * step)  # mean of the cosine
    difference = runs[1].forces[:, 0] - runs[0].forces[:, 0]
    # Rounding of the difference of moments of 150 N m.
    assert_allclose(difference, 0.7 * g * lever, rtol=0, atol=1e-10)
    assert_allclose(runs[1].forces[:, 1:], runs[0].forces[:, 1:], rtol=0, atol=1e-12)


# --- several throws

THREE = [{"phase": f"{angle} deg"} for angle in (0, 120, 240)]


@pytest.mark.parametrize(
    ("rungs", "pressure"),
    [
        ((IDEAL, IDEAL, IDEAL), "two-level"),
        ((LINK, LINK, IDEAL), "two-level"),
        ((COMPLIANT, COMPLIANT, COMPLIANT), "constant"),
    ],
    ids=lambda value: value if isinstance(value, str) else "-".join(value),
)
def test_triplex_at_constant_speed_is_three_simplexes(rungs, pressure):
    step = 1e-5
    changes = {"pressure__rung": pressure, "joint__guide__diametral_clearance": 1e-6}
    triplex = pump(rungs, throws=THREE, **changes)
    together = run(triplex, tables.tables(triplex, step), step=step, duration=0.2)
    moment = np.zeros(len(together.forces))
    for throw in range(3):
        scene = pump(rungs, throws=[THREE[throw]], **changes)
        alone = run(scene, tables.tables(scene, step), step=step, duration=0.2)
        own = slice(1 + len(layout.FORCES) * throw, 1 + len(layout.FORCES) * (throw + 1))
        # A change of contact cuts the step of all throws: equal but for the integrator.
        tolerance = 1e-3 if together.contact_changes else 1e-12
        size = abs(alone.forces[:, 1:]).max()
        assert_allclose(together.forces[:, own], alone.forces[:, 1:], rtol=0, atol=tolerance * size)
        moment += alone.forces[:, 0]
    assert_allclose(together.forces[:, 0], moment, rtol=0, atol=tolerance * abs(moment).max())


def test_triplex_on_a_motor_runs_more_evenly():
    step = 2e-5
    motor = {"drive__rung": "motor", "drive__motor": {**MOTOR, "inertia": 5.0}}
    scenes = [
        pump((IDEAL, IDEAL, IDEAL), throws=THREE, **motor),
        pump((IDEAL, IDEAL, IDEAL), throws=THREE[:1], **motor),
    ]
    runs = [run(s, tables.tables(s, step), step=step, duration=3.0) for s in scenes]
    last = slice(-round(0.6 / step), None)  # three revolutions, the start has died out
    three, one = (np.ptp(found.turns[last, 1]) / found.turns[last, 1].mean() for found in runs)
    print(f"\nspeed ripple {three:.4f} of three throws, {one:.4f} of one")
    assert 1e-4 < three < one / 3
    # The throws share the crank: its speed is not what a throw alone would make it.
    mean = [found.turns[last, 1].mean() for found in runs]
    assert mean[0] < 0.99 * mean[1]


# --- links


@pytest.mark.parametrize("joint", ["crankpin", "wristpin"])
@pytest.mark.parametrize("pressure", ["constant", "two-level"])
def test_tension_tells_where_contact_is_lost(joint, pressure):
    """A constant pressure holds pin and eye together; where it changes sides they part."""
    step = 1e-5
    found = {}
    for rung in (LINK, COMPLIANT):
        rungs = (rung, IDEAL, IDEAL) if joint == "crankpin" else (IDEAL, rung, IDEAL)
        scene = pump(rungs, pressure__rung=pressure, stroke_inclination=0)
        found[rung] = run(scene, tables.tables(scene, step), step=step, duration=0.4)
    parted = pressure == "two-level"
    assert (found[LINK].tension_steps > 100) == parted
    assert (found[COMPLIANT].contact_changes > 4) == parted
    if not parted:
        assert found[LINK].tension_steps == found[COMPLIANT].contact_changes == 0


def pressed(rungs, **changes):
    """A mechanism whose pins never leave their eyes, in a revolution after one of settling.

    Viscous sliding stills the swing of a pin round its eye, which nothing else would.
    """
    viscous = {f"joint__{pin}__tangential_damping": 300.0 for pin in ("crankpin", "wristpin")}
    scene = pump(rungs, pressure__rung="constant", **viscous, **changes)
    frequency = contacts.contact_frequency(scene) or 1e4
    per_revolution = 2 ** math.ceil(math.log2(0.2 * frequency / 0.3))
    step = 0.2 / per_revolution
    t = without(tables.tables(scene, step), "friction")
    found = run(scene, t, step=step, duration=0.4)
    assert found.contact_changes == found.tension_steps == 0
    every = per_revolution // 1024
    force = found.force("pin_x")[per_revolution:].reshape(1024, every).mean(axis=1)
    return found.bodies[per_revolution::every, 0, 3], force


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


@pytest.mark.parametrize("joint", ["crankpin", "wristpin"])
def test_compliant_approaches_the_link(joint):
    def rungs(rung):
        return (rung, IDEAL, IDEAL) if joint == "crankpin" else (IDEAL, rung, IDEAL)

    place, force = pressed(rungs(LINK))
    stiffness = np.array([2e8, 8e8, 3.2e9])
    errors = []
    for k in stiffness:
        changes = {
            f"joint__{joint}__stiffness": float(k),
            f"joint__{joint}__damping": 3e4 * math.sqrt(k / 2e8),
        }
        near, pushed = pressed(rungs(COMPLIANT), **changes)
        errors.append((abs(near - place).max(), abs(pushed - force).max()))
    errors = np.array(errors).T
    print(f"\n{joint}: piston and pin force off by {errors}")
    # The pin sinks in by F / K, and that is all: order 1.
    assert_allclose(slope(stiffness, errors[0]), -1.0, atol=0.02)
    assert_allclose(errors[0], abs(force).max() / stiffness, rtol=0.05)
    assert errors[1, -1] < errors[1, 0] / 8
    assert errors[1, -1] < 1e-3 * abs(force).max()


@pytest.mark.parametrize("joint", ["crankpin", "wristpin"])
def test_link_approaches_the_ideal_joint(joint):
    place, force = pressed((IDEAL, IDEAL, IDEAL))
    rungs = (LINK, IDEAL, IDEAL) if joint == "crankpin" else (IDEAL, LINK, IDEAL)
    lengths = np.array([1.6e-4, 8e-5, 4e-5])
    errors = []
    for length in lengths:
        near, pushed = pressed(rungs, **{f"joint__{joint}__radial_clearance": float(length)})
        errors.append((abs(near - place).max(), abs(pushed - force).max()))
    errors = np.array(errors).T
    print(f"\n{joint}: piston and pin force off by {errors}")
    assert_allclose(slope(lengths, errors[0]), 1.0, atol=0.02)
    assert_allclose(errors[0], lengths, rtol=0.05)  # the link's length, all along the stroke
    assert errors[1, -1] < errors[1, 0] / 2
    assert errors[1, -1] < 0.01 * abs(force).max()


# --- symmetry and contacts


@pytest.mark.parametrize(
    "rungs",
    [(IDEAL, IDEAL, IDEAL), (LINK, LINK, COMPLIANT), (COMPLIANT, COMPLIANT, COMPLIANT)],
    ids="-".join,
)
def test_turning_backwards_mirrors_the_motion(rungs):
    scene = pump(rungs, pressure__rung="none", drive__speed=12)
    step = 1e-5
    t = tables.tables(scene, step)
    t = turning(t._replace(machine=t.machine._replace(gravity_y=0.0)), drive_moment=0.0)
    # ... across the stroke: y, rod angle and tilt with their rates
    mirror = np.array([1, -1, -1, 1, -1, -1] * 2)
    bodies = tables.start_state(scene, 0.3, t)
    turn = 2 * math.pi * scene.drive.speed
    there, back = (
        crank_run.run_mechanism(
            t, angle=sign * 0.3, speed=sign * turn, bodies=start, step=step, n_steps=5000
        )
        for sign, start in ((1, bodies), (-1, mirror * bodies))
    )
    assert there.status.ok
    assert there.contact_changes > 10 or rungs[2] == IDEAL
    assert_allclose(back.turns, -there.turns, rtol=1e-12)
    # Rounding, which the knocks of a quarter revolution blow up.
    assert_allclose(back.bodies, there.bodies * mirror, rtol=0, atol=1e-9)


def test_both_corners_of_a_straight_piston_touch_at_once():
    """The piston alone, thrown across its guide: both corners close in the same instant."""
    scene = pump(
        (COMPLIANT, COMPLIANT, COMPLIANT),
        pressure__rung="none",
        gravity=0,
        joint__crankpin__radial_clearance=2e-3,
        joint__wristpin__radial_clearance=2e-3,
    )
    speed, errors = 0.3, []
    for step in (1e-5, 5e-6, 2.5e-6):
        t = without(tables.tables(scene, step), *LOSSES)
        bodies = np.zeros((1, 12))
        bodies[0, 3] = scene.crank.radius + scene.rod.length
        bodies[0, 0] = bodies[0, 3] - scene.rod.centre_of_mass
        bodies[0, 10] = speed
        n_steps = round(4e-3 / step)
        found = crank_run.run_mechanism(
            t, angle=0, speed=0, bodies=bodies, step=step, n_steps=n_steps
        )
        assert found.contact_changes > 20
        assert found.contact_changes % 2 == 0
        assert abs(found.bodies[:, 0, 5]).max() < 1e-20  # straight it stays
        energy = mechanical_energy(scene, t, found)
        errors.append(abs(energy / energy[0] - 1).max())
    print(f"\nenergy error {errors}")
    assert errors[0] < 1e-6
    assert -slope([1, 2, 4], errors) > 4.0  # order 5 of Runge-Kutta on an oscillator's energy


LAWS = {
    "kelvin-voigt": {},
    **{
        law: {"restitution": 0.5, "damping": 0}
        for law in (
            "hunt-crossley",
            "lankarani-nikravesh",
            "flores",
            "hu-guo",
            "carvalho-martins",
            "exact",
        )
    },
}
ELASTICITIES = {
    "linear": {},
    "hertz": {"hertz_stiffness": 3e10},
    "conformal": {"effective_modulus": 8e9, "contact_length": 0.05},
}


@pytest.mark.parametrize("elasticity", ELASTICITIES)
@pytest.mark.parametrize("law", LAWS)
def test_every_contact_law_runs_in_the_pump(law, elasticity):
    pin = {"law": law, "elasticity": elasticity, **LAWS[law], **ELASTICITIES[elasticity]}
    scene = load_scene("bilge-pump", {f"joint.crankpin.{k}": v for k, v in pin.items()})
    step = min(
        validity.STEP_PER_CONTACT_TIME / contacts.contact_frequency(scene),
        validity.STEP_PER_CONTACT_DECAY / contacts.contact_rate(scene),
    )
    assert step > 1e-6
    found = scene_run.run_scene(scene, step=step, n_steps=round(0.6 / step), start_angle=0.0)
    assert found.status.ok
    assert found.contact_changes > 0
    ideal = ideal_motion.ideal_motion(scene, np.linspace(0, 2 * math.pi, 361))
    largest = np.hypot(ideal.pin_force_x, ideal.pin_force_y).max()
    # Sustained contact is damped by a bounded amount: knocks, but no explosion.
    assert 0.9 * largest < found.peak_normal_force < 4 * largest
    last = found.force("pin_x")[-round(0.2 / step) :]
    # Over a revolution the pin carries the mean of what an ideal joint does.
    assert_allclose(last.mean(), ideal.pin_force_x[:-1].mean(), rtol=5e-3)


def test_contacts_of_a_scene_are_made_once(monkeypatch):
    made = []
    monkeypatch.setattr(
        contacts,
        "contact_record",
        lambda *a, own=contacts.contact_record: made.append(a) or own(*a),
    )
    # A stiffness that no other test has: nothing of this scene is known yet.
    simulate(
        load_scene("bilge-pump", {"duration": "0.25 s", "joint.crankpin.stiffness": 1.234e8}),
        seed=0,
    )
    assert len(made) == 1
    with pytest.raises(ValueError, match="read-only"):
        contacts.contact_table(load_scene("bilge-pump"), 0)["damping"] = 0.0


def test_a_throw_has_the_mobility_of_its_own_guide():
    long = {"guide": {"length": "300 mm"}}
    free = pump((COMPLIANT, COMPLIANT, COMPLIANT), throws=[{}, {"phase": "90 deg", "joint": long}])
    alone = pump((COMPLIANT, COMPLIANT, COMPLIANT), joint__guide__length="300 mm")
    shorter, longer = (contacts.joint_mobility(free, throw, layout.GUIDE) for throw in (0, 1))
    # Both corners together or against each other: 2/m, or 2 a^2/J about the wrist pin.
    assert_allclose(longer, 2 * 0.15**2 / TILT_INERTIA, rtol=1e-12)
    assert shorter < longer == contacts.joint_mobility(alone, 0, layout.GUIDE)


@pytest.mark.parametrize("hertz", [False, True], ids=["linear", "hertz"])
@pytest.mark.parametrize("restitution", [0.3, 0.7])
def test_restitution_is_what_was_asked_for(restitution, hertz):
    contact = np.zeros(1, CONTACT)[0]
    contact["law"], contact["hysteresis"] = LAW_HYSTERESIS, hysteresis("exact", restitution)
    contact["stiffness"] = 3e10 if hertz else 2e8
    contact["elasticity"] = ELASTIC_HERTZ if hertz else 0
    contact["clearance"], contact["friction_speed"], contact["speed_floor"] = 4e-5, 1.0, 1e-6
    # A hundred steps a contact; order 2.5 where the elasticity starts as d^(3/2).
    found = impact(contact, step=5e-6, duration=4e-3)
    assert_allclose(found, restitution, atol=1e-3)


def test_slow_closings_are_counted():
    pin = {"law": "exact", "restitution": 0.5, "damping": 0}
    counts = {}
    for floor in ("1e-6 m/s", "10 m/s"):
        table = {f"joint.crankpin.{k}": v for k, v in {**pin, "speed_floor": floor}.items()}
        scene = load_scene("bilge-pump", table | {"pressure.rung": "none"})
        found = scene_run.run_scene(scene, step=5e-6, n_steps=40_000, start_angle=0.0)
        counts[floor] = found.floored_closings, found.contact_changes
    assert counts["1e-6 m/s"][0] == 0
    floored, changes = counts["10 m/s"]
    assert changes > 10
    assert floored in (changes // 2, changes // 2 + changes % 2)  # every closing, no opening


def test_a_constant_loss_has_no_floor_to_count():
    pin = {"joint.crankpin.law": "exact", "joint.crankpin.damping": 0.0}
    pin |= {"joint.crankpin.restitution": 0.3, "duration": "0.8 s"}
    speed = {"joint.crankpin.restitution_speed": "10 m/s"}  # every closing is slower
    told = [simulate(load_scene("bilge-pump", pin | more), seed=1).numerics for more in ({}, speed)]
    assert "floored_share" in told[0]
    assert told[0]["contact_changes"] > 0 < told[1]["contact_changes"]
    assert not {"floored_share", "speed_floor_m_s"} & told[1].keys()


def test_the_seal_takes_its_friction_over_both_strokes():
    """Work of a revolution without any other friction: pressure times area, and 4 r F of Coulomb's.

    With the pressure's share, F is the mean over both strokes of what presses the seal on.
    """
    free = pump((IDEAL, IDEAL, IDEAL), pressure__rung="two-level")
    tension, share = 60.0, 0.02
    dragged = pump(
        (IDEAL, IDEAL, IDEAL),
        pressure__rung="two-level",
        piston__seal_friction=tension,
        piston__seal_friction_share=share,
        piston__seal_friction_speed=1e-4,
    )
    step = 1 / (4000 * free.drive.speed)
    work = []
    for scene in (free, dragged):
        found = run(scene, tables.tables(scene, step), step=step, duration=2 / scene.drive.speed)
        moment = found.forces[4000:, 0]  # the second revolution
        work.append(2 * math.pi * moment.mean())
    area, stroke = math.pi * free.piston.diameter**2 / 4, 2 * free.crank.radius
    pressed = area * (abs(free.pressure.suction) + free.pressure.discharge)
    # transitions of 6 degrees about the dead centres: some of a per mille of the stroke
    assert_allclose(work[1] - work[0], stroke * (2 * tension + share * pressed), rtol=2e-3)


def test_the_closed_form_has_the_seal_of_the_march():
    changes = {"piston__seal_friction": 60.0, "piston__seal_friction_share": 0.02}
    scene = pump((IDEAL, IDEAL, IDEAL), **changes)
    step = 1 / (4000 * scene.drive.speed)
    marched = run(scene, tables.tables(scene, step), step=step, duration=1 / scene.drive.speed)
    closed = scene_run.run_scene(scene, step=step, n_steps=4000, start_angle=0.3)
    for name in ("seal_x", "piston_x", "pin_x"):
        size = abs(closed.force(name)).max()
        # the middle of a step against its mean, where the sign turns within ten steps
        difference = abs(marched.force(name) - closed.force(name))
        assert np.percentile(difference, 99.5) < 1e-3 * size
    assert abs(closed.force("seal_x")).max() > 60.0
