"""The command line: results, exit codes, one clear message per bad input, nothing half-written."""

import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.record import DataSet
from wearstate.diagnose.cli import cli


def run(*arguments, code=0):
    result = CliRunner().invoke(cli, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    return result


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
        "import sys\nfrom wearstate.diagnose.cli import cli\n"
        "heavy = {'numpy', 'scipy', 'numba', 'pandas', 'sklearn', 'matplotlib', 'h5py'}\n"
        "heavy |= {'pydantic', 'rich', 'joblib'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_scene_list_show_check(tmp_path):
    scenes = json.loads(run("scene", "list", "--json").stdout)["scenes"]
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
    assert json.loads(done.stdout)["numerics"]["rung_joint"] == "compliant"
    assert picture.read_bytes().startswith(b"\x89PNG")
    with DataSet(file) as data:
        assert data.manifest["diametral_clearance_crankpin_m"][0] == pytest.approx(0.2e-3)
        assert data.manifest["grade"][0] == 1
        assert data.truth(0)["pin_offset_m"].shape == (data[0].signal.shape[1], 2)
    assert "simulated" in run("info", file).stdout
    table = json.loads(run("report", file, "--model", small_model, "--json").stdout)
    assert table["schema_version"] == 1
    assert table["estimate"]["verdict"] == "graded"
    assert "trained on simulation" in table["notice"]


def test_generate_features_train_evaluate_report(tmp_path, small_set):
    for suffix in ("parquet", "csv", "h5"):
        run("features", small_set, "-o", tmp_path / f"table.{suffix}", "-j", 1)
    with h5py.File(tmp_path / "table.h5") as file:
        assert {len(column) for column in file.values()} == {120}
    model = tmp_path / "model.wsm"
    held_out = json.loads(run("train", small_set, "-o", model, "-j", 1, "--json").stdout)[
        "held_out"
    ]
    judged = json.loads(run("evaluate", model, small_set, "-j", 1, "--json").stdout)
    assert judged["mae_m"] == pytest.approx(held_out["mae_m"])
    page = tmp_path / "report.html"
    text = run("report", small_set, "--record", 5, "--model", model, "-o", page).stdout
    assert "Notice      trained on simulation" in text
    html = page.read_text()
    assert html.count("data:image/png;base64,") == 4
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
    result = json.loads(run("verify", "--json").stdout)
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
    refused("scene", "check", tmp_path / "empty.toml", says=["machine = None"])
    refused("simulate", "bilge-pump", "--set", "drive.speed", says=["must read PATH=VALUE"])


def test_outputs_are_not_overwritten_nor_half_written(tmp_path, small_set, small_model):
    there = tmp_path / "there"
    there.write_text("mine")
    for command in (
        ("generate", "bilge-pump-small", "-n", 1, "-o", there),
        ("features", small_set, "-o", there),
        ("train", small_set, "-o", there),
        ("report", small_set, "--model", small_model, "-o", there),
        ("simulate", "bilge-pump", "-o", there),
        ("simulate", "bilge-pump", "--plot", there),
    ):
        refused(*command, says=["exists"])
        assert there.read_text() == "mine"
    refused("simulate", "bilge-pump", "-o", tmp_path / "no" / "x.h5", says=["is no folder"])
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


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
    refused("report", tmp_path / "none.h5", "--model", small_model, says=["is no file"])
    refused("report", small_set, "--model", tmp_path / "none.wsm", says=["is no file"])
    assert not (tmp_path / "m.wsm").exists()


def test_a_recording_with_nan_or_shorter_than_a_revolution(tmp_path, small_model):
    from scipy.io import savemat

    wave = np.random.default_rng(0).standard_normal(5000)
    wave[17] = np.nan
    savemat(tmp_path / "nan.mat", {"bearing": {"gs": wave, "sr": 25600.0, "rate": 25.0}})
    refused("report", tmp_path / "nan.mat", "--model", small_model, says=["1 sample", "index 17"])
    short = tmp_path / "short.h5"
    run("simulate", "bilge-pump", "--set", "duration=0.21 s", "-o", short)
    refused("report", short, "--model", small_model, says=["tacho"])


def test_record_number_out_of_range(small_set, small_model):
    refused("report", small_set, "--model", small_model, "--record", 500, says=["500", "120"])


def test_a_read_only_folder_is_one_message(tmp_path, small_set):
    if os.geteuid() == 0:
        pytest.skip("root may write anywhere")
    tmp_path.chmod(0o500)
    refused("features", small_set, "-o", tmp_path / "t.csv", says=["t.csv"])
