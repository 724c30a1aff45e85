"""Liquid in a chamber: compression, free air, vapour."""

from typing import Any

from ..jit import kernel, power, subroutine
from ..scene.pump_hydraulics import STANDARD_ATMOSPHERE

_SERIES_REACH = 0.01  # of the absolute pressure: within it the series below is exact to 1e-13


@kernel
def air_volume(pressure: float, h: Any) -> float:
    """Volume of the air per volume of mixture at atmospheric pressure."""
    share: float = h.air_fraction * power(
        STANDARD_ATMOSPHERE / (pressure + STANDARD_ATMOSPHERE), h.air_power
    )
    return share


@kernel
def air_series(pressure: float, known: Any, h: Any) -> Any:
    """The same by a series about a known value, and whether that is close enough."""
    e = (pressure - known[0]) * known[2]
    k = h.air_power
    s = 1.0 - e * (k + 4.0) * 0.2
    s = 1.0 - e * (k + 3.0) * 0.25 * s
    s = 1.0 - e * (k + 2.0) * (1.0 / 3.0) * s
    s = 1.0 - e * (k + 1.0) * 0.5 * s
    return known[1] * (1.0 - e * k * s), abs(e) <= _SERIES_REACH


@kernel
def air_near(pressure: float, known: Any, h: Any) -> float:
    """The same: within a hundredth of a known value by the series, which is faster."""
    near, good = air_series(pressure, known, h)
    volume: float = near if good else _air_far(pressure, h)
    return volume


@subroutine
def _air_far(pressure: float, h: Any) -> float:
    """A separate call: the compiler would otherwise always evaluate the power and then select."""
    volume: float = air_volume(pressure, h)
    return volume


@kernel
def mixture_volume(pressure: float, air: float, h: Any) -> Any:
    """Volume of liquid and air over their volume at atmospheric pressure, with its slope.

    Parameters
    ----------
    pressure : float
        Gauge pressure [Pa], above vacuum.
    air : float
        Volume of the air at this pressure, see :func:`air_volume` and :func:`air_near`.
    h : record of dtype HYDRAULIC

    Returns
    -------
    v : float
        ``(1 - a) / (1 + p / B) + a (p_a / (p_a + p))^(1/n)``, with the air fraction a at
        atmospheric pressure p_a and the polytropic exponent n.
    slope : float
        dv/dp [1/Pa]; ``-v / slope`` is the bulk modulus of the mixture.

    Notes
    -----
    Mass is expressed as volume at atmospheric pressure, so that it is conserved exactly. Air
    neither dissolves nor comes out of solution; the liquid's density is linear in the pressure.

    References
    ----------
    Gholizadeh, Burton, Schoenau (2011), Fluid bulk modulus: a literature survey, International
    Journal of Fluid Power 12(3), 5-15, doi:10.1080/14399776.2011.10781033.

    Examples
    --------
    >>> from wearstate.sim.hydraulics.parameters import hydraulic_parameters
    >>> from wearstate.sim.scene.pump_hydraulics import CylinderPressure
    >>> h = hydraulic_parameters(
    ...     CylinderPressure(), area=1.0, crank_radius=0.05, rod_length=0.25, speed=0.0
    ... )[0]
    >>> v, slope = mixture_volume(0.0, air_volume(0.0, h), h)
    >>> round(v, 12), round(-v / slope / 1e6, 1)  # two per mille of air: a thirtieth of water's
    (1.0, 68.7)
    """
    stiff, absolute = h.bulk_modulus + pressure, pressure + STANDARD_ATMOSPHERE
    inverse = 1.0 / (stiff * absolute)  # one division for two
    softness = inverse * absolute
    liquid = (1.0 - h.air_fraction) * h.bulk_modulus * softness
    return liquid + air, -liquid * softness - h.air_power * air * inverse * stiff
