"""A damaged kernel cache mends itself, with one warning; code that is not whole is never run."""

import hashlib
import multiprocessing
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from wearstate.sim import compiler, jit
from wearstate.sim.atomic import unsealed

CODE = "from wearstate.sim.jit import near_sine_cosine\nprint(near_sine_cosine(0.5)[0])"
"""Of a kernel that calls no other."""
SINE = "0.479425538604203"


# numba is imported once: every process but those of `fresh` is a fork of this server
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["numba"])

FORKED = """
import os
os.environ["WEARSTATE_CACHE"] = {cache!r}
for stream, path in ((1, {out!r}), (2, {err!r})):
    os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), stream)
exec({code!r}, {{"__name__": "__main__"}})
"""


class Forked:
    """A process that begins without a kernel."""

    def __init__(self, cache, code=CODE):
        self.said = tempfile.TemporaryDirectory()
        out, err = self.files = [Path(self.said.name, stream) for stream in ("out", "err")]
        forked = FORKED.format(cache=str(cache), out=str(out), err=str(err), code=code)
        self.process = FORKS.Process(target=exec, args=(forked, {}))
        self.process.start()

    def communicate(self, timeout):
        """What it said, once it has ended."""
        self.process.join(timeout)
        with self.said:
            return tuple(path.read_text() for path in self.files)

    @property
    def returncode(self):
        return self.process.exitcode


def fresh(cache, code=CODE):
    """A process of its own from the beginning, its hashes too."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", code],
        env=os.environ | {"WEARSTATE_CACHE": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(cache, code=CODE, begun=Forked):
    """Warnings of one process that needs a kernel."""
    process = begun(cache, code)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert out.strip().startswith(SINE)
    return err.splitlines()


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cache")
    assert run(folder, begun=fresh) == []
    return folder


def files(folder, ending):
    return sorted(folder.glob(f"kernels-*/*/*{ending}"))


def test_the_cache_is_used(filled):
    before = {path: path.stat().st_mtime_ns for path in filled.rglob("*.nb*")}
    assert len(before) == 2  # one index, one file of code
    assert run(filled, begun=fresh) == []
    assert {path: path.stat().st_mtime_ns for path in filled.rglob("*.nb*")} == before


def emptied(content):
    return b""


def cut(content):
    return content[: len(content) // 2]


def flipped(content):
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.parametrize("damage", [emptied, cut, flipped])
@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
def test_damage_is_mended_with_one_warning(filled, ending, damage):
    [path] = files(filled, ending)
    damaged = damage(path.read_bytes())
    path.write_bytes(damaged)
    [warning] = run(filled)
    assert "is damaged: kernels are compiled again and replaced" in warning
    assert not path.exists() or path.read_bytes() != damaged
    [index] = files(filled, ".nbi")
    _, names = pickle.loads(unsealed(index.read_bytes()))
    [code] = [index.parent / name for name in names.values()]
    assert hashlib.sha256(code.read_bytes()).hexdigest()[:32] in code.name
    for other in set(files(filled, ".nbc")) - {code}:
        other.unlink()  # of a compiler that does not repeat itself to the byte


def test_what_was_mended_is_used(filled):
    test_the_cache_is_used(filled)


def test_processes_at_once_on_a_damaged_cache(filled):
    for path in (*files(filled, ".nbi"), *files(filled, ".nbc")):
        path.write_bytes(b"")
    processes = [Forked(filled) for _ in range(3)]
    for process in processes:
        out, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
        assert out.strip().startswith(SINE)
    assert run(filled) == []


def test_a_full_disk_costs_one_warning(tmp_path):
    code = (
        "import os\nfrom wearstate.sim import jit\n"
        "def full(*_, **__):\n    raise OSError(28, 'No space left on device')\n"
        "jit.write_whole = full\n" + CODE
    )
    [warning] = run(tmp_path, code)
    assert "cannot be kept (No space left on device)" in warning


def test_a_place_that_cannot_be_a_folder_costs_one_warning(tmp_path):
    (tmp_path / "file").touch()
    [warning] = run(tmp_path / "file")
    assert "compiled kernels cannot be kept" in warning
    assert "WEARSTATE_CACHE" in warning


def test_installations_of_the_same_sources_share_kernels(filled, tmp_path):
    """Another folder and another time of the files: nothing is compiled or written again."""
    package = Path(jit.__file__).parents[1]
    (tmp_path / "wearstate").mkdir()
    for source in (*package.glob("*.py"), *package.glob("sim/**/*.py")):
        copy = tmp_path / "wearstate" / source.relative_to(package)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    before = {path: path.stat().st_mtime_ns for path in filled.rglob("*.nb*")}
    told = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n{CODE}"
    assert (
        run(
            filled,
            f"{told}\nimport wearstate\nassert wearstate.__path__ == [sys.path[0] + '/wearstate']",
        )
        == []
    )
    assert {path: path.stat().st_mtime_ns for path in filled.rglob("*.nb*")} == before


NESTED = {
    "jit.py": "",
    "constants.py": "LIMIT = 1.0",
    "units.py": "SCALE = 1.0",
    "unseen.py": "from .film.direct import pressure",
    "film/__init__.py": "",
    "film/direct.py": "from ..jit import kernel\nfrom . import (\n    mesh,\n)",
    "film/mesh.py": "from ..constants import LIMIT",
    "film/closed/__init__.py": "",
    "film/closed/short.py": "def late():\n    from ... import jit\n    from ..mesh import x, y",
    "contact.py": "from .jit import kernel\nfrom .units import (\n    SCALE as S,\n)",
}


def test_kernels_of_subfolders_are_seen(tmp_path):
    for name, text in NESTED.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    found = [path.relative_to(tmp_path).as_posix() for path in jit.kernel_sources(tmp_path)]
    assert found == [
        "constants.py",
        "contact.py",
        "film/closed/short.py",
        "film/direct.py",
        "film/mesh.py",
        "jit.py",
        "units.py",
    ]


def test_kernels_of_one_name_in_two_folders_are_kept_apart(tmp_path):
    """The same function in the same line of two files `law.py` of different folders."""
    package = Path(jit.__file__).parents[1]
    copy = tmp_path / "wearstate"
    shutil.copytree(package / "sim", copy / "sim", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copyfile(package / "__init__.py", copy / "__init__.py")
    for room, factor in (("one", 2.0), ("two", 3.0)):
        (copy / "sim" / room).mkdir()
        (copy / "sim" / room / "__init__.py").touch()
        (copy / "sim" / room / "law.py").write_text(
            f"from ..jit import kernel\n\n@kernel\ndef law(x):\n    return {factor} * x\n"
        )
    told = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n{CODE}\n"
    asked = "from wearstate.sim.one import law as a\nfrom wearstate.sim.two import law as b\n"
    for _ in range(2):  # compiled, then read back
        process = Forked(tmp_path / "cache", f"{told}{asked}print(a.law(1.0), b.law(1.0))")
        out, err = process.communicate(timeout=300)
        assert (out.split()[1:], err) == (["2.0", "3.0"], "")
    assert len(list((tmp_path / "cache").glob("kernels-*/sim/*/law.law*.nbi"))) == 2


LAWS = """
from ..jit import kernel, subroutine

@kernel
def _square(x):
    return x * x

@subroutine
def _fourth(x):
    return _square(_square(x))

@kernel
def eighth(x):
    return _square(_fourth(x))

@kernel
def sixteenth(x):
    return _fourth(_fourth(x))
"""


@pytest.fixture(scope="module")
def laws(tmp_path_factory):
    """A package of kernels that call kernels; runs an expression of them and gives its words."""
    package, folder = Path(jit.__file__).parents[1], tmp_path_factory.mktemp("laws")
    copy = folder / "wearstate"
    shutil.copytree(package / "sim", copy / "sim", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copyfile(package / "__init__.py", copy / "__init__.py")
    (copy / "sim" / "laws").mkdir()
    (copy / "sim" / "laws" / "__init__.py").touch()
    (copy / "sim" / "laws" / "law.py").write_text(LAWS)
    told = f"import sys\nsys.path.insert(0, {str(folder)!r})\n{CODE}\n"
    asked = "from wearstate.sim.laws import law\nprint("

    def ask(cache, expression, begun=Forked):
        out, err = begun(cache, f"{told}{asked}{expression})").communicate(timeout=300)
        return out.split()[1:], err.splitlines()

    return ask


def kept(cache, ending):
    """Functions with files of this ending."""
    paths = cache.glob(f"kernels-*/sim/laws/*{ending}")
    return {path.name.split(".")[1].split("-")[0] for path in paths}


def test_a_callee_is_kept_as_a_part_for_all_that_call_it(laws, tmp_path):
    assert laws(tmp_path, "law.eighth(2.0)", fresh) == (["256.0"], [])
    assert kept(tmp_path, ".nbi") == {"eighth"}  # no machine code that nobody calls
    assert kept(tmp_path, ".part") == {"_square", "_fourth"}
    parts = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.part")}
    misses = "sum(law._fourth.part._cache_misses.values())"
    assert laws(tmp_path, f"law.sixteenth(2.0), {misses}", fresh) == (["65536.0", "0"], [])
    assert laws(tmp_path, "law._fourth(2.0), law._fourth(3)") == (["16.0", "81"], [])
    assert kept(tmp_path, ".nbi") == {"eighth", "sixteenth", "_fourth"}
    assert {path: path.stat().st_mtime_ns for path in parts} == parts


def test_damaged_parts_are_mended_with_one_warning(laws, tmp_path):
    assert laws(tmp_path, "law.eighth(2.0)") == (["256.0"], [])
    parts = sorted(tmp_path.rglob("*.part"))
    for path, damage in zip(parts, (flipped, cut), strict=True):
        path.write_bytes(damage(path.read_bytes()))
    values, [warning] = laws(tmp_path, "law.sixteenth(2.0)")
    assert values == ["65536.0"]
    assert "is damaged: kernels are compiled again and replaced" in warning
    assert all(unsealed(path.read_bytes()) is not None for path in parts)
    assert laws(tmp_path, "law._square(3.0), law._fourth(3.0)") == (["9.0", "81.0"], [])


def test_a_part_that_is_lost_is_made_again(laws, tmp_path):
    """A part that is kept knows what it calls by name only."""
    assert laws(tmp_path, "law.eighth(2.0)") == (["256.0"], [])
    [square] = tmp_path.rglob("law._square-*.part")
    square.unlink()
    assert laws(tmp_path, "law.sixteenth(2.0)") == (["65536.0"], [])
    assert square.exists()


def test_local_kernels_are_parts_too_and_what_is_not_linked_is_named(monkeypatch):
    """Of functions that no later process finds by name, nor by chance another one of their name."""

    def chain(factor):
        @jit.kernel
        def inner(x):
            return factor * x

        @jit.kernel
        def middle(x):
            return inner(x)

        @jit.kernel
        def outer(x):
            return middle(x)

        return outer

    assert (chain(2.0)(1.5), chain(3.0)(1.5)) == (3.0, 4.5)
    monkeypatch.setattr(compiler._PartLibrary, "calls", lambda self: [])
    with pytest.raises(AssertionError, match=r"parts of .*outer are not linked: .*inner"):
        chain(2.0)(1.5)


def test_a_copy_that_is_imported_by_another_name_does_not_spoil_the_cache(tmp_path):
    """Kept code names its modules, which the installation `wearstate` does not have."""
    package = Path(jit.__file__).parents[1]
    copy = tmp_path / "renamed"
    shutil.copytree(package / "sim", copy / "sim", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copyfile(package / "__init__.py", copy / "__init__.py")
    renamed = CODE.replace("wearstate.", "renamed.")
    told = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n{renamed}\n"
    assert run(tmp_path / "cache", told) == []
    assert run(tmp_path / "cache") == []
    assert len(files(tmp_path / "cache", ".nbi")) == 2


PAIRS = """
from typing import NamedTuple

from ..jit import kernel, subroutine

class Pair(NamedTuple):
    x: float
    y: float

@subroutine
def _product(pairs):
    return pairs[0].x * pairs[0].y

@kernel
def area(pair):
    return _product((pair,))
"""


def test_what_two_copies_compile_together_is_not_kept(tmp_path):
    """Types of a class of the other copy look like those of one's own, and are none."""
    package = Path(jit.__file__).parents[1]
    for copy in (tmp_path / "wearstate", tmp_path / "renamed"):
        shutil.copytree(package / "sim", copy / "sim", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copyfile(package / "__init__.py", copy / "__init__.py")
        (copy / "sim" / "laws").mkdir()
        (copy / "sim" / "laws" / "__init__.py").touch()
        (copy / "sim" / "laws" / "law.py").write_text(PAIRS)
    told = f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n{CODE}\n"
    asked = "from wearstate.sim.laws import law\nfrom renamed.sim.laws import law as other\n"

    def area(pair):
        process = Forked(tmp_path / "cache", f"{told}{asked}print(law.area({pair}(2.0, 3.0)))")
        out, err = process.communicate(timeout=300)
        return out.split()[1:], err

    assert area("other.Pair") == (["6.0"], "")
    assert area("law.Pair") == (["6.0"], "")  # with parts of its own types
    shutil.rmtree(tmp_path / "renamed")
    asked = "from wearstate.sim.laws import law\n"
    assert area("law.Pair") == (["6.0"], "")  # without the other's module
    assert kept(tmp_path / "cache", ".nbi") == {"area"}
    assert kept(tmp_path / "cache", ".part") == {"_product"}
