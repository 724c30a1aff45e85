"""Classifiers of faults other than the wear, and of regimes that change the sound of wear."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .blends import Blend
from .regressions import CANDIDATES, Fitted, Folds, RegressionCandidate, fit_blend

Float = NDArray[np.float64]

PRESENT = 0.5
"""Probability from which on it is likelier there than not."""

_LEAST_CHANCE = 1e-12
_LOGISTIC_C = 10.0  # weak: one slope on hundreds of records


@dataclass(frozen=True, kw_only=True)
class Head:
    """Classifier of one fault other than the wear, or of one regime.

    Attributes
    ----------
    name : str
    blend : Blend
        Features to 1 (absent) … 2 (present).
    slope, offset : float
        ``probability = 1 / (1 + exp(-(offset + slope * value)))``
    threshold : float
        Probability above which it is called present.
    """

    name: str
    blend: Blend
    slope: float
    offset: float
    threshold: float

    def probability(self, rows: Float) -> Float:
        """Probability [shape=(n,)] of feature rows [shape=(n, n_features)]."""
        return np.asarray(1 / (1 + np.exp(-(self.offset + self.slope * self.blend.predict(rows)))))


@dataclass(frozen=True, kw_only=True)
class FittedHead:
    """A head with its behaviour on groups that it had not seen.

    Attributes
    ----------
    head : Head
    members : dict of str to float
        Weight of each part of its blend.
    probability, shifted : numpy.ndarray [shape=(n,)]
        Probability of every record, and of the same record on other machines.
    """

    head: Head
    members: dict[str, float]
    probability: Float
    shifted: Float


def logit(probability: float) -> float:
    """Logarithm of the odds, which are kept finite.

    Examples
    --------
    >>> logit(0.5), round(logit(1.0))
    (0.0, 28)
    """
    kept = min(max(probability, _LEAST_CHANCE), 1.0 - _LEAST_CHANCE)
    return math.log(kept / (1.0 - kept))


def told_apart(fitted: FittedHead, here: NDArray[np.bool_], share: float) -> Head:
    """A head that calls no more than a share of the records without it present.

    Parameters
    ----------
    fitted : FittedHead
    here : numpy.ndarray [shape=(n,)]
        Whether each record has it.
    share : float
        Share of the records without it.

    Returns
    -------
    Head
        Its threshold is never below the share of the records that have it: those below are
        likelier without it, however rare that is.

    Examples
    --------
    >>> fitted = FittedHead(
    ...     head=Head(name="oil", blend=None, slope=1.0, offset=0.0, threshold=0.5), members={},
    ...     probability=np.r_[np.linspace(0.0, 0.4, 101), 0.9], shifted=np.zeros(102))
    >>> told_apart(fitted, np.arange(102) > 100, 0.1).threshold
    0.36
    """
    usual = float(np.quantile(fitted.probability[~here], 1.0 - share, method="higher"))
    return replace(fitted.head, threshold=max(usual, float(here.mean())))


def fit_head(
    name: str,
    rows: Float,
    here: NDArray[np.bool_],
    folds: Folds,
    *,
    seed: int = 0,
    candidates: Sequence[RegressionCandidate] = CANDIDATES,
    shifted: Float | None = None,
) -> FittedHead:
    """Regress presence as 1 or 2, and turn out-of-fold values to a probability.

    Parameters
    ----------
    name : str
    rows : numpy.ndarray [shape=(n, n_features)]
    here : numpy.ndarray [shape=(n,)]
        Whether each record has it.
    folds, seed, candidates, shifted
        As of :func:`~.regressions.fit_blend`.

    Returns
    -------
    FittedHead
    """
    from sklearn.linear_model import LogisticRegression

    fitted: Fitted[Blend] = fit_blend(
        rows,
        1.0 + here.astype(np.float64),
        folds,
        seed=seed,
        candidates=candidates,
        shifted=shifted,
    )
    logistic = LogisticRegression(C=_LOGISTIC_C).fit(fitted.estimate[:, None], here)
    head = Head(
        name=name,
        blend=fitted.blend,
        slope=float(logistic.coef_[0, 0]),
        offset=float(logistic.intercept_[0]),
        threshold=PRESENT,
    )
    return FittedHead(
        head=head,
        members=fitted.blend.members,
        probability=logistic.predict_proba(fitted.estimate[:, None])[:, 1],
        shifted=logistic.predict_proba(fitted.shifted_estimate[:, None])[:, 1],
    )
