"""Literature checks of journal bearings: rest, flow, friction, coefficients, stability."""

import math
from collections.abc import Callable
from functools import cache, partial

from ...sim.bearing.coefficients import coefficients, flow, friction
from ...sim.bearing.equilibrium import equilibrium, sommerfeld_number
from ...sim.bearing.short_bearing import short_coefficients, short_eccentricity
from ...sim.bearing.whirl import stability
from ...sim.film.solve import FilmGeometry, Groove


def _friswell_value(quantity: str) -> float:
    """Example 5.5.1: D 100 mm, L 30 mm, C 0.1 mm, 0.1 Pa s, 525 N, 1500 rpm."""
    load, clearance, speed = 525.0, 1e-4, 2 * math.pi * 25
    unit = 0.1 * speed * 0.05**3 * 0.03 / clearance**2
    e = short_eccentricity(load / unit / 0.3**2)
    c = short_coefficients(e)
    stiffness, damping = c.stiffness * load / clearance, c.damping * load / (clearance * speed)
    values = {
        "eccentricity ratio": e,
        "stiffness along the load [N/m]": stiffness[0, 0],
        "stiffness along by across [N/m]": stiffness[0, 1],
        "stiffness across by along [N/m]": stiffness[1, 0],
        "stiffness across the load [N/m]": stiffness[1, 1],
        "damping along the load [N s/m]": damping[0, 0],
        "damping coupled [N s/m]": damping[0, 1],
        "damping across the load [N s/m]": damping[1, 1],
    }
    return float(values[quantity])


_FRISWELL = (
    "eccentricity ratio",
    "stiffness along the load [N/m]",
    "stiffness along by across [N/m]",
    "stiffness across by along [N/m]",
    "stiffness across the load [N/m]",
    "damping along the load [N s/m]",
    "damping coupled [N s/m]",
    "damping across the load [N s/m]",
)


def _short_threshold(eccentricity: float, quantity: str) -> float:
    threshold = stability(short_coefficients(eccentricity))
    return threshold.whirl_ratio if quantity == "whirl ratio" else threshold.speed


@cache
def _grooved_bearing(length_to_diameter: float, s: float, width: float) -> dict[str, float]:
    """Two axial grooves across the load.

    Error of the mesh: 0.2 % of the largest coefficient of its kind. Small ones beside it are less
    sure of themselves: Cyy at S 0.042, an eleventh of Cxx, is 0.6 % low.
    """
    grooves = tuple(Groove(angle=angle, width=width) for angle in (math.pi / 2, -math.pi / 2))
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter, n_theta=144, n_z=25, grooves=grooves
    )
    found = equilibrium(geometry, [sommerfeld_number(s), 0.0])
    c = coefficients(found).per_load(found.load[0])
    return {
        "eccentricity ratio": found.eccentricity_ratio,
        "attitude angle [deg]": math.degrees(found.attitude_angle),
        **dict(zip(("Kxx", "Kxy", "Kyx", "Kyy"), c.stiffness.ravel().tolist(), strict=True)),
        **dict(zip(("Cxx", "Cxy", "Cyx", "Cyy"), c.damping.ravel().tolist(), strict=True)),
    }


def _grooved_value(length_to_diameter: float, s: float, degrees: float, quantity: str) -> float:
    return _grooved_bearing(length_to_diameter, s, math.radians(degrees))[quantity]


@cache
def _plain_bearing(length_to_diameter: float, s: float) -> dict[str, float]:
    geometry = FilmGeometry(
        length_to_diameter=length_to_diameter, n_theta=144, n_z=25, condition="reynolds"
    )
    found = equilibrium(geometry, [sommerfeld_number(s), 0.0])
    oil = flow(found)
    return {
        "attitude angle [deg]": math.degrees(found.attitude_angle),
        "friction variable": friction(found) / float(found.load[0]),
        "flow variable": oil.through,
        "side flow over flow": oil.side / oil.through,
    }


def _plain_value(length_to_diameter: float, s: float, quantity: str) -> float:
    return _plain_bearing(length_to_diameter, s)[quantity]


_LUND_THOMSEN = ((0.5, 6.43), (0.5, 1.656), (0.5, 0.378), (0.5, 0.042), (1.0, 0.635))
_RAIMONDI_BOYD = (
    (1.0, 0.631),
    (1.0, 0.121),
    (1.0, 0.0188),
    (0.5, 2.03),
    (0.5, 0.319),
    (0.5, 0.0313),
)
_SOMEYA = ((0.5, 1.24), (0.5, 0.517))


def journal_checks() -> dict[str, Callable[[], float]]:
    """Checks of journals at rest on their films, and of their coefficients."""
    return {
        **{
            f"short bearing after Friswell: {quantity}": partial(_friswell_value, quantity)
            for quantity in _FRISWELL
        },
        **{
            f"short bearing, eccentricity {e:g}: {quantity}": partial(_short_threshold, e, quantity)
            for e in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75)
            for quantity in ("whirl ratio", "threshold speed")
        },
        **{
            f"Lund-Thomsen, L/D {ratio:g}, S {s:g}: {quantity}": partial(
                _grooved_value, ratio, s, 20.0, quantity
            )
            for ratio, s in _LUND_THOMSEN
            for quantity in (
                "eccentricity ratio",
                "attitude angle [deg]",
                *("Kxx", "Kxy", "Kyx", "Kyy", "Cxx", "Cxy", "Cyy"),
            )
        },
        **{
            f"Raimondi-Boyd, L/D {ratio:g}, S {s:g}: {quantity}": partial(
                _plain_value, ratio, s, quantity
            )
            for ratio, s in _RAIMONDI_BOYD
            for quantity in (
                "attitude angle [deg]",
                "friction variable",
                "flow variable",
                "side flow over flow",
            )
        },
        **{
            f"Someya, L/D {ratio:g}, S {s:g}: {quantity}": partial(
                _grooved_value, ratio, s, 10.0, quantity
            )
            for ratio, s in _SOMEYA
            for quantity in ("attitude angle [deg]", "Cxx", "Cxy", "Cyy")
        },
    }
