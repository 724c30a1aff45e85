"""The least model of a data set: chosen once, stored first, reused, within what it may touch."""

import h5py
import pytest
from click.testing import CliRunner
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation import fidelity_choice as module
from wearstate.datasets.generation import generate as generation
from wearstate.datasets.generation.fidelity_choice import (
    FidelityChoice,
    choose,
    pinned_by,
    with_choice,
)
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe, recorded_scene
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.text import recipe_names
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.fidelity.choose import Resolution
from wearstate.sim.fidelity.ladder import effects_of
from wearstate.sim.output.recording import DataError

SMALL = {
    "duration": "0.05 s",
    "film.n_theta": 24,
    "film.n_z": 5,
}
CHOICE = FidelityChoice(
    values={"film.n_theta": 36, "film.n_z": 9, "numerics.tolerance": 1e-4},
    rungs={"mesh": "x1", "tolerance": "x2"},
    pinned=("film",),
    accuracy=0.02,
    estimated_error=0.0123,
    status="resolved",
    cost=1.0,
    cost_of_reference=8.0,
    cost_as_written=4.0,
    runs=12,
)


@pytest.fixture
def recipe():
    return load_recipe("journal-bearing-small", SMALL)


@pytest.fixture
def counted(monkeypatch):
    """Choosing costs nothing and is counted."""
    calls = []

    def chosen(plan, **options):
        calls.append(options["seed"])
        return CHOICE

    monkeypatch.setattr(generation, "choose", chosen)
    return calls


# -- what it may touch


@pytest.mark.parametrize("name", recipe_names())
def test_what_wears_and_what_confounds_is_pinned(name):
    recipe = load_recipe(name)
    pinned = pinned_by(recipe)
    known = {effect.name for effect in effects_of(recipe.scene)}
    assert bool(pinned) == getattr(recipe.scene, "running", True)  # feet are of no effect
    assert set(pinned) <= known
    assert {"step", "tolerance", "mesh", "elements"} & known <= known - set(pinned)


@pytest.mark.parametrize(
    ("name", "overrides", "expected"),
    [
        ("bilge-pump-small", {}, {"crankpin"}),
        ("bilge-pump-faults", {}, {"crankpin", "wristpin", "pressure"}),
        ("triplex-pump-small", {}, {"crankpin", "pressure"}),
        ("journal-bearing-small", {}, {"film"}),
        ("propulsion-shaft-small", {}, {"film"}),
        ("journal-bearing-small", {"numerics.tolerance": 1e-6}, {"film", "tolerance"}),
        ("bilge-pump-small", {"pinned": ["drive"]}, {"crankpin", "drive"}),
    ],
)
def test_pins_of_a_recipe(name, overrides, expected):
    assert expected <= set(pinned_by(load_recipe(name, overrides)))
    if name != "bilge-pump-faults":  # which has many faults
        assert expected == set(pinned_by(load_recipe(name, overrides)))


def resolution(**rungs):
    return Resolution(
        values={},
        rungs=rungs,
        estimated_error=0.001 * len(rungs["mesh"]),
        cost=1.0,
        cost_of_reference=9.0,
        status="resolved",
        reasons=(),
        accuracy=0.02,
        runs=5,
    )


TRIPLEX = {"wristpin": "ideal", "drive": "motor", "casing": "driven", "mesh": ""}


def test_the_higher_rung_of_the_pilots_is_taken(monkeypatch):
    recipe = load_recipe("journal-bearing-small", {"duration": "0.05 s"})
    found = iter([resolution(mesh="x1", tolerance="x1/2"), resolution(mesh="x1/2", tolerance="x4")])
    scenes = []

    def resolve(scene, quantities, accuracy, pinned, **_ways):
        scenes.append((scene, pinned))
        return next(found)

    monkeypatch.setattr(module, "resolve", resolve)
    choice = choose(recipe, seed=3)
    assert choice.rungs == {"mesh": "x1/2", "tolerance": "x1/2"}
    film = recipe.scene.film
    mesh = choice.values["film.n_theta"], choice.values["film.n_z"] - 1
    assert mesh == (2 * film.n_theta, 2 * (film.n_z - 1))
    # steps of half the length are a sixteenth of the tolerance, as the ladder has it
    written = recipe.scene.numerics.tolerance
    assert choice.values["numerics.tolerance"] == pytest.approx(written / 16)
    assert choice.estimated_error == 0.004  # the greater
    assert choice.runs == 10
    assert [pinned for _, pinned in scenes] == [("film",)] * 2
    gaps = [scene.bearing.diametral_clearance for scene, _ in scenes]
    drawn = [s.scene.bearing.diametral_clearance for s in sample_records(recipe, 16, seed=3)]
    assert gaps == [min(drawn), max(drawn)]


@pytest.mark.parametrize(("level", "counts"), [("x1/2", {8, 10}), ("x4", {2}), ("x1", {})])
def test_a_step_is_the_least_of_what_the_records_ask_for(monkeypatch, level, counts):
    recipe = load_recipe("triplex-pump-small", {"duration": "0.25 s"})
    one = resolution(**TRIPLEX, step=level)
    monkeypatch.setattr(module, "resolve", lambda *_, **__: one)
    choice = choose(recipe, seed=1)
    assert ("numerics.step" in choice.values) == bool(counts)
    if counts:
        # whole parts of a sample; some records have no x4, and give their coarsest
        samples = list(sample_records(recipe, 64, seed=1))
        steps = {module._step_of(sample.scene, level) for sample in samples}
        assert {round(1 / (recipe.scene.sample_rate * step)) for step in steps} == counts
        assert choice.values["numerics.step"] == min(steps)


def test_a_level_that_the_recipes_own_scene_has_not_is_the_coarser_one(monkeypatch):
    recipe = load_recipe("triplex-pump-small", {"duration": "0.25 s"})
    [step] = [each for each in effects_of(recipe.scene) if each.name == "step"]
    assert "x4" not in [rung.name for rung in step.rungs]
    levels = iter(["x4", "x2"])
    monkeypatch.setattr(
        module,
        "resolve",
        lambda *_, **__: resolution(**TRIPLEX, step=next(levels)),
    )
    assert choose(recipe, seed=1).rungs["step"] == "x2"


def test_a_choice_comes_back_from_its_text():
    assert FidelityChoice.load(CHOICE.dump()) == CHOICE
    assert "8 times as cheap as the best rungs, 4 times as cheap as what is written" in CHOICE.text


# -- generate


def test_the_choice_is_in_the_file_and_in_every_record(recipe, counted, tmp_path):
    path = tmp_path / "data.h5"
    summary = generate(recipe, 3, path, seed=4, fidelity="auto")
    assert counted == [4]
    assert summary.fidelity == CHOICE
    with DataSet(path) as data:
        head, rows = data.attributes, data.manifest
    assert FidelityChoice.load(head.fidelity) == CHOICE
    assert rows["estimated_error"].tolist() == [0.0123] * 3
    scene = recorded_scene(head.scene, head.recipe, head.overrides)
    assert (scene.film.n_theta, scene.numerics.tolerance, scene.fidelity) == (36, 1e-4, "given")
    assert scene == with_choice(recipe, CHOICE).scene


def test_a_stopped_run_goes_on_with_its_choice(recipe, counted, tmp_path, monkeypatch):
    def stop(done, total):
        if done == 2:
            raise KeyboardInterrupt

    generate(recipe, 4, tmp_path / "whole.h5", seed=4, fidelity="auto")
    path = tmp_path / "data.h5"
    with pytest.raises(KeyboardInterrupt):
        generate(recipe, 4, path, seed=4, fidelity="auto", progress=stop)
    with h5py.File(path.with_name("data.h5.part")) as file:
        assert FidelityChoice.load(file.attrs["fidelity"]) == CHOICE
    counted.clear()
    monkeypatch.setattr(generation, "choose", None)  # choosing again would fail
    assert generate(recipe, 4, path, seed=4, fidelity="auto").n_resumed == 2
    with h5py.File(path) as file, h5py.File(tmp_path / "whole.h5") as whole:
        for name in ("signal", "manifest"):
            assert file[name][:].tobytes() == whole[name][:].tobytes()


def test_a_run_begun_otherwise_is_not_gone_on_with(recipe, counted, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    for first, second in (("given", "auto"), ("auto", "given")):
        path = tmp_path / f"{first}.h5"
        with pytest.raises(KeyboardInterrupt):
            generate(recipe, 2, path, fidelity=first, progress=stop)
        with pytest.raises(DataError, match=r"must be .* to go on with it"):
            generate(recipe, 2, path, fidelity=second)
    assert len(counted) == 1  # refused before anything is chosen
    other = load_recipe("journal-bearing-small", {**SMALL, "load.static": "900 N"})
    with pytest.raises(DataError, match=r"overrides = .* to go on with it"):
        generate(other, 2, tmp_path / "auto.h5", fidelity="auto")
    generate(recipe, 2, tmp_path / "given.h5", fidelity="auto", force=True)
    assert len(counted) == 2


def test_given_is_the_default_and_changes_nothing(recipe, counted, tmp_path):
    contents = []
    for name, options in (("default", {}), ("given", {"fidelity": "given"})):
        path = tmp_path / f"{name}.h5"
        assert generate(recipe, 2, path, **options).fidelity is None
        with h5py.File(path) as file:
            contents.append((file["signal"][:].tobytes(), file["manifest"][:].tobytes()))
            assert file.attrs["fidelity"] == b""
    assert contents[0] == contents[1]
    assert counted == []


def test_recipe_and_scene_may_ask_for_it(counted, tmp_path):
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\nextends = "journal-bearing-small"\nfidelity = "auto"\n'
    )
    generate(load_recipe(tmp_path / "mine.toml", SMALL), 1, tmp_path / "a.h5")
    asking = load_recipe("journal-bearing-small", {**SMALL, "fidelity": "auto"})
    generate(asking, 1, tmp_path / "b.h5")
    assert len(counted) == 2
    assert generate(asking, 1, tmp_path / "c.h5", fidelity="given").failures == {}
    assert len(counted) == 2


def test_an_older_file_without_the_attribute_is_read(recipe, tmp_path):
    generate(recipe, 1, tmp_path / "data.h5")
    with h5py.File(tmp_path / "data.h5", "r+") as file:
        del file.attrs["fidelity"], file.attrs["attributes_sha256"]
    with DataSet(tmp_path / "data.h5") as data:
        assert data.attributes.fidelity == ""


def test_a_real_choice_keeps_to_what_was_asked(tmp_path):
    values = ["duration=0.05", "film.n_theta=24", "film.n_z=5", "accuracy=0.05"]
    lines = [f'"{k}" = {v}' for k, v in (value.split("=") for value in values)]
    text = 'name = "tiny"\nextends = "journal-bearing-small"\nfidelity = "auto"\n[fixed]\n'
    (tmp_path / "tiny.toml").write_text(text + "\n".join(lines) + "\n")
    done = CliRunner().invoke(
        cli, ["generate", str(tmp_path / "tiny.toml"), "-n", "2", "-o", str(tmp_path / "d.h5")]
    )
    assert done.exit_code == 0, done.output
    assert "fidelity: resolved for 5 %" in done.stdout
    assert done.stderr.count("pilot, record") == 2
    with DataSet(tmp_path / "d.h5") as data:
        found = FidelityChoice.load(data.attributes.fidelity)
        assert set(data.manifest["rung_film"]) == {"map"}  # pinned
    assert 0 < found.estimated_error <= 0.05
    assert found.pinned == ("film", "mesh")  # the recipe fixes the mesh
    assert found.cost <= found.cost_of_reference
