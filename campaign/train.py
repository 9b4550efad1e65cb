"""What ``echoset train-classifier`` and ``echoset train-templates`` do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from ..control import templates, training
from ..formats import weights as archive
from ..formats.atomic import atomic, refuse_existing
from ..formats.provenance import versions
from ..models.errors import InputError, ParameterError
from ..models.parameters import resolve
from ..models.records import Recording
from ..simulate import jsc
from . import progress
from .files.inputs import read_any
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
    settings = tuple(settings)
    params = resolve(training.Params, *layers(None, settings))
    found = find(scenario)
    if found.module is not jsc:
        raise ParameterError(f"--scenario {scenario}: has no range-angle maps")
    scene = resolve(jsc.Params, *found.layers)
    progress.announce_compilation()
    learn, test = training.data(scene, params, seed, progress.bar)
    weights = training.train(learn, params, seed, progress.bar)
    accuracy = training.evaluate(weights, test)
    made = training.story(scenario, scene, params, seed, (learn, test), accuracy)
    made["versions"] = {**versions(), **made["versions"]}
    words = [f"--scenario {scenario} --seed {seed}", *(f"--set {text}" for text in settings)]
    made["command"] = f"echoset train-classifier {' '.join(words)}"
    archive.write(path, replace(weights, made=made), overwrite)
    say("stations  accuracy  stderr  log loss  windows")
    for a in accuracy:
        say(f"{a.stations:8d}  {a.share:8.4f}  {a.stderr:6.4f}  {a.log_loss:8.4f}  {a.windows:7d}")


def train_templates(
    files: Iterable[str], output: str, settings: Iterable[str], overwrite: bool
) -> None:
    """Learn what bodies reflect from recordings, write it to ``output`` and say what it gains.

    Raises
    ------
    ParameterError : a name or a setting that cannot be
    InputError : what is no recording, or has no truth to learn from
    OutputError : the output exists or cannot be written
    """
    path = Path(output)
    if path.suffix not in (".yaml", ".yml"):
        raise ParameterError(f"-o {output}: templates are written as .yaml")
    refuse_existing(path, overwrite)
    params = resolve(templates.Params, *layers(None, settings))
    recordings = []
    for file in files:
        found = read_any(file)
        if not isinstance(found, Recording):
            raise InputError(f"{file}: is no recording")
        recordings.append(found)
    progress.announce_compilation()
    learnt = templates.learn(recordings, params)
    software = " ".join(f"{name} {v}" for name, v in versions().items())
    lines = [
        f"# What reflects in range-angle maps, learnt by echoset train-templates ({software})",
        f"# from {' '.join(learnt.learnt_from)}, {params.scans} scans each;",
        f"# tried on {' '.join(learnt.tried_on) or 'none'}: {learnt.gain:+.2f} nats a scan.",
        *(f"{name}: {value:g}" for name, value in learnt.values.items()),
    ]
    with atomic(path, overwrite) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")
    for line in lines[3:]:
        say(line)
    say(f"{learnt.gain:+.2f} nats a scan in {len(learnt.tried_on)} recordings apart")
