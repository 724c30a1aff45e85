"""Theory pages: every name they quote exists, every quoted check stands in `wearstate verify`."""

import importlib
import math
import re
from functools import lru_cache
from pathlib import Path

import pytest
import wearstate
from wearstate.diagnose.literature.verify import run_checks

PAGES = sorted(page for page in Path("docs/theory").glob("*.md") if page.stem != "README")
FLOORS = ("sim", "features", "datasets", "diagnose")

_NAME = re.compile(rf"`((?:{'|'.join(FLOORS)})(?:\.\w+)+)`")
_ROW = re.compile(r"^\| `(?P<name>[^`]+)` \| (?P<expected>\S+) \| (?P<obtained>\S+) \|$")
_HEADER = "| check | expected | obtained |"


@lru_cache(maxsize=1)
def _verified() -> dict[str, tuple[float, float]]:
    return {result.name: (result.expected, result.obtained) for result in run_checks()}


def _exists(dotted: str) -> bool:
    """Whether the longest module in a dotted name has the rest as attributes."""
    parts = dotted.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join([wearstate.__name__, *parts[:end]]))
        except ModuleNotFoundError:
            continue
        for name in parts[end:]:
            found = getattr(found, name, None)
        return found is not None
    return False


def _quoted_rows(text: str) -> list[re.Match[str]]:
    """Rows of the tables under the header, all of which must be readable."""
    lines = iter(text.splitlines())
    rows = []
    for line in lines:
        if line == _HEADER:
            next(lines)
            for row in lines:
                if not row.startswith("|"):
                    break
                match = _ROW.match(row)
                assert match is not None, f"not a row of name, expected, obtained: {row}"
                rows.append(match)
    return rows


def test_there_are_pages():
    assert len(PAGES) >= 5


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_exist(page):
    names = set(_NAME.findall(page.read_text(encoding="utf-8")))
    assert names, "a theory page names the code that it describes"
    assert sorted(name for name in names if not _exists(name)) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_quoted_checks_are_those_of_verify(page):
    for row in _quoted_rows(page.read_text(encoding="utf-8")):
        expected, obtained = _verified()[row["name"]]
        assert float(row["expected"]) == expected, row["name"]
        # printed with fewer digits, and rounding differs from one processor to another
        assert math.isclose(float(row["obtained"]), obtained, rel_tol=1e-4), row["name"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pages_are_short_and_say_what_they_leave_out(page):
    text = page.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    assert "## What it leaves out" in text
    links = re.findall(r"\]\(([^)#]+?\.md)\)", text)
    assert [link for link in links if not (page.parent / link).exists()] == []
