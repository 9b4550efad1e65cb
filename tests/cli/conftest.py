"""Ways to run commands, for the tests of this folder."""

from support.commands import (
    campaign,
    command,
    empty,
    environment,
    files,
    plugins,
    rec,
    run,
    start,
)

__all__ = [
    "campaign",
    "command",
    "empty",
    "environment",
    "files",
    "plugins",
    "rec",
    "run",
    "start",
]
