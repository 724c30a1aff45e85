"""The next test of a shaft line: place, direction and size of the force, or the bearing to jack.

The value of a test is the reduction of the variance of the sags. The remaining covariance follows
from the derivatives with respect to every unknown at the most probable line and from the noise of
the scene's own vibration and sensors; no measurement is needed.

References
----------
Atkinson, Donev, Tobias (2007), Optimum Experimental Designs, with SAS, Oxford University Press,
chapters 9 and 10.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...sim.alignment.alignment import reactions
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.changed import (
    FreeLine,
    LineModel,
    coefficient_slopes,
    free_line,
    part_of,
    rest,
    transfer,
    transfer_slopes,
)
from ...sim.shaft.forces import random_forces
from ...sim.shaft.line_alignment import alignment_conditions, alignment_line
from ...sim.shaft.line_beam import shaft_beam
from ...sim.shaft_films.on_oil_films import BeamFilm
from ...sim.shaft_response.places import Place
from .rig_setup import HammerTest, ShakerTest
from .sag_model import (
    MeasuredReactions,
    Prior,
    SagError,
    question_of,
    slopes_at,
    trial_at,
    unknowns_of,
)
from .sags import SagPosterior

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOST_MOTION = 0.1
"""Rms motion of a journal in its bore under a test force, over the smallest film thickness [-]:
films stay linear within a few per cent, and peaks of a random force at a third of the film."""

JACKING_ERROR = 0.05
"""Usual error of a reaction from jacking, over the reaction [-]: friction of jack and shaft; from
memory of class guidance, which states 5 to 10 per cent."""

_LINES = 60  # of a planned test: far fewer distinguish the places
_SHAKER_SHARE = 0.02  # rms of a usual shaker, over the shaft's weight
_FLOOR = 1e-3  # smallest relative error of a measured transfer function


@dataclass(frozen=True, kw_only=True)
class PlannedTest:
    """A possible test, and the uncertainty that it would leave.

    Attributes
    ----------
    push : place or None
        Place of the force; None for a jack.
    jack : str
        Bearing to be jacked, or empty.
    force : float
        Rms of a shaker, peak of a hammer [N]; error of a jack's reaction [N].
    deviations : tuple of float
        Standard deviation of each sag after the test [m], in the order of the posterior.
    gain : float
        Relative reduction of the sum of the sags' variances by the test [-].
    """

    push: Place | None
    jack: str
    force: float
    deviations: tuple[float, ...]
    gain: float

    @property
    def text(self) -> str:
        """The test in words."""
        if self.push is None:
            return f"jack {self.jack}"
        assert isinstance(self.push, tuple)
        where, axis, *part = self.push
        place = f"the shaft at {where:g} m" if isinstance(where, float) else f"the shaft at {where}"
        if part == ["housing"]:
            place = f"the housing of {where}"
        return f"push {place} {'up' if axis == 'y' else 'sideways'}"


def candidate_places(scene: ShaftScene) -> tuple[Place, ...]:
    """Places where a line can be pushed: shaft and housing at every bearing, shaft at its discs.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of place
        Each vertical and horizontal.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> len(candidate_places(load_scene("shaft-rig")))
    20
    """
    places: list[Place] = [
        (bearing.name, axis, *part)
        for bearing in scene.bearings
        for part in ((), ("housing",))
        for axis in "yz"
    ]
    return (*places, *((disc.station, axis) for disc in scene.discs for axis in "yz"))


def usual_responses(scene: ShaftScene) -> tuple[Place, ...]:
    """Housings on which the scene has accelerometers, in their directions.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> usual_responses(load_scene("shaft-rig"))[0]
    ('aft', 'y', 'housing')
    """
    return tuple(
        (sensor.bearing, "y" if sensor.direction == "up" else "z", "housing")
        for sensor in scene.sensors
    )


# --- noise of a test


def force_density(setup: HammerTest | ShakerTest, frequencies: Vector) -> Vector:
    """Mean power spectral density of a test force over its blocks.

    Parameters
    ----------
    setup : HammerTest or ShakerTest
    frequencies : numpy.ndarray [shape=(n,)]
        Frequencies inside the band [Hz].

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        One-sided [N^2/Hz]. A burst of rms F has ``F^2 share / (1.05 high - 0.8 low)``, with the
        band that :mod:`.shaft_tests.rig_test` gives it; a half-sine of peak P
        and length T has ``2 |2 P T / pi cos(pi f T) / (1 - (2 f T)^2)|^2 / block``.

    Examples
    --------
    >>> shaker = ShakerTest(force=100.0, low=10.0, high=110.0, share=0.5)
    >>> force_density(shaker, np.array([50.0])).round(2).tolist()
    [46.51]
    """
    hertz = np.asarray(frequencies, dtype=float)
    if isinstance(setup, ShakerTest):
        even = setup.force**2 * setup.share / (1.05 * setup.high - 0.8 * setup.low)
        return np.full(hertz.size, even)
    turns = hertz * setup.contact_time
    gap = 1 - (2 * turns) ** 2
    shape = np.where(np.abs(gap) < 1e-6, math.pi / 4, np.cos(math.pi * turns) / (gap + 1e-300))
    pulse = 2 * setup.peak_force * setup.contact_time / math.pi * shape
    scatter = math.exp(2 * setup.scatter**2)  # mean square of log-normal peaks
    return np.asarray(2 * pulse**2 * scatter / setup.block)


def running_noise(
    scene: ShaftScene,
    model: LineModel,
    film: BeamFilm,
    frequencies: Vector,
    responses: Sequence[Place],
    *,
    sample_rate: float,
) -> Complex:
    """Cross-spectral densities of accelerometers without test force, shaft orders removed.

    Parameters
    ----------
    scene : ShaftScene
        Supplies turbulence and sensors.
    model : LineModel
    film : BeamFilm
        Equilibrium of the line.
    frequencies : numpy.ndarray [shape=(n_lines,)]
        [Hz]
    responses : sequence of place
    sample_rate : float
        The sensors' noise is spread over half of it [Hz].

    Returns
    -------
    numpy.ndarray [shape=(n_lines, n_resp, n_resp)]
        One-sided, Hermitian [(m/s^2)^2/Hz].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> from wearstate.sim.shaft.changed import line_model
    >>> rig = load_scene("shaft-rig")
    >>> model = line_model(rig)
    >>> running_noise(rig, model, rest(model, 62.8), np.array([40.0]), usual_responses(rig),
    ...               sample_rate=1024.0).shape
    (1, 4, 4)
    """
    count = len(responses)
    sensors = max((sensor.noise for sensor in scene.sensors), default=0.0)
    found = np.zeros((frequencies.size, count, count), dtype=np.complex128)
    found += np.eye(count) * sensors**2 / (sample_rate / 2)
    sources = random_forces(scene.model_copy(update={"sample_rate": sample_rate}))
    if not sources:
        return found
    places = [place for source in sources for place in source.forces]
    line = free_line(model, frequencies, speed=film.speed, forces=places, responses=responses)
    through = transfer(model, film, line).value
    density = np.array(
        [
            np.interp(frequencies, np.asarray(source.frequencies), np.asarray(source.density))
            for source in sources
        ]
    )
    found += np.einsum("lrs,sl,lqs->lrq", through, density, through.conj())
    return found


def transfer_covariance(
    setup: HammerTest | ShakerTest, noise: Complex, value: Complex, frequencies: Vector
) -> Complex:
    """Covariance of the H1 estimate of a test.

    Parameters
    ----------
    setup : HammerTest or ShakerTest
    noise : numpy.ndarray [shape=(n_lines, n_resp, n_resp)]
        From :func:`running_noise`.
    value : numpy.ndarray [shape=(n_lines, n_resp)]
        Accelerance [(m/s^2)/N]; its relative error is at least a thousandth.
    frequencies : numpy.ndarray [shape=(n_lines,)]
        [Hz]

    Returns
    -------
    numpy.ndarray [shape=(n_lines, n_resp, n_resp)]

    Examples
    --------
    >>> shaker = ShakerTest(force=100.0, low=10.0, high=110.0, share=0.5, bursts=10)
    >>> noise, value = np.full((1, 1, 1), 5.0 + 0j), np.zeros((1, 1), complex)
    >>> transfer_covariance(shaker, noise, value, np.array([50.0])).real.round(6).tolist()
    [[[0.01075]]]
    """
    blocks = setup.blows if isinstance(setup, HammerTest) else setup.bursts
    power = force_density(setup, frequencies) * blocks
    floor = np.einsum("lr,rs->lrs", (_FLOOR * np.abs(value)) ** 2, np.eye(value.shape[1]))
    return np.asarray(noise / power[:, None, None] + floor)


# --- size of the force


def fitting_force(
    model: LineModel, film: BeamFilm, line: FreeLine, setup: HammerTest | ShakerTest
) -> HammerTest | ShakerTest:
    """Reduce the force of a test until the films stay linear.

    Parameters
    ----------
    model : LineModel
    film : BeamFilm
    line : FreeLine
        Condensed line with the one force of the test.
    setup : HammerTest or ShakerTest
        Test with the largest available force.

    Returns
    -------
    HammerTest or ShakerTest
        A shaker moves no journal by more than :data:`MOST_MOTION` of its smallest film thickness,
        rms; a hammer, whose blow is short, by no more than three times that at its peak.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> from wearstate.sim.shaft.changed import line_model
    >>> model = line_model(load_scene("shaft-rig"))
    >>> film, hertz = rest(model, 62.8), np.linspace(6, 390, 60)
    >>> line = free_line(model, hertz, speed=62.8, forces=[("second", "y")], responses=[])
    >>> fitting_force(model, film, line, ShakerTest(force=1e6)).force < 1e6
    True
    """
    motion = np.linalg.norm(np.abs(_bore_motion(model, film, line)), axis=-1)
    if isinstance(setup, ShakerTest):
        most = float(np.max(np.sqrt(np.mean(motion**2, axis=0)) * setup.force / film.least_film))
        return replace(setup, force=setup.force * min(1.0, MOST_MOTION / most))
    # a short blow: x(0+) is at most the integral of its two-sided spectrum over the band
    impulse = 2 * setup.peak_force * setup.contact_time / math.pi
    width = 2 * (setup.high - setup.low)
    most = float(np.max(np.mean(motion, axis=0) * impulse * width / film.least_film))
    return replace(setup, peak_force=setup.peak_force * min(1.0, 3 * MOST_MOTION / most))


def _bore_motion(model: LineModel, film: BeamFilm, line: FreeLine) -> Complex:
    """Motion of journals relative to housings, per unit force (n_lines, n, 2)."""
    found = transfer(model, film, line).right[..., 0]
    n, m = len(model.bearings), line.stiffness.shape[1]
    journals = found[:, : 4 * n].reshape(-1, n, 4)[..., :2]
    return np.asarray(journals - found[:, m:].reshape(-1, n, 2))


# --- ranking


def rank_tests(
    scene: ShaftScene,
    known: SagPosterior | None = None,
    *,
    prior: Prior | None = None,
    setup: HammerTest | ShakerTest | None = None,
    places: Sequence[Place] | None = None,
    responses: Sequence[Place] | None = None,
    jacks: Sequence[str] = (),
    condition: str = "cold",
) -> tuple[PlannedTest, ...]:
    """Rank tests of a line, the most informative first.

    Parameters
    ----------
    scene : ShaftScene
        The line as aligned.
    known : SagPosterior, optional
        Result of earlier tests; by default there are none.
    prior : Prior, optional
        Prior used for `known`.
    setup : HammerTest or ShakerTest, optional
        Test with the largest available force; by default a shaker with a fiftieth of the shaft's
        weight.
    places : sequence of place, optional
        Places to push; by default :func:`candidate_places`.
    responses : sequence of place, optional
        By default the scene's accelerometers.
    jacks : sequence of str
        Bearings that can be jacked.
    condition : str
        Condition in which they would be jacked.

    Returns
    -------
    tuple of PlannedTest

    Raises
    ------
    SagError
        There are no places to push and no bearings to jack, or the prior has other unknowns than
        `known`.
    ShaftFilmError
        The line does not rest on its films.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> rig = load_scene("shaft-rig")
    >>> best, *_, worst = rank_tests(rig, places=[("aft", "z"), ("third", "y")])
    >>> best.text, best.gain > worst.gain
    ('push the shaft at third up', True)
    """
    own = prior or Prior()
    pushed = candidate_places(scene) if places is None else tuple(places)
    seen = usual_responses(scene) if responses is None else tuple(responses)
    if not (pushed and seen) and not jacks:
        raise SagError("places and jacks are missing; name a place to push, or a bearing to jack")
    now, values = _state_of_knowledge(scene, known, own)
    ranked = []
    if pushed and seen:
        turning = math.tau * scene.drive.speed
        test = setup or ShakerTest(force=_usual_force(scene))
        ranked += _pushes(scene, own, now, values, test, turning, pushed, seen)
    ranked += [_jacked(scene, own, now, values, name, condition) for name in jacks]
    return tuple(sorted(ranked, key=lambda one: -one.gain))


def _usual_force(scene: ShaftScene) -> float:
    return _SHAKER_SHARE * shaft_beam(scene).weight


def _state_of_knowledge(
    scene: ShaftScene, known: SagPosterior | None, prior: Prior
) -> tuple[Vector, Vector]:
    """Precision of all unknowns except gains, and their most probable values."""
    deviations = unknowns_of(scene, prior).deviations
    if known is None:
        return np.diag(deviations**-2.0), np.zeros(deviations.size)
    count = deviations.size
    if known.values.size < count:
        raise SagError(
            f"prior has {count} unknowns, known has {known.values.size}; it must be the prior with "
            "which known was estimated"
        )
    precision = np.asarray(np.linalg.inv(known.spread[:count, :count]), dtype=float)
    return precision, known.values[:count]


def _pushes(
    scene: ShaftScene,
    prior: Prior,
    now: Vector,
    values: Vector,
    setup: HammerTest | ShakerTest,
    speed: float,
    places: Sequence[Place],
    responses: Sequence[Place],
) -> list[PlannedTest]:
    hertz = np.linspace(setup.low, setup.high, _LINES)
    question = question_of(scene, (), None, prior)
    directions, change = question.unknowns.directions, question.unknowns.change(values)
    model = question.model.changed(change)
    film = rest(model, speed)
    noise = running_noise(scene, model, film, hertz, responses, sample_rate=setup.sample_rate)
    line = free_line(model, hertz, speed=speed, forces=places, responses=responses)
    found = transfer(model, film, line, change)
    slopes = transfer_slopes(
        model, line, found, coefficient_slopes(model, film, directions), directions
    )
    planned = []
    for k, place in enumerate(places):
        test = fitting_force(model, film, line.pushed(k), setup)
        value = found.value[..., k]
        factor = np.linalg.cholesky(transfer_covariance(test, noise, value, hertz) / 2)
        white = np.asarray(np.linalg.inv(factor), dtype=np.complex128)
        added = _information(white, slopes[..., k], value, prior.gain)
        force = test.peak_force if isinstance(test, HammerTest) else test.force
        planned.append(_planned(now, added, question.unknowns.sags, push=place, force=force))
    return planned


def _information(white: Complex, slopes: Complex, value: Complex, gain: float) -> Vector:
    """Precision that a test adds, with its gains marginalised (p, p)."""
    rows = _real(np.einsum("lab,plb->pla", white, slopes))
    added: Vector = rows @ rows.T
    if gain > 0:
        single = np.einsum("lr,rk->klr", value, np.eye(value.shape[1]))
        own = _real(np.einsum("lab,plb->pla", white, single))
        across = rows @ own.T
        added = added - across @ np.linalg.solve(own @ own.T + np.eye(len(own)) / gain**2, across.T)
    return added


def _real(values: Complex) -> Vector:
    flat = values.reshape(len(values), -1)
    return np.concatenate([flat.real, flat.imag], axis=1)


def _planned(
    now: Vector,
    added: Vector,
    sags: slice,
    *,
    force: float,
    push: Place | None = None,
    jack: str = "",
) -> PlannedTest:
    before, after = (np.diag(np.linalg.inv(precision))[sags] for precision in (now, now + added))
    return PlannedTest(
        push=push,
        jack=jack,
        force=force,
        deviations=tuple(np.sqrt(after).tolist()),
        gain=1 - float(after.sum() / before.sum()),
    )


def _jacked(
    scene: ShaftScene, prior: Prior, now: Vector, values: Vector, name: str, condition: str
) -> PlannedTest:
    load = _reaction(scene, values, prior, name, condition)
    question = question_of(
        scene,
        (),
        MeasuredReactions(reactions={name: 0.0}, deviations={name: load}, condition=condition),
        prior,
    )
    trial = trial_at(question, values, {})
    assert trial is not None  # no film is involved
    rows = slopes_at(question, trial)
    return _planned(now, rows.T @ rows, question.unknowns.sags, jack=name, force=load)


def _reaction(scene: ShaftScene, values: Vector, prior: Prior, name: str, condition: str) -> float:
    """Error of a reaction from jacking [N], at least that of a tenth of the mean load."""
    question = question_of(scene, (), None, prior)
    moves = part_of(question.unknowns.change(values), "bore")[:, 0]
    line = alignment_line(scene).moved(moves)
    conditions = alignment_conditions(scene)
    if condition not in conditions:
        raise SagError(f"condition = '{condition}' must be one of {', '.join(conditions)}")
    state = reactions(line, conditions[condition])
    load = float(state.reactions[line.seat(name)])
    return JACKING_ERROR * max(load, float(state.reactions.mean()) / 10)
