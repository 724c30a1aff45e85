"""A test on the rig, simulated: hammer or shaker on a running shaft, before and after alignment.

The measured chain is that of a real test: a force cell and accelerometers with their noise, the
shaft's own vibration as noise on the responses, blows that scatter; then blocks, H1 or H2,
coherence and confidence. What alignment does to a peak is told with the confidence it deserves.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks
from scipy.special import stdtr, stdtrit

from ...features.response.frf import (
    Blows,
    Estimator,
    Frf,
    block_spectra,
    estimate_frf,
    find_blows,
    force_window,
    level_deviation,
)
from ...features.rotation.order import order_amplitudes
from ...sim.alignment.calibration import Calibration
from ...sim.beam.rotor import Rotor
from ...sim.excitation.forces import band_noise, burst_gate, half_sine, sweep_wave
from ...sim.scene.parts import Scene
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.recording import harmonic_forces, random_forces, shaft_beam, shaft_state
from ...sim.shaft.response import (
    Broadband,
    Harmonic,
    Place,
    ReducedRotor,
    Transient,
    accelerance,
    free_basis,
    reduce_rotor,
    time_response,
)
from ..pages.page import short_name

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MODES_UP_TO = 3.0  # halves of the sample rate, of the free-free modes that are kept
_LEFT_OVER = 1e-3  # of a response at the end of its block: a bias of the FRF of that size
_ORDERS = 24  # of the shaft's speed that are taken out: blade rate of four blades six times over
_SEARCH_SHARE = 0.1  # of a peak's frequency, by which alignment may shift it
_DEVIATIONS = 8.0  # by which a peak must stand out: of some hundred values the extremes are 6 apart
_SMOOTHED = 5  # lines averaged to find a peak
_CHANCE = 1e-6  # of a peak's coherence without any connection
_BLOW_SHARE, _SHAKER_SHARE, _CELL_SHARE = 0.2, 0.02, 5e-6  # of a shaft's weight: usual forces
_TINY = 1e-300  # against the logarithm of zero
_PROMINENCE_DB = 3.0  # a factor of two in power
_COLOURS = ("#1f5a94", "#b3541e")
_DARK = {"before": "#0c2742", "after": "#4d2209"}
_SHOWN_DB = 80.0  # of a picture, from the highest peak down


class RigError(ValueError):
    """A test that cannot be run as asked."""


# --- the test


@dataclass(frozen=True, kw_only=True)
class RigSetup:
    """What every test has.

    Attributes
    ----------
    block : float
        Length of a block [s]; lines are ``1 / block`` apart.
    sample_rate : float
        [Hz]
    low, high : float
        Band that is evaluated [Hz].
    quiet : float
        Running without test force before the first block [s]; the shaft's orders are read there.
    force_noise : float
        rms of the force cell's noise [N].

    Raises
    ------
    RigError
        A value leaves its range; all at once.
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
    """Blows of an instrumented hammer by hand, without double hits; by default a sledge of 5 kg.

    Attributes
    ----------
    blows : int
        At least 2.
    peak_force : float
        Median of the blows' peaks [N].
    scatter : float
        Standard deviation of the logarithm of the peaks [-].
    contact_time : float
        Of the half-sine pulse [s]: set by the tip; its spectrum has fallen by 3 dB at
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
            faults.append(f"scatter = {self.scatter} must be in 0 … 0.5; practise")
        if not 2 / self.sample_rate <= self.contact_time < 0.1 * self.block:
            faults.append(
                f"contact_time = {self.contact_time} s must be >= {2 / self.sample_rate:g} s, two "
                f"samples, and < {0.1 * self.block:g} s, a tenth of a block; change the tip"
            )
        return faults


@dataclass(frozen=True, kw_only=True)
class ShakerTest(RigSetup):
    """A shaker in bursts or sweeps that have died away within their block: no leakage, no window.

    Attributes
    ----------
    kind : str
        ``burst-random``, or ``sweep`` (linear from `low` to `high`).
    bursts : int
        At least 2.
    force : float
        rms during a burst [N]. The force is what acts on the shaft: that a shaker gives less at
        a resonance is not modelled.
    share : float
        Of a block in which the shaker acts [-].
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


# --- what is tested


@dataclass(frozen=True, kw_only=True, eq=False)
class Plant:
    """A running shaft with a place to push it and accelerometers.

    Attributes
    ----------
    rotor : Rotor
    reduced : ReducedRotor
        The same at its speed.
    force : place
        Where the test force acts.
    responses : tuple of place
        Where the accelerometers are.
    channels : tuple of str
        Their names.
    harmonics, broadband : sequence
        Forces of the running shaft itself.
    noise : float
        rms of each accelerometer's noise [m/s^2].
    """

    rotor: Rotor
    reduced: ReducedRotor
    force: Place
    responses: tuple[Place, ...]
    channels: tuple[str, ...]
    harmonics: Sequence[Harmonic] = ()
    broadband: Sequence[Broadband] = ()
    noise: float = 0.0

    @property
    def speed_hz(self) -> float:
        """Speed of the shaft [Hz]."""
        return self.reduced.speed / (2 * math.pi)


def rotor_plant(
    rotor: Rotor,
    *,
    speed: float,
    force: Place,
    responses: Mapping[str, Place],
    sample_rate: float,
    harmonics: Sequence[Harmonic] = (),
    broadband: Sequence[Broadband] = (),
    noise: float = 0.0,
) -> Plant:
    """Make a rotor ready for a test.

    Parameters
    ----------
    rotor : Rotor
    speed : float
        [rad/s]
    force : place
        Where the test force acts, see :mod:`wearstate.sim.shaft.response`.
    responses : mapping of str to place
        Channel -> where its accelerometer is.
    sample_rate : float
        Of the test [Hz]; free-free modes up to three times its half are kept.
    harmonics, broadband : sequence
        Forces of the running shaft itself.
    noise : float
        rms of each accelerometer's noise [m/s^2].

    Returns
    -------
    Plant

    Raises
    ------
    RigError
        A place is unknown.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> rotor = shaft_state(load_scene("propulsion-shaft")).rotor
    >>> plant = rotor_plant(rotor, speed=31.4, force=("stern_aft", "y"), sample_rate=1024.0,
    ...                     responses={"aft": ("stern_aft", "y", "housing")})
    >>> plant.channels, round(plant.speed_hz, 2)
    (('aft',), 5.0)
    """
    places = tuple(responses.values())
    on_shaft = {
        float(rotor.beam.stations[rotor.dof(*_named(place)) // 4])
        for place in (force, *places)
        if _named(place)[2:] != ("housing",)
    }
    basis = free_basis(
        rotor.beam,
        limit_hz=_MODES_UP_TO * sample_rate / 2,
        stations=sorted({*on_shaft, *(support.station for support in rotor.supports)}),
    )
    return Plant(
        rotor=rotor,
        reduced=reduce_rotor(rotor, basis, speed=speed),
        force=force,
        responses=places,
        channels=tuple(responses),
        harmonics=harmonics,
        broadband=broadband,
        noise=noise,
    )


def _named(place: Place) -> Any:
    if isinstance(place, int):
        raise RigError(f"place = {place} must be named, as ('stern', 'y', 'housing')")
    return place


# --- running the test


@dataclass(frozen=True, kw_only=True, eq=False)
class RigTest:
    """What a test gave, and what it should have given.

    Attributes
    ----------
    setup : HammerTest or ShakerTest
    channels : tuple of str
    frf : Frf
        Measured accelerance in the band of the setup [(m/s^2)/N].
    model : ndarray, shape (n_channels, n_lines)
        True accelerance of the rotor at the same lines [(m/s^2)/N].
    force : ndarray, shape (n_blocks, nperseg)
        Blocks of the measured force [N].
    response : ndarray, shape (n_blocks, n_channels, nperseg)
        Blocks of the measured accelerations, orders of the shaft taken out [m/s^2].
    rejected : tuple of str
        A sentence for each blow left out.
    """

    setup: RigSetup
    channels: tuple[str, ...]
    frf: Frf
    model: Complex
    force: Float
    response: Float
    rejected: tuple[str, ...]

    @property
    def held(self) -> Float:
        """Share of the lines whose confidence disc holds the model [shape=(n_channels,)]."""
        inside = np.abs(self.frf.value - self.model) <= self.frf.radius
        return np.asarray(np.mean(inside, axis=-1))


def run_test(
    plant: Plant,
    setup: HammerTest | ShakerTest,
    *,
    seed: int = 0,
    estimator: Estimator = "h1",
    confidence: float = 0.95,
) -> RigTest:
    """Simulate a test and evaluate it as a measured one.

    Parameters
    ----------
    plant : Plant
    setup : HammerTest or ShakerTest
    seed : int
        Of blows, bursts and all noise.
    estimator : str
        ``h1`` or ``h2``.
    confidence : float
        Of the disc of a line [-].

    Returns
    -------
    RigTest

    Raises
    ------
    RigError
        Responses outlast a block, the rotor is unstable, or two blows or more were not found.

    Notes
    -----
    One record holds the quiet stretch and all blocks; the shaft runs on through it. Its orders are
    fitted in the quiet stretch, over whole revolutions, and taken out of the record: they are
    exactly periodic here and the tacho is perfect, which flatters the test. What is left of the
    shaft's own vibration is noise on the responses, the case H1 is for.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> plant = scene_plant(load_scene("propulsion-shaft"), force=("thrust_block", "y"),
    ...                     sample_rate=1024.0)
    >>> test = run_test(plant, ShakerTest(bursts=10, quiet=5.0), seed=1)
    >>> test.frf.value.shape, bool(test.frf.coherence[-1].mean() > 0.9)
    ((5, 1581), True)
    """
    _check_decay(plant, setup)
    streams = np.random.SeedSequence(seed).spawn(3)
    drawn, cell, sensors = (np.random.default_rng(stream) for stream in streams)
    kind = _KINDS[type(setup)]
    force, starts = kind.force(setup, drawn)
    measured = force + setup.force_noise * cell.standard_normal(force.size)
    blows = kind.blocks(setup, measured, starts)
    response = _without_orders(plant, setup, _accelerations(plant, setup, force, sensors))
    blocks = blows.cut(measured), blows.cut(response)
    spectra = block_spectra(*blocks, setup.sample_rate, force_window=kind.window(setup))
    frf = estimate_frf(
        spectra.between(setup.low, setup.high), estimator=estimator, confidence=confidence
    )
    return RigTest(
        setup=setup,
        channels=plant.channels,
        frf=frf,
        model=model_accelerance(plant, frf.frequency),
        force=blocks[0],
        response=blocks[1],
        rejected=blows.rejected,
    )


def model_accelerance(plant: Plant, frequency: Float) -> Complex:
    """Accelerance of the full rotor, by direct solution.

    Parameters
    ----------
    plant : Plant
    frequency : ndarray, shape (n_lines,)
        [Hz]

    Returns
    -------
    ndarray, shape (n_channels, n_lines)
        [(m/s^2)/N]
    """
    found = accelerance(
        plant.rotor, frequency, plant.responses, [plant.force], speed=plant.reduced.speed
    )
    return np.ascontiguousarray(found[:, :, 0].T)


def _check_decay(plant: Plant, setup: HammerTest | ShakerTest) -> None:
    """Raise where a response in the band outlasts its block; slower ones below leak little."""
    if not plant.reduced.stable:
        growth = float(plant.reduced.poles.real.max())
        raise RigError(
            f"growth rate = {growth:.3g} 1/s must be < 0: the shaft whirls in its films, or "
            "nothing holds it; change speed, load or moves"
        )
    free, needed = _free(setup), _needed(plant, setup)
    if free < needed:
        raise RigError(
            f"block = {setup.block} s leaves {free:.3g} s for the response to die away, must leave "
            f">= {needed:.3g} s to {_LEFT_OVER:g}; lengthen the block"
        )


def _free(setup: RigSetup) -> float:
    """Time of a block that is left for the response to die away [s]."""
    return setup.block * (1 - setup.share if isinstance(setup, ShakerTest) else 0.95)


def _needed(plant: Plant, setup: RigSetup) -> float:
    """Time in which the slowest motion of the band dies away [s]."""
    poles = plant.reduced.poles
    hertz = np.abs(poles) / (2 * math.pi)
    heard = (hertz > setup.low / 1.5) & (hertz < setup.high * 1.5)
    return -math.log(_LEFT_OVER) / -float(poles.real[heard].max(initial=-math.inf))


def _accelerations(plant: Plant, setup: RigSetup, force: Float, rng: np.random.Generator) -> Float:
    """Of every accelerometer, under the test force and the shaft's own [(n_channels, n)]."""
    found = time_response(
        plant.reduced,
        plant.responses,
        n_samples=force.size,
        sample_rate=setup.sample_rate,
        harmonics=[h for h in plant.harmonics if h.frequency < 0.45 * setup.sample_rate],
        broadband=plant.broadband,
        transients=[Transient(samples=force, forces={plant.force: 1.0})],
        seed=int(rng.integers(2**31)),
    )
    return np.asarray(found + plant.noise * rng.standard_normal(found.shape))


def _without_orders(plant: Plant, setup: RigSetup, response: Float) -> Float:
    """Take out the orders of the shaft, as found in the quiet stretch."""
    if plant.speed_hz <= 0:
        return response
    phase = plant.speed_hz * np.arange(response.shape[-1]) / setup.sample_rate
    quiet = round(setup.quiet * setup.sample_rate)
    count = min(_ORDERS, math.floor(0.45 * setup.sample_rate / plant.speed_hz))
    orders = np.arange(1, count + 1)
    amplitudes = order_amplitudes(response[:, :quiet], phase[:quiet], orders)
    clean = response.copy()
    for order, amplitude in zip(orders, amplitudes.T, strict=True):
        clean -= np.real(amplitude[:, None] * np.exp(2j * np.pi * order * phase))
    return clean


# --- kinds of test


@dataclass(frozen=True)
class _Kind:
    """How a test makes its force, finds its blocks and windows them."""

    name: str
    force: Callable[[Any, np.random.Generator], tuple[Float, NDArray[np.intp]]]
    blocks: Callable[[Any, Float, NDArray[np.intp]], Blows]
    window: Callable[[Any], Float | None]


def _hammer_force(setup: HammerTest, rng: np.random.Generator) -> tuple[Float, NDArray[np.intp]]:
    """Half-sine pulses, each somewhere in the first fifth of a stretch of 1.3 blocks."""
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
    del rng  # the same every time
    return sweep_wave(n, setup.sample_rate, setup.low, setup.high)


_BURSTS: dict[str, Callable[[ShakerTest, int, np.random.Generator], Float]] = {
    "burst-random": _random_burst,
    "sweep": _sweep,
}


def _shaker_blocks(setup: ShakerTest, _: Float, starts: NDArray[np.intp]) -> Blows:
    return Blows(starts=starts, nperseg=setup.nperseg, rejected=())


def _no_window(_: RigSetup) -> None:
    return None


_KINDS: dict[type, _Kind] = {
    HammerTest: _Kind("hammer", _hammer_force, _hammer_blocks, _hammer_window),
    ShakerTest: _Kind("shaker", _shaker_force, _shaker_blocks, _no_window),
}


TESTS = tuple(kind.name for kind in _KINDS.values())
"""Names of the kinds of test."""


# --- peaks before and after


@dataclass(frozen=True, kw_only=True)
class PeakChange:
    """What became of one peak of one channel.

    Attributes
    ----------
    channel : str
    frequency_before, frequency_after : float
        [Hz]
    level_before, level_after : float
        [dB re 1 (m/s^2)/N]
    change : float
        Measured, after less before [dB].
    interval : tuple of float
        Confidence interval of the change, of this peak alone [dB].
    p_value : float
        Of no change, adjusted for the number of peaks (Holm) [-].
    coherence_before, coherence_after : float
        At the peak [-].
    model_change : float
        What the change is in truth, the model's peak at both times [dB].
    verdict : str
        ``suppressed`` or ``amplified`` where the change is significant, else ``unchanged``.
    """

    channel: str
    frequency_before: float
    frequency_after: float
    level_before: float
    level_after: float
    change: float
    interval: tuple[float, float]
    p_value: float
    coherence_before: float
    coherence_after: float
    model_change: float
    verdict: str

    @property
    def scatter(self) -> float:
        """Half the width of the interval [dB]."""
        return (self.interval[1] - self.interval[0]) / 2

    @property
    def expected(self) -> bool:
        """Whether the true change is larger than the scatter: about every second test shows it."""
        return abs(self.model_change) > self.scatter


def find_frf_peaks(frf: Frf, *, prominence: float = _PROMINENCE_DB) -> tuple[NDArray[np.intp], ...]:
    """Peaks of the magnitude that stand out of their surroundings and of their scatter.

    Parameters
    ----------
    frf : Frf
    prominence : float
        Least height over the higher of the two valleys beside it, > 0 [dB].

    Returns
    -------
    tuple of ndarray
        Lines of the peaks of each channel, ascending.

    Notes
    -----
    Sought in the mean power of five neighbouring lines. The peak must rise over the valleys by
    eight standard deviations of that mean too, and its coherence must be significant (1e-6), else
    noise would make peaks. Two resonances closer than five lines are one peak.

    Examples
    --------
    >>> frequency = np.arange(10.0, 90.0, 0.25)
    >>> one = np.ones((1, frequency.size))
    >>> value = 1 / (1 - (frequency / 40) ** 2 + 0.04j * frequency / 40)
    >>> smooth = Frf(frequency=frequency, value=value[None], coherence=0.99 * one, radius=one,
    ...              averages=20.0, estimator="h1", confidence=0.95)
    >>> frequency[find_frf_peaks(smooth)[0]].tolist()
    [40.0]
    """
    deviation = uniform_filter1d(_finite(level_deviation(frf)), _SMOOTHED, axis=-1)
    return tuple(
        _channel_peaks(value, scatter, share, frf.averages, prominence)
        for value, scatter, share in zip(frf.value, deviation, frf.coherence, strict=True)
    )


def _finite(deviation: Float) -> Float:
    """Infinite where nothing hangs together: more than any peak stands out."""
    return np.minimum(deviation, 1e3)


def _channel_peaks(
    value: Complex, deviation: Float, coherence: Float, averages: float, prominence: float
) -> NDArray[np.intp]:
    smooth = 10 * np.log10(uniform_filter1d(np.abs(value) ** 2, _SMOOTHED) + _TINY)
    lines, found = find_peaks(smooth, prominence=prominence)
    outstanding = found["prominences"] > _DEVIATIONS * deviation[lines] / math.sqrt(_SMOOTHED)
    # without any connection P(coherence > c) = (1 - c)^(n - 1)
    connected = coherence[lines] > 1 - _CHANCE ** (1 / (averages - 1))
    tops = [_top(np.abs(value), int(line)) for line in lines[outstanding & connected]]
    return np.unique(np.asarray(tops, dtype=np.intp))


def _top(size: Float, line: int) -> int:
    """Highest line of those that were smoothed into one."""
    first = max(0, line - _SMOOTHED // 2)
    return first + int(np.argmax(size[first : line + _SMOOTHED // 2 + 1]))


def _level(value: Complex | Float) -> Float:
    """In decibels, floored by the smallest number."""
    return np.asarray(20 * np.log10(np.abs(value) + _TINY))


def peak_changes(
    before: RigTest,
    after: RigTest,
    *,
    prominence: float = _PROMINENCE_DB,
    confidence: float = 0.95,
) -> tuple[PeakChange, ...]:
    """Follow every peak of the first test into the second, and those of the second back.

    Parameters
    ----------
    before, after : RigTest
        Of the same channels and lines.
    prominence : float
        As in `find_frf_peaks` [dB].
    confidence : float
        Of the intervals; a verdict has the level ``1 - confidence`` over all peaks together [-].

    Returns
    -------
    tuple of PeakChange
        By channel, then frequency.

    Raises
    ------
    RigError
        The two tests have other lines or channels.

    Notes
    -----
    A peak is found again in the nearest one of the second test, each taken once, whose frequency
    differs by a tenth at most; there a third of the prominence is enough. Where there is none the
    peak has gone, and the level of its line is taken; likewise a peak that has come, else the
    choice of peaks would favour those that fall. Frequencies alone make the pairs: where alignment
    shifts resonances past one another, the picture tells more than the table.

    The scatter of a level in dB is normal to first order; the difference of two has Welch's
    degrees of freedom. That the top of a noisy peak was picked raises both levels alike.

    References
    ----------
    B. L. Welch, "The generalization of 'Student's' problem when several different population
    variances are involved", Biometrika 34 (1947) 28-35, doi:10.1093/biomet/34.1-2.28.
    S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6
    (1979) 65-70.
    """
    _check_same(before, after)
    tops = find_frf_peaks(before.frf, prominence=prominence)
    others = find_frf_peaks(after.frf, prominence=prominence / 3)
    new = find_frf_peaks(after.frf, prominence=prominence)
    found = [
        _compared(before, after, channel, line, there, confidence)
        for channel, rows in enumerate(zip(tops, others, new, strict=True))
        for line, there in _pairs(before.frf.frequency, *rows)
    ]
    adjusted = holm([p_value for _, p_value in found])
    return tuple(
        replace(peak, p_value=p, verdict=_verdict(peak.change, p, confidence))
        for (peak, _), p in zip(found, adjusted, strict=True)
    )


def _check_same(before: RigTest, after: RigTest) -> None:
    lines = before.frf.frequency, after.frf.frequency
    if before.channels != after.channels or not np.array_equal(*lines):
        raise RigError(
            f"tests of {len(before.channels)} channels x {lines[0].size} lines and of "
            f"{len(after.channels)} x {lines[1].size} must agree; run both with one setup"
        )


def _pairs(
    frequency: Float,
    peaks: NDArray[np.intp],
    later: NDArray[np.intp],
    new: NDArray[np.intp],
) -> list[tuple[int, int]]:
    """Line before and line after of each peak; the same one where it has gone or come."""
    partner: dict[int, int] = {}
    free = {int(line) for line in later}
    near = sorted(
        (abs(math.log(frequency[other] / frequency[line])), int(line), int(other))
        for line in peaks
        for other in later
    )
    for distance, line, other in near:
        if distance <= _SEARCH_SHARE and line not in partner and other in free:
            partner[line] = other
            free.remove(other)
    pairs = {int(line): partner.get(int(line), int(line)) for line in peaks}
    pairs.update({int(line): int(line) for line in new if int(line) in free - set(pairs)})
    return sorted(pairs.items())


def _compared(
    before: RigTest, after: RigTest, channel: int, line: int, there: int, confidence: float
) -> tuple[PeakChange, float]:
    """One peak and the p-value of it alone."""
    sides = (before, line), (after, there)
    levels = [float(_level(test.frf.value[channel, at])) for test, at in sides]
    errors = [float(level_deviation(test.frf)[channel, at]) for test, at in sides]
    sizes = [np.abs(test.model[channel]) for test, _ in sides]
    truths = [
        float(_level(size[_top(size, at)])) for size, at in zip(sizes, (line, there), strict=True)
    ]
    change = levels[1] - levels[0]
    freedom = [2 * test.frf.averages - 2 for test, _ in sides]
    interval, p_value = _welch(change, errors, freedom, confidence)
    peak = PeakChange(
        channel=before.channels[channel],
        frequency_before=float(before.frf.frequency[line]),
        frequency_after=float(after.frf.frequency[there]),
        level_before=levels[0],
        level_after=levels[1],
        change=change,
        interval=interval,
        p_value=p_value,
        coherence_before=float(before.frf.coherence[channel, line]),
        coherence_after=float(after.frf.coherence[channel, there]),
        model_change=truths[1] - truths[0],
        verdict="unchanged",
    )
    return peak, p_value


def _welch(
    change: float, errors: Sequence[float], freedom: Sequence[float], confidence: float
) -> tuple[tuple[float, float], float]:
    """Interval of a difference of two levels [dB], and p-value of none."""
    squares = [error**2 for error in errors]
    total = math.fsum(squares)
    if not 0 < total < math.inf:
        width = 0.0 if total == 0 else math.inf
        return (change - width, change + width), float(total > 0 or change == 0)
    degrees = total**2 / math.fsum(s**2 / f for s, f in zip(squares, freedom, strict=True))
    deviation = math.sqrt(total)
    width = float(stdtrit(degrees, (1 + confidence) / 2)) * deviation
    p_value = 2 * float(stdtr(degrees, -abs(change) / deviation))
    return (change - width, change + width), p_value


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values adjusted so that one threshold serves for all of them together.

    Parameters
    ----------
    p_values : sequence of float
        Each 0 to 1 [-].

    Returns
    -------
    list of float
        In the same order: the k-th smallest of n times ``n - k + 1``, never less than a smaller
        one's and at most 1 [-].

    References
    ----------
    S. Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6
    (1979) 65-70.

    Examples
    --------
    >>> holm([0.04, 0.01, 0.03])
    [0.06, 0.03, 0.06]
    """
    order = np.argsort(p_values)
    factors = np.arange(len(p_values), 0, -1)
    raised = np.maximum.accumulate(np.asarray(p_values, dtype=np.float64)[order] * factors)
    result = np.empty(len(p_values))
    result[order] = np.minimum(raised, 1.0)
    return [float(p) for p in result]


def _verdict(change: float, p_value: float, confidence: float) -> str:
    if p_value >= 1 - confidence:
        return "unchanged"
    return "suppressed" if change < 0 else "amplified"


# --- a scene before and after calibration


@dataclass(frozen=True, kw_only=True, eq=False)
class BeforeAfter:
    """The same test before and after bearings were moved.

    Attributes
    ----------
    scene : str
        Its name.
    moves : dict of str to float
        Bearing -> by how much it was moved up [m].
    force : place
        Where the test force acted.
    before, after : RigTest
    changes : tuple of PeakChange
    """

    scene: str
    moves: dict[str, float]
    force: Place
    before: RigTest
    after: RigTest
    changes: tuple[PeakChange, ...]

    def of(self, verdict: str) -> tuple[PeakChange, ...]:
        """Peaks that were ``suppressed``, ``amplified`` or left ``unchanged``."""
        return tuple(change for change in self.changes if change.verdict == verdict)

    @property
    def summary(self) -> str:
        """Whether the moves suppress transmission at some peaks, in two or three sentences."""
        return _summary(self)


def scene_plant(
    scene: ShaftScene,
    moves: Mapping[str, float] | None = None,
    *,
    force: Place,
    sample_rate: float,
    direction: Literal["up", "side"] = "up",
) -> Plant:
    """A scene's shaft in steady running, with an accelerometer on every housing.

    Parameters
    ----------
    scene : ShaftScene
    moves : mapping of str to float, optional
        Bearing -> by how much it is moved up [m].
    force : place
        Where the test force acts: ``(bearing or station, "y" or "z")``, on the shaft, or
        ``(bearing, "y" or "z", "housing")``. A station must be a node of the beam: of a disc, a
        load, a bearing or the coupling.
    sample_rate : float
        Of the test [Hz].
    direction : str
        Of the accelerometers, ``up`` or ``side``.

    Returns
    -------
    Plant
        With unbalance, blade rate, coupling and turbulence of the scene as its own vibration, and
        the noise of its noisiest accelerometer on every channel.

    Raises
    ------
    ShaftFilmError
        Beam and films find no balance.
    RigError, ValueError
        A place or a move is unknown.
    """
    state = shaft_state(scene, moves)
    coordinate = {"up": "y", "side": "z"}[direction]
    return rotor_plant(
        state.rotor,
        speed=math.tau * scene.drive.speed,
        force=force,
        responses={b.name: (b.name, coordinate, "housing") for b in scene.bearings},
        sample_rate=sample_rate,
        harmonics=harmonic_forces(scene),
        broadband=random_forces(scene.model_copy(update={"sample_rate": sample_rate})),
        noise=max((sensor.noise for sensor in scene.sensors), default=0.0),
    )


def turned_scene(scene: ShaftScene, turns: Mapping[str, float]) -> ShaftScene:
    """A scene whose bearings have been turned, as by slope boring.

    Parameters
    ----------
    scene : ShaftScene
    turns : mapping of str to float
        Bearing -> by how much the slope dy/dx of its bore grows [rad].

    Returns
    -------
    ShaftScene

    Raises
    ------
    RigError
        A turn names no bearing.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> turned_scene(load_scene("propulsion-shaft"), {"stern_aft": 1e-4}).bearings[0].slope
    0.0001
    """
    names = [bearing.name for bearing in scene.bearings]
    unknown = sorted(set(turns) - set(names))
    if unknown:
        raise RigError(
            "\n".join(
                f"turns: '{name}' is no bearing; choose one of {', '.join(names)}"
                for name in unknown
            )
        )
    bearings = tuple(
        bearing.model_copy(update={"slope": bearing.slope + turns.get(bearing.name, 0.0)})
        for bearing in scene.bearings
    )
    return scene.model_copy(update={"bearings": bearings})


def before_after(
    scene: ShaftScene,
    moves: Mapping[str, float],
    *,
    force: Place,
    turns: Mapping[str, float] | None = None,
    setup: HammerTest | ShakerTest | None = None,
    direction: Literal["up", "side"] = "up",
    seed: int = 0,
    estimator: Estimator = "h1",
    confidence: float = 0.95,
    prominence: float = _PROMINENCE_DB,
) -> BeforeAfter:
    """Test a shaft before and after its bearings are moved, and follow the peaks.

    Parameters
    ----------
    scene : ShaftScene
    moves : mapping of str to float
        Bearing -> by how much it is moved up [m], as a load calibration proposes.
    force : place
        Where the test force acts, see `scene_plant`.
    turns : mapping of str to float, optional
        Bearing -> by how much its bore is turned [rad].
    setup : HammerTest or ShakerTest, optional
        A hammer test as it stands by default.
    direction : str
        Of the accelerometers, ``up`` or ``side``.
    seed : int
        Of both tests, which are independent of each other.
    estimator : str
        ``h1`` or ``h2``.
    confidence : float
        Of discs, intervals and, over all peaks together, verdicts [-].
    prominence : float
        Of a peak [dB].

    Returns
    -------
    BeforeAfter

    Raises
    ------
    ShaftFilmError, RigError
        As `scene_plant`, `run_test`.

    Notes
    -----
    The claim put to the test: calibration of the bearing loads suppresses the transmission of
    vibration at some peaks.

    References
    ----------
    Zhang, Suo (2020), Research on the influence of shafting alignment condition on transverse
    vibration transmission characteristics, Ship Science and Technology 42(6), 65-70,
    doi:10.3404/j.issn.1672-7649.2020.06.013.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> result = before_after(load_scene("propulsion-shaft"), {"intermediate_aft": 5e-4},
    ...                       force=("stern_aft", "y"), setup=ShakerTest(bursts=10, quiet=5.0))
    >>> result.summary.split(" peaks ")[0][:3], len(result.changes) > 5
    ('Of ', True)
    """
    test = HammerTest() if setup is None else setup
    seeds = np.random.SeedSequence(seed).generate_state(2)
    before, after = (
        run_test(
            scene_plant(
                state, lifts, force=force, sample_rate=test.sample_rate, direction=direction
            ),
            test,
            seed=int(own),
            estimator=estimator,
            confidence=confidence,
        )
        for state, lifts, own in (
            (scene, None, seeds[0]),
            (turned_scene(scene, turns or {}), moves, seeds[1]),
        )
    )
    return BeforeAfter(
        scene=scene.name,
        moves=dict(moves),
        force=force,
        before=before,
        after=after,
        changes=peak_changes(before, after, prominence=prominence, confidence=confidence),
    )


def calibrated_test(
    scene: Scene,
    calibration: Calibration | None,
    kind: str,
    *,
    push: str | None = None,
    seed: int = 0,
) -> BeforeAfter | None:
    """Test a shaft before and after the moves of a calibration.

    Parameters
    ----------
    scene : Scene
        Of the machine propulsion-shaft.
    calibration : Calibration or None
        Of :func:`wearstate.sim.alignment.calibration.calibrate`.
    kind : str
        A name of `TESTS`, with the setup of `usual_setup`.
    push : str, optional
        Bearing whose journal is pushed up; the aftmost by default.
    seed : int

    Returns
    -------
    BeforeAfter or None
        None where nothing moves.

    Raises
    ------
    ShaftFilmError, RigError
        As `before_after`; the scene is no shaft line, or `push` is no bearing of it.
    """
    if not isinstance(scene, ShaftScene):
        raise RigError(
            f"machine of scene '{scene.name}' = '{scene.machine}' must be 'propulsion-shaft'; "
            "only a shaft line has an alignment to test"
        )
    names = [bearing.name for bearing in scene.bearings]
    if push is not None and push not in names:
        raise RigError(f"push = '{push}' is no bearing; choose one of {', '.join(names)}")
    if calibration is None or not calibration.moved:
        return None
    moves = dict(zip(calibration.line.names, map(float, calibration.moves), strict=True))
    turns = dict(zip(calibration.line.names, map(float, calibration.turns), strict=True))
    force = (push or names[0], "y")
    return before_after(
        scene,
        moves,
        turns=turns,
        force=force,
        setup=usual_setup(kind, scene, ((None, None), (moves, turns)), force=force),
        seed=seed,
    )


def usual_setup(
    kind: str,
    scene: ShaftScene,
    states: Sequence[tuple[Mapping[str, float] | None, Mapping[str, float] | None]],
    *,
    force: Place,
) -> HammerTest | ShakerTest:
    """A test of a size that goes with the shaft, its blocks long enough for every state.

    Parameters
    ----------
    kind : str
        A name of `TESTS`.
    scene : ShaftScene
    states : sequence of tuple
        Moves [m] and turns [rad] of each state to be tested.
    force : place

    Returns
    -------
    HammerTest or ShakerTest
        Peaks of a fifth of the shaft's weight, or a shaker's rms of a fiftieth; a force cell's
        noise of 5e-6 of it. Blocks of 4 s, or of as many whole seconds as the responses need.

    Raises
    ------
    ShaftFilmError, RigError, ValueError
        As `scene_plant`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("propulsion-shaft")
    >>> found = usual_setup("hammer", scene, [(None, None)], force=("stern_aft", "y"))
    >>> round(found.peak_force / 1e3), found.block
    (20, 4.0)
    """
    weight = shaft_beam(scene).weight
    noise = _CELL_SHARE * weight
    setup: HammerTest | ShakerTest = ShakerTest(force=_SHAKER_SHARE * weight, force_noise=noise)
    if kind == "hammer":
        setup = HammerTest(peak_force=_BLOW_SHARE * weight, force_noise=noise)
    plants = [
        scene_plant(
            turned_scene(scene, turns or {}), moves, force=force, sample_rate=setup.sample_rate
        )
        for moves, turns in states
    ]
    longest = max((_needed(plant, setup) for plant in plants if plant.reduced.stable), default=0.0)
    return replace(
        setup, block=float(max(setup.block, math.ceil(setup.block * longest / _free(setup))))
    )


def _summary(result: BeforeAfter) -> str:
    counted = len(result.changes)
    if not counted:
        return "No peak stands out of the scatter: average more, push harder or run more quietly."
    fell, rose = result.of("suppressed"), result.of("amplified")
    texts = [
        f"Of {counted} peaks {len(fell)} fell and {len(rose)} rose significantly "
        f"({len(result.before.channels)} bearings, all peaks taken together)."
    ]
    for changes, word, pick in ((fell, "fall", min), (rose, "rise", max)):
        if changes:
            most = pick(changes, key=lambda peak: peak.change)
            low, high = most.interval
            texts.append(
                f"Largest {word}: {most.change:+.1f} dB ({low:+.1f} … {high:+.1f}) at "
                f"{most.channel}, {most.frequency_before:.1f} Hz."
            )
    truths = [peak.model_change for peak in result.changes]
    texts.append(f"In the model these peaks change by {min(truths):+.1f} … {max(truths):+.1f} dB.")
    return " ".join([*texts, _power(result.changes)])


def _power(changes: Sequence[PeakChange]) -> str:
    """What such a test can show of the moves at all."""
    scatter = [peak.scatter for peak in changes]
    shown = [peak for peak in changes if peak.expected]
    told = (
        f"The change of a peak scatters by ±{min(scatter):.1f} to ±{max(scatter):.1f} dB in this "
        "test; in the model "
    )
    if not shown:
        return f"{told}no peak changes by more, so the test cannot show what these moves do."
    most = max(shown, key=lambda peak: abs(peak.model_change) / peak.scatter)
    one = len(shown) == 1
    return (
        f"{told}{len(shown)} of {len(changes)} peaks {'changes' if one else 'change'} by more and "
        f"may show it, first of all {most.channel} at "
        f"{most.frequency_before:.1f} Hz ({most.model_change:+.1f} dB)."
    )


def rig_table(result: BeforeAfter) -> dict[str, Any]:
    """Everything a test before and after found, in SI and decibels, ready for JSON.

    Parameters
    ----------
    result : BeforeAfter

    Returns
    -------
    dict
        ``kind``, ``force_place``, ``moves_m``, ``averages``, ``summary``, ``rejected`` and
        ``peaks``, one dictionary for each `PeakChange`.
    """
    return {
        "kind": _KINDS[type(result.before.setup)].name,
        "force_place": list(result.force) if isinstance(result.force, tuple) else result.force,
        "moves_m": result.moves,
        "averages": [test.frf.averages for test in (result.before, result.after)],
        "rejected": [*result.before.rejected, *result.after.rejected],
        "summary": result.summary,
        "peaks": [
            asdict(peak) | {"scatter": peak.scatter, "expected": peak.expected}
            for peak in result.changes
        ],
    }


def rig_text(result: BeforeAfter) -> str:
    """The same for a terminal.

    Parameters
    ----------
    result : BeforeAfter

    Returns
    -------
    str
        One line for each peak: where, its level before, and the change with its interval.
    """
    kind = _KINDS[type(result.before.setup)].name
    count, where = round(result.before.frf.averages), _in_words(result.force)
    lines = [
        f"simulated {kind} test, pushing {where}, {count} blocks before and after",
        f"  {result.summary}",
    ]
    if result.changes:
        lines.append(
            f"  {'bearing':22} {'Hz':>7} {'dB re 1 (m/s²)/N':>17} {'change dB':>10} "
            f"{'interval':>15} {'model':>6}  {'verdict':10} by model"
        )
    for peak in result.changes:
        low, high = peak.interval
        lines.append(
            f"  {peak.channel:22} {peak.frequency_before:7.1f} {peak.level_before:17.1f} "
            f"{peak.change:+10.1f} {f'{low:+.1f} … {high:+.1f}':>15} {peak.model_change:+6.1f}"
            f"  {peak.verdict:10} {EXPECTED[peak.expected]}"
        )
    return "\n".join(lines)


EXPECTED = {True: "may show", False: "too small"}
"""Whether the change in the model is larger than the scatter of the test."""


def _in_words(place: Place) -> str:
    where, coordinate, *part = _named(place)
    name = where if isinstance(where, str) else f"the shaft at {where:g} m"
    of = "the housing of " if part == ["housing"] else ""
    return f"{of}{name} {'up' if coordinate == 'y' else 'sideways'}"


# --- picture


def rig_figure(
    result: BeforeAfter,
    *,
    channels: Sequence[str] | None = None,
    columns: int | None = None,
    title: bool = True,
) -> Any:
    """Accelerance at the bearings before and after, with confidence, model and coherence.

    Parameters
    ----------
    result : BeforeAfter
    channels : sequence of str, optional
        Those to draw; all by default.
    columns : int, optional
        Channels beside each other; all by default.
    title : bool
        Above them; a page says the same.

    Returns
    -------
    matplotlib.figure.Figure
        One column a channel: level with its confidence band over the model's, coherence below.

    Raises
    ------
    RigError
        A channel is unknown.
    """
    from matplotlib.figure import Figure

    names = list(result.before.channels if channels is None else channels)
    unknown = sorted(set(names) - set(result.before.channels))
    if unknown:
        known = ", ".join(result.before.channels)
        raise RigError(f"channels = {', '.join(unknown)} must be of {known}")
    across = min(columns or len(names), len(names))
    down = math.ceil(len(names) / across)
    figure = Figure(figsize=(1 + 3.6 * across, 5.6 * down), layout="constrained")
    if title:
        name = short_name(result.scene, 60)
        figure.suptitle(f"{name}: accelerance before and after the moves (simulated test)")
    panels = figure.subplots(
        2 * down, across, sharex=True, sharey="row", height_ratios=[3, 1] * down, squeeze=False
    )
    highest = max(float(_level(t.model).max()) for t in (result.before, result.after))
    for place in range(down * across):
        row, column = divmod(place, across)
        pair = panels[2 * row : 2 * row + 2, column]
        if place < len(names):
            _draw_channel(pair, result, names[place])
        else:
            for axes in pair:
                axes.set_axis_off()
    for level, coherence in zip(panels[::2, 0], panels[1::2, 0], strict=True):
        level.set_ylim(highest - _SHOWN_DB, highest + _SHOWN_DB / 10)
        level.set_ylabel("accelerance [dB re 1 (m/s²)/N]")
        coherence.set_ylabel("coherence")
    panels[0, -1].legend(fontsize=8, loc="lower right")
    return figure


def _draw_channel(column: Any, result: BeforeAfter, name: str) -> None:
    row = result.before.channels.index(name)
    for test, colour, label in (
        (result.before, _COLOURS[0], "before"),
        (result.after, _COLOURS[1], "after"),
    ):
        frf = test.frf
        low, high = (_level(side[row]) for side in frf.magnitude_interval)
        level = _level(frf.value[row])
        # A disc that holds zero reaches down for ever: the picture ends 20 dB below the estimate.
        low = np.maximum(low, level - 20)
        column[0].fill_between(frf.frequency, low, high, color=colour, alpha=0.25, lw=0)
        column[0].plot(frf.frequency, level, color=colour, lw=0.9, label=f"{label}, test")
        column[0].plot(
            frf.frequency,
            _level(test.model[row]),
            color=_DARK[label],
            lw=0.7,
            ls=(0, (4, 3)),
            label=f"{label}, model",
        )
        column[1].plot(frf.frequency, frf.coherence[row], color=colour, lw=0.7)
    _mark(column[0], [peak for peak in result.changes if peak.channel == name])
    column[0].set_title(short_name(name, 30), fontsize=10)
    column[1].set(xlabel="frequency [Hz]", ylim=(0, 1.02))
    for axes in column:
        axes.grid(alpha=0.3)
        axes.margins(x=0)


def _mark(axes: Any, changes: Sequence[PeakChange]) -> None:
    """Write the change beside each peak that changed significantly."""
    for peak in changes:
        if peak.verdict == "unchanged":
            continue
        axes.annotate(
            f"{peak.change:+.1f} dB",
            (peak.frequency_before, peak.level_before),
            xytext=(0, 6),
            textcoords="offset points",
            ha="left",
            rotation=60,
            fontsize=8,
        )
