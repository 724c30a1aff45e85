"""Viscosity of oil from its temperature: Walther (ASTM D341) and Vogel."""

import math
from collections.abc import Sequence

_WALTHER_SHIFT = 0.7  # mm^2/s, ASTM D341
_WALTHER_LEAST = 2.0  # mm^2/s; below, ASTM D341 adds terms
_SQUARE_MILLIMETRE = 1e-6  # m^2


def walther_viscosity(
    temperature: float, points: Sequence[tuple[float, float]], *, density: float
) -> float:
    """Dynamic viscosity of a mineral oil known at two temperatures [Pa s].

    Parameters
    ----------
    temperature : float
        Absolute [K].
    points : sequence of two (float, float)
        Temperatures [K] and kinematic viscosities there [m^2/s], as a data sheet gives them for
        40 and 100 degrees Celsius.
    density : float
        At the temperature asked for [kg/m^3].

    Returns
    -------
    float

    Raises
    ------
    ValueError
        A value is out of range, the two temperatures are one, or the kinematic viscosity asked
        for or given is below 2 mm^2/s, where this form ends.

    Notes
    -----
    ``log10 log10(nu + 0.7) = A - B log10 T`` with nu in mm^2/s. Within a few per cent between the
    points and some tens of kelvin beyond; not below the cloud point, and for oils with thickeners
    only at low shear.

    References
    ----------
    ASTM D341. Walther (1931), Erdoel und Teer 7, 382-384.

    Examples
    --------
    >>> vg32 = (313.15, 32e-6), (373.15, 5.4e-6)
    >>> round(walther_viscosity(323.15, vg32, density=850.0), 4)
    0.0183
    """
    if not density > 0:
        raise ValueError(f"density = {density} kg/m^3 must be > 0; oil has about 860")
    (t_1, nu_1), (t_2, nu_2) = points
    for t in (temperature, t_1, t_2):
        if not 0 < t < math.inf:
            raise ValueError(f"temperature = {t} K must be > 0 and absolute; add 273.15")
    if t_1 == t_2:
        raise ValueError(f"both points are at {t_1} K and must differ; give 40 and 100 deg C")
    w_1, w_2 = (_walther(nu / _SQUARE_MILLIMETRE) for nu in (nu_1, nu_2))
    share = math.log(temperature / t_1) / math.log(t_2 / t_1)
    nu = 10 ** (10 ** (w_1 + share * (w_2 - w_1))) - _WALTHER_SHIFT
    _walther(nu)
    return nu * _SQUARE_MILLIMETRE * density


def _walther(nu: float) -> float:
    if not _WALTHER_LEAST <= nu < math.inf:
        raise ValueError(
            f"kinematic viscosity = {nu:g} mm^2/s must be >= {_WALTHER_LEAST:g} for this form; "
            "fit vogel_viscosity to measured points instead"
        )
    return math.log10(math.log10(nu + _WALTHER_SHIFT))


def vogel_viscosity(temperature: float, points: Sequence[tuple[float, float]]) -> float:
    """Dynamic viscosity of an oil known at three temperatures [Pa s].

    Parameters
    ----------
    temperature : float
        Absolute [K].
    points : sequence of three (float, float)
        Temperatures [K] and dynamic viscosities there [Pa s].

    Returns
    -------
    float

    Raises
    ------
    ValueError
        The three points are not on such a curve, or the temperature is not above its pole.

    Notes
    -----
    ``eta = a exp(b / (T - c))``; c follows from the slopes of the logarithm between the points.
    Within about 1 % between the points; useless near the pole c, 150 to 200 K for most oils.

    References
    ----------
    Vogel (1921), Physikalische Zeitschrift 22, 645-646.

    Examples
    --------
    >>> points = (293.15, 0.0829), (313.15, 0.0272), (373.15, 0.0043)
    >>> round(vogel_viscosity(323.15, points), 4)
    0.0177
    """
    ordered = sorted(points)
    (t_1, e_1), (t_2, e_2), (t_3, e_3) = ordered
    if not (0 < t_1 < t_2 < t_3 < math.inf and e_1 > e_2 > e_3 > 0):
        raise ValueError(
            f"points = {ordered} must be at three absolute temperatures, with a viscosity > 0 "
            "that falls as it gets warmer"
        )
    # ln eta = ln a + b / (T - c): the slopes of two chords are as (t_3 - c) to (t_1 - c)
    ratio = math.log(e_1 / e_2) / (t_2 - t_1) / (math.log(e_2 / e_3) / (t_3 - t_2))
    pole = (ratio * t_1 - t_3) / (ratio - 1.0) if ratio > 1.0 else -math.inf
    if not 0 <= pole < min(t_1, temperature):
        raise ValueError(
            f"temperature = {temperature} K must be above the pole of the curve, {pole:.4g} K, "
            "which must be between 0 K and the first point; check the points"
        )
    b = math.log(e_1 / e_2) / (1 / (t_1 - pole) - 1 / (t_2 - pole))
    return e_1 * math.exp(b / (temperature - pole) - b / (t_1 - pole))
