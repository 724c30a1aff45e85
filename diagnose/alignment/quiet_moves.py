"""Bearing moves that minimise the vibration of a running line within the limits of its alignment.

The forces of the running line, orders and random ones, act through the transfer functions of the
moved line, with films and beam solved together. The moves minimise the mean power of the
accelerations at the scene's sensors.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...sim.alignment.alignment import MET, check, reactions
from ...sim.alignment.calibration import Calibration, CalibrationStatus
from ...sim.alignment.seats import AlignmentError
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.changed import (
    FreeLine,
    LineModel,
    free_line,
    line_model,
    no_change,
    rest,
    transfer,
)
from ...sim.shaft.forces import harmonic_forces, random_forces
from ...sim.shaft_films.status import ShaftFilmError
from ...sim.shaft_response.time_response import Harmonic
from ..shaft_tests.next_test import usual_responses
from .margins import margin_of

Vector = NDArray[np.float64]

_LINES = 160  # of the random forces' band, in equal ratios
_LOWEST = 2.0  # Hz
_FIRST_STEP = 0.25  # of the range in which a bearing may move
_LAST_STEP = 0.01e-3  # m: finest setting of chocks
_GAIN = 2e-3  # smallest relative reduction of the power that counts
_MOST_TRIALS = 80
_HEARD_DB = 0.1  # smaller changes are within the error of the films' meshes


@dataclass(frozen=True, kw_only=True, eq=False)
class Running:
    """A line prepared for computing its vibration at any bearing positions.

    Attributes
    ----------
    model : LineModel
    speed : float
        [rad/s]
    orders : FreeLine or None
        Condensed line at the frequencies of `harmonics`, from every place where one acts.
    harmonics : tuple of Harmonic
    band : FreeLine or None
        Condensed line at the spectral lines of the random forces.
    density : numpy.ndarray [shape=(n_sources, n_lines)]
        Spectral densities of the random forces [N^2/Hz].
    """

    model: LineModel
    speed: float
    orders: FreeLine | None
    harmonics: tuple[Harmonic, ...]
    band: FreeLine | None
    density: Vector


def running_line(scene: ShaftScene) -> Running:
    """Line of a scene with the forces of its running state.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    Running

    Raises
    ------
    AlignmentError
        The scene has no accelerometer, or nothing excites it.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> running_line(load_scene("shaft-rig")).density.shape
    (4, 160)
    """
    model, speed = line_model(scene), math.tau * scene.drive.speed
    seen = usual_responses(scene)
    harmonics, sources = harmonic_forces(scene), random_forces(scene)
    if not seen or not (harmonics or sources):
        raise AlignmentError(
            f"target = 'vibration' needs accelerometers and forces, '{scene.name}' has "
            f"{len(seen)} and {len(harmonics) + len(sources)}; add them, or choose another target"
        )
    places = list(dict.fromkeys(place for h in harmonics for place in h.forces))
    orders = None
    if harmonics:
        turning = [h.frequency for h in harmonics]
        orders = free_line(model, turning, speed=speed, forces=places, responses=seen)
    hertz = np.geomspace(_LOWEST, 0.999 * scene.sample_rate / 2, _LINES)
    band = None
    if sources:
        pushed = [place for source in sources for place in source.forces]
        band = free_line(model, hertz, speed=speed, forces=pushed, responses=seen)
    density = [np.interp(hertz, np.asarray(s.frequencies), np.asarray(s.density)) for s in sources]
    return Running(
        model=model,
        speed=speed,
        orders=orders,
        harmonics=tuple(harmonics),
        band=band,
        density=np.array(density).reshape(len(sources), hertz.size),
    )


def running_rms(running: Running, moves: Vector) -> Vector:
    """Acceleration at every sensor with the bearings moved.

    Parameters
    ----------
    running : Running
    moves : numpy.ndarray [shape=(n,)]
        Upward moves [m].

    Returns
    -------
    numpy.ndarray [shape=(n_sensors,)]
        Total rms of orders and random motion [m/s^2].

    Raises
    ------
    ShaftFilmError
        The line has no equilibrium on its films.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> running_rms(running_line(load_scene("shaft-rig")), np.zeros(4)).shape
    (4,)
    """
    change = no_change(moves.size)
    change[:, 0] = moves
    model = running.model.changed(change)
    film = rest(model, running.speed)
    power = np.zeros(0)
    if running.orders is not None:
        through = transfer(model, film, running.orders).value
        places = list(dict.fromkeys(p for h in running.harmonics for p in h.forces))
        forces = np.array([[h.forces.get(p, 0.0) for p in places] for h in running.harmonics])
        phasors = np.einsum("lrf,lf->lr", through, forces)
        power = (np.abs(phasors) ** 2).sum(axis=0) / 2
    if running.band is not None:
        through = transfer(model, film, running.band).value
        spectrum = np.einsum("lrs,sl->lr", np.abs(through) ** 2, running.density)
        random = np.trapezoid(spectrum, running.band.frequencies, axis=0)
        power = random if power.size == 0 else power + random
    return np.asarray(np.sqrt(power))


@dataclass(frozen=True, kw_only=True, eq=False)
class QuietMoves:
    """Moves that make a running line quieter, and their effect.

    Attributes
    ----------
    calibration : Calibration
        The moves; if none helps, those that the limits require, if any.
    before, after : numpy.ndarray [shape=(n_sensors,)]
        rms of each accelerometer in the running line [m/s^2].
    trials : int
        Number of computed lines.
    moved : bool
        Whether any bearing moves more than the limits require.
    """

    calibration: Calibration
    before: Vector
    after: Vector
    trials: int
    moved: bool

    @property
    def text(self) -> str:
        """Effect of the moves on the vibration, in one sentence."""
        levels = [1e3 * float(np.sqrt(np.mean(rms**2))) for rms in (self.before, self.after)]
        change = 20 * math.log10(levels[1] / levels[0])
        said = (
            f"vibration of the running line, rms over {self.before.size} accelerometers: "
            f"{levels[0]:.4g} -> {levels[1]:.4g} mm/s^2 ({change:+.2f} dB)"
        )
        if not self.moved:
            return f"{said}; no further moves within the limits make it quieter by {_HEARD_DB:g} dB"
        return said


def quiet_moves(scene: ShaftScene, found: Calibration, *, margin: float = 0.0) -> QuietMoves:
    """Moves within limits and bounds that minimise the vibration, starting from given ones.

    Parameters
    ----------
    scene : ShaftScene
    found : Calibration
        Moves that meet the limits, as start of the search.
    margin : float
        Required distance from every limit, as a share of it.

    Returns
    -------
    QuietMoves
        With the given moves if these do not meet the limits or nothing is quieter.

    Raises
    ------
    AlignmentError
        As in :func:`running_line`.
    ShaftFilmError
        The line has no equilibrium on its films as set.

    Notes
    -----
    One bearing after the other is moved up and down by a step, which is halved if no move helps: a
    local search for few variables and a function that is smooth except for the films' meshes.

    Examples
    --------
    >>> from wearstate.sim.alignment.calibration import calibrate
    >>> from wearstate.sim.scene.load import load_scene
    >>> from wearstate.sim.shaft.line_alignment import alignment_line
    >>> rig = load_scene("shaft-rig", {"bearings.2.offset": "0 mm"})
    >>> quieter = quiet_moves(rig, calibrate(alignment_line(rig)))
    >>> bool(np.mean(quieter.after**2) <= np.mean(quieter.before**2))
    True
    """
    running = running_line(scene)
    before = running_rms(running, np.zeros(len(scene.bearings)))
    search = _Search(running, found, margin)
    moves, trials = found.moves, 0
    first = best = search.power(moves)
    if not found.status.ok or first is None or best is None:
        return QuietMoves(calibration=found, before=before, after=before, trials=1, moved=False)
    span = np.array([seat.most_move - seat.least_move for seat in found.line.seats])
    step = _FIRST_STEP * float(span.max(initial=0.0))
    while step >= _LAST_STEP and trials < _MOST_TRIALS:
        moved = False
        for k in np.flatnonzero(span > 0):
            for side in (-1, 1):
                trial = moves.copy()
                trial[k] += side * step
                power = search.power(trial)
                trials += power is not None
                if power is not None and power < (1 - _GAIN) * best:
                    moves, best, moved = trial, power, True
                    break
        if not moved:
            step /= 2
    if 10 * math.log10(first / best) < _HEARD_DB:
        moves = found.moves
    return QuietMoves(
        calibration=_with_moves(found, moves),
        before=before,
        after=running_rms(running, moves),
        trials=trials,
        moved=not np.array_equal(moves, found.moves),
    )


class _Search:
    """Mean power of a line with its bearings moved, for allowed moves."""

    def __init__(self, running: Running, found: Calibration, margin: float) -> None:
        self.running, self.found = running, found
        kept = [margin_of(c) for state in found.after for c in check(state)]
        self.margin = min([margin, *kept])

    def power(self, moves: Vector) -> float | None:
        """Mean power of the accelerations [(m/s^2)^2]; None if the moves are not allowed."""
        found = self.found
        seats = zip(found.line.seats, moves, strict=True)
        if any(not seat.least_move <= move <= seat.most_move for seat, move in seats):
            return None
        line = found.line.moved(moves, found.turns)
        states = (reactions(line, state.condition) for state in found.before)
        if any(margin_of(c) < self.margin - MET for state in states for c in check(state)):
            return None
        try:
            return float(np.mean(running_rms(self.running, moves) ** 2))
        except ShaftFilmError:
            return None


def _with_moves(found: Calibration, moves: Vector) -> Calibration:
    if np.array_equal(moves, found.moves):
        return found
    line = found.line.moved(moves, found.turns)
    after = tuple(reactions(line, state.condition) for state in found.before)
    return replace(
        found,
        status=CalibrationStatus.DONE,
        moves=moves,
        after=after,
        promised=np.array([state.reactions for state in after]),
    )
