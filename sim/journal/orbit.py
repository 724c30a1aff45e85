"""Time march of a journal, as a single mass, in any oil film that has a force.

With lengths over the radial clearance C and time ``tau = omega t``,

    X'' = alpha F_X + q_X(tau),  Y'' = alpha F_Y + q_Y(tau),  alpha = eta R^3 L / (M C^3 omega),

where F is the film's non-dimensional force and q the load over ``M C omega^2``: a constant (weight
``g / (C omega^2)`` and static load), an unbalance that rotates with the shaft (``u`` is the
eccentricity of the mass over C), and any history of time. The film is chosen by an integer code;
a wall may be added, a contact law that takes over where the film ends.

Three integrators. *euler*: velocity first, then position with the new velocity, at a fixed step,
as in the source paper (first order). *rk4*: the classical fourth-order method at a fixed step.
*adaptive*: the Rosenbrock method RODAS, order 4 with an embedded third, L-stable and stiffly
accurate, with an error-controlled step. The film is a damper whose strength grows with
``(1 - eccentricity)^(-5/2)``: it limits an explicit step wherever the journal comes near the
wall, and a run that violates the limit ends with a status.

Sources: Ma, Lu, Chen (2010), J. Vibration, Measurement & Diagnosis 30(1), 7-10; Hairer, Wanner
(1996), Solving Ordinary Differential Equations II, section IV.10 (RODAS and its coefficients).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..film.map_look_up import map_peak
from ..jit import kernel
from .load import Load, load_at
from .orbit_film import FILM_DIRECT, FILM_MAP, FILM_NONE, OrbitFilm, film_force
from .orbit_march import MarchSettings, Wall, march, no_wall
from .orbit_status import OrbitStatus
from .orbit_step import (
    ADAPTIVE,
    CALLS,
    EULER,
    REJECTED,
    RK4,
    RODAS,
    SAMPLE,
    STATE,
    STEPS,
    TAU,
    new_work,
)

INTEGRATORS = {"euler": EULER, "rk4": RK4, "adaptive": ADAPTIVE}
"""Name -> code: the paper's semi-implicit Euler, classical Runge-Kutta, RODAS."""

_STABLE = (2.0, 2.785, math.inf)  # step times damping, on the negative real axis


def _safe_eccentricity(film: OrbitFilm, alpha: float, step: float, stable: float) -> float:
    """Eccentricity up to which a fixed step is always stable; beyond it the march checks.

    The short film has the largest damping for its length, at most the squeeze of a full circle:
    ``4 (L/D)^2`` times the integral of ``cos^2 / H^3``, ``pi (1 + 2 eps^2) / (1 - eps^2)^2.5``.
    """
    if film.code == FILM_NONE:
        return math.inf
    squares = np.linspace(0.0, 1.0, 1001)[:-1] ** 2
    strength = 4 * math.pi * film.length_to_diameter**2 * alpha
    damping = strength * (1 + 2 * squares) / (1 - squares) ** 2.5
    last = int(np.searchsorted(step * damping, stable)) - 1
    return math.sqrt(squares[max(last, 0)])


@dataclass(frozen=True, kw_only=True, eq=False)
class OrbitRun:
    """A run of the journal.

    Attributes
    ----------
    tau : numpy.ndarray [shape=(n,)]
        Instants [rad].
    position, velocity : numpy.ndarray [shape=(n, 2)]
        Journal centre along X and Y over C, and its rates by tau.
    status : OrbitStatus
        How the run ended; the path ends there if it is not OK.
    end : float
        Last value of tau.
    steps, rejected, calls : int
        Steps taken, adaptive steps rejected, evaluations of the film.
    """

    tau: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    status: OrbitStatus
    end: float
    steps: int
    rejected: int
    calls: int

    @property
    def eccentricity(self) -> NDArray[np.float64]:
        """Distance of the journal from the centre of its bearing over C [shape=(n,)]."""
        return np.hypot(self.position[:, 0], self.position[:, 1])


def run_orbit(
    film: OrbitFilm,
    q: Load,
    *,
    duration: float,
    start: tuple[float, float] = (0.0, 0.0),
    start_velocity: tuple[float, float] = (0.0, 0.0),
    integrator: str = "adaptive",
    step: float = 0.02,
    sample_step: float | None = None,
    tolerance: float = 1e-5,
    max_steps: int = 10_000_000,
    wall: Wall | None = None,
) -> OrbitRun:
    """Path of the journal under its load.

    Parameters
    ----------
    film : Film
        From :func:`short_film`, :func:`map_film`, :func:`solved_film` or :func:`no_film`.
    q : Load
        From :func:`load`.
    duration : float
        Shaft angle [rad]; the last sample is at the last multiple of `sample_step` within.
    start, start_velocity : tuple of float
        Position of the journal over C, and its rates by tau.
    integrator : str
        One of :data:`INTEGRATORS`.
    step : float
        Fixed step, or the first of the adaptive integrator [rad].
    sample_step : float, optional
        Interval of the samples kept [rad]; by default `step`. A fixed step is shortened to divide
        it.
    tolerance : float
        Tolerance of one adaptive step: error of the position over the remaining gap, of the rates
        over gap plus speed.
    max_steps : int
        Largest number of adaptive steps.
    wall : Wall, optional
        Contact law at the wall; without it, the run ends there.

    Returns
    -------
    OrbitRun

    Raises
    ------
    ValueError
        All faults of the arguments together.

    Examples
    --------
    A journal that rests on its film, started in the centre:

    >>> from wearstate.sim.journal.load import load
    >>> from wearstate.sim.journal.orbit_film import short_film
    >>> run = run_orbit(short_film(0.25), load(alpha=10.0, static=(0.5, 0.0)), duration=200.0)
    >>> run.status.text, run.position[-1].round(3).tolist()
    ('done', [0.064, 0.217])
    """
    kept = step if sample_step is None else sample_step
    _check_run(film, duration, start, integrator, (step, kept, tolerance), wall)
    method = INTEGRATORS[integrator]
    fixed = step if method == ADAPTIVE else kept / math.ceil(kept / step * (1 - 1e-9))
    stable = _STABLE[method]
    safe = _safe_eccentricity(film, q.alpha, fixed, stable)
    settings = MarchSettings(method, fixed, tolerance, max_steps, kept, stable, safe)
    record = np.empty((int(duration / kept * (1 + 1e-12)) + 1, 4))
    work = new_work((*start, *start_velocity))
    code = march(film, q, no_wall() if wall is None else wall, settings, RODAS, work, record)
    status, filled, end = OrbitStatus(code), int(work.counts[SAMPLE]), float(work.clock[TAU])
    if status in (OrbitStatus.THIN, OrbitStatus.CONTACT) and _overloaded(
        film, q, work.y[STATE], end
    ):
        status = OrbitStatus.OVERLOAD
    return OrbitRun(
        tau=kept * np.arange(filled, dtype=np.float64),
        position=record[:filled, :2].copy(),
        velocity=record[:filled, 2:].copy(),
        status=status,
        end=end,
        steps=int(work.counts[STEPS]),
        rejected=int(work.counts[REJECTED]),
        calls=int(work.counts[CALLS]),
    )


def _check_run(
    film: OrbitFilm,
    duration: float,
    start: tuple[float, float],
    integrator: str,
    positive: tuple[float, float, float],
    wall: Wall | None,
) -> None:
    wrong = []
    if integrator not in INTEGRATORS:
        wrong.append(f"integrator = '{integrator}' must be one of {', '.join(INTEGRATORS)}")
    for name, value in zip(("step", "sample_step", "tolerance"), positive, strict=True):
        if not value > 0 or not math.isfinite(value):
            wrong.append(f"{name} = {value:g} must be > 0 and finite")
    if not duration >= 0 or not math.isfinite(duration):
        wrong.append(f"duration = {duration:g} rad must be >= 0 and finite")
    last = film.last_eccentricity if wall is None else math.inf
    if not math.hypot(*start) <= last:
        wrong.append(
            f"start = {start} has eccentricity {math.hypot(*start):.6g} and must lie within "
            f"{last:g}, the last of this film; start nearer to the centre"
        )
    if wrong:
        raise ValueError("\n".join(wrong))


def _overloaded(film: OrbitFilm, q: Load, state: NDArray[np.float64], tau: float) -> bool:
    """Whether the load exceeds, now and finally, the capacity of the film at its last eccentricity.

    Unbalance and orders are ignored, as they average out.
    """
    if film.code == FILM_NONE:
        return False
    place = state[:2] * (film.last_eccentricity / math.hypot(state[0], state[1]))
    capacity = q.alpha * math.hypot(*film_force(film, place[0], place[1], 0.0, 0.0))
    resting = q._replace(unbalance=0.0, orders=np.zeros((0, 4)))
    return all(math.hypot(*load_at(resting, t)) > capacity for t in (tau, q.time[-1]))


@kernel
def _trace(film: OrbitFilm, states: Any, trace: Any) -> None:
    for n in range(states.shape[0]):
        x, y, u, v = states[n, 0], states[n, 1], states[n, 2], states[n, 3]
        trace[n, 0], trace[n, 1] = film_force(film, x, y, u, v)
        peak = math.nan
        if film.code == FILM_MAP:
            peak = map_peak(film.table, x, y, u, v)
        elif film.code == FILM_DIRECT:
            peak = 0.0
            for i in range(film.work.pressure.shape[0]):
                for j in range(film.work.pressure.shape[1]):
                    peak = max(peak, film.work.pressure[i, j])
        trace[n, 2] = peak


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmTrace:
    """Film force and pressure along a run.

    Attributes
    ----------
    force : numpy.ndarray [shape=(n, 2)]
        Non-dimensional F on the journal.
    peak_pressure : numpy.ndarray [shape=(n,)] or None
        Largest non-dimensional P; None for films without a pressure.
    """

    force: NDArray[np.float64]
    peak_pressure: NDArray[np.float64] | None


def film_trace(film: OrbitFilm, run: OrbitRun) -> FilmTrace:
    """Force and largest pressure of the film at the samples of a run."""
    states = np.ascontiguousarray(np.hstack([run.position, run.velocity]))
    trace = np.empty((len(states), 3))
    _trace(film, states, trace)
    known = film.code in (FILM_MAP, FILM_DIRECT)
    return FilmTrace(force=trace[:, :2], peak_pressure=trace[:, 2] if known else None)
