"""Deep check of a journal bearing: its figures compared with usual values."""

import math
from dataclasses import dataclass

import numpy as np

from ..bearing.bearing_status import BearingError
from ..bearing.coefficients import coefficients, flow, friction
from ..bearing.equilibrium import Equilibrium, equilibrium
from ..bearing.whirl import stability
from ..film.solve import LEAST_CELLS
from ..journal.recording import film_geometry, journal_scale
from ..scene.journal import JournalScene
from .rows import OIL_DENSITY, RECORDING, Quantity, ShortRun, taylor_share, trial

_SECONDS = 3.0  # tabulated time of the trial; a map's run costs a hundredth of it
_HEAT = 1.7e6  # J/(m^3 K), mineral oil


@dataclass(frozen=True, kw_only=True)
class JournalFacts:
    """A journal bearing, its equilibrium, and a run of it.

    Attributes
    ----------
    scene : JournalScene
    trial : Trial
    rest : Equilibrium or None
        Under weight and static load; None without load, or if no film can carry it.
    """

    scene: JournalScene
    trial: ShortRun
    rest: Equilibrium | None


def steady_load(scene: JournalScene) -> tuple[float, float]:
    """Weight and static load on a journal, along X and Y [N].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> round(steady_load(load_scene("journal-bearing"))[0])
    5981
    """
    return scene.rotor.mass * scene.gravity + scene.load.static, scene.load.static_across


def journal_facts(scene: JournalScene) -> JournalFacts:
    """Run a journal bearing while that is cheap, and find its equilibrium at its steady load."""
    whole = scene.duration * scene.drive.speed
    return JournalFacts(
        scene=scene, trial=trial(scene, turns=whole, seconds=_SECONDS), rest=_rest(scene)
    )


def _rest(scene: JournalScene) -> Equilibrium | None:
    scale = journal_scale(scene)
    load = np.array(steady_load(scene)) / (scale.alpha * scale.force)
    if not np.hypot(*load) > 0:
        return None
    try:
        found = equilibrium(film_geometry(scene), load, raise_on_failure=False)
    except (BearingError, ValueError):
        return None
    return found if found.status.ok else None


def _radial(scene: JournalScene) -> float:
    return scene.bearing.clearance_radial


# --- load capacity


def _surface(facts: JournalFacts) -> dict[str, float]:
    return {"": math.pi * facts.scene.bearing.diameter * facts.scene.drive.speed}


def _slenderness(facts: JournalFacts) -> dict[str, float]:
    return {"": facts.scene.bearing.length / facts.scene.bearing.diameter}


def _relative_clearance(facts: JournalFacts) -> dict[str, float]:
    part = facts.scene.bearing
    return {"": 1e3 * part.clearance_diametral / part.diameter}


def _worn(facts: JournalFacts) -> dict[str, float]:
    scene, found = facts.scene, {}
    if scene.wear is not None:
        found["clearance"] = scene.bearing.clearance_diametral / scene.wear.condemning
    if scene.wear_scar is not None and scene.bearing.scar_depth > 0:
        found["scar"] = scene.bearing.scar_depth / scene.wear_scar.condemning
    return found


def _pressure(facts: JournalFacts) -> dict[str, float]:
    part = facts.scene.bearing
    load = math.hypot(*steady_load(facts.scene))
    return {"": 1e-6 * load / (part.length * part.diameter)} if load else {}


def _sommerfeld(facts: JournalFacts) -> dict[str, float]:
    """``S = eta N L D / W (R / C)^2``."""
    scene, part = facts.scene, facts.scene.bearing
    load = math.hypot(*steady_load(scene))
    if not load:
        return {}
    shear = scene.oil.dynamic_viscosity * scene.drive.speed * part.length * part.diameter
    return {"": shear / load * (part.diameter / 2 / _radial(scene)) ** 2}


def _eccentricity(facts: JournalFacts) -> dict[str, float]:
    return {} if facts.rest is None else {"": facts.rest.eccentricity_ratio}


def _least_film(facts: JournalFacts) -> dict[str, float]:
    found = facts.trial.solution.numerics.get("min_film_m")
    return {} if found is None else {"": 1e6 * float(found)}


def _film_share(facts: JournalFacts) -> dict[str, float]:
    radial = 1e6 * _radial(facts.scene)
    return {place: film / radial for place, film in _least_film(facts).items()}


def _peak_pressure(facts: JournalFacts) -> dict[str, float]:
    found = facts.trial.solution.truth.get("peak_pressure_pa")
    return {} if found is None else {"": 1e-6 * float(found.max())}


# --- assumptions of the film


def _taylor(facts: JournalFacts) -> dict[str, float]:
    scene = facts.scene
    return {
        "": taylor_share(
            _surface(facts)[""],
            scene.bearing.diameter / 2,
            _radial(scene),
            scene.oil.dynamic_viscosity,
            scene.oil.density or OIL_DENSITY,
        )
    }


def _warming(facts: JournalFacts) -> dict[str, float]:
    """Temperature rise if all friction heats the oil leaving at both ends [K]."""
    if facts.rest is None:
        return {}
    scene, scale = facts.scene, journal_scale(facts.scene)
    radius, gap = scene.bearing.diameter / 2, _radial(scene)
    power = friction(facts.rest) * scale.alpha * scale.force * gap * scale.speed
    side = flow(facts.rest).side * radius * gap * scene.drive.speed * scene.bearing.length
    return {"": power / (_HEAT * side)} if side > 0 else {}


def _cells(facts: JournalFacts) -> dict[str, float]:
    """Nodes where the gap is below twice its least; all nodes at low eccentricity."""
    scene, numerics = facts.scene, facts.trial.solution.numerics
    peak = float(numerics.get("peak_eccentricity", math.nan))
    if scene.film.rung == "short" or not 0 < peak < 1:
        return {}
    return {"": thin_nodes(peak, scene.film.n_theta)}


def thin_nodes(eccentricity: float, n_theta: int) -> float:
    """Number of nodes where the gap is below twice its least.

    Parameters
    ----------
    eccentricity : float
        Eccentricity ratio, in (0, 1).
    n_theta : int
        Nodes round the circle.

    Returns
    -------
    float
        ``n / pi arccos((2 e - 1) / e)``; all nodes up to e = 1/3.

    Examples
    --------
    >>> round(thin_nodes(0.5, 72), 9), thin_nodes(0.2, 72)
    (36.0, 72.0)
    """
    return n_theta / math.pi * math.acos(max(-1.0, (2 * eccentricity - 1) / eccentricity))


# --- excitation


def _balance(facts: JournalFacts) -> dict[str, float]:
    rotor = facts.scene.rotor
    if not rotor.unbalance:
        return {}
    return {"": 1e3 * rotor.unbalance / rotor.mass * math.tau * facts.scene.drive.speed}


def _whirl(facts: JournalFacts) -> dict[str, float]:
    """Mass on the bearing over the mass at the whirl threshold, by Routh and Hurwitz."""
    if facts.rest is None:
        return {}
    load = float(np.hypot(*facts.rest.load))
    limit = stability(coefficients(facts.rest).per_load(load)).mass
    scale = journal_scale(facts.scene)
    newton = load * scale.alpha * scale.force
    return {"": scale.force / newton / limit}


JOURNAL_ROWS = (
    Quantity(
        name="surface speed",
        unit="m/s",
        measure=_surface,
        least=0.2,
        most=100.0,
        reason="1 m/s of slow pumps to 100 m/s of turbines",
        low="check drive.speed (rpm or rev/s) and bearing.diameter",
        high="lower drive.speed (rpm or rev/s?) or bearing.diameter",
    ),
    Quantity(
        name="length over diameter",
        unit="",
        measure=_slenderness,
        least=0.2,
        most=2.0,
        reason="0.4 to 1.2; longer ones run on their edges",
        low="raise bearing.length, or check its unit",
        high="lower bearing.length, or check its unit",
    ),
    Quantity(
        name="clearance over bore, diametral",
        unit="per mille",
        measure=_relative_clearance,
        least=0.4,
        most=4.0,
        reason="0.8 to 2 new, renewed at 2 to 4",
        low="raise the clearance (diametral, or radial?), or check its unit",
        high="lower the clearance (diametral, or radial?), or check its unit",
    ),
    Quantity(
        name="wear over renewal limit",
        unit="",
        measure=_worn,
        most=1.0,
        reason="beyond its [wear] limit a shell is renewed",
        high="lower clearance or scar_depth, or raise the limit of [wear] or [wear_scar]",
    ),
    Quantity(
        name="projected pressure",
        unit="MPa",
        measure=_pressure,
        least=0.05,
        most=7.0,
        reason="0.2 to 3 in machines, white metal bears 5 to 7",
        low="check rotor.mass and load.static: so light a bearing is close to whirling",
        high="raise bearing.length or diameter, or lower load.static",
    ),
    Quantity(
        name="Sommerfeld number",
        unit="",
        measure=_sommerfeld,
        least=0.02,
        most=5.0,
        reason="eta N L D / W (R / C)^2; Raimondi and Boyd tabulate 0.01 to 6",
        low="raise oil.viscosity or drive.speed, or lower load or clearance",
        high="lower oil.viscosity (30 mPa s is usual), or raise load or clearance",
    ),
    Quantity(
        name="eccentricity at rest",
        unit="",
        measure=_eccentricity,
        least=0.05,
        most=0.9,
        reason="0.2 to 0.8 under weight and static load",
        low="raise the load, or lower oil.viscosity",
        high="raise oil.viscosity or bearing.length, or lower load.static",
    ),
    Quantity(
        name="least film",
        unit="um",
        measure=_least_film,
        least=4.0,
        reason="4 to 10 bridge roughness and dirt",
        low="raise oil.viscosity, drive.speed or bearing.length, or lower load or unbalance",
    ),
    Quantity(
        name="least film over clearance",
        unit="",
        measure=_film_share,
        least=0.05,
        reason="0.1 to 0.8; below, roughness and bending decide",
        low="raise oil.viscosity, drive.speed or bearing.length, or lower load or unbalance",
    ),
    Quantity(
        name="peak film pressure",
        unit="MPa",
        measure=_peak_pressure,
        most=25.0,
        reason="white metal yields at 25 to 40",
        high="lower load or unbalance, or raise bearing.length",
    ),
    Quantity(
        name="Reynolds over critical number",
        unit="",
        measure=_taylor,
        most=1.0,
        reason="all rungs are laminar: below 41.2 sqrt(R / C) (Taylor)",
        high="raise oil.viscosity, or lower clearance or drive.speed: no rung models turbulence",
    ),
    Quantity(
        name="warming of the oil, at most",
        unit="K",
        measure=_warming,
        most=80.0,
        reason="all rungs are isothermal; heat to shell and shaft and feed pressure are neglected",
        high="give oil.viscosity at the film's mean temperature, or raise the clearance",
    ),
    Quantity(
        name="nodes over the thinnest film",
        unit="",
        measure=_cells,
        least=1.5 * LEAST_CELLS,
        reason="a film that spans fewer than 4 is refused",
        low="raise film.n_theta",
    ),
    Quantity(
        name="film of closed form, L/D",
        unit="",
        measure=lambda facts: _slenderness(facts) if facts.scene.film.rung == "short" else {},
        most=0.5,
        reason="the short bearing neglects flow round the circle",
        high="set film.rung = 'map'",
    ),
    Quantity(
        name="balance grade",
        unit="mm/s",
        measure=_balance,
        least=0.1,
        most=16.0,
        reason="G 0.4 to G 16 (ISO 21940-11), 2.5 and 6.3 most",
        low="raise rotor.unbalance, or check its unit (kg m)",
        high="lower rotor.unbalance, or check its unit (kg m)",
    ),
    Quantity(
        name="mass over that of whirl",
        unit="",
        measure=_whirl,
        most=0.9,
        reason="at 1 the rotor whirls at half its speed",
        high="raise load.static or lower the clearance, oil.viscosity or drive.speed: it whirls",
    ),
    *RECORDING,
)
"""All figures of a journal bearing. A new one is one function and one row."""
