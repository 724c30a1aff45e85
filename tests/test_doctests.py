"""Every example in a docstring runs and gives what it says."""

import doctest
import importlib
import linecache
import pkgutil

import pytest
import wearstate

MODULES = ["wearstate"] + [
    info.name
    for info in pkgutil.walk_packages(wearstate.__path__, "wearstate.")
    if not info.name.endswith("__main__")  # importing it runs the command line
    and info.name.split(".")[1] in {"sim", "features", "datasets", "diagnose", *wearstate._MODULES}
]

USE_A_MODEL = (
    "wearstate.diagnose.workflow.",
    "wearstate.diagnose.wear_model.file",
    "wearstate.diagnose.class_model.file",
)
"""Their examples find a data set pump.h5 and a model pump.wsm trained on it."""


def test_the_walk_finds_the_library():
    assert {"wearstate.sim.scene.load", "wearstate.diagnose.literature.verify"} <= set(MODULES)
    assert len(MODULES) > 200


@pytest.mark.parametrize("name", MODULES)
def test_docstrings(name, tmp_path, monkeypatch, request):
    module = importlib.import_module(name)
    if name.startswith(USE_A_MODEL):
        data = "few_set" if name.endswith(".train") else "small_set"  # trains, asks no accuracy
        for file, fixture in (("pump.h5", data), ("pump.wsm", "small_model")):
            (tmp_path / file).symlink_to(request.getfixturevalue(fixture))
    monkeypatch.chdir(tmp_path)  # an example that writes a file leaves none behind
    # its debugger, which nothing starts, would look for changes in every source, each time
    monkeypatch.setattr(linecache, "checkcache", lambda *_: None)
    failed, _ = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0
