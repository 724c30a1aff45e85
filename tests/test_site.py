"""The documentation site: checks that need no build; ``make docs`` builds it."""

import ast
import importlib
import importlib.util
import re
import shlex
import sys
import types
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import wearstate
from click.testing import CliRunner
from matplotlib import pyplot as plt
from wearstate.diagnose.command_line.cli import cli

DOCS = Path(wearstate.__file__).parent / "docs"
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))
GUIDES = [DOCS / "start.md", *sorted((DOCS / "how-to").glob("[!i]*.md"))]

mpl.use("agg")


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


# --- pages


def pages():
    """Pages that are written by hand."""
    built = ("_build", "gallery", "generated", "examples")
    found = [page for page in DOCS.rglob("*.md") if not set(built) & set(page.parts)]
    return {page.relative_to(DOCS).with_suffix("").as_posix() for page in found}


def in_toctrees():
    """Pages that a toctree lists."""
    found = set()
    for name in pages():
        page = DOCS / f"{name}.md"
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text("utf-8"), re.S):
            lines = [line for line in tree.splitlines() if line and not line.startswith(":")]
            for line in lines:
                entry = m[1] if (m := re.search(r"<(.+)>$", line)) else line
                for each in page.parent.glob(f"{entry}.md"):
                    found.add(each.resolve().relative_to(DOCS.resolve()).with_suffix("").as_posix())
    return found


def test_every_page_is_in_a_toctree():
    assert len(pages()) > 60
    assert pages() - in_toctrees() == {"index"}


def test_the_reference_names_every_public_name():
    listed = set()
    for page in (DOCS / "reference").glob("*.md"):
        for table in re.findall(r"```\{eval-rst\}\n(.*?)```", page.read_text("utf-8"), re.S):
            [module] = re.findall(r"currentmodule:: (\S+)", table)
            listed |= {f"{module}.{name}" for name in re.findall(r"^   (\w+)$", table, re.M)}
    public = {f"wearstate.{name}" for name in wearstate._HOMES}
    for name in wearstate._MODULES:
        module = importlib.import_module(f"wearstate.{name}")
        public |= {f"{module.__name__}.{each}" for each in module.__all__}
    public.remove("wearstate.film.FILM_RUNGS")  # a table, on the page of the solvers
    assert listed == public


def made_at_build():
    """Pictures of the scripts that `make docs` runs."""
    found = set()
    for script in DOCS.glob("figures_*.py"):
        tree = ast.parse(script.read_text(encoding="utf-8"))
        [figures] = [
            node.value
            for node in tree.body
            if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "FIGURES"
        ]
        found |= {f"img/{ast.literal_eval(key)}.png" for key in figures.keys}
    return found


def test_every_picture_is_made_but_those_of_the_readme(monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    pictures = importlib.import_module("pictures")
    assert {*pictures.SCRIPTS} == {script.name for script in DOCS.glob("figures_*.py")}
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    stored = {*re.findall(r"\]\(docs/(img/[^)]+)\)", readme)}
    assert len(stored) == 2
    ignored = (DOCS.parent / ".gitignore").read_text(encoding="utf-8").splitlines()
    assert "/docs/img/*" in ignored
    assert {line for line in ignored if line[0] == "!"} == {f"!/docs/{name}" for name in stored}
    for name in pages():
        page = DOCS / f"{name}.md"
        for shown in re.findall(r"\]\((img/[^)]+)\)", page.read_text(encoding="utf-8")):
            assert shown in made_at_build() | stored, f"{name}: {shown}"
    assert not made_at_build() & stored


def test_pictures_are_made_again_when_the_program_changes(tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    monkeypatch.setattr(pictures, "FOLDER", tmp_path)
    script = pictures.SCRIPTS[0]
    assert pictures.stale(script)
    stamp = tmp_path / f".{script}.made"
    stamp.write_text(f"{pictures.current(script)}\na.png")
    assert pictures.stale(script)  # the picture is missing
    (tmp_path / "a.png").touch()
    assert not pictures.stale(script)
    stamp.write_text("another state\na.png")
    assert pictures.stale(script)
    said = f"{'what it shows ' * 30}\n{tmp_path / 'a.png'}\n"
    done = types.SimpleNamespace(stdout=said)
    monkeypatch.setattr(pictures.subprocess, "run", lambda *_, **__: done)
    pictures.run(script)  # only the line with the path is taken for a picture
    assert not pictures.stale(script)


# --- examples


def test_a_site_without_a_browser_says_so(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    screenshots = importlib.import_module("screenshots")
    monkeypatch.setattr(screenshots, "BUILD", tmp_path)
    monkeypatch.setattr(screenshots, "WORDS", tmp_path / "screens.md")
    monkeypatch.setattr(screenshots.shutil, "which", lambda name: None)
    screenshots.main()
    assert "no Chromium was found" in (tmp_path / "screens.md").read_text()
    assert "_build/screens.md" in (DOCS / "pages.md").read_text()


def test_there_are_enough_examples():
    assert len(EXAMPLES) >= 25


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_draws_one_picture(path, tmp_path, monkeypatch):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40
    title, rule = text.splitlines()[1:3]
    assert rule == "=" * len(title)
    monkeypatch.chdir(tmp_path)
    exec(compile(text, str(path), "exec"), {"__name__": path.stem})
    assert len(plt.get_fignums()) == 1
    drawn = [each for axes in plt.gcf().axes for each in axes.get_children()]
    assert len(drawn) > 10


# --- code in the guides


def blocks(text):
    """Blocks of Python and of shell, in their order."""
    return re.findall(r"^```(python|sh)\n(.*?)^```$", text, re.S | re.M)


def run_shell(text):
    for line in text.replace("\\\n", " ").splitlines():
        name, *arguments = shlex.split(line)
        assert name == "wearstate", line
        result = CliRunner().invoke(cli, arguments)
        assert result.exit_code == 0, f"{line}\n{result.output}"


def torch_stand_in():
    """The parts of torch that the guide uses, for testing it without torch installed."""

    class Subset:
        def __init__(self, data, rows):
            self.data, self.rows = data, rows

    def load(subset, *, batch_size, shuffle, collate_fn):
        assert shuffle
        for first in range(0, len(subset.rows), batch_size):
            yield collate_fn([subset.data[i] for i in subset.rows[first : first + batch_size]])

    torch = types.ModuleType("torch")
    torch.from_numpy, torch.tensor = np.asarray, np.asarray
    torch.Tensor = type("Tensor", (), {})  # other libraries look for it
    data = types.ModuleType("torch.utils.data")
    data.Subset, data.DataLoader = Subset, load
    return {"torch": torch, "torch.utils": types.ModuleType("torch.utils"), data.__name__: data}


@pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.stem)
def test_the_code_of_a_guide_runs(page, tmp_path, monkeypatch, request):
    text = page.read_text(encoding="utf-8")
    if "--interactive" in text:
        pytest.importorskip("bokeh")
    if "import torch" in text and importlib.util.find_spec("torch") is None:
        for name, module in torch_stand_in().items():
            monkeypatch.setitem(sys.modules, name, module)
    for file, fixture in (("pump.h5", "small_set"), ("pump.wsm", "small_model")):
        if file in text:
            (tmp_path / file).symlink_to(request.getfixturevalue(fixture))
    monkeypatch.chdir(tmp_path)
    names = {"__name__": page.stem}
    kinds = re.findall(r"^```([^`\s]+)", text, re.M)
    assert len(kinds) == len(re.findall(r"^```$", text, re.M))  # none without its kind
    found = blocks(text)
    assert len(found) == sum(not kind.startswith("{") and kind != "toml" for kind in kinds)
    for kind, code in found:
        if kind == "sh":
            run_shell(code)
        else:
            exec(compile(code, str(page), "exec"), names)


def test_the_reader_of_guides_sees_an_error():
    assert blocks("a\n```python\n1 / 0\n```\n") == [("python", "1 / 0\n")]
    with pytest.raises(AssertionError, match="scene check missing"):
        run_shell("wearstate scene check missing.toml")


# --- Python elsewhere: commands run in test_page_commands


WRITTEN = {"README": DOCS.parent / "README.md", **{name: DOCS / f"{name}.md" for name in pages()}}
ELSEWHERE = ("README", "datasets", "theory/force-map")
"""Pages with blocks of Python other than guides."""


@pytest.mark.parametrize("name", ELSEWHERE)
def test_the_python_of_a_page_runs(name, tmp_path, monkeypatch, request):
    text = WRITTEN[name].read_text(encoding="utf-8")
    for file, fixture in (("data.h5", "small_set"), ("pump.wsm", "small_model")):
        if file in text:
            (tmp_path / file).symlink_to(request.getfixturevalue(fixture))
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page", "wearstate": wearstate}
    for code in re.findall(r"^```python\n(.*?)^```$", text, re.S | re.M):
        compiled = compile(code, name, "exec")
        if "from datasets import" not in code:  # Hugging Face's own library is not installed here
            exec(compiled, names)


def test_python_stands_on_no_other_page():
    guides = {page.relative_to(DOCS).with_suffix("").as_posix() for page in GUIDES}
    having = {name for name, page in WRITTEN.items() if "```python" in page.read_text("utf-8")}
    assert having - guides == {*ELSEWHERE}
