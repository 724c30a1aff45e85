"""The command line: results, exit codes, one clear message per bad input, nothing half-written."""

import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.recipe.text import recipe_text
from wearstate.diagnose.pages.plain_json import json_text
from wearstate.diagnose.workflow import demo
from wearstate.sim.output.recording import DataError

from .command_line import run


def strict(text):
    """Parse JSON; a NaN or an infinity is none."""
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


def refused(*arguments, says):
    """Exit 2, nothing on stdout, one message that holds all of `says`."""
    result = run(*arguments, code=2)
    assert result.stdout == ""
    for text in says:
        assert text in result.stderr
    assert "Traceback" not in result.stderr
    return result.stderr


# --- results ------------------------------------------------------------------------------------


def test_module_and_script_are_the_same_program():
    command = [sys.executable, "-m", "wearstate", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("wearstate, version")


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom wearstate.diagnose.command_line.cli import cli\n"
        "heavy = {'numpy', 'scipy', 'numba', 'pandas', 'sklearn', 'matplotlib', 'h5py'}\n"
        "heavy |= {'pydantic', 'rich', 'joblib'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_scene_list_show_check(tmp_path):
    scenes = strict(run("scene", "list", "--json").stdout)["scenes"]
    assert {"bilge-pump", "slider-crank-benchmark"} <= set(scenes)
    text = run("scene", "show", "bilge-pump").stdout
    (tmp_path / "mine.toml").write_text(text)
    assert "no fault" in run("scene", "check", tmp_path / "mine.toml").stdout


def test_simulate_writes_a_recording_that_info_and_report_read(tmp_path, small_model):
    file, picture = tmp_path / "rec.h5", tmp_path / "rec.png"
    done = run(
        "simulate", "bilge-pump", "--set", "joint.crankpin.diametral_clearance=0.2mm",
        "--seed", 3, "-o", file, "--plot", picture, "--truth", "--json",
    )  # fmt: skip
    assert strict(done.stdout)["numerics"]["rung_joint"] == "compliant"
    assert picture.read_bytes().startswith(b"\x89PNG")
    with DataSet(file) as data:
        assert data.manifest["diametral_clearance_crankpin_m"][0] == pytest.approx(0.2e-3)
        assert data.manifest["grade"][0] == 1
        assert data.truth(0)["pin_offset_m"].shape == (data[0].signal.shape[1], 2)
    assert "simulated" in run("info", file).stdout
    table = strict(run("report", file, "--model", small_model, "--json").stdout)
    assert table["schema_version"] == 2
    assert table["estimate"]["verdict"] == "graded"
    assert "trained on simulation" in table["notice"]
    assert any("main bearings" in text for text in table["unseen"])


def test_generate_features_train_evaluate_report(tmp_path, few_set):
    for suffix in ("parquet", "csv", "h5"):
        run("features", few_set, "-o", tmp_path / f"table.{suffix}", "-j", 1)
    with h5py.File(tmp_path / "table.h5") as file:
        assert {len(column) for column in file.values()} == {24}
    model = tmp_path / "model.wsm"
    held_out = strict(run("train", few_set, "-o", model, "-j", 1, "--json").stdout)["held_out"]
    judged = strict(run("evaluate", model, few_set, "-j", 1, "--json").stdout)
    assert judged["mae_m"] == pytest.approx(held_out["mae_m"])
    page = tmp_path / "report.html"
    text = run("report", few_set, "--record", 5, "--model", model, "-o", page).stdout
    assert "Notice      trained on simulation" in text
    assert "Not seen    a crank-pin eye" in text
    html = page.read_text()
    assert html.count("Not seen by this model") == 2
    assert html.count("data:image/png;base64,") == 3
    assert "http://" not in html
    assert "https://" not in html
    assert "<script" not in html


def test_fail_on_tells_grade_and_level(small_set, small_model):
    with DataSet(small_set) as data:
        grades = data.manifest["grade"].to_numpy()
        severity = data.manifest["diametral_clearance_crankpin_m"].to_numpy()
    worst, best = int(np.argmax(severity)), int(np.argmin(severity))
    assert (grades[worst], grades[best]) == (3, 0)
    common = ("report", small_set, "--model", small_model)
    run(*common, "--record", worst, "--fail-on", "warning", code=4)
    run(*common, "--record", worst, "--fail-on", "alarm", code=4)
    run(*common, "--record", worst, code=0)
    run(*common, "--record", best, "--fail-on", "warning", code=0)
    middle = int(np.argmin(np.abs(severity - 0.265e-3)))  # middle of grade 2
    run(*common, "--record", middle, "--fail-on", "warning", code=3)
    run(*common, "--record", middle, "--fail-on", "alarm", code=0)


def test_verify_passes():
    result = strict(run("verify", "--json").stdout)
    assert result["failed"] == 0
    assert len(result["checks"]) >= 14


# --- bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("joint.crankpin.diametral_clearence=0.1mm", ["unknown key", "diametral_clearance"]),
        ("joint.crankpin.diametral_clearance=-0.02mm", ["= -2e-05 m must be >= 0"]),
        ("joint.crankpin.diametral_clearance=70mm", ["0.07 m must be smaller than the pin"]),
        ("drive.speed=0", ["drive.speed = 0 rev/s must be > 0"]),
        ("drive.speed=5 kg", ["has unit 'kg'", "rpm"]),
        ("numerics.step=1ms", ["numerics.step = 0.001 s must be <=", "shorten it"]),
        ("duration=0.1s", ["must be >= one revolution"]),
        ("no.such.thing=1", ["no is an unknown key"]),
    ],
)
def test_bad_scene_values(tmp_path, setting, says):
    refused("simulate", "bilge-pump", "--set", setting, "-o", tmp_path / "x.h5", says=says)
    assert list(tmp_path.iterdir()) == []


def test_bad_scene_files(tmp_path):
    refused("simulate", "bilgepump", says=["did you mean 'bilge-pump'"])
    (tmp_path / "bad.toml").write_text("machine = 'x'\nname = \n")
    refused("scene", "check", tmp_path / "bad.toml", says=["not TOML", "line 2"])
    (tmp_path / "empty.toml").write_text("")
    refused("scene", "check", tmp_path / "empty.toml", says=["machine is missing"])
    refused("simulate", "bilge-pump", "--set", "drive.speed", says=["must read PATH=VALUE"])


def test_outputs_are_not_overwritten_nor_half_written(tmp_path, small_set, small_model):
    for suffix, command in (
        ("h5", ("generate", "bilge-pump-small", "-n", 1, "-o")),
        ("csv", ("features", small_set, "-o")),
        ("wsm", ("train", small_set, "-o")),
        ("html", ("report", small_set, "--model", small_model, "-o")),
        ("hdf5", ("simulate", "bilge-pump", "-o")),
        ("png", ("simulate", "bilge-pump", "--plot")),
    ):
        there = tmp_path / f"there.{suffix}"
        there.write_text("mine")
        refused(*command, there, says=["exists; choose another name or use --force"])
        assert there.read_text() == "mine"
        there.unlink()
    refused("simulate", "bilge-pump", "-o", tmp_path / "no" / "x.h5", says=["is not a folder"])
    assert list(tmp_path.iterdir()) == []


def test_truncated_and_foreign_files(tmp_path, small_set, small_model):
    whole = small_set.read_bytes()
    cut = tmp_path / "cut.h5"
    for length in (100, 5000, len(whole) // 2):
        cut.write_bytes(whole[:length])
        refused("info", cut, says=["cut.h5"])
        refused("report", cut, "--model", small_model, says=["cut.h5"])
        refused("train", cut, "-o", tmp_path / "m.wsm", says=["cut.h5"])
    for name in ("x.mat", "x.h5", "x.wsm"):
        (tmp_path / name).write_bytes(b"not at all" * 50)
        refused("info", tmp_path / name, says=[name])
    refused("report", tmp_path / "x.mat", "--model", small_model, says=["x.mat"])
    refused("report", small_set, "--model", tmp_path / "x.wsm", says=["x.wsm"])
    refused("report", tmp_path / "none.h5", "--model", small_model, says=["no such file"])
    refused("report", small_set, "--model", tmp_path / "none.wsm", says=["no such file"])
    assert not (tmp_path / "m.wsm").exists()


def test_a_recording_with_nan_or_shorter_than_a_revolution(tmp_path, small_model):
    from scipy.io import savemat

    wave = np.random.default_rng(0).standard_normal(5000)
    wave[17] = np.nan
    savemat(tmp_path / "nan.mat", {"bearing": {"gs": wave, "sr": 25600.0, "rate": 25.0}})
    refused(
        "report", tmp_path / "nan.mat", "--model", small_model, says=["'gs' is nan", "index 17"]
    )
    short = tmp_path / "short.h5"
    run("simulate", "bilge-pump", "--set", "duration=0.21 s", "-o", short)
    unusable = run("report", short, "--model", small_model, code=2).stdout
    assert "Unusable recording: no grade is given" in unusable
    assert "record two revolutions or more" in " ".join(unusable.split())


def test_record_number_out_of_range(small_set, small_model):
    refused("report", small_set, "--model", small_model, "--record", 500, says=["500", "120"])


def test_a_folder_that_is_a_file_is_one_message(tmp_path, small_set):
    (tmp_path / "file").write_text("")
    for output in ("file/t.csv", "file/deeper/t.csv"):
        refused("features", small_set, "-o", tmp_path / output, says=["is not a folder; create it"])
    refused("demo", "--folder", tmp_path / "file" / "demo", says=["cannot be made"])
    refused("info", tmp_path / "file" / "x.h5", says=["no such file"])


def test_an_output_is_never_an_input(tmp_path, small_set, small_model):
    data, model = tmp_path / "data.h5", tmp_path / "model.wsm"
    data.write_bytes(small_set.read_bytes())
    model.write_bytes(small_model.read_bytes())
    (tmp_path / "link.h5").symlink_to(data)
    os.link(model, tmp_path / "twin.html")
    recipe = tmp_path / "recipe.h5"
    recipe.write_text("name = 'no matter'")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for command in (
        ("features", data, "-o", data),
        ("features", data, "-o", tmp_path / "." / "link.h5"),
        ("report", data, "--model", model, "-o", tmp_path / "twin.html"),
        ("generate", recipe, "-o", recipe),
        ("simulate", recipe, "-o", recipe),
    ):
        refused(*command, "--force", says=["is also an input"])
        refused(*command, says=["is also an input"])
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_two_outputs_are_two_files(tmp_path):
    picture = tmp_path / "a.png"
    for force in ((), ("--force",)):
        refused(
            "simulate", "bilge-pump", "-o", picture, "--plot", picture, *force,
            says=["given for two outputs"],
        )  # fmt: skip
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("command", "name", "says"),
    [
        (("simulate", "bilge-pump", "-o"), "x.png", ".h5, .hdf5"),
        (("simulate", "bilge-pump", "--plot"), "x.h5", ".png, .svg, .pdf"),
        (("generate", "bilge-pump-small", "-o"), "x", ".h5, .hdf5"),
        (("features", "data.h5", "-o"), "x.txt", ".parquet, .csv, .h5"),
        (("train", "data.h5", "-o"), "x.h5", "one of .wsm"),
        (("report", "data.h5", "--model", "m.wsm", "-o"), "x.wsm", ".html, .htm"),
    ],
)
def test_an_output_has_a_suffix_of_its_kind(tmp_path, command, name, says):
    refused(*command, tmp_path / name, says=["suffix", says, "rename it"])
    (tmp_path / "folder.h5").mkdir()
    refused(*command, tmp_path / "folder.h5", says=["is a folder; name a file in it"])
    refused(*command, "", says=["is empty"])


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (("simulate", "bilge-pump", "--seed", 2**63), "range"),
        (("generate", "bilge-pump-small", "-o", "x.h5", "-n", 10**8 + 1), "range"),
        (("generate", "bilge-pump-small", "-o", "x.h5", "-n", 10**8), "GB; ask for fewer"),
        (("generate", "bilge-pump-small", "-o", "x.h5", "-n", 0), "range"),
        (("train", "x.h5", "-o", "x.wsm", "--held-out", "nan"), "nan must be >= 0 and <= 0.9"),
        (("simulate", "bilge-pump", "--set", "duration=1e9"), "must be <= 3600"),
        (("simulate", "bilge-pump", "--set", "duration=1h"), "must be <= 4 GB"),
        (("simulate", "bilge-pump", "--set", "numerics.step=1e-9"), "must be >= 3.91e-08 s"),
        (("simulate", "bilge-pump", "--set", "drive.speed=1_0"), "drive.speed = '1_0' has unit"),
        (("simulate", "bilge-pump", "--set", "drive.speed=nan"), "has no leading number"),
        (("simulate", "bilge-pump", "--set", f"rod.mass={'9' * 400}"), "inf kg must be finite"),
        (("simulate", "bilge-pump", "--set", "sensors.-1.noise=0"), "does not lead to a value"),
        (("simulate", "bilge-pump", "--set", "drive=1"), "drive = 1 must be a table"),
    ],
)
def test_values_out_of_bounds(tmp_path, monkeypatch, command, says):
    monkeypatch.chdir(tmp_path)
    refused(*command, says=[says])
    assert list(tmp_path.iterdir()) == []


def test_only_a_scene_is_shown(tmp_path):
    (tmp_path / "secret").write_text("password: 1234")
    assert "1234" not in refused("scene", "show", tmp_path / "secret", says=["not TOML"])
    (tmp_path / "other.toml").write_text("name = 'no scene'")
    refused("scene", "show", tmp_path / "other.toml", says=["machine is missing"])
    refused("scene", "show", tmp_path, says=["is a folder, must be a scene"])


def test_force_is_an_option_here_and_an_argument_in_the_library(tmp_path):
    run("generate", "bilge-pump-small", "-n", 1, "-o", tmp_path / "a.h5", "-j", 1)
    (tmp_path / "a.h5").rename(tmp_path / "a.h5.part")
    command = ("generate", "bilge-pump-small", "-n", 2, "-o", tmp_path / "a.h5")
    refused(*command, says=["use --force to restart"])
    (tmp_path / "b.h5").write_text("")
    refused(*command[:-1], tmp_path / "b.h5", says=["use --force to replace it"])


def test_a_failed_simulation_leaves_nothing(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError(28, "No space left on device", str(tmp_path / "x.h5.part"))

    monkeypatch.setattr("wearstate.datasets.file.writer.DataSetWriter.write", fail)
    error = refused("simulate", "bilge-pump", "-o", tmp_path / "x.h5", says=["No space", "x.h5'"])
    assert ".part" not in error
    assert list(tmp_path.iterdir()) == []


def test_a_reader_that_stops_ends_the_program_quietly():
    program = subprocess.Popen(
        [sys.executable, "-m", "wearstate", "scene", "show", "bilge-pump"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    program.stdout.close()  # before anything is written
    assert program.stderr.read() == b""
    program.stderr.close()
    assert program.wait(timeout=60) == 1


def test_no_more_workers_than_four_a_core():
    from wearstate.datasets.workers import local as workers

    assert workers.cores() >= 1
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "cores", lambda: 0.25)  # four times that is one: no process at all
        patch.setattr("joblib.externals.loky.get_reusable_executor", None)
        assert list(workers.in_order(abs, [-1, 2], jobs=10**9)) == [1, 2]


# --- info and demo ------------------------------------------------------------------------------


def test_info_is_si_in_json_and_units_in_text(tmp_path, small_set, small_model):
    data = strict(run("info", small_set, "--json").stdout)
    assert data["sample_rate_hz"] == 25600.0
    assert data["duration_s"] == 4.8
    assert (data["records"], data["machine_draws"]) == (120, 60)
    assert sum(data["grades"].values()) == data["status"]["ok"] == 120
    low, high = data["severity_ranges_m"]["diametral_clearance_crankpin_m"]
    assert 0.05e-3 <= low < 0.06e-3 < 0.4e-3 < high <= 0.465e-3  # the recipe's bounds
    assert data["condemning_limit_m"] == 0.31e-3
    model = strict(run("info", small_model, "--json").stdout)
    assert model["grade_edges_m"] == [0.13e-3, 0.22e-3, 0.31e-3]
    assert all(key == key.lower() and " " not in key for key in [*data, *model])
    assert "grade edges     0.13, 0.22, 0.31 mm" in run("info", small_model).stdout
    assert "sample rate       25600 Hz" in run("info", small_set).stdout


def test_info_tells_who_transforms():
    facts = strict(run("info", "--fft", "--json").stdout)
    assert (facts["kind"], facts["mode"], facts["threads"]) == ("fft", "auto", 1)
    assert facts["pyfftw"] is not None
    chosen = {(c["transform"], c["rows"], c["samples"], c["dtype"]): c for c in facts["choices"]}
    assert chosen["rfft", 3, 25_600, "float32"]["engine"] == "fftw"
    assert chosen["rfft", 600, 256, "float32"]["engine"] == "scipy"
    assert all(0 < c["scipy_s"] < 1 and 0 < c["fftw_s"] < 1 for c in facts["choices"])
    text = run("info", "--fft").stdout
    assert "mode    auto (WEARSTATE_FFT: auto, measure, scipy), one thread" in text
    assert text.count("fftw\n") + text.count("scipy\n") == len(facts["choices"])
    refused("info", says=["give either a FILE or --fft"])
    refused("info", "a.h5", "--fft", says=["give either a FILE or --fft"])


def test_rms_is_that_of_the_vibration_about_its_mean(tmp_path):
    file = tmp_path / "a.h5"
    shown = run("simulate", "bilge-pump", "--set", "duration=0.3 s", "-o", file, "--json").stdout
    with DataSet(file) as data:
        vibration = data[0].vibration
    expected = np.sqrt(np.mean((vibration - vibration.mean(axis=1, keepdims=True)) ** 2, axis=1))
    rms = strict(shown)["rms"]
    assert list(rms) == ["acc_x", "acc_y"]
    # sums of 7,680 floats of 24 bit, in two orders
    assert list(rms.values()) == pytest.approx(expected.tolist(), rel=1e-4)


def test_json_has_null_for_what_is_not_finite():
    text = json_text({"a": float("nan"), "b": [np.float32("inf"), np.int64(3)], "c": (1.5,)})
    assert strict(text) == {"a": None, "b": [None, 3], "c": [1.5]}
    with pytest.raises(TypeError, match="not JSON serializable"):
        json_text({"a": object()})


@pytest.fixture
def tiny_recipe(tmp_path, monkeypatch):
    """24 records of 12 draws, 0.6 s each: as few as can be trained on."""
    text = recipe_text("bilge-pump-small").replace("records = 120", "records = 24")
    path = tmp_path / "tiny.toml"
    path.write_text(f'{text}[fixed]\nduration = "0.6 s"\n')
    monkeypatch.setattr(demo, "RECIPE", str(path))


@pytest.mark.usefixtures("tiny_recipe")
def test_demo_makes_its_files_and_replaces_only_them(tmp_path):
    folder = tmp_path / "out"
    result = strict(run("demo", "--folder", folder, "-j", 1, "--json").stdout)
    assert set(result["seconds"]) == {"generate", "train", "report"}
    assert all(seconds > 0 for seconds in result["seconds"].values())
    names = {"data.h5", "model.wsm", "report.html", demo.MARKER}
    assert {path.name for path in folder.iterdir()} == names
    assert set(result["files"].values()) == {str(folder / n) for n in names - {demo.MARKER}}
    assert result["held_out"]["records"] > 0
    assert run("demo", "--folder", folder, "-j", 1).stdout.startswith("Evaluated on")


def test_demo_leaves_the_files_of_others_alone(tmp_path):
    (tmp_path / "data.h5").write_text("mine")
    refused("demo", "--folder", tmp_path, says=["is not an earlier demo's", "another folder"])
    assert [path.name for path in tmp_path.iterdir()] == ["data.h5"]
    assert (tmp_path / "data.h5").read_text() == "mine"
    refused("demo", "--folder", "", says=["is empty"])


def test_demo_reports_on_an_unseen_record_whatever_its_wear():
    severity = np.array([0.1, 0.2, 0.9, 0.4, 0.5, 0.7])
    assert demo._most_worn(np.array([0, 1, 4]), severity, 0.45) == 1
    assert demo._most_worn(np.array([2, 5]), severity, 0.45) == 5


def test_a_caution_stands_beside_the_verdict_of_the_page(tmp_path, small_model):
    """A speed that the model was not trained on: graded or not, the page must not hide it."""
    file, page = tmp_path / "fast.h5", tmp_path / "fast.html"
    run("simulate", "bilge-pump", "--set", "drive.speed=360 rpm", "-o", file)
    table = json.loads(run("report", file, "--model", small_model, "-o", page, "--json").stdout)
    verdict = page.read_text().split('<div class="verdict"')[1].split("</div>")[0]
    if table["estimate"]["verdict"] == "caution":
        assert "shaft.speed_hz = 6 Hz is outside the trained range" in verdict
    else:
        assert "Unfamiliar" in verdict


def test_the_bounds_of_the_options_are_those_of_the_library():
    """The command line repeats two numbers, because importing them would slow its help."""
    from wearstate.datasets.recipe import records, table
    from wearstate.diagnose.options import shared as module

    assert module.MOST_RECORDS == table.MOST_RECORDS
    assert module.LARGEST_SEED == records.LARGEST_SEED


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("charts.of_models.model_chart", ("chart", "x.h5", "-j", 1)),
        (
            "shaft_tests.before_after.calibrated_test",
            ("align", "propulsion-shaft", "--test", "hammer"),
        ),
        ("wear_model.train.train_model", ("train", "SET", "-o", "m.wsm", "-j", 1)),
        ("workflow.demo.run_demo", ("demo", "-j", 1)),
    ],
)
def test_seed_reaches_whatever_draws(function, arguments, small_set, tmp_path, monkeypatch):
    """Learning, folds, trees and the noise of a simulated test."""
    monkeypatch.chdir(tmp_path)
    seeds = []

    def stop(*_, seed, **__):
        seeds.append(seed)
        raise DataError("enough")

    monkeypatch.setattr(f"wearstate.diagnose.{function}", stop)
    run(*[small_set if a == "SET" else a for a in arguments], "--seed", 7, code=2)
    assert seeds == [7]


def test_a_seed_without_a_draw_is_refused():
    refused("chart", "bilge-pump", "--seed", 7, says=["--seed is for the models"])
    refused("align", "propulsion-shaft", "--seed", 7, says=["--seed need --test"])
