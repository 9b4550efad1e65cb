"""The network against loops over its definition, and against a number by hand."""

import numpy as np

from echoset.estimators.maps.kernels import cnn
from echoset.models.classifier import SHAPES, Weights


def weights(rng, scale=0.05):
    a = {k: (scale * rng.normal(size=s)).astype(np.float32) for k, s in SHAPES.items()}
    return Weights.of({**a, "mean": np.float32(1.2), "std": np.float32(0.7)})


def naive(w, window):
    """One window, one output at a time, in double precision."""
    x = (np.log10(1 + window.astype(float)) - w.mean) / w.std
    pooled = np.zeros((20, 28, 28))
    for f in range(20):
        response = np.zeros((56, 56))
        for a in range(5):
            for b in range(5):
                response += float(w.conv_weight[f, 0, a, b]) * x[a : a + 56, b : b + 56]
        response = np.maximum(response + w.conv_bias[f], 0)
        for i in range(28):
            for j in range(28):
                pooled[f, i, j] = response[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].max()
    score = [w.fc_bias[c] + (w.fc_weight[c].astype(float) * pooled.ravel()).sum() for c in (0, 1)]
    return np.exp(score) / np.exp(score).sum()


def test_the_network_is_its_definition():
    rng = np.random.default_rng(0)
    w = weights(rng, 0.02)
    windows = (10 ** (rng.random((6, 60, 60)) * rng.uniform(0, 6, (6, 1, 1)))).astype(np.float32)
    p = cnn.probabilities(w, windows)
    assert p.shape == (6, 2) and np.ptp(p[:, 0]) > 0.1
    np.testing.assert_allclose(p, [naive(w, window) for window in windows], atol=2e-5)


def test_a_number_by_hand():
    a = {k: np.zeros(s, np.float32) for k, s in SHAPES.items() if k not in ("mean", "std")}
    a["conv_weight"][3, 0, 1, 4] = 2.0
    a["conv_bias"][3] = -1.0
    # The filter sees pixel (i + 1, j + 4) at (i, j): 99 there gives 2 log10(100) - 1 = 3. Pixel
    # (21, 34) is at (20, 30), which is pooled to (10, 15).
    a["fc_weight"][1, (3 * 28 + 10) * 28 + 15] = 0.5
    window = np.zeros((1, 60, 60), np.float32)
    window[0, 21, 34] = 99.0
    np.testing.assert_allclose(
        cnn.probabilities(Weights.of(a), window),
        [[1 / (1 + np.exp(1.5)), 1 / (1 + np.exp(-1.5))]],
        rtol=1e-6,
    )


def test_no_window_and_extreme_ones():
    w = weights(np.random.default_rng(1), 10.0)
    assert cnn.probabilities(w, np.zeros((0, 60, 60), np.float32)).shape == (0, 2)
    p = cnn.probabilities(w, np.full((1, 60, 60), 3e38, np.float32))
    assert np.isfinite(p).all() and p.sum() == 1
