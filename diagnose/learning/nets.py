"""Small neural networks of severity: smooth as a line, and bent where the features bend.

They see a recording as some hundred principal directions of its features, each weighted by its
importance for the target: otherwise hundreds of bands fill the directions and hide the few features
that matter. What is fitted is plain arrays, asked with numpy alone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

FEWEST_RECORDS = 150
"""Records from which a network is worth its training; with fewer, trees err less on pumps."""

_DIRECTIONS = 300
_TREES = 60  # of the forest that finds the importance of the features
_LEAF = 5  # records in each of its leaves, at least
_TRIED = 0.1  # share of the features that are tried at each of its nodes
_RECORDS = 3000  # that it sees, at most: enough to rank features, in a few seconds
_HIDDEN = (128, 32)
_NETS = 4
_PENALTY = 0.1
_BATCH = 200  # records a step
_ROUNDS = 40
_FARTHEST = 4.0  # deviations of a feature: where a net's own tail begins, which nothing taught
_LARGEST = 50.0  # logarithm of an estimate: e^50 is absurd enough, and finite


@dataclass(frozen=True, kw_only=True)
class Nets:
    """Mean of a few networks of two hidden layers, whose units pass what is positive.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_features,)]
        Features are taken as deviations, within +-4.
    direction : numpy.ndarray [shape=(n_features, n_directions)]
        Principal directions of the features weighted by their importances, scaled so that
        the first has one deviation over the training records, then a direction for each noted
        condition.
    first, second, last : numpy.ndarray [shape=(n_nets, n_directions, n_1), (n_nets, n_1, n_2), \
(n_nets, n_2)]
        Weights.
    first_bias, second_bias, last_bias : numpy.ndarray [shape=(n_nets, n_1), (n_nets, n_2), \
(n_nets,)]
    scale, offset : float
        The logarithm of the target is ``offset + scale * output``.
    """

    centre: Float
    spread: Float
    direction: Float
    first: Float
    first_bias: Float
    second: Float
    second_bias: Float
    last: Float
    last_bias: Float
    scale: float
    offset: float

    def predict(self, rows: Float) -> Float:
        """Target [shape=(n,)] of feature rows [shape=(n, n_features)]."""
        seen = deviations(rows, self.centre, self.spread) @ self.direction
        found = np.zeros(len(rows))
        for i in range(len(self.first)):
            hidden = np.maximum(seen @ self.first[i] + self.first_bias[i], 0.0)
            hidden = np.maximum(hidden @ self.second[i] + self.second_bias[i], 0.0)
            found += hidden @ self.last[i] + self.last_bias[i]
        value = self.offset + self.scale * found / len(self.first)
        return np.asarray(np.exp(np.clip(value, -_LARGEST, _LARGEST)))


def deviations(rows: Float, centre: Float, spread: Float) -> Float:
    """Standardised features, held within what a net was taught."""
    return np.clip((rows - centre) / spread, -_FARTHEST, _FARTHEST)


def fit_nets(rows: Float, moved: Float, target: Float, seed: int, noted: int) -> Nets:
    """Fit on records as they are and on the same records with their resonances elsewhere.

    Parameters
    ----------
    rows, moved : numpy.ndarray [shape=(n, n_features)]
        Both are taught, with the same target.
    target : numpy.ndarray [shape=(n,)]
        > 0.
    seed : int
        Seed of the initial weights and of the order of the records.
    noted : int
        Number of columns at the end that are noted conditions. Each is an input by itself: the
        principal directions of a thousand features hold next to nothing of a single column.

    Returns
    -------
    Nets
    """
    from sklearn.preprocessing import StandardScaler

    scaler = StandardScaler().fit(rows)
    here = deviations(rows, scaler.mean_, scaler.scale_)
    level = np.log(target)
    offset, scale = float(level.mean()), float(level.std()) or 1.0
    direction = _directions(here, _importances(here, level, seed), noted)
    there = deviations(moved, scaler.mean_, scaler.scale_)
    # a resonance elsewhere changes nothing of what was noted
    there[:, there.shape[1] - noted :] = here[:, here.shape[1] - noted :]
    seen = np.vstack([here, there]) @ direction
    taught = np.tile((level - offset) / scale, 2)
    nets = [_net(seen, taught, seed + i) for i in range(_NETS)]

    def stacked(of: str, layer: int) -> Float:
        return np.stack([np.asarray(getattr(net, of)[layer], dtype=np.float64) for net in nets])

    return Nets(
        centre=scaler.mean_,
        spread=scaler.scale_,
        direction=direction,
        first=stacked("coefs_", 0),
        first_bias=stacked("intercepts_", 0),
        second=stacked("coefs_", 1),
        second_bias=stacked("intercepts_", 1),
        last=stacked("coefs_", 2)[:, :, 0],
        last_bias=stacked("intercepts_", 2)[:, 0],
        scale=scale,
        offset=offset,
    )


def _importances(deviation: Float, level: Float, seed: int) -> Float:
    """Importance of each column for the logarithm of the target, by a forest of random splits."""
    from sklearn.ensemble import ExtraTreesRegressor

    records = np.random.default_rng(seed).permutation(len(deviation))[:_RECORDS]
    forest = ExtraTreesRegressor(
        _TREES, min_samples_leaf=_LEAF, max_features=_TRIED, random_state=seed
    ).fit(deviation[records], level[records])
    # a sum over all splits, which rounding may leave just below zero
    return np.asarray(np.maximum(forest.feature_importances_, 0.0))


def _directions(deviation: Float, importance: Float, noted: int) -> Float:
    """Principal directions of the weighted features, and the noted conditions as they are."""
    from sklearn.decomposition import PCA

    features = deviation.shape[1] - noted
    # the variance of a feature is its importance, if any has one
    known = importance[:features]
    weight = np.sqrt(known) if known.any() else np.ones(features)
    count = min(_DIRECTIONS, features, len(deviation) // 2)
    weighted = deviation[:, :features] * weight
    found = PCA(count, svd_solver="covariance_eigh").fit(weighted)
    direction = np.zeros((features + noted, count + noted))
    # not whitened: what the directions of small variance hold is noise for the most part
    scaled = found.components_.T / np.sqrt(found.explained_variance_[0])
    direction[:features, :count] = weight[:, None] * scaled
    direction[features:, count:] = np.eye(noted)
    return direction


def _net(seen: Float, taught: Float, seed: int) -> Any:
    from sklearn.neural_network import MLPRegressor

    net = MLPRegressor(
        hidden_layer_sizes=_HIDDEN,
        alpha=_PENALTY,
        batch_size=min(_BATCH, len(seen)),
        random_state=seed,
    )
    for _ in range(_ROUNDS):  # each through all records; ended by number, not when it gains little
        net.partial_fit(seen, taught)
    return net
