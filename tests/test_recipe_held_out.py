"""Held-out regions of a recipe: what lies in them, and what is refused."""

import math

import numpy as np
import pytest
from wearstate.datasets.draws.held_out import DIMENSIONS
from wearstate.datasets.recipe.load import load_recipe, recorded_recipe
from wearstate.datasets.recipe.records import overrides_text, sample_records
from wearstate.datasets.recipe.text import RecipeError
from wearstate.sim.parts.units import UNITS
from wearstate.sim.scene.load import all_condition_places, all_wear_places

SPEED = (42.5, 57.5)  # Hz, drawn by the recipe below


def written(tmp_path, text, base="journal-bearing-small"):
    file = tmp_path / "mine.toml"
    file.write_text(
        f'name = "mine"\nextends = "{base}"\n'
        'without = ["fast", "heavy_load", "thin_oil", "beyond_limit"]\n' + text
    )
    return file


def region(name, **bounds):
    lines = [f"bounds.{column} = {{ {ends} }}\n" for column, ends in bounds.items()]
    return f'[[held_out]]\nname = "{name}"\n{"".join(lines)}'


def load(tmp_path, text):
    return load_recipe(written(tmp_path, text))


def faults_of(tmp_path, text):
    with pytest.raises(RecipeError) as caught:
        load(tmp_path, text)
    return caught.value.faults


def test_bounds_are_read_in_their_units(tmp_path):
    recipe = load(
        tmp_path,
        region("fast", speed_hz='low = "3300 rpm"')
        + region("slow", speed_hz='high = "90 %"')
        + region("thick", viscosity_pa_s='low = "32 mPa s", high = 0.035')
        + region("far", static_load_n='low = "5.5 kN"', speed_hz="low = 50"),
    )
    found = {each.name: each.bounds for each in recipe.held_out}
    assert found == {
        "fast": {"speed_hz": (55.0, math.inf)},
        "slow": {"speed_hz": (-math.inf, 45.0)},
        "thick": {"viscosity_pa_s": (0.032, 0.035)},
        "far": {"static_load_n": (5500.0, math.inf), "speed_hz": (50.0, math.inf)},
    }


def test_records_lie_in_a_region_as_often_as_it_is_wide(tmp_path):
    recipe = load(
        tmp_path,
        region("fast", speed_hz='low = "3300 rpm"')
        + region("both", speed_hz='low = "3300 rpm"', static_load_n='low = "5.5 kN"')
        + region("worn", diametral_clearance_bearing_m='low = "0.2 mm"'),
    )
    rows = [sample.row for sample in sample_records(recipe, 480)]
    shares = {
        each.name: np.mean(
            [all(low <= row[c] <= high for c, (low, high) in each.bounds.items()) for row in rows]
        )
        for each in recipe.held_out
    }
    worn = math.log(0.36195 / 0.2) / math.log(0.36195 / 0.0914)
    # 30 whole blocks of sixteen: a severity or speed misses by its broken sixteenth at most, and
    # within it by half a block; both together by 4 deviations of free draws, 0.017
    assert shares["fast"] == pytest.approx(1 / 6, abs=8 / 480)
    assert shares["worn"] == pytest.approx(worn, abs=8 / 480)
    assert shares["both"] == pytest.approx(1 / 24, abs=4 * 0.0092)


def test_a_condition_that_follows_from_a_draw_has_its_range(tmp_path):
    """Viscosity from the drawn oil temperature, by Walther's law."""
    base = "propulsion-shaft-small"
    text = f'name = "m"\nextends = "{base}"\nwithout = ["fast", "heavy_load", "ballast"]\n'
    file = tmp_path / "m.toml"
    file.write_text(text + region("thin", viscosity_pa_s='high = "75 mPa s"'))
    found = [each for each in load_recipe(file).held_out if each.name == "thin"]
    assert found[0].bounds == {"viscosity_pa_s": (-math.inf, 0.075)}
    file.write_text(text + region("thin", viscosity_pa_s='high = "60 mPa s"'))
    with pytest.raises(RecipeError, match=r"holds no record, drawn is 0\.068\d* to 0\.114"):
        load_recipe(file)


def test_a_gap_between_bands_holds_no_record(tmp_path):
    file = tmp_path / "m.toml"
    text = 'name = "m"\nextends = "bilge-pump-shifted"\n'
    for bounds, good in (
        ('low = "0.25 MPa", high = "0.35 MPa"', False),
        ('low = "0.24 MPa", high = "0.36 MPa"', False),  # the edges alone
        ('low = "0.23 MPa", high = "0.35 MPa"', True),
    ):
        file.write_text(text + region("middle", discharge_pressure_pa=bounds))
        if good:
            assert load_recipe(file).held_out[0].name == "middle"
        else:
            with pytest.raises(RecipeError, match="180000 to 240000 or 360000 to 420000"):
                load_recipe(file)


def test_where_a_confounder_acts_counts_as_well(tmp_path):
    """Suction is -0.03 MPa, or -0.09 to -0.08 MPa where the pump cavitates."""
    file = tmp_path / "m.toml"
    text = 'name = "m"\nextends = "bilge-pump-faults"\n'
    file.write_text(text + region("cavitating", suction_pressure_pa='high = "-70 kPa"'))
    assert load_recipe(file).held_out[-1].name == "cavitating"
    file.write_text(text + region("deep", suction_pressure_pa='high = "-95 kPa"'))
    with pytest.raises(RecipeError, match="holds no record, drawn is -30000 or -90000 to -80000"):
        load_recipe(file)
    file.write_text(text + region("all", suction_pressure_pa='high = "-10 kPa"'))
    with pytest.raises(RecipeError, match="every record lies in it"):
        load_recipe(file)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            region("fast", speed_hz="low = 60"),
            "held_out 'fast': speed_hz from 60 to inf holds no record, drawn is 42.5 to 57.5; move",
        ),
        (region("edge", speed_hz="low = 57.5"), "holds no record"),
        (
            region("all", speed_hz="low = 40"),
            "held_out 'all': every record lies in it, speed_hz is 42.5 to 57.5; narrow",
        ),
        (region("all", speed_hz="low = 40", static_load_n="high = 6000"), "every record lies in"),
        (region("no", speed_hz="low = 50, high = 45"), "speed_hz: low = 50 must be < high = 45"),
        (region("no", sped_hz="low = 50"), "sped_hz is no column of it, must be one of diametral"),
        (region("no", speed_hz='low = "5 mm"'), "speed_hz: a bound has unit 'mm', not one of rot"),
        (region("no", speed_hz=""), "no bound is given, must be low, high or both"),
        (region("No", speed_hz="low = 50"), "held_out.0.name = 'No' must"),
        ('[[held_out]]\nname = "no"\nbounds = {}\n', "held_out.0.bounds = {} must have >= 1"),
        (
            region("fast", speed_hz="low = 50") + region("fast", speed_hz="low = 55"),
            "held_out name 'fast' is given 2 times, must be unique",
        ),
    ],
)
def test_regions_at_fault(tmp_path, text, fault):
    [found] = faults_of(tmp_path, text)
    assert fault in found


def test_a_region_of_two_columns_is_sound_where_one_of_them_holds_all(tmp_path):
    text = region("fast", speed_hz="low = 50", static_load_n="low = 0")
    assert load(tmp_path, text).held_out[0].name == "fast"


def test_all_faults_are_told_at_once(tmp_path):
    text = (
        region("fast", speed_hz="low = 60")
        + region("all", speed_hz="low = 40")
        + '[[correlation]]\npaths = ["drive.speed", "load.stitic"]\nrank = 0.5\n'
    )
    assert len(faults_of(tmp_path, text)) == 3


def test_a_region_is_taken_over_replaced_or_left_out(tmp_path):
    base = tmp_path / "base.toml"
    written(tmp_path, region("fast", speed_hz="low = 55") + region("slow", speed_hz="high = 45"))
    (tmp_path / "mine.toml").rename(base)
    own = tmp_path / "own.toml"
    text = 'name = "own"\nextends = "base.toml"\n'
    own.write_text(text)
    assert [each.name for each in load_recipe(own).held_out] == ["fast", "slow"]
    own.write_text(text + 'without = ["slow"]\n' + region("fast", speed_hz="low = 56"))
    [found] = load_recipe(own).held_out
    assert found.bounds == {"speed_hz": (56.0, math.inf)}


def test_regions_move_no_draw(tmp_path):
    plain, regions = load(tmp_path, ""), load(tmp_path, region("fast", speed_hz="low = 55"))
    assert next(sample_records(plain)).drawn == next(sample_records(regions)).drawn


def test_regions_come_back_from_the_texts_of_a_file(tmp_path):
    recipe = load_recipe(
        written(tmp_path, region("fast", speed_hz='low = "110 %"')), {"drive.speed": "40 Hz"}
    )
    texts = (recipe.scene_text, recipe.text, overrides_text(recipe))
    again = recorded_recipe(*texts)
    assert again.held_out == recipe.held_out
    assert again.held_out[0].bounds["speed_hz"][0] == pytest.approx(44.0)
    for one, other in zip(sample_records(again, 3), sample_records(recipe, 3), strict=True):
        assert (one.drawn, one.row, one.seed) == (other.drawn, other.row, other.seed)


def test_texts_of_no_recipe_are_refused():
    with pytest.raises(RecipeError, match="records is missing"):
        recorded_recipe("", 'name = "m"\nscene = "s"\nseverity = []', "")


def test_every_column_has_a_dimension():
    worn = [each.column for each in all_wear_places().values()]
    for column in (*worn, *all_condition_places()):
        ending = next(ending for ending in DIMENSIONS if column.endswith(ending))
        assert DIMENSIONS[ending] in UNITS
