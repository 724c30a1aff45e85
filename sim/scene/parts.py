"""What every scene is made of: quantities with units, frozen parts, and errors in words.

Validation reports every fault at once as a dotted path with value, bound and cure, and names the
nearest match of an unknown key. Kernels trust what passes.
"""

import difflib
import math
import re
import reprlib
from collections.abc import Callable, Container, Mapping, Sequence
from contextlib import suppress
from decimal import Decimal
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, Literal, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import CoreSchema

from ..brief import short
from ..output.recording import html_table
from ..output.sensor import SIMULATED_RATE_LEAST, SIMULATED_RATE_MOST, Channel, tacho_pulses
from ..output.spellings import spellings

_INCH = 0.0254  # m, exact by definition
_POUND_FORCE = 4.4482216152605  # N, exact by definition
STANDARD_GRAVITY = 9.80665  # m/s^2, ISO 80000-3

UNITS: dict[str, dict[str, float]] = {
    "length": {
        **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9},
        **{"in": _INCH, "mil": 1e-3 * _INCH},
    },
    "mass": {"kg": 1.0, "g": 1e-3},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "rotation speed": {"rev/s": 1.0, "Hz": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.5 / math.pi},
    "frequency": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "pressure": {
        "Pa": 1.0,
        "kPa": 1e3,
        "MPa": 1e6,
        "GPa": 1e9,
        "N/mm^2": 1e6,
        "bar": 1e5,
        "mbar": 1e2,
        "psi": _POUND_FORCE / _INCH**2,
    },
    "acceleration": {"m/s^2": 1.0, "g": STANDARD_GRAVITY},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "inertia": {"kg m^2": 1.0, "kg mm^2": 1e-6},
    "stiffness": {
        **{"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6, "GN/m": 1e9},
        **{"N/mm": 1e3, "kN/mm": 1e6, "N/um": 1e6},
    },
    "damping": {"N s/m": 1.0, "kN s/m": 1e3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "ratio": {"": 1.0, "%": 1e-2},
    "mode shape": {"kg^-0.5": 1.0},
    "density": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "volume": {"m^3": 1.0, "L": 1e-3, "cm^3": 1e-6, "mm^3": 1e-9},
    "area": {"m^2": 1.0, "cm^2": 1e-4, "mm^2": 1e-6},
    "moment": {"N m": 1.0, "kN m": 1e3, "N mm": 1e-3},
    "temperature": {"K": 1.0},
    "kinematic viscosity": {"m^2/s": 1.0, "mm^2/s": 1e-6, "cSt": 1e-6},
    "unbalance": {"kg m": 1.0, "kg mm": 1e-3, "g mm": 1e-6},
    "Hertz stiffness": {"N/m^1.5": 1.0},
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6},
    "viscosity": {"Pa s": 1.0, "mPa s": 1e-3, "cP": 1e-3},
    "heat conductance": {"W/K": 1.0},
    "specific heat": {"J/(kg K)": 1.0, "kJ/(kg K)": 1e3},
    "volume flow": {"m^3/s": 1.0, "L/s": 1e-3, "L/min": 1e-3 / 60, "mL/min": 1e-6 / 60},
}
"""Factor to SI of every unit, by dimension. The first unit of a row is the SI one."""

Table = TypeVar("Table", bound=BaseModel)
Value = TypeVar("Value")

_NUMBER = r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>.*?)\s*")

# Bounds no machine comes near: they catch a wrong unit or a slipped exponent, and keep every
# product and quotient of the kernels finite.
LONGEST = 100.0  # m
HEAVIEST, LIGHTEST = 1e6, 1e-6  # kg
INERTIA_MOST, INERTIA_LEAST = 1e9, 1e-12  # kg m^2
PRESSURE_MOST = 1e9  # Pa, a waterjet intensifier has 6e8
GRAVITY_MOST = 1000.0  # m/s^2, a hundred g
STIFFEST = 1e13  # N/m, a metre of steel has 1e11
DAMPING_MOST = 1e9  # N s/m
FORCE_MOST = 1e9  # N
SLIDING_LEAST, SLIDING_MOST = 1e-6, 1e3  # m/s
ANGLE_MOST = 1e4  # rad, beyond it a cosine has lost four digits
_ACCELERATION_LEAST, _ACCELERATION_MOST = 1e-9, 1e7  # m/s^2, a shock sensor ends at 1e6
_SHAPE_MOST = 1e3  # kg^-0.5, the mode of a milligram
_LEVEL_LEAST, _LEVEL_MOST = 1e-3, 1e4  # V
GAIN_LEAST, GAIN_MOST = 1e-3, 1e3
_MODE_SLOWEST, _MODE_FASTEST = 1e-6, 1e6  # Hz, a floating casing has almost none
_RECORDING_LONGEST = 3600.0  # s
_STEP_LEAST = 1e-12  # s
_SETTLING_MOST = 1000
MOST_SENSORS, _MOST_MODES = 64, 1000
NAME_LONGEST = 64
_FILTER_SLOWEST = 1.0  # Hz, of mounting and anti-alias filter: below it no signal is left
_FILTER_STEEPEST = 10  # order; eight is usual
_DAMPED_MOST = 0.99  # of a mode that swings still
_DAMPING_LEAST = 1e-3  # glued steel has some 0.01


class SceneError(ValueError):
    """Every fault of one scene, one line each, as dotted path, value, bound and cure."""

    def __init__(self, name: str, faults: list[str]) -> None:
        self.faults = faults
        super().__init__("\n".join([f"{name}: {len(faults)} fault(s)", *faults]))


def to_si(value: Any, dimension: str) -> float:
    """Convert a number or a string with a unit to SI.

    Parameters
    ----------
    value : float or str
        A bare number is SI; a string is a number and a unit of `dimension`.
    dimension : str
        A key of :data:`UNITS`.

    Returns
    -------
    float
        The value in the SI unit of `dimension` (rotation speed: revolutions per second).

    Raises
    ------
    ValueError
        The string has no number, no unit, or a unit of another dimension.

    Examples
    --------
    >>> to_si("0.25 mm", "length")
    0.00025
    >>> to_si("300 rpm", "rotation speed")
    5.0
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"is not a number or a string with a unit ({_unit_list(dimension)})")
    if not isinstance(value, str):
        try:
            return float(value)
        except OverflowError:  # a whole number of hundreds of digits
            return math.inf if value > 0 else -math.inf
    return _text_to_si(value, dimension)


@lru_cache(maxsize=4096)
def _text_to_si(value: str, dimension: str) -> float:
    """Kept, as a recipe validates its scene a hundred times, each draw at its extremes."""
    units = UNITS[dimension]
    match = _QUANTITY.fullmatch(value)
    if match is None:
        example = f"1.5 {_unit_symbol(dimension)}".rstrip()
        raise ValueError(f"has no leading number; write it like '{example}'")
    number, unit = match["number"], listed_unit(match["unit"], dimension)
    if unit is None:
        unit = match["unit"]
        missing = "has no unit" if unit == "" else f"has unit '{unit}', not one of {dimension}"
        raise ValueError(f"{missing}; use one of {_unit_list(dimension)}")
    try:  # a product of decimals keeps 0.13 mm at exactly 0.00013, that of two floats would not
        return float(Decimal(number) * Decimal(repr(units[unit])))
    except ArithmeticError:  # an exponent beyond decimals; the caller refuses what is not finite
        return float(number) * units[unit]


def listed_unit(text: str, dimension: str) -> str | None:
    """Unit of :data:`UNITS` that a text spells; None where it is none of the dimension.

    A product may be written with a blank, ``*``, ``·``, ``.``, ``-`` or nothing, a power as ``^2``,
    ``**2``, ``²`` or ``2``, and micro as ``u``, ``µ`` or ``μ``.

    Examples
    --------
    >>> [listed_unit(text, "viscosity") for text in ("Pa*s", "mPa·s", "Pas", "m")]
    ['Pa s', 'mPa s', 'Pa s', None]
    >>> listed_unit("1/min", "rotation speed"), listed_unit("kg·m²", "inertia")
    ('rpm', 'kg m^2')
    """
    units = UNITS[dimension]
    if text in units:
        return text
    return next((unit for unit in units if re.fullmatch(spellings(unit), text)), None)


def _unit_list(dimension: str) -> str:
    return ", ".join(unit or "(none)" for unit in UNITS[dimension])


def _unit_symbol(dimension: str) -> str:
    return next(iter(UNITS[dimension]))


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
        """SI unit, that of a bare number; empty for a ratio."""
        return _unit_symbol(self.name)

    @property
    def units(self) -> tuple[str, ...]:
        """Every unit that a string may carry, as listed, the SI unit first."""
        return tuple(UNITS[self.name])

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A number in SI, or a string with one of the units; ``unit`` names the SI one."""
        unit = "|".join(map(spellings, self.units))
        text = {"type": "string", "pattern": rf"^\s*{_NUMBER}\s*({unit})\s*$"}
        return {"anyOf": [handler(core), text], "unit": self.unit}


def _parser(dimension: str) -> BeforeValidator:
    def parse(value: Any) -> float:  # a hundred floats a scene: no call for what is SI already
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
    Field(ge=0, le=GRAVITY_MOST, description="0 where weight does not act across the shaft"),
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


class FixedTable(dict[str, Value], Generic[Value]):
    """A table of plain values that refuses to change; hashable, picklable, and a dict to dump.

    Examples
    --------
    >>> FixedTable({"acc_x": 0.1})["acc_x"]
    0.1
    """

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError("a scene is frozen; load it again with an override by dotted path")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[type["FixedTable[Value]"], tuple[dict[str, Value]]]:
        return FixedTable, (dict(self),)


class Part(BaseModel):
    """Base of every table of a scene: frozen, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class CasingMode(Part):
    """One mode of the casing: mass-normalised shape at every force and sensor place."""

    frequency: Frequency = Field(
        ge=_MODE_SLOWEST, le=_MODE_FASTEST, description="natural, undamped"
    )
    damping_ratio: Ratio = Field(gt=0, lt=1, description="over the critical one")
    shape: Annotated[dict[str, ModeShape], AfterValidator(FixedTable)] = Field(
        min_length=1, description="place or sensor -> mass-normalised deflection"
    )
    foot_share: Ratio = Field(
        default=0.0, ge=0, le=1, description="of its strain energy, in the feet as tightened"
    )

    def on_feet(self, stiffness_ratio: float) -> tuple[float, float]:
        """Frequency [Hz] and damping ratio where the feet keep this share of their stiffness.

        By Rayleigh's quotient with the shape as it was: the stiffness of the mode falls by its
        share in the feet, mass and dashpots stay.
        """
        lower = math.sqrt(1 - self.foot_share * (1 - stiffness_ratio))
        return self.frequency * lower, min(self.damping_ratio / lower, _DAMPED_MOST)


class FrfFile(Part):
    """Measured accelerance of the casing, in a file; see :mod:`wearstate.sim.casing.casing_frf`.

    ``folder`` is where a relative file is looked for first; :func:`beside` sets it to that of the
    scene file. It is no part of the scene's dump, which must not name a machine's folders.
    """

    file: str = Field(min_length=1, description="CSV or UFF58, accelerance in m/s^2/N")
    pairs: Annotated[dict[str, Annotated[str, Field(min_length=1)]], AfterValidator(FixedTable)] = (
        Field(default=FixedTable({}), description="sensor/place -> the name of it in the file")
    )
    without: tuple[str, ...] = Field(
        default=(), description="places the file does not have, whose forces stay silent"
    )
    folder: str = Field(default="", exclude=True, description="where the file is looked for first")


class Feet(Part):
    """Feet on anchor bolts, whose contact is as stiff as it is pressed.

    The stiffness of rough surfaces in contact is proportional to the load (Greenwood, Williamson
    1966, doi:10.1098/rspa.1966.0242; Persson 2007, doi:10.1103/PhysRevLett.99.125502), and the load
    to the stretch that the bolts still have. The contact is in series with the rest of the feet.
    """

    bolt_stretch: Length = Field(gt=0, le=0.1, description="of the anchor bolts, as tightened")
    stretch_lost: Length = Field(default=0.0, ge=0, description="of it, by settling and turning")
    contact_share: Ratio = Field(
        default=0.2, gt=0, lt=1, description="of the feet's flexibility, in their contact as new"
    )

    @model_validator(mode="after")
    def _held(self) -> Self:
        if self.stretch_lost >= self.bolt_stretch:
            raise ValueError(
                f"stretch_lost = {self.stretch_lost:g} m must be < bolt_stretch = "
                f"{self.bolt_stretch:g} m; a foot without any load rattles, which this model does "
                "not know"
            )
        return self

    @property
    def stiffness_ratio(self) -> float:
        """Of the feet, over that as tightened: 0 to 1 [-]."""
        left = 1 - self.stretch_lost / self.bolt_stretch
        return 1 / (1 - self.contact_share + self.contact_share / left)


class Casing(Part):
    """The pump casing on its mounts: as modes, or as measured frequency response functions."""

    rung: Literal["driven", "yielding"] = Field(
        default="driven",
        description="driven: the crank turns in a bearing at rest; yielding: in one that moves "
        "with the casing",
    )
    feet: Feet | None = Field(default=None, description="that may work loose; none: tight")
    modes: tuple[CasingMode, ...] = Field(default=(), max_length=_MOST_MODES)
    frf: FrfFile | None = None

    @model_validator(mode="after")
    def _one_description(self) -> Self:
        given = [f"casing.{name}" for name in ("modes", "frf") if getattr(self, name)]
        if len(given) != 1:
            raise ValueError(
                f"{' and '.join(given) if given else 'neither'} given, must be exactly one of "
                f"casing.modes and casing.frf; {'remove one' if given else 'add one'}"
            )
        if self.rung == "yielding" and not self.modes:
            raise ValueError(
                "rung = 'yielding' must have casing.modes: a measured casing has no shape at the "
                "bearing; take 'driven', or fit modes to the measurement"
            )
        if self.feet is not None and not any(mode.foot_share for mode in self.modes):
            raise ValueError(
                "feet needs modes of which one has foot_share > 0; what feet do to a measured "
                "casing is in the measurement"
            )
        return self


def beside(table: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Scene table whose files are looked for in this folder first, that of the scene file.

    Examples
    --------
    >>> beside({"casing": {"frf": {"file": "pump.csv"}}}, Path("scenes"))["casing"]["frf"]
    {'folder': 'scenes', 'file': 'pump.csv'}
    """
    result = dict(table)
    for owner, key in _FILES:
        part = result.get(owner)
        if isinstance(part, Mapping) and isinstance(part.get(key), Mapping):
            result[owner] = {**part, key: {"folder": str(folder), **part[key]}}
    return result


_FILES = (("casing", "frf"), ("load", "record"))
"""Tables of a scene that name a file."""


def specific_key(keys: Container[str], place: str, throw: int) -> str | None:
    """Key for a force: ``place_throw`` where there is one, else ``place``, else None.

    Parameters
    ----------
    keys : container of str
        Keys of a mode shape, or places of a frequency response table.
    place : str
        Where the force acts.
    throw : int
        Of which throw it is, counted from 1.

    Examples
    --------
    >>> specific_key({"bearing_x", "bearing_x_2"}, "bearing_x", 2)
    'bearing_x_2'
    >>> specific_key({"bearing_x", "bearing_x_2"}, "bearing_x", 1)
    'bearing_x'
    """
    return next((key for key in (f"{place}_{throw}", place) if key in keys), None)


AXES = {"x": "along the stroke", "y": "across the stroke", "z": "along the shaft"}
"""Axes of a triaxial accelerometer, in the frame of the machine."""


class Accelerometer(Part):
    """An accelerometer with its mounting, its filter and its converter.

    With ``axes`` it is a triaxial one: channels ``name_x``, ``name_y``, …, see
    :func:`single_axis`.
    """

    name: str = Field(min_length=1, max_length=NAME_LONGEST, description="of its channel")
    axes: tuple[Literal["x", "y", "z"], ...] = Field(
        default=(), max_length=3, description="one channel for each; none: a single axis"
    )
    place: str = Field(default="", description="where it sits, for the report")
    direction: str = Field(default="", description="which way it points, for the report")
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
        description="its power falls as 1 / f to this power: 0 white, 1 pink, 2 red",
    )
    mains: Acceleration = Field(
        default=0.0, ge=0, le=_ACCELERATION_MOST, description="rms of hum, harmonics and all"
    )
    mains_frequency: Frequency = Field(default=50.0, ge=15, le=400, description="of the hum")
    range: Acceleration = Field(
        ge=_ACCELERATION_LEAST, le=_ACCELERATION_MOST, description="full scale, plus and minus"
    )
    bits: int = Field(default=24, ge=8, le=32, description="of its converter")
    mounting_resonance: Frequency | None = Field(
        default=None, ge=_FILTER_SLOWEST, le=_MODE_FASTEST, description="of sensor on its mount"
    )
    mounting_damping: Ratio | None = Field(
        default=None, ge=_DAMPING_LEAST, lt=1, description="ratio to the critical one"
    )
    anti_alias: Literal["none", "butterworth", "bessel"] = Field(
        default="none", description="none: what decimation does, flat to 0.45 of the rate"
    )
    anti_alias_cutoff: Frequency | None = Field(
        default=None, ge=_FILTER_SLOWEST, le=_MODE_FASTEST, description="where 3 dB are lost"
    )
    anti_alias_order: int | None = Field(
        default=None,
        ge=1,
        le=_FILTER_STEEPEST,
        description="of the filter; falls by 6 dB an octave for each",
    )

    @model_validator(mode="after")
    def _whole_and_once(self) -> Self:
        faults = [*self._axis_faults(), *self._mounting_faults(), *self._filter_faults()]
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _axis_faults(self) -> list[str]:
        faults = []
        if len(set(self.axes)) < len(self.axes):
            faults.append(f"axes = {list(self.axes)} must be different; remove one")
        if self.axes and self.direction:
            faults.append(
                f"direction = {self.direction!r} must be empty beside axes, which have their own; "
                "remove it"
            )
        if self.axes and len(self.name) > NAME_LONGEST - 2:
            faults.append(
                f"name has {len(self.name)} characters, must have <= {NAME_LONGEST - 2} for the "
                "axis to follow; shorten it"
            )
        return faults

    def _mounting_faults(self) -> list[str]:
        given = (self.mounting_resonance is not None, self.mounting_damping is not None)
        if given[0] == given[1]:
            return []
        lone, other = ("resonance", "damping") if given[0] else ("damping", "resonance")
        value = getattr(self, f"mounting_{lone}")
        return [
            f"mounting_{lone} = {value:g} needs mounting_{other} beside it; add it or remove both"
        ]

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
            f"anti_alias = {self.anti_alias!r} needs {name} beside it; add it"
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


class Tacho(Part):
    """A rectangular pulse per revolution, rising at shaft angle zero or `late` after it."""

    name: str = Field(
        default="tacho", min_length=1, max_length=NAME_LONGEST, description="of its channel"
    )
    pulse_width: Angle = Field(
        default=math.radians(10.0),
        gt=0,
        le=math.pi,
        description="shaft angle for which the pulse is high",
    )
    level: Voltage = Field(
        default=5.0, ge=_LEVEL_LEAST, le=_LEVEL_MOST, description="of the pulse, above 0 V"
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


class Wear(Part):
    """Limits of a clearance, all diametral, with their source."""

    as_new_diametral: Length = Field(
        gt=0, le=LONGEST, description="smallest clearance of a new joint"
    )
    condemning_diametral: Length = Field(
        gt=0, le=LONGEST, description="the joint must be renewed above it"
    )
    grade_edges_diametral: tuple[Length, Length, Length] = Field(
        description="clearance at which grades 1, 2 and 3 begin"
    )
    source: str = Field(
        min_length=1, description="standard, maker or judgement that the limits come from"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        values = (self.as_new_diametral, *self.grade_edges_diametral)
        if any(low >= high for low, high in pairwise(values)):
            raise ValueError(
                "as_new_diametral and grade_edges_diametral = "
                f"{', '.join(f'{v:g} m' for v in values)} must rise strictly; reorder them"
            )
        if self.grade_edges_diametral[-1] != self.condemning_diametral:
            raise ValueError(
                f"grade_edges_diametral[2] = {self.grade_edges_diametral[-1]:g} m must equal "
                f"condemning_diametral = {self.condemning_diametral:g} m; grade 3 is condemned"
            )
        return self

    @property
    def as_new(self) -> float:
        """Smallest clearance of a new joint [m]."""
        return self.as_new_diametral

    @property
    def grade_edges(self) -> tuple[float, float, float]:
        """Clearance at which grades 1, 2 and 3 begin [m]."""
        return self.grade_edges_diametral

    @property
    def condemning(self) -> float:
        """Clearance above which the joint must be renewed [m]."""
        return self.condemning_diametral


class Numerics(Part):
    """What the solver may be told; every field has a default that the scene decides."""

    step: Time | None = Field(default=None, ge=_STEP_LEAST, description="largest integration step")


class WearPlace(NamedTuple):
    """A value of a scene that says how worn the machine is [m]."""

    path: str
    """Dotted; ``*`` stands for the number of a list entry, counted from 0."""
    place: str
    """What is worn; ``{}`` stands for that number counted from 1, as people count throws."""
    words: str
    limits: str = ""
    """Table of the scene with its limits; a severity without any has no grade."""

    @property
    def kind(self) -> str:
        """What its columns begin with: the value's own name."""
        return self.path.rpartition(".")[2]

    @property
    def column(self) -> str:
        """Manifest column."""
        return f"{self.kind}_{self.place}_m"


class ConditionPlace(NamedTuple):
    """A value of a scene that is an operating condition [SI]."""

    path: str
    column: str
    """Manifest column; ends in its unit."""
    words: str


SPEED = ConditionPlace("drive.speed", "speed_hz", "shaft speed, as set")
"""Condition that every machine has."""

START_ANGLE = ConditionPlace(
    "drive.start_angle", "start_angle_rad", "shaft angle at the first sample"
)

VISCOSITY = ConditionPlace(
    "oil.dynamic_viscosity", "viscosity_pa_s", "dynamic viscosity of the oil"
)


class Scene(Part):
    """What every machine's scene holds.

    With ``fidelity = "auto"`` the rungs and the numerics written in a scene are replaced by the
    cheapest that keep to ``accuracy``, but for the effects that ``pinned`` names.

    A machine's scene is a subclass, one row of :data:`.scene.load.MACHINES`. Its class variables
    are what the program must know of the machine without its physics.

    Attributes
    ----------
    physics : str
        Module with ``MACHINE``, a :class:`wearstate.sim.machine.registry.MachinePhysics`. It is
        named, so that a scene is read without kernels.
    effects : tuple of str
        As ``pinned`` names them.
    wear_places : tuple of WearPlace
    condition_places : tuple of ConditionPlace
    """

    physics: ClassVar[str]
    effects: ClassVar[tuple[str, ...]] = ()
    wear_places: ClassVar[tuple[WearPlace, ...]] = ()
    condition_places: ClassVar[tuple[ConditionPlace, ...]] = (SPEED,)

    name: str = Field(min_length=1, description="of the scene, kept with every recording")
    machine: str
    description: str = Field(default="", description="one sentence for lists")
    duration: Time = Field(
        gt=0, le=_RECORDING_LONGEST, description="length of the recording, after settling"
    )
    sample_rate: Frequency = Field(
        ge=SIMULATED_RATE_LEAST, le=SIMULATED_RATE_MOST, description="of every channel"
    )
    settling_revolutions: int = Field(
        default=3, ge=1, le=_SETTLING_MOST, description="run before the recording"
    )
    accuracy: Ratio = Field(default=0.02, gt=0, lt=1, description="error the features may carry")
    fidelity: Literal["given", "auto"] = Field(
        default="given", description="rungs and numerics as written, or as the accuracy needs"
    )
    pinned: tuple[str, ...] = Field(
        default=(), description="effects that stay as they are written whatever the fidelity"
    )
    tacho: Tacho | None = Tacho()
    numerics: Numerics = Numerics()

    @model_validator(mode="after")
    def _cross_checks(self) -> Self:
        faults = self.cross_faults({name: getattr(self, name) for name in type(self).model_fields})
        faults += pinned_faults(type(self), self.pinned)
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def __repr__(self) -> str:
        """Machine, name and what a recording of it is."""
        rate = self.sample_rate
        told = f"{rate / 1000:.6g} kHz" if rate >= 1000 else f"{rate:.6g} Hz"
        return f"<{type(self).__name__} {self.name}, {self.duration:.4g} s, {told}>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """The same for notebooks, and its parts."""
        parts = {name: short(getattr(self, name)) for name in type(self).model_fields}
        rows = [(name, text) for name, text in parts.items() if text]
        return html_table(repr(self)[1:-1], ["part", ""], rows)

    def sensor_channels(self) -> tuple[Channel, ...]:
        """Channels of the sensors, in order; every machine has its own."""
        raise NotImplementedError(self.machine)

    def sensor_parts(self) -> tuple[Any, ...]:
        """Sensors that have a range and a noise, one for each of their channels, in order."""
        raise NotImplementedError(self.machine)

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between parts, of those parts that are there; each machine has its own."""
        del parts
        return []


def machine_name(kind: type[Scene]) -> str:
    """What the scenes of a type write as their machine.

    Examples
    --------
    >>> from wearstate.sim.scene.pump import PumpScene
    >>> machine_name(PumpScene)
    'reciprocating-pump'
    """
    return str(kind.model_fields["machine"].annotation.__args__[0])  # type: ignore[union-attr]


def pinned_faults(kind: type[Scene], pinned: Sequence[str]) -> list[str]:
    """Names that are no effects of a type of scene, as sentences.

    Examples
    --------
    >>> from wearstate.sim.scene.pump import PumpScene
    >>> pinned_faults(PumpScene, ["presure"])
    ["pinned: 'presure' is no effect of a reciprocating-pump; did you mean 'pressure'?"]
    """
    return [
        f"pinned: '{name}' is no effect of a {machine_name(kind)}"
        + (nearest(name, kind.effects) if kind.effects else ", which has none; leave it out")
        for name in pinned
        if name not in kind.effects
    ]


def channels_of(scene: Scene) -> tuple[Channel, ...]:
    """Channels of a recording of this scene, sensors first, then the tacho.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> [channel.name for channel in channels_of(load_scene("bilge-pump"))]
    ['acc_x', 'acc_y', 'tacho']
    """
    sensors = scene.sensor_channels()
    if scene.tacho is None:
        return sensors
    return (*sensors, Channel(name=scene.tacho.name, unit="V", quantity="tacho"))


def faults_between(
    parts: Mapping[str, Any], checks: Sequence[tuple[Callable[..., list[str]], tuple[str, ...]]]
) -> list[str]:
    """Faults between parts, by those checks whose parts are all there."""
    return [
        fault
        for check, needs in checks
        if all(need in parts for need in needs)
        for fault in check(*(parts[need] for need in needs))
    ]


def acceleration_channel(name: str, place: str, direction: str) -> Channel:
    """Channel of an accelerometer: where it sits, and which way it measures."""
    return Channel(
        name=name, unit="m/s^2", quantity="acceleration", place=place, direction=direction
    )


def displacement_channel(name: str, place: str, direction: str) -> Channel:
    """Channel of a proximity probe: where it sits, and which way it measures."""
    return Channel(name=name, unit="m", quantity="displacement", place=place, direction=direction)


def name_faults(sensors: Sequence[str], tacho: Tacho | None) -> list[str]:
    """Channel names that are given more than once, as sentences.

    Examples
    --------
    >>> name_faults(["acc", "acc"], None)
    ["sensors: name 'acc' is given 2 times, must be unique; rename one"]
    """
    names = [*sensors, *([tacho.name] if tacho else [])]
    return [
        f"sensors: name '{name}' is given {names.count(name)} times, must be unique; rename one"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]


MOST_FAULTS = 200
"""Faults of one input that are told one by one."""


def validate_table(model: type[Table], table: Mapping[str, Any], name: str) -> Table:
    """Validate a plain table into any model, with every fault in the words of this program.

    Raises
    ------
    SceneError
        Every fault at once, each as dotted path, value, bound and cure.

    Examples
    --------
    >>> validate_table(Tacho, {"level": "5000 mV"}, "tacho").level
    5.0
    """
    try:
        return model.model_validate(dict(table))
    except ValidationError as error:
        found = [entry for entry in error.errors() if not _other_choice(entry)]
        entries = found[:MOST_FAULTS]
        places = [entry["loc"] for entry in entries]
        faults = [
            line
            for entry in entries
            # a list all of whose entries are at fault is called too short as well
            if not any(place[:-1][: len(entry["loc"])] == entry["loc"] for place in places)
            or entry["type"] != "too_short"
            for line in _fault_lines(model, entry)
        ]
        if len(found) > len(entries):
            faults.append(f"and {len(found) - len(entries)} more; mend these first")
        if issubclass(model, Scene) and () not in places:
            parts = _valid_parts(model, table)
            faults += model.cross_faults(parts)
            faults += pinned_faults(model, parts.get("pinned", ()))
        raise SceneError(name, faults) from None


def _other_choice(entry: Any) -> bool:
    """The text or boolean member of a union: its number has been reported already."""
    return entry["loc"][-1:] in (("str",), ("bool",)) and entry["type"].startswith(
        ("string_", "bool_")
    )


def _valid_parts(model: type[BaseModel], table: Mapping[str, Any]) -> dict[str, Any]:
    """Parts of a faulty table that are valid on their own, defaults included."""
    parts = {}
    for name, field in model.model_fields.items():
        if name not in table:
            if not field.is_required():
                parts[name] = field.get_default(call_default_factory=True)
            continue
        with suppress(ValidationError):
            kind: Any = Annotated[field.annotation, field]
            parts[name] = TypeAdapter(kind).validate_python(table[name])
    return parts


_TWINS = {
    "diametral_clearance": "radial_clearance",
    "radial_clearance": "diametral_clearance",
    "rated_slip": "synchronous_speed",
    "synchronous_speed": "rated_slip",
}


def without_twin(table: dict[str, Any], key: str) -> None:
    """Remove the other clearance of a joint, or speed of a motor, about to be given one."""
    table.pop(_TWINS.get(key, ""), None)


def merged(base: Any, over: Any) -> Any:
    """Table `over` upon table `base`, at any depth.

    Examples
    --------
    >>> merged({"pin": {"mass": 1.0, "size": 2.0}}, {"pin": {"size": 3.0}})
    {'pin': {'mass': 1.0, 'size': 3.0}}
    """
    if not isinstance(base, Mapping) or not isinstance(over, Mapping):
        return over
    result = dict(base)
    for key, value in over.items():
        without_twin(result, key)
        result[key] = merged(base[key], value) if key in base else value
    return result


def nearest(word: str, choices: Any) -> str:
    """End of an error message: the choice that was probably meant, or all of them."""
    whole = [choice for choice in choices if word in choice.split("_")]
    if len(whole) > 1:  # "clearance" is both of the two clearances
        return f"; did you mean {' or '.join(map(repr, sorted(whole)))}?"
    matches = difflib.get_close_matches(word, list(choices), n=1, cutoff=0.5)
    if matches:
        return f"; did you mean '{matches[0]}'?"
    return f"; choose one of {', '.join(choices)}"


def _fault_lines(model: type[BaseModel], entry: Any) -> list[str]:
    """Turn one pydantic error into lines with path, value, bound and cure."""
    location = entry["loc"]
    if location[-1:] == ("float",):  # the number of a union, not a part of the path
        location = location[:-1]
    path = ".".join(str(part) for part in location)
    kind, context = entry["type"], entry.get("ctx", {})
    owner, field = _find_field(model, location)
    if kind == "extra_forbidden":
        known = owner.model_fields if owner else ()
        return [f"{path} is an unknown key{nearest(str(location[-1]), known)}"]
    about = f" ({field.description})" if field is not None and field.description else ""
    if kind == "missing":
        return [f"{path} is missing{about}; add it"]
    if kind == "value_error":
        text = str(context["error"])
        if text.startswith(("has ", "is not ")):  # from to_si, about this one value
            return [f"{path} = {_short(entry['input'])} {text}"]
        return [f"{path}: {line}" if path else line for line in text.splitlines()]
    return [f"{path} = {_shown(entry['input'], field)} {_bound(entry)}{about}{_cure(entry, field)}"]


def _cure(entry: Any, field: Any) -> str:
    """A number out of bounds has a slipped exponent or a wrong unit."""
    out = entry["type"].startswith(("greater_", "less_"))
    return "; check value and unit" if out and _dimension_of(field) not in (None, "ratio") else ""


_KINDS = {
    "finite_number": "must be finite",
    "float_": "must be a number or a text with a unit",
    "int_": "must be a whole number",
    "string_too_short": "must have >= {min_length} character(s)",
    "string_too_long": "must have <= {max_length} characters",
    "string_": "must be a text",
    "bool_": "must be true or false",
    "too_short": "must have >= {min_length} entries",
    "too_long": "must have <= {max_length} entries",
    "tuple_": "must be a list",
    "list_": "must be a list",
    "model_": "must be a table",
    "dict_": "must be a table",
    "mapping_": "must be a table",
}
"""What a value must be, by the beginning of pydantic's name of the fault."""


def _bound(entry: Any) -> str:
    context = entry.get("ctx", {})
    for key, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        if key in context:
            return f"must be {sign} {context[key]:g}"
    if entry["type"] == "literal_error":
        return f"must be {context['expected']}"
    for beginning, text in _KINDS.items():
        if entry["type"].startswith(beginning):
            return text.format_map(context)
    return "must be of another kind; see a built-in one"  # no kind that a scene has today


def _shown(value: Any, field: Any) -> str:
    dimension = _dimension_of(field)
    if dimension is None or _holds_many(field):
        return _short(value)
    try:
        return f"{to_si(value, dimension):g} {_unit_symbol(dimension)}".rstrip()
    except ValueError:
        return _short(value)


def _holds_many(field: Any) -> bool:
    origin = getattr(field.annotation, "__origin__", None)
    return origin in (dict, tuple)


def _dimension_of(field: Any) -> str | None:
    return next((m.name for m in metadata_of(field) if isinstance(m, Dimension)), None)


def _short(value: Any) -> str:
    """A value for a message, cut where it would bury the rest."""
    text = reprlib.repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


_SHOWN = 60  # characters


def metadata_of(field: Any) -> list[Any]:
    """Metadata of a field, also of ``Annotated[...] | None``."""
    if field is None:
        return []
    arguments = getattr(field.annotation, "__args__", ())
    inner = [m for argument in arguments for m in getattr(argument, "__metadata__", ())]
    return [*field.metadata, *inner]


def _find_field(model: type[BaseModel], location: tuple[Any, ...]) -> tuple[Any, Any]:
    """Model class that owns the last name of a location, and the field where there is one."""
    owner: Any = model
    field = None
    for part in location:
        if isinstance(part, int) or owner is None:
            continue
        field = owner.model_fields.get(part)
        if part != location[-1]:
            owner = model_inside(field.annotation) if field is not None else None
    return owner, field


def si_unit(model: type[BaseModel], path: str) -> str:
    """SI unit of a number of a scene at a dotted path; empty where it has none.

    Examples
    --------
    >>> from wearstate.sim.scene.pump import PumpScene
    >>> si_unit(PumpScene, "joint.crankpin.diametral_clearance"), si_unit(PumpScene, "drive.speed")
    ('m', 'rev/s')
    """
    location = tuple(int(key) if key.isdecimal() else key for key in path.split("."))
    dimension = _dimension_of(_find_field(model, location)[1])
    return "" if dimension is None else _unit_symbol(dimension)


def model_inside(annotation: Any) -> type[BaseModel] | None:
    """Model in an annotation, also in a list or beside None; None where there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (model_inside(inner) for inner in getattr(annotation, "__args__", ()))
    return next((model for model in found if model is not None), None)
