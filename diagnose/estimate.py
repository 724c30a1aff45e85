"""The wear model: what it says of a recording."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..datasets.record import Recording
from .grades import GRADE_NAMES, grades_of
from .novelty import Familiarity, novelty_p_value
from .tabulate import recording_features

Float = NDArray[np.float64]

SIMULATION_NOTICE = "trained on simulation; no measured joint of known clearance has confirmed it"

COVERAGE = 0.9
"""Nominal coverage of the interval."""

UNFAMILIAR_SHARE = 0.01
"""Share of familiar recordings that may be called unfamiliar, where the calibration is large
enough to tell so small a share; else one in its number."""

_FEWEST_NEIGHBOURS = 40  # out-of-fold errors that decide an interval: its level moves by 2.5 %
_RATE_TOLERANCE = 1e-3  # of the sample rate; band edges move as much


class ModelError(ValueError):
    """A model file cannot be used; names what is wrong and what helps."""


@dataclass(frozen=True, kw_only=True)
class LinearSeverity:
    """Log severity as a linear function of the features.

    Attributes
    ----------
    centre, spread, weight : numpy.ndarray [shape=(n_features,)]
        ``log severity = offset + sum(weight * (feature - centre) / spread)``
    offset : float
        Log of the severity in metres at the centre.
    """

    centre: Float
    spread: Float
    weight: Float
    offset: float

    def predict(self, features: Float) -> Float:
        """Log severity [shape=(n_recordings,)] of feature rows [shape=(n_recordings, n)]."""
        standard = (features - self.centre) / self.spread
        return np.asarray(standard @ self.weight + self.offset)


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Out-of-fold behaviour of a model on machine draws it had not seen.

    Attributes
    ----------
    log_estimate, log_error : numpy.ndarray [shape=(n,)]
        Estimates of log severity, and truth minus estimate.
    distance : numpy.ndarray [shape=(n,)]
        Novelty distances.
    """

    log_estimate: Float
    log_error: Float
    distance: Float


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """What a model says of one recording.

    Attributes
    ----------
    verdict : {"graded", "unfamiliar"}
        Unfamiliar: no grade is given.
    reasons : tuple of str
        Why it is unfamiliar; empty where graded.
    cautions : tuple of str
        Conditions outside the trained range.
    p_value : float or None
        Of the hypothesis that the recording is of the trained kind; None where it could not even
        be turned into the model's features.
    p_limit : float or None
        At or below it a recording is called unfamiliar.
    grade : int or None
        0 to 3.
    grade_name : str
        In words; empty where unfamiliar.
    possible_grades : tuple of int
        Grades that the interval touches.
    severity, low, high : float or None
        Estimate and interval [m].
    coverage : float
        Nominal coverage of the interval.
    evidence : tuple of (str, float, float, float)
        Feature, its value, mean of as-new machines, distance in their standard deviations; the
        features that moved the most.
    """

    verdict: Literal["graded", "unfamiliar"]
    reasons: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    p_value: float | None = None
    p_limit: float | None = None
    grade: int | None = None
    grade_name: str = ""
    possible_grades: tuple[int, ...] = ()
    severity: float | None = None
    low: float | None = None
    high: float | None = None
    coverage: float = COVERAGE
    evidence: tuple[tuple[str, float, float, float], ...] = field(default=())

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class WearModel:
    """A trained wear model.

    Attributes
    ----------
    regressor : LinearSeverity
        Features to log severity.
    calibration : Calibration
        Out-of-fold errors and distances.
    familiarity : Familiarity
        The cloud of the training features.
    card : dict
        What it was trained on, its inputs, limits and ranges.
    """

    regressor: LinearSeverity
    calibration: Calibration
    familiarity: Familiarity
    card: dict[str, Any]

    @property
    def notice(self) -> str:
        """What every report of this model must say; from its origin, not from a text in a file."""
        return SIMULATION_NOTICE if self.card["origin"] == "simulated" else ""

    @property
    def p_limit(self) -> float:
        """A recording with this p-value or a smaller one is called unfamiliar."""
        return max(UNFAMILIAR_SHARE, 1 / (len(self.calibration.distance) + 1))

    def estimate(self, recording: Recording) -> Estimate:
        """Estimate the wear of the machine in a recording.

        Parameters
        ----------
        recording : Recording
            Any; one that lacks the model's inputs is unfamiliar, with the reasons.

        Returns
        -------
        Estimate
            Grade and severity with interval, or unfamiliar.

        Raises
        ------
        DataError
            The signal itself is unusable: not finite, or shorter than a revolution.
        """
        missing = input_faults(recording, self.card)
        if missing:
            return Estimate(verdict="unfamiliar", reasons=tuple(missing))
        names, values = recording_features(recording)
        if list(names) != self.card["features"]:
            raise ModelError(
                f"the model's {len(self.card['features'])} features are not the program's "
                f"{len(names)}; retrain it: wearstate train DATA -o MODEL"
            )
        return self.judge(values)

    def judge(self, values: Float) -> Estimate:
        """Estimate from a feature row in the order of ``card["features"]``."""
        row = values[None, :]
        distance = float(self.familiarity.distance(row)[0])
        p_value = novelty_p_value(distance, self.calibration.distance)
        if p_value <= self.p_limit:
            reason = _strangeness(distance, self.calibration.distance)
            return Estimate(
                verdict="unfamiliar", reasons=(reason,), p_value=p_value, p_limit=self.p_limit
            )
        log_severity = float(self.regressor.predict(row)[0])
        below, above, coverage = interval_offsets(log_severity, self.calibration)
        low, high = math.exp(log_severity + below), math.exp(log_severity + above)
        edges = self.card["grade_edges_m"]
        severity = math.exp(log_severity)
        grade = int(grades_of(severity, edges))
        span = range(int(grades_of(low, edges)), int(grades_of(high, edges)) + 1)
        return Estimate(
            verdict="graded",
            cautions=(*self._range_cautions(severity), *self._condition_cautions(values)),
            p_value=p_value,
            p_limit=self.p_limit,
            grade=grade,
            grade_name=GRADE_NAMES[grade],
            possible_grades=tuple(span),
            severity=severity,
            low=low,
            high=high,
            coverage=coverage,
            evidence=self._evidence(values),
        )

    def _range_cautions(self, severity: float) -> list[str]:
        """Beyond the trained severities an estimate is a bound, and a poor one."""
        low, high = self.card["severity_range_m"]
        if low <= severity <= high:
            return []
        side, edge = ("more", high) if severity > high else ("less", low)
        return [
            f"the estimate {1e3 * severity:.3g} mm is outside the trained range {1e3 * low:.3g} to "
            f"{1e3 * high:.3g} mm: read it, and its interval, as '{side} than {1e3 * edge:.3g} mm'"
        ]

    def _condition_cautions(self, values: Float) -> list[str]:
        columns = {name: i for i, name in enumerate(self.card["features"])}
        return [
            f"{name} = {values[columns[name]]:.3g} is outside the trained range "
            f"{low:.3g} to {high:.3g}: extrapolating"
            for name, (low, high) in self.card["condition_ranges"].items()
            if not low <= values[columns[name]] <= high
        ]

    def _evidence(
        self, values: Float, most: int = 12
    ) -> tuple[tuple[str, float, float, float], ...]:
        """Features farthest from those of as-new machines."""
        healthy = self.card["healthy_features"]
        mean, spread = np.array(healthy["mean"]), np.array(healthy["spread"])
        moved = np.where(spread > 0, (values - mean) / np.where(spread > 0, spread, 1), 0.0)
        order = np.argsort(-np.abs(moved))[:most]
        names = self.card["features"]
        return tuple((names[i], float(values[i]), float(mean[i]), float(moved[i])) for i in order)


def _strangeness(distance: float, calibration: Float) -> str:
    """How far a recording lies from the training recordings, in words."""
    n, farther = len(calibration), int(np.count_nonzero(calibration >= distance))
    rank = f"{farther} of {n}" if farther else f"none of {n}"
    return (
        f"its features lie {distance:.3g} from the centre of the training recordings; {rank} "
        f"calibration recordings lie as far (median {np.median(calibration):.3g}, largest "
        f"{calibration.max():.3g})"
    )


def interval_offsets(log_estimate: float, calibration: Calibration) -> tuple[float, float, float]:
    """Offsets of log severity that bracket the truth, and with which coverage.

    Parameters
    ----------
    log_estimate : float
        Estimate in question.
    calibration : Calibration
        Out-of-fold estimates and errors.

    Returns
    -------
    low, high : float
        From the conformal quantiles of the errors of the nearest estimates, one tail each.
    coverage : float
        :data:`COVERAGE`, or the ``(n - 1) / (n + 1)`` that lies between the extremes of n errors
        where n is too small for it.

    Notes
    -----
    Nominal as far as errors of unseen draws near the same estimate are exchangeable with the new
    one. Two records share a machine, and the neighbourhood has a width, so it is approximate; the
    fits behind the errors lack a fifth of the draws, which makes the interval slightly wide.
    """
    gap = np.abs(calibration.log_estimate - log_estimate)
    n = min(len(gap), max(_FEWEST_NEIGHBOURS, len(gap) // 4))
    errors = np.sort(calibration.log_error[np.argsort(gap, kind="stable")[:n]])
    rank = min(math.ceil((1 + COVERAGE) / 2 * (n + 1)), n)
    return float(errors[n - rank]), float(errors[rank - 1]), min(COVERAGE, (n - 1) / (n + 1))


def input_faults(recording: Recording, card: Mapping[str, Any]) -> list[str]:
    """What a recording lacks of a model's inputs, as sentences; empty where it fits."""
    wanted = [c for c in card["channels"] if c["name"] != card["tacho"]]
    units = [c["unit"] for c in wanted]
    found = recording.vibration_channels
    faults = []
    if len(found) != len(wanted):
        faults.append(
            f"it has {len(found)} vibration channel(s), the model needs {len(wanted)}: "
            f"{', '.join(c['name'] for c in wanted)}"
        )
    elif [c.name for c in found] != [c["name"] for c in wanted]:
        faults.append(
            f"its channels are {', '.join(c.name for c in found)}, the model needs "
            f"{', '.join(c['name'] for c in wanted)}, in this order"
        )
    faults += [
        f"channel {c.name} is in {c.unit or 'an unknown unit'}, the model needs {units[0]}"
        for c in found
        if c.unit not in units
    ]
    if (recording.tacho is None) != (card["tacho"] is None):
        faults.append("it has no tacho, the model needs one" if card["tacho"] else "it has a tacho")
    elif recording.pulses_per_revolution != card["pulses_per_revolution"]:
        faults.append(
            f"its tacho gives {recording.pulses_per_revolution} pulses per revolution, the model "
            f"needs {card['pulses_per_revolution']}"
        )
    rate = card["sample_rate_hz"]
    if abs(recording.sample_rate / rate - 1) > _RATE_TOLERANCE:
        faults.append(
            f"it is sampled at {recording.sample_rate:g} Hz, the model needs {rate:g} Hz: resample"
        )
    return faults
