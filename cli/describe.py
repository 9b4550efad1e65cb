"""``echoset describe``: parameters with unit, meaning and default, as YAML to be passed back.

Only scenarios state their defaults: what estimators and metrics are not told, they take from the
sensor model of the recording, so that here defaults are comments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import click

from ..campaign.outputs import say
from ..models.errors import ParameterError
from ..models.parameters import REQUIRED, groups, rule, suggestion
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
    from ..models import registry

    groups = [group for group in GROUPS if name in registry.names(group)]
    if not groups:
        known = [known for group in GROUPS for known in registry.names(group)]
        raise ParameterError(f"nothing is called {name!r}{suggestion(name, known)}")
    for group in groups:
        say("\n".join(describe(group, name)))


def describe(group: str, name: str) -> Iterator[str]:
    """The lines of the YAML for the entry point ``name`` of ``group``."""
    from ..models import registry
    from ..models.plain_yaml import dump

    module = registry.load(group, name)
    yield f"# {name}: {module.SUMMARY}"
    if group == "echoset.estimators":
        from ..estimators.presets import presets

        for preset, values in presets(name).items():
            if preset in module.PRESETS and hasattr(module.PRESETS, "comment"):
                yield f"# {module.PRESETS.comment(preset)}"
            yield f"# --preset {preset}: {dump(values)}"
    if group == "echoset.scenarios":
        from ..campaign.scenarios import find

        values = {key: value for _, layer in find(name).layers for key, value in layer.items()}
        yield f"scenario: {name}"
        yield "parameters:"
        yield from _parameters(module.Params, values, "  ")
    elif group == "echoset.metrics":
        yield f"{name}:"
        yield from _parameters(module.Params, {}, "  #")
    else:
        yield from _parameters(module.Params, {}, "#")


def _parameters(params: Any, values: Mapping[str, Any], start: str) -> Iterator[str]:
    from ..models.plain_yaml import dump

    indent = start.removesuffix("#")
    for group, fields in groups(params):
        title, streams = group.__dict__.get("TITLE"), group.__dict__.get("STREAMS")
        if title:
            yield f"{indent}# --- {title}" + (f" ({' '.join(streams)})" if streams else "")
        for f in fields:
            default = f.default_factory() if callable(f.default_factory) else f.default
            value = values.get(f.name, default)
            unit, within = f.metadata["unit"], rule(f.metadata.get("within", ""))
            said = f" [{unit}]" if unit not in ("", "1") else ""
            yield f"{indent}# {f.metadata['doc']}{said}" + (f", {within}" if within else "")
            if value is REQUIRED:
                yield f"{start}{f.name}: from the recording"
            else:
                yield f"{start}{f.name}: {dump(value)}"
