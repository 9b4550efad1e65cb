"""Training of the classifier of pedestrians and vehicles, with PyTorch.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section IV-B:
one convolution of 20 filters 5 x 5, ReLU, maximum over 2 x 2, one fully connected layer, softmax.
On one thread the same seed gives the same weights on the same version of PyTorch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..estimators.maps.evidence import LEAST
from ..estimators.maps.kernels.cnn import probabilities, scaled
from ..models.classifier import CLASSES, FILTERS, KERNEL, POOLED, Weights
from ..models.errors import ParameterError
from ..models.parameters import as_dict, parameter, require
from ..models.records import Array
from ..simulate import jsc
from .windows import Windows, join, scenes

Watch = Callable[[Iterable[Any], str, int], Iterable[Any]]
"""What shows progress: (items, their name, how many) -> the items."""
STAGES = "train", "test"
"""What windows are for."""


@dataclass(frozen=True, slots=True)
class Params:
    """Scenes to learn from and to test on, and how to learn."""

    scenes: int = parameter(600, "1", "scenes to train on", within="[1, inf)")
    held_out: int = parameter(200, "1", "scenes to test on", within="[1, inf)")
    scans: int = parameter(10, "1", "scans of a scene, spread over its time", within="[1, inf)")
    eirp: tuple[float, float] = parameter(
        (20.0, 50.0), "dBm", "power of a scene's stations, uniform between these"
    )
    circle: tuple[float, float] = parameter(
        (0.7, 1.2),
        "1",
        "distances of a scene's stations from the middle of the area over those of the scenario, "
        "uniform between these, the same for all of a scene",
        within="(0, inf)",
    )
    displacement: float = parameter(
        0.5, "m", "standard deviation sigma_w of the windows' middle", within="[0, inf)"
    )
    epochs: int = parameter(8, "1", "passes over the training set", within="[1, inf)")
    batch: int = parameter(64, "1", "windows in a step", within="[1, inf)")
    learning_rate: float = parameter(
        1e-3, "1", "of Adam, falling to zero along a cosine", within="(0, inf)"
    )
    weight_decay: float = parameter(1e-2, "1", "decoupled (AdamW)", within="[0, inf)")

    def __post_init__(self) -> None:
        for name in ("eirp", "circle"):
            low, high = getattr(self, name)
            require(low <= high, name, "in order", (low, high))


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Share of right classes with ``stations`` stations; its error is one over scenes.

    ``log_loss`` is the mean of -log p of the true class [nats].
    """

    stations: int
    share: float
    stderr: float
    log_loss: float
    windows: int


def require_torch() -> Any:
    """PyTorch.

    Raises
    ------
    ParameterError : it is not installed
    """
    try:
        import torch
    except ImportError as error:
        raise ParameterError("training needs PyTorch: pip install 'echoset[train]'") from error
    return torch


def data(scene: jsc.Params, params: Params, seed: int, watch: Watch) -> tuple[Windows, Windows]:
    """Windows to train on and to test on; no scene is in both, nor its random streams."""
    found = []
    for stage, count in zip(STAGES, (params.scenes, params.held_out), strict=True):
        key = f"classifier:{stage}"
        some = scenes(
            scene, range(count), seed, key, params.scans, params.displacement,
            params.eirp, params.circle,
        )  # fmt: skip
        found.append(join(watch(some, f"{stage} scene", count)))
    return found[0], found[1]


def story(
    scenario: str,
    scene: jsc.Params,
    params: Params,
    seed: int,
    learnt: tuple[Windows, Windows],
    found: Iterable[Accuracy],
) -> dict[str, Any]:
    """How weights were made: in which scenes, with which seed, and how good they are.

    ``learnt`` are the windows of :func:`data`, of which digests are stated.
    """
    by = {str(a.stations): a for a in found}
    return {
        "what": "pedestrians and vehicles in range-angle maps",
        "scenario": scenario,
        "scene": as_dict(scene),
        "settings": as_dict(params),
        "seed": seed,
        "streams": {f"classifier:{s}": w.sha256 for s, w in zip(STAGES, learnt, strict=True)},
        "accuracy by stations": {n: [round(a.share, 4), round(a.stderr, 4)] for n, a in by.items()},
        "log loss by stations": {n: round(a.log_loss, 4) for n, a in by.items()},
        "versions": {"torch": require_torch().__version__},
    }


def train(windows: Windows, params: Params, seed: int, watch: Watch) -> Weights:
    """Weights learnt from ``windows``.

    Raises
    ------
    ParameterError : PyTorch is not installed
    """
    torch = require_torch()
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    x = scaled(windows.power)
    mean, std = float(x.mean()), float(x.std())
    inputs = torch.from_numpy(scaled(windows.power, mean, std)[:, None])
    targets = torch.from_numpy(windows.kind.astype(np.int64))
    network = torch.nn.Sequential(
        torch.nn.Conv2d(1, FILTERS, KERNEL),
        torch.nn.ReLU(),
        torch.nn.MaxPool2d(2),
        torch.nn.Flatten(),
        torch.nn.Linear(FILTERS * POOLED**2, len(CLASSES)),
    )
    rate = params.learning_rate
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=params.weight_decay)
    steps = params.epochs * -(-len(inputs) // params.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    loss_of = torch.nn.CrossEntropyLoss()
    for _ in watch(range(params.epochs), "epoch", params.epochs):
        order = torch.randperm(len(inputs))
        for chosen in order.split(params.batch):
            batch = _turned(inputs[chosen], torch)
            loss = loss_of(network(batch), targets[chosen])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    conv, bias, fc, fc_bias = (p.detach().numpy().copy() for p in network.parameters())
    return Weights(conv, bias, fc, fc_bias, mean, std)


def _turned(batch: Any, torch: Any) -> Any:
    """The windows turned and mirrored together, at random: the law of the scene nearly stays."""
    turn = int(torch.randint(8, (1,)))
    batch = torch.rot90(batch, turn % 4, (2, 3))
    return batch.flip(2) if turn >= 4 else batch


def evaluate(weights: Weights, windows: Windows) -> list[Accuracy]:
    """Accuracy by number of stations, by the inference that the estimators use."""
    p = _probabilities(weights, windows.power)
    right = p.argmax(1) == windows.kind
    loss = -np.log(np.maximum(p[np.arange(len(p)), windows.kind], LEAST))
    found = []
    for n in np.unique(windows.stations).tolist():
        mine = windows.stations == n
        _, scene = np.unique(windows.scene[mine], return_inverse=True)
        share, count = right[mine].mean(), np.bincount(scene)
        excess = np.bincount(scene, right[mine] - share)
        stderr = np.sqrt((excess**2).sum()) / count.sum()
        log_loss = float(loss[mine].mean())
        found.append(Accuracy(n, float(share), float(stderr), log_loss, int(mine.sum())))
    return found


def _probabilities(weights: Weights, power: Array) -> Array:
    parts = [probabilities(weights, power[k : k + 64]) for k in range(0, len(power), 64)]
    return np.concatenate(parts)
