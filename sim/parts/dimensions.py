"""Types of fields with a dimension: a number in SI, or a text with a unit."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from ..output.spellings import spellings
from .units import NUMBER_PATTERN, UNITS, to_si, unit_symbol

GRAVITY_MOST = 1000.0  # m/s^2, a hundred g

_SHAPE_MOST = 1e3  # kg^-0.5, the mode of a milligram


class Dimension:
    """Marks a field with its dimension: for unit strings, error texts and JSON schemas.

    Examples
    --------
    >>> Dimension("length").unit
    'm'
    """

    def __init__(self, name: str) -> None:
        self.name = name

    @property
    def unit(self) -> str:
        """SI unit, assumed for a bare number; empty for a ratio."""
        return unit_symbol(self.name)

    @property
    def units(self) -> tuple[str, ...]:
        """All units that a string may have, the SI unit first."""
        return tuple(UNITS[self.name])

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A number in SI, or a string with one of the units; ``unit`` names the SI one."""
        unit = "|".join(map(spellings, self.units))
        text = {"type": "string", "pattern": rf"^\s*{NUMBER_PATTERN}\s*({unit})\s*$"}
        return {"anyOf": [handler(core), text], "unit": self.unit}


def _parser(dimension: str) -> BeforeValidator:
    def parse(value: Any) -> float:  # called a hundred times per scene: fast path for SI values
        return value if type(value) is float else to_si(value, dimension)

    return BeforeValidator(parse)


Length = Annotated[float, _parser("length"), Dimension("length")]
Mass = Annotated[float, _parser("mass"), Dimension("mass")]
Time = Annotated[float, _parser("time"), Dimension("time")]
RotationSpeed = Annotated[float, _parser("rotation speed"), Dimension("rotation speed")]
Frequency = Annotated[float, _parser("frequency"), Dimension("frequency")]
Angle = Annotated[float, _parser("angle"), Dimension("angle")]
Pressure = Annotated[float, _parser("pressure"), Dimension("pressure")]
Acceleration = Annotated[float, _parser("acceleration"), Dimension("acceleration")]
Gravity = Annotated[
    float,
    Field(ge=0, le=GRAVITY_MOST, description="gravity; 0 if weight does not act across the shaft"),
    _parser("acceleration"),
    Dimension("acceleration"),
]
Velocity = Annotated[float, _parser("velocity"), Dimension("velocity")]
Inertia = Annotated[float, _parser("inertia"), Dimension("inertia")]
Stiffness = Annotated[float, _parser("stiffness"), Dimension("stiffness")]
Damping = Annotated[float, _parser("damping"), Dimension("damping")]
Voltage = Annotated[float, _parser("voltage"), Dimension("voltage")]
Ratio = Annotated[float, _parser("ratio"), Dimension("ratio")]
Density = Annotated[float, _parser("density"), Dimension("density")]
Volume = Annotated[float, _parser("volume"), Dimension("volume")]
Area = Annotated[float, _parser("area"), Dimension("area")]
Temperature = Annotated[float, _parser("temperature"), Dimension("temperature")]
KinematicViscosity = Annotated[
    float, _parser("kinematic viscosity"), Dimension("kinematic viscosity")
]
Moment = Annotated[float, _parser("moment"), Dimension("moment")]
Unbalance = Annotated[float, _parser("unbalance"), Dimension("unbalance")]
HertzStiffness = Annotated[float, _parser("Hertz stiffness"), Dimension("Hertz stiffness")]
Force = Annotated[float, _parser("force"), Dimension("force")]
HeatConductance = Annotated[float, _parser("heat conductance"), Dimension("heat conductance")]
SpecificHeat = Annotated[float, _parser("specific heat"), Dimension("specific heat")]
VolumeFlow = Annotated[float, _parser("volume flow"), Dimension("volume flow")]
Viscosity = Annotated[float, _parser("viscosity"), Dimension("viscosity")]
ModeShape = Annotated[
    float,
    _parser("mode shape"),
    Dimension("mode shape"),
    Field(ge=-_SHAPE_MOST, le=_SHAPE_MOST),
]
