"""The crank mechanism with a clearance joint at the crank pin, compiled.

Two degrees of freedom (piston position and rod angle) and the crank, which runs at constant
speed where its inverse inertia is zero. Lagrange's equations, with the joint as a contact force:

    (m2 + m3) x'' + m2 Lc (sin b b'' + cos b b'^2) = F_x - A p - (m2 + m3) g_x
    m2 Lc sin b x'' + (J + m2 Lc^2) b''
        = L2 (F_x sin b + F_y cos b) - r_eye F_t - m2 Lc (g_x sin b + g_y cos b)
    a'' / (1 / J1) = T + L1 (F_x sin a - F_y cos a) - r_pin F_t

with a the crank angle, b the rod angle, x the piston position from the crank centre. The pin
stands at ``d = (L1 cos a + L2 cos b - x, L1 sin a - L2 sin b)`` from the eye's centre; contact is
where ``|d|`` exceeds the radial clearance. F is the force of the pin on the rod; its tangential
part follows the sliding velocity ``v_t = d' . t + r_pin a' + r_eye b'``, so that friction takes
energy out (the printed signs of the source paper put it in).

Classical Runge-Kutta with a fixed step; a step in which the contact closes or opens is cut there,
so the order is kept across contact. Forces are recorded as means over the step, that is as exact
impulses, whatever the contact did in between.

Source: Xia, Zhang, Yu, Zhu (2017), Ship Science and Technology 39(1), 51-55.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .analytic import IdealCrank, ideal_crank
from .contact import (
    RELEASE_AT_ZERO_FORCE,
    RELEASE_AT_ZERO_PENETRATION,
    kelvin_voigt,
    tangential_force,
)
from .hydraulics import PRESSURE_NONE, PRESSURE_TWO_LEVEL, two_level_pressure
from .integrate import Status
from .jit import kernel, sine_cosine
from .pump_parts import PumpScene

STEP_PER_CONTACT_TIME = 0.3
"""Default step times the contact's fastest angular frequency: 21 steps a contact period."""

STEP_PER_CONTACT_DECAY = 0.7
"""Default step times the contact's fastest decay, where damping is beyond critical."""

LARGEST_STEP_PER_CONTACT_TIME = 1.0
"""A step longer than this over the contact's rate is refused: Runge-Kutta 4 stays stable to 2.8
but is no longer accurate."""

_OVERLAP_LIMIT = 0.1  # of the pin radius: small-penetration contact laws end there
_MOST_CUTS = 8  # contact changes within one step before the rest is taken as it is


class CrankParameters(NamedTuple):
    """Everything the kernel needs, in SI."""

    crank_radius: float
    rod_length: float
    rod_centre: float
    moving_mass: float
    static_moment: float
    rod_inertia: float
    inverse_crank_inertia: float
    drive_moment: float
    gravity_x: float
    gravity_y: float
    clearance: float
    pin_radius: float
    eye_radius: float
    stiffness: float
    damping: float
    friction: float
    friction_speed: float
    tangential_damping: float
    release: int
    pressure_rung: int
    suction_force: float
    discharge_force: float
    rise_angle: float


STATE = ("alpha", "alpha_rate", "piston", "piston_velocity", "beta", "beta_rate")
"""Names of the state's columns: [rad], [rad/s], [m], [m/s], [rad], [rad/s]."""

FORCES = ("pin_x", "pin_y", "guide_y", "piston_x")
"""Names of the recorded mean forces [N]: pin on rod (x, y), guide on piston, pressure on piston
(positive towards the crank)."""


@dataclass(frozen=True, kw_only=True)
class CrankRun:
    """A run of the mechanism.

    Attributes
    ----------
    states : numpy.ndarray [shape=(n_steps + 1, 6)]
        Columns as :data:`STATE`, at the ends of the steps; the state in the middle of a step, to
        which its forces belong, is the mean of two rows.
    forces : numpy.ndarray [shape=(n_steps, 4)]
        Columns as :data:`FORCES`, mean over each step.
    step : float
        [s]
    status : Status
        How the run ended.
    peak_normal_force : float
        Largest contact force met inside the steps [N].
    contact_changes, cuts_refused : int
        Closings plus openings located; steps with more than could be located.
    """

    states: NDArray[np.float64]
    forces: NDArray[np.float64]
    step: float
    status: Status
    peak_normal_force: float
    contact_changes: int
    cuts_refused: int


@kernel
def _gap(state: Any, p: Any) -> Any:
    """Penetration, its rate, the normal, and the sliding velocity of the pin over the eye."""
    alpha, omega, x, u, beta, b = state
    sin_a, cos_a = sine_cosine(alpha)
    sin_b, cos_b = sine_cosine(beta)
    d_x = p.crank_radius * cos_a + p.rod_length * cos_b - x
    d_y = p.crank_radius * sin_a - p.rod_length * sin_b
    v_x = -p.crank_radius * sin_a * omega - p.rod_length * sin_b * b - u
    v_y = p.crank_radius * cos_a * omega - p.rod_length * cos_b * b
    distance = math.sqrt(d_x * d_x + d_y * d_y)
    if distance > 0.0:
        n_x, n_y = d_x / distance, d_y / distance
    else:  # centred pin: the normal along the stroke is as good as any, and never NaN
        n_x, n_y = 1.0, 0.0
    normal_speed = v_x * n_x + v_y * n_y
    sliding = v_y * n_x - v_x * n_y + omega * p.pin_radius + b * p.eye_radius
    return distance - p.clearance, normal_speed, n_x, n_y, sliding, sin_a, cos_a, sin_b, cos_b


@kernel
def _piston_force(alpha: float, p: CrankParameters) -> float:
    if p.pressure_rung == PRESSURE_NONE:
        return 0.0
    force: float = two_level_pressure(alpha, p.suction_force, p.discharge_force, p.rise_angle)
    return force


@kernel
def _piston_forces(angle: NDArray[np.float64], p: Any) -> NDArray[np.float64]:
    force = np.empty(angle.size)
    for i in range(angle.size):
        force[i] = _piston_force(angle[i], p)
    return force


@kernel
def _derivative(state: Any, contact: bool, p: Any) -> Any:
    """Rate of the state; forces pin x, pin y, piston, normal; penetration and the law's force."""
    sigma, normal_speed, n_x, n_y, sliding, sin_a, cos_a, sin_b, cos_b = _gap(state, p)
    b = state[5]
    law = kelvin_voigt(sigma, normal_speed, p.stiffness, p.damping)
    normal, tangential, f_x, f_y = 0.0, 0.0, 0.0, 0.0
    if contact:
        normal = law
        tangential = tangential_force(
            sliding, normal, p.friction, p.friction_speed, p.tangential_damping
        )
        f_x = normal * n_x - tangential * n_y
        f_y = normal * n_y + tangential * n_x
    piston = _piston_force(state[0], p)
    m12 = p.static_moment * sin_b
    rhs_x = f_x - piston - p.moving_mass * p.gravity_x - p.static_moment * cos_b * b * b
    rhs_b = (
        p.rod_length * (f_x * sin_b + f_y * cos_b)
        - p.eye_radius * tangential
        - p.static_moment * (p.gravity_x * sin_b + p.gravity_y * cos_b)
    )
    inverse = 1.0 / (p.moving_mass * p.rod_inertia - m12 * m12)
    x_acc = (p.rod_inertia * rhs_x - m12 * rhs_b) * inverse
    b_acc = (p.moving_mass * rhs_b - m12 * rhs_x) * inverse
    crank_acc = p.inverse_crank_inertia * (
        p.drive_moment + p.crank_radius * (f_x * sin_a - f_y * cos_a) - p.pin_radius * tangential
    )
    rate = (state[1], crank_acc, state[3], x_acc, b, b_acc)
    return rate, f_x, f_y, piston, normal, sigma, law


@kernel
def _moved(state: Any, rate: Any, h: float) -> Any:
    return (
        state[0] + h * rate[0],
        state[1] + h * rate[1],
        state[2] + h * rate[2],
        state[3] + h * rate[3],
        state[4] + h * rate[4],
        state[5] + h * rate[5],
    )


@kernel
def _mean_rate(k1: Any, k2: Any, k3: Any, k4: Any) -> Any:
    return (
        (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]) / 6.0,
        (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]) / 6.0,
        (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]) / 6.0,
        (k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3]) / 6.0,
        (k1[4] + 2.0 * (k2[4] + k3[4]) + k4[4]) / 6.0,
        (k1[5] + 2.0 * (k2[5] + k3[5]) + k4[5]) / 6.0,
    )


@kernel
def _runge_kutta(state: Any, first: Any, h: float, contact: bool, p: Any) -> Any:
    """One step with the contact held open or closed; impulses of the forces along with it.

    `first` is the derivative at `state`; the one at the end is returned for the next step.
    """
    k1, x1, y1, p1, n1, _, _ = first
    k2, x2, y2, p2, n2, _, _ = _derivative(_moved(state, k1, 0.5 * h), contact, p)
    k3, x3, y3, p3, n3, _, _ = _derivative(_moved(state, k2, 0.5 * h), contact, p)
    k4, x4, y4, p4, _, _, _ = _derivative(_moved(state, k3, h), contact, p)
    after = _moved(state, _mean_rate(k1, k2, k3, k4), h)
    sixth = h / 6.0
    return (
        after,
        _derivative(after, contact, p),
        sixth * (x1 + 2.0 * (x2 + x3) + x4),
        sixth * (y1 + 2.0 * (y2 + y3) + y4),
        sixth * (p1 + 2.0 * (p2 + p3) + p4),
        max(n1, n2, n3),
    )


@kernel
def _margin(sigma: float, law_force: float, contact: bool, p: CrankParameters) -> float:
    """Positive while the contact stays as it is, negative once it should change [N]."""
    if p.release == RELEASE_AT_ZERO_PENETRATION:
        return p.stiffness * sigma if contact else -p.stiffness * sigma
    return law_force if contact else -min(p.stiffness * sigma, law_force)


@kernel
def _hermite(
    before: float, rate_before: float, after: float, rate_after: float, h: float, s: float
) -> float:
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * before + s * h * rate_before) + s * s * (
        (1.0 + 2.0 * r) * after - r * h * rate_after
    )


@kernel
def _between(before: Any, rate_before: Any, after: Any, rate_after: Any, h: float, s: float) -> Any:
    """State a fraction s into the step, by the cubic through both ends."""
    return (
        _hermite(before[0], rate_before[0], after[0], rate_after[0], h, s),
        _hermite(before[1], rate_before[1], after[1], rate_after[1], h, s),
        _hermite(before[2], rate_before[2], after[2], rate_after[2], h, s),
        _hermite(before[3], rate_before[3], after[3], rate_after[3], h, s),
        _hermite(before[4], rate_before[4], after[4], rate_after[4], h, s),
        _hermite(before[5], rate_before[5], after[5], rate_after[5], h, s),
    )


@kernel
def _locate_change(
    before: Any, first: Any, after: Any, last: Any, h: float, contact: bool, p: Any
) -> float:
    """Fraction of the step at which the contact changes: Illinois on the dense output."""
    low, high = 0.0, 1.0
    f_low = _margin(first[5], first[6], contact, p)
    f_high = _margin(last[5], last[6], contact, p)
    if f_low <= 0.0:  # just changed, at rounding: the next change is the one at the end
        return 1.0
    for _ in range(60):
        s = high - f_high * (high - low) / (f_high - f_low)
        sigma, normal_speed = _gap(_between(before, first[0], after, last[0], h, s), p)[:2]
        law = kelvin_voigt(sigma, normal_speed, p.stiffness, p.damping)
        f = _margin(sigma, law, contact, p)
        if f > 0.0:
            low, f_low = s, f
            f_high *= 0.5
        else:
            high, f_high = s, f
            f_low *= 0.5
        if high - low < 1e-12 or abs(f) < 1e-9:
            break
    return high


@kernel
def _step(state: Any, first: Any, contact: bool, h: float, p: Any) -> Any:
    """One whole step, cut wherever the contact closes or opens."""
    left, cuts, refused = h, 0, 0
    impulse_x, impulse_y, impulse_p, peak = 0.0, 0.0, 0.0, 0.0
    while left > 0.0:
        after, last, i_x, i_y, i_p, n = _runge_kutta(state, first, left, contact, p)
        taken = left
        changed = _margin(last[5], last[6], contact, p) < 0.0
        if changed and cuts < _MOST_CUTS:
            taken = left * _locate_change(state, first, after, last, left, contact, p)
            after, last, i_x, i_y, i_p, n = _runge_kutta(state, first, taken, contact, p)
            cuts += 1
        elif changed:
            refused = 1
        state, first = after, last
        impulse_x += i_x
        impulse_y += i_y
        impulse_p += i_p
        peak = max(peak, n)
        if changed:
            contact = not contact
            first = _derivative(state, contact, p)
        left = 0.0 if taken == left else left - taken
    return state, first, contact, impulse_x, impulse_y, impulse_p, peak, cuts, refused


@kernel
def _fault(state: Any, sigma: float, p: Any) -> int:
    total = state[0] + state[1] + state[2] + state[3] + state[4] + state[5] + sigma
    if not math.isfinite(total):
        return 1
    if sigma > _OVERLAP_LIMIT * p.pin_radius:
        return 2
    if abs(state[4]) > 1.5:  # rad
        return 3
    return 0


@kernel
def _integrate(
    start: Any, h: float, p: Any, states: NDArray[np.float64], forces: NDArray[np.float64]
) -> Any:
    """March; returns status code, steps done, peak force, contact changes, refused cuts."""
    state = start
    first = _derivative(state, False, p)
    contact = _margin(first[5], first[6], False, p) < 0.0
    first = _derivative(state, contact, p)
    peak, changes, refused = 0.0, 0, 0
    for column in range(6):
        states[0, column] = state[column]
    rod_velocity = p.rod_centre * math.cos(state[4]) * state[5]
    rod_mass = p.static_moment / p.rod_centre if p.rod_centre > 0.0 else 0.0
    weight = p.moving_mass * p.gravity_y
    for i in range(forces.shape[0]):
        state, first, contact, i_x, i_y, i_p, n, cuts, late = _step(state, first, contact, h, p)
        for column in range(6):
            states[i + 1, column] = state[column]
        velocity = p.rod_centre * math.cos(state[4]) * state[5]
        forces[i, 0] = i_x / h
        forces[i, 1] = i_y / h
        forces[i, 2] = (rod_mass * (velocity - rod_velocity) - i_y) / h + weight
        forces[i, 3] = i_p / h
        rod_velocity = velocity
        peak = max(peak, n)
        changes += cuts
        refused += late
        code = _fault(state, first[5], p)
        if code != 0:
            return code, i + 1, peak, changes, refused
    return 0, forces.shape[0], peak, changes, refused


def parameters(scene: PumpScene) -> CrankParameters:
    """Kernel parameters of a scene."""
    joint, rod, pressure = scene.joint.crankpin, scene.rod, scene.pressure
    area = math.pi / 4 * scene.piston.diameter**2
    rung = {"none": PRESSURE_NONE, "two-level": PRESSURE_TWO_LEVEL}[pressure.rung]
    return CrankParameters(
        crank_radius=scene.crank.radius,
        rod_length=rod.length,
        rod_centre=rod.centre_of_mass,
        moving_mass=rod.mass + scene.piston.mass,
        static_moment=rod.mass * rod.centre_of_mass,
        rod_inertia=rod.inertia + rod.mass * rod.centre_of_mass**2,
        inverse_crank_inertia=0.0,
        drive_moment=0.0,
        gravity_x=scene.gravity * math.sin(scene.stroke_inclination),
        gravity_y=scene.gravity * math.cos(scene.stroke_inclination),
        clearance=joint.clearance_radial,
        pin_radius=joint.pin_diameter / 2,
        eye_radius=joint.pin_diameter / 2 + joint.clearance_radial,
        stiffness=joint.stiffness,
        damping=joint.damping,
        friction=joint.friction,
        friction_speed=joint.friction_speed,
        tangential_damping=joint.tangential_damping,
        release=RELEASE_AT_ZERO_FORCE,
        pressure_rung=rung,
        suction_force=area * pressure.suction,
        discharge_force=area * pressure.discharge,
        rise_angle=pressure.rise_angle,
    )


def contact_frequency(scene: PumpScene) -> float:
    """Largest angular frequency of the mechanism on its undamped contact spring [rad/s].

    The mass felt at the eye depends on the direction; its least value over a revolution sets the
    fastest contact, and so the step.
    """
    p = parameters(scene)
    return math.sqrt(p.stiffness * _largest_mobility(p))


def contact_rate(scene: PumpScene) -> float:
    """Fastest rate of the damped contact [1/s]: largest root of ``s^2 + C/m s + K/m``.

    The contact's angular frequency while it oscillates; beyond critical damping the faster of
    its two decays, which is what limits an explicit step.
    """
    p = parameters(scene)
    half = p.damping * _largest_mobility(p) / 2
    square = p.stiffness * _largest_mobility(p)
    return half + math.sqrt(half**2 - square) if half**2 > square else math.sqrt(square)


def _largest_mobility(p: CrankParameters) -> float:
    largest = math.asin(min(1.0, p.crank_radius / p.rod_length))
    return max(_mobility(beta, p) for beta in np.linspace(0.0, largest, 5))


def _mobility(beta: float, p: CrankParameters) -> float:
    """Largest acceleration of the eye per unit force [1/kg]."""
    coupling = p.static_moment * math.sin(beta)
    mass = np.array([[p.moving_mass, coupling], [coupling, p.rod_inertia]])
    arm = p.rod_length * np.array([math.sin(beta), math.cos(beta)])
    jacobian = np.array([[1.0, arm[0]], [0.0, arm[1]]])
    return float(np.linalg.eigvalsh(jacobian @ np.linalg.solve(mass, jacobian.T))[-1])


def ideal_motion(scene: PumpScene, angle: NDArray[np.float64]) -> IdealCrank:
    """The rung *ideal*: inverse dynamics without clearance at the crank angles given [rad]."""
    p = parameters(scene)
    force = _piston_forces(np.ravel(angle).astype(float), p).reshape(np.shape(angle))
    return ideal_crank(
        angle,
        speed=2 * math.pi * scene.drive.speed,
        crank_radius=p.crank_radius,
        rod_length=p.rod_length,
        rod_mass=scene.rod.mass,
        rod_centre=p.rod_centre,
        rod_inertia=scene.rod.inertia,
        piston_mass=scene.piston.mass,
        piston_force=force,
        gravity_x=p.gravity_x,
        gravity_y=p.gravity_y,
    )


def start_state(scene: PumpScene, angle: float) -> tuple[float, ...]:
    """State in which the pin rests in its eye with the force that an ideal joint would carry."""
    p = parameters(scene)
    ideal = ideal_motion(scene, np.array([angle]))
    force = np.array([ideal.pin_force_x[0], ideal.pin_force_y[0]])
    size = float(np.hypot(*force))
    direction = force / size if size > 0 else np.array([1.0, 0.0])
    offset = (p.clearance + size / p.stiffness) * direction
    sin_b = (p.crank_radius * math.sin(angle) - offset[1]) / p.rod_length
    # out of reach only where the contact is far too soft: the run then says so by its status
    beta = math.asin(min(1.0, max(-1.0, sin_b)))
    piston = p.crank_radius * math.cos(angle) + p.rod_length * math.cos(beta) - offset[0]
    return (
        angle,
        2 * math.pi * scene.drive.speed,
        float(piston),
        float(ideal.piston_velocity[0]),
        beta,
        float(ideal.beta_rate[0]),
    )


def pin_offset(scene: PumpScene, states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position of the pin's centre from the eye's [m].

    Parameters
    ----------
    scene : PumpScene
    states : numpy.ndarray [shape=(n, 6)]
        Columns as :data:`STATE`.

    Returns
    -------
    numpy.ndarray [shape=(n, 2)]
        x along the stroke, y across it. Its length exceeds the radial clearance by the
        penetration where there is contact.
    """
    alpha, piston, beta = states[:, 0], states[:, 2], states[:, 4]
    radius, length = scene.crank.radius, scene.rod.length
    along = radius * np.cos(alpha) + length * np.cos(beta) - piston
    return np.column_stack([along, radius * np.sin(alpha) - length * np.sin(beta)])


def run_compliant(
    p: CrankParameters, start: tuple[float, ...], *, step: float, n_steps: int
) -> CrankRun:
    """The rung *compliant*: integrate the mechanism with contact in its clearance.

    Parameters
    ----------
    p : CrankParameters
        Validated by the scene; a kernel trusts it.
    start : tuple of float
        Columns as :data:`STATE`.
    step : float
        [s], at most ``LARGEST_STEP_PER_CONTACT_TIME`` over :func:`contact_rate`.
    n_steps : int
        Steps to take.

    Returns
    -------
    CrankRun
        Cut off at the step in which it failed where the status is not OK.
    """
    states = np.empty((n_steps + 1, len(STATE)))
    forces = np.empty((n_steps, len(FORCES)))
    code, done, peak, changes, refused = _integrate(start, step, p, states, forces)
    return CrankRun(
        states=states[: done + 1],
        forces=forces[:done],
        step=step,
        status=Status(code),
        peak_normal_force=peak,
        contact_changes=changes,
        cuts_refused=refused,
    )


def run_ideal(scene: PumpScene, *, step: float, n_steps: int, start_angle: float) -> CrankRun:
    """The rung *ideal* in the form of a run: forces at the middle of each step."""
    speed = 2 * math.pi * scene.drive.speed
    angle = start_angle + speed * step * np.arange(n_steps + 1.0)
    ends = ideal_motion(scene, angle)
    middle = ideal_motion(scene, 0.5 * (angle[:-1] + angle[1:]))
    force = middle.wrist_force_x - scene.piston.mass * (
        middle.piston_acceleration + parameters(scene).gravity_x
    )
    states = np.column_stack(
        [
            angle,
            np.full(n_steps + 1, speed),
            ends.piston,
            ends.piston_velocity,
            ends.beta,
            ends.beta_rate,
        ]
    )
    return CrankRun(
        states=states,
        forces=np.column_stack([middle.pin_force_x, middle.pin_force_y, middle.guide_force, force]),
        step=step,
        status=Status.OK,
        peak_normal_force=float(np.hypot(middle.pin_force_x, middle.pin_force_y).max()),
        contact_changes=0,
        cuts_refused=0,
    )
