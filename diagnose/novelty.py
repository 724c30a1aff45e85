"""Does a recording look like anything the model was trained on? A calibrated answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

_SHARE = 0.95  # of the variance, kept as directions
_MOST_DIRECTIONS = 100
_LEAST_SPREAD = 1e-6  # of the largest: a feature that never moved says nothing
_CLIP = 5.0  # standard deviations: one wild feature must not stand for a strange recording


@dataclass(frozen=True, kw_only=True)
class Familiarity:
    """The cloud of the training features: centre, spread, main directions.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_features,)]
        Mean and standard deviation of each feature.
    shift : numpy.ndarray [shape=(n_features,)]
        Mean of the standardised features once they are clipped.
    directions : numpy.ndarray [shape=(n_directions, n_features)]
        Orthonormal main directions of the standardised features.
    variance : numpy.ndarray [shape=(n_directions,)]
        Variance along each.
    residual : float
        Mean square of what the directions leave, per recording.
    """

    centre: Float
    spread: Float
    shift: Float
    directions: Float
    variance: Float
    residual: float

    def distance(self, features: Float) -> Float:
        """Distance of recordings from the cloud: about 1 for a training recording.

        Parameters
        ----------
        features : numpy.ndarray [shape=(n_recordings, n_features)]

        Returns
        -------
        numpy.ndarray [shape=(n_recordings,)]
            The larger of two: the mean squared distance along the directions, in variances; the
            squared distance off them over its training mean.
        """
        standard = _standardised(features, self.centre, self.spread) - self.shift
        along = standard @ self.directions.T
        off = np.maximum((standard**2).sum(axis=1) - (along**2).sum(axis=1), 0.0)
        return np.asarray(np.maximum((along**2 / self.variance).mean(axis=1), off / self.residual))


def _standardised(features: Float, centre: Float, spread: Float) -> Float:
    return np.asarray(np.clip((features - centre) / spread, -_CLIP, _CLIP))


def fit_familiarity(features: Float) -> Familiarity:
    """Learn the cloud of training features.

    Parameters
    ----------
    features : numpy.ndarray [shape=(n_recordings, n_features)]
        At least three recordings.

    Returns
    -------
    Familiarity
        Principal directions by singular values of the standardised, clipped features.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> cloud = fit_familiarity(rng.standard_normal((100, 3)))
    >>> far, near = cloud.distance(np.array([[9.0, 9.0, 9.0], [0.1, 0.0, 0.2]]))
    >>> bool(far > 10 * near)
    True
    """
    centre, spread = features.mean(axis=0), features.std(axis=0)
    spread = np.maximum(spread, _LEAST_SPREAD * max(float(spread.max()), 1.0))
    standard = _standardised(features, centre, spread)
    shift = standard.mean(axis=0)
    _, singular, directions = np.linalg.svd(standard - shift, full_matrices=False)
    variance = singular**2 / len(features)
    share = np.cumsum(variance) / variance.sum()
    kept = min(int(np.searchsorted(share, _SHARE)) + 1, _MOST_DIRECTIONS, len(features) // 3)
    kept = max(kept, 1)
    # at least rounding-sized, so that features of full rank in few directions divide by no zero
    residual = max(float(variance[kept:].sum()), 1e-9)
    return Familiarity(
        centre=centre,
        spread=spread,
        shift=shift,
        directions=directions[:kept],
        variance=variance[:kept],
        residual=residual,
    )


def novelty_p_value(distance: float, calibration: Float) -> float:
    """Conformal p-value of "this recording comes from the training population".

    Parameters
    ----------
    distance : float
        Of the recording in question.
    calibration : numpy.ndarray [shape=(n,)]
        Distances of recordings that the cloud was not fitted on.

    Returns
    -------
    float
        ``(1 + #{calibration >= distance}) / (n + 1)``. For a recording exchangeable with the
        calibration it is at most alpha with probability alpha, whatever the distribution.

    Notes
    -----
    Here the calibration is out of fold: its clouds were fitted on four fifths of the machine
    draws, the recording's on all of them, which makes p slightly too large, so that a few less
    familiar recordings are refused than alpha says.

    Examples
    --------
    >>> novelty_p_value(5.0, np.arange(9.0))
    0.5
    """
    return float((1 + np.count_nonzero(calibration >= distance)) / (len(calibration) + 1))
