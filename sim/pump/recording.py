"""Simulation of a reciprocating pump, from its scene to its recording."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..excitation.forces import Push
from ..hydraulics.chamber import GATHERED
from ..mechanism.crank_run import CrankRun, CrankTally
from ..mechanism.layout import GUIDE
from ..output.recording import Recording
from ..output.sensor import (
    anti_alias_poles,
    digitise,
    floors_of,
    low_pass,
    mounting_poles,
)
from ..output.status import SimulationError, Status
from ..parts.sensors import Accelerometer
from ..scene.pump import PumpScene
from ..scene.recorded import failed, recorded
from ..scene.scene import Scene
from .findings import (
    exciter_truth,
    film_warnings,
    largest_lift_left,
    motor_warnings,
    oiled_pins,
    run_numerics,
    run_status,
    run_truth,
    run_warnings,
)
from .gathering import Gathering, driven_casing, measured_casing, sensor_response
from .pressure_sensors import pressures_at_rest, read_pressures
from .push import pushed_places, read_cells
from .run_plan import LimitError, RunPlan, planned, refuse, rest_faults, steps_per_sample
from .scene_run import run_scene
from .validity import FEWEST_STEPS

_CHUNK = 9216  # steps processed together: they fit the processor's cache


def check_pump(scene: Scene) -> None:
    """Check rungs, step, sampling and files, which need the physics.

    Raises
    ------
    SceneError
        All faults together.
    """
    pump = cast(PumpScene, scene)
    if pump.running:
        steps_per_sample(pump)
    else:
        refuse(pump, rest_faults(pump))
    measured_casing(pump)


def simulate_pump(
    scene: Scene, seed: int, truth: bool, raise_on_failure: bool, *, gathered_truth: bool = False
) -> Recording:
    """Simulate one recording; see :func:`wearstate.sim.machine.simulate.simulate`.

    Without its truth, the part named in :data:`GATHERED_TRUTH` costs almost nothing.
    """
    pump = cast(PumpScene, scene)
    if not pump.running:
        return _at_rest(pump, seed, truth)
    try:
        plan = planned(pump)
    except LimitError as error:
        if raise_on_failure:
            raise
        return refused_run(pump, error)
    run = run_scene(
        pump,
        step=plan.step,
        n_steps=plan.n_steps,
        start_angle=plan.first_angle,
        keep_states=truth,
    )
    gathered = Gathering(plan, seed, None, truth=gathered_truth)
    for first in range(0, run.steps, _CHUNK):
        steps = slice(first, first + _CHUNK)
        ends = slice(first, first + _CHUNK + 1)
        gathered.add(
            run.turns[ends],
            run.forces[steps].T,
            None if run.chambers is None else run.chambers[ends][:, :, list(GATHERED)],
            _film_gaps(pump, run, ends),
        )
    whole = run if truth else None
    return recording_of(gathered, run, truth=whole, raise_on_failure=raise_on_failure)


def _film_gaps(scene: PumpScene, run: CrankRun, ends: slice) -> NDArray[np.float64] | None:
    """Gap and asperity force of all films of a run [shape=(n, n_films, 2)]; None without films."""
    films = []
    if run.gaps is not None:
        gaps, oiled = run.gaps[ends], oiled_pins(scene)
        films.append(np.stack([gaps[:, :, :GUIDE][:, oiled], gaps[:, :, GUIDE:][:, oiled]], axis=2))
    if run.bore_gaps is not None:
        films.append(run.bore_gaps[ends][:, None])
    return np.concatenate(films, axis=1) if films else None


def refused_run(scene: PumpScene, error: "LimitError") -> Recording:
    """Recording of a scene beyond the limits of its methods: status, and a signal of zeros."""
    return failed(scene, error.status, {})


def recording_of(
    gathered: "Gathering",
    run: CrankTally,
    *,
    truth: CrankRun | None = None,
    raise_on_failure: bool = False,
) -> Recording:
    """Recording of a run of the mechanism whose steps were all gathered.

    Parameters
    ----------
    gathered : Gathering
    run : CrankTally
    truth : CrankRun, optional
        The run with its states, if the truth is requested.
    raise_on_failure : bool

    Raises
    ------
    SimulationError
        The run failed and `raise_on_failure` is true.
    """
    plan, pushes, seed = gathered.plan, gathered.pushes, gathered.seed
    pump = plan.scene
    lift = largest_lift_left(gathered)
    status = run_status(gathered, lift) if run.status.ok else run.status
    numerics = run_numerics(gathered, run, lift)
    if not status.ok:
        if raise_on_failure:
            raise SimulationError(status, pump.name)
        return failed(pump, status, numerics)
    acceleration, casing_numerics = sensor_response(gathered.casing)
    pressures = gathered.pressures()
    signal, clipped = _measured(acceleration, gathered.turned(), plan, pushes, seed, pressures)
    numerics |= casing_numerics
    numerics["clipped_samples"] = clipped
    return recorded(
        pump,
        signal,
        truth=run_truth(truth, plan) | exciter_truth(plan, pushes) if truth else gathered.truth(),
        status=status,
        numerics=numerics,
        warnings=(
            *run_warnings(numerics),
            *film_warnings(pump, numerics),
            *motor_warnings(pump, gathered.turns[:, 0, 1]),
        ),
    )


def _at_rest(pump: PumpScene, seed: int, truth: bool) -> Recording:
    """Test of the casing with the crank at rest, under the exciters' forces only."""
    refuse(pump, rest_faults(pump))
    plan = RunPlan(pump, FEWEST_STEPS)
    pushes = plan.pushes(seed)
    casing = driven_casing(plan, pushed_places(pump))
    casing.add(np.array([push.along for push in pushes]).reshape(len(pushes), plan.n_steps))
    acceleration, numerics = sensor_response(casing)
    angle = np.full(plan.n_samples, pump.drive.start_angle)
    signal, clipped = _measured(acceleration, angle, plan, pushes, seed, None)
    numerics |= {"step_s": plan.step, "steps": plan.n_steps, "mean_speed_hz": 0.0}
    numerics |= {"estimated_error": 0.0, "clipped_samples": clipped}
    return recorded(
        pump,
        signal,
        truth=exciter_truth(plan, pushes) if truth else {},
        status=Status.OK,
        numerics=numerics,
        warnings=run_warnings(numerics),
    )


def _measured(
    acceleration: NDArray[np.float64],
    angle: NDArray[np.float64],
    plan: RunPlan,
    pushes: tuple[Push, ...],
    seed: int,
    pressures: list[NDArray[np.float64]] | None,
) -> tuple[NDArray[np.float32], int]:
    """Signal of every channel, and the number of clipped samples.

    `pressures` are those at the sensors, for all samples; None with the crank at rest.
    """
    scene = plan.scene
    rng = np.random.default_rng(seed)
    rows, clipped = [], 0
    sensors, fs = scene.accelerometers, scene.sample_rate
    slopes = [sensor.noise_slope for sensor in sensors]
    floors = floors_of(sensors, plan.n_samples, fs, slopes=slopes, rng=rng)
    for sensor, row, floor in zip(sensors, acceleration, floors, strict=True):
        channel, lost = digitise(
            _front_end(sensor, row, fs)[plan.kept],
            gain=sensor.gain,
            noise=floor,
            full_scale=sensor.range,
            bits=sensor.bits,
            rng=rng,
        )
        rows.append(channel)
        clipped += lost
    cells, lost = read_cells(scene, pushes, plan.factor, plan.kept, rng)
    rows += cells
    clipped += lost
    if pressures is None:
        readings, lost = pressures_at_rest(scene, plan.n_samples, rng)
    else:
        readings, lost = read_pressures(scene, pressures, plan.kept, rng)
    rows += readings
    clipped += lost
    if scene.tacho and not scene.running:
        rows.append(np.zeros(plan.n_samples, dtype=np.float32))
    elif scene.tacho:
        rows.append(scene.tacho.channel(angle))
    return np.stack(rows), clipped


def _front_end(sensor: Accelerometer, row: NDArray[np.float64], fs: float) -> NDArray[np.float64]:
    """The whole run after mounting and anti-alias filter, which settle before the recording."""
    poles: list[NDArray[np.complex128]] = []
    if sensor.mounting_resonance is not None and sensor.mounting_damping is not None:
        poles.append(mounting_poles(sensor.mounting_resonance, sensor.mounting_damping))
    if sensor.anti_alias != "none" and sensor.anti_alias_cutoff and sensor.anti_alias_order:
        poles.append(
            anti_alias_poles(sensor.anti_alias, sensor.anti_alias_cutoff, sensor.anti_alias_order)
        )
    return low_pass(row, fs, np.concatenate(poles)) if poles else row
