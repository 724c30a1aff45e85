"""Recording of a propulsion shaft.

The equilibrium is that of beam and oil films solved together; the sensors measure the linear
response about it, in steady running. For the axes see
:mod:`wearstate.sim.shaft_films.on_oil_films`.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ..excitation.forces import Push, read_cell
from ..output.recording import Recorder, Recording
from ..output.sensor import digitise, floor_of
from ..output.status import SimulationError, Status
from ..output.track import track_under
from ..scene.exciters import pushing_faults
from ..scene.recorded import duration_faults, failed, memory_faults, recorded, tacho_faults
from ..scene.scene import Scene, SceneError
from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import ShaftAccelerometer, ShaftProbe
from ..shaft_films.status import ShaftFilmStatus
from ..shaft_response.places import Place
from ..shaft_response.reduced import ReducedRotor
from ..shaft_response.time_response import harmonic_response, time_response
from .at_rest import ShaftState, reduced_rotor, shaft_state
from .elements import element_faults
from .forces import harmonic_forces, order_forces, random_forces
from .hull import engine_rate_faults, hull_orders
from .line_alignment import alignment_line
from .local_modes import local_acceleration
from .push import lead_samples, peak_push, pushed_motion, pushes

Float = NDArray[np.float64]

Numerics = dict[str, float | int | str]

_FEWEST_PER_TURN = 8
"""Samples per revolution: three orders below half the sample rate, and a margin."""

_BYTES_PER_SAMPLE = 200 * 8  # spectra of forces, states of a block, responses, channels

_MOVED_WARNING = 0.3
"""Peak motion over the least film at which the films' stiffness has changed by about its own size,
``(1 + 0.3)^3`` to one, and the linear response is no longer a fair estimate."""
_RESONANT = 0.1
"""Damping ratio below which a mode counts as a resonance: amplified at least five times."""

_PEAK = 4.0  # of the rms of a Gaussian motion: exceeded once in 16,000 independent values
_LIFTED = 0.05  # of the mean reaction: a warning is given for a bearing that carries less
_THIN_EDGE = 0.2  # least film over that without tilt: below it the journal runs on its edge

_STATUS = {
    ShaftFilmStatus.OK: Status.OK,
    ShaftFilmStatus.OVERLOAD: Status.LINE_OVERLOAD,
    ShaftFilmStatus.EDGE_CONTACT: Status.LINE_EDGE,
    ShaftFilmStatus.NO_ROOM: Status.LINE_EDGE,
    ShaftFilmStatus.NO_CONVERGENCE: Status.LINE_BALANCE,
    ShaftFilmStatus.COARSE: Status.LINE_COARSE,
}
"""Status of a scene's run by that of its equilibrium."""


def check_shaft(scene: Scene) -> None:
    """Check sampling, size and the beam's mesh, which need the physics.

    Raises
    ------
    SceneError
        All faults together.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> check_shaft(load_scene("propulsion-shaft"))
    """
    shaft = cast(ShaftScene, scene)
    faults = [*_sampling_faults(shaft), *pushing_faults(shaft, shaft.exciters)]
    try:
        alignment_line(shaft)
        faults += element_faults(shaft)
    except ValueError as error:
        faults += str(error).splitlines()
    if faults:
        raise SceneError(shaft.name, faults)


def _sampling_faults(scene: ShaftScene) -> list[str]:
    revolution = 1 / scene.drive.speed
    faults = duration_faults(scene, revolution)
    orders = [*(force.order for force in order_forces(scene)), *hull_orders(scene)]
    fewest = max([_FEWEST_PER_TURN, *(2 * order + 1 for order in orders)])
    if scene.sample_rate * revolution < fewest:
        faults.append(
            f"sample_rate = {scene.sample_rate:g} Hz must be >= {fewest / revolution:g} Hz, "
            f"{fewest} samples a revolution for the highest order of its forces; raise it"
        )
    faults += engine_rate_faults(scene)
    faults += tacho_faults(scene, revolution)
    needed = scene.duration * scene.sample_rate * _BYTES_PER_SAMPLE
    return faults + memory_faults(scene, needed)


class _Rest(NamedTuple):
    """Equilibrium of a line with its status, for recordings of any seed and start angle."""

    state: ShaftState
    reduced: ReducedRotor | None
    status: Status
    culprit: str
    numerics: Numerics


def simulate_shaft(scene: Scene, seed: int, truth: bool, raise_on_failure: bool) -> Recording:
    """Simulate one recording; see :func:`wearstate.sim.machine.simulate.simulate`."""
    return shaft_recorder(scene)(scene, seed, truth, raise_on_failure)


def shaft_recorder(scene: Scene) -> Recorder:
    """Simulator for one line; see :func:`wearstate.sim.machine.simulate.recorder`."""
    return partial(_record, _rest(cast(ShaftScene, scene)))


def _rest(scene: ShaftScene) -> _Rest:
    check_shaft(scene)
    state = shaft_state(scene, raise_on_failure=False)
    numerics = _numerics(scene, state)
    status, culprit = _STATUS[state.film.status], state.film.culprit
    reduced = None
    if status.ok:
        reduced = reduced_rotor(scene, state)
        numerics |= _guards(scene, reduced)
        status, culprit = _motion_status(scene, state, reduced, numerics)
    return _Rest(state, reduced, status, culprit, numerics)


def _record(rest: _Rest, scene: Scene, seed: int, truth: bool, raise_on_failure: bool) -> Recording:
    shaft, state, numerics = cast(ShaftScene, scene), rest.state, dict(rest.numerics)
    if rest.reduced is None or not rest.status.ok:
        if raise_on_failure:
            raise SimulationError(rest.status, f"{shaft.name}, bearing '{rest.culprit}'")
        return failed(shaft, rest.status, numerics)
    motion = _Motion(shaft, state, rest.reduced, seed, truth)
    signal, clipped = _measured(shaft, state, motion, seed)
    numerics["clipped_samples"] = clipped
    return recorded(
        shaft,
        signal,
        truth=motion.truth() if truth else {},
        status=rest.status,
        numerics=numerics,
        warnings=_warnings(shaft, state, numerics),
    )


def _guards(scene: ShaftScene, reduced: ReducedRotor) -> Numerics:
    """Least damping, which is the stability margin; first resonance; error of the basis."""
    swinging = reduced.poles[np.abs(reduced.poles.imag) > 0]
    ratios = -swinging.real / np.abs(swinging)
    least = int(np.argmin(ratios))
    resonant = np.abs(swinging[ratios < _RESONANT].imag)
    guards: Numerics = {
        "least_damping_ratio": float(ratios[least]),
        "least_damped_hz": float(abs(swinging[least].imag)) / math.tau,
        "stability_margin": float(ratios[least]),
    }
    if resonant.size:
        guards["first_resonance_hz"] = float(resonant.min()) / math.tau
    harmonics = harmonic_forces(scene)
    if harmonics:
        places: list[Place] = [(b.name, axis) for b in scene.bearings for axis in "yz"]
        forces = list(dict.fromkeys(place for each in harmonics for place in each.forces))
        lines = [each.frequency for each in harmonics]
        guards["estimated_error"] = reduced.measured_error(lines, places, forces)
    return guards


def _motion_status(
    scene: ShaftScene, state: ShaftState, reduced: ReducedRotor, numerics: Numerics
) -> tuple[Status, str]:
    """Status of the linear response, and the bearing that limits it."""
    if not reduced.stable:
        worst = int(np.argmin(state.film.reactions[:, 1] ** 2 + state.film.reactions[:, 0] ** 2))
        return Status.LINE_UNSTABLE, scene.bearings[worst].name
    share = peak_motion(scene, reduced) / state.film.least_film
    worst = int(np.argmax(share))
    numerics["motion_share"] = float(share[worst])
    status = Status.LINE_MOTION if share[worst] >= 1 else Status.OK
    return status, scene.bearings[worst].name


def peak_motion(scene: ShaftScene, reduced: ReducedRotor) -> Float:
    """Peak motion of each journal in its bore, by the linear response.

    Parameters
    ----------
    scene : ShaftScene
    reduced : ReducedRotor
        Rotor of the scene's state.

    Returns
    -------
    numpy.ndarray [shape=(n,)]
        Sum of the amplitudes of all orders, and four times the rms of the random motion, each
        over both directions together, plus the exciters' part by
        :func:`~wearstate.sim.shaft.push.peak_push`: an upper bound except for rare peaks [m].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("propulsion-shaft")
    >>> motion = peak_motion(scene, reduced_rotor(scene, shaft_state(scene)))
    >>> bool((motion > 0).all() and motion.argmax() == 0)  # nearest to the propeller
    True
    """
    places = _bore_places(scene)
    phasors = _relative(harmonic_response(reduced, harmonic_forces(scene), places), axis=1)
    square = np.zeros(phasors.shape[1:])
    for force in random_forces(scene):
        hertz, density = np.asarray(force.frequencies), np.asarray(force.density)
        # without the mean, which excludes the rigid motion at rest like the response does
        gain = reduced.receptance(hertz[1:], places, list(force.forces))[..., 0]
        square += np.trapezoid(
            np.abs(_relative(gain, axis=1)) ** 2 * density[1:, None, None], hertz[1:], axis=0
        )
    steady = np.linalg.norm(np.abs(phasors), axis=-1).sum(axis=0)
    pushed = peak_push(scene, reduced, _paired(places)).reshape(-1, 2)
    return np.asarray(
        steady + _PEAK * np.sqrt(square.sum(axis=-1)) + np.linalg.norm(pushed, axis=-1)
    )


def _bore_places(scene: ShaftScene) -> list[Place]:
    """Journal and housing of every bearing, up and to the side."""
    return [
        (bearing.name, axis, part)
        for bearing in scene.bearings
        for part in ("shaft", "housing")
        for axis in "yz"
    ]


def _paired(places: Sequence[Place]) -> list[Place]:
    """Journal and housing of one direction in pairs."""
    return [
        places[4 * i + j + 2 * k] for i in range(len(places) // 4) for j in (0, 1) for k in (0, 1)
    ]


def _relative(values: NDArray[np.inexact], axis: int) -> NDArray[np.inexact]:
    """Journal minus housing; the axis of the places becomes two, bearing and direction."""
    shape = values.shape
    split = values.reshape(*shape[:axis], shape[axis] // 4, 2, 2, *shape[axis + 1 :])
    journal, housing = np.moveaxis(split, axis + 1, 0)
    return np.asarray(journal - housing)


class _Motion:
    """Time histories of the housings and journals that sensors measure, or of all."""

    def __init__(
        self, scene: ShaftScene, state: ShaftState, reduced: ReducedRotor, seed: int, truth: bool
    ) -> None:
        self.scene, self.state = scene, state
        wanted = _wanted(scene, truth)
        found = time_response(
            reduced,
            [place for place, _ in wanted],
            n_samples=round(scene.duration * scene.sample_rate),
            sample_rate=scene.sample_rate,
            quantity=[quantity for _, quantity in wanted],
            harmonics=harmonic_forces(scene),
            broadband=random_forces(scene),
            seed=seed,
        )
        self.forces: tuple[Push, ...] = ()
        if scene.mounted_exciters:
            lead = lead_samples(scene, reduced)
            led = pushes(scene, seed, lead)
            found = found + pushed_motion(scene, reduced, led, wanted, lead=lead)
            inside = slice(lead, lead + found.shape[1])
            self.forces = tuple(Push(*(row[inside] for row in push)) for push in led)
        self._rows = dict(zip(wanted, found, strict=True))

    def acceleration(self, bearing: str, axis: str) -> Float:
        """Acceleration of a housing [m/s^2]."""
        return np.asarray(self._rows[(bearing, axis, "housing"), "acceleration"])

    def offset(self, bearing: str, axis: str, quantity: str = "displacement") -> Float:
        """Motion of a journal in its bore about its position at rest [m] or [m/s]."""
        journal, housing = (
            self._rows[(bearing, axis, part), quantity] for part in ("shaft", "housing")
        )
        return np.asarray(journal - housing)

    def truth(self) -> dict[str, Float]:
        """Shaft angle, journals in their bores, film forces, test forces along their direction."""
        scene, film = self.scene, self.state.film
        places, forces = [], []
        for i, bearing in enumerate(scene.bearings):
            place, rate = (
                np.stack(
                    [
                        *(self.offset(bearing.name, axis, quantity) for axis in "yz"),
                        *(
                            self._rows[(bearing.name, f"slope_{axis}", "shaft"), quantity]
                            for axis in "yz"
                        ),
                    ]
                )
                for quantity in ("displacement", "velocity")
            )
            pull = film.stiffness[i] @ place + film.damping[i] @ rate
            places.append(film.positions[i] + place[:2].T)
            forces.append(film.reactions[i] - pull[:2].T)
        return {
            "state_angle": shaft_angle(scene),
            "journal_m": np.stack(places, axis=1),
            "film_force_n": np.stack(forces, axis=1),
        } | (
            {"test_force_n": np.stack([f.along for f in self.forces], axis=1)}
            if self.forces
            else {}
        )


def _wanted(scene: ShaftScene, truth: bool) -> list[tuple[Place, str]]:
    """Places and quantities of a run: those of the sensors, with truth all others too."""
    wanted: dict[tuple[Place, str], None] = {}
    for sensor in scene.sensors:
        axis = "y" if sensor.direction == "up" else "z"
        wanted[(sensor.bearing, axis, "housing"), "acceleration"] = None
    names = [probe.bearing for probe in scene.probes]
    for name in names:
        wanted |= {((name, a, p), "displacement"): None for p in ("shaft", "housing") for a in "yz"}
    if truth:
        for bearing in scene.bearings:
            for quantity in ("displacement", "velocity"):
                for axis in "yz":
                    wanted[(bearing.name, axis, "shaft"), quantity] = None
                    wanted[(bearing.name, axis, "housing"), quantity] = None
                    wanted[(bearing.name, f"slope_{axis}", "shaft"), quantity] = None
    return list(wanted)


def shaft_angle(scene: ShaftScene) -> Float:
    """Angle of the shaft at the samples [rad].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> shaft_angle(load_scene("propulsion-shaft", {"duration": "0.2 s"})).size
    512
    """
    time = np.arange(round(scene.duration * scene.sample_rate)) / scene.sample_rate
    return np.asarray(scene.drive.start_angle + math.tau * scene.drive.speed * time)


def _measured(
    scene: ShaftScene, state: ShaftState, motion: _Motion, seed: int
) -> tuple[NDArray[np.float32], int]:
    """Signal of every channel, and the number of clipped samples."""
    # separate from the stream of the random forces, which uses the seed itself
    rng = np.random.default_rng([seed, 1])
    angle = shaft_angle(scene)
    rows, clipped = [], 0
    readings = [
        local_acceleration(
            motion.acceleration(sensor.bearing, "y" if sensor.direction == "up" else "z"),
            sensor.modes,
            scene.sample_rate,
        )
        for sensor in scene.sensors
    ]
    readings += [_reading(scene, state, motion, probe, angle) for probe in scene.probes]
    parts: list[ShaftAccelerometer | ShaftProbe] = [*scene.sensors, *scene.probes]
    for part, reading in zip(parts, readings, strict=True):
        row, lost = digitise(
            reading,
            gain=part.gain,
            noise=floor_of(part, angle.size, scene.sample_rate, rng=rng),
            full_scale=part.range,
            bits=part.bits,
            rng=rng,
        )
        rows.append(row)
        clipped += lost
    for exciter, push in zip(scene.mounted_exciters, motion.forces, strict=True):
        row, lost = read_cell(exciter, push.cell, rng)
        rows.append(row)
        clipped += lost
    if scene.tacho:
        rows.append(scene.tacho.channel(angle))
    return np.stack(rows), clipped


def _reading(
    scene: ShaftScene, state: ShaftState, motion: _Motion, probe: ShaftProbe, angle: Float
) -> Float:
    """Reading of a proximity probe: the journal from the middle of the new bore, plus run-out."""
    i = [bearing.name for bearing in scene.bearings].index(probe.bearing)
    up, side = state.film.positions[i]
    up -= state.film.bearings[i].sunk
    down = -(up + motion.offset(probe.bearing, "y"))
    port = -(side + motion.offset(probe.bearing, "z"))
    towards = down * math.cos(probe.angle) + port * math.sin(probe.angle)
    turned = angle - probe.angle
    track = track_under(scene.run_out, scene.dents, turned)
    return np.asarray(towards + track + probe.offset)


def _numerics(scene: ShaftScene, state: ShaftState) -> Numerics:
    film = state.film
    return {
        "rung_film": film.rung,
        "film_condition": scene.film.condition,
        "mean_speed_hz": scene.drive.speed,
        "steps": film.iterations,
        "residual": film.residual,
        "min_film_m": float(film.least_film.min()),
        "peak_eccentricity": float(film.eccentricity_ratios.max()),
        "least_reaction_n": float(film.reactions[:, 0].min()),
    }


def _warnings(scene: ShaftScene, state: ShaftState, numerics: Numerics) -> tuple[str, ...]:
    """Warnings about a run that did not fail."""
    film = state.film
    up = film.reactions[:, 0]
    warnings = [
        f"bearing '{bearing.name}' carries {reaction:.0f} N, less than {_LIFTED:.0%} of the mean; "
        "raise it, or see wearstate align"
        for bearing, reaction in zip(scene.bearings, up, strict=True)
        if reaction < _LIFTED * float(np.mean(np.abs(up)))
    ]
    warnings += [
        f"bearing '{bearing.name}' runs on its edge: film {1e6 * least:.0f} um there, "
        f"{1e6 * inside:.0f} um in the middle; turn its bore towards the shaft"
        for bearing, least, inside in zip(
            scene.bearings, film.least_film, film.middle_films, strict=True
        )
        if least < _THIN_EDGE * inside
    ]
    moved = float(numerics["motion_share"])
    if moved > _MOVED_WARNING:
        warnings.append(
            f"a journal moves by {moved:.0%} of its least film, but the linear response is valid "
            f"only to about {_MOVED_WARNING:.0%}; lower unbalance, blade_rate, turbulence or force "
            "of exciters"
        )
    if int(numerics["clipped_samples"]) > 0:
        warnings.append(f"{numerics['clipped_samples']} samples clipped; widen the sensor's range")
    return tuple(warnings)
