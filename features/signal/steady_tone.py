"""Steady tone amid louder, varying vibration: of a gear mesh, or of a fan."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from .fft import fast_length, fft, rfft
from .hum import HARMONICS, MAINS_HZ
from .rate import check_rate
from .spectrum import hann

Complex = NDArray[np.complexfloating]
Float = NDArray[np.float64]

_ENOUGH_HZ = 3200.0  # block rate: tones are searched below 1.3 kHz
_FRAME_S = 0.024  # a casing's modes above 0.2 kHz decay within a few frames
_TOP_SHARE = 0.42  # of the block rate: averaging attenuates tones above it
_FEWEST_FRAMES = 64
_TRIED = 6  # bins whose phase advances most evenly
_BESIDE_HZ = 1.0  # distance from a multiple of a supply's frequency: hum
_REACH = 0.75  # of the bin spacing: a tone farther away is nearer to another bin


class SteadyTone(NamedTuple):
    """The steadiest tone of a signal.

    Attributes
    ----------
    frequency_hz : float
        Frequency [Hz].
    amplitude : float
        Amplitude [unit of the signal].
    scatter : float
        Median distance of the short-time amplitudes, as complex numbers, from the tone's own, over
        the tone's amplitude [-]: 0 for a pure tone, 1 or more if something else is louder most of
        the time.
    """

    frequency_hz: float
    amplitude: float
    scatter: float


SILENT: Final = SteadyTone(0.0, 0.0, math.inf)
"""Result for a signal without any tone, or one that is too short."""


def steady_tone(x: ArrayLike, fs: float, *, low_hz: float) -> SteadyTone:
    """Steadiest tone between a given frequency and 1.3 kHz, hum of the mains excluded.

    Parameters
    ----------
    x : array_like, shape (n_samples,)
        Signal [any unit].
    fs : float
        Sample rate [Hz].
    low_hz : float
        Lowest frequency considered [Hz].

    Returns
    -------
    SteadyTone
        Tone of least scatter; :data:`SILENT` for a signal shorter than half a second.

    Raises
    ------
    ValueError
        If a rate or frequency is not positive.

    Notes
    -----
    Samples are averaged in blocks of 0.3 ms and transformed in Hann frames of 24 ms that overlap by
    half. In a bin, all frames of a tone have the same amplitude, and the phase advances by the same
    angle from frame to frame. That angle is where the transform of the phases alone is largest, so
    that louder frames do not dominate it. With this rotation removed, the median distance of the
    frames from their median is the scatter. A mode that rings after every impact has a steady phase
    too, but no steady amplitude.

    Examples
    --------
    >>> t = np.arange(20_000) / 10_000
    >>> blows = 20 * np.exp(-200 * (t % 0.2)) * np.sin(2 * np.pi * 410 * t)
    >>> tone = steady_tone(blows + np.sin(2 * np.pi * 633 * t), 10_000.0, low_hz=100.0)
    >>> round(tone.frequency_hz), round(tone.amplitude, 1), tone.scatter < 0.5
    (633, 1.0, True)
    >>> steady_tone(blows, 10_000.0, low_hz=100.0).scatter > 0.7
    True
    """
    check_rate(fs)
    if not low_hz > 0:
        raise ValueError(f"low_hz = {low_hz} Hz must be > 0")
    blocks, rate = _blocks(np.asarray(x), fs)
    length = max(2, round(_FRAME_S * rate / 2)) * 2
    hop = length // 2
    if blocks.size < (_FEWEST_FRAMES + 1) * hop:
        return SILENT
    lines, bins = _frames(blocks, length)
    bins *= rate / length
    kept = (bins > low_hz - rate / length) & (bins < _TOP_SHARE * rate)
    lines, bins = lines[kept], bins[kept]
    size = np.abs(lines)
    phases = lines / np.where(size > 0, size, 1)
    even = np.abs(np.einsum("ij,ij->i", phases[:, 1:], phases[:, :-1].conj()))
    tried = np.argsort(-even)[:_TRIED]
    tone = _steadiest(lines[tried], phases[tried], bins[tried], rate / hop, low_hz)
    # Averaging in blocks lets this share of the amplitude through.
    passed = float(np.sinc(tone.frequency_hz / rate) / np.sinc(tone.frequency_hz / fs))
    return tone._replace(amplitude=tone.amplitude / passed)


def _blocks(signal: NDArray[np.floating], fs: float) -> tuple[NDArray[np.floating], float]:
    """Means of blocks of samples, and the block rate [Hz]."""
    block = max(1, int(fs / _ENOUGH_HZ))
    samples = signal.astype(np.result_type(signal, np.float32), copy=False)
    whole = samples[: samples.size // block * block].reshape(-1, block)
    return whole @ np.full(block, 1 / block, whole.dtype), fs / block


def _frames(blocks: NDArray[np.floating], length: int) -> tuple[Complex, Float]:
    """Amplitudes of every bin in every frame [shape=(n_bins, n_frames)], and the bin numbers."""
    window = hann(length)
    window = (window * (2 / window.sum())).astype(blocks.dtype)
    frames = sliding_window_view(blocks, length)[:: length // 2]
    lines = np.ascontiguousarray(rfft(frames * window).T)
    return lines, np.arange(len(lines), dtype=np.float64)


def _steadiest(
    lines: Complex, phases: Complex, bins: Float, frame_rate: float, low_hz: float
) -> SteadyTone:
    """Tone of least scatter among those that best fit the phases of each bin."""
    n = lines.shape[-1]
    length = fast_length(2 * n)
    turns = np.abs(fft(np.pad(phases, ((0, 0), (0, length - n)))))
    cycles = np.fft.fftfreq(length)  # per frame
    middle = bins[:, None] / frame_rate
    frequency = frame_rate * (cycles + np.round(middle - cycles))
    near = np.abs(frequency - bins[:, None]) <= _REACH * frame_rate / 2
    best = np.argmax(np.where(near, turns, -1.0), axis=1)
    found = frequency[np.arange(len(best)), best]
    still = lines * np.exp(-2j * np.pi * np.outer(cycles[best], np.arange(n)))
    amplitude = np.median(still.real, axis=1) + 1j * np.median(still.imag, axis=1)
    size = np.abs(amplitude)
    apart = np.median(np.abs(still - amplitude[:, None]), axis=1)
    heard = (found >= low_hz) & ~_is_hum(found) & (size > 0)
    if not heard.any():
        return SILENT
    scatter = np.where(heard, apart / np.where(size > 0, size, 1.0), math.inf)
    i = int(np.argmin(scatter))
    response = _hann_response(2 * float(found[i] - bins[i]) / frame_rate)
    return SteadyTone(float(found[i]), float(size[i]) / response, float(scatter[i]))


def _hann_response(bins: float) -> float:
    """Response of Hann's window to a tone less than one bin away; 1 at the centre of the bin."""
    return float(np.sinc(bins)) / (1 - bins**2)


def _is_hum(frequency: Float) -> NDArray[np.bool_]:
    found = np.zeros(frequency.shape, dtype=np.bool_)
    for mains in MAINS_HZ:
        multiple = np.round(frequency / mains)
        found |= np.isin(multiple, HARMONICS) & (abs(frequency - multiple * mains) < _BESIDE_HZ)
    return found
