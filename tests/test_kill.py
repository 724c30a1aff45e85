"""A sample of the kill trials: the command that is repeated ends with the same bytes."""

import json
import subprocess
import sys
from pathlib import Path


def test_a_sample_of_deaths_loses_nothing(tmp_path):
    script = Path(__file__).with_name("kill_trials.py")
    # in a process of its own: the trials fork, which a process with threads should not
    command = [sys.executable, "-P", script, "--sample", "--trials", "3", "--folder", tmp_path]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert run.returncode == 0, run.stderr
    figures = json.loads(run.stdout)
    # a run may end before its moment has come; then it counts as none
    assert figures["kills"] + figures["too late"] == 3
    assert (figures["lost"], figures["wrong"]) == (0, 0)
    # the writer has some thousand lines to go; every twelfth of them is tried
    assert figures["before a line"] > 50
