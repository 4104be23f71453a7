"""The command line: reconstruct a capture or a stream, import, export, check a calibration."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from ..errors import InputError, explain
from ..text import printable, write_anything

COMMANDS = {
    "reconstruct": ("reconstruct", "capture -> image, ranges, depth map, point cloud"),
    "import": ("importing", "array of bucket readings -> capture"),
    "export": ("export", "captures -> depth images, point clouds, NeRF's and ROS 2's files"),
    "check": ("check", "captures in fog -> whether the spots' paths are calibrated alike"),
    "live": ("live", "frames as they come -> results as they go"),
    "replay": ("replay", "capture -> its frames as a stream"),
}
"""Module of each, imported when it is called, and what it does."""
INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit status is 0, or 2 for bad input and files that cannot be written.

    An interrupt gives 130.
    """
    write_anything()
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and not arguments[0].startswith("-") and arguments[0] not in COMMANDS:
        arguments.insert(0, "reconstruct")
    options = _parser(arguments[:1]).parse_args(arguments)
    try:
        options.run(options)
    except InputError as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(explain(error))
    except KeyboardInterrupt:
        _fail("interrupted; no file is left half-written")
        return INTERRUPTED
    return 0


def _fail(message: str) -> int:
    print(printable(f"error: {message}"), file=sys.stderr)
    return 2


class _Parser(argparse.ArgumentParser):
    """What it says of wrong arguments steers no terminal."""

    def _print_message(self, message: str, file: Any = None) -> None:
        super()._print_message(printable(message), file)


def _parser(called: Sequence[str]) -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m reconstruction",
        description="From a capture to image, ranges and depth map.",
        epilog="A capture as the first word means reconstruct.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (module, does) in COMMANDS.items():
        verb = commands.add_parser(name, help=does)
        if name in called:
            command = import_module(f".{module}", __name__)
            verb.epilog = f"example: {command.EXAMPLE}"
            command.add_options(verb)
            verb.set_defaults(run=command.run)
    return parser
