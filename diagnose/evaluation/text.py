"""Figures of an evaluation as text for a terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..feature_rows.feature_choice import choice_in, words_of
from ..feature_rows.feature_table import FeatureSelection, kind_words
from ..feature_rows.model_card import ModelCard
from ..learning.scores import LEVEL
from ..pages.words import severity_word

_FEW_RECORDS = 30


def features_text(
    card: ModelCard, choices: Sequence[FeatureSelection], costs: Sequence[float]
) -> list[str]:
    """Features of a model, the alternatives, and their computing times.

    Parameters
    ----------
    card : ModelCard
        Card of the model.
    choices : sequence of FeatureSelection
        Feature selections that the training could choose from.
    costs : sequence of float
        Time of the features of one recording for each selection [ms].
    """
    mine = choice_in(card.feature_choice)
    tried = {each.name: each for each in card.feature_choice.candidates}
    lines = []
    for choice, cost in zip(choices, costs, strict=True):
        name = words_of(choice)
        if not tried:
            count = len(card.features)
            lines.append(f"Features: {name}, {count} values of a recording in {cost:.3g} ms")
            continue
        about = tried[name]
        lines.append(
            f"{'Features:' if choice == mine else '      not'} {name}, {about.values} values in "
            f"{cost:.3g} ms; cross-validated linear error {1e6 * about.line_mae_m:.3g} um"
        )
    if tried:
        nested = 1e6 * card.model.nested_mae_m
        lines.append(f"  error with the set chosen again in every fold: {nested:.3g} um")
    return lines


def refusal_lines(card: ModelCard) -> list[str]:
    """Kinds of recording that a model was trained to refuse, as lines for a terminal.

    Parameters
    ----------
    card : ModelCard
        Card of the model.
    """
    return [
        f"Refuses {kind_words(rates.name)}: {rates.detection_rate:.1%} of {rates.records}, and "
        f"{rates.false_alarm_rate:.1%} of the familiar ones, on machines left out"
        for rates in card.strangers
    ]


def score_lines(result: Mapping[str, Any], card: ModelCard) -> list[str]:
    """An evaluation as lines for a terminal.

    Parameters
    ----------
    result : mapping
        From :func:`wearstate.diagnose.evaluation.evaluate.score`; may be empty.
    card : ModelCard
        Card of the model.

    Returns
    -------
    list of str
    """
    if not result:
        return ["not evaluated: no machine draw was held out"]
    lines = [
        f"Evaluated on {result['records']} records of {result['draws']} unseen machine draws "
        f"({100 * result['unfamiliar']:.1f} % called unfamiliar, {100 * result['caution']:.1f} % "
        "graded with caution)"
    ]
    if result["records"] < _FEW_RECORDS:
        lines.append("  too few records: every figure below is very uncertain")
    if result["mae_m"] is None:
        return [*lines, "  none is familiar: no error can be given for this machine"]
    return [
        *lines,
        f"  {severity_word(card.severity)} error".ljust(20)
        + f"{1e6 * result['mae_m']:.1f} um mean, "
        f"{_percent(result, 'mae_share_of_limit')} of the condemning limit "
        f"{1e3 * card.condemning_limit_m:.3g} mm "
        f"({1e6 * result['mae_all_m']:.1f} um including unfamiliar records)",
        f"  interval coverage {_number(result, 'coverage')} (nominal "
        f"{result['nominal_coverage']:.2f}), mean width "
        f"{100 * result['mean_interval_share']:.1f} % of the limit",
        f"  set coverage      {_number(result, 'set_coverage')}, "
        f"{result['mean_set_size']:.2f} grades in a set on average",
        f"  grade accuracy    {_number(result, 'accuracy')}; best possible at that error "
        f"{result['accuracy_bound']:.3f}",
        f"  within one grade  {result['within_one_grade']:.4f}; quadratic kappa "
        f"{_plain(result['kappa'])}",
        f"  false alarms      {_rate(result, 'false_alarm')} of as-new records graded 2 or 3",
        f"  missed faults     {_rate(result, 'missed_fault')} of condemned records graded 0 or 1",
        f"  brackets          {100 * LEVEL:.0f} % intervals over machines",
        *baseline_lines(result["baselines"]),
        *part_lines("confounder", result["by_confounder"]),
        *part_lines("choice of the recipe", result["by_choice"]),
    ]


def _plain(value: float | None) -> str:
    return "none" if value is None else f"{value:.3f}"


def _number(result: Mapping[str, Any], name: str) -> str:
    low, high = result["intervals"][name]
    return _bracketed(result[name], low, high, 1.0, 3)


def _percent(result: Mapping[str, Any], name: str) -> str:
    low, high = result["intervals"][name]
    return _bracketed(result[name], low, high, 100.0, 1) + " %"


def _rate(result: Mapping[str, Any], name: str) -> str:
    if result[name] is None:
        return "none: no such machine"
    return _percent(result, name)


def _bracketed(
    value: float | None, low: float | None, high: float | None, times: float, digits: int
) -> str:
    if value is None or low is None or high is None:
        return "none"
    return f"{times * value:.{digits}f} [{times * low:.{digits}f}, {times * high:.{digits}f}]"


def baseline_lines(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Comparison with baselines over all records, also refused ones, as lines for a terminal.

    Parameters
    ----------
    rows : mapping
        From :func:`wearstate.diagnose.evaluation.baselines.compare_baselines`, as in JSON.

    Examples
    --------
    >>> print(*baseline_lines({"tsfel": {"missing": "not here"}}), sep=chr(10))
      baseline      error [% of limit]  accuracy  difference [% of limit]
      tsfel         not here
    """
    head = f"  {'baseline':12}  error [% of limit]  accuracy  difference [% of limit]"
    lines = [head, *(_baseline_line(name, row) for name, row in rows.items())]
    if all(row["missing"] for row in rows.values()):
        return lines
    return [*lines, "  error and difference over all records, accuracy over those not unfamiliar"]


def _baseline_line(name: str, row: Mapping[str, Any]) -> str:
    line = f"  {name.replace('_', ' '):12}  "
    if row["missing"]:
        return line + str(row["missing"])
    value, accuracy = row["mae_all_share_of_limit"]["value"], row["accuracy"]["value"]
    if accuracy is None:
        return line + "none: no record was graded"
    apart = row["difference_all"]
    note = "  (trained on the evaluated data set)" if row["flattered"] else ""
    return (
        f"{line}{100 * value:18.1f}  {accuracy:8.3f}  "
        f"{_bracketed(apart['value'], apart['low'], apart['high'], 100.0, 1)}{note}"
    )


def splits_text(result: Mapping[str, Any]) -> str:
    """A whole evaluation as text: one line per split, further tables below.

    Parameters
    ----------
    result : mapping
        From :func:`wearstate.diagnose.evaluation.protocol.evaluate_splits`.
    """
    origin = "simulated" if result["origin"] == "simulated" else "measured"
    head = (
        f"{result['data']}: {result['records']} {origin} records of {result['draws']} machines; "
        f"{severity_word(result['severity'])}, condemned at "
        f"{1e3 * result['condemning_limit_m']:.3g} mm"
    )
    lines = [head, "", *_table(_SPLIT_HEAD, [_split_row(split) for split in result["splits"]])]
    lines += ["error, baseline: mean error in % of the condemning limit with 95 % intervals over"]
    lines += ["machines; bound: best accuracy possible at that error; best baseline and difference"]
    lines += ["(this model minus baseline) over all records, including refused ones"]
    if "learning_curve" in result:
        lines += ["", *_table(_CURVE_HEAD, [_curve_row(row) for row in result["learning_curve"]])]
    if "detectability" in result:
        lines += ["", *_table(_FLOOR_HEAD, [_floor_row(row) for row in result["detectability"]])]
    if "cost" in result:
        lines += ["", *_table(_COST_HEAD, [_cost_row(row) for row in result["cost"]])]
    return "\n".join(lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    # a row that ends early gives a reason, and must not widen a column
    full = [head, *(row for row in rows if len(row) == len(head))]
    widths = [max(len(row[i]) for row in full) for i in range(len(head))]
    return [
        "  ".join(
            cell.ljust(width) for cell, width in zip(row, widths[: len(row)], strict=True)
        ).rstrip()
        for row in [head, *rows]
    ]


_SPLIT_HEAD = (
    "split",
    "records",
    "error",
    "accuracy",
    "bound",
    "kappa",
    "coverage",
    "set size",
    "false alarm",
    "missed",
    "refused",
    "best baseline",
    "difference",
)


def _split_row(split: Mapping[str, Any]) -> list[str]:
    name = str(split["name"])
    if split["missing"]:
        return [name, f"not made: {split['missing']}"]
    best = best_baseline(split)
    apart = None if best is None else split["baselines"][best]["difference_all"]
    return [
        name,
        str(split["records"]),
        _spread(split, "mae_share_of_limit", 100.0, 1),
        _plain(split["accuracy"]),
        _plain(split["accuracy_bound"]),
        _plain(split["kappa"]),
        _plain(split["coverage"]),
        "none" if split["mean_set_size"] is None else f"{split['mean_set_size']:.2f}",
        _share(split["false_alarm"]),
        _share(split["missed_fault"]),
        _share(split["unfamiliar"]),
        "none" if best is None else _best_words(best, split["baselines"][best]),
        "none"
        if apart is None
        else _bracketed(apart["value"], apart["low"], apart["high"], 100.0, 1),
    ]


def _spread(split: Mapping[str, Any], name: str, times: float, digits: int) -> str:
    low, high = split["intervals"][name]
    return _bracketed(split[name], low, high, times, digits)


def _share(value: float | None) -> str:
    return "none" if value is None else f"{100 * value:.1f} %"


def _best_words(name: str, row: Mapping[str, Any]) -> str:
    return f"{name.replace('_', ' ')} {100 * row['mae_all_share_of_limit']['value']:.1f}"


def best_baseline(split: Mapping[str, Any]) -> str | None:
    """Name of the baseline with the smallest mean error over all records; None if none ran.

    Examples
    --------
    >>> ran = {"missing": "", "mae_all_share_of_limit": {"value": 0.1}}
    >>> best_baseline({"baselines": {"tsfel": {"missing": "not installed"}, "majority": ran}})
    'majority'
    """
    errors = {
        name: row["mae_all_share_of_limit"]["value"]
        for name, row in split["baselines"].items()
        if not row["missing"]
    }
    return min(errors, key=lambda name: float(errors[name])) if errors else None


_CURVE_HEAD = ("machines trained on", "error [% of limit]", "accuracy", "refused")


def _curve_row(row: Mapping[str, Any]) -> list[str]:
    error = row["mae_share_of_limit"]
    return [
        str(row["machines"]),
        _bracketed(error["value"], error["low"], error["high"], 100.0, 1),
        _plain(row["accuracy"]["value"]),
        _share(row["unfamiliar"]["value"]),
    ]


_FLOOR_HEAD = ("smallest wear found", "records", "healthy below [um]", "found [um]", "% of limit")


def _floor_row(row: Mapping[str, Any]) -> list[str]:
    found, part = row["smallest_m"], row["smallest_share_of_limit"]
    return [
        str(row["condition"]),
        str(row["records"]),
        f"{1e6 * row['healthy_below_m']:.0f}",
        "none so often" if found["value"] is None else _open_ended(found, 1e6, 0),
        "none so often" if part["value"] is None else _open_ended(part, 100.0, 1),
    ]


def _open_ended(figure: Mapping[str, Any], times: float, digits: int) -> str:
    """A figure whose ends may be beyond the judged range."""
    high = "beyond" if figure["high"] is None else f"{times * figure['high']:.{digits}f}"
    low = "beyond" if figure["low"] is None else f"{times * figure['low']:.{digits}f}"
    return f"{times * figure['value']:.{digits}f} [{low}, {high}]"


_COST_HEAD = ("method", "ms per recording")


def _cost_row(row: Mapping[str, Any]) -> list[str]:
    value = row["ms_per_record"]
    return [str(row["name"]), row["missing"] if value is None else f"{value:.1f}"]


def part_lines(what: str, rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Errors of parts of the records as lines for a terminal; none without parts.

    Parameters
    ----------
    what : str
        Heading of the first column.
    rows : mapping
        From :func:`by_confounder` or :func:`by_choice`.

    Examples
    --------
    >>> row = {"records": 8, "unfamiliar": 0.25, "mae_m": 2e-5, "coverage": 1.0}
    >>> print(*part_lines("confounder", {"none": row}), sep=chr(10))
      confounder  records  unfamiliar  mean error  coverage
      none              8      25.0 %     20.0 um     1.000
    """
    if not rows:
        return []
    width = max(len(name) for name in (*rows, what))
    head = f"  {what:{width}}  records  unfamiliar  mean error  coverage"
    return [head, *(_part_line(name, row, width) for name, row in rows.items())]


def _part_line(name: str, row: Mapping[str, Any], width: int) -> str:
    share = 100 * row["unfamiliar"]
    line = f"  {name.replace('_', ' '):{width}}  {row['records']:7}  {share:8.1f} %"
    if row["mae_m"] is None:
        return f"{line}  none is familiar"
    return f"{line}  {1e6 * row['mae_m']:7.1f} um  {row['coverage']:8.3f}"
