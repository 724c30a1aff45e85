"""Transfer functions of a scene, the command that writes them, and hammer tests of casings."""

import json
from functools import partial

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.severities import wear_limits
from wearstate.diagnose.command_line.cli import cli
from wearstate.features.response.frf import block_spectra, estimate_frf, find_blows, force_window
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.machine.transfer import scene_transfer
from wearstate.sim.parts.casing import Feet
from wearstate.sim.pump.gathering import casing_modes
from wearstate.sim.scene.load import load_scene, scene_text
from wearstate.sim.scene.scene import SceneError

from .command_line import run as command

FS = 25_600.0
TESTED = {
    "running": False,
    "exciters.0.force": "500 N",
    "exciters.0.double_hits": 0,
    "exciters.0.repeats": 20,
    "duration": "10 s",
    **{f"sensors.{i}.noise": "0.02 m/s^2" for i in range(2)},  # nothing else runs
}
FEET = {"casing.feet.bolt_stretch": "0.2 mm"}


run = partial(command, "frf")


def measured(scene, seed=1):
    """H1 of a recorded hammer test by blows of 0.4 s."""
    solution = simulate(scene, seed=seed)
    kinds = np.array([channel.quantity for channel in solution.channels])
    force = solution.signal[kinds == "force"][0].astype(float)
    response = solution.signal[kinds == "acceleration"].astype(float)
    n, rate = round(0.4 * scene.sample_rate), scene.sample_rate
    blows = find_blows(force, rate, nperseg=n, pretrigger=40)
    assert not blows.rejected
    window = force_window(n, rate, end=2e-3 + 40 / rate, fall=1e-3)
    spectra = block_spectra(blows.cut(force), blows.cut(response), rate, force_window=window)
    return solution, estimate_frf(spectra.between(60.0, 2500.0))


def test_a_hammer_test_at_rest_measures_the_casings_transfer_function():
    scene = load_scene("bilge-pump", TESTED)
    solution, frf = measured(scene)
    found = scene_transfer(scene, frf.frequency)
    true = found.values[:, found.places.index("guide_y")]
    sure = frf.coherence > 0.9
    assert sure.mean() > 0.8
    held = np.abs(frf.value - true)[sure] <= frf.radius[sure]
    # of some 1,600 lines alike one in twenty may lie outside; antiresonances with the least
    # response have the most leakage of the block's edge
    assert held.mean() > 0.85
    # what is left at a block's edge, and noise
    assert np.median(np.abs(frf.value / true - 1)[sure]) < 0.01
    assert solution.numerics["mean_speed_hz"] == 0
    assert not solution.signal[-1].any()  # no tacho pulse


def test_at_rest_nothing_moves_between_the_blows():
    quiet = {f"sensors.{i}.noise": 0.0 for i in range(2)} | {"exciters.0.noise": 0.0}
    solution = simulate(load_scene("bilge-pump", TESTED | quiet), seed=3)
    first = int(np.flatnonzero(np.abs(solution.signal[2]) > 1)[0])
    # before the first blow the filters' ripple of 80 dB below the blow, and a converter's step
    assert np.abs(solution.signal[:2, : first - 200]).max() < 1e-3


def test_a_running_pump_is_shaken_too():
    values = {
        "exciters.0.kind": "random",
        "exciters.0.force": "50 N",
        "exciters.0.low": "50 Hz",
        "exciters.0.high": "2 kHz",
        "duration": "0.5 s",
    }
    bare = simulate(load_scene("bilge-pump", {"duration": "0.5 s"}), seed=4, truth=True)
    shaken = simulate(load_scene("bilge-pump", values), seed=4, truth=True)
    added = shaken.signal[:2].astype(float) - bare.signal[:2]
    true = scene_transfer(load_scene("bilge-pump"), np.linspace(51.0, 1999.0, 3000))
    power = np.mean(np.abs(true.values[:, true.places.index("guide_y")]) ** 2, axis=-1)
    # 0.5 s x 1950 Hz x 2 = 2,000 values, but most power is in a few resonances: some 15 %
    assert_allclose(np.std(added, axis=1), 50 * np.sqrt(power), rtol=0.4)
    assert_array_equal(shaken.signal[-1], bare.signal[-1])
    assert_allclose(shaken.signal[2], shaken.truth["test_force_n"][:, 0], atol=0.5)


def test_without_force_a_pump_is_as_it_was():
    scene = load_scene("bilge-pump", {"duration": "0.3 s"})
    bare = load_scene("bilge-pump", {"duration": "0.3 s", "exciters": []})
    signals = [simulate(each, seed=5).signal.tobytes() for each in (scene, bare)]
    assert scene.exciters
    assert signals[0] == signals[1]


def test_a_sensor_can_be_pushed():
    scene = load_scene("bilge-pump", TESTED | {"exciters.0.place": "acc_x"})
    _, frf = measured(scene)
    found = scene_transfer(scene, frf.frequency)
    true = found.values[0, found.places.index("acc_x")]  # of a driving point
    assert (true.imag > 0).all()
    sure = frf.coherence[0] > 0.9
    assert np.median(np.abs(frf.value[0] / true - 1)[sure]) < 0.02


# --- feet


def test_feet_lose_stiffness_with_their_load():
    tight, loose = Feet(bolt_stretch=2e-4), Feet(bolt_stretch=2e-4, stretch_lost=1e-4)
    assert tight.stiffness_ratio == 1
    # half of the load is left: the contact's flexibility, a fifth of all, doubles
    assert_allclose(loose.stiffness_ratio, 1 / 1.2)
    nothing_left = Feet(bolt_stretch=2e-4, stretch_lost=(1 - 1e-9) * 2e-4)
    assert nothing_left.stiffness_ratio < 1e-8


def test_loose_feet_lower_the_modes_by_their_share_and_keep_their_dashpots():
    lost = load_scene("bilge-pump", FEET | {"casing.feet.stretch_lost": "0.15 mm"})
    tight = load_scene("bilge-pump", FEET)
    one, other = (casing_modes(scene, ("guide_y",)) for scene in (tight, lost))
    share = np.array([mode.foot_share for mode in tight.casing.modes])
    ratio = lost.casing.feet.stiffness_ratio
    assert_allclose((other.frequency / one.frequency) ** 2, 1 - share * (1 - ratio))
    assert_allclose(other.damping_ratio * other.frequency, one.damping_ratio * one.frequency)
    bare = casing_modes(load_scene("bilge-pump"), ("guide_y",))
    assert_array_equal(one.frequency, bare.frequency)


def test_the_rocking_mode_of_a_loose_pump_is_found_lower_by_a_test():
    found = []
    for lost in ("0 mm", "0.15 mm"):
        scene = load_scene("bilge-pump", TESTED | FEET | {"casing.feet.stretch_lost": lost})
        _, frf = measured(scene)
        band = (frf.frequency > 80) & (frf.frequency < 200)
        found.append(frf.frequency[band][np.abs(frf.value[1, band]).argmax()])
    # 142 Hz, lower by sqrt(1 - 0.7 (1 - 1 / 1.6)) = 0.859; lines are 2.5 Hz apart
    assert_allclose(found, [142, 122], atol=2.6)


def test_a_test_at_rest_is_recorded_and_drawn_by_the_command(tmp_path):
    made, picture = tmp_path / "t.h5", tmp_path / "t.svg"
    values = ("running=false", "exciters.0.force=500 N", "exciters.0.repeats=2", "duration=1 s")
    sets = [text for value in values for text in ("--set", value)]
    arguments = ["simulate", "bilge-pump", *sets, "-o", str(made), "--plot", str(picture)]
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    assert "Force of the test" in picture.read_text()
    with DataSet(made) as data:
        force = data.attributes.channels[2]
        assert data.manifest["speed_hz"][0] == 0
    told = (force.unit, force.quantity, force.place)
    assert told == ("N", "force", "casing at guide_y")


# --- the command


def test_the_command_writes_what_a_scene_can_read(tmp_path):
    table, picture = tmp_path / "frf.csv", tmp_path / "frf.svg"
    told = run("bilge-pump", "-o", table, "--plot", picture, "--low", 20).stdout
    assert "acc_x/bearing_x" in told
    assert str(picture) in told
    assert "simulated" in picture.read_text()
    scene = tmp_path / "mine.toml"
    head = scene_text("bilge-pump").partition("[[casing.modes]]")[0]
    sensors = scene_text("bilge-pump").partition("[[sensors]]")[1:]
    scene.write_text(f'{head}[casing.frf]\nfile = "frf.csv"\n{"".join(sensors)}')
    again = scene_transfer(load_scene(scene), np.array([100.0, 5000.0]))
    found = scene_transfer(load_scene("bilge-pump"), again.frequency)
    assert again.places == tuple(f"{place}_1" for place in found.places)
    assert_allclose(again.values, found.values, rtol=1e-6, atol=1e-9)


def test_the_command_tells_peaks_as_json(tmp_path):
    found = json.loads(run("shaft-rig", "--high", 450, "--json").stdout)
    peaks = found["peaks"]["acc_forward/forward_up"]
    assert 200 < peaks[0]["frequency_hz"] < 330
    assert found["high_hz"] == 450
    error = run("journal-bearing", code=2).stderr
    assert "machine = 'journal-bearing' has no transfer function" in error
    error = run("bilge-pump", "--low", 20_000, code=2).stderr
    assert "low = 20000 Hz and high = 11520 Hz must be 0 < low < high" in error
    path = tmp_path / "a.csv"
    path.write_text("")
    assert "use --force" in run("bilge-pump", "-o", path, code=2).stderr


# --- faults


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ({"running": False}, "running = false needs an exciter with force > 0"),
        (TESTED | {"fidelity": "auto"}, "fidelity = 'auto' must be 'given' with running = false"),
        (TESTED | {"exciters.0.place": "guide_z"}, "exciters.0.place = 'guide_z' is no place"),
        (TESTED | {"exciters.0.angle_scatter": 0.1}, "angle_scatter = 0.1 rad must be 0"),
        (TESTED | {"exciters.0.contact_time": "1 us"}, "must be >= 7.8125e-05 s, two samples"),
        (TESTED | {"exciters.0.name": "acc_x"}, "name 'acc_x' is given 2 times"),
        (FEET | {"casing.feet.stretch_lost": "0.2 mm"}, "must be < bolt_stretch = 0.0002 m"),
        (
            FEET | {f"casing.modes.{i}.foot_share": 0 for i in range(8)},
            "feet needs modes of which one has foot_share > 0",
        ),
    ],
)
def test_faults_are_told(values, fault):
    with pytest.raises(SceneError) as caught:
        check(load_scene("bilge-pump", values))
    assert fault in str(caught.value)


# --- recipes


def test_the_recipe_labels_loose_feet_and_a_crank_at_rest():
    recipe = load_recipe("bilge-pump-casing-small")
    limits = wear_limits(recipe.scene, recipe.severity_columns[0])
    assert recipe.severity_columns == ("stretch_lost_feet_m",)
    for sample in sample_records(recipe, 20, seed=1):
        lost = sample.scene.casing.feet.stretch_lost
        assert sample.row["stretch_lost_feet_m"] == lost
        assert sample.row["grade"] == np.searchsorted(limits.grade_edges, lost, side="right")
        assert sample.row["speed_hz"] == 0
