"""The casing as measured: acceleration through a table of frequency response functions."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ..output.sensor import padded_spectrum
from .casing_frf import Accelerance
from .decimation import Decimation, edge_samples


@dataclass(frozen=True, kw_only=True)
class TableRun:
    """Acceleration from measured frequency response functions, and the neglected part.

    Attributes
    ----------
    acceleration : numpy.ndarray [shape=(n_outputs, n_samples)]
        Acceleration [m/s^2].
    force_share_above : float
        Share of the forces' energy, without their means, above the table's last line.
    """

    acceleration: NDArray[np.float64]
    force_share_above: float


class MeasuredCasing:
    """Acceleration of the housing at the sample rate, through measured responses.

    Forces arrive in pieces. Times and affected edges are those of :class:`.ModalCasing`.

    Parameters
    ----------
    accelerance : Accelerance
        Accelerance from every force to every sensor.
    step_rate : float
        Steps per second, `factor` times the sample rate.
    factor : int
        Steps per sample, >= 1.
    n_steps : int
        Total of all pieces.

    Notes
    -----
    The forces are decimated, their spectrum is multiplied by the interpolated accelerance,
    :meth:`.Accelerance.at`, and transformed back. The record is padded by
    the length of the response, one over the line spacing, so that its end does not wrap round to
    its beginning. The casing starts in equilibrium with the first forces, like the modes: they are
    assumed to have acted forever, with the accelerance at zero frequency.
    """

    def __init__(
        self, accelerance: Accelerance, step_rate: float, factor: int, n_steps: int
    ) -> None:
        self.accelerance, self._rate, self._factor = accelerance, step_rate / factor, factor
        self._low = Decimation(accelerance.values.shape[1], n_steps, factor)
        self._held = np.empty(0)

    def add(self, means: NDArray[np.float64]) -> None:
        """Add the next steps, means of the forces [shape=(n_inputs, n)] [N]."""
        if not self._held.size:
            self._held = means[:, 0].copy()
        self._low.add(means - self._held[:, None])

    def fill(self, n: int, write: Callable[[NDArray[np.float64]], None]) -> None:
        """Like :meth:`add`, for n steps that `write` puts into an array."""
        means = np.empty((self.accelerance.values.shape[1], n))
        write(means)
        self.add(means)

    def finish(self) -> TableRun:
        """Return the acceleration and the neglected part, after the last step."""
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
    """Response to forces at the sample rate, less the constant `held` ones, by the accelerance."""
    pad = math.ceil(rate / accelerance.spacing)
    edge = edge_samples(factor)
    # the filter includes zeros in the last rows: fade them out
    inside = forces[:, : max(1, forces.shape[1] - edge)]
    spectrum, length = padded_spectrum(inside, pad + edge)
    frequency = fft.rfftfreq(length, 1 / rate)
    rows = []
    for values in accelerance.values:  # one sensor at a time: all together may exceed the memory
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
