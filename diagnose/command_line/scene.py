"""Commands about a machine: scenes, simulation, transfer functions; literature checks."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..options.help import HelpfulGroup, command
from ..options.names import SCENE, scene_argument
from ..options.outputs import (
    DATA_SUFFIXES,
    PICTURE_SUFFIXES,
    SCENE_SUFFIXES,
    check_outputs,
)
from ..options.shared import (
    EXIT_BAD_INPUT,
    EXIT_FAILED,
    PATH,
    emit,
    force_option,
    json_option,
    scene_of,
    seed_option,
    set_option,
)
from ..pages.plain_json import json_text


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
        raise SceneError(name, ["machine is missing, must be a text; this file is not a scene"])
    click.echo(text, nl=False)


@scene.command("check")
@click.argument("file", metavar="SCENE", type=SCENE)
@set_option
@click.option(
    "--deep",
    is_flag=True,
    help="Compare each key figure with its usual range; runs a short simulation.",
)
@json_option
def scene_check(file: str, pairs: Sequence[str], deep: bool, as_json: bool) -> None:
    """Check a scene: all faults at once, and warnings of likely mistakes.

    --deep: a table of the machine's key figures (natural frequencies, forces, films, contacts,
    cost), each with its usual range, and a correction if it is outside. Exit 2 for faults, with
    --deep also if a short simulation fails; an unusual figure alone is no fault.
    """
    from ...sim.machine.simulate import check
    from ...sim.scene.plausibility import scene_doubts

    checked = scene_of(file, pairs)
    check(checked)
    if deep:
        _deep_check(checked, as_json)
        return
    warnings = [doubt.text for doubt in scene_doubts(checked)]
    count = f", {len(warnings)} warning(s)" if warnings else ""
    lines = [f"{checked.name}: no fault{count}", *(f"warning: {text}" for text in warnings)]
    emit({"scene": checked.name, "faults": [], "warnings": warnings}, as_json, "\n".join(lines))


def _deep_check(checked: Any, as_json: bool) -> None:
    from ...sim.deep_check.check import deep_check
    from ..inspect.deep_check_text import deep_check_table, deep_check_text

    found = deep_check(checked)
    faults = [found.failure] if found.failure else []
    result = {"scene": checked.name, "faults": faults, "warnings": list(found.warnings)}
    emit({**result, **deep_check_table(found)}, as_json, deep_check_text(checked.name, found))
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
@scene_argument
@set_option
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
@scene_argument
@set_option
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
