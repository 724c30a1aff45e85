"""Load, attitude and coefficients of a short bearing, in closed form."""

import math

import numpy as np

from ..film.slopes import Coefficients

MOST_ITERATIONS = 60  # a handful from a fair start


def short_load(eccentricity_ratio: float) -> float:
    """Load of Ocvirk's short bearing, half film, over ``(L / D)^2``.

    Parameters
    ----------
    eccentricity_ratio : float
        0 <= e < 1.

    Returns
    -------
    float
        ``e sqrt(pi^2 (1 - e^2) + 16 e^2) / (1 - e^2)^2``.

    Raises
    ------
    ValueError
        The eccentricity ratio is outside [0, 1).

    Examples
    --------
    >>> round(1 / (math.pi * short_load(0.266298)) / 0.3**2, 3)  # Friswell et al., 5.5.1
    3.571
    """
    e = _eccentricity(eccentricity_ratio, least=0.0)
    return e * math.sqrt(math.pi**2 * (1 - e**2) + 16 * e**2) / (1 - e**2) ** 2


def short_attitude(eccentricity_ratio: float) -> float:
    """Attitude angle of Ocvirk's short bearing, half film [rad].

    ``tan phi = pi sqrt(1 - e^2) / (4 e)``, from pi/2 at the centre to 0 at the wall.

    Parameters
    ----------
    eccentricity_ratio : float
        From 0 to below 1.

    Returns
    -------
    float
        Angle from the load to the journal centre [rad].

    Examples
    --------
    >>> round(math.degrees(short_attitude(0.266298)), 2)
    70.62
    """
    e = _eccentricity(eccentricity_ratio, least=0.0)
    return math.atan2(math.pi * math.sqrt(1 - e**2), 4 * e)


def short_eccentricity(load: float) -> float:
    """Eccentricity ratio of Ocvirk's short bearing: the inverse of :func:`short_load`.

    Parameters
    ----------
    load : float
        Non-dimensional load over ``(L / D)^2``, >= 0.

    Returns
    -------
    float
        0 <= e < 1.

    Raises
    ------
    ValueError
        The load is negative or not finite.

    Examples
    --------
    >>> round(short_eccentricity(1 / (math.pi * 3.571429 * 0.3**2)), 5)
    0.2663
    """
    if not 0 <= load < math.inf:
        raise ValueError(f"load = {load} must be >= 0 and finite; give its magnitude")
    if load == 0:
        return 0.0
    logit = math.log(load / math.pi) / 2  # approximate at both ends
    for _ in range(MOST_ITERATIONS):
        e = 1 / (1 + math.exp(-logit))
        root = math.pi**2 * (1 - e**2) + 16 * e**2
        slope = 1 + (16 - math.pi**2) * e**2 / root + 4 * e**2 / (1 - e**2)
        step = math.log(short_load(e) / load) / (slope * (1 - e))
        logit -= step
        if abs(step) < 1e-14 * max(1.0, abs(logit)):
            break
    return 1 / (1 + math.exp(-logit))


def short_coefficients(eccentricity_ratio: float) -> Coefficients:
    """Eight coefficients of Ocvirk's short bearing, half film: ``k C / W``, ``c C omega / W``.

    Parameters
    ----------
    eccentricity_ratio : float
        0 < e < 1.

    Returns
    -------
    Coefficients [shape=(2, 2)]
        X along the load, Y a quarter turn further in the sense of rotation.

    Raises
    ------
    ValueError
        The eccentricity ratio is outside (0, 1).

    Notes
    -----
    With ``p = pi^2``, ``q = 1 - e^2`` and ``h = (p q + 16 e^2)^(-3/2)``::

        Kxx = 4 h (p (1 + 2 e^2) + 32 e^2 (1 + e^2) / q)       Kyy = 4 h (p (2 - e^2) + 16 e^2)
        Kxy =  pi h (p q (1 + 2 e^2) + 32 e^2 (1 + e^2)) / (e sqrt q)
        Kyx = -pi h (p q^2 - 16 e^4) / (e sqrt q)
        Cxx = 2 pi h (p q^2 + 48 e^2) / (e sqrt q)
        Cyy = 2 pi h sqrt(q) (p (1 + 2 e^2) - 16 e^2) / e
        Cxy = Cyx = 8 h (p (1 + 2 e^2) - 16 e^2)

    Valid for L / D up to about 1/2 and e up to about 0.7.

    References
    ----------
    Friswell, Penny, Garvey, Lees (2010), Dynamics of Rotating Machines, Cambridge University
    Press, 177-181; its u is -Y here, its v is X.

    Examples
    --------
    >>> c = short_coefficients(0.266298)
    >>> [round(float(k) * 525 / 1e-4 / 1e6, 3) for k in c.stiffness.ravel()]  # MN/m
    [8.815, 25.06, -16.394, 12.808]
    """
    e = _eccentricity(eccentricity_ratio, least=np.nextafter(0.0, 1.0))
    p, q = math.pi**2, 1 - e**2
    h = (p * q + 16 * e**2) ** -1.5
    side = math.pi * h / (e * math.sqrt(q))
    bend = p * (1 + 2 * e**2)
    wall = 32 * e**2 * (1 + e**2)
    direct, cross = bend + wall / q, side * (bend * q + wall)
    stiffness = [[4 * h * direct, cross], [side * (16 * e**4 - p * q**2), 0.0]]
    stiffness[1][1] = 4 * h * (p * (2 - e**2) + 16 * e**2)
    coupled = 8 * h * (bend - 16 * e**2)
    across = 2 * side * q * (bend - 16 * e**2)
    damping = [[2 * side * (p * q**2 + 48 * e**2), coupled], [coupled, across]]
    return Coefficients(np.array(stiffness), np.array(damping))


def _eccentricity(value: float, *, least: float) -> float:
    if not least <= value < 1:
        bound = "[0, 1)" if least == 0 else "(0, 1)"
        raise ValueError(
            f"eccentricity_ratio = {value} must be in {bound}; it is the distance of the centres "
            "over the radial clearance"
        )
    return value
