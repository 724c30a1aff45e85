"""Feature ranking as text, as a table, as CSV and as a page with pictures."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.csv_cells import save_rows
from ...datasets.file.record import DataSet
from ...sim.output.recording import DataError
from ..feature_rows.feature_choice import costs_ms
from ..feature_rows.feature_rank import (
    LEAST_OF_MACHINE,
    LEAST_RANKED,
    FeatureRank,
    Ranking,
    rank_features,
)
from ..feature_rows.feature_table import FeatureSelection, FeatureTable
from ..pages.page import render, save_page, short_name
from ..pages.picture import PAGE_WIDTH, PageImage, drawn_alone, page_image
from ..pages.si_text import plain
from ..pages.words import quantity_name

SHOWN = 20
"""Features in the terminal table; only their cost is measured."""

_OPEN = 60  # features of a page that are visible, and printed, without unfolding
_DRAWN = 6  # features whose values are drawn


@dataclass(frozen=True, kw_only=True)
class RankedSet:
    """The features of a data set, ranked.

    Attributes
    ----------
    name : str
        Name of the data set.
    target : str
        Manifest column predicted.
    classes : bool
        Whether the target names conditions.
    table : FeatureTable
    ranking : Ranking
    costs_ms : mapping of str to float
        Time to compute a feature alone on one recording [ms], for those shown.
    """

    name: str
    target: str
    classes: bool
    table: FeatureTable
    ranking: Ranking
    costs_ms: Mapping[str, float] = field(default_factory=dict)


def rank_set(
    path: Path, table: FeatureTable, choice: FeatureSelection, *, target: str | None = None
) -> RankedSet:
    """Rank the features of a data set by its first severity, or another label.

    Parameters
    ----------
    path : Path
        Data set.
    table : FeatureTable
        Its features.
    choice : FeatureSelection
        Selection with which the table was made, also used to measure the costs.
    target : str, optional
        Column of the manifest.

    Raises
    ------
    DataError
        If there is no such column, or its values do not vary.
    """
    with DataSet(path) as data:
        severities = data.attributes.severities
    column = target or (severities[0] if severities else "")
    if column not in table.manifest:
        labels = ", ".join(severities) or "(the set stores no severity)"
        raise DataError(
            f"{path}: target = {column!r} must be a column of its manifest; severities: {labels}"
        )
    table = _labelled(table, column)
    values = table.manifest[column].to_numpy()
    classes = column not in severities and values.dtype.kind != "f"
    if len(np.unique(values)) < 2:
        raise DataError(f"{path}: {column} is the same in all records, must vary; name another")
    grades = table.manifest["grade"].to_numpy() if severities[:1] == (column,) else None
    ranking = rank_features(
        table.names,
        table.values,
        values,
        table.manifest["group"].to_numpy(),
        grades=grades,
        classes=classes,
    )
    shown = [each.name for each in ranking.features[:SHOWN]]
    alone = [_only(choice, name) for name in shown]
    return RankedSet(
        name=path.name,
        target=column,
        classes=classes,
        table=table,
        ranking=ranking,
        costs_ms=dict(zip(shown, costs_ms(path, alone), strict=True)),
    )


def _labelled(table: FeatureTable, column: str) -> FeatureTable:
    """The records whose target is known."""
    known = table.manifest[column].notna().to_numpy()
    manifest = table.manifest[known].reset_index(drop=True)
    return replace(table, values=table.values[known], manifest=manifest, lacking={})


def _only(choice: FeatureSelection, name: str) -> FeatureSelection:
    return replace(choice, feature_set="complete", only=(name,))


_COLUMNS = {
    "information": "information [bits]",
    "grades": "of the grades",
    "spearman": "Spearman",
    "monotonicity": "monotonicity",
    "trendability": "trendability",
}


def rank_lines(found: RankedSet) -> list[str]:
    """Results of the ranking in sentences."""
    ranking = found.ranking
    if math.isnan(ranking.chance):
        return [
            f"{ranking.n_records} records are too few to rank by information about {found.target}, "
            f"must be >= {LEAST_RANKED}; generate or record more"
        ]
    best = ranking.features[0]
    lines = [
        f"{best.name} is most informative about {found.target}: {plain(best.information)} bits",
        f"{len(ranking.informative)} of {len(ranking.features)} features are more informative than "
        f"chance ({plain(ranking.chance)} bits; a shuffled target stays below it in 95 of 100 "
        "features)",
    ]
    if not found.classes and ranking.n_followed < ranking.n_machines:
        lines.append(
            f"{ranking.n_followed} of {ranking.n_machines} machines have the "
            f"{LEAST_OF_MACHINE} records that monotonicity and trendability need"
        )
    return lines


def rank_text(found: RankedSet) -> str:
    """The ranking for a terminal: the first features, then the results in sentences."""
    width = max(len(each.name) for each in found.ranking.features[:SHOWN])
    heads = [*_used(found).values(), "cost [ms]"]
    lines = [
        f"{found.name}: {found.ranking.n_records} records of {found.ranking.n_machines} machines",
        f"{'feature':{width}}  " + "  ".join(heads),
    ]
    for each in found.ranking.features[:SHOWN]:
        cells = [*_cells(found, each), _number(found.costs_ms.get(each.name, math.nan))]
        row = "  ".join(cell.rjust(len(head)) for cell, head in zip(cells, heads, strict=True))
        lines.append(f"{each.name:{width}}  {row}")
    hidden = len(found.ranking.features) - SHOWN
    lines += [f"and {hidden} more: see --json or -o"] if hidden > 0 else []
    return "\n".join([*lines, *rank_lines(found)])


def _used(found: RankedSet) -> dict[str, str]:
    """Columns with known values."""
    rows = found.ranking.features
    return {
        name: head
        for name, head in _COLUMNS.items()
        if any(not math.isnan(getattr(each, name)) for each in rows)
    }


def _cells(found: RankedSet, each: FeatureRank) -> list[str]:
    return [_number(getattr(each, name)) for name in _used(found)]


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"


def rank_table(found: RankedSet) -> dict[str, Any]:
    """The ranking as plain values, for JSON."""
    ranking = found.ranking
    return {
        "data": found.name,
        "target": found.target,
        "chance_bits": ranking.chance,
        "records": ranking.n_records,
        "machines": ranking.n_machines,
        "machines_followed": ranking.n_followed,
        "features": [
            {**asdict(each), "cost_ms": found.costs_ms.get(each.name)} for each in ranking.features
        ],
    }


def save_rank(found: RankedSet, path: Path, *, force: bool = True) -> None:
    """Write the ranking as page or CSV."""
    if path.suffix == ".csv":
        rows = rank_table(found)["features"]
        save_rows(path, rows[0], [row.values() for row in rows], force=force)
    else:
        save_page(rank_html(found), path, force=force)


# --- page


def rank_html(found: RankedSet) -> str:
    """One self-contained page: results, pictures, all features."""
    return render(
        "rank.html.j2",
        name=found.name,
        target=_axis_words(found).partition(" [")[0],
        lines=rank_lines(found),
        records=found.ranking.n_records,
        machines=found.ranking.n_machines,
        bars=page_image(bar_figure(found)),
        values=value_images(found),
        drawn=min(_DRAWN, len(found.ranking.features)),
        heads=[*_used(found).values(), "cost [ms]"],
        rows=[
            {
                "name": each.name,
                "telling": each.information > found.ranking.chance,
                "cells": [
                    *_cells(found, each),
                    _number(found.costs_ms.get(each.name, math.nan)),
                ],
            }
            for each in found.ranking.features
        ],
        shown=SHOWN,
        open=_OPEN,
    )


def _axis_words(found: RankedSet) -> str:
    if found.classes or not found.target.endswith("_m"):
        return found.target
    return f"{quantity_name(found.target)} [mm]"


def bar_figure(found: RankedSet) -> Any:
    """Information of the first features, and the chance level."""
    from matplotlib.figure import Figure

    rows = found.ranking.features[:SHOWN]
    figure = Figure(figsize=(PAGE_WIDTH, 0.26 * len(rows) + 1.0), layout="constrained")
    axis = figure.subplots()
    places = np.arange(len(rows))
    axis.barh(places, np.nan_to_num([each.information for each in rows]), color="#2f6f9f")
    axis.set_yticks(places, [short_name(each.name, 34) for each in rows], fontsize=8)
    axis.invert_yaxis()
    axis.axvline(found.ranking.chance, color="#c03a2b", linestyle="--", label="chance")
    axis.set_xlabel(
        f"information about {_axis_words(found).partition(' [')[0]} [bits]", fontsize=9, loc="right"
    )
    axis.legend(loc="lower right")
    return figure


def value_images(found: RankedSet) -> list[PageImage]:
    """Values of each of the best features against the target, records of one machine joined."""
    place, ticks = _places(found)

    def draw(axis: Any, each: FeatureRank) -> None:
        column = found.table.values[:, found.table.names.index(each.name)]
        _draw_values(axis, found, place, column)
        axis.set_title(short_name(each.name, 44), fontsize=10)
        axis.set_xlabel(_axis_words(found), fontsize=9)
        if ticks:
            axis.set_xticks(range(len(ticks)), [short_name(each, 14) for each in ticks])

    best = found.ranking.features[:_DRAWN]
    return [drawn_alone(partial(draw, each=each), height=3.2) for each in best]


def _places(found: RankedSet) -> tuple[NDArray[np.float64], list[str]]:
    """Position of each record along the target, and the names of the conditions."""
    values = found.table.manifest[found.target].to_numpy()
    if found.classes:
        names, number = np.unique(values, return_inverse=True)
        return number.astype(np.float64), [_text(name) for name in names]
    scale = 1e3 if found.target.endswith("_m") else 1.0
    return np.asarray(values, dtype=np.float64) * scale, []


def _text(value: Any) -> str:
    return value.decode(errors="backslashreplace") if isinstance(value, bytes) else str(value)


_MOST_LINES = 12  # machines whose records are joined; more would be illegible


def _draw_values(
    axis: Any, found: RankedSet, place: NDArray[np.float64], column: NDArray[np.float64]
) -> None:
    axis.plot(place, column, "o", markersize=3, alpha=0.5, color="#49535e", markeredgewidth=0)
    if found.classes or found.ranking.n_followed == 0:
        return
    group = found.table.manifest["group"].to_numpy()
    for machine in np.unique(group)[:_MOST_LINES]:
        own = np.flatnonzero(group == machine)
        own = own[np.argsort(place[own])]
        axis.plot(place[own], column[own], linewidth=0.8, alpha=0.8)
