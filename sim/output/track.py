"""Run-out of a proximity probe: the reading for a perfectly still shaft as its track rotates."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


class _Lobes(Protocol):
    @property
    def order(self) -> int: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def phase(self) -> float: ...


class _Hollow(Protocol):
    @property
    def depth(self) -> float: ...
    @property
    def width(self) -> float: ...
    @property
    def angle(self) -> float: ...


def track_under(lobes: Sequence[_Lobes], dents: Sequence[_Hollow], turned: Float) -> Float:
    """Run-out in the reading of a probe.

    Parameters
    ----------
    lobes : sequence of RunOut
        Harmonics: order, amplitude [m], phase [rad].
    dents : sequence of Dent
        Depth [m], width [rad] and angle from the keyphasor mark in the direction of rotation [rad].
    turned : ndarray of shape (n,)
        Angle of the shaft minus that of the probe [rad].

    Returns
    -------
    ndarray of shape (n,)
        Run-out towards the probe [m]; a dent is away from it.
    """
    total = np.zeros(len(turned))
    for lobe in lobes:
        total += lobe.amplitude * np.cos(lobe.order * turned + lobe.phase)
    for dent in dents:
        total -= dent.depth * _raised_cosine(turned + dent.angle, dent.width)
    return total


def _raised_cosine(angle: Float, width: float) -> Float:
    """1 in the middle of a dent, 0 beyond its edges; smooth, as a probe averages over its tip."""
    away = np.abs(np.remainder(angle + math.pi, 2 * math.pi) - math.pi)
    inside = away < width / 2
    return np.where(inside, 0.5 + 0.5 * np.cos(2 * math.pi * away / width), 0.0)
