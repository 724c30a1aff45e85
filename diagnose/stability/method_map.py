"""Accuracy and stability of each method around a scene, with limits from theory.

A map is a plane of two quantities, with a panel for every method. A cell holds the result of a run
of one method; failed runs are kept, with their reason. A failure that another step or mesh removes
has a numerical cause, otherwise a physical one; the two never share a colour. The scene itself is a
cell of every map, and its row and column are run first. The maps themselves are in
:mod:`.stability.maps`, the distance from the scene to the next failure in :mod:`.stability.edges`.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import product

import numpy as np
from numpy.typing import NDArray

_COARSEST = 4  # every fourth cell first: an interrupted run has covered the whole plane


class Verdict(IntEnum):
    """Result of a method in one cell."""

    NOT_RUN = 0
    ACCURATE = 1
    INACCURATE = 2
    UNSTABLE = 3
    NOT_CONVERGED = 4
    REFUSED = 5
    LOST = 6
    CHAOTIC = 7
    WHIRL = 8
    FAILS = 9

    @property
    def text(self) -> str:
        """Text for a legend."""
        return _TEXT[self]

    @property
    def cause(self) -> str:
        """``numerical``: removed by a finer step or mesh; ``physical``: caused by the machine."""
        if self >= Verdict.LOST:
            return "physical"
        return "numerical" if self >= Verdict.INACCURATE else ""


_TEXT = {
    Verdict.NOT_RUN: "not run (budget)",
    Verdict.ACCURATE: "accurate",
    Verdict.INACCURATE: "inaccurate (numerical cause)",
    Verdict.UNSTABLE: "unstable (numerical cause)",
    Verdict.NOT_CONVERGED: "not converged (numerical cause)",
    Verdict.REFUSED: "refused by a check (numerical cause)",
    Verdict.LOST: "contact lost (physical cause)",
    Verdict.CHAOTIC: "chaotic (physical cause)",
    Verdict.WHIRL: "whirl (physical cause)",
    Verdict.FAILS: "fails at any step or mesh (physical cause)",
}


@dataclass(frozen=True, kw_only=True)
class MapAxis:
    """One quantity of a map.

    Attributes
    ----------
    name, unit : str
        The unit is empty if there is none.
    values : tuple of float
        Rising.
    log : bool
        Equal ratios rather than equal steps.
    even : bool
        Only even integers, such as nodes around a bore.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    log: bool = True
    even: bool = False

    @property
    def label(self) -> str:
        """Name with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def quantity(self) -> str:
        """Name without its explanation.

        Examples
        --------
        >>> MapAxis(name="gap left, 1 - eccentricity ratio", unit="", values=(0.1, 0.5)).quantity
        'gap left'
        """
        return self.name.partition(",")[0].partition(" (")[0]

    def written(self, value: float) -> str:
        """A value with its unit, and a prefix if the number would be unwieldy.

        Examples
        --------
        >>> MapAxis(name="step", unit="s", values=(1.0, 2.0)).written(1.953e-5)
        '19.5 us'
        """
        for factor, prefix in _PREFIXES:
            if self.unit in _PREFIXED and factor <= abs(value) < 1000 * factor:
                return f"{value / factor:.3g} {prefix}{self.unit}"
        return f"{value:.3g} {self.unit}".rstrip()

    def through(self, value: float | None) -> "MapAxis":
        """The axis with a value > 0 on it, which replaces the nearest value inside, not an end.

        Examples
        --------
        >>> MapAxis(name="step", unit="s", values=(1.0, 2.0, 4.0)).through(2.2).values
        (1.0, 2.2, 4.0)
        >>> MapAxis(name="step", unit="s", values=(1.0, 2.0, 4.0)).through(9.0).values
        (1.0, 2.0, 4.0, 9.0)
        """
        if value is None or not math.isfinite(value):
            return self
        way = math.log if self.log else float
        inner = [k for k, other in enumerate(self.values) if abs(other / value - 1) < _SAME] or (
            range(1, len(self.values) - 1) if self.values[0] < value < self.values[-1] else []
        )
        gone = min(inner, key=lambda k: abs(way(self.values[k]) - way(value)), default=None)
        others = [other for k, other in enumerate(self.values) if k != gone]
        return replace(self, values=tuple(sorted([*others, value])))


def even_ratios(low: float, high: float, size: int) -> tuple[float, ...]:
    """Values of a logarithmic axis."""
    return tuple(float(value) for value in np.geomspace(low, high, size))


def ratio_axis(
    name: str, unit: str, low: float, high: float, size: int, *, own: float | None
) -> MapAxis:
    """Logarithmic axis with the scene's own value on it."""
    return MapAxis(name=name, unit=unit, values=even_ratios(low, high, size)).through(own)


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A limit drawn over a map.

    Attributes
    ----------
    name : str
        Name of the theory.
    x, y : tuple of float
        Coordinates in the units of the axes; points outside are not drawn.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


def coordinates(points: list[tuple[float, float]], column: int) -> tuple[float, ...]:
    """One coordinate of the points of a curve."""
    return tuple(point[column] for point in points)


_SAME = 1e-9  # relative difference below which two values are the same
_PREFIXES = ((1e-9, "n"), (1e-6, "u"), (1e-3, "m"), (1.0, ""), (1e3, "k"), (1e6, "M"), (1e9, "G"))
_PREFIXED = {"s", "m", "N", "N/m", "Pa s"}

Cell = tuple[Verdict, str]
"""Verdict and its explanation: a status, an error."""


def within(error: float, accuracy: float, what: str) -> Cell:
    """Verdict on the relative error of a quantity; NaN is inaccurate."""
    fine = error <= accuracy
    return (Verdict.ACCURATE if fine else Verdict.INACCURATE), f"{what} off by {error:.2g}"


Judge = Callable[[float, float], Cell]
"""``(x, y) -> cell``: one run of one method."""


@dataclass(frozen=True, kw_only=True)
class Own:
    """The scene itself in a map.

    Attributes
    ----------
    method : str
        Panel of its method as written.
    x, y : float or None
        Values on the axes; None if the scene has no such quantity.
    note : str
        How the panel differs from its method, if it does.
    """

    method: str
    x: float | None
    y: float | None
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class MapPlan:
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
        Criterion of the verdicts.
    own : Own, optional
        Position of the scene; its values are on the axes.
    secondary : bool
        It shows methods that the scene does not use, and is run after the other maps.
    """

    name: str
    title: str
    x: MapAxis
    y: MapAxis
    judges: Mapping[str, Judge]
    curves: Mapping[str, Sequence[Curve]] = field(default_factory=dict)
    note: str = ""
    own: Own | None = None
    secondary: bool = False

    def theory(self, method: str) -> list[Curve]:
        """Curves in the panel of a method."""
        return [*self.curves.get("", ()), *self.curves.get(method, ())]

    @property
    def cell(self) -> tuple[int, int] | None:
        """Row and column of the scene; None if it is not on both axes."""
        if self.own is None or self.own.x is None or self.own.y is None:
            return None
        return self.y.values.index(self.own.y), self.x.values.index(self.own.x)

    @property
    def cross(self) -> list[tuple[int, int]]:
        """Cells of the scene's row and column, from the scene outwards."""
        if self.own is None:
            return []
        cells = []
        if self.own.y in self.y.values:
            row = self.y.values.index(self.own.y)
            cells += [(row, j) for j in range(len(self.x.values))]
        if self.own.x in self.x.values:
            column = self.x.values.index(self.own.x)
            cells += [(i, column) for i in range(len(self.y.values))]
        if self.cell is None:
            return cells
        i, j = self.cell
        return sorted(dict.fromkeys(cells), key=lambda c: abs(c[0] - i) + abs(c[1] - j))


@dataclass(frozen=True, kw_only=True)
class Edge:
    """Change of the verdict on the scene's own method, in one direction along one axis.

    Attributes
    ----------
    axis : str
        "x" or "y".
    rising : bool
        Direction.
    inside, outside : float
        Last value with a verdict as good (or as bad) as that of the scene, and first value with
        another; `outside` is NaN if there is none.
    verdict : Verdict
        Verdict at `outside`; NOT_RUN if there is none.
    word : str
        Explanation at `outside`.
    whole : bool
        Whether all cells up to the edge, or to the end of the axis, were run.
    """

    axis: str
    rising: bool
    inside: float
    outside: float = math.nan
    verdict: Verdict = Verdict.NOT_RUN
    word: str = ""
    whole: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class StabilityMap:
    """A measured map.

    Attributes
    ----------
    plan : Plan
    verdicts : dict of str to numpy.ndarray [shape=(n_y, n_x)]
        Codes of :class:`Verdict` for every method.
    words : dict of str to list of list of str
        Explanations of the same cells.
    edges : tuple of Edge
        Edges of the scene's own method around the scene.
    """

    plan: MapPlan
    verdicts: dict[str, NDArray[np.int64]]
    words: dict[str, list[list[str]]]
    edges: tuple[Edge, ...] = ()

    @property
    def methods(self) -> list[str]:
        """Methods, the scene's own first."""
        own = self.plan.own.method if self.plan.own else None
        return sorted(self.verdicts, key=lambda name: name != own)

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
    """Available time; without a limit a map is reproducible."""

    def __init__(self, seconds: float | None = None) -> None:
        self.end = None if seconds is None else time.monotonic() + seconds

    @property
    def spent(self) -> bool:
        """Whether the time is used up."""
        return self.end is not None and time.monotonic() > self.end


def measure(
    plan: MapPlan,
    budget: Budget | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    begun: StabilityMap | None = None,
    methods: Sequence[str] | None = None,
    cells: Sequence[tuple[int, int]] | None = None,
) -> StabilityMap:
    """Run the cells of a map: row and column of the scene, then the plane, coarse before fine.

    Parameters
    ----------
    plan : Plan
    budget : Budget, optional
        Cells beyond the budget stay "not run".
    progress : callable, optional
        Called with (done, all).
    begun : StabilityMap, optional
        Incomplete map of the same plan, of which only the missing cells are run.
    methods : sequence of str, optional
        Methods to be run; by default all.
    cells : sequence of tuple of int, optional
        Row and column of the cells to be run; by default all.

    Returns
    -------
    StabilityMap
    """
    found = begun or unmeasured(plan)
    verdicts = {name: codes.copy() for name, codes in found.verdicts.items()}
    words = {name: [list(row) for row in rows] for name, rows in found.words.items()}
    shape = len(plan.y.values), len(plan.x.values)
    wanted = dict.fromkeys([*plan.cross, *coarse_first(shape)] if cells is None else cells)
    order = [(i, j, name) for i, j in wanted for name in methods or found.methods]
    for done, (i, j, name) in enumerate(order, start=1):
        if verdicts[name][i, j] != Verdict.NOT_RUN:
            continue
        if budget is not None and budget.spent:
            break
        verdict, word = plan.judges[name](plan.x.values[j], plan.y.values[i])
        verdicts[name][i, j], words[name][i][j] = verdict, word
        if progress is not None:
            progress(done, len(order))
    return replace(found, verdicts=verdicts, words=words)


def unmeasured(plan: MapPlan) -> StabilityMap:
    """A map without any cell run."""
    n_y, n_x = len(plan.y.values), len(plan.x.values)
    return StabilityMap(
        plan=plan,
        verdicts={name: np.zeros((n_y, n_x), np.int64) for name in plan.judges},
        words={name: [[""] * n_x for _ in range(n_y)] for name in plan.judges},
    )


def coarse_first(shape: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """Cells of a plane: every fourth in both directions, then every second, then the rest.

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


def edge(codes: NDArray[np.int64], x: Sequence[float]) -> NDArray[np.float64]:
    """Stability limit of each row, between the last stable and the first unstable cell.

    Parameters
    ----------
    codes : numpy.ndarray [shape=(n_y, n_x)]
    x : sequence of float
        Values of the columns, > 0.

    Returns
    -------
    numpy.ndarray [shape=(n_y,)]
        Geometric mean of the two; NaN if a row is all stable or all unstable.

    Examples
    --------
    >>> edge(np.array([[1, 1, 3], [1, 1, 1]]), [1.0, 4.0, 9.0])
    array([ 6., nan])
    """
    hit = codes == Verdict.UNSTABLE
    first = np.argmax(hit, axis=1)
    known = hit.any(axis=1) & (first > 0)
    values = np.asarray(x, float)
    return np.where(known, np.sqrt(values[np.maximum(first - 1, 0)] * values[first]), np.nan)
