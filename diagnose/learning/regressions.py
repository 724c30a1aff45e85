"""Regressions of severity, from fast to strong, and the choice among them by cost and error.

A candidate is one row of :data:`CANDIDATES`. What it fits is a part made of plain arrays, so that a
model file holds numbers only, and a prediction needs no library but numpy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from .blends import Blend, Forest, Linear, Part, is_smooth, sides, together
from .nets import FEWEST_RECORDS, fit_nets

Float = NDArray[np.float64]
Index = NDArray[np.intp]
Folds = Sequence[tuple[Index, Index]]

_TREES = 100
_ROUNDS = 200, 0.08  # of boosting, and what each adds of what is missing
_MANY_ROUNDS = 400, 0.05
_MANY_RECORDS = 1000
_LEAF = 20  # records in a leaf of boosting
_FEWEST_BOOSTED = 3 * _LEAF  # two leaves in every fold: of fewer records a tree is one number
_LEAST_WEIGHT = 0.02  # of a blend: a part that says less is left out, and its time saved
_TIE = 0.01  # of the error: a blend that is no better than this is not worth its time
_SLACK = 0.1  # of a feature's range: as far beyond it a line may go on
_ENDLESS = 1e6  # spreads of a feature: no bound, and still a number that a file may hold
USUAL = 0.99  # share of held-out records whose parts are no farther apart than the tube
_FAR = 2.0  # estimates end this factor beyond the trained severities


# --- candidates

Fit = Callable[[Float, Float, Float, int, int], Part]


def _ridge(penalty: float, *, log: bool) -> Fit:
    def fit(rows: Float, _moved: Float, target: Float, _seed: int, _noted: int) -> Linear:
        from sklearn.linear_model import Ridge
        from sklearn.preprocessing import StandardScaler

        scaler = StandardScaler().fit(rows)
        ridge = Ridge(penalty).fit(scaler.transform(rows), np.log(target) if log else target)
        return Linear(
            centre=scaler.mean_,
            spread=scaler.scale_,  # one where a feature is constant
            weight=np.asarray(ridge.coef_, dtype=float),
            low=rows.min(axis=0) - _SLACK * np.ptp(rows, axis=0),
            high=rows.max(axis=0) + _SLACK * np.ptp(rows, axis=0),
            offset=float(ridge.intercept_),
            log=log,
        )

    return fit


def _share(tried: int, rows: Float) -> float:
    """Share of the features that a node may choose from: as many, however many there are.

    A fixed share starves the trees of a short row, in which few features depend on the wear.
    """
    return min(1.0, tried / int(rows.shape[1]))


def _fit_trees(rows: Float, _moved: Float, target: Float, seed: int, _noted: int) -> Part:
    """Extremely randomised trees."""
    from sklearn.ensemble import ExtraTreesRegressor

    model = ExtraTreesRegressor(
        _TREES, min_samples_leaf=2, max_features=_share(320, rows), random_state=seed
    ).fit(rows.astype(np.float32), np.log(target))
    tables = [
        _Tree(
            feature=tree.feature,
            threshold=tree.threshold,
            left=tree.children_left,
            right=tree.children_right,
            value=tree.value[:, 0, 0] / _TREES,
            leaf=tree.children_left < 0,
        )
        for tree in (estimator.tree_ for estimator in model.estimators_)
    ]
    return _forest(tables, offset=0.0, log=True)


def _fit_boosting(rows: Float, _moved: Float, target: Float, seed: int, _noted: int) -> Part:
    """Boosted trees over histograms of the features."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from threadpoolctl import threadpool_limits

    rounds, rate = _MANY_ROUNDS if len(rows) >= _MANY_RECORDS else _ROUNDS
    model = HistGradientBoostingRegressor(
        max_iter=rounds,
        learning_rate=rate,
        max_leaf_nodes=15,
        min_samples_leaf=_LEAF,
        max_features=_share(160, rows),
        random_state=seed,
    )
    # its threads wait for each other in a loop: on a core that others use, 30 times slower than one
    with threadpool_limits(1, user_api="openmp"):
        model.fit(rows.astype(np.float32), np.log(target))
    nodes = [step[0].nodes for step in model._predictors]  # no public way to the trees
    tables = [
        _Tree(
            feature=table["feature_idx"].astype(np.intp),
            threshold=table["num_threshold"],
            left=table["left"].astype(np.intp),
            right=table["right"].astype(np.intp),
            value=table["value"],
            leaf=table["is_leaf"].astype(bool),
        )
        for table in nodes
    ]
    return _forest(tables, offset=float(np.ravel(model._baseline_prediction)[0]), log=True)


@dataclass(frozen=True, kw_only=True)
class _Tree:
    """Nodes of one tree, numbered from its root 0; of a leaf only the value counts."""

    feature: NDArray[Any]
    threshold: NDArray[Any]
    left: NDArray[Any]
    right: NDArray[Any]
    value: NDArray[Any]
    leaf: NDArray[np.bool_]


def _forest(tables: Sequence[_Tree], *, offset: float, log: bool) -> Forest:
    starts = [0, *accumulate(len(tree.value) for tree in tables)]
    itself = [np.arange(a, b) for a, b in pairwise(starts)]

    def joined(pick: Callable[[_Tree, int], NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate([pick(tree, i) for i, tree in enumerate(tables)])

    return Forest(
        feature=joined(lambda tree, _: np.where(tree.leaf, 0, tree.feature)).astype(np.intp),
        threshold=joined(lambda tree, _: np.where(tree.leaf, 0.0, tree.threshold)),
        left=joined(lambda tree, i: np.where(tree.leaf, itself[i], tree.left + starts[i])),
        right=joined(lambda tree, i: np.where(tree.leaf, itself[i], tree.right + starts[i])),
        value=joined(lambda tree, _: np.where(tree.leaf, tree.value, 0.0)),
        root=np.array(starts[:-1], dtype=np.intp),
        depth=max(_depth(tree) for tree in tables),
        offset=offset,
        log=log,
    )


def _depth(tree: _Tree) -> int:
    level, found = np.zeros(1, dtype=np.intp), 0
    while not tree.leaf[level].all():
        inner = level[~tree.leaf[level]]
        level, found = np.concatenate([tree.left[inner], tree.right[inner]]), found + 1
    return found


@dataclass(frozen=True, kw_only=True)
class RegressionCandidate:
    """One way to fit a target.

    Attributes
    ----------
    name : str
    cost_ms : float
        Time of one prediction [ms].
    fit : callable
        ``fit(rows, moved, target, seed, noted)`` gives the part; `moved` are the same records on
        other machines, the target is > 0, the last `noted` columns are noted conditions.
    fewest : int
        Records that it needs.
    """

    name: str
    cost_ms: float
    fit: Fit
    fewest: int = 0


_PENALTIES = (3.0, 30.0, 300.0)  # of ridges on standardised features
_LINES = len(_PENALTIES)

CANDIDATES: tuple[RegressionCandidate, ...] = (
    *(
        RegressionCandidate(name=f"ridge {penalty:g}", cost_ms=0.02, fit=_ridge(penalty, log=True))
        for penalty in _PENALTIES
    ),
    *(
        RegressionCandidate(
            name=f"plain ridge {penalty:g}", cost_ms=0.02, fit=_ridge(penalty, log=False)
        )
        for penalty in _PENALTIES
    ),
    RegressionCandidate(name="trees", cost_ms=0.4, fit=_fit_trees),
    RegressionCandidate(name="boosting", cost_ms=0.4, fit=_fit_boosting, fewest=_FEWEST_BOOSTED),
    RegressionCandidate(name="nets", cost_ms=0.4, fit=fit_nets, fewest=FEWEST_RECORDS),
)
"""From fast to strong, lines of the logarithm first. The costs are tabulated, not timed at each
training, so that the choice is the same on every computer: measured for one recording of 1,500
features on one core of 2.5 GHz."""

WITNESSES = tuple(candidate.name for candidate in CANDIDATES[:_LINES])
"""Names of the straight lines of the logarithm."""

SMOOTH = (*WITNESSES, "nets")
"""Names of what distinguishes kinds of recordings by hundreds of features together."""

BUDGET_MS = 5.0
"""Time that a prediction may take by default [ms]."""


# --- the choice


@dataclass(frozen=True, kw_only=True)
class RegressionOption:
    """A candidate alone, or a blend of the first few, with what it costs and how it errs.

    Attributes
    ----------
    name : str
    members : tuple of int
        Places in the list of candidates.
    cost_ms : float
        Time of one prediction [ms].
    error : float
        Mean absolute error on groups that had no part in the fit [unit of the target].
    on_front : bool
        No other option is as cheap and better.
    """

    name: str
    members: tuple[int, ...]
    cost_ms: float
    error: float
    on_front: bool = False


Kind = TypeVar("Kind")


@dataclass(frozen=True, kw_only=True)
class Fitted(Generic[Kind]):
    """A chosen blend with its behaviour on groups that it had not seen.

    Attributes
    ----------
    blend : Blend, or a blend for each regime
        Fitted on all records.
    estimate : numpy.ndarray [shape=(n,)]
        Estimates of every record by parts, weights and choice that its group had no part in.
    disagreement : numpy.ndarray [shape=(n,)]
        Disagreement of the blend's parts, fitted without the group; see
        :meth:`Blend.disagreement`.
    shifted_estimate, shifted_disagreement : numpy.ndarray [shape=(n,)]
        The same of the records on other machines, by the weights of the blend.
    shares, shifted_shares : numpy.ndarray [shape=(n, n_regimes)]
        Probability of each regime that has a blend of its own; of no regimes where one is for all.
    options : tuple of RegressionOption
        All that was looked at, within the budget or not.
    chosen : str
        Name of the option.
    """

    blend: Kind
    estimate: Float
    disagreement: Float
    shifted_estimate: Float
    shifted_disagreement: Float
    shares: Float
    shifted_shares: Float
    options: tuple[RegressionOption, ...]
    chosen: str

    @property
    def cost_ms(self) -> float:
        """Time of one prediction [ms]."""
        return next(option.cost_ms for option in self.options if option.name == self.chosen)

    def knowing(self, options: tuple[RegressionOption, ...]) -> "Fitted[Kind]":
        """The same among more options than it was chosen from."""
        return replace(self, options=options)


def fit_blend(
    rows: Float,
    target: Float,
    folds: Folds,
    *,
    seed: int = 0,
    budget_ms: float | None = None,
    candidates: Sequence[RegressionCandidate] = CANDIDATES,
    shifted: Float | None = None,
    learnt_from: Index | None = None,
    noted: int = 0,
) -> Fitted[Blend]:
    """Fit every affordable candidate and keep the best of them, or a blend.

    Parameters
    ----------
    rows : numpy.ndarray [shape=(n, n_features)]
    target : numpy.ndarray [shape=(n,)]
        > 0.
    folds : sequence of (numpy.ndarray, numpy.ndarray)
        Records to fit on and to judge on; no group is on both sides.
    seed : int
        Seed of trees and networks.
    budget_ms : float, optional
        Time that one prediction may take [ms]; :data:`BUDGET_MS` unless given.
    candidates : sequence of RegressionCandidate
        From fast to strong.
    shifted : numpy.ndarray [shape=(n, n_features)], optional
        The same records on other machines than those trained on; as they are unless given.
    learnt_from : numpy.ndarray, optional
        Records that parts, weights and choice may learn from; all others are estimated only.
    noted : int
        Number of columns at the end that are noted conditions, not features.

    Returns
    -------
    Fitted

    Raises
    ------
    ValueError
        No candidate is within the budget.

    Notes
    -----
    Each candidate is fitted once per fold, which gives every record an estimate of each that it
    had no part in. Weights (least squares, none negative) and choice for a fold are then made
    from the estimates in the other folds, so the error of the whole, choice included, is that of
    unseen groups; only a handful of weights has met them through the fits behind those
    estimates. The choice is the cheapest option within one per cent of the least error.

    References
    ----------
    L. Breiman, "Stacked regressions", Machine Learning 24 (1996) 49-64,
    doi:10.1007/BF00117832; M. van der Laan, E. Polley, A. Hubbard, "Super learner", Stat. Appl.
    Genet. Mol. Biol. 6 (2007) 25, doi:10.2202/1544-6115.1309.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> rows = rng.standard_normal((60, 3))
    >>> folds = [(np.r_[0:30], np.r_[30:60]), (np.r_[30:60], np.r_[0:30])]
    >>> found = fit_blend(rows, np.exp(rows[:, 0]), folds, candidates=CANDIDATES[:2])
    >>> found.chosen
    'ridge 3'
    """
    limit = BUDGET_MS if budget_ms is None else budget_ms
    everyone = np.arange(len(target)) if learnt_from is None else learnt_from
    folds = [(np.intersect1d(train, everyone), test) for train, test in folds]
    enough = [item for item in candidates if item.fewest <= len(everyone)]
    usable = [item for item in enough if item.cost_ms <= limit]
    if not usable:
        cheapest = min(candidate.cost_ms for candidate in candidates)
        raise ValueError(
            f"budget_ms = {limit:g} ms must be >= {cheapest:g} ms, the cheapest model; raise it"
        )
    bounds = (float(target[everyone].min()) / _FAR, float(target[everyone].max()) * _FAR)
    asked = (rows, rows if shifted is None else shifted)
    both = [_out_of_fold(item, asked, target, folds, seed, noted) for item in usable]
    tables = np.clip(np.stack(both, axis=2), *bounds)
    ways: dict[str, Any] = {"seed": seed, "limit": limit, "bounds": bounds, "everyone": everyone}
    return _chosen(usable, tables, asked, target, folds, noted=noted, **ways)


def fit_line(
    rows: Float, target: Float, options: Sequence[RegressionOption], *, seed: int = 0
) -> Linear:
    """Fit the best of the straight lines among the candidates.

    Parameters
    ----------
    rows, target, seed
        As of :func:`fit_blend`.
    options : sequence of RegressionOption
        What it found; a line is within every budget.

    Returns
    -------
    Linear
        Line of the logarithm of the target without bounds to its features: unlike an estimate, this
        witness may point beyond the trained range.
    """
    lines = {each.name: each for each in CANDIDATES if each.name in WITNESSES}
    best = min((o for o in options if o.name in lines), key=lambda option: option.error)
    part = lines[best.name].fit(rows, rows, target, seed, 0)
    assert isinstance(part, Linear)
    room = _ENDLESS * part.spread
    return replace(part, low=part.centre - room, high=part.centre + room)


def _out_of_fold(
    candidate: RegressionCandidate,
    asked: tuple[Float, Float],
    target: Float,
    folds: Folds,
    seed: int,
    noted: int,
) -> Float:
    """Estimates of every record as it is and shifted [shape=(2, n)]."""
    estimate = np.empty((2, len(target)))
    for train, test in folds:
        part = candidate.fit(asked[0][train], asked[1][train], target[train], seed, noted)
        estimate[:, test] = [part.predict(each[test]) for each in asked]
    return estimate


def _chosen(
    usable: Sequence[RegressionCandidate],
    tables: Float,
    asked: tuple[Float, Float],
    target: Float,
    folds: Folds,
    *,
    seed: int,
    limit: float,
    bounds: tuple[float, float],
    everyone: Index,
    noted: int,
) -> Fitted[Blend]:
    table = tables[0]
    names = _option_members(usable)
    crossed = {name: _crossed(table[:, m], target, folds) for name, m in names.items()}
    options = _options(usable, names, crossed, target, everyone)
    best = cheapest_good(options, limit)
    estimate = np.empty(len(target))
    for train, test in folds:
        pick = cheapest_good(_options(usable, names, crossed, target, train), limit)
        estimate[test] = crossed[pick.name][test]
    weights = _with_a_line(
        usable,
        options,
        best,
        blend_weights(table[everyone][:, list(best.members)], target[everyone]),
    )
    kept = np.flatnonzero(weights).tolist()
    members = [usable[i] for i in kept]
    parts = tuple(
        item.fit(asked[0][everyone], asked[1][everyone], target[everyone], seed, noted)
        for item in members
    )
    smooth = np.array([is_smooth(part) for part in parts], dtype=np.float64)
    held, trees = sides(tables[:, :, kept], weights[kept], smooth)
    apart, strange = np.abs(np.log(held / trees))
    tube = float(np.quantile(apart[everyone], USUAL))
    blend = Blend(
        names=tuple(item.name for item in members),
        parts=parts,
        weights=weights[kept],
        low=bounds[0],
        high=bounds[1],
        tube=tube,
    )
    elsewhere = together(held[1], trees[1], float(weights[kept] @ smooth), tube)
    return Fitted(
        blend=blend,
        estimate=estimate,
        disagreement=apart,
        shifted_estimate=elsewhere,
        shifted_disagreement=strange,
        shares=blend.shares(asked[0]),
        shifted_shares=blend.shares(asked[1]),
        options=front(options),
        chosen=best.name,
    )


def _with_a_line(
    usable: Sequence[RegressionCandidate],
    options: Sequence[RegressionOption],
    best: RegressionOption,
    weights: Float,
) -> Float:
    """Weights of all usable candidates; the best line is kept, to be held against the trees."""
    everyone = np.zeros(len(usable))
    everyone[list(best.members)] = weights
    lines = [o for o in options if len(o.members) == 1 and o.name in _line_names()]
    if lines and not everyone[[o.members[0] for o in lines]].any():
        everyone[min(lines, key=lambda option: option.error).members[0]] = _LEAST_WEIGHT
    return np.asarray(everyone / everyone.sum())


def _line_names() -> set[str]:
    return {candidate.name for candidate in CANDIDATES[: 2 * _LINES]}


def _option_members(usable: Sequence[RegressionCandidate]) -> dict[str, tuple[int, ...]]:
    """Every candidate alone, and the blends of all up to each price."""
    alone = {item.name: (i,) for i, item in enumerate(usable)}
    prices = sorted({item.cost_ms for item in usable})
    groups = [tuple(i for i, c in enumerate(usable) if c.cost_ms <= price) for price in prices]
    return alone | {f"blend of {len(group)}": group for group in groups if len(group) > 1}


def _crossed(table: Float, target: Float, folds: Folds) -> Float:
    """Blend of out-of-fold estimates, the weights of each fold from the other folds."""
    estimate = np.empty(len(target))
    for train, test in folds:
        estimate[test] = table[test] @ blend_weights(table[train], target[train])
    return estimate


def _options(
    usable: Sequence[RegressionCandidate],
    names: dict[str, tuple[int, ...]],
    crossed: dict[str, Float],
    target: Float,
    where: Index,
) -> list[RegressionOption]:
    return [
        RegressionOption(
            name=name,
            members=members,
            cost_ms=sum(usable[i].cost_ms for i in members),
            error=float(np.abs(crossed[name][where] - target[where]).mean()),
        )
        for name, members in names.items()
    ]


def cheapest_good(options: Sequence[RegressionOption], limit: float) -> RegressionOption:
    """Cheapest option within a limit of time [ms] whose error is near the least one."""
    within = [option for option in options if option.cost_ms <= limit]
    least = min(option.error for option in within)
    close = [option for option in within if option.error <= (1 + _TIE) * least]
    return min(close, key=lambda option: (option.cost_ms, option.error))


def front(options: Sequence[RegressionOption]) -> tuple[RegressionOption, ...]:
    """The same, marked where no other one is as cheap and better."""
    return tuple(
        replace(
            one,
            on_front=not any(
                (o.cost_ms <= one.cost_ms and o.error < one.error)
                or (o.cost_ms < one.cost_ms and o.error <= one.error)
                for o in options
            ),
        )
        for one in options
    )


def blend_weights(table: Float, target: Float) -> Float:
    """Weights of estimates, none negative and of sum 1, with the least squares of the error.

    Parameters
    ----------
    table : numpy.ndarray [shape=(n, n_estimates)]
    target : numpy.ndarray [shape=(n,)]

    Returns
    -------
    numpy.ndarray [shape=(n_estimates,)]
        Weights below 2 % are set to 0.

    Examples
    --------
    >>> truth = np.array([1.0, 2.0, 3.0, 4.0])
    >>> blend_weights(np.column_stack([truth + [1, -1, 1, -1], truth - [1, -1, 1, -1]]), truth)
    array([0.5, 0.5])
    """
    from scipy.optimize import nnls

    if table.shape[1] == 1:
        return np.ones(1)
    # one heavy equation holds the sum at 1
    heavy = 1e3 * float(np.abs(target).max()) * np.sqrt(len(target))
    weights, _ = nnls(np.vstack([table, np.full(table.shape[1], heavy)]), np.append(target, heavy))
    weights = np.where(weights >= _LEAST_WEIGHT * weights.sum(), weights, 0.0)
    return np.asarray(weights / weights.sum())
