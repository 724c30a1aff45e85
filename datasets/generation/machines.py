"""Quantities of interest of each machine, and further results known to its simulator.

Rungs and steps are judged by the quantities of interest, which are those that features use.
Trajectories are not compared: contact with clearance is chaotic, and two correct runs diverge point
by point. Each quantity is a value with its kind and its scale.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ...features.rotation.orbit import filtered_orbits
from ...features.rotation.order import order_amplitudes
from ...features.signal.spectrum import band_edges, band_levels, decibel
from ...sim.fidelity.runs import Quantities, Quantity
from ...sim.output.recording import Recording
from ...sim.scene.journal import JournalScene
from ...sim.scene.pump import PumpScene
from ...sim.scene.pump_hydraulics import STANDARD_ATMOSPHERE
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene

Float = NDArray[np.float64]

_BANDS = 6  # wide enough to converge within a record of twenty revolutions
_LEAST_AXIS = 0.02  # of the radial clearance: below it, the error of an orbit is absolute
_LEAST_REACTION = 0.1  # of the mean reaction of the line


def level(mean_square: float) -> Quantity:
    """A level in dB: an accuracy of 2 % is 0.17 dB."""
    return float(decibel(mean_square)), "dB", 1.0


def relative(value: float, least: float = 0.0) -> Quantity:
    """A value with a relative error; it is relative to `least` if the value is smaller."""
    return float(value), "relative", least


def absolute(value: float, scale: float) -> Quantity:
    """A value whose error is relative to a scale of the machine."""
    return float(value), "absolute", scale


class Truth(NamedTuple):
    """One result of a run."""

    value: float
    unit: str
    """SI unit; ``dB`` for levels, empty for ratios."""
    words: str
    seen: bool = False
    """Whether it is computed from sensor signals; otherwise only the simulator knows it."""


# --- any machine


def _rms(values: Float) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _mean_peak(values: Float, turns: Float) -> float:
    """Mean over whole revolutions of the largest value in each."""
    number = np.floor(turns - turns[0]).astype(int)
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    whole = np.maximum.reduceat(values, starts)[: max(1, number[-1])]
    return float(whole.mean())


def band_quantities(solution: Recording, _scene: Scene | None = None) -> dict[str, Quantity]:
    """Levels of bands of all accelerations together."""
    rows = [
        row
        for row, channel in zip(solution.signal, solution.channels, strict=True)
        if channel.quantity == "acceleration"
    ]
    if not rows:
        return {}
    fs = solution.sample_rate
    powers = 10 ** (band_levels(np.stack(rows), fs, edges_of_bands(fs)) / 10)
    return {f"band_{i + 1}": level(power) for i, power in enumerate(powers.sum(axis=0))}


def edges_of_bands(fs: float) -> Float:
    """Edges of the bands of vibration at a sample rate [Hz]."""
    return band_edges(fs, n_bands=_BANDS, low=min(50.0, fs / 20))


# --- reciprocating pump


def pump_quantities(solution: Recording, _scene: Scene) -> dict[str, Quantity]:
    """Reciprocating pump: bands of vibration, forces in pin and guide, force of the pressure.

    Parameters
    ----------
    solution : Recording
        Recording with its truth.
    _scene : Scene
        Not used.

    Returns
    -------
    dict of str to Quantity
        Band levels over all accelerometers together; for each throw the rms force in the crank pin,
        the mean over revolutions of its peak, and rms forces of guide and pressure.

    Examples
    --------
    >>> from wearstate.sim.machine.simulate import simulate
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("bilge-pump", {"duration": "0.4 s"})
    >>> found = pump_quantities(simulate(scene, seed=1, truth=True), scene)
    >>> found["pin_rms"][1], 1e3 < found["pin_rms"][0] < 2e3
    ('relative', True)
    """
    truth = solution.truth
    found = band_quantities(solution)
    turns = truth["state_alpha"] / math.tau
    for name in sorted(name for name in truth if name.startswith("pin_force_n")):
        throw = name.removeprefix("pin_force_n")
        force = np.hypot(*truth[name].T)
        found[f"pin_rms{throw}"] = relative(_rms(force))
        found[f"pin_peak{throw}"] = relative(_mean_peak(force, turns))
        found[f"guide_rms{throw}"] = relative(_rms(truth[f"guide_force_n{throw}"]))
        pressure = _rms(truth[f"piston_pressure_force_n{throw}"])
        found[f"pressure_rms{throw}"] = relative(pressure, _LEAST_AXIS * _rms(force))
    return found


def _pump_truths(solution: Recording, scene: Scene) -> Iterator[tuple[str, Truth]]:
    pump, truth, numbers = cast(PumpScene, scene), solution.truth, solution.numerics
    turns = float(numbers["steps"]) * float(numbers["step_s"]) * float(numbers["mean_speed_hz"])
    contacts = float(numbers["contact_changes"]) / 2 / turns
    yield "contacts_per_turn", Truth(contacts, "", "contacts made in a revolution, dry joints")
    for name in sorted(name for name in truth if name.startswith("wrist_force_n")):
        suffix = name.removeprefix("wrist_force_n")
        about = f", throw {suffix[1:]}" if suffix else ""
        wrist = float(np.hypot(*truth[name].T).max())
        yield f"wrist_peak{suffix}", Truth(wrist, "N", f"wrist pin force, peak{about}")
        guide = float(np.abs(truth[f"guide_force_n{suffix}"]).max())
        yield f"guide_peak{suffix}", Truth(guide, "N", f"guide force, peak{about}")
        yield from _pressures(pump, truth, suffix, about)


def _pressures(
    scene: PumpScene, truth: dict[str, Float], suffix: str, about: str
) -> Iterator[tuple[str, Truth]]:
    """Range of the gauge pressure in a cylinder, and the ratio of its absolute extremes."""
    if scene.pressure.rung == "none" or not scene.piston.diameter:
        return
    area = math.pi / 4 * scene.piston.diameter**2
    pressure = truth.get(
        f"cylinder_pressure_pa{suffix}", truth[f"piston_pressure_force_n{suffix}"] / area
    )
    low, high = float(pressure.min()), float(pressure.max())
    yield f"pressure_lowest{suffix}", Truth(low, "Pa", f"cylinder pressure, lowest, gauge{about}")
    yield f"pressure_highest{suffix}", Truth(high, "Pa", f"cylinder pressure, highest{about}")
    if low + STANDARD_ATMOSPHERE > 0:
        ratio = (high + STANDARD_ATMOSPHERE) / (low + STANDARD_ATMOSPHERE)
        yield f"pressure_ratio{suffix}", Truth(ratio, "", f"pressure ratio, absolute{about}")


# --- journal bearing


def journal_quantities(solution: Recording, scene: Scene) -> dict[str, Quantity]:
    """Journal bearing: position and size of the orbit, thinnest film, forces of the film.

    Examples
    --------
    >>> from wearstate.sim.machine.simulate import simulate
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("journal-bearing")
    >>> sorted(journal_quantities(simulate(scene, seed=1, truth=True), scene))[:3]
    ['axis_major', 'axis_minor', 'centre_x']
    """
    truth = solution.truth
    clearance = cast(JournalScene, scene).bearing.clearance_radial
    path = truth["journal_m"] @ np.array([1.0, 1.0j])
    force = np.hypot(*truth["film_force_n"].T)
    about = np.abs(path - path.mean())
    found = {
        "centre_x": absolute(path.mean().real, clearance),
        "centre_y": absolute(path.mean().imag, clearance),
        "orbit_rms": relative(_rms(about), _LEAST_AXIS * clearance),
        "orbit_largest": relative(float(about.max()), _LEAST_AXIS * clearance),
        "film_least": relative(float(truth["min_film_m"].min())),
        "force_rms": relative(_rms(force)),
        "force_peak": relative(float(force.max())),
    }
    return found | _axes(path, truth["state_angle"], _LEAST_AXIS * clearance, "")


def _axes(
    path: NDArray[np.complex128], angle: Float, least: float, suffix: str
) -> dict[str, Quantity]:
    """Semi-axes of the synchronous orbit."""
    forward, backward = (
        float(np.abs(part[0])) for part in filtered_orbits(path, angle / math.tau, [1.0])
    )
    return {
        f"axis_major{suffix}": relative(forward + backward, least),
        f"axis_minor{suffix}": absolute(abs(forward - backward), max(forward + backward, least)),
    }


def _journal_truths(solution: Recording, scene: Scene) -> Iterator[tuple[str, Truth]]:
    truth, clearance = solution.truth, cast(JournalScene, scene).bearing.clearance_radial
    place = complex(*truth["journal_m"].mean(axis=0))
    load = complex(*truth["load_n"].mean(axis=0))
    ratio = abs(place) / clearance
    yield "eccentricity", Truth(ratio, "", "eccentricity ratio of the mean position")
    if load != 0 and place != 0:
        angle = float(np.angle(place / load))
        yield "attitude_angle", Truth(angle, "rad", "attitude angle of the mean position")
    if "peak_pressure_pa" in truth:
        peak = float(truth["peak_pressure_pa"].max())
        yield "pressure_peak", Truth(peak, "Pa", "film pressure, peak")


# --- propulsion shaft


def shaft_quantities(solution: Recording, scene: Scene) -> dict[str, Quantity]:
    """Shaft line: reactions, positions and orbits of the journals, films, vibration, resonance.

    Examples
    --------
    >>> from wearstate.sim.machine.simulate import simulate
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("shaft-rig")
    >>> found = shaft_quantities(simulate(scene, seed=1, truth=True), scene)
    >>> found["reaction_aft"][0] > 0, found["band_1"][1]
    (True, 'dB')
    """
    shaft, truth = cast(ShaftScene, scene), solution.truth
    reactions = truth["film_force_n"].mean(axis=0)[:, 0]
    least = _LEAST_REACTION * float(np.abs(reactions).mean())
    found = band_quantities(solution) | {
        "film_least": relative(float(solution.numerics["min_film_m"]))
    }
    for i, bearing in enumerate(shaft.bearings):
        clearance = bearing.diametral_clearance / 2
        path = truth["journal_m"][:, i] @ np.array([1.0, 1.0j])
        found[f"reaction_{bearing.name}"] = relative(reactions[i], least)
        found[f"up_{bearing.name}"] = absolute(path.mean().real, clearance)
        found[f"side_{bearing.name}"] = absolute(path.mean().imag, clearance)
        motion = _rms(np.abs(path - path.mean()))
        found[f"orbit_{bearing.name}"] = relative(motion, 1e-2 * _LEAST_AXIS * clearance)
    return found | _resonance(solution) | _orders(solution, shaft)


def _resonance(solution: Recording) -> dict[str, Quantity]:
    """Frequency of the first resonance; damping ratio of the least damped motion.

    The frequency of that motion is not included: two motions may have similar damping, so that a
    small change of the mesh could make it jump from one to the other.
    """
    numerics: dict[str, Any] = solution.numerics
    names = {"resonance_hz": "first_resonance_hz", "least_damping": "least_damping_ratio"}
    return {own: relative(numerics[name]) for own, name in names.items() if name in numerics}


def _orders(solution: Recording, scene: ShaftScene) -> dict[str, Quantity]:
    """Accelerations at the shaft speed and the blade rate, all sensors together."""
    rows = solution.signal[: len(scene.sensors)]
    if not len(rows):
        return {}
    orders = [1, 2] if scene.propeller is None else [1, scene.propeller.blades]
    phase = solution.truth["state_angle"] / math.tau
    sizes = np.abs(order_amplitudes(rows, phase, orders)) ** 2
    return {f"order_{k}": level(float(p)) for k, p in zip(orders, sizes.sum(axis=0), strict=True)}


def _shaft_truths(solution: Recording, _scene: Scene) -> Iterator[tuple[str, Truth]]:
    total = float(solution.truth["film_force_n"].mean(axis=0)[:, 0].sum())
    yield "reaction_sum", Truth(total, "N", "sum of the vertical reactions")


# --- the table


def no_truths(_solution: Recording, _scene: Scene) -> Iterator[tuple[str, Truth]]:
    """No further results, for a machine without hidden states of interest."""
    yield from ()


@dataclass(frozen=True, kw_only=True)
class Known:
    """Results known for the runs of a machine.

    Attributes
    ----------
    quantities : callable
        Function of a recording with its truth, and the scene: quantities of interest by name.
    words : mapping of str to tuple of str
        Words and unit of each quantity, by its name without the throw or the bearing.
    truth : tuple of str or None
        Names of the truth used by the quantities, for one part if there are many; None: any.
    truths : callable
        Function of a recording with its truth, and the scene: further results by name.
    fewest_turns : int or None
        Revolutions needed for the quantities; None if a recording must be complete because its load
        or speed changes, or its orbit takes its own time.
    """

    quantities: Quantities = band_quantities
    words: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    truth: tuple[str, ...] | None = None
    truths: Callable[[Recording, Scene], Iterator[tuple[str, Truth]]] = no_truths
    fewest_turns: int | None = None


KNOWN: dict[type[Scene], Known] = {
    PumpScene: Known(
        quantities=pump_quantities,
        truth=("state_alpha", "pin_force_n", "guide_force_n", "piston_pressure_force_n"),
        words={
            "pin_rms": ("rms crank pin force", "N"),
            "pin_peak": ("mean peak of the crank pin force", "N"),
            "guide_rms": ("rms guide force", "N"),
            "pressure_rms": ("rms pressure force on the piston", "N"),
        },
        truths=_pump_truths,
        fewest_turns=4,  # orders and peaks are those of each revolution
    ),
    JournalScene: Known(
        quantities=journal_quantities,
        words={
            "centre_x": ("mean position x", "m"),
            "centre_y": ("mean position y", "m"),
            "orbit_rms": ("rms orbit radius", "m"),
            "orbit_largest": ("largest orbit radius", "m"),
            "film_least": ("minimum film thickness", "m"),
            "force_rms": ("rms film force", "N"),
            "force_peak": ("peak film force", "N"),
            "axis_major": ("major half axis of the orbit at the speed", "m"),
            "axis_minor": ("minor half axis of the orbit at the speed", "m"),
        },
        truths=_journal_truths,
    ),
    ShaftScene: Known(
        quantities=shaft_quantities,
        words={
            "film_least": ("minimum film thickness", "m"),
            "resonance_hz": ("first resonance", "Hz"),
            "least_damping": ("least damping ratio", "-"),
            "reaction": ("reaction at bearing", "N"),
            "up": ("journal height at bearing", "m"),
            "side": ("journal side position at bearing", "m"),
            "orbit": ("rms orbit radius at bearing", "m"),
        },
        truths=_shaft_truths,
    ),
}
"""Known results by type of scene; a machine without a row is judged by its vibration."""


def known_of(scene: Scene) -> Known:
    """Known results of the runs of a scene's machine.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> known_of(load_scene("shaft-rig")).words["least_damping"]
    ('least damping ratio', '-')
    """
    return KNOWN.get(type(scene), Known())
