"""Matrices whose rows are records of one channel."""

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import savemat
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured.data_set import import_recordings
from wearstate.datasets.measured.labels import read_labels
from wearstate.datasets.measured.recording import read_recording
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source.part import SourceOptions
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.output.recording import DataError

MATRIX = np.random.default_rng(7).standard_normal((180, 60))
"""More rows than columns: without the option, 60 channels of 180 samples."""


def written(folder, kind):
    path = folder / f"m.{kind}"
    if kind == "npy":
        np.save(path, MATRIX)
    elif kind == "npz":
        np.savez(path, m=np.asfortranarray(MATRIX))
    elif kind == "mat":
        savemat(path, {"m": MATRIX})
    elif kind == "h5":
        with h5py.File(path, "w") as file:
            file["m"] = MATRIX
    elif kind == "txt":
        lines = "\n".join(f"row{i} " + " ".join(map(repr, row)) for i, row in enumerate(MATRIX))
        path.write_text(lines.replace("np.float64(", "").replace(")", "") + "\n")
    else:
        np.savetxt(path, MATRIX, delimiter=",", fmt="%.17g")
    return path


OPTIONS = {"rows": "records", "fs": 600.0, "unit": "m/s^2"}


@pytest.mark.parametrize("kind", ["npy", "npz", "mat", "h5", "csv", "txt"])
def test_every_row_is_a_record(tmp_path, kind):
    path = written(tmp_path, kind)
    made = import_recordings([path], tmp_path / "o.h5", options=SourceOptions(**OPTIONS))
    assert (made.n_records, made.n_groups, made.duration) == (180, 1, 0.1)
    with DataSet(tmp_path / "o.h5") as data:
        assert data[0].names == ("m",)
        signals = np.array([data[i].signal[0] for i in range(180)])
        np.testing.assert_allclose(signals, MATRIX, rtol=1e-6)
        assert data.manifest["row_in_file"].tolist() == list(range(180))
        assert (data.manifest["start_s"] == 0).all()
    one = read_recording(path, SourceOptions(**OPTIONS, record=171))
    np.testing.assert_allclose(one.signal[0], MATRIX[171], rtol=1e-6)
    with pytest.raises(DataError, match=r"record = 180 must be >= 0 and < 180, its rows"):
        read_recording(path, SourceOptions(**OPTIONS, record=180))


def test_rows_are_cut_and_resampled_each_by_itself(tmp_path):
    path = written(tmp_path, "npy")
    options = SourceOptions(**OPTIONS)
    made = import_recordings([path], tmp_path / "o.h5", options=options, segment=25 / 600)
    assert made.n_records == 360
    assert made.left_over == {"m.npy": pytest.approx(180 * 10 / 600)}
    with DataSet(tmp_path / "o.h5") as data:
        np.testing.assert_allclose(data[3].signal[0], MATRIX[1, 25:50], rtol=1e-6)
        assert data.manifest["row_in_file"].tolist()[:4] == [0, 0, 1, 1]
        assert data.manifest["start_s"].tolist()[1] == pytest.approx(25 / 600)
    slower = SourceOptions(**OPTIONS, resample_to=300.0)
    import_recordings([path], tmp_path / "s.h5", options=slower)
    np.save(tmp_path / "row.npy", MATRIX[4])
    alone = SourceOptions(fs=600.0, unit="m/s^2", resample_to=300.0)
    with open_source(tmp_path / "row.npy", alone) as row, DataSet(tmp_path / "s.h5") as data:
        np.testing.assert_allclose(data[4].signal[0], row.read()[0], rtol=1e-6)


def test_several_matrices_are_the_channels_and_columns_may_be_records(tmp_path):
    np.savez(tmp_path / "x.npz", x=MATRIX, y=2 * MATRIX, short=MATRIX[:9])
    options = SourceOptions(**OPTIONS, variable=("x", "y"))
    import_recordings([tmp_path / "x.npz"], tmp_path / "o.h5", options=options)
    with DataSet(tmp_path / "o.h5") as data:
        assert data[0].names == ("x", "y")
        np.testing.assert_allclose(data[9].signal, [MATRIX[9], 2 * MATRIX[9]], rtol=1e-6)
    with pytest.raises(DataError, match="x has 180 records, short has 9 records"):
        read_recording(tmp_path / "x.npz", SourceOptions(**OPTIONS, variable=("x", "short")))
    np.save(tmp_path / "t.npy", MATRIX.T)
    options = SourceOptions(**OPTIONS, order="interleaved", record=3)
    one = read_recording(tmp_path / "t.npy", options)
    np.testing.assert_allclose(one.signal[0], MATRIX[3], rtol=1e-6)


def test_lines_of_100_kilobyte_are_records(tmp_path):
    wide = np.random.default_rng(1).standard_normal((5, 5000))
    np.savetxt(tmp_path / "w.csv", wide, delimiter=",")
    options = SourceOptions(**OPTIONS, record=4)
    np.testing.assert_allclose(
        read_recording(tmp_path / "w.csv", options).signal[0], wide[4], rtol=1e-6
    )


def test_what_does_not_fit_rows_is_refused(tmp_path):
    np.save(tmp_path / "x.npy", np.ones((2, 3, 4)))
    with pytest.raises(DataError, match="must have 2 axes for rows = records"):
        read_recording(tmp_path / "x.npy", SourceOptions(**OPTIONS))
    path = written(tmp_path, "csv")
    with pytest.raises(DataError, match="time_column = 1 must not be given with rows"):
        read_recording(path, SourceOptions(**OPTIONS, time_column=1))
    with pytest.raises(DataError, match="record = 3 must not be given with rows = records"):
        import_recordings([path], tmp_path / "o.h5", options=SourceOptions(**OPTIONS, record=3))


def test_the_command_line_takes_rows(tmp_path):
    path = written(tmp_path, "npy")
    given = [str(path), "--rows", "records", "--fs", "600", "--unit", "g"]
    found = CliRunner().invoke(cli, ["import", *given, "--list"])
    assert "180 records of 60 samples at 600 Hz" in found.output
    made = CliRunner().invoke(cli, ["import", *given, "-o", str(tmp_path / "o.h5")])
    assert made.exit_code == 0, made.output
    assert "180 measured records of 0.1 s from 1 file(s)" in made.output


def labelled(folder, text):
    for name in ("a", "b"):
        np.save(folder / f"{name}.npy", MATRIX[:3])
    (folder / "l.csv").write_text(text)
    return {
        "files": [folder / "a.npy", folder / "b.npy"],
        "path": folder / "o.h5",
        "options": SourceOptions(**OPTIONS),
        "labels": read_labels(folder / "l.csv"),
        "segment": 0.05,
    }


ROWS = [("a", 2, "p3", "worn"), ("b", 0, "p1", "new"), ("a", 0, "p1", "new"), ("a", 1, "p2", "new")]
ROWS += [("b", 2, "p3", "worn"), ("b", 1, "p9", "worn"), ("c", 0, "p1", "new")]
TABLE = "file,row_in_file,group,state\n" + "".join(f"{a}.npy,{k},{g},{s}\n" for a, k, g, s in ROWS)


def test_single_rows_have_labels_and_machines_of_their_own(tmp_path):
    made = import_recordings(**labelled(tmp_path, TABLE))
    assert (made.n_records, made.n_groups, made.unused_rows) == (12, 4, 1)  # two segments a row
    with DataSet(tmp_path / "o.h5") as data:
        told = data.manifest[["file", "row_in_file", "group_name", "state"]].to_records(index=False)
    found = [(str(f)[:1], int(k), str(g), str(s)) for f, k, g, s in told]
    assert found == [row for row in sorted(ROWS[:6]) for _ in range(2)]


def test_labels_of_rows_that_do_not_fit_are_told_all_at_once(tmp_path):
    wrong = TABLE.replace("b.npy,1,", "b.npy,3,").replace("a.npy,1,", "a.npy,2,")
    with pytest.raises(DataError) as caught:
        import_recordings(**labelled(tmp_path, wrong))
    for part in (
        "line 7: row_in_file = 3 must be < 3, the rows of b.npy that are records; correct it",
        "lines 2, 5 are all about row 2 of a.npy, must be one; remove the others",
        "has no row for 2 record(s), a.npy 1, b.npy 1; add one",
    ):
        assert part in str(caught.value)
    with pytest.raises(DataError, match=r"row_in_file = '1\.5' must be a whole number >= 0"):
        labelled(tmp_path, TABLE.replace("a.npy,1,", "a.npy,1.5,"))


def test_labels_of_files_are_those_of_all_their_rows(tmp_path):
    import_recordings(**labelled(tmp_path, "file,state\na.npy,new\nb.npy,worn\n"))
    with DataSet(tmp_path / "o.h5") as data:
        assert list(data.manifest["state"]) == ["new"] * 6 + ["worn"] * 6
        assert data.manifest["group"].nunique() == 2
