"""The named catalogue of features, and the row it makes of one recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations, pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import order
from .spectrum import band_edges, decibel, levels_from_lines, line_band_edges, power_lines
from .statistics import Amplitude, Real

Float = NDArray[np.float64]

LARGEST_SAMPLE = 1e9
"""Largest believable sample [unit of x]: beyond it, squares leave the range of float32."""

FEWEST_SAMPLES = 64
"""Shortest record that is given a spectrum."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Choices behind the catalogue; rows compare only when made with equal ones.

    Parameters
    ----------
    n_bands : int
        Bands of the long spectrum.
    band_low : float
        Their lower edge [Hz].
    map_bands : int
        Bands of the crank-angle map.
    map_low : float
        Their lower edge [Hz].
    high : float, optional
        Upper edge of both [Hz]; see `band_edges`.
    angle_bins : int
        Bins in one revolution.
    orders : tuple of float
        Shaft orders [-].
    impact_threshold : float
        Least short-time energy of an impact, in medians [-].

    Examples
    --------
    >>> Settings(n_bands=10).angle_bins
    36
    """

    n_bands: int = 20
    band_low: float = 50.0
    map_bands: int = 20
    map_low: float = 200.0
    high: float | None = None
    angle_bins: int = 36
    orders: tuple[float, ...] = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
    impact_threshold: float = order.IMPACT_THRESHOLD

    def band_edges(self, fs: float) -> Float:
        """Edges of the bands of the long spectrum [Hz, shape=(n_bands + 1,)]."""
        return band_edges(fs, n_bands=self.n_bands, low=self.band_low, high=self.high)

    def map_edges(self, fs: float) -> Float:
        """Edges of the bands of the crank-angle map [Hz, shape=(map_bands + 1,)]."""
        nperseg, _ = order.default_window(fs)
        return line_band_edges(
            fs, nperseg, n_bands=self.map_bands, low=self.map_low, high=self.high
        )


STANDARD = Settings()
"""The settings used unless others are given."""


class Analysis:
    """One recording with every transform its features share, each computed at most once.

    Parameters
    ----------
    vibration : ndarray, shape (n_channels, n_samples)
        Accelerations [m/s^2, or one other unit for all channels], finite.
    fs : float
        Sample rate [Hz].
    pulses : ndarray, shape (n_pulses,), optional
        Tacho pulse times [s].
    pulses_per_revolution : int
        Pulses in one revolution.
    settings : Settings
        Bands, bins and orders.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.sin(2 * np.pi * 100 * np.arange(4096) / 4096)
    >>> round(float(Analysis(wave[np.newaxis], 4096.0).amplitude.kurtosis[0]), 6)
    1.5
    """

    def __init__(
        self,
        vibration: Real,
        fs: float,
        *,
        pulses: Float | None = None,
        pulses_per_revolution: int = 1,
        settings: Settings = STANDARD,
    ) -> None:
        self.amplitude = Amplitude(vibration)
        self.fs = fs
        self.settings = settings
        self._pulses = pulses
        self.pulses_per_revolution = pulses_per_revolution

    @cached_property
    def vibration(self) -> Real:
        """Zero-mean signals [unit of x, shape=(n_channels, n_samples)]."""
        return self.amplitude.centred

    @cached_property
    def lines(self) -> Real:
        """Mean square per spectral line [(unit of x)^2, shape=(n_channels, n_lines)]."""
        return power_lines(self.vibration, self.fs)

    @cached_property
    def pulses(self) -> Float:
        """Tacho pulse times [s, shape=(n_pulses,)]; ValueError without a tacho."""
        if self._pulses is None:
            raise ValueError("n_pulses = 0 must be >= 2: the feature needs a tacho; record one")
        return self._pulses

    @cached_property
    def phase(self) -> Float:
        """Shaft phase [rev, shape=(n_samples,)]."""
        return order.shaft_phase(
            self.pulses,
            self.vibration.shape[-1],
            self.fs,
            pulses_per_revolution=self.pulses_per_revolution,
        )

    @cached_property
    def energy(self) -> Real:
        """Short-time energies [(unit of x)^2, shape=(n_channels, n_frames, map_bands)]."""
        nperseg, hop = order.default_window(self.fs)
        edges = self.settings.map_edges(self.fs)
        return order.short_time_energy(
            self.vibration, self.fs, edges=edges, nperseg=nperseg, hop=hop
        )

    @cached_property
    def boundaries(self) -> Float:
        """Phase at the frame boundaries [rev, shape=(n_frames + 1,)]."""
        nperseg, hop = order.default_window(self.fs)
        return order.frame_boundaries(self.phase, self.energy.shape[-2], nperseg=nperseg, hop=hop)

    @cached_property
    def angle_map(self) -> Float:
        """Crank-angle map [(unit of x)^2, shape=(n_channels, angle_bins, map_bands)]."""
        return order.mean_over_angle(
            self.energy, self.boundaries, angle_bins=self.settings.angle_bins
        )

    @cached_property
    def profile(self) -> Float:
        """Broadband energy over the angle [(unit of x)^2, shape=(n_channels, angle_bins)]."""
        return np.asarray(self.angle_map.sum(axis=-1))


@dataclass(frozen=True, kw_only=True)
class Feature:
    """One row of the catalogue.

    Parameters
    ----------
    name : str
        What it is, unique in the catalogue.
    unit : str
        Unit of its values; "x" stands for the unit of the signal.
    needs : {"vibration", "tacho"}
        "tacho" if it cannot be had without one.
    scope : {"channel", "pair", "shaft"}
        Whether it exists once per channel, per pair of channels, or per record.
    labels : callable
        ``labels(settings, fs)`` names its values within one channel, pair or record.
    function : callable
        ``function(analysis)`` gives them [shape=(n_channels, …), (n_pairs, …) or (…)].
    reference : str
        Where it is defined.

    Examples
    --------
    >>> [feature.unit for feature in CATALOGUE if feature.name == "kurtosis"]
    ['-']
    """

    name: str
    unit: str
    needs: Literal["vibration", "tacho"] = "vibration"
    scope: Literal["channel", "pair", "shaft"] = "channel"
    labels: Callable[[Settings, float], tuple[str, ...]]
    function: Callable[[Analysis], Real]
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


def _band_levels(analysis: Analysis) -> Float:
    return levels_from_lines(analysis.lines, analysis.fs, analysis.settings.band_edges(analysis.fs))


def _order_levels(analysis: Analysis) -> Float:
    amplitudes = order.order_amplitudes(
        analysis.vibration, analysis.phase, analysis.settings.orders
    )
    return decibel(np.abs(amplitudes.astype(np.complex128)) ** 2 / 2)


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
    first, second = np.array(list(combinations(range(level.size), 2)), dtype=int).reshape(-1, 2).T
    return np.asarray(level[first] - level[second])


def _speed(analysis: Analysis) -> Float:
    pulses = analysis.pulses
    revolutions = (pulses.size - 1) / analysis.pulses_per_revolution
    return np.asarray(revolutions / (pulses[-1] - pulses[0]))


def _speed_variation(analysis: Analysis) -> Float:
    intervals = np.diff(analysis.pulses)
    return np.asarray(intervals.std() / intervals.mean())


_DEAD_CENTRES = _named(
    *(f"dead_centre_{a}.{place}_db" for a in ("000", "180") for place in ("around", "after"))
)
_HARMONICS = _named(
    *(f"angle_harmonic_{k}.{part}_db" for k in (1, 2, 3) for part in ("cos", "sin"))
)

_MOMENTS = "Dyer, Stewart, J. Mech. Design 100 (1978) 229-235"
_WELCH = "Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73"

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
        labels=_band_labels,
        function=_band_levels,
        reference=f"spectrum.band_levels; {_WELCH}",
    ),
    Feature(
        name="order_levels",
        unit="dB re 1 x^2",
        needs="tacho",
        labels=_order_labels,
        function=_order_levels,
        reference="order.order_amplitudes; Blough, J. Sound Vib. 262 (2003) 707-720",
    ),
    Feature(
        name="crank_angle_map",
        unit="dB re 1 x^2",
        needs="tacho",
        labels=_map_labels,
        function=_map_levels,
        reference="order.crank_angle_map",
    ),
    Feature(
        name="angle_harmonics",
        unit="dB",
        needs="tacho",
        labels=_HARMONICS,
        function=lambda a: order.angle_harmonics(a.profile),
        reference="order.angle_harmonics",
    ),
    Feature(
        name="dead_centre_levels",
        unit="dB",
        needs="tacho",
        labels=_DEAD_CENTRES,
        function=lambda a: order.dead_centre_levels(a.profile),
        reference="order.dead_centre_levels",
    ),
    Feature(
        name="angle_kurtosis",
        unit="-",
        needs="tacho",
        labels=_named("angle_kurtosis"),
        function=lambda a: order.angle_kurtosis(a.profile),
        reference="order.angle_kurtosis",
    ),
    Feature(
        name="impacts_per_revolution",
        unit="1/rev",
        needs="tacho",
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
        needs="tacho",
        scope="shaft",
        labels=_named("speed_hz"),
        function=_speed,
        reference="order.pulse_times",
    ),
    Feature(
        name="speed_variation",
        unit="-",
        needs="tacho",
        scope="shaft",
        labels=_named("speed_variation"),
        function=_speed_variation,
        reference="order.pulse_times",
    ),
)
"""Every feature, in the order of the row."""


def catalogue(*, tacho: bool) -> tuple[Feature, ...]:
    """Features that a recording can have.

    Parameters
    ----------
    tacho : bool
        Whether it has a tacho.

    Returns
    -------
    tuple of Feature
        The rows of `CATALOGUE` whose needs are met, in order.

    Examples
    --------
    >>> len(catalogue(tacho=False)) < len(catalogue(tacho=True)) == len(CATALOGUE)
    True
    """
    return tuple(f for f in CATALOGUE if tacho or f.needs != "tacho")


def feature_names(
    channel_names: Sequence[str], fs: float, *, tacho: bool = True, settings: Settings = STANDARD
) -> tuple[str, ...]:
    """Names of the values of `feature_row`, without a recording.

    Parameters
    ----------
    channel_names : sequence of str
        Names of the vibration channels, unique.
    fs : float
        Sample rate [Hz]; it decides the bands, whose edges are part of the name.
    tacho : bool
        Whether there is a tacho.
    settings : Settings
        Bands, bins and orders.

    Returns
    -------
    tuple of str
        ``channel.label``, ``first_over_second.label`` and ``shaft.label``.

    Raises
    ------
    ValueError
        If a channel name is empty or repeated, or a band does not fit below fs / 2.

    Examples
    --------
    >>> names = feature_names(["acc_x"], 25_600.0)
    >>> names[0], names[8], names[18 + 20]
    ('acc_x.rms', 'acc_x.band_50_66.level_db', 'acc_x.angle_000_010.band_150_250.level_db')
    """
    return _feature_names(tuple(channel_names), float(fs), tacho, settings)


@lru_cache(maxsize=64)
def _feature_names(
    channels: tuple[str, ...], fs: float, tacho: bool, settings: Settings
) -> tuple[str, ...]:
    if not channels or not all(channels) or len(set(channels)) < len(channels):
        raise ValueError(f"channel_names = {list(channels)} must be non-empty and unique; rename")
    owners = {
        "channel": channels,
        "pair": tuple(f"{a}_over_{b}" for a, b in combinations(channels, 2)),
        "shaft": ("shaft",),
    }
    names = tuple(
        f"{owner}.{label}"
        for feature in catalogue(tacho=tacho)
        for labels in (feature.labels(settings, fs),)
        for owner in owners[feature.scope]
        for label in labels
    )
    if len(set(names)) < len(names):
        raise ValueError(
            f"fs = {fs} Hz makes {len(names) - len(set(names))} feature names equal, must be 0: "
            "bands or bins are closer than 1 Hz or 1 deg; ask for fewer"
        )
    return names


def feature_row(
    vibration: ArrayLike,
    fs: float,
    *,
    tacho: ArrayLike | None = None,
    pulses_per_revolution: int = 1,
    channel_names: Sequence[str] | None = None,
    settings: Settings = STANDARD,
) -> tuple[tuple[str, ...], Float]:
    """All features of one recording.

    Parameters
    ----------
    vibration : array_like, shape (n_channels, n_samples) or (n_samples,)
        Accelerations [m/s^2, or one other unit for all channels]. float32 stays float32 in the
        transforms.
    fs : float
        Sample rate [Hz].
    tacho : array_like, shape (n_samples,), optional
        Pulses [V], whose rising edge is angle 0; without it the features that need it are absent.
    pulses_per_revolution : int
        Pulses in one revolution. Above 1, angle 0 is any one of them, and the crank angle of two
        records no longer compares.
    channel_names : sequence of str, optional
        Names of the channels; ``ch_0``, ``ch_1``, … by default.
    settings : Settings
        Bands, bins and orders.

    Returns
    -------
    names : tuple of str
        As `feature_names`.
    values : ndarray, shape (n_features,)
        Finite values, float64, in the order of the names. A constant channel, a dead sensor,
        has rms and ratios 0 and levels of -200 dB.

    Raises
    ------
    ValueError
        If a sample is not finite or exceeds 1e9, the record is shorter than 64 samples or (with a
        tacho) one revolution, the lengths or the number of names disagree, or as `pulse_times`
        and `shaft_phase`. All faults of the vibration are named at once.

    Notes
    -----
    Valid for stationary running. See `order.crank_angle_map` for the speeds at which the angle
    bins are resolved.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.sin(2 * np.pi * 1000 * np.arange(25_600) / 25_600)
    >>> names, values = feature_row(wave, 25_600.0, channel_names=["acc_x"])
    >>> row = dict(zip(names, values.round(2).tolist()))
    >>> row["acc_x.kurtosis"], row["acc_x.band_995_1306.level_db"]
    (1.5, -3.01)
    """
    signals = np.atleast_2d(np.asarray(vibration))
    if not np.issubdtype(signals.dtype, np.floating) or signals.dtype == np.float16:
        signals = signals.astype(np.float64)
    channels = _channel_names(channel_names, len(signals))
    _check_vibration(signals, channels)
    pulses = None
    if tacho is not None:
        pulses = _pulses(tacho, fs, signals.shape[-1])
    names = feature_names(channels, fs, tacho=tacho is not None, settings=settings)
    analysis = Analysis(
        signals,
        fs,
        pulses=pulses,
        pulses_per_revolution=pulses_per_revolution,
        settings=settings,
    )
    parts = [np.ravel(f.function(analysis)) for f in catalogue(tacho=tacho is not None)]
    return names, np.concatenate(parts, dtype=np.float64)


def _channel_names(given: Sequence[str] | None, n_channels: int) -> tuple[str, ...]:
    if given is None:
        return tuple(f"ch_{i}" for i in range(n_channels))
    if len(given) != n_channels:
        raise ValueError(
            f"channel_names has {len(given)} names, must have {n_channels}; name every channel"
        )
    return tuple(given)


def _pulses(tacho: ArrayLike, fs: float, n_samples: int) -> Float:
    volts = np.asarray(tacho)
    if volts.shape != (n_samples,):
        raise ValueError(
            f"tacho has shape {volts.shape}, must be ({n_samples},) as the vibration; use one clock"
        )
    return order.pulse_times(volts, fs)


def _check_vibration(signals: Real, channels: tuple[str, ...]) -> None:
    if signals.ndim != 2 or signals.shape[-1] < FEWEST_SAMPLES:
        raise ValueError(
            f"vibration has shape {signals.shape}, must be (n_channels, n_samples >= "
            f"{FEWEST_SAMPLES}); give a longer record"
        )
    # One pass for the usual, faultless record: NaN and infinity survive max and min.
    highest, lowest = signals.max(axis=-1), signals.min(axis=-1)
    sound = (highest <= LARGEST_SAMPLE) & (lowest >= -LARGEST_SAMPLE)
    faults = [_fault(signals[i], channels[i]) for i in np.flatnonzero(~sound)]
    if faults:
        raise ValueError("; ".join(faults))


def _fault(signal: Real, channel: str) -> str:
    wrong = np.flatnonzero(~np.isfinite(signal))
    if wrong.size:
        return (
            f"{channel} has {wrong.size} non-finite samples, the first at {wrong[0]}, must have 0; "
            "cut or mend the recording"
        )
    large = np.flatnonzero(np.abs(signal) > LARGEST_SAMPLE)
    return (
        f"{channel} has {large.size} samples beyond {LARGEST_SAMPLE:g}, the first at {large[0]}, "
        "must have 0; check the scale of the recording"
    )
