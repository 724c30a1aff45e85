"""Rungs of a journal bearing, from the cheapest to the best, and the cost of a run."""

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, cast

from ..film.rungs import FILM_RUNGS
from ..scene.journal import Film, JournalScene
from ..scene.rungs import (
    STEP_LEVELS,
    Beyond,
    Effect,
    Rung,
    as_written,
    effect,
    levels,
    price,
    whole_steps,
    written,
)
from ..scene.scene import Scene
from .validity import journal_step, orbit_faults

FILM_LADDER = tuple(
    Rung(
        name=rung.name,
        assumes=rung.assumes,
        reference=rung.reference,
        valid=rung.valid,
        nanoseconds_per_step=rung.nanoseconds,
    )
    for rung in FILM_RUNGS
    if rung.scene
)
"""Rungs of an oil film that a scene may choose."""

FINE_LEVELS = (4.0, 2.0, 1.0, 0.5)
"""Factors on the mesh width of an orbit's film, or on an adaptive integrator's steps."""


def journal_effects(scene: Scene) -> Iterator[Effect]:
    """Effects of a journal bearing, each with its rungs; their names are in its scene type."""
    yield from film_effect(scene, orbit_faults)
    yield from _mesh_effect(scene)
    yield from _integrator_effect(scene)


def film_effect(scene: Scene, beyond: Beyond) -> Iterator[Effect]:
    """Rungs of the film that a scene may choose."""
    rungs = written(FILM_LADDER, ["film.rung"])
    yield effect("film", scene, rungs, lambda one: str(one.film.rung), beyond=beyond)


def _mesh_effect(scene: Scene) -> Iterator[Effect]:
    film = cast(JournalScene, scene).film
    rungs = levels("a mesh width of the film", FINE_LEVELS, partial(mesh_values, film))
    yield effect("mesh", scene, rungs, as_written, numerical=True, beyond=orbit_faults)


def mesh_values(
    film: Film, factor: float, *, along: float | None = None
) -> Mapping[str, Any] | None:
    """Nodes of a mesh with scaled spacing: cells divide evenly, a node stays in the middle."""
    round_, over = film.n_theta / factor, (film.n_z - 1) / (along or factor)
    if round_ % 1 or over % 2 or round_ < _FEWEST_ROUND or over < _FEWEST_OVER:
        return None
    return {"film.n_theta": int(round_), "film.n_z": int(over) + 1}


_FEWEST_ROUND, _FEWEST_OVER = 24, 6


def _integrator_effect(scene: Scene) -> Iterator[Effect]:
    journal = cast(JournalScene, scene)
    numerics = journal.numerics
    if numerics.integrator == "adaptive":

        def tolerance(factor: float) -> Mapping[str, Any] | None:
            # a step's error is of fourth order, so that steps scale with the factor
            value = numerics.tolerance * factor**4
            return {"numerics.tolerance": value} if 1e-12 <= value <= 1e-2 else None

        rungs = levels("steps", FINE_LEVELS, tolerance)
        yield effect("tolerance", scene, rungs, as_written, numerical=True, beyond=orbit_faults)
        return
    values = whole_steps("numerics.step", scene, journal_step(journal), 1)
    rungs = levels("a step", STEP_LEVELS, values)
    yield effect("step", scene, rungs, as_written, numerical=True, beyond=orbit_faults)


# --- cost

_MESH = 72, 17  # mesh of the tabulated solve

_CALLS_PER_STEP = {"euler": 1, "rk4": 4, "adaptive": 10}

_STEPS_PER_CYCLE = 11.0
"""Step over the time constant of the fastest force, for the adaptive integrator at this tolerance,
averaged over scenes."""

_TOLERANCE = 1e-5

_MAP_SHARE = 2.5 * 96 * 97 / 100  # cold solves for a map's table, shared by a hundred records

_SAMPLE = 90.0  # ns per sample of an orbit's recording


def journal_calls(scene: JournalScene) -> float:
    """Expected number of film evaluations of a run."""
    turns = scene.duration * scene.drive.speed + scene.settling_revolutions
    numerics = scene.numerics
    if numerics.integrator == "adaptive":
        finer = math.sqrt(math.sqrt(_TOLERANCE / numerics.tolerance))
        fastest = max([1.0, *(force.order for force in scene.load.orders if force.amplitude > 0)])
        steps = turns * fastest * _STEPS_PER_CYCLE * finer
    else:
        steps = turns / (scene.drive.speed * journal_step(scene))
    return steps * _CALLS_PER_STEP[numerics.integrator]


def solve_time(film: Film, band: float) -> float:
    """Time of a direct solve over that of the tabulated mesh; `band` is the share of the fill.

    The cost has a part per node, and one with the square of the nodes across the matrix band.
    """

    def time(n_theta: int, n_z: int) -> float:
        return n_theta * n_z * (1 - band + band * (n_z / _MESH[1]) ** 2)

    return time(film.n_theta, film.n_z) / time(*_MESH)


_BAND = 0.28  # of a tabulated solve that is symmetric and starts from the last one


def journal_cost(scene: Scene) -> float:
    """Time of a run by the tables [s]."""
    journal = cast(JournalScene, scene)
    film = journal.film
    mesh = solve_time(film, _BAND)
    solve = price(FILM_LADDER, film.rung) * (mesh if film.rung == "direct" else 1.0)
    table = _MAP_SHARE * price(FILM_LADDER, "direct") * mesh if film.rung == "map" else 0.0
    samples = journal.duration * journal.sample_rate
    return 1e-9 * (journal_calls(journal) * solve + table + samples * _SAMPLE)
