"""Base of all scenes: wear and condition quantities, channels, validation of a whole table.

Validation reports all faults together, each as a dotted path with value, bound and cure, and
suggests the nearest match of an unknown key. Kernels trust validated scenes.
"""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeVar

from pydantic import BaseModel, Field, TypeAdapter, ValidationError, model_validator

from ..brief import short
from ..output.recording import extent_text, html_table
from ..output.sensor import SIMULATED_RATE_LEAST, SIMULATED_RATE_MOST, Channel
from ..parts.dimensions import Frequency, Length, Ratio, Time
from ..parts.limits import LONGEST
from ..parts.part import Part
from ..parts.sensors import Tacho
from ..parts.wording import fault_lines, nearest

Table = TypeVar("Table", bound=BaseModel)

_RECORDING_LONGEST = 3600.0  # s
_STEP_LEAST = 1e-12  # s
_SETTLING_MOST = 1000


class SceneError(ValueError):
    """All faults of one scene, one line each, as dotted path, value, bound and cure."""

    def __init__(self, name: str, faults: list[str]) -> None:
        self.name = name
        self.faults = faults
        super().__init__("\n".join([f"{name}: {len(faults)} fault(s)", *faults]))

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:
        """How it leaves a worker process."""
        return type(self), (self.name, self.faults)


class Wear(Part):
    """Limits of a clearance, all diametral, and their source."""

    as_new_diametral: Length = Field(
        gt=0, le=LONGEST, description="smallest clearance of a new joint"
    )
    condemning_diametral: Length = Field(
        gt=0, le=LONGEST, description="clearance above which the joint must be renewed"
    )
    grade_edges_diametral: tuple[Length, Length, Length] = Field(
        description="clearance at which grades 1, 2 and 3 begin"
    )
    source: str = Field(
        min_length=1, description="origin of the limits: standard, maker or judgement"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        refuse_disorder(self.as_new, self.grade_edges, self.condemning, "_diametral")
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


def refuse_disorder(
    as_new: float, edges: tuple[float, ...], condemning: float, suffix: str = ""
) -> None:
    """Refuse limits [m] that do not rise; their names in the scene end in the suffix."""
    values = (as_new, *edges)
    if any(low >= high for low, high in pairwise(values)):
        raise ValueError(
            f"as_new{suffix} and grade_edges{suffix} = {', '.join(f'{v:g} m' for v in values)} "
            "must rise strictly; reorder them"
        )
    if edges[-1] != condemning:
        raise ValueError(
            f"grade_edges{suffix}[2] = {edges[-1]:g} m must equal condemning{suffix} = "
            f"{condemning:g} m; grade 3 is condemned"
        )


class Numerics(Part):
    """Settings of the solver; the defaults depend on the scene."""

    step: Time | None = Field(default=None, ge=_STEP_LEAST, description="largest integration step")


class WearPlace(NamedTuple):
    """Wear quantity of a scene [m]."""

    path: str
    """Dotted path; ``*`` stands for the index of a list entry, counted from 0."""
    place: str
    """Worn part; ``{}`` stands for that index counted from 1, as throws are counted."""
    words: str
    limits: str = ""
    """Table of the scene with its limits; without limits a severity has no grade."""

    @property
    def kind(self) -> str:
        """Beginning of its column names: the last key of its path."""
        return self.path.rpartition(".")[2]

    @property
    def column(self) -> str:
        """Manifest column."""
        return f"{self.kind}_{self.place}_m"


class ConditionPlace(NamedTuple):
    """Operating condition of a scene [SI]."""

    path: str
    column: str
    """Manifest column; ends in the unit."""
    words: str


SPEED = ConditionPlace("drive.speed", "speed_hz", "shaft speed, as set")
"""Condition of every machine."""

START_ANGLE = ConditionPlace(
    "drive.start_angle", "start_angle_rad", "shaft angle at the first sample"
)

VISCOSITY = ConditionPlace(
    "oil.dynamic_viscosity", "viscosity_pa_s", "dynamic viscosity of the oil"
)


class Scene(Part):
    """Base of every machine's scene.

    With ``fidelity = "auto"`` the rungs and numerics written in a scene are replaced by the
    cheapest that meet ``accuracy``, except for the effects in ``pinned``.

    A machine's scene is a subclass, one row of :data:`.scene.load.MACHINES`. Its class variables
    describe the machine without its physics.

    Attributes
    ----------
    physics : str
        Module with ``MACHINE``, a :class:`wearstate.sim.machine.registry.MachinePhysics`. It is
        given by name, so that a scene can be read without loading kernels.
    effects : tuple of str
        Names of the effects, as used in ``pinned``.
    wear_places : tuple of WearPlace
    condition_places : tuple of ConditionPlace
    """

    physics: ClassVar[str]
    effects: ClassVar[tuple[str, ...]] = ()
    wear_places: ClassVar[tuple[WearPlace, ...]] = ()
    condition_places: ClassVar[tuple[ConditionPlace, ...]] = (SPEED,)

    name: str = Field(min_length=1, description="name of the scene, kept with every recording")
    machine: str
    description: str = Field(default="", description="one sentence, for lists")
    duration: Time = Field(
        gt=0, le=_RECORDING_LONGEST, description="length of the recording, after settling"
    )
    sample_rate: Frequency = Field(
        ge=SIMULATED_RATE_LEAST, le=SIMULATED_RATE_MOST, description="sample rate of every channel"
    )
    settling_revolutions: int = Field(
        default=3, ge=1, le=_SETTLING_MOST, description="revolutions before the recording"
    )
    accuracy: Ratio = Field(default=0.02, gt=0, lt=1, description="largest error of the features")
    fidelity: Literal["given", "auto"] = Field(
        default="given",
        description="given: rungs and numerics of the scene; auto: the cheapest that are accurate",
    )
    pinned: tuple[str, ...] = Field(
        default=(), description="effects that fidelity = 'auto' does not change"
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
        """Machine, name and extent of a recording."""
        extent = extent_text(self.duration, self.sample_rate)
        return f"<{type(self).__name__} {self.name}, {extent}>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """The same for notebooks, with the scene's parts."""
        parts = {name: short(getattr(self, name)) for name in type(self).model_fields}
        rows = [(name, text) for name, text in parts.items() if text]
        return html_table(repr(self)[1:-1], ["part", ""], rows)

    @abstractmethod
    def sensor_channels(self) -> tuple[Channel, ...]:
        """Channels of the sensors, in order."""

    @abstractmethod
    def sensor_parts(self) -> tuple[Any, ...]:
        """Sensors with a range and a noise, one for each sensor channel, in order."""

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between those parts that are present; each machine has its own."""
        del parts
        return []


def machine_name(kind: type[Scene]) -> str:
    """Name of a scene type in its ``machine`` key.

    Examples
    --------
    >>> from wearstate.sim.scene.pump import PumpScene
    >>> machine_name(PumpScene)
    'reciprocating-pump'
    """
    return str(kind.model_fields["machine"].annotation.__args__[0])  # type: ignore[union-attr]


def pinned_faults(kind: type[Scene], pinned: Sequence[str]) -> list[str]:
    """Pinned names that are no effects of a type of scene, as sentences.

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
    """Faults between parts, from those checks whose parts are all present."""
    return [
        fault
        for check, needs in checks
        if all(need in parts for need in needs)
        for fault in check(*(parts[need] for need in needs))
    ]


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
"""Number of faults of one input that are listed individually."""


def validate_table(model: type[Table], table: Mapping[str, Any], name: str) -> Table:
    """Validate a plain table into any model, and report all faults in this program's words.

    Raises
    ------
    SceneError
        All faults together, each as dotted path, value, bound and cure.

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
            # a list whose entries are all at fault is reported as too short as well
            if not any(place[:-1][: len(entry["loc"])] == entry["loc"] for place in places)
            or entry["type"] != "too_short"
            for line in fault_lines(model, entry)
        ]
        if len(found) > len(entries):
            faults.append(f"and {len(found) - len(entries)} more; correct these first")
        if issubclass(model, Scene) and () not in places:
            parts = _valid_parts(model, table)
            faults += model.cross_faults(parts)
            faults += pinned_faults(model, parts.get("pinned", ()))
        raise SceneError(name, faults) from None


def _other_choice(entry: Any) -> bool:
    """Whether this is another member of a union whose number has been reported already."""
    return entry["loc"][-1:] in (("str",), ("bool",)) and entry["type"].startswith(
        ("string_", "bool_")
    )


def _valid_parts(model: type[BaseModel], table: Mapping[str, Any]) -> dict[str, Any]:
    """Parts of a faulty table that are valid on their own, including defaults."""
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
