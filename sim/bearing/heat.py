"""Heat balance of a film: the temperature at which its oil runs.

Friction heats the oil; what flows through and what the metal conducts carry the heat away,

    (rho c Q + G) (T - T0) = P(eta(T)),

with the flow Q that comes in at T0, the conductance G to surroundings at T0, and one mean
temperature T of the film. The left side rises with T and the right side falls, as oil thins when
it warms, so there is one solution, between T0 and ``T0 + P(eta(T0)) / (rho c Q + G)``.
"""

import math
from collections.abc import Callable

from .short_bearing import short_eccentricity

_SETTLED = 1e-9  # of the warming
_HALVINGS = 60


def friction_power(
    viscosity: float,
    *,
    spin: float,
    load: float,
    radius: float,
    length: float,
    gap: float,
) -> float:
    """Friction power of a film at rest under a load, with Petroff's shear over its thinning.

    Parameters
    ----------
    viscosity : float
        Dynamic [Pa s].
    spin : float
        Of the surfaces against each other, root of the mean square [rad/s].
    load : float
        Root of its mean square [N].
    radius, length, gap : float
        Of the pin, of the land, radial clearance [m].

    Returns
    -------
    float
        ``2 pi eta w^2 R^3 L / (c sqrt(1 - e^2))`` with the eccentricity ratio e of Ocvirk's short
        bearing under this load [W].

    Notes
    -----
    A moving load squeezes the film: over a turn of a pump's crank pin the mean of
    ``1 / sqrt(1 - e^2)`` was 5 to 30 % off that at rest where surfaces did not touch.

    Examples
    --------
    Without a load it is Petroff's.

    >>> geometry = {"radius": 0.03, "length": 0.05, "gap": 1e-4}
    >>> round(friction_power(0.06, spin=30.0, load=0.0, **geometry), 3)
    4.58
    """
    petroff = math.tau * viscosity * spin**2 * radius**3 * length / gap
    if petroff == 0:
        return 0.0
    unit = viscosity * spin * radius * length**3 / (4 * gap**2)
    return petroff / math.sqrt(1 - short_eccentricity(load / unit) ** 2)


def film_temperature(
    inlet: float, power: Callable[[float], float], carried_per_kelvin: float
) -> float:
    """Temperature at which a film gives off as much heat as its friction makes [K].

    Parameters
    ----------
    inlet : float
        T0, of the oil that comes in and of the surroundings [K].
    power : callable
        Friction power [W] at a temperature [K], not rising. It may raise ValueError where the oil
        is too hot for its law of viscosity: the film is then cooler than that.
    carried_per_kelvin : float
        ``rho c Q + G`` > 0 [W/K].

    Returns
    -------
    float
        To a thousand-millionth of the warming.

    Raises
    ------
    ValueError
        Nothing carries the heat away.

    Examples
    --------
    A power of 100 W at the inlet that falls by 1 W/K, and 9 W/K carried: 10 K.

    >>> round(film_temperature(300.0, lambda t: 100.0 - (t - 300.0), 9.0), 6)
    310.0
    """
    if not carried_per_kelvin > 0:
        raise ValueError(
            f"heat carried away = {carried_per_kelvin:g} W/K must be > 0; give the oil a flow or "
            "its metal a conductance"
        )
    low, high = 0.0, power(inlet) / carried_per_kelvin
    for _ in range(_HALVINGS):
        if high - low <= _SETTLED * high:
            break
        middle = 0.5 * (low + high)
        try:
            made = power(inlet + middle)
        except ValueError:  # thinner than its law knows, so that it makes less heat than is carried
            made = 0.0
        if made > carried_per_kelvin * middle:
            low = middle
        else:
            high = middle
    return inlet + high
