"""Effect of fidelity on the verdict: trained on a cheap rung, judged on the best.

The same machines are drawn for every rung, so that records with the same number differ in the model
alone and the loss is a paired difference over held-out machine draws.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.generation.generate import generate
from ...datasets.recipe.load import load_recipe
from ...datasets.recipe.severities import wear_limits
from ...datasets.split.rules import group_folds
from ...sim.fidelity.differences import Difference
from ...sim.fidelity.ladder import cost_of, effects_of
from ...sim.output.recording import DataError
from ...sim.parts.wording import nearest
from ...sim.scene.rungs import Effect, admissible, with_values
from ...sim.scene.scene import Scene
from ..feature_rows.feature_table import FeatureTable, feature_table
from ..learning.regressions import CANDIDATES, fit_blend

Float = NDArray[np.float64]

_FOLDS = 5
_FEWEST_DRAWS = 10  # two per fold
_CANDIDATES = [each for each in CANDIDATES if each.name.startswith("ridge")]  # the fast ones
_FLIPS = 4_999  # random signs of the paired test: its smallest p-value is 1 in 5,000


@dataclass(frozen=True, kw_only=True)
class Loss:
    """Loss of accuracy by training on one rung.

    Attributes
    ----------
    effect, rung : str
        The one effect that is lowered, and its rung.
    cost : float
        Tabulated cost relative to that of the best rungs.
    error : Difference
        Mean absolute error on the best rungs over the condemning limit, trained on this rung.
    loss : Difference
        Increase of that error over training on the best rungs, paired by machine draw.
    p_value : float
        Two-sided p-value of no loss or gain, by random signs of the draws' differences.
    records : int
        Records that could be simulated with both.
    reason : str
        Why there is no figure; empty if there is one.
    """

    effect: str
    rung: str
    cost: float
    error: Difference
    loss: Difference
    p_value: float
    records: int
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class Across:
    """Losses of every rung below the best.

    Attributes
    ----------
    recipe : str
    best : mapping of str to str
        Effect -> rung used for judging.
    error : Difference
        Error when trained and judged on the best rungs.
    losses : tuple of Loss
    records, draws : int
    """

    recipe: str
    best: Mapping[str, str]
    error: Difference
    losses: tuple[Loss, ...]
    records: int
    draws: int


def across_fidelity(sets: "RungSets") -> Across:
    """Train on the data set of each rung of each effect, and judge on the best rungs.

    Parameters
    ----------
    sets : RungSets

    Returns
    -------
    Across

    Raises
    ------
    DataError
        There are too few machine draws.
    """
    judge = sets.judge()
    losses = [
        loss_of(sets, judge, effect.name, rung.name, {**sets.best, effect.name: rung.name})
        for effect in sets.effects
        for rung in admissible(effect, sets.plain.scene)[:-1]
    ]
    return Across(
        recipe=sets.plain.name,
        best=sets.best,
        error=judge.mean(judge.own),
        losses=tuple(losses),
        records=len(judge.best.values),
        draws=len(np.unique(judge.draws)),
    )


class RungSets:
    """Data sets of one recipe on several rungs, with the same machines in each, and their features.

    Parameters
    ----------
    name : str or Path
        Recipe.
    n : int
        Records per rung.
    folder : Path
        Folder of the data sets, one per rung; existing ones are reused.
    effects : sequence of str
        Effects to be raised and lowered, while others stay as written; by default all but steps
        and meshes.
    overrides : mapping, optional
        Dotted path of the scene -> value.
    seed : int
        Seed of the data sets and the folds.
    jobs : int
        Worker processes.
    say : callable, optional
        Called with a line for every rung.

    Attributes
    ----------
    plain : Recipe
        The recipe as written.
    effects : list of Effect
        Effects whose rungs are compared.
    best, written : dict of str to str
        Effect -> its best rung, and the rung in the recipe's scene.

    Raises
    ------
    DataError
        An effect is unknown or has only one rung.
    RecipeError
        The recipe is invalid.
    """

    def __init__(
        self,
        name: str | Path,
        n: int,
        folder: Path,
        *,
        effects: Sequence[str] = (),
        overrides: Mapping[str, Any] | None = None,
        seed: int = 0,
        jobs: int = 1,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.name, self.n, self.folder, self.seed, self.jobs = name, n, folder, seed, jobs
        self.overrides, self.say = dict(overrides or {}), say
        self.plain = load_recipe(name, self.overrides)
        self.effects = _effects(self.plain.scene, effects)
        scene = self.plain.scene
        self._tables: dict[tuple[str, ...], FeatureTable] = {}
        self.best = {each.name: admissible(each, scene)[-1].name for each in self.effects}
        self.written = {each.name: each.current(scene) for each in self.effects}

    def values(self, rungs: Mapping[str, str]) -> dict[str, Any]:
        """Scene values of these rungs, by dotted path."""
        return {
            path: value
            for effect in self.effects
            for path, value in effect.rung(rungs[effect.name]).values.items()
        }

    def cost(self, rungs: Mapping[str, str]) -> float:
        """Tabulated cost of one record [s]."""
        return cost_of(with_values(self.plain.scene, self.values(rungs)))

    def table(self, rungs: Mapping[str, str]) -> FeatureTable:
        """Features of the data set on these rungs, which is generated if missing."""
        key = tuple(rungs[effect.name] for effect in self.effects)
        if key not in self._tables:
            self._tables[key] = self._made(rungs)
        return self._tables[key]

    def _made(self, rungs: Mapping[str, str]) -> FeatureTable:
        words = "-".join(f"{effect}_{rung}" for effect, rung in rungs.items()).replace("/", "o")
        path = self.folder / f"{self.plain.name}-{words}-{self.n}-{self.seed}.h5"
        if self.say is not None:
            self.say(", ".join(f"{effect} {rung}" for effect, rung in rungs.items()))
        if not path.exists():
            self.folder.mkdir(parents=True, exist_ok=True)
            recipe = load_recipe(self.name, {**self.overrides, **self.values(rungs)})
            generate(recipe, self.n, path, seed=self.seed, jobs=self.jobs, fidelity="given")
        return feature_table(path, jobs=self.jobs)

    def judge(self) -> "PairedJudge":
        """Judge on the best rungs of what is trained on others."""
        column = self.plain.severity_columns[0]
        limits = wear_limits(self.plain.scene, column)
        if limits is None:
            raise DataError(f"{self.plain.name}: {column} has no condemning limit in the scene")
        return PairedJudge(self.table(self.best), limits.condemning, column, self.seed)


def loss_of(
    sets: RungSets, judge: "PairedJudge", effect: str, rung: str, rungs: Mapping[str, str]
) -> Loss:
    """Loss by training on these rungs; without a figure if they cannot be simulated.

    Parameters
    ----------
    sets : RungSets
    judge : PairedJudge
        Judge of the same data sets.
    effect, rung : str
        Names to be recorded in the result.
    rungs : mapping of str to str
        Effect -> rung.
    """
    cost = sets.cost(rungs) / sets.cost(sets.best)
    try:
        table = sets.table(rungs)
    except DataError as error:
        return _no_loss(effect, rung, cost, str(error))
    return judge.loss(effect, rung, cost, table)


def _effects(scene: Scene, wanted: Sequence[str]) -> list[Effect]:
    known = {effect.name: effect for effect in effects_of(scene)}
    faults = [
        f"effect = '{name}' is none of this scene{nearest(name, tuple(known))}"
        for name in wanted
        if name not in known
    ]
    found = [
        effect
        for name, effect in known.items()
        if (name in wanted or (not wanted and not effect.numerical))
        and len(admissible(effect, scene)) > 1
    ]
    if not faults and not found:
        faults = [f"{scene.name}: 0 effects have two rungs, must be >= 1; name one with --effect"]
    if faults:
        raise DataError("\n".join(faults))
    return found


class PairedJudge:
    """Errors on the best rungs, in folds of whole machine draws."""

    def __init__(self, best: FeatureTable, limit: float, column: str, seed: int) -> None:
        self.best, self.limit, self.seed = best, limit, seed
        self.truth = best.manifest[column].to_numpy(dtype=float)
        self.draws = best.manifest["group"].to_numpy()
        if len(np.unique(self.draws)) < _FEWEST_DRAWS:
            raise DataError(
                f"{len(np.unique(self.draws))} machine draws, must be >= {_FEWEST_DRAWS}; "
                "ask for more records"
            )
        self.folds = group_folds(self.draws, n=_FOLDS, seed=seed)
        self.ids = best.manifest["record_id"].to_numpy()
        self.own = self.errors(best, np.ones(len(self.ids), dtype=bool))

    def errors(self, table: FeatureTable, usable: NDArray[np.bool_]) -> Float:
        """Absolute errors over the limit for every best record, trained on another table.

        Only `usable` best records, which the other table has too, are used for training.
        """
        rows = {record: i for i, record in enumerate(table.manifest["record_id"])}
        found = np.empty_like(self.truth)
        for train, test in self.folds:
            kept = train[usable[train]]
            values = table.values[[rows[record] for record in self.ids[kept]]]
            folds = group_folds(self.draws[kept], n=_FOLDS, seed=self.seed)
            fitted = fit_blend(
                values, self.truth[kept], folds, seed=self.seed, candidates=_CANDIDATES
            )
            found[test] = fitted.blend.predict(self.best.values[test])
        return np.asarray(np.abs(found - self.truth) / self.limit)

    def loss(self, effect: str, rung: str, cost: float, other: FeatureTable) -> Loss:
        """Loss of one rung, against training on the best rungs of the same records."""
        usable = np.isin(self.ids, other.manifest["record_id"].to_numpy())
        left = len(np.unique(self.draws[usable]))
        if left < _FEWEST_DRAWS or other.names != self.best.names:
            return _no_loss(effect, rung, cost, f"{left} machine draws could be simulated")
        errors = self.errors(other, usable)
        best = self.own if usable.all() else self.errors(self.best, usable)
        means = _draw_means(errors - best, self.draws)
        return Loss(
            effect=effect,
            rung=rung,
            cost=cost,
            error=self.mean(errors),
            loss=_difference(means),
            p_value=sign_flip_test(means, seed=self.seed),
            records=int(usable.sum()),
        )

    def mean(self, errors: Float) -> Difference:
        """Mean over draws."""
        return _difference(_draw_means(errors, self.draws))


def _no_loss(effect: str, rung: str, cost: float, reason: str) -> Loss:
    nothing = Difference(mean=math.nan, standard_error=math.nan)
    return Loss(
        effect=effect,
        rung=rung,
        cost=cost,
        error=nothing,
        loss=nothing,
        p_value=math.nan,
        records=0,
        reason=reason.splitlines()[0],
    )


def _draw_means(values: Float, draws: NDArray[Any]) -> Float:
    return np.array([values[draws == draw].mean() for draw in np.unique(draws)])


def _difference(means: Float) -> Difference:
    spread = float(means.std(ddof=1) / math.sqrt(len(means)))
    return Difference(mean=float(means.mean()), standard_error=spread)


def sign_flip_test(differences: Float, *, seed: int = 0) -> float:
    """Two-sided p-value of paired differences, whose signs are random if there is no effect.

    Parameters
    ----------
    differences : numpy.ndarray [shape=(n,)]
        One difference per pair.
    seed : int
        Seed of the random signs.

    Returns
    -------
    float
        Share of :data:`_FLIPS` sign patterns, including the observed one, whose mean is as far
        from zero; up to 12 pairs all patterns are used.

    References
    ----------
    Fisher, "The design of experiments", Oliver and Boyd 1935, section 21.

    Examples
    --------
    >>> sign_flip_test(np.ones(5))
    0.0625
    """
    n = len(differences)
    if n <= _ALL_SIGNS:
        codes = np.arange(2**n)[:, None] >> np.arange(n) & 1
        means = np.abs((2 * codes - 1) @ differences)
        return float(np.mean(means >= abs(differences.sum()) * (1 - _ROUNDING)))
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (_FLIPS, n))
    means = np.abs(signs @ differences)
    count = np.count_nonzero(means >= abs(differences.sum()) * (1 - _ROUNDING))
    return float((1 + count) / (1 + _FLIPS))


_ALL_SIGNS = 12
_ROUNDING = 1e-12


def across_table(found: Across) -> dict[str, Any]:
    """Result as plain values."""
    return {
        "recipe": found.recipe,
        "judged_on": dict(found.best),
        "records": found.records,
        "draws": found.draws,
        "error_share_of_limit": asdict(found.error),
        "losses": [asdict(loss) for loss in found.losses],
    }


def across_text(found: Across) -> str:
    """Result as lines for a terminal."""
    best = ", ".join(f"{effect} {rung}" for effect, rung in found.best.items())
    return "\n".join(
        [
            f"{found.recipe} (simulated): {found.records} records of {found.draws} machine draws, "
            f"judged on {best}",
            f"  trained there, too: error {found.error.error:.2%} of the limit "
            f"(± {found.error.standard_error:.2%})",
            *_loss_lines(found.losses),
        ]
    )


def _loss_lines(losses: Sequence[Loss]) -> Iterator[str]:
    yield f"  {'trained on':28} {'cost':>7} {'error':>8} {'loss':>8} {'±':>7} {'p':>7}"
    for loss in losses:
        name = f"{loss.effect} {loss.rung}"
        if loss.reason:
            yield f"  {name:28} {loss.cost:7.3g}  none: {loss.reason}"
            continue
        yield (
            f"  {name:28} {loss.cost:7.3g} {loss.error.mean:8.2%} {loss.loss.mean:+8.2%} "
            f"{loss.loss.standard_error:7.2%} {loss.p_value:7.2g}"
        )
