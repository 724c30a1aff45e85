"""Run to failure: every machine of a recipe over its life, recorded at intervals.

A recipe with a ``[life]`` table does not draw its first severity, which follows from the wear of
the machine. Its additional manifest columns are `LIFE_COLUMNS`.
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
"""Manifest columns of a life with their numpy types.

``remaining_life_h`` is the number of operating hours until the condemning limit is next reached,
including maintenance on the way: 0 at the limit and beyond it, NaN if the policy prevents reaching
it. ``life_share`` is the age of the surface over the age at which it is renewed, either planned or
after a failure. ``maintenance`` is the number of maintenance events so far, ``wear_rate_m2_per_n``
the machine's own wear rate. All of them reveal the severity or its future: they are labels, not
features.
"""

_HOUR = 3600.0  # s


class TurningGear(Part):
    """Turning gear, on which a journal bearing wears."""

    speed: RotationSpeed = Field(gt=0, le=10, description="a few revolutions per minute")
    share: Ratio = Field(gt=0, le=1, description="share of the operating time")
    least_film: Length = Field(gt=0, le=LONGEST, description="film at which asperities first touch")


class MaintenanceTable(Part):
    """Maintenance of the joint; give `every` or `at`."""

    restores: Ratio = Field(gt=0, le=1, description="share of the worn volume; 1 renews")
    every: Time | None = Field(default=None, gt=0, description="operating time between two events")
    at: Length | None = Field(default=None, gt=0, description="severity at which it is due")

    @model_validator(mode="after")
    def _one_occasion(self) -> Self:
        _ = self.rule
        return self

    @property
    def rule(self) -> Maintenance:
        """The rule for the life history."""
        return Maintenance(restores=self.restores, every=self.every, at=self.at)


class LifeTable(Part):
    """Ageing of the machines of a recipe.

    A new surface has the low bound of the first severity, or up to `as_new_most`; it fails at the
    high bound, where it is renewed.
    """

    spacing: Time = Field(gt=0, description="operating time between recordings")
    jitter: Ratio = Field(
        default=0.5, ge=0, le=1, description="random position of a recording, share of the spacing"
    )
    wear_rate: float = Field(
        ge=0, le=WEAR_RATE_MOST, description="m^2/N, median of the machines; 1 mm^3/(N m) is 1e-9"
    )
    spread: Ratio = Field(
        default=0.0, ge=0, le=3, description="normal deviation of its logarithm between machines"
    )
    as_new_most: Length | None = Field(
        default=None, gt=0, description="largest new clearance; by default the low bound"
    )
    running_in: Ratio = Field(
        default=0.0, ge=0, le=100, description="extra rate of a new surface, over the steady rate"
    )
    running_in_time: Time = Field(default=_HOUR, gt=0, description="time in which it falls to 1/e")
    knots: int = Field(default=6, ge=2, le=64, description="severities used to compute the rate")
    width: Length | None = Field(
        default=None, gt=0, le=LONGEST, description="length of a pin joint, or width of a guide"
    )
    turning: TurningGear | None = Field(default=None, description="for a journal bearing")
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
        Table of the scene that wears; all machines wear alike except for their wear rate.
    path : str
        Path of the severity.
    low, high : float
        Severity as new and at failure [m].
    limit : float
        Condemning limit [m].
    recordings : int
        Number of recordings per machine.
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
        """Wear law of the joint, from simulations at a few severities.

        Raises
        ------
        RecipeError
            If one of them failed, or nothing slides.
        """
        try:
            return _LAWS[self.path](self)
        except (ValueError, RuntimeError) as error:  # SceneError; SimulationError, BearingError
            raise RecipeError("life", [f"life: wear of {self.path}: {error}"]) from None

    def scene(self, severity: float) -> Scene:
        """The scene at a severity [m]."""
        return scene_from_table(override(self.base, {self.path: severity}))

    def history(self, rng: np.random.Generator) -> LifeHistory:
        """Life of the machine with a given random stream."""
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
            Random streams of machine and recording, freshly seeded.
        place : int
            Number of the recording in the machine's life, counted from 0.

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
    """Faults of a life with regard to the rest of its recipe.

    Parameters
    ----------
    table : LifeTable
    path : str
        Path of the first severity.
    low, high : float
        Its bounds [m].
    limit : float or None
        Condemning limit [m]; None if the scene has none.

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


# --- wear laws of the severities


def _knots(lives: Lives) -> list[float]:
    """Severities for the law, denser for a new joint: its film's load share varies most there."""
    return [float(knot) for knot in np.geomspace(lives.low, lives.high, lives.table.knots)]


def _pin_law(joint: str, lives: Lives) -> WearLaw:
    """Pin joint: the eye's scar keeps its mean shape; the clearance grows with the volume."""
    scenes = [cast(PumpScene, lives.scene(knot)) for knot in _knots(lives)]
    found = [_joint_wear(scene, joint) for scene in scenes]
    shape = np.mean([wear.eye for wear in found], axis=0)
    radius = getattr(scenes[0].joint, joint).pin_diameter / 2
    gain = widening(shape, radius, _width(lives))
    return _linear_law(lives, [wear.power for wear in found], gain)


def _guide_law(lives: Lives) -> WearLaw:
    """Guide: each face wears evenly; the clearance is the sum of both."""
    scenes = [cast(PumpScene, lives.scene(knot)) for knot in _knots(lives)]
    guide = scenes[0].joint.guide
    assert guide is not None  # the severity is its clearance
    powers = [_joint_wear(scene, "guide").power for scene in scenes]
    return _linear_law(lives, powers, 1 / (guide.length * _width(lives)))


def _joint_wear(scene: PumpScene, joint: str) -> "JointWear":
    from ...sim.wear.rate import joint_wear  # compiled kernels, not needed to read a recipe

    return joint_wear(scene, joint)


def _width(lives: Lives) -> float:
    assert lives.table.width is not None  # checked before
    return lives.table.width


def _linear_law(lives: Lives, powers: Sequence[float], gain: float) -> WearLaw:
    """Severity that grows in proportion to the worn volume [gain: 1/m^2]."""
    return WearLaw(
        volume=np.array([(knot - lives.low) / gain for knot in _knots(lives)]),
        power=np.array(powers),
        severity_of=lambda volume: lives.low + gain * volume,
        volume_of=lambda severity: (severity - lives.low) / gain,
    )


def _scar_law(lives: Lives) -> WearLaw:
    """Scar in the shape of the shaft's circle, worn on the turning gear."""
    from ...sim.wear.rate import turning_wear  # compiled kernels, not needed to read a recipe

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
"""Wear laws by severity. A new one is one row."""
