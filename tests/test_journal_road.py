"""The whole road of the journal bearing: recipe, features, model, report, pictures."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import generate, save_solution
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.severities import clearances, wear_limits
from wearstate.diagnose.evaluation.evaluate import score
from wearstate.diagnose.feature_rows.feature_table import feature_table, recording_features
from wearstate.diagnose.machines.picture import plot_simulation
from wearstate.diagnose.report.page import report_html
from wearstate.diagnose.report.text import report_text
from wearstate.diagnose.report.verdict import report_table
from wearstate.diagnose.wear_model.file import save_model
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.scene.load import load_scene, scene_names

from .command_line import run

N = 120
CLEARANCE = "diametral_clearance_bearing_m"


@pytest.fixture(scope="module")
def data(journal_set):
    return journal_set


@pytest.fixture(scope="module")
def trained(journal_trained):
    return journal_trained


# --- probes


def test_probes_without_a_mean_are_at_fault_where_the_model_knows_one(data, trained):
    model = trained[0]
    with DataSet(data) as records:
        whole = records[0]
    gaps = np.array([channel.quantity == "displacement" for channel in whole.channels])
    still = whole.signal - whole.signal.mean(axis=1, keepdims=True)
    coupled = replace(whole, signal=np.where(gaps[:, None], still, whole.signal))
    said = model.estimate(coupled)
    assert said.verdict == "unusable"
    assert [fault.kind for fault in said.faults] == ["coupling"]
    assert "probe_1, probe_2 show no mean position" in said.reasons[0]
    assert model.estimate(whole).verdict != "unusable"
    never = replace(model.familiarity, low=np.full(len(model.names), -1e9))  # as trained on such
    assert replace(model, familiarity=never).estimate(coupled).verdict != "unusable"


def test_a_shaft_on_another_side_of_its_bearing_than_in_training_is_told(data, trained):
    model = trained[0]
    place = [model.names.index(f"orbit.centreline.{axis}") for axis in "xy"]
    low = model.familiarity.low[place]
    with DataSet(data) as records:  # the one whose shaft lies the lowest of those as in training
        rows = np.array([model._row(records[i], None)[place] for i in range(N)])
        known = np.where((rows >= low).all(axis=1), np.hypot(*rows.T), 0.0)
        whole = records[int(known.argmax())]
    first, second, *rest = whole.signal
    away = replace(whole, signal=np.stack([-first, -second, *rest]))  # gaps instead of motion
    said = model.estimate(away)
    assert said.verdict == "unusable"
    assert [(fault.kind, fault.bars) for fault in said.faults] == [("place", True)]
    assert "multiply them by -1" in said.reasons[0]
    # as a load to the side would have it: what the probe a quarter of a turn behind reads
    aside = replace(whole, signal=np.stack([second, -first, *rest]))
    (fault,) = [fault for fault in model.estimate(aside).faults if fault.kind == "place"]
    assert not fault.bars
    assert "direction of the load" in fault.text
    assert not any(fault.kind == "place" for fault in model.estimate(whole).faults)


# --- the recipe


def test_clearance_speed_load_oil_and_unbalance_are_drawn_as_the_recipe_says():
    recipe = load_recipe("journal-bearing-standard")
    rows = [sample.row for sample in sample_records(recipe, 400, seed=1)]
    scene = recipe.scene
    bounds = {
        CLEARANCE: (0.0914e-3, 0.36195e-3),
        "speed_hz": (42.5, 57.5),
        "static_load_n": (2000, 8000),
        "viscosity_pa_s": (0.012, 0.075),
        "unbalance_kg_m": (0.5 * scene.rotor.unbalance, 2 * scene.rotor.unbalance),
    }
    for column, (low, high) in bounds.items():
        values = np.array([row[column] for row in rows])
        # 200 machines or more: an end is missed by 5 % of the range with probability 4e-5
        assert low <= values.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < values.max() <= high
    assert {row["grade"] for row in rows} == {0, 1, 2, 3}


def test_limits_are_those_of_their_sources():
    """TM 9-6115-604-34, main bearings: 0.0036 to 0.0075 in new, renewed at 0.0095 in."""
    scene = load_scene("journal-bearing")
    wear = wear_limits(scene, CLEARANCE)
    inch = 0.0254
    expected = [0.0036 * inch, 0.0075 * inch, 0.0095 * inch]
    # the scene rounds to a tenth of a micrometre
    found = [wear.as_new, wear.grade_edges[0], wear.condemning]
    assert_allclose(found, expected, rtol=0, atol=0.06e-6)
    assert_allclose(wear.grade_edges[1], (found[1] + found[2]) / 2, rtol=1e-12)
    scar = wear_limits(scene, "scar_depth_bearing_m")
    assert_allclose(scar.condemning, 0.4 * scene.bearing.clearance_radial, rtol=1e-12)


def test_the_severities_of_a_scene():
    found = clearances(load_scene("journal-bearing", {"bearing.radial_clearance": "0.08 mm"}))
    assert found == {CLEARANCE: pytest.approx(0.16e-3), "scar_depth_bearing_m": 0.0}


def test_every_record_of_the_data_set_has_its_film(data):
    with DataSet(data) as found:
        manifest = found.manifest
        first = found[0]
    assert (manifest["status"] == "ok").all()
    assert (manifest["rung_film"] == "map").all()
    assert (manifest["min_film_m"] > 5e-6).all()
    assert manifest["peak_eccentricity"].between(0.05, 0.9).all()
    assert [channel.unit for channel in first.channels] == ["m", "m", "V"]


def test_the_orbit_of_a_record_is_in_its_features(data):
    with DataSet(data) as found:
        names, values = recording_features(found[0])
        row = found.manifest.iloc[0]
    features = dict(zip(names, values, strict=True))
    assert features["shaft.speed_hz"] == pytest.approx(row["speed_hz"], rel=1e-4)
    # the shaft hangs below the middle, and the x axis points up, between the probes
    assert features["orbit.centreline.x"] < 0
    assert not any(".angle_" in name for name in names)


# --- the model


def test_held_out_bearings_get_a_clearance(trained):
    model, table, test = trained
    found = score(model, table, test)
    assert found["records"] == 30
    # 6.3 % of the limit with 90 training records of another seed; 800 records: 3.7 %
    assert found["mae_share_of_limit"] < 0.10
    assert found["within_one_grade"] > 0.95
    assert found["baselines"]["single_rms"]["accuracy"]["value"] < 0.8


def test_the_centreline_knows_more_than_the_rms(trained):
    """What a person would look at: where the shaft lies."""
    _, table, _ = trained
    frame = table.frame()
    truth = np.log(frame[CLEARANCE])
    level = frame["orbit.centreline.radius_db"]
    assert np.corrcoef(level, truth)[0, 1] > 0.9
    assert np.corrcoef(np.log(frame["probe_1.rms"]), truth)[0, 1] < 0.8


def test_the_report_speaks_of_the_bearing(trained, data, tmp_path):
    model, _, test = trained
    with DataSet(data) as found:
        recording = found[int(test[0])]
    estimate = model.estimate(recording)
    assert estimate.verdict == "graded"
    table = report_table(recording, model, estimate)
    text = report_text(table)
    assert "diametral clearance, bearing" in text
    assert "TM 9-6115-604-34" in text
    page = report_html(table, recording)
    assert "Shaft orbit" in page
    assert "crank angle" not in page


def test_the_command_line_goes_all_the_way(data, tmp_path):
    model, page, features = (tmp_path / name for name in ("m.wsm", "r.html", "f.csv"))
    run("features", data, "-o", features, "-j", 1)
    lines = run("train", data, "-o", model, "-j", 1).stdout
    assert "clearance error" in lines
    run("evaluate", model, data, "-j", 1)
    shown = run("report", data, "--record", 0, "--model", model, "-o", page, "--json")
    told = json.loads(shown.stdout)
    assert told["limits"]["severity"] == CLEARANCE
    assert page.stat().st_size > 20_000
    assert "orbit.centreline.x" in features.read_text().splitlines()[0]
    assert "diametral_clearance_bearing" in run("info", data).stdout


def test_the_film_equilibrium_stands_beside_the_model(trained, data, tmp_path):
    """Without a word of a person, as the data set holds its scene; and against a wrong load."""
    model = tmp_path / "bearing.wsm"
    save_model(trained[0], model)
    one = ["report", data, "--record", 4, "--model", model]
    with DataSet(data) as found:
        truth = found.manifest[CLEARANCE].iloc[4]
    table = json.loads(run(*one, "--json").stdout)
    # probes set to 5 um, sensitivities within 5 %
    assert table["film"]["severity"] == pytest.approx(truth, rel=0.15)
    assert table["film"]["low"] < truth < table["film"]["high"]
    assert "Film        equilibrium: 0." in run(*one).stdout
    wrong = json.loads(run(*one, "--set", "load.static=0 N", "--json").stdout)
    assert wrong["film"]["severity"] is None or wrong["estimate"]["verdict"] == "caution"
    few = tmp_path / "few.h5"  # the first records of the set
    generate("journal-bearing-small", 6, few, seed=3)
    whole = run("report", few, "--model", model, "--json").stdout.splitlines()
    assert json.loads(whole[4])["film"] == {**table["film"], "nameplate": str(few)}
    page = tmp_path / "all.html"
    run("report", few, "--model", model, "--scene", "journal-bearing", "-o", page)
    assert "Film equilibrium:" in page.read_text(encoding="utf-8")


def test_a_pump_recording_lacks_what_a_bearing_model_needs(trained, tmp_path):
    model, _, _ = trained
    pump = load_scene("bilge-pump", {"duration": "0.25 s", "settling_revolutions": 1})
    path = tmp_path / "pump.h5"
    save_solution(pump, simulate(pump, seed=1), path, seed=1)
    with DataSet(path) as found:
        estimate = model.estimate(found[0])
    assert (estimate.verdict, estimate.grade) == ("unusable", None)
    assert any("m/s^2" in reason for reason in estimate.reasons)


def test_one_recording_keeps_severity_speed_and_grade(tmp_path):
    worn = load_scene("journal-bearing", {"bearing.diametral_clearance": "0.2 mm"})
    path = tmp_path / "one.h5"
    save_solution(worn, simulate(worn, seed=1, truth=True), path, seed=1, truth=True)
    with DataSet(path) as found:
        row, head = found.manifest.iloc[0], found.attributes
    assert (row["grade"], row["speed_hz"]) == (1, 50.0)
    assert (row["static_load_n"], row["viscosity_pa_s"]) == (5000.0, 0.03)
    assert row[CLEARANCE] == pytest.approx(0.2e-3)
    assert head.condemning_limit == pytest.approx(0.2413e-3)


# --- the scar


def test_a_worn_scar_is_a_severity_of_its_own(tmp_path):
    path = tmp_path / "scar.h5"
    generate("journal-scar-small", 6, path, seed=2)
    table = feature_table(path)
    depth = table.manifest["scar_depth_bearing_m"].to_numpy()
    assert (table.manifest["rung_film"] == "direct").all()
    assert depth.min() >= 2e-6
    assert depth.max() <= 42e-6
    level = dict(zip(table.names, table.values.T, strict=True))["orbit.centreline.x"]
    # the deeper the scar, the lower the shaft, whatever speed, load and oil: by rank
    assert level[np.argmax(depth)] < level[np.argmin(depth)]


# --- pictures


@pytest.mark.parametrize("name", [name for name in scene_names() if name.startswith("journal-")])
@pytest.mark.parametrize("rung", ["map", "short"])
def test_every_journal_scene_is_drawn(name, rung, tmp_path):
    scene = load_scene(name, {"film.rung": rung, "duration": "0.1 s"})
    path = tmp_path / "picture.png"
    plot_simulation(scene, simulate(scene, seed=1, truth=True), path)
    assert path.stat().st_size > 20_000
