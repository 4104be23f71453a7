"""Run as ``python -m reconstruction``."""

import signal
import sys

from .cli import main

status = main()
signal.signal(signal.SIGINT, signal.SIG_IGN)  # the status says how it ended
sys.exit(status)
