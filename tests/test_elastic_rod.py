"""Rods that stretch and bend: closed forms, mass points, energy, limits, refusals."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.sim.fidelity.ladder import effects_of
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.mechanism.crank_run import run_mechanism
from wearstate.sim.mechanism.equations import derivative_of_record
from wearstate.sim.mechanism.layout import ANGLE, SPEED, scratch
from wearstate.sim.pump.scene_run import pin_offsets
from wearstate.sim.pump_lanes.lanes import lane_kind
from wearstate.sim.pump_setup import contacts, tables
from wearstate.sim.pump_setup.rods import rod_table
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

ELASTIC = {"rod.rung": "elastic", "rod.section_area": "8 cm^2", "rod.section_radius": "8 mm"}
LOSSLESS = {
    "rod.damping_ratio": 0.0,
    "joint.crankpin.damping": 0.0,
    "joint.crankpin.friction": 0.0,
    "joint.crankpin.tangential_damping": 0.0,
}
NO_PRESSURE = {"pressure.rung": "none"}
TIGHT = {"joint.crankpin.rung": "ideal"}


def elastic(scene="bilge-pump", **changes):
    return load_scene(scene, ELASTIC | changes)


def run(scene, *, step, n_steps, angle=0.0, speed=None, inertia=0.0, flex=None):
    t, start = tables.tables_and_start(scene, step, angle)
    if inertia:  # a crank that turns freely
        t = without_loss(t)._replace(machine=t.machine._replace(inverse_inertia=1 / inertia))
    found = run_mechanism(
        t,
        angle=angle,
        speed=start.speed if speed is None else speed,
        bodies=at_rest(start.bodies, scene, flex) if speed == 0.0 else start.bodies,
        chambers=start.chambers,
        flex=flex,
        step=step,
        n_steps=n_steps,
    )
    assert found.status.ok
    return t, found


def at_rest(bodies, scene, flex):
    """Nothing moves, and the eyes lie at their pins, at the crank's dead centre."""
    still, rod, modes = bodies.copy(), scene.rod, rod_table(scene)[0]
    still[:, 6:] = 0.0
    crank = 1 - rod.centre_of_mass / rod.length
    stretch, bow = flex[0, :2]
    turned = (modes["wrist_shape"] - modes["crank_shape"]) * bow / rod.length
    still[0, 0] += crank * stretch
    still[0, 1] += rod.centre_of_mass * turned - modes["wrist_shape"] * bow
    still[0, 2] += turned
    still[0, 3] += stretch
    return still


def without_loss(t):
    """Tables whose links lose nothing either: their damping is no key of a scene."""
    contacts = t.contacts.copy()
    contacts["damping"] = contacts["tangential_damping"] = contacts["friction"] = 0.0
    return t._replace(contacts=contacts)


def frequency_of(signal, step):
    """Of a single sine through its zeros [rad/s]."""
    rising = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    at = rising - signal[rising] / (signal[rising + 1] - signal[rising])
    return 2 * math.pi * (len(at) - 1) / ((at[-1] - at[0]) * step)


STILL = LOSSLESS | NO_PRESSURE | TIGHT | {"gravity": 0.0}


def test_a_rod_between_two_pins_bends_as_a_beam_on_two_supports():
    scene = elastic(**STILL)
    step, rod = 2e-6, scene.rod
    flex = np.array([[0.0, 1e-4, 0.0, 0.0]])
    _, found = run(scene, step=step, n_steps=60_000, speed=0.0, flex=flex)
    beam = rod.elastic_modulus * rod.section_area * rod.section_radius**2
    per_metre = rod.shank_mass / rod.length
    expected = math.pi**2 * math.sqrt(beam / per_metre / rod.length**4)
    assert_allclose(frequency_of(found.flex[:, 0, 1], step), expected, rtol=1e-5)
    assert np.abs(found.flex[:, 0, 0]).max() < 1e-8  # of the bow squared over the length


def test_a_piston_swings_on_its_rod():
    """The crank stands at its dead centre: only the stretch is left, and all masses follow it."""
    scene = elastic(**STILL)
    step, rod = 1e-6, scene.rod
    flex = np.array([[1e-6, 0.0, 0.0, 0.0]])
    _, found = run(scene, step=step, n_steps=20_000, speed=0.0, flex=flex)
    moving = scene.piston.mass + rod.mass * (1 - rod.centre_of_mass / rod.length) ** 2
    moving += rod.inertia / rod.length**2
    stiffness = rod.elastic_modulus * rod.section_area / rod.length
    swing = found.flex[:, 0, 0]
    assert_allclose(
        frequency_of(swing - swing.mean(), step), math.sqrt(stiffness / moving), rtol=1e-4
    )
    assert_allclose(found.bodies[:, 0, 3] - found.bodies[0, 0, 3], swing - swing[0], atol=1e-9)


def eye_masses(rod):
    """Of wrist-pin and crank-pin eye, in addition to the shank: the moment about the wrist pin."""
    crank = rod.mass * rod.centre_of_mass / rod.length - rod.shank_mass / 2
    return rod.mass - rod.shank_mass - crank, crank


def points_of(rod, state, n=4000):
    """Where mass points of a rod lie, from (x, y, angle, stretch, bow), and their masses."""
    x, y, beta, stretch, bow = state
    share = (np.arange(n) + 0.5) / n
    s = np.concatenate([share * rod.length, [0.0, rod.length]]) - rod.centre_of_mass
    mass = np.concatenate([np.full(n, rod.shank_mass / n), eye_masses(rod)])
    sine = np.sin(math.pi * (s + rod.centre_of_mass) / rod.length)
    # free of what is a motion of the whole rod, by the masses themselves
    whole = np.stack([np.ones_like(s), s])
    sine = sine - whole.T @ np.linalg.solve((mass * whole) @ whole.T, (mass * whole) @ sine)
    e = np.array([-math.cos(beta), math.sin(beta)])
    g = np.array([math.sin(beta), math.cos(beta)])
    along, across = (1 + stretch / rod.length) * s, bow * sine
    return np.array([x, y]) + np.outer(along, e) + np.outer(across, g), mass


FLYING = {
    "joint.crankpin.friction": 0.3,
    "joint.crankpin.diametral_clearance": "2 mm",
    "joint.wristpin.rung": "compliant",
    "joint.wristpin.diametral_clearance": "20 mm",
    "joint.wristpin.damping": 0.0,
    "joint.wristpin.friction": 0.0,
    "gravity": 0.0,
}


@pytest.mark.parametrize("touching", [False, True])
def test_accelerations_are_those_of_the_rods_mass_points(touching):
    """Lagrange's equations of 4,002 mass points, by differences; the pin flies or rubs."""
    scene = elastic(**LOSSLESS | NO_PRESSURE | FLYING)
    t, start = tables.tables_and_start(scene, 1e-6, 0.4)
    w = scratch(1, 0, 1)
    w.crank[0, ANGLE], w.crank[0, SPEED] = 0.4, 3.0
    state = np.array([*start.bodies[0, :3], 3e-4, -2e-3])
    speeds = np.array([0.3, -0.2, 40.0, 1.5, 2.5])
    bodies = start.bodies.copy()
    flex = np.array([[*state[3:], *speeds[3:]]])
    offset = pin_offsets(scene, np.array([0.4]), bodies, flex=flex)[0, :2]
    reach = t.contacts[0, 0]["clearance"] + (2e-5 if touching else -1e-4)
    state[:2] += offset - reach * np.array([0.6, 0.8])
    bodies[0, :2], bodies[0, 6:9] = state[:2], speeds[:3]
    w.stage["y"][0], w.flex["y"][0] = bodies, flex
    w.held["touching"][0, 0] = touching
    derivative_of_record(w, 0, 0.0, t)
    found = np.array([*w.stage["rate"][0, 0, 6:9], *w.flex["rate"][0, 0, 2:]])

    _, mass = points_of(scene.rod, state)

    def tangents(at):
        ends = [
            (points_of(scene.rod, at + d)[0], points_of(scene.rod, at - d)[0])
            for d in 1e-6 * np.eye(5)
        ]
        return np.stack([(after - before) / 2e-6 for after, before in ends])

    basis = tangents(state)
    turning = (tangents(state + 1e-5 * speeds) - tangents(state - 1e-5 * speeds)) / 2e-5
    drift = np.einsum("i,ikc->kc", speeds, turning)
    matrix = np.einsum("ikc,k,jkc->ij", basis, mass, basis)
    modes = rod_table(scene)[0]
    push = -np.einsum("ikc,k,kc->i", basis, mass, drift)
    push[3:] -= np.array([modes["stretch_stiffness"], modes["bow_stiffness"]]) * state[3:]
    force = w.stage["force"][0, 0, :2]
    assert (np.hypot(*force) > 1000) == touching
    # the eye is the last point; it turns as the line to the last point of the shank does
    eye, shank = basis[:, -1], basis[:, -3]
    line = np.subtract(*points_of(scene.rod, state)[0][[-1, -3]])
    ahead = eye - shank
    # in the sense of the rod's angle
    turn = (ahead[:, 0] * line[1] - ahead[:, 1] * line[0]) / (line @ line)
    couple = (scene.joint.crankpin.pin_diameter / 2 + t.contacts[0, 0]["clearance"]) * (
        0.6 * force[1] - 0.8 * force[0]
    )
    push += eye @ force - couple * turn
    assert (abs(couple) > 10) == touching
    # differences of a millionth over metres leave 1e-10 of positions, and its square 1e-4 of rates
    assert_allclose(found, np.linalg.solve(matrix, push), rtol=1e-4, atol=1e-2)


def energy_of(scene, t, found, inertia):
    """Kinetic energy, height and springs of crank, rod and piston."""
    rod, modes = scene.rod, t.flex[0]
    omega = found.turns[:, 1]
    x, y, _, piston, _, _, x_, y_, b_, p_, _, _ = found.bodies[:, 0].T
    stretch, bow, stretch_, bow_ = found.flex[:, 0].T
    bow_mass, stretch_mass = 1 / modes["inverse_bow_mass"], 1 / modes["inverse_stretch_mass"]
    turning = rod.inertia * (1 + stretch / rod.length) ** 2 + bow_mass * bow**2
    kinetic = 0.5 * inertia * omega**2 + 0.5 * scene.piston.mass * p_**2
    kinetic += 0.5 * rod.mass * (x_**2 + y_**2) + 0.5 * turning * b_**2
    kinetic += 0.5 * stretch_mass * stretch_**2 + 0.5 * bow_mass * bow_**2
    height = t.machine.gravity_x * (rod.mass * x + scene.piston.mass * piston)
    height += t.machine.gravity_y * rod.mass * y
    springs = 0.5 * modes["stretch_stiffness"] * stretch**2 + 0.5 * modes["bow_stiffness"] * bow**2
    offsets = pin_offsets(scene, found.turns[:, 0], found.bodies[:, 0], flex=found.flex[:, 0])
    for joint, place in ((0, offsets[:, :2]), (1, offsets[:, 2:])):
        contact = t.contacts[0, joint]
        if contact["stiffness"] > 0:
            overlap = np.maximum(np.hypot(*place.T) - contact["clearance"], 0.0)
            springs += 0.5 * contact["stiffness"] * overlap**2
    return kinetic + height + springs


WRIST = {
    "joint.wristpin.rung": "compliant",
    "joint.wristpin.damping": 0.0,
    "joint.wristpin.friction": 0.0,
    "joint.wristpin.tangential_damping": 0.0,
}


LINKS = {"joint.crankpin.rung": "link"} | WRIST | {"joint.wristpin.rung": "link"}


@pytest.mark.parametrize(
    ("changes", "least"),
    [
        ({}, 4),
        (WRIST, 10),
        (TIGHT, 0),
        (TIGHT | WRIST, 4),
        (LINKS, 0),
        (TIGHT | WRIST | {"joint.wristpin.rung": "link"}, 0),
    ],
)
def test_energy_of_a_free_crank_with_an_elastic_rod(changes, least):
    """Nothing drives and nothing loses: what swings in the rod comes from the crank."""
    scene = elastic(**LOSSLESS | NO_PRESSURE | changes, **{"rod.section_radius": "2 mm"})
    drifts = []
    for step in (4e-6, 2e-6):
        t, found = run(scene, step=step, n_steps=round(0.2 / step), angle=0.3, inertia=0.5)
        energy = energy_of(scene, t, found, 0.5)
        drifts.append(np.abs(energy / energy[0] - 1).max())
        assert found.contact_changes >= least
    assert drifts[1] < min(1e-9, drifts[0] / 8)


def test_a_crank_on_a_motor_turns_with_an_elastic_rod():
    """The crank's acceleration reaches the modes through the constraints of tight pins."""
    driven = TIGHT | {"drive.rung": "motor", "rod.damping_ratio": 0.5}
    forces = []
    for stiff in ("8 cm^2", "8000 cm^2"):
        scene = elastic(**driven, **{"rod.section_area": stiff})
        _, found = run(scene, step=4e-7, n_steps=50_000)
        forces.append(found.force("pin_x"))
    _, rigid = run(load_scene("bilge-pump", driven), step=4e-7, n_steps=50_000)
    size = np.abs(rigid.force("pin_x")).max()
    near = [np.abs(each - rigid.force("pin_x"))[10_000:].max() / size for each in forces]
    assert near[1] < 0.02 * near[0]
    assert near[0] < 0.1


def test_a_steady_pull_stretches_a_rod_by_its_shank():
    """Under constant pressure, slowly: force times length over modulus and area."""
    slow = {"drive.speed": "1 rpm", "pressure.rung": "constant", "rod.damping_ratio": 0.5}
    scene = elastic(**TIGHT, **slow)
    _, found = run(scene, step=1e-5, n_steps=20_000, angle=0.0)
    rod = scene.rod
    pull = -found.force("pin_x")[-1]  # at its dead centre the rod lies along the stroke
    expected = pull * rod.length / (rod.elastic_modulus * rod.section_area)
    ends = rod.mass * 9.80665 * rod.length / (rod.elastic_modulus * rod.section_area)
    assert abs(pull) > 1000
    assert_allclose(found.flex[-1, 0, 0], expected, rtol=0, atol=ends)


def test_a_stiff_rod_is_rigid_in_oil():
    """A hundred times the section: a film follows elastic eyes as it follows rigid ones."""
    oil = {
        "joint.crankpin.rung": "film-short",
        "joint.crankpin.oil.viscosity": "0.06 Pa s",
        "joint.crankpin.oil.length": "15 mm",
    }
    rigid, soft, stiff = (
        run(scene, step=1e-6, n_steps=40_000, angle=0.3)[1].force("pin_x")
        for scene in (
            load_scene("bilge-pump", oil),
            elastic(**oil, **{"rod.damping_ratio": 0.5}),
            elastic(**oil, **{"rod.damping_ratio": 0.5, "rod.section_area": "800 cm^2"}),
        )
    )
    settled = slice(10_000, None)
    misses = [np.abs(each - rigid)[settled].max() for each in (soft, stiff)]
    assert misses[1] < 0.02 * misses[0]


def test_a_stiff_rod_is_rigid_in_the_recording():
    """A thousand times the section: the casing hears what it hears of a rigid rod."""
    short = {"duration": "0.5 s", "numerics.step": "2 us"} | TIGHT
    rigid = simulate(load_scene("bilge-pump", short), seed=1).signal[:2]
    stiff = {"rod.section_area": "8000 cm^2", "rod.damping_ratio": 0.5}
    misses = [
        np.std(simulate(elastic(**short, **changes), seed=1).signal[:2] - rigid, axis=1)
        for changes in ({}, stiff)
    ]
    assert np.all(misses[1] < 0.01 * misses[0])


@pytest.mark.parametrize("throws", ["bilge-pump", "triplex-pump"])
def test_elastic_rods_of_a_scene_are_recorded_with_their_truth(throws):
    scene = elastic(throws, duration="0.3 s")
    found = simulate(scene, seed=3, truth=True)
    assert found.numerics["rung_rod"] == "elastic"
    stretch = found.truth["rod_stretch_m"]
    pull = found.truth["pin_force_n"][:, 0]
    rod = scene.rod
    # low-passed force against instantaneous stretch: alike in size, pulled when pushed away
    expected = -pull * rod.length / (rod.elastic_modulus * rod.section_area)
    assert np.corrcoef(stretch, expected)[0, 1] > 0.9
    assert 0.5 < np.std(stretch) / np.std(expected) < 2
    assert found.truth["rod_bow_m"].shape == stretch.shape
    offset = np.hypot(*found.truth["pin_offset_m"].T)
    clearance = scene.joint.crankpin.clearance_radial
    assert offset.max() < 2 * clearance  # the eye is where the rod has bent to
    assert lane_kind(scene) is None


@pytest.mark.parametrize("rung", ["compliant", "link", "film-short"])
def test_what_joints_lose_by_default_does_not_depend_on_the_rod(rung):
    """Wall damping, the damping of links and the floor of impact speeds are those of rigid rods."""
    joint = {"joint.crankpin.rung": rung}
    if rung == "compliant":
        joint |= {f"joint.crankpin.{k}": v for k, v in HYSTERETIC.items()}
    if rung == "film-short":
        joint |= {"joint.crankpin.oil.viscosity": 0.06, "joint.crankpin.oil.length": 0.015}
    rigid = contacts.contact_table(load_scene("bilge-pump", joint), 0)
    assert rigid[0] == contacts.contact_table(elastic(**joint), 0)[0]
    assert rigid["damping"][0] > 0 or 0 < rigid["speed_floor"][0] < 1


HYSTERETIC = {"law": "hunt-crossley", "restitution": 0.5, "damping": 0.0}


def test_the_step_follows_the_fastest_of_contacts_and_rods():
    """Springs of a rod make its contacts ring faster than a rigid rod's; a stiff one most."""
    rates = [
        contacts.contact_frequency(each)
        for each in (
            load_scene("bilge-pump"),
            elastic(),
            elastic(**{"rod.elastic_modulus": "2060 GPa"}),
            elastic(**TIGHT),
        )
    ]
    rod = elastic().rod
    free = math.sqrt(rod.elastic_modulus * rod.section_area * rod.length / rod.inertia)
    assert rates[0] < rates[1] < rates[2]
    assert 0 < rates[3] < free  # held at both ends


def test_the_ladder_shows_elastic_rods_where_their_section_is_known():
    known = load_scene("bilge-pump", {k: v for k, v in ELASTIC.items() if k != "rod.rung"})
    assert "rod" not in [each.name for each in effects_of(load_scene("bilge-pump"))]
    effect = {each.name: each for each in effects_of(known)}["rod"]
    assert [rung.name for rung in effect.rungs] == ["rigid", "elastic"]
    assert effect.refusal(known, "elastic") is None


@pytest.mark.parametrize("length", [0.21, 0.25, 0.3, 0.37])
def test_an_even_bar_may_be_elastic(length):
    """Its inertia is the least a shank between two eyes has; rounding does not refuse it."""
    bar = {"rod.length": length, "rod.centre_of_mass": length / 2, "rod.mass": 0.7}
    scene = elastic(**bar, **{"rod.inertia": 0.7 * length**2 / 12})
    assert_allclose(scene.rod.shank_mass, 0.7, rtol=1e-12)
    assert_allclose(eye_masses(scene.rod), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"rod.section_area": None}, ["section_area is missing", "rung 'elastic'"]),
        ({"rod.section_radius": None}, ["section_radius is missing"]),
        ({"rod.inertia": 0.05}, ["inertia = 0.05 kg m^2", "0.04207", "rung = 'rigid'"]),
        ({"rod.inertia": 0.001}, ["inertia = 0.001 kg m^2", ">= 0.02082"]),
    ],
)
def test_rods_that_cannot_be_elastic(changes, named):
    wanted = {k: v for k, v in (ELASTIC | changes).items() if v is not None}
    with pytest.raises(SceneError) as raised:
        load_scene("bilge-pump", wanted)
    for words in named:
        assert words in str(raised.value)
