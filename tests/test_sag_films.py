"""Sags where films rupture otherwise than the scene says, and about bearings that carry nothing."""

import numpy as np
import pytest
from wearstate.diagnose.shaft_tests.sag_films import estimate_over_films, mixed, nearly_unloaded
from wearstate.diagnose.shaft_tests.sag_model import MeasuredReactions, MeasuredTransfer, Prior
from wearstate.diagnose.shaft_tests.sag_report import SagReport
from wearstate.diagnose.shaft_tests.sags import SagPosterior, estimate_sags
from wearstate.sim.alignment.alignment import reactions
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.changed import free_line, line_model, rest, transfer
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line

PRIOR = Prior(sag=0.2e-3)
SAGS = np.array([0.05e-3, 0.12e-3])
SPEED = 62.8  # rad/s


@pytest.fixture(scope="module")
def scene():
    return load_scene("shaft-rig", {"bearings.2.offset": "0 mm"})


def made(scene, condition):
    """A test of a line on films of a condition, without noise; 0.2 per cent is said."""
    film = scene.film.model_copy(update={"condition": condition})
    values = {"second": SAGS[0], "third": SAGS[1]}
    bearings = tuple(
        one.model_copy(update={"offset": one.offset - values.get(one.name, 0.0)})
        for one in scene.bearings
    )
    model = line_model(scene.model_copy(update={"film": film, "bearings": bearings}))
    hertz = np.linspace(8.0, 250.0, 40)
    places = tuple((bearing.name, "y", "housing") for bearing in scene.bearings)
    push = ("second", "y")
    line = free_line(model, hertz, speed=SPEED, forces=[push], responses=places)
    value = transfer(model, rest(model, SPEED), line).value[..., 0]
    deviation = 2e-3 * np.abs(value) + 2e-4 * np.abs(value).mean()
    covariance = np.einsum("lr,rs->lrs", deviation**2, np.eye(len(places))).astype(complex)
    return MeasuredTransfer(
        frequencies=hertz,
        value=value,
        covariance=covariance,
        speed=SPEED,
        force=push,
        responses=places,
    )


@pytest.mark.parametrize("condition", ["guembel", "periodic"])
def test_the_condition_of_the_films_is_found_and_the_sag_with_it(scene, condition):
    found = estimate_over_films(scene, [made(scene, condition)], prior=PRIOR)
    assert found.films[condition] > 0.9
    assert sum(found.films.values()) == pytest.approx(1.0)
    assert found.holds(SAGS)


def posterior(mean, cost, *, deviation=1e-5):
    one = np.full(1, deviation**2)
    return SagPosterior(
        bearings=("third",),
        datum=("aft", "forward"),
        mean=np.array([mean]),
        covariance=np.diag(one),
        prior_deviation=2e-4,
        misfit=cost / 100,
        freedom=100,
        values=np.array([mean]),
        spread=np.diag(one),
        steps=1,
        settled=True,
        scale=np.array([2e-4]),
    )


def test_a_mixture_has_the_mean_and_the_variance_of_its_parts():
    """Costs 2 ln 3 apart: three to one; variance within and between."""
    found = mixed({"a": posterior(0.0, 100.0), "b": posterior(4e-5, 100.0 + 2 * np.log(3))})
    assert found.films == pytest.approx({"a": 0.75, "b": 0.25})
    assert found.mean[0] == pytest.approx(1e-5)
    assert found.covariance[0, 0] == pytest.approx(1e-10 + 0.75 * 1e-10 + 0.25 * 9e-10)
    # at equal cost the condition that leaves more room is the likelier
    narrow = mixed({"a": posterior(0.0, 100.0), "b": posterior(0.0, 100.0, deviation=0.5e-5)})
    assert narrow.films["b"] == pytest.approx(1 / 3)


def test_undecided_films_are_said():
    found = mixed({"periodic": posterior(0.0, 100.0), "guembel": posterior(4e-5, 102.0)})
    [text] = SagReport(posterior=found, tests=(), reactions=None, planned=()).doubts
    assert "films may rupture either way (periodic 73%, guembel 27%)" in text
    sure = mixed({"periodic": posterior(0.0, 100.0), "guembel": posterior(4e-5, 130.0)})
    assert SagReport(posterior=sure, tests=(), reactions=None, planned=()).doubts == []


def test_a_bearing_near_to_carrying_nothing_is_named(scene):
    """The third loses its load at 0.39 mm."""
    straight = reactions(alignment_line(scene), alignment_conditions(scene)["cold"]).reactions
    for sag, named in ((0.0, ()), (0.45e-3, ("third",))):
        line = alignment_line(scene).moved({"third": -sag})
        load = reactions(line, alignment_conditions(scene)["cold"]).reactions
        error = 0.02 * float(straight[2])
        jacks = MeasuredReactions(
            reactions={"second": load[1], "third": load[2]},
            deviations={"second": error, "third": error},
        )
        found = estimate_sags(scene, measured=jacks, prior=PRIOR)
        assert nearly_unloaded(scene, found) == named
