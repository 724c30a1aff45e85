"""Run the command line as ``python -m wearstate``."""

import sys

if not sys.flags.safe_path:
    del sys.path[0]  # the current folder, put first by -m: its files must not be imported

from .diagnose.command_line.cli import main

main()
