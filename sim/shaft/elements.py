"""Elements of a shaft line: their lengths, at most half a bending wave."""

import math
from itertools import accumulate, pairwise
from typing import cast

from ..alignment.seats import Seat, seat_stations
from ..scene.scene import Scene
from ..scene.shaft import ShaftScene


def half_wave(scene: ShaftScene) -> float:
    """Half a bending wave of the slimmest section at half the sample rate [m].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(half_wave(load_scene("shaft-rig")), 3)
    0.307
    """
    steel = scene.shaft
    slimmest = min(s.outer_diameter**2 + s.inner_diameter**2 for s in scene.sections)
    omega = math.pi * scene.sample_rate
    return float(math.pi * (steel.young / steel.density * slimmest / 16 / omega**2) ** 0.25)


def element_lengths(scene: ShaftScene) -> list[float]:
    """Length of each element of a shaft's beam, from aft [m].

    There is a node at every end of a section, disc, load, bearing and support point, and at the
    coupling; between two of them elements have equal lengths.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> lengths = element_lengths(load_scene("shaft-rig"))
    >>> len(lengths), round(max(lengths), 9)
    (42, 0.1)
    """
    seats = (
        Seat(name=b.name, station=b.station, length=b.length, points=b.points)
        for b in scene.bearings
    )
    stations = {0.0, *accumulate(section.length for section in scene.sections)}
    stations |= {disc.station for disc in scene.discs} | {load.station for load in scene.loads}
    stations |= {*seat_stations(seats)}
    stations |= {scene.coupling.station} if scene.coupling else set()
    longest = scene.shaft.longest_element
    lengths = []
    for gap in (forward - aft for aft, forward in pairwise(sorted(stations))):
        if gap > _SAME_PLACE * scene.length:
            count = max(1, math.ceil(gap / longest * (1 - _SAME_PLACE)))
            lengths += [gap / count] * count
    return lengths


_SAME_PLACE = 1e-9  # of the shaft's length, as in the beam


def element_faults(scene: Scene) -> list[str]:
    """Find a mesh with less than one element per half-wave within the band of the recording.

    The frequency of a half-wave on one element is 11 % high.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> element_faults(load_scene("shaft-rig"))
    []
    """
    shaft = cast(ShaftScene, scene)
    most, longest = half_wave(shaft), max(element_lengths(shaft))
    if longest <= most:
        return []
    return [
        f"shaft.longest_element = {shaft.shaft.longest_element:g} m makes elements of "
        f"{longest:.3g} m, must be <= {most:.3g} m, half a bending wave at half of sample_rate = "
        f"{shaft.sample_rate:g} Hz; shorten it, or lower sample_rate"
    ]
