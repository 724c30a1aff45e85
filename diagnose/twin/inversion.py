"""Ensemble Kalman inversion: from levels of recordings to the distribution of the unknowns."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .ensemble import simulated
from .levels import LevelLayout
from .regression import Regressed, regressed
from .scan import scanned
from .unknowns import TwinUnknowns

Float = NDArray[np.float64]

ROUNDS = (130, 90, 90)
"""Members of the rounds: the first draws from the prior, each further one around the last."""
WIDENED = (3.0, 1.6)
"""How much wider than what is known the next ensemble is drawn, after the first round and later:
the first knows the scatter of all machines of the recipe, and not of this one."""
UNTOLD = 0.75
"""Deviation, in those of the prior, above which an unknown is drawn from the prior again."""
LEAST_TOLD = 0.9
"""Deviation, in those of the prior, below which an unknown counts as told."""
COST_S = 0.1
"""Of one simulated recording on a usual core, and its share of machines with oil [s], to turn a
budget into members."""
FEWEST = 120
"""Members: fewer tell nothing of a hundred unknowns."""
STEP_LIMIT = 2.5
"""Farthest step of a round, in deviations of its ensemble."""


@dataclass(frozen=True, kw_only=True)
class Gaussian:
    """Distribution of normal scores.

    Attributes
    ----------
    mean : ndarray [shape=(n_names,)]
    covariance : ndarray [shape=(n_names, n_names)]
    """

    mean: Float
    covariance: Float

    @property
    def sd(self) -> Float:
        """[shape=(n_names,)]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def draw(self, count: int, rng: np.random.Generator) -> Float:
        """Scores of members [shape=(count, n_names)]."""
        values, vectors = np.linalg.eigh(self.covariance)
        factor = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(self.mean + rng.standard_normal((count, len(self.mean))) @ factor.T)


@dataclass(frozen=True, kw_only=True)
class Inverted:
    """What recordings say of the unknowns.

    Attributes
    ----------
    posterior : Gaussian
    prior : Gaussian
    scores, levels : ndarray
        Members of the last round and their levels [dB].
    members : int
        Simulated in all.
    """

    posterior: Gaussian
    prior: Gaussian
    scores: Float
    levels: Float
    members: int


def standard(count: int) -> Gaussian:
    """The prior: what the recipe draws, each number apart."""
    return Gaussian(mean=np.zeros(count), covariance=np.eye(count))


def rounds_of(budget_s: float | None, n_runs: int) -> tuple[int, ...]:
    """Members of each round that a budget allows; the usual ones without.

    Examples
    --------
    >>> rounds_of(None, 3), rounds_of(60.0, 3)
    ((130, 90, 90), (83, 58, 58))
    """
    if budget_s is None:
        return ROUNDS
    members = max(FEWEST, int(budget_s / (COST_S * n_runs)))
    return tuple(round(members * each / sum(ROUNDS)) for each in ROUNDS)


def inverted(
    unknowns: TwinUnknowns,
    layout: LevelLayout,
    observed: Float,
    runs: Sequence[Mapping[str, float]],
    *,
    prior: Gaussian,
    rounds: Sequence[int] = ROUNDS,
    wider: Sequence[float] = WIDENED,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
    look: Callable[[Float], None] | None = None,
) -> Inverted:
    """Invert levels for the unknowns.

    Parameters
    ----------
    unknowns : TwinUnknowns
    layout : LevelLayout
        Of the levels.
    observed : ndarray [shape=(n_runs, n_levels)]
        Of the recordings [dB].
    runs : sequence of mapping
        Conditions of each recording.
    prior : Gaussian
        Of the normal scores.
    rounds : sequence of int
        Members of each round.
    wider : sequence of float
        How much wider than what is known an ensemble is drawn, after the first round and later.
    seed : int
        Of draws and sensor noise.
    jobs : int
        Worker processes.
    progress : callable, optional
        Called with (members done, members).
    look : callable, optional
        Called with the levels of the first ensemble; may raise to stop.
    """
    rng = np.random.default_rng(seed)
    proposal, before, done = prior, None, 0
    for number, count in enumerate(rounds):
        members = simulated(
            unknowns,
            proposal.draw(count, rng),
            runs,
            seed=seed + 100_000 * (number + 1),
            jobs=jobs,
            progress=moved(progress, done, sum(rounds)),
        )
        done += count
        if look is not None and number == 0:  # further ones hold fewer machines of the scene
            look(members[1])
        used = members if number < 2 or before is None else _joined(before, members)
        posterior = _step(unknowns, layout, used, observed, prior if number == 0 else None, prior)
        proposal = widened(posterior, prior, wider[min(number, 1)])
        before = members
    return Inverted(
        posterior=posterior, prior=prior, scores=used[0], levels=used[1], members=sum(rounds)
    )


def _joined(one: tuple[Float, Float], other: tuple[Float, Float]) -> tuple[Float, Float]:
    return np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1]])


def _step(
    unknowns: TwinUnknowns,
    layout: LevelLayout,
    members: tuple[Float, Float],
    observed: Float,
    drawn: Gaussian | None,
    prior: Gaussian,
) -> Gaussian:
    """Posterior of an ensemble, which was drawn from a known Gaussian or is one by its moments."""
    scores, levels = members
    rows = np.concatenate([levels, observed[np.newaxis]])
    scans, knocks = _scans(unknowns, layout, scores, rows), _knocks(layout, rows)
    flat = layout.levels_of(rows).reshape(len(rows), -1)
    if drawn is None:
        variance = np.diag(scores.var(axis=0))
        drawn = Gaussian(mean=scores.mean(axis=0), covariance=variance)
    return corrected(regressed(scores, flat, scans, knocks), drawn, prior)


def _knocks(layout: LevelLayout, rows: Float) -> Float:
    """Places of knocks of all runs, in their scatter [shape=(n + 1, n_runs * n_knocks)]."""
    found = layout.knocks_of(rows).reshape(len(rows), -1)
    scatter = np.sqrt(found[:-1].var(axis=0) + LEAST_ANGLE**2)
    return np.asarray((found - found[:-1].mean(axis=0)) / scatter)


LEAST_ANGLE = 0.5
"""Scatter of the place of a knock that is always there [deg]."""


def moved(
    progress: Callable[[int, int], None] | None, before: int, total: int
) -> Callable[[int, int], None] | None:
    """Progress of a part that begins after others."""
    return None if progress is None else lambda done, _: progress(before + done, total)


def _scans(unknowns: TwinUnknowns, layout: LevelLayout, scores: Float, levels: Float) -> Float:
    """Scanned frequencies of all modes, as normal scores [shape=(n + 1, n_modes)]."""
    spectra = layout.spectrum_of(levels).mean(axis=1)
    log_points = np.log(layout.points)
    found = []
    for path in unknowns.frequencies:
        own = unknowns.numbers(path, scores)
        if own.std() > 0 and log_points[0] < np.log(own.min()) and own.max() < layout.points[-1]:
            rows = scanned(spectra, own, log_points, unknowns.ends(path))
            found.append(unknowns.scores(path, rows))
    return np.array(found).T if found else np.empty((len(levels), 0))


def corrected(found: Regressed, proposal: Gaussian, prior: Gaussian) -> Gaussian:
    """Posterior under the prior, of one found under the proposal.

    What the recordings say of each unknown is what the regression found less what the ensemble was
    drawn with; the prior is added once, however many rounds there are.
    """
    sd = np.minimum(found.sd, proposal.sd)
    limit = STEP_LIMIT * proposal.sd
    mean = proposal.mean + np.clip(found.mean - proposal.mean, -limit, limit)
    told = sd**-2.0 - proposal.sd**-2.0
    precision = told + prior.sd**-2.0
    weighted = mean / sd**2 - proposal.mean / proposal.sd**2 + prior.mean / prior.sd**2
    final = precision**-0.5
    turned = _correlation(found.residuals)
    return Gaussian(mean=weighted / precision, covariance=turned * np.outer(final, final))


def _correlation(residuals: Float) -> Float:
    """Correlation of residuals, shrunk as far as so few members do not tell it."""
    count = len(residuals)
    scale = np.sqrt((residuals**2).mean(axis=0))
    found = (residuals / scale).T @ (residuals / scale) / count
    off = found - np.diag(np.diag(found))
    size = (off**2).sum()
    noise = off.size / count
    kept = max(0.0, 1 - noise / size) if size > 0 else 0.0
    shrunk = kept * off
    return np.asarray(shrunk + np.eye(len(found)))


def widened(posterior: Gaussian, prior: Gaussian, factor: float) -> Gaussian:
    """Where the next ensemble is drawn: wider, and no farther than the prior."""
    told = posterior.sd < UNTOLD * prior.sd
    sd = np.where(told, np.minimum(factor * posterior.sd, prior.sd), prior.sd)
    mean = np.where(told, posterior.mean, prior.mean)
    correlation = posterior.covariance / np.outer(posterior.sd, posterior.sd)
    both = np.outer(told, told) | np.eye(len(sd), dtype=bool)
    return Gaussian(mean=mean, covariance=np.where(both, correlation, 0.0) * np.outer(sd, sd))
