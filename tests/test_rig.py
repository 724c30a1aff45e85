"""The simulated rig test: what it measures against the model, and what it makes of peaks."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
import scipy.stats
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.shaft_tests import before_after, peak_changes, rig_figure, rig_setup
from wearstate.diagnose.shaft_tests import rig_test as rig
from wearstate.features.response.frf import Frf
from wearstate.sim.alignment.calibration import calibrate
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_parts import Disc, Section
from wearstate.sim.beam.modes import natural_frequencies
from wearstate.sim.beam.rotor import Rotor, Support
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line
from wearstate.sim.shaft_response.time_response import Broadband, Harmonic

RATE = 1024.0
SPEED = 2 * np.pi * 12.0
BEARINGS = {"aft": 0.2, "middle": 1.1, "forward": 2.0}
BLOWS = rig_setup.HammerTest(blows=12, block=1.0, peak_force=300.0, quiet=5.0, force_noise=0.0)
BURSTS = rig_setup.ShakerTest(bursts=12, block=2.0, force=30.0, quiet=5.0, force_noise=0.0)


def small_rotor(damping=1.0, pedestal_damping=2e3):
    """2.2 m of 60 mm on three housings: some ten modes up to 400 Hz."""
    steel = {"young": 2.1e11, "shear_modulus": 8.1e10, "density": 7850.0}
    beam = assemble_beam(
        [Section(length=2.2, outer_diameter=0.06, **steel)],
        discs=[Disc(station=0.0, mass=12.0, polar_inertia=0.4, diametral_inertia=0.25)],
        stations=sorted({0.6, *BEARINGS.values()}),
        longest_element=0.1,
        theory="euler-bernoulli",
    )
    supports = [
        Support(
            name=name,
            station=station,
            stiffness=np.diag([2e7, 1.5e7]),
            damping=damping * 4e3 * np.eye(2),
            housing_mass=15.0,
            pedestal_stiffness=(4e7, 3e7),
            pedestal_damping=(pedestal_damping, pedestal_damping),
        )
        for name, station in BEARINGS.items()
    ]
    return Rotor(
        beam=beam, supports=tuple(supports), damping_ratio=0.03, damping_band=(10.0, 400.0)
    )


def plant(rotor=None, noise=0.0, **forces):
    return rig.rotor_plant(
        rotor or small_rotor(),
        speed=SPEED,
        force=(0.6, "y"),
        responses={name: (name, "y", "housing") for name in BEARINGS},
        sample_rate=RATE,
        noise=noise,
        **forces,
    )


TURBULENCE = Broadband(
    frequencies=[0.0, 200.0, 512.0], density=[0.4, 0.2, 0.1], forces={(0.0, "y"): 1.0}
)
QUIET_PLANT = plant()
NOISY_PLANT = plant(noise=0.01, broadband=(TURBULENCE,))


# --- measured against the model


@pytest.mark.parametrize("setup", [BLOWS, BURSTS, replace(BURSTS, kind="sweep")])
def test_without_noise_the_test_gives_the_model(setup):
    result = rig.run_test(QUIET_PLANT, setup, seed=3)
    level = np.abs(result.model)
    # The tail cut off at a block's end is a thousandth of a response or less, and the reduced
    # rotor is as good; near an antiresonance that is more than the response, hence the mean.
    error = np.abs(result.frf.value - result.model)
    assert np.all(np.mean(error, axis=-1) < 2e-3 * np.mean(level, axis=-1))
    assert result.frf.frequency[0] >= 5.0
    assert result.frf.frequency[-1] <= 400.0
    assert np.median(result.frf.coherence) > 0.999
    assert result.rejected == ()


@pytest.mark.parametrize("setup", [BLOWS, BURSTS, replace(BURSTS, kind="sweep")])
def test_the_confidence_disc_holds_the_model(setup):
    held = [rig.run_test(NOISY_PLANT, setup, seed=seed) for seed in range(8)]
    assert np.min([np.mean(result.frf.coherence) for result in held]) < 0.95
    # 8 x 395 lines or more, the channels share their noise: 0.4 % a deviation. A short block
    # leaks the noise of a resonance into its neighbours, so fewer lines are independent.
    assert_allclose(np.mean([result.held for result in held]), 0.95, atol=0.02)


def test_the_force_window_takes_the_cells_noise():
    setup = replace(BLOWS, force_noise=1.0)
    errors = []
    for window in (rig_setup.TEST_KINDS[rig_setup.HammerTest].window, lambda _: None):
        kinds = {
            rig_setup.HammerTest: replace(rig_setup.TEST_KINDS[rig_setup.HammerTest], window=window)
        }
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rig, "TEST_KINDS", kinds)
            result = rig.run_test(QUIET_PLANT, setup, seed=1)
        errors.append(np.mean(np.abs(result.frf.value - result.model)))
    # 23 of 1024 samples keep their noise: a factor of 6.7 in amplitude, less the bias above.
    assert errors[0] < errors[1] / 3


def test_noise_on_the_force_lowers_h1_and_not_h2():
    setup = replace(BURSTS, bursts=60, force_noise=20.0)
    result = {
        name: rig.run_test(QUIET_PLANT, setup, seed=2, estimator=name) for name in ("h1", "h2")
    }
    ratio = {name: np.median(np.abs(test.frf.value / test.model)) for name, test in result.items()}
    # Band of 5 to 400 of 512 Hz, on in 0.6 of a block: density of the force over its noise's.
    r = 20.0**2 / (30.0**2 * 0.6 * 512 / (1.05 * 400 - 0.8 * 5))
    # The median of 1183 lines, each with the scatter of sixty bursts.
    assert_allclose(ratio["h1"], 1 / (1 + r), rtol=0.03)
    assert_allclose(ratio["h2"], 1.0, rtol=0.03)


def test_the_orders_of_the_shaft_are_taken_out():
    turning = Harmonic(frequency=12.0, forces={(0.0, "y"): 3e3, (0.0, "z"): -3e3j})
    blade = Harmonic(frequency=48.0, forces={(0.0, "y"): 1e3})
    without = rig.run_test(NOISY_PLANT, BLOWS, seed=5)
    with_orders = rig.run_test(replace(NOISY_PLANT, harmonics=(turning, blade)), BLOWS, seed=5)
    # Sums over whole revolutions: what is left is rounding of 1e4 times the noise.
    assert_allclose(with_orders.frf.value, without.frf.value, rtol=1e-6, atol=1e-12)


def test_a_seed_decides_everything():
    first, same, other = (rig.run_test(NOISY_PLANT, BLOWS, seed=seed) for seed in (7, 7, 8))
    assert_array_equal(first.response, same.response)
    assert_array_equal(first.force, same.force)
    assert np.abs(first.force - other.force).max() > 10
    assert first.force.shape == (12, 1024)
    assert first.response.shape == (12, 3, 1024)


def test_blows_are_half_sines_that_scatter():
    result = rig.run_test(QUIET_PLANT, replace(BLOWS, blows=100), seed=1)
    peaks = result.force.max(axis=-1)
    # Samples miss the top by up to cos(pi 0.2) at 2.56 samples a pulse: mean -10 %; 100 draws.
    assert_allclose(np.std(np.log(peaks)), 0.2, atol=0.06)
    impulse = result.force.sum(axis=-1) / RATE
    # The area of a half sine, 2 F t / pi, of median F; 2.5 % a deviation, and sampling.
    assert_allclose(np.median(impulse), 2 / np.pi * 300.0 * 2.5e-3, rtol=0.08)


# --- peaks


def test_peaks_stand_at_natural_frequencies():
    rotor = small_rotor(0.0, 300.0)
    quiet = rig.run_test(plant(rotor, noise=1e-4), replace(BLOWS, block=4.0, quiet=1.0), seed=0)
    modes = natural_frequencies(rotor, SPEED, 24)
    apart = []
    for lines, model in zip(peak_changes.find_frf_peaks(quiet.frf), quiet.model, strict=True):
        level = 20 * np.log10(np.abs(model))
        theirs, outstanding = scipy.signal.find_peaks(level, prominence=1.0)
        # The test is quiet: a peak stands at one of the model's, give or take two of the five
        # lines that are smoothed, and those that stand out twice as far as asked are all there.
        assert np.max(np.min(np.abs(lines[:, None] - theirs), axis=1)) <= 2
        high = theirs[outstanding["prominences"] > 6.0]
        assert np.max(np.min(np.abs(lines - high[:, None]), axis=1)) <= 2
        apart += [np.min(np.abs(modes / f - 1)) for f in quiet.frf.frequency[lines]]
    # Damping of 1 to 2 %: within half a bandwidth and a line. Three of some thirty are no modes,
    # but tops between an accelerance's rise with frequency and an antiresonance.
    assert np.count_nonzero(np.less(apart, 0.01)) >= len(apart) - 3
    assert len(apart) > 15


def flat_frf(seed, averages, share):
    """A smooth response with the scatter of its coherence."""
    rng = np.random.default_rng(seed)
    frequency = np.arange(5.0, 405.0, 0.25)
    noise = rng.standard_normal((2, averages, frequency.size)) * np.sqrt((1 - share) / share / 2)
    each = frequency / 100 + (frequency / 100) * (noise[0] + 1j * noise[1])
    value = each.mean(axis=0)
    coherence = np.abs(value) ** 2 / np.mean(np.abs(each) ** 2, axis=0)
    one = np.ones((1, frequency.size))
    return Frf(
        frequency=frequency, value=value[None], coherence=coherence[None], radius=one,
        averages=float(averages), estimator="h1", confidence=0.95,
    )  # fmt: skip


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.95])
def test_noise_makes_no_peaks(share):
    found = [peak_changes.find_frf_peaks(flat_frf(seed, 30, share))[0].size for seed in range(20)]
    # 20 x 1600 lines.
    assert sum(found) == 0


def test_nothing_changed_is_not_called_a_change():
    changes = []
    for seed in range(20):
        first, second = (rig.run_test(NOISY_PLANT, BLOWS, seed=2 * seed + k) for k in (0, 1))
        changes.append(peak_changes.peak_changes(first, second))
    assert np.mean([len(found) for found in changes]) > 5
    wrong = [any(peak.verdict != "unchanged" for peak in found) for found in changes]
    # At most 5 % of the tests by Holm's bound: of 20, four or more have a probability of 2 %.
    assert sum(wrong) < 4
    # The truth is of the line where the peak was found, give or take two.
    truths = [peak.model_change for found in changes for peak in found]
    assert np.median(np.abs(truths)) < 0.05


def test_a_change_is_found_with_its_size():
    damped = plant(small_rotor(damping=3.0), noise=0.01, broadband=(TURBULENCE,))
    held, verdicts = [], []
    for seed in range(12):
        before = rig.run_test(NOISY_PLANT, BLOWS, seed=500 + 2 * seed)
        after = rig.run_test(damped, BLOWS, seed=501 + 2 * seed)
        for peak in peak_changes.peak_changes(before, after):
            low, high = peak.interval
            held.append(low <= peak.model_change <= high)
            if peak.verdict != "unchanged":
                verdicts.append(np.sign(peak.change) == np.sign(peak.model_change))
                assert peak.verdict == ("suppressed" if peak.change < 0 else "amplified")
    assert len(held) > 80
    # 95 % nominal; first order in errors of up to a fifth, tops that were picked, and peaks of
    # three channels that share their noise.
    assert 0.88 <= np.mean(held) <= 0.99
    assert len(verdicts) > 30
    assert np.mean(verdicts) > 0.98


def test_pairs_take_the_nearest_once():
    frequency = np.arange(0.0, 400.0)
    lines = np.array([100, 109, 200, 300])
    later = np.array([104, 107, 150, 230, 301, 350])
    pairs = peak_changes._pairs(frequency, lines, later, new=np.array([107, 150, 301]))
    # 200 has gone, 150 has come, 350 is too low to have come.
    assert pairs == [(100, 104), (109, 107), (150, 150), (200, 200), (300, 301)]


def test_intervals_and_p_values_against_scipy():
    change, errors, freedom = -1.3, (0.5, 0.3), (58.0, 22.0)
    (low, high), p_value = peak_changes._welch(change, errors, freedom, 0.9)
    sizes = [f + 1 for f in freedom]
    spreads = [e * np.sqrt(n) for e, n in zip(errors, sizes, strict=True)]
    theirs = scipy.stats.ttest_ind_from_stats(
        change, spreads[0], sizes[0], 0.0, spreads[1], sizes[1], equal_var=False
    )
    assert_allclose(p_value, theirs.pvalue, rtol=1e-10)
    spread = np.hypot(*errors)
    degrees = spread**4 / sum(e**4 / f for e, f in zip(errors, freedom, strict=True))
    assert_allclose(high - change, scipy.stats.t.ppf(0.95, degrees) * spread, rtol=1e-10)
    assert_allclose(low + high, 2 * change, rtol=1e-12)


def test_a_change_rests_on_the_scatter_of_both_tests(ship):
    peak = ship.changes[0]
    errors = []
    for test, frequency in (
        (ship.before, peak.frequency_before),
        (ship.after, peak.frequency_after),
    ):
        line = int(np.argmin(np.abs(test.frf.frequency - frequency)))
        share = test.frf.coherence[test.channels.index(peak.channel), line]
        # Eight blocks: an F(2, 14) disc, and a relative deviation by the same residual.
        errors.append(20 / np.log(10) * np.sqrt((1 - share) / share / 14))
    degrees = 14 * np.sum(np.square(errors)) ** 2 / np.sum(np.power(errors, 4))
    width = scipy.stats.t.ppf(0.975, degrees) * np.hypot(*errors)
    assert_allclose(peak.interval, [peak.change - width, peak.change + width], rtol=1e-9)


def test_holm_against_its_definition():
    rng = np.random.default_rng(0)
    p_values = rng.uniform(size=9) ** 3
    adjusted = peak_changes.holm(p_values)
    for level in rng.uniform(0, 0.5, 50):
        # Step down: reject while the k-th smallest of the n left is below level / (n - k).
        rejected = set()
        for k, at in enumerate(np.argsort(p_values)):
            if p_values[at] > level / (9 - k):
                break
            rejected.add(int(at))
        assert {i for i, p in enumerate(adjusted) if p <= level} == rejected
    assert peak_changes.holm([]) == []


# --- a scene


SHIP = rig_setup.ShakerTest(force=5e4, bursts=8, quiet=4.0, block=2.5)
FORCE = ("stern_forward", "y")


@pytest.fixture(scope="module")
def ship():
    scene = load_scene("propulsion-shaft", {"bearings.2.sag": "1.4 mm"})
    moves = {"intermediate_aft": 1.4e-3}
    return before_after.before_after(scene, moves, force=FORCE, setup=SHIP, seed=1)


def test_a_scene_before_and_after(ship):
    names = ("stern_aft", "stern_forward", "intermediate_aft", "intermediate_forward")
    assert ship.before.channels == (*names, "thrust_block")
    assert ship.moves == {"intermediate_aft": 1.4e-3}
    assert len(ship.changes) > 10
    # The moved bearing was almost without load: its film changes, and with it the response there.
    row = ship.before.channels.index("intermediate_aft")
    moved = 20 * np.log10(np.abs(ship.after.model[row] / ship.before.model[row]))
    assert np.max(np.abs(moved)) > 1.0
    # Measured and true changes agree where the shaker is far stronger than the turbulence.
    measured = [peak.change for peak in ship.changes]
    truth = [peak.model_change for peak in ship.changes]
    assert_allclose(np.mean(np.subtract(measured, truth)), 0.0, atol=0.1)
    held = [p.interval[0] <= p.model_change <= p.interval[1] for p in ship.changes]
    # Of some twenty peaks at 95 %, two or three may be missed, and neighbours share their noise.
    assert np.mean(held) > 0.8


@pytest.fixture(scope="module")
def laboratory():
    """The rig with its third bearing 0.45 mm too low, calibrated, and pushed beside it."""
    scene = load_scene("shaft-rig", {"bearings.2.sag": "0.2 mm"})
    found = calibrate(alignment_line(scene), tuple(alignment_conditions(scene).values()))
    return before_after.calibrated_test(scene, found, "shaker", push="forward", seed=2)


def test_calibration_suppresses_some_peaks(laboratory):
    # What the paper of 2020 claims; it prints no values.
    fell, rose = laboratory.of("suppressed"), laboratory.of("amplified")
    best = min(fell, key=lambda peak: peak.change)
    assert best.channel == "third"
    assert best.change < -3.0
    for peak in (*fell, *rose):
        # A significant change is the model's too, but for one in twenty of such tests.
        assert np.sign(peak.change) == np.sign(peak.model_change)
    held = [p.interval[0] <= p.model_change <= p.interval[1] for p in laboratory.changes]
    assert np.mean(held) > 0.8


def test_the_usual_test_goes_with_the_shaft(laboratory):
    setup = laboratory.before.setup
    # 4.2 m of 60 mm, a disc and half a coupling: about 1.2 kN.
    assert 10 < setup.force < 50
    assert setup.block >= 4.0
    assert np.all(np.abs(laboratory.before.held - 0.95) < 0.04)


def test_the_summary_says_what_the_test_found(ship):
    fell, rose = ship.of("suppressed"), ship.of("amplified")
    assert len(fell) + len(rose) + len(ship.of("unchanged")) == len(ship.changes)
    assert ship.summary.startswith(
        f"Of {len(ship.changes)} peaks {len(fell)} fell and {len(rose)} rose significantly"
    )
    assert "In the model these peaks change by" in ship.summary
    empty = replace(ship, changes=())
    assert empty.summary.startswith("No peak exceeds")


def test_turns_go_into_the_scene():
    scene = load_scene("propulsion-shaft")
    turned = before_after.turned_scene(scene, {"stern_aft": -2e-4})
    assert turned.bearings[0].slope == scene.bearings[0].slope - 2e-4
    assert turned.bearings[1:] == scene.bearings[1:]
    with pytest.raises(ValueError, match="turns: 'stern' is no bearing; choose one of stern_aft"):
        before_after.turned_scene(scene, {"stern": 1e-4})


def test_the_picture(ship, tmp_path):
    figure = rig_figure.rig_figure(ship, channels=["stern_aft", "thrust_block"])
    assert len(figure.axes) == 4
    curves = {line.get_label() for line in figure.axes[0].lines}
    assert {"before, test", "after, test", "before, model", "after, model"} <= curves
    figure.savefig(tmp_path / "rig.png", dpi=40)
    with pytest.raises(ValueError, match="channels = aft must be of stern_aft"):
        rig_figure.rig_figure(ship, channels=["aft"])


def ask(*arguments):
    return CliRunner().invoke(cli, ["align", "propulsion-shaft", *arguments])


def test_the_command_line_tests_before_and_after(tmp_path):
    picture = tmp_path / "test.png"
    sag = ("--set", "bearings.2.sag=1.4 mm")
    result = ask(*sag, "--test", "shaker", "--test-plot", str(picture), "--json")
    table = json.loads(result.stdout)
    assert picture.stat().st_size > 10_000
    assert table["files"] == [str(picture)]
    test = table["test"]
    assert (test["kind"], test["force_place"]) == ("shaker", ["stern_aft", "y"])
    assert test["averages"] == [60.0, 60.0]
    assert test["moves_m"]["intermediate_aft"] > 1e-4
    assert len(test["peaks"]) > 10
    assert {peak["channel"] for peak in test["peaks"]} <= set(test["moves_m"])


def test_the_command_line_has_nothing_to_test():
    result = ask("--test", "hammer")
    assert result.exit_code == 0
    assert "no test: nothing moves" in result.stdout


def test_words_of_a_test(ship):
    lines = before_after.rig_text(ship).splitlines()
    assert lines[0] == "simulated shaker test, pushing stern_forward up, 8 blocks before and after"
    assert len(lines) == 3 + len(ship.changes)
    assert before_after._in_words((1.5, "z")) == "the shaft at 1.5 m sideways"
    assert before_after._in_words(("aft", "y", "housing")) == "the housing of aft up"
    table = before_after.rig_table(ship)
    assert json.loads(json.dumps(table)) == {
        **table,
        "peaks": [{**peak, "interval": list(peak["interval"])} for peak in table["peaks"]],
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--push", "stern_aft"], "need --test"),
        (["--test", "hammer", "--no-calibrate"], "leave out --no-calibrate"),
        (
            ["--test", "hammer", "--push", "gear"],
            "push = 'gear' is no bearing; choose one of stern",
        ),
        (["--test", "anvil"], "'anvil' is not one of"),
    ],
)
def test_the_command_line_refuses(arguments, message):
    result = ask(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr


# --- refusals


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rig_setup.HammerTest(blows=1, scatter=2.0), "blows = 1(.|\n)*scatter = 2.0"),
        (
            lambda: rig_setup.HammerTest(contact_time=1e-3),
            "contact_time = 0.001 s must be >= 0.00195",
        ),
        (lambda: rig_setup.HammerTest(high=500.0), "high = 500.0 Hz must be .* raise sample_rate"),
        (lambda: rig_setup.HammerTest(block=0.0, peak_force=0.01, force_noise=-1), "block = 0.0 s"),
        (
            lambda: rig_setup.ShakerTest(kind="sine"),
            "kind = 'sine' must be one of burst-random, sweep",
        ),
        (
            lambda: rig_setup.ShakerTest(share=1.0, bursts=1, force=-1.0),
            "force = -1.0 N(.|\n)*share",
        ),
        (lambda: rig.run_test(QUIET_PLANT, replace(BLOWS, block=0.1)), "lengthen the block"),
        (lambda: rig.run_test(plant(small_rotor(-1.0)), BLOWS), "growth rate = .* must be < 0"),
        (
            lambda: rig.rotor_plant(
                small_rotor(), speed=0.0, force=3, responses={}, sample_rate=RATE
            ),
            "place = 3 must be named",
        ),
        (
            lambda: peak_changes.peak_changes(
                rig.run_test(QUIET_PLANT, BLOWS), rig.run_test(QUIET_PLANT, replace(BLOWS, low=9.0))
            ),
            "run both with one setup",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(rig_setup.RigError, match=message):
        call()
