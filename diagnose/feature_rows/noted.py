"""Operating conditions noted with a recording, as inputs of a model: vibration lacks them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Float = NDArray[np.float64]

_LEAST = 1e-9  # SI units, lower bound of a condition whose logarithm is used


@dataclass(frozen=True, kw_only=True)
class Noted:
    """A condition that can be noted.

    Attributes
    ----------
    unit : str
    doubt : float
        Standard uncertainty of noted values: over the value, or over the trained range if the value
        may be 0 or negative.
    log : bool
        Its effect depends on ratios: its logarithm is the input.
    setting : str
        How the user gives it.
    left_out : float, optional
        Value in a scene that only means that the number was not given.
    usual : float, optional
        Value used if it was not noted, as in half of the training records; None: it must be known.
    """

    unit: str
    doubt: float
    log: bool
    setting: str
    left_out: float | None = None
    usual: float | None = None


NOTED = {
    "discharge_pressure_pa": Noted(
        unit="Pa", doubt=0.02, log=True, setting='pressure.discharge="3 bar"'
    ),
    "suction_pressure_pa": Noted(
        unit="Pa",
        doubt=0.05,
        log=False,
        setting='pressure.suction="-0.3 bar"',
        usual=-0.03e6,
    ),
    "static_load_n": Noted(unit="N", doubt=0.03, log=True, setting='load.static="2 kN"'),
    "viscosity_pa_s": Noted(unit="Pa s", doubt=0.05, log=True, setting='oil.viscosity="30 mPa s"'),
    "hull_deflection_m": Noted(unit="m", doubt=0.05, log=False, setting='hull.deflection="0.2 mm"'),
    "thrust_n": Noted(unit="N", doubt=0.05, log=False, setting='propeller.thrust="700 kN"'),
    "film_warming_k": Noted(
        unit="K",
        doubt=0.07,
        log=False,
        setting='bearings.0.film_warming="8 K"',
        left_out=0.0,
        usual=4.0,
    ),
}
"""Manifest column -> condition. Pressure gauges are read to 2 %, the viscosity follows from the
oil's temperature within a kelvin, thrust from the shaft's torque. The film's warming needs a
bearing thermometer, which is rarely read, to a kelvin of 15: by default the film is 4 K warmer than
the noted oil, the average of the shaft's recipe. Few pumps have a gauge on their suction side: by
default they lift from 3 m below. It moves estimates by next to nothing, and must not keep them from
the discharge pressure, which lowers their error by a fourth."""

_UNNOTED = 0.5  # of the training records, where a condition need not be known


def noted_values(names: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> Float:
    """Conditions as inputs of a model.

    Parameters
    ----------
    names : sequence of str
        Keys of :data:`NOTED`.
    rows : sequence of mapping
        Conditions noted with each recording, in SI units.

    Returns
    -------
    numpy.ndarray [shape=(n_rows, n_names)]
        NaN, or the usual value, for conditions not noted.

    Examples
    --------
    >>> noted_values(["hull_deflection_m", "viscosity_pa_s"], [{"viscosity_pa_s": 1.0}])
    array([[nan,  0.]])
    """
    values = np.array([[_number(row.get(name)) for name in names] for row in rows], dtype=float)
    values = values.reshape(len(rows), len(names))
    for column, name in enumerate(names):
        if NOTED[name].log:
            values[:, column] = np.log(np.maximum(values[:, column], _LEAST))
        if (usual := NOTED[name].usual) is not None:
            values[np.isnan(values[:, column]), column] = usual
    return values


def given_of(names: Sequence[str], row: Mapping[str, Any]) -> tuple[str, ...]:
    """Conditions that were noted with a recording.

    Examples
    --------
    >>> given_of(["viscosity_pa_s", "film_warming_k"], {"viscosity_pa_s": 0.08})
    ('viscosity_pa_s',)
    """
    return tuple(name for name in names if np.isfinite(_number(row.get(name))))


def _number(value: Any) -> float:
    return float(value) if isinstance(value, float | int) else np.nan


def doubted(names: Sequence[str], values: Float, seed: int) -> Float:
    """Conditions as they would have been noted: with an error of their uncertainty, or missing.

    Parameters
    ----------
    names : sequence of str
    values : numpy.ndarray [shape=(n, n_names)]
        From :func:`noted_values`.
    seed : int

    Returns
    -------
    numpy.ndarray [shape=(n, n_names)]
        Conditions with a usual value have that value in half of the rows.
    """
    doubts = [
        NOTED[name].doubt * (1.0 if NOTED[name].log else np.ptp(values[:, i]))
        for i, name in enumerate(names)
    ]
    noted = np.asarray(values + np.random.default_rng(seed).normal(0, 1, values.shape) * doubts)
    unnoted = np.random.default_rng([seed, 1]).random(len(values)) < _UNNOTED
    for column, name in enumerate(names):
        if (usual := NOTED[name].usual) is not None:
            noted[unnoted, column] = usual
    return noted


def strayed(names: Sequence[str], values: Float, seed: int, reach: float) -> Float:
    """Conditions of machines for which they have another meaning: another oil, another load.

    Parameters
    ----------
    names : sequence of str
    values : numpy.ndarray [shape=(n, n_names)]
        Of :func:`noted_values`.
    seed : int
    reach : float
        Largest factor by which each is off; if it may be 0, as large a share of its range.

    Returns
    -------
    numpy.ndarray [shape=(n, n_names)]
    """
    ends = [
        np.log(reach) if NOTED[name].log else (reach - 1) * np.ptp(values[:, i])
        for i, name in enumerate(names)
    ]
    return np.asarray(values + np.random.default_rng(seed).uniform(-1, 1, values.shape) * ends)


def noted_ranges(manifest: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of each condition that can be an input of a model.

    Parameters
    ----------
    manifest : pandas.DataFrame

    Returns
    -------
    dict
        Conditions that vary and are noted in all records, or have a usual value for the others.

    Examples
    --------
    >>> table = pd.DataFrame({"thrust_n": [1.0, 2.0], "viscosity_pa_s": [0.02, np.nan]})
    >>> noted_ranges(table)
    {'thrust_n': (1.0, 2.0)}
    """
    found = {}
    for name, values in _noted_columns(manifest).items():
        known = values[np.isfinite(values)]
        enough = len(known) == len(values) or (NOTED[name].usual is not None and len(known))
        if enough and np.ptp(known) > 0:
            found[name] = (float(known.min()), float(known.max()))
    return found


def partly_noted(manifest: pd.DataFrame) -> list[str]:
    """Sentences on conditions that are no inputs of a model because some records lack them.

    Examples
    --------
    >>> partly_noted(pd.DataFrame({"viscosity_pa_s": [0.02, 0.03, np.nan]}))
    ['viscosity_pa_s is known in 2 of 3 records, must be in all to be an input of the model']
    """
    return [
        f"{name} is known in {len(known)} of {len(values)} records, must be in all to be an input "
        "of the model"
        for name, values in _noted_columns(manifest).items()
        if 0 < len(known := values[np.isfinite(values)]) < len(values)
        if NOTED[name].usual is None and np.ptp(known) > 0
    ]


def _noted_columns(manifest: pd.DataFrame) -> dict[str, Float]:
    return {name: manifest[name].to_numpy(dtype=float) for name in NOTED if name in manifest}


def notes_of(manifest: pd.DataFrame) -> list[dict[str, Any]]:
    """Manifest values of each record, by name."""
    rows = manifest.to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in rows]
