"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import click
from click.shell_completion import CompletionItem
from click.types import StringParamType

from ..campaign import log
from ..campaign.batch.execution import Execution
from ..campaign.batch.lock import locked
from ..campaign.files.outputs import Existing
from ..campaign.machine import default_memory, parse_bytes

F = TypeVar("F", bound=Callable[..., Any])
PATH = click.Path(readable=False, allow_dash=True)
"""A file, which is looked at when it is opened: then errors name it and have their exit code."""
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


def _execution(
    jobs: int,
    cluster: str | None,
    keep_going: bool,
    summary: str | None,
    lock: str | None,
    memory: str | None,
) -> Execution:
    """The options of a batch; the lock is held until the command is over."""
    if lock is not None:
        click.get_current_context().with_resource(locked(lock))
    size = default_memory() if memory is None else parse_bytes(memory)
    return Execution(jobs, cluster, keep_going, summary, lock, size)


def output(text: str, default: str | None = None) -> Callable[[F], F]:
    """``-o``; required unless it has a default."""
    given: dict[str, Any] = {"default": default, "show_default": True}
    return click.option(
        "-o", "--output", type=PATH, help=text, **({"required": True} if default is None else given)
    )


data_format: Callable[[F], F] = click.option(
    "--format",
    "form",
    type=Name("echoset.formats"),
    help="Format of the output, h5 or mcap.  [default: by suffix; h5 in a folder, mcap on stdout]",
)

overwrite: Callable[[F], F] = click.option(
    "--overwrite", is_flag=True, help="Replace an output that exists."
)


def _gathered(name: str, make: Callable[..., Any], *options: str) -> Callable[[F], F]:
    """The values of ``options``, given to the command as one argument ``name``."""

    def decorate(function: F) -> F:
        @wraps(function)
        def command(**values: Any) -> Any:
            given = {option: values.pop(option) for option in options}
            return function(**values, **{name: make(**given)})

        return cast(F, command)

    return decorate


existing: Callable[[F], F] = _chain(
    click.option("--overwrite", is_flag=True, help="Replace outputs that exist."),
    click.option(
        "--skip-existing",
        is_flag=True,
        help="Leave outputs that are complete and made from the same input, parameters, seed and "
        "versions; make the rest, and make again what is not so.",
    ),
    click.option("--dry-run", is_flag=True, help="Only say what would be run, redone or skipped."),
    _gathered("existing", Existing, "overwrite", "skip_existing", "dry_run"),
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
        "--cluster",
        metavar="ADDRESS",
        help="Have the work done by a Dask cluster: tcp://HOST:PORT, or its scheduler file.",
    ),
    click.option(
        "--keep-going", is_flag=True, help="Go on with the other inputs when one has failed."
    ),
    click.option(
        "--summary",
        type=PATH,
        metavar="FILE",
        help="Write what was done and what failed why, as JSON.",
    ),
    click.option(
        "--lock",
        type=PATH,
        metavar="FILE",
        help="End with exit code 75 if another command holds the lock FILE.",
    ),
    click.option(
        "--memory",
        metavar="SIZE",
        help="Take no more memory than this, such as 4G, in all processes together.  [default: "
        "four fifths of the machine's]",
    ),
    _gathered(
        "execution", _execution, "jobs", "cluster", "keep_going", "summary", "lock", "memory"
    ),
)

deps: Callable[[F], F] = click.option(
    "--deps",
    type=PATH,
    metavar="FILE",
    help="Write Makefile rules that say which inputs each output was made from.",
)


def inputs(name: str, metavar: str) -> Callable[[F], F]:
    """The files to work on; ``@FILE`` stands for those that FILE lists, ``@-`` for stdin's."""
    return click.argument(
        name, nargs=-1, required=True, metavar=metavar, type=PATH, callback=_listed
    )


def _listed(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> tuple[str, ...]:
    from ..campaign.files.inputs import listed

    return tuple(path for word in value for path in listed(word))


settings: Callable[[F], F] = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Set a parameter; any number of times. The value is YAML: 3, 1e-3, [1, 2], text.",
)
config: Callable[[F], F] = click.option(
    "--config",
    type=PATH,
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
