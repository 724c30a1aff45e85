"""Archard wear: worn volume of a sliding contact, its distribution, and wear grades.

The worn volume is ``V = k int |F| |v| dt`` with the specific wear rate k [m^2/N, that is m^3 per N
and m of sliding], for any distribution of pressure: 1 mm^3/(N m) is 1e-9 m^2/N. The distribution
determines where the surface is lowered.

Sources: Archard (1953), "Contact and rubbing of flat surfaces", J. Applied Physics 24, 981-988,
doi:10.1063/1.1721448; Mukras, Kim, Mauntler, Schmitz, Sawyer (2010), "Comparison between elastic
foundation and contact force models in wear analysis of planar multibody system", J. Tribology 132,
031604; Dufrane, Kannel, McCloskey (1983), "Wear of steam turbine journal bearings at low operating
speeds", J. Lubrication Technology 105(3).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

WEAR_RATE_MOST = 1e-9
"""Largest specific wear rate [m^2/N], 1 mm^3/(N m): dry metal galls at 1e-11. A larger number has
another unit."""

ANGLES = 360
"""Default number of positions round the circumference of a scar."""


def grade(clearance: float, edges: Sequence[float]) -> int:
    """Wear grade of a clearance.

    Parameters
    ----------
    clearance : float
        Clearance [m], radial or diametral like `edges`.
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


# --- volume


def sliding_work(force: ArrayLike, speed: ArrayLike, step: float) -> float:
    """Contact force times sliding distance, summed over a run.

    Parameters
    ----------
    force : array_like [shape=(n,)]
        Normal force, means over equal steps [N]; the sign is ignored.
    speed : array_like [shape=(n,)]
        Sliding speed, means over the same steps [m/s]; the sign is ignored.
    step : float
        Time step [s].

    Returns
    -------
    float
        ``int |F| |v| dt`` [N m].

    Raises
    ------
    ValueError
        The step is not above zero.

    Examples
    --------
    A bush under 100 N, turned by 0.5 m/s for a second:

    >>> sliding_work(np.full(1000, 100.0), np.full(1000, -0.5), 1e-3)
    50.0
    """
    if not step > 0:
        raise ValueError(f"step = {step} s must be > 0; give the time between the values")
    return float(np.sum(np.abs(np.multiply(force, speed)))) * step


def wear_volume(wear_rate: float, work: float) -> float:
    """Worn volume from sliding, after Archard.

    Parameters
    ----------
    wear_rate : float
        Specific wear rate k [m^2/N], 0 <= k <= 1e-9.
    work : float
        Result of :func:`sliding_work` [N m], >= 0.

    Returns
    -------
    float
        Volume [m^3].

    Raises
    ------
    ValueError
        Rate or work is out of range; all faults together.

    Notes
    -----
    Valid for mild, steady sliding wear; not for scuffing or impact wear.

    Examples
    --------
    A PTFE bush of 5.05e-4 mm^3/(N m) after 1 MJ of sliding, in mm^3:

    >>> round(wear_volume(5.05e-4 * 1e-9, 1e6) * 1e9)
    505
    """
    faults = []
    if not 0 <= wear_rate <= WEAR_RATE_MOST:
        faults.append(
            f"wear_rate = {wear_rate} m^2/N must be >= 0 and <= {WEAR_RATE_MOST:g}; "
            "1 mm^3/(N m) is 1e-9 m^2/N"
        )
    if not (math.isfinite(work) and work >= 0):
        faults.append(f"work = {work} N m must be finite and >= 0; it is the integral of |F| |v|")
    if faults:
        raise ValueError("; ".join(faults))
    return wear_rate * work


# --- scar


def scar_shape(
    direction: ArrayLike,
    work: ArrayLike,
    *,
    bed_half_angle: float = math.pi / 2,
    n_angles: int = ANGLES,
) -> Float:
    """Distribution of wear on a round surface: its share per radian of circumference.

    Parameters
    ----------
    direction : array_like [shape=(n,)]
        Direction of the contact, in a frame that rotates with the surface [rad].
    work : array_like [shape=(n,)]
        Wear in each direction, in any unit, >= 0.
    bed_half_angle : float
        Half the arc of contact, in (0, pi/2] [rad].
    n_angles : int
        Positions round the circumference, >= 8.

    Returns
    -------
    numpy.ndarray [shape=(n_angles,)]
        At ``2 pi i / n_angles`` [1/rad]; its mean is ``1 / (2 pi)``. Times volume over radius and
        width it is the depth of wear [m].

    Raises
    ------
    ValueError
        There is no wear, or an argument is out of range; all faults together.

    Notes
    -----
    The pressure decreases as a cosine from the direction of the force to the ends of the bed, as in
    a bush run in on its pin. The distribution does not affect the volume.

    Examples
    --------
    A force that stays in place wears a cosine of half a turn, one that goes round wears evenly:

    >>> still = scar_shape([0.0], [1.0], n_angles=8)
    >>> (still / still[0]).round(3).tolist()
    [1.0, 0.707, 0.0, 0.0, 0.0, 0.0, 0.0, 0.707]
    >>> round_about = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    >>> (2 * np.pi * scar_shape(round_about, np.ones(8), n_angles=8)).round(9).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    """
    weight = np.asarray(work, dtype=float)
    _refuse_scar(weight, bed_half_angle, n_angles)
    place = np.mod(np.asarray(direction, dtype=float) * n_angles / math.tau, n_angles)
    below = np.floor(place).astype(np.intp)
    upper = place - below  # share of the neighbour: no jumps between bins
    loaded = np.bincount(below % n_angles, weight * (1 - upper), n_angles)
    loaded += np.bincount((below + 1) % n_angles, weight * upper, n_angles)
    bed = _bed(bed_half_angle, n_angles)
    spread = np.fft.irfft(np.fft.rfft(loaded) * np.fft.rfft(bed), n_angles)
    spread = np.maximum(spread, 0.0)  # rounding of the transforms
    return np.asarray(spread * n_angles / (math.tau * spread.sum()))


def _bed(half_angle: float, n_angles: int) -> Float:
    """Share of the pressure at every position, for a force along the first."""
    turn = np.arange(n_angles)
    away = math.tau * np.minimum(turn, n_angles - turn) / n_angles
    inside = away < half_angle
    return np.where(inside, np.cos(0.5 * math.pi * np.minimum(away / half_angle, 1.0)), 0.0)


def _refuse_scar(work: Float, bed_half_angle: float, n_angles: int) -> None:
    faults = []
    if not (np.isfinite(work).all() and (work >= 0).all() and work.sum() > 0):
        faults.append(f"work adds up to {work.sum()}, must be >= 0 each and > 0 in all")
    if not 0 < bed_half_angle <= math.pi / 2:
        faults.append(f"bed_half_angle = {bed_half_angle} rad must be > 0 and <= pi/2")
    if n_angles < 8:
        faults.append(f"n_angles = {n_angles} must be >= 8")
    if faults:
        raise ValueError("; ".join(faults))


def widening(shape: Float, radius: float, width: float) -> float:
    """Diametral clearance gained per volume, at the position of the largest gain.

    Parameters
    ----------
    shape : numpy.ndarray [shape=(n_angles,)]
        Result of :func:`scar_shape`, with an even number of positions.
    radius, width : float
        Dimensions of the surface [m].

    Returns
    -------
    float
        Clearance gained along the most worn diameter over the volume [1/m^2]: 1 over pi times
        radius times width for uniform wear, at most pi/2 times that in a bed of half a turn.

    Examples
    --------
    0.1 mm is to go all round a bush of 60 mm by 50 mm:

    >>> even = np.full(360, 1 / (2 * np.pi))
    >>> volume = 2 * np.pi * 0.03 * 0.05 * 0.1e-3
    >>> round(1e3 * volume * widening(even, 0.03, 0.05), 12)
    0.2
    """
    opposite = np.roll(shape, shape.size // 2)
    return float((shape + opposite).max()) / (radius * width)


def dufrane_volume(depth: float, clearance: float, radius: float, width: float) -> float:
    """Volume of a scar with the shape of the shaft's circle.

    Parameters
    ----------
    depth : float
        Deepest wear [m], >= 0 and below twice the clearance.
    clearance : float
        Radial clearance of the unworn bore [m].
    radius, width : float
        Dimensions of the bore [m].

    Returns
    -------
    float
        ``R L int max(0, depth - C (1 - cos theta)) dtheta`` [m^3]; grows as depth to the power
        3/2 while the scar is shallow.

    Raises
    ------
    ValueError
        The depth is out of range.

    References
    ----------
    Dufrane, Kannel, McCloskey (1983), as above; the same shape as
    :func:`wearstate.sim.film.solve.dufrane_scar`.

    Examples
    --------
    >>> round(dufrane_volume(28e-6, 70e-6, 0.05, 0.06) * 1e9, 1)  # in mm^3
    102.3
    """
    if not 0 <= depth < 2 * clearance:
        raise ValueError(
            f"depth = {depth} m must be >= 0 and < twice the clearance = {2 * clearance} m; "
            "a deeper scar reaches round the bore"
        )
    # acos(1 - depth / C) without the cancellation of a shallow scar
    half = 2 * math.asin(math.sqrt(0.5 * depth / clearance))
    return 2 * radius * width * clearance * _segment(half)


def _segment(half: float) -> float:
    """Half the scar's cross-section over radius times clearance, from half its angle [rad]."""
    if half < _SHALLOW:
        return half**3 / 3 * (1 - half**2 / 10 + half**4 / 280)
    return math.sin(half) - math.cos(half) * half


_SHALLOW = 0.03
"""Below, the difference loses digits; the series' relative error is less than 1e-13."""


def dufrane_depth(volume: float, clearance: float, radius: float, width: float) -> float:
    """Depth of the scar of a given volume: the inverse of :func:`dufrane_volume`.

    Parameters
    ----------
    volume : float
        Volume [m^3], >= 0.
    clearance, radius, width : float
        As in :func:`dufrane_volume` [m].

    Returns
    -------
    float
        Depth at the deepest position [m].

    Raises
    ------
    ValueError
        The volume exceeds that of the largest scar.

    Examples
    --------
    >>> volume = dufrane_volume(28e-6, 70e-6, 0.05, 0.06)
    >>> round(dufrane_depth(volume, 70e-6, 0.05, 0.06) * 1e6, 9)
    28.0
    """
    largest = math.tau * radius * width * clearance
    if not 0 <= volume < largest:
        raise ValueError(
            f"volume = {volume} m^3 must be >= 0 and < {largest:g} m^3, where a scar reaches round "
            "the bore"
        )
    low, high = 0.0, math.pi
    share = volume / (2 * radius * width * clearance)
    for _ in range(_HALVINGS):  # of the half angle: the volume is a smooth, rising function of it
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _segment(middle) < share else (low, middle)
    return 2 * clearance * math.sin(0.25 * (low + high)) ** 2


_HALVINGS = 60  # of pi: to the last digit
