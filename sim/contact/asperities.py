"""Rough surfaces of a pin in a close bore: load on their asperities, compiled.

Sources: Greenwood, Tripp (1971), Proceedings of the Institution of Mechanical Engineers 185,
625-633, for the pressure of two rough surfaces; Hu, Cheng, Arai, Kobayashi, Aoyama (1994), J.
Tribology 116(1), 1-8, for the power law that approximates its integral.
"""

import math
from typing import Any

from ..jit import kernel

SEPARATION = 4.0
"""Gap over the roughness above which no asperities touch."""

_POWER = 6.804  # of the pressure
_FACTOR = 4.4086e-5  # of the pressure
_LINE_POWER = _POWER + 0.5  # of the force of a pin in a close bore


def asperity_scale(
    roughness: float, radius: float, length: float, clearance: float, stiffness: float
) -> float:
    """Factor of :func:`asperity_force` [N].

    Parameters
    ----------
    roughness : float
        Root of the sum of both surfaces' mean square roughness [m].
    radius, length, clearance : float
        Dimensions of the pin; clearance radial [m].
    stiffness : float
        Pressure ``16 sqrt(2) pi / 15 (s b n)^2 sqrt(s / b) E*`` of the pair, with roughness s,
        radius b and density n of the asperities [Pa]; about 0.003 times E*.

    Notes
    -----
    The pressure is ``stiffness F(h / s)`` with ``F(u) = 4.4086e-5 (4 - u)^6.804``. Near the least
    gap g the gap is ``h = g + c t^2 / 2`` thick, so that the force per length is the integral of
    a power over a parabola, Euler's beta function. Valid if the asperities touch over less than
    half a radian: ``8 s << c``.

    Examples
    --------
    >>> round(asperity_scale(0.5e-6, 0.03, 0.05, 0.05e-3, 160e6), 6)
    0.964706
    """
    beta = math.gamma(0.5) * math.gamma(_POWER + 1.0) / math.gamma(_POWER + 1.5)
    return stiffness * _FACTOR * length * radius * math.sqrt(2.0 * roughness / clearance) * beta


@kernel
def asperity_force(gap: float, roughness: float, scale: float) -> Any:
    """Force of the asperities, and minus its derivative by the gap.

    Parameters
    ----------
    gap : float
        Least gap between the mean surfaces [m]; negative for an overlap.
    roughness, scale : float
        See :func:`asperity_scale` [m], [N].

    Returns
    -------
    tuple of float
        Force [N], derivative [N/m]; zeros from four roughnesses on.
    """
    if roughness <= 0.0 or gap >= SEPARATION * roughness:
        return 0.0, 0.0
    closed = SEPARATION - gap / roughness
    force = scale * closed**_LINE_POWER
    return force, _LINE_POWER * force / (roughness * closed)
