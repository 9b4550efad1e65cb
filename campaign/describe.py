"""Parameters with unit, meaning and default, as YAML to be passed back.

Only scenarios state their defaults: what estimators and metrics are not told, they take from the
sensor model of the recording, so that here defaults are comments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..estimators.presets import presets
from ..models import registry
from ..models.parameters import REQUIRED, groups, rule
from ..models.plain_yaml import dump
from .scenarios import find


def describe(group: str, name: str) -> Iterator[str]:
    """The lines of the YAML for the entry point ``name`` of ``group``."""
    module = registry.load(group, name)
    yield f"# {name}: {module.SUMMARY}"
    if group == "echoset.estimators":
        for preset, values in presets(name).items():
            if preset in module.PRESETS and hasattr(module.PRESETS, "comment"):
                yield f"# {module.PRESETS.comment(preset)}"
            yield f"# --preset {preset}: {dump(values)}"
    if group == "echoset.scenarios":
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
