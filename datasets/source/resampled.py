"""Resampling of a recording while it is read, without aliasing or images."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import DataError
from .part import Fetch, Source
from .resampled_tacho import ResampledTacho

RATE_IN_FILE = "sample_rate_in_file_hz"
"""Manifest column: rate before resampling."""

BANDWIDTH = "bandwidth_hz"
"""Manifest column: highest frequency of a resampled signal that the filter leaves unchanged."""

_MOST_STEPS = 1000  # of a ratio of rates, up or down: the filter grows with it
_EXACT = 1e-6  # relative error of a rate, a hundredth of a line in 10,000 lines
_HALF_LENGTH = 64  # of the filter, in samples of the lower rate
_CUTOFF = 0.95  # of the lower Nyquist frequency: -6 dB
_BETA = 8.0  # of the Kaiser window: 80 dB
_PASSED = 0.9  # of the lower Nyquist frequency: flat to 0.01 dB


def resampled(source: Source, rate: float | None, tacho: str | None = None) -> Source:
    """The same recording at another rate.

    Parameters
    ----------
    source : Source
        Source with a declared rate.
    rate : float or None
        Rate wanted [Hz]; None keeps the present one.
    tacho : str, optional
        Channel that is resampled by its edges instead of the filter.

    Returns
    -------
    Source
        Source read piece by piece like the original; the rate of the file and the remaining
        bandwidth are among its conditions. A higher rate adds samples, but no bandwidth.

    Raises
    ------
    DataError
        If the ratio of the rates needs too large whole numbers.

    Notes
    -----
    Polyphase, with a linear-phase filter (Kaiser window): flat to 0.01 dB up to 0.9 of the lower of
    both Nyquist frequencies, 80 dB down from it on. The samples do not depend on the pieces in
    which they are read. Before the first and after the last sample of the file the signal counts as
    0, which fades the first and last 64 samples of the lower rate.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from wearstate.datasets.readers.open import open_source
    >>> from wearstate.datasets.source.part import SourceOptions
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "x.npy"
    ...     np.save(file, np.ones((1, 4000)))
    ...     with open_source(file, SourceOptions(fs=400.0, unit="g", resample_to=100.0)) as found:
    ...         found.n_samples, bool(np.allclose(found.read(400, 600), 9.80665, atol=1e-4))
    (1000, True)
    """
    if rate is None or source.sample_rate is None or rate == source.sample_rate:
        return source
    ratio = _ratio(source, rate)
    band = _PASSED / 2 * min(rate, source.sample_rate)
    return replace(
        source,
        sample_rate=rate,
        n_samples=-(-source.n_samples * ratio.numerator // ratio.denominator),
        conditions={**source.conditions, RATE_IN_FILE: source.sample_rate, BANDWIDTH: band},
        fetch=_with_tacho(source, _Resampling(source, ratio), tacho, float(ratio)),
    )


def _ratio(source: Source, rate: float) -> Fraction:
    own = float(source.sample_rate or 0.0)
    ratio = Fraction(rate / own).limit_denominator(_MOST_STEPS)
    if abs(float(ratio) * own / rate - 1) > _EXACT:
        raise DataError(
            f"{source.path}: resample_to = {rate:.10g} Hz must be its rate {own:.10g} Hz times a "
            f"ratio of whole numbers <= {_MOST_STEPS}; nearest {float(ratio) * own:.10g} Hz"
        )
    return ratio


def _with_tacho(source: Source, filtered: Fetch, tacho: str | None, ratio: float) -> Fetch:
    """Fetches the tacho by its edges, the other channels through the filter."""
    names = [channel.name for channel in source.channels]
    if tacho not in names:
        return filtered
    own = source.rows[names.index(tacho)]

    def read(start: int, stop: int) -> NDArray[np.float64]:
        return np.asarray(source.fetch(start, stop, (own,))[0], dtype=np.float64)

    pulses = ResampledTacho(source.path, read, source.n_samples, ratio)

    def fetch(start: int, stop: int, rows: tuple[int, ...]) -> NDArray[Any]:
        others = tuple(row for row in rows if row != own)
        signals = dict(zip(others, filtered(start, stop, others), strict=True)) if others else {}
        if own in rows:
            signals[own] = pulses(start, stop)
        return np.stack([signals[row] for row in rows])

    return fetch


@cache
def _filter(up: int, down: int) -> NDArray[np.float64]:
    """Low-pass filter at `up` times the rate of the file."""
    from scipy.signal import firwin

    longest = max(up, down)
    taps = firwin(2 * _HALF_LENGTH * longest + 1, _CUTOFF / longest, window=("kaiser", _BETA))
    return np.asarray(taps)


class _Resampling:
    """Fetches samples at the new rate from just the samples of the file that they need."""

    def __init__(self, source: Source, ratio: Fraction) -> None:
        self.source = source
        self.up, self.down = ratio.numerator, ratio.denominator

    def __call__(self, start: int, stop: int, rows: tuple[int, ...]) -> NDArray[Any]:
        from scipy.signal import resample_poly

        # whole blocks: `down` samples of the file become `up` new ones
        margin = _HALF_LENGTH // min(self.up, self.down) + 2  # half the filter, in blocks
        block = max(0, start // self.up - margin)
        last = min(self.source.n_samples, (stop // self.up + 1 + margin) * self.down)
        numbers = self.source.fetch(block * self.down, last, rows).astype(np.float64)
        made = resample_poly(
            numbers, self.up, self.down, axis=1, window=_filter(self.up, self.down)
        )
        first = start - block * self.up
        return np.asarray(made[:, first : first + stop - start])
