"""The classifier of pedestrians and vehicles: a small convolutional network on soft maps.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section IV-B:
20 filters 5 x 5, ReLU, maximum over 2 x 2, one fully connected layer, softmax.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .records import Array

CLASSES = ("pedestrian", "vehicle")
"""Their names, in the order of the network's outputs."""
TRAINED = (0.5, 0.5)
"""Their shares among what the network learns from: as many of one as of the other."""
WINDOW = 60
"""Pixels along a side of a window: 6 m."""
CELL = 0.1
"""Side of a pixel [m]."""
FILTERS, KERNEL = 20, 5
POOLED = (WINDOW - KERNEL + 1) // 2
SHAPES: dict[str, tuple[int, ...]] = {
    "conv_weight": (FILTERS, 1, KERNEL, KERNEL),
    "conv_bias": (FILTERS,),
    "fc_weight": (len(CLASSES), FILTERS * POOLED**2),
    "fc_bias": (len(CLASSES),),
    "mean": (),
    "std": (),
}
"""Shape of each array of weights; ``mean`` and ``std`` may be absent."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Arrays float32 with the :data:`SHAPES`; ``fc_weight`` counts (filter, row, column).

    The network sees (log10(1 + L) - mean) / std of the powers L of a window. ``made`` says how they
    were learnt, in words of JSON; empty if nobody has said.
    """

    conv_weight: Array
    conv_bias: Array
    fc_weight: Array
    fc_bias: Array
    mean: float = 0.0
    std: float = 1.0
    made: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def of(arrays: Mapping[str, Array]) -> Weights:
        """The weights with these names; ``mean`` and ``std`` may be absent."""
        conv_weight, conv_bias, fc_weight, fc_bias = (arrays[name] for name in list(SHAPES)[:4])
        mean, std = float(arrays.get("mean", 0.0)), float(arrays.get("std", 1.0))
        return Weights(conv_weight, conv_bias, fc_weight, fc_bias, mean, std)

    def arrays(self) -> dict[str, Array]:
        """All weights by name."""
        return {name: np.asarray(getattr(self, name), np.float32) for name in SHAPES}
