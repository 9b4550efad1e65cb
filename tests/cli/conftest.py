"""Ways to run commands, for the tests of this folder."""

from support.commands import *  # noqa: F403
