"""File names that are no UTF-8 text: every command goes on, no stream or file chokes."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import wavfile
from wearstate.datasets.file.record import DataSet

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_commands as fuzz

NAME = os.fsdecode(b"a\xff")
STRANGE = pytest.mark.skipif(sys.platform != "linux", reason="names of bytes are those of Linux")
pytestmark = STRANGE


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with two recordings, the name of one being no text."""
    rng = np.random.default_rng(0)
    for name in (f"{NAME}.wav", "good.wav"):
        with (tmp_path / name).open("wb") as handle:
            wavfile.write(handle, 10000, rng.normal(0, 0.1, 4000).astype(np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(*words, code=0):
    """What a command says on streams that take UTF-8 alone."""
    log = Path("log")
    found, _ = fuzz.run_forked([str(word) for word in words], log)
    text = log.read_text(encoding="utf-8")
    assert found == code, text
    assert "Traceback" not in text
    return text


def test_streams_show_the_bytes(folder):
    assert r"a\udcff.wav" in said("import", "--list", f"{NAME}.wav")
    assert r"/a\udcff.mat: no such file" in said("info", folder / f"{NAME}.mat", code=2)


def test_names_go_into_data_sets_and_tables(folder):
    said("import", f"{NAME}.wav", "good.wav", "--unit", "m/s^2", "-o", f"{NAME}.h5", "-j", 1)
    names = [str(name) for name in DataSet(folder / f"{NAME}.h5").manifest["file"]]
    assert names == [r"a\xff.wav", "good.wav"]
    said("features", f"{NAME}.h5", "-o", f"{NAME}.csv", "--only", "rms", "-j", 1)
    with (folder / f"{NAME}.csv").open("rb") as handle:
        assert list(pd.read_csv(handle)["file"]) == names
    said("features", f"{NAME}.h5", "-o", "t.h5", "--only", "rms", "-j", 1)
    assert "label" in said("audit", "t.h5", "--label", NAME, "-j", 1, code=2)


def test_letters_beyond_ascii_go_into_tables(folder):
    """Written with the encoding of the file, not with that of C."""
    (folder / "good.wav").rename("Größe.wav")
    said("import", "Größe.wav", "--unit", "m/s^2", "-o", "d.h5", "-j", 1)
    said("features", "d.h5", "-o", "t.h5", "--only", "rms", "-j", 1)
    import h5py

    with h5py.File("t.h5") as file:
        assert file["file"][0].decode() == "Größe.wav"


def test_a_folder_is_reported(folder, small_model):
    given = ("--model", small_model, "--unit", "m/s^2", "-o", f"{NAME}.html")
    text = said("report", ".", *given, code=2)
    assert r"a\udcff.wav" in text
    assert "good.wav" in text
    assert "a\ufffd.wav" in (folder / f"{NAME}.html").read_text(encoding="utf-8")
    lines = said("report", ".", *given, "--force", "--json", code=2).splitlines()
    assert [json.loads(line)["name"] for line in lines] == [f"{NAME}.wav", "good.wav"]


@pytest.mark.parametrize(
    "words",
    [
        ("export", "d.h5", "-o", f"{NAME}.parquet"),
        ("simulate", "bilge-pump", "--set", f"duration=0.4 {NAME}"),
        ("import", "good.wav", "-o", "x.h5", "--unit", "m/s^2", "--label", f"place={NAME}"),
    ],
    ids=["library", "option", "label"],
)
def test_what_takes_text_alone_names_it(folder, words):
    if words[0] == "export":
        pytest.importorskip("pyarrow")
        said("import", "good.wav", "--unit", "m/s^2", "-o", "d.h5", "-j", 1)
    text = said(*words, code=2)
    assert r"a\udcff" in text
    assert "is not UTF-8 text" in text
