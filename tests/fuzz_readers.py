"""Damaged recordings by the thousand: every reader must refuse them in words, or read them.

    python tests/fuzz_readers.py --inputs 10000 [--reader wav] [--seed 0]

A reader runs in a process of its own, whose death is seen; what it takes of time and memory is
bounded. A failure names seed and input, so that ``--first INPUT --inputs 1`` repeats it.
"""

import argparse
import os
import resource
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat, wavfile
from wearstate.datasets.readers.open import list_sources, open_source
from wearstate.datasets.source.part import SourceOptions
from wearstate.sim.output.recording import DataError

N_SAMPLES = 60
SIGNAL = np.random.default_rng(0).standard_normal((2, N_SAMPLES))
LONGEST = 25.0  # s for one input: twice what a reader waits for a process of its own
MOST_MEMORY = 200 * 2**20  # byte more than before, of files that small
PIECE = 2**16  # samples read at once

INTERESTING = [
    b"\0",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\0",
]
INTERESTING += [b"\xff" * 8, b"nan", b"inf", b"\n", b",", b";", b"    -1\n", b"1e999", b"-", b'"']


@dataclass(frozen=True)
class Seed:
    """A valid file to start from."""

    suffix: str
    build: Callable[[Path], None]
    options: dict[str, Any] = field(default_factory=dict)


def wav(kind: Any) -> Callable[[Path], None]:
    def build(path: Path) -> None:
        scale = 1 if np.dtype(kind).kind == "f" else np.iinfo(kind).max // 8
        offset = 128 if kind == np.uint8 else 0
        wavfile.write(path, 1000, (SIGNAL.T * scale + offset).astype(kind))

    return build


def wav24(path: Path) -> None:
    """Extensible, three bytes a sample."""
    data = (SIGNAL.T * 2**20).astype("<i4").reshape(-1, 1).view(np.uint8)[:, :3].tobytes()
    form = struct.pack("<HHIIHHHHI", 0xFFFE, 2, 1000, 6000, 6, 24, 22, 24, 3)
    form += struct.pack("<H", 1) + bytes.fromhex("0000000010008000 00aa00389b71")
    body = b"WAVE" + b"fmt " + struct.pack("<I", len(form)) + form
    body += b"data" + struct.pack("<I", len(data)) + data
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def mat4(path: Path) -> None:
    savemat(path, {"x": SIGNAL, "sr": 1000.0, "load": "100"}, format="4")


def mat5(compressed: bool) -> Callable[[Path], None]:
    def build(path: Path) -> None:
        cell = np.empty((1, 2), dtype=object)
        cell[0, 0], cell[0, 1] = SIGNAL, "text"
        bearing = {"gs": SIGNAL[:1].T, "sr": 1000.0, "rate": 25, "load": "100"}
        savemat(path, {"bearing": bearing, "c": cell, "x": SIGNAL}, do_compression=compressed)

    return build


def mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        bearing = file.create_group("bearing")
        bearing.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, value in (("gs", SIGNAL[:1]), ("sr", [[1000.0]]), ("rate", [[25.0]])):
            data = bearing.create_dataset(name, data=value)
            data.attrs["MATLAB_class"] = np.bytes_("double")
        x = file.create_dataset("x", data=SIGNAL.T, chunks=(20, 2), compression="gzip")
        x.attrs["MATLAB_class"] = np.bytes_("double")
        cells = file.create_dataset("c", shape=(1, 2), dtype=h5py.ref_dtype)
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        for i in range(2):
            inner = file.create_dataset(f"#refs#/{'ab'[i]}", data=SIGNAL)
            cells[0, i] = inner.ref
    with path.open("r+b") as handle:
        handle.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        plain = file.create_dataset("rig/acc", data=SIGNAL)
        # of fixed length: a text of another kind costs a process each time
        plain.attrs["units"], plain.attrs["sample_rate_hz"] = np.bytes_("g"), 1000.0
        file.create_dataset("x", data=SIGNAL.T, chunks=(20, 2), compression="gzip", shuffle=True)


def hdf5_text(path: Path) -> None:
    with h5py.File(path, "w") as file:
        plain = file.create_dataset("acc", data=SIGNAL)
        plain.attrs["units"], plain.attrs["sample_rate"] = "g", "1 kHz"


def npy(path: Path) -> None:
    np.save(path, SIGNAL)


def npz(compressed: bool) -> Callable[[Path], None]:
    save = np.savez_compressed if compressed else np.savez
    return lambda path: save(path, x=SIGNAL, y=SIGNAL[0])


def text(delimiter: str, decimal: str) -> Callable[[Path], None]:
    def build(path: Path) -> None:
        rows = [["time [s]", "acc [g]", "v [mm/s]"]]
        rows += [[f"{i / 1000:.3f}", f"{a:.6f}", f"{b:.6f}"] for i, (a, b) in enumerate(SIGNAL.T)]
        lines = [delimiter.join(cell.replace(".", decimal) for cell in row) for row in rows]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    return build


UFF_HEAD = (
    "{name:<80}\nNONE\n18-Apr-16 13:49:58\nNONE\nNONE\n"
    "    1         0    0         0 {name:<10}         1   1 NONE               0   0\n"
    "{code:10d}{n:10d}{even:10d}  0.00000E+00  {step}  0.00000E+00\n"
    "        17    0    0    0 time                 s                   \n"
    "        12    0    0    0 Acceleration         {unit:<20}\n"
    "         0    0    0    0 NONE                 NONE                \n"
    "         0    0    0    0 NONE                 NONE                \n"
)


def uff_head(name: str, n: int, code: int = 2, unit: str = "m/s^2", even: int = 1) -> str:
    step = "1.00000E-03" if even else "0.00000E+00"
    return UFF_HEAD.format(name=name, n=n, code=code, even=even, step=step, unit=unit)


def uff_ascii(path: Path) -> None:
    out = ""
    for name, row in zip(("acc_x", "acc_y"), SIGNAL, strict=True):
        cells = [f"{value:13.5E}" for value in row]
        lines = ["".join(cells[i : i + 6]) for i in range(0, len(cells), 6)]
        out += f"    -1\n    58\n{uff_head(name, len(row))}" + "\n".join(lines) + "\n    -1\n"
    path.write_text(out)


def uff_binary(path: Path) -> None:
    raw = SIGNAL[0].astype("<f4").tobytes()
    head = f"    58b     1     2          11{len(raw):12d}     0     0           0           0\n"
    out = b"    -1\n" + head.encode() + uff_head("acc_x", N_SAMPLES).encode() + raw
    path.write_bytes(out + b"\n    -1\n")


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for i in range(3):  # three segments
            part = SIGNAL[:, i * 20 : (i + 1) * 20]
            kept = {"wf_increment": 1e-3, "unit_string": "g"}
            writer.write_segment(
                [ChannelObject("rig", "ab"[k], part[k], properties=kept) for k in range(2)]
            )


def raw(path: Path) -> None:
    path.write_bytes((SIGNAL.T * 1000).astype("<i2").tobytes())


SEEDS: dict[str, list[Seed]] = {
    "wav": [
        Seed(".wav", wav(np.uint8)),
        Seed(".wav", wav(np.int16)),
        Seed(".wav", wav(np.float32)),
        Seed(".wav", wav24),
    ],
    "mat4": [Seed(".mat", mat4), Seed(".mat", mat4, {"variable": "x"})],
    "mat5": [
        Seed(".mat", mat5(True)),
        Seed(".mat", mat5(False)),
        Seed(".mat", mat5(False), {"variable": "x"}),
    ],
    "mat73": [Seed(".mat", mat73), Seed(".mat", mat73, {"variable": "x"})],
    "hdf5": [Seed(".h5", hdf5, {"variable": name}) for name in ("rig/acc", "x")],
    "hdf5-text": [Seed(".h5", hdf5_text)],
    "npy": [Seed(".npy", npy)],
    "npz": [Seed(".npz", npz(flag), {"variable": "x"}) for flag in (True, False)],
    "text": [
        Seed(".csv", text(",", ".")),
        Seed(".csv", text(";", ",")),
        Seed(".tsv", text("\t", ".")),
    ],
    "uff": [Seed(".uff", uff_ascii), Seed(".uff", uff_binary)],
    "tdms": [Seed(".tdms", tdms)],
    "raw": [
        Seed(".bin", raw, {"dtype": "<int16", "n_channels": 2, "order": "interleaved"}),
        Seed(".bin", raw, {"dtype": ">int24", "n_channels": 1, "offset": 3}),
    ],
}
"""Valid files of every reader."""

Change = tuple[int, float, int]
"""What is done, where (part of the file), and with what."""


def changed(content: bytes, changes: list[Change]) -> bytes:
    """Flips, overwritten bytes, cuts and insertions, one after the other."""
    out = bytearray(content)
    for kind, where, value in changes:
        place = min(int(where * len(out)), max(len(out) - 1, 0))
        filling = INTERESTING[value % len(INTERESTING)]
        if kind == 0 and out:
            out[place] ^= 1 << (value % 8)
        elif kind == 1:
            out[place : place + len(filling)] = filling
        elif kind == 2:
            del out[place:]
        elif kind == 3:
            del out[place : place + 1 + value % 64]
        elif kind == 4:
            out[place:place] = filling
        elif kind == 5:
            out[place:place] = bytes(out[place // 2 : place // 2 + 1 + value])
        elif out:
            out[place] = value
    return bytes(out)


def attempt(path: Path, options: dict[str, Any]) -> str:
    """Open, list and read all; what comes of it, any other error being a failure."""
    try:
        declared = SourceOptions(**options)
        for source in list_sources(path, declared):
            source.close()
        with open_source(path, declared) as source:
            for start in range(0, source.n_samples, PIECE):
                stop = min(start + PIECE, source.n_samples)
                values = source.read(start, stop)
                assert values.shape == (len(source.channels), stop - start)
                assert np.isfinite(values).all()
    except DataError:
        return "refused"
    return "read"


def random_changes(seed: int, number: int) -> list[Change]:
    rng = np.random.default_rng([seed, number])
    return [
        (int(rng.integers(7)), float(rng.random()), int(rng.integers(256)))
        for _ in range(int(rng.integers(1, 5)))
    ]


def memory() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def campaign(reader: str, seed: int, first: int, count: int, mark: Path) -> None:
    """Inputs of one reader in this process; prints the counts, raises at a failure."""
    warnings.simplefilter("error")
    counts = {"read": 0, "refused": 0}
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        built = []
        for index, item in enumerate(SEEDS[reader]):
            path = Path(folder) / f"seed{index}{item.suffix}"
            item.build(path)
            assert attempt(path, item.options) == "read", "a seed must be valid"
            built.append((path.read_bytes(), path.with_stem("damaged"), item.options))
        before = memory()
        for number in range(first, first + count):
            mark.write_text(str(number))
            content, path, options = built[number % len(built)]
            path.write_bytes(changed(content, random_changes(seed, number)))
            begin = time.perf_counter()
            counts[attempt(path, options)] += 1
            slowest = max(slowest, time.perf_counter() - begin)
            assert slowest < LONGEST, f"{slowest:.1f} s"
        grown = memory() - before
    print(
        f"{reader}: {count} inputs, {counts['refused']} refused, {counts['read']} read, slowest "
        f"{slowest:.3f} s, {grown / 2**20:.0f} MiB more"
    )
    assert grown < MOST_MEMORY, "memory"


def main() -> int:
    """Run the campaigns, one process each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reader", choices=SEEDS, action="append")
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child is not None:
        campaign(given.reader[0], given.seed, given.first, given.inputs, given.child)
        return 0
    failed = 0
    for reader in given.reader or SEEDS:
        with tempfile.TemporaryDirectory() as folder:
            mark = Path(folder) / "mark"
            command = [sys.executable, "-X", "faulthandler", __file__, "--child", str(mark)]
            command += ["--reader", reader, "--inputs", str(given.inputs)]
            command += ["--first", str(given.first), "--seed", str(given.seed)]
            done = subprocess.run(command, env=os.environ, check=False)
            if done.returncode:
                failed += 1
                number = mark.read_text() if mark.exists() else "none"
                print(f"{reader}: FAILED at input {number} of seed {given.seed}")
    return failed


if __name__ == "__main__":
    sys.exit(main())
