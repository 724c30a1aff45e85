"""Where each method fails on a scene: maps of stable, wrong and unstable, theory over them.

A map is a plane of two quantities and a panel for every method. A cell says how one run of one
method ended there; failed runs are kept, with their word. What another step or mesh removes is the
method's doing, what it does not remove is the machine's: the two never share a colour. The maps
themselves are in :mod:`.stability_maps`.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sim.parts import Scene
from .page import short_name
from .picture import save_picture

_COARSEST = 4  # every fourth cell first: a run that is cut short has seen all of the plane


class Verdict(IntEnum):
    """How a method did in one cell."""

    NOT_RUN = 0
    ACCURATE = 1
    WRONG = 2
    UNSTABLE = 3
    NOT_CONVERGED = 4
    REFUSED = 5
    LOST = 6
    CHAOTIC = 7
    WHIRL = 8
    FAILS = 9

    @property
    def text(self) -> str:
        """As in a legend."""
        return _TEXT[self]

    @property
    def physical(self) -> bool:
        """Whether the machine does it, not the method: a finer step or mesh would show it too."""
        return self >= Verdict.LOST


_TEXT = {
    Verdict.NOT_RUN: "not run (budget)",
    Verdict.ACCURATE: "stable and accurate",
    Verdict.WRONG: "stable but wrong",
    Verdict.UNSTABLE: "unstable by its method",
    Verdict.NOT_CONVERGED: "not converged",
    Verdict.REFUSED: "refused by a guard",
    Verdict.LOST: "contact lost (physical)",
    Verdict.CHAOTIC: "chaotic (physical)",
    Verdict.WHIRL: "whirls (physical)",
    Verdict.FAILS: "fails at any step or mesh (physical)",
}

_COLOUR = {
    Verdict.NOT_RUN: "#ffffff",
    Verdict.ACCURATE: "#4f9d5d",
    Verdict.WRONG: "#f2c14e",
    Verdict.UNSTABLE: "#b3261e",
    Verdict.NOT_CONVERGED: "#e07b39",
    Verdict.REFUSED: "#9aa3ab",
    Verdict.LOST: "#9cc9e3",
    Verdict.CHAOTIC: "#5b8fc7",
    Verdict.WHIRL: "#7a4fa0",
    Verdict.FAILS: "#3c3457",
}


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One quantity of a map.

    Attributes
    ----------
    name, unit : str
        Unit empty where there is none.
    values : tuple of float
        Rising.
    log : bool
        Even ratios rather than even steps.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    log: bool = True

    @property
    def label(self) -> str:
        """With its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A limit drawn over a map.

    Attributes
    ----------
    name : str
        What the theory is.
    x, y : tuple of float
        In the units of the axes; a point outside is not drawn.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


Cell = tuple[Verdict, str]
"""Verdict and a word on it: a status, an error."""

Judge = Callable[[float, float], Cell]
"""``(x, y) -> cell``: one run of one method."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A map to be measured.

    Attributes
    ----------
    name, title : str
    x, y : Axis
    judges : mapping of str to Judge
        One for every method, in the order of the panels.
    curves : mapping of str to sequence of Curve
        Theory for a method; under "" for all.
    note : str
        What the colours are judged by.
    """

    name: str
    title: str
    x: Axis
    y: Axis
    judges: Mapping[str, Judge]
    curves: Mapping[str, Sequence[Curve]] = field(default_factory=dict)
    note: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityMap:
    """A measured map.

    Attributes
    ----------
    plan : Plan
    verdicts : dict of str to numpy.ndarray [shape=(n_y, n_x)]
        Codes of :class:`Verdict` for every method.
    words : dict of str to list of list of str
        Of the same cells.
    """

    plan: Plan
    verdicts: dict[str, NDArray[np.int64]]
    words: dict[str, list[list[str]]]

    @property
    def whole(self) -> bool:
        """Whether no cell was left out."""
        return all(np.all(codes != Verdict.NOT_RUN) for codes in self.verdicts.values())

    def share(self, method: str) -> dict[Verdict, float]:
        """Share of the cells of every verdict that occurs.

        Parameters
        ----------
        method : str
            One of the panels.
        """
        codes = self.verdicts[method]
        return {v: float(np.mean(codes == v)) for v in Verdict if np.any(codes == v)}


# --- measuring


class Budget:
    """Seconds that may be spent; without a limit a map is the same on every machine."""

    def __init__(self, seconds: float | None = None) -> None:
        self.end = None if seconds is None else time.monotonic() + seconds

    @property
    def spent(self) -> bool:
        """Whether nothing is left."""
        return self.end is not None and time.monotonic() > self.end


def measure(
    plan: Plan,
    budget: Budget | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    begun: StabilityMap | None = None,
) -> StabilityMap:
    """Run every cell of a map, the coarse picture first.

    Parameters
    ----------
    plan : Plan
    budget : Budget, optional
        Cells that it leaves no time for stay "not run".
    progress : callable, optional
        ``(done, all)``.
    begun : StabilityMap, optional
        Of the same plan, cut short by a budget: only what it left is run.

    Returns
    -------
    StabilityMap
    """
    shape = len(plan.y.values), len(plan.x.values)
    if begun is None:
        verdicts = {name: np.zeros(shape, np.int64) for name in plan.judges}
        words = {name: [[""] * shape[1] for _ in range(shape[0])] for name in plan.judges}
    else:
        verdicts = {name: codes.copy() for name, codes in begun.verdicts.items()}
        words = {name: [list(row) for row in rows] for name, rows in begun.words.items()}
    order = [(i, j, name) for i, j in coarse_first(shape) for name in plan.judges]
    for done, (i, j, name) in enumerate(order, start=1):
        if verdicts[name][i, j] != Verdict.NOT_RUN:
            continue
        if budget is not None and budget.spent:
            break
        verdict, word = plan.judges[name](plan.x.values[j], plan.y.values[i])
        verdicts[name][i, j], words[name][i][j] = verdict, word
        if progress is not None:
            progress(done, len(order))
    return StabilityMap(plan=plan, verdicts=verdicts, words=words)


def coarse_first(shape: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """Cells of a plane: every fourth of both directions, then every second, then the rest.

    Examples
    --------
    >>> list(coarse_first((1, 5)))
    [(0, 0), (0, 4), (0, 2), (0, 1), (0, 3)]
    """
    seen: set[tuple[int, int]] = set()
    stride = _COARSEST
    while stride:
        for cell in product(range(0, shape[0], stride), range(0, shape[1], stride)):
            if cell not in seen:
                seen.add(cell)
                yield cell
        stride //= 2


def edge(
    codes: NDArray[np.int64], x: Sequence[float], bad: tuple[Verdict, ...] = (Verdict.UNSTABLE,)
) -> NDArray[np.float64]:
    """Where each row turns bad, between the last good cell and the first bad one.

    Parameters
    ----------
    codes : numpy.ndarray [shape=(n_y, n_x)]
    x : sequence of float
        Of the columns, > 0.
    bad : tuple of Verdict

    Returns
    -------
    numpy.ndarray [shape=(n_y,)]
        Geometric mean of the two; NaN where a row is all good or all bad.

    Examples
    --------
    >>> edge(np.array([[1, 1, 3], [1, 1, 1]]), [1.0, 4.0, 9.0])
    array([ 6., nan])
    """
    hit = np.isin(codes, bad)
    first = np.argmax(hit, axis=1)
    known = hit.any(axis=1) & (first > 0)
    values = np.asarray(x, float)
    return np.where(known, np.sqrt(values[np.maximum(first - 1, 0)] * values[first]), np.nan)


# --- showing


def stability_table(scene: Scene, maps: Sequence[StabilityMap]) -> dict[str, Any]:
    """Maps as plain values.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap

    Returns
    -------
    dict
        Axes, verdicts by name, words of the cells that are not simply accurate, theory.
    """
    return {"scene": scene.name, "maps": [_table(each) for each in maps]}


def _table(found: StabilityMap) -> dict[str, Any]:
    plan = found.plan
    return {
        "name": plan.name,
        "title": plan.title,
        "judged_by": plan.note,
        "axes": {
            key: {"name": axis.name, "unit": axis.unit, "values": list(axis.values)}
            for key, axis in (("x", plan.x), ("y", plan.y))
        },
        "methods": [
            {
                "name": name,
                "verdicts": [[Verdict(code).name.lower() for code in row] for row in codes],
                "words": found.words[name],
                "shares": {v.name.lower(): share for v, share in found.share(name).items()},
                "theory": [
                    {"name": curve.name, "x": list(curve.x), "y": list(curve.y)}
                    for curve in _curves(plan, name)
                ],
            }
            for name, codes in found.verdicts.items()
        ],
    }


def _curves(plan: Plan, method: str) -> list[Curve]:
    return [*plan.curves.get("", ()), *plan.curves.get(method, ())]


def stability_text(scene: Scene, maps: Sequence[StabilityMap]) -> str:
    """Shares of every region, a line a method.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap

    Returns
    -------
    str
    """
    lines = [f"{scene.name} (simulated): where its methods fail"]
    for found in maps:
        plan = found.plan
        lines += ["", f"{plan.name}: {plan.title}", f"  {plan.x.label} against {plan.y.label}"]
        lines += [f"  judged by {plan.note}"] if plan.note else []
        for method in found.verdicts:
            shares = ", ".join(f"{v.text} {s:.0%}" for v, s in found.share(method).items())
            lines.append(f"  {method:24} {shares}")
            lines += [f"    {count} x {word}" for word, count in _reasons(found, method)]
    return "\n".join(lines)


def _reasons(found: StabilityMap, method: str) -> list[tuple[str, int]]:
    """Statuses behind the cells that failed, the most frequent first."""
    failed = (Verdict.REFUSED, Verdict.FAILS, Verdict.UNSTABLE, Verdict.NOT_CONVERGED)
    codes = found.verdicts[method]
    words = [
        word.partition(":")[0]
        for row, line in zip(codes, found.words[method], strict=True)
        for code, word in zip(row, line, strict=True)
        if code in failed and word
    ]
    counts = {word: words.count(word) for word in sorted(set(words))}
    return sorted(counts.items(), key=lambda item: -item[1])[:_MOST_REASONS]


_MOST_REASONS = 4


def save_figure(
    scene: Scene, maps: Sequence[StabilityMap], path: Path, *, force: bool = True
) -> None:
    """Draw maps on one sheet, a row of panels each.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap
    path : Path
        ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    DataError
        Another suffix.
    """
    save_picture(atlas_figure(scene, maps), path, force=force)


def atlas_figure(scene: Scene, maps: Sequence[StabilityMap]) -> Any:
    """Figure of maps: regions as colours, theory as lines, a legend for both.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap
        At least one.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    widest = max(len(found.verdicts) for found in maps)
    figure = Figure(figsize=(max(7.5, 3.0 * widest + 1.0), 4.3 * len(maps)), layout="constrained")
    rows = figure.subfigures(len(maps), 1, squeeze=False)[:, 0]
    for row, found in zip(rows, maps, strict=True):
        _draw(row, scene, found)
    return figure


def _draw(sheet: Any, scene: Scene, found: StabilityMap) -> None:
    plan = found.plan
    sheet.suptitle(f"{short_name(scene.name, 60)} (simulated): {plan.title}", fontsize=11)
    panels = sheet.subplots(1, len(found.verdicts), squeeze=False, sharex=True, sharey=True)[0]
    lines: dict[str, Any] = {}
    for panel, (method, codes) in zip(panels, found.verdicts.items(), strict=True):
        _draw_panel(panel, plan, codes)
        panel.set_title(method, fontsize=9)
        panel.set_xlabel(plan.x.label, fontsize=9)
        for number, curve in enumerate(_curves(plan, method)):
            (line,) = panel.plot(curve.x, curve.y, **_LINES[number % len(_LINES)])
            lines.setdefault(curve.name, line)
    panels[0].set_ylabel(plan.y.label, fontsize=9)
    _legend(sheet, found, lines)


_LINES: tuple[dict[str, Any], ...] = (
    {"color": "black", "lw": 1.8},
    {"color": "black", "lw": 1.4, "ls": "--"},
    {"color": "black", "lw": 1.2, "ls": ":"},
)


_DECADES = 300
"""Range of an axis, end over end, below which 1, 2 and 5 are marked in each decade."""


def _draw_panel(panel: Any, plan: Plan, codes: NDArray[np.int64]) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.ticker import LogLocator, NullFormatter

    colours = ListedColormap([_COLOUR[verdict] for verdict in Verdict])
    norm = BoundaryNorm(np.arange(len(Verdict) + 1) - 0.5, len(Verdict))
    x, y = _bounds(plan.x), _bounds(plan.y)
    panel.pcolormesh(x, y, codes, cmap=colours, norm=norm, edgecolors="white", linewidth=0.3)
    for axis, scale in ((plan.x, panel.set_xscale), (plan.y, panel.set_yscale)):
        scale("log" if axis.log else "linear")
    panel.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    for axis, ticks in ((plan.x, panel.xaxis), (plan.y, panel.yaxis)):
        if not axis.log:
            continue
        ticks.set_minor_formatter(NullFormatter())  # decades say enough, where there are several
        if axis.values[-1] < _DECADES * axis.values[0]:
            ticks.set_major_locator(LogLocator(subs=(1, 2, 5)))
            ticks.set_major_formatter("{x:g}")
    panel.tick_params(labelsize=8)


def _bounds(axis: Axis) -> NDArray[np.float64]:
    """Edges of the cells about the values of an axis."""
    values = np.log(axis.values) if axis.log else np.asarray(axis.values)
    middle = 0.5 * (values[1:] + values[:-1])
    edges = np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])
    return np.asarray(np.exp(edges) if axis.log else edges)


def _legend(sheet: Any, found: StabilityMap, lines: Mapping[str, Any]) -> None:
    from matplotlib.patches import Patch

    seen = sorted({int(code) for codes in found.verdicts.values() for code in np.unique(codes)})
    patches = [
        Patch(facecolor=_COLOUR[Verdict(code)], edgecolor="grey", label=Verdict(code).text)
        for code in seen
    ]
    handles, labels = [*patches, *lines.values()], [*(p.get_label() for p in patches), *lines]
    sheet.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
