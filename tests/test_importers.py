"""One recording from a file: exact values, and one clear message for everything else."""

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat, savemat, wavfile
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.measured import recording as importers
from wearstate.datasets.measured.plan import EachChannel
from wearstate.datasets.measured.recording import list_contents, read_recording
from wearstate.datasets.source.part import SourceOptions
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel
from wearstate.sim.parts.units import STANDARD_GRAVITY

SIGNAL = np.random.default_rng(0).standard_normal(50)


def read(path, *, tacho=None, pulses_per_revolution=1, **declared):
    options = SourceOptions(**declared)
    return read_recording(path, options, tacho=tacho, pulses_per_revolution=pulses_per_revolution)


@pytest.fixture
def mat(tmp_path):
    path = tmp_path / "bearing.mat"
    bearing = {"gs": SIGNAL[:, None], "sr": 1000.0, "rate": 25, "load": "100"}
    savemat(path, {"bearing": bearing, "BPFO": 81.1}, do_compression=True)
    return path


@pytest.fixture
def wav(tmp_path):
    path = tmp_path / "pump.wav"
    wavfile.write(path, 1000, np.stack([SIGNAL, -SIGNAL], axis=1).astype(np.float32))
    return path


def test_a_known_layout_declares_rate_unit_and_conditions(mat):
    item = read(mat)
    # float32: half an ulp
    assert_allclose(item.signal, [SIGNAL * STANDARD_GRAVITY], rtol=6e-8)
    assert (item.sample_rate, item.units, item.tacho) == (1000.0, {"gs": "m/s^2"}, None)
    # 100 pound-force: 45.359237 kg at 9.80665 m/s^2; a few roundings of a double
    assert_allclose([item.row["speed_hz"], item.row["load_n"]], [25.0, 444.82216152605], rtol=1e-15)
    assert (item.origin, item.source) == ("measured", "bearing.mat")
    assert read(mat, fs=1000.0, unit="g").sample_rate == 1000.0  # said again, not contradicted
    with pytest.raises(DataError, match=r"unit = m/s\^2 must be g \(MFPT bearing"):
        read(mat, unit="m/s^2")


def test_channels_tacho_and_their_units(wav):
    item = read(wav, channels=("acc", "key"), unit="g", tacho="key", pulses_per_revolution=3)
    assert (item.tacho, item.pulses_per_revolution) == ("key", 3)
    assert [(c.name, c.unit, c.quantity) for c in item.channels] == [
        ("acc", "m/s^2", "acceleration"),
        ("key", "-", "tacho"),  # only its edges count: the unit of all is not about it
    ]
    raw = SIGNAL.astype(np.float32)
    assert_allclose(item.signal[0], raw * STANDARD_GRAVITY, rtol=1.2e-7)  # two float32 roundings
    assert_array_equal(item.signal[1], -raw)
    unit = EachChannel({"key": "mV"}, others="g")
    assert_allclose(
        read(wav, channels=("acc", "key"), unit=unit, tacho="key").signal[1], -raw / 1e3, rtol=1e-7
    )


def test_one_unit_for_all_but_some(wav):
    unit = EachChannel({"b": "mm/s"}, others="g")
    item = read(wav, channels=("a", "b"), unit=unit)
    assert item.units == {"a": "m/s^2", "b": "m/s"}
    swapped = EachChannel({"a": "mm/s"}, others="g")
    assert read(wav, channels=("a", "b"), unit=swapped).units == {"a": "m/s", "b": "m/s^2"}
    with pytest.raises(DataError, match="'c' has no channel"):
        read(wav, channels=("a", "b"), unit=EachChannel({"c": "g"}, others="g"))


def test_what_nobody_declares_is_refused_at_once(wav, tmp_path):
    with pytest.raises(DataError) as caught:
        read(wav, channels=("a", "b"), tacho="c")
    text = str(caught.value)
    assert text.count("unit must be given") == 2
    assert "has no channel 'c' to be the tacho" in text
    np.save(tmp_path / "x.npy", SIGNAL)
    with pytest.raises(DataError, match="fs must be given"):
        read(tmp_path / "x.npy", unit="g")


def test_a_long_recording_is_refused_and_read_in_pieces(wav, monkeypatch):
    whole = read(wav, channels=("a", "b"), unit="g").signal
    monkeypatch.setattr(importers, "_PIECE", 14)  # seven samples of two channels
    assert_array_equal(read(wav, channels=("a", "b"), unit="g").signal, whole)
    monkeypatch.setattr(importers, "LARGEST_RECORD", 399)
    with pytest.raises(DataError, match="2 x 50 samples have 400 byte, must be <= 399"):
        read(wav, channels=("a", "b"), unit="g")


def test_numbers_beyond_single_precision_are_refused(tmp_path):
    values = np.ones(20)
    values[13] = 1e39
    np.save(tmp_path / "x.npy", values)
    with pytest.raises(DataError, match=r"channel 'x' is beyond 3\.4e38 at index 13"):
        read(tmp_path / "x.npy", fs=1.0, unit="g")


def test_a_data_set_by_record(tmp_path):
    path = tmp_path / "data.h5"
    channel = Channel(name="a", unit="m/s^2", quantity="acceleration")
    head = Attributes(sample_rate=10.0, channels=(channel,), origin="simulated")
    with DataSetWriter(path, head, n_records=2, n_samples=3) as writer:
        for i in (0, 1):
            writer.write(i, np.full((1, 3), i), {"record_id": str(i), "status": "ok"})
        writer.finish()
    assert read(path, channels=["x=a"]).names == ("x",)
    item = read(path, record=1, fs=10.0)
    assert_array_equal(item.signal, np.ones((1, 3)))
    assert (item.origin, item.row["record_id"]) == ("simulated", "1")
    for options, message in (
        ({"record": 2}, "record = 2 must be >= 0 and < 2"),
        ({"fs": 11.0}, "fs = 11 Hz must be 10 Hz"),
        ({"unit": "g", "variable": "x"}, "variable, unit must not be given"),
        ({"tacho": "a"}, "tacho = 'a' must be None"),
        ({"channels": ["b"]}, "has no channel 'b'; choose one of a"),
        ({"channels": ["a", "a"]}, "channels = a, a must differ"),
    ):
        with pytest.raises(DataError, match=message):
            read(path, **options)


def test_hdf5_of_another_program(tmp_path):
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["acc"] = SIGNAL
        file["acc"].attrs["unit"] = "g"
    assert_allclose(read(path, fs=10.0).signal, [SIGNAL * STANDARD_GRAVITY], rtol=6e-8)
    path.write_bytes(b"not at all" * 50)
    with pytest.raises(DataError, match=r"other\.h5"):
        read(path)


def test_contents_are_listed_without_choosing(tmp_path, mat):
    savemat(tmp_path / "two.mat", {"a": SIGNAL, "b": np.ones((30, 2))})
    known, two = list_contents([mat, tmp_path / "two.mat"])
    [part] = known["recordings"]
    assert (part["variable"], part["sample_rate_hz"], part["duration_s"]) == (
        "bearing.gs",
        1000.0,
        0.05,
    )
    assert (part["channels"][0]["unit_in_file"], part["conditions"]["speed_hz"]) == ("g", 25.0)
    assert [(p["variable"], p["samples"], p["sample_rate_hz"]) for p in two["recordings"]] == [
        ("a", 50, None),
        ("b", 30, None),
    ]
    assert "unit must be given" in " ".join(two["recordings"][0]["undeclared"])
    (tmp_path / "cut.mat").write_bytes(mat.read_bytes()[:150])
    absent, there, cut = list_contents([tmp_path / "no.wav", mat, tmp_path / "cut.mat"])
    assert absent == {"file": str(tmp_path / "no.wav"), "recordings": [], "fault": absent["fault"]}
    assert absent["fault"].startswith("no such file")
    assert there == known
    assert cut["fault"]
    with pytest.raises(DataError) as caught:
        list_contents([tmp_path / "no.wav", tmp_path / "cut.mat"])
    assert "no.wav: no such file" in str(caught.value)
    assert "cut.mat" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "fs", "n_samples", "load"),
    [
        ("baseline_1", 97_656.0, 585_936, 270.0),
        ("InnerRaceFault_vload_1", 48_828.0, 146_484, 0.0),
        ("OuterRaceFault_vload_1", 48_828.0, 146_484, 25.0),
    ],
)
def test_measured_bearings(realdata, name, fs, n_samples, load):
    path = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0" / f"{name}.mat"
    item = read(path)
    assert (item.sample_rate, item.signal.shape, item.tacho) == (fs, (1, n_samples), None)
    assert_allclose(item.row["speed_hz"], 25.0)
    assert_allclose(item.row["load_n"], load * 4.4482216152605)
    in_g = loadmat(path)["bearing"]["gs"][0, 0][:, 0]
    # float32 of the product: half an ulp
    assert_allclose(item.signal[0], in_g * 9.80665, rtol=6e-8)
