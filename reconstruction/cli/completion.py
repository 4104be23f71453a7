"""Shell completion, with argcomplete."""

import argparse
import sys

VARIABLE = "_ARGCOMPLETE"
"""Set by a shell's completion."""


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a completing shell, if argcomplete is installed."""
    try:
        import argcomplete
    except ImportError:
        sys.exit(1)
    argcomplete.autocomplete(parser)
