"""Slider-crank with rigid impacts in the clearance of its crank pin, event by event.

A yardstick for the compliant mechanism, written from the mechanics and sharing nothing with the
library. Two coordinates, piston position x from the crank centre and rod angle b, at constant
crank speed, without friction, gravity or pressure:

    [m2 + m3       m2 Lc sin b ] [x'']   [-m2 Lc cos b b'^2]
    [m2 Lc sin b   J + m2 Lc^2 ] [b''] = [        0        ]

in free flight. The pin stands at ``d = (r cos a + L cos b - x, r sin a - L sin b)`` from the
centre of its eye. Where ``|d|`` reaches the radial clearance, an impulse P along ``n = d / |d|``
acts on the rod and turns the normal speed v of pin against eye into -e v:

    P = (1 + e) v / (g' M^-1 g),    M [dx', db'] = P g,    g = (n_x, L (n_x sin b + n_y cos b))

with M the matrix above; ``1 / (g' M^-1 g)`` is the mass that the impact feels. A pin that keeps
resting in its eye is beyond this: the run ends before the bounces accumulate.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCE = 1e-12  # of the free flights, relative
LONGEST_STEP = 2e-5  # s: a flight twice as long cannot end unseen
SHORTEST_FLIGHT = 1e-8  # s: below, bounces follow one another without end
OUTSIDE = 1e-9  # of the clearance: the pin never is, by the root finder's 1e-14 s times 10 m/s


class Crank(NamedTuple):
    """Parameters in SI; `clearance` is radial, `inertia` about the rod's centre of mass."""

    crank_radius: float
    rod_length: float
    rod_mass: float
    rod_centre: float
    inertia: float
    piston_mass: float
    speed: float
    clearance: float


class RigidRun(NamedTuple):
    """Impacts of a run; states are (a, x, x', b, b')."""

    times: np.ndarray  # (n,) [s]
    before: np.ndarray  # (n, 5)
    after: np.ndarray  # (n, 5)
    impulses: np.ndarray  # (n,) [N s]
    directions: np.ndarray  # (n, 2)
    samples: np.ndarray  # (n_at, 5), at the times asked for


def mass_matrix(beta, crank):
    """Of piston position and rod angle [shape=(2, 2)]."""
    moment = crank.rod_mass * crank.rod_centre
    coupling = moment * np.sin(beta)
    return np.array(
        [
            [crank.rod_mass + crank.piston_mass, coupling],
            [coupling, crank.inertia + moment * crank.rod_centre],
        ]
    )


def offset(state, crank):
    """Pin's centre from the eye's, and its rate [shape=(2,) each]."""
    a, x, u, b, w = state
    place = np.array(
        [
            crank.crank_radius * np.cos(a) + crank.rod_length * np.cos(b) - x,
            crank.crank_radius * np.sin(a) - crank.rod_length * np.sin(b),
        ]
    )
    return place, crank.speed * pin_direction(a, crank) - eye_velocity(u, b, w, crank)


def pin_direction(a, crank):
    """Velocity of the pin per crank speed [m, shape=(2,)]."""
    return crank.crank_radius * np.array([-np.sin(a), np.cos(a)])


def eye_velocity(u, b, w, crank):
    """Velocity of the eye's centre [shape=(2,)]."""
    return np.array([u + crank.rod_length * np.sin(b) * w, crank.rod_length * np.cos(b) * w])


def kinetic_energy(state, crank):
    """Of rod and piston [J]."""
    velocity = np.array([state[2], state[4]])
    return 0.5 * velocity @ mass_matrix(state[3], crank) @ velocity


def flight(_, state, crank):
    """Rate of the state without contact."""
    _, _, u, b, w = state
    pull = [-crank.rod_mass * crank.rod_centre * np.cos(b) * w**2, 0.0]
    x_acceleration, b_acceleration = np.linalg.solve(mass_matrix(b, crank), pull)
    return [crank.speed, u, x_acceleration, w, b_acceleration]


def impact(state, crank, restitution):
    """State after an impact, its impulse [N s] and direction [shape=(2,)]."""
    place, rate = offset(state, crank)
    normal = place / np.linalg.norm(place)
    b = state[3]
    lever = crank.rod_length * (normal[0] * np.sin(b) + normal[1] * np.cos(b))
    arm = np.array([normal[0], lever])
    moved = np.linalg.solve(mass_matrix(b, crank), arm)
    impulse = (1.0 + restitution) * (normal @ rate) / (arm @ moved)
    after = np.array(state)
    after[[2, 4]] += impulse * moved
    return after, impulse, normal


def rigid_run(crank, start, restitution, horizon, at=()):
    """Run from a start in free flight.

    Parameters
    ----------
    crank : Crank
    start : sequence of float
        Crank angle, piston position and velocity, rod angle and rate.
    restitution : float
        Newton's, of the normal speed.
    horizon : float
        [s]
    at : sequence of float
        Rising times at which the state is wanted [s].

    Returns
    -------
    RigidRun

    Raises
    ------
    RuntimeError
        A flight was too short to be followed, because the impacts accumulate.
    """

    def room(_, state, crank):
        return crank.clearance - np.linalg.norm(offset(state, crank)[0])

    room.terminal, room.direction = True, -1.0
    at = np.asarray(at, dtype=float)
    time, state = 0.0, np.array(start, dtype=float)
    times, before, after, impulses, directions = [], [], [], [], []
    samples = np.full((len(at), 5), np.nan)
    while time < horizon:
        part = solve_ivp(
            flight,
            (time, horizon),
            state,
            method="DOP853",
            rtol=TOLERANCE,
            atol=1e-14,
            max_step=LONGEST_STEP,
            events=room,
            dense_output=True,
            args=(crank,),
        )
        left = min(room(None, step, crank) for step in part.y.T)
        if left < -OUTSIDE * crank.clearance or part.t[-1] - time < SHORTEST_FLIGHT:
            raise RuntimeError(f"impacts accumulate after {time:g} s of {horizon:g} s; shorten it")
        inside = (at >= time) & (at <= part.t[-1])
        if inside.any():
            samples[inside] = part.sol(at[inside]).T
        time, state = part.t[-1], part.y[:, -1]
        if part.status != 1:
            break
        times.append(time)
        before.append(state)
        state, impulse, normal = impact(state, crank, restitution)
        after.append(state)
        impulses.append(impulse)
        directions.append(normal)
    lists = (times, before, after, impulses, directions)
    return RigidRun(*(np.array(part) for part in lists), samples)
