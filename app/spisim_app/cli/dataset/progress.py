"""Progress of a data set: a bar on terminals, lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from ..console import messages, say

if TYPE_CHECKING:
    from spisim.dataset.runner import State

Update = Callable[["State"], None]

#: Time between lines.
EVERY_S = 30.0


@contextmanager
def progress_display(wanted: bool | None) -> Iterator[Update]:
    """Display a bar on terminals, else lines; or a bar or nothing if requested."""
    kinds = {None: bar if messages.is_terminal else lines, True: bar, False: silence}
    with kinds[wanted]() as update:
        yield update


@contextmanager
def bar() -> Iterator[Update]:
    """A bar with rate, failures and remaining time."""
    columns = (
        TextColumn("Samples"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}", markup=False),
    )
    with Progress(*columns, console=messages, transient=True, disable=False) as progress:
        task = progress.add_task("", total=None, rate="")
        yield lambda state: progress.update(
            task, total=state.samples, completed=state.samples - state.missing, rate=rate(state)
        )


@contextmanager
def lines() -> Iterator[Update]:
    """A line from time to time."""
    last = time.monotonic()

    def update(state: State) -> None:
        nonlocal last
        if time.monotonic() - last >= EVERY_S:
            last = time.monotonic()
            tried = state.samples - state.missing
            say(f"{tried} of {state.samples} samples{rate(state)}")

    yield update


@contextmanager
def silence() -> Iterator[Update]:
    """No output."""
    yield lambda state: None


def rate(state: State) -> str:
    """Return rate of this run, failures and remaining time."""
    failed = f", {state.failed} failed" if state.failed else ""
    if not state.made:
        return failed
    per_s = state.made / state.seconds
    return f", {60 * per_s:.0f} per minute{failed}, {short_time(state.missing / per_s)} left"


def short_time(seconds: float) -> str:
    """Format a duration, as 40 s, 12 min, 3.5 h, 2.1 days."""
    for limit, unit, name in ((120, 1, "s"), (7200, 60, "min"), (172_800, 3600, "h")):
        if seconds < limit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 86_400:.3g} days"
