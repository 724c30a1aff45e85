"""Rungs of each effect, as tables from the cheapest to the best.

A rung is one row: a name, what it assumes, where it is valid, where it comes from, what it costs,
and the values that put it into a scene. The kernels choose by the codes that go with the names;
nothing else knows which rungs there are. Steps, tolerances and meshes are effects as well, with
levels by factors of the one that is written. Alternatives that no order ranks, contact laws,
friction laws, modes or a measured casing, are choices of a scene and no rungs.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from ..journal.validity import journal_step, orbit_faults
from ..pump.validity import FEWEST_STEPS, joint_faults, knock_limits, limits, pump_step
from ..scene.journal import Film, JournalScene
from ..scene.parts import Scene, SceneError, validate_table
from ..scene.pump import PumpScene
from ..scene.shaft import ShaftScene
from ..shaft.elements import element_faults

AnyScene = TypeVar("AnyScene", bound=Scene)


@dataclass(frozen=True, kw_only=True)
class Rung:
    """One rung of an effect.

    Attributes
    ----------
    name : str
        As in the scene; of a numerical effect the factor on what is written, such as ``x2``.
    assumes : str
        The model in one line.
    valid : str
        Where it may be used.
    needs : str
        What the scene must give.
    reference : str
        Source.
    nanoseconds_per_step : float
        Tabulated cost of the effect on one throw, or of one solve of a film, on one core of a
        2020s server, for ranking only.
    values : mapping of str to object
        Dotted path -> value that puts the rung into the scene it was made for.
    """

    name: str
    assumes: str
    reference: str = ""
    nanoseconds_per_step: float = 0.0
    valid: str = "always"
    needs: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)


JOINT_RUNGS = (
    Rung(
        name="ideal",
        assumes="no clearance: rigid links, constraint forces",
        reference="Newton-Euler equations of the slider-crank",
        nanoseconds_per_step=60.0,
    ),
    Rung(
        name="link",
        assumes="a massless link as long as the radial clearance: contact is never lost",
        reference="Earles, Wu 1973",
        valid="while the link is in compression: no step of the run in tension",
        needs="a clearance",
        nanoseconds_per_step=120.0,
    ),
    Rung(
        name="compliant",
        assumes="free flight and the contact law's force, with friction, in the clearance circle",
        reference="Xia et al. 2017, eqs 1-15 with their signs mended",
        valid="penetration below a tenth of the pin's radius, and 4 clearances under the load",
        needs="a clearance, a contact law with its stiffness; of a guide the piston's inertia",
        nanoseconds_per_step=140.0,
    ),
)
"""Rungs of crank pin and wrist pin; a guide has the first and the last."""

PRESSURE_RUNGS = (
    Rung(
        name="none",
        assumes="no pressure",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="constant",
        assumes="a plunger against a constant pressure",
        needs="pressure.discharge",
        nanoseconds_per_step=1.0,
    ),
    Rung(
        name="two-level",
        assumes="suction and discharge pressure by turns",
        reference="quasi-static limit of the rung above",
        needs="pressure.suction and pressure.discharge",
        nanoseconds_per_step=20.0,
    ),
    Rung(
        name="heads",
        assumes="incompressible liquid: energy balance of the lines, liquid inertia as added mass",
        reference="Xia et al. 2017, eqs 16-27 with their misprints mended",
        valid="while the liquid's pressure stays above that of its vapour, at every knock too",
        needs="both lines and valves",
        nanoseconds_per_step=30.0,
    ),
    Rung(
        name="chamber",
        assumes="compressible chamber with air and vapour, self-acting valves, leaks",
        reference="Westphal 1893 for the plates' displacement; Hosea, Shampine 1996 for the solver",
        needs="both lines and valves, pressure.dead_volume",
        nanoseconds_per_step=350.0,
    ),
)
"""Rungs of the cylinder pressure."""

DRIVE_RUNGS = (
    Rung(
        name="constant-speed",
        assumes="the crank turns evenly whatever it carries",
        nanoseconds_per_step=0.0,
    ),
    Rung(
        name="motor",
        assumes="asynchronous motor and flywheel: the speed gives way",
        reference="Kloss 1929",
        needs="drive.motor",
        nanoseconds_per_step=30.0,
    ),
)
"""Rungs of the drive."""

FILM_RUNGS = (
    Rung(
        name="short",
        assumes="flow round the circle neglected: a closed form",
        reference="Ocvirk 1952; Dubois, Ocvirk 1953",
        valid="a plain aligned bore, L/D below a half or so",
        nanoseconds_per_step=100.0,
    ),
    Rung(
        name="map",
        assumes="the direct film of a plain aligned bore, interpolated in a table of it",
        reference="Childs, Moes, van Leeuwen 1977 for the idea",
        valid="a plain aligned bore without feed pressure",
        nanoseconds_per_step=125.0,
    ),
    Rung(
        name="direct",
        assumes="Reynolds' equation with cavitation, solved on the mesh at every call",
        reference="Reynolds 1886; active sets for the complementarity",
        valid="laminar, isothermal, a film thicker than its mesh resolves",
        nanoseconds_per_step=17_000.0,
    ),
)
"""Rungs of an oil film; the cost of the last is on the mesh of 72 by 17."""

BEAM_RUNGS = (
    Rung(
        name="euler-bernoulli",
        assumes="no shear, no rotary inertia",
        reference="Euler 1744",
        valid="wavelengths above ten diameters",
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

LADDERS = {
    "joint": JOINT_RUNGS,
    "pressure": PRESSURE_RUNGS,
    "drive": DRIVE_RUNGS,
    "film": FILM_RUNGS,
    "beam": BEAM_RUNGS,
}
"""Effect -> its rungs. A new rung is one row, its code in the kernel, and one test."""


# --- effects


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One effect of one scene, with its rungs.

    Attributes
    ----------
    name : str
        As ``pinned`` names it.
    machine : str
    rungs : tuple of Rung
        Cheapest first, each with the values that put it into the scene.
    current : callable
        Scene -> name of the rung that is written.
    refusal : callable
        Scene, name of a rung -> why the scene does not admit it, or None.
    numerical : bool
        A step, a tolerance or a mesh: its error goes to zero with the level.
    """

    name: str
    machine: str
    rungs: tuple[Rung, ...]
    current: Callable[[Scene], str]
    refusal: Callable[[Scene, str], str | None]
    numerical: bool = False

    def rung(self, name: str) -> Rung:
        """Rung of that name.

        Raises
        ------
        KeyError
            There is none.
        """
        return {rung.name: rung for rung in self.rungs}[name]


def effects_of(scene: Scene) -> tuple[Effect, ...]:
    """Effects of a scene, each with its rungs; an effect that is absent has no entry.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of Effect

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> pump = load_scene("bilge-pump")
    >>> [(effect.name, effect.current(pump)) for effect in effects_of(pump)][:3]
    [('crankpin', 'compliant'), ('wristpin', 'ideal'), ('guide', 'ideal')]
    """
    return tuple(
        effect for build in _EFFECTS[scene.machine] for effect in build(scene) if effect.rungs
    )


def admissible(effect: Effect, scene: Scene) -> tuple[Rung, ...]:
    """Rungs of an effect that the scene admits, cheapest first.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> worn = load_scene("journal-bearing", {"bearing.scar_depth": "5 um", "film.rung": "direct"})
    >>> [rung.name for rung in admissible(effects_of(worn)[0], worn)]
    ['direct']
    """
    return tuple(rung for rung in effect.rungs if effect.refusal(scene, rung.name) is None)


def with_values(scene: AnyScene, values: Mapping[str, Any]) -> AnyScene:
    """The scene with values replaced by dotted path, validated anew.

    Parameters
    ----------
    scene : Scene
    values : mapping of str to object
        Dotted path -> value, entries of lists by their number.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        Every fault of the new scene at once.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> with_values(load_scene("bilge-pump"), {"pressure.rung": "none"}).pressure.rung
    'none'
    """
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *above, last = path.split(".")
        node = tree
        for key in above:
            node = node.setdefault(key, {})
        node[last] = value
    return validate_table(type(scene), _grafted(scene, tree), scene.name)


def _grafted(node: Any, tree: Mapping[str, Any]) -> Any:
    """Fields of a part as a table, with a tree of new values in it; the rest stays validated."""
    if isinstance(node, tuple):
        return [
            _grafted(entry, tree[str(i)]) if str(i) in tree else entry
            for i, entry in enumerate(node)
        ]
    own = {
        name: getattr(node, name)
        for name, part in cast(type[BaseModel], type(node)).model_fields.items()
        if getattr(node, name) is not None or part.default is not None
    }
    for key, value in tree.items():
        own[key] = _grafted(getattr(node, key), value) if isinstance(value, Mapping) else value
    return own


def _refused(rungs: tuple[Rung, ...], scene: Scene, name: str) -> str | None:
    """Why a scene with that rung is none: its first fault that some other rung is without."""
    found = _faults_of(next(rung for rung in rungs if rung.name == name), scene)
    if not found:
        return None
    shared = set(found).intersection(*(_faults_of(rung, scene) for rung in rungs))
    return next((fault for fault in found if fault not in shared), None)


def _faults_of(rung: Rung, scene: Scene) -> list[str]:
    try:
        return _BEYOND[scene.machine](with_values(scene, rung.values))
    except SceneError as error:
        return list(error.faults)


def _pump_beyond(scene: Scene) -> list[str]:
    pump = cast(PumpScene, scene)
    beyond = joint_faults(pump) or [fault for _, fault in limits(pump)]
    return beyond or [fault for _, fault in knock_limits(pump)]


def _effect(
    name: str,
    scene: Scene,
    rungs: Iterable[Rung],
    current: Callable[[Any], str],
    *,
    numerical: bool = False,
) -> Effect:
    rows = tuple(rungs)
    return Effect(
        name=name,
        machine=scene.machine,
        rungs=rows,
        current=current,
        refusal=partial(_refused, rows),
        numerical=numerical,
    )


def _written(table: tuple[Rung, ...], paths: Iterable[str]) -> Iterator[Rung]:
    """Rows of a table of rungs, each with the values that put it at the paths."""
    places = tuple(paths)
    for rung in table:
        yield replace(rung, values=dict.fromkeys(places, rung.name))


STEP_LEVELS = (4.0, 2.0, 1.0, 0.5, 0.25)
"""Factors on a step that is written; the last is the finest."""

PUMP_STEP_LEVELS = (4.0, 2.0, 4 / 3, 1.0, 0.5, 0.25)
"""The same of a pump, whose steps are few to a sample: from two to four is a long way."""

FINE_LEVELS = (4.0, 2.0, 1.0, 0.5)
"""Factors on a mesh width of an orbit's film, or the steps of an adaptive integrator."""


def level_name(factor: float) -> str:
    """Name of a level of a numerical effect.

    Examples
    --------
    >>> [level_name(factor) for factor in (2.0, 4 / 3, 1.0, 0.25)]
    ['x2', 'x4/3', 'x1', 'x1/4']
    """
    return f"x{Fraction(factor).limit_denominator(16)}"


def _levels(
    what: str, factors: Iterable[float], values: Callable[[float], Mapping[str, Any] | None]
) -> Iterator[Rung]:
    """Levels of a numerical effect; a factor that cannot be written has none."""
    for factor in factors:
        found = values(factor)
        if found is not None:
            assumes = f"{what} of {factor:.3g} times what is written"
            yield Rung(name=level_name(factor), assumes=assumes, values=found)


def _whole_steps(
    path: str, scene: Scene, longest: float, fewest: int
) -> Callable[[float], Mapping[str, Any] | None]:
    """Values of a step's levels: a step is a whole part of a sample, and so is each level.

    Halves are exact; twice and four times are rounded to the next whole number, and are left out
    below the fewest steps of a sample or where they are none of their own. A level between two of
    them is there only where it is exact.
    """
    written = math.ceil(1 / (scene.sample_rate * longest) - 1e-9)

    def steps(factor: float) -> int:
        return math.ceil(written / factor - 1e-9)

    def values(factor: float) -> Mapping[str, Any] | None:
        count = steps(factor)
        between = factor not in STEP_LEVELS and not math.isclose(count * factor, written)
        if count < fewest or between or (factor > 1 and count == steps(factor / 2)):
            return None
        return {path: 1 / (scene.sample_rate * count)}

    return values


def _as_written(_scene: Scene) -> str:
    return level_name(1.0)


# --- reciprocating pump


def _joint_effects(scene: Scene) -> Iterator[Effect]:
    pump = cast(PumpScene, scene)
    for name in ("crankpin", "wristpin", "guide"):
        part = getattr(pump.joint, name)
        if part is None:
            continue
        table = tuple(r for r in JOINT_RUNGS if name != "guide" or r.name != "link")
        rungs = _written(table, _throw_paths(pump, "joint", f"{name}.rung"))
        yield _effect(name, scene, rungs, partial(_joint_rung, name))


def _joint_rung(name: str, scene: Scene) -> str:
    return str(getattr(cast(PumpScene, scene).joint, name).rung)


def _throw_paths(scene: PumpScene, table: str, leaf: str) -> Iterator[str]:
    """Path of a value in the scene's own table, and in that of every throw that has its own."""
    yield f"{table}.{leaf}"
    for i, throw in enumerate(scene.throws):
        if getattr(throw, table) is not None:
            yield f"throws.{i}.{table}.{leaf}"


def _pressure_effect(scene: Scene) -> Iterator[Effect]:
    pump = cast(PumpScene, scene)
    if pump.piston.diameter > 0:  # else there is nothing to push on
        rungs = _written(PRESSURE_RUNGS, _throw_paths(pump, "pressure", "rung"))
        yield _effect("pressure", scene, rungs, lambda one: str(one.pressure.rung))


def _drive_effect(scene: Scene) -> Iterator[Effect]:
    if cast(PumpScene, scene).drive.motor is not None:
        rungs = _written(DRIVE_RUNGS, ["drive.rung"])
        yield _effect("drive", scene, rungs, lambda one: str(one.drive.rung))


def _stiffest(scene: PumpScene) -> PumpScene:
    """The scene with every contact that it can have: a step that is stable there is so anywhere."""
    for effect in _joint_effects(scene):
        rung = effect.rungs[-1]
        if effect.refusal(scene, rung.name) is None:
            scene = with_values(scene, rung.values)
    return scene


def _pump_step_effect(scene: Scene) -> Iterator[Effect]:
    longest = pump_step(_stiffest(cast(PumpScene, scene)))
    values = _whole_steps("numerics.step", scene, longest, FEWEST_STEPS)
    rungs = _levels("a step", PUMP_STEP_LEVELS, values)
    yield _effect("step", scene, rungs, _as_written, numerical=True)


# --- journal bearing


def _film_effect(scene: Scene) -> Iterator[Effect]:
    rungs = _written(FILM_RUNGS, ["film.rung"])
    yield _effect("film", scene, rungs, lambda one: str(one.film.rung))


def _mesh_effect(scene: Scene) -> Iterator[Effect]:
    film = cast(JournalScene | ShaftScene, scene).film
    if isinstance(scene, JournalScene):
        rungs = list(_levels("a mesh width of the film", FINE_LEVELS, partial(_mesh, film)))
    else:  # a line solves its films some hundred times, not thousands of times as an orbit does
        rungs = list(_line_meshes(film))
    yield _effect("mesh", scene, rungs, _as_written, numerical=True)


def _line_meshes(film: Film) -> Iterator[Rung]:
    """Levels, and between two of them the mesh that is finer round the bore alone.

    A solve's time goes with the nodes round the bore, and with the cube of those along it.
    """
    for factor in STEP_LEVELS:
        yield from _levels("a mesh width of the film", [factor], partial(_mesh, film))
        values = _mesh(film, factor / 2, along=factor) if factor > STEP_LEVELS[-1] else None
        if values is not None:
            yield Rung(
                name=f"{level_name(factor / 2)} round",
                assumes=f"a mesh width of the film of {factor / 2:g} times what is written round "
                f"the bore, {factor:g} times along it",
                values=values,
            )


def _mesh(film: Film, factor: float, *, along: float | None = None) -> Mapping[str, Any] | None:
    """Nodes of a mesh so many times as wide: cells divide evenly, a node stays in the middle."""
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
            # error of a step goes with its fourth power: so steps have the factor's length
            value = numerics.tolerance * factor**4
            return {"numerics.tolerance": value} if 1e-12 <= value <= 1e-2 else None

        rungs = _levels("steps", FINE_LEVELS, tolerance)
        yield _effect("tolerance", scene, rungs, _as_written, numerical=True)
        return
    values = _whole_steps("numerics.step", scene, journal_step(journal), 1)
    rungs = _levels("a step", STEP_LEVELS, values)
    yield _effect("step", scene, rungs, _as_written, numerical=True)


# --- propulsion shaft


_BEYOND: dict[str, Callable[[Scene], list[str]]] = {
    "reciprocating-pump": _pump_beyond,
    "journal-bearing": orbit_faults,
    "propulsion-shaft": element_faults,
}
"""What of a scene is beyond the validity of its rungs. A new machine is one row."""


def _beam_effect(scene: Scene) -> Iterator[Effect]:
    rungs = _written(BEAM_RUNGS, ["shaft.theory"])
    yield _effect("beam", scene, rungs, lambda one: str(one.shaft.theory))


def _element_effect(scene: Scene) -> Iterator[Effect]:
    length = cast(ShaftScene, scene).shaft.longest_element
    rungs = _levels(
        "elements of the beam",
        STEP_LEVELS,
        lambda factor: {"shaft.longest_element": factor * length},
    )
    yield _effect("elements", scene, rungs, _as_written, numerical=True)


_EFFECTS: dict[str, tuple[Callable[[Scene], Iterator[Effect]], ...]] = {
    "reciprocating-pump": (_joint_effects, _pressure_effect, _drive_effect, _pump_step_effect),
    "journal-bearing": (_film_effect, _mesh_effect, _integrator_effect),
    "propulsion-shaft": (_film_effect, _beam_effect, _element_effect, _mesh_effect),
}
"""What has rungs in a machine. A new effect is one row, its name in ``parts.EFFECTS``, one test."""

VALIDITY = {"tension_share": 0.0}
"""Numerics of a run -> most of it within the validity of its rungs."""
