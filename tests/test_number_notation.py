"""Columns of numbers in a notation that is not read are named, not left out like words."""

import numpy as np
import pytest
from wearstate.datasets.readers.open import list_sources, open_source
from wearstate.datasets.source.number_notation import unknown_notation
from wearstate.datasets.source.part import SourceOptions
from wearstate.sim.output.recording import DataError

OTHERS = [
    ("1+2j", "a complex number", "two columns"),
    ("(1.5e-3-2i)", "a complex number", "two columns"),
    ("1,234.5", "thousands are separated", "without the separators"),
    ("-12 345 678", "thousands are separated", "without the separators"),
    ("1.234.567,5", "thousands are separated", "without the separators"),
    ("1.5D+03", "Fortran's exponent", "write e in place of d"),
]
WORDS = ["pump 3", "2024-05-01", "01.02.2024", "12:00:00", "1.2.3", "3/4", "12a", "", "1,23,456"]


@pytest.mark.parametrize(("cell", "kind", "cure"), OTHERS)
def test_a_number_that_is_not_read_is_named_with_its_cure(tmp_path, cell, kind, cure):
    path = tmp_path / "x.csv"
    rows = [f"{i / 10};{cell};{i % 7}.25" for i in range(30)]
    path.write_text("\n".join(["time [s];force [N];acc [g]", *rows]) + "\n", encoding="latin-1")
    with pytest.raises(DataError) as caught:
        open_source(path)
    told = str(caught.value)
    assert told.startswith(f"{path}: column 'force' holds {cell!r}, ")
    assert kind in told
    assert cure in told
    for channels in (["force"], ["load=force"]):
        with pytest.raises(DataError, match="column 'force' holds"):
            open_source(path, SourceOptions(channels=channels))


def test_channels_are_read_beside_it_and_files_are_listed(tmp_path):
    path = tmp_path / "x.csv"
    rows = [f"{i / 10};1+2j;{i % 7}.25" for i in range(30)]
    path.write_text("\n".join(["time [s];z;acc [g]", *rows]) + "\n")
    with open_source(path, SourceOptions(channels=["acc"])) as source:
        assert np.array_equal(source.read(0, 2), 9.80665 * np.array([[0.25, 1.25]]))
    [listed] = list_sources(path)
    assert [channel.name for channel in listed.channels] == ["acc"]
    listed.close()


@pytest.mark.parametrize("cell", WORDS)
def test_words_and_dates_are_no_numbers(cell):
    assert unknown_notation([cell]) is None
    assert unknown_notation(["1+2j", cell]) is None


def test_plain_cells_beside_one_of_another_notation():
    told = unknown_notation(["999.5", " 1,234.5 "])
    assert told is not None
    assert told[0] == "1,234.5"
    assert unknown_notation(["999.5", "7"]) is None
