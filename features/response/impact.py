"""Impact tests: how they are recognised by their force, cut into blows and analysed.

Tables, pictures and the API share one rule. A blow is a short pulse of one sign; each block runs
from shortly before a blow to the next one or to the end of the record.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..signal.rate import check_rate
from . import frf

Float = NDArray[np.float64]

MOST_STRUCK = 0.05
"""Largest share of a hammer record's samples that reach the trigger level [-]: a random force has a
third, a burst that lasts a fifth of its block a fifteenth."""

MOST_OF_ONE = 0.2
"""The same for a single blow that ends within the record: a short record of a soft tip [-]."""

LARGEST_PULL = 0.5
"""Largest force opposite to the blows, in units of the largest blow [-]: filters overshoot by about
a fifth."""

PRETRIGGER_S = 0.002
"""Length of the block before the blow, if the record allows it [s]."""

BOUNCE_S = 0.016
"""Force within this time after a blow counts as part of it [s]."""

MOST_RINGING = 0.15
"""Level at the end of the block, as a share of the loudest, from which a response is reported as
cut off [-]; noise alone has 1."""

WIDEST_LINES_HZ = 12.5
"""Widest line spacing of a transfer function in a table [Hz]."""

MOST_SHORTENED = 0.75
"""Share of the blows that the block length must suit [-]; the others are left out."""


@dataclass(frozen=True, kw_only=True)
class Impacts:
    """Blocks of an impact test.

    Attributes
    ----------
    force : ndarray, shape (n_samples,)
        Force without the cell's offset [N].
    blows : Blows
        Blocks, one blow each.
    fs : float
        Sample rate [Hz].
    ringing : float
        Rms of the windowed response in the last tenth of the blocks, over that of the loudest tenth
        [-]; 0 if unknown.
    faults : tuple of str
        Defects of the blow if there is only one; it is analysed nevertheless.
    """

    force: Float
    blows: frf.Blows
    fs: float
    ringing: float = 0.0
    faults: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Description of what is averaged, and of its limits."""
        count = len(self.blows.starts)
        left = len(self.blows.rejected)
        words = [f"{count} blows"] if count > 1 else [_ONE_BLOW, *self.faults]
        summary = "; ".join(words) + (f", {left} left out" if left else "")
        return "; ".join([summary, *self._short])

    @property
    def _short(self) -> list[str]:
        """Limits of short blocks: line spacing, and response cut off at the end."""
        words = []
        resolved = self.fs / self.blows.nperseg
        if resolved > WIDEST_LINES_HZ:
            words.append(
                f"blocks of {1000 * self.blows.nperseg / self.fs:.2g} ms resolve {resolved:.2g} "
                "Hz, modes nearer than that are one; record longer"
            )
        if self.ringing > MOST_RINGING:
            words.append(
                f"the response is still at {round(self.ringing, 1):.0%} of its loudest at the end "
                "of a block, and what is cut off leaks over all lines; record longer, or lower "
                "--exponential"
            )
        return words


_ONE_BLOW = (
    "1 blow, H1 of the whole block: coherence, random error and confidence are not defined, noise "
    "is not averaged; strike again"
)


def pressing(force: ArrayLike) -> Float:
    """Force without its offset, with blows counted positive.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force [N].

    Returns
    -------
    ndarray, shape (n_samples,)
        Force less its median, with the sign changed if the largest excursion is negative [N].

    Examples
    --------
    >>> pressing([1.0, 1.0, -9.0, 1.0]).tolist()
    [0.0, 0.0, 10.0, 0.0]
    """
    level = np.asarray(force, dtype=np.float64)
    level = level - np.median(level)
    return level if level.max() >= -level.min() else -level + 0.0


def is_impact(force: ArrayLike) -> bool:
    """Whether a force is that of a hammer: short pulses of one sign.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force [N].

    Returns
    -------
    bool
        True if at most `MOST_STRUCK` of the samples (`MOST_OF_ONE` for a single blow) reach a tenth
        of the largest, and the largest one of opposite sign is at most `LARGEST_PULL` of it.

    Examples
    --------
    >>> is_impact(np.arange(200) == 50), is_impact(np.sin(np.arange(200.0)))
    (True, False)
    """
    pulse = pressing(force)
    top = float(pulse.max(initial=0.0))
    if top <= 0:
        return False
    struck = pulse >= frf.TRIGGER_SHARE * top
    most = MOST_OF_ONE if _is_one(struck) else MOST_STRUCK
    return float(np.mean(struck)) <= most and -float(pulse.min()) <= LARGEST_PULL * top


def _is_one(struck: NDArray[np.bool_]) -> bool:
    """Whether the struck samples are consecutive and do not include the last one."""
    return not struck[-1] and np.count_nonzero(np.diff(struck.astype(np.int8)) < 0) == 1


def find_impacts(
    force: ArrayLike, fs: float, response: ArrayLike | None = None, *, last: float = 1.0
) -> Impacts:
    """Cut an impact test into its blows.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force, of either sign, with an offset or without [N].
    fs : float
        Sample rate [Hz].
    response : array_like, shape (n_channels, n_samples), optional
        Response, which shows how far it has died away at the end of a block [any unit].
    last : float
        Value of the exponential window at the end of a block [-]; see `impact_spectra`.

    Returns
    -------
    Impacts
        Blocks as long as three quarters of the blows allow. Double hits, and blows cut off by the
        record, are left out. If there is no other, the block from the first blow to the end of the
        record is kept, and its defects are reported.

    Raises
    ------
    ValueError
        If the force is not one row of finite samples, or is constant.

    Notes
    -----
    The block may start before the record: force and response are cut alike, and a common shift
    cancels in their ratio.

    Examples
    --------
    >>> force = np.zeros(4000)
    >>> force[[1, 1000, 2000, 3000]] = 1.0
    >>> found = find_impacts(force, 1000.0)
    >>> found.blows.starts.tolist(), found.blows.nperseg
    ([0, 998, 1998, 2998], 900)
    """
    check_rate(fs)
    level = np.asarray(force, dtype=np.float64)
    pulse = pressing(level)
    top = float(pulse.max(initial=0.0))
    if pulse.ndim != 1 or not np.all(np.isfinite(pulse)) or top <= 0:
        raise ValueError(
            f"force (shape {pulse.shape}) must be one row of finite samples that vary; "
            "connect the force cell"
        )
    level = level - np.median(level)
    lead = max(1, round(PRETRIGGER_S * fs))
    hits = frf.onsets(pulse, frf.TRIGGER_SHARE * top)
    events = _events(hits, max(lead, round(BOUNCE_S * fs)))
    if events.size > 1:
        found = _several(pulse, fs, events, lead)
        if found is not None:
            return Impacts(
                force=level, blows=found, fs=fs, ringing=last * _ringing(found, response)
            )
    start = max(int(events[0]) - lead, 0)
    blows = frf.Blows(
        starts=np.array([start], dtype=np.intp), nperseg=pulse.size - start, rejected=()
    )
    return Impacts(
        force=level,
        blows=blows,
        fs=fs,
        ringing=last * _ringing(blows, response),
        faults=tuple(_faults_of_one(pulse, hits)),
    )


def _ringing(blows: frf.Blows, response: ArrayLike | None) -> float:
    """Rms of the last tenth of the blows over that of the loudest tenth, for the worst channel."""
    tenth = blows.nperseg // _PARTS
    if response is None or np.size(response) == 0 or tenth == 0:
        return 0.0
    rows = np.asarray(response, dtype=np.float64)
    blocks = blows.cut(rows - rows.mean(axis=-1, keepdims=True))[..., : _PARTS * tenth]
    parts = blocks.reshape(*blocks.shape[:-1], _PARTS, tenth)
    power = np.square(parts).mean(axis=-1)
    loudest = power.max(axis=-1)
    share = np.divide(power[..., -1], loudest, out=np.zeros_like(loudest), where=loudest > 0)
    return float(np.sqrt(share.max()))


_PARTS = 10


def _events(hits: NDArray[np.intp], bounce: int) -> NDArray[np.intp]:
    """First hit of each blow; hits within `bounce` samples after it belong to it."""
    first = [int(hits[0])]
    for hit in hits[1:]:
        if hit - first[-1] >= bounce:
            first.append(int(hit))
    return np.array(first, dtype=np.intp)


def _several(pulse: Float, fs: float, events: NDArray[np.intp], lead: int) -> frf.Blows | None:
    """Blocks of a test of several blows; None if all of them are defective."""
    gaps = np.diff(np.append(events, pulse.size))
    # a double hit has a short gap; it is left out, and must not shorten the other blocks
    usual = np.sort(gaps[gaps > np.median(gaps) / 4])[::-1]
    suited = min(usual.size, max(2, int(np.ceil(MOST_SHORTENED * usual.size))))
    nperseg = int(0.9 * usual[suited - 1]) // 2 * 2
    if nperseg < 8:
        return None
    early = pulse[0] >= frf.TRIGGER_SHARE * pulse.max()
    padded = np.concatenate([np.zeros(lead), pulse])
    if early:  # its rise is not in the record
        padded[lead : lead + int(events[1]) - lead] = 0.0
    try:
        found = frf.find_blows(padded, fs, nperseg=nperseg, pretrigger=lead)
    except ValueError:  # every blow is defective: the whole record is analysed as one block
        return None
    starts = np.maximum(found.starts - lead, 0)
    kept = starts + nperseg <= pulse.size
    lost = ("blow at 0 s: begins before the record, must begin in it",) if early else ()
    return frf.Blows(starts=starts[kept], nperseg=nperseg, rejected=(*lost, *found.rejected))


def _faults_of_one(pulse: Float, hits: NDArray[np.intp]) -> list[str]:
    faults = []
    share = float(pulse[0] / pulse.max())
    if share >= frf.TRIGGER_SHARE:
        faults.append(
            f"the record begins within the blow, at {100 * share:.0f} % of its peak, must begin "
            "before it: levels are too high by what is lost; use a pretrigger"
        )
    if hits.size > 1:
        faults.append(f"hits {hits.size} times, must hit once: the force has gaps in its spectrum")
    return faults


def impact_spectra(
    force: ArrayLike,
    response: ArrayLike,
    fs: float,
    *,
    least: int = 8,
    last: float = 1.0,
) -> tuple[frf.Spectra, Impacts]:
    """Spectra of an impact test, its blows averaged.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force [N].
    response : array_like, shape (n_channels, n_samples)
        Responses [any unit].
    fs : float
        Sample rate [Hz].
    least : int
        Fewest samples of a block; shorter ones are zero-padded.
    last : float
        Value of an exponential window over force and response at the end of a block, 0 < last <= 1
        [-]; 1 for none. With a window, the force is also cut off after its blow.

    Returns
    -------
    spectra : Spectra
        Spectra with the rate of the window, which a modal fit removes from the damping.
    impacts : Impacts
        Blocks that were averaged.

    Raises
    ------
    ValueError
        As for `find_impacts`, `frf.window_decay` and `frf.block_spectra`.

    Notes
    -----
    Without a window, the poles of a response that is cut off at the end of its block lie at the
    lines of the block; with a window, levels at the resonances fall by the added damping.

    Examples
    --------
    >>> force = np.zeros(512)
    >>> force[3] = 2.0
    >>> spectra, impacts = impact_spectra(force, [3 * force], 512.0)
    >>> abs(frf.h1(spectra)).max().round(12).item(), len(impacts.blows.starts)
    (3.0, 1)
    """
    check_rate(fs)
    rows = np.asarray(response, dtype=np.float64)
    impacts = find_impacts(force, fs, rows, last=last)
    rows = rows - np.mean(rows, axis=-1, keepdims=True)
    blows = impacts.blows
    window, decay = None, 0.0
    length = max(least, blows.nperseg)
    if last < 1:
        decay = frf.window_decay(blows.nperseg / fs, last=last)
        end = PRETRIGGER_S + BOUNCE_S
        window = frf.force_window(length, fs, end=end, fall=BOUNCE_S)
    fill = length - blows.nperseg
    struck, answers = (
        np.pad(blows.cut(signal), [(0, 0)] * signal.ndim + [(0, fill)])
        for signal in (impacts.force, rows)
    )
    spectra = frf.block_spectra(struck, answers, fs, force_window=window, decay=decay)
    return spectra, impacts
