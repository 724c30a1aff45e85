"""Viscosity of oil from its temperature: Walther (ASTM D341) and Vogel."""

import math
from collections.abc import Sequence

_WALTHER_SHIFT = 0.7  # mm^2/s, ASTM D341
_WALTHER_LEAST = 2.0  # mm^2/s; below, ASTM D341 has additional terms
_SQUARE_MILLIMETRE = 1e-6  # m^2


def walther_viscosity(
    temperature: float, points: Sequence[tuple[float, float]], *, density: float
) -> float:
    """Dynamic viscosity of a mineral oil from values at two temperatures [Pa s].

    Parameters
    ----------
    temperature : float
        Absolute temperature [K].
    points : sequence of two (float, float)
        Temperatures [K] and kinematic viscosities there [m^2/s], as a data sheet gives them for
        40 and 100 degrees Celsius.
    density : float
        Density at `temperature` [kg/m^3].

    Returns
    -------
    float

    Raises
    ------
    ValueError
        A value is out of range, the two temperatures are equal, or a kinematic viscosity, given or
        resulting, is below 2 mm^2/s, the limit of this form.

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
            "give the viscosity at the temperature of the film instead"
        )
    return math.log10(math.log10(nu + _WALTHER_SHIFT))
