"""``echoset plot``: pictures of recordings, estimates and scores."""

from __future__ import annotations

from pathlib import PurePath

import click

from ..campaign.files.outputs import DASH, single
from ..models.errors import ParameterError
from . import options

GROUP = "echoset.plots"


@click.command("plot")
@click.argument("kind", type=options.Name(GROUP))
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT...", type=options.PATH)
@options.output("Picture, .png, .svg or .pdf.")
@click.option("--size", metavar="WxH", help="Width and height in cm.  [default: the kind's own]")
@click.option(
    "--time",
    "span",
    metavar="T|START:STOP",
    help="Draw this time or span, in seconds.  [default: all; of maps the last]",
)
@click.option(
    "--estimator",
    "estimators",
    metavar="NAME,...",
    help="Draw these estimators alone, beside truth and bounds.",
)
@options.overwrite
@options.logging_options
def command(
    kind: str,
    inputs: tuple[str, ...],
    output: str,
    size: str | None,
    span: str | None,
    estimators: str | None,
    overwrite: bool,
) -> None:
    """Draw a picture of INPUT: recordings, estimates, scores.

    KIND is a name from 'echoset list plots'; which inputs it takes says its error, or its line
    there. Equal inputs give equal bytes. Needs the extra echoset[plot].

    \b
    echoset plot scene rec.h5 est.h5 -o scene.svg
    echoset plot rmse scores.csv rec.h5 -o rmse.pdf --size 8.8x7
    """
    from ..campaign.pictures import describe, gather
    from ..report import plots

    suffix = PurePath(output).suffix
    if output == DASH or suffix not in plots.FORMATS:
        raise ParameterError(f"-o {output}: pictures are written as .png, .svg or .pdf")
    target = single(output, plots.FORMATS[suffix], overwrite, inputs)
    names = tuple(name.strip() for name in estimators.split(",")) if estimators else ()
    chosen = plots.Selection(*_span(span)) if span else plots.Selection()
    asked = _size(size) if size else None
    found = gather(inputs)
    made = plots.figure(kind, found, chosen, asked, names)
    target.write_bytes(plots.save(made, target.format, describe(kind, found)))


def _span(text: str) -> tuple[float, float]:
    """Start and stop of ``T`` or ``START:STOP`` [s]; either end may be left out."""
    start, colon, stop = text.partition(":")
    try:
        ends = (float(start or "-inf"), float(stop or "inf")) if colon else (float(start),) * 2
    except ValueError:
        raise ParameterError(f"--time must be T or START:STOP, got {text!r}") from None
    if not ends[0] <= ends[1]:
        raise ParameterError(f"--time {text}: must not end before it starts")
    return ends


def _size(text: str) -> tuple[float, float]:
    """Width and height of ``WxH`` [cm]."""
    try:
        width, height = map(float, text.split("x"))
    except ValueError:
        width = height = 0.0
    if not (2 <= width <= 200 and 2 <= height <= 200):
        raise ParameterError(f"--size must be WxH from 2 to 200 cm, got {text!r}")
    return width, height
