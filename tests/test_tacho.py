"""Missing, extra and jittery pulses, and shafts that stop: found, named, mended only on demand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from wearstate.features.rotation import order
from wearstate.features.rotation import tacho_faults as tacho


def ramp_pulses(n=60, start=10.0, rise=2.0):
    """Pulse times of a speed `start + rise t` [rev/s]: start t + rise t^2 / 2 = k."""
    return (np.sqrt(start**2 + 2 * rise * np.arange(n)) - start) / rise


def test_sound_pulses_have_no_faults():
    faults = tacho.pulse_faults(ramp_pulses())
    assert faults.count == 0
    # a ramp from 10 rev/s at 2 rev/s^2 has third differences of 3 (2 / 10^2)^2 of an interval
    assert faults.jitter_rev < 3 * 0.02**2 / np.sqrt(20)
    mended, _ = tacho.mend_pulses(ramp_pulses())
    assert np.array_equal(mended, ramp_pulses())


@given(st.sets(st.integers(3, 56), min_size=1, max_size=4))
def test_missing_pulses_are_found_and_put_back(lost):
    # never two gaps within nine intervals, nor more than three pulses in a row
    spread = [k for i, k in enumerate(sorted(lost)) if i == 0 or k - sorted(lost)[i - 1] > 9]
    truth = ramp_pulses()
    mended, faults = tacho.mend_pulses(np.delete(truth, spread))
    assert faults.extra.size == 0
    # a spline with knots h = 2 apart is 5 / 384 h^4 off per fourth derivative, which is
    # 15 rise^3 / speed^7 = 1.2e-5 s: 2.5e-6 s
    assert_allclose(faults.missing, truth[spread], atol=2.5e-6)
    assert_allclose(mended, truth, atol=2.5e-6)


@given(k=st.integers(2, 56), share=st.floats(0.03, 0.97))
def test_an_extra_pulse_is_found_and_left_out(k, share):
    truth = ramp_pulses()
    false = truth[k] + share * (truth[k + 1] - truth[k])
    mended, faults = tacho.mend_pulses(np.sort(np.append(truth, false)))
    assert faults.missing.size == 0
    assert np.array_equal(faults.extra, [false])
    assert np.array_equal(mended, truth)


@pytest.mark.parametrize("k", [0, 58])
def test_an_extra_pulse_at_an_end(k):
    truth = ramp_pulses()
    false = truth[k] + 0.3 * (truth[k + 1] - truth[k])
    assert np.array_equal(tacho.pulse_faults(np.sort(np.append(truth, false))).extra, [false])


def test_missing_and_extra_together_and_three_in_a_row():
    truth = ramp_pulses()
    false = truth[40] + 0.4 * (truth[41] - truth[40])
    broken = np.sort(np.append(np.delete(truth, [10, 11, 12, 25]), false))
    mended, faults = tacho.mend_pulses(broken)
    assert np.array_equal(faults.extra, [false])
    # as above with h = 4: 4e-5 s
    assert_allclose(mended, truth, atol=4e-5)
    assert "missing: 4" in str(faults)
    assert "extra: 1" in str(faults)


def test_mended_pulses_make_a_phase_and_broken_ones_do_not():
    truth = ramp_pulses()
    broken = np.delete(truth, 30)
    n = int(truth[-1] * 1000) + 20
    with pytest.raises(ValueError, match=r"missing or false there, or the shaft stands still"):
        order.shaft_phase(broken, n, 1000.0)
    mended, _ = tacho.mend_pulses(broken)
    phase = order.shaft_phase(mended, n, 1000.0)
    clock = np.arange(n) / 1000
    # the monotone cubic through the pulses: slopes within 2 % of the speed, 4 / 27 of that between
    assert_allclose(phase, 10 * clock + clock**2, atol=3e-3)


@pytest.mark.parametrize("per_revolution", [1, 6])
def test_jitter_is_measured_through_a_ramp_and_a_gap(per_revolution):
    rng = np.random.default_rng(5)
    truth = ramp_pulses(2000, start=10, rise=0.1)
    sigma = 1e-3  # of the mean interval
    speed = 10 + 0.1 * truth
    jittery = np.delete(truth + sigma * rng.standard_normal(2000) / speed, 700)
    found = tacho.pulse_faults(jittery, pulses_per_revolution=per_revolution)
    # 2000 third differences correlated over four: 1 / sqrt(2 * 2000 / 4) = 3 %, three of it
    assert found.jitter_rev * per_revolution == pytest.approx(sigma, rel=0.1)
    assert_allclose(found.missing, truth[700], atol=3e-4)


def test_a_shaft_that_stops_and_reverses_is_refused():
    # phase 8.3 - 2 (t - 3)^2: stands still at 3 s, after 8.3 revolutions
    turns = np.arange(9)
    times = np.concatenate((3 - np.sqrt((8.3 - turns) / 2), 3 + np.sqrt((8.3 - turns[::-1]) / 2)))
    faults = tacho.pulse_faults(times)
    assert_allclose(faults.standstills, [3.0], atol=1e-9)
    assert faults.missing.size == 0
    with pytest.raises(ValueError, match=r"speed passes through zero near 3 s, must stay > 0"):
        tacho.mend_pulses(times)


def test_unclear_gaps_and_long_ones_are_refused():
    even = np.arange(40) / 10
    half = np.concatenate((even[:20], even[20:] + 0.15))
    with pytest.raises(ValueError, match=r"near 2.025 s .* no whole number of intervals"):
        tacho.mend_pulses(half)
    with pytest.raises(ValueError, match=r"or more than 4"):
        tacho.mend_pulses(np.concatenate((even[:20], even[25:])))


def test_a_bouncing_tacho_is_refused():
    even = np.arange(40) / 10
    bouncing = np.sort(np.concatenate((even, even[::3] + 0.01)))
    with pytest.raises(ValueError, match=r"wrong pulses = .* must be <= 4; check the tacho"):
        tacho.mend_pulses(bouncing)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0.1, 0.2], "n_pulses = 2 must be >= 5"),
        ([0.1, 0.3, 0.2, 0.4, 0.5], "must be finite and increase"),
        ([0.1, np.nan, 0.2, 0.4, 0.5], "must be finite and increase"),
    ],
)
def test_unusable_times_are_refused(times, message):
    with pytest.raises(ValueError, match=message):
        tacho.pulse_faults(times)


def test_teeth_are_counted():
    with pytest.raises(ValueError, match="pulses_per_revolution = 0 must be >= 1"):
        tacho.pulse_faults(np.arange(9.0), pulses_per_revolution=0)
