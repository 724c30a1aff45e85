"""Force to housing acceleration: the casing as a set of modes."""

import math
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
def _modal_response(
    forces: NDArray[np.float64],
    inputs: NDArray[np.float64],
    outputs: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    damping: NDArray[np.float64],
    transition: NDArray[np.float64],
    gain: NDArray[np.float64],
    acceleration: NDArray[np.float64],
) -> None:
    """Add every mode's share to the accelerations; starts in static balance with the force."""
    n_modes, n_inputs = inputs.shape
    n_outputs = outputs.shape[1]
    for m in range(n_modes):
        force = 0.0
        for j in range(n_inputs):
            force += inputs[m, j] * forces[0, j]
        q, v = force / stiffness[m], 0.0
        for i in range(forces.shape[0]):
            following = 0.0
            for j in range(n_inputs):
                following += inputs[m, j] * forces[i, j]
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
            acc = force - damping[m] * v - stiffness[m] * q
            for k in range(n_outputs):
                acceleration[k, i] += outputs[m, k] * acc


def housing_acceleration(
    forces: NDArray[np.float64],
    sample_rate: float,
    *,
    frequency: NDArray[np.float64],
    damping_ratio: NDArray[np.float64],
    inputs: NDArray[np.float64],
    outputs: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Acceleration of the housing under forces, by superposition of modes.

    Parameters
    ----------
    forces : numpy.ndarray [shape=(n_samples, n_inputs)]
        Forces on the casing [N], linear between samples.
    sample_rate : float
        [Hz]
    frequency, damping_ratio : numpy.ndarray [shape=(n_modes,)]
        [Hz], [-]
    inputs, outputs : numpy.ndarray [shape=(n_modes, n_inputs)], [shape=(n_modes, n_outputs)]
        Mass-normalised mode shapes at the forces and at the sensors [kg^-0.5].

    Returns
    -------
    numpy.ndarray [shape=(n_outputs, n_samples)]
        [m/s^2]. The casing starts in static balance with the first forces.

    Notes
    -----
    Each mode obeys ``q'' + 2 zeta w q' + w^2 q = sum_j phi_j F_j``, discretised exactly for a
    force linear between samples. Valid below half the sample rate; a mode above it responds
    quasi-statically, which is right for the band that is left.
    """
    pairs = [
        exact_oscillator(f, z, 1 / sample_rate)
        for f, z in zip(frequency, damping_ratio, strict=True)
    ]
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    acceleration = np.zeros((outputs.shape[1], forces.shape[0]))
    _modal_response(
        np.ascontiguousarray(forces),
        np.ascontiguousarray(inputs),
        np.ascontiguousarray(outputs),
        omega**2,
        2 * np.asarray(damping_ratio, dtype=float) * omega,
        np.array([pair[0] for pair in pairs]),
        np.array([pair[1] for pair in pairs]),
        acceleration,
    )
    return acceleration


@lru_cache(maxsize=8)
def decimation_filter(factor: int) -> NDArray[np.float64]:
    """Linear-phase low-pass for step means, before one in `factor` is kept.

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
    """Low-pass step means and keep one in `factor`, without delay.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_columns)]
        Means over steps.
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
