"""``echoset describe``: parameters with unit, meaning and default, as YAML to be passed back."""

from __future__ import annotations

import click

from ..campaign.files.outputs import say
from ..models.errors import ParameterError
from ..models.parameters import suggestion
from . import options

GROUPS = ("echoset.scenarios", "echoset.estimators", "echoset.metrics", "echoset.importers")


@click.command("describe")
@click.argument("name", type=options.Name(*GROUPS))
@options.logging_options
def command(name: str) -> None:
    """Print the parameters of NAME as YAML.

    NAME is a scenario, estimator, metric or importer. Edited, it can be passed back: a scenario
    to 'simulate', the others by --config to 'estimate', 'score' and 'convert'. Of these, take the
    '#' away before what you set: the rest is as the recording says, or the default.
    """
    from ..campaign.describe import describe
    from ..models import registry

    groups = [group for group in GROUPS if name in registry.names(group)]
    if not groups:
        known = [known for group in GROUPS for known in registry.names(group)]
        raise ParameterError(f"nothing is called {name!r}{suggestion(name, known)}")
    for group in groups:
        say("\n".join(describe(group, name)))
