"""Pictures of recordings: what is drawn is where it must be, in the right unit, or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter
from wearstate.diagnose.pages.picture import save_picture
from wearstate.diagnose.pictures.kinds import AUTO, KINDS, make_panel, plot_recording
from wearstate.diagnose.pictures.panel import panel_figure
from wearstate.diagnose.pictures.view import View, thinned
from wearstate.features.signal.envelope import bearing_frequencies
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel

UNITS = {"acceleration": "m/s^2", "displacement": "m", "force": "N", "tacho": "V"}
FS = 4096.0


def recording(fs=FS, *, per_turn=1, row=None, place="", **rows):
    """Channels by name; the letters before a figure or underscore tell the quantity."""
    kinds = {"acc": "acceleration", "probe": "displacement", "force": "force", "tacho": "tacho"}
    channels = [
        Channel(
            name=name,
            unit=UNITS[kinds[name.split("_")[0]]],
            quantity=kinds[name.split("_")[0]],
            place=name.split("_")[-1] if place else "",
        )
        for name in rows
    ]
    return Recording(
        signal=np.stack(list(rows.values())),
        sample_rate=fs,
        channels=tuple(channels),
        tacho="tacho" if "tacho" in rows else None,
        pulses_per_revolution=per_turn,
        row=row or {},
        source="here.h5[0]",
    )


def view(fs=FS, *, about=None, **rows):
    return View(recording=recording(fs, **rows), **(about or {}))


def clock(duration, fs=FS):
    return np.arange(round(duration * fs)) / fs


def pulses(phase):
    """Tacho of a phase [rev]: up for the first tenth of every revolution."""
    return np.where(phase % 1 < 0.1, 5.0, 0.0)


def axes_of(seen, kind):
    return panel_figure(make_panel(seen, kind)).axes


def line(axes, label):
    [found] = [each for each in axes.get_lines() if each.get_label() == label]
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def upright(axes, style):
    """Places of the vertical lines of a style."""
    return sorted(
        float(each.get_xdata()[0])
        for each in axes.get_lines()
        if each.get_linestyle() == style and len(each.get_xdata()) == 2
    )


# --- waveform


def test_waveform_shows_every_peak_where_it_is_in_micrometres():
    t = clock(30)  # 122,880 samples, far more than points
    wave = 1e-5 * np.sin(2 * np.pi * 3 * t)
    wave[54_321] = 4e-5
    [axes] = axes_of(view(probe=wave), "waveform")
    x, y = line(axes, "probe")
    assert len(x) <= 4000
    # the sample is stored as float32: 6e-8 of it
    assert_allclose((x[np.argmax(y)], y.max()), (54_321 / FS, 40.0), rtol=1e-6)
    assert axes.get_ylabel() == "[µm]"
    assert axes.get_xlim() == (0, 30)


def test_waveform_of_a_shaft_is_two_revolutions_with_its_pulses():
    t = clock(2)
    seen = view(acc=np.cos(t), tacho=pulses(10 * t - 0.5))
    [axes] = axes_of(seen, "waveform")
    assert_allclose(axes.get_xlim(), (0, 0.2), atol=1 / FS)
    # half a sample between the last low and the first high one
    assert_allclose(upright(axes, "--"), [0.05, 0.15], atol=1 / FS)


# --- points


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(2, 3000), st.integers(4, 400), st.booleans())
def test_thinned_keeps_the_extremes_and_invents_nothing(seed, n, most, logarithmic):
    y = np.random.default_rng(seed).standard_normal(n)
    x = np.arange(1.0, n + 1)
    kept, values = thinned(x, y, most, logarithmic=logarithmic)
    assert len(kept) <= max(most, 2) or n <= most
    assert np.all(np.diff(kept) > 0)
    assert np.array_equal(values, y[kept.astype(int) - 1])
    assert (values.max(), values.min()) == (y.max(), y.min())


# --- spectrum


def test_spectrum_reads_density_and_amplitude_of_a_tone():
    t = clock(8)
    amplitude = 0.25
    seen = view(acc=amplitude * np.sin(2 * np.pi * 80 * t), tacho=pulses(20 * t))
    density, orders = axes_of(seen, "spectrum")
    x, y = line(density, "acc")
    spacing = 4.0  # Hz: 1024 samples
    # Hann's own line holds 1 / 1.5 of a tone's mean square; float32 transforms: 1e-6 of it
    expected = 10 * np.log10(amplitude**2 / 2 / 1.5 / spacing)
    assert_allclose((x[np.argmax(y)], y.max()), (80.0, expected), atol=1e-4)
    assert density.get_ylabel() == "PSD\n[dB re 1 (m/s²)²/Hz]"
    x, y = line(orders, "acc")
    assert_allclose((x[np.argmax(y)], y.max()), (80.0, amplitude), rtol=1e-5)
    assert orders.get_ylabel() == "amplitude\n[m/s²]"
    # 64 samples of the tacho a revolution, its edges between two of them: 20 Hz to 1e-5
    assert_allclose(upright(orders, ":"), 20.0 * np.arange(1, 21), rtol=1e-4)
    assert upright(density, ":") == []


def test_spectrum_keeps_units_apart():
    t = clock(1)
    seen = view(acc=np.sin(40 * t), probe_1=1e-6 * np.sin(50 * t), acc_2=np.sin(60 * t))
    first, second = axes_of(seen, "spectrum")
    assert [each.get_label() for each in first.get_lines()] == ["acc", "acc_2"]
    assert [each.get_label() for each in second.get_lines()] == ["probe_1"]
    assert second.get_ylabel() == "PSD\n[dB re 1 µm²/Hz]"
    # without speed there is no order to mark
    assert "orders" not in make_panel(seen, "spectrum").caption


@pytest.mark.parametrize(
    ("about", "row", "speed"),
    [({"speed_hz": 30.0}, {"speed_hz": 10.0}, 30.0), ({}, {"speed_hz": 10.0}, 10.0)],
)
def test_orders_are_marked_at_the_speed_given_or_declared(about, row, speed):
    seen = view(acc=np.sin(clock(2)), row=row, about=about)
    assert upright(axes_of(seen, "spectrum")[1], ":")[:3] == [speed, 2 * speed, 3 * speed]


# --- maps


def mesh(axes):
    """Middles of the columns and rows, and the values of a map."""
    [found] = axes.collections
    corners = np.asarray(found.get_coordinates())
    x, y = corners[0, :, 0], corners[:, 0, 1]
    return (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2, np.asarray(found.get_array())


def test_waterfall_follows_a_tone_that_changes():
    t = clock(16)
    tone = np.where(t < 8, 256.0, 768.0)
    axes, bar = axes_of(view(acc=np.sqrt(2) * np.sin(2 * np.pi * tone * t)), "waterfall")
    frequency, time, level = mesh(axes)
    top = frequency[np.argmax(level, axis=1)]
    early, late = time < 7.5, time > 8.5  # windows of 0.25 s
    assert early.any()
    assert late.any()
    # lines of 4 Hz, not merged: 513 of them
    assert_allclose(top[early], 256.0, atol=1e-9)
    assert_allclose(top[late], 768.0, atol=1e-9)
    # as above: a mean square of 1, of which Hann's own line holds 1 / 1.5
    assert_allclose(level[early].max(), -10 * np.log10(1.5 * 4.0), atol=1e-3)
    assert bar.get_ylabel() == "dB re 1\n(m/s²)²/Hz"


def test_waterfall_of_many_lines_merges_them_and_loses_no_peak():
    fs = 65_536.0
    t = clock(2, fs)
    axes, _ = axes_of(view(fs, acc=np.sin(2 * np.pi * 12_000 * t)), "waterfall")
    frequency, _, level = mesh(axes)
    assert level.shape[1] <= 800
    width = frequency[1] - frequency[0]
    top = frequency[np.argmax(level, axis=1)] * 1e3
    assert_allclose(top, 12_000.0, atol=width * 1e3 / 2)
    # nperseg 16384, lines of 4 Hz, mean square 1/2
    assert_allclose(level.max(), 10 * np.log10(0.5 / 1.5 / 4.0), atol=1e-3)


def test_order_map_of_a_run_up_stands_still():
    t = clock(10)
    phase = 20 * t + 1.5 * t**2  # 20 to 50 Hz
    seen = view(acc=3 * np.cos(2 * np.pi * 3 * phase), tacho=pulses(phase))
    axes, bar = axes_of(seen, "orders")
    order, time, level = mesh(axes)
    assert_allclose(order[np.argmax(level, axis=1)], 3.0, atol=1e-9)
    # one pulse a revolution, to a fraction of a sample of 80: 1 % of the amplitude, 0.1 dB
    assert_allclose(level.max(axis=1), 20 * np.log10(3 / np.sqrt(2)), atol=0.1)
    assert bar.get_ylabel() == "dB re 1 m/s²"
    # frames of 16 revolutions begin with the record, whose first 8 take 0.4 s
    assert 0.2 < time[0] < 0.6
    caption = make_panel(seen, "orders").caption
    assert "speed 20" in caption
    assert "16 revolutions" in caption


def test_crank_angle_map_puts_a_burst_at_its_angle_and_frequency():
    fs = 25_600.0
    t = clock(4, fs)
    phase = 5 * t
    angle = 360 * (phase % 1)
    burst = np.sin(2 * np.pi * 3000 * t) * ((angle > 95) & (angle < 125))
    seen = view(fs, acc=burst, tacho=pulses(phase))
    axes, _ = axes_of(seen, "angle")
    middles, frequency, level = mesh(axes)
    band, place = np.unravel_index(np.argmax(level), level.shape)
    assert middles[place] in (105.0, 115.0)  # bins of 10 degrees inside the burst
    assert abs(frequency[band] / 3000 - 1) < 0.2  # bands of a fifth of the frequency
    assert axes.get_xlabel() == "crank angle after the tacho pulse [deg]"


def test_channels_without_room_are_counted():
    t = clock(1)
    seen = view(**{f"acc_{i}": np.sin(t * i) for i in range(1, 7)})
    panel = make_panel(seen, "waterfall")
    assert panel.caption.endswith("first 4 of 6 channels")
    assert len(panel_figure(panel).axes) == 8  # with the bars of colours
    few = view(about={"channels": ["acc_6"]}, **{f"acc_{i}": t for i in range(1, 7)})
    [axes, _] = axes_of(few, "waterfall")
    assert [text.get_text() for text in axes.texts] == ["acc_6"]


# --- envelope


BEARING = bearing_frequencies(8, 0.02, 0.12)  # outer 3.333, inner 4.667 orders


def blows(rate, *, fs=20_480.0, duration=4.0, seed=0):
    """Blows at a rate that ring at 6 kHz, in noise."""
    t = clock(duration, fs)
    ring = np.exp(-1500 * (t % (1 / rate))) * np.sin(2 * np.pi * 6000 * t)
    return 20 * ring + np.random.default_rng(seed).standard_normal(t.size)


def test_envelope_finds_the_damaged_race_in_the_band_that_rings():
    rate = 0.99 * BEARING.outer * 25  # rollers slip by 1 %
    t = clock(4.0, 20_480.0)
    # louder than the blows, in another band, and swelling at another rate
    hum = 30 * (1 + np.cos(2 * np.pi * 60 * t)) * np.sin(2 * np.pi * 800 * t)
    signal = blows(rate) + hum
    seen = view(20_480.0, acc=signal, row={"speed_hz": 25.0}, about={"bearing": BEARING})
    [axes] = axes_of(seen, "envelope")
    [curve] = [each for each in axes.get_lines() if len(each.get_xdata()) > 2]
    x, y = curve.get_xdata(), curve.get_ydata()
    assert abs(x[np.argmax(y)] - rate) < 0.25  # lines of 1/4 Hz
    labels = dict(text.get_text().split(": ") for text in axes.get_legend().get_texts())
    found, score = labels["outer 83.33 Hz"].split(" Hz, score ")
    assert abs(float(found) - rate) < 0.05
    assert float(score) > 10
    assert float(labels["inner 116.7 Hz"].split("score ")[1]) < 5
    marks = upright(axes, "--")
    for orders, strikes in ((BEARING.outer, 1), (BEARING.roller, 2)):
        for harmonic in (1, 2, 3):
            place = harmonic * strikes * orders * 25
            # what lies beyond 3.5 times the inner race's line is not shown
            assert any(abs(place - mark) < 1e-9 for mark in marks) == (place < 3.5 * 116.6667)
    low, high = (
        float(word)
        for word in axes.get_title(loc="left").split(", ")[1].split(" Hz")[0].split(" … ")
    )
    assert 1600 < low < high  # clear of the hum; the blows ring far to both sides of 6 kHz
    assert high > 6000
    assert axes.get_ylabel() == "[m/s²]"


def test_envelope_without_geometry_marks_the_shaft():
    seen = view(20_480.0, acc=blows(30.0), row={"speed_hz": 30.0})
    [axes] = axes_of(seen, "envelope")
    assert upright(axes, ":")[:2] == [30.0, 60.0]
    assert "orders of 30 Hz" in make_panel(seen, "envelope").caption


def test_a_bearing_needs_a_speed():
    seen = view(20_480.0, acc=blows(30.0), about={"bearing": BEARING})
    with pytest.raises(DataError, match="envelope needs the shaft speed"):
        make_panel(seen, "envelope")


# --- transfer functions


def spring(force, frequency, fs):
    """Displacement of an oscillator of 2 kg, exactly sampled for a force held between samples."""
    omega, ratio = 2 * np.pi * frequency, 0.02
    from scipy.signal import cont2discrete

    system = ([0.5], [1.0, 2 * ratio * omega, omega**2])
    b, a, _ = cont2discrete(system, 1 / fs)
    return lfilter(b.ravel(), a, force)


def frf_axes(seen):
    panel = make_panel(seen, "frf")
    return panel.caption, panel_figure(panel).axes


def test_transfer_function_of_a_random_force():
    rng = np.random.default_rng(1)
    force = rng.standard_normal(80_000)
    late = np.roll(force, 1)
    noisy = 2 * late + 0.1 * rng.standard_normal(force.size)
    caption, (level, phase, share) = frf_axes(view(force=force, acc=noisy))
    assert "H1 of " in caption
    assert "windows" in caption
    x, y = line(level, "acc")
    # 17 or so averages at a coherence of 0.9975: 0.9 % of a line's magnitude, 0.08 dB; the
    # largest of 400 lines 4 times that
    assert_allclose(y, 20 * np.log10(2), atol=0.4)
    assert abs(y.mean() - 20 * np.log10(2)) < 0.02
    angle = phase.get_lines()[0].get_ydata()
    # one sample late; the same scatter in radians, four times 0.5 deg
    assert_allclose(angle, -360 * x / FS, atol=2.5)
    assert share.get_lines()[0].get_ydata().min() > 0.97
    # nothing above the slope of the anti-alias filter
    assert x.max() <= FS / 2.56
    assert level.get_ylabel() == "[dB re 1 (m/s²)/N]"
    [band] = level.collections
    below, above = (pick(band.get_paths()[0].vertices[:, 1]) for pick in (np.min, np.max))
    assert below < y.min() < y.max() < above


@pytest.mark.parametrize("sign", [1, -1])
def test_transfer_function_of_a_hammer(sign):
    fs, rng = 2048.0, np.random.default_rng(2)
    force = np.zeros(round(30 * fs))
    pulse = np.sin(np.pi * np.arange(0.5, 4) / 4)
    starts = [round((0.4 + 2.0 * k) * fs) for k in range(14)]
    for start in starts:
        force[start : start + 4] = rng.uniform(50, 100) * pulse
    hit = starts[5] + 200
    force[hit : hit + 4] = 60 * pulse  # a double hit
    motion = spring(force, 100.0, fs)
    cell = sign * force + 0.02 * rng.standard_normal(force.size)
    caption, (level, phase, _) = frf_axes(view(fs, force=cell, probe=motion))
    assert "H1 of 13 blows, 1 left out" in caption
    x, y = line(level, "probe")
    # the pole's own frequency, to a line of 0.6 Hz
    assert abs(x[np.argmax(y)] - 100.0) < 0.6
    stiffness = 2 * (2 * np.pi * 100) ** 2
    low = (x > 20) & (x < 25)
    # 1 / (k (1 - r^2)) within a thousandth, and 0.1 dB for the noise of the force
    static = 20 * np.log10(1e6 / stiffness / (1 - (x[low] / 100) ** 2))
    assert_allclose(y[low], static, atol=0.15)
    assert level.get_ylabel() == "[dB re 1 µm/N]"
    angle = phase.get_lines()[0].get_ydata()[low]
    assert np.all(np.abs(angle) < 10) if sign > 0 else np.all(np.abs(angle) > 170)


def test_the_force_may_be_named():
    force = np.random.default_rng(3).standard_normal(8192)
    rows = {"force_1": force, "force_2": -force, "acc": 3 * force}
    with pytest.raises(DataError, match="needs a force channel, has 2 in N"):
        make_panel(view(**rows), "frf")
    caption, (level, *_) = frf_axes(view(**rows, about={"force": "force_2"}))
    assert "over force_2" in caption
    assert_allclose(line(level, "acc")[1], 20 * np.log10(3), atol=1e-4)


# --- orbit


def ellipse(t, speed, a, b):
    """Readings of two probes at 45 degrees either side of x, of an ellipse in metres."""
    x, y = a * np.cos(2 * np.pi * speed * t), b * np.sin(2 * np.pi * speed * t)
    return (x + y) / np.sqrt(2), (x - y) / np.sqrt(2)


def test_orbit_and_full_spectrum_of_an_ellipse():
    t = clock(2)
    one, two = ellipse(t, 25.0, 30e-6, 10e-6)
    seen = view(probe_1=one, probe_2=two, tacho=pulses(25 * t))
    path, lines = axes_of(seen, "orbit")
    x, y = line(path, "path")
    # float32 of the readings
    assert_allclose((x.max(), y.max()), (30.0, 10.0), rtol=1e-3)
    x, y = line(path, "1×")
    assert_allclose(np.square(x / 30) + np.square(y / 10), 1.0, rtol=2e-3)
    place, radius = (np.asarray(part) for part in lines.get_lines()[0].get_data())
    peak = dict(zip(place[radius > 2].round(3).tolist(), radius[radius > 2].tolist(), strict=True))
    # half the sum ahead, half the difference behind; Hann puts half of each beside them
    assert_allclose((peak[1.0], peak[-1.0]), (20.0, 10.0), rtol=1e-3)
    assert max(peak) < 1.1
    assert path.get_ylabel() == "y [µm]"
    assert lines.get_xlabel() == "backward   [orders]   forward"
    marks = [each for each in path.get_lines() if each.get_label() == "tacho"]
    x, y = marks[0].get_data()
    # the pulse rises as the shaft passes x = 30, within a sample: 2.2 degrees
    assert_allclose(x, 30.0, rtol=2e-3)
    assert_allclose(y, 0.0, atol=0.5)


def test_pairs_of_probes_by_their_place():
    t = clock(1)
    one, two = ellipse(t, 25.0, 30e-6, 10e-6)
    rows = {"probe_1_aft": one, "probe_2_aft": two, "probe_1_bow": two, "probe_2_bow": one}
    assert len(axes_of(view(place="last", **rows), "orbit")) == 4
    # a place with one probe has no orbit
    assert len(axes_of(view(place="last", **rows, probe_1_mid=one), "orbit")) == 4
    with pytest.raises(DataError, match="has 4; name the two to draw"):
        make_panel(view(**rows), "orbit")
    named = {"channels": ["probe_1_bow", "probe_2_bow"]}
    path, _ = axes_of(view(**rows, about=named), "orbit")
    assert "probe_1_bow" in path.get_xlabel()


@pytest.mark.parametrize("pairs", [1, 2])
def test_names_of_probes_are_whole_on_the_narrow_picture_of_a_page(pairs):
    """They are a second line of a label, and neither leave the picture nor cross what is below."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    one, two = ellipse(clock(1), 25.0, 30e-6, 10e-6)
    rows = {"probe_1_aft": one, "probe_2_aft": two, "probe_1_bow": two, "probe_2_bow": one}
    rows = dict(list(rows.items())[: 2 * pairs])
    figure = panel_figure(make_panel(view(place="last", **rows), "orbit"))
    FigureCanvasAgg(figure).draw()
    labels = [axes.xaxis.label.get_window_extent() for axes in figure.axes]
    assert len(labels) == 2 * pairs
    assert min(label.y0 for label in labels) >= 0
    upper, lower = figure.axes[0], figure.axes[-1]
    if pairs > 1:
        assert upper.xaxis.label.get_window_extent().y0 >= lower.bbox.y1


# --- refused


@pytest.mark.parametrize(
    ("kind", "rows", "says"),
    [
        ("spectrum", {"acc": 60}, "needs >= 64 samples, has 60"),
        ("waterfall", {"acc": 1000}, "needs >= 1024 samples"),
        ("waterfall", {"force": 4096}, "needs a channel other than a force"),
        ("orders", {"acc": 4096}, "needs a tacho"),
        ("angle", {"acc": 4096}, "needs a tacho"),
        ("angle", {"probe": 4096, "tacho": 4096}, "other than a proximity probe"),
        ("envelope", {"probe": 4096}, "other than a proximity probe"),
        ("frf", {"acc": 4096}, "needs a force channel, has 0 in N"),
        ("frf", {"force": 4096}, "needs a response"),
        ("frf", {"force": 60, "acc": 60}, "needs >= 64 samples, has 60; record longer"),
        ("orbit", {"acc": 4096, "probe": 4096}, "needs 2 displacement channels, has 1"),
        ("waveform", {"tacho": 4096}, "needs a channel besides the tacho"),
    ],
)
def test_a_kind_that_is_not_supported_says_what_is_missing(kind, rows, says):
    signals = {name: np.sin(0.1 * np.arange(n)) for name, n in rows.items()}
    if "tacho" in rows:
        signals["tacho"] = pulses(np.arange(rows["tacho"]) / 100)
    with pytest.raises(DataError, match=says) as caught:
        make_panel(view(**signals), kind)
    assert str(caught.value).startswith(f"here.h5[0]: {kind} ")


def test_a_window_longer_than_the_recording_is_refused():
    t = clock(0.1, 51200.0)
    seen = view(51200.0, acc=np.sin(t[:400]), tacho=pulses(400 * t[:400]))
    with pytest.raises(DataError, match="angle needs >= 512 samples, has 400; record longer"):
        make_panel(seen, "angle")


def test_few_revolutions_are_refused():
    t = clock(1)
    with pytest.raises(DataError, match="orders needs >= 8 revolutions, has 3"):
        make_panel(view(acc=np.sin(t), tacho=pulses(4 * t)), "orders")


def test_a_missing_pulse_is_told_and_the_rest_is_drawn():
    t = clock(4)
    tacho = pulses(10 * t)
    tacho[(t > 1.95) & (t < 2.05)] = 0
    made = plot_recording(view(acc=np.sin(t), tacho=tacho))
    assert made.drawn == ("waveform", "spectrum", "waterfall", "envelope")
    assert "a pulse is missing or false" in made.left_out["orders"]


def test_unknown_names_are_all_told_with_the_nearest():
    about = {"channels": ["acx"], "force": "hammer", "speed_hz": -1.0}
    with pytest.raises(DataError) as caught:
        view(acc=np.ones(64), about=about)
    first, second, third = str(caught.value).split("\n")
    assert "no channel 'acx'; did you mean 'acc'?" in first
    assert "no channel 'hammer', must be of acc" in second
    assert "speed = -1.0 Hz must be > 0" in third
    with pytest.raises(DataError, match="did you mean 'waterfall'"):
        make_panel(view(acc=np.ones(64)), "watrfall")


# --- sheet and file


def everything():
    t = clock(4, 8192.0)
    one, two = ellipse(t, 20.0, 30e-6, 10e-6)
    rng = np.random.default_rng(5)
    force, acc = rng.standard_normal((2, t.size))
    return view(
        8192.0, force=force, acc=acc + force, probe_1=one, probe_2=two, tacho=pulses(20 * t)
    )


def test_auto_draws_every_kind_on_one_sheet(tmp_path):
    made = plot_recording(everything(), AUTO)
    assert made.drawn == tuple(KINDS)
    assert made.left_out == {}
    save_picture(made.figure, tmp_path / "all.png")
    assert [path.name for path in tmp_path.iterdir()] == ["all.png"]


def test_no_label_leaves_the_picture():
    """Words outside the figure are cut off by the fixed margins."""
    figure = plot_recording(everything(), AUTO).figure
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).draw()
    width, height = figure.bbox.size
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box.x0 > -1
        assert box.y0 > -1
        assert box.x1 < width + 1
        assert box.y1 < height + 1


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_same_recording_same_bytes(tmp_path, suffix):
    files = [tmp_path / f"{name}.{suffix}" for name in "ab"]
    for file in files:
        save_picture(plot_recording(everything(), "waterfall").figure, file)
    first, second = (file.read_bytes() for file in files)
    assert first == second
    assert len(first) > 5000


def test_another_suffix_is_refused(tmp_path):
    figure = plot_recording(everything(), "waveform").figure
    with pytest.raises(DataError, match=r"must be one of \.png, \.svg, \.pdf"):
        save_picture(figure, tmp_path / "x.jpg")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_a_dead_sensor_is_drawn_as_silence(value):
    t = clock(4)
    dead = np.full(t.size, value)
    made = plot_recording(view(acc=dead, probe_1=dead, probe_2=dead, tacho=pulses(10 * t)))
    # 4096 Hz are too few for the bands of the crank-angle map, and no command chooses those
    assert set(made.drawn) == set(KINDS) - {"frf", "angle"}
    assert "n_bands = 20 must be <= " in made.left_out["angle"]
    assert made.left_out["angle"].endswith("; sample faster")
    density = line(axes_of(view(acc=dead), "spectrum")[0], "acc")[1]
    assert np.all(density == -200)


def test_two_samples_are_a_waveform():
    made = plot_recording(view(acc=np.array([0.0, 1.0])))
    assert made.drawn == ("waveform",)
