"""Maps of :mod:`.stability.method_map` as plain values and as text, conclusions first."""

import math
from collections.abc import Sequence
from typing import Any

from ...sim.scene.scene import Scene
from .edges import conclusion, factor_of
from .method_map import Edge, StabilityMap, Verdict

_MOST_REASONS = 4
_FAILED = (Verdict.REFUSED, Verdict.FAILS, Verdict.UNSTABLE, Verdict.NOT_CONVERGED)


def stability_table(scene: Scene, maps: Sequence[StabilityMap]) -> dict[str, Any]:
    """Maps as plain values.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap

    Returns
    -------
    dict
        For every map: conclusion, position of the scene and edges around it, axes, verdicts by
        name, explanations of cells that are not accurate, theory.
    """
    return {"scene": scene.name, "maps": [_table(found) for found in maps]}


def _table(found: StabilityMap) -> dict[str, Any]:
    plan = found.plan
    return {
        "name": plan.name,
        "title": plan.title,
        "conclusion": conclusion(found),
        "whole": found.whole,
        "own": _own(found),
        "edges": [_edge(found, edge) for edge in found.edges],
        "judged_by": plan.note,
        "axes": {
            key: {"name": axis.name, "unit": axis.unit, "values": list(axis.values)}
            for key, axis in (("x", plan.x), ("y", plan.y))
        },
        "methods": [_method(found, name) for name in found.methods],
    }


def _own(found: StabilityMap) -> dict[str, Any] | None:
    own, cell = found.plan.own, found.plan.cell
    if own is None:
        return None
    verdict = None if cell is None else Verdict(found.verdicts[own.method][cell])
    return {
        "method": own.method,
        "x": own.x,
        "y": own.y,
        "verdict": None if verdict is None else verdict.name.lower(),
        "cause": None if verdict is None else verdict.cause or None,
        "word": "" if cell is None else found.words[own.method][cell[0]][cell[1]],
        "note": own.note,
    }


def _edge(found: StabilityMap, edge: Edge) -> dict[str, Any]:
    return {
        "axis": edge.axis,
        "rising": edge.rising,
        "inside": edge.inside,
        "outside": None if math.isnan(edge.outside) else edge.outside,
        "times_own": factor_of(found, edge),
        "verdict": edge.verdict.name.lower(),
        "cause": edge.verdict.cause or None,
        "word": edge.word,
        "run_to_the_end": edge.whole,
    }


def _method(found: StabilityMap, name: str) -> dict[str, Any]:
    plan = found.plan
    return {
        "name": name,
        "own": plan.own is not None and plan.own.method == name,
        "verdicts": [[Verdict(code).name.lower() for code in row] for row in found.verdicts[name]],
        "words": found.words[name],
        "shares": {v.name.lower(): share for v, share in found.share(name).items()},
        "theory": [
            {"name": curve.name, "x": list(curve.x), "y": list(curve.y)}
            for curve in plan.theory(name)
        ],
    }


def stability_text(scene: Scene, maps: Sequence[StabilityMap]) -> str:
    """Conclusion of every map, then the shares of its regions, one line per method.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap

    Returns
    -------
    str
    """
    lines = [f"{scene.name} (simulated): where its numerical methods fail"]
    for found in maps:
        plan = found.plan
        lines += ["", f"{plan.name}: {plan.title}", f"  {conclusion(found)}"]
        lines += [f"  {plan.x.label} against {plan.y.label}"]
        lines += [f"  criterion: {plan.note}"] if plan.note else []
        for method in found.methods:
            lines.append(f"  {method:24} {shares_text(found, method)}")
            lines += [f"    {count} x {word}" for word, count in reasons(found, method)]
    return "\n".join(lines)


def shares_text(found: StabilityMap, method: str) -> str:
    """Shares of the cells of a panel by verdict."""
    return ", ".join(f"{v.text} {s:.0%}" for v, s in found.share(method).items())


def reasons(found: StabilityMap, method: str) -> list[tuple[str, int]]:
    """Statuses of the failed cells with their counts, the most frequent first."""
    words = [
        word.partition(":")[0]
        for row, line in zip(found.verdicts[method], found.words[method], strict=True)
        for code, word in zip(row, line, strict=True)
        if code in _FAILED and word
    ]
    counts = {word: words.count(word) for word in sorted(set(words))}
    return sorted(counts.items(), key=lambda item: -item[1])[:_MOST_REASONS]
