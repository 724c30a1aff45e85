"""The command line. Commands call library functions and hold no physics.

Results go to stdout, progress and talk to stderr. Exit codes: 0 done, 1 failed, 2 bad input (also
where no recording can be judged); with ``report --fail-on``: 3 warning, 4 alarm, 5 unfamiliar.
Heavy imports stay inside the commands, so that ``--help`` answers at once.
"""

import io
import re
import sys
from collections.abc import Sequence
from typing import Any

import click

from ... import __version__
from .command_options import EXIT_BAD_INPUT, EXIT_FAILED, as_options
from .command_sweep import sweep
from .commands_data import (
    audit,
    export,
    features,
    generate,
    import_files,
    info,
    merge,
    recipe,
    splits,
)
from .commands_machine import align, chart, frf, scene, simulate, stability, verify
from .commands_wear import blindspots, demo, evaluate, report, train

# files are written under another name first, which says nothing to the caller
_UNFINISHED = re.compile(r"\.part\b|\.[0-9a-f]{8}\.tmp\b")


class _Group(click.Group):
    """Turns the library's own errors into one message and an exit code."""

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except UnicodeEncodeError as error:
            word = re.search(r"\S*[\ud800-\udfff]\S*", error.object)
            if word is None:
                raise
            text = _UNFINISHED.sub("", word.group())
            click.echo(f"Error: {text} is no UTF-8 text; rename or rewrite it", err=True)
            raise click.exceptions.Exit(EXIT_BAD_INPUT) from None
        except (ValueError, RuntimeError) as error:
            if not type(error).__module__.startswith(__name__.split(".")[0]):
                raise  # not ours: a defect, with its traceback
            command = self.get_command(context, context.invoked_subcommand or "")
            click.echo(f"Error: {as_options(str(error), command)}", err=True)
            bad_input = isinstance(error, ValueError)
            raise click.exceptions.Exit(EXIT_BAD_INPUT if bad_input else EXIT_FAILED) from None
        except KeyboardInterrupt as error:
            if not str(error):
                raise  # click says that it ends
            click.echo(f"\n{error}", err=True)  # below the ^C of the terminal
            raise click.exceptions.Exit(EXIT_FAILED) from None
        except BrokenPipeError:
            raise  # the reader of stdout has gone: click ends quietly
        except OSError as error:
            text = _UNFINISHED.sub("", str(error))
            click.echo(f"Error: {text}; check path, rights and space", err=True)
            raise click.exceptions.Exit(EXIT_BAD_INPUT) from None
        except MemoryError:
            click.echo("Error: out of memory; use fewer jobs or shorter recordings", err=True)
            raise click.exceptions.Exit(EXIT_FAILED) from None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; ends the process with its exit code.

    What the encoding of stdout or stderr cannot say is written with a backslash: a file name need
    not be text.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None under pythonw
            stream.reconfigure(errors="backslashreplace")
    cli.main(args=None if arguments is None else list(arguments), prog_name="wearstate")


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="wearstate")
def cli() -> None:
    """Condition monitoring built around physics.

    Simulate a machine that wears, make labelled data sets, train a wear estimate, and report on
    a recording.
    """


for _command in (
    scene,
    simulate,
    frf,
    align,
    stability,
    chart,
    sweep,
    verify,
    recipe,
    generate,
    import_files,
    merge,
    info,
    export,
    splits,
    audit,
    features,
    train,
    evaluate,
    report,
    blindspots,
    demo,
):
    cli.add_command(_command)
