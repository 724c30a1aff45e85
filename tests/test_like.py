"""`--like`: a profile says what neither the file nor the caller does."""

import json

import numpy as np
import pytest
from wearstate.datasets.file.record import DataSet

from .command_line import run

SIGNAL = np.random.default_rng(3).standard_normal((3, 4000))
SIGNAL[2] = np.arange(4000) % 50 < 5


@pytest.fixture
def folder(tmp_path):
    np.save(tmp_path / "x.npy", SIGNAL)
    profile = {
        "channels": [
            {"name": "a", "unit": "m/s^2", "unit_in_file": "g"},
            {"name": "b", "unit": "m/s^2", "unit_in_file": ""},
            {"name": "shaft", "unit": "-", "quantity": "tacho"},
        ],
        "sample_rate_hz": 1000.0,
        "tacho": "shaft",
        "pulses_per_revolution": 2,
        "kind": "model",
    }
    (tmp_path / "p.json").write_text(json.dumps(profile))
    return tmp_path


def test_import_takes_names_units_rate_and_tacho_from_a_profile(folder):
    like = ("--like", folder / "p.json")
    run("import", folder / "x.npy", "-o", folder / "o.h5", *like)
    with DataSet(folder / "o.h5") as data:
        head = data.attributes
        assert (head.sample_rate, head.tacho, head.pulses_per_revolution) == (1000.0, "shaft", 2)
        assert data[0].names == ("a", "b", "shaft")
        np.testing.assert_allclose(data[0].signal[0], SIGNAL[0] * 9.80665, rtol=1e-6)
        np.testing.assert_allclose(data[0].signal[1], SIGNAL[1], rtol=1e-6)


def test_info_lets_explicit_options_win(folder):
    like = ("--like", folder / "p.json", "--json")
    told = json.loads(run("info", folder / "x.npy", *like).stdout)
    assert (told["sample_rate_hz"], told["tacho"]) == (1000.0, "shaft")
    given = ("--channels", "u,v,w", "--tacho", "w", "--unit", "g")
    told = json.loads(run("info", folder / "x.npy", *like, *given).stdout)
    assert [channel["name"] for channel in told["channels"]] == ["u", "v", "w"]
    other = run("info", folder / "x.npy", *like, "--fs", "2000", code=2)
    assert "sample rate = 2000 Hz must be 1000 Hz, as in p.json" in other.stderr
    assert "give --resample-to 1000" in other.stderr
    slow = run("info", folder / "x.npy", *like, "--fs", "500", code=2)
    assert "resampling upwards adds no bandwidth" in slow.stderr
    assert "resample" not in slow.stderr
    resampled = run("info", folder / "x.npy", *like, "--fs", "2000", "--resample-to", "1000")
    assert json.loads(resampled.stdout)["sample_rate_hz"] == 1000.0


def test_a_file_of_other_channels_than_the_profile_says_whose_they_are(folder):
    np.save(folder / "one.npy", SIGNAL[0])
    told = run("info", folder / "one.npy", "--like", folder / "p.json", code=2).stderr
    assert "--channels = a, b, shaft (of p.json) must name the one channel" in told


def test_a_profile_chooses_the_arrays_that_are_named_after_its_channels(folder):
    np.savez(folder / "x.npz", b=SIGNAL[1], a=SIGNAL[0], shaft=SIGNAL[2], fs=1000.0)
    told = run("info", folder / "x.npz", "--like", folder / "p.json", "--json").stdout
    assert [channel["name"] for channel in json.loads(told)["channels"]] == ["a", "b", "shaft"]


def test_a_profile_that_is_none_is_refused(folder):
    (folder / "q.json").write_text('{"channels": []}')
    found = run("info", folder / "x.npy", "--like", folder / "q.json", code=2)
    assert "sample_rate_hz" in found.stderr
    (folder / "r.json").write_text("{")
    assert "is no JSON" in run("info", folder / "x.npy", "--like", folder / "r.json", code=2).stderr


def test_report_reads_a_file_as_its_model_wants_it(folder, small_model, small_set):
    with DataSet(small_set) as data:
        record = data[0]
    np.save(folder / "pump.npy", record.signal)
    like = ("--model", small_model, "--like", small_model, "--json")
    told = json.loads(run("report", folder / "pump.npy", *like).stdout)
    assert told["estimate"]["verdict"] != "unusable"
