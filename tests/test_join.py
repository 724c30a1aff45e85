"""Several tests of one machine state as one row: running and shaker test of small shaft rigs."""

import json
from dataclasses import replace

import numpy as np
import pytest
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.views import CompletingView, JoinedSet, views_of
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.evaluation.evaluate import evaluate_model
from wearstate.diagnose.feature_rows.feature_table import FeatureSelection, feature_table
from wearstate.diagnose.wear_model.file import load_model
from wearstate.sim.output.recording import DataError

from .command_line import run


def _short():
    """Recordings just long enough for transfer functions, at a low rate."""
    return {"duration": "18 s", "sample_rate": "512 Hz", "exciters.0.high": "200 Hz"}


@pytest.fixture(scope="module")
def sets(rig_sets, tmp_path_factory):
    """Shaker tests, and the same machine states running; made once, never written to."""
    folder = tmp_path_factory.mktemp("views")
    for name in ("test.h5", "running.h5"):
        (folder / name).symlink_to(rig_sets / name)
    return folder


def views(sets):
    return views_of([str(sets / "running.h5")])


def test_views_of_a_recipe_are_the_same_machine_states(sets):
    with DataSet(sets / "test.h5") as test, DataSet(sets / "running.h5") as running:
        for column in ("record_id", "group", "sag_bearing_3_m", "speed_hz"):
            assert (test.manifest[column] == running.manifest[column]).all()
        assert set(running.manifest["view"]) == {"running"}
        assert "view" not in test.manifest
        assert not set(test.manifest["seed"]) & set(running.manifest["seed"])  # noise of its own
        assert test.machines == running.machines
        assert "force" in test[0].names
        assert "force" not in running[0].names


def test_a_view_that_a_recipe_lacks():
    with pytest.raises(ValueError, match=r"view = 'aloft' must be one of running, aft"):
        load_recipe("shaft-rig-small", view="aloft")


def test_a_joined_row_is_the_single_rows_side_by_side(sets):
    joined = feature_table(sets / "test.h5", choice=FeatureSelection(views=views(sets)))
    alone = [feature_table(sets / name) for name in ("test.h5", "running.h5")]
    assert joined.names == (*alone[0].names, *(f"running:{name}" for name in alone[1].names))
    assert np.array_equal(joined.values, np.hstack([each.values for each in alone]))
    assert joined.lacking == {}


def test_a_missing_view_is_masked_and_said(sets, tmp_path):
    recipe = load_recipe("shaft-rig-small", _short(), view="running")
    generate(recipe, 10, tmp_path / "few.h5", seed=3)
    table = feature_table(
        sets / "test.h5", choice=FeatureSelection(views=views_of([str(tmp_path / "few.h5")]))
    )
    alone = feature_table(tmp_path / "few.h5")
    places = [table.names.index(f"running:{name}") for name in alone.names]
    assert np.array_equal(table.values[:10, places], alone.values)
    assert np.isnan(table.values[10:, places]).all()
    assert np.isfinite(np.delete(table.values, places, axis=1)).all()
    assert table.complete.tolist() == [True] * 10 + [False] * 6
    assert table.lacking_words == ["6 of 16 records have no view running"]


def wave(path, tone):
    """A second of a tone, measured."""
    time = np.arange(2048) / 2048
    np.savetxt(
        path,
        np.column_stack([time, np.sin(2 * np.pi * tone * time)]),
        delimiter=",",
        header="time [s],acc [m/s^2]",
        comments="",
    )


def measured(folder, name, tones):
    """A data set of one recording of each state, whose tone tells it."""
    lines = ["file,group,state,sag_bearing_3_m"]
    for state, tone in tones.items():
        wave(folder / f"{name}_{state}.csv", tone)
        lines.append(f"{name}_{state}.csv,rig,{state},0.0001")
    (folder / f"{name}_labels.csv").write_text("\n".join(lines))
    files = [folder / f"{name}_{state}.csv" for state in tones]
    run("import", *files, "--labels", folder / f"{name}_labels.csv", "-o", folder / f"{name}.h5")
    return folder / f"{name}.h5"


def test_measured_sets_are_joined_by_machine_and_state_in_any_order(tmp_path):
    one = measured(tmp_path, "one", {"may": 100.0, "june": 200.0})
    two = measured(tmp_path, "two", {"july": 300.0, "june": 420.0, "may": 310.0})
    only = ("strongest_tone", "aft:strongest_tone")
    table = feature_table(one, choice=FeatureSelection(only=only, views=views_of([f"aft={two}"])))
    hertz = [i for i, name in enumerate(table.names) if name.endswith("_hz")]
    tones = {(round(first), round(second)) for first, second in table.values[:, hertz].tolist()}
    assert tones == {(100, 310), (200, 420)}


@pytest.fixture(scope="module")
def trained(sets):
    """Model of test and running together, through the command line."""
    features = ["--features", "frf_profile,running:rms,running:order_levels"]
    told = run(
        "train", sets / "test.h5", "--join", sets / "running.h5", *features, "--budget-ms", "0.1",
        "-o", sets / "both.wsm",
    )  # fmt: skip
    return sets / "both.wsm", told.stdout


def test_a_model_of_two_views_keeps_what_it_reads(trained):
    model = load_model(trained[0])
    assert list(model.card.views) == ["running"]
    assert not [c for c in model.card.views["running"].channels if c.quantity == "force"]
    owners = {name.partition(".")[0] for name in model.names}
    assert "running:acc_third" in owners
    assert "acc_third" in owners


def test_a_joined_model_is_evaluated_on_joined_rows(sets, trained):
    model = load_model(trained[0])
    joined = evaluate_model(model, sets / "test.h5", views=views(sets), quick=True)
    assert f"{1e6 * joined['mae_all_m']:.1f} um including unfamiliar records" in trained[1]
    with pytest.raises(DataError, match=r"joined views = none, the model needs running; give"):
        evaluate_model(model, sets / "test.h5", quick=True)
    with pytest.raises(DataError, match=r"joined views = aft, the model needs running; give"):
        evaluate_model(model, sets / "test.h5", views=(CompletingView("aft", sets / "running.h5"),))


def test_a_report_of_two_files_of_one_machine(sets, trained):
    model = load_model(trained[0])
    with JoinedSet(sets / "test.h5", views(sets)) as data:
        recording = data[12]
    options = ["--model", trained[0], "--record", "12"]
    told = run("report", sets / "test.h5", *options, "--join", sets / "running.h5", "--json")
    found = json.loads(told.stdout)
    assert found["recording"]["views"] == {"running": "running.h5[12]"}
    assert found["estimate"]["severity"] == model.estimate(recording).severity
    lost = run("report", sets / "test.h5", *options, code=2)
    assert "view running is missing, which the model needs; give --join running=FILE" in lost.stdout
    # of the whole set: every record with its own view
    both = ["--model", trained[0], "--join", sets / "running.h5"]
    many = run("report", sets / "test.h5", *both, "--json")
    lines = [json.loads(line) for line in many.stdout.splitlines()]
    [line] = [one for one in lines if one["name"] == "test.h5[12]"]
    assert line["estimate"]["severity"] == found["estimate"]["severity"]


def test_faults_of_a_view_are_found_under_its_name(sets, trained):
    model = load_model(trained[0])
    with JoinedSet(sets / "test.h5", views(sets)) as data:
        recording = data[0]
    dead = recording.joined["running"]
    dead = replace(dead, signal=np.where(np.arange(len(dead.names))[:, None] == 1, 0, dead.signal))
    found = model.estimate(replace(recording, joined={"running": dead}))
    assert found.verdict == "unusable"
    assert found.reasons[0].startswith("view running: ")


def test_sets_that_do_not_belong_together_are_refused(sets, tmp_path):
    generate(load_recipe("shaft-rig-small", _short()), 1, tmp_path / "other.h5", seed=4)
    choice = FeatureSelection(views=views_of([f"other={tmp_path / 'other.h5'}"]))
    with pytest.raises(DataError, match="0 of its 1 records are of a machine and state of"):
        feature_table(sets / "test.h5", choice=choice)
    with pytest.raises(DataError, match="views named test are given twice"):
        views_of([str(sets / "test.h5"), f"test={tmp_path / 'other.h5'}"])
    with pytest.raises(DataError, match="feature running:rms is of a view that is not joined"):
        feature_table(sets / "test.h5", choice=FeatureSelection(only=("rms", "running:rms")))
