"""Oil film that conserves mass through cavitation (Jakobsson, Floberg, Olsson; Elrod, Adams).

Where the film has ruptured the pressure is zero and the gap is partly filled: the film fraction
``fill`` <= 1 takes the place of the pressure as the unknown. Non-dimensional as in
:mod:`.film.solve`,

    d/dtheta(6 fill H - H^3 dP/dtheta) - (R/L)^2 d/dz(H^3 dP/dz) + 12 d(fill H)/dtau = 0
    P >= 0,  fill <= 1,  P (1 - fill) = 0

balanced over the cells of the direct solver's mesh, the film fraction carried from upstream. A
cell belongs to the full set (its pressure is unknown) or to the cavitated one (its film fraction
is); for given sets the balance is linear, and for any sets its matrix is diagonally dominant
by columns, because no cell can pass on more than it receives. Cells change sets until the sets
settle, mostly after five to ten banded solutions.

Oil enters from grooves, from ends under pressure, and under the condition ``"reynolds"`` of a
bearing without grooves from a line at the widest gap that is kept full at zero pressure.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

from ..jit import kernel
from .solve import (
    LEAST_CELLS,
    FilmGeometry,
    FilmSolution,
    FilmState,
    FilmStatus,
    film_gap,
    groove_nodes,
)

_SETTLED = 1e-12  # of the highest pressure, and of a full gap: tolerated tension or overfill
_LOSS = 1e-13  # of the stream: drains a steady ring without supply, which is otherwise undetermined
_MOST_SETS = 100  # 3500 random films, from any start, settled within 50

EndPressure = float | tuple[float, float]
"""Pressure of both ends, or at z = -1/2 and z = 1/2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MassStep:
    """Film after a time step, and the oil that entered it.

    Attributes
    ----------
    solution : FilmSolution
        Pressure, force and film fraction at the end of the step.
    oil : numpy.ndarray [shape=(n_theta, n_z)]
        Oil on unit area over C, the input of the next step.
    intake : numpy.ndarray [shape=(n_theta, n_z)]
        Volume over R L C that each cell took in from outside during the step: from grooves;
        negative at the ends; zero to rounding elsewhere. Its sum is the change of
        :func:`oil_volume`.
    """

    solution: FilmSolution
    oil: NDArray[np.float64]
    intake: NDArray[np.float64]


class _Cells(NamedTuple):
    """Balance of every cell of a mesh; ends and grooves are held at a fixed state.

    ``(convect + store) fill - convect' fill' = flow in by pressure + source``, where a prime is
    upstream and ``along`` and ``across`` conduct to the next line and the next node of the line.
    """

    convect: NDArray[np.float64]  # (n, k)
    along: NDArray[np.float64]  # (n, k)
    across: NDArray[np.float64]  # (n, k), its last column unused
    store: NDArray[np.float64]  # (n, k)
    source: NDArray[np.float64]  # (n, k)
    held: NDArray[np.int8]  # (n, k)
    pressure: NDArray[np.float64]  # where held (n, k)
    place: NDArray[np.int64]  # of each line in the order of elimination (n,)
    rows: int  # unknowns in each line: columns 1 to rows


class _Answer(NamedTuple):
    pressure: NDArray[np.float64]
    fill: NDArray[np.float64]
    iterations: int
    settled: bool


# --- what a user calls


def mass_conserving(
    geometry: FilmGeometry,
    state: FilmState,
    start: FilmSolution | None = None,
    *,
    end_pressure: EndPressure = 0.0,
    end_fill: float = 1.0,
) -> FilmSolution:
    """Film with mass-conserving cavitation: steady, or perturbed by a given velocity.

    Parameters
    ----------
    geometry : FilmGeometry
        Its condition determines the oil supply without grooves: the widest gap
        (``"reynolds"``) or none.
    state : FilmState
        If rates are given, the film is the steady one of this position, advanced by the time in
        which oil is carried over one cell at these rates.
    start : FilmSolution, optional
        Solution on this mesh; its full and cavitated cells are tried first. Does not change the
        result.
    end_pressure : float or (float, float)
        Non-dimensional pressure P >= 0 at both ends, or at z = -1/2 and z = 1/2; if it is above
        zero the end is flooded.
    end_fill : float
        Film fraction of the ends in [0, 1]; affects only the volume of oil, since nothing flows in
        from an end at zero pressure.

    Returns
    -------
    FilmSolution
        With `fill`. ``FilmStatus.STARVED`` and no pressure if no oil can enter.

    Raises
    ------
    ValueError
        An end's pressure or film fraction is out of bounds.

    Notes
    -----
    A moving journal has no steady film: with its film fraction held, a closing gap would lose oil,
    and the film would not be unique. Use :func:`mass_step` to follow a motion in time. First order
    in the mesh where the film ruptures and forms again: forces within 0.5 %, film fractions within
    0.01 on 100 x 25.

    References
    ----------
    .. [1] H. G. Elrod, "A cavitation algorithm", J. Lubr. Technol. 103 (1981) 350-354,
       doi:10.1115/1.3251669.
    .. [2] A. Kumar, J. F. Booker, "A finite element cavitation algorithm", J. Tribol. 113 (1991)
       276-284, doi:10.1115/1.2920617.

    Examples
    --------
    >>> from wearstate.sim.film.solve import Groove
    >>> groove = Groove(angle=1.571, width=0.262, length_share=0.75, pressure=0.2)
    >>> geometry = FilmGeometry(length_to_diameter=0.8, grooves=(groove,))
    >>> solution = mass_conserving(geometry, FilmState(x=0.5, y=0.0))
    >>> round(solution.cavitated_share, 2), solution.iterations < 20
    (0.42, True)
    """
    _require_ends(end_pressure, end_fill)
    held = _held(geometry, state, end_pressure)
    least = _least_gap(geometry, state)
    if not least > 0.0:
        return _failed(geometry, FilmStatus.TOUCH, least)
    if not (held[0][:, 1:-1].any() or max(_both(end_pressure)) > 0.0):
        return _failed(geometry, FilmStatus.STARVED, least)
    cells = _cells(geometry, state, held)
    mirrored = not state.tilted and _alike(end_pressure)
    answer = _solve(cells, mirrored, end_fill, None if start is None else start.fill)
    if answer.settled and _moves(state):
        oil, step = _oil_before(geometry, state, answer.fill)
        cells = _moving_cells(geometry, state, held, oil, step)
        after = _solve(cells, mirrored, end_fill, answer.fill)
        answer = after._replace(iterations=answer.iterations + after.iterations)
    return _solution(geometry, state, cells, answer, least)


def mass_step(
    geometry: FilmGeometry,
    state: FilmState,
    oil: NDArray[np.float64],
    step: float,
    start: FilmSolution | None = None,
    *,
    end_pressure: EndPressure = 0.0,
    end_fill: float = 1.0,
) -> MassStep:
    """Advance the film by one time step of the implicit Euler method.

    Parameters
    ----------
    geometry : FilmGeometry
        As in :func:`mass_conserving`; without groove, line and flooded ends the film loses oil.
    state : FilmState
        Position at the end of the step; its rates are ignored, as `oil` implies them.
    oil : numpy.ndarray [shape=(n_theta, n_z)]
        On unit area over C >= 0, before the step: from :func:`oil_in_gap` or the last step.
    step : float
        In tau, > 0.
    start : FilmSolution, optional
        As in :func:`mass_conserving`, usually the solution of the last step.
    end_pressure, end_fill : float
        As in :func:`mass_conserving`.

    Returns
    -------
    MassStep
        Stable for any step; first order in the step.

    Raises
    ------
    ValueError
        Oil, step, or an end's pressure or film fraction is out of bounds.

    Examples
    --------
    >>> geometry = FilmGeometry(length_to_diameter=0.5)
    >>> oil = oil_in_gap(geometry, FilmState(x=0.5, y=0.0), 0.8)
    >>> after = mass_step(geometry, FilmState(x=0.5, y=0.01), oil, 0.02)
    >>> change = oil_volume(after.oil) - oil_volume(oil)
    >>> abs(change - float(after.intake.sum())) < 1e-12
    True
    """
    _require_ends(end_pressure, end_fill)
    _require_oil(geometry, oil, step)
    least = _least_gap(geometry, state)
    if not least > 0.0:
        return MassStep(
            solution=_failed(geometry, FilmStatus.TOUCH, least),
            oil=oil,
            intake=np.zeros_like(oil),
        )
    cells = _moving_cells(geometry, state, _held(geometry, state, end_pressure), oil, step)
    mirrored = not state.tilted and _alike(end_pressure) and bool(np.array_equal(oil, oil[:, ::-1]))
    answer = _solve(cells, mirrored, end_fill, None if start is None else start.fill)
    return MassStep(
        solution=_solution(geometry, state, cells, answer, least),
        oil=oil_in_gap(geometry, state, answer.fill),
        intake=_excess(cells, answer.pressure, answer.fill) * (step / 12.0),
    )


def oil_in_gap(geometry: FilmGeometry, state: FilmState, fill: ArrayLike) -> NDArray[np.float64]:
    """Oil on unit area over C, the mean of each cell.

    Parameters
    ----------
    geometry : FilmGeometry
    state : FilmState
        Position of the journal.
    fill : float or array_like [shape=(n_theta, n_z)]
        Film fraction.

    Returns
    -------
    numpy.ndarray [shape=(n_theta, n_z)]

    Examples
    --------
    >>> oil = oil_in_gap(FilmGeometry(length_to_diameter=0.5), FilmState(x=0.3, y=0.0), 0.5)
    >>> round(oil_volume(oil), 12) == round(math.pi, 12)  # half of 2 pi
    True
    """
    return np.asarray(fill, dtype=np.float64) * _cell_gap(geometry, state)


def oil_volume(oil: NDArray[np.float64]) -> float:
    """Volume over R L C of the oil of :func:`oil_in_gap`.

    Examples
    --------
    >>> round(oil_volume(np.ones((72, 17))), 6)
    6.283185
    """
    n, k = oil.shape
    volume: float = np.sum(oil * _widths(k)).item() * 2 * math.pi / n
    return volume


def oil_intake(
    geometry: FilmGeometry,
    state: FilmState,
    solution: FilmSolution,
    *,
    end_pressure: EndPressure = 0.0,
) -> NDArray[np.float64]:
    """Oil that each cell of a steady film takes in from outside, volume over R L C in unit tau.

    Parameters
    ----------
    geometry, state, solution, end_pressure
        As passed to and returned by :func:`mass_conserving`, the state at rest.

    Returns
    -------
    numpy.ndarray [shape=(n_theta, n_z)]
        Flow from grooves, negative at the ends, zero to rounding elsewhere. Times
        ``omega R L C`` in [m^3/s]. The leakage is that of the faces half a cell off the ends,
        first order in the mesh: 8 % low with 17 nodes over the length.

    Raises
    ------
    ValueError
        The solution has no film fraction, or the journal moves.

    Examples
    --------
    >>> geometry = FilmGeometry(length_to_diameter=0.5, condition="reynolds")
    >>> state = FilmState(x=0.4, y=0.0)
    >>> intake = oil_intake(geometry, state, mass_conserving(geometry, state))
    >>> leak = -float(intake[:, [0, -1]].sum())
    >>> round(leak, 2), abs(float(intake.sum())) < 1e-12
    (0.35, True)
    """
    if solution.fill is None:
        raise ValueError("solution.fill = None must be a film fraction; use mass_conserving")
    if _moves(state):
        raise ValueError("the state's rates must be 0, the film is not steady; use mass_step")
    cells = _cells(geometry, state, _held(geometry, state, end_pressure))
    return _excess(cells, solution.pressure, solution.fill) / 12.0


# --- mesh


def _both(end_pressure: EndPressure) -> tuple[float, float]:
    """Pressure at z = -1/2 and at z = 1/2."""
    return end_pressure if isinstance(end_pressure, tuple) else (end_pressure, end_pressure)


def _alike(end_pressure: EndPressure) -> bool:
    """Whether the two halves of the length mirror each other."""
    first, last = _both(end_pressure)
    return first == last


def _require_ends(end_pressure: EndPressure, fill: float) -> None:
    faults = []
    both = _both(end_pressure)
    for pressure in both if both[0] != both[1] else both[:1]:
        if not 0.0 <= pressure < math.inf:
            faults.append(f"end_pressure = {pressure:g} must be >= 0 and finite: cavities are at 0")
    if not 0.0 <= fill <= 1.0:
        faults.append(f"end_fill = {fill:g} must be in [0, 1]")
    elif max(both) > 0.0 and fill < 1.0:
        faults.append(f"end_fill = {fill:g} must be 1 at end_pressure = {max(both):g} > 0")
    if faults:
        raise ValueError("; ".join(faults))


def _require_oil(geometry: FilmGeometry, oil: NDArray[np.float64], step: float) -> None:
    shape = (geometry.n_theta, geometry.n_z)
    faults = []
    if oil.shape != shape:
        faults.append(f"oil.shape = {oil.shape} must be {shape}, the geometry's mesh")
    elif not (np.isfinite(oil).all() and oil.min() >= 0.0):
        faults.append(f"least oil = {oil.min():g} must be >= 0 and all finite; use oil_in_gap")
    if not 0.0 < step < math.inf:
        faults.append(f"step = {step:g} must be > 0 and finite")
    if faults:
        raise ValueError("; ".join(faults))


def _widths(k: int) -> NDArray[np.float64]:
    """Share of the length that belongs to each node [shape=(k,)]."""
    width = np.full(k, 1.0 / (k - 1))
    width[[0, -1]] *= 0.5
    return width


def _gap(
    state: FilmState,
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    bore: NDArray[np.float64],
    z: NDArray[np.float64],
) -> NDArray[np.float64]:
    centre = 1.0 - state.x * cosine - state.y * sine + bore
    tilt = state.tilt_x * cosine + state.tilt_y * sine
    return centre[:, None] - tilt[:, None] * z


def _least_gap(geometry: FilmGeometry, state: FilmState) -> float:
    """Least gap over C: at the nodes, or between them on the line of centres at either end."""
    least = float(film_gap(geometry, state).min())
    for z in (-0.5, 0.5):
        x, y = state.x + z * state.tilt_x, state.y + z * state.tilt_y
        place = math.atan2(y, x)
        worn = np.interp(place, _angles(geometry), _bore(geometry), period=2 * math.pi)
        least = min(least, 1.0 - math.hypot(x, y) + float(worn))
    return least


def _resolved(geometry: FilmGeometry, state: FilmState, least: float) -> FilmStatus:
    """Status by the number of cells across the narrow gap, where it is narrowest."""
    gap = film_gap(geometry, state)
    narrow = gap[:, int(np.argmin(gap.min(axis=0)))] < 2.0 * least
    return FilmStatus.COARSE if np.count_nonzero(narrow) < LEAST_CELLS else FilmStatus.OK


def _angles(geometry: FilmGeometry) -> NDArray[np.float64]:
    return 2 * math.pi * np.arange(geometry.n_theta) / geometry.n_theta


def _bore(geometry: FilmGeometry) -> NDArray[np.float64]:
    if geometry.bore is None:
        return np.zeros(geometry.n_theta)
    return np.asarray(geometry.bore, dtype=np.float64)


def _cell_gap(geometry: FilmGeometry, state: FilmState) -> NDArray[np.float64]:
    """Gap over C, the mean of each cell along the circumference, for the oil volume."""
    angle = _angles(geometry)
    mean = math.sin(math.pi / geometry.n_theta) / (math.pi / geometry.n_theta)
    z = np.linspace(-0.5, 0.5, geometry.n_z)
    return _gap(state, mean * np.cos(angle), mean * np.sin(angle), _bore(geometry), z)


_Held = tuple[NDArray[np.int8], NDArray[np.float64]]


def _held(geometry: FilmGeometry, state: FilmState, end_pressure: EndPressure) -> _Held:
    """Cells that are kept full, and their pressure: ends, grooves, or a line at the widest gap."""
    if geometry.inlet_fill < 1:
        raise ValueError(
            f"inlet_fill = {geometry.inlet_fill} works with the direct film only; supply oil by "
            "grooves, pressurised ends or an oil state"
        )
    held, pressure = groove_nodes(geometry)
    if geometry.condition == "reynolds" and not geometry.grooves:
        turn = math.atan2(state.y, state.x) / (2 * math.pi) + 0.5
        line = math.floor(turn * geometry.n_theta + 0.5) % geometry.n_theta
        held[line, 1:-1] = 1
    held[:, [0, -1]] = 1
    pressure[:, [0, -1]] = _both(end_pressure)
    return held, pressure


def _cells(geometry: FilmGeometry, state: FilmState, held: _Held) -> _Cells:
    """Conductances and convection of all cells, without the change in time."""
    n, k = geometry.n_theta, geometry.n_z
    z, width, step = np.linspace(-0.5, 0.5, k), _widths(k), 2 * math.pi / n
    angle, bore = _angles(geometry), _bore(geometry)
    face = angle + 0.5 * step
    face_bore = 0.5 * (bore + np.roll(bore, -1))
    gap = _gap(state, np.cos(face), np.sin(face), face_bore, z)
    # the last column is beyond the end and unused
    between = _gap(state, np.cos(angle), np.sin(angle), bore, z + 0.5 / (k - 1))
    length_factor = 0.25 / geometry.length_to_diameter**2
    return _Cells(
        convect=6.0 * gap * width,
        along=gap**3 * (width / step),
        across=between**3 * (length_factor * step * (k - 1)),
        store=np.zeros((n, k)),
        source=np.zeros((n, k)),
        held=held[0],
        pressure=held[1],
        place=_fold(n),
        rows=k - 2,
    )


def _fold(n: int) -> NDArray[np.int64]:
    """Order of the lines in which neighbours on the circle are at most two apart."""
    line = np.arange(n)
    return np.where(2 * line < n, 2 * line, 2 * (n - line) - 1)


def _moving_cells(
    geometry: FilmGeometry,
    state: FilmState,
    held: _Held,
    oil: NDArray[np.float64],
    step: float,
) -> _Cells:
    area = _widths(geometry.n_z) * (2 * math.pi / geometry.n_theta)
    return _cells(geometry, state, held)._replace(
        store=12.0 / step * _cell_gap(geometry, state) * area, source=12.0 / step * oil * area
    )


def _moves(state: FilmState) -> bool:
    return bool(state.x_rate or state.y_rate or state.tilt_x_rate or state.tilt_y_rate)


def _oil_before(
    geometry: FilmGeometry, state: FilmState, fill: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Oil of a film fraction a short time ago, and that time."""
    rate = FilmState(
        x=state.x_rate, y=state.y_rate, tilt_x=state.tilt_x_rate, tilt_y=state.tilt_y_rate
    )
    gap = _cell_gap(geometry, state)
    # a gap is one less what the position takes off; its rate has neither the one nor the bore
    opening = _cell_gap(geometry, rate) - 1.0 - _bore(geometry)[:, None]
    # oil moves with half of the journal's speed; and there was a gap before
    step = min(4 * math.pi / geometry.n_theta, 0.5 / max(float((opening / gap).max()), 1e-9))
    return fill * (gap - step * opening), step


def _half(cells: _Cells) -> _Cells:
    """Cells from one end to the middle, where a wall closes the middle cells."""
    middle = cells.rows // 2 + 2
    part = {name: getattr(cells, name)[:, :middle].copy() for name in _Cells._fields[:7]}
    for name in ("convect", "along", "store", "source"):
        part[name][:, -1] *= 0.5
    part["across"][:, -1] = 0.0
    return _Cells(**part, place=cells.place, rows=middle - 1)


# --- solution


def _solve(
    cells: _Cells, mirrored: bool, end_fill: float, start: NDArray[np.float64] | None
) -> _Answer:
    """Pressure and film fraction of the whole length."""
    full = np.ones(cells.held.shape, dtype=bool) if start is None else start >= 1.0
    if mirrored:
        answer = _exchange(_half(cells), full[:, : cells.rows // 2 + 2])
        pressure, fill = (np.hstack([a, a[:, -2::-1]]) for a in (answer.pressure, answer.fill))
        answer = answer._replace(pressure=pressure, fill=fill)
    else:
        answer = _exchange(cells, full)
    answer.fill[:, [0, -1]] = end_fill
    return answer


def _exchange(cells: _Cells, full: NDArray[np.bool_]) -> _Answer:
    """Exchange full and cavitated cells until both sets settle."""
    n, rows = full.shape[0], cells.rows
    unknown = slice(1, rows + 1)
    side = 2 * rows  # bands above and below the diagonal each
    band = np.zeros((3 * side + 1, n * rows), order="F")
    right = np.zeros(n * rows)
    free = cells.held[:, unknown] == 0
    full = full | (cells.held != 0)
    value = np.ones((n, rows))
    iterations, settled = 0, False
    while not settled and iterations < _MOST_SETS:
        iterations += 1
        _fill_band(cells, full, band, right)
        _, _, answer, info = lapack.dgbsv(side, side, band, right, overwrite_ab=1, overwrite_b=1)
        if info != 0:  # the balance is singular
            break
        value = answer.reshape(n, rows)[cells.place]
        inner = full[:, unknown]
        pull = _SETTLED * max(float(value[inner & free].max(initial=0.0)), 0.0)
        after = np.where(inner, value >= -pull, value > 1.0 + _SETTLED) | ~free
        settled = bool((after == inner).all())
        if not settled and iterations < _MOST_SETS:
            full[:, unknown] = after
    pressure, fill = cells.pressure.copy(), np.ones(full.shape)
    inner = full[:, unknown]
    pressure[:, unknown] = np.where(inner, np.maximum(value, 0.0), 0.0)
    fill[:, unknown] = np.where(inner, 1.0, np.minimum(value, 1.0))
    return _Answer(pressure=pressure, fill=fill, iterations=iterations, settled=settled)


@kernel
def _fill_band(
    cells: _Cells,
    full: NDArray[np.bool_],
    band: NDArray[np.float64],
    right: NDArray[np.float64],
) -> None:
    """Balance of all cells for the present sets, in the layout of LAPACK's gbsv."""
    n, k = full.shape
    m = cells.rows
    middle = 4 * m  # the band's row that holds the diagonal
    band[:] = 0.0
    for i in range(n):
        before = i - 1 if i > 0 else n - 1
        behind = i + 1 if i < n - 1 else 0
        for j in range(1, m + 1):
            r = cells.place[i] * m + j - 1
            if cells.held[i, j] != 0:
                band[middle, r] = 1.0
                right[r] = cells.pressure[i, j]
                continue
            spread = cells.along[before, j] + cells.along[i, j]
            spread += cells.across[i, j - 1] + cells.across[i, j]
            leave = cells.convect[i, j] * (1.0 + _LOSS) + cells.store[i, j]
            band[middle, r] = spread if full[i, j] else leave
            right[r] = cells.source[i, j] - (leave if full[i, j] else 0.0)
            # upstream, downstream, and the two neighbours in the line
            _couple(cells, full, band, right, r, before, j, cells.along[before, j], 1)
            _couple(cells, full, band, right, r, behind, j, cells.along[i, j], 0)
            _couple(cells, full, band, right, r, i, j - 1, cells.across[i, j - 1], 0)
            if j + 1 < k:
                _couple(cells, full, band, right, r, i, j + 1, cells.across[i, j], 0)


@kernel
def _couple(
    cells: _Cells,
    full: NDArray[np.bool_],
    band: NDArray[np.float64],
    right: NDArray[np.float64],
    r: int,
    i: int,
    j: int,
    conductance: float,
    upstream: int,
) -> None:
    """Add what the cell of row r receives from its neighbour (i, j)."""
    carried = cells.convect[i, j] if upstream == 1 else 0.0
    if cells.held[i, j] != 0:
        right[r] += carried + conductance * cells.pressure[i, j]
        return
    column = cells.place[i] * cells.rows + j - 1
    place = 4 * cells.rows + r - column
    if full[i, j]:
        right[r] += carried
        band[place, column] -= conductance
    else:
        band[place, column] -= carried


def _excess(
    cells: _Cells, pressure: NDArray[np.float64], fill: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Outflow and storage less inflow of each cell, twelve times the volume in unit tau."""
    carried = cells.convect * fill
    along = cells.along * (pressure - np.roll(pressure, -1, axis=0))
    across = cells.across[:, :-1] * (pressure[:, :-1] - pressure[:, 1:])
    excess = carried - np.roll(carried, 1, axis=0) + along - np.roll(along, 1, axis=0)
    excess += cells.store * fill - cells.source
    excess[:, :-1] += across
    excess[:, 1:] -= across
    return excess


def _solution(
    geometry: FilmGeometry, state: FilmState, cells: _Cells, answer: _Answer, least: float
) -> FilmSolution:
    pressure, fill = answer.pressure, answer.fill
    free = cells.held == 0
    excess = _excess(cells, pressure, fill)[free]
    # scaled by the largest stream of any cell; a cell's own may be zero
    scale = np.max(cells.convect + np.abs(cells.store) + np.abs(cells.source))
    n, k = pressure.shape
    angle, z, width = _angles(geometry), np.linspace(-0.5, 0.5, k), _widths(k)
    axes = np.array([np.cos(angle), np.sin(angle)])
    return FilmSolution(
        pressure=pressure,
        force=-(2 * math.pi / n) * axes @ (pressure @ width),
        moment=-(2 * math.pi / n) * axes @ (pressure @ (width * z)),
        min_thickness=least,
        cavitated_share=float((fill[:, 1:-1] < 1.0).mean()),
        status=_resolved(geometry, state, least) if answer.settled else FilmStatus.ITERATIONS,
        residual=float(np.abs(excess).max(initial=0.0) / scale),
        iterations=answer.iterations,
        fill=fill,
    )


def _failed(geometry: FilmGeometry, status: FilmStatus, least: float) -> FilmSolution:
    """Film without force, with the reason."""
    shape = (geometry.n_theta, geometry.n_z)
    return FilmSolution(
        pressure=np.zeros(shape),
        force=np.zeros(2),
        moment=np.zeros(2),
        min_thickness=least,
        cavitated_share=1.0,
        status=status,
        residual=0.0,
        iterations=0,
        fill=np.zeros(shape),
    )
