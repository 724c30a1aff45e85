"""Rows of a journal's orbit in the standard set: pairs of proximity probes at right angles."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..rotation import orbit
from ..signal.spectrum import decibel
from .analysis import Analysis, Settings
from .feature import Feature

Float = NDArray[np.float64]


def _orbit_labels(*parts: str) -> Callable[[Settings, float], tuple[str, ...]]:
    """One label for every part of every filtered orbit."""
    return lambda settings, _fs: tuple(
        f"order_{k:g}.{part}" for k in settings.orbit_orders for part in parts
    )


def _centreline(analysis: Analysis) -> Float:
    mean = orbit.centreline(analysis.path)
    radius = abs(mean)
    turn = mean / radius if radius > 0 else 0j
    level = float(decibel(radius**2))
    return np.array([mean.real, mean.imag, level, turn.real, turn.imag])


def _orbit_sizes(analysis: Analysis) -> Float:
    forward, backward = analysis.filtered
    sizes = (*orbit.semi_axes(forward, backward), np.abs(forward), np.abs(backward))
    return decibel(np.stack(sizes, axis=-1) ** 2)


def _orbit_shapes(analysis: Analysis) -> Float:
    forward, backward = analysis.filtered
    twice = 2 * orbit.inclination(forward, backward)  # an axis is the same after half a turn
    shapes = (
        orbit.ellipticity(forward, backward),
        orbit.precession(forward, backward),
        np.cos(twice),
        np.sin(twice),
    )
    return np.stack(shapes, axis=-1)


def _mark(analysis: Analysis) -> Float:
    """Direction of the synchronous orbit at the mark, its high spot."""
    forward, backward = orbit.filtered_orbits(analysis.path, analysis.phase, [1.0])
    mark = complex(orbit.orbit_path(forward[0], backward[0], 0.0))
    turn = mark / abs(mark) if mark != 0 else 0j
    return np.array([turn.real, turn.imag])


def _whirl(analysis: Analysis) -> Float:
    ratio, radius = orbit.whirl(analysis.path, analysis.fs, analysis.speed_hz)
    return np.array([ratio, float(decibel(radius**2))])


ORBIT_CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="centreline",
        unit="x, rad, -",
        needs=("probes",),
        scope="orbit",
        labels=(
            "centreline.x",
            "centreline.y",
            "centreline.radius_db",
            "centreline.attitude_cos",
            "centreline.attitude_sin",
        ),
        function=_centreline,
        reference="orbit.centreline",
    ),
    Feature(
        name="largest_excursion",
        unit="dB re 1 x^2",
        needs=("probes",),
        scope="orbit",
        labels=("largest_excursion_db",),
        function=lambda a: decibel(orbit.largest_excursion(a.path) ** 2),
        reference="orbit.largest_excursion; ISO 20816-1:2016",
    ),
    Feature(
        name="filtered_orbits",
        unit="dB re 1 x^2",
        needs=("tacho", "probes"),
        scope="orbit",
        labels=_orbit_labels("major_db", "minor_db", "forward_db", "backward_db"),
        function=_orbit_sizes,
        reference="orbit.filtered_orbits, orbit.semi_axes",
    ),
    Feature(
        name="orbit_shapes",
        unit="-",
        needs=("tacho", "probes"),
        scope="orbit",
        labels=_orbit_labels("ellipticity", "precession", "inclination_cos", "inclination_sin"),
        function=_orbit_shapes,
        reference="orbit.ellipticity, orbit.precession, orbit.inclination",
    ),
    Feature(
        name="keyphasor_mark",
        unit="-",
        needs=("tacho", "probes"),
        scope="orbit",
        labels=("mark_cos", "mark_sin"),
        function=_mark,
        reference="orbit.orbit_path",
    ),
    Feature(
        name="whirl",
        unit="-, dB re 1 x^2",
        needs=("tacho", "probes"),
        scope="orbit",
        labels=("whirl_ratio", "whirl_db"),
        function=_whirl,
        reference="orbit.whirl; Grandke, IEEE Trans. Instrum. Meas. 32 (1983) 350-355",
    ),
)
"""Features of a pair of proximity probes at right angles, after those of `CATALOGUE`."""
