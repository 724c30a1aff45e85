"""Features locked to the shaft: tacho pulses, phase, orders, and energy over the crank angle."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d

from ..signal.fft import rfft
from ..signal.rate import check_rate
from ..signal.spectrum import decibel, hann, line_weights, one_sided_scale
from ..signal.statistics import Amplitude, Real, centred
from .edges import placed_edges

Float = NDArray[np.float64]

HYSTERESIS_SHARE = 0.3
"""Distance of the two switching thresholds from the level, as a share of the distance to the nearer
extreme [-]: 15 % of the swing on either side of its middle."""

INTERVAL_JUMP = 1.8
"""Largest ratio of neighbouring pulse intervals [-]: a missed pulse makes it 2."""

WINDOW_S = 0.010
"""Short-time window [s]: a Hann window of 10 ms is 3.6 ms wide at half its energy, which is 6.6
degrees at 5 rev/s, less than one bin of 10 degrees, and has lines 100 Hz apart."""

DEAD_CENTRE_HALF_WIDTH_DEG = 20.0
"""Half width of the window about a dead centre, and half the length of the window after it
[deg]."""

IMPACT_THRESHOLD = 4.0
"""Short-time energy from which a peak counts as an impact, over the median energy [-]."""

_CHUNK_FRAMES = 256
_CHUNK_SAMPLES = 8192


def pulse_times(tacho: ArrayLike, fs: float, *, level: float | None = None) -> Float:
    """Times of the rising edges of a tacho signal.

    Parameters
    ----------
    tacho : array_like, shape (n_samples,)
        Pulse train [V, or any unit].
    fs : float
        Sample rate [Hz].
    level : float, optional
        Level of the edge [unit of tacho]; half-way between the extremes by default.

    Returns
    -------
    ndarray, shape (n_pulses,)
        Times after the first sample [s], increasing.

    Raises
    ------
    ValueError
        If a sample is not finite, the signal has no swing, `level` lies outside it, or there are
        fewer than two edges.

    Notes
    -----
    An edge counts if the signal goes from 30 % of the distance to the nearer extreme below the
    level to the same share above it, so that smaller noise cannot cause double counts. Its time is
    interpolated linearly between the two samples around the level; a step averaged over a sample is
    located by its area, see `edges.placed_edges`. Both are exact and unbiased. A sampled logic
    level has nothing to interpolate: each edge lies within a sample, and the smoothest row of edges
    within those samples is taken, see `edges.smoothest`. An edge in progress at the first sample
    does not count. The default level relies on the extremes: give `level` if spikes exceed the
    pulses; every edge is then located by linear interpolation at that level.

    Examples
    --------
    >>> pulse_times([0, 0, 4, 4, 0, 0, 1, 5, 0], fs=10.0, level=2.0).tolist()
    [0.15, 0.625]
    """
    volts = np.asarray(tacho, dtype=np.float64)
    _check_tacho(volts, fs)
    low, high = float(volts.min()), float(volts.max())
    middle = (low + high) / 2 if level is None else level
    if not low < middle < high:
        raise ValueError(
            f"level = {middle:.6g} must lie between the extremes of the tacho, {low:.6g} and "
            f"{high:.6g}; the tacho is disconnected, or the record shorter than a revolution"
        )
    before = _edge_samples(volts, middle, HYSTERESIS_SHARE * min(middle - low, high - middle))
    if before.size < 2:
        raise ValueError(
            f"tacho has {before.size} rising edge(s) through {middle:.6g}, must have >= 2; "
            "record two revolutions or more, check the tacho"
        )
    fraction = (middle - volts[before]) / (volts[before + 1] - volts[before])
    if level is not None:
        return np.asarray((before + fraction) / fs)
    share = np.pad((volts - low) / (high - low), (1, 2), constant_values=np.nan)
    around = share[before[:, np.newaxis] + np.arange(4)]
    placed = placed_edges(before, around, before + fraction)
    return np.asarray(np.clip(placed, 0.0, volts.size - 1) / fs)


def _check_tacho(volts: Float, fs: float) -> None:
    if volts.ndim != 1 or volts.size < 2:
        raise ValueError(f"tacho has shape {volts.shape}, must be (n_samples >= 2,); give one row")
    check_rate(fs)
    wrong = np.flatnonzero(~np.isfinite(volts))
    if wrong.size:
        raise ValueError(
            f"tacho has {wrong.size} non-finite samples, the first at {wrong[0]}, must have 0; "
            "cut or repair the recording"
        )


def _edge_samples(volts: Float, level: float, margin: float) -> NDArray[np.intp]:
    """Last sample below the level before each rise through both thresholds."""
    state = (volts >= level + margin).view(np.int8) - (volts <= level - margin).view(np.int8)
    begins = np.flatnonzero(np.append(True, state[1:] != state[:-1]))
    decided = begins[state[begins] != 0]
    rise = (state[decided[:-1]] < 0) & (state[decided[1:]] > 0)
    arrived = decided[1:][rise]
    crossings = np.flatnonzero((volts[:-1] < level) & (volts[1:] >= level))
    # Each rise has a crossing before it, since the signal came from below.
    return np.asarray(crossings[np.searchsorted(crossings, arrived) - 1])


def shaft_phase(
    pulses: ArrayLike, n_samples: int, fs: float, *, pulses_per_revolution: int = 1
) -> Float:
    """Phase of the shaft at every sample, from tacho pulses.

    Parameters
    ----------
    pulses : array_like, shape (n_pulses,)
        Pulse times [s], as from `pulse_times`.
    n_samples : int
        Length of the record.
    fs : float
        Sample rate [Hz].
    pulses_per_revolution : int
        Pulses in one revolution. Above 1, phase zero is at the first pulse of the record.

    Returns
    -------
    ndarray, shape (n_samples,)
        Phase [rev], increasing, 0 at the first pulse and negative before it.

    Raises
    ------
    ValueError
        If there are fewer than two pulses, they do not increase, neighbouring intervals differ by a
        factor of 1.8 or more, or the record has no pulse for 1.8 intervals at one end.

    Notes
    -----
    Monotone cubic (PCHIP) through the pulses, with the end slopes beyond them. The speed may drift
    from one revolution to the next; one pulse per revolution does not show speed ripple within a
    revolution, which stays in the signal as frequency modulation.

    References
    ----------
    F. N. Fritsch, J. Butland, "A method for constructing local monotone piecewise cubic
    interpolants", SIAM J. Sci. Stat. Comput. 5 (1984) 300-304, doi:10.1137/0905021.

    Examples
    --------
    >>> shaft_phase([0.1, 0.3], n_samples=5, fs=10.0).round(6).tolist()
    [-0.5, 0.0, 0.5, 1.0, 1.5]
    """
    from scipy.interpolate import PchipInterpolator  # import takes a third of a second

    check_rate(fs)
    times = np.asarray(pulses, dtype=np.float64)
    check_pulses(times, n_samples, fs, pulses_per_revolution)
    turns = np.arange(times.size) / pulses_per_revolution
    curve = PchipInterpolator(times, turns)
    first, last = int(np.ceil(times[0] * fs)), int(np.floor(times[-1] * fs)) + 1
    clock = np.arange(n_samples) / fs
    phase = np.empty(n_samples)
    phase[first:last] = curve(clock[first:last])
    slopes = curve(times[[0, -1]], 1)
    phase[:first] = slopes[0] * (clock[:first] - times[0])
    phase[last:] = turns[-1] + slopes[1] * (clock[last:] - times[-1])
    return phase


def check_pulses(times: Float, n_samples: int, fs: float, per_revolution: int) -> None:
    """Refuse pulses that give no phase.

    Parameters
    ----------
    times : ndarray, shape (n_pulses,)
        Pulse times [s].
    n_samples : int
        Length of the record.
    fs : float
        Sample rate [Hz].
    per_revolution : int
        Pulses in one revolution.

    Raises
    ------
    ValueError
        As for `shaft_phase`.

    Examples
    --------
    >>> check_pulses(np.array([0.1, 0.2, 0.3]), 4, 10.0, 1)  # nothing to say
    """
    check_rate(fs)
    if per_revolution < 1:
        raise ValueError(f"pulses_per_revolution = {per_revolution} must be >= 1; count the teeth")
    if times.ndim != 1 or times.size < 2:
        raise ValueError(f"n_pulses = {times.size} must be >= 2; record two revolutions or more")
    intervals = np.diff(times)
    if not np.all(intervals > 0):
        raise ValueError(f"pulse interval = {intervals.min():.6g} s must be > 0; sort the times")
    if times[0] < 0 or times[-1] > (n_samples - 1) / fs:
        raise ValueError(
            f"pulses = {times[0]:.6g} … {times[-1]:.6g} s must lie in the record, 0 … "
            f"{(n_samples - 1) / fs:.6g} s; give times after its first sample"
        )
    _check_regular(times, intervals, n_samples / fs)


def _check_regular(times: Float, intervals: Float, duration: float) -> None:
    jumps = np.maximum(intervals[1:] / intervals[:-1], intervals[:-1] / intervals[1:])
    if jumps.size and jumps.max() >= INTERVAL_JUMP:
        worst = int(np.argmax(jumps))
        raise ValueError(
            f"ratio of pulse intervals = {jumps[worst]:.3g} at {times[worst + 1]:.6g} s must be < "
            f"{INTERVAL_JUMP}; a pulse is missing or false there, or the shaft stands still: "
            "repair the pulses, cut it out, or check the tacho"
        )
    silence = max(times[0] / intervals[0], (duration - times[-1]) / intervals[-1])
    if silence >= INTERVAL_JUMP:
        raise ValueError(
            f"record without pulses at one end = {silence:.3g} intervals must be < "
            f"{INTERVAL_JUMP}; cut the record to the stretch where the tacho works"
        )


def revolution_weights(phase: ArrayLike) -> Float:
    """Phase increment of each sample, cut off after the last whole revolution.

    Parameters
    ----------
    phase : array_like, shape (n_samples,)
        Phase [rev], increasing, as from `shaft_phase`.

    Returns
    -------
    ndarray, shape (n_samples,)
        Weights [rev] that sum to the number of whole revolutions in the record, zero after them;
        the sample in which the last revolution ends has its share.

    Raises
    ------
    ValueError
        If the phase does not increase or spans less than one revolution.

    Examples
    --------
    >>> revolution_weights([0.0, 0.25, 0.5, 0.75, 1.0]).tolist()
    [0.25, 0.25, 0.25, 0.25, 0.0]
    """
    turns = np.asarray(phase, dtype=np.float64)
    if turns.ndim != 1 or turns.size < 2 or not np.all(np.diff(turns) > 0):
        raise ValueError(f"phase (shape {turns.shape}) must be one increasing row; check the tacho")
    inner = (turns[1:] + turns[:-1]) / 2
    ends = 2 * turns[[0, -1]] - inner[[0, -1]]
    cells = np.concatenate((ends[:1], inner, ends[1:])) - ends[0]
    # Rounding of the pulse times must not lose the last revolution.
    whole = np.floor(cells[-1] + 1e-9)
    if whole < 1:
        raise ValueError(
            f"record = {cells[-1]:.6g} revolutions must be >= 1; record at least one revolution"
        )
    return np.asarray(np.diff(np.minimum(cells, whole)))


def order_amplitudes(x: ArrayLike, phase: ArrayLike, orders: ArrayLike) -> NDArray[Any]:
    """Complex amplitudes of shaft orders, by projection over whole revolutions.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    phase : array_like, shape (n_samples,)
        Shaft phase [rev], as from `shaft_phase`.
    orders : array_like, shape (n_orders,)
        Orders, cycles per revolution [-], > 0.

    Returns
    -------
    ndarray, shape (..., n_orders)
        ``A = (2 / R) integral x exp(-2j pi order phase) d phase`` over the R whole revolutions of
        the record, the mean over time removed [unit of x]:
        ``x = A cos(2 pi order phase + angle)`` gives
        ``A exp(1j angle)``. complex64 for float32, else complex128.

    Raises
    ------
    ValueError
        If an order is not > 0 or exceeds half the sample rate, the lengths differ, or the record is
        shorter than one revolution.

    Notes
    -----
    Integration over phase, not time, keeps whole orders orthogonal while the speed changes. A
    neighbour of amplitude B at a distance d [orders] leaks at most ``2 B / (pi d R)``, and not at
    all if d is a whole number. Amplitudes that change over the record are averaged.

    References
    ----------
    J. R. Blough, "A survey of DSP methods for rotating machinery analysis, what is needed, what
    is available", J. Sound Vib. 262 (2003) 707-720.

    Examples
    --------
    >>> import numpy as np
    >>> phase = np.arange(400) / 100
    >>> amplitudes = order_amplitudes(3 * np.cos(4 * np.pi * phase), phase, [1, 2])
    >>> np.abs(amplitudes).round(6).tolist()
    [0.0, 3.0]
    """
    signal = centred(x)
    turns = np.asarray(phase, dtype=np.float64)
    wanted = np.atleast_1d(np.asarray(orders, dtype=np.float64))
    if turns.shape != signal.shape[-1:]:
        raise ValueError(
            f"phase has {turns.shape} samples, must have {signal.shape[-1:]} as x; use one record"
        )
    weights = revolution_weights(turns)
    _check_orders(wanted, turns)
    return _project(signal, turns, weights, wanted)


def _check_orders(orders: Float, phase: Float) -> None:
    bound = 0.5 / float(np.diff(phase).max())
    if orders.ndim != 1 or not np.all((orders > 0) & (orders < bound)):
        raise ValueError(
            f"orders = {orders.tolist()} must be one row, > 0 and < {bound:.6g}, half the samples "
            "in the fastest revolution; drop the others"
        )


def _project(signal: Real, phase: Float, weights: Float, orders: Float) -> NDArray[Any]:
    """Weighted sum of the signal times the wave of each order, in cache-sized pieces."""
    rows = signal.reshape(-1, signal.shape[-1])
    total = np.zeros((rows.shape[0], orders.size), dtype=np.complex128)
    for start in range(0, phase.size, _CHUNK_SAMPLES):
        part = slice(start, start + _CHUNK_SAMPLES)
        waves = _waves(phase[part], orders, signal.dtype)
        weight = weights[part].astype(signal.dtype)
        total += (rows[:, part] * weight) @ waves.T
    result = (2 / weights.sum()) * total
    kept = np.complex64 if signal.dtype == np.float32 else np.complex128
    return np.asarray(result.astype(kept).reshape(*signal.shape[:-1], orders.size))


def _waves(phase: Float, orders: Float, dtype: np.dtype[Any]) -> NDArray[Any]:
    """``exp(-2j pi order phase)`` [shape=(n_orders, n_samples)]."""
    if not np.array_equal(orders, np.arange(1, orders.size + 1)):
        return np.stack([_wave(phase * order, dtype) for order in orders])
    # Powers of the first order: one complex product each instead of a sine and a cosine.
    first = _wave(phase, dtype)
    waves = np.empty((orders.size, phase.size), dtype=first.dtype)
    waves[0] = first
    for row, following in pairwise(waves):
        np.multiply(row, first, out=following)
    return waves


def _wave(turns: Float, dtype: np.dtype[Any]) -> NDArray[Any]:
    angle = (-2 * np.pi * (turns - np.floor(turns))).astype(dtype)
    wave = np.empty(angle.shape, dtype=np.result_type(dtype, np.complex64))
    wave.real = np.cos(angle)
    wave.imag = np.sin(angle)
    return wave


def default_window(fs: float) -> tuple[int, int]:
    """Length and hop of the short-time window.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].

    Returns
    -------
    nperseg, hop : int
        Power of two nearest to 10 ms, at least 16, and a quarter of it [samples].

    Notes
    -----
    Squared Hann windows a quarter of their length apart add up to a constant, so that the mean of
    the short-time energies is the mean square of the signal.

    Examples
    --------
    >>> default_window(25_600.0)
    (256, 64)
    """
    check_rate(fs)
    nperseg = max(16, 1 << max(0, round(float(np.log2(WINDOW_S * fs)))))
    return nperseg, nperseg // 4


def short_time_energy(x: ArrayLike, fs: float, *, edges: ArrayLike, nperseg: int, hop: int) -> Real:
    """Mean square in every band and every short Hann-windowed frame.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit]; its mean is removed.
    fs : float
        Sample rate [Hz].
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz], as from `line_band_edges`.
    nperseg, hop : int
        Length of a frame and distance to the next one [samples].

    Returns
    -------
    ndarray, shape (..., n_frames, n_bands)
        Mean square [(unit of x)^2]; frame k is centred on sample ``k hop + nperseg / 2``.

    Raises
    ------
    ValueError
        Unless 8 <= nperseg <= n_samples and 1 <= hop <= nperseg / 3, or as for `line_weights`.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(2 * np.pi * 1000 * np.arange(2560) / 25_600)
    >>> energy = short_time_energy(x, 25_600.0, edges=[150, 3000], nperseg=256, hop=64)
    >>> energy.shape, round(float(energy.mean()), 4)
    ((37, 1), 0.5)
    """
    check_rate(fs)
    signal = centred(x)
    _check_frames(nperseg, hop, signal.shape[-1])
    window = hann(nperseg)
    taper = window.astype(signal.dtype)
    scaled = one_sided_scale(window)[:, np.newaxis] * line_weights(nperseg, fs, edges)
    # Real and imaginary parts are adjacent: two equal rows of weights add their squares.
    weights = np.repeat(scaled, 2, axis=0).astype(signal.dtype)
    rows = signal.reshape(-1, signal.shape[-1])
    frames = np.lib.stride_tricks.sliding_window_view(rows, nperseg, axis=-1)[:, ::hop]
    energy = np.empty((*frames.shape[:2], weights.shape[1]), dtype=signal.dtype)
    for row, framed in zip(energy, frames, strict=True):
        for start in range(0, len(framed), _CHUNK_FRAMES):
            part = slice(start, start + _CHUNK_FRAMES)
            halves = rfft(framed[part] * taper).view(signal.dtype)
            np.matmul(np.square(halves, out=halves), weights, out=row[part])
    return energy.reshape(*signal.shape[:-1], *energy.shape[1:])


def _check_frames(nperseg: int, hop: int, n_samples: int) -> None:
    if not 8 <= nperseg <= n_samples:
        raise ValueError(
            f"nperseg = {nperseg} samples must be >= 8 and <= n_samples = {n_samples}; "
            "give a longer record or a shorter window"
        )
    if not 1 <= hop <= nperseg // 3:
        raise ValueError(
            f"hop = {hop} samples must be >= 1 and <= nperseg / 3 = {nperseg // 3}, or some "
            "samples weigh more than others; use nperseg / 4"
        )


def frame_boundaries(phase: ArrayLike, n_frames: int, *, nperseg: int, hop: int) -> Float:
    """Shaft phase half-way between the centres of neighbouring frames.

    Parameters
    ----------
    phase : array_like, shape (n_samples,)
        Shaft phase [rev].
    n_frames : int
        Number of frames.
    nperseg, hop : int
        Length of a frame and distance to the next one [samples].

    Returns
    -------
    ndarray, shape (n_frames + 1,)
        Phase [rev] at samples ``(nperseg - hop) / 2 + k hop``.

    Examples
    --------
    >>> frame_boundaries([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], 2, nperseg=4, hop=1).round(3).tolist()
    [0.15, 0.25, 0.35]
    """
    turns = np.asarray(phase, dtype=np.float64)
    samples = (nperseg - hop) / 2 + hop * np.arange(n_frames + 1)
    below = np.floor(samples).astype(np.intp)
    return np.asarray(turns[below] + (samples - below) * (turns[below + 1] - turns[below]))


def mean_over_angle(energy: ArrayLike, boundaries: ArrayLike, *, angle_bins: int) -> Float:
    """Average of short-time energies in every bin of the shaft angle.

    Parameters
    ----------
    energy : array_like, shape (..., n_frames, n_bands)
        Short-time energies [(unit of x)^2].
    boundaries : array_like, shape (n_frames + 1,)
        Phase at the frame boundaries [rev], as from `frame_boundaries`.
    angle_bins : int
        Bins in one revolution.

    Returns
    -------
    ndarray, shape (..., angle_bins, n_bands)
        Mean energy while the shaft was in the bin [(unit of x)^2]; bin j spans
        ``j / angle_bins`` to ``(j + 1) / angle_bins`` revolutions after the pulse.

    Raises
    ------
    ValueError
        If `angle_bins` < 1, the phase does not increase, or it spans no whole revolution from the
        first bin edge on.

    Notes
    -----
    Each frame's energy is taken as constant between its boundaries and divided among the bins it
    touches in proportion to the time spent there, so that no bin is empty at any speed.

    Examples
    --------
    >>> mean_over_angle([[1.0], [3.0]], [0.0, 0.5, 1.0], angle_bins=2).tolist()
    [[1.0], [3.0]]
    """
    short = np.asarray(energy)
    position = np.asarray(boundaries, dtype=np.float64) * angle_bins
    first, revolutions = _whole_bins(position, angle_bins)
    targets = first + np.arange(revolutions * angle_bins + 1)
    place = np.interp(targets, position, np.arange(position.size))
    frame = np.minimum(place.astype(np.intp), position.size - 2)
    running = np.zeros((*short.shape[:-2], position.size, short.shape[-1]))
    np.cumsum(short, axis=-2, dtype=np.float64, out=running[..., 1:, :])
    part = (place - frame)[:, np.newaxis]
    reached = running[..., frame, :] + part * short[..., frame, :]
    gained = np.diff(reached, axis=-2)
    folded = gained.reshape(*short.shape[:-2], revolutions, angle_bins, short.shape[-1])
    spent = np.diff(place).reshape(revolutions, angle_bins).sum(axis=0)
    mean = folded.sum(axis=-3) / spent[:, np.newaxis]
    return np.asarray(np.roll(mean, first % angle_bins, axis=-2))


def _whole_bins(position: Float, angle_bins: int) -> tuple[int, int]:
    """First bin edge in the record and the number of whole revolutions from there."""
    if angle_bins < 1:
        raise ValueError(f"angle_bins = {angle_bins} must be >= 1; 36 makes bins of 10 degrees")
    if not np.all(np.diff(position) > 0):
        raise ValueError("phase at the frame boundaries must increase; check the tacho")
    # Rounding of the pulse times must not lose a bin at either end.
    first = int(np.ceil(position[0] - 1e-6))
    revolutions = int((position[-1] + 1e-6 - first) // angle_bins)
    if revolutions < 1:
        raise ValueError(
            f"frames span {(position[-1] - position[0]) / angle_bins:.3g} revolutions, must span "
            "one from the first bin edge on; give a longer record"
        )
    return first, revolutions


def crank_angle_map(
    x: ArrayLike,
    fs: float,
    phase: ArrayLike,
    *,
    edges: ArrayLike,
    angle_bins: int = 36,
    nperseg: int | None = None,
    hop: int | None = None,
) -> Float:
    """Mean energy in every band and every bin of the crank angle, over whole revolutions.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    phase : array_like, shape (n_samples,)
        Shaft phase [rev], as from `shaft_phase`; angle 0 is the tacho pulse.
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz], as from `line_band_edges`.
    angle_bins : int
        Bins in one revolution.
    nperseg, hop : int, optional
        Short-time window and step [samples]: see `default_window`; `hop` is nperseg / 4.

    Returns
    -------
    ndarray, shape (..., angle_bins, n_bands)
        Mean square [(unit of x)^2], not its logarithm. Its mean over the bins is the mean square
        of the signal in the band, at constant speed.

    Raises
    ------
    ValueError
        As for `short_time_energy` and `mean_over_angle`.

    Notes
    -----
    A frame belongs to the angle at its centre, so that an impact appears in the bin where it
    happens, spread by the window: half of its energy within ±1 ms at the default, 1.8 degrees at 5
    rev/s. The default resolves bins of 10 degrees up to about 7 rev/s; above, shorten `nperseg`,
    widen the lines, or accept that neighbouring bins look alike.

    References
    ----------
    P. D. McFadden, M. M. Toozhy, "Application of synchronous averaging to vibration monitoring of
    rolling element bearings", Mech. Syst. Signal Process. 14 (2000) 891-906.

    Examples
    --------
    >>> import numpy as np
    >>> phase = np.arange(25_600) / 5120
    >>> x = np.sin(2 * np.pi * 1000 * np.arange(25_600) / 25_600) * (phase % 1 < 0.5)
    >>> energy = crank_angle_map(x, 25_600.0, phase, edges=[150, 3000], angle_bins=4)
    >>> energy[:, 0].round(1).tolist()
    [0.5, 0.5, 0.0, 0.0]
    """
    check_rate(fs)
    length = default_window(fs)[0] if nperseg is None else nperseg
    step = length // 4 if hop is None else hop
    energy = short_time_energy(x, fs, edges=edges, nperseg=length, hop=step)
    boundaries = frame_boundaries(phase, energy.shape[-2], nperseg=length, hop=step)
    return mean_over_angle(energy, boundaries, angle_bins=angle_bins)


def angle_harmonics(profile: ArrayLike, *, n_harmonics: int = 3) -> Float:
    """First Fourier coefficients of the broadband level over one revolution.

    Parameters
    ----------
    profile : array_like, shape (..., angle_bins)
        Mean energy per bin [(unit of x)^2].
    n_harmonics : int
        Number of harmonics.

    Returns
    -------
    ndarray, shape (..., n_harmonics, 2)
        Cosine and sine coefficients of the level [dB], with angles at the bin centres: a level of
        ``c cos(k angle) + s sin(k angle)`` gives (c, s) at k. A gain does not change them.

    Raises
    ------
    ValueError
        Unless 1 <= n_harmonics < angle_bins / 2.

    Examples
    --------
    >>> import numpy as np
    >>> angle = 2 * np.pi * (np.arange(36) + 0.5) / 36
    >>> angle_harmonics(10 ** (0.6 * np.sin(angle)), n_harmonics=1).round(3).tolist()
    [[0.0, 6.0]]
    """
    level = decibel(profile)
    bins = level.shape[-1]
    if not 1 <= n_harmonics < bins / 2:
        raise ValueError(
            f"n_harmonics = {n_harmonics} must be >= 1 and < angle_bins / 2 = {bins / 2}; "
            "ask for fewer or use more bins"
        )
    angle = 2 * np.pi * (np.arange(bins) + 0.5) / bins
    multiples = np.outer(np.arange(1, n_harmonics + 1), angle)
    waves = np.stack((np.cos(multiples), np.sin(multiples)), axis=1)
    return np.asarray(2 / bins * np.einsum("...b,hcb->...hc", level, waves))


def angle_window_level(profile: ArrayLike, start_deg: float, stop_deg: float) -> Float:
    """Mean energy within a window of the shaft angle, relative to the whole revolution.

    Parameters
    ----------
    profile : array_like, shape (..., angle_bins)
        Mean energy per bin [(unit of x)^2].
    start_deg, stop_deg : float
        Window [deg after the pulse], from -360 on; it may extend across 0 or 360. Bins cut by its
        ends count in part.

    Returns
    -------
    ndarray, shape (...)
        Level of the window minus that of the revolution [dB]; 0 for a silent signal.

    Raises
    ------
    ValueError
        Unless -360 <= start < stop <= 720 and the window is at most one revolution.

    Examples
    --------
    >>> float(angle_window_level([10.0, 0.0, 0.0, 0.0], -45.0, 45.0).round(4))
    3.0103
    """
    energy = np.asarray(profile, dtype=np.float64)
    if not (-360 <= start_deg < stop_deg <= 720 and stop_deg - start_deg <= 360):
        raise ValueError(
            f"window = {start_deg} … {stop_deg} deg must increase within -360 … 720 and span <= "
            "360; wrap the angles"
        )
    edges = np.linspace(0.0, 360.0, energy.shape[-1] + 1)
    share = np.zeros(energy.shape[-1])
    for turn in (-360.0, 0.0, 360.0):
        lower = np.maximum(edges[:-1] + turn, start_deg)
        share += np.clip(np.minimum(edges[1:] + turn, stop_deg) - lower, 0.0, None)
    return decibel(energy @ (share / share.sum())) - decibel(energy.mean(axis=-1))


def dead_centre_levels(profile: ArrayLike) -> Float:
    """Energy about and after both dead centres, relative to the whole revolution.

    Parameters
    ----------
    profile : array_like, shape (..., angle_bins)
        Mean energy per bin [(unit of x)^2]; bin 0 starts at a dead centre.

    Returns
    -------
    ndarray, shape (..., 2, 2)
        Levels [dB re the mean over the revolution], first index: dead centre at 0 and at 180
        degrees; second: within 20 degrees on either side of it, within 40 degrees after it.

    Notes
    -----
    A worn crank or wrist pin knocks where the force in the rod changes sign, at or after a dead
    centre. This assumes that the pulse marks a dead centre; otherwise the two windows are just two
    fixed positions.

    Examples
    --------
    >>> import numpy as np
    >>> dead_centre_levels(np.ones(36)).tolist()
    [[0.0, 0.0], [0.0, 0.0]]
    """
    half = DEAD_CENTRE_HALF_WIDTH_DEG
    levels = [
        [
            angle_window_level(profile, c - half, c + half),
            angle_window_level(profile, c, c + 2 * half),
        ]
        for c in (0.0, 180.0)
    ]
    return np.moveaxis(np.asarray(levels), (0, 1), (-2, -1))


def angle_kurtosis(profile: ArrayLike) -> Float:
    """Unevenness of the energy over the revolution.

    Parameters
    ----------
    profile : array_like, shape (..., angle_bins)
        Mean energy per bin [(unit of x)^2].

    Returns
    -------
    ndarray, shape (...)
        Pearson kurtosis of the bins [-]: near 1 for two equal halves, near angle_bins for a single
        knock; 0 if all bins are equal.

    Examples
    --------
    >>> float(angle_kurtosis([1.0, 3.0, 1.0, 3.0]))
    1.0
    """
    return np.asarray(Amplitude(np.asarray(profile, dtype=np.float64)).kurtosis)


def impacts_per_revolution(
    energy: ArrayLike, boundaries: ArrayLike, *, threshold: float = IMPACT_THRESHOLD
) -> Float:
    """Number of peaks of the short-time energy that stand out from its median.

    Parameters
    ----------
    energy : array_like, shape (..., n_frames)
        Broadband short-time energy [(unit of x)^2].
    boundaries : array_like, shape (n_frames + 1,)
        Phase at the frame boundaries [rev].
    threshold : float
        Smallest peak, in medians [-].

    Returns
    -------
    ndarray, shape (...)
        Peaks per revolution [1/rev], over all frames (not only whole revolutions).

    Raises
    ------
    ValueError
        If `threshold` is not > 1 or the phase does not advance.

    Notes
    -----
    A peak is the largest of five frames, one window length at a hop of a quarter: two knocks
    closer than that count as one.

    Examples
    --------
    >>> impacts_per_revolution([1, 1, 1, 9, 1, 1, 1, 1], [i / 4 for i in range(9)]).tolist()
    0.5
    """
    short = np.asarray(energy, dtype=np.float64)
    phase = np.asarray(boundaries, dtype=np.float64)
    if not threshold > 1:
        raise ValueError(f"threshold = {threshold} medians must be > 1; 4 is 6 dB")
    if not phase[-1] > phase[0]:
        raise ValueError(f"phase advance = {phase[-1] - phase[0]} rev must be > 0; check the tacho")
    largest = maximum_filter1d(short, 5, axis=-1, mode="constant", cval=-1.0)
    bound = threshold * np.median(short, axis=-1, keepdims=True)
    peaks = np.count_nonzero((short == largest) & (short > bound), axis=-1)
    return np.asarray(peaks / (phase[-1] - phase[0]))
