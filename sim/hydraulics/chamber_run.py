"""A chamber by itself: its initial state, and a run with a prescribed motion of the piston."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from .chamber import CHAMBER_FLOWS, CHAMBER_OK, CHAMBER_STATE, chamber_step

_STEP_PER_CONTACT_TIME = 0.5  # 12 substeps per period of the valve on its seat


def chamber_substeps(h: Any, step: float) -> int:
    """Number of substeps of a step that resolve a valve's contact with its seat.

    Parameters
    ----------
    h : record of dtype HYDRAULIC
    step : float
        Step of the mechanism [s], > 0.

    Returns
    -------
    int
        At least 1, and at least 12 substeps per period of the stiffer contact. More are never
        needed for stability, only for accuracy: the method is L-stable.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Valve
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> chamber_substeps(h, 2e-5), chamber_substeps(h, 5e-5)
    (1, 3)
    """
    fastest = max(
        math.sqrt(h[f"{side}_seat_stiffness"] / h[f"{side}_mass"]) if h[f"{side}_stuck"] < 0 else 0
        for side in ("suction", "discharge")
    )
    return max(1, math.ceil(step * fastest / _STEP_PER_CONTACT_TIME))


def chamber_start(h: Any, x: float, v: float) -> NDArray[np.float64]:
    """Chamber in equilibrium with a steadily moving piston: one valve open, the other closed.

    Parameters
    ----------
    h : record of dtype HYDRAULIC
        Record with the rung *chamber*.
    x, v : float
        Piston position [m] and velocity [m/s].

    Returns
    -------
    numpy.ndarray [shape=(6,)]
        Columns as :data:`CHAMBER_STATE`.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Valve
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> p, vapour, lift = chamber_start(h, 0.25, -1.6)[:3]
    >>> round(float(p)), round(float(1e3 * lift), 2)  # [Pa], [mm]
    (-18080, 5.71)
    """
    flow = abs(float(h["area"]) * v)
    inward = v <= 0
    drop = _steady_drop(h, "suction" if inward else "discharge", flow)
    pressure = float(h["suction"]) - drop if inward else float(h["discharge"]) + drop
    pressure = max(pressure, float(h["vapour"]))
    suction = _steady_lift(h, "suction", float(h["suction"]) - pressure)
    discharge = _steady_lift(h, "discharge", pressure - float(h["discharge"]))
    del x  # the equilibrium is independent of the position
    return np.array([pressure, 0.0, suction, 0.0, discharge, 0.0])


def _steady_lift(h: Any, side: str, drop: float) -> float:
    """Lift at rest under a pressure drop: on the spring, or pressed into the seat or the stop."""
    if h[f"{side}_stuck"] >= 0:
        return float(h[f"{side}_stuck"])
    force = float(h[f"{side}_force_area"]) * drop - float(h[f"{side}_preload"])
    soft, top = float(h[f"{side}_stiffness"]), float(h[f"{side}_max_lift"])
    hard = soft + float(h[f"{side}_seat_stiffness"])
    if force <= 0:
        return force / hard
    return force / soft if force < soft * top else top + (force - soft * top) / hard


def _steady_drop(h: Any, side: str, flow: float) -> float:
    """Pressure drop for a flow through the valve at rest [Pa]; by bisection."""
    low, high = 0.0, 1e9
    for _ in range(100):
        drop = 0.5 * (low + high)
        gap = max(_steady_lift(h, side, drop), 0.0)
        conductance = float(h[f"{side}_gap_conductance"]) * gap
        conductance += float(h[f"{side}_leak_conductance"])
        if conductance * math.sqrt(drop) < flow:
            low = drop
        else:
            high = drop
    return 0.5 * (low + high)


@dataclass(frozen=True, kw_only=True)
class ChamberRun:
    """A chamber driven by a prescribed motion of its piston.

    Attributes
    ----------
    states : numpy.ndarray [shape=(n_steps + 1, 6)]
        Columns as :data:`CHAMBER_STATE`, at the ends of the steps.
    flows : numpy.ndarray [shape=(n_steps, 4)]
        Columns as :data:`CHAMBER_FLOWS`, for each step.
    code : int
        ``CHAMBER_OK``, or why the run ended early.
    """

    states: NDArray[np.float64]
    flows: NDArray[np.float64]
    code: int


def run_chamber(
    h: Any,
    piston: NDArray[np.float64],
    velocity: NDArray[np.float64],
    *,
    step: float,
    substeps: int | None = None,
    start: NDArray[np.float64] | None = None,
) -> ChamberRun:
    """Run a chamber with a prescribed motion of the piston.

    Parameters
    ----------
    h : record of dtype HYDRAULIC
        Record with the rung *chamber*.
    piston, velocity : numpy.ndarray [shape=(n_steps + 1,)]
        Position [m] and velocity [m/s] at the ends of the steps.
    step : float
        Step [s].
    substeps : int, optional
        By default :func:`chamber_substeps`.
    start : numpy.ndarray [shape=(6,)], optional
        By default :func:`chamber_start`.

    Returns
    -------
    ChamberRun
        Truncated before the step that failed if the code is not ``CHAMBER_OK``.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure, Valve
    >>> pressure = CylinderPressure(
    ...     rung="chamber", suction_valve=Valve(), discharge_valve=Valve(), dead_volume=4e-4
    ... )
    >>> h = hydraulic_parameters(
    ...     pressure, area=7.9e-3, crank_radius=0.05, rod_length=0.25, speed=31.4
    ... )[0]
    >>> run = run_chamber(h, np.full(501, 0.27), np.zeros(501), step=2e-5)
    >>> abs(float(run.states[-1, 0])) < 1.0  # [Pa]: nothing moves, nothing happens
    True
    """
    if substeps is None:
        substeps = chamber_substeps(h, step)
    states = np.empty((piston.size, len(CHAMBER_STATE)))
    states[0] = chamber_start(h, float(piston[0]), float(velocity[0])) if start is None else start
    flows = np.empty((piston.size - 1, len(CHAMBER_FLOWS)))
    code, done = _march(states, flows, h, step, piston, velocity, substeps)
    return ChamberRun(states=states[: done + 1], flows=flows[:done], code=code)


@kernel
def _march(
    states: NDArray[np.float64],
    flows: NDArray[np.float64],
    h: Any,
    step: float,
    piston: NDArray[np.float64],
    velocity: NDArray[np.float64],
    substeps: int,
) -> Any:
    for i in range(flows.shape[0]):
        for column in range(states.shape[1]):
            states[i + 1, column] = states[i, column]
        code = chamber_step(
            states[i + 1],
            flows[i],
            h,
            step,
            piston[i],
            velocity[i],
            piston[i + 1],
            velocity[i + 1],
            substeps,
        )
        if code != CHAMBER_OK:
            return code, i
    return CHAMBER_OK, flows.shape[0]
