"""Simulated hammer or shaker test of a running shaft line: plant, run, result.

The measuring chain is that of a real test: a force cell and accelerometers with noise, the shaft's
own vibration as noise on the responses, scattering blows; then blocks, H1 or H2, coherence and
confidence.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.response.frf import Estimator, Frf, block_spectra, estimate_frf
from ...features.rotation.order import order_amplitudes
from ...sim.beam.rotor import Rotor
from ...sim.shaft_response.places import Place
from ...sim.shaft_response.receptance import accelerance
from ...sim.shaft_response.reduced import ReducedRotor, free_basis, reduce_rotor
from ...sim.shaft_response.time_response import Broadband, Harmonic, Transient, time_response
from .rig_setup import LEFT_OVER, TEST_KINDS, HammerTest, RigError, RigSetup, ShakerTest, free_time

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MODES_UP_TO = 3.0  # highest kept free-free mode, over half the sample rate

_ORDERS = 24  # removed shaft orders: six harmonics of the blade rate of four blades

# --- tested shaft


@dataclass(frozen=True, kw_only=True, eq=False)
class Plant:
    """A running shaft with a place for the test force, and accelerometers.

    Attributes
    ----------
    rotor : Rotor
    reduced : ReducedRotor
        Reduced rotor at its speed.
    force : place
        Place of the test force.
    responses : tuple of place
        Places of the accelerometers.
    channels : tuple of str
        Names of the accelerometers.
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
    """Prepare a rotor for a test.

    Parameters
    ----------
    rotor : Rotor
    speed : float
        [rad/s]
    force : place
        Place of the test force, see :mod:`wearstate.sim.shaft_response.places`.
    responses : mapping of str to place
        Channel -> place of its accelerometer.
    sample_rate : float
        Sample rate of the test [Hz]; free-free modes up to three times its half are kept.
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
    >>> from wearstate.sim.shaft.at_rest import shaft_state
    >>> from wearstate.sim.scene.load import load_scene
    >>> rotor = shaft_state(load_scene("propulsion-shaft")).rotor
    >>> plant = rotor_plant(rotor, speed=31.4, force=("stern_aft", "y"), sample_rate=1024.0,
    ...                     responses={"aft": ("stern_aft", "y", "housing")})
    >>> plant.channels, round(plant.speed_hz, 2)
    (('aft',), 5.0)
    """
    places = tuple(responses.values())
    on_shaft = {
        float(rotor.beam.stations[rotor.dof(*named_place(place)) // 4])
        for place in (force, *places)
        if named_place(place)[2:] != ("housing",)
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


def named_place(place: Place) -> Any:
    """Return a named place; reject the number of a degree of freedom."""
    if isinstance(place, int):
        raise RigError(f"place = {place} must be named, as ('stern', 'y', 'housing')")
    return place


# --- running the test


@dataclass(frozen=True, kw_only=True, eq=False)
class RigTest:
    """Result of a test, and the true response.

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
        Blocks of the measured accelerations, shaft orders removed [m/s^2].
    rejected : tuple of str
        One sentence for each rejected blow.
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
    """Simulate a test and evaluate it like a measured one.

    Parameters
    ----------
    plant : Plant
    setup : HammerTest or ShakerTest
    seed : int
        Seed of blows, bursts and all noise.
    estimator : str
        ``h1`` or ``h2``.
    confidence : float
        Confidence of the disc of a line [-].

    Returns
    -------
    RigTest

    Raises
    ------
    RigError
        Responses outlast a block, the rotor is unstable, or fewer than two blows were found.

    Notes
    -----
    One record contains the quiet interval and all blocks, with the shaft running throughout. Its
    orders are fitted in the quiet interval, over whole revolutions, and removed from the record;
    they are exactly periodic here and the tacho is perfect, which makes the result optimistic. The
    rest of the shaft's own vibration is noise on the responses, the case for which H1 is unbiased.

    Examples
    --------
    >>> from wearstate.diagnose.shaft_tests.before_after import scene_plant
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
    kind = TEST_KINDS[type(setup)]
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
    """Raise if a response in the band outlasts its block; slower ones below it leak little."""
    if not plant.reduced.stable:
        growth = float(plant.reduced.poles.real.max())
        raise RigError(
            f"growth rate = {growth:.3g} 1/s must be < 0: the shaft whirls in its films, or it "
            "is unsupported; change speed, load or moves"
        )
    free, needed = free_time(setup), needed_time(plant, setup)
    if free < needed:
        raise RigError(
            f"block = {setup.block} s leaves {free:.3g} s for the response to decay, must leave "
            f">= {needed:.3g} s to {LEFT_OVER:g}; lengthen the block"
        )


def needed_time(plant: Plant, setup: RigSetup) -> float:
    """Time in which the slowest motion in the band decays [s]."""
    poles = plant.reduced.poles
    hertz = np.abs(poles) / (2 * math.pi)
    heard = (hertz > setup.low / 1.5) & (hertz < setup.high * 1.5)
    return -math.log(LEFT_OVER) / -float(poles.real[heard].max(initial=-math.inf))


def _accelerations(plant: Plant, setup: RigSetup, force: Float, rng: np.random.Generator) -> Float:
    """Signals of the accelerometers under test force and own forces (n_channels, n) [m/s^2]."""
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
    """Remove the orders of the shaft, as estimated in the quiet interval."""
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
