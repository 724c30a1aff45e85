"""The wear model: what it says of a recording."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...features.response.transfer import FrfReference
from ...sim.output.recording import DataError, Recording, Table, html_table
from ..feature_rows.feature_choice import choice_in, feature_words, value_words
from ..feature_rows.feature_table import (
    FeatureSelection,
    held_against,
    is_regime,
    kind_words,
    knows_no_oil,
    recording_features,
    regime_words,
)
from ..feature_rows.healthy import Baseline, referenced_rows
from ..feature_rows.model_card import ModelCard
from ..feature_rows.noted import NOTED, given_of, noted_values
from ..feature_rows.physical import level_channels, levelled_rows
from ..feature_rows.quality import (
    Levels,
    Observation,
    QualityFault,
    coupling_faults,
    layout_faults,
    mark_faults,
    place_faults,
    quiet_faults,
    recording_faults,
    suspicions,
)
from ..feature_rows.resampling import at_rate
from ..feature_rows.surroundings import company_faults, hum_faults
from ..feature_rows.transfer_reference import told_against
from ..learning.conformal import COVERAGE
from ..learning.grades import GRADE_NAMES
from ..learning.heads import Head, logit
from ..learning.severity import Estimator
from .bandwidth import cut_off
from .noise_floor import lifted_rows, noisiest, swing_of_turn
from .novelty import Familiarity, free_distance, novelty_p_value
from .quietness import CAUTIONED_SHARE

Float = NDArray[np.float64]
Verdict = Literal["graded", "caution", "unfamiliar", "unusable"]
Mode = Literal["cold", "referenced"]

_UNSKILLED = 0.8
"""Error over that of one guess for all machines beyond which a model says so: it was 1.05 with
shuffled labels, 0.16 of a pump's model and 0.15 of a journal's."""

SIMULATION_NOTICE = "trained on simulation; no measured joint of known clearance has confirmed it"

UNFAMILIAR_SHARE = 0.01
"""Share of familiar recordings that may be called unfamiliar, where the calibration is large
enough to tell so small a share; else one in its number."""

_OFF_LEVEL = 3.5  # standard deviations of a level that few familiar machines reach
_MUCH_WORSE = 1.5  # times the error: that of twenty recordings is known to a sixth
_TOLD_OUTSIDE = 3  # features that a caution names
_ROUNDING = 1e-9
_MOST_ODD = 2  # kinds of oddity: of 2,000 unseen pumps seven had two and none had three
_KNOCKING_DB = 15.0  # simulated pumps of one throw swing by 33 dB in a turn, of three by 8
_SPEED_FEATURE = "shaft.speed_hz"


class ModelError(ValueError):
    """A model file cannot be used; names what is wrong and what helps."""


@dataclass(frozen=True, kw_only=True)
class FaultFinding:
    """What a model says of a fault beside the wear.

    Attributes
    ----------
    name : str
        As the data set labels it.
    probability : float
        That it is present.
    present : bool
        The probability is above the threshold of the model.
    detection_rate, false_alarm_rate : float
        Share of present ones found, and of absent ones called present, on machines that had no
        part in the fit.
    visible_from_m : float or None
        Of a regime: wear that is told from as new in nine of ten machines without part in the fit,
        at 5 % false alarms [m]; less is not seen.
    """

    name: str
    probability: float
    present: bool
    detection_rate: float
    false_alarm_rate: float
    visible_from_m: float | None = None

    @property
    def unseen(self) -> str:
        """What wear a regime hides, in words; empty where that is not known."""
        return unseen_words(self.name, self.visible_from_m)


def unseen_words(name: str, visible_from_m: float | None) -> str:
    """What wear a regime hides.

    Examples
    --------
    >>> unseen_words("lubrication_flooded", 2.1e-4)
    'wear below 0.21 mm cannot be seen on a flooded pin of this kind'
    """
    if visible_from_m is None:
        return ""
    return (
        f"wear below {1e3 * visible_from_m:.2g} mm cannot be seen on a {regime_words(name)} of "
        "this kind"
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Estimate:
    """What a model says of one recording.

    Attributes
    ----------
    verdict : {"graded", "caution", "unfamiliar", "unusable"}
        Caution: graded, but read `cautions`. Unfamiliar: no grade, the machine is none of the
        trained kind. Unusable: no grade, the recording is at fault, or there is
        no healthy reference for a model that needs one.
    faults : tuple of QualityFault
        Of the data.
    reasons : tuple of str
        Why there is no grade; empty where there is one.
    cautions : tuple of str
        Conditions outside the trained range, faults that bar no verdict.
    mode : {"cold", "referenced"}
        Whether healthy recordings of the same machine were used.
    noted : tuple of str
        Conditions noted beside the recording that the estimate is made with.
    p_value : float or None
        Of the hypothesis that the recording is of the trained kind; None where it could not even
        be turned into the model's features.
    p_limit : float or None
        At or below it a recording is called unfamiliar.
    nearest : str
        The trained machine that is nearest; empty where unusable.
    grade : int or None
        0 to 3.
    grade_name : str
        In words; empty without a grade.
    possible_grades : tuple of int
        Those that cannot be excluded.
    grade_probabilities : tuple of float
        Of every grade, sum 1.
    severity, low, high : float or None
        Estimate and interval [m].
    coverage : float
        Nominal coverage of the interval, and of the set.
    confounders : tuple of FaultFinding
        Faults beside the wear that the model knows.
    evidence : tuple of (str, float, float, float)
        Feature, its value, the healthy one (of the baseline, or mean of as-new machines), distance
        in standard deviations of healthy machines; the features that moved the most.
    """

    verdict: Verdict
    faults: tuple[QualityFault, ...] = ()
    reasons: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    mode: Mode = "cold"
    noted: tuple[str, ...] = ()
    p_value: float | None = None
    p_limit: float | None = None
    nearest: str = ""
    grade: int | None = None
    grade_name: str = ""
    possible_grades: tuple[int, ...] = ()
    grade_probabilities: tuple[float, ...] = ()
    severity: float | None = None
    low: float | None = None
    high: float | None = None
    coverage: float = COVERAGE
    confounders: tuple[FaultFinding, ...] = ()
    evidence: tuple[tuple[str, float, float, float], ...] = ()

    @property
    def graded(self) -> bool:
        """Whether there is a grade, with or without caution."""
        return self.verdict in ("graded", "caution")

    @property
    def unreferenced(self) -> bool:
        """Unusable for want of the healthy reference alone: the recording itself is sound."""
        return self.reasons == (NO_BASELINE,)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def __repr__(self) -> str:
        """Verdict, and what it says: the wear with its interval, or why there is none."""
        if self.severity is None or self.low is None or self.high is None:
            return f"<Estimate {self.verdict}: {'; '.join(self.reasons) or 'no grade'}>"
        low, high = 1e3 * self.low, 1e3 * self.high
        return (
            f"<Estimate {self.verdict}: {self.grade_name}, {1e3 * self.severity:.3g} mm, "
            f"{100 * self.coverage:.0f} % within {low:.3g} to {high:.3g} mm>"
        )

    def _repr_html_(self) -> str:
        """The same for notebooks, with what must be known of it."""
        told = {
            "fault": [fault.text for fault in self.faults],
            "reason": self.reasons,
            "caution": self.cautions,
            "grade": [
                f"{GRADE_NAMES[grade]}: {100 * share:.0f} %"
                for grade, share in enumerate(self.grade_probabilities)
                if grade in self.possible_grades
            ],
        }
        rows = [(name, text) for name, texts in told.items() for text in texts]
        return html_table(repr(self)[1:-1], ["", "text"], rows)


@dataclass(frozen=True, kw_only=True, repr=False)
class WearModel:
    """A trained wear model.

    Attributes
    ----------
    blind : Estimator
        Features to severity.
    informed : Estimator or None
        Features and the conditions noted beside the recording to severity: used where all of them
        are known. None where the conditions tell no more than the features do.
    familiarity : Familiarity
        The cloud of the training recordings.
    levels : Levels
        Level to expect of each channel.
    heads : tuple of Head
        Faults beside the wear.
    strangers : tuple of Head
        Kinds of recordings that it was shown to refuse.
    card : ModelCard
        What it was trained on, its inputs, limits and ranges.
    """

    blind: Estimator
    informed: Estimator | None = None
    familiarity: Familiarity
    levels: Levels
    heads: tuple[Head, ...] = ()
    strangers: tuple[Head, ...] = ()
    card: ModelCard

    def __repr__(self) -> str:
        """What it estimates, from what, and what it was trained on."""
        return f"<WearModel of {self.card.severity}, {'; '.join(self._facts)}>"

    def _repr_html_(self) -> str:
        """For notebooks: the same as a table, with the notice."""
        rows = [(fact,) for fact in (*self._facts, self.notice) if fact]
        return html_table(f"wear model of {self.card.severity}", ("model",), rows)

    @property
    def _facts(self) -> tuple[str, ...]:
        trained, origin = self.card.trained_on, self.card.origin
        return (
            f"{len(self.names)} features",
            f"{trained.records} {origin} records of {trained.draws} machine draws",
            self.mode,
        )

    @property
    def notice(self) -> str:
        """What every report must say; from origin and errors, not from a text in a file."""
        simulated = SIMULATION_NOTICE if self.card.origin == "simulated" else ""
        error, guess = self.blind.error, self.blind.guess_error
        unskilled = (
            f"found on machines left out of training to err by {1e3 * error:.3g} mm, where one "
            f"guess for all errs by {1e3 * guess:.3g} mm: it tells hardly anything about the wear"
        )
        return "; ".join(filter(None, (simulated, unskilled * (error > _UNSKILLED * guess))))

    @property
    def mode(self) -> Mode:
        """Whether it needs healthy recordings of the machine."""
        return "referenced" if self.card.mode == "referenced" else "cold"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the features of a row."""
        return tuple(self.card.features)

    @cached_property
    def p_limit(self) -> float:
        """A recording with this p-value or a smaller one is called unfamiliar."""
        return max(UNFAMILIAR_SHARE, 1 / (len(self.blind.calibration.distance) + 1))

    @cached_property
    def distance_limit(self) -> float:
        """Distance at which the p-value falls to its limit."""
        far = np.sort(self.blind.calibration.distance)[::-1]
        # that many calibration recordings lie at least as far
        rank = math.floor(self.p_limit * (len(far) + 1) + _ROUNDING) - 1
        return float(np.nextafter(far[rank], math.inf)) if rank < len(far) else 0.0

    @cached_property
    def noted(self) -> tuple[str, ...]:
        """Conditions that the informed estimate needs; none where there is no such estimate."""
        return () if self.informed is None else self.card.noted_names

    @cached_property
    def _columns(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def _knocks(self) -> bool:
        """Whether its machines knock in every turn, and are quiet between."""
        return swing_of_turn(self.names, self._healthy[0]) > _KNOCKING_DB

    @cached_property
    def _healthy(self) -> tuple[Float, Float]:
        """Mean and spread of healthy features."""
        known = self.card.healthy_features
        return np.array(known.mean), np.array(known.spread)

    def predict(
        self,
        rows: Float | Recording | Sequence[Recording],
        baseline: Float | None = None,
        conditions: Sequence[Mapping[str, Any]] | None = None,
    ) -> Float:
        """Severity of many recordings, without a word on how far it can be trusted.

        Parameters
        ----------
        rows : numpy.ndarray [shape=(n, n_features)], Recording or sequence of Recording
            Features in the order of ``card.features``, or what they are computed from; faults of
            a recording are not looked for, see :meth:`estimate`.
        baseline : numpy.ndarray [shape=(n, n_features)] or [shape=(n_features,)], optional
            Healthy rows of the same machines, of a referenced model.
        conditions : sequence of mapping, optional
            What was noted beside each recording, by the names of the card.

        Returns
        -------
        numpy.ndarray [shape=(n,)]
            [m]

        Raises
        ------
        DataError
            The model is referenced and there is no baseline, or `rows` is none of these.
        """
        inputs = self._inputs(self._rows(rows), baseline)
        found = self.blind.severity.predict(inputs)
        if self.informed is None or conditions is None:
            return found
        noted = noted_values(self.noted, conditions)
        known = np.isfinite(noted).all(axis=1)
        if known.any():
            both = np.hstack([inputs[known], noted[known]])
            found[known] = self.informed.severity.predict(both)
        return found

    def informed_of(self, conditions: Mapping[str, Any]) -> bool:
        """Whether the conditions suffice for the informed estimate."""
        if self.informed is None:
            return False
        return bool(np.isfinite(noted_values(self.noted, [conditions])).all())

    def _asked(
        self, row: Float, baseline: Float | None, conditions: Mapping[str, Any]
    ) -> tuple[Estimator, Float]:
        """Who is to tell the severity of a recording, and from which inputs [shape=(1, n)]."""
        inputs = self._inputs(row[None, :], baseline)
        if self.informed is None or not self.informed_of(conditions):
            return self.blind, inputs
        return self.informed, np.hstack([inputs, noted_values(self.noted, [conditions])])

    def _rows(self, given: Float | Recording | Sequence[Recording]) -> Float:
        heard = [given] if isinstance(given, Recording) else given
        if isinstance(heard, np.ndarray):
            return heard
        if not len(heard) or not all(isinstance(each, Recording) for each in heard):
            raise DataError(
                f"rows = {type(given).__name__} must be an array of features, a recording, or "
                "several recordings; arrays of samples are for estimate"
            )
        return np.array([self._row(self._at_rate(each), None) for each in heard])

    def _inputs(self, rows: Float, baseline: Float | None) -> Float:
        lifted = self._lifted(rows)
        if self.mode == "cold":
            return lifted
        if baseline is None:
            raise DataError(NO_BASELINE)
        return referenced_rows(lifted, self._lifted(np.atleast_2d(baseline)))

    def estimate(
        self,
        recording: Recording | NDArray[Any] | Table,
        baseline: Baseline | None = None,
        conditions: Mapping[str, Any] | None = None,
        told: tuple[str, ...] = (),
        *,
        fs: float | None = None,
    ) -> Estimate:
        """Estimate the wear of the machine in a recording.

        Parameters
        ----------
        recording : Recording, numpy.ndarray or pandas.DataFrame
            Any, with the views that the model reads joined to it; one that is sampled faster is
            brought to the model's rate, one that lacks the model's inputs or is at fault is
            unusable, with the reasons. An array [shape=(n_channels, n_samples)] has the model's
            channels in their order and units, a table a column for each.
        baseline : Baseline, optional
            Healthy recordings of the same machine; a referenced model needs them, a cold one only
            tells the evidence against them.
        conditions : mapping, optional
            What is known of the day by the names of the card [SI units]; unless given, what was
            noted beside the recording.
        told : tuple of str
            Cautions from what is known beside the signals.
        fs : float, optional
            Sample rate of an array or a table [Hz].

        Returns
        -------
        Estimate

        Raises
        ------
        DataError
            The signal cannot be turned into features.
        ModelError
            The program's features are not the model's.
        """
        given = self.card.recording_of(recording, fs)
        stated, recording = given.sample_rate, self._at_rate(given)
        faults = recording_faults(recording, self.card)
        if any(fault.bars for fault in faults):
            return self._unusable(faults)
        known = None if baseline is None else baseline.transfer
        if known is None and told_against(FeatureSelection(only=self.names)):
            return Estimate(verdict="unusable", reasons=(NO_BASELINE,), mode=self.mode)
        row = self._row(recording, known)
        cloud = self.familiarity
        faults += (coupled := coupling_faults(recording, self.names, row, cloud.low))
        if self.mode == "cold" and not coupled:  # healthy recordings take zeros of probes away
            faults += place_faults(recording, self.names, row, cloud.low, cloud.high)
        late = cloud.late_mark(self.names, self._lifted(row[None, :])[0], self.distance_limit)
        faults += mark_faults(recording, late)
        if any(fault.bars for fault in faults):
            return self._unusable(faults)
        look = self._look(row)
        place = self._columns.get(_SPEED_FEATURE)
        faults += hum_faults(recording, None if place is None else float(row[place]))
        if self._knocks:
            faults += company_faults(recording)

        def see(mended: Recording) -> Observation:
            return self._look(self._row(mended, known))

        faults += suspicions(recording, look, see, self._speeds(), stated) or quiet_faults(
            recording, self.names, row, self.levels
        )
        if any(fault.bars for fault in faults):
            return self._unusable(faults, self._too_quiet(row))
        features = None if baseline is None else baseline.features
        noted = recording.row if conditions is None else conditions
        return self._judge(row, look, features, noted, faults, told)

    def _at_rate(self, recording: Recording) -> Recording:
        """The recording and its views, those that are sampled faster at the model's rates."""
        layouts = self.card.views
        joined = {
            view: at_rate(other, layouts[view].sample_rate_hz) if view in layouts else other
            for view, other in recording.joined.items()
        }
        return at_rate(replace(recording, joined=joined), self.card.sample_rate_hz)

    def _unusable(self, faults: tuple[QualityFault, ...], others: tuple[str, ...] = ()) -> Estimate:
        bars, flawed = ([f.text for f in faults if f.bars is bar] for bar in (True, False))
        reasons = (*bars, *others, *flawed)
        return Estimate(verdict="unusable", faults=faults, reasons=reasons, mode=self.mode)

    def _row(self, recording: Recording, reference: FrfReference | None) -> Float:
        choice = held_against(choice_in(self.card.feature_choice), reference)
        order = self.card.views
        joined = {view: recording.joined[view] for view in order}
        names, values = recording_features(replace(recording, joined=joined), choice)
        if names != self.names:
            raise ModelError(
                f"the model's {len(self.names)} features are not the program's {len(names)}; "
                "retrain it: wearstate train DATA -o MODEL"
            )
        return values

    def _look(self, row: Float) -> Observation:
        """How strange a recording is, with its level mended or its noise filled up first.

        A channel of another sensitivity is quieter as well, and must not be filled up before its
        level is mended; the level of a very clean one cannot be told before it is filled up. Of
        both orders, the one that makes the recording more familiar.
        """
        lifted = self._lifted(row[None, :])[0]
        ways = [row] if np.array_equal(lifted, row) else [row, lifted]
        return min((self._look_at(each) for each in ways), key=lambda look: look.distance)

    def _look_at(self, row: Float) -> Observation:
        speed = row[self._columns[_SPEED_FEATURE]] if _SPEED_FEATURE in self._columns else None
        apart = self.familiarity.by_kind(self.names, self._lifted(row[None, :]))[0]
        levelled = self._lifted(self._levelled(row))
        return Observation(
            distance=float(self.familiarity.distance(self.names, levelled)[0]),
            limit=self.distance_limit,
            free_distance=free_distance(self.names, apart),
            excess_db=self._excess(row),
            speed_hz=None if speed is None else float(speed),
        )

    def _lifted(self, rows: Float) -> Float:
        """Rows of cleaner recordings than any known, with the least noise that is known."""
        return lifted_rows(self.names, rows, self.familiarity.least_noise)

    def _levelled(self, row: Float) -> Float:
        """The row with levels that a sensitivity must have put there taken away [shape=(1, n)]."""
        excess = self.levels.excess(self.names, row[None, :])
        wrong = np.abs(excess) > _OFF_LEVEL * np.asarray(self.levels.size)
        return levelled_rows(self.names, row[None, :], np.where(wrong, excess, 0.0))

    def _excess(self, row: Float) -> dict[str, float]:
        """Level of each channel above the expected one [dB]."""
        excess = self.levels.excess(self.names, row[None, :])[0]
        return dict(zip(level_channels(self.names), excess.tolist(), strict=True))

    def _speeds(self) -> tuple[float, float] | None:
        """Trained speeds [Hz]."""
        for condition in self.card.conditions:
            if condition.feature == _SPEED_FEATURE:
                return condition.low, condition.high
        return None

    def judge(
        self,
        row: Float,
        baseline: Float | None = None,
        *,
        conditions: Mapping[str, Any] | None = None,
        faults: tuple[QualityFault, ...] = (),
    ) -> Estimate:
        """Estimate from a feature row.

        Parameters
        ----------
        row : numpy.ndarray [shape=(n_features,)]
            In the order of ``card.features``.
        baseline : numpy.ndarray [shape=(n_features,)], optional
            Healthy row of the same machine.
        conditions : mapping, optional
            Operating conditions by the names of the card, as far as they were recorded.
        faults : tuple of QualityFault
            Found in the recording; none of them bars a verdict.

        Returns
        -------
        Estimate
        """
        return self._judge(row, self._look(row), baseline, conditions or {}, faults)

    def _judge(
        self,
        row: Float,
        look: Observation,
        baseline: Float | None,
        conditions: Mapping[str, Any],
        faults: tuple[QualityFault, ...],
        told: tuple[str, ...] = (),
    ) -> Estimate:
        if self.mode == "referenced" and baseline is None:
            return Estimate(verdict="unusable", reasons=(NO_BASELINE,), mode=self.mode)
        raw, row = row, self._lifted(row[None, :])[0]
        known: dict[str, Any] = {
            "faults": faults,
            "mode": self.mode,
            "p_value": novelty_p_value(look.distance, self.blind.calibration.distance),
            "p_limit": self.p_limit,
            "nearest": self._nearest(row),
        }
        reasons = (*self._refused(row), *self._too_quiet(row))
        if known["p_value"] <= self.p_limit:
            reasons += (
                _strangeness(look.distance, self.blind.calibration.distance),
                *self._outside_cautions(row),
            )
        flawed = tuple(fault.text for fault in faults)  # may be why it is unfamiliar
        if reasons:
            return Estimate(verdict="unfamiliar", reasons=(*reasons, *flawed), **known)
        asked, inputs = self._asked(row, baseline, conditions)
        findings = self._findings(row)
        odd = [
            [*self._range_cautions(asked, inputs), *_disagreement_cautions(asked, inputs)],
            self._condition_cautions(row, conditions),
            self._level_cautions(look),
            self._quiet_cautions(row),
            self._noise_cautions(row),
            self._band_cautions(row),
        ]
        strange = tuple(text for texts in odd for text in texts)
        if (ways := sum(bool(texts) for texts in odd)) > _MOST_ODD:
            whole = (
                f"it is unlike the training recordings in {ways} ways at once, must be in at most "
                f"{_MOST_ODD}, as all machines of its kind were that it was tried on"
            )
            return Estimate(verdict="unfamiliar", reasons=(whole, *strange, *flawed), **known)
        cautions = (
            *told,
            *flawed,
            *self._missing_cautions(conditions),
            *strange,
            *self._outside_cautions(row),
            *self._finding_cautions(findings),
        )
        return Estimate(
            verdict="caution" if cautions else "graded",
            noted=() if asked is self.blind else given_of(self.noted, conditions),
            cautions=cautions,
            confounders=findings,
            evidence=self._evidence(raw, baseline),
            **known,
            **asked.grading(
                inputs, look.distance, self.card.grade_edges_m, cautious=bool(cautions)
            ),
        )

    def _refused(self, row: Float) -> tuple[str, ...]:
        """That a recording sounds like one of a kind that the model was shown to refuse."""
        found = [(head, float(head.probability(row[None, :])[0])) for head in self.strangers]
        called = [
            (logit(probability) - logit(head.threshold), head.name)
            for head, probability in found
            if probability > head.threshold
        ]
        if not called:
            return ()
        _, likeliest = max(called)
        return (
            f"it sounds like {kind_words(likeliest)}, which this model was trained to refuse; to "
            "have it graded, train on a data set that holds such machines",
        )

    def _too_quiet(self, row: Float) -> tuple[str, ...]:
        """That a machine is quieter than any in training, with the cause; empty if it is not."""
        lack, most = self._lacking(row), self.familiarity.most_lacking
        if lack <= most:
            return ()
        oil = "flooded pins, which do not knock, are not in this model: train one on a recipe that "
        oil = f"{oil}draws them, or " if self._knows_no_oil else ""
        return (
            f"it is quieter than any {self.card.trained_on.scene or 'machine'} trained on: "
            f"its peaks are {lack:.1f} dB below those usual at its speed, must be at most "
            f"{most:.1f} dB below; {oil}check the sensitivity of the sensors",
        )

    def _quiet_cautions(self, row: Float) -> list[str]:
        """That few trained pins are as quiet, where a flooded one would not be known."""
        lack, seldom = self._lacking(row), self.familiarity.seldom_lacking
        if lack <= seldom or not self._knows_no_oil:
            return []
        return [
            f"it is quieter than {1 - CAUTIONED_SHARE:.0%} of the machines trained on: its peaks "
            f"are {lack:.1f} dB below those usual at its speed, in all but a few at most "
            f"{seldom:.1f} dB; flooded pins, which do not knock, are not in this model: if this "
            "one may be flooded, train one on a recipe that draws them"
        ]

    def _noise_cautions(self, row: Float) -> list[str]:
        """That noise, or a machine near by, hides more than it did in training."""
        cloud = self.familiarity
        floor = noisiest(self.names, row, cloud.floor_ceiling)
        if floor is None or floor.excess_db <= cloud.most_noise:
            return []
        return [
            f"the noise floor of {floor.channel} (its level at quiet crank angles) is "
            f"{floor.excess_db:.1f} dB above the loudest usual one in training, must be at most "
            f"{cloud.most_noise:.1f} dB above: it hides what a sound machine shows; "
            "check sensor, cable and grounding, or what runs near by"
        ]

    def _band_cautions(self, row: Float) -> list[str]:
        """That the upper end of a channel's band is missing."""
        return [
            f"{each.channel} is {each.lacking_db:.0f} dB quieter above {each.edge_hz:.0f} Hz than "
            f"its lower bands suggest, must be at most {each.most_db:.0f} dB: a filter, the "
            "mounting of the sensor or resampling limits its band"
            for each in cut_off(self.names, row, self.familiarity.tops)
        ]

    def _lacking(self, row: Float) -> float:
        """How far the peaks of a recording are below those usual at its speed [dB]."""
        return float(self.familiarity.lacking(self.names, row[None, :])[0])

    @property
    def _knows_no_oil(self) -> bool:
        known = [rates.name for rates in self.card.confounders]
        known += [rates.name for rates in self.card.strangers]
        return knows_no_oil(self.card.severity, known)

    def _nearest(self, row: Float) -> str:
        group, distance = self.familiarity.nearest(self.names, row)
        trained = self.card.trained_on
        kind = trained.recipe or trained.scene or "the training set"
        return f"machine {group} of {kind}, {distance:.2g} away"

    def _missing_cautions(self, conditions: Mapping[str, Any]) -> list[str]:
        """What a person could add, and what it is worth."""
        if self.informed is None or self.informed_of(conditions):
            return []
        noted = noted_values(self.noted, [conditions])[0]
        missing = [name for name, value in zip(self.noted, noted, strict=True) if np.isnan(value)]
        settings = " ".join(f"--set {NOTED[name].setting}" for name in missing)
        limit = self.card.condemning_limit_m
        without, told = (100 * each.error / limit for each in (self.blind, self.informed))
        return [
            f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not known: with "
            f"{'it' if len(missing) == 1 else 'them'} estimates of unseen machines erred by "
            f"{told:.2g} % of the limit, without by {without:.2g} %; give {settings}"
        ]

    def _range_cautions(self, asked: Estimator, inputs: Float) -> list[str]:
        """Beyond the trained severities an estimate is a bound, and a poor one."""
        low, high = self.card.severity_range_m
        severity = float(asked.severity.predict(inputs)[0])
        straight = float(asked.witness.predict(inputs)[0])
        outside = [value for value in (severity, straight) if not low <= value <= high]
        if not outside:
            return []
        side, edge = ("more", high) if outside[0] > high else ("less", low)
        what = "the estimate" if outside[0] == severity else "a straight line through the training"
        return [
            f"{what}, {1e3 * outside[0]:.3g} mm, is outside the trained range {1e3 * low:.3g} to "
            f"{1e3 * high:.3g} mm: the wear may well be '{side} than {1e3 * edge:.3g} mm'"
        ]

    def _condition_cautions(self, row: Float, recorded: Mapping[str, Any]) -> list[str]:
        """Conditions outside the trained range: from the signal, or as noted beside it."""
        cautions = []
        for condition in self.card.conditions:
            name, feature = condition.name, condition.feature
            value = row[self._columns[feature]] if feature else recorded.get(name)
            low, high = condition.low, condition.high
            if value is None or not math.isfinite(value) or low <= value <= high:
                continue
            cautions.append(
                f"{name} = {f'{value:.4g} {condition.unit}'.rstrip()} is outside the trained range "
                f"{f'{low:.4g} to {high:.4g} {condition.unit}'.rstrip()}: extrapolating"
            )
        return cautions

    def _outside_cautions(self, row: Float) -> list[str]:
        """That more features are outside their trained ranges than in few familiar recordings."""
        cloud, n = self.familiarity, len(self.names)
        places = cloud.farthest_outside(row)
        most = math.floor(cloud.seldom_outside * n + _ROUNDING)
        if len(places) <= most:
            return []
        worst = "; ".join(
            f"{feature_words(self.names[i])} {value_words(self.names[i], row[i])}, "
            f"trained {cloud.low[i]:.3g} to {cloud.high[i]:.3g}"
            for i in places[:_TOLD_OUTSIDE]
        )
        return [
            f"{len(places)} of {n} features are outside all that was trained on, in all but a few "
            f"familiar recordings at most {most}: {worst}"
        ]

    def _level_cautions(self, look: Observation) -> list[str]:
        return [
            f"the level of {channel} is {value:+.1f} dB off what its shape lets expect, must be "
            f"within {_OFF_LEVEL * size:.1f} dB: check the sensitivity of its sensor"
            for (channel, value), size in zip(look.excess_db.items(), self.levels.size, strict=True)
            if abs(value) > _OFF_LEVEL * size
        ]

    def _finding_cautions(self, findings: tuple[FaultFinding, ...]) -> list[str]:
        """Faults that the intervals, which are for all machines alike, do not allow for."""
        cautions = []
        for finding, rates in zip(findings, self.card.confounders, strict=True):
            worse, usual = rates.mae_with_m, rates.mae_without_m
            if finding.present and worse > _MUCH_WORSE * usual:
                found = f"{finding.name.replace('_', ' ')} looks present, and with it"
                cure = "mend it and record again"
                if is_regime(finding.name):
                    found = f"this sounds like a {regime_words(finding.name)}, and on such"
                    cure = finding.unseen or "wear shows less in this regime"
                cautions.append(
                    f"{found} estimates erred by {1e3 * worse:.2g} mm instead of "
                    f"{1e3 * usual:.2g} mm: {cure}"
                )
        return cautions

    def _findings(self, row: Float) -> tuple[FaultFinding, ...]:
        findings = []
        for head, rates in zip(self.heads, self.card.confounders, strict=True):
            probability = float(head.probability(row[None, :])[0])
            findings.append(
                FaultFinding(
                    name=head.name,
                    probability=probability,
                    present=probability > head.threshold,
                    detection_rate=rates.detection_rate,
                    false_alarm_rate=rates.false_alarm_rate,
                    visible_from_m=rates.visible_from_m,
                )
            )
        return tuple(findings)

    def _evidence(
        self, row: Float, baseline: Float | None, most: int = 12
    ) -> tuple[tuple[str, float, float, float], ...]:
        """Features farthest from the healthy ones: the machine's own where they are known."""
        mean, spread = self._healthy
        if baseline is not None:
            mean = baseline
        moved = np.where(spread > 0, (row - mean) / np.where(spread > 0, spread, 1), 0.0)
        order = np.argsort(-np.abs(moved))[:most]
        return tuple((self.names[i], float(row[i]), float(mean[i]), float(moved[i])) for i in order)


NO_BASELINE = (
    "the model was trained with a baseline and needs healthy recordings of this machine: give "
    "--baseline healthy.h5, or use a model that was trained cold"
)
"""Reason of a verdict that lacks nothing but the reference."""


def _disagreement_cautions(asked: Estimator, inputs: Float) -> list[str]:
    """Smooth parts and trees learnt the same; where they part, one of them knows nothing."""
    apart, usual = float(asked.severity.disagreement(inputs)[0]), asked.severity.tube
    if apart <= usual:
        return []
    return [
        f"smooth parts and trees of the model differ by a factor of {math.exp(apart):.3g}, "
        f"on familiar machines by {math.exp(usual):.3g} at most: this one is unlike them"
    ]


def _strangeness(distance: float, calibration: Float) -> str:
    """How far a recording lies from the training recordings, in words."""
    n, farther = len(calibration), int(np.count_nonzero(calibration >= distance))
    rank = f"{farther} of {n}" if farther else f"none of {n}"
    return (
        f"its features lie {distance:.3g} from the centre of the training recordings; {rank} "
        f"calibration recordings lie as far (median {np.median(calibration):.3g}, largest "
        f"{calibration.max():.3g})"
    )


def input_faults(recording: Recording, card: ModelCard) -> list[str]:
    """What a recording lacks of a model's inputs, as sentences; empty where it fits."""
    seen = at_rate(recording, card.sample_rate_hz)
    return [fault.text for fault in layout_faults(seen, card)]
