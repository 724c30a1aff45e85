"""Commands about one machine: scenes, simulation, transfer functions, alignment, literature."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..pages.plain_json import json_text
from .command_help import HelpfulGroup, command
from .command_names import SCENE
from .command_options import (
    DATA_SUFFIXES,
    EXIT_ALARM,
    EXIT_BAD_INPUT,
    EXIT_FAILED,
    EXIT_WARNING,
    PAGE_SUFFIXES,
    PATH,
    PICTURE_SUFFIXES,
    SCENE_SUFFIXES,
    Share,
    check_outputs,
    emit,
    force_option,
    json_option,
    scene_of,
    seed_option,
)

_ALIGN_FAIL_ON_HELP = (
    "Exit 3 where a limit is not met, 4 where a bearing lifts or no moves help; alarm: only 4."
)


@click.group(cls=HelpfulGroup)
def scene() -> None:
    """List, show, check, explain and create scenes, the machines to simulate."""


@scene.command("list")
@json_option
def scene_list(as_json: bool) -> None:
    """List the built-in scenes with their descriptions."""
    from ...sim.scene.load import load_scene, scene_names

    scenes = {name: load_scene(name).description for name in scene_names()}
    emit({"scenes": scenes}, as_json, "\n".join(f"{n:24} {d}" for n, d in scenes.items()))


@scene.command("show")
@click.argument("name", metavar="SCENE", type=SCENE)
def scene_show(name: str) -> None:
    """Print the TOML text of a scene, to copy, change and check."""
    from ...sim.scene.load import scene_table, scene_text
    from ...sim.scene.scene import SceneError

    text = scene_text(name)
    if not isinstance(scene_table(text, name).get("machine"), str):
        raise SceneError(name, ["machine is missing, must be a text; this file is no scene"])
    click.echo(text, nl=False)


@scene.command("check")
@click.argument("file", metavar="SCENE", type=SCENE)
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option(
    "--deep",
    is_flag=True,
    help="Compare each key figure with its usual range; runs a short simulation.",
)
@json_option
def scene_check(file: str, pairs: Sequence[str], deep: bool, as_json: bool) -> None:
    """Check a scene: all faults at once, and warnings of likely mistakes.

    --deep: a table of the machine's key figures (natural frequencies, forces, films, contacts,
    cost), each with its usual range, and a correction where it is outside. Exit 2 for faults, with
    --deep also where a short simulation fails; an unusual figure alone is no fault.
    """
    from ...sim.machine.simulate import check
    from ...sim.scene.plausibility import scene_doubts

    checked = scene_of(file, pairs)
    check(checked)
    if deep:
        _deep_check(checked, as_json)
        return
    warnings = [doubt.text for doubt in scene_doubts(checked)]
    told = f", {len(warnings)} warning(s)" if warnings else ""
    lines = [f"{checked.name}: no fault{told}", *(f"warning: {text}" for text in warnings)]
    emit({"scene": checked.name, "faults": [], "warnings": warnings}, as_json, "\n".join(lines))


def _deep_check(checked: Any, as_json: bool) -> None:
    from ...sim.deep_check.check import deep_check
    from ..inspect.deep_check_text import deep_check_table, deep_check_text

    found = deep_check(checked)
    faults = [found.failure] if found.failure else []
    told = {"scene": checked.name, "faults": faults, "warnings": list(found.warnings)}
    emit({**told, **deep_check_table(found)}, as_json, deep_check_text(checked.name, found))
    raise click.exceptions.Exit(EXIT_BAD_INPUT if faults else 0)


@scene.command("explain")
@click.argument("subject", metavar="[SCENE|MACHINE]", required=False, default="", type=SCENE)
@click.argument("key", metavar="[KEY]", required=False, default="")
@json_option
def scene_explain(subject: str, key: str, as_json: bool) -> None:
    """Explain the keys of a scene: meaning, unit, range, default, and the rungs to choose from.

    MACHINE is pump, journal or shaft; for a SCENE its own values are shown as well. KEY is a dotted
    path, a table or the end of a path: `scene explain pump pressure.rung`, for short
    `scene explain pump.pressure.rung`.
    """
    from ..inspect.keys import found_keys
    from ..inspect.keys_text import explained, keys_table, subjects_text

    if not subject:
        emit({"subjects": []}, as_json, subjects_text())
        return
    found = found_keys(subject, key)
    emit(keys_table(found), as_json, "\n\n".join(map(explained, found)))


_MACHINES = ("pump", "journal", "shaft")  # as wearstate.sim.scene.load, too heavy for --help


@scene.command("schema")
@click.argument("machine", type=click.Choice(_MACHINES))
@click.option("-o", "--output", type=PATH, help="File to write (.json); default: stdout.")
@force_option
def scene_schema(machine: str, output: Path | None, force: bool) -> None:
    """Print the JSON schema of a scene, for an editor that completes and checks TOML.

    Name it in the first line of a scene: `#:schema ./pump.json` (taplo, Even Better TOML).
    """
    from ...sim.scene.load import machine_type
    from ..inspect.schema import scene_schema as schema_of
    from ..pages.page import save_page

    check_outputs([], [(output, (".json",))], force)
    text = json_text(schema_of(machine_type(machine)), indent=1)
    if output is None:
        click.echo(text)
        return
    save_page(text, output, force=force)
    click.echo(output)


@scene.command("new")
@click.argument("machine", type=click.Choice(_MACHINES))
@click.option("-o", "--output", type=PATH, required=True, help="Scene to write (.toml).")
@force_option
def scene_new(machine: str, output: Path, force: bool) -> None:
    """Write a scene of your own with the fewest keys that run: change its numbers, add others."""
    from ...sim.atomic import write_whole
    from ...sim.scene.load import minimal_text

    check_outputs([], [(output, SCENE_SUFFIXES)], force)
    write_whole(output, minimal_text(machine).encode(), force=force)
    click.echo(
        f"{output}\nnext: wearstate scene check {output}; wearstate simulate {output}; "
        f"wearstate scene explain {machine}"
    )


@command()
@click.argument("scene_name", metavar="SCENE", type=SCENE)
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option("-o", "--output", type=PATH, help="Recording to write (.h5).")
@click.option("--plot", type=PATH, help="Picture to write (.png, .svg or .pdf).")
@click.option("--truth", is_flag=True, help="Also store forces and orbit.")
@seed_option
@force_option
@json_option
def simulate(
    scene_name: str,
    pairs: Sequence[str],
    output: Path | None,
    plot: Path | None,
    truth: bool,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Simulate one recording of SCENE (a built-in name or a TOML file)."""
    from ...datasets.generation.generate import save_solution
    from ...datasets.generation.quantities import resolved, with_estimate
    from ...sim.machine.simulate import simulate as run
    from ..inspect.simulate_text import simulation_summary, summary_lines

    check_outputs([scene_name], [(output, DATA_SUFFIXES), (plot, PICTURE_SUFFIXES)], force)
    machine, resolution = resolved(scene_of(scene_name, pairs))
    solution = run(machine, seed=seed, truth=True)
    if resolution is not None:
        solution = with_estimate(solution, resolution)
        click.echo(f"fidelity: {resolution.text}", err=True)
    if output is not None:
        save_solution(machine, solution, output, seed=seed, force=force, truth=truth)
    if plot is not None:
        from ..machines.picture import plot_simulation

        plot_simulation(machine, solution, plot, force=force)
    vibration = [
        (channel, float(row.std()))
        for channel, row in zip(solution.channels, solution.signal, strict=True)
        if channel.quantity != "tacho"
    ]
    rms = {channel.name: value for channel, value in vibration}
    shown = ", ".join(f"{channel.name} {value:.3g} {channel.unit}" for channel, value in vibration)
    head = f"{machine.name} (simulated): {shown} rms about the mean"
    files = [str(path) for path in (output, plot) if path]
    summary = simulation_summary(machine, solution)
    for warning in solution.warnings:
        click.echo(f"warning: {warning}", err=True)
    emit(
        {
            "scene": machine.name,
            "rms": rms,
            "summary": summary,
            "numerics": solution.numerics,
            "warnings": list(solution.warnings),
            "files": files,
        },
        as_json,
        "\n".join([head, *files, *summary_lines(machine, summary)]),
    )


@command()
@click.argument("scene_name", metavar="SCENE", type=SCENE)
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
@click.option("--low", type=float, help="Lowest frequency [Hz]; default: --high / 300.")
@click.option(
    "--high", type=float, help="Highest frequency [Hz]; default: 0.45 of the sample rate."
)
@click.option("-o", "--output", type=PATH, help="Table to write (.csv).")
@click.option("--plot", type=PATH, help="Picture to write (.png, .svg or .pdf).")
@force_option
@json_option
def frf(
    scene_name: str,
    pairs: Sequence[str],
    low: float | None,
    high: float | None,
    output: Path | None,
    plot: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Compute the transfer functions of SCENE: of a pump's casing, or of a running shaft line.

    They are what a perfect test would measure; the table can be the `casing.frf` of a scene.
    """
    from ..pictures.scene_transfer import (
        save_csv,
        save_figure,
        transfer_of,
        transfer_table,
        transfer_text,
    )

    check_outputs([scene_name], [(output, (".csv",)), (plot, PICTURE_SUFFIXES)], force)
    machine = scene_of(scene_name, pairs)
    found = transfer_of(machine, low, high)
    if output is not None:
        save_csv(found, output, force=force)
    if plot is not None:
        save_figure(machine, found, plot, force=force)
    files = [str(path) for path in (output, plot) if path]
    emit(
        {**transfer_table(machine, found), "files": files},
        as_json,
        "\n".join([transfer_text(machine, found), *files]),
    )


@command()
@click.argument("scene_name", metavar="SCENE", type=SCENE)
@click.option("--set", "pairs", multiple=True, metavar="PATH=VALUE", help="Replace a scene value.")
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
@click.option("--jack", metavar="BEARING", help="Simulate a jacking test beside this bearing.")
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
            "--margin, --target and --prefer are of the moves: leave out --no-calibrate"
        )
    if rig_test is not None and not calibrate:
        raise click.UsageError("--test compares before and after the moves: it needs --calibrate")
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
    """The scene where its tests put it, and what they say; as it is where there are none."""
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
    """Result, table and text of the simulated test of the moves, if one was asked for."""
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


@command()
@json_option
def verify(as_json: bool) -> None:
    """Compare the physics with literature: expected, obtained, tolerance; exit 1 on a failure."""
    from dataclasses import asdict

    from ..literature.verify import run_checks

    results = run_checks()
    failed = sum(not result.passed for result in results)
    lines = [f"{'check':44} {'expected':>14} {'obtained':>14} {'tolerance':>10}  source"]
    lines += [
        f"{r.name:44} {r.expected:14.8g} {r.obtained:14.8g} {r.tolerance:10.2g}  "
        f"{'' if r.passed else 'FAILED '}[{r.trust}] {r.source}"
        for r in results
    ]
    lines.append(f"{len(results) - failed} passed, {failed} failed")
    checks = [{**asdict(r), "passed": r.passed} for r in results]
    emit({"checks": checks, "failed": failed}, as_json, "\n".join(lines))
    raise click.exceptions.Exit(EXIT_FAILED if failed else 0)
