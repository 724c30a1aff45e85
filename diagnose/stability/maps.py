"""The maps of :mod:`.stability.method_map`: what each method is run over, and the theory beside it.

A maker takes a scene and gives a plan, or the reason why this scene has no such map. A new map is
one row of :data:`MAPS`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ...sim.contact.closed_forms import kelvin_voigt_restitution
from ...sim.film.bearing import BearingError, BearingStatus, equilibrium, sommerfeld_number, whirl
from ...sim.film.over_relaxed import PAPER_RELAXATION
from ...sim.film.rungs import FILM_RUNGS
from ...sim.film.solve import (
    LEAST_CELLS,
    FilmGeometry,
    FilmSolution,
    FilmState,
    FilmStatus,
    solve_direct,
    solve_relaxed,
)
from ...sim.journal.orbit import OrbitFilm, OrbitRun, OrbitStatus, film_force, load, run_orbit
from ...sim.journal.recording import film_geometry, journal_film, journal_scale
from ...sim.journal.validity import JOURNAL_STEP
from ...sim.machine.simulate import simulate
from ...sim.output.recording import Recording
from ...sim.output.status import Status
from ...sim.piping.pipe import FEWEST_REACHES, drive_pipe, pipe_parameters, pipe_start
from ...sim.pump.recording import steps_per_sample
from ...sim.pump.setup import (
    LARGEST_STEP_PER_CONTACT_TIME,
    WAYS,
    bearing_mass_ratios,
    begun,
    contact_rate,
    contact_table,
    joint_loads,
    joint_mobility,
    joint_parts,
    joint_rungs,
    run_scene,
    tangent_stiffness,
    yielding_of,
)
from ...sim.pump.slider_crank import JOINT_COMPLIANT, run_mechanism
from ...sim.scene.journal import JournalScene
from ...sim.scene.oil import Oil
from ...sim.scene.parts import Scene, SceneError
from ...sim.scene.pump import PumpJoints, PumpScene
from ...sim.scene.pump_hydraulics import PIPED_RUNGS, Line, Liquid
from ...sim.scene.shaft import ShaftScene
from .method_map import Cell, Curve, Judge, MapAxis, MapPlan, Own, Verdict
from .own_point import journal_weight, orbit_step, own_film, plain_film
from .steppers import STEPPERS, Stepper, bounce, decays

Array = NDArray[np.float64]
Maker = Callable[[Scene, int | None], MapPlan | str]

_JOINTS = ("crankpin", "wristpin", "guide")
_PHASES = np.arange(8) / 8  # of a step, at which a contact may be met
_WATCHED = 600  # steps, of a free oscillator
_STARTS = (0.0, 1.7, 3.3, 5.0)  # rad, over the first turn
_FINER = 4  # steps or nodes for one, to tell the machine from its method


def _spread(low: float, high: float, size: int) -> tuple[float, ...]:
    return tuple(float(value) for value in np.geomspace(low, high, size))


def changed(part: Any, values: Mapping[str, Any]) -> Any:
    """A scene with values replaced by dotted path, not validated again.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> changed(load_scene("bilge-pump"), {"drive.speed": 4.0}).drive.speed
    4.0
    """
    for path, value in values.items():
        head, _, rest = path.partition(".")
        inner = changed(getattr(part, head), {rest: value}) if rest else value
        part = part.model_copy(update={head: inner})
    return part


# --- contact oscillator of a joint


class _Contact(NamedTuple):
    """A joint as an oscillator: the mass that its contact feels, stiffness, damping."""

    joint: str
    mass: float
    stiffness: float
    damping: float


def contact_oscillator(scene: PumpScene) -> _Contact | None:
    """Stiffest compliant joint of the first throw as a mass on a spring and a dashpot.

    Parameters
    ----------
    scene : PumpScene

    Returns
    -------
    _Contact or None
        The least mass that the contact feels over a revolution [kg], stiffness [N/m] and damping
        [N s/m], tangents at the ideal joint's largest load; None where no joint is compliant.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = contact_oscillator(load_scene("bilge-pump"))
    >>> found.joint, round(found.mass, 2), found.stiffness
    ('crankpin', 1.71, 200000000.0)
    """
    found = []
    table, loads = contact_table(scene, 0), joint_loads(scene, 0)
    for number, rung in enumerate(joint_rungs(scene, 0)):
        part = joint_parts(scene, 0)[number]
        if rung != JOINT_COMPLIANT or part is None:
            continue
        record = table[number]
        loss = float(record["hysteresis"]) * loads[number] / float(record["speed_floor"])
        found.append(
            _Contact(
                joint=_JOINTS[number],
                mass=1 / joint_mobility(scene, 0, number),
                stiffness=tangent_stiffness(record, loads[number]),
                damping=max(float(record["damping"]), loss),
            )
        )
    return max(found, key=lambda each: each.stiffness / each.mass, default=None)


def contact_restitution(damping_ratio: float) -> float:
    """Restitution of a Kelvin-Voigt contact that never pulls, at any damping.

    Notes
    -----
    Beyond critical damping the force vanishes at ``tanh(w t) = 2 zeta w / (2 zeta^2 - 1)`` with
    ``w^2 = zeta^2 - 1``.

    Examples
    --------
    >>> [round(contact_restitution(zeta), 3) for zeta in (0.2, 0.999, 1.001, 3.0)]
    [0.572, 0.136, 0.135, 0.024]
    """
    if damping_ratio < 1:
        return kelvin_voigt_restitution(damping_ratio)
    z = max(damping_ratio, 1 + 1e-9)
    w = math.sqrt(z * z - 1)
    end = math.atanh(2 * z * w / (2 * z * z - 1))
    return math.exp(-z * end / w) * (z / w * math.sinh(end) - math.cosh(end))


def step_stiffness(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Classical steppers on the joint's contact, and the mechanism itself: step by stiffness.

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
    contact = contact_oscillator(pump)
    if contact is None:
        return "no joint is compliant; set joint.crankpin.rung = 'compliant'"
    n = size or 13
    rate = math.sqrt(contact.stiffness / contact.mass)
    step = 1 / (pump.sample_rate * steps_per_sample(pump))
    guard = LARGEST_STEP_PER_CONTACT_TIME / contact_rate(pump) / step
    x = MapAxis(name="step", unit="s", values=_spread(0.02 / rate, 20 / rate, n)).through(step)
    y = MapAxis(
        name="contact stiffness",
        unit="N/m",
        values=_spread(contact.stiffness / 100, contact.stiffness * 100, n),
    ).through(contact.stiffness)
    judges = {s.name: _stepper_judge(s, contact, x, y, scene.accuracy) for s in STEPPERS}
    curves = {s.name: _stepper_curve(s, contact, y) for s in STEPPERS}
    judges[_MECHANISM] = _mechanism_judge(pump, contact)
    curves[_MECHANISM] = [*curves["runge-kutta 4"], _guard_curve(pump, contact, y)]
    return MapPlan(
        name="step-stiffness",
        title=f"contact of the {contact.joint}, step by stiffness, damping as it is",
        x=x,
        y=y,
        judges=judges,
        curves=curves,
        note="growth of the pressed contact; speed after an impact, over that before, within "
        f"{scene.accuracy:.2g}; the mechanism: rms of the joint's force",
        own=Own(
            method=_MECHANISM,
            x=step,
            y=contact.stiffness,
            note=f"A check lets a scene take at most {guard:.2g} times this step.",
        ),
    )


_MECHANISM = "mechanism, cut at contacts"


def _stepper_curve(stepper: Stepper, contact: _Contact, y: MapAxis) -> list[Curve]:
    points = []
    for k in np.geomspace(y.values[0] / 2, y.values[-1] * 2, 200):
        omega = math.sqrt(k / contact.mass)
        limit = stepper.limit(contact.damping / (2 * omega * contact.mass))
        if 0 < limit < math.inf:
            points.append((limit / omega, float(k)))
    if not points:
        return []
    return [Curve(name="limit in theory", x=_column(points, 0), y=_column(points, 1))]


def _column(points: list[tuple[float, float]], column: int) -> tuple[float, ...]:
    return tuple(point[column] for point in points)


def _guard_curve(scene: PumpScene, contact: _Contact, y: MapAxis) -> Curve:
    longest = [
        LARGEST_STEP_PER_CONTACT_TIME / contact_rate(_stiff(scene, contact, k)) for k in y.values
    ]
    return Curve(name="guard: longest step let pass", x=tuple(longest), y=y.values)


def _stiff(scene: PumpScene, contact: _Contact, stiffness: float) -> PumpScene:
    """A scene whose joint has another tangent stiffness under its largest load.

    That of Hertz's law goes with the power 2/3 of its constant, that of the conformal one nearly
    with its modulus.
    """
    path = f"joint.{contact.joint}"
    part = getattr(scene.joint, contact.joint)
    name, power = _STIFFENED[part.elasticity]
    value = getattr(part, name) * (stiffness / contact.stiffness) ** power
    return cast(PumpScene, changed(scene, {f"{path}.{name}": value}))


_STIFFENED = {
    "linear": ("stiffness", 1.0),
    "hertz": ("hertz_stiffness", 1.5),
    "conformal": ("effective_modulus", 1.0),
}


def _stepper_judge(
    stepper: Stepper, contact: _Contact, x: MapAxis, y: MapAxis, accuracy: float
) -> Judge:
    """A whole plane at once, on first use."""

    @cache
    def plane() -> dict[tuple[float, float], Cell]:
        step, stiffness = (a.ravel() for a in np.meshgrid(x.values, y.values))
        omega = np.sqrt(stiffness / contact.mass)
        zeta = contact.damping / (2 * contact.mass * omega)
        stable = decays(stepper, step, omega, zeta, _WATCHED)
        per_mass = contact.damping / contact.mass
        back = bounce(stepper, step, omega[None] ** 2, per_mass, _PHASES[:, None])
        exact = np.array([contact_restitution(float(ratio)) for ratio in zeta])
        off = np.abs(back - exact).max(axis=0)
        return {
            (float(h), float(k)): _stepper_cell(bool(fine), float(error), accuracy)
            for h, k, fine, error in zip(step, stiffness, stable, off, strict=True)
        }

    return lambda h, k: plane()[h, k]


def _stepper_cell(stable: bool, off: float, accuracy: float) -> Cell:
    if not stable:
        return Verdict.UNSTABLE, "grows"
    if math.isnan(off):
        return Verdict.NOT_CONVERGED, "no next point"
    verdict = Verdict.ACCURATE if off <= accuracy else Verdict.INACCURATE
    return verdict, f"restitution off by {off:.3g}"


def _mechanism_judge(scene: PumpScene, contact: _Contact) -> Judge:
    """The whole mechanism without its guard, against a quarter of the longest step let pass."""

    @cache
    def reference(stiffness: float) -> Array:
        stiff = _stiff(scene, contact, stiffness)
        longest = LARGEST_STEP_PER_CONTACT_TIME / contact_rate(stiff)
        return _joint_rms(stiff, contact.joint, longest / _FINER)

    def judge(step: float, stiffness: float) -> Cell:
        right = reference(stiffness)
        if not np.all(np.isfinite(right)):
            return Verdict.FAILS, "no finer step runs either"
        found = _joint_rms(_stiff(scene, contact, stiffness), contact.joint, step)
        if not np.all(found < _BOUNDLESS * right.max()):  # also where it is not finite
            return Verdict.UNSTABLE, "force without bound"
        off, mean = abs(found.mean() / right.mean() - 1), right.mean()
        # impacts are chaotic: what the starts scatter by is no error
        scatter = 3 * math.hypot(found.std(ddof=1), right.std(ddof=1)) / math.sqrt(len(_STARTS))
        fine = off <= max(scene.accuracy, scatter / mean)
        return (Verdict.ACCURATE if fine else Verdict.INACCURATE), f"rms force off by {off:.2g}"

    return judge


_BOUNDLESS = 4.0  # times the largest rms of a good run


def _joint_rms(scene: PumpScene, joint: str, step: float) -> Array:
    """Rms of a joint's force over the second revolution, by start [N]; NaN of a failed run."""
    columns = {"crankpin": ("pin_x", "pin_y"), "wristpin": ("wrist_x", "wrist_y")}.get(
        joint, ("guide_y",)
    )
    turn = max(8, round(1 / scene.drive.speed / step))
    found = []
    for start in _STARTS:
        with np.errstate(all="ignore"):  # what is unstable overflows: that is the answer
            run = run_scene(scene, step=step, n_steps=2 * turn, start_angle=start)
            square = sum(run.force(name)[turn:] ** 2 for name in columns)
        found.append(math.sqrt(np.mean(square)) if run.status.ok else math.nan)
    return np.array(found)


# --- pump: length of a pipe by step


def step_line(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Pulsation of the discharge pipe at its first frequency: step by length, both rungs of pipes.

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
    x = MapAxis(name="step", unit="s", values=_spread(guard / 10, guard * 10, n)).through(step)
    y = MapAxis(
        name="length of the discharge line",
        unit="m",
        values=_spread(line.length / 10, line.length * 10, n),
    ).through(line.length)
    crossed = Curve(
        name=f"guard: {FEWEST_REACHES} steps of travel",
        x=tuple(length / (FEWEST_REACHES * speed) for length in y.values),
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
_LEAST_PER_PERIOD = 3.0  # steps, to tell a frequency
_RINGING_AT = 1e7  # Pa, far from the vapour


def _line_pulsation(line: Line, rung: str, accuracy: float) -> Judge:
    def judge(step: float, length: float) -> Cell:
        bare = {"friction_factor": 0.0, "minor_loss": 0.0, "damper": None, "relief": None}
        smooth = line.model_copy(update={"length": length, **bare})
        assert smooth.wave_speed is not None
        exact = smooth.wave_speed / (4 * length)
        if step * exact * _LEAST_PER_PERIOD > 1:
            return Verdict.INACCURATE, "fewer than three steps a period: a rigid column"
        found = _ringing(smooth, step, math.ceil(_RUNG_PERIODS / (exact * step)), rung)
        off = abs(found / exact - 1)
        fine = off <= accuracy  # not so where it rings no more
        return (Verdict.ACCURATE if fine else Verdict.INACCURATE), f"frequency off by {off:.2g}"

    return judge


def _ringing(line: Line, step: float, n_steps: int, rung: str) -> float:
    """Frequency of a pipe whose flow is stopped, from upward zeros [Hz]; NaN where it is still."""
    pipes = pipe_parameters(
        line, Liquid(), far=_RINGING_AT, relief_back=0.0, step=step, waves=rung == "wave-lines"
    )
    states, nodes = pipe_start(pipes[0], 1e-3 * line.diameter**2)  # about 1 mm/s
    pressure, entering = np.zeros(n_steps), np.zeros(n_steps)
    drive_pipe(pipes, states, nodes, np.zeros(n_steps), step, pressure, entering)
    return _frequency(pressure - _RINGING_AT, step)


def _frequency(rest: Array, step: float) -> float:
    """Frequency of what swings about zero, from its zeros upward [Hz]; NaN of fewer than three."""
    up = np.flatnonzero((rest[:-1] < 0) & (rest[1:] >= 0))
    if len(up) < 3:
        return math.nan
    times = up - rest[up] / (rest[up + 1] - rest[up])
    return (len(times) - 1) / float((times[-1] - times[0]) * step)


# --- pump: a casing that yields


def step_casing(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Ring of a rigid mechanism with a casing that carries it: step by their masses.

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
    x = MapAxis(name="step", unit="s", values=_spread(0.05 / rate, 20 / rate, n)).through(step)
    y = MapAxis(
        name="casing at bearing over moving mass",
        unit="",
        values=_spread(own / 30, own * 30, n),
    ).through(own)
    return MapPlan(
        name="step-casing",
        title=f"ring of a casing of {mode:.4g} Hz with what it carries, step by their masses",
        x=x,
        y=y,
        judges={_YIELDING: _casing_judge(pump, mode)},
        curves={},
        note="frequency against that of both masses on the casing's spring, within "
        f"{scene.accuracy:.2g}; piston and rod held without play, on a crank that stands",
        own=Own(method=_YIELDING, x=step, y=own),
    )


_YIELDING = "mechanism in the frame of its bearing"
_GROWN = 1.5  # of a ring without damping, last over first: it grows


def _moving(scene: PumpScene) -> float:
    return scene.piston.mass + scene.rod.mass


def _casing_judge(scene: PumpScene, mode: float) -> Judge:
    def judge(step: float, ratio: float) -> Cell:
        exact = mode / math.sqrt(1 + 1 / ratio)
        if step * mode * _LEAST_PER_PERIOD > 1:
            return Verdict.INACCURATE, "fewer than three steps a period of the casing"
        force = _casing_ring(scene, mode, ratio, step, math.ceil(_RUNG_PERIODS / (exact * step)))
        quarter = len(force) // 4
        first, last = np.ptp(force[:quarter]), np.ptp(force[-quarter:])
        if not last < _GROWN * first:  # also where it is no number
            return Verdict.UNSTABLE, "grows"
        off = abs(_frequency(force - force.mean(), step) / exact - 1)
        fine = off <= scene.accuracy  # not so where too few periods are told
        return (Verdict.ACCURATE if fine else Verdict.INACCURATE), f"frequency off by {off:.2g}"

    return judge


def _casing_ring(scene: PumpScene, mode: float, ratio: float, step: float, least: int) -> Array:
    """Force of a rigid crank pin that stands at its dead centre, after a load set in [N]."""
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
    t, start = begun(rigid, step, 0.0)
    bodies = start.bodies.copy()
    bodies[:, 6:] = 0.0
    with np.errstate(all="ignore"):  # what is unstable overflows: that is the answer
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
_BEGUN = 8  # steps, of which the first have no past to be carried on


# --- pump: clearance by speed


def clearance_speed(scene: Scene, size: int | None = None) -> MapPlan | str:
    """The machine itself: contact lost, chaos, statuses, over speed and crank-pin clearance.

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
    if pump.joint.crankpin.rung != "compliant":
        return "the crank pin is not compliant; set joint.crankpin.rung = 'compliant'"
    n, gap = size or 9, pump.joint.crankpin.clearance_diametral
    if gap == 0:
        return "the crank pin has no clearance; set joint.crankpin.diametral_clearance"
    method = f"step of the scene, and a {_FINER}th"
    return MapPlan(
        name="clearance-speed",
        title="crank-pin clearance by speed, the scene otherwise as it is",
        x=MapAxis(
            name="speed", unit="Hz", values=_spread(pump.drive.speed / 4, 4 * pump.drive.speed, n)
        ).through(pump.drive.speed),
        y=MapAxis(
            name="diametral clearance", unit="m", values=_spread(gap / 30, gap * 10, n)
        ).through(gap),
        judges={method: lambda x, y: _pump_cell(pump, x, y)},
        note=f"status and contact, repeated at a {_FINER}th of the step; chaos: a clearance larger "
        "by 1e-9 parts the orbits by a thousandth of it",
        own=Own(method=method, x=pump.drive.speed, y=gap),
    )


def _pump_at(scene: PumpScene, speed: float, clearance: float) -> PumpScene:
    pin = {"diametral_clearance": clearance, "radial_clearance": None}
    values = {f"joint.crankpin.{name}": value for name, value in pin.items()}
    values |= {"drive.speed": speed, "duration": 2 / speed, "settling_revolutions": 1}
    return cast(PumpScene, changed(scene, values))


def _pump_cell(scene: PumpScene, speed: float, clearance: float) -> Cell:
    here = _pump_at(scene, speed, clearance)
    try:
        first = _run(here)
    except SceneError as error:
        return Verdict.REFUSED, error.faults[0]
    if not first.numerics:  # refused before the run
        return Verdict.REFUSED, f"{first.status.name.lower()}: {first.status.text}"
    finer = changed(here, {"numerics.step": float(first.numerics["step_s"]) / _FINER})
    again = _run(finer)
    if not first.status.ok:
        return _told_apart(first.status, again.status)
    if not again.status.ok:
        return Verdict.INACCURATE, f"a finer step ends with {again.status.name.lower()}"
    if _parts(here, first, clearance) and _parts(finer, again, clearance):
        return Verdict.CHAOTIC, f"in flight for {_flight(first, clearance):.1%} of the time"
    lost = _flight(first, clearance)
    if lost > 0 and _flight(again, clearance) > 0:
        return Verdict.LOST, f"in flight for {lost:.1%} of the time"
    off = abs(_pin_rms(first) / _pin_rms(again) - 1)
    return (
        Verdict.ACCURATE if off <= scene.accuracy else Verdict.INACCURATE
    ), f"rms force off by {off:.2g}"


def _told_apart(status: Status | OrbitStatus, finer: Status | OrbitStatus) -> Cell:
    """A failure that a finer run shows too is the machine's."""
    word = status.name.lower()
    return (Verdict.UNSTABLE if finer.ok else Verdict.FAILS), f"{word}: {status.text}"


def _run(scene: Scene) -> Recording:
    return simulate(scene, seed=0, truth=True, raise_on_failure=False)


def _parts(scene: PumpScene, run: Recording, clearance: float) -> bool:
    """Whether an unmeasurable change of the clearance parts the orbits."""
    near = _run(changed(scene, {"joint.crankpin.diametral_clearance": clearance * (1 + 1e-9)}))
    if not near.status.ok:
        return True
    apart = np.abs(near.truth["pin_offset_m"] - run.truth["pin_offset_m"]).max()
    return bool(apart > 1e-3 * clearance / 2)


def _flight(run: Recording, clearance: float) -> float:
    """Share of the samples at which the pin touches its eye nowhere."""
    return float(np.mean(np.hypot(*run.truth["pin_offset_m"].T) < clearance / 2))


def _pin_rms(run: Recording) -> float:
    return float(np.sqrt(np.mean(run.truth["pin_force_n"] ** 2)))


# --- journal: step by squeeze


def step_squeeze(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Integrators of the orbit about an equilibrium: step by how far out it lies.

    Parameters
    ----------
    scene : Scene
        A journal bearing.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    journal = cast(JournalScene, scene)
    case = _orbit_case(journal)
    n, step, gap = size or 13, orbit_step(journal), own_film(journal).gap
    x = MapAxis(name="step", unit="rad", values=_spread(1e-5, 1.0, n)).through(step)
    y = MapAxis(name=_GAP, unit="", values=_spread(0.01, 0.95, n)).through(gap)
    by_name = {stepper.name: stepper for stepper in STEPPERS}
    euler, runge = by_name["semi-implicit euler"], by_name["runge-kutta 4"]
    limits = {
        "euler": _squeeze_curve(case, y, euler),
        "rk4": _squeeze_curve(case, y, runge),
    }
    return MapPlan(
        name="step-squeeze",
        title=f"orbit about an equilibrium, film '{journal.film.rung}', step by gap",
        x=x,
        y=y,
        judges={
            "euler, no guard": _bare_judge(case, euler, scene.accuracy),
            "rk4, no guard": _bare_judge(case, runge, scene.accuracy),
            "euler": _guarded_judge(case, "euler", scene.accuracy),
            "rk4": _guarded_judge(case, "rk4", scene.accuracy),
            "adaptive": _guarded_judge(
                case, "adaptive", scene.accuracy, journal.numerics.tolerance
            ),
        },
        curves={
            **{f"{name}, no guard": [curve] for name, curve in limits.items()},
            **{name: [curve] for name, curve in limits.items()},
        },
        note="a displacement of a thousandth of the gap, followed within "
        f"{scene.accuracy:.2g} of it",
        own=Own(
            method=journal.numerics.integrator,
            x=step,
            y=gap,
            note="The step is the longest that it may take."
            if journal.numerics.integrator == "adaptive"
            else "",
        ),
    )


_GAP = "gap left, 1 - eccentricity ratio"


class _OrbitCase(NamedTuple):
    film: OrbitFilm
    alpha: float


def _orbit_case(scene: JournalScene) -> _OrbitCase:
    return _OrbitCase(film=journal_film(scene), alpha=journal_scale(scene).alpha)


def _rest_load(case: _OrbitCase, x: float) -> tuple[float, float]:
    """Load that holds the journal at (x, 0)."""
    f_x, f_y = film_force(case.film, x, 0.0, 0.0, 0.0)
    return -case.alpha * f_x, -case.alpha * f_y


def linear_film(case: _OrbitCase, x: float) -> tuple[Array, Array]:
    """Stiffness and damping over the inertia about (x, 0), by central differences."""
    matrix = np.empty((2, 4))
    for c in range(4):
        shift = 1e-5 * ((1 - x) if c < 2 else 1.0)
        ends = []
        for sign in (1.0, -1.0):
            state = [x, 0.0, 0.0, 0.0]
            state[c] += sign * shift
            ends.append(np.array(film_force(case.film, *state)))
        matrix[:, c] = -case.alpha * (ends[0] - ends[1]) / (2 * shift)
    return matrix[:, :2], matrix[:, 2:]


def growth(stepper: Stepper, stiffness: Array, damping: Array, step: float) -> float:
    """Factor by which a step of a stepper multiplies the largest motion of a linear film.

    Parameters
    ----------
    stepper : Stepper
        An explicit one.
    stiffness, damping : numpy.ndarray [shape=(2, 2)]
        Over the inertia.
    step : float

    Returns
    -------
    float
        Spectral radius of the step's matrix.

    Examples
    --------
    >>> from wearstate.diagnose.stability.steppers import STEPPERS
    >>> round(growth(STEPPERS[0], np.eye(2), np.zeros((2, 2)), 1.0), 6)
    1.0
    """
    return float(_growths(stepper, stiffness, damping, np.array([step]))[0])


def _growths(stepper: Stepper, stiffness: Array, damping: Array, steps: Array) -> Array:
    """Growth of each of many steps, as in :func:`growth`."""

    def acceleration(x: Array, v: Array) -> Array:
        return -(np.tensordot(stiffness, x, 1) + np.tensordot(damping, v, 1))

    unit = np.broadcast_to(np.eye(4)[:, :, None], (4, 4, len(steps)))
    x, v = stepper.step(unit[:2], unit[2:], acceleration, steps)
    matrices = np.moveaxis(np.concatenate([x, v]), 2, 0)
    largest: Array = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
    return largest


def squeeze_limit(case: _OrbitCase, x: float, stepper: Stepper) -> float:
    """Step from which on a stepper is unstable by itself on the film about (x, 0) [rad].

    Where the film whirls by itself a step of any length grows; the limit is where the growth of a
    step passes that of the motion itself by a hundredth, half a per cent beyond 2 over the damping.
    """
    stiffness, damping = linear_film(case, x)
    own = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), -np.hstack([stiffness, damping])])
    rate = max(0.0, float(np.linalg.eigvals(own).real.max()))
    for steps in np.split(np.geomspace(1e-5, 10.0, 2000), 20):  # mostly found in an early one
        allowed = 1.01 * np.exp(rate * steps)
        over = steps[_growths(stepper, stiffness, damping, steps) > allowed]
        if len(over):
            return float(over[0])
    return math.inf


def _squeeze_curve(case: _OrbitCase, y: MapAxis, stepper: Stepper) -> Curve:
    gaps = np.geomspace(y.values[0] / 2, 0.999, 60)
    limits = [squeeze_limit(case, 1 - float(gap), stepper) for gap in gaps]
    return Curve(
        name="limit in theory, film linear", x=tuple(limits), y=tuple(float(gap) for gap in gaps)
    )


_FEWEST, _MOST = 60, 400  # steps of a run beside an equilibrium
_AWAY = 1e-3  # of the gap


def _reference(case: _OrbitCase, step: float, gap: float) -> OrbitRun:
    n = _steps_for(step)
    return run_orbit(
        case.film,
        load(alpha=case.alpha, static=_rest_load(case, 1 - gap)),
        duration=n * step,
        start=(1 - gap + _AWAY * gap, 0.0),
        step=min(step, 0.01),
        sample_step=step,
        tolerance=1e-9,
    )


def _steps_for(step: float) -> int:
    return int(np.clip(2 * math.pi / step, _FEWEST, _MOST))


def _bare_judge(case: _OrbitCase, stepper: Stepper, accuracy: float) -> Judge:
    """A classical stepper on the film itself, with nothing to stop it."""

    def judge(step: float, gap: float) -> Cell:
        q_x, q_y = _rest_load(case, 1 - gap)

        def acceleration(x: Array, v: Array) -> Array:
            f_x, f_y = film_force(case.film, x[0], x[1], v[0], v[1])
            return np.array([case.alpha * f_x + q_x, case.alpha * f_y + q_y])

        x, v, h = np.array([1 - gap + _AWAY * gap, 0.0]), np.zeros(2), np.asarray(step)
        path = [x]
        for _ in range(_steps_for(step)):
            x, v = stepper.step(x, v, acceleration, h)
            path.append(x)
            if not np.hypot(*x) < 1:
                break
        return _orbit_cell(np.array(path), _reference(case, step, gap), gap, accuracy)

    return judge


def _guarded_judge(
    case: _OrbitCase, integrator: str, accuracy: float, tolerance: float = 1e-5
) -> Judge:
    """An integrator as a recording uses it."""

    def judge(step: float, gap: float) -> Cell:
        n = _steps_for(step)
        run = run_orbit(
            case.film,
            load(alpha=case.alpha, static=_rest_load(case, 1 - gap)),
            duration=n * step,
            start=(1 - gap + _AWAY * gap, 0.0),
            integrator=integrator,
            step=step,
            tolerance=tolerance,
        )
        if run.status is OrbitStatus.STEP:
            return Verdict.REFUSED, f"step: {run.status.text}"
        return _orbit_cell(run.position, _reference(case, step, gap), gap, accuracy, run.status)

    return judge


def _orbit_cell(
    path: Array,
    reference: OrbitRun,
    gap: float,
    accuracy: float,
    status: OrbitStatus = OrbitStatus.OK,
) -> Cell:
    if not reference.status.ok:
        return Verdict.FAILS, f"{reference.status.name.lower()}: {reference.status.text}"
    if not status.ok or len(path) < len(reference.position):
        return Verdict.UNSTABLE, status.name.lower() if not status.ok else "leaves the bore"
    away = np.hypot(*(path[: len(reference.position)] - reference.position).T).max()
    size = np.hypot(*(reference.position - [1 - gap, 0.0]).T).max()
    if not away < 2 * size:  # two motions that both stay within the displacement part by no more
        return Verdict.UNSTABLE, "grows"
    verdict = Verdict.ACCURATE if away <= accuracy * size else Verdict.INACCURATE
    return verdict, f"off by {away / size:.2g} of the displacement"


# --- journal: speed by load


def speed_load(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Whirl: what a displaced journal does at each speed and load, with the linear threshold.

    Parameters
    ----------
    scene : Scene
        A journal bearing.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    journal = cast(JournalScene, scene)
    n, weight = size or 11, journal_weight(journal)
    if not weight > 0:
        return "nothing rests on the journal; set load.static, in newtons"
    x = MapAxis(
        name="speed", unit="Hz", values=_spread(journal.drive.speed / 4, 8 * journal.drive.speed, n)
    ).through(journal.drive.speed)
    y = MapAxis(name="load", unit="N", values=_spread(weight / 30, weight * 10, n)).through(weight)
    numerics = journal.numerics
    own = f"{numerics.integrator}, as written"
    settings: dict[str, tuple[str, float, float]] = {
        own: (numerics.integrator, orbit_step(journal), numerics.tolerance)
    }
    settings |= {name: setting for name, setting in _SETTINGS.items() if setting != settings[own]}
    return MapPlan(
        name="speed-load",
        title=f"whirl over speed and load, film '{journal.film.rung}'",
        x=x,
        y=y,
        judges={name: _whirl_judge(journal, *setting) for name, setting in settings.items()},
        curves={"": [threshold_curve(journal, x, y)]},
        note="a displacement of a hundredth of the gap dies out or grows; the adaptive integrator "
        "at a hundredth of its tolerance decides what is right",
        own=Own(method=own, x=journal.drive.speed, y=weight),
    )


_SETTINGS = {
    "adaptive": ("adaptive", JOURNAL_STEP, 1e-5),
    "rk4, step 0.02": ("rk4", 0.02, 1e-5),
    "euler, step 0.02": ("euler", 0.02, 1e-5),
    "euler, step 0.2": ("euler", 0.2, 1e-5),
}
"""Integrator, longest step [rad] and tolerance of the panels beside that of the scene."""


def at_load(scene: JournalScene, speed: float, weight: float) -> JournalScene:
    """Scene at a speed [Hz] and a steady load along X [N]."""
    values = {"drive.speed": speed, "load.static": weight - scene.rotor.mass * scene.gravity}
    return cast(JournalScene, changed(scene, values))


def threshold_curve(scene: JournalScene, x: MapAxis, y: MapAxis) -> Curve:
    """Speeds at which the equilibrium of each load loses its stability, by its coefficients."""
    points = []
    for weight in np.geomspace(y.values[0] / 1.2, y.values[-1] * 1.2, 40):
        speed = threshold_speed(scene, float(weight), x.values[0] / 2, 2 * x.values[-1])
        if math.isfinite(speed):
            points.append((speed, float(weight)))
    return Curve(
        name="threshold of whirl, linear theory", x=_column(points, 0), y=_column(points, 1)
    )


def threshold_speed(scene: JournalScene, weight: float, low: float, high: float) -> float:
    """Speed at which the equilibrium under a load loses its stability [Hz]; NaN where none does.

    Parameters
    ----------
    scene : JournalScene
    weight : float
        Steady load along X [N].
    low, high : float
        Between which it is looked for [Hz].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("journal-whirl")
    >>> round(60 * threshold_speed(scene, 257.74 * 9.80665, 20.0, 200.0), -1)
    4910.0
    """
    margins = {each: _margin(scene, weight, each) for each in (low, high)}
    if margins[low] >= 0 or margins[high] <= 0:
        return math.nan

    def beyond(speed: float) -> float:
        """Margin, where endless cut to a number: an end of a bracket all the same."""
        margin = margins[speed] if speed in margins else _margin(scene, weight, speed)
        return float(np.clip(margin, -_FAR, _FAR))

    return float(brentq(beyond, low, high, xtol=1e-6 * low))


_FAR = 5.0  # e^5 of the threshold's mass: no root is near


def _margin(scene: JournalScene, weight: float, speed: float) -> float:
    """Logarithm of the rotor's mass over that at the threshold: above zero it whirls."""
    here = at_load(scene, speed, weight)
    scale = journal_scale(here)
    unit = scale.alpha * scale.force
    rung = "short" if scene.film.rung == "short" else "direct"
    try:
        found = equilibrium(film_geometry(here), (weight / unit, 0.0), rung=rung)
    except BearingError:
        return -math.inf  # too slow to carry the load: the journal lies on its shell
    limit = whirl(found).threshold.mass
    if limit == 0:
        return math.inf
    return math.log(scale.force / weight / limit) if math.isfinite(limit) else -math.inf


def _whirl_judge(
    scene: JournalScene, integrator: str, step: float, tolerance: float = 1e-5
) -> Judge:
    def judge(speed: float, weight: float) -> Cell:
        true, word = whirls(scene, speed, weight)
        if true is None:
            return Verdict.FAILS, word
        told, word = whirls(
            scene, speed, weight, integrator=integrator, step=step, tolerance=tolerance
        )
        if told is None:
            status = word.partition(":")[0]
            return (Verdict.REFUSED if status == "step" else Verdict.UNSTABLE), word
        if told != true:
            return Verdict.INACCURATE, f"says that it {'grows' if told else 'dies out'}"
        return (Verdict.WHIRL if true else Verdict.ACCURATE), word

    return judge


_WATCH = 160.0  # rad; a motion at half the speed turns a dozen times


def whirls(
    scene: JournalScene,
    speed: float,
    weight: float,
    *,
    integrator: str = "adaptive",
    step: float = 0.02,
    tolerance: float = 1e-7,
    watch: float = _WATCH,
) -> tuple[bool | None, str]:
    """Whether a small displacement from the equilibrium grows.

    Parameters
    ----------
    scene : JournalScene
    speed, weight : float
        [Hz], steady load along X [N].
    integrator : str
        Of the orbit.
    step, tolerance : float
        Of the integrator.
    watch : float
        How long the motion is followed [rad].

    Returns
    -------
    bool or None
        None where no equilibrium was found or the run failed.
    str
        Status, or the ratio of the motion late in the run to that at its begin.
    """
    here = at_load(scene, speed, weight)
    scale, film = journal_scale(here), journal_film(here)
    unit = scale.alpha * scale.force
    rung = "short" if scene.film.rung == "short" else "direct"
    try:
        rest = equilibrium(film_geometry(here), (weight / unit, 0.0), rung=rung)
    except BearingError as error:
        return None, f"{error.status.name.lower()}: {error.status.text}"
    place = rest.position * (1 - 0.01 * (1 / rest.eccentricity_ratio - 1))
    run = run_orbit(
        film,
        load(alpha=scale.alpha, static=(weight / scale.force, 0.0)),
        duration=watch,
        start=(float(place[0]), float(place[1])),
        integrator=integrator,
        step=step,
        sample_step=0.2,
        tolerance=tolerance,
    )
    if run.status in (OrbitStatus.THIN, OrbitStatus.CONTACT):  # from beside its equilibrium
        return True, f"grows to the wall: {run.status.text}"
    if not run.status.ok:
        return None, f"{run.status.name.lower()}: {run.status.text}"
    turn = round(4 * math.pi / 0.2)  # of a motion at half the speed
    early = float(np.ptp(run.position[turn : 3 * turn], axis=0).max())
    late = float(np.ptp(run.position[-2 * turn :], axis=0).max())
    ratio = late / early if early > 0 else 0.0
    # what has died out to the tolerance neither grows nor shrinks
    return bool(ratio > 1 and late > 1e-6), f"late motion {ratio:.2g} of the early"


# --- films


def _film_method(scene: Scene) -> str:
    """Panel of the solver of a scene's film: maps are drawn from direct solves."""
    return "short" if isinstance(scene, JournalScene) and scene.film.rung == "short" else "direct"


def _meshed(geometry: FilmGeometry, n_theta: int, n_z: int | None = None) -> FilmGeometry:
    """The same film on another mesh, a quarter as many nodes over the length if not told."""
    return FilmGeometry(
        length_to_diameter=geometry.length_to_diameter,
        n_theta=n_theta,
        n_z=n_z or max(5, n_theta // 4 | 1),
        condition=geometry.condition,
    )


_FINE = (432, 65)  # nodes of the film that decides what is right
_SWEEPS = 6000
_RUNG = {rung.name: rung for rung in FILM_RUNGS}


def eccentricity_mesh(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Solvers of the film over mesh and eccentricity.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, of which the aftmost bearing is taken.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    geometry = plain_film(scene)
    n, own = size or 10, own_film(scene)
    nodes = sorted({2 * round(value / 2) for value in np.geomspace(12, 216, n)})
    gaps = _spread(0.004, 0.9, n)

    @cache
    def reference(gap: float) -> FilmSolution:
        return solve_direct(_meshed(geometry, *_FINE), FilmState(x=1 - gap, y=0.0))

    def judge_of(solve: Callable[..., FilmSolution]) -> Judge:
        def judge(n_theta: float, gap: float) -> Cell:
            mesh = _meshed(geometry, round(n_theta))
            return _film_cell(
                solve(mesh, FilmState(x=1 - gap, y=0.0)), reference(gap), scene.accuracy
            )

        return judge

    return MapPlan(
        name="eccentricity-mesh",
        title=f"solvers of the film, L/D {geometry.length_to_diameter:.2g}, eccentricity by mesh",
        x=_nodes(nodes).through(geometry.n_theta),
        y=MapAxis(name=_GAP, unit="", values=gaps).through(own.gap),
        judges={
            "direct": judge_of(solve_direct),
            f"over-relaxed, {PAPER_RELAXATION}": judge_of(_relaxed),
            "over-relaxed, 1.5": judge_of(lambda mesh, at: _relaxed(mesh, at, 1.5)),
            "finite": judge_of(_RUNG["finite"].field),
            "short": judge_of(_RUNG["short"].field),
        },
        curves={"": [_cells_curve(gaps)]},
        note=f"force within {scene.accuracy:.2g} of a direct solve on {_FINE[0]} x {_FINE[1]} "
        "nodes",
        own=Own(method=_film_method(scene), x=float(geometry.n_theta), y=own.gap, note=own.note),
        aside=isinstance(scene, ShaftScene),
    )


def _nodes(values: Sequence[int]) -> MapAxis:
    return MapAxis(
        name="mesh, nodes round the circle",
        unit="",
        values=tuple(float(v) for v in values),
        even=True,
    )


def _relaxed(
    mesh: FilmGeometry, state: FilmState, relaxation: float = PAPER_RELAXATION
) -> FilmSolution:
    return solve_relaxed(mesh, state, relaxation=relaxation, most_sweeps=_SWEEPS)


def _cells_curve(gaps: tuple[float, ...]) -> Curve:
    """Mesh with as many nodes in the narrow gap as the guard asks for."""
    y = [float(gap) for gap in np.geomspace(gaps[0] / 2, 0.45, 60)]
    x = [LEAST_CELLS * math.pi / math.acos(1 - gap / (1 - gap)) for gap in y]
    return Curve(name="guard: nodes in the narrow gap", x=tuple(x), y=tuple(y))


_FILM_VERDICT = {
    FilmStatus.COARSE: Verdict.REFUSED,
    FilmStatus.TOUCH: Verdict.FAILS,
    FilmStatus.DIVERGED: Verdict.UNSTABLE,
}


def _film_cell(found: FilmSolution, reference: FilmSolution, accuracy: float) -> Cell:
    if found.status is not FilmStatus.OK:
        verdict = _FILM_VERDICT.get(found.status, Verdict.NOT_CONVERGED)
        return verdict, f"{found.status.name.lower()}: {found.status.value}"
    off = float(np.hypot(*(found.force - reference.force)) / np.hypot(*reference.force))
    return (Verdict.ACCURATE if off <= accuracy else Verdict.INACCURATE), f"force off by {off:.2g}"


def relaxation_mesh(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Over-relaxation over its factor and the mesh.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, of which the aftmost bearing is taken.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    geometry = plain_film(scene)
    n = size or 16
    factors = tuple(float(value) for value in np.linspace(0.9, 2.4, n))
    nodes = sorted({2 * round(value / 2) for value in np.geomspace(16, 128, max(4, n // 2))})

    def judge_of(eccentricity: float) -> Judge:
        state = FilmState(x=eccentricity, y=0.0)

        @cache
        def reference(n_theta: int) -> FilmSolution:
            return solve_direct(_meshed(geometry, n_theta), state)

        def judge(factor: float, n_theta: float) -> Cell:
            mesh = _meshed(geometry, round(n_theta))
            found = solve_relaxed(mesh, state, relaxation=factor, most_sweeps=_SWEEPS)
            return _film_cell(found, reference(round(n_theta)), 1e-2)

        return judge

    eccentricities = (0.2, 0.6, 0.9)
    own = 1 - (own_film(scene).gap or 0.4)
    nearest = min(eccentricities, key=lambda e: abs(e - own))
    lines = [
        ("limit in theory: 2", 2.0),
        (f"the paper's factor: {PAPER_RELAXATION}", PAPER_RELAXATION),
    ]
    return MapPlan(
        name="relaxation-mesh",
        title=f"projected over-relaxation, L/D {geometry.length_to_diameter:.2g}, factor by mesh",
        x=MapAxis(name="relaxation factor", unit="", values=factors, log=False),
        y=_nodes(nodes).through(geometry.n_theta),
        judges={f"eccentricity {e:g}": judge_of(e) for e in eccentricities},
        curves={"": [Curve(name=name, x=(at, at), y=(1.0, 1000.0)) for name, at in lines]},
        note=f"force within 0.01 of a direct solve on the same mesh, within {_SWEEPS} sweeps",
        own=Own(
            method=f"eccentricity {nearest:g}",
            x=None,
            y=float(geometry.n_theta),
            note="No scene relaxes its film: this is the source paper's method.",
        ),
        aside=True,
    )


def length_load(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Rungs of the film over the bearing's length and its load.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, of which the aftmost bearing is taken.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    geometry, own = plain_film(scene), own_film(scene)
    n = size or 10

    @cache
    def reference(ratio: float, number: float) -> Any:
        fine = FilmGeometry(
            length_to_diameter=ratio, n_theta=216, n_z=33, condition=geometry.condition
        )
        return equilibrium(fine, _per_sommerfeld(number), raise_on_failure=False)

    def judge_of(rung: str) -> Judge:
        def judge(ratio: float, number: float) -> Cell:
            mesh = FilmGeometry(
                length_to_diameter=ratio,
                n_theta=geometry.n_theta,
                n_z=geometry.n_z,
                condition=geometry.condition,
            )
            found = equilibrium(mesh, _per_sommerfeld(number), rung=rung, raise_on_failure=False)
            return _rest_cell(found, reference(ratio, number), scene.accuracy)

        return judge

    return MapPlan(
        name="length-load",
        title=f"rungs of the film on {geometry.n_theta} x {geometry.n_z} nodes, load by length",
        x=MapAxis(name="L/D", unit="", values=_spread(0.1, 6.0, n)).through(
            geometry.length_to_diameter
        ),
        y=MapAxis(
            name="Sommerfeld number (light load: large)", unit="", values=_spread(0.003, 10.0, n)
        ).through(own.sommerfeld),
        judges={rung: judge_of(rung) for rung in ("short", "finite", "long", "direct")},
        note=f"least film within {scene.accuracy:.2g} of a direct solve on 216 x 33 nodes",
        own=Own(
            method=_film_method(scene),
            x=geometry.length_to_diameter,
            y=own.sommerfeld,
            note=own.note,
        ),
        aside=isinstance(scene, ShaftScene),
    )


def _per_sommerfeld(number: float) -> tuple[float, float]:
    """Load over ``eta omega R^3 L / C^2``."""
    return sommerfeld_number(number), 0.0


def _rest_cell(found: Any, reference: Any, accuracy: float) -> Cell:
    status = found.status
    word = f"{status.name.lower()}: {status.text}"
    if status is BearingStatus.COARSE:
        return Verdict.REFUSED, word
    if not reference.status.ok:
        return Verdict.FAILS, f"{reference.status.name.lower()}: {reference.status.text}"
    if not status.ok:
        return Verdict.NOT_CONVERGED, word
    off = abs((1 - found.eccentricity_ratio) / (1 - reference.eccentricity_ratio) - 1)
    return (
        Verdict.ACCURATE if off <= accuracy else Verdict.INACCURATE
    ), f"least film off by {off:.2g}"


# --- shaft line


_LINE_PHYSICAL = {Status.LINE_UNSTABLE: Verdict.WHIRL}
_LINE_METHOD = {
    Status.LINE_BALANCE: Verdict.NOT_CONVERGED,
    Status.LINE_COARSE: Verdict.REFUSED,
    Status.LINE_MOTION: Verdict.REFUSED,
}


def speed_viscosity(scene: Scene, size: int | None = None) -> MapPlan | str:
    """A shaft line on its films: whirl, edge contact and overload over speed and viscosity.

    Parameters
    ----------
    scene : Scene
        A shaft line.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    shaft = cast(ShaftScene, scene)
    n, viscosity = size or 11, shaft.oil.dynamic_viscosity
    meshes = dict.fromkeys([(shaft.film.n_theta, shaft.film.n_z), (24, 7)])
    return MapPlan(
        name="speed-viscosity",
        title=f"the line on its films, '{shaft.film.rung}', viscosity by speed",
        x=MapAxis(
            name="speed",
            unit="Hz",
            values=_spread(shaft.drive.speed / 30, 10 * shaft.drive.speed, n),
        ).through(shaft.drive.speed),
        y=MapAxis(
            name="viscosity", unit="Pa s", values=_spread(viscosity / 30, viscosity * 10, n)
        ).through(viscosity),
        judges={_mesh_name(*mesh): _line_judge(shaft, *mesh) for mesh in meshes},
        note="status, and least film against a mesh of twice the nodes in both directions; a "
        "failure is physical where twice the nodes round the bore fail too",
        own=Own(
            method=_mesh_name(shaft.film.n_theta, shaft.film.n_z), x=shaft.drive.speed, y=viscosity
        ),
    )


def _mesh_name(n_theta: int, n_z: int) -> str:
    return f"{n_theta} x {n_z} nodes"


def _line_at(
    scene: ShaftScene, speed: float, viscosity: float, mesh: tuple[int, int]
) -> ShaftScene:
    values = {"drive.speed": speed, "duration": 2 / speed, "oil": Oil(viscosity=viscosity)}
    values |= {"film.n_theta": mesh[0], "film.n_z": mesh[1]}
    # enough for the orders of the forces; more would ask for a finer beam
    values |= {"sample_rate": max(scene.sample_rate, 40 * speed), "tacho": None}
    return cast(ShaftScene, changed(scene, values))


def _line_judge(scene: ShaftScene, n_theta: int, n_z: int) -> Judge:
    def judge(speed: float, viscosity: float) -> Cell:
        try:
            found = _run(_line_at(scene, speed, viscosity, (n_theta, n_z)))
        except SceneError as error:
            return Verdict.REFUSED, error.faults[0]
        word = f"{found.status.name.lower()}: {found.status.text}"
        if found.status in _LINE_METHOD:
            return _LINE_METHOD[found.status], word
        # a failed search has refined its meshes along the length by itself: round the bore is left
        along = 2 * n_z - 1 if found.status.ok else n_z
        finer = _run(_line_at(scene, speed, viscosity, (2 * n_theta, along)))
        if not found.status.ok:
            if finer.status.ok:
                return Verdict.INACCURATE, f"a finer mesh removes {word}"
            return _LINE_PHYSICAL.get(found.status, Verdict.FAILS), word
        if not finer.status.ok:
            return Verdict.INACCURATE, f"a finer mesh ends with {finer.status.name.lower()}"
        off = abs(float(found.numerics["min_film_m"]) / float(finer.numerics["min_film_m"]) - 1)
        fine = off <= scene.accuracy
        return (Verdict.ACCURATE if fine else Verdict.INACCURATE), f"least film off by {off:.2g}"

    return judge


_FILMS: dict[str, Maker] = {
    "eccentricity-mesh": eccentricity_mesh,
    "relaxation-mesh": relaxation_mesh,
    "length-load": length_load,
}

MAPS: dict[str, dict[str, Maker]] = {
    "reciprocating-pump": {
        "step-stiffness": step_stiffness,
        "clearance-speed": clearance_speed,
        "step-line": step_line,
        "step-casing": step_casing,
    },
    "journal-bearing": {"step-squeeze": step_squeeze, "speed-load": speed_load, **_FILMS},
    "propulsion-shaft": {"speed-viscosity": speed_viscosity, **_FILMS},
}
"""Machine -> its maps. A new one is one row."""
