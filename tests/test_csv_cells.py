"""Text cells that a spreadsheet would run as formulas."""

import pandas as pd
import pytest
from wearstate.datasets.file.csv_cells import plain_cell, safe_cell, safe_frame, save_rows
from wearstate.datasets.readers.text_dialect import split_cells


@pytest.mark.parametrize("first", list("=+-@\t\r\n"))
def test_formulas_are_escaped_and_come_back(first):
    text = f"{first}cmd|' /C calc'!A0"
    assert safe_cell(text) == f"'{text}"
    assert plain_cell(safe_cell(text)) == text


@pytest.mark.parametrize("value", ["-0.5", "+3e4", -0.5, 3, None, "", "a=b", "'quoted'"])
def test_numbers_and_other_texts_stay(value):
    assert safe_cell(value) is value


def test_names_and_texts_of_a_table_are_escaped_and_numbers_are_not():
    frame = pd.DataFrame({"=a": ["-x", "y"], "b": [-1.5, 2.0]})
    assert safe_frame(frame).to_csv(index=False) == "'=a,b\n'-x,-1.5\ny,2.0\n"
    assert list(frame.columns) == ["=a", "b"]


def test_thirty_thousand_quoted_names_are_split_at_once():
    cells = split_cells(",".join(f'"n, {i}"' for i in range(30_000)), ",")  # took a minute
    assert len(cells) == 30_000
    assert cells[-1] == "n, 29999"


def test_rows_are_written_with_safe_cells_or_not_at_all(tmp_path):
    path = tmp_path / "rows.csv"
    save_rows(path, ["a", "b"], [["=1+2", -0.5]])
    assert path.read_text(encoding="utf-8").splitlines() == ["a,b", "'=1+2,-0.5"]
    with pytest.raises(TypeError):
        save_rows(path, ["a"], [["x"], None])
    assert path.read_text(encoding="utf-8").splitlines()[0] == "a,b"
    assert list(tmp_path.iterdir()) == [path]
