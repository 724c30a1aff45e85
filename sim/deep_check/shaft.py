"""Deep check of a propulsion shaft: its figures compared with usual values."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..alignment.alignment import LineState, check, reactions
from ..alignment.seats import AlignmentError
from ..beam.modes import modes, natural_frequencies
from ..beam.rotor import Rotor, Support
from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import ShaftBearing
from ..shaft.at_rest import ShaftState, shaft_state
from ..shaft.elements import element_lengths, half_wave
from ..shaft.line_alignment import alignment_conditions, alignment_line
from ..shaft.line_beam import shaft_beam
from .rows import OIL_DENSITY, RECORDING, Quantity, ShortRun, taylor_share, trial

_TURNS = 4.0  # of the trial: the response is steady from its first sample
_SECONDS = 4.0  # tabulated time of the trial
_RESONANT = 0.1  # damping ratio below which a mode counts as a resonance
_RESONANCES = 10  # lowest resonances checked against the blade rate


@dataclass(frozen=True, kw_only=True)
class ShaftFacts:
    """A shaft line, its equilibrium, its alignment, and a short run of it.

    Attributes
    ----------
    scene : ShaftScene
    trial : Trial
    state : ShaftState
        On its films, in the running condition; its status shows if there is no equilibrium.
    modes : sequence of float
        Natural frequencies of the shaft on its seats, rising [Hz].
    aligned : LineState or None
        On elastic seats, running; None if the loads tip the shaft off them.
    """

    scene: ShaftScene
    trial: ShortRun
    state: ShaftState
    modes: Sequence[float]
    aligned: LineState | None


def shaft_facts(scene: ShaftScene) -> ShaftFacts:
    """Find the equilibrium of a line on films and on seats, and record some revolutions."""
    try:
        aligned = reactions(alignment_line(scene), alignment_conditions(scene)["running"])
    except AlignmentError:
        aligned = None
    return ShaftFacts(
        scene=scene,
        trial=trial(scene, turns=_TURNS, seconds=_SECONDS, truth=False),
        state=shaft_state(scene, raise_on_failure=False),
        modes=seated_modes(scene).tolist(),
        aligned=aligned,
    )


def _each(
    measure: Callable[[ShaftScene, ShaftBearing], float],
) -> Callable[[Any], dict[str, float]]:
    """One value for every bearing, from the scene alone."""
    return lambda facts: {b.name: measure(facts.scene, b) for b in facts.scene.bearings}


def _balanced(
    measure: Callable[[ShaftFacts], NDArray[np.float64]],
) -> Callable[[Any], dict[str, float]]:
    """One value for every bearing, from the state on its films; none without an equilibrium."""

    def values(facts: ShaftFacts) -> dict[str, float]:
        if not facts.state.film.status.ok:
            return {}
        names = [bearing.name for bearing in facts.scene.bearings]
        return dict(zip(names, np.asarray(measure(facts), dtype=float).tolist(), strict=True))

    return values


def _numeric(name: str, scale: float = 1.0) -> Callable[[Any], dict[str, float]]:
    """A numeric result of the trial run."""

    def value(facts: ShaftFacts) -> dict[str, float]:
        numerics = facts.trial.solution.numerics
        return {"": scale * float(numerics[name])} if name in numerics else {}

    return value


def _gap(bearing: ShaftBearing) -> float:
    """Radial clearance of the circle in which the journal lies, in its present state [m]."""
    if bearing.wear_down > 0 and bearing.worn_shape == "arc":
        return bearing.arc_clearance * bearing.diametral_clearance / 2
    return (bearing.diametral_clearance + bearing.wear_down) / 2


# --- bearings


def _surface(scene: ShaftScene, bearing: ShaftBearing) -> float:
    return math.pi * bearing.diameter * scene.drive.speed


def _taylor(scene: ShaftScene, bearing: ShaftBearing) -> float:
    return taylor_share(
        _surface(scene, bearing),
        bearing.diameter / 2,
        _gap(bearing),
        scene.oil.dynamic_viscosity,
        scene.oil.density or OIL_DENSITY,
    )


def _areas(facts: ShaftFacts) -> NDArray[np.float64]:
    return np.array([b.length * b.diameter for b in facts.scene.bearings])


def _loads(facts: ShaftFacts) -> NDArray[np.float64]:
    return np.asarray(np.hypot(*facts.state.film.reactions.T))


def _sommerfeld(facts: ShaftFacts) -> NDArray[np.float64]:
    """``S = eta N L D / W (R / C)^2``."""
    scene = facts.scene
    slimness = np.array([b.diameter / 2 / _gap(b) for b in scene.bearings])
    shear = scene.oil.dynamic_viscosity * scene.drive.speed * _areas(facts)
    return np.asarray(shear / np.maximum(_loads(facts), 1e-9) * slimness**2)


def _load_share(facts: ShaftFacts) -> NDArray[np.float64]:
    up = facts.state.film.reactions[:, 0]
    return np.asarray(up / np.mean(np.abs(up)))


def _edge(facts: ShaftFacts) -> NDArray[np.float64]:
    """Least film over that in the middle: 1 without tilt."""
    film = facts.state.film
    return np.asarray(film.least_film / film.middle_films)


def _seat_deflection(facts: ShaftFacts) -> NDArray[np.float64]:
    stiffness = np.array([b.housing.stiffness_up for b in facts.scene.bearings])
    return np.asarray(1e6 * np.abs(facts.state.film.reactions[:, 0]) / stiffness)


def _off_limits(facts: ShaftFacts) -> dict[str, float]:
    """Violation of limits in the running condition, over the limit [%]."""
    if facts.aligned is None:
        return {}
    return {
        f"{each.bearing}, {each.quantity}": 100 * each.shortfall / abs(bound)
        for each in check(facts.aligned)
        if (bound := each.least if each.value < each.least else each.most)
    }


# --- shaft


def _sag(facts: ShaftFacts) -> dict[str, float]:
    """Sag of each span below the line through its bearings, over its length."""
    if facts.aligned is None:
        return {}
    bearings, line = facts.scene.bearings, facts.aligned
    stations, heights = line.line.beam.stations, line.deflections
    found = {}
    for aft, forward in itertools.pairwise(bearings):
        inside = (stations >= aft.station) & (stations <= forward.station)
        x, y = stations[inside], heights[inside]
        chord = np.interp(x, x[[0, -1]], y[[0, -1]])
        length = forward.station - aft.station
        found[f"{aft.name} to {forward.name}"] = 1e3 * float(np.abs(y - chord).max()) / length
    return found


def _span(facts: ShaftFacts) -> dict[str, float]:
    slimmest = max(section.outer_diameter for section in facts.scene.sections)
    pairs = zip(facts.scene.bearings[:-1], facts.scene.bearings[1:], strict=True)
    return {f"{a.name} to {b.name}": (b.station - a.station) / slimmest for a, b in pairs}


def seated_modes(scene: ShaftScene) -> NDArray[np.float64]:
    """Natural frequencies of the shaft at rest on its housings' stiffness.

    Films are neglected: they are stiffer than most housings, and the slow motions that they add at
    half the speed are no modes of the shaft.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    numpy.ndarray [shape=(6,)]
        Rising, both directions [Hz].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> bool(seated_modes(load_scene("shaft-rig"))[0] > 30)
    True
    """
    seats = tuple(
        Support(
            name=bearing.name,
            station=bearing.station,
            stiffness=np.diag([bearing.housing.stiffness_up, bearing.housing.stiffness_side]),
        )
        for bearing in scene.bearings
    )
    return natural_frequencies(Rotor(beam=shaft_beam(scene), supports=seats), count=6)


def _critical(facts: ShaftFacts) -> dict[str, float]:
    return {"": facts.modes[0] / facts.scene.drive.speed}


def _blades(facts: ShaftFacts) -> dict[str, float]:
    """Distance of the nearest resonance of the running line from the blade rate [%]."""
    scene, part = facts.scene, facts.scene.propeller
    if part is None or not part.blade_rate or not facts.state.film.status.ok:
        return {}
    blade_rate = part.blades * scene.drive.speed
    turn = math.tau * scene.drive.speed
    found = modes(facts.state.rotor, turn, _RESONANCES, most_damping=_RESONANT).frequency_hz
    nearest = float(found[np.argmin(np.abs(found - blade_rate))])
    return {f"at {nearest:.3g} Hz": 100 * abs(nearest / blade_rate - 1)}


def _in_band(facts: ShaftFacts) -> dict[str, float]:
    return {"": facts.modes[0] / (facts.scene.sample_rate / 2)}


def _housing_hertz(_scene: ShaftScene, bearing: ShaftBearing) -> float:
    return math.sqrt(bearing.housing.stiffness_up / bearing.housing.mass) / math.tau


def _housing_band(scene: ShaftScene, bearing: ShaftBearing) -> float:
    return _housing_hertz(scene, bearing) / (scene.sample_rate / 2)


def _balance(facts: ShaftFacts) -> dict[str, float]:
    turn = math.tau * facts.scene.drive.speed
    discs = facts.scene.discs
    return {d.name: 1e3 * d.unbalance / d.mass * turn for d in discs if d.unbalance and d.mass}


def _tip(facts: ShaftFacts) -> dict[str, float]:
    part = facts.scene.propeller
    return {"": math.pi * part.diameter * facts.scene.drive.speed} if part else {}


# --- numerics


def _elements(facts: ShaftFacts) -> dict[str, float]:
    return {"": half_wave(facts.scene) / max(element_lengths(facts.scene))}


def _wave(facts: ShaftFacts) -> dict[str, float]:
    """Shortest wave recorded over the diameter, for a beam without shear."""
    if facts.scene.shaft.theory != "euler-bernoulli":
        return {}
    thickest = max(section.outer_diameter for section in facts.scene.sections)
    return {"": 2 * half_wave(facts.scene) / thickest}


SHAFT_ROWS = (
    Quantity(
        name="surface speed",
        unit="m/s",
        measure=_each(_surface),
        least=0.2,
        most=40.0,
        reason="2 to 10 in ships' lines",
        low="check drive.speed (rpm or rev/s) and the bearing's diameter",
        high="lower drive.speed (rpm or rev/s?), or check the bearing's diameter",
    ),
    Quantity(
        name="propeller tip speed",
        unit="m/s",
        measure=_tip,
        least=2.0,
        most=50.0,
        reason="20 to 40 against cavitation",
        low="check propeller.diameter and drive.speed",
        high="lower drive.speed, or check propeller.diameter",
    ),
    Quantity(
        name="span over shaft diameter",
        unit="",
        measure=_span,
        least=2.0,
        most=30.0,
        reason="8 to 22; sqrt(d) rules give 450 sqrt(d/mm) mm and less",
        low="move the bearings apart, or leave one out: the line is too stiff to align",
        high="add a bearing, or check the stations",
    ),
    Quantity(
        name="length over diameter",
        unit="",
        measure=_each(lambda _, b: b.length / b.diameter),
        least=0.3,
        most=4.0,
        reason="0.5 to 1.5 inside, stern 2 in oil, 4 in water",
        low="raise the bearing's length, or check its unit",
        high="lower the bearing's length, or check its unit",
    ),
    Quantity(
        name="clearance over bore, diametral",
        unit="per mille",
        measure=_each(lambda _, b: 2e3 * _gap(b) / b.diameter),
        least=0.5,
        most=5.0,
        reason="1 to 2.5 new, with wear-down to 5",
        low="raise diametral_clearance, or check its unit",
        high="lower diametral_clearance or wear_down, or check their unit",
    ),
    Quantity(
        name="bearing reaction over mean",
        unit="",
        measure=_balanced(_load_share),
        least=0.1,
        reason="no bearing below a fifth of its share; 0 is unloaded",
        low="raise that bearing's offset or lower its neighbours': wearstate align says how far",
        doubt="less than 5% of the mean",
    ),
    Quantity(
        name="projected pressure",
        unit="MPa",
        measure=_balanced(lambda facts: 1e-6 * _loads(facts) / _areas(facts)),
        least=0.01,
        most=1.2,
        reason="0.1 to 0.8 for white metal in ships' lines",
        low="raise that bearing's offset, or shorten it",
        high="lower that bearing's offset, or lengthen it",
    ),
    Quantity(
        name="beyond alignment limits",
        unit="%",
        measure=_off_limits,
        most=0.0,
        reason="[bearings.limits], in the running condition",
        high="move that bearing or its neighbours: wearstate align says how far",
    ),
    Quantity(
        name="shaft sag over span",
        unit="mm/m",
        measure=_sag,
        most=0.6,
        reason="0.02 to 0.3 between the bearings; slopes in bores stay below 0.3",
        high="move the bearings closer together, or raise the shaft's diameter",
    ),
    Quantity(
        name="housing deflection, static",
        unit="um",
        measure=_balanced(_seat_deflection),
        most=200.0,
        reason="reaction over stiffness; 1 to 50",
        high="raise housing.stiffness_up: 50 to 5000 MN/m is usual",
    ),
    Quantity(
        name="Sommerfeld number",
        unit="",
        measure=_balanced(_sommerfeld),
        least=0.02,
        most=20.0,
        reason="eta N L D / W (R / C)^2; lines are lightly loaded",
        low="raise oil viscosity or drive.speed, or lower that bearing's load or clearance",
        high="raise that bearing's offset: it is almost unloaded; or lower oil viscosity",
    ),
    Quantity(
        name="eccentricity at rest",
        unit="",
        measure=_balanced(lambda facts: facts.state.film.eccentricity_ratios),
        least=0.02,
        most=0.9,
        reason="0.1 to 0.8",
        low="raise that bearing's offset: it is almost unloaded; or lower oil viscosity",
        high="raise oil viscosity or the bearing's length, or lower its offset",
    ),
    Quantity(
        name="least film",
        unit="um",
        measure=_balanced(lambda facts: 1e6 * facts.state.film.least_film),
        least=8.0,
        reason="30 to 200; 8 bridges roughness and bending of the shell",
        low="raise oil viscosity or the bearing's length, or turn its bore (slope) to the shaft",
    ),
    Quantity(
        name="film at the edge over middle",
        unit="",
        measure=_balanced(_edge),
        least=0.2,
        reason="below a fifth the journal runs on its edge",
        low="turn the bore towards the shaft (slope), or shorten the bearing",
        doubt="runs on its edge",
    ),
    Quantity(
        name="Reynolds over critical number",
        unit="",
        measure=_each(_taylor),
        most=1.0,
        reason="all rungs are laminar: below 41.2 sqrt(R / C) (Taylor)",
        high="raise oil viscosity, or lower the clearance: no rung models turbulence",
    ),
    Quantity(
        name="first critical over speed",
        unit="",
        measure=_critical,
        least=1.15,
        reason="lines run below it by a sixth or more; modes on the housings, without films",
        low="shorten the longest span, stiffen the shaft or the housings, or lower drive.speed",
    ),
    Quantity(
        name="resonance from blade rate",
        unit="%",
        measure=_blades,
        least=10.0,
        reason="a margin of 20 is good practice; damping below 10 %, on films",
        low="choose other propeller.blades or drive.speed, or change the aftmost span",
    ),
    Quantity(
        name="first bending mode over half rate",
        unit="",
        measure=_in_band,
        most=0.5,
        reason="a recording should include the first modes of its shaft",
        high="raise sample_rate, or check the lengths of the sections",
    ),
    Quantity(
        name="housing frequency",
        unit="Hz",
        measure=_each(_housing_hertz),
        least=20.0,
        most=1500.0,
        reason="sqrt(k / m) / 2 pi; 100 to 500 for pedestals and stern tubes",
        low="raise housing.stiffness_up, or lower housing.mass",
        high="lower housing.stiffness_up, or raise housing.mass",
    ),
    Quantity(
        name="housing frequency over half rate",
        unit="",
        measure=_each(_housing_band),
        most=1.0,
        reason="a mode above is not recorded",
        high="raise sample_rate, or lower housing.stiffness_up",
    ),
    Quantity(
        name="least damping",
        unit="% of critical",
        measure=_numeric("least_damping_ratio", 100.0),
        least=0.1,
        reason="0.5 to 5 with films; at 0 the line whirls",
        low="load the bearings more evenly, give shaft.damping_ratio, or lower the speed",
    ),
    Quantity(
        name="journal motion over least film",
        unit="",
        measure=_numeric("motion_share"),
        least=1e-4,
        most=0.3,
        reason="the response is linear about the equilibrium, valid to 0.3",
        low="give discs their unbalance (kg m), or the propeller its blade_rate",
        high="lower unbalance, blade_rate or turbulence",
        doubt="of its least film",
    ),
    Quantity(
        name="balance grade",
        unit="mm/s",
        measure=_balance,
        least=0.1,
        most=16.0,
        reason="G 1 to G 16 (ISO 21940-11), propellers to 6.3",
        low="raise the disc's unbalance, or check its unit (kg m)",
        high="lower the disc's unbalance, or check its unit (kg m)",
    ),
    Quantity(
        name="elements per half-wave",
        unit="",
        measure=_elements,
        least=1.2,
        reason="shortest bending wave recorded; at 1 its frequency is 11 % high",
        low="lower shaft.longest_element",
    ),
    Quantity(
        name="shortest wave over diameter",
        unit="",
        measure=_wave,
        least=10.0,
        reason="the beam without shear is valid above ten diameters",
        low="set shaft.theory = 'timoshenko'",
    ),
    *RECORDING,
)
"""All figures of a shaft line. A new one is one function and one row."""
