"""Force to housing acceleration: the casing as a set of modes, or as it was measured."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from ..jit import kernel
from ..output.sensor import padded_spectrum
from ..scene.parts import specific_key
from .casing_frf import Accelerance

PASS_BAND = 0.45
"""Upper edge of the flat band over the sample rate; 11.5 kHz at 25.6 kHz."""

_STOP_ATTENUATION_DB = 80.0

_REACH = 3  # steps that the taps of line_inverse look ahead and back

# The loops below lie in vectors because each runs over one row of doubles, without branches, over a
# number of steps that the compiler knows. Rows are longer than a block by what is looked ahead, and
# their addresses differ by more than the processor confuses, a multiple of 4096.
_AHEAD = 8  # steps that a mode takes at once, the widest vector of doubles
_BLOCK = 576  # steps
_ROW = 640
_KEPT = 512  # samples of a block of the decimation
_PIECE = 16 * _BLOCK  # steps that are driven at once: what is on its way stays near the processor
_AT_ONCE = 8  # taps


def exact_oscillator(
    frequency: float, damping_ratio: float, step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Exact discretisation of a damped oscillator under a force linear within each step.

    Parameters
    ----------
    frequency : float
        Undamped natural frequency [Hz].
    damping_ratio : float
        0 <= zeta < 1.
    step : float
        [s]

    Returns
    -------
    transition : numpy.ndarray [shape=(2, 2)]
        ``(q, q')`` at the next step per ``(q, q')`` now.
    input_gain : numpy.ndarray [shape=(2, 2)]
        Columns for the modal force now and at the next step, unit modal mass.

    Notes
    -----
    The integral of the impulse response against the linear force in closed form; no time step
    error whatever ``frequency * step`` (first-order hold).

    Examples
    --------
    >>> transition, _ = exact_oscillator(1.0, 0.0, 1.0)  # one whole period
    >>> bool(np.allclose(transition, np.eye(2)))
    True
    """
    w = 2 * math.pi * frequency
    wd = w * math.sqrt(1 - damping_ratio**2)
    a = damping_ratio * w
    decay = math.exp(-a * step)
    cos, sin = decay * math.cos(wd * step), decay * math.sin(wd * step)
    transition = np.array(
        [[cos + a / wd * sin, sin / wd], [-(w**2) / wd * sin, cos - a / wd * sin]]
    )
    # responses from rest to a unit step, and to a unit ramp (the integral of the former)
    step_q, step_v = (1 - transition[0, 0]) / w**2, transition[0, 1]
    ramp_q, ramp_v = (step - step_v - 2 * a * step_q) / w**2, step_q
    slope = np.array([ramp_q, ramp_v]) / step
    return transition, np.column_stack([np.array([step_q, step_v]) - slope, slope])


@kernel
def _read(row: Any, first: int, block: Any) -> None:
    """A block of forces with those about it."""
    for i in range(_BLOCK + 2 * _REACH):
        block[i] = row[np.uint64(first + i)]  # unsigned: no index counts from the end


@kernel
def _raise(block: Any, taps: Any, raised: Any) -> None:
    """Forces through the symmetric taps."""
    t0, t1, t2, t3 = taps[3], taps[4], taps[5], taps[6]
    for i in range(_BLOCK):
        raised[i + _AHEAD] = (
            t0 * block[i + 3]
            + t1 * (block[i + 2] + block[i + 4])
            + t2 * (block[i + 1] + block[i + 5])
            + t3 * (block[i] + block[i + 6])
        )


@kernel
def _add_direct(total: Any, a: float, block: Any, b: float, raised: Any) -> None:
    for i in range(_BLOCK):
        total[i] += a * block[i + _REACH] + b * raised[i + _AHEAD]


@kernel
def _add_modal_twice(
    total: Any, a: float, b: float, other: Any, c: float, d: float, real: Any, imaginary: Any
) -> None:
    for i in range(_BLOCK):
        x, y = real[i + _AHEAD], imaginary[i + _AHEAD]
        total[i] += a * x + b * y
        other[i] += c * x + d * y


@kernel
def _add_modal(total: Any, a: float, real: Any, b: float, imaginary: Any) -> None:
    for i in range(_BLOCK):
        total[i] += a * real[i + _AHEAD] + b * imaginary[i + _AHEAD]


@kernel
def _sum_four(total: Any, a: Any, first: int, x: Any, y: Any, z: Any, u: Any) -> None:
    a0, a1, a2, a3 = a[first], a[first + 1], a[first + 2], a[first + 3]
    for i in range(_BLOCK + 4 * _AHEAD):
        total[i] = (a0 * x[i] + a1 * y[i]) + (a2 * z[i] + a3 * u[i])


@kernel
def _add_pair(total: Any, a: float, x: Any, b: float, y: Any) -> None:
    for i in range(_BLOCK + 4 * _AHEAD):
        total[i] += a * x[i] + b * y[i]


@kernel
def _gather_four(force: Any, turn: Any, real: Any, imaginary: Any) -> None:
    """Sum of four steps' forces, each turned on by a mode until the last of them."""
    a1, a2, a3 = turn[0].real, turn[1].real, turn[2].real
    b1, b2, b3 = turn[0].imag, turn[1].imag, turn[2].imag
    for i in range(_BLOCK + 4 * _AHEAD):
        real[i] = force[i + 3] + a1 * force[i + 2] + a2 * force[i + 1] + a3 * force[i]
        imaginary[i] = b1 * force[i + 2] + b2 * force[i + 1] + b3 * force[i]


@kernel
def _turn_eight(real: Any, imaginary: Any, turn: Any, x: Any, y: Any) -> None:
    """Every state eight steps on, from sums of four."""
    a4, b4, a8, b8 = turn[3].real, turn[3].imag, turn[4].real, turn[4].imag
    for i in range(_BLOCK):
        pushed_x = real[i + 4] + a4 * real[i] - b4 * imaginary[i]
        pushed_y = imaginary[i + 4] + b4 * real[i] + a4 * imaginary[i]
        x_now, y_now = x[i], y[i]
        x[i + _AHEAD] = a8 * x_now - b8 * y_now + pushed_x
        y[i + _AHEAD] = b8 * x_now + a8 * y_now + pushed_y


@kernel
def _write(total: Any, first: int, n: int, row: Any) -> None:
    for i in range(n):
        row[np.uint64(first + i)] = total[i]


@kernel
def _respond(
    forces: Any,
    fresh: bool,
    acceleration: Any,
    taps: Any,
    inputs: Any,
    direct: Any,
    raised_direct: Any,
    turns: Any,
    swings: Any,
    raised: Any,
    states: Any,
    block: Any,
    force: Any,
    real: Any,
    imaginary: Any,
    x: Any,
    y: Any,
    total: Any,
) -> None:
    """Bare modal masses under `forces`, and what springs and dashpots of every mode take back.

    These feel straight lines between the forces filtered by the symmetric `taps`; where `fresh`,
    they start in balance with the first of them. The forces are whole blocks, with those of
    ``_REACH`` steps before and after. Coefficients are those of :class:`_Steps`; `raised` and what
    follows are scratch, rows of ``_ROW``, of which `raised` and `states` [shape=(n_modes, 2, 8)],
    the last eight states of every mode, go on from one call to the next.
    """
    for first in range(0, acceleration.shape[1], _BLOCK):
        begins = fresh and first == 0
        total[:] = 0.0
        for j in range(len(forces)):
            for i in range(_AHEAD):
                raised[j, i] = raised[j, i + _BLOCK]
            _read(forces[j], first, block)
            _raise(block, taps, raised[j])
            if begins:
                for i in range(_AHEAD):
                    raised[j, i] = raised[j, _AHEAD]
            for k in range(len(total)):
                _add_direct(total[k], direct[k, j], block, raised_direct[k, j], raised[j])
        for m in range(len(inputs)):
            _sum_four(force, inputs[m], 0, raised[0], raised[1], raised[2], raised[3])
            for j in range(4, len(raised), 2):
                _add_pair(force, inputs[m, j], raised[j], inputs[m, j + 1], raised[j + 1])
            for i in range(_AHEAD):
                balance = turns[m, 5] * force[0]
                x[i] = balance.real if begins else states[m, 0, i]
                y[i] = balance.imag if begins else states[m, 1, i]
            _gather_four(force, turns[m], real, imaginary)
            _turn_eight(real, imaginary, turns[m], x, y)
            for i in range(_AHEAD):
                states[m, 0, i], states[m, 1, i] = x[i + _BLOCK], y[i + _BLOCK]
            paired = len(total) // 2 * 2
            for k in range(0, paired, 2):
                a, b = swings[m, k], swings[m, k + 1]
                _add_modal_twice(total[k], a.imag, a.real, total[k + 1], b.imag, b.real, x, y)
            for k in range(paired, len(total)):
                _add_modal(total[k], swings[m, k].imag, x, swings[m, k].real, y)
        for k in range(len(total)):
            _write(total[k], first, _BLOCK, acceleration[k])


@dataclass(frozen=True, kw_only=True)
class CasingModes:
    """Modes of a casing, mass-normalised.

    Attributes
    ----------
    frequency, damping_ratio : numpy.ndarray [shape=(n_modes,)]
        [Hz], [-]
    inputs, outputs : numpy.ndarray [shape=(n_modes, n_inputs)], [shape=(n_modes, n_outputs)]
        Shapes at the forces and at the sensors [kg^-0.5].
    """

    frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]


def _steps(
    modes: CasingModes, step: float
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]]:
    """How modes move on by whole steps, each as one complex number.

    Returns
    -------
    share : numpy.ndarray [shape=(n_modes,)]
        Acceleration of a mode at once per filtered force, beside that of its bare mass.
    turns : numpy.ndarray [shape=(n_modes, 6)]
        Factors of the state over 1, 2, 3, 4 and 8 steps, and state in balance per force.
    swings : numpy.ndarray [shape=(n_modes,)]
        Imaginary part of it times the state: acceleration by the forces before.

    Notes
    -----
    With ``p = -zeta w + j w_d`` the state ``z = q' - conj(p) q`` obeys ``z' = p z + f``; of it
    ``q = Im(z) / w_d``, and springs and dashpots add ``Im(p^2 z) / w_d`` to the bare mass. Under
    straight lines, ``z[n+1] = t z[n] + g0 f[n] + g1 f[n+1]`` with ``t = exp(p step)``, so that
    ``z = (t g1 + g0) r + g1 f`` where ``r[n+1] = t r[n] + f[n]``. The factors follow from
    :func:`exact_oscillator`.
    """
    pairs = [
        exact_oscillator(f, z, step)
        for f, z in zip(modes.frequency, modes.damping_ratio, strict=True)
    ]
    transition, gain = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])
    omega = 2 * np.pi * modes.frequency
    damped = omega * np.sqrt(1 - modes.damping_ratio**2)
    pole = -modes.damping_ratio * omega + 1j * damped
    before, after = (gain[:, 1] - pole.conj()[:, None] * gain[:, 0]).T
    one = transition[:, 0, 0] + pole * transition[:, 0, 1]
    two = one * one
    four = two * two
    turns = np.column_stack([one, two, two * one, four, four * four, 1 / (1 - one)])
    felt = pole**2 / damped
    return (felt * after).imag, turns, felt * (one * after + before)


class _ModesInMotion:
    """Modes of a casing under forces that come piece by piece, their springs feeling `taps`."""

    def __init__(self, modes: CasingModes, taps: NDArray[np.float64], step_rate: float) -> None:
        share, turns, swings = _steps(modes, 1 / step_rate)
        n_inputs, n_outputs = modes.inputs.shape[1], modes.outputs.shape[1]
        pairs = max(2, -(-n_inputs // 2))
        self._window = np.empty((n_inputs, _PIECE + 2 * (_BLOCK + _REACH)))
        self._filled = 0
        self._fresh = True
        self._n_outputs = n_outputs
        self._told: tuple[Any, ...] = (
            taps,
            np.pad(modes.inputs, ((0, 0), (0, 2 * pairs - n_inputs))),
            modes.outputs.T @ modes.inputs,
            (modes.outputs * share[:, None]).T @ modes.inputs,
            turns,
            modes.outputs * swings[:, None],
            np.zeros((2 * pairs, _ROW)),
            np.zeros((len(turns), 2, _AHEAD)),
            *np.zeros((6, _ROW)),
            np.zeros((n_outputs, _ROW)),
        )

    def add(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take ``_PIECE`` steps at most; the acceleration of those that are known by now."""
        self.room(forces.shape[1])[:] = forces
        return self.take(forces.shape[1])

    def room(self, n: int) -> NDArray[np.float64]:
        """Where the next n steps' forces are to be written, ``_PIECE`` at most."""
        first = self._filled or _REACH
        return self._window[:, first : first + n]

    def take(self, n: int) -> NDArray[np.float64]:
        """As :meth:`add`, of n steps that have been written into :meth:`room`."""
        if not self._filled:
            self._window[:, :_REACH] = self._window[:, _REACH : _REACH + 1]
            self._filled = _REACH
        end = self._filled + n
        known = (end - 2 * _REACH) // _BLOCK * _BLOCK
        acceleration = np.empty((self._n_outputs, max(0, known)))
        if known > 0:
            _respond(self._window, self._fresh, acceleration, *self._told)
            self._window[:, : end - known] = self._window[:, known:end]
            self._fresh, end = False, end - known
        self._filled = end
        return acceleration

    def finish(self) -> NDArray[np.float64]:
        """Acceleration of what is left; the last forces stand."""
        left = self._filled - _REACH
        last = self._window[:, self._filled - 1 : self._filled]
        more = -(-left // _BLOCK) * _BLOCK + 2 * _REACH - self._filled
        self.room(more)[:] = last
        return self.take(more)[:, :left]


def _pieces(rows: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    for first in range(0, rows.shape[1], _PIECE):
        yield rows[:, first : first + _PIECE]


def housing_acceleration(
    forces: NDArray[np.float64], sample_rate: float, modes: CasingModes
) -> NDArray[np.float64]:
    """Acceleration of the housing under forces that are linear between samples.

    Parameters
    ----------
    forces : numpy.ndarray [shape=(n_samples, n_inputs)]
        Forces on the casing [N].
    sample_rate : float
        [Hz]
    modes : CasingModes
        The casing.

    Returns
    -------
    numpy.ndarray [shape=(n_outputs, n_samples)]
        [m/s^2]. The casing starts in static balance with the first forces.

    Notes
    -----
    Each mode obeys ``q'' + 2 zeta w q' + w^2 q = sum_j phi_j F_j``, discretised exactly for a
    force linear between samples. Under a band-limited force its resonances are low by
    ``sinc^2(f / sample_rate)``, the share of the samples' spectrum that straight lines keep;
    :func:`band_limited_acceleration` has no such loss.
    """
    casing = _ModesInMotion(modes, _AS_THEY_ARE, sample_rate)
    found = [casing.add(piece) for piece in _pieces(forces.T)]
    return np.hstack([*found, casing.finish()])


_AS_THEY_ARE = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # taps


def band_limited_acceleration(
    means: NDArray[np.float64], step_rate: float, factor: int, modes: CasingModes
) -> NDArray[np.float64]:
    """Acceleration of the housing at the sample rate, from means of the forces over steps.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_inputs)]
        Means of the forces on the casing over each step [N].
    step_rate : float
        Steps per second, `factor` times the sample rate.
    factor : int
        At least 2, so that the images of the hold lie beyond the band.
    modes : CasingModes
        The casing.

    Returns
    -------
    numpy.ndarray [shape=(n_outputs, n_steps // factor)]
        [m/s^2], flat to :data:`PASS_BAND` of the sample rate, times as in :func:`decimate`.

    Notes
    -----
    The casing runs at the step rate, before anything is decimated. Its springs and dashpots feel
    straight lines between the means, which lose a sinc squared; they are given the means with
    that loss made up for, so that they and the bare masses, which feel the means as they are,
    cancel each other below the modes as they should.
    """
    casing = ModalCasing(modes, step_rate, factor, len(means))
    casing.add(means.T)
    return casing.finish()


class ModalCasing:
    """:func:`band_limited_acceleration` of forces that come piece by piece; the same bytes.

    Parameters
    ----------
    modes, step_rate, factor
        As there.
    n_steps : int
        Of all pieces together.
    """

    def __init__(self, modes: CasingModes, step_rate: float, factor: int, n_steps: int) -> None:
        self._modes = _ModesInMotion(modes, line_inverse(), step_rate)
        self._low = Decimation(modes.outputs.shape[1], n_steps, factor)

    def add(self, means: NDArray[np.float64]) -> None:
        """Take the next steps, means of the forces [shape=(n_inputs, n)] [N]."""
        for piece in _pieces(means):
            self._low.add(self._modes.add(piece))

    def fill(self, n: int, write: Callable[[NDArray[np.float64]], None]) -> None:
        """As :meth:`add`, of n steps, ``_PIECE`` at most, that are written where they are used."""
        write(self._modes.room(n))
        self._low.add(self._modes.take(n))

    def finish(self) -> NDArray[np.float64]:
        """Acceleration [shape=(n_outputs, n_steps // factor)] [m/s^2], after the last step."""
        self._low.add(self._modes.finish())
        return self._low.finish()


def casing_inputs(shape: Mapping[str, float], place: str, throw: int) -> float:
    """Mode shape where a force acts: that of the throw, else that of the place, else none.

    Parameters
    ----------
    shape : mapping of str to float
        Mass-normalised shape [kg^-0.5] by place; ``bearing_x`` is good for all throws,
        ``bearing_x_2`` for the second alone, and wins there.
    place : str
        Where the force acts.
    throw : int
        Of which throw it is, counted from 1.

    Returns
    -------
    float
        [kg^-0.5]; 0 where the shape names neither.

    Examples
    --------
    >>> casing_inputs({"bearing_x": 0.1, "bearing_x_2": 0.2}, "bearing_x", 2)
    0.2
    >>> casing_inputs({"bearing_x": 0.1, "bearing_x_2": 0.2}, "bearing_x", 3)
    0.1
    """
    key = specific_key(shape, place, throw)
    return 0.0 if key is None else shape[key]


@dataclass(frozen=True, kw_only=True)
class TableRun:
    """Acceleration from measured frequency response functions, and what they left out.

    Attributes
    ----------
    acceleration : numpy.ndarray [shape=(n_outputs, n_samples)]
        [m/s^2]
    force_share_above : float
        Share of the forces' energy, their means apart, above the table's last line.
    """

    acceleration: NDArray[np.float64]
    force_share_above: float


def table_acceleration(
    means: NDArray[np.float64], step_rate: float, factor: int, accelerance: Accelerance
) -> TableRun:
    """Acceleration of the housing at the sample rate, through measured responses.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_inputs)]
        Means of the forces on the casing over each step [N].
    step_rate : float
        Steps per second, `factor` times the sample rate.
    factor : int
        Steps per sample, >= 1.
    accelerance : Accelerance
        From every force to every sensor.

    Returns
    -------
    TableRun
        Acceleration with the times and the spoilt edges of :func:`band_limited_acceleration`.

    Notes
    -----
    The forces are decimated, their spectrum is multiplied by the accelerance between the lines,
    :meth:`~wearstate.sim.pump.casing_frf.Accelerance.at`, and brought back. The record is padded by
    the length of the response, one over the line spacing, so that its end does not wrap round to
    its beginning. The casing starts in balance with the first forces, as the modes do: they have
    stood there for ever and meet the accelerance at zero frequency.
    """
    casing = MeasuredCasing(accelerance, step_rate, factor, len(means))
    casing.add(means.T)
    return casing.finish()


class MeasuredCasing:
    """:func:`table_acceleration` of forces that come piece by piece.

    Parameters
    ----------
    accelerance, step_rate, factor
        As there.
    n_steps : int
        Of all pieces together.
    """

    def __init__(
        self, accelerance: Accelerance, step_rate: float, factor: int, n_steps: int
    ) -> None:
        self.accelerance, self._rate, self._factor = accelerance, step_rate / factor, factor
        self._low = Decimation(accelerance.values.shape[1], n_steps, factor)
        self._held = np.empty(0)

    def add(self, means: NDArray[np.float64]) -> None:
        """Take the next steps, means of the forces [shape=(n_inputs, n)] [N]."""
        if not self._held.size:
            self._held = means[:, 0].copy()
        self._low.add(means - self._held[:, None])

    def fill(self, n: int, write: Callable[[NDArray[np.float64]], None]) -> None:
        """As :meth:`add`, of n steps that `write` puts into an array."""
        means = np.empty((self.accelerance.values.shape[1], n))
        write(means)
        self.add(means)

    def finish(self) -> TableRun:
        """Acceleration and what was left out, after the last step."""
        return _through_table(
            self._low.finish(), self._held, self._rate, self._factor, self.accelerance
        )


def _through_table(
    forces: NDArray[np.float64],
    held: NDArray[np.float64],
    rate: float,
    factor: int,
    accelerance: Accelerance,
) -> TableRun:
    """Forces at the sample rate, less those `held` from ever, times the accelerance."""
    pad = math.ceil(rate / accelerance.spacing)
    edge = edge_samples(factor)
    # the last rows run into zeros: they are led there more gently
    inside = forces[:, : max(1, forces.shape[1] - edge)]
    spectrum, length = padded_spectrum(inside, pad + edge)
    frequency = fft.rfftfreq(length, 1 / rate)
    rows = []
    for values in accelerance.values:  # one sensor at a time: all at once may not fit the memory
        response = replace(accelerance, values=values[None]).at(frequency)[0]
        rows.append(
            fft.irfft(np.sum(response * spectrum, axis=0), length)[: forces.shape[1]]
            + response[:, 0].real @ held
        )
    energy = np.sum((inside - inside.mean(axis=1, keepdims=True)) ** 2)
    beyond = spectrum[:, frequency > accelerance.frequency[-1]]
    above = 2 * np.sum(np.abs(beyond) ** 2) / length  # Parseval; one side of two
    return TableRun(
        acceleration=np.stack(rows),
        force_share_above=float(min(above / energy, 1.0)) if energy > 0 else 0.0,
    )


@lru_cache(maxsize=1)
def line_inverse() -> NDArray[np.float64]:
    """Seven symmetric taps that approximate ``1 / sinc^2`` of the frequency over the rate.

    Their expansion about zero frequency agrees with that of ``(w/2)^2 / sin^2(w/2)``, which is
    ``1 + w^2/12 + w^4/240 + w^6/6048 + …``, to the sixth power of the angular frequency w per
    sample: 0.4 % is left at 0.225 of the rate.
    """
    wanted = np.array([1.0, 1 / 12, 1 / 240, 1 / 6048])
    order = np.arange(4)
    sign = (-1.0) ** order / np.array([math.factorial(2 * n) for n in order])
    # a_0 + 2 sum a_k cos(k w), term by term
    matrix = np.array(
        [
            [float(n == 0) if k == 0 else 2 * s * k ** (2 * n) for k in order]
            for n, s in zip(order, sign, strict=True)
        ]
    )
    side = np.linalg.solve(matrix, wanted)
    return np.concatenate([side[:0:-1], side])


@lru_cache(maxsize=8)
def decimation_filter(factor: int) -> NDArray[np.float64]:
    """Linear-phase low-pass at the step rate, before one sample in `factor` is kept.

    The mean over a step is a low-pass of its own (a sinc); the filter takes its droop back, so
    that the result is flat to :data:`PASS_BAND` of the final rate. Half its length is a whole
    number of kept samples.
    """
    width = (1 - 2 * PASS_BAND) * 2 / factor  # of the fine Nyquist: 0.45 to 0.55 of the rate
    taps, beta = signal.kaiserord(_STOP_ATTENUATION_DB, width)
    half = factor * math.ceil(taps / 2 / factor)
    edge = 1.0 / factor
    grid = np.linspace(0, edge, 129)
    return np.asarray(
        signal.firwin2(
            2 * half + 1,
            np.concatenate([grid, [edge, 1.0]] if factor > 1 else [grid]),
            np.concatenate([1 / np.sinc(grid / 2), [0.0, 0.0] if factor > 1 else []]),
            nfreqs=2**15 + 1,
            window=("kaiser", beta),
        )
    )


def decimate(means: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    """Low-pass what was sampled once a step and keep one in `factor`, without delay.

    Parameters
    ----------
    means : numpy.ndarray [shape=(n_steps, n_columns)]
        Means over steps, or what the casing made of them.
    factor : int
        Steps per sample, >= 1.

    Returns
    -------
    numpy.ndarray [shape=(n_steps // factor, n_columns)]
        Row k belongs to the middle of step ``k * factor``. Within :func:`edge_samples` of either
        end the filter runs into zeros.
    """
    low = Decimation(means.shape[1], len(means), factor)
    low.add(means.T)
    return np.ascontiguousarray(low.finish().T)


class Decimation:
    """:func:`decimate` of rows that come piece by piece; the same bytes.

    Parameters
    ----------
    n_rows, n_steps : int
        Shape of all pieces together.
    factor : int
        Steps per sample, >= 1.
    """

    def __init__(self, n_rows: int, n_steps: int, factor: int) -> None:
        self._phases = _filter_phases(factor)
        self._kept = np.empty((n_rows, n_steps // factor))
        self._done = 0
        self._advance = _KEPT * factor
        self._span = self._phases.size + self._advance  # steps that a block of samples looks at
        self._window = np.zeros((n_rows, self._span + max(_PIECE, self._advance)))
        self._filled = edge_samples(factor) * factor  # zeros before the first step
        self._scratch = np.empty(_KEPT + self._phases.shape[1]), np.empty(_KEPT)

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take the next steps [shape=(n_rows, n)]."""
        for piece in _pieces(rows):
            end = self._filled + piece.shape[1]
            self._window[:, self._filled : end] = piece
            self._filled = end
            self._keep()

    def _keep(self) -> None:
        blocks = max(0, (self._filled - self._span) // self._advance + 1)
        if not blocks:
            return
        begin, end = self._done, min(self._done + blocks * _KEPT, self._kept.shape[1])
        _low_pass(self._window, self._phases, *self._scratch, self._kept[:, begin:end])
        self._done, gone = end, blocks * self._advance
        self._filled -= gone
        self._window[:, : self._filled] = self._window[:, gone : gone + self._filled]

    def finish(self) -> NDArray[np.float64]:
        """Kept values [shape=(n_rows, n_steps // factor)], after the last step."""
        while self._done < self._kept.shape[1]:
            self._window[:, self._filled : self._span] = 0.0
            self._filled = max(self._filled, self._span)
            self._keep()
        return self._kept


@lru_cache(maxsize=8)
def _filter_phases(factor: int) -> NDArray[np.float64]:
    """Every factor-th tap of the filter, from each of the first ones on, and zeros."""
    taps = decimation_filter(factor)
    columns = _AT_ONCE * math.ceil(len(taps) / factor / _AT_ONCE)
    padded = np.zeros(columns * factor)
    padded[: len(taps)] = taps
    return np.ascontiguousarray(padded.reshape(columns, factor).T)


@kernel
def _pick(row: Any, first: int, factor: int, picked: Any) -> None:
    """Every factor-th value."""
    for i in range(picked.size):
        picked[i] = row[np.uint64(first + i * factor)]


@kernel
def _add_taps(total: Any, taps: Any, first: int, x: Any) -> None:
    """Eight taps from the first on."""
    t0, t1, t2, t3 = taps[first], taps[first + 1], taps[first + 2], taps[first + 3]
    t4, t5, t6, t7 = taps[first + 4], taps[first + 5], taps[first + 6], taps[first + 7]
    for i in range(_KEPT):
        k = np.uint64(first + i)
        early = (t0 * x[k] + t1 * x[k + _ONE]) + (t2 * x[k + _TWO] + t3 * x[k + _THREE])
        late = (t4 * x[k + _FOUR] + t5 * x[k + _FIVE]) + (t6 * x[k + _SIX] + t7 * x[k + _SEVEN])
        total[i] += early + late


_ONE, _TWO, _THREE, _FOUR, _FIVE, _SIX, _SEVEN = (np.uint64(i) for i in range(1, 8))


@kernel
def _low_pass(rows: Any, phases: Any, picked: Any, total: Any, kept: Any) -> None:
    """Filter and keep one in so many: of each phase of the filter, one phase of the rows."""
    factor, columns = phases.shape
    n_kept = kept.shape[1]
    for c in range(len(rows)):
        for first in range(0, n_kept, _KEPT):
            total[:] = 0.0
            for phase in range(factor):
                _pick(rows[c], first * factor + phase, factor, picked)
                for tap in range(0, columns, _AT_ONCE):
                    _add_taps(total, phases[phase], tap, picked)
            _write(total, first, min(_KEPT, n_kept - first), kept[c])


def edge_samples(factor: int) -> int:
    """Samples at either end of a decimated record that the filter's length spoils."""
    return (len(decimation_filter(factor)) // 2) // factor
