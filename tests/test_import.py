"""Many measured files into one data set: the right samples, labels and groups, or a refusal."""

import csv
import itertools
import tracemalloc

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import savemat, wavfile
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.measured import data_set as import_set
from wearstate.datasets.measured import label_table
from wearstate.datasets.measured import plan as import_plan
from wearstate.datasets.measured.data_set import NO_PULSES, import_recordings
from wearstate.datasets.measured.labels import read_labels, read_limits
from wearstate.datasets.source.part import SourceOptions
from wearstate.sim.output.recording import DataError
from wearstate.sim.parts.units import STANDARD_GRAVITY

RATE = 100
NAMES = ("acc", "key")
DECLARED = SourceOptions(channels=NAMES, unit="m/s^2")
CLEARANCE = "diametral_clearance_crankpin_m"


def wave(number, n_samples=250):
    """A ramp that tells file and sample apart, and a tacho at 10 Hz [shape=(2, n_samples)]."""
    place = np.arange(n_samples)
    return np.stack([1000.0 * number + place, np.where(place % 10 == 3, 5.0, 0.0)])


def save(path, signal, rate=RATE):
    path.parent.mkdir(exist_ok=True, parents=True)
    wavfile.write(path, rate, signal.T.astype(np.float32))
    return path


@pytest.fixture
def files(tmp_path):
    """Three recordings of 2.5 s, named so that their order is not that of their numbers."""
    return [save(tmp_path / f"{name}.wav", wave(i)) for i, name in enumerate("cab")]


def load(path):
    with DataSet(path) as data:
        return data.attributes, data.manifest, np.stack([item.signal for item in data])


def content(path):
    """Every byte of signal, manifest and attributes; HDF5 itself adds the time of day."""
    with h5py.File(path) as file:
        return (file["signal"][:].tobytes(), file["manifest"][:].tobytes(), str(dict(file.attrs)))


def made(files, path, **options):
    summary = import_recordings(files, path, **{"options": DECLARED, "tacho": "key", **options})
    return summary, *load(path)


def refused(files, path, match, **options):
    with pytest.raises(DataError, match=match) as caught:
        made(files, path, **options)
    assert not path.exists()
    assert not list(path.parent.glob("*.part*"))
    return str(caught.value)


# --- cutting ------------------------------------------------------------------------------------


def test_whole_files_sorted_by_name(files, tmp_path):
    summary, head, manifest, signal = made(files, tmp_path / "x.h5")
    assert manifest["file"].tolist() == ["a.wav", "b.wav", "c.wav"]
    assert_array_equal(signal, [wave(1), wave(2), wave(0)])
    assert manifest["group"].tolist() == [0, 1, 2]
    assert (head.origin, head.sample_rate, head.tacho) == ("measured", 100.0, "key")
    assert [(c.unit, c.quantity) for c in head.channels] == [
        ("m/s^2", "acceleration"),
        ("-", "tacho"),
    ]
    assert set(manifest["grade"]) == {-1}
    assert (summary.n_records, summary.n_files, summary.n_groups) == (3, 3, 3)
    assert summary.left_over == {}


def test_segments_with_their_rest_reported_and_never_padded(files, tmp_path):
    long = save(tmp_path / "z.wav", wave(7, 420))
    summary, _, manifest, signal = made([*files, long], tmp_path / "x.h5", segment=1.0)
    assert manifest["file"].tolist() == [f"{name}.wav" for name in "aabbcczzzz"]
    assert_array_equal(manifest["start_s"], [0, 1, 0, 1, 0, 1, 0, 1, 2, 3])
    assert_array_equal(signal[:, 0, 0], [1000, 1100, 2000, 2100, 0, 100, 7000, 7100, 7200, 7300])
    assert_array_equal(np.diff(signal[:, 0]), 1.0)  # samples in sequence, to the last
    assert summary.left_over == pytest.approx(
        {"a.wav": 0.5, "b.wav": 0.5, "c.wav": 0.5, "z.wav": 0.2}
    )
    assert manifest.groupby("file")["group"].nunique().tolist() == [1, 1, 1, 1]


def test_overlap_is_part_of_the_segment(files, tmp_path):
    _, _, manifest, signal = made(files[:1], tmp_path / "x.h5", segment=1.0, overlap=0.75)
    assert_allclose(manifest["start_s"], np.arange(7) / 4)
    assert_array_equal(signal[:, 0, 0], 25.0 * np.arange(7))
    assert signal[-1, 0, -1] == 249  # the last sample of the file


def test_the_result_depends_on_neither_order_nor_workers(files, tmp_path, monkeypatch):
    labelled = read_labels(None, {"fault": "none", "speed_hz": "600 rpm"})
    monkeypatch.setattr(import_plan, "_WORTH_WORKERS", 0)
    monkeypatch.setattr(import_set, "_BATCH", 700)  # of 500 numbers a file: one file a batch
    results = []
    for number, (order, jobs) in enumerate(
        itertools.product((files, files[::-1]), (1, 2)),
    ):
        path = tmp_path / f"{number}.h5"
        import_recordings(
            order, path, options=DECLARED, tacho="key", labels=labelled, segment=0.5, jobs=jobs
        )
        results.append(content(path))
    assert len(set(results)) == 1
    monkeypatch.setattr(import_set, "_BATCH", 100)  # every file is large: read by this process
    import_recordings(
        files, tmp_path / "y.h5", options=DECLARED, tacho="key", labels=labelled, segment=0.5
    )
    assert content(tmp_path / "y.h5") == results[0]


def test_units_of_files_may_differ_where_si_is_the_same(tmp_path):
    one = tmp_path / "a.csv"
    one.write_text("time [s],acc [g]\n" + "".join(f"{i / 100},{i}\n" for i in range(10)))
    other = tmp_path / "b.csv"
    other.write_text("time [s],acc [m/s^2]\n" + "".join(f"{i / 100},{i}\n" for i in range(10)))
    _, head, _, signal = made([one, other], tmp_path / "x.h5", options=None, tacho=None)
    assert_allclose(signal[0], STANDARD_GRAVITY * signal[1], rtol=1e-7)  # a float32 rounding
    assert head.channels[0].unit_in_file == ""


def test_files_that_differ_are_named_at_once(files, tmp_path):
    save(tmp_path / "fast.wav", wave(0), rate=200)
    save(tmp_path / "short.wav", wave(0, 99))
    everything = [*files, tmp_path / "fast.wav", tmp_path / "short.wav"]
    text = refused(everything, tmp_path / "x.h5", "same sample rate")
    assert "100 Hz in a.wav, b.wav, c.wav, short.wav; 200 Hz in fast.wav" in text
    assert "shortest short.wav with 0.99 s (99 samples), longest a.wav with 2.5 s" in text
    assert "import each rate by itself, or resample_to one of them" in text
    text = refused(everything, tmp_path / "x.h5", "shorter than the segment of 2 s", segment=2.0)
    assert "1 of 5 files" in text


def test_channels_that_differ_are_named(tmp_path):
    for name, title in (("a", "acc [g]"), ("b", "acc [g]"), ("c", "vel [mm/s]")):
        rows = "".join(f"{i / 10},{i}\n" for i in range(10))
        (tmp_path / f"{name}.csv").write_text(f"time [s],{title}\n{rows}")
    text = refused(
        [tmp_path / f"{name}.csv" for name in "abc"],
        tmp_path / "x.h5",
        "same channels",
        options=None,
        tacho=None,
    )
    assert "acc [m/s^2] in a.csv, b.csv; vel [m/s] in c.csv" in text


def test_rates_that_differ_by_a_printed_digit_are_one(tmp_path):
    for name, step in (("a", 0.01), ("b", 0.01 * (1 + 2e-6)), ("c", 0.01 * (1 + 1e-3))):
        rows = "".join(f"{i * step:.9f},1\n" for i in range(500))
        (tmp_path / f"{name}.csv").write_text("time [s],acc [g]\n" + rows)
    both = [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert made(both, tmp_path / "x.h5", options=None, tacho=None)[1].sample_rate == 100.0
    refused(
        [*both, tmp_path / "c.csv"], tmp_path / "y.h5", "same sample rate", options=None, tacho=None
    )


def test_bad_numbers_are_refused_at_once(files, tmp_path):
    for options, message in (
        ({"segment": 0.0}, r"segment = 0\.0 s must be > 0"),
        ({"segment": float("nan")}, "segment = nan s must be > 0"),
        ({"segment": 1.0, "overlap": 1.0}, r"overlap = 1\.0 must be >= 0 and < 1"),
        ({"overlap": 0.5}, r"overlap = 0\.5 needs a segment"),
        ({"pulses_per_revolution": 0}, "pulses_per_revolution = 0 must be >= 1"),
        ({"jobs": 0}, "jobs = 0 must be >= 1"),
        ({"tacho": None, "pulses_per_revolution": 2}, "must be those of a tacho"),
    ):
        refused(files, tmp_path / "x.h5", message, **options)


def test_every_bad_file_is_named_at_once(files, tmp_path):
    (tmp_path / "cut.wav").write_bytes(files[0].read_bytes()[:30])
    text = refused(
        [*files, tmp_path / "cut.wav", tmp_path / "no.wav", tmp_path],
        tmp_path / "x.h5",
        "no.wav: no such file",
    )
    assert "cut.wav" in text
    assert f"{tmp_path} is a folder" in text
    refused([*files, files[0]], tmp_path / "x.h5", "given twice")
    refused([], tmp_path / "x.h5", "0 files, must be >= 1")


def test_a_gap_in_the_middle_leaves_nothing_behind(files, tmp_path):
    signal = wave(0)
    signal[0, 222] = np.nan
    save(tmp_path / "zz.wav", signal)
    text = refused([*files, tmp_path / "zz.wav"], tmp_path / "x.h5", "index 222", segment=0.5)
    assert "zz.wav: channel 'acc' is nan" in text


def test_an_interrupted_import_leaves_nothing_behind(files, tmp_path):
    def stop(done, total):
        if (done, total) == (2, 3):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        made(files, tmp_path / "x.h5", progress=stop)
    assert not list(tmp_path.glob("x.h5*"))


def test_an_existing_file_is_replaced_only_by_force(files, tmp_path):
    path, part = tmp_path / "x.h5", tmp_path / "x.h5.part"
    path.write_text("mine")
    with pytest.raises(DataError, match=r"x\.h5 exists; .* use force"):
        made(files, path)
    assert path.read_text() == "mine"
    with pytest.raises(DataError, match="same length"):
        made([*files, save(tmp_path / "s.wav", wave(0, 99))], path, force=True)
    assert path.read_text() == "mine"
    path.unlink()
    part.write_text("hours of another run")
    assert made(files, path)[0].n_records == 3
    assert made(files, path, force=True)[0].n_records == 3
    assert part.read_text() == "hours of another run"


# --- tacho --------------------------------------------------------------------------------------


def test_speed_by_the_tacho_and_records_without_pulses(tmp_path):
    signal = wave(0, 400)
    signal[1, 200:] = 0.0  # the machine stops after two seconds
    path = save(tmp_path / "a.wav", signal)
    summary, _, manifest, _ = made([path], tmp_path / "x.h5", segment=1.0)
    assert manifest["status"].tolist() == ["ok", "ok", NO_PULSES, NO_PULSES]
    # a period of ten samples, its edge at the same place of each
    assert_allclose(manifest["mean_speed_hz"], [10, 10, np.nan, np.nan], rtol=1e-12)
    assert summary.statuses == {"ok": 2, NO_PULSES: 2}
    assert_allclose(summary.speeds, [10, 10], rtol=1e-12)
    manifest = made([path], tmp_path / "y.h5", segment=1.0, pulses_per_revolution=4)[2]
    assert_allclose(manifest["mean_speed_hz"][:2], 2.5, rtol=1e-12)


def test_a_channel_without_pulses_is_no_tacho(tmp_path):
    path = save(tmp_path / "a.wav", wave(0, 200))
    text = refused([path], tmp_path / "x.h5", "'acc' has a revolution", tacho="acc")
    assert "0 of 1 records" in text
    # ten pulses and no more: nine intervals are no revolution of ten
    refused([path], tmp_path / "x.h5", "has a revolution", segment=1.0, pulses_per_revolution=10)
    refused([path], tmp_path / "x.h5", r"no channel 'kye' .*did you mean 'key'", tacho="kye")


# --- labels -------------------------------------------------------------------------------------


def table(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_labels_groups_and_grades(files, tmp_path):
    text = (
        f"file,{CLEARANCE},speed [rpm],fault,grade,group,confounder_leak\n"
        "b.wav,0.00025,600,outer,,pump 2,1\n"
        "c.wav,0.05 mm,300,,0,pump 2,0\n"
        "a.wav,,,none,3,pump 1,0\n"
        "elsewhere.wav,1,1,x,1,x,1\n"
    )
    known = read_labels(table(tmp_path / "l.csv", text), {"load_n": "2 kN"})
    assert known.severities == (CLEARANCE,)
    limits = read_limits("bilge-pump", known.severities)
    summary, head, manifest, _ = made(
        files, tmp_path / "x.h5", labels=known, limits=limits, segment=1.0
    )
    rows = manifest[::2].reset_index(drop=True)  # two records of a file are alike
    assert rows["file"].tolist() == ["a.wav", "b.wav", "c.wav"]
    assert_array_equal(rows[CLEARANCE], [np.nan, 0.00025, 0.00005])
    assert_array_equal(rows["speed_hz"], [np.nan, 10, 5])
    assert rows["fault"].tolist() == ["none", "outer", ""]
    # the edges of the scene are 0.13, 0.22 and 0.31 mm; where the wear is unknown, as labelled
    assert rows["grade"].tolist() == [3, 2, 0]
    assert rows["group_name"].tolist() == ["pump 1", "pump 2", "pump 2"]
    assert rows["group"].tolist() == [0, 1, 1]
    assert rows["confounder_leak"].tolist() == [False, True, False]
    assert_array_equal(rows["load_n"], 2000.0)
    assert (head.severities, head.condemning_limit) == ((CLEARANCE,), 0.00031)
    assert head.grade_edges == (0.00013, 0.00022, 0.00031)
    assert "Jetstream" in head.limit_source
    assert (summary.unused_rows, summary.grades) == (1, {0: 2, 2: 2, 3: 2})


def test_decimal_commas_and_other_separators(files, tmp_path):
    for delimiter in ";\t":
        text = f"file;scar_depth_bearing [mm];n\n{files[0].name};0,25;1,5\n".replace(";", delimiter)
        known = read_labels(table(tmp_path / "l.csv", "\ufeff" + text))
        assert known.columns == {"scar_depth_bearing_m": (0.00025,), "n": (1.5,)}


def test_pressures_that_no_pump_has_are_refused_with_their_lines(tmp_path):
    """A model would use them as noted: 3 Pa for 3 bar, a vacuum below nothing, sides swapped."""
    text = (
        "file,discharge_pressure [bar],suction_pressure [bar]\n"
        "a.wav,3,-0.3\nb.wav,-5,\nc.wav,-0.3,3\nd.wav,,\ne.wav,0,0\n"
    )
    with pytest.raises(DataError) as error:
        read_labels(table(tmp_path / "l.csv", text))
    first, second = str(error.value).splitlines()
    assert "line 3: discharge_pressure_pa = -500000 must be > -101325; check value" in first
    assert (
        "line 4: discharge_pressure_pa = -30000 must be >= suction_pressure_pa = 300000" in second
    )
    both = {"discharge_pressure_pa": "1 bar", "suction_pressure_pa": "2 bar"}
    with pytest.raises(DataError, match="label: discharge_pressure_pa = 100000 must be >= suct"):
        read_labels(None, both)
    rows = table(tmp_path / "m.csv", "file,discharge_pressure_pa\na.wav,3 bar\nb.wav,3\n")
    with pytest.raises(DataError, match="line 3: discharge_pressure_pa = 3 must be >= suction"):
        read_labels(rows, {"suction_pressure_pa": "0.2 bar"})
    with pytest.raises(DataError, match=r"label: viscosity_pa_s = -0\.03 must be > 0"):
        read_labels(None, {"viscosity_pa_s": "-30 mPa s"})


def test_numbers_keep_their_group_names(files, tmp_path):
    text = "file,group\na.wav,12\nb.wav,7\nc.wav,12\n"
    known = read_labels(table(tmp_path / "l.csv", text))
    assert made(files, tmp_path / "x.h5", labels=known)[2]["group"].tolist() == [12, 7, 12]
    manifest = made(files, tmp_path / "y.h5", labels=known, group_by="file")[2]
    assert manifest["group"].tolist() == [0, 1, 2]
    alike = read_labels(table(tmp_path / "m.csv", "file,group\na.wav,7\nb.wav,07\nc.wav,7\n"))
    assert made(files, tmp_path / "z.h5", labels=alike)[2]["group"].tolist() == [1, 0, 1]


def test_folders_as_groups_and_files_of_one_name(tmp_path):
    paths = [
        save(tmp_path / folder / name, wave(i))
        for i, (folder, name) in enumerate([("new", "1.wav"), ("worn", "1.wav"), ("worn", "2.wav")])
    ]
    manifest = made(paths, tmp_path / "x.h5", group_by="folder")[2]
    assert manifest["file"].tolist() == ["new/1.wav", "worn/1.wav", "worn/2.wav"]
    assert manifest["group_name"].tolist() == ["new", "worn", "worn"]
    rows = "file,fault\n1.wav,a\nworn/2.wav,b\n"
    refused(
        paths, tmp_path / "y.h5", r"line 2: file '1\.wav' fits .*new.*worn",
        labels=read_labels(table(tmp_path / "l.csv", rows)),
    )  # fmt: skip
    rows = "file,fault\nnew/1.wav,a\nworn\\1.wav,b\nworn/2.wav,c\n"
    known = read_labels(table(tmp_path / "l.csv", rows))
    assert made(paths, tmp_path / "z.h5", labels=known)[2]["fault"].tolist() == ["a", "b", "c"]


def test_rows_missing_and_twice_are_named_at_once(files, tmp_path):
    rows = "file,fault\na.wav,x\na.wav,y\nbb.wav,z\n"
    text = refused(
        files, tmp_path / "x.h5", "lines 2, 3 are all about",
        labels=read_labels(table(tmp_path / "l.csv", rows)),
    )  # fmt: skip
    assert "no row for 2 file(s), b.wav, c.wav" in text
    assert "is 'bb.wav' meant for b.wav?" in text


def test_labels_do_not_contradict_file_or_limits(tmp_path):
    for name, rate in (("a", 25.0), ("b", 30.0)):
        bearing = {"gs": np.ones(9), "sr": 10.0, "rate": rate}
        savemat(tmp_path / f"{name}.mat", {"bearing": bearing})
    files = [tmp_path / "a.mat", tmp_path / "b.mat"]
    plain = {"options": None, "tacho": None}
    text = refused(
        files, tmp_path / "x.h5", r"b\.mat: label speed_hz = 25\.0 must be 30, as the file",
        labels=read_labels(None, {"speed_hz": "1500 rpm"}), **plain,
    )  # fmt: skip
    assert "a.mat" not in text
    known = read_labels(None, {CLEARANCE: "0.2 mm", "grade": "3"})
    refused(
        files, tmp_path / "x.h5", r"grade = 3 must be 1 by diametral", labels=known,
        limits=read_limits("bilge-pump", known.severities), **plain,
    )  # fmt: skip
    millimetres = read_labels(None, {CLEARANCE: "0.2"})
    text = refused(
        files, tmp_path / "x.h5", r"a\.mat \(and 1 more\): .* = 0\.2 m must be at most 20 times",
        labels=millimetres, limits=read_limits("bilge-pump", known.severities), **plain,
    )  # fmt: skip
    assert "as in 'diametral_clearance_crankpin [mm]'" in text
    manifest = made(files, tmp_path / "x.h5", **plain)[2]
    assert manifest["speed_hz"].tolist() == [25.0, 30.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,fault\na.wav,x\n", "no column 'file'"),
        ("file,fault\n", "has 0 rows below its header"),
        ("file,fault\na.wav\n", r"line 2: has 1 cells, must have 2"),
        ("file,fault,fault\na.wav,1,2\n", "'fault' is there 2 times"),
        ("file,,x\na.wav,1,2\n", "column 2 has no name"),
        ("file,speed_hz\na.wav,fast\n", "line 2: speed_hz = 'fast' has no leading number"),
        ("file,speed_hz\na.wav,1 mm\n", "has unit 'mm', not one of rotation speed"),
        ("file,speed_hz\na.wav,1e999\n", "must be finite"),
        ("file,speed [mm]\na.wav,5 mm\n", "the heading says mm; leave the unit out"),
        ("file,speed [kn]\na.wav,5\n", r"has unit 'kn' behind 'speed', must be a name and one of"),
        ("file,speed_hz [mm]\na.wav,5\n", "must be one of rotation speed"),
        ("file,gap\na.wav,0.2 mm\n", "must end in _m, the SI one"),
        ("file,grade\na.wav,4\n", "grade = '4' must be a whole number >= 0 and <= 3"),
        ("file,group\na.wav,\n", "must name the machine"),
        ("file,confounder_x\na.wav,yes\n", "must be 0"),
        ("file,status\na.wav,1\n", "status is a name of the import's own"),
        (f"file,{CLEARANCE}\na.wav,-1 mm\n", r"= -0\.001 m must be >= 0"),
        (f"file,fault\na.wav,{'x' * 201}\n", "has 201 byte, must have <= 200"),
    ],
)
def test_labels_at_fault(tmp_path, text, message):
    with pytest.raises(DataError, match=message):
        read_labels(table(tmp_path / "l.csv", text))


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.sampled_from(["file,{}\n", "file;{}\n", "{}\tfile\n", "{}"]),
    st.sampled_from(["grade", "group", "speed_hz", "gap [mm]", "confounder_x", "a", '"']),
    st.text(alphabet='a.wv,;\t"\n\r\0 0123456789-+e[]m\u00b5\ufeff', max_size=60),
)
def test_any_table_is_read_or_refused(tmp_path, head, name, body):
    path = tmp_path / "any.csv"
    path.write_bytes((head.format(name) + body).encode())
    try:
        found = read_labels(path)
    except DataError:
        return
    assert {len(values) for values in found.columns.values()} <= {len(found.entries)}
    numbers = [v for row in found.columns.values() for v in row if isinstance(v, float)]
    assert not np.isinf(numbers).any()
    assert found.of_files([])[1] == len(found.entries)


def test_a_scene_names_the_severities_that_it_has_limits_for():
    with pytest.raises(DataError, match="of slack_pin_m, it has those of diametral_clearance_cra"):
        read_limits("bilge-pump", ["slack_pin_m"])


def test_labels_of_other_kinds_at_fault(tmp_path, monkeypatch):
    for path, constants, severities, message in (
        (tmp_path / "no.csv", {}, (), "no such file"),
        (None, {"a": "1"}, ("b",), "severity b is no label"),
        (None, {"gap_m": "1"}, ("gap_m",), "must name kind, place and metres"),
        (
            *(None, {"clearance_m": "1"}, ("clearance_m",)),
            "severity clearance_m must .* rename the label to diametral_clearance_crankpin_m",
        ),
        (table(tmp_path / "l.csv", "file,a\nx,1\n"), {"a": "2"}, (), "is also a column of"),
    ):
        with pytest.raises(DataError, match=message):
            read_labels(path, constants, severities)
    (tmp_path / "latin.csv").write_bytes("file,a\nx,\xb5\n".encode("latin-1"))
    with pytest.raises(DataError, match="is not UTF-8 at byte 9"):
        read_labels(tmp_path / "latin.csv")
    monkeypatch.setattr(label_table, "LARGEST_TABLE", 10)
    with pytest.raises(DataError, match="has 11 byte, must be <= 10"):
        read_labels(tmp_path / "l.csv")


def test_a_severity_of_ones_own(files, tmp_path):
    known = read_labels(None, {"groove_depth_seal_m": "40 um"}, ["groove_depth_seal_m"])
    limits = read_limits("10 um, 20 um, 0.05 mm", known.severities)
    head, manifest = made(files, tmp_path / "x.h5", labels=known, limits=limits)[1:3]
    assert head.severities == ("groove_depth_seal_m",)
    assert (head.limit_source, head.condemning_limit) == ("given on import", 5e-5)
    assert set(manifest["grade"]) == {2}
    for text, severities, message in (
        ("1 um, 2 um", ["x"], "must be 3 lengths > 0 that rise"),
        ("2 um, 1 um, 3 um", ["x"], "must be 3 lengths > 0 that rise"),
        ("0 um, 1 um, 3 um", ["x"], "must be 3 lengths > 0 that rise"),
        ("1, 2, 3", ["x"], "has no unit"),
        ("bilge-pump", ["groove_depth_seal_m"], "no wear limits of groove_depth_seal_m"),
        ("bilge-pump", [], "must be about a severity"),
    ):
        with pytest.raises(DataError, match=message):
            read_limits(text, severities)
    refused(files, tmp_path / "y.h5", "must be about a severity", limits=limits)
    refused(files, tmp_path / "y.h5", "needs the label 'group'", group_by="column")


# --- leaks and memory ---------------------------------------------------------------------------


def test_a_record_in_two_groups_is_reported(files, tmp_path):
    (tmp_path / "copy.wav").write_bytes(files[1].read_bytes())  # a.wav
    everything = [*files, tmp_path / "copy.wav"]
    summary = made(everything, tmp_path / "x.h5", segment=1.0)[0]
    assert summary.twins == (("a.wav", "copy.wav"),)
    one = read_labels(None, {"group": "pump"})
    assert made(everything, tmp_path / "y.h5", labels=one, segment=1.0)[0].twins == ()


def test_a_large_file_is_imported_with_flat_memory(tmp_path):
    path, size = tmp_path / "big.raw", 2**27
    with path.open("wb") as file:
        file.truncate(size)  # sparse
    options = SourceOptions(dtype="<int16", n_channels=2, order="interleaved", fs=2.0**14, unit="V")
    tracemalloc.start()
    try:
        summary = import_recordings([path], tmp_path / "x.h5", options=options, segment=64.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert summary.n_records == 32
    # of the 128 MB: a record of 8 MB, a piece of 2^20 numbers as int16, two doubles and masks
    assert peak < 48e6


def test_a_simulated_set_comes_back_with_the_same_features(few_set, few_trained, tmp_path):
    from wearstate.diagnose.feature_rows.feature_table import feature_table
    from wearstate.diagnose.wear_model.train import train_model

    options = SourceOptions(channels=("acc_x", "acc_y", "tacho"), unit="m/s^2")
    with DataSet(few_set) as data:
        rows = [["file", "group", CLEARANCE]]
        for i, item in enumerate(data):
            wavfile.write(tmp_path / f"{i:03d}.wav", int(item.sample_rate), item.signal.T)
            rows.append([f"{i:03d}.wav", item.row["group"], repr(float(item.row[CLEARANCE]))])
        limits = read_limits("bilge-pump", [CLEARANCE])
        assert data.attributes.grade_edges == limits.edges
    with (tmp_path / "labels.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    path = tmp_path / "measured.h5"
    import_recordings(
        sorted(tmp_path.glob("*.wav")), path, options=options, tacho="tacho",
        labels=read_labels(tmp_path / "labels.csv"), limits=limits, jobs=2,
    )  # fmt: skip
    before, after = feature_table(few_set), feature_table(path)
    assert after.names == before.names
    assert_array_equal(after.values, before.values)  # a float WAV keeps every bit
    for column in ("group", "grade", CLEARANCE, "signal_crc32"):
        assert_array_equal(after.manifest[column], before.manifest[column])
    ours, theirs = few_trained[0], train_model(path)[0]
    assert_array_equal(theirs.predict(after.values), ours.predict(before.values))
    assert (theirs.notice, ours.notice != "") == ("", True)  # origin: measured


def test_text_files_come_back_with_the_same_features(small_set, tmp_path):
    from wearstate.diagnose.feature_rows.feature_table import recording_features

    with DataSet(small_set) as data:
        items = [data[i] for i in range(2)]
    for i, item in enumerate(items):
        time = np.arange(item.signal.shape[1]) / item.sample_rate
        np.savetxt(
            tmp_path / f"{i}.csv", np.column_stack([time, item.signal.T]), delimiter=",",
            fmt=["%.9f", "%.9g", "%.9g", "%.9g"], comments="",
            header="time [s],acc_x [m/s^2],acc_y [m/s^2],tacho [V]",
        )  # fmt: skip
    path = tmp_path / "x.h5"
    import_recordings([tmp_path / "0.csv", tmp_path / "1.csv"], path, tacho="tacho")
    with DataSet(path) as data:
        for i, item in enumerate(items):
            assert_array_equal(data[i].signal, item.signal)  # nine digits tell float32 apart
            # the rate is that of times printed to a nanosecond: 1e-9 of 4.8 s
            assert_allclose(
                recording_features(data[i])[1], recording_features(item)[1], rtol=1e-6, atol=1e-6
            )


def test_measured_bearings_become_a_data_set(realdata, tmp_path):
    from wearstate.diagnose.feature_rows.feature_table import feature_table
    from wearstate.diagnose.wear_model.train import train_model

    folder = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0"
    files = sorted(folder.glob("*_vload_*.mat"))
    rows = "".join(f"{f.name},{'inner' if f.name[0] == 'I' else 'outer'}\n" for f in files)
    known = read_labels(table(tmp_path / "l.csv", "file,fault\n" + rows))
    path = tmp_path / "x.h5"
    summary, _, manifest, _ = made(files, path, options=None, tacho=None, labels=known, segment=0.5)
    assert (summary.n_records, summary.n_groups, summary.left_over) == (48, 8, {})
    assert manifest["fault"].tolist() == ["inner"] * 24 + ["outer"] * 24
    assert_allclose(manifest["speed_hz"], 25.0)
    found = feature_table(path)
    kurtosis = found.values[:, found.names.index("gs.kurtosis")].reshape(8, 6).mean(axis=1)
    # known of these files: inner 28 to 51, outer 3.2 to 17.7
    assert kurtosis[:4].min() > 20 > kurtosis[4:].max()
    with pytest.raises(DataError, match=r"no severity, must have one.*label the wear"):
        train_model(path)
    refused(
        [*files, folder / "baseline_1.mat"], tmp_path / "y.h5", "97656 Hz in baseline_1.mat",
        options=None, tacho=None, segment=0.5,
    )  # fmt: skip
