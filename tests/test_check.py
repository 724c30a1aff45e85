"""`info --verify`: whatever is wrong in a data set file is found, and nothing that is right."""

import json
import re
import shutil
from itertools import chain
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.audit.integrity import (
    check_set,
    checked_table,
    checked_text,
    refuse_shared,
    refuse_wrong_labels,
)
from wearstate.datasets.file.attributes import HASHES, Attributes, manifest_hash, signal_checksum
from wearstate.datasets.file.columns import describe_columns, meanings
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.generation.work import NUMERICS
from wearstate.datasets.recipe.load import load_recipe
from wearstate.datasets.recipe.text import recipe_names
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.workflow.evaluate import evaluate
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

N = 8


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Eight records of four machines, with confounders per machine and per record."""
    path = tmp_path_factory.mktemp("made") / "data.h5"
    generate(load_recipe("bilge-pump-faults", {"duration": "0.3 s"}), N, path, seed=1)
    return path


@pytest.fixture
def copy(made, tmp_path):
    path = tmp_path / "copy.h5"
    shutil.copy(made, path)
    return path


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    path = tmp_path_factory.mktemp("journal") / "data.h5"
    generate(load_recipe("journal-bearing-small", {"duration": "0.05 s"}), N, path, seed=1)
    return path


def relabel(path, change, *, honest=True):
    """Change the rows of a file; honest: as a program would that writes wrong labels."""
    with h5py.File(path, "r+") as file:
        rows = file["manifest"][:]
        change(rows)
        file["manifest"][:] = rows
        if honest:
            file.attrs["manifest_sha256"] = np.bytes_(manifest_hash(rows))


def set_to(name, index, value):
    def change(rows):
        rows[name][index] = value

    return change


def faults(path):
    """Check and records of every fault."""
    return [(f.check, f.records, f.text) for f in check_set(path).findings if f.severity == "fault"]


def the_fault(path):
    found = faults(path)
    assert len(found) == 1, found
    return found[0]


# -- sound ---------------------------------------------------------------------------------------


def test_a_generated_file_is_sound(made, journal):
    for path in (made, journal):
        found = check_set(path)
        assert found.sound
        told = [f for f in found.findings if f.check != "clipped"]
        assert all(f.text.startswith("few revolutions") for f in told)  # the records are short
        with DataSet(path) as data:
            assert found.n_bytes == sum(item.signal.nbytes for item in data)
        assert (found.n_records, found.n_failed) == (N, 0)


@pytest.mark.parametrize("name", recipe_names())
def test_every_column_of_every_recipe_has_a_meaning(name):
    columns = [
        *load_recipe(name).columns,
        *NUMERICS,
        "record_id",
        "group",
        "seed",
        "done",
        "status",
    ]
    other = [column.name for column in describe_columns(columns) if column.role == "other"]
    assert other == []


# -- damage --------------------------------------------------------------------------------------


def places(path):
    """Offset and size of every piece of signal and manifest."""
    with h5py.File(path) as file:
        signal, manifest = file["signal"].id, file["manifest"].id
        chunks = [signal.get_chunk_info(i) for i in range(N)]
        return {
            "signal": [(chunk.byte_offset, chunk.size) for chunk in chunks],
            "manifest": [(manifest.get_offset(), manifest.get_storage_size())],
        }


def room_of_splits(path):
    """Offset and size of what follows the text of each split, to the end of its place."""
    whole, found = path.read_bytes(), []
    with h5py.File(path) as file:
        for node in file["splits"].values():
            text, place = bytes(node.attrs["about"]), node.attrs.get_id("about").get_type()
            found.append((whole.index(text) + len(text), place.get_size() - len(text)))
    return found


def flipped(whole, path, place, rng):
    raw = bytearray(whole)
    raw[place] ^= 1 << int(rng.integers(8))
    path.write_bytes(raw)


@pytest.mark.parametrize("part", ["signal", "manifest"])
def test_every_flipped_bit_is_found(journal, tmp_path, part):
    whole, pieces = journal.read_bytes(), places(journal)[part]
    rng = np.random.default_rng(3)
    for _ in range(30):
        number = int(rng.integers(len(pieces)))
        start, size = pieces[number]
        flipped(whole, tmp_path / "x.h5", start + int(rng.integers(size)), rng)
        found = check_set(tmp_path / "x.h5")
        assert not found.sound
        if part == "signal":
            assert the_fault(tmp_path / "x.h5")[:2] == ("checksum", (number,))


def content(path):
    with DataSet(path) as data:
        return repr(data.attributes), data.rows.tobytes(), [item.signal.tobytes() for item in data]


def test_a_flipped_bit_elsewhere_is_found_or_changes_nothing(journal, tmp_path):
    """Most of the structure is spare room; of the rest the attributes have their own hash."""
    whole, known = journal.read_bytes(), content(journal)
    held = np.zeros(len(whole), dtype=bool)
    for start, size in chain(*places(journal).values(), room_of_splits(journal)):
        held[start : start + size] = True
    rng = np.random.default_rng(4)
    n_found = 0
    for place in rng.choice(np.flatnonzero(~held), 60, replace=False).tolist():
        flipped(whole, tmp_path / "x.h5", place, rng)
        if check_set(tmp_path / "x.h5").sound:
            assert content(tmp_path / "x.h5") == known, place
        else:
            n_found += 1
    assert n_found > 10  # 56 % in a campaign of 1,000


def test_an_altered_attribute_is_found(copy):
    with h5py.File(copy, "r+") as file:
        file.attrs["sample_rate_hz"] = 12_800.0
    check, records, text = the_fault(copy)
    assert (check, records) == ("file", ())
    assert text.startswith("attributes_sha256 is ")
    with pytest.raises(DataError, match="take an intact copy, or delete that attribute"):
        DataSet(copy)


def test_an_altered_label_is_found_and_never_read(copy):
    relabel(copy, set_to("grade", 2, 3), honest=False)
    assert the_fault(copy)[2].startswith("manifest_sha256 is ")
    with pytest.raises(DataError, match="manifest_sha256"):
        DataSet(copy)


@pytest.mark.parametrize("name", HASHES)
def test_a_damaged_hash_is_found(copy, name):
    with h5py.File(copy, "r+") as file:
        file.attrs[name] = np.bytes_(b"\xff" + bytes(file.attrs[name])[1:])  # no UTF-8 either
    assert the_fault(copy)[2].startswith(f"{name} is \ufffd")


def test_an_old_file_with_a_damaged_status_is_checked(copy):
    relabel(copy, set_to("status", 2, b"\xff"), honest=False)
    with h5py.File(copy, "r+") as file:
        del file.attrs["manifest_sha256"]
    found = check_set(copy)
    assert [f.records for f in found.findings if f.check == "status"] == [(2,)]


def test_an_old_file_is_read_and_said_to_have_no_hash(copy):
    with h5py.File(copy, "r+") as file:
        del file.attrs["manifest_sha256"], file.attrs["attributes_sha256"]
    found = check_set(copy)
    assert found.sound
    [note] = [finding for finding in found.findings if finding.check == "hash"]
    assert "no attributes_sha256 and no manifest_sha256" in note.text
    assert "export it to .h5 to add them" in note.text


def test_a_file_that_cannot_be_opened_has_that_as_its_finding(tmp_path):
    (tmp_path / "x.h5").write_text("no HDF5")
    assert the_fault(tmp_path / "x.h5")[2].startswith("file cannot be read")
    with pytest.raises(DataError, match=r"no\.h5: no such file; check the path"):
        check_set(tmp_path / "no.h5")


# -- signals -------------------------------------------------------------------------------------


def resign(path, index, signal):
    """Another signal with a checksum that fits."""
    with h5py.File(path, "r+") as file:
        file["signal"][index] = signal
    relabel(path, set_to("signal_crc32", index, signal_checksum(signal)))


def test_a_signal_written_twice_is_found(copy):
    with DataSet(copy) as data:
        twin = data[1].signal
    resign(copy, 6, twin)
    check, records, text = the_fault(copy)
    assert (check, records) == ("duplicate", (1, 6))
    assert "also across groups, which leaks into every split" in text


def test_equal_checksums_of_other_signals_are_no_duplicate(copy, monkeypatch):
    monkeypatch.setattr("wearstate.datasets.audit.integrity.signal_checksum", lambda _: 7)
    relabel(copy, set_to("signal_crc32", slice(None), 7))
    assert check_set(copy).sound


@pytest.mark.parametrize(
    ("value", "check", "message"),
    [
        (0.0, "signal", "is zero throughout while its status is ok"),
        (np.nan, "signal", "not finite"),
    ],
)
def test_a_signal_that_is_none_is_found(copy, value, check, message):
    with DataSet(copy) as data:
        shape = data[0].signal.shape
    resign(copy, 3, np.full(shape, value, dtype=np.float32))
    found = the_fault(copy)
    assert found[:2] == (check, (3,))
    assert message in found[2]


def test_one_dead_channel_is_a_note(copy):
    with DataSet(copy) as data:
        signal = data[5].signal.copy()
    signal[1] = 2.5
    resign(copy, 5, signal)
    found = check_set(copy)
    assert found.sound
    assert [f.records for f in found.findings if "never changes" in f.text] == [(5,)]


# -- labels --------------------------------------------------------------------------------------

CLEARANCE = "diametral_clearance_crankpin_m"


@pytest.mark.parametrize(
    ("change", "check", "records", "message"),
    [
        (set_to("record_id", 4, b"00000001"), "duplicate", (1, 4), "record_id is that of another"),
        (set_to("seed", [2, 3], 5), "duplicate", (2, 3), "seed is that of another"),
        (set_to("grade", 1, 9), "grade", (1,), "must be -1 to 3"),
        (set_to("speed_hz", 1, np.nan), "number", (1,), "speed_hz is not a number"),
        (set_to("discharge_pressure_pa", 2, np.inf), "number", (2,), "is infinite"),
        (set_to("start_angle_rad", 2, 7.0), "range", (2,), "must be within 0 to 6.28319"),
        (set_to("speed_hz", 6, 9.0), "range", (6,), "must be within 4.25 to 5.75"),
        (set_to("group", [0, 1, 2], 77), "group", (0, 1, 2), "more than the 2 record(s)"),
        (set_to("peak_normal_force_n", 0, -np.inf), "number", (0,), "is infinite"),
    ],
)
def test_a_wrong_label_is_found(copy, change, check, records, message):
    relabel(copy, change)
    found = [fault for fault in faults(copy) if message in fault[2]]
    assert [fault[:2] for fault in found] == [(check, records)]


def test_a_speed_that_is_not_positive_is_found(copy):
    relabel(copy, set_to("speed_hz", 6, 0.0))
    assert any(
        fault[:2] == ("number", (6,)) and fault[2].startswith("speed_hz must be > 0")
        for fault in faults(copy)
    )


def test_a_severity_out_of_range_is_found_at_both_ends(copy):
    high = 0.465e-3
    relabel(copy, lambda rows: set_to(CLEARANCE, [1, 2, 3], [0.04e-3, high, 1.01 * high])(rows))
    ranges = [fault for fault in faults(copy) if fault[0] == "range"]
    assert [fault[1] for fault in ranges] == [(1, 3)]  # the bound itself is inside
    assert f"{CLEARANCE} must be within 5e-05 to 0.000465" in ranges[0][2]


def test_a_grade_that_the_limits_contradict_is_found(copy):
    with DataSet(copy) as data:
        grades = data.rows["grade"].copy()
    relabel(copy, set_to("grade", 0, (grades[0] + 1) % 4))
    check, records, text = the_fault(copy)
    assert (check, records) == ("grade", (0,))
    assert "limits 0.00013, 0.00022, 0.00031 m" in text


def test_labels_in_millimetres_are_found(copy):
    def in_millimetres(rows):
        rows[CLEARANCE] *= 1e3
        rows["grade"] = 3

    relabel(copy, in_millimetres)
    found = [text for check, _, text in faults(copy) if check == "grade"]
    assert found == [
        f"{CLEARANCE} is more than 20 times the condemning limit, 0.00031 m; labels are in metres: "
        "check the unit"
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (set_to(CLEARANCE, 2, np.inf), f"record 2: {CLEARANCE} is infinite"),
        (set_to(CLEARANCE, [1, 2], 0.1), f"records 1, 2: {CLEARANCE} is more than 20 times"),
        (set_to("grade", slice(None), 3), "grade must be what"),
        (set_to(CLEARANCE, 4, 1e-6), f"record 4: {CLEARANCE} must be within 5e-05"),
    ],
)
def test_wrong_labels_neither_train_nor_judge_a_model(copy, change, message):
    refuse_wrong_labels(copy)
    relabel(copy, change)
    with pytest.raises(DataError, match=re.escape(message)):
        refuse_wrong_labels(copy)
    with pytest.raises(DataError, match=re.escape(message)):
        evaluate("any.wsm", copy)
    ran = CliRunner().invoke(cli, ["train", str(copy), "-o", f"{copy}.wsm"])
    assert ran.exit_code == 2
    assert message in ran.stderr


def test_a_signal_of_two_machines_trains_no_model(copy):
    with DataSet(copy) as data:
        twin = data[0].signal
    resign(copy, 1, twin)  # of the same machine: no leak
    refuse_wrong_labels(copy)
    resign(copy, 6, twin)
    with pytest.raises(DataError, match="records 0, 1, 6: signal is that of another record; also"):
        refuse_wrong_labels(copy)


def test_what_is_to_be_refused_is_not_trained_on(copy, made, journal, monkeypatch):
    refuse_shared(made, [journal])
    with pytest.raises(DataError, match=r"records 0, 1, 2, 3, 4 and 3 more: also in the training"):
        refuse_shared(made, [journal, copy])
    monkeypatch.setattr("wearstate.datasets.audit.integrity.np.array_equal", lambda *_: False)
    refuse_shared(made, [copy])  # checksums that are equal by chance


def test_a_confounder_and_its_value_belong_together(copy):
    name = "leaking_discharge_valve"
    with DataSet(copy) as data:
        present = data.rows[f"confounder_{name}"].copy()
    absent = np.flatnonzero(~present)[:2]  # both records of a machine, or of two
    relabel(copy, set_to(f"{name}_value", absent, 1e-5))
    assert any(f[0] == "range" and f[1] == tuple(absent.tolist()) for f in faults(copy))


def test_what_is_drawn_per_machine_is_one_in_a_group(journal, tmp_path):
    copy = tmp_path / "x.h5"
    shutil.copy(journal, copy)
    with DataSet(copy) as data:
        groups, value = data.rows["group"], data.rows["unbalance_kg_m"][0]
        assert (groups[2] == groups[3]) & (value > 0)
    relabel(copy, set_to("unbalance_kg_m", 3, value))  # in range, but of another machine
    check, records, text = the_fault(copy)
    assert (check, records) == ("group", (2, 3))
    assert text.startswith("unbalance_kg_m is drawn per machine")


def test_hours_that_fall_are_found(tmp_path):
    path = small(tmp_path, hours=[0.0, 5.0, 4.0, 0.0], group=[1, 1, 1, 2])
    assert the_fault(path)[:2] == ("group", (2,))


def test_failed_records_are_counted_and_noted(tmp_path):
    path = small(tmp_path, status=["ok", "diverged", "ok", "refused"])
    found = check_set(path)
    assert (found.sound, found.n_failed) == (True, 2)
    [note] = found.findings
    assert (note.check, note.records) == ("status", (1, 3))
    assert "1 diverged, 1 refused" in note.text


def test_a_file_of_nothing_but_failures_is_not_sound(tmp_path):
    assert the_fault(small(tmp_path, status=["diverged"] * 4))[0] == "status"


def small(folder, *, status=("ok",) * 4, group=(0, 1, 2, 3), hours=(0.0,) * 4, **head):
    """Four records of noise, those that failed of zeros."""
    about = Attributes(
        sample_rate=100.0,
        channels=(Channel(name="acc", unit="m/s^2", quantity="acceleration"),),
        **{"origin": "simulated", **head},
    )
    path = folder / "small.h5"
    columns = {"operating_hours": "<f8"}
    with DataSetWriter(path, about, n_records=4, n_samples=30, columns=columns) as writer:
        for i in range(4):
            signal = np.random.default_rng(i).standard_normal((1, 30)) * (status[i] == "ok")
            row = {"record_id": str(i), "group": group[i], "seed": i, "status": status[i]}
            writer.write(i, signal, {**row, "operating_hours": hours[i]})
        writer.finish()
    return path


def test_measured_labels_may_be_unknown(tmp_path):
    path = small(tmp_path, hours=[0.0, np.nan, 1.0, 2.0], origin="measured")
    assert check_set(path).sound
    relabel(path, set_to("seed", slice(None), 0))  # a measured record has none
    assert check_set(path).sound


def test_a_recipe_of_another_version_is_a_note(tmp_path):
    found = check_set(small(tmp_path, recipe="name = 'x'\nfancy = 1", scene="name = 's'"))
    assert found.sound
    [note] = found.findings
    assert "ranges and groups are not checked against the recipe" in note.text
    assert "fancy" in note.text


# -- splits --------------------------------------------------------------------------------------


def with_split(path, sides, apart=True):
    with h5py.File(path, "r+") as file:
        file["splits/mine"] = np.array(sides, dtype=np.int8)
        about = {"kind": "random", "machines_apart": apart}
        file["splits/mine"].attrs["about"] = np.bytes_(json.dumps(about))
    return path


def test_splits_are_checked(tmp_path):
    path = with_split(small(tmp_path, group=[0, 0, 1, 1]), [0, 0, 1, -1])
    assert check_set(path).sound


@pytest.mark.parametrize(
    ("sides", "message"),
    [
        ([0, 1, 1, 1], "1 group(s) are on both sides"),
        ([0, 0, 1, 3], "split mine must be -1, 0 or 1"),
        ([0, 0, 1], "split mine must be -1, 0 or 1"),
    ],
)
def test_wrong_splits_are_found(tmp_path, sides, message):
    path = with_split(small(tmp_path, group=[0, 0, 1, 1]), sides)
    check, _, text = the_fault(path)
    assert check == "split"
    assert message in text


def test_a_split_in_time_has_a_machine_on_both_sides_by_design(tmp_path):
    assert check_set(with_split(small(tmp_path, group=[0, 0, 1, 1]), [0, 1, 0, 1], False)).sound


# -- the command ---------------------------------------------------------------------------------


def run(*arguments):
    return CliRunner().invoke(cli, [str(a) for a in arguments])


def test_the_command_exits_1_on_a_fault(copy):
    whole = run("info", copy, "--verify")
    assert whole.exit_code == 0
    assert f"{copy}: sound: 0 fault(s)" in whole.stdout
    relabel(copy, set_to("grade", [1, 5], 9))
    broken = run("info", copy, "--verify")
    assert broken.exit_code == 1
    assert "NOT SOUND" in broken.stdout
    assert (
        "fault  grade      records 1, 5: grade must be -1 to 3; correct the label" in broken.stdout
    )
    table = json.loads(run("info", copy, "--verify", "--json").stdout)
    assert (table["sound"], table["records"]) == (False, N)
    assert table["findings"][0]["records"] == [1, 5]
    assert table["findings"][0]["count"] == 2
    assert run("info", copy.with_name("no.h5"), "--verify").exit_code == 2


def test_long_lists_of_records_are_cut(tmp_path):
    found = checked_table(check_set(small(tmp_path)))
    finding = {"severity": "fault", "check": "x", "text": "bad", "count": 4000}
    text = checked_text({**found, "findings": [{**finding, "records": list(range(1000))}]})
    assert "records 0, 1, 2, 3, 4 and 3995 more: bad" in text


def test_progress_counts_records(tmp_path):
    seen = []
    check_set(small(tmp_path), progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_the_page_about_files_lists_every_column():
    page = (Path(__file__).parents[1] / "docs" / "datasets.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `([^`]+)` \| (\w+) \| (.+) \|$", page, re.MULTILINE)
    wanted = [
        (pattern.replace("(.+)", "…"), role, meaning.replace(": {0}", ""))
        for pattern, role, meaning in meanings()
    ]
    assert sorted(listed) == sorted(wanted)
