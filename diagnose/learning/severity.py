"""The severity from inputs, with what is known of its errors: a blend, and how it did unseen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .blends import Blend, Linear
from .conformal import (
    COVERAGE,
    IntervalCalibration,
    Scale,
    Tails,
    grade_limits,
    grade_probabilities,
    grade_set,
    interval,
    scale_inputs,
    tails,
)
from .experts import Experts
from .grades import GRADE_NAMES, grades_of

Float = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Estimator:
    """Tells the severity from inputs, and how far it may be off.

    Attributes
    ----------
    severity : Blend or Experts
        Inputs to severity [m].
    witness : Linear
        The best straight line among the candidates: it goes on beyond the trained severities,
        where trees stay at the last they have seen.
    scale : Scale
        Size of the error to expect.
    calibration : Calibration
        Behaviour on machines that had no part in the fit.
    shifted : Calibration
        The same with the resonances of each machine elsewhere: what a verdict with caution may
        count on.
    """

    severity: Blend | Experts
    witness: Linear
    scale: Scale
    calibration: IntervalCalibration
    shifted: IntervalCalibration

    def known(self, *, cautious: bool) -> IntervalCalibration:
        """The calibration of a verdict with or without caution."""
        return self.shifted if cautious else self.calibration

    def ends(self, *, cautious: bool, coverage: float = COVERAGE) -> Tails:
        """Tails of a verdict; with caution none is shorter than without."""
        found = tails(self.calibration, coverage)
        if not cautious:
            return found
        far = tails(self.shifted, coverage)
        return replace(far, low=max(far.low, found.low), high=max(far.high, found.high))

    @property
    def error(self) -> float:
        """Mean absolute error on machines that had no part in the fit [m]."""
        return float(np.abs(self.calibration.estimate - self.calibration.truth).mean())

    @property
    def guess_error(self) -> float:
        """Mean absolute error of one guess for all these machines, their median [m]."""
        truth = self.calibration.truth
        return float(np.abs(truth - np.median(truth)).mean())

    def grading(
        self, inputs: Float, distance: float, edges: Sequence[float], *, cautious: bool
    ) -> dict[str, Any]:
        """Grade, set, probabilities and interval of one recording.

        Parameters
        ----------
        inputs : numpy.ndarray [shape=(1, n_inputs)]
        distance : float
            Its novelty.
        edges : sequence of float
            Edges of the grades [m].
        cautious : bool
            There is a caution: the interval is then that of machines unlike the trained ones.

        Returns
        -------
        dict
            Fields of :class:`~.wear_model.verdict.Estimate`.
        """
        severity = float(self.severity.predict(inputs)[0])
        known = self.known(cautious=cautious)
        ends, limits = self._limits(tuple(edges), cautious)
        apart = self.severity.disagreement(inputs)
        sizes = scale_inputs([severity], [distance], apart, self.severity.shares(inputs))
        scale = float(self.scale.predict(sizes)[0])
        low, high = interval(severity, scale, ends)
        grade = int(grades_of(severity, edges))
        share = grade_probabilities(severity, scale, known, edges)
        return {
            "grade": grade,
            "grade_name": GRADE_NAMES[grade],
            "possible_grades": grade_set(severity, scale, limits, edges),
            "grade_probabilities": tuple(share.tolist()),
            "severity": severity,
            "low": low,
            "high": high,
            "coverage": ends.coverage,
        }

    def _limits(self, edges: tuple[float, ...], cautious: bool) -> tuple[Tails, Float]:
        """Tails of the errors and limits of the grades, reckoned once."""
        if (edges, cautious) not in self._reckoned:
            known = self.known(cautious=cautious)
            ends = self.ends(cautious=cautious)
            self._reckoned[edges, cautious] = ends, grade_limits(known, edges)
        return self._reckoned[edges, cautious]

    @cached_property
    def _reckoned(self) -> dict[tuple[tuple[float, ...], bool], tuple[Tails, Float]]:
        return {}
