"""Force to housing acceleration: the casing as a set of modes, or as it was measured."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft, signal

from ..jit import kernel
from ..output.sensor import padded_spectrum
from ..scene.parts import specific_key
from .casing_frf import Accelerance

PASS_BAND = 0.45
"""Upper edge of the flat band over the sample rate; 11.5 kHz at 25.6 kHz."""

_STOP_ATTENUATION_DB = 80.0

_BLOCK = 1024  # samples of a block, some 50 of which are its ends
_AT_ONCE = 16  # blocks: more are no faster, and a long record must not double in memory


def exact_oscillator(
    frequency: float, damping_ratio: float, step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Exact discretisation of a damped oscillator under a force linear within each step.

    Parameters
    ----------
    frequency : float
        Undamped natural frequency [Hz].
    damping_ratio : float
        0 <= zeta < 1.
    step : float
        [s]

    Returns
    -------
    transition : numpy.ndarray [shape=(2, 2)]
        ``(q, q')`` at the next step per ``(q, q')`` now.
    input_gain : numpy.ndarray [shape=(2, 2)]
        Columns for the modal force now and at the next step, unit modal mass.

    Notes
    -----
    The integral of the impulse response against the linear force in closed form; no time step
    error whatever ``frequency * step`` (first-order hold).

    Examples
    --------
    >>> transition, _ = exact_oscillator(1.0, 0.0, 1.0)  # one whole period
    >>> bool(np.allclose(transition, np.eye(2)))
    True
    """
    w = 2 * math.pi * frequency
    wd = w * math.sqrt(1 - damping_ratio**2)
    a = damping_ratio * w
    decay = math.exp(-a * step)
    cos, sin = decay * math.cos(wd * step), decay * math.sin(wd * step)
    transition = np.array(
        [[cos + a / wd * sin, sin / wd], [-(w**2) / wd * sin, cos - a / wd * sin]]
    )
    # responses from rest to a unit step, and to a unit ramp (the integral of the former)
    step_q, step_v = (1 - transition[0, 0]) / w**2, transition[0, 1]
    ramp_q, ramp_v = (step - step_v - 2 * a * step_q) / w**2, step_q
    slope = np.array([ramp_q, ramp_v]) / step
    return transition, np.column_stack([np.array([step_q, step_v]) - slope, slope])


@kernel
def _respond(
    forces: Any,
    taps: Any,
    inputs: Any,
    outputs: Any,
    stiffness: Any,
    damping: Any,
    transition: Any,
    gain: Any,
    scratch: Any,
    acceleration: Any,
) -> None:
    """Bare modal masses under `forces`, and what springs and dashpots of every mode take back.

    These feel straight lines between the forces filtered by the symmetric `taps`; they start in
    balance with the first of them. `scratch` [shape=(5, n)] holds forces as they are and filtered,
    and of every mode its force, coordinate and rate.
    """
    n, n_inputs = forces.shape
    n_modes, n_outputs = outputs.shape
    half = taps.size // 2
    for i in range(n):
        for j in range(n_inputs):
            raised = 0.0
            for k in range(-half, half + 1):
                raised += taps[half + k] * forces[min(max(i + k, 0), n - 1), j]
            scratch[0, j] = forces[i, j]
            scratch[1, j] = raised
        for k in range(n_outputs):
            acceleration[i, k] = 0.0
        for m in range(n_modes):
            bare, following = 0.0, 0.0
            for j in range(n_inputs):
                bare += inputs[m, j] * scratch[0, j]
                following += inputs[m, j] * scratch[1, j]
            if i == 0:
                scratch[2, m] = following
                scratch[3, m] = following / stiffness[m]
                scratch[4, m] = 0.0
            force, q, v = scratch[2, m], scratch[3, m], scratch[4, m]
            q, v = (
                transition[m, 0, 0] * q
                + transition[m, 0, 1] * v
                + gain[m, 0, 0] * force
                + gain[m, 0, 1] * following,
                transition[m, 1, 0] * q
                + transition[m, 1, 1] * v
                + gain[m, 1, 0] * force
                + gain[m, 1, 1] * following,
            )
            scratch[2, m], scratch[3, m], scratch[4, m] = following, q, v
            felt = bare - damping[m] * v - stiffness[m] * q
            for k in range(n_outputs):
                acceleration[i, k] += outputs[m, k] * felt


@dataclass(frozen=True, kw_only=True)
class CasingModes:
    """Modes of a casing, mass-normalised.

    Attributes
    ----------
    frequency, damping_ratio : numpy.ndarray [shape=(n_modes,)]
        [Hz], [-]
    inputs, outputs : numpy.ndarray [shape=(n_modes, n_inputs)], [shape=(n_modes, n_outputs)]
        Shapes at the forces and at the sensors [kg^-0.5].
    """

    frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]


def _acceleration(
    forces: NDArray[np.float64], taps: NDArray[np.float64], sample_rate: float, modes: CasingModes
) -> NDArray[np.float64]:
    """Acceleration [shape=(n_samples, n_outputs)] where springs feel the forces through `taps`."""
    pairs = [
        exact_oscillator(f, z, 1 / sample_rate)
        for f, z in zip(modes.frequency, modes.damping_ratio, strict=True)
    ]
    omega = 2 * np.pi * modes.frequency
    n_modes, n_inputs = modes.inputs.shape
    acceleration = np.empty((len(forces), modes.outputs.shape[1]))
    _respond(
        forces,
        taps,
        np.ascontiguousarray(modes.inputs),
        np.ascontiguousarray(modes.outputs),
        omega**2,
        2 * modes.damping_ratio * omega,
        np.array([pair[0] for pair in pairs]),
        np.array([pair[1] for pair in pairs]),
        np.empty((5, max(n_modes, n_inputs))),
        acceleration,
    )
    return acceleration


def housing_acceleration(
    forces: NDArray[np.float64], sample_rate: float, modes: CasingModes
) -> NDArray[np.float64]:
    """Acceleration of the housing under forces that are linear between samples.

    Parameters
    ----------
    forces : numpy.ndarray [shape=(n_samples, n_inputs)]
        Forces on the casing [N].
    sample_rate : float
        [Hz]
    modes : CasingModes
        The casing.

    Returns
    -------
    numpy.ndarray [shape=(n_outputs, n_samples)]
        [m/s^2]. The casing starts in static balance with the first forces.

    Notes
    -----
    Each mode obeys ``q'' + 2 zeta w q' + w^2 q = sum_j phi_j F_j``, discretised exactly for a
    force linear between samples. Under a band-limited force its resonances are low by
    ``sinc^2(f / sample_rate)``, the share of the samples' spectrum that straight lines keep;
    :func:`band_limited_acceleration` has no such loss.
    """
    return _acceleration(np.ascontiguousarray(forces), np.ones(1), sample_rate, modes).T


def band_limited_acceleration(
    means: NDArray[np.float64], step_rate: float, factor: int, modes: CasingModes
) -> NDArray[np.float64]:
    """Acceleration of the housing at the sample rate, from means of the forces over steps.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_inputs)]
        Means of the forces on the casing over each step [N].
    step_rate : float
        Steps per second, `factor` times the sample rate.
    factor : int
        At least 2, so that the images of the hold lie beyond the band.
    modes : CasingModes
        The casing.

    Returns
    -------
    numpy.ndarray [shape=(n_outputs, n_steps // factor)]
        [m/s^2], flat to :data:`PASS_BAND` of the sample rate, times as in :func:`decimate`.

    Notes
    -----
    The casing runs at the step rate, before anything is decimated. Its springs and dashpots feel
    straight lines between the means, which lose a sinc squared; they are given the means with
    that loss made up for, so that they and the bare masses, which feel the means as they are,
    cancel each other below the modes as they should.
    """
    means = np.ascontiguousarray(means)
    return decimate(_acceleration(means, line_inverse(), step_rate, modes), factor).T


def casing_inputs(shape: Mapping[str, float], place: str, throw: int) -> float:
    """Mode shape where a force acts: that of the throw, else that of the place, else none.

    Parameters
    ----------
    shape : mapping of str to float
        Mass-normalised shape [kg^-0.5] by place; ``bearing_x`` is good for all throws,
        ``bearing_x_2`` for the second alone, and wins there.
    place : str
        Where the force acts.
    throw : int
        Of which throw it is, counted from 1.

    Returns
    -------
    float
        [kg^-0.5]; 0 where the shape names neither.

    Examples
    --------
    >>> casing_inputs({"bearing_x": 0.1, "bearing_x_2": 0.2}, "bearing_x", 2)
    0.2
    >>> casing_inputs({"bearing_x": 0.1, "bearing_x_2": 0.2}, "bearing_x", 3)
    0.1
    """
    key = specific_key(shape, place, throw)
    return 0.0 if key is None else shape[key]


@dataclass(frozen=True, kw_only=True)
class TableRun:
    """Acceleration from measured frequency response functions, and what they left out.

    Attributes
    ----------
    acceleration : numpy.ndarray [shape=(n_outputs, n_samples)]
        [m/s^2]
    force_share_above : float
        Share of the forces' energy, their means apart, above the table's last line.
    """

    acceleration: NDArray[np.float64]
    force_share_above: float


def table_acceleration(
    means: NDArray[np.float64], step_rate: float, factor: int, accelerance: Accelerance
) -> TableRun:
    """Acceleration of the housing at the sample rate, through measured responses.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_inputs)]
        Means of the forces on the casing over each step [N].
    step_rate : float
        Steps per second, `factor` times the sample rate.
    factor : int
        Steps per sample, >= 1.
    accelerance : Accelerance
        From every force to every sensor.

    Returns
    -------
    TableRun
        Acceleration with the times and the spoilt edges of :func:`band_limited_acceleration`.

    Notes
    -----
    The forces are decimated, their spectrum is multiplied by the accelerance between the lines,
    :meth:`~wearstate.sim.pump.casing_frf.Accelerance.at`, and brought back. The record is padded by
    the length of the response, one over the line spacing, so that its end does not wrap round to
    its beginning. The casing starts in balance with the first forces, as the modes do: they have
    stood there for ever and meet the accelerance at zero frequency.
    """
    rate = step_rate / factor
    held = means[0]
    forces = decimate(means - held, factor).T
    pad = math.ceil(rate / accelerance.spacing)
    edge = edge_samples(factor)
    # the last rows run into zeros: they are led there more gently
    inside = forces[:, : max(1, forces.shape[1] - edge)]
    spectrum, length = padded_spectrum(inside, pad + edge)
    frequency = fft.rfftfreq(length, 1 / rate)
    rows = []
    for values in accelerance.values:  # one sensor at a time: all at once may not fit the memory
        response = replace(accelerance, values=values[None]).at(frequency)[0]
        rows.append(
            fft.irfft(np.sum(response * spectrum, axis=0), length)[: forces.shape[1]]
            + response[:, 0].real @ held
        )
    energy = np.sum((inside - inside.mean(axis=1, keepdims=True)) ** 2)
    beyond = spectrum[:, frequency > accelerance.frequency[-1]]
    above = 2 * np.sum(np.abs(beyond) ** 2) / length  # Parseval; one side of two
    return TableRun(
        acceleration=np.stack(rows),
        force_share_above=float(min(above / energy, 1.0)) if energy > 0 else 0.0,
    )


@lru_cache(maxsize=1)
def line_inverse() -> NDArray[np.float64]:
    """Seven symmetric taps that approximate ``1 / sinc^2`` of the frequency over the rate.

    Their expansion about zero frequency agrees with that of ``(w/2)^2 / sin^2(w/2)``, which is
    ``1 + w^2/12 + w^4/240 + w^6/6048 + …``, to the sixth power of the angular frequency w per
    sample: 0.4 % is left at 0.225 of the rate.
    """
    wanted = np.array([1.0, 1 / 12, 1 / 240, 1 / 6048])
    order = np.arange(4)
    sign = (-1.0) ** order / np.array([math.factorial(2 * n) for n in order])
    # a_0 + 2 sum a_k cos(k w), term by term
    matrix = np.array(
        [
            [float(n == 0) if k == 0 else 2 * s * k ** (2 * n) for k in order]
            for n, s in zip(order, sign, strict=True)
        ]
    )
    side = np.linalg.solve(matrix, wanted)
    return np.concatenate([side[:0:-1], side])


@lru_cache(maxsize=8)
def decimation_filter(factor: int) -> NDArray[np.float64]:
    """Linear-phase low-pass at the step rate, before one sample in `factor` is kept.

    The mean over a step is a low-pass of its own (a sinc); the filter takes its droop back, so
    that the result is flat to :data:`PASS_BAND` of the final rate. Half its length is a whole
    number of kept samples.
    """
    width = (1 - 2 * PASS_BAND) * 2 / factor  # of the fine Nyquist: 0.45 to 0.55 of the rate
    taps, beta = signal.kaiserord(_STOP_ATTENUATION_DB, width)
    half = factor * math.ceil(taps / 2 / factor)
    edge = 1.0 / factor
    grid = np.linspace(0, edge, 129)
    return np.asarray(
        signal.firwin2(
            2 * half + 1,
            np.concatenate([grid, [edge, 1.0]] if factor > 1 else [grid]),
            np.concatenate([1 / np.sinc(grid / 2), [0.0, 0.0] if factor > 1 else []]),
            nfreqs=2**15 + 1,
            window=("kaiser", beta),
        )
    )


def decimate(means: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    """Low-pass what was sampled once a step and keep one in `factor`, without delay.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_columns)]
        Means over steps, or what the casing made of them.
    factor : int
        Steps per sample, >= 1.

    Returns
    -------
    numpy.ndarray [shape=(n_steps // factor, n_columns)]
        Row k belongs to the middle of step ``k * factor``. Within :func:`edge_samples` of either
        end the filter runs into zeros.
    """
    n_kept = means.shape[0] // factor
    edge = edge_samples(factor)
    hop = _BLOCK - 2 * edge
    n_blocks = -(-n_kept // hop)
    padded = np.zeros((means.shape[1], (n_blocks * hop + 2 * edge) * factor))
    padded[:, edge * factor : edge * factor + means.shape[0]] = means.T
    blocks = sliding_window_view(padded, _BLOCK * factor, axis=1)[:, :: hop * factor]
    kept = np.empty((means.shape[1], n_blocks, hop))
    for first in range(0, n_blocks, _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        spectrum = fft.rfft(blocks[:, some])
        spectrum *= _decimation_response(factor)
        kept[:, some] = fft.irfft(_folded(spectrum, factor), _BLOCK)[..., edge : edge + hop]
    return np.ascontiguousarray(kept.reshape(means.shape[1], -1)[:, :n_kept].T)


@lru_cache(maxsize=8)
def _decimation_response(factor: int) -> NDArray[np.float64]:
    """Of the filter over a block; real, since it is symmetric, and led by no delay."""
    taps = decimation_filter(factor)
    half = len(taps) // 2
    circular = np.zeros(_BLOCK * factor)
    circular[: half + 1], circular[-half:] = taps[half:], taps[:half]
    return np.asarray(fft.rfft(circular).real)


def _folded(spectrum: NDArray[np.complex128], factor: int) -> NDArray[np.complex128]:
    """One-sided spectrum of every factor-th sample: the sum of all that look alike there."""
    n = _BLOCK // 2
    folded = spectrum[..., : n + 1].copy()
    for turn in range(1, factor):
        first = turn * _BLOCK
        if 2 * turn < factor:
            folded += spectrum[..., first : first + n + 1]
        else:  # negative frequencies, mirrored
            last = (factor - turn) * _BLOCK
            folded += spectrum[..., last - n : last + 1][..., ::-1].conj()
    return np.asarray(folded / factor)


def edge_samples(factor: int) -> int:
    """Samples at either end of a decimated record that the filter's length spoils."""
    return (len(decimation_filter(factor)) // 2) // factor
