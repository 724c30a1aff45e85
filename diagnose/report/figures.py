"""Pictures of the report: the estimate on the scale of grades, changes, signals, a trend."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_choice import choice_in
from ..feature_rows.feature_table import recording_features
from ..learning.grades import GRADE_COLOURS
from ..pages.page import short_name
from ..pages.picture import PAGE_WIDTH, PageImage, drawn_alone, page_image
from ..pictures.kinds import make_panel
from ..pictures.panel import RIGHT_OF_MAP, Panel, log_frequency, panel_figure, stack
from ..pictures.view import View
from ..wear_model.estimate import WearModel
from .trend import Trend
from .verdict import MAP_CELL

Float = NDArray[np.float64]

_LEAST_SPAN_DB = 6.0  # of the colour scale of a map: smaller changes stay pale
_MOST_MAPS = 2
_NARROW = 0.12  # share of the gauge: a narrower band has no room for a name


@dataclass(frozen=True, kw_only=True)
class ReportPicture:
    """A picture in the page.

    Attributes
    ----------
    caption, alt : str
        Text below the picture, and its replacement.
    image : PageImage
    """

    caption: str
    alt: str
    image: PageImage


def _picture(panel: Panel, alt: str) -> ReportPicture:
    return ReportPicture(caption=panel.caption, alt=alt, image=page_image(panel_figure(panel)))


def report_pictures(
    recording: Recording,
    model: WearModel | None = None,
    *,
    graded: bool,
    healthy: Float | None = None,
    evidence: Sequence[str] = (),
    most: int | None = None,
) -> list[ReportPicture]:
    """The most informative pictures of this machine: changes, effect of its wear, spectrum.

    Parameters
    ----------
    recording : Recording
    model : WearModel, optional
        Supplies the healthy reference of the map of changes, which is not drawn without it.
    graded : bool
        Without a grade the signal itself is shown, because it reveals a faulty recording.
    healthy : numpy.ndarray [shape=(n_features,)], optional
        Baseline of the machine instead of the model's as-new machines.
    evidence : sequence of str
        Features to be marked on the map.
    most : int, optional
        Largest number of pictures.

    Returns
    -------
    list of ReportPicture
    """
    view = View(recording=recording)
    moved = None
    if graded and model is not None:
        moved = moved_panel(recording, model, healthy=healthy, evidence=evidence)
    kinds = ("frf", "orbit") if graded else ("waveform",)
    special = _supported(view, kinds)[:1]
    panels = [panel for panel in (moved, *special) if panel is not None]
    panels += _supported(view, ("spectrum",))
    return [
        _picture(panel, f"{panel.caption.split(':')[0]} of {recording.source}")
        for panel in panels[:most]
    ]


def _supported(view: View, kinds: Sequence[str]) -> list[Panel]:
    """Pictures of those kinds that the recording supports; the others are left out silently."""
    panels = []
    for kind in kinds:
        with suppress(DataError):
            panels.append(make_panel(view, kind))
    return panels


# --- change over the crank angle


@dataclass(frozen=True, kw_only=True, eq=False)
class _Moved:
    """Level of one channel relative to healthy, in cells of angle and frequency."""

    channel: str
    angle: Float  # edges [deg]
    band: Float  # edges [Hz]
    level: Float  # [dB, shape=(len(band) - 1, len(angle) - 1)]
    marked: tuple[tuple[int, int], ...]  # (band, angle)


def moved_panel(
    recording: Recording,
    model: WearModel,
    *,
    healthy: Float | None = None,
    evidence: Sequence[str] = (),
) -> Panel | None:
    """Level of every cell of the crank-angle map relative to the healthy reference.

    Returns
    -------
    Panel or None
        None if the model's features contain no such map.
    """
    cells = [(i, MAP_CELL.fullmatch(name)) for i, name in enumerate(model.names)]
    found = {i: match.groups() for i, match in cells if match is not None}
    if not found:
        return None
    names, row = recording_features(recording, choice_in(model.card.feature_choice))
    if names != model.names:
        return None
    reference = healthy
    if reference is None:
        reference = np.array(model.card.healthy_features.mean)
    channels = list(dict.fromkeys(parts[0] for parts in found.values()))
    maps = [
        _moved(channel, found, row - reference, model.names, evidence)
        for channel in channels[:_MOST_MAPS]
    ]
    of = "the machine's healthy recordings" if healthy is not None else "as-new training machines"
    more = (
        "" if len(channels) <= _MOST_MAPS else f"; first {_MOST_MAPS} of {len(channels)} channels"
    )
    return Panel(
        kind="moved",
        caption=(
            f"What moved: level over crank angle and frequency against {of}; framed: the cells of "
            f"the evidence{more}"
        ),
        height=2.4 * len(maps) + 0.6,
        draw=partial(_draw_moved, maps=maps),
        right=RIGHT_OF_MAP,
    )


def _moved(
    channel: str,
    cells: Mapping[int, tuple[str, ...]],
    change: Float,
    names: Sequence[str],
    evidence: Sequence[str],
) -> _Moved:
    mine = {i: [int(n) for n in parts[1:]] for i, parts in cells.items() if parts[0] == channel}
    angle = sorted({edge for parts in mine.values() for edge in parts[:2]})
    band = sorted({edge for parts in mine.values() for edge in parts[2:]})
    level = np.full((len(band) - 1, len(angle) - 1), np.nan)
    marked = []
    for i, (left, _, low, _) in mine.items():
        place = band.index(low), angle.index(left)
        level[place] = change[i]
        if names[i] in evidence:
            marked.append(place)
    return _Moved(
        channel=channel,
        angle=np.array(angle, dtype=float),
        band=np.array(band, dtype=float),
        level=level,
        marked=tuple(marked),
    )


def _draw_moved(place: Any, *, maps: Sequence[_Moved]) -> None:
    from matplotlib.patches import Rectangle

    axes = stack(place, len(maps))
    most = max(_LEAST_SPAN_DB, *(float(np.nanpercentile(np.abs(m.level), 99)) for m in maps))
    for axis, item in zip(axes, maps, strict=True):
        mesh = axis.pcolormesh(
            item.angle, item.band, item.level, cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True
        )
        bar = place.colorbar(mesh, ax=axis, pad=0.015, fraction=0.06)
        bar.set_label("dB against\nhealthy", fontsize=8)
        for i, j in item.marked:
            width, height = item.angle[j + 1] - item.angle[j], item.band[i + 1] - item.band[i]
            corner = (item.angle[j], item.band[i])
            axis.add_patch(Rectangle(corner, width, height, fill=False, ec="black", lw=1.2))
        axis.grid(visible=False)
        log_frequency(axis, "y")
        axis.set_ylim(item.band[0], item.band[-1])
        axis.set_xticks(np.arange(0, 361, 45))
        axis.set_ylabel(f"{short_name(item.channel, 24)}\nfrequency [Hz]", fontsize=9)
    axes[-1].set_xlabel("crank angle after the tacho pulse [deg]")


# --- the estimate on the scale of grades


def gauge(estimate: Mapping[str, Any], limits: Mapping[str, Any]) -> ReportPicture:
    """The estimate and its interval on a scale of grades."""
    limit = 1e3 * limits["condemning_limit_m"]
    caption = (
        f"Estimate with its {100 * estimate['coverage']:.0f} % interval; red line: condemning "
        f"limit {limit:.3g} mm ({limits['source']})"
    )
    alt = (
        f"{limits['quantity']} {1e3 * estimate['severity']:.3f} mm, interval "
        f"{1e3 * estimate['low']:.3f} to {1e3 * estimate['high']:.3f} mm, on the scale of grades; "
        f"condemning limit {limit:.3g} mm"
    )
    image = page_image(_gauge_figure(estimate, limits))
    return ReportPicture(caption=caption, alt=alt, image=image)


def _gauge_figure(estimate: Mapping[str, Any], limits: Mapping[str, Any]) -> Any:
    """Small enough to be read on a phone."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, 1.6))
    figure.subplots_adjust(left=0.04, right=0.96, bottom=0.32, top=0.97)
    draw_gauge(figure.add_subplot(), estimate, limits)
    return figure


def draw_gauge(axes: Any, estimate: Mapping[str, Any], limits: Mapping[str, Any]) -> None:
    """Draw the grades as bands, the estimate with its interval and the condemning limit."""
    edges = [1e3 * edge for edge in limits["grade_edges_m"]]
    low, value, high = (1e3 * estimate[key] for key in ("low", "severity", "high"))
    right = 1.15 * max(1.5 * edges[-1], high)
    bounds = [0.0, *edges, right]
    for i, name in enumerate(limits["grade_names"]):
        axes.axvspan(bounds[i], bounds[i + 1], color=GRADE_COLOURS[i], alpha=0.25, lw=0)
        middle = (bounds[i] + bounds[i + 1]) / 2
        narrow = bounds[i + 1] - bounds[i] < _NARROW * right
        text = str(i) if narrow else "\n".join([str(i), *name.split()])
        axes.text(middle, 0.95, text, ha="center", va="top", fontsize=8)
    axes.errorbar(
        [value],
        [0.3],
        xerr=[[max(value - low, 0)], [max(high - value, 0)]],
        fmt="o",
        color="black",
        capsize=6,
        lw=2,
        ms=8,
    )
    axes.axvline(1e3 * limits["condemning_limit_m"], color="#c03a2b", lw=2)
    axes.set(xlim=(0, right), ylim=(0, 1), yticks=[])
    axes.set_xlabel(f"{limits['quantity']} [mm]")


# --- trend


def trend_picture(trend: Trend, limits: Mapping[str, Any], heading: str) -> ReportPicture:
    """Severity with intervals over time, the line since the last maintenance and its band."""
    said = trend.outlook.text if trend.outlook else f"no line: {trend.reason}"
    caption = f"Trend of {heading}: {said}"
    image = drawn_alone(partial(_draw_trend, trend=trend, limits=limits))
    return ReportPicture(caption=caption, alt=caption, image=image)


def _draw_trend(axes: Any, trend: Trend, limits: Mapping[str, Any]) -> None:
    time, ahead = _moments(trend, trend.time_h), _moments(trend, trend.ahead_h)
    low, value, high = (1e3 * row for row in (trend.low, trend.severity, trend.high))
    errors = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
    held = f"{100 * trend.coverage:.3g} %"
    label = f"estimate, {held} interval"
    axes.errorbar(time, value, yerr=errors, fmt="o", ms=4, color="black", lw=0.8, label=label)
    if ahead.size:
        band = 1e3 * trend.line_low, 1e3 * trend.line_high
        axes.fill_between(
            ahead, *band, color=_LINE_COLOUR, alpha=0.2, lw=0, label=f"{held} band of the line"
        )
        axes.plot(ahead, 1e3 * trend.line, color=_LINE_COLOUR, label="line")
    limit = 1e3 * limits["condemning_limit_m"]
    axes.axhline(limit, color="#c03a2b", lw=1.5, label=f"condemning limit {limit:.3g} mm")
    for between in _moments(trend, trend.maintenances_h):
        axes.axvline(between, color="0.4", ls="--", lw=1)
        axes.annotate(
            "maintenance",
            (between, 0.02),
            xycoords=("data", "axes fraction"),
            rotation=90,
            fontsize=8,
            ha="right",
        )
    axes.set_ylim(0, 1.1 * max(limit, float(high.max())))
    axes.margins(x=0.02)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    axes.set_ylabel(f"{short_name(limits['quantity'].split(',')[0])} [mm]")
    _label_time(axes, trend)


_LINE_COLOUR = "#1f5a94"


def _moments(trend: Trend, hours: Float) -> NDArray[Any]:
    """Times as the axis needs them: calendar dates, or operating hours."""
    if trend.clock == "operating":
        return hours
    return (3600 * hours).round().astype("datetime64[s]")


def _label_time(axes: Any, trend: Trend) -> None:
    """Label the time axis: dates for calendar times, else operating hours."""
    if trend.clock == "operating":
        axes.set_xlabel("operating hours [h]")
        return
    from matplotlib import dates

    untyped: Any = dates
    locator = untyped.AutoDateLocator(minticks=3, maxticks=7)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(untyped.ConciseDateFormatter(locator))
    axes.set_xlabel("date (UTC)")
