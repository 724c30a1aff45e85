"""Docstrings of the public names, as numpydoc validates them."""

import dataclasses
import importlib
import inspect

import pytest
import wearstate
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate

LEFT_OUT = {
    "GL01",  # text begins on the line of the quotes, as ruff has it
    "GL02",
    "ES01",  # a summary that says all needs no second one
    "SA01",  # the reference lists neighbours
    "SS05",  # takes every plural for a verb: "Features of one recording"
}
"""Checks that are not asked for."""

OF_FUNCTIONS = {"PR01", "EX01"}
"""Checks that a class meets otherwise: fields under Attributes, an example where it is made."""

HOMES = [wearstate, *(getattr(wearstate, name) for name in wearstate._MODULES)]
PUBLIC = {
    f"{value.__module__}.{value.__qualname__}": value
    for home in HOMES
    for value in (getattr(home, name) for name in home.__all__)
    if callable(value)
}


def faults(name, value):
    left_out = LEFT_OUT | OF_FUNCTIONS if inspect.isclass(value) else LEFT_OUT
    return [f"{code} {text}" for code, text in validate(name)["errors"] if code not in left_out]


def undocumented(value):
    """Fields of a class that stand neither under Parameters nor under Attributes."""
    if not dataclasses.is_dataclass(value):
        return set()
    doc = get_doc_object(value, "class")
    told = [row.name for row in (*doc["Parameters"], *doc["Attributes"])]
    names = {name.strip() for each in told for name in each.split(",")}
    return {each.name for each in dataclasses.fields(value)} - names


def test_all_names_are_there():
    assert len(PUBLIC) > 100
    assert {
        "wearstate.sim.bearing.operate.operate",
        "wearstate.diagnose.workflow.train.train",
    } <= set(PUBLIC)


def test_the_judge_sees_a_fault(tmp_path, monkeypatch):
    code = 'def double(x):\n    """Double."""\n    return 2 * x\n'
    (tmp_path / "told_little.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    value = importlib.import_module("told_little").double
    found = [each[:4] for each in faults("told_little.double", value)]
    assert found == ["PR01", "RT01", "EX01"]


def test_the_judge_sees_a_field_without_a_word():
    @dataclasses.dataclass
    class Half:
        """A half.

        Attributes
        ----------
        one : int
        """

        one: int
        other: int

    assert undocumented(Half) == {"other"}


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_is_documented(name):
    assert faults(name, PUBLIC[name]) == []
    assert undocumented(PUBLIC[name]) == set()
