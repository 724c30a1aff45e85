"""What pressure transmitters at the cylinders of a pump read."""

import math

import numpy as np
from numpy.typing import NDArray

from ..output.sensor import digitise, low_pass, mounting_poles
from ..scene.pump import PumpScene
from ..scene.pump_hydraulics import PIPED_RUNGS, STANDARD_ATMOSPHERE, PressureSensor

Float = NDArray[np.float64]


def cylinder_pressure(scene: PumpScene, force: Float) -> Float:
    """Gauge pressure on the face of a piston that the liquid pushes along x by `force` [Pa].

    Every rung has it so, with the inertia of the columns that *heads* adds.
    """
    return np.asarray(-force / (math.pi / 4 * scene.piston.diameter**2))


def read_pressures(
    scene: PumpScene, pressures: list[Float], kept: slice, rng: np.random.Generator
) -> tuple[list[NDArray[np.float32]], int]:
    """Channels of the pressure sensors, and how many samples were clipped.

    Parameters
    ----------
    scene : PumpScene
    pressures : list of numpy.ndarray [shape=(n,)]
        On the piston of every sensor's throw at all samples [Pa gauge], band-limited as the
        accelerations are.
    kept : slice
        Samples that are recorded: lines and transmitters have settled before.
    rng : numpy.random.Generator
        Of the noise.
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
    """As :func:`read_pressures`, of a crank that stands: every cylinder is at suction pressure."""
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
    """What a transmitter and its converter make of the pressure at the membrane.

    Parameters
    ----------
    sensor : PressureSensor
    pressure : ndarray, shape (n_samples,)
        Gauge [Pa], band-limited.
    rng : numpy.random.Generator
        Of the noise.

    Returns
    -------
    signal : ndarray, shape (n_samples,)
        float32 [Pa], between absolute vacuum and the upper end of the range.
    clipped : int
        Samples above the range. Those at vacuum are none: there the liquid leaves the membrane.

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
    """Whole run behind connecting line and transmitter."""
    poles: list[NDArray[np.complex128]] = []
    if sensor.line_resonance is not None and sensor.line_damping is not None:
        poles.append(mounting_poles(sensor.line_resonance, sensor.line_damping))
    if sensor.lag is not None:
        poles.append(np.array([-1 / sensor.lag + 0j]))
    return low_pass(pressure, fs, np.concatenate(poles)) if poles else pressure
