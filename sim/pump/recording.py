"""A reciprocating pump, from its scene to its recording."""

import math
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..casing.casing_frf import Accelerance, load_accelerance
from ..casing.decimation import Decimation, decimate, edge_samples
from ..casing.measured_casing import MeasuredCasing
from ..casing.modes import CasingModes, ModalCasing, casing_inputs
from ..excitation.forces import Push
from ..hydraulics.chamber import GATHERED
from ..hydraulics.valves import lift_left
from ..mechanism.crank_run import CrankRun, CrankTally
from ..mechanism.layout import FORCES, GUIDE, JOINT_COMPLIANT, JOINT_LINK, JOINT_OILED
from ..output.recording import Recording
from ..output.sensor import (
    anti_alias_poles,
    coloured_noise,
    digitise,
    low_pass,
    mains_hum,
    mounting_poles,
)
from ..output.status import SimulationError, Status
from ..pump_setup.contacts import contact_rate, contact_table
from ..pump_setup.films import film_temperature_of
from ..pump_setup.joints import joint_rungs
from ..pump_setup.yielding import rubs_in_guide, throw_on_casing
from ..scene.exciters import pushing_faults
from ..scene.parts import Accelerometer, CasingMode, Scene, SceneError, specific_key
from ..scene.pump import (
    CRANK_PLACES,
    FORCE_PLACES,
    GUIDE_PLACES,
    OILED_RUNGS,
    VALVE_PLACES,
    PumpScene,
)
from ..scene.pump_hydraulics import BREATHING_RUNGS
from ..scene.recorded import failed, recorded
from ..scene.sampling import MEMORY, duration_faults, memory_faults, tacho_faults
from .pressure_sensors import cylinder_pressure, pressures_at_rest, read_pressures
from .push import casing_pushes, pushed_places, read_cells
from .scene_run import pin_offsets, run_scene
from .tearing import lowest_under_pull, torn_by_pull
from .validity import FEWEST_STEPS, MOST_STEPS, joint_faults, knock_limits, limits, pump_step

_BYTES_PER_STEP = 3 * 10 * 8  # of one throw: forces and chamber as doubles, two passes over them

_AT_ONCE = 9216  # steps that are gathered at once: they stay in the processor's cache

_LIFT_LEFT = 0.05
"""Of the stop's lift: a valve that is open by more so long after its stroke does not close."""

_STABLE = 2.785  # step times rate of Runge-Kutta 4, on the negative real axis

_ROUGHNESS = 0.4e-6  # m, of a ground pin and a bored eye together, where none is given
_MOSTLY = 0.5  # of all contacts: the floor, not the law, decides what they lose

_LATE = math.radians(60.0)  # after the dead centre; a fast pump's valves close 30 degrees late


def check_pump(scene: Scene) -> None:
    """Check what only the physics can tell: rungs, step, sampling, files.

    Raises
    ------
    SceneError
        Every fault at once.
    """
    pump = cast(PumpScene, scene)
    if pump.running:
        steps_per_sample(pump)
    else:
        _refuse(pump, _rest_faults(pump))
    measured_casing(pump)


def simulate_pump(
    scene: Scene, seed: int, truth: bool, raise_on_failure: bool, *, gathered_truth: bool = False
) -> Recording:
    """Simulate one recording; see :func:`wearstate.sim.machine.simulate.simulate`.

    Without its truth, that of :data:`GATHERED_TRUTH` may be had for next to nothing.
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
    for first in range(0, run.steps, _AT_ONCE):
        steps = slice(first, first + _AT_ONCE)
        ends = slice(first, first + _AT_ONCE + 1)
        gathered.add(
            run.turns[ends],
            run.forces[steps].T,
            None if run.chambers is None else run.chambers[ends][:, :, list(GATHERED)],
            None if run.gaps is None else _pin_gaps(pump, run.gaps[ends]),
        )
    whole = run if truth else None
    return recording_of(gathered, run, truth=whole, raise_on_failure=raise_on_failure)


def _pin_gaps(scene: PumpScene, gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of all films of a run: gap and force of peaks of the oiled pins [shape=(n, n_pins, 2)]."""
    oiled = _oiled(scene)
    return np.stack([gaps[:, :, :GUIDE][:, oiled], gaps[:, :, GUIDE:][:, oiled]], axis=2)


def _oiled(scene: PumpScene) -> NDArray[np.bool_]:
    """Which pins run in oil [shape=(n_throws, 2)]."""
    rungs = [joint_rungs(scene, throw)[:GUIDE] for throw in range(len(scene.throws))]
    return np.asarray(np.array(rungs) == JOINT_OILED)


def refused_run(scene: PumpScene, error: "LimitError") -> Recording:
    """Recording of a scene beyond the limits of its methods: its status and a signal of zeros."""
    return failed(scene, error.status, {})


def planned(scene: PumpScene) -> "RunPlan":
    """Steps and samples of a running scene.

    Raises
    ------
    SceneError, LimitError
        As :func:`steps_per_sample`.
    """
    return RunPlan(scene, steps_per_sample(scene))


def recording_of(
    gathered: "Gathering",
    run: CrankTally,
    *,
    truth: CrankRun | None = None,
    raise_on_failure: bool = False,
) -> Recording:
    """Recording of a run of the mechanism, of which all steps were gathered.

    Parameters
    ----------
    gathered : Gathering
    run : CrankTally
    truth : CrankRun, optional
        The run with its states, where the truth is asked for.
    raise_on_failure : bool

    Raises
    ------
    SimulationError
        The run failed and `raise_on_failure` is true.
    """
    plan, pushes, seed = gathered.plan, gathered.pushes, gathered.seed
    pump = plan.scene
    lift = _lift_left(gathered)
    status = _judged(gathered, lift) if run.status.ok else run.status
    numerics = _numerics(gathered, run, lift)
    if not status.ok:
        if raise_on_failure:
            raise SimulationError(status, pump.name)
        return failed(pump, status, numerics)
    acceleration, casing_numerics = _heard(gathered.casing)
    pressures = gathered.pressures()
    signal, clipped = _measured(acceleration, gathered.turned(), plan, pushes, seed, pressures)
    numerics |= casing_numerics
    numerics["clipped_samples"] = clipped
    return recorded(
        pump,
        signal,
        truth=_truth(truth, plan) | _test_truth(plan, pushes) if truth else gathered.truth(),
        status=status,
        numerics=numerics,
        warnings=(
            *_warnings(numerics),
            *_film_warnings(pump, numerics),
            *_motor_warnings(pump, gathered.turns[:, 0, 1]),
        ),
    )


def _at_rest(pump: PumpScene, seed: int, truth: bool) -> Recording:
    """A test of the casing while the crank stands: no force but those of the exciters."""
    _refuse(pump, _rest_faults(pump))
    plan = RunPlan(pump, FEWEST_STEPS)
    pushes = plan.pushes(seed)
    casing = _casing(plan, pushed_places(pump))
    casing.add(np.array([push.along for push in pushes]).reshape(len(pushes), plan.n_steps))
    acceleration, numerics = _heard(casing)
    angle = np.full(plan.n_samples, pump.drive.start_angle)
    signal, clipped = _measured(acceleration, angle, plan, pushes, seed, None)
    numerics |= {"step_s": plan.step, "steps": plan.n_steps, "mean_speed_hz": 0.0}
    numerics |= {"estimated_error": 0.0, "clipped_samples": clipped}
    return recorded(
        pump,
        signal,
        truth=_test_truth(plan, pushes) if truth else {},
        status=Status.OK,
        numerics=numerics,
        warnings=_warnings(numerics),
    )


def _rest_faults(scene: PumpScene) -> list[str]:
    needed = scene.duration * scene.sample_rate * FEWEST_STEPS * _BYTES_PER_STEP
    return [*memory_faults(scene, needed), *pushing_faults(scene, scene.exciters)]


def _refuse(scene: PumpScene, faults: list[str]) -> None:
    if faults:
        raise SceneError(scene.name, faults)


class RunPlan:
    """Which steps of a scene are run, and which samples are kept."""

    def __init__(self, scene: PumpScene, factor: int) -> None:
        rate, speed = scene.sample_rate, scene.drive.speed
        edge = edge_samples(factor)
        settling = math.ceil(scene.settling_revolutions / speed * rate) + edge
        self.scene = scene
        self.factor = factor
        self.step = 1 / (rate * factor)
        self.n_samples = round(scene.duration * rate)
        self.n_steps = (settling + self.n_samples + edge) * factor
        self.kept = slice(settling, settling + self.n_samples)
        # a sample stands for the middle of its first step, see decimate
        before = (settling * factor + 0.5) / (rate * factor)
        self.first_angle = scene.drive.start_angle - 2 * math.pi * speed * before

    def pushes(self, seed: int) -> tuple[Push, ...]:
        """Forces of the mounted exciters at all steps."""
        first, last = self.kept.start * self.factor, self.kept.stop * self.factor
        return casing_pushes(
            self.scene,
            n_steps=self.n_steps,
            first=first,
            last=last,
            factor=self.factor,
            seed=seed,
        )

    @property
    def angle(self) -> NDArray[np.float64]:
        """Crank angle at the samples [rad], at constant speed; made anew, as many plans wait."""
        scene = self.scene
        seconds = np.arange(self.n_samples) / scene.sample_rate
        return np.asarray(scene.drive.start_angle + 2 * math.pi * scene.drive.speed * seconds)

    def turned(self, made: NDArray[np.float64]) -> NDArray[np.float64]:
        """Crank angle at the samples [rad]: exact at constant speed, else as the run made it."""
        return made if self.scene.drive.rung != "constant-speed" else self.angle

    def at_samples(self, ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the samples from those at the ends of all steps, first axis time.

        A sample stands for the middle of a step: its value is the mean of the step's two ends.
        """
        first, step = self.kept.start * self.factor, self.factor
        last = first + self.n_samples * step
        return np.asarray(0.5 * (ends[first:last:step] + ends[first + 1 : last + 1 : step]))


class LimitError(SceneError):
    """A scene beyond the limits of its methods; the status says which."""

    def __init__(self, name: str, faults: list[str], status: Status) -> None:
        self.status = status
        super().__init__(name, faults)


def steps_per_sample(scene: PumpScene) -> int:
    """Integration steps per sample: what the contact needs, or what the scene asks for.

    Raises
    ------
    SceneError
        All of: an invalid rung, a recording shorter than a revolution or two samples, a pulse
        shorter than two samples. Or: a step of less than a thousandth of a sample, a run that
        needs more than 4 GB.
    LimitError
        A step too long for the contact, a contact too soft for its law or its clearance, a
        pressure below that of the vapour, in a trial of two revolutions too; with the status a
        sweep records.
    """
    faults = joint_faults(scene)
    if faults:
        raise SceneError(scene.name, [*faults, *_sampling_faults(scene)])
    faults = _sampling_faults(scene)
    beyond = limits(scene)
    step = pump_step(scene)
    if faults:
        raise SceneError(scene.name, [*faults, *(fault for _, fault in beyond)])
    if beyond:
        raise LimitError(scene.name, [fault for _, fault in beyond], beyond[0][0])
    wanted = 1 / (scene.sample_rate * step)
    faults = [fault for fault in (_step_fault(scene, wanted), _size_fault(scene, wanted)) if fault]
    if faults:
        raise SceneError(scene.name, faults)
    beyond = knock_limits(scene)
    if beyond:
        raise LimitError(scene.name, [fault for _, fault in beyond], beyond[0][0])
    return max(FEWEST_STEPS, math.ceil(wanted - 1e-9))


def _step_fault(scene: PumpScene, steps: float) -> str | None:
    if steps - 1e-9 <= MOST_STEPS:  # the bound itself, whatever its rounding
        return None
    shortest = 1 / (scene.sample_rate * MOST_STEPS)
    if scene.numerics.step is not None:
        return (
            f"numerics.step = {scene.numerics.step:g} s must be >= {shortest:.3g} s, "
            f"{MOST_STEPS} steps a sample; lengthen it, or raise sample_rate"
        )
    return (
        f"the contact needs steps of {shortest * MOST_STEPS / steps:.3g} s, must be >= "
        f"{shortest:.3g} s, {MOST_STEPS} steps a sample; raise sample_rate, lower stiffness and "
        "damping of the joints, or raise their speed_floor or restitution_speed"
    )


def _size_fault(scene: PumpScene, steps: float) -> str | None:
    """Refuse what would not fit the memory, before any of it is taken."""
    time = scene.duration + scene.settling_revolutions / scene.drive.speed
    per_step = _BYTES_PER_STEP * len(scene.throws)
    needed = time * scene.sample_rate * max(steps, FEWEST_STEPS) * per_step
    if needed <= MEMORY:
        return None
    return (
        f"duration = {scene.duration:g} s at sample_rate = {scene.sample_rate:g} Hz with "
        f"{max(steps, FEWEST_STEPS):.0f} steps a sample needs {needed / 1e9:.3g} GB, must be <= "
        f"{MEMORY / 1e9:g} GB; shorten duration or settling_revolutions, lower sample_rate, "
        "lengthen numerics.step, or raise a joint's speed_floor or restitution_speed"
    )


def _sampling_faults(scene: PumpScene) -> list[str]:
    revolution = 1 / scene.drive.speed
    faults = pushing_faults(scene, scene.exciters)
    faults += duration_faults(scene, revolution)
    if scene.duration * scene.sample_rate < 2:
        faults.append(
            f"duration = {scene.duration:g} s must be >= 2 samples = {2 / scene.sample_rate:g} s; "
            "raise sample_rate or record longer"
        )
    return faults + tacho_faults(scene, revolution)


# --- casing


class Gathering:
    """What a recording needs of a run, gathered step by step while the mechanism runs.

    So that forces of all steps need not be kept: they go through the casing at once.

    Parameters
    ----------
    plan : RunPlan
    seed : int
        Of the recording.
    columns : tuple of int or None
        Of all forces: the rows of those that will be added; None for all.
    truth : bool
        Keep what :data:`GATHERED_TRUTH` names as well.

    Attributes
    ----------
    plan, seed
        As given.
    pushes : tuple of Push
        Forces of the mounted exciters at all steps.
    casing : ModalCasing or MeasuredCasing
        Under all forces that were added.
    turns : numpy.ndarray [shape=(n, 2, 2)]
        Crank angle [rad] and speed [rad/s] where the first step of every sample begins and ends;
        n is 0 where a crank of constant speed drives what does not breathe.
    lifts : numpy.ndarray [shape=(n, n_throws, 2)]
        Of suction and discharge valve [m], where the first step of every sample begins; n is 0
        where nothing breathes.
    vapour : numpy.ndarray [shape=(n_throws,)]
        Whether a chamber ever held vapour.
    pull : numpy.ndarray [shape=(n_throws,)]
        Largest force of the liquid along x on each piston after settling [N], a mean over its step.
    mean_speed : float
        Of the crank over all steps [rad/s].
    """

    def __init__(
        self,
        plan: "RunPlan",
        seed: int,
        columns: tuple[int, ...] | None,
        *,
        truth: bool = False,
    ) -> None:
        scene = plan.scene
        n_throws = len(scene.throws)
        self.plan, self.seed = plan, seed
        self.pushes = plan.pushes(seed)
        self._sources = _sources(scene, columns)
        self._pistons = [_row_of("piston_x", throw, columns) for throw in range(n_throws)]
        self._bearings = [
            list(self._sources).index(_force_key(scene, place, 1))
            for place in ("bearing_x", "bearing_y")
        ]
        self.casing = _casing(plan, (*self._sources, *pushed_places(scene)))
        self._sensors = [
            (self._pistons[throw], Decimation(1, plan.n_steps, plan.factor))
            for throw, _ in scene.pressure_sensors
        ]
        self._known = [
            _row_of(name, throw, columns)
            for throw in range(n_throws if truth else 0)
            for name in _GATHERED_FORCES
        ]
        self._knowing = Decimation(len(self._known), plan.n_steps, plan.factor) if truth else None
        self._steps = self._samples = 0
        breathing = _breathes(scene)
        turning = breathing or scene.drive.rung != "constant-speed"
        most = -(-plan.n_steps // plan.factor)
        self._turns = np.empty((most if turning else 0, 2, 2))
        self._lifts = np.empty((most if breathing else 0, n_throws, 2))
        self.vapour = np.zeros(n_throws, dtype=bool)
        self.pull = np.full(n_throws, -math.inf)
        self._ends = [0.0, 0.0]
        self._least_gap, self._looks, self._rubs = math.inf, 0, 0

    def add(
        self,
        turns: NDArray[np.float64],
        forces: NDArray[np.float64],
        chambers: NDArray[np.float64] | None,
        gaps: NDArray[np.float64] | None = None,
    ) -> None:
        """Take the next steps.

        Parameters
        ----------
        turns : numpy.ndarray [shape=(n + 1, 2)]
            As of :class:`CrankRun`, from where the first of them begins.
        forces : numpy.ndarray [shape=(n_columns, n)]
        chambers : numpy.ndarray [shape=(n + 1, n_throws, 3)] or None
            Columns :data:`GATHERED` of ``CHAMBER_STATE``.
        gaps : numpy.ndarray [shape=(n + 1, n_pins, 2)] or None
            Of the oiled pins: least film [m], and what its touching peaks carry [N].
        """
        first, n, factor = self._steps, forces.shape[1], self.plan.factor
        if not first:
            self._ends[0] = float(turns[0, 0])
        self._ends[1] = float(turns[-1, 0])
        self._steps += n
        early = -first % factor  # steps before one that begins with a sample
        begin, self._samples = self._samples, self._samples + len(range(early, n, factor))
        found = slice(begin, self._samples)
        # column by column: numpy takes ten times as long over many rows of two
        for column in range(2 if len(self._turns) else 0):
            self._turns[found, 0, column] = turns[early:n:factor, column]
            self._turns[found, 1, column] = turns[early + 1 :: factor, column]
        if chambers is not None:
            for throw, column in np.ndindex(chambers.shape[1], 2):
                self._lifts[found, throw, column] = chambers[early:n:factor, throw, 1 + column]
            self.vapour |= (chambers[:, :, 0] > 0).any(axis=0)
        self._note_pull(forces, first)
        if gaps is not None:
            self._note_films(gaps[:-1], first)
        for row, low in self._sensors:
            low.add(cylinder_pressure(self.plan.scene, forces[row : row + 1]))
        if self._knowing is not None:
            self._knowing.add(forces[self._known])
        self.casing.fill(n, partial(self._on_casing, turns, forces, first))

    def _note_pull(self, forces: NDArray[np.float64], first: int) -> None:
        settled = max(0, self.plan.kept.start * self.plan.factor - first)
        for throw, row in enumerate(self._pistons):
            found = forces[row, settled:].max(initial=-math.inf)
            self.pull[throw] = max(self.pull[throw], found)

    def _note_films(self, gaps: NDArray[np.float64], first: int) -> None:
        """Least film, and how often peaks touch, where steps of the samples begin."""
        kept, factor = self.plan.kept, self.plan.factor
        begin = max(0, kept.start * factor - first)
        found = gaps[begin : max(begin, kept.stop * factor - first)]
        least = found[:, :, 0].min(initial=math.inf)
        self._least_gap = float(np.minimum(self._least_gap, least))  # NaN stays NaN
        self._rubs += int(np.count_nonzero((found[:, :, 1] > 0).any(axis=1)))
        self._looks += len(found)

    @property
    def films(self) -> dict[str, float]:
        """Least film of all oiled pins, and how long rough peaks touched; empty without either."""
        if not self._looks:  # or a run that failed while it settled
            return {}
        return {"min_film_m": self._least_gap, "rubbing_share": self._rubs / self._looks}

    def _on_casing(
        self,
        turns: NDArray[np.float64],
        forces: NDArray[np.float64],
        first: int,
        rows: NDArray[np.float64],
    ) -> None:
        """Write forces on the casing [shape=(n_places, n)]: the mechanism's, and exciters'."""
        n = forces.shape[1]
        for row, ((source, sign), *others) in zip(rows, self._sources.values(), strict=False):
            np.multiply(forces[source], sign, out=row)
            for other, its_sign in others:
                row += its_sign * forces[other]
        if self.plan.scene.crank.unbalance > 0:
            rows[self._bearings] += _crank_throws(self.plan, turns)
        for row, push in zip(rows[len(self._sources) :], self.pushes, strict=True):
            row[:] = push.along[first : first + n]

    @property
    def turns(self) -> NDArray[np.float64]:
        """Crank at the samples so far; see the class."""
        return self._turns[: self._samples]

    @property
    def lifts(self) -> NDArray[np.float64]:
        """Valves at the samples so far; see the class."""
        return self._lifts[: self._samples]

    @property
    def mean_speed(self) -> float:
        """Of the crank; see the class."""
        return (self._ends[1] - self._ends[0]) / (self._steps * self.plan.step)

    def turned(self) -> NDArray[np.float64]:
        """Crank angle at the samples [rad]: exact at constant speed, else as the run made it."""
        if not len(self.turns):
            return self.plan.angle
        angle = self.turns[self.plan.kept, :, 0]
        return self.plan.turned(0.5 * (angle[:, 0] + angle[:, 1]))

    def truth(self) -> dict[str, NDArray[np.float64]]:
        """Of :func:`_truth` what :data:`GATHERED_TRUTH` names; empty where it was not asked for."""
        if self._knowing is None:
            return {}
        found = {"state_alpha": self.turned()}
        forces = self._knowing.finish()[:, self.plan.kept].T
        for throw in range(len(self.plan.scene.throws)):
            suffix = f"_{throw + 1}" if throw else ""
            own = forces[:, len(_GATHERED_FORCES) * throw :]
            found[f"pin_force_n{suffix}"] = own[:, 0:2]
            found[f"guide_force_n{suffix}"] = own[:, 2]
            found[f"piston_pressure_force_n{suffix}"] = -own[:, 3]
        return found

    def pressures(self) -> list[NDArray[np.float64]]:
        """Pressure on the piston of every sensor's throw at all samples [Pa], band-limited."""
        return [low.finish()[0] for _, low in self._sensors]


_GATHERED_FORCES = ("pin_x", "pin_y", "guide_y", "piston_x")

GATHERED_TRUTH = ("state_alpha", "pin_force_n", "guide_force_n", "piston_pressure_force_n")
"""Of a run's truth: what is at hand without its states, by throw as there."""


def _row_of(force: str, throw: int, columns: tuple[int, ...] | None) -> int:
    """Row of a force of a throw among those that are kept."""
    column = 1 + len(FORCES) * throw + FORCES.index(force)
    return column if columns is None else columns.index(column)


def _sources(
    scene: PumpScene, columns: tuple[int, ...] | None
) -> dict[str, list[tuple[int, float]]]:
    """Rows of forces, with their signs, behind every place of the casing where the crank pushes.

    Reactions of bearing and guide, liquid on the cylinder head, valves on their seats. Keys are
    those of a mode shape, a place or that of one throw; throws that one key stands for add up.
    """
    found: dict[str, list[tuple[int, float]]] = {}
    for throw in range(len(scene.throws)):
        for place, name, sign in throw_on_casing(scene, throw):
            row = _row_of(name, throw, columns)
            found.setdefault(_force_key(scene, place, throw + 1), []).append((row, sign))
    return found


def _breathes(scene: PumpScene) -> bool:
    return any(scene.pressures(k).rung in BREATHING_RUNGS for k in range(len(scene.throws)))


def _crank_throws(plan: RunPlan, turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the unbalance of the crank does to its bearing (x, y), but for its steady weight."""
    scene = plan.scene
    angle = 0.5 * (turns[:-1, 0] + turns[1:, 0]) + scene.throws[0].phase
    speed = 0.5 * (turns[:-1, 1] + turns[1:, 1])
    spin_up = np.diff(turns[:, 1]) / plan.step
    sin, cos = np.sin(angle), np.cos(angle)
    along = scene.crank.unbalance * (speed**2 * cos + spin_up * sin)
    across = scene.crank.unbalance * (speed**2 * sin - spin_up * cos)
    return np.stack([along, across])


def _force_key(scene: PumpScene, place: str, throw: int) -> str:
    """Key under which the casing knows a force: that of its throw where there is one."""
    if scene.casing.frf is not None:
        return f"{place}_{throw}"
    keys = {key for mode in scene.casing.modes for key in mode.shape}
    return specific_key(keys, place, throw) or place


def _split(key: str) -> tuple[str, int]:
    """Place and throw of a key; a place for all throws is that of the first."""
    place, _, throw = key.rpartition("_")
    return (key, 1) if key in FORCE_PLACES else (place, int(throw))


def _casing(plan: RunPlan, places: tuple[str, ...]) -> ModalCasing | MeasuredCasing:
    """The casing of a scene, to be driven at these places."""
    step_rate = plan.scene.sample_rate * plan.factor
    accelerance = measured_casing(plan.scene, places)
    if accelerance is not None:
        return MeasuredCasing(accelerance, step_rate, plan.factor, plan.n_steps)
    return ModalCasing(casing_modes(plan.scene, places), step_rate, plan.factor, plan.n_steps)


def _heard(
    casing: ModalCasing | MeasuredCasing,
) -> tuple[NDArray[np.float64], dict[str, float | int | str]]:
    """Acceleration at every accelerometer, and the numerics of a measured casing."""
    if isinstance(casing, ModalCasing):
        return casing.finish(), {}
    run = casing.finish()
    return run.acceleration, {
        "frf_sha256": casing.accelerance.sha256,
        "frf_top_hz": float(casing.accelerance.frequency[-1]),
        "frf_late_share": casing.accelerance.late_share(),
        "frf_force_share_above": run.force_share_above,
    }


def measured_casing(scene: PumpScene, places: tuple[str, ...] = ()) -> Accelerance | None:
    """Accelerance from the scene's file, None where the casing is given as modes.

    Parameters
    ----------
    scene : PumpScene
    places : tuple of str
        Columns wanted; those of :func:`measured_places` by default.

    Raises
    ------
    SceneError
        The file cannot be used.
    """
    if scene.casing.frf is None:
        return None
    sensors = [sensor.name for sensor in scene.accelerometers]
    inputs = tuple(_split(key) for key in places or measured_places(scene))
    try:
        return load_accelerance(scene.casing.frf, sensors, inputs)
    except SceneError as error:
        raise SceneError(scene.name, error.faults) from None


def measured_places(scene: PumpScene) -> tuple[str, ...]:
    """Places where the mechanism pushes on a measured casing, by throw.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> measured_places(load_scene("bilge-pump"))[0]
    'bearing_x_1'
    """
    return tuple(
        f"{place}_{throw + 1}"
        for throw in range(len(scene.throws))
        for place in (
            *CRANK_PLACES,
            *(GUIDE_PLACES if rubs_in_guide(scene, throw) else ()),
            *(VALVE_PLACES if scene.pressures(throw).rung in BREATHING_RUNGS else ()),
        )
    )


def casing_modes(scene: PumpScene, places: tuple[str, ...]) -> CasingModes:
    """Modes of a scene's casing on its feet as they are, at these places and all sensors.

    Parameters
    ----------
    scene : PumpScene
        Whose casing is given as modes.
    places : tuple of str
        Keys of mode shapes: of forces, or sensors that are pushed.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> loose = {"casing.feet.bolt_stretch": 2e-4, "casing.feet.stretch_lost": 1e-4}
    >>> modes = casing_modes(load_scene("bilge-pump", loose), ("bearing_x",))
    >>> modes.inputs.shape, modes.frequency[0].round(1)
    ((8, 1), np.float64(133.5))
    """
    modes, sensors = scene.casing.modes, scene.accelerometers
    feet = scene.casing.feet
    held = [mode.on_feet(1.0 if feet is None else feet.stiffness_ratio) for mode in modes]
    return CasingModes(
        frequency=np.array([frequency for frequency, _ in held]),
        damping_ratio=np.array([ratio for _, ratio in held]),
        inputs=np.array([[_participation(mode, key) for key in places] for mode in modes]),
        outputs=np.array([[mode.shape[s.name] for s in sensors] for mode in modes]),
    )


def _participation(mode: CasingMode, key: str) -> float:
    """Shape at the key of a force, or at a sensor that is pushed."""
    return mode.shape[key] if key in mode.shape else casing_inputs(mode.shape, *_split(key))


# --- recording


def _measured(
    acceleration: NDArray[np.float64],
    angle: NDArray[np.float64],
    plan: RunPlan,
    pushes: tuple[Push, ...],
    seed: int,
    pressures: list[NDArray[np.float64]] | None,
) -> tuple[NDArray[np.float32], int]:
    """Signal of every channel, and how many samples were clipped.

    Pressures are those at the sensors of all samples; None where the crank stands.
    """
    scene = plan.scene
    rng = np.random.default_rng(seed)
    rows, clipped = [], 0
    for sensor, row in zip(scene.accelerometers, acceleration, strict=True):
        channel, lost = digitise(
            _front_end(sensor, row, scene.sample_rate)[plan.kept],
            gain=sensor.gain,
            noise=_floor(sensor, plan.n_samples, scene.sample_rate, rng),
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
        told, lost = pressures_at_rest(scene, plan.n_samples, rng)
    else:
        told, lost = read_pressures(scene, pressures, plan.kept, rng)
    rows += told
    clipped += lost
    if scene.tacho and not scene.running:
        rows.append(np.zeros(plan.n_samples, dtype=np.float32))
    elif scene.tacho:
        rows.append(scene.tacho.channel(angle))
    return np.stack(rows), clipped


def _floor(
    sensor: Accelerometer, n: int, fs: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """What the sensor shows of a machine at rest [m/s^2, shape=(n,)]."""
    noise = coloured_noise(n, fs, rms=sensor.noise, slope=sensor.noise_slope, rng=rng)
    if sensor.mains > 0:
        noise += mains_hum(n, fs, rms=sensor.mains, frequency=sensor.mains_frequency, rng=rng)
    return noise


def _front_end(sensor: Accelerometer, row: NDArray[np.float64], fs: float) -> NDArray[np.float64]:
    """Whole run through mounting and anti-alias filter: they have settled when it is recorded."""
    poles: list[NDArray[np.complex128]] = []
    if sensor.mounting_resonance is not None and sensor.mounting_damping is not None:
        poles.append(mounting_poles(sensor.mounting_resonance, sensor.mounting_damping))
    if sensor.anti_alias != "none" and sensor.anti_alias_cutoff and sensor.anti_alias_order:
        poles.append(
            anti_alias_poles(sensor.anti_alias, sensor.anti_alias_cutoff, sensor.anti_alias_order)
        )
    return low_pass(row, fs, np.concatenate(poles)) if poles else row


def _judged(gathered: Gathering, lift: float) -> Status:
    """A column that tears; a valve that never shuts in time, its spring too soft for the speed."""
    if torn_by_pull(gathered.plan.scene, gathered.pull):
        return Status.VAPOUR
    return Status.VALVE_OPEN if lift > _LIFT_LEFT else Status.OK


def _lift_left(gathered: Gathering) -> float:
    """Least lift left in the idle strokes of any free valve, over the stop's: what recurs."""
    scene, settled = gathered.plan.scene, gathered.plan.kept.start
    lifts = gathered.lifts[settled:]
    if not len(lifts):  # nothing breathes; or a run has failed before
        return 0.0
    largest = 0.0
    for throw in np.flatnonzero(~gathered.vapour).tolist():
        # vapour keeps a suction valve open until it is refilled, whatever its spring
        pressure = scene.pressures(throw)
        angle = gathered.turns[settled:, 0, 0] + scene.throws[throw].phase
        sides = (("suction", pressure.suction_valve, 0), ("discharge", pressure.discharge_valve, 1))
        for side, valve, column in sides:
            if valve is None or valve.stuck_lift is not None:
                continue
            left = lift_left(angle, lifts[:, throw, column], side, valve.max_lift, after=_LATE)
            if left.size:
                largest = max(largest, float(left.min()))
    return largest


def _rung_of(part: Any) -> str:
    return "ideal" if part is None else str(part.rung)


def _numerics(gathered: Gathering, run: CrankTally, lift: float) -> dict[str, float | int | str]:
    scene = gathered.plan.scene
    steps, resolved = run.steps, run.step * contact_rate(scene)
    numerics: dict[str, float | int | str] = {
        "rung_joint": scene.joint.crankpin.rung,
        "rung_wristpin": _rung_of(scene.joint.wristpin),
        "rung_guide": _rung_of(scene.joint.guide),
        "rung_pressure": scene.pressure.rung,
        "rung_drive": scene.drive.rung,
        "contact_law": scene.joint.crankpin.law,
        "step_s": run.step,
        "steps": steps,
        "step_per_contact_time": resolved,
        "stability_margin": 1 - resolved / _STABLE,
        # Runge-Kutta 4 turns the fastest contact too slowly by this share
        "estimated_error": resolved**4 / 120,
        "contact_changes": run.contact_changes,
        "cuts_refused": run.cuts_refused,
        "peak_normal_force_n": run.peak_normal_force,
        "mean_speed_hz": gathered.mean_speed / (2 * math.pi),
    }
    rungs = [joint_rungs(scene, throw) for throw in range(len(scene.throws))]
    if any(JOINT_COMPLIANT in row for row in rungs) and _has_floor(scene):
        closings = max(1, run.contact_changes // 2)
        numerics["floored_share"] = run.floored_closings / closings
        numerics["speed_floor_m_s"] = max(
            float(contact_table(scene, throw)["speed_floor"][:2].min())
            for throw in range(len(scene.throws))
        )
    lowest = lowest_under_pull(scene, gathered.pull)
    if math.isfinite(lowest):
        numerics["lowest_pressure_pa"] = lowest
    if any(JOINT_LINK in row for row in rungs):
        numerics["tension_share"] = run.tension_steps / max(1, steps * len(rungs))
    if gathered.films:
        numerics |= _film_numerics(gathered)
    if _breathes(scene):
        numerics["cavitating_share"] = run.vapour_steps / max(1, steps * len(rungs))
        numerics["lift_left"] = lift
    for side, parted in zip(("suction", "discharge"), run.parted_steps, strict=False):
        numerics[f"{side}_line_parted_share"] = parted / max(1, steps)
    if run.unsettled_steps:
        numerics["lines_unsettled_share"] = max(run.unsettled_steps) / max(1, steps)
    return numerics


def _film_numerics(gathered: Gathering) -> dict[str, float | int | str]:
    """How thin the films got, and how warm the warmest is where a heat balance says it."""
    scene = gathered.plan.scene
    pins = zip(*np.nonzero(_oiled(scene)), strict=True)
    warm = [film_temperature_of(scene, int(throw), int(joint)) for throw, joint in pins]
    known = [each for each in warm if each is not None]
    return {**({"film_temperature_k": max(known)} if known else {}), **gathered.films}


def _has_floor(scene: PumpScene) -> bool:
    """Whether a contact law takes the speed of each impact, and so has a least one."""
    parts = (scene.joint.crankpin, scene.joint.wristpin, scene.joint.guide)
    return any(
        part is not None and part.law != "kelvin-voigt" and part.restitution_speed is None
        for part in parts
    )


def _warnings(numerics: dict[str, float | int | str]) -> tuple[str, ...]:
    """What a user must know of a run that did not fail."""
    found = []
    if float(numerics.get("tension_share", 0.0)) > 0:
        found.append(
            f"contact would be lost in {float(numerics['tension_share']):.1%} of the steps: a "
            "massless link is in tension; set the joint's rung to 'compliant'"
        )
    if float(numerics.get("cavitating_share", 0.0)) > 0:
        found.append(
            f"a cylinder holds vapour in {float(numerics['cavitating_share']):.1%} of the steps: "
            "the suction cavitates"
        )
    for side in ("suction", "discharge"):
        share = float(numerics.get(f"{side}_line_parted_share", 0.0))
        if share > 0:
            found.append(
                f"the liquid column of the {side} line parts in {share:.1%} of the steps: vapour "
                "is counted at the nodes of the line alone, so the pressures when it closes are "
                "those of a coarse model; raise the pressure at its far end, shorten it, or "
                "give it a damper"
            )
    if float(numerics.get("lines_unsettled_share", 0.0)) > 0:
        found.append(
            f"pump and lines agree to a thousandth of the pressure in all but "
            f"{float(numerics['lines_unsettled_share']):.2%} of the steps: what is left over is "
            "made up for in the next ones; shorten numerics.step, or give the lines dampers"
        )
    if float(numerics.get("floored_share", 0.0)) > _MOSTLY:
        found.append(
            f"{float(numerics['floored_share']):.1%} of the contacts closed more slowly than "
            f"{float(numerics['speed_floor_m_s']):.3g} m/s, the floor of the contact law: they "
            "were damped less than the law says"
        )
    if int(numerics.get("clipped_samples", 0)) > 0:
        found.append(f"{numerics['clipped_samples']} samples clipped; widen the sensor's range")
    return tuple(found)


def _film_warnings(scene: PumpScene, numerics: dict[str, float | int | str]) -> tuple[str, ...]:
    """Films that are thinner than their surfaces are rough, where no rung knows of peaks."""
    pins = [part for part in (scene.joint.crankpin, scene.joint.wristpin) if part is not None]
    oiled = [part for part in pins if part.rung in OILED_RUNGS and part.oil is not None]
    if not oiled or any(part.rung == "mixed" for part in oiled):
        return ()
    given = [part.oil.roughness for part in oiled if part.oil and part.oil.roughness]
    rough, film = max(given, default=_ROUGHNESS), float(numerics.get("min_film_m", math.inf))
    if film >= rough:
        return ()
    return (
        f"least film of the pins = {film:.2g} m is below a roughness of {rough:.2g} m, where "
        "peaks touch; set the joint's rung to 'mixed'",
    )


def _motor_warnings(scene: PumpScene, speed: NDArray[np.float64]) -> tuple[str, ...]:
    """A motor that its load has slowed beyond its largest moment."""
    motor = scene.drive.motor
    if scene.drive.rung != "motor" or motor is None:
        return ()
    later = speed[3 * len(speed) // 4 :]  # the mean of a part, as the speed swings
    last = later.mean() / math.tau
    least = scene.drive.synchronous_speed * (1 - motor.breakdown_slip)
    if last >= least:
        return ()
    return (
        f"speed at the end = {60 * last:.3g} rpm is below {60 * least:.3g} rpm, where the motor "
        "pulls hardest: it stalls; raise drive.motor.breakdown_moment or lower the load",
    )


def _test_truth(plan: RunPlan, pushes: tuple[Push, ...]) -> dict[str, Any]:
    if not pushes:
        return {}
    forces = np.stack([push.along for push in pushes], axis=1)
    return {"test_force_n": decimate(forces, plan.factor)[plan.kept]}


def _truth(run: CrankRun, plan: RunPlan) -> dict[str, Any]:
    """Forces, low-passed as the signal is, and states at the sample instants, per throw."""
    turned = plan.turned(plan.at_samples(run.turns[:, 0]))
    truth: dict[str, Any] = {"state_alpha": turned}
    truth["state_alpha_rate"] = plan.at_samples(run.turns[:, 1])
    throws = range(len(plan.scene.throws))
    columns = [1 + len(FORCES) * throw + FORCES.index(name) for throw in throws for name in _KEPT]
    force = decimate(run.forces[:, [0, *columns]], plan.factor)[plan.kept]  # it costs by the column
    truth["drive_moment_n_m"] = force[:, 0]
    if run.ends is not None:
        ends = plan.at_samples(run.ends)
        truth["suction_line_pressure_pa"] = ends[:, 0]
        truth["discharge_line_pressure_pa"] = ends[:, 1]
    for throw in throws:
        suffix = f"_{throw + 1}" if throw else ""
        own = force[:, 1 + len(_KEPT) * throw :]
        truth |= {
            f"{name}{suffix}": value for name, value in _throw_truth(run, plan, throw, turned, own)
        }
    return truth


_KEPT = ("pin_x", "pin_y", "wrist_x", "wrist_y", "guide_y", "piston_x")
"""Forces of a throw in the truth."""


def _throw_truth(
    run: CrankRun,
    plan: RunPlan,
    throw: int,
    turned: NDArray[np.float64],
    force: NDArray[np.float64],
) -> list[tuple[str, NDArray[np.float64]]]:
    assert run.bodies is not None  # truth was asked for
    bodies = plan.at_samples(run.bodies[:, throw])
    offsets = pin_offsets(plan.scene, turned, bodies, throw)
    found = [
        ("pin_force_n", force[:, 0:2]),
        ("wrist_force_n", force[:, 2:4]),
        ("guide_force_n", force[:, 4]),
        ("piston_pressure_force_n", -force[:, 5]),  # positive towards the crank
        ("pin_offset_m", offsets[:, 0:2]),
        ("wrist_offset_m", offsets[:, 2:4]),
        ("state_piston", bodies[:, 3]),
        ("state_piston_velocity", bodies[:, 9]),
        ("state_piston_across", bodies[:, 4]),
        ("state_piston_tilt", bodies[:, 5]),
        ("state_beta", bodies[:, 2]),
        ("state_beta_rate", bodies[:, 8]),
    ]
    if run.gaps is not None:
        gaps = plan.at_samples(run.gaps[:, throw])
        rungs = joint_rungs(plan.scene, throw)
        for joint, name in enumerate(("crankpin", "wristpin")):
            if rungs[joint] == JOINT_OILED:
                found += [
                    (f"{name}_gap_m", gaps[:, joint]),
                    (f"{name}_peak_force_n", gaps[:, GUIDE + joint]),
                ]
    if run.chambers is not None:
        chamber = plan.at_samples(run.chambers[:, throw])
        found += [
            ("cylinder_pressure_pa", chamber[:, 0]),
            ("suction_lift_m", chamber[:, 2]),
            ("discharge_lift_m", chamber[:, 4]),
        ]
    return found
