"""Features of records with a low rate, and of records whose speed stands in the manifest."""

import numpy as np
import pandas as pd
import pytest
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.diagnose.feature_rows.feature_table import choice_of, feature_table
from wearstate.diagnose.inspect.info import plot_file
from wearstate.diagnose.pictures.envelope import envelope_panel
from wearstate.diagnose.pictures.view import View
from wearstate.features.catalogue import needs
from wearstate.features.catalogue import row as table
from wearstate.features.rotation import order
from wearstate.features.signal.envelope import bearing_frequencies
from wearstate.sim.output.sensor import Channel

from .command_line import run

BEARING = (8, 20.0, 120.0)


def data_set(path, rate, rows, *, tacho=None, seconds=2.0, strikes=None):
    """One record a row of the manifest: noise, with blows at `strikes` [Hz] that ring at 6 kHz."""
    t = np.arange(round(seconds * rate)) / rate
    signals = [np.random.default_rng(0).standard_normal(t.size)]
    if strikes is not None:  # without noise the weak foot of the resonance would be as spiky
        signals[0] += 10 * np.exp(-1500 * (t % (1 / strikes))) * np.sin(2 * np.pi * 6000 * t)
    channels = [Channel(name="acc", unit="m/s^2", quantity="acceleration")]
    if tacho is not None:
        signals.append(np.where(tacho * t % 1 < 0.1, 5.0, 0.0))
        channels.append(Channel(name="tacho", unit="V", quantity="tacho"))
    head = Attributes(
        sample_rate=rate,
        channels=tuple(channels),
        origin="measured",
        tacho=None if tacho is None else "tacho",
    )
    columns = {name: "<f8" for row in rows for name in row}
    with DataSetWriter(
        path, head, n_records=len(rows), n_samples=t.size, columns=columns
    ) as writer:
        for index, row in enumerate(rows):
            names = {"record_id": str(index), "status": "ok"}
            writer.write(index, np.stack(signals), {**names, **row})
        writer.finish()
    return path


# --- low rates


@pytest.mark.parametrize(("rate", "lines"), [(2560.0, 12), (1280.0, 5)])
def test_a_rate_without_room_for_the_map_leaves_it_out_and_says_so(tmp_path, rate, lines):
    data, path = data_set(tmp_path / "d.h5", rate, [{}], tacho=5.0), tmp_path / "t.csv"
    done = run("features", data, "-o", path, "-j", 1)
    assert "absent: crank_angle_map, angle_harmonics, dead_centre_levels" in done.stderr
    assert f"fs = {rate:g} Hz is too low: n_bands = 20 must be <= {lines}" in done.stderr
    columns = pd.read_csv(path).columns
    assert {"acc.rms", "acc.order_01.level_db", "shaft.speed_hz"} <= set(columns)
    assert not any(".angle_" in name for name in columns)


def test_only_asks_nothing_of_the_other_rows(tmp_path, monkeypatch):
    data = data_set(tmp_path / "d.h5", 80.0, [{}], tacho=5.0)
    found = feature_table(data, choice=choice_of(only=["rms", "speed"]))
    assert found.names == ("acc.rms", "shaft.speed_hz")
    assert found.values[0, 1] == pytest.approx(5.0, rel=1e-6)
    monkeypatch.setattr(order, "pulse_times", None)  # not even the tacho is read
    assert feature_table(data, choice=choice_of(only=["rms"])).names == ("acc.rms",)
    refused = run("features", data, "-o", tmp_path / "t.csv", "--only", "band_levels", code=2)
    assert "band_levels is not available: fs = 80 Hz is too low: low = 50.0 Hz" in refused.stderr


@pytest.mark.parametrize("rate", [64.0, 100.0, 150.0, 500.0, 1280.0, 2560.0, 4096.0, 8192.0])
def test_every_rate_has_a_row(rate):
    signal = np.random.default_rng(1).standard_normal((1, 4096))
    tacho = np.where(rate / 64 * np.arange(4096) / rate % 1 < 0.1, 5.0, 0.0)
    names, values = table.feature_row(signal, rate, tacho=tacho)
    layout = needs.Layout(channels=("ch_0",), quantities=("acceleration",), fs=rate, tacho=True)
    absent = table.absent_features(layout, "standard")
    assert np.isfinite(values).all()
    assert ("crank_angle_map" in absent) == (not any(".angle_" in name for name in names))
    assert ("band_levels" in absent) == (not any(".band_" in name for name in names))


# --- speed of the manifest


def score(data, race="outer", **about):
    choice = choice_of(only=["bearing_lines"], bearing=BEARING, **about)
    found = feature_table(data, choice=choice)
    return found.values[:, found.names.index(f"acc.bearing_{race}.score")]


OUTER = bearing_frequencies(*BEARING).outer


def test_the_stored_speed_places_the_lines_of_a_bearing(tmp_path):
    rows = [{"speed_hz": 25.0}, {"speed_hz": 29.0}]
    data = data_set(tmp_path / "d.h5", 20_480.0, rows, strikes=25 * OUTER)
    stored = score(data)
    assert stored[0] > 20 > 5 > stored[1]  # the second one's speed is not that of the blows
    given = score(data, speed_hz=25.0)  # what is given goes before what is stored
    assert given[0] == given[1] == stored[0]
    run("features", data, "-o", tmp_path / "t.csv", "--bearing", "8,20,120", "--set", "core")
    assert "acc.bearing_outer.score" in pd.read_csv(tmp_path / "t.csv")


def test_the_mean_of_the_record_goes_before_the_speed_as_set(tmp_path):
    rows = [{"speed_hz": 29.0, "mean_speed_hz": 25.0}, {"speed_hz": 25.0, "mean_speed_hz": np.nan}]
    data = data_set(tmp_path / "d.h5", 20_480.0, rows, strikes=25 * OUTER)
    assert (score(data) > 20).all()


def test_the_tacho_goes_before_everything_in_table_and_picture(tmp_path):
    data = data_set(
        tmp_path / "d.h5", 20_480.0, [{"speed_hz": 29.0}], strikes=25 * OUTER, tacho=25.0
    )
    assert score(data, speed_hz=31.0)[0] > 20
    with DataSet(data) as found:
        view = View(recording=found[0], speed_hz=31.0)
    assert view.speed == pytest.approx(25.0, rel=1e-3)


def test_the_picture_takes_the_same_speed(tmp_path):
    rows = [{"speed_hz": 29.0, "mean_speed_hz": 25.0}]
    data = data_set(tmp_path / "d.h5", 20_480.0, rows, strikes=25 * OUTER)
    with DataSet(data) as found:
        recording = found[0]
    assert View(recording=recording).speed == 25.0
    assert View(recording=recording, speed_hz=31.0).speed == 31.0
    assert envelope_panel(View(recording=recording, bearing=bearing_frequencies(*BEARING)))
    made = plot_file(data, tmp_path / "p.png", kind="envelope", bearing=BEARING)
    assert made["drawn"] == ["envelope"]


def test_a_bearing_without_any_speed_says_where_one_can_come_from(tmp_path):
    data = data_set(tmp_path / "d.h5", 20_480.0, [{}])
    options = ("--only", "bearing_lines", "--bearing", "8,20,120")
    done = run("features", data, "-o", tmp_path / "t.csv", *options, code=2)
    assert "--speed-hz = None must be given without a tacho" in done.stderr


def test_a_speed_that_only_some_records_have_is_refused(tmp_path):
    data = data_set(tmp_path / "d.h5", 20_480.0, [{"speed_hz": 25.0}, {"speed_hz": np.nan}])
    options = ("--set", "core", "--bearing", "8,20,120")
    done = run("features", data, "-o", tmp_path / "t.csv", *options, "-j", 1, code=2)
    assert "features are not in every record" in done.stderr
    assert "give --speed-hz for all" in done.stderr
    assert not (tmp_path / "t.csv").exists()


# --- one kurtogram


@pytest.mark.parametrize("about", [{}, {"speed_hz": 25.0}, {"speed_hz": 25.0, "bearing": BEARING}])
def test_table_and_picture_choose_the_same_band(tmp_path, about):
    data = data_set(tmp_path / "d.h5", 20_480.0, [{}], strikes=82.5)
    found = feature_table(data, choice=choice_of(only=["kurtogram"], **about))
    row = dict(zip(found.names, found.values[0], strict=True))
    low, high = (
        row["acc.kurtogram.centre_hz"] + sign * row["acc.kurtogram.bandwidth_hz"] / 2
        for sign in (-1, 1)
    )
    settings = choice_of(**about).settings
    with DataSet(data) as opened:
        view = View(recording=opened[0], speed_hz=settings.speed_hz, bearing=settings.bearing)
    [drawn] = envelope_panel(view).draw.keywords["spectra"]
    assert drawn.found.band == (low, high)
    assert low < 6000 < high
    assert drawn.found.highest == pytest.approx(row["acc.kurtogram.kurtosis"], rel=1e-5)
