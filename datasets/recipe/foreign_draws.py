"""Doubts about absolute numbers that a recipe inherits from a recipe of another scene.

A factor follows the scene; a number in kilograms does not. Whether it fits cannot be proved, but it
is unlikely to if the scene's own value lies outside the drawn range.
"""

from collections.abc import Mapping

from ..draws.draws import Range, has_value, value_at
from .recipe import Recipe


def draw_doubts(recipe: Recipe, inherited: Mapping[str, str]) -> list[str]:
    """Draws inherited from a recipe of another scene that are unlikely to fit this one.

    Parameters
    ----------
    recipe : Recipe
    inherited : mapping
        Inherited draws, see :class:`wearstate.datasets.recipe.text.RecipeSource`.

    Returns
    -------
    list of str
        One message for each draw of machine or record whose range excludes the scene's own value,
        and for each confounder: the scene's value for an absent fault says nothing about its size.

    Examples
    --------
    >>> from wearstate.datasets.recipe.load import load_recipe
    >>> draw_doubts(load_recipe("bilge-pump-small"), {})
    []
    """
    here = recipe.table.scene
    cure = "give it again, as a factor, or name it in without"
    doubts = []
    for axis in (*recipe.machine, *recipe.record):
        other = inherited.get(axis.path) or inherited.get(_starred(axis.path))
        if other is None or not isinstance(axis, Range) or axis.kind.relative:
            continue
        low, high = axis.extremes()
        own = value_at(recipe.scene, axis.path) if has_value(recipe.scene, axis.path) else None
        if isinstance(own, int | float) and not low <= own <= high:
            doubts.append(
                f"{axis.path}: {low:.4g} to {high:.4g} (SI) is of the scene {other}, {here} has "
                f"{own:.4g}; {cure}"
            )
    for fault in recipe.faults:
        other = inherited.get(fault.table.name)
        if other is not None and not fault.axes[0].kind.relative:
            low, high = fault.axes[0].extremes()
            doubts.append(
                f"confounder {fault.table.name}: {low:.4g} to {high:.4g} (SI) is of the scene "
                f"{other}, whose parts need not be as large as those of {here}; {cure}"
            )
    return doubts


def _starred(path: str) -> str:
    return ".".join("*" if key.isdigit() else key for key in path.split("."))
