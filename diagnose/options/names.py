"""Scenes, recipes, data sets and models as arguments, with hints if one is mistaken for another.

Heavy imports stay inside the functions, so that ``--help`` and completion answer at once.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from .outputs import DATA_SUFFIXES, MODEL_SUFFIXES
from .shared import PathType

_ROOT = Path(__file__).parents[2]
_BUILT_IN = {"scene": _ROOT / "sim/scene/built_in", "recipe": _ROOT / "datasets/recipe/built_in"}


def built_in(what: str) -> list[str]:
    """Names of the built-in scenes or recipes, sorted; read from their folder only.

    Examples
    --------
    >>> "bilge-pump" in built_in("scene"), "bilge-pump-small" in built_in("recipe")
    (True, True)
    """
    return sorted(path.stem for path in _BUILT_IN[what].glob("*.toml"))


class _Name(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.3 on
    """A built-in name or a file, with completion of the names."""

    def __init__(self, what: str) -> None:
        self.name = what

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Built-in names with this beginning, and files."""
        del ctx, param
        names = [name for name in built_in(self.name) if name.startswith(incomplete)]
        return [*map(CompletionItem, names), CompletionItem(incomplete, type="file")]


class SceneName(_Name):
    """A scene; a recipe is refused with the scene that it varies."""

    def __init__(self) -> None:
        super().__init__("scene")

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As in :class:`click.ParamType`."""
        if value in built_in("scene") or value not in built_in("recipe") or Path(value).is_file():
            return value
        from ...datasets.recipe.text import read_recipe

        scene = read_recipe(value).table["scene"]
        return self.fail(
            f"{value} is a recipe, must be a scene; it varies the scene {scene}: name that, or "
            f"simulate records of the recipe: wearstate generate {value} -o data.h5",
            param,
            ctx,
        )


class RecipeName(_Name):
    """A recipe; a scene is refused with the recipes that vary it."""

    def __init__(self) -> None:
        super().__init__("recipe")

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As in :class:`click.ParamType`."""
        if value in built_in("recipe") or value not in built_in("scene") or Path(value).is_file():
            return value
        from ...datasets.recipe.text import read_recipe

        found = [name for name in built_in("recipe") if read_recipe(name).table["scene"] == value]
        cure = (
            f"these vary it: {', '.join(found)}"
            if found
            else "no built-in recipe varies it; write one with it as scene"
        )
        return self.fail(
            f"{value} is a scene, must be a recipe; {cure}; or one record of it: wearstate "
            f"simulate {value}",
            param,
            ctx,
        )


SCENE, RECIPE = SceneName(), RecipeName()

scene_argument = click.argument("scene_name", metavar="SCENE", type=SCENE)


class _Kind(PathType):
    """A path to files of one kind; other kinds, and built-in names, are refused by name."""

    def __init__(self, what: str, suffixes: tuple[str, ...], others: Mapping[str, str]) -> None:
        super().__init__(path_type=Path)
        self._what, self._suffixes, self._others = what, suffixes, others

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """As in :class:`click.ParamType`."""
        path = super().convert(value, param, ctx)
        other = self._others.get(path.suffix)
        if other is not None:
            self.fail(f"{path} is {other}, must be {self._what}{_order(param, ctx)}", param, ctx)
        for what, cure in _MAKES.items() if ".h5" in self._suffixes and not path.exists() else ():
            if str(path) in built_in(what):
                made = f"wearstate {cure} {path} -o {path}.h5"
                self.fail(f"{path} is a {what}, must be {self._what}; make one: {made}", param, ctx)
        return path


_MAKES = {"scene": "simulate", "recipe": "generate"}
"""Command that makes a file of a built-in scene or recipe."""


def _order(param: Any, ctx: Any) -> str:
    """Order of the arguments of a command, if two may have been swapped."""
    arguments = [p for p in ctx.command.params if isinstance(p, click.Argument)] if ctx else []
    if isinstance(param, click.Option):
        return f"; {param.opts[0]} takes one, train it: wearstate train DATA -o model.wsm"
    if len(arguments) < 2:
        return ""
    usage = " ".join(ctx.command.collect_usage_pieces(ctx)[1:])  # the first is [OPTIONS]
    return f"; check the order: {ctx.command_path} {usage}"


_A_TEXT = {".toml": "a scene or recipe"}
MODEL = _Kind(
    "a model (.wsm)", MODEL_SUFFIXES, dict.fromkeys(DATA_SUFFIXES, "a data set or recording")
)
DATA = _Kind(
    "a data set or recording",
    DATA_SUFFIXES,
    {**_A_TEXT, **dict.fromkeys(MODEL_SUFFIXES, "a model")},
)
FILE = _Kind("a data set, recording or model", DATA_SUFFIXES, _A_TEXT)
