"""``echoset list``: what there is to choose from."""

from __future__ import annotations

import click

from ..campaign.files.outputs import say
from . import options

KINDS = ("estimators", "scenarios", "metrics", "formats", "importers", "policies", "plots")


@click.command("list")
@click.argument("kind", required=False, type=click.Choice(KINDS))
@options.logging_options
def command(kind: str | None) -> None:
    """List names, of one KIND or of all."""
    from ..models import registry

    for group in (kind,) if kind else KINDS:
        if not kind:
            say(f"{group}:")
        names = registry.names(f"echoset.{group}")
        width = max(map(len, names), default=0)
        for name in names:
            say(f"{'' if kind else '  '}{name:<{width}}  {_summary(f'echoset.{group}', name)}")


def _summary(group: str, name: str) -> str:
    """The line of a plugin on itself, or why it cannot be loaded."""
    from ..models import registry

    try:
        return str(registry.load(group, name).SUMMARY)
    except (ImportError, AttributeError) as error:
        return f"(cannot be loaded: {error})"
