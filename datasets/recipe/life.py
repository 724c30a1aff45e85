"""Run to failure: every machine of a recipe over its life, recorded again and again.

A recipe with a ``[life]`` table does not draw its first severity; it follows from how the machine
wears. Manifest columns beside it are those of `LIFE_COLUMNS`.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast

import numpy as np
from pydantic import Field, model_validator

from ...sim.parts.dimensions import Length, Ratio, RotationSpeed, Time
from ...sim.parts.limits import LONGEST
from ...sim.parts.part import Part
from ...sim.scene.journal import JournalScene
from ...sim.scene.load import override, scene_from_table
from ...sim.scene.pump import PumpScene
from ...sim.scene.scene import Scene
from ...sim.wear.archard import WEAR_RATE_MOST, dufrane_depth, dufrane_volume, widening
from ...sim.wear.life import LifeHistory, Maintenance, RunningIn, WearLaw, life_history
from .text import RecipeError

if TYPE_CHECKING:
    from ...sim.wear.rate import JointWear

LIFE_COLUMNS = {
    "operating_hours": "<f8",
    "remaining_life_h": "<f8",
    "life_share": "<f8",
    "maintenance": "<i4",
    "wear_rate_m2_per_n": "<f8",
}
"""Manifest columns of a life -> numpy type.

``remaining_life_h`` counts operating hours until the condemning limit is next reached, maintenance
on the way included: 0 at the limit and beyond it, NaN where the policy keeps the machine from it.
``life_share`` is the age of the surface over the age at which it is renewed, whether planned or
after a failure. ``maintenance`` counts what was done so far, ``wear_rate_m2_per_n`` is the
machine's own. All of them tell the severity or what it will be: they are labels, no features.
"""

_HOUR = 3600.0  # s


class TurningGear(Part):
    """The turning gear, on which a journal bearing wears."""

    speed: RotationSpeed = Field(gt=0, le=10, description="a few revolutions a minute")
    share: Ratio = Field(gt=0, le=1, description="of the operating time")
    least_film: Length = Field(gt=0, le=LONGEST, description="at which asperities begin to touch")


class MaintenanceTable(Part):
    """Something done to the joint; give `every` or `at`."""

    restores: Ratio = Field(gt=0, le=1, description="share of the worn volume; 1 renews")
    every: Time | None = Field(default=None, gt=0, description="operating time between two")
    at: Length | None = Field(default=None, gt=0, description="severity at which it is due")

    @model_validator(mode="after")
    def _one_occasion(self) -> Self:
        _ = self.rule
        return self

    @property
    def rule(self) -> Maintenance:
        """For the history."""
        return Maintenance(restores=self.restores, every=self.every, at=self.at)


class LifeTable(Part):
    """How the machines of a recipe age.

    The surface is new at the low bound of the first severity or up to `as_new_most`, and fails at
    the high bound, where it is renewed.
    """

    spacing: Time = Field(gt=0, description="operating time from one recording to the next")
    jitter: Ratio = Field(
        default=0.5, ge=0, le=1, description="of the spacing: where in it a recording falls"
    )
    wear_rate: float = Field(
        ge=0, le=WEAR_RATE_MOST, description="m^2/N, median of the machines; 1 mm^3/(N m) is 1e-9"
    )
    spread: Ratio = Field(
        default=0.0, ge=0, le=3, description="of its logarithm between machines, normal"
    )
    as_new_most: Length | None = Field(
        default=None, gt=0, description="widest new joint; none: all at the low bound"
    )
    running_in: Ratio = Field(
        default=0.0, ge=0, le=100, description="of a new surface, over the steady rate"
    )
    running_in_time: Time = Field(default=_HOUR, gt=0, description="in which that falls to 1/e")
    knots: int = Field(default=6, ge=2, le=64, description="severities at which the rate is found")
    width: Length | None = Field(
        default=None, gt=0, le=LONGEST, description="of a joint along its pin, of a guide across"
    )
    turning: TurningGear | None = Field(default=None, description="of a journal bearing")
    maintenance: tuple[MaintenanceTable, ...] = Field(
        default=(), max_length=16, description="what is renewed, and when"
    )


class Moment(NamedTuple):
    """One recording in the life of a machine."""

    severity: float  # [m]
    labels: dict[str, float | int]  # columns of `LIFE_COLUMNS`


@dataclass(frozen=True, kw_only=True)
class Lives:
    """The lives of all machines of a recipe.

    Attributes
    ----------
    table : LifeTable
    base : mapping
        Table of the scene that wears; all machines wear as it does but for their wear rate.
    path : str
        Of the severity.
    low, high : float
        As new and at failure [m].
    limit : float
        That condemns [m].
    recordings : int
        Of every machine.
    """

    table: LifeTable
    base: Mapping[str, Any]
    path: str
    low: float
    high: float
    limit: float
    recordings: int

    @cached_property
    def law(self) -> WearLaw:
        """How the joint wears, from simulations at a few severities.

        Raises
        ------
        RecipeError
            One of them failed, or nothing slides.
        """
        try:
            return _LAWS[self.path](self)
        except (ValueError, RuntimeError) as error:  # SceneError; SimulationError, BearingError
            raise RecipeError("life", [f"life: wear of {self.path}: {error}"]) from None

    def scene(self, severity: float) -> Scene:
        """The scene at a severity [m]."""
        return scene_from_table(override(self.base, {self.path: severity}))

    def history(self, rng: np.random.Generator) -> LifeHistory:
        """Life of the machine that a random stream stands for."""
        table = self.table
        rate = table.wear_rate * math.exp(table.spread * rng.standard_normal())
        return life_history(
            self.law,
            rate,
            as_new=self._as_new(rng),
            limit=self.limit,
            end=self.high,
            until=self.recordings * table.spacing,
            running_in=RunningIn(excess=table.running_in, time=table.running_in_time),
            maintenance=[entry.rule for entry in table.maintenance],
        )

    def _as_new(self, rng: np.random.Generator) -> Iterator[float]:
        most = self.low if self.table.as_new_most is None else self.table.as_new_most
        while True:
            yield float(rng.uniform(self.low, most))

    def moment(
        self, machine: np.random.Generator, record: np.random.Generator, place: int
    ) -> Moment:
        """One recording of a machine.

        Parameters
        ----------
        machine, record : numpy.random.Generator
            Random streams of machine and recording, fresh.
        place : int
            Of the recording in the machine's life, counted from 0.

        Returns
        -------
        Moment
        """
        life = self.history(machine)
        within = 0.5 + self.table.jitter * (record.random() - 0.5)
        time = (place + within) * self.table.spacing
        labels: dict[str, float | int] = {
            "operating_hours": time / _HOUR,
            "remaining_life_h": life.remaining(time) / _HOUR,
            "life_share": life.share(time),
            "maintenance": life.events(time),
            "wear_rate_m2_per_n": life.wear_rate,
        }
        return Moment(life.severity(time), labels)


def life_faults(
    table: LifeTable, path: str, low: float, high: float, limit: float | None
) -> list[str]:
    """What of a life does not fit the rest of its recipe.

    Parameters
    ----------
    table : LifeTable
    path : str
        Of the first severity.
    low, high : float
        Its bounds [m].
    limit : float or None
        That condemns [m]; None where the scene has none.

    Returns
    -------
    list of str
    """
    if path not in _LAWS:
        known = ", ".join(_LAWS)
        return [f"life: severity.0.path = '{path}' must be one whose wear is modelled: {known}"]
    faults = []
    if limit is None:
        faults.append(f"life: the scene has no wear limits of {path}; add them to the scene")
    elif not low < limit <= high:
        faults.append(
            f"life: the condemning limit = {limit:g} m must be > severity.0.low = {low:g} m and "
            f"<= severity.0.high = {high:g} m, where the joint fails; widen the bounds"
        )
    need = "turning" if path == _SCAR else "width"
    if getattr(table, need) is None:
        faults.append(f"life.{need} is missing; the wear of {path} needs it")
    most = low if table.as_new_most is None else table.as_new_most
    if not low <= most < high:
        faults.append(
            f"life.as_new_most = {most:g} m must be >= severity.0.low = {low:g} m and < "
            f"severity.0.high = {high:g} m; lower it"
        )
    faults += [
        f"life.maintenance.{i}.at = {rule.at:g} m must be > {most:g} m, as new, and < {high:g} m, "
        "where the joint fails; move it between"
        for i, rule in enumerate(table.maintenance)
        if rule.at is not None and not most < rule.at < high
    ]
    return faults


# --- how each severity wears


def _knots(lives: Lives) -> list[float]:
    """Closer where the joint is new: there a film's load share changes most."""
    return [float(knot) for knot in np.geomspace(lives.low, lives.high, lives.table.knots)]


def _pin_law(joint: str, lives: Lives) -> WearLaw:
    """The eye's scar keeps its mean shape, so that the play grows with the volume."""
    scenes = [cast(PumpScene, lives.scene(knot)) for knot in _knots(lives)]
    found = [_joint_wear(scene, joint) for scene in scenes]
    shape = np.mean([wear.eye for wear in found], axis=0)
    radius = getattr(scenes[0].joint, joint).pin_diameter / 2
    gain = widening(shape, radius, _width(lives))
    return _linear_law(lives, [wear.power for wear in found], gain)


def _guide_law(lives: Lives) -> WearLaw:
    """Either face is lowered evenly; what both lose is the play."""
    scenes = [cast(PumpScene, lives.scene(knot)) for knot in _knots(lives)]
    guide = scenes[0].joint.guide
    assert guide is not None  # the severity is its clearance
    powers = [_joint_wear(scene, "guide").power for scene in scenes]
    return _linear_law(lives, powers, 1 / (guide.length * _width(lives)))


def _joint_wear(scene: PumpScene, joint: str) -> "JointWear":
    from ...sim.wear.rate import joint_wear  # kernels, which to read a recipe needs none of

    return joint_wear(scene, joint)


def _width(lives: Lives) -> float:
    assert lives.table.width is not None  # checked before
    return lives.table.width


def _linear_law(lives: Lives, powers: Sequence[float], gain: float) -> WearLaw:
    """Severity that grows by so much per volume [1/m^2]."""
    return WearLaw(
        volume=np.array([(knot - lives.low) / gain for knot in _knots(lives)]),
        power=np.array(powers),
        severity_of=lambda volume: lives.low + gain * volume,
        volume_of=lambda severity: (severity - lives.low) / gain,
    )


def _scar_law(lives: Lives) -> WearLaw:
    """A scar in the shape of the shaft's own circle, worn on the turning gear."""
    from ...sim.wear.rate import turning_wear  # kernels, which to read a recipe needs none of

    turning = lives.table.turning
    assert turning is not None  # checked before
    scenes = [cast(JournalScene, lives.scene(knot)) for knot in _knots(lives)]
    powers = [
        turning.share
        * turning_wear(scene, speed=turning.speed, least_film=turning.least_film).power
        for scene in scenes
    ]
    part = scenes[0].bearing
    size = {
        "clearance": part.clearance_radial,
        "radius": part.diameter / 2,
        "width": part.length,
    }
    return WearLaw(
        volume=np.array([dufrane_volume(knot, **size) for knot in _knots(lives)]),
        power=np.array(powers),
        severity_of=lambda volume: dufrane_depth(volume, **size),
        volume_of=lambda severity: dufrane_volume(severity, **size),
    )


_SCAR = "bearing.scar_depth"

_LAWS: dict[str, Callable[[Lives], WearLaw]] = {
    "joint.crankpin.diametral_clearance": partial(_pin_law, "crankpin"),
    "joint.wristpin.diametral_clearance": partial(_pin_law, "wristpin"),
    "joint.guide.diametral_clearance": _guide_law,
    _SCAR: _scar_law,
}
"""Severities whose wear is modelled. A new one is one row."""
