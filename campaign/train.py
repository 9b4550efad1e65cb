"""The weights that tell pedestrians from vehicles: what ``echoset train-classifier`` does."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from ..control import training
from ..formats import weights as archive
from ..formats.atomic import refuse_existing
from ..formats.provenance import versions
from ..models.errors import ParameterError
from ..models.parameters import resolve
from ..simulate import jsc
from . import progress
from .files.outputs import say
from .layers import layers
from .scenarios import find


def train(output: str, scenario: str, seed: int, settings: Iterable[str], overwrite: bool) -> None:
    """Train on ``scenario``, write the weights to ``output`` and say how good they are.

    Raises
    ------
    ParameterError : a name or a setting that cannot be
    OutputError : the output exists or cannot be written
    """
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
    accuracy = training.evaluate(weights, test)
    made = training.story(scenario, scene, params, seed, accuracy)
    made["versions"] = {**versions(), **made["versions"]}
    archive.write(path, replace(weights, made=made), overwrite)
    say("stations  accuracy  stderr  windows")
    for a in accuracy:
        say(f"{a.stations:8d}  {a.share:8.4f}  {a.stderr:6.4f}  {a.windows:7d}")
