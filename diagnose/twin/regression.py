"""One step of the inversion: unknowns as a linear function of levels, over an ensemble.

The gain of an ensemble Kalman step is the regression of the unknowns on the observations. With
fewer members than levels it is underdetermined and must be regularised; the strength is chosen for
each unknown by its error on left-out members. The same errors comprise noise, uninformative levels
and nonlinearity, and give the posterior.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

LEAST_SCATTER = 0.5
"""Added to the scatter of a level [dB]: simulated levels agree with measured ones no better."""
HUBER = 3.0
"""Standard deviations of the ensemble beyond which a level of the recording counts less."""
STRENGTHS = 10.0 ** np.arange(-3.5, 2.1, 0.5)
"""Regularisation strengths, over the mean eigenvalue."""
WEIGHTS = (0.0, 1.0, 30.0)
"""Weights of each kind of further numbers, relative to all levels together."""


@dataclass(frozen=True)
class Regressed:
    """Unknowns of one recording, from an ensemble.

    Attributes
    ----------
    mean : ndarray [shape=(n_names,)]
        Normal scores.
    residuals : ndarray [shape=(n_members, n_names)]
        Errors on left-out members.
    """

    mean: Float
    residuals: Float

    @property
    def sd(self) -> Float:
        """Root mean square of the residuals [shape=(n_names,)]."""
        return np.asarray(np.sqrt((self.residuals**2).mean(axis=0)))


def regressed(scores: Float, levels: Float, *further: Float) -> Regressed:
    """Regress scores on levels and further numbers; their last row is that of the recording.

    Parameters
    ----------
    scores : ndarray [shape=(n, n_names)]
        Scores of the members.
    levels : ndarray [shape=(n + 1, n_levels)]
        [dB]
    further : ndarray [shape=(n + 1, n_numbers)]
        Other kinds of numbers that depend on the unknowns, each about as wide as the scores.
    """
    mean, residuals = scores.mean(axis=0), scores - scores.mean(axis=0)
    best = (residuals**2).mean(axis=0)
    centred, base = residuals.copy(), mean.copy()
    of_levels, others = _products(_scaled(levels)), [_products(each) for each in further]
    for weights in itertools.product(WEIGHTS, repeat=len(others)):
        products = of_levels + sum(w * o for w, o in zip(weights, others, strict=True))
        for found, left_out in _ridges(products, centred):
            error = (left_out**2).mean(axis=0)
            better = error < best
            best = np.where(better, error, best)
            mean = np.where(better, base + found, mean)
            residuals = np.where(better, left_out, residuals)
    return Regressed(mean=mean, residuals=residuals)


def _scaled(rows: Float) -> Float:
    """Scaled deviations from the members' mean; levels beyond all members count less."""
    members = rows[:-1]
    scatter = np.sqrt(members.var(axis=0) + LEAST_SCATTER**2)
    found = (rows - members.mean(axis=0)) / scatter
    weights = np.minimum(1.0, HUBER / np.maximum(np.abs(found[-1]), 1e-9))
    return np.asarray(found * weights)


def _products(rows: Float) -> Float:
    return np.asarray(rows @ rows[:-1].T / max(rows.shape[1], 1))


def _ridges(products: Float, scores: Float) -> list[tuple[Float, Float]]:
    """Prediction and left-out errors for every strength, from one decomposition."""
    count = len(scores)
    inner = products[:-1]
    last = products[-1] - inner.mean(axis=0)
    inner = inner - inner.mean(axis=0)
    inner = inner - inner.mean(axis=1, keepdims=True)
    last = last - last.mean()
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    values = np.maximum(values, 0.0)
    turned = vectors.T @ scores
    found = []
    for strength in STRENGTHS * values.mean():
        smooth = values / (values + strength)
        leverage = (vectors**2) @ smooth + 1 / count
        fitted = vectors @ (smooth[:, np.newaxis] * turned)
        left_out = (scores - fitted) / (1 - leverage)[:, np.newaxis]
        ahead = (last @ vectors) / (values + strength) @ turned
        found.append((ahead, left_out))
    return found
