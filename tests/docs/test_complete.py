"""Everything that there is to use is documented: what is not, a test names."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path

import click
import pytest
from mcap.reader import make_reader

from echoset import formats
from echoset.cli.describe import GROUPS
from echoset.cli.main import commands
from echoset.formats import leaves
from echoset.formats.importers.csv import mapping
from echoset.models.classifier import SHAPES
from echoset.models.columns import COLUMNS, ESTIMATES, RECORDING, REQUIRED, Leaf, declared
from echoset.models.records import Estimates, Recording, Scores

DOCS = Path(__file__).parents[2] / "docs"
KINDS = ("estimators", "scenarios", "metrics", "plots", "policies", "importers", "formats")


def subcommands() -> Iterator[tuple[str, click.Command, click.Context]]:
    """Every command by the words that call it."""
    context = click.Context(commands, info_name="echoset")
    yield "echoset", commands, context
    for name in commands.list_commands(context):
        command = commands.get_command(context, name)
        assert command is not None
        yield f"echoset {name}", command, click.Context(command, context, info_name=name)


def section(text: str, title: str) -> str:
    """The part of a page under a heading of the second level."""
    found = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text, re.M | re.S)
    assert found, f"no section {title!r}"
    return found[1]


def squeezed(text: str) -> str:
    return " ".join(text.split())


def plugins() -> Iterator[tuple[str, str, object]]:
    """Kind, name and object of every entry point of ours."""
    for point in distribution("echoset").entry_points:
        kind = point.group.removeprefix("echoset.")
        if kind in KINDS:
            yield kind, point.name, point.load()


def name_of(value: object) -> str:
    """What a test calls a parameter of its own."""
    return value if isinstance(value, str) else "-"


def test_every_kind_of_plugin_is_known() -> None:
    points = distribution("echoset").entry_points
    groups = {point.group for point in points if point.group.startswith("echoset.")}
    assert groups == {f"echoset.{kind}" for kind in (*KINDS, "readers")}


@pytest.mark.parametrize(("words", "command", "context"), list(subcommands()), ids=name_of)
def test_every_command_and_option(words, command, context, reference, written) -> None:
    part = squeezed(section(reference["commands"], words))
    if words != "echoset":
        assert re.search(rf"\b{words}\b", written), f"no page speaks of {words!r}"
    assert command.help
    for param in command.params:
        if not isinstance(param, click.Option):
            assert param.make_metavar(context) in part
            continue
        assert param.help, f"{words}: {param.opts} has no help"
        for name in (*param.opts, *param.secondary_opts):
            assert re.search(rf"{re.escape(name)}\b", part), f"{words}: {name}"
        assert squeezed(param.help.partition("\b")[0]) in part, f"{words}: {param.opts}"


@pytest.mark.parametrize(("kind", "name", "plugin"), list(plugins()), ids=name_of)
def test_every_plugin_and_parameter(kind, name, plugin, reference, written) -> None:
    shown = re.search(rf"`[^`\n]*(?<![\w-]){re.escape(name)}(?![\w-])[^`\n]*`", written)
    assert shown, f"no page speaks of {kind} {name!r}"
    part = section(reference[kind], name)
    assert plugin.SUMMARY in part
    if f"echoset.{kind}" in GROUPS:
        for field in dataclasses.fields(plugin.Params):
            assert field.metadata["doc"], f"{name}: {field.name}"
            (row,) = (r for r in part.splitlines() if r.startswith(f"| `{field.name}` |"))
            assert field.metadata["doc"] in row and field.metadata["unit"].strip("1") in row
        for preset, values in getattr(plugin, "PRESETS", {}).items():
            assert not values or f"`--preset {preset}`" in part


def test_every_column(reference) -> None:
    text, page = (DOCS / "formats.md").read_text(), reference["columns"]
    for name, column in COLUMNS.items():
        (row,) = (line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
        for word in (column.level, f"`{column.dtype}`", f"`{column.unit}`", column.long_name):
            assert word in row
        assert column.evaluation == ("evaluation" in row)
    for kind, names in REQUIRED.items():
        assert f"`{kind}`" in text and all(f"`{name}`" in text for name in names)


@pytest.mark.parametrize(
    "leaf", [*dict.fromkeys((*RECORDING, *ESTIMATES))], ids=lambda leaf: leaf.path
)
def test_every_leaf(leaf: Leaf) -> None:
    """Each has the row that its declaration gives; the objects of truth those of estimates."""
    kind = f"`{leaf.type}`" if leaf.type in ("i4", "i8", "f8") else leaf.type
    kind += f" ({', '.join(leaf.shape)})" if leaf.shape else ""
    path = leaf.path.replace("truth/objects/", "objects/")
    row = f"| `{path}` | {kind.strip()} | {leaf.unit} | {leaf.meaning} |"
    assert row in (DOCS / "formats.md").read_text().splitlines()


@pytest.mark.parametrize("suffix", ["recording", "estimates"])
def test_every_path_is_declared(suffix, recording: Recording, estimates: Estimates) -> None:
    record = recording if suffix == "recording" else estimates
    assert all(declared(path) for path in leaves.of(record))


def test_every_topic_and_schema(recording: Recording, estimates: Estimates, tmp_path: Path) -> None:
    text = (DOCS / "formats.md").read_text()
    for record in (recording, estimates):
        formats.write(record, tmp_path / "x.mcap", "mcap")
        with (tmp_path / "x.mcap").open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        for channel in summary.channels.values():
            topic = re.sub(r"^/radar/[^/]+", "/radar/<stream>", channel.topic)
            topic = re.sub(r"^/estimates/[^/]+", "/estimates/<estimator>", topic)
            assert f"`{topic}`" in text, topic
            assert f"`{summary.schemas[channel.schema_id].name}`" in text


def test_scores_weights_and_mappings(written) -> None:
    text = (DOCS / "formats.md").read_text()
    for field in dataclasses.fields(Scores):
        assert f"`{field.name}`" in text
    for name, shape in SHAPES.items():
        assert f"`{name}`" in text and ", ".join(map(str, shape)) in text
    page = (DOCS / "recordings.md").read_text()
    for field in dataclasses.fields(mapping.Mapping):
        assert f"`{field.name}`" in page, field.name
    for kind in mapping.MEASUREMENT:
        (row,) = (line for line in page.splitlines() if line.startswith(f"| `{kind}` |"))
        for name in ("time", *mapping.MEASUREMENT[kind], *mapping.OPTIONAL[kind]):
            assert f"`{name}`" in row, f"{kind}: {name}"
