"""A journal bearing from its scene to its recording: the source paper, Newton, probes, refusals."""

import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.datasets.recipe.severities import clearances
from wearstate.sim.bearing.equilibrium import equilibrium
from wearstate.sim.journal.recording import film_geometry, journal_scale
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.output.status import SimulationError, Status
from wearstate.sim.scene.journal import JournalScene
from wearstate.sim.scene.load import load_scene, override, scene_from_table, scene_table, scene_text
from wearstate.sim.scene.scene import SceneError, channels_of

PAPER = ("journal-step", "journal-rectangular-pulse", "journal-half-sine")
STEP_TIME = 0.16  # s, tau = 16 pi at 3000 rpm


def run(name="journal-step", changes=None, *, seed=1, **options):
    scene = load_scene(name, changes)
    return scene, simulate(scene, seed=seed, truth=True, **options)


def place(scene, solution):
    """Journal over the radial clearance."""
    return solution.truth["journal_m"] / scene.bearing.clearance_radial


@pytest.fixture(scope="module")
def paper():
    return {name: run(name) for name in PAPER}


def at_load(scene):
    """Last sample before the load comes."""
    return math.floor(STEP_TIME * scene.sample_rate) - 1


def test_an_order_of_the_load_peaks_where_its_phase_says():
    """In its own cycle, counted from the keyphasor mark; along its direction, beside the weight."""
    order = {"order": 3, "amplitude": "50 N", "angle": "90 deg", "phase": "30 deg"}
    changes = {"rotor.unbalance": 0, "load.orders": [order], "duration": 0.2}
    scene, solution = run("journal-bearing", {**changes, "drive.start_angle": "20 deg"})
    steady = scene.rotor.mass * scene.gravity + scene.load.static
    turned = 3 * solution.truth["state_angle"] - math.radians(30)
    expected = np.stack([np.full(len(turned), steady), 50 * np.cos(turned)], axis=1)
    assert_allclose(solution.truth["load_n"], expected, atol=1e-6 * steady)


# --- the source paper: Ma, Lu, Chen, J. Vib. Meas. Diagn. 30 (2010) 5-10


@pytest.mark.parametrize("name", PAPER)
def test_the_scenes_have_the_numbers_of_the_paper(name):
    scene = load_scene(name)
    scale = journal_scale(scene)
    beta = scene.gravity / (scale.clearance * scale.speed**2)
    # the dimensions of the scene are rounded to four digits and more
    assert_allclose([scale.alpha, beta], [0.83537, 0.3972], rtol=3e-4)
    assert_allclose(scene.load.amplitude / scale.force, 1, rtol=1e-4)
    reynolds = 880 * scale.speed * scene.bearing.diameter / 2 * scale.clearance
    assert_allclose(reynolds / scene.oil.viscosity, 206.5, rtol=1e-3)


def test_the_equilibria_of_the_paper(paper):
    scene, solution = paper["journal-step"]
    found = place(scene, solution)
    # the paper's mesh is not known: the contract of this program is 0.006
    assert_allclose(found[at_load(scene)], [0.1147, 0.3029], atol=0.006)
    assert_allclose(found[-1], [0.411, 0.4654], atol=0.006)
    # an independent solver with L/D = 2/3; it stood 2e-3 from the map of 72 x 17 nodes
    assert_allclose(found[at_load(scene)], [0.1192, 0.3006], atol=1e-3)
    assert_allclose(found[-1], [0.4121, 0.4607], atol=1e-3)


def test_the_pulse_of_the_paper(paper):
    scene, solution = paper["journal-rectangular-pulse"]
    before = at_load(scene)
    peak = solution.truth["peak_pressure_pa"][before:]
    along = solution.truth["film_force_n"][before:, 0]
    # the paper reads 4.6 and 3.9 off its figures: 2 per cent
    assert_allclose(peak.max() / peak[0], 4.6, rtol=0.02)
    assert_allclose(along.min() / along[0], 3.9, rtol=0.02)
    found = place(scene, solution)
    # 13 revolutions later; the journal loses half its way back in each
    assert_allclose(found[-1], found[before], atol=1e-3)


def test_a_half_sine_disturbs_less_than_a_rectangle(paper):
    largest = {}
    for name in PAPER[1:]:
        scene, solution = paper[name]
        found = place(scene, solution)
        away = found[at_load(scene) :] - found[at_load(scene)]
        largest[name] = np.hypot(*away.T).max()
    assert largest["journal-half-sine"] < 0.9 * largest["journal-rectangular-pulse"]


@pytest.mark.parametrize("name", PAPER)
def test_the_map_is_the_direct_film(paper, name):
    scene, solution = paper[name]
    direct, solved = run(name, {"film.rung": "direct"})
    assert_allclose(place(direct, solved), place(scene, solution), atol=1e-3)  # the contract


def test_the_papers_integrator_with_its_step_comes_to_the_same_orbit(paper):
    scene, solution = paper["journal-step"]
    euler = {"numerics.integrator": "euler", "numerics.step": 0.02 / (100 * math.pi)}
    _, stepped = run("journal-step", euler)
    # semi-implicit Euler is of first order: half a step of 0.02 at rates up to 0.5
    assert_allclose(place(scene, stepped), place(scene, solution), atol=0.01)


# --- Newton


@pytest.mark.parametrize("name", [*PAPER, "journal-unbalance"])
def test_film_force_and_load_accelerate_the_rotor(name):
    """In SI: mass times the change of velocity is the force between two samples."""
    scene, solution = run(name, {"numerics.tolerance": 1e-8})
    truth = solution.truth
    total = truth["film_force_n"] + truth["load_n"]
    change = scene.rotor.mass * np.diff(truth["journal_velocity_m_s"], axis=0) * scene.sample_rate
    middle = (total[:-1] + total[1:]) / 2
    jumps = np.abs(np.diff(truth["load_n"], axis=0)).max(axis=1) > 200
    weight = scene.rotor.mass * scene.gravity
    # trapezium rule: a twelfth of the second difference of the force, 73 N after the jump; and the
    # dense output of the integrator
    assert_allclose(change[~jumps], middle[~jumps], atol=4e-3 * weight)
    assert np.count_nonzero(jumps) <= 2
    velocity = (truth["journal_velocity_m_s"][:-1] + truth["journal_velocity_m_s"][1:]) / 2
    moved = np.diff(truth["journal_m"], axis=0) * scene.sample_rate
    # the same rule: velocities bend by 9e-5 m/s a sample where the pulse ends, of 0.019 m/s at most
    assert_allclose(moved, velocity, atol=1e-3 * np.abs(velocity).max())


def test_at_rest_the_film_carries_weight_and_load(paper):
    scene, solution = paper["journal-step"]
    expected = [-(scene.rotor.mass * scene.gravity + scene.load.amplitude), 0.0]
    # what the journal still moves after 14 revolutions
    assert_allclose(solution.truth["film_force_n"][-1], expected, atol=2e-3 * abs(expected[0]))


def test_a_load_across_turns_the_orbit_by_a_quarter():
    fine = {"gravity": 0.0, "numerics.tolerance": 1e-9}
    along, first = run(changes={**fine, "load.static": "2 kN"})
    across, second = run(changes={**fine, "load.static_across": "2 kN", "load.angle": "90 deg"})
    x, y = place(along, first).T
    # a map of a plain bore knows no direction; the integrator weighs its coordinates apart
    assert_allclose(place(across, second), np.column_stack([-y, x]), atol=1e-6)


def test_an_unbalance_makes_an_orbit_that_repeats_with_the_shaft():
    scene, solution = run("journal-unbalance")
    found = place(scene, solution)
    per_turn = round(scene.sample_rate / scene.drive.speed)
    # 20 revolutions after the start, at the tolerance of the integrator
    assert_allclose(found[-per_turn:], found[-2 * per_turn : -per_turn], atol=1e-4)
    assert np.ptp(found[-per_turn:, 0]) > 0.05
    # its force turns with the shaft: a whole turn of it adds nothing to the weight
    mean = solution.truth["load_n"][-per_turn:].mean(axis=0)
    weight = scene.rotor.mass * scene.gravity
    assert_allclose(mean, [weight, 0], atol=1e-6 * weight)
    swing = np.hypot(*(solution.truth["load_n"] - [weight, 0]).T)
    expected = scene.rotor.unbalance * (2 * math.pi * scene.drive.speed) ** 2
    assert_allclose(swing, expected, rtol=1e-9)


def test_the_mark_of_the_tacho_is_where_the_unbalance_is():
    """Far above any resonance nothing hides the phase: the force itself is looked at."""
    changes = {"rotor.unbalance_angle": "30 deg", "drive.start_angle": "50 deg"}
    scene, solution = run("journal-unbalance", changes)
    force = solution.truth["load_n"][0] - [scene.rotor.mass * scene.gravity, 0]
    assert math.degrees(math.atan2(force[1], force[0])) == pytest.approx(80, abs=1e-6)
    assert solution.truth["state_angle"][0] == pytest.approx(math.radians(50))


def test_whirl_grows_at_half_speed_and_dies_below_the_threshold():
    scene, solution = run("journal-whirl")
    found = place(scene, solution) @ np.array([1, 1j])
    per_turn = scene.sample_rate / scene.drive.speed
    late = found[-round(20 * per_turn) :]
    spectrum = np.abs(np.fft.fft((late - late.mean()) * np.hanning(len(late))))
    frequency = np.fft.fftfreq(len(late), per_turn**-1)
    assert np.abs(late - late.mean()).max() > 0.5
    assert 0.42 < frequency[np.argmax(spectrum)] < 0.5  # forward, a little below half
    scene, solution = run("journal-whirl", {"drive.speed": "4400 rpm", "duration": "1.5 s"})
    late = place(scene, solution)[-round(5 * per_turn) :]
    assert np.ptp(late, axis=0).max() < 1e-3


# --- probes


QUIET = {"sensors.0.noise": 0.0, "sensors.1.noise": 0.0, "rotor.run_out": [], "rotor.dents": []}


def bearing(changes=None, **options):
    return run("journal-bearing", {**QUIET, "duration": "0.1 s", **(changes or {})}, **options)


def converter_step(scene):
    return 2 * scene.sensors[0].range / 2**24


def test_a_probe_reads_the_motion_towards_it():
    scene, solution = bearing()
    for row, angle in enumerate(np.radians([225.0, 135.0])):
        direction = np.array([math.cos(angle), math.sin(angle)])
        expected = solution.truth["journal_m"] @ direction
        # the converter rounds, float32 holds 24 bit of up to 1e-4 m
        assert_allclose(solution.signal[row], expected, rtol=0, atol=0.6 * converter_step(scene))
    assert [c.quantity for c in solution.channels] == ["displacement", "displacement", "tacho"]
    assert [c.unit for c in solution.channels] == ["m", "m", "V"]
    assert solution.channels == channels_of(scene)


def test_gain_and_offset():
    _, plain = bearing()
    scene, changed = bearing({"sensors.0.gain": 1.05, "sensors.0.offset": "5 um"})
    expected = 1.05 * (plain.signal[0].astype(float) + 5e-6)
    assert_allclose(changed.signal[0], expected, atol=2 * converter_step(scene))
    assert_array_equal(changed.signal[1], plain.signal[1])


def test_run_out_comes_to_the_second_probe_first():
    """The track turns from the second probe to the first, 90 degrees apart."""
    part = [{"order": 3, "amplitude": "4 um", "phase": "20 deg"}]
    _, plain = bearing()
    scene, rough = bearing({"rotor.run_out": part})
    seen = rough.signal[:2].astype(float) - plain.signal[:2]
    angle = rough.truth["state_angle"]
    expected = [
        4e-6 * np.cos(3 * (angle - math.radians(at)) + math.radians(20)) for at in (225, 135)
    ]
    assert_allclose(seen, expected, rtol=0, atol=1.5 * converter_step(scene))


def test_a_dent_passes_the_second_probe_first_once_a_turn():
    """It lies 30 degrees behind the mark, 20 wide: half as deep a quarter of its width away."""
    dent = {"depth": "8 um", "width": "20 deg", "angle": "30 deg"}
    _, plain = bearing({"rotor.dents": []})
    scene, marked = bearing({"rotor.dents": [dent]})
    seen = marked.signal[:2].astype(float) - plain.signal[:2]
    angle = np.degrees(marked.truth["state_angle"])
    for row, probe in zip(seen, (225, 135), strict=True):
        away = np.abs((angle + 30 - probe + 180) % 360 - 180)
        assert_allclose(row[away > 10], 0, atol=1.5 * converter_step(scene))
        deep = np.interp(np.arange(0, 10.1, 2.5), away[np.argsort(away)], -row[np.argsort(away)])
        half = 4e-6
        expected = [2 * half, half * (1 + math.sqrt(0.5)), half, half * (1 - math.sqrt(0.5)), 0]
        assert_allclose(deep, expected, atol=0.15e-6)  # between samples 3.5 degrees apart


def test_noise_is_of_the_seed_alone():
    loud = {"sensors.0.noise": "1 um", "sensors.1.noise": "1 um"}
    (_, one), (_, same), (_, other) = (bearing(loud, seed=seed) for seed in (3, 3, 4))
    assert one.signal.tobytes() == same.signal.tobytes()
    added = one.signal.astype(float) - other.signal
    # difference of two independent noises; 512 samples know an rms to 3 %, of which 4
    assert_allclose(added[:2].std(axis=1), math.sqrt(2) * 1e-6, rtol=0.13)
    assert_array_equal(added[2], 0)
    assert_array_equal(one.truth["journal_m"], other.truth["journal_m"])


def test_hum_is_added_to_what_a_probe_reads():
    hum = {"sensors.1.mains": "2 um", "sensors.1.mains_frequency": "60 Hz", "duration": "0.5 s"}
    _, plain = bearing({"duration": "0.5 s"})
    _, humming = bearing(hum)
    added = humming.signal.astype(float) - plain.signal
    assert_array_equal(added[[0, 2]], 0)
    assert added[1].std() == pytest.approx(2e-6, rel=1e-3)  # 30 whole periods
    lines = np.abs(np.fft.rfft(added[1])) ** 2
    of_60_hz = lines[np.array([1, 2, 3, 5]) * 30].sum()
    assert of_60_hz == pytest.approx(lines.sum(), rel=1e-4)


def test_the_tacho_rises_at_whole_turns():
    scene, solution = bearing({"drive.start_angle": "90 deg"})
    pulse = solution.signal[2]
    rises = np.flatnonzero((pulse[1:] > 2.5) & (pulse[:-1] <= 2.5)) + 1
    per_turn = scene.sample_rate / scene.drive.speed
    # three quarters of a turn, then one each; a sample's pulse is the mean round it
    assert_allclose(rises, (np.arange(len(rises)) + 0.75) * per_turn, atol=1.0)
    assert len(rises) == 5


def test_a_probe_out_of_range_is_told():
    _, solution = bearing({"sensors.0.range": "5 um"})
    assert solution.numerics["clipped_samples"] > 0
    assert "clipped" in solution.warnings[0]


# --- wear


def test_more_clearance_lets_the_shaft_down():
    depth = []
    for clearance in ("0.1 mm", "0.2 mm", "0.3 mm"):
        _, solution = bearing({"bearing.diametral_clearance": clearance})
        depth.append(solution.truth["journal_m"].mean(axis=0)[0])
        assert_allclose(
            solution.numerics["min_film_m"], solution.truth["min_film_m"].min(), rtol=1e-12
        )
    assert depth[0] < depth[1] < depth[2]


SCAR = {"film.rung": "direct", "bearing.scar_depth": "0.02 mm"}


def test_a_scar_lets_the_shaft_down_where_it_is():
    plain, bare = bearing({"film.rung": "direct"})
    worn, scarred = bearing(SCAR)
    turned, aside = bearing({**SCAR, "bearing.scar_angle": "180 deg"})
    centre = [solution.truth["journal_m"].mean(axis=0)[0] for solution in (bare, scarred, aside)]
    assert centre[1] > centre[0] + 5e-6
    # above the shaft there is no pressure to lose: what is left is the film's start
    assert abs(centre[2] - centre[0]) < 0.2 * (centre[1] - centre[0])
    bore = film_geometry(worn).bore
    assert np.argmax(bore) == 0
    assert bore.max() == pytest.approx(20e-6 / 70e-6)
    assert np.argmax(film_geometry(turned).bore) == 36
    assert film_geometry(plain).bore is None


SHARE = {
    "film.rung": "direct",
    "bearing.diametral_clearance": "0.25 mm",
    "bearing.unworn_clearance": "0.1 mm",
    "bearing.scar_angle": "10 deg",
}


@pytest.mark.parametrize(
    ("share", "depth"),
    [
        (0.4, 20e-6),  # of a fifth of the clearance: the wear, 0.15 mm, is more
        (1.0, 50e-6),
    ],
)
def test_a_share_of_the_wear_is_a_scar_in_a_bore_so_much_narrower(share, depth):
    """The clearance is that across the scar: a scene of that bore and scar has the same orbit."""
    shared, one = bearing({**SHARE, "bearing.scar_share": share})
    round_bore = 0.25e-3 - depth
    told, other = bearing(
        {
            "film.rung": "direct",
            "bearing.diametral_clearance": round_bore,
            "bearing.scar_depth": depth,
            "bearing.scar_angle": "10 deg",
        }
    )
    assert shared.bearing.scar == pytest.approx(depth)
    assert shared.bearing.clearance_radial == pytest.approx(round_bore / 2)
    assert clearances(shared)["diametral_clearance_bearing_m"] == 0.25e-3
    assert_allclose(one.truth["journal_m"], other.truth["journal_m"], atol=1e-9)
    assert told.bearing.scar == depth


def test_a_starved_inlet_lets_the_shaft_down_towards_its_load():
    """The orbit lies about the equilibrium of its film; a full inlet changes nothing."""
    (full, ever), (_, same), (starved, low) = (
        bearing({"film.rung": "direct", **changes})
        for changes in ({}, {"bearing.inlet_fill": 1.0}, {"bearing.inlet_fill": 0.6})
    )
    assert_array_equal(ever.signal, same.signal)
    middle = place(starved, low).mean(axis=0)
    scale = journal_scale(starved)
    weight = starved.rotor.mass * starved.gravity + starved.load.static
    rest = equilibrium(film_geometry(starved), [weight / scale.force / scale.alpha, 0.0])
    assert_allclose(middle, rest.position, atol=5e-3)  # the mean of an orbit of a few per cent
    assert middle[0] > place(full, ever).mean(axis=0)[0] + 0.1


def test_a_new_bearing_has_no_scar():
    new = {"bearing.diametral_clearance": "0.1 mm", "bearing.scar_share": 1.0}
    scene = load_scene("journal-bearing", {**SHARE, **new})
    assert scene.bearing.scar == 0
    assert scene.bearing.clearance_radial == 50e-6


def test_the_thinnest_film_of_a_scar_is_inside_its_gap():
    scene, solution = bearing(SCAR)
    gap = solution.truth["min_film_m"]
    eccentric = np.hypot(*solution.truth["journal_m"].T)
    plain = scene.bearing.clearance_radial - eccentric
    assert np.all(gap > plain)
    assert np.all(gap < plain + scene.bearing.scar_depth)


def test_a_groove_at_the_load_costs_film():
    groove = [{"angle": "20 deg", "width": "20 deg", "pressure": "0.1 MPa"}]
    _, plain = bearing({"film.rung": "direct"})
    scene, grooved = bearing({"film.rung": "direct", "bearing.grooves": groove})
    assert grooved.numerics["min_film_m"] < 0.9 * plain.numerics["min_film_m"]
    [fed] = film_geometry(scene).grooves
    assert fed.pressure == pytest.approx(1e5 / journal_scale(scene).pressure)


# --- loads from a file


def test_a_recorded_load_is_the_history_it_describes(tmp_path, paper):
    scene = load_scene("journal-rectangular-pulse")
    amplitude = scene.load.amplitude
    times, sizes = [0.16, 0.16, 0.18, 0.18], [0, amplitude, amplitude, 0]
    lines = [f"{time},{size},0" for time, size in zip(times, sizes, strict=True)]
    (tmp_path / "pulse.csv").write_text("\n".join(["# s, N, N", *lines]))
    text = scene_text("journal-rectangular-pulse").replace('"rectangular"', '"file"')
    text = text.replace("[load]\n", '[load]\nrecord = { file = "pulse.csv" }\n')
    file = tmp_path / "mine.toml"
    file.write_text(text)
    recorded = load_scene(file)
    solution = simulate(recorded, seed=1, truth=True)
    known, expected = paper["journal-rectangular-pulse"]
    # the same instants, but for the rounding of 0.16 + 0.02
    assert_allclose(place(recorded, solution), place(known, expected), atol=1e-6)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "is no CSV of numbers"),
        ("0,1\n1,2\n", "must hold three columns"),
        ("1,0,0\n0,0,0\n", "rising time"),
        ("a,b,c\n", "is no CSV of numbers"),
        ("0,nan,0\n", "all finite"),
    ],
)
def test_a_load_record_at_fault(tmp_path, content, says):
    file = tmp_path / "load.csv"
    if content is not None:
        file.write_text(content)
    record = {"load.history": "file", "load.record": {"file": str(file)}, "load.amplitude": 0.0}
    with pytest.raises(SceneError, match=says):
        check(load_scene("journal-step", record))


# --- where it fails


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"load.amplitude": "2 MN"}, Status.OVERLOAD),
        (
            {
                "load.amplitude": "0.2 MN",
                "numerics.integrator": "euler",
                "numerics.step": "1 ms",
            },
            Status.SQUEEZE,
        ),
    ],
)
def test_failures_have_a_status_with_a_cure(changes, status):
    scene = load_scene("journal-step", changes)
    with pytest.raises(SimulationError, match=status.name.lower()):
        simulate(scene, seed=1)
    failed = simulate(scene, seed=1, raise_on_failure=False)
    assert failed.status is status
    assert not failed.signal.any()
    assert failed.signal.shape == (3, round(scene.duration * scene.sample_rate))


def test_a_wall_takes_what_no_film_carries():
    wall = {"stiffness": "1000 MN/m", "damping": "100 kN s/m", "friction": 0.1}
    scene, solution = run(changes={"load.amplitude": "2 MN", "bearing.wall": wall})
    sunk = np.hypot(*place(scene, solution)[-1]) - 1
    # the film at its last eccentricity carries the greater part, the wall the rest
    assert -0.006 < sunk < 2e6 / 1e9 / scene.bearing.clearance_radial


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"duration": "0.01 s"}, "must be >= one revolution"),
        ({"sample_rate": "300 Hz"}, "8 samples a revolution"),
        ({"tacho.pulse_width": "0.1 deg"}, "must last >= 2 samples"),
        ({"sample_rate": "1 MHz", "duration": "1000 s"}, "GB, must be <= 4 GB"),
    ],
)
def test_a_plan_that_cannot_be_kept(changes, says):
    with pytest.raises(SceneError, match=says):
        check(load_scene("journal-step", changes))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"bearing.radial_clearance": "8 mm"}, "a tenth of the bore"),
        ({"bearing.scar_depth": "0.3 mm"}, "must be < the radial clearance"),
        ({"bearing.scar_depth": "0.1 mm"}, "film.rung = 'map' needs a plain bore"),
        ({"bearing.scar_share": 0.5}, "scar_share = 0.5 needs unworn_clearance"),
        (
            {"bearing.scar_share": 0.5, "bearing.unworn_clearance": "0.1 mm"},
            "scar_share; set film.rung = 'direct'",
        ),
        ({"bearing.inlet_fill": 0.5}, "inlet_fill; set film.rung = 'direct'"),
        ({"bearing.inlet_fill": 0.0}, "inlet_fill"),
        (
            {"bearing.inlet_fill": 0.5, "film.rung": "direct", "film.condition": "guembel"},
            "must be 1 with film.condition = 'guembel'",
        ),
        (
            {
                "bearing.inlet_fill": 0.5,
                "film.rung": "direct",
                "bearing.grooves": [{"angle": 0.0, "width": 0.1}],
            },
            "must be 1 with grooves",
        ),
        ({"film.n_z": 16}, "must be odd"),
        ({"start.x": 0.9, "start.y": 0.9}, "eccentricity = 1.27279 must be < 1"),
        ({"load.history": "half-sine"}, "length is missing"),
        ({"load.history": "none"}, "needs a history"),
        ({"load.history": "file"}, "record is missing"),
        ({"sensors.1.name": "probe_1"}, "is given 2 times"),
        ({"oil.viscosity": "30 mm"}, "has unit 'mm', not one of viscosity"),
        ({"bearing.diametral_clearence": 1e-4}, "did you mean 'diametral_clearance'"),
        ({"wear": {"as_new_diametral": 1}}, "condemning_diametral is missing"),
        (
            {
                "wear_scar": {
                    "as_new": 2e-5,
                    "condemning": 3e-5,
                    "grade_edges": [1e-5, 2e-5, 3e-5],
                    "source": "x",
                }
            },
            "must rise strictly",
        ),
    ],
)
def test_impossible_bearings(changes, says):
    with pytest.raises(SceneError, match=says):
        load_scene("journal-step", changes)


def test_exactly_one_clearance():
    table = scene_table(scene_text("journal-step"))
    table["bearing"]["diametral_clearance"] = 5e-4
    with pytest.raises(SceneError, match="radial_clearance given, must be exactly one of"):
        scene_from_table(table)
    one = load_scene("journal-step", {"bearing.diametral_clearance": "0.50032 mm"})
    assert one.bearing.radial_clearance is None
    assert one.bearing.clearance_radial == load_scene("journal-step").bearing.clearance_radial


def test_a_scene_survives_its_dump():
    scene = load_scene("journal-bearing")
    assert JournalScene.model_validate_json(scene.model_dump_json()) == scene


def test_oil_by_its_temperature():
    """ISO VG 32 of a data sheet: 32 mm^2/s at 40 and 5.4 mm^2/s at 100 degrees Celsius."""
    sheet = {
        "oil.viscosity_40": "32 mm^2/s",
        "oil.viscosity_100": "5.4 mm^2/s",
        "oil.density": "850 kg/m^3",
    }
    table = scene_table(scene_text("journal-step"))
    del table["oil"]
    warm = scene_from_table(override(table, {**sheet, "oil.temperature": 313.15}))
    # the law passes through its points
    assert_allclose(warm.oil.dynamic_viscosity, 850 * 32e-6, rtol=1e-9)
    hot = scene_from_table(override(table, {**sheet, "oil.temperature": "373.15 K"}))
    assert_allclose(hot.oil.dynamic_viscosity, 850 * 5.4e-6, rtol=1e-9)
    assert_allclose(journal_scale(warm).alpha / journal_scale(hot).alpha, 32 / 5.4, rtol=1e-9)


@pytest.mark.parametrize(
    ("oil", "says"),
    [
        ({}, "viscosity is missing; add it, or temperature, viscosity_40, viscosity_100, density"),
        ({"viscosity": 0.02, "temperature": 320}, "must be one or the other; remove one"),
        ({"temperature": 320, "density": 850}, "add it, or viscosity_40, viscosity_100"),
        (
            {"temperature": 320, "density": 850, "viscosity_40": 3e-5, "viscosity_100": 3e-1},
            "viscosity_100 = 0.3 m^2/s must be <=",
        ),
    ],
)
def test_oil_half_described_is_refused(oil, says):
    table = {**scene_table(scene_text("journal-step")), "oil": oil}
    with pytest.raises(SceneError, match=re.escape(says)):
        scene_from_table(table)
