"""Model of a shaft line with all its unknowns, which predicts the result of a test.

The unknowns are the sags and other uncertain properties: housings, oil, the films' own
coefficients, the gains of the sensors. Each has a normal prior. Measured transfer functions and
reactions are compared with the model's in units of their noise, with derivatives with respect to
every unknown.

Raising or tilting the whole line has no effect. Sags are therefore relative to the line through
two bearings, by default the first and the last.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...sim.alignment.alignment import AlignmentLine, Condition, influence, reactions
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.changed import (
    FreeLine,
    LineModel,
    coefficient_slopes,
    free_line,
    line_model,
    no_change,
    part_of,
    rest,
    transfer,
    transfer_slopes,
    unit_change,
)
from ...sim.shaft.line_alignment import alignment_conditions, alignment_line
from ...sim.shaft_films.on_oil_films import BeamFilm
from ...sim.shaft_films.status import ShaftFilmError
from ...sim.shaft_response.places import Place

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

_FILM_ENTRIES = 16


class SagError(ValueError):
    """Data or a prior from which no sag can be estimated."""


# --- measurements


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredTransfer:
    """Transfer functions of one test.

    Attributes
    ----------
    frequencies : numpy.ndarray [shape=(n_lines,)]
        > 0 [Hz].
    value : numpy.ndarray [shape=(n_lines, n_resp)]
        Accelerance, complex [(m/s^2)/N].
    covariance : numpy.ndarray [shape=(n_lines, n_resp, n_resp)]
        Covariance of its noise, Hermitian: mean of ``e e^H`` for circular complex errors e.
    speed : float
        Speed of the shaft in the test, > 0 [rad/s].
    force : place
        Place of the test force.
    responses : tuple of place
        Places of the accelerometers.

    Raises
    ------
    SagError
        Shapes do not agree, or a number is not finite; all faults at once.
    """

    frequencies: Vector
    value: Complex
    covariance: Complex
    speed: float
    force: Place
    responses: tuple[Place, ...]

    def __post_init__(self) -> None:
        shape = (self.frequencies.size, len(self.responses))
        faults = [
            f"{name} of shape {array.shape} must be {wanted}: lines by responses"
            for name, array, wanted in (
                ("value", self.value, shape),
                ("covariance", self.covariance, (*shape, shape[1])),
            )
            if array.shape != wanted
        ]
        if not (np.isfinite(self.value).all() and np.isfinite(self.covariance).all()):
            faults.append("value and covariance must be finite; leave out lines without coherence")
        if not 0 < self.speed < math.inf:
            faults.append(f"speed = {self.speed} rad/s must be > 0; a film needs rotation")
        if faults:
            raise SagError("\n".join(faults))


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredReactions:
    """Reactions measured by jacking.

    Attributes
    ----------
    reactions : mapping of str to float
        Bearing -> [N].
    deviations : mapping of str to float
        Standard deviation of each, > 0 [N].
    condition : str
        Condition of the scene during the measurement.
    """

    reactions: Mapping[str, float]
    deviations: Mapping[str, float]
    condition: str = "cold"


# --- unknowns


@dataclass(frozen=True, kw_only=True)
class Prior:
    """Prior standard deviations, before any test.

    Attributes
    ----------
    sag : float or None
        Sag of each bearing [m]; by default the sag that unloads an average bearing, see
        :func:`usual_sag`.
    datum : tuple of str
        Two bearings whose connecting line is the datum of the sags; by default the first and the
        last.
    housing_stiffness, housing_damping, viscosity, clearance : float
        Natural logarithm of the quantity [-]: about the relative error. A uniform tolerance of +-a
        has ``a / sqrt(3)``.
    film : float
        Every coefficient of every film, relative to the size of the film's coefficients [-]: error
        of the film model and of its mesh, see :mod:`wearstate.sim.shaft_films.on_oil_films`.
    gain : float
        Logarithm of each response's gain over that of the force [-].
    """

    sag: float | None = None
    datum: tuple[str, ...] = ()
    housing_stiffness: float = 0.06 / math.sqrt(3)
    housing_damping: float = 0.4 / math.sqrt(3)
    viscosity: float = 0.2 / math.sqrt(3)
    clearance: float = 0.0
    film: float = 0.03
    gain: float = 0.0


class Unknowns(NamedTuple):
    """Standard deviations of all unknowns and their unit changes; gains, if any, come last."""

    sagging: tuple[int, ...]  # bearings
    deviations: Vector  # (p + n_gains,)
    directions: Vector  # (p, n, 42)
    gains: int

    @property
    def sags(self) -> slice:
        """Slice of the sags among the unknowns."""
        return slice(0, len(self.sagging))

    def change(self, values: Vector) -> Vector:
        """Change of the whole line (n, 42)."""
        p = self.directions.shape[0]
        return np.asarray(np.tensordot(values[:p], self.directions, axes=1))


def usual_sag(line: AlignmentLine) -> float:
    """Sag at which a bearing of the line loses its load; mean over the inner bearings.

    Parameters
    ----------
    line : AlignmentLine

    Returns
    -------
    float
        [m]

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(1e3 * usual_sag(alignment_line(load_scene("propulsion-shaft"))), 2)
    1.36
    """
    state = reactions(line)
    own = np.diag(influence(line, state))
    loads = np.maximum(state.reactions, state.reactions.mean() / 10) / np.maximum(own, 1.0)
    return float(np.mean(loads[1:-1] if loads.size > 2 else loads))


def unknowns_of(scene: ShaftScene, prior: Prior, gains: int = 0) -> Unknowns:
    """Unknowns of a scene's line under a prior, with the gains of so many responses."""
    names = [bearing.name for bearing in scene.bearings]
    n = len(names)
    datum = prior.datum or (names[0], names[-1])
    unknown = [name for name in datum if name not in names]
    if unknown or len(set(datum)) != 2:
        raise SagError(
            f"datum = {', '.join(datum)} must be two bearings of {', '.join(names)}; raising or "
            "tilting the whole line has no effect"
        )
    sagging = tuple(i for i, name in enumerate(names) if name not in datum)
    if not sagging:
        raise SagError("bearings = 2 must be >= 3: a sag has no effect on a shaft on two bearings")
    size = usual_sag(alignment_line(scene)) if prior.sag is None else prior.sag
    rows = [(size, -unit_change(n, i, "bore")) for i in sagging]
    rows += _nuisances(n, prior)
    kept = [(deviation, change) for deviation, change in rows if deviation > 0]
    extra = [prior.gain] * gains if prior.gain > 0 else []
    return Unknowns(
        sagging=sagging,
        deviations=np.array([deviation for deviation, _ in kept] + extra),
        directions=np.array([change for _, change in kept]),
        gains=len(extra),
    )


def _nuisances(n: int, prior: Prior) -> list[tuple[float, Vector]]:
    """Standard deviation and unit change of each nuisance parameter."""
    oil = no_change(n)
    for i in range(n):
        oil = oil + unit_change(n, i, "viscosity")
    rows = [(prior.viscosity, oil)]
    for i in range(n):
        rows.append((prior.clearance, unit_change(n, i, "clearance")))
        for axis in range(2):
            rows.append((prior.housing_stiffness, unit_change(n, i, "pedestal", axis)))
            rows.append((prior.housing_damping, unit_change(n, i, "pedestal_damping", axis)))
        for entry in range(_FILM_ENTRIES):
            rows.append((prior.film, unit_change(n, i, "film_stiffness", entry)))
            rows.append((prior.film, unit_change(n, i, "film_damping", entry)))
    return rows


# --- the estimation problem


class WhiteTest(NamedTuple):
    """A measured test with whitened noise."""

    line: FreeLine
    white: Complex  # (n_lines, n_resp, n_resp), times the errors
    value: Complex  # measured (n_lines, n_resp)
    gains: slice  # among the gains


class Jacks(NamedTuple):
    """Measured reactions, and the line that they belong to."""

    line: AlignmentLine
    condition: Condition
    rows: list[int]
    value: Vector
    deviation: Vector


class Question(NamedTuple):
    """A line, its unknowns and the measurements."""

    model: LineModel
    unknowns: Unknowns
    tests: tuple[WhiteTest, ...]
    jacks: Jacks | None
    names: tuple[str, ...]


def question_of(
    scene: ShaftScene,
    transfers: Sequence[MeasuredTransfer],
    measured: MeasuredReactions | None,
    prior: Prior,
) -> Question:
    """Line, unknowns and data, ready for trials; arguments as in `estimate_sags`."""
    model = line_model(scene)
    tests, first = [], 0
    for test in transfers:
        last = first + len(test.responses)
        tests.append(white_test(model, test, slice(first, last)))
        first = last
    return Question(
        model=model,
        unknowns=unknowns_of(scene, prior, first),
        tests=tuple(tests),
        jacks=None if measured is None else _jacks(scene, measured),
        names=model.names,
    )


def white_test(model: LineModel, test: MeasuredTransfer, gains: slice) -> WhiteTest:
    """Test with the shaft condensed for it, and whitened noise."""
    line = free_line(
        model, test.frequencies, speed=test.speed, forces=[test.force], responses=test.responses
    )
    try:
        factor = np.linalg.cholesky(test.covariance / 2)
    except np.linalg.LinAlgError:
        raise SagError(
            "covariance must be positive definite at every line; average more blocks than there "
            "are responses, or leave the responses uncorrelated"
        ) from None
    white = np.asarray(np.linalg.inv(factor), dtype=np.complex128)
    return WhiteTest(line, white, test.value, gains)


def _jacks(scene: ShaftScene, measured: MeasuredReactions) -> Jacks:
    line = alignment_line(scene)
    conditions = alignment_conditions(scene)
    if measured.condition not in conditions:
        raise SagError(f"condition = '{measured.condition}' must be one of {', '.join(conditions)}")
    unknown = sorted(set(measured.reactions) - set(line.names))
    if unknown:
        raise SagError(
            f"reactions of {', '.join(unknown)} must be of bearings: {', '.join(line.names)}"
        )
    missing = [n for n in measured.reactions if not measured.deviations.get(n, 0.0) > 0]
    if missing:
        raise SagError(f"deviations of {', '.join(missing)} must be given and > 0 N")
    return Jacks(
        line=line,
        condition=conditions[measured.condition],
        rows=[line.seat(name) for name in measured.reactions],
        value=np.array(list(measured.reactions.values())),
        deviation=np.array([measured.deviations[name] for name in measured.reactions]),
    )


# --- a trial


class SagTrial(NamedTuple):
    """A trial: misfit of the measurements and of the prior, over their standard deviations."""

    values: Vector
    films: dict[float, BeamFilm]  # speed -> balance
    model: LineModel
    left: Vector  # (n_data,)
    cost: float


def trial_at(question: Question, values: Vector, start: dict[float, BeamFilm]) -> SagTrial | None:
    """Evaluate a trial; None if the line has no equilibrium."""
    change = question.unknowns.change(values)
    model = question.model.changed(change)
    films = {}
    for test in question.tests:
        speed = test.line.speed
        if speed not in films:
            try:
                films[speed] = rest(model, speed, start=start.get(speed))
            except ShaftFilmError:
                return None
    parts = [
        whitened(test, test.value - _seen(question, test, model, films, change, values))
        for test in question.tests
    ]
    if question.jacks is not None:
        parts.append(_jack_misfit(question, values))
    left = np.concatenate(parts)
    prior = values / question.unknowns.deviations
    return SagTrial(values, films, model, left, float(left @ left + prior @ prior))


def _seen(
    question: Question,
    test: WhiteTest,
    model: LineModel,
    films: dict[float, BeamFilm],
    change: Vector,
    values: Vector,
) -> Complex:
    found = transfer(model, films[test.line.speed], test.line, change)
    return np.asarray(found.value[..., 0] * np.exp(_gains(question, test, values)))


def _gains(question: Question, test: WhiteTest, values: Vector) -> Vector:
    """Logarithms of the gains of a test's responses (n_resp,)."""
    own = question.unknowns
    if own.gains == 0:
        return np.zeros(test.value.shape[1])
    return values[own.directions.shape[0] :][test.gains]


def whitened(test: WhiteTest, errors: Complex) -> Vector:
    """Errors (..., n_lines, n_resp) as real numbers of unit variance (..., 2 n_lines n_resp)."""
    white = np.einsum("lab,...lb->...la", test.white, errors)
    flat = white.reshape(*white.shape[:-2], -1)
    return np.concatenate([flat.real, flat.imag], axis=-1)


def _jack_state(question: Question, values: Vector) -> tuple[AlignmentLine, Vector, Vector]:
    jacks = question.jacks
    assert jacks is not None
    moves = part_of(question.unknowns.change(values), "bore")[:, 0]
    line = jacks.line.moved(moves)
    state = reactions(line, jacks.condition)
    return line, state.reactions, influence(line, state)


def _jack_misfit(question: Question, values: Vector) -> Vector:
    jacks = question.jacks
    assert jacks is not None
    found = _jack_state(question, values)[1]
    return np.asarray((jacks.value - found[jacks.rows]) / jacks.deviation)


def slopes_at(question: Question, point: SagTrial) -> Vector:
    """Derivatives of the scaled predictions with respect to the unknowns (n_data, p)."""
    own = question.unknowns
    p = own.directions.shape[0]
    change = own.change(point.values)
    films = {
        speed: coefficient_slopes(point.model, film, own.directions)
        for speed, film in point.films.items()
    }
    parts = []
    for test in question.tests:
        speed = test.line.speed
        found = transfer(point.model, point.films[speed], test.line, change)
        rows = transfer_slopes(point.model, test.line, found, films[speed], own.directions)
        gain = np.exp(_gains(question, test, point.values))
        part = np.zeros((own.deviations.size, 2 * test.value.size))
        part[:p] = whitened(test, rows[..., 0] * gain)
        if own.gains:
            single = np.einsum("lr,rk->klr", found.value[..., 0] * gain, np.eye(gain.size))
            part[p:][test.gains] = whitened(test, single)
        parts.append(part)
    if question.jacks is not None:
        jacks, rising = question.jacks, part_of(own.directions, "bore")[..., 0]
        part = np.zeros((own.deviations.size, len(jacks.rows)))
        part[:p] = (rising @ _jack_state(question, point.values)[2])[:, jacks.rows]
        parts.append(part / jacks.deviation)
    return np.concatenate(parts, axis=1).T
