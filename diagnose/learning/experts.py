"""One blend for each regime that wear sounds different in, weighted by how likely each regime is.

A single fit for all regimes reads each as well as their mixture allows: a dry pin worse than a fit
of dry pins, though it is known to be dry.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blends import Blend
from .heads import FittedHead, Head
from .regressions import USUAL, Fitted, Index, RegressionOption, cheapest_good, front

Float = NDArray[np.float64]

FEWEST_RECORDS = 100
"""Least number of records of each regime, for a blend of its own."""


@dataclass(frozen=True, kw_only=True)
class Experts:
    """A blend for every regime, and the classifiers that recognise the regimes.

    Attributes
    ----------
    gates : tuple of Head
        Each gives the probability of one regime from the features.
    blends : tuple of Blend
        Inputs to target, in the order of the gates.
    first : int
        Column of the inputs at which the features begin that the gates ask for.
    features : int
        How many they are.
    tube : float
        Smooth parts and trees of 99 of 100 held-out records are no farther apart, as a logarithm.
    """

    gates: tuple[Head, ...]
    blends: tuple[Blend, ...]
    first: int
    features: int
    tube: float

    @property
    def low(self) -> float:
        """No estimate is below."""
        return min(blend.low for blend in self.blends)

    @property
    def names(self) -> tuple[str, ...]:
        """Candidates that its parts are of."""
        return tuple(dict.fromkeys(name for blend in self.blends for name in blend.names))

    @property
    def members(self) -> dict[str, float]:
        """Weight of each part within the blend of its regime."""
        return {
            f"{gate.name}: {part}": weight
            for gate, blend in zip(self.gates, self.blends, strict=True)
            for part, weight in blend.members.items()
        }

    def shares(self, rows: Float) -> Float:
        """Probability of each regime [shape=(n, n_regimes)]; they add up to 1."""
        asked = rows[:, self.first : self.first + self.features]
        return regime_shares([gate.probability(asked) for gate in self.gates])

    def predict(self, rows: Float) -> Float:
        """Target [shape=(n,)] of input rows [shape=(n, n_inputs)]."""
        return self._weighted(rows, lambda blend: blend.predict(rows))

    def disagreement(self, rows: Float) -> Float:
        """How far smooth parts and trees are apart, as a logarithm [shape=(n,)]."""
        return self._weighted(rows, lambda blend: blend.disagreement(rows))

    def _weighted(self, rows: Float, of: Callable[[Blend], Float]) -> Float:
        found = np.stack([of(blend) for blend in self.blends], axis=1)
        return np.asarray((self.shares(rows) * found).sum(axis=1))


def regime_shares(probabilities: Sequence[Float]) -> Float:
    """Normalise the probabilities of regimes [each shape=(n,)] to a sum of 1.

    Examples
    --------
    >>> regime_shares([np.array([0.9]), np.array([0.3])]).round(2).tolist()
    [[0.75, 0.25]]
    """
    # of no regime at all: each as likely, and no division by zero
    table = np.maximum(np.stack(probabilities, axis=1), np.finfo(np.float64).tiny)
    return np.asarray(table / table.sum(axis=1, keepdims=True))


def fit_experts(
    gates: Sequence[FittedHead],
    present: Sequence[NDArray[np.bool_]],
    target: Float,
    fit: Callable[[Index, int], Fitted[Blend]],
    *,
    first: int,
    features: int,
) -> Fitted[Experts]:
    """Fit a blend on the records of each regime.

    Parameters
    ----------
    gates : sequence of FittedHead
        Classifier of each regime.
    present : sequence of numpy.ndarray [each shape=(n,)]
        Whether each record is of the regime.
    target : numpy.ndarray [shape=(n,)]
        > 0.
    fit : callable
        ``fit(records, n_regimes)`` learns from these records and estimates all, in its share of
        the time that a prediction may take.
    first, features : int
        As of :class:`Experts`.

    Returns
    -------
    Fitted
        Estimates of every record by blends and gates that its group had no part in.
    """
    fits = [fit(np.flatnonzero(here), len(present)) for here in present]
    usual = regime_shares([gate.probability for gate in gates])
    strange = regime_shares([gate.shifted for gate in gates])

    def mixed(shares: Float, found: Sequence[Float]) -> Float:
        return np.asarray((shares * np.stack(found, axis=1)).sum(axis=1))

    estimate = mixed(usual, [one.estimate for one in fits])
    apart = mixed(usual, [one.disagreement for one in fits])
    option = RegressionOption(
        name=f"experts of {len(fits)} regimes",
        members=(),
        cost_ms=sum(one.cost_ms for one in fits),
        error=float(np.abs(estimate - target).mean()),
    )
    return Fitted(
        blend=Experts(
            gates=tuple(gate.head for gate in gates),
            blends=tuple(one.blend for one in fits),
            first=first,
            features=features,
            tube=float(np.quantile(apart, USUAL)),
        ),
        estimate=estimate,
        disagreement=apart,
        shifted_estimate=mixed(strange, [one.shifted_estimate for one in fits]),
        shifted_disagreement=mixed(strange, [one.shifted_disagreement for one in fits]),
        shares=usual,
        shifted_shares=strange,
        options=(option,),
        chosen=option.name,
    )


def better_of(
    one: Fitted[Blend], experts: Fitted[Experts], limit_ms: float
) -> Fitted[Blend] | Fitted[Experts]:
    """The cheaper of two fits unless the other errs less; both know all that was looked at."""
    options = front([*one.options, *experts.options])
    best = cheapest_good([o for o in options if o.name in (one.chosen, experts.chosen)], limit_ms)
    return (one if best.name == one.chosen else experts).knowing(options)
