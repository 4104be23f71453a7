"""The command line: reconstruct a capture, import a recording."""

import argparse
import sys
from collections.abc import Sequence

from ..errors import InputError, explain
from . import importing, reconstruct

COMMANDS = {"reconstruct": reconstruct, "import": importing}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit status is 0, or 2 for bad input and files that cannot be written."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and not arguments[0].startswith("-") and arguments[0] not in COMMANDS:
        arguments.insert(0, "reconstruct")
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except InputError as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(explain(error))
    return 0


def _fail(message: str) -> int:
    print(f"error: {message}", file=sys.stderr)
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reconstruction",
        description="From a capture to image, ranges and depth map.",
        epilog="A capture as the first word means reconstruct.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, command in COMMANDS.items():
        verb = commands.add_parser(name, help=command.HELP, epilog=f"example: {command.EXAMPLE}")
        command.add_options(verb)
        verb.set_defaults(run=command.run)
    return parser
