"""A twin of one machine: what is drawn from it, what the inversion tells, what it refuses."""

import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import wearstate
from scipy.special import ndtri
from wearstate.datasets.draws.twin import Twin, TwinTable, coordinate_names, machine_values
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.text import RecipeError, toml_text
from wearstate.diagnose.twin import opinion
from wearstate.diagnose.twin.calibration import calibration_text, conditions_of
from wearstate.diagnose.twin.ensemble import simulated
from wearstate.diagnose.twin.inversion import Gaussian, corrected, rounds_of, widened
from wearstate.diagnose.twin.levels import LevelLayout, layout_of, levels_of, speed_of
from wearstate.diagnose.twin.misfit import misfit, refusal, tail_share
from wearstate.diagnose.twin.regimes import oiled_unknowns
from wearstate.diagnose.twin.regression import Regressed, regressed
from wearstate.diagnose.twin.scan import scanned
from wearstate.diagnose.twin.unknowns import WEAR, unknowns_of
from wearstate.sim.output.recording import DataError
from wearstate.sim.scene.load import minimal_text

RECIPE = "bilge-pump-standard"
BENCHMARKS = Path(__file__).parent / "benchmarks"
MODE = "casing.modes.2.frequency"
DELAY = "pressure.pressure.rise_delay"


@pytest.fixture(scope="module")
def twin_file(tmp_path_factory):
    """A twin whose third mode is a little high; its pressure turns by angles, early."""
    table = {
        "scene": "bilge-pump",
        "names": [MODE, "pressure", DELAY],
        "mean": [1.0, -2.0, -1.0],
        "sd": [0.05, 0.1, 0.2],
        "correlation": [[1.0], [0.0, 1.0], [0.8, 0.0, 1.0]],
    }
    path = tmp_path_factory.mktemp("twin") / "mine.twin.toml"
    path.write_text(toml_text(table), encoding="utf-8")
    return path


def test_records_of_a_twin_stand_beside_those_of_the_recipe(twin_file):
    plain = list(sample_records(load_recipe(RECIPE), 80, seed=3))
    mixed = list(sample_records(load_recipe(RECIPE, twin=twin_file), 80, seed=3))
    own = [sample.row["twin"] for sample in mixed]
    assert 20 < sum(own) < 60  # half of 40 machines, two records each
    for before, after, is_twin in zip(plain, mixed, own, strict=True):
        if not is_twin:
            assert after.drawn == before.drawn
        else:
            assert after.drawn["joint.crankpin.friction"] == before.drawn["joint.crankpin.friction"]
            assert after.row["choice_pressure"] == "two-level"
            # 815 Hz * (0.94 + 0.12 * Phi(1 -+ 4 * 0.05))
            assert 843.1 < after.drawn[MODE] < 852.7


def test_the_scene_of_a_twin_names_the_file_beside_it(twin_file):
    recipe = load_recipe(RECIPE, twin=twin_file.with_name("mine.toml"))
    assert recipe.table.twin.names == (MODE, "pressure", DELAY)
    again = wearstate.datasets.recipe.load.recorded_recipe(recipe.scene_text, recipe.text, "{}")
    assert [s.drawn for s in sample_records(again, 4)] == [
        s.drawn for s in sample_records(recipe, 4)
    ]


def test_a_recipe_may_name_its_twin(twin_file):
    file = twin_file.with_name("with-twin.toml")
    file.write_text(f'name = "mine"\nextends = "{RECIPE}"\ntwin = "mine.toml"\n', encoding="utf-8")
    assert load_recipe(file).twin is not None


def test_a_twin_that_is_not_there_or_of_another_recipe_is_refused(twin_file):
    with pytest.raises(RecipeError, match="make it: wearstate calibrate"):
        load_recipe(RECIPE, twin=twin_file.with_name("none.toml"))
    with pytest.raises(RecipeError, match=r"must be drawn by the recipe"):
        load_recipe("journal-bearing-standard", twin=twin_file)


def test_draws_of_a_twin_have_its_moments():
    table = TwinTable(
        names=("a", "b"), mean=(1.0, 0.0), sd=(0.1, 0.5), correlation=((1.0,), (0.8, 1.0))
    )
    rng = np.random.default_rng(1)
    drawn = ndtri([list(Twin(table).draw(rng).values()) for _ in range(4000)])
    # 4 standard errors of 4,000 draws
    assert drawn.mean(axis=0) == pytest.approx([1.0, 0.0], abs=0.035)
    assert drawn.std(axis=0) == pytest.approx([0.1, 0.5], rel=0.05)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.8, abs=0.03)


def test_a_twin_that_contradicts_itself_is_refused():
    for wrong in (
        {"sd": (0.0,)},
        {"correlation": ((1.0,), (0.0, 1.0))},
        {"names": ("a", "a"), "mean": (0.0, 0.0)},
    ):
        given = {"names": ("a",), "mean": (0.0,), "sd": (1.0,), "correlation": ((1.0,),), **wrong}
        with pytest.raises(ValueError, match="calibrate again"):
            TwinTable(**given)


def test_coordinates_decide_a_machine_as_the_recipe_does():
    recipe = load_recipe(RECIPE)
    names = coordinate_names(recipe.machine, recipe.choices)
    values, options = machine_values(recipe.machine, recipe.choices, lambda _: 0.4)
    assert len(set(names)) == len(names)
    assert values[MODE] == pytest.approx(815.0 * (0.94 + 0.4 * 0.12))
    assert options["choice_pressure"] == "two-level"


# --- unknowns


def test_unknowns_can_be_chosen_and_all_else_is_as_in_the_scene():
    recipe = load_recipe(RECIPE)
    few = unknowns_of(recipe, (5e-5, 1.3e-4), ["casing.modes.*.frequency", "tacho.late"])
    assert len(few.names) == 8 + 1 + 1
    scene = few.scene(np.ones(len(few.names)), {"drive.speed": 4.0})
    assert scene.joint.crankpin.friction == recipe.scene.joint.crankpin.friction
    assert scene.casing.modes[0].frequency > recipe.scene.casing.modes[0].frequency
    assert scene.drive.speed == 4.0
    with pytest.raises(DataError, match=r"drive\.speeed must be drawn by the recipe"):
        unknowns_of(recipe, (5e-5, 1.3e-4), ["drive.speeed"])


def test_wear_stays_in_its_range():
    few = unknowns_of(load_recipe(RECIPE), (5e-5, 1.3e-4), ["tacho.late"])
    ends = few.numbers(WEAR, np.array([[0.0, -9.0], [0.0, 9.0]]))
    assert ends == pytest.approx([5e-5, 1.3e-4], rel=1e-6)


# --- inversion


def linear(n, rng):
    """Unknowns, and levels that are linear in the first two of three."""
    gain = rng.standard_normal((3, 40)) * 3
    gain[2] = 0
    scores = rng.standard_normal((n, 3))
    return scores, scores @ gain + 3 * rng.standard_normal((n, 40)) + 60


def test_errors_left_out_are_those_of_doing_without():
    rng = np.random.default_rng(0)
    scores, levels = linear(30, rng)
    found = regressed(scores[:-1], levels)
    # the last machine as the recording, and as one left out of all thirty
    whole = regressed(scores, np.concatenate([levels, levels[-1:]]))
    here = scores[-1] - found.mean
    # both choose their strength of regularisation and scatter by other members
    assert here[:2] == pytest.approx(whole.residuals[-1][:2], abs=0.15)


def test_regression_tells_what_is_told_and_no_more():
    rng = np.random.default_rng(2)
    z = []
    for _ in range(60):
        scores, levels = linear(80, rng)
        found = regressed(scores[:-1], levels)
        assert (found.sd[:2] < 0.3).all()
        assert found.sd[2] > 0.75
        z.append((scores[-1] - found.mean) / found.sd)
    inside = (np.abs(z) < ndtri(0.95)).mean()
    assert 0.85 < inside < 0.95  # 0.9 within 2.2 standard errors of 180


def test_a_level_that_no_member_has_counts_less():
    rng = np.random.default_rng(3)
    scores, levels = linear(80, rng)
    plain = regressed(scores[:-1], levels).mean
    levels[-1, 0] += 1000.0
    assert regressed(scores[:-1], levels).mean == pytest.approx(plain, abs=0.3)


def test_the_prior_is_counted_once():
    """Product of Gaussians: precision of likelihood 3, of the prior 1, whatever was drawn from."""
    prior = Gaussian(mean=np.zeros(1), covariance=np.eye(1))
    for centre, variance in ((0.0, 1.0), (0.5, 0.5)):
        proposal = Gaussian(mean=np.array([centre]), covariance=np.array([[variance]]))
        precision = 3 + 1 / variance
        mean = (3 * 0.8 + centre / variance) / precision
        residuals = np.array([[1.0], [-1.0]]) / np.sqrt(precision)
        found = corrected(Regressed(np.array([mean]), residuals), proposal, prior)
        assert found.mean == pytest.approx([0.6])
        assert found.covariance == pytest.approx(np.array([[0.25]]))


def test_the_next_ensemble_is_wider_and_no_wider_than_the_prior():
    prior = Gaussian(mean=np.zeros(3), covariance=np.eye(3))
    told = Gaussian(mean=np.array([1.0, 1.0, 1.0]), covariance=np.diag([0.01, 0.49, 0.9]))
    found = widened(told, prior, 1.6)
    assert found.sd == pytest.approx([0.16, 1.0, 1.0])
    assert found.mean == pytest.approx([1.0, 1.0, 0.0])


def test_a_budget_decides_the_members():
    assert sum(rounds_of(200.0, 2)) == pytest.approx(2 * sum(rounds_of(200.0, 4)), abs=3)


def resonance(frequency, points, rng):
    """Level of a mode of 2 per cent damping, with scatter [dB]."""
    ratio = points / frequency
    level = -10 * np.log10((1 - ratio**2) ** 2 + (0.04 * ratio) ** 2)
    return level[np.newaxis] + rng.standard_normal((1, len(points)))


def test_a_scan_finds_the_frequency_of_a_mode():
    rng = np.random.default_rng(5)
    points = LevelLayout(channels=("a",), sample_rate=25_600.0).points
    frequencies = 815 * rng.uniform(0.94, 1.06, 60)
    spectra = np.array([resonance(each, points, rng) for each in (*frequencies, 790.0)])
    found = scanned(spectra, frequencies, np.log(points), (760.0, 870.0))
    # a scatter of 1 dB over the ten points of the resonance leaves some 0.1 %
    assert found[-1] == pytest.approx(790.0, rel=0.003)
    assert np.median(np.abs(found[:-1] / frequencies - 1)) < 0.002


def test_a_motor_on_the_mains_is_calibrated_at_the_measured_speed(recording):
    mains = {"drive.rung": "motor", "drive.motor.synchronous_speed": "306 rpm"}
    at = conditions_of(load_recipe(RECIPE, mains), recording)
    assert at["drive.motor.synchronous_speed"] == pytest.approx(5.1 * at["drive.speed"] / 5.0)
    assert "drive.motor.synchronous_speed" not in conditions_of(load_recipe(RECIPE), recording)


# --- misfit


@pytest.fixture(scope="module")
def recording():
    return wearstate.simulate(wearstate.load_scene("bilge-pump", {"duration": "1 s"}))


def test_levels_hold_map_spectrum_and_knocks(recording):
    layout, row = layout_of(recording), levels_of(recording)
    assert speed_of(recording) == pytest.approx(5.0, rel=1e-4)
    sizes = [layout.map_of(row).size, layout.spectrum_of(row).size, layout.knocks_of(row).size]
    assert sum(sizes) == row.size
    assert -20 <= layout.knocks_of(row).min() < layout.knocks_of(row).max() <= 70


@pytest.mark.parametrize("rate", [5000.0, 12800.0, 20000.0])
def test_levels_of_a_slow_recording_end_below_half_its_rate(rate):
    slow = wearstate.simulate(
        wearstate.load_scene("bilge-pump", {"duration": "1 s", "sample_rate": rate})
    )
    layout, row = layout_of(slow), levels_of(slow)
    assert np.isfinite(row).all()
    assert layout.knock_edges[-1] < rate / 2
    assert np.all(np.diff(layout.knock_edges) > 0)
    sizes = [layout.map_of(row).size, layout.spectrum_of(row).size, layout.knocks_of(row).size]
    assert sum(sizes) == row.size


def test_a_recording_too_slow_for_the_map_is_refused():
    slow = wearstate.simulate(
        wearstate.load_scene("bilge-pump", {"duration": "1 s", "sample_rate": 4000.0})
    )
    with pytest.raises(DataError, match="sample rate = 4000 Hz must be >= 5000; record faster"):
        levels_of(slow)


def test_knocks_are_placed_in_the_same_bands_at_every_fast_rate():
    for rate in (25_600.0, 51_200.0):
        layout = LevelLayout(channels=("acc",), sample_rate=rate)
        assert layout.knock_edges == (200.0, 1000.0, 3000.0, 9500.0)


def test_another_machine_is_told_by_its_name_and_not_by_the_keys_it_lacks(recording):
    with pytest.raises(DataError, match="machine = 'propulsion-shaft' must be 'recipr"):
        wearstate.calibrate("propulsion-shaft", [recording])


def test_a_file_that_is_no_data_set_is_sent_to_be_imported(tmp_path):
    np.save(tmp_path / "pump.npy", np.ones((3, 50)))
    with pytest.raises(
        DataError, match=r"wearstate import pump\.npy -o healthy\.h5, with its units"
    ):
        wearstate.calibrate("bilge-pump", [tmp_path / "pump.npy"])
    with pytest.raises(DataError, match="'journal-bearing' must be 'reciprocating-pump'"):
        wearstate.calibrate("journal-bearing", [tmp_path / "pump.npy"])  # whatever the file is


def test_a_recording_given_twice_is_refused(recording):
    with pytest.raises(DataError, match="are the same recording; give each once"):
        wearstate.calibrate("bilge-pump", [recording, replace(recording)])


def test_a_recording_without_tacho_is_refused(recording):
    bare = replace(
        recording, signal=recording.vibration, channels=recording.channels[:2], tacho=None
    )
    with pytest.raises(DataError, match="tacho with one pulse per revolution is missing"):
        levels_of(bare)


def test_the_shortest_scene_lacks_what_the_recipe_varies(recording, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(minimal_text("pump"), encoding="utf-8")
    says = "lacks .start from that of wearstate scene show bilge-pump.*choice.5.option.1 .motor."
    with pytest.raises(RecipeError, match=f"(?s){says}"):
        wearstate.calibrate(path, [recording])


def test_what_no_member_shows_is_told_with_its_place(recording):
    layout = layout_of(recording)
    rng = np.random.default_rng(7)
    base = levels_of(recording)
    ways = rng.standard_normal((6, base.size))
    rows = base + 3 * rng.standard_normal((80, 6)) @ ways + rng.standard_normal((80, base.size))
    usual = base + 3 * rng.standard_normal(6) @ ways + rng.standard_normal(base.size)
    assert not misfit(layout, rows[:, None], usual[None]).refused
    other = usual.copy()
    layout.map_of(other)[:] = layout.map_of(usual)[::-1]
    layout.spectrum_of(other)[:] = layout.spectrum_of(usual)[::-1]
    swapped = misfit(layout, rows[:, None], other[None])
    assert swapped.order == ("acc_y", "acc_x")
    assert "fit far better as acc_y, acc_x" in refusal("bilge-pump", ["a.h5"], swapped)
    wrong = usual.copy()
    layout.map_of(wrong)[1, 3:6, 10] += 60.0
    found = misfit(layout, rows[:, None], wrong[None])
    assert found.refused
    assert not found.order
    assert found.text.startswith("acc_y, ")
    assert "crank angle 30 to 60 deg" in found.text
    assert "above the nearest machine" in found.text
    quiet = usual.copy()
    layout.spectrum_of(quiet)[0, 40:] -= 30.0
    found = misfit(layout, rows[:, None], quiet[None])
    assert found.refused
    assert found.text.startswith("acc_x, ")
    assert "crank angle 0 to 360 deg" in found.text
    assert "below the nearest machine" in found.text


def test_a_share_beyond_all_members_is_that_of_their_tail():
    """Of an exponential distribution the tail is known: exp(-x)."""
    own = -np.log((np.arange(1000) + 0.5) / 1000)
    for share in (0.5, 0.05, 0.001, 1e-6):
        # a tail of 100 members tells its scale to 10 %, 12 scales beyond the edge to a factor 3
        assert np.log(tail_share(own, -np.log(share)) / share) == pytest.approx(0, abs=1.1)


def test_levels_of_noise_are_no_machine(recording):
    """Noise at the levels of the pump: it knows no crank."""
    layout = layout_of(recording)
    rng = np.random.default_rng(11)
    waves = (
        rng.standard_normal(recording.vibration.shape) * recording.vibration.std(axis=1)[:, None]
    )
    hiss = replace(recording, signal=np.concatenate([waves, recording.signal[2:]]).astype("f4"))
    plan = load_recipe(RECIPE)
    every = unknowns_of(plan, (5e-5, 1.3e-4))
    # of 40 members p is 2e-7 to 3e-3, depending on their draw, of 120 3e-5 to 4e-4
    scores = rng.standard_normal((120, len(every.names)))
    run = conditions_of(plan, recording)
    _, rows = simulated(every, scores, [run], seed=1)
    found = misfit(layout, rows, levels_of(hiss)[None])
    assert found.refused
    assert found.p < 1e-4  # 0.02 by map and spectrum alone
    assert "change less over a crank revolution" in found.text
    assert not misfit(layout, rows, levels_of(recording)[None]).refused


def test_recordings_of_swapped_channels_are_refused(recording):
    signal = recording.signal.copy()
    signal[:2] = recording.signal[1::-1]
    swapped = replace(recording, signal=signal, source="swapped.h5")
    with pytest.raises(
        wearstate.MisfitError, match=r"swapped\.h5.* fit far better as acc_y, acc_x"
    ):
        wearstate.calibrate("bilge-pump", [swapped], unknown=["casing.modes.*"], budget_s=1.0)


def test_a_pin_in_oil_is_told_from_a_dry_one():
    """What the scene has dry and the recording flooded, though laws of contact are unknown."""
    oil = {
        "joint.crankpin.rung": "film-map",
        "joint.crankpin.oil.viscosity": "0.06 Pa s",
        "joint.crankpin.oil.length": "50 mm",
        "joint.crankpin.oil.wall_damping": "3 kN s/m",
    }
    flooded = wearstate.simulate(wearstate.load_scene("bilge-pump", {"duration": "1 s", **oil}))
    unknown = ["contact_law", "sensors.*.noise"]
    with pytest.raises(wearstate.MisfitError, match=r"not dry as in .*in oil, most likely flooded"):
        wearstate.calibrate("bilge-pump", [flooded], unknown=unknown, budget_s=1.0)


def test_oil_is_asked_for_where_the_pin_is_dry_only():
    dry = unknowns_of(load_recipe(RECIPE), (5e-5, 1.3e-4))
    oiled = oiled_unknowns(dry)
    assert set(oiled.names) > set(dry.names)
    taken = {
        oiled.options(row)["choice_lubrication"]
        for row in np.random.default_rng(0).standard_normal((20, len(oiled.names)))
    }
    assert taken == {"flooded", "starved"}
    assert oiled_unknowns(oiled) is None
    ideal = load_recipe("bilge-pump-oiled")
    assert oiled_unknowns(unknowns_of(ideal, (5e-5, 1.3e-4))) is None


def test_channels_of_another_name_are_refused(recording):
    first, *rest = recording.channels
    other = replace(recording, channels=(replace(first, name="a"), *rest), source="a.h5")
    with pytest.raises(DataError, match=r"a\.h5: channels a, acc_y must be acc_x, acc_y"):
        wearstate.calibrate("bilge-pump", [other])


def test_recordings_of_two_rates_are_refused(recording):
    other = replace(recording, sample_rate=12800.0, source="b.h5")
    says = r"^b\.h5: sample rate = 12800 Hz must be 25600, that of the first"
    with pytest.raises(DataError, match=says):
        wearstate.calibrate("bilge-pump", [recording, other])


@pytest.mark.parametrize(
    ("p", "even", "told"),
    [
        (1.0, True, "fits machines of this scene: p = 1, refused below 0.02"),
        (0.5, False, "fits machines of this scene: p = 0.5, refused below 0.02; largest misfit: x"),
        (1e-3, True, "largest misfit: x"),
    ],
)
def test_a_fit_is_told_as_one(p, even, told):
    named = SimpleNamespace(name="pump")
    found = SimpleNamespace(
        numbers=(),
        unknowns=SimpleNamespace(recipe=SimpleNamespace(scene=named, name="recipe"), named=()),
        recordings=("a.h5",),
        found=SimpleNamespace(members=1),
        misfit=SimpleNamespace(refused=p < 0.02, p=p, even=even, text="x"),
    )
    assert calibration_text(found).splitlines()[-1] == told


# --- second opinion


@pytest.fixture(scope="module")
def mine(recording, tmp_path_factory):
    """A pump of which all is known but the frequencies of its casing and its wear."""
    path = tmp_path_factory.mktemp("mine") / "mine.toml"
    unknown = ["casing.modes.*.frequency"]
    wearstate.calibrate("bilge-pump", [recording], unknown=unknown, budget_s=1.0).save(path)
    return path


def worn(clearance):
    path = "joint.crankpin.diametral_clearance"
    given = {"duration": "1 s", "drive.speed": "270 rpm", path: clearance}
    return wearstate.simulate(wearstate.load_scene("bilge-pump", given), seed=5)


def test_a_twin_tells_the_wear_without_a_model(mine, monkeypatch):
    monkeypatch.setattr(opinion, "OPINION_ROUNDS", (60, 40))
    found = opinion.second_opinion(mine, worn(2.4e-4), wear="diametral_clearance_crankpin_m")
    assert (found.members, found.scene, found.reason) == (100, "bilge-pump", "")
    # a third of the range that it could be in, .05 to .465 mm, and the truth in it
    assert found.low < 2.4e-4 < found.high < found.low + 1.4e-4
    assert 1.9e-4 < found.severity < 2.9e-4
    again = opinion.second_opinion(mine.with_name("mine.twin.toml"), worn(2.4e-4))
    assert again == found
    other = opinion.second_opinion(mine, worn(2.4e-4), seed=1)
    assert other.severity != found.severity


def test_a_recording_that_a_twin_cannot_hear_gets_a_reason(mine, recording):
    bare = replace(
        recording, signal=recording.vibration, channels=recording.channels[:2], tacho=None
    )
    found = opinion.second_opinion(mine, bare)
    assert found.severity is None
    assert "tacho with one pulse per revolution is missing" in found.reason


def test_a_twin_of_another_wear_or_without_its_scene_is_refused(mine, recording, tmp_path):
    with pytest.raises(DataError, match="wear = diametral_clearance_crankpin_m must be sag_m"):
        opinion.second_opinion(mine, recording, wear="sag_m")
    table = {"names": [MODE], "mean": [0.0], "sd": [0.5], "correlation": [[1.0]]}
    (tmp_path / "old.twin.toml").write_text(toml_text(table), encoding="utf-8")
    with pytest.raises(DataError, match="recipe and base are missing"):
        opinion.second_opinion(tmp_path / "old.toml", recording)


def test_a_twin_and_its_scene_can_be_moved_together(recording, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    own = wearstate.sim.scene.load.scene_text("bilge-pump")
    (here / "pump.toml").write_text(own, encoding="utf-8")
    made = wearstate.calibrate(
        here / "pump.toml", [recording], unknown=["casing.modes.*.frequency"], budget_s=1.0
    )
    made.save(here / "mine.toml")
    here.rename(there)
    table, folder = opinion.read_twin(there / "mine.toml")
    assert (table.base, table.recipe) == ("pump.toml", RECIPE)
    assert opinion.plan_of(table, folder, recording.sample_rate).scene.name == "bilge-pump"


def test_what_a_calibration_left_is_the_prior_of_an_opinion(mine, recording):
    table, folder = opinion.read_twin(mine)
    plan = opinion.plan_of(table, folder, recording.sample_rate)
    known = unknowns_of(plan, plan.severity.extremes(), table.unknown)
    prior = opinion.prior_of(table, known)
    assert set(known.kept) == {f"casing.modes.{i}.frequency" for i in range(8)}
    for name, mean, sd in zip(table.names, table.mean, table.sd, strict=True):
        place = known.names.index(name)
        assert (prior.mean[place], prior.sd[place]) == pytest.approx((mean, sd))
    assert (prior.mean[-1], prior.sd[-1]) == (0.0, 1.0)  # the wear


# --- the campaign of misfits


def test_the_campaign_records_what_it_says(monkeypatch):
    """A sample of tests/benchmarks/twin_misfits.py: kinds of the same conditions, counted."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    script = runpy.run_path(str(BENCHMARKS / "twin_misfits.py"))
    (dry,) = script["pumps"](1, 905)
    (starved,) = script["oiled_pumps"](1, 905, "starved")
    starved = script["run_as"](starved, dry)
    assert {draw.scene.joint.crankpin.rung for draw in starved.draws} == {"mixed"}
    true, oiled, bare = (
        kind.recorded(starved if kind.oil else dry)
        for kind in script["KINDS"]
        if kind.name in ("true", "pin starved of oil", "no pressure")
    )
    for one, other in zip(true, oiled, strict=True):
        assert speed_of(one) == pytest.approx(speed_of(other), rel=script["SAME_SPEED"])
        assert one.row["discharge_pressure_pa"] == other.row["discharge_pressure_pa"]
    assert bare[0].vibration.std() < true[0].vibration.std()
    rows = [{"kind": "true", "refused": each} for each in (True, False, False)]
    # 1 of 3, exact: 0.8 to 90.6 %
    assert list(script["table"](rows))[2:] == ["| true | 1 of 3 | 1% to 91% |"]
