"""Validity checks of an orbit's film and integrator: longest steps, width of a short film."""

import math
from typing import cast

from ..scene.journal import JournalScene
from ..scene.scene import Scene

JOURNAL_STEP = 0.02
"""Default step as a shaft angle, that of the source paper [rad]."""


def journal_step(scene: JournalScene) -> float:
    """Step of a journal's fixed-step integrator, a whole fraction of a sample [s]."""
    step = scene.numerics.step or JOURNAL_STEP / (math.tau * scene.drive.speed)
    sample = 1 / scene.sample_rate
    return sample / math.ceil(sample / step * (1 - 1e-9))


_LONGEST_STEP = {"euler": 0.1, "rk4": 0.5}
"""Longest step of the fixed integrators [rad]: euler shifts the whirl threshold by 0.34 of its
step, and any load needs at least a dozen steps per revolution."""

_LONGEST_SHORT = 1.0  # L/D of a short film: there its force is 1.3 to 3 times the bearing's


def orbit_faults(scene: Scene) -> list[str]:
    """Find a step that is stable but too long to be accurate, or a film outside its validity.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> orbit_faults(load_scene("journal-step"))
    []
    """
    journal = cast(JournalScene, scene)
    faults = []
    speed, given = math.tau * journal.drive.speed, journal.numerics.step
    longest = _LONGEST_STEP.get(journal.numerics.integrator, math.inf)
    step = min(given or JOURNAL_STEP / speed, 1 / journal.sample_rate)
    if step * speed > longest:
        faults.append(
            f"numerics.step = {step:g} s must be <= {longest / speed:.3g} s, {longest:g} rad of "
            "the shaft, for the orbit to be accurate; shorten it, or set numerics.integrator = "
            "'adaptive'"
        )
    ratio = journal.bearing.length / journal.bearing.diameter
    if journal.film.rung == "short" and ratio > _LONGEST_SHORT:
        faults.append(
            f"film.rung = 'short' of L/D = {ratio:.3g} must be <= {_LONGEST_SHORT:g}, as it "
            "neglects the flow round the circle; set film.rung = 'map'"
        )
    return faults
