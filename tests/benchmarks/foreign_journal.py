"""An independent journal bearing whose bore is as bearings are built; see `foreign.py`.

Reynolds' equation in finite differences over the whole bearing, with Reynolds' condition where the
film ruptures (Christopherson's projected over-relaxation); numpy, scipy and numba, nothing from
`wearstate.sim`. About the place of equilibrium the film's force is laid into a cubic polynomial of
displacement and velocity, least squares over 130 solutions within 1.6 times the orbit expected, and
the journal moves by

    M q'' = F(q, q') + W + U w^2 (cos(w t + p), sin(w t + p)),

by Runge and Kutta's fourth-order formula. Draws, run-out, probes and tacho are those of
`foreign_ross.py`; axes as there: X along the load, Y a quarter turn further in the direction of
rotation.

oval
    The split stands open: the bore is up to 30 um wider across the load than along it.
tilt
    The journal leans in the bearing by up to 0.3 mrad about either axis, less where a quarter of
    the clearance at the ends would be used up.
grooves
    Two axial grooves across the load, 15 to 30 degrees wide over four fifths of the length, fed at
    up to 1.5 bar.
warm
    Oil warms from where the film is widest to where it is thinnest, by what the shear there makes:
    its viscosity falls by up to half. What is noted is the viscosity at the supply.

Without them it is the library's bearing: round, plain, at one temperature. Mesh: 96 by 17; 144 by
25 moves the eccentricity by less than 0.003. All is simulated.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from foreign_casing import tacho
from foreign_records import Job, Program
from foreign_ross import (
    COLUMNS,
    DIAMETER,
    GRAVITY,
    JOURNAL,
    LENGTH,
    MASS,
    PULSE_WIDTH,
    SAMPLE_RATE,
    STEPS,
    Conditions,
    Journal,
    conditions_draw,
    journal_draw,
    probes,
)
from numba import njit

DIFFERENCES = ("oval", "tilt", "grooves", "warm")

N_THETA, N_Z = 96, 17
RADIUS = DIAMETER / 2
RELAXATION, SETTLED, MOST_SWEEPS = 1.75, 1e-6, 6000
THINNEST = 0.5e-6  # film below which nothing is solved [m]
SOLUTIONS, REACH = 130, 1.6  # of the cubic, over the orbit expected
SETTLING = 8.0  # revolutions
POWERS = np.array(
    [
        (a, b, c, d)
        for a in range(4)
        for b in range(4)
        for c in range(4)
        for d in range(4)
        if a + b + c + d <= 3
    ],
    dtype=np.int64,
)


@dataclass(frozen=True, kw_only=True)
class Built:
    """How one bearing departs from a round plain bore at one temperature; SI."""

    oval: float = 0.0  # amplitude of the bore's second harmonic
    tilt: tuple[float, float] = (0.0, 0.0)
    groove: float = 0.0  # width of each [rad]
    feed: float = 0.0  # [Pa]
    warm: float = 0.0  # share of the viscosity that is lost


def built_draw(seed: int, number: int, clearance: float, on: frozenset[str]) -> Built:
    """Bearing of machine `number`, its radial clearance given; the same whatever is switched on."""
    rng = np.random.default_rng([seed, number, 9])
    oval, tilts = rng.uniform(0, 7.5e-6), rng.uniform(-0.3e-3, 0.3e-3, 2)
    width, feed, warm = np.radians(rng.uniform(15, 30)), rng.uniform(0, 1.5e5), rng.uniform(0, 0.5)
    most = 0.25 * clearance / (LENGTH / 2)
    return Built(
        oval=oval if "oval" in on else 0.0,
        tilt=tuple(np.clip(tilts, -most, most)) if "tilt" in on else (0.0, 0.0),
        groove=width if "grooves" in on else 0.0,
        feed=feed if "grooves" in on else 0.0,
        warm=warm if "warm" in on else 0.0,
    )


@njit(cache=True)
def relax(pressure, gap, viscosity, rate, speed, cell, groove, feed):
    """Pressure [shape=(n_theta, n_z)] by projected over-relaxation, from what is there.

    `rate` is the gap's rate of change and `speed` that of the journal's surface [m/s], `cell` the
    mesh's width along and across [m], `groove` one where the pressure is `feed`.
    """
    n_theta, n_z = gap.shape
    d_x, d_z = cell
    along, across, source = np.empty_like(gap), np.empty_like(gap), np.empty_like(gap)
    for i in range(n_theta):
        after = (i + 1) % n_theta
        for j in range(n_z):
            mean = 0.5 * (gap[i, j] + gap[after, j])
            along[i, j] = mean**3 / (6 * (viscosity[i] + viscosity[after])) / d_x**2
            if j < n_z - 1:
                mean = 0.5 * (gap[i, j] + gap[i, j + 1])
                across[i, j] = mean**3 / (12 * viscosity[i]) / d_z**2
            wedge = (gap[after, j] - gap[i - 1, j]) / (2 * d_x)
            source[i, j] = 0.5 * speed * wedge + rate[i]
    for _ in range(MOST_SWEEPS):
        largest, moved = 0.0, 0.0
        for i in range(n_theta):
            after = (i + 1) % n_theta
            for j in range(1, n_z - 1):
                if groove[i, j]:
                    pressure[i, j] = feed
                    continue
                total = along[i, j] + along[i - 1, j] + across[i, j] + across[i, j - 1]
                flow = along[i, j] * pressure[after, j] + along[i - 1, j] * pressure[i - 1, j]
                flow += across[i, j] * pressure[i, j + 1] + across[i, j - 1] * pressure[i, j - 1]
                step = (flow - source[i, j]) / total - pressure[i, j]
                found = max(pressure[i, j] + RELAXATION * step, 0.0)
                moved = max(moved, abs(found - pressure[i, j]))
                largest = max(largest, found)
                pressure[i, j] = found
        if moved <= SETTLED * largest:
            return


class Film:
    """Film of one bearing at one speed.

    Parameters
    ----------
    clearance : float
        Radial [m].
    omega : float
        [rad/s]
    viscosity : float
        At the supply [Pa s].
    built : Built
    length : float
        Of the bearing [m].
    """

    def __init__(
        self,
        clearance: float,
        omega: float,
        viscosity: float,
        built: Built,
        *,
        length: float = LENGTH,
    ) -> None:
        self.clearance, self.omega, self.built = clearance, omega, built
        self.theta = np.arange(N_THETA) * 2 * pi / N_THETA
        z = np.linspace(-length / 2, length / 2, N_Z)
        self.cos, self.sin = np.cos(self.theta), np.sin(self.theta)
        lean = np.stack([self.cos, self.sin], axis=1) @ np.outer(built.tilt, z)
        self.bore = clearance - built.oval * np.cos(2 * self.theta)[:, None] - lean
        beside = np.abs(np.abs(np.arctan2(self.sin, self.cos)) - pi / 2) <= built.groove / 2
        middle = np.abs(z) <= 0.4 * length
        self.groove = (beside[:, None] & middle & (built.groove > 0)).astype(np.uint8)
        self.supplied, self.viscosity = viscosity, np.full(N_THETA, viscosity)
        self.pressure = np.zeros((N_THETA, N_Z))
        self.cell = (2 * pi * RADIUS / N_THETA, length / (N_Z - 1))
        self.area = np.full(N_Z, self.cell[0] * self.cell[1])
        self.area[[0, -1]] /= 2

    def gap(self, x: float, y: float) -> np.ndarray:
        """Film thickness [shape=(n_theta, n_z)] [m]."""
        return self.bore - (x * self.cos + y * self.sin)[:, None]

    def force(self, x: float, y: float, u: float = 0.0, v: float = 0.0) -> np.ndarray:
        """On a journal at (x, y) with velocity (u, v) [N, shape=(2,)]; NaN where it touches."""
        gap = self.gap(x, y)
        if gap.min() <= THINNEST:
            return np.full(2, np.nan)
        rate = -u * self.cos - v * self.sin
        known = self.viscosity, rate, RADIUS * self.omega, self.cell, self.groove, self.built.feed
        relax(self.pressure, gap, *known)
        load = self.pressure @ self.area
        return -np.array([load @ self.cos, load @ self.sin])

    def warmed(self, x: float, y: float) -> None:
        """Lower the viscosity along the film, where the journal is at (x, y)."""
        gap = self.gap(x, y)[:, N_Z // 2]
        widest = int(np.argmax(gap))
        heat = np.roll(1 / gap**2, -widest)  # shear strain rate squared
        heat[N_THETA // 2 + 8 :] = 0.0  # beyond the thinnest film there is little oil
        share = np.cumsum(heat) / heat.sum()
        self.viscosity = self.supplied * np.roll((1 - self.built.warm) ** share, widest)

    def slopes(self, place: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Change of the force with (x, y, u, v) [shape=(2, 4)], by central differences."""
        state = np.concatenate([place, [0.0, 0.0]])
        columns = []
        for i in range(4):
            aside = np.zeros(4)
            aside[i] = step[i]
            columns.append((self.force(*(state + aside)) - self.force(*(state - aside))) / step[i])
        return np.stack(columns, axis=1) / 2

    def rest(self, load: np.ndarray) -> np.ndarray:
        """Where the film carries a load [m, shape=(2,)], by Newton's method.

        Raises
        ------
        ArithmeticError
            It is not found.
        """
        place = 0.5 * self.clearance * np.array([np.cos(0.8), np.sin(0.8)])
        for sweep in range(60):
            if sweep < 25:  # then the temperatures stay
                self.warmed(*place)
            left = self.force(*place) + load
            if np.hypot(*left) < 1e-4 * np.hypot(*load) and sweep >= 25 * (self.built.warm > 0):
                return place
            step = 1e-4 * self.clearance
            slopes = self.slopes(place, np.full(4, step))[:, :2]
            move = -np.linalg.solve(slopes, left)
            move /= max(1.0, np.hypot(*move) / (0.15 * self.clearance))
            while not np.isfinite(self.force(*(place + move))).all():
                move /= 2
            place = place + move
        raise ArithmeticError(f"no equilibrium under {load} N; check load and clearance")


@njit(cache=True)
def orbit(weights, powers, scale, force, step, n_steps):
    """Places about the equilibrium [shape=(n_steps, 2)] under a force at half steps."""
    state, places = np.zeros(4), np.empty((n_steps, 2))
    rates, trial = np.empty((4, 4)), np.empty(4)
    ahead = (0.0, 0.5, 0.5, 1.0)
    for i in range(n_steps):
        places[i] = state[:2]
        for stage in range(4):
            trial[:] = state
            if stage > 0:
                trial += ahead[stage] * step * rates[stage - 1]
            film = force[2 * i + int(2 * ahead[stage])].copy()
            for k in range(len(powers)):
                term = 1.0
                for axis in range(4):
                    term *= (trial[axis] / scale[axis]) ** powers[k, axis]
                film += weights[k] * term
            rates[stage, :2] = trial[2:]
            rates[stage, 2:] = film / MASS
        state += step / 6 * (rates[0] + 2 * rates[1] + 2 * rates[2] + rates[3])
    return places


def cubic(film: Film, place: np.ndarray, scale: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Weights of the polynomial of the film's force and the load [shape=(n_powers, 2)]."""
    rng = np.random.default_rng(0)
    points = rng.standard_normal((SOLUTIONS, 4))
    points *= (rng.uniform(size=SOLUTIONS) ** 0.25 / np.linalg.norm(points, axis=1))[:, None]
    state = np.concatenate([place, [0.0, 0.0]])
    forces = np.array([film.force(*(state + scale * point)) for point in points]) + load
    kept = np.isfinite(forces).all(axis=1)
    terms = np.prod(points[kept, None, :] ** POWERS, axis=2)
    return np.linalg.lstsq(terms, forces[kept], rcond=None)[0]


def moved(film: Film, machine: Journal, run: Conditions, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Places [shape=(n, 2)] [m] and shaft angles [shape=(n,)] of a settled record."""
    omega = film.omega
    load = np.array([run.static_load + MASS * GRAVITY, 0.0])
    place = film.rest(load)
    small = 1e-3 * film.clearance
    slopes = film.slopes(place, small * np.array([1.0, 1.0, omega, omega]))
    unbalance = machine.unbalance * omega**2
    dynamic = -slopes[:, :2] - omega**2 * MASS * np.eye(2) - 1j * omega * slopes[:, 2:]
    amplitude = np.abs(np.linalg.solve(dynamic, unbalance * np.array([1.0, -1j]))).max()
    reach = min(REACH * max(amplitude, 0.2e-6), 0.6 * film.gap(*place).min())
    scale = reach * np.array([1.0, 1.0, 1.5 * omega, 1.5 * omega])
    weights = cubic(film, place, scale, load)
    motion = np.block([[np.zeros((2, 2)), np.eye(2)], [slopes / MASS]])
    fastest = np.abs(np.linalg.eigvals(motion)).max()
    sub = max(4, int(np.ceil(fastest / SAMPLE_RATE)))  # the formula is stable to 2.8
    settling = int(np.ceil(SETTLING / run.speed_hz * SAMPLE_RATE))
    half = (np.arange(2 * (settling + n) * sub + 1) / (2 * sub) - settling) / SAMPLE_RATE
    angle = run.start_angle + omega * half + machine.unbalance_angle
    force = unbalance * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    steps = (settling + n) * sub
    places = orbit(weights, POWERS, scale, force, 1 / (SAMPLE_RATE * sub), steps)
    if not np.abs(places).max() < 2.5 * reach:
        raise ArithmeticError("the orbit leaves what the polynomial knows; the bearing whirls")
    return place + places[settling * sub :: sub], (angle - machine.unbalance_angle)[
        2 * settling * sub : -1 : 2 * sub
    ]


def record(job: Job) -> tuple[np.ndarray, dict[str, float]]:
    """Signal and manifest values of a job; see `foreign_records`."""
    machine = journal_draw(job.seed, job.machine)
    run = conditions_draw(job.seed, job.record, healthy=job.healthy)
    clearance, omega = run.diametral_clearance / 2, 2 * pi * run.speed_hz
    built = built_draw(job.seed, job.machine, clearance, job.on)
    n = JOURNAL.n_samples
    places, angle = moved(Film(clearance, omega, run.viscosity, built), machine, run, n)
    signal = probes(places.T, angle, machine, run.seed)
    fine = run.start_angle + omega * np.arange(n * STEPS) / (SAMPLE_RATE * STEPS)
    pulses = tacho(fine, STEPS, SAMPLE_RATE, width=PULSE_WIDTH)
    values = (
        *(run.diametral_clearance, run.speed_hz, run.speed_hz),
        *(run.static_load, run.viscosity),
    )
    return np.vstack([signal, pulses]).astype(np.float32), dict(zip(COLUMNS, values, strict=True))


JOURNAL_B = Program(
    name="independent journal B",
    differences=DIFFERENCES,
    make=record,
    columns=COLUMNS,
    head=JOURNAL.head,
    n_samples=JOURNAL.n_samples,
)
