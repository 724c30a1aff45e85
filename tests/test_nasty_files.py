"""Files made to be stumbled over: each ends in words that name what is wrong, in time."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import fuzz_commands
import nasty_files as nasty


@pytest.fixture(scope="module", autouse=True)
def warm():
    fuzz_commands.warm_up()


@pytest.mark.parametrize("name", nasty.FILES)
def test_it_is_read_or_refused_by_name(name, tmp_path):
    if name.startswith("TDMS"):
        pytest.importorskip("nptdms")
    item = nasty.FILES[name]
    code, said = nasty.attempt(item, tmp_path)
    assert fuzz_commands.fault_of(code, said) == ""
    assert code == item.code, said
    assert re.search(item.says, said, re.DOTALL), said


def test_there_are_sixty_of_them():
    assert len(nasty.FILES) >= 60
