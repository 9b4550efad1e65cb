"""``echoset report``: tables from scores."""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click

from . import options
from .outputs import DASH, single

if TYPE_CHECKING:
    from ..models.records import Scores

_SUFFIXES = {".md": "md", ".csv": "csv", ".tex": "latex", ".html": "html", ".json": "json"}


@click.command("report")
@click.argument("scores", nargs=-1, required=True, metavar="SCORES...", type=click.Path())
@click.option(
    "--format",
    "form",
    type=click.Choice(list(_SUFFIXES.values())),
    help="Form of the tables.  [default: by suffix, else md]",
)
@click.option(
    "--by",
    metavar="NAME,...",
    help="One table with a line for each of these: scenario, recording, estimator, metric, part, "
    "time.  [default: tables of averages, errors over time and distributions]",
)
@options.output("File, or - for stdout.", default=DASH)
@options.overwrite
@options.logging_options
def command(
    scores: tuple[str, ...], form: str | None, by: str | None, output: str, overwrite: bool
) -> None:
    """Write tables of SCORES.

    Scores are pooled over the recordings of each scenario. Several files are read as one; those
    of 'estimate --timing' add the time per step.

    \b
    echoset report geo.csv ideal.csv -o report.md
    echoset report scores.csv --by estimator,part --format latex -o -
    """
    from ..metrics import pooling
    from ..metrics.table import concatenate
    from ..report import render, tables
    from .inputs import read_scores

    form = form or _SUFFIXES.get(PurePath(output).suffix, "md")
    target = single(output, form, overwrite)
    table = concatenate([read_scores(source) for source in scores])
    names = tuple(name.strip() for name in by.split(",")) if by else ()
    if "recording" not in names:
        table = pooling.pool(_unpooled(table), by_scenario=True)
    target.write_text(render(tables(table, names), form, table.provenance))


def _unpooled(scores: Scores) -> Scores:
    """The rows of single recordings, which are pooled by scenario; if there are none, all."""
    rows = [i for i, name in enumerate(scores.recording) if name != "*"]
    names = ("recording", "estimator", "metric", "part")
    numbers = ("time", "value", "n", "stderr")
    columns: dict[str, Any] = {c: tuple(getattr(scores, c)[i] for i in rows) for c in names}
    columns |= {c: getattr(scores, c)[rows] for c in numbers}
    return replace(scores, **columns) if rows else scores
