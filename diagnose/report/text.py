"""The report for a terminal: one recording, or many."""

import textwrap
from collections.abc import Mapping
from typing import Any

from ..feature_rows.feature_choice import feature_words
from ..pages.words import severity_word
from .advice import brief_words
from .batch import Batch, BatchRow, machine_heading
from .second_estimate import is_first
from .verdict import finding_words, millimetres, zone_words

_WIDTH = 96  # of a line
_INDENT = 12
_MOST_CHANGES = 3


def report_text(table: Mapping[str, Any]) -> str:
    """The report on one recording, verdict first.

    Parameters
    ----------
    table : mapping
        From :func:`wearstate.diagnose.report.verdict.report_table`.
    """
    estimate, limits, advice = table["estimate"], table["limits"], table["advice"]
    lines = [("Recording", table["recording"]["label"])]
    lines += [("Disagree", text) for text in table["disagreements"]]
    lines.append(("Verdict", table["headline"]))
    lines += [("  because", reason) for reason in estimate["reasons"]]
    if estimate["severity"] is not None:
        share = estimate["severity"] / limits["condemning_limit_m"]
        lines += [
            (
                severity_word(limits["severity"]).capitalize(),
                f"{millimetres(estimate)}, {limits['quantity']}: {100 * share:.0f} % of the limit",
            ),
            ("Limit", f"{1e3 * limits['condemning_limit_m']:.3g} mm ({limits['source']})"),
        ]
        if table["grades_text"]:
            lines.append(("Possible", table["grades_text"]))
    lines += [("Given", each["text"]) for each in table["conditions"]]
    if table["film"] is not None:
        lines.append(("Film", f"equilibrium: {table['film']['text']}"))
    if table["twin"] is not None:
        lines.append(("Twin", table["twin"]["text"]))
    if table["other_model"] is not None:
        lines.append(("Other", table["other_model"]["text"]))
    lines.append(("Advice", advice["sentence"]))
    if advice["horizon"]:
        lines.append(("How soon", f"{advice['horizon']} ({advice['basis']})"))
    if table["outlook"] is not None:
        lines.append(("Trend", table["outlook"]["text"]))
    lines += [("Also", finding_words(f)) for f in estimate["confounders"] if f["present"]]
    lines += [("Caution", each) for each in estimate["cautions"] if not is_first(each, table)]
    if table["iso"]["machine"] is not None:
        lines.append(("ISO zone", zone_words(table["iso"])))
    lines += [("Moved", text) for text in _changes(table)]
    if estimate["p_value"] is not None:
        near = f"; nearest: {estimate['nearest']}" if estimate["nearest"] else ""
        limit = f"unfamiliar at {estimate['p_limit']:.2g} or less"
        lines.append(("Familiarity", f"p = {estimate['p_value']:.2g} ({limit}){near}"))
    if table["provenance"]["baseline"] and table["baseline_note"]:
        lines.append(("Baseline", table["baseline_note"]))
    lines += [("Not seen", text) for text in table["unseen"]]
    if table["notice"]:
        lines.append(("Notice", table["notice"]))
    return "\n".join(_folded(name, text) for name, text in lines)


def _changes(table: Mapping[str, Any]) -> list[str]:
    """What moved: the summary if there is one, else the largest changes."""
    if table["evidence_summary"]:
        return [table["evidence_summary"]]
    largest = table["evidence"][:_MOST_CHANGES]
    return [f"{feature_words(item['feature'])}: {item['words']}" for item in largest]


def _folded(name: str, text: str) -> str:
    return textwrap.fill(
        text,
        _WIDTH,
        initial_indent=name.ljust(_INDENT),
        subsequent_indent=" " * _INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )


def batch_text(batch: Batch) -> str:
    """The report on many recordings: counts, a line for each, the worst first, trends."""
    lines = [f"{batch.source}: {batch.summary()}"]
    width = max([len(row.name) for row in batch.rows] + [len("recording")])
    word = severity_word(batch.limits["severity"])
    lines.append(f"{'recording':{width}}  {'verdict':26}  {word + ' [mm]':22}  advice")
    lines += [_row_line(row, width) for row in batch.current]
    if any(row.estimate.verdict == "caution" for row in batch.current):
        lines.append("?: graded with caution; report that recording alone to see why")
    past = [row for row in batch.rows if not row.current]
    if past:
        lines.append(f"and {len(past)} earlier ones, in the trend")
    for machine, trend in batch.trends.items():
        said = trend.outlook.text if trend.outlook else trend.reason
        lines.append(_folded("Trend", f"{machine_heading(machine)}: {said}"))
    if batch.trends:
        lines.append(_folded("Assumes", _assumptions(batch)))
    if batch.undated:
        lines.append(_folded("Undated", batch.undated))
    if batch.notice:
        lines.append(_folded("Notice", batch.notice))
    return "\n".join(lines)


def _assumptions(batch: Batch) -> str:
    texts = {trend.outlook.assumption for trend in batch.trends.values() if trend.outlook}
    return "; ".join(sorted(texts)) or "no trend could be drawn"


def _row_line(row: BatchRow, width: int) -> str:
    found, advice, severity = row.estimate, row.advice, "-"
    if found.severity is not None and found.low is not None and found.high is not None:
        severity = f"{1e3 * found.severity:.3f} ({1e3 * found.low:.3f} to {1e3 * found.high:.3f})"
    note = row.note if found.grade is None else brief_words(advice.action, advice.horizon)
    return f"{row.name:{width}}  {row.headline:26}  {severity:22}  {_short(note)}"


def _short(text: str) -> str:
    return textwrap.shorten(text.replace("\n", " "), _WIDTH, placeholder=" …")
