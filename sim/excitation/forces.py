"""Force signals of shakers and hammers.

All are drawn from the seed of the recording. A hammer's pulse is a half sine of the contact time
tau: its spectrum ``cos(pi f tau) / (1 - (2 f tau)^2)`` is 3 dB lower at ``0.59 / tau`` and
zero at ``1.5 / tau``.
"""

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..output.sensor import digitise
from ..scene.exciters import Exciter, ShaftExciter

Float = NDArray[np.float64]

RISE_SHARE = 0.05
"""Share of a burst or sweep in which it fades in, and in which it fades out."""

_BLOW_FROM, _BLOW_TO = 0.05, 0.2  # of the time per blow: nobody hits exactly in time
_REBOUND_AFTER = (0.01, 0.05)  # s, delay of the second hit of a double hit (estimate)
_REBOUND_PEAK = (0.1, 0.5)  # of the first peak (estimate)
_STREAM = 2  # of the seed: 0 is the machine's own, 1 the sensors'
_FADE = 64  # samples over which a steady force is faded in and out, as a jump would ring


class Push(NamedTuple):
    """Force of an exciter on the machine, each [shape=(n_samples,)].

    Attributes
    ----------
    cell : ndarray
        Along the axis of the force cell, which measures it [N].
    along : ndarray
        In the nominal direction [N].
    across : ndarray
        Perpendicular to it, from blows that are not quite straight [N].
    moment : ndarray
        From blows next to their place, about an axis across both shaft and force [N m].
    """

    cell: Float
    along: Float
    across: Float
    moment: Float


def exciter_push(
    part: Exciter,
    *,
    n_samples: int,
    sample_rate: float,
    seed: int,
    index: int = 0,
    lead: int = 0,
    tail: int = 0,
) -> Push:
    """Force of an exciter during a recording.

    Parameters
    ----------
    part : Exciter
    n_samples : int
        Samples of the recording.
    sample_rate : float
        Sampling rate [Hz].
    seed : int
        Seed of the recording.
    index : int
        Index of the exciter in its scene; exciters are independent.
    lead : int
        Samples before the recording in which a steady force (random or stepped sine) already
        acts; bursts, sweeps and blows do not.
    tail : int
        Samples after the recording in which a steady force is faded out.

    Returns
    -------
    Push
        Force of ``lead + n_samples + tail`` samples.

    Examples
    --------
    >>> shaker = Exciter(kind="random", force=20.0, range=200.0)
    >>> push = exciter_push(shaker, n_samples=4096, sample_rate=1024.0, seed=1)
    >>> round(float(push.cell.std()))
    20
    >>> bool((push.cell == push.along).all() and not push.across.any())
    True
    """
    rng = np.random.default_rng([seed, _STREAM, index])
    quiet = round(part.quiet * sample_rate)
    steady = part.kind in _STEADY
    before, after = (0 if quiet or not steady else lead), (tail if steady else 0)
    push = _FORCES[part.kind](part, _Span(before, n_samples - quiet, after), sample_rate, rng)
    if steady:
        gate = _fade(push.cell.size, bool(before or quiet), bool(after))
        push = _straight(gate * push.cell)
    around = (lead + quiet - before, tail - after)
    return Push(*(np.pad(row, around) for row in push))


class _Span(NamedTuple):
    """Samples of a force: before, in and after the recording."""

    before: int
    inside: int
    after: int


def _fade(n: int, comes: bool, goes: bool) -> Float:
    rise = 0.5 * (1 - np.cos(np.pi * (np.arange(_FADE) + 0.5) / _FADE))[: n // 2]
    gate = np.ones(n)
    if comes:
        gate[: rise.size] = rise
    if goes:
        gate[n - rise.size :] = rise[::-1]
    return gate


def _straight(force: Float) -> Push:
    nothing = np.zeros(force.size)
    return Push(force, force, nothing, nothing)


def _random(part: Exciter, span: _Span, sample_rate: float, rng: np.random.Generator) -> Push:
    """Gaussian, flat over the band, drawn a quarter longer than used and so not periodic."""
    n = sum(span)
    size = n + n // 4 + 1
    noise = band_noise(size, sample_rate, part.low, part.high, rng)
    return _straight(part.force * noise[:n])


def band_noise(
    n: int, sample_rate: float, low: float, high: float, rng: np.random.Generator
) -> Float:
    """Gaussian noise of unit rms, flat between two frequencies and zero outside.

    Parameters
    ----------
    n : int
        Number of samples, its period.
    sample_rate, low, high : float
        Sampling rate and band [Hz].
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (n,)
        Noise; its mean square is one on average over realisations.

    Raises
    ------
    ValueError
        No line of n samples lies in the band.

    Examples
    --------
    >>> noise = band_noise(1024, 1024.0, 100.0, 200.0, np.random.default_rng(0))
    >>> power = np.abs(np.fft.rfft(noise)) ** 2
    >>> bool(power[100:201].sum() > 0.999 * power.sum())
    True
    """
    lines = np.fft.rfftfreq(n, 1 / sample_rate)
    inside = (lines >= low) & (lines <= high) & (lines > 0) & (lines < sample_rate / 2)
    count = int(np.count_nonzero(inside))
    if count == 0:
        raise ValueError(
            f"low = {low:g} Hz and high = {high:g} Hz must have a line of {n} samples between "
            f"them, {sample_rate / n:g} Hz apart; widen the band or record longer"
        )
    normal = rng.standard_normal((2, lines.size))
    return np.fft.irfft((normal[0] + 1j * normal[1]) * inside, n) * (n / math.sqrt(4 * count))


def _burst_random(part: Exciter, span: _Span, sample_rate: float, rng: np.random.Generator) -> Push:
    low, high = _ends(part)
    waves = partial(band_noise, sample_rate=sample_rate, low=low, high=high, rng=rng)
    return _straight(_repeated(part, span.inside, waves))


def _ends(part: Exciter) -> tuple[float, float]:
    """Slightly more than the band, to excite all of it."""
    return 0.8 * part.low, 1.05 * part.high


def _sweep(part: Exciter, span: _Span, sample_rate: float, rng: np.random.Generator) -> Push:
    del rng  # the same every time
    waves = partial(sweep_wave, sample_rate=sample_rate, low=part.low, high=part.high)
    return _straight(_repeated(part, span.inside, waves))


def sweep_wave(n: int, sample_rate: float, low: float, high: float) -> Float:
    """A linear sweep through a band, faded in at the lowest and out at the highest frequency.

    Parameters
    ----------
    n : int
        Number of samples.
    sample_rate, low, high : float
        Sampling rate and band [Hz].

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> sweep_wave(5, 100.0, 1.0, 10.0).size
    5
    """
    held = RISE_SHARE * n
    hertz = np.interp(np.arange(n), [held, n - 1 - held], [low, high])
    return np.asarray(np.sin(math.tau * np.cumsum(hertz) / sample_rate))


def _repeated(part: Exciter, n: int, wave: Callable[[int], Float]) -> Float:
    """Bursts with the exciter's rms, one after the other, each faded in and out."""
    force = np.zeros(n)
    starts = np.linspace(0, n, part.repeats + 1).astype(int)
    for start, stop in pairwise(starts):
        size = max(2, round(part.share * (stop - start)))
        burst = burst_gate(size) * wave(size)
        force[start : start + size] = burst * part.force / math.sqrt(np.mean(burst**2))
    return force


def burst_gate(n: int) -> Float:
    """One, with half a cosine at either end over :data:`RISE_SHARE` of it.

    Examples
    --------
    >>> burst_gate(40).round(2)[:4].tolist()
    [0.0, 0.5, 1.0, 1.0]
    """
    from_end = np.minimum(np.arange(n), np.arange(n)[::-1])
    return np.asarray(0.5 * (1 - np.cos(np.pi * np.minimum(1.0, from_end / (RISE_SHARE * n)))))


def _stepped_sine(part: Exciter, span: _Span, sample_rate: float, rng: np.random.Generator) -> Push:
    """One frequency after the other without jumps; the first starts before the recording."""
    del rng
    hertz = stepped_frequencies(part, span.inside / sample_rate)
    edges = np.linspace(0, span.inside, hertz.size + 1).astype(int)
    each = np.pad(np.repeat(hertz, np.diff(edges)), (span.before, span.after), mode="edge")
    phase = math.tau * np.cumsum(each) / sample_rate
    return _straight(math.sqrt(2) * part.force * np.sin(phase))


def stepped_frequencies(part: Exciter, duration: float) -> Float:
    """Frequencies of a stepped sine, evenly spaced, with whole periods in half of a dwell.

    Parameters
    ----------
    part : Exciter
    duration : float
        Total of all dwells [s].

    Returns
    -------
    ndarray, shape (repeats,)
        Frequencies [Hz].

    Examples
    --------
    >>> part = Exciter(kind="stepped-sine", force=1.0, low=10, high=20, repeats=3, range=10.0)
    >>> stepped_frequencies(part, 6.0).tolist()
    [10.0, 15.0, 20.0]
    """
    half = duration / part.repeats / 2
    asked = np.linspace(part.low, part.high, part.repeats)
    return np.asarray(np.maximum(1.0, np.round(asked * half)) / half)


def _hammer(part: Exciter, span: _Span, sample_rate: float, rng: np.random.Generator) -> Push:
    push = Push(*np.zeros((4, span.inside)))
    reach = math.ceil(part.contact_time * sample_rate) + 1
    for blow in _blows(part, span.inside / sample_rate, rng):
        at = np.arange(reach) + math.floor(blow.begin * sample_rate)
        at = at[at < span.inside]
        pulse = half_sine(at / sample_rate - blow.begin, part.contact_time) * blow.peak
        straight, askew = math.cos(blow.angle), math.sin(blow.angle)
        shares = (1.0, straight, askew, straight * blow.offset)
        for row, share in zip(push, shares, strict=True):
            row[at] += share * pulse
    return push


def half_sine(time: Float, contact_time: float) -> Float:
    """Pulse of unit peak, starting at time zero.

    Examples
    --------
    >>> half_sine(np.array([-1.0, 0.5, 2.0]), 1.0).tolist()
    [0.0, 1.0, 0.0]
    """
    share = time / contact_time
    return np.where((share > 0) & (share < 1), np.sin(np.pi * np.clip(share, 0, 1)), 0.0)


class _Blow(NamedTuple):
    begin: float  # s
    peak: float  # N
    angle: float  # rad
    offset: float  # m


def _blows(part: Exciter, duration: float, rng: np.random.Generator) -> list[_Blow]:
    """Blows, with the rebounds of double hits at the place of the first."""
    stretch, count = duration / part.repeats, part.repeats
    begins = stretch * (np.arange(count) + rng.uniform(_BLOW_FROM, _BLOW_TO, count))
    peaks = part.force * rng.lognormal(0.0, part.peak_scatter, count)
    angles = part.angle_scatter * rng.standard_normal(count)
    width = part.place_scatter if isinstance(part, ShaftExciter) else 0.0
    offset = width * rng.standard_normal(count)
    twice = rng.uniform(size=count) < part.double_hits
    delays = rng.uniform(*_REBOUND_AFTER, count) + part.contact_time
    smaller = rng.uniform(*_REBOUND_PEAK, count)
    first = np.stack([begins, peaks, angles, offset], axis=1)
    second = np.stack([begins + delays, peaks * smaller, angles, offset], axis=1)[twice]
    return [_Blow(*map(float, row)) for row in np.concatenate([first, second])]


_Force = Callable[[Exciter, _Span, float, np.random.Generator], Push]

_FORCES: dict[str, _Force] = {
    "random": _random,
    "burst-random": _burst_random,
    "sweep": _sweep,
    "stepped-sine": _stepped_sine,
    "hammer": _hammer,
}
"""Force of every kind. A new kind is one row, and its name in :mod:`.scene.exciters`."""

_STEADY = ("random", "stepped-sine")


def read_cell(
    part: Exciter, force: Float, rng: np.random.Generator
) -> tuple[NDArray[np.float32], int]:
    """Reading of a force by the force cell and its converter; see :func:`.output.sensor.digitise`.

    Examples
    --------
    >>> read_cell(Exciter(range=10.0, bits=8), np.array([20.0]), np.random.default_rng(0))
    (array([10.], dtype=float32), 1)
    """
    return digitise(
        force, gain=part.gain, noise=part.noise, full_scale=part.range, bits=part.bits, rng=rng
    )
