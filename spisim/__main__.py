"""The program `spisim`, also run as ``python -m spisim``."""

import signal


def main() -> None:
    """Run a command; Ctrl-C ends it without a word while it is loaded, when nothing is begun."""
    interruptible = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if interruptible:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from spisim.cli import main as run

    if interruptible:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


if __name__ == "__main__":
    main()
