"""The command line. Commands call library functions and hold no physics.

Results go to stdout, progress and messages to stderr. With ``--json`` the result is one JSON object
on stdout; an error is one on stderr, its last line, with ``error.message``, ``error.faults`` and
``exit_code``, and stdout stays empty. Exit codes: 0 done, 1 failed, 2 bad input (also if no
recording can be judged); with ``report --fail-on``: 3 warning, 4 alarm, 5 unfamiliar. Heavy imports
stay inside the commands, so that ``--help`` answers at once.
"""

import io
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click
from click.shell_completion import get_completion_class

from ... import __version__
from ..options.help import FIRST_CONTACT, HelpfulGroup, command
from ..options.shared import EXIT_BAD_INPUT, EXIT_FAILED, as_options
from ..pages.plain_json import json_text
from .align import align
from .chart import chart, stability
from .data_sets import audit, export, generate, merge, splits
from .evaluate import blindspots, evaluate
from .features import features
from .measured import import_files, info
from .recipe import recipe
from .report import report
from .scene import frf, scene, simulate, verify
from .sweep import sweep
from .train import calibrate, demo, train

# files are first written under another name, which means nothing to the caller
_UNFINISHED = re.compile(r"\.part\b|\.[0-9a-f]{8}\.tmp\b")


class _Group(HelpfulGroup):
    """Turns the library's own errors into one message and an exit code.

    With ``--json`` the message is one JSON object, the last line of stderr.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As in click; remembers whether an error is to be reported as JSON."""
        ctx.meta[_AS_JSON] = "--json" in args
        return super().parse_args(ctx, args)

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except click.ClickException as error:
            if not context.meta[_AS_JSON]:
                raise
            _end(context, error.format_message(), error.exit_code)
        except UnicodeEncodeError as error:
            word = re.search(r"\S*[\ud800-\udfff]\S*", error.object)
            if word is None:
                raise
            text = _UNFINISHED.sub("", word.group())
            _end(context, f"{text} is not UTF-8 text; rename or rewrite it", EXIT_BAD_INPUT)
        except (ValueError, RuntimeError) as error:
            if not type(error).__module__.startswith(__name__.split(".")[0]):
                raise  # a defect of the program, shown with its traceback
            command = self.get_command(context, context.invoked_subcommand or "")
            code = EXIT_BAD_INPUT if isinstance(error, ValueError) else EXIT_FAILED
            text = as_options(str(error), command)
            # a scene's errors begin with a line that counts them, others have a line each
            faults = [as_options(fault, command) for fault in getattr(error, "faults", ())]
            _end(context, text, code, faults or text.splitlines())
        except KeyboardInterrupt as error:
            if not str(error):
                raise  # click reports the end
            click.echo(f"\n{error}", err=True)  # below the ^C of the terminal
            raise click.exceptions.Exit(EXIT_FAILED) from None
        except BrokenPipeError:
            raise  # the reader of stdout is gone: click ends quietly
        except OSError as error:
            text = _UNFINISHED.sub("", str(error))
            _end(context, f"{text}; check path, rights and space", EXIT_BAD_INPUT)
        except MemoryError:
            _end(context, "out of memory; use fewer jobs or shorter recordings", EXIT_FAILED)


_AS_JSON = f"{__name__}.as_json"


def _end(context: click.Context, text: str, code: int, faults: Sequence[str] = ()) -> NoReturn:
    """Report an error, as text or as JSON, and end with its code."""
    if context.meta[_AS_JSON]:
        error = {"message": text, "faults": list(faults) or [text]}
        click.echo(json_text({"schema_version": 1, "error": error, "exit_code": code}), err=True)
    else:
        click.echo(f"Error: {text}", err=True)
    raise click.exceptions.Exit(code) from None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; ends the process with its exit code.

    Characters that the encoding of stdout or stderr lacks are written with a backslash, since a
    file name need not be text.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None under pythonw
            stream.reconfigure(errors="backslashreplace")
    cli.main(args=None if arguments is None else list(arguments), prog_name="wearstate")


@click.group(
    cls=_Group,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="wearstate")
@click.pass_context
def cli(context: click.Context) -> None:
    """Condition monitoring built around physics.

    Simulate a machine that wears, make labelled data sets, train a wear estimate, and report on a
    recording. Without a command, three ways to begin are shown.
    """
    if context.invoked_subcommand is None:
        click.echo(FIRST_CONTACT, nl=False)


@command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the script that lets SHELL complete commands, options, scenes and recipes.

    For bash and zsh put `eval "$(wearstate completion bash)"` into ~/.bashrc or ~/.zshrc.
    """
    kind = get_completion_class(shell)
    assert kind is not None  # the choices are those that click has
    click.echo(kind(cli, {}, "wearstate", "_WEARSTATE_COMPLETE").source())


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
    calibrate,
    train,
    evaluate,
    report,
    blindspots,
    demo,
    completion,
):
    cli.add_command(_command)
