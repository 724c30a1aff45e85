"""Progress of commands on stderr, for interactive use."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[int, int], None] | None]:
    """Progress bar on stderr in a terminal; otherwise None."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    rate = TextColumn("{task.fields[rate]}")
    with Progress(*columns, rate, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None, rate="")

        def update(done: int, total: int) -> None:
            speed = bar.tasks[task].speed  # of the last half minute
            text = f"{float(f'{speed:.3g}'):g}/s" if speed else ""
            bar.update(task, completed=done, total=total, rate=text)

        yield update


@contextmanager
def time_bar() -> Iterator[Callable[[str, float, float], None] | None]:
    """Bar on stderr in a terminal: current step, and the seconds left; otherwise None.

    Yields a function of the current step, the seconds elapsed, and the seconds left.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    left = TextColumn("about {task.fields[left]:.0f} s left")
    columns = (BarColumn(), left, TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0, left=0.0)

        def update(what: str, gone: float, remaining: float) -> None:
            bar.update(
                task,
                description=what,
                completed=gone,
                total=max(gone + remaining, 1e-3),
                left=remaining,
            )

        yield update
