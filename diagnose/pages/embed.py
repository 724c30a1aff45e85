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


def plain_figure(title: str, x_name: str, y_name: str, *, tools: Any, **ways: Any) -> Any:
    """A figure with plain labels, as wide as the page, with its tools above.

    Parameters
    ----------
    title, x_name, y_name : str
        Shown to the letter.
    tools : tuple of bokeh.models.Tool
        The first is the one to drag with, the second the one to scroll with; panning and reset
        follow them, and then the others.
    **ways
        As for :func:`bokeh.plotting.figure`.
    """
    from bokeh.models import PanTool, PlainText, ResetTool
    from bokeh.models.annotations.labels import Title
    from bokeh.plotting import figure

    zoom, wheel, *others = tools
    plot = figure(
        # plain: a name between dollar signs is not a formula, which would need the network
        title=Title(text=PlainText(text=title)),
        x_axis_label=PlainText(text=x_name),
        y_axis_label=PlainText(text=y_name),
        sizing_mode="stretch_width",
        toolbar_location="above",
        min_border_right=18,  # half of the last number
        toolbar_sticky=False,  # in a separate row: next to a long title a phone would show no tools
        tools=[zoom, wheel, PanTool(), ResetTool(), *others],
        active_drag=zoom,
        active_scroll=wheel,
        **ways,
    )
    plot.toolbar.logo = None
    return plot


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
