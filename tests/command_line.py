"""The command line in the tests' own process."""

from click.testing import CliRunner
from wearstate.diagnose.command_line.cli import cli


def run(*arguments, code=0):
    """Run a command, of which this exit code is expected; an error that is no refusal is raised."""
    result = CliRunner().invoke(cli, [str(each) for each in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    return result
