"""Rows of the standard set of features, the default for training."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..response import operational
from ..rotation import order
from ..signal.spectrum import decibel
from .analysis import Analysis, Settings
from .feature import RANDOM_DATA, WELCH, Feature, band_names, order_labels

Float = NDArray[np.float64]


def _band_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(f"{band}.level_db" for band in band_names(settings.band_edges(fs)))


def _map_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    degrees = np.rint(np.linspace(0, 360, settings.angle_bins + 1)).astype(int)
    bands = band_names(settings.map_edges(fs))
    return tuple(
        f"angle_{a:03d}_{b:03d}.{band}.level_db" for a, b in pairwise(degrees) for band in bands
    )


def _order_levels(analysis: Analysis) -> Float:
    return decibel(np.abs(analysis.order_vectors) ** 2 / 2)


def _map_levels(analysis: Analysis) -> Float:
    return decibel(analysis.angle_map)


def _impacts(analysis: Analysis) -> Float:
    return order.impacts_per_revolution(
        analysis.energy.sum(axis=-1),
        analysis.boundaries,
        threshold=analysis.settings.impact_threshold,
    )


def _rms_ratios(analysis: Analysis) -> Float:
    level = decibel(analysis.amplitude.rms.astype(np.float64) ** 2)
    first, second = operational.channel_pairs(level.size)
    return np.asarray(level[first] - level[second])


def _speed(analysis: Analysis) -> Float:
    return np.asarray(analysis.speed_hz)


def _speed_variation(analysis: Analysis) -> Float:
    """Scatter of the pulse intervals over their mean; 0 if it may come from sampling alone."""
    intervals = np.diff(analysis.pulses)
    scatter = intervals.std()
    sampled = scatter <= EDGE_SCATTER_SAMPLES / analysis.fs
    return np.asarray(0.0 if sampled else scatter / intervals.mean())


EDGE_SCATTER_SAMPLES = 1 / math.sqrt(6)
"""Scatter of intervals between edges known to one sample [samples]: the limit for a sampled logic
level, applied to averaged edges, too, so that a model does not see more in them."""

_DEAD_CENTRES = tuple(
    f"dead_centre_{a}.{place}_db" for a in ("000", "180") for place in ("around", "after")
)
_HARMONICS = tuple(f"angle_harmonic_{k}.{part}_db" for k in (1, 2, 3) for part in ("cos", "sin"))

_MOMENTS = "Dyer, Stewart, J. Mech. Design 100 (1978) 229-235"


def _profile_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    pairs = pairwise(settings.profile_edges(fs).tolist())
    return tuple(f"frf.profile_{low:.5g}_{high:.5g}.level_db" for low, high in pairs)


CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="rms",
        unit="x",
        function=lambda a: a.amplitude.rms,
        reference="statistics.rms",
    ),
    Feature(
        name="peak",
        unit="x",
        function=lambda a: a.amplitude.peak,
        reference="statistics.peak",
    ),
    Feature(
        name="peak_to_peak",
        unit="x",
        function=lambda a: a.amplitude.peak_to_peak,
        reference="statistics.peak_to_peak",
    ),
    Feature(
        name="crest_factor",
        unit="-",
        function=lambda a: a.amplitude.crest_factor,
        reference="statistics.crest_factor",
    ),
    Feature(
        name="kurtosis",
        unit="-",
        function=lambda a: a.amplitude.kurtosis,
        reference=f"statistics.kurtosis; {_MOMENTS}",
    ),
    Feature(
        name="skewness",
        unit="-",
        function=lambda a: a.amplitude.skewness,
        reference=f"statistics.skewness; {_MOMENTS}",
    ),
    Feature(
        name="shape_factor",
        unit="-",
        function=lambda a: a.amplitude.shape_factor,
        reference="statistics.shape_factor",
    ),
    Feature(
        name="impulse_factor",
        unit="-",
        function=lambda a: a.amplitude.impulse_factor,
        reference="statistics.impulse_factor",
    ),
    Feature(
        name="band_levels",
        unit="dB re 1 x^2",
        needs=("spectrum bands",),
        labels=_band_labels,
        function=lambda a: a.band_levels,
        reference=f"spectrum.band_levels; {WELCH}",
    ),
    Feature(
        name="order_levels",
        unit="dB re 1 x^2",
        needs=("tacho",),
        labels=order_labels,
        function=_order_levels,
        reference="order.order_amplitudes; Blough, J. Sound Vib. 262 (2003) 707-720",
    ),
    Feature(
        name="crank_angle_map",
        unit="dB re 1 x^2",
        needs=("tacho", "casing"),
        labels=_map_labels,
        function=_map_levels,
        reference="order.crank_angle_map",
    ),
    Feature(
        name="angle_harmonics",
        unit="dB",
        needs=("tacho", "casing"),
        labels=_HARMONICS,
        function=lambda a: order.angle_harmonics(a.profile),
        reference="order.angle_harmonics",
    ),
    Feature(
        name="dead_centre_levels",
        unit="dB",
        needs=("tacho", "casing"),
        labels=_DEAD_CENTRES,
        function=lambda a: order.dead_centre_levels(a.profile),
        reference="order.dead_centre_levels",
    ),
    Feature(
        name="angle_kurtosis",
        unit="-",
        needs=("tacho", "casing"),
        function=lambda a: order.angle_kurtosis(a.profile),
        reference="order.angle_kurtosis",
    ),
    Feature(
        name="impacts_per_revolution",
        unit="1/rev",
        needs=("tacho", "casing"),
        function=_impacts,
        reference="order.impacts_per_revolution",
    ),
    Feature(
        name="rms_ratio",
        unit="dB",
        scope="pair",
        labels=("rms_ratio_db",),
        function=_rms_ratios,
        reference="statistics.rms",
    ),
    Feature(
        name="speed",
        unit="Hz",
        needs=("tacho",),
        scope="shaft",
        labels=("speed_hz",),
        function=_speed,
        reference="order.pulse_times",
    ),
    Feature(
        name="speed_variation",
        unit="-",
        needs=("tacho",),
        scope="shaft",
        function=_speed_variation,
        reference="order.pulse_times",
    ),
)
"""All features, in the order of the row."""


def _of_cylinders(*parts: str) -> Callable[[Analysis], Float]:
    """Parts of the transitions of each cylinder pressure."""
    return lambda a: np.array([[getattr(row, part) for part in parts] for row in a.transitions])


_PUMP = "Miller, The Reciprocating Pump, 2nd ed. (1995)"

CYLINDER_CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="pressure_levels",
        unit="x",
        needs=("tacho", "mark", "cylinder"),
        scope="cylinder",
        labels=("suction", "discharge"),
        function=_of_cylinders("suction", "discharge"),
        reference="pressure.transitions",
    ),
    Feature(
        name="pressure_ripple",
        unit="x",
        needs=("tacho", "mark", "cylinder"),
        scope="cylinder",
        labels=("suction_ripple", "discharge_ripple"),
        function=_of_cylinders("suction_ripple", "discharge_ripple"),
        reference="pressure.transitions",
    ),
    Feature(
        name="pressure_transitions",
        unit="deg",
        needs=("tacho", "mark", "cylinder"),
        scope="cylinder",
        labels=("rise_deg", "rise_width_deg", "fall_deg", "fall_width_deg"),
        function=_of_cylinders("rise", "rise_width", "fall", "fall_width"),
        reference=f"pressure.transitions; {_PUMP}",
    ),
)
"""Features of a cylinder pressure next to a vibration, after those of a test."""

TEST_CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="frf_profile",
        unit="dB re 1 (x/N)^2",
        needs=("force", "profile"),
        scope="path",
        labels=_profile_labels,
        function=lambda a: a.frf_profile[0],
        reference=f"transfer.profile; {RANDOM_DATA}",
    ),
)
"""Features of a test with a measured force, after those of an orbit."""
