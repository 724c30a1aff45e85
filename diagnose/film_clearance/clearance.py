"""The clearance of a journal bearing from where its journal runs: film equilibrium, inverted.

A loaded journal lies on its film where the film carries the load: under the same load it sinks the
deeper the wider the bearing. Speed, load, viscosity and the bearing's size given, the mean readings
of two probes tell the clearance, with no training at all. What is not known exactly is estimated
along with it, held by how well it is known: the readings of a centred shaft, the probes'
sensitivities, load and viscosity. Healthy recordings of the same machine share these numbers, and
have the clearance of a machine as new: they tell the offsets of the probes.

What the film is like is not known exactly either. A scar where the load presses lets the journal
sink without a wider bore, and an end of the film that no theory has right lets it lie
elsewhere. Other films are tried beside the scene's, and count by how well they explain the
readings.
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
"""Of the interval, as that of the trained models."""

NORMAL = 1.6449  # standard deviations to either side of the middle 90 %
CORRECTED = 10.0  # times its doubt: an offset that healthy recordings of known wear correct
FLOOR = 0.2e-6  # m: mean of a record of some revolutions, and the curve's own error
_MOST_SWING = 0.35  # rms of the orbit over the radial clearance; beyond, it has no place of rest
_LOOSEST = 0.3  # standard error of the clearance's logarithm, above which nothing is told
CONTRADICTED = 2.6  # root mean square of what is left, in standard deviations, per free number
OR_HEALTHY = (
    ", or give healthy recordings (--baseline): they separate offsets from a bore of another shape"
)
"""Cure of readings that nothing explains, where there are none."""
_WIDEST, _NARROWEST = 10.0, 0.1  # clearance looked for, over that as new
SCARS = tuple(
    (depth, math.radians(turned))
    for depth in (0.06, 0.13, 0.22, 0.33, 0.48)
    for turned in (-15.0, 0.0, 15.0)
)
"""Depths of scars that a bore may have, over the radial clearance; angles from the load [rad]."""


@dataclass(frozen=True, kw_only=True)
class Doubts:
    """Standard uncertainties of what an estimate is told.

    Attributes
    ----------
    load : float
        Of each component, over the load. Belts are set by a gauge, a rotor is weighed: 5 %.
    viscosity : float
        Over the viscosity. Oil loses 4 to 5 % a kelvin near 45 degrees Celsius, and the film is
        warmer than the sump by what is known to two or three: 10 %.
    offset : float
        Of the reading of a centred shaft [m]. Gaps are set to some hundredths of a volt, and the
        middle is found by lifting the shaft: half a per cent of the range, 5 um of 1 mm.
    gain : float
        Of a probe's sensitivity, over it. API 670 allows 5 %, evenly spread: 3 %.
    clearance : float
        Of a diametral clearance that was measured [m]. Lead wire and plastic strips are read to
        some hundredths of a millimetre: 5 um.
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
    """One recording, as the film sees it.

    Attributes
    ----------
    readings : numpy.ndarray [shape=(n_probes,)]
        Mean motion towards each probe, zero for a centred shaft [m].
    swing : float
        rms of the motion about it [m].
    load : tuple of float
        On the journal along X and Y, weight included [N].
    film_force : float
        ``eta omega R^3 L`` [N m^2], the film's force times the square of the clearance.
    measured : float or None
        Diametral clearance that was measured when it was recorded, of healthy recordings [m].
    """

    readings: Float
    swing: float
    load: tuple[float, float]
    film_force: float
    measured: float | None = None


@dataclass(frozen=True, kw_only=True)
class FilmEstimate:
    """What the film equilibrium says of a recording.

    Attributes
    ----------
    reason : str
        Why nothing can be told; empty where there is an estimate.
    severity, low, high : float or None
        Diametral clearance, or wear, and its interval [m].
    coverage : float
        Nominal, of the interval, as far as the stated uncertainties hold.
    healthy : int
        Recordings of the machine as new that it was told against.
    budget : dict
        What each doubt is worth: its own part of half the interval [m], by the names of
        :class:`Doubts`, and what film and bore are like where that is not known; their squares
        add up to that of the whole.
    contradicted : bool
        A journal is where no clearance puts it, so that something else is not as told.
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
    """Diametral clearance that puts the journal where it was measured.

    Parameters
    ----------
    run : JournalRun
    curve : RestCurve
        Of the bearing's film.
    angles : sequence of float
        Of the probes, from X in the direction of rotation [rad].
    as_new : tuple of float
        Least and largest diametral clearance of a healthy bearing of this kind [m].
    others : sequence of PossibleFilm
        What the film may be instead.
    healthy : sequence of JournalRun
        Of the same machine, with the clearance that was measured, else one within `as_new`.
    doubts : Doubts
        How well it is known what is told.

    Returns
    -------
    FilmEstimate

    Notes
    -----
    Least squares over all readings, with the logarithms of the clearance now and as new, offset and
    sensitivity of every probe, and of every recording factors of load and viscosity, each held by
    its uncertainty; half of the variance of these factors, and of the clearance as new, is common
    to all recordings, as an error of the nameplate is, the other half is that of the day. The
    interval is that of the linearised problem. The mean of an orbit departs from the place of rest
    by about its mean square over the clearance, which is counted as scatter.

    Of a bore with a scar it is the clearance across the scar, which a lift of the shaft or a lead
    wire shows.

    Laminar and isothermal. A groove, a wrong direction of the load or a swapped probe put the
    journal where no clearance explains it: that is said, not fitted. Without healthy recordings
    the film as told must explain the readings: two probes do not tell a scar from their offsets.

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
    told = problem.solve(films[0], problem.start())
    each = [told, *(problem.solve(film, told.values) for film in others)]
    found, weights = mixed_by_evidence(
        [film.across(problem.explained(one)) for film, one in zip(films, each, strict=True)],
        [one.cost for one in each],
        [film.likely for film in films],
    )
    if not healthy:
        found = found._replace(left=told.left)
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
        # a machine that is asked about may have any clearance: its prior says next to nothing
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
        """Readings [shape=(..., n, n_probes)] for deviations from what is told, in their doubts."""
        real = free * self.prior
        probes, n = self.probes, self.n
        new, offsets, gains, loads, oils = np.split(
            real[..., 1:], np.cumsum([n, probes, probes, 1 + n]), axis=-1
        )
        apart = np.concatenate([real[..., :1], new[..., :1] + new[..., 1:]], axis=-1)
        clearance = np.exp(self.middles + apart)
        strength = self.film_force * np.exp(oils[..., :1] + oils[..., 1:]) / clearance**2
        load = self.load * (np.exp(loads[..., :1] + loads[..., 1:]) / strength)[..., None]
        rest = [film.now.position(load[..., :1, :]), film.new.position(load[..., 1:, :])]
        place = clearance[..., None] * np.concatenate(rest, axis=-2)
        read = place @ self.looks + offsets[..., None, :]
        return np.asarray(read * np.exp(gains)[..., None, :])

    def residuals(self, film: "PossibleFilm", free: Float) -> Float:
        """Of readings, then of what is held, in standard deviations."""
        apart = (self.predicted(free, film) - self.readings) / self.scatter[:, None]
        return np.concatenate([apart.reshape(*free.shape[:-1], -1), free], axis=-1)

    def start(self) -> Float:
        """All as told, and a clearance in which the journal has room."""
        start = np.zeros(len(self.prior))
        radius = float(np.hypot(*np.linalg.lstsq(self.looks.T, self.readings[0], rcond=None)[0]))
        guess = max(1.3 * radius, math.exp(self.middle))
        start[0] = (math.log(guess) - self.middle) / self.prior[0]
        return start

    def solve(self, film: "PossibleFilm", start: Float) -> "FittedClearance":
        """Deviations from what is told, if the film is this one."""
        return fitted(partial(self.residuals, film), start, self.readings.size)

    def explained(self, found: "FittedClearance") -> "Explained":
        """Logarithm of the clearance, of deviations."""
        unit = float(self.prior[0])
        return Explained(
            value=self.middle + float(found.values[0]) * unit,
            error=found.error * unit,
            budget={name: found.worth(self.names, name) * unit for name in DOUBTS},
            left=found.left,
        )


class PossibleFilm(NamedTuple):
    """What the film of a machine may be.

    Attributes
    ----------
    likely : float
        Probability before the readings, over that of the film as told.
    now, new : RestCurve
        Of the machine in question, and of the same when it was new.
    scar : float
        Depth of that scar of the machine in question, over its radial clearance.
    """

    likely: float
    now: "RestCurve"
    new: "RestCurve"
    scar: float = 0.0

    def across(self, found: "Explained") -> "Explained":
        """The clearance across the scar, as a lead wire shows it, from that of the round bore."""
        return found._replace(value=found.value + math.log1p(self.scar / 2))


class Explained(NamedTuple):
    """How one bore or film explains the readings: what is asked for, and how sure that is.

    Attributes
    ----------
    value, error : float
        Number that is asked for, and its standard error.
    budget : dict
        Parts of that error, by the names of :class:`Doubts`.
    left : float
        As of :class:`FittedClearance`.
    """

    value: float
    error: float
    budget: dict[str, float]
    left: float


def mixed_by_evidence(
    each: Sequence[Explained], costs: Sequence[float], likely: Sequence[float]
) -> tuple[Explained, Float]:
    """Of several bores, each by how well it explains the readings.

    The weight is its probability before, times its likelihood, times the range of the value that
    it allows: nearly its evidence by Laplace's method.

    Parameters
    ----------
    each : sequence of Explained
    costs : sequence of float
        Half the sum of squares that each leaves.
    likely : sequence of float
        Probability of each before the readings, up to a factor.

    Returns
    -------
    Explained
        Its budget has film and bore as well, where there is more than one.
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
    """Least squares of readings and of what is held.

    Attributes
    ----------
    values : numpy.ndarray [shape=(n,)]
        Numbers found.
    covariance : numpy.ndarray [shape=(n,)]
        Of the first number with each.
    cost : float
        Half of the residuals' sum of squares.
    left : float
        Root mean square of the residuals per reading beyond the first, in standard deviations.
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
        """Part of that error which is due to what is held under a name.

        The first number moves by its covariance with another where the value at which that one
        is held moves by its standard deviation.
        """
        mine = [part for part, own in zip(self.covariance, names, strict=True) if own == name]
        return math.hypot(*mine)


def fitted(residuals: Callable[[Float], Float], start: Float, n_readings: int) -> FittedClearance:
    """Numbers with the least residuals, which are in standard deviations.

    Parameters
    ----------
    residuals : callable
        Numbers [shape=(..., n)] -> residuals of readings and of prior knowledge of each
        [shape=(..., n_readings + n)].
    start : numpy.ndarray [shape=(n,)]
    n_readings : int
    """

    def slopes(free: Float) -> Float:
        # all at once: one call costs as much as one of its rows
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
    reason = _untold(problem, found, run, film, clearance)
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
    """That nothing explains the readings; empty where something does."""
    ratio = clearance / math.exp(problem.middle)
    if not found.left <= CONTRADICTED:
        why = f"{found.left:.1f} standard deviations are left, must be <= {CONTRADICTED:g}"
    elif not _NARROWEST < ratio < _WIDEST:
        why = (
            f"it would be {ratio:.3g} times that as new, must be > {_NARROWEST:g} and < {_WIDEST:g}"
        )
    else:
        return ""
    return (
        f"no clearance puts the journal where the probes see it: {why}; check load, its direction, "
        f"viscosity and the probes{OR_HEALTHY if problem.n == 1 else ''}"
    )


def _untold(
    problem: _Problem, found: Explained, run: JournalRun, film: PossibleFilm, clearance: float
) -> str:
    """Why a solution that explains the readings is no estimate; empty where it is one."""
    if run.swing > _MOST_SWING * clearance:
        return (
            f"the orbit's rms is {run.swing / clearance:.2f} of the radial clearance, must be <= "
            f"{_MOST_SWING:g}: a whirling journal has no place of rest"
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
