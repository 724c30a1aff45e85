"""The report as one self-contained page, pictures inside; without a script unless interactive."""

import re
import textwrap
from collections.abc import Sequence
from typing import Any

from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_choice import feature_words
from ..healthy_reference.healthy import Baseline, Baselines
from ..learning.grades import GRADE_COLOURS, NO_GRADE_COLOUR
from ..nameplate.cautions import known_beside
from ..nameplate.nameplate import Nameplate
from ..nameplate.sensors import as_told
from ..pages.embed import require_bokeh
from ..pages.page import render
from ..pages.points import PointBlock, point_block
from ..pictures.view import View
from ..pictures.zoom import ZoomBlock, zoom_block
from ..pictures.zoom_curves import zoom_curves
from ..wear_model.estimate import WearModel
from ..wear_model.verdict import Estimate
from .advice import brief_words
from .batch import Batch, BatchRow, machine_heading
from .figures import (
    ReportPicture,
    gauge,
    report_pictures,
    trend_picture,
)
from .points import trend_points
from .verdict import finding_words, millimetres, report_table, zone_words

_MOST_ROWS = 1000  # of the table of a batch: a page for reading
_MOST_DETAILS = 3  # recordings of a batch with pictures
_MOST_TRENDS = 6
_MOST_LETTERS = 160  # of a note in a table
_FULL_SCALE = 1.5  # of a bar, in condemning limits; the limit's place in the style follows from it


def report_html(
    table: dict[str, Any],
    recording: Recording,
    model: WearModel | None = None,
    *,
    baseline: Baseline | None = None,
    plate: Nameplate | None = None,
    interactive: bool = False,
) -> str:
    """The report on one recording.

    Parameters
    ----------
    table : dict
        Of :func:`wearstate.diagnose.report.verdict.report_table`.
    recording : Recording
        Its signals are drawn.
    model : WearModel, optional
        For the map of what moved against its healthy reference.
    baseline : Baseline, optional
        That the estimate was given.
    plate : Nameplate, optional
        What it tells of sensors is taken out of the signals, as it was for the estimate.
    interactive : bool
        Add the signals as curves to zoom and measure in.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    DataError
        Bokeh is not installed for an interactive page.
    """
    estimate = table["estimate"]
    graded = estimate["severity"] is not None
    judged = as_told(recording, plate, baseline)
    pictures = report_pictures(
        judged,
        model,
        graded=graded,
        healthy=None if baseline is None else baseline.features,
        evidence=[item["feature"] for item in table["evidence"]],
    )
    return _rendered(
        "report.html.j2",
        table=table,
        gauge=gauge(estimate, table["limits"]) if graded else None,
        pictures=pictures,
        block=_zoom_of(judged, pictures) if interactive else None,
        reference="the machine's healthy recordings"
        if baseline is not None
        else "those of as-new machines in the training set",
        simulated=" (simulated recording)" if recording.origin == "simulated" else "",
    )


def _zoom_of(recording: Recording, pictures: Sequence[ReportPicture]) -> ZoomBlock | None:
    """Curves of a recording beside its pictures; None where none can be computed."""
    require_bokeh()
    view = View(recording=recording)
    try:
        curves, _ = zoom_curves(view)
    except DataError:
        return None  # the verdict says what is wrong with the recording
    taken = sum(len(picture.image.address) for picture in pictures)
    return zoom_block(curves, speed=view.speed, taken=taken)


def batch_html(
    batch: Batch,
    model: WearModel,
    *,
    machine: str | None = None,
    baselines: Baselines | None = None,
    plate: Nameplate | None = None,
    interactive: bool = False,
) -> str:
    """The report on many recordings: counts, trends, a table, and the most urgent in full.

    Parameters
    ----------
    batch : Batch
        Its items can still be read.
    model : WearModel
    machine : str, optional
        As of :func:`wearstate.diagnose.report.verdict.report_table`.
    baselines : Baselines, optional
        That the estimates were given.
    plate : Nameplate, optional
        Of the machines, as of :func:`wearstate.diagnose.report.verdict.report_table`.
    interactive : bool
        Trends to zoom in, whose points tell their recordings.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    DataError
        Bokeh is not installed for an interactive page.
    """
    order = _machines(batch)
    shown = order[:_MOST_TRENDS]
    trends = [
        trend_picture(batch.trends[name], batch.limits, machine_heading(name)) for name in shown
    ]
    details = _details(batch, model, machine, baselines, plate)
    grades = [row.grade for row in batch.current if row.grade is not None]
    outlooks = [trend.outlook for trend in batch.trends.values() if trend.outlook]
    return _rendered(
        "report_batch.html.j2",
        batch=batch,
        rows=batch.rows[:_MOST_ROWS],
        hidden=max(len(batch.rows) - _MOST_ROWS, 0),
        worst=max(grades, default=None),
        trends=trends,
        block=_zoom_of_trends(batch, shown, [*trends, *_pictures(details)])
        if interactive and shown
        else None,
        untold=[_told(batch, name) for name in order[_MOST_TRENDS:]],
        assumptions=sorted({outlook.assumption for outlook in outlooks}),
        details=details,
        brief=brief_words,
        bar=lambda row: _bar(row, batch.limits["condemning_limit_m"]),
        short=lambda text: textwrap.shorten(text, _MOST_LETTERS, placeholder=" …"),
    )


def _pictures(details: Sequence[dict[str, Any]]) -> list[ReportPicture]:
    return [picture for each in details for picture in each["pictures"]]


def _zoom_of_trends(
    batch: Batch, machines: Sequence[str], pictures: Sequence[ReportPicture]
) -> PointBlock:
    """Trends beside their pictures."""
    taken = sum(len(picture.image.address) for picture in pictures) + _ROW_BYTES * len(batch.rows)
    return point_block(
        [trend_points(batch, name, machine_heading(name)) for name in machines], taken=taken
    )


_ROW_BYTES = 1_000  # of a recording in the table


def _machines(batch: Batch) -> list[str]:
    """Machines with a trend, the shortest life first."""

    def life(name: str) -> float:
        outlook = batch.trends[name].outlook
        early = None if outlook is None else outlook.remaining_low_h
        return float("inf") if early is None else early

    return sorted(batch.trends, key=life)


def _told(batch: Batch, name: str) -> str:
    trend = batch.trends[name]
    said = trend.outlook.text if trend.outlook else trend.reason
    return f"{machine_heading(name)}: {said}"


def _bar(row: BatchRow, limit: float) -> str:
    """The interval and the estimate on a line, as parts of the page: no picture for each row."""
    low, value, high = (
        100 * min(max((length or 0.0) / (_FULL_SCALE * limit), 0.0), 1.0)
        for length in (row.low, row.severity, row.high)
    )
    said = f"{100 * (row.severity or 0.0) / limit:.0f} % of the limit"
    return (
        f'<span class="bar" role="img" aria-label="{said}" title="{said}">'
        f'<i style="left:{low:.1f}%;width:{high - low:.1f}%"></i><u></u>'
        f'<b style="left:{value:.1f}%"></b></span>'
    )


def _details(
    batch: Batch,
    model: WearModel,
    machine: str | None,
    baselines: Baselines | None,
    plate: Nameplate | None,
) -> list[dict[str, Any]]:
    """Tables and pictures of the most urgent graded recordings, read once more."""
    found = []
    for row in [row for row in batch.current if row.grade is not None][:_MOST_DETAILS]:
        try:
            recording = batch.items[row.number].load()
            baseline = None if baselines is None else baselines.of(recording)
            beside = known_beside(plate, recording, model.card, baseline)
            judged = as_told(recording, plate, baseline)
            estimate = model.estimate(judged, baseline, **beside)
        except DataError:
            continue  # it has gone since
        outlook = batch.outlook_of(row)
        table = report_table(
            recording,
            model,
            estimate,
            machine=machine,
            baseline=baseline,
            plate=plate,
            outlook=outlook,
        )
        found.append({"table": table, "pictures": _few(table, judged, model, estimate, baseline)})
    return found


def _few(
    table: dict[str, Any],
    recording: Recording,
    model: WearModel,
    estimate: Estimate,
    baseline: Baseline | None,
) -> list[ReportPicture]:
    graded = estimate.severity is not None
    first = report_pictures(
        recording,
        model,
        graded=graded,
        healthy=None if baseline is None else baseline.features,
        evidence=[item["feature"] for item in table["evidence"]],
        most=1,
    )
    return [gauge(table["estimate"], table["limits"]), *first] if graded else first


def _rendered(name: str, **context: Any) -> str:
    return render(
        name,
        **context,
        colour=_colour,
        millimetres=millimetres,
        finding_words=finding_words,
        zone_words=zone_words,
        words=feature_words,
        sentence=_sentence,
    )


def _colour(grade: int | None) -> str:
    return NO_GRADE_COLOUR if grade is None else GRADE_COLOURS[grade]


def _sentence(text: str) -> str:
    """A clause as a sentence; a name of a channel, feature or file at its start stays as it is."""
    plain = re.match(r"[a-z]+(?=[ ,:;])", text) is not None
    first = text[:1].upper() if plain else text[:1]
    return first + text[1:] + ("" if text.endswith((".", "?", "!")) else ".")
