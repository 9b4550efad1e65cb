"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem
from click.types import StringParamType

from . import log

F = TypeVar("F", bound=Callable[..., Any])
_VERBOSITY, _FORM = "echoset.verbosity", "echoset.form"


class Name(StringParamType):
    """A name from an entry-point group, for completion; it is checked when it is looked up."""

    name = "name"

    def __init__(self, *groups: str) -> None:
        self.groups = groups

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from ..models import registry

        found = (name for group in self.groups for name in registry.names(group))
        return [CompletionItem(name) for name in found if name.startswith(incomplete)]


def _configure(ctx: click.Context, param: click.Parameter, value: Any) -> None:
    if isinstance(value, str):
        ctx.meta[_FORM] = value
    elif value:
        sign = -1 if param.name == "quiet" else 1
        ctx.meta[_VERBOSITY] = ctx.meta.get(_VERBOSITY, 0) + sign * value
    log.configure(ctx.meta.get(_VERBOSITY, 0), ctx.meta.get(_FORM, "text"))


def _chain(*decorators: Callable[[F], F]) -> Callable[[F], F]:
    def decorate(function: F) -> F:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return decorate


_said: dict[str, Any] = {"callback": _configure, "expose_value": False, "is_eager": True}
logging_options: Callable[[F], F] = _chain(
    click.option("-q", "--quiet", count=True, help="Say nothing but errors.", **_said),
    click.option(
        "-v", "--verbose", count=True, help="Say more; twice, with tracebacks of errors.", **_said
    ),
    click.option(
        "--log-format",
        type=click.Choice(log.FORMATS),
        default=None,
        help="Form of the lines on stderr: text, or one JSON object a line.  [default: text]",
        **_said,
    ),
)


def output(text: str, default: str | None = None) -> Callable[[F], F]:
    """``-o``; required unless it has a default."""
    return click.option(
        "-o",
        "--output",
        required=default is None,
        default=default,
        show_default=default is not None,
        type=click.Path(allow_dash=True),
        help=text,
    )


data_format: Callable[[F], F] = click.option(
    "--format",
    "form",
    type=Name("echoset.formats"),
    help="Format of the output, h5 or mcap.  [default: by suffix; h5 in a folder, mcap on stdout]",
)

existing: Callable[[F], F] = _chain(
    click.option("--overwrite", is_flag=True, help="Replace outputs that exist."),
    click.option("--skip-existing", is_flag=True, help="Leave outputs that exist, make the rest."),
)
overwrite: Callable[[F], F] = click.option(
    "--overwrite", is_flag=True, help="Replace an output that exists."
)

batch: Callable[[F], F] = _chain(
    click.option(
        "-j",
        "--jobs",
        type=click.IntRange(min=1),
        default=1,
        show_default=True,
        help="Number of processes; the results do not depend on it.",
    ),
    click.option(
        "--keep-going", is_flag=True, help="Go on with the other inputs when one has failed."
    ),
)

settings: Callable[[F], F] = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Set a parameter; any number of times. The value is YAML: 3, 1e-3, [1, 2], text.",
)
config: Callable[[F], F] = click.option(
    "--config",
    type=click.Path(),
    metavar="FILE",
    help="YAML file of parameters, as 'echoset describe' prints it.",
)
seed: Callable[[F], F] = click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Seed of all randomness. Equal seeds and inputs give equal bytes.",
)
