"""Page of a sweep, and its output formats."""

import math
from pathlib import Path

from ..pages.page import render, save_page
from ..pages.picture import save_picture
from ..pages.plain_json import json_text
from ..pages.points import point_block
from ..pages.si_text import si_text
from .figure import MOST_PANELS, sweep_figure, sweep_images
from .points import sweep_points
from .sweep import Row, Sweep
from .text import (
    basis,
    best_rows,
    change_words,
    conclusion,
    fault_lines,
    save_csv,
    setting_words,
    slope_words,
    sweep_table,
)

_CELL_BYTES = 120  # of the table


def sweep_html(sweep: Sweep, *, interactive: bool = False) -> str:
    """A self-contained page: conclusion, picture, table.

    Parameters
    ----------
    sweep : Sweep
    interactive : bool
        Make the curves interactive, with points that show their settings.

    Returns
    -------
    str
    """
    axis, rows = sweep.plan.axes[-1], sweep.rows()
    best = {(row.setting, row.shown.name) for row in best_rows(sweep) if row.detection.detected}
    panels = min(len(sweep.plan.shown), MOST_PANELS)
    images = sweep_images(sweep)
    block = None
    if interactive:
        taken = _CELL_BYTES * sum(len(row.means) for row in rows)
        taken += sum(len(image.address) for image in images)
        block = point_block(sweep_points(sweep), taken=taken)
    return render(
        "sweep.html.j2",
        name=sweep.plan.name,
        axis=axis,
        conclusion=conclusion(sweep),
        basis=basis(sweep),
        faults=fault_lines(sweep),
        finished=sweep.finished,
        done=len(sweep.outcomes),
        planned=len(sweep.plan.runs),
        heads=[axis.text(number, 4) for number in axis.numbers],
        panels=panels,
        hidden=len(sweep.plan.shown) - panels,
        several=len(sweep.plan.axes) > 1,
        images=images,
        block=block,
        rows=[
            {
                "label": row.shown.label,
                "seen": row.shown.seen,
                "setting": setting_words(sweep, row.setting),
                "cells": [_cell(row, i) for i in range(len(row.means))],
                "slope": slope_words(sweep, row),
                "change": change_words(sweep, row),
                "best": (row.setting, row.shown.name) in best,
            }
            for row in rows
        ],
    )


def _cell(row: Row, i: int) -> str:
    if not row.counts[i]:
        return "–"
    mean = si_text(row.means[i], row.shown.unit)
    scatter = row.scatters[i]
    return mean if math.isnan(scatter) else f"{mean} ± {si_text(scatter, row.shown.unit, 2)}"


def save_sweep(sweep: Sweep, path: Path, *, force: bool = True, interactive: bool = False) -> None:
    """Write a sweep in the format of the suffix, atomically.

    Parameters
    ----------
    sweep : Sweep
    path : Path
        ``.html``, ``.htm``, ``.json``, ``.csv``, ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.
    interactive : bool
        As in :func:`sweep_html`; ignored by other formats.

    Raises
    ------
    DataError
        Bokeh is not installed for an interactive page.
    """
    if path.suffix == ".csv":
        save_csv(sweep, path, force=force)
    elif path.suffix == ".json":
        save_page(json_text(sweep_table(sweep), indent=1), path, force=force)
    elif path.suffix in (".html", ".htm"):
        save_page(sweep_html(sweep, interactive=interactive), path, force=force)
    else:
        save_picture(sweep_figure(sweep), path, force=force)
