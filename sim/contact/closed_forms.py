"""Closed forms that verify the solvers and serve as the cheapest rungs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..brief import brief


@dataclass(frozen=True, kw_only=True)
class IdealCrank:
    """Motion and forces of a slider-crank without clearance at constant speed.

    All arrays have the shape of the given crank angle. x runs along the stroke from the crank
    centre to the piston, y across it; the rod's crank-pin end is at ``y = L2 sin(beta)``.

    Attributes
    ----------
    beta, beta_rate, beta_acceleration : numpy.ndarray
        Rod angle [rad], [rad/s], [rad/s^2].
    piston, piston_velocity, piston_acceleration : numpy.ndarray
        Piston position from the crank centre [m], [m/s], [m/s^2].
    pin_force_x, pin_force_y : numpy.ndarray
        Force of the crank pin on the rod [N].
    wrist_force_x, wrist_force_y : numpy.ndarray
        Force of the rod on the piston [N].
    guide_force : numpy.ndarray
        Force of the guide on the piston, along y [N].
    crank_moment : numpy.ndarray
        Drive moment on the crank that keeps the speed [N m].
    """

    beta: NDArray[np.float64]
    beta_rate: NDArray[np.float64]
    beta_acceleration: NDArray[np.float64]
    piston: NDArray[np.float64]
    piston_velocity: NDArray[np.float64]
    piston_acceleration: NDArray[np.float64]
    pin_force_x: NDArray[np.float64]
    pin_force_y: NDArray[np.float64]
    wrist_force_x: NDArray[np.float64]
    wrist_force_y: NDArray[np.float64]
    guide_force: NDArray[np.float64]
    crank_moment: NDArray[np.float64]

    __repr__ = brief("piston", "pin_force_x", "pin_force_y")


def ideal_crank(
    angle: NDArray[np.float64],
    *,
    speed: float,
    crank_radius: float,
    rod_length: float,
    rod_mass: float,
    rod_centre: float,
    rod_inertia: float,
    piston_mass: float,
    piston_force: NDArray[np.float64] | float = 0.0,
    gravity_x: float = 0.0,
    gravity_y: float = 0.0,
) -> IdealCrank:
    """Inverse dynamics of a slider-crank with ideal joints at constant speed.

    Parameters
    ----------
    angle : numpy.ndarray
        Crank angle [rad], zero with the piston farthest from the crank centre.
    speed : float
        Crank speed [rad/s].
    crank_radius, rod_length : float
        Lengths between the centres of the joints [m].
    rod_mass : float
        Mass of the whole rod [kg].
    rod_centre : float
        Distance of the rod's centre of mass from the wrist pin [m].
    rod_inertia : float
        Inertia about the centre of mass [kg m^2].
    piston_mass : float
        Piston with crosshead and wrist pin [kg].
    piston_force : numpy.ndarray or float
        Pressure force on the piston, positive towards the crank [N].
    gravity_x, gravity_y : float
        Downward gravity is ``(-gravity_x, -gravity_y)`` in the mechanism's axes [m/s^2].

    Returns
    -------
    IdealCrank
        Kinematics by differentiating ``L2 sin(beta) = L1 sin(alpha)`` twice; forces by
        Lagrange's equations of rod and piston.

    Examples
    --------
    >>> crank = ideal_crank(np.array([0.0]), speed=10.0, crank_radius=0.05, rod_length=0.25,
    ...                     rod_mass=0.0, rod_centre=0.0, rod_inertia=0.0, piston_mass=2.0)
    >>> crank.pin_force_x  # m r omega^2 (1 + lambda), towards the crank centre
    array([-12.])
    """
    sin_a, cos_a = np.sin(angle), np.cos(angle)
    beta = np.arcsin(crank_radius / rod_length * sin_a)
    sin_b, cos_b = np.sin(beta), np.cos(beta)
    beta_rate = crank_radius * cos_a * speed / (rod_length * cos_b)
    beta_acc = (-crank_radius * sin_a * speed**2 / rod_length + sin_b * beta_rate**2) / cos_b
    piston = crank_radius * cos_a + rod_length * cos_b
    piston_velocity = -crank_radius * sin_a * speed - rod_length * sin_b * beta_rate
    piston_acc = -crank_radius * cos_a * speed**2 - rod_length * (
        cos_b * beta_rate**2 + sin_b * beta_acc
    )
    static_moment = rod_mass * rod_centre
    pin_x = (
        (rod_mass + piston_mass) * (piston_acc + gravity_x)
        + static_moment * (sin_b * beta_acc + cos_b * beta_rate**2)
        + piston_force
    )
    about_wrist = (rod_inertia + static_moment * rod_centre) * beta_acc + static_moment * (
        sin_b * (piston_acc + gravity_x) + cos_b * gravity_y
    )
    pin_y = (about_wrist - rod_length * pin_x * sin_b) / (rod_length * cos_b)
    wrist_x = piston_mass * (piston_acc + gravity_x) + piston_force
    rod_acc_y = rod_centre * (cos_b * beta_acc - sin_b * beta_rate**2)
    wrist_y = pin_y - rod_mass * (rod_acc_y + gravity_y)
    return IdealCrank(
        beta=beta,
        beta_rate=beta_rate,
        beta_acceleration=beta_acc,
        piston=piston,
        piston_velocity=piston_velocity,
        piston_acceleration=piston_acc,
        pin_force_x=pin_x,
        pin_force_y=pin_y,
        wrist_force_x=wrist_x + np.zeros_like(pin_x),
        wrist_force_y=wrist_y,
        guide_force=piston_mass * gravity_y - wrist_y,
        crank_moment=crank_radius * (pin_y * cos_a - pin_x * sin_a),
    )


def kelvin_voigt_restitution(damping_ratio: float, *, release_at_zero_force: bool = True) -> float:
    """Coefficient of restitution of a mass on a Kelvin-Voigt contact.

    Parameters
    ----------
    damping_ratio : float
        ``C / (2 sqrt(K m))``, 0 <= zeta < 1.
    release_at_zero_force : bool
        True: the contact opens when its force reaches zero, so it never pulls. False: it opens
        when the penetration returns to zero, and pulls shortly before.

    Returns
    -------
    float
        Speed of separation over speed of approach.

    Raises
    ------
    ValueError
        The damping ratio is outside [0, 1).

    Notes
    -----
    With ``w = sqrt(1 - zeta^2)`` the penetration is ``exp(-zeta t) sin(w t)`` in units of the
    contact's own time; the force ``d + 2 zeta d'`` first vanishes at
    ``w t = pi - atan2(2 zeta w, w^2 - zeta^2)``.

    Examples
    --------
    >>> round(kelvin_voigt_restitution(0.2), 6)
    0.57174
    """
    if not 0 <= damping_ratio < 1:
        raise ValueError(f"damping_ratio = {damping_ratio} must be in [0, 1); lower the damping")
    z = damping_ratio
    w = math.sqrt(1 - z * z)
    end = math.pi - (math.atan2(2 * z * w, w * w - z * z) if release_at_zero_force else 0.0)
    return math.exp(-z * end / w)


def effective_modulus(young_1: float, poisson_1: float, young_2: float, poisson_2: float) -> float:
    """Contact modulus of two elastic bodies, ``1 / E* = sum of (1 - nu^2) / E``.

    Parameters
    ----------
    young_1 : float
        Young's modulus of the first body [Pa], > 0.
    poisson_1 : float
        Its Poisson's ratio, from -1 to 0.5.
    young_2 : float
        Young's modulus of the second body [Pa], > 0.
    poisson_2 : float
        Its Poisson's ratio, from -1 to 0.5.

    Returns
    -------
    float
        E* [Pa].

    Raises
    ------
    ValueError
        A modulus or a ratio is outside its range.

    Examples
    --------
    >>> round(effective_modulus(207e9, 0.3, 207e9, 0.3) / 1e9, 3)  # steel on steel [GPa]
    113.736
    """
    for name, young in (("young_1", young_1), ("young_2", young_2)):
        if not young > 0:
            raise ValueError(f"{name} = {young} Pa must be > 0; steel has about 2.1e11")
    for name, poisson in (("poisson_1", poisson_1), ("poisson_2", poisson_2)):
        if not -1 < poisson <= 0.5:
            raise ValueError(f"{name} = {poisson} must be in (-1, 0.5]; metals have about 0.3")
    return 1 / ((1 - poisson_1**2) / young_1 + (1 - poisson_2**2) / young_2)


def hertz_sphere_stiffness(modulus: float, radius: float, seat_radius: float) -> float:
    """Stiffness of a ball in a spherical seat, ``F = K d^(3/2)``.

    Parameters
    ----------
    modulus : float
        E* of the pair, see :func:`effective_modulus` [Pa], > 0.
    radius, seat_radius : float
        Radius of the ball, and the larger one of the hollow around it [m].

    Returns
    -------
    float
        K [N/m^1.5].

    Raises
    ------
    ValueError
        The modulus or the radius is not above zero, or the seat not larger than the ball.

    Notes
    -----
    ``K = 4/3 E* sqrt(R_1 R_2 / (R_2 - R_1))`` (Hertz 1882; Johnson, Contact Mechanics, 1985,
    sec. 4.2), for a contact that is small compared with the radii. The literature on clearance
    joints uses it by convention for a pin in an eye too (Ravn 1998). But there the contact is a
    line, and the error grows as the radii approach each other: use :func:`conformal_stiffness`.

    Examples
    --------
    >>> steel = effective_modulus(207e9, 0.3, 207e9, 0.3)
    >>> f"{hertz_sphere_stiffness(steel, 9.5e-3, 10e-3):.4e}"
    '6.6102e+10'
    """
    if not modulus > 0:
        raise ValueError(f"modulus = {modulus} Pa must be > 0; steel on steel has about 1.1e11")
    if not 0 < radius < seat_radius:
        raise ValueError(
            f"radius = {radius} m must be > 0 and < seat_radius = {seat_radius} m; "
            "check which one is hollow"
        )
    return 4 / 3 * modulus * math.sqrt(radius * seat_radius / (seat_radius - radius))


def conformal_stiffness(modulus: float, length: float) -> float:
    """Stiffness of a pin in an eye of nearly its radius, ``F = K d sqrt(d / (2 (c + d)))``.

    Parameters
    ----------
    modulus : float
        E* of the pair, see :func:`effective_modulus` [Pa], > 0.
    length : float
        Length of the contact along the pin's axis [m], > 0.

    Returns
    -------
    float
        K [N/m]; c is the radial clearance.

    Raises
    ------
    ValueError
        The modulus or the length is not above zero.

    Notes
    -----
    ``K = pi/2 E* L``: a foundation whose pressure decreases over the arc of contact (Liu, Zhang,
    Yang 2007, Mechanism and Machine Theory 42(2), 183-197). Plane strain, no friction. For d well
    above c the force becomes linear, ``K d / sqrt(2)``.

    Examples
    --------
    >>> steel = effective_modulus(207e9, 0.3, 207e9, 0.3)
    >>> f"{conformal_stiffness(steel, 20e-3):.4e}"
    '3.5731e+09'
    """
    if not modulus > 0:
        raise ValueError(f"modulus = {modulus} Pa must be > 0; steel on steel has about 1.1e11")
    if not length > 0:
        raise ValueError(f"length = {length} m must be > 0; it is measured along the pin")
    return math.pi / 2 * modulus * length
