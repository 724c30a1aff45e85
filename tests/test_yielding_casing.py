"""A casing that carries the main bearing along: momentum, ring of a pin, limits, steps, lanes."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.datasets.generation.work import NUMERICS
from wearstate.sim.fidelity.ladder import cost_of
from wearstate.sim.machine.simulate import simulate, simulate_many
from wearstate.sim.mechanism.crank_run import run_mechanism
from wearstate.sim.mechanism.layout import AT_REST, FORCES, PUSHES, Yielding
from wearstate.sim.pump_setup import joints, tables, yielding
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

YIELDS = {"casing.rung": "yielding"}
MASS = 20.0  # kg


def free_casing(step, mass, *, along=1.0, across=0.0, pushed=("pin_x", "pin_y")):
    """A casing of this mass on no spring, pushed by the crank pin alone."""
    push = np.zeros((1, 1, len(PUSHES)))
    for name, share in zip(pushed, (along, across), strict=True):
        push[0, 0, PUSHES.index(FORCES.index(name))] = -share / math.sqrt(mass)
    return Yielding(
        push=push,
        react=np.array([[1.0, 0.0, 0.0]]),
        reach=np.array([[0.5 * step**2, 1.0, step]]),
        give=np.array([[along, across]]) / math.sqrt(mass),
        held=np.zeros((1, 2)),
        journal=np.zeros((1, 2)),
        blend=np.zeros((2, 2)),
    )


def tables_of(step, **changes):
    scene = load_scene("bilge-pump", {"gravity": 0.0, "pressure.rung": "none", **changes})
    return scene, tables.tables(scene, step)


def run(scene, t, casing, *, step, n_steps, angle=0.3, speed=None, kick=0.0, shift=0.0):
    """From the library's own start; of a crank that stands, shifted [m] and kicked [m/s]."""
    bodies = tables.start_state(scene, angle, t)
    if speed == 0.0:
        bodies[:, 6:] = 0.0
    bodies[:, [0, 3]] += shift
    bodies[:, [6, 9]] += kick
    found = run_mechanism(
        t,
        angle=angle,
        speed=2 * math.pi * scene.drive.speed if speed is None else speed,
        bodies=bodies,
        step=step,
        n_steps=n_steps,
        casing=casing,
    )
    assert found.status.ok
    return found


# --- the frame of a bearing that moves


def test_momentum_of_a_free_casing_and_what_moves_in_it():
    """Without liquid nothing pushes along the stroke from outside: what one gains the other loses.

    The kernel's bodies are seen from the bearing; their own momentum is that and their mass times
    the casing's speed.
    """
    step = 5e-6
    scene, t = tables_of(step, **{"drive.speed": "300 rpm"})
    found = run(scene, t, free_casing(step, MASS), step=step, n_steps=60_000)
    impulse = np.cumsum(found.force("pin_x")) * step  # of the pin on rod and piston
    casing = -impulse / MASS
    masses = np.array([scene.rod.mass, scene.piston.mass])
    seen = found.bodies[:, 0, [6, 9]] @ masses
    gained = seen[1:] - seen[0] + masses.sum() * casing
    size = np.abs(impulse).max()
    assert np.ptp(impulse) > 1.0  # N s: knocks, not a stroll
    # the casing's acceleration is carried on over one step: a knock's edge is off by its change
    assert_allclose(gained, impulse, rtol=0, atol=2e-3 * size)
    # and a casing that is taken to stand still is far off
    still = run(scene, t, AT_REST, step=step, n_steps=60_000)
    seen = still.bodies[:, 0, [6, 9]] @ masses
    own = np.cumsum(still.force("pin_x")) * step
    assert_allclose(seen[1:] - seen[0], own, rtol=0, atol=1e-9 * size)
    assert np.abs(seen[1:] - seen[0] - masses.sum() * own / MASS - own).max() > 0.1 * size


@pytest.mark.parametrize("mass", [20.0, 60.0, 1e9])
def test_a_pin_rings_against_rod_and_casing_together(mass):
    """Pulled into its eye at the dead centre: the spring between both masses."""
    step, n_steps = 2e-6, 20_000
    scene, t = tables_of(
        step,
        **{
            "pressure.rung": "constant",
            "pressure.suction": "-60 kPa",
            "pressure.discharge": "-50 kPa",  # a rod in compression would turn aside
            "joint.crankpin.friction": 0.0,
            "joint.crankpin.tangential_damping": 0.0,
            "piston.seal_friction": 0.0,
        },
    )
    contacts = t.contacts.copy()
    contacts["damping"] = 0.0
    t = t._replace(contacts=contacts)
    moving = scene.rod.mass + scene.piston.mass
    stiffness = float(t.contacts["stiffness"][0, 0])
    at_dead_centre = {"step": step, "angle": 0.0, "speed": 0.0}
    [pulled] = run(scene, t, free_casing(step, mass), n_steps=1, **at_dead_centre).force("pin_x")
    rest = -50e3 * joints.piston_area(scene) * mass / (mass + moving)
    shift = (pulled - rest) / stiffness  # of a start that is meant for a crank that turns
    found = run(
        scene, t, free_casing(step, mass), n_steps=n_steps, kick=1e-3, shift=shift, **at_dead_centre
    )
    force = found.force("pin_x") - found.force("pin_x").mean()
    assert abs(found.force("pin_x")).min() > 0  # it never lets go
    up = np.flatnonzero((force[:-1] < 0) & (force[1:] >= 0))
    at = up - force[up] / (force[up + 1] - force[up])
    heard = (len(at) - 1) / ((at[-1] - at[0]) * step)
    expected = math.sqrt(stiffness * (1 / moving + 1 / mass)) / (2 * math.pi)
    assert heard == pytest.approx(expected, rel=1e-3)


def test_a_heavy_casing_is_one_at_rest():
    scene = load_scene("bilge-pump", {**YIELDS, "duration": "0.4 s"})
    shapes = {
        f"casing.modes.{i}.shape.{place}": 1e-4 * value
        for i, mode in enumerate(scene.casing.modes)
        for place, value in mode.shape.items()
    }
    forces = [
        simulate(
            load_scene("bilge-pump", {"duration": "0.4 s", **shapes, "casing.rung": rung}),
            seed=1,
            truth=True,
        ).truth["pin_force_n"]
        for rung in ("driven", "yielding")
    ]
    assert_allclose(forces[1], forces[0], rtol=0, atol=1e-3 * np.abs(forces[0]).max())


def test_it_takes_force_out_of_knocks():
    """A pin that meets a casing of 18 kg instead of a wall is knocked less hard."""
    peaks = [
        simulate(load_scene("bilge-pump", {"casing.rung": rung}), seed=2).numerics[
            "peak_normal_force_n"
        ]
        for rung in ("driven", "yielding")
    ]
    assert 0.6 < peaks[1] / peaks[0] < 0.98


def heard(name, changes):
    return simulate(load_scene(name, changes), seed=1).vibration.astype(float)


def levels(step_s, n=16):
    """Mean square of both sensors over starts, which are the same at every step."""
    runs = [
        (
            load_scene(
                "bilge-pump",
                {
                    **YIELDS,
                    "duration": "1 s",
                    "drive.start_angle": math.tau * (i * 0.618 % 1),
                    "joint.crankpin.diametral_clearance": "0.15 mm",
                    "numerics.step": step_s,
                },
            ),
            i,
        )
        for i in range(n)
    ]
    found = [run.vibration.astype(float) for _, run in simulate_many(runs)]
    return 10 * np.log10(np.mean([(each**2).mean(axis=1) for each in found], axis=0))


def test_the_default_step_is_fine_enough():
    """Carried on with its ringing, the bearing's acceleration was off by 0.04 dB; held, by 0.6."""
    usual, fine = levels(1 / 51_200), levels(1 / 204_800)
    assert_allclose(usual, fine, rtol=0, atol=0.01)  # a fourth of that


# --- lanes


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"joint.guide.rung": "compliant", "joint.wristpin.rung": "compliant"},
        {"pressure.rung": "chamber", "drive.rung": "motor"},
    ],
)
def test_lanes_have_the_bytes_of_a_pump_alone(more):
    """Beside others, some of which stand still in their frames, as their casings are driven."""
    runs = [
        (
            load_scene(
                "bilge-pump",
                {
                    "duration": "0.4 s",
                    **more,
                    "casing.rung": "driven" if i % 3 == 1 else "yielding",
                    "joint.crankpin.diametral_clearance": 6e-5 + 3e-5 * i,
                },
            ),
            i,
        )
        for i in range(9)
    ]
    together = dict(simulate_many(runs))
    for i in (0, 1, 8):
        alone = simulate(*runs[i][:1], seed=i)
        assert alone.signal.tobytes() == together[i].signal.tobytes()


def test_throws_of_a_record_push_on_the_same_modes():
    runs = [(load_scene("triplex-pump", {**YIELDS, "duration": "0.2 s"}), i) for i in range(6)]
    together = dict(simulate_many(runs))
    assert simulate(runs[2][0], seed=2).signal.tobytes() == together[2].signal.tobytes()
    driven = simulate(load_scene("triplex-pump", {"duration": "0.2 s"}), seed=2)
    assert np.abs(driven.signal - together[2].signal).max() > 0.1


# --- what the bearing carries without play


def of_one_mode(scene, frequency, shape):
    """The scene on a casing of one undamped mode, which moves along the stroke alone."""
    mode = scene.casing.modes[0].model_copy(
        update={"frequency": frequency, "damping_ratio": 0.0, "shape": {"bearing_x": shape}}
    )
    return scene.model_copy(
        update={"casing": scene.casing.model_copy(update={"rung": "yielding", "modes": (mode,)})}
    )


@pytest.mark.parametrize("mass", [2.0, 9.0, 60.0])
def test_a_rigid_mechanism_rings_with_its_casing_as_their_masses_together(mass):
    """On a crank that stands, under a load that sets in: `sqrt(M / (M + m))` of the mode alone.

    A casing of 2 kg under 9 of piston and rod: fed back a step late it would run away.
    """
    step, mode = 5e-6, 1000.0
    rigid = {"joint.crankpin.rung": "ideal", "pressure.rung": "constant"}
    scene, _ = tables_of(step, **rigid, **{"pressure.discharge": "50 kPa"})
    scene = of_one_mode(scene, mode, 1 / math.sqrt(mass))
    t = tables.tables(scene, step)
    casing = yielding.yielding_of(scene, step)
    found = run(scene, t, casing, step=step, n_steps=20_000, angle=0.0, speed=0.0)
    force = found.force("pin_x")[100:]  # which begins without a past to be carried on
    force -= force.mean()
    up = np.flatnonzero((force[:-1] < 0) & (force[1:] >= 0))
    at = up - force[up] / (force[up + 1] - force[up])
    heard = (len(at) - 1) / ((at[-1] - at[0]) * step)
    moving = scene.rod.mass + scene.piston.mass
    assert heard == pytest.approx(mode * math.sqrt(mass / (mass + moving)), rel=1e-3)
    assert np.ptp(force[-4000:]) == pytest.approx(np.ptp(force[:4000]), rel=0.02)


@pytest.mark.parametrize(("guide", "bearing"), [(4.0, 1.0), (1.0, 4.0), (2.0, 2.0)])
def test_a_light_casing_does_not_run_away(guide, bearing):
    """What an ideal guide carries outweighs a third of what the casing weighs there."""
    light = {"duration": "0.8 s", **YIELDS}
    for i, mode in enumerate(load_scene("bilge-pump").casing.modes):
        light[f"casing.modes.{i}.shape.guide_y"] = guide * mode.shape["guide_y"]
        light[f"casing.modes.{i}.shape.bearing_y"] = bearing * mode.shape["bearing_y"]
    usual, fine = (
        heard("bilge-pump", {**light, "numerics.step": step}).std(axis=1)
        for step in ("19 us", "4 us")
    )
    assert_allclose(usual, fine, rtol=0.25)  # of few knocks; it was 200 times as loud


# --- scenes


def test_it_costs_as_much_more_as_it_takes():
    costs = [cost_of(load_scene("bilge-pump", {"casing.rung": r})) for r in ("driven", "yielding")]
    assert 1.1 < costs[1] / costs[0] < 1.5


@pytest.mark.parametrize("mode", ["9 kHz", "17 kHz", "40 kHz"])
def test_the_default_step_follows_every_mode(mode):
    """One above 16 kHz turned by more than 2 rad a step, and ran away."""
    short = {**YIELDS, "duration": "0.4 s", "casing.modes.7.frequency": mode}
    usual, fine = (
        heard("bilge-pump", {**short, **step}).std(axis=1)
        for step in ({}, {"numerics.step": "4 us"})
    )
    assert_allclose(usual, fine, rtol=0.1)  # two revolutions of knocks; what ran away had no level


def test_a_guide_against_its_bearing_is_refused():
    """What is said of it is the gain: -0.06 of the bilge pump's guide turned round, times five."""
    modes = load_scene("bilge-pump").casing.modes
    turned = {
        f"casing.modes.{i}.shape.guide_y": -5 * m.shape["guide_y"] for i, m in enumerate(modes)
    }
    assert heard("bilge-pump", {**turned, "duration": "0.2 s"}).any()
    with pytest.raises(SceneError, match=r"by -0\.298 of it .* >= -0\.25 .*'driven'"):
        heard("bilge-pump", {**YIELDS, **turned, "duration": "0.2 s"})


@pytest.mark.parametrize("rung", ["driven", "yielding"])
def test_a_data_set_tells_every_rung_that_was_run(rung):
    scene = load_scene("bilge-pump", {"duration": "0.3 s", "casing.rung": rung})
    numerics = simulate(scene, seed=0).numerics
    columns = {f"rung_{effect.replace('crankpin', 'joint')}" for effect in scene.effects}
    columns.remove("rung_step")
    assert columns <= NUMERICS.keys()
    assert columns <= numerics.keys()
    assert numerics["rung_casing"] == rung
