"""Sags of drawn lines, told from their transfer functions and reactions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from wearstate.diagnose.shaft_tests.before_after import scene_plant
from wearstate.diagnose.shaft_tests.next_test import (
    candidate_places,
    force_density,
    rank_tests,
    running_noise,
    transfer_covariance,
    usual_responses,
)
from wearstate.diagnose.shaft_tests.rig_setup import HammerTest, ShakerTest
from wearstate.diagnose.shaft_tests.rig_test import run_test
from wearstate.diagnose.shaft_tests.sag_model import (
    MeasuredReactions,
    MeasuredTransfer,
    Prior,
    SagError,
    question_of,
    slopes_at,
    trial_at,
    unknowns_of,
)
from wearstate.diagnose.shaft_tests.sags import estimate_sags
from wearstate.sim.alignment.alignment import influence, reactions
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.changed import free_line, line_model, part_of, rest, transfer
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line

CONFIDENCE = 0.9


class Lines:
    """Lines drawn about a scene, and tests of them while they run: its vibration is the noise."""

    def __init__(self, name, *, sag, highest, lines=60, **prior):
        straight = {"bearings.2.offset": "0 mm"} if name == "shaft-rig" else None
        self.scene = load_scene(name, straight)
        self.prior = Prior(sag=sag, **prior)
        self.unknowns = unknowns_of(self.scene, self.prior)
        self.model = line_model(self.scene)
        self.hertz = np.linspace(8.0, highest, lines)
        self.responses = usual_responses(self.scene)
        weight = self.model.beam.weight
        self.setup = ShakerTest(force=0.02 * weight, low=8.0, high=highest)

    def draw(self, rng, *, film=1.0):
        """Values of the unknowns: normal sags, tolerances to their edges, films' errors."""
        own = self.unknowns
        values = rng.uniform(-1, 1, own.deviations.size) * math.sqrt(3) * own.deviations
        films = np.array(
            [
                any(part_of(d, f"film_{name}").any() for name in ("stiffness", "damping"))
                for d in own.directions
            ]
        )
        values[films] = film * rng.standard_normal(films.sum()) * own.deviations[films]
        values[own.sags] = rng.standard_normal(len(own.sagging)) * own.deviations[own.sags]
        return values

    def speed(self, rng):
        return math.tau * self.scene.drive.speed * rng.uniform(0.85, 1.15)

    def test(self, rng, values, push, speed, *, model=None):
        change = self.unknowns.change(values)
        model = (model or self.model).changed(change)
        line = free_line(model, self.hertz, speed=speed, forces=[push], responses=self.responses)
        film = rest(model, speed)
        value = transfer(model, film, line, change).value[..., 0]
        running = running_noise(
            self.scene, model, film, self.hertz, self.responses, sample_rate=1024.0
        )
        covariance = transfer_covariance(self.setup, running, value, self.hertz)
        drawn = rng.standard_normal((2, *value.shape)) / math.sqrt(2)
        noise = np.linalg.cholesky(covariance) @ (drawn[0] + 1j * drawn[1])[..., None]
        return MeasuredTransfer(
            frequencies=self.hertz,
            value=value + noise[..., 0],
            covariance=covariance,
            speed=speed,
            force=push,
            responses=self.responses,
        )


def held(lines, push, count, seed, *, film=1.0, model=None):
    """How many of the drawn lines lie in their region, and the error over the deviation."""
    rng = np.random.default_rng(seed)
    hits, scores = 0, []
    for _ in range(count):
        values, speed = lines.draw(rng, film=film), lines.speed(rng)
        test = lines.test(rng, values, push, speed, model=model)
        found = estimate_sags(lines.scene, [test], prior=lines.prior)
        sags = values[lines.unknowns.sags]
        hits += found.holds(sags, CONFIDENCE)
        scores.append((found.mean - sags) / found.deviation)
    return hits, np.array(scores)


@pytest.fixture(scope="module")
def rig():
    return Lines("shaft-rig", sag=0.2e-3, highest=250.0)


def test_regions_hold_what_they_say(rig):
    """Ten lines; 200 are the campaign below. Fewer than six come once in 5,000 tries."""
    hits, scores = held(rig, ("second", "y"), 10, seed=4)
    assert hits >= binom.ppf(2e-4, 10, CONFIDENCE)
    assert np.std(scores) < 1.6  # 20 values of unit deviation: 1.6 is one in 10,000
    assert np.std(scores) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "sag", "highest", "push", "count"),
    [
        ("shaft-rig", 0.2e-3, 250.0, ("second", "y"), 200),
        ("propulsion-shaft", 0.5e-3, 150.0, ("intermediate_aft", "y"), 60),
    ],
)
def test_regions_hold_what_they_say_over_many_lines(name, sag, highest, push, count):
    lines = Lines(name, sag=sag, highest=highest)
    hits, _ = held(lines, push, count, seed=11)
    low, high = (0.85, 0.95) if count == 200 else (0.8, 1.0)
    assert low <= hits / count <= high


def test_reactions_alone_give_the_closed_form_of_a_linear_model(rig):
    """While every bearing carries, reactions are linear in the sags and so is the posterior."""
    line = alignment_line(rig.scene)
    sags = np.array([0.05e-3, 0.1e-3])
    truth = reactions(
        line.moved({"second": -sags[0], "third": -sags[1]}),
        alignment_conditions(rig.scene)["cold"],
    ).reactions
    straight = reactions(line, alignment_conditions(rig.scene)["cold"]).reactions
    slope = -influence(line)[1:3, 1:3]
    errors = np.array([10.0, 20.0])
    weight = slope.T / errors**2
    precision = weight @ slope + np.eye(2) / rig.prior.sag**2
    expected = np.linalg.solve(precision, weight @ (truth - straight)[1:3])
    jacks = MeasuredReactions(
        reactions={"second": truth[1], "third": truth[2]},
        deviations={"second": errors[0], "third": errors[1]},
    )
    found = estimate_sags(rig.scene, measured=jacks, prior=rig.prior)
    np.testing.assert_allclose(found.mean, expected, rtol=1e-6)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(precision), rtol=1e-6)


def test_slopes_of_all_unknowns_are_differences_of_what_the_model_says(rig):
    """Sags apart, whose films' coefficients jump; gains and reactions included."""
    rng = np.random.default_rng(2)
    values = rig.draw(rng)
    prior = replace(rig.prior, gain=0.02)
    test = rig.test(rng, values, ("second", "y"), 60.0)
    jacks = MeasuredReactions(reactions={"third": 100.0}, deviations={"third": 5.0})
    question = question_of(rig.scene, [test], jacks, prior)
    at = np.zeros(question.unknowns.deviations.size)
    trial = trial_at(question, at, {})
    slopes = slopes_at(question, trial)
    for k in (3, 5, 8, 60, question.unknowns.deviations.size - 1):
        step = np.zeros(at.size)
        step[k] = 0.05 * question.unknowns.deviations[k]
        ends = [trial_at(question, at + side * step, trial.films).left for side in (1, -1)]
        expected = (ends[1] - ends[0]) / (2 * step[k])
        # housings move the journals a little, whose coefficients jump
        assert np.abs(slopes[:, k] - expected).max() < 0.03 * np.abs(expected).max()
    assert slopes[-1, : len(question.unknowns.sagging)].any()


def test_a_film_that_is_not_the_machines_is_called_implausible(rig):
    """Without tilt the films have no moments: no sag explains that, and the posterior says so."""
    rng = np.random.default_rng(5)
    short = replace(rig.model, rung="short")
    test = rig.test(rng, rig.draw(rng, film=0.0), ("second", "y"), 60.0, model=short)
    found = estimate_sags(rig.scene, [test], prior=rig.prior, start=[0.0, 0.0])
    assert not found.plausible


def transfer_data(frf, *, speed, force, responses):
    """Estimated accelerances as data: ``E |e|^2 = |H|^2 (1 - c) / (c (n - 1))`` of H1."""
    kept = np.flatnonzero((frf.frequency > 0) & (frf.coherence > 0).all(axis=0))
    kept = kept[np.unique(np.linspace(0, kept.size - 1, min(200, kept.size)).round()).astype(int)]
    value, shared = frf.value[:, kept].T, np.minimum(frf.coherence[:, kept].T, 1.0)
    share = np.maximum((1 - shared) / (shared * (frf.averages - 1)), 1e-6)
    variance = np.abs(value) ** 2 * share
    return MeasuredTransfer(
        frequencies=frf.frequency[kept],
        value=np.ascontiguousarray(value),
        covariance=np.einsum("lr,rs->lrs", variance, np.eye(len(responses))).astype(complex),
        speed=speed,
        force=force,
        responses=tuple(responses),
    )


def test_a_simulated_test_tells_the_sag_and_its_noise_is_as_predicted(rig):
    """From blocks of force and acceleration, as of a measured test."""
    sagged = load_scene("shaft-rig", {"bearings.2.offset": "0 mm", "bearings.2.sag": "0.15 mm"})
    shaker = ShakerTest(force=15.0, bursts=30, quiet=5.0, force_noise=0.01, low=8.0, high=250.0)
    plant = scene_plant(sagged, force=("second", "y"), sample_rate=shaker.sample_rate)
    result = run_test(plant, shaker, seed=3)
    test = transfer_data(
        result.frf, speed=plant.reduced.speed, force=plant.force, responses=plant.responses
    )
    found = estimate_sags(rig.scene, [test], prior=rig.prior)
    assert found.holds(np.array([0.0, 0.15e-3]), 0.99)
    low, _ = found.interval(0.9).T
    assert low[1] > 0.05e-3  # the third sags, with 95 % confidence,
    assert found.mean[0] < 0.05e-3  # the second need not
    model = line_model(sagged)
    noise = running_noise(
        sagged,
        model,
        rest(model, plant.reduced.speed),
        test.frequencies,
        plant.responses,
        sample_rate=shaker.sample_rate,
    )
    power = force_density(shaker, test.frequencies) * shaker.bursts
    expected = np.einsum("lrr->lr", noise).real / power[:, None]
    ratio = np.einsum("lrr->lr", test.covariance).real / expected
    # 800 values of 30 averages each
    assert 0.85 < np.median(ratio) < 1.2


def test_force_of_a_blow_is_that_of_its_samples():
    hammer = HammerTest(scatter=0.0, contact_time=4e-3, block=1.0, peak_force=100.0)
    clock = np.arange(0, 1.0, 1e-5)
    pulse = np.where(clock < 4e-3, 100 * np.sin(math.pi * clock / 4e-3), 0.0)
    spectrum = np.fft.rfft(pulse)[[20, 50, 125, 200]] * 1e-5
    np.testing.assert_allclose(
        force_density(hammer, np.array([20.0, 50.0, 125.0, 200.0])),
        2 * np.abs(spectrum) ** 2,
        rtol=1e-3,
    )


# --- which test next


def test_what_is_promised_of_a_test_is_what_it_leaves(rig):
    """Promised with the mean of all unknowns, left at the mode found."""
    rng = np.random.default_rng(8)
    push = ("third", "y")
    [planned] = rank_tests(rig.scene, prior=rig.prior, places=[push], setup=rig.setup)
    values = np.zeros(rig.unknowns.deviations.size)
    found = estimate_sags(rig.scene, [rig.test(rng, values, push, math.tau * 10)], prior=rig.prior)
    np.testing.assert_allclose(found.deviation, planned.deviations, rtol=0.1)


def test_jacks_promise_what_their_reactions_leave(rig):
    [planned] = rank_tests(rig.scene, prior=rig.prior, places=(), jacks=["third"])
    straight = reactions(alignment_line(rig.scene), alignment_conditions(rig.scene)["cold"])
    load = float(straight.reactions[2])
    jacks = MeasuredReactions(
        reactions={"third": load}, deviations={"third": planned.force}, condition="cold"
    )
    found = estimate_sags(rig.scene, measured=jacks, prior=rig.prior)
    np.testing.assert_allclose(planned.deviations, found.deviation, rtol=1e-6)
    assert planned.force == pytest.approx(0.05 * load)


def test_gains_that_are_not_known_cost(rig):
    places = [("second", "y")]
    [sure] = rank_tests(rig.scene, prior=rig.prior, places=places)
    [unsure] = rank_tests(rig.scene, prior=replace(rig.prior, gain=0.1), places=places)
    # resonances tell what they tell without a level: a little only
    assert sum(unsure.deviations) > 1.01 * sum(sure.deviations)


def test_the_chosen_test_beats_the_usual_one_on_the_ships_line():
    """On drawn lines, against the push at the aftmost bearing: the variance it leaves."""
    ship = Lines("propulsion-shaft", sag=0.5e-3, highest=150.0, lines=40)
    rng = np.random.default_rng(6)
    chosen = rank_tests(ship.scene, prior=ship.prior, setup=ship.setup)[0].push
    left = {"chosen": 0.0, "usual": 0.0}
    for _ in range(2):
        values, speed = ship.draw(rng), ship.speed(rng)
        for name, push in (("chosen", chosen), ("usual", ("stern_aft", "y"))):
            test = ship.test(rng, values, push, speed)
            found = estimate_sags(ship.scene, [test], prior=ship.prior)
            left[name] += float(np.trace(found.covariance))
    assert left["chosen"] < 0.7 * left["usual"]


# --- what is refused


def test_faults_are_told_with_a_cure(rig):
    with pytest.raises(SagError, match="transfers and reactions are missing"):
        estimate_sags(rig.scene)
    with pytest.raises(SagError, match="datum = aft, bow must be two bearings of aft, second"):
        unknowns_of(rig.scene, Prior(datum=("aft", "bow")))
    jacks = MeasuredReactions(reactions={"bow": 1.0}, deviations={"bow": 1.0})
    with pytest.raises(SagError, match="reactions of bow must be of bearings: aft"):
        estimate_sags(rig.scene, measured=jacks)
    jacks = MeasuredReactions(reactions={"aft": 1.0}, deviations={})
    with pytest.raises(SagError, match="deviations of aft must be given"):
        estimate_sags(rig.scene, measured=jacks)
    jacks = MeasuredReactions(reactions={"aft": 1.0}, deviations={"aft": 1.0}, condition="wet")
    with pytest.raises(SagError, match="condition = 'wet' must be one of cold"):
        estimate_sags(rig.scene, measured=jacks)
    with pytest.raises(SagError, match="places and jacks are missing"):
        rank_tests(rig.scene, places=())
    with pytest.raises(SagError, match="value of shape"):
        MeasuredTransfer(
            frequencies=np.ones(2),
            value=np.ones((3, 1), complex),
            covariance=np.ones((2, 1, 1), complex),
            speed=1.0,
            force=("aft", "y"),
            responses=(("aft", "y", "housing"),),
        )


def test_places_to_push_are_those_of_the_scene(rig):
    assert ("third", "z", "housing") in candidate_places(rig.scene)
    assert (0.1, "y") in candidate_places(rig.scene)
