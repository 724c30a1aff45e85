"""Numbers and draws of the independent propulsion shaft; see `foreign_ross_shaft.py`.

They are those of the scene `propulsion-shaft`, drawn as widely as its recipe says. What the scene
holds fixed and the program varies is drawn here too.
"""

from dataclasses import dataclass
from math import exp, log, log10, pi

import numpy as np

SPEED, GRAVITY = 5.0, 9.80665  # [Hz], [m/s^2]
YOUNG, SHEAR, DENSITY = 206e9, 79e9, 7850.0  # [Pa], [Pa], [kg/m^3]
DAMPING_RATIO, DAMPING_BAND = 0.003, (5.0, 200.0)  # [-], [Hz]
SECTIONS = ((6.2, 0.3), (8.4, 0.25), (2.0, 0.28))  # length, diameter [m]
DISCS = np.array(  # station [m], mass [kg], diametral, polar inertia [kg m^2], unbalance [kg m]
    [
        [0.35, 1700, 210, 390, 0.34],
        [6.2, 320, 9.8, 17.5, 0.02],
        [14.6, 300, 8.2, 14.4, 0.02],
        [15.1, 220, 7.9, 15.6, 0.01],
        [16.6, 350, 15, 28, 0.03],
    ]
)
WATER, BUOYANCY = (425.0, 120.0), 2250.0  # entrained mass, diametral inertia; [N]
BEARINGS = np.array(  # station, diameter, length, diametral clearance, rise when hot [m]
    [
        [1.25, 0.30, 0.60, 0.70e-3, 0.0],
        [5.0, 0.30, 0.30, 0.70e-3, 0.0],
        [8.9, 0.25, 0.19, 0.35e-3, 0.1e-3],
        [12.6, 0.25, 0.19, 0.35e-3, 0.1e-3],
        [15.6, 0.28, 0.21, 0.39e-3, 0.2e-3],
    ]
)
HOUSINGS = np.array(  # mass [kg], stiffness [N/m] and damping [N s/m], up and side
    [
        [1600, 2000e6, 1300e6, 143e3, 115e3],
        [900, 1150e6, 770e6, 81e3, 67e3],
        [320, 800e6, 500e6, 40e3, 32e3],
        [320, 900e6, 560e6, 43e3, 34e3],
        [1100, 1600e6, 1000e6, 106e3, 84e3],
    ]
)
OIL = ((313.15, 100.0), (373.15, 11.4))  # [K], [mm^2/s]
OIL_DENSITY, OIL_HEAT = 875.0, 1950.0  # [kg/m^3], [J/(kg K)]
THRUST, THRUST_HEIGHT, THRUST_SIDE = 350e3, 36e-3, -12e-3  # [N], [m], [m]
COUPLING_STIFFNESS, COUPLING_BENDING = 2.5e6, 80e3  # [N/m], [N m]


@dataclass(frozen=True, kw_only=True)
class Machine:
    """One line; SI."""

    clearance: np.ndarray  # diametral (5,)
    housing: np.ndarray  # as HOUSINGS
    principal: np.ndarray  # angle of each housing's stiff axis from up
    slope: np.ndarray  # of the bores, up and side (5, 2)
    side_offset: np.ndarray  # (5,)
    scar: float  # its clearance over that of the bore
    coupling_direction: float
    coupling_angle: float
    seed: int


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Of one record; SI."""

    wear_down: float
    sag: float
    coupling_offset: float
    speed_hz: float
    thrust: float
    hull: float
    temperature: float
    start_angle: float
    seed: int


def machine_draw(seed: int, number: int) -> Machine:
    """Machine `number`: what lies still."""
    rng = np.random.default_rng([seed, number, 10])
    factors = np.column_stack([rng.uniform(0.94, 1.06, (5, 3)), rng.uniform(0.6, 1.4, (5, 2))])
    return Machine(
        clearance=BEARINGS[:, 3] * rng.uniform(0.85, 1.15, 5),
        housing=HOUSINGS * factors,
        principal=np.radians(rng.uniform(-15, 15, 5)),
        slope=rng.uniform(-1e-4, 1e-4, (5, 2)),  # a third of what class rules allow
        side_offset=rng.uniform(-0.1e-3, 0.1e-3, 5),
        scar=rng.uniform(0.3, 1.0),
        coupling_direction=rng.uniform(0, 2 * pi),
        coupling_angle=rng.uniform(-3e-4, 3e-4),
        seed=int(rng.integers(2**62)),
    )


def conditions_draw(
    seed: int, record: int, *, healthy: bool = False, attempt: int = 0
) -> Conditions:
    """Conditions and faults of record `record`."""
    rng = np.random.default_rng([seed, record, 12 if healthy else 11, attempt])
    bounds = (
        ((0.03e-3, 0.05e-3), (0.05e-3, 0.08e-3), (0.05e-3, 0.08e-3))
        if healthy
        else ((0.03e-3, 1.35e-3), (0.05e-3, 1.8e-3), (0.05e-3, 2.25e-3))
    )
    wear_down, sag, offset = (exp(rng.uniform(log(low), log(high))) for low, high in bounds)
    return Conditions(
        wear_down=wear_down,
        sag=sag,
        coupling_offset=offset,
        speed_hz=SPEED * rng.uniform(0.85, 1.15),
        thrust=THRUST * rng.uniform(0.0, 1.3),
        hull=rng.uniform(-0.5e-3, 0.5e-3),
        temperature=rng.uniform(298.15, 333.15),
        start_angle=rng.uniform(0, 2 * pi),
        seed=int(rng.integers(2**62)),
    )


def viscosity(temperature: float) -> float:
    """Of the oil [Pa s], by Walther's law through the data sheet's two points."""
    (cold, thick), (hot, thin) = OIL
    first, last = (log10(log10(nu + 0.7)) for nu in (thick, thin))
    doubled = first + (last - first) * log(temperature / cold) / log(hot / cold)
    return OIL_DENSITY * 1e-6 * (10**10**doubled - 0.7)
