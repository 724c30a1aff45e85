"""Headers lose no sample, and channels without a number are left out of every format."""

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import savemat, wavfile
from wearstate.datasets.measured.recording import read_recording
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source.part import SourceOptions
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.output.recording import DataError

ROWS = [f"{0.5 * i},{i}" for i in range(300)]


@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("", ("column_1", "column_2")),
        ("a,b\n", ("a", "b")),
        ("a,b\ng,m/s^2\n", ("a", "b")),
        ("a,b\ng,-\n", ("a", "b")),
        ("a,b\n\n", ("a", "b")),
        ("# made by hand\n# a,b\n", ("a", "b")),
        ("% 1,2\n", ("1", "2")),
        ("Record 12\n", ("column_1", "column_2")),
        ("Record 12\nCh 1 (g),Ch 2 (g)\n", ("Ch 1", "Ch 2")),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_header_loses_no_sample(tmp_path, header, names, end):
    text = header + "\n".join(ROWS) + "\n"
    (tmp_path / "x.csv").write_bytes(text.replace("\n", end).encode())
    with open_source(tmp_path / "x.csv", SourceOptions(fs=2.0)) as source:
        assert tuple(channel.name for channel in source.channels) == names
        assert source.n_samples == 300
    (tmp_path / "y.csv").write_bytes((header + "\n".join(ROWS)).encode())
    with open_source(tmp_path / "y.csv", SourceOptions(fs=2.0)) as source:
        assert source.n_samples == 300


def test_a_first_line_of_numbers_is_a_sample(tmp_path):
    (tmp_path / "x.csv").write_text("7,8\n" + "\n".join(ROWS) + "\n")
    with open_source(tmp_path / "x.csv", SourceOptions(fs=2.0, unit="m/s^2")) as source:
        assert source.n_samples == 301
        assert source.read()[:, 0].tolist() == [7.0, 8.0]


SIGNAL = np.vstack([np.arange(90_000.0), np.full(90_000, np.nan), np.ones(90_000)])


def written(folder, kind):
    path = folder / f"x.{kind}"
    if kind == "npy":
        np.save(path, SIGNAL)
    elif kind == "npz":
        np.savez_compressed(path, x=SIGNAL)
    elif kind == "mat":
        savemat(path, {"x": SIGNAL.T}, do_compression=True)
    elif kind == "h5":
        with h5py.File(path, "w") as file:
            file["x"] = SIGNAL
    elif kind == "wav":
        wavfile.write(path, 1000, SIGNAL.T.astype(np.float32))
    else:
        np.savetxt(path, SIGNAL.T, delimiter=",")
    return path


@pytest.mark.parametrize("kind", ["npy", "npz", "mat", "h5", "wav", "csv"])
def test_a_channel_of_nan_alone_is_left_out_of_every_format(tmp_path, kind, caplog):
    path = written(tmp_path, kind)
    rate = None if kind == "wav" else 1000.0
    with open_source(path, SourceOptions(fs=rate, unit="m/s^2")) as source:
        assert len(source.channels) == 2
        [dead] = source.empty
        np.testing.assert_allclose(source.read(80_000), SIGNAL[::2, 80_000:], rtol=1e-6)
    recording = read_recording(path, SourceOptions(fs=rate, unit="m/s^2"))
    assert dead not in recording.names
    assert f"left out, nothing but NaN: {dead}" in caplog.text
    if kind == "wav":
        return
    with pytest.raises(DataError, match="holds nothing but NaN, must hold numbers"):
        open_source(path, SourceOptions(fs=rate, unit="m/s^2", channels=(f"new={dead}",)))


def test_import_names_what_it_leaves_out(tmp_path):
    path = written(tmp_path, "npy")
    given = [str(path), "-o", str(tmp_path / "o.h5"), "--fs", "1000", "--unit", "g"]
    made = CliRunner().invoke(cli, ["import", *given, "--json"])
    assert made.exit_code == 0, made.output
    assert "left out, nothing but NaN: x_1 in 1 of 1 file(s)" in made.stderr
    assert '"empty": {"x.npy": ["x_1"]}' in made.stdout


def test_a_gap_is_no_dead_channel(tmp_path):
    holed = SIGNAL.copy()
    holed[1, 40_000] = 1.0
    np.save(tmp_path / "x.npy", holed)
    with (
        open_source(tmp_path / "x.npy", SourceOptions(fs=1.0, unit="g")) as source,
        pytest.raises(DataError, match="channel 'x_1' is nan at index 0"),
    ):
        source.read()
