"""From a scene to a recording: only the physics that the scene needs."""

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from .casing import Modes, band_limited_acceleration, decimate, edge_samples
from .integrate import SimulationError, Solution, Status
from .ladder import Rung, crankpin_rung
from .parts import Scene, SceneError
from .pump_parts import FORCE_PLACES, PumpScene
from .sensor import Channel, digitise, tacho_pulses
from .slider_crank import (
    LARGEST_STEP_PER_CONTACT_TIME,
    STATE,
    STEP_PER_CONTACT_DECAY,
    STEP_PER_CONTACT_TIME,
    CrankRun,
    contact_frequency,
    contact_rate,
    pin_offset,
)

_FEWEST_STEPS = 2  # per sample: the casing runs once a step, and needs twice the sample rate

_MOST_STEPS = 1000
"""Steps per sample: beyond it a step says more about a slip than about accuracy."""

_MEMORY = 4e9  # byte, what one run may take: a data set runs one on every core
_BYTES_PER_STEP = 3 * 10 * 8  # states and forces as doubles, and two passes over them

_CASING_SIGN = np.array([-1.0, -1.0, -1.0, 1.0])
"""Reactions on the casing from the forces on rod and piston: bearing x, y, guide; the pressure on
the piston is its own counterpart on the cylinder head."""


def channels_of(scene: Scene) -> tuple[Channel, ...]:
    """Channels of a recording of this scene, accelerometers first, then the tacho.

    Examples
    --------
    >>> from wearstate.sim.scene import load_scene
    >>> [channel.name for channel in channels_of(load_scene("bilge-pump"))]
    ['acc_x', 'acc_y', 'tacho']
    """
    sensors = tuple(
        Channel(
            name=sensor.name,
            unit="m/s^2",
            quantity="acceleration",
            place=sensor.place,
            direction=sensor.direction,
        )
        for sensor in scene.sensors
    )
    if scene.tacho is None:
        return sensors
    return (*sensors, Channel(name=scene.tacho.name, unit="V", quantity="tacho"))


def simulate(
    scene: Scene, *, seed: int, truth: bool = False, raise_on_failure: bool = True
) -> Solution:
    """Simulate one recording of a scene.

    Parameters
    ----------
    scene : Scene
        A validated scene, see :func:`wearstate.sim.scene.load_scene`.
    seed : int
        Seed of the sensor noise; the mechanics are deterministic.
    truth : bool
        Also return forces and orbit at the sample instants.
    raise_on_failure : bool
        False: a failed run comes back with its status and a signal of zeros.

    Returns
    -------
    Solution
        Signal, channels, status, numerics, and truth where asked for.

    Raises
    ------
    SceneError
        A rung is not valid for the scene, the step is too long for the contact, the recording is
        shorter than a revolution, or pulses or modes cannot be sampled.
    SimulationError
        The run failed and `raise_on_failure` is true.

    Examples
    --------
    >>> from wearstate.sim.scene import load_scene
    >>> scene = load_scene("bilge-pump", {"duration": "0.2 s"})
    >>> simulate(scene, seed=1).signal.shape
    (3, 5120)
    """
    return _SIMULATORS[scene.machine](scene, seed, truth, raise_on_failure)


def check(scene: Scene) -> None:
    """Check what only the physics can tell: rungs, step, sampling.

    Raises
    ------
    SceneError
        Every fault at once.

    Examples
    --------
    >>> from wearstate.sim.scene import load_scene
    >>> check(load_scene("bilge-pump"))
    """
    _CHECKS[scene.machine](scene)


def _check_pump(scene: Scene) -> None:
    steps_per_sample(cast(PumpScene, scene))


def _simulate_pump(scene: Scene, seed: int, truth: bool, raise_on_failure: bool) -> Solution:
    pump = cast(PumpScene, scene)
    factor = steps_per_sample(pump)
    rung = crankpin_rung(pump.joint.crankpin.rung)
    step = 1 / (pump.sample_rate * factor)
    plan = _Plan(pump, factor)
    run = rung.run(pump, step, plan.n_steps, plan.first_angle)
    numerics = _numerics(pump, rung, run)
    if not run.status.ok:
        if raise_on_failure:
            raise SimulationError(run.status, pump.name)
        silence = np.zeros((len(channels_of(pump)), plan.n_samples), dtype=np.float32)
        return _solution(pump, silence, run.status, numerics, {})
    on_casing = run.forces * _CASING_SIGN
    acceleration = band_limited_acceleration(on_casing, 1 / step, factor, _modes(pump))
    signal, clipped = _measured(pump, acceleration[:, plan.kept], plan, seed)
    numerics["clipped_samples"] = clipped
    hidden = _truth(run, plan) if truth else {}
    return _solution(pump, signal, run.status, numerics, hidden)


class _Plan:
    """Which steps are run, and which samples are kept."""

    def __init__(self, scene: PumpScene, factor: int) -> None:
        rate, speed = scene.sample_rate, scene.drive.speed
        edge = edge_samples(factor)
        settling = math.ceil(scene.settling_revolutions / speed * rate) + edge
        self.scene = scene
        self.factor = factor
        self.n_samples = round(scene.duration * rate)
        self.n_steps = (settling + self.n_samples + edge) * factor
        self.kept = slice(settling, settling + self.n_samples)
        # a sample stands for the middle of its first step, see decimate
        before = (settling * factor + 0.5) / (rate * factor)
        self.first_angle = scene.drive.start_angle - 2 * math.pi * speed * before
        self.angle = scene.drive.start_angle + 2 * math.pi * speed * (
            np.arange(self.n_samples) / rate
        )


def steps_per_sample(scene: PumpScene) -> int:
    """Integration steps per sample: what the contact needs, or what the scene asks for.

    Raises
    ------
    SceneError
        All of: an invalid rung, a step too long for the contact, a recording shorter than a
        revolution or two samples, a pulse shorter than two samples. Or: a step of less than a
        thousandth of a sample, a run that needs more than 4 GB.
    """
    compliant = scene.joint.crankpin.rung != "ideal"
    faults = [fault for fault in (_rung_fault(scene), *_sampling_faults(scene)) if fault]
    step = 0.5 / scene.sample_rate
    if compliant:
        longest = LARGEST_STEP_PER_CONTACT_TIME / contact_rate(scene)
        needed = min(
            STEP_PER_CONTACT_TIME / contact_frequency(scene),
            STEP_PER_CONTACT_DECAY / contact_rate(scene),
        )
        step = min(scene.numerics.step or needed, step)
        if (scene.numerics.step or 0.0) > longest:
            faults.append(
                f"numerics.step = {scene.numerics.step:g} s must be <= {longest:.3g} s, the "
                f"contact's rate being {1 / longest:.4g} 1/s; shorten it, or lower "
                "joint.crankpin.stiffness and damping"
            )
    if faults:
        raise SceneError(scene.name, faults)
    wanted = 1 / (scene.sample_rate * step)
    faults = [fault for fault in (_step_fault(scene, wanted), _size_fault(scene, wanted)) if fault]
    if faults:
        raise SceneError(scene.name, faults)
    return max(_FEWEST_STEPS, math.ceil(wanted - 1e-9))


def _step_fault(scene: PumpScene, steps: float) -> str | None:
    if steps - 1e-9 <= _MOST_STEPS:  # the bound itself, whatever its rounding
        return None
    shortest = 1 / (scene.sample_rate * _MOST_STEPS)
    if scene.numerics.step is not None:
        return (
            f"numerics.step = {scene.numerics.step:g} s must be >= {shortest:.3g} s, "
            f"{_MOST_STEPS} steps a sample; lengthen it, or raise sample_rate"
        )
    return (
        f"the contact needs steps of {shortest * _MOST_STEPS / steps:.3g} s, must be >= "
        f"{shortest:.3g} s, {_MOST_STEPS} steps a sample; raise sample_rate, or lower "
        "joint.crankpin.stiffness and damping"
    )


def _size_fault(scene: PumpScene, steps: float) -> str | None:
    """Refuse what would not fit the memory, before any of it is taken."""
    time = scene.duration + scene.settling_revolutions / scene.drive.speed
    needed = time * scene.sample_rate * max(steps, _FEWEST_STEPS) * _BYTES_PER_STEP
    if needed <= _MEMORY:
        return None
    return (
        f"duration = {scene.duration:g} s at sample_rate = {scene.sample_rate:g} Hz with "
        f"{max(steps, _FEWEST_STEPS):.0f} steps a sample needs {needed / 1e9:.3g} GB, must be <= "
        f"{_MEMORY / 1e9:g} GB; shorten duration or settling_revolutions, lower sample_rate, or "
        "lengthen numerics.step"
    )


def _rung_fault(scene: PumpScene) -> str | None:
    return crankpin_rung(scene.joint.crankpin.rung).fault(scene)


def _sampling_faults(scene: PumpScene) -> list[str]:
    revolution = 1 / scene.drive.speed
    faults = []
    if scene.duration < revolution:
        faults.append(
            f"duration = {scene.duration:g} s must be >= one revolution = {revolution:g} s; "
            "record longer"
        )
    if scene.duration * scene.sample_rate < 2:
        faults.append(
            f"duration = {scene.duration:g} s must be >= 2 samples = {2 / scene.sample_rate:g} s; "
            "raise sample_rate or record longer"
        )
    if scene.tacho and scene.tacho.pulse_width / (2 * math.pi) * revolution < 2 / scene.sample_rate:
        faults.append(
            f"tacho.pulse_width = {scene.tacho.pulse_width:g} rad must last >= 2 samples; "
            "widen the pulse or raise sample_rate"
        )
    return faults


def _modes(scene: PumpScene) -> Modes:
    modes = scene.casing.modes
    return Modes(
        frequency=np.array([mode.frequency for mode in modes]),
        damping_ratio=np.array([mode.damping_ratio for mode in modes]),
        inputs=np.array([[mode.shape.get(p, 0.0) for p in FORCE_PLACES] for mode in modes]),
        outputs=np.array([[mode.shape[s.name] for s in scene.sensors] for mode in modes]),
    )


def _measured(
    scene: PumpScene, acceleration: NDArray[np.float64], plan: _Plan, seed: int
) -> tuple[NDArray[np.float32], int]:
    """Signal of every channel, and how many samples were clipped."""
    rng = np.random.default_rng(seed)
    rows, clipped = [], 0
    for sensor, row in zip(scene.sensors, acceleration, strict=True):
        channel, lost = digitise(
            row,
            gain=sensor.gain,
            noise=sensor.noise,
            full_scale=sensor.range,
            bits=sensor.bits,
            rng=rng,
        )
        rows.append(channel)
        clipped += lost
    if scene.tacho:
        turn = 2 * math.pi
        width = scene.tacho.pulse_width / turn
        rows.append(tacho_pulses(plan.angle / turn, pulse_width=width, level=scene.tacho.level))
    return np.stack(rows), clipped


def _numerics(scene: PumpScene, rung: Rung, run: CrankRun) -> dict[str, float | int | str]:
    return {
        "rung_joint": rung.name,
        "rung_pressure": scene.pressure.rung,
        "step_s": run.step,
        "steps": len(run.forces),
        "step_per_contact_time": run.step * contact_rate(scene),
        "contact_changes": run.contact_changes,
        "cuts_refused": run.cuts_refused,
        "peak_normal_force_n": run.peak_normal_force,
    }


def _truth(run: CrankRun, plan: _Plan) -> dict[str, Any]:
    """Forces, low-passed as the signal is, and state at the sample instants.

    A sample stands for the middle of a step: its state is the mean of the step's two ends.
    """
    states = (0.5 * (run.states[:-1] + run.states[1:]))[:: plan.factor][plan.kept]
    force = decimate(run.forces, plan.factor)[plan.kept]
    offset = pin_offset(plan.scene, states)
    return {
        "pin_force_n": force[:, :2],
        "guide_force_n": force[:, 2],
        "piston_pressure_force_n": force[:, 3],
        "pin_offset_m": offset,
        **{f"state_{name}": states[:, column] for column, name in enumerate(STATE)},
    }


def _solution(
    scene: PumpScene,
    signal: NDArray[np.float32],
    status: Status,
    numerics: dict[str, float | int | str],
    truth: dict[str, NDArray[np.float64]],
) -> Solution:
    return Solution(
        signal=signal,
        sample_rate=scene.sample_rate,
        channels=channels_of(scene),
        truth=truth,
        status=status,
        numerics=numerics,
    )


_SIMULATORS: dict[str, Callable[[Scene, int, bool, bool], Solution]] = {
    "reciprocating-pump": _simulate_pump,
}
"""A new machine is one row."""

_CHECKS: dict[str, Callable[[Scene], None]] = {"reciprocating-pump": _check_pump}
