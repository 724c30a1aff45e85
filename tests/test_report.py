"""The report: table, text and page of one recording, of a folder, of a trend; exit codes."""

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import wearstate
from matplotlib import pyplot
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.recipe.text import toml_text
from wearstate.diagnose.command_line.report import report_exit
from wearstate.diagnose.healthy_reference.healthy import Baseline, Baselines
from wearstate.diagnose.nameplate.nameplate import Nameplate, nameplate_of
from wearstate.diagnose.pages.embed import MOST_BYTES
from wearstate.diagnose.recording_faults.fault import QualityFault
from wearstate.diagnose.report import page as page_module
from wearstate.diagnose.report.batch import judge_all, recordings_in, times_of
from wearstate.diagnose.report.figures import moved_panel, report_pictures
from wearstate.diagnose.report.page import batch_html, report_html
from wearstate.diagnose.report.points import trend_points
from wearstate.diagnose.report.second_estimate import ModelOpinion
from wearstate.diagnose.report.text import batch_text, report_text
from wearstate.diagnose.report.verdict import (
    evidence_words,
    iso_table,
    millimetres,
    report_table,
    zone_words,
)
from wearstate.diagnose.twin.opinion import TwinOpinion
from wearstate.diagnose.wear_model.file import load_model, save_model
from wearstate.diagnose.wear_model.train import train_model
from wearstate.diagnose.wear_model.verdict import Estimate, FaultFinding
from wearstate.diagnose.workflow import report as workflow_report
from wearstate.diagnose.workflow.report import Report
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel

from .command_line import run

FS = 10240.0
SPEED = 8.0  # Hz
N = 10240
LIMIT = 3e-4
EDGES = (1e-4, 2e-4, LIMIT)
RECIPE = 'name = "knocking"'
COLUMN = "diametral_clearance_crankpin_m"
CHANNELS = (
    Channel(name="acc", unit="m/s^2", quantity="acceleration", place="housing"),
    Channel(name="tacho", unit="V", quantity="tacho"),
)


def knocking(clearance, seed, speed=SPEED):
    """A housing that rings at every dead centre, the louder the larger the clearance."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / FS
    turn = speed * t % 1
    ring = np.exp(-60 * turn / speed) * np.sin(2 * np.pi * 700 * turn / speed)
    wave = 1e5 * clearance * ring + np.sin(2 * np.pi * speed * t) + 0.2 * rng.standard_normal(N)
    return np.stack([wave, np.where(turn < 0.1, 5.0, 0.0)])


def recording_of(clearance, seed=1, **changes):
    whole = Recording(
        signal=knocking(clearance, seed),
        sample_rate=FS,
        channels=CHANNELS,
        tacho="tacho",
        origin="simulated",
        source="case.h5",
    )
    return dataclasses.replace(whole, **changes)


def written(
    path,
    clearances,
    *,
    groups=None,
    hours=None,
    seed=0,
    origin="simulated",
    recipe=RECIPE,
    names=(),
    column=COLUMN,
):
    head = Attributes(
        sample_rate=FS,
        channels=CHANNELS,
        origin=origin,
        tacho="tacho",
        severities=(column,),
        grade_edges=EDGES,
        condemning_limit=LIMIT,
        limit_source="a manual",
        recipe=recipe,
    )
    n = len(clearances)
    columns = {column: "<f8", **({"operating_hours": "<f8"} if hours is not None else {})}
    columns |= {"group_name": "S16"} if names else {}
    with DataSetWriter(path, head, n_records=n, n_samples=N, columns=columns) as writer:
        for i, clearance in enumerate(clearances):
            row = {"record_id": str(i), "group": 0 if groups is None else int(groups[i])}
            row |= {"status": "ok", "grade": int(np.searchsorted(EDGES, clearance, "right"))}
            row |= {"group_name": names[i]} if names else {}
            row |= {column: clearance} | ({} if hours is None else {"operating_hours": hours[i]})
            writer.write(i, knocking(clearance, [seed, i]), row)
        writer.finish()
    return path


@pytest.fixture(scope="module")
def model_file(tmp_path_factory):
    """Model of 60 synthetic machines."""
    folder = tmp_path_factory.mktemp("report")
    clearances = np.geomspace(4e-5, 4.5e-4, 60)
    data = written(folder / "data.h5", clearances, groups=range(60))
    save_model(train_model(data, held_out=0.0)[0], folder / "model.wsm")
    return folder / "model.wsm"


@pytest.fixture(scope="module")
def model(model_file):
    return load_model(model_file)


def graded(**changes):
    """An estimate in the middle of grade 2."""
    plain = Estimate(
        verdict="graded",
        p_value=0.4,
        p_limit=0.02,
        nearest="machine 7 of the training set",
        grade=2,
        grade_name="plan renewal",
        possible_grades=(2,),
        grade_probabilities=(0.0, 0.05, 0.9, 0.05),
        severity=2.5e-4,
        low=2.3e-4,
        high=2.8e-4,
        evidence=(("acc.rms", 4.0, 2.0, 8.0), ("acc.order_02.level_db", -8.0, -14.0, 5.0)),
    )
    return dataclasses.replace(plain, **changes)


def shown(page):
    """A page as a reader sees it."""
    text = re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL)
    return " ".join(text.split())


def is_self_contained(page):
    addresses = re.findall(r"(?:src|href)=\"([^\"]{0,40})", page)
    return all(a.startswith("data:image/png;base64,") for a in addresses) and not re.search(
        r"<script|<link|https?://|@import|url\(", page
    )


# --- one recording


def test_the_verdict_stands_first(model):
    found = recording_of(2.5e-4)
    table = report_table(found, model, graded())
    page = report_html(table, found, model)
    text = shown(page)
    assert text.index("Grade 2 of 3: plan renewal") < text.index("0.250 mm (0.230 to 0.280, 90 %)")
    assert text.index("0.250 mm") < text.index("Plan renewal of the crankpin bearing")
    assert text.index("within a week") < text.index("Evidence") < text.index("Caveats")
    assert "83 % of the condemning limit 0.3 mm (a manual)" in text
    assert "Nearest: machine 7 of the training set" in text
    assert "trained on simulation" in text
    assert is_self_contained(page)
    assert len(page) < 1_500_000
    assert all(re.findall(r"<img [^>]*alt=\"([^\"]+)\"", page))
    assert "@media print" in page


def test_text_and_table_tell_the_same(model):
    table = report_table(recording_of(2.5e-4), model, graded(possible_grades=(2, 3)))
    text = report_text(table)
    assert table["schema_version"] == 2
    json.dumps(table, allow_nan=False)
    assert text.splitlines()[1] == "Verdict     Grade 2 of 3: plan renewal"
    assert table["advice"]["days"] == 2  # it may be condemned already
    assert "within 2 days (rule of thumb" in text
    assert "2 (plan renewal) or 3 (condemned)" in text
    assert max(map(len, text.splitlines())) <= 96


def test_an_interval_beyond_the_possible_grades_is_said(model):
    found = recording_of(2.5e-4)
    beyond = report_table(found, model, graded(low=1.9e-4, high=3.2e-4))
    within = report_table(found, model, graded())
    said = "grade 2 (plan renewal); the interval, calibrated by itself, also reaches 1 (worn) and 3"
    assert beyond["grades_text"].startswith(said)
    assert beyond["advice"]["days"] == 2  # it may be condemned already
    assert within["grades_text"] == ""
    assert within["advice"]["days"] == 7
    assert said in shown(report_html(beyond, found, model))
    assert "also reaches 1" in " ".join(report_text(beyond).split())
    assert "Possible" not in report_text(within)


def test_a_grade_far_from_the_interval_has_its_reason(model):
    """A grade of few training machines cannot be excluded by them, whatever the interval says."""
    found, narrow = recording_of(1.2e-4), {"grade": 1, "severity": 1.2e-4, "low": 1.1e-4}
    few = graded(**narrow, high=1.3e-4, possible_grades=(0, 1, 2, 3))
    words = report_table(found, model, few)["grades_text"]
    assert words.partition("; ")[2].startswith("the interval keeps away from 3 (condemned), but ")
    beside = graded(**narrow | {"low": 0.9e-4}, high=1.3e-4, possible_grades=(1, 2, 3))
    words = report_table(found, model, beside)["grades_text"]
    assert words.split("; ")[2].endswith("also reaches 0 (as new)")
    near = graded(**narrow, high=1.3e-4, possible_grades=(0, 1, 2))
    assert "keeps away" not in report_table(found, model, near)["grades_text"]


def test_a_twin_stands_beside_the_model_and_a_disagreement_before_the_verdict(model):
    found = recording_of(2.5e-4)
    near = TwinOpinion(severity=2.4e-4, low=2.2e-4, high=2.7e-4, members=210, scene="mine")
    agreed = report_table(found, model, graded(), twin=near)
    assert (agreed["twin"]["agrees"], agreed["disagreements"]) == (True, [])
    assert "Twin        0.240 mm (0.220 to 0.270, 90 %), by 210 sim" in report_text(agreed)
    assert "Twin of the machine: 0.240 mm" in shown(report_html(agreed, found, model))

    far = TwinOpinion(severity=1.4e-4, low=1.2e-4, high=1.7e-4, members=210, scene="mine")
    apart = report_table(found, model, graded(), twin=far)
    lines = report_text(apart).splitlines()
    assert lines[1].startswith("Disagree    twin of the machine and trained model disagree: 0.140")
    assert "Grade 2 of 3: plan renewal, with caution" in "\n".join(lines)
    assert not any(line.startswith("Caution") for line in lines)  # once is enough
    page = shown(report_html(apart, found, model))
    assert page.lower().index("trained model disagree") < page.index("Grade 2 of 3")
    assert page.count("trained model disagree") == 1
    assert not apart["twin"]["agrees"]

    silent = report_table(found, model, graded(), twin=TwinOpinion(reason="tacho must be there"))
    assert silent["twin"]["agrees"] is None
    assert "Twin        no estimate: tacho must be there" in report_text(silent)


def test_another_model_stands_next_to_this_one_and_is_first_outside_its_interval(model):
    """Wide as its own interval may be: where its estimate lies decides."""
    found = recording_of(2.5e-4)
    inside = ModelOpinion(trained_on="oval eyes", severity=2.6e-4, low=1.8e-4, high=3.6e-4)
    agreed = report_table(found, model, graded(), other=inside)
    assert (agreed["other_model"]["agrees"], agreed["disagreements"]) == (True, [])
    assert "Other       0.260 mm (0.180 to 0.360, 90 %), by the model of" in report_text(agreed)
    assert "Another model: 0.260 mm" in shown(report_html(agreed, found, model))

    outside = dataclasses.replace(inside, severity=3.4e-4)
    apart = report_table(found, model, graded(), other=outside)
    assert not apart["other_model"]["agrees"]
    said = "Disagree    the model of oval eyes estimates 0.340 mm (0.180 to 0.360, 90 %), outside"
    assert report_text(apart).splitlines()[1].startswith(said[:70])
    assert "with caution" in apart["headline"]

    silent = ModelOpinion(trained_on="oval eyes", reasons=("it is unfamiliar",))
    table = report_table(found, model, graded(), other=silent)
    assert (table["other_model"]["agrees"], table["disagreements"]) == (None, [])
    assert "Other       no estimate by the model of oval eyes: it is unfamiliar" in report_text(
        table
    )


def test_advice_and_exit_follow_a_larger_estimate_of_another_grade(model):
    """The caution says to rely on the larger one: neither advice nor alarm may follow the other."""
    found = recording_of(2.5e-4)
    worse = ModelOpinion(
        trained_on="oval eyes", severity=3.4e-4, low=3.1e-4, high=4e-4, grade=3, grade_name="bad"
    )
    table = report_table(found, model, graded(), other=worse)
    assert table["other_model"]["relied_on"]
    assert table["advice"]["action"] == "stop"
    assert table["advice"]["sentence"].startswith("The larger estimate is beyond the condemning")
    assert "(grade 3: bad), by the model of oval eyes" in " ".join(report_text(table).split())
    assert "Grade 2" in table["headline"]  # the verdict remains that of this model

    for quiet in (
        dataclasses.replace(worse, severity=2.6e-4),  # within the interval: they agree
        dataclasses.replace(worse, severity=1e-4, grade=0),  # smaller
        dataclasses.replace(worse, severity=3.4e-4, grade=2),  # of the same grade
    ):
        same = report_table(found, model, graded(), other=quiet)
        assert not same["other_model"]["relied_on"]
        assert "larger" not in same["advice"]["sentence"]
    careful = dataclasses.replace(worse, cautions=("its noise floor is high",))
    said = report_table(found, model, graded(), other=careful)["other_model"]["text"]
    assert said.endswith("; its own caution: its noise floor is high")


def test_an_alarm_of_the_other_model_is_one_of_the_command(model_file, tmp_path, monkeypatch):
    worse = ModelOpinion(trained_on="oval eyes", severity=9e-4, low=8e-4, high=1e-3, grade=3)
    monkeypatch.setattr(workflow_report, "_other_opinion", lambda *_: worse)
    one = written(tmp_path / "one.h5", [1.4e-4])
    args = ("report", one, "--model", model_file, "--fail-on", "alarm")
    assert "Grade 1 of 3" in run(*args).output
    assert "Grade 1 of 3" in run(*args, "--also", "other.wsm", code=4).output


def test_a_channel_too_many_is_left_out_as_the_verdict_says(model_file, tmp_path):
    """A data set refused the very option that its verdict asked for."""
    extra = Channel(name="pressure", unit="Pa", quantity="pressure")
    head = Attributes(
        sample_rate=FS,
        channels=(CHANNELS[0], extra, CHANNELS[1]),
        origin="measured",
        tacho="tacho",
    )
    path = tmp_path / "three.h5"
    with DataSetWriter(path, head, n_records=2, n_samples=N) as writer:
        for i in range(2):
            acc, tacho = knocking(2.5e-4, i)
            row = {"record_id": str(i), "group": 0, "status": "ok"}
            writer.write(i, np.stack([acc, 0 * acc, tacho]), row)
        writer.finish()
    said = run("report", path, "--record", 0, "--model", model_file, code=2).output
    assert "give --channels acc" in said
    chosen = ("--model", model_file, "--channels", "acc")
    assert "no grade" not in run("report", path, "--record", 0, *chosen).output
    assert "no grade" not in run("report", path, *chosen).output  # many
    (tmp_path / "folder").mkdir()
    path.rename(tmp_path / "folder" / "three.h5")
    assert "no grade" not in run("report", tmp_path / "folder", *chosen).output


def test_what_the_other_model_was_trained_on_is_no_longer_unseen(model):
    """Only if it gives an estimate."""
    trained = {"scene": "bilge-pump", "recipe": "bilge-pump-narrow"}
    card = model.card.model_copy(
        update={"trained_on": model.card.trained_on.model_copy(update=trained)}
    )
    blind = dataclasses.replace(model, card=card)
    other = ModelOpinion(trained_on="bilge-pump-standard", severity=2.6e-4, low=2e-4, high=3e-4)

    def unseen(other):
        return " ".join(report_table(recording_of(2.5e-4), blind, graded(), other=other)["unseen"])

    assert "across the rod" in unseen(None)
    assert "across the rod" in unseen(
        dataclasses.replace(other, severity=None, low=None, high=None)
    )
    assert "across the rod" not in unseen(other)
    assert "main bearings" in unseen(other)


def test_a_report_names_the_conditions_that_its_estimate_uses(model):
    """A scene given for its geometry also gives pressures: whoever relies on them must see them."""
    found = recording_of(2.5e-4)
    used = graded(noted=("discharge_pressure_pa", "suction_pressure_pa"))

    def told(row, **values):
        plate = nameplate_of(None, "bilge-pump", values)
        table = report_table(dataclasses.replace(found, row=row), model, used, plate=plate)
        return table, [each["text"] for each in table["conditions"]]

    table, texts = told({"discharge_pressure_pa": 2.8e5}, **{"pressure.suction": "0 bar"})
    assert texts == [
        "pressure.discharge = 280 kPa (noted with the recording)",
        "pressure.suction = 0 Pa (set)",
    ]
    assert "Given       pressure.discharge = 280 kPa (noted" in report_text(table)
    assert "Condition used: pressure.suction = 0 Pa (set)" in shown(
        report_html(table, found, model)
    )
    assert told({})[1] == [
        "pressure.discharge = 300 kPa (bilge-pump)",
        "pressure.suction = -30 kPa (bilge-pump)",
    ]
    assert report_table(found, model, graded())["conditions"] == []
    oil = report_table(
        dataclasses.replace(found, row={"viscosity_pa_s": 0.03}),
        model,
        graded(noted=("viscosity_pa_s",)),
    )
    assert [each["path"] for each in oil["conditions"]] == ["oil.viscosity"]  # as --set takes it


def test_another_model_is_named_to_the_command(model_file, tmp_path):
    one, two = written(tmp_path / "one.h5", [2.5e-4]), written(tmp_path / "two.h5", [1e-4, 2e-4])
    other = load_model(model_file)
    trained = other.card.trained_on.model_copy(update={"recipe": "another"})
    other = dataclasses.replace(other, card=other.card.model_copy(update={"trained_on": trained}))
    save_model(other, tmp_path / "other.wsm")
    also = ("--model", model_file, "--also", tmp_path / "other.wsm")
    told = json.loads(run("report", one, *also, "--json").output)
    own = told["estimate"]
    assert told["other_model"]["severity"] == own["severity"]
    assert told["other_model"]["grade"] == own["grade"]
    origins = told["other_model"]["origin"], told["provenance"]["model"]
    assert origins[0].keys() == origins[1].keys()
    assert {name for name, value in origins[0].items() if value != origins[1][name]} == {
        "file_sha256",
        "recipe",
    }
    assert told["other_model"]["agrees"]
    page = shown(wearstate.report(one, model_file, also=tmp_path / "other.wsm").html())
    assert "second model" in page
    assert told["other_model"]["origin"]["file_sha256"] in page
    same = run("report", one, "--model", model_file, "--also", model_file, code=2).output
    assert "also: it is the same model of" in same
    many = run("report", two, *also, code=2).output
    assert "--also is for one recording: name one, or choose a --record" in many
    other = load_model(model_file)
    other = dataclasses.replace(other, card=other.card.model_copy(update={"severity": "sag_m"}))
    with pytest.raises(DataError, match="also: its wear = sag_m must be diametral_clearance"):
        wearstate.report(one, model_file, also=other)


def test_a_twin_is_asked_by_the_command(model_file, tmp_path):
    """Of a recording with other channels it says why it says nothing; of many none is asked."""
    given = {"recipe": "bilge-pump-standard", "base": "bilge-pump", "names": ["tacho.late"]}
    given |= {"mean": [0.0], "sd": [0.5], "correlation": [[1.0]]}
    (tmp_path / "mine.twin.toml").write_text(toml_text(given), encoding="utf-8")
    one = tmp_path / "one.h5"
    written(one, [2.5e-4])
    two = tmp_path / "two.h5"
    written(two, [2.5e-4, 2.6e-4])
    twin = ("--model", model_file, "--twin", tmp_path / "mine.toml")
    assert "Twin        no estimate: " in run("report", one, *twin).output
    many = run("report", two, *twin, code=2).output
    assert "--twin is for one recording: name one, or choose a --record" in many
    lost = run("report", one, "--model", model_file, "--twin", tmp_path / "no.toml", code=2).output
    assert "make it: wearstate calibrate" in " ".join(lost.split())


def test_chance_is_no_evidence(model):
    """Of many features some lie two or three standard deviations off in any healthy machine."""
    quiet = graded(evidence=(("acc.rms", 2.1, 2.0, 2.4),))
    loud = graded(evidence=(("acc.rms", 4.0, 2.0, 8.0),))
    found = recording_of(6e-5)
    table = report_table(found, model, quiet)
    assert table["evidence_summary"].startswith(f"nothing stands out: of {len(model.names)} ")
    assert table["evidence_summary"].endswith("here it is 2.4")
    assert "In short: nothing stands out" in shown(report_html(table, found, model))
    assert "nothing stands out" in report_text(table)
    assert "nothing stands out" not in report_table(found, model, loud)["evidence_summary"]


def test_a_caution_stands_in_the_verdict(model):
    found = recording_of(2.5e-4)
    caution = graded(verdict="caution", cautions=("shaft.speed_hz = 12 Hz is outside",))
    page = report_html(report_table(found, model, caution), found, model)
    verdict = page.split('<div class="verdict"')[1].split("</div>")[0]
    assert "plan renewal, with caution" in verdict
    assert "shaft.speed_hz = 12 Hz is outside" in verdict
    assert "within the trained ranges" not in page


@pytest.mark.parametrize("verdict", ["unfamiliar", "unusable"])
def test_without_a_grade_no_figure_is_given(model, verdict):
    found = recording_of(2.5e-4)
    fault = QualityFault(kind="dead", channel="acc", text="channel acc is dead")
    empty = Estimate(
        verdict=verdict,
        reasons=("it is <odd> & strange",),
        faults=(fault,) if verdict == "unusable" else (),
    )
    table = report_table(found, model, empty)
    page = report_html(table, found, model)
    text = shown(page)
    assert text.index("no grade is given") < text.index("It is &lt;odd&gt; &amp; strange.")
    assert "does not mean that the machine is sound" in text
    assert not re.search(r"\d mm\b", text.split("Provenance")[0])
    assert "Waveform" in text  # where a fault of the recording is seen
    assert ("Data quality, dead" in text) == (verdict == "unusable")
    assert "Advice" in report_text(table)


def test_a_fault_beside_the_wear_is_in_the_verdict_only_if_present(model):
    rates = {"detection_rate": 0.88, "false_alarm_rate": 0.03}
    leak = FaultFinding(name="valve_leak", probability=0.93, present=True, **rates)
    air = FaultFinding(name="air", probability=0.1, present=False, **rates)
    found = recording_of(2.5e-4)
    table = report_table(found, model, graded(confounders=(leak, air)))
    page = report_html(table, found, model)
    verdict = page.split('<div class="verdict"')[1].split("</div>")[0]
    assert "Valve leak: present (93 %" in verdict
    assert "air" not in shown(verdict).lower().split("valve leak")[1].split("iso")[0]
    assert "Air: not found (10 %" in page
    assert "valve leak: present" in report_text(table)
    assert "air: not" not in report_text(table)


def test_evidence_is_in_plain_words():
    assert evidence_words("acc.rms", 4.0, 2.0, {"acc": "m"}) == "4e+06 µm instead of 2e+06"
    assert evidence_words("acc.kurtosis", 6.0, 3.0) == "6 instead of 3"
    assert evidence_words("a.order_02.level_db", -20.0, 0.0).startswith("20.0 dB weaker: 0.1 times")
    assert evidence_words("a.peak_hz", 50.0, 40.0) == "50 Hz instead of 40"
    assert evidence_words("a.b.rms_ratio_db", 3.0, 1.0) == "3.0 dB instead of 1.0"


def test_the_zone_is_of_the_kind_of_machine():
    """A tone of 5 mm/s rms at 100 Hz."""
    t = np.arange(4 * N) / FS
    tone = 2 * np.pi * 100 * 5e-3 * np.sqrt(2) * np.sin(2 * np.pi * 100 * t)
    found = recording_of(1e-4, signal=np.stack([tone, np.tile(knocking(1e-4, 0)[1], 4)]))
    table = iso_table(found, "reciprocating-2")
    # of velocity_rms: below 1e-3 from 5 lines of the lower edge on
    assert table["channels"][0]["velocity_m_s"] == pytest.approx(5e-3, rel=1e-3)
    assert table["zone"] == "A"  # up to 7.07
    assert "A (ISO 10816-6" in zone_words(table)
    assert "5 mm/s" in zone_words(table)
    assert iso_table(found, "compressor-foundation")["zone"] == "D"  # above 4.5


def test_where_there_is_no_zone_it_says_why():
    found = recording_of(1e-4)
    assert "kind of machine is not given" in zone_words(iso_table(found, None))
    probe = dataclasses.replace(CHANNELS[0], unit="m", quantity="displacement")
    at_shaft = dataclasses.replace(found, channels=(probe, CHANNELS[1]))
    assert "no channel of acceleration" in iso_table(at_shaft, "industrial-1-rigid")["note"]
    slow = dataclasses.replace(found, sample_rate=1000.0)
    assert "fs / 2" in iso_table(slow, "reciprocating-1")["note"]
    with pytest.raises(DataError, match=r"machine = 'pump-1-smal'.*did you mean pump-1-small"):
        iso_table(found, "pump-1-smal")


def test_the_map_of_what_moved_is_level_against_healthy(model):
    """Against a baseline of its own features nothing has moved."""
    from wearstate.diagnose.feature_rows.feature_table import recording_features

    found = recording_of(4e-4)
    own = recording_features(found)[1]
    still = moved_panel(found, model, healthy=own)
    against = moved_panel(found, model, evidence=[model.names[-1]])
    level = [panel.draw.keywords["maps"][0].level for panel in (still, against)]
    assert np.abs(level[0]).max() == 0
    assert np.nanmax(level[1]) > 6  # four times as new: 12 dB where it knocks
    name = "acc.angle_000_010.band_"
    cells = [i for i, n in enumerate(model.names) if n.startswith(name)]
    mean = np.array(model.card.healthy_features.mean)
    np.testing.assert_allclose(level[1][:, 0], (own - mean)[cells])
    assert "the machine's healthy" in still.caption
    assert [p.caption.split(":")[0] for p in report_pictures(found, model, graded=True)] == [
        "What moved", "Spectrum",
    ]  # fmt: skip


def test_pictures_and_zone_are_of_the_readings_that_were_judged(model, monkeypatch):
    """Of a sensor that a person told to read twice too much: not twice, as the estimate."""
    plain = recording_of(2.5e-4, signal=np.tile(knocking(2.5e-4, 0), 4))
    doubled = dataclasses.replace(plain, signal=plain.signal * np.float32([[2], [1]]))
    pump = wearstate.load_scene("bilge-pump")
    sensor = pump.sensors[0].model_copy(update={"name": "acc", "gain": 2.0})
    known = pump.model_copy(update={"sensors": (sensor,)})
    plate = Nameplate(scene=known, set_paths=frozenset({"sensors.0.gain"}))
    table, wanted = (
        report_table(each, model, graded(), machine="reciprocating-2", plate=known)
        for each, known in ((doubled, plate), (plain, None))
    )
    assert table["iso"] == wanted["iso"]
    assert table["iso"]["channels"]
    drawn = []

    def draw(seen, *_, **__):
        drawn.append(seen.signal)
        return []

    monkeypatch.setattr(page_module, "report_pictures", draw)
    parts = {"recording": doubled, "model": model, "estimate": graded(), "table": table}
    Report(**parts, plate=plate).html()
    [signal] = drawn
    np.testing.assert_array_equal(signal, plain.signal)


def test_a_force_shows_its_transfer_functions():
    """With an input channel the response to it stands between what moved and the spectrum."""
    rng = np.random.default_rng(3)
    force = 50 * rng.standard_normal(4 * N)
    wave, tacho = np.tile(knocking(2e-4, 0), 4)
    channels = (CHANNELS[0], Channel(name="shaker", unit="N", quantity="force"), CHANNELS[1])
    found = recording_of(
        2e-4, signal=np.stack([wave + 0.01 * force, force, tacho]), channels=channels
    )
    shown_first = report_pictures(found, graded=True)[0]
    assert shown_first.caption.startswith("Transfer function over shaker: H1 of")
    assert "95 % confidence" in shown_first.caption
    assert [p.caption.split(":")[0] for p in report_pictures(found, graded=False)] == [
        "Waveform", "Spectrum",
    ]  # fmt: skip


def test_provenance_tells_files_and_samples(model, model_file, tmp_path):
    import hashlib

    data = written(tmp_path / "one.h5", [2.5e-4])
    with DataSet(data) as opened:
        found = opened[0]
    files = {"recording": data, "model": model_file}
    baseline = Baseline(features=np.zeros(len(model.names)), recordings=3, source="healthy.h5")
    told = report_table(found, model, graded(), files=files, baseline=baseline)["provenance"]
    assert told["recording"]["file_sha256"] == hashlib.sha256(data.read_bytes()).hexdigest()
    assert told["model"]["file_sha256"] == hashlib.sha256(model_file.read_bytes()).hexdigest()
    samples = hashlib.sha256(found.signal.tobytes()).hexdigest()
    assert told["recording"]["samples_sha256"] == samples
    assert told["model"]["split_seed"] == 0
    assert told["baseline"] == {"source": "healthy.h5", "recordings": 3}


# --- against healthy recordings of the machine


@pytest.fixture(scope="module")
def referenced(tmp_path_factory):
    """Model of 60 synthetic machines, each against two healthy recordings; and the healthy set."""
    folder = tmp_path_factory.mktemp("referenced")
    data = written(folder / "data.h5", np.geomspace(4e-5, 4.5e-4, 60), groups=range(60))
    healthy = written(folder / "healthy.h5", [4e-5] * 120, groups=np.repeat(range(60), 2), seed=1)
    path = folder / "model.wsm"
    model = train_model(data, held_out=0.0, baseline=healthy)[0]
    save_model(model, path)
    row = np.array(model.card.healthy_features.mean)
    assert load_model(path).judge(row + 1, row) == model.judge(row + 1, row)
    return path, healthy


def test_a_referenced_model_needs_the_machine_itself(referenced, tmp_path):
    """Every sentence on the baseline: none, the right one, of other machines, of worn ones."""
    model_file, healthy = referenced
    worn = written(tmp_path / "worn.h5", [2.5e-4], groups=[7], seed=3)
    args = ("report", worn, "--model", model_file, "--record", 0)
    said = " ".join(run(*args, code=2).stdout.split())
    assert "give --baseline healthy.h5" in said
    assert "Verdict Healthy reference missing: no grade is given" in said
    assert "Unusable" not in said
    assert "need not be repeated" in said
    whole = run("report", healthy, "--model", model_file, code=2).stdout.splitlines()[0]
    assert whole == ("healthy.h5: no grade is given, 120 recordings: 120 without healthy reference")
    page = tmp_path / "r.html"
    told = json.loads(run(*args, "--baseline", healthy, "-o", page, "--json").stdout)
    assert told["estimate"]["mode"] == "referenced"
    # of 60 machines 11 % of severity apart; wide of the mark is a wrong reference
    assert told["estimate"]["severity"] == pytest.approx(2.5e-4, rel=0.15)
    assert told["provenance"]["baseline"] == {"source": str(healthy), "recordings": 2}
    assert told["baseline_note"] == ""
    assert "largest deviation from the machine&#39;s healthy recordings" in shown(page.read_text())
    stranger = written(tmp_path / "other.h5", [2.5e-4], groups=[60], seed=3)
    said = run("report", stranger, *args[2:], "--baseline", healthy, code=2).stderr
    wanted = 'must have some of machine 60 of recipe "knocking", seed 0, the machine of other.h5[0]'
    assert wanted in said
    said = run(*args, "--baseline", page, code=2).stderr
    assert "must be a data set (.h5); make one of the healthy recordings" in said
    said = run(*args, "--baseline", worn, code=2).stderr
    assert "1 of 1 recordings have a grade above 0, must be of a healthy machine" in said


def test_another_model_uses_the_healthy_recordings_as_well(referenced, model_file, tmp_path):
    """A referenced second model is not told to ask for what was given."""
    second, healthy = referenced
    worn = written(tmp_path / "worn.h5", [2.5e-4], groups=[7], seed=3)
    args = ("report", worn, "--model", model_file, "--also", second, "--record", 0, "--json")
    alone = json.loads(run(*args).stdout)["other_model"]
    assert "give --baseline healthy.h5" in alone["text"]
    other = json.loads(run(*args, "--baseline", healthy).stdout)["other_model"]
    assert other["reasons"] == []
    assert other["severity"] == pytest.approx(2.5e-4, rel=0.15)  # as above


def test_each_machine_of_a_batch_has_its_own_baseline(referenced, tmp_path):
    model_file, healthy = referenced
    model = load_model(model_file)
    data = written(tmp_path / "some.h5", [2e-4, 3e-4, 2e-4], groups=[3, 5, 60], seed=4)
    baselines = Baselines(healthy, model.card)
    with recordings_in(data) as items:
        batch = judge_all(data, items, model, baselines=baselines)
        page = batch_html(batch, model, baselines=baselines)
        alone = model.estimate(items[1].load(), baselines.of(items[1].load()))
        own, other = (baselines.of(item.load()) for item in items[:2])
    rows = {row.machine: row for row in batch.rows}
    assert rows["5"].estimate.severity == alone.severity
    assert not np.array_equal(own.features, other.features)
    assert rows["60"].estimate.verdict == "unusable"
    assert "must have some of machine 60" in rows["60"].note
    assert "some.h5[1]" in shown(page)


def test_measured_files_without_a_common_name_are_of_one_machine(referenced, tmp_path):
    """Imported healthy files are a group each, unless named; the caller says they are of one."""
    model = load_model(referenced[0])
    own = {"origin": "measured", "recipe": ""}
    healthy = written(tmp_path / "h.h5", [4e-5] * 3, groups=range(3), seed=5, **own)
    assert Baselines(healthy, model.card).of(recording_of(1e-4)).recordings == 3
    one = written(tmp_path / "one.h5", [4e-5] * 3, groups=[8] * 3, seed=5)
    assert Baselines(one, model.card).of(recording_of(1e-4)).recordings == 3


def test_machines_are_paired_by_identity_and_never_by_number(referenced, tmp_path):
    """A healthy set with the same numbers, but of other machines or of none that it names."""
    model_file, _ = referenced
    twelve = {"clearances": [4e-5] * 12, "groups": range(12), "seed": 2}
    made = {"recipe": 'name = "own"'}
    data = written(tmp_path / "data.h5", **twelve | {"clearances": [2e-4] * 12}, **made)
    nameless = written(tmp_path / "nameless.h5", **twelve, origin="measured", recipe="")
    named = written(
        tmp_path / "named.h5", **twelve, origin="measured", recipe="", names=["north"] * 12
    )
    drawn = written(tmp_path / "drawn.h5", **twelve, recipe='name = "other"')
    worn = written(tmp_path / "worn.h5", **twelve | {"clearances": [2e-4] * 12}, **made)
    told = {
        nameless: "12 of 12 records do not name their machine",
        named: "it has machine north; ",
        drawn: 'machine 0 of recipe "other", seed 0',
        worn: "12 of 12 recordings have a grade above 0",
    }
    for other, text in told.items():
        for command in (
            ("train", data, "-o", tmp_path / "m.wsm"),
            ("evaluate", model_file, data, "--quick"),
            ("report", data, "--record", 3, "--model", model_file),
        ):
            said = run(*command, "--baseline", other, code=2).stderr
            assert other.name in said, said
            assert "data.h5" in said or other == worn, said
            assert text in said or command[0] == "report", said
    assert not (tmp_path / "m.wsm").exists()
    said = run("report", data, "--record", 3, "--model", model_file, "--baseline", named, code=2)
    assert "has healthy recordings of machine north, must have some of machine 3" in said.stderr


def test_a_model_names_its_own_severity_to_a_set_that_has_another(model_file, tmp_path):
    data = written(tmp_path / "x.h5", [2e-4], column="slack_pin_m", recipe="")
    said = run("evaluate", model_file, data, "--quick", code=2).stderr
    assert f"severities = slack_pin_m, must hold that of the model, {COLUMN};" in said


def test_measured_machines_go_by_the_names_that_they_were_imported_with(referenced, tmp_path):
    """The numbers of the two sets differ: only the names can pair them."""
    model = load_model(referenced[0])
    own = {"origin": "measured", "recipe": ""}
    healthy = written(
        tmp_path / "h.h5", [4e-5] * 3, groups=[0, 0, 1], names=["m0", "m0", "m1"], **own
    )
    worn = written(tmp_path / "w.h5", [2e-4] * 2, groups=[0, 1], names=["m1", "m0"], **own)
    baselines = Baselines(healthy, model.card)
    with DataSet(worn) as data:
        assert [baselines.of(item).recordings for item in data] == [1, 2]
    with pytest.raises(DataError, match=r"2 machines \(machine m0, machine m1\).*of one"):
        baselines.of(recording_of(1e-4))
    lines = run("report", worn, "--model", referenced[0], "--baseline", healthy, "--json").stdout
    assert [json.loads(line)["machine"] for line in lines.splitlines()] == ["m1", "m0"]


def test_faults_of_a_baseline_are_told_once(referenced, tmp_path):
    from scipy.io import wavfile
    from wearstate.datasets.measured.recording import read_recording
    from wearstate.datasets.source.part import SourceOptions
    from wearstate.diagnose.healthy_reference.healthy import baseline_of

    model = load_model(referenced[0])
    wavfile.write(tmp_path / "x.wav", 8000, np.zeros(9000, dtype=np.float32))
    other = read_recording(tmp_path / "x.wav", SourceOptions(unit="g"))
    with pytest.raises(DataError) as caught:
        baseline_of((other for _ in range(1000)), model.card)
    text = str(caught.value)
    assert text.count("8000 Hz") == 1
    assert len(text.splitlines()) <= 4


def test_a_cold_model_tells_the_evidence_against_a_baseline(model, model_file, tmp_path):
    """It graded without one and grades the same with one."""
    data = written(tmp_path / "x.h5", [2.5e-4], seed=3)
    healthy = written(tmp_path / "healthy.h5", [6e-5] * 3, seed=4)
    args = ("report", data, "--model", model_file, "--json")
    without = json.loads(run(*args).stdout)
    given = json.loads(run(*args, "--baseline", healthy).stdout)
    for key in ("verdict", "grade", "severity", "low", "high", "cautions"):
        assert given["estimate"][key] == without["estimate"][key]
    own = Baselines(healthy, model.card).of(recording_of(1e-4)).features
    for item in given["evidence"]:
        assert item["healthy"] == own[model.names.index(item["feature"])]
    assert "the estimate does not use it" in given["baseline_note"]
    assert "no healthy recording of this machine" in without["baseline_note"]


# --- many recordings


@pytest.fixture
def folder(tmp_path):
    """One machine wearing, a dead channel, a damaged file, and files that are no recordings."""
    place = tmp_path / "pump"
    place.mkdir()
    for day, clearance in enumerate(np.linspace(1e-4, 2.6e-4, 9)):
        written(place / f"pump_2024-03-{1 + 3 * day:02d}.h5", [clearance], seed=100 + day)
    written(place / "pump_2024-02-01.h5", [0.9e-4], seed=99)
    (place / "cut.h5").write_bytes((place / "pump_2024-03-01.h5").read_bytes()[:9000])
    (place / "notes.txt").write_text("greased")
    (place / "old.html").write_text("a page")
    (place / ".hidden.h5").write_text("")
    return place


def test_a_broken_file_is_a_row_and_stops_nothing(model, folder):
    with recordings_in(folder) as items:
        assert len(items) == 11
        batch = judge_all(folder, items, model)
        page = batch_html(batch, model)
    names = [row.name for row in batch.rows]
    estimates = [row.estimate for row in batch.rows]
    assert estimates[0].severity == max(each.severity or 0 for each in estimates)
    broken = batch.rows[names.index("cut.h5")]
    assert (broken.estimate.verdict, broken.estimate.grade) == ("unusable", None)
    assert broken.note.startswith("file cannot be read")
    assert batch.counts()["unusable"] == 1
    # what must be acted on, what could not be judged, what is fine
    urgent = [each.grade >= 2 if each.grade is not None else None for each in estimates]
    assert urgent == sorted(urgent, key=[True, None, False].index)
    assert is_self_contained(page)
    assert page.count("<tr>") >= 11
    assert "cut.h5" in shown(page)
    assert "1 unusable" in batch_text(batch)


def test_a_folder_keeps_no_file_open(model, folder):
    """A thousand files would be more than a process may open."""
    fds = Path("/proc/self/fd")
    if not fds.is_dir():
        pytest.skip("no list of open files here")
    before = len(list(fds.iterdir()))
    with recordings_in(folder) as items:
        assert len(list(fds.iterdir())) == before
        judge_all(folder, items, model)
        assert len(list(fds.iterdir())) == before


def test_json_of_a_folder_is_one_object_a_line(folder, model_file, tmp_path):
    page = tmp_path / "all.html"
    done = run("report", folder, "--model", model_file, "--trend", "-o", page, "--json")
    assert "<script" not in page.read_text(encoding="utf-8")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["kind"] for line in lines] == ["recording"] * 11 + ["trend"]
    assert {line["schema_version"] for line in lines} == {2}
    first = next(line for line in lines if line["name"] == "pump_2024-03-01.h5")
    with DataSet(folder / "pump_2024-03-01.h5") as data:
        alone = load_model(model_file).estimate(data[0])
    assert first["estimate"]["severity"] == alone.severity
    outlook = lines[-1]["outlook"]
    found = [
        line["estimate"]["severity"]
        for line in lines[:-1]
        if re.match(r"pump_2024-03-\d\d\.h5", line["name"]) and line["estimate"]["severity"]
    ]
    assert len(found) == 9
    days = np.arange(1, 26, 3)
    slope, start = np.polyfit(days, sorted(found), 1)
    straight = ((3e-4 - start) / slope - days[-1]) * 24
    assert outlook["remaining_low_h"] < straight < outlook["remaining_high_h"]
    # 20 µm in 3 days to 0.3 mm from 0.26 mm: 6 days; the estimates err by some per cent
    assert outlook["remaining_low_h"] < 1.1 * 6 * 24
    assert outlook["remaining_high_h"] > 0.9 * 6 * 24
    assert outlook["clock"] == "calendar"
    assert "Trend of the machine" in page.read_text()


def test_with_times_only_the_latest_counts(model, tmp_path):
    """A joint that was condemned and then renewed is no alarm."""
    data = written(
        tmp_path / "life.h5",
        [2e-4, 2.6e-4, 3.4e-4, 0.6e-4, 0.7e-4, 0.8e-4],
        hours=[0.0, 500.0, 1000.0, 1500.0, 2000.0, 2500.0],
    )
    with recordings_in(data) as items:
        plain = judge_all(data, items, model)
        timed = judge_all(data, items, model, dates="operating_hours")
        page = batch_html(timed, model)
    assert len(plain.current) == 6
    assert max(row.estimate.grade for row in plain.current) == 3
    assert [row.name for row in timed.current] == ["life.h5[5]"]
    assert timed.current[0].estimate.grade == 0
    assert timed.rows[0] == timed.current[0]
    assert timed.trends[""].starts == (0, 3)
    assert "6 recordings; now: 1 as new" in shown(page)
    assert "Worst: life.h5[5], 0 as new. No action" in shown(page)
    assert "3 usable recordings since the last maintenance" in shown(page)
    assert trend_points(timed, "", "the machine").moments == (1250.0,)  # between 1,000 and 1,500


def test_a_trend_to_zoom_in_names_its_recordings(model_file, tmp_path):
    pytest.importorskip("bokeh")
    data = written(tmp_path / "life.h5", np.linspace(1e-4, 2e-4, 6))
    judge = ("report", data, "--model", model_file, "--interactive")
    page, dates = tmp_path / "r.html", tmp_path / "dates.csv"
    dates.write_text("file,hours\n" + "".join(f"life.h5[{i}],{100 * i}\n" for i in range(6)))
    run(*judge, "--dates", dates, "-o", page)
    html = page.read_text(encoding="utf-8")
    assert len(html.encode()) < MOST_BYTES
    item = re.search(r'(?s)id="zoom-item">(.*?)</script>', html)[1]
    blocks = item[item.index('["block"') :]
    told = re.findall(r'"recording: life\.h5\[(\d)\]\\ntime: (\d+) h\\nestimate: ', blocks)
    assert sorted(told) == [(str(i), str(100 * i)) for i in range(6)]
    assert re.search(r'(?s)<div class="pictures still-pictures">.*data:image/png', html)
    dates.write_text("file,hours\n1,100\n2,200\n")  # by record_id: no name of a recording
    refused = run(*judge, "--dates", dates, "-o", tmp_path / "no.html", code=2).stderr
    assert "'life.h5[0]'" in refused


def test_recordings_without_a_date_are_named_as_in_no_trend(model_file, tmp_path):
    data = written(tmp_path / "life.h5", np.linspace(1e-4, 2e-4, 7))
    dates, page = tmp_path / "dates.csv", tmp_path / "r.html"
    rows = [f"life.h5[{i}],2026-0{1 + i}-01\n" for i in range(7)]
    dates.write_text("file,date\n" + "".join(rows))
    judge = ("report", data, "--model", model_file, "--dates", dates, "-o", page)
    assert "Undated" not in run(*judge).stdout
    dates.write_text("file,date\n" + "".join(rows[:5]))
    told = " ".join(run(*judge, "--force").stdout.split())
    assert "Undated 2 of 7 recordings have no time that can be read and are in no trend" in told
    assert "life.h5[5], life.h5[6]; begin the date in a name with the year" in told
    assert "2 of 7 recordings have no time" in shown(page.read_text(encoding="utf-8"))


def test_a_short_life_hastens_the_advice(model, tmp_path):
    """Grade 2 at its beginning, but the limit is 40 h away: a week would be too late."""
    hours = np.arange(12) * 10.0
    data = written(tmp_path / "fast.h5", 2e-6 * hours + 1e-5 * 4, hours=hours)
    with recordings_in(data) as items:
        batch = judge_all(data, items, model, dates="operating_hours")
    [now] = batch.current
    outlook = batch.trends[""].outlook
    # (300 - 260) µm at 2 µm an hour; the estimates err by up to 8 %, 20 µm, 10 h
    assert outlook.remaining_h == pytest.approx(20, abs=10)
    assert outlook.remaining_low_h < outlook.remaining_h < outlook.remaining_high_h
    assert now.advice.horizon.startswith("within")
    assert "can be reached before" in now.advice.sentence


def test_machines_of_a_data_set_are_told_apart(model, tmp_path):
    hours = np.tile(np.arange(6) * 100.0, 2)
    wear = np.concatenate([np.linspace(0.6e-4, 2.6e-4, 6), np.full(6, 0.6e-4)])
    data = written(tmp_path / "two.h5", wear, groups=np.repeat([4, 9], 6), hours=hours)
    with recordings_in(data) as items:
        batch = judge_all(data, items, model, dates="operating_hours")
    assert set(batch.trends) == {"4", "9"}
    assert [row.machine for row in batch.current] == ["4", "9"]
    # (300 - 260) µm at 0.4 µm an hour; the estimates err by up to 8 %, 20 µm, 50 h
    assert batch.trends["4"].outlook.remaining_h == pytest.approx(100, rel=0.5)
    assert batch.trends["9"].outlook.remaining_low_h is None


def test_times_come_from_names_files_tables_and_columns(folder, tmp_path):
    with recordings_in(folder) as items:
        names = [item.name for item in items]
        first, second = names.index("pump_2024-03-01.h5"), names.index("pump_2024-03-04.h5")
        dated = times_of(items, "names")
        assert dated[second] - dated[first] == 72
        assert dated[names.index("cut.h5")] is None
        assert all(time is not None for time in times_of(items, "mtime"))
        table = tmp_path / "dates.csv"
        table.write_text("file,date\npump_2024-03-01.h5,2024-03-01 06:00\n")
        listed = times_of(items, str(table))
        assert listed[first] - dated[first] == 6
        assert sum(time is not None for time in listed) == 1
        with pytest.raises(DataError, match=r"'operating_hours' gives a time to 0 of 11"):
            times_of(items, "operating_hours")


def test_an_empty_folder_is_refused(tmp_path, model_file):
    done = run("report", tmp_path, "--model", model_file, code=2)
    assert "holds 0 recordings" in done.stderr


# --- exit codes


@pytest.mark.parametrize(
    ("verdicts", "fail_on", "code"),
    [
        ([("graded", 3)], None, 0),
        ([("graded", 3)], "alarm", 4),
        ([("caution", 3)], "warning", 4),
        ([("graded", 2)], "warning", 3),
        ([("graded", 2)], "alarm", 0),
        ([("graded", 1)], "warning", 0),
        ([("unfamiliar", None)], None, 0),
        ([("unfamiliar", None)], "alarm", 5),
        ([("unusable", None)], None, 2),
        ([("unusable", None)], "alarm", 2),
        ([("unusable", None), ("graded", 1)], None, 0),
        ([("unusable", None), ("graded", 1)], "alarm", 2),
        ([("unusable", None), ("unfamiliar", None), ("graded", 2)], "warning", 3),
        ([("unfamiliar", None), ("unusable", None), ("graded", 3)], "alarm", 4),
        ([("unfamiliar", None), ("graded", 0)], "warning", 5),
    ],
)
def test_exit_codes(verdicts, fail_on, code):
    assert report_exit(verdicts, fail_on) == code


def test_the_command_goes_all_the_way(tmp_path, model_file):
    data = written(tmp_path / "two.h5", [2.5e-4, 4e-4], seed=7)
    common = ("report", data, "--model", model_file)
    run(*common, "--fail-on", "warning", code=4)  # all records
    run(*common, "--record", 0, "--fail-on", "warning", code=3)
    run(*common, "--record", 1, "--fail-on", "alarm", code=4)
    run(*common, code=0)
    assert "--trend and --dates" in run(*common, "--record", 0, "--trend", code=2).stderr
    assert "must be one of" in run(*common, "--machine", "mill", code=2).stderr
    page = tmp_path / "r.html"
    told = json.loads(run(*common, "--record", 1, "-o", page, "--json").stdout)
    assert told["html"] == str(page)
    assert told["provenance"]["recording"]["file_sha256"]
    assert millimetres(told["estimate"]).startswith("0.4")


def test_a_recording_that_does_not_fit_is_bad_input(tmp_path, model_file):
    from scipy.io import savemat

    savemat(tmp_path / "x.mat", {"acc": knocking(2e-4, 0)[0]})
    args = ("report", tmp_path / "x.mat", "--model", model_file, "--fs", FS, "--unit", "m/s^2")
    done = run(*args, code=2)
    assert "Unusable recording" in done.stdout
    assert "tacho" in done.stdout


def test_a_report_without_a_page_loads_neither_trainers_nor_pictures(tmp_path, model_file):
    """A cold report of 3 s has no room for it."""
    data = written(tmp_path / "one.h5", [2.5e-4])
    code = (
        "import sys\nfrom wearstate.diagnose.command_line.cli import main\n"
        f"try: main(['report', {str(data)!r}, '--model', {str(model_file)!r}])\n"
        "except SystemExit: pass\n"
        "print('heavy:', *{'sklearn', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "heavy:"


def test_arrays_and_tables_with_a_rate_are_judged_as_recordings(small_model):
    recording = wearstate.simulate("bilge-pump", seed=4)
    # an array counts as measured, of a machine that nobody has described
    wanted = wearstate.report(recording, small_model, scene="bilge-pump").estimate
    table = pd.DataFrame({name: recording[name] for name in reversed(recording.names)})
    for given in (recording.signal, table):
        rate = recording.sample_rate
        found = wearstate.report(given, small_model, fs=rate, scene="bilge-pump")
        assert found.estimate == wanted
    for given, fs, message in (
        (recording.signal, None, "fs = None must be given"),
        (recording.signal[:2], 25_600.0, "must be .3 channels"),
        (table[["acc_x"]], 25_600.0, "column 'tacho' must be there"),
        (recording, 25_600.0, "the recording has its own"),
    ):
        with pytest.raises(DataError, match=message):
            wearstate.report(given, small_model, fs=fs)


def test_a_report_is_drawn_with_and_without_a_grade(small_model):
    recording = wearstate.simulate("bilge-pump", seed=4)
    found = wearstate.report(recording, small_model)
    axes = found.plot()
    assert len(axes) == 1 + len(recording.channels)
    assert axes[0].get_title() == found.table["headline"]
    [marked] = [bar.lines[0].get_xdata() for bar in axes[0].containers]
    assert marked == pytest.approx([1e3 * found.estimate.severity])
    silent = wearstate.report(0 * recording.signal, small_model, fs=25_600.0)
    axes = silent.plot()
    assert silent.estimate.severity is None
    assert axes[0].get_title() == silent.table["headline"]
    assert not axes[0].axison
    pyplot.close("all")
