"""Hand-made files that a reader may stumble over, each with the command that meets it.

    python tests/nasty_files.py [NAME...]

prints what each command says.
"""

import contextlib
import io
import os
import struct
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from scipy.io import savemat
from scipy.sparse import csc_array

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_commands
import fuzz_readers

DECLARED = ("--fs", "1000", "--unit", "m/s^2")
ROWS = "".join(f"{i / 1000:.3f},{i % 7}\n" for i in range(64))
SIGNAL = fuzz_readers.SIGNAL


@dataclass(frozen=True)
class Nasty:
    """How a file is made, what is done with it, and what must be said."""

    build: Callable[[Path], object]
    """Makes the file at the path, or what stands there."""
    name: str
    says: str
    """Pattern in what the command says."""
    words: tuple[str, ...] = ("info", "FILE", *DECLARED)
    """``FILE`` stands for the path."""
    code: int = 2


def text(content: str | bytes) -> Callable[[Path], object]:
    raw = content.encode() if isinstance(content, str) else content
    return lambda path: path.write_bytes(raw)


def array(values: object) -> Callable[[Path], object]:
    return lambda path: np.save(path, np.asarray(values))


# --- binary recordings


def wav_header(path: Path, *, channels: int = 1, rate: int = 1000, bits: int = 16, says: int = 8):
    form = struct.pack("<HHIIHH", 1, channels, rate, rate * 2, 2, bits)
    data = b"data" + struct.pack("<I", says) + bytes(8)
    body = b"WAVEfmt " + struct.pack("<I", len(form)) + form + data
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def mat4_header(path: Path, rows: int, columns: int) -> None:
    path.write_bytes(struct.pack("<5i", 0, rows, columns, 0, 2) + b"x\0" + bytes(64))


def mat5_of(path: Path, **variables: object) -> None:
    savemat(path, variables)


def mat5_huge(path: Path) -> None:
    """A matrix of 2^31 - 1 byte in a file of 200."""
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<2I", 14, 2**31 - 1) + bytes(64))


def npy_pickled(path: Path) -> None:
    np.save(path, np.array([{"a": 1}, None], dtype=object), allow_pickle=True)


def npy_huge(path: Path) -> None:
    """A header of 2^50 numbers and none of them."""
    np.lib.format.write_array_header_1_0(
        handle := io.BytesIO(), {"descr": "<f8", "fortran_order": False, "shape": (2**50,)}
    )
    path.write_bytes(handle.getvalue())


def npz_bomb(path: Path) -> None:
    """A gigabyte of zeros in a kilobyte."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (2**27,)}
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", head.getvalue() + bytes(2**20))
        archive.infolist()[0].file_size = 2**30 + 128  # as the table of contents says


def uff_huge(path: Path) -> None:
    fuzz_readers.uff_ascii(path)
    path.write_bytes(path.read_bytes().replace(b"        60", b"2147483647"))


def tdms_huge(path: Path) -> None:
    """One segment whose index names 2^32 - 1 objects."""
    meta = struct.pack("<I", 2**32 - 1) + bytes(16)
    head = b"TDSm" + struct.pack("<IIQQ", 0x0E, 4713, len(meta), len(meta))
    path.write_bytes(head + meta)


# --- HDF5


def hdf5(fill: Callable[[h5py.File], object]) -> Callable[[Path], object]:
    def build(path: Path) -> None:
        with h5py.File(path, "w") as file:
            fill(file)

    return build


def looped(file: h5py.File) -> None:
    group = file.create_group("a")
    group["again"] = file["/"]
    group["x"] = SIGNAL


def linked_away(file: h5py.File) -> None:
    secret = Path(file.filename).with_name("secret.h5")
    with h5py.File(secret, "w") as other:
        other["x"] = SIGNAL
    file["x"] = h5py.ExternalLink("secret.h5", "/x")


def stored_away(file: h5py.File) -> None:
    """Samples in another file: one that the reader was never given."""
    secret = Path(file.filename).with_name("secret.bin")
    secret.write_bytes(bytes(800))
    file.create_dataset("x", shape=(100,), dtype="<f8", external=[(str(secret), 0, 800)])


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(100,), dtype="<f8")
    layout[:] = h5py.VirtualSource("absent.h5", "x", shape=(100,))
    file.create_virtual_dataset("x", layout)


def soft_loop(file: h5py.File) -> None:
    file["x"] = h5py.SoftLink("/y")
    file["y"] = h5py.SoftLink("/x")


def of_type(dtype: object, shape: tuple[int, ...] = (64,)) -> Callable[[Path], object]:
    return hdf5(lambda file: file.create_dataset("x", shape=shape, dtype=dtype))


def choices(file: h5py.File) -> None:
    kind = h5py.enum_dtype({"ON": 1, "OFF": 0}, "i1")
    file.create_dataset("x", data=np.arange(64, dtype="i1") % 2, dtype=kind)


def unwritten(file: h5py.File) -> None:
    """A shape of 2^60 samples without a byte of storage."""
    file.create_dataset("x", shape=(2**60,), dtype="<f4", chunks=(1024,))


# --- what is no file


def symlink_loop(path: Path) -> None:
    path.symlink_to(path.name)


def healthy_csv(path: Path) -> None:
    path.write_text("time [s],acc [m/s^2]\n" + ROWS)


def zip_of(**members: bytes) -> Callable[[Path], object]:
    def build(path: Path) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in members.items():
                archive.writestr(name.replace("_", "."), content)

    return build


MEMBERS = {"seal_json": b"[" * 10**5, "structure_json": b"{}", "arrays_npz": b""}
INFO = ("info", "FILE")
SCENE = ("scene", "check", "FILE")
RECIPE = ("recipe", "check", "FILE")
IMPORT = ("import", "FILE", *DECLARED, "-o", "OUT/out.h5", "-j", "1")
RAW = ("info", "FILE", *DECLARED, "--dtype", "<int16", "--n-channels", "2")

FILES: dict[str, Nasty] = {
    **{
        f"empty {suffix}": Nasty(text(b""), f"x{suffix}", "0 byte|cannot be read")
        for suffix in (".wav", ".mat", ".csv", ".h5", ".npy", ".npz", ".uff", ".tdms")
    },
    "empty raw": Nasty(text(b""), "x.bin", "0 byte", RAW),
    "empty model": Nasty(text(b""), "x.wsm", "not a zip", INFO),
    "empty scene": Nasty(text(b""), "x.toml", "machine is missing", SCENE),
    # text
    "BOM alone": Nasty(text(b"\xef\xbb\xbf"), "x.csv", "no line"),
    "BOM twice": Nasty(
        text(b"\xef\xbb\xbf\xef\xbb\xbft,a\n" + ROWS.encode()), "x.csv", r"channels +a \[", code=0
    ),
    "UTF-16": Nasty(text(("t,a\n" + ROWS).encode("utf-16")), "x.csv", "UTF-16"),
    "UTF-32": Nasty(text(("t,a\n" + ROWS).encode("utf-32")), "x.csv", "UTF-32"),
    "NUL bytes": Nasty(text(("t,a\n" + ROWS).replace("3,", "3\0,")), "x.csv", "text file"),
    "one sample": Nasty(text("t,a\n0.0,1\n"), "x.csv", r"1 time\(s\), must have >= 2"),
    "header alone": Nasty(text("time [s],a [g]\n"), "x.csv", "no columns of numbers"),
    "mixed separators": Nasty(
        text("a;b\n" + "1;2\n1,2\n" * 20), "x.csv", "give delimiter or decimal"
    ),
    "quote never closed": Nasty(text('t,"a\n' + ROWS), "x.csv", r"channels +a \[", code=0),
    "quoted line feed": Nasty(text('t,"a\nb"\n' + ROWS), "x.csv", r"channels +a \[", code=0),
    "10^6 columns": Nasty(
        text(",".join(["1"] * 10**6) + "\n"), "x.csv", "no line that ends within"
    ),
    "ragged rows": Nasty(text("a,b\n" + "1,2\n1,2,3\n" * 20), "x.csv", "line 2 .* unlike"),
    "nan alone": Nasty(text("a,b\n" + "nan,nan\n" * 40), "x.csv", "'a' is nan at index 0.*finite"),
    "inf alone": Nasty(text("a,b\n" + "inf,-inf\n" * 40), "x.csv", "'a' is inf at index 0"),
    "complex cells": Nasty(text("a,b\n" + "1+2j,3\n" * 40), "x.csv", "'1[+]2j', a complex"),
    "numbers beyond double": Nasty(text("a,b\n" + "1e999,1\n" * 40), "x.csv", "'a' is inf"),
    "digits without end": Nasty(text("a\n" + "9" * 10**6 + "\n"), "x.csv", "no columns of numbers"),
    "time backwards": Nasty(
        text("time [s],a [g]\n" + "".join(f"{-i / 1000},1\n" for i in range(40))),
        "x.csv",
        r"-0.001 \(line 3\) after 0.0",
    ),
    "time stands": Nasty(
        text("time [s],a [g]\n" + "0.5,1\n" * 40), "x.csv", r"0.5 \(line 3\) after 0.5"
    ),
    "negative rate": Nasty(
        healthy_csv,
        "x.csv",
        "--fs = -1000.0 Hz must be >= 0.001",
        ("info", "FILE", "--fs", "-1000", "--unit", "m/s^2"),
    ),
    "all one line": Nasty(text("x" * 10**7), "x.csv", "no line that ends within"),
    # binary
    "WAV of 65,535 channels": Nasty(
        lambda p: wav_header(p, channels=65535), "x.wav", "65535 channel"
    ),
    "WAV without channels": Nasty(lambda p: wav_header(p, channels=0), "x.wav", r"0 channel\(s\)"),
    "WAV at 0 Hz": Nasty(lambda p: wav_header(p, rate=0), "x.wav", "sample_rate = 0.0 Hz must be"),
    "WAV of 4 GB in 52 byte": Nasty(
        lambda p: wav_header(p, says=2**32 - 2), "x.wav", "has 52 byte, must be >= 4294967338"
    ),
    "WAV without samples": Nasty(lambda p: wav_header(p, says=0), "x.wav", "0 byte of samples"),
    "MAT 4 of 2^31 rows": Nasty(
        lambda p: mat4_header(p, 2**31 - 1, 2**31 - 1), "x.mat", "has 86 byte, must be >= 3689"
    ),
    "MAT 4 of -1 row": Nasty(lambda p: mat4_header(p, -1, 8), "x.mat", r"shape \(-1, 8\)"),
    "MAT 5 of 2 GB": Nasty(mat5_huge, "x.mat", "has 200 byte, must be >= 2147483783"),
    "MAT of text": Nasty(lambda p: mat5_of(p, x="text"), "x.mat", "no recording"),
    "MAT sparse": Nasty(lambda p: mat5_of(p, x=csc_array(np.eye(40))), "x.mat", "x sparse"),
    "MAT complex": Nasty(lambda p: mat5_of(p, x=np.arange(40) * 1j), "x.mat", "x complex"),
    "MAT empty": Nasty(lambda p: mat5_of(p, x=np.zeros((0, 4))), "x.mat", "no recording"),
    "MAT of four axes": Nasty(
        lambda p: mat5_of(p, x=np.ones((2, 3, 4, 5))), "x.mat", r"x \(2, 3, 4, 5\)"
    ),
    "NPY pickled": Nasty(npy_pickled, "x.npy", "pickled objects"),
    "NPY of 2^50 numbers": Nasty(npy_huge, "x.npy", "must be 9007199254741120"),
    "NPY by columns": Nasty(array(np.asfortranarray(SIGNAL)), "x.npy", "samples +60", code=0),
    "NPY of one number": Nasty(array(3.0), "x.npy", r"shape \(\)"),
    "NPY of texts": Nasty(array(["a", "b"]), "x.npy", "<U1, must be real"),
    "NPY of truth": Nasty(array(np.ones(40, bool)), "x.npy", "bool, must be real"),
    "NPZ bomb": Nasty(npz_bomb, "x.npz", "inflates to 1073741952 byte"),
    "NPZ of no array": Nasty(zip_of(readme_txt=b"no"), "x.npz", "readme.txt is no array"),
    "UFF of 2^31 samples": Nasty(uff_huge, "x.uff", "10 lines of numbers, must have 357913942"),
    "TDMS of 2^32 objects": Nasty(tdms_huge, "x.tdms", "cannot be read"),
    "RAW of half a sample": Nasty(text(bytes(7)), "x.bin", "7 byte .* multiple", RAW),
    # HDF5
    "HDF5 looped": Nasty(hdf5(looped), "x.h5", "1 measured record", IMPORT, 0),
    "HDF5 linked away": Nasty(
        hdf5(linked_away), "x.h5", "x is a link, which is not followed", IMPORT
    ),
    "HDF5 stored away": Nasty(hdf5(stored_away), "x.h5", "x is kept in other files", IMPORT),
    "HDF5 virtual": Nasty(hdf5(virtual), "x.h5", "x is kept in other files", IMPORT),
    "HDF5 soft loop": Nasty(hdf5(soft_loop), "x.h5", "y is a link", IMPORT),
    "HDF5 of objects": Nasty(of_type(h5py.ref_dtype), "x.h5", "x is object", IMPORT),
    "HDF5 of texts": Nasty(of_type(h5py.string_dtype()), "x.h5", "x is object", IMPORT),
    "HDF5 ragged": Nasty(of_type(h5py.vlen_dtype("<f4")), "x.h5", "x is object", IMPORT),
    "HDF5 of records": Nasty(
        of_type([("a", "<f4"), ("b", "<i4")]), "x.h5", "x is .*must be real", IMPORT
    ),
    "HDF5 of choices": Nasty(hdf5(choices), "x.h5", "1 measured record", IMPORT, 0),
    "HDF5 of no sample": Nasty(of_type("<f4", (0, 3)), "x.h5", r"x is float32 \(0, 3\)", IMPORT),
    "HDF5 of 2^60 samples": Nasty(hdf5(unwritten), "x.h5", "holds 0 of", IMPORT),
    "HDF5 without a dataset": Nasty(hdf5(lambda file: None), "x.h5", "no recording", IMPORT),
    # what is no file, and names
    "symlink loop": Nasty(symlink_loop, "x.csv", "is no file"),
    "FIFO": Nasty(os.mkfifo, "x.csv", "is no file"),
    "folder": Nasty(Path.mkdir, "x.wav", "is a folder"),
    "device": Nasty(lambda p: p.symlink_to("/dev/zero"), "x.wav", "is no file"),
    "line feed in a name": Nasty(healthy_csv, "a\nb.csv", "samples +64", code=0),
    "signs in a name": Nasty(
        healthy_csv, "$x^{ %s '\"`;\\.csv", "not plotted", (*INFO, "--plot", "OUT.svg"), code=0
    ),
    "output to a folder that is none": Nasty(
        healthy_csv, "x.csv", "absent is not a folder", ("import", "FILE", "-o", "OUT/absent/x.h5")
    ),
    "output over the input": Nasty(
        healthy_csv, "x.csv", "is also an input", ("import", "FILE", "-o", "FILE", "--force")
    ),
    # scenes, recipes, models
    "TOML of deep brackets": Nasty(text("a = " + "[" * 10**5), "x.toml", "nested too deep", SCENE),
    "TOML of a long number": Nasty(text("a = " + "9" * 10**5), "x.toml", "<= 64 bit", SCENE),
    "TOML of many keys": Nasty(
        text("".join(f"k{i} = 1\n" for i in range(10**4))), "x.toml", "machine is missing", SCENE
    ),
    "TOML deep keys": Nasty(
        text(".".join("a" * 20000) + " = 1\n"), "x.toml", "nested too deep", RECIPE
    ),
    "recipe of itself": Nasty(
        text('extends = "x.toml"\n'), "x.toml", "x -> x must not come back", RECIPE
    ),
    "model: another zip": Nasty(zip_of(readme_txt=b"no"), "x.wsm", "holds readme.txt", INFO),
    "model: deep card": Nasty(
        zip_of(card_json=b"[" * 10**5, **MEMBERS), "x.wsm", "seal.json cannot be read", INFO
    ),
    "model: card that is a list": Nasty(
        zip_of(card_json=b"[1, 2]", **MEMBERS), "x.wsm", "seal", INFO
    ),
    "model that is a picture": Nasty(
        text(b"\x89PNG\r\n\x1a\n" + bytes(100)), "x.wsm", "no intact model", INFO
    ),
}
"""By name; each of another kind."""


def attempt(nasty: Nasty, folder: Path) -> tuple[int | None, str]:
    """Exit code of the command, and what it says."""
    path = folder / nasty.name
    nasty.build(path)
    log = folder / "log"
    words = [word.replace("FILE", str(path)).replace("OUT", str(folder)) for word in nasty.words]
    code, _ = fuzz_commands.run_forked(words, log)
    return code, log.read_text(encoding="utf-8", errors="replace")


def main(names: list[str]) -> None:
    """Show what each command says."""
    fuzz_commands.warm_up()
    for name in names or FILES:
        with tempfile.TemporaryDirectory() as folder:
            code, said = attempt(FILES[name], Path(folder))
        fault = fuzz_commands.fault_of(code, said)
        said = said.replace(f"{folder}/", "")
        print(f"--- {name}: {code} {'FAULT ' + fault if fault else ''}\n{said[-400:].rstrip()}")


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        main(sys.argv[1:])
