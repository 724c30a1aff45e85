"""A crank with play in its main bearings: whirl, momentum, energy, limits, lanes, refusals."""

import math

import numpy as np
import pytest
from numba import typeof
from numpy.testing import assert_allclose
from wearstate.sim.fidelity.ladder import effects_of
from wearstate.sim.machine.simulate import simulate, simulate_many
from wearstate.sim.mechanism.crank_run import run_mechanism
from wearstate.sim.mechanism.layout import AT_REST, PUSHES, Yielding
from wearstate.sim.pump_setup import contacts, films, ideal_motion, tables, yielding
from wearstate.sim.pump_setup.films import bore_temperature
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

PLAY = {
    "crank.mass": "60 kg",
    "crank.bearing.pin_diameter": "70 mm",
    "crank.bearing.diametral_clearance": "0.1 mm",
    "crank.bearing.stiffness": "400 MN/m",
    "crank.bearing.damping": "60 kN s/m",
    "crank.bearing.friction": 0.02,
}
LOSSLESS = {
    "crank.bearing.damping": 0.0,
    "crank.bearing.friction": 0.0,
    "joint.crankpin.damping": 0.0,
    "joint.crankpin.friction": 0.0,
    "joint.crankpin.tangential_damping": 0.0,
    "piston.seal_friction": 0.0,
    "piston.seal_friction_share": 0.0,
}


def worn(scene="bilge-pump", **changes):
    return load_scene(scene, PLAY | changes)


def run(scene, *, step, n_steps, inertia=0.0, angle=0.3, journal=None, casing=None):
    t, start = tables.tables_and_start(scene, step, angle)
    if inertia:  # a crank that turns freely
        t = t._replace(machine=t.machine._replace(inverse_inertia=1 / inertia))
    found = run_mechanism(
        t,
        angle=angle,
        speed=start.speed,
        bodies=start.bodies,
        chambers=start.chambers,
        journal=start.journal if journal is None else journal,
        films=films.start_films(t, start.bodies, angle, start.journal),
        casing=casing or yielding.yielding_of(scene, step),
        step=step,
        n_steps=n_steps,
    )
    assert found.status.ok
    return t, found


def test_every_crank_runs_in_the_same_kernel():
    """Of other types, such as read-only arrays, a quarter of a minute would go into one more."""
    rod = {"rod.rung": "elastic", "rod.section_area": "8 cm^2", "rod.section_radius": "8 mm"}
    casing = {"casing.rung": "yielding"}
    scenes = [load_scene("bilge-pump", rod), worn(), worn(**rod), worn(**rod, **casing)]
    plain = load_scene("bilge-pump")
    assert {typeof(tables.tables(scene, 2e-5)) for scene in scenes} == {
        typeof(tables.tables(plain, 2e-5))
    }
    assert typeof(yielding.yielding_of(scenes[-1], 2e-5)) == typeof(AT_REST)


def test_an_unbalanced_crank_leans_on_its_bore_where_its_heavy_side_is():
    """Alone and without weight it turns on a circle: `m (e + u) w^2 = K (u - c)`, in phase.

    Rod and piston of a gram and no liquid hardly push.
    """
    light = {"rod.mass": "1 g", "piston.mass": "1 g", "rod.inertia": "1e-5 kg m^2"}
    still = {"gravity": 0.0, "pressure.rung": "none", "crank.unbalance": "0.3 kg m"}
    soft = {"crank.bearing.stiffness": "20 MN/m", "joint.crankpin.stiffness": "10 kN/m"}
    fast = {"drive.speed": "1500 rpm", "joint.crankpin.damping": "1 N s/m"}
    scene = worn(**LOSSLESS | light | still | soft | fast)
    step = 1e-5
    mass, e, clearance, omega = 60.0, 0.3 / 60, 0.05e-3, 2 * math.pi * 25
    radius = (clearance * 20e6 + mass * e * omega**2) / (20e6 - mass * omega**2)
    speed = radius * omega
    _, found = run(
        scene,
        step=step,
        n_steps=20_000,
        angle=0.0,
        journal=np.array([radius, 0.0, 0.0, speed, 0.0, 0.0]),
    )
    turned = np.exp(-1j * found.turns[:, 0])
    place = (found.journal[:, 0] + 1j * found.journal[:, 1]) * turned
    # rod and piston weigh 2e-5 of the crank
    assert_allclose(place, radius, rtol=0, atol=2e-3 * (radius - clearance) + 1e-4 * clearance)
    load = (found.force("main_x") + 1j * found.force("main_y")) * turned[:-1]
    assert_allclose(abs(load), mass * (e + radius) * omega**2, rtol=2e-3)


@pytest.mark.parametrize("scene", ["bilge-pump", "triplex-pump"])
def test_momentum_of_the_crank(scene):
    """Pins, bearing and weight are all that pushes it; its centre of mass is eccentric."""
    changes = {"crank.unbalance": "0.2 kg m", "pressure.rung": "two-level"}
    pump = worn(scene, **changes)
    step = 1e-5
    t, found = run(pump, step=step, n_steps=30_000)
    mass, e = 60.0, 0.2 / 60
    angle = found.turns[:, 0] + pump.throws[0].phase
    omega = found.turns[:, 1]
    velocity = found.journal[:, 2:] + (e * omega * np.array([-np.sin(angle), np.cos(angle)])).T
    pushed = -np.stack([found.force("main_x"), found.force("main_y")], axis=1)
    pushed -= mass * np.array([t.machine.gravity_x, t.machine.gravity_y])
    for throw in range(len(pump.throws)):
        pushed -= np.stack([found.force("pin_x", throw), found.force("pin_y", throw)], axis=1)
    gained = mass * (velocity - velocity[0])[1:]
    impulse = np.cumsum(pushed, axis=0) * step
    assert found.contact_changes > 10
    assert np.ptp(gained) > 0.1  # N s: it flies and knocks
    assert_allclose(gained, impulse, rtol=0, atol=1e-7 * np.abs(np.cumsum(pushed)).max() * step)


def test_momentum_of_a_free_casing_that_the_journal_pushes():
    """Nothing pushes along the stroke from outside: what the casing gains its contents lose.

    Bodies and journal are seen from the casing; their own momentum is that and their mass times
    its speed.
    """
    scene = worn(**{"gravity": 0.0, "pressure.rung": "none", "piston.seal_friction": 0.0})
    step, mass = 5e-6, 200.0
    casing = Yielding(
        push=np.zeros((1, 1, len(PUSHES))),
        react=np.array([[1.0, 0.0, 0.0]]),
        reach=np.array([[0.5 * step**2, 1.0, step]]),
        give=np.array([[1.0, 0.0]]) / math.sqrt(mass),
        held=np.zeros((1, 2)),
        journal=np.array([[1.0, 0.0]]) / math.sqrt(mass),
        blend=np.zeros((2, 2)),
    )
    _, found = run(scene, step=step, n_steps=60_000, casing=casing)
    impulse = np.cumsum(found.force("main_x")) * step  # of the journal on the casing
    contents = np.array([60.0, scene.rod.mass, scene.piston.mass])
    speeds = np.stack([found.journal[:, 2], *found.bodies[:, 0, [6, 9]].T])
    gained = contents @ speeds
    size = np.abs(impulse).max()
    assert np.ptp(impulse) > 1.0  # N s
    lost = gained[1:] - gained[0] + contents.sum() * impulse / mass
    # the casing's acceleration is carried on over one step: a knock's edge is off by its change
    assert_allclose(lost, -impulse, rtol=0, atol=2e-3 * size)


def energy_of(scene, t, found, inertia):
    """Kinetic energy, height and springs of crank, rod and piston."""
    mass, e, rod = scene.crank.mass, scene.crank.unbalance / scene.crank.mass, scene.rod
    angle, omega = found.turns.T
    x, y, beta, piston, _, _, x_, y_, b_, p_, _, _ = found.bodies[:, 0].T
    u, v, u_, v_ = found.journal.T
    sin, cos = np.sin(angle), np.cos(angle)
    kinetic = 0.5 * mass * (u_**2 + v_**2) + 0.5 * inertia * omega**2
    kinetic += mass * e * omega * (v_ * cos - u_ * sin)
    kinetic += 0.5 * rod.mass * (x_**2 + y_**2) + 0.5 * rod.inertia * b_**2
    kinetic += 0.5 * scene.piston.mass * p_**2
    high = t.machine.gravity_x * (mass * (u + e * cos) + rod.mass * x + scene.piston.mass * piston)
    high += t.machine.gravity_y * (mass * (v + e * sin) + rod.mass * y)
    arm, radius = rod.length - rod.centre_of_mass, scene.crank.radius
    d = np.hypot(
        u + radius * cos - x + arm * np.cos(beta), v + radius * sin - y - arm * np.sin(beta)
    )
    springs = 0.0
    for contact, away in ((t.contacts[0, 0], d), (t.bore[0], np.hypot(u, v))):
        sunk = np.maximum(away - contact["clearance"], 0.0)
        springs = springs + 0.5 * contact["stiffness"] * sunk**2
    return kinetic + high + springs


def test_a_crank_that_turns_freely_keeps_the_energy():
    """Without losses, with weight, unbalance, a hundred knocks; fourth order in the step."""
    free = {"pressure.rung": "none", "crank.unbalance": "0.2 kg m"}
    scene = worn(**LOSSLESS | free, stroke_inclination="35 deg")
    inertia, errors = 2.0, []
    default = 0.3 / contacts.contact_frequency(scene)
    for part in (1, 2, 4):
        step = default / part
        t, found = run(scene, step=step, n_steps=math.ceil(0.3 / step), inertia=inertia)
        energy = energy_of(scene, t, found, inertia)
        errors.append(abs(energy / energy[0] - 1).max())
        assert found.contact_changes > 100
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] > 8
    assert errors[1] / errors[2] > 8


def test_a_tight_bearing_hands_the_force_of_the_pin_on():
    """Without room to fly, the casing feels pin and weight up to the tenth order."""
    scene = worn(
        **{
            "crank.bearing.diametral_clearance": "4 um",
            "crank.bearing.stiffness": "2 GN/m",
            "crank.bearing.damping": "200 kN s/m",
            "duration": "1 s",
            "drive.speed": "300 rpm",
        }
    )
    truth = simulate(scene, seed=1, truth=True).truth
    pin, main = -truth["pin_force_n"].T, truth["main_bearing_force_n"].T
    weight = 60 * 9.80665 * math.sin(scene.stroke_inclination)
    assert_allclose(main.mean(axis=1), pin.mean(axis=1) - [weight, 0.0], rtol=0, atol=1.0)
    orders = [np.fft.rfft(force, axis=1)[:, 5:51:5] * 2 / force.shape[1] for force in (pin, main)]
    assert_allclose(orders[1], orders[0], rtol=0, atol=0.01 * abs(orders[0]).max())


def test_half_the_step_finds_the_same_levels():
    scene = worn(duration="2 s")
    step = simulate(scene, seed=1).numerics["step_s"]
    levels = [
        np.log10(np.std(np.asarray(simulate(one, seed=1).signal)[:2], axis=1)) * 20
        for one in (
            scene,
            scene.model_copy(
                update={"numerics": scene.numerics.model_copy(update={"step": step / 4})}
            ),
        )
    ]
    assert_allclose(levels[0], levels[1], rtol=0, atol=0.3)  # dB: knocks scatter


def test_a_bearing_without_play_is_none():
    plain = simulate(load_scene("bilge-pump", {"duration": "0.5 s"}), seed=1)
    ideal = worn(**{"crank.bearing.rung": "ideal", "duration": "0.5 s"})
    assert np.array_equal(simulate(ideal, seed=1).signal, plain.signal)
    assert plain.numerics["rung_mainbearing"] == "ideal"


def test_play_runs_alone_among_lanes_and_keeps_its_bytes():
    scenes = [load_scene("bilge-pump", {"duration": "0.4 s"})] * 4
    scenes.insert(2, worn(duration="0.4 s", **{"casing.rung": "yielding"}))
    together = [
        recording
        for _, recording in sorted(
            simulate_many(list(zip(scenes, range(5), strict=True))), key=lambda pair: pair[0]
        )
    ]
    assert together[2].numerics["rung_mainbearing"] == "compliant"
    for number, recording in enumerate(together):
        assert np.array_equal(recording.signal, simulate(scenes[number], seed=number).signal)


def test_load_of_the_bearing_holds_pin_weight_and_unbalance():
    scene = worn(**{"crank.unbalance": "0.2 kg m", "pressure.rung": "none", "gravity": 0.0})
    angle = np.linspace(0, 6, 7)
    motion = ideal_motion.ideal_motion(scene, angle)
    load = ideal_motion.bearing_load(scene, angle)
    flung = 0.2 * (2 * math.pi * scene.drive.speed) ** 2
    assert_allclose(load[0], flung * np.cos(angle) - motion.pin_force_x, rtol=1e-12)
    assert_allclose(load[1], flung * np.sin(angle) - motion.pin_force_y, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"crank.mass": None}, "mass is missing"),
        ({"joint.crankpin.rung": "ideal"}, "joint.crankpin.rung = 'ideal' holds the crank"),
        ({"crank.bearing.stiffness": None}, "stiffness is missing"),
        ({"crank.bearing.diametral_clearance": "0 mm"}, "crank.bearing.rung = 'compliant' needs"),
        ({"crank.bearing.stiffness": "1 MN/m"}, "crank.bearing: radial clearance"),
    ],
)
def test_what_cannot_be_is_refused_by_name(changes, words):
    given = {name: value for name, value in (PLAY | changes).items() if value is not None}
    with pytest.raises(SceneError, match=words):
        simulate(load_scene("bilge-pump", given), seed=1)


def test_chart_and_auto_may_leave_the_play_out():
    effect = {one.name: one for one in effects_of(worn())}["mainbearing"]
    assert [rung.name for rung in effect.rungs] == ["ideal", "compliant"]
    assert "mainbearing" not in {one.name for one in effects_of(load_scene("bilge-pump"))}


OIL = {
    "crank.bearing.rung": "film-short",
    "crank.bearing.oil.viscosity": "0.06 Pa s",
    "crank.bearing.oil.length": "20 mm",
}


def test_a_journal_in_oil_floats_where_the_short_bearing_says():
    """Under the crank's weight alone: load and attitude of Ocvirk's film."""
    light = {"rod.mass": "1 g", "piston.mass": "1 g", "rod.inertia": "1e-5 kg m^2"}
    alone = {"pressure.rung": "none", "piston.seal_friction": 0.0, "duration": "3 s"}
    soft = {"joint.crankpin.stiffness": "100 kN/m", "joint.crankpin.damping": "1 N s/m"}
    soft |= {"joint.crankpin.friction": 0.0, "joint.crankpin.tangential_damping": 0.0}
    turn = {"drive.speed": "1200 rpm", "stroke_inclination": "0 deg", "crank.mass": "20 kg"}
    scene = worn(**OIL | light | alone | soft | turn)
    truth = simulate(scene, seed=1, truth=True).truth
    # means over a revolution: rod and piston swing by 2 N
    x, y = truth["main_bearing_offset_m"][-1280:].mean(axis=0) / 0.05e-3
    load = -truth["main_bearing_force_n"][-1280:].mean(axis=0)[1]
    assert_allclose(load, 20 * 9.80665, rtol=1e-3)
    y += load / 400e6 / 0.05e-3  # the wall yields, a hundredth of the clearance
    e = math.hypot(x, y)
    # eta U L^3 / (4 c^2) * e / (1 - e^2)^2 * sqrt(pi^2 (1 - e^2) + 16 e^2)
    scale = 0.06 * math.tau * 20 * 0.035 * 0.02**3 / (4 * 0.05e-3**2)
    carried = scale * e / (1 - e * e) ** 2 * math.sqrt(math.pi**2 * (1 - e * e) + 16 * e * e)
    assert_allclose(carried, load, rtol=5e-3)
    attitude = math.atan2(x, -y)  # from the load, which points along -y, with the rotation
    assert_allclose(math.tan(attitude), math.pi * math.sqrt(1 - e * e) / (4 * e), rtol=5e-3)


def test_oil_cushions_the_journal():
    """Flooded main bearings: the casing hears the pin again, and the film is told."""
    dry, oiled = (simulate(worn(duration="2 s", **more), seed=1) for more in ({}, OIL))
    plain = simulate(load_scene("bilge-pump", {"duration": "2 s"}), seed=1)
    levels = [np.std(np.asarray(one.signal)[1]) for one in (plain, oiled, dry)]
    assert levels[2] > 2 * levels[0]
    assert levels[1] < 1.3 * levels[0]
    assert oiled.numerics["rung_mainbearing"] == "film-short"
    assert 1e-6 < oiled.numerics["min_film_m"] < 0.05e-3


def test_main_bearings_are_as_warm_as_their_heat_balance():
    oil = {"temperature": "320 K", "viscosity_40": "68 mm^2/s", "viscosity_100": "8.7 mm^2/s"}
    oil |= {"density": "870 kg/m^3", "conductance": "5 W/K", "viscosity": None}
    heat = OIL | {f"crank.bearing.oil.{name}": value for name, value in oil.items()}
    warm = bore_temperature(worn(**{name: value for name, value in heat.items() if value}))
    assert 320.5 < warm < 360
    assert bore_temperature(worn(**OIL)) is None
