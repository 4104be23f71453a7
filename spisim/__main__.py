"""The program `spisim`, also run as ``python -m spisim``: the commands of `spisim_app`."""

import signal
import sys

from reconstruction.base.errors import InputError
from spisim.base.optional import import_app


def main() -> None:
    """Run a command; Ctrl-C ends it without a word while it is loaded, when nothing is begun."""
    interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if interruptible:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        program = import_app("cli")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    if interruptible:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    program.main()


if __name__ == "__main__":
    main()
