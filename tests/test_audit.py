"""The audit finds what was planted, and nothing in clean data."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.datasets.audit.audit import CHECKS, Audit, audit, table_findings
from wearstate.datasets.audit.columns import close_pairs, resolution
from wearstate.datasets.audit.label import neighbour_accuracy
from wearstate.datasets.audit.records import ANCHORS, anchors, copies, sketch
from wearstate.datasets.audit.rows import _rank, copied_rows
from wearstate.datasets.audit.table import AuditTable, Roles, coded, read_table
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.machines import machine_origin
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.generation.generate import generate
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.inspect.audit_text import audit_text
from wearstate.sim.output.recording import DataError
from wearstate.sim.output.sensor import Channel

from .command_line import run

NUISANCE = 3


def clean_table(seed, *, n=240, machines=40):
    """Columns of every kind that a feature table has, some of which know the label a little."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(machines), n // machines)
    wear = rng.permutation(np.arange(n)) / n
    label = (4 * wear).astype(int)
    size = np.exp(0.5 * wear + 0.3 * rng.standard_normal(n))
    shape = rng.gamma(2.0, size=n)
    columns = {
        "rms": size,
        "std": size * np.sqrt(1 - 1e-8 * rng.random(n)),  # equal but for a mean next to nothing
        "level": 20 * np.log10(size),
        "peak": size * (3 + shape),
        "crest": 3 + shape,  # its product with rms is peak: three columns, no leak
        "doubled": 2 * size,
        "complement": 10 - size,
        "normal": rng.standard_normal(n),
        "large offset": 1e6 + rng.standard_normal(n),
        "four digits": np.array([float(f"{v:.3e}") for v in rng.lognormal(size=n)]),
        "two digits": np.round(rng.random(n), 2),
        "count": rng.poisson(3 + 2 * wear),
        "rare": rng.random(n) < 0.02,
        "saturated": np.minimum(1.0, rng.normal(0.95, 0.05, n)),
        "angle": rng.uniform(0, 2 * np.pi, n),
        "single precision": rng.standard_normal(n).astype(np.float32),
        "constant": np.full(n, 7.0),
        "machine": rng.standard_normal(machines)[groups],
        "gaps": np.where(rng.random(n) < 0.1, np.nan, rng.standard_normal(n)),
    }
    nuisance = {"speed_hz": rng.random(n), "load_n": rng.random(machines)[groups]}
    nuisance["leak"] = (rng.random(n) < 0.2).astype(float)
    assert len(nuisance) == NUISANCE
    side = (rng.permutation(machines)[groups] < machines // 4).astype(np.int8)
    return AuditTable(
        source="clean.csv",
        names=tuple(columns),
        values=np.column_stack([np.asarray(v, dtype=float) for v in columns.values()]),
        texts={"file": np.array([f"rec_{i:04d}_m{g}.wav" for i, g in enumerate(groups)])},
        label_name="grade",
        label=label,
        classes=("0", "1", "2", "3"),
        groups=groups,
        nuisance=nuisance,
        sides={"machine": side},
    )


def planted(table, **columns):
    """The table with further columns."""
    return replace(
        table,
        names=(*table.names, *columns),
        values=np.column_stack([table.values, *columns.values()]),
    )


def codes(table):
    return [finding.code for finding in table_findings(table)]


def one(table, code):
    [finding] = [finding for finding in table_findings(table) if finding.code == code]
    return finding


CLEAN = clean_table(0)
CLASS = np.array([0.5, 0.9, 0.1, 0.7])[CLEAN.label]
RNG = np.random.default_rng(99)
N = len(CLEAN.label)


@pytest.mark.parametrize("seed", range(60))
def test_clean_tables_raise_nothing(seed):
    """At 0.1 % by chance for each of two checks, 60 tables raise one in 9 campaigns: none here."""
    assert codes(clean_table(seed)) == []
    assert codes(replace(clean_table(1000 + seed), groups=None, sides={})) == []


# --- columns made with the label


FREE = np.exp(RNG.standard_normal(N))


@pytest.mark.parametrize(
    ("code", "other"),
    [
        ("constant-product", CLASS / FREE),
        ("constant-ratio", CLASS * FREE),
        ("constant-sum", CLASS - FREE),
        ("constant-difference", CLASS + FREE),
    ],
)
def test_pairs_that_are_constant_within_a_class(code, other):
    finding = one(planted(CLEAN, free=FREE, made=other), code)
    assert finding.severity == "alarm"
    assert finding.columns == ("free", "made")
    [example] = finding.numbers["examples"]
    want = dict(zip(CLEAN.classes, [0.5, 0.9, 0.1, 0.7], strict=True))
    if code == "constant-ratio":
        want = {name: 1 / value for name, value in want.items()}  # free / made
    if code == "constant-difference":
        want = {name: -value for name, value in want.items()}
    assert_allclose([example["values"][k] for k in want], list(want.values()), rtol=1e-9)


@pytest.mark.parametrize("digits", [5, 6, 7])
def test_rounded_text_hides_nothing(digits):
    made = [float(f"{v:.{digits - 1}e}") for v in CLASS / FREE]
    free = [float(f"{v:.{digits - 1}e}") for v in FREE]
    assert "constant-product" in codes(planted(CLEAN, free=free, made=made))


def test_a_constant_that_is_no_class_is_no_leak():
    assert codes(planted(CLEAN, free=FREE, made=3 / FREE)) == []


def test_a_constant_with_noise_is_no_leak():
    """1e-4 of noise is a hundred times what the check allows; physics is no more exact."""
    made = CLASS / FREE * (1 + 1e-4 * RNG.standard_normal(N))
    assert "constant-product" not in codes(planted(CLEAN, free=FREE, made=made))


def test_a_column_that_is_constant_within_a_class():
    finding = one(planted(CLEAN, made=CLASS * (1 + 1e-7 * RNG.random(N))), "constant-column")
    assert (finding.severity, finding.columns) == ("alarm", ("made",))


def test_one_class_with_a_value_of_its_own():
    made = np.where(CLEAN.label == 2, 0.25, RNG.random(N))
    finding = one(planted(CLEAN, made=made), "constant-in-a-class")
    assert (finding.severity, finding.columns) == ("warning", ("made",))


def by_class(function):
    made = RNG.lognormal(size=N) * (1 + CLEAN.label)
    for k in range(4):
        made[CLEAN.label == k] = function(made[CLEAN.label == k])
    return made


@pytest.mark.parametrize(
    ("function", "same"),
    [
        (lambda x: (x - x.mean()) / x.std(), "mean and standard deviation"),
        (lambda x: (x - x.mean()) / x.std(ddof=1) * 3 + 8, "mean and standard deviation"),
        (lambda x: (x - x.min()) / np.ptp(x), "smallest and largest value"),
        (lambda x: x / np.sqrt(np.mean(x**2)), "rms"),
        (lambda x: 5 * x / np.abs(x).max(), "largest magnitude"),
    ],
)
def test_scaling_class_by_class(function, same):
    finding = one(planted(CLEAN, made=by_class(function)), "class-normalised")
    severity = "warning" if same == "largest magnitude" else "alarm"
    assert (finding.severity, finding.columns, finding.numbers["same"]) == (
        severity,
        ("made",),
        same,
    )


def test_a_floor_is_no_scaling():
    """Two values at the floor of one class: a peak that scaling makes stands alone."""
    level = -200 + 30 * RNG.random(N)
    floored = [np.flatnonzero(CLEAN.label == k)[: 1 + (k == 3)] for k in range(4)]
    level[np.concatenate(floored)] = -200.0
    assert codes(planted(CLEAN, level=level)) == []


def test_scaling_all_alike_is_no_leak():
    x = RNG.lognormal(size=N)
    assert codes(planted(CLEAN, made=(x - x.mean()) / x.std(), other=x / x.max())) == []


@given(st.integers(2, 30), st.integers(0, 10**6), st.sampled_from([1, -1]))
def test_close_pairs_are_those_of_all_comparisons(n, seed, sign):
    rng = np.random.default_rng(seed)
    vectors = rng.standard_normal((n, 12))
    source, target = rng.integers(n, size=(2, n // 2))
    vectors[target] = sign * vectors[source] + 1e-7 * rng.standard_normal((n // 2, 12))
    tolerance = np.full(n, 1e-6)
    want = [
        [i, j]
        for i in range(n)
        for j in range(i + 1, n)
        if np.abs(vectors[i] - sign * vectors[j]).max() <= 2e-6
    ]
    assert close_pairs(vectors, tolerance, sign=sign).tolist() == want


def test_resolution_of_text():
    rng = np.random.default_rng(0)
    values = rng.lognormal(sigma=3, size=(50, 3))
    text = [[float(f"{v:.4e}") for v in row] for row in values]
    assert_array_equal(resolution(np.array(text)), [1e-4] * 3)
    assert_array_equal(resolution(values), [0] * 3)
    assert_array_equal(resolution(np.arange(9.0)[:, None]), [0])


# --- the label read from elsewhere


@given(st.integers(0, 10**6), st.booleans())
def test_neighbours_are_those_of_all_comparisons(seed, grouped):
    rng = np.random.default_rng(seed)
    n = 25
    values, label = rng.standard_normal((n, 2)), rng.integers(3, size=n)
    groups = rng.integers(8, size=n) if grouped else np.arange(n)
    want = []
    for column in values.T:
        gap = np.abs(column[:, None] - column)
        gap[groups[:, None] == groups] = np.inf
        want.append((label[gap.argmin(axis=1)] == label).mean())
    got = neighbour_accuracy(values, label, groups if grouped else None)
    assert_allclose(got, want)


def test_a_column_that_is_the_label_in_disguise():
    finding = one(
        planted(CLEAN, code=np.sin(CLEAN.label) + 0.01 * RNG.random(N)), "readable-column"
    )
    assert (finding.severity, finding.columns) == ("warning", ("code",))
    assert finding.numbers["accuracy"]["code"] > 0.99


def test_missing_values_that_tell_the_label():
    two = replace(CLEAN, label=CLEAN.label // 2, classes=("new", "worn"))
    made = np.where(two.label == 1, np.nan, RNG.random(N))
    assert "missing made" in one(planted(two, made=made), "readable-column").columns


def test_a_value_of_the_machine_is_not_read_off_its_other_records():
    """Each machine has one class and a number of its own, which says nothing of other machines."""
    label = (RNG.permutation(40) % 4)[CLEAN.groups]
    table = replace(planted(CLEAN, serial=RNG.random(40)[CLEAN.groups]), label=label, sides={})
    assert codes(table) == []
    assert "readable-column" in codes(replace(table, groups=None))


def test_rows_in_blocks_of_classes():
    order = np.argsort(CLEAN.label, kind="stable")
    table = replace(
        CLEAN,
        label=CLEAN.label[order],
        groups=None,
        values=RNG.random((N, 1)),
        names=("x",),
        nuisance={},
        sides={},
        texts={},
    )
    finding = one(table, "readable-order")
    assert "stand in blocks" in finding.what
    # three borders with a row on the wrong side at most each
    assert finding.numbers["accuracy"] > 1 - 4 / N


def test_rows_in_a_cycle_of_classes():
    table = AuditTable(
        source="t",
        names=("x",),
        values=RNG.random((N, 1)),
        label_name="state",
        label=np.arange(N) % 4,
        classes=("a", "b", "c", "d"),
    )
    assert "repeat every 4 rows" in one(table, "readable-order").what


def test_names_that_tell_the_label():
    words = np.array(["ok", "worn"])
    two = replace(CLEAN, label=CLEAN.label // 2, classes=("new", "worn"))
    files = np.array([f"run{i}/{words[k]}-3.wav" for i, k in enumerate(two.label)])
    finding = one(replace(two, texts={"file": files}), "readable-name")
    assert (finding.columns, finding.numbers["accuracy"]) == (("file",), 1.0)
    assert "word 3 of file" in finding.what


def test_a_condition_that_follows_the_wear():
    wear = np.random.default_rng(0).permutation(np.arange(240)) / 240  # as clean_table draws it
    load = wear + RNG.standard_normal(N)
    for graded in (None, wear):
        table = replace(CLEAN, graded=graded, nuisance={**CLEAN.nuisance, "load": load})
        finding = one(table, "confounded")
        assert finding.columns == ("load",)
        # uniform plus unit normal: rank correlation near sqrt(1/12) / sqrt(1 + 1/12) = 0.28
        assert_allclose(finding.numbers["load"]["rank_correlation"], 0.28, atol=0.12)


def test_records_of_one_machine_are_no_independent_witnesses():
    """Eight machines with thirty records each: by records p < 1e-9, by machines it is chance."""
    groups = np.repeat(np.arange(8), 30)
    load = np.arange(8.0)[groups]
    label = np.array([0, 1, 0, 1, 0, 1, 1, 1])[groups]
    table = replace(
        CLEAN,
        groups=groups,
        label=label,
        classes=("new", "worn"),
        nuisance={"load": load},
        sides={},
        names=("x",),
        values=RNG.random((N, 1)),
        texts={},
    )
    assert "confounded" not in codes(table)
    assert "confounded" in codes(replace(table, groups=None))


def test_classes_of_one_machine():
    label = np.minimum(CLEAN.groups // 10, 1)
    label[CLEAN.groups == 39] = 2
    table = replace(CLEAN, label=label, classes=("new", "worn", "broken"), sides={})
    finding = one(table, "lone-machines")
    assert finding.numbers["machines"] == {"broken": 1}


# --- copies and splits


def test_copied_rows_and_the_split_they_cross():
    train, test = (np.flatnonzero(CLEAN.sides["machine"] == k) for k in (0, 1))
    values = CLEAN.values.copy()
    values[test[0]] = values[train[3]]
    values[train[7]] = values[train[5]] + 1e-7
    finding = one(replace(CLEAN, values=values), "copied-rows")
    assert finding.severity == "alarm"
    assert (finding.numbers["pairs"], finding.numbers["across"]) == (2, {"machine": 1})
    values[test[0]] = CLEAN.values[test[0]]
    assert one(replace(CLEAN, values=values), "copied-rows").severity == "warning"


def test_counts_alone_make_no_copies():
    assert len(copied_rows(RNG.integers(3, size=(200, 4)).astype(float))) == 0


def test_one_rounded_column_makes_no_copies():
    """A thousand values of six digits have dozens of chance pairs within 1e-4 of a deviation."""
    assert len(copied_rows(RNG.standard_normal((1000, 1)))) == 0


def test_machines_on_both_sides():
    side = (np.arange(N) % 3 == 0).astype(np.int8)
    table = replace(CLEAN, sides={"rows": side})
    finding = one(table, "shared-machines")
    assert (finding.severity, finding.numbers["machines"]) == ("alarm", 40)
    meant = one(replace(table, shared=frozenset(["rows"])), "shared-machines")
    assert meant.severity == "note"


# --- signals


CHANNELS = (
    Channel(name="acc", unit="m/s^2", quantity="acceleration"),
    Channel(name="acc_y", unit="m/s^2", quantity="acceleration"),
)
SAMPLES = 8000


def recordings(n, seed=0, samples=SAMPLES):
    """Resonances rung by noise, with a shaft order and a noise floor."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) / 25600.0
    found = []
    for _ in range(n):
        force = rng.standard_normal((2, samples))
        ring = np.exp(-400 * t) * np.sin(2 * np.pi * rng.uniform(900, 1100) * t)
        spectrum = np.fft.rfft(ring, 2 * samples) * np.fft.rfft(force, 2 * samples)
        x = np.fft.irfft(spectrum)[:, :samples]
        x += 20 * np.sin(2 * np.pi * rng.uniform(20, 30) * t) + 0.03 * x.std() * force[::-1]
        found.append(x)
    return found


def write_set(path, signals, *, groups=None, split=None, seed=0, recipe="", crc_of=None):
    signals = [np.asarray(x, dtype=np.float32) for x in signals]
    groups = np.arange(len(signals)) if groups is None else groups
    head = Attributes(
        sample_rate=25600.0, channels=CHANNELS, origin="measured", recipe=recipe, seed=seed
    )
    names = [] if split is None else ["mine"]
    with DataSetWriter(
        path, head, n_records=len(signals), n_samples=signals[0].shape[1], splits=names
    ) as writer:
        for i, x in enumerate(signals):
            row = {"record_id": f"r{i}", "group": groups[i], "status": "ok"}
            writer.write(i, x, row)
        if split is not None:
            writer.write_split("mine", np.array(split, dtype=np.int8), '{"kind": "region"}')
        writer.finish()
    return path


def found_in(path):
    with DataSet(path) as data:
        return copies([data], [sketch(data)])


def test_different_recordings_share_nothing(tmp_path):
    path = write_set(tmp_path / "a.h5", recordings(40))
    assert found_in(path) == []
    assert audit([path]).verdict == "clean"


@pytest.mark.parametrize("overlap", [0.5, 0.1])
def test_overlapping_windows(tmp_path, overlap):
    [long] = recordings(1, samples=6 * SAMPLES)
    step = round(SAMPLES * (1 - overlap))
    windows = [long[:, i * step : i * step + SAMPLES] for i in range(5)]
    signals = [*windows, *recordings(6, seed=1)]
    found = found_in(write_set(tmp_path / "w.h5", signals))
    assert [(c.first[1], c.second[1]) for c in found if c.exact] == [(i, i + 1) for i in range(4)]
    assert len(found) == 4
    for copy in found:
        assert copy.shift == step
        assert_allclose(copy.share, overlap)


def test_overlap_survives_gain_and_offset(tmp_path):
    [long] = recordings(1, samples=2 * SAMPLES)
    one_window, other = long[:, :SAMPLES], long[:, SAMPLES // 2 : SAMPLES * 3 // 2]
    scaled = (other - other.mean(axis=1, keepdims=True)) / other.std(axis=1, keepdims=True)
    [copy] = found_in(write_set(tmp_path / "s.h5", [one_window, scaled, *recordings(4, seed=2)]))
    assert (copy.shift, copy.share, copy.exact) == (SAMPLES // 2, 0.5, False)


@pytest.mark.parametrize(("level_db", "is_copy"), [(-40, True), (-10, False)])
def test_copies_with_noise(tmp_path, level_db, is_copy):
    """Noise is set against the differences, which the comparison is made on."""
    x, *rest = recordings(5, seed=3)
    noise = np.random.default_rng(5).standard_normal(x.shape)
    scale = np.std(np.diff(x)) / np.std(np.diff(noise)) * 10 ** (level_db / 20)
    found = found_in(write_set(tmp_path / "n.h5", [x, x + scale * noise, *rest]))
    assert [(c.first[1], c.second[1]) for c in found] == ([(0, 1)] if is_copy else [])


def test_equal_records_are_paired_with_the_first(tmp_path):
    x, y = recordings(2)
    found = found_in(write_set(tmp_path / "e.h5", [y, x, x, x]))
    assert [(c.first[1], c.second[1], c.exact) for c in found] == [(1, 2, True), (1, 3, True)]


def test_constant_signals_are_no_copies_of_others(tmp_path):
    still = [np.full((2, SAMPLES), value) for value in (0.0, 1.0, 2.0)]
    assert found_in(write_set(tmp_path / "c.h5", [*still, *recordings(2)])) == []


@pytest.mark.parametrize(
    ("groups", "split", "severity"),
    [
        ([0, 0, 1], None, "note"),
        ([0, 2, 1], None, "alarm"),
        ([0, 0, 1], [0, 1, 1], "alarm"),
        ([0, 0, 1], [0, 0, 1], "note"),
    ],
)
def test_where_windows_of_one_recording_lie(tmp_path, groups, split, severity):
    [long] = recordings(1, samples=2 * SAMPLES)
    signals = [long[:, :SAMPLES], long[:, SAMPLES // 2 : SAMPLES * 3 // 2], recordings(1, 4)[0]]
    path = write_set(tmp_path / "g.h5", signals, groups=groups, split=split)
    findings = [f for f in audit([path]).findings if f.code == "overlapping-windows"]
    assert [f.severity for f in findings] == [severity]


def test_anchors_do_not_mind_where_a_signal_is_cut():
    x = recordings(1)[0][0].astype(np.float32)
    whole, part = anchors(x), anchors(2 * x[2000:6000] - 1)
    assert (whole[1] >= 0).sum() == ANCHORS
    _, i, j = np.intersect1d(whole[0], part[0], return_indices=True)
    assert len(i) >= ANCHORS // 4  # half of the whole's lie in the part, which keeps more than that
    assert set((whole[1][i] - part[1][j]).tolist()) == {2000}


def test_short_signals_have_no_anchors():
    assert (anchors(np.arange(10, dtype=np.float32))[1] == -1).all()


# --- two files


def test_the_same_record_in_two_files(tmp_path):
    x, y, z = recordings(3)
    one_file, other = write_set(tmp_path / "a.h5", [x, y]), write_set(tmp_path / "b.h5", [z, x])
    [finding] = audit([one_file, other]).findings
    assert (finding.code, finding.severity) == ("copied-signals", "warning")
    assert finding.numbers == {"shared": 1, "first": [[0, 1, 0]]}
    [finding] = audit(train=[one_file], test=[other]).findings
    assert finding.severity == "alarm"


def test_the_same_draw_in_two_files(tmp_path):
    """Machines are told by the recipe that draws them and the seed, not by the signals."""
    first = write_set(tmp_path / "a.h5", recordings(3, 0), seed=1, recipe="name = 'r'")
    healthy = "name = 'healthy'\nmachines_of = 'r'"
    for recipe, seed, count in (
        *(("name = 'r'", 1, 3), (healthy, 1, 3)),
        *(("name = 'r'", 2, None), ("name = 'other'", 1, None), ("", 1, None)),
    ):
        second = tmp_path / "b.h5"
        write_set(second, recordings(3, 7), seed=seed, recipe=recipe)
        shared = audit(train=[first], test=[second]).findings
        assert [f.numbers["shared"] for f in shared] == ([count] if count else [])
        second.unlink()
    with DataSet(first) as data:
        assert machine_origin(data.attributes.recipe, data.attributes.seed) == ('"r"', 1)


def test_rows_and_machines_that_two_tables_share(tmp_path):
    frame = pd.DataFrame(RNG.random((30, 4)), columns=list("abcd"))
    frame["machine"] = [f"m{i // 3}" for i in range(30)]
    other = frame.iloc[25:].assign(machine=[f"k{i}" for i in range(5)])
    fresh = pd.DataFrame(RNG.random((9, 4)), columns=list("abcd")).assign(machine="m2")
    frame.to_csv(tmp_path / "train.csv", index=False)
    pd.concat([other, fresh]).to_csv(tmp_path / "test.csv", index=False)
    roles = Roles(group="machine")
    findings = audit(roles=roles, train=[tmp_path / "train.csv"], test=[tmp_path / "test.csv"])
    found = {f.code: f for f in findings.findings}
    assert found["copied-rows"].numbers["shared"] == 5
    assert found["copied-rows"].numbers["first"][0] == [26, 1]
    assert found["shared-machines"].numbers["first"] == ["m2"]
    assert {f.severity for f in findings.findings} == {"alarm"}


def test_numbers_of_machines_hold_within_one_of_our_tables(tmp_path):
    for name in ("a", "b"):
        own = pd.DataFrame(RNG.random((30, 4)), columns=[f"acc.{c}" for c in "abcd"])
        own = own.assign(record_id="r", group=np.arange(30) // 3, signal_crc32=0)
        own.assign(grade=np.arange(30) % 2).to_csv(tmp_path / f"{name}.csv", index=False)
    found = audit(train=[tmp_path / "a.csv"], test=[tmp_path / "b.csv"])
    assert [f.code for f in found.findings if f.severity == "alarm"] == []
    assert any("its numbers hold in it alone; audit the .h5" in text for text in found.unchecked)


# --- our own data, and a public table


@pytest.fixture(scope="module")
def own_set(tmp_path_factory):
    path = tmp_path_factory.mktemp("own") / "data.h5"
    recipe = load_recipe("bilge-pump-small", {"duration": "0.6 s"})
    generate(recipe, 32, path, seed=0, jobs=2)
    return path


def test_our_own_set_is_clean(own_set):
    found = audit([own_set])
    assert (found.verdict, found.findings) == ("clean", ())
    [source] = found.sources
    assert (source.rows, source.label, source.machines) == (32, "grade", 16)
    assert {"machine", "speed", "geometry"} <= set(source.splits)


def test_our_own_table_knows_its_roles(own_set, tmp_path):
    path = tmp_path / "t.csv"
    CliRunner().invoke(
        cli,
        ["features", str(own_set), "-o", str(path), "--set", "core", "-j", "1"],
        catch_exceptions=False,
    )
    table = read_table(path)
    assert (table.label_name, np.unique(table.groups).size) == ("grade", 16)
    assert {"speed_hz", "discharge_pressure_pa"} <= set(table.nuisance)
    assert all("." in name for name in table.names)
    assert table_findings(table) == []


@pytest.fixture
def public(realdata):
    folder = realdata / "vbl_va001_pump_features_MIT"
    return folder / "feature_VBL-VA001.csv", folder / "label_VBL-VA001.csv"


def test_the_leak_of_a_public_table(public):
    features, label = public
    found = audit([features], Roles(label=str(label)))
    assert found.verdict == "alarm"
    [leak] = [f for f in found.findings if f.severity == "alarm"]
    assert leak.code == "constant-product"
    names = [example["name"] for example in leak.numbers["examples"]]
    # mean and impulse of x, y, z; rms and crest of x, y, z; columns counted from 1
    pairs = [*zip((1, 2, 3), (13, 14, 15), strict=True)]
    pairs += [*zip((10, 11, 12), (22, 23, 24), strict=True)]
    assert names == [f"column {a} × column {b}" for a, b in pairs]
    values = leak.numbers["examples"][0]["values"]
    assert_allclose(list(values.values()), [0.098559, 0.279454, 0.253748, 0.117327], atol=5e-7)
    assert {f.code for f in found.findings if f.severity == "warning"} == {
        "readable-order",
        "copied-rows",
    }


def test_the_public_table_without_the_leak(public, tmp_path):
    features, label = public
    frame = pd.read_csv(features, header=None).drop(columns=[12, 13, 14, 21, 22, 23])
    frame.to_csv(tmp_path / "t.csv", index=False, header=False)
    assert audit([tmp_path / "t.csv"], Roles(label=str(label))).verdict == "warning"


# --- reading


FRAME = pd.DataFrame(
    {"a": [1.5, 2.5, 3.5, 4.5], "state": ["new", "new", "worn", "worn"], "m": [1, 1, 2, 2]}
)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("t.csv", {}),
        ("t.tsv", {"sep": "\t"}),
        ("t.csv", {"sep": ";", "decimal": ","}),
        ("t.txt", {"sep": " "}),
    ],
)
def test_text_tables(tmp_path, name, options):
    FRAME.to_csv(tmp_path / name, index=False, **options)
    table = read_table(tmp_path / name, Roles(label="state", group="m"))
    assert (table.names, table.classes) == (("a",), ("new", "worn"))
    assert_array_equal(table.values, FRAME[["a"]])
    assert_array_equal(table.label, [0, 0, 1, 1])
    assert_array_equal(table.groups, ["1", "1", "2", "2"])


def test_tables_without_a_header_and_other_formats(tmp_path):
    rows = FRAME[["a", "m"]]
    rows.to_csv(tmp_path / "n.csv", index=False, header=False)
    table = read_table(tmp_path / "n.csv", Roles(label="2"))
    assert (table.names, table.label_name, table.classes) == (("column 1",), "column 2", ("1", "2"))
    rows.to_parquet(tmp_path / "p.parquet")
    assert_array_equal(read_table(tmp_path / "p.parquet").values, rows)
    with h5py.File(tmp_path / "h.h5", "w") as file:
        file["a"], file["m"] = rows["a"], rows["m"]
        file["word"] = np.array([b"x", b"y", b"x", b"y"])
    table = read_table(tmp_path / "h.h5")
    assert_array_equal(table.values, rows)
    assert_array_equal(table.texts["word"], ["x", "y", "x", "y"])


def test_a_split_column(tmp_path):
    FRAME.assign(part=["train", "test", "Train", ""]).to_csv(tmp_path / "s.csv", index=False)
    table = read_table(tmp_path / "s.csv", Roles(split="part"))
    assert_array_equal(table.sides["part"], [0, 1, 0, -1])


def test_a_continuous_label_is_cut_into_quarters():
    wear = np.random.default_rng(0).random(400)
    classes, label, graded = coded(wear, "wear")
    assert len(classes) == 4
    assert_array_equal(np.bincount(label), [100] * 4)
    assert_array_equal(graded, wear)
    with pytest.raises(DataError, match="label wear: 1 rows have none"):
        coded(np.r_[wear, np.nan], "wear")


def refusals(tmp_path):
    FRAME.to_csv(tmp_path / "t.csv", index=False)
    (tmp_path / "e.csv").write_text("")
    (tmp_path / "l.csv").write_text("1\n2\n")
    (tmp_path / "t.xls").write_text("a")
    FRAME.assign(part="fit").to_csv(tmp_path / "s.csv", index=False)
    return {
        "t.csv": (Roles(label="z", group="9"), "label = 'z' must be one of its 3 columns"),
        "e.csv": (Roles(), "cannot be read as a table"),
        "t.xls": (Roles(), "suffix '.xls' must be .h5 or one of"),
        "none.csv": (Roles(), "no such file; check the path"),
        "s.csv": (Roles(split="part"), "holds fit, must hold train and test"),
    }


def test_tables_that_cannot_be_read(tmp_path):
    for name, (roles, message) in refusals(tmp_path).items():
        with pytest.raises(DataError, match=message):
            read_table(tmp_path / name, roles)
    with pytest.raises(DataError, match="group = '9'"):  # both faults at once
        read_table(tmp_path / "t.csv", Roles(label="z", group="9"))
    with pytest.raises(DataError, match="2 rows and 1 columns, must be 4"):
        read_table(tmp_path / "t.csv", Roles(label=str(tmp_path / "l.csv")))
    with pytest.raises(DataError, match="is given twice"):
        audit([tmp_path / "t.csv", tmp_path / "t.csv"])
    with pytest.raises(DataError, match="0 files are given"):
        audit([])


def test_roles_of_a_data_set_are_checked_before_it_is_read(tmp_path):
    path = write_set(tmp_path / "a.h5", recordings(2, samples=200))
    with pytest.raises(DataError, match="label = 'zone' must be a manifest column"):
        audit([path], Roles(label="zone"))
    with pytest.raises(DataError, match="split = 'x' must be one of"):
        audit([path], Roles(split="x"))


# --- words and the command


@pytest.fixture
def leaky(tmp_path):
    path = tmp_path / "leaky.csv"
    pd.DataFrame({"mean": FREE, "impulse": CLASS / FREE, "state": CLEAN.label}).to_csv(
        path, index=False
    )
    return path


def test_the_text_says_the_verdict_first(leaky):
    text = run("audit", leaky, "--label", "state").stdout
    lines = text.splitlines()
    assert lines[0] == "ALARM: do not trust results from these data until this is corrected."
    assert "leaky.csv (table): 240 rows, 2 columns; label state" in lines[1]
    assert "1. alarm, leaky.csv: 1 product of two columns" in text
    assert "mean × impulse = 0.5 in 0, 0.9 in 1, 0.1 in 2, 0.7 in 3" in text
    assert "Do: leave these columns out" in text
    assert "no machines are known" in text
    assert "scaled with common numbers: afterwards it does not show" in text
    assert max(map(len, lines)) <= 100


def test_json_and_exit_codes(leaky, tmp_path):
    value = json.loads(run("audit", leaky, "--label", "state", "--json").stdout)
    assert (value["schema_version"], value["verdict"]) == (1, "alarm")
    assert value["findings"][0]["columns"] == ["mean", "impulse"]
    assert value["checked"] == list(CHECKS)
    run("audit", leaky, "--label", "state", "--fail-on", "alarm", code=4)
    blocks = tmp_path / "blocks.csv"
    pd.DataFrame({"x": RNG.random(300), "state": np.repeat([0, 1, 2], 100)}).to_csv(
        blocks, index=False
    )
    run("audit", blocks, "--label", "state", "--fail-on", "warning", code=3)
    run("audit", blocks, "--label", "state", "--fail-on", "alarm")
    run("audit", leaky, "--fail-on", "warning")
    assert "give FILES" in run("audit", code=2).stderr
    assert "go together" in run("audit", "--train", leaky, code=2).stderr


def test_the_clean_text():
    text = audit_text(Audit(sources=(), findings=(), checked=("copied rows",), unchecked=()))
    assert text.startswith("CLEAN: nothing was found")
    assert "Looked for:\n  - copied rows\nNo audit sees:" in text


def test_a_missing_machine_is_refused_and_huge_values_are_compared(tmp_path):
    path, n = tmp_path / "t.csv", 40
    huge = 1e200 * np.random.default_rng(0).standard_normal((n, 2))
    assert len(copied_rows(huge)) == 0  # the squares are infinite
    frame = pd.DataFrame({"m": huge[:, 0], "state": np.arange(n) % 2, "machine": np.arange(n) % 5})
    roles = Roles(label="state", group="machine")
    frame["machine"] = frame["machine"].where(frame["machine"] > 0)
    frame.to_csv(path, index=False)
    with pytest.raises(DataError, match="group 'machine' is missing in 8 of 40 rows"):
        audit([path], roles)


@pytest.mark.parametrize("scale", [1.7e308, 1e154, 1e-308, 5e-324])
@pytest.mark.parametrize("state", ["word", "number"])
def test_numbers_at_either_end_of_the_doubles_are_missing_without_a_warning(tmp_path, scale, state):
    path, n = tmp_path / "t.csv", 60
    rng = np.random.default_rng(0)
    spread = rng.uniform(-1, 1, (n, 2)) * scale
    condition = np.where(np.arange(n) % 2, "a", "b") if state == "word" else np.arange(n) / n
    frame = pd.DataFrame(
        {
            "mean": spread[:, 0],
            "rms": np.sign(spread[:, 1]) * scale,
            "plain": rng.random(n),
            "speed": spread[::-1, 0],
            "state": condition,
        }
    )
    frame.to_csv(path, index=False)
    found = audit([path], Roles(label="state", nuisance=("speed",)))
    assert any("2 column(s) with missing values (also beyond 1e-100" in u for u in found.unchecked)
    assert found.sources[0].rows == n
    if state == "number":
        frame["state"] = rng.random(n) * scale
        frame.to_csv(path, index=False)
        with pytest.raises(DataError, match=r"label state: [0-9]+ rows have none of 1e-100 to 1e"):
            audit([path], Roles(label="state"))


def test_a_table_of_one_row_again_and_again(tmp_path):
    """Its columns have no deviation to be scaled by."""
    path = tmp_path / "t.csv"
    pd.DataFrame({"mean": [2.5] * 30, "state": ["a", "b"] * 15}).to_csv(path, index=False)
    codes = {finding.code: finding for finding in audit([path], Roles(label="state")).findings}
    assert codes["copied-rows"].numbers["pairs"] == 29


def test_the_rank_without_a_singular_value_decomposition(monkeypatch):
    scaled = np.random.default_rng(0).standard_normal((200, 6)) @ np.diag([9, 8, 7, 1, 0.1, 0])
    whole = _rank(scaled)

    def fails(*args, **options):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", fails)
    # (81 + 64 + 49 + 1)^2 / (81^2 + 64^2 + 49^2 + 1) is 2.9
    assert _rank(scaled) == whole == 2
