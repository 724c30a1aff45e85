"""The wear model: what it says of a recording."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.response.transfer import FrfReference
from ...sim.output.recording import DataError, Recording, Table, html_table
from ..familiarity.noise_floor import lifted_rows, swing_of_turn
from ..familiarity.novelty import Familiarity, free_distance, novelty_p_value
from ..feature_rows.feature_choice import choice_in
from ..feature_rows.feature_table import (
    FeatureSelection,
    held_against,
    recording_features,
)
from ..feature_rows.model_card import ModelCard
from ..feature_rows.noted import NOTED, given_of, noted_values
from ..feature_rows.physical import level_channels, levelled_rows
from ..feature_rows.resampling import at_rate
from ..healthy_reference.healthy import Baseline, referenced_rows
from ..healthy_reference.transfer_reference import told_against
from ..learning.heads import Head
from ..learning.severity import Estimator
from ..recording_faults.fault import QualityFault
from ..recording_faults.layout import layout_faults, recording_faults
from ..recording_faults.levels import Levels, quiet_faults
from ..recording_faults.probes import coupling_faults, place_faults
from ..recording_faults.surroundings import company_faults, hum_faults
from ..recording_faults.suspicions import Observation, suspicions
from ..recording_faults.tacho_mark import mark_faults
from .bundle import ModelError
from .cautions import (
    OFF_LEVEL,
    ROUNDING,
    band_cautions,
    condition_cautions,
    disagreement_cautions,
    finding_cautions,
    level_cautions,
    noise_cautions,
    outside_cautions,
    quiet_cautions,
    range_cautions,
    refused,
    strangeness,
    too_quiet,
)
from .verdict import NO_BASELINE, Estimate, FaultFinding, Mode

Float = NDArray[np.float64]

_UNSKILLED = 0.8
"""Error over that of one guess for all machines beyond which a model says so: it was 1.05 with
shuffled labels, 0.16 of a pump's model and 0.15 of a journal's."""

SIMULATION_NOTICE = "trained on simulation; no measured joint of known clearance has confirmed it"

UNFAMILIAR_SHARE = 0.01
"""Share of familiar recordings that may be called unfamiliar, where the calibration is large
enough to determine so small a share; else one in its number."""

_MOST_ODD = 2  # kinds of oddity: of 2,000 unseen pumps seven had two and none had three
_KNOCKING_DB = 15.0  # simulated pumps of one throw swing by 33 dB in a turn, of three by 8
_SPEED_FEATURE = "shaft.speed_hz"


@dataclass(frozen=True, kw_only=True, repr=False)
class WearModel:
    """A trained wear model.

    Attributes
    ----------
    blind : Estimator
        Features to severity.
    informed : Estimator or None
        Severity from features and the conditions noted with the recording: used if all of these are
        known. None if the conditions add nothing to the features.
    familiarity : Familiarity
        The cloud of the training recordings.
    levels : Levels
        Level to expect of each channel.
    heads : tuple of Head
        Classifiers of faults other than the wear.
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
            f"guess for all errs by {1e3 * guess:.3g} mm: it says hardly anything about the wear"
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
        rank = math.floor(self.p_limit * (len(far) + 1) + ROUNDING) - 1
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
            Conditions noted with each recording, by the names of the card.

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
        """Estimator for the severity of a recording, and its inputs [shape=(1, n)]."""
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
            noted with the recording.
        told : tuple of str
            Cautions from other knowledge than the signals.
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
            return self._unusable(faults, too_quiet(self.card, cloud, row))
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
        wrong = np.abs(excess) > OFF_LEVEL * np.asarray(self.levels.size)
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
        card, cloud = self.card, self.familiarity
        reasons = (*refused(self.strangers, row), *too_quiet(card, cloud, row))
        if known["p_value"] <= self.p_limit:
            reasons += (
                strangeness(look.distance, self.blind.calibration.distance),
                *outside_cautions(self.names, cloud, row),
            )
        flawed = tuple(fault.text for fault in faults)  # may be why it is unfamiliar
        if reasons:
            return Estimate(verdict="unfamiliar", reasons=(*reasons, *flawed), **known)
        asked, inputs = self._asked(row, baseline, conditions)
        findings = self._findings(row)
        odd = [
            [*range_cautions(card, asked, inputs), *disagreement_cautions(asked, inputs)],
            condition_cautions(card, row, conditions),
            level_cautions(self.levels, look),
            quiet_cautions(card, cloud, row),
            noise_cautions(self.names, cloud, row),
            band_cautions(self.names, cloud, row),
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
            *outside_cautions(self.names, cloud, row),
            *finding_cautions(card, findings),
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
        without, known = (100 * each.error / limit for each in (self.blind, self.informed))
        return [
            f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not known: with "
            f"{'it' if len(missing) == 1 else 'them'} estimates of unseen machines erred by "
            f"{known:.2g} % of the limit, without by {without:.2g} %; give {settings}"
        ]

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


def input_faults(recording: Recording, card: ModelCard) -> list[str]:
    """What a recording lacks of a model's inputs, as sentences; empty where it fits."""
    seen = at_rate(recording, card.sample_rate_hz)
    return [fault.text for fault in layout_faults(seen, card)]
