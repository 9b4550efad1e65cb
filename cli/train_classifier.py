"""``echoset train-classifier``: the weights that tell pedestrians from vehicles."""

from __future__ import annotations

import click

from . import options


@click.command("train-classifier")
@options.seed
@options.settings
@click.option(
    "--scenario",
    default="jsc-6bs",
    show_default=True,
    type=options.Name("echoset.scenarios"),
    help="Scenario to learn in: jsc-6bs or a YAML file of its kind.",
)
@options.output("File of the weights, .npz.")
@options.overwrite
@options.logging_options
def command(
    seed: int, settings: tuple[str, ...], scenario: str, output: str, overwrite: bool
) -> None:
    """Train the network that tells pedestrians from vehicles.

    It is tested on other scenes than it learns from; the accuracy by number of stations goes to
    stdout. Needs PyTorch (pip install 'echoset[train]'). Settings are those of the training, as
    'echoset train-classifier --set scenes=50 -o quick.npz'; use the weights by
    'echoset estimate -e phd --set weights=FILE'.

    \b
    echoset train-classifier --seed 1 -o jsc_cnn.npz
    """
    from ..campaign.train import train

    train(output, scenario, seed, settings, overwrite)
