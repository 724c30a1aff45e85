"""Card of a model in its file, and the layout that its recordings must have.

The classes mirror the JSON tables in the file, so that a missing name is a type error.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ...features.catalogue.catalogue import SetName
from ...sim.output.recording import Recording, Table, as_recording
from ...sim.output.sensor import RATE_LEAST, RATE_MOST, Channel
from ..learning.grades import GRADE_NAMES
from .noted import NOTED

_MOST_PULSES = 10**6  # per revolution: a 20-bit encoder

RateHz = Annotated[float, Field(ge=RATE_LEAST, le=RATE_MOST)]
"""Sample rate of a recording [Hz]."""

Pulses = Annotated[int, Field(ge=1, le=_MOST_PULSES)]
"""Pulses of a tacho per revolution."""

Portion = Annotated[float, Field(ge=0, le=1)]
"""A share, rate or probability."""


class Strict(BaseModel):
    """A table with exactly the declared entries; all numbers are finite."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True, frozen=True)

    def table(self) -> dict[str, Any]:
        """Table as in JSON: entries that were given, without defaults."""
        return self.model_dump(exclude_unset=True)


class SetCard(Strict):
    """One candidate feature set."""

    name: str
    values: int = Field(ge=1)
    line_mae_m: float = Field(ge=0)


class FeatureChoice(Strict):
    """Features that a model was trained on, and the candidate sets."""

    set: SetName = "standard"
    only: list[str] = Field(default=[], max_length=100_000)
    candidates: list[SetCard] = Field(default=[], max_length=100)


class ChannelCard(Strict):
    """A channel that a model needs, as :class:`wearstate.sim.output.sensor.Channel`."""

    name: str
    unit: str
    quantity: str
    place: str = ""
    direction: str = ""
    unit_in_file: str = ""


def check_channels(channels: Sequence[ChannelCard], tacho: str | None) -> None:
    """Reject channels with equal names, or a tacho that is none of them.

    Raises
    ------
    ValueError
    """
    names = [channel.name for channel in channels]
    if len(set(names)) < len(names):
        raise ValueError("channels must have different names")
    if tacho is not None and tacho not in names:
        raise ValueError("tacho must be one of the channels")
    if all(name == tacho for name in names):
        raise ValueError("channels must hold a vibration")


_MOST_WEAR_M = 10.0  # clearance, wear-down or offset beyond any machine

_Wear = Annotated[float, Field(gt=0, le=_MOST_WEAR_M)]
_Worn = Annotated[float, Field(ge=0, le=_MOST_WEAR_M)]


class TrainedOn(Strict):
    """Training data of a model, and how records were held out."""

    records: int = Field(ge=1)
    draws: int = Field(ge=1)
    draw_identity: str
    held_out_share: Portion
    split_seed: int
    split: str = ""
    split_sha256: str = ""
    training_groups: list[int]
    training_signals: list[int]
    scene: str
    recipe: str


class HealthyFeatures(Strict):
    """Features of as-new machines, one number per feature."""

    mean: list[float]
    spread: list[float]


class TrainedCondition(Strict):
    """Range of an operating condition; without a feature it was noted with the recording."""

    name: str
    feature: str
    unit: str
    low: float
    high: float


class TriedModel(Strict):
    """A candidate: its time per recording [ms] and its error on machines left out [m]."""

    name: str
    cost_ms: float
    mae_m: float
    on_front: bool


class ChosenModel(Strict):
    """The chosen model and its errors."""

    chosen: str
    members: dict[str, float]
    nested_mae_m: float
    informed_mae_m: float | None = None
    candidates: list[TriedModel]


class ConfounderRates(Strict):
    """Detection of a fault other than the wear, and its effect on the estimate."""

    name: str
    share: Portion
    detection_rate: Portion
    false_alarm_rate: Portion
    mae_with_m: float = Field(ge=0)
    mae_without_m: float = Field(ge=0)
    visible_from_m: float | None = Field(gt=0)
    members: dict[str, float]


class StrangerRates(Strict):
    """How recordings of a kind that a model must refuse are distinguished from familiar ones.

    Rates are from machines not used in the fit: refused share of this kind and of familiar ones.
    """

    name: str
    records: int = Field(ge=1)
    detection_rate: Portion
    false_alarm_rate: Portion


class LayoutCard(Strict):
    """Required layout of a recording that is an input of a model, or of one of its views."""

    channels: list[ChannelCard] = Field(min_length=1)
    sample_rate_hz: RateHz
    tacho: str | None
    pulses_per_revolution: Pulses

    @model_validator(mode="after")
    def _channels_fit(self) -> Self:
        check_channels(self.channels, self.tacho)
        return self

    def recording_of(self, given: Recording | NDArray[Any] | Table, fs: float | None) -> Recording:
        """Return a recording unchanged; give an array or a table the channels of the model.

        Parameters
        ----------
        given : Recording, numpy.ndarray [shape=(n_channels, n_samples)] or pandas.DataFrame
            Channels in the order and units of the model; a table has one column per channel.
        fs : float or None
            Sample rate of an array or a table [Hz]; a recording has its own.

        Raises
        ------
        DataError
            An array has no rate or other channels, or a rate is given for a recording.
        """
        if isinstance(given, Recording):
            return as_recording(given, fs)
        channels = [Channel(**channel.model_dump()) for channel in self.channels]
        pulses = self.pulses_per_revolution
        return as_recording(given, fs, channels, tacho=self.tacho, pulses_per_revolution=pulses)


class ModelCard(LayoutCard):
    """Card of a wear model, validated so that readers need no checks."""

    created_by: str
    origin: Literal["simulated", "measured"]
    trained_on: TrainedOn
    severity: str = Field(pattern=r"^\w+_\w+_m$")
    severity_range_m: list[_Worn] = Field(min_length=2, max_length=2)
    grade_edges_m: list[_Wear] = Field(
        min_length=len(GRADE_NAMES) - 1, max_length=len(GRADE_NAMES) - 1
    )
    condemning_limit_m: _Wear
    limit_source: str
    views: dict[str, LayoutCard] = Field(default_factory=dict)
    features: list[str] = Field(min_length=1)
    feature_choice: FeatureChoice = FeatureChoice()
    conditions: list[TrainedCondition]
    healthy_features: HealthyFeatures
    mode: Literal["cold", "referenced"]
    baseline_records: int = Field(ge=0)
    budget_ms: float = Field(gt=0)
    model: ChosenModel
    confounders: list[ConfounderRates]
    strangers: list[StrangerRates] = Field(default_factory=list)

    @model_validator(mode="after")
    def _fits_itself(self) -> Self:
        n = len(self.features)
        if len(self.healthy_features.mean) != n or len(self.healthy_features.spread) != n:
            raise ValueError("healthy_features must have one number per feature")
        edges, limit = self.grade_edges_m, self.condemning_limit_m
        if not all(low < high for low, high in pairwise(edges)):
            raise ValueError(f"grade_edges_m = {edges} m must rise, each above the one before")
        if limit < edges[-1]:
            raise ValueError(f"condemning_limit_m = {limit:g} m must be >= the last grade edge")
        for name, (low, high) in self._ranges():
            if low > high:
                raise ValueError(f"{name} = {low:g} to {high:g} must rise")
        if not {c.feature for c in self.conditions} <= {"", *self.features}:
            raise ValueError("conditions must name features")
        if not {c.name for c in self.conditions if not c.feature} <= set(NOTED):
            raise ValueError(f"conditions that are noted must be of {', '.join(NOTED)}")
        return self

    def _ranges(self) -> list[tuple[str, tuple[float, float]]]:
        """Entries with a low and a high end."""
        low, high = self.severity_range_m
        return [
            ("severity_range_m", (low, high)),
            *((f"condition {one.name}", (one.low, one.high)) for one in self.conditions),
        ]

    @property
    def noted_names(self) -> tuple[str, ...]:
        """Conditions that varied in training and cannot be inferred from the signals."""
        return tuple(one.name for one in self.conditions if not one.feature)


class ClassCard(LayoutCard):
    """Card of a model of named conditions."""

    created_by: str
    origin: Literal["simulated", "measured"]
    target: str
    classes: list[str] = Field(min_length=2, max_length=100)
    records: int = Field(ge=1)
    split_seed: int
    training_signals: list[int]
    features: list[str] = Field(min_length=1)
    feature_choice: FeatureChoice = FeatureChoice()

    @model_validator(mode="after")
    def _fits_itself(self) -> Self:
        if self.classes != sorted(set(self.classes)):
            raise ValueError("classes must be different, in alphabetical order")
        return self
