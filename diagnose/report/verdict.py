"""The verdict on one recording as a table, from which page, text and JSON are made."""

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import NormalDist
from typing import Any

from ... import __version__
from ...features.signal import iso
from ...sim.output.recording import DataError, Recording
from ..feature_rows.feature_choice import choice_in, words_of
from ..feature_rows.feature_table import is_regime, regime_words
from ..feature_rows.model_card import ModelCard
from ..feature_rows.noted import NOTED
from ..healthy_reference.healthy import Baseline
from ..learning.grades import GRADE_NAMES
from ..nameplate.cautions import unseen_texts
from ..nameplate.nameplate import Nameplate, condition_origin, day_of
from ..nameplate.sensors import corrected_recording, correction_words
from ..pages.si_text import si_text
from ..pages.words import quantity_name
from ..pictures.view import View
from ..twin.opinion import TwinOpinion
from ..wear_model.estimate import WearModel, input_faults
from ..wear_model.verdict import Estimate, unseen_words
from .advice import advise, touched_grades
from .film import film_estimate, film_table, with_film
from .second_estimate import (
    ModelOpinion,
    new_cautions,
    other_model_table,
    relied_on_grade,
    twin_table,
    with_other_model,
    with_twin,
)
from .trend import Outlook

REPORT_SCHEMA = 2

LARGEST_HASHED = 2**28
"""Larger files [byte] are identified by the hash of their samples alone: hashing the whole file
would take longer than the report."""

MAP_CELL = re.compile(r"(.+)\.angle_(\d+)_(\d+)\.band_(\d+)_(\d+)\.level_db")
"""Name of a feature: level in a crank-angle bin and a frequency band."""

NO_REFERENCE = "Healthy reference missing"
"""Headline of a sound recording whose model needs healthy recordings of the machine."""

_CHANCE = 0.05  # that the farthest feature of a healthy machine exceeds the bound
_SURE = 0.9  # confidence in the boundaries of a zone; below it they need confirmation
_SHOWN = {  # SI unit -> displayed unit, factor
    "m": ("µm", 1e6),
    "m/s": ("mm/s", 1e3),
    "m/s^2": ("m/s²", 1.0),
    "Pa": ("kPa", 1e-3),
}
_LEVELS = ("suction", "discharge", "suction_ripple", "discharge_ripple")
_SIZES = ("rms", "peak", "peak_to_peak", *_LEVELS)  # features in the unit of their channel


def report_table(
    recording: Recording,
    model: WearModel,
    estimate: Estimate,
    *,
    machine: str | None = None,
    baseline: Baseline | None = None,
    plate: Nameplate | None = None,
    twin: TwinOpinion | None = None,
    other: ModelOpinion | None = None,
    outlook: Outlook | None = None,
    files: Mapping[str, Path] | None = None,
) -> dict[str, Any]:
    """Content of the report, ready for JSON.

    Parameters
    ----------
    recording : Recording
    model : WearModel
    estimate : Estimate
        Estimate of the model for the recording.
    machine : str, optional
        Kind of machine for its ISO zone, a key of :data:`wearstate.features.signal.iso.KINDS`.
    baseline : Baseline, optional
        Healthy recordings used for the estimate.
    plate : Nameplate, optional
        Nameplate of the machine, for the estimate by film equilibrium.
    twin : TwinOpinion, optional
        Estimate by the twin of the machine.
    other : ModelOpinion, optional
        Estimate by another wear model.
    outlook : Outlook, optional
        Outlook of the machine's trend; it may shorten the horizon.
    files : mapping, optional
        ``recording``, ``model``: files to be hashed.

    Returns
    -------
    dict
        ``schema_version``, ``headline``, ``recording``, ``estimate``, ``conditions`` (those that
        the estimate uses, with their origin), ``film`` (estimate by the film equilibrium, None if
        there is none for this machine), ``twin`` (estimate by the twin, or None), ``other_model``
        (estimate by another model, or None), ``disagreements`` (of these with the model),
        ``grades_text``, ``advice``, ``limits``, ``iso``, ``outlook``, ``evidence_summary``,
        ``evidence``, ``baseline_note``, ``unseen`` (effects that mislead the model without a
        warning), ``notice``, ``provenance``.
        Lengths in metres, speeds in revolutions per second.

    Raises
    ------
    DataError
        The kind of machine is unknown.
    """
    card = model.card
    quantity = quantity_name(card.severity)
    corrections = correction_words(recording, plate, baseline)
    film = film_estimate(recording, card.severity, plate, baseline)
    trained, estimate = estimate, with_other_model(estimate, other)
    estimate = with_twin(with_film(estimate, film), twin)
    return {
        "schema_version": REPORT_SCHEMA,
        "headline": headline(estimate),
        "recording": _recording_table(recording, card, corrections),
        "estimate": estimate.as_dict(),
        "film": film_table(film, plate, recording.row),
        "twin": twin_table(twin, trained),
        "conditions": conditions_table(estimate, plate, recording.row),
        "other_model": other_model_table(other, trained),
        "disagreements": new_cautions(trained, estimate),
        "grades_text": possible_words(estimate, card.grade_edges_m),
        "advice": asdict(
            advise(
                estimate,
                quantity,
                card.grade_edges_m,
                outlook,
                larger=relied_on_grade(trained, other),
            )
        ),
        "limits": limits_table(card),
        # an absolute level: known sensor errors are removed even if healthy recordings share them
        "iso": iso_table(corrected_recording(recording, plate), machine),
        "outlook": None if outlook is None else asdict(outlook),
        "evidence_summary": _quiet_words(estimate, len(model.names))
        or evidence_summary([item[:3] for item in estimate.evidence]),
        "evidence": [
            {"feature": name, "value": value, "healthy": healthy, "moved": moved}
            | {"words": evidence_words(name, value, healthy, recording.units)}
            for name, value, healthy, moved in estimate.evidence
        ],
        "baseline_note": baseline_note(model, baseline),
        "unseen": unseen_texts(card, _also_drawn(other)) if estimate.graded else [],
        "notice": model.notice,
        "provenance": {
            "program": f"wearstate {__version__}",
            "recording": {
                "samples_sha256": hashlib.sha256(recording.signal.tobytes()).hexdigest(),
                "file_sha256": _file_hash((files or {}).get("recording")),
            },
            "model": model_table(model, (files or {}).get("model")),
            "baseline": None
            if baseline is None
            else {"source": baseline.source, "recordings": baseline.recordings},
        },
    }


def conditions_table(
    estimate: Estimate, plate: Nameplate | None, row: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Operating conditions that an estimate uses: path, column, value [SI], unit, origin, text."""
    known = day_of(plate, row)
    return [
        {
            "path": (path := NOTED[column].setting.partition("=")[0]),
            "column": column,
            "value": float(known[column]),
            "unit": NOTED[column].unit,
            "origin": (origin := condition_origin(plate, row, column)),
            "text": f"{path} = {si_text(known[column], NOTED[column].unit)} ({origin})",
        }
        for column in estimate.noted
    ]


def _also_drawn(other: ModelOpinion | None) -> str:
    """Recipe of another model whose estimate stands next to this one; empty if there is none."""
    return "" if other is None or other.severity is None else other.trained_on


def baseline_note(model: WearModel, baseline: Baseline | None) -> str:
    """How healthy recordings of the machine affected the estimate; empty if it is based on them."""
    if model.mode == "referenced":
        return ""
    if baseline is None:
        return (
            "no healthy recording of this machine was used: the reference is the model's as-new "
            "machines"
        )
    return (
        "the model was trained without healthy recordings: the evidence is compared with the "
        "baseline, but the estimate does not use it; for that, train with --baseline"
    )


def headline(estimate: Estimate) -> str:
    """The verdict in one line.

    Examples
    --------
    >>> headline(Estimate(verdict="graded", grade=1, grade_name="worn", possible_grades=(1,)))
    'Grade 1 of 3: worn'
    """
    if estimate.verdict == "unfamiliar":
        return "Unfamiliar: no grade is given"
    if estimate.unreferenced:
        return f"{NO_REFERENCE}: no grade is given"
    if estimate.verdict == "unusable":
        return "Unusable recording: no grade is given"
    words = f"Grade {estimate.grade} of {len(GRADE_NAMES) - 1}: {estimate.grade_name}"
    return f"{words}, with caution" if estimate.verdict == "caution" else words


def _recording_table(recording: Recording, card: ModelCard, corrections: str) -> dict[str, Any]:
    return {
        "source": recording.source,
        "origin": recording.origin,
        "channels": [asdict(channel) for channel in recording.channels],
        "label": _recording_line(recording)
        + (f"; corrected in the readings: {corrections}" if corrections else ""),
        "taken_out": corrections,
        "tacho": recording.tacho,
        "sample_rate_hz": recording.sample_rate,
        "duration_s": recording.duration,
        "rms": {
            channel.name: float(row.std())
            for channel, row in zip(recording.vibration_channels, recording.vibration, strict=True)
        },
        "views": {name: each.source for name, each in recording.joined.items()},
        "fits_model_inputs": not input_faults(recording, card),
    }


def _recording_line(recording: Recording) -> str:
    channels = ", ".join(channel.label for channel in recording.channels)
    views = "".join(f"; {name}: {each.source}" for name, each in recording.joined.items())
    return (
        f"{recording.source}: {recording.origin}, {recording.duration:.3g} s at "
        f"{recording.sample_rate:g} Hz, {channels}{views}"
    )


def limits_table(card: ModelCard) -> dict[str, Any]:
    """Limits of a model's severity, with their source."""
    return {
        "severity": card.severity,
        "quantity": quantity_name(card.severity),
        "grade_edges_m": card.grade_edges_m,
        "grade_names": list(GRADE_NAMES),
        "condemning_limit_m": card.condemning_limit_m,
        "source": card.limit_source,
    }


def model_table(model: WearModel, path: Path | None = None) -> dict[str, Any]:
    """Origin of a model, and its accuracy in training."""
    card, trained = model.card, model.card.trained_on
    return {
        "file_sha256": _file_hash(path),
        "created_by": card.created_by,
        "origin": card.origin,
        "mode": card.mode,
        "features": words_of(choice_in(card.feature_choice)),
        "chosen": card.model.chosen,
        "nested_mae_m": card.model.nested_mae_m,
        "scene": trained.scene,
        "recipe": trained.recipe,
        "records": trained.records,
        "draws": trained.draws,
        "draw_identity": trained.draw_identity,
        "split_seed": trained.split_seed,
    }


def _file_hash(path: Path | None) -> str | None:
    """SHA-256 of a file, as from ``sha256sum``; None if it is too large."""
    if path is None or path.stat().st_size > LARGEST_HASHED:
        return None
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


# --- vibration severity zone


def known_machine(machine: str | None) -> None:
    """Reject an unknown kind of machine before any work.

    Raises
    ------
    DataError
        The kind is not in :data:`wearstate.features.signal.iso.KINDS`.
    """
    try:
        iso.machine_kind(machine or next(iter(iso.KINDS)))
    except ValueError as error:
        raise DataError(str(error).replace("kind = ", "machine = ", 1)) from error


def iso_table(recording: Recording, machine: str | None) -> dict[str, Any]:
    """Vibration severity and its zone, or the reason for none.

    Parameters
    ----------
    recording : Recording
    machine : str, optional
        Key of :data:`wearstate.features.signal.iso.KINDS`; it cannot be inferred from a signal.

    Returns
    -------
    dict
        ``machine``, ``standard``, ``band_hz``, ``channels`` (name, place, velocity [m/s], zone),
        ``zone`` (the worst), ``note`` (how to read it, or why there is none).

    Raises
    ------
    DataError
        The kind is unknown.
    """
    table: dict[str, Any] = {
        "machine": machine,
        "standard": None,
        "band_hz": None,
        "channels": [],
        "zone": None,
        "note": "",
    }
    if machine is None:
        table["note"] = "the kind of machine is not given, and no signal shows it: --machine KIND"
        return table
    known_machine(machine)
    kind = iso.machine_kind(machine)
    table["standard"] = kind.standard
    housings = [c.quantity == "acceleration" for c in recording.vibration_channels]
    if not any(housings):
        table["note"] = (
            "the zones are of the velocity of housings, and the recording has no channel of "
            "acceleration"
        )
        return table
    try:
        band = iso.iso_band(machine, View(recording=recording).speed)
        velocity = iso.velocity_rms(recording.vibration[housings], recording.sample_rate, band=band)
    except ValueError as error:
        table["note"] = str(error)
        return table
    zones = iso.zone(velocity, machine)
    channels = [c for c, kept in zip(recording.vibration_channels, housings, strict=True) if kept]
    table["band_hz"] = list(band)
    table["channels"] = [
        {
            "name": channel.name,
            "place": channel.place,
            "velocity_m_s": float(value),
            "zone": iso.ZONES[i],
        }
        for channel, value, i in zip(channels, velocity, zones, strict=True)
    ]
    table["zone"] = iso.ZONES[int(zones.max())]
    table["note"] = _zone_note(kind)
    return table


def _zone_note(kind: iso.MachineKind) -> str:
    note = f"{kind.machine}; the zone is of the whole machine's vibration, not of one joint's wear"
    if kind.confidence < _SURE:
        note += "; confirm the boundaries in the standard before a contract relies on them"
    return note


# --- words


def evidence_words(
    name: str, value: float, healthy: float, units: Mapping[str, str] | None = None
) -> str:
    """Change of a feature, with its unit.

    Parameters
    ----------
    name : str
        Name of the feature.
    value, healthy : float
        Value of the recording, and of the healthy reference.
    units : mapping, optional
        Unit of each channel.

    Examples
    --------
    >>> evidence_words("acc_x.order_02.level_db", -8.0, -14.0)
    '6.0 dB stronger: 2.0 times the amplitude'
    >>> evidence_words("acc_x.order_02.level_db", -50.4, -14.0)
    '36.4 dB weaker: 0.015 times the amplitude'
    >>> evidence_words("acc_x.rms", 12.0, 6.0, {"acc_x": "m/s^2"})
    '12 m/s² instead of 6'
    >>> evidence_words("p.discharge", 3.5e5, 3.1e5, {"p": "Pa"})
    '350 kPa instead of 310'
    """
    owner, last = name.split(".", 1)[0], name.rsplit(".", 1)[-1]
    if last == "level_db":
        side = "stronger" if value > healthy else "weaker"
        ratio = 10 ** ((value - healthy) / 20)
        return f"{abs(value - healthy):.1f} dB {side}: {_times(ratio)} times the amplitude"
    if last.endswith("_db"):
        return f"{value:.1f} dB instead of {healthy:.1f}"
    unit, factor = {"hz": "Hz", "deg": "°"}.get(last.rpartition("_")[2], ""), 1.0
    if last in _SIZES:
        unit = (units or {}).get(owner, "")
        unit, factor = _SHOWN.get(unit, (unit, 1.0))
    present = f"{factor * value:.3g} {unit}".rstrip()
    return f"{present} instead of {factor * healthy:.3g}"


def _quiet_words(estimate: Estimate, n_features: int) -> str:
    """Statement that nothing stands out, if chance explains even the largest of many changes."""
    farthest = max((abs(moved) for *_, moved in estimate.evidence), default=math.inf)
    chance = NormalDist().inv_cdf(1 - _CHANCE / (2 * n_features))
    if farthest > chance:
        return ""
    return (
        f"nothing stands out: of {n_features} features of a healthy machine the farthest can lie "
        f"{chance:.1f} standard deviations off by chance, here it is {farthest:.1f}"
    )


def evidence_summary(evidence: Sequence[tuple[str, float, float]]) -> str:
    """Crank angles and frequencies of most of the evidence, if it consists of such levels.

    Parameters
    ----------
    evidence : sequence of (str, float, float)
        Feature, its value, the healthy value.

    Returns
    -------
    str
        For each channel the range of its cells, the channel with most cells first; empty for other
        evidence.

    Examples
    --------
    >>> evidence_summary([("acc_x.angle_040_050.band_4350_5250.level_db", -8.0, -14.0),
    ...                   ("acc_x.angle_060_070.band_350_450.level_db", -8.0, -18.0)])
    'acc_x: stronger by 6 to 10 dB between 40 and 70°, 350 and 5250 Hz'
    >>> evidence_summary([("acc.angle_350_360.band_350_450.level_db", 6.0, 0.0),
    ...                   ("acc.angle_000_010.band_350_450.level_db", 6.0, 0.0)])
    'acc: stronger by 6 dB between 350 and 10°, 350 and 450 Hz'
    """
    cells: dict[tuple[str, str], list[tuple[list[int], float]]] = {}
    for name, value, healthy in evidence:
        match = MAP_CELL.fullmatch(name)
        if match is not None:
            side = "stronger" if value > healthy else "weaker"
            place = [int(number) for number in match.groups()[1:]]
            cells.setdefault((match[1], side), []).append((place, abs(value - healthy)))
    found = sorted(cells.items(), key=lambda item: -len(item[1]))
    return "; ".join(_span_words(*key, of) for key, of in found if len(of) > 1)


def _span_words(channel: str, side: str, cells: Sequence[tuple[list[int], float]]) -> str:
    left, right, low, high = zip(*(place for place, _ in cells), strict=True)
    least, most = (f"{size(change for _, change in cells):.0f}" for size in (min, max))
    by = least if least == most else f"{least} to {most}"
    begin, end = _arc(left, right)
    return f"{channel}: {side} by {by} dB between {begin} and {end}°, {min(low)} and {max(high)} Hz"


def _arc(left: Sequence[int], right: Sequence[int]) -> tuple[int, int]:
    """Ends of the shortest arc that contains all bins; it may cross 0 degrees."""
    begins = sorted(set(left))
    ends = {
        begin: max(r for b, r in zip(left, right, strict=True) if b == begin) for begin in begins
    }
    gaps = [
        ((after - ends[before]) % 360, after, ends[before])
        for before, after in zip(begins, begins[1:] + begins[:1], strict=True)
    ]
    _, begin, end = max(gaps)
    return begin, end


def _times(ratio: float) -> str:
    """A ratio to two digits, or whole from 10 on."""
    if ratio < 1:
        return f"{ratio:.2g}"
    return f"{ratio:.1f}" if ratio < 10 else f"{ratio:.0f}"


def millimetres(estimate: Mapping[str, Any]) -> str:
    """Severity with its interval [mm]."""
    return (
        f"{1e3 * estimate['severity']:.3f} mm ({1e3 * estimate['low']:.3f} to "
        f"{1e3 * estimate['high']:.3f}, {100 * estimate['coverage']:.0f} %)"
    )


def grades_words(grades: tuple[int, ...] | list[int]) -> str:
    """Possible grades by number and name.

    Examples
    --------
    >>> grades_words((0, 1, 2))
    '0 (as new), 1 (worn) or 2 (plan renewal)'
    """
    *first, last = [f"{grade} ({GRADE_NAMES[grade]})" for grade in grades]
    return f"{', '.join(first)} or {last}" if first else last


def possible_words(estimate: Estimate, edges: Sequence[float]) -> str:
    """Grades that cannot be excluded, and an explanation if the interval disagrees.

    Parameters
    ----------
    estimate : Estimate
    edges : sequence of float
        Lower bounds of grades 1, 2, … [m].

    Returns
    -------
    str
        Empty if only one is possible and the interval stays within it.

    Examples
    --------
    >>> found = Estimate(verdict="graded", grade=2, possible_grades=(2,), low=2.4e-4, high=3.1e-4)
    >>> possible_words(found, (1e-4, 2e-4, 3e-4))
    'grade 2 (plan renewal); the interval, calibrated by itself, also reaches 3 (condemned)'
    >>> few = {"possible_grades": (1, 2, 3), "low": 1.1e-4, "high": 1.3e-4}
    >>> words = possible_words(Estimate(verdict="graded", grade=1, **few), (1e-4, 2e-4, 3e-4))
    >>> words.partition("; ")[2].partition(",")[0]
    'the interval keeps away from 3 (condemned)'
    """
    possible, touched = estimate.possible_grades, touched_grades(estimate, edges)
    far = [g for g in possible if touched and not touched[0] - 1 <= g <= touched[-1] + 1]
    beyond = [g for g in touched if g not in possible]
    if len(possible) < 2 and not beyond:
        return ""
    words = [f"grade {grades_words(possible)}"]
    if far:
        words.append(
            f"the interval keeps away from {grades_words(far)}, but the model has seen too few "
            "machines of such a grade, or estimates them too poorly, to exclude it: train on more"
        )
    if beyond:
        also = " and ".join(grades_words([grade]) for grade in beyond)
        words.append(f"the interval, calibrated by itself, also reaches {also}")
    return "; ".join(words)


def finding_words(finding: Mapping[str, Any]) -> str:
    """Another fault than the wear, or a regime, with the reliability of the finding.

    Examples
    --------
    >>> rates = {"detection_rate": 0.88, "false_alarm_rate": 0.02}
    >>> finding_words({"name": "cavitation", "present": True, "probability": 0.93, **rates})
    'cavitation: present (93 %; of 100 such records 88 are found, of 100 others 2 are called so)'
    >>> finding_words({"name": "lubrication_dry", "present": True, "probability": 0.93, **rates})
    'sounds like a dry pin (93 %; of 100 such records 88 are found, of 100 others 2 are called so)'
    """
    name, present = finding["name"], finding["present"]
    if is_regime(name):
        found = f"{'sounds' if present else 'does not sound'} like a {regime_words(name)}"
    else:
        found = f"{name.replace('_', ' ')}: {'present' if present else 'not found'}"
    unseen = unseen_words(name, finding.get("visible_from_m"))
    hidden = f"; {unseen}" if present and unseen else ""
    return (
        f"{found} ({100 * finding['probability']:.0f} %; of 100 such records "
        f"{100 * finding['detection_rate']:.0f} are found, of 100 others "
        f"{100 * finding['false_alarm_rate']:.0f} are called so){hidden}"
    )


def zone_words(table: Mapping[str, Any]) -> str:
    """The zone in a sentence, or the reason for none."""
    if table["zone"] is None:
        return f"not given: {table['note']}"
    worst = max(table["channels"], key=lambda channel: (channel["zone"], channel["velocity_m_s"]))
    low, high = table["band_hz"]
    return (
        f"{table['zone']} ({table['standard']}): {worst['name']} "
        f"{1e3 * worst['velocity_m_s']:.2g} mm/s rms, {low:g} to {high:g} Hz; {table['note']}"
    )
