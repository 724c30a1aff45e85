"""Recordings from files: exact values where known, and one clear message for everything else."""

import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat, savemat
from wearstate.datasets import importers
from wearstate.datasets.importers import read_recording
from wearstate.datasets.record import Attributes, DataError, DataSetWriter
from wearstate.sim.parts import STANDARD_GRAVITY
from wearstate.sim.sensor import Channel

SIGNAL = np.random.default_rng(0).standard_normal(50)


@pytest.fixture
def mat(tmp_path):
    path = tmp_path / "bearing.mat"
    bearing = {"gs": SIGNAL[:, None], "sr": 1000.0, "rate": 25, "load": "100"}
    savemat(path, {"bearing": bearing, "BPFO": 81.1}, do_compression=True)
    return path


@pytest.fixture
def other(tmp_path):
    path = tmp_path / "other.mat"
    savemat(path, {"acc": np.stack([SIGNAL, -SIGNAL]), "rig": {"x": SIGNAL[:, None]}, "n": 3})
    return path


def test_a_known_layout_declares_its_unit(mat):
    item = read_recording(mat)
    # float32: half an ulp
    assert_allclose(item.signal, [SIGNAL * STANDARD_GRAVITY], rtol=6e-8)
    assert (item.sample_rate, item.units, item.tacho) == (1000.0, {"gs": "m/s^2"}, None)
    # 100 pound-force: 45.359237 kg at 9.80665 m/s^2; a few roundings of a double
    assert_allclose([item.row["speed_hz"], item.row["load_n"]], [25.0, 444.82216152605], rtol=1e-15)
    assert set(item.row) == {"speed_hz", "load_n"}
    assert (item.origin, item.source) == ("measured", "bearing.mat")


def test_what_is_declared_may_be_repeated_but_not_contradicted(mat):
    assert read_recording(mat, fs=1000.0, unit="g").sample_rate == 1000.0
    with pytest.raises(DataError, match=r"unit = m/s\^2 must be g \(MFPT bearing"):
        read_recording(mat, unit="m/s^2")
    with pytest.raises(DataError, match=r"fs = 999.0 Hz must be 1000 Hz, as declared"):
        read_recording(mat, fs=999.0)


@pytest.mark.parametrize(
    ("variable", "unit", "expected"),
    [
        ("acc", "m/s^2", np.stack([SIGNAL, -SIGNAL])),
        ("acc", "g", np.stack([SIGNAL, -SIGNAL]) * STANDARD_GRAVITY),
        ("rig.x", "m/s^2", SIGNAL[None]),
    ],
)
def test_an_unknown_layout_is_read_as_told(other, variable, unit, expected):
    item = read_recording(other, variable=variable, fs=500.0, unit=unit)
    assert_array_equal(item.signal, expected.astype(np.float32))


def test_an_unknown_layout_is_never_guessed(other):
    listing = r"numeric arrays: acc \(2, 50\), rig\.x \(50, 1\); give variable, fs and unit"
    with pytest.raises(DataError, match=listing):
        read_recording(other)
    for options in ({"fs": 500.0}, {"unit": "g"}):
        with pytest.raises(DataError, match="must both be given for variable acc"):
            read_recording(other, variable="acc", **options)


def test_a_data_set_by_record(tmp_path):
    path = tmp_path / "data.h5"
    channel = Channel(name="a", unit="m/s^2", quantity="acceleration")
    head = Attributes(sample_rate=10.0, channels=(channel,), origin="simulated")
    with DataSetWriter(path, head, n_records=2, n_samples=3) as writer:
        for i in (0, 1):
            writer.write(i, np.full((1, 3), i), {"record_id": str(i), "status": "ok"})
        writer.finish()
    item = read_recording(path, record=1)
    assert_array_equal(item.signal, np.ones((1, 3)))
    assert (item.origin, item.row["record_id"]) == ("simulated", "1")
    for options, message in (
        ({"record": 2}, "record = 2 must be >= 0 and < 2"),
        ({"record": -1}, "record = -1 must be >= 0"),
        ({"fs": 11.0}, "fs = 11 Hz must be 10 Hz"),
        ({"unit": "g"}, "declares its own units"),
    ):
        with pytest.raises(DataError, match=message):
            read_recording(path, **options)


def test_options_and_paths_at_fault(mat, tmp_path):
    for path, options, message in (
        (mat, {"record": 1}, "record = 1 must be 0"),
        (mat, {"fs": 0.0}, "fs = 0.0 Hz must be > 0"),
        (mat, {"unit": "mm/s"}, r"unit = 'mm/s' must be one of m/s\^2, g"),
        (tmp_path / "a.csv", {}, r"suffix '\.csv' must be one of \.h5, \.hdf5, \.mat"),
        (tmp_path / "a.mat", {}, "is no file"),
    ):
        with pytest.raises(DataError, match=message):
            read_recording(path, **options)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"sr": -5.0}, r"sample_rate = -5.0 Hz must be > 0"),
        ({"sr": "fast"}, r"sr = .*'fast'.* must be one number"),
        ({"sr": np.ones(2)}, r"sr = .* must be one number"),
        ({"gs": "text"}, r"gs is <U4 \(1,\), must be real numbers"),
        ({"gs": np.ones((3, 1)) * 1j}, r"gs is complex128 .* must be real numbers"),
        ({"gs": np.array([[1.0], [np.nan]])}, r"'gs' has 1 sample\(s\) .* first at index 1"),
    ],
)
def test_impossible_values_are_refused(tmp_path, fields, message):
    path = tmp_path / "bearing.mat"
    savemat(path, {"bearing": {"gs": SIGNAL[:, None], "sr": 1000.0, **fields}})
    with pytest.raises(DataError, match=message):
        read_recording(path)


# -- damaged bytes -----------------------------------------------------------------------------


@pytest.mark.parametrize("compressed", [True, False])
def test_every_truncation_is_refused(tmp_path, compressed):
    path = tmp_path / "x.mat"
    bearing = {"gs": SIGNAL[:, None], "sr": 1000.0}
    savemat(path, {"bearing": bearing}, do_compression=compressed)
    whole = path.read_bytes()
    for size in range(0, len(whole), 7):
        path.write_bytes(whole[:size])
        with pytest.raises(DataError, match=r"x\.mat"):
            read_recording(path)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=4))
def test_damage_is_refused_or_harmless(mat, changes):
    path = mat.with_name("damaged.mat")
    raw = bytearray(mat.read_bytes())
    for place, value in changes:
        raw[place % len(raw)] = value
    path.write_bytes(raw)
    try:
        item = read_recording(path)
    except DataError:
        return
    # zlib's checksum guards the content; what survives is the header's free text
    assert_allclose(item.signal, [SIGNAL * STANDARD_GRAVITY], rtol=6e-8)


def element(kind, payload):
    return np.array([kind, len(payload)], "<u4").tobytes() + payload


def test_a_small_file_that_inflates_is_refused(mat, monkeypatch):
    monkeypatch.setattr(importers, "LARGEST_INFLATED", 2**23)
    bomb = element(15, zlib.compress(bytes(2**26)))
    mat.write_bytes(mat.read_bytes()[:128] + bomb)
    with pytest.raises(DataError, match="holds more than 8388608 byte"):
        read_recording(mat)


def test_absurd_declared_sizes_are_refused(tmp_path, mat):
    head = mat.read_bytes()[:128]
    # a matrix element of 4 GB in a file of 136 byte
    mat.write_bytes(head + np.array([14, 2**32 - 8], "<u4").tobytes())
    with pytest.raises(DataError, match="has 136 byte, must be >= 4294967424"):
        read_recording(mat)
    # a double array of 2**31 - 1 by 2**31 - 1 that holds one number
    matrix = (
        element(6, np.array([6, 0], "<u4").tobytes())
        + element(5, np.array([2**31 - 1] * 2, "<i4").tobytes())
        + element(1, b"acc\0\0\0\0\0")
        + element(9, bytes(8))
    )
    mat.write_bytes(head + element(14, matrix))
    with pytest.raises(DataError, match="cannot be read"):
        read_recording(mat, variable="acc", fs=1.0, unit="g")


def test_formats_of_other_levels_are_named(mat):
    mat.write_bytes(b"MATLAB 7.3 MAT-file" + bytes(200))
    with pytest.raises(DataError, match=r"MATLAB 7\.3, must be 5 to 7; save it again with '-v7'"):
        read_recording(mat)
    mat.write_bytes(bytes(200))
    with pytest.raises(DataError, match="has no MAT 5 header"):
        read_recording(mat)


# -- measured ----------------------------------------------------------------------------------


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
    item = read_recording(path)
    assert (item.sample_rate, item.signal.shape, item.tacho) == (fs, (1, n_samples), None)
    assert_allclose(item.row["speed_hz"], 25.0)
    assert_allclose(item.row["load_n"], load * 4.4482216152605)
    in_g = loadmat(path)["bearing"]["gs"][0, 0][:, 0]
    # float32 of the product: half an ulp
    assert_allclose(item.signal[0], in_g * 9.80665, rtol=6e-8)
