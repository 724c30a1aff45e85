"""Figures as files and in pages: the same bytes every time, words from data as they stand."""

import base64
import io
from pathlib import Path
from typing import Any

from ...sim.atomic import write_whole
from ...sim.output.recording import DataError
from .page import visible

FORMATS = (".png", ".svg", ".pdf")
"""Suffixes of a picture."""

DOTS_PER_INCH = 110
"""Of a picture in points."""


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
    with mpl.rc_context({"svg.hashsalt": "wearstate"}):
        figure.savefig(picture, format=suffix[1:], dpi=DOTS_PER_INCH, metadata=undated.get(suffix))
    return picture.getvalue()


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


def encoded(figure: Any, *, colours: int | None = None) -> str:
    """PNG of a figure as a data address; with few colours, a third of the size."""
    picture = picture_bytes(figure, ".png")
    if colours is not None:
        picture = _of_few_colours(picture, colours)
    return "data:image/png;base64," + base64.b64encode(picture).decode()


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
    from matplotlib.axis import Axis
    from matplotlib.text import Text

    numbers: set[int] = set()
    for axis in figure.findobj(Axis):
        if _is_named(axis):
            _name_literally(axis)
        else:
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            numbers |= {id(label) for tick in ticks for label in (tick.label1, tick.label2)}
    for text in figure.findobj(Text):
        if id(text) not in numbers:
            text.set_parse_math(False)
            text.set_text(_drawable(text.get_text(), text))


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
