"""Maps of a journal's orbit: step by squeeze stiffness of the film, whirl over speed and load."""

import math
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ...sim.bearing.bearing_status import BearingError
from ...sim.bearing.equilibrium import equilibrium
from ...sim.bearing.whirl import whirl
from ...sim.journal.load import load
from ...sim.journal.orbit import OrbitRun, run_orbit
from ...sim.journal.orbit_film import OrbitFilm, film_force
from ...sim.journal.orbit_status import OrbitStatus
from ...sim.journal.recording import film_geometry, journal_film, journal_scale
from ...sim.journal.validity import JOURNAL_STEP
from ...sim.scene.journal import JournalScene
from ...sim.scene.scene import Scene
from .method_map import Cell, Curve, Judge, MapAxis, MapPlan, Own, Verdict, coordinates, ratio_axis
from .own_point import GAP_LEFT, changed, journal_weight, orbit_step, own_film, status_words
from .steppers import STEPPERS, Stepper

Array = NDArray[np.float64]

# --- journal: step by squeeze


def step_squeeze(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Integrators of the orbit about an equilibrium: step by remaining gap.

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
    x = ratio_axis("step", "rad", 1e-5, 1.0, n, own=step)
    y = ratio_axis(GAP_LEFT, "", 0.01, 0.95, n, own=gap)
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
        note="motion after a displacement of a thousandth of the gap, followed within "
        f"{scene.accuracy:.2g} of it",
        own=Own(
            method=journal.numerics.integrator,
            x=step,
            y=gap,
            note="The step is the longest allowed step."
            if journal.numerics.integrator == "adaptive"
            else "",
        ),
    )


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
    """Largest growth factor of one step of a stepper on a linear film.

    Parameters
    ----------
    stepper : Stepper
        An explicit stepper.
    stiffness, damping : numpy.ndarray [shape=(2, 2)]
        Stiffness and damping over the inertia.
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
    """Step from which a stepper itself is unstable on the film about (x, 0) [rad].

    If the film whirls, motion grows at any step. The limit is therefore where the growth per step
    exceeds that of the motion itself by 1 %, half a per cent beyond 2 over the damping.
    """
    stiffness, damping = linear_film(case, x)
    own = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), -np.hstack([stiffness, damping])])
    rate = max(0.0, float(np.linalg.eigvals(own).real.max()))
    for steps in np.split(np.geomspace(1e-5, 10.0, 2000), 20):  # usually found in an early part
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


_FEWEST, _MOST = 60, 400  # steps of a run near an equilibrium
_AWAY = 1e-3  # initial displacement, over the gap


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
    """Judge of a classical stepper on the film itself, without guards."""

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
    """Judge of an integrator as used for recordings."""

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
        return Verdict.FAILS, status_words(reference.status)
    if not status.ok or len(path) < len(reference.position):
        return Verdict.UNSTABLE, status.name.lower() if not status.ok else "leaves the bore"
    away = np.hypot(*(path[: len(reference.position)] - reference.position).T).max()
    size = np.hypot(*(reference.position - [1 - gap, 0.0]).T).max()
    if not away < 2 * size:  # largest distance of two motions within the displacement
        return Verdict.UNSTABLE, "grows"
    verdict = Verdict.ACCURATE if away <= accuracy * size else Verdict.INACCURATE
    return verdict, f"off by {away / size:.2g} of the displacement"


# --- journal: speed by load


def speed_load(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Whirl of a displaced journal over speed and load, with the linear threshold.

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
    n, speed, weight = size or 11, journal.drive.speed, journal_weight(journal)
    if not weight > 0:
        return "the journal carries no load; set load.static, in newtons"
    x = ratio_axis("speed", "Hz", speed / 4, 8 * speed, n, own=speed)
    y = ratio_axis("load", "N", weight / 30, weight * 10, n, own=weight)
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
        note="a displacement of a hundredth of the gap decays or grows; the reference is the "
        "adaptive integrator at a hundredth of its tolerance",
        own=Own(method=own, x=speed, y=weight),
    )


_SETTINGS = {
    "adaptive": ("adaptive", JOURNAL_STEP, 1e-5),
    "rk4, step 0.02": ("rk4", 0.02, 1e-5),
    "euler, step 0.02": ("euler", 0.02, 1e-5),
    "euler, step 0.2": ("euler", 0.2, 1e-5),
}
"""Integrator, longest step [rad] and tolerance of the panels in addition to that of the scene."""


def at_load(scene: JournalScene, speed: float, weight: float) -> JournalScene:
    """Scene at a speed [Hz] and a steady load along X [N]."""
    values = {"drive.speed": speed, "load.static": weight - scene.rotor.mass * scene.gravity}
    return cast(JournalScene, changed(scene, values))


def threshold_curve(scene: JournalScene, x: MapAxis, y: MapAxis) -> Curve:
    """Speeds at which the equilibrium of each load loses stability, from linear coefficients."""
    points = []
    for weight in np.geomspace(y.values[0] / 1.2, y.values[-1] * 1.2, 40):
        speed = threshold_speed(scene, float(weight), x.values[0] / 2, 2 * x.values[-1])
        if math.isfinite(speed):
            points.append((speed, float(weight)))
    return Curve(
        name="threshold of whirl, linear theory", x=coordinates(points, 0), y=coordinates(points, 1)
    )


def threshold_speed(scene: JournalScene, weight: float, low: float, high: float) -> float:
    """Speed at which the equilibrium under a load loses its stability [Hz]; NaN if none.

    Parameters
    ----------
    scene : JournalScene
    weight : float
        Steady load along X [N].
    low, high : float
        Bounds of the search [Hz].

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
        """Margin, with infinity replaced by a number, so that it can bound a bracket."""
        margin = margins[speed] if speed in margins else _margin(scene, weight, speed)
        return float(np.clip(margin, -_FAR, _FAR))

    return float(brentq(beyond, low, high, xtol=1e-6 * low))


_FAR = 5.0  # e^5 times the mass at the threshold: no root is near


def _margin(scene: JournalScene, weight: float, speed: float) -> float:
    """Logarithm of the rotor's mass over that at the threshold; whirl above zero."""
    here = at_load(scene, speed, weight)
    scale = journal_scale(here)
    unit = scale.alpha * scale.force
    rung = "short" if scene.film.rung == "short" else "direct"
    try:
        found = equilibrium(film_geometry(here), (weight / unit, 0.0), rung=rung)
    except BearingError:
        return -math.inf  # too slow to carry the load: the journal touches its shell
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
        judged, word = whirls(
            scene, speed, weight, integrator=integrator, step=step, tolerance=tolerance
        )
        if judged is None:
            status = word.partition(":")[0]
            return (Verdict.REFUSED if status == "step" else Verdict.UNSTABLE), word
        if judged != true:
            return Verdict.INACCURATE, f"wrongly {'grows' if judged else 'decays'}"
        return (Verdict.WHIRL if true else Verdict.ACCURATE), word

    return judge


_WATCH = 160.0  # rad; a dozen revolutions at half the speed


def whirls(
    scene: JournalScene,
    speed: float,
    weight: float,
    *,
    integrator: str = "adaptive",
    step: float = 0.02,
    tolerance: float = 1e-7,
) -> tuple[bool | None, str]:
    """Whether a small displacement from the equilibrium grows.

    Parameters
    ----------
    scene : JournalScene
    speed, weight : float
        Speed [Hz] and steady load along X [N].
    integrator : str
        Integrator of the orbit.
    step, tolerance : float
        Step [rad] and tolerance of the integrator.

    Returns
    -------
    bool or None
        None if no equilibrium was found or the run failed.
    str
        Status, or the ratio of late to early motion.
    """
    here = at_load(scene, speed, weight)
    scale, film = journal_scale(here), journal_film(here)
    unit = scale.alpha * scale.force
    rung = "short" if scene.film.rung == "short" else "direct"
    try:
        rest = equilibrium(film_geometry(here), (weight / unit, 0.0), rung=rung)
    except BearingError as error:
        return None, status_words(error.status)
    place = rest.position * (1 - 0.01 * (1 / rest.eccentricity_ratio - 1))
    run = run_orbit(
        film,
        load(alpha=scale.alpha, static=(weight / scale.force, 0.0)),
        duration=_WATCH,
        start=(float(place[0]), float(place[1])),
        integrator=integrator,
        step=step,
        sample_step=0.2,
        tolerance=tolerance,
    )
    if run.status in (OrbitStatus.THIN, OrbitStatus.CONTACT):  # from near its equilibrium
        return True, f"grows to the wall: {run.status.text}"
    if not run.status.ok:
        return None, status_words(run.status)
    turn = round(4 * math.pi / 0.2)  # samples per revolution at half the speed
    early = float(np.ptp(run.position[turn : 3 * turn], axis=0).max())
    late = float(np.ptp(run.position[-2 * turn :], axis=0).max())
    ratio = late / early if early > 0 else 0.0
    # a motion below the tolerance neither grows nor decays
    return bool(ratio > 1 and late > 1e-6), f"late motion {ratio:.2g} times the early motion"
