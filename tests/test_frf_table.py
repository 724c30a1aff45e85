"""Measured accelerance: files, pairs, between the lines, and the acceleration it gives."""

import pickle
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.sim.casing.casing_frf import (
    FEWEST_LINES,
    Accelerance,
    find_file,
    load_accelerance,
    read_frf_table,
)
from wearstate.sim.casing.decimation import edge_samples
from wearstate.sim.casing.measured_casing import MeasuredCasing
from wearstate.sim.casing.modes import CasingModes, ModalCasing
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.parts.casing import FrfFile, with_folder
from wearstate.sim.scene.load import load_scene, scene_from_table, scene_table, scene_text
from wearstate.sim.scene.scene import SceneError

FS = 25_600.0
FACTOR = 2
INPUTS = [("bearing_x", 1), ("guide_y", 1)]
SENSORS = ["acc_x", "acc_y"]

MODES = CasingModes(
    frequency=np.array([142.0, 815.0, 2240.0, 7620.0]),
    damping_ratio=np.array([0.04, 0.02, 0.018, 0.015]),
    inputs=np.array([[0.05, 0.13], [0.06, -0.09], [-0.07, 0.11], [0.08, 0.06]]),
    outputs=np.array([[0.06, 0.13], [0.07, -0.11], [-0.06, 0.12], [0.07, -0.08]]),
)


def modal_accelerance(f, modes=MODES):
    """Closed form, [shape=(n_outputs, n_inputs, n_frequencies)]."""
    r = np.asarray(f) / modes.frequency[:, None]
    unit = -(r**2) / (1 - r**2 + 2j * modes.damping_ratio[:, None] * r)
    return np.einsum("mo,mi,mf->oif", modes.outputs, modes.inputs, unit)


def table_of(modes, spacing, top, first=0.0):
    f = np.arange(first, top + spacing / 2, spacing)
    return Accelerance(frequency=f, values=modal_accelerance(f, modes))


def resonance(frequency, damping_ratio, shape=1.0):
    return CasingModes(
        frequency=np.array([frequency]),
        damping_ratio=np.array([damping_ratio]),
        inputs=np.array([[shape]]),
        outputs=np.array([[1.0]]),
    )


def text_of(frequency, values, delimiter=",", comma="."):
    """CSV of a table, with the sensors and places of this file."""
    names = [f"{s}/{place}" for s in SENSORS for place, _ in INPUTS]
    header = ["frequency_hz", *(f"{name} {part}" for name in names for part in ("real", "imag"))]
    flat = values.reshape(len(names), -1)
    parts = np.stack([flat.real, flat.imag], axis=1).reshape(2 * len(names), -1)
    lines = [delimiter.join(header)]
    for row in np.vstack([frequency, parts]).T:
        lines.append(delimiter.join(repr(float(v)).replace(".", comma) for v in row))
    return "\n".join(lines)


F = np.arange(0.0, 13_001.0, 4.0)


@pytest.fixture(scope="module")
def pump_csv(tmp_path_factory):
    path = tmp_path_factory.mktemp("frf") / "pump.csv"
    path.write_text(text_of(F, modal_accelerance(F)), encoding="utf-8")
    return path


def faults_of(call):
    with pytest.raises(SceneError) as caught:
        call()
    return caught.value.faults


# --- between the lines


def test_the_lines_themselves_are_kept():
    table = table_of(MODES, 4.0, 13_000.0)
    # Nothing is lost on the way to the time domain and back: rounding of 3,000 lines.
    assert_allclose(table.at(table.frequency), table.values, rtol=0, atol=1e-12)


@pytest.mark.parametrize("first", [0.0, 4.0, 20.0])
def test_a_resonance_between_two_lines_is_found_again(first):
    # exp(-0.04 * 2 pi 142 / 4 * 15/16) = 2.4e-4 of the slowest response is left after the part of
    # 1 / spacing that is kept for it; it is missed there, and stands where it does not belong.
    table = table_of(MODES, 4.0, 13_000.0, first)
    f = np.arange(0.0, 12_000.0, 0.5)
    expected = modal_accelerance(f)
    above = f >= first
    largest = np.abs(expected).max()
    error = np.abs(table.at(f) - expected)[..., above]
    assert error.max() < 2 * 2.4e-4 * largest
    # ... while straight lines between the lines lose it: the test would see them.
    straight = np.interp(f[above], table.frequency, table.values[0, 0].real)
    assert np.abs(straight - expected[0, 0, above].real).max() > 1e-2 * np.abs(expected[0, 0]).max()


def test_below_the_first_line_the_square_of_frequency():
    table = table_of(MODES, 1.0, 13_000.0, 20.0)
    f = np.arange(0.0, 20.0, 1.0)
    low = table.at(np.arange(0.0, 100.0))[..., :20]
    assert_allclose(low, table.values[..., :1] * (f / 20.0) ** 2, rtol=0, atol=1e-12)


def test_above_the_last_line_nothing():
    table = table_of(MODES, 4.0, 10_000.0)
    f = np.arange(0.0, 12_000.0, 4.0)
    assert np.all(table.at(f)[..., f > 10_000.0] == 0)
    # The end of the table does not disturb what lies below it.
    assert_allclose(table.at(f)[..., :2501], table.values, rtol=0, atol=1e-12)


@pytest.mark.parametrize("top", [6000.0, 9999.5])
def test_uneven_lines_at_the_order_of_cubic_splines(top):
    asked = np.arange(0.0, 5900.0, 1.0)
    expected = modal_accelerance(asked)
    errors = []
    for step in (0.01, 0.005):  # closer at the low modes, as a swept sine
        f = np.geomspace(5.0, top, int(np.log(top / 5.0) / np.log(1 + step)))
        table = Accelerance(frequency=f, values=modal_accelerance(f))
        errors.append(np.abs(table.at(asked) - expected)[..., asked > 5].max())
    # Lines 0.01 f apart on a resonance 0.036 f wide: 1.5 % of its peak measured.
    assert errors[0] < 0.03 * np.abs(expected).max()
    # Fourth order: 16; not all lines fall alike on the peaks.
    assert errors[1] < errors[0] / 10


@given(
    st.floats(60.0, 400.0),
    st.floats(0.03, 0.3),
    st.floats(0.5, 2.0),
    st.floats(0.0, 0.9),
)
@settings(max_examples=25, deadline=None)
def test_any_resonance_is_within_its_late_response(natural, zeta, spacing, offset):
    unit = resonance(natural, zeta)
    f = np.arange(0.0, 1500.0, spacing)
    table = Accelerance(frequency=f, values=modal_accelerance(f, unit))
    asked = np.arange(0.0, 1400.0, spacing * (0.1 + offset))
    expected = modal_accelerance(asked, unit)[0, 0]
    left = np.exp(-zeta * 2 * np.pi * natural / spacing)
    # What has not died away folds back, at most as large as it is; 15/16 of the length count.
    # 1e-3: the constant roll-off above the table bends the curve at its end.
    bound = (2 * left ** (15 / 16) + 1e-3) * np.abs(expected).max() / (1 - left)
    assert np.abs(table.at(asked)[0, 0] - expected).max() < bound


def test_late_share_tells_when_the_lines_are_too_far_apart():
    shares = [table_of(MODES, spacing, 13_000.0).late_share() for spacing in (1, 4, 16)]
    # Decay of the slowest mode over half the length, twice for the energy: at 16 Hz it is
    # exp(-0.04 * 2 pi 142 / 16) = 0.1, of a mode that holds a hundredth of the energy.
    assert shares[0] < 1e-12
    assert shares[1] < 1e-5
    assert 1e-4 < shares[2] < 1e-1


# --- the acceleration


def blows(n_steps, rate, seed=0):
    """Reversals of half a millisecond, at random times, on a slow force."""
    rng = np.random.default_rng(seed)
    time = np.arange(n_steps) / rate
    forces = np.stack([2e3 + 500 * np.sin(2 * np.pi * 5 * time), -800 * np.cos(31 * time)], axis=1)
    for at, high in zip(rng.uniform(0.05, time[-1], 12), rng.normal(0, 3e3, (12, 2)), strict=True):
        forces += np.exp(-0.5 * ((time - at) / 60e-6) ** 2)[:, None] * high
    return forces


def through(kind, casing, means):
    """What a casing makes of forces, step by step."""
    moving = kind(casing, FACTOR * FS, FACTOR, len(means))
    moving.add(means.T)
    return moving.finish()


@pytest.mark.parametrize(("spacing", "top"), [(1.0, 12_800.0), (1.0, 20_000.0), (4.0, 13_000.0)])
def test_a_table_of_known_modes_gives_their_acceleration(spacing, top):
    rate = FACTOR * FS
    means = blows(int(0.8 * rate), rate)
    expected = through(ModalCasing, MODES, means)
    run = through(MeasuredCasing, table_of(MODES, spacing, top), means)
    edge = edge_samples(FACTOR)
    inside = slice(edge, -edge)
    error = (run.acceleration - expected)[:, inside]
    relative = np.sqrt(np.mean(error**2) / np.mean(expected[:, inside] ** 2))
    print(f"\ntable against modes, lines {spacing:g} Hz apart to {top:g} Hz: {relative:.1e} rms")
    # The seven taps that make up for the straight lines of the modes leave up to 4e-3 of what the
    # springs take back, at the top of the band, where these forces hold a hundredth.
    assert relative < 2e-4
    assert run.acceleration.shape == expected.shape
    assert run.force_share_above == 0


def test_a_blow_on_one_resonance_is_its_impulse_response():
    """Sign, phase, time and level against the closed form."""
    natural, zeta, mass = 500.0, 0.03, 4.0
    n, hit = 8000, 4000
    means = np.zeros((n * FACTOR, 1))
    means[hit * FACTOR] = 1.0 * FACTOR * FS  # 1 N s within one step
    unit = resonance(natural, zeta, 1 / mass)
    run = through(MeasuredCasing, table_of(unit, 2.0, 12_800.0), means)
    w, wd = 2 * np.pi * natural, 2 * np.pi * natural * np.sqrt(1 - zeta**2)
    time = np.arange(1, 3000) / FS
    decay = np.exp(-zeta * w * time)
    # the second derivative of exp(-zeta w t) sin(wd t) / (m wd)
    free = decay * (
        ((zeta * w) ** 2 - wd**2) * np.sin(wd * time) - 2 * zeta * w * wd * np.cos(wd * time)
    )
    expected = free / (mass * wd)
    # Near the blow the band edge rings, as 1 / time; the free decay is what is compared, over
    # means of eight samples, which the ringing at half the rate does not pass.
    found = run.acceleration[0, hit + 1 : hit + 3000]
    smooth = np.ones(8) / 8
    there, here = (np.convolve(x, smooth, "valid")[40:] for x in (expected, found))
    assert_allclose(here, there, rtol=0, atol=2e-3 * w / mass)
    # Nothing before the blow but that ringing.
    before = np.convolve(run.acceleration[0, : hit - 40], smooth, "valid")
    assert np.abs(before).max() < 2e-3 * w / mass


def test_the_end_does_not_wrap_round_to_the_beginning():
    n = 4000
    means = np.zeros((n * FACTOR, 2))
    means[-60 * FACTOR :] = 5e3
    run = through(MeasuredCasing, table_of(MODES, 4.0, 13_000.0), means)
    assert np.abs(run.acceleration[:, -40:]).max() > 10
    # The brick wall of the band edge, 1 / (pi 2000) of the jump at the worst.
    assert np.abs(run.acceleration[:, :2000]).max() < 2e-3 * np.abs(run.acceleration).max()


def test_a_constant_force_is_in_balance_with_a_mounted_casing():
    means = np.full((3000, 2), 4e3)
    run = through(MeasuredCasing, table_of(MODES, 4.0, 13_000.0), means)
    assert_allclose(run.acceleration, 0.0, atol=1e-9)  # rounding of 4 kN through 3,000 lines


def test_a_floating_casing_recoils_with_its_mass():
    f = np.arange(0.0, 13_000.0, 8.0)
    free = Accelerance(frequency=f, values=np.full((1, 1, len(f)), 1 / 60.0 + 0j))
    time = np.arange(6000) / (FACTOR * FS)
    means = 500 + 300 * np.sin(2 * np.pi * 20 * time)[:, None]
    run = through(MeasuredCasing, free, means)
    edge = edge_samples(FACTOR)
    # Row k is the middle of step k * factor; 1e-3: ripple of the decimation.
    assert_allclose(
        run.acceleration[0, edge:-edge], means[::FACTOR, 0][edge:-edge] / 60.0, rtol=2e-3
    )


def test_the_share_of_force_above_the_table():
    n, edge = 30_000, edge_samples(FACTOR)
    time = (np.arange(n * FACTOR) + 0.5) / (FACTOR * FS)
    low, high = 3.0 * np.sin(2 * np.pi * 2000 * time), 4.0 * np.sin(2 * np.pi * 9000 * time)
    means = np.stack([700 + low + high, np.full(len(time), -2e3)], axis=1)
    run = through(MeasuredCasing, table_of(MODES, 4.0, 6400.0), means)
    # The forces are given as point values, not means: decimation lifts them by 1 / sinc.
    lift = np.sinc(np.array([2000.0, 9000.0]) / (FACTOR * FS)) ** -2
    expected = 16 * lift[1] / (9 * lift[0] + 16 * lift[1])
    # The ends of the sines, one sample in 10,000, and the fall after the last one: half a value
    # over some 6,000 samples, at low frequency and not above the table.
    assert_allclose(run.force_share_above, expected, rtol=2e-3)
    settled = run.acceleration[0, 2000 : n - 10 * edge]
    spectrum = np.abs(np.fft.rfft(settled * np.hanning(len(settled))))
    f = np.fft.rfftfreq(len(settled), 1 / FS)
    assert spectrum[f > 6500].max() < 1e-4 * spectrum[f < 6300].max()


# --- files


def test_csv_is_read(pump_csv):
    table = read_frf_table(pump_csv)
    assert_array_equal(table.frequency, F)
    assert_array_equal(table.pairs["acc_y/bearing_x"], modal_accelerance(F)[1, 0])
    assert sorted(table.pairs) == [f"{s}/{p}" for s in SENSORS for p in ("bearing_x", "guide_y")]
    assert len(table.sha256) == 64


@pytest.mark.parametrize(("delimiter", "comma"), [(";", "."), (";", ","), (",", ".")])
def test_csv_dialects(tmp_path, delimiter, comma):
    text = text_of(F, modal_accelerance(F), delimiter, comma).replace("\n", "\r\n")
    path = tmp_path / "pump.CSV"
    path.write_text("\ufeff# measured on the bench\r\n" + text, encoding="utf-8", newline="")
    table = read_frf_table(path)
    assert_array_equal(table.pairs["acc_x/guide_y"], modal_accelerance(F)[0, 1])


GOOD = "frequency_hz,acc_x/bearing_x real,acc_x/bearing_x imag\n" + "\n".join(
    f"{k},1.0,0.5" for k in range(FEWEST_LINES)
)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("frequency_hz", "hertz", "has no column 'frequency_hz'; the first line"),
        ("frequency_hz", "hertz", "column 'hertz' must be like 'acc_x/bearing_x real'; rename"),
        ("acc_x/bearing_x imag", "phase", "column 'phase' must be like"),
        ("acc_x/bearing_x imag", "phase", "column 'acc_x/bearing_x imag' is missing next to"),
        ("bearing_x imag", "bearing_x real", "column 'acc_x/bearing_x real' is given twice"),
        ("\n3,1.0,0.5", "\n3,1.0,nan", "at 3 Hz, must be finite; measure that line again"),
        ("\n3,", "\nnan,", "has a frequency that is not finite; remove the line"),
        ("\n3,", "\n2,", "2 Hz follows 2 Hz, must rise from line to line; sort"),
        ("\n0,", "\n-1,", "has a frequency of -1 Hz, must be >= 0; remove"),
        ("\n3,1.0,0.5", "", f"has {FEWEST_LINES - 1} lines, must have >= {FEWEST_LINES}; measure"),
        ("\n3,1.0,0.5", "\n3,1.0,half", "below the header: could not convert string 'half'"),
        ("\n3,1.0,0.5", "\n3,1.0", "below the header: the number of columns changed"),
        (",acc_x/bearing_x real,acc_x/bearing_x imag", "", "must have 1 as the header; fix"),
        (GOOD, "# nothing\n", "is empty; it needs a header"),
        (GOOD, "frequency_hz\n1\n", "has no pair; add two columns"),
    ],
)
def test_broken_csv(tmp_path, old, new, says):
    assert GOOD.count(old) == 1
    path = tmp_path / "pump.csv"
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    faults = faults_of(lambda: read_frf_table(path))
    assert any(says in fault for fault in faults), faults
    assert all(fault.startswith("casing.frf.file = 'pump.csv': ") for fault in faults)


def test_files_that_are_none(tmp_path):
    (tmp_path / "pump.xls").write_bytes(b"")
    [fault] = faults_of(lambda: read_frf_table(tmp_path / "pump.xls"))
    assert "suffix must be one of .csv, .txt, .uff, .unv, .uf; convert" in fault
    (tmp_path / "pump.csv").write_bytes(b"\xff\xfe\x00")
    [fault] = faults_of(lambda: read_frf_table(tmp_path / "pump.csv"))
    assert "is no UTF-8 text; save it as UTF-8" in fault


# --- pairs


def picked(path, sensors=SENSORS, inputs=INPUTS, **frf):
    return load_accelerance(FrfFile(file=str(path), **frf), sensors, inputs)


def test_pairs_in_the_order_asked_for(pump_csv):
    found = picked(pump_csv, ["acc_y", "acc_x"], [("guide_y", 1), ("bearing_x", 1)])
    assert_array_equal(found.values, modal_accelerance(F)[::-1, ::-1])


def test_missing_pairs_are_named_all_at_once_with_the_nearest(pump_csv):
    faults = faults_of(lambda: picked(pump_csv, ["acc_x", "acc"], [("guide", 1), ("guide_y", 1)]))
    assert len(faults) == 3
    assert "has no pair 'acc_x/guide', must have one; map it in casing.frf.pairs" in faults[0]
    assert faults[0].endswith("to ignore its force; did you mean 'acc_x/guide_y'?")


def test_a_place_left_out_is_silent(pump_csv):
    found = picked(pump_csv, inputs=[*INPUTS, ("suction_valve", 2)], without=("suction_valve",))
    assert_array_equal(found.values[:, 2], 0)
    assert_array_equal(found.values[:, :2], modal_accelerance(F))


def test_the_pair_of_one_throw_wins(pump_csv):
    found = picked(
        pump_csv,
        ["acc_x"],
        [("bearing_x", 1), ("bearing_x", 2), ("bearing_x", 3)],
        pairs={"acc_x/bearing_x_2": "acc_y/guide_y"},
    )
    h = modal_accelerance(F)
    assert_array_equal(found.values[0], [h[0, 0], h[1, 1], h[0, 0]])


def test_a_mapped_pair_that_the_file_lacks(pump_csv):
    [fault] = faults_of(lambda: picked(pump_csv, pairs={"acc_x/bearing_x": "acc_x/bearng_x"}))
    assert fault.startswith("casing.frf.pairs.acc_x/bearing_x = 'acc_x/bearng_x' is no pair of")
    assert fault.endswith("did you mean 'acc_x/bearing_x'?")


def test_a_conjugated_table_is_refused(tmp_path):
    path = tmp_path / "pump.csv"
    path.write_text(text_of(F, modal_accelerance(F).conj()), encoding="utf-8")
    [fault] = faults_of(lambda: picked(path))
    assert "the responses come before the blow, must come after it" in fault


def test_a_bare_mass_is_not_taken_for_a_conjugated_table(tmp_path):
    path = tmp_path / "pump.csv"
    path.write_text(text_of(F, np.full((2, 2, len(F)), 1 / 60 + 0j)), encoding="utf-8")
    assert_array_equal(picked(path).values, 1 / 60)


def test_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "pump.csv"
    path.write_text(text_of(F, modal_accelerance(F)), encoding="utf-8")
    before = picked(path)
    path.write_text(text_of(F, 2.5 * modal_accelerance(F)) + "\n", encoding="utf-8")
    after = picked(path)
    assert_array_equal(after.values, 2.5 * modal_accelerance(F))
    assert before.sha256 != after.sha256


# --- where the file is


def test_beside_the_scene_first_then_the_working_directory(tmp_path, monkeypatch):
    there, here = tmp_path / "scenes", tmp_path / "work"
    for folder in (there, here):
        folder.mkdir()
        (folder / "pump.csv").write_text("x", encoding="utf-8")
    monkeypatch.chdir(here)
    frf = FrfFile(file="pump.csv", folder=str(there))
    assert find_file(frf) == there / "pump.csv"
    (there / "pump.csv").unlink()
    assert find_file(frf).resolve() == here / "pump.csv"
    (here / "pump.csv").unlink()
    [fault] = faults_of(lambda: find_file(frf))
    assert fault.startswith(
        "casing.frf.file = 'pump.csv' must be a file; it is neither next to the scene"
    )
    [fault] = faults_of(lambda: find_file(FrfFile(file="pump\0.csv")))
    assert "must be a file" in fault


# --- UFF


PYUFF_RECORD = {
    "func_type": 4,
    "rsp_node": 12,
    "rsp_dir": 1,
    "ref_node": 3,
    "ref_dir": -2,
    "abscissa_spec_data_type": 18,
    "ordinate_spec_data_type": 12,
    "orddenom_spec_data_type": 13,
}


def write_uff(path, *records, units=None):
    pyuff = pytest.importorskip("pyuff")
    sets = [pyuff.prepare_58(**{**PYUFF_RECORD, **_uff_numbers(record)}) for record in records]
    if units:
        sets.append(
            pyuff.prepare_164(
                units_code=9,
                units_description="bench",
                temp_mode=1,
                length=units[0],
                force=units[1],
                temp=1.0,
                temp_offset=0.0,
            )
        )
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
    return path


def _uff_numbers(record):
    x = record.get("x", F)
    data = record.get("data", modal_accelerance(x)[0, 0])
    return {
        "binary": 0,
        "ord_data_type": 6,
        "abscissa_spacing": 1,
        "num_pts": len(x),
        "abscissa_min": x[0],
        "abscissa_inc": x[1] - x[0],
        **record,
        "x": x,
        "data": data,
    }


def test_uff_by_degrees_of_freedom(tmp_path):
    path = write_uff(tmp_path / "pump.uff", {}, {"ref_dir": 3, "data": modal_accelerance(F)[0, 1]})
    table = read_frf_table(path)
    h = modal_accelerance(F)
    tolerance = {"rtol": 0, "atol": 1e-12}  # twelve digits in the file
    assert_allclose(table.frequency, F)
    assert_allclose(table.pairs["12:+X/3:-Y"], h[0, 0], **tolerance)
    assert_allclose(table.pairs["12:+X/3:+Z"], h[0, 1], **tolerance)
    # A blow the other way, or a sensor turned round, turns the sign; both together do not.
    assert_allclose(table.pairs["12:+X/3:+Y"], -h[0, 0], **tolerance)
    assert_allclose(table.pairs["12:-X/3:-Y"], -h[0, 0], **tolerance)
    assert_allclose(table.pairs["12:-X/3:+Y"], h[0, 0], **tolerance)


def test_uff_in_a_scene_table_of_pairs(tmp_path):
    path = write_uff(tmp_path / "pump.uff", {})
    found = picked(path, ["acc_x"], INPUTS[:1], pairs={"acc_x/bearing_x": "12:+X/3:+Y"})
    assert_allclose(found.values[0, 0], -modal_accelerance(F)[0, 0], rtol=0, atol=1e-12)


def test_uff_by_entity_names(tmp_path):
    names = {"rsp_ent_name": "acc_x", "ref_ent_name": "bearing_x"}
    found = picked(write_uff(tmp_path / "pump.uff", names), ["acc_x"], INPUTS[:1])
    assert_allclose(found.values[0, 0], modal_accelerance(F)[0, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("labels", "units", "factor"),
    [
        ({}, None, 1.0),
        ({"ordinate_axis_units_lab": "g", "orddenom_axis_units_lab": "N"}, None, 9.80665),
        ({"ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "kN"}, None, 1e-3),
        # millimetres and newtons: 1000 file units to the metre
        ({}, (1000.0, 1.0), 1e-3),
        ({"ordinate_axis_units_lab": "m/s^2"}, (1000.0, 1.0), 1.0),  # the label wins
    ],
)
def test_uff_units(tmp_path, labels, units, factor):
    table = read_frf_table(write_uff(tmp_path / "pump.uff", labels, units=units))
    expected = factor * modal_accelerance(F)[0, 0]
    assert_allclose(table.pairs["12:+X/3:-Y"], expected, rtol=0, atol=1e-11 * factor)


@pytest.mark.parametrize(
    ("records", "says"),
    [
        ([{"ordinate_spec_data_type": 11}], "has the quantity 11, must be acceleration (12)"),
        ([{"orddenom_spec_data_type": 12}], "is over the quantity 12, must be force (13)"),
        ([{"abscissa_spec_data_type": 17}], "is over the abscissa 17, must be frequency (18)"),
        ([{"func_type": 6}], "has no frequency response function (58, type 4)"),
        (
            [{}, {"ref_dir": 3, "x": F[:-1]}],
            "has other lines than '12:+X/3:-Y', export them with",
        ),
        ([{}, {}], "has '12:+X/3:-Y' twice; export one of them"),
        ([{"ordinate_axis_units_lab": "inch/s^2"}], "is in 'inch/s^2', must be one of m/s^2"),
    ],
)
def test_uff_that_cannot_be_used(tmp_path, records, says):
    path = write_uff(tmp_path / "pump.uff", *records)
    faults = faults_of(lambda: read_frf_table(path))
    assert any(says in fault for fault in faults), faults


def test_a_text_is_no_universal_file(tmp_path):
    pytest.importorskip("pyuff")
    path = tmp_path / "pump.uff"
    path.write_text(GOOD, encoding="utf-8")
    [fault] = faults_of(lambda: read_frf_table(path))
    assert fault.startswith("casing.frf.file = 'pump.uff': ")


def test_uff_without_its_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyuff", None)
    (tmp_path / "pump.uff").write_text("x", encoding="utf-8")
    [fault] = faults_of(lambda: read_frf_table(tmp_path / "pump.uff"))
    assert "needs pyuff, which is not installed; pip install 'wearstate[uff]', or use CSV" in fault


# --- scenes


def pump_with(frf, **changes):
    table = scene_table(scene_text("bilge-pump"))
    table["casing"] = {"frf": frf} if frf else {}
    return scene_from_table({**table, **changes})


def write_pump(path, spacing=2.0, top=13_000.0):
    """Accelerance of the built-in pump's own modes."""
    pump = load_scene("bilge-pump")
    sensors = [sensor.name for sensor in pump.sensors]
    places = ["bearing_x", "bearing_y", "guide_y", "cylinder_x"]
    f = np.arange(0.0, top + spacing / 2, spacing)
    columns, header = [f], ["frequency_hz"]
    for sensor in sensors:
        for place in places:
            h = np.zeros(len(f), dtype=complex)
            for mode in pump.casing.modes:
                r = f / mode.frequency
                unit = -(r**2) / (1 - r**2 + 2j * mode.damping_ratio * r)
                h += mode.shape[sensor] * mode.shape[place] * unit
            columns += [h.real, h.imag]
            header += [f"{sensor}/{place} real", f"{sensor}/{place} imag"]
    np.savetxt(path, np.array(columns).T, delimiter=",", header=",".join(header), comments="")
    return path


def test_a_recording_through_the_table_is_that_through_the_modes(tmp_path):
    quiet = {"duration": "0.25 s", "sensors.0.noise": 0, "sensors.1.noise": 0}
    modal = load_scene("bilge-pump", quiet)
    file = write_pump(tmp_path / "pump.csv")
    table = modal.model_dump() | {"casing": {"frf": {"file": str(file)}}}
    by_modes, by_table = simulate(modal, seed=1), simulate(scene_from_table(table), seed=1)
    error = (by_table.signal - by_modes.signal)[:2]
    # As above; the forces of the pump hold less of the top band: 2e-5 measured.
    assert np.sqrt(np.mean(error**2) / np.mean(by_modes.signal[:2] ** 2)) < 2e-4
    assert len(by_table.numerics["frf_sha256"]) == 64
    assert by_table.numerics["frf_force_share_above"] == 0
    assert by_table.numerics["frf_late_share"] < 1e-6
    assert by_table.numerics["frf_top_hz"] == 13_000.0
    assert not any(name.startswith("frf") for name in by_modes.numerics)


def test_a_table_below_the_pass_band_is_told_in_the_numerics(tmp_path):
    file = write_pump(tmp_path / "pump.csv", top=3000.0)
    run = simulate(pump_with({"file": str(file)}, duration="0.25 s"), seed=1)
    assert run.numerics["frf_top_hz"] == 3000.0
    assert 0 < run.numerics["frf_force_share_above"] < 0.05


def test_exactly_one_of_modes_and_frf():
    [fault] = faults_of(lambda: pump_with(None))
    assert "neither given, must be exactly one of casing.modes and casing.frf; add one" in fault
    [fault] = faults_of(lambda: load_scene("bilge-pump", {"casing.frf": {"file": "pump.csv"}}))
    assert "casing.modes and casing.frf given, must be exactly one of" in fault


def test_a_scene_with_a_table_is_frozen_and_its_dump_names_no_folder(tmp_path):
    frf = {"file": "pump.csv", "pairs": {"acc_x/guide_y_1": "12:+X/3:+Y"}}
    table = {**scene_table(scene_text("bilge-pump")), "casing": {"frf": frf}}
    scene = scene_from_table(with_folder(table, tmp_path))
    assert scene.casing.frf.folder == str(tmp_path)
    assert hash(scene) == hash(pickle.loads(pickle.dumps(scene)))
    assert pickle.loads(pickle.dumps(scene)) == scene  # a worker finds the file too
    assert str(tmp_path) not in scene.model_dump_json()
    assert with_folder({"name": "x"}, tmp_path) == {"name": "x"}


@pytest.mark.parametrize(
    ("frf", "says"),
    [
        ({"pairs": {"acc_z/guide_y": "a/b"}}, "casing.frf.pairs.acc_z/guide_y is no sensor/place"),
        ({"pairs": {"acc_x/guide_y_2": "a/b"}}, "did you mean 'acc_x/guide_y_1'?"),
        ({"without": ["guide"]}, "casing.frf.without: 'guide' is no place of this scene"),
        ({"fil": "pump.csv"}, "casing.frf.fil is an unknown key; did you mean 'file'?"),
    ],
)
def test_names_that_the_scene_does_not_have(frf, says):
    faults = faults_of(lambda: pump_with({"file": "pump.csv", **frf}))
    assert any(says in fault for fault in faults), faults


def test_check_names_the_missing_file():
    [fault] = faults_of(lambda: check(pump_with({"file": "pmup.csv"})))
    assert fault.startswith("casing.frf.file = 'pmup.csv' must be a file")
