"""Resampling to shaft angle, order spectra and maps, and averages, against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features.rotation import angle_resample as resample
from wearstate.features.rotation import order
from wearstate.features.rotation.angle_resample import AngleSignal

FS = 5120.0
ERROR = 5e-5  # of a tone in the pass band, and what is left of one above the stop band


def steady(speed=20.3, n=20_480, start=-0.4, fs=FS):
    return start + speed * np.arange(n) / fs


def ramp(n=3000, fs=600.0):
    """The published example: 600 Hz, 5 s, 10 to 40 rev/s."""
    t = np.arange(n) / fs
    return 10 * t + 3 * t**2


def tones(phase, amplitudes, angle=0.0):
    """Sum of orders {order: amplitude}."""
    return sum(a * np.cos(2 * np.pi * k * phase + angle) for k, a in amplitudes.items())


# --- interpolation


@given(cycles=st.floats(0.0, 0.4), place=st.floats(20, 79), angle=st.floats(0, 6))
def test_tones_in_the_pass_band_are_right(cycles, place, angle):
    wave = np.cos(2 * np.pi * cycles * np.arange(100) + angle)
    found = resample.interpolate(wave, [place])[0]
    assert abs(found - np.cos(2 * np.pi * cycles * place + angle)) < ERROR


@given(
    cycles=st.floats(0.001, 0.5),
    share=st.floats(0.05, 1.0),
    place=st.floats(0, 1),
    up=st.booleans(),
)
@settings(max_examples=60)
def test_a_lower_rate_keeps_what_it_can_carry_and_removes_what_would_fold(cycles, share, place, up):
    wave = np.exp(2j * np.pi * cycles * np.arange(1000))
    found = resample.interpolate(wave, [499 + place], share=share)[0]
    truth = np.exp(2j * np.pi * cycles * (499 + place))
    if cycles <= 0.4 * share:
        assert abs(found - truth) < ERROR
    elif cycles >= 0.6 * share:
        assert abs(found) < ERROR
    else:  # between the two: the kernel's slope
        assert abs(found) < 1 + ERROR


def test_the_bound_is_no_luxury():
    """Just outside the pass band the error is a hundred times the bound."""
    wave = np.cos(2 * np.pi * 0.45 * np.arange(200))
    places = 100 + np.linspace(0, 1, 11)
    error = resample.interpolate(wave, places) - np.cos(2 * np.pi * 0.45 * places)
    assert np.abs(error).max() > 100 * ERROR


@pytest.mark.parametrize(("dtype", "atol"), [(np.float32, 3e-7), (np.float64, 1e-15)])
def test_a_constant_and_the_dtype_are_kept(dtype, atol):
    found = resample.interpolate(np.full((2, 100), 1.25, dtype), np.linspace(20, 70, 321))
    assert found.dtype == dtype
    # 32 products rounded
    assert_allclose(found, 1.25, rtol=0, atol=4 * atol)


@pytest.mark.parametrize("dtype", [np.float32, np.complex64, np.int16])
def test_single_precision_is_as_good(dtype):
    wave = 1000 * np.cos(2 * np.pi * 0.3 * np.arange(400))
    wave = (np.round(wave) if dtype == np.int16 else wave).astype(dtype)
    places = np.linspace(20, 379, 1234)
    found = resample.interpolate(wave, places)
    assert found.dtype == (np.float64 if dtype == np.int16 else dtype)
    # 32 products of 1e3 at 1e-7, and table entries to 1e-6: 1e-5 of the amplitude; rounding to
    # whole numbers is 0.5 a sample
    atol = 1000 * (ERROR + 1e-5) + (1.0 if dtype == np.int16 else 0.0)
    assert_allclose(found, 1000 * np.cos(2 * np.pi * 0.3 * places), rtol=0, atol=atol)


@pytest.mark.parametrize(
    ("place", "share", "message"),
    [
        (15.9, 1.0, "place 0 = 15.9 must be >= 16"),
        (83.5, 1.0, "and <= 83 samples"),
        (np.nan, 1.0, "must be >= 16"),
        (50, 0.0, "must be > 0 and <= 1"),
        (50, 1.5, "must be > 0 and <= 1"),
        (50, 0.3, "must be >= 53"),
    ],
)
def test_places_outside_are_refused(place, share, message):
    with pytest.raises(ValueError, match=message):
        resample.interpolate(np.ones(100), [place], share=share)


# --- to angle


@pytest.mark.parametrize("points", [16, 64, 1024])
def test_orders_stand_still_in_a_run_up(points):
    phase = ramp(15_000, 3000.0)  # 10 to 40 rev/s
    parts = {1: 1.0, 0.5: 0.5, 6.2: 0.3}
    angle = resample.angular_resample(tones(phase, parts), phase, points_per_revolution=points)
    # each part to the bound, and 1 % of it for the places: a / (8 f fs) = 2.5e-5 samples of
    # 2 pi 6.2 / 75 rad each
    assert_allclose(angle.signal, tones(angle.phase, parts), rtol=0, atol=1.8 * ERROR * 1.01)
    assert angle.points_per_revolution == points
    # 16 points or 16 samples lost at both ends
    lost = max(16 / points, 16 * 40 / 3000)
    assert angle.phase[-1] - angle.phase[0] > phase[-1] - 2 * lost - 2 / points


def test_a_slowing_shaft_folds_nothing():
    """A steady 900 Hz is order 22 at 40 rev/s and 180 at 5 rev/s, beyond 32 points' reach."""
    phase = 40 * np.arange(25_000) / 5000 - 3.5 * (np.arange(25_000) / 5000) ** 2
    whine = np.cos(2 * np.pi * 900 * np.arange(25_000) / 5000)
    x = whine + 0.5 * np.cos(2 * np.pi * 3 * phase)
    angle = resample.angular_resample(x, phase, points_per_revolution=32)
    rest = angle.signal - 0.5 * np.cos(2 * np.pi * 3 * angle.phase)
    assert np.abs(rest).max() < 1.5 * ERROR
    # without the widened kernel it would be there in full
    places = np.interp(angle.phase, phase, np.arange(phase.size))
    assert np.std(resample.interpolate(whine, places)) > 0.6


def test_points_are_counted_from_the_pulse():
    phase = steady(start=-0.4)
    angle = resample.angular_resample(phase, phase, points_per_revolution=64)
    # a straight line is its own band-limited interpolation but for the kernel's second moment
    assert_allclose(angle.signal, angle.phase, rtol=0, atol=1e-5)
    # sixteen points are further apart than sixteen samples
    assert angle.first == int(np.ceil(phase[0] * 64 + 16))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.complex64])
def test_channels_are_independent_and_dtype_is_kept(dtype):
    rng = np.random.default_rng(0)
    phase = steady(n=4000)
    x = rng.standard_normal((2, 3, 4000)).astype(dtype)
    angle = resample.angular_resample(x, phase)
    assert angle.signal.dtype == dtype
    one = resample.angular_resample(x[1, 2], phase)
    # the same products in another order
    assert_allclose(angle.signal[1, 2], one.signal, atol=1e-5 if dtype != np.float64 else 1e-13)


@pytest.mark.parametrize(
    ("x", "phase", "options", "message"),
    [
        (np.ones(99), steady(n=100), {}, r"phase has shape \(100,\), must have \(99,\)"),
        (np.append(np.ones(99), np.nan), steady(n=100), {}, "x has 1 non-finite samples"),
        (np.ones(100), 1 - steady(n=100), {}, "stands still or reverses there"),
        (np.ones(100), -np.abs(steady(n=100) + 0.2), {}, "phase step after sample 50"),
        (np.ones(100), np.full(100, np.nan), {}, "must be > 0"),
        (np.ones(30), steady(n=30), {}, "record = 30 samples must be > 32"),
        (np.ones(100), steady(n=100), {"points_per_revolution": 3}, "must be >= 4"),
        (np.ones(2000), steady(n=2000), {"points_per_revolution": 4}, "the slowest place"),
        (np.float64(3), steady(n=100), {}, r"must have \(\)"),
    ],
)
def test_impossible_records_are_refused(x, phase, options, message):
    with pytest.raises(ValueError, match=message):
        resample.angular_resample(x, phase, **options)


def test_two_faults_are_named_at_once():
    with pytest.raises(ValueError, match=r"must have \(9,\) as x\npoints_per_revolution = 1 must"):
        resample.angular_resample(np.ones(9), np.arange(8.0), points_per_revolution=1)


# --- spectra


@pytest.mark.parametrize("window", ["hann", "flattop", "boxcar"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_amplitude_and_phase_over_the_order(window, dtype):
    phase = steady(speed=20.0, start=-0.37)
    truth = {1: 2.0, 2: 0.5 * np.exp(1.2j), 7: 1j}
    x = 5 + sum(np.real(a * np.exp(2j * np.pi * k * phase)) for k, a in truth.items())
    angle = resample.angular_resample(x.astype(dtype), phase, points_per_revolution=64)
    orders, vector = resample.order_spectrum(angle, window=window)
    assert vector.dtype == (np.complex128 if dtype == np.float64 else np.complex64)
    # whole orders over 79 whole revolutions do not leak; the bound of each part, and its sum;
    # the constant is exact; float32: 1e-7 of 8 in 32 products
    atol = 4 * ERROR + (3e-5 if dtype == np.float32 else 0)
    for k, a in truth.items():
        [found] = vector[np.isclose(orders, k)]
        assert_allclose(found, a, rtol=0, atol=atol)
    if window == "boxcar":
        others = np.min(np.abs(orders[:, None] - [1, 2, 7]), axis=1) > 1e-9
        assert np.abs(vector[others]).max() < atol
    assert orders[-1] <= 0.4 * 64


def test_a_tone_between_two_lines_reads_low_as_stated():
    angle = AngleSignal(
        signal=np.cos(2 * np.pi * 4.05 * np.arange(640) / 64), first=0, points_per_revolution=64
    )
    peaks = {w: np.abs(resample.order_spectrum(angle, window=w)[1]).max() for w in resample.WINDOWS}
    # half-way between lines 0.1 apart; the mirror image at -4.05 leaks 1 / (pi 81) with no window
    assert peaks["boxcar"] == pytest.approx(2 / np.pi, abs=0.006)
    assert peaks["hann"] == pytest.approx(8 / (3 * np.pi), abs=1e-4)
    # the stated 0.1 %, and its side lobes (70 dB down) of the mirror image
    assert peaks["flattop"] == pytest.approx(1, abs=1.3e-3)


def test_the_map_of_the_ramp_example():
    """Constant amplitudes A at orders 1, 1/2, root 2 and 2 read A / root 2 in every frame."""
    phase = ramp()
    parts = {1: 1.0, 0.5: 0.5, np.sqrt(2): np.sqrt(2), 2: 2.0}
    angle = resample.angular_resample(tones(phase, parts), phase, points_per_revolution=32)
    found = resample.order_map(angle, revolutions=16)
    assert found.rms.shape == (found.turns.size, found.orders.size)
    assert found.turns.size > 20
    for k, a in parts.items():
        line = np.argmin(np.abs(found.orders - k))
        # 0.1 % of the flat top, the bound of interpolation, and the side lobes (3e-4) of the rest;
        # places 1e-4 samples off and 0.1 of the last sample's speed change make 1e-3 of order 2
        assert_allclose(found.rms[:, line], a / np.sqrt(2), rtol=3e-3, atol=1e-3)
    # between the orders there is nothing: 5 lines from 1 / 2 to the left
    assert found.rms[:, :2].max() < 5e-3


def test_the_map_of_the_chirp_example():
    """Orders 1 and 2.5 in step with the shaft, and one that leaves order 6 and comes back."""
    t = np.arange(3000) / 600
    phase = ramp()
    bent = 60 * t + 180 * t**3 / 75  # quadratic from 60 Hz to 240 Hz
    x = tones(phase, {1: 2.0, 2.5: 1.0}) + 0.8 * np.cos(2 * np.pi * bent)
    angle = resample.angular_resample(x, phase, points_per_revolution=32)
    found = resample.order_map(angle, revolutions=4, window="hann")
    assert found.orders[1] == 0.25
    times = np.interp(found.turns, phase, np.arange(phase.size)) / 600
    for k, a in ((1, 2.0), (2.5, 1.0)):
        rms = found.rms[:, found.orders == k][:, 0]
        # Hann lobes of its neighbours 1.5 orders, 6 lines, off: 1 / (pi 6 * 35) of 2
        assert_allclose(rms, a / np.sqrt(2), atol=5e-3)
    upper = found.orders >= 3.2
    ridge = found.orders[upper][np.argmax(found.rms[:, upper], axis=1)]
    expected = (60 + 180 * t**2 / 25)[np.rint(times * 600).astype(int)] / (10 + 6 * times)
    # a line is 0.25; the order moves by up to 0.25 within a frame
    assert np.abs(ridge - expected).max() <= 0.25


def followed(angle, orders):
    """Amplitude and phase of orders in frames of eight turns, from the pulse, and their middles."""
    points = angle.points_per_revolution
    k = np.arange(8 * points)
    frames = np.lib.stride_tricks.sliding_window_view(angle.signal, k.size)[:: 4 * points]
    starts = 4 * np.arange(len(frames)) + angle.first / points
    hann = (1 - np.cos(2 * np.pi * k / k.size))[:, np.newaxis] * (2 / k.size)
    vector = frames @ (hann * np.exp(-2j * np.pi * np.outer(k / points, orders)))
    return starts + 4, vector * np.exp(-2j * np.pi * np.outer(starts, orders))


def test_an_order_is_followed_in_amplitude_and_phase():
    phase = steady(speed=25.0, n=51_200, start=-0.2)
    grows = 1 + 0.1 * np.arange(51_200) / FS
    x = grows * np.cos(2 * np.pi * 1.5 * phase + 0.7) + 3 * np.cos(2 * np.pi * 4 * phase)
    angle = resample.angular_resample(x, phase, points_per_revolution=64)
    turns, vector = followed(angle, [1.5, 4])
    # linear growth averages to its middle; the neighbour is 20 lines off: 3 / (pi 20 * 399)
    assert_allclose(np.abs(vector[:, 0]), 1 + 0.1 * (turns + 0.2) / 25, atol=4e-4)
    assert_allclose(np.angle(vector[:, 0]), 0.7, atol=4e-4)
    assert_allclose(vector[:, 1], 3, atol=4e-4)
    assert_allclose(np.diff(turns), 4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: resample.order_map(a, revolutions=20), "record = 10 revolutions must be >= 20"),
        (lambda a: resample.order_map(a, revolutions=0), "revolutions = 0 must be >= 1"),
        (lambda a: resample.order_map(a, overlap=1.0), "overlap = 1.0 must be >= 0 and < 1"),
        (lambda a: resample.order_spectrum(a, window="haning"), "must be one of boxcar, hann"),
        (lambda a: resample.angular_residual(a, np.ones(3)), "must end in 16 points"),
    ],
)
def test_impossible_questions_are_refused(call, message):
    angle = AngleSignal(signal=np.ones(160), first=0, points_per_revolution=16)
    with pytest.raises(ValueError, match=message):
        call(angle)


def test_less_than_a_revolution_is_refused():
    angle = AngleSignal(signal=np.ones(15), first=0, points_per_revolution=16)
    for call in (resample.order_spectrum, resample.synchronous_average):
        with pytest.raises(ValueError, match=r"record = 0.9375 revolutions must be >= 1"):
            call(angle)


# --- averages


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_the_average_keeps_what_repeats_and_the_residual_the_rest(dtype):
    rng = np.random.default_rng(1)
    phase = steady(speed=20.0, start=-0.3, n=51_200)
    repeats = 0.5 + tones(phase, {1: 1.0, 3: 0.4}, 0.6)
    noise = 0.3 * rng.standard_normal(51_200)
    x = (repeats + noise).astype(dtype)
    angle = resample.angular_resample(x, phase, points_per_revolution=128)
    average = resample.synchronous_average(angle)
    assert average.dtype == dtype
    truth = 0.5 + tones(np.arange(128) / 128, {1: 1.0, 3: 0.4}, 0.6)
    # band-limited to half the 5120 Hz or less, so at most 0.3, over 198 revolutions: 0.021; four
    # standard deviations over 128 points
    assert_allclose(average, truth, atol=4 * 0.3 / np.sqrt(198))
    angular = resample.angular_residual(angle, average)
    assert_allclose(resample.synchronous_average(angular), 0, atol=1e-5)
    assert angular.first == angle.first


def test_the_average_is_a_comb():
    n, k = 20, 1.3
    points = np.arange(64 * n) / 64
    angle = AngleSignal(signal=np.exp(2j * np.pi * k * points), first=0, points_per_revolution=64)
    left = np.abs(resample.synchronous_average(angle))
    # the stated comb, exactly
    assert_allclose(left, abs(np.sin(np.pi * k * n) / (n * np.sin(np.pi * k))), atol=1e-12)


@given(shift=st.integers(-40, 40))
def test_the_average_does_not_depend_on_where_the_record_starts(shift):
    points = (shift + np.arange(64 * 5 + 17)) / 64
    angle = AngleSignal(
        signal=tones(points, {1: 1.0, 2: 0.5}), first=shift, points_per_revolution=64
    )
    assert_allclose(
        resample.synchronous_average(angle), tones(np.arange(64) / 64, {1: 1.0, 2: 0.5}), atol=1e-12
    )


@given(scale=st.sampled_from([0.25, -1.0, 8.0]), offset=st.floats(-10, 10))
@settings(max_examples=20)
def test_scale_sign_and_offset(scale, offset):
    phase = steady(n=8000)
    x = tones(phase, {1: 1.0, 2.5: 0.3})
    plain = resample.angular_resample(x, phase, points_per_revolution=64)
    moved = resample.angular_resample(scale * x + offset, phase, points_per_revolution=64)
    # constants pass exactly: rounding of numbers up to 10
    assert_allclose(moved.signal, scale * plain.signal + offset, atol=1e-13)
    assert_allclose(
        resample.order_spectrum(moved)[1], scale * resample.order_spectrum(plain)[1], atol=1e-13
    )
    maps = [resample.order_map(angle, revolutions=4).rms for angle in (plain, moved)]
    assert_allclose(maps[1], abs(scale) * maps[0], atol=1e-13)


def test_silence_is_silence():
    angle = resample.angular_resample(np.zeros(8000), steady(n=8000))
    assert not resample.order_spectrum(angle)[1].any()
    assert not resample.order_map(angle).rms.any()
    assert not resample.synchronous_average(angle).any()


def test_phase_from_a_tacho_is_enough():
    """The map of the ramp example through pulses: as `order_amplitudes`, per frame."""
    t = (np.arange(30_001) - 0.5) / 6000
    turns = 10 * t + 3 * t**2 + 0.1
    on = np.floor(turns) * 0.2 + np.minimum(turns % 1, 0.2)
    pulses = order.pulse_times(np.diff(on) / np.diff(turns), 6000.0)
    phase = order.shaft_phase(pulses, 30_000, 6000.0)
    t = np.arange(30_000) / 6000
    x = tones(10 * t + 3 * t**2 + 0.1, {1: 1.0, 2: 2.0})
    angle = resample.angular_resample(x, phase, points_per_revolution=32)
    _, vector = followed(angle, [1, 2])
    # pulses are 0.09 sample off at up to 40 rev/s: 6e-4 rev, 8e-3 rad at order 2, and PCHIP's own
    # error at a fast run-up, 4 / 27 of a slope error of 3 % rev, in the first revolutions
    assert_allclose(vector[2:], np.tile([1, 2], (vector.shape[0] - 2, 1)), atol=0.02)


# --- another implementation


def test_agreement_with_another_implementation():
    maps = pytest.importorskip("rota.maps")
    slices = pytest.importorskip("rota.slices")
    t = np.arange(30_000) / 6000
    phase = 10 * t + 3 * t**2
    x = tones(phase, {1: 1.0, 0.5: 0.5, 4: 2.0, 7.25: 0.3})
    theirs = maps.rpm_order_map(x, 6000.0, 60 * (10 + 6 * t), order_resolution=0.25, window="hann")
    angle = resample.angular_resample(x, phase, points_per_revolution=64)
    revolutions = round(theirs.nperseg / (theirs.nperseg * theirs.axis[1]))
    ours = resample.order_map(angle, revolutions=revolutions, window="hann")
    assert ours.orders[1] == pytest.approx(theirs.axis[1])
    spectrum = slices.order_spectrum(theirs)
    values = np.sqrt(np.mean(np.asarray(ours.rms) ** 2, axis=0))
    for k in (0.5, 1, 4, 7.25):
        [mine] = values[np.isclose(ours.orders, k)]
        [other] = np.ravel(spectrum.amplitude)[np.isclose(spectrum.axis, k)]
        # both state 80 dB or better; the neighbours' Hann lobes depend on where frames start
        assert mine == pytest.approx(other, rel=2e-2, abs=2e-3)


def test_effort_is_linear_in_the_length():
    """Counted, not timed: weights per sample grow neither with the record nor with fewer points."""
    for n in (4000, 40_000):
        for points in (16, 256, 1024):
            phase = steady(n=n)
            angle = resample.angular_resample(np.ones(n), phase, points_per_revolution=points)
            places = np.interp(angle.phase, phase, np.arange(n))
            share = np.full(places.size, min(1.0, 20.3 * points / FS))
            weights = sum(
                first.size * taps for _, first, taps in resample._pieces(places, share, n)
            )
            # 32 of each sample or each point, the more numerous; rounded up by one tap
            assert weights <= 33.1 * max(n, places.size)


def test_whole_revolutions_are_counted():
    angle = AngleSignal(signal=np.ones(39), first=-7, points_per_revolution=8)
    assert angle.revolutions == 4
    assert angle.highest_order == pytest.approx(3.2)
    assert_array_equal(angle.phase[[0, 7]], [-7 / 8, 0])
