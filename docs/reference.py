"""The reference pages, made from what the commands and plugins say of themselves."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from echoset.campaign.scenarios import find
from echoset.cli.describe import GROUPS
from echoset.cli.list import KINDS
from echoset.cli.main import commands
from echoset.estimators.presets import presets
from echoset.models import registry
from echoset.models.columns import COLUMNS
from echoset.models.parameters import REQUIRED, rule
from echoset.models.plain_yaml import dump


def write(folder: Path) -> None:
    """Write all pages into ``folder``, those that have changed."""
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def pages() -> dict[str, str]:
    """The pages in Markdown by name."""
    made = {"commands": _command_page(), "columns": _column_page()}
    made |= {kind: _plugin_page(kind) for kind in KINDS}
    return {name: "\n".join(lines) + "\n" for name, lines in made.items()}


def walk(
    command: click.Command = commands, parent: click.Context | None = None, name: str = "echoset"
) -> Iterator[tuple[click.Command, click.Context]]:
    """A command and all below it, each with its context."""
    context = click.Context(command, info_name=name, parent=parent, terminal_width=92)
    yield command, context
    if isinstance(command, click.Group):
        for below in command.list_commands(context):
            found = command.get_command(context, below)
            assert found is not None
            yield from walk(found, context, below)


def _command_page() -> Iterator[str]:
    yield "# Commands\n"
    yield "What `echoset COMMAND --help` prints.\n"
    for _, context in walk():
        yield f"## {context.command_path}\n"
        yield f"```text\n{context.get_help()}\n```\n"
    yield "## Exit codes\n"
    yield "```{include} ../../README.md"
    yield ':start-after: "## Exit codes"\n:end-before: "## Licence"\n```'


def _plugin_page(kind: str) -> Iterator[str]:
    group = f"echoset.{kind}"
    yield f"# {kind.capitalize()}\n"
    yield f"Entry points of the group `{group}`."
    if group in GROUPS:
        yield "`echoset describe NAME` prints the parameters as YAML, to be edited and passed back."
    for name in registry.names(group):
        plugin = registry.load(group, name)
        yield f"\n## {name}\n"
        yield f"{plugin.SUMMARY}\n"
        yield from _facts(plugin)
        if group in GROUPS:
            yield from _parameters(kind, name, plugin)


def _parameters(kind: str, name: str, plugin: Any) -> Iterator[str]:
    """A table of parameters, and the presets."""
    layers = find(name).layers if kind == "scenarios" else ()
    own = {key: value for _, layer in layers for key, value in layer.items()}
    yield "| parameter | default | unit | legal | meaning |"
    yield "|---|---|---|---|---|"
    for field in dataclasses.fields(plugin.Params):
        usual = field.default_factory() if callable(field.default_factory) else field.default
        value = own.get(field.name, usual)
        default = "from the recording" if value is REQUIRED else f"`{dump(value)}`"
        unit = field.metadata["unit"] if field.metadata["unit"] != "1" else ""
        legal = rule(field.metadata.get("within", ""))
        yield f"| `{field.name}` | {default} | {unit} | {legal} | {field.metadata['doc']} |"
    for preset, values in presets(name).items() if kind == "estimators" else ():
        if values:
            yield f"\n`--preset {preset}`:\n"
            yield f"```yaml\n{chr(10).join(f'{k}: {dump(v)}' for k, v in values.items())}\n```"


def _facts(plugin: Any) -> Iterator[str]:
    """What a plugin declares beside its parameters."""
    for title, attribute in (
        ("Stream kinds", "STREAMS"),
        ("Parts", "PARTS"),
        ("Needs", "NEEDS"),
        ("Also uses", "USES"),
        ("Suffixes", "SUFFIXES"),
    ):
        if values := tuple(filter(None, getattr(plugin, attribute, ()))):
            yield f"{title}: {', '.join(f'`{value}`' for value in values)}.\n"


def _column_page() -> Iterator[str]:
    yield "# Columns\n"
    yield "What the scans and rows of a stream may hold; see [](../formats.md). The columns named"
    yield "*evaluation* are for scoring, no estimator sees them.\n"
    yield "| column | level | type | units | long_name | least value | remarks |"
    yield "|---|---|---|---|---|---|---|"
    for name, column in COLUMNS.items():
        remarks = []
        if column.axes:
            remarks.append(f"{column.axes} further axes")
        if column.flags:
            remarks.append("codes " + ", ".join(f"{i} {f}" for i, f in enumerate(column.flags)))
        if column.missing:
            remarks.append("NaN where not known")
        if column.evaluation:
            remarks.append("evaluation")
        least = f"{column.minimum:g}" if column.minimum > float("-inf") else ""
        cells = (f"`{name}`", column.level, f"`{column.dtype}`", f"`{column.unit}`")
        yield f"| {' | '.join((*cells, column.long_name, least, '; '.join(remarks)))} |"
