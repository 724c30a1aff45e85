"""What a run of a scene costs by the tables: predicted steps times tabulated times."""

import math
from collections.abc import Callable
from typing import cast

from ..journal.validity import journal_step
from ..pump.setup import joint_parts
from ..pump.validity import pump_steps
from ..scene.journal import Film, JournalScene
from ..scene.parts import Scene
from ..scene.pump import PumpScene
from ..scene.shaft import ShaftScene
from ..shaft.elements import element_lengths, half_wave
from .ladder import LADDERS


def cost_of(scene: Scene) -> float:
    """Time that a run takes by the tables: predicted steps times tabulated cost [s].

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    float
        For ranking: the same on every machine.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> cheap = load_scene("bilge-pump", {"joint.crankpin.rung": "ideal"})
    >>> cost_of(cheap) < cost_of(load_scene("bilge-pump"))
    True
    """
    return _COSTS[scene.machine](scene)


_MECHANISM = 60.0  # ns of a step of one throw beside its effects

_MODE = 12.0  # ns of a step of one casing mode and its sensors

_CASING_FIXED = 200.0  # ns of a step beside: low-pass and bookkeeping


def _pump_cost(scene: Scene) -> float:
    pump = cast(PumpScene, scene)
    per_step = _CASING_FIXED + _MODE * len(pump.casing.modes) + _price("drive", pump.drive.rung)
    for throw in range(len(pump.throws)):
        per_step += _MECHANISM + _price("pressure", pump.pressures(throw).rung)
        for part in joint_parts(pump, throw):
            per_step += _price("joint", "ideal" if part is None else part.rung)
    return 1e-9 * per_step * pump_steps(pump)


def _price(effect: str, name: str) -> float:
    return next(r.nanoseconds_per_step for r in LADDERS[effect] if r.name == name)


_MESH = 72, 17  # on which a solve is tabulated

_CALLS_PER_STEP = {"euler": 1, "rk4": 4, "adaptive": 10}

_STEPS_PER_TURN = 11.0  # of the adaptive integrator at the tolerance below, in the mean of scenes

_TOLERANCE = 1e-5

_MAP_SHARE = 2.5 * 96 * 97 / 100  # solves of a map's table, cold, shared by a hundred records

_SAMPLE = 90.0  # ns of one sample of one recording of an orbit


def journal_calls(scene: JournalScene) -> float:
    """Solves of the film that a run is expected to ask for."""
    turns = scene.duration * scene.drive.speed + scene.settling_revolutions
    numerics = scene.numerics
    if numerics.integrator == "adaptive":
        finer = math.sqrt(math.sqrt(_TOLERANCE / numerics.tolerance))
        steps = turns * _STEPS_PER_TURN * finer
    else:
        steps = turns / (scene.drive.speed * journal_step(scene))
    return steps * _CALLS_PER_STEP[numerics.integrator]


def _solve(film: Film, band: float) -> float:
    """Time of a direct solve over that of the tabulated mesh; `band` is the share of the fill.

    Every node costs by itself, and by the square of those across the band of the matrix.
    """

    def time(n_theta: int, n_z: int) -> float:
        return n_theta * n_z * (1 - band + band * (n_z / _MESH[1]) ** 2)

    return time(film.n_theta, film.n_z) / time(*_MESH)


_BAND_ORBIT, _BAND_LINE = 0.28, 0.5  # of a tabulated solve: symmetric, started from the last; not


def _journal_cost(scene: Scene) -> float:
    journal = cast(JournalScene, scene)
    film = journal.film
    mesh = _solve(film, _BAND_ORBIT)
    solve = _price("film", film.rung) * (mesh if film.rung == "direct" else 1.0)
    table = _MAP_SHARE * _price("film", "direct") * mesh if film.rung == "map" else 0.0
    samples = journal.duration * journal.sample_rate
    return 1e-9 * (journal_calls(journal) * solve + table + samples * _SAMPLE)


_BALANCE = 150  # orbit's solves that balancing each bearing takes: tilted, from cold, coefficients

_ELEMENT = 100_000.0  # ns of one element: matrices, balance

_STATES = 1.5  # ns of a cubed state: eigenvectors

_FORCE = 1_000_000.0  # ns of one random force: its receptance

_FORCE_SAMPLE = 180.0  # ns of one sample of one random force

_CHANNEL = 120.0  # ns of one sample of one channel

_LINE = 10_000_000.0  # ns of a recording beside


def shaft_states(scene: ShaftScene) -> int:
    """States of a line's modes that a recording is expected to take.

    Free modes up to half of the sample rate, two residual shapes for each place that is pushed,
    in two planes; the housings.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> shaft_states(load_scene("shaft-rig"))  # 128 are taken
    124
    """
    modes = math.ceil(scene.length / half_wave(scene)) + 1
    places = {bearing.station for bearing in scene.bearings}
    places |= {disc.station for disc in scene.discs}
    places |= {scene.coupling.station} if scene.coupling else set()
    return 4 * (modes + 2 * len(places) + len(scene.bearings))


def _shaft_cost(scene: Scene) -> float:
    shaft = cast(ShaftScene, scene)
    solves = _BALANCE * len(shaft.bearings) * _solve(shaft.film, _BAND_LINE)
    samples = shaft.duration * shaft.sample_rate
    forces = 2 * len(shaft.turbulence)
    return 1e-9 * (
        solves * _price("film", shaft.film.rung)
        + len(element_lengths(shaft)) * _ELEMENT
        + shaft_states(shaft) ** 3 * _STATES
        + forces * (_FORCE + samples * _FORCE_SAMPLE)
        + samples * (len(shaft.sensors) + len(shaft.probes)) * _CHANNEL
        + _LINE
    )


_COSTS: dict[str, Callable[[Scene], float]] = {
    "reciprocating-pump": _pump_cost,
    "journal-bearing": _journal_cost,
    "propulsion-shaft": _shaft_cost,
}
"""Cost of a run of every machine. A new machine is one row."""
