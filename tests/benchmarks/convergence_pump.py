"""Is the default step of the crank with clearance fine enough for the features?

Band levels and peak pin force at the default step against a quarter of it, and the quarter
against an eighth. Contact with clearance is chaotic, so means over start angles are compared, and
the number of starts is doubled until their standard error is a third of what is asked. Run as
``python tests/benchmarks/convergence_pump.py`` (about five minutes on one core).
"""

from collections import defaultdict

import numpy as np
from wearstate.features.signal.spectrum import band_edges, band_levels
from wearstate.sim.machine.simulate import simulate, simulate_many
from wearstate.sim.scene.load import load_scene

LEVEL_TOLERANCE = 0.2  # dB, a change of 2.3 %
PEAK_TOLERANCE = 0.02
CLEARANCES = ("0.08 mm", "0.31 mm")  # diametral: as new, and at the renewal limit
MOST_STARTS = 256


def scenes(clearance, part, angles, duration="4.8 s"):
    """Scenes of the pump without noise, one for each start angle [rad].

    `part` divides the default step; the default is the step that `simulate` itself chooses.
    """
    quiet = {
        "joint.crankpin.diametral_clearance": clearance,
        "sensors.0.noise": 0,
        "sensors.1.noise": 0,
    }
    for angle in angles:
        overrides = {**quiet, "drive.start_angle": angle}
        if part > 1:
            default = load_scene("bilge-pump", {**overrides, "duration": "0.2 s"})
            overrides["numerics.step"] = simulate(default, seed=0).numerics["step_s"] / part
        yield load_scene("bilge-pump", {**overrides, "duration": duration})


def features(run):
    """Band levels [dB], both channels in a row, and the peak contact force [N] of one run."""
    if not run.status.ok:
        raise RuntimeError(run.status.text)
    levels = band_levels(run.signal[:2], 25_600.0, band_edges(25_600.0))
    return levels.ravel(), run.numerics["peak_normal_force_n"]


_RUNS = defaultdict(list)  # the starts of a smaller sample are those of the larger


def sample(clearance, part, n_starts):
    """Features of `n_starts` runs; the starts are the same for every part of the step."""
    angles = 2 * np.pi * (np.arange(n_starts) * 0.6180339887498949 % 1)  # nested, evenly spread
    runs = _RUNS[clearance, part]
    jobs = [(scene, 0) for scene in scenes(clearance, part, angles[len(runs) :])]
    found = dict(simulate_many(jobs))  # side by side: the bytes of each alone
    runs += [features(found[number]) for number in range(len(jobs))]
    levels, peaks = zip(*runs[:n_starts], strict=True)
    return np.array(levels), np.array(peaks)


def standard_error(values):
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))


def starts_needed(clearance, parts=(1, 4), first=8):
    """Number of starts, doubled until the standard errors are a third of the tolerances."""
    n_starts = first
    while n_starts <= MOST_STARTS:
        if all(_resolved(*sample(clearance, part, n_starts)) for part in parts):
            return n_starts
        n_starts *= 2
    raise RuntimeError(f"{clearance}: unresolvable with {MOST_STARTS} starts; record longer")


def _resolved(levels, peaks):
    return (
        standard_error(levels).max() < LEVEL_TOLERANCE / 3
        and standard_error(peaks) / peaks.mean() < PEAK_TOLERANCE / 3
    )


def compare(clearance, coarse, fine, n_starts):
    """Worst difference of mean band levels [dB], and of mean peak force [-]."""
    (level_c, peak_c), (level_f, peak_f) = (sample(clearance, p, n_starts) for p in (coarse, fine))
    return {
        "bands": float(abs(level_c.mean(axis=0) - level_f.mean(axis=0)).max()),
        "peak": float(peak_c.mean() / peak_f.mean() - 1),
        "scatter": float(max(standard_error(level_c).max(), standard_error(level_f).max())),
        "peak_scatter": float(max(standard_error(p) / p.mean() for p in (peak_c, peak_f))),
    }


def faults_of(found):
    """What of a comparison misses its tolerance, or is too scattered to be told."""
    limits = {
        "bands": LEVEL_TOLERANCE,
        "peak": PEAK_TOLERANCE,
        "scatter": LEVEL_TOLERANCE / 3,
        "peak_scatter": PEAK_TOLERANCE / 3,
    }
    return [
        f"{name} = {found[name]:.3g} must be < {limit:.3g}; shorten the default step"
        if name in ("bands", "peak")
        else f"{name} = {found[name]:.3g} must be < {limit:.3g}; take more starts"
        for name, limit in limits.items()
        if not abs(found[name]) < limit
    ]


def main():
    faults = []
    for clearance in CLEARANCES:
        n_starts = starts_needed(clearance, parts=(1, 4, 8))
        for coarse, fine in ((1, 4), (4, 8)):
            found = compare(clearance, coarse, fine, n_starts)
            print(
                f"{clearance}, {n_starts} starts, step 1/{coarse} against 1/{fine}: "
                f"bands {found['bands']:.3f} dB (standard error {found['scatter']:.3f}), "
                f"peak {found['peak']:+.2%} ({found['peak_scatter']:.2%})",
                flush=True,
            )
            faults += [f"{clearance}, 1/{coarse} against 1/{fine}: {f}" for f in faults_of(found)]
    if faults:  # exit code 1, with every miss on stderr
        raise SystemExit("\n".join(faults))


if __name__ == "__main__":
    main()
