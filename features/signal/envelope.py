"""Envelope of a signal, its spectrum, and the lines of rolling bearings in it.

A local defect causes one impact per passage and rings a resonance. The band round that resonance,
shifted down to zero frequency, is slow enough to read the impact rate from; the kurtogram
(:mod:`.signal.kurtogram`) finds the band.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length, ifft, rfft
from .rate import rate_fault
from .spectrum import hann
from .statistics import Real, centred

Float = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Band = tuple[float, float]
Kind = Literal["squared", "plain", "log"]

FEWEST_LINES = 8
"""Fewest spectral lines that a band needs for an envelope spectrum [-]."""

LOG_FLOOR = 1e-3
"""Floor of the squared envelope under the logarithm, in medians [-]: 0.07 % of the samples of a
stationary band lie below it."""

SLIP = 0.02
"""Relative deviation of a bearing's lines from the frequencies of its geometry [-]: rollers slide 1
to 2 %."""

NEIGHBOURHOOD = 0.3
"""Half width of the surroundings a fault line is compared with, in fault frequencies [-]."""

LARGEST_SPREAD = 0.15
"""Largest slip times harmonics [-]: leaves half the surroundings for comparison."""

SHOWN_ORDERS = 20.5
"""Orders of the shaft shown in an envelope spectrum if no bearing is known [-]."""

SHOWN_HARMONICS = 3.5
"""Harmonics of the inner race shown if the bearing is known [-]."""

SHOWN_HZ = 500.0
"""Width of the envelope spectrum shown if the speed is unknown [Hz]."""

_FEWEST_NEIGHBOURS = 8  # lines; the median of fewer is not a reliable background


def checked_signal(x: ArrayLike, fs: float, *, least: int = 2 * FEWEST_LINES) -> Real:
    """Signal minus its mean, after a check of its samples, length and rate.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    least : int
        Fewest samples.

    Returns
    -------
    ndarray, shape (..., n_samples)
        Signal minus its mean [unit of x], float32 or float64.

    Raises
    ------
    ValueError
        If a sample is not finite, there are too few samples, or `fs` is not plausible.

    Examples
    --------
    >>> checked_signal([0.0, 2.0], 1.0, least=2).tolist()
    [-1.0, 1.0]
    """
    signal = np.asarray(x)
    faults = []
    if fault := rate_fault(fs):
        faults.append(fault)
    n_samples = signal.shape[-1] if signal.ndim else 0
    if n_samples < least:
        faults.append(f"n_samples = {n_samples} must be >= {least}; record longer")
    wrong = signal.size - np.count_nonzero(np.isfinite(signal))
    if wrong:
        faults.append(f"x has {wrong} non-finite samples, must have 0; cut or repair the recording")
    if faults:
        raise ValueError("; ".join(faults))
    return centred(signal)


# --- the envelope


def baseband(x: ArrayLike, fs: float, band: Band | None = None) -> tuple[Complex, float]:
    """Analytic signal of a band, shifted to zero frequency and decimated to suit the bandwidth.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    band : tuple of float, optional
        Lower and upper edge [Hz]; everything between 0 and fs / 2 by default.

    Returns
    -------
    signal : ndarray, shape (..., n)
        Complex [unit of x]: ``x = A cos(2 pi f t + angle)`` in the band has the absolute value A.
        complex64 for float32, else complex128.
    rate : float
        Its sample rate [Hz], at least twice the width of the band, so that its square is not
        aliased either.

    Raises
    ------
    ValueError
        As for `checked_signal`, or if the band leaves 0 … fs / 2, has no width, or holds fewer than
        8 lines of ``fs / n_samples``.

    Notes
    -----
    The lines of one Fourier transform inside the band (both edges included), transformed back. The
    edges are sharp: an impact rings for about 2 / bandwidth. The record is treated as periodic: a
    step between its ends appears there as an impact, which a window on the envelope removes.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> signal, rate = baseband(3 * np.cos(2 * np.pi * 110 * t), 1000.0, (100.0, 131.0))
    >>> abs(signal).round(6).max(), rate
    (np.float64(3.0), 64.0)
    """
    signal = checked_signal(x, fs)
    n_samples = signal.shape[-1]
    first, past = _band_lines(n_samples, fs, (0.0, fs / 2) if band is None else band)
    n = fast_length(2 * (past - first))
    lines = np.zeros((*signal.shape[:-1], n), dtype=np.result_type(signal.dtype, np.complex64))
    lines[..., : past - first] = rfft(signal)[..., first:past]
    lines *= 2 * n / n_samples  # negative frequencies, and the shorter inverse transform
    return np.asarray(ifft(lines)), fs * n / n_samples


def _band_lines(n_samples: int, fs: float, band: Band) -> tuple[int, int]:
    """First line of a band and one past its last line; lines 0 and fs / 2 are left out."""
    low, high = band
    if not 0 <= low < high <= fs / 2:
        raise ValueError(
            f"band = {low:.6g} … {high:.6g} Hz must rise and lie in 0 … fs / 2 = {fs / 2:.6g} Hz; "
            "move its edges"
        )
    # An edge within a rounding error of a line counts as that line.
    first = max(1, math.ceil(low * n_samples / fs - 1e-9))
    past = min((n_samples - 1) // 2, math.floor(high * n_samples / fs + 1e-9)) + 1
    if past - first < FEWEST_LINES:
        raise ValueError(
            f"band = {low:.6g} … {high:.6g} Hz holds {max(past - first, 0)} lines of "
            f"{fs / n_samples:.6g} Hz, must hold >= {FEWEST_LINES}; widen it or record longer"
        )
    return first, past


def envelope(x: ArrayLike, fs: float, band: Band | None = None) -> tuple[Real, float]:
    """Envelope of a band.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    band : tuple of float, optional
        Lower and upper edge [Hz]; 0 to fs / 2 by default.

    Returns
    -------
    envelope : ndarray, shape (..., n)
        Amplitude of the band [unit of x]; precision of `x` kept.
    rate : float
        Its sample rate [Hz]; see `baseband`.

    Raises
    ------
    ValueError
        As for `baseband`.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> beat = (1 + 0.5 * np.cos(2 * np.pi * 5 * t)) * np.cos(2 * np.pi * 200 * t)
    >>> found, rate = envelope(beat, 1000.0, (150.0, 250.0))
    >>> found.round(6).max(), found.round(6).min()
    (np.float64(1.5), np.float64(0.5))
    """
    signal, rate = baseband(x, fs, band)
    return np.asarray(np.abs(signal)), rate


def envelope_spectrum(
    x: ArrayLike, fs: float, band: Band | None = None, *, kind: Kind = "squared"
) -> tuple[Float, Real]:
    """Amplitude spectrum of the envelope of a band.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    band : tuple of float, optional
        Lower and upper edge [Hz], as from `Kurtogram.band`; 0 to fs / 2 by default.
    kind : {"squared", "plain", "log"}
        Quantity transformed: the squared envelope, the envelope, or the natural logarithm of the
        squared envelope. The logarithm prevents one large impact, whatever its cause, from masking
        the periodic ones; the plain envelope lies between the two.

    Returns
    -------
    frequency : ndarray, shape (n_lines,)
        From 0 up to the width of the band [Hz], ``fs / n_samples`` apart.
    amplitude : ndarray, shape (..., n_lines)
        Peak amplitude [(unit of x)^2, unit of x, or -]; the mean is removed. A modulated tone
        ``A (1 + m cos wt) cos vt`` has ``2 m A^2`` at w and ``m^2 A^2 / 2`` at 2 w in the squared
        spectrum, ``m A`` at w in the plain one.

    Raises
    ------
    ValueError
        As for `baseband`, or if `kind` is none of the three.

    Notes
    -----
    Hann window divided by its mean: exact at a line, up to 15 % (1.4 dB) low between two. Only the
    squared envelope is free of aliasing; the other two have harmonics beyond the width of the
    band, which fold back. The logarithm is cut off at a thousandth of the median.

    References
    ----------
    R. B. Randall, J. Antoni, "Rolling element bearing diagnostics: a tutorial", Mech. Syst. Signal
    Process. 25 (2011) 485-520, doi:10.1016/j.ymssp.2010.07.017. Logarithm: P. Borghesani,
    M. R. Shahriar, "Cyclostationary analysis with logarithmic variance stabilisation", Mech. Syst.
    Signal Process. 70-71 (2016) 51-72.

    Examples
    --------
    >>> t = np.arange(2000) / 2000
    >>> beat = 3 * (1 + 0.5 * np.cos(2 * np.pi * 7 * t)) * np.cos(2 * np.pi * 400 * t)
    >>> frequency, amplitude = envelope_spectrum(beat, 2000.0, (350.0, 450.0))
    >>> [round(float(amplitude[frequency == f][0]), 6) for f in (7, 14)]
    [9.0, 1.125]
    """
    if kind not in _KINDS:
        raise ValueError(f"kind = {kind!r} must be one of {', '.join(_KINDS)}; choose one")
    signal, rate = baseband(x, fs, band)
    wave = _KINDS[kind](np.square(signal.real) + np.square(signal.imag))
    n = wave.shape[-1]
    window = hann(n).astype(wave.dtype)
    share = window / window.sum()
    wave -= (wave * share).sum(axis=-1, keepdims=True)
    # Beyond the bandwidth, the squared envelope has nothing and the other two mostly aliases.
    first, past = _band_lines(np.shape(x)[-1], fs, (0.0, fs / 2) if band is None else band)
    amplitude = 2 * np.abs(rfft(wave * share))[..., : past - first]
    return np.arange(past - first) * (rate / n), amplitude


def _log_envelope(power: Real) -> Real:
    floor = LOG_FLOOR * np.median(power, axis=-1, keepdims=True)
    silent = floor <= 0
    kept = np.maximum(power, np.where(silent, 1, floor).astype(power.dtype))
    return np.asarray(np.where(silent, 0, np.log(kept)).astype(power.dtype))


_KINDS: dict[str, Callable[[Real], Real]] = {
    "squared": lambda power: power,
    "plain": lambda power: np.asarray(np.sqrt(power)),
    "log": _log_envelope,
}

# --- rolling bearings


@dataclass(frozen=True, kw_only=True)
class BearingFrequencies:
    """Fault frequencies of a rolling bearing with its outer race at rest.

    Attributes
    ----------
    cage : float
        Rotation of the cage (FTF) [Hz, or orders].
    outer : float
        Rollers passing a point of the outer race (BPFO) [Hz, or orders].
    inner : float
        Rollers passing a point of the inner race (BPFI) [Hz, or orders].
    roller : float
        Rotation of a roller about its own axis (BSF); a damaged roller strikes a race twice per
        turn [Hz, or orders].

    Examples
    --------
    >>> BearingFrequencies(cage=0.4, outer=3.2, inner=4.8, roller=2.0).outer
    3.2
    """

    cage: float
    outer: float
    inner: float
    roller: float


def bearing_frequencies(
    rollers: int,
    roller_diameter: float,
    pitch_diameter: float,
    *,
    contact_angle: float = 0.0,
    speed_hz: float = 1.0,
) -> BearingFrequencies:
    """Fault frequencies of a rolling bearing from its geometry.

    Parameters
    ----------
    rollers : int
        Number of rolling elements.
    roller_diameter, pitch_diameter : float
        Diameters of a roller and of the pitch circle [m, or any one unit for both].
    contact_angle : float
        Angle between the line through the contacts and the radial plane [rad].
    speed_hz : float
        Speed of the inner race, the outer one at rest [Hz]; 1 gives orders of the shaft.

    Returns
    -------
    BearingFrequencies
        Fault frequencies [unit of speed_hz].

    Raises
    ------
    ValueError
        Unless rollers >= 1, 0 < roller diameter < pitch diameter, 0 <= angle < pi / 2 and the
        speed is > 0; all faults at once.

    Notes
    -----
    Pure rolling, with ``r = d cos(angle) / D``: cage ``(1 - r) / 2``, outer ``n (1 - r) / 2``,
    inner ``n (1 + r) / 2``, roller ``D (1 - r^2) / (2 d)``. Real rollers slide, and their lines lie
    1 to 2 % off.

    References
    ----------
    R. B. Randall, J. Antoni, "Rolling element bearing diagnostics: a tutorial", Mech. Syst. Signal
    Process. 25 (2011) 485-520, doi:10.1016/j.ymssp.2010.07.017.

    Examples
    --------
    >>> found = bearing_frequencies(8, 0.02, 0.12, speed_hz=25.0)
    >>> round(found.outer, 4), round(found.inner, 4)
    (83.3333, 116.6667)
    """
    _check_bearing(rollers, roller_diameter, pitch_diameter, contact_angle, speed_hz)
    ratio = roller_diameter / pitch_diameter * math.cos(contact_angle)
    return BearingFrequencies(
        cage=speed_hz / 2 * (1 - ratio),
        outer=rollers * speed_hz / 2 * (1 - ratio),
        inner=rollers * speed_hz / 2 * (1 + ratio),
        roller=speed_hz / 2 * pitch_diameter / roller_diameter * (1 - ratio**2),
    )


def _check_bearing(rollers: int, roller: float, pitch: float, angle: float, speed: float) -> None:
    faults = []
    if rollers < 1:
        faults.append(f"rollers = {rollers} must be >= 1; count them")
    if not 0 < roller < pitch < math.inf:
        faults.append(
            f"roller_diameter = {roller} must be > 0 and < pitch_diameter = {pitch}; "
            "give both in one unit"
        )
    if not 0 <= angle < math.pi / 2:
        faults.append(f"contact_angle = {angle} rad must be >= 0 and < pi / 2; give it in radians")
    if not 0 < speed < math.inf:
        faults.append(f"speed_hz = {speed} Hz must be > 0 and finite; give the shaft speed")
    if faults:
        raise ValueError("; ".join(faults))


@dataclass(frozen=True, kw_only=True)
class FaultLine:
    """A fault frequency and its harmonics as measured in an envelope spectrum.

    Attributes
    ----------
    frequency : float
        Measured frequency of the fundamental [Hz, or orders]; without a fault line, that of the
        loudest noise.
    score : float
        Geometric mean of `ratios` [-]: about 2 for noise, seldom 4; above 10 for a clear fault.
    ratios : ndarray, shape (n_harmonics,)
        Amplitude of each harmonic over the median of its surroundings [-].
    amplitudes : ndarray, shape (n_harmonics,)
        Amplitude of each harmonic [unit of the spectrum].

    Examples
    --------
    >>> line = FaultLine(frequency=80.3, score=6.0, ratios=np.array([9, 4]),
    ...     amplitudes=np.array([0.9, 0.4]))
    >>> line.score
    6.0
    """

    frequency: float
    score: float
    ratios: Float
    amplitudes: Float


def fault_line(
    frequency: ArrayLike,
    amplitude: ArrayLike,
    fault_hz: float,
    *,
    harmonics: int = 3,
    slip: float = SLIP,
) -> FaultLine:
    """Fault frequency and its harmonics, searched for in an envelope spectrum.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Evenly spaced from 0 [Hz, or orders], as from `envelope_spectrum`.
    amplitude : array_like, shape (n_lines,)
        Amplitude of each line [any unit].
    fault_hz : float
        Frequency by geometry [unit of frequency], as from `bearing_frequencies`.
    harmonics : int
        Number of harmonics, including the fundamental; those beyond the spectrum are left out.
    slip : float
        Half width of the search, as a share of the frequency [-]; rounded up to whole lines.

    Returns
    -------
    FaultLine
        Fault line at the frequency with the highest score within the search.

    Raises
    ------
    ValueError
        If the spectrum is not one row of finite amplitudes at evenly spaced frequencies from 0, it
        does not cover the fault frequency and its surroundings, the lines are too coarse for it, or
        slip times harmonics leaves no surroundings; all faults at once.

    Notes
    -----
    A trial frequency on line k takes the largest line within half a line's width of each harmonic
    and divides it by the median of the lines up to 0.3 fault frequencies away, without those within
    the slip. All harmonics share one fundamental, so that a multiple of another fault's frequency
    inside one search range is not mistaken for this fault. A silent spectrum scores 0. The position
    is interpolated between the lines of a Hann window at the most prominent harmonic.

    Examples
    --------
    >>> frequency = np.arange(1000) * 0.5
    >>> amplitude = np.ones(1000)
    >>> amplitude[[161, 322, 483]] = 20.0
    >>> found = fault_line(frequency, amplitude, 81.125)
    >>> found.frequency, round(found.score, 6)
    (80.5, 20.0)
    """
    place, size = np.asarray(frequency, dtype=np.float64), np.asarray(amplitude, dtype=np.float64)
    _check_spectrum(place, size)
    spacing = float(place[1])
    _check_search(spacing, place.size, fault_hz, harmonics, slip)
    order = fault_hz / spacing  # lines
    trials = np.arange(math.floor(order * (1 - slip)), math.ceil(order * (1 + slip)) + 1)
    reach = math.ceil((1 + slip) * order) + 1
    counts = [h for h in range(1, harmonics + 1) if h * reach + h < place.size]
    tops = np.stack([_highest_line(size, h * trials, h // 2) for h in counts])
    floors = np.array([_background(size, h * order, order, h * slip) for h in counts])
    ratios = size[tops] / floors[:, np.newaxis]
    scores = np.exp(np.mean(np.log(np.maximum(ratios, np.finfo(float).tiny)), axis=0))
    best = int(np.argmax(scores))
    clearest = int(np.argmax(ratios[:, best]))
    top = int(tops[clearest, best])
    return FaultLine(
        frequency=(top + _between_lines(size, top)) * spacing / counts[clearest],
        score=float(scores[best]) if size.any() else 0.0,
        ratios=ratios[:, best],
        amplitudes=size[tops[:, best]],
    )


def _check_spectrum(place: Float, size: Float) -> None:
    if place.ndim != 1 or place.shape != size.shape or place.size < 2:
        raise ValueError(
            f"frequency {place.shape} and amplitude {size.shape} must be two rows of equal length "
            ">= 2; give the spectrum of one channel"
        )
    if not (np.isfinite(size).all() and (size >= 0).all()):
        raise ValueError("amplitude must be finite and >= 0; repair the recording")
    even = np.arange(place.size) * place[1]
    if not (place[1] > 0 and np.allclose(place, even, rtol=1e-6, atol=0)):
        raise ValueError("frequency must rise evenly from 0; give every line of the spectrum")


def _check_search(spacing: float, n_lines: int, fault: float, harmonics: int, slip: float) -> None:
    faults = []
    if harmonics < 1:
        faults.append(f"harmonics = {harmonics} must be >= 1; count the fundamental")
    if not 0 <= slip * max(harmonics, 1) <= LARGEST_SPREAD:
        faults.append(
            f"slip * harmonics = {slip * harmonics:.4g} must be >= 0 and <= {LARGEST_SPREAD}; "
            "lower either"
        )
    least = _FEWEST_NEIGHBOURS / NEIGHBOURHOOD * spacing
    most = (n_lines - 1) * spacing / (1 + NEIGHBOURHOOD)
    if not least <= fault <= most:
        faults.append(
            f"fault_hz = {fault:.6g} Hz must be >= {least:.6g} Hz, which a longer record lowers, "
            f"and <= {most:.6g} Hz, which a wider band raises"
        )
    if faults:
        raise ValueError("; ".join(faults))


def _highest_line(size: Float, centres: NDArray[np.intp], reach: int) -> NDArray[np.intp]:
    """Index of the largest line within `reach` lines of each centre."""
    near = centres[:, np.newaxis] + np.arange(-reach, reach + 1)
    return np.asarray(near[np.arange(centres.size), np.argmax(size[near], axis=1)])


def _background(size: Float, centre: float, order: float, spread: float) -> float:
    """Median around the harmonic at line `centre`, without the search range; never 0."""
    lines = np.arange(size.size)
    far = np.abs(lines - centre)
    around = (far <= NEIGHBOURHOOD * order) & (far > max(spread * order, 2)) & (lines > 0)
    # A spectrum of exact zeros next to its peaks counts as its rounding error.
    least = max(np.finfo(float).eps * float(size.max()), np.finfo(float).tiny)
    return max(float(np.median(size[around])), least)


def _between_lines(size: Float, top: int) -> float:
    """Distance of a tone from its highest Hann line [lines], by Grandke's ratio of two lines."""
    if size[top] == 0 or top + 1 >= size.size:
        return 0.0
    side = 1 if size[top + 1] >= size[top - 1] else -1
    neighbour = size[top + side] / size[top]
    return side * float(np.clip((2 * neighbour - 1) / (1 + neighbour), 0.0, 0.5))


def envelope_span(speed_hz: float | None, bearing: BearingFrequencies | None) -> float:
    """Upper end of the envelope frequencies that are of interest.

    Parameters
    ----------
    speed_hz : float, optional
        Shaft speed [Hz].
    bearing : BearingFrequencies, optional
        Fault frequencies in orders of the shaft.

    Returns
    -------
    float
        Three harmonics of the inner race, else twenty orders, else 500 [Hz].

    Examples
    --------
    >>> envelope_span(25.0, None)
    512.5
    """
    if speed_hz is None:
        return SHOWN_HZ
    return (SHOWN_ORDERS if bearing is None else SHOWN_HARMONICS * bearing.inner) * speed_hz
