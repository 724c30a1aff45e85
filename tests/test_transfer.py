"""Transfer functions as features, against a chain of three masses whose receptance is known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.features.catalogue.analysis import Analysis, Settings
from wearstate.features.catalogue.row import feature_row
from wearstate.features.response import frf, impact, response_change, transfer

FS = 2560.0
N = 60 * 2560
MASS = np.diag([2.0, 3.0, 2.5])
STIFFNESS = np.array([[9.0, -4.0, 0.0], [-4.0, 9.0, -5.0], [0.0, -5.0, 12.0]]) * 1e6
DAMPING = 1.5e-5 * STIFFNESS
"""Proportional: damping ratios of 0.75e-5 times the angular frequency, 1 to 2 %."""

KINDS = ("force", "displacement", "displacement", "displacement")
TWO = ("force", "force", "displacement", "displacement", "displacement")


def receptance(frequency, stiffness=STIFFNESS):
    """[shape=(n_lines, 3, 3), m/N]"""
    s = 2j * np.pi * np.atleast_1d(frequency)[:, np.newaxis, np.newaxis]
    return np.linalg.inv(stiffness + s * DAMPING + s**2 * MASS)


def natural(stiffness=STIFFNESS):
    """Frequencies [Hz] and mass-normalised shapes [shape=(3, 3)], a column a mode."""
    root = np.diag(np.diag(MASS) ** -0.5)
    value, vector = np.linalg.eigh(root @ stiffness @ root)
    return np.sqrt(value) / (2 * np.pi), root @ vector


def pushed(at, *, seed=0, noise=0.0, stiffness=STIFFNESS, n=N, low=0.0):
    """Forces on some masses and the motion of all, noise in shares of each channel's rms."""
    rng = np.random.default_rng(seed)
    frequency = np.fft.rfftfreq(n, 1 / FS)
    force = np.fft.rfft(rng.standard_normal((len(at), n))) * (frequency >= low)
    motion = np.einsum("lrf,fl->rl", receptance(frequency, stiffness)[:, :, list(at)], force)
    rows = np.fft.irfft(np.concatenate([force, motion]), n)
    rows[len(at) :] += (
        noise * rows[len(at) :].std(axis=-1, keepdims=True) * rng.standard_normal((3, n))
    )
    return rows


def named(rows, kinds, **options):
    names, values = feature_row(rows, FS, quantities=kinds, **options)
    return dict(zip(names, values.tolist(), strict=True))


def test_functions_of_one_and_of_two_forces():
    for at in ([0], [0, 2]):
        rows = pushed(at, noise=0.05)
        found = transfer.measured_transfer(
            rows[: len(at)], rows[len(at) :], FS, nperseg=2048, band=(20.0, 500.0)
        )
        true = receptance(found.frequency)[:, :, at].transpose(1, 2, 0).reshape(3 * len(at), -1)
        # 141 averages: where the coherence is 0.9 a line scatters by 2 %; lines of 1.25 Hz under a
        # Hann window widen a peak of 10 Hz by some 2 % at its top.
        sure = found.coherence > 0.9
        assert sure.mean() > 0.3
        assert np.median(np.abs(found.value / true - 1)[sure]) < 0.02
        assert np.abs(found.value / true - 1)[sure].max() < 0.15


def test_partial_coherence_is_that_of_what_the_other_force_leaves():
    rows = pushed([0, 2], noise=1.0, n=40_960)
    rows[1] += 0.5 * rows[0]  # forces that hang together
    found = transfer.measured_transfer(rows[:2], rows[2:], FS, nperseg=512)
    # By conditioning: of force 1 and each response, the part that H1 of force 0 does not explain.
    blocks = frf.blocks_of(rows, 512, 256)
    window = np.sin(np.pi * np.arange(512) / 512) ** 2
    blocks = blocks - blocks.mean(axis=-1, keepdims=True)
    lines = np.fft.rfft(blocks * window)[:, :, 1:-1]
    first = lines[0]

    def left(z):
        gain = np.sum(z * first.conj(), axis=0) / np.sum(np.abs(first) ** 2, axis=0)
        return z - gain * first

    other = left(lines[1])
    for i in range(3):
        response = left(lines[2 + i])
        cross = np.abs(np.sum(response * other.conj(), axis=0)) ** 2
        powers = np.sum(np.abs(response) ** 2, axis=0) * np.sum(np.abs(other) ** 2, axis=0)
        assert_allclose(found.coherence[2 * i + 1], cross / powers, rtol=1e-6, atol=1e-9)


def test_estimators_are_those_of_one_force():
    rows = pushed([1], noise=0.5, n=40_960)
    spectra = frf.welch_spectra(rows[0], rows[1:], FS, nperseg=512)
    found = transfer.measured_transfer(rows[:1], rows[1:], FS, nperseg=512)
    for name, function in (("h1", frf.h1), ("h2", frf.h2), ("hv", frf.hv)):
        assert_allclose(found.estimate(name), function(spectra)[:, 1:-1], rtol=1e-9)


def test_noise_passes_for_coherent_as_often_as_said():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((41, 60_000))
    found = transfer.measured_transfer(rows[:1], rows[1:], FS, nperseg=256)
    # 40 responses of 127 lines, a third of them independent under the window: 1 % within 0.25 %.
    assert found.masked.mean() == pytest.approx(0.99, abs=0.004)


def test_a_band_without_force_is_masked_and_said():
    settings = Settings()
    edges = settings.profile_edges(FS)
    clean, blind = (
        Analysis(rows, FS, quantities=KINDS).transfer_functions
        for rows in (pushed([0], noise=0.02), pushed([0], noise=0.02, low=60.0))
    )
    below = edges[1:] < 50.0
    (whole, sure), (part, heard) = (transfer.profile(found, edges) for found in (clean, blind))
    assert sure[0, below].all()
    # Of 20 bands of noise one may pass.
    assert heard[0, below].sum() <= 1
    assert blind.masked[0] - clean.masked[0] > 0.03  # 40 of 870 lines
    assert np.isfinite(part).all()
    # Unmasked, what the noise makes there is no part of the machine.
    wild = transfer.band_levels(blind, edges)[0, below]
    assert np.abs(wild - whole[0, below]).max() > 20
    assert np.abs(part[0, below][~heard[0, below]] - whole[0, below][~heard[0, below]]).max() < 6


def test_bands_of_noise_pass_as_often_as_said():
    rng = np.random.default_rng(3)
    rows = rng.standard_normal((31, 40_960))
    found = transfer.measured_transfer(rows[:1], rows[1:], FS, nperseg=2048)
    heard = transfer.profile(found, Settings().profile_edges(FS))[1]
    # 30 paths of 72 bands, all but independent: 1 % within 0.4 %.
    assert 0.002 < heard.mean() < 0.02


@pytest.mark.parametrize("noise", [0.3, 1.0])
def test_a_profile_is_that_of_the_machine_whatever_the_noise(noise):
    edges = Settings().profile_edges(FS)
    found = Analysis(pushed([0], noise=noise), FS, quantities=KINDS).transfer_functions
    true = receptance(found.frequency)[:, :, 0].T
    levels = response_change.band_response_levels(found.frequency, true, edges)[0]
    told, heard = (part[0] for part in transfer.profile(found, edges))
    plain = transfer.band_levels(found, edges)[0]
    weak = levels < np.max(levels) - 35
    assert heard.mean() > 0.5
    # The mean over the weak bands, of which noise makes half or more.
    bias = [np.mean(part[heard & weak] - levels[heard & weak]) for part in (told, plain)]
    assert abs(bias[0]) < 0.6 * abs(bias[1])
    assert np.abs(told - levels)[heard & ~weak].mean() < noise


def test_lines_without_force_count_less():
    """A notch in the force within a band: its lines are noise, and the level does without them."""
    edges = np.array([100.0, 140.0])
    n = N
    rng = np.random.default_rng(0)
    frequency = np.fft.rfftfreq(n, 1 / FS)
    notch = np.where((frequency > 105) & (frequency < 135), 1e-3, 1.0)
    force = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * notch, n)
    rows = np.stack([force, force + 0.05 * rng.standard_normal(n)])
    found = transfer.measured_transfer(rows[:1], rows[1:], FS, nperseg=2048)
    assert abs(transfer.profile(found, edges)[0].item()) < 0.5  # of a gain of 1
    assert abs(transfer.band_levels(found, edges).item()) > 3


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_antiresonances_of_the_chain(noise):
    found = Analysis(pushed([0], noise=noise), FS, quantities=KINDS).transfer_functions
    # Of the driven mass, near the frequencies of the chain with that mass held.
    held = np.linalg.eigvals(np.linalg.solve(MASS[1:, 1:], STIFFNESS[1:, 1:]))
    near = np.sort(np.sqrt(held))[:, np.newaxis] / (2 * np.pi) + np.linspace(-5, 5, 501)
    expected = [line[np.argmin(np.abs(receptance(line)[:, 0, 0]))] for line in near]
    rows = transfer.antiresonances(found, 3)[0]
    # Half a line of 1.25 Hz: leakage and damping move a dip, too.
    assert_allclose(rows[:2, 0], expected, atol=0.6)
    assert rows[2, 0] == 0.0
    assert (rows[:2, 1] > transfer.LEAST_DIP).all()


def test_modes_shapes_and_static_stiffness():
    rows = pushed([0], noise=0.02)
    settings = Settings(n_modes=3)
    found = named(rows, KINDS, settings=settings, feature_set="complete")
    frequency, shape = natural()
    constant = shape * shape[0]  # response i, force on mass 0
    for k in range(3):
        f = found[f"frf.mode_{k + 1}.frequency_hz"]
        assert f == pytest.approx(frequency[k], rel=2e-3)
        scatter = found[f"frf.mode_{k + 1}.frequency_deviation_hz"]
        assert 0 < scatter < 0.5
        told = [found[f"ch_{i}.mode_{k + 1}.shape"] for i in (1, 2, 3)]
        doubt = [found[f"ch_{i}.mode_{k + 1}.shape_deviation"] for i in (1, 2, 3)]
        expected = constant[:, k] / np.linalg.norm(constant[:, k])
        # Leakage adds some hundredths to what the scatter tells.
        assert np.all(np.abs(np.array(told) - expected) < 0.05 + 4 * np.array(doubt))
    stiffness = -20 * np.log10(np.abs(np.linalg.inv(STIFFNESS)[:, 0]))
    told = [found[f"ch_{i}.static.stiffness_db"] for i in (1, 2, 3)]
    assert_allclose(told, stiffness, atol=0.8)  # leakage widens the modes


def test_changes_of_the_modes_against_the_healthy_machine():
    settings = Settings(n_modes=3)
    healthy = Analysis(pushed([0], noise=0.02), FS, quantities=KINDS, settings=settings)
    functions = healthy.transfer_functions
    known = transfer.FrfReference(functions.frequency, functions.value, healthy.modes)
    softer = STIFFNESS - np.diag([0, 0, 1.5e6])
    found = named(
        pushed([0], seed=1, noise=0.02, stiffness=softer),
        KINDS,
        settings=Settings(n_modes=3, reference=known),
        only=["mode_changes", "resonance_shift", "frf_assurance"],
    )
    shift = natural(softer)[0] / natural()[0] - 1
    told = [found[f"frf.mode_{k}.frequency_shift"] for k in (1, 2, 3)]
    assert_allclose(told, shift, atol=3e-3)
    assert np.abs(shift).max() > 0.02
    assert found["frf.resonance_shift.mean"] == pytest.approx(np.mean(told), abs=1e-12)
    assert all(0.5 < found[f"frf.mode_{k}.mac"] <= 1 for k in (1, 2, 3))
    assert found["ch_1.frf.assurance"] < 0.95
    # A dead sensor: nothing is found again, and nothing fails.
    rows = pushed([0], noise=0.02)
    rows[3] = 0.0
    dead = named(rows, KINDS, settings=Settings(n_modes=3, reference=known), only=["mode_changes"])
    assert set(dead.values()) == {0.0}


def test_two_forces_name_their_paths_and_one_may_be_dead():
    rows = pushed([0, 2], noise=0.02)
    found = named(rows, TWO)
    profile = [name for name in found if ".frf.profile_" in name]
    assert len(profile) == 72 * 6
    assert profile[0].startswith("ch_2_per_ch_0.frf.profile_")
    rows[1] = 0.5
    dead = named(rows, TWO)
    levels = {name: dead[name] for name in profile}
    assert {v for name, v in levels.items() if "_per_ch_1." in name} == {-200.0}
    alone = named(rows[[0, 2, 3, 4]], KINDS)
    ours = [v for name, v in levels.items() if "_per_ch_0." in name]
    assert_allclose(ours, [v for name, v in alone.items() if ".frf.profile_" in name])
    rows[1] = rows[0]
    with pytest.raises(ValueError, match="drive the shakers by independent noise"):
        named(rows, TWO)


def decibels(value, other):
    return np.abs(20 * np.log10(np.abs(value) / np.abs(other)))


# --- another library, where it is installed

BLOCK, BLOWS = 5120, 12


def struck(seed=0):
    """A hammer on the first mass, every 2 s, with a hand's scatter; noise on force and motion."""
    rng = np.random.default_rng(seed)
    force = np.zeros(BLOWS * BLOCK)
    for k in range(BLOWS):
        at = k * BLOCK + 40 + rng.integers(0, 200)
        force[at : at + 5] += 100 * rng.uniform(0.5, 1.5) * np.array([0.3, 0.8, 1.0, 0.8, 0.3])
    lines = receptance(np.fft.rfftfreq(force.size, 1 / FS))[:, :, 0].T * np.fft.rfft(force)
    motion = np.fft.irfft(lines, force.size)
    motion += 5e-4 * np.abs(motion).max() * rng.standard_normal(motion.shape)
    return force + 0.01 * rng.standard_normal(force.size), motion


@pytest.mark.parametrize("cut", ["ours", "whole periods"])
def test_h1_of_an_impact_record_by_pyfrf(cut):
    library = pytest.importorskip("pyFRF")
    force, motion = struck()
    found = transfer.measured_transfer(force[np.newaxis], motion, FS, nperseg=BLOCK)
    assert found.words == f"{BLOWS} blows"
    level, shape = force - np.median(force), (BLOWS, 1, BLOCK)
    rows = motion - motion.mean(axis=-1, keepdims=True)
    pulses, blocks = level.reshape(shape), rows.reshape(3, BLOWS, BLOCK).swapaxes(0, 1)
    if cut == "ours":
        blows = impact.find_impacts(force, FS).blows
        fill = BLOCK - blows.nperseg
        pulses = np.pad(blows.cut(level[np.newaxis]), ((0, 0), (0, 0), (0, fill)))
        blocks = np.pad(blows.cut(rows), ((0, 0), (0, 0), (0, fill)))
    options = {"exc_type": "f", "resp_type": "d", "fft_len": BLOCK}
    theirs = library.FRF(int(FS), pulses, blocks, **options).get_H1()[:, 0, 1 : BLOCK // 2]
    sure = found.coherence > 0.9
    assert sure.mean() > 0.1
    apart = decibels(found.value, theirs)[sure]
    # Of other blocks other noise: a tenth of it and what lies before the blow.
    assert (apart < 0.1).mean() > (0.9 if cut == "whole periods" else 0.9999)
    assert np.median(apart) < 0.02


def test_h1_of_two_shakers_by_pyfrf():
    library = pytest.importorskip("pyFRF")
    rows = pushed([0, 2], noise=0.05)
    found = transfer.measured_transfer(rows[:2], rows[2:], FS, nperseg=2048)
    options = {"window": "hann", "fft_len": 2048, "nperseg": 2048, "noverlap": 1024}
    other = library.FRF(int(FS), rows[np.newaxis, :2], rows[np.newaxis, 2:], "f", "d", **options)
    theirs = other.get_H1()[:, :, 1:1024].reshape(6, -1)
    sure = found.coherence > 0.9
    assert sure.mean() > 0.3
    assert decibels(found.value, theirs)[sure].max() < 0.1
