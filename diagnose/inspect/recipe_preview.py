"""Preview of a recipe before any simulation: counts, as text and as a picture."""

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.draws.draws import Draw, Range, matches
from ...datasets.file.writer import size_words
from ...datasets.generation.work import NUMERICS
from ...datasets.recipe.recipe import Recipe
from ...datasets.recipe.records import Sample, sample_records
from ...datasets.recipe.severities import limit_faults
from ...sim.fidelity.ladder import cost_of, effects_of
from ...sim.parts.wording import si_unit
from ...sim.scene.scene import channels_of
from ..learning.grades import GRADE_COLOURS, GRADE_NAMES, NO_GRADE_COLOUR
from ..pages.page import short_name
from ..pages.picture import PAGE_WIDTH
from ..pictures.panel import COLOURS

MOST_DRAWN = 1000
"""Largest number of records drawn for a preview; more give the same picture."""

_COSTED = 16  # drawn scenes whose cost is looked up
_ROW_BYTES = 64  # in a row of the manifest: name, group, seed, status, checksum
_COLUMNS = 2  # of panels: readable on a phone
_HEAD, _ROW = 0.8, 1.75  # inch, of the heading and of a row of panels
_LARGE = 1e6  # numbers from here on are read better with an exponent
_LEVELS = ("severity", "machine", "record", "confounder")


def preview(recipe: Recipe, n: int | None = None, *, seed: int = 0, cores: int = 1) -> "Preview":
    """Draw the records of a recipe without simulating them.

    Parameters
    ----------
    recipe : Recipe
    n : int, optional
        Number of records; by default the recipe's own.
    seed : int
        Seed of the data set.
    cores : int
        Number of simulating cores.

    Returns
    -------
    Preview

    Raises
    ------
    RecipeError, SceneError
        If `n` or `seed` is out of bounds, or a drawn combination is not a valid scene.

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> found = preview(load_recipe("journal-bearing-small"), 16, cores=2)
    >>> found.table["machines"], sum(found.table["labels"]["grade"].values())
    (8, 16)
    """
    count = recipe.table.records if n is None else n
    samples = list(islice(sample_records(recipe, count, seed=seed), MOST_DRAWN))
    return Preview(recipe, count, samples, cores)


class Preview:
    """Drawn records of a recipe, counted.

    Parameters
    ----------
    recipe : Recipe
    n : int
        Number of records of the data set.
    samples : sequence of Sample
        Samples drawn: all, or the first ones.
    cores : int
        Number of simulating cores.

    Attributes
    ----------
    table : dict
        Summary ready for JSON; names include the SI unit, drawn values are in SI.
    """

    def __init__(self, recipe: Recipe, n: int, samples: Sequence[Sample], cores: int) -> None:
        self.recipe, self.samples = recipe, samples
        self.table: dict[str, Any] = {
            **_sizes(recipe, n),
            "drawn_records": len(samples),
            **_costs(recipe, n, samples, cores),
            "labels": _labels(recipe, samples),
            "ungraded": limit_faults(recipe),
            "confounders": _shares(recipe, samples),
            "held_out": _regions(recipe, samples),
            "draws": [_summary(recipe, *draw) for draw in _draws(recipe)],
            "choices": _choices(recipe),
            "correlations": [entry.model_dump() for entry in recipe.table.correlation],
        }

    def values(self, path: str) -> NDArray[np.float64]:
        """Numbers drawn at a path of the scene, NaN if none was [shape=(n_drawn,)]."""
        return np.array([sample.drawn.get(path, np.nan) for sample in self.samples], dtype=float)


def _sizes(recipe: Recipe, n: int) -> dict[str, Any]:
    scene, table = recipe.scene, recipe.table
    channels = channels_of(scene)
    n_samples = round(scene.duration * scene.sample_rate)
    columns = {**recipe.columns, **NUMERICS}
    row = _ROW_BYTES + sum(np.dtype(kind).itemsize for kind in columns.values())
    return {
        "recipe": recipe.name,
        "description": table.description,
        "scene": table.scene,
        "sampling": table.sampling,
        "machines_of": recipe.machine_name,
        "records": n,
        "records_per_machine": table.records_per_group,
        "machines": -(-n // table.records_per_group),
        "channels": [channel.name for channel in channels],
        "sample_rate_hz": scene.sample_rate,
        "duration_s": scene.duration,
        "signal_s": n * scene.duration,
        "size_bytes": n * (4 * len(channels) * n_samples + row),
    }


def _costs(recipe: Recipe, n: int, samples: Sequence[Sample], cores: int) -> dict[str, Any]:
    """Rungs as written and their tabulated cost, and the machines that differ."""
    scene = recipe.scene
    costs = [cost_of(sample.scene) for sample in samples[:_COSTED]]
    return {
        "fidelity": recipe.table.fidelity or scene.fidelity,
        "rungs": {e.name: e.current(scene) for e in effects_of(scene) if not e.numerical},
        "cores": cores,
        "estimated_time_s": n * float(np.mean(costs)) / min(cores, n),
    }


def _labels(recipe: Recipe, samples: Sequence[Sample]) -> dict[str, dict[str, int]]:
    """Number of records of every grade, by grade column; severities without limits are left out."""
    columns = [w.grade_column for w in recipe.severities if w.grade_column and w.edges]
    rows = {name: [sample.row[name] for sample in samples] for name in columns}
    return {
        name: {str(grade): values.count(grade) for grade in range(len(GRADE_NAMES))}
        for name, values in rows.items()
    }


def _shares(recipe: Recipe, samples: Sequence[Sample]) -> dict[str, float]:
    return {
        fault.table.name: float(np.mean([sample.row[fault.columns[0]] for sample in samples]))
        for fault in recipe.faults
    }


def _regions(recipe: Recipe, samples: Sequence[Sample]) -> dict[str, dict[str, Any]]:
    """Bounds of every held-out region, and its share of the records."""
    return {
        region.name: {
            "bounds": {column: list(ends) for column, ends in region.bounds.items()},
            "share": float(np.mean([_within(sample.row, region.bounds) for sample in samples])),
        }
        for region in recipe.held_out
    }


def _within(row: Mapping[str, Any], bounds: Mapping[str, tuple[float, float]]) -> bool:
    return all(low <= row[column] <= high for column, (low, high) in bounds.items())


def _draws(recipe: Recipe) -> list[tuple[str, Draw]]:
    """All draws of a recipe with their levels."""
    table = recipe.table
    worn = [
        Draw(path=each.path, distribution="log-uniform", low=each.low, high=each.high)
        for each in table.severity
    ]
    lists = (worn, table.machine, table.record, table.confounder)
    return [(level, draw) for level, draws in zip(_LEVELS, lists, strict=True) for draw in draws]


def _summary(recipe: Recipe, level: str, draw: Draw) -> dict[str, Any]:
    """One draw as in the recipe, and the ends of every value it matches [SI]."""
    paths = matches(recipe.base, draw.path)
    known = [axis for axis in (*recipe.machine, *recipe.record) if axis.path in paths]
    known += [w.axis for w in recipe.severities if w.axis.path in paths]
    known += [axis for fault in recipe.faults for axis in fault.axes if axis.path in paths]
    return {
        "level": level,
        "path": draw.path,
        "distribution": draw.distribution,
        "as_written": _as_written(draw),
        "values": {
            axis.path: [list(band) for band in axis.bands] if isinstance(axis, Range) else []
            for axis in known
        },
    }


def _choices(recipe: Recipe) -> list[dict[str, Any]]:
    """Options of every choice: share of the machines or records, values set, values drawn."""
    shares = {
        (each.name, option.name): option.share for each in recipe.choices for option in each.options
    }
    return [
        {
            "name": choice.name,
            "per": choice.per,
            "options": [
                {
                    "name": option.name,
                    "share": shares[choice.name, option.name],
                    "values": dict(option.values),
                    "draws": [
                        {
                            "path": draw.path,
                            "distribution": draw.distribution,
                            "as_written": _as_written(draw),
                        }
                        for draw in option.draw
                    ],
                }
                for option in choice.option
            ],
        }
        for choice in recipe.table.choice
    ]


def _as_written(draw: Draw) -> str:
    if draw.scale is not None:
        return f"norm changed by {100 * draw.scale:g} %"
    return " or ".join(f"{_bound(low)} to {_bound(high)}" for low, high in draw.ranges)


def _bound(value: float | str) -> str:
    """A bound as written; stiffnesses with an exponent."""
    return f"{value:g}" if isinstance(value, float) and abs(value) >= _LARGE else str(value)


def preview_text(table: Mapping[str, Any]) -> str:
    """A preview in lines.

    Parameters
    ----------
    table : mapping
        Table of :class:`Preview`.
    """
    machines = f"{table['records']} records of {table['machines']} machines"
    if table["machines_of"] != table["recipe"]:
        machines += f" (those of {table['machines_of']})"
    seconds = table["estimated_time_s"]
    lines = [
        f"{table['recipe']}: {table['description']}",
        f"  {machines}, {table['signal_s']:.6g} s of signal, {size_words(table['size_bytes'])}",
        f"  scene {table['scene']}: {', '.join(table['channels'])} at "
        f"{table['sample_rate_hz']:g} Hz, {table['duration_s']:g} s each",
        f"  rungs ({_fidelity(table['fidelity'])}): "
        + ", ".join(f"{effect} {rung}" for effect, rung in table["rungs"].items()),
        f"  estimate: {_time(seconds)} on {table['cores']} core(s), by tabulated cost, without "
        + _not_in_it(table["fidelity"]),
        f"  sampling {table['sampling']}; drawn here: {table['drawn_records']} records",
    ]
    for column, grades in table["labels"].items():
        shown = ", ".join(f"{grades[str(i)]} {name}" for i, name in enumerate(GRADE_NAMES))
        lines.append(f"  {column}: {shown}")
    lines += [f"  no grades: {text}" for text in table["ungraded"]]
    lines += [f"  confounder {n}: {share:.1%}" for n, share in table["confounders"].items()]
    lines += [
        f"  held out '{name}': {region['share']:.1%}, {_bounds(region['bounds'])}"
        for name, region in table["held_out"].items()
    ]
    lines += [
        f"  correlation {c['rank']:+g}: {', '.join(c['paths'])}" for c in table["correlations"]
    ]
    return "\n".join([*lines, *_draw_lines(table["draws"]), *_choice_lines(table["choices"])])


def _not_in_it(fidelity: str) -> str:
    """Additional time, not included in that of the records."""
    once = "compiling, a minute or two when a machine is simulated for the first time"
    return once if fidelity == "given" else f"{once}, and the pilots that choose the rungs"


def _fidelity(word: str) -> str:
    return "as written" if word == "given" else "chosen when generated; here as written"


def _time(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.3g} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"


def _bounds(bounds: Mapping[str, Sequence[float]]) -> str:
    return ", ".join(
        f"{column} "
        + " and ".join(
            f"{sign} {end:.4g}" for sign, end in ((">=", low), ("<=", high)) if np.isfinite(end)
        )
        for column, (low, high) in bounds.items()
    )


def _draw_lines(draws: Sequence[Mapping[str, Any]]) -> list[str]:
    width = max(len(draw["path"]) for draw in draws)
    return [
        f"    {draw['level']:10} {draw['path']:{width}}  {draw['distribution']} "
        f"{draw['as_written']}"
        + (f" ({len(draw['values'])} values)" if len(draw["values"]) > 1 else "")
        for draw in draws
    ]


def _choice_lines(choices: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each option; a value that is drawn is not shown as set, too."""
    options = [(f"{each['name']} = {o['name']}", o) for each in choices for o in each["options"]]
    width = max((len(name) for name, _ in options), default=0)
    return [
        f"    choice     {name:{width}}  {option['share']:5.1%}  {_option_words(option)}".rstrip()
        for name, option in options
    ]


def _option_words(option: Mapping[str, Any]) -> str:
    drawn = [f"{d['path']} {d['distribution']} {d['as_written']}" for d in option["draws"]]
    paths = {draw["path"] for draw in option["draws"]}
    fixed = [f"{path} = {value}" for path, value in option["values"].items() if path not in paths]
    return "; ".join([*fixed, *drawn])


def preview_figure(found: Preview) -> Any:
    """Small panels of the draws: every value against the first severity, by grade.

    Parameters
    ----------
    found : Preview

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    paths = [path for path in _plotted(found) if path != found.recipe.severity.path]
    columns = _COLUMNS
    rows = -(-(len(paths) + 1) // columns)
    height = _HEAD + _ROW * rows
    figure = Figure(figsize=(PAGE_WIDTH, height))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    _draw_severity(axes[0], found)
    for place, path in zip(axes[1:], paths, strict=False):
        _draw_path(place, found, path)
    for place in axes[len(paths) + 1 :]:
        place.set_axis_off()
    count = len(found.samples)
    figure.text(
        0.5,
        1 - 0.3 * _HEAD / height,
        f"{short_name(found.recipe.name, 40)}: draws of {count} records\n"
        "(nothing simulated yet); across: severity [mm]",
        ha="center",
        va="center",
        fontsize=9,
    )
    _draw_legend(figure, found, 1 - 0.75 * _HEAD / height)
    figure.subplots_adjust(
        left=0.13,
        right=0.985,
        bottom=0.35 / height,
        top=1 - (_HEAD + 0.25) / height,
        wspace=0.42,
        hspace=0.5,
    )
    return figure


def _draw_legend(figure: Any, found: Preview, middle: float) -> None:
    """Colours of the grades that were drawn, in a row below the heading."""
    from matplotlib.lines import Line2D

    shown = sorted(set(_grades(found)))
    names = {i: f"{i} {name}" for i, name in enumerate(GRADE_NAMES)} | {-1: "no grade"}
    marks = [Line2D([], [], ls="none", marker="o", ms=5, color=_colour(grade)) for grade in shown]
    figure.legend(
        marks,
        [names[grade] for grade in shown],
        loc="center",
        bbox_to_anchor=(0.5, middle),
        ncols=len(shown),
        fontsize=8,
        columnspacing=1.0,
        handletextpad=0.1,
        frameon=False,
    )


def _colour(grade: int) -> str:
    return NO_GRADE_COLOUR if grade < 0 else GRADE_COLOURS[grade]


def _titled(found: Preview, path: str) -> str:
    """Path and SI unit; a dash for numbers without a unit."""
    unit = si_unit(type(found.recipe.scene), path)
    return f"{short_name(path, 38)}\n[{unit or '-'}]"


def _plotted(found: Preview) -> list[str]:
    """One number of every draw, that of the first list entry."""
    first = [next(iter(draw["values"].items())) for draw in found.table["draws"]]
    return [path for path, bands in first if bands]


def _grades(found: Preview) -> list[int]:
    return [int(sample.row.get("grade", -1)) for sample in found.samples]


def _draw_severity(axes: Any, found: Preview) -> None:
    values = [sample.row[found.recipe.severity_columns[0]] for sample in found.samples]
    axes.hist(1e3 * np.array(values), bins=_edges(values), color=COLOURS[0])
    axes.set(xscale="log")
    axes.minorticks_off()
    low, high = 1e3 * min(values), 1e3 * max(values)
    ticks = [low, np.sqrt(low * high), high]
    axes.set(xticks=ticks, xticklabels=[f"{tick:.3g}" for tick in ticks])
    axes.set_title("records by severity [mm]", fontsize=8)
    axes.tick_params(labelsize=8)


def _edges(values: Sequence[float]) -> NDArray[np.float64]:
    low, high = 1e3 * min(values), 1e3 * max(values) * (1 + 1e-9)
    return np.geomspace(low, high, 17)


def _draw_path(axes: Any, found: Preview, path: str) -> None:
    severity = np.array([s.row[found.recipe.severity_columns[0]] for s in found.samples])
    colours = [_colour(grade) for grade in _grades(found)]
    axes.scatter(1e3 * severity, found.values(path), s=2, c=colours, linewidths=0)
    axes.set(xscale="log")
    axes.minorticks_off()
    low, high = 1e3 * severity.min(), 1e3 * severity.max()
    axes.set(xticks=[low, high], xticklabels=[f"{low:.3g}", f"{high:.3g}"])
    axes.set_title(_titled(found, path), fontsize=8, loc="right")
    axes.tick_params(labelsize=8)
    axes.yaxis.set_major_formatter("{x:.6g}")  # a power of ten would not fit next to the title
