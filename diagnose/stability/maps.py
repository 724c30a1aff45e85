"""The stability maps of every machine, by name.

A maker returns the plan of a map for a scene, or the reason why the map does not apply to it. A new
map is one row of :data:`MAPS`.
"""

from collections.abc import Callable

from ...sim.scene.scene import Scene
from .film_maps import eccentricity_mesh, length_load, relaxation_mesh, speed_viscosity
from .joint_maps import clearance_speed, step_stiffness
from .method_map import MapPlan
from .orbit_maps import speed_load, step_squeeze
from .ringing_maps import step_casing, step_line

Maker = Callable[[Scene, int | None], MapPlan | str]

_FILMS: dict[str, Maker] = {
    "eccentricity-mesh": eccentricity_mesh,
    "relaxation-mesh": relaxation_mesh,
    "length-load": length_load,
}

MAPS: dict[str, dict[str, Maker]] = {
    "reciprocating-pump": {
        "step-stiffness": step_stiffness,
        "clearance-speed": clearance_speed,
        "step-line": step_line,
        "step-casing": step_casing,
    },
    "journal-bearing": {"step-squeeze": step_squeeze, "speed-load": speed_load, **_FILMS},
    "propulsion-shaft": {"speed-viscosity": speed_viscosity, **_FILMS},
}
"""Machine -> its maps."""
