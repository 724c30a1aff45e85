"""Figures as files and in pages: the same bytes every time, words from data as they stand."""

import base64
import io
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...sim.atomic import write_whole
from ...sim.output.recording import DataError
from .page import visible

FORMATS = (".png", ".svg", ".pdf")
"""Suffixes of a picture."""

DOTS_PER_INCH = 110
"""Of a picture in points."""

PAGE_WIDTH = 4.9
"""Of a picture that a phone shows whole, text of 8 points and more [inch]."""

PAGE_HEIGHT = 3.6
"""And its height, where nothing asks for another [inch]."""

PHONE_PX = 358
"""Of the 390 pixels of a phone, less the margins of a page."""

LEAST_TEXT_PX = 8
"""Height of the smallest text that can be read."""

_ENLARGED = 1.2  # a picture in a wide page, over its own size
_EXPONENT = 0.7  # height of a raised letter, over the others


@dataclass(frozen=True, kw_only=True)
class PageImage:
    """A picture in a page, with the widths at which it can be read.

    Attributes
    ----------
    address : str
        PNG as a data address.
    svg : str
        Instead of it, where points tell their names under the pointer.
    least : int
        Narrower, its smallest text is below :data:`LEAST_TEXT_PX` [CSS px].
    most : int
        Wider, it is only coarse [CSS px].
    """

    address: str = ""
    svg: str = ""
    least: int
    most: int

    @property
    def sideways(self) -> bool:
        """Whether a phone cannot show it whole."""
        return self.least > PHONE_PX


def picture_bytes(figure: Any, suffix: str) -> bytes:
    """A figure as a file, the same bytes every time.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Its words are taken literally from here on: a dollar sign begins no formula.
    suffix : str
        One of :data:`FORMATS`.

    Returns
    -------
    bytes
    """
    import matplotlib as mpl

    undated: dict[str, Any] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    _take_literally(figure)
    picture = io.BytesIO()
    # the names of an SVG's parts are random without a salt
    with mpl.rc_context({"svg.hashsalt": "wearstate"}), _laid_out(figure, suffix[1:]):
        figure.savefig(picture, format=suffix[1:], dpi=DOTS_PER_INCH, metadata=undated.get(suffix))
    return picture.getvalue()


def lay_out(figure: Any) -> None:
    """Place the axes of a figure, as drawing it would; without drawing.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        With a layout.
    """
    figure.get_layout_engine().execute(figure)


@contextmanager
def _laid_out(figure: Any, form: str) -> Iterator[None]:
    """Lay a figure out as saving would, which draws the whole of it once more for that."""
    from matplotlib.backend_bases import get_registered_canvas_class

    engine, canvas, dots = figure.get_layout_engine(), figure.canvas, figure.dpi
    if engine is None or not figure.axes:
        yield
        return
    try:
        get_registered_canvas_class(form)(figure)  # whose letters are measured
        figure.dpi = DOTS_PER_INCH
        lay_out(figure)
        figure.dpi = dots
        figure.set_layout_engine("none")
        yield
    finally:
        figure.dpi = dots
        figure.set_layout_engine(engine)
        figure.set_canvas(canvas)


def save_picture(figure: Any, path: Path, *, force: bool = True) -> None:
    """Write a figure whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : Path
        ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        Another suffix.
    """
    if path.suffix not in FORMATS:
        raise DataError(f"{path}: suffix must be one of {', '.join(FORMATS)}; rename it")
    write_whole(path, picture_bytes(figure, path.suffix), force=force)


def page_image(figure: Any, *, colours: int | None = None) -> PageImage:
    """A figure for a page.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    colours : int, optional
        With few, a third of the size.

    Returns
    -------
    PageImage
    """
    picture = picture_bytes(figure, ".png")
    if colours is not None:
        picture = _of_few_colours(picture, colours)
    return PageImage(
        address="data:image/png;base64," + base64.b64encode(picture).decode(),
        least=least_width(figure),
        most=round(_ENLARGED * DOTS_PER_INCH * figure.get_figwidth()),
    )


def drawn_alone(draw: Callable[[Any], None], *, height: float = PAGE_HEIGHT) -> PageImage:
    """One pair of axes as a picture of a page.

    Parameters
    ----------
    draw : callable
        ``draw(axes)``
    height : float
        [inch]

    Returns
    -------
    PageImage
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, height), layout="constrained")
    draw(figure.add_subplot())
    return page_image(figure)


def least_width(figure: Any) -> int:
    """Width below which the smallest text of a figure that was drawn cannot be read [CSS px]."""
    from matplotlib.text import Text

    sizes = [_height(text) for text in figure.findobj(Text) if text.get_visible()]
    smallest = min((size for size in sizes if size), default=math.inf)
    width: float = figure.get_figwidth()
    return math.ceil(LEAST_TEXT_PX * 72 * width / smallest)


def _height(text: Any) -> float:
    """Of the smallest letter [pt]; 0 without letters."""
    words = text.get_text()
    if not words.strip():
        return 0.0
    raised = text.get_parse_math() and words.count("$") > 1 and "^" in words
    return float(text.get_fontsize() * (_EXPONENT if raised else 1.0))


def plain_numbers(axis: Any) -> None:
    """On a logarithmic axis 0.01 rather than a power of ten, whose exponent nobody can read."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    if axis.get_scale() != "log":
        return
    low, high = axis.get_view_interval()
    if high < _FEW * low:
        axis.set_major_locator(MaxNLocator(4))  # the other would take up to nine, which touch
    else:
        narrow = high < _NARROW * low
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


_FEW = 5.0  # of an axis, last over first: up to here 1, 2, 5 may be a single number
_NARROW = 200.0  # of an axis, last over first: so few decades need numbers between


def _of_few_colours(picture: bytes, colours: int) -> bytes:
    from PIL import Image  # comes with matplotlib

    small = io.BytesIO()
    whole = Image.open(io.BytesIO(picture)).convert("RGB")
    whole.quantize(colours, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
    return small.getvalue()


def _take_literally(figure: Any) -> None:
    """No word of a figure is read as a formula; only matplotlib's own numbers on axes may be one.

    What the font lacks or nobody can see becomes a replacement sign.
    """
    for text in _words(figure):
        text.set_parse_math(False)
        text.set_text(_drawable(text.get_text(), text))


def _words(artist: Any) -> Iterator[Any]:
    """Texts of an artist; of an axis with numbers not those, each of which would be made for it."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text

    if isinstance(artist, Text):
        yield artist
    if isinstance(artist, Axis) and not _is_named(artist):
        yield from (artist.label, artist.offsetText)
        return
    if isinstance(artist, Axis):
        _name_literally(artist)
    for part in artist.get_children():
        yield from _words(part)


def _is_named(axis: Any) -> bool:
    """Whether the ticks of an axis bear words."""
    from matplotlib.ticker import FixedFormatter, FuncFormatter

    return isinstance(axis.get_major_formatter(), FixedFormatter | FuncFormatter)


def _name_literally(axis: Any) -> None:
    """Words beside ticks are asked for anew with every drawing: cure them where they come from."""
    from matplotlib.ticker import FuncFormatter

    words, label = axis.get_major_formatter(), axis.label
    axis.set_major_formatter(FuncFormatter(lambda x, place: _drawable(words(x, place), label)))


def _drawable(words: str, text: Any) -> str:
    """Words with a replacement sign for each character that the text's font does not have."""
    from matplotlib.font_manager import findfont, get_font

    shown = visible(words).replace("\t", " ")
    if shown.isascii():
        return shown
    font = get_font(findfont(text.get_fontproperties()))
    return "".join(
        letter if letter == "\n" or font.get_char_index(ord(letter)) else "\ufffd"
        for letter in shown
    )
