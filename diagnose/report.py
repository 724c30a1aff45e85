"""The verdict on one recording: as a table for JSON, as text, as one HTML page."""

import base64
import io
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from .. import __version__
from ..datasets.record import DataError, Recording
from .estimate import Estimate, WearModel, input_faults
from .grades import ADVICE, GRADE_NAMES
from .panel import DOTS_PER_INCH, Panel, panel_figure
from .signal_plots import make_panel
from .signal_view import View

REPORT_SCHEMA = 1

_TEMPLATES = Path(__file__).parent / "templates"
_GRADE_COLOURS = ("#3a923a", "#c8b400", "#e07b00", "#c03a2b")


def report_table(recording: Recording, model: WearModel, estimate: Estimate) -> dict[str, Any]:
    """Everything the report says, ready for JSON.

    Returns
    -------
    dict
        ``schema_version``, ``recording``, ``estimate``, ``limits``, ``advice``, ``notice``,
        ``provenance``. Lengths in metres, speeds in revolutions per second.
    """
    card = model.card
    return {
        "schema_version": REPORT_SCHEMA,
        "recording": {
            "source": recording.source,
            "origin": recording.origin,
            "channels": [asdict(channel) for channel in recording.channels],
            "label": _recording_line(recording),
            "tacho": recording.tacho,
            "sample_rate_hz": recording.sample_rate,
            "duration_s": recording.duration,
            "rms": {
                channel.name: float(row.std())
                for channel, row in zip(
                    recording.vibration_channels, recording.vibration, strict=True
                )
            },
            "fits_model_inputs": not input_faults(recording, card),
        },
        "estimate": estimate.as_dict(),
        "advice": ADVICE[estimate.grade] if estimate.grade is not None else _UNFAMILIAR_ADVICE,
        "limits": {
            "severity": card["severity"],
            "grade_edges_m": card["grade_edges_m"],
            "grade_names": list(GRADE_NAMES),
            "condemning_limit_m": card["condemning_limit_m"],
            "source": card["limit_source"],
        },
        "notice": model.notice,
        "provenance": {
            "program": f"wearstate {__version__}",
            "model": {key: card[key] for key in ("created_by", "origin")}
            | {
                key: card["trained_on"][key]
                for key in ("scene", "recipe", "records", "draws", "draw_identity")
            },
        },
    }


_UNFAMILIAR_ADVICE = (
    "No grade is given: the model was not trained on recordings like this one. Check channels, "
    "units and tacho, or train a model on this machine."
)


def quantity_name(severity: str) -> str:
    """Severity column in words, for headings.

    Examples
    --------
    >>> quantity_name("diametral_clearance_crankpin_m")
    'diametral clearance, crankpin'
    >>> quantity_name("diametral_clearance_crankpin_2_m")
    'diametral clearance, crankpin 2'
    """
    number = re.search(r"_([0-9]+)_m$", severity)
    stem = severity.removesuffix(number[0] if number else "_m")
    kind, _, place = stem.rpartition("_")
    return f"{kind.replace('_', ' ')}, {place}{f' {number[1]}' if number else ''}"


def severity_word(severity: str) -> str:
    """What a severity column measures, in one or two words.

    Examples
    --------
    >>> severity_word("diametral_clearance_crankpin_m"), severity_word("scar_depth_bearing_m")
    ('clearance', 'scar depth')
    """
    return quantity_name(severity).split(",")[0].removeprefix("diametral ")


def feature_words(name: str) -> str:
    """Feature name for people.

    Examples
    --------
    >>> feature_words("acc_x.angle_040_050.band_4350_5250.level_db")
    'acc_x, 40 to 50°, 4350 to 5250 Hz, level [dB]'
    >>> feature_words("acc_y.kurtosis")
    'acc_y, kurtosis'
    >>> feature_words("orbit.order_0.5.major_db")
    'orbit, order 0.5, major [dB]'
    """
    owner, *parts = re.split(r"\.(?![0-9])", name)  # an order may be 0.5
    words = [owner]
    for part in parts:
        span = re.fullmatch(r"(angle|band)_(\d+)_(\d+)", part)
        if span:
            unit = "°" if span[1] == "angle" else " Hz"
            words.append(f"{int(span[2])} to {int(span[3])}{unit}")
        else:
            words.append(re.sub(r"_db$", " [dB]", part).replace("_", " "))
    return ", ".join(words)


def report_text(table: dict[str, Any]) -> str:
    """The report for a terminal: verdict first, a dozen lines."""
    estimate, limits = table["estimate"], table["limits"]
    lines = [f"Recording   {table['recording']['label']}"]
    if estimate["verdict"] == "unfamiliar":
        lines.append("Verdict     UNFAMILIAR: no grade is given")
        lines += [f"  because   {reason}" for reason in estimate["reasons"]]
    else:
        lines += [
            f"Verdict     grade {estimate['grade']} ({estimate['grade_name']})",
            f"{severity_word(limits['severity']).capitalize():11} {_millimetres(estimate)} mm, "
            f"{quantity_name(limits['severity'])}",
            f"Limit       {1e3 * limits['condemning_limit_m']:.3g} mm ({limits['source']})",
            f"Familiarity p = {estimate['p_value']:.2g} (unfamiliar at {estimate['p_limit']:.2g})",
        ]
    lines += [f"Caution     {caution}" for caution in estimate["cautions"]]
    lines.append(f"Advice      {table['advice']}")
    if table["notice"]:
        lines.append(f"Notice      {table['notice']}")
    return "\n".join(lines)


def _recording_line(recording: Recording) -> str:
    channels = ", ".join(channel.label for channel in recording.channels)
    return (
        f"{recording.source}: {recording.origin}, {recording.duration:.3g} s at "
        f"{recording.sample_rate:g} Hz, {channels}"
    )


def _millimetres(estimate: dict[str, Any]) -> str:
    return (
        f"{1e3 * estimate['severity']:.3f} "
        f"({1e3 * estimate['low']:.3f} to {1e3 * estimate['high']:.3f}, "
        f"{100 * estimate['coverage']:.0f} %)"
    )


def report_html(table: dict[str, Any], recording: Recording) -> str:
    """The report as one self-contained page: no script, no link, plots inside.

    Parameters
    ----------
    table : dict
        Of :func:`report_table`.
    recording : Recording
        Its signals are drawn.

    Returns
    -------
    str
        HTML.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    estimate = table["estimate"]
    graded = estimate["verdict"] == "graded"
    return environment.get_template("report.html.j2").render(
        table=table,
        graded=graded,
        colour=_GRADE_COLOURS[estimate["grade"]] if graded else "#5b6470",
        clearance=_millimetres(estimate) if graded else "",
        words=feature_words,
        quantity=quantity_name(table["limits"]["severity"]),
        gauge=_gauge(table) if graded else "",
        figures=_figures(recording, graded=graded),
        trained=table["provenance"]["model"],
    )


def _figures(recording: Recording, *, graded: bool) -> list[tuple[str, str]]:
    """Captions and pictures: where the machine tells most of its wear first, then the usual two."""
    view = View(recording=recording)
    first = _supported(view, ("orbit", "angle") if graded else ("orbit",))[:1]
    return [
        (panel.caption, _encoded(panel_figure(panel)))
        for panel in (*first, *_supported(view, ("waveform", "spectrum")))
    ]


def _supported(view: View, kinds: Sequence[str]) -> list[Panel]:
    """Those kinds that the recording supports; a report is no place for what it lacks."""
    panels = []
    for kind in kinds:
        with suppress(DataError):
            panels.append(make_panel(view, kind))
    return panels


def save_page(html: str, path: Path) -> None:
    """Write a page whole, or not at all."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(html, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _encoded(figure: Any) -> str:
    """PNG of a figure as a data address."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS_PER_INCH)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def _gauge(table: dict[str, Any]) -> str:
    """The estimate and its interval on a scale of grades."""
    panel = Panel(kind="gauge", caption="", height=1.7, draw=partial(_draw_gauge, table=table))
    return _encoded(panel_figure(panel))


def _draw_gauge(place: Any, *, table: dict[str, Any]) -> None:
    estimate, limits = table["estimate"], table["limits"]
    edges = [1e3 * edge for edge in limits["grade_edges_m"]]
    low, value, high = (1e3 * estimate[key] for key in ("low", "severity", "high"))
    right = 1.15 * max(1.5 * edges[-1], high)
    axes = place.add_subplot()
    bounds = [0.0, *edges, right]
    for i, name in enumerate(limits["grade_names"]):
        axes.axvspan(bounds[i], bounds[i + 1], color=_GRADE_COLOURS[i], alpha=0.25, lw=0)
        middle = (bounds[i] + bounds[i + 1]) / 2
        height = 0.9 if i % 2 == 0 else 0.75  # neighbours of narrow bands would overlap
        axes.text(middle, height, f"{i}: {name}", ha="center", va="center", fontsize=8)
    axes.errorbar(
        [value], [0.4], xerr=[[value - low], [high - value]], fmt="o", color="black", capsize=5
    )
    axes.axvline(1e3 * limits["condemning_limit_m"], color="#c03a2b", lw=2)
    axes.set(xlim=(0, right), ylim=(0, 1), yticks=[])
    axes.set_xlabel(f"{quantity_name(limits['severity'])} [mm]")
