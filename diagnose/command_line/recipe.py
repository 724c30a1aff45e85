"""Commands about recipes: list, show, check, explain, preview."""

from pathlib import Path

import click

from ..options.help import HelpfulGroup
from ..options.names import RECIPE
from ..options.outputs import PICTURE_SUFFIXES, check_outputs
from ..options.shared import (
    PATH,
    emit,
    force_option,
    jobs_option,
    json_option,
    records_option,
    seed_option,
)


@click.group(cls=HelpfulGroup)
def recipe() -> None:
    """List, show, check, explain and preview recipes, from which data sets are drawn."""


@recipe.command("list")
@json_option
def recipe_list(as_json: bool) -> None:
    """List the built-in recipes with their descriptions."""
    from ...datasets.recipe.text import read_recipe, recipe_names

    found = {name: read_recipe(name).table.get("description", "") for name in recipe_names()}
    width = max(map(len, found))
    emit({"recipes": found}, as_json, "\n".join(f"{n:{width}}  {d}" for n, d in found.items()))


@recipe.command("show")
@click.argument("name", metavar="RECIPE", type=RECIPE)
@click.option("--whole", is_flag=True, help="Include what the recipe takes from those it extends.")
def recipe_show(name: str, whole: bool) -> None:
    """Print the TOML text of a recipe, to copy, change and check."""
    from ...datasets.recipe.text import read_recipe, recipe_text

    click.echo(read_recipe(name).text if whole else recipe_text(name), nl=False)


@recipe.command("check")
@click.argument("file", metavar="RECIPE", type=RECIPE)
@json_option
def recipe_check(file: str, as_json: bool) -> None:
    """Check a recipe against its scene: all faults at once, and warnings of likely mistakes."""
    from ...datasets.recipe.foreign_draws import draw_doubts
    from ...datasets.recipe.load import load_recipe
    from ...datasets.recipe.records import STRATA, sample_records
    from ...datasets.recipe.severities import limit_faults
    from ...datasets.recipe.text import RecipeError, read_recipe
    from ...sim.machine.simulate import check
    from ...sim.scene.plausibility import scene_doubts

    checked = load_recipe(file)
    for view in checked.table.views:
        check(load_recipe(file, view=view).scene)
    if faults := limit_faults(checked):
        raise RecipeError(checked.name, faults)
    doubts: dict[str, str] = {}  # each with the first record that has it
    for sample in sample_records(checked, STRATA):
        check(sample.scene)
        for doubt in scene_doubts(sample.scene):
            doubts.setdefault(doubt.check, f"record {sample.index}: {doubt.text}")
    warnings = draw_doubts(checked, read_recipe(file).inherited) + list(doubts.values())
    count = f", {len(warnings)} warning(s)" if warnings else ""
    lines = [f"{checked.name}: no fault{count}", *(f"warning: {text}" for text in warnings)]
    table = {"recipe": checked.name, "faults": [], "warnings": warnings}
    emit(table, as_json, "\n".join(lines))


@recipe.command("explain")
@click.argument("key", metavar="[KEY]", required=False, default="")
@json_option
def recipe_explain(key: str, as_json: bool) -> None:
    """Explain the keys of a recipe: meaning, unit, range, default; KEY as severity.low."""
    from ..inspect.keys import found_recipe_keys
    from ..inspect.keys_text import explained, keys_table

    found = found_recipe_keys(key)
    emit(keys_table([found]), as_json, explained(found))


@recipe.command("preview")
@click.argument("name", metavar="RECIPE", type=RECIPE)
@records_option
@click.option("--plot", type=PATH, help="Picture of the draws to write (.png, .svg or .pdf).")
@seed_option
@jobs_option
@force_option
@json_option
def recipe_preview(
    name: str,
    records: int | None,
    plot: Path | None,
    seed: int,
    jobs: int,
    force: bool,
    as_json: bool,
) -> None:
    """Show what RECIPE (a built-in name or a TOML file) would make: draws, labels, time, size."""
    from ...datasets.recipe.load import load_recipe
    from ..inspect.recipe_preview import preview, preview_figure, preview_text

    check_outputs([name], [(plot, PICTURE_SUFFIXES)], force)
    found = preview(load_recipe(name), records, seed=seed, cores=jobs)
    if plot is not None:
        from ..pages.picture import save_picture

        save_picture(preview_figure(found), plot, force=force)
    files = [str(plot)] if plot else []
    words = "\n".join([preview_text(found.table), *files])
    emit({**found.table, "files": files}, as_json, words)
