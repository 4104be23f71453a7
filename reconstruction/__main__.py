"""Run as ``python -m reconstruction``."""

import sys

from .cli import main

sys.exit(main())
