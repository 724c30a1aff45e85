"""Force to housing acceleration: the casing as a set of modes."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from .jit import kernel

PASS_BAND = 0.45
"""Upper edge of the flat band over the sample rate; 11.5 kHz at 25.6 kHz."""

_STOP_ATTENUATION_DB = 80.0


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
def _restoring(
    modal_force: NDArray[np.float64],
    outputs: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    damping: NDArray[np.float64],
    transition: NDArray[np.float64],
    gain: NDArray[np.float64],
    acceleration: NDArray[np.float64],
) -> None:
    """Add what springs and dashpots of every mode do; starts in static balance with the force."""
    n_modes, n_samples = modal_force.shape
    for m in range(n_modes):
        force = modal_force[m, 0]
        q, v = force / stiffness[m], 0.0
        for i in range(n_samples):
            following = modal_force[m, i]
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
            force = following
            back = -damping[m] * v - stiffness[m] * q
            for k in range(outputs.shape[1]):
                acceleration[i, k] += outputs[m, k] * back


@dataclass(frozen=True, kw_only=True)
class Modes:
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
    forces: NDArray[np.float64],
    on_springs: NDArray[np.float64],
    sample_rate: float,
    modes: Modes,
) -> NDArray[np.float64]:
    """Bare modal masses under `forces`, and what springs take back under lines of `on_springs`.

    All [shape=(n_samples, n_inputs or n_outputs)].
    """
    pairs = [
        exact_oscillator(f, z, 1 / sample_rate)
        for f, z in zip(modes.frequency, modes.damping_ratio, strict=True)
    ]
    omega = 2 * np.pi * modes.frequency
    acceleration = forces @ (modes.inputs.T @ modes.outputs)
    _restoring(
        np.ascontiguousarray(modes.inputs @ on_springs.T),
        np.ascontiguousarray(modes.outputs),
        omega**2,
        2 * modes.damping_ratio * omega,
        np.array([pair[0] for pair in pairs]),
        np.array([pair[1] for pair in pairs]),
        acceleration,
    )
    return acceleration


def housing_acceleration(
    forces: NDArray[np.float64], sample_rate: float, modes: Modes
) -> NDArray[np.float64]:
    """Acceleration of the housing under forces that are linear between samples.

    Parameters
    ----------
    forces : numpy.ndarray [shape=(n_samples, n_inputs)]
        Forces on the casing [N].
    sample_rate : float
        [Hz]
    modes : Modes
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
    return _acceleration(forces, forces, sample_rate, modes).T


def band_limited_acceleration(
    means: NDArray[np.float64], step_rate: float, factor: int, modes: Modes
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
    modes : Modes
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
    return decimate(_acceleration(means, _raised(means), step_rate, modes), factor).T


def _raised(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means filtered by the inverse of what straight lines between them lose."""
    taps = line_inverse()
    half = len(taps) // 2
    padded = np.concatenate(
        [np.repeat(means[:1], half, axis=0), means, np.repeat(means[-1:], half, axis=0)]
    )
    raised: NDArray[np.float64] = taps[half] * means
    for k in range(half):
        other = len(taps) - 1 - k
        raised += taps[k] * (padded[k : k + len(means)] + padded[other : other + len(means)])
    return raised


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
    taps = decimation_filter(factor)
    kept = signal.upfirdn(taps, means, up=1, down=factor, axis=0)
    first = edge_samples(factor)
    return np.asarray(kept[first : first + means.shape[0] // factor])


def edge_samples(factor: int) -> int:
    """Samples at either end of a decimated record that the filter's length spoils."""
    return (len(decimation_filter(factor)) // 2) // factor
