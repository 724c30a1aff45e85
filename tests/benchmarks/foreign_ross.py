"""An independent journal bearing, its film by ROSS; see `foreign.py`.

Needs the extra `foreign` (tried with ROSS 2.3.0). Equilibrium, stiffness K and damping C are those
of ROSS's `PlainJournal`, a finite-volume film of two pads of 176 degrees, with grooves across the
load, by Lund's perturbation (Lund and Thomsen 1978; Daniel 2012, as ROSS cites them). The journal
moves about its equilibrium by

    M q'' + C q' + K q = U w^2 (cos(w t + p), sin(w t + p)),

linear, whereas the library integrates the whole film, without grooves, at one temperature. Run-out,
gains, offsets and noise of the probes are as the scene `journal-bearing` and its recipe say;
nothing is from `wearstate.sim`. Axes: X along the load, Y a quarter turn further in the direction
of rotation; ROSS has the load along -y, so that X = -y and Y = x.

thermal
    ROSS's energy equation with an ISO VG 46 oil, whose viscosity falls with temperature as ROSS's
    table has it, scaled to the record's viscosity at the supply's 47 C. Else: one viscosity.

Mesh: 20 by 6 volumes a pad; 30 by 8 moves the eccentricity by less than 0.004 of the clearance.
All is simulated.
"""

import contextlib
import io
import warnings
from dataclasses import dataclass
from math import exp, log, pi

import numpy as np
from foreign_casing import tacho
from foreign_records import Job, Program
from wearstate.sim.output.sensor import Channel

SPEED, DIAMETER, LENGTH = 50.0, 0.1, 0.06  # [Hz], [m], [m]
VISCOSITY, SUPPLY = 0.03, 47.0  # [Pa s], [C]
MASS, UNBALANCE, GRAVITY, STATIC_LOAD = 100.0, 8e-4, 9.80665, 5000.0  # [kg], [kg m], -, [N]
RUN_OUT = np.array([2e-6, 0.7e-6, 0.3e-6])  # orders 1 to 3 [m]
PROBES = np.radians([225.0, 135.0])
NOISE, RANGE, BITS = 0.05e-6, 1e-3, 24  # [m], [m], [-]
PULSE_WIDTH = 20 / 360  # of the tacho [revolutions]
SAMPLE_RATE, DURATION = 5120.0, 0.48  # [Hz], [s]
AS_NEW, CONDEMNING = 0.0914e-3, 0.2413e-3  # diametral clearance [m]
GRADE_EDGES = (0.1905e-3, 0.2159e-3, CONDEMNING)
OFFSET = 5e-6  # of a probe's gap, largest [m]
STEPS = 8  # of the crank angle per sample, for the tacho's edges


@dataclass(frozen=True, kw_only=True)
class Journal:
    """One draw of a machine; SI."""

    unbalance: float
    unbalance_angle: float
    run_out: np.ndarray
    phase: np.ndarray
    gain: np.ndarray
    noise: np.ndarray
    offset: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """Of one record; SI."""

    diametral_clearance: float
    speed_hz: float
    static_load: float
    viscosity: float
    start_angle: float
    seed: int


def journal_draw(seed: int, number: int) -> Journal:
    """Machine `number`."""
    rng = np.random.default_rng([seed, number, 5])
    return Journal(
        unbalance=UNBALANCE * exp(rng.uniform(log(0.5), log(2.0))),
        unbalance_angle=rng.uniform(0, 2 * pi),
        run_out=RUN_OUT * np.exp(rng.uniform(log(0.3), log(2.0), 3)),
        phase=rng.uniform(0, 2 * pi, 3),
        gain=rng.uniform(0.95, 1.05, 2),
        noise=NOISE * np.exp(rng.uniform(log(0.5), log(2.0), 2)),
        offset=rng.uniform(-OFFSET, OFFSET, 2),
    )


def conditions_draw(seed: int, record: int, *, healthy: bool = False) -> Conditions:
    """Conditions and wear of record `record`."""
    rng = np.random.default_rng([seed, record, 7 if healthy else 6])
    low, high = (AS_NEW, 1.1 * AS_NEW) if healthy else (AS_NEW, 1.5 * CONDEMNING)
    return Conditions(
        diametral_clearance=exp(rng.uniform(log(low), log(high))),
        speed_hz=SPEED * rng.uniform(0.85, 1.15),
        static_load=STATIC_LOAD * rng.uniform(0.8, 1.2),
        viscosity=VISCOSITY * rng.uniform(0.8, 1.2),
        start_angle=rng.uniform(0, 2 * pi),
        seed=int(rng.integers(2**62)),
    )


def lubricant(viscosity: float, *, thermal: bool) -> dict[str, float]:
    """Oil as ROSS takes it, of a viscosity [Pa s] at the supply's temperature."""
    from ross.bearings.lubricants import lubricants_dict

    oil = dict(lubricants_dict["ISOVG46"])
    cold, hot = oil["liquid_viscosity1"], oil["liquid_viscosity2"]
    warm, warmest = (oil[f"temperature{i}"] - 273.15 for i in (1, 2))
    power = log(hot / cold) / log(warmest / warm)  # the curve that ROSS lays through both
    scale = viscosity / (cold * (SUPPLY / warm) ** power)
    if not thermal:
        # ROSS cannot fit a curve to two equal values
        return {**oil, "liquid_viscosity1": viscosity, "liquid_viscosity2": viscosity * (1 - 1e-6)}
    return {**oil, "liquid_viscosity1": scale * cold, "liquid_viscosity2": scale * hot}


def film(run: Conditions, *, thermal: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Equilibrium [shape=(2,)] [m], stiffness and damping [shape=(2, 2)] in X and Y."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")  # ROSS and its libraries talk at import
        from ross.bearings.plain_journal import PlainJournal

        bearing = PlainJournal(
            n=0,
            axial_length=LENGTH,
            journal_radius=DIAMETER / 2,
            radial_clearance=run.diametral_clearance / 2,
            elements_circumferential=20,
            elements_axial=6,
            n_pad=2,
            pad_arc_length=176,
            preload=0,
            geometry="circular",
            reference_temperature=SUPPLY,
            frequency=np.array([2 * pi * run.speed_hz]),
            fxs_load=0,
            fys_load=-(run.static_load + MASS * GRAVITY),
            groove_factor=[0.5, 0.5],
            lubricant=lubricant(run.viscosity, thermal=thermal),
            sommerfeld_type=2,
            initial_guess=[0.5, -0.8],
            method="lund",
            operating_type="flooded",
            oil_supply_pressure=0,
            oil_flow_v=1e-4,  # not used by a flooded bearing
        )
    eccentricity, angle = bearing.equilibrium_pos
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])  # ROSS's (x, y) to (X, Y)
    place = eccentricity * run.diametral_clearance / 2 * np.array([np.cos(angle), np.sin(angle)])
    pairs = [
        np.array([getattr(bearing, f"{letter}{one}{two}")[0] for one in "xy" for two in "xy"])
        for letter in "kc"
    ]
    stiffness, damping = (turned @ pair.reshape(2, 2) @ turned.T for pair in pairs)
    return turned @ place, stiffness, damping


def orbit(stiffness, damping, unbalance: float, omega: float) -> np.ndarray:
    """Complex amplitudes of X and Y for an unbalance along X at time 0; Re(a exp(i w t))."""
    force = unbalance * omega**2 * np.array([1.0, -1j])
    return np.linalg.solve(stiffness - omega**2 * MASS * np.eye(2) + 1j * omega * damping, force)


def record(job: Job) -> tuple[np.ndarray, dict[str, float]]:
    """Signal and manifest values of a job; see `foreign_records`."""
    machine = journal_draw(job.seed, job.machine)
    run = conditions_draw(job.seed, job.record, healthy=job.healthy)
    omega, n = 2 * pi * run.speed_hz, round(SAMPLE_RATE * DURATION)
    place, stiffness, damping = film(run, thermal="thermal" in job.on)
    angle = run.start_angle + omega * np.arange(n) / SAMPLE_RATE
    amplitude = orbit(stiffness, damping, machine.unbalance, omega)
    moving = np.real(amplitude[:, None] * np.exp(1j * (angle + machine.unbalance_angle)))
    signal = probes(place[:, None] + moving, angle, machine, run.seed)
    fine = run.start_angle + omega * np.arange(n * STEPS) / (SAMPLE_RATE * STEPS)
    pulses = tacho(fine, STEPS, SAMPLE_RATE, width=PULSE_WIDTH)
    values = (
        *(run.diametral_clearance, run.speed_hz, run.speed_hz),
        *(run.static_load, run.viscosity),
    )
    return np.vstack([signal, pulses]).astype(np.float32), dict(zip(COLUMNS, values, strict=True))


def probes(position, angle, machine: Journal, seed: int) -> np.ndarray:
    """What both probes read [shape=(2, n)] of positions [shape=(2, n)] [m]."""
    rng = np.random.default_rng([seed, 8])
    read = []
    for place, gain, noise, offset in zip(
        PROBES, machine.gain, machine.noise, machine.offset, strict=True
    ):
        towards = np.array([np.cos(place), np.sin(place)]) @ position
        orders = np.arange(1, 4)[:, None] * (angle - place) + machine.phase[:, None]
        gap = towards + machine.run_out @ np.cos(orders) + offset
        read.append(gain * gap + noise * rng.standard_normal(len(angle)))
    step = 2 * RANGE / 2**BITS
    return np.round(np.clip(read, -RANGE, RANGE) / step) * step


COLUMNS = (
    *("diametral_clearance_bearing_m", "speed_hz", "mean_speed_hz"),
    *("static_load_n", "viscosity_pa_s"),
)

JOURNAL = Program(
    name="independent journal",
    differences=("thermal",),
    make=record,
    columns=COLUMNS,
    head={
        "sample_rate": SAMPLE_RATE,
        "channels": (
            Channel(name="probe_1", unit="m", quantity="displacement"),
            Channel(name="probe_2", unit="m", quantity="displacement"),
            Channel(name="tacho", unit="V", quantity="tacho"),
        ),
        "tacho": "tacho",
        "grade_edges": GRADE_EDGES,
        "condemning_limit": CONDEMNING,
        "limit_source": "TM 9-6115-604-34, engine main bearing clearances",
    },
    n_samples=round(DURATION * SAMPLE_RATE),
)
