"""Readings of the pressure transmitters at a pump's cylinders."""

import math

import numpy as np
from numpy.typing import NDArray

from ..output.sensor import digitise, low_pass, mounting_poles
from ..parts.sensors import PressureSensor
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import PIPED_RUNGS, STANDARD_ATMOSPHERE

Float = NDArray[np.float64]


def cylinder_pressure(scene: PumpScene, force: Float) -> Float:
    """Gauge pressure on a piston with the liquid's force `force` along x [Pa].

    Valid for every rung, including the inertia of the columns that *heads* adds.
    """
    return np.asarray(-force / (math.pi / 4 * scene.piston.diameter**2))


def read_pressures(
    scene: PumpScene, pressures: list[Float], kept: slice, rng: np.random.Generator
) -> tuple[list[NDArray[np.float32]], int]:
    """Channels of the pressure sensors, and the number of clipped samples.

    Parameters
    ----------
    scene : PumpScene
    pressures : list of numpy.ndarray [shape=(n,)]
        Pressure on the piston of every sensor's throw at all samples [Pa gauge], band-limited like
        the accelerations.
    kept : slice
        Recorded samples: lines and transmitters have settled before them.
    rng : numpy.random.Generator
        Source of the noise.
    """
    rows, clipped = [], 0
    for (_, sensor), pressure in zip(scene.pressure_sensors, pressures, strict=True):
        row, lost = read_pressure(sensor, _lagged(sensor, pressure, scene.sample_rate)[kept], rng)
        rows.append(row)
        clipped += lost
    return rows, clipped


def pressures_at_rest(
    scene: PumpScene, n_samples: int, rng: np.random.Generator
) -> tuple[list[NDArray[np.float32]], int]:
    """Like :func:`read_pressures`, with the crank at rest and all cylinders at suction pressure."""
    rows, clipped = [], 0
    for throw, sensor in scene.pressure_sensors:
        pressure = scene.pressures(throw)
        rest = pressure.at_pump[0] if pressure.rung in PIPED_RUNGS else pressure.suction
        level = np.full(n_samples, rest)
        row, lost = read_pressure(sensor, level, rng)
        rows.append(row)
        clipped += lost
    return rows, clipped


def read_pressure(
    sensor: PressureSensor, pressure: Float, rng: np.random.Generator
) -> tuple[NDArray[np.float32], int]:
    """Reading of a transmitter and its converter for a pressure at the membrane.

    Parameters
    ----------
    sensor : PressureSensor
    pressure : ndarray, shape (n_samples,)
        Gauge pressure [Pa], band-limited.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    signal : ndarray, shape (n_samples,)
        float32 [Pa], between absolute vacuum and the upper end of the range.
    clipped : int
        Samples above the range. Vacuum does not clip: there the liquid leaves the membrane.

    Examples
    --------
    >>> sensor = PressureSensor(range=1e6, gain=1.02, offset=500.0)
    >>> row, lost = read_pressure(sensor, np.array([-2e5, 0.0, 2e5, 2e6]), np.random.default_rng(0))
    >>> row.round().tolist(), lost
    ([-101325.0, 500.0, 204500.0, 1000000.0], 1)
    """
    middle, half = (
        (sensor.range - STANDARD_ATMOSPHERE) / 2,
        (sensor.range + STANDARD_ATMOSPHERE) / 2,
    )
    about, _ = digitise(
        sensor.gain * pressure + sensor.offset - middle,
        gain=1.0,
        noise=sensor.noise,
        full_scale=half,
        bits=sensor.bits,
        rng=rng,
    )
    return (about + middle).astype(np.float32), int(np.count_nonzero(about >= half))


def _lagged(sensor: PressureSensor, pressure: Float, fs: float) -> Float:
    """The whole run after connecting line and transmitter."""
    poles: list[NDArray[np.complex128]] = []
    if sensor.line_resonance is not None and sensor.line_damping is not None:
        poles.append(mounting_poles(sensor.line_resonance, sensor.line_damping))
    if sensor.lag is not None:
        poles.append(np.array([-1 / sensor.lag + 0j]))
    return low_pass(pressure, fs, np.concatenate(poles)) if poles else pressure
