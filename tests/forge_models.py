"""Damaged and forged model files by the thousand: each is refused in words, or says the same.

    python tests/forge_models.py MODEL OTHER --files 1000 [--seed 0]

MODEL and OTHER are intact models of one kind of machine. A child process reads the files, whose
death, silence and growth are seen; whatever it would run or write is counted. A failure names
its number, so that ``--first NUMBER --files 1`` repeats it.
"""

import argparse
import hashlib
import io
import json
import pickle
import resource
import select
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Members = dict[str, bytes]
LONGEST = 60.0  # s for one file, on a machine that is busy
MOST_MEMORY = 700 * 2**20  # byte more than before: the largest arrays believed, twice and a bit
TABLES = ("card.json", "structure.json")
WATCHED = (
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "subprocess.Popen",
    "socket.connect",
)


# --- containers


def unpacked(path: Path) -> Members:
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}


def packed(members: Members, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", method) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return data.getvalue()


def sealed(members: Members) -> Members:
    """With the right checksums, as a forger would compute them."""
    seal = json.loads(members["seal.json"])
    parts = {name: data for name, data in members.items() if name != "seal.json"}
    seal["sha256"] = {name: hashlib.sha256(data).hexdigest() for name, data in parts.items()}
    return {"seal.json": json.dumps(seal).encode(), **parts}


def arrays_of(members: Members) -> dict[str, Any]:
    with np.load(io.BytesIO(members["arrays.npz"])) as stored:
        return {name: stored[name] for name in stored.files}


def with_arrays(members: Members, arrays: dict[str, Any]) -> bytes:
    data = io.BytesIO()
    np.savez(data, allow_pickle=True, **arrays)
    return packed(sealed({**members, "arrays.npz": data.getvalue()}))


# --- damage: what happens to files


def flipped(rng: np.random.Generator, whole: bytes, _other: bytes) -> bytes:
    data = bytearray(whole)
    for place in rng.integers(0, len(data), int(rng.integers(1, 4))):
        data[place] ^= 1 << int(rng.integers(8))
    return bytes(data)


def cut(rng: np.random.Generator, whole: bytes, _other: bytes) -> bytes:
    return whole[: int(rng.integers(len(whole)))]


def holed(rng: np.random.Generator, whole: bytes, _other: bytes) -> bytes:
    start = int(rng.integers(len(whole)))
    length = int(rng.integers(1, 4096))
    filler = bytes(length) if rng.integers(2) else b""
    return whole[:start] + filler + whole[start + length :]


def mixed(rng: np.random.Generator, whole: bytes, other: bytes) -> bytes:
    place = int(rng.integers(min(len(whole), len(other))))
    return whole[:place] + other[place:]


DAMAGE = (flipped, flipped, cut, holed, mixed)


# --- forgery: what somebody makes of a file, with the right checksums


def swapped(rng: np.random.Generator, mine: Members, other: Members) -> bytes:
    """Members of another model; resealed or not."""
    name = str(rng.choice([*TABLES, "arrays.npz", "seal.json"]))
    changed = {**mine, name: other[name]}
    return packed(sealed(changed) if rng.integers(2) else changed)


def tree(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    """Trees that lead in rings, out of their table, or to features that do not exist."""
    arrays = arrays_of(mine)
    places = [
        name for name in arrays if name.rpartition(".")[2] in ("left", "right", "root", "feature")
    ]
    name = str(rng.choice(places))
    array = np.array(arrays[name])
    at = int(rng.integers(array.size))
    values = [
        -1,
        0,
        at,
        at - 1,
        array.size,
        2**31 - 1,
        2**62,
        -(2**63),
        int(rng.integers(array.size)),
    ]
    array[at] = values[int(rng.integers(len(values)))]
    arrays[name] = array
    if rng.integers(3) == 0:
        depth = name.rpartition(".")[0] + ".depth"
        arrays[depth] = np.int64(rng.choice([0, 1, -1, 10**9, 2**62]))
    return with_arrays(mine, arrays)


def number(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    """A number that is none, or out of all bounds."""
    arrays = arrays_of(mine)
    name = str(rng.choice(list(arrays)))
    array = np.array(arrays[name], dtype=float)
    flat = array.reshape(-1)
    flat[int(rng.integers(flat.size))] = rng.choice(
        [np.nan, np.inf, -np.inf, 1e308, -1.0, 0.0, 5e-324]
    )
    return with_arrays(mine, {**arrays, name: array})


def shape(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    arrays = arrays_of(mine)
    name = str(rng.choice(list(arrays)))
    array = arrays[name]
    ways: list[Callable[[], Any]] = [
        lambda: array.reshape(-1)[:-1],
        lambda: np.stack([array, array]),
        lambda: np.zeros(0),
        lambda: np.float64(1),
        lambda: array.astype(complex),
        lambda: np.array(["text"]),
        lambda: np.zeros(array.shape, dtype="V8"),
        lambda: np.zeros(array.shape, dtype=[("a", "<f8"), ("b", "<i4")]),
    ]
    return with_arrays(mine, {**arrays, name: ways[int(rng.integers(len(ways)))]()})


class _Runs:
    """An object whose unpickling runs a command."""

    def __init__(self, canary: str) -> None:
        self.canary = canary

    def __reduce__(self) -> tuple[Any, ...]:
        return _PAYLOADS[len(self.canary) % len(_PAYLOADS)](self.canary)


def _by_system(canary: str) -> tuple[Any, ...]:
    import os

    return os.system, (f"touch {canary}",)


def _by_popen(canary: str) -> tuple[Any, ...]:
    return subprocess.Popen, (["touch", canary],)


def _by_partial(canary: str) -> tuple[Any, ...]:
    import functools

    return functools.partial, (open, canary, "w")


def _by_getter(canary: str) -> tuple[Any, ...]:
    import operator

    return operator.methodcaller, ("touch", canary)


def _by_eval(canary: str) -> tuple[Any, ...]:
    return eval, (f"open({canary!r}, 'w')",)


_PAYLOADS = (_by_system, _by_popen, _by_partial, _by_getter, _by_eval)


def code(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    """Objects that run something when unpickled, as an array, a member, the file, or by name."""
    runs = _Runs("/".join((".", *["x" * int(rng.integers(1, 9)), CANARY])))
    arrays = arrays_of(mine)
    way = int(rng.integers(5))
    if way == 0:
        name = str(rng.choice(list(arrays)))
        return with_arrays(mine, {**arrays, name: np.array([runs], dtype=object)})
    if way == 1:
        return packed(
            sealed({**mine, str(rng.choice([*TABLES, "arrays.npz"])): pickle.dumps(runs)})
        )
    if way == 2:
        return pickle.dumps(runs)
    if way == 3:  # as another library's file of models writes it
        node = {"__class__": "system", "__module__": "posix", "__loader__": "FunctionNode"}
        return packed(sealed({**mine, "schema.json": json.dumps(node).encode()}))
    structure = json.loads(mine["structure.json"])
    structure["blind"]["kinds"][0] = str(rng.choice(["os.system", "__import__", "Forest", "eval"]))
    return packed(sealed({**mine, "structure.json": json.dumps(structure).encode()}))


CANARY = "canary"


def bomb(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    """Small files that unpack to large ones, deep tables, arrays that say they are huge."""
    way = int(rng.integers(8))
    name = str(rng.choice(TABLES))
    if way == 0:
        return packed({**mine, name: b" " * 2**27})
    if way == 1:
        return packed(sealed({**mine, name: b"[" * 10**6}))
    if way == 2:
        return packed(sealed({**mine, name: b'{"a":' * 10**5 + b"1" + b"}" * 10**5}))
    if way == 3:
        return packed(sealed({**mine, name: b'{"a": ' + b"9" * 10**6 + b"}"}))
    if way == 4:
        return packed(sealed({**mine, name: json.dumps({"a": [[]] * 10**6}).encode()}))
    if way == 5:  # an array whose header promises far more than follows
        shape = str(rng.choice(["(1000000000000,)", "(-1,)", "(2**40,)", "(3, -5)", "(" * 90]))
        head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
        if rng.integers(2):
            head = b"-" * 60_000 + head
        data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + bytes(64)
        inner = packed({**unzipped(mine["arrays.npz"]), "blind.witness.weight.npy": data})
        return packed(sealed({**mine, "arrays.npz": inner}))
    if way == 6:  # a zip inside, of many times its size
        inner = packed({**unzipped(mine["arrays.npz"]), "more.npy": bytes(2**28)})
        return packed(sealed({**mine, "arrays.npz": inner}))
    inner = packed({**unzipped(mine["arrays.npz"]), **{f"{i}.npy": b"" for i in range(20_000)}})
    return packed(sealed({**mine, "arrays.npz": inner}))


def unzipped(data: bytes) -> Members:
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        return {name: file.read(name) for name in file.namelist()}


def names(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    """Members that want to be elsewhere, are there twice, or are missing."""
    way = int(rng.integers(5))
    if way == 0:
        path = str(rng.choice(["../canary", "/tmp/canary", "..\\canary", "a/../../canary", ""]))
        return packed(sealed({**mine, path or "x": b"x"}))
    if way == 1:
        return packed({name: data for name, data in mine.items() if name != rng.choice(list(mine))})
    if way == 2:
        import warnings

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a name that is there twice is the point
            return _twice(sealed(mine), str(rng.choice(list(mine))))
    if way == 3:
        method = int(rng.choice([zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]))
        return packed(mine, method)
    inner = packed({**unzipped(mine["arrays.npz"]), "../canary.npy": b"x"})
    return packed(sealed({**mine, "arrays.npz": inner}))


def _twice(members: Members, name: str) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as file:
        for each, content in [*members.items(), (name, b"{}")]:
            file.writestr(each, content)
    return data.getvalue()


def table(rng: np.random.Generator, mine: Members, _other: Members) -> bytes:
    """One value of a table replaced by something else."""
    name = str(rng.choice([*TABLES, "seal.json"]))
    value = json.loads(mine[name])
    places = list(_places(value))
    owner, key = places[int(rng.integers(len(places)))]
    others = [None, True, -1, 0, 1e308, "", "x" * 10**5, [], {}, [[]], 2**70, float("nan")]
    owner[key] = others[int(rng.integers(len(others)))]
    forged = {**mine, name: json.dumps(value).encode()}
    return packed(forged if name == "seal.json" else sealed(forged))


def _places(value: Any) -> Any:
    """Container and key of every value in a table, long lists by their first few."""
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))[:5]
    for key in keys:
        yield value, key
        if isinstance(value[key], dict | list):
            yield from _places(value[key])


FORGERY = (swapped, tree, tree, number, shape, code, bomb, names, table, table)


def forged(number_: int, seed: int, intact: tuple[Path, Path]) -> tuple[str, bytes]:
    """File of this number, with what was done to it."""
    rng = np.random.default_rng([seed, number_])
    ways = (*DAMAGE, *FORGERY)
    way = ways[number_ % len(ways)]
    if way in DAMAGE:
        return way.__name__, way(rng, *(path.read_bytes() for path in intact))  # type: ignore[arg-type]
    return way.__name__, way(rng, *(unpacked(path) for path in intact))  # type: ignore[arg-type]


# --- the child


def child(model: str) -> None:
    """Read the files named on stdin; answer with one line each."""
    from wearstate.diagnose.wear_model.file import load_model

    row = np.array(load_model(model).card.healthy_features.mean)
    wanted = answer(load_model(model), row)
    seen: list[str] = []
    sys.addaudithook(
        lambda event, _: (
            seen.append(event) if event in WATCHED or event.startswith("pickle") else None
        )
    )
    start = _memory()
    print("ready", flush=True)
    for line in sys.stdin:
        seen.clear()
        told = verdict(Path(line.strip()), row, wanted)
        if seen:
            told = f"RAN {', '.join(seen)}"
        if _memory() - start > MOST_MEMORY:
            told = f"GREW {(_memory() - start) >> 20} MiB"
        print(told, flush=True)


def verdict(path: Path, row: Any, wanted: str) -> str:
    from wearstate.diagnose.wear_model.bundle import ModelError
    from wearstate.diagnose.wear_model.file import load_model

    try:
        model = load_model(path)
    except ModelError as error:
        return "refused" if str(error) else "REFUSED WITHOUT A WORD"
    except Exception as error:  # whatever else comes out is a defect
        return f"RAISED {type(error).__name__}: {str(error)[:100]}"
    try:
        found = answer(model, row)
    except Exception as error:
        return f"USE RAISED {type(error).__name__}: {str(error)[:100]}"
    return "same" if found == wanted else "other"


def answer(model: Any, row: Any) -> str:
    """What a model says of a row of features; no number in it may be none."""
    features = row if model.mode == "referenced" else None
    return json.dumps(model.judge(row, features).as_dict(), allow_nan=False, default=str)


def _memory() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


class Reader:
    """A child process that is started anew when it dies or hangs."""

    def __init__(self, model: Path, folder: Path) -> None:
        self.model, self.folder = model, folder
        self.process: subprocess.Popen[str] | None = None

    def ask(self, path: Path) -> str:
        process = self.process or self._start()
        assert process.stdin is not None
        process.stdin.write(f"{path}\n")
        process.stdin.flush()
        return self._line(process)

    def _start(self) -> "subprocess.Popen[str]":
        command = [sys.executable, __file__, "--child", str(self.model)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, text=True, cwd=self.folder
        )
        told = self._line(self.process)
        if told != "ready":
            raise RuntimeError(f"the child did not start: {told}")
        return self.process

    def _line(self, process: "subprocess.Popen[str]") -> str:
        assert process.stdout is not None
        ready, _, _ = select.select([process.stdout], [], [], LONGEST)
        line = process.stdout.readline().strip() if ready else ""
        if not line:
            told = f"DIED {process.poll()}" if ready else f"HUNG {LONGEST:.0f} s"
            self.close()
            return told
        return line

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None


def run(
    intact: tuple[Path, Path], files: int, *, seed: int = 0, first: int = 0, progress: bool = False
) -> dict[str, Counter[str]]:
    """Answers to many files by what was done to them; those in capitals are failures."""
    found: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "a" / "b"
        folder.mkdir(parents=True)
        reader = Reader(intact[0].resolve(), folder)
        try:
            for number_ in range(first, first + files):
                way, data = forged(number_, seed, intact)
                path = folder / "forged.wsm"
                path.write_bytes(data)
                told = reader.ask(path)
                if any(Path(name).rglob(CANARY + "*")):
                    told = f"CANARY {told}"
                if told not in ("refused", "same", "other"):
                    print(f"file {number_} ({way}): {told}", file=sys.stderr)
                found.setdefault(way, Counter())[told.split(":")[0]] += 1
                if progress and (number_ + 1) % 100 == 0:
                    print(f"{number_ + 1} files", file=sys.stderr, flush=True)
        finally:
            reader.close()
    return found


def failures(found: dict[str, Counter[str]]) -> list[str]:
    """Answers that no file may get; damaged bytes must not give another model either."""
    damage = {way.__name__ for way in DAMAGE}
    return [
        f"{way}: {told}"
        for way, counts in found.items()
        for told in counts
        if told not in ("refused", "same") and not (told == "other" and way not in damage)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--files", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--child")
    given = parser.parse_args()
    if given.child:
        child(given.child)
        return
    found = run(tuple(given.models), given.files, seed=given.seed, first=given.first, progress=True)
    for way, counts in sorted(found.items()):
        print(f"{way:10}", ", ".join(f"{count} {told}" for told, count in counts.most_common()))
    sys.exit(1 if failures(found) else 0)


if __name__ == "__main__":
    main()
