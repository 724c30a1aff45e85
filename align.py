"""Alignment of shaft lines: reactions, influence numbers, bearing moves, jacking, gap and sag.

:func:`align` evaluates a scene and finds the moves that correct it; the other functions take a line
of bearings on a beam.

Examples
--------
>>> import wearstate
>>> found = wearstate.align.align(wearstate.load_scene("propulsion-shaft"))
>>> found.verdict, found.line.names[0]
('within', 'stern_aft')
"""

from .diagnose.alignment.align import Alignment, align
from .sim.alignment.alignment import (
    AlignmentLine,
    Check,
    Condition,
    LineState,
    check,
    influence,
    reactions,
    span_loads,
)
from .sim.alignment.calibration import Calibration, calibrate
from .sim.alignment.jacking import Flange, Jacking, gap_and_sag, jacking
from .sim.alignment.jacking_curve import CurveFit, fit_curve
from .sim.alignment.seats import AlignmentError, Seat
from .sim.shaft.line_alignment import alignment_conditions, alignment_line

__all__ = [
    "Alignment",
    "AlignmentError",
    "AlignmentLine",
    "Calibration",
    "Check",
    "Condition",
    "CurveFit",
    "Flange",
    "Jacking",
    "LineState",
    "Seat",
    "align",
    "alignment_conditions",
    "alignment_line",
    "calibrate",
    "check",
    "fit_curve",
    "gap_and_sag",
    "influence",
    "jacking",
    "reactions",
    "span_loads",
]
