"""The casing on its mounts, as modes or as measured frequency response functions."""

import math
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from .dimensions import Frequency, Length, ModeShape, Ratio
from .limits import MODE_FASTEST, MODE_SLOWEST, MOST_MODES
from .part import FixedTable, Part

_DAMPED_MOST = 0.99  # of an underdamped mode


class CasingMode(Part):
    """One mode of the casing: mass-normalised shape at every force and sensor place."""

    frequency: Frequency = Field(
        ge=MODE_SLOWEST, le=MODE_FASTEST, description="undamped natural frequency"
    )
    damping_ratio: Ratio = Field(gt=0, lt=1, description="damping over critical damping")
    shape: Annotated[dict[str, ModeShape], AfterValidator(FixedTable)] = Field(
        min_length=1, description="place or sensor -> mass-normalised deflection"
    )
    foot_share: Ratio = Field(
        default=0.0, ge=0, le=1, description="share of its strain energy in the feet as tightened"
    )

    def on_feet(self, stiffness_ratio: float) -> tuple[float, float]:
        """Frequency [Hz] and damping ratio if the feet keep this share of their stiffness.

        By Rayleigh's quotient with the original shape: the stiffness of the mode falls by its
        share in the feet; mass and dashpots stay.
        """
        lower = math.sqrt(1 - self.foot_share * (1 - stiffness_ratio))
        return self.frequency * lower, min(self.damping_ratio / lower, _DAMPED_MOST)


class FrfFile(Part):
    """Measured accelerance of the casing, in a file; see :mod:`wearstate.sim.casing.casing_frf`.

    A relative file is searched first in ``folder``, which :func:`with_folder` sets to that of the
    scene file. It is excluded from the scene's dump, which must not contain a computer's paths.
    """

    file: str = Field(min_length=1, description="CSV or UFF58, accelerance in m/s^2/N")
    pairs: Annotated[dict[str, Annotated[str, Field(min_length=1)]], AfterValidator(FixedTable)] = (
        Field(default=FixedTable({}), description="sensor/place -> name in the file")
    )
    without: tuple[str, ...] = Field(
        default=(), description="places missing in the file, whose forces are ignored"
    )
    folder: str = Field(default="", exclude=True, description="folder searched first")


class Feet(Part):
    """Feet on anchor bolts, whose contact stiffness is proportional to the bolt force.

    The stiffness of rough surfaces in contact is proportional to the load (Greenwood, Williamson
    1966, doi:10.1098/rspa.1966.0242; Persson 2007, doi:10.1103/PhysRevLett.99.125502), and the load
    to the remaining stretch of the bolts. The contact is in series with the rest of the feet.
    """

    bolt_stretch: Length = Field(
        gt=0, le=0.1, description="stretch of the anchor bolts as tightened"
    )
    stretch_lost: Length = Field(
        default=0.0, ge=0, description="loss of stretch by settling and loosening"
    )
    contact_share: Ratio = Field(
        default=0.2,
        gt=0,
        lt=1,
        description="share of the new feet's flexibility that is in their contact",
    )

    @model_validator(mode="after")
    def _held(self) -> Self:
        if self.stretch_lost >= self.bolt_stretch:
            raise ValueError(
                f"stretch_lost = {self.stretch_lost:g} m must be < bolt_stretch = "
                f"{self.bolt_stretch:g} m; the model does not cover a loose foot, which "
                "rattles"
            )
        return self

    @property
    def stiffness_ratio(self) -> float:
        """Stiffness of the feet over that as tightened: 0 to 1 [-]."""
        left = 1 - self.stretch_lost / self.bolt_stretch
        return 1 / (1 - self.contact_share + self.contact_share / left)


class Casing(Part):
    """The pump casing on its mounts, as modes or as measured frequency response functions."""

    rung: Literal["driven", "yielding"] = Field(
        default="driven",
        description="driven: the crank's bearing is at rest; yielding: it moves with the casing",
    )
    feet: Feet | None = Field(default=None, description="feet that may work loose; none: tight")
    modes: tuple[CasingMode, ...] = Field(default=(), max_length=MOST_MODES)
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
                "bearing; set 'driven', or fit modes to the measurement"
            )
        if self.feet is not None and not any(mode.foot_share for mode in self.modes):
            raise ValueError(
                "feet needs modes of which one has foot_share > 0; the measurement of a "
                "casing includes its feet"
            )
        return self


def with_folder(table: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Scene table whose files are searched first in this folder, that of the scene file.

    Examples
    --------
    >>> with_folder({"casing": {"frf": {"file": "pump.csv"}}}, Path("scenes"))["casing"]["frf"]
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
    """Key for a force: ``place_throw`` if there is one, else ``place``, else None.

    Parameters
    ----------
    keys : container of str
        Keys of a mode shape, or places of a frequency response table.
    place : str
        Place of the force.
    throw : int
        Throw of the force, counted from 1.

    Examples
    --------
    >>> specific_key({"bearing_x", "bearing_x_2"}, "bearing_x", 2)
    'bearing_x_2'
    >>> specific_key({"bearing_x", "bearing_x_2"}, "bearing_x", 1)
    'bearing_x'
    """
    return next((key for key in (f"{place}_{throw}", place) if key in keys), None)
