"""What the commands say: results on stdout, progress and messages on stderr."""

import math
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from typing import Any

from rich.console import Console
from rich.text import Text

from reconstruction.base.text import flush_output, json_line, printable, shortened
from spisim.base.progress import Advance, terminal_bar


class _Terminal(Console):
    """Shows all words as they are: names of files and scenes are no markup and steer nothing."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Words to be shown, those of tables included."""
        return super().render_str(printable(text), **options)


messages = _Terminal(stderr=True)
results = _Terminal()


def print_json(report: Mapping[str, Any]) -> None:
    """Print one JSON object; what is not finite becomes null."""
    print(json_line(_plain(report)))


def say(text: str, style: str | None = None) -> None:
    """Print a message; terminals break long lines, not this program."""
    messages.print(shortened(text), style=style, soft_wrap=True)


def fail(message: str, status: int, as_json: bool) -> None:
    """Tell an error in one line on stderr, and with --json as an object on stdout too."""
    line = shortened(" ".join(message.split("\n")))
    say(f"error: {line}", style="red")
    with suppress(OSError):
        if as_json:
            print_json({"error": line, "status": status})
    with suppress(OSError):
        flush_output()


def warn(warnings: Iterable[str]) -> None:
    """Say what the user should know before believing the results."""
    for warning in warnings:
        say(f"warning: {warning}", "yellow")


def progress_bar(title: str, displayed: bool | None) -> AbstractContextManager[Advance]:
    """Show a bar that the function in hand moves to a fraction; None shows it on terminals."""
    return terminal_bar(
        title, messages, displayed=messages.is_terminal if displayed is None else displayed
    )


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
