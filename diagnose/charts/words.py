"""Words of a scene's chart: rungs, numerics with their values, errors with their quantity."""

import math
from collections.abc import Mapping
from typing import Any

from ...datasets.generation.quantities import quantity_label
from ...sim.fidelity.differences import Candidate
from ...sim.fidelity.findings import Raise
from ...sim.scene.scene import Scene

AS_WRITTEN = "your scene as written"
"""Name of the point without changes."""

EFFECTS = {
    "crankpin": "crank pin",
    "wristpin": "wrist pin",
    "guide": "guide",
    "pressure": "pressure",
    "drive": "drive",
    "casing": "casing",
    "film": "film",
    "beam": "beam",
}
"""Effect -> words; numerics are named by their values."""


def effect_words(effect: str) -> str:
    """An effect in words.

    Examples
    --------
    >>> effect_words("wristpin"), effect_words("mesh")
    ('wrist pin', 'mesh')
    """
    return EFFECTS.get(effect, effect)


def rung_words(
    effect: str, rung: str, values: Mapping[str, Any], before: Mapping[str, Any] | None = None
) -> str:
    """One rung of a combination in words.

    Parameters
    ----------
    effect, rung : str
        Names.
    values : mapping of str to object
        Dotted path -> value of the combination.
    before : mapping of str to object, optional
        The same paths in the scene as written, to show which numbers of a mesh change.

    Examples
    --------
    >>> rung_words("pressure", "chamber", {"pressure.rung": "chamber"})
    'pressure: chamber'
    >>> rung_words("step", "x2", {"numerics.step": 1.953125e-05})
    'step 19.5 µs'
    >>> mesh = {"film.n_theta": 96, "film.n_z": 13}
    >>> rung_words("mesh", "x1", mesh, {"film.n_theta": 48, "film.n_z": 13})
    'mesh 96 around (was 48) and 13 along (unchanged)'
    """
    if effect == "step" and "numerics.step" in values:
        return f"step {short_time(values['numerics.step'])}"
    if effect == "tolerance" and "numerics.tolerance" in values:
        return f"tolerance {values['numerics.tolerance']:.2g}"
    if effect == "mesh" and "film.n_theta" in values:
        around, along = (_changed(path, values, before or {}) for path in _MESH)
        return f"mesh {around[0]} around{around[1]} and {along[0]} along{along[1]}"
    if effect == "elements" and "shaft.longest_element" in values:
        return f"elements of {values['shaft.longest_element']:.3g} m"
    return f"{effect_words(effect)}: {rung}"


_MESH = ("film.n_theta", "film.n_z")


def _changed(path: str, values: Mapping[str, Any], before: Mapping[str, Any]) -> tuple[Any, str]:
    """A value, and its previous value in words; empty without one."""
    value, old = values[path], before.get(path)
    return value, "" if old is None else " (unchanged)" if old == value else f" (was {old})"


def short_time(value: float) -> str:
    """A time below a second, in a suitable unit.

    Examples
    --------
    >>> short_time(1.953125e-05), short_time(0.004)
    ('19.5 µs', '4 ms')
    """
    return f"{1e6 * value:.3g} µs" if value < _MILLI else f"{1e3 * value:.3g} ms"


_MILLI = 1e-3


def combination_words(
    candidate: Candidate, written: Mapping[str, str], before: Mapping[str, Any] | None = None
) -> str:
    """Differences of a combination from the scene as written.

    Parameters
    ----------
    candidate : Candidate
    written : mapping of str to str
        Effect -> rung of the scene as written.
    before : mapping of str to object, optional
        As in :func:`rung_words`.

    Returns
    -------
    str
        :data:`AS_WRITTEN` if there are none.
    """
    parts = [
        rung_words(effect, rung, candidate.values, before)
        for effect, rung in candidate.rungs.items()
        if rung != written.get(effect)
    ]
    return ", ".join(parts) or AS_WRITTEN


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


def two_digits(value: float) -> str:
    """A share in per cent with two digits, trailing zeros included.

    Examples
    --------
    >>> two_digits(0.02004)
    '2.0 %'
    """
    return f"{100 * value:#.2g} %"


def error_words(candidate: Candidate, scene: Scene, error: str = "") -> str:
    """Largest error of a candidate with its scatter and its quantity.

    Parameters
    ----------
    candidate : Candidate
    scene : Scene
    error : str, optional
        Replacement for the error in words.

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
    error = error or with_scatter(found.error, found.standard_error, candidate.starts)
    return f"{error} off in {quantity_label(worst, scene)[0]}"


def with_scatter(error: float, standard_error: float, starts: int = 0) -> str:
    """An error in per cent with its scatter, if known.

    Parameters
    ----------
    error, standard_error : float
        [-]; the latter is given with one digit, because it is uncertain itself.
    starts : int, optional
        Two starts give no standard error worth showing.

    Returns
    -------
    str
        Without a standard error if starts do not scatter. If it is as large as the error itself,
        the error is given with a bound two standard errors above it.

    Examples
    --------
    >>> with_scatter(0.63, 0.0097, 16), with_scatter(0.004, 0.0), with_scatter(0.75, 0.01, 2)
    ('63 ± 1 %', '0.4 %', '75 % (2 starts)')
    >>> with_scatter(0.0019, 0.0046, 32)
    '0.19 % (surely below 1.2 %)'
    """
    if starts == _FEWEST:
        return f"{percent(error)}{few_starts(error, starts)}"
    if not (math.isfinite(standard_error) and standard_error > _SMALLEST):
        return percent(error)
    if standard_error >= error:
        bound = 100 * (error + 2 * standard_error)
        digit = 10.0 ** (math.floor(math.log10(bound)) - 1)
        return f"{percent(error)} (surely below {digit * math.ceil(bound / digit):.3g} %)"
    return f"{percent(error).removesuffix(' %')} ± {float(f'{100 * standard_error:.1g}'):g} %"


_FEWEST = 2  # starts needed for a scatter


def few_starts(error: float, starts: int) -> str:
    """Remark on an error that is the mean of only two starts.

    Examples
    --------
    >>> few_starts(0.75, 2), few_starts(0.75, 16), few_starts(0.0, 2)
    (' (2 starts)', '', '')
    """
    return f" ({starts} starts)" if starts == _FEWEST and 0 < error < math.inf else ""


def raise_words(each: Raise, scene: Scene) -> str:
    """Error of a rung of the scene as written, in one line.

    Returns
    -------
    str
        Such as ``"pressure as two-level rather than chamber: 64 ± 2 % off in vibration …"``.
    """
    what = f"{effect_words(each.effect)} as {each.written} rather than {each.best}"
    if not each.candidate.differences:
        return f"{what} could not be compared: {each.candidate.reason}"
    return f"{what}: {error_words(each.candidate, scene)}"


def faster_words(seconds: float, own: float) -> str:
    """A time compared with that of the scene as written, in words.

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
_HOURS = 120.0  # min from which hours are used


def is_faster(seconds: float, own: float) -> bool:
    """Whether a time is shorter than that of the scene as written by more than its scatter.

    Examples
    --------
    >>> is_faster(1.0, 2.0), is_faster(1.0, 1.1)
    (True, False)
    """
    return own > _ALIKE * seconds


_ALIKE = 1.15  # scatter of run times
