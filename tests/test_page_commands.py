"""Command lines that pages show are run, those of a page in their order and in one folder.

What a page shows is what runs, but for two rules. A file that a page names and that no earlier line
of it writes is a small one (`STAND_INS`); so is one that a shortened command wrote. And counts,
sizes and budgets are cut and one process is taken (`CUTS`), nothing else. Guides run as they
stand, in test_site.
"""

import glob
import re
import shlex
import zlib
from itertools import pairwise
from pathlib import Path

import click
import numpy as np
import pytest
import wearstate
from click.testing import CliRunner
from scipy.io import savemat, wavfile
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.options.help import FIRST_CONTACT
from wearstate.sim.scene.load import minimal_text, scene_text

from .conftest import made_once
from .test_site import DOCS, GUIDES, WRITTEN

PAGES = {name: page.read_text(encoding="utf-8") for name, page in WRITTEN.items()}
for number, way in enumerate(FIRST_CONTACT.split("\n\n")[1:4], 1):
    shown = re.sub(r"(?m)^ +(\S.*?)  +(?=\S)", r"\1  # ", way)
    PAGES[f"wearstate, way {number}"] = f"```\n{shown}\n```\n"

CUTS = (
    ("generate", "-n", "2"),
    ("(generate|train|calibrate|features|evaluate|sweep)", "-j", "1"),
    ("calibrate", "--budget", "1"),
    ("blindspots", "-n", "1"),
    ("blindspots", "--budget", "1"),
    ("chart .*(pump|mine)", "--budget", "1"),
    ("chart data", "--budget", "1"),
    ("stability", "--size", "3"),
    ("stability", "--budget", "1"),
    ("recipe preview", "-n", "24"),
    ("sweep", "--starts", "1"),
    ("sweep bilge-pump", "--set", "duration=1.2 s"),
)
"""Beginning of a command as a pattern, option, and its value here whatever the page says."""

SLOW = {
    "evaluate pump.wsm pump.h5 --retrain all -o splits.html --cache folder": "trains on seven "
    "splits: 20 s; the README's line does on two",
    "stability journal-bearing -o atlas.svg": "all maps of a journal: 9 s; tests/test_stability.py "
    "draws them, and a page's line those of a pump",
    "demo": "20 s; tests/run.sh runs it twice, with the wheel",
    "evaluate bilge-pump-standard --across-fidelity -n 120": "trains on every rung, each on 20 "
    "records or more: 50 s; tests/test_across.py has shorter records",
    "evaluate bilge-pump-standard --across-fidelity -n 120 --effect pressure": "the same: 25 s",
    "chart journal-bearing-small --accuracy verdict=2% -o verdict.html --apply cheaper.toml": "the "
    "same: 15 s; tests/test_chart_verdict.py has shorter records",
}
"""Lines that cannot be made cheap, and why; ``-m slow`` runs them as they stand."""

OTHERS = {
    "make demo": "a target of the Makefile: wearstate demo",
    "make test": "is what runs here",
    "python tests/benchmarks/opponents_crank.py --exudyn PYTHON --plot opponents.png": "needs "
    "another program, in an environment of its own",
    "python tests/benchmarks/opponents_crank.py --repeats 3": "the same, for 11 minutes",
}
"""Lines of other programs, which no test runs, and why."""


# --- lines


def lines_of(text):
    """Lines of the blocks of a page, those of Python, TOML and directives left out."""
    for kind, block in re.findall(r"^```([^`\n]*)\n(.*?)^```$", text, re.S | re.M):
        if kind in ("", "sh"):
            for line in block.replace("\\\n", " ").splitlines():
                yield shlex.split(line, comments=True) if line.startswith(PROGRAMS) else []


PROGRAMS = ("wearstate ", "python ", "make ", "pip ", "git ", "eval ")


def command_lines(text):
    """Commands of this program, as words."""
    return [words[1:] for words in lines_of(text) if words[:1] == ["wearstate"]]


def understand(words):
    """Read a command as the program would, without running it."""
    command, context = cli, None
    while isinstance(command, click.Group):
        context = command.make_context(command.name, list(words), parent=context)
        _, command, words = command.resolve_command(
            context, [*context._protected_args, *context.args]
        )
    command.make_context(command.name, list(words), parent=context)


def outputs(words):
    """What a command writes."""
    return {after for word, after in pairwise(words) if word in ("-o", "--card")}


def cut(words):
    """The same command with small counts and budgets, and whether it has fewer records."""
    words, line, shorter = [*words], shlex.join(words), False
    for command, option, value in CUTS:
        if re.match(command, line):
            if option in words:
                words[words.index(option) + 1] = value
            else:
                words += [option, value]
            shorter |= option == "-n"
    return words, shorter


def expanded(words):
    """Words with ``*`` replaced by the files that fit, as a shell does."""
    return [each for word in words for each in sorted(glob.glob(word)) or [word]]


def run(words):
    """Run one command in the present folder; its output where it fails."""
    result = CliRunner().invoke(cli, expanded(words))
    if result.exit_code:
        reason = result.output if isinstance(result.exception, SystemExit) else result.exception
        pytest.fail(f"wearstate {shlex.join(words)}\n{reason!s}")


# --- files that stand for those of a page


def fixture(name):
    """A file that all tests share."""
    return lambda path, request: path.symlink_to(request.getfixturevalue(name))


def scene(name):
    """A scene file: a built-in one to begin with."""
    return lambda path, request: path.write_text(scene_text(name), encoding="utf-8")


def shortest(machine):
    """A scene file as ``scene new`` writes it."""
    return lambda path, request: path.write_text(minimal_text(machine), encoding="utf-8")


def recorded(name, **values):
    """A simulated recording."""
    words = [f"--set={key.replace('__', '.')}={value}" for key, value in values.items()]
    return lambda path, request: run(["simulate", name, *words, "-o", str(path)])


def wav(path, request):
    """Two accelerometers [g] and a tacho."""
    recording = wearstate.simulate("bilge-pump", seed=zlib.crc32(path.name.encode()))
    channels = np.stack([recording["acc_x"], recording["acc_y"], 9.80665 * recording["tacho"]])
    wavfile.write(path, 25600, (channels / 9.80665).T.astype(np.float32))


def rig(path, request):
    """Three WAV files of a rig, and their labels."""
    path.parent.mkdir()
    for day in range(3):
        wav(path.parent / f"day{day}.wav", request)
    rows = [f"day{day}.wav,new" for day in range(3)]
    Path("labels.csv").write_text("\n".join(["file,condition", *rows]), encoding="utf-8")


def earlier(path, request):
    """A data set of one measured file."""
    wav(Path("earlier.wav"), request)
    run(shlex.split("import earlier.wav --channels acc_x,acc_y,key --unit g --tacho key --label "
                    "condition=new -o earlier.h5"))  # fmt: skip


def dated(path, request):
    """A folder of three recordings, dates in their names."""
    path.mkdir()
    for month in (1, 2, 3):
        run(["simulate", "bilge-pump", "--set=duration=2.4 s", f"--seed={month}",
             "-o", f"{path}/pump_2026-0{month}-05.h5"])  # fmt: skip


def bearings(path, request):
    """Recordings of rolling bearings as .mat files, as the page names them."""
    listed = re.search(r"```\n(file,condition\n.*?)```", PAGES["own-data"], re.S)[1]
    Path("labels.csv").write_text(listed, encoding="utf-8")
    rng, hz = np.random.default_rng(0), {"inner": 118.0, "outer": 81.0, "healthy": 0.0}
    for name, kind in re.findall(r"^(\S+\.mat),(\w+)$", listed, re.M):
        rate = 97_656.0 if kind == "healthy" else 48_828.0
        t = np.arange(round(rate)) / rate
        blows = np.diff(np.floor(hz[kind] * t), prepend=0.0)
        ring = np.exp(-1500 * t[:1024]) * np.sin(2 * np.pi * 4000 * t[:1024])
        signal = np.convolve(blows, ring)[: t.size] + 0.1 * rng.standard_normal(t.size)
        savemat(name, {"bearing": {"sr": rate, "gs": signal[:, None], "load": 0.0, "rate": 25.0}})


def features(path, request):
    """Features of `few_set`."""
    run(["features", str(request.getfixturevalue("few_set")), "-o", str(path), "-j", "1"])


def table(path, request):
    """A table of noise, and the labels of its rows in a file of their own."""
    rng, rows = np.random.default_rng(0), range(48)
    states = ["worn" if row % 8 < 4 else "new" for row in rows]
    lines = [f"{rng.normal()},{row // 4},{states[row]}" for row in rows]
    path.write_text("\n".join(["rms,machine,state", *lines]), encoding="utf-8")
    Path("labels.csv").write_text("\n".join(["state", *states]), encoding="utf-8")


def drawn(seed):
    """A data set of two records."""
    return lambda path, request: generate("bilge-pump-small", 2, path, seed=seed)


def of_rigs(path, request):
    """Sixteen short shaker tests of shaft rigs, or the same rigs running."""
    path.symlink_to(request.getfixturevalue("rig_sets") / path.name)


def strange(recipe, records):
    """Short records of what a model must refuse: of a kind 20 are the fewest."""

    def make(path, request):
        generate(load_recipe(recipe, {"duration": "1 s"}), records, path, seed=17)

    return make


SHAKEN = recorded("shaft-rig", exciters__0__force="20 N", duration="20 s", sample_rate="1.024 kHz")


def jacks(path, request):
    """Reactions of the rig's bearings [kN]."""
    path.write_text("bearing,reaction_kn\nsecond,0.3\nthird,0.2\n", encoding="utf-8")


@pytest.fixture(scope="module")
def bearing_model(common, journal_trained):
    """Wear model of journal bearings."""
    return made_once(
        common / "bearing.wsm", lambda path: wearstate.save_model(journal_trained[0], path)
    )


STAND_INS = {
    "data.h5": fixture("few_set"),
    "pump.h5": fixture("few_set"),
    "other.h5": fixture("few_set"),
    "pump.wsm": fixture("small_model"),
    "bearing.wsm": fixture("bearing_model"),
    "oil.h5": strange("bilge-pump-lubricated", 40),  # 20 starved, 20 flooded
    "loose.h5": strange("bilge-pump-loose", 20),
    "pump.toml": scene("bilge-pump"),
    "bearing.toml": scene("journal-bearing"),
    "line.toml": scene("shaft-rig"),
    "mine.toml": shortest("pump"),
    "healthy.h5": recorded("bilge-pump"),
    "recording.h5": recorded("bilge-pump"),
    "today.h5": recorded("journal-bearing"),
    "as-new.h5": recorded("journal-bearing"),
    "pump.wav": wav,
    "rig.wav": wav,
    "rig/*.wav": rig,
    "earlier.h5": earlier,
    "folder/": dated,
    "*.mat": bearings,
    "tests.h5": SHAKEN,
    "jacks.csv": jacks,
    ("datasets", "test.h5"): of_rigs,
    ("datasets", "running.h5"): of_rigs,
    ("results", "test.h5"): SHAKEN,
    "features.parquet": features,
    "table.csv": table,
    "a.h5": drawn(1),
    "b.h5": drawn(2),
}
"""File, or page and file -> what makes a small one."""


# --- tests


@pytest.mark.parametrize("name", sorted(PAGES))
def test_every_command_of_a_page_is_understood(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in command_lines(PAGES[name]):
        try:
            understand(words)
        except click.ClickException as error:
            pytest.fail(f"wearstate {shlex.join(words)}: {error.format_message()}")


GUIDED = {page.relative_to(DOCS).with_suffix("").as_posix() for page in GUIDES}
SHOWING = sorted(name for name, text in PAGES.items() if command_lines(text) and name not in GUIDED)


def supplied(page, words, request):
    """Make what a line reads and no earlier one has written."""
    for word in words:
        make = STAND_INS.get((page, word), STAND_INS.get(word))
        if make and word not in outputs(words) and not glob.glob(word):
            make(Path(word), request)


@pytest.mark.parametrize("name", SHOWING)
def test_the_commands_of_a_page_run(name, tmp_path, monkeypatch, request):
    monkeypatch.chdir(tmp_path)
    for words in command_lines(PAGES[name]):
        if shlex.join(words) in SLOW:
            continue
        supplied(name, words, request)
        less, shorter = cut(words)
        run(less)
        for written in outputs(words):
            assert Path(written).stat().st_size > 0, written
            if shorter and ((name, written) in STAND_INS or written in STAND_INS):
                Path(written).unlink()


def test_tables_of_this_file_name_what_stands_on_a_page():
    shown = [words for text in PAGES.values() for words in command_lines(text)]
    lines = {shlex.join(words) for words in shown}
    assert {*SLOW} <= lines
    for page, file in ((key if isinstance(key, tuple) else (None, key)) for key in STAND_INS):
        texts = PAGES if page is None else [page]
        assert any(file in words for name in texts for words in command_lines(PAGES[name])), file
    for command, option, _ in CUTS:
        assert any(re.match(command, line) for line in lines), command
        assert any(param.opts[0] == option or option in param.opts for param in _params(command))


def _params(pattern):
    return [
        param
        for name, group in cli.commands.items()
        if re.match(pattern.split()[0], name)
        for command in (group, *getattr(group, "commands", {}).values())
        for param in command.params
    ]


def test_no_line_of_another_program_is_forgotten():
    found = {
        shlex.join(words)
        for text in PAGES.values()
        for words in lines_of(text)
        if words and words[0] != "wearstate"
    }
    assert found == {*OTHERS}


def test_the_reader_of_commands_sees_a_fault(tmp_path, monkeypatch):
    text = "```\nwearstate info x.h5 \\\n  --verfy  # all\n```\n```{include} a\nwearstate no\n```\n"
    [words] = command_lines(text)
    assert words == ["info", "x.h5", "--verfy"]
    with pytest.raises(click.NoSuchOption, match="--verfy"):
        understand(words)
    assert {"README", "evaluation", "fidelity", "results", "leakage"} <= {*SHOWING}
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pytest.fail.Exception, match=r"info x\.h5\nError: x\.h5: no such file"):
        run(["info", "x.h5"])


def test_only_counts_and_budgets_are_cut():
    words = shlex.split("generate mine -n 2000 --seed 7 -o data.h5")
    assert cut(words) == (shlex.split("generate mine -n 2 --seed 7 -o data.h5 -j 1"), True)
    words = shlex.split("report pump.wav --model pump.wsm")
    assert cut(words) == (words, False)


@pytest.mark.slow  # minutes
@pytest.mark.parametrize("line", SLOW)
def test_a_long_command_of_a_page_runs(line, tmp_path, monkeypatch, request):
    monkeypatch.chdir(tmp_path)
    supplied(None, shlex.split(line), request)
    run(shlex.split(line))
