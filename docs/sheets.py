"""Shared by the scripts of figures: colours, sheets of axes, writing of figures."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

COLOURS = ("#1f5a94", "#b3541e", "#4f7d3a", "#7a4fa0", "#8a8a8a", "#c2a000")


def sheet(title: str, rows: int, columns: int = 1, size: tuple[float, float] = (9, 6), **kw: Any):
    figure = Figure(figsize=size, layout="constrained")
    figure.suptitle(title, fontsize=11)
    return figure, figure.subplots(rows, columns, squeeze=False, **kw)


def label(axes: Any, x: str, y: str, title: str = "", legend: str = "best") -> None:
    axes.set(xlabel=x, ylabel=y)
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc=legend)


def write(figures: Mapping[str, Callable[[], Figure]], folder: Path, *, dpi: int = 90) -> None:
    """Draw every figure into a folder, and print its path."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in figures.items():
        draw().savefig(folder / f"{name}.png", dpi=dpi)
        print(folder / f"{name}.png", flush=True)


def output_folder() -> Path:
    """Folder named on the command line, by default that of the site's pictures."""
    return Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "img"
