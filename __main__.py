"""Run the command line as ``python -m wearstate``."""

from .diagnose.cli import main

main()
