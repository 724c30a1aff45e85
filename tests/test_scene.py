"""Scenes: units, refusals, and the built-in machines."""

import copy
import json
import math
import pickle
import re
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pydantic import ValidationError
from wearstate.sim.contact.closed_forms import kelvin_voigt_restitution
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.spellings import spellings
from wearstate.sim.parts.dimensions import Dimension
from wearstate.sim.parts.part import FixedTable
from wearstate.sim.parts.units import UNITS, listed_unit, to_si
from wearstate.sim.pump_setup.contacts import contact_frequency
from wearstate.sim.pump_setup.ideal_motion import ideal_motion
from wearstate.sim.scene.load import (
    SCENE_FOLDER,
    load_scene,
    scene_from_table,
    scene_names,
    scene_table,
    scene_text,
)
from wearstate.sim.scene.scene import MOST_FAULTS, SceneError

EVERY_UNIT = [(dimension, unit) for dimension, units in UNITS.items() for unit in units]
CRANKPIN = "joint.crankpin"


def pump_table():
    return scene_table(scene_text("bilge-pump"))


def faults_of(overrides):
    with pytest.raises(SceneError) as caught:
        load_scene("bilge-pump", overrides)
    return caught.value.faults


# --- alternatives


def test_a_motor_has_one_of_its_two_speeds():
    table = pump_table()
    table["drive"]["motor"]["synchronous_speed"] = "306 rpm"
    both = "rated_slip and synchronous_speed given, must be exactly one of rated_slip and sync"
    with pytest.raises(SceneError, match=f"drive.motor: {both}"):
        scene_from_table(table)
    del table["drive"]["motor"]["rated_slip"]
    assert_allclose(scene_from_table(table).drive.synchronous_speed, 5.1)
    del table["drive"]["motor"]["synchronous_speed"]
    with pytest.raises(SceneError, match="neither given, must be exactly one of rated_slip and"):
        scene_from_table(table)


def test_a_speed_of_a_motor_replaces_the_other():
    mains = load_scene("bilge-pump", {"drive.motor.synchronous_speed": "306 rpm", "drive.speed": 4})
    assert_allclose(mains.drive.synchronous_speed, 5.1)
    governed = load_scene("bilge-pump", {"drive.motor.rated_slip": 0.2, "drive.speed": 4})
    assert_allclose(governed.drive.synchronous_speed, 5.0)


# --- units


@pytest.mark.parametrize(("dimension", "unit"), EVERY_UNIT)
@given(
    number=st.floats(-1e12, 1e12).filter(lambda x: x == 0 or abs(x) > 1e-250),
    space=st.sampled_from(["", " ", "  "]),
)
def test_every_unit_round_trips(dimension, unit, number, space):
    value = to_si(f"{number!r}{space}{unit}", dimension)
    # the factor's decimals, the product and the way back: three roundings of 1.1e-16
    assert_allclose(value / UNITS[dimension][unit], number, rtol=4e-16, atol=0)


@pytest.mark.parametrize(("dimension", "unit"), EVERY_UNIT)
def test_one_unit_is_its_factor(dimension, unit):
    assert to_si(f"1 {unit}", dimension) == UNITS[dimension][unit]


def test_factors_against_their_definitions():
    # Not from the table: what each unit means. Exact but for one rounding.
    known = [
        ("1 in", "length", 25.4e-3),
        ("60 rpm", "rotation speed", 1.0),
        ("25 Hz", "rotation speed", 25.0),
        ("25 Hz", "frequency", 25.0),
        ("180 deg", "angle", math.pi),
        ("1 bar", "pressure", 1e5),
        ("14.503773773020923 psi", "pressure", 1e5),
        ("1 g", "acceleration", 9.80665),
        ("1 g", "mass", 1e-3),
        ("2 h", "time", 7200.0),
        ("1 N/um", "stiffness", 1e6),
        ("1 kN/mm", "stiffness", 1e6),
        ("1 N mm", "moment", 1e-3),
        ("6.283185307179586 rad/s", "rotation speed", 1.0),
        ("200 nm", "length", 2e-7),
        ("3 min", "time", 180.0),
        ("1 N/mm^2", "pressure", 1e6),
        ("1000 mbar", "pressure", 1e5),
        ("1 kg mm^2", "inertia", 1e-6),
        ("2.5 %", "ratio", 0.025),
    ]
    for text, dimension, expected in known:
        assert_allclose(to_si(text, dimension), expected, rtol=3e-16, err_msg=text)


SPELLINGS = [
    ("viscosity", "mPa s", ("mPa*s", "mPa·s", "mPa⋅s", "mPa.s", "mPa-s", "mPas", "mPa * s")),
    ("rotation speed", "rpm", ("RPM", "rev/min", "r/min", "1/min", "min^-1", "min-1", "min⁻¹")),
    ("rotation speed", "rev/s", ("r/s", "rev / s")),
    ("length", "um", ("µm", "μm")),  # micro sign, Greek letter
    ("time", "us", ("µs", "μs")),
    ("stiffness", "N/um", ("N/µm", "N/μm", "N / um")),
    ("moment", "kN m", ("kN·m", "kN*m", "kNm", "kN-m")),
    ("inertia", "kg m^2", ("kg·m²", "kg*m^2", "kgm2", "kg m**2", "kg-m²")),
    ("unbalance", "g mm", ("g·mm", "gmm", "g*mm")),
    ("damping", "N s/m", ("N·s/m", "Ns/m", "N*s/m", "N/(m/s)")),
    ("acceleration", "m/s^2", ("m/s²", "m/s2", "m/s**2")),
    ("volume", "cm^3", ("cm³", "cm3")),
    ("volume", "L", ("l",)),
    ("Hertz stiffness", "N/m^1.5", ("N/m**1.5", "N/m1.5")),
    ("angle", "deg", ("°",)),
]


@pytest.mark.parametrize(("dimension", "unit", "others"), SPELLINGS)
def test_a_unit_is_known_by_each_of_its_spellings(dimension, unit, others):
    schema = Dimension(dimension).__get_pydantic_json_schema__({}, lambda core: core)
    for other in others:
        assert to_si(f"7 {other}", dimension) == to_si(f"7 {unit}", dimension)
        assert re.search(schema["anyOf"][1]["pattern"], f"7 {other}"), other


def test_no_spelling_has_two_meanings():
    told = [(d, u, other) for d, u, others in SPELLINGS for other in others]
    for dimension, unit, other in [*told, *((d, u, u) for d, u in EVERY_UNIT)]:
        same = [u for u in UNITS[dimension] if re.fullmatch(spellings(u), other)]
        assert same == [unit], other
    # 1/s of a shaft may be revolutions or radians; a blank within a prefix is a slip
    for dimension, other in (("rotation speed", "1/s"), ("time", "m s"), ("pressure", "Mpa")):
        assert listed_unit(other, dimension) is None
        with pytest.raises(ValueError, match="use one of"):
            to_si(f"7 {other}", dimension)


@pytest.mark.parametrize("first", UNITS)
def test_the_first_unit_of_a_dimension_is_si(first):
    assert next(iter(UNITS[first].values())) == 1.0


def test_decimal_prefixes_are_exact():
    assert to_si("0.25 mm", "length") == 0.00025
    assert to_si("0.08 mm", "length") == 0.00008
    assert to_si("0.13 mm", "length") == 0.00013
    assert to_si("0.31 mm", "length") == 0.00031
    assert to_si("-3e-2 MPa", "pressure") == -30000.0
    assert to_si("7 us", "time") == 7e-6


@given(st.one_of(st.floats(allow_nan=False), st.integers(-(10**15), 10**15)))
def test_bare_numbers_are_si(number):
    assert to_si(number, "length") == number


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("0.25", "has no unit; use one of m, cm, mm"),
        ("0.25 kg", "has unit 'kg', not one of length"),
        ("0.25 MM", "has unit 'MM'"),
        ("mm", "has no leading number"),
        ("", "has no leading number"),
        ("nan mm", "has no leading number"),
        ("1,5 mm", "has a decimal comma; write '1.5 mm'"),
        (True, "is not a number or a string with a unit"),
        (None, "is not a number"),
        ([1.0], "is not a number"),
    ],
)
def test_unusable_quantities(value, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        to_si(value, "length")


@given(st.text(max_size=12))
def test_any_text_is_a_finite_length_or_a_value_error(text):
    try:
        value = to_si(text, "length")
    except ValueError:
        return
    assert not math.isnan(value)


# --- refusals


def test_all_errors_at_once():
    faults = faults_of(
        {
            "drive.speed": "0 rpm",
            f"{CRANKPIN}.diametral_clearance": "-0.02 mm",
            "rod.mass": "3 m",
            "piston.diamter": "0.1 m",
            "pressure.rung": "magic",
            "sensors.1.range": 0,
        }
    )
    assert sorted(fault.split(" ")[0] for fault in faults) == [
        "drive.speed",
        "joint.crankpin.diametral_clearance",
        "piston.diamter",
        "pressure.rung",
        "rod.mass",
        "sensors.1.range",
    ]


def test_error_names_quantity_value_bound_and_cure():
    [speed] = faults_of({"drive.speed": "0 rpm"})
    assert speed.startswith("drive.speed = 0 rev/s must be > 0")
    [clearance] = faults_of({f"{CRANKPIN}.diametral_clearance": "-0.02 mm"})
    assert clearance.startswith("joint.crankpin.diametral_clearance = -2e-05 m must be >= 0")
    [unit] = faults_of({"rod.mass": "3 m"})
    assert unit.startswith("rod.mass = '3 m' has unit 'm', not one of mass; use one of kg, g")


@pytest.mark.parametrize(
    ("path", "nearest"),
    [
        ("piston.diamter", "diameter"),
        ("drive.sped", "speed"),
        (f"{CRANKPIN}.diametric_clearance", "diametral_clearance"),
        ("joint.crank_pin", "crankpin"),
        ("durations", "duration"),
    ],
)
def test_unknown_keys_are_refused_with_the_nearest(path, nearest):
    faults = faults_of({path: "1 m"})
    assert f"{path} is an unknown key; did you mean '{nearest}'?" in faults


def test_unknown_scene_and_machine_name_the_nearest():
    with pytest.raises(SceneError, match="did you mean 'bilge-pump'"):
        load_scene("bilge-pmup")
    with pytest.raises(SceneError, match="did you mean 'reciprocating-pump'"):
        load_scene("bilge-pump", {"machine": "reciprocating-pmup"})


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({f"{CRANKPIN}.radial_clearance": "40 mm"}, "must be smaller than the pin"),
        ({f"{CRANKPIN}.diametral_clearance": "60 mm"}, "must be smaller than the pin"),
        ({"rod.centre_of_mass": "0.3 m"}, "centre_of_mass = 0.3 m must be <= length = 0.25 m"),
        ({"rod.length": "50 mm", "rod.centre_of_mass": 0.03}, "a shorter rod locks the crank"),
        ({"pressure.discharge": "-0.05 MPa"}, "must be >= suction"),
        ({"pressure.suction": "-2 bar"}, "must be >= -101325"),
        ({"wear.condemning_diametral": "0.3 mm"}, "must equal condemning_diametral"),
        ({"wear.as_new_diametral": "0.2 mm"}, "must rise strictly"),
        ({"sensors.1.name": "acc_x"}, "'acc_x' is given 2 times"),
        ({"casing.modes.2.shape.bearing_z": 0.1}, "casing.modes.2.shape.bearing_z is no place"),
        ({f"{CRANKPIN}.restitution_speed": 0.3}, "restitution_speed = 0.3 m/s is for the hyster"),
        (
            {
                f"{CRANKPIN}.law": "exact",
                f"{CRANKPIN}.damping": 0.0,
                f"{CRANKPIN}.restitution": 0.3,
                f"{CRANKPIN}.restitution_speed": 0.3,
                f"{CRANKPIN}.speed_floor": 0.1,
            },
            "speed_floor = 0.1 m/s has no effect with restitution_speed",
        ),
        ({"rod.mass": math.inf}, "rod.mass = inf kg"),
        ({"rod.mass": "1e999 kg"}, "rod.mass = inf kg"),
    ],
)
def test_impossible_machines(changes, says):
    assert any(says in fault for fault in faults_of(changes))


@pytest.mark.parametrize("given", [(), ("diametral_clearance", "radial_clearance")])
def test_exactly_one_clearance(given):
    table = pump_table()
    joint = table["joint"]["crankpin"]
    del joint["diametral_clearance"]
    joint |= dict.fromkeys(given, "0.1 mm")
    with pytest.raises(SceneError, match="must be exactly one of diametral_clearance and radial"):
        scene_from_table(table)


def test_missing_shape_at_a_sensor():
    table = copy.deepcopy(pump_table())
    del table["casing"]["modes"][0]["shape"]["acc_y"]
    with pytest.raises(SceneError, match=r"casing.modes.0.shape.acc_y is missing; give the shape"):
        scene_from_table(table)


def test_override_that_leads_nowhere():
    with pytest.raises(SceneError, match=r"sensors.7.noise does not lead to a value"):
        load_scene("bilge-pump", {"sensors.7.noise": 0})
    with pytest.raises(SceneError, match=r"name.first does not lead to a value"):
        load_scene("bilge-pump", {"name.first": 0})


def test_override_leaves_the_table_alone():
    table = pump_table()
    before = copy.deepcopy(table)
    load_scene("bilge-pump", {"casing.modes.0.shape.acc_x": 0.5})
    assert table == before
    assert pump_table() == before


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"drive": 1}, "drive = 1 must be a table"),
        ({"tacho": "none"}, "tacho = 'none' must be a table"),
        ({"sensors.0": 3}, "sensors.0 = 3 must be a table"),
        ({"casing.modes.0.shape": 3}, "casing.modes.0.shape = 3 must be a table"),
        ({"sensors": 3}, "sensors = 3 must be a list"),
        ({"sensors": []}, "sensors = [] must have >= 1 entries"),
        ({"wear.grade_edges_diametral": [1, 2, 3, 4]}, "must have <= 3 entries"),
        ({"settling_revolutions": 1.5}, "settling_revolutions = 1.5 must be a whole number"),
        ({"settling_revolutions": "x"}, "settling_revolutions = 'x' must be a whole number"),
        ({"name": 5}, "name = 5 must be a text"),
        ({"name": ""}, "name = '' must have >= 1 character(s)"),
        ({"tacho.name": "t" * 65}, "must have <= 64 characters"),
        ({"rod.mass": math.nan}, "rod.mass = nan kg must be finite"),
        ({"rod.mass": 10**400}, "rod.mass = inf kg must be finite"),
        ({"pressure.rung": 3}, "pressure.rung = 3 must be 'none', 'constant', 'two-level'"),
    ],
)
def test_every_kind_of_fault_has_its_own_words(changes, says):
    faults = faults_of(changes)
    assert any(says in fault for fault in faults), faults
    assert not any(word in fault for fault in faults for word in ("input", "instance", "valid "))


@pytest.mark.parametrize(
    ("path", "bound"),
    [
        ("duration", "<= 3600"),
        ("sample_rate", "<= 1e+06"),
        ("settling_revolutions", "<= 1000"),
        ("gravity", "<= 1000"),
        ("stroke_inclination", "<= 6.28319"),
        ("drive.speed", "<= 1000"),
        ("drive.start_angle", "<= 10000"),
        ("crank.radius", "<= 100"),
        ("rod.length", "<= 100"),
        ("rod.mass", "<= 1e+06"),
        ("rod.inertia", "<= 1e+09"),
        ("piston.mass", "<= 1e+06"),
        ("piston.diameter", "<= 100"),
        ("pressure.discharge", "<= 1e+09"),
        ("joint.crankpin.pin_diameter", "<= 100"),
        ("joint.crankpin.stiffness", "<= 1e+13"),
        ("joint.crankpin.damping", "<= 1e+09"),
        ("joint.crankpin.tangential_damping", "<= 1e+09"),
        ("joint.crankpin.friction_speed", "<= 1000"),
        ("wear.as_new_diametral", "<= 100"),
        ("casing.modes.0.frequency", "<= 1e+06"),
        ("casing.modes.0.shape.acc_x", "<= 1000"),
        ("sensors.0.gain", "<= 1000"),
        ("sensors.0.noise", "<= 1e+07"),
        ("sensors.0.range", "<= 1e+07"),
        ("tacho.level", "<= 10000"),
    ],
)
def test_absurd_values_meet_a_bound(path, bound):
    value = 10**12 if path == "settling_revolutions" else 1e200
    faults = [fault for fault in faults_of({path: value}) if fault.startswith(f"{path} = ")]
    assert len(faults) == 1
    assert f"must be {bound}" in faults[0]


@pytest.mark.parametrize(
    "path",
    [
        *("rod.mass", "rod.inertia", "piston.mass", "sample_rate", "numerics.step"),
        *("sensors.0.range", "sensors.0.gain", "casing.modes.0.frequency", "tacho.level"),
        "joint.crankpin.friction_speed",
    ],
)
def test_what_divides_has_a_least_value(path):
    [fault] = faults_of({path: 1e-300})
    assert fault.startswith(f"{path} = 1e-300")
    assert "must be >= " in fault


def test_a_number_out_of_bounds_comes_with_a_cure():
    [fault] = faults_of({"rod.mass": "3e9 kg"})
    assert fault == (
        "rod.mass = 3e+09 kg must be <= 1e+06 (mass with bearing shells); check value and unit"
    )


def test_half_a_name_is_answered_with_every_whole_one():
    assert faults_of({f"{CRANKPIN}.clearance": "0.1 mm"}) == [
        f"{CRANKPIN}.clearance is an unknown key; "
        "did you mean 'diametral_clearance' or 'radial_clearance'?"
    ]


@pytest.mark.parametrize("index", ["-1", "1_0", "+0", "٠", "7", "x"])
def test_a_list_is_counted_from_the_front_in_plain_digits(index):
    [fault] = faults_of({f"sensors.{index}.noise": 0})
    assert fault.startswith(f"sensors.{index}.noise does not lead to a value")


def test_a_mode_shape_is_frozen_hashable_and_picklable():
    scene = load_scene("bilge-pump")
    shape = scene.casing.modes[0].shape
    for change in (
        lambda: shape.update(acc_x=1.0),
        lambda: shape.__setitem__("acc_x", 1.0),
        lambda: shape.pop("acc_x"),
        lambda: shape.clear(),
        lambda: shape.setdefault("new", 1.0),
        lambda: shape.__ior__({"acc_x": 1.0}),
        lambda: shape.__delitem__("acc_x"),
    ):
        with pytest.raises(TypeError, match="a scene is frozen"):
            change()
    assert shape["acc_x"] == 0.06
    twin = pickle.loads(pickle.dumps(scene))
    assert twin == copy.deepcopy(scene) == scene
    assert hash(twin) == hash(scene)
    assert type(twin.casing.modes[0].shape) is FixedTable
    assert scene_from_table(json.loads(scene.model_dump_json())) == scene


def test_the_benchmark_contact_is_the_secant_of_its_hertz_law():
    # F = K d^1.5 has the secant F/d = K^(2/3) F^(1/3); F is the ideal joint's largest force
    scene = load_scene("slider-crank-benchmark")
    ideal = ideal_motion(scene, np.linspace(0, 2 * np.pi, 721))
    force = np.hypot(ideal.pin_force_x, ideal.pin_force_y).max()
    secant = 6.61e10 ** (2 / 3) * force ** (1 / 3)
    assert_allclose(force, 6.2e3, rtol=5e-3)  # as the scene's comment rounds it
    assert_allclose(scene.joint.crankpin.stiffness, secant, rtol=5e-3)  # two digits
    mass = scene.rod.mass + scene.piston.mass
    ratio = scene.joint.crankpin.damping / 2 / math.sqrt(scene.joint.crankpin.stiffness * mass)
    assert_allclose(kelvin_voigt_restitution(ratio), 0.94, atol=5e-3)  # two digits


def test_no_toml_and_no_text(tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text("name = ", encoding="utf-8")
    with pytest.raises(SceneError, match="not TOML"):
        load_scene(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="is no UTF-8 text"):
        load_scene(broken)
    broken.write_text(f"a = {'[' * 5000}", encoding="utf-8")
    with pytest.raises(SceneError, match="nested too deep"):
        load_scene(broken)
    with pytest.raises(SceneError, match="did you mean"):
        load_scene("bilge-pump\0")


def test_too_long_a_step_names_value_and_bound():
    scene = load_scene("bilge-pump", {"numerics.step": "1 ms"})
    bound = f"{1 / contact_frequency(scene):.3g} s"
    with pytest.raises(SceneError, match=r"numerics\.step = 0\.001 s must be <= ") as caught:
        simulate(scene, seed=0)
    assert bound in str(caught.value)
    assert "shorten it" in str(caught.value)


def test_a_recording_holds_a_revolution():
    scene = load_scene("bilge-pump", {"duration": "0.19 s"})
    with pytest.raises(SceneError, match=r"duration = 0\.19 s must be >= one revolution = 0\.2 s"):
        simulate(scene, seed=0)


def test_faults_of_the_plan_come_together():
    changes = {"duration": "0.19 s", "numerics.step": "1 ms", "sample_rate": "60 Hz"}
    with pytest.raises(SceneError) as caught:
        simulate(load_scene("bilge-pump", changes), seed=0)
    assert [fault.split(" ")[0] for fault in caught.value.faults] == [
        "duration",
        "tacho.pulse_width",
        "numerics.step",
    ]


@pytest.mark.parametrize(
    "part", [lambda s: s, lambda s: s.rod, lambda s: s.joint.crankpin, lambda s: s.sensors[0]]
)
def test_frozen(part):
    target = part(load_scene("bilge-pump"))
    field = next(iter(type(target).model_fields))
    with pytest.raises(ValidationError, match="frozen"):
        setattr(target, field, getattr(target, field))


# --- radial and diametral


def test_diametral_is_twice_radial():
    # Jetstream 3600/4200: renew the rod bearing at 0.31 mm on the diameter
    for name, value in (("diametral_clearance", "0.31 mm"), ("radial_clearance", "0.155 mm")):
        joint = load_scene("bilge-pump", {f"{CRANKPIN}.{name}": value}).joint.crankpin
        assert joint.clearance_radial == 0.155e-3
        assert joint.clearance_diametral == 0.31e-3


def test_setting_one_clearance_removes_the_other():
    joint = load_scene("bilge-pump", {f"{CRANKPIN}.radial_clearance": "0.1 mm"}).joint.crankpin
    assert joint.diametral_clearance is None
    assert joint.clearance_diametral == 0.2e-3


def test_limits_of_the_bilge_pump_are_those_of_its_source():
    wear = load_scene("bilge-pump").wear
    new_low, new_high, renew = 0.05e-3, 0.13e-3, 0.31e-3  # Jetstream 3600/4200, diametral
    assert wear.as_new_diametral == new_low
    assert wear.grade_edges_diametral[0] == new_high
    assert wear.grade_edges_diametral[2] == wear.condemning_diametral == renew
    # grade 2 begins in the middle of the wear allowance
    assert_allclose(wear.grade_edges_diametral[1], (new_high + renew) / 2, rtol=1e-12)


# --- the built-in scenes


@pytest.mark.parametrize("name", scene_names())
def test_built_in_scenes_load(name):
    scene = load_scene(name)
    assert scene.name == name
    assert scene.description
    assert scene == load_scene(SCENE_FOLDER / f"{name}.toml")


def unexplained_numbers(text):
    """Lines of TOML with a number that neither they, nor their block, nor an elder twin explain.

    A block is explained by a comment above its header or under it; the second ``[[sensors]]``
    shares the reasons of the first.
    """
    explained, bare, block, above = set(), [], "", ""
    for number, line in enumerate(text.splitlines(), 1):
        code, _, comment = line.partition("#")
        key, _, value = code.partition("=")
        if code.startswith("["):
            block = code.strip()
            explained |= {block} if above.startswith("#") else set()
        elif comment and not code.strip():
            explained |= {block} if block and above else set()
        elif comment.strip():
            explained.add((block, key))
        elif any(c.isdigit() for c in value) and not {block, (block, key)} & explained:
            bare.append(f"{number}: {line}")
        above = line.strip()
    return bare


def test_the_reader_of_comments_sees_a_bare_number():
    assert unexplained_numbers("a = 1\n") == ["1: a = 1"]
    twins = "[[e]]\nf = 3  # why\n[[e]]\nf = 4\ng = 5\n"
    assert unexplained_numbers(f"a = 1  # why\nb = 'x'\n\n# why\n[c]\nd = 2\n{twins}") == [
        "11: g = 5"
    ]
    assert unexplained_numbers("[a]\n# why\nb = 1\n[c]\nd = 2\n") == ["5: d = 2"]


@pytest.mark.parametrize("name", scene_names())
def test_every_number_of_a_scene_has_a_reason(name):
    assert unexplained_numbers(scene_text(name)) == []


def test_faults_between_parts_are_told_beside_faults_of_a_value():
    """The rod is too short and a mode's shape is misspelt, while the speed is no number."""
    changes = {
        "drive.speed": 0,
        "rod.length": "50 mm",
        "rod.centre_of_mass": "20 mm",
        "casing.modes.0.shape.guid_y": 0.1,
    }
    with pytest.raises(SceneError) as refusal:
        load_scene("bilge-pump", changes)
    text = "\n".join(refusal.value.faults)
    assert len(refusal.value.faults) == 3
    assert "drive.speed = 0 rev/s must be > 0" in text
    assert "rod.length = 0.05 m must be > crank radius" in text
    assert "did you mean 'guide_y'" in text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a = " + "9" * 100_000, "a whole number must have <= 64 bit"),
        ("a = 0x" + "f" * 100_000, "a: a whole number must have <= 64 bit"),
        ("a" + ".a" * 20_000 + " = 1", "nested too deep"),
        ("a = " + "{a = " * 40 + "1" + "}" * 40, "nested too deep"),
        ("".join(f"k{i} = 1\n" for i in range(90_000)), "characters must be <= 262144"),
    ],
)
def test_monstrous_toml_is_refused_at_once(text, says):
    begin = time.perf_counter()
    with pytest.raises(SceneError, match=says):
        scene_table(text)
    assert time.perf_counter() - begin < 10.0  # each took minutes or a traceback


def test_of_very_many_faults_the_first_are_told():
    table = scene_table(scene_text("bilge-pump") + "".join(f"\nk{i} = 1" for i in range(5000)))
    with pytest.raises(SceneError) as error:
        scene_from_table(table)
    assert len(error.value.faults) == MOST_FAULTS + 1
    assert error.value.faults[-1] == f"and {5000 - MOST_FAULTS} more; correct these first"
