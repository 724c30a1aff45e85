"""Position of a scene in its maps: load, remaining gap, Sommerfeld number, mesh, step, method.

Also the change of its values to those of another cell, and the run there.
"""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple, cast

from ...sim.bearing.bearing_status import BearingStatus
from ...sim.bearing.equilibrium import equilibrium, sommerfeld_number
from ...sim.film.solve import FilmGeometry
from ...sim.journal.orbit_status import OrbitStatus
from ...sim.journal.recording import film_geometry, journal_scale
from ...sim.journal.validity import JOURNAL_STEP
from ...sim.machine.simulate import simulate
from ...sim.output.recording import Recording
from ...sim.output.status import Status
from ...sim.scene.journal import JournalScene
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.at_rest import film_bearings, shaft_state

GAP_LEFT = "remaining gap, 1 - eccentricity ratio"
"""Name of the eccentricity axis of film maps."""


class OwnFilm(NamedTuple):
    """Film of a scene at its running equilibrium.

    Attributes
    ----------
    gap : float or None
        Minimum film thickness at mid-length over the radial clearance, 1 - eccentricity ratio; None
        if there is no equilibrium.
    sommerfeld : float or None
        Sommerfeld number; None if the film carries no load.
    note : str
        How the plain, aligned film of the maps differs from that of the scene.
    """

    gap: float | None
    sommerfeld: float | None
    note: str


def journal_weight(scene: JournalScene) -> float:
    """Steady load along X [N]: weight and static load."""
    return scene.rotor.mass * scene.gravity + scene.load.static


def orbit_step(scene: JournalScene) -> float:
    """Longest step of the orbit's integrator, as written or by default [rad]."""
    step = scene.numerics.step
    return JOURNAL_STEP if step is None else math.tau * scene.drive.speed * step


def plain_film(scene: Scene) -> FilmGeometry:
    """Plain film, on the scene's mesh, of the bearing or of the aftmost bearing of a line."""
    if isinstance(scene, ShaftScene):
        found = film_bearings(scene)[0].worn.geometry
    else:
        found = film_geometry(cast(JournalScene, scene))
    return FilmGeometry(
        length_to_diameter=found.length_to_diameter,
        n_theta=found.n_theta,
        n_z=found.n_z,
        condition=found.condition,
    )


@lru_cache(maxsize=8)
def own_film(scene: Scene) -> OwnFilm:
    """Film of a scene at its equilibrium.

    Parameters
    ----------
    scene : Scene
        A journal bearing, or a shaft line, whose aftmost bearing is used.

    Returns
    -------
    OwnFilm

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = own_film(load_scene("journal-step"))
    >>> round(found.gap, 2)
    0.68
    """
    if isinstance(scene, ShaftScene):
        return _aftmost(scene)
    return _single(cast(JournalScene, scene))


def _single(scene: JournalScene) -> OwnFilm:
    scale = journal_scale(scene)
    unit = scale.alpha * scale.force
    weight = math.hypot(journal_weight(scene), scene.load.static_across)
    if weight == 0:
        return OwnFilm(gap=None, sommerfeld=None, note=_MAPPED[scene.film.rung])
    rung = "short" if scene.film.rung == "short" else "direct"
    found = equilibrium(plain_film(scene), (weight / unit, 0.0), rung=rung, raise_on_failure=False)
    return OwnFilm(
        gap=1 - found.eccentricity_ratio if found.status.ok else None,
        sommerfeld=sommerfeld_number(weight / unit),
        note=_MAPPED[scene.film.rung],
    )


_MAPPED = {
    "short": "",
    "map": "The scene uses a map tabulated from this film.",
    "direct": "",
}


def _aftmost(scene: ShaftScene) -> OwnFilm:
    film = shaft_state(scene, raise_on_failure=False).film
    note = "This film is plain and aligned; that of the scene is tilted."
    if not film.status.ok:
        return OwnFilm(gap=None, sommerfeld=None, note=note)
    bearing = film.bearings[0].worn
    unit = bearing.viscosity * film.speed * bearing.length * (bearing.diameter / 2) ** 3
    load = math.hypot(*film.reactions[0]) * bearing.clearance**2 / unit
    return OwnFilm(
        gap=1 - float(film.eccentricity_ratios[0]), sommerfeld=sommerfeld_number(load), note=note
    )


def changed(part: Any, values: Mapping[str, Any]) -> Any:
    """Replace values of a scene by dotted path, without validation.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> changed(load_scene("bilge-pump"), {"drive.speed": 4.0}).drive.speed
    4.0
    """
    for path, value in values.items():
        head, _, rest = path.partition(".")
        inner = changed(getattr(part, head), {rest: value}) if rest else value
        part = part.model_copy(update={head: inner})
    return part


def status_words(status: Status | OrbitStatus | BearingStatus) -> str:
    """Name and text of a status."""
    return f"{status.name.lower()}: {status.text}"


def outcome(scene: Scene) -> Recording:
    """Run a scene and return it with its truth, whatever its status."""
    return simulate(scene, seed=0, truth=True, raise_on_failure=False)
