"""Sag of each bearing of a shaft line, from measured transfer functions and reactions.

Gauss-Newton finds the most probable values of all unknowns, and the curvature there gives their
covariance: the posterior of the model linearised about its mode, with normal errors.

References
----------
Tarantola (2005), Inverse Problem Theory and Methods for Model Parameter Estimation, SIAM,
doi:10.1137/1.9780898717921, chapter 3. Friswell, Mottershead (1995), Finite Element Model Updating
in Structural Dynamics, Kluwer, doi:10.1007/978-94-015-8508-8, for bearings and foundations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import chdtrc, chdtri, ndtri

from ...sim.scene.shaft import ShaftScene
from .sag_model import (
    MeasuredReactions,
    MeasuredTransfer,
    Prior,
    Question,
    SagError,
    SagTrial,
    question_of,
    slopes_at,
    trial_at,
)

Vector = NDArray[np.float64]

_MOST_STEPS = 15
_SETTLED = 0.1  # of a standard deviation: finer than a posterior is read
_CLOSE = 1.0  # standard deviations, after the last step
_LONGEST = 0.7  # longest step of a sag, over its prior standard deviation
_WORSE = 4.0  # largest factor by which a step may raise the cost
_IMPLAUSIBLE = 1e-3  # probability of the misfit at a mode: below it another one is sought
_MOST_HALVINGS = 6


# --- result


@dataclass(frozen=True, kw_only=True, eq=False)
class SagPosterior:
    """Sags of a line after its tests.

    Attributes
    ----------
    bearings : tuple of str
        The k bearings that may have sagged.
    datum : tuple of str
        The two bearings whose connecting line is the datum.
    mean : numpy.ndarray [shape=(k,)]
        Sags in addition to those of the scene, downward positive [m].
    covariance : numpy.ndarray [shape=(k, k)]
        [m^2]
    prior_deviation : float
        [m]
    misfit : float
        Chi-square over its degrees of freedom: about 1 if model and noise are correct [-].
    freedom : int
        Number of measured real numbers.
    values, spread : numpy.ndarray
        All unknowns at the mode, and their covariance; sags first.
    steps : int
        Number of Gauss-Newton steps.
    settled : bool
        Whether the mode is less than a standard deviation away; otherwise mean and covariance
        belong to the point at which the search stopped.
    scale : numpy.ndarray
        Prior deviation of each unknown.
    films : dict
        Probability of each rupture condition of the films; empty if only one was assumed.
    """

    bearings: tuple[str, ...]
    datum: tuple[str, ...]
    mean: Vector
    covariance: Vector
    prior_deviation: float
    misfit: float
    freedom: int
    values: Vector
    spread: Vector
    steps: int
    settled: bool
    scale: Vector
    films: dict[str, float] = field(default_factory=dict)

    @property
    def deviation(self) -> Vector:
        """Standard deviation of each sag [shape=(k,)], [m]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def plausible(self) -> bool:
        """Whether model and noise explain the measurements; otherwise trust no interval."""
        return float(chdtrc(self.freedom, self.misfit * self.freedom)) > _IMPLAUSIBLE

    def interval(self, confidence: float = 0.9) -> Vector:
        """Interval of the sag of each bearing [shape=(k, 2)], [m]."""
        width = float(ndtri((1 + confidence) / 2)) * self.deviation
        return np.stack([self.mean - width, self.mean + width], axis=1)

    def holds(self, sags: Vector, confidence: float = 0.9) -> bool:
        """Whether the joint elliptic region of all sags contains these [shape=(k,)]."""
        off = self.mean - np.asarray(sags)
        distance = float(off @ np.linalg.solve(self.covariance, off))
        return distance <= float(chdtri(off.size, 1 - confidence))


def estimate_sags(
    scene: ShaftScene,
    transfers: Sequence[MeasuredTransfer] = (),
    measured: MeasuredReactions | None = None,
    *,
    prior: Prior | None = None,
    start: Sequence[float] | None = None,
) -> SagPosterior:
    """Posterior of the sags of a line.

    Parameters
    ----------
    scene : ShaftScene
        The line as aligned.
    transfers : sequence of MeasuredTransfer
        One for each test.
    measured : MeasuredReactions, optional
    prior : Prior, optional
        By default that of a line whose housings and oil are known from data sheets.
    start : sequence of float, optional
        Initial sags, one for each bearing except the datum [m]. By default zero; if the result is
        implausible, each bearing in turn is sagged by a prior standard deviation.

    Returns
    -------
    SagPosterior

    Raises
    ------
    SagError
        There is no measurement, or a name is unknown.
    ShaftFilmError
        The line has no equilibrium on its films even without a sag.

    Notes
    -----
    The mode minimises ``sum |L^-1 (d - H)|^2 2 + sum (t / s)^2`` over the unknowns t, with L the
    factor of the noise; real and imaginary part of a circular error each have half its variance.
    A film responds to its load alike in both directions: for an unloaded bearing there may be two
    modes, some hundredths of a millimetre apart, and the one found need not be the better.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> rig = load_scene("shaft-rig", {"bearings.2.offset": "0 mm"})
    >>> jacks = MeasuredReactions(reactions={"second": 392.4, "third": -20.0 + 265.0},
    ...                           deviations={"second": 10.0, "third": 10.0})
    >>> estimate_sags(rig, measured=jacks).bearings
    ('second', 'third')
    """
    if not transfers and measured is None:
        raise SagError("transfers and reactions are missing; give one of them")
    question = question_of(scene, transfers, measured, prior or Prior())
    starts = _starts(question) if start is None else [np.asarray(start, dtype=float)]
    best = None
    for sags in starts:
        best = _lower(best, _mode(question, sags))
        if best is not None and chdtrc(best.slopes.shape[0], best.cost) > _IMPLAUSIBLE:
            break
    if best is None:
        raise SagError("the line has no equilibrium on its films at any sag; check the scene")
    return _posterior(question, best)


# --- the mode


class _Mode(NamedTuple):
    values: Vector
    slopes: Vector  # (n_data, p)
    cost: float
    steps: int
    settled: bool


def _lower(one: _Mode | None, other: _Mode | None) -> _Mode | None:
    """Return the mode with the lower cost."""
    if one is None or (other is not None and other.cost < one.cost):
        return other
    return one


def _starts(question: Question) -> list[Vector]:
    """Zero sag, and each bearing sagged by a standard deviation, down and up."""
    own = question.unknowns
    size = np.diag(own.deviations[own.sags])
    return [np.zeros(len(size)), *size, *-size]


def _mode(question: Question, sags: Vector) -> _Mode | None:
    """Gauss-Newton from initial sags and the mean of all else; None without an equilibrium there.

    A film's coefficients jump by a per cent as the nodes of its mesh fill. This exceeds the noise
    of a good test, and the films' errors among the unknowns compensate it only in the next step.
    Hence a step need not lower the cost; the mode is that of the linear model at the last trial.
    """
    own = question.unknowns
    values = np.zeros(own.deviations.size)
    values[own.sags] = sags
    point = trial_at(question, values, {})
    steps = 0
    while point is not None:
        slopes = slopes_at(question, point)
        step = _step(question, point, slopes)
        spread = np.sqrt(np.diag(_covariance(question, slopes)))
        away = float((np.abs(step) / spread)[own.sags].max())
        if away < _SETTLED or steps == _MOST_STEPS:
            left = point.left - slopes @ step
            prior = (point.values + step) / own.deviations
            cost = float(left @ left + prior @ prior)
            return _Mode(point.values + step, slopes, cost, steps, away < _CLOSE)
        point = _followed(question, point, step)
        steps += 1
    return None


def _step(question: Question, point: SagTrial, slopes: Vector) -> Vector:
    deviations = question.unknowns.deviations
    scaled = slopes * deviations
    factor = cho_factor(scaled.T @ scaled + np.eye(deviations.size))
    right = scaled.T @ point.left - point.values / deviations
    return np.asarray(deviations * cho_solve(factor, right))


def _followed(question: Question, point: SagTrial, step: Vector) -> SagTrial | None:
    """Trial after the step, which is shortened if it is too long for the linear model."""
    own = question.unknowns
    share = min(1.0, _LONGEST / float((np.abs(step) / own.deviations)[own.sags].max()))
    for _ in range(_MOST_HALVINGS):
        trial = trial_at(question, point.values + share * step, point.films)
        if trial is not None and trial.cost < _WORSE * point.cost:
            return trial
        share /= 2
    return None


def _covariance(question: Question, slopes: Vector) -> Vector:
    deviations = question.unknowns.deviations
    scaled = slopes * deviations
    inner = np.linalg.inv(scaled.T @ scaled + np.eye(deviations.size))
    return np.asarray(deviations[:, None] * inner * deviations)


def _posterior(question: Question, mode: _Mode) -> SagPosterior:
    own = question.unknowns
    spread = _covariance(question, mode.slopes)
    names = question.names
    freedom = mode.slopes.shape[0]
    return SagPosterior(
        bearings=tuple(names[i] for i in own.sagging),
        datum=tuple(name for i, name in enumerate(names) if i not in own.sagging),
        mean=mode.values[own.sags],
        covariance=spread[own.sags, own.sags],
        prior_deviation=float(own.deviations[0]),
        misfit=mode.cost / freedom,
        freedom=freedom,
        values=mode.values,
        spread=spread,
        steps=mode.steps,
        settled=mode.settled,
        scale=own.deviations,
    )
