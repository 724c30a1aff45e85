"""Shaker or instrumented hammer of a scene: its force, and what its force cell reads.

The force signal is made in :mod:`.excitation.forces`.
"""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ..output.sensor import Channel
from ..parts.dimensions import Angle, Force, Frequency, Length, Ratio, Time
from ..parts.limits import FORCE_MOST, GAIN_LEAST, GAIN_MOST, LONGEST, NAME_LONGEST
from ..parts.part import Part
from .scene import Scene

_RANGE_LEAST = 1e-6  # N
_FREQUENCY_MOST = 1e6  # Hz
_LONGEST = 3600.0  # s
_MOST_REPEATS = 10_000
_SCATTER_MOST = 0.5  # of the logarithm of a peak, or rad: a larger scatter is no hammer test

Kind = Literal["random", "burst-random", "sweep", "stepped-sine", "hammer"]


class Exciter(Part):
    """A shaker or a hammer; with ``force = 0`` it is not mounted and has no channel.

    ``repeats`` are spread evenly over the recording after ``quiet``: bursts, sweeps, frequencies of
    a stepped sine, blows. The force is what acts on the machine. That a shaker delivers less at a
    resonance is not modelled and need not be, since the cell reads the acting force.
    """

    name: Annotated[str, Field(min_length=1, max_length=NAME_LONGEST)] = Field(
        default="force", description="name of the force cell's channel"
    )
    kind: Kind = Field(default="random", description="waveform of the force")
    force: Force = Field(
        default=0.0, ge=0, le=FORCE_MOST, description="rms while active; hammer: median peak"
    )
    low: Frequency = Field(
        default=5.0, gt=0, le=_FREQUENCY_MOST, description="lower end of the band"
    )
    high: Frequency = Field(
        default=400.0, gt=0, le=_FREQUENCY_MOST, description="upper end of the band"
    )
    quiet: Time = Field(default=0.0, ge=0, le=_LONGEST, description="pause before the force begins")
    repeats: int = Field(
        default=20, ge=1, le=_MOST_REPEATS, description="blows or periods in a recording"
    )
    share: Ratio = Field(default=0.6, gt=0, le=1, description="active share of a burst or sweep")
    contact_time: Time = Field(
        default=2.5e-3, gt=0, le=1.0, description="duration of a blow's half-sine, set by the tip"
    )
    peak_scatter: Ratio = Field(
        default=0.2,
        ge=0,
        le=_SCATTER_MOST,
        description="scatter of the logarithm of the blows' peaks",
    )
    angle_scatter: Angle = Field(
        default=0.0, ge=0, le=_SCATTER_MOST, description="scatter of the blows' direction"
    )
    double_hits: Ratio = Field(default=0.0, ge=0, le=1, description="share of blows that rebound")
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    noise: Force = Field(default=0.0, ge=0, le=FORCE_MOST, description="rms of white noise")
    range: Force = Field(
        ge=_RANGE_LEAST, le=FORCE_MOST, description="full scale of the cell, plus and minus"
    )
    bits: int = Field(default=24, ge=8, le=32, description="resolution of the converter")

    @model_validator(mode="after")
    def _band(self) -> Self:
        if self.low >= self.high:
            raise ValueError(
                f"low = {self.low:g} Hz must be < high = {self.high:g} Hz; exchange them or check "
                "the unit"
            )
        return self

    @property
    def mounted(self) -> bool:
        """Whether it acts and is recorded."""
        return self.force > 0


class CasingExciter(Exciter):
    """A shaker or hammer on the casing of a pump, whose modes have one direction at each place."""

    place: Annotated[str, Field(min_length=1, max_length=NAME_LONGEST)] = Field(
        description="place in the mode shapes: of a force or a sensor"
    )
    direction: str = Field(default="", description="direction of the force, for the report")

    @model_validator(mode="after")
    def _straight(self) -> Self:
        if self.angle_scatter:
            raise ValueError(
                f"angle_scatter = {self.angle_scatter:g} rad must be 0 on a casing, whose modes "
                "have one direction at each place; remove it"
            )
        return self


class ShaftExciter(Exciter):
    """A shaker or hammer on the shaft or on a bearing's housing, while the line runs.

    No test at standstill is modelled: the journals would then lie on metal. Blows on the shaft
    also scatter along it.
    """

    place_scatter: Length = Field(
        default=0.0, ge=0, le=1.0, description="scatter of the blows along the shaft"
    )
    place: str = Field(
        default="", max_length=NAME_LONGEST, description="name of a bearing or a disc"
    )
    station: Length | None = Field(
        default=None,
        ge=0,
        le=LONGEST,
        description="station on the shaft, instead of a place",
    )
    part: Literal["shaft", "housing"] = Field(default="shaft", description="part that it acts on")
    direction: Literal["up", "side"] = Field(default="up", description="up or side")

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        faults = []
        if bool(self.place) == (self.station is not None):
            faults.append(
                f"{'both' if self.place else 'neither'} of place and station given, must be "
                "exactly one; remove or add one"
            )
        if self.part == "housing" and self.place_scatter:
            faults.append(
                f"place_scatter = {self.place_scatter:g} m must be 0 on a housing, which does not "
                "tilt in this model; set part = 'shaft' or remove it"
            )
        if self.part == "housing" and self.station is not None:
            faults.append(
                f"station = {self.station:g} m names no housing; name a bearing as place instead"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    @property
    def where(self) -> str:
        """Description for people: ``shaft at forward``, ``housing of forward``."""
        if self.part == "housing":
            return f"housing of {self.place}"
        return f"shaft at {self.place or f'{self.station:g} m'}"


def force_channel(part: Exciter, place: str, direction: str) -> Channel:
    """Channel of the force cell, named by place and direction.

    Examples
    --------
    >>> force_channel(Exciter(range=10.0), "shaft at forward", "vertical, up").label
    'force [N]'
    """
    return Channel(name=part.name, unit="N", quantity="force", place=place, direction=direction)


def pushing_faults(scene: Scene, exciters: Sequence[Exciter]) -> list[str]:
    """Faults of all exciters of a scene, by :func:`exciter_faults`."""
    times = {"duration": scene.duration, "sample_rate": scene.sample_rate}
    return [
        fault
        for i, part in enumerate(exciters)
        for fault in exciter_faults(f"exciters.{i}", part, **times)
    ]


def exciter_faults(
    path: str, part: Exciter, *, duration: float, sample_rate: float
) -> Iterator[str]:
    """Conflicts of an exciter with the recording, as sentences; none if it is not mounted.

    Parameters
    ----------
    path : str
        Dotted path of the exciter in the scene.
    part : Exciter
    duration : float
        Length of the recording [s].
    sample_rate : float
        Sampling rate [Hz].

    Examples
    --------
    >>> shaker = Exciter(force=10.0, range=100.0, high=600.0)
    >>> [fault] = exciter_faults("exciters.0", shaker, duration=4.0, sample_rate=1000.0)
    >>> fault.split(";")[0]
    'exciters.0.high = 600 Hz must be <= 500 Hz, half the sample rate'
    """
    if not part.mounted:
        return
    stretch = (duration - part.quiet) / part.repeats
    if part.quiet >= duration:
        yield (
            f"{path}.quiet = {part.quiet:g} s must be < duration = {duration:g} s; shorten it or "
            "record longer"
        )
        return
    if part.kind == "hammer":
        yield from _blow_faults(path, part, stretch, sample_rate)
        return
    if part.high > sample_rate / 2:
        yield (
            f"{path}.high = {part.high:g} Hz must be <= {sample_rate / 2:g} Hz, half the sample "
            "rate; lower it or raise sample_rate"
        )
    if part.kind != "random":
        yield from _burst_faults(path, part, stretch)


def _blow_faults(path: str, part: Exciter, stretch: float, sample_rate: float) -> Iterator[str]:
    least, most = 2 / sample_rate, stretch / 10
    if not least <= part.contact_time <= most:
        yield (
            f"{path}.contact_time = {part.contact_time:g} s must be >= {least:g} s, two samples, "
            f"and <= {most:g} s, a tenth of the time for a blow; change the tip, the sample_rate "
            "or the repeats"
        )


def _burst_faults(path: str, part: Exciter, stretch: float) -> Iterator[str]:
    stepped = part.kind == "stepped-sine"
    # the settled half of a dwell holds whole periods, so frequencies differ by one per half or more
    turns = (part.high - part.low) * stretch / 2 if stepped else part.low * part.share * stretch
    least = part.repeats - 1 if stepped else 1
    if turns < least:
        yield (
            f"{path}.repeats = {part.repeats} leaves {stretch:g} s for each, too short for "
            f"{'frequencies that differ' if stepped else 'one period of low'}; must be fewer, or "
            "record longer"
        )
