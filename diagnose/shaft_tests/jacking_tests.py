"""Measured jacking curves of a shaft line: reactions with errors, and a check of the line."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...sim.alignment.alignment import influence
from ...sim.alignment.jacking import Jacking, jacking
from ...sim.alignment.jacking_curve import CurveError, CurveFit, fit_curve
from ...sim.alignment.seats import AlignmentError
from ...sim.output.recording import DataError
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.line_alignment import alignment_conditions, alignment_line
from .next_test import JACKING_ERROR
from .sag_model import MeasuredReactions, SagError

_BOTH_WAYS = 0.02
"""Error of a reaction from a curve of lifting and lowering, over the reaction and in addition to
its scatter [-]: pressure gauge and piston area to 1 %, correction factor, friction that differs
between both directions (estimate)."""

_OTHER_SLOPE = 0.1  # of the model's slope: a larger deviation means that the line differs
_SURE = 3.0  # standard deviations of the slope
_UNITS = {"lift": (("m", 1.0), ("mm", 1e-3)), "load": (("n", 1.0), ("kn", 1e3))}


@dataclass(frozen=True, kw_only=True)
class JackedBearing:
    """Result of one measured curve.

    Attributes
    ----------
    bearing : str
    fit : CurveFit
    factor : float
        Reaction over the load of the second straight part at zero lift, from the scene [-].
    reaction, deviation : float
        [N]
    influence, expected_influence : float
        Own influence number of the bearing, i.e. decrease of its reaction per own lowering, from
        the slope of the curve and from the scene [N/m].
    warnings : tuple of str
    """

    bearing: str
    fit: CurveFit
    factor: float
    reaction: float
    deviation: float
    influence: float
    expected_influence: float
    warnings: tuple[str, ...]

    @property
    def text(self) -> str:
        """Result in one line."""
        result = (
            f"jack beside {self.bearing}: reaction {1e-3 * self.reaction:.4g} ± "
            f"{1e-3 * self.deviation:.2g} kN, free at {1e3 * self.fit.free_lift:.3g} mm, own "
            f"influence number {1e-6 * self.influence:.4g} kN/mm (line: "
            f"{1e-6 * self.expected_influence:.4g})"
        )
        return "; ".join([result, *self.warnings])

    def as_dict(self) -> dict[str, Any]:
        """Result in SI, for JSON."""
        return {
            "bearing": self.bearing,
            "reaction_n": self.reaction,
            "deviation_n": self.deviation,
            "free_lift_m": self.fit.free_lift,
            "friction_n": self.fit.friction,
            "influence_n_per_m": self.influence,
            "expected_influence_n_per_m": self.expected_influence,
            "warnings": list(self.warnings),
        }


def read_curves(
    path: str | Path, scene: ShaftScene, *, condition: str = "cold"
) -> tuple[JackedBearing, ...]:
    """Read measured jacking curves from a table and evaluate the reactions.

    Parameters
    ----------
    path : str or Path
        CSV, one row per reading in order: ``bearing``, ``lift_mm`` or ``lift_m``, ``load_kn`` or
        ``load_n``; ``station_m`` of the jack if it is not next to the bearing.
    scene : ShaftScene
        The line as aligned; its shaft determines the correction factor.
    condition : str
        Condition of the scene during the measurement.

    Returns
    -------
    tuple of JackedBearing
        In the order of the file.

    Raises
    ------
    DataError
        The file cannot be read, a column, number or bearing is invalid, or a curve does not show
        the bearing coming free; all faults at once.
    SagError
        The condition is unknown.
    """
    curves = _curves(Path(path), [bearing.name for bearing in scene.bearings])
    faults, found = [], []
    for name, rows in curves.items():
        try:
            found.append(_jacked(scene, name, np.array(rows), condition))
        except (CurveError, AlignmentError) as error:
            faults.append(f"{path}: bearing '{name}': {error}")
    if faults:
        raise DataError("\n".join(faults))
    return tuple(found)


def measured_curves(found: tuple[JackedBearing, ...], condition: str) -> MeasuredReactions:
    """Reactions from the curves, as input of the posterior of sags."""
    return MeasuredReactions(
        reactions={one.bearing: one.reaction for one in found},
        deviations={one.bearing: one.deviation for one in found},
        condition=condition,
    )


def _jacked(
    scene: ShaftScene, name: str, rows: np.ndarray[Any, np.dtype[np.float64]], condition: str
) -> JackedBearing:
    conditions = alignment_conditions(scene)
    if condition not in conditions:
        raise SagError(f"condition = '{condition}' must be one of {', '.join(conditions)}")
    line = alignment_line(scene)
    station = rows[0, 2]
    model = jacking(
        line, name, conditions[condition], station=None if math.isnan(station) else float(station)
    )
    fit = fit_curve(rows[:, 0], rows[:, 1])
    own = float(-influence(line)[line.seat(name), line.seat(name)])
    reaction = model.correction_factor * fit.zero_load
    share = JACKING_ERROR if fit.friction is None else _BOTH_WAYS
    return JackedBearing(
        bearing=name,
        fit=fit,
        factor=model.correction_factor,
        reaction=reaction,
        deviation=math.hypot(
            model.correction_factor * fit.zero_load_deviation, share * abs(reaction)
        ),
        influence=abs(own) * fit.slope / model.second_slope,
        expected_influence=abs(own),
        warnings=tuple(_warnings(fit, model)),
    )


def _warnings(fit: CurveFit, model: Jacking) -> list[str]:
    off = fit.slope - model.second_slope
    found = []
    if abs(off) > max(_OTHER_SLOPE * model.second_slope, _SURE * fit.slope_deviation):
        found.append(
            f"slope with the bearing free {1e-6 * fit.slope:.4g} kN/mm must be "
            f"{1e-6 * model.second_slope:.4g} by the line as described: check shaft and stations, "
            "or whether another bearing lifted"
        )
    if fit.friction is None:
        found.append("read while lifting only: read while lowering too, to eliminate friction")
    return found


# --- the file


def _curves(path: Path, names: list[str]) -> dict[str, list[tuple[float, float, float]]]:
    """Lift [m], load [N] and station [m] (NaN: next to the bearing) of each reading."""
    try:
        rows = list(csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path} cannot be read: {error}") from None
    columns = set(rows[0]) if rows else set()
    lacking = [
        f"{quantity}_{units[1][0]} or {quantity}_{units[0][0]}"
        for quantity, units in _UNITS.items()
        if not columns & {f"{quantity}_{unit}" for unit, _ in units}
    ]
    lacking += [] if "bearing" in columns else ["bearing"]
    if lacking:
        raise DataError(f"{path}: columns {', '.join(lacking)} are missing; add them")
    faults: list[str] = []
    found: dict[str, list[tuple[float, float, float]]] = {}
    for number, row in enumerate(rows, start=2):
        name = (row["bearing"] or "").strip()
        if name not in names:
            faults.append(
                f"{path} line {number}: bearing '{name}' must be one of {', '.join(names)}"
            )
            continue
        lift, load = (_number(row, key, f"{path} line {number}", faults) for key in _UNITS)
        station = _value(row.get("station_m") or "nan")
        found.setdefault(name, []).append((lift, load, station))
    if faults:
        raise DataError("\n".join(faults))
    return found


def _number(row: dict[str, str], key: str, where: str, faults: list[str]) -> float:
    for unit, factor in _UNITS[key]:
        text = (row.get(f"{key}_{unit}") or "").strip()
        if text:
            value = factor * _value(text)
            if not 0 <= value < math.inf:
                faults.append(f"{where}: {key}_{unit} = '{text}' must be a number >= 0")
            return value
    faults.append(f"{where}: {key} is missing; give it, or remove the line")
    return math.nan


def _value(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
