"""Records side by side: the bytes of each alone, whatever lies beside it."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.sim.machine.simulate import simulate, simulate_many, simulates_together
from wearstate.sim.output.status import Status
from wearstate.sim.pump.gathering import GATHERED_TRUTH
from wearstate.sim.pump.run_plan import planned
from wearstate.sim.pump_lanes.lane_layout import DRY, MAPPED_FILM, SHORT_FILM
from wearstate.sim.pump_lanes.lanes import lane_kind, run_lanes
from wearstate.sim.pump_lanes.many import lane_job
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

SHORT = {"duration": "0.3 s"}
N = 40  # of the standard set's unknowns: contact laws, chamber, play, motor, all of them drawn


@pytest.fixture(scope="module")
def drawn():
    recipe = load_recipe("bilge-pump-standard", SHORT)
    samples = sample_records(recipe, N, seed=16, skip=np.zeros(N, bool))
    return [(sample.scene, sample.seed) for sample in samples]


@pytest.fixture(scope="module")
def alone(drawn):
    return [simulate(scene, seed=seed, raise_on_failure=False) for scene, seed in drawn]


def same(one, other):
    return (
        one.status == other.status
        and np.array_equal(one.signal, other.signal)
        and one.numerics == other.numerics
        and one.warnings == other.warnings
    )


def test_the_drawn_records_are_of_every_kind(drawn):
    """Else the tests below would compare less than they say."""
    kinds = {lane_kind(scene) for scene, _ in drawn}
    plays = {(kind.wrist, kind.guide, kind.chambers) for kind in kinds}
    assert plays == set(product((False, True), repeat=3))
    assert {(kind.throws, kind.oil) for kind in kinds} == {(1, DRY)}
    assert {kind.yields for kind in kinds} == {False, True}
    pins = [scene.joint.crankpin for scene, _ in drawn]
    assert {"kelvin-voigt", "hunt-crossley", "exact"} <= {pin.law for pin in pins}
    assert {pin.elasticity for pin in pins} >= {"linear", "hertz"}
    assert {scene.drive.rung for scene, _ in drawn} == {"constant-speed", "motor"}


def test_bytes_are_those_of_each_alone(drawn, alone):
    found = dict(simulate_many(drawn))
    assert [n for n in range(N) if not same(found[n], alone[n])] == []


def test_the_truth_of_lanes_is_that_of_each_alone(drawn):
    some = [drawn[n] for n in range(0, N, 2)]
    found = dict(simulate_many(some, truth=GATHERED_TRUTH))
    for n, (scene, seed) in enumerate(some):
        own = simulate(scene, seed=seed, truth=True, raise_on_failure=False)
        assert same(found[n], own)
        if own.status.ok:
            assert set(found[n].truth) == set(GATHERED_TRUTH)  # in a lane, not alone
            assert all(np.array_equal(found[n].truth[k], own.truth[k]) for k in GATHERED_TRUTH)


def test_truth_that_lanes_do_not_know_comes_of_a_record_alone():
    jobs = [(load_scene("bilge-pump", SHORT), seed) for seed in range(6)]
    found = dict(simulate_many(jobs, truth=("wrist_force_n",)))
    own = simulate(*jobs[5][:1], seed=5, truth=True).truth
    assert np.array_equal(found[5].truth["wrist_force_n"], own["wrist_force_n"])


@pytest.mark.parametrize("some", [slice(0, 7), slice(5, 22), slice(None, None, -1)])
def test_neighbours_number_and_place_change_no_byte(drawn, alone, some):
    found = dict(simulate_many(drawn[some]))
    assert [n for n, one in enumerate(alone[some]) if not same(found[n], one)] == []


@pytest.mark.parametrize(
    "changes",
    [
        {"pressure.rung": "constant"},
        {"pressure.rung": "none"},
        {
            "joint.crankpin.elasticity": "conformal",
            "joint.crankpin.effective_modulus": "60 GPa",
            "joint.crankpin.contact_length": "50 mm",
        },
        {"joint.wristpin.rung": "compliant", "joint.guide.rung": "compliant"},
        {"crank.unbalance": "0.1 kg m"},
        {"joint.crankpin.one_sided": 0.8, "joint.crankpin.diametral_clearance": "0.3 mm"},
        {"piston.seal_friction": "80 N", "piston.seal_friction_share": 0.02},
        {
            "joint.crankpin.law": "exact",
            "joint.crankpin.damping": 0.0,
            "joint.crankpin.restitution": 0.3,
            "joint.crankpin.restitution_speed": "0.3 m/s",
        },
        {"exciters.0.force": "500 N"},
        {"pressure.rung": "chamber", "pressure.suction": "-80 kPa"},  # some vapour
        {"pressure.rung": "chamber", "pressure.suction_valve.stuck_lift": "2 mm"},  # much of it
        {"pressure.rung": "chamber", "pressure.liquid.air_fraction": 0.0},
        {
            "pressure.rung": "chamber",
            "pressure.suction_valve.seat_stiffness": "300 MN/m",
        },  # substeps
    ],
)
def test_rungs_that_the_standard_set_does_not_draw(changes):
    jobs = [(load_scene("bilge-pump", {"duration": "0.5 s"} | changes), n) for n in range(6)]
    assert lane_kind(jobs[0][0]) is not None
    found = dict(simulate_many(jobs))
    assert all(same(found[n], simulate(scene, seed=seed)) for n, (scene, seed) in enumerate(jobs))


@pytest.mark.parametrize(
    "changes",
    [
        {},  # chambers
        {"drive.rung": "motor", "joint.wristpin.rung": "compliant"},
        {"pressure.rung": "two-level", "drive.rung": "motor", "throws.1.phase": "90 deg"},
        {"throws.2": {"joint": {"crankpin": {"diametral_clearance": "0.2 mm"}}}},
        {"throws": [{"phase": "0 deg"}, {"phase": "110 deg"}], "pressure.suction": "-80 kPa"},
        {"throws": [{"phase": f"{72 * n} deg"} for n in range(5)], "pressure.rung": "two-level"},
    ],
)
def test_throws_lie_in_lanes_beside_each_other(changes):
    settings = {"duration": "0.15 s", "settling_revolutions": 1, "casing.modes": _MODES} | changes
    jobs = [
        (load_scene("triplex-pump", settings | {"drive.speed": f"{440 + 3 * n} rpm"}), n)
        for n in range(9)
    ]
    throws = len(jobs[0][0].throws)
    assert lane_kind(jobs[0][0]).throws == throws > 1
    assert lane_kind(jobs[0][0]).records < len(jobs)
    found = dict(simulate_many(jobs))
    for n, (scene, seed) in enumerate(jobs):
        own = simulate(scene, seed=seed, raise_on_failure=False)
        assert same(found[n], own)
        assert own.status.ok
        assert own.numerics["contact_changes"] > 9  # steps are cut for all throws at once


_PLACES = (
    *("bearing_x", "bearing_y", "guide_y", "cylinder_x", "suction_valve", "discharge_valve"),
    *("head_x", "head_y", "head_z", "frame_y"),
)
_MODES = [  # the scene's name three throws
    {"frequency": "640 Hz", "damping_ratio": 0.02, "shape": dict.fromkeys(_PLACES, 0.05)}
]


@pytest.fixture(scope="module")
def oiled():
    recipe = load_recipe("bilge-pump-lubricated", SHORT)
    samples = sample_records(recipe, N, seed=2, skip=np.zeros(N, bool))
    return [(sample.scene, sample.seed) for sample in samples]


def test_pins_in_oil_have_the_bytes_of_each_alone(oiled):
    """Starved films with touching peaks, flooded ones on a map; with chambers and with play."""
    kinds = {lane_kind(scene) for scene, _ in oiled} - {None}  # in casings that yield: alone
    assert {kind.oil for kind in kinds} == {SHORT_FILM, MAPPED_FILM}
    assert {kind.chambers for kind in kinds} == {kind.guide for kind in kinds} == {False, True}
    found = dict(simulate_many(oiled))
    own = [simulate(scene, seed=seed, raise_on_failure=False) for scene, seed in oiled]
    assert [n for n in range(N) if not same(found[n], own[n])] == []
    assert max(one.numerics.get("rubbing_share", 0.0) for one in own) > 0.005
    assert all(one.numerics["min_film_m"] > 0 for one in own if one.status.ok)
    some = dict(simulate_many(oiled[3:16], truth=GATHERED_TRUTH))
    assert all(same(some[n], own[3 + n]) for n in range(13))


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("bilge-pump", {"joint.crankpin.rung": "film-short"}),
        ("bilge-pump", {"joint.crankpin.rung": "film-short", "drive.rung": "motor"}),
        ("bilge-pump", {"joint.crankpin.rung": "mixed"}),  # peaks under a film on a map
        ("triplex-pump", {"joint.crankpin.rung": "mixed", "joint.crankpin.oil.filled_gap": "9 um"}),
    ],
)
def test_films_that_the_set_does_not_draw(name, changes):
    oil = {"viscosity": "0.06 Pa s", "length": "40 mm"}
    oil |= {"roughness": "0.6 um"} if changes["joint.crankpin.rung"] == "mixed" else {}
    settings = {f"joint.crankpin.oil.{key}": value for key, value in oil.items()} | changes
    settings |= {"duration": "0.3 s", "settling_revolutions": 1}
    jobs = [(load_scene(name, settings), n) for n in range(6)]
    assert lane_kind(jobs[0][0]).oil != DRY
    found = dict(simulate_many(jobs))
    own = simulate(jobs[5][0], seed=5)
    assert same(found[5], own)
    assert own.numerics["min_film_m"] > 0


def test_truth_of_several_throws():
    settings = {"duration": "0.15 s", "settling_revolutions": 1}
    jobs = [(load_scene("triplex-pump", settings), n) for n in range(3)]
    found = dict(simulate_many(jobs, truth=GATHERED_TRUTH))
    own = simulate(jobs[2][0], seed=2, truth=True).truth
    names = set(found[2].truth)
    assert names == {name for name in own if name.startswith(GATHERED_TRUTH)} - _STATES
    assert "pin_force_n_3" in names
    assert all(np.array_equal(found[2].truth[name], own[name]) for name in names)


_STATES = {"state_alpha_rate"}


def test_throws_that_differ_in_what_lanes_must_know_run_alone():
    """Some breathe, some do not; one has a link."""
    own = load_scene("triplex-pump", {"throws.1.pressure": {"rung": "two-level"}})
    assert lane_kind(own) is None
    link = {"throws.1.joint": {"crankpin": {"rung": "link"}}}
    assert lane_kind(load_scene("triplex-pump", link)) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"pressure.rung": "heads", "pressure.flow": "two-harmonic"},
        {"joint.crankpin.rung": "link"},
        {"joint.crankpin.rung": "ideal"},
        {
            "joint.wristpin.rung": "film-short",
            "joint.wristpin.oil": {"viscosity": "0.06 Pa s", "length": "40 mm"},
        },
        {"exciters.0.force": "500 N", "running": False},
    ],
)
def test_what_lanes_do_not_know_runs_alone(changes):
    jobs = [(load_scene("bilge-pump", {"duration": "0.5 s"} | changes), 1)] * 6
    found = dict(simulate_many(jobs))
    assert len(found) == 6
    assert same(found[3], simulate(*jobs[0][:1], seed=1))


@pytest.mark.parametrize("stiffness", ["2 MN/m", "0.2 MN/m"])
def test_a_refused_and_a_failed_scene_leave_the_others_alone(stiffness):
    good = [(load_scene("bilge-pump", SHORT), seed) for seed in range(6)]
    refused = load_scene("bilge-pump", {"duration": "0.1 s"})  # less than a revolution
    soft = load_scene("bilge-pump", SHORT | {"joint.crankpin.stiffness": stiffness})
    found = dict(simulate_many([*good[:3], (refused, 0), (soft, 0), *good[3:]]))
    assert isinstance(found[3], SceneError)
    assert found[4].status == simulate(soft, seed=0, raise_on_failure=False).status
    assert not found[4].status.ok
    assert same(found[7], simulate(good[5][0], seed=5))


class Kept(list):
    """Forces of a run, stretch by stretch."""

    def add(self, turns, forces, chambers, gaps):
        assert turns.shape == (forces.shape[1] + 1, 2)
        assert chambers is gaps is None
        self.append(forces.copy())


def forces_of(jobs, kind):
    """Status and forces of every run side by side [shape=(n_kept, n_steps)]."""
    kept = [Kept() for _ in jobs]
    ended = dict(run_lanes(jobs, kind, lambda n: kept[n]))
    found = {n: (run.status, np.hstack(kept[n])) for n, run in ended.items()}
    assert all(forces.shape[1] == ended[n].steps for n, (_, forces) in found.items())
    return found


@pytest.mark.parametrize(
    ("name", "settings", "throw"),
    [
        ("bilge-pump", SHORT, 0),
        ("triplex-pump", {"duration": "0.15 s", "pressure.rung": "two-level"}, 0),
        ("triplex-pump", {"duration": "0.15 s", "pressure.rung": "two-level"}, 1),
    ],
)
def test_a_run_that_fails_on_its_way_is_left_behind(name, settings, throw):
    """The state of a throw is no number from the start; its neighbours end as ever."""
    rpm = load_scene(name).drive.speed * 60
    scenes = [load_scene(name, settings | {"drive.speed": f"{rpm + n} rpm"}) for n in range(20)]
    jobs = [lane_job(planned(scene)) for scene in scenes]
    kind = lane_kind(scenes[0])
    whole = forces_of(jobs, kind)
    bodies = jobs[4].start.bodies.copy()
    bodies[throw] = np.nan
    jobs[4] = replace(jobs[4], start=jobs[4].start._replace(bodies=bodies))
    found = forces_of(jobs, kind)
    assert found[4][0] == Status(1)
    assert found[4][1].shape[1] == 1
    others = [n for n in range(20) if n != 4]
    assert all(found[n][0].ok and np.array_equal(found[n][1], whole[n][1]) for n in others)


def test_machines_without_lanes_are_simulated_one_by_one():
    scene = load_scene("propulsion-shaft", {"duration": "0.4 s"})
    assert not simulates_together(scene)
    found = dict(simulate_many([(scene, 1), (scene, 2)]))
    assert np.array_equal(found[1].signal, simulate(scene, seed=2).signal)


def test_a_data_set_has_the_bytes_of_its_records_alone(tmp_path):
    """With truth every record runs alone; without, those of a batch run side by side."""
    recipe = load_recipe("bilge-pump-small", SHORT)
    for name, settings in {
        "lanes": {"jobs": 1},
        "two": {"jobs": 2},
        "truth": {"truth": True},
    }.items():
        generate(recipe, 14, tmp_path / f"{name}.h5", seed=3, **settings)
    import h5py

    with (
        h5py.File(tmp_path / "lanes.h5") as lanes,
        h5py.File(tmp_path / "two.h5") as two,
        h5py.File(tmp_path / "truth.h5") as truth,
    ):
        for other in (two, truth):
            assert np.array_equal(lanes["signal"][:], other["signal"][:])
            assert lanes["manifest"][:].tobytes() == other["manifest"][:].tobytes()
