"""Spectral kurtosis and kurtogram: the band in which a signal is most impulsive."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided, sliding_window_view
from numpy.typing import ArrayLike, NDArray

from .envelope import Band, checked_signal
from .fft import fast_length, ifft, rfft
from .rate import check_rate
from .spectrum import hann
from .statistics import Real

Float = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

DEEPEST_LEVEL = 7
"""Default depth: 128 bands, each 1/256 of the sample rate wide."""

FEWEST_SAMPLES_LOG2 = 7
"""Binary logarithm of the samples that level 0 needs; each further level doubles them. The finest
bands then have 64 independent samples."""

SETTLING = 4.0
"""Length of the tapers at the ends of the record, and of the part left out after each, in samples
of the finest band [-]: leakage beyond them lies 80 dB or more below the record."""

SILENCE = 1e-8
"""Mean square of a band, as a share of the record's, below which it may be leakage alone [-]."""

LONE_SHARE = 1 / 3
"""Share of a band's fourth moment within `_LONE_PARTS` of the record that marks a lone event [-]:
impacts that recur four times or more leave less than that in each eighth of the record."""

FEWEST_FRAMES, MANY_FRAMES = 64, 256
"""Numbers of frames [-]: from the first on, spectral kurtosis looks for lone events (with fewer,
noise can reach any share); below the second, a third is reached by every tenth line of noise, a
half by none."""

LONE_SHARE_OF_FEW = 1 / 2
"""`LONE_SHARE` below `MANY_FRAMES` [-]."""

FEWEST_POOLED = 31
"""Fewest frames for any search for lone events [-], below `FEWEST_FRAMES` over neighbouring lines
together; the default frames leave at least that many."""

MOST_LONE = 3
"""Lone events left out of a band [-]; more than that count as recurring."""

_PARTS = 16  # of a record, searched for lone events
_LONE_PARTS = 2  # adjacent: an event may lie on the boundary of two

_POOLED_LINES = 9  # averaged in spectral kurtosis; a third of their noise is shared
LINE_SILENCE = 1e-12  # of the power of all lines; below it is rounding
_INDEPENDENCE = 0.703  # samples a flanked band holds per independent fourth moment, times its width
CHUNK = 32_768  # complex samples transformed at a time, half a megabyte

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
        0 for stationary Gaussian noise, -1 for a tone of constant amplitude, above 0 for impacts
        [-]; also -1 for silence. Precision of `x` kept.

    Raises
    ------
    ValueError
        As for `checked_signal`, or if `nperseg` is odd, below 16, or leaves fewer than 4 frames.

    Notes
    -----
    ``(K + 1) / (K - 1) (<|X|^4> / <|X|^2>^2 - 1) - 1`` over K frames, the form of
    ``<|X|^4> / <|X|^2>^2 - 2`` that is free of bias for Gaussian noise and independent frames at
    any K; the overlap leaves a bias of ``-1 / (9 K)``. Standard deviation on such noise
    ``2 / sqrt(K)``. The lines at either end are left out: they overlap their own mirror image and
    have a different scatter.

    Lone events are left out line by line, by the rule of `kurtogram`, if there are 256 frames or
    more; from 64 frames on if they make up half of a line's ``<|X|^4>``; from 31 on if they make up
    half of it in the mean of nine neighbouring lines. K then counts the remaining frames. In noise,
    one line in a hundred loses some.

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
    silence = LINE_SILENCE * parts[0].sum(axis=(-1, -2))[..., np.newaxis]
    spread = _over(n_left * fourth, second**2, silence=silence)
    kurtosis = (n_left + 1) / (n_left - 1) * (spread - 1) - 1
    inner = slice(2, length // 2 - 1)
    frequency = np.arange(length // 2 + 1)[inner] * (fs / length)
    return frequency, kurtosis[..., inner].astype(signal.dtype)


def _pooled(fourth: Float) -> Float:
    """Share of each part in the fourth moment, averaged over a line and its neighbours.

    With few frames, the largest value of a line of noise may lie in a single frame; an event
    appears in all lines of its neighbourhood.
    """
    total = fourth.sum(axis=-1, keepdims=True)
    share = np.divide(fourth, total, out=np.zeros_like(fourth), where=total > 0)
    width = min(_POOLED_LINES, share.shape[-2] // 2 * 2 - 1)
    ends = [(0, 0)] * (share.ndim - 2) + [(width // 2, width // 2), (0, 0)]
    padded = np.pad(share, ends, mode="reflect")
    return np.asarray(sliding_window_view(padded, width, axis=-2).mean(axis=-1))


def _begins(n: int, n_parts: int) -> NDArray[np.intp]:
    """First sample or frame of each part of the record, of n in all [shape=(n_parts,)]."""
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
    step = max(1, CHUNK // length)
    for part, (begin, end) in enumerate(pairwise([*begins.tolist(), n_frames])):
        for start in range(begin, end, step):
            lines = rfft(frames[..., start : min(start + step, end), :] * window)
            power = np.square(lines.real) + np.square(lines.imag)
            second[..., part] += power.sum(axis=-2)
            fourth[..., part] += np.square(power).sum(axis=-2)
    return second, fourth


def _over(above: Float, below: Float, *, silence: Float) -> Float:
    """Quotient; 1, its minimum, if the root of the divisor is not above `silence`."""
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
        One per row, from the lowest band to the highest [-]: 0 for stationary Gaussian noise, -1
        for a tone of constant amplitude or silence. Lone events are left out, see `kurtogram`.
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
        """Row and number of the band of largest kurtosis; among equals, the widest."""
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
        """Largest kurtosis, in standard deviations of that of noise in the same band [-].

        Noise scores 2 to 4, and 7 in one record of a hundred; tones and silence score 0.
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
        """Kurtosis as a picture: one row per level, each band drawn at its width.

        Returns
        -------
        ndarray, shape (n_rows, 3 * 2**levels)
            Kurtosis [-]; the columns divide 0 … fs / 2 evenly.
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
        Depth of the tree: the narrowest bands are ``fs / 2 / 2**levels`` wide. By default 7, or as
        many as the length of the record allows. To show a fault line and its harmonics, a band must
        be several fault frequencies wide.

    Returns
    -------
    Kurtogram
        Kurtogram with the band of largest kurtosis.

    Raises
    ------
    ValueError
        As for `checked_signal`, or if `x` is not one row, or unless 1 <= levels <= log2(n_samples)
        - 7.

    Notes
    -----
    Each row divides 0 … fs / 2 into 1, 2, 3, 4, 6, 8, 12 … bands, the tree of the reference. The
    reference filters and decimates from level to level; here every band is a slice of one Fourier
    transform with smooth flanks half a band wide, transformed back at 1.5 times its bandwidth. The
    kurtosis of the complex envelope z is ``<|z|^4> / <|z|^2>^2 - 2``. The ends of the record are
    tapered and left out, 16 samples of the finest band in total, so that the step between them does
    not count as an impact.

    With n independent samples in a band (remaining time times bandwidth), noise scatters by about
    ``2 / sqrt(n)`` (`Kurtogram.deviation`). The largest of all bands is then a narrow one at 2 to 4
    times that, 7 in one record of a hundred.

    A single impact would have a higher kurtosis than a train of them, but is not a recurring
    defect. If an eighth of the record holds more than a third of a band's ``<|z|^4>``, it is left
    out of both means; this is repeated on the remainder, up to three times. A train of four impacts
    or more is not affected, and noise almost never.

    References
    ----------
    J. Antoni, "Fast computation of the kurtogram for the detection of transient faults", Mech.
    Syst. Signal Process. 21 (2007) 108-124, doi:10.1016/j.ymssp.2005.12.002.

    Examples
    --------
    An impact every 50 ms that rings at 3.5 kHz, in noise:

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
    inside = (kept[1] - kept[0]) * lines.size * 4 / 3  # samples of the record that remain
    return Kurtogram(
        fs=fs,
        level=np.log2(counts),
        kurtosis=tuple(_over(fourth, second**2, silence=silence) - 2 for second, fourth in moments),
        deviation=2 * np.sqrt(_INDEPENDENCE * 2 * np.array(counts) / inside),
    )


def kurtogram_levels(n_samples: int, fs: float, span: float) -> int:
    """Depth of a kurtogram whose narrowest bands still cover the frequencies of interest.

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
        Depth for `kurtogram`, >= 1.

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
    """Numbers of bands: powers of two, and three times all but the last two: 1, 2, 3, 4, 6, 8 …."""
    return sorted({1 << k for k in range(depth + 1)} | {3 << k for k in range(depth - 1)})


def _tapered_lines(signal: Real, depth: int) -> tuple[Complex, tuple[float, float]]:
    """Lines of the tapered record below fs / 2, and the part of the inverse transform to use.

    The record, scaled to an rms of 1, is zero-padded so that every row divides its half spectrum
    into bands with flanks of whole lines. Zeros fill the lines below 0 and above fs / 2.
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

    Arguments: the contributions of each part of the record to both means [shape=(count, _PARTS)].
    """
    kept = _without_lone(fourth, LONE_SHARE)
    share = kept.mean(axis=-1)
    return (second * kept).sum(axis=-1) / share, (fourth * kept).sum(axis=-1) / share


def _without_lone(fourth: Float, most: float) -> Float:
    """Weight of each part: 0 at a lone event, else 1 [shape=(..., n_parts)].

    `fourth` holds what each part adds to the fourth moment, `most` the largest share that adjacent
    parts may have; see `kurtogram`.
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
    """Contribution of each part of the record to mean |z|^2 and |z|^4 [shape=(count, _PARTS) each].

    `lines` begin a quarter of their number below 0, padded with zeros, and end as far above fs / 2.
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
    rows = max(1, CHUNK // n)
    for start in range(0, count, rows):
        part = slice(start, start + rows)
        wave = ifft(slices[part] * weight)[:, first:past].view(weight.dtype)
        np.square(wave, out=wave)
        power = wave[:, ::2] + wave[:, 1::2]
        second[part] = np.add.reduceat(power, begins, axis=-1, dtype=np.float64)
        # A dot product would start BLAS threads, which cost more than they save on a busy machine.
        np.square(power, out=power)
        fourth[part] = np.add.reduceat(power, begins, axis=-1, dtype=np.float64)
    return second / (past - first), fourth / (past - first)


def _flanks(width: int) -> Float:
    """Weights of the lines of a band: its squares and its neighbours' add up to 1.

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
