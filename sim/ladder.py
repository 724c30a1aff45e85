"""Rungs of each effect, as tables from the cheapest to the best.

A rung is one row: a name, what it assumes, when it is valid, where it comes from, and the function
that runs it. Dispatch goes by these tables, never by a chain of conditions.
"""

from collections.abc import Callable
from dataclasses import dataclass

from .pump_parts import PumpScene
from .slider_crank import CrankRun, parameters, run_compliant, run_ideal, start_state


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One rung of the crank-pin joint.

    Attributes
    ----------
    name : str
        As in the scene.
    assumes : str
        The model in one line.
    reference : str
        Source.
    nanoseconds_per_step : float
        Tabulated cost on one core of a 2020s server, for ranking only.
    fault : callable
        Scene -> why the rung is not valid there, with the cure; None where it is.
    run : callable
        (scene, step, n_steps, start_angle) -> run.
    """

    name: str
    assumes: str
    reference: str
    nanoseconds_per_step: float
    fault: Callable[[PumpScene], str | None]
    run: Callable[[PumpScene, float, int, float], CrankRun]


def _never(scene: PumpScene) -> None:  # noqa: ARG001 - one signature for every rung
    return None


def _unresolved_clearance(scene: PumpScene) -> str | None:
    joint = scene.joint.crankpin
    if joint.clearance_radial > 0:
        return None
    return (
        "joint.crankpin.rung = 'compliant' needs a clearance > 0 m; "
        "set joint.crankpin.rung = 'ideal' for a joint without one"
    )


def _run_ideal(scene: PumpScene, step: float, n_steps: int, start_angle: float) -> CrankRun:
    return run_ideal(scene, step=step, n_steps=n_steps, start_angle=start_angle)


def _run_compliant(scene: PumpScene, step: float, n_steps: int, start_angle: float) -> CrankRun:
    start = start_state(scene, start_angle)
    return run_compliant(parameters(scene), start, step=step, n_steps=n_steps)


CRANKPIN_RUNGS = (
    Rung(
        name="ideal",
        assumes="no clearance: inverse dynamics of rigid links",
        reference="Lagrange's equations of the slider-crank, closed form",
        nanoseconds_per_step=60.0,
        fault=_never,
        run=_run_ideal,
    ),
    Rung(
        name="compliant",
        assumes="free flight and Kelvin-Voigt contact with friction inside the clearance circle",
        reference="Xia et al. 2017, eqs 1-15 with their signs mended",
        nanoseconds_per_step=190.0,
        fault=_unresolved_clearance,
        run=_run_compliant,
    ),
)


def crankpin_rung(name: str) -> Rung:
    """Row of the crank-pin table by name."""
    return next(rung for rung in CRANKPIN_RUNGS if rung.name == name)
