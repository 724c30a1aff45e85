"""Sample rate from a time column: even within its printed digits, or refused with the jitter."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError

MOST_JITTER = 0.01
"""Largest deviation of a time from the even grid, in steps, beyond its last digit [-].

At a quarter of the sample rate it is a phase error of 0.016 rad, an amplitude error below 2e-4.
"""

_BLOCK = 2**16  # times checked at once

_PRINTED = re.compile(r"[-+]?[0-9]*(?:[.,]([0-9]*))?(?:[eEdD]([-+]?[0-9]+))?")


@dataclass(frozen=True, kw_only=True)
class Clock:
    """Result of a time column.

    Attributes
    ----------
    step : float
        Mean step > 0, in the unit of the column.
    doubt : float
        Relative uncertainty of the step due to the last printed digit.
    """

    step: float
    doubt: float


def even_rate(
    path: Path,
    name: str,
    times: Callable[[int, int], NDArray[np.float64]],
    count: int,
    resolution: float,
    *,
    place: Callable[[int], str] = "index {}".format,
) -> Clock:
    """Step of evenly spaced times, checked piece by piece.

    Parameters
    ----------
    path, name : Path, str
        File and column, for messages.
    times : callable
        Times [start, stop).
    count : int
        Number of times.
    resolution : float
        Value of the last printed digit, 0 for binary numbers; same unit as the times.
    place : callable
        Text with value and line of the time at an index, for messages.

    Raises
    ------
    DataError
        If there are fewer than two, or they are not finite or not rising (the offending ones are
        named), or they are uneven beyond rounding of the last digit (the jitter is given).

    Examples
    --------
    >>> even_rate(Path("x"), "t", lambda a, b: 0.5 * np.arange(a, b), 9, 0.0).step
    0.5
    """
    cure = "give time_column = 0 and fs if the times are wrong"
    if count < 2:
        raise DataError(f"{path}: column {name!r} has {count} time(s), must have >= 2; {cure}")
    first, last = float(times(0, 1)[0]), float(times(count - 1, count)[0])
    step = (last - first) / (count - 1)
    coarse = "" if resolution <= step / 2 else f" (they are printed to {resolution:g} only)"
    if not (np.isfinite(step) and step > 0):
        _refuse_repeats(path, name, times, count, place, coarse, cure)
        raise DataError(
            f"{path}: times of column {name!r} go from {first:g} to {last:g}, must rise; {cure}"
        )
    # rounding to more than half a step would hide a lost sample; even times may still be exact
    rounding = resolution if resolution <= step / 2 else 0.0
    limit = MOST_JITTER * step + rounding + 2 * np.spacing(max(abs(first), abs(last)))
    jitter, at = _jitter(times, count, first, step)
    if not jitter <= limit or limit >= step / 2:  # at half a step two may be one
        _refuse_repeats(path, name, times, count, place, coarse, cure)
    if not jitter <= limit:
        raise DataError(
            f"{path}: times of column {name!r} are off an even grid by up to {jitter:g}, "
            f"{100 * jitter / step:.3g} % of the mean step {step:g}, at {place(at)}, must be <= "
            f"{limit:g}{coarse}; resample the recording to an even rate, or {cure}"
        )
    return Clock(step=step, doubt=resolution / (last - first) + 4 * np.finfo(float).eps)


def _refuse_repeats(
    path: Path,
    name: str,
    times: Callable[[int, int], NDArray[np.float64]],
    count: int,
    place: Callable[[int], str],
    coarse: str,
    cure: str,
) -> None:
    """Refuse times that repeat or go back."""
    places: list[int] = []
    for start in range(0, count - 1, _BLOCK):
        stop = min(start + _BLOCK + 1, count)
        places += (start + 1 + np.flatnonzero(np.diff(times(start, stop)) <= 0)).tolist()
    if not places:
        return
    shown = [f"{place(i)} after {place(i - 1)}" for i in places[:_SHOWN]]
    more = f" and {len(places) - _SHOWN} more" if len(places) > _SHOWN else ""
    raise DataError(
        f"{path}: times of column {name!r} must rise{coarse}, do not at {len(places)} of {count}: "
        f"{', '.join(shown)}{more}; remove the lines that repeat, or {cure}"
    )


_SHOWN = 3  # times that a message names


def _jitter(
    times: Callable[[int, int], NDArray[np.float64]], count: int, first: float, step: float
) -> tuple[float, int]:
    """Largest distance from the even grid (NaN if a time is NaN), and its index."""
    worst, at = 0.0, 0
    for start in range(0, count, _BLOCK):
        stop = min(start + _BLOCK, count)
        off = np.abs(times(start, stop) - (first + step * np.arange(start, stop)))
        most = int(np.argmax(off))  # a NaN counts as the largest
        if not off[most] <= worst:
            worst, at = float(off[most]), start + most
        if not np.isfinite(worst):
            break
    return worst, at


def printed_resolution(cells: Iterable[str]) -> float:
    """Smallest resolution of some printed numbers, by their last digits.

    Examples
    --------
    >>> printed_resolution(["0.1", "0.25"]), printed_resolution(["1.52588E-05"])
    (0.01, 1e-10)
    """
    digits = [
        int(match.group(2) or 0) - len(match.group(1) or "")
        for cell in cells
        if (match := _PRINTED.fullmatch(cell.strip()))
    ]
    return float(f"1e{min(digits)}") if digits else 0.0
