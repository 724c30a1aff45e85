"""HTML pages: rendered from the templates, with text from data made visible and escaped."""

import unicodedata
from pathlib import Path
from typing import Any

from ...sim.atomic import write_whole

_TEMPLATES = Path(__file__).parent / "templates"
_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}  # control, format, lone surrogate, separators
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


def visible(text: str) -> str:
    r"""A text in which every character is visible: control and bidirectional ones are replaced.

    Tabs and line feeds stay.

    Examples
    --------
    >>> visible("pump\x07 \u202e3") == "pump\ufffd \ufffd3"
    True
    """
    if text.isprintable():
        return text
    return "".join(
        _REPLACEMENT if unicodedata.category(letter) in _UNSEEN and letter not in "\t\n" else letter
        for letter in text
    )


def short_name(name: str, most: int = 40) -> str:
    r"""A name on one line, shortened in the middle if it is long, for a legend or an axis.

    Examples
    --------
    >>> short_name("accelerometer on the\nfoundation", 21)
    'accelerome…foundation'
    >>> short_name("_x")  # a legend leaves out what begins with an underscore
    ' _x'
    """
    line = " ".join(name.split())
    if len(line) > most:
        line = f"{line[: most // 2]}…{line[len(line) - (most - 1 - most // 2) :]}"
    return f" {line}" if line.startswith("_") else line


def render(template: str, **context: Any) -> str:
    """A rendered template.

    Parameters
    ----------
    template : str
        File name in the template folder.
    **context
        Its variables; text is escaped and made :func:`visible`.

    Returns
    -------
    str
        HTML page, or a part of one.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    return environment.get_template(template).render(**context).lstrip()


def _shown(value: Any) -> Any:
    """Texts made visible; HTML and numbers unchanged."""
    return visible(value) if type(value) is str else value


def save_page(html: str, path: Path, *, force: bool = True) -> None:
    """Write a page completely or not at all; without `force`, never over an existing file."""
    # a file's name may hold bytes that are not UTF-8
    write_whole(path, html.encode(errors="backslashreplace"), force=force)
