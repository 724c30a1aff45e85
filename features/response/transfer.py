"""Transfer functions of a test, computed alike for tables, pictures and the API.

A path leads from one force to one response. Blows are found, cut and averaged by
:mod:`wearstate.features.response.impact`; any other force is cut into half-overlapped windows,
several simultaneous forces into matrices of spectra. Lines that noise alone could have caused are
left out of the results.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammainccinv

from ..signal.rate import check_rate
from ..signal.spectrum import decibel
from . import frf, impact, mimo, modal, modal_model, response_change

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

CHANCE = 0.01
"""Share of the lines of pure noise that pass as coherent [-]."""

LEAST_DIP = 6.0
"""Depth of an antiresonance below the lower of the two adjacent crests [dB]."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Transfer:
    """Transfer functions of a test, one row per path.

    Attributes
    ----------
    frequency : ndarray, shape (n_lines,)
        Frequency of the lines [Hz].
    value : ndarray, shape (n_paths, n_lines)
        H1, with the other forces absent; the paths of a response are consecutive [unit of response
        / N]; 0 if the force is silent.
    coherence : ndarray, shape (n_paths, n_lines)
        Ordinary coherence, or the partial one for several forces, 0 to 1 [-]; NaN for a single
        blow.
    averages : float
        Number of independent averages behind `coherence` [-].
    n_forces : int
    words : str
        Readable description of what was averaged.
    struck : bool
        Whether the force was a hammer's.
    decay : float
        As in :class:`wearstate.features.response.frf.Spectra` [1/s].
    paths, units : tuple of str
        ``response / force`` and unit of each path; empty if the channels had no names.

    Examples
    --------
    >>> force = np.random.default_rng(0).standard_normal((1, 4096))
    >>> found = measured_transfer(force, 3 * force, 1024.0, nperseg=256)
    >>> found.value[0, 7].real.round(9).item(), found.words
    (3.0, '31 windows (Hann, half overlapped)')
    """

    frequency: Float
    value: Complex
    coherence: Float
    averages: float
    n_forces: int
    words: str
    struck: bool = False
    decay: float = 0.0
    paths: tuple[str, ...] = ()
    units: tuple[str, ...] = ()

    def __repr__(self) -> str:
        paths = ", ".join(self.paths) or f"{len(self.value)} paths"
        last = f"{self.frequency[-1]:.6g} Hz" if len(self.frequency) else "none"
        return f"<Transfer {len(self.frequency)} lines to {last}, {self.words}: {paths}>"

    def plot(self, *, ax: Any = None) -> Any:
        """Draw magnitude and coherence of every path over frequency.

        Parameters
        ----------
        ax : sequence of two matplotlib.axes.Axes, optional
            Axes for magnitude and coherence; a new figure by default.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (2,)
            The axes, for further drawing or for saving through their ``figure``.

        Examples
        --------
        >>> force = np.random.default_rng(0).standard_normal((1, 4096))
        >>> measured_transfer(force, 3 * force, 1024.0, nperseg=256).plot()[1].get_ylabel()
        'coherence [-]'
        """
        if ax is None:
            from matplotlib import pyplot as plt

            _, ax = plt.subplots(
                2, sharex=True, figsize=(8.0, 4.5), height_ratios=(2, 1), layout="constrained"
            )
        magnitude, coherence = np.ravel(ax)
        paths = self.paths or tuple(f"path {i}" for i in range(len(self.value)))
        for name, value, share in zip(paths, self.value, self.coherence, strict=True):
            magnitude.semilogy(self.frequency, np.abs(value), lw=0.8, label=name)
            coherence.plot(self.frequency, share, lw=0.8)
        unit = f" [{self.units[0]}]" if len(set(self.units)) == 1 else ""
        magnitude.set_ylabel(f"magnitude{unit}")
        magnitude.legend(fontsize="small")
        coherence.set(xlabel="frequency [Hz]", ylabel="coherence [-]", ylim=(0, 1.05))
        for each in (magnitude, coherence):
            each.margins(x=0)
            each.grid(alpha=0.3)
        return np.array([magnitude, coherence])

    @property
    def heard(self) -> NDArray[np.bool_]:
        """Whether each line exceeds what noise alone would cause [shape=(n_paths, n_lines)].

        For a single blow, all lines that are not 0: its noise is unknown.
        """
        if np.isnan(self.coherence).any():
            return np.asarray(self.value != 0)
        return np.asarray(self.coherence > coherence_limit(self.averages))

    @property
    def masked(self) -> Float:
        """Share of the lines of each path that are left out [-, shape=(n_paths,)]."""
        return np.asarray(1 - self.heard.mean(axis=-1))

    @property
    def noise(self) -> Float:
        """Variance of each function [(unit of response / N)^2, shape=(n_paths, n_lines)].

        0 for a single blow, whose noise is unknown.
        """
        share = np.where(np.isnan(self.coherence), 1.0, self.coherence)
        power = (1 - share) * np.abs(self.value) ** 2
        freedom = max(self.averages - 1, 1.0)
        return _ratio(power, share * freedom)

    def estimate(self, estimator: str) -> Complex:
        """Functions by another estimator.

        Parameters
        ----------
        estimator : str
            ``h1``: noise on the responses; ``h2``: on the force; ``hv``: on both, in proportion.

        Returns
        -------
        ndarray, shape (n_paths, n_lines)
            ``H1``, ``H1 / g^2`` or ``H1 / g``, with g^2 the coherence [unit of response / N]; 0 if
            that is 0. A single blow has one function only.

        Notes
        -----
        With several forces, the functions between a response and one force after the others are
        removed.
        """
        power = _ESTIMATORS[estimator]
        share = np.where(np.isnan(self.coherence), 1.0, self.coherence) ** power
        return np.divide(self.value, share, out=np.zeros_like(self.value), where=share > 0)


_ESTIMATORS = {"h1": 0.0, "hv": 0.5, "h2": 1.0}
"""Estimator -> power of the coherence by which H1 is divided."""


@dataclass(frozen=True, eq=False)
class FrfReference:
    """Reference for later transfer functions, usually those of the healthy machine.

    Parameters
    ----------
    frequency : ndarray, shape (n_lines,)
        Frequency of the lines [Hz].
    value : ndarray, shape (n_paths, n_lines)
        Transfer functions [unit of response / unit of force].
    modes : Modes, optional
        Modes of the same functions; without them no shift is computed.

    Examples
    --------
    >>> FrfReference(np.ones(1), np.ones((1, 1), complex)).modes is None
    True
    """

    frequency: Float
    value: Complex
    modes: modal_model.Modes | None = None

    def at(self, frequency: Float, n_paths: int) -> Complex:
        """Functions on the lines of a test [shape=(n_paths, n_lines)].

        Parameters
        ----------
        frequency : ndarray, shape (n_lines,)
            Lines of the test [Hz].
        n_paths : int
            Number of paths of the test.

        Raises
        ------
        ValueError
            If it has other paths, or ends a line or more within the test's range.
        """
        line = float(frequency[1] - frequency[0]) if frequency.size > 1 else 0.0
        ends = self.frequency[0] - line, self.frequency[-1] + line
        if len(self.value) != n_paths or frequency[0] < ends[0] or frequency[-1] > ends[1]:
            raise ValueError(
                f"reference has shape {self.value.shape} at {self.frequency[0]:.6g} … "
                f"{self.frequency[-1]:.6g} Hz, must have {n_paths} paths at {frequency[0]:.6g} … "
                f"{frequency[-1]:.6g} Hz as the transfer function; measure it with the same "
                "channels, sample rate and settings"
            )
        if np.array_equal(frequency, self.frequency):
            return self.value
        return np.array([np.interp(frequency, self.frequency, row) for row in self.value])


def coherence_limit(averages: float, chance: float = CHANCE) -> float:
    """Coherence that noise alone exceeds with a given chance.

    Parameters
    ----------
    averages : float
        Independent averages, > 1 [-].
    chance : float
        Probability, 0 to 1 [-].

    Returns
    -------
    float
        ``1 - chance^(1 / (averages - 1))`` [-]

    References
    ----------
    G. C. Carter, "Coherence and time delay estimation", Proc. IEEE 75 (1987) 236-255,
    doi:10.1109/PROC.1987.13723.

    Examples
    --------
    >>> round(coherence_limit(3.0), 3)
    0.9
    """
    if not averages > 1:
        return 1.0
    return float(1 - chance ** (1 / (averages - 1)))


def excited_spectra(
    force: ArrayLike,
    response: ArrayLike,
    fs: float,
    *,
    nperseg: int,
    least: int = 8,
    last: float = 1.0,
) -> tuple[frf.Spectra, str]:
    """Averaged spectra of one force: over blows for a hammer, otherwise over windows.

    Parameters
    ----------
    force : array_like, shape (n_samples,)
        Force [N].
    response : array_like, shape (n_channels, n_samples)
        Responses [any unit].
    fs : float
        Sample rate [Hz].
    nperseg : int
        Length of a window [samples].
    least, last
        As for :func:`wearstate.features.response.impact.impact_spectra`.

    Returns
    -------
    spectra : Spectra
    words : str
        Readable description of what was averaged.

    Raises
    ------
    ValueError
        As for :func:`wearstate.features.response.impact.impact_spectra` and
        :func:`wearstate.features.response.frf.welch_spectra`.

    Examples
    --------
    >>> force = np.random.default_rng(0).standard_normal(1024)
    >>> excited_spectra(force, [force], 1024.0, nperseg=256)[1]
    '7 windows (Hann, half overlapped)'
    """
    check_rate(fs)
    if impact.is_impact(force):
        spectra, found = impact.impact_spectra(force, response, fs, least=least, last=last)
        return spectra, found.text
    spectra = frf.welch_spectra(force, response, fs, nperseg=nperseg)
    return spectra, f"{spectra.blocks} windows (Hann, half overlapped)"


def measured_transfer(
    force: ArrayLike,
    response: ArrayLike,
    fs: float,
    *,
    nperseg: int,
    last: float = 1.0,
    band: tuple[float, float] = (0.0, np.inf),
) -> Transfer:
    """Transfer functions of a test with one force or several.

    Parameters
    ----------
    force : array_like, shape (n_forces, n_samples)
        Force of each shaker, or of one hammer [N].
    response : array_like, shape (n_responses, n_samples)
        Responses [any unit].
    fs : float
        Sample rate [Hz].
    nperseg : int
        Length of a window, and smallest length of a blow's block [samples].
    last : float
        As for :func:`excited_spectra` [-].
    band : tuple of float
        First and last frequency [Hz].

    Returns
    -------
    Transfer
        Functions on the lines of the band, without those at 0 Hz and at half the sample rate.

    Raises
    ------
    ValueError
        If several forces are copies of one another, or as for :func:`excited_spectra` and
        :func:`wearstate.features.response.mimo.multiple_h1`.

    Notes
    -----
    The paths of a force that never varies are 0, and the other forces are analysed without it.

    Examples
    --------
    >>> force = np.random.default_rng(0).standard_normal((2, 4096))
    >>> found = measured_transfer(force, [3 * force[0] - force[1]], 1024.0, nperseg=256)
    >>> found.value[:, 7].real.round(9).tolist(), found.coherence.min().round(9).item()
    ([3.0, -1.0], 1.0)
    """
    check_rate(fs)
    forces = np.atleast_2d(np.asarray(force))
    responses = np.atleast_2d(np.asarray(response))
    alive = np.flatnonzero(np.ptp(forces, axis=-1) > 0)
    if alive.size > 1:
        found = _of_several(forces[alive], responses, fs, nperseg)
    else:
        row = forces[alive[0] if alive.size else 0]
        spectra, words = excited_spectra(
            row, responses, fs, nperseg=nperseg, least=nperseg, last=last
        )
        found = replace(_of_one(spectra, words), struck=impact.is_impact(row))
    kept = (found.frequency >= band[0]) & (found.frequency <= band[1])
    kept &= (found.frequency > 0) & (found.frequency < fs / 2)
    value, share = (
        _all_paths(rows[:, kept], len(responses), alive, len(forces))
        for rows in (found.value, found.coherence)
    )
    return Transfer(
        frequency=found.frequency[kept],
        value=value,
        coherence=share.real,
        averages=found.averages,
        n_forces=len(forces),
        words=found.words,
        struck=found.struck,
        decay=found.decay,
    )


def _of_one(spectra: frf.Spectra, words: str) -> Transfer:
    force = spectra.force
    known = spectra.blocks > 1
    return Transfer(
        frequency=spectra.frequency,
        value=spectra.cross / np.where(force > 0, force, 1.0),
        coherence=frf.coherence(spectra) if known else np.full(spectra.response.shape, np.nan),
        averages=spectra.averages,
        n_forces=1,
        words=words,
        decay=spectra.decay,
    )


def _of_several(forces: NDArray[np.float64], responses: ArrayLike, fs: float, n: int) -> Transfer:
    found = mimo.multiple_h1(forces, responses, fs, nperseg=n)
    lines = found.frequency.size
    return Transfer(
        frequency=found.frequency,
        value=found.value.reshape(-1, lines),
        coherence=found.partial.reshape(-1, lines),
        averages=found.averages - len(forces) + 1,
        n_forces=len(forces),
        words=f"{len(forces)} forces, {found.averages:.4g} independent averages",
    )


def _all_paths(
    rows: NDArray[np.complexfloating] | Float, responses: int, alive: NDArray[np.intp], forces: int
) -> Complex:
    """Rows of the paths from live forces, with zero rows added for the other forces."""
    full = np.zeros((responses, forces, rows.shape[-1]), dtype=np.complex128)
    places = alive if alive.size else np.zeros(1, dtype=np.intp)
    full[:, places] = rows.reshape(responses, places.size, -1)
    return full.reshape(-1, rows.shape[-1])


# --- results of a test


def band_levels(transfer: Transfer, edges: ArrayLike, *, estimator: str = "h1") -> Float:
    """Levels of the paths in bands, regardless of coherence.

    Parameters
    ----------
    transfer : Transfer
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz].
    estimator : str
        As for :meth:`Transfer.estimate`.

    Returns
    -------
    ndarray, shape (n_paths, n_bands)
        Levels [dB re 1 (unit of response / N)^2]; -200 for a silent path.

    Raises
    ------
    ValueError
        As for :func:`wearstate.features.response.response_change.band_response_levels`.
    """
    return _levels(transfer, transfer.estimate(estimator), np.ones(transfer.value.shape), edges)


def _levels(transfer: Transfer, value: Complex, weight: Float, edges: ArrayLike) -> Float:
    """Weighted band levels; -200 dB for silent paths."""
    moving = np.any(value != 0, axis=-1)
    levels = np.full((len(value), np.size(edges) - 1), decibel(0.0))
    if moving.any():
        levels[moving] = response_change.band_response_levels(
            transfer.frequency, value[moving], edges, weight=weight[moving]
        )
    return levels


def profile(transfer: Transfer, edges: ArrayLike) -> tuple[Float, NDArray[np.bool_]]:
    """Levels of the paths in narrow bands: noise subtracted, lines weighted by their coherence.

    Parameters
    ----------
    transfer : Transfer
    edges : array_like, shape (n_bands + 1,)
        Band edges [Hz].

    Returns
    -------
    levels : ndarray, shape (n_paths, n_bands)
        Levels [dB re 1 (unit of response / N)^2]; a band without signal is interpolated between its
        neighbours over the logarithm of the frequency; -200 for a path without any signal.
    heard : ndarray of bool, shape (n_paths, n_bands)
        Bands whose level noise alone reaches with at most the probability `CHANCE`.

    Raises
    ------
    ValueError
        If a band holds no line.

    Notes
    -----
    ``|H1|^2`` has the expectation ``|H|^2 + v``, with ``v = (1 - g^2) |H1|^2 / (g^2 (n - 1))`` for
    n averages, determined from the residual, which is independent of H1. The level is that of the
    mean of ``|H1|^2 - v`` over the lines, each with the weight ``P / (P + v)``, the coherence that
    the averaged function has there, P being the mean with the weights ``1 / v``. The estimated
    coherence of a line must not be used to weight it or to leave it out: it is high where chance
    makes H1 large. For noise alone, the mean of ``|H1|^2 / v`` over a band is about 1 and follows a
    gamma distribution with as many degrees as there are independent lines under a Hann window.

    Examples
    --------
    >>> force = np.random.default_rng(0).standard_normal((1, 4096))
    >>> found = measured_transfer(force, 10 * force, 1024.0, nperseg=256)
    >>> profile(found, [10.0, 20.0, 40.0])[0].round(9).tolist()
    [[20.0, 20.0]]
    """
    limits = np.asarray(edges, dtype=np.float64)
    places = np.searchsorted(transfer.frequency, limits)
    counts = np.diff(places)
    if not np.all(counts > 0):
        raise ValueError(f"{np.sum(counts < 1)} bands hold no line, must be 0; widen them")
    band = np.repeat(np.arange(counts.size), counts)
    kept = slice(places[0], places[-1])
    noise = transfer.noise[:, kept]
    raw = np.abs(transfer.value[:, kept]) ** 2
    power = raw - noise

    def mean(lines: Float) -> Float:
        return np.add.reduceat(lines, places[:-1] - places[0], axis=-1) / counts

    least = _LEAST_NOISE * mean(raw)[:, band]
    sure = _ratio(np.ones(1), noise + least)
    signal = np.maximum(_ratio(mean(sure * power), mean(sure)), 0.0)[:, band]
    weight = _ratio(signal, signal + noise)
    level = _ratio(mean(weight * power), mean(weight))
    heard = (mean(sure * raw) > _noise_limits(counts)) & (level > 0)
    return _filled(decibel(np.maximum(level, 0.0)), heard, np.sqrt(limits[1:] * limits[:-1])), heard


_LEAST_NOISE = 1e-6  # of a band's mean power: leakage; also keeps a single line from dominating


def _ratio(above: Float, below: Float) -> Float:
    """Quotient; 0 if the denominator is 0."""
    quotient: Float = np.divide(above, below, out=np.zeros_like(below), where=below > 0)
    return quotient


def _noise_limits(counts: NDArray[np.intp]) -> Float:
    """Ratio to its mean that a mean over noise lines exceeds with probability `CHANCE` [-]."""
    # Under Hann the powers of neighbouring lines correlate by (2/3)^2.
    free = counts / (1 + 2 * (2 / 3) ** 2 * (1 - 1 / counts))
    return np.asarray(gammainccinv(free, CHANCE) / free)


def _filled(levels: Float, heard: NDArray[np.bool_], middle: Float) -> Float:
    """Levels, interpolated in the bands without signal."""
    place = np.log(middle)
    for row, known in zip(levels, heard, strict=True):
        row[:] = np.interp(place, place[known], row[known]) if known.any() else decibel(0.0)
    return levels


def antiresonances(transfer: Transfer, count: int) -> Float:
    """Deepest antiresonances of the paths, among the lines above noise.

    Parameters
    ----------
    transfer : Transfer
    count : int
        Number for each path.

    Returns
    -------
    ndarray, shape (n_paths, count, 2)
        Frequency [Hz], rising, and depth below the lower of the adjacent crests [dB]; zeros if
        there are fewer.

    Notes
    -----
    The lines at the bottom of a dip are the first to disappear in noise and are then left out. The
    frequency is therefore the zero of a straight line in the complex plane through the lines next
    to the bottom.

    Examples
    --------
    >>> f = np.arange(1.0, 100.0)
    >>> value = (60.3**2 - f**2) / ((30**2 - f**2 + 1j * f) * (90**2 - f**2 + 3j * f))
    >>> found = Transfer(
    ...     frequency=f, value=value[None], coherence=np.ones((1, 99)), averages=9.0, n_forces=1,
    ...     words=""
    ... )
    >>> antiresonances(found, 1)[0, 0, 0].round(1).item()
    60.3
    """
    table = np.zeros((len(transfer.value), count, 2))
    for place, value, heard in zip(table, transfer.value, transfer.heard, strict=True):
        dips = _dips(transfer.frequency[heard], value[heard])[-count:]
        dips.sort(key=lambda dip: dip[1])
        for i, (depth, frequency) in enumerate(dips):
            place[i] = frequency, depth
    return table


def _dips(frequency: Float, value: Complex) -> list[tuple[float, float]]:
    """Depth [dB] and frequency [Hz] of the dips of one function, the deepest last."""
    from scipy.signal import find_peaks  # import takes half a second, and reports do not need it

    level = decibel(np.abs(value) ** 2)
    places, about = find_peaks(-level, prominence=LEAST_DIP)
    depths = about["prominences"].tolist()
    return sorted(
        (depth, _zero(frequency, value, int(at))) for depth, at in zip(depths, places, strict=True)
    )


def _zero(frequency: Float, value: Complex, at: int) -> float:
    """Frequency where the straight line through a line's neighbours is nearest to 0 [Hz]."""
    below, above = frequency[at - 1], frequency[at + 1]
    slope = (value[at + 1] - value[at - 1]) / (above - below)
    size = abs(slope) ** 2
    shift = (value[at] * np.conj(slope)).real / size if size > 0 else 0.0
    return float(np.clip(frequency[at] - shift, below, above))


# --- modes of a test


def fit_transfer(
    transfer: Transfer,
    paths: list[int],
    *,
    quantity: modal_model.Quantity,
    n_modes: int,
    highest_order: int,
    most_lines: int,
) -> modal_model.Modes | None:
    """Modes of some paths, on the lines that are above noise in one of them.

    Parameters
    ----------
    transfer : Transfer
    paths : list of int
        Indices of paths to moving responses of one quantity.
    quantity, n_modes, highest_order
        As for :func:`wearstate.features.response.modal.modal_fit`.
    most_lines : int
        Number of lines above which each peak is fitted separately.

    Returns
    -------
    Modes or None
        None if no pole is stable, or nothing moves.
    """
    kept = transfer.heard[paths].any(axis=0)
    if np.count_nonzero(kept) < modal_model.FEWEST_LINES:
        return None
    fit = modal.peak_fits if np.count_nonzero(kept) > most_lines else modal.modal_fit
    try:
        return fit(
            transfer.frequency[kept],
            transfer.value[paths][:, kept],
            n_modes=n_modes,
            quantity=quantity,
            decay=transfer.decay,
            highest_order=min(highest_order, int(np.count_nonzero(kept)) // 3),
        )
    except ValueError:  # no stable pole: the functions are valid
        return None


def mode_shapes(modes: modal_model.Modes) -> tuple[Float, Float]:
    """Mode shapes as seen by the force of each path, with standard deviations.

    Parameters
    ----------
    modes : Modes

    Returns
    -------
    shape, deviation : ndarray, shape (n_paths, n_modes)
        Real parts of the modal constants over the root of the sum of their squares [-]. The sign is
        that of the response relative to the force, which no scaling of the shape reverses.
    """
    constant = modes.modal_constant
    size = np.linalg.norm(constant, axis=0)
    deviation = 2 * modes.pole.imag * modes.residue_deviation
    return np.asarray(constant.real / size), np.asarray(deviation / size)


def static_flexibility(modes: modal_model.Modes) -> tuple[Float, Float]:
    """Static flexibility of the modes and all above them, and that of the latter alone.

    Parameters
    ----------
    modes : Modes

    Returns
    -------
    whole, residual : ndarray, shape (n_paths,)
        Receptance at rest, ``sum 2 Re(-A / p) + Re U`` and ``Re U`` [unit of receptance]; modes
        below the band, such as a free rigid-body mode, are not included.

    Examples
    --------
    >>> f = np.arange(5.0, 60.0, 0.5)
    >>> modes = modal.modal_fit(f, 1 / (40**2 - f**2 + 1.6j * f), quantity="receptance")
    >>> (1 / static_flexibility(modes)[0]).round(2).tolist()
    [1600.0]
    """
    modal_part = 2 * np.sum((-modes.residue / modes.pole).real, axis=-1)
    return np.asarray(modal_part + modes.upper.real), np.asarray(modes.upper.real)


def mode_changes(
    modes: modal_model.Modes | None, reference: modal_model.Modes, count: int
) -> Float:
    """Changes of each mode of a reference.

    Parameters
    ----------
    modes : Modes or None
        Modes of the test.
    reference : Modes
        Modes of the same paths in the reference.
    count : int
        Number of modes in the result.

    Returns
    -------
    ndarray, shape (count, 5)
        Relative change of the frequency and its standard deviation [-], logarithm of the ratio of
        the damping ratios [-], mean change of level over the paths [dB], and modal assurance
        criterion MAC [-]; zeros for a mode that is not found again.
    """
    table = np.zeros((count, 5))
    if modes is None or modes.residue.shape[0] != reference.residue.shape[0]:
        return table  # a dead sensor: nothing is found again
    shift = response_change.resonance_shift(modes, reference)
    old, now = shift.pairs.T
    one, other = reference.residue[:, old], modes.residue[:, now]
    both = np.abs(np.sum(one.conj() * other, axis=0)) ** 2
    assurance = both / (np.sum(np.abs(one) ** 2, axis=0) * np.sum(np.abs(other) ** 2, axis=0))
    damping = np.log(np.maximum(np.abs(shift.damping_ratio), _LEAST_DAMPING))
    rows = np.stack(
        [shift.frequency, shift.frequency_deviation, damping, shift.level.mean(axis=0), assurance],
        axis=-1,
    )
    counted = old < count
    table[old[counted]] = rows[counted]
    return table


_LEAST_DAMPING = 1e-3  # of the reference's damping ratio
