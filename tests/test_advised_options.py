"""Whatever option or command a message advises is there, for the one who reads the message."""

import ast
import re
from functools import cache
from itertools import product
from pathlib import Path

import click
import pytest
import wearstate
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.options.shared import as_options
from wearstate.features.catalogue.analysis import Settings
from wearstate.features.catalogue.needs import NEEDS, Layout

ROOT = Path(wearstate.__file__).parent
SOURCES = [
    p for part in ("sim", "features", "datasets", "diagnose") for p in ROOT.glob(f"{part}/**/*.py")
]
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
COMMAND = re.compile(r"\bwearstate ((?:[a-z]+ )?[a-z]+)")
FOREIGN = {"--nthreads", "--least", "--most"}  # of `dask worker`; properties of a page's style
NAMED = {"import": "import", "train": "train", "retrain": "train", "generate": "generate"}
"""Word before an option -> command that it tells to run."""
OWN_RULE = {
    f"{path.parent.name}/{path.stem}"
    for room in ("options", "command_line")
    for path in ROOT.glob(f"diagnose/{room}/*.py")
    if path.stem not in ("__init__", "cli", "chart_run")
}
"""Files that hold many commands or declare options: see the test of usage errors."""
SPOKEN_BY = {
    "charts/across": {"evaluate"},
    "report/advice": {"report"},
    "report/batch": {"report"},
    "alignment/text": {"align"},
    "inspect/audit_text": {"splits"},
    "inspect/rank_text": {"features"},
    "blindspots/blindspots": {"blindspots"},
    "command_line/chart_run": {"chart"},
    "charts/sentences": {"chart"},
    "wear_model/estimate": {"evaluate", "report"},
    "wear_model/verdict": {"evaluate", "report"},
    "evaluation/evaluate": {"evaluate"},
    "evaluation/protocol": {"evaluate"},
    "evaluation/splits": {"evaluate"},
    "film_clearance/clearance": {"report"},
    "report/film": {"report"},
    "film_clearance/wear_down": {"report"},
    "response/impact": {"features", "info"},
    "pages/kept": {"blindspots", "chart"},
    "pages/points": {"chart", "report", "sweep"},
    "recording_faults/layout": {"report"},
    "report/verdict": {"report"},
    "templates/report_batch.html": {"report"},
    "charts/scene_edit": {"chart", "simulate"},
    "class_model/train": {"import"},
    "wear_model/like": {"import", "info", "report"},
    "machines/pump": {"report"},
    "nameplate/cautions": {"report"},
    "source/settled": {"import", "info", "report"},
    "feature_rows/feature_table": {"evaluate", "features", "report", "train"},
    "sweep/axes": {"sweep"},
    "sweep/show": {"sweep"},
    "sweep/text": {"sweep"},
}
"""File -> commands that say its messages, where these name an option without a command."""


def commands(group=cli, path=""):
    """Every command with the name it is called by."""
    for name, command in group.commands.items():
        yield f"{path}{name}", command
        if isinstance(command, click.Group):
            yield from commands(command, f"{path}{name} ")


ALL = dict(commands())


def options_of(name):
    context = click.Context(ALL[name])
    return {
        option
        for param in ALL[name].get_params(context)
        for option in param.opts + param.secondary_opts
    }


def strings(path):
    """Texts of a source with their line, docstrings and declared options left out."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return [(number, line) for number, line in enumerate(text.splitlines(), 1)]
    tree = ast.parse(text)
    skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(value) for value in node.values}
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "option":
            skipped |= {id(value) for value in node.args}
    found = []
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.append((node.lineno, node.value))
        elif isinstance(node, ast.JoinedStr):
            parts = [getattr(value, "value", "") for value in node.values]
            found.append((node.lineno, "".join(p if isinstance(p, str) else "{}" for p in parts)))
    return found


@cache
def messages():
    """Every text that names an option or a command: file, line, text."""
    files = [p for p in SOURCES if p.suffix == ".py"] + sorted(
        ROOT.glob("diagnose/pages/templates/*.j2")
    )
    return [
        (path, line, text)
        for path in files
        for line, text in strings(path)
        if OPTION.search(text) or COMMAND.search(text)
    ]


def readers(path, text, place):
    """Commands that must all have the option at a place of a message."""
    if spot(path) in OWN_RULE:
        return set()
    before = text[:place]
    if said := COMMAND.findall(before):
        return {command_in(said[-1])}
    for word in reversed(re.findall(r"[a-z]+", before)):
        if word in NAMED:
            return {NAMED[word]}
    return SPOKEN_BY.get(spot(path), set())


def spot(path):
    """Room and file, without the endings: file names are unique within a room only."""
    return f"{path.parent.name}/{path.name.removesuffix('.j2').removesuffix('.py')}"


def command_in(words):
    """Command that words begin with: `splits` of `splits then`, `recipe show` as it is."""
    return words if words in ALL else words.split()[0]


def test_every_advised_option_and_command_exists():
    everywhere = set().union(*(options_of(name) for name in ALL)) | FOREIGN
    wrong = []
    for path, line, text in messages():
        where = f"{path.name}:{line}: {text!r}"
        wrong += [f"{where}: {o}" for o in OPTION.findall(text) if o not in everywhere]
        for found in OPTION.finditer(text):
            missing = [
                name
                for name in readers(path, text, found.start())
                if name in ALL and found.group() not in options_of(name) | FOREIGN
            ]
            wrong += [f"{where}: {name} has no {found.group()}" for name in missing]
    assert wrong == []


def test_every_command_of_an_advice_exists():
    wrong = [
        f"{path.name}:{line}: wearstate {words}"
        for path, line, text in messages()
        for words in re.findall(
            r"(?:see|with|one|it|recordings|out|run):? wearstate ([a-z]+)", text
        )
        if words not in ALL
    ]
    assert wrong == []
    said = {word for _, _, text in messages() for word in re.findall(r"wearstate ([a-z]+)", text)}
    assert said >= {"train", "import", "splits"}


def test_the_walk_finds_what_it_should():
    texts = [text for _, _, text in messages()]
    assert any("--margin" in text for text in texts)
    assert any("<code>--json</code>" in text for text in texts)
    assert len(texts) > 60


def test_a_file_whose_messages_name_bare_options_says_who_reads_them():
    known = {"command_line/cli", *OWN_RULE, *SPOKEN_BY}
    bare = {
        spot(path)
        for path, _, text in messages()
        for found in OPTION.finditer(text)
        if not readers(path, text, found.start()) and found.group() not in FOREIGN
    }
    assert bare - known - {"convert/export"} == set()  # the export writes whole command lines


def test_the_usage_errors_of_a_command_name_its_own_options():
    wrong = []
    for path in ROOT.glob("diagnose/command_line/*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for function in tree.body:
            if not isinstance(function, ast.FunctionDef):
                continue
            name = function.name.removesuffix("_files")
            if name not in ALL:
                continue
            for node in ast.walk(ast.Module(body=function.body, type_ignores=[])):
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    if COMMAND.search(node.value):
                        continue
                    said = set(OPTION.findall(node.value))
                    wrong += [f"{name}: {o}" for o in said - options_of(name)]
    assert wrong == []


LAYOUTS = [
    Layout(
        channels=names,
        quantities=quantities,
        fs=fs,
        n_samples=n,
        tacho=tacho,
        pulses_per_revolution=1 + tacho,
        settings=settings,
    )
    for (names, quantities), fs, n, tacho, settings in product(
        (
            (("a",), ("acceleration",)),
            (("a",), ("force",)),
            (("a", "b"), ("force", "acceleration")),
            (("a", "b", "c"), ("displacement",) * 3),
        ),
        (0.5, 30.0, 800.0, 25_600.0),
        (64, 4096),
        (False, True),
        (
            Settings(),
            Settings(machine="industrial-1-rigid", speed_band_hz=(0.01, 5.0)),
            Settings(envelope_band=(1000.0, 1000.5), speed_hz=10.0),
        ),
    )
]


@pytest.mark.parametrize("need", NEEDS)
def test_an_unmet_need_advises_options_or_python_by_name(need):
    """What looks like an argument is an option of `features`, or told to be for Python."""
    command, had = ALL["features"], options_of("features")
    faults = {NEEDS[need].fault(layout) for layout in LAYOUTS} - {""}
    assert faults
    for fault in faults:
        text = as_options(fault, command)
        elsewhere = r"wearstate import --[a-z-]+"
        assert set(OPTION.findall(re.sub(elsewhere, "", text))) <= had
        for cure in text.split("; ")[1:]:
            for word in re.findall(r"\b[a-z]+_[a-z_]+\b", cure):
                assert "in Python" in cure[: cure.index(word)], text
        assert "nperseg" not in text
