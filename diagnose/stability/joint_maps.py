"""Maps of a pump's joints: step by contact stiffness, clearance by speed.

The first compares classical steppers on the contact, as an oscillator, with the mechanism itself.
The second runs the machine, and distinguishes its chaos from errors of the step.
"""

import math
from functools import cache
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ...sim.contact.closed_forms import kelvin_voigt_restitution
from ...sim.journal.orbit_status import OrbitStatus
from ...sim.mechanism.layout import JOINT_COMPLIANT
from ...sim.output.recording import Recording
from ...sim.output.status import Status
from ...sim.pump.run_plan import steps_per_sample
from ...sim.pump.scene_run import run_scene
from ...sim.pump.validity import LARGEST_STEP_PER_CONTACT_TIME
from ...sim.pump_setup.contacts import (
    contact_rate,
    contact_table,
    joint_mobility,
    tangent_stiffness,
)
from ...sim.pump_setup.ideal_motion import joint_loads
from ...sim.pump_setup.joints import joint_parts, joint_rungs
from ...sim.scene.pump import PumpScene
from ...sim.scene.scene import Scene, SceneError
from .method_map import (
    Cell,
    Curve,
    Judge,
    MapAxis,
    MapPlan,
    Own,
    Verdict,
    coordinates,
    ratio_axis,
    within,
)
from .own_point import changed, outcome, status_words
from .steppers import STEPPERS, Stepper, bounce, decays

Array = NDArray[np.float64]

_JOINTS = ("crankpin", "wristpin", "guide")
_PHASES = np.arange(8) / 8  # of a step, at which contact may begin
_WATCHED = 600  # steps of a free oscillator
_STARTS = (0.0, 1.7, 3.3, 5.0)  # rad, start angles
_FINER = 4  # refinement factor that distinguishes the machine from its method

# --- contact oscillator of a joint


class _Contact(NamedTuple):
    """A joint as an oscillator: effective mass at the contact, stiffness, damping."""

    joint: str
    mass: float
    stiffness: float
    damping: float


def contact_oscillator(scene: PumpScene) -> _Contact | None:
    """Stiffest compliant joint of the first throw as mass, spring and dashpot.

    Parameters
    ----------
    scene : PumpScene

    Returns
    -------
    _Contact or None
        Smallest effective mass at the contact over a revolution [kg], stiffness [N/m] and damping
        [N s/m] as tangents at the largest load of the ideal joint; None if no joint is compliant.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = contact_oscillator(load_scene("bilge-pump"))
    >>> found.joint, round(found.mass, 2), found.stiffness
    ('crankpin', 1.71, 200000000.0)
    """
    found = []
    table, loads = contact_table(scene, 0), joint_loads(scene, 0)
    for number, rung in enumerate(joint_rungs(scene, 0)):
        part = joint_parts(scene, 0)[number]
        if rung != JOINT_COMPLIANT or part is None:
            continue
        record = table[number]
        loss = float(record["hysteresis"]) * loads[number] / float(record["speed_floor"])
        found.append(
            _Contact(
                joint=_JOINTS[number],
                mass=1 / joint_mobility(scene, 0, number),
                stiffness=tangent_stiffness(record, loads[number]),
                damping=max(float(record["damping"]), loss),
            )
        )
    return max(found, key=lambda each: each.stiffness / each.mass, default=None)


def contact_restitution(damping_ratio: float) -> float:
    """Restitution of a Kelvin-Voigt contact without tension, at any damping.

    Notes
    -----
    Beyond critical damping the force vanishes at ``tanh(w t) = 2 zeta w / (2 zeta^2 - 1)`` with
    ``w^2 = zeta^2 - 1``.

    Examples
    --------
    >>> [round(contact_restitution(zeta), 3) for zeta in (0.2, 0.999, 1.001, 3.0)]
    [0.572, 0.136, 0.135, 0.024]
    """
    if damping_ratio < 1:
        return kelvin_voigt_restitution(damping_ratio)
    z = max(damping_ratio, 1 + 1e-9)
    w = math.sqrt(z * z - 1)
    end = math.atanh(2 * z * w / (2 * z * z - 1))
    return math.exp(-z * end / w) * (z / w * math.sinh(end) - math.cosh(end))


def step_stiffness(scene: Scene, size: int | None = None) -> MapPlan | str:
    """Classical steppers on the joint's contact, and the mechanism itself: step by stiffness.

    Parameters
    ----------
    scene : Scene
        A pump.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    pump = cast(PumpScene, scene)
    contact = contact_oscillator(pump)
    if contact is None:
        return "no joint is compliant; set joint.crankpin.rung = 'compliant'"
    n = size or 13
    rate = math.sqrt(contact.stiffness / contact.mass)
    step = 1 / (pump.sample_rate * steps_per_sample(pump))
    guard = LARGEST_STEP_PER_CONTACT_TIME / contact_rate(pump) / step
    k = contact.stiffness
    x = ratio_axis("step", "s", 0.02 / rate, 20 / rate, n, own=step)
    y = ratio_axis("contact stiffness", "N/m", k / 100, k * 100, n, own=k)
    judges = {s.name: _stepper_judge(s, contact, x, y, scene.accuracy) for s in STEPPERS}
    curves = {s.name: _stepper_curve(s, contact, y) for s in STEPPERS}
    judges[_MECHANISM] = _mechanism_judge(pump, contact)
    curves[_MECHANISM] = [*curves["runge-kutta 4"], _guard_curve(pump, contact, y)]
    return MapPlan(
        name="step-stiffness",
        title=f"contact of the {contact.joint}, step by stiffness, damping as in the scene",
        x=x,
        y=y,
        judges=judges,
        curves=curves,
        note="growth in the closed contact; speed after an impact over that before, within "
        f"{scene.accuracy:.2g}; the mechanism: rms of the joint's force",
        own=Own(
            method=_MECHANISM,
            x=step,
            y=contact.stiffness,
            note=f"A check limits the step of a scene to {guard:.2g} times this step.",
        ),
    )


_MECHANISM = "mechanism, cut at contacts"


def _stepper_curve(stepper: Stepper, contact: _Contact, y: MapAxis) -> list[Curve]:
    points = []
    for k in np.geomspace(y.values[0] / 2, y.values[-1] * 2, 200):
        omega = math.sqrt(k / contact.mass)
        limit = stepper.limit(contact.damping / (2 * omega * contact.mass))
        if 0 < limit < math.inf:
            points.append((limit / omega, float(k)))
    if not points:
        return []
    return [Curve(name="limit in theory", x=coordinates(points, 0), y=coordinates(points, 1))]


def _guard_curve(scene: PumpScene, contact: _Contact, y: MapAxis) -> Curve:
    longest = [
        LARGEST_STEP_PER_CONTACT_TIME / contact_rate(_stiff(scene, contact, k)) for k in y.values
    ]
    return Curve(name="guard: longest allowed step", x=tuple(longest), y=y.values)


def _stiff(scene: PumpScene, contact: _Contact, stiffness: float) -> PumpScene:
    """Scene whose joint has another tangent stiffness under its largest load.

    The stiffness of Hertz's law is proportional to the power 2/3 of its constant, that of the
    conformal law nearly to its modulus.
    """
    path = f"joint.{contact.joint}"
    part = getattr(scene.joint, contact.joint)
    name, power = _STIFFENED[part.elasticity]
    value = getattr(part, name) * (stiffness / contact.stiffness) ** power
    return cast(PumpScene, changed(scene, {f"{path}.{name}": value}))


_STIFFENED = {
    "linear": ("stiffness", 1.0),
    "hertz": ("hertz_stiffness", 1.5),
    "conformal": ("effective_modulus", 1.0),
}


def _stepper_judge(
    stepper: Stepper, contact: _Contact, x: MapAxis, y: MapAxis, accuracy: float
) -> Judge:
    """Judge of a stepper; the whole plane is computed at once on first use."""

    @cache
    def plane() -> dict[tuple[float, float], Cell]:
        step, stiffness = (a.ravel() for a in np.meshgrid(x.values, y.values))
        omega = np.sqrt(stiffness / contact.mass)
        zeta = contact.damping / (2 * contact.mass * omega)
        stable = decays(stepper, step, omega, zeta, _WATCHED)
        per_mass = contact.damping / contact.mass
        back = bounce(stepper, step, omega[None] ** 2, per_mass, _PHASES[:, None])
        exact = np.array([contact_restitution(float(ratio)) for ratio in zeta])
        off = np.abs(back - exact).max(axis=0)
        return {
            (float(h), float(k)): _stepper_cell(bool(fine), float(error), accuracy)
            for h, k, fine, error in zip(step, stiffness, stable, off, strict=True)
        }

    return lambda h, k: plane()[h, k]


def _stepper_cell(stable: bool, off: float, accuracy: float) -> Cell:
    if not stable:
        return Verdict.UNSTABLE, "grows"
    if math.isnan(off):
        return Verdict.NOT_CONVERGED, "no next point"
    verdict = Verdict.ACCURATE if off <= accuracy else Verdict.INACCURATE
    return verdict, f"restitution off by {off:.3g}"


def _mechanism_judge(scene: PumpScene, contact: _Contact) -> Judge:
    """Judge of the mechanism without guard, against a quarter of the longest allowed step."""

    @cache
    def reference(stiffness: float) -> Array:
        stiff = _stiff(scene, contact, stiffness)
        longest = LARGEST_STEP_PER_CONTACT_TIME / contact_rate(stiff)
        return _joint_rms(stiff, contact.joint, longest / _FINER)

    def judge(step: float, stiffness: float) -> Cell:
        right = reference(stiffness)
        if not np.all(np.isfinite(right)):
            return Verdict.FAILS, "no finer step runs either"
        found = _joint_rms(_stiff(scene, contact, stiffness), contact.joint, step)
        if not np.all(found < _BOUNDLESS * right.max()):  # also where it is not finite
            return Verdict.UNSTABLE, "force grows without bound"
        off, mean = abs(found.mean() / right.mean() - 1), right.mean()
        # impacts are chaotic: the scatter between starts is no error
        scatter = 3 * math.hypot(found.std(ddof=1), right.std(ddof=1)) / math.sqrt(len(_STARTS))
        return within(off, max(scene.accuracy, scatter / mean), "rms force")

    return judge


_BOUNDLESS = 4.0  # times the largest rms of a good run


def _joint_rms(scene: PumpScene, joint: str, step: float) -> Array:
    """Rms force of a joint over the second revolution, for each start [N]; NaN if a run fails."""
    columns = {"crankpin": ("pin_x", "pin_y"), "wristpin": ("wrist_x", "wrist_y")}.get(
        joint, ("guide_y",)
    )
    turn = max(8, round(1 / scene.drive.speed / step))
    found = []
    for start in _STARTS:
        with np.errstate(all="ignore"):  # what is unstable overflows: that is the answer
            run = run_scene(scene, step=step, n_steps=2 * turn, start_angle=start)
            square = sum(run.force(name)[turn:] ** 2 for name in columns)
        found.append(math.sqrt(np.mean(square)) if run.status.ok else math.nan)
    return np.array(found)


# --- pump: clearance by speed


def clearance_speed(scene: Scene, size: int | None = None) -> MapPlan | str:
    """The machine itself: loss of contact, chaos and statuses over speed and crank-pin clearance.

    Parameters
    ----------
    scene : Scene
        A pump.
    size : int, optional
        Cells along either axis.

    Returns
    -------
    Plan or str
        Or why there is none.
    """
    pump = cast(PumpScene, scene)
    if pump.joint.crankpin.rung != "compliant":
        return "the crank pin is not compliant; set joint.crankpin.rung = 'compliant'"
    n, speed, gap = size or 9, pump.drive.speed, pump.joint.crankpin.clearance_diametral
    if gap == 0:
        return "the crank pin has no clearance; set joint.crankpin.diametral_clearance"
    method = f"step of the scene, and a {_FINER}th"
    return MapPlan(
        name="clearance-speed",
        title="crank-pin clearance by speed, the scene otherwise as written",
        x=ratio_axis("speed", "Hz", speed / 4, 4 * speed, n, own=speed),
        y=ratio_axis("diametral clearance", "m", gap / 30, gap * 10, n, own=gap),
        judges={method: lambda x, y: _pump_cell(pump, x, y)},
        note=f"status and contact, repeated at a {_FINER}th of the step; chaos: increasing the "
        "clearance by 1e-9 separates the orbits by a thousandth of it",
        own=Own(method=method, x=speed, y=gap),
    )


def _pump_at(scene: PumpScene, speed: float, clearance: float) -> PumpScene:
    pin = {"diametral_clearance": clearance, "radial_clearance": None}
    values = {f"joint.crankpin.{name}": value for name, value in pin.items()}
    values |= {"drive.speed": speed, "duration": 2 / speed, "settling_revolutions": 1}
    return cast(PumpScene, changed(scene, values))


def _pump_cell(scene: PumpScene, speed: float, clearance: float) -> Cell:
    pump = _pump_at(scene, speed, clearance)
    try:
        first = outcome(pump)
    except SceneError as error:
        return Verdict.REFUSED, error.faults[0]
    if not first.numerics:  # refused before the run
        return Verdict.REFUSED, status_words(first.status)
    finer = changed(pump, {"numerics.step": float(first.numerics["step_s"]) / _FINER})
    again = outcome(finer)
    if not first.status.ok:
        return _failed_cell(first.status, again.status)
    if not again.status.ok:
        return Verdict.INACCURATE, f"a finer step ends with {again.status.name.lower()}"
    if _is_chaotic(pump, first, clearance) and _is_chaotic(finer, again, clearance):
        return Verdict.CHAOTIC, f"in flight for {_flight(first, clearance):.1%} of the time"
    lost = _flight(first, clearance)
    if lost > 0 and _flight(again, clearance) > 0:
        return Verdict.LOST, f"in flight for {lost:.1%} of the time"
    return within(abs(_pin_rms(first) / _pin_rms(again) - 1), scene.accuracy, "rms force")


def _failed_cell(status: Status | OrbitStatus, finer: Status | OrbitStatus) -> Cell:
    """Verdict on a failed run; a failure that a finer run shows too has a physical cause."""
    return (Verdict.UNSTABLE if finer.ok else Verdict.FAILS), status_words(status)


def _is_chaotic(scene: PumpScene, run: Recording, clearance: float) -> bool:
    """Whether an immeasurably small change of the clearance makes the orbits diverge."""
    near = outcome(changed(scene, {"joint.crankpin.diametral_clearance": clearance * (1 + 1e-9)}))
    if not near.status.ok:
        return True
    distance = np.abs(near.truth["pin_offset_m"] - run.truth["pin_offset_m"]).max()
    return bool(distance > 1e-3 * clearance / 2)


def _flight(run: Recording, clearance: float) -> float:
    """Share of the samples at which the pin does not touch its eye."""
    return float(np.mean(np.hypot(*run.truth["pin_offset_m"].T) < clearance / 2))


def _pin_rms(run: Recording) -> float:
    return float(np.sqrt(np.mean(run.truth["pin_force_n"] ** 2)))
