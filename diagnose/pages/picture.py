"""Figures as files and in pages: reproducible bytes, text from data taken literally."""

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
"""Resolution of a bitmap picture."""

PAGE_WIDTH = 4.9
"""Width of a picture that fits on a phone with text of 8 points or more [inch]."""

PAGE_HEIGHT = 3.6
"""Default height of such a picture [inch]."""

PHONE_PX = 358
"""Usable width: the 390 pixels of a phone less the margins of a page."""

LEAST_TEXT_PX = 8
"""Height of the smallest text that can be read."""

_ENLARGED = 1.2  # factor on the size of a picture in a wide page
_EXPONENT = 0.7  # height of a superscript, relative to other letters


@dataclass(frozen=True, kw_only=True)
class PageImage:
    """A picture in a page, with the range of widths at which it is readable.

    Attributes
    ----------
    address : str
        PNG as a data address.
    svg : str
        Used instead of the PNG if points show their names under the pointer.
    least : int
        Width below which its smallest text is less than :data:`LEAST_TEXT_PX` high [CSS px].
    most : int
        Width above which it is unnecessarily coarse [CSS px].
    """

    address: str = ""
    svg: str = ""
    least: int
    most: int

    @property
    def sideways(self) -> bool:
        """Whether it is too wide for a phone."""
        return self.least > PHONE_PX


def picture_bytes(figure: Any, suffix: str) -> bytes:
    """A figure as a file with reproducible bytes.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Its text is taken literally from now on: a dollar sign starts no formula.
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
    """Place the axes of a figure as drawing would, without drawing.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Figure with a layout engine.
    """
    figure.get_layout_engine().execute(figure)


@contextmanager
def _laid_out(figure: Any, form: str) -> Iterator[None]:
    """Apply the layout of a figure once; saving would draw everything again for it."""
    from matplotlib.backend_bases import get_registered_canvas_class

    engine, canvas, dots = figure.get_layout_engine(), figure.canvas, figure.dpi
    if engine is None or not figure.axes:
        yield
        return
    try:
        get_registered_canvas_class(form)(figure)  # used to measure text
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
    """Write a figure completely or not at all.

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
        If the suffix is another.
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
        Number of colours; a small number reduces the size to a third.

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
    """One pair of axes as a picture for a page.

    Parameters
    ----------
    draw : callable
        ``draw(axes)`` draws into the axes.
    height : float
        Height [inch].

    Returns
    -------
    PageImage
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, height), layout="constrained")
    draw(figure.add_subplot())
    return page_image(figure)


def least_width(figure: Any) -> int:
    """Width below which the smallest text of a drawn figure cannot be read [CSS px]."""
    from matplotlib.text import Text

    sizes = [_height(text) for text in figure.findobj(Text) if text.get_visible()]
    smallest = min((size for size in sizes if size), default=math.inf)
    width: float = figure.get_figwidth()
    return math.ceil(LEAST_TEXT_PX * 72 * width / smallest)


def _height(text: Any) -> float:
    """Height of the smallest letter [pt]; 0 without letters."""
    words = text.get_text()
    if not words.strip():
        return 0.0
    raised = text.get_parse_math() and words.count("$") > 1 and "^" in words
    return float(text.get_fontsize() * (_EXPONENT if raised else 1.0))


def plain_numbers(axis: Any) -> None:
    """Label a logarithmic axis with 0.01 instead of powers of ten, whose exponents are tiny."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    if axis.get_scale() != "log":
        return
    low, high = axis.get_view_interval()
    if high < _FEW * low:
        axis.set_major_locator(MaxNLocator(4))  # the default allows up to nine, which touch
    else:
        narrow = high < _NARROW * low
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


_FEW = 5.0  # ratio of the ends of an axis up to which only one of 1, 2, 5 may be labelled
_NARROW = 200.0  # ratio of the ends of an axis below which numbers between decades are needed


def _of_few_colours(picture: bytes, colours: int) -> bytes:
    from PIL import Image  # installed with matplotlib

    small = io.BytesIO()
    whole = Image.open(io.BytesIO(picture)).convert("RGB")
    whole.quantize(colours, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
    return small.getvalue()


def _take_literally(figure: Any) -> None:
    """Prevent text of a figure from being parsed as formulas, except matplotlib's own axis numbers.

    Characters that are missing in the font or invisible become a replacement character.
    """
    for text in _words(figure):
        text.set_parse_math(False)
        text.set_text(_drawable(text.get_text(), text))


def _words(artist: Any) -> Iterator[Any]:
    """Texts of an artist, without the tick numbers of an axis, which would first be created."""
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
    """Whether the tick labels of an axis are words."""
    from matplotlib.ticker import FixedFormatter, FuncFormatter

    return isinstance(axis.get_major_formatter(), FixedFormatter | FuncFormatter)


def _name_literally(axis: Any) -> None:
    """Replace tick words at their source, since every drawing requests them again."""
    from matplotlib.ticker import FuncFormatter

    words, label = axis.get_major_formatter(), axis.label
    axis.set_major_formatter(FuncFormatter(lambda x, place: _drawable(words(x, place), label)))


def _drawable(words: str, text: Any) -> str:
    """Text with a replacement character for every character that its font lacks."""
    from matplotlib.font_manager import findfont, get_font

    shown = visible(words).replace("\t", " ")
    if shown.isascii():
        return shown
    font = get_font(findfont(text.get_fontproperties()))
    return "".join(
        letter if letter == "\n" or font.get_char_index(ord(letter)) else "\ufffd"
        for letter in shown
    )
