"""The recipes that come with the package: what each must hold, so that figures mean something."""

from functools import cache
from operator import attrgetter

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm, rankdata
from wearstate.datasets.draws.draws import value_at
from wearstate.datasets.recipe import records
from wearstate.datasets.recipe.load import load_recipe, recorded_recipe
from wearstate.datasets.recipe.records import overrides_text, sample_records
from wearstate.datasets.recipe.text import RecipeError, recipe_names
from wearstate.features.rotation.order import pulse_times
from wearstate.sim.machine.simulate import simulate, simulate_many
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import channels_of

MACHINES = ("bilge-pump", "journal-bearing", "propulsion-shaft")
TESTS = ("shaft-rig", "propulsion-shaft-test", "bilge-pump-casing")
N = 2000

BRIEF = {
    "reciprocating-pump": {"duration": "0.3 s", "settling_revolutions": 1},
    "journal-bearing": {"duration": "0.05 s"},
    "propulsion-shaft": {"duration": "1 s"},
}
"""Machine -> overrides for a recording that takes some 50 ms."""


@cache
def shipped(name):
    """A recipe as it comes; each is asked for by several tests."""
    return load_recipe(name)


def drawn(recipe, n=N, seed=0):
    """Every number by path and table entry, without building a scene of each."""
    sources = records._sources(recipe, seed)
    size = recipe.table.records_per_group
    columns = {}
    for i in range(n):
        for level, source in sources.items():
            for path, value in source.values(i // size if level == "machine" else i).items():
                entries = value.items() if isinstance(value, dict) else [("", value)]
                for key, number in entries:
                    columns.setdefault(f"{path}.{key}".rstrip("."), []).append(number)
    return {path: np.array(numbers) for path, numbers in columns.items()}


@cache
def shipped_numbers(name):
    """What `drawn` tells of a recipe as it comes."""
    return drawn(shipped(name))


MAINS = {"drive.motor.synchronous_speed": "306 rpm"}
"""A motor that drive.speed does not govern, two per cent above it."""


@pytest.mark.parametrize("motor", [{}, MAINS], ids=["rated slip", "mains"])
def test_a_motor_turns_as_fast_as_its_label_says(motor):
    """By the tacho, over whole revolutions: what the load of each leaves of its slip."""
    brief = {"duration": "1.5 s", "settling_revolutions": 2, **motor}
    recipe = load_recipe("bilge-pump-standard", brief)
    driven = [s for s in sample_records(recipe, 60) if s.scene.drive.rung == "motor"][:8]
    jobs = [(sample.scene, sample.seed) for sample in driven]
    told = np.array([sample.row["speed_hz"] for sample in driven])
    pulses = {
        number: pulse_times(found.tacho_signal, found.sample_rate)
        for number, found in simulate_many(jobs)
    }
    turned = np.array([1 / np.diff(pulses[number]).mean() for number in range(len(jobs))])
    assert np.ptp(told) > 0.5
    assert_allclose(turned, told, rtol=0.015 if motor else 0.01)


def test_a_motor_far_from_its_label_is_refused_with_the_cure():
    far = {"drive.motor.synchronous_speed": "360 rpm"}
    with pytest.raises(RecipeError, match=r"drive\.speed = 5 must be >= 5\.7 and <= .* = 6 where"):
        load_recipe("bilge-pump-standard", far)
    assert load_recipe("bilge-pump-standard", {**far, "drive.speed": "355 rpm"})


@pytest.fixture(scope="module", params=MACHINES)
def standard(request):
    name = f"{request.param}-standard"
    return shipped(name), shipped_numbers(name)


@pytest.mark.parametrize("machine", [*MACHINES, *TESTS])
@pytest.mark.parametrize("kind", ["small", "standard", "shifted", "healthy"])
def test_every_machine_has_its_recipes(machine, kind):
    recipe = shipped(f"{machine}-{kind}")
    assert machine.startswith(recipe.scene.name)
    forces = [channel.name for channel in channels_of(recipe.scene) if channel.quantity == "force"]
    assert bool(forces) == (machine in TESTS)


@pytest.mark.parametrize("name", recipe_names())
def test_the_first_records_of_every_recipe_simulate(name):
    plain = shipped(name)
    brief = BRIEF[plain.scene.machine]
    recipe = load_recipe(name, brief)
    for sample in sample_records(recipe, 2, seed=1):
        solution = simulate(sample.scene, seed=sample.seed)
        assert solution.status.ok
        # a part of a revolution on a small flywheel: its ripple is up to some 2 %
        assert_allclose(solution.numerics["mean_speed_hz"], sample.row["speed_hz"], rtol=0.02)
        assert np.ptp(solution.signal[0]) > 0


@pytest.mark.parametrize(
    "name", [*(f"{m}-standard" for m in (*MACHINES, *TESTS)), "bilge-pump-faults"]
)
def test_sets_that_figures_are_quoted_on_have_a_thousand_machines(name):
    table = shipped(name).table
    assert table.records / table.records_per_group >= 1000
    assert table.sampling == "sobol"


def factors(recipe, values, path):
    """Drawn values over the scene's own."""
    return values[path] / float(value_at(recipe.scene, path))


NUISANCE = {
    "bilge-pump-standard": {
        "casing.modes.7.frequency": (0.94, 1.06),
        "joint.crankpin.friction": (0.2, 2.4),  # of 0.05: 0.01 to 0.12
        "joint.crankpin.damping": (0.4, 2.5),
        "joint.crankpin.stiffness": (0.5, 2.0),
        "casing.modes.0.damping_ratio": (0.5, 2.0),
        "sensors.1.gain": (0.93, 1.07),
        "drive.speed": (0.85, 1.15),
        "pressure.discharge": (0.8, 1.2),
    },
    "bilge-pump-narrow": {
        "casing.modes.7.frequency": (0.97, 1.03),
        "casing.modes.0.damping_ratio": (0.6, 1.4),
        "joint.crankpin.stiffness": (0.7, 1.4),
        "joint.crankpin.damping": (0.5, 2.0),
        "joint.crankpin.friction": (0.4, 1.6),  # of 0.05: 0.02 to 0.08
        "sensors.1.gain": (0.95, 1.05),
        "drive.speed": (0.85, 1.15),
        "pressure.discharge": (0.8, 1.2),
    },
    "journal-bearing-standard": {
        "oil.viscosity": (0.4, 2.5),
        "rotor.unbalance": (0.5, 2.0),
        "rotor.run_out.0.amplitude": (0.3, 5.0),
        "rotor.run_out.2.amplitude": (0.3, 2.0),
        "sensors.0.noise": (0.5, 2.0),
        "sensors.1.gain": (0.95, 1.05),
        "drive.speed": (0.85, 1.15),
        "load.static": (0.4, 1.6),
    },
    "propulsion-shaft-standard": {
        "discs.4.unbalance": (0.5, 2.0),
        "bearings.4.housing.damping_side": (0.6, 1.4),
        "run_out.0.amplitude": (0.3, 5.0),
        "probes.0.noise": (0.5, 2.0),
        "sensors.4.gain": (0.95, 1.05),
        "drive.speed": (0.85, 1.15),
        "propeller.thrust": (0.0, 1.3),
        "oil.temperature": (298.15 / 313.15, 333.15 / 313.15),
    },
    "journal-bearing-narrow": {
        "oil.viscosity": (0.8, 1.2),
        "rotor.unbalance": (0.5, 2.0),
        "rotor.run_out.2.amplitude": (0.3, 2.0),
        "sensors.0.noise": (0.5, 2.0),
        "sensors.1.gain": (0.95, 1.05),
        "drive.speed": (0.85, 1.15),
        "load.static": (0.8, 1.2),
    },
    "propulsion-shaft-narrow": {
        "discs.4.unbalance": (0.5, 2.0),
        "bearings.4.housing.damping_side": (0.6, 1.4),
        "run_out.0.amplitude": (0.3, 2.0),
        "probes.0.noise": (0.5, 2.0),
        "sensors.4.gain": (0.95, 1.05),
        "drive.speed": (0.85, 1.15),
        "propeller.thrust": (0.8, 1.2),
        "oil.temperature": (308.15 / 313.15, 318.15 / 313.15),
    },
}
"""What a recipe varies about its scene, as the design asks for each machine."""


@pytest.mark.parametrize("name", NUISANCE)
def test_nuisance_fills_the_ranges_of_the_design(name):
    recipe = shipped(name)
    of_options = drawn_by_options(recipe)
    values = {**shipped_numbers(name), **of_options}
    for path, (low, high) in NUISANCE[name].items():
        found = factors(recipe, values, path)
        assert low * (1 - 1e-12) <= found.min()
        assert found.max() <= high * (1 + 1e-12)
        # one of each sixteenth in every block: of 1000 at least 62 in the outermost one, whose
        # last 2 % of all are missed by free ones with probability 0.68^62 = 4e-11; an option
        # is drawn freely by a third of 1000 machines: 2.3 % of them in the last 5 %, 4e-4
        edge = (0.05 if path in of_options else 0.02) * (high - low)
        assert found.min() < low + edge
        assert found.max() > high - edge


def drawn_by_options(recipe, seed=0):
    """What the options draw that a thousand machines take."""
    columns = {}
    for i in range(N // 2):
        for _, values in records._choices(recipe, i, 2 * i, seed, {}).values():
            for path, value in values.items():
                if value:  # 0 where another law has no such number
                    columns.setdefault(path, []).append(value)
    return {path: np.array(values) for path, values in columns.items()}


def test_grades_hold_their_share_of_the_severity_range(standard):
    recipe, values = standard
    for wearing in recipe.severities:
        (low, high), edges = wearing.axis.bands[0], wearing.edges
        assert low < edges[0] < edges[2] < high
        level = np.log(values[wearing.axis.path] / low) / np.log(high / low)
        ends = np.concatenate([[0], np.log(np.array(edges) / low) / np.log(high / low), [1]])
        counts = np.histogram(level, ends)[0]
        # each end of a (0, 1)-sequence in base 2 is off by log2(n) / 3 + 1 records at most, 4.7
        assert np.abs(counts - N * np.diff(ends)).max() < 2 * (np.log2(N) / 3 + 1)
        assert counts.min() > N / 20


def test_nothing_drawn_knows_another(standard):
    _, values = standard
    # one record of each machine: rank correlations of deviation 1/sqrt(n - 1); a share of 1e-3
    # over all pairs (Bonferroni), both signs. Entries of one mode shape share one vector of fixed
    # norm, uncorrelated all the same.
    ranks = np.array([rankdata(numbers[::2]) for numbers in values.values()])
    n_draws, n = ranks.shape
    n_pairs = n_draws * (n_draws - 1) // 2
    bound = norm.isf(1e-3 / 2 / n_pairs) / np.sqrt(n - 1)
    correlation = np.corrcoef(ranks) - np.eye(n_draws)
    assert n_draws > 15
    assert np.abs(correlation).max() < bound


def test_records_in_a_row_know_no_label(standard):
    """Neither first nor second record of a machine is the more worn."""
    recipe, values = standard
    (low, high) = recipe.severity.bands[0]
    level = np.log(values[recipe.severity.path] / low) / np.log(high / low)
    # deviation of the difference of two means of 1000: 0.013; less, as both are even
    assert abs(level[::2].mean() - level[1::2].mean()) < 4 * 0.013
    within = np.corrcoef(level[::2], level[1::2])[0, 1]
    assert abs(within + 1 / (records.STRATA - 1)) < 4 / np.sqrt(1000)


def test_no_condition_tells_the_severity(standard):
    """Nor in a bent way, that ranks would not see: nearest records in it are no more alike."""
    recipe, values = standard
    (low, high) = recipe.severity.bands[0]
    level = np.log(values[recipe.severity.path] / low) / np.log(high / low)
    for n in (120, 480, N):
        for path, numbers in values.items():
            if path != recipe.severity.path:
                order = level[:n][np.argsort(numbers[:n], kind="stable")]
                steps = np.diff(order)
                # von Neumann's ratio of free draws: 2 with a deviation of 2 / sqrt(n); as even
                # pairs repel each other it may be above, never far below. Pairs of records of one
                # machine follow each other in its own draws: a sixteenth more apart.
                ratio = np.mean(steps**2) / np.var(order)
                assert ratio > 2 - 4.5 * 2 / np.sqrt(n)


HELD_OUT = {
    "bilge-pump": {"fast", "heavy_load", "beyond_limit"},
    "journal-bearing": {"fast", "heavy_load", "thin_oil", "beyond_limit"},
    "propulsion-shaft": {"fast", "heavy_load", "ballast", "beyond_limit"},
}


def test_regions_to_test_on_hold_a_tenth_to_a_third(standard):
    recipe, _ = standard
    assert {region.name for region in recipe.held_out} == HELD_OUT[recipe.scene.name]
    rows = [sample.row for sample in sample_records(recipe, 240)]
    for region in recipe.held_out:
        held = [all(a <= row[c] <= b for c, (a, b) in region.bounds.items()) for row in rows]
        assert 0.08 < np.mean(held) < 0.31


def spans(recipe):
    axes = (*recipe.machine, *recipe.record, *(w.axis for w in recipe.severities))
    return {axis.path: getattr(axis, "bands", None) for axis in axes}


SHIFTED_LOAD = {
    "bilge-pump": ("pressure.discharge", [(0.6, 0.8), (1.2, 1.4)]),
    "journal-bearing": ("load.static", [(0.25, 0.4), (1.6, 1.9)]),
    "propulsion-shaft": ("propeller.thrust", [(1.3, 1.5)]),  # none at all is in the standard set
}
"""Path, and bands over the scene's own value."""


@pytest.mark.parametrize("machine", MACHINES)
def test_the_shifted_set_is_beyond_the_standard_one(machine):
    standard, shifted = (shipped(f"{machine}-{kind}") for kind in ("standard", "shifted"))
    there, here = spans(standard), spans(shifted)
    own = standard.scene.drive.speed
    assert_allclose(here["drive.speed"], [(0.7 * own, 1.3 * own)])
    load, bands = SHIFTED_LOAD[machine]
    [(low, high)] = there[load]
    as_written = attrgetter(load)(standard.scene)
    assert_allclose(here[load], np.array(bands) * as_written)
    assert all(top <= low * (1 + 1e-9) or bottom >= high * (1 - 1e-9) for bottom, top in here[load])
    severities = [wearing.axis for wearing in standard.severities]
    assert [wearing.axis for wearing in shifted.severities] == severities
    assert not shifted.held_out
    assert shifted.name not in {standard.name, f"{machine}-small"}


def test_modes_of_the_shifted_sets_move_by_a_fifth():
    pump, shaft = shipped("bilge-pump-shifted"), shipped("propulsion-shaft-shifted")
    for i, mode in enumerate(pump.scene.casing.modes):
        band = spans(pump)[f"casing.modes.{i}.frequency"]
        assert_allclose(band, [(0.8 * mode.frequency, 1.2 * mode.frequency)])
    housing = shaft.scene.bearings[2].housing
    for name in ("stiffness_up", "stiffness_side"):
        [(low, high)] = spans(shaft)[f"bearings.2.housing.{name}"]
        # a frequency goes with the root of the stiffness
        assert_allclose(np.sqrt([low, high] / np.float64(getattr(housing, name))), [0.8, 1.2])


def test_models_of_the_shifted_sets_are_trained_on_nowhere():
    others = [shipped(name) for name in recipe_names() if not name.endswith("-shifted")]
    scenes = [recipe.scene for recipe in others]
    pump, journal, shaft = (shipped(f"{machine}-shifted").scene for machine in MACHINES)
    pumps = [scene for scene in scenes if scene.machine == "reciprocating-pump"]
    assert pump.joint.crankpin.law not in {scene.joint.crankpin.law for scene in pumps}
    journals = [scene for scene in scenes if scene.machine == "journal-bearing"]
    assert journal.film.rung not in {scene.film.rung for scene in journals}
    shafts = [scene for scene in scenes if scene.machine == "propulsion-shaft"]
    assert shaft.film.condition not in {scene.film.condition for scene in shafts}
    assert min(len(pumps), len(journals), len(shafts)) >= 3


def test_the_other_law_and_films_make_another_signal():
    """Records of a shifted set as drawn, and with the model of the standard set."""
    other = {
        "bilge-pump": {
            "joint.crankpin.law": "kelvin-voigt",
            "joint.crankpin.restitution": None,
            "joint.crankpin.damping": "30 kN s/m",
        },
        "journal-bearing": {"film.rung": "map"},
        "propulsion-shaft": {"film.condition": "periodic"},
    }
    for machine in MACHINES:
        recipe = load_recipe(f"{machine}-shifted", BRIEF[load_scene(machine).machine])
        sample = next(sample_records(recipe, seed=4))
        changed = sample.scene.model_dump()
        for path, value in other[machine].items():
            *tables, key = path.split(".")
            node = changed
            for table in tables:
                node = node[table]
            node[key] = value
        signals = [
            simulate(scene, seed=sample.seed).signal[0].astype(float)
            for scene in (sample.scene, type(sample.scene).model_validate(changed))
        ]
        # not rounding: more than a per cent of the vibration
        change = np.std(signals[0] - signals[1]) / np.std(signals[0])
        assert change > 0.01


@pytest.mark.parametrize("machine", TESTS)
def test_tests_of_the_shifted_sets_are_beyond_the_standard_ones(machine):
    standard, shifted = (shipped(f"{machine}-{kind}") for kind in ("standard", "shifted"))
    assert shifted.scene.duration == standard.scene.duration / 2  # half the averages
    there, here = spans(standard), spans(shifted)
    assert {path for path in there if there[path] != here[path]} >= {SHIFTED_TEST[machine]}
    bands, [(low, high)] = here[SHIFTED_TEST[machine]], there[SHIFTED_TEST[machine]]
    assert all(b <= low * (1 + 1e-9) or a >= high * (1 - 1e-9) for a, b in bands)


SHIFTED_TEST = {
    "shaft-rig": "drive.speed",
    "propulsion-shaft-test": "drive.speed",
    "bilge-pump-casing": "exciters.0.contact_time",
}
"""What of a shifted set lies outside the standard one altogether."""


@pytest.mark.parametrize("machine", TESTS)
def test_healthy_tests_are_of_the_machines_of_the_standard_set(machine):
    standard, healthy = (shipped(f"{machine}-{kind}") for kind in ("standard", "healthy"))
    pairs = zip(*(sample_records(r, 5, seed=5) for r in (standard, healthy)), strict=True)
    for worn, new in pairs:
        assert worn.group == new.group
        assert all(worn.drawn[axis.path] == new.drawn[axis.path] for axis in standard.machine)
        assert new.row["grade"] == 0
        assert new.seed != worn.seed


# -- healthy recordings of the same machines


@pytest.mark.parametrize("machine", MACHINES)
def test_healthy_recordings_are_of_the_machines_of_the_standard_set(machine):
    standard, healthy = (shipped(f"{machine}-{kind}") for kind in ("standard", "healthy"))
    worn = {s.group: s for s in sample_records(standard, 40, seed=5)}
    new = list(sample_records(healthy, 60, seed=5))
    machine_paths = [axis.path for axis in standard.machine]
    record_paths = [axis.path for axis in (*standard.record, standard.severity)]
    assert [sample.group for sample in new] == [i // 3 for i in range(60)]
    for sample in new:
        other = worn[sample.group]
        for path in machine_paths:
            assert sample.drawn[path] == other.drawn[path]
        for path in record_paths:
            assert sample.drawn[path] != other.drawn[path]
        assert sample.row["grade"] == 0
        assert sample.seed != other.seed
    assert len({sample.seed for sample in new}) == 60
    # another seed, other machines
    path = machine_paths[0]
    assert next(sample_records(healthy, seed=6)).drawn[path] != new[0].drawn[path]


def healthy_text(machine="bilge-pump", of="bilge-pump-standard", more=""):
    return f'name = "mine"\nextends = "{machine}-standard"\nmachines_of = "{of}"\n{more}'


def load_text(tmp_path, text):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    return load_recipe(file)


GAIN = '[[machine]]\npath = "sensors.*.gain"\ndistribution = "factor"\nlow = 0.9\nhigh = 1.1\n'


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (healthy_text(more=GAIN), "machines_of = 'bilge-pump-standard': machine must be as it is"),
        (healthy_text(more='sampling = "random"\n'), "'bilge-pump-standard': sampling must be as"),
        (healthy_text(of="bilge-pump-stndard"), "did you mean 'bilge-pump-standard'?"),
        (healthy_text(of="bilge-pump-healthy"), "must be the recipe that draws them; name 'bilge"),
    ],
)
def test_other_machines_are_refused(tmp_path, text, fault):
    with pytest.raises(RecipeError) as caught:
        load_text(tmp_path, text)
    [found] = caught.value.faults
    assert fault in found


def test_machines_of_a_file_beside(tmp_path):
    base = tmp_path / "base.toml"
    base.write_text('name = "base"\nextends = "journal-bearing-small"\n')
    text = 'name = "mine"\nextends = "base.toml"\nmachines_of = "base"\nrecords_per_group = 4\n'
    mine = load_text(tmp_path, text)
    one, other = (next(sample_records(recipe)).drawn for recipe in (mine, shipped(base)))
    same = {path for path in one if one[path] == other[path]}
    assert same == {axis.path for axis in mine.machine}
    base.write_text('name = "misnamed"\nextends = "journal-bearing-small"\n')
    with pytest.raises(RecipeError, match="must be the recipe that draws them; name 'misnamed'"):
        load_text(tmp_path, text)


def test_an_added_severity_or_confounder_leaves_the_machines(tmp_path):
    """What recordings of a reference stand for: they need not have the faults of the set."""
    fault = (
        '[[confounder]]\nname = "loud"\nprobability = 1\npath = "crank.unbalance"\n'
        'distribution = "uniform"\nlow = 0.1\nhigh = 0.2\n'
    )
    mine = load_text(tmp_path, healthy_text(more=fault))
    one = next(sample_records(mine, seed=2))
    other = next(sample_records(shipped("bilge-pump-standard"), seed=2))
    assert one.row["confounder_loud"]
    assert all(one.drawn[axis.path] == other.drawn[axis.path] for axis in mine.machine)


@pytest.mark.parametrize("name", recipe_names())
def test_it_comes_back_from_the_texts_of_a_file(name):
    recipe = shipped(name)
    again = recorded_recipe(recipe.scene_text, recipe.text, overrides_text(recipe))
    assert next(sample_records(again)).drawn == next(sample_records(recipe)).drawn
