"""Effect of accelerometer, tacho and converter on a signal."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

_FORGOTTEN = math.log(1e8)
"""Time constants after which a transient has decayed to 1e-8, below a 24-bit converter's step."""


RATE_LEAST, RATE_MOST = 1e-3, 1e8
"""Plausible sample rates of a recording [Hz]: a level every quarter of an hour, acoustic emission.
Outside, a unit or an exponent is wrong."""

SIMULATED_RATE_LEAST, SIMULATED_RATE_MOST = 1.0, 1e6
"""Sample rates of a simulated recording [Hz]."""


def rate_fault(name: str, rate: float, cure: str) -> str:
    """Fault of a sample rate; empty if there is none.

    Parameters
    ----------
    name : str
        Name of the rate in the message.
    rate : float
        Sampling rate [Hz].
    cure : str
        Cure in the message.

    Examples
    --------
    >>> rate_fault("fs", 8e98, "give it in Hz")
    'fs = 8e+98 Hz must be >= 0.001 Hz and <= 1e+08 Hz; give it in Hz'
    """
    if RATE_LEAST <= rate <= RATE_MOST:
        return ""
    return f"{name} = {rate} Hz must be >= {RATE_LEAST:g} Hz and <= {RATE_MOST:g} Hz; {cure}"


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One row of a signal: name, quantity, unit, place.

    Attributes
    ----------
    name, unit, quantity : str
        The unit of the numbers; the quantity is ``acceleration``, ``tacho``, ….
    place, direction : str
        For the report.
    unit_in_file : str
        Unit that a measured file declared before conversion; empty for a simulated channel.
    """

    name: str
    unit: str
    quantity: str
    place: str = ""
    direction: str = ""
    unit_in_file: str = ""

    @property
    def label(self) -> str:
        """Name and unit for display: ``acc [m/s^2]``, or ``gs [m/s^2, g in the file]``."""
        converted = self.unit_in_file not in ("", self.unit)
        return f"{self.name} [{self.unit}{f', {self.unit_in_file} in the file' * converted}]"


def mounting_poles(resonance: float, damping_ratio: float) -> NDArray[np.complex128]:
    """Poles of an accelerometer on its mount, an oscillator driven at its foot.

    Parameters
    ----------
    resonance : float
        Undamped natural frequency of the mounted sensor [Hz].
    damping_ratio : float
        0 < zeta < 1.

    Returns
    -------
    numpy.ndarray [shape=(2,)]
        Poles [rad/s].

    Notes
    -----
    The sensor's reading over the motion of the housing is ``1 / (1 - r^2 + 2 j zeta r)`` with r the
    frequency over the resonance: one below it, ``1 / (2 zeta)`` at it [1]_.

    References
    ----------
    .. [1] ISO 5348:2021, Mechanical mounting of accelerometers.

    Examples
    --------
    >>> poles = mounting_poles(25e3, 0.05)
    >>> round(float(abs(low_pass_response(np.array([25e3]), poles))[0]), 9)
    10.0
    """
    omega = 2 * math.pi * resonance
    pole = omega * complex(-damping_ratio, math.sqrt(1 - damping_ratio**2))
    return np.array([pole, pole.conjugate()])


def anti_alias_poles(
    kind: Literal["butterworth", "bessel"], cutoff: float, order: int
) -> NDArray[np.complex128]:
    """Poles of the analogue low-pass before the converter.

    Parameters
    ----------
    kind : str
        ``butterworth`` (flattest level) or ``bessel`` (flattest delay).
    cutoff : float
        Frequency of 3 dB loss, ``1 / sqrt(2)`` [Hz].
    order : int
        1 to 10; the level falls by ``6 order`` dB an octave far above the cut-off.

    Returns
    -------
    numpy.ndarray [shape=(order,)]
        Poles [rad/s].

    Examples
    --------
    >>> level = abs(low_pass_response(np.array([0.0, 1e3]), anti_alias_poles("bessel", 1e3, 4)))
    >>> np.round(level, 6).tolist()
    [1.0, 0.707107]
    """
    from scipy import signal  # this module is imported wherever a channel is named

    omega = 2 * math.pi * cutoff
    if kind == "bessel":
        _, poles, _ = signal.bessel(order, omega, analog=True, output="zpk", norm="mag")
    else:
        _, poles, _ = signal.butter(order, omega, analog=True, output="zpk")
    return np.asarray(poles, dtype=np.complex128)


def low_pass_response(
    frequency: NDArray[np.float64], poles: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Frequency response of poles without zeros, with unit gain at zero frequency.

    Parameters
    ----------
    frequency : numpy.ndarray
        Frequencies [Hz].
    poles : numpy.ndarray [shape=(n_poles,)]
        Poles [rad/s], real parts negative, closed under conjugation.

    Returns
    -------
    numpy.ndarray [shape=frequency.shape]
        Complex, ``exp(+j w t)``: a delay has a falling phase.

    Examples
    --------
    >>> complex(low_pass_response(np.array([1.0]), np.array([-2 * np.pi + 0j]))[0])
    (0.5-0.5j)
    """
    result = np.ones(frequency.shape, dtype=np.complex128)
    for pole in poles:
        result /= 1 - 2j * math.pi * frequency / pole
    return result


def low_pass(
    x: NDArray[np.float64], fs: float, poles: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Pass a band-limited signal through analogue poles, by their exact frequency response.

    Parameters
    ----------
    x : numpy.ndarray [shape=(..., n_samples)]
        Band-limited below ``fs / 2``; assumed constant at its first value before the start.
    fs : float
        Sample rate [Hz].
    poles : numpy.ndarray [shape=(n_poles,)]
        Poles [rad/s], see :func:`mounting_poles` and :func:`anti_alias_poles`; they may lie above
        ``fs / 2``.

    Returns
    -------
    numpy.ndarray [shape=(..., n_samples)]
        At the same times. The end does not wrap round to the beginning: the transform is longer by
        the time in which the slowest pole decays to 1e-8.

    Notes
    -----
    No bilinear transform warps the response near ``fs / 2``; the phase is that of the analogue
    chain. Within some ten samples of either end the band edge shows.

    Examples
    --------
    >>> poles = anti_alias_poles("butterworth", 10e3, 4)
    >>> bool(np.allclose(low_pass(np.full(100, 3.0), 25.6e3, poles), 3.0))
    True
    """
    from scipy import fft

    slowest = -float(np.max(poles.real))
    pad = math.ceil(_FORGOTTEN / slowest * fs)
    first = x[..., :1]
    spectrum, length = padded_spectrum(x - first, pad)
    spectrum *= low_pass_response(fft.rfftfreq(length, 1 / fs), poles)
    back = fft.irfft(spectrum, length, axis=-1)[..., : x.shape[-1]]
    return np.asarray(first + back)


def padded_spectrum(x: NDArray[np.float64], pad: int) -> tuple[NDArray[np.complex128], int]:
    """Spectrum of a record that begins at zero, with room for the decay of a response.

    Parameters
    ----------
    x : numpy.ndarray [shape=(..., n_samples)]
        First value zero.
    pad : int
        Length of the longest response to be applied, in samples.

    Returns
    -------
    spectrum : numpy.ndarray [shape=(..., length // 2 + 1)]
        One-sided spectrum.
    length : int
        Samples of the transform, >= ``n_samples + 2 pad``. The last value is faded to zero by half
        a cosine over the first `pad` of them, so that no step excites the response.

    Examples
    --------
    >>> padded_spectrum(np.zeros(100), 10)[1] >= 120
    True
    """
    from scipy import fft

    n = x.shape[-1]
    length = fft.next_fast_len(n + 2 * pad, real=True)
    whole = np.zeros((*x.shape[:-1], length))
    whole[..., :n] = x
    fall = 0.5 * (1 + np.cos(np.pi * np.arange(1, pad + 1) / (pad + 1)))
    whole[..., n : n + pad] = x[..., -1:] * fall
    return fft.rfft(whole, axis=-1), length


def coloured_noise(
    n: int, fs: float, *, rms: float, slope: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Gaussian noise whose power density falls as ``1 / f**slope``.

    Parameters
    ----------
    n : int
        Number of samples.
    fs : float
        Sample rate [Hz].
    rms : float
        rms of the whole band, from one cycle in the record to half the sample rate.
    slope : float
        0 white, 1 pink (flicker noise of amplifiers), 2 red.
    rng : numpy.random.Generator

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Noise in the unit of `rms`; zeros for `rms` 0.

    Examples
    --------
    >>> x = coloured_noise(2**16, 1e3, rms=2.0, slope=1.0, rng=np.random.default_rng(0))
    >>> power = np.abs(np.fft.rfft(x)) ** 2
    >>> octaves = [power[2**k : 2**(k + 1)].sum() for k in (12, 13, 14)]  # equal of pink noise
    >>> bool(np.ptp(octaves) < 0.1 * max(octaves)), round(float(x.std()), 1)
    (True, 2.0)
    """
    white = rng.standard_normal((1, n)) if rms else np.zeros((1, n))
    return np.asarray(_coloured(white, fs, [rms], [slope])[0])


def _coloured(
    white: NDArray[np.float64], fs: float, rms: Sequence[float], slopes: Sequence[float]
) -> NDArray[np.float64]:
    """Rows of white noise, rms 1, with each its rms and slope; transformed together."""
    n = white.shape[1]
    sloped = [k for k, slope in enumerate(slopes) if slope and rms[k]]
    if sloped:
        spectra = np.fft.rfft(white[sloped])
        frequency = np.fft.rfftfreq(n, 1 / fs)[1:]
        for spectrum, k in zip(spectra, sloped, strict=True):
            weight = frequency ** (-slopes[k] / 2)
            weight *= rms[k] / math.sqrt(float(np.mean(weight**2)))
            spectrum[0] = 0.0
            spectrum[1:] *= weight
        white[sloped] = np.fft.irfft(spectra, n)
    for k, row in enumerate(white):
        if k not in sloped:
            row *= rms[k]
    return white


HUM = ((1, 1.0), (2, 0.3), (3, 0.5), (5, 0.25))
"""Harmonics of mains hum and their amplitudes over the first: a ground loop next to a rectifier
(estimate)."""


def mains_hum(
    n: int, fs: float, *, rms: float, frequency: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Hum of a mains supply, with a random phase of each harmonic of :data:`HUM`.

    Parameters
    ----------
    n : int
        Number of samples.
    fs : float
        Sample rate [Hz].
    rms : float
        rms of all harmonics together; those above half the sample rate are omitted.
    frequency : float
        Mains frequency [Hz].
    rng : numpy.random.Generator
        Source of the phases.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Hum in the unit of `rms`.

    Examples
    --------
    >>> hum = mains_hum(1000, 1e3, rms=1.0, frequency=50.0, rng=np.random.default_rng(0))
    >>> round(float(hum.std()), 9), int(np.abs(np.fft.rfft(hum)).argmax())
    (1.0, 50)
    """
    phases = math.tau * rng.random(len(HUM))
    scale = rms * math.sqrt(2 / sum(share**2 for _, share in HUM))
    kept = [
        (order, scale * share, phase)
        for (order, share), phase in zip(HUM, phases, strict=True)
        if order * frequency < fs / 2
    ]
    orders, sizes, begins = np.array(kept).reshape(-1, 3).T
    # sin(a + b) with the angle a at the start of each block and b within it: few sines, one product
    starts = np.arange(0, n, _HUM_BLOCK)[:, None]
    turn = math.tau * frequency / fs * orders
    early = turn * starts + begins
    late = turn[:, None] * np.arange(_HUM_BLOCK)
    sums = np.hstack([sizes * np.sin(early), sizes * np.cos(early)])
    return np.asarray((sums @ np.vstack([np.cos(late), np.sin(late)])).ravel()[:n])


_HUM_BLOCK = 512  # samples


class NoisySensor(Protocol):
    """Noise data of a sensor in a scene, in the sensor's unit."""

    @property
    def noise(self) -> float:
        """Rms of the sensor's own noise."""
        ...

    @property
    def mains(self) -> float:
        """Rms of mains hum with harmonics."""
        ...

    @property
    def mains_frequency(self) -> float:
        """Mains frequency [Hz]."""
        ...


def floor_of(
    sensor: NoisySensor, n: int, fs: float, *, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Reading of a sensor on a machine at rest: its own white noise and mains hum.

    Parameters
    ----------
    sensor : NoisySensor
    n : int
        Number of samples.
    fs : float
        Sample rate [Hz].
    rng : numpy.random.Generator

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Noise in the sensor's unit.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> probe = SimpleNamespace(noise=3.0, mains=4.0, mains_frequency=50.0)
    >>> round(float(floor_of(probe, 4000, 1e3, rng=np.random.default_rng(0)).std()), 1)
    5.0
    """
    return np.asarray(floors_of([sensor], n, fs, slopes=[0.0], rng=rng)[0])


def floors_of(
    sensors: Sequence[NoisySensor],
    n: int,
    fs: float,
    *,
    slopes: Sequence[float],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Like :func:`floor_of`, for several sensors in order, with coloured noise.

    Parameters
    ----------
    sensors : sequence of NoisySensor
    n : int
        Number of samples.
    fs : float
        Sample rate [Hz].
    slopes : sequence of float
        The power density of each one's noise falls as ``1 / f**slope``.
    rng : numpy.random.Generator

    Returns
    -------
    numpy.ndarray [shape=(n_sensors, n)]
        Noise in the unit of each sensor; the same bytes as one after the other.
    """
    floors, hums = np.zeros((len(sensors), n)), {}
    for k, sensor in enumerate(sensors):
        if sensor.noise:
            rng.standard_normal(out=floors[k])
        if sensor.mains > 0:
            hums[k] = mains_hum(n, fs, rms=sensor.mains, frequency=sensor.mains_frequency, rng=rng)
    floors = _coloured(floors, fs, [sensor.noise for sensor in sensors], slopes)
    for k, hum in hums.items():
        floors[k] += hum
    return floors


def digitise(
    acceleration: NDArray[np.float64],
    *,
    gain: float,
    noise: float | NDArray[np.float64],
    full_scale: float,
    bits: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], int]:
    """Pass an acceleration through an accelerometer and its converter.

    Parameters
    ----------
    acceleration : numpy.ndarray [shape=(n_samples,)]
        True acceleration of the housing [m/s^2], already band-limited.
    gain : float
        True sensitivity over the nominal one.
    noise : float or numpy.ndarray [shape=(n_samples,)]
        rms of white Gaussian noise, or the noise itself [m/s^2], added before the converter.
    full_scale : float
        The converter saturates at plus and minus this [m/s^2].
    bits : int
        Word length; the step is ``2 * full_scale / 2**bits``.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    signal : numpy.ndarray [shape=(n_samples,)]
        float32 [m/s^2].
    clipped : int
        Number of saturated samples; a caller must not lose it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> digitise(np.array([0.0, 30.0]), gain=1.0, noise=0.0, full_scale=20.0, bits=16, rng=rng)
    (array([ 0., 20.], dtype=float32), 1)
    """
    signal = gain * acceleration  # changed in place from here on, for speed
    if isinstance(noise, np.ndarray):
        signal += noise
    elif noise > 0:
        signal += noise * rng.standard_normal(signal.shape)
    step = 2 * full_scale / 2**bits
    clipped = int(np.count_nonzero(signal > full_scale) + np.count_nonzero(signal < -full_scale))
    np.clip(signal, -full_scale, full_scale, out=signal)
    signal /= step
    np.rint(signal, out=signal)
    signal *= step
    return signal.astype(np.float32), clipped


def tacho_pulses(
    revolutions: NDArray[np.float64], *, pulse_width: float, level: float
) -> NDArray[np.float32]:
    """Rectangular tacho pulses, rising at every whole revolution.

    Each sample holds the mean over the interval around it, half-way to either neighbour, so that
    an edge can be interpolated exactly to a fraction of a sample.

    Parameters
    ----------
    revolutions : numpy.ndarray [shape=(n_samples,)]
        Shaft angle in revolutions at each sample, rising.
    pulse_width : float
        Width of a pulse [rev].
    level : float
        Height of a pulse [V].

    Returns
    -------
    numpy.ndarray [shape=(n_samples,)]
        float32 [V].

    Examples
    --------
    >>> tacho_pulses(np.array([-0.2, 0.0, 0.2]), pulse_width=0.5, level=4.0)
    array([0., 2., 4.], dtype=float32)
    """
    # integral of the pulse train over angle: complete pulses, and the part of the present one
    border = np.empty(len(revolutions) + 1)
    inner = np.add(revolutions[1:], revolutions[:-1], out=border[1:-1])
    inner /= 2
    border[[0, -1]] = 2 * revolutions[[0, -1]] - inner[[0, -1]]
    area = np.floor(border)
    part = border - area
    area *= pulse_width
    area += np.minimum(part, pulse_width, out=part)
    pulses = np.diff(area)
    pulses *= level
    pulses /= np.diff(border)
    return pulses.astype(np.float32)
