"""`wearstate import` and `report` on measured files: options, words, exit codes."""

import json
import os
import re

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import wavfile
from wearstate.datasets.file.record import DataSet
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.options.shared import as_options
from wearstate.sim.parts.units import STANDARD_GRAVITY

from .command_line import run

RAMP = np.arange(400.0)


def strict(*arguments):
    """JSON on stdout; a NaN or an infinity is none."""
    text = run(*arguments, "--json").stdout
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


def refused(*arguments, says):
    """Exit 2, nothing on stdout, one message that holds all of `says`."""
    result = run(*arguments, code=2)
    assert result.stdout == ""
    for text in says:
        assert text in result.stderr
    return result.stderr


@pytest.fixture
def wavs(tmp_path):
    pulses = np.where(np.arange(400) % 20 == 5, 5.0, 0.0)
    for i, name in enumerate(("one", "two")):
        signal = np.stack([RAMP + i, -RAMP, pulses], axis=1).astype(np.float32)
        wavfile.write(tmp_path / f"{name}.wav", 200, signal)
    return [tmp_path / "one.wav", tmp_path / "two.wav"]


def test_every_option_reaches_the_data_set(wavs, tmp_path):
    path, labels = tmp_path / "x.h5", tmp_path / "l.csv"
    labels.write_text("file,groove_depth_seal [um],side\ntwo.wav,15,left\none.wav,5,right\n")
    done = strict(
        "import", *wavs, "-o", path, "--channels", "x,y", "--channels", "key",
        "--unit", "g", "--unit", "y=V", "--sensitivity", "y=50 mV/(mm/s)", "--tacho", "key",
        "--pulses-per-revolution", 2, "--labels", labels, "--label", "load_n=3 kN",
        "--speed", "300 rpm", "--severity", "groove_depth_seal_m",
        "--limits", "10 um, 20 um, 30 um", "--segment", "500 ms", "--overlap", 0.5, "-j", 1,
    )  # fmt: skip
    assert (done["n_records"], done["n_groups"], done["duration_s"]) == (14, 2, 0.5)
    assert done["severities"] == ["groove_depth_seal_m"]
    assert done["speeds_hz"] == pytest.approx([5.0, 5.0])
    with DataSet(path) as data:
        head, manifest, first = data.attributes, data.manifest, data[1]
    assert [(c.name, c.unit, c.quantity) for c in head.channels] == [
        ("x", "m/s^2", "acceleration"),
        ("y", "m/s", "velocity"),
        ("key", "-", "tacho"),
    ]
    assert head.pulses_per_revolution == 2
    # float32 of a product: two roundings of 6e-8; a volt is 20 mm/s
    assert_allclose(first.signal[0], (RAMP[50:150]) * STANDARD_GRAVITY, rtol=1.2e-7)
    assert_allclose(first.signal[1], -RAMP[50:150] * 0.02, rtol=1.2e-7)
    assert_array_equal(manifest["grade"], [0] * 7 + [1] * 7)
    assert_array_equal(manifest["speed_hz"], 5.0)
    assert_array_equal(manifest["load_n"], 3000.0)
    assert manifest["side"].tolist() == ["right"] * 7 + ["left"] * 7


def test_it_says_what_it_made_and_left_out(wavs, tmp_path):
    options = ("--channels", "x,y,key", "--unit", "g", "--tacho", "key", "--segment", 0.75)
    text = run("import", *wavs, "-o", tmp_path / "x.h5", *options).stdout
    assert "x.h5: 4 measured records of 0.75 s from 2 file(s), 2 group(s)" in text
    assert "x [m/s^2, g in the file], y [m/s^2, g in the file], key [-] at 200 Hz" in text
    assert "severities: none; labels: mean_speed_hz" in text
    assert "tacho shows 10 Hz" in text
    assert "1 s at the end of 2 file(s) fill no record and are left out, at most 0.5 s" in text
    described = run("info", tmp_path / "x.h5").stdout
    assert "measured" in described
    assert "4 of unknown grade" in described
    run("features", tmp_path / "x.h5", "-o", tmp_path / "x.csv", "-j", 1, code=2)  # 10 Hz: too low
    assert not (tmp_path / "x.csv").exists()


def test_twins_and_records_without_pulses_are_said(wavs, tmp_path):
    twin = tmp_path / "twin.wav"
    rate, signal = wavfile.read(wavs[0])
    signal[200:, 2] = 0.0
    wavfile.write(wavs[0], rate, signal)
    twin.write_bytes(wavs[0].read_bytes())
    options = ("--channels", "x,y,key", "--unit", "g", "--tacho", "key", "--segment", 1)
    text = run("import", *wavs, twin, "-o", tmp_path / "x.h5", *options).stdout
    assert "one.wav and twin.wav hold the same record" in text
    assert "2 with status no_tacho_pulses, left out of features" in text


def test_raw_and_text_layouts(tmp_path):
    raw, text = tmp_path / "a.bin", tmp_path / "a.txt"
    blocks = np.stack([RAMP, -RAMP]).astype(">i2")
    raw.write_bytes(b"headline" + blocks.tobytes())
    run(
        "import", raw, "-o", tmp_path / "x.h5", "--dtype", ">int16", "--n-channels", 2,
        "--offset", 8, "--order", "blocks", "--fs", 100, "--unit", "2 mV",
    )  # fmt: skip
    with DataSet(tmp_path / "x.h5") as data:
        assert_allclose(data[0].signal, np.stack([RAMP, -RAMP]) * 2e-3, rtol=1e-7)
    rows = "".join(f"{i:d}|{i},5|{-i},0\n" for i in range(20))
    text.write_text("made by a logger\nno|p|q\n" + rows)
    run(
        "import", text, "-o", tmp_path / "y.h5", "--delimiter", "|", "--decimal", ",",
        "--header", 2, "--time-column", "no", "--unit", "no=ms", "--unit", "g",
    )  # fmt: skip
    with DataSet(tmp_path / "y.h5") as data:
        assert data.attributes.sample_rate == pytest.approx(1000.0)
        assert data[0].names == ("p", "q")
    # by its number a column of times as well
    common = ("--delimiter", "|", "--decimal", ",", "--unit", "no=ms", "--unit", "g")
    run("import", text, "-o", tmp_path / "w.h5", *common, "--time-column", 3, code=2)
    run("import", text, "-o", tmp_path / "w.h5", *common, "--time-column", 1)
    with DataSet(tmp_path / "w.h5") as data:
        assert data[0].names == ("p", "q")
    np.savez(tmp_path / "n.npz", u=RAMP, v=-RAMP, w=np.zeros((3, 2, 30)))
    two = ("--variable", "u", "--variable", "v", "--fs", 10, "--unit", "g")
    run("import", tmp_path / "n.npz", "-o", tmp_path / "z.h5", *two)
    with DataSet(tmp_path / "z.h5") as data:
        assert data[0].signal.shape == (2, 400)


def test_contents_are_listed(wavs, tmp_path):
    np.savez(tmp_path / "n.npz", u=RAMP, v=np.zeros((30, 2)))
    text = run("import", "--list", wavs[0], tmp_path / "n.npz").stdout
    assert "one.wav\n  recording: 400 samples at 200 Hz, 2 s\n    one_0 [not declared], " in text
    assert "n.npz\n  u: 400 samples, rate not declared; u [not declared]\n  v: 30 samples" in text
    found = strict("import", "--list", wavs[0], tmp_path / "n.npz", "--fs", 200)["files"]
    assert [len(item["recordings"]) for item in found] == [1, 2]
    assert found[1]["recordings"][0]["duration_s"] == 2.0
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".npz", ".wav", ".wav"]


def test_a_faulty_file_does_not_hide_the_contents_of_others(wavs, tmp_path):
    cut = tmp_path / "cut.wav"
    cut.write_bytes(wavs[0].read_bytes()[:30])
    text = run("import", "--list", cut, wavs[0]).stdout
    assert re.match(rf"{re.escape(str(cut))}\n  \S.*\n{re.escape(str(wavs[0]))}\n  recording", text)
    found = strict("import", "--list", cut, wavs[0])["files"]
    assert [bool(item["fault"]) for item in found] == [True, False]
    alone = run("import", "--list", cut, code=2)
    assert found[0]["fault"].splitlines()[0] in alone.stderr
    assert alone.stdout == ""


def test_measured_contents(realdata):
    path = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0" / "baseline_1.mat"
    text = run("import", "--list", path).stdout
    assert "bearing.gs: 585936 samples at 97656 Hz, 6 s; gs [g]; speed_hz = 25" in text


def test_errors_name_the_options(wavs, tmp_path):
    path = tmp_path / "x.h5"
    wavfile.write(tmp_path / "int.wav", 200, RAMP.astype(np.int16))
    wavfile.write(tmp_path / "mono.wav", 200, RAMP.astype(np.float32))
    np.savez(tmp_path / "n.npz", u=RAMP, v=RAMP)
    np.save(tmp_path / "n.npy", RAMP)
    (tmp_path / "a.doc").touch()
    unit, three = ("--unit", "g"), ("--channels", "x,y,key")
    for arguments, says in (
        ((wavs[0],), ["channel 'one_0': --unit must be given"]),
        ((tmp_path / "int.wav",), ["--full-scale must be given ('10 V'"]),
        ((tmp_path / "n.npz", *unit), ["--variable must be one of", "choose with --variable"]),
        ((tmp_path / "n.npy", *unit), ["--fs must be given"]),
        ((*wavs, tmp_path / "mono.wav", *unit), ["same channels", "with --channels"]),
        ((*wavs, *unit, *three, "--overlap", 0.5), ["--overlap = 0.5 needs a segment"]),
        ((*wavs, *unit, *three, "--tacho", "kay"), ["did you mean 'key'"]),
        ((*wavs, *unit, *three, "--limits", "bilge-pump"), ["--limits = 'bilge-pump' must be"]),
        ((*wavs, *unit, *three, "--group-by", "column"), ["--group-by = 'column' needs the label"]),
        ((*wavs, *unit, "--unit", "V"), ["cannot all be for every channel"]),
        ((*wavs, "--unit", "=g"), ["must read [CHANNEL=]VALUE"]),
        ((*wavs, "--unit", "x=g", "--unit", "x=V"), ["once per channel"]),
        ((*wavs, *unit, "--label", "load_n"), ["must read NAME=VALUE"]),
        ((*wavs, *unit, "--label", "a=1", "--label", "a=2"), ["once per name"]),
        ((*wavs, *unit, "--segment", "soon"), ["has no leading number", "or write whole"]),
        ((*wavs, "--fs", "nan"), ["--fs = nan Hz must be >= 0.001"]),
        ((*wavs, "--decimal", ","), ["does not fit WAV files"]),
        ((tmp_path / "a.doc",), ["suffix '.doc' must be one of", "--n-channels"]),
    ):
        refused("import", *arguments, "-o", path, says=says)
    refused("import", *wavs, says=["-o/--output must name the data set"])
    refused("import", "-o", path, says=["FILES"])
    assert not list(tmp_path.glob("x.h5*"))


def test_plain_words_are_no_options():
    command = cli.commands["import"]
    for text in (
        "files of one unit and segment; a record of 5 samples",
        "record of 3 has labels and header, order is kept",
        "column 'time_column' is 'fs'",
        "/data/fs/unit.csv: is cut",
    ):
        assert as_options(text, command) == text
    assert as_options("use force to replace it", command) == "use --force to replace it"
    assert as_options("a: fs = 1 Hz must be", command) == "a: --fs = 1 Hz must be"
    assert as_options("give fs = 100 if that is in Hz", command) == "give --fs 100 if that is in Hz"
    assert as_options("use force", None) == "use force"


def test_every_option_of_a_row_is_named_as_one():
    command = cli.commands["import"]
    for text, told in (
        ("give delimiter, decimal and header, or", "give --delimiter, --decimal and --header, or"),
        ("give time_column = 0 and fs if it", "give --time-column 0 and --fs if it"),
        ("none; name it with tacho", "none; name it with --tacho"),
        ("give it, or header and unit", "give it, or header and unit"),
    ):
        assert as_options(text, command) == told


def test_every_fault_of_a_file_is_one_of_the_json(wavs):
    done = run("import", wavs[0], "-o", wavs[0].parent / "x.h5", "--json", code=2)
    error = json.loads(done.stderr.splitlines()[-1])["error"]
    assert error["faults"] == error["message"].split("\n")
    assert len(error["faults"]) == 3


def test_arrays_named_after_the_channels_are_chosen(tmp_path):
    path = tmp_path / "n.npz"
    np.savez(path, acc_x=RAMP, acc_y=-RAMP, tacho=2 * RAMP, other=np.ones(9))
    rate = ("--fs", 10, "--unit", "g")
    run("import", path, "-o", tmp_path / "a.h5", "--channels", "acc_y,x=acc_x", *rate)
    with DataSet(tmp_path / "a.h5") as data:
        assert data[0].names == ("acc_y", "x")
        np.testing.assert_allclose(data[0].signal[1], 9.80665 * RAMP, rtol=1e-6)
    refused("import", path, "-o", tmp_path / "b.h5", "--channels", "acc_x,key", *rate,
            says=["choose with --variable, once for each channel"])  # fmt: skip


def test_inputs_and_outputs_are_kept(wavs, tmp_path):
    path, options = tmp_path / "x.h5", ("--channels", "x,y,key", "--unit", "g")
    path.write_text("mine")
    refused("import", *wavs, "-o", path, *options, says=["exists", "use --force"])
    assert path.read_text() == "mine"
    refused("import", *wavs, "-o", wavs[0], *options, "--force", says=["is also an input"])
    labels = tmp_path / "l.h5"
    labels.write_text("file\n")
    refused("import", *wavs, "-o", labels, "--labels", labels, says=["is also an input"])
    run("import", *wavs, "-o", path, *options, "--force")
    refused("import", path, "-o", tmp_path / "y.h5", says=["is a data set of this program already"])
    part = tmp_path / "y.h5.part"
    part.write_text("hours of another run")
    run("import", *wavs, "-o", tmp_path / "y.h5", *options)
    run("import", *wavs, "-o", tmp_path / "y.h5", *options, "--force")
    assert part.read_text() == "hours of another run"


def test_the_report_on_a_wav_is_that_on_the_simulation(small_set, small_model, tmp_path):
    with DataSet(small_set) as data:
        item = data[7]
    path = tmp_path / "pump.wav"
    wavfile.write(path, int(item.sample_rate), item.signal.T)
    declared = ("--channels", "acc_x,acc_y,tacho", "--unit", "m/s^2", "--tacho", "tacho")
    common = ("--model", small_model)
    ours = strict("report", path, *common, *declared, "--scene", "bilge-pump")
    theirs = strict("report", small_set, "--record", 7, *common)
    assert ours["estimate"] == theirs["estimate"]  # float WAV keeps every bit
    assert ours["estimate"]["verdict"] == "graded"
    assert ours["recording"]["origin"] == "measured"
    refused("report", path, *common, says=["--unit must be given"])
    refused("report", small_set, *common, "--unit", "g", says=["unit must not be given"])
    swapped = strict("report", small_set, "--record", 7, *common, "--channels", "acc_x,acc_y")
    assert swapped["estimate"] == theirs["estimate"]  # its tacho stays
    says = ["has no channel 'acc_z'; choose one of acc_x, acc_y, tacho"]
    refused("report", small_set, "--record", 7, *common, "--channels", "acc_z", says=says)
    plain = run("report", path, *common, *declared[:4], code=2).stdout
    assert "Unusable recording: no grade is given" in plain
    assert "its channel tacho is not named as its tacho; give --tacho tacho" in plain
    assert "it has" not in plain  # nothing else is amiss
    page = tmp_path / "r.html"
    run("report", path, *common, *declared, "-o", page)
    assert "pump.wav: measured" in page.read_text()


def test_file_names_that_are_no_utf8_are_imported(tmp_path):
    """Two such names stay apart."""
    wavfile.write(tmp_path / "a.wav", 1000, np.sin(np.arange(400.0)).astype("f4"))
    paths = [tmp_path / os.fsdecode(b"a" + end + b".wav") for end in (b"\xe9", b"\xe8")]
    for path in paths:
        path.write_bytes((tmp_path / "a.wav").read_bytes())
    command = ["import", *map(str, paths), "-o", str(tmp_path / "o.h5"), "-j", "1"]
    done = CliRunner().invoke(cli, [*command, "--unit", "g", "--channels", "acc"])
    assert done.exit_code == 0, done.output
    with DataSet(tmp_path / "o.h5") as data:
        assert data.manifest["file"].tolist() == ["a\\xe8.wav", "a\\xe9.wav"]
        assert data.manifest["group"].nunique() == 2


def test_a_force_cell_tells_where_and_which_way_it_pushes(wavs, tmp_path):
    """A measured hammer or shaker test, with all that a transfer function needs."""
    path = tmp_path / "x.h5"
    named = ("--channels", "x,force,key", "--unit", "m/s^2", "--unit", "force=N")
    told = ("--place", "force=shaft at forward", "--direction", "force=vertical, up")
    run("import", *wavs, "-o", path, *named, *told, "--tacho", "key")
    with DataSet(path) as data:
        x, force, _ = data.attributes.channels
    assert (force.quantity, force.unit) == ("force", "N")
    assert (force.place, force.direction) == ("shaft at forward", "vertical, up")
    assert x.place == x.direction == ""
    again = ("import", *wavs, "-o", tmp_path / "y.h5", *named, "--tacho", "key")
    error = run(*again, "--place", "forse=a", code=2).stderr
    assert "no channel 'forse' is imported; did you mean 'force'?" in error
    error = run(*again, "--direction", "force", code=2).stderr
    assert "must read CHANNEL=TEXT" in error
