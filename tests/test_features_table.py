"""The catalogue: names, values against the functions behind them, invariances, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features.catalogue import analysis as shared
from wearstate.features.catalogue import row as table
from wearstate.features.catalogue import standard_rows
from wearstate.features.rotation import order
from wearstate.features.signal import spectrum, statistics

FS = 25_600.0
N = 30_720
CHANNELS = ("acc_x", "acc_y")


def machine(seed=0, n=N, dtype=np.float64, speed=5.0, knock_deg=65):
    """Two channels with a knock once a revolution, a shaft order and noise, and a tacho."""
    rng = np.random.default_rng(seed)
    phase = 0.3 + speed * np.arange(n) / FS
    ring = np.exp(-np.arange(150) / 30) * np.sin(2 * np.pi * 3000 * np.arange(150) / FS)
    knocks = np.zeros(n)
    knocks[:-1][np.diff(np.floor(phase - knock_deg / 360)) > 0] = 20.0
    knock = np.convolve(knocks, ring)[:n]
    vibration = np.stack((knock, 0.5 * knock)) + rng.normal(0, 0.2, (2, n))
    vibration += np.cos(2 * np.pi * 2 * phase)
    tacho = 5.0 * (phase % 1 < 0.1)
    return vibration.astype(dtype), tacho.astype(dtype)


def row(vibration, tacho=None, **options):
    names, values = table.feature_row(
        vibration, FS, tacho=tacho, channel_names=CHANNELS[: len(vibration)], **options
    )
    assert len(names) == len(values) == len(set(names))
    assert values.dtype == np.float64
    assert np.all(np.isfinite(values))
    return dict(zip(names, values, strict=True))


@pytest.mark.parametrize("with_tacho", [True, False])
def test_names_agree_with_the_row(with_tacho):
    vibration, tacho = machine()
    found = row(vibration, tacho if with_tacho else None)
    assert tuple(found) == table.feature_names(CHANNELS, FS, tacho=with_tacho)
    # 8 statistics and 20 bands; 10 orders, 36 x 20 map, 6, 4, 1, 1; one pair; two of the shaft.
    assert len(found) == 2 * (28 + with_tacho * (10 + 720 + 12)) + 1 + 2 * with_tacho
    assert any(".angle_" in name for name in found) == with_tacho
    assert "acc_x.angle_050_060.band_1150_1350.level_db" in found or not with_tacho


def test_every_feature_is_one_function_with_a_reference():
    assert len({f.name for f in standard_rows.CATALOGUE}) == len(standard_rows.CATALOGUE)
    vibration, tacho = machine()
    analysis = shared.Analysis(vibration, FS, pulses=order.pulse_times(tacho, FS))
    per_scope = {"channel": 2, "pair": 1, "shaft": 1}
    for feature in standard_rows.CATALOGUE:
        labels = feature.labels_for(shared.STANDARD, FS)
        assert np.size(feature.function(analysis)) == per_scope[feature.scope] * len(labels)
        assert feature.reference
        assert feature.unit


@pytest.mark.parametrize("name", [f.name for f in standard_rows.CATALOGUE[:8]])
def test_statistics_are_those_of_the_channel(name):
    vibration, _ = machine()
    found = row(vibration)
    # The same sums in another order.
    expected = getattr(statistics, name)(vibration[1])
    assert_allclose(found[f"acc_y.{name}"], expected, rtol=1e-10)


def test_spectral_features_are_those_of_the_channel():
    vibration, tacho = machine()
    found = row(vibration, tacho)
    bands = [v for k, v in found.items() if k.startswith("acc_y.band_")]
    # Same arithmetic, summed in another order.
    expected = spectrum.band_levels(vibration[1], FS, spectrum.band_edges(FS))
    assert_allclose(bands, expected, atol=1e-9)
    phase = order.shaft_phase(order.pulse_times(tacho, FS), N, FS)
    edges = spectrum.line_band_edges(FS, 256)
    energy = order.crank_angle_map(vibration[1], FS, phase, edges=edges)
    cells = [v for k, v in found.items() if k.startswith("acc_y.angle_") and ".band_" in k]
    assert_allclose(cells, spectrum.decibel(energy).ravel(), atol=1e-9)


def test_orders_and_shaft():
    vibration, tacho = machine()
    found = row(vibration, tacho)
    # Amplitude 1 at order 2; noise of 0.2 over 5 revolutions of 5120 samples adds an amplitude
    # of about 0.2 sqrt(2 / 25600) = 0.002, the knock 0.02.
    assert_allclose(found["acc_x.order_02.level_db"], 10 * np.log10(0.5), atol=0.3)
    assert found["acc_x.order_05.level_db"] < -30
    # Pulses are known to one sample in 5120 over four or more revolutions.
    assert_allclose(found["shaft.speed_hz"], 5.0, rtol=1e-4)
    assert found["shaft.speed_variation"] < 2e-4


def test_knock_shows_where_it_happens():
    vibration, tacho = machine()
    found = row(vibration, tacho)
    band = "band_2950_3550"
    levels = {k.split(".")[1]: v for k, v in found.items() if k.startswith("acc_x.") and band in k}
    assert max(levels, key=levels.get) == "angle_060_070"
    assert levels["angle_060_070"] > levels["angle_240_250"] + 15
    # One knock a revolution, counted over 5.95 revolutions: five or six of them.
    assert 0.8 < found["acc_x.impacts_per_revolution"] < 1.1
    assert found["acc_x.angle_kurtosis"] > 10
    # A level that peaks near 70 degrees has its first harmonic there.
    direction = np.degrees(
        np.arctan2(found["acc_x.angle_harmonic_1.sin_db"], found["acc_x.angle_harmonic_1.cos_db"])
    )
    assert 55 < direction < 95


def test_knock_after_a_dead_centre():
    found = row(*machine(knock_deg=205))
    # Nearly all energy lies in a ninth of the revolution; noise and the knock's tail take the rest.
    assert_allclose(found["acc_x.dead_centre_180.after_db"], 10 * np.log10(9), atol=0.3)
    assert found["acc_x.dead_centre_180.around_db"] < 3
    assert found["acc_x.dead_centre_000.after_db"] < -5


@settings(max_examples=6, deadline=None)
@given(gain=st.floats(0.01, 100), sign=st.sampled_from([-1, 1]), offset=st.floats(-50, 50))
def test_gain_sign_and_offset(gain, sign, offset):
    vibration, tacho = machine()
    before, after = row(vibration, tacho), row(sign * gain * vibration + offset, tacho)
    shift = 20 * np.log10(gain)
    for name, value in before.items():
        label = name.split(".")[-1]
        if label == "level_db":
            expected = value + shift
        elif label in ("rms", "peak", "peak_to_peak"):
            expected = value * gain
        else:
            expected = value * (sign if label == "skewness" else 1)
        # An offset 5000 times the scaled signal costs four digits of sixteen, and levels 60 dB
        # below the strongest three more.
        assert_allclose(after[name], expected, rtol=1e-8, atol=1e-7, err_msg=name)


def test_channels_may_change_places():
    vibration, tacho = machine()
    first = row(vibration, tacho)
    swapped, values = table.feature_row(
        vibration[::-1], FS, tacho=tacho, channel_names=CHANNELS[::-1]
    )
    second = dict(zip(swapped, values, strict=True))
    for name in first:
        if name.startswith(("acc_x.", "acc_y.", "shaft.")):
            # Rows may be blocked differently in a matrix product.
            assert_allclose(second[name], first[name], rtol=1e-9, atol=1e-9, err_msg=name)
    ratio = first["acc_x_over_acc_y.rms_ratio_db"]
    assert_allclose(second["acc_y_over_acc_x.rms_ratio_db"], -ratio, rtol=1e-12)
    power = [statistics.rms(v) for v in vibration]
    assert_allclose(ratio, 20 * np.log10(power[0] / power[1]), rtol=1e-9)


def test_float32_stays_and_agrees(monkeypatch):
    vibration, tacho = machine()
    full = row(vibration, tacho)
    seen = []
    for module in (spectrum, order):
        transform = module.rfft
        monkeypatch.setattr(module, "rfft", lambda x, f=transform: seen.append(x.dtype) or f(x))
    single = row(vibration.astype(np.float32), tacho.astype(np.float32))
    assert set(seen) == {np.dtype(np.float32)}
    for name, value in full.items():
        # 1e-7 of the strongest amplitude is 1e-3 dB at levels 80 dB down; orders reach there.
        assert_allclose(single[name], value, rtol=1e-4, atol=5e-3, err_msg=name)


def test_transforms_are_shared(monkeypatch):
    calls = []
    for module, name in (
        (shared.spectrum, "power_lines"),
        (order, "short_time_energy"),
        (order, "shaft_phase"),
        (order, "mean_over_angle"),
        (order, "pulse_times"),
    ):
        inner = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, f=inner, n=name, **k: calls.append(n) or f(*a, **k)
        )
    row(*machine())
    assert sorted(calls) == sorted(
        ["power_lines", "short_time_energy", "shaft_phase", "mean_over_angle", "pulse_times"]
    )


def test_dead_channel_has_documented_values():
    vibration, tacho = machine(dtype=np.float32)
    vibration[1] = 0.1
    found = {k: v for k, v in row(vibration, tacho).items() if k.startswith("acc_y.")}
    for name, value in found.items():
        # Silence: the floor for levels, 0 for all the rest; the log of 1e-20 rounds.
        assert_allclose(value, -200.0 if name.endswith("level_db") else 0.0, atol=1e-12)


def test_settings_change_names_and_values():
    vibration, tacho = machine()
    chosen = shared.Settings(n_bands=5, map_bands=4, angle_bins=12, orders=(0.5, 2.0))
    found = row(vibration, tacho, settings=chosen)
    assert len(found) == 2 * (8 + 5 + 2 + 48 + 12) + 3
    assert "acc_x.order_0.5.level_db" in found
    assert any(k.startswith("acc_x.angle_330_360.band_") for k in found)


@pytest.mark.parametrize("fs", [48_800.0, 97_656.25])
def test_one_channel_of_another_machine(fs):
    x = np.random.default_rng(0).standard_normal(int(fs)).astype(np.float32)
    names, values = table.feature_row(x, fs)
    assert names[0] == "ch_0.rms"
    assert len(values) == 28
    assert np.all(np.isfinite(values))


def bad(index, value):
    vibration, tacho = machine()
    vibration[index] = value
    return vibration, tacho


@pytest.mark.parametrize(
    ("vibration", "tacho", "message"),
    [
        (*bad((1, slice(7, 9)), np.nan), r"acc_y has 2 non-finite samples, the first at 7"),
        (*bad((slice(None), 3), -np.inf), r"acc_x has 1 .* at 3, .*; acc_y has 1 .* at 3"),
        (*bad((0, 5), -2e9), r"acc_x has 1 samples beyond 1e\+09, the first at 5"),
        (np.zeros((2, 10)), None, r"n_samples >= 64"),
        (np.zeros((2, N)), np.zeros(N - 1), r"tacho has shape \(30719,\)"),
        (*(a[..., :6000] for a in machine()), r"1 rising edge\(s\)"),
    ],
)
def test_faults_are_named(vibration, tacho, message):
    with pytest.raises(ValueError, match=message):
        table.feature_row(vibration, FS, tacho=tacho, channel_names=CHANNELS)


def test_less_than_one_revolution_is_refused():
    vibration, _ = machine()
    teeth = 5.0 * (0.3 + 300 * np.arange(4000) / FS % 1 < 0.5)
    with pytest.raises(ValueError, match=r"revolutions must be >= 1; record at least one"):
        table.feature_row(vibration[:, :4000], FS, tacho=teeth, pulses_per_revolution=60)


@pytest.mark.parametrize("channels", [(), ("a", "a"), ("a", "")])
def test_names_must_be_unique(channels):
    with pytest.raises(ValueError, match=r"must be non-empty and unique"):
        table.feature_names(channels, FS)
    with pytest.raises(ValueError, match=r"channel_names has \d names, must have 5"):
        table.feature_row(np.zeros((5, 100)), FS, channel_names=channels)


def test_bands_closer_than_a_hertz_have_no_names_and_are_left_out():
    close = shared.Settings(n_bands=200)
    names = table.feature_names(["a"], 200.0, tacho=False, settings=close)
    assert "a.rms" in names
    assert not any("band" in name for name in names)
    with pytest.raises(ValueError, match=r"band_levels is not available: fs = 200 Hz is too low"):
        table.feature_names(["a"], 200.0, tacho=False, settings=close, only=["band_levels"])
    twice = shared.Settings(bands=((1.0, 2.0), (1.0, 2.0)))
    with pytest.raises(ValueError, match=r"feature names equal, must be 0"):
        table.feature_names(["a"], 200.0, tacho=False, settings=twice, feature_set="core")


def test_the_same_record_gives_the_same_bytes():
    vibration, tacho = machine(dtype=np.float32)
    first = table.feature_row(vibration, FS, tacho=tacho)[1]
    assert_array_equal(first, table.feature_row(vibration, FS, tacho=tacho)[1])
