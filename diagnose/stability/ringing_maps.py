"""Maps of free vibration in a pump: step by pipe length, step by masses on a yielding casing.

Both are excited once and vibrate freely; the frequency is compared with the closed form.
"""

import math
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ...sim.mechanism.crank_run import run_mechanism
from ...sim.piping.pipe import FEWEST_REACHES, drive_pipe, pipe_parameters, pipe_start
from ...sim.pump.run_plan import steps_per_sample
from ...sim.pump_setup.tables import tables_and_start
from ...sim.pump_setup.yielding import WAYS, bearing_mass_ratios, yielding_of
from ...sim.scene.pump import PumpScene
from ...sim.scene.pump_hydraulics import PIPED_RUNGS, Line, Liquid
from ...sim.scene.pump_joints import PumpJoints
from ...sim.scene.scene import Scene
from .method_map import Cell, Curve, Judge, MapPlan, Own, Verdict, ratio_axis, within
from .own_point import changed

Array = NDArray[np.float64]

# --- pump: length of a pipe by step


def step_line(scene: Scene, size: int | None = None) -> MapPlan | str:
    """First pulsation frequency of the discharge pipe: step by length, both rungs of pipes.

    Parameters
    ----------
    scene : Scene
        A pump.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    pump = cast(PumpScene, scene)
    line = pump.pressure.discharge_line
    if pump.pressure.rung not in PIPED_RUNGS or line is None or not line.wave_speed:
        return "the pressure has no pipes; set pressure.rung = 'wave-lines' and the wave speeds"
    if line.length == 0:
        return "the discharge line has no length; set pressure.discharge_line.length"
    n, speed = size or 13, line.wave_speed
    step = 1 / (pump.sample_rate * steps_per_sample(pump))
    guard = line.length / (FEWEST_REACHES * speed)
    length = line.length
    x = ratio_axis("step", "s", guard / 10, guard * 10, n, own=step)
    y = ratio_axis("length of the discharge line", "m", length / 10, length * 10, n, own=length)
    crossed = Curve(
        name=f"guard: {FEWEST_REACHES} steps of travel",
        x=tuple(each / (FEWEST_REACHES * speed) for each in y.values),
        y=y.values,
    )
    return MapPlan(
        name="step-line",
        title="first frequency of the discharge line closed at the pump, step by length",
        x=x,
        y=y,
        judges={rung: _line_pulsation(line, rung, scene.accuracy) for rung in PIPED_RUNGS},
        curves={"wave-lines": [crossed]},
        note=f"against wave speed over four lengths, within {scene.accuracy:.2g}",
        own=Own(method=pump.pressure.rung, x=step, y=line.length),
    )


_RUNG_PERIODS = 12
_LEAST_PER_PERIOD = 3.0  # steps, for a frequency
_RINGING_AT = 1e7  # Pa, far above the vapour pressure


def _line_pulsation(line: Line, rung: str, accuracy: float) -> Judge:
    def judge(step: float, length: float) -> Cell:
        bare = {"friction_factor": 0.0, "minor_loss": 0.0, "damper": None, "relief": None}
        smooth = line.model_copy(update={"length": length, **bare})
        assert smooth.wave_speed is not None
        exact = smooth.wave_speed / (4 * length)
        if step * exact * _LEAST_PER_PERIOD > 1:
            return Verdict.INACCURATE, "fewer than three steps per period: a rigid column"
        found = _ringing(smooth, step, math.ceil(_RUNG_PERIODS / (exact * step)), rung)
        return within(abs(found / exact - 1), accuracy, "frequency")  # NaN if it has ended

    return judge


def _ringing(line: Line, step: float, n_steps: int, rung: str) -> float:
    """Frequency of a pipe after its flow is stopped [Hz]; NaN without oscillation."""
    pipes = pipe_parameters(
        line, Liquid(), far=_RINGING_AT, relief_back=0.0, step=step, waves=rung == "wave-lines"
    )
    states, nodes = pipe_start(pipes[0], 1e-3 * line.diameter**2)  # about 1 mm/s
    pressure, entering = np.zeros(n_steps), np.zeros(n_steps)
    drive_pipe(pipes, states, nodes, np.zeros(n_steps), step, pressure, entering)
    return _frequency(pressure - _RINGING_AT, step)


def _frequency(rest: Array, step: float) -> float:
    """Frequency from upward zero crossings [Hz]; NaN if there are fewer than three."""
    up = np.flatnonzero((rest[:-1] < 0) & (rest[1:] >= 0))
    if len(up) < 3:
        return math.nan
    times = up - rest[up] / (rest[up + 1] - rest[up])
    return (len(times) - 1) / float((times[-1] - times[0]) * step)


# --- pump: a casing that yields


def step_casing(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Free vibration of a rigid mechanism on its casing: step by their masses.

    Parameters
    ----------
    scene : Scene
        A pump.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    pump = cast(PumpScene, scene)
    if pump.casing.rung != "yielding":
        return "the casing does not yield; set casing.rung = 'yielding'"
    own = bearing_mass_ratios(pump).get(WAYS[0])
    if own is None:
        return "the casing does not move along the stroke; give casing.modes a shape at bearing_x"
    mode = max(each.frequency for each in pump.casing.modes)
    n, rate = size or 13, math.tau * mode
    step = 1 / (pump.sample_rate * steps_per_sample(pump))
    x = ratio_axis("step", "s", 0.05 / rate, 20 / rate, n, own=step)
    y = ratio_axis("casing at bearing over moving mass", "", own / 30, own * 30, n, own=own)
    return MapPlan(
        name="step-casing",
        title=f"free vibration of a {mode:.4g} Hz casing with its mechanism, step by masses",
        x=x,
        y=y,
        judges={_YIELDING: _casing_judge(pump, mode)},
        curves={},
        note="frequency against that of both masses on the casing's spring, within "
        f"{scene.accuracy:.2g}; piston and rod without clearance, crank at rest",
        own=Own(method=_YIELDING, x=step, y=own),
    )


_YIELDING = "mechanism in the frame of its bearing"
_GROWN = 1.5  # last over first amplitude without damping, from which it grows


def _moving(scene: PumpScene) -> float:
    return scene.piston.mass + scene.rod.mass


def _casing_judge(scene: PumpScene, mode: float) -> Judge:
    def judge(step: float, ratio: float) -> Cell:
        exact = mode / math.sqrt(1 + 1 / ratio)
        if step * mode * _LEAST_PER_PERIOD > 1:
            return Verdict.INACCURATE, "fewer than three steps per period of the casing"
        force = _casing_ring(scene, mode, ratio, step, math.ceil(_RUNG_PERIODS / (exact * step)))
        quarter = len(force) // 4
        first, last = np.ptp(force[:quarter]), np.ptp(force[-quarter:])
        if not last < _GROWN * first:  # also for NaN
            return Verdict.UNSTABLE, "grows"
        off = abs(_frequency(force - force.mean(), step) / exact - 1)  # NaN with too few periods
        return within(off, scene.accuracy, "frequency")

    return judge


def _casing_ring(scene: PumpScene, mode: float, ratio: float, step: float, least: int) -> Array:
    """Force of a rigid crank pin at rest at its dead centre, after a sudden load [N]."""
    shape = {"bearing_x": 1 / math.sqrt(ratio * _moving(scene))}
    alone = scene.casing.modes[0].model_copy(
        update={"frequency": mode, "damping_ratio": 0.0, "shape": shape}
    )
    rigid = changed(
        scene,
        {
            "joint": PumpJoints(crankpin=scene.joint.crankpin.model_copy(update={"rung": "ideal"})),
            "pressure.rung": "constant",
            "drive.rung": "constant-speed",
            "casing": scene.casing.model_copy(update={"modes": (alone,), "feet": None}),
            "throws": scene.throws[:1],
        },
    )
    t, start = tables_and_start(rigid, step, 0.0)
    bodies = start.bodies.copy()
    bodies[:, 6:] = 0.0
    with np.errstate(all="ignore"):  # an unstable run overflows, which is the result
        run = run_mechanism(
            t,
            angle=0.0,
            speed=0.0,
            bodies=bodies,
            casing=yielding_of(rigid, step),
            step=step,
            n_steps=max(least, _LEAST_WATCHED),
            keep_states=False,
        )
    return run.force("pin_x")[_BEGUN:] if run.status.ok else np.full(_LEAST_WATCHED, np.nan)


_LEAST_WATCHED = 200  # steps
_BEGUN = 8  # initial steps, the first without a history to extrapolate
