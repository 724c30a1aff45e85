"""Blows and what repeats them: envelope spectra, bearing lines, kurtogram, cyclic coherence.

A local defect strikes once a passage and rings a resonance. The band round that resonance, shifted
down to zero frequency, is slow enough to read the rate of the blows from; the kurtogram finds it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.lib.stride_tricks import as_strided, sliding_window_view
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length, fft, ifft, rfft
from .rate import check_rate, rate_fault
from .spectrum import hann
from .statistics import Real, centred

Float = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Band = tuple[float, float]
Kind = Literal["squared", "plain", "log"]

FEWEST_LINES = 8
"""Spectral lines a band must hold to have an envelope worth a spectrum [-]."""

LOG_FLOOR = 1e-3
"""Smallest squared envelope the logarithm tells apart, in medians [-]: of a stationary band, 0.07 %
of the samples lie lower."""

SLIP = 0.02
"""How far a bearing's lines lie from the geometry's, as a share [-]: rollers slide 1 to 2 %."""

NEIGHBOURHOOD = 0.3
"""Half width of the surroundings a fault line is compared with, in fault frequencies [-]."""

LARGEST_SPREAD = 0.15
"""Largest slip times harmonics [-]: half the surroundings are left to compare with."""

DEEPEST_LEVEL = 7
"""Default depth: 128 bands, each 1/256 of the sample rate wide."""

FEWEST_SAMPLES_LOG2 = 7
"""Binary logarithm of the samples that level 0 takes; each level below doubles them. The finest
bands then have 64 independent samples."""

SETTLING = 4.0
"""Length of the tapers at the ends of the record, and of what is left out after each, in samples
of the finest band [-]: what leaks past them lies 80 dB or more below the record."""

SILENCE = 1e-8
"""Mean square of a band, as a share of the record's, below which it may hold leakage only [-]."""

OVERLAP = 4
"""Hann frames over every sample [-]: fewer alias the cyclic frequency with the frame rate."""

LONE_SHARE = 1 / 3
"""Share of a band's fourth moment that, within `_LONE_PARTS` of the record, is a lone event [-]:
blows that come back four times or more leave each eighth of the record less."""

FEWEST_FRAMES, MANY_FRAMES = 64, 256
"""Frames from which spectral kurtosis looks for lone events [-]: below the former any share may be
one of noise, below the latter a third is that of every tenth line, half of none."""

LONE_SHARE_OF_FEW = 1 / 2
"""`LONE_SHARE` below the latter [-]."""

FEWEST_POOLED = 31
"""Frames from which it looks for lone events at all [-], below `FEWEST_FRAMES` over neighbouring
lines together; the default frames leave at least so many."""

MOST_LONE = 3
"""Lone events left out of a band [-]; with more, they come back."""

SHOWN_ORDERS = 20.5
"""Orders of the shaft that an envelope spectrum shows without a bearing [-]."""

SHOWN_HARMONICS = 3.5
"""Harmonics of the inner race that it shows with one [-]."""

SHOWN_HZ = 500.0
"""What it shows where the speed is unknown [Hz]."""

_PARTS = 16  # of a record, in which lone events are looked for
_LONE_PARTS = 2  # neighbours: an event may lie on the edge of two
_FEWEST_NEIGHBOURS = 8  # lines; the median of fewer is no background
_POOLED_LINES = 9  # neighbours in spectral kurtosis, a third of whose noise is shared
_LINE_SILENCE = 1e-12  # of the power of all lines; below it is rounding
_INDEPENDENCE = 0.703  # samples a flanked band holds per independent fourth moment, times its width
_CHUNK = 32_768  # complex samples transformed at a time, half a megabyte


def checked_signal(x: ArrayLike, fs: float, *, least: int = 2 * FEWEST_LINES) -> Real:
    """Zero-mean signal of finite samples, or a sentence that says what is wrong with it.

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
        If a sample is not finite, there are too few, or `fs` is not believed.

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
        faults.append(f"x has {wrong} non-finite samples, must have 0; cut or mend the recording")
    if faults:
        raise ValueError("; ".join(faults))
    return centred(signal)


# --- the envelope


def baseband(x: ArrayLike, fs: float, band: Band | None = None) -> tuple[Complex, float]:
    """Analytic signal of a band, shifted down to zero frequency, at a rate that suits the band.

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
        As `checked_signal`, or if the band leaves 0 … fs / 2, has no width, or holds fewer than
        8 lines of ``fs / n_samples``.

    Notes
    -----
    The lines of one Fourier transform inside the band (both edges included), transformed back. The
    edges are sharp: a blow rings for about two over the width. The record counts as periodic: a
    step between its ends shows as a blow there, which a window on the envelope takes away.

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
    lines *= 2 * n / n_samples  # the half of negative frequency, and the shorter transform back
    return np.asarray(ifft(lines)), fs * n / n_samples


def _band_lines(n_samples: int, fs: float, band: Band) -> tuple[int, int]:
    """First line of a band and the one past its last, neither 0 nor fs / 2."""
    low, high = band
    if not 0 <= low < high <= fs / 2:
        raise ValueError(
            f"band = {low:.6g} … {high:.6g} Hz must rise and lie in 0 … fs / 2 = {fs / 2:.6g} Hz; "
            "move its edges"
        )
    # Edges a rounding error beside a line still mean that line.
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
        Lower and upper edge [Hz]; everything by default.

    Returns
    -------
    envelope : ndarray, shape (..., n)
        Amplitude of the band [unit of x]; precision of `x` kept.
    rate : float
        Its sample rate [Hz]; see `baseband`.

    Raises
    ------
    ValueError
        As `baseband`.

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
        Lower and upper edge [Hz], as from `Kurtogram.band`; everything by default.
    kind : {"squared", "plain", "log"}
        What is transformed: the squared envelope, the envelope, or the natural logarithm of the
        squared envelope. The logarithm keeps one large blow, whatever its cause, from drowning the
        periodic ones; the plain envelope stands between.

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
        As `baseband`, or if `kind` is none of the three.

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
    # Beyond the width of the band, the square has nothing and the others little but aliases.
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
    """How often the parts of a rolling bearing meet, its outer race at rest.

    Attributes
    ----------
    cage : float
        Turns of the cage (FTF) [Hz, or orders].
    outer : float
        Rollers passing a point of the outer race (BPFO) [Hz, or orders].
    inner : float
        Rollers passing a point of the inner race (BPFI) [Hz, or orders].
    roller : float
        Turns of a roller about itself (BSF); a damaged one strikes a race twice a turn [Hz, or
        orders].

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
        Of a roller, and of the circle of their centres [m, or one other unit for both].
    contact_angle : float
        Between the line through the contacts and the radial plane [rad].
    speed_hz : float
        Speed of the inner race, the outer one at rest [Hz]; 1 gives orders of the shaft.

    Returns
    -------
    BearingFrequencies
        [unit of speed_hz].

    Raises
    ------
    ValueError
        Unless rollers >= 1, 0 < roller diameter < pitch diameter, 0 <= angle < pi / 2 and the
        speed is > 0; all faults at once.

    Notes
    -----
    Pure rolling, with ``r = d cos(angle) / D``: cage ``(1 - r) / 2``, outer ``n (1 - r) / 2``,
    inner ``n (1 + r) / 2``, roller ``D (1 - r^2) / (2 d)``. Real rollers slide, and the lines lie
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
    """What stands in an envelope spectrum at a fault frequency and its harmonics.

    Attributes
    ----------
    frequency : float
        Where the fundamental is found [Hz, or orders]; that of the loudest noise where there is
        none.
    score : float
        Geometric mean of `ratios` [-]: about 2 of noise, seldom 4; above 10 of a clear fault.
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
    """Look for a fault frequency and its harmonics in an envelope spectrum.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Evenly spaced from 0 [Hz, or orders], as from `envelope_spectrum`.
    amplitude : array_like, shape (n_lines,)
        Of the lines [any unit].
    fault_hz : float
        Frequency by geometry [unit of frequency], as from `bearing_frequencies`.
    harmonics : int
        Number of harmonics, the fundamental one of them; those beyond the spectrum are left out.
    slip : float
        Half width of the search, as a share of the frequency [-]; rounded up to whole lines.

    Returns
    -------
    FaultLine
        At the frequency within the search that scores highest.

    Raises
    ------
    ValueError
        If the spectrum is no row of finite amplitudes over even frequencies from 0, it does not
        reach the fault frequency and its surroundings, the lines are too coarse for it, or slip
        times harmonics leaves no surroundings; all faults at once.

    Notes
    -----
    A trial frequency on line k takes the largest line within half a line's worth of each harmonic
    and divides it by the median of the lines up to 0.3 fault frequencies away, those within the
    slip left out. All harmonics share one fundamental, so that a multiple of another fault's
    frequency that falls into one search does not pass for this one. A silent spectrum scores 0.
    The position is refined between the lines of a Hann window at the harmonic that stands out
    most.

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
        raise ValueError("amplitude must be finite and >= 0; mend the recording")
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
    """Of the lines up to `reach` away from each centre, the largest."""
    near = centres[:, np.newaxis] + np.arange(-reach, reach + 1)
    return np.asarray(near[np.arange(centres.size), np.argmax(size[near], axis=1)])


def _background(size: Float, centre: float, order: float, spread: float) -> float:
    """Median round a harmonic at line `centre`, the search left out; never 0."""
    lines = np.arange(size.size)
    far = np.abs(lines - centre)
    around = (far <= NEIGHBOURHOOD * order) & (far > max(spread * order, 2)) & (lines > 0)
    # A spectrum of exact zeros beside its peaks is as deep as its rounding.
    least = max(np.finfo(float).eps * float(size.max()), np.finfo(float).tiny)
    return max(float(np.median(size[around])), least)


def _between_lines(size: Float, top: int) -> float:
    """Distance of a tone from its highest Hann line [lines]; Grandke's ratio of two lines."""
    if size[top] == 0 or top + 1 >= size.size:
        return 0.0
    side = 1 if size[top + 1] >= size[top - 1] else -1
    beside = size[top + side] / size[top]
    return side * float(np.clip((2 * beside - 1) / (1 + beside), 0.0, 0.5))


# --- spectral kurtosis


def spectral_kurtosis(x: ArrayLike, fs: float, *, nperseg: int | None = None) -> tuple[Float, Real]:
    """Kurtosis of the fluctuation of every spectral line from frame to frame.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    nperseg : int, optional
        Length of the half-overlapping Hann frames [samples]; 256, or a sixteenth of the record if
        that is less. It should be shorter than the time between two blows and longer than one.

    Returns
    -------
    frequency : ndarray, shape (n_lines,)
        ``k fs / nperseg`` for k = 2 … nperseg / 2 - 2 [Hz].
    kurtosis : ndarray, shape (..., n_lines)
        0 of stationary Gaussian noise, -1 of a tone of constant amplitude, above 0 of blows [-];
        -1 also of silence. Precision of `x` kept.

    Raises
    ------
    ValueError
        As `checked_signal`, or if `nperseg` is odd, below 16, or leaves fewer than 4
        frames.

    Notes
    -----
    ``(K + 1) / (K - 1) (<|X|^4> / <|X|^2>^2 - 1) - 1`` over K frames, the form of
    ``<|X|^4> / <|X|^2>^2 - 2`` that is free of bias for Gaussian noise and independent frames at
    any K; the overlap leaves a bias of ``-1 / (9 K)``. Standard deviation on such noise
    ``2 / sqrt(K)``. The lines at either end, which overlap their own mirror image and
    scatter otherwise, are left out.

    Lone events are left out by the rule of `kurtogram`, line by line, where there are 256 frames or
    more, and from 64 on where they have half of a line's ``<|X|^4>``; from 31 on, where they have
    half of it in the mean of nine neighbouring lines. K then counts the frames that are left.
    Of noise, one line in a hundred loses some.

    References
    ----------
    J. Antoni, "The spectral kurtosis: a useful tool for characterising non-stationary signals",
    Mech. Syst. Signal Process. 20 (2006) 282-307, doi:10.1016/j.ymssp.2004.09.001. Bias: G. M.
    Nita, D. E. Gary, "The generalized spectral kurtosis estimator", Mon. Not. R. Astron. Soc.
    Lett. 406 (2010) L60-L64.

    Examples
    --------
    >>> t = np.arange(4096) / 4096
    >>> frequency, kurtosis = spectral_kurtosis(np.sin(2 * np.pi * 512 * t), 4096.0)
    >>> round(float(kurtosis[frequency == 512][0]), 6)
    -1.0
    """
    signal = checked_signal(x, fs, least=64)
    length = min(256, signal.shape[-1] // 32 * 2) if nperseg is None else nperseg
    n_frames = (signal.shape[-1] - length) // max(length // 2, 1) + 1
    if length % 2 or length < 16 or n_frames < 4:
        raise ValueError(
            f"nperseg = {length} samples must be even, >= 16 and <= 2/5 of n_samples = "
            f"{signal.shape[-1]}; choose another"
        )
    begins = _begins(n_frames, _PARTS if n_frames >= FEWEST_POOLED else 1)
    parts = _moments(signal, length, n_frames, begins)
    share = LONE_SHARE if n_frames >= MANY_FRAMES else LONE_SHARE_OF_FEW
    kept = _without_lone(parts[1] if n_frames >= FEWEST_FRAMES else _pooled(parts[1]), share)
    second, fourth = ((part * kept).sum(axis=-1) for part in parts)
    n_left = kept @ np.diff([*begins, n_frames])
    silence = _LINE_SILENCE * parts[0].sum(axis=(-1, -2))[..., np.newaxis]
    spread = _over(n_left * fourth, second**2, silence=silence)
    kurtosis = (n_left + 1) / (n_left - 1) * (spread - 1) - 1
    inner = slice(2, length // 2 - 1)
    frequency = np.arange(length // 2 + 1)[inner] * (fs / length)
    return frequency, kurtosis[..., inner].astype(signal.dtype)


def _pooled(fourth: Float) -> Float:
    """Share of each part in the fourth moment, mean of a line and its neighbours.

    Of few frames one line of noise has its largest in a single one; an event has it in all lines
    of its neighbourhood.
    """
    total = fourth.sum(axis=-1, keepdims=True)
    share = np.divide(fourth, total, out=np.zeros_like(fourth), where=total > 0)
    width = min(_POOLED_LINES, share.shape[-2] // 2 * 2 - 1)
    ends = [(0, 0)] * (share.ndim - 2) + [(width // 2, width // 2), (0, 0)]
    padded = np.pad(share, ends, mode="reflect")
    return np.asarray(sliding_window_view(padded, width, axis=-2).mean(axis=-1))


def _begins(n: int, n_parts: int) -> NDArray[np.intp]:
    """First of the n samples or frames in each part of the record [shape=(n_parts,)]."""
    return np.arange(n_parts) * n // n_parts


def _moments(
    signal: Real, length: int, n_frames: int, begins: NDArray[np.intp]
) -> tuple[Float, Float]:
    """Sums of |X|^2 and |X|^4 over the frames of each part, scaled to the rms.

    Both [shape=(..., n_lines, n_parts)]; `begins` holds the first frame of each part.
    """
    scale = math.sqrt(float(np.mean(np.square(signal, dtype=np.float64)))) or 1.0
    window = (hann(length) / scale).astype(signal.dtype)
    frames = sliding_window_view(signal, length, axis=-1)[..., :: length // 2, :]
    shape = (*signal.shape[:-1], length // 2 + 1, begins.size)
    second, fourth = np.zeros(shape), np.zeros(shape)
    step = max(1, _CHUNK // length)
    for part, (begin, end) in enumerate(pairwise([*begins.tolist(), n_frames])):
        for start in range(begin, end, step):
            lines = rfft(frames[..., start : min(start + step, end), :] * window)
            power = np.square(lines.real) + np.square(lines.imag)
            second[..., part] += power.sum(axis=-2)
            fourth[..., part] += np.square(power).sum(axis=-2)
    return second, fourth


def _over(above: Float, below: Float, *, silence: Float) -> Float:
    """Quotient; 1, the least it can be, where the root of the divisor is not above `silence`."""
    heard = np.sqrt(below) > silence
    return np.asarray(np.divide(above, below, out=np.ones_like(below), where=heard))


# --- kurtogram


@dataclass(frozen=True, kw_only=True)
class Kurtogram:
    """Kurtosis of the complex envelope of every band of a tree.

    Attributes
    ----------
    fs : float
        Sample rate [Hz].
    level : ndarray, shape (n_rows,)
        Binary logarithm of the number of bands in each row: 0, 1, log2(3), 2, log2(6) … [-].
    kurtosis : tuple of ndarray
        One per row, from the lowest band to the highest [-]: 0 of stationary Gaussian noise, -1 of
        a tone of constant amplitude or of silence. Lone events are left out, see `kurtogram`.
    deviation : ndarray, shape (n_rows,)
        Standard deviation of the kurtosis of stationary Gaussian noise in each row [-].

    Examples
    --------
    >>> found = kurtogram(np.sin(np.arange(1024)), 1000.0, levels=1)
    >>> found.level.tolist(), [row.round(3).tolist() for row in found.kurtosis]
    ([0.0, 1.0], [[-1.0], [-1.0, -1.0]])
    """

    fs: float
    level: Float
    kurtosis: tuple[Float, ...]
    deviation: Float

    @property
    def best(self) -> tuple[int, int]:
        """Row and number of the band of the largest kurtosis; of equals, the widest."""
        tops = [int(np.argmax(row)) for row in self.kurtosis]
        values = [row[top] for row, top in zip(self.kurtosis, tops, strict=True)]
        row = int(np.argmax(values))
        return row, tops[row]

    @property
    def highest(self) -> float:
        """Largest kurtosis [-]."""
        row, number = self.best
        return float(self.kurtosis[row][number])

    @property
    def score(self) -> float:
        """Largest kurtosis, in standard deviations of what noise has in such a band [-].

        Noise has 2 to 4, and 7 in one record of a hundred; tones and silence have 0.
        """
        row, _ = self.best
        return max(self.highest, 0.0) / float(self.deviation[row])

    @property
    def band(self) -> Band:
        """Edges of the band of the largest kurtosis [Hz]."""
        row, number = self.best
        width = self.fs / 2 / self.kurtosis[row].size
        return number * width, (number + 1) * width

    @property
    def centre(self) -> float:
        """Middle of that band [Hz]."""
        return sum(self.band) / 2

    @property
    def bandwidth(self) -> float:
        """Width of that band [Hz]."""
        low, high = self.band
        return high - low

    def image(self) -> Float:
        """Kurtosis as a picture: one row a level, each band as wide as it is.

        Returns
        -------
        ndarray, shape (n_rows, 3 * 2**levels)
            Columns share 0 … fs / 2 evenly [-].
        """
        columns = 3 * max(row.size for row in self.kurtosis)
        return np.stack([np.repeat(row, columns // row.size) for row in self.kurtosis])


def kurtogram(x: ArrayLike, fs: float, *, levels: int | None = None) -> Kurtogram:
    """Kurtosis of the complex envelope over centre frequency and bandwidth.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    levels : int, optional
        Depth of the tree: the narrowest bands are ``fs / 2 / 2**levels`` wide. 7, or as many as
        the record is long enough for. To show a fault line and its harmonics, a band must be
        several fault frequencies wide.

    Returns
    -------
    Kurtogram
        With the band of the largest kurtosis.

    Raises
    ------
    ValueError
        As `checked_signal`, if `x` is no single row, or unless 1 <= levels <=
        log2(n_samples) - 7.

    Notes
    -----
    Each row cuts 0 … fs / 2 into 1, 2, 3, 4, 6, 8, 12 … bands, the tree of the reference. Where
    that filters and decimates from level to level, here every band is a slice of one Fourier
    transform with smooth flanks half a band wide, transformed back at 1.5 times its bandwidth.
    The kurtosis of the complex envelope z is ``<|z|^4> / <|z|^2>^2 - 2``. The ends of the record
    are tapered and left out, 16 samples of the finest band together, so that the step between
    them is no blow.

    With n independent samples in a band (time left times width), noise scatters by about
    ``2 / sqrt(n)`` (`Kurtogram.deviation`). The largest of all bands is then a narrow one at 2 to
    4 times that, 7 in one record of a hundred.

    One single blow would have a higher kurtosis than a train of them, and is no defect that comes
    back. Where an eighth of the record holds more than a third of a band's ``<|z|^4>``, it is left
    out of both means, and again of what is left, three times at the most. A train of four blows
    or more is not touched, and noise next to never.

    References
    ----------
    J. Antoni, "Fast computation of the kurtogram for the detection of transient faults", Mech.
    Syst. Signal Process. 21 (2007) 108-124, doi:10.1016/j.ymssp.2005.12.002.

    Examples
    --------
    A blow every 50 ms that rings at 3.5 kHz, in noise:

    >>> t = np.arange(20_000) / 10_000
    >>> ring = np.exp(-800 * (t % 0.05)) * np.sin(2 * np.pi * 3500 * t)
    >>> found = kurtogram(ring + 0.05 * np.random.default_rng(0).standard_normal(t.size), 10_000.0)
    >>> found.band[0] < 3500 < found.band[1]
    True
    """
    signal = checked_signal(x, fs, least=1 << (FEWEST_SAMPLES_LOG2 + 1))
    if signal.ndim != 1:
        raise ValueError(f"x has shape {signal.shape}, must be (n_samples,); give one channel")
    deepest = signal.size.bit_length() - 1 - FEWEST_SAMPLES_LOG2
    depth = min(DEEPEST_LEVEL, deepest) if levels is None else levels
    if not 1 <= depth <= deepest:
        raise ValueError(
            f"levels = {depth} must be >= 1 and <= {deepest}, log2(n_samples) - "
            f"{FEWEST_SAMPLES_LOG2}; ask for fewer or record longer"
        )
    counts = _bands_per_row(depth)
    lines, kept = _tapered_lines(signal, depth)
    parts = [_part_moments(lines, count, kept) for count in counts]
    silence = np.asarray(SILENCE * float(parts[0][0].sum()))
    moments = [_repeated(second, fourth) for second, fourth in parts]
    inside = (kept[1] - kept[0]) * lines.size * 4 / 3  # samples of the record left
    return Kurtogram(
        fs=fs,
        level=np.log2(counts),
        kurtosis=tuple(_over(fourth, second**2, silence=silence) - 2 for second, fourth in moments),
        deviation=2 * np.sqrt(_INDEPENDENCE * 2 * np.array(counts) / inside),
    )


def envelope_span(speed_hz: float | None, bearing: BearingFrequencies | None) -> float:
    """Frequencies of the envelope that are of interest, from 0 to this.

    Parameters
    ----------
    speed_hz : float, optional
        Shaft speed [Hz].
    bearing : BearingFrequencies, optional
        In orders of the shaft.

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


def kurtogram_levels(n_samples: int, fs: float, span: float) -> int:
    """Depth of a kurtogram whose narrowest bands still hold the frequencies of interest.

    Parameters
    ----------
    n_samples : int
        Length of the record, 256 or more.
    fs : float
        Sample rate [Hz].
    span : float
        Highest frequency of the envelope that is of interest [Hz], see `envelope_span`.

    Returns
    -------
    int
        For `kurtogram`, >= 1.

    Examples
    --------
    >>> kurtogram_levels(51_200, 25_600.0, 500.0)
    4
    """
    check_rate(fs)
    wide = int(math.log2(max(fs / 2 / span, 2)))
    deepest = n_samples.bit_length() - 1 - FEWEST_SAMPLES_LOG2
    return max(1, min(DEEPEST_LEVEL, wide, deepest))


def _bands_per_row(depth: int) -> list[int]:
    """Halves of halves, and thirds of those but the last two: 1, 2, 3, 4, 6, 8 …."""
    return sorted({1 << k for k in range(depth + 1)} | {3 << k for k in range(depth - 1)})


def _tapered_lines(signal: Real, depth: int) -> tuple[Complex, tuple[float, float]]:
    """Lines of the tapered record below fs / 2, and the part of the transform to look at.

    The record, scaled to an rms of 1, is padded to a length whose half every row divides into
    bands with flanks of whole lines. Zeros stand for what is below 0 and above fs / 2.
    """
    unit = 3 << (depth + 3)
    length = unit * fast_length(-(-signal.size // unit))
    settling = round(SETTLING * (2 << depth))
    ramp = np.sin(np.pi / 2 * (np.arange(settling) + 0.5) / settling) ** 2
    rms = math.sqrt(float(np.mean(np.square(signal, dtype=np.float64)))) or 1.0
    padded = np.zeros(length, dtype=signal.dtype)
    np.divide(signal, rms, out=padded[: signal.size], casting="same_kind")
    padded[:settling] *= ramp
    padded[signal.size - settling : signal.size] *= ramp[::-1]
    kept = (2 * settling / length, (signal.size - 2 * settling) / length)
    lines = rfft(padded)[:-1]
    margin = lines.size // 4
    return np.pad(lines, margin), kept


def _repeated(second: Float, fourth: Float) -> tuple[Float, Float]:
    """Mean |z|^2 and |z|^4 of every band without its lone events [shape=(count,) each].

    From the parts of both means that fall into each part of the record [shape=(count, _PARTS)].
    """
    kept = _without_lone(fourth, LONE_SHARE)
    share = kept.mean(axis=-1)
    return (second * kept).sum(axis=-1) / share, (fourth * kept).sum(axis=-1) / share


def _without_lone(fourth: Float, most: float) -> Float:
    """Weight of each part: 0 where a lone event is, else 1 [shape=(..., n_parts)].

    From what each part adds to the fourth moment, and the share that neighbours may have at the
    most; see `kurtogram`.
    """
    kept = np.ones(fourth.shape)
    if fourth.shape[-1] < _LONE_PARTS:
        return kept
    for _ in range(MOST_LONE):
        left = fourth * kept
        pairs = sliding_window_view(left, _LONE_PARTS, axis=-1).sum(axis=-1)
        first = np.argmax(pairs, axis=-1)
        lone = np.nonzero(pairs.max(axis=-1) > most * left.sum(axis=-1))
        for part in range(_LONE_PARTS):
            kept[(*lone, first[lone] + part)] = 0.0
    return kept


def _part_moments(lines: Complex, count: int, kept: tuple[float, float]) -> tuple[Float, Float]:
    """What each part of the record adds to mean |z|^2 and |z|^4 [shape=(count, _PARTS) each].

    `lines` begin a quarter of their number below 0, with zeros, and end as far above fs / 2.
    """
    width = lines.size * 2 // 3 // count
    weight = _flanks(width).astype(lines.real.dtype)
    n = weight.size
    weight *= n / (width * count * 2)
    first, past = math.ceil(kept[0] * n), math.floor(kept[1] * n)
    step = lines.strides[0]
    outset = lines[lines.size // 6 - (n - width) // 2 :]
    slices = as_strided(outset, (count, n), (width * step, step), writeable=False)
    second, fourth = np.empty((count, _PARTS)), np.empty((count, _PARTS))
    begins = _begins(past - first, _PARTS)
    rows = max(1, _CHUNK // n)
    for start in range(0, count, rows):
        part = slice(start, start + rows)
        wave = ifft(slices[part] * weight)[:, first:past].view(weight.dtype)
        np.square(wave, out=wave)
        power = wave[:, ::2] + wave[:, 1::2]
        second[part] = np.add.reduceat(power, begins, axis=-1, dtype=np.float64)
        # A dot product would wake BLAS threads, which cost more than they bring on a busy machine.
        np.square(power, out=power)
        fourth[part] = np.add.reduceat(power, begins, axis=-1, dtype=np.float64)
    return second / (past - first), fourth / (past - first)


def _flanks(width: int) -> Float:
    """Weights of the lines of a band: their squares and its neighbours' add up to 1.

    They reach a quarter of the width beyond either edge [shape=(3 width / 2,)]. Meyer's polynomial
    makes the flank smooth, so that the band settles within the tapers (Daubechies, "Ten lectures on
    wavelets", 1992, section 4.2).
    """
    weight = np.ones(width * 3 // 2)
    fall = width // 2
    u = np.arange(fall) / fall
    square = u * u
    weight[-fall:] = np.cos(np.pi / 2 * square * square * (35 - 84 * u + square * (70 - 20 * u)))
    weight[0] = 0.0
    weight[1 : fall + 1] = weight[: -fall - 1 : -1]
    return weight


# --- cyclic coherence


def cyclic_coherence(
    x: ArrayLike, fs: float, cyclic_hz: ArrayLike, *, nperseg: int = 256
) -> tuple[Float, Float]:
    """Cyclic spectral coherence of a signal at given cyclic frequencies.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal [any unit]; its mean is removed. Resampled over the shaft angle, `fs` counts samples
        a revolution, and both frequencies below are orders.
    fs : float
        Sample rate [Hz].
    cyclic_hz : array_like, shape (n_cyclic,)
        Cyclic frequencies alpha [Hz], > 0 and < fs / 2. They are resolved to ``fs / n_samples``:
        search round a bearing's frequency in steps of that.
    nperseg : int
        Length of the Hann frames, three quarters overlapping [samples].

    Returns
    -------
    frequency : ndarray, shape (nperseg // 2 + 1,)
        Spectral frequency f [Hz].
    coherence : ndarray, shape (n_cyclic, nperseg // 2 + 1)
        ``|<X(f) X*(f - alpha)>|^2 / (<|X(f)|^2> <|X(f - alpha)|^2>)``, between 0 and 1 [-]; 0 of
        silence. Its mean over f is the enhanced envelope spectrum at alpha.

    Raises
    ------
    ValueError
        As `checked_signal`, if `x` is no single row, `nperseg` is no multiple of 4 from
        16 up to a third of the record, a cyclic frequency leaves its bounds, or the record
        holds no whole period of it.

    Notes
    -----
    Averaged cyclic periodogram. Compare with `coherence_threshold`: noise has about one over the
    number of independent frames. Stationary tones a cyclic frequency apart are coherent too, and
    one tone with its own mirror image at twice its frequency: take the orders of the shaft out
    first. Narrower lines (a longer `nperseg`) than the cyclic frequency resolve the sidebands of a
    modulated tone; wider ones suit blows.

    References
    ----------
    J. Antoni, "Cyclic spectral analysis in practice", Mech. Syst. Signal Process. 21 (2007)
    597-630, doi:10.1016/j.ymssp.2006.08.007.

    Examples
    --------
    Noise whose power swings 40 times a second, and not 50 times:

    >>> t = np.arange(32_768) / 8192
    >>> x = np.random.default_rng(0).standard_normal(t.size) * (1 + np.cos(2 * np.pi * 40 * t))
    >>> _, coherence = cyclic_coherence(x, 8192.0, [40.0, 50.0])
    >>> bool(coherence[0].mean() > 0.3), bool(coherence[1].mean() < 0.01)
    (True, True)
    """
    signal = checked_signal(x, fs, least=64)
    cycles = np.atleast_1d(np.asarray(cyclic_hz, dtype=np.float64))
    _check_frames(signal.shape, nperseg)
    _check_cycles(cycles, fs, signal.size)
    rms = math.sqrt(float(np.mean(np.square(signal, dtype=np.float64)))) or 1.0
    window = hann(nperseg) / rms
    hop = nperseg // OVERLAP
    # The shift by alpha inside a frame is one window for all frames; their places add a factor.
    turning = window * np.exp(2j * np.pi / fs * np.outer(cycles, np.arange(nperseg)))
    frames = sliding_window_view(signal, nperseg)[::hop]
    power, shifted, cross = _sums(frames, window, turning, cycles * (hop / fs))
    below = power * shifted
    heard = np.sqrt(below) > _LINE_SILENCE * power.sum()
    above = np.square(cross.real) + np.square(cross.imag)
    coherence = np.divide(above, below, out=np.zeros_like(below), where=heard)
    frequency = np.arange(power.size, dtype=np.float64) * (fs / nperseg)
    # Rounding must not lift a perfect coherence above 1.
    return frequency, np.minimum(coherence, 1.0)


def _sums(
    frames: Real, window: Float, turning: Complex, drift: Float
) -> tuple[Float, Float, NDArray[np.complex128]]:
    """Sums over the frames of |X(f)|^2, |X(f - alpha)|^2 and X(f) X*(f - alpha).

    `drift` is what each cyclic frequency turns from frame to frame [rev, shape=(n_cyclic,)].
    """
    n_lines = window.size // 2 + 1
    power, shifted = np.zeros(n_lines), np.zeros((drift.size, n_lines))
    cross = np.zeros((drift.size, n_lines), dtype=np.complex128)
    step = max(1, _CHUNK // window.size)
    for start in range(0, len(frames), step):
        part = frames[start : start + step]
        lines = rfft(part * window)
        power += _power(lines)
        for i, turns in enumerate(drift):
            others = fft(part * turning[i])[:, :n_lines]
            shifted[i] += _power(others)
            place = np.exp(-2j * np.pi * turns * np.arange(start, start + len(part)))
            cross[i] += np.einsum("f,fk,fk->k", place, lines, others.conj())
    return power, shifted, cross


def _power(lines: Complex) -> Real:
    return np.asarray((np.square(lines.real) + np.square(lines.imag)).sum(axis=0))


def coherence_threshold(n_samples: int, *, nperseg: int = 256, probability: float = 0.01) -> float:
    """Cyclic coherence that stationary noise exceeds with a given probability.

    Parameters
    ----------
    n_samples : int
        Length of the record.
    nperseg : int
        Length of the frames, as in `cyclic_coherence` [samples].
    probability : float
        Of a false alarm at one line and one cyclic frequency [-]; divide by their number for the
        largest of many.

    Returns
    -------
    float
        ``1 - probability**(1 / (n - 1))`` of n independent frames [-].

    Raises
    ------
    ValueError
        If `nperseg` is as `cyclic_coherence` refuses it, or unless 0 < probability < 1.

    Notes
    -----
    The squared coherence of n independent pairs of complex Gaussian numbers. The K frames that
    overlap by three quarters count as ``n = K / (1 + 2 sum_j (1 - j / K) r_j^2)``, with r_j the
    correlation of the window with itself j frames on; a Hann window gives K / 1.92.

    References
    ----------
    G. C. Carter, "Coherence and time delay estimation", Proc. IEEE 75 (1987) 236-255,
    doi:10.1109/PROC.1987.13723. Overlap: P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967)
    70-73, doi:10.1109/TAU.1967.1161901.

    Examples
    --------
    >>> round(coherence_threshold(32_768), 4)
    0.0173
    """
    _check_frames((n_samples,), nperseg)
    if not 0 < probability < 1:
        raise ValueError(f"probability = {probability} must be > 0 and < 1; 0.01 is usual")
    hop = nperseg // OVERLAP
    n_frames = (n_samples - nperseg) // hop + 1
    window = hann(nperseg)
    lags = np.arange(1, OVERLAP)
    likeness = np.array([window[j * hop :] @ window[: nperseg - j * hop] for j in lags])
    likeness /= window @ window
    independent = n_frames / (1 + 2 * float(np.sum((1 - lags / n_frames) * likeness**2)))
    return float(1 - probability ** (1 / (independent - 1)))


def _check_frames(shape: tuple[int, ...], nperseg: int) -> None:
    if len(shape) != 1:
        raise ValueError(f"x has shape {shape}, must be (n_samples,); give one channel")
    most = shape[0] // 3  # 8 frames and more
    if nperseg % OVERLAP or not 16 <= nperseg <= most:
        raise ValueError(
            f"nperseg = {nperseg} samples must be a multiple of {OVERLAP}, >= 16 and <= {most}, a "
            "third of n_samples; choose another or record longer"
        )


def _check_cycles(cycles: Float, fs: float, n_samples: int) -> None:
    least = fs / n_samples
    if cycles.ndim != 1 or not np.all((cycles >= least) & (cycles < fs / 2)):
        raise ValueError(
            f"cyclic_hz = {cycles.tolist()} Hz must be one row, >= {least:.6g}, one period in the "
            f"record, and < fs / 2 = {fs / 2:.6g}; drop the others or record longer"
        )
