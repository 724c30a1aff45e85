"""What turns and what is measured of the independent propulsion shaft; see `foreign_ross_shaft.py`.

Nominal numbers are those of the scene `propulsion-shaft`, drawn as widely as its recipe says.
"""

from dataclasses import dataclass
from math import log, pi

import numpy as np
from foreign_casing import tacho
from foreign_line_draws import DISCS, Conditions
from scipy import fft

BLADE_RATE = np.array(  # shares of the thrust: up, side, moments over the diameter
    [[0.012, 0.008, 0.004, 0.003], [0.004, 0.003, 0.0015, 0.001], [0.0, 0.0, 0.0, 0.0]]
)
BLADE_PHASE = np.radians([[0.0, 70.0], [140.0, 20.0], [0.0, 0.0]])  # up, side
THIRD = 0.3  # of the second harmonic, where there is a third
UNLIKE_BLADES = 0.005  # of the thrust
TORQUE, RING_RADIUS, UNEVEN_ONCE, UNEVEN_TWICE = 159e3, 0.4, 0.002, 0.2
PULSE_WIDTH = 15 / 360  # of the tacho [revolutions]
SAMPLE_RATE, DURATION = 2560.0, 4.8  # [Hz], [s]
STEPS = 8  # of the shaft's angle per sample, for the tacho's edges
RUN_OUT = np.array([8e-6, 4e-6, 2e-6])  # orders 1 to 3 [m]
PROBES = np.radians([225.0, 135.0])  # from straight down in the direction of rotation
PROBE_NOISE, PROBE_RANGE, PROBE_OFFSET = 0.5e-6, 3e-3, 60e-6  # [m]
PROBE_CURVE = 0.01  # of the reading, at full range
NOISE, RANGE, BITS = 1e-3, 50.0, 24  # [m/s^2], [m/s^2], [-]
MAINS = (50.0, 150.0, 250.0)  # [Hz]
AS_NEW, CONDEMNING = 0.03e-3, 0.9e-3  # wear-down [m]
GRADE_EDGES = (0.2e-3, 0.45e-3, CONDEMNING)
RIPPLE, RIPPLE_BAND = 0.002, 1.0  # of the speed, [Hz]


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What turns with one line, and its sensors; SI."""

    unbalance: np.ndarray  # complex (5,)
    blades: int
    blade_rate: np.ndarray  # as BLADE_RATE, third harmonic included
    blade_phase: np.ndarray
    unlike: complex
    uneven: tuple[float, float, float]  # once, twice, phase
    run_out: np.ndarray  # complex (3,)
    gain: np.ndarray  # accelerometers, probes (7,)
    probe_noise: np.ndarray
    probe_offset: np.ndarray
    level: np.ndarray  # of coloured noise (7,)
    slope: np.ndarray


def parts_draw(seed: int) -> Drawn:
    """Of the machine with this seed."""
    rng = np.random.default_rng([seed, 13])

    def factor(low: float, high: float, n: int | tuple[int, int] | None = None):
        return np.exp(rng.uniform(log(low), log(high), n))

    shares = np.vstack([BLADE_RATE[:2], THIRD * BLADE_RATE[1]]) * factor(0.5, 2.0, (3, 4))
    return Drawn(
        unbalance=DISCS[:, 4] * factor(0.5, 2, 5) * np.exp(2j * pi * rng.uniform(size=5)),
        blades=int(rng.choice([4, 4, 3, 5])),
        blade_rate=shares,
        blade_phase=rng.uniform(0, 2 * pi, (3, 2)),
        unlike=complex(UNLIKE_BLADES * np.exp(2j * pi * rng.uniform())),
        uneven=(
            UNEVEN_ONCE * factor(0.5, 2.0),
            UNEVEN_TWICE * rng.uniform(0.8, 1.2),
            rng.uniform(0, 2 * pi),
        ),
        run_out=RUN_OUT * factor(0.3, 2.0, 3) * np.exp(2j * pi * rng.uniform(size=3)),
        gain=rng.uniform(0.95, 1.05, 7),
        probe_noise=PROBE_NOISE * factor(0.5, 2.0, 2),
        probe_offset=rng.uniform(-PROBE_OFFSET, PROBE_OFFSET, 2),
        level=factor(0.5, 2.0, 7),
        slope=rng.uniform(0.2, 0.8, 7),
    )


def exp_i(angle):
    """A turn by an angle."""
    return np.exp(1j * angle)


def measured(
    part: Drawn,
    run: Conditions,
    place: np.ndarray,
    acceleration: np.ndarray,
    fine: np.ndarray,
    *,
    disturbed: bool,
) -> np.ndarray:
    """Five accelerometers, two probes, tacho [shape=(8, n)], float32.

    Parameters
    ----------
    part, run
        Gains, offsets, noise, run-out; seed of the noise.
    place, acceleration : numpy.ndarray [shape=(2, n)], [shape=(5, n)]
        Of the aft journal from the middle of the bore as new [m], of the housings [m/s^2].
    fine : numpy.ndarray [shape=(n * STEPS,)]
        Angle of the shaft [rad].
    disturbed : bool
        Coloured noise, mains and curved probes.
    """
    angle = fine[::STEPS]
    rng = np.random.default_rng([run.seed, 15])
    read = np.vstack([acceleration, probes(place, angle, part, curved=disturbed)])
    read = part.gain[:, None] * read + noise(part, len(angle), rng, coloured=disturbed)
    full = np.array([RANGE] * 5 + [PROBE_RANGE] * 2)[:, None]
    step = 2 * full / 2**BITS
    read = np.round(np.clip(read, -full, full) / step) * step
    pulses = tacho(fine, STEPS, SAMPLE_RATE, width=PULSE_WIDTH)
    return np.vstack([read, pulses]).astype(np.float32)


def shaft_angle(run: Conditions, n: int, *, ripple: bool) -> np.ndarray:
    """At all steps [rad]."""
    time = np.arange(n) / (SAMPLE_RATE * STEPS)
    angle = run.start_angle + 2 * pi * run.speed_hz * time
    if not ripple:
        return angle
    rng = np.random.default_rng([run.seed, 16])
    tones = RIPPLE_BAND * rng.uniform(0.1, 1.0, 6)
    phases = rng.uniform(0, 2 * pi, (6, 1))
    swing = RIPPLE * run.speed_hz / tones * (2 / 6) ** 0.5  # of the angle, for its rate's rms
    return angle + swing @ np.sin(2 * pi * tones[:, None] * time + phases)


def probes(place: np.ndarray, angle: np.ndarray, part: Drawn, *, curved: bool) -> np.ndarray:
    """Of journal places [shape=(2, n)], before gain and noise [m]."""
    read = []
    for at, offset in zip(PROBES, part.probe_offset, strict=True):
        towards = -np.array([np.cos(at), np.sin(at)]) @ place
        track = np.real(part.run_out @ exp_i(np.arange(1, 4)[:, None] * (angle - at)))
        read.append(towards + track + offset)
    gap = np.array(read)
    return gap * (1 + PROBE_CURVE * np.abs(gap) / PROBE_RANGE) if curved else gap


def noise(part: Drawn, n: int, rng: np.random.Generator, *, coloured: bool) -> np.ndarray:
    """Of all seven sensors [shape=(7, n)]."""
    nominal = np.array([NOISE] * 5 + [PROBE_NOISE] * 2)
    white = rng.standard_normal((7, n))
    phases = rng.uniform(0, 2 * pi, (7, len(MAINS), 1))
    if not coloured:
        return np.concatenate([nominal[:5], part.probe_noise])[:, None] * white
    frequency = np.maximum(fft.rfftfreq(n, 1 / SAMPLE_RATE), 1.0)
    shaped = fft.irfft(fft.rfft(white) * frequency ** -part.slope[:, None], n)
    hum = 2 * pi * np.array(MAINS)[:, None] * np.arange(n) / SAMPLE_RATE
    hum = np.cos(hum + phases).sum(axis=1)
    both = shaped / shaped.std(axis=1, keepdims=True) + hum / len(MAINS) ** 0.5
    return (nominal * part.level)[:, None] * both
