"""The benchmark crank in Exudyn: a job comes in on stdin, results go out on stdout, both JSON.

`opponents_crank.py` runs this file in an interpreter that has Exudyn, which need not be the one
that has wearstate: nothing but numpy and Exudyn is imported here. Tried with Exudyn 1.13.6.

The model is the fastest of those tried. The crank is a rotor so heavy that it runs at constant
speed, the rod a planar rigid body with its reference point in the wrist pin, the piston a mass
on the rod's node that is beyond moving across the stroke: three bodies, four coordinates, no
constraint. A kinematic tree gives the same motion to rounding at two to four times the time;
holding the wrist by a coordinate constraint costs time and is wrong in the explicit solvers,
which drop the constrained row after the mass matrix is inverted.
"""

import json
import math
import sys
import time
import warnings

import numpy as np

sys.exudynFast = True  # Exudyn's own switch for the build without range checks
warnings.simplefilter("ignore")  # Exudyn renames its settings from release to release
import exudyn  # noqa: E402
import exudyn.itemInterface as items  # noqa: E402, N813
from exudyn.advancedUtilities import CreateSymbolicUserFunction  # noqa: E402

HELD = 1e12
"""Inertia of the crank [kg m^2] and of the piston across the stroke [kg]: 1e4 N and 1e3 N m
for a revolution of 12 ms move them by 1e-12 m and 1e-13 rad."""

MOST_CUT = 1e-4
"""Smallest step over the full one: below it Exudyn gives up, and above it would hang in rounding
at a contact it cannot place."""

HOLLOW_SPHERE, SYMBOLIC = "hollow sphere", "symbolic force"


def add_mechanism(system, crank, start):
    """Bodies at a start state; returns node numbers of crank and rod, markers of pin and eye."""
    alpha, omega, x, u, beta, b = start
    rotor = system.AddNode(
        items.Node1D(
            referenceCoordinates=[0.0], initialCoordinates=[alpha], initialVelocities=[omega]
        )
    )
    crank_body = system.AddObject(items.ObjectRotationalMass1D(inertia=HELD, nodeNumber=rotor))
    wrist = system.AddNode(  # the rod points from the wrist to the crank, at pi less the rod angle
        items.NodeRigidBody2D(
            referenceCoordinates=[0.0, 0.0, 0.0],
            initialCoordinates=[x, 0.0, math.pi - beta],
            initialVelocities=[u, 0.0, -b],
        )
    )
    rod = system.AddObject(
        items.ObjectRigidBody2D(
            nodeNumber=wrist,
            mass=crank["rod_mass"],
            inertia=crank["rod_inertia"] + crank["rod_mass"] * crank["rod_centre"] ** 2,
            centerOfMass=[crank["rod_centre"], 0.0],
        )
    )
    piston = np.diag([crank["piston_mass"], HELD, 0.0])
    system.AddObject(items.ObjectGenericODE2(nodeNumbers=[wrist], massMatrix=piston))
    pin, eye = (
        system.AddMarker(items.MarkerBodyRigid(bodyNumber=body, localPosition=[arm, 0.0, 0.0]))
        for body, arm in ((crank_body, crank["crank_radius"]), (rod, crank["rod_length"]))
    )
    return rotor, wrist, pin, eye


def add_jointed_mechanism(system, crank, start):
    """The same as a user would build it: three bodies, revolute joints, a guided piston, a drive.

    Returns nodes of crank, rod and piston, markers of pin and eye.
    """
    alpha, omega, x, u, beta, b = start
    places = [(0.0, alpha, 0.0, omega), (x, math.pi - beta, u, -b), (x, 0.0, u, 0.0)]
    nodes = [
        system.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[0.0, 0.0, 0.0],
                initialCoordinates=[along, 0.0, angle],
                initialVelocities=[speed, 0.0, spin],
            )
        )
        for along, angle, speed, spin in places
    ]
    inertia = crank["rod_inertia"] + crank["rod_mass"] * crank["rod_centre"] ** 2
    bodies = [
        system.AddObject(
            items.ObjectRigidBody2D(
                nodeNumber=node, mass=mass, inertia=turning, centerOfMass=[centre, 0.0]
            )
        )
        for node, mass, turning, centre in (
            (nodes[0], 1.0, 1.0, 0.0),  # of a crank at constant speed these do not matter
            (nodes[1], crank["rod_mass"], inertia, crank["rod_centre"]),
            (nodes[2], crank["piston_mass"], 1.0, 0.0),
        )
    ]
    ground = system.AddObject(items.ObjectGround())
    joined = ((ground, bodies[0]), (bodies[1], bodies[2]))
    for pair in joined:
        markers = [system.AddMarker(items.MarkerBodyPosition(bodyNumber=body)) for body in pair]
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))
    fixed = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )
    guided = ((nodes[2], 1, 0.0, False), (nodes[2], 2, 0.0, False), (nodes[0], 2, omega, True))
    for node, coordinate, value, of_speed in guided:
        moving = system.AddMarker(
            items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)
        )
        system.AddObject(
            items.ObjectConnectorCoordinate(
                markerNumbers=[fixed, moving], offset=value, velocityLevel=of_speed
            )
        )
    pin, eye = (
        system.AddMarker(items.MarkerBodyRigid(bodyNumber=body, localPosition=[arm, 0.0, 0.0]))
        for body, arm in ((bodies[0], crank["crank_radius"]), (bodies[1], crank["rod_length"]))
    )
    return nodes[0], nodes[1], pin, eye


def add_hollow_sphere(system, crank, pin, eye, penetration):
    """Exudyn's own contact: linear spring and dashpot, released at zero penetration."""
    history = system.AddNode(
        items.NodeGenericData(
            numberOfDataCoordinates=4, initialCoordinates=[-penetration, 0.0, 0.0, 0.0]
        )
    )
    system.AddObject(
        items.ObjectContactSphereSphere(
            markerNumbers=[pin, eye],
            nodeNumber=history,
            spheresRadii=[crank["pin_radius"], crank["pin_radius"] + crank["clearance"]],
            isHollowSphere1=True,
            contactStiffness=crank["stiffness"],
            contactDamping=crank["damping"],
        )
    )


def add_symbolic_force(system, crank, pin, eye):
    """The same spring and dashpot, released at zero force, as an expression compiled by Exudyn."""
    symbolic = exudyn.symbolic
    spring = system.AddObject(
        items.ObjectConnectorCartesianSpringDamper(
            markerNumbers=[eye, pin],
            stiffness=[crank["stiffness"]] * 3,  # not zero, else Exudyn leaves the connector out
            damping=[crank["damping"]] * 3,
        )
    )

    # Exudyn calls by these names
    def force(mbs, t, itemNumber, displacement, velocity, stiffness, damping, offset):
        zero = symbolic.Real(0.0)
        along, across = displacement[0], displacement[1]
        distance = symbolic.sqrt(along * along + across * across)
        speed = (along * velocity[0] + across * velocity[1]) / distance
        law = crank["stiffness"] * (distance - crank["clearance"]) + crank["damping"] * speed
        touching = distance > crank["clearance"]
        push = symbolic.IfThenElse(touching, symbolic.max(law, zero), zero) / distance
        return [push * along, push * across, zero]

    compiled = CreateSymbolicUserFunction(system, force, "springForceUserFunction", spring)
    system.SetObjectParameter(spring, "springForceUserFunction", compiled)
    return compiled


def penetration(crank, start):
    """Penetration of a state [m]."""
    alpha, _, x, _, beta, _ = start
    along = crank["crank_radius"] * math.cos(alpha) + crank["rod_length"] * math.cos(beta) - x
    across = crank["crank_radius"] * math.sin(alpha) - crank["rod_length"] * math.sin(beta)
    return math.hypot(along, across) - crank["clearance"]


class Crank:
    """One assembled system, ready for one run."""

    def __init__(self, crank, start, contact, *, record, jointed=False):
        self.container = exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self.angle = 3 if jointed else 1  # column of the crank's angle after the time
        build = add_jointed_mechanism if jointed else add_mechanism
        rotor, wrist, pin, eye = build(self.system, crank, start)
        if contact == HOLLOW_SPHERE:
            add_hollow_sphere(self.system, crank, pin, eye, penetration(crank, start))
        else:  # the expression must outlive the run
            self.force = add_symbolic_force(self.system, crank, pin, eye)
        kinds = ("Coordinates", "Coordinates_t", "Coordinates_tt") if record else ()
        self.sensors = [
            [
                self.system.AddSensor(
                    items.SensorNode(
                        nodeNumber=node,
                        storeInternal=True,
                        writeToFile=False,
                        outputVariableType=getattr(exudyn.OutputVariableType, kind),
                    )
                )
                for kind in kinds
            ]
            for node in (rotor, wrist)
        ]
        self.system.Assemble()

    def solve(self, setting, horizon, revolution):
        """Integrate over `horizon` [s] and return the processor time [s]."""
        options = solver_options(setting, horizon, revolution, record=bool(self.sensors[0]))
        solver = getattr(exudyn.DynamicSolverType, setting["solver"])
        begin = time.process_time()
        self.system.SolveDynamic(options, solverType=solver, showHints=False)
        return time.process_time() - begin

    def history(self):
        """Times, positions, velocities and accelerations at every step [shape=(n, 3) each]."""
        columns = []
        for kind in range(3):
            rotor, wrist = (
                self.system.GetSensorStoredData(sensors[kind]) for sensors in self.sensors
            )
            # back from the direction of the rod to the rod angle
            turned = (math.pi if kind == 0 else 0.0) - wrist[:, 3]
            columns.append(np.column_stack([rotor[:, self.angle], wrist[:, 1], turned]))
        return rotor[:, 0], *columns


def solver_options(setting, horizon, revolution, *, record):
    """Exudyn's settings for a fixed step, or for a tolerance."""
    options = exudyn.SimulationSettings()
    stepper = options.timeIntegration
    stepper.endTime = horizon
    stepper.minimumStepSize = MOST_CUT * revolution / setting["steps"]
    stepper.verboseMode = 0
    stepper.numberOfSteps = max(1, round(setting["steps"] * horizon / revolution))
    if "tolerance" in setting:
        stepper.automaticStepSize = True
        stepper.relativeTolerance = setting["tolerance"]
        stepper.absoluteTolerance = setting["tolerance"] * setting["scale"]
    else:
        stepper.automaticStepSize = False
        stepper.adaptiveStep = setting["recovery"] > 0
    stepper.discontinuous.useRecommendedStepSize = setting["recovery"] > 0
    stepper.adaptiveStepRecoverySteps = setting["recovery"]
    if setting["solver"] == "GeneralizedAlpha":
        stepper.generalizedAlpha.spectralRadius = setting.get("spectral_radius", 0.9)
    # without recording nobody needs the acceleration at the end, one evaluation a step
    stepper.explicit.computeEndOfStepAccelerations = record or setting["solver"] == "VelocityVerlet"
    options.solution.file.write = False
    options.solution.sensors.active = record
    options.solution.sensors.writePeriod = 0.0 if record else horizon
    return options


def hermite(at, times, values, rates):
    """Cubic through values and rates of the neighbours [shape=(len(at), n_columns)]."""
    left = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    h = (times[left + 1] - times[left])[:, None]
    s = (at[:, None] - times[left][:, None]) / h
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * values[left] + s * h * rates[left]) + s * s * (
        (1.0 + 2.0 * r) * values[left + 1] - r * h * rates[left + 1]
    )


def sampled_states(crank, start, setting, at, revolution):
    """States at the times `at` [shape=(len(at), 6)], or None where Exudyn gives up."""
    run = Crank(crank, start, setting["contact"], record=True, jointed=setting["jointed"])
    try:
        run.solve(setting, at[-1], revolution)
    except exudyn.SolverError as error:
        print(f"  {setting}: {str(error)[:80]}", file=sys.stderr)
        return None
    times, positions, velocities, accelerations = run.history()
    keep = np.concatenate([np.diff(times) > 0.0, [True]])  # a repeated step is written twice
    times, positions, velocities, accelerations = (
        part[keep] for part in (times, positions, velocities, accelerations)
    )
    q = hermite(at, times, positions, velocities)
    v = hermite(at, times, velocities, accelerations)
    return np.column_stack([q, v])[:, [0, 3, 1, 4, 2, 5]]


def seconds_per_second(crank, start, setting, revolution, job):
    """Median processor time per simulated second, the empty run taken off."""
    horizon = job["timing_revolutions"] * revolution
    times = []
    for _ in range(job["repeats"]):
        long, short = (
            Crank(crank, start, setting["contact"], record=False, jointed=setting["jointed"])
            for _ in range(2)
        )
        setup = short.solve(setting, 1e-3 * revolution, revolution)
        times.append((long.solve(setting, horizon, revolution) - setup) / horizon)
    return float(np.median(times))


def main():
    """Answer one job."""
    exudyn.config.printToConsole = False
    job = json.load(sys.stdin)
    crank, starts, revolution = job["crank"], job["starts"], job["revolution"]
    at = np.asarray(job["times"])
    answer = []
    for setting in job["settings"]:
        states = [sampled_states(crank, start, setting, at, revolution) for start in starts]
        if any(part is None for part in states):
            continue
        seconds = None
        if job["repeats"]:
            try:
                seconds = seconds_per_second(crank, starts[0], setting, revolution, job)
            except exudyn.SolverError:
                continue
        print(f"  {setting}: {seconds or 0.0:.3g} s/s", file=sys.stderr)
        answer.append({**setting, "seconds": seconds, "states": [part.tolist() for part in states]})
    json.dump({"version": exudyn.__version__, "runs": answer}, sys.stdout)


if __name__ == "__main__":
    main()
