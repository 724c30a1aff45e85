"""The layers: arrows point down only, and importing the command line costs next to nothing."""

import ast
import importlib
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import wearstate
from wearstate.sim.jit import kernel_sources

ROOT = Path(wearstate.__file__).parent
PACKAGES = ("sim", "features", "datasets", "diagnose")

MAY_IMPORT = {
    "sim": set(),
    "features": set(),
    "datasets": {"sim", "features"},
    "diagnose": {"sim", "features", "datasets"},
}
"""Package -> packages below it. sim and features know nothing of each other."""

ROOMS = {
    "sim": [
        "atomic",
        "compiler",
        "jit",
        "brief",
        "output",
        "parts",
        "scene",
        "contact",
        "film",
        "bearing",
        "excitation",
        "beam",
        "alignment",
        "hydraulics",
        "piping",
        "mechanism",
        "casing",
        "pump_setup",
        "pump",
        "pump_lanes",
        "journal",
        "shaft_films",
        "shaft_response",
        "shaft",
        "wear",
        "machine",
        "fidelity",
        "deep_check",
    ],
    "features": [
        "signal",
        "response",
        "rotation",
        "catalogue",
    ],
    "datasets": [
        "file",
        "workers",
        "source",
        "readers",
        "draws",
        "recipe",
        "split",
        "measured",
        "generation",
        "audit",
        "convert",
    ],
    "diagnose": [
        "pages",
        "pictures",
        "machines",
        "learning",
        "feature_rows",
        "recording_faults",
        "healthy_reference",
        "familiarity",
        "wear_model",
        "film_clearance",
        "nameplate",
        "twin",
        "report",
        "class_model",
        "evaluation",
        "blindspots",
        "charts",
        "stability",
        "shaft_tests",
        "alignment",
        "literature",
        "sweep",
        "inspect",
        "workflow",
        "options",
        "command_line",
    ],
}
"""Floor -> its folders and the files in its root, from the ground up; imports point down."""

MOST_FILES = 14
"""In one folder: more is a hall."""

HEAVY = {
    "matplotlib": set(),  # inside functions only
    "click": {"diagnose.options", "diagnose.command_line"},
    "rich": set(),
    "sklearn": {"diagnose", "features.catalogue"},
    "joblib": {"diagnose", "datasets"},
    "pandas": {"features.catalogue", "datasets.file", "diagnose"},
    "h5py": {"datasets"},
    "pyarrow": set(),
    "bokeh": set(),
}
"""Library -> floors or rooms that may import it at module level."""


@pytest.fixture(scope="module")
def sources():
    """Every file of the library, read: 'floor.room.module' -> its syntax tree."""
    return {
        dotted(path): ast.parse(path.read_text(encoding="utf-8"))
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def dotted(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def targets(name, node):
    """Modules that an import statement names, ours from their floor on, others as they are."""
    if isinstance(node, ast.Import):
        return [alias.name.removeprefix("wearstate.") for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    if node.level == 0:
        return [(node.module or "").removeprefix("wearstate.")]
    here = ("wearstate." + name).split(".")[: -node.level]
    base = Path(*here[1:], *(node.module or "").split("."))
    # `from . import x` and `from ..scene import parts` name modules, not their contents
    modules = [base / alias.name for alias in node.names]
    found = {each if (ROOT / each).with_suffix(".py").is_file() else base for each in modules}
    return sorted(".".join(each.parts) for each in found)


def imports_of(name, tree):
    return [target for node in ast.walk(tree) for target in targets(name, node)]


def module_level(tree):
    """Nodes that run at import: all but function bodies and blocks for the type checker."""
    queue = list(tree.body)
    while queue:
        node = queue.pop()
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            queue.extend(node.orelse)
            continue
        yield node
        queue.extend(ast.iter_child_nodes(node))


def ours(target):
    return target.split(".")[0] in PACKAGES


def room(name):
    """`film` of `sim.film.solve`; a file in the root of a floor is a room of its own."""
    return name.split(".")[1]


def violations(name, tree):
    package = name.split(".")[0]
    found = []
    for target in filter(ours, imports_of(name, tree)):
        other = target.split(".")[0]
        if other != package and other not in MAY_IMPORT[package]:
            found.append(f"{name} -> {target}")
        if other == package and floor(target) > floor(name):
            found.append(f"{name} -> {target} (upwards inside {package})")
    return found


def floor(name):
    rooms = ROOMS[name.split(".")[0]]
    return len(rooms) if room(name) == "__init__" else rooms.index(room(name))


def test_the_reader_sees_a_forbidden_import():
    upward = ast.parse(
        "from ...diagnose.command_line.cli import main\nimport wearstate.features.signal.fft"
    )
    assert violations("sim.scene.load", upward) == [
        "sim.scene.load -> diagnose.command_line.cli",
        "sim.scene.load -> features.signal.fft",
    ]
    assert violations("features.signal.fft", ast.parse("from ...sim.scene import load")) == [
        "features.signal.fft -> sim.scene.load"
    ]
    for inside in (
        "def f():\n    from ..machine.simulate import a",
        "from ..machine import simulate",
    ):
        assert violations("sim.film.solve", ast.parse(inside)) == [
            "sim.film.solve -> sim.machine.simulate (upwards inside sim)"
        ]
    allowed = ast.parse("from ...sim.scene.load import load_scene\nfrom ..recipe import draws")
    assert violations("datasets.generation.generate", allowed) == []


def twice(sources):
    """Public classes that stand in two files; what a reader looks for has one place."""
    found = {}
    for name, tree in sources.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(name)
    return {name: places for name, places in found.items() if len(places) > 1}


def test_a_public_class_has_its_name_for_itself(sources):
    assert twice(sources) == {}
    both = {"sim.a": ast.parse("class Film: ..."), "sim.b": ast.parse("class Film: ...")}
    assert twice(both) == {"Film": ["sim.a", "sim.b"]}


def test_arrows_point_down(sources):
    assert {name.split(".")[0] for name in sources} == set(PACKAGES)
    assert [each for name, tree in sources.items() for each in violations(name, tree)] == []


def test_every_file_is_in_a_room_that_is_no_hall(sources):
    here = {(*name.split(".")[:2],) for name in sources} - {(each, "__init__") for each in PACKAGES}
    assert here == {(package, each) for package in PACKAGES for each in ROOMS[package]}
    folders = Counter(name.rpartition(".")[0] for name in sources)
    assert {name: count for name, count in folders.items() if count > MOST_FILES} == {}
    assert {name for name in folders if name.count(".") > 1} == set()


def test_a_room_imports_what_its_first_words_allow(sources):
    """``It may import`` of every `__init__.py`, held against the imports of its files."""
    wrong = {}
    for package in PACKAGES:
        for each in ROOMS[package]:
            if f"{package}.{each}.__init__" in sources:
                said = ast.get_docstring(sources[f"{package}.{each}.__init__"])
                _, _, allowed = said.partition("It may import ")
                inside = {n: t for n, t in sources.items() if n.startswith(f"{package}.{each}.")}
                used = {
                    ".".join(target.split(".")[:2])
                    for name, tree in inside.items()
                    for target in filter(ours, imports_of(name, tree))
                } - {f"{package}.{each}"}
                extra = used - set(re.findall(r"``([\w.]+)``", allowed))
                if extra:
                    wrong[f"{package}.{each}"] = sorted(extra)
    assert wrong == {}


def test_the_kernel_cache_is_keyed_by_all_that_a_kernel_can_see(sources):
    sim = {name: tree for name, tree in sources.items() if name.startswith("sim.")}
    graph = {name: set(filter(ours, imports_of(name, tree))) for name, tree in sim.items()}
    seen, queue = set(), [name for name, targets in graph.items() if "sim.jit" in targets]
    while queue:
        name = queue.pop()
        if name not in seen:
            seen.add(name)
            queue.extend(graph[name])
    found = {dotted(path) for path in kernel_sources(ROOT / "sim")}
    assert "sim.film.short" in found
    assert found ^ seen == set()


def reaches_itself(name, graph):
    seen, queue = set(), list(graph[name])
    while queue:
        other = queue.pop()
        if other == name:
            return True
        if other in graph and other not in seen:
            seen.add(other)
            queue.extend(graph[other])
    return False


def test_no_import_circles(sources):
    assert reaches_itself("a", {"a": {"b"}, "b": {"c"}, "c": {"a"}})
    graph = {name: set(filter(ours, imports_of(name, tree))) for name, tree in sources.items()}
    del graph["features.__init__"]  # its block for type checkers names the files below it
    assert [name for name in graph if reaches_itself(name, graph)] == []


def absolute_imports(name, tree):
    return [
        f"{name}: {ast.unparse(node)}"
        for node in ast.walk(tree)
        if (isinstance(node, ast.ImportFrom) and (node.module or "").startswith("wearstate"))
        or (isinstance(node, ast.Import) and any("wearstate" in a.name for a in node.names))
    ]


def test_imports_inside_the_library_are_relative(sources):
    absolute = ast.parse("def f():\n    import wearstate.sim\nfrom .jit import kernel")
    assert absolute_imports("sim.film.x", absolute) == ["sim.film.x: import wearstate.sim"]
    assert [each for name, tree in sources.items() for each in absolute_imports(name, tree)] == []


def heavy_imports(name, tree):
    found = []
    for node in module_level(tree):
        for target in targets(name, node):
            library = target.split(".")[0]
            allowed = HEAVY.get(library)
            places = {name.split(".")[0], ".".join(name.split(".")[:2])}
            if allowed is not None and not places & allowed:
                found.append(f"{name} -> {target}")
    return found


def test_the_reader_sees_a_heavy_import():
    assert heavy_imports("sim.scene", ast.parse("import pandas as pd")) == ["sim.scene -> pandas"]
    guarded = ast.parse("try:\n    import h5py\nfinally:\n    1")
    assert heavy_imports("sim.scene", guarded) == ["sim.scene -> h5py"]
    assert heavy_imports("sim.scene", ast.parse("def f():\n    import pandas")) == []


def test_heavy_libraries_stay_where_they_belong(sources):
    assert [each for name, tree in sources.items() for each in heavy_imports(name, tree)] == []


PUBLIC_MODULES = ("align", "contact", "crank", "film", "shaft")
"""Files in the root: what users import, told by the language of the field."""


@pytest.mark.parametrize("name", PUBLIC_MODULES)
def test_a_public_module_only_gives_names(name):
    docstring, *imports, names = ast.parse((ROOT / f"{name}.py").read_text()).body
    assert isinstance(docstring, ast.Expr)
    assert all(isinstance(each, ast.ImportFrom) and each.level for each in imports)
    given = {alias.asname or alias.name for each in imports for alias in each.names}
    assert given == set(ast.literal_eval(names.value))


def test_the_root_holds_the_public_modules():
    found = {path.stem for path in ROOT.glob("*.py")} - {"__init__", "__main__", "setup"}
    assert found == set(PUBLIC_MODULES) == set(wearstate._MODULES) - {"features"}


def test_packages_hold_no_code(sources):
    packages = {name: tree for name, tree in sources.items() if name.endswith(".__init__")}
    del packages["features.__init__"]  # public names, as in the root: tests/test_public.py
    full = [name for name, tree in packages.items() if len(tree.body) != 1]
    assert full == []
    assert all(ast.get_docstring(tree) for tree in packages.values())


def imported_by(statement):
    """Top-level names in sys.modules of a fresh interpreter after a statement."""
    code = f"{statement}\nimport sys\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    return set(done.stdout.split())


SLOW_TO_IMPORT = {"numba", "scipy", "sklearn", "matplotlib", "pandas", "h5py", "pyfftw"}


def test_the_probe_sees_an_import():
    assert "scipy" in imported_by("import scipy.signal")


@pytest.mark.parametrize("module", ["wearstate", "wearstate.diagnose.command_line.cli"])
def test_the_command_line_imports_nothing_slow(module):
    assert imported_by(f"import {module}") & SLOW_TO_IMPORT == set()


def test_nothing_that_simulates_imports_what_is_slow_and_seldom_needed(sources):
    """They take three quarters of a second together, at the start of every process."""
    seldom, found = {"scipy.signal", "scipy.stats", "pandas"}, []
    for name, tree in sources.items():
        for node in tree.body:
            given = {alias.name for alias in getattr(node, "names", ())}
            if isinstance(node, ast.ImportFrom):
                given = {node.module, *(f"{node.module}.{each}" for each in given)}
            if isinstance(node, ast.Import | ast.ImportFrom) and given & seldom:
                found.append(name.partition(".")[0])
    assert {*found} == {"features", "diagnose"}


def test_scenes_are_validated_without_the_kernels():
    assert imported_by("import wearstate.sim.scene.load") & SLOW_TO_IMPORT == set()


IN_THE_WHEEL = """
import setuptools
from distutils.core import run_setup
build = run_setup("setup.py").get_command_obj("build_py")
build.ensure_finalized()
print(*build.get_source_files(), sep="\\n")
for _, folder, _, names in build.data_files:
    print(*(f"{folder}/{name}" for name in names), sep="\\n")
"""


def test_the_wheel_ships_every_file():
    done = subprocess.run(
        [sys.executable, "-c", IN_THE_WHEEL], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    shipped = {ROOT / line for line in done.stdout.splitlines() if line}
    here = {
        path
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.suffix in {".py", ".toml", ".csv", ".j2"}
    }
    modules = [f"{name}.py" for name in PUBLIC_MODULES]
    root = {ROOT / name for name in ("__init__.py", "__main__.py", "py.typed", *modules)}
    assert (shipped - here - root, (here | root) - shipped) == (set(), set()), done.stderr


def test_public_names_resolve():
    assert [name for name in wearstate.__all__ if getattr(wearstate, name) is None] == []
    assert set(wearstate.__all__) <= set(dir(wearstate))


def test_unknown_public_name():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        importlib.import_module("wearstate").simulat  # noqa: B018 - the access is the test


# --- reached

ROOTS = ("__init__", "__main__")
"""What a user calls: the package's public names and its command."""

_DOTTED = re.compile(rf"(?:wearstate\.)?((?:{'|'.join(PACKAGES)})(?:\.\w+)+)")


def mentioned(name, tree):
    """Modules that a file imports, or names in a string that it imports later by name."""
    prose = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    folder = name.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            above = folder[: len(folder) - node.level + 1] if node.level else []
            base = [*above, *(node.module or "").removeprefix("wearstate.").split(".")]
            base = [part for part in base if part]
            yield ".".join(base)
            yield from (".".join([*base, alias.name]) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name.removeprefix("wearstate.") for alias in node.names)
        elif isinstance(node, ast.Constant) and id(node) not in prose:
            yield from _DOTTED.findall(str(node.value))
            yield ".".join([*folder, str(node.value).strip(".")])


def reached(files):
    """Modules that the roots lead to; a package stands for its ``__init__``."""
    found, todo = set(), [*ROOTS, *(name for name in files if "." not in name)]
    while todo:
        name = todo.pop()
        name = name if name in files else f"{name}.__init__"
        if name in files and name not in found:
            found.add(name)
            todo += mentioned(name, ast.parse(files[name]))
    return found


def test_every_module_is_reached_by_a_command_or_a_public_name():
    paths = [*ROOT.glob("*.py"), *(p for each in PACKAGES for p in (ROOT / each).rglob("*.py"))]
    files = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8")
        for path in paths
        if path != ROOT / "setup.py"
    }
    lost = set(files) - reached(files)
    assert {name for name in lost if not name.endswith("__init__")} == set()
    alone = {"__init__": "from .sim import a", "sim.a": "", "sim.b": "", "sim.__init__": ""}
    assert reached(alone) == {"__init__", "sim.a", "sim.__init__"}
