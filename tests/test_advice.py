"""What to do about a verdict: the table is whole, and worse is never more patient."""

import dataclasses

import pytest
from wearstate.diagnose.report.advice import (
    _RULES,
    _WORDS,
    FROM_TREND,
    RULE_OF_THUMB,
    advise,
    confidence_of,
    touched_grades,
    work_words,
)
from wearstate.diagnose.report.trend import Outlook
from wearstate.diagnose.wear_model.verdict import NO_BASELINE, Estimate

PIN = "diametral clearance, crankpin"
EDGES = (1e-4, 2e-4, 3e-4)


def estimate(grade, possible=None, verdict="graded"):
    return Estimate(verdict=verdict, grade=grade, possible_grades=tuple(possible or (grade,)))


def outlook(low):
    return Outlook(
        clock="operating",
        rate=1e-8,
        remaining_low_h=low,
        remaining_h=None,
        remaining_high_h=None,
        reach_h=1e4,
        coverage=0.9,
        text="",
        assumption="",
    )


def possible_sets(grade):
    """Every run of grades that holds this one."""
    return [tuple(range(low, high + 1)) for low in range(grade + 1) for high in range(grade, 4)]


def test_every_verdict_has_its_advice():
    seen = set()
    for grade in range(4):
        for possible in possible_sets(grade):
            for verdict in ("graded", "caution"):
                found = estimate(grade, possible, verdict)
                seen.add((grade, confidence_of(found, EDGES)))
                advice = advise(found, PIN, EDGES)
                assert "{" not in advice.sentence
                assert advice.basis == RULE_OF_THUMB
    barred = {"unfamiliar": (), "unusable": ()}, {"unusable": (NO_BASELINE,)}
    for verdict, reasons in (item for part in barred for item in part.items()):
        found = Estimate(verdict=verdict, reasons=reasons)
        seen.add((None, confidence_of(found, EDGES)))
        assert "does not mean that the machine is sound" in advise(found, PIN, EDGES).sentence
    assert seen == set(_RULES)  # no row that nothing reaches
    assert {rule.days for rule in _RULES.values()} - {None} <= set(_WORDS)


def test_worse_is_never_more_patient():
    for confidence in ("sure", "caution"):
        days = [_RULES[grade, confidence].days for grade in range(4)]
        assert days == sorted(days, reverse=True)
    for grade in range(3):
        assert _RULES[grade, "maybe_worse"].days <= _RULES[grade, "sure"].days
    for grade in range(2):
        assert _RULES[grade, "maybe_condemned"].days < _RULES[grade, "maybe_worse"].days
        assert _RULES[grade, "maybe_condemned"].days <= _RULES[2, "sure"].days
    assert {_RULES[3, c].action for c in ("sure", "maybe_better", "caution")} == {"stop"}
    assert _RULES[0, "sure"].action == "none"


@pytest.mark.parametrize(
    ("found", "confidence"),
    [
        (estimate(1), "sure"),
        (estimate(1, (1, 2)), "maybe_worse"),
        (estimate(1, (0, 1)), "maybe_better"),
        (estimate(1, (1, 2, 3)), "maybe_condemned"),
        (estimate(0, (0, 1, 2, 3)), "maybe_condemned"),
        (estimate(0, (0, 1, 2)), "maybe_worse"),
        (estimate(1, (0, 1, 2)), "maybe_worse"),
        (estimate(1, (0, 1), "caution"), "caution"),
    ],
)
def test_confidence(found, confidence):
    assert confidence_of(found, EDGES) == confidence


@pytest.mark.parametrize(
    ("low", "high", "touched", "confidence"),
    [
        (2.1e-4, 2.9e-4, (2,), "sure"),
        (2.1e-4, 3.0e-4, (2, 3), "maybe_worse"),  # an edge is of the worse grade
        (1.9e-4, 2.9e-4, (1, 2), "maybe_better"),
        (1.9e-4, 3.1e-4, (1, 2, 3), "maybe_worse"),
    ],
)
def test_advice_reckons_with_an_interval_beyond_the_grades(low, high, touched, confidence):
    """Set and interval are calibrated apart; who reads '… to 0.31 mm' of 0.3 mm must not wait."""
    found = dataclasses.replace(estimate(2), severity=2.5e-4, low=low, high=high)
    assert touched_grades(found, EDGES) == touched
    assert confidence_of(found, EDGES) == confidence
    assert advise(found, PIN, EDGES).days == _RULES[2, confidence].days


def test_a_caution_makes_no_one_more_patient():
    for grade in range(3):
        doubtful = advise(estimate(grade, (grade, grade + 1), "caution"), PIN, EDGES)
        assert doubtful.days <= _RULES[grade, "maybe_worse"].days
        assert doubtful.sentence == advise(estimate(grade, None, "caution"), PIN, EDGES).sentence


def test_a_caution_alone_changes_no_horizon():
    for grade in range(4):
        told = advise(estimate(grade, None, "caution"), PIN, EDGES)
        assert told.days == _RULES[grade, "caution"].days


def test_a_trend_may_only_hasten():
    calm = advise(estimate(0), PIN, EDGES, outlook(1e4))
    assert (calm.days, calm.basis) == (90, RULE_OF_THUMB)
    assert advise(estimate(0), PIN, EDGES, outlook(None)).days == 90
    soon = advise(estimate(1), PIN, EDGES, outlook(48.0))
    assert (soon.action, soon.days, soon.horizon) == ("plan", 2.0, "within 48 h")
    assert soon.basis == FROM_TREND
    now = advise(estimate(2), PIN, EDGES, outlook(0.0))
    assert (now.days, now.horizon) == (0.0, "now")
    assert advise(estimate(3), PIN, EDGES, outlook(0.0)).action == "stop"


def test_what_no_new_part_mends_is_realigned():
    assert "realignment of bearing 3" in advise(estimate(2), "sag, bearing 3", EDGES).sentence
    assert work_words("scar depth, bearing") == "renewal of the bearing"
    assert work_words("diametral clearance, crankpin 2") == "renewal of the crankpin 2 bearing"
