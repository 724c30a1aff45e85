"""Estimate of a recording from its film equilibrium, and whether the trained model agrees.

The equilibrium needs no training but the machine's nameplate and the conditions of the day.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from ...sim.scene.journal import JournalScene, ProximityProbe
from ...sim.scene.shaft import ShaftScene
from ..film_clearance.clearance import (
    SCARS,
    FilmEstimate,
    JournalRun,
    PossibleFilm,
    film_clearance,
)
from ..film_clearance.wear_down import SinkingRun, film_wear_down, possible_bores, sinking_places
from ..healthy_reference.healthy import Baseline
from ..healthy_reference.probe_means import ProbeMeans, probe_means
from ..nameplate.nameplate import Nameplate, known_conditions
from ..wear_model.verdict import Estimate
from .second_estimate import length_words, with_second

if TYPE_CHECKING:
    from ...sim.bearing.rest_curve import RestCurve

Float = NDArray[np.float64]

_TURN = 2 * np.pi


def film_estimate(
    recording: Recording,
    severity: str,
    plate: Nameplate | None,
    baseline: Baseline | None = None,
) -> FilmEstimate | None:
    """Severity of a machine from the position of its shaft.

    Parameters
    ----------
    recording : Recording
    severity : str
        Column of the requested wear.
    plate : Nameplate or None
        Known machine data and operating conditions.
    baseline : Baseline, optional
        Healthy recordings of the same machine; they determine the offsets of the probes.

    Returns
    -------
    FilmEstimate or None
        None if no such estimate exists for this wear or machine.
    """
    kind = _NUMBER.sub("_{}_m", severity)
    if plate is None:
        possible = any(kind == each for each, _ in _METHODS) and probe_means(recording).names
        return FilmEstimate(reason=_UNKNOWN) if possible else None
    method = _METHODS.get((kind, plate.scene.machine))
    if method is None:
        return None
    healthy = () if baseline is None else baseline.positions
    return method(probe_means(recording), plate, healthy, severity)


def _journal(
    means: ProbeMeans, plate: Nameplate, healthy: Sequence[ProbeMeans], severity: str
) -> FilmEstimate:
    scene = cast(JournalScene, plate.scene)
    reason = journal_fault(scene, means)
    if reason:
        return FilmEstimate(reason=reason)
    usable = [each for each in healthy if not journal_fault(scene, each)]
    wear = scene.wear
    built = scene.bearing.clearance_diametral
    as_new = (wear.as_new, wear.grade_edges[0]) if wear else (built / _BUILT, built * _BUILT)
    given, others = _possible_films(scene)
    return film_clearance(
        _run(means, plate, severity),
        given,
        [_probe(scene.sensors, name).angle for name in means.names],
        as_new,
        others=others,
        healthy=[_run(each, plate, severity, healthy=True) for each in usable],
        doubts=plate.doubts,
    )


def _possible_films(scene: JournalScene) -> tuple["RestCurve", list[PossibleFilm]]:
    """Film of the scene, and the films it may be instead.

    These are the other solution of Reynolds' equation, for the whole life of the machine, and a
    scar that came with the wear.
    """
    from ...sim.bearing.rest_curve import rest_curve
    from ...sim.journal.recording import (
        film_geometry,  # compiled code: takes a second, needed only here
    )

    geometry = film_geometry(scene)
    finite, short = (rest_curve(geometry, rung) for rung in ("direct", "short"))
    given, other = (short, finite) if scene.film.rung == "short" else (finite, short)
    scars = [rest_curve(geometry, scar=depth, turned=turned) for depth, turned in SCARS]
    share = _OTHER_FILM / len(scars)
    return given, [
        PossibleFilm(likely=_OTHER_FILM, now=other, new=other),
        *(
            PossibleFilm(likely=share, now=scar, new=finite, scar=depth)
            for scar, (depth, _) in zip(scars, SCARS, strict=True)
        ),
    ]


_OTHER_FILM = 0.5  # prior weight relative to the given film: of the other one, of all scars
_BUILT = 1.3  # makers' tolerance of a clearance, if no limits define as new


def _shaft(
    means: ProbeMeans, plate: Nameplate, healthy: Sequence[ProbeMeans], severity: str
) -> FilmEstimate:
    """Wear-down of the bearing that the severity names, counted from 1."""
    scene = cast(ShaftScene, plate.scene)
    number = int(severity.removesuffix("_m").rpartition("_")[2]) - 1
    limits = scene.wear_down
    if limits is None or number >= len(scene.bearings):
        return FilmEstimate(reason="the nameplate has no such bearing, or no limits of wear-down")
    mine = _probes_of_bearing(means, scene, scene.bearings[number].name)
    reason = _missing(mine)
    if reason:
        return FilmEstimate(reason=reason)
    others = [_probes_of_bearing(each, scene, scene.bearings[number].name) for each in healthy]
    run = _sinking_run(mine, plate, number, limits.condemning, severity)
    if isinstance(run, str):
        return FilmEstimate(reason=run)
    new = [
        _sinking_run(each, plate, number, limits.condemning, severity, healthy=True)
        for each in others
        if not _missing(each)
    ]
    return film_wear_down(
        run,
        [_probe(scene.probes, name).angle for name in mine.names],
        limits.condemning,
        limits.as_new,
        plate.doubts,
        healthy=[each for each in new if not isinstance(each, str)],
    )


def _probes_of_bearing(means: ProbeMeans, scene: ShaftScene, bearing: str) -> ProbeMeans:
    """Means of the probes in one bearing."""
    known = {probe.name for probe in scene.probes if probe.bearing == bearing}
    rows = [i for i, name in enumerate(means.names) if name in known]
    return replace(
        means,
        names=tuple(means.names[i] for i in rows),
        means=means.means[rows],
        swings=means.swings[rows],
    )


def _sinking_run(
    means: ProbeMeans,
    plate: Nameplate,
    number: int,
    limit: float,
    severity: str,
    *,
    healthy: bool = False,
) -> SinkingRun | str:
    scene = cast(ShaftScene, plate.on_the_day(means.row, means.speed_hz))
    places = sinking_places(scene, number, limit, healthy=healthy)
    if isinstance(places, str):
        return places
    readings, swing = _readings(means, scene.probes)
    return SinkingRun(
        readings=readings,
        places=places,
        likely=tuple(likely for likely, _ in possible_bores(scene.bearings[number])),
        swing=swing,
        clearance=scene.bearings[number].diametral_clearance / 2,
        measured=_measured(means, severity, healthy),
    )


def journal_fault(scene: JournalScene, means: ProbeMeans) -> str:
    """Why the clearance cannot be inferred from the journal position; empty if it can."""
    shaped = [
        name
        for name, present in (
            ("a scar", scene.bearing.scar > 0),
            ("grooves", scene.bearing.grooves),
        )
        if present
    ]
    if scene.bearing.inlet_fill < 1:
        return (
            f"inlet_fill = {scene.bearing.inlet_fill:g} must be 1: how well the inlet is filled "
            "changes from run to run, and the journal position with it"
        )
    if shaped:
        return (
            f"the bore has {' and '.join(shaped)}, must be round and plain: otherwise the "
            "journal position depends on its shape as much as on its clearance"
        )
    known = {probe.name for probe in scene.sensors}
    unknown = [name for name in means.names if name not in known]
    if unknown:
        return (
            f"probes {', '.join(unknown)} are not on the nameplate ({', '.join(sorted(known))}), "
            "whose angles it gives; rename them, or give the scene with --scene"
        )
    return _missing(means)


def _missing(means: ProbeMeans) -> str:
    """What a recording lacks; empty if it is complete."""
    if len(means.names) < _FEWEST_PROBES:
        return (
            f"{len(means.names)} probes of the nameplate are in the recording, must be >= "
            f"{_FEWEST_PROBES}: a journal position has two coordinates"
        )
    if means.speed_hz is None:
        return "the speed is unknown: add a tacho, or note speed_hz"
    return ""


_FEWEST_PROBES = 2


def _probe(probes: Sequence[ProximityProbe], name: str) -> ProximityProbe:
    return next(probe for probe in probes if probe.name == name)


def _readings(means: ProbeMeans, probes: Sequence[ProximityProbe]) -> tuple[Float, float]:
    """Mean readings corrected for the nameplate's offsets and gains, and rms of the motion [m]."""
    mine = [_probe(probes, name) for name in means.names]
    gains = np.array([probe.gain for probe in mine])
    readings = means.means / gains - np.array([probe.offset for probe in mine])
    # of the motion across the axis, however many probes see it
    swing = float(np.hypot.reduce(means.swings / gains) * np.sqrt(2 / len(mine)))
    return readings, swing


def _measured(means: ProbeMeans, severity: str, healthy: bool) -> float | None:
    """Measured wear [m] of a healthy recording; None if unknown."""
    value = float(means.row.get(severity, np.nan)) if healthy else np.nan
    return value if value > 0 else None


def _run(
    means: ProbeMeans, plate: Nameplate, severity: str, *, healthy: bool = False
) -> JournalRun:
    """Input of the film inversion from one recording."""
    scene = cast(JournalScene, plate.on_the_day(means.row, means.speed_hz))
    readings, swing = _readings(means, scene.sensors)
    bearing, viscosity = scene.bearing, scene.oil.dynamic_viscosity
    return JournalRun(
        readings=readings,
        swing=swing,
        load=(
            scene.rotor.mass * scene.gravity + scene.load.static,
            scene.load.static_across,
        ),
        film_force=viscosity
        * (_TURN * scene.drive.speed)
        * (bearing.diameter / 2) ** 3
        * bearing.length,
        measured=_measured(means, severity, healthy),
    )


_Method = Callable[[ProbeMeans, Nameplate, Sequence[ProbeMeans], str], FilmEstimate]

_METHODS: dict[tuple[str, str], _Method] = {
    ("diametral_clearance_bearing_m", "journal-bearing"): _journal,
    ("wear_down_bearing_{}_m", "propulsion-shaft"): _shaft,
}
"""Severity and machine -> estimate from the shaft position. A new method is one row."""

_NUMBER = re.compile(r"_[0-9]+_m$")


# --- comparison with the trained model


def with_film(estimate: Estimate, film: FilmEstimate | None) -> Estimate:
    """Put first that the film equilibrium contradicts the estimate or the given data.

    Examples
    --------
    >>> trained = Estimate(verdict="graded", grade=2, severity=2.4e-4, low=2.2e-4, high=2.6e-4)
    >>> film = FilmEstimate(severity=1.5e-4, low=1.4e-4, high=1.6e-4)
    >>> with_film(trained, film).cautions[0][:46]
    'film equilibrium and trained model disagree: 0'
    """
    cure = (
        "check the given load, viscosity and offsets, the probes, and whether the machine is one "
        "of the model's kind"
    )
    if film is None:
        return estimate
    if film.contradicted and estimate.low is not None:
        said = (
            f"film equilibrium: {film.reason.partition(':')[0]}, so that load, its direction, "
            "viscosity, probes or the shape of the bore are not as given"
        )
        return replace(estimate, verdict="caution", cautions=(said, *estimate.cautions))
    return with_second(estimate, film, "film equilibrium", cure)


_UNKNOWN = (
    "load, oil and geometry of the machine are unknown, and the severity depends on them as much "
    "as on the signals; give its scene (--scene SCENE|TOML), or differences from the trained one "
    "(--set PATH=VALUE)"
)


def film_table(
    film: FilmEstimate | None, plate: Nameplate | None, row: Mapping[str, Any]
) -> dict[str, Any] | None:
    """Estimate by the film equilibrium, for JSON and pages; None without one.

    Parameters
    ----------
    film : FilmEstimate or None
    plate : Nameplate or None
    row : mapping
        Conditions noted with the recording.
    """
    if film is None:
        return None
    if plate is None:
        return {**asdict(film), "nameplate": "", "text": film_words(film)}
    day = known_conditions(plate, row)
    usual = "" if day else "; load and oil from the nameplate, as none are given for this day"
    return {
        **asdict(film),
        "nameplate": plate.source,
        "conditions_of_the_day": list(day),
        "uncertainty": asdict(plate.doubts),
        "text": film_words(film) + (usual if film.severity is not None else ""),
    }


def film_words(film: FilmEstimate) -> str:
    """The estimate in a clause.

    Examples
    --------
    >>> found = FilmEstimate(severity=2.1e-4, low=1.9e-4, high=2.3e-4, budget={"load": 1e-5})
    >>> film_words(found).split("; ")[0]
    '0.210 mm (0.190 to 0.230, 90 %), without training'
    >>> film_words(found).split("; ")[1:]
    ['no healthy recordings', 'largest uncertainty: load, 0.010 mm']
    """
    if film.severity is None:
        return f"no estimate: {film.reason}"
    healthy = (
        f"against {film.healthy} healthy recordings" if film.healthy else "no healthy recordings"
    )
    worst = max(film.budget, key=lambda name: film.budget[name], default="")
    doubt = f"; largest uncertainty: {worst}, {1e3 * film.budget[worst]:.3f} mm" if worst else ""
    return f"{length_words(film)}, without training; {healthy}{doubt}"
