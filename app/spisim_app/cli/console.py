"""Output of the commands: results on stdout, progress and messages on stderr."""

import math
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from typing import Any

from rich.console import Console
from rich.text import Text

from reconstruction.base.text import flush_output, json_line, printable, shortened
from spisim.base.progress import Advance, terminal_bar


class _Terminal(Console):
    """Prints text verbatim, without markup or control sequences in names of files and scenes."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return text to print, including that of tables."""
        return super().render_str(printable(text), **options)


messages = _Terminal(stderr=True)
results = _Terminal()


def print_json(report: Mapping[str, Any]) -> None:
    """Print one JSON object; values that are not finite become null."""
    print(json_line(_plain(report)))


def say(text: str, style: str | None = None) -> None:
    """Print a message without line breaks, which are left to the terminal."""
    messages.print(shortened(text), style=style, soft_wrap=True)


def fail(message: str, status: int, as_json: bool) -> None:
    """Print an error in one line on stderr, and with --json also as an object on stdout."""
    line = shortened(" ".join(message.split("\n")))
    say(f"error: {line}", style="red")
    with suppress(OSError):
        if as_json:
            print_json({"error": line, "status": status})
    with suppress(OSError):
        flush_output()


def warn(warnings: Iterable[str]) -> None:
    """Print warnings about the results."""
    for warning in warnings:
        say(f"warning: {warning}", "yellow")


def progress_bar(title: str, visible: bool | None) -> AbstractContextManager[Advance]:
    """Show a bar that the returned function moves; None shows it on terminals only."""
    visible = messages.is_terminal if visible is None else visible
    return terminal_bar(title, messages, visible=visible)


def _plain(value: Any) -> Any:
    """Replace values unknown to JSON: NaN, tuples and paths."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    return str(value)
