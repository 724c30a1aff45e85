"""How far each bearing of a shaft line has sagged, from measured transfer functions and reactions.

Gauss-Newton finds the most probable values of all unknowns, and the curvature there their
covariance: the posterior of a linear model with normal errors, about the mode of one that is not
linear.

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
_SETTLED = 0.1  # of a standard deviation: less than what a posterior is read to
_CLOSE = 1.0  # the same after the last step
_LONGEST = 0.7  # step of a sag over its prior's deviation
_WORSE = 4.0  # factor of the cost that a step may bring
_IMPLAUSIBLE = 1e-3  # probability of the misfit at a mode: below it another one is looked for
_MOST_HALVINGS = 6


# --- what was found


@dataclass(frozen=True, kw_only=True, eq=False)
class SagPosterior:
    """Sags of a line after its tests.

    Attributes
    ----------
    bearings : tuple of str
        k of them, those that may have sagged.
    datum : tuple of str
        The two against whose line they have.
    mean : numpy.ndarray [shape=(k,)]
        [m], downward positive, on top of those of the scene.
    covariance : numpy.ndarray [shape=(k, k)]
        [m^2]
    prior_deviation : float
        [m]
    misfit : float
        Chi-square over its degrees of freedom: about 1 where model and noise are what they are
        said to be [-].
    freedom : int
        Real numbers measured.
    values, spread : numpy.ndarray
        Of all unknowns at the mode, and their covariance; sags first.
    steps : int
        Of Gauss-Newton.
    settled : bool
        Whether the mode is less than a standard deviation away; otherwise mean and covariance are
        those of where the search stopped.
    scale : numpy.ndarray
        Prior deviation of each unknown.
    films : dict
        Probability of each condition of film rupture that was asked; empty where one was taken.
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
        """Whether model and noise explain what was measured; otherwise trust no interval."""
        return float(chdtrc(self.freedom, self.misfit * self.freedom)) > _IMPLAUSIBLE

    def interval(self, confidence: float = 0.9) -> Vector:
        """Least and largest sag of each bearing [shape=(k, 2)], [m]."""
        width = float(ndtri((1 + confidence) / 2)) * self.deviation
        return np.stack([self.mean - width, self.mean + width], axis=1)

    def holds(self, sags: Vector, confidence: float = 0.9) -> bool:
        """Whether the elliptic region of all sags together holds these [shape=(k,)]."""
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
        The line as it was aligned.
    transfers : sequence of MeasuredTransfer
        One for each test.
    measured : MeasuredReactions, optional
    prior : Prior, optional
        By default that of a line whose housings and oil are known by their data sheets.
    start : sequence of float, optional
        Sags to start from, one for each bearing but the datum [m]. By default none, and where what
        is found from there is implausible, each bearing sagged by a deviation of the prior.

    Returns
    -------
    SagPosterior

    Raises
    ------
    SagError
        Nothing is measured, or a name is unknown.
    ShaftFilmError
        The line does not rest on its films even without a sag.

    Notes
    -----
    The mode minimises ``sum |L^-1 (d - H)|^2 2 + sum (t / s)^2`` over the unknowns t, with L the
    factor of the noise; real and imaginary part of a circular error each have half its variance.
    A film answers the load it carries either way: about a bearing without load there may be two
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
        raise SagError("no sag was found with which the line rests on its films; check the scene")
    return _posterior(question, best)


# --- the mode


class _Mode(NamedTuple):
    values: Vector
    slopes: Vector  # (n_data, p)
    cost: float
    steps: int
    settled: bool


def _lower(one: _Mode | None, other: _Mode | None) -> _Mode | None:
    """The mode of the lower cost."""
    if one is None or (other is not None and other.cost < one.cost):
        return other
    return one


def _starts(question: Question) -> list[Vector]:
    """No sag, and each bearing sagged by a deviation, down and up."""
    own = question.unknowns
    size = np.diag(own.deviations[own.sags])
    return [np.zeros(len(size)), *size, *-size]


def _mode(question: Question, sags: Vector) -> _Mode | None:
    """Gauss-Newton from sags and the mean of all else; none where the line does not rest there.

    A film's coefficients jump by a per cent as the nodes of its mesh fill, more than a good test's
    noise, and the films' own errors among the unknowns make up for it only in the next step. So no
    step is asked to lower the cost; the mode is that of the linear model at the last trial.
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
    """The trial after the step, shortened where it goes too far to be linear."""
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
