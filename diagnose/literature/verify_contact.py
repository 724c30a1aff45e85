"""Literature checks of contacts: restitution of an impact, Hertz's stiffness."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ...sim.contact.closed_forms import effective_modulus, hertz_sphere_stiffness
from ...sim.contact.law import (
    CONTACT,
    ELASTIC_HERTZ,
    HYSTERESIS,
    LAW_HYSTERESIS,
    RELEASE_AT_ZERO_FORCE,
    RELEASE_AT_ZERO_PENETRATION,
    hysteresis,
    normal_force,
)
from ...sim.jit import kernel
from ...sim.mechanism.crank_run import CrankRun, run_mechanism
from ...sim.mechanism.layout import BODY, CRANKPIN, JOINT_COMPLIANT
from .verify_crank import one_throw

_APPROACH_SPEED = 0.3  # m/s, an impact speed of a worn pump; the law is linear, any would do
_LONGEST_DROP = 1000.0  # contact times; the slowest rebound of the table is over after thirty


def impact(
    contact: np.void, *, speed: float = _APPROACH_SPEED, step: float, duration: float
) -> float:
    """Coefficient of restitution of the mechanism itself in one straight impact.

    The rod lies along the stroke with the crank at rest, without gravity, pressure or friction,
    so that rod and piston are one mass of 9 kg which runs against the pin.

    Parameters
    ----------
    contact : record of sim.contact.CONTACT
        Of the crank pin, with a clearance above zero [m].
    speed : float
        Of approach [m/s], > 0.
    step : float
        Integration step [s].
    duration : float
        From a hundredth of the clearance before first touch [s].

    Returns
    -------
    float
        Speed of separation over speed of approach, at the first rebound; NaN where it does not
        come within the duration.

    Examples
    --------
    >>> contact = np.zeros(1, CONTACT)[0]
    >>> contact["law"], contact["stiffness"], contact["hysteresis"] = LAW_HYSTERESIS, 2e8, 0.75
    >>> contact["clearance"], contact["friction_speed"] = 4e-5, 1.0
    >>> round(impact(contact, step=1e-6, duration=2e-3), 5)
    0.66296
    """
    clearance = float(contact["clearance"])
    t = one_throw(_STRAIGHT, {CRANKPIN: contact})
    reach = _STRAIGHT["crank_radius"] + _STRAIGHT["rod_centre"] + _STRAIGHT["rod_arm"]
    bodies = np.zeros((1, 2 * len(BODY)))
    bodies[0, 3] = reach - 0.99 * clearance
    bodies[0, 0] = bodies[0, 3] - _STRAIGHT["rod_centre"]
    bodies[0, 6] = bodies[0, 9] = -speed
    n_steps = math.ceil(duration / step)
    run = run_mechanism(t, angle=0.0, speed=0.0, bodies=bodies, step=step, n_steps=n_steps)
    return _first_free_speed(run, reach - clearance) / speed


_STRAIGHT = {
    "crank_radius": 0.05,
    "rod_centre": 0.165,
    "rod_arm": 0.085,
    "rod_mass": 3.0,
    "inverse_rod_mass": 1 / 3.0,
    "inverse_rod_inertia": 1 / 0.025,
    "piston_mass": 6.0,
    "crankpin_rung": JOINT_COMPLIANT,
    "crankpin_radius": 0.03,
    "guide_half_height": 1.0,
}
"""Typical of a pump at 300 rpm; the restitution of a law does not depend on it."""


def rebound(damping_ratio: float, release: int, *, step_per_contact_time: float = 0.03) -> float:
    """Coefficient of restitution of a spring and dashpot, by :func:`impact`.

    Parameters
    ----------
    damping_ratio : float
        Of rod and piston on the contact spring, 0 <= zeta < 1.
    release : int
        ``RELEASE_AT_ZERO_FORCE`` or ``RELEASE_AT_ZERO_PENETRATION``.
    step_per_contact_time : float
        Integration step times the angular frequency of that mass on the spring.

    Returns
    -------
    float
        Speed of separation over speed of approach, at the first rebound.

    Raises
    ------
    ValueError
        The damping ratio is outside [0, 1), where a rebound need not come.

    Examples
    --------
    >>> round(rebound(0.2, RELEASE_AT_ZERO_FORCE), 5)
    0.57174
    """
    if not 0 <= damping_ratio < 1:
        raise ValueError(f"damping_ratio = {damping_ratio} must be in [0, 1); lower the damping")
    stiffness, mass = 2e8, _STRAIGHT["rod_mass"] + _STRAIGHT["piston_mass"]
    contact = np.zeros(1, CONTACT)[0]
    contact["stiffness"], contact["release"] = stiffness, release
    contact["damping"] = 2 * damping_ratio * math.sqrt(stiffness * mass)
    contact["clearance"], contact["friction_speed"] = 4e-5, 1.0
    step = step_per_contact_time / math.sqrt(stiffness / mass)
    # approach over a hundredth of the clearance, then at most half a contact period
    duration = 0.01 * 4e-5 / _APPROACH_SPEED + 2 * math.pi * step / step_per_contact_time
    return impact(contact, step=step, duration=duration)


def _first_free_speed(run: CrankRun, touch: float) -> float:
    """Piston velocity once it moves away and has cleared the side it ran against [m/s]."""
    assert run.bodies is not None  # kept by default
    piston, velocity = run.bodies[:, 0, 3], run.bodies[:, 0, 9]
    free = np.flatnonzero((velocity > 0) & (piston > touch))
    return float(velocity[free[0]]) if free.size else math.nan


@kernel
def _slowing(penetration: float, velocity: float, speed: float, contact: Any) -> float:
    return -normal_force(penetration, velocity, speed, contact)


@kernel
def _drop(speed: float, h: float, n_steps: int, contact: Any) -> float:
    """Velocity at which a unit mass leaves, by Runge-Kutta 4; NaN if it does not.

    Order 4 with a linear elasticity, 2.5 with those that start as d^(3/2).
    """
    d, v = 0.0, speed
    for _ in range(n_steps):
        k1 = _slowing(d, v, speed, contact)
        v2 = v + 0.5 * h * k1
        k2 = _slowing(d + 0.5 * h * v, v2, speed, contact)
        v3 = v + 0.5 * h * k2
        k3 = _slowing(d + 0.5 * h * v2, v3, speed, contact)
        v4 = v + h * k3
        k4 = _slowing(d + h * v3, v4, speed, contact)
        after = d + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        if after <= 0.0:
            return v - 0.5 * d * k1 / v  # the force falls to zero over the rest
        d = after
        v += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return math.nan


def drop(contact: np.void, *, speed: float = 1.0, step: float = 1e-3) -> float:
    """Coefficient of restitution of a mass of 1 kg thrown on a hysteresis contact, integrated.

    Parameters
    ----------
    contact : record of sim.contact.CONTACT
        With a hysteresis law.
    speed : float
        Of approach [m/s], > 0.
    step : float
        Integration step [s]. With a stiffness and a speed of one the contact lasts from two to
        thirty seconds and the default is within 1e-8, whatever the elasticity.

    Returns
    -------
    float
        Speed of separation over speed of approach; NaN where the mass does not come back.

    Examples
    --------
    >>> contact = np.zeros(1, CONTACT)[0]
    >>> contact["law"], contact["stiffness"], contact["hysteresis"] = LAW_HYSTERESIS, 1.0, 0.75
    >>> round(drop(contact), 5)
    0.66296
    """
    leaving: float = _drop(speed, step, math.ceil(_LONGEST_DROP / step), contact)
    return -leaving / speed


def _hertz_drop(law: str, restitution: float) -> float:
    contact = np.zeros(1, CONTACT)[0]
    contact["law"], contact["elasticity"], contact["stiffness"] = LAW_HYSTERESIS, ELASTIC_HERTZ, 1.0
    contact["hysteresis"] = hysteresis(law, restitution)
    return drop(contact)


def _benchmark_hertz(clearance: float) -> float:
    steel = effective_modulus(207e9, 0.3, 207e9, 0.3)
    return hertz_sphere_stiffness(steel, 10e-3 - clearance, 10e-3)


def restitution_checks() -> dict[str, Callable[[], float]]:
    """Checks of the restitution of the linear contact."""
    return {
        f"restitution: damping ratio {ratio:g}, release at zero {name}": partial(
            rebound, ratio, code
        )
        for ratio in (0.05, 0.2, 0.5)
        for name, code in (
            ("force", RELEASE_AT_ZERO_FORCE),
            ("penetration", RELEASE_AT_ZERO_PENETRATION),
        )
    }


def contact_checks() -> dict[str, Callable[[], float]]:
    """Checks of Hertz's contact and of its laws of damping."""
    return {
        **{
            f"impact by {law}, asked for {restitution:g}": partial(_hertz_drop, law, restitution)
            for law in HYSTERESIS
            for restitution in (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95)
            if law != "carvalho-martins" or restitution >= 1 / 3  # its validity
        },
        **{
            f"Hertz contact: stiffness at {clearance * 1e3:g} mm clearance [N/m^1.5]": partial(
                _benchmark_hertz, clearance
            )
            for clearance in (0.5e-3, 0.25e-3, 0.1e-3)
        },
    }
