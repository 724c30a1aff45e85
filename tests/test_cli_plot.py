"""`wearstate info --plot`: pictures of simulated and measured recordings from the command line."""

import json

import numpy as np
import pytest
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.diagnose.command_line.measured import _KINDS
from wearstate.diagnose.inspect.info import plot_file
from wearstate.diagnose.pictures.kinds import AUTO, KINDS
from wearstate.diagnose.report.figures import report_pictures
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel

from .command_line import run

FS = 4096.0


def shaft(t, speed):
    """Readings of two probes and a tacho of a shaft that moves round an ellipse [m, m, V]."""
    x, y = 3e-5 * np.cos(2 * np.pi * speed * t), 1e-5 * np.sin(2 * np.pi * speed * t)
    return np.stack([x + y, x - y, np.where(speed * t % 1 < 0.1, 5.0, 0.0)])


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two records of a shaft between two probes, at 20 and 30 Hz."""
    path = tmp_path_factory.mktemp("plot") / "data.h5"
    names = (("probe_1", "displacement"), ("probe_2", "displacement"), ("tacho", "tacho"))
    channels = tuple(
        Channel(name=name, unit="V" if name == "tacho" else "m", quantity=kind)
        for name, kind in names
    )
    head = Attributes(sample_rate=FS, channels=channels, origin="simulated", tacho="tacho")
    t = np.arange(8192) / FS
    with DataSetWriter(path, head, n_records=2, n_samples=t.size) as writer:
        for index, speed in enumerate((20.0, 30.0)):
            writer.write(index, shaft(t, speed), {"record_id": str(index), "status": "ok"})
        writer.finish()
    return path


def test_the_command_line_knows_every_kind():
    assert (AUTO, *KINDS) == _KINDS


def test_a_record_of_a_data_set(data, tmp_path):
    picture = tmp_path / "p.svg"
    done = run("info", data, "--record", 1, "--plot", picture, "--json")
    plot = json.loads(done.stdout)["plot"]
    assert plot["path"] == str(picture)
    assert plot["drawn"] == ["waveform", "spectrum", "waterfall", "orders", "orbit"]
    assert set(plot["left_out"]) == {"angle", "envelope", "frf"}
    text = run("info", data, "--record", 1, "--plot", picture, "--force").stdout
    assert "plotted      " in text
    assert "not plotted  frf: needs a force channel, has 0 in N" in text
    assert "kind              data set" in text


def test_one_kind_and_one_channel(data, tmp_path):
    picture = tmp_path / "p.png"
    run("info", data, "--kind", "spectrum", "--draw", "probe_2", "--plot", picture)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_measured_file_declares_what_it_needs(tmp_path):
    file, picture = tmp_path / "x.npy", tmp_path / "p.pdf"
    t = np.arange(40_960) / 20_480
    np.save(file, [np.exp(-1500 * (t % (1 / 82.5))) * np.sin(2 * np.pi * 6000 * t)])
    declared = ("--fs", 20_480, "--unit", "g")
    done = run(
        "info", file, *declared, "--kind", "envelope", "--speed-hz", 25, "--bearing", "8,20,120",
        "--plot", picture, "--json",
    )  # fmt: skip
    facts = json.loads(done.stdout)
    assert facts["plot"]["drawn"] == ["envelope"]
    assert facts["sample_rate_hz"] == 20_480
    assert picture.read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--kind", "frf"], "plot options need --plot"),
        (["--draw", "probe_1"], "plot options need --plot"),
        (["--kind", "frf", "--plot", "p.png"], "data.h5[0]: frf needs a force channel"),
        (["--draw", "probe_3", "--plot", "p.png"], "no channel 'probe_3'; did you mean 'probe_"),
        (["--force-channel", "cell", "--plot", "p.png"], "no channel 'cell'"),
        (["--record", "2", "--plot", "p.png"], "must be >= 0 and < 2"),
        (["--bearing", "8,120,20", "--plot", "p.png"], "roller_diameter = 120.0 must be > 0 and <"),
        (["--speed-hz", "-1", "--plot", "p.png"], "must be > 0"),
        (["--plot", "p.jpg"], "must be one of .png, .svg, .pdf"),
    ],
)
def test_bad_input_is_one_message_and_no_file(data, tmp_path, monkeypatch, options, says):
    monkeypatch.chdir(tmp_path)
    done = run("info", data, *options, code=2)
    assert says in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_unasked(data, tmp_path):
    picture = tmp_path / "p.png"
    picture.write_text("mine")
    assert "exists" in run("info", data, "--plot", picture, code=2).stderr
    assert picture.read_text() == "mine"


def test_a_model_has_no_picture(tmp_path):
    with pytest.raises(DataError, match="is a model, must be a recording"):
        plot_file(tmp_path / "a.wsm", tmp_path / "p.png")


def test_measured_bearings_without_a_word_about_the_band(realdata, tmp_path):
    folder = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0"
    if not folder.is_dir():
        pytest.skip("the bearing recordings are not here")
    for name in ("OuterRaceFault_vload_5", "InnerRaceFault_vload_5", "baseline_1"):
        made = plot_file(
            folder / f"{name}.mat", tmp_path / f"{name}.png", bearing=[8, 0.235, 1.245]
        )
        assert made["drawn"] == ["waveform", "spectrum", "waterfall", "envelope"]


def test_the_report_shows_the_same_pictures(data):
    with DataSet(data) as found:
        captions = [picture.caption for picture in report_pictures(found[0], graded=True)]
    assert [caption.split()[0].strip(":,") for caption in captions] == ["Shaft", "Spectrum"]
    channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    other = Recording(signal=np.ones((1, 4096)), sample_rate=FS, channels=(channel,))
    assert len(report_pictures(other, graded=False)) == 2
