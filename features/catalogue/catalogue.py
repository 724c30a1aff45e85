"""The named catalogue of features: one row each, with its unit, its needs and its reference."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..response import frf, modal, operational, transfer
from ..rotation import orbit, order
from ..rotation import tacholess_speed as speed
from ..signal.envelope import FaultLine
from ..signal.spectral_shape import (
    noise_floor,
    spectral_centroid,
    spectral_entropy,
    spectral_flatness,
    spectral_spread,
)
from ..signal.spectrum import decibel, levels_in_bands
from ..signal.statistics import Real
from .analysis import FAULTS, Analysis, Settings

Float = NDArray[np.float64]
Scope = Literal["channel", "housing", "path", "pair", "shaft", "orbit", "frf", "cylinder"]
SetName = Literal["standard", "core", "complete"]


@dataclass(frozen=True, kw_only=True)
class Feature:
    """One row of the catalogue.

    Parameters
    ----------
    name : str
        What it is, unique in the catalogue.
    unit : str
        Unit of its values; "x" stands for the unit of the signal.
    needs : tuple of str
        What it cannot be had without, keys of `needs.NEEDS`; nothing but a vibration by default.
    uses : tuple of str
        What else it takes into account where it is there; ``tacho`` alone has a meaning.
    scope : {"channel", "housing", "path", "pair", "shaft", "orbit", "frf", "cylinder"}
        Whether it exists once per channel, per acceleration, per path from a force to a channel
        that is none, per pair of channels, per record, per orbit, per test, or per cylinder
        pressure.
    labels : callable
        ``labels(settings, fs)`` names its values within one of these.
    function : callable
        ``function(analysis)`` gives them [shape=(n_channels, …), (n_paths, …), (n_pairs, …) or
        (…)].
    reference : str
        Where it is defined.

    Examples
    --------
    >>> [feature.unit for feature in CATALOGUE if feature.name == "kurtosis"]
    ['-']
    """

    name: str
    unit: str
    needs: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    scope: Scope = "channel"
    labels: Callable[[Settings, float], tuple[str, ...]]
    function: Callable[[Analysis], NDArray[Any]]
    reference: str


def _named(*labels: str) -> Callable[[Settings, float], tuple[str, ...]]:
    """Labels that no setting changes."""
    return lambda _settings, _fs: labels


def _hertz(edges: Float) -> tuple[str, ...]:
    """Bands as text, in whole hertz."""
    bounds = np.rint(edges).astype(int)
    return tuple(f"band_{a}_{b}" for a, b in pairwise(bounds))


def _band_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(f"{band}.level_db" for band in _hertz(settings.band_edges(fs)))


def _order_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"order_{int(k):02d}.level_db" if k == int(k) else f"order_{k:g}.level_db"
        for k in settings.orders
    )


def _map_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    degrees = np.rint(np.linspace(0, 360, settings.angle_bins + 1)).astype(int)
    bands = _hertz(settings.map_edges(fs))
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
    """Scatter of the pulses' intervals over their mean; 0 where single samples could make it."""
    intervals = np.diff(analysis.pulses)
    found = intervals.std()
    return np.asarray(found / intervals.mean() if found > UNTOLD_SAMPLES / analysis.fs else 0.0)


UNTOLD_SAMPLES = 1 / math.sqrt(6)
"""Scatter of intervals between edges that are known to one sample [samples]: a sampled logic level
tells no less, and one whose edges are averaged must not tell more to a model."""


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


_DEAD_CENTRES = _named(
    *(f"dead_centre_{a}.{place}_db" for a in ("000", "180") for place in ("around", "after"))
)
_HARMONICS = _named(
    *(f"angle_harmonic_{k}.{part}_db" for k in (1, 2, 3) for part in ("cos", "sin"))
)

_MOMENTS = "Dyer, Stewart, J. Mech. Design 100 (1978) 229-235"
_WELCH = "Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73"


# --- beyond the standard row


def _stacked(*columns: Real) -> Float:
    """Values of one channel side by side [shape=(n_channels, n_values)]."""
    return np.stack([np.asarray(column, dtype=np.float64) for column in columns], axis=-1)


def _user_band_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(f"user_band_{low:g}_{high:g}.level_db" for low, high in settings.bands)


def _octave_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(f"third_octave_{_nominal(f)}.level_db" for f in settings.octave_centres(fs))


def _nominal(centre: float) -> str:
    """Nominal mid-band frequency of a third octave, as engineers know it (IEC 61260-1, annex E)."""
    decade, place = divmod(round(10 * np.log10(centre)), 10)
    return f"{_R10[place] * 10.0**decade:g}"


_R10 = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)


def _tone(analysis: Analysis) -> Float:
    frequency, amplitude = analysis.tone
    return _stacked(frequency, decibel(amplitude**2 / 2))


def _noise_floor(analysis: Analysis) -> Float:
    return decibel(noise_floor(analysis.lines, analysis.fs, n_averages=analysis.n_averages))


def _highest_kurtosis(analysis: Analysis) -> Float:
    frequency, kurtosis = analysis.spectral_kurtosis
    return _stacked(kurtosis.max(axis=-1), frequency[np.argmax(kurtosis, axis=-1)])


def _order_phase_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"{label.removesuffix('.level_db')}.{part}"
        for label in _order_labels(settings, _fs)
        for part in ("cos", "sin")
    )


def _order_phases(analysis: Analysis) -> Float:
    vectors = analysis.order_vectors
    size = np.abs(vectors)
    unit = vectors / np.where(size > 0, size, 1.0)
    return _stacked(unit.real, unit.imag)


def _transmissibility_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(
        f"transmissibility.{band}.{part}"
        for band in _hertz(settings.band_edges(fs))
        for part in ("level_db", "coherence")
    )


def _transmissibilities(analysis: Analysis) -> Float:
    edges = analysis.settings.band_edges(analysis.fs)
    return _stacked(*operational.transmissibility(analysis.vibration, analysis.fs, edges))


def _deflection_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"deflection.{label.removesuffix('.level_db')}.{part}"
        for label in _order_labels(settings, _fs)
        for part in ("ratio_db", "phase_cos", "phase_sin")
    )


def _synchronous(analysis: Analysis) -> Float:
    return _stacked(
        *(
            value
            for part in analysis.synchronous
            for value in (decibel(part.rms.astype(np.float64) ** 2), part.kurtosis)
        )
    )


def _tacholess(analysis: Analysis) -> Float:
    """Speed, half its interval, and 1; zeros where no harmonics stand out."""
    band = analysis.settings.speed_band_hz
    if band is None:
        raise ValueError("speed_band_hz is missing: the feature needs it; give it")
    return np.array([_speed_or_none(row, analysis.fs, band) for row in analysis.vibration])


def _speed_or_none(row: Real, fs: float, band: tuple[float, float]) -> tuple[float, float, float]:
    try:
        found = speed.tacholess_speed(row, fs, band_hz=band)
    except ValueError:  # no speed, or an ambiguous one; the record is long enough
        return 0.0, 0.0, 0.0
    return found.mean_hz, (found.high_hz - found.low_hz) / 2, 1.0


def _envelope_line(analysis: Analysis) -> Float:
    """Highest line of the envelope spectrum, and its ratio to the median line."""
    frequency, amplitude = analysis.envelope_spectrum
    # The mean of the envelope, taken out, leaves its lobe on lines 0 and 1.
    lines = amplitude[..., 2:]
    highest, middle = lines.max(axis=-1), np.median(lines, axis=-1)
    heard = middle > 0
    ratio = np.where(heard, highest / np.where(heard, middle, 1.0), 0.0)
    return _stacked(np.where(heard, frequency[2 + np.argmax(lines, axis=-1)], 0.0), ratio)


def _scores(lines: list[list[FaultLine | None]]) -> Float:
    return np.array([[line.score if line is not None else 0.0 for line in row] for row in lines])


def _kurtogram(analysis: Analysis) -> Float:
    return np.array([(k.centre, k.bandwidth, k.highest, k.score) for k in analysis.kurtograms])


def _fault_labels(prefix: str, part: str) -> Callable[[Settings, float], tuple[str, ...]]:
    return _named(*(f"{prefix}_{fault}.{part}" for fault in FAULTS))


def _frf_band_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(f"frf.{band}.level_db" for band in _hertz(settings.frf_edges(fs)))


def _frf_levels(estimator: str) -> Callable[[Analysis], Float]:
    """Levels of the paths by an estimator."""
    return lambda a: transfer.band_levels(
        a.transfer_functions, a.settings.frf_edges(a.fs), estimator=estimator
    )


def _estimator_labels(estimator: str) -> Callable[[Settings, float], tuple[str, ...]]:
    return lambda settings, fs: tuple(
        f"frf_{estimator}.{band}.level_db" for band in _hertz(settings.frf_edges(fs))
    )


def _profile_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    pairs = pairwise(settings.profile_edges(fs).tolist())
    return tuple(f"frf.profile_{low:.5g}_{high:.5g}.level_db" for low, high in pairs)


def _frf_quality(analysis: Analysis) -> Float:
    """Mean coherence, random error that goes with it, 1 at the most, and share of lines left out.

    NaN of one blow but for the last: nothing is left out then, for want of a reason.
    """
    found = analysis.transfer_functions
    mean = found.coherence.mean(axis=-1)
    if np.isnan(mean).any():
        return _stacked(mean, mean, found.masked)
    error = frf.random_error(mean, found.averages)
    return _stacked(mean, np.minimum(error, 1.0), found.masked)


def _frf_assurance(analysis: Analysis) -> Float:
    """Likeness to the reference, path by path; 0 of a silent one."""
    found, known = analysis.transfer_functions, analysis.settings.reference
    if known is None:
        raise ValueError("reference = None must be given: the feature needs it; measure one")
    value, other = found.value, known.at(found.frequency, len(found.value))
    likeness = np.zeros(len(value))
    moving = np.any(value != 0, axis=-1) & np.any(other != 0, axis=-1)
    if moving.any():
        likeness[moving] = modal.frequency_response_assurance(value[moving], other[moving])
    return likeness


def _antiresonance_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"frf.antiresonance_{k}.{part}"
        for k in range(1, settings.n_modes + 1)
        for part in ("frequency_hz", "depth_db")
    )


def _mode_labels(*parts: str) -> Callable[[Settings, float], tuple[str, ...]]:
    """One label for every part of every mode."""
    return lambda settings, _fs: tuple(
        f"mode_{k}.{part}" for k in range(1, settings.n_modes + 1) for part in parts
    )


def _of_modes(*parts: str) -> Callable[[Analysis], Float]:
    """Parts of the modes, rising; zeros where there are fewer."""

    def values(analysis: Analysis) -> Float:
        table = np.zeros((analysis.settings.n_modes, len(parts)))
        found = analysis.modes
        if found is not None:
            table[: found.frequency.size] = _stacked(*(getattr(found, part) for part in parts))
        return table

    return values


def _mode_shapes(analysis: Analysis) -> Float:
    """Shape and its deviation, of every path and mode; zeros where there is none."""
    paths = len(analysis.transfer_functions.value)
    table = np.zeros((paths, analysis.settings.n_modes, 2))
    if analysis.modes is not None:
        shape = _stacked(*transfer.mode_shapes(analysis.modes))
        table[analysis.modal_paths, : shape.shape[1]] = shape
    return table


def _static_stiffness(analysis: Analysis) -> Float:
    """Stiffness at rest, and of what lies above the modes; 200 dB where nothing moves."""
    table = np.full((len(analysis.transfer_functions.value), 2), -decibel(0.0))
    if analysis.modes is not None:
        flexibility = _stacked(*transfer.static_flexibility(analysis.modes))
        table[analysis.modal_paths] = -decibel(flexibility**2)
    return table


def _mode_changes(analysis: Analysis) -> Float:
    count = analysis.settings.n_modes
    return transfer.mode_changes(analysis.modes, analysis.reference_modes, count)


def _resonance_shift(analysis: Analysis) -> Float:
    """Mean relative shift of the modes that are found again, and the share of those that are."""
    known, found = analysis.reference_modes, analysis.modes
    if found is None or found.residue.shape[0] != known.residue.shape[0]:
        return np.zeros(2)  # a dead sensor: nothing is found again
    shift = modal.resonance_shift(found, known)
    count = len(shift.frequency)
    mean = float(shift.frequency.mean()) if count else 0.0
    return np.array([mean, count / max(known.frequency.size, 1)])


CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="rms",
        unit="x",
        labels=_named("rms"),
        function=lambda a: a.amplitude.rms,
        reference="statistics.rms",
    ),
    Feature(
        name="peak",
        unit="x",
        labels=_named("peak"),
        function=lambda a: a.amplitude.peak,
        reference="statistics.peak",
    ),
    Feature(
        name="peak_to_peak",
        unit="x",
        labels=_named("peak_to_peak"),
        function=lambda a: a.amplitude.peak_to_peak,
        reference="statistics.peak_to_peak",
    ),
    Feature(
        name="crest_factor",
        unit="-",
        labels=_named("crest_factor"),
        function=lambda a: a.amplitude.crest_factor,
        reference="statistics.crest_factor",
    ),
    Feature(
        name="kurtosis",
        unit="-",
        labels=_named("kurtosis"),
        function=lambda a: a.amplitude.kurtosis,
        reference=f"statistics.kurtosis; {_MOMENTS}",
    ),
    Feature(
        name="skewness",
        unit="-",
        labels=_named("skewness"),
        function=lambda a: a.amplitude.skewness,
        reference=f"statistics.skewness; {_MOMENTS}",
    ),
    Feature(
        name="shape_factor",
        unit="-",
        labels=_named("shape_factor"),
        function=lambda a: a.amplitude.shape_factor,
        reference="statistics.shape_factor",
    ),
    Feature(
        name="impulse_factor",
        unit="-",
        labels=_named("impulse_factor"),
        function=lambda a: a.amplitude.impulse_factor,
        reference="statistics.impulse_factor",
    ),
    Feature(
        name="band_levels",
        unit="dB re 1 x^2",
        needs=("spectrum bands",),
        labels=_band_labels,
        function=lambda a: a.band_levels,
        reference=f"spectrum.band_levels; {_WELCH}",
    ),
    Feature(
        name="order_levels",
        unit="dB re 1 x^2",
        needs=("tacho",),
        labels=_order_labels,
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
        labels=_named("angle_kurtosis"),
        function=lambda a: order.angle_kurtosis(a.profile),
        reference="order.angle_kurtosis",
    ),
    Feature(
        name="impacts_per_revolution",
        unit="1/rev",
        needs=("tacho", "casing"),
        labels=_named("impacts_per_revolution"),
        function=_impacts,
        reference="order.impacts_per_revolution",
    ),
    Feature(
        name="rms_ratio",
        unit="dB",
        scope="pair",
        labels=_named("rms_ratio_db"),
        function=_rms_ratios,
        reference="statistics.rms",
    ),
    Feature(
        name="speed",
        unit="Hz",
        needs=("tacho",),
        scope="shaft",
        labels=_named("speed_hz"),
        function=_speed,
        reference="order.pulse_times",
    ),
    Feature(
        name="speed_variation",
        unit="-",
        needs=("tacho",),
        scope="shaft",
        labels=_named("speed_variation"),
        function=_speed_variation,
        reference="order.pulse_times",
    ),
)
"""Every feature, in the order of the row."""


ORBIT_CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="centreline",
        unit="x, rad, -",
        needs=("probes",),
        scope="orbit",
        labels=_named(
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
        labels=_named("largest_excursion_db"),
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
        labels=_named("mark_cos", "mark_sin"),
        function=_mark,
        reference="orbit.orbit_path",
    ),
    Feature(
        name="whirl",
        unit="-, dB re 1 x^2",
        needs=("tacho", "probes"),
        scope="orbit",
        labels=_named("whirl_ratio", "whirl_db"),
        function=_whirl,
        reference="orbit.whirl; Grandke, IEEE Trans. Instrum. Meas. 32 (1983) 350-355",
    ),
)
"""Features of a pair of proximity probes at right angles, after those of `CATALOGUE`."""


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
        labels=_named("suction", "discharge"),
        function=_of_cylinders("suction", "discharge"),
        reference="pressure.transitions",
    ),
    Feature(
        name="pressure_ripple",
        unit="x",
        needs=("tacho", "mark", "cylinder"),
        scope="cylinder",
        labels=_named("suction_ripple", "discharge_ripple"),
        function=_of_cylinders("suction_ripple", "discharge_ripple"),
        reference="pressure.transitions",
    ),
    Feature(
        name="pressure_transitions",
        unit="deg",
        needs=("tacho", "mark", "cylinder"),
        scope="cylinder",
        labels=_named("rise_deg", "rise_width_deg", "fall_deg", "fall_width_deg"),
        function=_of_cylinders("rise", "rise_width", "fall", "fall_width"),
        reference=f"pressure.transitions; {_PUMP}",
    ),
)
"""Features of a cylinder pressure beside a vibration, after those of a test."""


_RANDOM_DATA = "Bendat, Piersol, Random Data, 4th ed. (2010), chapter 9"

TEST_CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="frf_profile",
        unit="dB re 1 (x/N)^2",
        needs=("force", "profile"),
        scope="path",
        labels=_profile_labels,
        function=lambda a: a.frf_profile[0],
        reference=f"transfer.profile; {_RANDOM_DATA}",
    ),
)
"""Features of a test with a measured force, after those of an orbit."""


_IEC = "IEC 61260-1:2014"
_BEARING = "Randall, Antoni, Mech. Syst. Signal Process. 25 (2011) 485-520"
_SHIN = "Shin, Hammond, Fundamentals of Signal Processing (2008), chapter 9"
_FIT = "Guillaume et al., IMAC XXI (2003)"
_EWINS = "Ewins, Modal Testing, 2nd ed. (2000)"

CORE_ROWS: tuple[Feature, ...] = (
    Feature(
        name="clearance_factor",
        unit="-",
        labels=_named("clearance_factor"),
        function=lambda a: a.amplitude.clearance_factor,
        reference="statistics.clearance_factor; Lei, He, Zi, Expert Syst. Appl. 35 (2008) 1593",
    ),
    Feature(
        name="k_factor",
        unit="x^2",
        labels=_named("k_factor"),
        function=lambda a: a.amplitude.k_factor,
        reference="statistics.k_factor; Sturm et al., Waelzlagerdiagnostik (1986)",
    ),
    Feature(
        name="zero_crossing_rate",
        unit="1/s",
        labels=_named("zero_crossing_rate"),
        function=lambda a: a.amplitude.zero_crossings * a.fs,
        reference="statistics.zero_crossing_rate; Rice, Bell Syst. Tech. J. 23 (1944) 282-332",
    ),
    Feature(
        name="entropy",
        unit="bit",
        labels=_named("entropy"),
        function=lambda a: a.amplitude.entropy,
        reference="statistics.entropy; Shannon, Bell Syst. Tech. J. 27 (1948) 379-423",
    ),
    Feature(
        name="velocity_rms",
        unit="m/s",
        needs=("acceleration",),
        scope="housing",
        labels=_named("velocity_rms"),
        function=lambda a: a.velocity,
        reference="iso.velocity_rms; ISO 20816-1:2016",
    ),
    Feature(
        name="iso_zone",
        unit="0 to 3 for A to D",
        needs=("acceleration", "machine"),
        scope="housing",
        labels=_named("iso_zone"),
        function=lambda a: a.zone,
        reference="iso.zone; ISO 20816-3:2022, ISO 10816-6, -7, ISO 20816-8",
    ),
    Feature(
        name="user_bands",
        unit="dB re 1 x^2",
        needs=("bands",),
        labels=_user_band_labels,
        function=lambda a: levels_in_bands(a.lines, a.fs, a.settings.bands),
        reference=f"spectrum.levels_in_bands; {_WELCH}",
    ),
    Feature(
        name="third_octaves",
        unit="dB re 1 x^2",
        needs=("octaves",),
        labels=_octave_labels,
        function=lambda a: a.octave_levels,
        reference=f"third_octave.third_octave_levels; {_IEC}",
    ),
    Feature(
        name="spectral_centroid",
        unit="Hz",
        labels=_named("spectral_centroid_hz"),
        function=lambda a: spectral_centroid(a.lines, a.fs),
        reference="spectral_shape.spectral_centroid",
    ),
    Feature(
        name="spectral_spread",
        unit="Hz",
        labels=_named("spectral_spread_hz"),
        function=lambda a: spectral_spread(a.lines, a.fs),
        reference="spectral_shape.spectral_spread",
    ),
    Feature(
        name="spectral_entropy",
        unit="-",
        labels=_named("spectral_entropy"),
        function=lambda a: spectral_entropy(a.lines),
        reference="spectral_shape.spectral_entropy; Powell, Percival, J. Phys. A 12 (1979) 2053",
    ),
    Feature(
        name="spectral_flatness",
        unit="-",
        labels=_named("spectral_flatness"),
        function=lambda a: spectral_flatness(a.lines),
        reference="spectral_shape.spectral_flatness; Johnston, IEEE JSAC 6 (1988) 314-323",
    ),
    Feature(
        name="noise_floor",
        unit="dB re 1 x^2/Hz",
        labels=_named("noise_floor_db"),
        function=_noise_floor,
        reference="spectral_shape.noise_floor",
    ),
    Feature(
        name="strongest_tone",
        unit="Hz, dB re 1 x^2",
        labels=_named("tone.frequency_hz", "tone.level_db"),
        function=_tone,
        reference="spectrum.strongest_tone; Grandke, IEEE Trans. Instrum. Meas. 32 (1983) 350-355",
    ),
    Feature(
        name="spectral_kurtosis",
        unit="-, Hz",
        needs=("frames",),
        labels=_named("spectral_kurtosis.highest", "spectral_kurtosis.frequency_hz"),
        function=_highest_kurtosis,
        reference="envelope.spectral_kurtosis; Antoni, Mech. Syst. Signal Process. 20 (2006) 282",
    ),
    Feature(
        name="harmonic_spacing",
        unit="Hz, -",
        needs=("spacing",),
        labels=_named("harmonic_spacing.frequency_hz", "harmonic_spacing.height"),
        function=lambda a: _stacked(*a.harmonic_spacing),
        reference="cepstrum.harmonic_spacing; Randall, Mech. Syst. Signal Process. 97 (2017) 3-19",
    ),
    Feature(
        name="envelope_line",
        unit="Hz, -",
        needs=("envelope",),
        labels=_named("envelope_line.frequency_hz", "envelope_line.ratio"),
        function=_envelope_line,
        reference=f"envelope.envelope_spectrum; {_BEARING}",
    ),
    Feature(
        name="bearing_lines",
        unit="-",
        needs=("envelope", "bearing", "speed"),
        labels=_fault_labels("bearing", "score"),
        function=lambda a: _scores(a.fault_lines),
        reference=f"envelope.fault_line; {_BEARING}",
    ),
    Feature(
        name="order_phases",
        unit="-",
        needs=("tacho", "mark"),
        labels=_order_phase_labels,
        function=_order_phases,
        reference="order.order_amplitudes; Blough, J. Sound Vib. 262 (2003) 707-720",
    ),
    Feature(
        name="synchronous_average",
        unit="dB re 1 x^2, -",
        needs=("tacho",),
        labels=_named(
            "synchronous.level_db",
            "synchronous.kurtosis",
            "residual.level_db",
            "residual.kurtosis",
        ),
        function=_synchronous,
        reference="resample.synchronous_average; McFadden, Mech. Syst. Signal Process. 1 (1987) 83",
    ),
    Feature(
        name="transmissibility",
        unit="dB, -",
        needs=("spectrum bands",),
        scope="pair",
        labels=_transmissibility_labels,
        function=_transmissibilities,
        reference="operational.transmissibility; Devriendt, Guillaume, JSV 314 (2008) 343-356",
    ),
    Feature(
        name="deflection_shape",
        unit="dB, -",
        needs=("tacho",),
        scope="pair",
        labels=_deflection_labels,
        function=lambda a: operational.deflection_shape(a.order_vectors),
        reference="operational.deflection_shape; Richardson, Sound and Vibration 31 (1997) 54-61",
    ),
    Feature(
        name="tacholess_speed",
        unit="Hz, Hz, -",
        needs=("speed band",),
        labels=_named("tacholess.speed_hz", "tacholess.half_interval_hz", "tacholess.found"),
        function=_tacholess,
        reference="speed.tacholess_speed",
    ),
    Feature(
        name="frf_levels",
        unit="dB re 1 (x/N)^2",
        needs=("force", "frf bands"),
        scope="path",
        labels=_frf_band_labels,
        function=_frf_levels("h1"),
        reference=f"transfer.band_levels, frf.h1, mimo.multiple_h1; {_RANDOM_DATA}",
    ),
    Feature(
        name="frf_h2_levels",
        unit="dB re 1 (x/N)^2",
        needs=("force", "frf bands"),
        scope="path",
        labels=_estimator_labels("h2"),
        function=_frf_levels("h2"),
        reference=f"transfer.band_levels, frf.h2; {_RANDOM_DATA}",
    ),
    Feature(
        name="frf_hv_levels",
        unit="dB re 1 (x/N)^2",
        needs=("force", "frf bands"),
        scope="path",
        labels=_estimator_labels("hv"),
        function=_frf_levels("hv"),
        reference=f"transfer.band_levels, frf.hv; {_SHIN}",
    ),
    Feature(
        name="frf_quality",
        unit="-",
        needs=("force",),
        scope="path",
        labels=_named("frf.coherence", "frf.random_error", "frf.masked_share"),
        function=_frf_quality,
        reference=f"frf.coherence, frf.random_error, transfer.coherence_limit; {_RANDOM_DATA}",
    ),
    Feature(
        name="antiresonances",
        unit="Hz, dB",
        needs=("force",),
        scope="path",
        labels=_antiresonance_labels,
        function=lambda a: transfer.antiresonances(a.transfer_functions, a.settings.n_modes),
        reference=f"transfer.antiresonances; {_EWINS}",
    ),
    Feature(
        name="frf_assurance",
        unit="-",
        needs=("force", "reference"),
        scope="path",
        labels=_named("frf.assurance"),
        function=_frf_assurance,
        reference="modal.frequency_response_assurance; Heylen, Lammens, Swansea (1996) 48-57",
    ),
)
"""What `core` has beside the standard row."""


COMPLETE_ROWS: tuple[Feature, ...] = (
    Feature(
        name="kurtogram",
        unit="Hz, Hz, -, -",
        needs=("frames",),
        uses=("tacho",),
        labels=_named(
            "kurtogram.centre_hz",
            "kurtogram.bandwidth_hz",
            "kurtogram.kurtosis",
            "kurtogram.score",
        ),
        function=_kurtogram,
        reference="envelope.kurtogram; Antoni, Mech. Syst. Signal Process. 21 (2007) 108-124",
    ),
    Feature(
        name="kurtogram_bearing_lines",
        unit="-",
        needs=("frames", "bearing", "speed"),
        labels=_fault_labels("kurtogram_bearing", "score"),
        function=lambda a: _scores(a.kurtogram_fault_lines),
        reference=f"envelope.kurtogram, envelope.fault_line; {_BEARING}",
    ),
    Feature(
        name="cyclic_coherence",
        unit="-",
        needs=("cycles", "envelope", "bearing", "speed"),
        labels=_fault_labels("cyclic", "coherence"),
        function=lambda a: a.cyclic_coherences,
        reference="envelope.cyclic_coherence; Antoni, Mech. Syst. Signal Process. 21 (2007) 597",
    ),
    Feature(
        name="modes",
        unit="Hz, -",
        needs=("force",),
        scope="frf",
        labels=_mode_labels("frequency_hz", "damping_ratio"),
        function=_of_modes("frequency", "damping_ratio"),
        reference=f"modal.modal_fit; {_FIT}",
    ),
    Feature(
        name="mode_deviations",
        unit="Hz, -",
        needs=("force",),
        scope="frf",
        labels=_mode_labels("frequency_deviation_hz", "damping_deviation"),
        function=_of_modes("frequency_deviation", "damping_deviation"),
        reference=f"modal.modal_fit; {_FIT}",
    ),
    Feature(
        name="mode_shapes",
        unit="-",
        needs=("force",),
        scope="path",
        labels=_mode_labels("shape", "shape_deviation"),
        function=_mode_shapes,
        reference=f"transfer.mode_shapes; {_EWINS}",
    ),
    Feature(
        name="static_stiffness",
        unit="dB re 1 N/(x in m)",
        needs=("force",),
        scope="path",
        labels=_named("static.stiffness_db", "static.residual_stiffness_db"),
        function=_static_stiffness,
        reference=f"transfer.static_flexibility; {_EWINS}",
    ),
    Feature(
        name="resonance_shift",
        unit="-",
        needs=("force", "reference", "reference modes"),
        scope="frf",
        labels=_named("resonance_shift.mean", "resonance_shift.found"),
        function=_resonance_shift,
        reference="modal.resonance_shift",
    ),
    Feature(
        name="mode_changes",
        unit="-, -, -, dB, -",
        needs=("force", "reference", "reference modes"),
        scope="frf",
        labels=_mode_labels(
            "frequency_shift", "shift_deviation", "damping_change", "level_change_db", "mac"
        ),
        function=_mode_changes,
        reference="transfer.mode_changes, modal.resonance_shift; Allemang, IMAC I (1982) 110-116",
    ),
)
"""What `complete` has beside `core`: what costs most."""


_STANDARD = (*CATALOGUE, *ORBIT_CATALOGUE, *TEST_CATALOGUE, *CYLINDER_CATALOGUE)

SETS: Mapping[SetName, tuple[Feature, ...]] = MappingProxyType(
    {
        "standard": _STANDARD,
        "core": (*_STANDARD, *CORE_ROWS),
        "complete": (*_STANDARD, *CORE_ROWS, *COMPLETE_ROWS),
    }
)
"""Rows of every set: what models are trained on, all that is cheap, and everything."""


def smallest_set(feature: Feature) -> SetName:
    """Smallest set that has a feature.

    Examples
    --------
    >>> smallest_set(CATALOGUE[0]), smallest_set(COMPLETE_ROWS[0])
    ('standard', 'complete')
    """
    return next(name for name in get_args(SetName) if feature in SETS[name])
