"""Why a recording gets no grade, or one with caution: where it is unlike the training recordings.

A recording is a feature row of the model; the cloud is that of its training recordings.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..familiarity.bandwidth import cut_off
from ..familiarity.noise_floor import noisiest
from ..familiarity.novelty import Familiarity
from ..familiarity.quietness import CAUTIONED_SHARE
from ..feature_rows.feature_choice import feature_words, value_words
from ..feature_rows.feature_table import is_regime, kind_words, knows_no_oil, regime_words
from ..feature_rows.model_card import ModelCard
from ..learning.heads import Head, logit
from ..learning.severity import Estimator
from ..recording_faults.levels import Levels
from ..recording_faults.suspicions import Observation
from .verdict import FaultFinding

Float = NDArray[np.float64]

OFF_LEVEL = 3.5  # standard deviations of a level that few familiar machines reach
_MUCH_WORSE = 1.5  # times the error: that of twenty recordings is known to a sixth
_TOLD_OUTSIDE = 3  # features that a caution names
ROUNDING = 1e-9


def refused(strangers: Sequence[Head], row: Float) -> tuple[str, ...]:
    """That a recording sounds like one of a kind that the model was shown to refuse."""
    found = [(head, float(head.probability(row[None, :])[0])) for head in strangers]
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


def too_quiet(card: ModelCard, cloud: Familiarity, row: Float) -> tuple[str, ...]:
    """That a machine is quieter than any in training, with the cause; empty if it is not."""
    lack, most = _lacking(card, cloud, row), cloud.most_lacking
    if lack <= most:
        return ()
    oil = "flooded pins, which do not knock, are not in this model: train one on a recipe that "
    oil = f"{oil}draws them, or " if _without_oil(card) else ""
    return (
        f"it is quieter than any {card.trained_on.scene or 'machine'} trained on: "
        f"its peaks are {lack:.1f} dB below those usual at its speed, must be at most "
        f"{most:.1f} dB below; {oil}check the sensitivity of the sensors",
    )


def quiet_cautions(card: ModelCard, cloud: Familiarity, row: Float) -> list[str]:
    """That few trained pins are as quiet, where a flooded one would not be known."""
    lack, seldom = _lacking(card, cloud, row), cloud.seldom_lacking
    if lack <= seldom or not _without_oil(card):
        return []
    return [
        f"it is quieter than {1 - CAUTIONED_SHARE:.0%} of the machines trained on: its peaks "
        f"are {lack:.1f} dB below those usual at its speed, in all but a few at most "
        f"{seldom:.1f} dB; flooded pins, which do not knock, are not in this model: if this "
        "one may be flooded, train one on a recipe that draws them"
    ]


def noise_cautions(names: tuple[str, ...], cloud: Familiarity, row: Float) -> list[str]:
    """That noise, or a machine near by, hides more than it did in training."""
    floor = noisiest(names, row, cloud.floor_ceiling)
    if floor is None or floor.excess_db <= cloud.most_noise:
        return []
    return [
        f"the noise floor of {floor.channel} (its level at quiet crank angles) is "
        f"{floor.excess_db:.1f} dB above the loudest usual one in training, must be at most "
        f"{cloud.most_noise:.1f} dB above: it hides what a sound machine shows; "
        "check sensor, cable and grounding, or what runs near by"
    ]


def band_cautions(names: tuple[str, ...], cloud: Familiarity, row: Float) -> list[str]:
    """That the upper end of a channel's band is missing."""
    return [
        f"{each.channel} is {each.lacking_db:.0f} dB quieter above {each.edge_hz:.0f} Hz than "
        f"its lower bands suggest, must be at most {each.most_db:.0f} dB: a filter, the "
        "mounting of the sensor or resampling limits its band"
        for each in cut_off(names, row, cloud.tops)
    ]


def _lacking(card: ModelCard, cloud: Familiarity, row: Float) -> float:
    """How far the peaks of a recording are below those usual at its speed [dB]."""
    return float(cloud.lacking(tuple(card.features), row[None, :])[0])


def _without_oil(card: ModelCard) -> bool:
    """Whether its machines knew no flooded pins."""
    known = [rates.name for rates in card.confounders]
    known += [rates.name for rates in card.strangers]
    return knows_no_oil(card.severity, known)


def range_cautions(card: ModelCard, asked: Estimator, inputs: Float) -> list[str]:
    """Beyond the trained severities an estimate is a bound, and a poor one."""
    low, high = card.severity_range_m
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


def condition_cautions(card: ModelCard, row: Float, recorded: Mapping[str, Any]) -> list[str]:
    """Conditions outside the trained range, from the signal or as noted with it."""
    cautions = []
    for condition in card.conditions:
        name, feature = condition.name, condition.feature
        value = row[card.features.index(feature)] if feature else recorded.get(name)
        low, high = condition.low, condition.high
        if value is None or not math.isfinite(value) or low <= value <= high:
            continue
        cure = "" if feature else "check value and unit; if they are right, "
        cautions.append(
            f"{name} = {f'{value:.4g} {condition.unit}'.rstrip()} is outside the trained range "
            f"{f'{low:.4g} to {high:.4g} {condition.unit}'.rstrip()}: {cure}the estimate is an "
            "extrapolation"
        )
    return cautions


def outside_cautions(names: tuple[str, ...], cloud: Familiarity, row: Float) -> list[str]:
    """That more features are outside their trained ranges than in few familiar recordings."""
    places = cloud.farthest_outside(row)
    most = math.floor(cloud.seldom_outside * len(names) + ROUNDING)
    if len(places) <= most:
        return []
    worst = "; ".join(
        f"{feature_words(names[i])} {value_words(names[i], row[i])}, "
        f"trained {cloud.low[i]:.3g} to {cloud.high[i]:.3g}"
        for i in places[:_TOLD_OUTSIDE]
    )
    return [
        f"{len(places)} of {len(names)} features are outside all that was trained on, in all but a "
        f"few familiar recordings at most {most}: {worst}"
    ]


def level_cautions(levels: Levels, look: Observation) -> list[str]:
    """That a sensor is louder or quieter than its signal's shape lets expect."""
    return [
        f"the level of {channel} is {value:+.1f} dB off what its shape lets expect, must be "
        f"within {OFF_LEVEL * size:.1f} dB: check the sensitivity of its sensor"
        for (channel, value), size in zip(look.excess_db.items(), levels.size, strict=True)
        if abs(value) > OFF_LEVEL * size
    ]


def finding_cautions(card: ModelCard, findings: tuple[FaultFinding, ...]) -> list[str]:
    """Faults that the intervals, which are for all machines alike, do not allow for."""
    cautions = []
    for finding, rates in zip(findings, card.confounders, strict=True):
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


def disagreement_cautions(asked: Estimator, inputs: Float) -> list[str]:
    """Smooth parts and trees learnt the same; where they part, one of them knows nothing."""
    apart, usual = float(asked.severity.disagreement(inputs)[0]), asked.severity.tube
    if apart <= usual:
        return []
    return [
        f"smooth parts and trees of the model differ by a factor of {math.exp(apart):.3g}, "
        f"on familiar machines by {math.exp(usual):.3g} at most: this one is unlike them"
    ]


def strangeness(distance: float, calibration: Float) -> str:
    """How far a recording lies from the training recordings, in words."""
    n, farther = len(calibration), int(np.count_nonzero(calibration >= distance))
    rank = f"{farther} of {n}" if farther else f"none of {n}"
    return (
        f"its features lie {distance:.3g} from the centre of the training recordings; {rank} "
        f"calibration recordings lie as far (median {np.median(calibration):.3g}, largest "
        f"{calibration.max():.3g})"
    )
