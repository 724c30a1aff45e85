"""The alignment of a shaft line as one HTML page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...sim.alignment.alignment import LineState, influence
from ...sim.shaft_films.status import ShaftFilmError
from ..pages.page import render, save_page
from ..pages.picture import PageImage, page_image
from ..shaft_tests.before_after import EXPECTED, BeforeAfter, rig_text
from ..shaft_tests.measured_tests import LineTest
from ..shaft_tests.rig_figure import rig_figure
from ..shaft_tests.sag_report import SagReport, next_texts, sag_images, sag_rows
from .align import Alignment, states_after
from .figure import align_images
from .films import (
    FILM_HEAD,
    LineFilms,
    film_cells,
    film_states,
    pressure_images,
    resting,
    transfer_images,
)
from .margins import jack_cells, jack_rows, margin_cells, margin_rows
from .text import (
    COLUMN_HEADS,
    UNITS_OF_COLUMNS,
    bearing_row,
    bearing_verdict,
    block_texts,
    fixed_digits,
    headline,
    jacking_text,
    margin_lines,
    move_lines,
    reactions_before_after,
)


def align_html(
    found: Alignment,
    tested: BeforeAfter | None = None,
    *,
    measured: SagReport | None = None,
    note: str = "",
) -> str:
    """A self-contained page: verdict, tables, pictures, moves, and a simulated test of them.

    Parameters
    ----------
    found : Alignment
    tested : BeforeAfter, optional
        From :func:`wearstate.diagnose.shaft_tests.before_after.calibrated_test`.
    measured : SagReport, optional
        Sags from measured tests; `found` then refers to the line with these sags.
    note : str
        Why a requested test is missing.

    Returns
    -------
    str
        HTML.
    """
    moves, turns = found.proposed
    films = film_states(found.scene, moves, turns)
    return render(
        "align.html.j2",
        found=found,
        films=_films(films),
        transfers=_transfers(found, moves, turns, measured),
        margin_rows=margin_cells(margin_rows(found.states, states_after(found))),
        jack_rows=jack_cells(jack_rows(found.states, found.calibration)),
        colour=_COLOURS[found.verdict],
        headline=headline(found),
        states=[_state_cells(state) for state in found.states],
        head=COLUMN_HEADS,
        unit=UNITS_OF_COLUMNS,
        influence=influence(found.line, found.states[0]) / 1e6,
        blocks=block_texts(found.calibration.blocks) if found.calibration else [],
        moves=move_lines(found.calibration) if found.calibration else [],
        before_after=reactions_before_after(found.calibration) if found.calibration else [],
        jack=jacking_text(found.jacking, found.states[0].condition.name) if found.jacking else "",
        images=align_images(found),
        margins=margin_lines(found.calibration, found.margin) if found.calibration else [],
        tested=None if tested is None else _tested(tested),
        measured=None if measured is None else _measured(measured),
        note=note,
        fixed=fixed_digits,
    )


_COLOURS = {"within": "#3a923a", "warning": "#e07b00", "alarm": "#c03a2b"}


def _state_cells(state: LineState) -> dict[str, Any]:
    return {
        "name": state.condition.name,
        "load": f"{state.reactions.sum() / 1e3:.1f}",
        "rows": [
            (bearing_row(state, i), bearing_verdict(state, name))
            for i, name in enumerate(state.line.names)
        ],
    }


def _tested(result: BeforeAfter) -> dict[str, Any]:
    """A simulated test for the page: heading, summary, pictures and peaks."""
    heading, *_ = rig_text(result).splitlines()
    rows = [
        (
            peak.channel,
            peak.verdict,
            f"{peak.frequency_before:.1f}",
            f"{peak.level_before:.1f}",
            f"{peak.change:+.1f}",
            f"{peak.interval[0]:+.1f} … {peak.interval[1]:+.1f}",
            f"{peak.model_change:+.1f}",
            EXPECTED[peak.expected],
        )
        for peak in result.changes
    ]
    return {
        "heading": heading,
        "summary": result.summary,
        "rows": rows,
        "images": [
            page_image(rig_figure(result, channels=[name], title=False))
            for name in result.before.channels
        ],
    }


def _films(states: Sequence[LineFilms]) -> dict[str, Any]:
    """Oil films for the page; without a picture if the line has no equilibrium."""
    rests = any(state.film is not None for state in states)
    return {
        "head": FILM_HEAD,
        "rows": film_cells(states),
        "faults": resting(states),
        "images": pressure_images(states) if rests else [],
    }


def _transfers(
    found: Alignment,
    moves: Mapping[str, float],
    turns: Mapping[str, float],
    measured: SagReport | None,
) -> list[PageImage]:
    """Pictures of transfer functions, for each measured test, else of the model alone."""
    tests: Sequence[LineTest | None] = (measured.tests if measured else ()) or (None,)
    try:
        return [
            image
            for test in tests
            for image in transfer_images(found.scene, moves, turns, measured=test)
        ]
    except ShaftFilmError:  # reported with the table of the films
        return []


def _measured(report: SagReport) -> dict[str, Any]:
    """Sags from measured tests, for the page."""
    head, *rows = sag_rows(report)
    return {
        "headline": report.headline,
        "plausible": report.posterior.plausible,
        "head": head,
        "rows": rows,
        "tests": [*report.doubts, *report.sources],
        "next": next_texts(report),
        "images": sag_images(report),
    }


def save_html(
    found: Alignment,
    path: Path,
    tested: BeforeAfter | None = None,
    *,
    measured: SagReport | None = None,
    note: str = "",
    force: bool = True,
) -> None:
    """Write :func:`align_html` atomically."""
    save_page(align_html(found, tested, measured=measured, note=note), path, force=force)
