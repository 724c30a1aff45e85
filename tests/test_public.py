"""The public names: typed, documented, cheap to import, and fitting together."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import wearstate

ROOT = Path(wearstate.__file__).parent
USES = Path(__file__).with_name("public_uses.py")


def told_to_checkers(path):
    """What the block for type checkers of an `__init__.py` imports: name -> module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    [block] = [
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    return {
        alias.asname: f"{'.' * node.level}{node.module or ''}"
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.level
        for alias in node.names
    }


@pytest.mark.parametrize("package", [wearstate, wearstate.features])
def test_type_checkers_and_python_find_the_same_names(package):
    modules = dict.fromkeys(getattr(package, "_MODULES", ()), ".")
    told = told_to_checkers(Path(package.__file__))
    assert told == package._HOMES | modules
    for name, home in package._HOMES.items():
        assert getattr(package, name).__module__ == f"{package.__name__}{home}", name
    assert all(getattr(wearstate, name).__name__ == f"wearstate.{name}" for name in modules)


def expected_errors(text):
    lines = enumerate(text.splitlines(), 1)
    return {(i, m[1]) for i, line in lines if (m := re.search(r"# error: ([\w-]+)$", line))}


@pytest.fixture(scope="module")
def mypy(tmp_path_factory):
    """Check a file against the package as it is installed, under a link of the right name."""
    folder = tmp_path_factory.mktemp("types")
    (folder / "wearstate").mkdir()
    for each in ROOT.iterdir():
        if each.suffix in {".py", ".typed"} or each.name in wearstate_floors():
            (folder / "wearstate" / each.name).symlink_to(each)
    (folder / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())

    def check(path):
        (folder / path.name).symlink_to(path)
        done = subprocess.run(
            [
                *(sys.executable, "-m", "mypy", "-p", "wearstate", "-m", path.stem),
                *("--cache-dir", ROOT / ".mypy_cache"),  # of tests/types.sh, which asks the same
            ],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=300,
        )
        return {
            (int(line), code)
            for line, code in re.findall(
                rf"{path.name}:(\d+): error: .*\[([\w-]+)\]$", done.stdout, re.M
            )
        }, done.stdout + done.stderr

    return check


def wearstate_floors():
    return {"sim", "features", "datasets", "diagnose"}


def test_mypy_tells_right_uses_from_wrong_ones(mypy):
    wanted = expected_errors(USES.read_text())
    assert len(wanted) >= 7
    found, text = mypy(USES)
    assert found == wanted, text


def test_natural_slips_of_arguments_are_named():
    pump = wearstate.load_scene("bilge-pump")
    recording = wearstate.Recording.from_array(np.zeros((1, 64)), 64.0)
    for call, message in (
        (lambda: wearstate.simulate(pump, seed=-1), "seed = -1 must be a whole number >= 0"),
        (lambda: wearstate.align.align("shaft-rig"), "'shaft-rig' must be a scene; .*load_scene"),
        (lambda: wearstate.shaft.shaft_state("shaft-rig"), "'shaft-rig' must be a shaft line"),
        (lambda: wearstate.shaft.shaft_state(pump), "'bilge-pump' must be a shaft line"),
        (lambda: wearstate.report("pump.wsm", recording), "recording comes first"),
    ):
        with pytest.raises((ValueError, TypeError), match=message):
            call()


@pytest.mark.parametrize("given", [[1, 2], np.zeros((3, 10))])
def test_training_on_recordings_in_memory_is_refused_by_name(given):
    for train in (wearstate.train, lambda data: wearstate.train_classes(data, "grade")):
        with pytest.raises(wearstate.DataError, match="must be the file of a labelled data set"):
            train(given)


def test_values_by_path_are_no_scene():
    with pytest.raises(
        wearstate.SceneError, match=r"drive.speed is a value of a scene.*load_scene"
    ):
        wearstate.simulate({"drive.speed": "250 rpm"})


@pytest.mark.parametrize("kind", ["spectrum", "envelope_spectrum", "order_spectrum", "orbit"])
def test_gaps_are_refused_with_channel_number_and_place(kind):
    signal = np.zeros((2, 1000))
    signal[1, [7, 9]] = np.nan, np.inf
    with pytest.raises(ValueError, match=r"channel ch_1 has 2 sample.*first at index 7; cut"):
        getattr(wearstate.features, kind)(signal, 1000.0)


@pytest.mark.parametrize("unit", ["m/s²", "m/s**2", "m / s2", "m/s^2"])
def test_an_array_takes_every_spelling_of_a_unit(unit):
    [channel] = wearstate.Recording.from_array(np.zeros(10), 10.0, unit=unit).channels
    assert (channel.unit, channel.quantity) == ("m/s^2", "acceleration")
