"""Parts of a scene that determine the pressure in a pump cylinder: liquid, lines and valves."""

import math
from typing import Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from ..parts.dimensions import (
    Angle,
    Area,
    Damping,
    Density,
    Length,
    Mass,
    Pressure,
    Ratio,
    Stiffness,
    Velocity,
    Volume,
)
from ..parts.limits import (
    DAMPING_MOST,
    HEAVIEST,
    LIGHTEST,
    LONGEST,
    PRESSURE_MOST,
    STIFFEST,
)
from ..parts.part import Part
from ..parts.sensors import PressureSensor
from ..parts.units import STANDARD_GRAVITY

STANDARD_ATMOSPHERE = 101325.0  # Pa, ISO 2533; gauge pressures count from it

_DENSITY_LEAST, _DENSITY_MOST = 100.0, 20e3  # kg/m^3, from liquid gas to mercury
_MODULUS_LEAST = 1e7  # Pa, a tenth of the softest liquid
_MODULUS_MOST = 1e12  # Pa, five hundred times water: practically rigid
_AIR_MOST = 0.2  # beyond it a pump no longer primes, and bubbles are no longer small
_FRICTION_MOST = 1.0  # Darcy-Weisbach; a rough pipe has 0.1
_LOSS_MOST = 1e4
_VOLUME_LEAST, _VOLUME_MOST = 1e-9, 1e3  # m^3
_LEVEL_MOST = 1e4  # m
_MOST_VALVES = 100
_WAVE_SLOWEST, _WAVE_FASTEST = 10.0, 5000.0  # m/s, from a froth to solid steel
_CONTACT_FASTEST = 1e6  # rad/s, a ball of a gram on hard steel has half of it


class Liquid(Part):
    """Pumped liquid; the defaults are fresh water at 20 degC with some air."""

    density: Density = Field(
        default=998.2,
        ge=_DENSITY_LEAST,
        le=_DENSITY_MOST,
        description="density at atmospheric pressure",
    )
    bulk_modulus: Pressure = Field(
        default=2.18e9,
        ge=_MODULUS_LEAST,
        le=_MODULUS_MOST,
        description="modulus of the liquid alone, at atmospheric pressure",
    )
    air_fraction: Ratio = Field(
        default=0.002,
        ge=0,
        le=_AIR_MOST,
        description="volume of free air over the volume of the mixture at atmospheric pressure",
    )
    air_exponent: Ratio = Field(
        default=1.4,
        ge=1,
        le=5 / 3,
        description="polytropic exponent of the air: 1 isothermal, 1.4 isentropic",
    )
    vapour_pressure: Pressure = Field(
        default=2339.0, ge=1, le=PRESSURE_MOST, description="absolute, at the liquid's temperature"
    )

    def wave_speed(self, pressure: float) -> float:
        """Speed of sound of the liquid with its air, ``sqrt(K / rho)`` after Wood [m/s].

        Parameters
        ----------
        pressure : float
            Gauge [Pa], above vacuum.

        Examples
        --------
        >>> round(Liquid(air_fraction=0.0).wave_speed(0.0)), round(Liquid().wave_speed(0.0))
        (1478, 262)
        """
        absolute = max(pressure + STANDARD_ATMOSPHERE, 1.0)
        n = self.air_exponent
        air = self.air_fraction * (STANDARD_ATMOSPHERE / absolute) ** (1 / n)
        stiff = self.bulk_modulus + pressure
        liquid = (1 - self.air_fraction) * self.bulk_modulus / stiff
        modulus = (liquid + air) / (liquid / stiff + air / (n * absolute))
        return math.sqrt(modulus * (liquid + air) / self.density)


class Damper(Part):
    """A gas vessel on a line, at the pump: its gas keeps ``p V^n`` constant."""

    gas_volume: Volume = Field(
        ge=_VOLUME_LEAST, le=_VOLUME_MOST, description="gas volume at the line's pressure at rest"
    )
    exponent: Ratio = Field(
        default=1.4,
        ge=1,
        le=5 / 3,
        description="polytropic exponent of the gas: 1 isothermal, 1.4 isentropic",
    )


class ReliefValve(Part):
    """A spring-loaded relief valve on a line, at the pump, that returns to the suction side.

    It opens in proportion to the pressure above `set_pressure`, without inertia, and is fully open
    at ``(1 + accumulation) set_pressure``.
    """

    set_pressure: Pressure = Field(
        gt=0, le=PRESSURE_MOST, description="opening gauge pressure in the line"
    )
    diameter: Length = Field(gt=0, le=LONGEST, description="bore diameter, fully open")
    accumulation: Ratio = Field(
        default=0.1,
        gt=0,
        le=1,
        description="relative rise above the set pressure at which it is fully open",
    )
    discharge_coefficient: Ratio = Field(
        default=0.7, gt=0, le=1, description="flow over the lossless flow of the bore"
    )


class Line(Part):
    """A pipe between a reservoir or air vessel and the pump.

    Its pressure drop is ``rho (f L / D + K) u |u| / 2``, its inertia ``rho L du/dt``. `wave_speed`,
    `damper` and `relief` are used by the rungs *lumped-lines* and *wave-lines*, in which all throws
    share the line.
    """

    rise: Length = Field(
        default=0.0,
        ge=-_LEVEL_MOST,
        le=_LEVEL_MOST,
        description="height of the line's downstream end above its upstream end",
    )
    length: Length = Field(
        default=0.3,
        ge=0,
        le=LONGEST,
        description="length of moving liquid, up to the next air vessel",
    )
    diameter: Length = Field(default=0.08, gt=0, le=LONGEST, description="inside diameter")
    friction_factor: Ratio = Field(
        default=0.02, ge=0, le=_FRICTION_MOST, description="f of Darcy and Weisbach"
    )
    minor_loss: Ratio = Field(
        default=1.5, ge=0, le=_LOSS_MOST, description="sum of the loss coefficients of fittings"
    )
    wave_speed: Velocity | None = Field(
        default=None,
        ge=_WAVE_SLOWEST,
        le=_WAVE_FASTEST,
        description="wave speed: water in steel 1000 to 1400 m/s, with air a few hundred",
    )
    damper: Damper | None = Field(default=None, description="gas vessel at the pump")
    relief: ReliefValve | None = Field(default=None, description="relief valve at the pump")

    @model_serializer(mode="wrap")
    def _without_absent_parts(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit absent parts, so that lines of the rung *heads* keep their written form."""
        table: dict[str, Any] = handler(self)
        for name in ("wave_speed", "damper", "relief"):
            if getattr(self, name) is None:
                table.pop(name, None)
        return table


class Valve(Part):
    """The self-acting plate valves of one side of a cylinder.

    All values except `leak_area` are for one of `count` equal valves. The default is a group that
    suits a bilge pump of 100 mm bore and stroke at 300 rpm: some 15 kPa at full flow.
    """

    count: int = Field(
        default=4, ge=1, le=_MOST_VALVES, description="number of equal valves in parallel"
    )
    diameter: Length = Field(
        default=0.045, gt=0, le=LONGEST, description="diameter of the seat opening"
    )
    mass: Mass = Field(
        default=0.1,
        ge=LIGHTEST,
        le=HEAVIEST,
        description="mass of plate, water and a third of the spring",
    )
    stiffness: Stiffness = Field(default=3.3e3, ge=0, le=STIFFEST, description="spring stiffness")
    preload_lift: Length = Field(
        default=3e-3, ge=0, le=LONGEST, description="spring compression on the closed valve"
    )
    damping: Damping = Field(
        default=2.0, ge=0, le=DAMPING_MOST, description="damping of the plate in the liquid"
    )
    max_lift: Length = Field(default=8e-3, gt=0, le=LONGEST, description="lift at the stop")
    discharge_coefficient: Ratio = Field(
        default=0.65, gt=0, le=1, description="flow over the lossless flow of the gap"
    )
    force_coefficient: Ratio = Field(
        default=1.0, gt=0, le=2, description="force over pressure drop times seat area"
    )
    seat_stiffness: Stiffness = Field(
        default=50e6, gt=0, le=STIFFEST, description="contact stiffness of seat and stop"
    )
    seat_damping: Damping = Field(
        default=1.3e3, ge=0, le=DAMPING_MOST, description="contact damping of seat and stop"
    )
    leak_area: Area = Field(
        default=0.0, ge=0, le=_VOLUME_MOST, description="area of all leaks past the closed valves"
    )
    stuck_lift: Length | None = Field(
        default=None, ge=0, description="lift of valves that do not move; 0: stuck shut"
    )
    resistance: Ratio = Field(
        default=10.0,
        ge=0,
        le=_LOSS_MOST,
        description="loss coefficient for the speed in the seat opening, rung heads",
    )
    equivalent_length: Length = Field(
        default=0.1,
        ge=0,
        le=LONGEST,
        description="length of liquid in the seat opening with the valve's inertia, rung heads",
    )

    @model_validator(mode="after")
    def _can_work(self) -> Self:
        faults = [*self._lift_faults(), *self._contact_faults()]
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _lift_faults(self) -> list[str]:
        faults = []
        if self.max_lift > self.diameter / 4:
            faults.append(
                f"max_lift = {self.max_lift:g} m must be <= diameter / 4 = {self.diameter / 4:g} m;"
                " above it the seat opening throttles, not the gap"
            )
        if self.stuck_lift is not None and self.stuck_lift > self.max_lift:
            faults.append(
                f"stuck_lift = {self.stuck_lift:g} m must be <= max_lift = {self.max_lift:g} m; "
                "the stop ends the lift"
            )
        return faults

    def _contact_faults(self) -> list[str]:
        rate = math.sqrt(self.seat_stiffness / self.mass)
        if rate <= _CONTACT_FASTEST:
            return []
        return [
            f"seat_stiffness = {self.seat_stiffness:g} N/m gives a contact of {rate:g} rad/s on "
            f"mass = {self.mass:g} kg, must be <= {_CONTACT_FASTEST:g} rad/s; soften the seat"
        ]


PIPED_RUNGS = ("lumped-lines", "wave-lines")
"""Rungs of the pressure with pipes between the valves and the reservoirs."""

CHAMBER_RUNGS = ("chamber", *PIPED_RUNGS)
"""Rungs of the pressure with a compressible chamber and moving valves."""


class CylinderPressure(Part):
    """Gauge pressure on the piston.

    ``none``: no pressure. ``constant``: `discharge` at all times. ``two-level``: `suction` and
    `discharge` in turn; the rise begins `rise_delay` after the bottom dead centre, when the
    suction valve has closed, and takes `rise_angle`; the fall at the other dead centre likewise,
    with its own values, since clearance volume and air expand there. ``heads``: the
    quasi-static energy balance of the two lines, with `suction` and `discharge` at their far ends.
    ``chamber``: a compressible chamber with self-acting valves, with `suction` and `discharge`
    before and after them. ``lumped-lines`` and ``wave-lines``: such chambers on two
    pipes shared by all throws, with `suction` and `discharge` at their far ends; a pipe is one mass
    on one spring, or carries waves.
    """

    rung: Literal[
        "none", "constant", "two-level", "heads", "chamber", "lumped-lines", "wave-lines"
    ] = Field(
        default="two-level",
        description="none, constant, two levels, heads in lines, chamber with valves, or chamber "
        "with lumped-lines or wave-lines",
    )
    suction: Pressure = Field(
        default=0.0, ge=-STANDARD_ATMOSPHERE, description="suction pressure, gauge"
    )
    discharge: Pressure = Field(
        default=0.0, le=PRESSURE_MOST, description="discharge pressure, gauge"
    )
    rise_angle: Angle = Field(
        default=math.radians(3.0),
        ge=math.radians(0.5),
        le=math.radians(90.0),
        description="crank angle of the rise, and of the fall unless fall_angle is given",
    )
    rise_delay: Angle = Field(
        default=0.0,
        ge=0,
        le=math.radians(90.0),
        description="crank angle after the bottom dead centre at which the rise begins",
    )
    fall_angle: Angle | None = Field(
        default=None,
        ge=math.radians(0.5),
        le=math.radians(90.0),
        description="crank angle of the fall; none: as for the rise",
    )
    fall_delay: Angle = Field(
        default=0.0,
        ge=0,
        le=math.radians(90.0),
        description="crank angle after the top dead centre at which the fall begins",
    )
    flow: Literal["exact", "two-harmonic"] = Field(
        default="exact", description="flow law of the rung heads"
    )
    liquid: Liquid = Liquid()
    suction_line: Line | None = None
    discharge_line: Line | None = None
    suction_valve: Valve | None = None
    discharge_valve: Valve | None = None
    dead_volume: Volume | None = Field(
        default=None,
        ge=_VOLUME_LEAST,
        le=_VOLUME_MOST,
        description="chamber volume at top dead centre",
    )
    sensor: PressureSensor | None = Field(
        default=None, description="cylinder pressure sensor; none: not recorded"
    )

    @model_serializer(mode="wrap")
    def _without_absent_sensor(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit an absent sensor, so that scenes without one keep their written form."""
        table: dict[str, Any] = handler(self)
        if self.sensor is None:
            table.pop("sensor", None)
        return table

    @model_validator(mode="after")
    def _fit_for_the_rung(self) -> Self:
        faults = [
            *self._level_faults(),
            *self._missing(),
            *self._vapour_faults(),
            *self._deadlock(),
        ]
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _level_faults(self) -> list[str]:
        if self.discharge >= self.suction:
            return []
        return [
            f"discharge = {self.discharge:g} Pa must be >= suction = {self.suction:g} Pa; swap them"
            " or correct one, both are gauge pressures"
        ]

    def _missing(self) -> list[str]:
        faults = [
            f"{name} is missing; the rung '{self.rung}' needs it (an empty table takes defaults)"
            if name != "dead_volume"
            else f"{name} is missing; the rung '{self.rung}' needs it, about half the swept volume"
            for name in _NEEDS.get(self.rung, ())
            if getattr(self, name) is None
        ]
        return faults + self._wave_faults()

    def _wave_faults(self) -> list[str]:
        """Find pipes without a wave speed, and give that of a rigid pipe with this liquid."""
        if self.rung not in PIPED_RUNGS:
            return []
        sides = (("suction", self.suction_line), ("discharge", self.discharge_line))
        return [
            f"{name}_line.wave_speed is missing; the rung '{self.rung}' needs it, at most "
            f"{self.liquid.wave_speed(level):.3g} m/s of this liquid with its air at {level:.3g} Pa"
            for (name, line), level in zip(sides, self.at_pump, strict=True)
            if line is not None and line.wave_speed is None
        ]

    @property
    def at_pump(self) -> tuple[float, float]:
        """Pressures at rest before and after the valves, from the lines' far ends [Pa gauge].

        Examples
        --------
        >>> well = CylinderPressure(suction_line=Line(rise=3.0), discharge=2e5)
        >>> [round(p) for p in well.at_pump]
        [-29367, 200000]
        """
        weight = self.liquid.density * STANDARD_GRAVITY
        inlet, outlet = self.suction_line, self.discharge_line
        return (
            self.suction - (weight * inlet.rise if inlet else 0.0),
            self.discharge + (weight * outlet.rise if outlet else 0.0),
        )

    def _vapour_faults(self) -> list[str]:
        vapour = self.liquid.vapour_pressure - STANDARD_ATMOSPHERE
        name = "discharge" if self.rung == "constant" else "suction"
        lowest = getattr(self, name)
        if self.rung in PIPED_RUNGS:
            name, lowest = "suction at the pump", self.at_pump[0]
        if self.rung == "none" or lowest > vapour:
            return []
        return [
            f"{name} = {lowest:g} Pa must be > the liquid's vapour pressure = {vapour:g} Pa "
            "gauge; raise it or cool the liquid"
        ]

    def _deadlock(self) -> list[str]:
        inlet, outlet = self.suction_valve, self.discharge_valve
        if self.rung not in CHAMBER_RUNGS or inlet is None or outlet is None:
            return []
        if outlet.stuck_lift != 0 or (inlet.stuck_lift or 0) > 0:
            return []
        return [
            "discharge_valve.stuck_lift = 0 m must be > 0 m or the suction valve stuck open: "
            "a cylinder without a way out bursts, and has no relief valve of its own"
        ]


_NEEDS = {
    "heads": ("suction_line", "discharge_line"),
    "chamber": ("suction_valve", "discharge_valve", "dead_volume"),
    **dict.fromkeys(
        PIPED_RUNGS,
        ("suction_line", "discharge_line", "suction_valve", "discharge_valve", "dead_volume"),
    ),
}
"""Rung -> values that it requires."""
