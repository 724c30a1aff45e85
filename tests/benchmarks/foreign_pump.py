"""An independent bilge pump, to judge wear models that were trained on the library's own.

Nothing here is from `wearstate.sim`; only the nominal numbers of the scene `bilge-pump` are the
same, and a test holds them against it. Everything is simulated.

**Motion.** Lagrange's equations in crank angle a, piston position x above the crank centre and rod
angle b. The rod's mass m and inertia J lie at s from the wrist, M is the piston's mass, G(a) and E
are pin and eye, F is the force of the pin on the eye and T the moment of its friction on the rod:

    (M + m) x'' + m s sin b b'' = F_x - p A - R(x') - (M + m) g - m s cos b b'^2
    m s sin b x'' + (J + m s^2) b'' = L (F_x sin b + F_y cos b) - T - m g s sin b
    I a'' = motor(a') - (G x F) - r_p F_t
    G = r (cos a, sin a),  E = (x - L cos b, L sin b),  overlap = |G - E| - c

Third-order Runge-Kutta of Shu and Osher (1988, doi:10.1016/0021-9991(88)90177-5), fixed step.

**What differs from the library**, each to be switched off by name (`DIFFERENCES`), which leaves
the law that the library's documentation states, programmed here anew:

pressure
    tanh over a transition angle that begins a delay after the dead centre, both 0 to 7 degrees,
    apart for rise and fall. Else: a cubic over 6 degrees from the dead centre.
contact
    Hunt and Crossley (1975, doi:10.1115/1.3423596), N = K d^1.5 (1 + q d'), not negative. K makes
    the overlap under the mean discharge force that of the nominal stiffness; q follows from a
    restitution e at an impact of 0.3 m/s by the law's exact relation
    ln((1 + q v) / (1 - q v e)) = q v (1 + e). Else: spring and dashpot, which never pull.
friction
    Stribeck at the pin and at the piston's seal, mu = (m_c + (m_s - m_c) exp(-(v / v_s)^2))
    tanh(v / v_0) and a viscous part (Armstrong-Helouvry et al. 1994,
    doi:10.1016/0005-1098(94)90209-7); the seal is pressed on by its tension and the pressure.
    Else: regularised Coulomb friction and a viscous part at the pin, no seal.
casing
    hysteretic damping, see `foreign_casing`. Else: viscous.
noise
    coloured, see `foreign_casing`. Else: white, at the nominal level.
ripple
    the crank runs free on a motor by Kloss's formula, M = 2 M_k s s_k / (s^2 + s_k^2), s the slip.
    Else: constant speed.

Two further programs have the same differences and one kind of wear besides, which judged models do
not draw:

loose
    main bearings with play: the crank's centre C moves, m_c C'' = -F - N - m_c g,
    G = C + r (cos a, sin a), and the casing feels N, the force of the journal on its bore by Hunt
    and Crossley's law with friction, instead of F.
oval
    an eye that has sunk in on the side of the wrist pin: the pin has the room of two half circles
    along the rod. The clearance is that along the rod.
"""

from dataclasses import dataclass, replace
from math import asin, cos, exp, floor, log, pi, sin, sqrt, tanh
from typing import NamedTuple

import numpy as np
from foreign_casing import CHANNELS, signal
from foreign_records import Job, Program
from numba import njit
from scipy.optimize import brentq

DIFFERENCES = ("pressure", "contact", "friction", "casing", "noise", "ripple")

RADIUS, LENGTH = 0.05, 0.25  # crank and rod [m]
ROD_MASS, ROD_CENTRE, ROD_INERTIA = 3.0, 0.165, 0.025  # [kg], from the wrist [m], [kg m^2]
PISTON_MASS, BORE = 6.0, 0.1  # [kg], [m]
AREA = pi * BORE**2 / 4
GRAVITY = 9.80665
SPEED = 5.0  # [Hz]
SUCTION, DISCHARGE = -0.03e6, 0.30e6  # [Pa]
RISE_ANGLE = np.radians(6.0)
PIN_RADIUS = 0.03
STIFFNESS, DAMPING = 200e6, 30e3  # of the pin [N/m], [N s/m]
FRICTION, FRICTION_SPEED, DRAG = 0.05, 0.02, 12.0  # [-], [m/s], [N s/m]
SYNCHRONOUS, BREAKDOWN_MOMENT, BREAKDOWN_SLIP = 5 / (1 - 0.011), 400.0, 0.2  # [Hz], [N m], [-]
INERTIA = 4.0  # of all that turns [kg m^2]
SAMPLE_RATE, DURATION, SETTLING = 25600.0, 4.8, 3.0  # [Hz], [s], [revolutions]
AS_NEW, CONDEMNING = 0.05e-3, 0.31e-3  # diametral clearance [m]
GRADE_EDGES = (0.13e-3, 0.22e-3, CONDEMNING)

JOURNAL_RADIUS, BORE_STIFFNESS = 0.035, 400e6  # of the main bearings together [m], [N/m]
STEPS = 8  # per sample: forces change by less than 0.1 % of their rms with 16
IMPACT_SPEED = 0.3  # pin across its clearance under the reversing force [m/s]
SEAL_WIDTH = 0.005  # of a piston's lip seal [m]
LARGEST_ANGLE = np.radians(7.0)
LEAST_TRANSITION = np.radians(0.2)  # 6 steps: a jump proper would need events


class Mechanism(NamedTuple):
    """What the kernel reads; SI, clearance radial."""

    clearance: float
    elastic: float  # Hunt-Crossley K [N/m^1.5], or stiffness [N/m]
    loss: float  # Hunt-Crossley q [s/m], or damping [N s/m]
    hertzian: bool
    coulomb: float
    static: float  # over sliding friction
    stribeck: float  # speed [m/s]
    sharp: float  # speed of the sign's change [m/s]
    smooth: bool  # tanh, else the root form
    drag: float
    seal: float  # friction of the seal's tension [N]
    seal_share: float  # further friction of the seal per pressure [N/Pa]
    suction: float
    discharge: float
    rise_delay: float
    rise: float
    fall_delay: float
    fall: float
    cubic: bool
    free: bool  # the crank's speed
    synchronous: float  # [rad/s]
    moment: float
    slip: float
    inertia: float
    gravity: float
    slot: float  # by which the eye is longer along the rod [m]
    crank_mass: float  # that moves in its bearings [kg]; 0 is none
    play: float  # radial [m]
    bore_elastic: float  # Hunt-Crossley K [N/m^1.5]
    bore_loss: float  # and q [s/m]
    bore_friction: float


@dataclass(frozen=True, kw_only=True)
class Machine:
    """One draw of a pump: factors on nominal values, and laws' constants in SI."""

    stiffness: float
    damping: float
    restitution: float
    friction: float
    static: float
    stribeck: float
    drag: float
    seal: float
    seal_friction: float
    rise_delay: float
    rise: float
    fall_delay: float
    fall: float
    inertia: float
    seed: int
    one_sided: float  # share of the wear
    crank_mass: float
    play: float  # diametral [m]
    bore_stiffness: float
    bore_restitution: float
    bore_friction: float


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Of one record; SI."""

    diametral_clearance: float
    speed_hz: float
    discharge: float
    start_angle: float
    seed: int


def machine_draw(seed: int, number: int) -> Machine:
    """Machine `number`; the same whatever differences are switched on."""
    rng = np.random.default_rng([seed, number, 1])
    worn = np.random.default_rng([seed, number, 4])
    return Machine(
        stiffness=rng.uniform(0.7, 1.4),
        damping=exp(rng.uniform(log(0.5), log(2.0))),
        restitution=rng.uniform(0.15, 0.5),  # nominal: about 0.4 along the stroke, 0.2 across
        friction=rng.uniform(0.02, 0.08),
        static=rng.uniform(1.2, 2.0),  # static over sliding friction
        stribeck=exp(rng.uniform(log(0.03), log(0.3))),
        drag=rng.uniform(0.5, 2.0),
        seal=rng.uniform(20.0, 120.0),
        seal_friction=rng.uniform(0.02, 0.08),
        rise_delay=rng.uniform(0.0, LARGEST_ANGLE),
        rise=max(rng.uniform(0.0, LARGEST_ANGLE), LEAST_TRANSITION),
        fall_delay=rng.uniform(0.0, LARGEST_ANGLE),
        fall=max(rng.uniform(0.0, LARGEST_ANGLE), LEAST_TRANSITION),
        inertia=exp(rng.uniform(log(0.5), log(2.0))),
        seed=int(rng.integers(2**62)),
        one_sided=worn.uniform(0.2, 0.7),
        crank_mass=exp(worn.uniform(log(20.0), log(100.0))),  # alone, and with a flywheel
        play=exp(worn.uniform(log(0.06e-3), log(0.16e-3))),
        bore_stiffness=worn.uniform(0.7, 1.4),
        bore_restitution=worn.uniform(0.15, 0.5),
        bore_friction=worn.uniform(0.02, 0.08),
    )


def conditions_draw(seed: int, record: int, *, healthy: bool = False) -> Conditions:
    """Speed, pressure, phase and wear of record `record`; healthy ones are run in at most."""
    rng = np.random.default_rng([seed, record, 3 if healthy else 2])
    low, high = (AS_NEW, 1.2 * AS_NEW) if healthy else (AS_NEW, 1.5 * CONDEMNING)
    return Conditions(
        diametral_clearance=exp(rng.uniform(log(low), log(high))),
        speed_hz=SPEED * rng.uniform(0.85, 1.15),
        discharge=DISCHARGE * rng.uniform(0.8, 1.2),
        start_angle=rng.uniform(0.0, 2 * pi),
        seed=int(rng.integers(2**62)),
    )


def hunt_crossley(stiffness: float, restitution: float) -> tuple[float, float]:
    """K [N/m^1.5] and q [s/m] of the law, by a secant stiffness [N/m] and a restitution."""
    overlap = AREA * DISCHARGE / stiffness

    def excess(loss: float) -> float:
        return log((1 + loss) / (1 - loss * restitution)) - loss * (1 + restitution)

    loss = brentq(excess, 1e-3, (1 - 1e-12) / restitution)
    return stiffness / sqrt(overlap), loss / IMPACT_SPEED


def mechanism(machine: Machine, run: Conditions, on: frozenset[str]) -> Mechanism:
    """What the kernel reads of a machine under conditions, with the differences `on`."""
    k, c = STIFFNESS * machine.stiffness, DAMPING * machine.damping
    elastic, loss = hunt_crossley(k, machine.restitution) if "contact" in on else (k, c)
    own = "friction" in on
    bore = hunt_crossley(BORE_STIFFNESS * machine.bore_stiffness, machine.bore_restitution)
    worn = max(0.0, run.diametral_clearance - AS_NEW)
    slot = machine.one_sided * worn if "oval" in on else 0.0
    shape = (
        (machine.rise_delay, machine.rise, machine.fall_delay, machine.fall)
        if "pressure" in on
        else (0.0, RISE_ANGLE, 0.0, RISE_ANGLE)
    )
    return Mechanism(
        clearance=(run.diametral_clearance - slot) / 2,
        elastic=elastic,
        loss=loss,
        hertzian="contact" in on,
        coulomb=machine.friction,
        static=machine.static if own else 1.0,
        stribeck=machine.stribeck,
        sharp=FRICTION_SPEED,
        smooth=own,
        drag=DRAG * (machine.drag if own else 1.0),
        seal=machine.seal if own else 0.0,
        seal_share=machine.seal_friction * pi * BORE * SEAL_WIDTH if own else 0.0,
        suction=SUCTION,
        discharge=run.discharge,
        rise_delay=shape[0],
        rise=shape[1],
        fall_delay=shape[2],
        fall=shape[3],
        cubic="pressure" not in on,
        free="ripple" in on,
        synchronous=2 * pi * run.speed_hz * SYNCHRONOUS / SPEED,
        moment=BREAKDOWN_MOMENT,
        slip=BREAKDOWN_SLIP,
        inertia=INERTIA * machine.inertia,
        gravity=GRAVITY,
        slot=slot,
        crank_mass=machine.crank_mass if "loose" in on else 0.0,
        play=machine.play / 2,
        bore_elastic=bore[0],
        bore_loss=bore[1],
        bore_friction=machine.bore_friction,
    )


@njit(cache=True)
def passed(angle, delay, width, cubic):
    """Share of a transition that is over at an angle after its dead centre."""
    u = (angle - delay) / width
    if not cubic:
        return 0.5 * (1.0 + tanh(4.0 * (u - 0.5)))  # 2 to 98 per cent over the width
    u = min(max(u, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


@njit(cache=True)
def pressure(angle, m):
    """Gauge pressure in the cylinder [Pa]; the piston withdraws from 0 to pi."""
    turn = angle / (2.0 * pi)
    after_top = 2.0 * pi * (turn - floor(turn + 0.5))  # -pi to pi
    turn -= 0.5
    after_bottom = 2.0 * pi * (turn - floor(turn + 0.5))
    if abs(after_top) < 0.5 * pi:
        share = 1.0 - passed(after_top, m.fall_delay, m.fall, m.cubic)
    else:
        share = passed(after_bottom, m.rise_delay, m.rise, m.cubic)
    return m.suction + (m.discharge - m.suction) * share


@njit(cache=True)
def normal(overlap, rate, m):
    """Force between pin and eye [N]."""
    if overlap <= 0.0:
        return 0.0
    if m.hertzian:
        return m.elastic * overlap * sqrt(overlap) * max(0.0, 1.0 + m.loss * rate)
    return max(0.0, m.elastic * overlap + m.loss * rate)


@njit(cache=True)
def friction(speed, m):
    """Friction over sliding friction, with the sign of the sliding speed."""
    if not m.smooth:
        return speed / sqrt(speed * speed + m.sharp * m.sharp)
    ratio = speed / m.stribeck
    return (1.0 + (m.static - 1.0) * exp(-ratio * ratio)) * tanh(speed / m.sharp)


@njit(cache=True)
def on_bore(y, m):
    """Force of the journal on its bore (x, y) [N]."""
    away = sqrt(y[6] * y[6] + y[7] * y[7]) + 1e-30
    n_x, n_y = y[6] / away, y[7] / away
    deep = away - m.play
    if deep <= 0.0:
        return 0.0, 0.0
    closing = n_x * y[8] + n_y * y[9]
    push = m.bore_elastic * deep * sqrt(deep) * max(0.0, 1.0 + m.bore_loss * closing)
    slide = n_x * y[9] - n_y * y[8] + y[1] * JOURNAL_RADIUS
    rub = m.bore_friction * tanh(slide / m.sharp) * push
    return push * n_x - rub * n_y, push * n_y + rub * n_x


@njit(cache=True)
def rates(y, m, dy, forces):
    """Rates of (a, a', x, x', b, b', C, C'), and forces on bearing (x, y), guide and cylinder."""
    a, w, x, u, b, v = y[0], y[1], y[2], y[3], y[4], y[5]
    sin_b, cos_b = sin(b), cos(b)
    pin_x, pin_y = RADIUS * cos(a), RADIUS * sin(a)
    gap_x, gap_y = y[6] + pin_x - x + LENGTH * cos_b, y[7] + pin_y - LENGTH * sin_b
    rate_x = y[8] - w * pin_y - u - LENGTH * sin_b * v
    rate_y = y[9] + w * pin_x - LENGTH * cos_b * v
    sunk = min(max(gap_x * cos_b - gap_y * sin_b, 0.0), m.slot)  # towards the wrist pin
    gap_x, gap_y = gap_x - sunk * cos_b, gap_y + sunk * sin_b
    rate_x, rate_y = rate_x + sunk * v * sin_b, rate_y + sunk * v * cos_b
    gap = sqrt(gap_x * gap_x + gap_y * gap_y) + 1e-30
    n_x, n_y = gap_x / gap, gap_y / gap
    push = normal(gap - m.clearance, n_x * rate_x + n_y * rate_y, m)
    rub = 0.0
    if gap > m.clearance:  # the rod turns at -b'
        slide = n_x * rate_y - n_y * rate_x + (w + v) * PIN_RADIUS
        rub = m.coulomb * friction(slide, m) * push + m.drag * slide
    force_x, force_y = push * n_x - rub * n_y, push * n_y + rub * n_x
    load = pressure(a, m)
    seal = (m.seal + m.seal_share * abs(load)) * friction(u, m)
    moment = ROD_MASS * ROD_CENTRE
    m11, m12 = PISTON_MASS + ROD_MASS, moment * sin_b
    m22 = ROD_INERTIA + moment * ROD_CENTRE
    q1 = force_x - load * AREA - seal - m11 * m.gravity - moment * cos_b * v * v
    q2 = (LENGTH - sunk) * (force_x * sin_b + force_y * cos_b)
    q2 -= rub * (PIN_RADIUS + m.clearance) + moment * m.gravity * sin_b
    det = m11 * m22 - m12 * m12
    rod_turn = (m11 * q2 - m12 * q1) / det
    dy[0], dy[1] = w, 0.0
    dy[2], dy[3] = u, (m22 * q1 - m12 * q2) / det
    dy[4], dy[5] = v, rod_turn
    if m.free:
        slip = 1.0 - w / m.synchronous
        motor = 2.0 * m.moment * slip * m.slip / (slip * slip + m.slip * m.slip)
        dy[1] = (motor - pin_x * force_y + pin_y * force_x - PIN_RADIUS * rub) / m.inertia
    forces[0], forces[1] = -force_x, -force_y
    for i in range(6, 10):
        dy[i] = 0.0
    if m.crank_mass > 0.0:
        bore_x, bore_y = on_bore(y, m)
        dy[6], dy[7] = y[8], y[9]
        dy[8] = -(force_x + bore_x) / m.crank_mass - m.gravity
        dy[9] = -(force_y + bore_y) / m.crank_mass
        forces[0], forces[1] = bore_x, bore_y
    forces[2] = force_y - moment * (cos_b * rod_turn - sin_b * v * v)
    forces[3] = load * AREA + seal


@njit(cache=True)
def march(y, m, step, n_steps):
    """Forces on the casing [shape=(n_steps, 4)] and states [shape=(n_steps, 10)] at step starts."""
    forces, states = np.empty((n_steps, 4)), np.empty((n_steps, 10))
    d, one, two, unused = np.empty(10), np.empty(10), np.empty(10), np.empty(4)
    for i in range(n_steps):
        states[i] = y
        rates(y, m, d, forces[i])
        one[:] = y + step * d
        rates(one, m, d, unused)
        two[:] = 0.75 * y + 0.25 * (one + step * d)
        rates(two, m, d, unused)
        y = y / 3.0 + 2.0 / 3.0 * (two + step * d)
    return forces, states


def start_state(angle: float, speed: float) -> np.ndarray:
    """State of the mechanism without clearance [shape=(10,)]."""
    b = asin(RADIUS / LENGTH * sin(angle))
    v = RADIUS * cos(angle) * speed / (LENGTH * cos(b))
    x = RADIUS * cos(angle) + LENGTH * cos(b)
    u = -RADIUS * sin(angle) * speed - LENGTH * sin(b) * v
    return np.array([angle, speed, x, u, b, v, 0.0, 0.0, 0.0, 0.0])


def simulate(
    machine: Machine,
    run: Conditions,
    on: frozenset[str],
    *,
    duration: float = DURATION,
    steps: int = STEPS,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Run one record.

    Returns
    -------
    forces : numpy.ndarray [shape=(n, 4)]
        On the casing at bearing x and y, guide y and cylinder x [N], every step.
    angle : numpy.ndarray [shape=(n,)]
        Of the crank [rad], every step.
    settled : int
        First step of the record; what comes before settles.
    """
    rate = SAMPLE_RATE * steps
    settled = int(np.ceil(SETTLING / run.speed_hz * SAMPLE_RATE)) * steps
    n_steps = settled + round(duration * SAMPLE_RATE) * steps
    omega = 2 * pi * run.speed_hz
    first = run.start_angle - omega * settled / rate
    forces, states = march(
        start_state(first, omega), mechanism(machine, run, on), 1 / rate, n_steps
    )
    if not np.isfinite(forces).all():
        raise ArithmeticError(f"{run}: forces are not finite; raise steps = {steps}")
    return forces, states[:, 0], settled


def record(job: Job, *, duration: float = DURATION) -> tuple[np.ndarray, dict[str, float]]:
    """Signal and manifest values of a job; see `foreign_records`."""
    machine = machine_draw(job.seed, job.machine)
    run = conditions_draw(job.seed, job.record, healthy=job.healthy)
    forces, angle, settled = simulate(machine, run, job.on, duration=duration)
    heard = signal(forces, angle, settled, STEPS, SAMPLE_RATE, machine.seed, run.seed, job.on)
    return heard, manifest_values(run, angle[settled:], duration)


def manifest_values(run: Conditions, angle: np.ndarray, duration: float) -> dict[str, float]:
    """Wear and conditions as the manifest names them, of a record with this crank angle."""
    turned = (angle[-1] - angle[0]) / (2 * pi) / (duration * (1 - 1 / len(angle)))
    values = (run.diametral_clearance, run.speed_hz, turned, run.discharge, SUCTION)
    return dict(zip(COLUMNS, values, strict=True))


COLUMNS = (
    *("diametral_clearance_crankpin_m", "speed_hz", "mean_speed_hz"),
    *("discharge_pressure_pa", "suction_pressure_pa"),
)

HEAD = {
    "sample_rate": SAMPLE_RATE,
    "channels": CHANNELS,
    "tacho": "tacho",
    "grade_edges": GRADE_EDGES,
    "condemning_limit": CONDEMNING,
    "limit_source": "Jetstream 3600/4200 plunger pump manual, rod bearing clearances",
}

PUMP_A = Program(
    name="independent pump A",
    differences=DIFFERENCES,
    make=record,
    columns=COLUMNS,
    head=HEAD,
    n_samples=round(DURATION * SAMPLE_RATE),
)
PUMP_LOOSE = replace(PUMP_A, name="pump A, loose", differences=(*DIFFERENCES, "loose"))
PUMP_OVAL = replace(PUMP_A, name="pump A, oval", differences=(*DIFFERENCES, "oval"))
