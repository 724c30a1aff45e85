"""A second independent bilge pump: its mechanism by Exudyn; see `foreign_pump` for the first.

Needs the extra `foreign` (tried with Exudyn 1.13.6). Rod and crank are Exudyn's rigid bodies
(`exudyn_crank`), the pin is a sphere in a hollow sphere, the solver is its Runge-Kutta 4 with four
fixed steps a sample. Contact force and accelerations are Exudyn's; the forces on the casing follow
from them by Newton's law. Casing, sensors and tacho are those of `foreign_casing`, machines and
conditions are drawn by `foreign_pump`, under another seed. The crank runs at constant speed.

What differs from the library, each to be switched off by name:

pressure
    One smooth curve, p = p_s + (p_d - p_s) / 2 (1 - tanh(2 sin(a - c(a)) / sin(w / 2))), with
    c(a) = (c_f + c_r) / 2 + (c_f - c_r) / 2 cos a: the middles c_f and c_r of fall and rise lie a
    delay and half a transition angle after the dead centres; w is the mean of both transitions.
    Else: a cubic over 6 degrees from the dead centre.
contact
    Exudyn's `impactModel` 2, N = K d^1.5 (1 + q d' / d'_0) with q by the restitution (Gonthier
    et al. 2004, doi:10.1023/B:MUBO.0000029392.21648.bc; Carvalho and Martins 2019,
    doi:10.1016/j.mechmachtheory.2019.03.028), d'_0 at least 0.1 m/s; K as in `foreign_pump`.
    Else: Exudyn's linear spring and dashpot, released at zero overlap: it can pull.
friction
    Seal friction at the piston, Exudyn's regularised Stribeck function. Else: none. The pin has
    Exudyn's regularised Coulomb friction either way.
casing, noise
    See `foreign_casing`.

All is simulated.
"""

from math import pi

import numpy as np
from foreign_casing import signal
from foreign_pump import (
    AREA,
    COLUMNS,
    DAMPING,
    DURATION,
    FRICTION_SPEED,
    GRAVITY,
    HEAD,
    LENGTH,
    PIN_RADIUS,
    PISTON_MASS,
    RADIUS,
    RISE_ANGLE,
    ROD_CENTRE,
    ROD_INERTIA,
    ROD_MASS,
    SAMPLE_RATE,
    SETTLING,
    STIFFNESS,
    SUCTION,
    Conditions,
    Machine,
    conditions_draw,
    hunt_crossley,
    machine_draw,
    manifest_values,
    start_state,
)
from foreign_records import Job, Program

DIFFERENCES = ("pressure", "contact", "friction", "casing", "noise")

STEPS = 4  # per sample: 16 to the period of the contact under the hardest knocks
OTHER_MACHINES = 1_000_000  # added to the seed
LEAST_IMPACT = (
    0.1  # [m/s], a third of a knock's: at 0.02 soft touches locked the pin, then diverged
)
CRANK = {
    "crank_radius": RADIUS,
    "rod_length": LENGTH,
    "rod_mass": ROD_MASS,
    "rod_centre": ROD_CENTRE,
    "rod_inertia": ROD_INERTIA,
    "piston_mass": PISTON_MASS,
}


def cylinder_share(symbolic, angle, machine: Machine, *, smooth: bool):
    """Share of the discharge pressure at a crank angle, as an expression."""
    sine, cosine = symbolic.sin(angle), symbolic.cos(angle)
    if smooth:
        fall = machine.fall_delay + machine.fall / 2
        rise = machine.rise_delay + machine.rise / 2
        late = (fall + rise) / 2 + (fall - rise) / 2 * cosine
        sharp = 2 / np.sin((machine.fall + machine.rise) / 4)
        return 0.5 * (1.0 - symbolic.tanh(sharp * symbolic.sin(angle - late)))
    after = symbolic.asin(symbolic.abs(sine)) * (1 / RISE_ANGLE)
    u = symbolic.IfThenElse(sine * cosine > 0.0, symbolic.min(after, 1.0), symbolic.Real(1.0))
    done = u * u * (3.0 - 2.0 * u)  # of the transition after the last dead centre
    return symbolic.IfThenElse(sine > 0.0, 1.0 - done, done)


def add_pin(system, items, pin, eye, machine: Machine, run: Conditions, on: frozenset[str]) -> int:
    """The contact of pin and eye; returns the number of the object."""
    stiffness = STIFFNESS * machine.stiffness
    law = {"contactStiffness": stiffness, "contactDamping": DAMPING * machine.damping}
    if "contact" in on:
        law = {
            "contactStiffness": hunt_crossley(stiffness, machine.restitution)[0],
            "contactStiffnessExponent": 1.5,
            "impactModel": 2,
            "restitutionCoefficient": machine.restitution,
            "minimumImpactVelocity": LEAST_IMPACT,
        }
    history = system.AddNode(
        items.NodeGenericData(numberOfDataCoordinates=4, initialCoordinates=[0.0] * 4)
    )
    return system.AddObject(
        items.ObjectContactSphereSphere(
            markerNumbers=[pin, eye],
            nodeNumber=history,
            spheresRadii=[PIN_RADIUS, PIN_RADIUS + run.diametral_clearance / 2],
            isHollowSphere1=True,
            dynamicFriction=machine.friction,
            frictionProportionalZone=FRICTION_SPEED,
            **law,
        )
    )


def add_seal(system, items, along, machine: Machine) -> None:
    """Friction of the piston's seal against the ground; `along` is the piston's marker."""
    ground = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )
    system.AddObject(
        items.ObjectConnectorCoordinateSpringDamperExt(
            markerNumbers=[ground, along],
            dynamicFrictionForce=machine.seal,
            staticFrictionOffsetForce=machine.seal * (machine.static - 1),
            exponentialDecayStatic=machine.stribeck,
            frictionProportionalZone=FRICTION_SPEED,
        )
    )


def add_pressure(system, tools, along, machine, run, first, *, smooth):
    """Pressure on the piston as a compiled expression of time, which must outlive the run."""
    exudyn, items = tools.exudyn, tools.items
    omega = 2 * pi * run.speed_hz
    load = system.AddLoad(items.LoadCoordinate(markerNumber=along, load=1.0))

    # Exudyn calls by these names
    def push(mbs, t, load):
        share = cylinder_share(exudyn.symbolic, first + omega * t, machine, smooth=smooth)
        return -AREA * (SUCTION + (run.discharge - SUCTION) * share)

    compiled = tools.CreateSymbolicUserFunction(system, push, "loadUserFunction", load)
    system.SetLoadParameter(load, "loadUserFunction", compiled)
    return compiled


def simulate(
    machine: Machine,
    run: Conditions,
    on: frozenset[str],
    *,
    duration: float = DURATION,
    steps: int = STEPS,
):
    """Run one record; returns what `foreign_pump.simulate` does."""
    import exudyn_crank  # only here, as Exudyn need not be installed

    exudyn, items = exudyn_crank.exudyn, exudyn_crank.items
    exudyn.config.printToConsole = False
    rate, omega = SAMPLE_RATE * steps, 2 * pi * run.speed_hz
    settled = int(np.ceil(SETTLING / run.speed_hz * SAMPLE_RATE)) * steps
    n_steps = settled + round(duration * SAMPLE_RATE) * steps
    first = run.start_angle - omega * settled / rate
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    start = start_state(first, omega)[:6]
    _, wrist, pin, eye = exudyn_crank.add_mechanism(system, CRANK, start)
    contact = add_pin(system, items, pin, eye, machine, run, on)
    along = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=wrist, coordinate=0))
    smooth = "pressure" in on
    held = add_pressure(system, exudyn_crank, along, machine, run, first, smooth=smooth)
    system.AddLoad(items.LoadCoordinate(markerNumber=along, load=-PISTON_MASS * GRAVITY))
    weight = system.AddMarker(items.MarkerBodyMass(bodyNumber=1))  # the rod
    system.AddLoad(items.LoadMassProportional(markerNumber=weight, loadVector=[-GRAVITY, 0, 0]))
    if "friction" in on:
        add_seal(system, items, along, machine)
    sensors = [
        *node_sensors(system, exudyn, items, wrist),
        contact_sensor(system, exudyn, items, contact),
    ]
    system.Assemble()
    options = exudyn_crank.solver_options(
        {"solver": "RK44", "steps": 1, "recovery": 0}, 1.0, 1.0, record=True
    )
    options.timeIntegration.endTime = n_steps / rate
    options.timeIntegration.numberOfSteps = n_steps
    system.SolveDynamic(options, solverType=exudyn.DynamicSolverType.RK44, showHints=False)
    del held
    stored = [system.GetSensorStoredData(sensor)[:n_steps, 1:] for sensor in sensors]
    return casing_forces(*stored), first + omega * np.arange(n_steps) / rate, settled


def node_sensors(system, exudyn, items, node):
    """Sensors of a node's coordinates, velocities and accelerations."""
    kinds = ("Coordinates", "Coordinates_t", "Coordinates_tt")
    return [
        system.AddSensor(
            items.SensorNode(
                nodeNumber=node,
                storeInternal=True,
                writeToFile=False,
                outputVariableType=getattr(exudyn.OutputVariableType, kind),
            )
        )
        for kind in kinds
    ]


def contact_sensor(system, exudyn, items, contact):
    """Sensor of a contact's force, on its first marker."""
    return system.AddSensor(
        items.SensorObject(
            objectNumber=contact,
            storeInternal=True,
            writeToFile=False,
            outputVariableType=exudyn.OutputVariableType.Force,
        )
    )


def casing_forces(place, speed, acceleration, contact):
    """Forces on bearing (x, y), guide and cylinder [shape=(n, 4)] by Newton's law.

    Columns of the wrist's node are x, y and the rod's angle pi - b; `contact` is the force on the
    pin.
    """
    b, turn, spin_up = pi - place[:, 2], -speed[:, 2], -acceleration[:, 2]
    moment = ROD_MASS * ROD_CENTRE
    along = (PISTON_MASS + ROD_MASS) * (acceleration[:, 0] + GRAVITY)
    along += moment * (np.sin(b) * spin_up + np.cos(b) * turn**2)
    across = moment * (np.cos(b) * spin_up - np.sin(b) * turn**2)
    pin_x, pin_y = contact[:, 0], contact[:, 1]
    return np.column_stack([pin_x, pin_y, -pin_y - across, -pin_x - along])


def record(job: Job, *, duration: float = DURATION) -> tuple[np.ndarray, dict[str, float]]:
    """Signal and manifest values of a job; see `foreign_records`."""
    seed = job.seed + OTHER_MACHINES
    machine = machine_draw(seed, job.machine)
    run = conditions_draw(seed, job.record, healthy=job.healthy)
    for steps in (STEPS, 2 * STEPS, 4 * STEPS):
        forces, angle, settled = simulate(machine, run, job.on, duration=duration, steps=steps)
        if np.isfinite(forces).all():
            break
    heard = signal(forces, angle, settled, steps, SAMPLE_RATE, machine.seed, run.seed, job.on)
    return heard, manifest_values(run, angle[settled:], duration)


PUMP_B = Program(
    name="independent pump B",
    differences=DIFFERENCES,
    make=record,
    columns=COLUMNS,
    head=HEAD,
    n_samples=round(DURATION * SAMPLE_RATE),
)
