"""What a file holds beside an array: a rate with or without a unit, the unit of a struct's data."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source.part import Profile, SourceOptions
from wearstate.sim.output.recording import DataError

WAVE = np.sin(np.arange(300.0))
LIKE = Profile(source="pump.wsm", channels=("x",), units={"x": "g"}, sample_rate=2000.0)


def matlab(path, **beside):
    savemat(path.with_suffix(".mat"), {"x": WAVE, **beside})
    return path.with_suffix(".mat")


def archive(path, **beside):
    np.savez(path.with_suffix(".npz"), x=WAVE, **beside)
    return path.with_suffix(".npz")


def hdf5(path, **beside):
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        file["x"] = WAVE
        file["x"].attrs.update(beside)
    return path.with_suffix(".h5")


WRITERS = pytest.mark.parametrize("write", [matlab, archive, hdf5])


@WRITERS
def test_a_rate_without_a_unit_is_told_and_not_taken(write, tmp_path):
    path = write(tmp_path / "a", fs=1000.0)
    with open_source(path, SourceOptions(unit="g")) as source:
        assert source.sample_rate is None
        [told] = source.undeclared
    assert "it holds fs = 1000 without a unit: give fs = 1000 if that is in Hz" in told


@WRITERS
def test_a_name_that_says_hertz_declares_the_rate(write, tmp_path):
    with open_source(write(tmp_path / "a", sample_rate_hz=1000.0)) as source:
        assert source.sample_rate == 1000.0


@WRITERS
def test_the_rate_of_a_model_stands_for_no_other(write, tmp_path):
    with pytest.raises(DataError, match=r"2000 Hz of pump.wsm .* but it holds fs = 1000 without"):
        open_source(write(tmp_path / "a", fs=1000.0), SourceOptions(like=LIKE))
    with open_source(write(tmp_path / "b", fs=2000.0), SourceOptions(like=LIKE)) as source:
        assert source.sample_rate == 2000.0


def test_structs_say_the_unit_of_their_data_and_the_nearest_rate(tmp_path):
    data = {"data": WAVE, "unit": "g"}
    rig = {"x": {**data, "fs_hz": 500.0}, "y": data, "z": {**data, "t": WAVE}, "fs_hz": 250.0}
    path = tmp_path / "a.mat"
    savemat(path, {"rig": rig})

    def told(name):
        with open_source(path, SourceOptions(variable=name)) as source:
            return source.sample_rate, source.channels[0].unit_in_file

    assert told("rig.x.data") == (500.0, "g")
    assert told("rig.y.data") == (250.0, "g")
    assert told("rig.z.data") == (250.0, "")  # of the data or of the times
