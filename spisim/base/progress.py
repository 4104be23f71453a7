"""Progress bars on a terminal or below the cell of a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from html import escape
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from rich.console import Console

Advance: TypeAlias = Callable[[float], None]


def progress_bar(title: str) -> AbstractContextManager[Advance]:
    """Show a progress bar, driven by the function returned; none in files and pipes.

    with spisim.progress_bar("Tracing light") as advance:
        spisim.simulate(scene, instrument, progress=advance)

    Parameters
    ----------
    title : str
        Text in front of the bar.

    Returns
    -------
    context manager of a callable
        Takes the finished fraction of the work, 0 to 1.
    """
    if _in_notebook():
        return nullcontext(_below_the_cell(title))
    from rich.console import Console

    console = Console(stderr=True)
    return terminal_bar(title, console, visible=console.is_terminal)


@contextmanager
def terminal_bar(title: str, console: Console, *, visible: bool) -> Iterator[Advance]:
    """A progress bar on a console."""
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=not visible
    ) as progress:
        task = progress.add_task(title, total=1.0)
        yield lambda fraction: progress.update(task, completed=fraction)


def _in_notebook() -> bool:
    """Whether a Jupyter kernel runs this code."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


def _below_the_cell(title: str) -> Advance:
    """A progress bar in HTML, which needs no widgets; saved in its final state."""
    from IPython.display import HTML, display

    def drawn(fraction: float) -> HTML:
        text = f"{escape(title)} {fraction:.0%}"
        return HTML(f'<progress value="{fraction:.3f}"></progress> {text}')

    handle = display(drawn(0.0), display_id=True)
    return lambda fraction: handle.update(drawn(fraction))
