"""Page of a chart, and its output formats."""

import itertools
import math
from collections.abc import Callable
from pathlib import Path

from ..pages.page import render, save_page
from ..pages.picture import save_picture
from ..pages.plain_json import json_text
from ..pages.points import point_block
from .chart import (
    RECOMMENDED,
    Chart,
    Choice,
    Point,
    RungCost,
    chart_table,
    convergence_text,
    save_chart_rows,
)
from .figure import (
    FLOOR,
    PALE,
    ShadedCell,
    chart_figure,
    chart_svg,
    choice_of,
    floor_of,
    has_band,
    question_images,
    shaded_rows,
)
from .points import chart_points
from .words import percent, with_scatter

_ROW_BYTES = 3_000  # per point in the tables of a page


def chart_html(chart: Chart, *, interactive: bool = False) -> str:
    """A self-contained page: verdict, picture with named points, tables.

    Parameters
    ----------
    chart : Chart
    interactive : bool
        Let the reader zoom in and tap points for their settings.

    Returns
    -------
    str
    """
    images = question_images(chart)
    block = None
    if interactive:
        taken = sum(len(image.svg) for image in images) + _ROW_BYTES * len(chart.points)
        block = point_block(chart_points(chart), taken=taken)
    return render(
        "chart.html.j2",
        chart=chart,
        pictures_shown=[
            (image, [point.name for point in chart.numbered(question)])
            for image, question in zip(images, chart.shown or ("",), strict=True)
        ],
        shaded=_shaded(chart),
        block=block,
        tapped="its settings as TOML" if any(p.block for p in chart.points) else "its figures",
        tables=[(chart.heading(question), _rows(chart, question)) for question in chart.shown],
        convergence=[convergence_text(each, chart.labels) for each in chart.convergence],
        cards=_cards(chart),
        recommended=RECOMMENDED,
        lines=_lines(chart),
        reference_error=percent(chart.remaining) if chart.remaining > 0 else "",
        floored=floor_of(chart) > FLOOR,
        pale=PALE,
        band=has_band(chart),
        unbroken=_unbroken,
        error_of=_error_of,
        finite=math.isfinite,
        percent=percent,
    )


def _lines(chart: Chart) -> list[tuple[str, bool]]:
    """Lines of the conclusion; True for the finding on the subject and for advice."""
    lines = chart.conclusion or (chart.verdict,)
    advice = [c.sentence for c in chart.shown_choices if c.enough and c.status in RECOMMENDED]
    first = {lines[0], *[line for line in advice if line.startswith("We recommend")]}
    places = {
        choice.sentence: f" The choice is point {number} in the picture."
        for choice in chart.shown_choices
        if choice.sentence in first and (number := chart.number(choice))
    }
    return [(_unbroken(line + places.get(line, "")), line in first) for line in lines]


def _error_of(each: Point | Choice | RungCost) -> str:
    """Error with its scatter, if known."""
    return _unbroken(with_scatter(each.error, each.standard_error, each.starts))


def _unbroken(text: str) -> str:
    """Text with non-breaking spaces between numbers and signs."""
    return text.replace(" %", "\u00a0%").replace(" ± ", "\u00a0±\u00a0")


def _shaded(chart: Chart) -> tuple[list[str], list[tuple[str, list[ShadedCell]]]]:
    """Errors by quantity; for a scene, which has many quantities, one row per quantity."""
    names, rows = shaded_rows(chart)
    if not chart.choices or not rows:
        return names, rows
    columns = zip(*(cells for _, cells in rows), strict=True)
    return [label for label, _ in rows], [
        (name, list(cells)) for name, cells in zip(names, columns, strict=True)
    ]


def _cards(chart: Chart) -> list[tuple[Choice, str, bool, bool]]:
    """Choices with heading, whether the previous one has the same settings, and full width.

    Two settings are shown side by side, a single one across the page.
    """
    shown = chart.shown_choices
    again = [
        bool(one.block) and dict(one.changes) == dict(before.changes)
        for before, one in itertools.pairwise(shown)
    ]
    repeated = [False, *again][: len(shown)]
    settings = [bool(c.block) and not r for c, r in zip(shown, repeated, strict=True)]
    alone = sum(settings) == 1
    return [
        (choice, _unbroken(_head(chart, choice)), same, alone or not has)
        for choice, same, has in zip(shown, repeated, settings, strict=True)
    ]


def _head(chart: Chart, choice: Choice) -> str:
    """Heading with the advice on a question."""
    if not choice.enough:
        return f"No numerical setting reaches {percent(chart.accuracy or 0.0)} with your rungs"
    name = choice.words or choice.name
    if choice.status not in RECOMMENDED:
        text = "no recommendation" + (" yet" if choice.status == "no answer yet" else "")
    elif choice.keeps:
        text = "nothing to change"
    elif choice.optional:
        text = f"nothing must change; {name} is sufficient too"
    else:
        text = f"take {name}"
    text = f"{text}; {chart.alike}" if chart.alike else f"{choice.question}: {text}"
    return text[0].upper() + text[1:]


def _rows(chart: Chart, question: str) -> list[tuple[int | str, Point, str]]:
    """Number in the picture, point, and style: taken, and coarse if that is not enough."""
    numbers: dict[int, int] = {id(p): i for i, p in enumerate(chart.numbered(question), start=1)}
    choice = choice_of(chart, question)
    wanted = choice.name if choice else None
    look = "" if choice is None else "taken" if choice.enough else "taken coarse"
    return [(numbers.get(id(p), ""), p, look * (p.name == wanted)) for p in chart.of(question)]


def save_chart(chart: Chart, path: Path, *, force: bool = True, interactive: bool = False) -> None:
    """Write a chart in the format of the suffix, atomically.

    Parameters
    ----------
    chart : Chart
    path : Path
        ``.html``, ``.json``, ``.csv``, ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.
    interactive : bool
        As in :func:`chart_html`; ignored by other formats.

    Raises
    ------
    KeyError
        The suffix is none of these.
    DataError
        Bokeh is not installed for an interactive page.
    """
    if path.suffix == ".html":
        save_page(chart_html(chart, interactive=interactive), path, force=force)
    elif path.suffix == ".csv":
        save_chart_rows(chart, path, force=force)
    elif path.suffix in (".png", ".pdf"):
        save_picture(chart_figure(chart), path, force=force)
    else:
        save_page(_PAGES[path.suffix](chart), path, force=force)


def _json(chart: Chart) -> str:
    return json_text(chart_table(chart), indent=1)


_PAGES: dict[str, Callable[[Chart], str]] = {
    ".svg": chart_svg,
    ".json": _json,
}
