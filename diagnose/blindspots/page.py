"""Blind spots as a page and a picture."""

import textwrap
from collections.abc import Sequence
from typing import Any

from ..pages.page import render, short_name
from ..pages.picture import PAGE_WIDTH, page_image
from ..pages.words import quantity_name
from .text import Table, conclusion, percent, with_ends

_COLOURS = {"as trained": "#9aa3ab", "fixed": "#b3261e", "drawn": "#1f5a94", "sensor": "#3a923a"}
_WORDS = {
    "fixed": "held fixed by the recipe",
    "drawn": "drawn, beyond its range",
    "sensor": "sensor and converter",
}
_PER_ROW, _MARGIN = 0.32, 1.0  # inches
_MOST = 25  # rows of the picture


def blind_spots_html(table: Table, *, notice: str = "") -> str:
    """Blind spots as one self-contained page: no script, no link, with a picture.

    Parameters
    ----------
    table : dict
        From :func:`~.blindspots.text.blind_spots_table`.
    notice : str
        Notice of the model, if it was trained on simulated data.

    Returns
    -------
    str
        HTML.
    """
    simulated = [row for row in table["rows"] if row["machines"]]
    return render(
        "blindspots.html.j2",
        table=table,
        simulated=[table["baseline"], *simulated],
        failed=[row for row in table["rows"] if not row["machines"]],
        words=_WORDS,
        conclusion=conclusion(table),
        quantity=quantity_name(table["severity"]),
        notice=notice,
        percent=percent,
        with_ends=with_ends,
        picture=page_image(blind_spots_figure(table)) if _shown(table) else "",
    )


def blind_spots_figure(table: Table) -> Any:
    """Error without a caution of the worst rows, compared with that as trained.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    rows = _shown(table)
    height = _MARGIN + _PER_ROW * max(len(rows), 4)
    figure = Figure(figsize=(PAGE_WIDTH, height), layout="constrained")
    axes = figure.add_subplot()
    usual = table["baseline"]["clear_error"]["value"]
    if usual is not None:
        axes.axvline(100 * usual, color=_COLOURS["as trained"], ls="--", label="as trained")
    for kind, word in _WORDS.items():
        _draw(axes, [(i, row) for i, row in enumerate(rows) if row["kind"] == kind], kind, word)
    names = [_in_two_lines(f"{row['name']} {row['shift']}") for row in rows]
    axes.set_yticks(range(len(rows)), names, fontsize=8, linespacing=0.9)
    axes.set_ylim(max(len(rows), 1) - 0.5, -0.5)
    axes.set_xlim(left=0)
    axes.set_xlabel("error without a caution [% of the condemning limit]", fontsize=8)
    axes.grid(axis="x", alpha=0.3)
    if axes.get_legend_handles_labels()[1]:  # none if every verdict has a caution
        axes.legend(fontsize=8, loc="lower right")
    return figure


def _shown(table: Table) -> list[Table]:
    """Rows of the picture: the worst of those that have verdicts without a caution."""
    return [row for row in table["rows"] if row["clear_error"]["value"] is not None][:_MOST]


def _in_two_lines(name: str) -> str:
    return textwrap.fill(short_name(name, 54), 28)


def _draw(axes: Any, rows: Sequence[tuple[int, Table]], kind: str, word: str) -> None:
    if not rows:
        return
    figures = [row["clear_error"] for _, row in rows]
    values = [100 * each["value"] for each in figures]
    ends = [
        # a quantile of the resamples may lie on the wrong side by rounding
        [max(value - 100 * each["low"], 0.0) for value, each in zip(values, figures, strict=True)],
        [max(100 * each["high"] - value, 0.0) for value, each in zip(values, figures, strict=True)],
    ]
    places = [place for place, _ in rows]
    style = {"ls": "none", "marker": "o", "capsize": 3, "ms": 4, "lw": 1}
    axes.errorbar(values, places, xerr=ends, color=_COLOURS[kind], label=word, **style)
