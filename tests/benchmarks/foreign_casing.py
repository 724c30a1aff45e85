"""Casing, accelerometers and tacho of the independent pumps; nothing here is from `wearstate.sim`.

Casing: modes of the scene `bilge-pump` with frequencies, shapes and damping drawn per machine as
widely as its recipe draws them. With structural (hysteretic) damping the accelerance is

    A(f) = sum_r -w^2 phi_r,out phi_r,in / (w_r^2 (1 + i eta_r) - w^2),   eta = 2 zeta,

without it w_r^2 (1 + i eta_r) becomes w_r^2 + 2 i zeta_r w_r w (Ewins, Modal Testing, 2000, ch. 2).
It is applied to the spectrum of the whole run, settling included, whose beginning and end are
faded to the mean force; a filter of half a cosine from 0.45 to 0.5 of the sample rate follows.

Noise: white noise shaped to a level falling with f^-beta, beta 0.2 to 0.8 in amplitude, of half
to twice the nominal rms, per machine. Without the difference: white and nominal.

All is simulated.
"""

import numpy as np
from scipy import fft
from wearstate.sim.output.sensor import Channel

FREQUENCY = np.array([142.0, 388.0, 815.0, 1370.0, 2240.0, 3450.0, 5180.0, 7620.0])
DAMPING_RATIO = np.array([0.04, 0.025, 0.02, 0.02, 0.018, 0.016, 0.015, 0.015])
PLACES = ("bearing_x", "bearing_y", "guide_y", "cylinder_x", "acc_x", "acc_y")
SHAPES = np.array(  # mass-normalised [kg^-0.5], a row per mode
    [
        [0.05, 0.10, 0.13, 0.05, 0.06, 0.13],
        [0.11, -0.04, 0.02, 0.10, 0.12, 0.03],
        [0.06, 0.12, -0.09, -0.03, 0.07, -0.11],
        [0.12, 0.05, 0.04, -0.10, 0.11, 0.05],
        [-0.07, 0.09, 0.11, 0.04, -0.06, 0.12],
        [0.10, -0.06, 0.05, 0.08, 0.10, -0.07],
        [0.05, 0.08, -0.07, 0.02, 0.08, 0.09],
        [0.08, 0.07, 0.06, -0.05, 0.07, -0.08],
    ]
)
NOISE, RANGE, BITS = 0.43, 200 * 9.80665, 24  # [m/s^2], [m/s^2], [-]
PULSE_WIDTH, LEVEL = 1 / 36, 5.0  # of the tacho [revolutions], [V]
CHANNELS = (
    Channel(name="acc_x", unit="m/s^2", quantity="acceleration"),
    Channel(name="acc_y", unit="m/s^2", quantity="acceleration"),
    Channel(name="tacho", unit="V", quantity="tacho"),
)
FADE = 0.05  # [s], ends of a run that are faded
NOISE_CORNER = 10.0  # [Hz], below which coloured noise is level


def accelerance(frequency, seed, *, hysteretic):
    """From four forces to two sensors [shape=(n, 2, 4)] of the machine with this seed."""
    rng = np.random.default_rng([seed, 1])
    centre = 2 * np.pi * FREQUENCY * rng.uniform(0.97, 1.03, 8)
    zeta = DAMPING_RATIO * rng.uniform(0.6, 1.4, 8)
    spread = 0.05 * np.linalg.norm(SHAPES, axis=1, keepdims=True)
    shapes = SHAPES + spread / np.sqrt(SHAPES.shape[1]) * rng.standard_normal(SHAPES.shape)
    w = 2 * np.pi * frequency
    result = np.zeros((len(w), 2, 4), dtype=complex)
    for w_r, z, shape in zip(centre, zeta, shapes, strict=True):
        loss = 2 * z * w_r**2 * np.sign(w) if hysteretic else 2 * z * w_r * w
        gain = -(w**2) / (w_r**2 + 1j * loss - w**2)
        result += gain[:, None, None] * np.outer(shape[4:], shape[:4])
    return result


def housing(forces, steps, rate, seed, *, hysteretic):
    """Acceleration [shape=(2, n_samples)] of the whole run at `rate`, `steps` below the forces'."""
    n = len(forces) // steps
    length = fft.next_fast_len(n, real=True)
    fade = round(FADE * rate * steps)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / fade)
    changing = forces - forces.mean(axis=0)
    changing[:fade] *= ramp[:, None]
    changing[-fade:] *= ramp[::-1, None]
    spectrum = fft.rfft(changing, length * steps, axis=0)[: length // 2 + 1]
    frequency = np.arange(length // 2 + 1) * rate / length
    low_pass = 0.5 + 0.5 * np.cos(np.pi * np.clip((frequency / rate - 0.45) / 0.05, 0, 1))
    response = accelerance(frequency, seed, hysteretic=hysteretic)
    heard = np.einsum("fij,fj->if", response, spectrum) * low_pass
    return fft.irfft(heard, length, axis=1)[:, :n] / steps


def noise(n, rate, machine_seed, rng, *, coloured):
    """Noise of both sensors [shape=(2, n)] [m/s^2]."""
    white = rng.standard_normal((2, n))
    if not coloured:
        return NOISE * white
    drawn = np.random.default_rng([machine_seed, 2])
    level = NOISE * np.exp(drawn.uniform(-np.log(2), np.log(2), 2))
    slope = drawn.uniform(0.2, 0.8, 2)
    frequency = np.maximum(fft.rfftfreq(n, 1 / rate), NOISE_CORNER)
    shaped = fft.irfft(fft.rfft(white) * frequency ** -slope[:, None], n)
    return level[:, None] * shaped / shaped.std(axis=1, keepdims=True)


def tacho(angle, steps, rate, width=PULSE_WIDTH):
    """Pulses [shape=(n_samples,)] of a crank angle at all steps; a sample is a mean over itself."""
    turns, time = angle / (2 * np.pi), np.arange(len(angle)) / (steps * rate)
    whole = np.arange(np.floor(turns[0]), np.ceil(turns[-1]) + 1)
    edges = np.interp(np.sort(np.concatenate([whole, whole + width])), turns, time)
    high = np.cumsum(np.diff(edges, prepend=edges[0]) * (np.arange(len(edges)) % 2))
    borders = (np.arange(len(angle) // steps + 1) - 0.5) / rate
    return LEVEL * rate * np.diff(np.interp(borders, edges, high))


def signal(forces, angle, settled, steps, rate, machine_seed, record_seed, on):
    """Two accelerometers and the tacho [shape=(3, n_samples)], float32.

    Parameters
    ----------
    forces, angle : numpy.ndarray [shape=(n, 4)], [shape=(n,)]
        At all steps, `steps` to a sample.
    settled : int
        Steps before the record begins.
    machine_seed, record_seed : int
        Of casing, gains and colour of the noise; of the noise.
    on : frozenset of str
        Differences.
    """
    first = settled // steps
    heard = housing(forces, steps, rate, machine_seed, hysteretic="casing" in on)[:, first:]
    gain = np.random.default_rng([machine_seed, 3]).uniform(0.95, 1.05, (2, 1))
    rng = np.random.default_rng([record_seed, 4])
    heard = gain * heard + noise(heard.shape[1], rate, machine_seed, rng, coloured="noise" in on)
    step = 2 * RANGE / 2**BITS
    heard = np.round(np.clip(heard, -RANGE, RANGE) / step) * step
    pulses = tacho(angle, steps, rate)[first:]
    return np.vstack([heard, pulses]).astype(np.float32)
