"""Does a recording look like anything the model was trained on? A calibrated answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

_SHARE = 0.95  # of the variance, kept as directions
_MOST_DIRECTIONS = 30  # more cannot be estimated from a few hundred recordings
_LEAST_SPREAD = 1e-6  # of the largest: a feature that never moved says nothing


@dataclass(frozen=True, kw_only=True)
class Familiarity:
    """The cloud of the training features: centre, spread, main directions.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_features,)]
        Mean and standard deviation of each feature.
    directions : numpy.ndarray [shape=(n_directions, n_features)]
        Orthonormal main directions of the standardised features.
    variance : numpy.ndarray [shape=(n_directions,)]
        Variance along each.
    residual : float
        Mean square of what the directions leave, per recording.
    """

    centre: Float
    spread: Float
    directions: Float
    variance: Float
    residual: float

    def distance(self, features: Float) -> Float:
        """Distance of recordings from the cloud: about 2 for a training recording.

        Parameters
        ----------
        features : numpy.ndarray [shape=(n_recordings, n_features)]

        Returns
        -------
        numpy.ndarray [shape=(n_recordings,)]
            Mean squared distance along the directions, in variances, plus the squared distance
            off them over its training mean.
        """
        standard = (features - self.centre) / self.spread
        along = standard @ self.directions.T
        off = np.maximum((standard**2).sum(axis=1) - (along**2).sum(axis=1), 0.0)
        return np.asarray((along**2 / self.variance).mean(axis=1) + off / self.residual)


def fit_familiarity(features: Float) -> Familiarity:
    """Learn the cloud of training features.

    Parameters
    ----------
    features : numpy.ndarray [shape=(n_recordings, n_features)]
        At least three recordings.

    Returns
    -------
    Familiarity
        Principal directions by singular values of the standardised features.

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
    standard = (features - centre) / spread
    _, singular, directions = np.linalg.svd(standard, full_matrices=False)
    variance = singular**2 / len(features)
    share = np.cumsum(variance) / variance.sum()
    kept = min(int(np.searchsorted(share, _SHARE)) + 1, _MOST_DIRECTIONS, len(features) // 3)
    kept = max(kept, 1)
    # at least rounding-sized, so that features of full rank in few directions divide by no zero
    residual = max(float(variance[kept:].sum()), 1e-9)
    return Familiarity(
        centre=centre,
        spread=spread,
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
        ``(1 + #{calibration >= distance}) / (n + 1)``: for a familiar recording at most alpha
        with probability alpha, whatever the distribution.

    Examples
    --------
    >>> novelty_p_value(5.0, np.arange(9.0))
    0.5
    """
    return float((1 + np.count_nonzero(calibration >= distance)) / (len(calibration) + 1))
