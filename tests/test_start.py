"""The script of the start page: it runs, and its numbers are what it says."""

import io
from contextlib import redirect_stdout
from pathlib import Path

import pytest
import wearstate

SCRIPT = Path(wearstate.__file__).parent / "docs" / "start.py"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Folder, names and text of one run."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("start")
        patch.chdir(folder)
        patch.setenv("MPLBACKEND", "agg")
        names = {"__name__": "start"}
        with redirect_stdout(io.StringIO()) as text:
            exec(compile(SCRIPT.read_text(encoding="utf-8"), str(SCRIPT), "exec"), names)
    return folder, names, text.getvalue()


def test_it_fits_on_a_screen():
    code = [line for line in SCRIPT.read_text(encoding="utf-8").splitlines() if line.strip()]
    assert len(code) <= 36  # thirty statements and the comments between them


def test_it_comes_to_a_verdict(run):
    folder, names, text = run
    estimate = names["report"].estimate
    # the truth is 0.25 mm; the interval holds with 88 %, this one does
    assert estimate.low < 0.25e-3 < estimate.high
    assert "Verdict     Grade 2 of 3: plan renewal" in text
    assert (folder / "report.html").stat().st_size > 50_000


def test_features_in_a_pipeline_beat_a_guess(run):
    _, names, _ = run
    guess = abs(names["clearance"] - names["clearance"].mean()).mean()
    # whole machines held out; a constant guess errs by the mean deviation
    assert -names["search"].best_score_ < 0.7 * guess


def test_it_plots(run):
    folder, _, _ = run
    assert (folder / "recording.png").read_bytes().startswith(b"\x89PNG")
