"""Rows that the core set adds to the standard one: all others that are fast to compute."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..response import frf, operational, response_change, transfer
from ..rotation import tacholess_speed as speed
from ..signal.spectral_shape import (
    noise_floor,
    spectral_centroid,
    spectral_entropy,
    spectral_flatness,
    spectral_spread,
)
from ..signal.spectrum import decibel, levels_in_bands
from ..signal.statistics import Real
from .analysis import Analysis, Settings
from .feature import (
    EWINS,
    RANDOM_DATA,
    ROLLING_BEARING,
    WELCH,
    Feature,
    band_names,
    fault_labels,
    order_labels,
    scores,
    stacked,
)

Float = NDArray[np.float64]


def _user_band_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(f"user_band_{low:g}_{high:g}.level_db" for low, high in settings.bands)


def _octave_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(f"third_octave_{_nominal(f)}.level_db" for f in settings.octave_centres(fs))


def _nominal(centre: float) -> str:
    """Nominal mid-band frequency of a third octave (IEC 61260-1, annex E)."""
    decade, place = divmod(round(10 * np.log10(centre)), 10)
    return f"{_R10[place] * 10.0**decade:g}"


_R10 = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)


def _tone(analysis: Analysis) -> Float:
    frequency, amplitude = analysis.tone
    return stacked(frequency, decibel(amplitude**2 / 2))


def _noise_floor(analysis: Analysis) -> Float:
    return decibel(noise_floor(analysis.lines, analysis.fs, n_averages=analysis.n_averages))


def _highest_kurtosis(analysis: Analysis) -> Float:
    frequency, kurtosis = analysis.spectral_kurtosis
    return stacked(kurtosis.max(axis=-1), frequency[np.argmax(kurtosis, axis=-1)])


def _order_phase_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"{label.removesuffix('.level_db')}.{part}"
        for label in order_labels(settings, _fs)
        for part in ("cos", "sin")
    )


def _order_phases(analysis: Analysis) -> Float:
    vectors = analysis.order_vectors
    size = np.abs(vectors)
    unit = vectors / np.where(size > 0, size, 1.0)
    return stacked(unit.real, unit.imag)


def _transmissibility_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(
        f"transmissibility.{band}.{part}"
        for band in band_names(settings.band_edges(fs))
        for part in ("level_db", "coherence")
    )


def _transmissibilities(analysis: Analysis) -> Float:
    edges = analysis.settings.band_edges(analysis.fs)
    return stacked(*operational.transmissibility(analysis.vibration, analysis.fs, edges))


def _deflection_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"deflection.{label.removesuffix('.level_db')}.{part}"
        for label in order_labels(settings, _fs)
        for part in ("ratio_db", "phase_cos", "phase_sin")
    )


def _synchronous(analysis: Analysis) -> Float:
    return stacked(
        *(
            value
            for part in analysis.synchronous
            for value in (decibel(part.rms.astype(np.float64) ** 2), part.kurtosis)
        )
    )


def _tacholess(analysis: Analysis) -> Float:
    """Speed, half its interval, and 1; zeros if no harmonics stand out."""
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
    # Removing the mean of the envelope leaves its lobe on lines 0 and 1.
    lines = amplitude[..., 2:]
    highest, middle = lines.max(axis=-1), np.median(lines, axis=-1)
    heard = middle > 0
    ratio = np.where(heard, highest / np.where(heard, middle, 1.0), 0.0)
    return stacked(np.where(heard, frequency[2 + np.argmax(lines, axis=-1)], 0.0), ratio)


def _frf_band_labels(settings: Settings, fs: float) -> tuple[str, ...]:
    return tuple(f"frf.{band}.level_db" for band in band_names(settings.frf_edges(fs)))


def _frf_levels(estimator: str) -> Callable[[Analysis], Float]:
    """Levels of the paths by an estimator."""
    return lambda a: transfer.band_levels(
        a.transfer_functions, a.settings.frf_edges(a.fs), estimator=estimator
    )


def _estimator_labels(estimator: str) -> Callable[[Settings, float], tuple[str, ...]]:
    return lambda settings, fs: tuple(
        f"frf_{estimator}.{band}.level_db" for band in band_names(settings.frf_edges(fs))
    )


def _frf_quality(analysis: Analysis) -> Float:
    """Mean coherence, its random error (1 at most), and share of lines left out.

    For a single blow the first two are NaN and no line is left out.
    """
    found = analysis.transfer_functions
    mean = found.coherence.mean(axis=-1)
    if np.isnan(mean).any():
        return stacked(mean, mean, found.masked)
    error = frf.random_error(mean, found.averages)
    return stacked(mean, np.minimum(error, 1.0), found.masked)


def _frf_assurance(analysis: Analysis) -> Float:
    """Similarity to the reference, path by path; 0 for a silent path."""
    found, known = analysis.transfer_functions, analysis.settings.reference
    if known is None:
        raise ValueError("reference = None must be given: the feature needs it; measure one")
    value, other = found.value, known.at(found.frequency, len(found.value))
    likeness = np.zeros(len(value))
    moving = np.any(value != 0, axis=-1) & np.any(other != 0, axis=-1)
    if moving.any():
        likeness[moving] = response_change.frequency_response_assurance(
            value[moving], other[moving]
        )
    return likeness


def _antiresonance_labels(settings: Settings, _fs: float) -> tuple[str, ...]:
    return tuple(
        f"frf.antiresonance_{k}.{part}"
        for k in range(1, settings.n_modes + 1)
        for part in ("frequency_hz", "depth_db")
    )


_IEC = "IEC 61260-1:2014"

_SHIN = "Shin, Hammond, Fundamentals of Signal Processing (2008), chapter 9"

CORE_ROWS: tuple[Feature, ...] = (
    Feature(
        name="clearance_factor",
        unit="-",
        function=lambda a: a.amplitude.clearance_factor,
        reference="statistics.clearance_factor; Lei, He, Zi, Expert Syst. Appl. 35 (2008) 1593",
    ),
    Feature(
        name="k_factor",
        unit="x^2",
        function=lambda a: a.amplitude.k_factor,
        reference="statistics.k_factor; Sturm et al., Waelzlagerdiagnostik (1986)",
    ),
    Feature(
        name="zero_crossing_rate",
        unit="1/s",
        function=lambda a: a.amplitude.zero_crossings * a.fs,
        reference="statistics.zero_crossing_rate; Rice, Bell Syst. Tech. J. 23 (1944) 282-332",
    ),
    Feature(
        name="entropy",
        unit="bit",
        function=lambda a: a.amplitude.entropy,
        reference="statistics.entropy; Shannon, Bell Syst. Tech. J. 27 (1948) 379-423",
    ),
    Feature(
        name="velocity_rms",
        unit="m/s",
        needs=("acceleration",),
        scope="housing",
        function=lambda a: a.velocity,
        reference="iso.velocity_rms; ISO 20816-1:2016",
    ),
    Feature(
        name="iso_zone",
        unit="0 to 3 for A to D",
        needs=("acceleration", "machine"),
        scope="housing",
        function=lambda a: a.zone,
        reference="iso.zone; ISO 20816-3:2022, ISO 10816-6, -7, ISO 20816-8",
    ),
    Feature(
        name="user_bands",
        unit="dB re 1 x^2",
        needs=("bands",),
        labels=_user_band_labels,
        function=lambda a: levels_in_bands(a.lines, a.fs, a.settings.bands),
        reference=f"spectrum.levels_in_bands; {WELCH}",
    ),
    Feature(
        name="third_octaves",
        unit="dB re 1 x^2",
        needs=("octaves",),
        labels=_octave_labels,
        function=lambda a: a.octave_levels,
        reference=f"spectrum.band_levels; {_IEC}",
    ),
    Feature(
        name="spectral_centroid",
        unit="Hz",
        labels=("spectral_centroid_hz",),
        function=lambda a: spectral_centroid(a.lines, a.fs),
        reference="spectral_shape.spectral_centroid",
    ),
    Feature(
        name="spectral_spread",
        unit="Hz",
        labels=("spectral_spread_hz",),
        function=lambda a: spectral_spread(a.lines, a.fs),
        reference="spectral_shape.spectral_spread",
    ),
    Feature(
        name="spectral_entropy",
        unit="-",
        function=lambda a: spectral_entropy(a.lines),
        reference="spectral_shape.spectral_entropy; Powell, Percival, J. Phys. A 12 (1979) 2053",
    ),
    Feature(
        name="spectral_flatness",
        unit="-",
        function=lambda a: spectral_flatness(a.lines),
        reference="spectral_shape.spectral_flatness; Johnston, IEEE JSAC 6 (1988) 314-323",
    ),
    Feature(
        name="noise_floor",
        unit="dB re 1 x^2/Hz",
        labels=("noise_floor_db",),
        function=_noise_floor,
        reference="spectral_shape.noise_floor",
    ),
    Feature(
        name="strongest_tone",
        unit="Hz, dB re 1 x^2",
        labels=("tone.frequency_hz", "tone.level_db"),
        function=_tone,
        reference="spectrum.strongest_tone; Grandke, IEEE Trans. Instrum. Meas. 32 (1983) 350-355",
    ),
    Feature(
        name="spectral_kurtosis",
        unit="-, Hz",
        needs=("frames",),
        labels=("spectral_kurtosis.highest", "spectral_kurtosis.frequency_hz"),
        function=_highest_kurtosis,
        reference="kurtogram.spectral_kurtosis; Antoni, Mech. Syst. Signal Process. 20 (2006) 282",
    ),
    Feature(
        name="harmonic_spacing",
        unit="Hz, -",
        needs=("spacing",),
        labels=("harmonic_spacing.frequency_hz", "harmonic_spacing.height"),
        function=lambda a: stacked(*a.harmonic_spacing),
        reference="cepstrum.harmonic_spacing; Randall, Mech. Syst. Signal Process. 97 (2017) 3-19",
    ),
    Feature(
        name="envelope_line",
        unit="Hz, -",
        needs=("envelope",),
        labels=("envelope_line.frequency_hz", "envelope_line.ratio"),
        function=_envelope_line,
        reference=f"envelope.envelope_spectrum; {ROLLING_BEARING}",
    ),
    Feature(
        name="bearing_lines",
        unit="-",
        needs=("envelope", "bearing", "speed"),
        labels=fault_labels("bearing", "score"),
        function=lambda a: scores(a.fault_lines),
        reference=f"envelope.fault_line; {ROLLING_BEARING}",
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
        labels=(
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
        labels=("tacholess.speed_hz", "tacholess.half_interval_hz", "tacholess.found"),
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
        reference=f"transfer.band_levels, frf.h1, mimo.multiple_h1; {RANDOM_DATA}",
    ),
    Feature(
        name="frf_h2_levels",
        unit="dB re 1 (x/N)^2",
        needs=("force", "frf bands"),
        scope="path",
        labels=_estimator_labels("h2"),
        function=_frf_levels("h2"),
        reference=f"transfer.band_levels, frf.h2; {RANDOM_DATA}",
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
        labels=("frf.coherence", "frf.random_error", "frf.masked_share"),
        function=_frf_quality,
        reference=f"frf.coherence, frf.random_error, transfer.coherence_limit; {RANDOM_DATA}",
    ),
    Feature(
        name="antiresonances",
        unit="Hz, dB",
        needs=("force",),
        scope="path",
        labels=_antiresonance_labels,
        function=lambda a: transfer.antiresonances(a.transfer_functions, a.settings.n_modes),
        reference=f"transfer.antiresonances; {EWINS}",
    ),
    Feature(
        name="frf_assurance",
        unit="-",
        needs=("force", "reference"),
        scope="path",
        labels=("frf.assurance",),
        function=_frf_assurance,
        reference="response_change.frequency_response_assurance; "
        "Heylen, Lammens, Swansea (1996) 48-57",
    ),
)
"""Rows that `core` adds to the standard set."""
