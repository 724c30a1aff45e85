"""Shaft speed without a tacho, from the harmonics in a vibration, with its uncertainty."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import grey_dilation, maximum_filter1d, percentile_filter
from scipy.special import stdtrit

from ..signal.fft import rfft
from ..signal.rate import check_rate
from ..signal.spectrum import hann

Float = NDArray[np.float64]

FEWEST_REVOLUTIONS = 4
"""Fewest revolutions of the slowest speed in a frame [-]: with fewer, harmonics overlap."""

USUAL_REVOLUTIONS = (16, 32)
"""Revolutions of the slowest speed in a frame if the record is long enough [-]."""

LEAST_EVIDENCE = 3.1
"""Smallest lead of the best speed over every other, and over silence [nepers of power per frame]:
two harmonics 15 dB above the noise, or four whose odd neighbours half the speed would miss."""

HIT_RATIO = 6.0
"""Ratio of a line's power to the adjacent noise that counts neither for nor against a speed [-];
noise alone exceeds it once in 400 lines."""

_PADDING = 2  # spectral lines per resolved line
_LARGEST_HIT, _LARGEST_MISS = 3.0, 1.0  # nepers, so that no single line or gap decides
_QUARTILE = 0.28768  # of exponentially distributed noise, over its mean: ln(4 / 3)
_STEPS_A_LINE = 2  # of the speed grid, per line at the highest harmonic
_HANN_SCATTER = 0.62  # resolved lines, for a tone at a power ratio of 1: calibrated by simulation
_BESIDE = 0.02  # speeds nearer than this count as the same [-]
_OVERLAP = 4  # frames begun within the length of one
_LARGEST_DISAGREEMENT = 0.15  # resolved lines beyond the noise of a harmonic: changing speed
_LEAKAGE_REACH = 10  # resolved lines
_LEAST_SHARE = 1e-6  # of the strongest line, whose side lobes are 58 dB down at that reach


@dataclass(frozen=True, kw_only=True)
class SpeedEstimate:
    """Shaft speed over a record.

    Parameters
    ----------
    times : ndarray, shape (n_frames,)
        Middles of the frames [s].
    speed_hz : ndarray, shape (n_frames,)
        Mean speed within each frame [rev/s].
    deviation_hz : ndarray, shape (n_frames,)
        Standard deviation of the speed in each frame [rev/s].
    mean_hz, low_hz, high_hz : float
        Mean over the frames, and the interval that holds the mean speed of the record [rev/s].
    margin : float
        Lead of the best speed over the next one [nepers of power per frame].
    rival_hz : float
        Next best speed [rev/s]; NaN if the band holds no other.
    n_harmonics : float
        Harmonics used, mean over the frames [-].

    Examples
    --------
    >>> frame = np.array([25.0])
    >>> SpeedEstimate(
    ...     times=frame, speed_hz=frame, deviation_hz=frame, mean_hz=25.0, low_hz=24.9,
    ...     high_hz=25.1, margin=9.0, rival_hz=12.5, n_harmonics=6.0,
    ... ).mean_hz
    25.0
    """

    times: Float
    speed_hz: Float
    deviation_hz: Float
    mean_hz: float
    low_hz: float
    high_hz: float
    margin: float
    rival_hz: float
    n_harmonics: float


def tacholess_speed(
    x: ArrayLike,
    fs: float,
    *,
    band_hz: tuple[float, float],
    n_harmonics: int = 8,
    frame_s: float | None = None,
    largest_rate: float = 0.1,
    confidence: float = 0.95,
) -> SpeedEstimate:
    """Shaft speed from the harmonics of the shaft in a vibration.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Vibration, preferably a velocity, which emphasises low harmonics [any unit]. Not the
        envelope signal of a faulty bearing, whose fault frequency and sidebands form families of
        harmonics, too.
    fs : float
        Sample rate [Hz].
    band_hz : tuple of float
        Band to search for the speed [rev/s]. If it spans less than an octave, two harmonics are
        enough.
    n_harmonics : int
        Harmonics considered at the upper end of the band; lower speeds have more.
    frame_s : float, optional
        Length of a frame [s]; by default a quarter of the record, but at least 16 and at most 32
        revolutions of the lower end of the band; never more than half the record. Shorten it if the
        speed changes fast.
    largest_rate : float
        Largest relative change of the speed [1/s].
    confidence : float
        Probability of the interval [-], in (0, 1).

    Returns
    -------
    SpeedEstimate
        Speed in frames a quarter of their length apart, and the mean with its interval.

    Raises
    ------
    ValueError
        If an argument is out of range or the record too short (all at once); if no harmonic stands
        out of the noise; if another speed explains the spectrum nearly as well (the message names
        both); if the harmonics do not agree, or are lost in a frame.

    Notes
    -----
    Every line of a frame's Hann spectrum is divided by the noise around it (its lower quartile) or
    by the side lobes of stronger adjacent lines, whichever is more. The score of a speed is the sum
    of the logarithms of the lines at its harmonics over a ratio of 6, each limited to -1 … 3, up to
    the harmonic at which the sum is largest. Half the true speed thus loses 1 for every missing odd
    multiple, and twice the speed loses all lines it leaves out. The speed is the path of largest
    sum through all frames that changes no faster than `largest_rate`; it must lead every other by
    3.1 per frame, which takes two harmonics. The peaks of the harmonics must also agree on one
    speed, and those that do in most frames must start at 1 or 2 and must not all be multiples of
    one number: 118 and 236 Hz are not accepted as 23.6 rev/s.

    Within a frame, each harmonic k gives an estimate from the ratios of three Hann lines (Grandke),
    with a standard deviation of ``0.62 / (k T sqrt(ratio))`` (T: length of the frame). They are
    averaged by weight; if they disagree more than that, the deviation is multiplied by the Birge
    ratio. The interval of the mean adds the scatter of the frames about a straight line. It holds
    for a steady or slowly changing speed; it does not include harmonics of another machine at
    nearly the same speed, or a ripple at whole multiples of the speed.

    References
    ----------
    A. M. Noll, "Pitch determination of human speech by the harmonic product spectrum, the harmonic
    sum spectrum, and a maximum likelihood estimate", Proc. Symp. Computer Processing in
    Communications (1969) 779-797; T. Grandke, "Interpolation algorithms for discrete Fourier
    transforms of weighted signals", IEEE Trans. Instrum. Meas. 32 (1983) 350-355,
    doi:10.1109/TIM.1983.4315077; R. T. Birge, "The calculation of errors by the method of least
    squares", Phys. Rev. 40 (1932) 207-227, doi:10.1103/PhysRev.40.207.

    Examples
    --------
    >>> t = np.arange(8000) / 2000
    >>> wave = sum(np.cos(2 * np.pi * k * 24.3 * t + k) for k in range(1, 7))
    >>> wave = wave + 0.5 * np.random.default_rng(0).standard_normal(t.size)
    >>> found = tacholess_speed(wave, 2000.0, band_hz=(10.0, 40.0))
    >>> round(found.mean_hz, 2), found.high_hz - found.low_hz < 0.01
    (24.3, True)
    """
    check_rate(fs)
    signal = np.asarray(x, dtype=np.float64)
    length = _frame_length(signal, fs, band_hz, frame_s)
    _check_speed_request(signal, fs, band_hz, length, n_harmonics, largest_rate, confidence)
    top = min(n_harmonics * band_hz[1], 0.4 * fs)
    power, ratio, starts = _whitened_frames(signal, length, fs, band_hz[1], top)
    line = fs / (length * _PADDING)
    grid = _speed_grid(band_hz, top * length / fs)
    score = _scores(ratio, line, grid, top)
    reach = round(largest_rate * length / _OVERLAP / fs / math.log(grid[1] / grid[0]))
    path, total = _best_path(score, reach)
    rival, rival_hz = _best_rival(score, grid, path, reach, fs / length)
    _check_evidence(total, rival, grid[path], rival_hz)
    times: Float = np.asarray((starts + length / 2) / fs, dtype=np.float64)
    speed, deviation, used = _refined(power, ratio, line, grid[path], top, times)
    mean, half = _mean_interval(speed, deviation, used, signal.size / length, confidence)
    return SpeedEstimate(
        times=times,
        speed_hz=speed,
        deviation_hz=deviation,
        mean_hz=mean,
        low_hz=mean - half,
        high_hz=mean + half,
        margin=total - rival,
        rival_hz=rival_hz,
        n_harmonics=float(used.mean()),
    )


def _frame_length(x: Float, fs: float, band: tuple[float, float], frame_s: float | None) -> int:
    """Samples in a frame; 0 if the arguments allow none."""
    if not (fs > 0 and band[0] > 0):
        return 0
    duration = x.shape[-1] / fs
    few, many = (revolutions / band[0] for revolutions in USUAL_REVOLUTIONS)
    usual = min(max(duration / 4, few), many)
    wanted = min(usual if frame_s is None else frame_s, duration / 2)
    return int(wanted * fs) if wanted > 0 else 0


def _check_speed_request(
    x: Float,
    fs: float,
    band: tuple[float, float],
    length: int,
    n_harmonics: int,
    largest_rate: float,
    confidence: float,
) -> None:
    faults = []
    if x.ndim != 1:
        faults.append(f"x has shape {x.shape}, must be (n_samples,); give one channel")
    if not np.all(np.isfinite(x)):
        faults.append("x must be finite; cut or repair the recording")
    if not 0 < band[0] < band[1] <= 0.4 * fs:
        faults.append(f"band_hz = {band} must increase within 0 … 0.4 fs = {0.4 * fs:.6g} Hz")
    elif length * band[0] < FEWEST_REVOLUTIONS * fs:
        faults.append(
            f"frame = {length / fs:.4g} s (half the record at most) must be >= "
            f"{FEWEST_REVOLUTIONS / band[0]:.4g} s, {FEWEST_REVOLUTIONS} revolutions of the "
            "slowest speed; record longer or raise the lower end of band_hz"
        )
    if n_harmonics < 1:
        faults.append(f"n_harmonics = {n_harmonics} must be >= 1; 8 suits most machines")
    if not largest_rate >= 0:
        faults.append(f"largest_rate = {largest_rate} 1/s must be >= 0; 0.1 is 10 % in a second")
    if not 0 < confidence < 1:
        faults.append(f"confidence = {confidence} must be > 0 and < 1; 0.95 is usual")
    if faults:
        raise ValueError("\n".join(faults))


def _whitened_frames(
    x: Float, length: int, fs: float, highest_speed: float, top: float
) -> tuple[Float, Float, NDArray[np.intp]]:
    """Power of each line, its ratio to the noise [shape=(n_frames, n_lines)], and frame starts."""
    hop = max(1, length // _OVERLAP)
    starts = np.arange(0, x.size - length + 1, hop)
    line = fs / (length * _PADDING)
    lines = min(math.ceil(1.02 * top / line) + 2, length * _PADDING // 2)
    window = hann(length)
    power = np.empty((starts.size, lines))
    for k, start in enumerate(starts):
        frame = x[start : start + length]
        padded = np.zeros(length * _PADDING)
        padded[:length] = (frame - frame.mean()) * window
        power[k] = np.abs(rfft(padded)[:lines]) ** 2
    width = 2 * math.ceil(1.5 * highest_speed / line) + 1
    # Row by row: scipy is fast for one dimension only.
    quartiles = [percentile_filter(row, 25, size=width, mode="mirror") for row in power]
    noise = np.asarray(quartiles) / _QUARTILE
    np.maximum(noise, _leakage(power), out=noise)
    return power, power / np.maximum(noise, np.finfo(float).tiny), starts


def _leakage(power: Float) -> Float:
    """Largest power that other lines can leak into each [shape=(n_frames, n_lines)]."""
    apart = np.arange(-_LEAKAGE_REACH * _PADDING, _LEAKAGE_REACH * _PADDING + 1) / _PADDING
    far = np.maximum(np.abs(apart), 2.0)
    # Envelope of the side lobes of a Hann window, doubled where tones overlap.
    lobes = np.where(np.abs(apart) >= 2, 2 / (np.pi * far * (far**2 - 1)), 1e-30) ** 2
    level = np.log(np.maximum(power, np.finfo(float).tiny))
    near = np.exp(grey_dilation(level, structure=np.log(lobes)[np.newaxis], mode="mirror"))
    return np.asarray(np.maximum(near, power.max(axis=1, keepdims=True) * _LEAST_SHARE))


def _speed_grid(band: tuple[float, float], top_lines: float) -> Float:
    """Speeds so close that the highest harmonic moves by half a line at most."""
    steps = max(2, math.ceil(math.log(band[1] / band[0]) * _STEPS_A_LINE * top_lines))
    return np.geomspace(band[0], band[1], steps + 1)


def _scores(ratio: Float, line: float, grid: Float, top: float) -> Float:
    """Evidence for every speed in every frame [nepers, shape=(n_frames, n_speeds)]."""
    logarithm = np.log(np.maximum(ratio, 1e-12) / HIT_RATIO)
    # The last term only decides between equal speeds on the flanks of the same strong lines.
    lines = np.clip(logarithm, -_LARGEST_MISS, _LARGEST_HIT) + 0.005 * np.maximum(logarithm, 0)
    running = np.zeros((ratio.shape[0], grid.size))
    best = np.zeros_like(running)
    for k in range(1, int(top / grid[0]) + 1):
        within = int(np.searchsorted(grid, top / k, side="right"))
        at = np.rint(k * grid[:within] / line).astype(np.intp)
        running[:, :within] += lines[:, at]
        np.maximum(best[:, :within], running[:, :within], out=best[:, :within])
    return best


def _best_path(score: Float, reach: int) -> tuple[NDArray[np.intp], float]:
    """Speeds (grid numbers) of largest sum that change by at most `reach` steps per frame.

    Returns
    -------
    path : ndarray, shape (n_frames,)
        Grid numbers.
    total : float
        Mean score of the path.
    """
    totals = np.array(score)
    for before, total in pairwise(totals):
        total += maximum_filter1d(before, 2 * reach + 1, mode="nearest")
    path = np.empty(len(score), dtype=np.intp)
    path[-1] = int(np.argmax(totals[-1]))
    for k in range(len(score) - 1, 0, -1):
        start = max(path[k] - reach, 0)
        within = totals[k - 1, start : path[k] + reach + 1]
        # Among equals take the nearest: the speed does not change without need.
        equal = start + np.flatnonzero(within == within.max())
        path[k - 1] = equal[np.argmin(np.abs(equal - path[k]))]
    return path, float(totals[-1].max()) / len(score)


def _best_rival(
    score: Float, grid: Float, path: NDArray[np.intp], reach: int, resolution: float
) -> tuple[float, float]:
    """Mean score and mean speed of the best path that stays clear of the given one."""
    found = grid[path][:, np.newaxis]
    margin = np.maximum(_BESIDE, 2 * resolution / found)
    away = np.where(np.abs(np.log(grid / found)) > margin, score, -np.inf)
    if not np.all(np.isfinite(away).any(axis=1)):
        return 0.0, math.nan
    other, total = _best_path(away, reach)
    if not np.isfinite(total):
        return 0.0, math.nan
    return total, float(grid[other].mean())


def _check_evidence(total: float, rival: float, path_hz: Float, rival_hz: float) -> None:
    if total < LEAST_EVIDENCE:
        raise ValueError(
            f"evidence for {path_hz.mean():.4g} rev/s = {total:.3g} nepers must be >= "
            f"{LEAST_EVIDENCE}: no harmonics stand out; record longer, choose longer frames, "
            "use a sensor nearer to the shaft, or a tacho"
        )
    if total - rival < LEAST_EVIDENCE:
        raise ValueError(
            f"evidence for {path_hz.mean():.4g} over {rival_hz:.4g} rev/s = {total - rival:.3g} "
            f"nepers must be >= {LEAST_EVIDENCE}: the speed is ambiguous; narrow band_hz round "
            "the true one, or use a tacho"
        )


# --- refinement to a fraction of a line


def _refined(
    power: Float, ratio: Float, line: float, coarse: Float, top: float, times: Float
) -> tuple[Float, Float, Float]:
    """Speed, its standard deviation [rev/s] and the harmonics used, in every frame."""
    results = [
        _refined_frame(*frame, line, top) for frame in zip(power, ratio, coarse, strict=True)
    ]
    lost = [k for k, (_, _, numbers) in enumerate(results) if numbers.size == 0]
    if lost:
        raise ValueError(
            f"frame at {times[lost[0]]:.4g} s has 0 clear harmonics of {coarse[lost[0]]:.4g} "
            "rev/s, must have >= 1; cut the record there, or choose longer frames"
        )
    _check_numbers([numbers for _, _, numbers in results], coarse)
    speed, deviation = np.array([result[:2] for result in results]).T
    return speed, deviation, np.array([float(numbers.size) for _, _, numbers in results])


def _check_numbers(numbers: list[NDArray[np.intp]], coarse: Float) -> None:
    """Refuse harmonics without a low one, or with a common divisor, in half of the frames."""
    found, counts = np.unique(np.concatenate(numbers), return_counts=True)
    usual = found[counts >= len(numbers) / 2]
    if usual.size == 0 or usual[0] > 2 or np.gcd.reduce(usual) > 1:
        raise ValueError(
            f"harmonics that agree on {coarse.mean():.4g} rev/s in most frames = {usual.tolist()} "
            "must have 1 or 2 among them and no common divisor: lines of another origin; narrow "
            "band_hz, use a sensor nearer to the shaft, or a tacho"
        )


def _refined_frame(
    power: Float, ratio: Float, coarse: float, line: float, top: float
) -> tuple[float, float, NDArray[np.intp]]:
    """Speed, standard deviation [rev/s] and numbers of the harmonics that agree on it."""
    numbers = np.arange(1, int(top / coarse) + 1)
    speed, used = coarse, np.ones(numbers.size, dtype=bool)
    for _ in range(4):  # low harmonics first: each pass brings higher ones within reach
        expected = np.asarray(speed * numbers / line, dtype=np.float64)
        own, height = _own_estimates(power, ratio, expected)
        clear = height > 2 * HIT_RATIO
        deviation = _HANN_SCATTER * _PADDING / np.sqrt(np.maximum(height, 1.0))  # [lines]
        off = np.abs(own - expected)
        used = clear & (off <= _LARGEST_DISAGREEMENT * _PADDING + 3 * deviation)
        chosen = used if used.any() else clear
        if not chosen.any():
            return coarse, 0.0, numbers[:0]
        weights = (numbers / deviation)[chosen] ** 2
        speed = float(np.average((own / numbers)[chosen], weights=weights)) * line
    estimates = (own * line / numbers)[chosen]
    spread = float(np.sum(weights * ((estimates - speed) / line) ** 2))
    birge = math.sqrt(max(1.0, spread / max(estimates.size - 1, 1)))
    return speed, birge * line / math.sqrt(float(weights.sum())), numbers[used]


def _own_estimates(power: Float, ratio: Float, expected: Float) -> tuple[Float, Float]:
    """Position [lines] and ratio of the peak within a resolved line of each expected position.

    A peak at the edge of its search range has the ratio 0.
    """
    around = np.arange(-_PADDING, _PADDING + 1)
    rim = 2 * _PADDING
    middle = np.clip(np.rint(expected).astype(np.intp), rim, ratio.size - 1 - rim)
    near = power[middle[:, np.newaxis] + around]
    at = np.argmax(near, axis=1)
    peak = middle + around[at]
    # Amplitudes one resolved line to either side over the peak's: each gives the shift of a tone.
    sides = power[np.stack((peak - _PADDING, peak + _PADDING))]
    alpha = np.sqrt(sides / np.maximum(power[peak], np.finfo(float).tiny))
    below, above = (2 * alpha - 1) / (1 + alpha)
    inner = (at > 0) & (at < around.size - 1)
    return peak + _PADDING * (above - below) / 2, np.where(inner, ratio[peak], 0.0)


def _mean_interval(
    speed: Float, deviation: Float, used: Float, independent: float, confidence: float
) -> tuple[float, float]:
    """Mean over the frames, and half width of its interval."""
    noise = float(np.mean(deviation**2))
    drift = max(_scatter(speed) - noise, 0.0)
    # Errors of neighbouring frames partly cancel, since their phases are continuous: the variance
    # of noise falls with the third power of the length, of which the second is taken. Drift between
    # frames falls with the first, and the ends of the record count less than its middle.
    variance = noise / independent**2 + drift / max(independent / 2, 1.0)
    freedom = max(min(2 * independent - 2, float(used.sum()) / _OVERLAP - 1), 1.0)
    quantile = float(stdtrit(freedom, (1 + confidence) / 2))
    return float(speed.mean()), quantile * math.sqrt(variance)


def _scatter(speed: Float) -> float:
    """Variance of the frames about a straight line."""
    if speed.size < 3:
        return 0.0
    frame = np.arange(speed.size) - (speed.size - 1) / 2
    slope = float(frame @ speed) / float(frame @ frame)
    bent = speed - speed.mean() - slope * frame
    return float(bent @ bent) / (speed.size - 2)
