"""Literature checks: what the physics must give, what it gives, and whether that is close enough.

Expected values, tolerances and sources stand in ``literature/*.csv``, one line per check; the
function that obtains the value stands in a table here under the same name.
"""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

from ..sim.analytic import IdealCrank
from ..sim.contact import RELEASE_AT_ZERO_FORCE, RELEASE_AT_ZERO_PENETRATION
from ..sim.hydraulics import PRESSURE_NONE
from ..sim.pump_parts import PumpScene
from ..sim.scene import load_scene
from ..sim.slider_crank import (
    CrankParameters,
    CrankRun,
    ideal_motion,
    parameters,
    run_compliant,
)

LITERATURE_FOLDER = Path(__file__).parent / "literature"

_ANGLES = 36_001  # steps of 0.01 degree: a maximum is missed by less than 1e-7 of itself
_APPROACH_SPEED = 0.3  # m/s, an impact speed of a worn pump; the law is linear, any would do


@dataclass(frozen=True, kw_only=True)
class Check:
    """One value of the literature and how to obtain it here.

    Attributes
    ----------
    name : str
        What is checked, with its unit.
    expected : float
        The value of the source, in SI.
    tolerance : float
        Largest difference that passes; of the expected value where `kind` is ``"relative"``.
    kind : str
        ``"absolute"`` or ``"relative"``.
    trust : str
        How far the expected value can be trusted: ``R`` read at the source, ``H`` computed by
        an independent implementation, ``M`` recalled, ``V`` verified; combined with ``+``.
    source : str
        Where it is from.
    obtain : callable
        () -> the value that this program gives.
    """

    name: str
    expected: float
    tolerance: float
    kind: str
    trust: str
    source: str
    obtain: Callable[[], float]


@dataclass(frozen=True, kw_only=True)
class Result:
    """Outcome of one check; the fields of :class:`Check`, the value obtained, and the verdict."""

    name: str
    expected: float
    obtained: float
    tolerance: float
    kind: str
    passed: bool
    trust: str
    source: str


def checks() -> tuple[Check, ...]:
    """Every literature check, in the order of the tables.

    Raises
    ------
    ValueError
        A table's lines and its functions do not name the same checks, or a tolerance is unusable.

    Examples
    --------
    >>> checks()[0].name
    'ideal crank: stroke [m]'
    """
    return tuple(check for file, table in _TABLES.items() for check in _read(file, table))


def run_checks() -> list[Result]:
    """Obtain every value and compare it with the literature.

    Returns
    -------
    list of Result
        In the order of :func:`checks`. A value that is not finite does not pass.

    Examples
    --------
    >>> all(result.passed for result in run_checks())
    True
    """
    return [_judge(check) for check in checks()]


def _judge(check: Check) -> Result:
    obtained = check.obtain()
    scale = abs(check.expected) if check.kind == "relative" else 1.0
    return Result(
        name=check.name,
        expected=check.expected,
        obtained=obtained,
        tolerance=check.tolerance,
        kind=check.kind,
        passed=abs(obtained - check.expected) <= check.tolerance * scale,
        trust=check.trust,
        source=check.source,
    )


def _read(file: str, table: dict[str, Callable[[], float]]) -> list[Check]:
    with (LITERATURE_FOLDER / file).open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    named = [row["name"] for row in rows]
    if sorted(named) != sorted(table):
        odd = ", ".join(sorted(set(named) ^ set(table))) or "one given twice"
        raise ValueError(f"{file} and its functions differ: {odd}; give each check once in both")
    return [_check(file, row, table[row["name"]]) for row in rows]


def _check(file: str, row: dict[str, str], obtain: Callable[[], float]) -> Check:
    tolerance = float(row["tolerance"])
    if not 0 < tolerance < math.inf:
        raise ValueError(
            f"{file}: tolerance of '{row['name']}' = {tolerance:g} must be > 0 and finite; "
            "half a unit of the last printed digit will do"
        )
    if row["kind"] not in ("absolute", "relative"):
        raise ValueError(
            f"{file}: kind of '{row['name']}' = '{row['kind']}' must be 'absolute' or 'relative'"
        )
    return Check(
        name=row["name"],
        expected=float(row["expected"]),
        tolerance=tolerance,
        kind=row["kind"],
        trust=row["trust"],
        source=row["source"],
        obtain=obtain,
    )


@cache
def _benchmark_crank() -> IdealCrank:
    scene = load_scene("slider-crank-benchmark")
    assert isinstance(scene, PumpScene)  # a built-in scene of that machine
    return ideal_motion(scene, np.linspace(0.0, 2 * math.pi, _ANGLES))


def _stroke() -> float:
    return float(np.ptp(_benchmark_crank().piston))


def _largest_piston_speed() -> float:
    return float(np.abs(_benchmark_crank().piston_velocity).max())


def _least_piston_acceleration() -> float:
    return float(_benchmark_crank().piston_acceleration.min())


def _largest_piston_acceleration() -> float:
    return float(_benchmark_crank().piston_acceleration.max())


def _largest_crank_pin_force() -> float:
    crank = _benchmark_crank()
    return float(np.hypot(crank.pin_force_x, crank.pin_force_y).max())


def _largest_wrist_pin_force() -> float:
    crank = _benchmark_crank()
    return float(np.hypot(crank.wrist_force_x, crank.wrist_force_y).max())


def _largest_guide_force() -> float:
    return float(np.abs(_benchmark_crank().guide_force).max())


def _largest_crank_moment() -> float:
    return float(np.abs(_benchmark_crank().crank_moment).max())


def rebound(damping_ratio: float, release: int, *, step_per_contact_time: float = 0.03) -> float:
    """Coefficient of restitution that the mechanism itself gives for one straight impact.

    The rod lies along the stroke with the crank at rest, without gravity, pressure or friction,
    so that rod and piston are one mass which runs against the pin.

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
    p = _straight_impact(damping_ratio, release)
    step = step_per_contact_time / math.sqrt(p.stiffness / p.moving_mass)
    reach = p.crank_radius + p.rod_length
    start = (0.0, 0.0, reach - 0.99 * p.clearance, -_APPROACH_SPEED, 0.0, 0.0)
    # approach over a hundredth of the clearance, then at most half a contact period
    duration = 0.01 * p.clearance / _APPROACH_SPEED + 2 * math.pi * step / step_per_contact_time
    run = run_compliant(p, start, step=step, n_steps=math.ceil(duration / step))
    return _first_free_speed(run, reach - p.clearance) / _APPROACH_SPEED


def _straight_impact(damping_ratio: float, release: int) -> CrankParameters:
    scene = load_scene("bilge-pump")
    assert isinstance(scene, PumpScene)  # a built-in scene of that machine
    p = parameters(scene)
    return p._replace(
        gravity_x=0.0,
        gravity_y=0.0,
        pressure_rung=PRESSURE_NONE,
        friction=0.0,
        tangential_damping=0.0,
        release=release,
        damping=2 * damping_ratio * math.sqrt(p.stiffness * p.moving_mass),
    )


def _first_free_speed(run: CrankRun, touch: float) -> float:
    """Piston velocity once it moves away and has cleared the side it ran against [m/s]."""
    piston, velocity = run.states[:, 2], run.states[:, 3]
    free = np.flatnonzero((velocity > 0) & (piston > touch))
    return float(velocity[free[0]]) if free.size else math.nan


_TABLES: dict[str, dict[str, Callable[[], float]]] = {
    "slider_crank.csv": {
        "ideal crank: stroke [m]": _stroke,
        "ideal crank: largest piston speed [m/s]": _largest_piston_speed,
        "ideal crank: least piston acceleration [m/s^2]": _least_piston_acceleration,
        "ideal crank: largest piston acceleration [m/s^2]": _largest_piston_acceleration,
        "ideal crank: largest crank-pin force [N]": _largest_crank_pin_force,
        "ideal crank: largest wrist-pin force [N]": _largest_wrist_pin_force,
        "ideal crank: largest guide force [N]": _largest_guide_force,
        "ideal crank: largest crank moment [N m]": _largest_crank_moment,
    },
    "restitution.csv": {
        f"restitution: damping ratio {ratio:g}, release at zero {name}": partial(
            rebound, ratio, code
        )
        for ratio in (0.05, 0.2, 0.5)
        for name, code in (
            ("force", RELEASE_AT_ZERO_FORCE),
            ("penetration", RELEASE_AT_ZERO_PENETRATION),
        )
    },
}
"""File of the literature -> name of each of its checks -> what obtains it."""
