"""The whole workflow on a small simulated example: from a recipe to a report."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.record import DataSet
from ...datasets.generation.generate import generate
from ...sim.output.recording import DataError
from ..evaluation.evaluate import score
from ..feature_rows.feature_table import Progress
from ..pages.page import save_page
from ..report.page import report_html
from ..report.text import report_text
from ..report.verdict import report_table
from ..wear_model.file import load_model, save_model
from ..wear_model.train import train_model

RECIPE = "bilge-pump-small"
MARKER = ".wearstate-demo"
"""File that marks a demo's folder, whose files may be replaced."""

FILES = {"data": "data.h5", "model": "model.wsm", "report": "report.html"}


def run_demo(
    folder: Path,
    *,
    seed: int,
    jobs: int,
    progress: Progress | None,
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Generate, train, evaluate, report; opens nothing.

    Parameters
    ----------
    folder : Path
        Folder, created if needed; must be empty or an earlier demo's, whose three files are
        replaced.
    seed : int
        Seed of the data set and of the split.
    jobs : int
        Worker processes.
    progress : callable, optional
        Called with (records done, records).
    say : callable
        Called with one line before each stage.

    Returns
    -------
    dict
        ``files``, ``held_out`` (as :func:`wearstate.diagnose.evaluation.evaluate.score`),
        ``report``, ``text``, ``card``, ``seconds`` per stage.

    Raises
    ------
    DataError
        If the folder cannot be made or written, or holds other files.
    """
    _claim(folder)
    files = {key: folder / name for key, name in FILES.items()}
    clock = _Clock()
    say(f"1/3 simulating recordings of recipe {RECIPE} …")
    generate(RECIPE, None, files["data"], seed=seed, jobs=jobs, force=True, progress=progress)
    clock.lap("generate")
    say("2/3 features, training, judging on unseen machine draws …")
    model, table, test = train_model(files["data"], seed=seed, jobs=jobs, progress=progress)
    save_model(model, files["model"], force=True)
    held_out = score(model, table, test)
    clock.lap("train")
    say("3/3 report on a recording of an unseen machine draw …")
    result = _report_on_unseen(files, table.manifest["record_id"].iloc[test].tolist())
    clock.lap("report")
    return {
        "files": {key: str(path) for key, path in files.items()},
        "held_out": held_out,
        "card": model.card,
        "seconds": clock.laps,
        **result,
    }


def _claim(folder: Path) -> None:
    """Mark the folder as a demo's, unless it holds other files."""
    marker = folder / MARKER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not marker.is_file() and any(folder.iterdir()):
            raise DataError(
                f"{folder} holds files and is not an earlier demo's, must be new or empty; choose "
                "another folder"
            )
        marker.touch()
    except OSError as error:
        raise DataError(f"{folder} cannot be made ({error}); choose another") from error


def _report_on_unseen(files: dict[str, Path], unseen: list[str]) -> dict[str, Any]:
    """Report on one of the unseen recordings."""
    model = load_model(files["model"])
    with DataSet(files["data"]) as data:
        manifest = data.manifest
        severity = manifest[model.card.severity].to_numpy()
        rows = np.flatnonzero(manifest["record_id"].isin(unseen).to_numpy())
        number = _most_worn(rows, severity, model.card.condemning_limit_m)
        recording = data[number]
    table = report_table(recording, model, model.estimate(recording))
    save_page(report_html(table, recording, model), files["report"])
    text = (
        f"{report_text(table)}\n"
        f"Truth       {1e3 * severity[number]:.3f} mm (known, because it is simulated)\n"
        f"Page        {files['report']}"
    )
    return {"report": table, "text": text}


def _most_worn(rows: NDArray[np.intp], severity: NDArray[np.float64], limit: float) -> int:
    """The most worn record that is not yet condemned; if all are, the least worn."""
    good = rows[severity[rows] < limit]
    if good.size:
        return int(good[np.argmax(severity[good])])
    return int(rows[np.argmin(severity[rows])])


class _Clock:
    """Duration of each stage [s]."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = round(now - self._last, 2)
        self._last = now
