"""The layers: arrows point down only, and importing the command line costs next to nothing."""

import ast
import importlib
import subprocess
import sys
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

SIM_FLOORS = [
    {"study"},
    {"fidelity"},
    {"pilot", "deep_check"},
    {"deep_pump", "deep_journal", "deep_shaft"},
    {"deep_rows"},
    {"assemble"},
    {"wear_rate", "transfer"},
    {"shaft_change"},
    {"pump", "journal", "shaft_line"},
    {"ladder", "plausibility"},
    {"tearing", "pump_push", "pump_pressure"},
    {"crank_setup", "shaft_push"},
    {"slider_crank", "orbit", "casing", "shaft_film", "shaft_response"},
    {"rest_curve"},
    {"impedance", "bearing", "film_mass", "contact", "hydraulics", "frf_table"},
    {"calibration", "jacking", "jacking_curve"},
    {"rotor", "alignment"},
    {"film", "film_slopes", "beam"},
    {"film_relax"},
    {"film_direct"},
    {"film_line", "film_short"},
    {"integrate", "analytic", "scene", "steppers", "exciters"},
    {"pump_parts", "journal_parts", "shaft_parts"},
    {"hydraulic_parts", "exciter_parts"},
    {"parts"},
    {"wear_life"},
    {"sensor", "jit", "wear", "viscosity", "atomic"},
]
"""Inside sim, from the roof to the ground; a file imports from lower floors or its own."""

HEAVY = {
    "matplotlib": set(),  # inside functions only
    "click": {
        "diagnose.cli",
        "diagnose.chart_commands",
        "diagnose.command_options",
        "diagnose.command_sweep",
        "diagnose.commands_machine",
        "diagnose.commands_data",
        "diagnose.commands_wear",
    },
    "rich": set(),
    "sklearn": {"diagnose"},
    "joblib": {"diagnose", "datasets"},
    "pandas": {"features.table", "datasets.record", "diagnose"},
    "h5py": {"datasets"},
    "pyarrow": set(),
}
"""Library -> modules or packages that may import it at module level."""


@pytest.fixture(scope="module")
def sources():
    """Every file of the library, read: 'package.module' -> its syntax tree."""
    return {
        f"{package}.{path.stem}": ast.parse(path.read_text(encoding="utf-8"))
        for package in PACKAGES
        for path in sorted((ROOT / package).glob("*.py"))
    }


def targets(name, node):
    """Modules that an import statement names, ours as 'package.module', others as they are."""
    if isinstance(node, ast.Import):
        return [alias.name.removeprefix("wearstate.") for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    if node.level == 0:
        return [(node.module or "").removeprefix("wearstate.")]
    here = ("wearstate." + name).split(".")[: -node.level]
    base = ".".join([*here, *([node.module] if node.module else [])])
    found = base.removeprefix("wearstate").removeprefix(".")
    # `from . import x` and `from ..sim import scene` name modules, not their contents
    if found.count(".") == 0:
        return [f"{found}.{alias.name}".removeprefix(".") for alias in node.names]
    return [found]


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


def violations(name, tree):
    package = name.split(".")[0]
    found = []
    for target in filter(ours, imports_of(name, tree)):
        other = target.split(".")[0]
        if other != package and other not in MAY_IMPORT[package]:
            found.append(f"{name} -> {target}")
        if package == other == "sim" and floor(target) < floor(name):
            found.append(f"{name} -> {target} (upwards inside sim)")
    return found


def floor(name):
    stem = name.split(".")[1]
    return next(i for i, names in enumerate(SIM_FLOORS) if stem in names)


def test_the_reader_sees_a_forbidden_import():
    upward = ast.parse("from ..diagnose.cli import main\nimport wearstate.features.fft\n")
    assert violations("sim.scene", upward) == [
        "sim.scene -> diagnose.cli",
        "sim.scene -> features.fft",
    ]
    assert violations("features.fft", ast.parse("from ..sim import scene")) == [
        "features.fft -> sim.scene"
    ]
    inside = ast.parse("def f():\n    from .assemble import simulate\n")
    assert violations("sim.ladder", inside) == ["sim.ladder -> sim.assemble (upwards inside sim)"]
    assert violations("sim.ladder", ast.parse("from . import assemble")) != []
    assert violations("datasets.generate", ast.parse("from ..sim.scene import load_scene")) == []


def test_arrows_point_down(sources):
    assert {name.split(".")[0] for name in sources} == set(PACKAGES)
    assert [each for name, tree in sources.items() for each in violations(name, tree)] == []


def test_every_file_of_sim_has_a_floor(sources):
    stems = {name.split(".")[1] for name in sources if name.startswith("sim.")} - {"__init__"}
    assert stems <= set().union(*SIM_FLOORS)


def test_the_kernel_cache_is_keyed_by_all_that_a_kernel_can_see(sources):
    sim = {name: tree for name, tree in sources.items() if name.startswith("sim.")}
    graph = {name: set(filter(ours, imports_of(name, tree))) for name, tree in sim.items()}
    seen, queue = set(), [name for name, targets in graph.items() if "sim.jit" in targets]
    while queue:
        name = queue.pop()
        if name not in seen:
            seen.add(name)
            queue.extend(graph[name])
    found = {f"sim.{path.stem}" for path in kernel_sources(ROOT / "sim")}
    assert "sim.film_short" in found
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
    assert absolute_imports("sim.scene", absolute) == ["sim.scene: import wearstate.sim"]
    assert [each for name, tree in sources.items() for each in absolute_imports(name, tree)] == []


def heavy_imports(name, tree):
    found = []
    for node in module_level(tree):
        for target in targets(name, node):
            library = target.split(".")[0]
            allowed = HEAVY.get(library)
            if allowed is not None and not {name, name.split(".")[0]} & allowed:
                found.append(f"{name} -> {target}")
    return found


def test_the_reader_sees_a_heavy_import():
    assert heavy_imports("sim.scene", ast.parse("import pandas as pd")) == ["sim.scene -> pandas"]
    guarded = ast.parse("try:\n    import h5py\nfinally:\n    1")
    assert heavy_imports("sim.scene", guarded) == ["sim.scene -> h5py"]
    assert heavy_imports("sim.scene", ast.parse("def f():\n    import pandas")) == []


def test_heavy_libraries_stay_where_they_belong(sources):
    assert [each for name, tree in sources.items() for each in heavy_imports(name, tree)] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_hold_no_code(package, sources):
    [docstring] = sources[f"{package}.__init__"].body
    assert isinstance(docstring, ast.Expr)
    assert isinstance(docstring.value, ast.Constant)


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


@pytest.mark.parametrize("module", ["wearstate", "wearstate.diagnose.cli"])
def test_the_command_line_imports_nothing_slow(module):
    assert imported_by(f"import {module}") & SLOW_TO_IMPORT == set()


def test_scenes_are_validated_without_the_kernels():
    assert imported_by("import wearstate.sim.scene") & SLOW_TO_IMPORT == set()


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
    root = {ROOT / name for name in ("__init__.py", "__main__.py", "py.typed")}
    assert (shipped - here - root, (here | root) - shipped) == (set(), set()), done.stderr


@pytest.mark.parametrize("name", wearstate.__all__)
def test_public_names_resolve(name):
    assert getattr(wearstate, name) is not None
    assert name in dir(wearstate)


def test_unknown_public_name():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        importlib.import_module("wearstate").simulat  # noqa: B018 - the access is the test
