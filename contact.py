"""Contact in joints with clearance: stiffness, damping and restitution, and wear.

Examples
--------
>>> from wearstate import contact
>>> modulus = contact.effective_modulus(210e9, 0.3, 100e9, 0.33)
>>> f"{contact.conformal_stiffness(modulus, 0.03):.3g} N/m"
'3.56e+09 N/m'
"""

from .sim.contact.closed_forms import (
    conformal_stiffness,
    effective_modulus,
    hertz_sphere_stiffness,
    kelvin_voigt_restitution,
)
from .sim.contact.law import effective_restitution, floored_restitution, hysteresis
from .sim.wear.archard import (
    dufrane_depth,
    dufrane_volume,
    grade,
    scar_shape,
    sliding_work,
    wear_volume,
    widening,
)

__all__ = [
    "conformal_stiffness",
    "dufrane_depth",
    "dufrane_volume",
    "effective_modulus",
    "effective_restitution",
    "floored_restitution",
    "grade",
    "hertz_sphere_stiffness",
    "hysteresis",
    "kelvin_voigt_restitution",
    "scar_shape",
    "sliding_work",
    "wear_volume",
    "widening",
]
