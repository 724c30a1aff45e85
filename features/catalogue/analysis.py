"""Shared basis of the features of one recording: settings, and transforms computed once."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..response import frf, modal_model, transfer
from ..response.impact import WIDEST_LINES_HZ
from ..rotation import angle_resample as resample
from ..rotation import orbit, order
from ..rotation import pressure as cylinder
from ..signal import cepstrum, cyclic_coherence, envelope, iso, kurtogram, spectrum
from ..signal.fft import fast_length, irfft, rfft
from ..signal.statistics import Amplitude, Real
from ..signal.third_octave import third_octave_centres

Float = NDArray[np.float64]
Band = tuple[float, float]

ACCELERATION, DISPLACEMENT, FORCE = "acceleration", "displacement", "force"
PRESSURE = "pressure"
"""Quantities of channels that some features require: for severity, an orbit, a transfer function,
cylinder pressures."""

FAULTS = ("outer", "inner", "roller", "cage")
"""Parts of a rolling bearing whose fault lines are searched."""

FEWEST_OCTAVE_LINES = 4
"""Lines in the lowest third octave if the record is long enough [-]."""

FEWEST_BLOCKS = 8
"""Half-overlapping blocks per force for a transfer function [-]: its random error is then 13 % at a
coherence of 0.8."""

FEWEST_FRF_LINES = 8
"""Fewest lines of a transfer function for its features [-]."""

HIGHEST_ORDER = 20
"""Highest order of the stabilisation [-]: finds the same modes as the usual 30 in half the time."""

USUAL_WINDOW = 2048
"""Window of a transfer function, the usual one of analysers [samples]."""

MOST_LINES = 1024
"""Most lines of one modal fit [-]; with more, each peak is fitted separately: a fit of all takes
half a minute if blows are seconds apart."""

_THINNING_PAD = 32  # samples at the lower rate between the end and the start of the record


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the catalogue; only rows computed with equal settings are comparable.

    What cannot be inferred from a signal (the kind of machine, the geometry of a bearing) is None
    unless given, and the features that need it are then absent.

    Parameters
    ----------
    n_bands : int
        Bands of the long spectrum.
    band_low : float
        Lower edge of these bands [Hz].
    map_bands : int
        Bands of the crank-angle map.
    map_low : float
        Lower edge of the map's bands [Hz].
    high : float, optional
        Upper edge of spectrum and map [Hz]; see `band_edges`.
    angle_bins : int
        Bins in one revolution.
    orders : tuple of float
        Shaft orders [-].
    orbit_orders : tuple of float
        Orders of the filtered orbits [-].
    impact_threshold : float
        Smallest short-time energy of an impact, in medians [-].
    bands : tuple of tuple of float
        Additional bands, lower and upper edge [Hz].
    octave_low : float
        Lowest third octave [Hz].
    spacing_band_hz : tuple of float
        Range searched for the spacing of harmonics or sidebands [Hz].
    points_per_revolution : int
        Points of the synchronous average; it holds the orders below 0.4 of this number.
    envelope_band : tuple of float, optional
        Band of the envelope [Hz]; fs / 8 to 0.4 fs by default.
    machine : str, optional
        Kind of machine, a key of `iso.KINDS`; a rotating one needs `speed_hz` too.
    speed_hz : float, optional
        Nominal shaft speed [Hz]: for the zone, and for bearing lines without a tacho.
    speed_band_hz : tuple of float, optional
        Range searched for the speed without a tacho [Hz].
    bearing : BearingFrequencies, optional
        Fault frequencies in orders of the shaft.
    frf_spacing_hz : float
        Widest line spacing of a transfer function [Hz]; lines are closer if the record has
        `FEWEST_BLOCKS` windows of 2,048 samples for each force.
    exponential : float
        Value of the exponential window of an impact test at the end of a block [-]; 1 for none. See
        `impact.impact_spectra`.
    frf_bands : int
        Bands of a transfer function, from `band_low`.
    profile_bands : int
        Narrow bands of a transfer function, from `profile_low`.
    profile_low : float
        Lower edge of the narrow bands and of the search for modes [Hz].
    n_modes : int
        Number of modes reported, those that stand out most, and of antiresonances.
    reference : FrfReference, optional
        Reference for transfer functions.

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
    bands: tuple[Band, ...] = ()
    octave_low: float = 25.0
    spacing_band_hz: Band = (25.0, 200.0)
    points_per_revolution: int = 128
    envelope_band: Band | None = None
    machine: str | None = None
    speed_hz: float | None = None
    speed_band_hz: Band | None = None
    bearing: envelope.BearingFrequencies | None = None
    frf_spacing_hz: float = WIDEST_LINES_HZ
    exponential: float = 1.0
    frf_bands: int = 10
    profile_bands: int = 72
    profile_low: float = 5.0
    n_modes: int = 3
    reference: transfer.FrfReference | None = None

    def band_edges(self, fs: float) -> Float:
        """Edges of the bands of the long spectrum [Hz, shape=(n_bands + 1,)]."""
        return spectrum.band_edges(fs, n_bands=self.n_bands, low=self.band_low, high=self.high)

    def map_edges(self, fs: float) -> Float:
        """Edges of the bands of the crank-angle map [Hz, shape=(map_bands + 1,)]."""
        nperseg, _ = order.default_window(fs)
        return spectrum.line_band_edges(
            fs, nperseg, n_bands=self.map_bands, low=self.map_low, high=self.high
        )

    def octave_centres(self, fs: float) -> Float:
        """Third octaves up to the upper edge [Hz]; ValueError if there are none."""
        top = spectrum.upper_edge(fs, self.high) * 10**-0.05
        return third_octave_centres(self.octave_low, 1000 * 10 ** (_whole(10 * _decades(top)) / 10))

    def envelope_edges(self, fs: float) -> Band:
        """Band of the envelope [Hz]."""
        return (fs / 8, 0.4 * fs) if self.envelope_band is None else self.envelope_band

    def severity_band(self) -> Band:
        """Band of the severity [Hz]: that of the machine if its kind and speed are known."""
        if self.machine is None:
            return iso.ISO_BAND
        if self.speed_hz is None and not iso.machine_kind(self.machine).reciprocating:
            return iso.ISO_BAND
        return iso.iso_band(self.machine, self.speed_hz)

    def frf_nperseg(self, fs: float) -> int:
        """Smallest length of the windows of a transfer function [samples]: a power of two."""
        return 1 << max(3, math.ceil(math.log2(fs / self.frf_spacing_hz)))

    def profile_nperseg(self, fs: float) -> int:
        """Length of the windows if the record is long enough [samples]."""
        return max(self.frf_nperseg(fs), USUAL_WINDOW)

    def frf_edges(self, fs: float) -> Float:
        """Edges of the bands of a transfer function [Hz, shape=(frf_bands + 1,)]."""
        return spectrum.line_band_edges(
            fs, self.frf_nperseg(fs), n_bands=self.frf_bands, low=self.band_low, high=self.high
        )

    def profile_edges(self, fs: float) -> Float:
        """Edges of the narrow bands of a transfer function [Hz, shape=(profile_bands + 1,)]."""
        nperseg = self.profile_nperseg(fs)
        return spectrum.line_band_edges(
            fs, nperseg, n_bands=self.profile_bands, low=self.profile_low, high=self.high
        )

    def frf_band(self, fs: float) -> Band:
        """First and last frequency of a transfer function [Hz]."""
        line = fs / self.frf_nperseg(fs)
        low = min(self.profile_low, self.band_low) - line / 2
        return low, spectrum.upper_edge(fs, self.high) + line / 2


def least_samples(nperseg: int, n_forces: int) -> float:
    """Shortest record that has `FEWEST_BLOCKS` half-overlapping windows for each force [samples].

    Examples
    --------
    >>> least_samples(256, 1)
    1152.0
    """
    return (n_forces * FEWEST_BLOCKS + 1) / 2 * nperseg


def _decades(frequency: float) -> float:
    return math.log10(frequency / 1000)


def _whole(number: float) -> int:
    # An edge that is a third octave except for rounding counts as one.
    return math.floor(number + 1e-9)


STANDARD = Settings()
"""Default settings."""


class Analysis:
    """One recording with all transforms that its features share, each computed at most once.

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
        Rows of the two proximity probes of an orbit, see :mod:`wearstate.features.rotation.orbit`.
    quantities : tuple of str, optional
        Quantity of every channel; all ``acceleration`` by default.
    pressures : ndarray, shape (n_pressures, n_samples), optional
        Cylinder pressures [Pa], in addition to the vibration.
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
        quantities: tuple[str, ...] | None = None,
        pressures: Real | None = None,
        settings: Settings = STANDARD,
    ) -> None:
        self._pressures = pressures
        self.amplitude = Amplitude(vibration)
        self._readings = vibration
        self._probes = probes
        self._quantities = quantities or (ACCELERATION,) * len(vibration)
        self.fs = fs
        self.settings = settings
        self._pulses = pulses
        self.pulses_per_revolution = pulses_per_revolution

    @cached_property
    def vibration(self) -> Real:
        """Zero-mean signals [unit of x, shape=(n_channels, n_samples)]."""
        return self.amplitude.centred

    # --- spectra

    @cached_property
    def lines(self) -> Real:
        """Mean square per spectral line [(unit of x)^2, shape=(n_channels, n_lines)]."""
        return spectrum.power_lines(self.vibration, self.fs)

    @cached_property
    def n_averages(self) -> float:
        """Independent averages behind `lines` [-]."""
        n_samples = self.vibration.shape[-1]
        nperseg = 2 * (self.lines.shape[-1] - 1)
        segments = (n_samples - nperseg) // (nperseg // 2) + 1
        return frf.effective_averages(spectrum.hann(nperseg), nperseg // 2, segments)

    @cached_property
    def band_levels(self) -> Float:
        """Levels in the bands of the settings [dB re 1 x^2, shape=(n_channels, n_bands)]."""
        edges = self.settings.band_edges(self.fs)
        return spectrum.levels_from_lines(self.lines, self.fs, edges)

    @cached_property
    def octave_levels(self) -> Float:
        """Levels in third octaves [dB re 1 x^2, shape=(n_channels, n_octaves)]."""
        centres = self.settings.octave_centres(self.fs)
        edges = np.append(centres, centres[-1] * 10**0.1) * 10**-0.05
        wanted = FEWEST_OCTAVE_LINES * self.fs / float(edges[1] - edges[0])
        longest = spectrum.whole_segment(self.vibration)
        nperseg = min(2 * fast_length(math.ceil(wanted / 2)), longest)
        return spectrum.band_levels(self.vibration, self.fs, edges, nperseg=nperseg)

    @cached_property
    def tone(self) -> tuple[Float, Float]:
        """Strongest tone: frequency [Hz] and amplitude [unit of x], shape=(n_channels,) each."""
        return spectrum.strongest_tone(self.vibration, self.fs)

    @cached_property
    def spectral_kurtosis(self) -> tuple[Float, Real]:
        """Frequencies [Hz] and kurtosis of the lines [-, shape=(n_channels, n_lines)]."""
        return kurtogram.spectral_kurtosis(self.vibration, self.fs)

    @cached_property
    def harmonic_spacing(self) -> tuple[Float, Float]:
        """Spacing of harmonics [Hz] and height of its peak [-], shape=(n_channels,) each."""
        low, high = self.settings.spacing_band_hz
        return cepstrum.harmonic_spacing(self.vibration, self.fs, low=low, high=high)

    # --- severity

    @cached_property
    def housings(self) -> Real:
        """Accelerations among the channels, zero-mean [m/s^2, shape=(n_housings, n_samples)]."""
        rows = [i for i, quantity in enumerate(self._quantities) if quantity == ACCELERATION]
        return self.vibration if len(rows) == len(self.vibration) else self.vibration[rows]

    @cached_property
    def velocity(self) -> Real:
        """Severity of the housings [m/s rms, shape=(n_housings,)]."""
        return iso.velocity_rms(self.housings, self.fs, band=self.settings.severity_band())

    @cached_property
    def zone(self) -> NDArray[np.intp]:
        """Zones of the housings, 0 to 3, the worse of velocity and displacement [-]."""
        kind = str(self.settings.machine)
        displacement = None
        if iso.machine_kind(kind).displacement_um is not None:
            displacement = iso.band_rms(
                self.housings, self.fs, self.settings.severity_band(), integrations=2
            )
        return iso.zone(self.velocity, kind, displacement=displacement)

    # --- shaft

    @cached_property
    def pulses(self) -> Float:
        """Tacho pulse times [s, shape=(n_pulses,)]; ValueError without a tacho."""
        if self._pulses is None:
            raise ValueError("n_pulses = 0 must be >= 2: the feature needs a tacho; record one")
        return self._pulses

    @cached_property
    def speed_hz(self) -> float:
        """Mean shaft speed from the tacho, or else the nominal speed [Hz]."""
        if self._pulses is None:
            if self.settings.speed_hz is None:
                raise ValueError("speed_hz is missing: the feature needs a tacho or a speed")
            return self.settings.speed_hz
        revolutions = (self.pulses.size - 1) / self.pulses_per_revolution
        return float(revolutions / (self.pulses[-1] - self.pulses[0]))

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
    def order_vectors(self) -> NDArray[np.complex128]:
        """Complex amplitudes of the orders [unit of x, shape=(n_channels, n_orders)]."""
        vectors = order.order_amplitudes(self.vibration, self.phase, self.settings.orders)
        return vectors.astype(np.complex128)

    @cached_property
    def angle(self) -> resample.AngleSignal:
        """Signals over the shaft angle; fast ones are first decimated to the required rate."""
        points = self.settings.points_per_revolution
        factor = max(1, int(1 / (points * float(np.diff(self.phase).max()))))
        while fast_length(factor) != factor:
            factor -= 1
        signal = thinned(self.vibration, factor)
        return resample.angular_resample(signal, self.phase[::factor], points_per_revolution=points)

    @cached_property
    def synchronous(self) -> tuple[Amplitude, Amplitude]:
        """Statistics of the mean revolution, and of the signal without it."""
        mean = resample.synchronous_average(self.angle)
        rest = resample.angular_residual(self.angle, mean)
        whole = rest.signal[..., : rest.revolutions * rest.points_per_revolution]
        return Amplitude(mean), Amplitude(whole)

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

    # --- cylinder

    @cached_property
    def transitions(self) -> list[cylinder.Transitions]:
        """Levels and transitions of each cylinder pressure."""
        rows = () if self._pressures is None else self._pressures
        return [cylinder.transitions(cylinder.mean_revolution(row, self.phase)) for row in rows]

    # --- orbit

    @cached_property
    def path(self) -> orbit.Complex:
        """Orbit with its mean [unit of x, shape=(n_samples,)]; ValueError without two probes."""
        if self._probes is None:
            raise ValueError("n_probes = 0 must be 2; give quantities, two of them displacement")
        first, second = self._probes
        return orbit.displacement(self._readings[first], self._readings[second])

    @cached_property
    def filtered(self) -> tuple[orbit.Complex, orbit.Complex]:
        """Forward and backward vectors [unit of x, shape=(n_orbit_orders,) each]."""
        return orbit.filtered_orbits(self.path, self.phase, self.settings.orbit_orders)

    # --- envelope

    @cached_property
    def envelope_spectrum(self) -> tuple[Float, Real]:
        """Envelope spectrum [Hz and unit of x, shape=(n_channels, n_lines)].

        The squared envelope is not used: it carries the scatter of the impacts and shows a damaged
        race less clearly.
        """
        band = self.settings.envelope_edges(self.fs)
        return envelope.envelope_spectrum(self.vibration, self.fs, band, kind="plain")

    @cached_property
    def fault_lines(self) -> list[list[envelope.FaultLine | None]]:
        """Lines of each of `FAULTS` in `envelope_spectrum`, by channel."""
        frequency, amplitude = self.envelope_spectrum
        return [self._lines_of_faults(frequency, row) for row in amplitude]

    @cached_property
    def kurtograms(self) -> list[kurtogram.Kurtogram]:
        """Kurtogram of each channel."""
        known = self._pulses is not None or self.settings.speed_hz is not None
        span = envelope.envelope_span(self.speed_hz if known else None, self.settings.bearing)
        levels = kurtogram.kurtogram_levels(self.vibration.shape[-1], self.fs, span)
        return [kurtogram.kurtogram(row, self.fs, levels=levels) for row in self.vibration]

    @cached_property
    def kurtogram_fault_lines(self) -> list[list[envelope.FaultLine | None]]:
        """As `fault_lines`, in the band of largest kurtosis of each channel."""
        pairs = zip(self.vibration, self.kurtograms, strict=True)
        found = (envelope.envelope_spectrum(row, self.fs, k.band, kind="plain") for row, k in pairs)
        return [self._lines_of_faults(*lines) for lines in found]

    @cached_property
    def cyclic_coherences(self) -> Float:
        """Mean cyclic coherence at the `fault_lines` [-, shape=(n_channels, n_faults)]; else 0."""
        result = np.zeros((len(self.vibration), len(FAULTS)))
        for row, lines, means in zip(self.vibration, self.fault_lines, result, strict=True):
            places = {i: line.frequency for i, line in enumerate(lines) if line is not None}
            known = {i: f for i, f in places.items() if self._has_cycle(f)}
            if known:
                _, coherence = cyclic_coherence.cyclic_coherence(row, self.fs, list(known.values()))
                means[list(known)] = coherence.mean(axis=-1)
        return result

    def _has_cycle(self, frequency: float) -> bool:
        return bool(self.fs / self.vibration.shape[-1] <= frequency < self.fs / 2)

    def _lines_of_faults(self, place: Float, size: Real) -> list[envelope.FaultLine | None]:
        """Line of each fault; None if the spectrum is too short or too coarse to show it."""
        orders = self.settings.bearing
        if orders is None:
            raise ValueError("bearing is missing: the feature needs its geometry; give it")
        # A damaged roller strikes both races, hence twice per turn.
        places = (orders.outer, orders.inner, 2 * orders.roller, orders.cage)
        return [_line_or_none(place, size, self.speed_hz * k) for k in places]

    # --- transfer function

    @cached_property
    def responses(self) -> list[int]:
        """Channels other than the force."""
        return [i for i, quantity in enumerate(self._quantities) if quantity != FORCE]

    @cached_property
    def transfer_functions(self) -> transfer.Transfer:
        """Transfer functions of the paths, from each force to each response."""
        forces = [i for i, quantity in enumerate(self._quantities) if quantity == FORCE]
        if not forces or not self.responses:
            raise ValueError(
                f"n_forces = {len(forces)} and n_responses = {len(self.responses)} must be >= 1: "
                "the feature needs both; record them"
            )
        nperseg = self.settings.profile_nperseg(self.fs)
        if self.vibration.shape[-1] < least_samples(nperseg, len(forces)):
            nperseg = self.settings.frf_nperseg(self.fs)
        return transfer.measured_transfer(
            self.vibration[forces],
            self.vibration[self.responses],
            self.fs,
            nperseg=nperseg,
            last=self.settings.exponential,
            band=self.settings.frf_band(self.fs),
        )

    @cached_property
    def frf_profile(self) -> tuple[Float, NDArray[np.bool_]]:
        """Levels of the paths in narrow bands, and which of these are above noise."""
        return transfer.profile(self.transfer_functions, self.settings.profile_edges(self.fs))

    @cached_property
    def modal_paths(self) -> list[int]:
        """Paths used in a modal fit: moving ones to responses of the first one's quantity.

        Poles are shared, residues are not: functions of another quantity have other residues.
        """
        kinds = [self._quantities[i] for i in self.responses]
        found = self.transfer_functions
        moving = np.any(found.value != 0, axis=-1)
        return [
            i for i in np.flatnonzero(moving).tolist() if kinds[i // found.n_forces] == kinds[0]
        ]

    @cached_property
    def modal_quantity(self) -> modal_model.Quantity:
        """Quantity of the functions of `modal_paths`."""
        return MODAL_QUANTITIES.get(self._quantities[self.responses[0]], ACCELERANCE)

    @cached_property
    def modes(self) -> modal_model.Modes | None:
        """Modes of `modal_paths`; None if no pole is stable."""
        return self.modes_of(self.transfer_functions)

    def modes_of(self, found: transfer.Transfer) -> modal_model.Modes | None:
        """Modes of functions of the same paths, such as the mean of several tests."""
        return transfer.fit_transfer(
            found,
            self.modal_paths,
            quantity=self.modal_quantity,
            n_modes=self.settings.n_modes,
            highest_order=HIGHEST_ORDER,
            most_lines=MOST_LINES,
        )

    @cached_property
    def reference_modes(self) -> modal_model.Modes:
        """Modes of the reference; ValueError if it has none."""
        known = self.settings.reference
        if known is None or known.modes is None:
            raise ValueError("reference has no modes: the feature needs them; fit the reference")
        return known.modes


ACCELERANCE: Literal["accelerance"] = "accelerance"
MODAL_QUANTITIES: dict[str, modal_model.Quantity] = {
    ACCELERATION: ACCELERANCE,
    "velocity": "mobility",
    DISPLACEMENT: "receptance",
}
"""Quantity of the transfer function by quantity of the response."""


_FAULT_REACH = 3 * (1 + envelope.SLIP) + envelope.NEIGHBOURHOOD  # fault frequencies covered


def _line_or_none(place: Float, size: Real, fault_hz: float) -> envelope.FaultLine | None:
    reach = math.ceil(_FAULT_REACH * fault_hz / float(place[1])) + 8
    try:
        return envelope.fault_line(place[:reach], size[:reach], fault_hz)
    except ValueError:  # the spectrum is valid: only the frequency can be out of its range
        return None


# --- shared arithmetic


def thinned(x: Real, factor: int) -> NDArray[Any]:
    """Every n-th sample of a signal after low-pass filtering.

    Parameters
    ----------
    x : ndarray, shape (..., n_samples)
        Signal [any unit].
    factor : int
        Decimation factor n, >= 1.

    Returns
    -------
    ndarray, shape (..., ceil(n_samples / factor))
        Samples 0, factor, 2 factor … of the filtered signal [unit of x]; dtype kept.

    Notes
    -----
    One transform of the zero-padded record. The gain is 1 up to 0.4 of the lower rate and falls as
    a raised cosine to 0 at half of it. The ends of the record act as steps: about 16 samples at the
    lower rate are wrong by more than 1 % of the step.

    Examples
    --------
    >>> wave = np.cos(2 * np.pi * 0.02 * np.arange(1000))
    >>> found = thinned(wave, 4)
    >>> bool(abs(found - wave[::4])[32:-32].max() < 2e-3)
    True
    """
    if factor == 1:
        return x
    n_kept = -(-x.shape[-1] // factor)
    length = fast_length(n_kept + _THINNING_PAD)
    line = np.arange(length // 2 + 1) / length  # of the lower rate
    gain = np.cos(np.pi / 2 * np.clip((line - 0.4) / 0.1, 0, 1)) ** 2 / factor
    lines = rfft(x, length * factor)[..., : gain.size] * gain.astype(x.dtype)
    return irfft(lines, length)[..., :n_kept]
