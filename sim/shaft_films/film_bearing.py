"""A journal bearing on a shaft line, new or worn."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..bearing.operate import JournalBearing
from ..film.solve import worn_arc

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmBearing:
    """A journal bearing on a shaft line.

    Attributes
    ----------
    name : str
    station : float
        Position of the middle of its length, a node of the beam [m].
    bearing : JournalBearing
        Bearing as new.
    offset : float
        Height of the journal's centre when it lies at the bottom of the new bore, positive up
        [m].
    side_offset : float
        Position of the bore's centre along z [m].
    slope : tuple of float
        Slope of the bore, dy/dx and dz/dx [rad].
    wear_down : float
        Wear of the bottom of the bore, >= 0 [m].
    arc_clearance : float or None
        Clearance of the journal in the arc that it has worn, over the bore's as new, > 0. None: the
        bore stays a circle, whose diametral clearance grows by the wear-down and whose centre sinks
        by half of it.

    Raises
    ------
    ValueError
        A number is not finite, the wear-down is negative, or the arc's clearance is not positive.

    Examples
    --------
    >>> new = JournalBearing(diameter=0.4, length=0.8, clearance=0.4e-3, viscosity=0.1)
    >>> worn = FilmBearing(name="stern", station=1.0, bearing=new, wear_down=0.2e-3)
    >>> round(worn.worn.clearance * 1e3, 6), round(worn.centre[0] * 1e3, 6)
    (0.5, 0.3)
    """

    name: str
    station: float
    bearing: JournalBearing
    offset: float = 0.0
    side_offset: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)
    wear_down: float = 0.0
    arc_clearance: float | None = None

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        numbers = {
            "station": (self.station, "m"),
            "offset": (self.offset, "m"),
            "side_offset": (self.side_offset, "m"),
            "slope[0]": (self.slope[0], "rad"),
            "slope[1]": (self.slope[1], "rad"),
        }
        problems = [
            f"{self.name}.{name} = {value} {unit} must be finite"
            for name, (value, unit) in numbers.items()
            if not math.isfinite(value)
        ]
        if not 0 <= self.wear_down < math.inf:
            problems.append(f"{self.name}.wear_down = {self.wear_down} m must be >= 0 and finite")
        if self.arc_clearance is not None and not 0 < self.arc_clearance < math.inf:
            problems.append(
                f"{self.name}.arc_clearance = {self.arc_clearance} must be > 0 and finite"
            )
        if problems:
            raise ValueError("; ".join(problems))

    @property
    def worn(self) -> JournalBearing:
        """Bearing with its present bore; its profile and the feed pressure stay in SI."""
        if self.wear_down == 0:
            return self.bearing
        if self.arc_clearance is not None:
            return self._with_arc(self.arc_clearance)
        clearance = self.bearing.clearance + self.wear_down / 2
        film, grown = self.bearing.film, clearance / self.bearing.clearance
        if film is not None:
            bore = None if film.bore is None else np.asarray(film.bore) / grown
            grooves = tuple(replace(g, pressure=g.pressure * grown**2) for g in film.grooves)
            film = replace(film, bore=bore, grooves=grooves)
        return replace(self.bearing, clearance=clearance, film=film)

    def _with_arc(self, clearance: float) -> JournalBearing:
        film = self.bearing.geometry
        depth = self.wear_down / self.bearing.clearance
        arc = worn_arc(depth, clearance, 0.0, film.n_theta)  # the film's X axis points down
        bore = arc if film.bore is None else np.maximum(film.bore, arc)
        return replace(self.bearing, film=replace(film, bore=bore))

    @property
    def bottom(self) -> float:
        """Distance of the journal from the middle of the present bore down to its bottom [m]."""
        return self.bearing.clearance + self.wear_down - self.sunk

    @property
    def sunk(self) -> float:
        """Distance by which the middle of the bore is lower than as new [m]."""
        return 0.0 if self.arc_clearance is not None else self.wear_down / 2

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the bore, y and z [m]."""
        return self.offset + self.bearing.clearance - self.sunk, self.side_offset


def clearances_of(bearings: Sequence[FilmBearing]) -> Vector:
    """Radial clearances, as worn [m, shape=(n,)]."""
    return np.array([b.worn.clearance for b in bearings])
