"""Damaged files given to the commands: a sample of the campaign of ``fuzz_commands``."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_commands as fuzz

FILES = 2  # of each kind; a few seconds in all


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    fuzz.warm_up()
    return fuzz.kinds_of(tmp_path_factory.mktemp("kinds"))


def test_every_damaged_file_ends_in_words(kinds):
    assert not fuzz.campaign(kinds, FILES * len(kinds), seed=1, say=str)


def test_whole_files_are_read(kinds, tmp_path):
    """A campaign of files that were never good would show nothing."""
    for name, seeds in kinds.items():
        assert fuzz.attempt(seeds[0], seeds[0].content, 0, tmp_path) == (0, ""), name


def test_what_a_fault_is():
    assert fuzz.fault_of(None, "") == "longer than 20 s"
    assert fuzz.fault_of(-11, "") == "signal 11"
    assert fuzz.fault_of(2, "") == "not a word"
    assert "ValueError: x" in fuzz.fault_of(1, "Traceback (most recent call last)\nValueError: x\n")
    assert fuzz.fault_of(2, "Error: x is cut short; take an intact copy") == ""


def test_a_crash_and_a_hang_are_seen(tmp_path, monkeypatch):
    log = tmp_path / "log"
    monkeypatch.setattr(fuzz, "LONGEST", 0.5)
    for code, end in (("os.kill(os.getpid(), 9)", -9), ("time.sleep(60)", None)):
        monkeypatch.setattr(
            "wearstate.diagnose.command_line.cli.main",
            lambda words, code=code: exec(f"import os, time; {code}"),
        )
        assert fuzz.run_forked([], log)[0] == end
