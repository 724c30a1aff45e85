"""Normal and friction laws of a clearance joint, compiled.

Laws are scene choices, selected by integer codes in the joint's record of :data:`CONTACT`. All
act on the *rod* end of a joint: the normal force along the direction from the eye's centre to the
pin's, the tangential one along the sliding velocity of the pin over the eye.

The hysteresis laws share one form, ``F = F_e(d) (1 + a d' / d'_0)``, with F_e the elastic force, d
the penetration, d'_0 the speed at first touch and a the hysteresis factor. They differ in how a
follows from the required restitution e, and most of them miss it. For any elasticity, mass and
speed (:func:`effective_restitution` shows why), a required restitution e
results in

    ======================= ===== ===== ===== ===== =====
    e                         0.3   0.5   0.7   0.8   0.9
    ======================= ===== ===== ===== ===== =====
    ``exact``               0.300 0.500 0.700 0.800 0.900
    ``carvalho-martins``        - 0.500 0.700 0.800 0.900
    ``hu-guo``              0.271 0.488 0.697 0.799 0.900
    ``gonthier``            0.304 0.488 0.670 0.768 0.876
    ``flores``              0.256 0.470 0.683 0.789 0.894
    ``zhiying-qishao``      0.327 0.483 0.680 0.787 0.896
    ``herbert-mcwhannell``  0.520 0.594 0.723 0.807 0.901
    ``hunt-crossley``       0.581 0.663 0.768 0.833 0.909
    ``lankarani-nikravesh`` 0.684 0.725 0.796 0.847 0.913
    ``lee-wang``            0.739 0.799 0.869 0.909 0.952
    ======================= ===== ===== ===== ===== =====

All of them assume elastic bodies except for the loss itself: an impact faster than about
``1e-5 sqrt(E / rho)`` (Love; 5 cm/s for steel) leaves a permanent mark.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..jit import kernel

LAW_KELVIN_VOIGT = 0
LAW_HYSTERESIS = 1
LAW_CONSTANT_LOSS = 2  # hysteresis whose d'_0 is the same for every impact

ELASTIC_LINEAR = 0
ELASTIC_HERTZ = 1
ELASTIC_CONFORMAL = 2

RELEASE_AT_ZERO_FORCE = 0
RELEASE_AT_ZERO_PENETRATION = 1

FRICTION_SMOOTH = 0
FRICTION_RAMP = 1

CONTACT = np.dtype(
    [
        ("law", np.int64),  # LAW_*
        ("elasticity", np.int64),  # ELASTIC_*
        ("stiffness", np.float64),  # K of the elasticity: [N/m], Hertz [N/m^1.5]
        ("damping", np.float64),  # C of Kelvin-Voigt [N s/m]
        ("hysteresis", np.float64),  # a of the hysteresis laws
        ("clearance", np.float64),  # radial [m]; for a worn eye across the rod
        ("slot", np.float64),  # length of an eye along its rod in excess of that across [m]
        ("speed_floor", np.float64),  # least d'_0, or the constant one, > 0 [m/s]
        ("release", np.int64),  # RELEASE_*
        ("friction_law", np.int64),  # FRICTION_*
        ("friction", np.float64),  # Coulomb's coefficient
        ("friction_speed", np.float64),  # speed of nearly full friction, > 0 [m/s]
        ("friction_dead_speed", np.float64),  # no friction below, FRICTION_RAMP [m/s]
        ("tangential_damping", np.float64),  # C_t [N s/m]
    ]
)
"""One record per joint; SI, codes as integers."""

_LEAST_CARVALHO_MARTINS = 1 / 3  # validity given with the formula
_ASYMPTOTE = 0.05  # coth x = 1 to rounding if 1 - L(x) is below it, that is x > 20
_SERIES_END = 0.1  # below, cancellation in coth x - 1/x exceeds the series' error (6e-16)
_NEWTON_STEPS = 50  # both uses converge within 8


# --- normal force


@kernel
def elastic_force(penetration: float, contact: Any) -> float:
    """Force of the elastic contact alone [N]; zero without penetration.

    Linear ``K d``; Hertz ``K d^(3/2)`` (:func:`.contact.closed_forms.hertz_sphere_stiffness`);
    conformal cylinders ``K d sqrt(d / (2 (c + d)))`` with c the radial clearance
    (:func:`.contact.closed_forms.conformal_stiffness`), which changes from d^(3/2) to linear as the
    penetration exceeds the clearance.

    References
    ----------
    Liu, Zhang, Yang (2007), Mechanism and Machine Theory 42(2), 183-197: the conformal law.
    """
    inside = max(penetration, 0.0)
    reach = contact.clearance + inside
    conformal = 0.5 * inside / (reach if reach > 0.0 else 1.0)
    share = conformal if contact.elasticity == ELASTIC_CONFORMAL else 1.0
    share = inside if contact.elasticity == ELASTIC_HERTZ else share
    force: float = contact.stiffness * inside * math.sqrt(share)
    return force


@kernel
def elastic_stiffness(penetration: float, contact: Any) -> float:
    """Derivative of :func:`elastic_force` by the penetration [N/m]; zero without penetration."""
    if penetration <= 0.0:
        return 0.0
    stiffness: float = contact.stiffness
    if contact.elasticity == ELASTIC_HERTZ:
        stiffness *= 1.5 * math.sqrt(penetration)
    elif contact.elasticity == ELASTIC_CONFORMAL:
        reach = contact.clearance + penetration
        stiffness *= math.sqrt(0.5 * penetration / reach) * (1.0 + 0.5 * contact.clearance / reach)
    return stiffness


@kernel
def normal_force(
    penetration: float, approach_speed: float, impact_speed: float, contact: Any
) -> float:
    """Force of the contact along its normal [N].

    Kelvin-Voigt: ``F_e(d) + C d'``, a spring and a dashpot in parallel (eq. 12 of Xia et al. 2017,
    the pump paper). The dashpot makes the force jump at first touch and turn negative before the
    surfaces part; the sign is kept, and without penetration the force is ``K d + C d'``: the solver
    locates opening and closing by its sign changes. `impact_speed` is ignored.

    Hysteresis: ``max(0, F_e(d) (1 + a d' / d'_0))``, continuous at first touch and at release, both
    at zero penetration. It never pulls; a free impact does not reach that limit, as it separates
    more slowly than ``d'_0 / a``. d'_0 is `impact_speed`, at least the record's `speed_floor`
    (:func:`floored_restitution` gives the error). With a constant loss d'_0 is `speed_floor` for
    every impact, so that faster ones lose more, as Hunt and Crossley (1975) found.

    Parameters
    ----------
    penetration : float
        d [m], negative while the surfaces are apart.
    approach_speed : float
        Rate d' of the penetration [m/s].
    impact_speed : float
        Approach speed at the first touch of this contact [m/s].
    contact : record of CONTACT
    """
    elastic = elastic_force(penetration, contact)
    spring = elastic if penetration > 0.0 else contact.stiffness * penetration
    speed = impact_speed if contact.law == LAW_HYSTERESIS else 0.0
    floor = max(speed, contact.speed_floor)
    loss = contact.hysteresis * approach_speed / (floor if floor > 0.0 else 1.0)
    force: float = (
        spring + contact.damping * approach_speed
        if contact.law == LAW_KELVIN_VOIGT
        else elastic * max(0.0, 1.0 + loss)
    )
    return force


# --- friction


@kernel
def _ramp_parts(speed: float, dead_speed: float, full_speed: float) -> Any:
    """Numerator and denominator of a sign that rises linearly between two speeds.

    Zero up to the dead speed, one from the full one on.

    References
    ----------
    Ambrosio (2003), Virtual Nonlinear Multibody Systems, NATO Science Series 103, 57-81.
    """
    size, reach = abs(speed), full_speed - dead_speed
    rises = dead_speed < size < full_speed
    part = size - dead_speed if rises else (1.0 if size > dead_speed else 0.0)
    return (part if speed > 0.0 else -part), (reach if rises else 1.0)


@kernel
def friction_force(sliding_speed: float, normal_force: float, contact: Any) -> float:
    """Regularised Coulomb friction plus the pump paper's viscous term ``C_t v`` [N].

    Coulomb's part is ``f N s(v)`` with s the regularised sign ``v / sqrt(v^2 + v_s^2)`` at the
    `friction_speed` v_s, 0.995 at ten times that, or one that rises linearly from
    `friction_dead_speed` to `friction_speed`; a contact that pulls has no friction. The force has
    the sign of the sliding velocity; it acts on the sliding body in the opposite direction, so
    it never adds energy. There is no static friction: a constant load creeps.
    """
    full, smooth = contact.friction_speed, contact.friction_law == FRICTION_SMOOTH
    part, whole = _ramp_parts(sliding_speed, contact.friction_dead_speed, full)
    rounded = math.sqrt(sliding_speed * sliding_speed + full * full)
    # one division for either law: it takes longer than everything else here
    sign = (sliding_speed if smooth else part) / (rounded if smooth else whole)
    coulomb = contact.friction * max(0.0, normal_force) * sign
    force: float = coulomb + contact.tangential_damping * sliding_speed
    return force


# --- restitution of the hysteresis laws


def hysteresis(law: str, restitution: float) -> float:
    """Hysteresis factor of a law for a required restitution.

    Parameters
    ----------
    law : str
        One of :data:`HYSTERESIS`.
    restitution : float
        Required speed of separation over speed of approach, 0 < e <= 1;
        ``carvalho-martins`` is valid from 1/3 on.

    Returns
    -------
    float
        Factor a of ``F = F_e(d) (1 + a d' / d'_0)``, >= 0.

    Raises
    ------
    ValueError
        There is no such law, or the restitution is outside its validity.

    Notes
    -----
    Only ``exact`` and, within 0.003, ``carvalho-martins`` achieve the required value; the table at
    the head of this file shows the others. ``hunt-crossley`` is within 5 % from e = 0.78 on,
    ``lankarani-nikravesh`` from 0.82. For small damping a must tend to ``3/2 (1 - e)``:
    ``lee-wang`` tends to half of it, ``gonthier`` to 4/3 and ``flores`` to 16/15 of it.

    References
    ----------
    Hunt, Crossley (1975), J. Applied Mechanics 42(2), 440-445, doi:10.1115/1.3423596.
    Herbert, McWhannell (1977), J. Engineering for Industry 99(3), 513-518.
    Lee, Wang (1983), J. Mechanisms, Transmissions, and Automation in Design 105(3), 534-540.
    Lankarani, Nikravesh (1990), J. Mechanical Design 112(3), 369-376, doi:10.1115/1.2912617.
    Gonthier, McPhee, Lange, Piedboeuf (2004), Multibody System Dynamics 11, 209-233: the
    approximation in closed form.
    Zhiying, Qishao (2006), J. Dynamics and Control 4, 294-298.
    Flores, Machado, Silva, Martins (2011), Multibody System Dynamics 25, 357-375,
    doi:10.1007/s11044-010-9237-4.
    Hu, Guo (2015), Multibody System Dynamics 35, 131-151, doi:10.1007/s11044-015-9453-z.
    Carvalho, Martins (2019), Mechanism and Machine Theory 139, 174-194,
    doi:10.1016/j.mechmachtheory.2019.03.028.

    Examples
    --------
    >>> hysteresis("hunt-crossley", 0.5)
    0.75
    >>> round(hysteresis("exact", 0.5), 4)
    1.4328
    """
    if law not in HYSTERESIS:
        raise ValueError(f"law = '{law}' must be one of {', '.join(HYSTERESIS)}")
    if not 0 < restitution <= 1:
        raise ValueError(
            f"restitution = {restitution} must be in (0, 1]; it is a ratio of speeds, and no "
            "finite damping of this form stops a body dead"
        )
    if law == "carvalho-martins" and restitution < _LEAST_CARVALHO_MARTINS:
        raise ValueError(
            f"restitution = {restitution} of carvalho-martins must be >= 1/3; "
            "choose law = 'exact', which holds for all"
        )
    return HYSTERESIS[law](restitution)


def effective_restitution(factor: float) -> float:
    """Coefficient of restitution of a free impact with a hysteresis factor.

    Parameters
    ----------
    factor : float
        Factor a of ``F = F_e(d) (1 + a d' / d'_0)``, >= 0 and finite.

    Returns
    -------
    float
        Speed of separation over speed of approach, in (0, 1].

    Raises
    ------
    ValueError
        The factor is negative or not finite.

    Notes
    -----
    With ``v = d' / d'_0`` the motion ``m d'_0^2 v dv = -F_e(d) (1 + a v) dd`` separates: the
    integral of ``v / (1 + a v)`` by v is the elastic energy, over ``m d'_0^2``.
    Closing (v from 1 to 0) and opening (v from 0 to -e) pass through the same energy, for any
    F_e, so it cancels:

        a (1 + e) = ln((1 + a) / (1 - a e)).

    With ``2 x = a (1 + e)`` this becomes ``(1 - e) / (1 + e) = coth x - 1/x``, Langevin's function
    L: hence solve ``a = x (1 + L)`` for x, and ``e = (1 - L) / (1 + L)``. This avoids root finding
    in e, and cancellation at either end. Small factors: ``e = 1 - 2 a / 3 + ...``; large ones:
    ``e = 1 / a``. No other force may act on the body during the impact.

    Examples
    --------
    >>> round(effective_restitution(hysteresis("hunt-crossley", 0.5)), 4)
    0.663
    """
    if not 0 <= factor < math.inf:
        raise ValueError(
            f"factor = {factor} must be >= 0 and finite; hysteresis() gives one from a restitution"
        )
    x = factor
    for _ in range(_NEWTON_STEPS):  # x (1 + L) is convex: after one step from the right only
        langevin = _langevin(x)
        slope = (1 - langevin) * (1 + x * (1 + langevin))
        step = (x * (1 + langevin) - factor) / slope
        x -= step
        if abs(step) <= 1e-15 * x:
            break
    langevin = _langevin(x)
    return (1 - langevin) / (1 + langevin)


def floored_restitution(factor: float, impact_speed: float, speed_floor: float) -> float:
    """Coefficient of restitution of an impact with a floor of the impact speed.

    The hysteresis laws divide by the impact speed, which tends to zero for a contact that closes
    gently or is sustained. The floor bounds that: a slower impact has the factor
    ``a d'_0 / floor`` and so loses less than it should, in the limit nothing.

    Parameters
    ----------
    factor : float
        Factor a of the law, >= 0.
    impact_speed, speed_floor : float
        Approach speed at first touch, and its floor, both > 0 [m/s].

    Returns
    -------
    float
        Speed of separation over speed of approach.

    Raises
    ------
    ValueError
        A speed is not above zero, or the factor is negative or not finite.

    Examples
    --------
    >>> a = hysteresis("exact", 0.5)
    >>> [round(floored_restitution(a, v, 1e-3), 3) for v in (1e-2, 1e-3, 1e-4)]
    [0.5, 0.5, 0.913]
    """
    for name, speed in (("impact_speed", impact_speed), ("speed_floor", speed_floor)):
        if not speed > 0:
            raise ValueError(
                f"{name} = {speed} m/s must be > 0; a touch without speed is no impact"
            )
    return effective_restitution(factor * min(1.0, impact_speed / speed_floor))


def _exact(restitution: float) -> float:
    """Factor that gives the restitution: ``a = 2 x / (1 + e)`` with ``L(x) = (1 - e) / (1 + e)``.

    Newton's method from Cohen's approximation of the inverse of L, which is within 5 % everywhere.
    """
    lost = (1 - restitution) / (1 + restitution)
    kept = 2 * restitution / (1 + restitution)  # 1 - lost, without cancellation
    if lost == 0:
        return 0.0
    x = 1 / kept
    if kept >= _ASYMPTOTE:
        x = lost * (3 - lost**2) / (kept * (1 + lost))
        for _ in range(_NEWTON_STEPS):
            langevin = _langevin(x)
            step = (langevin - lost) / (1 - langevin**2 - 2 * langevin / x)
            x -= step
            if abs(step) <= 1e-15 * x:
                break
    return 2 * x / (1 + restitution)


def _langevin(x: float) -> float:
    """Langevin's function ``coth x - 1/x`` for x >= 0, to rounding."""
    if x >= _SERIES_END:
        return 1 / math.tanh(x) - 1 / x
    z = x * x
    return x * (1 / 3 - z * (1 / 45 - z * (2 / 945 - z * (1 / 4725 - z * (2 / 93555)))))


HYSTERESIS: dict[str, Callable[[float], float]] = {
    "exact": _exact,
    "carvalho-martins": lambda e: 1.5 * (1 - e) * (11 - e) / (1 + 9 * e),
    "hu-guo": lambda e: 1.5 * (1 - e) / e,
    "gonthier": lambda e: (1 - e * e) / e,
    "flores": lambda e: 1.6 * (1 - e) / e,
    "zhiying-qishao": lambda e: 0.75 * (1 - e * e) * math.exp(2 * (1 - e)),
    "herbert-mcwhannell": lambda e: 6 * (1 - e) / ((2 * e - 1) ** 2 + 3),
    "hunt-crossley": lambda e: 1.5 * (1 - e),
    "lankarani-nikravesh": lambda e: 0.75 * (1 - e * e),
    "lee-wang": lambda e: 0.75 * (1 - e),
}
"""Name of a hysteresis law -> its factor as a function of the required restitution.

Formulas only; :func:`hysteresis` checks the range.
"""
