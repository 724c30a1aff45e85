"""Train, evaluate and report from Python: what the commands say, and short texts for notebooks."""

import json
from dataclasses import replace

import pytest
import wearstate
from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.twin.opinion import TwinOpinion
from wearstate.diagnose.workflow.report import judged


@pytest.fixture(scope="module")
def record(small_set):
    with wearstate.DataSet(small_set) as data:
        return data[0]


def run(*arguments):
    return CliRunner().invoke(cli, [str(each) for each in arguments], catch_exceptions=False)


def test_a_report_is_that_of_the_command(small_set, small_model, tmp_path):
    found = wearstate.report(small_set, small_model)
    told = run("report", small_set, "--model", small_model, "--record", 0)
    assert told.output == f"{found.text}\n"
    found.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == found.html()
    with pytest.raises(wearstate.DataError, match="exists"):
        found.save(tmp_path / "page.html")


def test_a_recording_and_a_model_in_memory_are_as_good(record, small_model):
    model = wearstate.load_model(small_model)
    found = wearstate.report(record, model)
    assert found.estimate == model.estimate(record, conditions=dict(record.row))
    assert repr(found).startswith("<Report on small.h5[0]: Grade ")
    shown = replace(found.estimate, cautions=("a < b",))._repr_html_()
    assert "<td>a &lt; b</td>" in shown
    assert f"as new: {100 * found.estimate.grade_probabilities[0]:.0f} %" in shown
    assert found._repr_html_().startswith("<pre>Recording ")


def test_a_measured_recording_is_asked_for_its_nameplate(record, small_model):
    measured = replace(record, origin="measured", numerics={})
    found = wearstate.report(measured, small_model)
    assert [text for text in found.estimate.cautions if "--scene bilge-pump" in text]
    told = wearstate.report(measured, small_model, scene="bilge-pump")
    assert "nameplate" not in " ".join(told.estimate.cautions)


def test_the_estimate_of_a_report_says_what_contradicts_it(record, small_model):
    """A program that reads its verdict learns what the text says first."""
    model = wearstate.load_model(small_model)
    known = {"baselines": None, "plate": None, "machine": None, "files": None}
    far = TwinOpinion(severity=2e-3, low=1.9e-3, high=2.1e-3)
    found = judged(record, model, twin=far, **known)
    assert found.estimate.verdict == "caution"
    assert found.estimate.cautions[0].startswith("twin of the machine and trained model disagree")
    assert found.table["twin"]["agrees"] is False


def test_the_nameplate_reaches_the_estimate(record, small_model):
    with pytest.raises(wearstate.SceneError, match="pressure"):
        wearstate.report(record, small_model, values={"pressure.discharg": "3 bar"})


def test_an_evaluation_is_that_of_the_command(small_set, small_model, tmp_path):
    found = wearstate.evaluate(small_model, small_set, quick=True)
    told = run("evaluate", small_model, small_set, "--quick")
    assert told.output == f"{found}\n"
    found.save(tmp_path / "judged.json")
    assert json.loads((tmp_path / "judged.json").read_text())
    assert repr(found) == "<Evaluation of diametral_clearance_crankpin_m on small.h5>"
    assert found._repr_html_().count("<tr>") > 5


def test_train_is_that_of_the_fit(few_set, few_trained):
    expected, _, _ = few_trained
    found = wearstate.train(few_set, seed=0)
    assert found.card == expected.card
    assert repr(found) == (
        "<WearModel of diametral_clearance_crankpin_m, 1543 features; 18 simulated records of 9 "
        "machine draws; cold>"
    )
    assert "no measured joint" in found._repr_html_()


def test_a_data_set_says_what_it_holds(small_set):
    with wearstate.DataSet(small_set) as data:
        assert repr(data) == (
            "<DataSet small.h5, 120 simulated records of 4.8 s, 25600 Hz, acc_x acc_y tacho, label "
            "diametral_clearance_crankpin_m>"
        )
        assert data._repr_html_().count("<tr>") == 6


def test_an_estimate_says_what_it_found(record, small_model):
    model = wearstate.load_model(small_model)
    assert repr(model.estimate(record)).startswith("<Estimate graded: ")
    refused = wearstate.Recording.from_array(record["acc_x"], record.sample_rate, ["acc_x"])
    assert repr(model.estimate(refused)).startswith("<Estimate unusable: ")
