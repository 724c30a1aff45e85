"""Wear-down of a shaft's bearing from the journal position, by inverting alignment and films.

A worn bearing lets its journal sink; its height also depends on the film and on the load from the
line. Beam and films are solved together for several wear-downs, each also with slightly higher
viscosity and clearance. This gives the readings of the probes as functions of the uncertain
numbers, which are fitted by least squares as for a single journal.

The shape of the worn bore is unknown: still a circle, or with an arc, and with or without grooves.
All are considered, weighted by how well they explain the readings.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from .clearance import (
    CONTRADICTED,
    CORRECTED,
    DOUBTS,
    FLOOR,
    NORMAL,
    OR_HEALTHY,
    Doubts,
    Explained,
    FilmEstimate,
    fitted,
    mixed_by_evidence,
)

if TYPE_CHECKING:
    from ...sim.scene.shaft import ShaftScene
    from ...sim.scene.shaft_parts import ShaftBearing

Float = NDArray[np.float64]

_SHARES = (0.0, 0.25, 0.6, 1.0, 1.5)  # of the condemning wear-down: solved cases
_HEALTHY = (0.0, 0.1, 0.25)  # the same, for a healthy bearing
_ARCS = (0.25, 0.5, 0.9)  # clearance in a worn arc over that of the bore
_GROOVES = (math.radians(14.0), math.radians(32.0))  # widths at the sides, the same
_CHANGE = 0.05  # of viscosity and clearance, for their slopes
_BUILT = 0.09  # of a clearance as new: makers' tolerance 15 %, uniformly distributed
_LOOSEST = 0.3  # largest standard error over the condemning wear-down for an estimate
_BEYOND = 1.5  # of the condemning wear-down: largest solved case


@dataclass(frozen=True, kw_only=True)
class SinkingRun:
    """One recording of a journal in a bearing that wears down.

    Attributes
    ----------
    readings : numpy.ndarray [shape=(n_probes,)]
        Mean motion towards each probe, zero at the centre of the bore as new [m].
    places : tuple of CubicSpline or None
        For each bore of :func:`possible_bores`: wear-down [m] -> height and side of the journal
        [m], their derivatives with respect to the logarithms of viscosity and clearance as new.
        None for a bore without an equilibrium.
    likely : tuple of float
        Prior probability of each bore.
    swing : float
        rms of the motion about the mean [m].
    clearance : float
        Radial clearance as new [m].
    measured : float or None
        Wear-down measured at the time of a healthy recording [m].
    """

    readings: Float
    places: tuple[CubicSpline | None, ...]
    likely: tuple[float, ...]
    swing: float
    clearance: float
    measured: float | None = None


def possible_bores(bearing: "ShaftBearing") -> tuple[tuple[float, dict[str, Any]], ...]:
    """Possible bores of a worn bearing: that of the scene, and others if it defines none.

    Parameters
    ----------
    bearing : ShaftBearing

    Returns
    -------
    tuple of (float, dict)
        Prior probability, and changed fields of the bearing, empty in the first. An arc is as
        likely as a circle, grooves are as likely as none.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> bearing = load_scene("propulsion-shaft").bearings[0]
    >>> len(possible_bores(bearing)), possible_bores(bearing)[0]
    (12, (0.25, {}))
    """
    shapes: list[dict[str, Any]] = []
    if bearing.worn_shape == "circle":
        shapes = [{"worn_shape": "arc", "arc_clearance": own} for own in _ARCS]
    grooves: list[dict[str, Any]] = []
    if bearing.groove_width == 0:
        grooves = [{"groove_width": width} for width in _GROOVES]
    return tuple(
        (a * b, {**groove, **shape}) for a, groove in _even(grooves) for b, shape in _even(shapes)
    )


def _even(others: Sequence[dict[str, Any]]) -> list[tuple[float, dict[str, Any]]]:
    """The case of the scene with half of the probability, and the others."""
    if not others:
        return [(1.0, {})]
    return [(0.5, {}), *((0.5 / len(others), other) for other in others)]


def sinking_places(
    scene: "ShaftScene", bearing: int, limit: float, *, healthy: bool = False
) -> tuple[CubicSpline | None, ...] | str:
    """Position of a journal as a function of the wear-down of its bearing.

    Parameters
    ----------
    scene : ShaftScene
        Scene with the conditions of the day.
    bearing : int
        Number of the bearing, from aft.
    limit : float
        Condemning wear-down [m].
    healthy : bool
        Only for a bearing with little wear.

    Returns
    -------
    tuple of (CubicSpline or None), or str
        As in :class:`SinkingRun`; or why the line of the scene has no equilibrium.

    Notes
    -----
    Viscosity and clearance as new are assumed to have the same effect in every bore.
    """
    from ...sim.shaft_films.status import ShaftFilmError

    shares = _HEALTHY if healthy else _SHARES
    wears = [share * limit for share in shares]
    try:
        plain, thick, wide = (
            _ways(changed, bearing, wears)
            for changed in (scene, _thicker(scene), _wider(scene, bearing))
        )
    except ShaftFilmError as error:
        return str(error)
    step = math.log1p(_CHANGE)
    slopes = [(thick - plain) / step, (wide - plain) / step]

    def of(bore: Mapping[str, Any]) -> CubicSpline | None:
        try:
            own = _ways(_with_bearing(scene, bearing, bore), bearing, wears) if bore else plain
        except ShaftFilmError:
            return None
        return CubicSpline(wears, np.hstack([own, *slopes]))

    return tuple(of(bore) for _, bore in possible_bores(scene.bearings[bearing]))


def _ways(scene: "ShaftScene", bearing: int, wears: Sequence[float]) -> Float:
    """Heights and sides relative to the centre of the bore as new [m, shape=(n_wears, 2)]."""
    from ...sim.shaft.at_rest import film_bearings
    from ...sim.shaft.line_beam import running_beam
    from ...sim.shaft_films.on_oil_films import beam_film

    beam, places = running_beam(scene), []
    for wear in wears:
        worn = _with_bearing(scene, bearing, {"wear_down": wear})
        found = beam_film(
            beam,
            film_bearings(worn),
            math.tau * worn.drive.speed,
            rung=worn.film.rung,
            pedestals=[(b.housing.stiffness_up, b.housing.stiffness_side) for b in worn.bearings],
        )
        up, side = found.positions[bearing]
        places.append([up - found.bearings[bearing].sunk, side])
    return np.array(places)


def _with_bearing(scene: Any, bearing: int, changes: Mapping[str, float]) -> Any:
    bearings = list(scene.bearings)
    bearings[bearing] = bearings[bearing].model_copy(update=dict(changes))
    return scene.model_copy(update={"bearings": tuple(bearings)})


def _thicker(scene: Any) -> Any:
    return scene.model_copy(update={"oil": scene.oil.thickened(1 + _CHANGE)})


def _wider(scene: Any, bearing: int) -> Any:
    built = scene.bearings[bearing].diametral_clearance
    return _with_bearing(scene, bearing, {"diametral_clearance": built * (1 + _CHANGE)})


def film_wear_down(
    run: SinkingRun,
    angles: Sequence[float],
    limit: float,
    as_new: float,
    doubts: Doubts,
    *,
    healthy: Sequence[SinkingRun] = (),
) -> FilmEstimate:
    """Wear-down that explains the measured journal position.

    Parameters
    ----------
    run : SinkingRun
    angles : sequence of float
        Angles of the probes, from straight down in the direction of rotation [rad].
    limit, as_new : float
        Condemning wear-down, and wear-down after running in [m].
    doubts : Doubts
    healthy : sequence of SinkingRun
        Recordings of the same machine, with a measured wear-down, or that of a new bearing.

    Returns
    -------
    FilmEstimate

    Notes
    -----
    As :func:`.film_clearance.clearance.film_clearance`, but linear in viscosity and clearance.
    Loads follow from the nameplate and from the day's thrust and hull; sags of other bearings are
    not estimated. The bores of :func:`possible_bores` are mixed by their evidence.
    """
    problem = _Problem([run, *healthy], np.asarray(angles), limit, as_new, doubts)
    found = problem.explained()
    wear, error = found.value, found.error
    if not found.left <= CONTRADICTED:
        return FilmEstimate(
            healthy=len(healthy),
            reason=f"no wear-down explains the journal position: {found.left:.1f} "
            f"standard deviations remain, must be <= {CONTRADICTED:g}; check thrust, hull, oil "
            f"and the probes{'' if healthy else OR_HEALTHY}",
        )
    if error > _LOOSEST * limit or wear > _BEYOND * limit:
        return FilmEstimate(
            healthy=len(healthy),
            reason=f"the wear-down would be {1e3 * wear:.2f} mm with a standard error of "
            f"{1e3 * error:.2f} mm, must be <= {1e3 * _BEYOND * limit:.2f} and "
            f"{1e3 * _LOOSEST * limit:.2f} mm; give healthy recordings of the machine (--baseline)",
        )
    return FilmEstimate(
        severity=max(wear, 0.0),
        low=max(wear - NORMAL * error, 0.0),
        high=max(wear + NORMAL * error, 0.0),
        healthy=len(healthy),
        budget={name: NORMAL * part for name, part in found.budget.items()},
    )


class _Problem:
    """Readings and prior knowledge as residuals in standard deviations."""

    def __init__(
        self,
        runs: Sequence[SinkingRun],
        angles: Float,
        limit: float,
        as_new: float,
        doubts: Doubts,
    ) -> None:
        n, probes = len(runs), len(angles)
        self.runs, self.n, self.probes = runs, n, probes
        self.readings = np.array([run.readings for run in runs])
        # heights and sides refer to the shaft line, probe angles to straight down
        self.looks = -np.stack([np.cos(angles), np.sin(angles)])
        measured = [run.measured for run in runs[1:] if run.measured is not None]
        known = len(measured) == n - 1 > 0
        self.middles = np.array([limit / 2, *(measured if known else [as_new] * (n - 1))])
        offset = doubts.offset * (CORRECTED if n > 1 else 1)
        # half of the variance of wear as new and of the oil is specific to the day
        day = math.sqrt(0.5)
        new = day * (doubts.clearance if known else as_new)
        self.prior = np.array(
            [
                2 * limit,
                _BUILT,
                *[offset] * probes,
                *[doubts.gain] * probes,
                *[new] * n,
                *[day * doubts.viscosity] * (1 + n),
            ]
        )
        self.names = [
            *["", "clearance", *["offset"] * probes, *["gain"] * probes],
            *["clearance"] * n,
            *["viscosity"] * (1 + n),
        ]
        self.scatter = np.array([math.hypot(FLOOR, run.swing**2 / run.clearance) for run in runs])

    def explained(self) -> Explained:
        """Mixture of all bores with an equilibrium in every run.

        Without healthy runs a bore of another shape could explain an offset of the probes: the
        scene's own bore must then explain the readings.
        """
        each, costs, likely = [], [], []
        for bore, before in enumerate(self.runs[0].likely):
            ways = [run.places[bore] for run in self.runs]
            if None not in ways:
                found, cost = self._by(ways)
                each.append(found)
                costs.append(cost)
                likely.append(before)
        found, _ = mixed_by_evidence(each, costs, likely)
        return found._replace(left=each[0].left) if self.n == 1 else found

    def _by(self, ways: Sequence[Any]) -> tuple[Explained, float]:
        residuals = partial(self.residuals, ways)
        found = fitted(residuals, np.zeros(len(self.prior)), self.readings.size)
        unit = float(self.prior[0])
        explained = Explained(
            value=self.middles[0] + float(found.values[0]) * unit,
            error=found.error * unit,
            budget={
                name: unit * found.worth(self.names, name)
                for name in DOUBTS
                if name != "load"  # loads of a line follow from masses, thrust and hull
            },
            left=found.left,
        )
        return explained, found.cost

    def predicted(self, ways: Sequence[Any], free: Float) -> Float:
        """Readings [shape=(..., n, n_probes)] for deviations from the input, in uncertainties."""
        real = free * self.prior
        probes, n = self.probes, self.n
        offsets, gains, new, oils = np.split(real[..., 2:], np.cumsum([probes, probes, n]), axis=-1)
        deviation = np.concatenate([real[..., :1], new[..., :1] + new[..., 1:]], axis=-1)
        wear = self.middles + deviation
        found = np.stack([way(wear[..., i]) for i, way in enumerate(ways)], axis=-2)
        oil = (oils[..., :1] + oils[..., 1:])[..., None]
        place = found[..., :2] + found[..., 2:4] * oil + found[..., 4:] * real[..., 1:2, None]
        read = place @ self.looks + offsets[..., None, :]
        return np.asarray(read * np.exp(gains)[..., None, :])

    def residuals(self, ways: Sequence[Any], free: Float) -> Float:
        """Residuals of readings, then of the prior, in standard deviations."""
        misfit = (self.predicted(ways, free) - self.readings) / self.scatter[:, None]
        return np.concatenate([misfit.reshape(*free.shape[:-1], -1), free], axis=-1)
