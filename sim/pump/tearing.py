"""Check for a torn liquid column: the rung heads has no vapour and rigid columns.

A knock decelerates the piston within a millisecond. The column, which the rung *heads* moves with
the piston as a rigid mass, then pulls on it, down to pressures that no liquid sustains.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..hydraulics.piston_pressure import lowest_pressure
from ..pump_setup.joints import hydraulics_of, piston_area
from ..scene.pump import PumpScene
from .scene_run import run_scene

_TRIAL_TURNS = 2.0
"""Revolutions of a trial after settling: a joint that knocks does so in each of them."""


class Tear(NamedTuple):
    """A throw with a torn column: its number from 0, lowest and vapour pressure [Pa gauge]."""

    throw: int
    lowest: float
    vapour: float
    knocks: bool

    @property
    def text(self) -> str:
        """Fault text, with its cure."""
        cause = "the knocks pull the liquid down to" if self.knocks else "the piston needs"
        flow = ", or pressure.flow = 'two-harmonic', which ignores knocks" * self.knocks
        return (
            f"pressure: {cause} {self.lowest:.4g} Pa at the lowest, must be >= the liquid's vapour "
            f"pressure = {self.vapour:.4g} Pa gauge; set pressure.rung = 'chamber'{flow}, shorten "
            "pressure.suction_line.length, or lower the speed"
        )


def torn_in_motion(scene: PumpScene) -> list[Tear]:
    """Throws whose column tears in the motion of a crank without clearance.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> torn_in_motion(load_scene("bilge-pump", {"pressure.rung": "heads"}))
    []
    """
    found = []
    for throw in _columns(scene):
        liquid = hydraulics_of(scene, throw)[0]
        lowest, vapour = lowest_pressure(liquid), float(liquid["vapour"])
        if lowest < vapour:
            found.append(Tear(throw, lowest, vapour, knocks=False))
    return found


def torn_by_knocks(scene: PumpScene, step: float) -> list[Tear]:
    """Throws whose column tears in a trial of two revolutions after settling, with knocks.

    Parameters
    ----------
    scene : PumpScene
        A scene without other faults.
    step : float
        Integration step [s].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> worn = load_scene("bilge-pump", {"pressure.rung": "heads"})
    >>> torn_by_knocks(worn, 1 / 51200)[0].lowest < -1e5
    True
    """
    if not _columns(scene):
        return []
    turn = 1 / (scene.drive.speed * step)
    begin = math.ceil(scene.settling_revolutions * turn)
    run = run_scene(
        scene,
        step=step,
        n_steps=begin + math.ceil(_TRIAL_TURNS * turn),
        start_angle=scene.drive.start_angle,
    )
    throws = range(len(scene.throws))
    pull = np.array([run.force("piston_x", k)[begin:].max(initial=-math.inf) for k in throws])
    return torn_by_pull(scene, pull) if run.status.ok else []


def torn_by_pull(scene: PumpScene, pull: NDArray[np.float64]) -> list[Tear]:
    """Throws whose column tears in a run.

    Parameters
    ----------
    scene : PumpScene
    pull : numpy.ndarray [shape=(n_throws,)]
        As in :func:`lowest_under_pull`.
    """
    found = []
    for throw in _columns(scene):
        vapour = float(hydraulics_of(scene, throw)[0]["vapour"])
        lowest = lowest_under_pull(scene, pull, [throw])
        if lowest < vapour:
            found.append(Tear(throw, lowest, vapour, knocks=True))
    return found


def lowest_under_pull(
    scene: PumpScene, pull: NDArray[np.float64], throws: list[int] | None = None
) -> float:
    """Lowest pressure on the pistons in a run, including the inertia of the liquid.

    Parameters
    ----------
    scene : PumpScene
    pull : numpy.ndarray [shape=(n_throws,)]
        Largest force of the liquid along x on each piston [N], after settling.
    throws : list of int, optional
        Throws to include, counted from 0; all by default.

    Returns
    -------
    float
        Gauge pressure [Pa], a mean over its step; infinite without liquid or without steps.
    """
    area = piston_area(scene)
    each = range(len(scene.throws)) if throws is None else throws
    pushed = [k for k in each if area > 0 and scene.pressures(k).rung != "none"]
    return min((-float(pull[k]) / area for k in pushed), default=math.inf)


def _columns(scene: PumpScene) -> list[int]:
    """Throws with the rung heads and a bore."""
    bores = range(len(scene.throws)) if scene.piston.diameter > 0 else ()
    return [throw for throw in bores if scene.pressures(throw).rung == "heads"]
