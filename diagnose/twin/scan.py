"""Frequencies of casing modes from the spectrum of the running machine.

The spectrum around a mode, relative to its frequency, looks alike in all members of an ensemble.
The ensemble thus gives a template with its scatter, and the frequency of a recording is where the
template fits best. This needs a scan, because a level is not a linear function of a frequency that
shifts by more than the width of its resonance.
"""

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

HALF_WIDTH, STEP = 0.15, 0.015
"""Of the template, in log frequency: half the distance to the next mode of a usual casing."""
LEAST_SCATTER = 0.3
"""Smallest scatter of a level [dB], from averaging only a few revolutions."""
SHRINKAGE = 0.05
"""Shrinkage of the covariance towards its diagonal: templates have more points than a small
ensemble can resolve."""
GRID = 161


def scanned(
    spectra: Float, frequencies: Float, log_points: Float, between: tuple[float, float]
) -> Float:
    """Frequency of one mode in every spectrum, using templates from the others.

    Parameters
    ----------
    spectra : ndarray [shape=(n, n_channels, n_points)]
        Levels [dB]; the last row is that of the recording, with unknown frequency.
    frequencies : ndarray [shape=(n - 1,)]
        Frequency of the mode in every other row [Hz].
    log_points : ndarray [shape=(n_points,)]
        Logarithms of the frequencies of the points.
    between : tuple of float
        Bounds of the frequency [Hz].

    Returns
    -------
    ndarray [shape=(n,)]
        Likelihood-weighted mean on a grid [Hz].
    """
    offsets = np.arange(-HALF_WIDTH, HALF_WIDTH + STEP / 2, STEP)
    own = np.stack(
        [
            _around(s[None], f, offsets, log_points)[0]
            for s, f in zip(spectra, frequencies, strict=False)
        ]
    )
    centre = own.mean(axis=0)
    weight = np.asarray(np.linalg.inv(_scatter(own - centre)), dtype=np.float64)
    grid = np.linspace(*between, GRID)
    misfit = np.stack(
        [_distance(_around(spectra, f, offsets, log_points) - centre, weight) for f in grid],
        axis=-1,
    )
    likelihood = np.exp(-0.5 * (misfit - misfit.min(axis=-1, keepdims=True)))
    found: Float = likelihood @ grid / likelihood.sum(axis=-1)
    return found


def _around(spectra: Float, frequency: float, offsets: Float, log_points: Float) -> Float:
    """Levels at offsets from a frequency [shape=(n, n_channels * n_offsets)]."""
    place = (np.log(frequency) + offsets - log_points[0]) / (log_points[1] - log_points[0])
    place = np.clip(place, 0, len(log_points) - 1.001)
    left = place.astype(int)
    part = place - left
    levels = spectra[..., left] * (1 - part) + spectra[..., left + 1] * part
    return np.asarray(levels.reshape(len(spectra), -1), dtype=np.float64)


def _scatter(residual: Float) -> Float:
    covariance = residual.T @ residual / len(residual)
    diagonal = np.diag(np.diag(covariance))
    return (
        (1 - SHRINKAGE) * covariance
        + SHRINKAGE * diagonal
        + LEAST_SCATTER**2 * np.eye(len(covariance))
    )


def _distance(residual: Float, weight: Float) -> Float:
    return np.asarray(((residual @ weight) * residual).sum(axis=-1))
