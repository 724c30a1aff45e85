"""`info --card`: every number on the page is that of the file, and its snippets run."""

import html
import os
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.inspect.card import (
    CardPicture,
    CardTable,
    Code,
    card_html,
    card_markdown,
    data_card,
    snippets,
    write_card,
)
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

N = 24
CLEARANCE = "diametral_clearance_bearing_m"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Twenty-four simulated records of twelve machines, in every grade."""
    path = tmp_path_factory.mktemp("card") / "data.h5"
    generate(load_recipe("journal-bearing-small", {"duration": "0.3 s"}), N, path, seed=1)
    return path


@pytest.fixture(scope="module")
def card(path):
    with DataSet(path) as data:
        return data_card(data, licence="CC BY 4.0")


@pytest.fixture(scope="module")
def manifest(path):
    with DataSet(path) as data:
        return data.manifest


def section(card, name):
    return dict(card.sections)[name]


def rows(card, name, number=0):
    tables = [block for block in section(card, name) if isinstance(block, CardTable)]
    return [dict(zip(tables[number].head, row, strict=True)) for row in tables[number].rows]


def test_the_first_sentence_counts(card, manifest):
    n_machines = manifest["group"].nunique()
    assert card.lead == (
        f"24 simulated recordings of {n_machines} machine draws, 0.3 s of 3 channels at 5120 Hz "
        "each."
    )
    assert card.title == "Clearance of a plain journal bearing, for trials"


def test_labels_are_those_of_the_file(card, manifest):
    [severity] = rows(card, "Labels")
    values = 1e3 * manifest[CLEARANCE]
    assert severity["column"] == CLEARANCE
    assert [float(severity[f"{name} [mm]"]) for name in ("least", "median", "largest")] == (
        pytest.approx([values.min(), values.median(), values.max()], rel=1e-3)  # four digits
    )
    balance = rows(card, "Labels", 1)
    counts = manifest["grade"].value_counts().sort_index()
    assert [int(row["grade"]) for row in balance] == counts.index.tolist()
    assert [int(row["records"]) for row in balance] == counts.tolist()
    assert sum(float(row["share"].rstrip(" %")) for row in balance) == pytest.approx(100, abs=0.2)
    assert [row["meaning"] for row in balance][-1] == "condemned"


def test_every_column_is_told_or_said_to_be_empty(card, manifest):
    told = {row["column"]: row for row in rows(card, "Columns")}
    text = section(card, "Columns")[1]
    empty = text.removeprefix("Unknown in every record: ").removesuffix(".").split(", ")
    assert set(told) | set(empty) == set(manifest)
    assert set(told) & set(empty) == set()
    assert manifest[[name for name in empty if manifest[name].dtype.kind == "f"]].isna().all().all()
    speed = told["speed_hz"]
    assert (speed["unit"], speed["unknown"]) == ("Hz", "")
    assert float(speed["least"]) == pytest.approx(manifest["speed_hz"].min(), rel=1e-3)
    assert told["group"]["least"] == f"{manifest['group'].nunique()} different"
    assert all(row["meaning"] for row in told.values())


def test_models_and_errors(card, manifest):
    rungs = {row["column"]: row["model (records)"] for row in rows(card, "Models and their errors")}
    assert rungs["rung_film"] == f"{manifest['rung_film'][0]} (24)"
    texts = " ".join(b for b in section(card, "Models and their errors") if isinstance(b, str))
    assert f"largest {100 * manifest['estimated_error'].max():.2g} %, known for 24 records" in texts
    assert "Status of the records: 24 ok." in texts


def test_splits_are_listed_with_their_sides(card, path):
    with DataSet(path) as data:
        wanted = {name: [len(side) for side in data.split(name)] for name in data.splits}
    found = {r["split"]: [int(r["train"]), int(r["test"])] for r in rows(card, "Splits")}
    assert found == wanted
    assert "machine" in found


def test_a_file_without_splits_says_how_to_split(path, tmp_path):
    copy = tmp_path / "data.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        del file["splits"]
    with DataSet(copy) as data:
        [text] = section(data_card(data, pictures=False), "Splits")
    assert "Split by the column group" in text


def test_licence_and_citation(card):
    licence, citation = section(card, "Licence and citation")
    assert licence == "Licence: CC BY 4.0."
    assert "recipe journal-bearing-small, seed 1, wearstate" in citation


def test_a_picture_of_every_grade(card, manifest):
    pictures = section(card, "One recording of each grade")
    assert all(isinstance(picture, CardPicture) for picture in pictures)
    for grade in sorted(set(manifest["grade"])):
        own = [p.caption for p in pictures if p.caption.startswith(f"Grade {grade},")]
        assert len(own) == 2  # waveform and spectrum
        [number] = {int(re.search(r"record (\d+)", caption)[1]) for caption in own}
        assert manifest["grade"][number] == grade


# -- limits --------------------------------------------------------------------------------------


def measured(folder, status=("ok", "no_tacho_pulses"), grade=(-1, -1)):
    head = Attributes(
        sample_rate=1000.0,
        channels=(Channel(name="acc", unit="m/s^2", quantity="acceleration"),),
        origin="measured",
    )
    path = folder / "rig.h5"
    columns = {"rig": "S40", "clipped_samples": "<i8"}
    with DataSetWriter(path, head, n_records=2, n_samples=400, columns=columns) as writer:
        for i in range(2):
            signal = np.random.default_rng(i).standard_normal((1, 400))
            row = {"record_id": str(i), "group": 0, "status": status[i], "grade": grade[i]}
            writer.write(i, signal, {**row, "rig": "<b>|x|</b>", "clipped_samples": i})
        writer.finish()
    return path


def test_known_limits_are_those_of_the_file(card, tmp_path):
    [simulated] = section(card, "Known limits")
    assert simulated[0].startswith("Simulated: it contains only what the models contain.")
    assert any("random by record puts the same machine on both sides" in t for t in simulated)
    with DataSet(measured(tmp_path)) as data:
        page = data_card(data, pictures=False)
    [limits] = section(page, "Known limits")
    assert limits[0].startswith("Measured: labels are as given on import")
    assert "The grade of 2 record(s) is not known." in limits
    assert "1 record(s) have a status other than ok: leave them out." in limits
    assert "1 record(s) hold saturated samples, as a real sensor would." in limits
    assert "Models and their errors" not in dict(page.sections)


def test_a_measured_set_without_labels_has_a_page(tmp_path):
    write_card(measured(tmp_path), tmp_path / "card.html")
    page = (tmp_path / "card.html").read_text()
    assert "Grade not known, record 0 (measured). Waveform" in page
    assert "&lt;b&gt;|x|&lt;/b&gt;" in page  # a label is text, not part of the page
    write_card(tmp_path / "rig.h5", tmp_path / "card.md")
    assert "| <b>\\|x\\|</b> |" in (tmp_path / "card.md").read_text()


# -- pages ---------------------------------------------------------------------------------------


def test_the_page_stands_alone(card):
    page = card_html(card)
    assert page.count("data:image/png;base64,") == len(section(card, "One recording of each grade"))
    for word in ("http://", "https://", "<script", "<link"):
        assert word not in page
    for code in snippets("data.h5", CLEARANCE):
        assert code.text.rstrip() in html.unescape(page)


def test_markdown_has_the_same_words_and_no_pictures(card):
    text = card_markdown(card)
    assert "data:image" not in text
    assert (
        "| grade | meaning | records | share | machines |\n| --- | --- | ---: | ---: | ---: |"
        in text
    )
    assert text.count("```python") == 3
    for line in text.splitlines():  # a table has as many cells in every row
        assert not line.startswith("|") or line.endswith("|")


def test_the_same_file_gives_the_same_page(path, tmp_path):
    pages = [tmp_path / "a.html", tmp_path / "b.html"]
    for page in pages:
        write_card(path, page)
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_the_command(path, tmp_path):
    def run(*more, code=0):
        result = CliRunner().invoke(cli, ["info", str(path), *map(str, more)])
        assert result.exit_code == code, result.output
        return result

    page = tmp_path / "card.md"
    assert str(page) in run("--card", page, "--licence", "CC0").stdout
    assert "Licence: CC0." in page.read_text()
    assert "exists" in run("--card", page, code=2).stderr
    run("--card", page, "--verify", "--force")
    assert "must be one of" in run("--card", tmp_path / "card.txt", code=2).stderr
    with pytest.raises(DataError, match=r"suffix '\.txt' must be \.html or \.md"):
        write_card(path, tmp_path / "card.txt")


def test_no_card_of_a_file_that_is_not_sound(path, tmp_path):
    copy = tmp_path / "data.h5"
    raw = bytearray(path.read_bytes())
    with h5py.File(path) as file:
        raw[file["signal"].id.get_chunk_info(3).byte_offset] ^= 1
    copy.write_bytes(raw)
    result = CliRunner().invoke(
        cli, ["info", str(copy), "--verify", "--card", str(tmp_path / "card.md")]
    )
    assert result.exit_code == 1
    assert "record 3: signal does not fit its checksum" in result.stdout
    assert not (tmp_path / "card.md").exists()


# -- snippets ------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", range(3))
def test_a_snippet_runs_beside_the_file(path, number, tmp_path):
    code = snippets(path.name, CLEARANCE)[number]
    assert isinstance(code, Code)
    done = run_beside(path, code.text + SHAPE, tmp_path)
    missing = re.search("No module named '(torch|datasets)'", done.stderr)
    if missing:  # asked here and not by an import: with the root on the path, datasets is ours
        pytest.skip(f"{missing[1]} is not installed")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [
        str(N),
        *("(4, 3, 1536)" if number == 1 else "(3, 1536)").split(),
    ]


SHAPE = """
print(len(usable), tuple((signals if "signals" in globals() else signal).shape))
"""


def run_beside(path, code, cache):
    """Run code as a script of its own, with the folder of the file as its working folder."""
    script = cache / "snippet.py"
    script.write_text(code)
    return subprocess.run(
        [sys.executable, script],
        cwd=path.parent,
        env={**os.environ, "HF_HOME": str(cache), "HF_DATASETS_OFFLINE": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
