"""``echoset calibrate``: what sensors are like, from recordings with truth."""

from __future__ import annotations

import click

from . import options


@click.command("calibrate")
@options.inputs("recordings", "REC...")
@click.option(
    "--truth",
    multiple=True,
    type=options.PATH,
    metavar="FILE|DIR",
    help="The same recording with its truth, or a folder where it is; any number of times.",
)
@click.option(
    "--stream", "streams", metavar="NAME,...", help="Streams to calibrate.  [default: all]"
)
@options.config
@options.settings
@options.output("Parameters, as YAML that 'echoset estimate --config' takes, or - for stdout.")
@click.option(
    "--plot",
    "picture",
    type=options.PATH,
    metavar="FILE",
    help="Draw the residuals as .png, .svg or .pdf.",
)
@options.overwrite
@options.logging_options
def command(
    recordings: tuple[str, ...],
    truth: tuple[str, ...],
    streams: str | None,
    config: str | None,
    settings: tuple[str, ...],
    output: str,
    picture: str | None,
    overwrite: bool,
) -> None:
    """Find what the sensors of recordings REC are like, by their truth.

    For radars latency, offsets, accuracy, detection probability (by range too), false detections
    and detections per target; for UWB noise, offsets by anchor, scale, height and rates. Each has a
    standard error, and how far the two halves of the recordings are apart; the table goes to
    stdout. Detections need no labels. Settings are reach, latency_max and others.

    \b
    echoset calibrate rec-1.h5 rec-2.h5 -o sensors.yaml --plot residuals.svg
    echoset estimate -e mbm other.h5 --config sensors.yaml -o est.h5
    """
    from ..campaign.calibrate import run

    run(recordings, truth, streams, config, settings, output, picture, overwrite)
