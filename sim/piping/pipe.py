"""One pipe between a far end at constant pressure and a node at the pump, compiled.

The flow Q is positive towards the pump, on the discharge side too. A step of length h uses means
over the step: what a pump draws from the node is a volume, the node's pressure p its mean. All
flows into the node itself are functions of p alone, so a step solves one equation for p::

    pipe_flow(p) = q + demand(p) + void / h

with the flow q that the pump draws, the flow into spring, gas and relief valve (:func:`demand`),
and the volume of vapour at the node (:func:`excess`). :func:`seek` finds p for a given q; if q
depends on the pressures of two pipes, :mod:`wearstate.sim.piping.coupling` finds both.

A pipe is a rigid column with a spring at the node (*lumped-lines*), or carries waves between nodes
one step of travel apart (*wave-lines*); the rest of its length beyond whole reaches is a rigid
column at the far end, where the pressure is constant and a spring would have no effect.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from ..scene.pump_hydraulics import STANDARD_ATMOSPHERE, Line, Liquid

PIPE = np.dtype(
    [
        ("fixed", "i8"),  # 1: no pipe between the far end and the node
        ("reaches", "i8"),  # each one step of travel; 0: only a rigid column
        ("far", "f8"),  # pressure at the far end, reduced to the pump's height [Pa]
        ("inertance", "f8"),  # of the rigid column [kg/m^4]
        ("far_loss", "f8"),  # of the rigid column and the fittings [Pa s^2/m^6]
        ("impedance", "f8"),  # rho a / A [Pa s/m^3]
        ("reach_loss", "f8"),  # friction of one reach [Pa s^2/m^6]
        ("compliance", "f8"),  # of the spring at the node [m^3/Pa]
        ("reach_volume", "f8"),  # liquid of one reach [m^3]; of the whole pipe if it has none
        ("gas_volume", "f8"),  # of the damper at rest [m^3]; 0: none
        ("gas_pressure", "f8"),  # at rest, absolute [Pa]
        ("gas_exponent", "f8"),
        ("relief_opens", "f8"),  # [Pa gauge]
        ("relief_full", "f8"),  # pressure rise to the fully open valve [Pa]; 0: none
        ("relief_conductance", "f8"),  # fully open [m^3/s/sqrt(Pa)]
        ("relief_back", "f8"),  # pressure behind the relief valve [Pa]
        ("vapour", "f8"),  # [Pa gauge]
    ]
)
"""One pipe in SI, from :func:`pipe_parameters`."""

PIPE_STATE = np.dtype(
    [
        ("mean", "f8"),  # pressure at the node over the last step [Pa]
        ("end", "f8"),  # at its end
        ("column_mean", "f8"),  # flow of the rigid column over the last step [m^3/s]
        ("column_end", "f8"),  # at its end
        ("gas", "f8"),  # volume in the damper [m^3]
        ("void", "f8"),  # vapour at the node, and the remainder of a step's equation [m^3]
        ("drawn", "f8"),  # flow that the pump drew in the last step [m^3/s]
        ("parted", "i8"),  # steps with vapour anywhere in the pipe
        ("unsettled", "i8"),  # steps whose search ended with too large an excess
    ]
)
"""State of one pipe carried from step to step, in addition to its inner nodes."""

PRESSURE, ARRIVES, LEAVES, VOID = range(4)
"""Rows of the inner nodes: pressure [Pa], flow arriving from the far side and flow leaving to
the pump's side [m^3/s], volume of vapour [m^3]; columns from the pump (0) to the far end."""

FEWEST_REACHES = 5
"""Least number of reaches of a pipe: the first organ-pipe frequency is then within 0.5 %, see the
tests."""

FIRST_MODE = 4 / math.pi**2
"""Share of a pipe's compliance that is lumped at its closed end: with it, and the whole inertance,
the first organ-pipe frequency a / 4 L is exact. The static deformation would give 1/3."""

_STEEPEST_FALL = 0.1  # of the mean pressure: least pressure to which a damper's gas is extrapolated


# --- parameters


def pipe_parameters(
    line: Line,
    liquid: Liquid,
    *,
    far: float,
    relief_back: float,
    step: float,
    waves: bool,
) -> NDArray[np.void]:
    """Kernel parameters of one pipe.

    Parameters
    ----------
    line : Line
        Line with a wave speed.
    liquid : Liquid
    far : float
        Pressure at the far end, reduced to the height of the pump [Pa gauge].
    relief_back : float
        Pressure behind a relief valve [Pa gauge].
    step : float
        Step [s].
    waves : bool
        Waves between the ends; if false, a column on a spring.

    Returns
    -------
    numpy.ndarray [shape=(1,), dtype=PIPE]

    Examples
    --------
    >>> line = Line(length=10.0, wave_speed=1000.0, minor_loss=0.0)
    >>> one = pipe_parameters(line, Liquid(), far=0.0, relief_back=0.0, step=3e-3, waves=True)[0]
    >>> int(one["reaches"]), round(float(one["inertance"] * 5.0265e-3 / 998.2), 3)  # 1 m is left
    (3, 1.0)
    """
    speed = line.wave_speed
    assert speed is not None  # ensured by the scene
    area = math.pi / 4 * line.diameter**2
    dynamic = 0.5 * liquid.density / area**2
    reaches = math.floor(line.length / (speed * step) * (1 + _ROUNDING)) if waves else 0
    left = max(0.0, line.length - reaches * speed * step)
    if left < _ROUNDING * line.length:
        left = 0.0
    friction = dynamic * line.friction_factor / line.diameter  # per metre
    whole = line.length * area / (liquid.density * speed**2)
    values = {
        "reaches": reaches,
        "far": far,
        "inertance": liquid.density * left / area,
        "far_loss": dynamic * line.minor_loss + friction * left,
        "impedance": liquid.density * speed / area,
        "reach_loss": friction * speed * step,
        "compliance": 0.0 if waves else FIRST_MODE * whole,
        "reach_volume": area * (speed * step if reaches else line.length),
        "vapour": liquid.vapour_pressure - STANDARD_ATMOSPHERE,
        **_damper_values(line, far),
        **_relief_values(line, liquid, relief_back),
    }
    values["fixed"] = values["inertance"] == values["far_loss"] == 0.0 and reaches == 0
    record = np.zeros(1, dtype=PIPE)
    for name, value in values.items():
        record[name] = value
    return record


_ROUNDING = 1e-9  # tolerance for a whole number of reaches


def _damper_values(line: Line, far: float) -> dict[str, float]:
    if line.damper is None:
        return {"gas_volume": 0.0, "gas_pressure": 1.0, "gas_exponent": 1.0}
    return {
        "gas_volume": line.damper.gas_volume,
        "gas_pressure": far + STANDARD_ATMOSPHERE,
        "gas_exponent": line.damper.exponent,
    }


def _relief_values(line: Line, liquid: Liquid, back: float) -> dict[str, float]:
    relief = line.relief
    if relief is None:
        return {"relief_full": 0.0}
    bore = math.pi / 4 * relief.diameter**2
    return {
        "relief_opens": relief.set_pressure,
        "relief_full": relief.accumulation * relief.set_pressure,
        "relief_conductance": relief.discharge_coefficient * bore * math.sqrt(2 / liquid.density),
        "relief_back": back,
    }


def steady_pressure(pipe: Any, flow: float) -> float:
    """Pressure at the node at a steady flow [Pa].

    Parameters
    ----------
    pipe : record of dtype PIPE
    flow : float
        Flow towards the pump [m^3/s].
    """
    loss = float(pipe["far_loss"] + pipe["reaches"] * pipe["reach_loss"])
    return float(pipe["far"]) - loss * flow * abs(flow)


def pipe_start(pipe: Any, flow: float) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """State of a pipe with a steady flow.

    Parameters
    ----------
    pipe : record of dtype PIPE
    flow : float
        Flow towards the pump [m^3/s].

    Returns
    -------
    state : numpy.ndarray [shape=(1,), dtype=PIPE_STATE]
    nodes : numpy.ndarray [shape=(4, n_reaches + 1)]
        Rows as PRESSURE, ARRIVES, LEAVES, VOID.
    """
    n = int(pipe["reaches"])
    at_node = max(steady_pressure(pipe, flow), float(pipe["vapour"]))
    nodes = np.zeros((4, n + 1))
    nodes[PRESSURE] = at_node + float(pipe["reach_loss"]) * flow * abs(flow) * np.arange(n + 1)
    nodes[ARRIVES] = nodes[LEAVES] = flow
    state = np.zeros(1, dtype=PIPE_STATE)
    state["mean"] = state["end"] = at_node
    state["column_mean"] = state["column_end"] = state["drawn"] = flow
    state["gas"] = gas_volume(at_node + STANDARD_ATMOSPHERE, pipe)
    return state, nodes


# --- the equation of the node


@kernel
def gas_volume(pressure: float, pipe: Any) -> float:
    """Volume of the damper's gas at an absolute pressure [m^3]; 0 without gas."""
    if pipe.gas_volume == 0.0:
        return 0.0
    volume: float = pipe.gas_volume * (pipe.gas_pressure / pressure) ** (1.0 / pipe.gas_exponent)
    return volume


@kernel
def _column(drive: float, back: float, loss: float) -> Any:
    """Flow of ``back Q + loss Q |Q| = drive``, and its derivative by the drive."""
    root = math.sqrt(back * back + 4.0 * loss * abs(drive))
    return 2.0 * drive / (back + root), 1.0 / root


@kernel
def _column_drive(pipe: Any, state: Any, h: float) -> Any:
    """Inertia terms of a rigid column: added driving pressure, and resistance to its flow.

    ``I (Q_end - Q_begin) / h``, with the flow at the end extrapolated from the means of two steps.
    """
    per_step = pipe.inertance / h
    return per_step * (0.5 * state.column_mean + state.column_end), 1.5 * per_step


@kernel
def pipe_flow(p: float, pipe: Any, state: Any, nodes: Any, h: float) -> Any:
    """Flow of the pipe into the node at a mean pressure p of the step, and its slope.

    Parameters
    ----------
    p : float
        Mean pressure [Pa gauge].
    pipe : record of dtype PIPE
        Pipe that is not fixed.
    state : record of dtype PIPE_STATE
    nodes : numpy.ndarray [shape=(4, n_reaches + 1)]
    h : float
        Step [s].

    Returns
    -------
    flow, slope : float
        [m^3/s], [m^3/s/Pa]; the slope is negative.
    """
    if pipe.reaches == 0:
        push, back = _column_drive(pipe, state, h)
        flow, slope = _column(pipe.far - p + push, back, pipe.far_loss)
        return flow, -slope
    flow = nodes[LEAVES, 1]
    back = pipe.impedance + pipe.reach_loss * abs(flow)
    return (nodes[PRESSURE, 1] + pipe.impedance * flow - p) / back, -1.0 / back


@kernel
def _end(p: float, state: Any) -> float:
    """Pressure at the end of the step, from its mean and that of the last step."""
    end: float = 1.5 * p - 0.5 * state.mean
    return end


@kernel
def _gas_end(p: float, state: Any) -> Any:
    """The same, absolute, for a gas, whose pressure stays positive; and its slope."""
    absolute, least = _end(p, state) + STANDARD_ATMOSPHERE, p + STANDARD_ATMOSPHERE
    if absolute >= _STEEPEST_FALL * least:
        return absolute, 1.5
    return _STEEPEST_FALL * least, _STEEPEST_FALL


@kernel
def demand(p: float, pipe: Any, state: Any, h: float) -> Any:
    """Flow into spring, damper and relief valve of the node, and its slope.

    Parameters
    ----------
    p : float
        Mean pressure of the step [Pa gauge].
    pipe : record of dtype PIPE
    state : record of dtype PIPE_STATE
    h : float
        Step [s].

    Returns
    -------
    flow, slope : float
        [m^3/s], [m^3/s/Pa]; the slope is not negative.
    """
    per_step = pipe.compliance / h
    flow, slope = per_step * (_end(p, state) - state.end), 1.5 * per_step
    if pipe.gas_volume > 0.0:
        end, per_mean = _gas_end(p, state)
        volume = gas_volume(end, pipe)
        flow += (state.gas - volume) / h
        slope += volume / (pipe.gas_exponent * end) * per_mean / h
    if pipe.relief_full > 0.0 and p > pipe.relief_opens and p > pipe.relief_back:
        share = (p - pipe.relief_opens) / pipe.relief_full
        root = pipe.relief_conductance * math.sqrt(p - pipe.relief_back)
        flow += min(share, 1.0) * root
        slope += min(share, 1.0) * 0.5 * root / (p - pipe.relief_back)
        slope += root / pipe.relief_full if share < 1.0 else 0.0
    return flow, slope


@kernel
def excess(p: float, drawn: float, pipe: Any, state: Any, nodes: Any, h: float) -> Any:
    """Outflow of the node in excess of its inflow, including vapour, and its slope.

    Parameters
    ----------
    p : float
        Mean pressure of the step [Pa gauge].
    drawn : float
        Flow that the pump draws [m^3/s].
    pipe, state, nodes, h
        As in :func:`pipe_flow`.

    Returns
    -------
    flow, slope : float
        [m^3/s], [m^3/s/Pa]; it rises with p. Zero at the node's pressure; if it is positive even at
        the vapour pressure, h times it is the volume of vapour.
    """
    arrives, per_arrival = pipe_flow(p, pipe, state, nodes, h)
    taken, per_taken = demand(p, pipe, state, h)
    return state.void / h + drawn + taken - arrives, per_taken - per_arrival


@kernel
def _settled(p: float, gap: float, slope: float, pipe: Any) -> bool:
    """Whether an excess is small enough, as the pressure error of the pipe alone."""
    if p <= pipe.vapour and gap >= 0.0:
        return True
    return abs(gap) <= _TOLERANCE * (p + STANDARD_ATMOSPHERE) * slope


_TOLERANCE = 1e-8  # of the absolute pressure; the rest is booked as volume and compensated


SEARCH = np.dtype(
    [
        ("pressure", "f8"),  # current trial [Pa gauge]
        ("low", "f8"),  # negative excess there
        ("high", "f8"),  # positive excess there
        ("tries", "i8"),  # in this step
    ]
)
"""A search for the pressure of a node at a given flow."""

MOST_TRIES = 40
"""Largest number of trials; the remaining excess is booked as volume and compensated in the next
steps."""


@kernel
def begin_search(search: Any, pipe: Any, state: Any) -> None:
    """Set the first trial of a step: pressure extrapolated from the last two means.

    Parameters
    ----------
    search : record of dtype SEARCH
    pipe : record of dtype PIPE
    state : record of dtype PIPE_STATE
    """
    search.tries = 0
    search.low, search.high = -math.inf, math.inf
    guess = pipe.far if pipe.fixed != 0 else 2.0 * state.end - state.mean
    search.pressure = max(guess, pipe.vapour)


@kernel
def seek(search: Any, drawn: float, pipe: Any, state: Any, nodes: Any, h: float) -> bool:
    """Whether the last trial has converged; otherwise set the next one in the search.

    Parameters
    ----------
    search : record of dtype SEARCH
    drawn : float
        Flow that the pump draws [m^3/s].
    pipe, state, nodes, h
        As in :func:`pipe_flow`.

    Notes
    -----
    Newton's method inside the bracket of earlier trials.
    """
    if pipe.fixed != 0:
        return True
    p = search.pressure
    gap, slope = excess(p, drawn, pipe, state, nodes, h)
    if _settled(p, gap, slope, pipe) or search.tries >= MOST_TRIES:
        return True
    if gap > 0.0:
        search.high = p
    else:
        search.low = p
    search.tries += 1
    after = max(p - gap / slope, pipe.vapour)
    between = math.isfinite(search.high - search.low)
    if between and (not (search.low < after < search.high) or search.tries % 4 == 0):
        after = 0.5 * (search.low + search.high)
    search.pressure = after
    return False


# --- the end of the step


@kernel
def advance_pipe(p: float, drawn: float, pipe: Any, state: Any, nodes: Any, h: float) -> None:
    """Advance a pipe by one step.

    Parameters
    ----------
    p : float
        Mean pressure of its node [Pa gauge], where :func:`excess` is zero, or the vapour pressure.
    drawn : float
        Flow that the pump drew [m^3/s].
    pipe : record of dtype PIPE
    state : record of dtype PIPE_STATE
    nodes : numpy.ndarray [shape=(4, n_reaches + 1)]
        Both are replaced by those at the end of the step.
    h : float
        Step [s].

    Notes
    -----
    Between nodes the method of characteristics: along ``dx/dt = -+a``, with a reach of one step,
    ``p +- Z Q`` is constant except for friction ``R Q |Q'|``, implicit in Q [1]_. If the pressure
    would fall below the vapour pressure, the difference of outflow and inflow of a node is vapour,
    a discrete cavity [1]_. Its volume and all others are conserved to rounding.

    Column, spring and gas use BDF2 in a form that conserves the volumes: the mean of a step is
    two thirds of its end and one third of the last mean. The numerical damping is ``(omega h)^3 /
    4`` of critical.

    References
    ----------
    .. [1] E. B. Wylie, V. L. Streeter, Fluid Transients in Systems, Prentice Hall 1993, on the
       method of characteristics and on column separation.
    """
    if pipe.fixed != 0:
        state.drawn = state.column_mean = drawn
        state.mean = state.end = pipe.far
        return
    gap, _ = excess(p, drawn, pipe, state, nodes, h)
    arrives, _ = pipe_flow(p, pipe, state, nodes, h)
    parted = p <= pipe.vapour and gap > 0.0
    if pipe.reaches > 0:
        parted |= _advance_nodes(p, arrives, pipe, state, nodes, h)
    else:
        _advance_column(arrives, state)
        nodes[PRESSURE, 0], nodes[ARRIVES, 0] = p, arrives
    nodes[LEAVES, 0] = drawn
    state.void = h * gap
    nodes[VOID, 0] = state.void if p <= pipe.vapour else 0.0
    state.parted += parted
    if pipe.gas_volume > 0.0:
        state.gas = gas_volume(_gas_end(p, state)[0], pipe)
    state.end = _end(p, state)
    state.mean = p
    state.drawn = drawn


@kernel
def _advance_column(flow: float, state: Any) -> None:
    state.column_end = 1.5 * flow - 0.5 * state.column_mean
    state.column_mean = flow


@kernel
def _advance_nodes(p: float, arrives: float, pipe: Any, state: Any, nodes: Any, h: float) -> bool:
    """One sweep from the pump to the far end; old values are kept for the next node.

    Returns whether a node holds vapour.
    """
    parted = False
    z, loss, n = pipe.impedance, pipe.reach_loss, pipe.reaches
    p_near, q_near = nodes[PRESSURE, 0], nodes[ARRIVES, 0]
    nodes[PRESSURE, 0], nodes[ARRIVES, 0] = p, arrives
    for i in range(1, n):
        p_far, q_far = nodes[PRESSURE, i + 1], nodes[LEAVES, i + 1]
        down, up = z + loss * abs(q_far), z + loss * abs(q_near)
        from_far, from_near = p_far + z * q_far, p_near - z * q_near
        p_near, q_near = nodes[PRESSURE, i], nodes[ARRIVES, i]
        void = nodes[VOID, i]
        own = (from_far * up + from_near * down - void / h * up * down) / (up + down)
        if own >= pipe.vapour:
            nodes[PRESSURE, i], nodes[VOID, i] = own, 0.0
            nodes[ARRIVES, i] = (from_far - own) / down
            # inflow into a closing cavity; otherwise the same to rounding
            nodes[LEAVES, i] = (own - from_near) / up if void > 0.0 else nodes[ARRIVES, i]
        else:
            own = pipe.vapour
            nodes[PRESSURE, i] = own
            nodes[ARRIVES, i], nodes[LEAVES, i] = (from_far - own) / down, (own - from_near) / up
            nodes[VOID, i] = void + h * (nodes[LEAVES, i] - nodes[ARRIVES, i])
            parted = True
    push, back = _column_drive(pipe, state, h)
    up = z + loss * abs(q_near)
    from_near = p_near - z * q_near
    flow, _ = _column(pipe.far - from_near + push, back + up, pipe.far_loss)
    nodes[PRESSURE, n] = from_near + up * flow
    nodes[ARRIVES, n] = nodes[LEAVES, n] = flow
    _advance_column(flow, state)
    return parted


def drive_pipe(
    pipes: NDArray[np.void],
    states: NDArray[np.void],
    nodes: NDArray[np.float64],
    drawn: NDArray[np.float64],
    h: float,
    pressure: NDArray[np.float64],
    entering: NDArray[np.float64],
) -> None:
    """March one pipe with a given flow at its node.

    Parameters
    ----------
    pipes : numpy.ndarray [shape=(1,), dtype=PIPE]
    states : numpy.ndarray [shape=(1,), dtype=PIPE_STATE]
        From :func:`pipe_start`; replaced by the final state, like `nodes`.
    nodes : numpy.ndarray [shape=(4, n_reaches + 1)]
    drawn : numpy.ndarray [shape=(n_steps,)]
        Flow that the pump draws, means over the steps [m^3/s].
    h : float
        Step [s].
    pressure, entering : numpy.ndarray [shape=(n_steps,)]
        Filled with the node's pressure [Pa gauge] and the flow at the far end [m^3/s], means.

    Examples
    --------
    A column of water stopped at once strikes with ``rho a u``, Joukowsky's surge:

    >>> line = Line(length=12.0, wave_speed=1200.0, friction_factor=0.0, minor_loss=0.0)
    >>> pipes = pipe_parameters(line, Liquid(), far=3e5, relief_back=0.0, step=1e-4, waves=True)
    >>> states, nodes = pipe_start(pipes[0], math.pi / 4 * 0.08**2)  # 1 m/s
    >>> pressure, entering = np.zeros(50), np.zeros(50)
    >>> drive_pipe(pipes, states, nodes, np.zeros(50), 1e-4, pressure, entering)
    >>> round(pressure[10] - 3e5)  # 998.2 kg/m^3 times 1200 m/s
    1197840
    """
    _drive(pipes, states, nodes, np.zeros(1, SEARCH), drawn, h, pressure, entering)


@kernel
def _drive(
    pipes: Any,
    states: Any,
    nodes: Any,
    searches: Any,
    drawn: Any,
    h: float,
    pressure: Any,
    entering: Any,
) -> None:
    pipe, state, search = pipes[0], states[0], searches[0]
    for i in range(drawn.size):
        begin_search(search, pipe, state)
        while not seek(search, drawn[i], pipe, state, nodes, h):
            pass
        advance_pipe(search.pressure, drawn[i], pipe, state, nodes, h)
        pressure[i] = search.pressure
        entering[i] = state.column_mean
