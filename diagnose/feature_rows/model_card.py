"""What a model says of itself: the card in its file, and what a recording must have for it.

Kept as the tables of JSON that they are in the file; a name that a card lacks is a fault of types.
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

_MOST_PULSES = 10**6  # of a tacho in a revolution: an encoder of 20 bit

RateHz = Annotated[float, Field(ge=RATE_LEAST, le=RATE_MOST)]
"""Sample rate that a recording can have [Hz]."""

Pulses = Annotated[int, Field(ge=1, le=_MOST_PULSES)]
"""Pulses of a tacho in a revolution."""

Portion = Annotated[float, Field(ge=0, le=1)]
"""A share, rate or probability."""


class Strict(BaseModel):
    """A table that holds what it must and nothing else; no number in it is infinite or none."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True, frozen=True)

    def table(self) -> dict[str, Any]:
        """As JSON has it: what was given, without what is taken for granted."""
        return self.model_dump(exclude_unset=True)


class SetCard(Strict):
    """One set of features that was looked at."""

    name: str
    values: int = Field(ge=1)
    line_mae_m: float = Field(ge=0)


class FeatureChoice(Strict):
    """Features that a model was trained on, and the sets that they were chosen among."""

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
    """Refuse channels that are not told apart by name, or a tacho that is none of them.

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
    """What a model was trained on, and how records were held out."""

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
    """Features of as-new machines, one number for each."""

    mean: list[float]
    spread: list[float]


class TrainedCondition(Strict):
    """Range of an operating condition; without a feature it was noted beside the recording."""

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
    """What was chosen among the candidates, and how it errs."""

    chosen: str
    members: dict[str, float]
    nested_mae_m: float
    informed_mae_m: float | None = None
    candidates: list[TriedModel]


class ConfounderRates(Strict):
    """How a fault beside the wear is found, and what it does to the estimate."""

    name: str
    share: Portion
    detection_rate: Portion
    false_alarm_rate: Portion
    mae_with_m: float = Field(ge=0)
    mae_without_m: float = Field(ge=0)
    visible_from_m: float | None = Field(gt=0)
    members: dict[str, float]


class StrangerRates(Strict):
    """How recordings of a kind that a model must refuse are told from familiar ones.

    Rates are of machines without part in the fit: of this kind refused, and of familiar ones.
    """

    name: str
    records: int = Field(ge=1)
    detection_rate: Portion
    false_alarm_rate: Portion


class LayoutCard(Strict):
    """What a recording must have to be an input of a model, or one of its views."""

    channels: list[ChannelCard] = Field(min_length=1)
    sample_rate_hz: RateHz
    tacho: str | None
    pulses_per_revolution: Pulses

    @model_validator(mode="after")
    def _channels_fit(self) -> Self:
        check_channels(self.channels, self.tacho)
        return self

    def recording_of(self, given: Recording | NDArray[Any] | Table, fs: float | None) -> Recording:
        """A recording as it is; an array or a table with the channels of the model.

        Parameters
        ----------
        given : Recording, numpy.ndarray [shape=(n_channels, n_samples)] or pandas.DataFrame
            Channels in the order and units of the model's; a table has a column for each.
        fs : float or None
            Sample rate of an array or a table [Hz]; a recording has its own.

        Raises
        ------
        DataError
            An array has no rate or other channels, or a recording is given a rate.
        """
        if isinstance(given, Recording):
            return as_recording(given, fs)
        channels = [Channel(**channel.model_dump()) for channel in self.channels]
        pulses = self.pulses_per_revolution
        return as_recording(given, fs, channels, tacho=self.tacho, pulses_per_revolution=pulses)


class ModelCard(LayoutCard):
    """What the card of a wear model must hold, so that nothing that reads it can fail."""

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
        """What has a low and a high end."""
        low, high = self.severity_range_m
        return [
            ("severity_range_m", (low, high)),
            *((f"condition {one.name}", (one.low, one.high)) for one in self.conditions),
        ]

    @property
    def noted_names(self) -> tuple[str, ...]:
        """Conditions that varied where the model was trained and that its signals do not tell."""
        return tuple(one.name for one in self.conditions if not one.feature)


class ClassCard(LayoutCard):
    """The same of a model of named conditions."""

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
