"""Pedestrians who are followed as one become two where map and network say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.maps.kernels.fusion import Pixels
from echoset.estimators.maps.pairs import halves, split
from echoset.estimators.maps.params import MapParams
from echoset.models.errors import ParameterError

PIXELS = Pixels.of((-20.0, 20.0, -20.0, 20.0), 0.1)
PARAMS = MapParams(pair=(1.5, 3.5))


def soft(*spots: tuple[float, float], power: float = 1e4) -> np.ndarray:
    """A map with a round spot of 0.3 m at each place."""
    x, y = PIXELS.centres().T.reshape(2, PIXELS.ny, PIXELS.nx)
    found = sum(np.exp(-0.5 * ((x - a) ** 2 + (y - b) ** 2) / 0.3**2) for a, b in spots)
    return np.asarray(power * found, np.float32)


def told(pedestrian: float):
    return lambda time_ns, soft, where: np.tile((pedestrian, 1 - pedestrian), (len(where), 1))


def test_halves_are_the_centres_of_two_clouds():
    rng = np.random.default_rng(3)
    for angle in (0.0, 1.0, 2.5):
        apart = np.array([np.cos(angle), np.sin(angle)])
        clouds = [m * apart + rng.normal(0, 0.2, (60, 2)) for m in (-1.2, 1.2)]
        found = halves(np.concatenate(clouds))
        expected = np.array([c.mean(0) for c in clouds])
        order = np.argsort(found @ apart)
        np.testing.assert_allclose(found[order], expected, atol=1e-9)
    np.testing.assert_array_equal(halves(np.array([[1.0, 2.0]])), [[1.0, 2.0]] * 2)


def test_a_pair_is_two_and_the_others_stay():
    where, kind = np.array([[0.0, 0.1], [9.0, 9.0], [-9.0, 0.0]]), np.array([0, 0, 1])
    here = soft((-1.1, 0.0), (1.1, 0.0), (9.0, 9.0), (-9.0, 1.1), (-9.0, -1.1))
    found, kinds = split(PARAMS, PIXELS, 1.0, told(0.99), 0, here, where, kind)
    assert kinds.tolist() == [0, 0, 1, 0]
    np.testing.assert_array_equal(found[1:3], where[1:])
    both = found[np.argsort(found[:, 0])][1:3]
    np.testing.assert_allclose(both, [[-1.1, 0.0], [1.1, 0.0]], atol=0.05)


@pytest.mark.parametrize(
    ("spots", "pedestrian", "pair", "kind"),
    [
        (((-1.1, 0.0), (1.1, 0.0)), 0.85, (1.5, 3.5), 0),
        (((-1.1, 0.0), (1.1, 0.0)), 0.99, (0.0, 0.0), 0),
        (((-1.1, 0.0), (1.1, 0.0)), 0.99, (1.5, 3.5), 1),
        (((-0.6, 0.0), (0.6, 0.0)), 0.99, (1.5, 3.5), 0),
        (((-2.0, 0.0), (2.0, 0.0)), 0.99, (1.5, 3.5), 0),
        (((0.0, 0.0),), 0.99, (1.5, 3.5), 0),
        ((), 0.99, (1.5, 3.5), 0),
    ],
    ids=["unsure", "off", "vehicle", "close", "far", "one", "nothing"],
)
def test_what_is_no_pair_stays_one(spots, pedestrian, pair, kind):
    params = MapParams(pair=pair)
    where, kinds = np.zeros((1, 2)), np.array([kind])
    here = soft(*spots) if spots else np.zeros((PIXELS.ny, PIXELS.nx), np.float32)
    found = split(params, PIXELS, 1.0, told(pedestrian), 0, here, where, kinds)
    np.testing.assert_array_equal(found[0], where)
    assert found[1].tolist() == [kind]


def test_sidelobes_and_few_pixels_part_nothing():
    spot, weak = soft((0.0, 0.0)), soft((2.0, 0.0), power=2500.0)
    where, kind = np.zeros((1, 2)), np.array([0])
    assert len(split(PARAMS, PIXELS, 1.0, told(0.99), 0, spot + weak, where, kind)[0]) == 1
    as_bright = soft((0.0, 0.0), (2.0, 0.0))
    assert len(split(PARAMS, PIXELS, 1.0, told(0.99), 0, as_bright, where, kind)[0]) == 2
    few = np.zeros_like(spot)
    few[200, [190, 191, 209, 210]] = 1e4
    assert len(split(PARAMS, PIXELS, 1.0, told(0.99), 0, few, where, kind)[0]) == 1


def test_no_half_where_another_target_is():
    params = replace(PARAMS, room_pedestrian=0.65)
    here = soft((-1.1, 0.0), (1.1, 0.0))
    where, kind = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([0, 0])
    assert len(split(params, PIXELS, 1.0, told(0.99), 0, here, where[:1], kind[:1])[0]) == 2
    assert len(split(params, PIXELS, 1.0, told(0.99), 0, here, where, kind)[0]) == 2


def test_a_pair_within_the_room_of_one_is_refused():
    with pytest.raises(ParameterError, match="at least twice room_pedestrian"):
        replace(PARAMS, room_pedestrian=0.8)
