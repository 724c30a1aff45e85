"""Accelerometer, pressure sensor and tacho: their channels, noise, range and filters."""

import math
from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ..output.sensor import Channel, tacho_pulses
from .dimensions import Acceleration, Angle, Frequency, Pressure, Ratio, Time, Voltage
from .limits import GAIN_LEAST, GAIN_MOST, MODE_FASTEST, NAME_LONGEST, PRESSURE_MOST
from .part import Part

_ACCELERATION_LEAST, _ACCELERATION_MOST = 1e-9, 1e7  # m/s^2, a shock sensor ends at 1e6

_LEVEL_LEAST, _LEVEL_MOST = 1e-3, 1e4  # V

_FILTER_SLOWEST = 1.0  # Hz, of mounting and anti-alias filter: below it no signal passes
_FILTER_STEEPEST = 10  # order; eight is usual

_DAMPING_LEAST = 1e-3  # glued steel has about 0.01

_SENSOR_SLOWEST, _SENSOR_FASTEST = 1.0, 1e6  # Hz: no stroke visible below, no effect above
_SENSOR_LEAST = 1.0  # Pa, a microphone's range
_LINE_DAMPING_MOST = 0.99  # of an underdamped line

AXES = {"x": "along the stroke", "y": "across the stroke", "z": "along the shaft"}
"""Axes of a triaxial accelerometer, in the frame of the machine."""


class Accelerometer(Part):
    """An accelerometer with its mounting, its filter and its converter.

    With ``axes`` it is triaxial, with channels ``name_x``, ``name_y``, …, see
    :func:`single_axis`.
    """

    name: str = Field(min_length=1, max_length=NAME_LONGEST, description="channel name")
    axes: tuple[Literal["x", "y", "z"], ...] = Field(
        default=(), max_length=3, description="one channel for each; none: a single axis"
    )
    place: str = Field(default="", description="location, for the report")
    direction: str = Field(default="", description="direction, for the report")
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    noise: Acceleration = Field(
        default=0.0, ge=0, le=_ACCELERATION_MOST, description="rms of the sensor's own noise"
    )
    noise_slope: Ratio = Field(
        default=0.0,
        ge=0,
        le=2,
        description="exponent n of a noise power ~ 1 / f^n: 0 white, 1 pink, 2 red",
    )
    mains: Acceleration = Field(
        default=0.0, ge=0, le=_ACCELERATION_MOST, description="rms of mains hum with harmonics"
    )
    mains_frequency: Frequency = Field(default=50.0, ge=15, le=400, description="mains frequency")
    range: Acceleration = Field(
        ge=_ACCELERATION_LEAST, le=_ACCELERATION_MOST, description="full scale, plus and minus"
    )
    bits: int = Field(default=24, ge=8, le=32, description="resolution of the converter")
    mounting_resonance: Frequency | None = Field(
        default=None,
        ge=_FILTER_SLOWEST,
        le=MODE_FASTEST,
        description="resonance of the sensor on its mount",
    )
    mounting_damping: Ratio | None = Field(
        default=None, ge=_DAMPING_LEAST, lt=1, description="damping over critical damping"
    )
    anti_alias: Literal["none", "butterworth", "bessel"] = Field(
        default="none", description="filter; none: decimation only, flat to 0.45 of the rate"
    )
    anti_alias_cutoff: Frequency | None = Field(
        default=None, ge=_FILTER_SLOWEST, le=MODE_FASTEST, description="frequency of 3 dB loss"
    )
    anti_alias_order: int | None = Field(
        default=None,
        ge=1,
        le=_FILTER_STEEPEST,
        description="order of the filter: 6 dB per octave each",
    )

    @model_validator(mode="after")
    def _whole_and_once(self) -> Self:
        pair = _pair_faults(self, "mounting_resonance", "mounting_damping")
        faults = [*self._axis_faults(), *pair, *self._filter_faults()]
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _axis_faults(self) -> list[str]:
        faults = []
        if len(set(self.axes)) < len(self.axes):
            faults.append(f"axes = {list(self.axes)} must be different; remove one")
        if self.axes and self.direction:
            faults.append(
                f"direction = {self.direction!r} must be empty with axes, which have their own; "
                "remove it"
            )
        if self.axes and len(self.name) > NAME_LONGEST - 2:
            faults.append(
                f"name has {len(self.name)} characters, must have <= {NAME_LONGEST - 2} for the "
                "axis to follow; shorten it"
            )
        return faults

    def _filter_faults(self) -> list[str]:
        fields = ("anti_alias_cutoff", "anti_alias_order")
        if self.anti_alias == "none":
            return [
                f"{name} = {getattr(self, name):g} needs anti_alias = 'butterworth' or 'bessel'; "
                "add it or remove this"
                for name in fields
                if getattr(self, name) is not None
            ]
        return [
            f"anti_alias = {self.anti_alias!r} needs {name} as well; add it"
            for name in fields
            if getattr(self, name) is None
        ]


def single_axis(sensors: Sequence[Accelerometer]) -> tuple[Accelerometer, ...]:
    """Accelerometers with one axis each: a triaxial one becomes three, named ``name_axis``.

    Examples
    --------
    >>> head = Accelerometer(name="head", axes=("x", "z"), range=100.0)
    >>> [(one.name, one.direction) for one in single_axis([head])]
    [('head_x', 'along the stroke'), ('head_z', 'along the shaft')]
    """
    return tuple(
        sensor.model_copy(
            update={"name": f"{sensor.name}_{axis}", "direction": AXES[axis], "axes": ()}
        )
        if axis
        else sensor
        for sensor in sensors
        for axis in (sensor.axes or ("",))
    )


class PressureSensor(Part):
    """A pressure transmitter at the cylinder, with its connecting line and converter.

    It reads gauge pressure from absolute vacuum, -101,325 Pa, to the upper end of its range.

    Notes
    -----
    A liquid-filled line oscillates on the compliance C of what it leads to, with the inertance
    ``rho L / A``: ``f = sqrt(A / (rho L C)) / (2 pi)`` [1]_. Usual values: a flush membrane has
    none; 0.3 m of 4 mm tube up to a membrane quarter-wave rings at 1.2 kHz, and with a bubble of
    0.05 cm^3 in it (``C = V / (1.4 p)``) at some 60 Hz. The line lags by ``zeta / (pi f)``; the
    transmitter's own time constant adds to that.

    References
    ----------
    .. [1] E. O. Doebelin, Measurement Systems, 5th ed., McGraw-Hill 2004, section 6.6, dynamic
       effects of volumes and connecting tubing.
    """

    name: str = Field(
        default="pressure", min_length=1, max_length=NAME_LONGEST - 3, description="channel name"
    )
    place: str = Field(default="cylinder", description="location, for the report")
    range: Pressure = Field(
        ge=_SENSOR_LEAST, le=PRESSURE_MOST, description="upper end of the range, gauge"
    )
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    offset: Pressure = Field(
        default=0.0,
        ge=-PRESSURE_MOST,
        le=PRESSURE_MOST,
        description="reading at atmospheric pressure",
    )
    noise: Pressure = Field(default=0.0, ge=0, le=PRESSURE_MOST, description="rms of white noise")
    bits: int = Field(default=24, ge=8, le=32, description="resolution of the converter")
    lag: Time | None = Field(
        default=None,
        ge=1 / (math.tau * _SENSOR_FASTEST),
        le=1 / (math.tau * _SENSOR_SLOWEST),
        description="time constant of the transmitter, first order; none: no lag",
    )
    line_resonance: Frequency | None = Field(
        default=None,
        ge=_SENSOR_SLOWEST,
        le=_SENSOR_FASTEST,
        description="resonance of the connecting line; none: flush membrane",
    )
    line_damping: Ratio | None = Field(
        default=None,
        ge=_DAMPING_LEAST,
        le=_LINE_DAMPING_MOST,
        description="damping ratio of the line",
    )

    @model_validator(mode="after")
    def _line_whole(self) -> Self:
        faults = _pair_faults(self, "line_resonance", "line_damping")
        if faults:
            raise ValueError(*faults)
        return self


def _pair_faults(sensor: Part, *names: str) -> list[str]:
    """Find one of two values that is given without the other."""
    given = {name: getattr(sensor, name) for name in names if getattr(sensor, name) is not None}
    return [
        f"{name} = {value:g} needs {other} as well; add it or remove both"
        for name, value in given.items()
        for other in names
        if other not in given
    ]


class Tacho(Part):
    """A rectangular pulse per revolution, rising at shaft angle `late`, by default zero."""

    name: str = Field(
        default="tacho", min_length=1, max_length=NAME_LONGEST, description="channel name"
    )
    pulse_width: Angle = Field(
        default=math.radians(10.0),
        gt=0,
        le=math.pi,
        description="shaft angle for which the pulse is high",
    )
    level: Voltage = Field(
        default=5.0, ge=_LEVEL_LEAST, le=_LEVEL_MOST, description="height of the pulse above 0 V"
    )
    late: Angle = Field(
        default=0.0, ge=-math.pi, le=math.pi, description="shaft angle at which the pulse rises"
    )

    def channel(self, angle: NDArray[np.float64]) -> NDArray[np.float32]:
        """Pulses [V, shape=(n,)] of a shaft at these rising angles [rad, shape=(n,)]."""
        return tacho_pulses(
            (angle - self.late) / math.tau,
            pulse_width=self.pulse_width / math.tau,
            level=self.level,
        )


def acceleration_channel(name: str, place: str, direction: str) -> Channel:
    """Channel of an accelerometer with its place and direction."""
    return Channel(
        name=name, unit="m/s^2", quantity="acceleration", place=place, direction=direction
    )


def displacement_channel(name: str, place: str, direction: str) -> Channel:
    """Channel of a proximity probe with its place and direction."""
    return Channel(name=name, unit="m", quantity="displacement", place=place, direction=direction)
