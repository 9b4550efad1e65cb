"""The classifier's network on windows of a soft map, by NumPy alone.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section III-A
and IV-B.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ....models.classifier import WINDOW, Weights
from ....models.records import Array
from .fusion import Pixels


def windows(soft: Array, where: Array, pixels: Pixels) -> Array:
    """Squares (n, 60, 60) of the soft map (ny, nx) about positions ``where`` (n, 2) [m].

    Rows run along y and columns along x, as in the map; the position is within half a pixel of
    the middle, between the pixels 29 and 30. Beyond the map is 0.
    """
    out = np.zeros((len(where), WINDOW, WINDOW), np.float32)
    shape, n = np.array(soft.shape), np.arange(WINDOW)
    corner = np.rint((where - (pixels.x0, pixels.y0)) / pixels.cell) - WINDOW // 2
    corner = np.clip(corner, -WINDOW, shape[::-1]).astype(int)
    for k, (x, y) in enumerate(corner):
        row, column = y + n, x + n
        rows, columns = ((row >= 0) & (row < shape[0])), ((column >= 0) & (column < shape[1]))
        out[k][np.ix_(rows, columns)] = soft[np.ix_(row[rows], column[columns])]
    return out


def scaled(windows: Array, mean: float = 0.0, std: float = 1.0) -> Array:
    """What the network sees of powers: (log10(1 + L) - mean) / std, float32."""
    return ((np.log10(1 + windows.astype(np.float32)) - np.float32(mean)) / np.float32(std)).astype(
        np.float32
    )


def probabilities(weights: Weights, windows: Array) -> Array:
    """Probabilities (n, 2) of the classes of the powers in ``windows`` (n, 60, 60)."""
    x = scaled(windows, weights.mean, weights.std)
    kernel = weights.conv_weight[:, 0]
    filters, side = kernel.shape[:2]
    pooled = (x.shape[1] - side + 1) // 2
    patches = sliding_window_view(x, (side, side), axis=(1, 2))
    columns = patches.reshape(-1, side * side)
    y = columns @ kernel.reshape(filters, -1).T
    # Maximum, bias and ReLU keep the order of numbers: the maximum first leaves a quarter to do.
    y = y.reshape(-1, pooled, 2, pooled, 2, filters).max((2, 4))
    y = np.maximum(y + weights.conv_bias, 0)
    y = y.transpose(0, 3, 1, 2).reshape(len(x), filters * pooled**2)
    score = (y @ weights.fc_weight.T + weights.fc_bias).astype(float)
    e = np.exp(score - score.max(1, keepdims=True))
    return np.asarray(e / e.sum(1, keepdims=True))
