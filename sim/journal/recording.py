"""Simulation of a journal bearing, from its scene to its recording."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..contact.law import CONTACT
from ..film.impedance_map import impedance_map
from ..film.solve import LEAST_CELLS, FilmGeometry, Groove, dufrane_scar
from ..output.recording import Recording
from ..output.sensor import digitise, floor_of
from ..output.status import SimulationError, Status
from ..output.track import track_under
from ..scene.journal import JournalLoad, JournalScene
from ..scene.recorded import duration_faults, failed, memory_faults, recorded, tacho_faults
from ..scene.scene import Scene, SceneError
from .load import Load, half_sine_history, load, loads_at, rectangular_history, step_history
from .orbit import FilmTrace, OrbitRun, film_trace, run_orbit
from .orbit_film import OrbitFilm, map_film, short_film, solved_film
from .orbit_march import Wall
from .orbit_status import OrbitStatus
from .validity import JOURNAL_STEP, orbit_faults

Float = NDArray[np.float64]
Numerics = dict[str, float | int | str]

_FEWEST_PER_TURN = 8
"""Samples per revolution: three orders of the orbit below half the sample rate, and a margin."""

_BYTES_PER_SAMPLE = 40 * 8  # states, forces, loads and two passes over the channels

_STATUS = {
    OrbitStatus.OK: Status.OK,
    OrbitStatus.DIVERGED: Status.DIVERGED,
    OrbitStatus.STEP: Status.SQUEEZE,
    OrbitStatus.THIN: Status.THIN_FILM,
    OrbitStatus.OVERLOAD: Status.OVERLOAD,
    OrbitStatus.CONTACT: Status.TOUCH,
    OrbitStatus.OVERLAP: Status.WALL,
    OrbitStatus.FILM: Status.NO_PRESSURE,
    OrbitStatus.STEPS: Status.TOO_MANY_STEPS,
}
"""Status of a scene's run by the orbit's status."""


@dataclass(frozen=True, kw_only=True)
class JournalScale:
    """Units of the orbit computation.

    Attributes
    ----------
    speed : float
        Shaft speed [rad/s]; multiplies times.
    clearance : float
        Radial clearance [m]; divides lengths.
    alpha : float
        ``eta R^3 L / (M C^3 omega)``: film force over the force below [-].
    force : float
        ``M C omega^2`` [N]; divides loads.
    pressure : float
        ``eta omega (R / C)^2`` [Pa].
    """

    speed: float
    clearance: float
    alpha: float
    force: float
    pressure: float


def journal_scale(scene: JournalScene) -> JournalScale:
    """Units of a scene.

    Parameters
    ----------
    scene : JournalScene

    Returns
    -------
    JournalScale

    References
    ----------
    Ma, Lu, Chen, "Simulation of the journal orbit of a journal bearing under transient load",
    J. Vib. Meas. Diagn. 30 (2010) 5-10, equation 2.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scale = journal_scale(load_scene("journal-step"))
    >>> round(scale.alpha, 4), round(9.80665 / (scale.clearance * scale.speed**2), 4)
    (0.8354, 0.3972)
    """
    speed = 2 * math.pi * scene.drive.speed
    radius, gap = scene.bearing.diameter / 2, scene.bearing.clearance_radial
    force = scene.rotor.mass * gap * speed**2
    film = scene.oil.dynamic_viscosity * speed * radius**3 * scene.bearing.length / gap**2
    return JournalScale(
        speed=speed,
        clearance=gap,
        alpha=film / force,
        force=force,
        pressure=scene.oil.dynamic_viscosity * speed * (radius / gap) ** 2,
    )


def film_geometry(scene: JournalScene) -> FilmGeometry:
    """Geometry of the film of a scene, over its radial clearance.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(film_geometry(load_scene("journal-step")).length_to_diameter, 4)
    0.6667
    """
    bearing, film = scene.bearing, scene.film
    bore = None
    if bearing.scar > 0:
        depth = bearing.scar / bearing.clearance_radial
        bore = dufrane_scar(depth, bearing.scar_angle, film.n_theta)
    unit = journal_scale(scene).pressure
    return FilmGeometry(
        length_to_diameter=bearing.length / bearing.diameter,
        n_theta=film.n_theta,
        n_z=film.n_z,
        condition=film.condition,
        bore=bore,
        inlet_fill=bearing.inlet_fill,
        grooves=tuple(
            Groove(
                angle=groove.angle,
                width=groove.width,
                length_share=groove.length_share,
                pressure=groove.pressure / unit,
            )
            for groove in bearing.grooves
        ),
    )


def journal_film(scene: JournalScene) -> OrbitFilm:
    """Film of a scene, by its rung.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> film = journal_film(load_scene("journal-step", {"film.rung": "short"}))
    >>> round(film.length_to_diameter, 4)
    0.6667
    """
    return _FILMS[scene.film.rung](film_geometry(scene))


def _mapped(geometry: FilmGeometry) -> OrbitFilm:
    """Map of a plain bore, independent of the clearance: all records of a set share it."""
    size = (geometry.length_to_diameter, geometry.n_theta, geometry.n_z, geometry.condition)
    return _plain_map(*size)


@lru_cache(maxsize=8)
def _plain_map(length_to_diameter: float, n_theta: int, n_z: int, condition: str) -> OrbitFilm:
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter, n_theta=n_theta, n_z=n_z, condition=condition
    )
    return map_film(impedance_map(geometry), length_to_diameter)


_FILMS: dict[str, Callable[[FilmGeometry], OrbitFilm]] = {
    "short": lambda geometry: short_film(geometry.length_to_diameter),
    "map": _mapped,
    "direct": solved_film,
}
"""Film of every rung of a scene. A new rung is one row."""


def journal_wall(scene: JournalScene) -> Wall | None:
    """Contact of journal and shell in the orbit's units; None if the scene has none.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> journal_wall(load_scene("journal-step")) is None
    True
    """
    part = scene.bearing.wall
    if part is None:
        return None
    scale = journal_scale(scene)
    rate = scene.rotor.mass * scale.speed
    contact = np.zeros(1, dtype=CONTACT)
    contact["stiffness"] = part.stiffness / (rate * scale.speed)
    contact["damping"] = part.damping / rate
    contact["clearance"] = contact["speed_floor"] = 1.0
    contact["friction"] = part.friction
    contact["friction_speed"] = part.friction_speed / (scale.clearance * scale.speed)
    return Wall(1, contact, scene.bearing.diameter / 2 / scale.clearance)


# --- load


def journal_load(scene: JournalScene, lead: float = 0.0) -> Load:
    """All loads on the journal except film and wall, in the orbit's units.

    Parameters
    ----------
    scene : JournalScene
    lead : float
        Time from the start of the run to the first sample [s].

    Returns
    -------
    Load
        Weight and static load, unbalance, history.

    Raises
    ------
    SceneError
        The file of a load record cannot be read.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> pulse = journal_load(load_scene("journal-rectangular-pulse"))
    >>> loads_at(pulse, np.array([50.0, 51.0, 57.0]))[:, 0].round(3).tolist()
    [0.397, 1.397, 0.397]
    """
    scale, part, rotor = journal_scale(scene), scene.load, scene.rotor
    size = part.amplitude / scale.force
    vector = (size * math.cos(part.angle), size * math.sin(part.angle))
    if part.history == "file":
        history = _recorded(scene, scale, lead)
    else:
        history = _HISTORIES[part.history](part, scale.speed, lead, vector)
    return load(
        alpha=scale.alpha,
        static=(
            (rotor.mass * scene.gravity + part.static) / scale.force,
            part.static_across / scale.force,
        ),
        unbalance=rotor.unbalance / (rotor.mass * scale.clearance),
        phase=scene.drive.start_angle + rotor.unbalance_angle - scale.speed * lead,
        orders=_orders(scene, scale, lead),
        **history,
    )


_History = dict[str, Float]
_Vector = tuple[float, float]


def _step(part: JournalLoad, speed: float, lead: float, size: _Vector) -> _History:
    return step_history(speed * (part.begin + lead), size)


def _rectangular(part: JournalLoad, speed: float, lead: float, size: _Vector) -> _History:
    begin = part.begin + lead
    return rectangular_history(speed * begin, speed * (begin + (part.length or 0.0)), size)


def _half_sine(part: JournalLoad, speed: float, lead: float, size: _Vector) -> _History:
    begin = part.begin + lead
    return half_sine_history(speed * begin, speed * (begin + (part.length or 0.0)), size)


_HISTORIES: dict[str, Callable[[JournalLoad, float, float, _Vector], _History]] = {
    "none": lambda _part, _speed, _lead, _size: {},
    "step": _step,
    "rectangular": _rectangular,
    "half-sine": _half_sine,
}
"""History of a load. A new one is one row."""


def _orders(scene: JournalScene, scale: JournalScale, lead: float) -> list[tuple[float, ...]]:
    """Forces periodic with the shaft, as arguments of :func:`.orbit.load`."""
    begin = scene.drive.start_angle - scale.speed * lead
    return [
        (
            one.order,
            one.order * begin - one.phase,
            one.amplitude * math.cos(one.angle) / scale.force,
            one.amplitude * math.sin(one.angle) / scale.force,
        )
        for one in scene.load.orders
        if one.amplitude > 0
    ]


def _recorded(scene: JournalScene, scale: JournalScale, lead: float) -> _History:
    rows = _load_rows(scene)
    return {"time": scale.speed * (rows[:, 0] + lead), "history": rows[:, 1:] / scale.force}


def _load_rows(scene: JournalScene) -> Float:
    """Rows of a load record: time [s] from the first sample, forces along X and Y [N]."""
    record = scene.load.record
    assert record is not None  # checked with the scene
    at_scene = Path(record.folder) / record.file
    path = at_scene if at_scene.is_file() else Path(record.file)
    try:
        rows = np.loadtxt(path, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        fault = f"load.record.file = {record.file!r} is no CSV of numbers ({error}); correct it"
        raise SceneError(scene.name, [fault]) from None
    sound = rows.shape[1] == 3 and len(rows) > 0 and bool(np.isfinite(rows).all())
    if not sound or not (np.diff(rows[:, 0]) >= 0).all():
        fault = (
            f"load.record.file = {record.file!r} must hold three columns, rising time [s] and two "
            "forces [N], all finite; correct it"
        )
        raise SceneError(scene.name, [fault])
    return np.asarray(rows)


# --- run


def check_journal(scene: Scene) -> None:
    """Check sampling, size and files, which need the physics.

    Raises
    ------
    SceneError
        All faults together.
    """
    journal = cast(JournalScene, scene)
    faults = [*_sampling_faults(journal), *orbit_faults(journal)]
    if faults:
        raise SceneError(journal.name, faults)
    journal_load(journal)


def _sampling_faults(scene: JournalScene) -> list[str]:
    revolution = 1 / scene.drive.speed
    faults = duration_faults(scene, revolution)
    if scene.sample_rate * revolution < _FEWEST_PER_TURN:
        faults.append(
            f"sample_rate = {scene.sample_rate:g} Hz must be >= "
            f"{_FEWEST_PER_TURN / revolution:g} Hz, {_FEWEST_PER_TURN} samples a revolution; raise "
            "it"
        )
    faults += tacho_faults(scene, revolution)
    needed = _Plan(scene).n_all * _BYTES_PER_SAMPLE
    return faults + memory_faults(scene, needed)


class _Plan:
    """Samples of a run, and those that are kept."""

    def __init__(self, scene: JournalScene) -> None:
        rate = scene.sample_rate
        self.settling = math.ceil(scene.settling_revolutions / scene.drive.speed * rate)
        self.n_samples = round(scene.duration * rate)
        self.n_all = self.settling + self.n_samples
        self.kept = slice(self.settling, self.n_all)
        self.scene = scene

    @property
    def lead(self) -> float:
        """Time from the start of the run to the first sample kept [s]."""
        return self.settling / self.scene.sample_rate

    @property
    def angle(self) -> Float:
        """Shaft angle at the samples kept [rad]."""
        time = np.arange(self.n_samples) / self.scene.sample_rate
        turned = math.tau * self.scene.drive.speed * time
        return np.asarray(self.scene.drive.start_angle + turned)


def simulate_journal(scene: Scene, seed: int, truth: bool, raise_on_failure: bool) -> Recording:
    """Simulate one recording; see :func:`wearstate.sim.machine.simulate.simulate`."""
    journal = cast(JournalScene, scene)
    check_journal(journal)
    plan, scale = _Plan(journal), journal_scale(journal)
    film, loads = journal_film(journal), journal_load(journal, plan.lead)
    run = _run(journal, film, loads, plan)
    status = _STATUS[run.status]
    if status.ok and plan.n_samples > len(run.tau) - plan.settling:
        status = Status.DIVERGED
    if status.ok and _coarse(journal, run.position[plan.kept]):
        status = Status.THIN_FILM
    numerics = _numerics(journal, scale, plan, run)
    numerics |= _guards(journal, film, run)
    if not status.ok:
        if raise_on_failure:
            raise SimulationError(status, journal.name)
        return failed(journal, status, numerics)
    signal, clipped = _measured(journal, scale.clearance * run.position[plan.kept], plan, seed)
    numerics["clipped_samples"] = clipped
    return recorded(
        journal,
        signal,
        truth=_truth(journal, scale, plan, run, (film, loads)) if truth else {},
        status=status,
        numerics=numerics,
        warnings=_warnings(numerics),
    )


def _run(scene: JournalScene, film: OrbitFilm, loads: Load, plan: "_Plan") -> OrbitRun:
    speed = math.tau * scene.drive.speed
    sample_step = speed / scene.sample_rate
    step = scene.numerics.step
    return run_orbit(
        film,
        loads,
        duration=sample_step * (plan.n_all - 1),
        start=(scene.start.x, scene.start.y),
        integrator=scene.numerics.integrator,
        step=JOURNAL_STEP if step is None else speed * step,
        sample_step=sample_step,
        tolerance=scene.numerics.tolerance,
        wall=journal_wall(scene),
    )


def _measured(
    scene: JournalScene, position: Float, plan: _Plan, seed: int
) -> tuple[NDArray[np.float32], int]:
    """Signal of every channel, and the number of clipped samples.

    The orbit is sampled without a filter: a jump of the load affects a displacement by the third
    power of the frequency, so that content above half the sample rate is negligible.
    """
    rng = np.random.default_rng(seed)
    rows, clipped = [], 0
    for probe in scene.sensors:
        towards = position[:, 0] * math.cos(probe.angle) + position[:, 1] * math.sin(probe.angle)
        row, lost = digitise(
            towards
            + track_under(scene.rotor.run_out, scene.rotor.dents, plan.angle - probe.angle)
            + probe.offset,
            gain=probe.gain,
            noise=floor_of(probe, towards.size, scene.sample_rate, rng=rng),
            full_scale=probe.range,
            bits=probe.bits,
            rng=rng,
        )
        rows.append(row)
        clipped += lost
    if scene.tacho:
        rows.append(scene.tacho.channel(plan.angle))
    return np.stack(rows), clipped


def film_gap(scene: JournalScene, position: Float) -> Float:
    """Thinnest film at positions of the journal.

    Parameters
    ----------
    scene : JournalScene
    position : numpy.ndarray [shape=(n, 2)]
        Journal centre along X and Y over the radial clearance.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Over the radial clearance; for a worn bore, at the nodes of its mesh.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> film_gap(load_scene("journal-step"), np.array([[0.3, 0.4]])).round(3).tolist()
    [0.5]
    """
    bore = film_geometry(scene).bore
    if bore is None:
        return np.asarray(1 - np.hypot(position[:, 0], position[:, 1]))
    thinnest = np.full(len(position), np.inf)
    for extra, angle in zip(bore, math.tau * np.arange(len(bore)) / len(bore), strict=True):
        gap = 1 + extra - position[:, 0] * math.cos(angle) - position[:, 1] * math.sin(angle)
        np.minimum(thinnest, gap, out=thinnest)
    return thinnest


def _coarse(scene: JournalScene, position: Float) -> bool:
    """Whether the thinnest film of an orbit spans too few nodes of its mesh to be accurate.

    With a wall this does not apply, as it takes over where the film ends.
    """
    if scene.film.rung == "short" or scene.bearing.wall is not None:
        return False
    geometry = film_geometry(scene)
    least = film_gap(scene, position)
    x, y = position[int(np.argmin(least))]
    angle = math.tau * np.arange(geometry.n_theta) / geometry.n_theta
    gap = 1 - x * np.cos(angle) - y * np.sin(angle)
    if geometry.bore is not None:
        gap += geometry.bore
    return bool(np.count_nonzero(gap < 2 * least.min()) < LEAST_CELLS)


def _numerics(scene: JournalScene, scale: JournalScale, plan: _Plan, run: OrbitRun) -> Numerics:
    kept = run.position[plan.settling :]
    numerics: Numerics = {
        "rung_film": scene.film.rung,
        "film_condition": scene.film.condition,
        "integrator": scene.numerics.integrator,
        "step_s": run.end / max(1, run.steps) / scale.speed,
        "steps": run.steps,
        "steps_rejected": run.rejected,
        "film_calls": run.calls,
        "alpha": scale.alpha,
        "mean_speed_hz": scene.drive.speed,
    }
    if len(kept):
        numerics["peak_eccentricity"] = float(np.hypot(kept[:, 0], kept[:, 1]).max())
        numerics["min_film_m"] = scale.clearance * float(film_gap(scene, kept).min())
    return numerics


def _guards(scene: JournalScene, film: OrbitFilm, run: OrbitRun) -> Numerics:
    """Stability margin of the step, and the error expected by the integrator."""
    method = scene.numerics.integrator
    if method == "adaptive":  # L-stable: stable at any step
        return {"stability_margin": 1.0, "estimated_error": scene.numerics.tolerance}
    if not len(run.position):
        return {}
    step = run.end / max(1, run.steps)
    alpha = journal_scale(scene).alpha
    rate = alpha * squeeze_rate(film, run)
    return {
        "stability_margin": 1 - step * rate / _STABLE[method],
        "estimated_error": step / 2 if method == "euler" else step**4 / 120,
    }


_STABLE = {"euler": 2.0, "rk4": 2.785}
"""Stability limit of step times damping for a fixed-step integrator, on the real axis."""

_NUDGE = 1e-4  # of the clearance per radian: the film is nearly linear in so small a rate


def squeeze_rate(film: OrbitFilm, run: OrbitRun) -> float:
    """Largest damping of the film at the outermost position of an orbit.

    Parameters
    ----------
    film : Film
    run : OrbitRun
        Run with at least one sample.

    Returns
    -------
    float
        Largest eigenvalue of the symmetric part of ``-dF/dV``, over that of the unit of force;
        times alpha it is the decay rate of a squeeze [1/rad].

    Examples
    --------
    >>> from wearstate.sim.journal.load import load
    >>> from wearstate.sim.journal.orbit import run_orbit
    >>> film = short_film(0.5)
    >>> run = run_orbit(film, load(alpha=1.0), duration=0.1)
    >>> bool(abs(squeeze_rate(film, run) / (4 * 0.5**2 * math.pi / 2) - 1) < 0.1)
    True
    """
    outermost = int(np.argmax(np.hypot(*run.position.T)))
    nudges = _NUDGE * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    there = replace(
        run,
        tau=np.zeros(len(nudges)),
        position=np.repeat(run.position[[outermost]], len(nudges), axis=0),
        velocity=run.velocity[outermost] + nudges,
    )
    force = film_trace(film, there).force
    damping = -np.stack([force[0] - force[1], force[2] - force[3]]) / (2 * _NUDGE)
    return float(np.linalg.eigvalsh((damping + damping.T) / 2)[-1])


def _warnings(numerics: Numerics) -> tuple[str, ...]:
    """Warnings about a run that did not fail."""
    if int(numerics.get("clipped_samples", 0)) > 0:
        return (f"{numerics['clipped_samples']} samples clipped; widen the probe's range",)
    return ()


def _truth(
    scene: JournalScene,
    scale: JournalScale,
    plan: _Plan,
    run: OrbitRun,
    pushes: tuple[OrbitFilm, Load],
) -> dict[str, Float]:
    """Orbit, film force, thinnest film, peak pressure and load at the samples."""
    kept, (film, loads) = plan.kept, pushes
    trace: FilmTrace = film_trace(film, run)
    truth = {
        "state_angle": plan.angle,
        "journal_m": scale.clearance * run.position[kept],
        "journal_velocity_m_s": scale.clearance * scale.speed * run.velocity[kept],
        "film_force_n": scale.alpha * scale.force * trace.force[kept],
        "min_film_m": scale.clearance * film_gap(scene, run.position[kept]),
        "load_n": scale.force * loads_at(loads, run.tau[kept]),
    }
    if trace.peak_pressure is not None:
        truth["peak_pressure_pa"] = scale.pressure * trace.peak_pressure[kept]
    return truth
