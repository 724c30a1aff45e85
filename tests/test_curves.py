"""Spectra, transfer functions and orbits of recordings: equal to the functions of arrays, drawn."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
import wearstate
from matplotlib import pyplot as plt
from numpy.testing import assert_allclose, assert_array_equal
from wearstate import features
from wearstate.features.rotation.orbit import displacement
from wearstate.features.signal import envelope, spectrum

mpl.use("agg")

FS = 4096.0
T = np.arange(2 * 4096) / FS
PULSES = 5.0 * ((20 * T + 0.3) % 1 < 0.1)
UNITS = {"acc": "m/s^2", "push": "N", "px": "m", "py": "m"}


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def recording(**signals):
    table = pd.DataFrame({**signals, "tacho": PULSES})
    return wearstate.Recording.from_array(table, FS, unit=UNITS, tacho="tacho")


@pytest.fixture
def one():
    noise = np.random.default_rng(0).standard_normal(T.size)
    return recording(acc=3 * np.cos(2 * np.pi * 40 * (T + 0.3 / 20)) + 0.01 * noise)


def test_a_recording_and_its_array_have_one_spectrum(one):
    lines, amplitude = spectrum.amplitude_spectrum(one["acc"], FS)
    found = features.spectrum(one)
    assert_array_equal(found.lines, lines)
    assert_array_equal(found["acc"], amplitude)
    assert found.units == ("m/s^2",)
    assert_array_equal(features.spectrum(one["acc"], FS).value, found.value)
    table = pd.DataFrame({"a": one["acc"]})
    assert_array_equal(features.spectrum(table, FS)["a"], amplitude)
    assert found["acc"].max() == pytest.approx(3, rel=1e-3)  # the tone is on a line


def test_envelope_spectrum(one):
    lines, amplitude = envelope.envelope_spectrum(one["acc"], FS, (10.0, 90.0), kind="plain")
    found = features.envelope_spectrum(one, band=(10.0, 90.0), kind="plain")
    assert_array_equal(found.lines, lines)
    assert_array_equal(found["acc"], amplitude)
    assert features.envelope_spectrum(one).units == ("(m/s^2)²",)


def test_orders_count_from_the_pulse(one):
    found = features.order_spectrum(one)
    line = int(found["acc"].argmax())
    assert found.lines[line] == 2.0
    # edges are known to a fraction of a sample, 20/4096 rev; twice that in order 2
    assert_allclose(found.value[0, line], 3.0, atol=0.1)
    assert_allclose(
        features.order_spectrum(one["acc"], FS, tacho=one["tacho"]).value, found.value, rtol=1e-6
    )


def test_transfer_function_by_name():
    push = np.random.default_rng(0).standard_normal(T.size)
    test = recording(push=push, acc=2 * push)
    for found in (features.frf(test), features.frf(test, nperseg=512)):
        assert found.paths == ("acc / push",)
        assert found.units == ("m/s^2/N",)
        assert_allclose(found.value, 2, rtol=1e-6)  # float32
        assert "acc / push" in repr(found)
    # lines fs / nperseg apart, without those at 0 and fs / 2
    assert len(found.frequency) == 255
    magnitude, coherence = found.plot()
    assert [each.get_text() for each in magnitude.get_legend().get_texts()] == ["acc / push"]
    assert_allclose(coherence.lines[0].get_ydata(), 1, rtol=1e-6)


def test_orbit_of_the_probes():
    x, y = 1e-5 * np.cos(40 * np.pi * T), 2e-5 * np.sin(40 * np.pi * T)
    both = recording(acc=x, px=x, py=y)
    found = features.orbit(both)
    assert_array_equal(found.path, displacement(both["px"], both["py"]))
    assert found.unit == "m"
    assert len(found.marks) == 40  # 20 rev/s over two seconds
    axes = found.plot()
    assert axes.get_xlabel() == "x [m]"
    assert len(axes.lines[1].get_xdata()) == 40


def test_plots_draw_into_given_axes(one):
    _, mine = plt.subplots()
    drawn = features.spectrum(one).plot(ax=mine, high=100.0)
    assert drawn[0] is mine
    assert mine.lines[0].get_xdata()[-1] == 100.0
    assert mine.get_ylabel() == "acc [m/s^2]"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: features.spectrum(r, FS), "fs must be left out; the recording has its own"),
        (lambda r: features.spectrum(r["acc"]), "fs = None must be given with an array"),
        (lambda r: features.spectrum("pump.wav"), "'pump.wav' must be a rec.*read_recording"),
        (lambda r: features.spectrum([r["acc"]], FS, channel_names=["a", "b"]), "must have 1"),
        (lambda r: features.order_spectrum(r["acc"], FS), "tacho = none must be there"),
        (lambda r: features.orbit(r), "n_probes = 0 must be 2"),
        (lambda r: features.orbit(np.ones((3, 8)), FS), "n_probes = 3 must be 2"),
        (lambda r: features.frf(r), "n_forces = 0"),
    ],
)
def test_what_is_missing_is_named(one, call, message):
    with pytest.raises(ValueError, match=message):
        call(one)


def test_an_unknown_channel_names_those_there_are(one):
    with pytest.raises(KeyError, match="channel 'x' must be one of acc"):
        features.spectrum(one)["x"]
