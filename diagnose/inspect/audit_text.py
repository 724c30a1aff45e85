"""Result of an audit as text and for programs."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ...datasets.audit.audit import UNSEEN, Audit, AuditSource
from ...datasets.audit.table import Finding
from ...datasets.file.record import DataSet

_WIDTH = 100
_SHOWN = 6  # examples of a finding

_VERDICTS = {
    "alarm": "ALARM: do not trust results from these data until this is corrected.",
    "warning": "WARNING: look at this before trusting figures from these data.",
    "clean": "CLEAN: nothing was found that spoils figures from these data.",
}


def audit_table(found: Audit) -> dict[str, Any]:
    """An audit ready for JSON.

    Parameters
    ----------
    found : Audit
        Audit from :func:`~..datasets.audit.audit`.

    Returns
    -------
    dict
        ``verdict`` first, then ``sources``, ``findings``, ``checked``, ``unchecked``, ``unseen``.
    """
    return {
        "verdict": found.verdict,
        "sources": [{**asdict(source), "path": str(source.path)} for source in found.sources],
        "findings": [asdict(finding) for finding in found.findings],
        "checked": list(found.checked),
        "unchecked": list(found.unchecked),
        "unseen": list(UNSEEN),
    }


def audit_text(found: Audit) -> str:
    """An audit as a text report: the verdict, the findings, what was not checked.

    Parameters
    ----------
    found : Audit
        Audit from :func:`~..datasets.audit.audit`.

    Examples
    --------
    >>> audit_text(Audit(sources=(), findings=(), checked=(), unchecked=())).splitlines()[0]
    'CLEAN: nothing was found that spoils figures from these data.'
    """
    lines = [_VERDICTS[found.verdict], *map(_source_line, found.sources)]
    for number, finding in enumerate(found.findings, 1):
        lines += ["", *_finding_lines(number, finding)]
    lines += ["", *_list("Looked for", found.checked), *_list("Not looked for", found.unchecked)]
    return "\n".join([*lines, *_list("No audit sees", UNSEEN)])


def splits_table(data: DataSet) -> dict[str, Any]:
    """Splits of a data set ready for JSON.

    Parameters
    ----------
    data : DataSet
        Any data set.

    Returns
    -------
    dict
        ``path``, ``records`` and ``splits``: by name, the records of each side and the description.
    """
    sides = {name: data.split(name) for name in data.splits}
    return {
        "path": str(data.path),
        "records": len(data),
        "splits": {
            name: {"train": len(train), "test": len(test), **data.splits[name]}
            for name, (train, test) in sides.items()
        },
    }


def splits_text(value: Mapping[str, Any]) -> str:
    """Splits of a data set, two lines each.

    Parameters
    ----------
    value : mapping
        Table from :func:`splits_table`.

    Examples
    --------
    >>> print(splits_text({"path": "data.h5", "records": 9, "splits": {}}))
    data.h5: 9 records, no splits; add some with --defaults or --add
    """
    if not value["splits"]:
        head = f"{value['path']}: {value['records']} records"
        return f"{head}, no splits; add some with --defaults or --add"
    lines = [f"{value['path']}: {value['records']} records, {len(value['splits'])} splits"]
    for name, split in value["splits"].items():
        neither = value["records"] - split["train"] - split["test"]
        rest = f", {neither} in neither" if neither else ""
        lines.append(f"  {name}: {split['train']} train, {split['test']} test{rest}")
        lines.append(_wrapped(split["text"], "    ", "    "))
    return "\n".join(lines)


def _source_line(source: AuditSource) -> str:
    rows = "records" if source.kind == "data set" else "rows"
    classes = ", ".join(f"{count} of {name}" for name, count in source.classes.items())
    parts = [
        f"{source.rows} {rows}, {source.columns} columns",
        f"label {source.label} ({classes})" if source.label else "no label",
        "machines not known" if source.machines is None else f"{source.machines} machines",
    ]
    if source.splits:
        parts.append(f"splits {', '.join(source.splits)}")
    role = f", {source.side}" if source.side else ""
    return _wrapped(f"{source.path.name} ({source.kind}{role}): {'; '.join(parts)}", "  ", "    ")


def _finding_lines(number: int, finding: Finding) -> Iterator[str]:
    head = f"{number}. {finding.severity}, {finding.where}: {finding.what}."
    yield _wrapped(head, "", "   ")
    yield from (_wrapped(text, "     ", "       ") for text in _examples(finding))
    yield _wrapped(f"Means: {finding.means}.", "   ", "   ")
    yield _wrapped(f"Do: {finding.cure}.", "   ", "   ")


def _examples(finding: Finding) -> Iterator[str]:
    """Values behind a finding, if showing them helps."""
    numbers = finding.numbers
    examples: Sequence[Mapping[str, Any]] = numbers.get("examples", ())
    for example in examples[:_SHOWN]:
        values = ", ".join(f"{value:.6g} in {name}" for name, value in example["values"].items())
        yield f"{example['name']} = {values}"
    if numbers.get("found", 0) > _SHOWN:
        yield f"and {numbers['found'] - _SHOWN} more"
    if finding.code == "readable-column":
        for name, accuracy in list(numbers["accuracy"].items())[:_SHOWN]:
            yield f"{name}: {accuracy:.1%}"
    if finding.code == "confounded":
        for name, value in numbers.items():
            strength, chance = value["rank_correlation"], value["by_chance"]
            yield f"{name}: rank correlation {strength:.2f}, by chance {chance:.1g}"


def _list(title: str, entries: Sequence[str]) -> list[str]:
    if not entries:
        return []
    return [f"{title}:", *(_wrapped(entry, "  - ", "    ") for entry in entries)]


def _wrapped(text: str, first: str, rest: str) -> str:
    return textwrap.fill(
        text,
        _WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
