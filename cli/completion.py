"""``echoset completion``: what a shell needs to complete commands, options and names."""

from __future__ import annotations

import click

from ..campaign.files.outputs import say
from . import options

SHELLS = ("bash", "zsh", "fish")


@click.command("completion")
@click.argument("shell", type=click.Choice(SHELLS))
@options.logging_options
def command(shell: str) -> None:
    """Print the completion script for SHELL.

    \b
    bash: eval "$(echoset completion bash)"
    zsh:  eval "$(echoset completion zsh)"
    fish: echoset completion fish | source
    """
    from click.shell_completion import get_completion_class

    from .main import COMPLETE_VARIABLE, commands

    kind = get_completion_class(shell)
    assert kind is not None
    say(kind(commands, {}, "echoset", COMPLETE_VARIABLE).source())
