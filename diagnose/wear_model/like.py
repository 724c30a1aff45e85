"""Profile of the recordings that a model wants: channels, units, rate and tacho."""

import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ...datasets.source.channel_units import known_unit
from ...datasets.source.part import Profile
from ...sim.output.recording import DataError, missing_file
from ..feature_rows.model_card import Pulses, RateHz
from .bundle import kind_of, load_bundle

_LARGEST = 2**24  # byte


class _Channel(BaseModel):
    """What of a channel a profile needs; a description may say more."""

    name: str = Field(min_length=1)
    unit: str
    unit_in_file: str = ""


class _Wanted(BaseModel):
    """Part of a model's card, and of what `info --json` prints."""

    model_config = ConfigDict(extra="ignore")

    channels: list[_Channel] = Field(min_length=1)
    sample_rate_hz: RateHz
    tacho: str | None = None
    pulses_per_revolution: Pulses = 1


def read_profile(path: Path) -> tuple[Profile, str | None, int]:
    """Profile, tacho and pulses per revolution of a model file, or of a JSON description.

    Parameters
    ----------
    path : Path
        ``.wsm``, or the JSON that ``wearstate info --json`` prints of a model or a data set.

    Raises
    ------
    DataError, ModelError
        No such file, damaged, or no description of recordings.
    """
    is_model = path.suffix == ".wsm"
    table: object = load_bundle(path, kind_of(path)).card if is_model else _described(path)
    try:
        wanted = _Wanted.model_validate(table)
    except ValidationError as error:
        words = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise DataError(
            f"{path}: {words}; give a model, or what info --json prints of one"
        ) from None
    units = {
        # numbers that declare no unit are as those that the model was trained on
        c.name: c.unit_in_file if known_unit(c.unit_in_file) else c.unit
        for c in wanted.channels
        if c.name != wanted.tacho
    }
    profile = Profile(
        source=path.name,
        channels=tuple(c.name for c in wanted.channels),
        units=units,
        sample_rate=wanted.sample_rate_hz,
    )
    return profile, wanted.tacho, wanted.pulses_per_revolution


def _described(path: Path) -> object:
    if not path.is_file():
        raise DataError(missing_file(path, "name a model or a description of one"))
    if path.stat().st_size > _LARGEST:
        raise DataError(f"{path} has {path.stat().st_size} byte, must be <= {_LARGEST}; check it")
    try:
        return json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path} is no JSON ({error}); save what info --json prints") from None
