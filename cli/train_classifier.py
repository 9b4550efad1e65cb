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
    from pathlib import Path

    from ..campaign import progress
    from ..campaign.layers import layers
    from ..campaign.outputs import say
    from ..campaign.scenarios import find
    from ..control import training
    from ..formats import weights as archive
    from ..formats.atomic import refuse_existing
    from ..models.errors import ParameterError
    from ..models.parameters import resolve
    from ..simulate import jsc

    path = Path(output)
    if path.suffix != ".npz":
        raise ParameterError(f"-o {output}: weights are written as .npz")
    refuse_existing(path, overwrite)
    training.require_torch()
    params = resolve(training.Params, *layers(None, settings))
    found = find(scenario)
    if found.module is not jsc:
        raise ParameterError(f"--scenario {scenario}: has no range-angle maps")
    scene = resolve(jsc.Params, *found.layers)
    progress.announce_compilation()
    learn, test = training.data(scene, params, seed, progress.bar)
    weights = training.train(learn, params, seed, progress.bar)
    archive.write(path, weights, overwrite)
    say("stations  accuracy  stderr  windows")
    for a in training.evaluate(weights, test):
        say(f"{a.stations:8d}  {a.share:8.4f}  {a.stderr:6.4f}  {a.windows:7d}")
