"""What a file calls its channels, and what a caller may call them."""

import numpy as np
import pytest
from scipy.io import savemat
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured.data_set import import_recordings
from wearstate.datasets.measured.plan import EachChannel
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source.part import SourceOptions
from wearstate.diagnose.options.source import BearingNumbers as _Bearing
from wearstate.sim.output.recording import DataError

SIGNAL = np.random.default_rng(5).standard_normal((2, 50))


def values(path, **options):
    with open_source(path, SourceOptions(**options)) as source:
        return source.read()


def test_a_pattern_finds_the_variable_that_every_file_calls_otherwise(tmp_path):
    for number in (105, 106):
        names = {f"X{number}_DE_time": SIGNAL[:1].T, f"X{number}_FE_time": SIGNAL[1:].T}
        savemat(tmp_path / f"{number}.mat", names)
    files = sorted(tmp_path.glob("*.mat"))
    options = SourceOptions(fs=100.0, unit="g", variable=("*_FE_time", "*_DE_time"))
    import_recordings(files, tmp_path / "o.h5", options=options)
    with DataSet(tmp_path / "o.h5") as data:
        assert data[0].names == ("FE_time", "DE_time")
        np.testing.assert_allclose(data[1].signal, SIGNAL[::-1] * 9.80665, rtol=1e-6)
    with pytest.raises(DataError, match="fits X105_DE_time, X105_FE_time, must fit one"):
        values(files[0], variable="*_time")
    with pytest.raises(DataError, match="must be one of its arrays"):
        values(files[0], variable="*_BA_*")


def test_names_of_a_listing_choose_and_rename(tmp_path):
    np.save(tmp_path / "x.npy", SIGNAL)
    np.savetxt(tmp_path / "x.csv", SIGNAL.T, delimiter=",")
    for file, old in (("x.npy", "x_1"), ("x.csv", "column_2")):
        for wanted in (old, f"acc={old}"):
            options = SourceOptions(fs=10.0, unit="m/s^2", channels=(wanted,))
            with open_source(tmp_path / file, options) as source:
                assert [c.name for c in source.channels] == [wanted.partition("=")[0]]
                np.testing.assert_allclose(source.read(), SIGNAL[1:])
    with pytest.raises(DataError, match=r"must name all 2 channels.*or choose of x_0, x_1"):
        values(tmp_path / "x.npy", channels=("a",))


def test_arrays_of_different_stems_are_one_set(tmp_path):
    for name in ("monday", "tuesday"):
        np.save(tmp_path / f"{name}.npy", SIGNAL)
    options = SourceOptions(fs=10.0, unit="g")
    import_recordings(sorted(tmp_path.glob("*.npy")), tmp_path / "o.h5", options=options)
    with DataSet(tmp_path / "o.h5") as data:
        assert data[0].names == ("channel_0", "channel_1")


def text(folder, rows):
    (folder / "x.csv").write_text(rows)
    return folder / "x.csv"


def test_a_column_of_nan_alone_is_left_out(tmp_path):
    rows = "".join(f"{i},nan,{i + 1}\n" for i in range(5000))
    file = text(tmp_path, "a,b,c\n" + rows)
    assert values(file, fs=10.0, unit="g").shape == (2, 5000)
    file = text(tmp_path, "a,b,c\n1,2,3\n" + rows)  # b holds a number: a gap, not a dead channel
    with pytest.raises(DataError, match="channel 'b' is nan"):
        values(file, fs=10.0, unit="g")


def test_a_general_unit_spares_the_times(tmp_path):
    file = text(tmp_path, "time [s],acc\n" + "".join(f"{i / 10},{i}\n" for i in range(20)))
    unit = EachChannel({}, others="m/s^2")
    with open_source(file, SourceOptions(unit=unit)) as source:
        assert (source.sample_rate, source.channels[0].unit) == (10.0, "m/s^2")


def test_a_rate_that_the_times_contradict_is_refused(tmp_path):
    file = text(tmp_path, "time,acc\n" + "".join(f"{i / 10},{i}\n" for i in range(20)))
    for fs in (10.0, 10_000.0):  # as seconds, as milliseconds
        assert values(file, fs=fs, unit="g").shape == (1, 20)
    with pytest.raises(DataError, match="fs = 25600 Hz must fit the times of column 'time'"):
        values(file, fs=25_600.0, unit="g")
    assert values(file, fs=25_600.0, unit="g", time_column=0).shape == (2, 20)


def test_a_bearing_takes_units():
    convert = _Bearing().convert
    assert convert("9,7.94mm,39.04 mm", None, None) == (9.0, 0.00794, 0.03904)
    assert convert("9,7.94mm,39.04mm,15deg", None, None) == (9.0, 0.00794, 0.03904, 15.0)
    assert convert("9,7.94,39.04", None, None) == (9.0, 7.94, 39.04)
    for wrong in ("9,7.94mm,39.04", "9,7.94 kg,39.04 kg"):
        with pytest.raises(Exception, match=r"both diameters|not one of length"):
            convert(wrong, None, None)
