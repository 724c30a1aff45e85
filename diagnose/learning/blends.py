"""Regressions as they predict: lines, trees, and blends of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .nets import Nets

Float = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Linear:
    """A target as a linear function of the features.

    Attributes
    ----------
    centre, spread, weight : numpy.ndarray [shape=(n_features,)]
        ``offset + sum(weight * (feature - centre) / spread)`` is the target, or its logarithm.
    low, high : numpy.ndarray [shape=(n_features,)]
        Features beyond are set to these: a line goes on for ever, and what it learnt does not.
    offset : float
        At the centre.
    log : bool
        The logarithm was fitted.
    """

    centre: Float
    spread: Float
    weight: Float
    low: Float
    high: Float
    offset: float
    log: bool

    def predict(self, rows: Float) -> Float:
        """Target [shape=(n,)] of feature rows [shape=(n, n_features)]."""
        value = (
            np.clip(rows, self.low, self.high) - self.centre
        ) / self.spread @ self.weight + self.offset
        return _back(np.asarray(value), self.log)


@dataclass(frozen=True, kw_only=True)
class Forest:
    """Regression trees, all in one table of nodes; their leaves add up.

    Attributes
    ----------
    feature : numpy.ndarray [shape=(n_nodes,)]
        Column that a node asks for.
    threshold : numpy.ndarray [shape=(n_nodes,)]
        The way leads to `left` where the feature, in single precision, is at most this.
    left, right : numpy.ndarray [shape=(n_nodes,)]
        Nodes that follow; a leaf follows itself.
    value : numpy.ndarray [shape=(n_nodes,)]
        What a leaf adds.
    root : numpy.ndarray [shape=(n_trees,)]
        First node of each tree.
    depth : int
        Steps from a root to the farthest leaf.
    offset : float
        Added to the sum of the leaves.
    log : bool
        The logarithm of the target was fitted.
    """

    feature: NDArray[np.intp]
    threshold: Float
    left: NDArray[np.intp]
    right: NDArray[np.intp]
    value: Float
    root: NDArray[np.intp]
    depth: int
    offset: float
    log: bool

    def predict(self, rows: Float) -> Float:
        """Target [shape=(n,)] of feature rows [shape=(n, n_features)]."""
        single = np.asarray(rows, dtype=np.float32)  # as the trees were grown
        place = np.arange(len(rows))[:, None]
        node = np.repeat(self.root[None, :], len(rows), axis=0)
        for _ in range(self.depth):
            below = single[place, self.feature[node]] <= self.threshold[node]
            node = np.where(below, self.left[node], self.right[node])
        return _back(self.value[node].sum(axis=1) + self.offset, self.log)


def _back(value: Float, log: bool) -> Float:
    # e^50 is absurd enough, and finite
    return np.exp(np.clip(value, -50.0, 50.0)) if log else value


Part = Linear | Forest | Nets


@dataclass(frozen=True, kw_only=True)
class Blend:
    """A weighted mean of parts.

    Attributes
    ----------
    names : tuple of str
        Candidate that each part is of.
    parts : tuple of Linear, Forest or Nets
    weights : numpy.ndarray [shape=(n_parts,)]
        Positive, of sum 1.
    low, high : float
        Estimates outside are set to the bound: a factor of two beyond what was trained, where an
        estimate is a bound anyway.
    tube : float
        Lines and nets may point this far from the trees, as a logarithm; farther, they are set to
        it: what 99 of 100 held-out records keep to. 0 where all parts are of one kind.

    Examples
    --------
    >>> one = np.ones(1)
    >>> flat = Linear(
    ...     centre=0 * one, spread=one, weight=one, low=0 * one, high=9 * one, offset=2.0, log=False
    ... )
    >>> Blend(names=("a",), parts=(flat,), weights=np.ones(1), low=0.0, high=9.0).predict(
    ...     np.array([[1.0], [50.0]])
    ... ).tolist()
    [3.0, 9.0]
    """

    names: tuple[str, ...]
    parts: tuple[Part, ...]
    weights: Float
    low: float
    high: float
    tube: float = 0.0

    def predict(self, rows: Float) -> Float:
        """Target [shape=(n,)] of feature rows [shape=(n, n_features)]."""
        smooth, trees = self._sides(rows)
        share = float(self.weights @ self._smooth)
        return np.clip(together(smooth, trees, share, self.tube), self.low, self.high)

    def disagreement(self, rows: Float) -> Float:
        """How far smooth parts and trees are apart, as a logarithm [shape=(n,)]; 0 of one kind."""
        smooth, trees = self._sides(rows)
        return np.abs(np.log(smooth / trees))

    def _sides(self, rows: Float) -> tuple[Float, Float]:
        found = np.stack([part.predict(rows) for part in self.parts], axis=1)
        return sides(np.clip(found, self.low, self.high), self.weights, self._smooth)

    @property
    def members(self) -> dict[str, float]:
        """Weight of each part."""
        return dict(zip(self.names, self.weights.tolist(), strict=True))

    def shares(self, rows: Float) -> Float:
        """Shares of regimes [shape=(n, 0)]: a single blend has none."""
        return np.empty((len(rows), 0))

    @property
    def _smooth(self) -> Float:
        return np.array([is_smooth(part) for part in self.parts], dtype=np.float64)


def is_smooth(part: Part) -> bool:
    """Whether a part goes on beyond what it learnt, as a line or a net does and no tree."""
    return not isinstance(part, Forest)


def together(smooth: Float, trees: Float, share: float, tube: float) -> Float:
    """Mean of smooth parts, of this share, and trees, which hold them within the tube."""
    if 0 < share < 1:
        smooth = trees * np.exp(np.clip(np.log(smooth / trees), -tube, tube))
    return np.asarray(share * smooth + (1 - share) * trees)


def sides(found: Float, weights: Float, smooth: Float) -> tuple[Float, Float]:
    """Estimates of smooth parts and of trees; where one kind is missing, those of the other.

    Parameters
    ----------
    found : numpy.ndarray [shape=(…, n, n_parts)]
    weights, smooth : numpy.ndarray [shape=(n_parts,)]
        One where a part is smooth, see :func:`is_smooth`.

    Returns
    -------
    smooth, trees : numpy.ndarray [shape=(…, n)]

    Examples
    --------
    >>> line, trees = sides(np.array([[1.0, 2.0, 4.0]]), np.full(3, 1 / 3), np.array([1, 0, 0]))
    >>> line.tolist(), trees.round(9).tolist()
    ([1.0], [3.0])
    """
    own = [weights * smooth, weights * (1 - smooth)]
    one, other = (each if each.any() else weights for each in own)
    return found @ one / one.sum(), found @ other / other.sum()
