"""Clearance of a journal bearing from the journal position, by inverting the film equilibrium.

A loaded journal rests where its film carries the load: under the same load it sinks deeper in a
wider bearing. Given speed, load, viscosity and bearing size, the mean readings of two probes
determine the clearance without training. Uncertain data are estimated along with it, constrained by
their uncertainties: readings of a centred shaft, sensitivities of the probes, load and viscosity.
Healthy recordings of the same machine share these numbers and have the clearance as new, so that
they determine the offsets of the probes.

The film itself is uncertain too. A scar in the loaded zone lets the journal sink without a wider
bore, and the rupture of the film is not predicted exactly. Alternative films are therefore
considered, weighted by how well they explain the readings.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

if TYPE_CHECKING:
    from ...sim.bearing.rest_curve import RestCurve

Float = NDArray[np.float64]

COVERAGE = 0.9
"""Nominal coverage of the interval, as for trained models."""

NORMAL = 1.6449  # standard deviations to either side of the middle 90 %
CORRECTED = 10.0  # widening of an offset's uncertainty, given healthy recordings of known wear
FLOOR = 0.2e-6  # m: error of a mean over few revolutions, and of the curve
_MOST_SWING = 0.35  # rms of the orbit over the radial clearance; beyond, it has no equilibrium
_LOOSEST = 0.3  # largest standard error of the clearance's logarithm for an estimate
CONTRADICTED = 2.6  # limit of the rms residual, in standard deviations, per free number
OR_HEALTHY = (
    ", or give healthy recordings (--baseline): they separate offsets from a bore of another shape"
)
"""Cure for unexplained readings without healthy recordings."""
_WIDEST, _NARROWEST = 10.0, 0.1  # range of the clearance, over that as new
SCARS = tuple(
    (depth, math.radians(turned))
    for depth in (0.06, 0.13, 0.22, 0.33, 0.48)
    for turned in (-15.0, 0.0, 15.0)
)
"""Possible scars of a bore: depth over the radial clearance, and angle from the load [rad]."""


@dataclass(frozen=True, kw_only=True)
class Doubts:
    """Standard uncertainties of the input of an estimate.

    Attributes
    ----------
    load : float
        Each load component, relative. Belts are set by a gauge, a rotor is weighed: 5 %.
    viscosity : float
        Viscosity, relative. Oil loses 4 to 5 % per kelvin near 45 degrees Celsius, and the excess
        temperature of the film over the sump is known within two or three kelvin: 10 %.
    offset : float
        Reading of a centred shaft [m]. Gaps are set within some hundredths of a volt, and the
        centre is found by lifting the shaft: half a per cent of the range, 5 um of 1 mm.
    gain : float
        Sensitivity of a probe, relative. API 670 allows 5 %, uniformly distributed: 3 %.
    clearance : float
        A measured diametral clearance [m]. Lead wire and plastic strips are read to some hundredths
        of a millimetre: 5 um.
    """

    load: float = 0.05
    viscosity: float = 0.10
    offset: float = 5e-6
    gain: float = 0.03
    clearance: float = 5e-6


USUAL_DOUBTS = Doubts()
DOUBTS = tuple(each.name for each in fields(Doubts))


@dataclass(frozen=True, kw_only=True)
class JournalRun:
    """Input of the film inversion from one recording.

    Attributes
    ----------
    readings : numpy.ndarray [shape=(n_probes,)]
        Mean motion towards each probe, zero for a centred shaft [m].
    swing : float
        rms of the motion about it [m].
    load : tuple of float
        Load on the journal along X and Y, including weight [N].
    film_force : float
        ``eta omega R^3 L`` [N m^2], force unit of the film times the square of the clearance.
    measured : float or None
        Diametral clearance measured at the time of a healthy recording [m].
    """

    readings: Float
    swing: float
    load: tuple[float, float]
    film_force: float
    measured: float | None = None


@dataclass(frozen=True, kw_only=True)
class FilmEstimate:
    """Estimate by the film equilibrium for a recording.

    Attributes
    ----------
    reason : str
        Why there is no estimate; empty if there is one.
    severity, low, high : float or None
        Diametral clearance, or wear, and its interval [m].
    coverage : float
        Nominal coverage of the interval, if the stated uncertainties are correct.
    healthy : int
        Number of recordings of the machine as new.
    budget : dict
        Contribution of each uncertainty to half the interval [m], by the names of :class:`Doubts`,
        and of unknown film and bore; the squares add up to that of the total.
    contradicted : bool
        No clearance explains the journal position, so that other input must be wrong.
    """

    reason: str = ""
    severity: float | None = None
    low: float | None = None
    high: float | None = None
    coverage: float = COVERAGE
    healthy: int = 0
    budget: dict[str, float] = field(default_factory=dict)
    contradicted: bool = False


def film_clearance(
    run: JournalRun,
    curve: "RestCurve",
    angles: Sequence[float],
    as_new: tuple[float, float],
    *,
    others: Sequence["PossibleFilm"] = (),
    healthy: Sequence[JournalRun] = (),
    doubts: Doubts = USUAL_DOUBTS,
) -> FilmEstimate:
    """Diametral clearance that explains the measured journal position.

    Parameters
    ----------
    run : JournalRun
    curve : RestCurve
        Equilibrium curve of the bearing's film.
    angles : sequence of float
        Angles of the probes, from X in the direction of rotation [rad].
    as_new : tuple of float
        Smallest and largest diametral clearance of a healthy bearing of this kind [m].
    others : sequence of PossibleFilm
        Alternative films.
    healthy : sequence of JournalRun
        Recordings of the same machine, with a measured clearance, or one within `as_new`.
    doubts : Doubts
        Uncertainties of the input.

    Returns
    -------
    FilmEstimate

    Notes
    -----
    Least squares over all readings, with the logarithms of the clearance now and as new, offset and
    sensitivity of every probe, and factors of load and viscosity of every recording, each
    constrained by its uncertainty. Half of the variance of these factors, and of the clearance as
    new, is common to all recordings, like an error of the nameplate, the other half is specific to
    the day. The interval is that of the linearised problem. The mean of an orbit deviates from the
    equilibrium by about its mean square over the clearance, which counts as scatter.

    For a bore with a scar the result is the clearance across the scar, as a lift of the shaft or a
    lead wire shows it.

    The film is laminar and isothermal. With a groove, a wrong load direction or a swapped probe no
    clearance explains the journal position: this is reported, not fitted. Without healthy
    recordings the given film must explain the readings, because two probes cannot distinguish a
    scar from their offsets.

    Examples
    --------
    >>> from wearstate.sim.film.solve import FilmGeometry
    >>> from wearstate.sim.bearing.rest_curve import rest_curve
    >>> curve = rest_curve(FilmGeometry(length_to_diameter=0.6), "short")
    >>> film_force, load, clearance = 7e-5, 6e3, 90e-6
    >>> place = clearance * curve.position([load * clearance**2 / film_force, 0.0])
    >>> towards = np.array([place @ (math.cos(a), math.sin(a)) for a in (3.93, 2.36)])
    >>> run = JournalRun(readings=towards, swing=2e-6, load=(load, 0.0), film_force=film_force)
    >>> found = film_clearance(run, curve, (3.93, 2.36), (0.09e-3, 0.19e-3))
    >>> round(found.severity * 1e3, 2), found.low < found.severity < found.high
    (0.18, True)
    """
    runs = [run, *healthy]
    reason = _unloaded(runs)
    if reason:
        return FilmEstimate(reason=reason)
    problem = _Problem(runs, np.asarray(angles), as_new, doubts)
    films = [PossibleFilm(likely=1.0, now=curve, new=curve), *others]
    given = problem.solve(films[0], problem.start())
    each = [given, *(problem.solve(film, given.values) for film in others)]
    found, weights = mixed_by_evidence(
        [film.across(problem.explained(one)) for film, one in zip(films, each, strict=True)],
        [one.cost for one in each],
        [film.likely for film in films],
    )
    if not healthy:
        found = found._replace(left=given.left)
    likeliest = films[int(np.argmax(weights))]
    return _judged(problem, found, run, likeliest, len(healthy))


def _unloaded(runs: Sequence[JournalRun]) -> str:
    least = min(math.hypot(*each.load) for each in runs)
    if least > 0:
        return ""
    return (
        "the static load is 0 N, must be > 0: an unloaded journal runs in the middle of any "
        "clearance"
    )


class _Problem:
    """Readings and prior knowledge as residuals in standard deviations."""

    def __init__(
        self,
        runs: Sequence[JournalRun],
        angles: Float,
        as_new: tuple[float, float],
        doubts: Doubts,
    ) -> None:
        n, probes = len(runs), len(angles)
        self.n, self.probes = n, probes
        self.readings = np.array([run.readings for run in runs])
        self.load = np.array([run.load for run in runs])
        self.film_force = np.array([run.film_force for run in runs])
        self.looks = np.stack([np.cos(angles), np.sin(angles)])
        low, high = np.log(as_new) - math.log(2)
        self.middle = (low + high) / 2
        measured = [run.measured for run in runs[1:] if run.measured is not None]
        known = len(measured) == n - 1 > 0
        self.middles = np.array(
            [self.middle, *(math.log(c / 2) for c in measured)] if known else [self.middle] * n
        )
        band = doubts.clearance / max(measured) if known else (high - low) / math.sqrt(12)
        # the clearance of the judged machine is unknown: its prior is nearly flat
        day = math.sqrt(0.5)
        self.prior = np.concatenate(
            [
                [math.log(_WIDEST)],
                [day * band] * n,
                [doubts.offset * (CORRECTED if known else 1)] * probes,
                [doubts.gain] * probes,
                np.repeat([day * doubts.load, day * doubts.viscosity], 1 + n),
            ]
        )
        self.names = [
            *["", *["clearance"] * n, *["offset"] * probes, *["gain"] * probes],
            *["load"] * (1 + n),
            *["viscosity"] * (1 + n),
        ]
        swing = np.array([run.swing for run in runs])
        self.scatter = np.hypot(FLOOR, swing**2 / math.exp(self.middle))

    def predicted(self, free: Float, film: "PossibleFilm") -> Float:
        """Readings [shape=(..., n, n_probes)] for deviations from the input, in uncertainties."""
        real = free * self.prior
        probes, n = self.probes, self.n
        new, offsets, gains, loads, oils = np.split(
            real[..., 1:], np.cumsum([n, probes, probes, 1 + n]), axis=-1
        )
        deviation = np.concatenate([real[..., :1], new[..., :1] + new[..., 1:]], axis=-1)
        clearance = np.exp(self.middles + deviation)
        strength = self.film_force * np.exp(oils[..., :1] + oils[..., 1:]) / clearance**2
        load = self.load * (np.exp(loads[..., :1] + loads[..., 1:]) / strength)[..., None]
        rest = [film.now.position(load[..., :1, :]), film.new.position(load[..., 1:, :])]
        place = clearance[..., None] * np.concatenate(rest, axis=-2)
        read = place @ self.looks + offsets[..., None, :]
        return np.asarray(read * np.exp(gains)[..., None, :])

    def residuals(self, film: "PossibleFilm", free: Float) -> Float:
        """Residuals of readings, then of the prior, in standard deviations."""
        misfit = (self.predicted(free, film) - self.readings) / self.scatter[:, None]
        return np.concatenate([misfit.reshape(*free.shape[:-1], -1), free], axis=-1)

    def start(self) -> Float:
        """Initial values: the input as given, and a clearance that holds the journal position."""
        start = np.zeros(len(self.prior))
        radius = float(np.hypot(*np.linalg.lstsq(self.looks.T, self.readings[0], rcond=None)[0]))
        guess = max(1.3 * radius, math.exp(self.middle))
        start[0] = (math.log(guess) - self.middle) / self.prior[0]
        return start

    def solve(self, film: "PossibleFilm", start: Float) -> "FittedClearance":
        """Fit of the deviations from the input, for one film."""
        return fitted(partial(self.residuals, film), start, self.readings.size)

    def explained(self, found: "FittedClearance") -> "Explained":
        """Logarithm of the clearance from fitted deviations."""
        unit = float(self.prior[0])
        return Explained(
            value=self.middle + float(found.values[0]) * unit,
            error=found.error * unit,
            budget={name: found.worth(self.names, name) * unit for name in DOUBTS},
            left=found.left,
        )


class PossibleFilm(NamedTuple):
    """A possible film of a machine.

    Attributes
    ----------
    likely : float
        Prior probability, over that of the given film.
    now, new : RestCurve
        Equilibrium curve of the machine at present, and when new.
    scar : float
        Depth of the present scar, over the radial clearance.
    """

    likely: float
    now: "RestCurve"
    new: "RestCurve"
    scar: float = 0.0

    def across(self, found: "Explained") -> "Explained":
        """Convert the clearance of the round bore to that across the scar, as by a lead wire."""
        return found._replace(value=found.value + math.log1p(self.scar / 2))


class Explained(NamedTuple):
    """Result for one bore or film: the requested number and its uncertainty.

    Attributes
    ----------
    value, error : float
        Requested number, and its standard error.
    budget : dict
        Contributions to that error, by the names of :class:`Doubts`.
    left : float
        As in :class:`FittedClearance`.
    """

    value: float
    error: float
    budget: dict[str, float]
    left: float


def mixed_by_evidence(
    each: Sequence[Explained], costs: Sequence[float], likely: Sequence[float]
) -> tuple[Explained, Float]:
    """Mixture of several bores, weighted by how well they explain the readings.

    The weight is the prior probability times the likelihood times the standard error of the value:
    nearly the evidence by Laplace's method.

    Parameters
    ----------
    each : sequence of Explained
    costs : sequence of float
        Half the residual sum of squares of each.
    likely : sequence of float
        Prior probability of each, up to a factor.

    Returns
    -------
    Explained
        Its budget includes film and bore if there is more than one.
    weights : numpy.ndarray [shape=(n,)]

    Examples
    --------
    >>> one = Explained(value=1.0, error=0.1, budget={"load": 0.1}, left=1.0)
    >>> both, weights = mixed_by_evidence([one, one._replace(value=2.0)], [0.5, 0.5], [1.0, 1.0])
    >>> both.value, round(both.budget["film and bore"], 2), weights.tolist()
    (1.5, 0.5, [0.5, 0.5])
    """
    evidence = np.log([one.error * before for one, before in zip(each, likely, strict=True)])
    evidence -= np.asarray(costs)
    weights = np.exp(evidence - evidence.max())
    weights /= weights.sum()
    if len(each) == 1:
        return each[0], weights
    values = np.array([one.value for one in each])
    value = float(weights @ values)
    parts = {
        name: math.sqrt(weights @ np.array([one.budget[name] ** 2 for one in each]))
        for name in each[0].budget
    }
    parts["film and bore"] = math.sqrt(weights @ (values - value) ** 2)
    variance = weights @ np.array([one.error**2 for one in each])
    mixed = Explained(
        value=value,
        error=math.sqrt(variance + parts["film and bore"] ** 2),
        budget=parts,
        left=min(one.left for one in each),
    )
    return mixed, weights


@dataclass(frozen=True, kw_only=True)
class FittedClearance:
    """Least-squares fit of readings and prior.

    Attributes
    ----------
    values : numpy.ndarray [shape=(n,)]
        Fitted numbers.
    covariance : numpy.ndarray [shape=(n,)]
        Covariance of the first number with each.
    cost : float
        Half the sum of squared residuals.
    left : float
        Rms of the residuals per reading beyond the first, in standard deviations.
    """

    values: Float
    covariance: Float
    cost: float
    left: float

    @property
    def error(self) -> float:
        """Standard error of the first number."""
        return math.sqrt(self.covariance[0])

    def worth(self, names: Sequence[str], name: str) -> float:
        """Contribution to that error by the prior of a name.

        The first number changes by its covariance with another if the prior mean of that one
        changes by its standard deviation.
        """
        mine = [part for part, own in zip(self.covariance, names, strict=True) if own == name]
        return math.hypot(*mine)


def fitted(residuals: Callable[[Float], Float], start: Float, n_readings: int) -> FittedClearance:
    """Least-squares fit of numbers to residuals in standard deviations.

    Parameters
    ----------
    residuals : callable
        Numbers [shape=(..., n)] -> residuals of readings and of prior knowledge of each
        [shape=(..., n_readings + n)].
    start : numpy.ndarray [shape=(n,)]
    n_readings : int
    """

    def slopes(free: Float) -> Float:
        # vectorised: one call takes as long as one of its rows
        ends = residuals(free + _STEP * np.array([1, -1])[:, None, None] * np.eye(free.size))
        return np.asarray((ends[0] - ends[1]).T / (2 * _STEP))

    found = least_squares(residuals, start, slopes, method="lm", xtol=1e-10, ftol=1e-10)
    inverse = np.linalg.inv(found.jac.T @ found.jac)
    return FittedClearance(
        values=found.x,
        covariance=inverse[0],
        cost=float(found.cost),
        left=math.sqrt(2 * found.cost / max(1, n_readings - 1)),
    )


_STEP = 1e-5  # standard deviations, of central differences


def _judged(
    problem: _Problem, found: Explained, run: JournalRun, film: PossibleFilm, healthy: int
) -> FilmEstimate:
    clearance = math.exp(found.value)
    reason = _contradiction(problem, found, clearance)
    if reason:
        return FilmEstimate(reason=reason, healthy=healthy, contradicted=True)
    reason = _rejection(problem, found, run, film, clearance)
    if reason:
        return FilmEstimate(reason=reason, healthy=healthy)
    spread = math.exp(NORMAL * found.error)
    return FilmEstimate(
        severity=2 * clearance,
        low=2 * clearance / spread,
        high=2 * clearance * spread,
        healthy=healthy,
        budget={name: 2 * clearance * NORMAL * part for name, part in found.budget.items()},
    )


def _contradiction(problem: _Problem, found: Explained, clearance: float) -> str:
    """Reason if no clearance explains the readings; else empty."""
    ratio = clearance / math.exp(problem.middle)
    if not found.left <= CONTRADICTED:
        why = f"{found.left:.1f} standard deviations remain, must be <= {CONTRADICTED:g}"
    elif not _NARROWEST < ratio < _WIDEST:
        why = (
            f"it would be {ratio:.3g} times that as new, must be > {_NARROWEST:g} and < {_WIDEST:g}"
        )
    else:
        return ""
    return (
        f"no clearance explains the journal position: {why}; check load, its direction, "
        f"viscosity and the probes{OR_HEALTHY if problem.n == 1 else ''}"
    )


def _rejection(
    problem: _Problem, found: Explained, run: JournalRun, film: PossibleFilm, clearance: float
) -> str:
    """Why a solution that explains the readings is not used; empty if it is."""
    if run.swing > _MOST_SWING * clearance:
        return (
            f"the orbit's rms is {run.swing / clearance:.2f} of the radial clearance, must be <= "
            f"{_MOST_SWING:g}: a whirling journal has no equilibrium position"
        )
    round_bore = clearance / (1 + film.scar / 2)
    load = math.hypot(*run.load) * round_bore**2 / float(problem.film_force[0])
    if load > film.now.most_load:
        return (
            f"the film would be thinner than 3 % of the clearance (load {load:.3g} of its unit, "
            f"must be <= {film.now.most_load:.3g}): check load, viscosity and speed"
        )
    if found.error > _LOOSEST:
        return (
            f"its standard error would be {100 * found.error:.0f} %, must be <= "
            f"{100 * _LOOSEST:.0f} %: the journal is loaded too lightly for probes known so "
            "well; give healthy recordings of the machine (--baseline)"
        )
    return ""
