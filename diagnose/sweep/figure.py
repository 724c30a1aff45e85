"""Picture of a sweep."""

import math
from functools import partial
from typing import Any

import numpy as np

from ..pages.page import short_name
from ..pages.picture import PageImage, drawn_alone, plain_numbers
from .sweep import Row, Sweep
from .text import best_rows, setting_words

MOST_PANELS = 8
"""Largest number of quantities, in addition to the panel of smallest changes."""

_MOST_LINES = 6  # quantities in the panel of smallest changes
_COLUMNS = 3


def sweep_figure(sweep: Sweep) -> Any:
    """Quantities along the last axis with scatter between starts, the most sensitive first.

    Parameters
    ----------
    sweep : Sweep

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    rows = sweep.rows()
    names = panel_names(sweep, rows)
    summary = len(sweep.plan.axes) > 1 and any(row.detection.detected for row in rows)
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


def sweep_images(sweep: Sweep) -> list[PageImage]:
    """The panels of :func:`sweep_figure` as pictures of a page."""
    rows = sweep.rows()
    names = panel_names(sweep, rows)
    images = []
    if len(sweep.plan.axes) > 1 and any(row.detection.detected for row in rows):
        images.append(drawn_alone(lambda axes: _draw_changes(axes, sweep, rows)))
    for name in names:
        shown = [row for row in rows if row.shown.name == name]
        images.append(drawn_alone(partial(_draw_with_legend, sweep=sweep, rows=shown)))
    return images


def _draw_with_legend(axes: Any, sweep: Sweep, rows: list[Row]) -> None:
    _draw_quantity(axes, sweep, rows)
    _, labels = axes.get_legend_handles_labels()
    if labels:
        axes.legend(fontsize=8, framealpha=0.6, ncols=1 + (len(labels) > _ONE_COLUMN))


_ONE_COLUMN = 4  # most settings in one column of a legend


def panel_names(sweep: Sweep, rows: list[Row]) -> list[str]:
    """Quantities in order of sensitivity, those of the conclusion first."""
    least: dict[str, float] = {}
    for row in rows:
        change = row.detection.change
        rank = math.inf if math.isnan(change) else change + (0.0 if row.shown.seen else 1e9)
        least[row.shown.name] = min(least.get(row.shown.name, math.inf), rank)
    best = [row.shown.name for row in best_rows(sweep)]
    ranked = [*dict.fromkeys(best), *sorted(least, key=lambda name: least[name])]
    return list(dict.fromkeys(ranked))[:MOST_PANELS]


def _draw_quantity(axes: Any, sweep: Sweep, rows: list[Row]) -> None:
    """Draw one line per setting; bars are one standard deviation between starts."""
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
    mark = "" if shown.seen else " *"
    axes.set_title(short_name(shown.name, 40) + mark, fontsize=10)
    unit = f" [{shown.unit}]" if shown.unit else ""
    axes.set_ylabel(f"{short_name(shown.words, 44)}{unit}".strip(), fontsize=8)
    axes.set_xlabel(f"{axis.words} [{axis.unit or axis.si_unit or '-'}]", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)


def _draw_changes(axes: Any, sweep: Sweep, rows: list[Row]) -> None:
    """Draw the smallest detectable change over the settings."""
    settings, axis = sweep.settings, sweep.plan.axes[-1]
    single = len(sweep.plan.axes) == 2
    places = list(sweep.plan.axes[0].numbers) if single else list(range(len(settings)))
    judged = [row for row in rows if row.shown.seen] or rows
    names = [n for n in panel_names(sweep, judged) if any(r.shown.name == n for r in judged)]
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
        axes.set_xticks(places, words, rotation=30, ha="right", fontsize=8)
    axes.set_title("smallest change that shows in one recording", fontsize=10)
    axes.set_ylabel(f"{axis.words} [{axis.unit or axis.si_unit or '-'}]", fontsize=8)
    axes.set_yscale("log")
    plain_numbers(axes.yaxis)
    axes.legend(fontsize=8, framealpha=0.6)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.3)
