"""Description of a file, checked while reading it."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy

from ...datasets.audit.plausibility import recording_doubts, scene_in
from ...datasets.file.record import DataSet
from ...datasets.measured.recording import read_recording
from ...datasets.source.part import SourceOptions
from ...features.signal import fft
from ...sim.output.recording import DataError, Recording, missing_file
from ...sim.output.sensor import Channel
from ...sim.scene.scene import Scene
from ..class_model.file import CLASS_MODEL, load_class_model
from ..feature_rows.feature_table import choice_of, confounders_in
from ..pages.embed import require_bokeh
from ..pages.page import save_page
from ..pages.picture import page_image, save_picture
from ..pictures.kinds import AUTO, plot_recording
from ..pictures.panel import panel_figure
from ..pictures.view import View
from ..pictures.zoom import STILL_COLOURS, zoom_page
from ..pictures.zoom_curves import zoom_curves
from ..recording_faults.samples import sample_faults
from ..recording_faults.surroundings import hum_faults
from ..wear_model.bundle import kind_of
from ..wear_model.file import load_model


def describe(
    path: Path,
    options: SourceOptions | None = None,
    *,
    tacho: str | None = None,
    pulses_per_revolution: int = 1,
) -> dict[str, Any]:
    """Describe a data set, a recording or a model.

    Parameters
    ----------
    path : Path
        A data set or model of this program, or a measured file.
    options : SourceOptions, optional
        Declarations that a measured file lacks.
    tacho : str, optional
        Name of the tacho channel of a measured file.
    pulses_per_revolution : int
        Pulses of the tacho in one revolution.

    Returns
    -------
    dict
        ``kind`` first; names in snake case, numbers in SI with the unit in the name, None if
        unknown.

    Raises
    ------
    DataError, ModelError
        If the file is missing, damaged, or of unknown kind.
    """
    if not path.is_file():
        raise DataError(missing_file(path))
    if path.suffix == ".wsm":
        return _describe_model(path)
    if path.suffix in (".h5", ".hdf5", ".part"):
        return _describe_data(path)
    return _describe_recording(
        read_recording(path, options, tacho=tacho, pulses_per_revolution=pulses_per_revolution)
    )


def description_text(described: Mapping[str, Any]) -> str:
    """A description as lines of name and value, in usual units.

    Parameters
    ----------
    described : mapping
        Description from :func:`describe`.

    Examples
    --------
    >>> print(description_text({"kind": "recording", "sample_rate_hz": 25600.0}))
    kind         recording
    sample rate  25600 Hz
    """
    facts = {key: value for key, value in described.items() if key != "warnings"}
    lines = dict(_line(key, value) for key, value in facts.items())
    width = max(len(name) for name in lines)
    listed = [f"{name:{width}}  {value}" for name, value in lines.items()]
    return "\n".join([*listed, *(f"warning: {text}" for text in described.get("warnings", ()))])


def _line(key: str, value: Any) -> tuple[str, str]:
    """Name and value of one entry as text."""
    if value is None or value == "" or value == {}:
        return key.removesuffix("_m").replace("_", " "), "none"
    if key == "channels":
        return key, ", ".join(Channel(**channel).label for channel in value)
    for ending, unit, scale in _UNITS:
        if key.endswith(ending):
            return key.removesuffix(ending).replace("_", " "), _quantity(value, unit, scale)
    if key == "confounders":
        return key, ", ".join(
            f"{name.replace('_', ' ')} in {count}" for name, count in value.items()
        )
    if key == "grades":
        names = {grade: f"grade {grade}" if int(grade) >= 0 else "unknown grade" for grade in value}
        return key, ", ".join(f"{count} of {names[grade]}" for grade, count in value.items())
    return key.replace("_", " "), _value_text(value)


_UNITS = (("_hz", "Hz", 1.0), ("_s", "s", 1.0), ("_m", "mm", 1e3))
"""Ending of a name, usual unit, and factor to it."""


def _quantity(value: Any, unit: str, scale: float) -> str:
    if isinstance(value, Mapping):
        return ", ".join(
            f"{name.removesuffix('_m')} {_quantity(v, unit, scale)}" for name, v in value.items()
        )
    if isinstance(value, (list, tuple)):
        between = " to " if len(value) == 2 else ", "
        return between.join(f"{scale * v:.4g}" for v in value) + f" {unit}"
    return f"{scale * value:.6g} {unit}"


def _value_text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_value_text(inner)}" for name, inner in value.items())
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _describe_class_model(path: Path) -> dict[str, Any]:
    model = load_class_model(path)
    card = model.card
    return {
        "kind": CLASS_MODEL,
        "created_by": card.created_by,
        "origin": card.origin,
        "trained_on": {"records": card.records},
        "recordings": dict(zip(model.classes, model.votes.groups_of, strict=True)),
        "target": card.target,
        "channels": [channel.table() for channel in card.channels],
        "tacho": card.tacho,
        "sample_rate_hz": card.sample_rate_hz,
        "features": len(card.features),
        "members": {
            name: " + ".join(blend.names)
            for name, blend in zip(model.classes, model.blends, strict=True)
        },
        "notice": model.notice,
    }


def _describe_model(path: Path) -> dict[str, Any]:
    if kind_of(path) == CLASS_MODEL:
        return _describe_class_model(path)
    model = load_model(path)
    card = model.card
    trained = card.trained_on
    return {
        "kind": "wear model",
        "created_by": card.created_by,
        "origin": card.origin,
        "trained_on": {"records": trained.records, "draws": trained.draws},
        "scene": trained.scene,
        "recipe": trained.recipe,
        "channels": [channel.table() for channel in card.channels],
        "tacho": card.tacho,
        "sample_rate_hz": card.sample_rate_hz,
        "features": len(card.features),
        "mode": card.mode,
        "members": card.model.members,
        "severity": card.severity,
        "severity_range_m": list(card.severity_range_m),
        "grade_edges_m": list(card.grade_edges_m),
        "limit_source": card.limit_source,
        "notice": model.notice,
    }


def _describe_data(path: Path) -> dict[str, Any]:
    with DataSet(path) as data:
        head, manifest = data.attributes, data.manifest
        warnings = _Warnings(scene_in(head), single=len(data) == 1)
        for index in range(len(data)):  # check every signal against its checksum
            warnings.look(index, data[index])
        first = data[0]
    return {
        "kind": "data set" if len(manifest) > 1 else "recording",
        "origin": head.origin,
        "created_by": head.created_by,
        "records": len(manifest),
        "machine_draws": int(manifest["group"].nunique()),
        "status": _counts(manifest["status"]),
        "grades": _counts(manifest["grade"]),
        "channels": [asdict(channel) for channel in head.channels],
        "tacho": head.tacho,
        "sample_rate_hz": head.sample_rate,
        "duration_s": first.duration,
        "checksums_intact": True,
        "severity_ranges_m": {
            column: [float(manifest[column].min()), float(manifest[column].max())]
            for column in head.severities
        },
        "confounders": {
            name: int(present.sum()) for name, present in confounders_in(manifest).items()
        },
        "condemning_limit_m": head.condemning_limit if head.limit_source else None,
        "limit_source": head.limit_source,
        "warnings": warnings.texts(),
    }


class _Warnings:
    """Implausible properties of the records of a file: one text per check, and a count."""

    def __init__(self, scene: Scene | None, *, single: bool) -> None:
        self.scene, self.single = scene, single
        self.found: dict[str, list[tuple[int, str]]] = {}

    def look(self, index: int, recording: Recording) -> None:
        """Collect the doubts about one record; failed ones are reported by their status."""
        if recording.row.get("status", "ok") == "ok":
            for check, text in _doubts(recording, self.scene, run=self.single):
                self.found.setdefault(check, []).append((index, text))

    def texts(self) -> list[str]:
        """All warnings; for a set, each check with its first record."""
        if self.single:
            return [text for found in self.found.values() for _, text in found]
        return [
            f"{check} in {len(found)} record(s), such as record {found[0][0]}: {found[0][1]}"
            for check, found in self.found.items()
        ]


def _doubts(
    recording: Recording, scene: Scene | None = None, *, run: bool = False
) -> list[tuple[str, str]]:
    """Check and text of each doubt; for measured records also saturation, gaps and hum."""
    texts = [
        (doubt.check, doubt.text) for doubt in recording_doubts(recording, scene, scene_too=run)
    ]
    if recording.origin == "simulated":  # the converter has counted its clipped samples
        return texts
    faults = sample_faults(recording)
    shown = [fault for fault in faults if fault.kind in ("saturated", "gap")]
    if all(fault.kind != "tacho" for fault in faults):
        shown += hum_faults(recording)
    return [*texts, *((fault.kind, fault.text) for fault in shown)]


def _counts(column: Any) -> dict[str, int]:
    return {str(value): int(count) for value, count in column.value_counts().sort_index().items()}


def _describe_recording(recording: Recording) -> dict[str, Any]:
    rows = zip(recording.vibration_names, recording.vibration, strict=True)
    return {
        "kind": "recording",
        "origin": recording.origin,
        "channels": [asdict(channel) for channel in recording.channels],
        "tacho": recording.tacho,
        "sample_rate_hz": recording.sample_rate,
        "samples": recording.signal.shape[1],
        "duration_s": recording.duration,
        "rms_about_mean": {name: float(row.std()) for name, row in rows},
        "manifest": {str(key): value for key, value in recording.row.items()},
        "warnings": [text for _, text in _doubts(recording)],
    }


# --- pictures


def plot_file(
    path: Path,
    picture: Path,
    options: SourceOptions | None = None,
    *,
    kind: str = AUTO,
    draw: Sequence[str] = (),
    force_channel: str | None = None,
    speed_hz: float | None = None,
    bearing: Sequence[float] | None = None,
    exponential: float = 1.0,
    tacho: str | None = None,
    pulses_per_revolution: int = 1,
    interactive: bool = False,
    force: bool = True,
) -> dict[str, Any]:
    """Draw a recording of a file into a picture, or into a page with zoom and cursors.

    Parameters
    ----------
    path : Path
        Data set, with the record chosen in `options`, or measured file.
    picture : Path
        ``.png``, ``.svg`` or ``.pdf``; for an interactive page ``.html``.
    options, tacho, pulses_per_revolution
        As for :func:`describe`.
    kind : str
        Key of :data:`.pictures.kinds.KINDS`, or ``auto`` for all that the recording supports.
    draw : sequence of str
        Channels; all by default.
    force_channel : str, optional
        Force of a transfer function; the only channel in N by default.
    speed_hz : float, optional
        Shaft speed if there is no tacho [Hz]; it takes precedence over that in the file.
    bearing : sequence of float, optional
        Number and diameter of the rollers, pitch diameter (any one unit for both) and, if it is not
        0, contact angle [deg].
    exponential : float
        Value of the exponential window of an impact test at the end of a block [-].
    interactive : bool
        Write a page; `kind` is then ``auto`` or a key of :data:`.pictures.zoom_curves.ZOOM_KINDS`.
    force : bool
        Replace an existing file.

    Returns
    -------
    dict
        ``path``, ``drawn`` (kinds) and ``left_out`` (what the recording lacks, by kind).

    Raises
    ------
    DataError
        If the file is a model or cannot be read, an argument is out of bounds, the recording lacks
        what the kind needs, or Bokeh is not installed for an interactive page.
    """
    if interactive:
        require_bokeh()
    if path.suffix == ".wsm":
        raise DataError(f"{path} is a model, must be a recording or data set; name one to plot")
    about = choice_of(speed_hz=speed_hz, bearing=bearing, exponential=exponential).settings
    view = View(
        recording=read_recording(
            path, options, tacho=tacho, pulses_per_revolution=pulses_per_revolution
        ),
        channels=draw,
        force=force_channel,
        speed_hz=about.speed_hz,
        bearing=about.bearing,
        exponential=about.exponential,
    )
    if interactive:
        return _save_zoom(view, kind, picture, force=force)
    made = plot_recording(view, kind)
    save_picture(made.figure, picture, force=force)
    return {"path": str(picture), "drawn": list(made.drawn), "left_out": made.left_out}


def _save_zoom(view: View, kind: str, page: Path, *, force: bool) -> dict[str, Any]:
    """Write the page of curves with a still picture for printing; return as `plot_file` does."""
    curves, left_out = zoom_curves(view, kind)
    stills = [
        (panel.caption, page_image(panel_figure(panel), colours=STILL_COLOURS))
        for panel in plot_recording(view, kind).panels
    ]
    html = zoom_page(curves, stills, heading=view.heading, speed=view.speed, missing=left_out)
    save_page(html, page, force=force)
    drawn = list(dict.fromkeys(curve.kind for curve in curves))
    return {"path": str(page), "drawn": drawn, "left_out": left_out}


def picture_text(made: Mapping[str, Any]) -> str:
    """Text about what :func:`plot_file` drew.

    Examples
    --------
    >>> made = {"path": "a.png", "drawn": ["waveform", "spectrum"]}
    >>> print(picture_text({**made, "left_out": {"orbit": "needs 2 displacement channels, has 0"}}))
    plotted      a.png: waveform, spectrum
    not plotted  orbit: needs 2 displacement channels, has 0
    """
    lines = [f"plotted      {made['path']}: {', '.join(made['drawn'])}"]
    lines += [f"not plotted  {kind}: {lack}" for kind, lack in made["left_out"].items()]
    return "\n".join(lines)


# --- FFT backend

_TIMED: tuple[tuple[fft.Kind, int, int, str], ...] = (
    ("rfft", 600, 256, "float32"),
    ("rfft", 3, 8192, "float32"),
    ("rfft", 12, 8192, "float32"),
    ("rfft", 3, 25_600, "float32"),
    ("rfft", 3, 25_600, "float64"),
    ("irfft", 3, 25_600, "complex64"),
    ("ifft", 3, 25_600, "complex64"),
    ("rfft", 1, 122_880, "float32"),
    ("rfft", 3, 25_601, "float32"),
)
"""Transform, rows, length [samples] and type of typical transforms of the features."""


def describe_fft() -> dict[str, Any]:
    """Describe the FFT backend, with both libraries timed on this machine.

    Returns
    -------
    dict
        Mode, versions and the wisdom file; under ``choices`` one dict for each of a few transforms:
        the engine chosen and the shortest time of each [s]. Versions and times of a library that is
        not installed are None.

    Raises
    ------
    FFTModeError
        If the environment variable names no mode.
    """
    library = fft.fftw_library()
    path = fft.wisdom_file()
    return {
        "kind": "fft",
        "mode": fft.fft_mode(),
        "modes": list(fft.MODES),
        "scipy": scipy.__version__,
        "pyfftw": None if library is None else library.__version__,
        "fftw": None if library is None else library.fftw_version,
        "threads": 1,
        "wisdom_file": None if path is None else str(path),
        "wisdom_kept": path is not None and path.is_file(),
        "choices": [_choice(*timed) for timed in _TIMED],
    }


def _choice(kind: fft.Kind, rows: int, n: int, dtype: str) -> dict[str, Any]:
    """One transform: the engine chosen, and the times of both [s]."""
    columns = n // 2 + 1 if kind == "irfft" else n
    data = np.random.default_rng(0).standard_normal((rows, columns)).astype(dtype)
    engines: dict[str, float | None] = {"scipy": None, "fftw": None}
    for engine in engines if fft.fftw_library() is not None else ("scipy",):
        chosen = cast(fft.Engine, engine)
        engines[engine] = _least_time(partial(fft.transform, kind, data, n, engine=chosen))
    return {
        "transform": kind,
        "rows": rows,
        "samples": n,
        "dtype": dtype,
        "engine": fft.engine_in_force(kind, n, rows, dtype),
        **{f"{engine}_s": least for engine, least in engines.items()},
    }


_REPEATS = 15


def _least_time(function: Callable[[], Any]) -> float:
    """Shortest duration of several calls [s]; the first, which may plan, is not counted."""
    function()
    least = float("inf")
    for _ in range(_REPEATS):
        start = time.perf_counter()
        function()
        least = min(least, time.perf_counter() - start)
    return least


def fft_text(facts: Mapping[str, Any]) -> str:
    """Text about what :func:`describe_fft` found.

    Examples
    --------
    >>> facts = {"mode": "auto", "modes": ["auto", "scipy"], "scipy": "1.17", "fftw": None}
    >>> facts |= {"pyfftw": None, "wisdom_file": None, "wisdom_kept": False}
    >>> row = {"transform": "rfft", "rows": 3, "samples": 8192, "dtype": "float32"}
    >>> print(fft_text({**facts, "choices": [row | {"engine": "scipy", "scipy_s": 9e-5}]}))
    mode    auto (WEARSTATE_FFT: auto, scipy), one thread
    scipy   1.17
    FFTW    not installed
    wisdom  none
    <BLANKLINE>
    transform         data                     scipy       FFTW  chosen
    rfft              3 x 8192 float32       90.0 us       none  scipy
    """
    fftw = f"{facts['fftw']}, pyfftw {facts['pyfftw']}" if facts["pyfftw"] else "not installed"
    wisdom = facts["wisdom_file"] if facts["wisdom_kept"] else "none"
    lines = [
        f"mode    {facts['mode']} (WEARSTATE_FFT: {', '.join(facts['modes'])}), one thread",
        f"scipy   {facts['scipy']}",
        f"FFTW    {fftw}",
        f"wisdom  {wisdom}",
        "",
        f"{'transform':16}  {'data':19}  {'scipy':>9}  {'FFTW':>9}  chosen",
    ]
    for choice in facts["choices"]:
        data = f"{choice['rows']} x {choice['samples']} {choice['dtype']}"
        times = [_microseconds(choice.get(f"{engine}_s")) for engine in ("scipy", "fftw")]
        lines.append(
            f"{choice['transform']:16}  {data:19}  {times[0]:>9}  {times[1]:>9}  {choice['engine']}"
        )
    return "\n".join(lines)


def _microseconds(duration: float | None) -> str:
    return "none" if duration is None else f"{1e6 * duration:.1f} us"
