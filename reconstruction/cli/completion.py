"""Completion of words in shells, by argcomplete."""

import argparse
import sys

VARIABLE = "_ARGCOMPLETE"
"""What a shell's completion sets."""


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer the shell that asks how a word may go on; without argcomplete there is no answer."""
    try:
        import argcomplete
    except ImportError:
        sys.exit(1)
    argcomplete.autocomplete(parser)
