"""Older and rarer kinds of known formats, against the library that everyone reads them with."""

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat, savemat, wavfile
from wearstate.datasets.readers.open import list_sources, open_source
from wearstate.datasets.source.part import DECLARED, SourceOptions
from wearstate.sim.output.recording import DataError

SIGNAL = np.random.default_rng(3).standard_normal((2, 50))
LIBRARY = Path(scipy.__file__).parent / "io"
MAT = sorted(LIBRARY.rglob("tests/data/*.mat"))
WAV = sorted(LIBRARY.rglob("tests/data/*.wav"))


def values(path, **options):
    with open_source(path, SourceOptions(**options)) as source:
        return source.read()


def refusal(path, **options):
    with pytest.raises(DataError) as caught:
        values(path, **options)
    return str(caught.value)


# -- the files that the library is tested with -------------------------------------------------


def attempt(read, path):
    """What the library reads, None where it gives up."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return read(path)
        except Exception:  # of as many types as there are ways to be damaged
            return None


@pytest.mark.skipif(not MAT, reason="this SciPy came without its test data")
@pytest.mark.parametrize("path", MAT, ids=lambda path: path.name)
def test_matlab_files_are_read_as_the_library_reads_them(path):
    found = attempt(loadmat, path)
    if found is None:
        return
    known = {
        name: array
        for name, array in found.items()
        if isinstance(array, np.ndarray) and array.dtype.kind in "iuf" and array.size > 1
        if not name.startswith("__")
    }
    sources = {s.part: s for s in list_sources(path, SourceOptions(order="interleaved"))}
    assert {name for name, array in known.items() if array.ndim == 2} <= set(sources)
    for name in set(sources) & set(known):
        assert_array_equal(sources[name].read(), known[name].T)


@pytest.mark.skipif(not WAV, reason="this SciPy came without its test data")
@pytest.mark.parametrize("path", WAV, ids=lambda path: path.name)
def test_wav_files_are_read_as_the_library_reads_them(path):
    found = attempt(wavfile.read, path)
    if found is None:
        return
    rate, samples = found
    partial = "early-eof" in path.name
    if partial:
        assert "read what is there with partial" in refusal(path)
    with open_source(path, SourceOptions(unit="FS", partial=partial)) as source:
        assert source.sample_rate == rate
        assert (DECLARED in source.conditions) == partial
        ours = source.read()
    known = np.atleast_2d(samples.T).astype(float)
    if samples.dtype.kind in "iu":
        middle = 128.0 if samples.dtype == np.uint8 else 0.0
        known = (known - middle) / 2.0 ** (8 * samples.dtype.itemsize - 1)
    assert_array_equal(ours, known)


def test_a_matlab_7_3_file_may_call_itself_7_0(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "old.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"] = SIGNAL
        file["x"].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as handle:
        handle.write(b"MATLAB 7.0 MAT-file, Platform: GLNX86".ljust(124) + b"\x00\x02IM")
    assert_array_equal(values(path, channels=("a", "b")), SIGNAL)


# -- MATLAB 4 ----------------------------------------------------------------------------------


def mat4(name, array, *, machine=0, precision=0, kind=0, shape=None, imaginary=0):
    """A matrix of level 4, written by hand."""
    order = "<>"[machine]
    code = ("f8", "f4", "i4", "i2", "u2", "u1")[precision]
    rows, columns = shape or array.shape
    label = name.encode() + b"\0"
    numbers = (1000 * machine + 10 * precision + kind, rows, columns, imaginary, len(label))
    data = np.asarray(array).T.astype(np.dtype(code).newbyteorder(order)).tobytes()
    return struct.pack(f"{order}5i", *numbers) + label + data


@pytest.mark.parametrize("machine", [0, 1])
@pytest.mark.parametrize("precision", range(6))
def test_mat4_of_every_precision_and_byte_order(tmp_path, machine, precision):
    path = tmp_path / "x.mat"
    numbers = np.round(np.abs(SIGNAL) * 50)
    words = np.array([[ord(letter) for letter in "text"]])
    path.write_bytes(
        mat4("x", numbers.T, machine=machine, precision=precision)
        + mat4("t", words, machine=machine, kind=1)
    )
    assert_array_equal(values(path, variable="x", channels=("a", "b")), numbers)
    assert_array_equal(loadmat(path)["x"], numbers.T)


def test_mat4_as_the_library_writes_it_and_complex_ones(tmp_path):
    path = tmp_path / "x.mat"
    savemat(path, {"x": SIGNAL[:1].T, "z": SIGNAL.T + 1j}, format="4")
    assert_array_equal(values(path), SIGNAL[:1])
    assert "z is complex (50, 2), must be real" in refusal(path, variable="z")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (mat4("x", SIGNAL)[:-1], "must be >= 822; take an intact copy"),
        (mat4("x", SIGNAL)[:10], "must be >= 20"),
        (mat4("x", SIGNAL, shape=(2**31 - 1, 2**31 - 1)), "must be >= 368934"),
        (mat4("x", SIGNAL, shape=(-2, 50)), "shape (-2, 50)"),
        (struct.pack("<5i", 2000, 1, 2, 0, 2) + b"x\0", "type 2000 at byte 0, must be of level 4"),
        (struct.pack("<5i", 0, 1, 2, 0, 2**30) + b"x\0", "a name of 1073741824 byte"),
    ],
)
def test_mat4_sizes_that_cannot_be(tmp_path, content, message):
    path = tmp_path / "x.mat"
    path.write_bytes(content)
    assert message in refusal(path)


# -- WAV ---------------------------------------------------------------------------------------


def wav(path, *, kind=1, channels=1, bits=16, width=2, data=b"", order="<", declared=None):
    """A WAV file with its samples in containers of so many bytes."""
    frame = channels * width
    form = struct.pack(f"{order}HHIIHH", kind, channels, 8000, 8000 * frame, frame, bits)
    length = len(data) if declared is None else declared
    body = b"WAVEfmt " + struct.pack(f"{order}I", 16) + form
    body += b"data" + struct.pack(f"{order}I", length) + data
    head = b"RIFF" if order == "<" else b"RIFX"
    path.write_bytes(head + struct.pack(f"{order}I", len(body)) + body)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("bits", "width"), [(12, 2), (20, 3), (20, 4), (36, 5), (45, 6), (53, 7), (64, 8)]
)
def test_wav_samples_of_odd_widths_are_parts_of_full_scale(tmp_path, bits, width, order):
    whole = np.array([-(2 ** (bits - 1)), -1, 0, 1, 2 ** (bits - 1) - 1], dtype=object)
    at_top = [int(value) << (8 * width - bits) for value in whole]
    end = "little" if order == "<" else "big"
    data = b"".join(value.to_bytes(width, end, signed=True) for value in at_top)
    path = wav(tmp_path / "x.wav", bits=bits, width=width, data=data, order=order)
    expected = np.array([float(value) for value in whole]) / 2.0 ** (bits - 1)
    assert_array_equal(values(path, unit="FS")[0], expected)


@pytest.mark.parametrize(
    ("kind", "table"),
    [
        # G.711: the first bytes as tables of it begin, silence of either sign, and the largest
        (7, {0: -32124, 1: -31100, 2: -30076, 3: -29052, 0x7F: 0, 0xFF: 0, 0xEF: 132, 0x80: 32124}),
        (6, {0: -5504, 1: -5248, 2: -6016, 3: -5760, 0x55: -8, 0xD5: 8, 0x2A: -32256, 0xAA: 32256}),
    ],
)
def test_wav_of_g711(tmp_path, kind, table):
    path = wav(tmp_path / "x.wav", kind=kind, bits=8, width=1, data=bytes(range(256)))
    found = 2.0**15 * values(path, unit="FS")[0]
    assert {byte: found[byte] for byte in table} == table
    assert_array_equal(np.sort(found), np.sort(-found))
    assert len(np.unique(np.abs(found))) == 128


def test_wav_cut_short_offers_what_is_there(tmp_path):
    data = np.arange(20, dtype="<i2").tobytes()
    path = wav(tmp_path / "x.wav", channels=2, data=data[:-3], declared=len(data))
    assert "or read what is there with partial" in refusal(path, unit="FS")
    options = SourceOptions(unit="FS", partial=True)
    with open_source(path, options) as source:
        assert source.conditions == {DECLARED: 10.0}
        assert_array_equal(2.0**15 * source.read(), np.arange(18).reshape(-1, 2).T)
    # as a program leaves it that writes into a pipe
    wav(path, channels=2, data=data, declared=0xFFFFFFFF)
    assert values(path, unit="FS", partial=True).shape == (2, 10)
    wav(path, channels=2, data=b"", declared=40)
    assert "0 byte of samples must be a multiple >= 1 of 4" in refusal(path, partial=True)


def test_raw_with_an_odd_end_offers_whole_frames(tmp_path):
    path = tmp_path / "x.bin"
    path.write_bytes(np.arange(9, dtype="<i2").tobytes() + b"x")
    layout = {"dtype": "<i2", "n_channels": 2, "fs": 10.0, "unit": "g"}
    assert "must be a multiple" in refusal(path, **layout, order="interleaved")
    assert values(path, **layout, order="interleaved", partial=True).shape == (2, 4)
    assert "must be a multiple" in refusal(path, **layout, order="blocks", partial=True)


# -- TDMS --------------------------------------------------------------------------------------


@pytest.fixture
def tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    kept = {"wf_increment": 1 / 25600, "unit_string": "g"}
    path = tmp_path / "x.tdms"
    with nptdms.TdmsWriter(path) as writer:
        for part in (SIGNAL[:, :20], SIGNAL[:, 20:]):
            writer.write_segment(
                [
                    nptdms.ChannelObject("rig", n, row, properties=kept)
                    for n, row in zip("xy", part, strict=True)
                ]
            )
    return path


def test_tdms_with_fewer_samples_than_declared_offers_those_it_has(tdms):
    whole = tdms.read_bytes()
    tdms.write_bytes(whole[:-85])  # of y ten whole samples and a part of one
    assert "must be >=" in refusal(tdms)
    with open_source(tdms, SourceOptions(partial=True)) as source:
        assert source.conditions == {DECLARED: 50.0}
        assert (source.part, source.n_samples) == ("rig", 39)
        assert_allclose(source.read(), SIGNAL[:, :39] * 9.80665, rtol=1e-15)
    last = whole.rindex(b"TDSm")
    # never closed; or closed with a last chunk in which every channel is shorter by its share
    for length, n in ((b"\xff" * 8, 39), (struct.pack("<Q", len(whole) - last - 28 - 85), 44)):
        tdms.write_bytes(whole[: last + 12] + length + whole[last + 20 : -85])
        assert "read what is there with partial" in refusal(tdms)
        assert_allclose(values(tdms, partial=True)[0], SIGNAL[0, :n] * 9.80665, rtol=1e-15)
    tdms.write_bytes(whole)
    with open_source(tdms, SourceOptions(partial=True)) as source:
        assert (source.n_samples, source.conditions) == (50, {})
