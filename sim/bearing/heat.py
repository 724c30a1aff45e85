"""Heat balance of a film: its operating temperature.

Friction heats the oil; the oil flow and conduction through the metal carry the heat away,

    (rho c Q + G) (T - T0) = P(eta(T)),

with the flow Q entering at T0, the conductance G to surroundings at T0, and one mean
temperature T of the film. The left side rises with T and the right side falls, as warm oil is
thinner, so there is one solution, between T0 and ``T0 + P(eta(T0)) / (rho c Q + G)``.
"""

import math
from collections.abc import Callable

from .short_bearing import short_eccentricity

_SETTLED = 1e-9  # of the temperature rise
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
    """Friction power of a film at rest under a load: Petroff's shear, increased by eccentricity.

    Parameters
    ----------
    viscosity : float
        Dynamic viscosity [Pa s].
    spin : float
        Relative angular velocity of the surfaces, root mean square [rad/s].
    load : float
        Root mean square load [N].
    radius, length, gap : float
        Radius of the pin, length of the land, radial clearance [m].

    Returns
    -------
    float
        ``2 pi eta w^2 R^3 L / (c sqrt(1 - e^2))`` with the eccentricity ratio e of Ocvirk's short
        bearing under this load [W].

    Notes
    -----
    A moving load squeezes the film: over a revolution of a pump's crank pin the mean of
    ``1 / sqrt(1 - e^2)`` was 5 to 30 % off that at rest, if the surfaces did not touch.

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
    """Temperature at which a film's heat losses equal its friction power [K].

    Parameters
    ----------
    inlet : float
        T0, of the supplied oil and of the surroundings [K].
    power : callable
        Friction power [W] at a temperature [K], not rising. It may raise ValueError if the oil
        is too hot for its law of viscosity: the film is then cooler.
    carried_per_kelvin : float
        ``rho c Q + G`` > 0 [W/K].

    Returns
    -------
    float
        Accurate to 1e-9 of the temperature rise.

    Raises
    ------
    ValueError
        The heat has no way out.

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
        except ValueError:  # thinner than its law allows: less heat produced than carried away
            made = 0.0
        if made > carried_per_kelvin * middle:
            low = middle
        else:
            high = middle
    return inlet + high
