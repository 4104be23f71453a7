"""What the commands say: results on stdout, progress and messages on stderr."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

# Brackets and colons in the name of a user's file are no markup.
messages = Console(stderr=True, highlight=False, markup=False, emoji=False)
results = Console(highlight=False, markup=False, emoji=False)


def print_json(report: Mapping[str, Any]) -> None:
    """Print one JSON object; what is not finite becomes null."""
    print(json.dumps(_plain(report), ensure_ascii=False, allow_nan=False))


def say(text: str, style: str | None = None) -> None:
    """Print a message; terminals break long lines, not this program."""
    messages.print(text, style=style, soft_wrap=True)


def warn(warnings: Iterable[str]) -> None:
    """Say what the user should know before believing the results."""
    for warning in warnings:
        say(f"warning: {warning}", "yellow")


@contextmanager
def progress_bar(title: str, shown: bool | None) -> Iterator[Callable[[float], None]]:
    """Show a bar that the yielded function moves to a fraction; None shows it on terminals."""
    visible = messages.is_terminal if shown is None else shown
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()
    with Progress(
        *columns, TimeRemainingColumn(), console=messages, transient=True, disable=not visible
    ) as progress:
        task = progress.add_task(title, total=1.0)
        yield lambda fraction: progress.update(task, completed=fraction)


def _plain(value: Any) -> Any:
    """JSON has no NaN, no tuples and no paths."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    return str(value)
