"""The film equilibrium beside a trained model: its estimate of a recording, and whether they agree.

What the equilibrium needs is no training but the machine's nameplate and the conditions of the day.
Where both estimates are there and contradict each other, that is the first thing to be said: one of
them is told something wrong, or the machine is not what either takes it for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np

from ..datasets.record import Recording
from ..sim.journal_parts import JournalScene
from .estimate import Estimate
from .film_clearance import FilmEstimate, JournalRun, film_clearance
from .healthy import Baseline
from .nameplate import Nameplate
from .probe_means import ProbeMeans, probe_means

_TURN = 2 * np.pi
_CLEARANCE = "diametral_clearance_bearing_m"


def film_estimate(
    recording: Recording,
    severity: str,
    plate: Nameplate | None,
    baseline: Baseline | None = None,
) -> FilmEstimate | None:
    """Severity of a machine from where its shaft runs.

    Parameters
    ----------
    recording : Recording
    severity : str
        Column of the wear that is asked for.
    plate : Nameplate or None
        What is known beside the signals.
    baseline : Baseline, optional
        Healthy recordings of the same machine: they tell the offsets of the probes.

    Returns
    -------
    FilmEstimate or None
        None where no such estimate exists for this wear or machine, or nothing is known of it.
    """
    way = None if plate is None else _WAYS.get((severity, plate.scene.machine))
    if way is None or plate is None:
        return None
    healthy = () if baseline is None else baseline.positions
    return way(probe_means(recording), plate, healthy, severity)


def _journal(
    means: ProbeMeans, plate: Nameplate, healthy: Sequence[ProbeMeans], severity: str
) -> FilmEstimate:
    from ..sim.journal import film_geometry  # compiled code: a second that others need not wait
    from ..sim.rest_curve import rest_curve

    scene = cast(JournalScene, plate.scene)
    reason = journal_fault(scene, means)
    if reason:
        return FilmEstimate(reason=reason)
    usable = [each for each in healthy if not journal_fault(scene, each)]
    wear = scene.wear
    built = scene.bearing.clearance_diametral
    as_new = (wear.as_new, wear.grade_edges[0]) if wear else (built / _BUILT, built * _BUILT)
    return film_clearance(
        _run(means, plate, severity),
        rest_curve(film_geometry(scene), "short" if scene.film.rung == "short" else "direct"),
        [_probe(scene, name).angle for name in means.names],
        as_new,
        healthy=[_run(each, plate, severity, healthy=True) for each in usable],
        doubts=plate.doubts,
    )


_BUILT = 1.3  # makers' tolerances of a clearance, where no limits say what as new is


def journal_fault(scene: JournalScene, means: ProbeMeans) -> str:
    """Why the place of a journal tells nothing of its clearance; empty where it does."""
    shaped = [
        name
        for name, there in (
            ("a scar", scene.bearing.scar_depth > 0),
            ("grooves", scene.bearing.grooves),
        )
        if there
    ]
    if shaped:
        return (
            f"the bore has {' and '.join(shaped)}, must be round and plain: the place of the "
            "journal then tells of its shape as much as of its clearance"
        )
    if means.speed_hz is None:
        return "the speed is unknown: add a tacho, or note speed_hz"
    known = {probe.name for probe in scene.sensors}
    strange = [name for name in means.names if name not in known]
    if strange:
        return (
            f"probes {', '.join(strange)} are none of the nameplate's {', '.join(sorted(known))}, "
            "whose angles it gives; rename them, or give the scene with --scene"
        )
    if len(means.names) < _FEWEST_PROBES:
        return (
            f"{len(means.names)} channels of displacement, must be >= {_FEWEST_PROBES}: the place "
            "of a journal is two numbers"
        )
    return ""


_FEWEST_PROBES = 2


def _probe(scene: JournalScene, name: str) -> Any:
    return next(probe for probe in scene.sensors if probe.name == name)


def _run(
    means: ProbeMeans, plate: Nameplate, severity: str, *, healthy: bool = False
) -> JournalRun:
    """A recording as the film sees it; the nameplate's own offsets and gains are taken out."""
    scene = cast(JournalScene, plate.on_the_day(means.row, means.speed_hz))
    probes = [_probe(scene, name) for name in means.names]
    gains = np.array([probe.gain for probe in probes])
    readings = means.means / gains - np.array([probe.offset for probe in probes])
    bearing = scene.bearing
    measured = float(means.row.get(severity, np.nan)) if healthy else np.nan
    return JournalRun(
        readings=readings,
        swing=float(np.hypot.reduce(means.swings / gains) * np.sqrt(2 / len(probes))),
        load=(
            scene.rotor.mass * scene.gravity + scene.load.static,
            scene.load.static_across,
        ),
        film_force=scene.oil.dynamic_viscosity
        * _TURN
        * scene.drive.speed
        * (bearing.diameter / 2) ** 3
        * bearing.length,
        measured=measured if measured > 0 else None,
    )


_Way = Callable[[ProbeMeans, Nameplate, Sequence[ProbeMeans], str], FilmEstimate]

_WAYS: dict[tuple[str, str], _Way] = {
    (_CLEARANCE, "journal-bearing"): _journal,
}
"""Severity and machine -> how it is told from the place of the shaft. A new one is one row."""


# --- beside the trained model


def with_film(estimate: Estimate, film: FilmEstimate | None) -> Estimate:
    """An estimate that says first where the film equilibrium contradicts it.

    Examples
    --------
    >>> trained = Estimate(verdict="graded", grade=2, severity=2.4e-4, low=2.2e-4, high=2.6e-4)
    >>> film = FilmEstimate(severity=1.5e-4, low=1.4e-4, high=1.6e-4)
    >>> with_film(trained, film).cautions[0][:46]
    'film equilibrium and trained model disagree: 0'
    """
    if film is None or not disagree(estimate, film):
        return estimate
    said = (
        f"film equilibrium and trained model disagree: {_length(asdict(film))} against "
        f"{_length(estimate.as_dict())}; check load, viscosity and offsets that were told, the "
        "probes, and whether the machine is one of the model's kind"
    )
    return replace(estimate, verdict="caution", cautions=(said, *estimate.cautions))


def disagree(estimate: Estimate, film: FilmEstimate) -> bool:
    """Whether two estimates have intervals that do not touch."""
    ends = (estimate.low, estimate.high, film.low, film.high)
    if any(end is None for end in ends):
        return False
    low, high, film_low, film_high = cast(tuple[float, float, float, float], ends)
    return film_high < low or high < film_low


def film_table(film: FilmEstimate | None, plate: Nameplate | None) -> dict[str, Any] | None:
    """For JSON and pages; None where there is no such estimate."""
    if film is None or plate is None:
        return None
    return {
        **asdict(film),
        "nameplate": plate.source,
        "uncertainty": asdict(plate.doubts),
        "text": film_words(film),
    }


def film_words(film: FilmEstimate) -> str:
    """The estimate in a clause.

    Examples
    --------
    >>> film_words(FilmEstimate(severity=2.1e-4, low=1.9e-4, high=2.3e-4, healthy=3))
    '0.210 mm (0.190 to 0.230, 90 %), without training; offsets by 3 healthy recordings'
    """
    if film.severity is None:
        return f"not told: {film.reason}"
    offsets = (
        f"offsets by {film.healthy} healthy recordings"
        if film.healthy
        else "offsets of the probes as declared"
    )
    return f"{_length(asdict(film))}, without training; {offsets}"


def _length(found: Mapping[str, Any]) -> str:
    return (
        f"{1e3 * found['severity']:.3f} mm ({1e3 * found['low']:.3f} to {1e3 * found['high']:.3f}, "
        f"{100 * found['coverage']:.0f} %)"
    )
