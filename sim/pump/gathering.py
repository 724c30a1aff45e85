"""Data collected while a pump runs: forces on its casing, and the response at its sensors."""

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..casing.casing_frf import Accelerance, load_accelerance
from ..casing.decimation import Decimation
from ..casing.measured_casing import MeasuredCasing
from ..casing.modes import CasingModes, ModalCasing, casing_inputs
from ..mechanism.layout import force_column
from ..parts.casing import CasingMode, specific_key
from ..pump_setup.joints import has_main_play
from ..pump_setup.yielding import rubs_in_guide, throw_on_casing
from ..scene.pump import CRANK_PLACES, FORCE_PLACES, GUIDE_PLACES, VALVE_PLACES, PumpScene
from ..scene.pump_hydraulics import CHAMBER_RUNGS
from ..scene.scene import SceneError
from .pressure_sensors import cylinder_pressure
from .push import pushed_places
from .run_plan import RunPlan


class Gathering:
    """Collects the data of a recording step by step while the mechanism runs.

    Forces pass through the casing at once, so that those of all steps need not be kept.

    Parameters
    ----------
    plan : RunPlan
    seed : int
        Seed of the recording.
    columns : tuple of int or None
        Rows of forces that will be added, among all forces; None for all.
    truth : bool
        Also keep the data named in :data:`GATHERED_TRUTH`.

    Attributes
    ----------
    plan, seed
        As passed.
    pushes : tuple of Push
        Forces of the mounted exciters at all steps.
    casing : ModalCasing or MeasuredCasing
        Casing under all forces added so far.
    turns : numpy.ndarray [shape=(n, 2, 2)]
        Crank angle [rad] and speed [rad/s] at the start and end of every sample's first step;
        n is 0 for a crank of constant speed without chambers.
    lifts : numpy.ndarray [shape=(n, n_throws, 2)]
        Lift of suction and discharge valve [m] at the start of every sample's first step; n is 0
        without chambers.
    vapour : numpy.ndarray [shape=(n_throws,)]
        Whether a chamber ever held vapour.
    pull : numpy.ndarray [shape=(n_throws,)]
        Largest force of the liquid along x on each piston after settling [N], a mean over its step.
    mean_speed : float
        Mean crank speed over all steps [rad/s].
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
        self._pistons = [_row_of("piston_x", throw, n_throws, columns) for throw in range(n_throws)]
        self._bearings = [
            list(self._sources).index(_force_key(scene, place, 1))
            for place in ("bearing_x", "bearing_y")
        ]
        self.casing = driven_casing(plan, (*self._sources, *pushed_places(scene)))
        self._sensors = [
            (self._pistons[throw], Decimation(1, plan.n_steps, plan.factor))
            for throw, _ in scene.pressure_sensors
        ]
        self._known = [
            _row_of(name, throw, n_throws, columns)
            for throw in range(n_throws if truth else 0)
            for name in _GATHERED_FORCES
        ]
        self._knowing = Decimation(len(self._known), plan.n_steps, plan.factor) if truth else None
        self._steps = self._samples = 0
        chambered = has_chambers(scene)
        turning = chambered or scene.drive.rung != "constant-speed"
        most = -(-plan.n_steps // plan.factor)
        self._turns = np.empty((most if turning else 0, 2, 2))
        self._lifts = np.empty((most if chambered else 0, n_throws, 2))
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
        """Add the next steps.

        Parameters
        ----------
        turns : numpy.ndarray [shape=(n + 1, 2)]
            As in :class:`CrankRun`, from the start of the first step.
        forces : numpy.ndarray [shape=(n_columns, n)]
        chambers : numpy.ndarray [shape=(n + 1, n_throws, 3)] or None
            Columns :data:`GATHERED` of ``CHAMBER_STATE``.
        gaps : numpy.ndarray [shape=(n + 1, n_pins, 2)] or None
            For the oiled pins: least film [m], and force of its asperities [N].
        """
        first, n, factor = self._steps, forces.shape[1], self.plan.factor
        if not first:
            self._ends[0] = float(turns[0, 0])
        self._ends[1] = float(turns[-1, 0])
        self._steps += n
        early = -first % factor  # steps before the next first step of a sample
        begin, self._samples = self._samples, self._samples + len(range(early, n, factor))
        found = slice(begin, self._samples)
        # column by column: numpy is ten times slower over many rows of two
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
        """Record least film and asperity contact at the starts of the samples' steps."""
        kept, factor = self.plan.kept, self.plan.factor
        begin = max(0, kept.start * factor - first)
        found = gaps[begin : max(begin, kept.stop * factor - first)]
        least = found[:, :, 0].min(initial=math.inf)
        self._least_gap = float(np.minimum(self._least_gap, least))  # NaN stays NaN
        self._rubs += int(np.count_nonzero((found[:, :, 1] > 0).any(axis=1)))
        self._looks += len(found)

    @property
    def films(self) -> dict[str, float]:
        """Least film of all oiled pins, and share of asperity contact; empty without data."""
        if not self._looks:  # no oiled pins, or the run failed while settling
            return {}
        return {"min_film_m": self._least_gap, "rubbing_share": self._rubs / self._looks}

    def _on_casing(
        self,
        turns: NDArray[np.float64],
        forces: NDArray[np.float64],
        first: int,
        rows: NDArray[np.float64],
    ) -> None:
        """Write forces on the casing [shape=(n_places, n)]: of the mechanism and the exciters."""
        n = forces.shape[1]
        for row, ((source, sign), *others) in zip(rows, self._sources.values(), strict=False):
            np.multiply(forces[source], sign, out=row)
            for other, its_sign in others:
                row += its_sign * forces[other]
        if self.plan.scene.crank.unbalance > 0 and not has_main_play(self.plan.scene):
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
        """Mean crank speed; see the class."""
        return (self._ends[1] - self._ends[0]) / (self._steps * self.plan.step)

    def turned(self) -> NDArray[np.float64]:
        """Crank angle at the samples [rad]: exact at constant speed, else as computed."""
        if not len(self.turns):
            return self.plan.angle
        angle = self.turns[self.plan.kept, :, 0]
        return self.plan.turned(0.5 * (angle[:, 0] + angle[:, 1]))

    def truth(self) -> dict[str, NDArray[np.float64]]:
        """Truth named in :data:`GATHERED_TRUTH`; empty if not requested."""
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
"""Part of a run's truth available without its states, with one array for all throws."""


def _row_of(force: str, throw: int, n_throws: int, columns: tuple[int, ...] | None) -> int:
    """Row of a throw's force among those kept."""
    column = force_column(force, throw, n_throws)
    return column if columns is None else columns.index(column)


def _sources(
    scene: PumpScene, columns: tuple[int, ...] | None
) -> dict[str, list[tuple[int, float]]]:
    """Rows of forces, with signs, for every place where the crank mechanism acts on the casing.

    Reactions of bearing and guide, liquid on the cylinder head, valves on their seats. Keys are
    those of a mode shape: a place, or a place of one throw; a key for several throws sums them.
    """
    found: dict[str, list[tuple[int, float]]] = {}
    for throw in range(len(scene.throws)):
        for place, name, sign in throw_on_casing(scene, throw):
            row = _row_of(name, throw, len(scene.throws), columns)
            found.setdefault(_force_key(scene, place, throw + 1), []).append((row, sign))
    return found


def has_chambers(scene: PumpScene) -> bool:
    """Whether any cylinder is a chamber with valves."""
    return any(scene.pressures(k).rung in CHAMBER_RUNGS for k in range(len(scene.throws)))


def _crank_throws(plan: RunPlan, turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force of the crank's unbalance on its bearing (x, y), without its steady weight."""
    scene = plan.scene
    angle = 0.5 * (turns[:-1, 0] + turns[1:, 0]) + scene.throws[0].phase
    speed = 0.5 * (turns[:-1, 1] + turns[1:, 1])
    spin_up = np.diff(turns[:, 1]) / plan.step
    sin, cos = np.sin(angle), np.cos(angle)
    along = scene.crank.unbalance * (speed**2 * cos + spin_up * sin)
    across = scene.crank.unbalance * (speed**2 * sin - spin_up * cos)
    return np.stack([along, across])


def _force_key(scene: PumpScene, place: str, throw: int) -> str:
    """Key of a force in the casing's shapes: with its throw if there is such a key."""
    if scene.casing.frf is not None:
        return f"{place}_{throw}"
    keys = {key for mode in scene.casing.modes for key in mode.shape}
    return specific_key(keys, place, throw) or place


def _split(key: str) -> tuple[str, int]:
    """Place and throw of a key; a place for all throws counts as that of the first."""
    place, _, throw = key.rpartition("_")
    return (key, 1) if key in FORCE_PLACES else (place, int(throw))


def driven_casing(plan: RunPlan, places: tuple[str, ...]) -> ModalCasing | MeasuredCasing:
    """Create the casing of a scene, driven at these places."""
    step_rate = plan.scene.sample_rate * plan.factor
    accelerance = measured_casing(plan.scene, places)
    if accelerance is not None:
        return MeasuredCasing(accelerance, step_rate, plan.factor, plan.n_steps)
    return ModalCasing(casing_modes(plan.scene, places), step_rate, plan.factor, plan.n_steps)


def sensor_response(
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
    """Accelerance from the scene's file; None if the casing is given as modes.

    Parameters
    ----------
    scene : PumpScene
    places : tuple of str
        Columns to read; by default those of :func:`measured_places`.

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
    """Places where the mechanism acts on a measured casing, by throw.

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
            *(VALVE_PLACES if scene.pressures(throw).rung in CHAMBER_RUNGS else ()),
        )
    )


def casing_modes(scene: PumpScene, places: tuple[str, ...]) -> CasingModes:
    """Modes of a scene's casing on its feet as they are, at these places and all sensors.

    Parameters
    ----------
    scene : PumpScene
        A scene with a casing given as modes.
    places : tuple of str
        Keys of mode shapes, for forces or excited sensors.

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
    """Shape at the key of a force, or at an excited sensor."""
    return mode.shape[key] if key in mode.shape else casing_inputs(mode.shape, *_split(key))
