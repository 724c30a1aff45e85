"""Pictures and page of an evaluation: errors by split, confusion, reliability, detectability."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..learning.grades import GRADE_NAMES
from ..pages.page import render, save_page, short_name
from ..pages.picture import PAGE_HEIGHT, PAGE_WIDTH, drawn_alone, save_picture
from ..pages.words import quantity_name
from .text import best_baseline

Result = Mapping[str, Any]

_OURS, _IDEAL, _SECOND = "#1f5a94", "#9aa3ab", "#e07b39"
_RIVALS = {
    "majority": ("#b8bfc6", "s"),
    "single_rms": ("#7a858f", "D"),
    "tsfel": ("#e07b39", "^"),
    "minirocket": ("#3a923a", "v"),
}
"""Baseline -> colour and marker."""

_BEYOND = 1.15  # of the axis: position of an open end


def made_splits(result: Result) -> list[Result]:
    """Splits that could be evaluated."""
    return [split for split in result["splits"] if not split["missing"]]


def evaluation_figure(result: Result) -> Any:
    """All pictures of an evaluation in one figure.

    Parameters
    ----------
    result : mapping
        From :func:`wearstate.diagnose.evaluation.protocol.evaluate_splits`, with at least one split
        made.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    panels = _panels(result)
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(2 * PAGE_WIDTH, PAGE_HEIGHT * rows), layout="constrained")
    what = f"{quantity_name(result['severity'])}, {result['origin']}"
    figure.suptitle(f"{short_name(result['data'], 60)}: {what}", fontsize=11)
    for place, (_, _, draw) in enumerate(panels, start=1):
        draw(figure.add_subplot(rows, 2, place))
    return figure


def _panels(result: Result) -> list[tuple[str, str, Callable[[Any], None]]]:
    """Name, caption and drawing function of each picture with data."""
    splits = made_splits(result)
    first = splits[0]
    panels: list[tuple[str, str, Callable[[Any], None]]] = [
        ("errors", _ERRORS, lambda axes: draw_errors(axes, splits)),
        ("confusion", _CONFUSION.format(first["name"]), lambda axes: draw_confusion(axes, first)),
        ("reliability", _RELIABILITY, lambda axes: draw_reliability(axes, first)),
        ("familiarity", _FAMILIARITY, lambda axes: draw_familiarity(axes, splits)),
    ]
    if result.get("learning_curve"):
        curve = result["learning_curve"]
        panels.append(("learning", _LEARNING, lambda axes: draw_learning(axes, curve)))
    if result.get("detectability"):
        floors, limit = result["detectability"], result["condemning_limit_m"]
        panels.append(("found", _FOUND, lambda axes: draw_floors(axes, floors, limit)))
    return panels


_ERRORS = (
    "Mean error over all records of each split, including refused ones, with 95 % intervals over "
    "machines; baselines on the same records. Further left is better."
)
_CONFUSION = "Split {}: true grade against the grade given; shares of each true grade."
_RELIABILITY = (
    "Share of intervals and of sets that contain the truth against the nominal share. On or above "
    "the line the promise is kept; far above, they are wider than necessary."
)
_FAMILIARITY = (
    "Share of records whose novelty p-value is at or below a level. Records like the training "
    "records follow the line; others lie above it."
)
_LEARNING = "Mean error on the same unseen machines against the number of machines trained on."
_FOUND = (
    "Smallest wear detected in nine of ten cases with one false alarm in twenty, by condition; "
    "bars are 95 % intervals over machines. Healthy: the tenth of the records with the least wear."
)


def draw_errors(axes: Any, splits: Sequence[Result]) -> None:
    """Mean error by split, of the model and the baselines."""
    for place, split in enumerate(splits):
        _draw_bar(
            axes,
            [split["mae_all_share_of_limit"], *split["intervals"]["mae_all_share_of_limit"]],
            place,
            {"color": _OURS, "marker": "o", "label": "this model" if place == 0 else None},
        )
        for name, (colour, marker) in _RIVALS.items():
            row = split["baselines"].get(name, {"missing": "none"})
            if not row["missing"]:
                axes.plot(
                    100 * row["mae_all_share_of_limit"]["value"],
                    place + 0.22,
                    ls="none",
                    color=colour,
                    marker=marker,
                    ms=6,
                    label=name.replace("_", " ") if place == 0 else None,
                )
    axes.set_yticks(range(len(splits)), [short_name(split["name"]) for split in splits])
    axes.set_ylim(len(splits) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(_some_minor)
    axes.set_xlabel("mean error [% of the condemning limit]")
    axes.grid(axis="x", alpha=0.3, which="both")
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=3, frameon=False)


def _some_minor(value: float, _place: Any = None) -> str:
    """Label only 2 and 5 between the powers of ten: all labels would overlap."""
    return f"{value:g}" if f"{value:e}"[0] in "25" else ""


def _draw_bar(axes: Any, figure: Sequence[float | None], place: float, style: Any) -> None:
    value, low, high = (None if each is None else 100 * each for each in figure)
    if value is None or low is None or high is None:
        return
    axes.errorbar(
        [value],
        [place],
        # a quantile of the resamples may lie on the wrong side by rounding
        xerr=[[max(value - low, 0.0)], [max(high - value, 0.0)]],
        ls="none",
        capsize=4,
        ms=7,
        **style,
    )


def draw_confusion(axes: Any, split: Result) -> None:
    """Counts and shares of each true grade."""
    counts = split["confusion"]
    shares = [[n / max(sum(row), 1) for n in row] for row in counts]
    names = [GRADE_NAMES[i] for i in range(len(counts))]
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for i, row in enumerate(counts):
        for j, count in enumerate(row):
            text = f"{count}\n{100 * shares[i][j]:.1f} %" if count else "0"
            colour = "white" if shares[i][j] > 0.5 else "black"
            axes.text(j, i, text, ha="center", va="center", fontsize=9, color=colour)
    axes.set_xticks(range(len(names)), names, fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set(xlabel="grade given", ylabel="true grade")


def draw_reliability(axes: Any, split: Result) -> None:
    """Observed against nominal coverage of intervals and sets."""
    rows = split["reliability"]
    nominal = [row["nominal"] for row in rows]
    axes.plot([0.45, 1], [0.45, 1], color=_IDEAL, ls="--", label="as promised")
    for name, colour, shift in (("interval", _OURS, 0.0), ("set", _SECOND, 0.004)):
        known = [
            (n + shift, row[name])
            for n, row in zip(nominal, rows, strict=True)
            if row[name]["value"] is not None
        ]
        _draw_points(axes, known, colour, f"{name}s")
    axes.set(xlabel="nominal coverage", ylabel="share that contains the truth", ylim=(0.4, 1.02))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower right")


def _draw_points(
    axes: Any, points: Sequence[tuple[float, Mapping[str, float]]], colour: str, label: str
) -> None:
    axes.errorbar(
        [x for x, _ in points],
        [y["value"] for _, y in points],
        yerr=[
            [max(y["value"] - y["low"], 0.0) for _, y in points],
            [max(y["high"] - y["value"], 0.0) for _, y in points],
        ],
        color=colour,
        marker="o",
        capsize=3,
        label=label,
    )


def draw_familiarity(axes: Any, splits: Sequence[Result]) -> None:
    """Share of records at or below each p-value, by split."""
    axes.plot([0, 1], [0, 1], color=_IDEAL, ls="--", label="like the training records")
    for split in splits:
        rows = split["familiarity"]
        axes.plot(
            [row["p"] for row in rows],
            [row["share"]["value"] for row in rows],
            marker=".",
            lw=2.2 if split is splits[0] else 1.0,
            label=short_name(split["name"]),
        )
    axes.set(xlabel="novelty p-value", ylabel="share of records at or below", ylim=(-0.02, 1.02))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="lower right", ncols=1 + len(splits) // 6)


def draw_learning(axes: Any, curve: Sequence[Result]) -> None:
    """Error against the number of machines trained on."""
    known = [row for row in curve if row["mae_share_of_limit"]["value"] is not None]
    points = [
        (row["machines"], {k: 100 * v for k, v in row["mae_share_of_limit"].items()})
        for row in known
    ]
    _draw_points(axes, points, _OURS, "this model")
    axes.set_xscale("log")
    axes.set_xticks([x for x, _ in points], [str(x) for x, _ in points])
    axes.xaxis.set_minor_formatter(lambda _value, _place: "")
    axes.set(xlabel="machines trained on", ylabel="mean error [% of limit]")
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)


def draw_floors(axes: Any, rows: Sequence[Result], limit: float) -> None:
    """Smallest detected wear by condition; the condemning limit [m] is 100 %."""
    found = [row["smallest_share_of_limit"] for row in rows]
    known = [v for each in found for v in each.values() if v is not None]
    edge = _BEYOND * 100 * max(known, default=1.0)
    for place, each in enumerate(found):
        if each["value"] is None:
            axes.text(0.02 * edge, place, "none so often", va="center", fontsize=9)
            continue
        ends = [each["value"], each["low"], each["high"]]
        shown = [edge / 100 if end is None else end for end in ends]
        _draw_bar(axes, shown, place, {"color": _OURS, "marker": "o"})
        if each["high"] is None:
            axes.plot(edge, place, marker=">", color=_OURS, ms=8)
    new = 100 * rows[0]["healthy_below_m"] / limit
    axes.axvline(new, color=_IDEAL, ls="--", label="healthy up to here")
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.4, 1.0), frameon=False)
    axes.set_yticks(range(len(rows)), [short_name(row["condition"]) for row in rows], fontsize=8)
    axes.set(ylim=(len(rows) - 0.5, -0.5), xlim=(0, 1.03 * edge))
    axes.set_xlabel("smallest wear detected [% of the condemning limit]")
    axes.grid(axis="x", alpha=0.3)


# --- the page -------------------------------------------------------------------------------------


def evaluation_html(result: Result, *, notice: str = "") -> str:
    """An evaluation as one self-contained page: no script, no link, pictures inside.

    Parameters
    ----------
    result : mapping
        From :func:`wearstate.diagnose.evaluation.protocol.evaluate_splits`.
    notice : str
        Notice of the model, if it was trained on simulated data.

    Returns
    -------
    str
        HTML.
    """
    made = made_splits(result)
    panels = _panels(result) if made else []
    return render(
        "evaluate.html.j2",
        result=result,
        made=made,
        absent=[split for split in result["splits"] if split["missing"]],
        quantity=quantity_name(result["severity"]),
        notice=notice,
        best=best_baseline,
        figures=[(caption, drawn_alone(draw)) for _, caption, draw in panels],
    )


def save_evaluation(result: Result, path: Path, *, notice: str = "", force: bool = True) -> None:
    """Write an evaluation as a page, a picture or JSON, depending on the suffix.

    Measured times (``cost``) are left out: the same evaluation gives the same bytes.

    Parameters
    ----------
    result : mapping
        From :func:`wearstate.diagnose.evaluation.protocol.evaluate_splits`.
    path : Path
        ``.html``, ``.png``, ``.svg``, ``.pdf`` or ``.json``.
    notice : str
        Notice of the model, for the page.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The suffix is none of these, or there is no split for a picture.
    """
    import json

    from ...sim.output.recording import DataError

    lasting = {name: value for name, value in result.items() if name != "cost"}
    if path.suffix == ".json":
        save_page(json.dumps(lasting, allow_nan=False, indent=1) + "\n", path, force=force)
    elif path.suffix == ".html":
        save_page(evaluation_html(result, notice=notice), path, force=force)
    elif not made_splits(result):
        raise DataError(f"{path}: 0 splits could be made, must be > 0 for a picture; write .html")
    else:
        save_picture(evaluation_figure(result), path, force=force)
