"""The command `align`: bearing loads of a shaft line, and moves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..options.help import command
from ..options.names import scene_argument
from ..options.outputs import (
    PAGE_SUFFIXES,
    PICTURE_SUFFIXES,
    check_outputs,
)
from ..options.shared import (
    EXIT_ALARM,
    EXIT_WARNING,
    PATH,
    Share,
    emit,
    force_option,
    json_option,
    scene_of,
    seed_option,
    set_option,
)

_ALIGN_FAIL_ON_HELP = (
    "Exit 3 if a limit is not met, 4 if a bearing lifts or no moves help; alarm: only 4."
)


@command()
@scene_argument
@set_option
@click.option(
    "--condition",
    type=click.Choice(["cold", "hot", "running", "all"]),
    default="all",
    show_default=True,
    help="Condition in which the limits must hold.",
)
@click.option(
    "--calibrate/--no-calibrate",
    default=True,
    show_default=True,
    help="Look for bearing moves that meet the limits.",
)
@click.option(
    "--prefer",
    type=click.Choice(["least", "fewest"]),
    default="least",
    show_default=True,
    help="Smallest sum of moves, or fewest bearings moved.",
)
@click.option(
    "--target",
    type=click.Choice(["limits", "even", "vibration"]),
    default="limits",
    show_default=True,
    help="limits: smallest moves that meet the limits; even: also the most equal reactions within "
    "them; vibration: also the quietest running line within them.",
)
@click.option(
    "--margin",
    type=Share(0.0, 0.9),
    default=0.0,
    show_default=True,
    help="Safety margin to each limit, as a fraction of it.",
)
@click.option("--jack", metavar="BEARING", help="Simulate a jacking test next to this bearing.")
@click.option(
    "--test",
    "rig_test",
    type=click.Choice(["hammer", "shaker"]),
    help="Simulate this test of the running shaft before and after the moves.",
)
@click.option(
    "--push",
    metavar="BEARING",
    help="Bearing at which --test pushes the shaft up; default: the aftmost.",
)
@click.option("--test-plot", type=PATH, help="Picture of --test to write.")
@click.option(
    "--from-test",
    "tests",
    type=PATH,
    multiple=True,
    help="Data set of measured tests of the line, with force channels, from which its sags are "
    "estimated.",
)
@click.option("--reactions", type=PATH, help="CSV of measured reactions: bearing, reaction_kn.")
@click.option(
    "--jacking", type=PATH, help="CSV of measured jacking curves: bearing, lift_mm, load_kn."
)
@click.option(
    "--reactions-in",
    type=click.Choice(["cold", "hot", "running"]),
    default="cold",
    show_default=True,
    help="Condition in which --reactions and --jacking were measured.",
)
@seed_option
@click.option("--plot", type=PATH, help="Picture to write (.png, .svg or .pdf).")
@click.option("-o", "--output", type=PATH, help="HTML page to write.")
@click.option("--fail-on", type=click.Choice(["warning", "alarm"]), help=_ALIGN_FAIL_ON_HELP)
@force_option
@json_option
def align(
    scene_name: str,
    pairs: Sequence[str],
    condition: str,
    calibrate: bool,
    prefer: str,
    target: str,
    margin: float,
    jack: str | None,
    rig_test: str | None,
    push: str | None,
    test_plot: Path | None,
    tests: Sequence[Path],
    reactions: Path | None,
    jacking: Path | None,
    reactions_in: str,
    seed: int,
    plot: Path | None,
    output: Path | None,
    fail_on: str | None,
    force: bool,
    as_json: bool,
) -> None:
    """Compute bearing loads of the shaft line SCENE, and the moves that bring them within limits.

    With --from-test, --reactions or --jacking, the bearings are first placed where these
    measurements put them.
    """
    from ..alignment.align import align as judge
    from ..alignment.figure import save_figure
    from ..alignment.page import save_html
    from ..alignment.table import align_table
    from ..alignment.text import align_text
    from ..shaft_tests.sag_report import sag_table, sag_text

    if rig_test is None and (push or test_plot or seed):
        raise click.UsageError("--push, --test-plot and --seed need --test")
    if not calibrate and (margin or target != "limits" or prefer != "least"):
        raise click.UsageError(
            "--margin, --target and --prefer concern the moves: leave out --no-calibrate"
        )
    if rig_test is not None and not calibrate:
        raise click.UsageError("--test compares before and after moves: leave out --no-calibrate")
    outputs = [(plot, PICTURE_SUFFIXES), (output, PAGE_SUFFIXES), (test_plot, PICTURE_SUFFIXES)]
    inputs = [*tests, *(path for path in (reactions, jacking) if path)]
    check_outputs([scene_name, *inputs], outputs, force)
    scene = scene_of(scene_name, pairs)
    scene, measured = _measured(scene, tests, reactions, jacking, reactions_in)
    found = judge(
        scene,
        condition=condition,
        mend=calibrate,
        prefer=prefer,
        target=target,
        margin=margin,
        jack=jack,
    )
    result, tested, words = _tested(
        scene, found.calibration, rig_test, push, test_plot, seed, force
    )
    if plot is not None:
        save_figure(found, plot, force=force)
    if output is not None:
        note = "" if result else "".join(words)
        save_html(found, output, result, measured=measured, note=note, force=force)
    files = [str(path) for path, _ in outputs if path and path.exists()]
    said = [] if measured is None else [sag_text(measured), ""]
    text = "\n".join([*said, align_text(found), *words, *files])
    sags = None if measured is None else sag_table(measured)
    emit({**align_table(found), "sags": sags, "test": tested, "files": files}, as_json, text)
    levels = {"warning": EXIT_WARNING, "alarm": EXIT_ALARM}
    code = levels.get(found.verdict, 0) if fail_on else 0
    raise click.exceptions.Exit(0 if fail_on == "alarm" and code == EXIT_WARNING else code)


def _measured(
    scene: Any, tests: Sequence[Path], reactions: Path | None, jacking: Path | None, condition: str
) -> tuple[Any, Any]:
    """The scene as placed by its tests, with their results; unchanged without tests."""
    if not tests and reactions is None and jacking is None:
        return scene, None
    from ..shaft_tests.sag_report import sag_report, sagged

    found = sag_report(scene, tests, reactions, curves=jacking, condition=condition)
    return sagged(scene, found.posterior), found


def _tested(
    scene: Any,
    calibration: Any,
    kind: str | None,
    push: str | None,
    picture: Path | None,
    seed: int,
    force: bool,
) -> tuple[Any, dict[str, Any] | None, list[str]]:
    """Result, table and text of the simulated test of the moves, if requested."""
    if kind is None:
        return None, None, []
    from ..pages.picture import save_picture
    from ..shaft_tests.before_after import calibrated_test, rig_table, rig_text
    from ..shaft_tests.rig_figure import rig_figure

    result = calibrated_test(scene, calibration, kind, push=push, seed=seed)
    if result is None:
        return None, None, ["", "no test: nothing moves, so nothing changes"]
    if picture is not None:
        save_picture(rig_figure(result), picture, force=force)
    return result, rig_table(result), ["", rig_text(result)]
