"""Wear speed of a joint of a scene, and its distribution: sliding work from forces and motion.

A pump's joint is run for some revolutions, and its contact force times its sliding speed is summed.
A journal bearing runs on its film without contact: it wears on the turning gear, at
a few revolutions a minute, where steam turbines were found to have worn their shells. Below the
lift-off speed the film carries a share of the load that grows with the speed, and the
asperities carry the rest.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import brentq

from ..bearing.bearing_status import BearingError
from ..bearing.equilibrium import Equilibrium, equilibrium
from ..brief import brief
from ..film.solve import FilmGeometry
from ..journal.recording import film_geometry
from ..mechanism.crank_run import CrankRun
from ..output.status import SimulationError
from ..parts.wording import nearest
from ..pump.run_plan import steps_per_sample
from ..pump.scene_run import pin_offsets, run_scene
from ..scene.journal import JournalScene
from ..scene.pump import PumpScene
from ..scene.scene import SceneError
from .archard import Float, scar_shape, sliding_work

_SETTLING = 3  # revolutions; contact is independent of its start within one
_REVOLUTIONS = 10

# --- joints of a pump


@dataclass(frozen=True, kw_only=True, eq=False)
class JointWear:
    """Sliding in a joint, and its distribution.

    Attributes
    ----------
    power : float
        Mean of contact force times sliding speed [W]; times the specific wear rate [m^2/N] it is
        the wear by volume [m^3/s].
    per_revolution : numpy.ndarray [shape=(revolutions,)]
        Sliding work of each revolution [N m].
    eye : numpy.ndarray [shape=(360,)]
        Share of the wear per radian of the eye, see :func:`.wear.archard.scar_shape`. Angles are
        positive from the stroke's axis to the one across it, and start at the rod's axis where it
        leaves the rod: thrust acts at half a turn. For a guide: shares of upper and lower face
        [shape=(2,)].
    pin : numpy.ndarray [shape=(360,)]
        The same for the pin: for a crank pin from the direction of the crank, for a wrist pin from
        that of the stroke. For a guide the shares again.
    """

    power: float
    per_revolution: Float
    eye: Float
    pin: Float

    __repr__ = brief()


def joint_wear(
    scene: PumpScene, joint: str, *, throw: int = 0, revolutions: int = _REVOLUTIONS
) -> JointWear:
    """Sliding work of one joint at its clearance, from a run of the mechanism.

    Parameters
    ----------
    scene : PumpScene
        Its duration and settling are ignored.
    joint : {"crankpin", "wristpin", "guide"}
        An ideal joint has the forces of its constraint.
    throw : int
        Throw, counted from 0.
    revolutions : int
        Number of revolutions summed, >= 1, after three to settle.

    Returns
    -------
    JointWear
        Power, and its distribution.

    Raises
    ------
    SceneError
        There is no such joint, or the mechanism refuses the scene.
    SimulationError
        The run failed.

    Notes
    -----
    Forces are means over each step, and the motion is the difference of the states at its ends,
    so that no work is lost by sampling; only in a step with a force reversal
    the smaller part is lost. For a guide with corners in contact on both faces,
    the difference counts.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = joint_wear(load_scene("bilge-pump"), "crankpin", revolutions=2)
    >>> round(found.power, -1), int(found.eye.argmax()) in range(170, 190)
    (1290.0, True)
    """
    if joint not in _JOINTS:
        fault = f"joint = '{joint}' is no joint of a pump{nearest(joint, _JOINTS)}"
        raise SceneError(scene.name, [fault])
    run, per_turn = _run(scene, revolutions)
    force, speed, eye_angle, pin_angle = _JOINTS[joint](scene, run, throw)
    force, speed, eye_angle, pin_angle = (
        values[-per_turn * revolutions :] for values in (force, speed, eye_angle, pin_angle)
    )
    turns = zip(np.split(force, revolutions), np.split(speed, revolutions), strict=True)
    work = np.array([sliding_work(f, v, run.step) for f, v in turns])
    weight = np.abs(force * speed)
    eye, pin = _shapes(joint, force, weight, eye_angle, pin_angle)
    return JointWear(
        power=float(work.sum()) / (per_turn * revolutions * run.step),
        per_revolution=work,
        eye=eye,
        pin=pin,
    )


def _run(scene: PumpScene, revolutions: int) -> tuple[CrankRun, int]:
    """Run whole revolutions at constant speed; also return the steps per revolution."""
    longest = 1 / (scene.sample_rate * steps_per_sample(scene))
    per_turn = math.ceil(1 / (scene.drive.speed * longest))
    run = run_scene(
        scene,
        step=1 / (scene.drive.speed * per_turn),
        n_steps=(_SETTLING + revolutions) * per_turn,
        start_angle=0.0,
        keep_states=True,
    )
    if not run.status.ok:
        raise SimulationError(run.status, scene.name)
    return run, per_turn


_Sliding = tuple[Float, Float, Float, Float]  # force [N], speed [m/s], angle on eye and pin [rad]


def _crankpin(scene: PumpScene, run: CrankRun, throw: int) -> _Sliding:
    part = scene.joints(throw).crankpin
    alpha = run.turns[:, 0] + scene.throws[throw].phase
    bodies = _bodies(run, throw)
    turning = part.pin_diameter / 2 * np.diff(alpha) / run.step
    turning += (part.pin_diameter / 2 + part.clearance_radial) * np.diff(bodies[:, 2]) / run.step
    force, slip, angle = _pressed(scene, run, throw, slice(0, 2), ("pin_x", "pin_y"))
    beta = _middle(bodies[:, 2])
    return force, slip + turning, angle + beta - math.pi, angle - _middle(alpha)


def _wristpin(scene: PumpScene, run: CrankRun, throw: int) -> _Sliding:
    part = scene.joints(throw).wristpin
    if part is None:
        raise SceneError(scene.name, ["joint.wristpin is missing; give its pin_diameter"])
    bodies = _bodies(run, throw)
    beta, tilt = bodies[:, 2], bodies[:, 5]
    turning = part.pin_diameter / 2 * np.diff(tilt) / run.step
    turning += (part.pin_diameter / 2 + part.clearance_radial) * np.diff(beta) / run.step
    force, slip, angle = _pressed(scene, run, throw, slice(2, 4), ("wrist_x", "wrist_y"))
    return force, slip + turning, angle + _middle(beta), angle - _middle(tilt)


def _guide(scene: PumpScene, run: CrankRun, throw: int) -> _Sliding:  # noqa: ARG001 - as the pins
    push = run.force("guide_y", throw)
    speed = np.diff(_bodies(run, throw)[:, 3]) / run.step
    return push, speed, np.zeros_like(push), np.zeros_like(push)


_JOINTS = {"crankpin": _crankpin, "wristpin": _wristpin, "guide": _guide}
"""Sliding of every joint. A new joint is one row."""


def _bodies(run: CrankRun, throw: int) -> Float:
    assert run.bodies is not None  # they were kept
    return run.bodies[:, throw]


def _middle(ends: Float) -> Float:
    return np.asarray(0.5 * (ends[1:] + ends[:-1]))


def _pressed(
    scene: PumpScene, run: CrankRun, throw: int, columns: slice, names: tuple[str, str]
) -> tuple[Float, Float, Float]:
    """Normal force of a pin [N], its speed along the eye [m/s], and its direction [rad]."""
    offset = pin_offsets(scene, run.turns[:, 0], _bodies(run, throw), throw)[:, columns]
    on_rod = np.column_stack([run.force(name, throw) for name in names])
    place = 0.5 * (offset[1:] + offset[:-1])
    if _is_ideal(offset):  # a constraint has no contact point; use the direction of its force
        place = on_rod
    length = np.hypot(place[:, 0], place[:, 1])
    normal = place / np.where(length > 0, length, 1.0)[:, None]
    rate = np.diff(offset, axis=0) / run.step
    slip = rate[:, 1] * normal[:, 0] - rate[:, 0] * normal[:, 1]
    force = np.einsum("ij,ij->i", on_rod, normal)
    return force, slip, np.arctan2(normal[:, 1], normal[:, 0])


_CENTRED = 1e-9  # m: Baumgarte's terms keep an ideal joint closer


def _is_ideal(offset: Float) -> bool:
    return bool(np.abs(offset).max() < _CENTRED)


def _shapes(joint: str, force: Float, weight: Float, eye: Float, pin: Float) -> tuple[Float, Float]:
    if joint != "guide":
        return scar_shape(eye, weight), scar_shape(pin, weight)
    shares = np.array([weight[force < 0].sum(), weight[force > 0].sum()]) / weight.sum()
    return shares, shares


# --- a journal bearing on the turning gear


@dataclass(frozen=True, kw_only=True)
class TurningWear:
    """Sliding in a journal bearing that turns slowly.

    Attributes
    ----------
    power : float
        Load on the asperities times sliding speed [W].
    lift_off_hz : float
        Speed above which the film alone carries the load [rev/s].
    boundary_share : float
        Share of the load on the asperities.
    """

    power: float
    lift_off_hz: float
    boundary_share: float


def turning_wear(scene: JournalScene, *, speed: float, least_film: float) -> TurningWear:
    """Sliding work of a journal bearing on its turning gear.

    Parameters
    ----------
    scene : JournalScene
        With its present scar; its own speed is ignored.
    speed : float
        Speed of the turning gear [rev/s], > 0.
    least_film : float
        Film at which asperities begin to touch [m], > 0 and below the radial clearance: three
        times the combined rms roughness of both surfaces.

    Returns
    -------
    TurningWear

    Raises
    ------
    SceneError
        Speed or film is out of range; all faults together.
    BearingError
        No equilibrium was found in the search.

    Notes
    -----
    At the gap where asperities begin to touch, the pressure of an isoviscous film is proportional
    to the speed. With the gap held by the asperities, whose force hardly moves the journal, the
    film carries the share ``n / n_lift`` of the load and they carry the rest, ``1 - n / n_lift``:
    the load sharing of Johnson, Greenwood and Poon. A full film causes no wear; heat and grit are
    not modelled, nor are the few turns of each start and stop.

    References
    ----------
    Johnson, Greenwood, Poon (1972), "A simple theory of asperity contact in elastohydrodynamic
    lubrication", Wear 19, 91-108, doi:10.1016/0043-1648(72)90445-0.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = turning_wear(load_scene("journal-bearing"), speed=0.05, least_film=2e-6)
    >>> round(found.lift_off_hz, 2), round(found.boundary_share, 2)
    (0.35, 0.86)
    """
    gap = scene.bearing.clearance_radial
    faults = []
    if not speed > 0:
        faults.append(f"speed = {speed:g} rev/s must be > 0; give that of the turning gear")
    if not 0 < least_film < gap:
        faults.append(
            f"least_film = {least_film:g} m must be > 0 and < the radial clearance = {gap:g} m; "
            "three times the roughness of both surfaces is usual"
        )
    if faults:
        raise SceneError(scene.name, faults)
    lift_off = _lift_off(scene, least_film)
    share = max(0.0, 1 - speed / lift_off)
    sliding = math.pi * scene.bearing.diameter * speed
    load = math.hypot(*_load(scene))
    return TurningWear(power=share * load * sliding, lift_off_hz=lift_off, boundary_share=share)


def _load(scene: JournalScene) -> tuple[float, float]:
    return scene.rotor.mass * scene.gravity + scene.load.static, scene.load.static_across


def _lift_off(scene: JournalScene, least_film: float) -> float:
    """Speed at which the equilibrium has the given least film [rev/s]."""
    gap, load = scene.bearing.clearance_radial, np.array(_load(scene))
    radius, length = scene.bearing.diameter / 2, scene.bearing.length
    unit = scene.oil.dynamic_viscosity * math.tau * radius**3 * length / gap**2  # at 1 rev/s
    for n_theta in _MESHES:
        rest = partial(_resting, _meshed(scene, n_theta), load / unit)
        try:
            speed = _speed_of(rest, least_film / gap)
        except ValueError:
            raise SceneError(scene.name, [_no_lift_off(least_film)]) from None
        found = rest(speed)
        if found.status.ok:
            return speed
    raise BearingError(found.status, f"lift-off at {speed:g} rev/s")


_LIFT_OFF = (1e-3, 1e2)  # rev/s: range of lift-off speeds
_LOG_SPEED = 1e-5  # tolerance of the logarithm of the speed
_MESHES = (360, 720, 1440)  # nodes round the circle; the first suffices for a hundredth of the gap


def _speed_of(rest: Callable[[float], Equilibrium], least: float) -> float:
    """Speed for a least film over C, from the logarithms, which are nearly proportional."""

    def excess(log_speed: float) -> float:
        return math.log(rest(math.exp(log_speed)).film.min_thickness / least)

    low, high = (math.log(end) for end in _LIFT_OFF)
    return math.exp(brentq(excess, low, high, xtol=_LOG_SPEED))


def _no_lift_off(least_film: float) -> str:
    low, high = _LIFT_OFF
    return (
        f"least_film = {least_film:g} m must be the film of a speed between {low:g} and {high:g} "
        "rev/s; give the roughness of run-in surfaces, and check the viscosity"
    )


def _meshed(scene: JournalScene, n_theta: int) -> FilmGeometry:
    part = scene.film
    finer = part.model_copy(update={"rung": "direct", "n_theta": max(n_theta, part.n_theta)})
    return film_geometry(scene.model_copy(update={"film": finer}))


def _resting(geometry: FilmGeometry, load: Float, speed: float) -> Equilibrium:
    return equilibrium(geometry, load / speed, raise_on_failure=False)
