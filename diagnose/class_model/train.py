"""Model that recognises named conditions, trained on the user's labelled recordings.

There is no clearance in metres and no grade: a recording belongs to one of the labelled classes,
with a set of those that cannot be excluded, or to none.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...datasets.file.attributes import Attributes
from ...datasets.file.record import DataSet
from ...datasets.split.rules import check_no_leak, group_folds
from ...sim.output.recording import DataError, Recording, Table
from ..familiarity.novelty import Familiarity, fit_familiarity
from ..feature_rows.blows import NOISE_SCORE, blow_scores, blow_table
from ..feature_rows.feature_choice import choice_card, choice_in
from ..feature_rows.feature_table import (
    USUAL,
    FeatureSelection,
    FeatureTable,
    Progress,
    feature_table,
    recording_features,
)
from ..feature_rows.model_card import ClassCard
from ..learning.blends import Blend
from ..learning.regressions import CANDIDATES, Folds, fit_blend
from ..recording_faults.layout import layout_faults
from ..recording_faults.samples import sample_faults
from ..report.batch import Item, fault_of
from ..wear_model.bundle import ModelError
from .votes import FEWEST, Votes, score_votes, set_of

Float = NDArray[np.float64]
Index = NDArray[np.intp]

_MOST_CLASSES = 20
_MOST_FOLDS = 10  # of whole recordings; up to this number each is a fold
_FEWEST_TO_KNOW = 10  # training recordings; with fewer, most unknown conditions are accepted
_USED = ("plain ridge", "trees")  # candidates suitable for few recordings


@dataclass(frozen=True, kw_only=True)
class Naming:
    """Result of a class model for one recording.

    Attributes
    ----------
    verdict : {"named", "unfamiliar", "unusable"}
        Unfamiliar: like none of the training recordings. Unusable: the recording is faulty.
    reasons : tuple of str
        Why there is no name; empty if there is one.
    cautions : tuple of str
        What makes a name doubtful: minor faults of the recording.
    name : str
        The likeliest class; empty without one.
    possible : tuple of str
        Classes that cannot be excluded, in the order of the model; not empty if named.
    shares : dict
        Class -> share of the votes, sum 1.
    p_value : float or None
        P-value of the hypothesis that the recording is of a trained class.
    p_limit : float or None
        Limit at or below which a recording is unfamiliar.
    """

    verdict: Literal["named", "unfamiliar", "unusable"]
    reasons: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    name: str = ""
    possible: tuple[str, ...] = ()
    shares: Mapping[str, float]
    p_value: float | None = None
    p_limit: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Result for JSON."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class ClassModel:
    """A trained model of named conditions.

    Attributes
    ----------
    blends : tuple of Blend
        One per class: features -> 1 (another) … 2 (this one).
    votes : Votes
        Votes on the training records.
    familiarity : tuple of Familiarity
        Distribution of the training recordings of each class, because a recording between two
        classes belongs to neither; for a class with too few recordings, that of all.
    card : ClassCard
        Training data, inputs and classes.
    """

    blends: tuple[Blend, ...]
    votes: Votes
    familiarity: tuple[Familiarity, ...]
    card: ClassCard

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes, in alphabetical order."""
        return tuple(self.card.classes)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the features of a row."""
        return tuple(self.card.features)

    @cached_property
    def scores(self) -> dict[str, Any]:
        """Accuracy on left-out recordings, from :func:`score_votes`."""
        return score_votes(self.votes, self.classes)

    def __repr__(self) -> str:
        recordings = len(np.unique(self.votes.group))
        return f"<ClassModel of {self.card.target}: {', '.join(self.classes)}; {recordings} groups>"

    @property
    def notice(self) -> str:
        """Notice to be shown with every result."""
        few = [
            f"{name}: {count} recording(s), can be neither evaluated nor excluded"
            for name, count in zip(self.classes, self.votes.groups_of, strict=True)
            if count < FEWEST
        ]
        recordings = len(np.unique(self.votes.group))
        if recordings < _FEWEST_TO_KNOW:
            few.append(
                f"trained on {recordings} recordings, must be >= {_FEWEST_TO_KNOW} to "
                "recognise unfamiliar recordings: a condition outside its classes "
                "may be named as one of them"
            )
        accuracy, guess = self.scores["accuracy"], self.scores["majority"]
        if self.scores["recordings_judged"] and self.scores["intervals"]["accuracy"][0] <= guess:
            few.append(
                f"it named {accuracy:.2f} of left-out recordings correctly, the largest class "
                f"alone would give {guess:.2f}: that may be chance"
            )
        return "; ".join(few)

    def distance(self, rows: Float) -> Float:
        """Distance of feature rows [shape=(n, n_features)] from the nearest class [shape=(n,)]."""
        return _nearest_distance(self.familiarity, self.names, rows)

    def predict(self, rows: Float) -> Float:
        """Shares [shape=(n, n_classes)] for feature rows [shape=(n, n_features)]."""
        return _shares(np.stack([blend.predict(rows) for blend in self.blends], axis=1))

    def estimate(
        self, recording: Recording | NDArray[Any] | Table, *, fs: float | None = None
    ) -> Naming:
        """Recognise the condition in a recording.

        Parameters
        ----------
        recording : Recording, numpy.ndarray or pandas.DataFrame
            One that lacks the model's inputs or is faulty is unusable, with the reasons. An array
            [shape=(n_channels, n_samples)] has the model's channels in their order and units, a
            table one column per channel.
        fs : float, optional
            Sample rate of an array or a table [Hz].

        Returns
        -------
        Naming

        Raises
        ------
        DataError
            The features cannot be computed.
        ModelError
            The features of this program are not those of the model.
        """
        recording = self.card.recording_of(recording, fs)
        faults = layout_faults(recording, self.card) or sample_faults(recording)
        reasons = tuple(fault.text for fault in faults if fault.bars)
        if reasons:
            return Naming(verdict="unusable", reasons=reasons, shares={})
        names, row = recording_features(recording, choice_in(self.card.feature_choice))
        if names != self.names:
            raise ModelError(
                f"the model's {len(self.names)} features are not the recording's {len(names)}; "
                "use recordings like those it was trained on, or retrain it"
            )
        flawed = tuple(fault.text for fault in faults)
        return replace(self.judge(row, blow_scores(recording)), cautions=flawed)

    def judge(self, row: Float, blows: Float) -> Naming:
        """Recognise the condition from features and impact scores.

        Parameters
        ----------
        row : numpy.ndarray [shape=(n_features,)]
        blows : numpy.ndarray [shape=(n_channels,)]
            From :func:`wearstate.diagnose.feature_rows.blows.blow_scores`.

        Returns
        -------
        Naming
        """
        shares = self.predict(row[None, :])[0]
        votes = {name: float(value) for name, value in zip(self.classes, shares, strict=True)}
        distance = float(self.distance(row[None, :])[0])
        p_value, p_limit = self.votes.p_value(distance), self.votes.p_limit
        judged: dict[str, Any] = {"shares": votes, "p_value": p_value, "p_limit": p_limit}
        if p_value <= p_limit:
            reason = (
                f"unlike the recordings of every class (p = {p_value:.2g}, unfamiliar at "
                f"{p_limit:.2g} or less): {distance:.3g} from the nearest, of the trained ones the "
                f"farthest {self.votes.distance.max():.3g}"
            )
            return Naming(verdict="unfamiliar", reasons=(reason,), **judged)
        kept = set_of(shares, self.votes.limits)
        if set(kept) <= set(self.votes.lacking(blows)):
            return Naming(verdict="unfamiliar", reasons=(self._no_blows(kept, blows),), **judged)
        return Naming(
            verdict="named",
            name=self.classes[int(shares.argmax())],
            possible=tuple(self.classes[c] for c in kept),
            **judged,
        )

    def _no_blows(self, kept: Sequence[int], blows: Float) -> str:
        """Why a recording belongs to none of these classes."""
        floors = self.votes.blow_floors[list(kept)]
        return (
            f"without the blows of every recording of {', '.join(self.classes[c] for c in kept)}: "
            f"score {blows.max():.2g}, noise has up to {NOISE_SCORE:g}, they have "
            f"{floors[floors > NOISE_SCORE].min():.2g} or more"
        )


def _shares(values: Float) -> Float:
    """Votes from 1 (no) to 2 (yes) as shares with sum 1; equal without any votes."""
    votes = np.clip(values - 1, 0, 1)
    total = votes.sum(axis=1, keepdims=True)
    even = np.full_like(votes, 1 / votes.shape[1])
    return np.asarray(np.where(total > 0, votes / np.where(total > 0, total, 1), even))


# --- training


def train_classes(
    path: str | Path,
    *,
    target: str,
    choice: FeatureSelection = USUAL,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[ClassModel, dict[str, Any]]:
    """Fit a model of named conditions, and evaluate it with whole recordings left out.

    Parameters
    ----------
    path : str or Path
        Data set with a text label. Splits are made by its groups (by default files), so that
        windows of one recording are never on both sides.
    target : str
        Manifest column with the label.
    choice : Choice
        Features to train on.
    seed : int
        Seed of folds, trees and resamples.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    model : ClassModel
        Fitted on all recordings.
    result : dict
        As from :func:`score_votes`, with every recording judged by a fit without it.

    Raises
    ------
    DataError
        No such label, a label that differs within a recording, fewer than two classes of enough
        recordings.
    """
    with DataSet(path) as data:
        head, manifest = data.attributes, data.manifest
    _labels_of(manifest, target, path)  # refused before the features are computed
    table = feature_table(path, choice=choice, jobs=jobs, progress=progress)
    labels = _labels_of(table.manifest, target, path)
    blows = blow_table(path, len(labels), jobs=jobs)
    model = fit_classes(table, labels, blows, head, target=target, seed=seed)
    card = model.card.model_copy(update={"feature_choice": choice_card(choice)})
    model = replace(model, card=card)
    return model, score_votes(model.votes, model.classes, seed=seed)


def _labels_of(manifest: Any, target: str, path: str | Path) -> NDArray[np.str_]:
    """Label of each record as text, refused where it cannot be learnt."""
    if target not in manifest:
        raise DataError(
            f"{path}: target = {target!r} must be one of its columns {', '.join(manifest)}; label "
            f"the recordings when importing them: --label {target}=… or --labels TABLE"
        )
    column = manifest[target].to_numpy()
    if column.dtype.kind == "f":
        raise DataError(
            f"{path}: {target} is a column of decimal numbers, must be one of names; train for a "
            "severity, or label the recordings by names"
        )
    labels = np.asarray(column, dtype=str)
    groups = manifest["group"].to_numpy()
    found = {c: len(np.unique(groups[labels == c])) for c in np.unique(labels).tolist()}
    faults = _class_faults(found, target) + [
        f"group {group} has {target} = {', '.join(several)}, must have one; group by file"
        for group in np.unique(groups).tolist()
        if len(several := np.unique(labels[groups == group]).tolist()) > 1
    ]
    if faults:
        raise DataError("\n".join(f"{path}: {fault}" for fault in faults))
    return labels


def _class_faults(found: Mapping[str, int], target: str) -> list[str]:
    counts = ", ".join(f"{count} of {name}" for name, count in list(found.items())[:_MOST_CLASSES])
    enough = sum(count >= FEWEST for count in found.values())
    if len(found) > _MOST_CLASSES:
        return [f"{target} has {len(found)} values, must have <= {_MOST_CLASSES}; name classes"]
    if enough < 2:
        return [
            f"{target}: {enough} classes of >= {FEWEST} recordings ({counts}), must be >= 2; "
            "record more"
        ]
    return []


def fit_classes(
    table: FeatureTable,
    labels: NDArray[np.str_],
    blows: Float,
    head: Attributes,
    *,
    target: str,
    seed: int = 0,
) -> ClassModel:
    """Fit a model of named conditions on a feature table.

    Parameters
    ----------
    table : FeatureTable
    labels : numpy.ndarray [shape=(n_records,)]
        Label of each record.
    blows : numpy.ndarray [shape=(n_records, n_channels)]
        From :func:`wearstate.diagnose.feature_rows.blows.blow_table`.
    head : Attributes
        Attributes of the data set.
    target, seed
        As in :func:`train_classes`.

    Returns
    -------
    ClassModel
    """
    classes, truth = np.unique(labels, return_inverse=True)
    groups = table.manifest["group"].to_numpy()
    folds = group_folds(groups, n=min(_MOST_FOLDS, len(np.unique(groups))), seed=seed)
    for train, test in folds:
        check_no_leak(groups, train, test)
    usable = [item for item in CANDIDATES if item.name.startswith(_USED)]
    fitted = [
        fit_blend(table.values, 1.0 + (truth == c), folds, seed=seed, candidates=usable)
        for c in range(len(classes))
    ]
    return ClassModel(
        blends=tuple(part.blend for part in fitted),
        votes=Votes(
            shares=_shares(np.stack([part.estimate for part in fitted], axis=1)),
            label=truth.astype(np.intp),
            group=groups.astype(np.intp),
            distance=_left_out_distances(table, truth, groups, folds),
            blows=blows,
        ),
        familiarity=_clouds(table, truth, groups, np.arange(len(groups))),
        card=_card(head, table, classes.tolist(), target, seed),
    )


def _left_out_distances(table: FeatureTable, truth: Index, groups: Index, folds: Folds) -> Float:
    """Distance of each record from distributions fitted without its recording."""
    distance = np.empty(len(groups))
    for train, test in folds:
        clouds = _clouds(table, truth, groups, train)
        distance[test] = _nearest_distance(clouds, table.names, table.values[test])
    return distance


def _clouds(
    table: FeatureTable, truth: Index, groups: Index, rows: Index
) -> tuple[Familiarity, ...]:
    """Distribution of each class in some rows; of all rows for a class with too few recordings."""
    clouds = []
    for c in np.unique(truth):
        few = len(np.unique(groups[truth == c])) < FEWEST
        own = rows if few else rows[truth[rows] == c]
        clouds.append(fit_familiarity(table.names, table.values[own], groups[own]))
    return tuple(clouds)


def _nearest_distance(clouds: Sequence[Familiarity], names: Sequence[str], rows: Float) -> Float:
    return np.asarray(np.min([cloud.distance(names, rows) for cloud in clouds], axis=0))


def _card(
    head: Attributes, table: FeatureTable, classes: list[str], target: str, seed: int
) -> ClassCard:
    manifest = table.manifest
    card = {
        "created_by": f"wearstate {__version__}",
        "origin": head.origin,
        "target": target,
        "classes": classes,
        "records": len(manifest),
        "split_seed": seed,
        "training_signals": sorted({int(crc) for crc in manifest["signal_crc32"]}),
        "sample_rate_hz": head.sample_rate,
        "channels": [asdict(channel) for channel in head.channels],
        "tacho": head.tacho,
        "pulses_per_revolution": head.pulses_per_revolution,
        "features": list(table.names),
    }
    return ClassCard.model_validate_json(json.dumps(card))


# --- judging


def evaluate_classes(
    model: ClassModel,
    path: str | Path,
    *,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Evaluate a model on unseen recordings.

    Parameters
    ----------
    model : ClassModel
    path : str or Path
        Data set with the model's label.
    seed : int
        Seed of the resamples.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    dict
        As from :func:`score_votes`.

    Raises
    ------
    DataError
        The label is missing or has no value that the model knows, the features differ, or every
        recording was used in the training.
    """
    table = feature_table(
        path, choice=choice_in(model.card.feature_choice), jobs=jobs, progress=progress
    )
    target = model.card.target
    if target not in table.manifest or table.names != model.names:
        raise DataError(
            f"{path}: must have the label {target} and the model's {len(model.names)} features, "
            f"has {len(table.names)}; import recordings like those of the training"
        )
    labels = table.manifest[target].to_numpy().astype(str)
    groups = table.manifest["group"].to_numpy()
    seen = table.manifest["signal_crc32"].isin(model.card.training_signals).to_numpy()
    rows = np.flatnonzero(~np.isin(groups, groups[seen]) & np.isin(labels, model.classes))
    if rows.size == 0:
        raise DataError(
            f"{path}: 0 recordings of {', '.join(model.classes)} that the model has not seen, must "
            "be > 0; train shows its accuracy on left-out recordings"
        )
    votes = Votes(
        shares=model.predict(table.values[rows]),
        label=np.searchsorted(model.classes, labels[rows]).astype(np.intp),
        group=groups[rows],
        distance=model.distance(table.values[rows]),
        blows=blow_table(path, len(labels), jobs=jobs)[rows],
    )
    return score_votes(votes, model.classes, trained=model.votes, seed=seed)


# --- words


def names_classes(path: str | Path, target: str) -> bool:
    """Whether a column of a data set names classes: it exists, with texts or integers.

    Raises
    ------
    DataError
        The file cannot be read.
    """
    with DataSet(path) as data:
        column = data.manifest.get(target)
        return (
            column is not None
            and target not in data.attributes.severities
            and (column.to_numpy().dtype.kind != "f")
        )


def name_all(items: Sequence[Item], model: ClassModel) -> Iterator[tuple[str, Naming]]:
    """Recognise the condition in recordings, one after the other.

    Parameters
    ----------
    items : sequence of Item
    model : ClassModel

    Yields
    ------
    (str, Naming)
        Name and result of each recording; one that cannot be read is unusable.

    Raises
    ------
    ModelError
        The features of this program are not those of the model.
    """
    for item in items:
        try:
            naming = model.estimate(item.load())
        except ModelError:
            raise  # applies to every recording
        except (ValueError, OSError) as error:
            naming = Naming(verdict="unusable", reasons=(fault_of(item, error),), shares={})
        yield item.name, naming
