"""Run as ``python -m spisim``."""

from spisim.cli import main

main()
