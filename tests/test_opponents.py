"""Runs of our crank that the comparison with other codes times."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(
    0, str(Path(__file__).parent / "benchmarks")
)  # its files import one another by name

import opponents_crank as opponents

STEPS = 400


def test_runs_of_the_comparison_are_done_alone_and_side_by_side():
    step = opponents.REVOLUTION / 4096
    angles = np.tile(opponents.START_ANGLES, opponents.LANES // len(opponents.START_ANGLES))
    starts = [opponents.start_state(angle) for angle in angles]
    opponents.prepared_lanes(starts, "zero force", step, STEPS)()
    states = opponents.run_ours(starts[0], "zero force", step, STEPS)
    assert len(states) == STEPS + 1
    assert np.isfinite(states).all()
    assert np.abs(states[-1] - states[0]).max() > 1e-3
