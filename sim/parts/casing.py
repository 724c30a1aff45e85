"""The casing on its mounts: as modes, or as measured frequency response functions."""

import math
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from .dimensions import Frequency, Length, ModeShape, Ratio
from .limits import MODE_FASTEST, MODE_SLOWEST, MOST_MODES
from .part import FixedTable, Part

_DAMPED_MOST = 0.99  # of a mode that swings still


class CasingMode(Part):
    """One mode of the casing: mass-normalised shape at every force and sensor place."""

    frequency: Frequency = Field(ge=MODE_SLOWEST, le=MODE_FASTEST, description="natural, undamped")
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
