"""Measured bearings: the damaged race named without being told the band, healthy ones silent."""

import numpy as np
import pytest
from wearstate.datasets.measured.recording import read_recording
from wearstate.features.signal.cyclic_coherence import coherence_threshold, cyclic_coherence
from wearstate.features.signal.envelope import bearing_frequencies, envelope_spectrum, fault_line
from wearstate.features.signal.kurtogram import kurtogram

MFPT = bearing_frequencies(8, 0.235, 1.245, speed_hz=25.0)  # rollers, inches; 25 Hz in every file
RACES = {"outer": (80.0, 80.75), "inner": (117.65, 118.05)}
"""Where the lines were found in the whole set, in a band chosen by hand: 80.0 to 80.7 Hz and 117.7
to 118.0 Hz, given to a line of 1/3 Hz [Hz]."""

FAULTY = [(f"{race.title()}RaceFault_vload_{n}.mat", race) for race in RACES for n in (1, 3, 5, 7)]
HEALTHY = ["baseline_1.mat"]

DETECTED = 10.0
"""Score that names a race: three times what the healthy bearing's lines have."""


@pytest.fixture(scope="module")
def recording(realdata):
    folder = realdata / "mfpt_bearing_CC-BY-NC-SA-4.0"
    if not folder.is_dir():
        pytest.skip("the bearing recordings are not here")
    held = {}

    def read(name):
        if name not in held:
            found = read_recording(folder / name)
            held[name] = found.signal[0], found.sample_rate
        return held[name]

    return read


def spectrum(signal, fs, kind="plain"):
    return envelope_spectrum(signal, fs, kurtogram(signal, fs).band, kind=kind)


def scores(signal, fs):
    """Score of each race in the plain envelope of the kurtogram's band."""
    lines = spectrum(signal, fs)
    return {race: fault_line(*lines, getattr(MFPT, race)) for race in RACES}


@pytest.mark.parametrize(("name", "race"), FAULTY)
@pytest.mark.parametrize("kind", ["squared", "plain", "log"])
def test_the_line_of_the_damaged_race(recording, name, race, kind):
    found = fault_line(*spectrum(*recording(name), kind=kind), getattr(MFPT, race))
    low, high = RACES[race]
    assert low <= found.frequency <= high
    assert found.score > 6  # twice what noise has; squared spectra carry the scatter of the blows


@pytest.mark.parametrize(("name", "race"), FAULTY)
def test_the_damaged_race_is_named(recording, name, race):
    found = scores(*recording(name))
    [other] = RACES.keys() - {race}
    assert found[race].score > DETECTED
    # inner race, load 7: the shaft's sidebands of the inner line reach into the outer's search
    assert found[race].score > 4 * found[other].score


@pytest.mark.parametrize(("name", "race"), FAULTY)
def test_the_highest_line_is_the_race_or_the_shaft(recording, name, race):
    """Without knowing the bearing: the envelope's highest line between 10 and 400 Hz."""
    frequency, amplitude = spectrum(*recording(name))
    slow = (frequency > 10) & (frequency < 400)
    top = frequency[slow][np.argmax(amplitude[slow])]
    low, high = RACES[race]
    # the shaft carries the inner race's damage through the load zone once a turn, 24.7 Hz
    assert low <= top <= high or (race == "inner" and 24.5 < top < 25.5)


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_bearing_has_no_line(recording, name):
    found = scores(*recording(name))
    assert max(line.score for line in found.values()) < DETECTED / 2


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_bearing_has_no_blows(recording, name):
    signal, fs = recording(name)
    assert kurtogram(signal, fs).highest < 1


@pytest.mark.parametrize(("name", "race"), FAULTY)
def test_a_damaged_bearing_has_blows(recording, name, race):
    signal, fs = recording(name)
    found = kurtogram(signal, fs)
    assert found.highest > 1.5  # the light damage at a low load; 14 to 70 of the others
    assert found.highest > 20 * found.deviation[found.best[0]]


def enhanced(signal, fs, rate):
    """Mean coherence at a rate, where it is largest within the slip, and what noise has."""
    rates = np.arange(0.98 * rate, 1.005 * rate, fs / signal.size)
    _, coherence = cyclic_coherence(signal, fs, rates, nperseg=128)
    bound = coherence_threshold(signal.size, nperseg=128, probability=0.01 / rates.size)
    mean = coherence.mean(axis=1)
    return rates[np.argmax(mean)], mean.max(), bound


@pytest.mark.parametrize(("name", "race"), FAULTY)
def test_cyclic_coherence_of_a_damaged_race(recording, name, race):
    rate, mean, bound = enhanced(*recording(name), getattr(MFPT, race))
    # a grid of 1/3 Hz beside the line
    assert RACES[race][0] - 0.34 <= rate <= RACES[race][1] + 0.34
    # the mean over all lines is above what a single one of noise reaches once in a hundred records
    assert mean > 2 * bound


@pytest.mark.parametrize("name", HEALTHY)
def test_cyclic_coherence_of_a_healthy_bearing(recording, name):
    for race in RACES:
        _, mean, bound = enhanced(*recording(name), getattr(MFPT, race))
        assert mean < bound
