"""Configuration of the documentation: ``make docs`` builds it without a network."""

import functools
import importlib
import inspect
import pkgutil
from typing import Any

import wearstate

project = "wearstate"
author = "The wearstate founders"
copyright = "The wearstate founders"  # noqa: A001 - Sphinx's name
version = release = wearstate.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",
]
templates_path = ["_templates"]
exclude_patterns = ["_build", "examples", "**/GALLERY_HEADER.rst"]
suppress_warnings = ["config.cache"]  # the example order is a function and cannot be pickled

# --- text

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

# --- reference

autosummary_generate = True
autosummary_ignore_module_all = False
autodoc_typehints = "none"  # docstrings have types, with shapes
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_attributes_as_param_list = True

nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(numpy|scipy|pandas|matplotlib|sklearn|numba|click)\..*")]

# --- gallery

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,  # its page would load external scripts
    "min_reported_time": 1,
    "remove_config_comments": True,
}

# --- page

html_theme = "pydata_sphinx_theme"
html_title = "wearstate"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {
    "navbar_align": "left",
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "header_links_before_dropdown": 7,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_show_sourcelink = False
html_sidebars = {"index": [], "start": []}


# --- references to names without a page of their own


@functools.cache
def _modules() -> tuple[str, ...]:
    packages = pkgutil.walk_packages(wearstate.__path__, "wearstate.")
    return tuple(each.name for each in packages if each.name.split(".")[1] in _FLOORS)


_FLOORS = ("sim", "features", "datasets", "diagnose")


@functools.cache
def _public() -> dict[int, str]:
    """Value -> name under which users import it."""
    homes = [wearstate, *(getattr(wearstate, name) for name in wearstate._MODULES)]
    return {
        id(getattr(home, name)): f"{home.__name__}.{name}"
        for home in homes
        for name in home.__all__
        if not name.startswith("__") and not inspect.ismodule(getattr(home, name))
    }


def _found(target: str, module: str | None) -> Any:
    """Object that a docstring names in full, within its module or by its end (``.film.direct``)."""
    name = target.lstrip("~.")
    places = [name, *(f"{home}.{name}" for home in _homes(module))]
    places += [f"{each}.{name.rpartition('.')[2]}" for each in _modules() if _ends(each, name)]
    places += [each for each in _modules() if each.endswith(f".{name}")]
    for place in places:
        parts = place.split(".")
        for end in range(len(parts), 0, -1):
            try:
                value = importlib.import_module(".".join(parts[:end]))
                for part in parts[end:]:
                    value = getattr(value, part)
            except (ImportError, AttributeError):
                continue
            return value
    return None


@functools.cache
def _homes(module: str | None) -> list[str]:
    """A public module and the modules that define its names."""
    if not module:
        return []
    given = importlib.import_module(module)
    values = [getattr(given, name) for name in getattr(given, "__all__", ())]
    return [module, *sorted({getattr(each, "__module__", None) or module for each in values})]


def _ends(module: str, name: str) -> bool:
    return "." in name and module.endswith("." + name.rpartition(".")[0])


def _resolve(app: Any, env: Any, node: Any, contnode: Any) -> Any:
    """Link a name to its public page; a name without a page stays text, a wrong one warns."""
    if node.get("refdomain") != "py":
        return None
    value = _found(node["reftarget"], node.get("py:module"))
    if value is None:
        return None
    public = _public().get(id(value))
    if public is None:
        return contnode
    domain = env.get_domain("py")
    return (
        domain.resolve_xref(env, node["refdoc"], app.builder, "obj", public, node, contnode)
        or contnode
    )


def setup(app: Any) -> None:
    """Resolve names that Sphinx does not know."""
    app.connect("missing-reference", _resolve)
