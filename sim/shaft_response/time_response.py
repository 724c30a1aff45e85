"""Motion of a reduced rotor under steady, random and transient forces, as time histories."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from ..beam.rotor import Rotor
from .places import Complex, Index, Place, Vector, dofs
from .receptance import receptance
from .reduced import LINES_AT_ONCE, ReducedRotor

QUANTITIES = ("displacement", "velocity", "acceleration")
"""Quantities of a response, in the order of their derivatives."""

_NOTHING = 1e-16  # of the largest value at the start


# --- steady and transient forces


@dataclass(frozen=True, kw_only=True, eq=False)
class Harmonic:
    """Forces of one frequency, ``Re(amplitude exp(2 pi i frequency t))``.

    Attributes
    ----------
    frequency : float
        [Hz]; zero for a steady force.
    forces : mapping of place to complex
        Amplitudes [N], [N m]. A force that rotates with the shaft has -i times its y amplitude
        along z.
    """

    frequency: float
    forces: Mapping[Place, complex]


@dataclass(frozen=True, kw_only=True, eq=False)
class Broadband:
    """A Gaussian random force, identical at all its places and independent of others.

    Attributes
    ----------
    frequencies : array-like [shape=(m,)]
        In rising order [Hz].
    density : array-like [shape=(m,)]
        One-sided power spectral density at these, linear between them and zero outside
        [N^2/Hz].
    forces : mapping of place to float
        Share at each place.
    """

    frequencies: ArrayLike
    density: ArrayLike
    forces: Mapping[Place, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Transient:
    """A force by its samples, zero before the first: a hammer's blow, a shaker's sweep.

    Attributes
    ----------
    samples : array-like [shape=(n_samples,)]
        Force [N], at the sample rate of the response; band-limited between samples.
    forces : mapping of place to float
        Share at each place.
    """

    samples: ArrayLike
    forces: Mapping[Place, float]


def harmonic_response(
    rotor: Rotor | ReducedRotor,
    harmonics: Sequence[Harmonic],
    responses: Sequence[Place],
    *,
    speed: float | None = None,
) -> Complex:
    """Complex displacement of each place at each frequency [m].

    Parameters
    ----------
    rotor : Rotor or ReducedRotor
    harmonics : sequence of Harmonic
    responses : sequence of place
    speed : float, optional
        Shaft speed [rad/s]; by default 0, or that of the reduced rotor.

    Returns
    -------
    numpy.ndarray [shape=(n_harmonics, n_resp)]

    Raises
    ------
    ValueError
        As in :func:`receptance`; or the speed differs from that of a reduced rotor.
    """
    if not harmonics:
        return np.zeros((0, len(responses)), dtype=np.complex128)
    places, amplitude = _amplitudes([harmonic.forces for harmonic in harmonics])
    hertz = [harmonic.frequency for harmonic in harmonics]
    if isinstance(rotor, ReducedRotor):
        if speed is not None and speed != rotor.speed:
            raise ValueError(
                f"speed = {speed} rad/s must be the reduced rotor's, {rotor.speed}; reduce it again"
            )
        gain = rotor.receptance(hertz, responses, places)
    else:
        gain = receptance(rotor, hertz, responses, places, speed=speed or 0.0)
    return np.asarray(np.einsum("hrf,hf->hr", gain, amplitude), dtype=np.complex128)


def _amplitudes(forces: Sequence[Mapping[Place, complex]]) -> tuple[list[Place], Complex]:
    """All places, and amplitudes [shape=(n, n_places)]."""
    places = list(dict.fromkeys(place for one in forces for place in one))
    table = [[one.get(place, 0.0) for place in places] for one in forces]
    amplitude = np.array(table, dtype=np.complex128).reshape(len(forces), len(places))
    for k, j in np.argwhere(~np.isfinite(amplitude)):
        raise ValueError(f"force {k} at {places[j]!r} = {amplitude[k, j]} must be finite")
    return places, amplitude


def time_response(
    reduced: ReducedRotor,
    responses: Sequence[Place],
    *,
    n_samples: int,
    sample_rate: float,
    quantity: str | Sequence[str] = "acceleration",
    harmonics: Sequence[Harmonic] = (),
    broadband: Sequence[Broadband] = (),
    transients: Sequence[Transient] = (),
    seed: int = 0,
) -> Vector:
    """Motion about the equilibrium under the sum of three kinds of forces.

    Parameters
    ----------
    reduced : ReducedRotor
        Result of :func:`reduce_rotor`.
    responses : sequence of place
    n_samples : int
        At least 2.
    sample_rate : float
        [Hz]
    quantity : str or sequence of str [shape=(n_resp,)]
        *displacement*, *velocity* or *acceleration*, one for all or one for each response.
    harmonics : sequence of Harmonic
        In steady state: acting since long before the first sample.
    broadband : sequence of Broadband
        Also in steady state.
    transients : sequence of Transient
        From rest at the first sample on.
    seed : int
        Seed of the random forces.

    Returns
    -------
    numpy.ndarray [shape=(n_resp, n_samples)]
        [m], [m/s] or [m/s^2] (rad for slopes).

    Raises
    ------
    ValueError
        The rotor is unstable, a force lies above half the sample rate, or an argument is out of
        range.

    Notes
    -----
    There is no time stepping: each line of the forces' spectra is multiplied by the reduced rotor's
    transfer function, so that a response is exact for band-limited forces. Random forces
    are drawn a quarter longer than the record, which is cut from them and so is not periodic. A
    transient is first treated as periodic; then the free motion of each mode from its modal
    coordinate at the first sample is subtracted, so that the remaining motion starts from rest. A
    transient that starts or ends with a jump rings there at half the sample rate, like its
    band-limited version.

    Examples
    --------
    >>> from wearstate.sim.beam.beam import Section, assemble_beam
    >>> from wearstate.sim.beam.rotor import Support
    >>> from wearstate.sim.shaft_response.reduced import free_basis, reduce_rotor
    >>> shaft = Section(length=10.0, outer_diameter=0.2, young=2.1e11, shear_modulus=8e10,
    ...                 density=7850.0)
    >>> beam = assemble_beam([shaft], theory="euler-bernoulli", longest_element=0.5)
    >>> ends = [Support(name=n, station=s, stiffness=1e7 * np.eye(2), damping=1e4 * np.eye(2))
    ...         for n, s in (("aft", 0.0), ("fore", 10.0))]
    >>> basis = free_basis(beam, limit_hz=100.0, stations=[0.0, 10.0])
    >>> reduced = reduce_rotor(Rotor(beam=beam, supports=ends), basis, speed=20.0)
    >>> turning = Harmonic(frequency=20 / (2 * np.pi), forces={(5.0, "y"): 10, (5.0, "z"): -10j})
    >>> time_response(reduced, [("aft", "y"), ("aft", "z")], n_samples=100, sample_rate=500.0,
    ...               quantity="displacement", harmonics=[turning]).shape
    (2, 100)
    """
    _check_record(reduced, n_samples, sample_rate, harmonics, broadband, transients)
    orders = _orders(quantity, len(responses))
    rows = dofs(reduced.rotor, responses)
    total = np.zeros((len(responses), n_samples))
    if harmonics:
        total += _harmonic_part(reduced, rows, orders, n_samples, sample_rate, harmonics)
    if broadband:
        total += _broadband_part(reduced, rows, orders, n_samples, sample_rate, broadband, seed)
    if transients:
        total += _transient_part(reduced, rows, orders, n_samples, sample_rate, transients)
    return total


def _harmonic_part(
    reduced: ReducedRotor,
    rows: Index,
    orders: Index,
    n_samples: int,
    sample_rate: float,
    harmonics: Sequence[Harmonic],
) -> Vector:
    omega = 2 * math.pi * np.array([harmonic.frequency for harmonic in harmonics])
    phasors = harmonic_response(reduced, harmonics, [int(row) for row in rows])
    phasors = phasors * (1j * omega[:, None]) ** orders
    turns = _turns(omega / sample_rate, n_samples)
    return np.asarray(phasors.real.T @ turns.real - phasors.imag.T @ turns.imag, dtype=float)


def _turns(angle: Vector, n: int) -> Complex:
    """``exp(i angle k)`` for k below n [shape=(n_angles, n)], a product of few exponentials."""
    block = math.isqrt(n) + 1
    fine = np.exp(1j * np.outer(angle, np.arange(block)))
    coarse = np.exp(1j * np.outer(angle, block * np.arange(block)))
    product = coarse[:, :, None] * fine[:, None, :]
    return np.asarray(product.reshape(angle.size, -1)[:, :n], dtype=np.complex128)


def _broadband_part(
    reduced: ReducedRotor,
    rows: Index,
    orders: Index,
    n_samples: int,
    sample_rate: float,
    broadband: Sequence[Broadband],
    seed: int,
) -> Vector:
    n = fft.next_fast_len(n_samples + n_samples // 4, real=True)
    hertz = fft.rfftfreq(n, 1 / sample_rate)
    streams = np.random.SeedSequence(seed).spawn(len(broadband))
    spectra = np.array(
        [
            _random_spectrum(source, hertz, n, sample_rate, np.random.default_rng(stream))
            for source, stream in zip(broadband, streams, strict=True)
        ]
    )
    participation = _shared(reduced, [source.forces for source in broadband])
    found, _ = _through(reduced, hertz, n, spectra, participation, rows, orders)
    return np.asarray(fft.irfft(found, n)[:, :n_samples], dtype=float)


def _random_spectrum(
    source: Broadband, hertz: Vector, n: int, sample_rate: float, rng: np.random.Generator
) -> Complex:
    """Spectrum of a real Gaussian force [N] in rfft's layout, without the mean."""
    at = np.asarray(source.frequencies, dtype=float)
    given = np.asarray(source.density, dtype=float)
    density = np.interp(hertz, at, given, left=0.0, right=0.0)
    density[0] = 0.0
    normal = rng.standard_normal((2, hertz.size))
    # E|X|^2 = n fs S / 2 for a one-sided density S
    spectrum = np.sqrt(n * sample_rate * density / 4) * (normal[0] + 1j * normal[1])
    if n % 2 == 0:
        spectrum[-1] = spectrum[-1].real * math.sqrt(2)
    return np.asarray(spectrum, dtype=np.complex128)


def _transient_part(
    reduced: ReducedRotor,
    rows: Index,
    orders: Index,
    n_samples: int,
    sample_rate: float,
    transients: Sequence[Transient],
) -> Vector:
    n = fft.next_fast_len(n_samples, real=True)
    samples = np.array([transient.samples for transient in transients], dtype=float)
    participation = _shared(reduced, [transient.forces for transient in transients])
    hertz = fft.rfftfreq(n, 1 / sample_rate)
    found, start = _through(reduced, hertz, n, fft.rfft(samples, n), participation, rows, orders)
    repeated = np.asarray(fft.irfft(found, n)[:, :n_samples], dtype=float)
    repeated -= _decay(reduced, start, n_samples, sample_rate, rows, orders)
    return repeated


def _decay(
    reduced: ReducedRotor,
    start: Complex,
    n_samples: int,
    sample_rate: float,
    rows: Index,
    orders: Index,
) -> Vector:
    """Free motion from modal coordinates `start` [shape=(n_resp, n_samples)]."""
    upper = reduced.poles.imag >= 0
    poles = reduced.poles[upper]
    once = np.where(poles.imag > 0, 2.0, 1.0)  # the conjugate pole is the other half
    now = once * start[upper] * poles ** orders[:, None] * reduced.shapes[np.ix_(rows, upper)]
    block = math.isqrt(n_samples) + 1
    within = np.exp(np.outer(poles, np.arange(block) / sample_rate))
    later = np.exp(poles * block / sample_rate)
    motion = np.zeros((rows.size, n_samples))
    least = _NOTHING * np.abs(now).max(axis=1, keepdims=True, initial=0.0)
    for first in range(0, n_samples, block):
        alive = (np.abs(now) > least).any(axis=0)
        piece = now[:, alive].real @ within[alive].real - now[:, alive].imag @ within[alive].imag
        motion[:, first : first + block] = piece[:, : n_samples - first]
        now = now * later
    return motion


def _shared(reduced: ReducedRotor, forces: Sequence[Mapping[Place, float]]) -> Complex:
    """Participation of each source [shape=(2 m, n_sources)]."""
    places, share = _amplitudes(forces)
    return reduced.participation[:, dofs(reduced.rotor, places)] @ share.T


def _through(
    reduced: ReducedRotor,
    hertz: Vector,
    n: int,
    spectra: Complex,
    participation: Complex,
    rows: Index,
    orders: Index,
) -> tuple[Complex, Complex]:
    """Response to forces that repeat after n samples; lines without force are skipped.

    Spectra of the responses [shape=(n_resp, n_lines)], and modal coordinates at the first sample
    [shape=(2 m,)].
    """
    s = 2j * math.pi * hertz
    found = np.zeros((rows.size, s.size), dtype=np.complex128)
    shapes = reduced.shapes[rows].T
    half = np.zeros(reduced.poles.size, dtype=np.complex128)  # from the lines above zero
    weight = np.ones(s.size)
    weight[0] = 0.5  # zero and half the sample rate count for both sides
    if n % 2 == 0:
        weight[-1] = 0.5
    busy = np.flatnonzero(spectra.any(axis=0))
    for first in range(0, busy.size, LINES_AT_ONCE):
        lines = busy[first : first + LINES_AT_ONCE]
        states = spectra[:, lines].T @ participation.T
        states /= s[lines, None] - reduced.poles
        half += weight[lines] @ states
        found[:, lines] = ((states @ shapes) * s[lines, None] ** orders).T
    return found, (half + half[_partners(reduced.poles)].conj()) / n


def _partners(poles: Complex) -> Index:
    """Index of each pole's conjugate; those of a real matrix come in pairs, the upper first."""
    return np.arange(poles.size) + np.sign(poles.imag).astype(np.int64)


# --- checks


def _orders(quantity: str | Sequence[str], n: int) -> Index:
    """Number of derivatives of each displacement."""
    names = [quantity] * n if isinstance(quantity, str) else list(quantity)
    if len(names) != n or not set(names) <= set(QUANTITIES):
        raise ValueError(
            f"quantity = {quantity!r} must be one of {', '.join(QUANTITIES)}, "
            f"or {n} of them, one for each response"
        )
    return np.array([QUANTITIES.index(name) for name in names], dtype=np.int64)


def _check_record(
    reduced: ReducedRotor,
    n_samples: int,
    sample_rate: float,
    harmonics: Sequence[Harmonic],
    broadband: Sequence[Broadband],
    transients: Sequence[Transient],
) -> None:
    faults = [
        *_record_faults(reduced, n_samples, sample_rate),
        *_harmonic_faults(harmonics, sample_rate),
        *_broadband_faults(broadband, sample_rate),
        *_transient_faults(transients, n_samples),
    ]
    if faults:
        raise ValueError("\n".join(faults))


def _record_faults(reduced: ReducedRotor, n_samples: int, sample_rate: float) -> Iterator[str]:
    if n_samples < 2:
        yield f"n_samples = {n_samples} must be >= 2"
    if not 0 < sample_rate < math.inf:
        yield f"sample_rate = {sample_rate} Hz must be > 0 and finite"
    if not reduced.stable:
        worst = reduced.poles[np.argmax(reduced.poles.real)]
        yield (
            f"growth rate = {worst.real:.3g} 1/s of the motion at "
            f"{abs(worst.imag) / 2 / math.pi:.3g} Hz must be < 0: the shaft whirls in its films, "
            "or has no support; change speed, load or film, or add a support"
        )


def _harmonic_faults(harmonics: Sequence[Harmonic], sample_rate: float) -> Iterator[str]:
    for k, harmonic in enumerate(harmonics):
        if not 0 <= harmonic.frequency < sample_rate / 2:
            yield (
                f"harmonics[{k}].frequency = {harmonic.frequency} Hz must be >= 0 and below "
                f"half the sample rate, {sample_rate / 2:g} Hz; raise the sample rate"
            )


def _broadband_faults(broadband: Sequence[Broadband], sample_rate: float) -> Iterator[str]:
    for k, source in enumerate(broadband):
        hertz = np.asarray(source.frequencies, dtype=float)
        density = np.asarray(source.density, dtype=float)
        if hertz.ndim != 1 or hertz.shape != density.shape or hertz.size < 2:
            yield (
                f"broadband[{k}]: frequencies of shape {hertz.shape} and density of shape "
                f"{density.shape} must be two rows of one length, at least 2"
            )
            continue
        if not (np.diff(hertz) > 0).all() or not 0 <= hertz[0] <= hertz[-1] <= sample_rate / 2:
            yield (
                f"broadband[{k}].frequencies = {hertz[0]:g} ... {hertz[-1]:g} Hz must rise within "
                f"0 ... {sample_rate / 2:g}, half the sample rate"
            )
        if not (np.isfinite(density).all() and (density >= 0).all()):
            yield f"broadband[{k}].density must be >= 0 and finite [N^2/Hz]"


def _transient_faults(transients: Sequence[Transient], n_samples: int) -> Iterator[str]:
    for k, transient in enumerate(transients):
        samples = np.asarray(transient.samples, dtype=float)
        if samples.shape != (n_samples,) or not np.isfinite(samples).all():
            yield (
                f"transients[{k}].samples of shape {samples.shape} must be {n_samples} finite "
                "numbers [N]; fill up with zeros"
            )
