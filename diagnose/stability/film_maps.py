"""Maps of oil films: solvers and rungs of one bearing, and a shaft line on its films."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, cast

import numpy as np

from ...sim.bearing.bearing_status import BearingStatus
from ...sim.bearing.equilibrium import equilibrium, sommerfeld_number
from ...sim.film.over_relaxed import PAPER_RELAXATION
from ...sim.film.rungs import FILM_RUNGS
from ...sim.film.solve import (
    LEAST_CELLS,
    FilmGeometry,
    FilmSolution,
    FilmState,
    FilmStatus,
    solve_direct,
    solve_relaxed,
)
from ...sim.output.status import Status
from ...sim.scene.journal import JournalScene
from ...sim.scene.scene import Scene, SceneError
from ...sim.scene.shaft import ShaftScene
from .method_map import (
    Cell,
    Curve,
    Judge,
    MapAxis,
    MapPlan,
    Own,
    Verdict,
    even_ratios,
    ratio_axis,
    within,
)
from .own_point import GAP_LEFT, changed, outcome, own_film, plain_film, status_words


def _film_method(scene: Scene) -> str:
    """Panel of the solver of a scene's film; film maps are tabulated from direct solves."""
    return "short" if isinstance(scene, JournalScene) and scene.film.rung == "short" else "direct"


def _meshed(geometry: FilmGeometry, n_theta: int, n_z: int | None = None) -> FilmGeometry:
    """The same film on another mesh; by default a quarter as many nodes over the length."""
    return replace(geometry, n_theta=n_theta, n_z=n_z or max(5, n_theta // 4 | 1))


_FINE = (432, 65)  # nodes of the reference film
_SWEEPS = 6000
_RUNG = {rung.name: rung for rung in FILM_RUNGS}


def eccentricity_mesh(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Solvers of the film over mesh and eccentricity.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, whose aftmost bearing is used.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    MapPlan or str
        The plan, or why there is none.
    """
    geometry = plain_film(scene)
    n, own = size or 10, own_film(scene)
    nodes = sorted({2 * round(value / 2) for value in np.geomspace(12, 216, n)})
    gaps = even_ratios(0.004, 0.9, n)

    @cache
    def reference(gap: float) -> FilmSolution:
        return solve_direct(_meshed(geometry, *_FINE), FilmState(x=1 - gap, y=0.0))

    def judge_of(solve: Callable[..., FilmSolution]) -> Judge:
        def judge(n_theta: float, gap: float) -> Cell:
            mesh = _meshed(geometry, round(n_theta))
            return _film_cell(
                solve(mesh, FilmState(x=1 - gap, y=0.0)), reference(gap), scene.accuracy
            )

        return judge

    return MapPlan(
        name="eccentricity-mesh",
        title=f"solvers of the film, L/D {geometry.length_to_diameter:.2g}, eccentricity by mesh",
        x=_nodes(nodes).through(geometry.n_theta),
        y=MapAxis(name=GAP_LEFT, unit="", values=gaps).through(own.gap),
        judges={
            "direct": judge_of(solve_direct),
            f"over-relaxed, {PAPER_RELAXATION}": judge_of(_relaxed),
            "over-relaxed, 1.5": judge_of(lambda mesh, at: _relaxed(mesh, at, 1.5)),
            "finite": judge_of(_RUNG["finite"].field),
            "short": judge_of(_RUNG["short"].field),
        },
        curves={"": [_cells_curve(gaps)]},
        note=f"force within {scene.accuracy:.2g} of a direct solve on {_FINE[0]} x {_FINE[1]} "
        "nodes",
        own=Own(method=_film_method(scene), x=float(geometry.n_theta), y=own.gap, note=own.note),
        secondary=isinstance(scene, ShaftScene),
    )


def _nodes(values: Sequence[int]) -> MapAxis:
    return MapAxis(
        name="mesh, nodes around the circumference",
        unit="",
        values=tuple(float(v) for v in values),
        even=True,
    )


def _relaxed(
    mesh: FilmGeometry, state: FilmState, relaxation: float = PAPER_RELAXATION
) -> FilmSolution:
    return solve_relaxed(mesh, state, relaxation=relaxation, most_sweeps=_SWEEPS)


def _cells_curve(gaps: tuple[float, ...]) -> Curve:
    """Mesh with as many nodes in the narrow gap as the guard requires."""
    y = [float(gap) for gap in np.geomspace(gaps[0] / 2, 0.45, 60)]
    x = [LEAST_CELLS * math.pi / math.acos(1 - gap / (1 - gap)) for gap in y]
    return Curve(name="guard: nodes in the narrow gap", x=tuple(x), y=tuple(y))


_FILM_VERDICT = {
    FilmStatus.COARSE: Verdict.REFUSED,
    FilmStatus.TOUCH: Verdict.FAILS,
    FilmStatus.DIVERGED: Verdict.UNSTABLE,
}


def _film_cell(found: FilmSolution, reference: FilmSolution, accuracy: float) -> Cell:
    if found.status is not FilmStatus.OK:
        verdict = _FILM_VERDICT.get(found.status, Verdict.NOT_CONVERGED)
        return verdict, f"{found.status.name.lower()}: {found.status.value}"
    off = float(np.hypot(*(found.force - reference.force)) / np.hypot(*reference.force))
    return within(off, accuracy, "force")


def relaxation_mesh(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Over-relaxation over relaxation factor and mesh.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, whose aftmost bearing is used.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    MapPlan or str
        The plan, or why there is none.
    """
    geometry = plain_film(scene)
    n = size or 16
    factors = tuple(float(value) for value in np.linspace(0.9, 2.4, n))
    nodes = sorted({2 * round(value / 2) for value in np.geomspace(16, 128, max(4, n // 2))})

    def judge_of(eccentricity: float) -> Judge:
        state = FilmState(x=eccentricity, y=0.0)

        @cache
        def reference(n_theta: int) -> FilmSolution:
            return solve_direct(_meshed(geometry, n_theta), state)

        def judge(factor: float, n_theta: float) -> Cell:
            mesh = _meshed(geometry, round(n_theta))
            found = solve_relaxed(mesh, state, relaxation=factor, most_sweeps=_SWEEPS)
            return _film_cell(found, reference(round(n_theta)), 1e-2)

        return judge

    eccentricities = (0.2, 0.6, 0.9)
    own = 1 - (own_film(scene).gap or 0.4)
    nearest = min(eccentricities, key=lambda e: abs(e - own))
    lines = [
        ("limit in theory: 2", 2.0),
        (f"the paper's factor: {PAPER_RELAXATION}", PAPER_RELAXATION),
    ]
    return MapPlan(
        name="relaxation-mesh",
        title=f"projected over-relaxation, L/D {geometry.length_to_diameter:.2g}, factor by mesh",
        x=MapAxis(name="relaxation factor", unit="", values=factors, log=False),
        y=_nodes(nodes).through(geometry.n_theta),
        judges={f"eccentricity {e:g}": judge_of(e) for e in eccentricities},
        curves={"": [Curve(name=name, x=(at, at), y=(1.0, 1000.0)) for name, at in lines]},
        note=f"force within 0.01 of a direct solve on the same mesh, within {_SWEEPS} sweeps",
        own=Own(
            method=f"eccentricity {nearest:g}",
            x=None,
            y=float(geometry.n_theta),
            note="No scene uses relaxation: this is the method of the source paper.",
        ),
        secondary=True,
    )


def length_load(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Rungs of the film over the bearing's length and its load.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, whose aftmost bearing is used.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    MapPlan or str
        The plan, or why there is none.
    """
    geometry, own = plain_film(scene), own_film(scene)
    n = size or 10

    @cache
    def reference(ratio: float, number: float) -> Any:
        fine = replace(geometry, length_to_diameter=ratio, n_theta=216, n_z=33)
        return equilibrium(fine, _per_sommerfeld(number), raise_on_failure=False)

    def judge_of(rung: str) -> Judge:
        def judge(ratio: float, number: float) -> Cell:
            mesh = replace(geometry, length_to_diameter=ratio)
            found = equilibrium(mesh, _per_sommerfeld(number), rung=rung, raise_on_failure=False)
            return _rest_cell(found, reference(ratio, number), scene.accuracy)

        return judge

    return MapPlan(
        name="length-load",
        title=f"rungs of the film on {geometry.n_theta} x {geometry.n_z} nodes, load by length",
        x=ratio_axis("L/D", "", 0.1, 6.0, n, own=geometry.length_to_diameter),
        y=ratio_axis(
            "Sommerfeld number (light load: large)", "", 0.003, 10.0, n, own=own.sommerfeld
        ),
        judges={rung: judge_of(rung) for rung in ("short", "finite", "long", "direct")},
        note=f"minimum film within {scene.accuracy:.2g} of a direct solve on 216 x 33 nodes",
        own=Own(
            method=_film_method(scene),
            x=geometry.length_to_diameter,
            y=own.sommerfeld,
            note=own.note,
        ),
        secondary=isinstance(scene, ShaftScene),
    )


def _per_sommerfeld(number: float) -> tuple[float, float]:
    """Load over ``eta omega R^3 L / C^2`` at a Sommerfeld number."""
    return sommerfeld_number(number), 0.0


def _rest_cell(found: Any, reference: Any, accuracy: float) -> Cell:
    status = found.status
    word = status_words(status)
    if status is BearingStatus.COARSE:
        return Verdict.REFUSED, word
    if not reference.status.ok:
        return Verdict.FAILS, status_words(reference.status)
    if not status.ok:
        return Verdict.NOT_CONVERGED, word
    off = abs((1 - found.eccentricity_ratio) / (1 - reference.eccentricity_ratio) - 1)
    return within(off, accuracy, "minimum film")


# --- shaft line


_LINE_PHYSICAL = {Status.LINE_UNSTABLE: Verdict.WHIRL}
_LINE_METHOD = {
    Status.LINE_BALANCE: Verdict.NOT_CONVERGED,
    Status.LINE_COARSE: Verdict.REFUSED,
    Status.LINE_MOTION: Verdict.REFUSED,
}


def speed_viscosity(scene: Scene, size: int | None = None) -> MapPlan | str:
    """A shaft line on its films: whirl, edge contact and overload over speed and viscosity.

    Parameters
    ----------
    scene : Scene
        A shaft line.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    MapPlan or str
        The plan, or why there is none.
    """
    shaft = cast(ShaftScene, scene)
    n, speed, viscosity = size or 11, shaft.drive.speed, shaft.oil.dynamic_viscosity
    meshes = dict.fromkeys([(shaft.film.n_theta, shaft.film.n_z), (24, 7)])
    return MapPlan(
        name="speed-viscosity",
        title=f"the line on its films, '{shaft.film.rung}', viscosity by speed",
        x=ratio_axis("speed", "Hz", speed / 30, 10 * speed, n, own=speed),
        y=ratio_axis("viscosity", "Pa s", viscosity / 30, viscosity * 10, n, own=viscosity),
        judges={_mesh_name(*mesh): _line_judge(shaft, *mesh) for mesh in meshes},
        note="status, and minimum film against a mesh of twice the nodes in both directions; a "
        "failure is physical if it persists with twice the nodes around the bore",
        own=Own(method=_mesh_name(shaft.film.n_theta, shaft.film.n_z), x=speed, y=viscosity),
    )


def _mesh_name(n_theta: int, n_z: int) -> str:
    return f"{n_theta} x {n_z} nodes"


def _line_at(
    scene: ShaftScene, speed: float, viscosity: float, mesh: tuple[int, int]
) -> ShaftScene:
    oil = scene.oil.thickened(viscosity / scene.oil.dynamic_viscosity)
    values = {"drive.speed": speed, "duration": 2 / speed, "oil": oil}
    values |= {"film.n_theta": mesh[0], "film.n_z": mesh[1]}
    # enough for the orders of the forces; more would require a finer beam
    values |= {"sample_rate": max(scene.sample_rate, 40 * speed), "tacho": None}
    return cast(ShaftScene, changed(scene, values))


def _line_judge(scene: ShaftScene, n_theta: int, n_z: int) -> Judge:
    def judge(speed: float, viscosity: float) -> Cell:
        try:
            found = outcome(_line_at(scene, speed, viscosity, (n_theta, n_z)))
        except SceneError as error:
            return Verdict.REFUSED, error.faults[0]
        word = status_words(found.status)
        if found.status in _LINE_METHOD:
            return _LINE_METHOD[found.status], word
        # a failed search has already refined its meshes along the length: refine around the bore
        along = 2 * n_z - 1 if found.status.ok else n_z
        finer = outcome(_line_at(scene, speed, viscosity, (2 * n_theta, along)))
        if not found.status.ok:
            if finer.status.ok:
                return Verdict.INACCURATE, f"a finer mesh removes {word}"
            return _LINE_PHYSICAL.get(found.status, Verdict.FAILS), word
        if not finer.status.ok:
            return Verdict.INACCURATE, f"a finer mesh ends with {finer.status.name.lower()}"
        off = abs(float(found.numerics["min_film_m"]) / float(finer.numerics["min_film_m"]) - 1)
        return within(off, scene.accuracy, "minimum film")

    return judge
