"""The proposal of the bias: twins are equal and the weights make up for the choice."""

from __future__ import annotations

import numpy as np

from echoset.estimators.eopda.kernels import bias_proposal as definition
from echoset.estimators.eopda.kernels.compiled import bias_proposal as compiled

ANCHORS = np.array([[4.0, 4.5, 0.0], [0.0, 0.5, 1.0], [6.5, 0.0, 0.2]])


def arguments(rng: np.random.Generator, n: int, tries: int):
    """Particles about (3, 2) with candidates, and two active links."""
    centre = np.array([[3.0], [2.0]]) + 0.05 * rng.normal(size=(2, n))
    length, angle = rng.uniform(0.1, 0.4, (tries, n)), rng.uniform(-3.0, 3.0, (tries, n))
    z = np.concatenate((np.hypot(1.2, 2.3) + 0.1 * rng.normal(size=5), rng.uniform(2.0, 4.0, 6)))
    links = (np.array([0, 2]), np.array([0, 5, 11]), z, np.full(11, 0.05**2))
    return (
        centre,
        0.5 * rng.random(n),
        length,
        angle,
        rng.random(n),
        ANCHORS,
        *links,
        0.01 * rng.normal(size=(2, n)),
        0.001 * rng.random((2, n)),
        1.0,
        1.0,
    )


def test_twins_are_equal():
    rng = np.random.default_rng(1)
    for tries in (1, 4, 7):
        values = arguments(rng, 200, tries)
        for a, b in zip(
            definition.propose_bias(*values), compiled.propose_bias(*values), strict=True
        ):
            assert np.allclose(a, b, rtol=1e-9, atol=1e-9)


def test_weights_make_up_for_the_choice():
    """Averaged over ``pick``, weight times any function of the bias is its mean over candidates."""
    n, tries = 20_000, 4
    centre, height, length, angle, _, *rest = arguments(np.random.default_rng(2), 1, tries)
    one = [np.tile(a, n) for a in (centre, height)]
    many = [np.tile(a, n) for a in (length, angle)]
    rest[-4:-2] = [np.tile(a, n) for a in rest[-4:-2]]
    kept, _, correction = compiled.propose_bias(*one, *many, (np.arange(n) + 0.5) / n, *rest)
    for function in (np.ones_like, np.square):
        weighed = (np.exp(correction) * function(kept)).mean()
        worst = np.exp(correction).max() * tries / n
        assert abs(weighed - function(length).mean()) < worst


def test_without_links_the_first_candidates_are_as_good_as_any():
    centre, shift, length, angle, pick, *_ = arguments(np.random.default_rng(3), 50, 1)
    none = (np.zeros(0, int), np.zeros(1, int), *np.zeros((2, 0)), *np.zeros((2, 0, 50)))
    for module in (definition, compiled):
        kept = module.propose_bias(centre, shift, length, angle, pick, ANCHORS, *none, 1.0, 1.0)
        assert (kept[0] == length[0]).all() and (kept[1] == angle[0]).all()
        assert (kept[2] == 0.0).all()
