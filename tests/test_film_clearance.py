"""The clearance by the static film equilibrium: on places made by the closed form, and on runs."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import save_solution
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.feature_rows.model_card import (
    ModelCard,
    StrangerRates,
    TrainedCondition,
    TrainedOn,
)
from wearstate.diagnose.film_clearance.clearance import (
    SCARS,
    Doubts,
    Explained,
    FilmEstimate,
    JournalRun,
    PossibleFilm,
    _contradiction,
    _Problem,
    film_clearance,
)
from wearstate.diagnose.healthy_reference.healthy import Baseline
from wearstate.diagnose.healthy_reference.probe_means import probe_means
from wearstate.diagnose.nameplate.cautions import (
    nameplate_cautions,
    recording_context,
    unseen_texts,
)
from wearstate.diagnose.nameplate.nameplate import Nameplate, day_of, nameplate_of
from wearstate.diagnose.nameplate.sensors import corrected_recording, correction_words, known_zeros
from wearstate.diagnose.report import film as film_report
from wearstate.diagnose.report.film import film_estimate, film_table, with_film
from wearstate.diagnose.report.second_estimate import disagree
from wearstate.diagnose.wear_model.verdict import Estimate
from wearstate.sim.bearing.rest_curve import rest_curve
from wearstate.sim.film.solve import FilmGeometry
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel
from wearstate.sim.parts.sensors import Accelerometer
from wearstate.sim.scene.load import load_scene, scene_text

ANGLES = (math.radians(225), math.radians(135))
CURVE = rest_curve(FilmGeometry(length_to_diameter=0.6), "short")
AS_NEW = (0.0914e-3, 0.1905e-3)
CLEARANCE = "diametral_clearance_bearing_m"


def placed(clearance, *, curve=CURVE, load=(6e3, 0.0), force=7e-5, offset=(0.0, 0.0), **changes):
    """A run of a journal at rest, by the short film unless another curve is given."""
    radial = clearance / 2
    place = radial * curve.position(np.array(load) * radial**2 / force)
    towards = [place @ (math.cos(a), math.sin(a)) for a in ANGLES]
    known = {"swing": 1e-6, "load": load, "film_force": force, **changes}
    return JournalRun(readings=np.add(towards, offset), **known)


@pytest.mark.parametrize("clearance", [0.1e-3, 0.2e-3, 0.36e-3])
@pytest.mark.parametrize("load", [(6e3, 0.0), (1e3, 5e3), (980.0, 0.0)])
def test_a_place_gives_its_clearance(clearance, load):
    tight = Doubts(load=1e-4, viscosity=1e-4, offset=1e-8, gain=1e-4)
    found = film_clearance(placed(clearance, load=load), CURVE, ANGLES, AS_NEW, doubts=tight)
    # the prior of the clearance is a decade wide, and pulls by some parts in 1e4
    assert found.severity == pytest.approx(clearance, rel=2e-3)
    assert found.low < clearance < found.high


def test_what_is_less_known_makes_the_interval_wider():
    run = placed(0.2e-3)
    usual = film_clearance(run, CURVE, ANGLES, AS_NEW)
    for name in ("load", "viscosity", "offset", "gain"):
        doubts = Doubts(**{name: 3 * getattr(Doubts(), name)})
        wider = film_clearance(run, CURVE, ANGLES, AS_NEW, doubts=doubts)
        assert wider.high / wider.low > 1.005 * usual.high / usual.low, name
        assert wider.budget[name] > 2 * usual.budget[name], name
    # squares of the parts add up to that of the whole, but for the readings' own scatter
    parts = math.hypot(*usual.budget.values())
    assert parts == pytest.approx((usual.high - usual.low) / 2, rel=0.05)


def test_an_interval_keeps_its_promise_where_the_told_values_are_off_by_their_doubts():
    """Of 200 machines 90 % within four standard errors of a share, and no wider than it must be."""
    rng, doubts, covered = np.random.default_rng(1), Doubts(), []
    for _ in range(200):
        clearance = np.exp(rng.uniform(math.log(0.12e-3), math.log(0.36e-3)))
        load, force = 6e3, 7e-5
        true = placed(
            clearance,
            load=(load * math.exp(doubts.load * rng.standard_normal()), 0.0),
            force=force * math.exp(doubts.viscosity * rng.standard_normal()),
            offset=doubts.offset * rng.standard_normal(2),
        )
        readings = true.readings * np.exp(doubts.gain * rng.standard_normal(2))
        told = JournalRun(readings=readings, swing=1e-6, load=(load, 0.0), film_force=force)
        found = film_clearance(told, CURVE, ANGLES, AS_NEW)
        if not found.reason:
            covered.append(found.low <= clearance <= found.high)
    assert len(covered) > 190
    assert abs(np.mean(covered) - 0.9) < 4 * math.sqrt(0.9 * 0.1 / len(covered))


def test_healthy_recordings_take_an_offset_away():
    off = (-20e-6, -20e-6)
    run = placed(0.25e-3, offset=off)
    healthy = [
        placed(0.1e-3, offset=off, measured=0.1e-3, load=(load, 0.0)) for load in (5e3, 6e3, 7e3)
    ]
    alone = film_clearance(run, CURVE, ANGLES, AS_NEW)
    told = film_clearance(run, CURVE, ANGLES, AS_NEW, healthy=healthy)
    assert alone.severity is None or abs(alone.severity - 0.25e-3) > 20e-6
    assert told.severity == pytest.approx(0.25e-3, rel=0.02)
    assert told.healthy == 3


def test_healthy_recordings_tell_a_scar_from_a_wider_bore():
    """Against a bore worn to a depth and at an angle that none of those tried has."""
    film = FilmGeometry(length_to_diameter=0.6, n_theta=72, n_z=9)
    round_bore = rest_curve(film)
    others = [
        PossibleFilm(
            likely=0.03,
            now=rest_curve(film, scar=depth, turned=turned),
            new=round_bore,
            scar=depth,
        )
        for depth, turned in SCARS
    ]
    off = (-8e-6, 12e-6)
    run = placed(0.2e-3, curve=rest_curve(film, scar=0.28, turned=0.1), offset=off)
    healthy = [
        placed(0.12e-3, curve=round_bore, offset=off, measured=0.12e-3, load=(load, 0.0))
        for load in (4e3, 6e3, 8e3)
    ]
    known = {"healthy": healthy, "others": others}
    plain = film_clearance(run, round_bore, ANGLES, AS_NEW, healthy=healthy)
    told = film_clearance(run, round_bore, ANGLES, AS_NEW, **known)
    # a round bore does not explain it, and nothing is asked for that was given
    assert "no clearance explains the journal" in plain.reason
    assert "--baseline" not in plain.reason
    # the scars that are tried lie so far apart; half the interval is a tenth
    across = 0.2e-3 * (1 + 0.28 / 2)
    assert told.severity == pytest.approx(across, rel=0.06)
    assert told.low < across < told.high
    assert told.budget["film and bore"] > 0
    # a round bore is told as well as before, but for what the others leave open
    fresh = placed(0.2e-3, curve=round_bore, offset=off)
    assert film_clearance(fresh, round_bore, ANGLES, AS_NEW, **known).severity == pytest.approx(
        0.2e-3, rel=0.03
    )


def test_an_unloaded_journal_tells_nothing():
    run = JournalRun(readings=np.zeros(2), swing=1e-6, load=(0.0, 0.0), film_force=7e-5)
    assert "load is 0 N, must be > 0" in film_clearance(run, CURVE, ANGLES, AS_NEW).reason
    light = placed(0.1e-3, load=(50.0, 0.0))
    assert "loaded too lightly" in film_clearance(light, CURVE, ANGLES, AS_NEW).reason


def test_a_whirl_and_a_contradiction_are_said():
    whirling = placed(0.2e-3, swing=50e-6)
    assert "a whirling journal" in film_clearance(whirling, CURVE, ANGLES, AS_NEW).reason
    turned = placed(0.2e-3, load=(0.0, 6e3))
    wrong = JournalRun(
        readings=turned.readings, swing=1e-6, load=(6e3, 0.0), film_force=turned.film_force
    )
    said = film_clearance(wrong, CURVE, ANGLES, AS_NEW).reason
    assert "no clearance explains the journal" in said
    assert "give healthy recordings (--baseline)" in said


def test_readings_that_are_no_numbers_give_no_estimate():
    found = Explained(value=math.log(1e-4), error=0.01, budget={}, left=math.nan)
    problem = _Problem([placed(0.2e-3)], np.array(ANGLES), AS_NEW, Doubts())
    assert "must be <= 2.6" in _contradiction(problem, found, 1e-4)
    # a clearance beyond reason is refused for what it is, not for what is left
    far = found._replace(left=0.5)
    said = _contradiction(problem, far, 20 * math.exp(problem.middle))
    assert "it would be 20 times that as new, must be > 0.1 and < 10; check load" in said
    assert "standard deviations" not in said
    assert _contradiction(problem, far, math.exp(problem.middle)) == ""


# --- from a recording


SHORT = {"film.rung": "short", "duration": 0.2, "bearing.diametral_clearance": 0.22e-3}


def recorded(path, changes, seed=1):
    scene = load_scene("journal-bearing", {**SHORT, **changes})
    save_solution(scene, simulate(scene, seed=seed), path, seed=seed)
    with DataSet(path) as data:
        return data[0]


@pytest.fixture
def film_as_told(monkeypatch):
    """Without what the film may be instead, which a recording by this very film cannot exclude."""
    both = film_report._possible_films
    monkeypatch.setattr(film_report, "_possible_films", lambda scene: (both(scene)[0], []))


@pytest.mark.parametrize(
    "changes",
    [
        {"load.static": 0.0},
        {"load.static": 0.0, "load.static_across": 5e3},
        {"bearing.length": 0.084},
        {"oil.viscosity": 0.06},
    ],
)
@pytest.mark.usefixtures("film_as_told")
def test_every_condition_that_is_told_is_taken_into_account(tmp_path, changes):
    recording = recorded(tmp_path / "run.h5", changes)
    plate = nameplate_of(tmp_path / "run.h5", None, {})
    found = film_estimate(recording, CLEARANCE, plate)
    # the mean of an orbit is not quite the place of rest
    assert found.severity == pytest.approx(0.22e-3, rel=0.02)
    # what a person sets goes before the manifest, and is believed
    usual = nameplate_of(None, "journal-bearing", {"load.static": 5e3, "oil.viscosity": 0.03})
    believed = film_estimate(recording, CLEARANCE, usual)
    assert believed.severity is None or abs(believed.severity / 0.22e-3 - 1) > 0.05


@pytest.mark.usefixtures("film_as_told")
def test_a_declared_offset_is_taken_out_and_healthy_recordings_find_one(tmp_path):
    off = {f"sensors.{i}.offset": -20e-6 for i in range(2)}
    recording = recorded(tmp_path / "run.h5", off)
    told = nameplate_of(tmp_path / "run.h5", None, {})
    assert film_estimate(recording, CLEARANCE, told).severity == pytest.approx(0.22e-3, rel=0.02)
    plate = nameplate_of(None, "journal-bearing", {"film.rung": "short"})
    new = [
        recorded(tmp_path / f"{speed}.h5", {**off, "drive.speed": speed, **NEW})
        for speed in (45.0, 50.0, 55.0)
    ]
    healthy = Baseline(
        features=np.zeros(1), recordings=3, source="", positions=tuple(map(probe_means, new))
    )
    found = film_estimate(recording, CLEARANCE, plate, healthy)
    assert found.severity == pytest.approx(0.22e-3, rel=0.02)
    assert found.healthy == 3


def test_a_film_that_is_not_the_told_one_is_allowed_for(tmp_path, request):
    """A recording by a short film, told to be of a finite one, with three healthy recordings."""
    recording = recorded(tmp_path / "run.h5", {})
    new = [
        recorded(tmp_path / f"{speed}.h5", {"drive.speed": speed, **NEW})
        for speed in (45.0, 50.0, 55.0)
    ]
    healthy = Baseline(
        features=np.zeros(1), recordings=3, source="", positions=tuple(map(probe_means, new))
    )
    plate = nameplate_of(None, "journal-bearing", {})
    found = film_estimate(recording, CLEARANCE, plate, healthy)
    assert found.low < 0.22e-3 < found.high
    assert found.budget["film and bore"] > 0
    request.getfixturevalue("film_as_told")
    told = film_estimate(recording, CLEARANCE, plate, healthy)
    assert told.severity is None or not told.low < 0.22e-3 < told.high


NEW = {"bearing.diametral_clearance": 0.1e-3}


def test_what_bars_an_estimate_is_named(tmp_path):
    recording = recorded(tmp_path / "run.h5", {})
    scarred = nameplate_of(
        None, "journal-bearing", {"bearing.scar_depth": 1e-5, "film.rung": "direct"}
    )
    assert "the bore has a scar" in film_estimate(recording, CLEARANCE, scarred).reason
    starved = nameplate_of(
        None, "journal-bearing", {"bearing.inlet_fill": 0.5, "film.rung": "direct"}
    )
    assert "inlet_fill = 0.5 must be 1" in film_estimate(recording, CLEARANCE, starved).reason
    plate = Nameplate(scene=load_scene("journal-bearing"))
    probe = Channel(name="gap", unit="m", quantity="displacement")
    strange = recording.__class__(
        signal=recording.signal[:1], sample_rate=5120.0, channels=(probe,), row={"speed_hz": 50.0}
    )
    assert "probes gap are not on the nameplate" in film_estimate(strange, CLEARANCE, plate).reason
    assert film_estimate(recording, "scar_depth_bearing_m", plate) is None
    assert "--scene" in film_estimate(recording, CLEARANCE, None).reason


# --- the nameplate


def test_uncertainties_come_with_the_values():
    plate = nameplate_of(
        None,
        "journal-bearing",
        {"load.static": "4 kN ± 12 %", "sensors.1.offset": "3 um +- 2 um"},
    )
    assert (plate.scene.load.static, plate.scene.sensors[1].offset) == (4000.0, 3e-6)
    assert plate.doubts == Doubts(load=0.12, offset=2e-6)
    with pytest.raises(DataError, match="uncertainty '0 um' must be > 0 and < 1 m;"):
        nameplate_of(None, "journal-bearing", {"sensors.1.offset": "3 um +- 0 um"})
    with pytest.raises(DataError, match="takes no uncertainty"):
        nameplate_of(None, "journal-bearing", {"bearing.length": "60 mm +- 1 %"})
    with pytest.raises(DataError, match="in per cent"):
        nameplate_of(None, "journal-bearing", {"load.static": "4 kN +- 1 kN"})


def test_oil_is_as_uncertain_as_its_temperature():
    warm = nameplate_of(None, "propulsion-shaft", {"oil.temperature": "318.15 K +- 3 K"})
    hot = load_scene("propulsion-shaft", {"oil.temperature": 321.15}).oil.dynamic_viscosity
    expected = math.log(warm.scene.oil.dynamic_viscosity / hot)
    assert warm.doubts.viscosity == pytest.approx(expected, rel=1e-9)
    assert 0.1 < expected < 0.2


def test_the_day_goes_before_the_nameplate_and_a_person_before_the_day():
    plate = nameplate_of(None, "journal-bearing", {"load.static": 4e3})
    day = plate.on_the_day({"static_load_n": 6e3, "viscosity_pa_s": 0.05, "thrust_n": 1.0}, 40.0)
    assert (day.load.static, day.oil.viscosity, day.drive.speed) == (4e3, 0.05, 40.0)
    assert plate.on_the_day({"viscosity_pa_s": math.nan}, None).oil.viscosity == 0.03


def test_nothing_known_is_no_nameplate(tmp_path):
    assert nameplate_of(tmp_path / "a.wav", None, {}) is None


def card_of(scene, recipe="", conditions=()):
    """What these cautions read of a card."""
    trained = TrainedOn.model_construct(scene=scene, recipe=recipe)
    return ModelCard.model_construct(
        trained_on=trained,
        conditions=list(conditions),
        severity_range_m=(1e-4, 3.6e-4),
        condemning_limit_m=2.4e-4,
    )


SPEED = {"name": "shaft.speed_hz", "feature": "shaft.speed_hz", "unit": "Hz"}
LOAD = {"name": "static_load_n", "feature": "", "unit": "N"}
VISCOSITY = {"name": "viscosity_pa_s", "feature": "", "unit": "Pa s"}
CARD = card_of(
    "journal-bearing",
    conditions=[
        TrainedCondition(**SPEED, low=1.0, high=2.0),
        TrainedCondition(**LOAD, low=4e3, high=6e3),
        TrainedCondition(**VISCOSITY, low=0.024, high=0.036),
    ],
)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, []),
        ({"load.static_across": 5e3}, ["load.static_across = 5000 N by the nameplate"]),
        ({"bearing.length": 0.084}, ["bearing.length = 0.084 m by the nameplate"]),
    ],
)
def test_a_nameplate_outside_the_trained_one_is_a_caution(changes, said):
    plate = nameplate_of(None, "journal-bearing", changes)
    found = nameplate_cautions(plate, {}, CARD)
    assert len(found) == len(said)
    assert all(text.startswith(begin) for text, begin in zip(found, said, strict=True))


def test_the_day_is_what_a_person_told_then_what_was_noted_then_the_nameplate():
    plate = nameplate_of(None, "journal-bearing", {"oil.viscosity": 0.06})
    noted = {"static_load_n": 100.0, "viscosity_pa_s": 1.0}
    day = day_of(plate, noted)
    assert (day["static_load_n"], day["viscosity_pa_s"]) == (100.0, 0.06)
    assert day_of(plate, {})["static_load_n"] == load_scene("journal-bearing").load.static
    assert day_of(None, noted) == noted
    # without a scene only what a person told is known
    assumed = nameplate_of(None, None, {"oil.viscosity": 0.06}, usual="journal-bearing")
    assert day_of(assumed, {}) == {"viscosity_pa_s": 0.06}


def test_probes_without_healthy_recordings_are_a_caution(tmp_path):
    recording = recorded(tmp_path / "a.h5", {})
    said = " ".join(recording_context(None, recording, CARD)["told"])
    assert "offsets of probe_1, probe_2" in said
    zeros = {f"sensors.{i}.offset": "0 um +- 5 um" for i in range(2)}
    told = nameplate_of(None, "journal-bearing", zeros)
    assert recording_context(told, recording, CARD)["told"] == ()
    one = nameplate_of(None, "journal-bearing", {"sensors.0.offset": "0 um"})
    [said] = recording_context(one, recording, CARD)["told"]
    assert "offsets of probe_2, which" in said
    path, zero = _cure_in(said)  # of that probe
    assert nameplate_of(None, "journal-bearing", {path: zero}).set_paths == {"sensors.1.offset"}
    line = nameplate_of(None, "propulsion-shaft", {"probes.probe_1.offset": "0 um"})
    [said] = recording_context(line, recording, card_of("propulsion-shaft"))["told"]
    assert _cure_in(said)[0] == "probes.1.offset"
    [said] = recording_context(None, recording, card_of("propulsion-shaft"))["told"][-1:]
    assert _cure_in(said)[0] == "probes.0.offset"


def _cure_in(said):
    """Path and value that a caution proposes to set."""
    return said.partition("--set '")[2].rstrip("'").split("=")


def test_the_height_of_a_bearing_is_no_offset_of_a_probe():
    plate = nameplate_of(None, "propulsion-shaft", {"bearings.0.offset": "0.1 mm"})
    assert known_zeros(plate) == frozenset()


def test_offset_and_sensitivity_that_a_person_told_are_taken_out(tmp_path):
    """So that a model sees the readings that it learnt with; healthy recordings have both."""
    off = {"sensors.0.offset": -20e-6, "sensors.1.gain": 1.25}
    plain, seen = (recorded(tmp_path / f"{i}.h5", each) for i, each in enumerate(({}, off)))
    told = nameplate_of(None, "journal-bearing", off)
    np.testing.assert_allclose(corrected_recording(seen, told).signal, plain.signal, atol=2e-7)
    assert np.abs(seen.signal - plain.signal)[:2].max(axis=1).min() > 2e-6
    assert corrected_recording(seen, nameplate_of(None, "journal-bearing", {})) is seen
    assert corrected_recording(seen, None) is seen
    healthy = Baseline(features=np.zeros(1), recordings=1, source="")
    assert corrected_recording(seen, told, healthy) is seen
    # sensors are as well known by their names
    named = {"sensors.probe_1.offset": "-20 um", "sensors.probe_2.gain": 1.25}
    by_name = nameplate_of(None, "journal-bearing", named)
    np.testing.assert_allclose(corrected_recording(seen, by_name).signal, plain.signal, atol=2e-7)
    assert known_zeros(by_name) == {"probe_1"}


def test_a_triaxial_sensor_has_one_sensitivity_on_all_its_channels(tmp_path):
    scene = load_scene("bilge-pump")
    head = Accelerometer(name="head", axes=("x", "y"), gain=2.0, range=100.0)
    plate = Nameplate(
        scene=scene.model_copy(update={"sensors": (head,)}), set_paths=frozenset({"sensors.0.gain"})
    )
    recording = recorded(tmp_path / "a.h5", {})
    channels = tuple(
        Channel(name=name, unit="m/s^2", quantity="acceleration")
        for name in ("head_x", "head_y", "head")
    )
    seen = replace(recording, signal=np.ones((3, 8), np.float32), channels=channels, tacho=None)
    assert corrected_recording(seen, plate).signal[:, 0].tolist() == [0.5, 0.5, 1.0]


def test_sensors_of_a_scene_that_a_person_gave_are_taken_out_and_said(tmp_path):
    off = {"sensors.0.offset": -20e-6, "sensors.1.gain": 1.25}
    plain, seen = (recorded(tmp_path / f"{i}.h5", each) for i, each in enumerate(({}, off)))
    text = scene_text("journal-bearing").replace(
        'name = "probe_1"', 'name = "probe_1"\noffset = "-20 um"'
    )
    (tmp_path / "mine.toml").write_text(text)
    mine = nameplate_of(None, str(tmp_path / "mine.toml"), {"sensors.1.gain": 1.25})
    np.testing.assert_allclose(corrected_recording(seen, mine).signal, plain.signal, atol=2e-7)
    assert correction_words(seen, mine) == "offset -20 um of probe_1, gain 1.25 of probe_2"
    # a data set's own scene has those that its records were simulated with
    assert corrected_recording(seen, nameplate_of(tmp_path / "1.h5", None, {})) is seen
    assert correction_words(seen, nameplate_of(None, "journal-bearing", {})) == ""


def test_a_nameplate_of_another_machine_is_a_caution():
    plate = nameplate_of(None, "bilge-pump", {})
    assert "is for a reciprocating-pump" in nameplate_cautions(plate, {}, CARD)[0]
    assert nameplate_cautions(None, {}, card_of("of another program")) == ()


PUMP_CARD = card_of("bilge-pump", "bilge-pump-standard")


def test_sizes_that_nobody_gave_are_a_caution():
    """No signal shows a rod of another length; a mass that training drew needs no caution."""
    [said] = nameplate_cautions(None, {}, PUMP_CARD)
    assert "crank.radius" in said
    assert "rod.length" in said
    assert "piston.mass" not in said
    usual = nameplate_of(None, "bilge-pump", {})
    assert nameplate_cautions(usual, {}, PUMP_CARD) == ()
    # told some numbers without a scene: what was not told is taken for granted still
    some = nameplate_of(None, None, {"rod.length": "250 mm"}, usual="bilge-pump")
    [said] = nameplate_cautions(some, {}, PUMP_CARD)
    assert "rod.length" not in said
    assert "crank.radius" in said


def test_sizes_that_an_option_of_the_recipe_sets_are_trained_too():
    """Propellers of three, four and five blades: only another number is a caution."""
    card = card_of("propulsion-shaft", "propulsion-shaft-standard")
    said = {
        blades: nameplate_cautions(
            nameplate_of(None, "propulsion-shaft", {"propeller.blades": blades}), {}, card
        )
        for blades in (3, 4, 5, 6)
    }
    assert [blades for blades, found in said.items() if found] == [6]
    assert said[6][0].startswith("propeller.blades = 6 ")
    assert "trained at 3 to 5" in said[6][0]
    assert nameplate_cautions(None, {}, card) == ()


def test_sizes_that_training_drew_are_held_against_their_range():
    axes = load_recipe("bilge-pump-standard").machine
    low, high = next(axis.extremes() for axis in axes if axis.path == "piston.mass")
    for mass, cautioned in ((low, False), (high, False), (1.1 * high, True), (0.9 * low, True)):
        plate = nameplate_of(None, "bilge-pump", {"piston.mass": mass})
        said = nameplate_cautions(plate, {}, PUMP_CARD)
        assert len(said) == cautioned
        assert all(f"trained at {low:.4g} to {high:.4g} kg" in each for each in said)


def test_what_misleads_without_a_warning_is_said_unless_the_recipe_draws_it():
    def said(scene, recipe, severity):
        card = card_of(scene, recipe).model_copy(update={"severity": severity})
        return unseen_texts(card)

    crankpin = "diametral_clearance_crankpin_m"
    eye, play = said("bilge-pump", "bilge-pump-narrow", crankpin)
    assert "along the rod" in eye
    assert "main bearings" in play
    assert said("bilge-pump", "bilge-pump-standard", crankpin) == [play]  # it draws oval eyes
    loose = StrangerRates(
        name="bilge-pump-loose", records=500, detection_rate=1.0, false_alarm_rate=0.0
    )
    shown = card_of("bilge-pump", "bilge-pump-narrow")
    shown = shown.model_copy(update={"severity": crankpin, "strangers": [loose]})
    assert unseen_texts(shown) == [eye]  # it refuses play in the main bearings
    assert said("bilge-pump", "of one's own", crankpin) == []  # nobody knows what it draws
    assert said("bilge-pump", "bilge-pump-standard", "stretch_lost_feet_m") == []
    [starved] = said("journal-bearing", "journal-bearing-standard", "diametral_clearance_m")
    assert "check the feed" in starved
    line = ("propulsion-shaft", "propulsion-shaft-{}", "wear_down_aft_m")
    [film] = said(line[0], line[1].format("standard"), line[2])
    assert "warmer" in film
    assert said(line[0], line[1].format("warm"), line[2]) == []  # it draws them


# --- beside the trained model


def test_a_disagreement_is_said_first():
    trained = Estimate(
        verdict="graded", grade=0, severity=1.5e-4, low=1.4e-4, high=1.6e-4, cautions=("other",)
    )
    far = FilmEstimate(severity=2.5e-4, low=2.3e-4, high=2.7e-4)
    near = FilmEstimate(severity=1.7e-4, low=1.55e-4, high=1.9e-4)
    untold = FilmEstimate(reason="no load")
    assert disagree(trained, far)
    assert not disagree(trained, near)
    assert not disagree(trained, untold)
    said = with_film(trained, far)
    assert said.verdict == "caution"
    assert said.cautions[0].startswith("film equilibrium and trained model disagree: 0.250 mm")
    assert said.cautions[1:] == ("other",)
    assert with_film(trained, near) is trained
    table = film_table(untold, Nameplate(scene=load_scene("journal-bearing")), {})
    assert json.loads(json.dumps(table))["text"] == "no estimate: no load"


def test_what_no_clearance_explains_is_a_caution_too():
    trained = Estimate(verdict="graded", grade=0, severity=1.5e-4, low=1.4e-4, high=1.6e-4)
    run = replace(placed(0.2e-3, load=(0.0, 6e3)), load=(6e3, 0.0))
    said = with_film(trained, film_clearance(run, CURVE, ANGLES, AS_NEW))
    assert said.verdict == "caution"
    assert said.cautions[0].startswith("film equilibrium: no clearance explains")
    refused = Estimate(verdict="unfamiliar", severity=1.5e-4)
    assert with_film(refused, film_clearance(run, CURVE, ANGLES, AS_NEW)) is refused
    # one that runs too light to tell contradicts nothing
    light = film_clearance(placed(0.1e-3, load=(50.0, 0.0)), CURVE, ANGLES, AS_NEW)
    assert light.severity is None
    assert with_film(trained, light) is trained


def test_conditions_in_the_labels_of_an_import_are_those_of_the_day(tmp_path):
    recording = recorded(tmp_path / "run.h5", {"load.static": 1e3, "oil.viscosity": 0.06})
    time = np.arange(recording.signal.shape[1]) / recording.sample_rate
    head = "time [s],probe_1 [m],probe_2 [m],tacho [V]"
    rows = np.c_[time, recording.signal.T]
    np.savetxt(tmp_path / "run.csv", rows, "%.9g", ",", header=head, comments="")
    labels = tmp_path / "labels.csv"
    labels.write_text("file,static_load_n,viscosity_pa_s\nrun.csv,1000,0.06\n", encoding="utf-8")
    given = ["import", tmp_path / "run.csv", "--labels", labels, "--tacho", "tacho"]
    done = CliRunner().invoke(cli, [*map(str, given), "-o", str(tmp_path / "in.h5")])
    assert done.exit_code == 0, done.output
    plate = nameplate_of(None, "journal-bearing", {"film.rung": "short"})
    with DataSet(tmp_path / "in.h5") as data:
        found = film_estimate(data[0], CLEARANCE, plate)
    assert found.severity == pytest.approx(0.22e-3, rel=0.03)
