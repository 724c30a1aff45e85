"""The casing as it was measured: acceleration through a table of frequency response functions."""

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


class MeasuredCasing:
    """Acceleration of the housing at the sample rate, through measured responses.

    The forces come piece by piece. Times and spoilt edges are those of :class:`.ModalCasing`.

    Parameters
    ----------
    accelerance : Accelerance
        From every force to every sensor.
    step_rate : float
        Steps per second, `factor` times the sample rate.
    factor : int
        Steps per sample, >= 1.
    n_steps : int
        Of all pieces together.

    Notes
    -----
    The forces are decimated, their spectrum is multiplied by the accelerance between the lines,
    :meth:`.Accelerance.at`, and brought back. The record is padded by
    the length of the response, one over the line spacing, so that its end does not wrap round to
    its beginning. The casing starts in balance with the first forces, as the modes do: they have
    stood there for ever and meet the accelerance at zero frequency.
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
