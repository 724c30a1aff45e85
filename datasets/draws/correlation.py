"""Correlated draws: a Gaussian copula between draws of one level of a recipe."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import ndtr, ndtri

from ...sim.parts.part import Part
from ...sim.scene.scene import SceneError
from .draws import Axis, Draw, Range

Float = NDArray[np.float64]

_LEAST_EIGENVALUE = 1e-6  # of a correlation matrix: below it two draws are practically one


class Correlation(Part):
    """Draws with correlated ranks, the same for every pair."""

    paths: tuple[str, ...] = Field(min_length=2, description="draws of one level, as written there")
    rank: float = Field(gt=-1, lt=1, description="Spearman's rank correlation of each pair")


@dataclass(frozen=True)
class Copula:
    """Correlation of some coordinates of a point.

    Attributes
    ----------
    places : numpy.ndarray of int [shape=(n,)]
        Indices of the coordinates, rising.
    factor : numpy.ndarray [shape=(n, n)]
        Lower triangular matrix; its product with independent normal values has the correlation.
    """

    places: NDArray[np.int64]
    factor: Float

    def __call__(self, point: Float) -> Float:
        """The point with its coordinates correlated [shape=(n_dimensions,)]; the first stays."""
        result = point.copy()
        result[self.places] = ndtr(self.factor @ ndtri(point[self.places]))
        return result


def pearson(rank: float) -> float:
    """Correlation of two normal values whose ranks have a given correlation.

    Parameters
    ----------
    rank : float
        Spearman's rank correlation, -1 to 1.

    Returns
    -------
    float
        ``2 sin(pi / 6 rank)``.

    References
    ----------
    Kruskal, "Ordinal measures of association", J. Am. Stat. Assoc. 53 (1958) 814-861,
    doi:10.1080/01621459.1958.10501481.

    Examples
    --------
    >>> round(pearson(0.5), 4)
    0.5176
    """
    return 2 * math.sin(math.pi / 6 * rank)


def copula_of(
    correlations: Sequence[Correlation],
    levels: Mapping[str, Sequence[tuple[Draw, Sequence[Axis]]]],
    faults: list[str],
) -> dict[str, Copula]:
    """Resolve correlations, each of which must be between draws of one level.

    Parameters
    ----------
    correlations : sequence of Correlation
        Correlations as in the recipe.
    levels : mapping
        Draws of each level, by its name, each with the axes that its path matches. For two draws
        with ``*``, the first entries are correlated, the second ones, and so on.
    faults : list of str
        List to which faults are added: paths that are not drawn, draws of several levels, of tables
        or of unequal number, pairs given twice, and correlations that contradict each other.

    Returns
    -------
    dict of str to Copula
        Copula by level; none for a level without correlations.
    """
    ranks: dict[str, dict[tuple[str, str], float]] = {name: {} for name in levels}
    for number, correlation in enumerate(correlations):
        try:
            name, rows = _rows(correlation, levels)
            pairs = [pair for row in zip(*rows, strict=True) for pair in combinations(row, 2)]
            _refuse_again(pairs, ranks[name])
        except SceneError as error:
            faults += [f"correlation.{number}: {fault}" for fault in error.faults]
            continue
        ranks[name] |= dict.fromkeys(pairs, correlation.rank)
    found: dict[str, Copula] = {}
    for name, ranks_of_level in ranks.items():
        if not ranks_of_level:
            continue
        entries = [e for _, axes in levels[name] for axis in axes for e in axis.entries]
        try:
            found[name] = _factored(name, ranks_of_level, entries)
        except SceneError as error:
            faults += error.faults
    return found


def _rows(
    correlation: Correlation, levels: Mapping[str, Sequence[tuple[Draw, Sequence[Axis]]]]
) -> tuple[str, list[list[str]]]:
    """Level of a correlation, and the coordinates of each of its paths."""
    found = [_where(path, levels) for path in correlation.paths]
    names = sorted({name for name, _ in found})
    rows = [[axis.path for axis in axes if isinstance(axis, Range)] for _, axes in found]
    shown = ", ".join(correlation.paths)
    if len(names) > 1:
        fault = f"{shown} are of {' and '.join(names)}, must be of one level; remove it"
    elif len(set(correlation.paths)) < len(correlation.paths):
        fault = f"{shown}: a path is given twice, must be once; remove one"
    elif not all(rows):
        fault = f"{shown}: a table of numbers has no rank; name draws of single numbers"
    elif len({len(row) for row in rows}) > 1:
        counts = ", ".join(str(len(row)) for row in rows)
        fault = f"{shown} stand for {counts} values, must be as many each; name list entries"
    else:
        return names[0], rows
    raise SceneError("correlation", [fault])


def _where(
    path: str, levels: Mapping[str, Sequence[tuple[Draw, Sequence[Axis]]]]
) -> tuple[str, Sequence[Axis]]:
    """Level and axes of a draw by its path, or by that of one of its list entries."""
    for name, draws in levels.items():
        for draw, axes in draws:
            if draw.path == path:
                if not axes:
                    raise SceneError(path, [])  # its own fault has been reported
                return name, axes
            single = [axis for axis in axes if axis.path == path]
            if single:
                return name, single
    known = sorted({draw.path for draws in levels.values() for draw, _ in draws})
    raise SceneError(path, [f"{path} is not drawn, must be one of {', '.join(known)}"])


def _refuse_again(pairs: Sequence[tuple[str, str]], there: Mapping[tuple[str, str], float]) -> None:
    known = {frozenset(pair) for pair in there}
    faults = [
        f"{one} and {other} are correlated twice, must be once; remove one"
        for one, other in pairs
        if frozenset((one, other)) in known
    ]
    if faults:
        raise SceneError("correlation", faults)


def _factored(name: str, ranks: Mapping[tuple[str, str], float], entries: Sequence[str]) -> Copula:
    """Copula of the coordinates of one level."""
    places = sorted({entries.index(path) for pair in ranks for path in pair})
    order = {entries[place]: k for k, place in enumerate(places)}
    matrix = np.eye(len(places))
    for (one, other), rank in ranks.items():
        matrix[order[one], order[other]] = matrix[order[other], order[one]] = pearson(rank)
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least < _LEAST_EIGENVALUE:
        fault = (
            f"correlation: those of {', '.join(order)} ({name}) contradict each other, least "
            f"eigenvalue = {least:.3g} must be > 0; bring the ranks nearer to 0"
        )
        raise SceneError("correlation", [fault])
    factor: Float = np.linalg.cholesky(matrix).astype(np.float64)
    return Copula(np.array(places), factor)
