"""One Runge-Kutta step of a throw, cut at each closing or opening of a contact."""

from typing import Any

from ..contact.law import LAW_CONSTANT_LOSS
from ..jit import kernel, sine_cosine
from .elastic_rod import from_bent_eye
from .equations import derivative_of_record
from .layout import (
    ANGLE,
    CHANGES,
    CONTACTS,
    CRANKPIN,
    FILM,
    FLEX,
    FLOORED,
    FORCES,
    GUIDE,
    MOMENT,
    NOT_LOCATED,
    PER_THROW,
    SPEED,
    VALVE_FORCES,
    WRISTPIN,
    pose_of,
)
from .main_bearing import is_journal, journal_margin, with_play
from .throw_motion import corner_margin, crank_offset, pin_touch, worn_eye, wrist_offset

_MOST_CUTS = 8  # contact changes located within one step and throw


@kernel
def contact_margin(k: int, j: int, w: Any, row: int, t: Any) -> Any:
    """Margin of one contact, for locating its change; the index after the throws: the journal."""
    if is_journal(k, t):
        return journal_margin(w, row, t)
    q, p, omega = t.throws[k], pose_of(w.stage[row, k]), w.crank[row, SPEED]
    touching, impact = w.held[k].touching[j] != 0, w.held[k].impact[j]
    if j > WRISTPIN:
        along, side = _corner_place(j - GUIDE)
        return corner_margin(p, q, along, side, touching, impact, t.contacts[k, GUIDE])
    sin_b, cos_b = sine_cosine(p.beta)
    if j == CRANKPIN:
        sin_a, cos_a = sine_cosine(w.crank[row, ANGLE] + q.phase)
        offset = with_play(crank_offset(p, omega, q, sin_a, cos_a, sin_b, cos_b), w, row, t)
    else:
        offset = wrist_offset(p, q, sin_b, cos_b)
    offset = from_bent_eye(offset, j, p.beta_rate, k, w, row, t, sin_b, cos_b)
    (d_x, d_y, v_x, v_y), _ = worn_eye(offset, p.beta_rate, sin_b, cos_b, t.contacts[k, j])
    touch, _, _ = pin_touch(d_x, d_y, v_x, v_y, touching, impact, t.contacts[k, j])
    return touch.margin


@kernel
def _corner_place(number: int) -> Any:
    """Coordinates along and across of a corner of the piston: rear and front, upper then lower."""
    return (1.0 if number & 1 else -1.0), (1.0 if number < 2 else -1.0)


@kernel
def _hermite(
    before: float, rate_before: float, after: float, rate_after: float, h: float, s: float
) -> float:
    """Cubic through both ends of a step, a fraction s into it."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * before + s * h * rate_before) + s * s * (
        (1.0 + 2.0 * r) * after - r * h * rate_after
    )


@kernel
def _interpolate(k: int, w: Any, i: int, h: float, s: float, t: Any) -> None:
    """Interpolate crank and one throw, a fraction s into the step from row i, into row 2."""
    y, z = w.crank, 1 - i
    for c in range(2):
        y[2, c] = _hermite(y[i, c], y[i, 2 + c], y[z, c], y[z, 2 + c], h, s)
    for n in range(w.journal.shape[1]):
        at, start, end = w.journal[2, n], w.journal[i, n], w.journal[z, n]
        for c in range(4):
            at.y[c] = _hermite(start.y[c], start.rate[c], end.y[c], end.rate[c], h, s)
    if is_journal(k, t):
        return
    if w.flex.shape[1] > 0:
        bent, first, last = w.flex[2, k], w.flex[i, k], w.flex[z, k]
        for c in range(2 * len(FLEX)):
            bent.y[c] = _hermite(first.y[c], first.rate[c], last.y[c], last.rate[c], h, s)
    here, before, after = w.stage[2, k], w.stage[i, k], w.stage[z, k]
    for c in range(PER_THROW):
        here.y[c] = _hermite(before.y[c], before.rate[c], after.y[c], after.rate[c], h, s)


@kernel
def _margin_of(k: int, j: int, w: Any, row: int, t: Any) -> float:
    """Margin of a contact from the last derivative of a row [N]."""
    margin: float = w.journal[row, 0].margin if is_journal(k, t) else w.stage[row, k].margin[j]
    return margin


@kernel
def _locate_change(k: int, j: int, w: Any, i: int, h: float, t: Any) -> Any:
    """Fraction of the step at which a contact changes: Illinois method on the dense output."""
    low, high = 0.0, 1.0
    f_low, f_high = _margin_of(k, j, w, i, t), _margin_of(k, j, w, 1 - i, t)
    share = 0.5
    while f_low <= 0.0:  # changed just now, at rounding: it must hold before it changes again
        if share < 1e-4:
            return 0.0  # it never holds: change it at once
        _interpolate(k, w, i, h, share, t)
        low, f_low = share, contact_margin(k, j, w, 2, t)
        share *= 0.5
    for _ in range(60):
        s = high - f_high * (high - low) / (f_high - f_low)
        _interpolate(k, w, i, h, s, t)
        f = contact_margin(k, j, w, 2, t)
        if f > 0.0:
            low, f_low = s, f
            f_high *= 0.5
        else:
            high, f_high = s, f
            f_low *= 0.5
        if abs(f) < 1e-9:
            return s
        if high - low < 1e-12:
            break
    return high


@kernel
def _first_change(w: Any, i: int, h: float, locate: bool, t: Any) -> Any:
    """Earliest contact change within the step: time, throw (-1: none), contact."""
    first, throw, contact = 1.0, -1, 0
    for k in range(t.throws.shape[0]):
        after = w.stage[1 - i, k]
        for j in range(CONTACTS):
            if after.margin[j] < 0.0:
                share = _locate_change(k, j, w, i, h, t) if locate else 1.0
                if throw < 0 or share < first:
                    first, throw, contact = share, k, j
    for n in range(w.journal.shape[1]):
        if w.journal[1 - i, n].margin < 0.0:
            k = t.throws.shape[0]
            share = _locate_change(k, 0, w, i, h, t) if locate else 1.0
            if throw < 0 or share < first:
                first, throw, contact = share, k, 0
    return first, throw, contact


@kernel
def _advance(w: Any, row: int, i: int, share: float, slope: int) -> None:
    """Set a row's state: that of row i moved along the rates of row `slope` over `share` [s]."""
    for c in range(2):
        w.crank[row, c] = w.crank[i, c] + share * w.crank[slope, 2 + c]
    for k in range(w.stage.shape[1]):
        here, start, rate = w.stage[row, k], w.stage[i, k], w.stage[slope, k]
        for c in range(PER_THROW):
            here.y[c] = start.y[c] + share * rate.rate[c]
        for c in range(len(FILM)):
            here.film[c] = start.film[c] + share * rate.film_rate[c]
    for k in range(w.flex.shape[1]):
        bent, held, bending = w.flex[row, k], w.flex[i, k], w.flex[slope, k]
        for c in range(2 * len(FLEX)):
            bent.y[c] = held.y[c] + share * bending.rate[c]
    for n in range(w.journal.shape[1]):
        at, begin, moving = w.journal[row, n], w.journal[i, n], w.journal[slope, n]
        for c in range(4):
            at.y[c] = begin.y[c] + share * moving.rate[c]
        for c in range(2):
            at.film[c] = begin.film[c] + share * moving.film_rate[c]


@kernel
def mean_of_stages(first: float, middle: float, last: float) -> float:
    """Six times the weighted mean of a step's four stages, `middle` being the sum of two."""
    return first + 2.0 * middle + last


@kernel
def _finish(w: Any, i: int, h: float) -> None:
    """State at the end of the step from row i, by the weighted mean of the four rates."""
    sixth, y = h / 6.0, w.crank
    for c in range(2):
        rate = mean_of_stages(y[i, 2 + c], y[2, 2 + c] + y[3, 2 + c], y[4, 2 + c])
        y[1 - i, c] = y[i, c] + sixth * rate
    for k in range(w.stage.shape[1]):
        end, a, b = w.stage[1 - i, k], w.stage[i, k], w.stage[2, k]
        c_, d = w.stage[3, k], w.stage[4, k]
        for c in range(PER_THROW):
            end.y[c] = a.y[c] + sixth * mean_of_stages(a.rate[c], b.rate[c] + c_.rate[c], d.rate[c])
        for c in range(len(FILM)):
            rate = mean_of_stages(a.film_rate[c], b.film_rate[c] + c_.film_rate[c], d.film_rate[c])
            end.film[c] = a.film[c] + sixth * rate
    for k in range(w.flex.shape[1]):
        last, first, second = w.flex[1 - i, k], w.flex[i, k], w.flex[2, k]
        third, fourth = w.flex[3, k], w.flex[4, k]
        for c in range(2 * len(FLEX)):
            middle = second.rate[c] + third.rate[c]
            rate = mean_of_stages(first.rate[c], middle, fourth.rate[c])
            last.y[c] = first.y[c] + sixth * rate
    for n in range(w.journal.shape[1]):
        last, first, second = w.journal[1 - i, n], w.journal[i, n], w.journal[2, n]
        third, fourth = w.journal[3, n], w.journal[4, n]
        for c in range(4):
            middle = second.rate[c] + third.rate[c]
            rate = mean_of_stages(first.rate[c], middle, fourth.rate[c])
            last.y[c] = first.y[c] + sixth * rate
        for c in range(2):
            middle = second.film_rate[c] + third.film_rate[c]
            rate = mean_of_stages(first.film_rate[c], middle, fourth.film_rate[c])
            last.film[c] = first.film[c] + sixth * rate


@kernel
def _stages(w: Any, i: int, h: float, passed: float, whole: float, fresh: bool, t: Any) -> None:
    """Take a Runge-Kutta step from row i to the other over `h`, without contact changes.

    `passed` of the `whole` step have passed. The derivative at the start is recomputed unless
    `fresh`; that at the end is left for the next step.
    """
    for stage in range(1 if fresh else 0, 5):
        row, share = i, 0.0
        if stage == 4:
            row, share = 1 - i, 1.0
            _finish(w, i, h)
        elif stage > 0:
            row = 1 + stage
            share = 1.0 if stage == 3 else 0.5
            _advance(w, row, i, share * h, i if stage == 1 else stage)
        derivative_of_record(w, row, (passed + share * h) / whole, t)


@kernel
def _flip(k: int, j: int, w: Any, i: int, t: Any) -> int:
    """Open or close one contact; return 1 if it closed more slowly than its law's floor."""
    if is_journal(k, t):
        return _flip_journal(w, i, t)
    held = w.held[k]
    held.touching[j] = 1 - held.touching[j]
    if held.touching[j] == 0:
        return 0
    held.impact[j] = max(w.stage[i, k].approach[j], 0.0)
    c = t.contacts[k, min(j, GUIDE)]
    return 1 if c.law != LAW_CONSTANT_LOSS and held.impact[j] < c.speed_floor else 0


@kernel
def _flip_journal(w: Any, i: int, t: Any) -> int:
    held, c = w.journal_held[0], t.bore[0]
    held.touching = 1 - held.touching
    if held.touching == 0:
        return 0
    held.impact = max(w.journal[i, 0].approach, 0.0)
    return 1 if c.law != LAW_CONSTANT_LOSS and held.impact < c.speed_floor else 0


@kernel
def _change(throw: int, contact: int, w: Any, i: int, t: Any, tally: Any) -> None:
    """Change a contact, and all others due at the same instant.

    Both corners of an untilted piston change together: one of them left for later would be late by
    the rest of the step.
    """
    for k in range(t.throws.shape[0]):
        for j in range(CONTACTS):
            if (k == throw and j == contact) or w.stage[i, k].margin[j] < 0.0:
                tally.counts[CHANGES] += 1
                tally.counts[FLOORED] += _flip(k, j, w, i, t)
    for n in range(w.journal.shape[1]):
        if is_journal(throw, t) or w.journal[i, n].margin < 0.0:
            tally.counts[CHANGES] += 1
            tally.counts[FLOORED] += _flip(t.throws.shape[0], 0, w, i, t)


@kernel
def _record_forces(w: Any, i: int, weight: float, forces: Any, step: int, tally: Any) -> None:
    """Add the impulse of one part of the step to the step's mean forces."""
    y = w.crank
    forces[step, 0] += weight * mean_of_stages(
        y[i, MOMENT], y[2, MOMENT] + y[3, MOMENT], y[4, MOMENT]
    )
    for k in range(w.stage.shape[1]):
        a, b, c, d = w.stage[i, k], w.stage[2, k], w.stage[3, k], w.stage[4, k]
        f = 1 + len(FORCES) * k
        for n in range(VALVE_FORCES):
            forces[step, f + n] += weight * mean_of_stages(
                a.force[n], b.force[n] + c.force[n], d.force[n]
            )
        tally.peak[0] = max(tally.peak[0], max(a.normal, max(b.normal, c.normal)))
    for n in range(w.journal.shape[1]):
        first, second = w.journal[i, n], w.journal[2, n]
        third, fourth = w.journal[3, n], w.journal[4, n]
        f = 1 + len(FORCES) * w.stage.shape[1]
        for way in range(2):
            middle = second.force[way] + third.force[way]
            mean = mean_of_stages(first.force[way], middle, fourth.force[way])
            forces[step, f + way] += weight * mean
        highest = max(first.normal, max(second.normal, third.normal))
        tally.peak[0] = max(tally.peak[0], highest)


@kernel
def step_of_record(
    w: Any, i: int, h: float, fresh: bool, tried: bool, t: Any, forces: Any, step: int, tally: Any
) -> Any:
    """Take one whole step, cut wherever a contact closes or opens.

    The result of a step that was `tried` without a cut is in the other row, with a contact change
    due. Returns the row of the end, and whether that row's derivative is up to date.
    """
    left, taken, cuts, k, j = h, h, 0, -1, 0
    while left > 0.0:
        if not tried:
            _stages(w, i, taken, h - left, h, fresh, t)
        fresh, tried = True, False
        if k < 0:  # not yet cut
            locate = cuts < _MOST_CUTS * t.throws.shape[0]
            share, k, j = _first_change(w, i, taken, locate, t)
            if k >= 0 and locate:
                taken *= share
                cuts += 1
                continue
            tally.counts[NOT_LOCATED] += k >= 0
        _record_forces(w, i, taken / (6.0 * h), forces, step, tally)
        i = 1 - i
        if k >= 0:
            _change(k, j, w, i, t, tally)
            fresh, k = False, -1
        left = 0.0 if taken == left else left - taken
        taken = left
    return i, fresh
