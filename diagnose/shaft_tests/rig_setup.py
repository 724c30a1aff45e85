"""Setups of hammer and shaker tests: rates, blocks, forces, windows."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...features.response.frf import Blows, find_blows, force_window
from ...sim.excitation.forces import band_noise, burst_gate, half_sine, sweep_wave

Float = NDArray[np.float64]

LEFT_OVER = 1e-3  # remainder of a response at the end of its block: bias of the FRF

TINY = 1e-300  # avoids the logarithm of zero


class RigError(ValueError):
    """A test that cannot be run as requested."""


# --- the test


@dataclass(frozen=True, kw_only=True)
class RigSetup:
    """Settings that all tests share.

    Attributes
    ----------
    block : float
        Length of a block [s]; lines are ``1 / block`` apart.
    sample_rate : float
        [Hz]
    low, high : float
        Band that is evaluated [Hz].
    quiet : float
        Time without test force before the first block [s], used to estimate the shaft's orders.
    force_noise : float
        rms of the force cell's noise [N].

    Raises
    ------
    RigError
        A value is out of its range; all faults at once.
    """

    block: float = 4.0
    sample_rate: float = 1024.0
    low: float = 5.0
    high: float = 400.0
    quiet: float = 20.0
    force_noise: float = 0.5

    def __post_init__(self) -> None:
        faults = [*self._band_faults(), *self._own_faults()]
        if faults:
            raise RigError("\n".join(faults))

    def _band_faults(self) -> list[str]:
        faults = _least("block", self.block, 0.0, "s") + _least("quiet", self.quiet, 0.0, "s")
        faults += _least("sample_rate", self.sample_rate, 0.0, "Hz")
        if not 0 < self.low < self.high <= 0.45 * self.sample_rate:
            faults.append(
                f"low = {self.low} Hz and high = {self.high} Hz must be 0 < low < high <= "
                f"{0.45 * self.sample_rate:g} Hz, 0.45 of the sample rate; raise sample_rate"
            )
        if not self.force_noise >= 0:
            faults.append(f"force_noise = {self.force_noise} N must be >= 0")
        return faults

    def _own_faults(self) -> list[str]:
        return []

    @property
    def nperseg(self) -> int:
        """Samples of a block."""
        return round(self.block * self.sample_rate)


def _least(name: str, value: float, bound: float, unit: str) -> list[str]:
    if bound < value < math.inf:
        return []
    return [f"{name} = {value} {unit} must be > {bound:g} and finite"]


@dataclass(frozen=True, kw_only=True)
class HammerTest(RigSetup):
    """Manual blows of an instrumented hammer, without double hits; by default a 5 kg sledge.

    Attributes
    ----------
    blows : int
        At least 2.
    peak_force : float
        Median of the blows' peaks [N].
    scatter : float
        Standard deviation of the logarithm of the peaks [-].
    contact_time : float
        Duration of the half-sine pulse [s], set by the tip; its spectrum has fallen by 3 dB at
        ``0.6 / contact_time`` and has its first zero at ``1.5 / contact_time``.
    """

    blows: int = 40
    peak_force: float = 20e3
    scatter: float = 0.2
    contact_time: float = 2.5e-3

    def _own_faults(self) -> list[str]:
        faults = _least("peak_force", self.peak_force, 0.0, "N")
        if self.blows < 2:
            faults.append(f"blows = {self.blows} must be >= 2; one gives no coherence")
        if not 0 <= self.scatter <= 0.5:
            faults.append(f"scatter = {self.scatter} must be in 0 … 0.5; strike more evenly")
        if not 2 / self.sample_rate <= self.contact_time < 0.1 * self.block:
            faults.append(
                f"contact_time = {self.contact_time} s must be >= {2 / self.sample_rate:g} s, two "
                f"samples, and < {0.1 * self.block:g} s, a tenth of a block; change the tip"
            )
        return faults


@dataclass(frozen=True, kw_only=True)
class ShakerTest(RigSetup):
    """Shaker bursts or sweeps that decay within their block: no leakage, no window.

    Attributes
    ----------
    kind : str
        ``burst-random``, or ``sweep`` (linear from `low` to `high`).
    bursts : int
        At least 2.
    force : float
        rms during a burst [N], as it acts on the shaft; the force drop of a shaker at a resonance
        is not modelled.
    share : float
        Fraction of a block in which the shaker acts [-].
    """

    kind: Literal["burst-random", "sweep"] = "burst-random"
    bursts: int = 60
    force: float = 2e3
    share: float = 0.6

    def _own_faults(self) -> list[str]:
        faults = _least("force", self.force, 0.0, "N")
        if self.kind not in _BURSTS:
            faults.append(f"kind = {self.kind!r} must be one of {', '.join(_BURSTS)}")
        if self.bursts < 2:
            faults.append(f"bursts = {self.bursts} must be >= 2; one gives no coherence")
        if not 0 < self.share < 1:
            faults.append(f"share = {self.share} must be > 0 and < 1; 0.6 is usual")
        return faults


def free_time(setup: RigSetup) -> float:
    """Time of a block available for the response to decay [s]."""
    return setup.block * (1 - setup.share if isinstance(setup, ShakerTest) else 0.95)


# --- kinds of test


@dataclass(frozen=True)
class _Kind:
    """Functions of a kind of test: force, detection of blocks, window."""

    name: str
    force: Callable[[Any, np.random.Generator], tuple[Float, NDArray[np.intp]]]
    blocks: Callable[[Any, Float, NDArray[np.intp]], Blows]
    window: Callable[[Any], Float | None]


def _hammer_force(setup: HammerTest, rng: np.random.Generator) -> tuple[Float, NDArray[np.intp]]:
    """Half-sine pulses, each starting in the first fifth of an interval of 1.3 blocks."""
    fs = setup.sample_rate
    stretch = 1.3 * setup.block
    begins = setup.quiet + stretch * np.arange(setup.blows)
    begins = begins + 0.2 * setup.block * rng.uniform(size=setup.blows) + 4 * _pretrigger(setup)
    peaks = setup.peak_force * rng.lognormal(0.0, setup.scatter, setup.blows)
    clock = np.arange(round((setup.quiet + stretch * setup.blows) * fs)) / fs
    force = np.zeros(clock.size)
    for begin, peak in zip(begins, peaks, strict=True):
        force += peak * half_sine(clock - begin, setup.contact_time)
    return force, np.round(begins * fs).astype(np.intp)


def _pretrigger(setup: HammerTest) -> float:
    return 4 / setup.sample_rate + setup.contact_time


def _hammer_blocks(setup: HammerTest, force: Float, _: NDArray[np.intp]) -> Blows:
    fs = setup.sample_rate
    return find_blows(force, fs, nperseg=setup.nperseg, pretrigger=round(_pretrigger(setup) * fs))


def _hammer_window(setup: HammerTest) -> Float:
    end = _pretrigger(setup) + 2 * setup.contact_time + 4 / setup.sample_rate
    return force_window(setup.nperseg, setup.sample_rate, end=end, fall=setup.contact_time)


def _shaker_force(setup: ShakerTest, rng: np.random.Generator) -> tuple[Float, NDArray[np.intp]]:
    starts = round(setup.quiet * setup.sample_rate) + setup.nperseg * np.arange(setup.bursts)
    force = np.zeros(starts[-1] + setup.nperseg)
    n = round(setup.share * setup.nperseg)
    for start in starts:
        burst = burst_gate(n) * _BURSTS[setup.kind](setup, n, rng)
        force[start : start + n] = burst * setup.force / np.sqrt(np.mean(burst**2))
    return force, starts.astype(np.intp)


def _random_burst(setup: ShakerTest, n: int, rng: np.random.Generator) -> Float:
    """Gaussian noise, flat over a little more than the band."""
    return band_noise(n, setup.sample_rate, 0.8 * setup.low, 1.05 * setup.high, rng)


def _sweep(setup: ShakerTest, n: int, rng: np.random.Generator) -> Float:
    del rng  # deterministic
    return sweep_wave(n, setup.sample_rate, setup.low, setup.high)


_BURSTS: dict[str, Callable[[ShakerTest, int, np.random.Generator], Float]] = {
    "burst-random": _random_burst,
    "sweep": _sweep,
}


def _shaker_blocks(setup: ShakerTest, _: Float, starts: NDArray[np.intp]) -> Blows:
    return Blows(starts=starts, nperseg=setup.nperseg, rejected=())


def _no_window(_: RigSetup) -> None:
    return None


TEST_KINDS: dict[type, _Kind] = {
    HammerTest: _Kind("hammer", _hammer_force, _hammer_blocks, _hammer_window),
    ShakerTest: _Kind("shaker", _shaker_force, _shaker_blocks, _no_window),
}
"""Type of a setup -> functions for its force, blocks and window."""
