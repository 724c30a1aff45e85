"""An independent propulsion shaft, its beam by ROSS; see `foreign.py`.

Needs the extra `foreign` (tried with ROSS 2.3.0). `foreign_ross_line` balances ROSS's beam on
tilted films; about that balance shaft and housings move by

    (-w^2 M + i w (C + W G + C_f) + K + K_f) q = f,

solved directly at every line of the spectrum (banded elimination, no modes). Probes, run-out,
gains, offsets, accelerometers and tacho are as the scene `propulsion-shaft` and its recipe say;
nothing is from `wearstate.sim`. What differs from the library's scene, each to be switched off by
name (its standard recipe draws grooves, and arcs of the same geometry as `scar`):

grooves
    Two axial grooves at the sides of every bearing hold no pressure. Else: none.
scar
    The worn bore keeps its circle but for a scar below, as deep, of a radius drawn between the
    journal's and the bore's. Else: a wider circle, its top where it was.
thermal
    Every film is warmer than the oil that is noted, by half of its friction over the heat of the
    oil that leaks, at most 20 K. Else: as noted.
bores
    Drawn out of line: slopes to 0.1 mm/m in both planes, 0.1 mm to the side. Else: straight.
coupling
    Drawn direction of the offset and drawn angle to 0.3 mrad; its stiffness holds the shaft's end.
    Else: offset upwards, no angle, no stiffness to the shaft's own motion.
propeller
    Blade-rate shares of half to twice the nominal, drawn phases, a third harmonic; blades unlike by
    0.5 % of the thrust, which turns with the shaft. Else: as the scene has it.
turbulence
    von Karman's spectrum, (1 + (f / f_c)^2)^(-5/6), up and side correlated by 0.4. Else: the
    scene's, of one pole.
housing
    Structural damping of the same ratio, principal axes turned by up to 15 degrees. Else: viscous.
ripple
    The shaft's angle wanders by a random 0.2 % of the speed below 1 Hz; orders follow it.
    Else: constant speed.
noise
    Falls with f^-0.2 to f^-0.8, half to twice the nominal, with mains at 50, 150 and 250 Hz as
    large; probes curved by 1 % of their reading at the end of their range. Else: white.

All is simulated.
"""

import contextlib
from math import log, pi

import numpy as np
from foreign_line_draws import (
    BEARINGS,
    COUPLING_STIFFNESS,
    DISCS,
    Conditions,
    Machine,
    conditions_draw,
    machine_draw,
    viscosity,
)
from foreign_line_sensors import (
    BLADE_PHASE,
    BLADE_RATE,
    CONDEMNING,
    DURATION,
    GRADE_EDGES,
    RING_RADIUS,
    SAMPLE_RATE,
    STEPS,
    TORQUE,
    Drawn,
    exp_i,
    measured,
    parts_draw,
    shaft_angle,
)
from foreign_records import Job, Program
from foreign_ross_line import NoBalanceError, Rest, balance, beam, coupling_spring, pedestals
from scipy import fft
from scipy.linalg import solve_banded
from wearstate.sim.output.sensor import Channel

DIFFERENCES = (
    *("grooves", "scar", "thermal", "bores", "coupling"),
    *("propeller", "turbulence", "housing", "ripple", "noise"),
)
PROPELLER_DIAMETER = 2.4  # [m]
TURBULENCE = np.array(  # rms [N] and corner [Hz]: propeller, then the housings
    [[600, 30], [300, 80], [100, 150], [60, 200], [60, 200], [150, 200]]
)
CORRELATED = 0.4
ATTEMPTS = 5  # to draw a line whose journals do not touch
BAND = 9  # diagonals on either side: a node, its housing, the next node


# --- forces: order of the shaft -> complex amplitude at each number of the nodes


def order_forces(
    machine: Machine, part: Drawn, run: Conditions, on: frozenset[str]
) -> dict[int, np.ndarray]:
    """Re(f exp(i order angle)) on the shaft [shape=(4 n,)] of unbalance, blades, coupling."""
    shaft, omega = beam(), 2 * pi * run.speed_hz
    size = len(shaft.weight)
    turning = np.array([1.0, -1j])  # goes round from up to side
    aft, forward = (shaft.at(x) for x in DISCS[[0, -1], 0])
    once, twice = np.zeros(size, complex), np.zeros(size, complex)
    for x, u in zip(DISCS[:, 0], part.unbalance, strict=True):
        once[shaft.at(x) + np.arange(2)] += u * omega**2 * turning
    a, b, phase = part.uneven
    once[forward : forward + 2] += 1j * TORQUE * a / (2 * RING_RADIUS) * exp_i(phase) * turning
    direction = machine.coupling_direction if "coupling" in on else 0.0
    pull = COUPLING_STIFFNESS * run.coupling_offset * b / 2
    twice[forward : forward + 2] -= pull * exp_i(2 * phase - direction) * turning
    forces = {1: once, 2: twice}
    other = "propeller" in on
    if other:
        once[aft : aft + 2] += part.unlike * run.thrust * turning
    shares, phases = (part.blade_rate, part.blade_phase) if other else (BLADE_RATE, BLADE_PHASE)
    for k, (share, (up, side)) in enumerate(zip(shares, phases, strict=True)):
        arm = np.array([1.0, 1.0, PROPELLER_DIAMETER, PROPELLER_DIAMETER])
        at = forces.setdefault((k + 1) * part.blades, np.zeros(size, complex))
        at[aft : aft + 4] += run.thrust * share * arm * exp_i(np.array([up, side, up, side]))
    return forces


def random_forces(frequency: np.ndarray, length: int, seed: int, on: frozenset[str]) -> np.ndarray:
    """Spectra of propeller and housings, up and side [shape=(6, 2, n_freq)], for `irfft`."""
    rng = np.random.default_rng([seed, 14])
    level = TURBULENCE[:, 0] * np.exp(rng.uniform(log(0.5), log(2.0), 6))
    ratio = frequency / TURBULENCE[:, 1:]
    if "turbulence" in on:
        # over all frequencies 1 / B(1/2, 1/3) of the corner, twice for one side
        density = (
            level[:, None] ** 2 * 2 / (4.2065 * TURBULENCE[:, 1:]) * (1 + ratio**2) ** (-5 / 6)
        )
    else:
        density = level[:, None] ** 2 * 2 / (pi * TURBULENCE[:, 1:]) / (1 + ratio**2)
    white = rng.standard_normal((6, 2, len(frequency), 2)) @ np.array([1.0, 1j])
    if "turbulence" in on:
        white[:, 1] = CORRELATED * white[:, 0] + (1 - CORRELATED**2) ** 0.5 * white[:, 1]
    scale = np.sqrt(density * SAMPLE_RATE * length / 4)
    spectrum = scale[:, None] * white
    spectrum[..., 0] = 0.0
    return spectrum


# --- motion


class Line:
    """Dynamic stiffness of shaft and housings, in an order that keeps it banded."""

    def __init__(self, machine: Machine, run: Conditions, rest: Rest, on: frozenset[str]) -> None:
        shaft = beam()
        n = len(shaft.weight)
        self.nodes = np.array([shaft.at(x) for x in BEARINGS[:, 0]])
        after = np.searchsorted(self.nodes, np.arange(0, n, 4))  # housings before each node
        self.shaft = (np.arange(n).reshape(-1, 4) + 2 * after[:, None]).ravel()
        self.housings = self.shaft[self.nodes + 3][:, None] + np.array([1, 2])
        self.size = n + 10
        place = np.ix_(self.shaft, self.shaft)
        mass, damping, stiffness = (np.zeros((self.size,) * 2, complex) for _ in range(3))
        mass[place] = shaft.mass
        damping[place] = shaft.damping + 2 * pi * run.speed_hz * shaft.gyroscopic
        stiffness[place] = shaft.stiffness
        end = self.shaft[shaft.at(DISCS[-1, 0]) + np.arange(4)]
        stiffness[end, end] += coupling_spring(machine, on)
        springs = pedestals(machine, on)
        dampers = pedestals(machine, on, "damping")
        for i, film in enumerate(rest.films):
            at = self.housings[i]
            mass[at, at] += machine.housing[i, 0]
            if "housing" in on:
                ratio = machine.housing[i, 3] / np.sqrt(
                    machine.housing[i, 0] * machine.housing[i, 1]
                )
                stiffness[np.ix_(at, at)] += springs[i] * (1 + 1j * ratio)
            else:
                stiffness[np.ix_(at, at)] += springs[i]
                damping[np.ix_(at, at)] += dampers[i]
            joint = np.zeros((4, self.size))  # journal in its bore
            joint[np.arange(4), self.shaft[self.nodes[i] + np.arange(4)]] = 1.0
            joint[[0, 1], at] = -1.0
            rows = np.ix_(*(2 * [np.flatnonzero(joint.any(axis=0))]))
            stiffness[rows] += (joint.T @ film.stiffness @ joint)[rows]
            damping[rows] += (joint.T @ film.damping @ joint)[rows]
        self.bands = [_bands(each) for each in (mass, damping, stiffness)]

    def motion(self, frequency: float, force: np.ndarray) -> np.ndarray:
        """Complex motion [shape=(size,)] for a force at a frequency [Hz]."""
        w = 2 * pi * frequency
        mass, damping, stiffness = self.bands
        matrix = stiffness - w**2 * mass + 1j * w * damping
        return solve_banded((BAND, BAND), matrix, force, overwrite_ab=True, check_finite=False)

    def seen(self, motion: np.ndarray) -> np.ndarray:
        """Housings up, then the aft journal in its bore up and side [shape=(7, ...)]."""
        journal = motion[self.shaft[self.nodes[0] + np.arange(2)]]
        return np.concatenate([motion[self.housings[:, 0]], journal - motion[self.housings[0]]])


def _bands(matrix: np.ndarray) -> np.ndarray:
    n = len(matrix)
    found = np.zeros((2 * BAND + 1, n), complex)
    for k in range(-BAND, BAND + 1):
        diagonal = np.diagonal(matrix, k)
        found[BAND - k, max(k, 0) : n + min(k, 0)] = diagonal
    return found


def moved(
    machine: Machine, part: Drawn, run: Conditions, on: frozenset[str], angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places of the aft journal [shape=(2, n)] and accelerations of the housings [shape=(5, n)]."""
    rest = balance(machine, run, on)
    line = Line(machine, run, rest, on)
    shape = np.where(np.arange(7) < 5, 1, 0)[:, None]  # which are accelerations
    total = np.zeros((7, len(angle)))
    for order, force in order_forces(machine, part, run, on).items():
        full = np.zeros(line.size, complex)
        full[line.shaft] = force
        w = 2 * pi * order * run.speed_hz
        amplitude = line.seen(line.motion(order * run.speed_hz, full))[:, None]
        total += np.real(amplitude * (-(w**2)) ** shape * exp_i(order * angle))
    frequency = fft.rfftfreq(len(angle), 1 / SAMPLE_RATE)
    forces = random_forces(frequency, len(angle), run.seed, on)
    aft = line.shaft[beam().at(DISCS[0, 0]) + np.arange(2)]
    heard = np.zeros((7, len(frequency)), complex)
    for k in range(1, len(frequency)):
        full = np.zeros(line.size, complex)
        full[aft] = forces[0, :, k]
        full[line.housings] = forces[1:, :, k]
        heard[:, k] = line.seen(line.motion(frequency[k], full))
    heard *= (-((2 * pi * frequency) ** 2)) ** shape
    total += fft.irfft(heard, len(angle), axis=1)
    return rest.places[0, :2, None] + total[5:], total[:5]


# --- records


def record(job: Job, duration: float = DURATION) -> tuple[np.ndarray, dict[str, float]]:
    """Signal and manifest values of a job; see `foreign_records`. What touches is drawn again."""
    machine = machine_draw(job.seed, job.machine)
    for attempt in range(ATTEMPTS):
        run = conditions_draw(job.seed, job.record, healthy=job.healthy, attempt=attempt)
        with contextlib.suppress(NoBalanceError):
            return simulate(machine, run, job.on, duration), manifest_values(run)
    raise NoBalanceError(
        f"record {job.record}, machine {job.machine}: no draw of {ATTEMPTS} balances"
    )


def simulate(
    machine: Machine, run: Conditions, on: frozenset[str], duration: float = DURATION
) -> np.ndarray:
    """Five accelerometers, two probes, tacho [shape=(8, n)], float32."""
    part = parts_draw(machine.seed)
    fine = shaft_angle(run, round(duration * SAMPLE_RATE) * STEPS, ripple="ripple" in on)
    place, acceleration = moved(machine, part, run, on, fine[::STEPS])
    return measured(part, run, place, acceleration, fine, disturbed="noise" in on)


COLUMNS = (
    *("wear_down_bearing_1_m", "sag_bearing_3_m", "parallel_offset_coupling_m"),
    *("speed_hz", "mean_speed_hz", "viscosity_pa_s", "hull_deflection_m", "thrust_n"),
)


def manifest_values(run: Conditions) -> dict[str, float]:
    """What a record is labelled with, and what is noted of its day."""
    values = (
        *(run.wear_down, run.sag, run.coupling_offset),
        *(run.speed_hz, run.speed_hz, viscosity(run.temperature), run.hull, run.thrust),
    )
    return dict(zip(COLUMNS, values, strict=True))


NAMES = ("stern_aft", "stern_forward", "intermediate_aft", "intermediate_forward", "thrust_block")
SHAFT = Program(
    name="independent shaft",
    differences=DIFFERENCES,
    make=record,
    columns=COLUMNS,
    head={
        "sample_rate": SAMPLE_RATE,
        "channels": (
            *(Channel(name=f"acc_{n}", unit="m/s^2", quantity="acceleration") for n in NAMES),
            Channel(name="probe_1", unit="m", quantity="displacement"),
            Channel(name="probe_2", unit="m", quantity="displacement"),
            Channel(name="tacho", unit="V", quantity="tacho"),
        ),
        "tacho": "tacho",
        "grade_edges": GRADE_EDGES,
        "condemning_limit": CONDEMNING,
        "limit_source": "estimate: 3 per mille of the shaft's diameter, as the scene has it",
    },
    n_samples=round(DURATION * SAMPLE_RATE),
)
