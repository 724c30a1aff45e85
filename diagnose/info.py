"""What a file is, checked while reading it."""

from pathlib import Path
from typing import Any

from ..datasets.importers import read_recording
from ..datasets.record import DataError, DataSet
from .estimate import load_model


def describe(path: Path) -> dict[str, Any]:
    """Describe a data set, a recording or a model.

    Parameters
    ----------
    path : Path
        ``.h5``, ``.mat`` or ``.wsm``.

    Returns
    -------
    dict
        Plain values, ``kind`` first.

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


def _describe_model(path: Path) -> dict[str, Any]:
    model = load_model(path)
    card = model.card
    trained = card["trained_on"]
    return {
        "kind": "wear model",
        "created by": card["created_by"],
        "trained on": f"{trained['records']} {card['origin']} records, {trained['draws']} draws",
        "scene": trained["scene"],
        "recipe": trained["recipe"],
        "channels": ", ".join(f"{c['name']} [{c['unit']}]" for c in card["channels"]),
        "tacho": card["tacho"] or "none",
        "sample rate": f"{card['sample_rate_hz']:g} Hz",
        "severity": card["severity"],
        "trained range": " to ".join(f"{1e3 * v:.3g} mm" for v in card["severity_range_m"]),
        "grades from": ", ".join(f"{1e3 * v:.3g} mm" for v in card["grade_edges_m"]),
        "limit source": card["limit_source"],
        "notice": model.notice,
    }


def _describe_data(path: Path) -> dict[str, Any]:
    with DataSet(path) as data:
        head, manifest = data.attributes, data.manifest
        for index in range(len(data)):  # every signal against its checksum
            data[index]
        first = data[0]
    grades = manifest["grade"].value_counts().sort_index()
    described = {
        "kind": "data set" if len(manifest) > 1 else "recording",
        "origin": head.origin,
        "created by": head.created_by,
        "records": len(manifest),
        "machine draws": int(manifest["group"].nunique()),
        "status": ", ".join(f"{n} {s}" for s, n in manifest["status"].value_counts().items()),
        "grades": ", ".join(f"{n} of {_grade(g)}" for g, n in grades.items()),
        "channels": ", ".join(channel.label for channel in head.channels),
        "tacho": head.tacho or "none",
        "sample rate": f"{head.sample_rate:g} Hz",
        "duration": f"{first.duration:g} s each",
        "checksums": "all signals intact",
    }
    for column in head.severities:
        low, high = manifest[column].min(), manifest[column].max()
        described[column] = f"{1e3 * low:.4g} to {1e3 * high:.4g} mm"
    if head.limit_source:
        described["limit"] = f"{1e3 * head.condemning_limit:.3g} mm ({head.limit_source})"
    return described


def _grade(grade: Any) -> str:
    return "unknown grade" if grade < 0 else f"grade {grade}"


def _describe_recording(path: Path) -> dict[str, Any]:
    recording = read_recording(path)
    return {
        "kind": "recording",
        "origin": recording.origin,
        "channels": ", ".join(channel.label for channel in recording.channels),
        "tacho": recording.tacho or "none",
        "sample rate": f"{recording.sample_rate:g} Hz",
        "samples": recording.signal.shape[1],
        "duration": f"{recording.duration:g} s",
        "rms": ", ".join(
            f"{name} {row.std():.4g}"
            for name, row in zip(recording.vibration_names, recording.vibration, strict=True)
        ),
        **{str(key): value for key, value in recording.row.items()},
    }
