"""`wearstate features`: the list, the sets, single features, what is absent and why."""

import json
from typing import get_args

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from wearstate.datasets.file.record import DataSet
from wearstate.diagnose.command_line.features import _FEATURE_SETS
from wearstate.diagnose.feature_rows.feature_table import choice_of, feature_table
from wearstate.features.catalogue.catalogue import SETS, SetName
from wearstate.features.signal import iso

from .command_line import run


def test_the_sets_of_the_command_line_are_those_of_the_library():
    assert get_args(SetName) == _FEATURE_SETS == tuple(SETS)


def test_list():
    listed = json.loads(run("features", "--list", "--json").stdout)["features"]
    assert [row["name"] for row in listed] == [row.name for row in SETS["complete"]]
    assert set(listed[0]) == {"name", "unit", "needs", "scope", "set", "reference"}
    lines = run("features", "--list").stdout.splitlines()
    assert len(lines) == 1 + len(listed)
    assert lines[0].split() == ["name", "unit", "set", "needs", "reference"]
    [kurtogram] = [line for line in lines if line.startswith("kurtogram ")]
    assert "complete" in kurtogram
    assert "Antoni" in kurtogram
    short = run("features", "--list", "--set", "standard").stdout.splitlines()
    assert len(short) == 1 + len(SETS["standard"])


@pytest.fixture(scope="module")
def table_of(few_set, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")

    def make(*options):
        path = folder / f"{abs(hash(options))}.csv"
        result = run("features", few_set, "-o", path, "-j", 1, "--force", *options)
        return pd.read_csv(path), result

    return make


def test_only(table_of, few_set):
    frame, _ = table_of("--only", "rms, kurtosis", "--only", "acc_x.third_octave_1000.level_db")
    with DataSet(few_set) as data:
        manifest = set(data.manifest.columns)
        first = data[0].vibration
    added = [column for column in frame.columns if column not in manifest]
    assert added == [
        "acc_x.rms",
        "acc_y.rms",
        "acc_x.kurtosis",
        "acc_y.kurtosis",
        "acc_x.third_octave_1000.level_db",
    ]
    # Text of 17 digits of what is summed in single precision.
    assert_allclose(frame["acc_x.rms"][0], first[0].std(dtype=float), rtol=1e-5)


def test_core_with_machine_and_bearing(table_of, few_set):
    frame, result = table_of(
        *("--only", "iso_zone,velocity_rms,bearing_lines,user_bands"),
        *("--machine", "reciprocating-1", "--bearing", "8,0.235,1.245,0", "--band", "500,2000"),
    )
    assert "absent" not in result.stderr
    velocity = 1e3 * frame["acc_x.velocity_rms"]
    zones = np.searchsorted(iso.KINDS["reciprocating-1"].velocity_mm_s, velocity)
    assert (frame["acc_x.iso_zone"] >= zones).all()  # the displacement may be worse
    assert "acc_y.bearing_inner.score" in frame
    assert "acc_y.user_band_500_2000.level_db" in frame


def test_a_set_says_what_is_absent(few_set, tmp_path):
    path = tmp_path / "t.csv"
    result = run("features", few_set, "-o", path, "--set", "core", "--json", "-j", 1)
    absent = json.loads(result.stdout)["absent"]
    assert absent["frf_levels"] == (
        "force channels = 0 must be >= 1; declare the unit N on import, or quantities in Python"
    )
    assert "iso_zone" in result.stderr
    assert "velocity_rms" not in absent
    core = set(pd.read_csv(path).columns)
    assert core >= set(feature_table(few_set, choice=choice_of(only=["entropy"])).names)
    standard = feature_table(few_set).names
    assert core > set(standard)


def test_the_usual_row_says_nothing(table_of):
    _, result = table_of()
    assert result.stderr == ""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--only", "kurtossis"), "feature 'kurtossis' is unknown; did you mean kurtosis?"),
        (("--only", "frf_levels"), "force channels = 0 must be >= 1"),
        (("--set", "core", "--machine", "pump-1-smal"), "did you mean pump-1-small?"),
        (("--bearing", "8,2"), "bearing = [8.0, 2.0] must be a whole number of rollers"),
        (("--bearing", "8,3,2"), "roller_diameter = 3.0 must be > 0 and < pitch_diameter = 2.0"),
        (("--band", "500,100"), "band = [500.0, 100.0] Hz must be two rising numbers"),
        (("--speed-hz", "-1"), "must be > 0 and finite"),
        (("--bearing", "eight"), "must be numbers separated by commas"),
        (("--only", "rms", "--set", "core"), "give either --set or --only"),
        (("--list",), "--list takes no other option"),
        (("--set", "all"), "is not one of"),
    ],
)
def test_bad_choices_are_refused_before_any_work(few_set, tmp_path, options, message):
    result = run("features", few_set, "-o", tmp_path / "t.csv", *options, code=2)
    assert message in result.stderr
    assert not (tmp_path / "t.csv").exists()


def test_all_faults_of_a_choice_at_once():
    with pytest.raises(ValueError, match=r"(?s)envelope_band.*bearing.*speed_hz"):
        choice_of(envelope_band=[1.0], bearing=[8.5, 1, 2], speed_hz=float("nan"))


def test_something_must_be_asked():
    assert "give DATA and --output, DATA and --rank, or --list" in run("features", code=2).stderr
