"""The report as one self-contained page, pictures inside; without a script unless interactive."""

import re
import textwrap
from collections.abc import Sequence
from typing import Any

from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_choice import feature_words
from ..healthy_reference.healthy import Baseline, Baselines
from ..learning.grades import GRADE_COLOURS, NO_GRADE_COLOUR
from ..nameplate.nameplate import Nameplate
from ..nameplate.sensors import corrected_recording
from ..pages.embed import require_bokeh
from ..pages.page import render
from ..pages.points import PointBlock, point_block
from ..pictures.view import View
from ..pictures.zoom import ZoomBlock, zoom_block
from ..pictures.zoom_curves import zoom_curves
from ..wear_model.estimate import WearModel
from ..wear_model.verdict import Estimate
from .advice import brief_words
from .batch import Batch, BatchRow, informed_estimate, machine_heading
from .figures import (
    ReportPicture,
    gauge,
    report_pictures,
    trend_picture,
)
from .points import trend_points
from .verdict import finding_words, millimetres, report_table, zone_words

_MOST_ROWS = 1000  # of the table of a batch: the page is for reading
_MOST_DETAILS = 3  # recordings of a batch with pictures
_MOST_TRENDS = 6
_MOST_LETTERS = 160  # of a note in a table
_FULL_SCALE = 1.5  # of a bar, in condemning limits; the style sheet places the limit accordingly


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
        From :func:`wearstate.diagnose.report.verdict.report_table`.
    recording : Recording
        Its signals are drawn.
    model : WearModel, optional
        For the map of changes from its healthy reference.
    baseline : Baseline, optional
        Healthy recordings used for the estimate.
    plate : Nameplate, optional
        Its sensor offsets and gains are removed from the signals, as for the estimate.
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
    judged = corrected_recording(recording, plate, baseline)
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
    """Interactive curves of a recording; None if none can be computed."""
    require_bokeh()
    view = View(recording=recording)
    try:
        curves, _ = zoom_curves(view)
    except DataError:
        return None  # the verdict names the fault of the recording
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
        As in :func:`wearstate.diagnose.report.verdict.report_table`.
    baselines : Baselines, optional
        Healthy recordings used for the estimates.
    plate : Nameplate, optional
        As in :func:`wearstate.diagnose.report.verdict.report_table`.
    interactive : bool
        Make the trends interactive, with points that show their recordings.

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
    grades = [row.estimate.grade for row in batch.current if row.estimate.grade is not None]
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
        other_trends=[_trend_line(batch, name) for name in order[_MOST_TRENDS:]],
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
    """Interactive trends, in addition to their pictures."""
    taken = sum(len(picture.image.address) for picture in pictures) + _ROW_BYTES * len(batch.rows)
    return point_block(
        [trend_points(batch, name, machine_heading(name)) for name in machines], taken=taken
    )


_ROW_BYTES = 1_000  # of one recording in the table


def _machines(batch: Batch) -> list[str]:
    """Machines with a trend, the shortest remaining life first."""

    def life(name: str) -> float:
        outlook = batch.trends[name].outlook
        early = None if outlook is None else outlook.remaining_low_h
        return float("inf") if early is None else early

    return sorted(batch.trends, key=life)


def _trend_line(batch: Batch, name: str) -> str:
    trend = batch.trends[name]
    said = trend.outlook.text if trend.outlook else trend.reason
    return f"{machine_heading(name)}: {said}"


def _bar(row: BatchRow, limit: float) -> str:
    """Interval and estimate on a line, as HTML elements: a picture per row would be too large."""
    low, value, high = (
        100 * min(max((length or 0.0) / (_FULL_SCALE * limit), 0.0), 1.0)
        for length in (row.estimate.low, row.estimate.severity, row.estimate.high)
    )
    said = f"{100 * (row.estimate.severity or 0.0) / limit:.0f} % of the limit"
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
    """Tables and pictures of the most urgent graded recordings, read again."""
    found = []
    for row in [row for row in batch.current if row.estimate.grade is not None][:_MOST_DETAILS]:
        try:
            recording = batch.items[row.number].load()
            baseline = None if baselines is None else baselines.of(recording)
            estimate = informed_estimate(recording, model, baseline, plate)
        except DataError:
            continue  # removed in the meantime
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
        judged = corrected_recording(recording, plate, baseline)
        pictures = _few_pictures(table, judged, model, estimate, baseline)
        found.append({"table": table, "pictures": pictures})
    return found


def _few_pictures(
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
    """A clause as a sentence; a channel, feature or file name at its start keeps its case."""
    plain = re.match(r"[a-z]+(?=[ ,:;])", text) is not None
    first = text[:1].upper() if plain else text[:1]
    return first + text[1:] + ("" if text.endswith((".", "?", "!")) else ".")
