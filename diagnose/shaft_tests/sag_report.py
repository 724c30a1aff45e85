"""Sags of a shaft line from its tests, and the next test: table, text, picture."""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from ..pages.page import short_name
from ..pages.picture import PageImage, drawn_alone
from .jacking_tests import JackedBearing, measured_curves, read_curves
from .measured_tests import LineTest, read_reactions, read_tests
from .next_test import PlannedTest, candidate_places, rank_tests
from .sag_films import estimate_over_films, nearly_unloaded
from .sag_model import MeasuredReactions, Prior, SagError
from .sags import SagPosterior

CONFIDENCE = 0.9
"""Confidence of the reported intervals [-]."""

_GAIN = 0.02 / math.sqrt(3)  # sensors are calibrated before the test to 2 per cent
_SHOWN = 3  # tests proposed
_UNDECIDED = 0.05  # probability of a rupture condition: below it the other one is certain
_WORTH = 0.1  # smallest relative reduction of the variance that is worth a test


@dataclass(frozen=True, kw_only=True, eq=False)
class SagReport:
    """Sags of a line from its tests, and proposals for the next test.

    Attributes
    ----------
    posterior : SagPosterior
    tests : tuple of LineTest
    reactions : MeasuredReactions or None
        Reactions given directly and from jacking curves.
    planned : tuple of PlannedTest
        Proposed tests, the most informative first.
    jacked : tuple of JackedBearing
        Jacking curves.
    unloaded : tuple of str
        Bearings for which two sags may explain the tests.
    """

    posterior: SagPosterior
    tests: tuple[LineTest, ...]
    reactions: MeasuredReactions | None
    planned: tuple[PlannedTest, ...]
    jacked: tuple[JackedBearing, ...] = ()
    unloaded: tuple[str, ...] = ()

    @property
    def doubts(self) -> list[str]:
        """Doubts that the intervals do not include, one sentence each."""
        films = self.posterior.films
        texts = []
        if min(films.values(), default=0.0) > _UNDECIDED:
            shares = ", ".join(f"{name} {share:.0%}" for name, share in films.items())
            texts.append(
                f"the films may rupture either way ({shares}): mean and interval include both"
            )
        if self.unloaded:
            texts.append(
                f"{', '.join(self.unloaded)} may be unloaded: then two sags some hundredths of a "
                "millimetre apart explain a test; jack it, or raise it and test again"
            )
        return texts

    @property
    def sources(self) -> list[str]:
        """Summary of each test and each jacking curve, one line each."""
        return [*(test.text for test in self.tests), *(one.text for one in self.jacked)]

    @property
    def headline(self) -> str:
        """Which bearings have sagged, in one sentence."""
        found = self.posterior
        against = f"against the line through {' and '.join(found.datum)}"
        if not found.plausible:
            return (
                f"the line as described does not explain the measurements (misfit "
                f"{found.misfit:.2f}, must be about 1): discard these sags; check places, speed, "
                "oil and housings of the scene"
            )
        sure = [
            name
            for name, (low, high) in zip(found.bearings, found.interval(CONFIDENCE), strict=True)
            if low > 0 or high < 0
        ]
        if not sure:
            return f"no bearing is known to have moved {against}"
        return f"moved, with {CONFIDENCE:.0%} confidence each, {against}: {', '.join(sure)}"


def sag_report(
    scene: Scene,
    tests: Sequence[Path] = (),
    reactions: Path | None = None,
    *,
    curves: Path | None = None,
    condition: str = "cold",
) -> SagReport:
    """Sags of a line from files of its tests and reactions.

    Parameters
    ----------
    scene : Scene
        The line as aligned, of the machine propulsion-shaft.
    tests : sequence of Path
        Files for :func:`.shaft_tests.measured_tests.read_tests`.
    reactions : Path, optional
        File for :func:`.shaft_tests.measured_tests.read_reactions`.
    curves : Path, optional
        File for :func:`.shaft_tests.jacking_tests.read_curves`, with bearings that are not in
        `reactions`.
    condition : str
        Condition of the scene during these measurements.

    Returns
    -------
    SagReport
        Gains of sensors and force cells are assumed to be calibrated to 2 %.

    Raises
    ------
    DataError, SagError, ShaftFilmError
        As in reading and estimation.
    """
    if not isinstance(scene, ShaftScene):
        raise SagError(
            f"machine of scene '{scene.name}' = '{scene.machine}' must be 'propulsion-shaft'; "
            "only a shaft line has sags"
        )
    prior = Prior(gain=_GAIN)
    read = [test for path in tests for test in read_tests(path, scene)]
    jacked = None if reactions is None else read_reactions(reactions, scene, condition=condition)
    lifted = () if curves is None else read_curves(curves, scene, condition=condition)
    if lifted:
        jacked = _together(jacked, measured_curves(lifted, condition))
    posterior = estimate_over_films(scene, [test.transfer for test in read], jacked, prior=prior)
    names = posterior.bearings
    done = set() if jacked is None else set(jacked.reactions)
    planned = rank_tests(
        scene,
        posterior,
        prior=prior,
        places=candidate_places(scene),
        jacks=[name for name in names if name not in done],
        condition=condition,
    )
    return SagReport(
        posterior=posterior,
        tests=tuple(read),
        reactions=jacked,
        planned=planned,
        jacked=lifted,
        unloaded=nearly_unloaded(scene, posterior) if read and posterior.plausible else (),
    )


def _together(one: MeasuredReactions | None, other: MeasuredReactions) -> MeasuredReactions:
    """Reactions from a table and from curves, merged."""
    if one is None:
        return other
    twice = sorted(set(one.reactions) & set(other.reactions))
    if twice:
        raise SagError(
            f"bearings {', '.join(twice)} are in reactions and in jacking, must be in one of them; "
            "remove them from one"
        )
    return MeasuredReactions(
        reactions={**one.reactions, **other.reactions},
        deviations={**one.deviations, **other.deviations},
        condition=one.condition,
    )


def sagged(scene: ShaftScene, found: SagPosterior) -> ShaftScene:
    """Scene with the bearings at the estimated sags; unchanged if these are implausible.

    Examples
    --------
    >>> from wearstate.diagnose.shaft_tests.sags import estimate_sags
    >>> from wearstate.sim.scene.load import load_scene
    >>> rig = load_scene("shaft-rig")
    >>> jacks = MeasuredReactions(reactions={"second": 200.0}, deviations={"second": 5.0})
    >>> sagged(rig, estimate_sags(rig, measured=jacks)).bearings[1].offset < 0
    True
    """
    if not found.plausible:
        return scene
    down = dict(zip(found.bearings, found.mean.tolist(), strict=True))
    bearings = tuple(
        bearing.model_copy(update={"offset": bearing.offset - down.get(bearing.name, 0.0)})
        for bearing in scene.bearings
    )
    return scene.model_copy(update={"bearings": bearings})


def sag_table(report: SagReport) -> dict[str, Any]:
    """Report in SI, ready for JSON."""
    found = report.posterior
    return {
        "headline": report.headline,
        "datum": list(found.datum),
        "plausible": found.plausible,
        "misfit": found.misfit,
        "confidence": CONFIDENCE,
        "bearings": [
            {
                "name": name,
                "sag_m": float(mean),
                "deviation_m": float(deviation),
                "interval_m": [float(low), float(high)],
            }
            for name, mean, deviation, (low, high) in zip(
                found.bearings,
                found.mean,
                found.deviation,
                found.interval(CONFIDENCE),
                strict=True,
            )
        ],
        "films": found.films,
        "doubts": report.doubts,
        "covariance_m2": found.covariance.tolist(),
        "tests": report.sources,
        "jacking": [one.as_dict() for one in report.jacked],
        "next": [
            {
                "text": one.text,
                "push": list(one.push) if isinstance(one.push, tuple) else None,
                "jack": one.jack or None,
                "force_n": one.force,
                "deviations_m": list(one.deviations),
                "variance_taken": one.gain,
            }
            for one in report.planned
        ],
    }


def sag_text(report: SagReport) -> str:
    """Report for a terminal, in mm."""
    found = report.posterior
    lines = [f"sags: {report.headline}"]
    lines += [f"  {' '.join(row)}" for row in _aligned(sag_rows(report))]
    lines += [f"  {text}" for text in (*report.doubts, *report.sources)]
    return "\n".join([*lines, *(f"  {text}" for text in _next_texts(report, found))])


def sag_rows(report: SagReport) -> list[tuple[str, str, str]]:
    """Bearing, sag and interval [mm], with a heading."""
    found = report.posterior
    rows = [("bearing", "sag mm", f"{CONFIDENCE:.0%} interval")]
    for name, mean, (low, high) in zip(
        found.bearings, 1e3 * found.mean, 1e3 * found.interval(CONFIDENCE), strict=True
    ):
        rows.append((name, f"{mean:.3f}", f"{low:.3f} … {high:.3f}"))
    return rows


def _aligned(rows: Sequence[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    width = max(len(row[0]) for row in rows)
    return [(a.ljust(width), b.rjust(8), c.rjust(18)) for a, b, c in rows]


def _next_texts(report: SagReport, found: SagPosterior) -> list[str]:
    return [f"next: {text}" for text in next_texts(report)] if found.plausible else []


def next_texts(report: SagReport) -> list[str]:
    """The most informative tests, and the uncertainty that they would leave."""
    texts = []
    for one in report.planned[:_SHOWN]:
        left = ", ".join(f"{1e3 * deviation:.3f}" for deviation in one.deviations)
        unit = f"error {one.force:.3g} N" if one.jack else f"{one.force:.3g} N rms"
        texts.append(
            f"{one.text} ({unit}): reduces the variance by {one.gain:.0%}, leaves ±{left} mm"
        )
    if report.planned and report.planned[0].gain < _WORTH:
        texts.append("none of them gains much: measure oil, clearances and housings instead")
    return texts


def sag_images(report: SagReport) -> list[PageImage]:
    """Pictures: sag of every bearing with its interval, and gain of the next tests."""
    return [
        drawn_alone(partial(_draw_sags, report=report), height=3.2),
        drawn_alone(partial(_draw_next, report=report), height=3.2),
    ]


def _draw_sags(axes: Any, report: SagReport) -> None:
    found = report.posterior
    at = np.arange(len(found.bearings))
    width = 1e3 * (found.interval(CONFIDENCE)[:, 1] - found.mean)
    axes.errorbar(
        at, 1e3 * found.mean, yerr=width, fmt="o", color="#1f5a94", capsize=4,
        label=f"estimate, {CONFIDENCE:.0%} interval",
    )  # fmt: skip
    axes.axhline(0, color="black", lw=0.6)
    names = [short_name(name, 20) for name in found.bearings]
    axes.set_xticks(at, names, rotation=20, ha="right", fontsize=9)
    axes.set_xlim(-0.5, at.size - 0.5)
    axes.set(ylabel="sag [mm]", title="Sags from the tests")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)


def _draw_next(axes: Any, report: SagReport) -> None:
    shown = report.planned[:_SHOWN][::-1]
    names = [textwrap.fill(one.text, 26) for one in shown]
    axes.barh(names, [100 * one.gain for one in shown], color="#b3541e")
    axes.set(xlim=(0, 100), xlabel="reduction of the variance [%]", title="Next test")
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(alpha=0.3)
