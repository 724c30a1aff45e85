"""Words of a scene's chart: rungs and numerics by their values, errors with their quantity."""

import math
from collections.abc import Mapping
from typing import Any

from ...datasets.generation.quantities import quantity_label
from ...sim.fidelity.pilot import Candidate
from ...sim.fidelity.study import Raise
from ...sim.scene.parts import Scene

HERE = "your scene as written"
"""Name of the point where only what the user wrote is."""

EFFECTS = {
    "crankpin": "crank pin",
    "wristpin": "wrist pin",
    "guide": "guide",
    "pressure": "pressure",
    "drive": "drive",
    "film": "film",
    "beam": "beam",
}
"""Effect -> words; numerics speak by their values."""


def effect_words(effect: str) -> str:
    """An effect in words.

    Examples
    --------
    >>> effect_words("wristpin"), effect_words("mesh")
    ('wrist pin', 'mesh')
    """
    return EFFECTS.get(effect, effect)


def rung_words(effect: str, rung: str, values: Mapping[str, Any]) -> str:
    """One rung of a combination in words.

    Parameters
    ----------
    effect, rung : str
        Names.
    values : mapping of str to object
        Dotted path -> value of the combination.

    Examples
    --------
    >>> rung_words("pressure", "chamber", {"pressure.rung": "chamber"})
    'pressure chamber'
    >>> rung_words("step", "x2", {"numerics.step": 1.953125e-05})
    'step 19.5 µs'
    >>> rung_words("mesh", "x1", {"film.n_theta": 72, "film.n_z": 17})
    'mesh 72 around x 17 along'
    """
    if effect == "step" and "numerics.step" in values:
        return f"step {short_time(values['numerics.step'])}"
    if effect == "tolerance" and "numerics.tolerance" in values:
        return f"tolerance {values['numerics.tolerance']:.2g}"
    if effect == "mesh" and "film.n_theta" in values:
        return f"mesh {values['film.n_theta']} around x {values['film.n_z']} along"
    if effect == "elements" and "shaft.longest_element" in values:
        return f"elements of {values['shaft.longest_element']:.3g} m"
    return f"{effect_words(effect)} {rung}"


def short_time(value: float) -> str:
    """A time below a second, in the unit that suits it.

    Examples
    --------
    >>> short_time(1.953125e-05), short_time(0.004)
    ('19.5 µs', '4 ms')
    """
    return f"{1e6 * value:.3g} µs" if value < _MILLI else f"{1e3 * value:.3g} ms"


_MILLI = 1e-3


def combination_words(candidate: Candidate, written: Mapping[str, str]) -> str:
    """What a combination has other than the scene as written.

    Parameters
    ----------
    candidate : Candidate
    written : mapping of str to str
        Effect -> rung of the scene as written.

    Returns
    -------
    str
        :data:`HERE` where that is nothing.
    """
    parts = [
        rung_words(effect, rung, candidate.values)
        for effect, rung in candidate.rungs.items()
        if rung != written.get(effect)
    ]
    return ", ".join(parts) or HERE


def percent(value: float) -> str:
    """A share in per cent, with two digits at most.

    Examples
    --------
    >>> percent(0.6437), percent(0.00312), percent(0.0), percent(1e-7), percent(12.3)
    ('64 %', '0.31 %', '0 %', 'under 0.01 %', '1230 %')
    """
    if not math.isfinite(value):
        return "no figure"
    if value == 0:
        return "0 %"
    if abs(value) < _SMALLEST:
        return "under 0.01 %"
    return f"{float(f'{100 * value:.2g}' if abs(value) < 1 else f'{100 * value:.3g}'):g} %"


_SMALLEST = 1e-4


def percent_beside(value: float, limit: float) -> str:
    """A share in per cent, with as many digits as it takes to differ from a limit.

    Examples
    --------
    >>> percent_beside(0.0203, 0.02), percent_beside(0.64, 0.02), percent_beside(0.0199997, 0.02)
    ('2.03 %', '64 %', '2 %')
    """
    asked, found = percent(limit), percent(value)
    digits = 3
    while found == asked and digits <= _MOST_DIGITS:
        found = f"{float(f'{100 * value:.{digits}g}'):g} %"
        digits += 1
    return found


_MOST_DIGITS = 4


def error_words(candidate: Candidate, scene: Scene, accuracy: float = math.nan) -> str:
    """Largest error of a candidate with its scatter and its quantity.

    Parameters
    ----------
    candidate : Candidate
    scene : Scene
    accuracy : float, optional
        That the error must be seen to lie below or above [-].

    Returns
    -------
    str
        Such as ``"64 ± 3 % off in vibration level, 306 to 758 Hz"``.
    """
    if not candidate.differences:
        return f"not valid: {candidate.reason}"
    worst = max(candidate.differences, key=lambda name: candidate.differences[name].error)
    found = candidate.differences[worst]
    if found.error == 0:
        return "no error"
    error = with_scatter(percent_beside(found.error, accuracy), found.standard_error)
    return f"{error} off in {quantity_label(worst, scene)[0]}"


def with_scatter(error: str, standard_error: float) -> str:
    """An error in per cent with its standard error, where there is one.

    Parameters
    ----------
    error : str
        As of :func:`percent`.
    standard_error : float
        [-]; told with one digit, as it is uncertain itself.

    Examples
    --------
    >>> with_scatter("63 %", 0.0097), with_scatter("0.4 %", 0.0), with_scatter("0.4 %", 0.0011)
    ('63 ± 1 %', '0.4 %', '0.4 ± 0.1 %')
    """
    if not _scattered(standard_error):
        return error
    return f"{error.removesuffix(' %')} ± {float(f'{100 * standard_error:.1g}'):g} %"


def _scattered(standard_error: float) -> bool:
    return math.isfinite(standard_error) and standard_error > _SMALLEST


def raise_words(each: Raise, scene: Scene) -> str:
    """What a rung of the scene as written costs, in one line.

    Returns
    -------
    str
        Such as ``"your pressure rung (two-level, not chamber) is 64 % off in vibration …"``.
    """
    what = f"your {effect_words(each.effect)} rung ({each.written}, not {each.best})"
    if not each.candidate.differences:
        return f"{what} could not be compared: {each.candidate.reason}"
    return f"{what} is {error_words(each.candidate, scene)}"


def faster_words(seconds: float, own: float) -> str:
    """How a time compares with that of the scene as written.

    Examples
    --------
    >>> faster_words(1.0, 3.0), faster_words(3.0, 1.0), faster_words(1.0, 1.001)
    ('3 times as fast as your scene', '3 times the time of your scene', 'as fast as your scene')
    >>> faster_words(1.02, 1.0), faster_words(1.0, 1.1)
    ('2 % slower than your scene', '9 % faster than your scene')
    """
    ratio = own / seconds
    if not math.isfinite(ratio):
        return "not timed"
    if 1 / _ALIKE < ratio < _ALIKE:
        change = round(100 * (1 / ratio - 1))
        word = "slower" if change > 0 else "faster"
        return f"{abs(change)} % {word} than your scene" if change else "as fast as your scene"
    if ratio > 1:
        return f"{ratio:.2g} times as fast as your scene"
    return f"{1 / ratio:.2g} times the time of your scene"


def time_words(seconds: float) -> str:
    """A time with two digits.

    Examples
    --------
    >>> time_words(12.34), time_words(754.0), time_words(36000.0)
    ('12 s', '13 min', '10 h')
    """
    if seconds < _MINUTE:
        return f"{float(f'{seconds:.2g}'):g} s"
    if seconds < _HOURS * _MINUTE:
        return f"{float(f'{seconds / _MINUTE:.2g}'):g} min"
    return f"{float(f'{seconds / _MINUTE / _MINUTE:.2g}'):g} h"


_MINUTE = 60.0
_HOURS = 120.0  # min from which hours are told


def is_faster(seconds: float, own: float) -> bool:
    """Whether a time is shorter than that of the scene as written by more than its scatter.

    Examples
    --------
    >>> is_faster(1.0, 2.0), is_faster(1.0, 1.1)
    (True, False)
    """
    return own > _ALIKE * seconds


_ALIKE = 1.15  # times of runs scatter by as much
