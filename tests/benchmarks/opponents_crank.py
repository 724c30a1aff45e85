"""Time against error of the benchmark crank: wearstate, scipy's LSODA, Exudyn.

Run as ``python tests/benchmarks/opponents_crank.py --exudyn PYTHON --plot opponents.png`` where
PYTHON is an interpreter that has Exudyn (default: this one; without Exudyn its part is skipped
with a message). Text goes to stderr, one JSON object to stdout. What is compared, and what came
out, stands in ``docs/opponents.md``.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numba import njit
from scipy.integrate import odeint, solve_ivp
from wearstate.sim.contact.law import RELEASE_AT_ZERO_FORCE, RELEASE_AT_ZERO_PENETRATION
from wearstate.sim.mechanism.crank_run import run_mechanism
from wearstate.sim.mechanism.layout import AT_REST, CRANKPIN
from wearstate.sim.pump_lanes.lane_layout import LANES
from wearstate.sim.pump_lanes.lanes import LaneJob, lane_kind, run_lanes
from wearstate.sim.pump_setup.films import start_films
from wearstate.sim.pump_setup.tables import Start, tables
from wearstate.sim.pump_setup.tables import start_state as bodies_at
from wearstate.sim.scene.load import load_scene

SAMPLES_PER_REVOLUTION = 256  # three a contact period; every fixed step divides it
HORIZONS = (0.25, 0.5)  # revolutions
START_ANGLES = 0.1 + 2 * np.pi / 8 * np.arange(8)  # rad
REFERENCE_PART = 512  # steps between two samples of the reference
TARGETS = (1e-2, 1e-3)  # relative rms error of the pin force at which times are compared
RELEASES = {
    "zero force": RELEASE_AT_ZERO_FORCE,
    "zero penetration": RELEASE_AT_ZERO_PENETRATION,
}
EXUDYN_CONTACT = {"hollow sphere": "zero penetration", "symbolic force": "zero force"}
TIMING_REVOLUTIONS = 4.0
EXUDYN_PATIENCE = 60.0  # s for one setting; those that reach 1e-4 need 10 s

MANY = ", many at once"

# --- adapter: all that knows how the mechanism is called

SCENE = load_scene("slider-crank-benchmark", {"joint.crankpin.friction": 0.0})
REVOLUTION = 1.0 / SCENE.drive.speed  # s
STATE_COLUMNS = [3, 9, 2, 8]  # of the bodies: piston and its velocity, rod angle and its rate


def crank_numbers():
    """Geometry, masses and contact, in SI."""
    joint = SCENE.joint.crankpin
    return {
        "crank_radius": SCENE.crank.radius,
        "rod_length": SCENE.rod.length,
        "rod_mass": SCENE.rod.mass,
        "rod_centre": SCENE.rod.centre_of_mass,
        "rod_inertia": SCENE.rod.inertia,
        "piston_mass": SCENE.piston.mass,
        "pin_radius": joint.pin_diameter / 2,
        "clearance": joint.clearance_radial,
        "stiffness": joint.stiffness,
        "damping": joint.damping,
    }


def start_state(angle):
    """Crank angle and rate, piston position and velocity, rod angle and rate.

    The pin rests in its eye under the force that an ideal joint would carry.
    """
    bodies = bodies_at(SCENE, angle, tables(SCENE, 1e-6))[0]
    speed = 2 * np.pi * SCENE.drive.speed
    return (angle, speed, *(float(bodies[column]) for column in STATE_COLUMNS))


def tables_and_bodies(start, release, step):
    """What the mechanism is told of its numbers, and where its bodies begin."""
    told = tables(SCENE, step)
    told.contacts[0, CRANKPIN]["release"] = RELEASES[release]
    _, _, x, u, beta, b = start
    centre, sine, cosine = SCENE.rod.centre_of_mass, np.sin(beta), np.cos(beta)
    rod = [x - centre * cosine, centre * sine]
    rod_velocity = [u + centre * sine * b, centre * cosine * b]
    return told, np.array([[*rod, beta, x, 0.0, 0.0, *rod_velocity, b, u, 0.0, 0.0]])


def prepared_run(start, release, step, n_steps, *, keep_states):
    """The run as a function without arguments; tables and start are made beforehand."""
    told, bodies = tables_and_bodies(start, release, step)
    return partial(
        run_mechanism,
        told,
        angle=start[0],
        speed=start[1],
        bodies=bodies,
        step=step,
        n_steps=n_steps,
        keep_states=keep_states,
    )


def prepared_lanes(starts, release, step, n_steps):
    """Runs side by side as a function without arguments; they have the states of each alone."""
    jobs = []
    for start in starts:
        told, bodies = tables_and_bodies(start, release, step)
        begin = Start(start[0], start[1], bodies, np.zeros((1, 6)), np.zeros(6))
        films = start_films(told, bodies, start[0], np.zeros(6))
        jobs.append(
            LaneJob(
                tables=told, start=begin, step=step, n_steps=n_steps, films=films, casing=AT_REST
            )
        )

    def run():
        for _, found in run_lanes(jobs, lane_kind(SCENE), Unheard):
            assert found.status.ok

    return run


class Unheard:
    """Steps that nobody listens to."""

    def __init__(self, number):
        self.number = number

    def add(self, turns, forces, chambers, gaps):
        """Take the next steps of a run, and leave them."""


def run_ours(start, release, step, n_steps):
    """States at the ends of the steps [shape=(n_steps + 1, 6)], columns as `start_state`."""
    run = prepared_run(start, release, step, n_steps, keep_states=True)()
    assert run.status.ok
    return np.column_stack([run.turns, run.bodies[:, 0, STATE_COLUMNS]])


# --- the same crank as two equations, for scipy


def compiled_mechanism(release):
    """Rate of the state with the contact held open or closed, and the contact's margin.

    Lagrange's equations in piston position and rod angle, the least that describes this machine
    and shares nothing with the library's general mechanism. The margin is positive while the
    contact stays as it is.
    """
    crank = crank_numbers()
    r, length, clearance = crank["crank_radius"], crank["rod_length"], crank["clearance"]
    stiffness, damping = crank["stiffness"], crank["damping"]
    m11 = crank["rod_mass"] + crank["piston_mass"]
    moment = crank["rod_mass"] * crank["rod_centre"]
    m22 = crank["rod_inertia"] + moment * crank["rod_centre"]
    at_zero_force = release == "zero force"

    @njit(inline="always")
    def contact_state(y):
        alpha, omega, x, u, beta, b = y[0], y[1], y[2], y[3], y[4], y[5]
        sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
        d_x = r * cos_a + length * cos_b - x
        d_y = r * sin_a - length * sin_b
        distance = np.sqrt(d_x * d_x + d_y * d_y)
        approach = (
            -(r * sin_a * omega + length * sin_b * b + u) * d_x
            + (r * cos_a * omega - length * cos_b * b) * d_y
        ) / distance
        depth = distance - clearance
        law = stiffness * depth + damping * approach
        return depth, law, d_x / distance, d_y / distance, sin_b, cos_b

    @njit(inline="always")
    def closes(depth, law):
        return depth > 0.0 and (law > 0.0 or not at_zero_force)

    @njit(inline="always")
    def accelerate(y, push, n_x, n_y, sin_b, cos_b):
        b = y[5]
        coupling = moment * sin_b
        along = push * n_x - moment * cos_b * b * b
        turning = length * push * (n_x * sin_b + n_y * cos_b)
        inverse = 1.0 / (m11 * m22 - coupling * coupling)
        rates = np.empty(6)
        rates[0], rates[1], rates[2], rates[4] = y[1], 0.0, y[3], b
        rates[3] = (m22 * along - coupling * turning) * inverse
        rates[5] = (m11 * turning - coupling * along) * inverse
        return rates

    @njit
    def rate(y, contact):
        _, law, n_x, n_y, sin_b, cos_b = contact_state(y)
        return accelerate(y, law if contact else 0.0, n_x, n_y, sin_b, cos_b)

    @njit
    def margin(y, contact):
        depth, law = contact_state(y)[:2]
        if not at_zero_force:
            return stiffness * depth if contact else -stiffness * depth
        return law if contact else -min(stiffness * depth, law)

    @njit
    def decided_rate(_, y):
        depth, law, n_x, n_y, sin_b, cos_b = contact_state(y)
        push = law if closes(depth, law) else 0.0
        return accelerate(y, push, n_x, n_y, sin_b, cos_b)

    return rate, margin, decided_rate


# --- the measure


def pin_force(states, crank=None):
    """Force of the pin on the rod from the state [N, shape=(n, 2)], the same for everyone."""
    crank = crank or crank_numbers()
    alpha, omega, x, u, beta, b = states.T
    radius, length = crank["crank_radius"], crank["rod_length"]
    along = radius * np.cos(alpha) + length * np.cos(beta) - x
    across = radius * np.sin(alpha) - length * np.sin(beta)
    speed_along = -radius * np.sin(alpha) * omega - length * np.sin(beta) * b - u
    speed_across = radius * np.cos(alpha) * omega - length * np.cos(beta) * b
    distance = np.hypot(along, across)
    depth = distance - crank["clearance"]
    law = crank["stiffness"] * depth + crank["damping"] / distance * (
        along * speed_along + across * speed_across
    )
    push = np.where((depth > 0.0) & (law > 0.0), law, 0.0) / distance
    return np.column_stack([push * along, push * across])


def sample_times():
    """Instants at which states are compared [s], over the longest horizon."""
    count = round(max(HORIZONS) * SAMPLES_PER_REVOLUTION)
    return REVOLUTION / SAMPLES_PER_REVOLUTION * np.arange(count + 1)


def errors(found, reference):
    """Horizon -> relative rms pin-force error and piston error over the clearance.

    Both are pooled over all start angles [shape=(n_starts, n_samples, 6)].
    """
    clearance = crank_numbers()["clearance"]
    result = {}
    for horizon in HORIZONS:
        last = round(horizon * SAMPLES_PER_REVOLUTION) + 1
        ours, theirs = (np.concatenate([run[:last] for run in runs]) for runs in (found, reference))
        wanted = pin_force(theirs)
        miss = np.linalg.norm(pin_force(ours) - wanted) / np.linalg.norm(wanted)
        piston = np.sqrt(np.mean((ours[:, 2] - theirs[:, 2]) ** 2)) / clearance
        result[str(horizon)] = {"force": float(miss), "piston": float(piston)}
    return result


@dataclass
class Curve:
    """One method over its settings; a point has the setting, `seconds` and `errors`."""

    name: str
    points: list = field(default_factory=list)

    def front(self, horizon, quantity="force"):
        """Settings that no other beats in both, as arrays of error and time, time rising."""
        best, errors_, times = np.inf, [], []
        for point in sorted(self.points, key=lambda q: q["seconds"]):
            error = point["errors"][str(horizon)][quantity]
            if error < best:
                best = error
                errors_.append(error)
                times.append(point["seconds"])
        return np.array(errors_), np.array(times)

    def time_at(self, target, horizon):
        """Time at an error, log-log along the front; None where the front does not reach it."""
        error, seconds = self.front(horizon)
        if not len(error) or not error.min() <= target <= error.max():
            return None
        return float(np.exp(np.interp(-np.log(target), -np.log(error), np.log(seconds))))


def processor_time(run, repeats):
    """Median processor time of a call [s]; all methods use one thread."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        run()
        times.append(time.process_time() - begin)
    return float(np.median(times))


# --- references


def reference_ours(release):
    """Fixed tiny step."""
    step = REVOLUTION / SAMPLES_PER_REVOLUTION / REFERENCE_PART
    count = (len(sample_times()) - 1) * REFERENCE_PART
    return [
        run_ours(start_state(angle), release, step, count)[::REFERENCE_PART]
        for angle in START_ANGLES
    ]


def reference_events(release, tolerance=1e-12):
    """DOP853 from contact change to contact change, each located on its dense output."""
    rate, margin, _ = compiled_mechanism(release)
    return [_follow(start_state(angle), rate, margin, tolerance) for angle in START_ANGLES]


def _follow(start, rate, margin, tolerance):
    times = sample_times()
    states = np.empty((len(times), len(start)))
    y, t = np.array(start), 0.0
    contact = margin(y, False) < 0.0

    def change(_, y):
        return margin(y, contact)

    change.terminal, change.direction = True, -1.0
    while t < times[-1]:
        part = solve_ivp(
            lambda _, y, closed=contact: rate(y, closed),
            (t, times[-1]),
            y,
            method="DOP853",
            rtol=tolerance,
            atol=tolerance * SCALES,
            max_step=REVOLUTION / 2048,  # no two changes hide in one step
            events=change,
            dense_output=True,
        )
        inside = (times >= t) & (times <= part.t[-1])
        if inside.any():
            states[inside] = part.sol(times[inside]).T
        t, y = part.t[-1], part.y[:, -1]
        contact = not contact
    return states


SCALES = np.array([1.0, 100.0, 1e-3, 1.0, 1e-2, 10.0])
"""Sizes that a tolerance is relative to: clearance and impact speeds, not strokes and speeds."""


# --- the methods


def ours(release, references, repeats, many=False):
    """Fixed steps, from the coarsest that is admitted; `many`: 16 records at once, time of one."""
    curve = Curve(f"wearstate, {release}{MANY if many else ''}")
    for part in (6, 8, 11, 16, 23, 32, 45, 64, 91, 128):
        step = REVOLUTION / SAMPLES_PER_REVOLUTION / part
        count = (len(sample_times()) - 1) * part
        states = [run_ours(start_state(a), release, step, count)[::part] for a in START_ANGLES]
        steps = round(TIMING_REVOLUTIONS * SAMPLES_PER_REVOLUTION) * part
        if many:
            starts = [start_state(a) for a in np.tile(START_ANGLES, LANES // len(START_ANGLES))]
            timed, runs = prepared_lanes(starts, release, step, steps), LANES
        else:
            timed, runs = (
                prepared_run(start_state(0.1), release, step, steps, keep_states=False),
                1,
            )
        seconds = processor_time(timed, repeats) / runs
        curve.points.append(
            {
                "steps": part * SAMPLES_PER_REVOLUTION,
                "seconds": seconds / (TIMING_REVOLUTIONS * REVOLUTION),
                "errors": errors(states, references[release]),
            }
        )
    return curve


def solver_call(name, right_hand_side):
    """Function of start, times, relative and absolute tolerance that returns the states."""

    def by_odeint(start, times, rtol, atol):
        return odeint(
            right_hand_side, start, times, tfirst=True, rtol=rtol, atol=atol, mxstep=10**8
        )

    def by_solve_ivp(start, times, rtol, atol):
        span = (times[0], times[-1])
        return solve_ivp(
            right_hand_side, span, start, method=name, t_eval=times, rtol=rtol, atol=atol
        ).y.T

    return by_odeint if name == "odeint" else by_solve_ivp


def stacked(name, right_hand_side):
    """As :func:`solver_call`, of all start angles as one system: Python's share is paid once."""
    size, n = 6, len(START_ANGLES)

    @njit
    def all_rates(t, y):
        rates = np.empty(n * size)
        for k in range(0, n * size, size):
            rates[k : k + size] = right_hand_side(t, y[k : k + size])
        return rates

    def by_odeint(starts, times, rtol, atol):
        return odeint(
            all_rates,
            starts.ravel(),
            times,
            tfirst=True,
            rtol=rtol,
            atol=np.tile(atol, n),
            ml=size - 1,  # the Jacobian is a band: no crank knows of the others
            mu=size - 1,
            mxstep=10**8,
        )

    def by_solve_ivp(starts, times, rtol, atol):
        banded = {"lband": size - 1, "uband": size - 1} if name == "LSODA" else {}
        return solve_ivp(
            all_rates,
            (times[0], times[-1]),
            starts.ravel(),
            method=name,
            t_eval=times,
            rtol=rtol,
            atol=np.tile(atol, n),
            **banded,
        ).y.T

    return by_odeint if name == "odeint" else by_solve_ivp


def scipy_at_once(name, release, references, repeats):
    """A scipy method on all start angles as one system, over its tolerance; time of one."""
    curve = Curve({"odeint": "LSODA (odeint)"}.get(name, f"{name} (solve_ivp)") + MANY)
    call = stacked(name, compiled_mechanism(release)[2])
    starts = np.array([start_state(a) for a in START_ANGLES])
    times, n = sample_times(), len(START_ANGLES)
    ends = np.array([0.0, REVOLUTION])
    for tolerance in 10.0 ** np.arange(-4.0, -10.5, -1.0):
        settings = (tolerance, tolerance * SCALES)
        found = call(starts, times, *settings)
        states = [found[:, 6 * k : 6 * k + 6] for k in range(n)]
        seconds = processor_time(lambda settings=settings: call(starts, ends, *settings), repeats)
        curve.points.append(
            {
                "tolerance": tolerance,
                "seconds": seconds / REVOLUTION / n,
                "errors": errors(states, references[release]),
            }
        )
    return curve


def scipy_solver(name, release, references, repeats):
    """A scipy method over its tolerance, absolute ones at two sizes."""
    curve = Curve({"odeint": "LSODA (odeint)"}.get(name, f"{name} (solve_ivp)"))
    right_hand_side = compiled_mechanism(release)[2]  # the contact by the state: no history
    right_hand_side(0.0, np.array(start_state(0.1)))  # compile
    call = solver_call(name, right_hand_side)
    times = sample_times()
    ends = np.array([0.0, 1.0 * REVOLUTION])  # no output in between to pay for
    for size in (1.0, 0.01):
        for tolerance in 10.0 ** np.arange(-4.0, -11.5, -0.5):
            settings = (max(tolerance, 1e-12), tolerance * size * SCALES)
            states = [call(start_state(a), times, *settings) for a in START_ANGLES]
            seconds = processor_time(
                lambda settings=settings: call(start_state(0.1), ends, *settings), repeats
            )
            curve.points.append(
                {
                    "tolerance": tolerance,
                    "absolute": size,
                    "seconds": seconds / REVOLUTION,
                    "errors": errors(states, references[release]),
                }
            )
    return curve


def exudyn_settings():
    """What is tried: solver, contact, step or tolerance.

    `recovery` is the number of steps after which Exudyn lengthens a step that it had cut at a
    contact (its default is 10); 0 for steps that are never cut.
    """
    fixed = [
        ("hollow sphere", "RK44", 0),
        ("hollow sphere", "VelocityVerlet", 0),
        ("hollow sphere", "GeneralizedAlpha", 0),
        ("symbolic force", "RK44", 0),
        ("symbolic force", "VelocityVerlet", 0),
        ("symbolic force", "GeneralizedAlpha", 0),
        ("hollow sphere", "RK44", 1),
        ("hollow sphere", "RK44", 10),
        ("hollow sphere", "ExplicitMidpoint", 1),
    ]
    settings = [
        {
            "contact": "hollow sphere",
            "solver": "GeneralizedAlpha",
            "recovery": 0,
            "steps": steps,
            "jointed": True,
        }
        for steps in (1024, 2048, 4096, 8192, 16384, 32768)
    ]
    settings += [
        {
            "contact": contact,
            "solver": solver,
            "recovery": recovery,
            "steps": steps,
            "jointed": False,
        }
        for contact, solver, recovery in fixed
        for steps in (
            (1024, 1448, 2048, 2896, 4096, 5792, 8192, 11585, 16384)
            if recovery
            else (1024, 2048, 4096, 8192, 16384, 32768)
        )
    ]
    for contact, recovery in (("hollow sphere", 1), ("symbolic force", 0)):
        settings += [
            {
                "contact": contact,
                "solver": solver,
                "recovery": recovery,
                "jointed": False,
                "steps": 256,  # the largest step of the adaptive ones
                "tolerance": tolerance,
                "scale": 1e-2,
            }
            for solver in ("DOPRI5", "ODE23")
            for tolerance in (1e-4, 1e-5, 1e-6, 1e-7)
        ]
    return settings


def ask_exudyn(python, settings, repeats):
    """Send a job to the interpreter with Exudyn; None where it does not answer in time."""
    job = {
        "crank": crank_numbers(),
        "starts": [list(map(float, start_state(angle))) for angle in START_ANGLES],
        "revolution": REVOLUTION,
        "times": sample_times().tolist(),
        "settings": settings,
        "timing_revolutions": 1.0,
        "repeats": repeats,
    }
    command = [python, str(Path(__file__).with_name("exudyn_crank.py"))]
    try:
        answer = subprocess.run(
            command,
            input=json.dumps(job),
            stdout=subprocess.PIPE,
            text=True,
            check=True,
            timeout=EXUDYN_PATIENCE,
        ).stdout
    except (OSError, subprocess.SubprocessError) as error:
        print(f"  no answer to {settings}: {type(error).__name__}", file=sys.stderr)
        return None
    return json.loads(answer[answer.index("{") :])  # after its greeting


def exudyn_curves(python, references, repeats):
    """One curve for each solver and contact."""
    if ask_exudyn(python, [], 0) is None:
        print(f"{python} has no Exudyn; its part is skipped", file=sys.stderr)
        return []
    curves = {}
    for setting in exudyn_settings():  # one at a time: some never end
        answer = ask_exudyn(python, [setting], repeats) or {"runs": []}
        for run in answer["runs"]:
            cuts = f", cut, recovery {run['recovery']}" if run["recovery"] else ""
            built = ", bodies and joints" if run["jointed"] else ""
            name = f"Exudyn {answer['version']} {run['solver']}, {run['contact']}{cuts}{built}"
            states = np.array(run.pop("states"))
            reference = references[EXUDYN_CONTACT[run["contact"]]]
            point = {**run, "errors": errors(states, reference)}
            curves.setdefault(name, Curve(name)).points.append(point)
    return list(curves.values())


# --- what comes out


def joined(name, curves):
    """The best of several curves as one."""
    return Curve(name, [point for curve in curves for point in curve.points])


def ratios(base, opponents):
    """Opponent, horizon, error -> time over ours at the same error."""
    found = {}
    for opponent in opponents:
        for horizon in HORIZONS:
            for target in TARGETS:
                ours_, theirs = (c.time_at(target, horizon) for c in (base, opponent))
                key = f"{opponent.name}, {horizon} revolution, error {target:g}"
                found[key] = theirs / ours_ if ours_ and theirs else None
    return found


def draw(curves, path):
    """Pin-force error against time, a panel for each horizon."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 5), layout="constrained")
    panels = figure.subplots(1, len(HORIZONS), sharey=True)
    for panel, horizon in zip(panels, HORIZONS, strict=True):
        for curve in curves:
            error, seconds = curve.front(horizon)
            panel.loglog(seconds, error, marker=".", label=curve.name)
        panel.set_title(f"{horizon:g} revolution")
        panel.set_xlabel("processor time per simulated second [s/s]")
        panel.grid(visible=True, which="both", alpha=0.3)
    panels[0].set_ylabel("pin force, relative rms error [-]")
    panels[0].legend(fontsize=8)
    figure.savefig(path, dpi=120)


def measure(python, repeats):
    """All curves, and how far the two references are apart."""
    references = {release: reference_ours(release) for release in RELEASES}
    apart = {r: errors(reference_events(r), references[r]) for r in RELEASES}
    for release, found in apart.items():
        print(f"references apart, {release}: {found}", file=sys.stderr)
    curves = [ours(release, references, repeats) for release in RELEASES]
    curves += [ours("zero force", references, repeats, many=True)]
    curves += [
        scipy_solver(name, "zero force", references, repeats)
        for name in ("odeint", "LSODA", "DOP853")
    ]
    curves += [
        scipy_at_once(name, "zero force", references, repeats)
        for name in ("odeint", "LSODA", "DOP853")
    ]
    return curves + exudyn_curves(python, references, repeats), apart


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--exudyn", default=sys.executable, help="interpreter that has Exudyn")
    parser.add_argument("--plot", help="where to draw the curves")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    curves, apart = measure(options.exudyn, options.repeats)
    base = curves[0]
    lsoda = [c for c in curves if c.name.startswith("LSODA")]
    of_exudyn = [c for c in curves if c.name.startswith("Exudyn")]
    jointed = joined("Exudyn, bodies and joints", [c for c in of_exudyn if "joints" in c.name])
    exudyn = joined("Exudyn, tuned", [c for c in of_exudyn if "joints" not in c.name])
    dop = joined(
        "DOP853", [c for c in curves if c.name.startswith("DOP853") and MANY not in c.name]
    )
    alone = [*(c for c in lsoda if MANY not in c.name), dop, exudyn, jointed]
    [lanes] = [c for c in curves if c.name.startswith("wearstate") and MANY in c.name]
    many = [c for c in curves if MANY in c.name and c is not lanes]
    found = ratios(base, alone)
    found |= {f"{LANES} records at once: {k}": r for k, r in ratios(lanes, alone + many).items()}
    for key, ratio in found.items():
        print(f"{key}: {'not reached' if ratio is None else f'{ratio:.0f} x'}", file=sys.stderr)
    if options.plot:
        draw([base, lanes, *alone], options.plot)
    curves = [{"name": curve.name, "points": curve.points} for curve in curves]
    json.dump({"references_apart": apart, "ratios": found, "curves": curves}, sys.stdout)


if __name__ == "__main__":
    main()
