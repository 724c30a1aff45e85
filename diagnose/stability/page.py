"""Maps of :mod:`.method_map` as one page: conclusions for the scene first, then the maps."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...sim.scene.scene import Scene
from ..pages.page import render, save_page
from .edges import conclusion
from .figure import map_images, save_figure
from .method_map import StabilityMap
from .text import reasons, shares_text

_PAGES = (".html", ".htm")


def save_atlas(
    scene: Scene, maps: Sequence[StabilityMap], path: Path, *, force: bool = True
) -> None:
    """Write maps as a page or a picture, depending on the suffix.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap
    path : Path
        ``.html``, ``.htm``, ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The suffix is none of these.
    """
    if path.suffix in _PAGES:
        save_page(atlas_html(scene, maps), path, force=force)
    else:
        save_figure(scene, maps, path, force=force)


def atlas_html(scene: Scene, maps: Sequence[StabilityMap]) -> str:
    """Maps as one self-contained page: no script, no link, pictures inside.

    Parameters
    ----------
    scene : Scene
    maps : sequence of StabilityMap

    Returns
    -------
    str
        HTML.
    """
    return render("stability.html.j2", name=scene.name, maps=[_shown(m) for m in maps])


def _shown(found: StabilityMap) -> dict[str, Any]:
    plan = found.plan
    return {
        "name": plan.name,
        "title": plan.title,
        "note": plan.note,
        "axes": f"{plan.x.label} against {plan.y.label}",
        "conclusion": conclusion(found),
        "secondary": plan.secondary,
        "whole": found.whole,
        "images": map_images(found),
        "rows": [
            {
                "method": method,
                "own": plan.own is not None and plan.own.method == method,
                "shares": shares_text(found, method),
                "reasons": [f"{count} x {word}" for word, count in reasons(found, method)],
            }
            for method in found.methods
        ],
    }
