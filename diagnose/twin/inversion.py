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
"""Members of the rounds: the first draws from the prior, later ones around the previous result."""
WIDENED = (3.0, 1.6)
"""Widening of the posterior for the next ensemble, after the first round and later: the first knows
the scatter of all machines of the recipe, not of this one."""
UNDETERMINED = 0.75
"""Standard deviation over that of the prior, above which an unknown is drawn from the prior."""
DETERMINED = 0.9
"""Standard deviation over that of the prior, below which an unknown counts as determined."""
COST_S = 0.1
"""Time of one simulated recording on a usual core, with its share of machines with oil [s], to
convert a budget into members."""
FEWEST = 120
"""Fewest members: fewer give no information on a hundred unknowns."""
STEP_LIMIT = 2.5
"""Longest step of a round, in standard deviations of its ensemble."""


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
        """Standard deviations [shape=(n_names,)]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def draw(self, count: int, rng: np.random.Generator) -> Float:
        """Scores of members [shape=(count, n_names)]."""
        values, vectors = np.linalg.eigh(self.covariance)
        factor = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(self.mean + rng.standard_normal((count, len(self.mean))) @ factor.T)


@dataclass(frozen=True, kw_only=True)
class Inverted:
    """Distribution of the unknowns, given recordings.

    Attributes
    ----------
    posterior : Gaussian
    prior : Gaussian
    scores, levels : ndarray
        Members of the last round and their levels [dB].
    members : int
        Total number of simulated members.
    """

    posterior: Gaussian
    prior: Gaussian
    scores: Float
    levels: Float
    members: int


def standard(count: int) -> Gaussian:
    """Prior of independent normal scores."""
    return Gaussian(mean=np.zeros(count), covariance=np.eye(count))


def rounds_of(budget_s: float | None, n_runs: int) -> tuple[int, ...]:
    """Members of each round within a budget; without one the usual numbers.

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
    check: Callable[[Float], None] | None = None,
) -> Inverted:
    """Invert levels for the unknowns.

    Parameters
    ----------
    unknowns : TwinUnknowns
    layout : LevelLayout
        Layout of the levels.
    observed : ndarray [shape=(n_runs, n_levels)]
        Levels of the recordings [dB].
    runs : sequence of mapping
        Conditions of each recording.
    prior : Gaussian
        Prior of the normal scores.
    rounds : sequence of int
        Members of each round.
    wider : sequence of float
        Widening of the posterior for the next ensemble, after the first round and later.
    seed : int
        Seed of draws and sensor noise.
    jobs : int
        Worker processes.
    progress : callable, optional
        Called with (members done, members).
    check : callable, optional
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
            progress=offset_progress(progress, done, sum(rounds)),
        )
        done += count
        if check is not None and number == 0:  # later ones no longer represent the scene
            check(members[1])
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
    """Posterior of an ensemble, drawn from a known Gaussian or described by its moments."""
    scores, levels = members
    rows = np.concatenate([levels, observed[np.newaxis]])
    scans, knocks = _scans(unknowns, layout, scores, rows), _knocks(layout, rows)
    flat = layout.levels_of(rows).reshape(len(rows), -1)
    if drawn is None:
        variance = np.diag(scores.var(axis=0))
        drawn = Gaussian(mean=scores.mean(axis=0), covariance=variance)
    return corrected(regressed(scores, flat, scans, knocks), drawn, prior)


def _knocks(layout: LevelLayout, rows: Float) -> Float:
    """Crank angles of knocks in all runs, scaled by scatter [shape=(n + 1, n_runs * n_knocks)]."""
    found = layout.knocks_of(rows).reshape(len(rows), -1)
    scatter = np.sqrt(found[:-1].var(axis=0) + LEAST_ANGLE**2)
    return np.asarray((found - found[:-1].mean(axis=0)) / scatter)


LEAST_ANGLE = 0.5
"""Smallest scatter of the crank angle of a knock [deg]."""


def offset_progress(
    progress: Callable[[int, int], None] | None, before: int, total: int
) -> Callable[[int, int], None] | None:
    """Progress of a part that starts after others."""
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
    """Convert a posterior found under the proposal into one under the prior.

    The information of the recordings is that of the regression minus that of the proposal; the
    prior is added once, regardless of the number of rounds.
    """
    sd = np.minimum(found.sd, proposal.sd)
    limit = STEP_LIMIT * proposal.sd
    mean = proposal.mean + np.clip(found.mean - proposal.mean, -limit, limit)
    gained = sd**-2.0 - proposal.sd**-2.0
    precision = gained + prior.sd**-2.0
    weighted = mean / sd**2 - proposal.mean / proposal.sd**2 + prior.mean / prior.sd**2
    final = precision**-0.5
    turned = _correlation(found.residuals)
    return Gaussian(mean=weighted / precision, covariance=turned * np.outer(final, final))


def _correlation(residuals: Float) -> Float:
    """Correlation of residuals, shrunk according to the number of members."""
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
    """Distribution of the next ensemble: wider than the posterior, at most as wide as the prior."""
    known = posterior.sd < UNDETERMINED * prior.sd
    sd = np.where(known, np.minimum(factor * posterior.sd, prior.sd), prior.sd)
    mean = np.where(known, posterior.mean, prior.mean)
    correlation = posterior.covariance / np.outer(posterior.sd, posterior.sd)
    both = np.outer(known, known) | np.eye(len(sd), dtype=bool)
    return Gaussian(mean=mean, covariance=np.where(both, correlation, 0.0) * np.outer(sd, sd))
