"""Distance from a scene to the next failure of its own method: edges of a map, and conclusions.

An edge is located between two cells of the scene's row or column and then bisected until it is
known to a few per cent. Texts state the last value that was still good.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

from .method_map import Budget, Edge, MapAxis, Own, StabilityMap, Verdict

_HALVINGS = 3  # of an interval between cells a factor of 1.8 apart: leaves 7 per cent
_LEAST_FACTOR = 1.1
_KNOCKING = {Verdict.LOST, Verdict.CHAOTIC}
_BAD = {Verdict.INACCURATE, Verdict.UNSTABLE, Verdict.NOT_CONVERGED, Verdict.REFUSED}
_BAD |= {Verdict.WHIRL, Verdict.FAILS}
_SEEN_STABLE = {Verdict.ACCURATE, Verdict.INACCURATE, *_KNOCKING}


def with_edges(found: StabilityMap, budget: Budget | None = None) -> StabilityMap:
    """Add the edges around the scene to a map, as far as its cells have been run.

    Parameters
    ----------
    found : StabilityMap
    budget : Budget, optional
        Edges beyond the budget are known only to the distance of the cells.

    Returns
    -------
    StabilityMap
        Edges in both directions along both axes; two if accuracy ends before stability.
    """
    start = start_cell(found)
    if start is None:
        return replace(found, edges=())
    edges = [
        edge
        for axis in _open_axes(found.plan.own)
        for rising in (True, False)
        for edge in _edges(found, start, axis, rising, budget)
    ]
    return replace(found, edges=tuple(edges))


def start_cell(found: StabilityMap) -> tuple[int, int] | None:
    """Cell from which edges are searched: that of the scene, once it has been run.

    If the scene has a value on one axis only, it is the middle of the longest accurate run.
    """
    plan = found.plan
    if plan.own is None:
        return None
    cell = plan.cell or _middle_of_the_good(found, plan.own)
    if cell is None or found.verdicts[plan.own.method][cell] == Verdict.NOT_RUN:
        return None
    return cell


def _middle_of_the_good(found: StabilityMap, own: Own) -> tuple[int, int] | None:
    line = found.plan.cross
    codes = found.verdicts[own.method]
    longest: list[tuple[int, int]] = []
    run: list[tuple[int, int]] = []
    for cell in line:
        run = [*run, cell] if codes[cell] == Verdict.ACCURATE else []
        longest = max(longest, run, key=len)
    return longest[len(longest) // 2] if longest else None


def _open_axes(own: Own | None) -> list[str]:
    """Axes along which edges are searched; a scene with a value on one axis keeps that value."""
    if own is None:
        return []
    if own.x is None or own.y is None:
        return ["x"] if own.x is None else ["y"]
    return ["x", "y"]


def _edges(
    found: StabilityMap,
    start: tuple[int, int],
    axis: str,
    rising: bool,
    budget: Budget | None,
) -> Iterator[Edge]:
    own = Verdict(found.verdicts[_method(found)][start])
    edge = _edge(found, start, axis, rising, _equivalent(own), budget)
    yield edge
    if own not in _BAD and edge.verdict is Verdict.INACCURATE:
        yield _edge(found, start, axis, rising, _SEEN_STABLE, budget)


def _method(found: StabilityMap) -> str:
    assert found.plan.own is not None
    return found.plan.own.method


def _equivalent(own: Verdict) -> set[Verdict]:
    """Verdicts that do not count as a change: a knocking pump may knock differently or not."""
    if own in _BAD:
        return _BAD
    return {own, Verdict.ACCURATE, *(_KNOCKING if own in _KNOCKING else ())}


def _edge(
    found: StabilityMap,
    start: tuple[int, int],
    axis: str,
    rising: bool,
    same: set[Verdict],
    budget: Budget | None,
) -> Edge:
    """Go from the start to the first cell with another verdict, then bisect the interval."""
    plan, codes = found.plan, found.verdicts[_method(found)]
    values = (plan.x if axis == "x" else plan.y).values
    place = start[1] if axis == "x" else start[0]
    inside = values[place]
    for k in range(place + 1, len(values)) if rising else range(place - 1, -1, -1):
        i, j = (start[0], k) if axis == "x" else (k, start[1])
        verdict = Verdict(codes[i, j])
        if verdict is Verdict.NOT_RUN:
            return Edge(axis=axis, rising=rising, inside=inside, whole=False)
        if verdict not in same:
            word = found.words[_method(found)][i][j]
            return _halved(
                found,
                start,
                Edge(
                    axis=axis,
                    rising=rising,
                    inside=inside,
                    outside=values[k],
                    verdict=verdict,
                    word=word,
                ),
                same,
                budget,
            )
        inside = values[k]
    return Edge(axis=axis, rising=rising, inside=inside)


def _halved(
    found: StabilityMap,
    start: tuple[int, int],
    edge: Edge,
    same: set[Verdict],
    budget: Budget | None,
) -> Edge:
    plan = found.plan
    axis = plan.x if edge.axis == "x" else plan.y
    for _ in range(_HALVINGS):
        middle = _between(axis, edge.inside, edge.outside)
        if middle in (edge.inside, edge.outside) or (budget is not None and budget.spent):
            break
        at = (
            (middle, plan.y.values[start[0]])
            if edge.axis == "x"
            else (plan.x.values[start[1]], middle)
        )
        verdict, word = plan.judges[_method(found)](*at)
        if verdict in same:
            edge = replace(edge, inside=middle)
        else:
            edge = replace(edge, outside=middle, verdict=verdict, word=word)
    return edge


def _between(axis: MapAxis, one: float, other: float) -> float:
    middle = math.sqrt(one * other) if axis.log else 0.5 * (one + other)
    return float(2 * round(middle / 2)) if axis.even else middle


# --- in words


def conclusion(found: StabilityMap) -> str:
    """Conclusion of a map for its scene, in a sentence or two.

    Parameters
    ----------
    found : StabilityMap
        Map with its edges.

    Returns
    -------
    str
    """
    own = found.plan.own
    if own is None:
        return "The scene is outside this map."
    start = start_cell(found)
    if start is None and found.plan.cell is None and _run(found, found.plan.cross):
        return f"{_where(found)} nothing is accurate."
    if start is None:
        return "The budget ended before the cell of this scene was run."
    verdict = Verdict(found.verdicts[own.method][start])
    parts = [_as_written(found, start, verdict), _distance(found, verdict)]
    if not _run(found, found.plan.cross):
        parts.append("The budget ended before all of the scene's row and column were run.")
    return " ".join(part for part in (*parts, own.note) if part)


def _run(found: StabilityMap, cells: list[tuple[int, int]]) -> bool:
    codes = found.verdicts[_method(found)]
    return all(codes[cell] != Verdict.NOT_RUN for cell in cells)


def _where(found: StabilityMap) -> str:
    """Value of the scene on its only axis, in words."""
    plan, own = found.plan, found.plan.own
    assert own is not None
    axis, value = (plan.y, own.y) if own.x is None else (plan.x, own.x)
    return f"At this scene's {axis.quantity} = {axis.written(value or 0.0)}"


def _as_written(found: StabilityMap, start: tuple[int, int], verdict: Verdict) -> str:
    plan = found.plan
    if plan.cell is None:
        axis = plan.x if plan.own is not None and plan.own.x is None else plan.y
        ends = " to ".join(axis.written(e.inside) for e in reversed(found.edges[:2]))
        return f"{_where(found)} this method is accurate for {axis.quantity} = {ends}."
    i, j = start
    word = "" if verdict is Verdict.ACCURATE else found.words[_method(found)][i][j]
    return (
        f"As written ({plan.x.quantity} {plan.x.written(plan.x.values[j])}, "
        f"{plan.y.quantity} {plan.y.written(plan.y.values[i])}): {verdict.text}"
        f"{_why(word)}."
    )


def _why(word: str) -> str:
    """Explanation of a cell for use in a sentence, without the name of its status and the cure."""
    name, sign, text = word.partition(": ")
    short = (text if sign and name.isidentifier() else word).partition(";")[0]
    return f", {short}" if short else ""


def _distance(found: StabilityMap, verdict: Verdict) -> str:
    if found.plan.cell is None:
        return ""
    ends = [edge for edge in found.edges if edge.verdict is not Verdict.NOT_RUN]
    if verdict in _BAD:
        return _nearest_other(found, ends)
    if not ends:
        return f"No failure found: {_ranges(found, _first_ones(found))}."
    nearest = min(ends, key=lambda edge: _ratio(found, edge))
    soft = nearest.verdict is Verdict.INACCURATE
    said = f"{'Accurate' if soft else 'Stable'} {_reach(found, nearest)}; next failure: "
    said += f"{nearest.verdict.text}{_why(nearest.word)}."
    hard = [e for e in ends if e.axis == nearest.axis and e.rising == nearest.rising]
    if soft and len(hard) > 1:
        said += f" Stable {_reach(found, hard[1])}, then: {hard[1].verdict.text}."
    others = [e for e in _first_ones(found) if e not in hard]
    return f"{said} In the other directions: {_ranges(found, others)}." if others else said


def _first_ones(found: StabilityMap) -> list[Edge]:
    """First edge in each direction; without directions that end at the scene."""
    kept: dict[tuple[str, bool], Edge] = {}
    for edge in found.edges:
        informative = edge.verdict is not Verdict.NOT_RUN or not edge.whole
        if informative or _is_notable(factor_of(found, edge)):
            kept.setdefault((edge.axis, edge.rising), edge)
    return list(kept.values())


def _is_notable(factor: float) -> bool:
    """Whether the end of an axis is far enough to be mentioned: a map may end at the scene."""
    return max(factor, 1 / factor) > _LEAST_FACTOR


def _nearest_other(found: StabilityMap, ends: list[Edge]) -> str:
    if not ends:
        return f"No better value found: {_ranges(found, found.edges)}."
    nearest = min(ends, key=lambda edge: _ratio(found, edge))
    return f"Nearest {nearest.verdict.text} cell: {_times(found, nearest, nearest.outside)}."


def _ranges(found: StabilityMap, edges: list[Edge] | tuple[Edge, ...]) -> str:
    return ", ".join(
        f"{_reach(found, edge)}{'' if edge.verdict is not Verdict.NOT_RUN else _end(edge)}"
        for edge in edges
    )


def _end(edge: Edge) -> str:
    return " (end of the map)" if edge.whole else " (not run beyond)"


def _reach(found: StabilityMap, edge: Edge) -> str:
    return f"{'up' if edge.rising else 'down'} to {_times(found, edge, edge.inside)}"


def _times(found: StabilityMap, edge: Edge, value: float) -> str:
    axis = found.plan.x if edge.axis == "x" else found.plan.y
    factor = value / _own_value(found, edge)
    if abs(factor - 1) < 1e-9:
        return f"this {axis.quantity}"
    return f"{factor:.2g} times this {axis.quantity}"


def _own_value(found: StabilityMap, edge: Edge) -> float:
    own = found.plan.own
    value = None if own is None else own.x if edge.axis == "x" else own.y
    return math.nan if value is None else value


def factor_of(found: StabilityMap, edge: Edge) -> float:
    """Last good value of an edge over that of the scene; NaN if the scene has none."""
    return edge.inside / _own_value(found, edge)


def _ratio(found: StabilityMap, edge: Edge) -> float:
    factor = edge.outside / _own_value(found, edge)
    return max(factor, 1 / factor)
