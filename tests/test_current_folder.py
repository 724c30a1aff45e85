"""Files of the current folder that are named like modules are never run."""

import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

TRAPPED = ("json", "signal", "random", "numpy", "h5py", "typing", "click", "socket", "shutil")
SCRIPT = [shutil.which("wearstate", path=Path(sys.executable).parent)]
MODULE = [sys.executable, "-m", "wearstate"]


def set_traps(folder, *, package):
    """Files that say that they were run; a package `wearstate` only where Python can pass it by."""
    trap = "open({place!r}, 'a').write(__name__ + chr(10))\n"
    code = trap.format(place=str(folder / "sprung"))
    for name in TRAPPED:
        (folder / f"{name}.py").write_text(code, encoding="utf-8")
    if package:
        (folder / "wearstate").mkdir()
        (folder / "wearstate" / "__init__.py").write_text(code, encoding="utf-8")


def run(folder, *command):
    done = subprocess.run(
        [str(part) for part in command], cwd=folder, capture_output=True, text=True, timeout=600
    )
    sprung = folder / "sprung"
    assert not sprung.exists(), f"run: {sorted(set(sprung.read_text().split()))}"
    assert done.returncode == 0, done.stderr


def test_a_trap_is_sprung_where_the_folder_is_on_the_path(tmp_path):
    set_traps(tmp_path, package=True)
    with pytest.raises(AssertionError, match=r"run: \['json', 'wearstate'\]"):
        run(tmp_path, sys.executable, "-c", "import json, wearstate")


def test_workers_and_what_is_started_beside_them(tmp_path):
    """Where the folder is not on the path of the parent, as with the script and ``-m``."""
    set_traps(tmp_path, package=True)
    code = "from wearstate.datasets.workers.local import in_order\n"
    code += "assert list(in_order(abs, [-1, 2, -3], jobs=2)) == [1, 2, 3]"
    run(tmp_path, sys.executable, "-c", f"import sys; sys.path.remove(''); exec({code!r})")


def test_a_module_run_looks_nowhere_in_the_folder(tmp_path):
    set_traps(tmp_path, package=False)
    run(tmp_path, *MODULE, "scene", "list")


def test_the_script_with_workers(tmp_path):
    set_traps(tmp_path, package=True)
    run(tmp_path, *SCRIPT, "generate", "bilge-pump-small", "-n", 3, "-o", "data.h5", "-j", 2)
    assert (tmp_path / "data.h5").is_file()


@pytest.mark.parametrize("program", [SCRIPT, MODULE], ids=["script", "module"])
def test_texts_of_hdf5_files_are_read_apart(tmp_path, program):
    set_traps(tmp_path, package=program is SCRIPT)
    with h5py.File(tmp_path / "rig.hdf5", "w") as file:
        file["acc"] = np.random.default_rng(0).standard_normal(2000)
        file["acc"].attrs["unit"] = "m/s^2"  # of variable length: read by another process
    run(tmp_path, *program, "import", "rig.hdf5", "-o", "rig.h5", "-j", 1, "--fs", 1000)
    assert (tmp_path / "rig.h5").is_file()
