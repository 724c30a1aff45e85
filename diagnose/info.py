"""What a file is, checked while reading it."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..datasets.importers import read_recording
from ..datasets.record import DataError, DataSet
from ..sim.sensor import Channel
from .modelfile import load_model
from .tabulate import confounders_in


def describe(path: Path) -> dict[str, Any]:
    """Describe a data set, a recording or a model.

    Parameters
    ----------
    path : Path
        ``.h5``, ``.mat`` or ``.wsm``.

    Returns
    -------
    dict
        ``kind`` first; names in snake case, numbers SI with the unit in the name, None where
        unknown.

    Raises
    ------
    DataError, ModelError
        The file is missing, damaged, or of no known kind.
    """
    if not path.is_file():
        raise DataError(f"{path} is no file; check the path")
    if path.suffix == ".wsm":
        return _describe_model(path)
    if path.suffix in (".h5", ".hdf5", ".part"):
        return _describe_data(path)
    return _describe_recording(path)


def description_text(described: Mapping[str, Any]) -> str:
    """A description as lines of name and value, in the units people use.

    Parameters
    ----------
    described : mapping
        From :func:`describe`.

    Examples
    --------
    >>> print(description_text({"kind": "recording", "sample_rate_hz": 25600.0}))
    kind         recording
    sample rate  25600 Hz
    """
    lines = dict(_line(key, value) for key, value in described.items())
    width = max(len(name) for name in lines)
    return "\n".join(f"{name:{width}}  {value}" for name, value in lines.items())


def _line(key: str, value: Any) -> tuple[str, str]:
    """Name and value of one entry, for people."""
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
"""Ending of a name, unit for people, factor to it."""


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


def _describe_model(path: Path) -> dict[str, Any]:
    model = load_model(path)
    card = model.card
    trained = card["trained_on"]
    return {
        "kind": "wear model",
        "created_by": card["created_by"],
        "origin": card["origin"],
        "trained_on": {"records": trained["records"], "draws": trained["draws"]},
        "scene": trained["scene"],
        "recipe": trained["recipe"],
        "channels": card["channels"],
        "tacho": card["tacho"],
        "sample_rate_hz": card["sample_rate_hz"],
        "severity": card["severity"],
        "severity_range_m": list(card["severity_range_m"]),
        "grade_edges_m": list(card["grade_edges_m"]),
        "limit_source": card["limit_source"],
        "notice": model.notice,
    }


def _describe_data(path: Path) -> dict[str, Any]:
    with DataSet(path) as data:
        head, manifest = data.attributes, data.manifest
        for index in range(len(data)):  # every signal against its checksum
            data[index]
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
    }


def _counts(column: Any) -> dict[str, int]:
    return {str(value): int(count) for value, count in column.value_counts().sort_index().items()}


def _describe_recording(path: Path) -> dict[str, Any]:
    recording = read_recording(path)
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
    }
