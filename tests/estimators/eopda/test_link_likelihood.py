"""The likelihood of links: the compiled twin equals the definition, which equals closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.eopda.kernels import link_likelihood as definition
from echoset.estimators.eopda.kernels.compiled import link_likelihood as compiled
from echoset.estimators.kernels.compiled.gauss import exp_negative
from echoset.models.scatter import unit_square_nodes

ANCHORS = np.array([[4.0, 4.5, 0.0], [0.0, 0.5, 2.0], [6.5, 0.0, 1.0]])
NONE = (np.zeros((0, 0)), np.zeros((0, 0)))
OPENING = 2 * np.pi / 3
NAMES = ("geo", "centre", "ideal", "point")


def particles(rng: np.random.Generator, n: int = 150):
    """Centre, device, height, semi-axes and width of particles about (3, 2)."""
    centre = np.array([[3.0], [2.0]]) + 0.1 * rng.normal(size=(2, n))
    device = centre + 0.2 * rng.normal(size=(2, n))
    height = 0.5 * rng.random(n)
    return centre, device, height, rng.uniform(0.1, 0.5, (2, n)), rng.uniform(0.01, 0.2, n)


def links(rng: np.random.Generator, counts=(3, 0, 20, 5, 1)):
    """Links in the order of receivers, 3 the device, with ranges near the object and far off."""
    tx, rx = np.array([3, 0, 1, 3, 2]), np.array([0, 0, 1, 2, 2])
    offset = np.concatenate(([0], np.cumsum(counts)))
    z = np.concatenate([rng.uniform(1.0, 9.0, c) for c in counts])
    return tx, rx, offset, z, rng.uniform(0.01, 0.2, len(z)) ** 2


def likelihood(module, name, state, links, excess=NONE, clutter=0.25, los=1.0, scatter=5.0):
    """Any of the likelihoods by name."""
    centre, device, height, axes, width = state
    common = (centre, device, height, ANCHORS, *links, *excess, clutter)
    if name == "point":
        return module.point(*common, 0.9)
    if name == "ideal":
        nodes = unit_square_nodes(50)
        return module.ideal(*common, los, scatter, axes, width, OPENING, *nodes)
    return module.geo(*common, los, scatter, axes[0], width, OPENING, name == "geo")


@pytest.mark.parametrize("name", NAMES)
def test_twins_are_equal(name):
    rng = np.random.default_rng(1)
    for n in (1, 127, 128, 300):
        state, ranges = particles(rng, n), links(rng)
        for excess in (NONE, (0.1 * rng.normal(size=(5, n)), 0.01 * rng.random((5, n)))):
            expected = likelihood(definition, name, state, ranges, excess)
            value = likelihood(compiled, name, state, ranges, excess)
            assert np.allclose(value, expected, rtol=0, atol=1e-9)


def test_exponential_is_accurate():
    t = np.linspace(0.0, 31.9, 1000)
    value = np.array([exp_negative(x) for x in t])
    assert np.allclose(value, np.exp(-t), rtol=5e-7)
    assert np.allclose(value[t < 8], np.exp(-t[t < 8]), rtol=1e-12)
    assert exp_negative(32.0) == 0.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("module", [definition, compiled])
def test_order_of_links_and_ranges_does_not_matter(name, module):
    rng = np.random.default_rng(2)
    state = particles(rng)
    tx, rx, offset, z, variance = links(rng)
    expected = likelihood(module, name, state, (tx, rx, offset, z, variance))
    order = np.array([4, 1, 3, 0, 2])
    rows = np.concatenate([np.arange(offset[e], offset[e + 1])[::-1] for e in order])
    shuffled = (tx[order], rx[order], np.concatenate(([0], np.cumsum(np.diff(offset)[order]))))
    value = likelihood(module, name, state, (*shuffled, z[rows], variance[rows]))
    assert np.allclose(value, expected, atol=1e-9)


def test_a_tiny_object_scatters_one_gaussian():
    """With a vanishing extent both models are ``N(z; |p - a| + |p - a'|, sigma^2)``."""
    centre, device = np.array([[3.0], [0.0]]), np.array([[3.0], [4.0]])
    anchors = np.array([[0.0, 0.0, 0.0], [3.0, 8.0, 0.0], [0.0, 4.0, 0.0]])
    tx, rx = np.array([1, 3]), np.array([0, 2])
    ranges = (tx, rx, np.array([0, 1, 2]), np.array([11.1, 3.2]), np.array([0.01, 0.04]))
    passive = 0.25 + 5 * np.exp(-0.5) / np.sqrt(2 * np.pi * 0.01)
    # device to centre 4 m, centre to A3 5 m: only the direct path of 3 m is near 3.2 m
    active = 0.25 + np.exp(-0.5) / np.sqrt(2 * np.pi * 0.04)
    small, zero = np.full((2, 1), 1e-7), np.zeros(1)
    common = (centre, device, zero, anchors, *ranges, *NONE, 0.25, 1.0, 5.0)
    for module in (definition, compiled):
        geo = module.geo(*common, small[0], small[0], OPENING, True)
        ideal = module.ideal(*common, small, small[0], OPENING, *unit_square_nodes(7))
        assert np.allclose([geo, ideal], np.log(passive * active), atol=1e-5)


def test_point_target_has_at_most_one_range_a_link():
    centre = np.array([[3.0], [0.0]])
    anchors = np.array([[0.0, 0.0, 0.0], [3.0, 8.0, 0.0], [0.0, 4.0, 0.0]])
    one = (np.array([1]), np.array([0]), np.array([0, 2]), np.full(2, 11.0), np.full(2, 0.01))
    peak = 1 / np.sqrt(2 * np.pi * 0.01)
    for module in (definition, compiled):
        value = module.point(centre, centre, np.zeros(1), anchors, *one, *NONE, 0.25, 0.9)
        assert np.allclose(value, np.log(0.1 + 0.9 * 2 * peak / 0.25))


@pytest.mark.parametrize("name", NAMES)
def test_a_shift_moves_all_ranges(name):
    rng = np.random.default_rng(3)
    state = particles(rng)
    tx, rx, offset, z, variance = links(rng)
    shift, doubt = np.full((5, 150), 0.3), np.zeros((5, 150))
    value = likelihood(compiled, name, state, (tx, rx, offset, z + 0.3, variance), (shift, doubt))
    assert np.allclose(value, likelihood(compiled, name, state, (tx, rx, offset, z, variance)))
    wide = likelihood(
        compiled, name, state, (tx, rx, offset, z, variance), (0 * shift, doubt + 0.1)
    )
    assert np.allclose(wide, likelihood(compiled, name, state, (tx, rx, offset, z, variance + 0.1)))


@pytest.mark.parametrize("name", ("geo", "ideal", "point"))
@pytest.mark.parametrize("module", [definition, compiled])
def test_heights_lengthen_both_legs_of_a_path(name, module):
    """A device and a tiny object 3 m below one anchor, 4 m from it in the plane: 5 m away."""
    state = (np.zeros((2, 1)), np.zeros((2, 1)), np.full(1, 0.5), np.full((2, 1), 1e-7))
    anchors = np.array([[4.0, 0.0, 3.5], [0.0, 5.0, 12.5]])
    ranges = (np.array([2, 1]), np.array([0, 0]), np.array([0, 1, 2]), np.array([5.1, 18.2]))
    variance = np.full(2, 0.04)
    common = (*state[:3], anchors, *ranges, variance, *NONE, 0.25)
    active = np.exp(-(0.1**2) / 0.08) / np.sqrt(2 * np.pi * 0.04)
    passive = np.exp(-(0.2**2) / 0.08) / np.sqrt(2 * np.pi * 0.04)
    if name == "point":
        value = module.point(*common, 0.9)
        expected = np.log(0.1 + 0.9 * active / 0.25) + np.log(0.1 + 0.9 * passive / 0.25)
    else:
        scatter = (state[3][0] if name == "geo" else state[3], np.full(1, 1e-7), OPENING)
        rest = (True,) if name == "geo" else unit_square_nodes(5)
        value = getattr(module, name)(*common, 1.0, 5.0, *scatter, *rest)
        # of the scatter of the active link, 5 m long as well as the device is inside the object
        expected = np.log(0.25 + 6 * active) + np.log(0.25 + 5 * passive)
    assert np.allclose(value, expected, atol=1e-5)


@pytest.mark.parametrize("name", ("geo", "ideal"))
def test_scatter_density_integrates_to_its_mean_number(name):
    """exp(log L) - clutter over all ranges of one link integrates to scatter (and los)."""
    state = particles(np.random.default_rng(4), 20)
    z = np.arange(0.0, 20.0, 0.005)
    for tx, total in ((1, 5.0), (3, 6.0)):
        density = [
            np.exp(
                likelihood(
                    compiled,
                    name,
                    state,
                    (
                        np.array([tx]),
                        np.array([0]),
                        np.array([0, 1]),
                        z[i : i + 1],
                        np.full(1, 0.0025),
                    ),
                )
            )
            - 0.25
            for i in range(len(z))
        ]
        assert np.allclose(np.sum(density, axis=0) * 0.005, total, rtol=1e-6)
