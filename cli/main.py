"""The command ``echoset``: finds the command asked for and runs it to an exit code."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module

import click

from .. import __version__
from ..campaign import exits, log, machine
from ..models.parameters import suggestion
from .options import logging_options

COMMANDS = (
    "simulate",
    "estimate",
    "score",
    "report",
    "plot",
    "info",
    "validate",
    "convert",
    "cut",
    "join",
    "calibrate",
    "train-classifier",
    "train-templates",
    "list",
    "describe",
    "completion",
)
COMPLETE_VARIABLE = "_ECHOSET_COMPLETE"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Set to 1 unless the user did: speed comes from processes, and results depend on no machine."""


class Commands(click.Group):
    """The commands, each in the module of its name, imported when asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command: click.Command = import_module(f".{name.replace('-', '_')}", __package__).command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail(f"no command {args[0]!r}{suggestion(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)


@click.group(cls=Commands)
@click.version_option(__version__, prog_name="echoset", message="%(prog)s %(version)s")
@logging_options
def commands() -> None:
    """Process recordings of radar and ultra-wideband data in batches.

    simulate writes recordings, estimate runs an estimator over them, score measures the result,
    report writes tables, plot draws. Data go to files or, as "-", through pipes; all else goes to
    stderr.
    """


def main(args: Sequence[str] | None = None) -> int:
    """Run ``args`` (by default those of the process) and return the exit code."""
    exits.open_standard_streams()
    log.configure()
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    words = list(sys.argv[1:] if args is None else args)
    return run(lambda: _run(words))


def _run(args: list[str]) -> None:
    instruction = os.environ.get(COMPLETE_VARIABLE)
    if instruction:
        from click.shell_completion import shell_complete

        shell_complete(commands, {}, "echoset", COMPLETE_VARIABLE, instruction)
        return
    color = False if os.environ.get("NO_COLOR") else None
    with commands.make_context("echoset", args, color=color) as context:
        commands.invoke(context)


def run(function: Callable[[], object]) -> int:
    """Call ``function``, tell its error in one line, and return the exit code."""
    try:
        with exits.signals():
            try:
                with machine.limited_memory(machine.default_memory()):
                    function()
                sys.stdout.flush()
            except Exception:
                exits.check_signals()
                raise
            exits.check_signals()
    except exits.Terminated as error:
        return int(str(error.code))
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.ClickException as error:
        log.error(error.format_message())
        return 2
    except BrokenPipeError:
        exits.drop_stdout()
        return 128 + signal.SIGPIPE
    except exits.Ended as error:
        return error.exit_code
    except Exception as error:
        known = exits.stdout_error(error) or machine.explained(error) or error
        log.error(exits.message(known), error)
        return exits.exit_code(known)
    return 0
