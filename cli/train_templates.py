"""``echoset train-templates``: what pedestrians and vehicles reflect, from maps with truth."""

from __future__ import annotations

import click

from . import options


@click.command("train-templates")
@click.argument("recordings", nargs=-1, required=True, metavar="IN...", type=options.PATH)
@options.settings
@options.output("File of the parameters, .yaml.")
@options.overwrite
@options.logging_options
def command(
    recordings: tuple[str, ...], settings: tuple[str, ...], output: str, overwrite: bool
) -> None:
    """Learn the bodies that tbd looks for from recordings with truth.

    Sizes and cross sections for which the maps are most likely; tried on the last of the
    recordings, apart. Settings are those of the training, as '--set scans=50'. Use them by
    'echoset estimate -e tbd --config FILE'.

    \b
    echoset train-templates a.h5 b.h5 c.h5 -o bodies.yaml
    """
    from ..campaign.train import train_templates

    train_templates(recordings, output, settings, overwrite)
