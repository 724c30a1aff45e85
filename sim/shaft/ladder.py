"""Rungs of a propulsion shaft, from the cheapest to the best, and the cost of a run."""

import math
from collections.abc import Iterator
from functools import partial
from typing import cast

from ..journal.ladder import FILM_LADDER, film_effect, mesh_values, solve_time
from ..scene.journal import Film
from ..scene.rungs import (
    STEP_LEVELS,
    Effect,
    Rung,
    as_written,
    effect,
    level_name,
    levels,
    price,
    written,
)
from ..scene.scene import Scene
from ..scene.shaft import ShaftScene
from .elements import element_faults, element_lengths, half_wave

BEAM_RUNGS = (
    Rung(
        name="euler-bernoulli",
        assumes="no shear, no rotary inertia",
        reference="Euler 1744",
        valid="wavelengths above ten diameters, where frequencies are 5 % high",
        nanoseconds_per_step=1.0,
    ),
    Rung(
        name="timoshenko",
        assumes="shear and rotary inertia",
        reference="Timoshenko 1921; Cowper 1966",
        nanoseconds_per_step=1.0,
    ),
)
"""Rungs of a shaft's beam."""


def shaft_effects(scene: Scene) -> Iterator[Effect]:
    """Effects of a shaft line, each with its rungs; their names are in its scene type."""
    yield from film_effect(scene, element_faults)
    yield from _beam_effect(scene)
    yield from _element_effect(scene)
    yield from _mesh_effect(scene)


def _mesh_effect(scene: Scene) -> Iterator[Effect]:
    rungs = _line_meshes(cast(ShaftScene, scene).film)
    yield effect("mesh", scene, rungs, as_written, numerical=True, beyond=element_faults)


def _line_meshes(film: Film) -> Iterator[Rung]:
    """Mesh levels, and between two of them a mesh that is finer only round the bore.

    A line solves its films some hundred times, not thousands of times like an orbit. The time of a
    solve is proportional to the nodes round the bore, and to the cube of those along it.
    """
    for factor in STEP_LEVELS:
        yield from levels("a mesh width of the film", [factor], partial(mesh_values, film))
        values = mesh_values(film, factor / 2, along=factor) if factor > STEP_LEVELS[-1] else None
        if values is not None:
            yield Rung(
                name=f"{level_name(factor / 2)} round",
                assumes=f"a mesh width of the film of {factor / 2:g} times the scene's value round "
                f"the bore, {factor:g} times along it",
                values=values,
            )


def _beam_effect(scene: Scene) -> Iterator[Effect]:
    rungs = written(BEAM_RUNGS, ["shaft.theory"])
    yield effect("beam", scene, rungs, lambda one: str(one.shaft.theory), beyond=element_faults)


def _element_effect(scene: Scene) -> Iterator[Effect]:
    length = cast(ShaftScene, scene).shaft.longest_element
    rungs = levels(
        "elements of the beam",
        STEP_LEVELS,
        lambda factor: {"shaft.longest_element": factor * length},
    )
    yield effect("elements", scene, rungs, as_written, numerical=True, beyond=element_faults)


# --- cost

_BAND = 0.5  # of a tabulated solve that is not symmetric and does not start from the last one

_BALANCE = 150  # orbit solves per bearing for the equilibrium: tilted, from cold, with coefficients

_ELEMENT = 100_000.0  # ns per element: matrices, equilibrium

_STATES = 1.5  # ns per state cubed: eigenvectors

_FORCE = 1_000_000.0  # ns per random force: its receptance

_FORCE_SAMPLE = 180.0  # ns per sample of a random force

_CHANNEL = 120.0  # ns per sample of a channel

_LINE = 10_000_000.0  # ns of a recording in addition


def shaft_states(scene: ShaftScene) -> int:
    """Expected number of states of a line's modes in a recording.

    Free modes up to half the sample rate and two residual shapes for each place of a force, each
    in two planes; and the housings.

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


def shaft_cost(scene: Scene) -> float:
    """Time of a run by the tables [s]."""
    shaft = cast(ShaftScene, scene)
    solves = _BALANCE * len(shaft.bearings) * solve_time(shaft.film, _BAND)
    samples = shaft.duration * shaft.sample_rate
    forces = 2 * len(shaft.turbulence)
    return 1e-9 * (
        solves * price(FILM_LADDER, shaft.film.rung)
        + len(element_lengths(shaft)) * _ELEMENT
        + shaft_states(shaft) ** 3 * _STATES
        + forces * (_FORCE + samples * _FORCE_SAMPLE)
        + samples * (len(shaft.sensors) + len(shaft.probes)) * _CHANNEL
        + _LINE
    )
