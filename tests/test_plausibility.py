"""What runs well and is hardly meant is told, and nothing that is built in is."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.audit.integrity import check_set
from wearstate.datasets.audit.plausibility import recording_doubts, scene_in
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.generation.generate import save_solution
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.datasets.recipe.text import recipe_names
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel
from wearstate.sim.scene.load import load_scene, scene_names
from wearstate.sim.scene.plausibility import (
    FEWEST_TURNS,
    MOST_VELOCITY,
    RECORD_CHECKS,
    SCENE_CHECKS,
    Seen,
    record_doubts,
    scene_doubts,
    solution_doubts,
)

RATE = 1024.0
ACC = Channel(name="acc", unit="m/s^2", quantity="acceleration")
SHAPES = {f"casing.modes.{i}.shape.{key}": 1.5 for i in range(8) for key in ("acc_x", "bearing_x")}
FREQUENCIES = {f"casing.modes.{i}.frequency": f"{20 + i} kHz" for i in range(8)}
SOFT = {f"casing.modes.{i}.frequency": f"{2 + i / 10} Hz" for i in range(8)}
PIPES = {
    "pressure.rung": "lumped-lines",
    "pressure.suction_line.wave_speed": "1470 m/s",
    "pressure.discharge_line.wave_speed": "1490 m/s",
}
OIL = {"joint.crankpin.oil.viscosity": "0.06 Pa s", "joint.crankpin.oil.length": "50 mm"}
NODES = {f"casing.modes.{i}.shape.acc_x": 0 for i in range(8)}
BALANCED = {f"discs.{i}.unbalance": 0 for i in range(5)} | {
    "turbulence": [],
    "propeller.blade_rate": [],
    "coupling.parallel_offset": 0,
    "coupling.angle": 0,
}


def checks(doubts):
    return [doubt.check for doubt in doubts]


# --- scenes


@pytest.mark.parametrize("name", scene_names())
def test_no_built_in_scene_is_in_doubt(name):
    assert scene_doubts(load_scene(name)) == ()


@pytest.mark.parametrize("name", recipe_names())
def test_no_machine_that_a_recipe_draws_is_in_doubt(name):
    for sample in sample_records(load_recipe(name), 40, seed=3):
        assert scene_doubts(sample.scene) == (), sample.index


DOUBTFUL = {
    "few revolutions": (
        ("bilge-pump", {"duration": "1.2 s"}),
        "duration = 1.2 s holds 6 revolutions, usual are >= 20; record 4 s or longer",
    ),
    "few revolutions of a shaft": (
        ("shaft-rig", {"duration": "0.5 s"}),
        "duration = 0.5 s holds 5 revolutions",
    ),
    "light casing": (
        ("bilge-pump", SHAPES),
        r"casing.modes: 8 of 8 move less than 2 times .* \(9 kg\), least casing.modes.0 with 0.444 "
        "kg, usual are >= 5 times",
    ),
    "soft casing": (
        ("bilge-pump", SOFT),
        r"casing.modes: 2\.8e\+03 N at \w+ move \w+ by .* mm, usual are < 0.1 mm; raise",
    ),
    "modes outside": (
        ("bilge-pump", FREQUENCIES),
        "8 of 8 lie above half the sample rate = 12800 Hz, the lowest at 20000 Hz",
    ),
    "sensor at nodes": (
        ("bilge-pump", NODES),
        "sensors: 'acc_x' moves in none of 8 casing modes that a force drives",
    ),
    "fast waves": (
        ("bilge-pump", PIPES),
        r"pressure.discharge_line.wave_speed = 1490 m/s is above the speed of sound .* = 1478 m/s, "
        "the limit of a rigid pipe",
    ),
    "unread oil": (
        ("bilge-pump", OIL),
        r"joint\.crankpin\.oil is given, but the rung 'compliant' is dry, usual is one of",
    ),
    "no excitation of a shaft": (("propulsion-shaft", BALANCED), "0 of them have an unbalance"),
    "no excitation of a journal": (
        ("journal-bearing", {"rotor.unbalance": 0}),
        "rotor.unbalance = 0 kg m and load.history = 'none': nothing excites the shaft",
    ),
}


@pytest.mark.parametrize(("given", "text"), DOUBTFUL.values(), ids=list(DOUBTFUL))
def test_a_scene_that_is_hardly_meant_is_told_with_what_is_usual(given, text):
    found = scene_doubts(load_scene(*given))
    told = [doubt.text for doubt in found if re.search(text, doubt.text)]
    assert len(told) == 1, found
    assert "usual" in told[0]
    assert ";" in told[0]  # a cure follows


def test_every_check_of_a_scene_is_tried():
    assert {row.name for row in SCENE_CHECKS} == {name.split(" of a ")[0] for name in DOUBTFUL}


def test_the_bounds_bite_where_they_say():
    speed = load_scene("bilge-pump").drive.speed
    just = {"duration": FEWEST_TURNS / speed}
    assert scene_doubts(load_scene("bilge-pump", just)) == ()
    less = {"duration": 0.999 * FEWEST_TURNS / speed}
    assert checks(scene_doubts(load_scene("bilge-pump", less))) == ["few revolutions"]


# --- recordings


def seen(row, **known):
    signal = np.atleast_2d(row).astype(np.float32)
    return Seen(signal=signal, sample_rate=RATE, channels=(ACC,), **known)


def tone(amplitude, frequency=64.0, n=4096):
    return amplitude * np.sin(2 * np.pi * frequency * np.arange(n) / RATE)


RECORDS = {
    "few revolutions": seen(tone(1.0), turns=6.0),
    "still": seen(np.zeros(100)),
    "faint": seen(tone(0.9), full_scale={"acc": 1000.0}),
    "noise alone": seen(
        np.random.default_rng(0).standard_normal(4096), noise={"acc": 1.0}, full_scale={"acc": 1e6}
    ),
    "violent": seen(tone(1.01 * MOST_VELOCITY * np.sqrt(2) * 2 * np.pi * 64.0)),
}


@pytest.mark.parametrize("check", RECORDS)
def test_a_record_that_is_hardly_meant_is_told(check):
    [doubt] = record_doubts(RECORDS[check])
    assert doubt.check == check
    assert "usual" in doubt.text


def test_every_check_of_a_record_is_tried():
    assert [row.name for row in RECORD_CHECKS] == list(RECORDS)


def test_a_usual_record_is_not_in_doubt():
    usual = seen(tone(2.0), turns=20.0, full_scale={"acc": 1000.0}, noise={"acc": 0.05})
    assert record_doubts(usual) == ()
    assert record_doubts(seen(tone(0.99 * MOST_VELOCITY * np.sqrt(2) * 2 * np.pi * 64.0))) == ()


def test_a_steady_value_is_no_vibration():
    assert checks(record_doubts(seen(np.full(100, 9.81)))) == ["still"]
    offset = seen(9.81 + tone(0.9), full_scale={"acc": 1000.0})
    assert checks(record_doubts(offset)) == ["faint"]


@pytest.mark.parametrize(
    "name", ["journal-bearing", "journal-unbalance", "journal-step", "journal-whirl", "shaft-rig"]
)
def test_no_run_of_a_built_in_scene_is_in_doubt(name):
    scene = load_scene(name)
    assert solution_doubts(scene, simulate(scene, seed=1)) == ()


def test_a_balanced_shaft_records_its_noise_and_says_so():
    still = {f"discs.{i}.unbalance": 0 for i in range(2)} | {"turbulence": [], "duration": "2 s"}
    still |= {"coupling.parallel_offset": 0, "coupling.torque": 0}
    solution = simulate(load_scene("shaft-rig", still | {"run_out": [], "dents": []}), seed=1)
    assert any("0 of them have an unbalance" in text for text in solution.warnings)
    held = [text for text in solution.warnings if "its own noise" in text or "throughout" in text]
    assert len(held) == 6  # four accelerometers, two probes


def test_a_failed_run_has_its_status_and_no_doubts():
    scene = load_scene("propulsion-shaft", {"discs.0.unbalance": "200 kg m", "duration": "1 s"})
    assert simulate(scene, seed=1, raise_on_failure=False).warnings == ()


# --- commands and files


def test_scene_check_and_simulate_tell_it(tmp_path):
    run = CliRunner().invoke
    text = run(cli, ["scene", "show", "journal-unbalance"]).stdout
    short = tmp_path / "short.toml"
    short.write_text(text.replace('"0.4 s"', '"0.1 s"'), encoding="utf-8")
    told = "duration = 0.1 s holds 5 revolutions, usual are >= 20; record 0.4 s or longer"
    checked = run(cli, ["scene", "check", str(short)])
    assert checked.exit_code == 0
    assert checked.stdout == f"journal-unbalance: no fault, 1 warning(s)\nwarning: {told}\n"
    table = json.loads(run(cli, ["scene", "check", str(short), "--json"]).stdout)
    assert (table["faults"], table["warnings"]) == ([], [told])
    made = run(cli, ["simulate", str(short), "--json", "-o", str(tmp_path / "a.h5")])
    assert made.exit_code == 0
    assert f"warning: {told}" in made.stderr
    assert json.loads(made.stdout)["warnings"] == [told]
    shown = run(cli, ["info", str(tmp_path / "a.h5")])
    assert "warning: 0.1 s hold 5 revolutions, usual are >= 20" in shown.stdout
    plain = run(cli, ["scene", "check", "journal-unbalance"])
    assert plain.stdout == "journal-unbalance: no fault\n"


def test_a_file_of_noise_alone_is_noted(tmp_path):
    still = {"rotor.unbalance": 0, "rotor.run_out": [], "rotor.dents": [], "duration": "0.1 s"}
    scene = load_scene("journal-bearing", still)
    path = tmp_path / "still.h5"
    save_solution(scene, simulate(scene, seed=1), path, seed=1)
    found = check_set(path)
    assert found.sound  # whole, as it was recorded
    notes = [finding.text for finding in found.findings if finding.check == "plausible"]
    assert any("its own noise" in note for note in notes)
    assert any("5 revolutions" in note for note in notes)
    with DataSet(path) as data:
        whole = scene_in(data.attributes)
        assert checks(recording_doubts(data[0], whole, scene_too=True)) == [
            "few revolutions",
            "noise alone",
            "noise alone",
            "no excitation",
        ]


def test_turns_are_counted_by_a_tacho():
    key = Channel(name="key", unit="V", quantity="tacho")
    time = np.arange(4096) / RATE
    signal = np.stack([tone(1.0), 5.0 * (time * 4.5 % 1 < 0.2)])
    about = {"sample_rate": RATE, "channels": (ACC, key), "tacho": "key"}
    [doubt] = recording_doubts(Recording(signal=signal, **about, pulses_per_revolution=3))
    assert doubt.text.startswith("4 s hold 6 revolutions, usual are >= 20; record 13.3 s")
    assert recording_doubts(Recording(signal=signal[:1], sample_rate=RATE, channels=(ACC,))) == ()
