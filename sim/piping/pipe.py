"""One pipe between a far end at constant pressure and a node at the pump, compiled.

The flow Q counts towards the pump, on the discharge side too. A step of length h works with means
over the step: what a pump draws from the node is a volume, the node's pressure p its mean. All
that the node takes up by itself is a function of p alone, so a step solves one equation for p::

    pipe_flow(p) = q + demand(p) + void / h

with the flow q that the pump draws, what spring, gas and relief valve take (:func:`demand`), and
the volume of vapour at the node (:func:`excess`). :func:`seek` finds p under a given q; where q
depends on the pressures of two pipes in turn, :mod:`wearstate.sim.piping.coupling` finds both.

A pipe is a rigid column with a spring at the node (*lumped-lines*), or carries waves between nodes
one step of travel apart (*wave-lines*); what is left of its length beside whole reaches is a rigid
column at the far end, where the pressure does not change and a spring would do nothing.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..jit import kernel
from ..scene.pump_hydraulics import STANDARD_ATMOSPHERE, Line, Liquid

PIPE = np.dtype(
    [
        ("fixed", "i8"),  # 1: nothing between the far end and the node
        ("reaches", "i8"),  # of one step of travel each; 0: a rigid column alone
        ("far", "f8"),  # pressure at the far end, brought to the pump's height [Pa]
        ("inertance", "f8"),  # of the rigid column [kg/m^4]
        ("far_loss", "f8"),  # of the rigid column and the fittings [Pa s^2/m^6]
        ("impedance", "f8"),  # rho a / A [Pa s/m^3]
        ("reach_loss", "f8"),  # friction of one reach [Pa s^2/m^6]
        ("compliance", "f8"),  # of the spring at the node [m^3/Pa]
        ("reach_volume", "f8"),  # liquid of one reach [m^3]; of the whole pipe where it has none
        ("gas_volume", "f8"),  # of the damper at rest [m^3]; 0: none
        ("gas_pressure", "f8"),  # at rest, absolute [Pa]
        ("gas_exponent", "f8"),
        ("relief_opens", "f8"),  # [Pa gauge]
        ("relief_full", "f8"),  # pressure above it at which the valve is fully open [Pa]; 0: none
        ("relief_conductance", "f8"),  # fully open [m^3/s/sqrt(Pa)]
        ("relief_back", "f8"),  # pressure that it lets out to [Pa]
        ("vapour", "f8"),  # [Pa gauge]
    ]
)
"""One pipe in SI, as :func:`pipe_parameters` makes it."""

PIPE_STATE = np.dtype(
    [
        ("mean", "f8"),  # pressure at the node over the last step [Pa]
        ("end", "f8"),  # at its end
        ("column_mean", "f8"),  # flow of the rigid column over the last step [m^3/s]
        ("column_end", "f8"),  # at its end
        ("gas", "f8"),  # volume in the damper [m^3]
        ("void", "f8"),  # vapour at the node, and what a step's equation was left open by [m^3]
        ("drawn", "f8"),  # flow that the pump drew in the last step [m^3/s]
        ("parted", "i8"),  # steps with vapour anywhere in the pipe
        ("unsettled", "i8"),  # steps whose search ended with more left over than it may
    ]
)
"""What one pipe remembers from step to step, beside its inner nodes."""

PRESSURE, ARRIVES, LEAVES, VOID = range(4)
"""Rows of the inner nodes: pressure [Pa], flow that arrives from the far side and that leaves to
the pump's side [m^3/s], volume of vapour [m^3]; columns from the pump (0) to the far end."""

FEWEST_REACHES = 5
"""Of a pipe with waves: the first organ-pipe frequency is then within 0.5 %, see the tests."""

FIRST_MODE = 4 / math.pi**2
"""Share of a pipe's compliance that is lumped at its closed end: with it, and the whole inertance,
the first organ-pipe frequency a / 4 L is exact. Deformed as in statics it would be 1/3."""

_STEEPEST_FALL = 0.1  # of the mean pressure: the least that a damper's gas is extrapolated to


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
        With its wave speed.
    liquid : Liquid
    far : float
        Pressure at the far end, brought to the height of the pump [Pa gauge].
    relief_back : float
        Pressure that a relief valve lets out to [Pa gauge].
    step : float
        [s]
    waves : bool
        Waves between the ends; else a column on a spring.

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
    assert speed is not None  # the scene has seen to it
    area = math.pi / 4 * line.diameter**2
    dynamic = 0.5 * liquid.density / area**2
    reaches = math.floor(line.length / (speed * step) * (1 + _ROUNDING)) if waves else 0
    left = max(0.0, line.length - reaches * speed * step)
    if left < _ROUNDING * line.length:
        left = 0.0
    friction = dynamic * line.friction_factor / line.diameter  # of a metre
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


_ROUNDING = 1e-9  # of a number of reaches that would be whole


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
    """Pressure at the node under a steady flow [Pa].

    Parameters
    ----------
    pipe : record of dtype PIPE
    flow : float
        Towards the pump [m^3/s].
    """
    loss = float(pipe["far_loss"] + pipe["reaches"] * pipe["reach_loss"])
    return float(pipe["far"]) - loss * flow * abs(flow)


def pipe_start(pipe: Any, flow: float) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """State of a pipe that carries a steady flow.

    Parameters
    ----------
    pipe : record of dtype PIPE
    flow : float
        Towards the pump [m^3/s].

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
    """Volume of the damper's gas at an absolute pressure [m^3]; 0 where there is none."""
    if pipe.gas_volume == 0.0:
        return 0.0
    volume: float = pipe.gas_volume * (pipe.gas_pressure / pressure) ** (1.0 / pipe.gas_exponent)
    return volume


@kernel
def _column(drive: float, back: float, loss: float) -> Any:
    """Flow of ``back Q + loss Q |Q| = drive``, and its slope over the drive."""
    root = math.sqrt(back * back + 4.0 * loss * abs(drive))
    return 2.0 * drive / (back + root), 1.0 / root


@kernel
def _column_drive(pipe: Any, state: Any, h: float) -> Any:
    """What a rigid column's inertia adds to its driving pressure, and what holds its flow back.

    ``I (Q_end - Q_begin) / h``, the flow at the end extrapolated from the means of two steps.
    """
    per_step = pipe.inertance / h
    return per_step * (0.5 * state.column_mean + state.column_end), 1.5 * per_step


@kernel
def pipe_flow(p: float, pipe: Any, state: Any, nodes: Any, h: float) -> Any:
    """Flow of the pipe into the node at a mean pressure p of the step, and its slope.

    Parameters
    ----------
    p : float
        [Pa gauge]
    pipe : record of dtype PIPE
        Not fixed.
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
    """Pressure at the end of the step, from its mean and that of the step before."""
    end: float = 1.5 * p - 0.5 * state.mean
    return end


@kernel
def _gas_end(p: float, state: Any) -> Any:
    """The same, absolute, for a gas, which has no pressure below zero; and its slope."""
    absolute, least = _end(p, state) + STANDARD_ATMOSPHERE, p + STANDARD_ATMOSPHERE
    if absolute >= _STEEPEST_FALL * least:
        return absolute, 1.5
    return _STEEPEST_FALL * least, _STEEPEST_FALL


@kernel
def demand(p: float, pipe: Any, state: Any, h: float) -> Any:
    """Flow that spring, damper and relief valve of the node take up, and its slope.

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
    """By what more is taken from the node than reaches it, vapour included, and its slope.

    Parameters
    ----------
    p : float
        Mean pressure of the step [Pa gauge].
    drawn : float
        Flow that the pump draws [m^3/s].
    pipe, state, nodes, h
        As of :func:`pipe_flow`.

    Returns
    -------
    flow, slope : float
        [m^3/s], [m^3/s/Pa]; it rises with p. Zero at the node's pressure; where it is positive at
        the vapour pressure already, h times it is the volume of the vapour.
    """
    arrives, per_arrival = pipe_flow(p, pipe, state, nodes, h)
    taken, per_taken = demand(p, pipe, state, h)
    return state.void / h + drawn + taken - arrives, per_taken - per_arrival


@kernel
def _settled(p: float, gap: float, slope: float, pipe: Any) -> bool:
    """Whether an excess is small enough, as the pressure that the pipe alone would be off by."""
    if p <= pipe.vapour and gap >= 0.0:
        return True
    return abs(gap) <= _TOLERANCE * (p + STANDARD_ATMOSPHERE) * slope


_TOLERANCE = 1e-8  # of the absolute pressure; what is left is booked as volume and made up for


SEARCH = np.dtype(
    [
        ("pressure", "f8"),  # tried at present [Pa gauge]
        ("low", "f8"),  # excess was negative there
        ("high", "f8"),  # excess was positive there
        ("tries", "i8"),  # in this step
    ]
)
"""A search for the pressure of a node under a given flow."""

MOST_TRIES = 40
"""Of a search: what is then left over is booked as volume, and made up for in the next steps."""


@kernel
def begin_search(search: Any, pipe: Any, state: Any) -> None:
    """First pressure to be tried in a step: extrapolated from the means of the last two.

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
    """Whether the pressure tried last is that of the node; else the next one is in the search.

    Parameters
    ----------
    search : record of dtype SEARCH
    drawn : float
        Flow that the pump draws [m^3/s].
    pipe, state, nodes, h
        As of :func:`pipe_flow`.

    Notes
    -----
    Newton, kept inside what was tried.
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
    """Advance a pipe over a step.

    Parameters
    ----------
    p : float
        Mean pressure of its node [Pa gauge], where :func:`excess` is zero, or that of the vapour.
    drawn : float
        Flow that the pump drew [m^3/s].
    pipe : record of dtype PIPE
    state : record of dtype PIPE_STATE
    nodes : numpy.ndarray [shape=(4, n_reaches + 1)]
        Both are replaced by those at the end of the step.
    h : float
        [s]

    Notes
    -----
    Between nodes the method of characteristics: along ``dx/dt = -+a``, with a reach of one step,
    ``p +- Z Q`` is kept but for friction ``R Q |Q'|``, implicit in Q [1]_. What leaves a node less
    what arrives is vapour where the pressure would fall below its own, a discrete cavity [1]_. Its
    volume and all others are kept to rounding.

    Column, spring and gas take BDF2 in such a form that the volumes close: the mean of a step is
    two thirds of its end and one of the mean before. Damped as ``(omega h)^3 / 4`` of the critical.

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
    """One sweep from the pump to the far end; what a node had before is kept for the next one.

    True where a node holds vapour.
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
            # what a closing cavity swallows; else the same to rounding
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
    """March one pipe under a given flow at its node.

    Parameters
    ----------
    pipes : numpy.ndarray [shape=(1,), dtype=PIPE]
    states : numpy.ndarray [shape=(1,), dtype=PIPE_STATE]
        As :func:`pipe_start` makes it; replaced by that at the end, with `nodes`.
    nodes : numpy.ndarray [shape=(4, n_reaches + 1)]
    drawn : numpy.ndarray [shape=(n_steps,)]
        Flow that the pump draws, means over the steps [m^3/s].
    h : float
        [s]
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
