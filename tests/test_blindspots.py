"""What a model takes for granted: rows, resuming, ranking, page, command."""

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.records import sample_records
from wearstate.diagnose.blindspots import blindspots
from wearstate.diagnose.blindspots.blindspots import find_blind_spots, kept_rows, recipe_of
from wearstate.diagnose.blindspots.page import blind_spots_html
from wearstate.diagnose.blindspots.rows import scene_rows
from wearstate.diagnose.blindspots.scores import ShiftRow, ShiftVerdict, ranked, row_figures
from wearstate.diagnose.blindspots.signals import signal_rows
from wearstate.diagnose.blindspots.text import blind_spots_table, blind_spots_text, conclusion
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.machines.registry import presentation_of
from wearstate.diagnose.machines.shifts import Shift
from wearstate.diagnose.wear_model.verdict import Estimate
from wearstate.features.rotation.order import pulse_times
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel, tacho_pulses
from wearstate.sim.scene.scene import SceneError, channels_of

PUMP = load_recipe("bilge-pump-narrow", {"duration": "0.4 s"})
LIMIT = 3.1e-4

CARD = SimpleNamespace(
    mode="cold",
    views={},
    trained_on=SimpleNamespace(recipe="bilge-pump-narrow", scene="bilge-pump"),
    severity="diametral_clearance_crankpin_m",
    condemning_limit_m=LIMIT,
    severity_range_m=(0.2 * LIMIT, 1.5 * LIMIT),
    sample_rate_hz=25600.0,
    channels=channels_of(PUMP.scene),
)


def loudness(recording, baseline=None, conditions=None, told=()):
    """Stands for a model: the louder, the more worn."""
    found = 1e-5 * float(recording.signal[0].std())
    return Estimate(verdict="graded", severity=found, low=found / 2, high=2 * found, grade=0)


MODEL = SimpleNamespace(card=CARD, noted=(), estimate=loudness)


def shifts_of(path, *amounts):
    return scene_rows(PUMP, [Shift(path=path, kind="factor", amounts=amounts, why="")])[
        : len(amounts)
    ]


def gains():
    return [row for row in signal_rows() if row.name == "gain"]


@pytest.fixture(scope="module")
def found():
    """Baseline, a shift of nothing, a heavier piston, a gain; two machines."""
    rows = shifts_of("piston.mass", 1.0, 1.25)
    return find_blind_spots(MODEL, PUMP, machines=2, scenes=rows, signals=gains())


def by_name(found):
    return {f"{row.name} {row.shift}": row for row in found.rows}


def test_no_shift_is_the_baseline(found):
    assert len(found.baseline.said) == 2
    assert len({each.truth for each in found.baseline.said}) == 2
    assert by_name(found)["piston.mass x 1"].said == found.baseline.said


def test_a_shift_shows_in_its_row_alone(found):
    heavy = by_name(found)["piston.mass x 1.25"]
    pairs = list(zip(heavy.said, found.baseline.said, strict=True))
    assert all(one.truth == other.truth for one, other in pairs)
    assert all(abs(one.found / other.found - 1) > 1e-3 for one, other in pairs)


def test_a_gain_scales_what_is_judged(found):
    pairs = zip(by_name(found)["gain x 1.26"].said, found.baseline.said, strict=True)
    # float32 signals
    assert [one.found / other.found for one, other in pairs] == pytest.approx([1.26] * 2, rel=1e-6)


def test_a_model_is_told_the_nameplate_of_the_shifted_machine():
    """A rod of another length shows in no signal: only its nameplate can say so."""
    heard = []

    def listening(recording, baseline=None, conditions=None, told=()):
        heard.append(told)
        return loudness(recording)

    model = SimpleNamespace(card=CARD, noted=(), estimate=listening)
    rows = shifts_of("rod.length", 1.2)
    find_blind_spots(model, PUMP, machines=1, scenes=rows, signals=gains())
    as_trained, gained, longer = heard
    assert as_trained == gained == ()
    assert len(longer) == 1
    assert longer[0].startswith("rod.length = 0.3 m by the nameplate")


def test_machines_are_of_seeds_of_their_own():
    own = blindspots._samples(PUMP, 2, 0)
    usual = list(sample_records(PUMP, 4, seed=0))
    assert not {s.row["diametral_clearance_crankpin_m"] for s in own} & {
        s.row["diametral_clearance_crankpin_m"] for s in usual
    }
    assert [s.group for s in own] == [0, 1]


# --- rows of the scene ----------------------------------------------------------------------------


def rows_named(recipe, name, word=""):
    return [row for row in scene_rows(recipe) if row.name == name and word in row.shift]


def test_what_is_drawn_is_shifted_beyond_its_range():
    [low, high] = rows_named(PUMP, "drive.speed")
    sample = next(sample_records(PUMP, 1))
    [axis] = [axis for axis in PUMP.record if axis.path == "drive.speed"]
    ends = axis.extremes()
    width = ends[1] - ends[0]
    assert low.kind == high.kind == "drawn"
    assert low.applied(PUMP, sample).drive.speed == pytest.approx(ends[0] - 0.3 * width)
    assert high.applied(PUMP, sample).drive.speed == pytest.approx(ends[1] + 0.3 * width)


def test_every_machine_is_given_the_option_that_draws_the_value():
    recipe = load_recipe("bilge-pump-standard")
    [low, _] = rows_named(recipe, "pressure.liquid.air_fraction")
    samples = list(sample_records(recipe, 40))
    rungs = {sample.scene.pressure.rung for sample in samples}
    assert rungs == {"two-level", "chamber"}
    shifted = [low.applied(recipe, sample) for sample in samples]
    assert {scene.pressure.rung for scene in shifted} == {"chamber"}
    assert {round(s.pressure.liquid.air_fraction, 9) for s in shifted} == {round(3e-4 / 1.3, 9)}


def test_values_that_an_option_takes_are_no_shift():
    recipe = load_recipe("bilge-pump-standard")
    assert [row.shift for row in rows_named(recipe, "joint.crankpin.law")] == ["= flores"]
    assert rows_named(recipe, "drive.rung") == []
    assert len(rows_named(PUMP, "joint.crankpin.law")) == 3


def test_severities_and_full_circles_are_left_alone():
    names = {row.name for row in scene_rows(PUMP)}
    assert names
    assert not names & {"joint.crankpin.diametral_clearance", "drive.start_angle"}


@pytest.mark.parametrize(
    "name", ["bilge-pump-narrow", "journal-bearing-small", "propulsion-shaft-small"]
)
def test_every_row_of_the_table_is_a_scene(name):
    recipe = load_recipe(name)
    sample = next(sample_records(recipe, 1))
    rows = scene_rows(recipe)
    assert all(row.applied(recipe, sample) != sample.scene for row in rows)
    paths = {shift.path for shift in presentation_of(recipe.scene).shifts}
    told = {row.name for row in rows}
    lacking = {"coupling.angle", "bearings.*.slope"} & paths - told
    assert paths - told == lacking == set()


def test_a_value_that_the_scene_lacks_is_left_out():
    journal = load_recipe("journal-bearing-small")
    of_pump = presentation_of(load_recipe("bilge-pump-small").scene).shifts
    assert "rod.mass" not in {row.name for row in scene_rows(journal, of_pump)}


def test_a_shift_that_no_machine_takes_is_told():
    rows = scene_rows(PUMP, [Shift(path="rod.length", kind="set", amounts=("1 mm",), why="")])[:1]
    with pytest.raises(SceneError, match="rod: centre_of_mass"):
        rows[0].applied(PUMP, next(sample_records(PUMP, 1)))
    made = find_blind_spots(MODEL, PUMP, machines=1, scenes=rows, signals=[])
    assert made.rows[0].said == ()
    table = blind_spots_table(made, CARD)
    assert "Not simulated: rod.length = 1 mm: rod: centre_of_mass" in blind_spots_text(table)
    assert "rod.length = 1 mm" in blind_spots_html(table)


def test_what_the_rung_of_the_pressure_does_not_read_is_not_simulated():
    valves = {"pressure.rung": "chamber", "pressure.dead_volume": "4e-4 m^3"}
    empty = {"pressure.suction_valve": {}, "pressure.discharge_valve": {}}
    chamber = load_recipe("bilge-pump-narrow", {**valves, **empty})
    angles = r"pressure.(rise|fall)_(delay|angle)"
    for recipe, readable in ((PUMP, True), (chamber, False)):
        machine = next(sample_records(recipe, 1))
        rows = [row for row in scene_rows(recipe) if re.fullmatch(angles, row.name)]
        assert len(rows) == 8
        for row in rows:
            if readable:
                assert row.applied(recipe, machine) != machine.scene
            else:
                with pytest.raises(
                    SceneError, match=r"only matters if pressure\.rung = 'two-level'"
                ):
                    row.applied(recipe, machine)


def test_a_page_without_a_verdict_that_has_no_caution_has_no_picture():
    def careful(*given, **named):
        return replace(loudness(*given, **named), verdict="caution")

    model = SimpleNamespace(**{**vars(MODEL), "estimate": careful})
    made = find_blind_spots(model, PUMP, machines=1, scenes=[], signals=gains())
    page = blind_spots_html(blind_spots_table(made, CARD))
    assert "<img" not in page
    assert "gain" in page


# --- rows of the signal ---------------------------------------------------------------------------

FS, SPEED = 10_000.0, 5.0


@pytest.fixture
def recording():
    time = np.arange(int(FS)) / FS
    wave = 3.0 * np.sin(math.tau * 440 * time) + 7.0  # about a mean that is no vibration
    pulses = tacho_pulses(SPEED * time - 0.5, pulse_width=0.03, level=5.0)
    channels = (
        Channel(name="acc", unit="m/s^2", quantity="acceleration"),
        Channel(name="tacho", unit="V", quantity="tacho"),
    )
    signal = np.stack([wave, pulses])
    return Recording(signal=signal, sample_rate=FS, channels=channels, tacho="tacho")


def applied(recording, name, shift, **ways):
    [row] = [
        r for r in signal_rows(**ways) if r.name.startswith(name) and r.shift.startswith(shift)
    ]
    return row.apply(recording, SPEED, np.random.default_rng(0))


@pytest.mark.parametrize("name", ["white noise", "pink noise", "mains noise"])
@pytest.mark.parametrize("db", [-30, -20, -10])
def test_noise_has_its_level_about_the_mean(recording, name, db):
    noisy = applied(recording, name, f"{db} dB")
    added = noisy.signal[0].astype(float) - recording.signal[0]
    level = 20 * math.log10(added.std() / (3.0 / math.sqrt(2)))
    # 10,000 samples of white noise: a per cent; a fifth of pink noise is in its first lines
    assert level == pytest.approx(db, abs=1.2 if name == "pink noise" else 0.2)
    assert np.array_equal(noisy.signal[1], recording.signal[1])


@pytest.mark.parametrize("degrees", [1, 2, 5])
def test_a_late_tacho_is_late_by_its_angle(recording, degrees):
    late = applied(recording, "tacho", f"{degrees} deg")
    usual = pulse_times(recording.tacho_signal, FS)
    moved = pulse_times(late.tacho_signal, FS)
    # a pulse's flank is as wide as a sample, 0.18 degrees
    assert 360 * SPEED * (moved - usual) == pytest.approx([degrees] * len(usual), abs=0.1)
    assert np.array_equal(late.signal[0], recording.signal[0])


def test_other_rows_of_the_signal(recording):
    wave = recording.signal[0]
    assert applied(recording, "start", "").signal.shape[1] == FS - FS / SPEED
    coarse = applied(recording, "converter", "12 bits").signal[0]
    step = 4 * wave.max() / 2**12
    assert 0.4 * step < np.abs(coarse - wave).max() <= 0.501 * step
    # 440 Hz is far below either edge, and the mean is kept
    assert applied(recording, "mounting", "").signal[0].mean() == pytest.approx(7, abs=0.01)
    ratio = applied(recording, "mounting", "").signal[0].std() / wave.std()
    assert ratio == pytest.approx(1 / (1 - (440 / 7e3) ** 2), rel=1e-3)
    assert applied(recording, "anti", "").signal[0].std() == pytest.approx(wave.std(), rel=1e-3)


def test_a_probe_has_no_mounted_resonance(recording):
    probe = replace(recording.channels[0], quantity="displacement", unit="m")
    other = replace(recording, channels=(probe, recording.channels[1]))
    with pytest.raises(DataError, match="no channel is an acceleration"):
        applied(other, "mounting", "")


def test_a_background_comes_from_a_file(recording, tmp_path):
    from scipy.io import wavfile

    path = tmp_path / "hall.wav"
    tone = np.sin(math.tau * 100 * np.arange(4000) / 8000)  # half a second at 8 kHz
    wavfile.write(path, 8000, tone.astype(np.float32))
    noisy = applied(recording, "background hall.wav", "-20 dB", background=path)
    added = noisy.signal[0].astype(float) - recording.signal[0]
    assert added.std() == pytest.approx(0.1 * 3 / math.sqrt(2), rel=0.02)
    assert np.abs(np.fft.rfft(added)).argmax() == 100  # in one second
    wavfile.write(path, 8000, np.zeros(400, dtype=np.float32))
    with pytest.raises(DataError, match="silent"):
        signal_rows(path)


def test_a_background_keeps_the_unit_that_its_file_declares(recording, tmp_path):
    from scipy.io import savemat

    path = tmp_path / "hall.mat"
    rattle = np.random.default_rng(1).standard_normal((4000, 1))
    savemat(path, {"bearing": {"gs": rattle, "sr": 8000.0, "rate": 25, "load": "100"}})  # in g
    noisy = applied(recording, "background hall.mat", "-20 dB", background=path)
    added = noisy.signal[0].astype(float) - recording.signal[0]
    assert added.std() == pytest.approx(0.1 * 3 / math.sqrt(2), rel=0.02)


def test_a_model_that_cautions_always_is_told_so():
    table = {
        "baseline": {"clear_error": {"value": None}},
        "rows": [],
        "machines": 30,
        "recipe": "x",
        "usual_cautions": [],
    }
    lines = conclusion(table)
    assert lines == ["As trained, no verdict is without a caution (30 simulated machines of x)."]


# --- going on -------------------------------------------------------------------------------------


def test_a_run_is_gone_on_with(found, tmp_path, monkeypatch):
    rows = shifts_of("piston.mass", 1.0, 1.25)
    ways = {"machines": 2, "scenes": rows, "signals": gains()}
    path = tmp_path / "page.part.json"
    first = find_blind_spots(MODEL, PUMP, **ways, budget=1e-9, kept=kept_rows(path, "key"))
    assert (first.rows, len(first.left)) == ((), 3)
    assert first.baseline == found.baseline
    table = blind_spots_table(first, CARD)
    assert "Out of time, 3 rows not run: gain, piston.mass" in blind_spots_text(table)
    assert "fixed: piston.mass x 1.25" in blind_spots_html(table)

    steps = []
    say = lambda done, total: steps.append((done, total))  # noqa: E731
    again = find_blind_spots(MODEL, PUMP, **ways, kept=kept_rows(path, "key"), progress=say)
    assert again == found
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]

    monkeypatch.setattr(blindspots, "simulate_many", None)
    assert find_blind_spots(MODEL, PUMP, **ways, kept=kept_rows(path, "key")) == found


def test_amounts_carry_their_units():
    rows = [*scene_rows(load_recipe("bilge-pump-standard"))]
    rows += scene_rows(load_recipe("propulsion-shaft-standard"))
    told = {(row.name, row.shift) for row in rows}
    # 30 % of the range from -2 to 2 degrees beyond either end
    assert {("tacho.late", "above, = 3.2 deg"), ("tacho.late", "below, = -3.2 deg")} <= told
    assert {("bearings.*.offset", "-100 um"), ("bearings.*.offset", "+100 um")} <= told
    assert not [row for row in rows if "SI" in row.shift]


def test_rows_that_one_asks_for_are_those_of_the_whole_run(found):
    rows = shifts_of("piston.mass", 1.0, 1.25)
    ways = {"machines": 2, "scenes": rows, "signals": gains()}
    chosen = find_blind_spots(MODEL, PUMP, **ways, only=["mass x 1.25"])
    assert chosen.baseline == found.baseline
    assert [row.key for row in chosen.rows] == ["fixed: piston.mass x 1.25"]
    assert chosen.rows[0] in found.rows
    assert chosen.left == ()
    with pytest.raises(DataError, match=r"only = moss: no row .* there are gain, piston\.mass"):
        find_blind_spots(MODEL, PUMP, **ways, only=["mass", "moss"])


def test_rows_of_another_run_are_refused(tmp_path):
    path = tmp_path / "page.part.json"
    path.write_text('{"key": "other", "rows": []}')
    with pytest.raises(DataError, match=r"another model.*delete it, or use --force"):
        kept_rows(path, "key")
    path.write_text('{"key": "key"}')
    with pytest.raises(DataError, match=r"damaged.*delete it"):
        kept_rows(path, "key")


# --- figures --------------------------------------------------------------------------------------


def told(name, *errors, verdict="graded"):
    said = tuple(
        ShiftVerdict(
            machine=i, truth=1e-4, verdict=verdict, found=1e-4 + e * LIMIT, low=9e-5, high=1.1e-4
        )
        for i, e in enumerate(errors)
    )
    return ShiftRow(name=name, shift="x 2", kind="fixed", why="<why>", said=said)


REFUSED = ShiftRow(
    name="strange",
    shift="x 2",
    kind="drawn",
    why="",
    said=(
        ShiftVerdict(machine=0, truth=1e-4, verdict="unfamiliar", found=None, low=None, high=None),
    ),
)


def test_figures_of_a_row():
    row = told("a", 0.1, -0.2)
    other = replace(told("b", 0.6, verdict="caution").said[0], machine=2, high=1e-3)
    mixed = replace(row, said=(*row.said, other, replace(REFUSED.said[0], machine=3)))
    values = {name: each.value for name, each in row_figures(mixed, LIMIT).items()}
    assert values == pytest.approx(
        {
            "clear_error": 0.15,
            "error": 0.3,
            "bias": 0.5 / 3,
            "coverage": 1.0,
            "refused": 0.25,
            "cautioned": 0.25,
        }
    )
    narrow = replace(row, said=tuple(replace(s, high=s.truth / 2, low=1e-6) for s in row.said))
    assert row_figures(narrow, LIMIT)["coverage"].value == 0
    assert row_figures(row, LIMIT)["clear_error"].low == pytest.approx(0.1)
    assert row_figures(row, LIMIT)["clear_error"].high == pytest.approx(0.2)


def test_the_worst_without_a_caution_is_first():
    warned = told("warned", 0.8, verdict="caution")
    worse = told("worse", 0.9, verdict="caution")
    nothing = replace(REFUSED, name="nothing", said=(), faults=("no",))
    rows = [nothing, REFUSED, told("small", 0.01), warned, worse, told("large", 0.3)]
    rows.append(told("some", -0.1))
    order = [row.name for row in ranked(rows, LIMIT)]
    assert order == ["large", "some", "small", "worse", "warned", "strange", "nothing"]


def cautioned(name, error, *cautions):
    row = told(name, error, error, verdict="caution")
    return replace(row, said=tuple(replace(each, cautions=cautions) for each in row.said))


def test_a_caution_that_every_machine_has_as_trained_does_not_count():
    always, new = "its offsets are not told", "its load is outside"
    rows = [cautioned("told", 0.4, always, new), cautioned("silent", 0.2, always)]
    found = replace(spots(*rows), baseline=cautioned("as trained", 0.1, always))
    table = blind_spots_table(found, CARD)
    assert [row["name"] for row in table["rows"]] == ["silent", "told"]
    silent, loud = (
        {name: row[name]["value"] for name in ("clear_error", "cautioned")} for row in table["rows"]
    )
    assert silent == {"clear_error": pytest.approx(0.2), "cautioned": 0.0}
    assert loud == {"clear_error": None, "cautioned": 1.0}
    assert table["baseline"]["clear_error"]["value"] == pytest.approx(0.1)
    assert any("not counted: its offsets are not told." in line for line in conclusion(table))


def test_a_caution_of_some_machines_counts():
    warned = cautioned("as trained", 0.1, "a")
    some = replace(warned, said=(*warned.said[:1], *told("", 0.1).said))
    table = blind_spots_table(replace(spots(cautioned("row", 0.2, "a")), baseline=some), CARD)
    assert table["usual_cautions"] == []
    assert table["rows"][0]["cautioned"]["value"] == 1.0


def spots(*rows):
    baseline = replace(told("as trained", 0.02, -0.03), kind="as trained", shift="")
    return blindspots.BlindSpots(
        recipe="<recipe>", baseline=baseline, rows=rows, left=("fixed: z",)
    )


def test_page_text_and_json():
    table = blind_spots_table(spots(told("small", 0.01), REFUSED, told("large", 0.3)), CARD)
    assert [row["name"] for row in table["rows"]] == ["large", "small", "strange"]
    assert table["rows"][2]["clear_error"] == {"value": None, "low": None, "high": None}
    json.dumps(table, allow_nan=False)
    text = blind_spots_text(table)
    assert "As trained, the error without a caution is 2.5 % of the condemning limit" in text
    assert "Largest error without a caution: large x 2, 30.0 %." in text
    page = blind_spots_html(table, notice="trained on simulation")
    assert "&lt;recipe&gt;" in page
    assert "<recipe>" not in page
    assert page.count("data:image/png;base64,") == 1
    assert "simulated" in page
    assert page.index("<td>large") < page.index("<td>small") < page.index("<td>strange")


# --- the recipe -----------------------------------------------------------------------------------


def card(**changes):
    return SimpleNamespace(
        card=SimpleNamespace(**{**vars(CARD), **changes}), noted=(), estimate=loudness
    )


@pytest.mark.parametrize(
    ("model", "name", "words"),
    [
        (
            card(trained_on=SimpleNamespace(recipe="own")),
            None,
            "recipe = 'own' is not built in.*--recipe",
        ),
        (card(trained_on=SimpleNamespace(recipe="")), None, "trained on no recipe.*--recipe"),
        (card(mode="referenced"), None, "must be 'cold'; train one without --baseline"),
        (card(views={"running": {}}), None, "running must be none; train one without --join"),
        (MODEL, "journal-bearing-small", "another severity.*diametral_clearance_crankpin_m.*--rec"),
        (card(sample_rate_hz=1.0), None, "another sample_rate"),
        (card(channels=[SimpleNamespace(name="a", unit="V")]), None, "another channels"),
        (MODEL, "no-such-recipe", "no-such-recipe"),
    ],
)
def test_a_recipe_that_does_not_fit_is_refused(model, name, words):
    with pytest.raises(ValueError, match=f"(?s){words}"):
        recipe_of(model, name)


def test_the_recipe_of_the_card():
    assert recipe_of(MODEL).name == "bilge-pump-narrow"
    assert (
        recipe_of(card(trained_on=SimpleNamespace(recipe="own")), "bilge-pump-small").name
        == "bilge-pump-small"
    )


# --- the command ----------------------------------------------------------------------------------


def run(*arguments):
    return CliRunner().invoke(cli, ["blindspots", *map(str, arguments)])


@pytest.fixture
def stub(tmp_path, monkeypatch):
    """A model file that is none: loading it gives the stand-in."""
    told = SimpleNamespace(card=CARD, noted=(), estimate=loudness, notice="trained on simulation")
    monkeypatch.setattr("wearstate.diagnose.wear_model.bundle.kind_of", lambda path: "wear")
    monkeypatch.setattr("wearstate.diagnose.wear_model.file.load_model", lambda path: told)
    path = tmp_path / "model.wsm"
    path.write_bytes(b"stub")
    return path


def test_the_command_goes_on_where_time_ended(stub, tmp_path):
    page, part = tmp_path / "page.html", tmp_path / "page.part.json"
    ways = (stub, "-n", 1, "--budget", 0.001, "-o", page)
    first = run(*ways, "--json")
    assert first.exit_code == 0, first.output
    table = json.loads(first.stdout)
    assert (table["machines"], table["rows"]) == (1, [])
    assert "fixed: pressure.rise_delay = 6 deg" in table["left"]
    assert "Not run: out of time" in page.read_text()
    before = part.read_bytes()

    again = run(*ways, "--json")
    assert json.loads(again.stdout) == table
    assert part.read_bytes() == before
    other = run(*ways, "-n", 2)
    assert other.exit_code == 2
    assert "--force" in other.stderr
    anew = run(*ways, "-n", 2, "--force")
    assert anew.exit_code == 0
    assert "(2 simulated machines of bilge-pump-narrow)" in anew.stdout


def test_a_finished_run_leaves_no_rows_behind(stub, tmp_path, monkeypatch):
    monkeypatch.setattr(blindspots, "scene_rows", lambda recipe: shifts_of("rod.mass", 1.2))
    page = tmp_path / "page.html"
    assert run(stub, "-n", 1, "-o", page).exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.wsm", "page.html"]
    assert "rod.mass" in page.read_text()
    once_more = run(stub, "-n", 1, "-o", page)
    assert once_more.exit_code == 2
    assert "exists" in once_more.stderr


def test_the_command_refuses_what_does_not_fit(stub, tmp_path):
    wrong = run(stub, "--recipe", "journal-bearing-small", "-o", tmp_path / "a.html")
    assert wrong.exit_code == 2
    assert "another severity" in wrong.stderr
    assert run(stub, "-o", tmp_path / "a.txt").exit_code == 2
    none = run(stub, "--only", "wheel", "-o", tmp_path / "a.html")
    assert none.exit_code == 2
    assert "only = wheel: no row has this name; there are" in none.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["model.wsm"]


def test_a_trained_model_is_judged(small_model):
    done = run(small_model, "-n", 1, "--budget", 0.001, "--json")
    assert done.exit_code == 0, done.output
    table = json.loads(done.stdout)
    assert table["recipe"] == "bilge-pump-small"
    [said] = table["baseline"]["said"]
    assert said["verdict"] in ("graded", "caution")
    assert abs(said["found"] - said["truth"]) < 0.5 * LIMIT


def test_conditions_can_be_left_out():
    row = next(row for row in signal_rows() if row.name == "conditions")
    recording = Recording(
        signal=np.zeros((1, 8)),
        sample_rate=8.0,
        channels=(Channel(name="a", unit="m/s^2", quantity="acceleration"),),
        row={"viscosity_pa_s": 0.03, "speed_hz": 5.0},
    )
    assert row.apply(recording, 5.0, np.random.default_rng(0)).row == {"speed_hz": 5.0}
