"""Run of a pump's mechanism: step by step, or in closed form if that is exact."""

import math

import numpy as np
from numpy.typing import NDArray

from ..contact.closed_forms import IdealCrank
from ..mechanism.crank_run import CrankRun, run_mechanism
from ..mechanism.layout import BOW, JOINT_IDEAL, STRETCH
from ..pump_setup.films import start_films
from ..pump_setup.ideal_motion import forces_on_piston, ideal_motion
from ..pump_setup.joints import gravity_along_and_across, has_main_play, joint_rungs
from ..pump_setup.rods import rod_table
from ..pump_setup.tables import lines_of, tables_and_start
from ..pump_setup.yielding import yielding_of
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import CHAMBER_RUNGS


def needs_integration(scene: PumpScene) -> bool:
    """Whether a run needs steps: not with ideal joints, pressure by angle and no other dynamics."""
    ideal = all(
        rung == JOINT_IDEAL
        for throw in range(len(scene.throws))
        for rung in joint_rungs(scene, throw)
    )
    chambered = any(scene.pressures(k).rung in CHAMBER_RUNGS for k in range(len(scene.throws)))
    answered = scene.drive.rung != "constant-speed" or scene.casing.rung == "yielding"
    moving = has_main_play(scene) or scene.rod.rung == "elastic"
    return not ideal or chambered or answered or moving


def run_scene(
    scene: PumpScene, *, step: float, n_steps: int, start_angle: float, keep_states: bool = False
) -> CrankRun:
    """Run the mechanism of a scene, in closed form if that is exact, else step by step.

    Parameters
    ----------
    scene : PumpScene
    step : float
        Step [s], at most ``LARGEST_STEP_PER_CONTACT_TIME`` over :func:`contact_rate`.
    n_steps : int
        Number of steps to take.
    start_angle : float
        Crank angle at the start [rad].
    keep_states : bool
        Keep bodies and chambers at the ends of all steps.

    Returns
    -------
    CrankRun
        Truncated at the step that failed if the status is not OK.
    """
    if not needs_integration(scene):
        return _run_ideal(scene, step=step, n_steps=n_steps, start_angle=start_angle)
    t, start = tables_and_start(scene, step, start_angle)
    return run_mechanism(
        t,
        angle=start.angle,
        speed=start.speed,
        bodies=start.bodies,
        chambers=start.chambers,
        films=start_films(t, start.bodies, start_angle, start.journal),
        journal=start.journal,
        lines=lines_of(scene, step),
        casing=yielding_of(scene, step),
        step=step,
        n_steps=n_steps,
        keep_states=keep_states,
    )


def _run_ideal(scene: PumpScene, *, step: float, n_steps: int, start_angle: float) -> CrankRun:
    """The closed form as a run, with forces at the middle of each step."""
    speed = 2 * math.pi * scene.drive.speed
    angle = start_angle + speed * step * np.arange(n_steps + 1.0)
    middle = 0.5 * (angle[:-1] + angle[1:])
    bodies, columns, moment, peak = [], [], np.zeros(n_steps), 0.0
    for throw in range(len(scene.throws)):
        motion = ideal_motion(scene, middle, throw)
        pull = scene.piston.mass * (motion.piston_acceleration + gravity_along_and_across(scene)[0])
        own = middle + scene.throws[throw].phase
        nothing, (_, seal) = np.zeros(n_steps), forces_on_piston(scene, motion, own, throw)
        columns += [
            motion.pin_force_x,
            motion.pin_force_y,
            -motion.wrist_force_x,
            -motion.wrist_force_y,
            nothing,
            motion.guide_force,
            pull - motion.wrist_force_x - seal,
            seal,
            nothing,
            nothing,
        ]
        moment += motion.crank_moment
        peak = max(peak, float(np.hypot(motion.pin_force_x, motion.pin_force_y).max()))
        bodies.append(_ideal_bodies(scene, ideal_motion(scene, angle, throw)))
    weight_x, weight_y = gravity_along_and_across(scene)
    first = middle + scene.throws[0].phase
    moment -= scene.crank.unbalance * (weight_x * np.sin(first) - weight_y * np.cos(first))
    return CrankRun(
        steps=n_steps,
        turns=np.column_stack([angle, np.full(n_steps + 1, speed)]),
        forces=np.column_stack([moment, *columns]),
        bodies=np.stack(bodies, axis=1),
        chambers=None,
        step=step,
        peak_normal_force=peak,
    )


def _ideal_bodies(scene: PumpScene, motion: IdealCrank) -> NDArray[np.float64]:
    centre = scene.rod.centre_of_mass
    sin_b, cos_b = np.sin(motion.beta), np.cos(motion.beta)
    nothing = np.zeros_like(motion.beta)
    return np.column_stack(
        [
            motion.piston - centre * cos_b,
            centre * sin_b,
            motion.beta,
            motion.piston,
            nothing,
            nothing,
            motion.piston_velocity + centre * sin_b * motion.beta_rate,
            centre * cos_b * motion.beta_rate,
            motion.beta_rate,
            motion.piston_velocity,
            nothing,
            nothing,
        ]
    )


def pin_offsets(
    scene: PumpScene,
    angle: NDArray[np.float64],
    bodies: NDArray[np.float64],
    throw: int = 0,
    *,
    journal: NDArray[np.float64] | None = None,
    flex: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Position of the pins' centres relative to those of their eyes [m].

    Parameters
    ----------
    scene : PumpScene
    angle : numpy.ndarray [shape=(n,)]
        Crank angle [rad].
    bodies : numpy.ndarray [shape=(n, 12)]
        State of the throw: columns as ``BODY``, then their rates.
    throw : int
        Throw, counted from 0.
    journal : numpy.ndarray [shape=(n, 4)], optional
        Journal of a crank with play in its main bearings, as in :class:`.CrankRun`.
    flex : numpy.ndarray [shape=(n, 4)], optional
        Modes of the throw's elastic rod, as in :class:`.CrankRun`.

    Returns
    -------
    numpy.ndarray [shape=(n, 4)]
        Crank pin x (along the stroke) and y (across it), wrist pin x and y. In contact the distance
        exceeds the radial clearance by the penetration.
    """
    x, y, beta, piston, across = bodies[:, :5].T
    angle = angle + scene.throws[throw].phase
    centre = scene.rod.centre_of_mass
    arm = scene.rod.length - centre
    sin_b, cos_b = np.sin(beta), np.cos(beta)
    crank_x, crank_y = (0.0, 0.0) if journal is None else journal[:, :2].T
    offsets = np.column_stack(
        [
            crank_x + scene.crank.radius * np.cos(angle) - x + arm * cos_b,
            crank_y + scene.crank.radius * np.sin(angle) - y - arm * sin_b,
            piston - x - centre * cos_b,
            across - y + centre * sin_b,
        ]
    )
    return offsets if flex is None else offsets - _eyes_moved(scene, flex, sin_b, cos_b)


def _eyes_moved(
    scene: PumpScene,
    flex: NDArray[np.float64],
    sin_b: NDArray[np.float64],
    cos_b: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Displacement of the eyes by the rod's modes, columns as in :func:`pin_offsets` [m]."""
    modes, centre = rod_table(scene)[0], scene.rod.centre_of_mass / scene.rod.length
    stretch, bow = flex[:, STRETCH], flex[:, BOW]
    moved = []
    for reach, shape in ((1 - centre, modes["crank_shape"]), (-centre, modes["wrist_shape"])):
        along, across = reach * stretch, shape * bow
        moved += [across * sin_b - along * cos_b, across * cos_b + along * sin_b]
    return np.column_stack(moved)
