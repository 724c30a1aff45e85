"""Normal and friction laws of a clearance joint, compiled.

Laws are scene choices, selected by an integer code. All act on the *rod* end of a joint: the
normal force along the direction from the eye's centre to the pin's, the tangential one along the
sliding velocity of the pin over the eye.
"""

import math

from .jit import kernel

RELEASE_AT_ZERO_FORCE = 0
RELEASE_AT_ZERO_PENETRATION = 1


@kernel
def kelvin_voigt(
    penetration: float, approach_speed: float, stiffness: float, damping: float
) -> float:
    """Spring and dashpot in parallel: ``F = K d + C d'`` [N].

    The dashpot makes the force jump at first touch and turn negative before the surfaces part;
    the solver releases the contact where the force reaches zero. Source: eq. 12 of Xia et al.
    2017, the pump paper.
    """
    return stiffness * penetration + damping * approach_speed


@kernel
def smooth_sign(speed: float, reference: float) -> float:
    """Regularised sign ``v / sqrt(v^2 + v_s^2)``: 0.995 at ten times the reference speed."""
    return speed / math.sqrt(speed * speed + reference * reference)


@kernel
def tangential_force(
    sliding_speed: float,
    normal_force: float,
    friction: float,
    friction_speed: float,
    tangential_damping: float,
) -> float:
    """Regularised Coulomb friction plus the pump paper's viscous term C_t v_t [N]."""
    return (
        friction * normal_force * smooth_sign(sliding_speed, friction_speed)
        + tangential_damping * sliding_speed
    )
