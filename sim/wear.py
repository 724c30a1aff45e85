"""Wear of a joint: grades of its clearance."""

from collections.abc import Sequence

import numpy as np

SEVERITY_BEYOND_LIMIT = 1.5
"""Data sets reach this multiple of the condemning limit, so that grade 3 has an inside."""


def grade(clearance: float, edges: Sequence[float]) -> int:
    """Wear grade of a clearance.

    Parameters
    ----------
    clearance : float
        [m], radial or diametral as `edges` are.
    edges : sequence of float
        Rising clearances [m] at which grades 1, 2, 3 begin; a clearance on an edge has the
        higher grade.

    Returns
    -------
    int
        0 as new, 1 worn, 2 plan the renewal, 3 condemned.

    Raises
    ------
    ValueError
        The clearance is negative or not finite.

    Examples
    --------
    >>> [grade(c * 1e-3, (0.13e-3, 0.22e-3, 0.31e-3)) for c in (0.05, 0.13, 0.3, 0.4)]
    [0, 1, 2, 3]
    """
    if not (np.isfinite(clearance) and clearance >= 0):
        raise ValueError(f"clearance = {clearance} m must be finite and >= 0; check the unit")
    return int(np.searchsorted(np.asarray(edges, dtype=float), clearance, side="right"))
