"""Results of an import, and contents of files, as text."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ...datasets.measured.data_set import ImportSummary

_SHOWN = 3  # pairs of twins


def imported_table(summary: ImportSummary) -> dict[str, Any]:
    """A summary ready for JSON; names include the SI unit.

    Parameters
    ----------
    summary : ImportSummary
        Summary from :func:`~..datasets.import_set.import_recordings`.
    """
    value = asdict(summary) | {"path": str(summary.path)}
    for name, unit in (
        ("sample_rate", "hz"),
        ("duration", "s"),
        ("left_over", "s"),
        ("speeds", "hz"),
    ):
        value[f"{name}_{unit}"] = value.pop(name)
    return value


def imported_text(summary: ImportSummary) -> str:
    """A summary in lines: what was made, then what was left out.

    Parameters
    ----------
    summary : ImportSummary
        Summary from :func:`~..datasets.import_set.import_recordings`.
    """
    grades = [f"{count} of grade {grade}" for grade, count in summary.grades.items() if grade >= 0]
    return "\n".join(
        [
            f"{summary.path}: {summary.n_records} measured records of {summary.duration:.6g} s "
            f"from {summary.n_files} file(s), {summary.n_groups} group(s)",
            f"  {', '.join(summary.channels)} at {summary.sample_rate:.10g} Hz",
            f"  severities: {', '.join(summary.severities) or 'none'}; "
            f"labels: {', '.join(summary.labels) or 'none'}",
            *([f"  {', '.join(grades)}"] if grades else []),
            *([f"  tacho shows {_span(summary.speeds)} Hz"] if summary.speeds else []),
            *_omissions(summary),
            *_twin_lines(summary.twins),
        ]
    )


def _span(values: Sequence[float]) -> str:
    return " to ".join(dict.fromkeys(f"{value:.4g}" for value in values))


def empty_text(summary: ImportSummary) -> str:
    """Channels left out because they hold no numbers; empty if there are none.

    Parameters
    ----------
    summary : ImportSummary
    """
    kinds = Counter(summary.empty.values())
    return "; ".join(
        f"{', '.join(names)} in {count} of {summary.n_files} file(s)"
        for names, count in kinds.most_common()
    )


def _omissions(summary: ImportSummary) -> list[str]:
    lines = [
        f"  {count} with status {status}, left out of features"
        for status, count in summary.statuses.items()
        if status != "ok"
    ]
    rest = summary.left_over.values()
    if rest:
        lines.append(
            f"  {sum(rest):.4g} s at the end of {len(rest)} file(s) fill no record and are left "
            f"out, at most {max(rest):.4g} s of one"
        )
    if summary.unused_rows:
        lines.append(f"  {summary.unused_rows} row(s) of the labels are about other files")
    return lines


def _twin_lines(twins: Sequence[tuple[str, str]]) -> list[str]:
    lines = [
        f"  {one} and {other} hold the same record and count as two machines: give them one group"
        for one, other in twins[:_SHOWN]
    ]
    more = len(twins) - _SHOWN
    return [*lines, f"  and {more} more such pairs"] if more > 0 else lines


def contents_text(found: Sequence[Mapping[str, Any]]) -> str:
    """Contents of files, a paragraph for each.

    Parameters
    ----------
    found : sequence of mapping
        Contents from :func:`~..datasets.importers.list_contents`.
    """
    lines = []
    for item in found:
        lines.append(item["file"])
        lines += [line for part in item["recordings"] for line in _part_lines(part)]
        lines += [f"  {line}" for line in item["fault"].splitlines()]
        if not item["recordings"] and not item["fault"]:
            lines.append("  no array that can be a recording")
    return "\n".join(lines)


def _part_lines(part: Mapping[str, Any]) -> list[str]:
    rate = part["sample_rate_hz"]
    size = f"{part['samples']} samples, rate not declared"
    if rate is not None:
        size = f"{part['samples']} samples at {rate:.10g} Hz, {part['duration_s']:.6g} s"
    if part["records"] > 1:
        size = f"{part['records']} records of {size}"
    channels = [f"{c['name']} [{c['unit_in_file'] or 'not declared'}]" for c in part["channels"]]
    conditions = [f"{name} = {value:.6g}" for name, value in part["conditions"].items()]
    about = [", ".join(words) for words in (channels, conditions) if words]
    if part["variable"] and len(channels) == 1:
        return [f"  {part['variable']}: {'; '.join([size, *about])}"]
    return [f"  {part['variable'] or 'recording'}: {size}", *(f"    {line}" for line in about)]
