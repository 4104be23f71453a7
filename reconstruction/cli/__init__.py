"""Command line: reconstruct a capture, import, export, check; and other packages' commands."""

import argparse
import os
import re
import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Any, NoReturn

from .. import __version__
from ..base.errors import InputError, explain
from ..base.text import flush_output, json_line, printable, shortened, write_anything
from . import completion
from .interrupts import uninterrupted

COMMANDS = {
    "reconstruct": ("reconstruct", "capture -> image, ranges, depth map, point cloud"),
    "import": ("importing", "array of bucket readings -> capture"),
    "export": ("export", "captures -> depth images, point clouds, NeRF and ROS 2 files"),
    "calibrate": ("calibrate", "capture -> capture with the throughput of its patterns"),
    "check": ("check", "captures in fog -> path calibration of the spots"),
}
"""Module, imported on demand, and summary of each command."""
NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$", re.IGNORECASE)
"""Negative numbers as arguments."""
INTERRUPTED, UNREAD = 130, 1
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Thread limits of linear algebra libraries, besides OMP_NUM_THREADS."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns the exit status: 0, or 2 for bad input and files that cannot be written, 130 after an
    interrupt, 1 if nobody reads the output. Raises SystemExit for wrong arguments.
    """
    write_anything()
    _calculate_on_one_thread()
    arguments = list(sys.argv[1:] if argv is None else argv)
    called = [word for word in arguments[:1] if not word.startswith("-")]
    if called and not is_command(called[0]):
        called = ["reconstruct"]
        arguments = [*called, *arguments]
    completing = completion.VARIABLE in os.environ
    try:
        listed = completing or arguments[:1] in (["-h"], ["--help"])
        parser = _parser(COMMANDS if completing else called, _others().listed() if listed else {})
        if completing:
            completion.complete(parser)
        try:
            options = parser.parse_args(arguments)
        except InputError as error:
            sys.exit(_fail(str(error), "--json" in arguments))
        options.run(options)
        flush_output()
    except InputError as error:
        return _fail(str(error), "--json" in arguments)
    except BrokenPipeError:
        return _unread()
    except OSError as error:
        return _fail(explain(error), "--json" in arguments)
    except KeyboardInterrupt:
        with uninterrupted():
            text = "interrupted; no file is left half-written"
            return _fail(text, "--json" in arguments, INTERRUPTED)
    return 0


def _fail(message: str, as_json: bool, status: int = 2) -> int:
    """Print an error as one line on stderr, and with --json as an object on stdout too."""
    line = printable(shortened(" ".join(message.split("\n"))))
    print(f"error: {line}", file=sys.stderr)
    with suppress(OSError):
        if as_json:
            print(json_line({"error": line, "status": status}))
    with suppress(OSError):
        flush_output()
    return status


def _unread() -> int:
    """Stop quietly: the reader of the output, such as `head`, has seen enough."""
    with suppress(OSError):
        flush_output()
    return UNREAD


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line, without terminal control characters."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = NEGATIVE  # before 3.14, -1e-9 parses as an option

    def error(self, message: str) -> NoReturn:
        """Raise InputError, which `main` reports."""
        raise InputError(f"{message} (see {self.prog} --help)")

    def _print_message(self, message: str, file: Any = None) -> None:
        super()._print_message(printable(message), file)


def _calculate_on_one_thread() -> None:
    """Use one thread: matrices of a frame are small, and more threads wait for each other.

    Set OMP_NUM_THREADS or a library's variable to override; importing NumPy before does, too.
    """
    if "numpy" not in sys.modules and "OMP_NUM_THREADS" not in os.environ:
        for name in THREADS:
            os.environ.setdefault(name, "1")


def is_command(name: str) -> bool:
    """Return whether a command has this name, be it another package's."""
    return name in COMMANDS or name in _others().OTHERS


def _others() -> ModuleType:
    """Commands of other packages; looking for them takes a while, so not before they are needed."""
    return import_module(".others", __name__)


def _parser(
    called: Collection[str], others: Mapping[str, Any] | None = None
) -> argparse.ArgumentParser:
    """Parser of commands: of those called with their options, of all of ``others`` too."""
    parser = _Parser(
        prog="python -m reconstruction",
        description="From a capture to image, ranges and depth map.",
        epilog="A capture as the first argument means reconstruct.",
    )
    parser.add_argument("--version", action="version", version=f"spisim-reconstruct {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (module, summary) in COMMANDS.items():
        verb = commands.add_parser(name, help=summary)
        if name in called:
            _complete(verb, import_module(f".{module}", __name__))
    others = others or {word: _others().OTHERS[word] for word in called if word not in COMMANDS}
    for name, command in others.items():
        _complete(commands.add_parser(name, help=command.SUMMARY), command)
    return parser


def _complete(parser: argparse.ArgumentParser, command: Any) -> None:
    """Add what a command's module says."""
    parser.epilog = f"example: {command.EXAMPLE}"
    command.add_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.set_defaults(run=command.run)
