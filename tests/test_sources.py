"""Readers: the numbers of every format as another program wrote them, and words for bad input."""

import importlib.util
import re
import struct
import sys
import tracemalloc
import wave
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat, savemat, wavfile
from wearstate.datasets.file import hdf5_values
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.readers import flat as source_flat
from wearstate.datasets.readers import mat5 as source_mat5
from wearstate.datasets.readers import text as source_text
from wearstate.datasets.readers import text_lines
from wearstate.datasets.readers.open import READERS, list_sources, open_source
from wearstate.datasets.source import time_column as source_time
from wearstate.datasets.source.channel_units import (
    DIMENSIONS,
    known_units,
    parse_sensitivity,
    parse_unit,
)
from wearstate.datasets.source.part import LARGEST_INFLATED, SourceOptions
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel
from wearstate.sim.parts.units import STANDARD_GRAVITY

_SPEC = importlib.util.spec_from_file_location(
    "fuzz_readers", Path(__file__).with_name("fuzz_readers.py")
)
fuzz = importlib.util.module_from_spec(_SPEC)
sys.modules["fuzz_readers"] = fuzz  # dataclasses look their module up
_SPEC.loader.exec_module(fuzz)

SIGNAL = np.random.default_rng(1).standard_normal((2, 50))
G = STANDARD_GRAVITY


def opened(path, **options):
    return open_source(path, SourceOptions(**options))


def values(path, **options):
    with opened(path, **options) as source:
        return source.read()


def refusal(path, **options):
    with pytest.raises(DataError) as caught:
        values(path, **options)
    return str(caught.value)


# -- units -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "quantity", "symbol", "factor"),
    [
        ("g", "acceleration", "m/s^2", G),
        ("m/s²", "acceleration", "m/s^2", 1.0),
        ("m/s2", "acceleration", "m/s^2", 1.0),
        ("mm/s", "velocity", "m/s", 1e-3),
        ("μm", "displacement", "m", 1e-6),  # the Greek letter, not the micro sign
        ("mil", "displacement", "m", 25.4e-6),
        ("ips", "velocity", "m/s", 0.0254),
        ("0.5 mV", "voltage", "V", 5e-4),
        ("2 mil", "displacement", "m", 50.8e-6),
        ("1/min", "rotation speed", "rev/s", 1 / 60),
        ("r/min", "rotation speed", "rev/s", 1 / 60),
        ("m/s**2", "acceleration", "m/s^2", 1.0),
        ("kN·m", "moment", "N m", 1e3),
        ("mbar", "pressure", "Pa", 100.0),
        ("FS", "full scale", "FS", 1.0),
    ],
)
def test_units_are_those_of_the_table(text, quantity, symbol, factor):
    unit = parse_unit(text)
    assert (unit.quantity, unit.symbol) == (quantity, symbol)
    assert_allclose(unit.factor, factor, rtol=1e-15)  # one or two roundings


def test_every_known_unit_has_one_meaning():
    for text in known_units():
        unit = parse_unit(text)
        assert unit.quantity in {*DIMENSIONS, "full scale"}
        assert parse_unit(unit.symbol).factor == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("m/s^", r"unit 'm/s\^' is not known; did you mean 'm/s(\^2)?'\?"),
        ("furlong", "is not known; use one of m/s"),
        ("0 g", "is a factor of 0.0, must be > 0"),
        ("", "unit '' is not known"),
        ("kg", "unit 'kg' is not known"),
    ],
)
def test_other_units_are_refused_with_the_nearest(text, message):
    with pytest.raises(ValueError, match=message):
        parse_unit(text)


def test_sensitivities():
    for text, quantity, factor in (
        ("100 mV/g", "acceleration", 10 * G),
        ("4 mV/(mm/s)", "velocity", 0.25),
        ("10 mV/m/s^2", "acceleration", 100.0),
        ("8 V/mm", "displacement", 1.25e-4),
    ):
        unit = parse_sensitivity(text)
        assert unit.quantity == quantity
        assert_allclose(unit.factor, factor, rtol=1e-14)
    for text, message in (
        ("100 mV", "has no '/'"),
        ("100 g/mV", "acceleration per voltage"),
        ("2 mV/V", "voltage per voltage"),
        ("0 mV/g", "factor of 0.0"),
        ("10 pC/g", "unit '10 pC' is not known"),
    ):
        with pytest.raises(ValueError, match=message):
            parse_sensitivity(text)


# -- WAV ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [np.uint8, np.int16, np.int32, np.float32, np.float64])
def test_wav_of_every_width(tmp_path, kind):
    path = tmp_path / "rec.wav"
    written = (
        SIGNAL.T * (1 if np.dtype(kind).kind == "f" else 30) + (kind is np.uint8) * 128
    ).astype(kind)
    wavfile.write(path, 8000, written)
    with opened(path, unit="FS", channels=("a", "b")) as source:
        scale = (
            {1: 2.0**7, 2: 2.0**15, 4: 2.0**31}[written.itemsize]
            if written.dtype.kind != "f"
            else 1.0
        )
        expected = (written.T.astype(float) - (kind is np.uint8) * 128) / scale
        assert_array_equal(source.read(), expected)  # powers of two: exact
        assert_array_equal(source.read(7, 19), expected[:, 7:19])
        assert (source.sample_rate, source.n_samples) == (8000.0, 50)
        assert [c.name for c in source.channels] == ["a", "b"]
        assert source.channels[0].unit == "FS"


def test_wav_of_24_bits_keeps_its_sign(tmp_path):
    path = tmp_path / "rec.wav"
    written = np.array([0, 1, -1, 2**23 - 1, -(2**23), 123_456, -654_321])
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 3, 1000, 0, "NONE", ""))
        file.writeframes(b"".join(int(v).to_bytes(3, "little", signed=True) for v in written))
    assert_array_equal(values(path, unit="FS")[0], written / 2.0**23)
    assert_allclose(values(path, full_scale="50 g")[0], written / 2.0**23 * 50 * G, rtol=1e-15)
    expected = written / 2.0**23 * 5.0 / 0.1 * G  # ten volts would be 100 g
    found = values(path, full_scale="5 V", sensitivity="100 mV/g")[0]
    assert_allclose(found, expected, rtol=1e-14)  # a few roundings


def chunk(name, content, order="<"):
    return name + struct.pack(f"{order}I", len(content)) + content + b"\0" * (len(content) % 2)


def wav_file(path, form, data, *, order="<", head=b"RIFF", before=b""):
    body = b"WAVE" + before + chunk(b"fmt ", form, order) + data
    path.write_bytes(head + struct.pack(f"{order}I", len(body)) + body)
    return path


def pcm(order="<", kind=1, channels=1, rate=1000, bits=16):
    frame = channels * bits // 8
    return struct.pack(f"{order}HHIIHH", kind, channels, rate, rate * frame, frame, bits)


def test_wav_extensible_big_endian_and_odd_chunks(tmp_path):
    written = np.arange(-5, 6)
    guid = struct.pack("<H", 1) + bytes.fromhex("0000000010008000 00aa00389b71")
    form = pcm(kind=0xFFFE, bits=32) + struct.pack("<HHI", 22, 24, 4) + guid
    left = (written << 8).astype("<i4").tobytes()  # 24 valid bits at the upper end of 32
    path = wav_file(tmp_path / "x.wav", form, chunk(b"data", left), before=chunk(b"LIST", b"odd"))
    assert_array_equal(values(path, unit="FS")[0], written / 2.0**23)
    big = chunk(b"data", written.astype(">i2").tobytes(), ">")
    path = wav_file(tmp_path / "y.wav", pcm(">"), big, order=">", head=b"RIFX")
    assert_array_equal(values(path, unit="FS")[0], written / 2.0**15)


def test_wav_beyond_four_gigabyte_is_read_flat(tmp_path):
    path = tmp_path / "long.wav"
    n = 2**31 + 1000  # 16-bit samples of a sparse file
    ds64 = struct.pack("<QQQI", 0, 2 * n, n, 0)
    head = b"RF64" + b"\xff" * 4 + b"WAVE" + chunk(b"ds64", ds64) + chunk(b"fmt ", pcm())
    head += b"data" + b"\xff" * 4
    with path.open("wb") as handle:
        handle.write(head)
        handle.truncate(len(head) + 2 * n)
        handle.seek(len(head) + 2 * (n - 2))
        handle.write(np.array([16384, -16384], "<i2").tobytes())
    tracemalloc.start()
    with opened(path, unit="FS") as source:
        assert source.n_samples == n
        tail = source.read(n - 1000, n)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert_array_equal(tail[0, -3:], [0.0, 0.5, -0.5])
    assert peak < 2**21  # a thousand samples of sixteen gigabyte


def test_wav_integers_mean_nothing_until_declared(tmp_path):
    path = tmp_path / "rec.wav"
    wavfile.write(path, 1000, np.arange(10, dtype=np.int16))
    with opened(path) as source:
        assert source.channels[0].unit is None
        assert re.search(r"full_scale must be given \('10 V'.*or unit 'FS'", *source.undeclared)
    assert "does not say what an integer is worth; give full_scale" in refusal(path, unit="g")
    assert "needs a channel in V, is in 50 g full scale" in refusal(
        path, full_scale="50 g", sensitivity="100 mV/g"
    )
    wavfile.write(path, 1000, np.ones(10, dtype=np.float32))
    assert "does not fit floats" in refusal(path, full_scale="50 g")
    assert_allclose(values(path, unit="g"), G)


@pytest.mark.parametrize(
    ("form", "data", "message"),
    [
        (pcm(channels=0), b"ab", "0 channel"),
        (pcm(rate=0), b"ab", "sample_rate = 0.0 Hz must be >= 0.001"),
        (pcm(kind=2), b"ab", "coding 2 of 16 bits must be PCM"),
        (pcm(bits=12), b"ab", "1 channel(s) of 12 bits in frames of 1 byte must"),
        (pcm(bits=72), b"ab", "coding 1 of 72 bits must be PCM (1) of 1 to 64 bits"),
        (pcm(channels=2), b"abc", "3 byte of samples must be a multiple >= 1 of 4"),
        (pcm(), b"", "0 byte of samples"),
        (pcm()[:10], b"ab", "fmt chunk has 10 byte"),
    ],
)
def test_wav_headers_at_fault(tmp_path, form, data, message):
    path = wav_file(tmp_path / "x.wav", form, chunk(b"data", data))
    assert message in refusal(path)


def test_wav_that_claims_more_than_it_holds(tmp_path):
    data = b"data" + struct.pack("<I", 2**31) + b"ab"
    path = wav_file(tmp_path / "x.wav", pcm(), data)
    assert "has 46 byte, must be >= 2147483692; take an intact copy" in refusal(path)
    path = wav_file(tmp_path / "y.wav", pcm(), b"")
    assert "has no data chunk" in refusal(path)


# -- MATLAB 5 ----------------------------------------------------------------------------------


@pytest.mark.parametrize("compressed", [True, False])
def test_mat5_arrays_structs_and_cells(tmp_path, compressed):
    path = tmp_path / "rig.mat"
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = SIGNAL, "note"
    several = np.zeros((1, 2), dtype=[("x", object)])
    several["x"][0, 0], several["x"][0, 1] = SIGNAL[:1], SIGNAL[1:]
    content = {"a": SIGNAL, "b": SIGNAL.T, "s": {"t": {"u": SIGNAL[:1].T}}, "c": cell, "m": several}
    content |= {"i": (SIGNAL * 100).astype(np.int16), "f": SIGNAL.astype(np.float32), "one": 3.0}
    savemat(path, {**content, "z": SIGNAL + 1j}, do_compression=compressed)
    for name, expected in (
        ("a", SIGNAL),
        ("b", SIGNAL),
        ("s.t.u", SIGNAL[:1]),
        ("c{1}", SIGNAL),
        ("m(2).x", SIGNAL[1:]),
        ("i", content["i"].astype(float)),
        ("f", content["f"].astype(float)),
    ):
        with opened(path, variable=name, unit="m/s^2", fs=10.0) as source:
            assert_array_equal(source.read(), expected)
            assert_array_equal(source.read(11, 13), expected[:, 11:13])
    assert [s.part for s in list_sources(path)] == [
        "a",
        "b",
        "s.t.u",
        "c{1}",
        "m(1).x",
        "m(2).x",
        "i",
        "f",
    ]
    message = refusal(path)
    assert "holds 8: variable must be one of its arrays: a (2, 50), b (50, 2), s.t.u" in message
    assert "(not signals: z complex (2, 50)); choose with variable" in message
    assert "z is complex (2, 50), must be real" in refusal(path, variable="z")
    assert "did you mean 's.t.u'?" in refusal(path, variable="s.t.v")


def test_mat5_variables_of_one_length_become_channels(tmp_path):
    path = tmp_path / "097.mat"
    savemat(path, {"DE_time": SIGNAL[:1].T, "FE_time": SIGNAL[1:].T, "short": SIGNAL[:1, :9].T})
    options = {"variable": ("DE_time", "FE_time"), "unit": {"FE_time": "g", "DE_time": "mm/s"}}
    with opened(path, **options) as source:
        assert [c.name for c in source.channels] == ["DE_time", "FE_time"]
        assert [c.quantity for c in source.channels] == ["velocity", "acceleration"]
        assert_array_equal(source.read(), SIGNAL * np.array([[1e-3], [G]]))
    assert "DE_time has 50 samples, short has 9 samples, must be the same" in refusal(
        path, variable=("DE_time", "short")
    )


def element(kind, payload, order="<"):
    padding = b"\0" * (-len(payload) % 8) if kind < 14 else b""
    return np.array([kind, len(payload)], f"{order}u4").tobytes() + payload + padding


def matrix(kind, shape, name, data, order="<"):
    flags = np.array([kind, 0], f"{order}u4").tobytes()
    sides = np.array(shape, f"{order}i4").tobytes()
    parts = (
        element(6, flags, order),
        element(5, sides, order),
        element(1, name, order),
    )
    return element(14, b"".join(parts) + data, order)


def mat_header(order="<"):
    return b"MATLAB 5.0".ljust(124) + (b"\0\1IM" if order == "<" else b"\1\0MI")


@pytest.mark.parametrize("order", ["<", ">"])
def test_mat5_of_either_byte_order_and_shortened_numbers(tmp_path, order):
    path = tmp_path / "x.mat"
    long = element(9, np.arange(8.0).astype(f"{order}f8").tobytes(), order)
    # MATLAB stores doubles that are small whole numbers in fewer bytes
    short = element(2, bytes(range(8)), order)
    raw = (
        mat_header(order)
        + matrix(6, (8, 1), b"a", long, order)
        + matrix(6, (4, 2), b"b", short, order)
    )
    path.write_bytes(raw)
    assert_array_equal(values(path, variable="a"), [np.arange(8.0)])
    assert_array_equal(values(path, variable="b"), np.arange(8.0).reshape(2, 4))
    if order == "<":
        assert_array_equal(loadmat(path)["b"], np.arange(8.0).reshape(2, 4).T)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (matrix(6, (2**31 - 1, 2**31 - 1), b"a", element(9, bytes(8))), "which do not fit"),
        (matrix(6, (-1, 8), b"a", element(9, bytes(8))), "must be >= 0"),
        (matrix(1, (2**31 - 1, 2**31 - 1), b"a", b""), "members in"),
        (matrix(1, (1, 2), b"a", element(14, b"")), "has 1 members, must have 2"),
        (matrix(6, (1, 8), b"a", np.array([9, 800], "<u4").tobytes() + bytes(64)), "of 800 byte"),
        (element(14, bytes(64))[:-8], "must be >= 200"),
        (bytes(8), "element of type 0"),
        (b"", "holds 0 variables"),
        (element(15, zlib.compress(bytes(16))[:-3]), "ends within a compressed"),
        (element(15, b"not zlib"), "cannot be read"),
    ],
)
def test_mat5_sizes_that_cannot_be(tmp_path, content, message):
    path = tmp_path / "x.mat"
    path.write_bytes(mat_header() + content)
    tracemalloc.start()
    assert message in refusal(path, variable="a", fs=1.0, unit="g")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**22


def test_mat5_bombs_and_depths(tmp_path, monkeypatch):
    path = tmp_path / "x.mat"
    path.write_bytes(mat_header() + element(15, zlib.compress(bytes(2**26))))
    monkeypatch.setattr(source_mat5, "LARGEST_INFLATED", 2**23)
    assert "holds more than 8388608 byte" in refusal(path)
    nest = matrix(6, (1, 2), b"", element(9, bytes(16)))
    for _ in range(50):
        nest = matrix(1, (1, 1), b"", nest)
    path.write_bytes(mat_header() + nest)
    assert "are nested more than 32 deep" in refusal(path)


def mfpt(path, **fields):
    savemat(
        path, {"bearing": {"gs": SIGNAL[:1].T, "sr": 1000.0, "rate": 25, "load": "100", **fields}}
    )
    return path


def test_a_known_layout_declares_rate_unit_and_conditions(tmp_path):
    path = mfpt(tmp_path / "x.mat")
    with opened(path) as source:
        assert_allclose(source.read(), SIGNAL[:1] * G, rtol=1e-15)
        assert (source.sample_rate, source.undeclared) == (1000.0, ())
        assert source.channels[0].unit_in_file == "g"
        assert source.channels[0].name == "gs"
        assert_allclose(source.conditions["load_n"], 444.82216152605, rtol=1e-14)
        assert source.conditions["speed_hz"] == 25.0
    assert opened(path, fs=1000.0, unit="g").sample_rate == 1000.0
    assert "unit = m/s^2 must be g (MFPT bearing" in refusal(path, unit="m/s^2")
    assert "fs = 999 Hz must be 1000 Hz, as declared" in refusal(path, fs=999.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"sr": -5.0}, "sample_rate = -5.0 Hz must be >= 0.001"),
        ({"sr": np.nan}, "sample_rate = nan Hz must be >= 0.001"),
        ({"sr": "fast"}, "sr = 'fast' must be one number"),
        ({"sr": np.ones(2)}, "sr = (1, 2) must be one number"),
        ({"gs": "text"}, "gs is text (1, 4), must be real numbers"),
        ({"gs": np.ones((3, 1)) * 1j}, "gs is complex (3, 1), must be real numbers"),
        ({"gs": np.array([[1.0], [np.nan]])}, "'gs' is nan at index 1, must be finite"),
    ],
)
def test_a_known_layout_with_impossible_values(tmp_path, fields, message):
    assert message in refusal(mfpt(tmp_path / "x.mat", **fields))


# -- MATLAB 7.3 and HDF5 -----------------------------------------------------------------------


def mat73(path, fill):
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    with path.open("r+b") as handle:
        handle.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return path


def test_mat73_is_transposed_back_and_references_are_followed(tmp_path):
    def fill(file):
        file["x"] = SIGNAL.T  # MATLAB's (2, 50)
        file["s/t"] = SIGNAL[:1]  # (50, 1)
        file.create_dataset("c", (2, 1), h5py.ref_dtype)
        file["c"].attrs["MATLAB_class"] = np.bytes_("cell")
        file.create_dataset("m/x", (2, 1), h5py.ref_dtype)  # an array of structs
        for i in (0, 1):
            file[f"#refs#/{i}"] = SIGNAL[i : i + 1]
            file["c"][i, 0] = file["m/x"][i, 0] = file[f"#refs#/{i}"].ref

    path = mat73(tmp_path / "x.mat", fill)
    assert [s.part for s in list_sources(path)] == ["c{1}", "c{2}", "m(1).x", "m(2).x", "s.t", "x"]
    assert "x (2, 50)" in refusal(path)
    for name, rows in (("x", [0, 1]), ("s.t", [0]), ("c{2}", [1]), ("m(1).x", [0])):
        assert_array_equal(values(path, variable=name), SIGNAL[rows])
        with opened(path, variable=name) as source:
            assert_array_equal(source.read(30, 31), SIGNAL[rows, 30:31])


def test_mat73_of_a_known_layout_and_of_a_loop(tmp_path):
    def bearing(file):
        file["bearing/gs"], file["bearing/sr"] = SIGNAL[:1], [[1000.0]]
        file["bearing/rate"] = np.array([[50], [53]], dtype=np.uint16)  # "25" in characters
        file["bearing/rate"].attrs["MATLAB_class"] = np.bytes_("char")

    with opened(mat73(tmp_path / "b.mat", bearing)) as source:
        assert_array_equal(source.read(), SIGNAL[:1] * G)
        assert (source.sample_rate, source.conditions["speed_hz"]) == (1000.0, 25.0)

    def loop(file):
        file.create_dataset("c", (2, 1), h5py.ref_dtype)
        file["c"].attrs["MATLAB_class"] = np.bytes_("cell")
        file["c"][0, 0] = file["c"][1, 0] = file["c"].ref  # 2**32 cells, if followed

    assert "holds > 10000 arrays or structs > 32 deep" in refusal(mat73(tmp_path / "l.mat", loop))


def test_hdf5_of_another_program(tmp_path):
    path = tmp_path / "rig.h5"
    with h5py.File(path, "w") as file:
        file["a/acc"] = SIGNAL
        file["a/acc"].attrs.update({"units": "g", "sample_rate_hz": 25.6e3})
        file.create_dataset("b", data=SIGNAL.T, chunks=(7, 2), compression="gzip")
        file["b"].attrs["fs"] = "25.6 kHz"
        file["c"] = np.stack([SIGNAL, -SIGNAL, 2 * SIGNAL])
        file["c"].attrs["fs"] = 25.6  # of what?
        file["words"] = [b"a", b"b"]
        file["soft"] = h5py.SoftLink("/a/acc")
        file["far"] = h5py.ExternalLink("other.h5", "/x")
        file["again"] = file["a"]  # a loop of hard links
        file["a/up"] = file["/"]
    assert {s.part for s in list_sources(path)} >= {"a/acc", "b", "c"}
    message = refusal(path)
    assert "b (50, 2)" in message
    assert "words is object (2,)" in message
    with opened(path, variable="b", unit="g") as source:
        assert source.sample_rate == 25.6e3
        assert_array_equal(source.read(3, 20), (SIGNAL * G)[:, 3:20])
    with opened(path, variable="c", record=2) as source:
        assert source.sample_rate is None
        assert_array_equal(source.read(), 2 * SIGNAL)
    name = next(s.part for s in list_sources(path) if s.part.endswith("acc"))
    with opened(path, variable=name) as source:
        assert (source.sample_rate, source.channels[1].unit) == (25.6e3, "m/s^2")
        assert_array_equal(source.read(), SIGNAL * G)


def test_hdf5_that_holds_less_than_it_declares(tmp_path):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("tera", shape=(2, 2**40), dtype="f8", chunks=(2, 1024))
        file.create_dataset("late", shape=(2, 2**30), dtype="f8")
        file.create_dataset("huge", shape=(2**28,), dtype="f8", chunks=(2**28,))
        source = h5py.VirtualSource("other.h5", "x", shape=(50,))
        layout = h5py.VirtualLayout(shape=(50,), dtype="f8")
        layout[:] = source
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("outside", (4,), "f8", external=[(tmp_path / "raw", 0, 32)])
    for name, message in (
        ("tera", "holds 0 of 1073741824 pieces"),
        ("late", "declares 17179869184 byte and holds 0"),
        ("huge", f"pieces of 2147483648 byte, must be <= {LARGEST_INFLATED}"),
        ("virtual", "is kept in other files"),
        ("outside", "is kept in other files"),
    ):
        assert message in refusal(path, variable=name)


def test_hdf5_texts_whose_heap_is_damaged_do_not_hang(tmp_path, monkeypatch):
    path = tmp_path / "x.h5"
    fuzz.hdf5_text(path)
    with opened(path) as source:
        assert (source.sample_rate, source.channels[0].unit_in_file) == (1000.0, "g")
    raw = bytearray(path.read_bytes())
    place = raw.index(b"GCOL") + 24  # size of the first text: the library's walk stands still
    raw[place : place + 8] = b"\xff" * 8
    path.write_bytes(raw)
    monkeypatch.setattr(hdf5_values, "_LONGEST_READING", 2.0)
    assert "the texts of acc.sample_rate, acc.units cannot be read" in refusal(path)


def test_a_data_set_of_this_program_is_not_imported(tmp_path):
    path = tmp_path / "data.h5"
    head = Attributes(
        sample_rate=10.0,
        channels=(Channel(name="a", unit="m/s^2", quantity="acceleration"),),
        origin="measured",
    )
    with DataSetWriter(path, head, n_records=1, n_samples=3) as writer:
        writer.write(0, np.ones((1, 3)), {"record_id": "a", "status": "ok"})
        writer.finish()
    assert "is a data set of this program already" in refusal(path)


# -- NPY and NPZ -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["<f8", ">f4", "<i2", "|u1", ">i8"])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("transposed", [False, True])
def test_npy_of_any_type_and_order(tmp_path, kind, order, transposed):
    path = tmp_path / "x.npy"
    written = (np.abs(SIGNAL) * 50).astype(kind)
    np.save(path, np.asarray(written.T if transposed else written, order=order))
    assert_array_equal(values(path), written.astype(float))
    with opened(path) as source:
        assert_array_equal(source.read(10, 20), written[:, 10:20].astype(float))


def test_npy_axes(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, SIGNAL[0])
    assert_array_equal(values(path), SIGNAL[:1])
    np.save(path, np.stack([SIGNAL.T, 3 * SIGNAL.T]))
    assert_array_equal(values(path, record=1), 3 * SIGNAL)
    assert "record = 2 must be >= 0 and < 2" in refusal(path, record=2)
    square = SIGNAL[:, :2]
    np.save(path, square)
    assert "sides are equal; give order" in refusal(path)
    assert_array_equal(values(path, order="blocks"), square)
    assert_array_equal(values(path, order="interleaved"), square.T)
    np.save(path, np.ones((5000, 6000), dtype=np.int8))
    assert "has 5000 channels, must be <= 4096" in refusal(path).replace("have", "be")


def npy_claiming(path, header, content=b""):
    raw = header.encode().ljust(117) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(raw)) + raw + content)
    return path


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 1000000000000)}", "must be 16000"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 5)}", "no empty one"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 5)}", "must be >= 0"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': ()}", "must have 1 to 3 axes"),
        ("{'descr': '|O', 'fortran_order': False, 'shape': (2,)}", "pickled objects"),
        ("{'descr': '<c16', 'fortran_order': False, 'shape': (2,)}", "must be real numbers"),
        ("{'descr': '<U4', 'fortran_order': False, 'shape': (2,)}", "must be real numbers"),
        ("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (2,)}", "must be real"),
        ("__import__('os').system('true')", "cannot be read"),
        ("{" * 100, "cannot be read"),
    ],
)
def test_npy_headers_at_fault(tmp_path, header, message):
    assert message in refusal(npy_claiming(tmp_path / "x.npy", header))


def test_npy_pickles_are_not_opened(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, np.array([{"a": 1}, None], dtype=object), allow_pickle=True)
    assert "holds pickled objects, which could run code" in refusal(path)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_members(tmp_path, save):
    path = tmp_path / "x.npz"
    save(path, a=SIGNAL, b=SIGNAL[0], words=np.array(["x"]))
    assert_array_equal(values(path, variable="a"), SIGNAL)
    assert_array_equal(values(path, variable=("b",)), SIGNAL[:1])
    message = refusal(path)
    assert "a (2, 50), b (50,) (not signals: words" in message
    assert "words holds <U1, must be real numbers" in refusal(path, variable="words")


def test_npz_bombs_and_lies(tmp_path, monkeypatch):
    monkeypatch.setattr(source_flat, "LARGEST_INFLATED", 2**23)
    path = tmp_path / "x.npz"
    claim = "{'descr': '|u1', 'fortran_order': False, 'shape': (33554432,)}"
    header = npy_claiming(tmp_path / "h.npy", claim).read_bytes()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", header + bytes(2**25))
    assert path.stat().st_size < 2**16
    tracemalloc.start()
    message = refusal(path, variable="a")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "inflates to 33554560 byte, must be <= 8388608" in message
    assert peak < 2**21
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", header)
    assert "has 128 byte, must be 33554560 for its shape" in refusal(path, variable="a")


# -- text --------------------------------------------------------------------------------------

TABLE = np.array([[1.5, -2.0], [2.5, 1e-3], [3.25, 4.0], [-1.0, 0.5]])


def written(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    "text",
    [
        "1.5,-2\n2.5,1e-3\n3.25,4.0\n-1,.5\n",
        "1.5;-2\n2.5;1e-3\n3.25;4.0\n-1;.5",
        "1,5;-2\n2,5;1e-3\n3,25;4,0\n-1;,5\n",
        "1.5\t-2\r\n2.5\t1e-3\r\n3.25\t4.0\r\n-1\t.5\r\n\r\n",
        "  1.5   -2\n  2.5 1e-3\n 3.25    4.0\n -1 .5\n",
        "a;b\n1,5;-2\n2,5;1e-3\n3,25;4,0\n-1;,5\n",
        '"a, left","b"\n"1.5","-2"\n2.5,1e-3\n"3.25",4.0\n-1,.5\n',
        "Logger 7\nserial: 12; version 3\n\na,b\n1.5,-2\n2.5,1e-3\n3.25,4.0\n-1,.5\n",
        "# a,b\n1.5,-2\n2.5,1e-3\n3.25,4.0\n-1,.5\n",
        "\ufeffa,b\n1.5,-2\n2.5,1e-3\n3.25,4.0\n-1,.5\n",
        "date,a,b\n1 May,1.5,-2\n1 May,2.5,1e-3\n2 May,3.25,4.0\n2 May,-1,.5\n",
    ],
)
def test_text_in_every_dialect(tmp_path, text):
    path = written(tmp_path / "x.csv", text)
    assert_array_equal(values(path), TABLE.T)
    with opened(path) as source:
        assert_array_equal(source.read(1, 3), TABLE.T[:, 1:3])


def test_text_declares_names_units_and_time(tmp_path):
    head = "Time [ms];acc_x [g];disp (µm);side (left);pressure [bar]\n"
    body = "".join(f"{i / 4};{i};{2 * i};{3 * i};{4 * i}\n" for i in range(8))
    for encoding in ("utf-8", "cp1252"):
        path = written(tmp_path / "x.csv", head + body, encoding)
        with opened(path, unit={"side (left)": "mm/s"}) as source:
            assert [c.name for c in source.channels] == ["acc_x", "disp", "side (left)", "pressure"]
            assert [c.unit for c in source.channels] == ["m/s^2", "m", "m/s", "Pa"]
            assert source.sample_rate == 4000.0
            assert_allclose(source.read(7, 8)[:, 0], [7 * G, 14e-6, 21e-3, 28e5], rtol=1e-15)
    with opened(path, channels=("acc=acc_x", "pressure")) as source:
        assert [c.name for c in source.channels] == ["acc", "pressure"]
        assert_allclose(source.read(1, 2)[:, 0], [G, 4e5])
    message = refusal(path, channels=("acc_y", "presure"))
    assert "has no channel 'acc_y'; did you mean 'acc_x'?" in message
    assert "has no channel 'presure'; did you mean 'pressure'?" in message
    assert "unit of 'acc_z' has no channel; did you mean 'acc_x'?" in refusal(
        path, unit={"acc_z": "g"}
    )


def test_text_with_a_line_of_units(tmp_path):
    path = written(tmp_path / "x.txt", "Time\tChannel A\n(ms)\t(mV)\n\n0.0\t1\n0.5\t2\n1.0\t3\n")
    with opened(path, sensitivity="100 mV/g") as source:
        assert (source.sample_rate, source.channels[0].name) == (2000.0, "Channel A")
        assert source.channels[0].unit_in_file == "mV at 100 mV/g"
        assert_allclose(source.read()[0], np.array([1, 2, 3]) * 0.01 * G, rtol=1e-14)


def test_text_that_can_be_read_in_two_ways_is_not_guessed(tmp_path):
    path = written(tmp_path / "x.csv", "0,1\n0,2\n0,3\n")
    assert "2 column(s) by ',' with decimal '.' or 1 column(s) by ' ' with decimal ','" in refusal(
        path
    )
    assert_array_equal(values(path, delimiter="comma"), [[0, 0, 0], [1, 2, 3]])
    assert_array_equal(values(path, decimal=","), [[0.1, 0.2, 0.3]])
    assert values(written(tmp_path / "y.csv", "a,b\n0,1\n0,2\n")).shape == (2, 2)
    assert values(written(tmp_path / "z.csv", "acc\n0,1\n0,2\n")).shape == (1, 2)


def timed(path, times, name="time [s]"):
    return written(path, f"{name},a\n" + "".join(f"{t},1\n" for t in times))


def test_times_are_even_or_refused_with_the_jitter(tmp_path):
    path = tmp_path / "x.csv"
    even = np.arange(200) / 1600  # 0.000625 s
    assert opened(timed(path, [f"{t:.6f}" for t in even])).sample_rate == pytest.approx(
        1600, rel=1e-12
    )
    # the only whole number that seven digits allow
    assert (
        opened(timed(path, [f"{0.1 + t:.8f}" for t in np.arange(200) / 25600])).sample_rate == 25600
    )
    rounded = timed(path, [f"{t:.4f}" for t in even])  # to 16 % of a step, but even
    assert opened(rounded).sample_rate == pytest.approx(1600, rel=1e-3)
    assert opened(rounded, fs=1600.0).sample_rate == 1600.0
    assert "fs = 1700 Hz must be 1599.678457 Hz" in refusal(rounded, fs=1700.0)
    off = even.copy()
    off[77] += 0.1 * 0.000625
    message = refusal(timed(path, [f"{t:.7f}" for t in off]))
    assert (
        "off an even grid by up to 6.25e-05, 10 % of the mean step 0.000625, at 0.0481875 (line 79)"
        in message
    )
    assert "off an even grid" in refusal(timed(path, [f"{t:.7f}" for t in np.delete(even, 50)]))
    message = refusal(timed(path, [f"{t:.3f}" for t in even]))
    assert "(they are printed to 0.001 only)" in message
    assert (
        opened(timed(path, [f"{t:.3f}" for t in even]), time_column=0, fs=1600.0).n_samples == 200
    )
    for times, text in (
        ([1.0], "has 1 time(s)"),
        ([0, 1, 0], "must rise"),
        ([0, "nan", 2], "by up to nan"),
    ):
        assert text in refusal(timed(path, times))


def test_times_need_a_unit(tmp_path):
    path = timed(tmp_path / "x.csv", np.arange(5) / 10, name="time")
    with opened(path) as source:
        assert source.sample_rate is None
        assert re.search(r"fs must be given.*column 'time' has no unit", source.undeclared[0])
    assert opened(path, unit={"time": "ms", "a": "g"}).sample_rate == pytest.approx(1e4)
    assert opened(path, fs=10.0).sample_rate == 10.0
    assert "unit 'h/s' of column 'time' must be one of s, ms" in refusal(path, unit={"time": "h/s"})


def test_the_column_of_times_is_the_one_named(tmp_path):
    path = written(tmp_path / "x.csv", "tick [ms],a\n0,1\n2,5\n4,2\n")
    with opened(path, time_column="tick") as source:
        assert source.sample_rate == 500.0
    assert opened(path, time_column=1).sample_rate == 500.0
    assert len(opened(path).channels) == 2
    assert "time_column = 'tack' is no column; did you mean 'tick'?" in refusal(
        path, time_column="tack"
    )
    assert "time_column = 3 must be <= 2" in refusal(path, time_column=3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n3\n4,5\n", "line 2 holds numbers but reads unlike those below line 3"),
        ("a,b\n1,2\n3,x\n4,5\n", "line 2 holds numbers but reads unlike"),
        ("a,b\n1,2\n3,4\n4,\n", "column 2 is '2' in line 2 and no number in line 4"),
        ("a,b\n1,2\n3,4\n4", "line 2 holds numbers but reads unlike"),
        ("a,b\n1,2\n3,nan\n4,5\n", "channel 'b' is nan at index 1, must be finite"),
        ("a,b\n1,2\n3,-1e999\n4,5\n", "channel 'b' is -inf at index 1, must be finite"),
        ("a,b\n1,2\n\n4,5\n", "line 2 holds numbers"),
        ("words\nand more\n", "no columns of numbers"),
        ("a,a\n1,2\n3,4\n", "channel names ['a'] must be unique"),
        ("a\r1\r2\r3\r", "ends lines by CR alone"),
    ],
)
def test_text_at_fault(tmp_path, text, message):
    assert message in refusal(written(tmp_path / "x.csv", text), fs=1.0, unit="g")


def test_text_at_fault_far_down_is_found_on_reading(tmp_path, monkeypatch):
    monkeypatch.setattr(source_text, "_HEAD", 4096)
    lines = [f"{i},{i}" for i in range(30_000)]
    for bad, message in (
        ("1;2", "line 20001 has 1 cell(s), must have 2"),
        ("1,2,3", "line 20001 has 3 cell(s), must have 2"),
        ("1,x", "column 2 of line 20001 is 'x', must be a number"),
        ("1,", "column 2 of line 20001 is '', must be a number"),
        ("", "line 20001 has 1 cell(s)"),
        ("1,1_0", "column 2 of line 20001 is '1_0'"),
    ):
        path = written(
            tmp_path / "x.csv", "\n".join([*lines[:20_000], bad, *lines[20_001:]]) + "\n"
        )
        with opened(path, delimiter=",") as source:
            assert source.read(0, 19_999)[1, -1] == 19_998
            with pytest.raises(DataError) as caught:
                source.read(19_999, 20_500)
            assert message in str(caught.value)


def test_text_is_read_in_pieces(tmp_path, monkeypatch):
    count = 40_000
    path = written(tmp_path / "x.csv", "".join(f"{i};{-i}\n" for i in range(count)))
    monkeypatch.setattr(text_lines, "_PIECE", 1000)  # lines lie across pieces
    monkeypatch.setattr(source_text, "_HEAD", 4096)
    with opened(path) as source:
        assert source.n_samples == count
        for start in (0, 4095, 4096, 8191, 39_999):
            stop = min(start + 3, count)
            assert_array_equal(source.read(start, stop)[0], np.arange(start, stop))
        tracemalloc.start()
        source.read(20_000, 20_100)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 2**21  # two blocks of lines, not the file's 500 kB as objects


def test_text_that_is_none(tmp_path):
    for raw, message in (
        (b"\xff\xfe1\x00,\x002\x00", "is UTF-16, must be UTF-8"),
        (b"1,2\n\x00\x01\n", "does not begin like a text file"),
        (b"\n \n\t\n", "has no line that ends"),
        (b"1," * 400_000, "has no line that ends"),
    ):
        path = tmp_path / "x.csv"
        path.write_bytes(raw)
        assert message in refusal(path)


# -- UFF ---------------------------------------------------------------------------------------


def uff_set(name, row, *, code=2, unit="m/s^2", cells=None):
    cells = cells or [f"{v:13.5E}" if code == 2 else f"{v:20.12E}" for v in row]
    width = 6 if code == 2 else 4
    lines = ["".join(cells[i : i + width]) for i in range(0, len(cells), width)]
    head = fuzz.uff_head(name, len(row), code=code, unit=unit)
    return f"    -1\n    58\n{head}" + "\n".join(lines) + "\n    -1\n"


def test_uff_channels_and_precision(tmp_path):
    path = written(
        tmp_path / "x.uff", uff_set("acc_x", SIGNAL[0]) + uff_set("acc_y", SIGNAL[1], code=4)
    )
    with opened(path) as source:
        assert [c.name for c in source.channels] == ["acc_x", "acc_y"]
        assert (source.sample_rate, source.channels[0].unit) == (1000.0, "m/s^2")
        found = source.read()
        # six and thirteen digits are printed
        assert_allclose(found[0], SIGNAL[0], rtol=5e-6)
        assert_allclose(found[1], SIGNAL[1], rtol=5e-13)
        assert_array_equal(source.read(5, 8), found[:, 5:8])
        assert_array_equal(source.read(48, 50), found[:, 48:50])
    # numbers of full width leave no blank between them
    tight = [f"{-abs(v) * 1e-101:13.5E}"[-13:] for v in SIGNAL[0]]
    path = written(tmp_path / "y.uff", uff_set("a", SIGNAL[0], cells=tight))
    assert_allclose(values(path)[0], -abs(SIGNAL[0]) * 1e-101, rtol=5e-5)


# the library leaves a file open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(("binary", "even"), [(0, True), (0, False), (1, True)])
def test_uff_as_another_library_writes_it(tmp_path, binary, even):
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "x.uff"
    data = {"type": 58, "func_type": 1, "rsp_node": 12, "rsp_dir": -2, "ref_node": 0, "ref_dir": 0}
    data |= {"data": SIGNAL[0], "x": np.arange(50) * 1e-3, "binary": binary}
    data |= {"abscissa_spec_data_type": 17, "abscissa_spacing": int(even), "abscissa_inc": 1e-3}
    data |= {"ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "g", "id1": "run"}
    data |= {"orddenom_spec_data_type": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE"}
    # its other mode writes no header before binary numbers
    pyuff.UFF(str(path)).write_sets([data], mode="add", force_double=True)
    with opened(path) as source:
        assert source.channels[0].name == "12:-Y"
        assert source.sample_rate == pytest.approx(1000.0, rel=1e-5)
        # twelve digits are printed
        assert_allclose(source.read()[0], SIGNAL[0] * G, rtol=0 if binary else 5e-12)


def uff_binary(path, row, *, order="<", note=""):
    raw = np.asarray(row).astype(f"{order}f4").tobytes()
    head = (
        f"    58b{1 if order == '<' else 2:6d}     2          11{len(raw):12d}     0     0{note}\n"
    )
    text = "    -1\n" + head + fuzz.uff_head("acc_x", len(row))
    path.write_bytes(text.encode() + raw + b"\n    -1\n")
    return path


@pytest.mark.parametrize("order", ["<", ">"])
def test_uff_binary_numbers_that_look_like_the_mark(tmp_path, order):
    mark = np.frombuffer(b"\n    -1\n    -1\n ", dtype=f"{order}f4")
    row = np.concatenate([SIGNAL[0].astype(np.float32), mark, SIGNAL[1].astype(np.float32)])
    path = uff_binary(tmp_path / "x.uff", row, order=order)
    assert_array_equal(values(path)[0], row.astype(float))


def test_uff_units_by_its_unit_system(tmp_path):
    system = "    -1\n   164\n         5mm, N, s                     2\n"
    system += "  1.00000000000000000D+03  1.00000000000000000D+00  1.00000000000000000D+00\n"
    system += "  0.00000000000000000D+00\n    -1\n"
    path = written(tmp_path / "x.uff", system + uff_set("a", SIGNAL[0], unit="NONE"))
    with opened(path) as source:
        assert source.channels[0].unit == "m/s^2"
        assert_allclose(source.read()[0], SIGNAL[0] * 1e-3, rtol=5e-6)
    path = written(tmp_path / "y.uff", uff_set("a", SIGNAL[0], unit="NONE"))
    assert opened(path).channels[0].unit is None


def test_uff_sets_that_do_not_fit_together_are_listed(tmp_path):
    text = uff_set("a", SIGNAL[0]) + uff_set("a", SIGNAL[1]) + uff_set("b", SIGNAL[0, :20])
    path = written(tmp_path / "x.uff", text)
    assert "a#1 (1, 50), a#2 (1, 50), b (1, 20)" in refusal(path)
    assert_allclose(values(path, variable="a#2")[0], SIGNAL[1], rtol=5e-6)
    spectrum = uff_set("a", SIGNAL[0]).replace("    1         0    0  ", "    4         0    0  ")
    path = written(tmp_path / "y.uff", spectrum)
    assert "none (not signals: a frequency response function)" in refusal(path)


def test_uff_at_fault(tmp_path):
    good = uff_set("a", SIGNAL[0])
    lines = good.splitlines(keepends=True)
    for text, message in (
        ("".join(lines[:-2]), "has 8 lines of numbers, must have 9"),
        ("".join(lines[:-1]), "ends within a set"),
        ("".join(lines[:6]), "a set of type 0, 0 values"),
        (
            good.replace("        50         1", " 999999999         1"),
            "must have 166666667 for 999999999",
        ),
        (good.replace("        50         1", "       -50         1"), "-50 values"),
        (good.replace("1.00000E-03", "0.00000E+00"), "has a step of 0.0 s, must be > 0"),
        (good.replace("1.00000E-03", "        nan"), "has a step of nan s"),
        (good + "rubbish\n", "between two sets"),
        (good[7:], "does not begin like a UFF file"),
    ):
        assert message in refusal(written(tmp_path / "x.uff", text))
    path = uff_binary(tmp_path / "b.uff", SIGNAL[0])
    path.write_bytes(path.read_bytes().replace(b"         200", b"  2000000000"))
    assert "must be >= 2000000" in refusal(path)


# -- TDMS --------------------------------------------------------------------------------------


@pytest.fixture
def tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")

    def write(*segments):
        path = tmp_path / "x.tdms"
        with nptdms.TdmsWriter(path) as writer:
            for segment in segments:
                writer.write_segment(
                    [nptdms.ChannelObject(g, c, d, properties=p) for g, c, d, p in segment]
                )
        return path

    return write


def test_tdms_groups_segments_and_units(tdms):
    kept = {"wf_increment": 1 / 25600, "unit_string": "g"}
    path = tdms(
        [("rig", "x", SIGNAL[0, :20], kept), ("rig", "y", SIGNAL[1, :20], kept)],
        [("rig", "x", SIGNAL[0, 20:], {}), ("rig", "y", SIGNAL[1, 20:], {})],
    )
    with opened(path, channels=("acc=y",)) as source:
        assert (source.part, source.sample_rate, source.n_samples) == ("rig", 25600.0, 50)
        assert_array_equal(source.read(15, 25), SIGNAL[1:, 15:25] * G)
    path = tdms(
        [
            ("rig", "x", SIGNAL[0], kept),
            ("rig", "slow", SIGNAL[0, :5], {"wf_increment": 1.0}),
            ("rig", "words", np.array(["a", "b"]), {}),
            ("plant", "p", SIGNAL[0].astype(np.int16), {}),
        ]
    )
    assert "plant (1, 50), rig/x (1, 50), rig/slow (1, 5) (not signals: rig/words)" in refusal(path)
    assert values(path, variable="plant").shape == (1, 50)


def test_tdms_sets_no_memory_aside_for_a_length_that_cannot_be(tdms):
    path = tdms([("rig", "x", SIGNAL[0], {"wf_increment": 0.1, "unit_string": "g"})])
    content = path.read_bytes()
    place = content.index(b"/'rig'") - 4  # its length, of 6 byte, becomes 1 GiB and 6 byte
    path.write_bytes(content[: place + 3] + b"\x40" + content[place + 4 :])
    tracemalloc.start()
    try:
        with pytest.raises(DataError):
            open_source(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2**24


def test_tdms_at_fault(tdms):
    path = tdms([("rig", "x", SIGNAL[0], {"wf_increment": -1.0})])
    assert "wf_increment of x is -1.0, must be a number > 0" in refusal(path)
    path = tdms([("rig", "x", SIGNAL[0], {"wf_increment": 1e-3, "unit_string": "wobble"})])
    with opened(path) as source:
        assert "unit 'wobble' is not known" in source.undeclared[0]
    assert_array_equal(values(path, unit="mm/s"), SIGNAL[:1] * 1e-3)
    whole = path.read_bytes()
    path.write_bytes(whole[:-8])
    assert "must be >=" in refusal(path)
    path.write_bytes(whole[:12] + b"\xff" * 8 + whole[20:])
    assert "unfinished segment" in refusal(path)


def test_tdms_without_its_library(tdms, monkeypatch):
    path = tdms([("rig", "x", SIGNAL[0], {})])
    monkeypatch.setitem(sys.modules, "nptdms", None)
    assert "pip install 'wearstate[tdms]'" in refusal(path)


# -- headerless --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "dtype", ["<int16", ">int16", "<float32", ">f8", "<int24", ">int24", "int8"]
)
@pytest.mark.parametrize("order", ["interleaved", "blocks"])
def test_raw_by_its_declared_layout(tmp_path, dtype, order):
    path = tmp_path / "x.bin"
    numbers = np.round(SIGNAL * 30)
    table = numbers.T if order == "interleaved" else numbers
    if "24" in dtype:
        wide = table.astype(f"{dtype[0]}i4").reshape(-1, 1).view(np.uint8)
        raw = (wide[:, :3] if dtype[0] == "<" else wide[:, 1:]).tobytes()
    else:
        end, name = (dtype[0], dtype[1:]) if dtype[0] in "<>" else ("|", dtype)
        raw = table.astype(np.dtype(name).newbyteorder(end)).tobytes()
    path.write_bytes(b"skip me" + raw)
    options = {"dtype": dtype, "n_channels": 2, "offset": 7, "order": order, "fs": 100.0}
    options |= {"unit": "0.25 mm/s", "channels": ("a", "b")}
    with opened(path, **options) as source:
        assert_array_equal(source.read(), numbers * 0.25e-3)
        assert_array_equal(source.read(48, 49), numbers[:, 48:49] * 0.25e-3)


def test_raw_layouts_at_fault(tmp_path):
    path = tmp_path / "x.bin"
    path.write_bytes(bytes(33))
    whole = {"dtype": "<int16", "n_channels": 2, "order": "blocks"}
    for options, message in (
        ({}, "dtype = None and n_channels = None must both be given"),
        (whole, "33 byte behind offset 0 must be a multiple >= 1 of 4"),
        ({**whole, "offset": 33}, "0 byte behind offset 33"),
        ({**whole, "offset": 34}, "-1 byte behind offset 34"),
        ({**whole, "dtype": "int16"}, "must include its byte order; write '<int16'"),
        ({**whole, "dtype": "<complex64"}, "must be one of int8"),
        ({**whole, "offset": 1, "order": None}, "order must be 'interleaved'"),
        ({**whole, "offset": 1, "channels": ("a",)}, "must name all 2 channels"),
        ({**whole, "offset": 1, "channels": ("a", "a")}, "must be unique"),
        ({**whole, "delimiter": ";"}, "delimiter = ';' does not fit headerless binary files"),
    ):
        assert message in refusal(path, **options)


def test_a_file_larger_than_memory_is_read_flat(tmp_path):
    path = tmp_path / "x.bin"
    with path.open("wb") as handle:
        handle.truncate(2**36)  # sparse: 64 GB that take no room
        handle.seek(2**36 - 2)
        handle.write(np.array([77], "<i2").tobytes())
    for order, last in (("interleaved", [0.0, 77.0]), ("blocks", [0.0, 77.0])):
        tracemalloc.start()
        with opened(path, dtype="<int16", n_channels=2, order=order) as source:
            assert source.n_samples == 2**34
            assert_array_equal(source.read(2**34 - 1000)[:, -1], last)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2**20


# -- every format ------------------------------------------------------------------------------

SEEDS = [(name, seed) for name, seeds in fuzz.SEEDS.items() for seed in seeds]
NAMES = [f"{name}{i}" for i, (name, _) in enumerate(SEEDS)]


def built(seed, tmp_path):
    if seed.suffix == ".tdms":
        pytest.importorskip("nptdms")
    path = tmp_path / f"seed{seed.suffix}"
    seed.build(path)
    return path


@pytest.mark.parametrize(("name", "seed"), SEEDS, ids=NAMES)
def test_an_empty_file_is_refused(tmp_path, name, seed):
    path = built(seed, tmp_path)
    path.write_bytes(b"")
    assert "has 0 byte, must be a" in refusal(path, **seed.options)


@pytest.mark.parametrize(("name", "seed"), SEEDS, ids=NAMES)
def test_every_truncation_is_refused(tmp_path, name, seed):
    path = built(seed, tmp_path)
    whole = path.read_bytes()
    intact = values(path, **seed.options)
    for size in range(1, len(whole), max(len(whole) // 60, 1)):
        path.write_bytes(whole[:size])
        try:
            found = values(path, **seed.options)
        except DataError:
            continue
        # nothing in a table or a headerless file says how long it was
        assert name in ("text", "raw")
        assert found.shape[1] < intact.shape[1] or size > len(whole) - 12


@pytest.mark.parametrize(("name", "seed"), SEEDS, ids=NAMES)
def test_a_wrong_suffix_is_named(tmp_path, name, seed):
    if name in ("raw", "text"):
        return
    content = built(seed, tmp_path).read_bytes()
    for suffix in (".wav", ".mat", ".csv", ".h5", ".npy", ".npz", ".uff", ".tdms"):
        alike = {".mat": name == "mat73", ".h5": name == "mat73"}
        if suffix == seed.suffix or alike.get(suffix):
            continue
        path = tmp_path / f"x{suffix}"
        path.write_bytes(content)
        with pytest.raises(DataError, match=r"x\.|no columns|is no|MAT 5"):
            opened(path)


def test_what_a_foreign_file_is_is_said(tmp_path):
    path = tmp_path / "x.wav"
    np.save(tmp_path / "x.npy", SIGNAL)
    (tmp_path / "x.npy").rename(path)
    assert refusal(path).endswith("is no WAV file but begins like NPY; rename it to x.npy")


def test_options_and_paths_at_fault(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, SIGNAL)
    (tmp_path / "x.dat").touch()
    assert "suffix '.dat' must be one of .wav, .mat" in refusal(tmp_path / "x.dat")
    assert "no such file" in refusal(tmp_path / "y.npy")
    assert "no such file" in refusal(tmp_path / "folder")
    assert "variable = 'a' does not fit NPY files" in refusal(path, variable="a")
    with pytest.raises(DataError) as caught:
        SourceOptions(
            fs=-1.0, n_channels=0, offset=-3, header=-1, record=-2, order="x", decimal="x"
        )
    assert len(str(caught.value).splitlines()) == 7
    with pytest.raises(DataError, match=r"fs = inf Hz must be >= 0\.001"):
        SourceOptions(fs=float("inf"))
    with opened(path, fs=10.0, unit="g") as source:
        for start, stop in ((-1, 5), (5, 5), (0, 51), (7, 3)):
            with pytest.raises(DataError, match="must be within 0 to 50"):
                source.read(start, stop)


def test_all_faults_of_a_file_are_told_at_once(tmp_path):
    path = written(tmp_path / "x.csv", "a [g],b\n1,2\n3,4\n")
    message = refusal(path, unit={"a": "mm/s", "b": "wobble", "c": "g"}, sensitivity={"a": "1 V/g"})
    for text in (
        "unit of 'c' has no channel",
        "unit = mm/s must be g",
        "unit 'wobble' is not known",
    ):
        assert text in message


def test_a_file_that_shrinks_while_it_is_read(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, SIGNAL)
    with opened(path) as source:
        path.write_bytes(path.read_bytes()[:-80])
        with pytest.raises(DataError, match="has 40 of the samples 0 to 50, must have 50"):
            source.read()


def test_overflow_is_refused_by_name(tmp_path):
    path = tmp_path / "x.npy"
    np.save(path, np.array([[1.0, 1e308]]))
    message = refusal(path, unit="g")
    assert "channel 'x' is inf at index 1, must be finite" in message
    np.save(path, np.array([[2**63 - 1, -(2**63)]]))
    assert_array_equal(values(path), [[2.0**63, -(2.0**63)]])


def test_every_suffix_has_a_reader_that_is_tested():
    assert set(READERS) == {
        *(".wav", ".mat", ".csv", ".tsv", ".txt", ".h5", ".hdf5", ".npy", ".npz", ".uff"),
        *(".unv", ".uf", ".tdms", ".bin", ".raw"),
    }


def test_the_jitter_bound_is_what_it_says():
    # phase error 2 pi (fs / 4) (0.01 / fs) and, to second order, the amplitude's
    phase = 2 * np.pi * 0.25 * source_time.MOST_JITTER
    assert phase == pytest.approx(0.0157, abs=1e-4)
    assert 1 - np.cos(phase) < 2e-4


# -- measured ----------------------------------------------------------------------------------


def test_measured_uff_ascii_equals_binary(realdata):
    folder = realdata / "pyuff_beam_frf_MIT"
    with (
        opened(folder / "Sample_UFF58_ascii.uff") as printed,
        opened(folder / "Sample_UFF58b_bin.uff") as binary,
    ):
        assert printed.n_samples == binary.n_samples == 79_292
        assert printed.channels == binary.channels
        assert printed.channels[0].unit == "Pa"
        assert printed.sample_rate == binary.sample_rate == 65_536.0
        # six digits are printed: half of the last is 5e-6 of the smallest mantissa
        assert_allclose(printed.read(), binary.read(), rtol=5.01e-6)
    assert opened(folder / "Sample_UFF58_ascii.uff", fs=65_536.0).sample_rate == 65_536.0


def test_measured_uff_agrees_with_another_library(realdata):
    pyuff = pytest.importorskip("pyuff")
    for name in ("Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff"):
        path = realdata / "pyuff_beam_frf_MIT" / name
        found = pyuff.UFF(str(path)).read_sets(0)["data"]
        assert_array_equal(values(path)[0], np.asarray(found, dtype=float))


def test_measured_spectra_are_no_recordings(realdata):
    message = refusal(realdata / "pyuff_beam_frf_MIT" / "sample_dataset58_psd.uff")
    assert "not signals: Pilot 1 power spectral density" in message
    for name in ("case1.mat", "case2.mat"):
        message = refusal(realdata / "vibrationtesting_frf_MIT" / name)
        assert "Time_chan_1 (4096, 1), Time_chan_2 (4096, 1)" in message
        assert "Hf_chan_2 complex (1601, 1)" in message


def test_measured_mat_agrees_with_another_reader(realdata):
    path = realdata / "vibrationtesting_frf_MIT" / "case1.mat"
    expected = loadmat(path)
    for source in list_sources(path):
        assert_array_equal(source.read()[0], expected[source.part].reshape(-1))
    folder = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0"
    for file in sorted(folder.glob("*.mat")):
        with opened(file) as source:
            bearing = loadmat(file)["bearing"][0, 0]
            assert_array_equal(source.read()[0], bearing["gs"][:, 0] * G)
            assert source.sample_rate == bearing["sr"][0, 0]
            assert source.conditions["speed_hz"] == 25.0


def test_measured_table_without_header(realdata):
    path = realdata / "vbl_va001_pump_features_MIT" / "feature_VBL-VA001.csv"
    expected = np.loadtxt(path, delimiter=",").T
    assert_array_equal(values(path), expected)


def test_whole_numbers_at_the_end_of_a_semicolon_file(tmp_path):
    """Values above cut a chunk from the rest: its lines alone would read as integers."""
    path = tmp_path / "late.csv"
    rows = [f"{0.5 + i % 7:.1f};{i}" for i in range(5000)] + [f"{i};{i}" for i in range(200)]
    path.write_text("acc [g];count [V]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    with open_source(path, SourceOptions(fs=100.0)) as source:
        assert source.n_samples == 5200
        assert_allclose(source.read(0, 2)[0], [0.5 * 9.80665, 1.5 * 9.80665])


def test_one_column_keeps_its_header(tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("acc [g]\n1.5\n2.5\n0.5\n", encoding="utf-8")
    with open_source(path, SourceOptions(fs=100.0)) as source:
        [channel] = source.channels
        assert (channel.name, channel.unit) == ("acc", "m/s^2")
        assert source.n_samples == 3


# --- the first line and the last


@pytest.mark.parametrize("mark", ["#", "%", "  # "])
def test_comments_at_the_end_are_no_samples(tmp_path, mark):
    rows = "".join(f"{i / 1000:.3f},{i % 7}.5\n" for i in range(50))
    (tmp_path / "x.csv").write_text(f"time [s],a [g]\n{rows}{mark} end\n\n{mark} 12,5\n\n")
    with open_source(tmp_path / "x.csv", SourceOptions()) as source:
        assert (source.n_samples, source.sample_rate) == (50, 1000.0)
        assert source.read()[0, -1] == pytest.approx(0.5 * 9.80665)  # 49 % 7 = 0
    long = "".join(f"{i / 1000:.3f},{i % 7}.5\n" for i in range(40_000))  # more than is looked at
    (tmp_path / "y.csv").write_text(f"time [s],a [g]\n{long}{mark} end\n")
    with open_source(tmp_path / "y.csv", SourceOptions()) as source:
        assert source.read().shape == (1, 40_000)


def test_comments_alone_are_no_table(tmp_path):
    (tmp_path / "x.csv").write_text("# a\n" * 100_000)
    assert "no columns of numbers" in refusal(tmp_path / "x.csv")


def test_a_first_line_that_counts_the_columns_is_asked_about(tmp_path):
    """Written by pandas, it names columns without a name; else it is a sample: none is lost."""
    path = tmp_path / "x.csv"
    rows = "".join(f"{0.3 * i % 1:.2f},{0.7 * i % 1:.2f},-0.5\n" for i in range(50))
    for first in ("0,1,2", "1,2,3"):
        path.write_text(f"{first}\n{rows}")
        assert "line 1, '" + first in refusal(path, fs=1000.0, unit="g")
        assert "give header, the lines before the numbers: 1 or 0" in refusal(path)
        for header, count in ((0, 51), (1, 50)):
            with open_source(path, SourceOptions(fs=1000.0, unit="g", header=header)) as source:
                assert source.n_samples == count


@pytest.mark.parametrize(
    "text",
    [
        "0,1\n" + "".join(f"{i / 1000},0.5\n" for i in range(1, 50)),  # times go on
        "0;1\n" + "".join(f"{-i};{i * i % 7}\n" for i in range(1, 50)),  # whole numbers all
        "0\n" + "0.5\n0.25\n" * 24 + "0.5\n",  # one column
    ],
)
def test_a_first_line_of_whole_numbers_is_else_a_sample(tmp_path, text):
    (tmp_path / "x.csv").write_text(text)
    with open_source(tmp_path / "x.csv", SourceOptions(fs=1000.0, unit="g")) as source:
        assert source.n_samples == 50
