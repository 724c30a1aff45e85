"""Changes of response functions: band levels, assurance criteria, resonance shift."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from ..signal.spectrum import decibel
from .modal_model import Modes, checked_functions, squared_size

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integer = NDArray[np.intp]


def band_response_levels(
    frequency: ArrayLike, value: ArrayLike, edges: ArrayLike, *, weight: ArrayLike | None = None
) -> Float:
    """Mean level of response functions in bands.

    Parameters
    ----------
    frequency : array_like, shape (n_lines,)
        Lines, equally spaced [Hz].
    value : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions.
    edges : array_like, shape (n_bands + 1,)
        Ascending edges; a band includes its lower edge and excludes its upper one [Hz].
    weight : array_like, shape (n_lines,) or (n_channels, n_lines), optional
        Weight of each line, >= 0 [-], such as its coherence; equal by default.

    Returns
    -------
    ndarray, shape (n_channels, n_bands)
        ``10 log10`` of the mean of ``|H|^2`` over the lines [dB re 1 unit of value]; NaN if all
        lines of a band have the weight 0.

    Raises
    ------
    ValueError
        If the data cannot be used, edges do not ascend, a band holds no line, or weights are
        negative or of another shape.

    Notes
    -----
    This is the level of the response to a white force in that band, less the level of the force.
    The difference from the levels of a reference is the change in dB, independent of the unit.

    Examples
    --------
    >>> band_response_levels(range(10), [10.0] * 5 + [1.0] * 5, [0.0, 5.0, 10.0]).tolist()
    [[20.0, 0.0]]
    >>> weight = [1.0, 0, 0, 0, 0]
    >>> band_response_levels(range(5), [10.0, 1, 1, 1, 1], [0.0, 5.0], weight=weight).tolist()
    [[20.0]]
    """
    lines, functions = checked_functions(frequency, value)
    limits = np.asarray(edges, dtype=np.float64)
    if limits.ndim != 1 or limits.size < 2 or not np.all(np.diff(limits) > 0):
        raise ValueError(f"edges (shape {limits.shape}) must be two or more and ascend; sort them")
    places = np.searchsorted(lines, limits)
    empty = np.flatnonzero(np.diff(places) == 0)
    if empty.size:
        named = ", ".join(f"{limits[i]:.6g} … {limits[i + 1]:.6g} Hz" for i in empty)
        raise ValueError(f"bands {named} must each hold a line; widen them")
    share = np.ones(lines.size) if weight is None else np.asarray(weight, dtype=np.float64)
    if share.shape == lines.shape:
        share = np.broadcast_to(share, functions.shape)
    if share.shape != functions.shape or not np.all(share >= 0):
        raise ValueError(
            f"weight has shape {share.shape}, must have {functions.shape}, each >= 0; give "
            "the coherence of every line"
        )
    total, shares = (
        np.add.reduceat(lines[:, : places[-1]], places[:-1], axis=-1)
        for lines in (share * squared_size(functions), share)
    )
    heard = shares > 0
    return np.where(heard, decibel(total / np.where(heard, shares, 1.0)), np.nan)


def frequency_response_assurance(value: ArrayLike, reference: ArrayLike) -> Float:
    """Frequency response assurance criterion (FRAC): similarity in shape over frequency.

    Parameters
    ----------
    value, reference : array_like, shape (n_lines,) or (n_channels, n_lines)
        Response functions on the same lines.

    Returns
    -------
    ndarray, shape (n_channels,)
        ``|sum H R*|^2 / (sum |H|^2 sum |R|^2)`` over the lines, 0 to 1 [-]; 1 if one is a complex
        multiple of the other.

    Raises
    ------
    ValueError
        If shapes differ, a line is not finite or a channel is silent.

    Notes
    -----
    Insensitive to level and to a common phase. Two resonances of one half-power width b, alone in
    the band and a distance d apart, have ``1 / (1 + (d / b)^2)``: one half at one width.

    References
    ----------
    W. Heylen, S. Lammens, "FRAC: a consistent way of comparing frequency response functions",
    Proc. Int. Conf. Identification in Engineering Systems, Swansea 1996, 48-57.

    Examples
    --------
    >>> frequency_response_assurance([1, 1j, 2], [2, 2j, 4]).round(12).tolist()
    [1.0]
    """
    one, other = _same(value, reference)
    powers = np.sum(squared_size(one), axis=-1) * np.sum(squared_size(other), axis=-1)
    both = squared_size(np.sum(one * other.conj(), axis=-1))
    return np.asarray(np.minimum(both / powers, 1.0))  # rounding


def _same(value: ArrayLike, reference: ArrayLike) -> tuple[Complex, Complex]:
    """Two sets of functions of one shape, in units of the largest magnitude of both."""
    shapes = np.shape(value), np.shape(reference)
    if shapes[0] != shapes[1] or len(shapes[0]) not in (1, 2) or 0 in shapes[0]:
        raise ValueError(
            f"value has shape {shapes[0]} and reference {shapes[1]}, must be the same, (n_lines,) "
            "or (n_channels, n_lines); bring both to the same lines"
        )
    index = np.arange(shapes[0][-1], dtype=np.float64)
    one, other = (checked_functions(index, x, least=1)[1] for x in (value, reference))
    size = max(np.abs(one).max(), np.abs(other).max())
    return one / size, other / size


@dataclass(frozen=True, kw_only=True)
class ModeShift:
    """Changes of the modes relative to a reference.

    Attributes
    ----------
    pairs : ndarray of int, shape (n_pairs, 2)
        Index of the mode in the reference and in the new set, ascending.
    frequency : ndarray, shape (n_pairs,)
        Relative change of natural frequency [-].
    frequency_deviation : ndarray, shape (n_pairs,)
        Its standard deviation, from those of both fits [-].
    damping_ratio : ndarray, shape (n_pairs,)
        New damping ratio over the reference's [-].
    level : ndarray, shape (n_channels, n_pairs)
        Change of the height of the resonance, ``|A| / |Re p|`` [dB].
    lost, new : tuple of int
        Modes without a partner: of the reference, and of the new set.
    """

    pairs: Integer
    frequency: Float
    frequency_deviation: Float
    damping_ratio: Float
    level: Float
    lost: tuple[int, ...]
    new: tuple[int, ...]


def resonance_shift(modes: Modes, reference: Modes, *, within: float = 0.1) -> ModeShift:
    """Pair the modes of two fits and compare them.

    Parameters
    ----------
    modes, reference : Modes
        Fits of the same channels, after and before.
    within : float
        Largest relative change of frequency of a pair, > 0 [-].

    Returns
    -------
    ModeShift

    Raises
    ------
    ValueError
        If the numbers of channels differ or `within` is not > 0.

    Notes
    -----
    The pairs minimise the sum of ``|f / f_ref - 1| / within + 1 - MAC``, with a cost of 2 for an
    unpaired mode and the modal assurance criterion MAC of the residues over the channels: given
    enough channels, modes that have swapped order are distinguished by shape. With one channel MAC
    is 1, and the nearest frequency decides.

    Examples
    --------
    >>> from wearstate.features.response.modal import fit_modes
    >>> f = np.arange(20.0, 60.0, 0.5)
    >>> before, after = (
    ...     fit_modes(f, 1 / (f0**2 - f**2 + 0.02j * f0 * f), [f0], [0.02], quantity="receptance")
    ...     for f0 in (40.0, 39.0)
    ... )
    >>> resonance_shift(after, before).frequency.round(6).tolist()
    [-0.025]
    """
    channels = modes.residue.shape[0], reference.residue.shape[0]
    if channels[0] != channels[1] or not within > 0:
        raise ValueError(
            f"n_channels = {channels[0]} must equal that of the reference, {channels[1]}, and "
            f"within = {within} must be > 0; fit the same channels"
        )
    pairs = _paired(modes, reference, within)
    old, now = pairs.T
    ratio = modes.frequency[now] / reference.frequency[old]
    scatter = np.hypot(
        modes.frequency_deviation[now] / modes.frequency[now],
        reference.frequency_deviation[old] / reference.frequency[old],
    )
    heights = [np.abs(x.residue) / np.abs(x.pole.real) for x in (modes, reference)]
    return ModeShift(
        pairs=pairs,
        frequency=ratio - 1,
        frequency_deviation=ratio * scatter,
        damping_ratio=modes.damping_ratio[now] / reference.damping_ratio[old],
        level=decibel(np.square(heights[0][:, now] / heights[1][:, old])),
        lost=tuple(sorted(set(range(reference.frequency.size)) - set(old.tolist()))),
        new=tuple(sorted(set(range(modes.frequency.size)) - set(now.tolist()))),
    )


def _paired(modes: Modes, reference: Modes, within: float) -> Integer:
    """Indices (reference, modes) of the pairs of least cost, (n_pairs, 2)."""
    apart = np.abs(modes.frequency / reference.frequency[:, np.newaxis] - 1) / within
    product = squared_size(reference.residue.conj().T @ modes.residue)
    sizes = [np.sum(squared_size(x.residue), axis=0) for x in (reference, modes)]
    cost = apart + 1 - product / np.outer(*sizes)
    cost = np.where(apart <= 1, np.minimum(cost, 2.0), 2.0)
    rows, columns = linear_sum_assignment(cost)
    kept = cost[rows, columns] < 2.0
    return np.stack([rows[kept], columns[kept]], axis=1).astype(np.intp)
