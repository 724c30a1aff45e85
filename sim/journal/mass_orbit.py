"""Journal in a mass-conserving film: the oil in the film depends on its history.

A force map depends only on the journal's position and velocity. This film has a memory: ruptured
parts are partly filled, oil from an end or a groove takes time to fill them, and until
then the gap carries less. The march is implicit in journal and film alike,

    X1 = X0 + h V1,   V1 = V0 + h (alpha F(X1, oil0) + q(tau1)),

with F from :func:`.film.mass_conserving.mass_step` over the same step h, so that no squeeze
stiffness limits the step. The position is found by Broyden's method; its Jacobian is kept from step
to step and computed anew by differences when convergence is poor.

Source of the problem: Ausas, Jai, Buscaglia (2009), J. Tribology 131(3), 031702. The coupled step
is derived here.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..brief import brief
from ..film.mass_conserving import EndPressure, MassStep, mass_step, oil_in_gap
from ..film.solve import FilmGeometry, FilmSolution, FilmState
from .load import Load, load_at
from .orbit_status import OrbitStatus

_SETTLED = 1e-7  # of the remaining gap: tolerance of the position at the end of a step
_MOST_TRIALS = 40  # film solutions per step
_STALE = 8  # trials after which the Jacobian is computed anew
_MOST_CLOSED = 0.7  # of the gap, from one trial to the next
_LEAST_GAP = 1e-6  # over C: far below the roughness of any bearing
_SPACING = 1e-5  # of the gap: spacing of a difference quotient


@dataclass(frozen=True, kw_only=True, eq=False)
class MassOrbit:
    """Path of a journal in a mass-conserving film.

    Attributes
    ----------
    tau : numpy.ndarray [shape=(n,)]
        Instants [rad].
    position, velocity : numpy.ndarray [shape=(n, 2)]
        Journal centre along X and Y over C, and its rates by tau.
    force : numpy.ndarray [shape=(n, 2)]
        Non-dimensional F on the journal; zero at the first instant, where no step ends.
    peak_pressure : numpy.ndarray [shape=(n,)]
        Largest P.
    filled : numpy.ndarray [shape=(n,)]
        Volume of oil over that of the gap.
    status : OrbitStatus
        How the run ended; the path ends there if it is not OK.
    films : int
        Number of film solutions.
    """

    tau: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    force: NDArray[np.float64]
    peak_pressure: NDArray[np.float64]
    filled: NDArray[np.float64]
    status: OrbitStatus
    films: int

    __repr__ = brief("tau", "position", "status")

    @property
    def eccentricity(self) -> NDArray[np.float64]:
        """Distance of the journal from the centre of its bearing over C [shape=(n,)]."""
        return np.hypot(self.position[:, 0], self.position[:, 1])


@dataclass(kw_only=True)
class _March:
    """State of journal and film, and the starting point of the next step."""

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    oil: NDArray[np.float64]
    film: FilmSolution | None
    jacobian: NDArray[np.float64] | None
    films: int


def mass_orbit(
    geometry: FilmGeometry,
    q: Load,
    *,
    duration: float,
    step: float,
    start: tuple[float, float] = (0.0, 0.0),
    start_velocity: tuple[float, float] = (0.0, 0.0),
    fill: float = 1.0,
    end_pressure: EndPressure = 0.0,
) -> MassOrbit:
    """Path of a journal under its load in a mass-conserving film.

    Parameters
    ----------
    geometry : FilmGeometry
        As in :func:`.film.mass_conserving.mass_step`; its condition must be ``"periodic"`` or
        ``"reynolds"``.
    q : Load
        From :func:`.orbit.load`.
    duration : float
        Shaft angle [rad], >= 0.
    step : float
        Shaft angle [rad], > 0. The method is of first order in the step.
    start, start_velocity : tuple of float
        Position of the journal over C, inside the clearance, and its rates by tau.
    fill : float
        Film fraction of the whole gap at the start, in [0, 1].
    end_pressure : float or (float, float)
        Non-dimensional pressure of both ends, or of either.

    Returns
    -------
    MassOrbit
        Path to the end, or as far as its status indicates.

    Raises
    ------
    ValueError
        All faults of the arguments together.

    References
    ----------
    .. [1] R. F. Ausas, M. Jai, G. C. Buscaglia, "A mass-conserving algorithm for dynamical
       lubrication problems with cavitation", J. Tribol. 131 (2009) 031702.

    Examples
    --------
    A journal under a steady load comes to rest where the steady film carries it:

    >>> from wearstate.sim.journal.load import load
    >>> bearing = FilmGeometry(length_to_diameter=0.5, n_theta=40, n_z=9, condition="reynolds")
    >>> run = mass_orbit(bearing, load(alpha=10.0, static=(5.0, 0.0)), duration=40.0, step=0.2)
    >>> run.status.text, run.position[-1].round(2).tolist(), round(run.filled[-1].item(), 2)
    ('done', [0.24, 0.39], 0.82)
    """
    _check(geometry, duration, step, start, fill)
    at_rest = FilmState(x=start[0], y=start[1])
    now = _March(
        position=np.array(start, dtype=np.float64),
        velocity=np.array(start_velocity, dtype=np.float64),
        oil=oil_in_gap(geometry, at_rest, fill),
        film=None,
        jacobian=None,
        films=0,
    )
    steps = int(duration / step * (1 + 1e-12))
    rows = np.zeros((steps + 1, 8))
    rows[0, :4] = *start, *start_velocity
    rows[0, 7] = fill
    status, done = OrbitStatus.OK, 0
    while done < steps and status.ok:
        status = _step(geometry, q, now, step * (done + 1), step, end_pressure, rows[done + 1])
        done += status.ok
    kept = rows[: done + 1]
    return MassOrbit(
        tau=step * np.arange(done + 1, dtype=np.float64),
        position=kept[:, :2],
        velocity=kept[:, 2:4],
        force=kept[:, 4:6],
        peak_pressure=kept[:, 6],
        filled=kept[:, 7],
        status=status,
        films=now.films,
    )


def _check(
    geometry: FilmGeometry, duration: float, step: float, start: tuple[float, float], fill: float
) -> None:
    wrong = []
    if geometry.condition == "guembel":
        wrong.append("geometry.condition = 'guembel' loses oil; use 'periodic' or 'reynolds'")
    if not 0 <= duration < math.inf:
        wrong.append(f"duration = {duration:g} rad must be >= 0 and finite")
    if not 0 < step < math.inf:
        wrong.append(f"step = {step:g} rad must be > 0 and finite")
    if not math.hypot(*start) < 1.0:
        wrong.append(f"start = {start} must lie inside the clearance circle of radius 1")
    if not 0 <= fill <= 1:
        wrong.append(f"fill = {fill:g} must be in [0, 1]")
    if wrong:
        raise ValueError("\n".join(wrong))


def _step(
    geometry: FilmGeometry,
    q: Load,
    now: _March,
    tau: float,
    h: float,
    end_pressure: EndPressure,
    row: NDArray[np.float64],
) -> OrbitStatus:
    """Take one step of journal and film; fill the row of its end."""
    coast = now.position + h * now.velocity + h * h * np.array(load_at(q, tau))
    place, miss, after = now.position.copy(), np.zeros(2), None
    trial, age = now.position + _held_back(now.position, h * now.velocity), 0

    def residual(at: NDArray[np.float64]) -> tuple[NDArray[np.float64], MassStep]:
        now.films += 1
        state = FilmState(x=float(at[0]), y=float(at[1]))
        film = mass_step(geometry, state, now.oil, h, now.film, end_pressure=end_pressure)
        return at - coast - h * h * q.alpha * film.solution.force, film

    for _ in range(_MOST_TRIALS):
        if 1.0 - math.hypot(*trial) < _LEAST_GAP:
            return OrbitStatus.CONTACT
        found, after = residual(trial)
        if not np.isfinite(found).all():
            return OrbitStatus.DIVERGED
        if age > 0 and now.jacobian is not None:
            moved = trial - place
            lack = found - miss - now.jacobian @ moved
            now.jacobian += np.outer(lack, moved) / float(moved @ moved)
        place, miss = trial, found
        if now.jacobian is None or age >= _STALE:
            spacing = _SPACING * (1.0 - math.hypot(*place))
            columns = [(residual(place + spacing * e)[0] - miss) / spacing for e in np.eye(2)]
            now.jacobian, age = np.column_stack(columns), 0
        step_back = np.asarray(np.linalg.solve(now.jacobian, miss), dtype=np.float64)
        move = _held_back(place, -step_back)
        if float(np.abs(move).max()) <= _SETTLED * (1.0 - math.hypot(*place)):
            break
        trial, age = place + move, age + 1
    else:
        return OrbitStatus.UNSETTLED
    now.velocity = (place - now.position) / h
    now.position, now.oil, now.film = place, after.oil, after.solution
    row[:2], row[2:4], row[4:6] = place, now.velocity, after.solution.force
    row[6] = after.solution.pressure.max()
    full = oil_in_gap(geometry, FilmState(x=float(place[0]), y=float(place[1])), 1.0)
    width = np.full(geometry.n_z, 1.0)
    width[[0, -1]] = 0.5
    row[7] = float((after.oil @ width).sum() / (full @ width).sum())
    return OrbitStatus.OK


def _held_back(place: NDArray[np.float64], move: NDArray[np.float64]) -> NDArray[np.float64]:
    """Limit a move so that some of the gap remains."""
    gap = 1.0 - math.hypot(*place)
    share = 1.0
    while 1.0 - math.hypot(*(place + share * move)) < (1.0 - _MOST_CLOSED) * gap:
        share *= 0.5
    return share * move
