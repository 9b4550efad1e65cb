"""``echoset report``: tables from scores."""

from __future__ import annotations

from pathlib import PurePath

import click

from ..campaign.files.outputs import DASH, single
from . import options

_SUFFIXES = {".md": "md", ".csv": "csv", ".tex": "latex", ".html": "html", ".json": "json"}


@click.command("report")
@click.argument("scores", nargs=-1, required=True, metavar="SCORES...", type=options.PATH)
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
    of 'estimate --timing' add the time per step. HTML is one page without outside parts, which says
    first of each scenario which estimator is best and by how much; with the extra echoset[plot] it
    has all the plots that the scores allow.

    \b
    echoset report geo.csv ideal.csv -o report.md
    echoset report scores.csv --by estimator,part --format latex -o -
    echoset report scores.csv -o report.html
    """
    from ..campaign.files.inputs import read_scores
    from ..campaign.pictures import pooled, portraits, warn_of_few
    from ..models.records import Scores
    from ..report import gaps, headlines, page, render, tables
    from ..report.plots import Inputs

    form = form or _SUFFIXES.get(PurePath(output).suffix, "md")
    target = single(output, form, overwrite, scores)
    table = Scores.join([read_scores(source) for source in scores])
    names = tuple(name.strip() for name in by.split(",")) if by else ()
    warn_of_few(table)
    found = Inputs(scores=table, pooled=pooled(table))
    made = tables(table if "recording" in names else found.tables[1], names)
    if form == "html":
        said = headlines(*found.tables)
        text = page(made, table.provenance, portraits(found), gaps(table), said)
    else:
        text = render(made, form, table.provenance)
    target.write_text(text)
