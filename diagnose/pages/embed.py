"""Bokeh in a page that works offline: its script and figures are embedded in the HTML.

Bokeh is optional; its script comes from the installed package.
"""

import json
from importlib.util import find_spec
from typing import Any

from ...sim.output.recording import DataError

MOST_BYTES = 2_500_000
"""Largest size of a page with zoomable figures."""

SPARE_BYTES = 100_000
"""Part reserved for the text of such a page."""


def require_bokeh() -> None:
    """Refuse if the plotting library is missing.

    Raises
    ------
    DataError
        If Bokeh is not installed; the message contains the cure.
    """
    if find_spec("bokeh") is None:
        raise DataError(
            "an interactive page needs Bokeh, which is not installed; "
            'pip install "wearstate[interactive]"'
        )


def bokeh_script() -> str:
    """The script of the library as HTML."""
    from bokeh.resources import Resources

    return str(Resources(mode="inline", components=["bokeh"]).render_js())


def item_text(figure: Any) -> str:
    """A figure as JSON that can be placed in a script element of a page.

    Parameters
    ----------
    figure : bokeh.models.LayoutDOM

    Returns
    -------
    str
    """
    from bokeh.embed import json_item

    return json.dumps(json_item(figure)).replace("&", "\\u0026").replace("<", "\\u003c")
