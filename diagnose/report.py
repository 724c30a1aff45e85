"""The verdict on one recording: as a table for JSON, as text, as one HTML page."""

import base64
import io
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..datasets.record import Recording
from ..features.orbit import displacement, full_spectrum, keyphasor_marks
from ..features.order import crank_angle_map, pulse_times, shaft_phase
from ..features.spectrum import decibel, line_band_edges, power_lines
from ..features.table import probe_rows
from .estimate import Estimate, WearModel, input_faults
from .grades import ADVICE, GRADE_NAMES

REPORT_SCHEMA = 1

_TEMPLATES = Path(__file__).parent / "templates"
_GRADE_COLOURS = ("#3a923a", "#c8b400", "#e07b00", "#c03a2b")
_LINE_COLOURS = ("#1f5a94", "#b3541e", "#4f7d3a", "#7a4a8c")
_LOWEST_SHOWN = 10.0  # Hz, of a spectrum
_MOST_POINTS = 4000  # of a curve in a plot; more cannot be seen
_MOST_ORDERS = 4.0  # of a full spectrum, to either side


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
    figures = [("Waveform", _waveform(recording)), ("Spectrum", _spectrum(recording))]
    probes = probe_rows([channel.quantity for channel in recording.vibration_channels])
    if probes is not None:
        figures.insert(0, ("Shaft orbit, with dots at the tacho pulses", _orbit(recording, probes)))
    elif graded:
        figures.insert(0, ("Energy over crank angle and frequency", _angle_map(recording)))
    return environment.get_template("report.html.j2").render(
        table=table,
        graded=graded,
        colour=_GRADE_COLOURS[estimate["grade"]] if graded else "#5b6470",
        clearance=_millimetres(estimate) if graded else "",
        words=feature_words,
        quantity=quantity_name(table["limits"]["severity"]),
        gauge=_gauge(table) if graded else "",
        figures=figures,
        trained=table["provenance"]["model"],
    )


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
    figure.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


_WIDTH = 8.0  # inch, of every figure


def _figure(height: float) -> Any:
    """A figure with fixed margins: fitting them to the labels would take half a report's time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height))
    figure.subplots_adjust(
        left=0.75 / _WIDTH,
        right=1 - 0.2 / _WIDTH,
        bottom=0.5 / height,
        top=1 - 0.1 / height,
        hspace=0.08,
    )
    return figure


def _gauge(table: dict[str, Any]) -> str:
    """The estimate and its interval on a scale of grades."""
    estimate, limits = table["estimate"], table["limits"]
    edges = [1e3 * edge for edge in limits["grade_edges_m"]]
    low, value, high = (1e3 * estimate[key] for key in ("low", "severity", "high"))
    right = 1.15 * max(1.5 * edges[-1], high)
    figure = _figure(1.7)
    axes = figure.add_subplot()
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
    return _encoded(figure)


def _waveform(recording: Recording) -> str:
    """The first two revolutions, or the first half second without a tacho."""
    rate = recording.sample_rate
    duration = 0.5
    if recording.tacho_signal is not None:
        pulses = pulse_times(recording.tacho_signal, rate)
        per_turn = recording.pulses_per_revolution
        if len(pulses) > 2 * per_turn:
            duration = float(pulses[2 * per_turn] - pulses[0])
    n = max(2, min(recording.signal.shape[1], round(duration * rate)))
    channels = recording.vibration_channels
    figure = _figure(1.6 * len(channels) + 0.6)
    axes = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for i, (channel, row) in enumerate(zip(channels, recording.vibration, strict=True)):
        time, low, high = _envelope_of(row[:n], rate)
        shown, scale = ("µm", 1e6) if channel.unit == "m" else (channel.unit, 1.0)
        colour = _LINE_COLOURS[i % 4]
        axes[i].fill_between(time, scale * low, scale * high, lw=0.5, color=colour, alpha=0.9)
        axes[i].set_ylabel(f"{channel.name}\n[{shown}]", fontsize=8)
        axes[i].grid(alpha=0.3)
        axes[i].margins(x=0)
    axes[-1].set_xlabel("time [s]")
    return _encoded(figure)


def _envelope_of(
    row: NDArray[np.float32], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float32]]:
    """Least and largest value of short pieces, so that a plot hides no peak."""
    piece = max(1, len(row) // (_MOST_POINTS // 2))
    cut = row[: len(row) // piece * piece].reshape(-1, piece)
    return np.arange(len(cut)) * piece / rate, cut.min(axis=1), cut.max(axis=1)


def _spectrum(recording: Recording) -> str:
    """Power spectral density of every vibration channel."""
    figure = _figure(3.2)
    axes = figure.add_subplot()
    for i, (channel, row) in enumerate(
        zip(recording.vibration_channels, recording.vibration, strict=True)
    ):
        lines = power_lines(row, recording.sample_rate)
        frequency = np.linspace(0, recording.sample_rate / 2, lines.shape[-1])
        level = decibel(lines / (frequency[1] - frequency[0]))
        axes.plot(
            frequency[1:] / 1e3, level[1:], lw=0.8, color=_LINE_COLOURS[i % 4], label=channel.name
        )
    units = " or ".join(sorted({channel.unit for channel in recording.vibration_channels}))
    axes.set_xlabel("frequency [kHz]")
    axes.set_ylabel(f"PSD [dB re 1 ({units})²/Hz]")
    _log_frequency(axes, "x")
    axes.set_xlim(_LOWEST_SHOWN / 1e3, recording.sample_rate / 2e3)
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right", fontsize=8)
    return _encoded(figure)


def _log_frequency(axes: Any, which: str) -> None:
    """Logarithmic axis in kHz with a few plain ticks: matplotlib's own take a second to draw."""
    ticks = [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50]
    axes.set(**{f"{which}scale": "log"})
    axes.minorticks_off()
    axes.set(**{f"{which}ticks": ticks, f"{which}ticklabels": [f"{tick:g}" for tick in ticks]})


def _orbit(recording: Recording, probes: tuple[int, int]) -> str:
    """Orbit of the shaft as the probes see it, and its two-sided spectrum in orders."""
    rate = recording.sample_rate
    z = 1e6 * displacement(*(recording.vibration[row] for row in probes))
    figure = _figure(3.6)
    path, lines = figure.subplots(1, 2, width_ratios=(1, 1.4))
    figure.subplots_adjust(wspace=0.3)
    n = min(len(z), _MOST_POINTS)
    path.plot(z[:n].real, z[:n].imag, lw=0.6, color=_LINE_COLOURS[0])
    path.set_aspect("equal", adjustable="datalim")
    path.set(xlabel="x, between the probes [µm]", ylabel="y [µm]")
    frequency, vector = full_spectrum(z, rate)
    unit = "Hz"
    if recording.tacho_signal is not None:
        pulses = pulse_times(recording.tacho_signal, rate)[:: recording.pulses_per_revolution]
        marks = keyphasor_marks(z, rate, pulses[pulses < n / rate])
        path.plot(marks.real, marks.imag, ".", ms=4, color="black")
        frequency, unit = frequency / ((len(pulses) - 1) / (pulses[-1] - pulses[0])), "orders"
        lines.set_xlim(-_MOST_ORDERS, _MOST_ORDERS)
    lines.plot(frequency, np.abs(vector), lw=0.8, color=_LINE_COLOURS[0])
    lines.set(xlabel=f"backward   [{unit}]   forward", ylabel="radius [µm]")
    for axes in (path, lines):
        axes.grid(alpha=0.3)
    return _encoded(figure)


def _angle_map(recording: Recording) -> str:
    """Energy in crank-angle bins and frequency bands, per channel."""
    rate = recording.sample_rate
    tacho = recording.tacho_signal
    assert tacho is not None  # only drawn for graded recordings of a model with tacho
    phase = shaft_phase(
        pulse_times(tacho, rate),
        len(tacho),
        rate,
        pulses_per_revolution=recording.pulses_per_revolution,
    )
    edges = line_band_edges(rate, 256)
    channels = recording.vibration_channels
    figure = _figure(2.6 * len(channels) + 0.6)
    axes = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, channel, row in zip(axes, channels, recording.vibration, strict=True):
        level = decibel(crank_angle_map(row, rate, phase, edges=edges))
        angle = np.linspace(0, 360, level.shape[0] + 1)
        mesh = axis.pcolormesh(angle, edges / 1e3, level.T, shading="flat", cmap="magma")
        figure.colorbar(mesh, ax=axis, label=f"dB re 1 ({channel.unit})²")
        _log_frequency(axis, "y")
        axis.set_ylim(edges[0] / 1e3, edges[-1] / 1e3)
        axis.set_ylabel(f"{channel.name}\nfrequency [kHz]")
    axes[-1].set_xlabel("crank angle after the tacho pulse [deg]")
    axes[-1].set_xticks(np.arange(0, 361, 45))
    return _encoded(figure)
