"""The named catalogue of features, and the row it makes of one recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations, pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import orbit, order
from .spectrum import band_edges, decibel, levels_from_lines, line_band_edges, power_lines
from .statistics import Amplitude, Real

Float = NDArray[np.float64]

LARGEST_SAMPLE = 1e9
"""Largest believable sample [unit of x]: beyond it, squares leave the range of float32."""

DISPLACEMENT = "displacement"
"""Quantity of a proximity probe; two of them make an orbit."""

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
    orbit_orders : tuple of float
        Orders of the filtered orbits [-].
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
    orbit_orders: tuple[float, ...] = (0.5, 1.0, 2.0)
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
    probes : tuple of int, optional
        Rows of the two proximity probes of an orbit, see :mod:`wearstate.features.orbit`.
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
        probes: tuple[int, int] | None = None,
        settings: Settings = STANDARD,
    ) -> None:
        self.amplitude = Amplitude(vibration)
        self._readings = vibration
        self._probes = probes
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
    def path(self) -> orbit.Complex:
        """Orbit with its mean [unit of x, shape=(n_samples,)]; ValueError without two probes."""
        if self._probes is None:
            raise ValueError("n_probes must be 2: the feature needs displacement; give quantities")
        first, second = self._probes
        return orbit.displacement(self._readings[first], self._readings[second])

    @cached_property
    def filtered(self) -> tuple[orbit.Complex, orbit.Complex]:
        """Forward and backward vectors [unit of x, shape=(n_orbit_orders,) each]."""
        return orbit.filtered_orbits(self.path, self.phase, self.settings.orbit_orders)

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
    scope : {"channel", "pair", "shaft", "orbit"}
        Whether it exists once per channel, per pair of channels, per record, or per orbit.
    casing : bool
        Whether it tells something of the knocks of a casing only, and nothing of an orbit.
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
    scope: Literal["channel", "pair", "shaft", "orbit"] = "channel"
    casing: bool = False
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
    ratio, radius = orbit.whirl(analysis.path, analysis.fs, float(_speed(analysis)))
    return np.array([ratio, float(decibel(radius**2))])


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
        casing=True,
        labels=_map_labels,
        function=_map_levels,
        reference="order.crank_angle_map",
    ),
    Feature(
        name="angle_harmonics",
        unit="dB",
        needs="tacho",
        casing=True,
        labels=_HARMONICS,
        function=lambda a: order.angle_harmonics(a.profile),
        reference="order.angle_harmonics",
    ),
    Feature(
        name="dead_centre_levels",
        unit="dB",
        needs="tacho",
        casing=True,
        labels=_DEAD_CENTRES,
        function=lambda a: order.dead_centre_levels(a.profile),
        reference="order.dead_centre_levels",
    ),
    Feature(
        name="angle_kurtosis",
        unit="-",
        needs="tacho",
        casing=True,
        labels=_named("angle_kurtosis"),
        function=lambda a: order.angle_kurtosis(a.profile),
        reference="order.angle_kurtosis",
    ),
    Feature(
        name="impacts_per_revolution",
        unit="1/rev",
        needs="tacho",
        casing=True,
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


ORBIT_CATALOGUE: tuple[Feature, ...] = (
    Feature(
        name="centreline",
        unit="x, rad, -",
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
        scope="orbit",
        labels=_named("largest_excursion_db"),
        function=lambda a: decibel(orbit.largest_excursion(a.path) ** 2),
        reference="orbit.largest_excursion; ISO 20816-1:2016",
    ),
    Feature(
        name="filtered_orbits",
        unit="dB re 1 x^2",
        needs="tacho",
        scope="orbit",
        labels=_orbit_labels("major_db", "minor_db", "forward_db", "backward_db"),
        function=_orbit_sizes,
        reference="orbit.filtered_orbits, orbit.semi_axes",
    ),
    Feature(
        name="orbit_shapes",
        unit="-",
        needs="tacho",
        scope="orbit",
        labels=_orbit_labels("ellipticity", "precession", "inclination_cos", "inclination_sin"),
        function=_orbit_shapes,
        reference="orbit.ellipticity, orbit.precession, orbit.inclination",
    ),
    Feature(
        name="keyphasor_mark",
        unit="-",
        needs="tacho",
        scope="orbit",
        labels=_named("mark_cos", "mark_sin"),
        function=_mark,
        reference="orbit.orbit_path",
    ),
    Feature(
        name="whirl",
        unit="-, dB re 1 x^2",
        needs="tacho",
        scope="orbit",
        labels=_named("whirl_ratio", "whirl_db"),
        function=_whirl,
        reference="orbit.whirl; Grandke, IEEE Trans. Instrum. Meas. 32 (1983) 350-355",
    ),
)
"""Features of a pair of proximity probes at right angles, after those of `CATALOGUE`."""


def catalogue(*, tacho: bool, orbit: bool = False, casing: bool = True) -> tuple[Feature, ...]:
    """Features that a recording can have.

    Parameters
    ----------
    tacho : bool
        Whether it has a tacho.
    orbit : bool
        Whether it has two proximity probes.
    casing : bool
        Whether it has any other channel, whose knocks are worth a map over the shaft angle.

    Returns
    -------
    tuple of Feature
        The rows of `CATALOGUE`, then of `ORBIT_CATALOGUE`, whose needs are met, in order.

    Examples
    --------
    >>> len(catalogue(tacho=False)) < len(catalogue(tacho=True)) == len(CATALOGUE)
    True
    >>> [feature.name for feature in catalogue(tacho=False, orbit=True)][-1]
    'largest_excursion'
    """
    rows = (*CATALOGUE, *ORBIT_CATALOGUE) if orbit else CATALOGUE
    return tuple(
        row for row in rows if (tacho or row.needs != "tacho") and (casing or not row.casing)
    )


def probe_rows(quantities: Sequence[str]) -> tuple[int, int] | None:
    """Channels of the two proximity probes of an orbit; None unless there are exactly two.

    Parameters
    ----------
    quantities : sequence of str
        Of every vibration channel.

    Examples
    --------
    >>> probe_rows(["acceleration", "displacement", "displacement"])
    (1, 2)
    """
    rows = [i for i, quantity in enumerate(quantities) if quantity == DISPLACEMENT]
    return (rows[0], rows[1]) if len(rows) == 2 else None


def feature_names(
    channel_names: Sequence[str],
    fs: float,
    *,
    tacho: bool = True,
    quantities: Sequence[str] | None = None,
    settings: Settings = STANDARD,
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
    quantities : sequence of str, optional
        Quantity of every channel; all ``acceleration`` by default.
    settings : Settings
        Bands, bins and orders.

    Returns
    -------
    tuple of str
        ``channel.label``, ``first_over_second.label``, ``shaft.label`` and ``orbit.label``.

    Raises
    ------
    ValueError
        If a channel name is empty or repeated, the numbers of names and quantities differ, or a
        band does not fit below fs / 2.

    Examples
    --------
    >>> names = feature_names(["acc_x"], 25_600.0)
    >>> names[0], names[8], names[18 + 20]
    ('acc_x.rms', 'acc_x.band_50_66.level_db', 'acc_x.angle_000_010.band_150_250.level_db')
    """
    kinds = _quantities(quantities, len(channel_names))
    return _feature_names(tuple(channel_names), float(fs), tacho, kinds, settings)


def _quantities(given: Sequence[str] | None, n_channels: int) -> tuple[str, ...]:
    if given is None:
        return ("acceleration",) * n_channels
    if len(given) != n_channels:
        raise ValueError(
            f"quantities has {len(given)} entries, must have {n_channels}; give one of each channel"
        )
    return tuple(given)


def _rows_for(
    quantities: tuple[str, ...], tacho: bool, fs: float, settings: Settings
) -> tuple[Feature, ...]:
    """Catalogue rows of a recording with these channels."""
    probes = probe_rows(quantities)
    return catalogue(
        tacho=tacho,
        orbit=probes is not None,
        casing=any(quantity != DISPLACEMENT for quantity in quantities)
        and (probes is None or _map_fits(fs, settings)),
    )


def _map_fits(fs: float, settings: Settings) -> bool:
    """Whether the map over the shaft angle has its bands below fs / 2.

    A shaft line is sampled slowly, for its orders; it has no knocks that are worth a map.
    """
    try:
        settings.map_edges(fs)
    except ValueError:
        return False
    return True


@lru_cache(maxsize=64)
def _feature_names(
    channels: tuple[str, ...],
    fs: float,
    tacho: bool,
    quantities: tuple[str, ...],
    settings: Settings,
) -> tuple[str, ...]:
    if not channels or not all(channels) or len(set(channels)) < len(channels):
        raise ValueError(f"channel_names = {list(channels)} must be non-empty and unique; rename")
    owners = {
        "channel": channels,
        "pair": tuple(f"{a}_over_{b}" for a, b in combinations(channels, 2)),
        "shaft": ("shaft",),
        "orbit": ("orbit",),
    }
    names = tuple(
        f"{owner}.{label}"
        for feature in _rows_for(quantities, tacho, fs, settings)
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
    quantities: Sequence[str] | None = None,
    settings: Settings = STANDARD,
) -> tuple[tuple[str, ...], Float]:
    """All features of one recording.

    Parameters
    ----------
    vibration : array_like, shape (n_channels, n_samples) or (n_samples,)
        Accelerations [m/s^2, or one other unit for all channels], displacements with their mean
        [m]. float32 stays float32 in the transforms.
    fs : float
        Sample rate [Hz].
    tacho : array_like, shape (n_samples,), optional
        Pulses [V], whose rising edge is angle 0; without it the features that need it are absent.
    pulses_per_revolution : int
        Pulses in one revolution. Above 1, angle 0 is any one of them, and the crank angle of two
        records no longer compares.
    channel_names : sequence of str, optional
        Names of the channels; ``ch_0``, ``ch_1``, … by default.
    quantities : sequence of str, optional
        Quantity of every channel; all ``acceleration`` by default. With exactly two of
        ``displacement`` the features of their orbit are added.
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
    kinds = _quantities(quantities, len(signals))
    names = feature_names(
        channels, fs, tacho=tacho is not None, quantities=kinds, settings=settings
    )
    analysis = Analysis(
        signals,
        fs,
        pulses=pulses,
        pulses_per_revolution=pulses_per_revolution,
        probes=probe_rows(kinds),
        settings=settings,
    )
    rows = _rows_for(kinds, tacho is not None, fs, settings)
    parts = [np.ravel(feature.function(analysis)) for feature in rows]
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
