"""Forces of the mechanism on the casing, and how a yielding casing carries its main bearing."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..casing.modes import casing_inputs, exact_oscillator
from ..mechanism.layout import (
    AT_REST,
    CRANK_FORCES,
    CRANKPIN,
    FORCES,
    GUIDE,
    JOINT_COMPLIANT,
    PUSHES,
    Yielding,
)
from ..scene.pump import GUIDE_PLACES, VALVE_PLACES, PumpScene
from ..scene.pump_hydraulics import CHAMBER_RUNGS
from .joints import has_main_play, joint_rungs


def throw_on_casing(scene: PumpScene, throw: int) -> list[tuple[str, str, float]]:
    """Places on the casing, the force of the mechanism at each, and its sign."""
    reactions = [
        *_on_bearing(scene),
        ("guide_y", "guide_y", -1.0),
        ("cylinder_x", "piston_x", -1.0),
    ]
    if scene.piston.seal_friction or scene.piston.seal_friction_share:
        reactions.append(("cylinder_x", "seal_x", -1.0))
    if rubs_in_guide(scene, throw):
        reactions += [(place, place, -1.0) for place in GUIDE_PLACES]
    if scene.pressures(throw).rung in CHAMBER_RUNGS:
        reactions += [(place, place, 1.0) for place in VALVE_PLACES]
    return reactions


def _on_bearing(scene: PumpScene) -> list[tuple[str, str, float]]:
    """Forces of a throw on its main bearing; a journal with play spreads them over all throws."""
    if not has_main_play(scene):
        return [("bearing_x", "pin_x", -1.0), ("bearing_y", "pin_y", -1.0)]
    share = 1 / len(scene.throws)
    return [(place, name, share) for place, name in zip(_BEARING, CRANK_FORCES, strict=True)]


def rubs_in_guide(scene: PumpScene, throw: int) -> bool:
    """Whether the piston of a throw rubs in a guide with clearance."""
    return joint_rungs(scene, throw)[GUIDE] == JOINT_COMPLIANT


def yielding_of(scene: PumpScene, step: float) -> Yielding:
    """Casing that carries the main bearing, for the rung `yielding`; else one at rest.

    Its modes are those of the casing on its present feet, and exact for a force that is constant
    over a step [s]. Modes with more than half a cycle per step are omitted, as is the
    unbalance of the crank, whose frequency is far below the first mode.
    """
    if scene.casing.rung != "yielding":
        return AT_REST
    moving = [step * mode.frequency < 0.5 for mode in scene.casing.modes]
    modes = [mode for mode, moves in zip(scene.casing.modes, moving, strict=True) if moves]
    throws = range(len(scene.throws))
    feet = 1.0 if scene.casing.feet is None else scene.casing.feet.stiffness_ratio
    push = np.zeros((len(modes), len(throws), len(PUSHES)))
    journal = np.zeros((len(modes), len(CRANK_FORCES)))
    for throw in throws:
        for place, name, sign in throw_on_casing(scene, throw):
            pushed = [sign * casing_inputs(m.shape, place, throw + 1) for m in modes]
            if name in CRANK_FORCES:
                journal[:, CRANK_FORCES.index(name)] += pushed
            else:
                push[:, throw, PUSHES.index(FORCES.index(name))] += pushed
    react, reach = step_of_modes([mode.on_feet(feet) for mode in modes], step)
    give, held = bearing_shapes(scene)[moving], _held(scene)[moving]
    gain = give.T @ (react[:, :1] * held)
    return Yielding(
        push=push,
        react=react,
        reach=reach,
        give=give,
        held=held,
        journal=journal,
        blend=np.asarray(np.linalg.solve(np.eye(2) + gain, gain), np.float64),
    )


def step_of_modes(
    modes: Sequence[tuple[float, float]], step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean acceleration of modes over a step, and their displacement and speed after it.

    Parameters
    ----------
    modes : sequence of (float, float)
        Frequency [Hz] and damping ratio.
    step : float
        Integration step [s].

    Returns
    -------
    react, reach : ndarray of shape (n_modes, 3)
        Per force, constant over the step, and per displacement and speed before it; unit modal
        mass.
    """
    react, reach = np.empty((len(modes), 3)), np.empty((len(modes), 3))
    for row, (frequency, damping_ratio) in enumerate(modes):
        turned, gain = exact_oscillator(frequency, damping_ratio, step)
        place, speed = gain.sum(axis=1)
        react[row] = speed / step, turned[1, 0] / step, (turned[1, 1] - 1) / step
        reach[row] = place, turned[0, 0], turned[0, 1]
    return react, reach


def _held(scene: PumpScene) -> NDArray[np.float64]:
    """Force on each mode per acceleration of the masses held by the bearing [kg^0.5], (n_modes, 2).

    A rigid crank pin holds piston and rod along the stroke; across it pin and guide share them,
    according to the rod's mass distribution. With play in the crank pin, the guide holds the piston
    and the share of a free rod; the effect of the pin's contact within a step is small.
    """
    held = np.zeros((len(scene.casing.modes), 2))
    for k in range(len(scene.throws)):
        at = np.array(
            [
                [casing_inputs(mode.shape, place, k + 1) for place in (*_BEARING, "guide_y")]
                for mode in scene.casing.modes
            ]
        )
        along, at_pin, at_guide = _held_masses(scene, k)
        held[:, 0] += along * at[:, 0]
        held[:, 1] += at_pin * at[:, 1] + at_guide * at[:, 2]
    return held


def guide_gain(scene: PumpScene) -> float:
    """Acceleration of a bearing across the stroke per acceleration of its guides' load.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(guide_gain(load_scene("bilge-pump")), 3)
    0.06
    """
    across = bearing_shapes(scene)[:, 1]
    guides = [
        _held_masses(scene, k)[2]
        * np.array([casing_inputs(m.shape, "guide_y", k + 1) for m in scene.casing.modes])
        for k in range(len(scene.throws))
    ]
    return float(across @ np.sum(guides, axis=0))


def _held_masses(scene: PumpScene, throw: int) -> tuple[float, float, float]:
    """Masses acting on a bearing along the stroke, and across it at pin and guide [kg]."""
    piston, rod = scene.piston.mass, scene.rod.mass
    if joint_rungs(scene, throw)[CRANKPIN] < JOINT_COMPLIANT:
        at_pin = rod * scene.rod.centre_of_mass / scene.rod.length
        return piston + rod, at_pin, piston + rod - at_pin
    about_wrist = scene.rod.inertia + rod * scene.rod.centre_of_mass**2
    swung = scene.rod.inertia / about_wrist if about_wrist > 0 else 1.0
    return 0.0, 0.0, piston + rod * swung


def bearing_shapes(scene: PumpScene) -> NDArray[np.float64]:
    """Shapes of the casing's modes at the main bearing, averaged over the throws.

    Returns
    -------
    ndarray of shape (n_modes, 2)
        Mass-normalised, along the stroke and across it [kg^-0.5].
    """
    throws, modes = range(1, len(scene.throws) + 1), scene.casing.modes
    shapes = [
        casing_inputs(mode.shape, place, k) for mode in modes for place in _BEARING for k in throws
    ]
    return np.asarray(np.reshape(shapes, (len(modes), 2, len(throws))).mean(axis=-1))


def bearing_mass_ratios(scene: PumpScene) -> dict[str, float]:
    """Apparent mass of the casing at its main bearing above all its modes, over one throw's masses.

    A force shorter than the period of any mode moves it as ``1 / sum(shape^2)``.

    Returns
    -------
    dict of str to float
        Direction -> ratio, for those in which the casing moves there.
    """
    if not scene.casing.modes:
        return {}
    moving = scene.piston.mass + scene.rod.mass
    given_way = np.sum(bearing_shapes(scene) ** 2, axis=0)
    return {way: 1 / (float(g) * moving) for way, g in zip(WAYS, given_way, strict=True) if g > 0}


WAYS = ("along the stroke", "across it")
_BEARING = ("bearing_x", "bearing_y")
