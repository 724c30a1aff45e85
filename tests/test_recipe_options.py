"""Discrete draws of a recipe: which option, with which values, for which machines."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.text import RecipeError

RECIPE = """
name = "mine"
scene = "bilge-pump"
records = 40
records_per_group = 2
[fixed]
duration = "0.25 s"
[[severity]]
path = "joint.crankpin.diametral_clearance"
low = "as new"
high = "150 % of limit"
[[choice]]
name = "law"
[[choice.option]]
name = "dry"
weight = 3.0
[[choice.option.draw]]
path = "joint.crankpin.damping"
distribution = "log-factor"
low = 0.5
high = 2.0
[[choice.option]]
name = "lossy"
[choice.option.values]
"joint.crankpin.law" = "exact"
"joint.crankpin.damping" = 0.0
"joint.crankpin.restitution" = 0.3
[[choice.option.draw]]
path = "joint.crankpin.restitution"
distribution = "uniform"
low = 0.2
high = 0.5
[[choice]]
name = "state"
per = "record"
[[choice.option]]
name = "idle"
values = { "pressure.discharge" = "0.1 MPa" }
[[choice.option]]
name = "loaded"
"""


@pytest.fixture
def recipe(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(RECIPE)
    return file


def test_options_come_as_often_as_they_weigh_and_set_what_they_say(recipe):
    samples = list(sample_records(load_recipe(recipe), 2000, seed=1))
    lossy = np.array([sample.row["choice_law"] == "lossy" for sample in samples])
    idle = np.array([sample.row["choice_state"] == "idle" for sample in samples])
    # 1,000 machines of a quarter: deviation .0137; 2,000 records of a half: .0112; five of each
    assert abs(lossy[::2].mean() - 0.25) < 0.07
    assert abs(idle.mean() - 0.5) < 0.056
    assert np.array_equal(lossy[::2], lossy[1::2])  # drawn per machine
    assert not np.array_equal(idle[::2], idle[1::2])  # drawn per record
    assert abs(np.corrcoef(lossy, idle)[0, 1]) < 0.15
    for sample in samples:
        pin = sample.scene.joint.crankpin
        if sample.row["choice_law"] == "lossy":
            assert (pin.law, pin.damping) == ("exact", 0.0)
            assert 0.2 <= pin.restitution <= 0.5
        else:
            assert pin.law == "kelvin-voigt"
            assert 15e3 <= pin.damping <= 60e3
        assert (sample.scene.pressure.discharge == 0.1e6) == (sample.row["choice_state"] == "idle")


def test_an_option_added_moves_no_other_draw(recipe, tmp_path):
    plain = tmp_path / "plain.toml"
    plain.write_text(RECIPE[: RECIPE.index('[[choice]]\nname = "state"')])
    for one, other in zip(
        sample_records(load_recipe(recipe), 30, seed=2),
        sample_records(load_recipe(plain), 30, seed=2),
        strict=True,
    ):
        assert {**one.drawn, "pressure.discharge": 0} == {**other.drawn, "pressure.discharge": 0}


def test_machines_of_another_recipe_keep_their_options():
    worn = list(sample_records(load_recipe("bilge-pump-standard"), 12, seed=4))
    new = list(sample_records(load_recipe("bilge-pump-healthy"), 18, seed=4))
    for machine in range(6):
        one, other = worn[2 * machine], new[3 * machine]
        columns = [name for name in one.row if name.startswith("choice_")]
        assert len(columns) == 8
        assert {name: one.row[name] for name in columns} == {n: other.row[n] for n in columns}
        assert one.scene.casing == other.scene.casing
        assert one.scene.joint.wristpin == other.scene.joint.wristpin


def test_the_manifest_names_the_option(recipe, tmp_path):
    generate(recipe, 4, tmp_path / "d.h5", seed=3)
    with DataSet(tmp_path / "d.h5") as data:
        laws = data.manifest["choice_law"].tolist()
        assert set(laws) <= {"dry", "lossy"}
        kinds = {"dry": "kelvin-voigt", "lossy": "exact"}
        assert data.manifest["contact_law"].tolist() == [kinds[law] for law in laws]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "dry"', 'name = "lossy"', "options of law = lossy, lossy must differ"),
        ('name = "state"', 'name = "law"', "choice name 'law' is given 2 times"),
        (
            '= "exact"',
            '= "exakt"',
            r"choice\.0\.option\.1 \(lossy\): joint\.crankpin\.law = 'exakt'",
        ),
        (
            "high = 0.5",
            "high = 1.5",
            r"choice\.0\.option\.1\.draw\.0.*restitution = 1\.5 .*must be <= 1",
        ),
        ("weight = 3.0", "weight = 0.0", "weight = 0 must be > 0"),
        (
            '"pressure.discharge" = "0.1 MPa"',
            '"joint.crankpin.damping" = 1.0',
            "joint.crankpin.damping is drawn 2 times, must be once",
        ),
    ],
)
def test_faults_name_the_option(tmp_path, old, new, message):
    file = tmp_path / "mine.toml"
    assert old in RECIPE
    file.write_text(RECIPE.replace(old, new, 1))
    with pytest.raises(RecipeError, match=message):
        load_recipe(file)


def test_standard_draws_what_a_pump_leaves_open():
    samples = list(sample_records(load_recipe("bilge-pump-standard"), 400, seed=1))
    seen = {
        name: {sample.row[f"choice_{name}"] for sample in samples}
        for name in ("contact_law", "elasticity", "pressure", "wristpin", "guide", "drive")
    }
    assert {name: len(options) for name, options in seen.items()} == {
        "contact_law": 4,
        "elasticity": 2,
        "pressure": 2,
        "wristpin": 2,
        "guide": 2,
        "drive": 2,
    }
    late = [
        np.degrees(sample.scene.pressure.rise_delay)
        for sample in samples
        if sample.row["choice_pressure"] == "two-level"
    ]
    # 150 machines over 12 degrees: an end free by more than .6 with probability 5e-4
    assert_allclose([min(late), max(late)], [0, 12], atol=0.6)
