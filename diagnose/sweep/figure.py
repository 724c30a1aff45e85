"""Picture and page of a sweep."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..pages.page import render, save_page, short_name
from ..pages.picture import encoded, save_picture
from ..pages.plain_json import json_text
from ..pages.si_text import si_text
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

SUFFIXES = (".html", ".htm", ".json", ".csv", ".png", ".svg", ".pdf")
"""Of what a sweep is written as."""

_MOST_PANELS = 8  # and that of the smallest changes
_MOST_LINES = 6  # quantities in the panel of smallest changes
_COLUMNS = 3


def sweep_figure(sweep: Sweep) -> Any:
    """Quantities along the last axis, with the scatter between starts; what tells a change first.

    Parameters
    ----------
    sweep : Sweep

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    rows = sweep.rows()
    names = _panel_names(sweep, rows)
    summary = len(sweep.plan.axes) > 1 and any(row.detection.told for row in rows)
    count = len(names) + summary
    columns = min(_COLUMNS, count)
    high = math.ceil(count / columns)
    figure = Figure(figsize=(4.3 * columns, 3.3 * high + 0.9), layout="constrained")
    figure.suptitle(f"{sweep.plan.name} (simulated)", fontsize=12)
    panels = list(np.ravel(figure.subplots(high, columns, squeeze=False)))
    if summary:
        _draw_changes(panels.pop(0), sweep, rows)
    for name in names:
        _draw_quantity(panels.pop(0), sweep, [row for row in rows if row.shown.name == name])
    for spare in panels:
        spare.set_axis_off()
    lines = [line for axes in figure.axes[summary:] for line in [axes.get_legend_handles_labels()]]
    handles, labels = next((line for line in lines if line[1]), ([], []))
    if labels:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(6, len(labels)))
    return figure


def _panel_names(sweep: Sweep, rows: list[Row]) -> list[str]:
    """Quantities that tell the smallest changes first, those of the conclusion among them."""
    least: dict[str, float] = {}
    for row in rows:
        change = row.detection.change
        rank = math.inf if math.isnan(change) else change + (0.0 if row.shown.seen else 1e9)
        least[row.shown.name] = min(least.get(row.shown.name, math.inf), rank)
    best = [row.shown.name for row in best_rows(sweep)]
    ranked = [*dict.fromkeys(best), *sorted(least, key=lambda name: least[name])]
    return list(dict.fromkeys(ranked))[:_MOST_PANELS]


def _draw_quantity(axes: Any, sweep: Sweep, rows: list[Row]) -> None:
    """One line for every setting; bars are one standard deviation between starts."""
    from matplotlib import colormaps

    axis = sweep.plan.axes[-1]
    colours = colormaps["viridis"](np.linspace(0.0, 0.85, max(len(rows), 2)))
    for row, colour in zip(rows, colours, strict=False):
        label = setting_words(sweep, row.setting) if row.setting else None
        axes.errorbar(
            axis.numbers,
            row.means,
            yerr=np.nan_to_num(np.array(row.scatters)),
            fmt="o-",
            ms=4,
            lw=1.3,
            capsize=3,
            color=colour,
            label=label,
        )
    shown = rows[0].shown
    aside = "" if shown.seen else " *"
    axes.set_title(short_name(shown.name, 40) + aside, fontsize=10)
    unit = f" [{shown.unit}]" if shown.unit else ""
    axes.set_ylabel(f"{short_name(shown.words, 44)}{unit}".strip(), fontsize=8)
    axes.set_xlabel(f"{axis.words} [{axis.unit or axis.si_unit or '-'}]", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)


def _draw_changes(axes: Any, sweep: Sweep, rows: list[Row]) -> None:
    """Smallest change that is told, over the settings."""
    settings, axis = sweep.settings, sweep.plan.axes[-1]
    single = len(sweep.plan.axes) == 2
    places = list(sweep.plan.axes[0].numbers) if single else list(range(len(settings)))
    judged = [row for row in rows if row.shown.seen] or rows
    names = [n for n in _panel_names(sweep, judged) if any(r.shown.name == n for r in judged)]
    for name in names[:_MOST_LINES]:
        own = {row.setting: row.detection.change for row in judged if row.shown.name == name}
        values = np.array([own[setting] for setting in settings]) / abs(axis.scale)
        shown = np.where(np.isfinite(values), values, np.nan)
        axes.plot(places, shown, "o-", ms=5, lw=1.3, label=short_name(name, 24))
    if single:
        first = sweep.plan.axes[0]
        axes.set_xlabel(f"{first.words} [{first.unit or first.si_unit or '-'}]", fontsize=9)
    else:
        words = [setting_words(sweep, setting, short=True) for setting in settings]
        axes.set_xticks(places, words, rotation=30, ha="right", fontsize=7)
    axes.set_title("smallest change that shows in one recording", fontsize=10)
    axes.set_ylabel(f"{axis.words} [{axis.unit or axis.si_unit or '-'}]", fontsize=8)
    axes.set_yscale("log")
    axes.legend(fontsize=7, framealpha=0.6)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)


def sweep_html(sweep: Sweep) -> str:
    """One self-contained page: conclusion, picture, table.

    Parameters
    ----------
    sweep : Sweep

    Returns
    -------
    str
    """
    axis, rows = sweep.plan.axes[-1], sweep.rows()
    best = {(row.setting, row.shown.name) for row in best_rows(sweep) if row.detection.told}
    panels = min(len(sweep.plan.shown), _MOST_PANELS)
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
        picture=encoded(sweep_figure(sweep)),
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


def save_sweep(sweep: Sweep, path: Path, *, force: bool = True) -> None:
    """Write a sweep in the form that the suffix asks for, whole or not at all.

    Parameters
    ----------
    sweep : Sweep
    path : Path
        One of :data:`SUFFIXES`.
    force : bool
        Replace an existing file.
    """
    if path.suffix == ".csv":
        save_csv(sweep, path, force=force)
    elif path.suffix == ".json":
        save_page(json_text(sweep_table(sweep), indent=1), path, force=force)
    elif path.suffix in (".html", ".htm"):
        save_page(sweep_html(sweep), path, force=force)
    else:
        save_picture(sweep_figure(sweep), path, force=force)
