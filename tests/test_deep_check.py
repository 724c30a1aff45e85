"""The deep check: each figure against a formula by hand, sane scenes usual, broken ones marked."""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.inspect.deep_check_text import deep_check_text, number, usual_range
from wearstate.sim.deep_check.check import deep_check
from wearstate.sim.deep_check.pump_figures import closing_speeds
from wearstate.sim.deep_check.rows import Figure, Quantity
from wearstate.sim.journal.recording import film_geometry
from wearstate.sim.scene.load import load_scene, scene_names

OWN = Path(__file__).parent / "own_scenes"
MUD_PUMP, JOURNAL, LINE = (
    str(OWN / f"{name}.toml") for name in ("mud-pump", "gearbox-journal", "workboat-line")
)

TRULY_UNUSUAL = {
    # a mechanism of the literature at engine speed, its clearance 50 per mille, not a pump
    "slider-crank-benchmark": {
        "mean piston speed",
        "crank radius over rod length",
        "clearance over pin, diametral",
        "impacts per revolution",
        "approach speed of an impact",
        "peak pin force over casing weight",
        "shaking force over casing weight",
    },
    "journal-whirl": {"mass over that of whirl"},  # what the scene is for
    "shaft-rig": {"beyond alignment limits"},  # one bearing stands too low, to be aligned
}


@cache
def found(name, *pairs):
    return deep_check(load_scene(name, dict(pairs)))


def values(name, *pairs):
    """Quantity -> its worst value."""
    return {f.quantity.name: f.worst[1] for f in found(name, *pairs).figures}


def unusual(name, *pairs):
    return {figure.quantity.name: figure for figure in found(name, *pairs).unusual}


# --- what is sane is usual


@pytest.mark.parametrize("name", [*scene_names(), MUD_PUMP, JOURNAL, LINE])
def test_sane_scenes_are_usual(name):
    assert set(unusual(name)) == TRULY_UNUSUAL.get(name, set())
    assert found(name).failure == ""
    assert found(name).warnings == ()


# --- each number by hand


def test_pump_figures_by_hand():
    got = values(MUD_PUMP)
    area = math.pi / 4 * 0.127**2
    assert got["mean piston speed"] == pytest.approx(2 * 0.254 * 2)  # 2 s n
    assert got["pressure ratio, absolute"] == pytest.approx(10.101325 / 0.301325)
    assert got["crank pin, rubbing speed"] == pytest.approx(math.pi * 0.2 * 2)
    assert got["clearance over pin, diametral"] == pytest.approx(1e3 * 0.25 / 200)
    assert got["casing mass over moving mass"] == pytest.approx(1 / 0.010**2 / (2 * 240))
    across = 0.010**2 + 0.006**2 + 0.010**2 + 0.008**2  # kg^-1, of four modes; the second has none
    assert got["casing at bearing over moving mass"] == pytest.approx(1 / across / 240)
    assert got["first casing mode over speed"] == pytest.approx(65 / 2)
    assert got["casing mode over half the rate"] == pytest.approx(2900 / 6400)
    assert got["revolutions recorded"] == pytest.approx(22)
    assert got["size of a recording"] == pytest.approx(11 * 12800 * 3 * 4e-6)
    # the discharge pressure on the piston; inertia at the dead centres is 4 % of it
    pressure = 10e6 * area / 0.2**2 / 1e6
    assert got["crank pin, projected pressure"] == pytest.approx(pressure, rel=0.06)
    assert got["penetration over clearance"] == pytest.approx(
        got["crank pin, projected pressure"] * 1e6 * 0.2**2 / 2e9 / 0.125e-3
    )


def test_shaking_force_of_one_throw_by_hand():
    # m r omega^2 (1 + r / l) at the dead centre, on 1 / 0.13^2 kg
    force = (6 + 1.5) * 0.05 * (10 * math.pi) ** 2 * 1.2
    assert values("bilge-pump")["shaking force over casing weight"] == pytest.approx(
        force / (9.80665 / 0.13**2)
    )


def test_deflection_of_one_mode_is_force_over_stiffness():
    # F / k with k = (2 pi f)^2 / (shape at force x shape at sensor); no pressure, inertia alone
    force = (0.14 + 0.21) * 0.05 * (math.tau * 5000 / 60) ** 2
    stiffness = (math.tau * 2000) ** 2 / 0.3**2
    got = values("slider-crank-benchmark")["casing deflection, static"]
    assert got == pytest.approx(1e6 * force / stiffness)


def test_closing_speed_of_a_free_flight():
    radius = np.concatenate([np.linspace(-0.9, 0.9, 19), [1.0001, 1.05, 1.0001, 0.9]])
    offset = 1e-4 * np.column_stack([radius, np.zeros_like(radius)])
    # 0.1 of 0.1 mm a sample at 1 kHz
    assert closing_speeds(offset, 1e-4, 1e3) == pytest.approx([0.01], rel=0.02)


def test_journal_figures_by_hand():
    got, scene = values(JOURNAL), load_scene(JOURNAL)
    load = 5000 + 40 * 9.80665
    sommerfeld = 0.020 * 50 * 0.048 * 0.060 / load * (30 / 0.045) ** 2
    assert got["Sommerfeld number"] == pytest.approx(sommerfeld)
    assert got["projected pressure"] == pytest.approx(load / (48 * 60))
    assert got["surface speed"] == pytest.approx(math.pi * 0.06 * 50)
    assert got["clearance over bore, diametral"] == pytest.approx(1.5)
    assert got["balance grade"] == pytest.approx(0.32e-3 / 40 * math.tau * 50 * 1e3)
    reynolds = 870 * math.pi * 0.06 * 50 * 45e-6 / 0.020
    critical = 41.2 * math.sqrt(30 / 0.045)
    assert got["Reynolds over critical number"] == pytest.approx(reynolds / critical)
    # Raimondi, Boyd 1958, L/D between 1/2 and 1 at S = 0.237: e between 0.4 and 0.6
    assert 0.4 < got["eccentricity at rest"] < 0.6
    # the orbit about the rest is small, so the least film is what is left of the clearance
    rest = 45 * (1 - got["eccentricity at rest"])
    assert got["least film"] == pytest.approx(rest, rel=0.03)
    assert film_geometry(scene).n_theta == 72


def test_whirl_scene_is_past_its_threshold_and_the_slower_one_is_not():
    assert values("journal-whirl")["mass over that of whirl"] > 1
    slower = values("journal-whirl", ("drive.speed", "4600 rpm"))
    assert slower["mass over that of whirl"] < 1


def test_shaft_figures_by_hand():
    got = values(LINE)
    facts = {f.quantity.name: f.values for f in found(LINE).figures}
    steel = 7850 * math.pi / 4 * 0.12**2 * 6.4
    weight = (steel + 220 + 45) * 9.80665 - 280  # less the propeller's buoyancy
    loads = {name: p * 1e6 for name, p in facts["projected pressure"].items()}
    lengths = {"stern": 0.24, "middle": 0.12, "forward": 0.12}
    total = sum(loads[name] * 0.12 * length for name, length in lengths.items())
    assert total == pytest.approx(weight, rel=0.01)  # side forces are the rest
    middle = loads["middle"]
    sommerfeld = 0.030 * 10 / middle * (60 / 0.1) ** 2
    assert facts["Sommerfeld number"]["middle"] == pytest.approx(sommerfeld)
    assert got["propeller tip speed"] == pytest.approx(math.pi * 1.2 * 10)
    assert got["housing frequency"] == pytest.approx(math.sqrt(250e6 / 60) / math.tau)
    deflection = loads["stern"] * 0.12 * 0.24 / 400e6
    assert facts["housing deflection, static"]["stern"] == pytest.approx(1e6 * deflection, rel=0.01)
    assert facts["balance grade"]["propeller"] == pytest.approx(0.022 / 220 * math.tau * 10 * 1e3)


# --- what is broken is marked, and its cure helps

LIGHT = [
    (f"casing.modes.{i}.shape.{place}", 0.7)
    for i in range(8)
    for place in ("bearing_x", "bearing_y", "guide_y", "cylinder_x", "acc_x", "acc_y")
]

BROKEN = {
    "casing of 2 kg": ("bilge-pump", LIGHT, "casing mass over moving mass", []),
    "mode above half the rate": (
        "bilge-pump",
        [("casing.modes.7.frequency", "15 kHz")],
        "casing mode over half the rate",
        [("sample_rate", "51.2 kHz")],
    ),
    "pin clearance ten times": (
        "bilge-pump",
        [("joint.crankpin.diametral_clearance", "0.8 mm")],
        "clearance over pin, diametral",
        [],
    ),
    "stroke given as radius and rpm as rev/s": (
        MUD_PUMP,
        [
            ("crank.radius", "254 mm"),
            ("rod.length", "1400 mm"),
            ("rod.centre_of_mass", "900 mm"),
            ("pressure.rung", "none"),
            ("drive.speed", "6 Hz"),
        ],
        "mean piston speed",
        [("drive.speed", "1.9 Hz")],
    ),
    "journal clearance ten times": (
        JOURNAL,
        [("bearing.diametral_clearance", "0.9 mm")],
        "clearance over bore, diametral",
        [],
    ),
    "film of 1 um": (
        JOURNAL,
        [("oil.viscosity", "0.25 mPa s"), ("film.rung", "short")],
        "least film",
        [("oil.viscosity", "20 mPa s")],
    ),
    "unloaded bearing": (
        LINE,
        [("bearings.1.offset", "-2.5 mm")],
        "bearing reaction over mean",
        [],  # back to its offset: the sane scene
    ),
    "housing above half the rate": (
        LINE,
        [("bearings.0.housing.stiffness_up", "9000 MN/m")],
        "housing frequency over half rate",
        [("sample_rate", "5.12 kHz")],
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_scenes_are_marked_and_the_cure_helps(case):
    name, broken, quantity, cure = BROKEN[case]
    marked = unusual(name, *broken)
    assert quantity in marked, values(name, *broken)
    assert marked[quantity].cure
    if cure:  # else it is to be as in the sane scene
        assert quantity not in unusual(name, *dict([*broken, *cure]).items())


def test_a_failing_trial_is_a_fault(tmp_path):
    pairs = ["--set", "load.static=60000 N", "--set", "oil.viscosity=2 mPa s"]
    result = CliRunner().invoke(cli, ["scene", "check", JOURNAL, "--deep", *pairs])
    assert result.exit_code == 2
    assert "trial" in result.output
    assert "UNUSUAL" in result.output


# --- rows and command


def test_a_figure_shows_the_place_furthest_from_usual():
    row = Quantity(
        name="x", unit="", measure=dict, least=1.0, most=10.0, reason="r", low="up", high="down"
    )
    assert Figure(quantity=row, values={"a": 5.0, "b": 0.5}).worst == ("b", 0.5)
    assert Figure(quantity=row, values={"a": 5.0, "b": -1.0}).cure == "up"
    assert Figure(quantity=row, values={"a": 30.0, "b": 0.5}).cure == "down"
    assert Figure(quantity=row, values={"a": 10.0}).usual
    assert not Figure(quantity=row, values={"a": math.nan}).usual
    assert usual_range(row) == "1 to 10"
    assert number(0.0) == "0"


def test_every_row_has_a_cure_where_it_has_an_end():
    for name in ("bilge-pump", JOURNAL, LINE):
        for figure in found(name).figures:
            row = figure.quantity
            assert bool(row.low) == (row.least > -math.inf), row.name
            assert bool(row.high) == (row.most < math.inf), row.name


def test_command_as_text_and_json():
    run = CliRunner().invoke(cli, ["scene", "check", JOURNAL, "--deep"])
    assert run.exit_code == 0
    assert run.output.startswith("gearbox-journal: no fault; all 19 figures are usual")
    assert run.output.strip() == deep_check_text("gearbox-journal", found(JOURNAL))
    table = json.loads(
        CliRunner().invoke(cli, ["scene", "check", JOURNAL, "--deep", "--json"]).output
    )
    assert table["faults"] == []
    assert table["unusual"] == []
    entry = next(e for e in table["figures"] if e["quantity"] == "Sommerfeld number")
    assert entry["value"] == pytest.approx(0.2373, rel=1e-3)
    assert (entry["least"], entry["most"], entry["usual"]) == (0.02, 5.0, True)


def test_a_doubt_that_a_figure_tells_is_not_told_again():
    short = found("bilge-pump", ("duration", "1.2 s"))
    assert [figure.quantity.name for figure in short.unusual] == ["revolutions recorded"]
    assert short.warnings == ()


def test_a_warning_of_the_run_that_a_figure_tells_is_not_told_again():
    low = found(LINE, ("bearings.1.offset", "-2.5 mm"))
    assert low.warnings == ()
    edge = next(f for f in low.unusual if f.quantity.name == "film at the edge over middle")
    assert edge.others == ("forward",)
