"""Signals over the shaft angle: band-limited resampling, order spectra and maps, averages.

Time samples become points a constant angle apart, so that everything locked to the shaft keeps its
place at any speed.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.fft import rfft
from ..signal.statistics import Real, centred

Float = NDArray[np.float64]

PASSBAND_SHARE = 0.4
"""Highest frequency kept unchanged, as a share of the lower of the two rates [-]: recorders are
flat up to 1 / 2.56 = 0.39 of their sample rate."""

WINDOWS = {
    "boxcar": (1.0,),
    "hann": (1.0, -1.0),
    # ISO 18431-2: a tone between two lines reads at most 0.1 % low.
    "flattop": (1.0, -1.933, 1.286, -0.388, 0.0322),
}
"""Cosine coefficients of periodic windows by name [-]."""

_HALF_WIDTH = 16  # zero crossings of the kernel on either side
_STEPS = 1024  # table entries per zero crossing of the kernel: linear interpolation is 4e-7 off
_KAISER_BETA = 9.62  # 96 dB: smallest maximum error for 16 crossings at 0.4 of the rate
_CHUNK_WEIGHTS = 32_768  # 256 KiB of weights, which fit into a cache

Window = Literal["boxcar", "hann", "flattop"]


@dataclass(frozen=True, kw_only=True)
class AngleSignal:
    """Signal at points a constant shaft angle apart.

    Parameters
    ----------
    signal : ndarray, shape (..., n_points)
        Values [any unit].
    first : int
        Number of the first point; point 0 is at phase 0, the first tacho pulse.
    points_per_revolution : int
        Points in one revolution.

    Examples
    --------
    >>> AngleSignal(signal=np.zeros(6), first=-2, points_per_revolution=4).phase.tolist()
    [-0.5, -0.25, 0.0, 0.25, 0.5, 0.75]
    """

    signal: NDArray[Any]
    first: int
    points_per_revolution: int

    @property
    def phase(self) -> Float:
        """Shaft phase of the points [rev, shape=(n_points,)]."""
        points = self.first + np.arange(self.signal.shape[-1])
        return np.asarray(points / self.points_per_revolution)

    @property
    def revolutions(self) -> int:
        """Number of whole revolutions."""
        return int(self.signal.shape[-1] // self.points_per_revolution)

    @property
    def highest_order(self) -> float:
        """Highest order that is correct [cycles per revolution]."""
        return PASSBAND_SHARE * self.points_per_revolution


# --- band-limited interpolation


@lru_cache(maxsize=2)
def _kernel(dtype: np.dtype[Any]) -> tuple[Real, Real]:
    """Half of a Kaiser-windowed sinc, and the step from each entry to the next."""
    crossing = np.arange(_HALF_WIDTH * _STEPS + 1) / _STEPS
    shape = np.sqrt(1.0 - (crossing / _HALF_WIDTH) ** 2)
    kernel = np.sinc(crossing) * np.i0(_KAISER_BETA * shape) / np.i0(_KAISER_BETA)
    kernel[-1] = 0.0
    return kernel.astype(dtype), np.append(np.diff(kernel), 0.0).astype(dtype)


def _weights(start: Float, share: Float, taps: int, dtype: np.dtype[Any]) -> Real:
    """Weight of `taps` samples, the first `start` before each place [shape=(n_places, taps)]."""
    value, step = _kernel(dtype)
    scale = (share * _STEPS).astype(dtype)
    # In single precision the table position is exact to a thousandth of an entry: 1e-6 of the
    # weight.
    distance = np.arange(taps, dtype=dtype) - start.astype(dtype)[:, np.newaxis]
    distance *= scale[:, np.newaxis]
    np.abs(distance, out=distance)
    np.minimum(distance, _HALF_WIDTH * _STEPS, out=distance)
    entry = distance.astype(np.int32)
    distance -= entry
    distance *= step[entry]
    distance += value[entry]
    # With a sum of exactly one, a constant stays constant.
    distance /= distance.sum(axis=1, keepdims=True)
    return np.asarray(distance)


def interpolate(x: ArrayLike, places: ArrayLike, *, share: ArrayLike = 1.0) -> NDArray[Any]:
    """Band-limited values of a signal between its samples.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit], real or complex.
    places : array_like, shape (n_places,)
        Places, in samples from the first one [-].
    share : array_like, shape () or (n_places,)
        Band kept at each place, as a share of the sample rate's own [-], in (0, 1]: the rate of the
        places if it is lower than the sample rate.

    Returns
    -------
    ndarray, shape (..., n_places)
        Values [unit of x]; single and double precision are kept, other types become float64.

    Raises
    ------
    ValueError
        If a share lies outside (0, 1], or a place is less than ``16 / share`` samples from either
        end of the record, or is not finite.

    Notes
    -----
    Kaiser-windowed sinc with 16 zero crossings on either side, widened by ``1 / share``. With ``r =
    share fs``: a tone below 0.4 r is right to 5e-5 of its amplitude, one above 0.6 r is attenuated
    to 5e-5, in between it is reduced; a constant is exact. The effort grows with the samples
    between the places, hence linearly with the length of the record.

    References
    ----------
    J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc.
    IEEE Int. Symp. Circuits Syst. (1974) 20-23; J. O. Smith, P. Gossett, "A flexible
    sampling-rate conversion method", Proc. IEEE ICASSP (1984) 112-115,
    doi:10.1109/ICASSP.1984.1172555.

    Examples
    --------
    >>> wave = np.cos(0.6 * np.arange(100))
    >>> bool(abs(interpolate(wave, [50.3])[0] - np.cos(0.6 * 50.3)) < 5e-5)
    True
    """
    signal = np.asarray(x)
    if signal.dtype.char not in "fdFD":
        signal = signal.astype(np.float64)
    where = np.atleast_1d(np.asarray(places, dtype=np.float64))
    band = np.broadcast_to(np.asarray(share, dtype=np.float64), where.shape)
    _check_places(where, band, signal.shape[-1])
    found = np.empty((*signal.shape[:-1], where.size), dtype=signal.dtype)
    for part, first, taps in _pieces(where, band, signal.shape[-1]):
        weights = _weights(where[part] - first, band[part], taps, signal.real.dtype)
        windows = np.lib.stride_tricks.sliding_window_view(signal, taps, axis=-1)
        found[..., part] = np.vecdot(weights, windows[..., first, :])
    return found


def _check_places(places: Float, share: Float, n_samples: int) -> None:
    if not np.all((share > 0) & (share <= 1)):
        raise ValueError("share of the band must be > 0 and <= 1; give the lower rate over fs")
    reach = _HALF_WIDTH / share
    inside = (places >= reach) & (places <= n_samples - 1 - reach)
    if not np.all(inside):
        worst = int(np.argmin(inside))
        raise ValueError(
            f"place {worst} = {places[worst]:.6g} must be >= {reach[worst]:.6g} and <= "
            f"{n_samples - 1 - reach[worst]:.6g} samples, or its kernel leaves the record; drop it"
        )


def _pieces(
    places: Float, share: Float, n_samples: int
) -> Iterator[tuple[slice, NDArray[np.intp], int]]:
    """Cache-sized pieces of the places: index, first samples, number of samples."""
    widest = 2 * math.ceil(_HALF_WIDTH / float(share.min(initial=1.0)))
    at_once = max(1, _CHUNK_WEIGHTS // widest)
    for start in range(0, places.size, at_once):
        part = slice(start, start + at_once)
        # The share changes little within a piece, so that few weights are wasted beyond a kernel's
        # end.
        taps = min(2 * math.ceil(_HALF_WIDTH / float(share[part].min())), n_samples)
        first = np.floor(places[part]).astype(np.intp) - taps // 2 + 1
        np.clip(first, 0, n_samples - taps, out=first)
        yield part, first, taps


# --- from time to angle


def _check_increasing(phase: Float) -> None:
    if phase.ndim != 1 or phase.size < 2:
        raise ValueError(f"phase has shape {phase.shape}, must be (n_samples >= 2,); give one row")
    steps = np.diff(phase)
    wrong = np.flatnonzero(~(steps > 0))
    if wrong.size:
        raise ValueError(
            f"phase step after sample {wrong[0]} = {steps[wrong[0]]:.6g} rev must be > 0: the "
            "shaft stands still or reverses there; cut the record to one direction of rotation"
        )


def angular_resample(
    x: ArrayLike, phase: ArrayLike, *, points_per_revolution: int = 256
) -> AngleSignal:
    """Resample a signal to points a constant shaft angle apart.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Signal [any unit], real or complex.
    phase : array_like, shape (n_samples,)
        Shaft phase [rev], increasing, as from `order.shaft_phase`.
    points_per_revolution : int
        Points in one revolution; orders up to 0.4 of it are correct.

    Returns
    -------
    AngleSignal
        Points from the first to the last whose kernel fits into the record: 16 samples (or 16
        points if these are further apart) are lost at either end. dtype kept.

    Raises
    ------
    ValueError
        If lengths differ, a sample is not finite, the phase does not increase, or less than one
        point is left; all faults at once.

    Notes
    -----
    At a speed f, frequencies below ``0.4 min(fs, f points_per_revolution)`` are kept to 5e-5 of
    their amplitude and those above ``0.6 f points_per_revolution`` removed to 5e-5. Nothing aliases
    onto the orders below 0.4 `points_per_revolution`, however slowly the shaft turns, because the
    kernel widens with the time between two points. The speed is assumed to change little during 16
    points.

    References
    ----------
    K. R. Fyfe, E. D. S. Munck, "Analysis of computed order tracking", Mech. Syst. Signal Process.
    11 (1997) 187-205, doi:10.1006/mssp.1996.0056.

    Examples
    --------
    >>> phase = 5 * np.arange(2000) / 1000 + 0.5 * (np.arange(2000) / 1000) ** 2
    >>> angle = angular_resample(np.cos(2 * np.pi * 3 * phase), phase, points_per_revolution=32)
    >>> bool(abs(angle.signal - np.cos(2 * np.pi * 3 * angle.phase)).max() < 1e-4)
    True
    """
    signal, turns = np.asarray(x), np.asarray(phase, dtype=np.float64)
    _check_record(signal, turns, points_per_revolution)
    first = math.ceil(turns[0] * points_per_revolution)
    last = math.floor(turns[-1] * points_per_revolution)
    points = np.arange(first, last + 1)
    places = np.interp(points / points_per_revolution, turns, np.arange(turns.size))
    share = _band_share(turns, places, points_per_revolution)
    kept = _supported(places, share, turns.size)
    return AngleSignal(
        signal=interpolate(signal, places[kept], share=share[kept]),
        first=first + kept.start,
        points_per_revolution=points_per_revolution,
    )


def _check_record(signal: NDArray[Any], phase: Float, points: int) -> None:
    faults = []
    if signal.shape[-1:] != phase.shape:
        faults.append(f"phase has shape {phase.shape}, must have {signal.shape[-1:]} as x")
    elif not np.all(np.isfinite(signal)):
        wrong = int((~np.isfinite(signal)).sum())
        faults.append(f"x has {wrong} non-finite samples, must have 0; cut or repair the recording")
    if points < 4:
        faults.append(f"points_per_revolution = {points} must be >= 4; 256 keeps 102 orders")
    if faults:
        raise ValueError("\n".join(faults))
    _check_increasing(phase)


def _band_share(phase: Float, places: Float, points_per_revolution: int) -> Float:
    """Points per sample at each place, at most one."""
    rate = np.diff(phase) * points_per_revolution
    cell = np.minimum(places.astype(np.intp), rate.size - 1)
    return np.asarray(np.minimum(rate[cell], 1.0))


def _supported(places: Float, share: Float, n_samples: int) -> slice:
    """Places whose kernel fits into the record."""
    reach = _HALF_WIDTH / share
    fits = np.flatnonzero((places >= reach) & (places <= n_samples - 1 - reach))
    if fits.size == 0 or fits[-1] - fits[0] + 1 != fits.size:
        raise ValueError(
            f"record = {n_samples} samples must be > {2 * reach.max(initial=_HALF_WIDTH):.6g}, the "
            "kernel at the slowest place; record longer, or in Python raise points_per_revolution"
        )
    return slice(int(fits[0]), int(fits[-1]) + 1)


# --- spectra over the order


def cosine_window(n: int, name: Window = "hann") -> Float:
    """Periodic cosine-sum window with a mean of one.

    Parameters
    ----------
    n : int
        Length.
    name : {"boxcar", "hann", "flattop"}
        Name, see `WINDOWS`.

    Returns
    -------
    ndarray, shape (n,)
        Weights [-].

    Raises
    ------
    ValueError
        If there is no window of that name.

    Examples
    --------
    >>> cosine_window(4, "hann").round(6).tolist()
    [0.0, 1.0, 2.0, 1.0]
    """
    if name not in WINDOWS:
        raise ValueError(f"window = {name!r} must be one of {', '.join(WINDOWS)}; choose one")
    angle = 2 * np.pi * np.arange(n) / n
    return np.asarray(sum(c * np.cos(k * angle) for k, c in enumerate(WINDOWS[name])))


def order_spectrum(angle: AngleSignal, *, window: Window = "hann") -> tuple[Float, NDArray[Any]]:
    """Amplitude and phase over the order, from the whole revolutions of a record.

    Parameters
    ----------
    angle : AngleSignal
        Real signal from `angular_resample` [any unit]; its mean is removed.
    window : {"boxcar", "hann", "flattop"}
        With "boxcar", whole orders do not leak into each other at all, but half and fractional
        orders leak widely; "flattop" reads any order within 0.1 %, with other orders 5 lines away
        or more.

    Returns
    -------
    orders : ndarray, shape (n_lines,)
        0 up to 0.4 of the points in a revolution, `1 / revolutions` apart [-].
    vector : ndarray, shape (..., n_lines)
        ``A exp(1j a)`` [unit of x] of ``A cos(2 pi order phase + a)``; complex64 for float32.

    Raises
    ------
    ValueError
        If there is less than one revolution.

    Notes
    -----
    A tone between two lines reads low by at most 15 % (1.4 dB) with "hann", 36 % with "boxcar";
    line 0 is 0. Resampling adds 5e-5 of an amplitude.

    References
    ----------
    ISO 18431-2:2004, Mechanical vibration and shock - Signal processing - Part 2.

    Examples
    --------
    >>> wave = 3 * np.cos(2 * np.pi * 2 * np.arange(640) / 64 + 0.5)
    >>> angle = AngleSignal(signal=wave, first=0, points_per_revolution=64)
    >>> orders, vector = order_spectrum(angle)
    >>> [round(float(f(vector[orders == 2][0])), 6) for f in (np.abs, np.angle)]
    [3.0, 0.5]
    """
    revolutions = angle.revolutions
    if revolutions < 1:
        raise ValueError(_too_short(angle, 1))
    n = revolutions * angle.points_per_revolution
    signal = centred(angle.signal[..., :n])
    lines = _line_count(angle, n)
    taper = (cosine_window(n, window) * (2 / n)).astype(signal.dtype)
    vector = rfft(signal * taper)[..., :lines]
    orders = np.arange(lines) / revolutions
    # Phases count from the pulse, not from the first point.
    turn = np.exp(-2j * np.pi * orders * (angle.first / angle.points_per_revolution % revolutions))
    vector = vector * turn.astype(vector.dtype)
    vector[..., 0] = 0
    return orders, vector


def _line_count(angle: AngleSignal, n: int) -> int:
    """Number of lines of an n-point transform up to the highest correct order."""
    return math.floor(angle.highest_order * n / angle.points_per_revolution + 1e-9) + 1


def _too_short(angle: AngleSignal, wanted: int) -> str:
    found = angle.signal.shape[-1] / angle.points_per_revolution
    return f"record = {found:.6g} revolutions must be >= {wanted}; record longer"


@dataclass(frozen=True, kw_only=True)
class OrderMap:
    """Amplitudes over orders and revolutions.

    Parameters
    ----------
    orders : ndarray, shape (n_orders,)
        Orders [-].
    turns : ndarray, shape (n_frames,)
        Shaft phase in the middle of each frame [rev].
    rms : ndarray, shape (..., n_frames, n_orders)
        Rms amplitude, a tone's amplitude over the root of 2 [unit of the signal].

    Examples
    --------
    >>> OrderMap(orders=np.ones(1), turns=np.zeros(2), rms=np.ones((2, 1))).rms.shape
    (2, 1)
    """

    orders: Float
    turns: Float
    rms: Real


def order_map(
    angle: AngleSignal,
    *,
    revolutions: int = 16,
    overlap: float = 0.75,
    window: Window = "flattop",
) -> OrderMap:
    """Rms amplitude over orders and revolutions.

    Parameters
    ----------
    angle : AngleSignal
        Real signal from `angular_resample` [any unit].
    revolutions : int
        Length of a frame [rev]; orders are 1 / revolutions apart.
    overlap : float
        Part that a frame shares with the next one [-], in [0, 1).
    window : {"boxcar", "hann", "flattop"}
        See `order_spectrum`.

    Returns
    -------
    OrderMap
        Map of all frames that fit; dtype of the signal kept.

    Raises
    ------
    ValueError
        Unless 0 <= overlap < 1 and 1 <= revolutions <= those of the record.

    Notes
    -----
    Two orders are resolved if 10 / revolutions apart with "flattop", 4 / revolutions with "hann". A
    constant amplitude A reads ``A / sqrt(2)``, to 0.1 % at any order with "flattop".

    References
    ----------
    A. Brandt, "Noise and Vibration Analysis", 2nd ed., Wiley (2023), chapter 12.

    Examples
    --------
    >>> wave = 3 * np.cos(2 * np.pi * 2.5 * np.arange(6400) / 64)
    >>> angle = AngleSignal(signal=wave, first=0, points_per_revolution=64)
    >>> found = order_map(angle)
    >>> round(float(found.rms[0, found.orders == 2.5][0]), 6)
    2.12132
    """
    _check_map(angle, revolutions, overlap)
    n = revolutions * angle.points_per_revolution
    hop = max(1, round(n * (1 - overlap)))
    signal = centred(angle.signal)
    frames = np.lib.stride_tricks.sliding_window_view(signal, n, axis=-1)[..., ::hop, :]
    taper = (cosine_window(n, window) * (math.sqrt(2) / n)).astype(signal.dtype)
    lines = _line_count(angle, n)
    rms = np.empty((*frames.shape[:-1], lines), dtype=signal.dtype)
    for k in range(frames.shape[-2]):  # one frame at a time, to limit memory
        np.abs(rfft(frames[..., k, :] * taper)[..., :lines], out=rms[..., k, :])
    middles = angle.first + hop * np.arange(frames.shape[-2]) + n / 2
    return OrderMap(
        orders=np.arange(lines) / revolutions,
        turns=middles / angle.points_per_revolution,
        rms=rms,
    )


def _check_map(angle: AngleSignal, revolutions: int, overlap: float) -> None:
    if not 0 <= overlap < 1:
        raise ValueError(f"overlap = {overlap} must be >= 0 and < 1; 0.75 suits most windows")
    if revolutions < 1:
        raise ValueError(f"revolutions = {revolutions} must be >= 1; 16 separate half orders")
    if angle.revolutions < revolutions:
        raise ValueError(_too_short(angle, revolutions))


# --- synchronous average and residual


def synchronous_average(angle: AngleSignal) -> NDArray[Any]:
    """Mean revolution: the part of the signal that repeats with the shaft.

    Parameters
    ----------
    angle : AngleSignal
        Signal from `angular_resample` [any unit], real or complex; its mean is kept.

    Returns
    -------
    ndarray, shape (..., points_per_revolution)
        Mean over the R whole revolutions [unit of x], from phase 0 on; dtype kept.

    Raises
    ------
    ValueError
        If there is less than one revolution.

    Notes
    -----
    Noise falls by the root of R. A non-integer order k keeps ``|sin(pi k R) / (R sin(pi k))|`` of
    its amplitude: a comb filter.

    References
    ----------
    P. D. McFadden, "A revised model for the extraction of periodic waveforms by time domain
    averaging", Mech. Syst. Signal Process. 1 (1987) 83-95, doi:10.1016/0888-3270(87)90085-9.

    Examples
    --------
    >>> angle = AngleSignal(signal=np.array([2.0, 1, 4, 3]), first=1, points_per_revolution=2)
    >>> synchronous_average(angle).tolist()
    [2.0, 3.0]
    """
    if angle.revolutions < 1:
        raise ValueError(_too_short(angle, 1))
    points = angle.points_per_revolution
    whole = angle.signal[..., : angle.revolutions * points]
    folded = whole.reshape(*whole.shape[:-1], angle.revolutions, points)
    mean = folded.mean(axis=-2, dtype=np.result_type(whole.dtype, np.float64))
    rolled = np.roll(mean, angle.first % points, axis=-1)
    return np.asarray(rolled.astype(whole.dtype))


def angular_residual(angle: AngleSignal, average: ArrayLike) -> AngleSignal:
    """Signal over the angle without the part that repeats with the shaft.

    Parameters
    ----------
    angle : AngleSignal
        Signal from `angular_resample` [any unit].
    average : array_like, shape (..., points_per_revolution)
        Mean revolution from `synchronous_average` [same unit].

    Returns
    -------
    AngleSignal
        Same points [unit of x].

    Raises
    ------
    ValueError
        If the average has another number of points.

    Examples
    --------
    >>> angle = AngleSignal(signal=np.array([2.0, 1, 4, 3]), first=1, points_per_revolution=2)
    >>> angular_residual(angle, synchronous_average(angle)).signal.tolist()
    [-1.0, -1.0, 1.0, 1.0]
    """
    mean = np.asarray(average)
    if mean.shape[-1:] != (angle.points_per_revolution,):
        raise ValueError(
            f"average has shape {mean.shape}, must end in {angle.points_per_revolution} points; "
            "average the same resampled signal"
        )
    bins = (angle.first + np.arange(angle.signal.shape[-1])) % angle.points_per_revolution
    return replace(angle, signal=angle.signal - mean[..., bins])
